"""Where links have their origins does not count: drawings of many parts share one, far from the joints."""

import copy
import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_redundancy import SPATIAL, some_poses

SCENES = Path(__file__).parents[1] / "scenes"
FAR = np.array([1.9, -2.4, 0.6])
"""From the origins as they are to those elsewhere [m]: some times the size of these mechanisms."""


def attitude(start: dict[str, Any]) -> Rotation:
    roll, pitch, yaw = (np.radians(float(a.removesuffix("deg"))) if isinstance(a, str) else a for a in start.get("angles", [0, 0, 0]))
    return Rotation.from_euler("ZYX", [yaw, pitch, roll])


def with_origins_at(scene: dict[str, Any], aside: np.ndarray) -> dict[str, Any]:
    """The same spatial mechanism: the axes of its links keep their directions."""
    moved = json.loads(json.dumps(scene))
    for link in moved["link"]:
        if "position" in (start := link.get("start", {})):
            start["position"] = (start["position"] + attitude(start).apply(aside)).tolist()
        link["cog"] = (np.array(link.get("cog", [0, 0, 0])) - aside).tolist()
        for name, marker in link["markers"].items():
            if isinstance(marker, dict):
                marker["at"] = (np.array(marker.get("at", [0, 0, 0])) - aside).tolist()
            else:
                link["markers"][name] = (np.array(marker) - aside).tolist()
    return moved


