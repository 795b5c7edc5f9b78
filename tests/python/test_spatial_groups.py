"""Spatial loops without a closed form: assembly at the start, forces by independent roads, refusals."""

from __future__ import annotations

import copy
import math
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest

pytestmark = pytest.mark.accuracy

ROOT = Path(__file__).resolve().parents[2]
SLIDER_CRANK = tomllib.loads((ROOT / "examples" / "spatial_slider_crank" / "scene.toml").read_text())


def platform_on_cranks(elbow: float | None = None) -> dict[str, Any]:
    """A 6-RUS platform: cranks on the frame, rods with a universal joint below and a spherical one above, threefold
    symmetric. ``elbow``: about where the cranks are [deg]; None: nothing is said of the start."""
    scene: dict[str, Any] = {
        "title": "Platform on six cranks", "space": "spatial", "gravity": [0.0, 0.0, -9.81],
        "frame": {"markers": {}}, "joint": [], "actuator": [],
        "link": [{"name": "platform", "mass": 20.0, "cog": [0.02, -0.01, 0.05], "inertia": {"diagonal": [1.0, 1.1, 2.0]}, "markers": {}}],
        "coordinate": [{"link": "platform", "start": {"position": [0.0, 0.0, 0.9]}, "motion": {
            "x": {"law": "harmonic", "mean": 0.0, "amplitude": 0.05, "frequency": "1 Hz"},
            "z": {"law": "harmonic", "mean": 0.9, "amplitude": 0.03, "frequency": "2 Hz"},
            "yaw": {"law": "harmonic", "mean": 0.0, "amplitude": 0.1, "frequency": "1 Hz"}}}],
        "time": {"end": 1.0, "samples": 41},
    }
    for i in range(6):
        foot, top = (2 * math.pi / 3 * (i // 2) + (-1) ** i * offset for offset in (-0.25, -0.8))
        out, axis = [math.cos(foot), math.sin(foot), 0.0], [-math.sin(foot), math.cos(foot), 0.0]
        scene["frame"]["markers"][f"A{i}"] = {"at": out, "axis": axis, "x": out}
        scene["link"][0]["markers"][f"P{i}"] = [0.5 * math.cos(top), 0.5 * math.sin(top), 0.0]
        scene["link"] += [
            {"name": f"crank{i}", "mass": 1.0, "cog": [0.15, 0.0, 0.0], "inertia": {"diagonal": [0.001, 0.01, 0.01]},
             "markers": {"A": {"at": [0.0, 0.0, 0.0], "axis": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0]},
                         "B": {"at": [0.3, 0.0, 0.0], "axis": [0.0, 1.0, 0.0]}}},
            {"name": f"rod{i}", "mass": 1.0, "cog": [0.0, 0.0, 0.5], "inertia": {"diagonal": [0.08, 0.08, 0.001]},
             "markers": {"B": {"at": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0]}, "P": [0.0, 0.0, 1.0]}},
        ]
        foot_joint: dict[str, Any] = {"name": f"A{i}", "type": "revolute", "between": [f"frame.A{i}", f"crank{i}.A"]}
        if elbow is not None:
            foot_joint["start"] = f"{elbow} deg"
        scene["joint"] += [
            foot_joint,
            {"name": f"B{i}", "type": "universal", "between": [f"crank{i}.B", f"rod{i}.B"]},
            {"name": f"P{i}", "type": "spherical", "between": [f"rod{i}.P", f"platform.P{i}"]},
        ]
        scene["actuator"].append({"joint": f"A{i}"})
    return scene


def test_benchmark_digits() -> None:
    """Slider and crank at 0.1 s, twelve digits found twice for the inertia taken here; energy stays."""
    run = linkdyn.Scene(SLIDER_CRANK).forward(t=np.linspace(0.0, 5.0, 51), rtol=1e-13, atol=1e-13, want="all")
    at = run.isel(sample=1)
    assert at.joint_variable.sel(variable="D.slide").item() == pytest.approx(0.226787188553, abs=1e-12)
    assert at.q.item() == pytest.approx(0.560031482093, abs=1e-12)
    energy = (run.kinetic_energy + run.potential_energy).values
    # each step may err by its tolerance, relative to the 0.25 J at hand
    assert np.ptp(energy) < run.attrs["steps"] * 1e-13 * 0.25
    assert np.abs(run.closure).max() < 1e-14


