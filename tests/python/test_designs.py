"""Designs of a sweep: each is the scene with its number in it, whatever designs share."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkdyn

ROOT = Path(__file__).parents[2]
UNREACHED = ("belt_drive", "cart_pole", "double_wishbone", "flyball_governor", "hill_start", "loader_crane", "n_fourbar",
             "spatial_slider_crank", "stopped_rocker", "swing_arm", "ball_joint", "bricard", "capture")  # fewer drives than freedoms: nothing of them is swept
SCENES = [path for folder, pattern in (("examples", "*/scene.toml"), ("tests/scenes", "*.toml"))
          for path in sorted((ROOT / folder).glob(pattern)) if not {path.stem, path.parent.name} & set(UNREACHED)]
# friction, gears, belts, motors, laws, a frame that moves, cams, idle spins, screws, loops closed by iteration
QUICK = ["delta", "hoist", "knuckle_press", "planetary_crank", "screw_lift", "shaper", "ship_hexapod", "thread_guide", "valve_train",
         "belt_arm", "slotted_lever", "flat_cam_3d"]
CHANGE = 1.013


def numbers(content: Any, path: str = "") -> Iterator[tuple[str, float, str]]:
    """Path, value and unit of every number that a sweep may vary, but zeros."""
    if isinstance(content, dict):
        for key, part in content.items():
            if path or key not in ("sweep", "title", "space", "time", "view", "sheet", "include"):
                yield from numbers(part, f"{path}.{key}" if path else key)
    elif isinstance(content, list):
        for i, part in enumerate(content):
            yield from numbers(part, f"{path}.{part['name']}" if isinstance(part, dict) and "name" in part else f"{path}[{i}]")
    elif isinstance(content, int | float) and not isinstance(content, bool) and content:
        yield path, float(content), ""
    elif isinstance(content, str) and (found := re.fullmatch(r"\s*([-+]?[\d.]+(?:e[-+]?\d+)?)\s*([A-Za-z].*)?", content)) and float(found[1]):
        yield path, float(found[1]), found[2] or ""


def swept(scene: linkdyn.Scene, *axes: dict[str, Any]) -> Any:
    moving = [{"rate": scene.coordinates[0], "values": [0.3]}, {"acceleration": scene.coordinates[0], "values": [0.7]}]
    return scene.sweep({"axis": [*axes, *moving], "reduce": ["driving_force"]}, keep=["driving_force", "reaction"])


def check_all_numbers(content: dict[str, Any], folder: Path) -> int:
    """Every number in two designs, the second of which is compared with a scene of its own."""
    scene = linkdyn.Scene({key: part for key, part in content.items() if key != "sweep"}, folder=os.fspath(folder))
    n = 0
    for path, number, unit in numbers(content):
        values = [f"{x!r} {unit}" if unit else x for x in (number, CHANGE * number)]
        try:
            both = swept(scene, {"parameter": path, "values": values})
            alone = swept(scene.with_({path: values[1]}))
        except linkdyn.LinkdynError:
            continue  # no such mechanism, or no number
        for name in ("driving_force", "reaction"):
            expected = alone[name].values.ravel()
            np.testing.assert_allclose(both[name].values.reshape(2, -1)[1], expected, rtol=0, atol=1e-11 * np.nanmax(np.abs(expected), initial=1e-9),
                                       err_msg=f"{path}: {name}")
        n += 1
    return n


@pytest.mark.parametrize("path", [path for path in SCENES if {path.stem, path.parent.name} & set(QUICK)], ids=str)
def test_every_number_of_a_feature(path: Path) -> None:
    assert check_all_numbers(tomllib.loads(path.read_text()), path.parent) > 5


@pytest.mark.thorough
@pytest.mark.parametrize("path", SCENES, ids=str)
def test_every_number(path: Path) -> None:
    assert check_all_numbers(tomllib.loads(path.read_text()), path.parent) > 5


def test_shares_and_preloads() -> None:
    """How drives share the work is of each design its own."""
    content = tomllib.loads((ROOT / "examples/fourbar/scene.toml").read_text())
    content["actuator"] = [{"joint": content["actuator"][0]["joint"], "share": 1.5, "preload": "3 N*m"},
                           {"joint": content["joint"][-1]["name"], "share": 0.7, "preload": "2 N*m"}]
    assert {"actuator[0].share", "actuator[1].preload"} <= {path for path, _, _ in numbers(content)}
    check_all_numbers(content, ROOT / "examples/fourbar")


@pytest.mark.parametrize("sharing", ["minimum-norm", "stiffness"])
def test_over_constrained(sharing: str) -> None:
    """Designs that stand as the first one does let go of what that lets go of, others of what they find by themselves."""
    content = tomllib.loads((ROOT / "examples/tripteron/scene.toml").read_text()) | {"redundancy": sharing}
    if sharing == "stiffness":
        content["chain"][0]["stiffness"] = [{"radial": 1e6, "axial": 2e6, "tilt": 3e3, "torsion": 4e3}] * 4
    scene = linkdyn.Scene(content)
    for path, values in (("link.platform.mass", ["1.8 kg", "2.1 kg", "0.5 kg"]),
                         ("chain[0].links[1].mass", ["1.1 kg", "1.3 kg", "0.9 kg"]),
                         ("link.platform.markers.C.at[1]", ["-100 mm", "-103 mm", "-97 mm"])):
        designs = swept(scene, {"parameter": path, "values": values})
        for i, value in enumerate(values):
            alone = swept(scene.with_({path: value}))
            for name in ("driving_force", "reaction"):
                expected = alone[name].values.ravel()
                assert np.nanmax(np.abs(expected)) > 0.1
                np.testing.assert_allclose(designs[name].values.reshape(len(values), -1)[i], expected, rtol=0,
                                           atol=1e-11 * np.nanmax(np.abs(expected)), err_msg=f"{path}: {name}")


def test_what_no_scene_has() -> None:
    """Payloads, clutches, soft stops of measures, springs by laws over these, a pin that rubs: on one mechanism."""
    content = tomllib.loads((ROOT / "examples/fourbar/scene.toml").read_text()) | {
        "payload": [{"on": "coupler.J5", "mass": 2.0, "inertia": 0.3}, {"on": "follower.J3", "mass": 1.5, "until": "9 s"}],
        "clutch": [{"name": "rub", "joint": "J4", "capacity": 30.0},
                   {"name": "tie", "joint": "J1", "to": "J4", "ratio": 0.7, "capacity": 12.0}],
        "measures": {"height": {"marker": "coupler.J5", "component": "y"}, "gap": {"between": ["coupler.J5", "frame.J1"]}},
        "stop": [{"name": "floor", "measure": "height", "min": 50.0, "stiffness": 1000.0, "damping": 10.0},
                 {"name": "far", "measure": "gap", "max": 0.05, "stiffness": 800.0}],
        "laws": {"pull": "3 N/m*height"},
        "spring": [{"name": "air", "between": ["frame.J1", "coupler.J5"], "force": "pull"}],
        "friction": [{"joint": "J3", "coulomb": 0.2, "radius": 0.03, "creep_speed": "1 mm/s"}],
    }  # fmt: skip
    assert check_all_numbers(content, ROOT / "examples/fourbar") > 30