def plain(scene: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    return copy.deepcopy(scene())


@pytest.mark.parametrize("name", ["bennett", "spherical", "agile_eye", "sarrus"])
def test_shared_reactions(name: str) -> None:
    """The least sum of squares weighs moments against forces by a length of the mechanism, not of its drawing."""
    scene = plain(SPATIAL[name]) | {"redundancy": "minimum-norm"}
    q = some_poses(scene)
    near, far = (linkdyn.Scene(one).inverse(q=q, qd=0 * q, qdd=0 * q) for one in (scene, with_origins_at(scene, FAR)))
    assert not near.status.values.any()
    assert not far.status.values.any()
    np.testing.assert_allclose(far.reaction, near.reaction, rtol=0, atol=1e-9 * float(np.abs(near.reaction).max()))


def test_distance_to_singular_positions() -> None:
    scene = plain(SPATIAL["bennett"])
    q = some_poses(scene)
    near, far = (linkdyn.Scene(one).inverse(q=q, want=["singularity_distance"]) for one in (scene, with_origins_at(scene, FAR)))
    assert far.singularity_distance.attrs.get("length") == pytest.approx(near.singularity_distance.attrs.get("length"), rel=1e-12)


def test_loops_closed_by_iteration() -> None:
    """A run of an arm that a screw lifts: no sample is called singular for its drawing's sake."""
    scene = tomllib.loads((SCENES / "screw_loop.toml").read_text(encoding="utf-8"))
    t = np.linspace(0, 2, 41)
    for one in (scene, with_origins_at(scene, FAR)):
        opened = linkdyn.Scene(one)
        assert not opened.inverse(t=t).status.values.any()
        assert not opened.forward(t=t).status.values.any()


LEAD = 0.005


def jack(start: float) -> dict[str, Any]:
    """A boom on a spindle between a universal joint and a ball, drawn closed with the boom at zero."""
    slope = np.arctan2(0.2, 0.4)
    nut = (np.array([0.3, 0, 0]) + 0.2 * np.array([np.sin(slope), 0, np.cos(slope)])).tolist()
    links = [
        {"name": "boom", "mass": 12.0, "cog": [0.3, 0, 0], "inertia": [0.1, 0.8, 0.8, 0, 0, 0], "start": {"position": [0, 0, 0.3]},
         "markers": {"R": {"at": [0, 0, 0], "axis": [0, 1, 0]}, "S": [0.5, 0, 0.1]}},
        {"name": "housing", "mass": 2, "cog": [0, 0, 0.1], "inertia": [0.01, 0.01, 0.002, 0, 0, 0],
         "start": {"position": [0.3, 0, 0], "angles": [0, slope, 0]}, "markers": {"U": {"at": [0, 0, 0], "axis": [1, 0, 0]}, "G": [0, 0, 0.2]}},
        {"name": "nut", "mass": 1, "cog": [0, 0, 0.1], "inertia": [0.005, 0.005, 0.001, 0, 0, 0],
         "start": {"position": nut, "angles": [0, slope, 0]}, "markers": {"G": [0, 0, 0], "S": [0, 0, float(np.hypot(0.2, 0.4)) - 0.2]}},
    ]
    joints = [
        {"name": "R", "type": "revolute", "between": ["frame.R", "boom.R"]},
        {"name": "U", "type": "universal", "between": ["frame.U", "housing.U"]},
        {"name": "G", "type": "screw", "between": ["housing.G", "nut.G"], "lead": LEAD},
        {"name": "S", "type": "spherical", "between": ["nut.S", "boom.S"]},
    ]
    return {"title": "boom on a screw", "space": "spatial", "gravity": [0, 0, -9.81], "link": links, "joint": joints,
            "frame": {"markers": {"R": {"at": [0, 0, 0.3], "axis": [0, 1, 0]}, "U": {"at": [0.3, 0, 0], "axis": [0, 1, 0]}}},
            "coordinate": [{"joint": "R", "start": start}], "actuator": [{"joint": "G"}]}


def drawn_in_place(scene: dict[str, Any]) -> dict[str, Any]:
    """All links measured from the origin of the drawing, as CAD has them."""
    moved = copy.deepcopy(scene)
    for link in moved["link"]:
        start = link.pop("start")
        link["start"] = {}
        turn = attitude(start)
        where = np.array(start.get("position", [0, 0, 0]))
        link["cog"] = (where + turn.apply(link["cog"])).tolist()
        for name, marker in link["markers"].items():
            given = marker if isinstance(marker, dict) else {"at": marker}
            link["markers"][name] = {"at": (where + turn.apply(given["at"])).tolist(),
                                     "axis": turn.apply(given.get("axis", [0, 0, 1])).tolist()}
    return moved


def angle_at_start(scene: dict[str, Any], variable: str) -> float:
    run = linkdyn.Scene(scene).inverse(want=["joint_variable"])
    assert not run.status.values.any()
    return float(run.joint_variable.sel(variable=variable)[0])


@pytest.mark.parametrize("degrees", [3.0, 10.0, -10.0, 20.0])
def test_start_of_a_screw_jack(degrees: float) -> None:
    """A nut turns many times as the boom moves off where it is drawn; its origin beside the spindle's line goes round with it."""
    boom = np.radians(degrees)
    ball = np.array([0.5 * np.cos(boom) + 0.1 * np.sin(boom) - 0.3, 0.3 - 0.5 * np.sin(boom) + 0.1 * np.cos(boom)])
    expected = (np.hypot(*ball) - np.hypot(0.2, 0.4)) * 2 * np.pi / LEAD
    scene = jack(boom)
    for one in (scene, with_origins_at(scene, np.array([0, 0.1, 0])), with_origins_at(scene, FAR), drawn_in_place(scene)):
        assert angle_at_start(one, "G.angle") == pytest.approx(expected, rel=1e-9)


def test_motion_of_a_screw_jack() -> None:
    """Fifteen turns of its screw along a motion: forces, too, are those of a nut whose origin is on the spindle."""
    motion = {"joint": "R", "motion": {"law": "polynomial-345", "from": 0.0, "to": "-10 deg", "duration": 1.0}}
    scene = jack(0.0) | {"coordinate": [motion], "time": {"samples": 301}}
    runs = [linkdyn.Scene(one).inverse() for one in (scene, with_origins_at(scene, np.array([0, 0.1, 0])), with_origins_at(scene, FAR))]
    for run in runs:
        assert not run.status.values.any()
        np.testing.assert_allclose(run.driving_force, runs[0].driving_force, rtol=0, atol=1e-8 * float(np.abs(runs[0].driving_force).max()))


def test_start_led_by_the_screw_of_a_jack() -> None:
    """The boom at twenty degrees, as the angle of its screw says it."""
    scene = jack(0.0) | {"coordinate": [{"joint": "G", "start": -182.18}]}
    for one in (scene, with_origins_at(scene, FAR), drawn_in_place(scene)):
        assert angle_at_start(one, "R.angle") == pytest.approx(np.radians(20), abs=1e-4)


@pytest.mark.parametrize("start", [0.01, -0.02, 0.05])
def test_start_of_a_screw_that_is_carried(start: float) -> None:
    """A screw adjusts a loop that turns with its arm: taken along by half a lead or more, it is not turned."""
    scene = tomllib.loads((Path(__file__).parent / "scenes" / "adjusting_screw.toml").read_text(encoding="utf-8"))
    scene["coordinate"][0]["start"] = start
    for one in (scene, with_origins_at(scene, FAR), with_origins_at(scene, np.array([0, 0.1, 0]))):
        assert angle_at_start(one, "G.angle") == pytest.approx(0, abs=1e-9)


def test_start_of_an_arm_lifted_by_a_screw() -> None:
    scene = tomllib.loads((SCENES / "screw_loop.toml").read_text(encoding="utf-8"))
    del scene["time"]
    for arm in (-0.35, -0.1, 0.4):
        scene["coordinate"] = [{"joint": "O", "start": arm}]
        expected = (np.hypot(0.7 * np.cos(arm) - 0.7, 0.5 - 0.7 * np.sin(arm)) - 0.7) * 2 * np.pi / 0.006
        for one in (scene, with_origins_at(scene, np.array([0, 0.1, 0])), with_origins_at(scene, FAR)):
            assert angle_at_start(one, "S.angle") == pytest.approx(expected, rel=1e-9)