def test_cranks_find_their_assembly() -> None:
    """Without a word on the start every leg takes the elbow nearest to its joints' zero, the same by symmetry."""
    scene = linkdyn.Scene(platform_on_cranks())
    home = scene.inverse(q=[[0.0, 0.0, 0.9, 0.0, 0.0, 0.0]], qd=np.zeros((1, 6)), qdd=np.zeros((1, 6)), want="all")
    angles = home.joint_variable.sel(variable=[f"A{i}.angle" for i in range(6)]).values[0]
    np.testing.assert_allclose(angles[::2], angles[0], atol=1e-13)
    np.testing.assert_allclose(angles[1::2], angles[1], atol=1e-13)


def test_elbow_as_wished() -> None:
    """The start of a joint chooses among the assemblies."""
    angle = {}
    for elbow in (0.0, 180.0):
        run = linkdyn.Scene(platform_on_cranks(elbow)).inverse(want="all")
        angle[elbow] = np.degrees(run.joint_variable.sel(variable="A0.angle").values)
        assert np.all(run.status == 0)
    chord = lambda a, b: np.abs(np.exp(1j * np.radians(a)) - np.exp(1j * np.radians(b)))
    assert np.all(chord(angle[0.0], 0.0) < chord(angle[180.0], 0.0))
    assert np.all(chord(angle[180.0], 180.0) < chord(angle[0.0], 180.0))


def test_forces_by_other_roads() -> None:
    """Power balance, virtual work without reactions, LAPACK on all equations."""
    scene = linkdyn.Scene(platform_on_cranks())
    run, lapack, reduced = (scene.inverse(solver=solver) for solver in ("elimination", "lapack", "reduced"))
    scale = float(np.abs(lapack.reaction).max())
    # condition numbers of some thousand
    assert np.abs(run.power_imbalance).max() < 1e-11
    assert np.abs(run.reaction - lapack.reaction).max() < 1e-12 * scale
    assert np.abs(reduced.driving_force - lapack.driving_force).max() < 1e-12 * scale


def test_legs_written_otherwise() -> None:
    """UPS legs whose links have other axes than a chain's: the same platform, the same forces."""
    plain = tomllib.loads((ROOT / "examples" / "stewart_mathworks" / "scene.toml").read_text())
    chain = plain.pop("chain")[0]
    written = copy.deepcopy(plain)
    for i, (foot, top) in enumerate(zip(chain["base"], chain["platform"]), start=1):
        add_turned_leg(written, chain, i, foot, top)
    closed = linkdyn.Scene(plain | {"chain": [chain]})
    other = linkdyn.Scene(written)
    assert other.explain().count("UPS leg") == closed.explain().count("UPS leg") == 6
    q, qd, qdd = closed.motion()
    pick = slice(None, None, max(1, len(q) // 20))
    ours, theirs = (scene.inverse(q=q[pick], qd=qd[pick], qdd=qdd[pick]) for scene in (other, closed))
    assert np.all(ours.status == 0)
    # by name: the joints come in another order
    for name, pick in (("driving_force", {"actuator": theirs.actuator.values}), ("reaction", {"joint": theirs.joint.values})):
        expected = theirs[name].values
        np.testing.assert_allclose(ours[name].sel(pick).values, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def add_turned_leg(scene: dict[str, Any], chain: dict[str, Any], i: int, foot: str, top: str) -> None:
    """Leg i joint by joint, both its links turned by 120 degrees about (1, 1, 1): their x is the leg's direction."""
    turned = lambda v: [v[2], v[0], v[1]]
    pick = lambda value: value[i - 1] if isinstance(value, list) and isinstance(value[0], (list, dict)) else value

    def link(name: str, data: dict[str, Any], markers: dict[str, Any]) -> dict[str, Any]:
        xx, yy, zz, xy, yz, zx = data["inertia"] if isinstance(data["inertia"], list) else [*data["inertia"]["diagonal"], 0.0, 0.0, 0.0]
        return {"name": name, "mass": data["mass"], "cog": turned(data["cog"]), "inertia": [zz, xx, yy, zx, xy, yz],
                "inertia_check": data.get("inertia_check", True), "markers": markers}

    along, across = [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]
    owner, marker = foot.split(".")
    base = scene["frame"]["markers"][marker]
    at = base["at"] if isinstance(base, dict) else base
    scene["frame"]["markers"][f"U{i}"] = {"at": at, "axis": pick(chain["axis"])}
    assert owner == "frame"
    scene["link"] += [
        link(f"lower{i}", pick(chain["lower"]), {"U": {"at": [0.0] * 3, "axis": across}, "P": {"at": [0.0] * 3, "axis": along}}),
        link(f"upper{i}", pick(chain["upper"]), {"P": {"at": [0.0] * 3, "axis": along}, "S": [0.0] * 3}),
    ]
    scene["joint"] = scene.get("joint", []) + [
        {"name": f"leg{i}.U", "type": "universal", "between": [f"frame.U{i}", f"lower{i}.U"]},
        {"name": f"leg{i}.P", "type": "prismatic", "between": [f"lower{i}.P", f"upper{i}.P"], "start": 1.5},
        {"name": f"leg{i}.S", "type": "spherical", "between": [f"upper{i}.S", top]},
    ]
    scene["actuator"] = scene.get("actuator", []) + [{"joint": f"leg{i}.P"}]


def test_start_of_no_assembly() -> None:
    """Links that cannot reach each other: named, with what was expected. A rod off its universal joint's axis is closed by iteration,
    one square to it by a formula, which may close elsewhere."""
    scene = copy.deepcopy(SLIDER_CRANK)
    scene["link"][1]["markers"]["C"]["at"] = [0.05, 0.0, 0.0]
    text = linkdyn.Scene(scene).explain()
    assert "links 'slider', 'rod' cannot be closed at the start" in text and "does not close at the start" in text
    scene["link"][1]["markers"]["C"]["at"] = [0.05, 0.02, 0.0]
    with pytest.raises(linkdyn.SceneError, match="cannot be closed at the start"):
        linkdyn.Scene(scene)


def loop_of_seven_hinges(lead: int) -> dict:
    """Four of them are parallel and let none of the others turn; one leads."""
    place = [[0.0, 0.0, 0.0], [0.2, 0.4, 0.0], [0.9, 0.5, 0.0], [1.0, 0.0, 0.0], [1.2, -0.2, 0.3], [0.7, -0.5, 0.2], [0.2, -0.3, -0.1]]
    axis = [[0.0, 0.0, 1.0]] * 4 + [[0.4, -0.8, 0.5], [0.9, 0.3, -0.2], [-0.1, 0.6, 0.7]]
    marker = [{"at": at, "axis": along} for at, along in zip(place, axis)]
    ends = ["frame.P", *(f"link{i}.{name}" for i in range(1, 7) for name in "PQ"), "frame.Q"]
    return {
        "space": "spatial", "frame": {"markers": {"P": marker[0], "Q": marker[6]}},
        "link": [{"name": f"link{i}", "mass": 1.0, "inertia": {"diagonal": [0.01] * 3}, "markers": {"P": marker[i - 1], "Q": marker[i]},
                  "start": {"position": [0.0, 0.0, 0.0]}} for i in range(1, 7)],
        "joint": [{"name": f"J{i + 1}", "type": "revolute", "between": ends[2 * i : 2 * i + 2]} for i in range(7)],
        "coordinate": [{"joint": f"J{lead}", "motion": {"law": "constant", "value": 0.0}}], "actuator": [{"joint": f"J{lead}"}],
    }  # fmt: skip


@pytest.mark.parametrize("lead", range(1, 5))
def test_parallel_hinges_lead(lead: int) -> None:
    assert not linkdyn.Scene(loop_of_seven_hinges(lead)).inverse(t=[0.0]).status.values.any()


@pytest.mark.parametrize("lead", range(5, 8))
def test_coordinate_that_the_others_hold(lead: int) -> None:
    """It cannot lead, and is told by name."""
    with pytest.raises(linkdyn.SceneError, match=f"coordinate 'J{lead}' cannot move: the other joints hold it fast"):
        linkdyn.Scene(loop_of_seven_hinges(lead))


def test_start_is_not_needed() -> None:
    """Without the links' starts the slider-crank closes as well, on one of its two sides."""
    scene = copy.deepcopy(SLIDER_CRANK)
    for link in scene["link"]:
        link.pop("start", None)
    place = linkdyn.Scene(scene).poses([[0.0]]).position[0, 2]
    assert abs(place[0]) == pytest.approx(0.2, abs=1e-14)


def test_followed_along_a_motion() -> None:
    """Sixty turns of the crank: the assembly neither jumps nor drifts."""
    scene = copy.deepcopy(SLIDER_CRANK)
    scene["actuator"] = [{"joint": "A"}]
    scene["coordinate"] = [{"joint": "A", "motion": {"law": "constant-rate", "rate": "60 rpm"}}]
    scene["time"] = {"end": 60.0, "samples": 6001}
    run = linkdyn.Scene(scene).inverse(want="all")
    slide = run.joint_variable.sel(variable="D.slide").values
    assert np.all(run.status == 0)
    # one turn after the other the same, but for the rounding of the angle, 377 rad eps
    np.testing.assert_allclose(slide[5900:6001], slide[:101], atol=1e-12)
    assert slide.min() > 0.15
