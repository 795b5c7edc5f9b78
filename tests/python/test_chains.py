"""Chains by name: platforms on legs of every kind, deltas, planar legs and cylinders, by roads that do not share code."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest

pytestmark = pytest.mark.accuracy

HALF = {"mass": 2.0, "cog": [0.0, 0.0, 0.2], "inertia": {"diagonal": [0.02, 0.02, 0.0]}, "inertia_check": False}
UPPER = HALF | {"cog": [0.0, 0.0, -0.2]}
CARRIAGE = {"mass": 3.0, "inertia": {"diagonal": [0.01, 0.01, 0.01]}}
CRANK, ROD = {"length": 0.3, "mass": 1.0}, {"length": 0.9, "mass": 0.8}
LEGS: dict[str, dict[str, Any]] = {
    "UPS": {"axis": [0, 1, 0], "lower": HALF, "upper": UPPER},
    "SPS": {"lower": HALF, "upper": UPPER},
    "UCU": {"axis": [0, 1, 0], "top_axis": [0, 1, 0], "lower": HALF, "upper": UPPER},
    "cylinder": {"barrel": HALF, "rod": UPPER},
    "PUS": {"rail": [0, 0, 1], "axis": [0, 1, 0], "carriage": CARRIAGE, "rod": ROD, "start": 0.1},
    "PSS": {"rail": [0, 0, 1], "carriage": CARRIAGE, "rod": ROD, "start": 0.1},
    "RUS": {"axis": [0, 1, 0], "zero": [1, 0, 0], "crank": CRANK, "rod": ROD, "elbow": -1},
    "RSS": {"axis": [0, 1, 0], "zero": [1, 0, 0], "crank": CRANK, "rod": ROD, "elbow": -1},
}


def platform(kind: str, **leg: Any) -> dict[str, Any]:
    """Six legs of a kind, threefold symmetric with images, and a platform that is moved."""
    base, top = 0.9, 0.5
    spot = lambda r, degrees: [r * math.cos(math.radians(degrees)), r * math.sin(math.radians(degrees)), 0.0]
    swing = lambda mean, amplitude: {"law": "harmonic", "mean": mean, "amplitude": amplitude, "frequency": "1 Hz"}
    return {
        "title": f"6-{kind}", "space": "spatial", "gravity": [0.0, 0.0, -9.81],
        "frame": {"markers": {"B": {"at": spot(base, 10), "repeat": 3, "about": "z", "mirror": "xz"}}},
        "link": [{"name": "platform", "mass": 30.0, "cog": [0.02, 0.01, 0.05], "inertia": {"diagonal": [2.0, 2.1, 3.0]},
                  "markers": {"P": {"at": spot(top, 50), "repeat": 3, "about": "z", "mirror": "xz"}}}],
        "chain": [{"type": kind, "base": "frame.B#", "platform": "platform.P#", "repeat": 3, "about": "z", "mirror": "xz", **LEGS[kind], **leg}],
        "coordinate": [{"link": "platform", "start": {"position": [0.0, 0.0, 0.8]},
                        "motion": {"x": swing(0.0, 0.04), "z": swing(0.8, 0.05), "roll": swing(0.0, 0.1), "yaw": swing(0.0, 0.1)}}],
        "time": {"end": 1.0, "samples": 201},
    }


def agree(first: Any, second: Any, digits: float = 1e-11) -> None:
    """Driving forces are the same, leg by leg."""
    a, b = first.driving_force.values, second.driving_force.values
    np.testing.assert_allclose(a, b, rtol=0, atol=digits * np.abs(a).max())


@pytest.mark.thorough
@pytest.mark.parametrize("kind", LEGS)
def test_platform_on_legs(kind: str) -> None:
    """Without any start but what the chain says: power balances, other solvers and virtual work agree, so do single samples and
    any order."""
    scene = linkdyn.Scene(platform(kind))
    run = scene.inverse()
    assert np.all(run.status == 0)
    assert np.abs(run.power_imbalance).max() < 1e-11
    for solver in ("lapack", "reduced"):
        agree(run, scene.inverse(solver=solver))
    q, qd, qdd = scene.motion()
    order = np.random.default_rng(3).permutation(len(q))
    mixed = scene.inverse(q=q[order], qd=qd[order], qdd=qdd[order])
    np.testing.assert_allclose(mixed.driving_force.values, run.driving_force.values[order], rtol=0,
                               atol=1e-10 * np.abs(run.driving_force).max().item())
    one = scene.inverse(q=q[77:78], qd=qd[77:78], qdd=qdd[77:78])
    np.testing.assert_allclose(one.driving_force.values[0], run.driving_force.values[77], rtol=1e-9,
                               atol=1e-10 * np.abs(run.driving_force).max().item())


@pytest.mark.parametrize("kind", LEGS)
def test_legs_are_alike(kind: str) -> None:
    """The machine has its symmetry at rest: all six drives take the same force, and the assembly is the same in every leg."""
    scene = linkdyn.Scene(platform(kind))
    home = scene.inverse(q=[[0.0, 0.0, 0.8, 0.0, 0.0, 0.0]], qd=np.zeros((1, 6)), qdd=np.zeros((1, 6)), want="all")
    level = platform(kind)
    level["link"][0]["cog"] = [0.0, 0.0, 0.0]
    even = linkdyn.Scene(level).inverse(q=[[0.0, 0.0, 0.8, 0.0, 0.0, 0.0]], qd=np.zeros((1, 6)), qdd=np.zeros((1, 6)))
    force = even.driving_force.values[0]
    np.testing.assert_allclose(force, force[0], rtol=1e-10)
    drives = home.joint_variable.sel(variable=[v for v in home.variable.values if str(v).endswith(drive_of(kind))]).values[0]
    np.testing.assert_allclose(drives, drives[0], rtol=1e-10)


def drive_of(kind: str) -> str:
    return {"UCU": "C.slide", "R": "R.angle"}.get(kind, "R.angle" if kind.startswith("R") else "P.slide")


@pytest.mark.thorough
@pytest.mark.parametrize(("first", "second"), [("UPS", "SPS"), ("UPS", "UCU"), ("UPS", "cylinder"), ("PUS", "PSS"), ("RUS", "RSS")])
def test_thin_rods_need_no_universal_joints(first: str, second: str) -> None:
    """Links without inertia about themselves: what holds their spin takes no moment, whichever joint it is."""
    agree(linkdyn.Scene(platform(first)).inverse(), linkdyn.Scene(platform(second)).inverse())


def test_which_are_in_closed_form() -> None:
    """Legs with a slide between ball or universal joint and ball are; and so their balls by name."""
    for kind in ("UPS", "SPS", "cylinder"):
        assert linkdyn.Scene(platform(kind)).explain().count("closed form") == 6


def test_elbow_and_start_choose() -> None:
    """The other elbow, the carriage's other side."""
    def first_drive(**leg: Any) -> float:
        kind = "PUS" if "start" in leg else "RUS"
        home = linkdyn.Scene(platform(kind, **leg)).inverse(q=[[0.0, 0.0, 0.8, 0.0, 0.0, 0.0]], want="all")
        return float(home.joint_variable.sel(variable=f"leg1.{drive_of(kind)}")[0])

    # z of the ball less or plus the rod's rise
    reach = math.sqrt(0.9**2 - (0.9**2 + 0.5**2 - 2 * 0.9 * 0.5 * math.cos(math.radians(40))))
    assert first_drive(start=0.0) == pytest.approx(0.8 - reach, abs=1e-12)
    assert first_drive(start=2.0) == pytest.approx(0.8 + reach, abs=1e-12)
    inward, outward = first_drive(elbow=1), first_drive(elbow=-1)
    assert abs(inward - outward) > 0.5


def delta(kind: str) -> dict[str, Any]:
    """Three arms, led by their cranks: with two parallel rods of half the mass, or with one between universal joints."""
    rod = {"length": 0.8, "mass": 0.2 if kind == "R(SS)2" else 0.4}
    arm: dict[str, Any] = {"crank": {"length": 0.3, "mass": 0.5}, "rod": rod, "elbow": 1}
    if kind == "R(SS)2":
        arm["width"] = 0.08
    return {
        "title": "delta", "space": "spatial", "gravity": [0.0, 0.0, -9.81],
        "frame": {"markers": {"B": {"at": [0.2, 0.0, 0.0], "repeat": 3, "about": "z"}}},
        "link": [{"name": "platform", "mass": 1.0, "inertia": {"diagonal": [0.001, 0.001, 0.002]},
                  "markers": {"P": {"at": [0.05, 0.0, 0.0], "repeat": 3, "about": "z"}}, "start": {"position": [0.0, 0.0, -0.7]}}],
        "chain": [{"type": kind, "name": "arm", "base": "frame.B#", "platform": "platform.P#", "repeat": 3, "about": "z",
                   "axis": [0, 1, 0], "zero": [1, 0, 0], **arm}],
        "coordinate": [{"joint": f"arm{i}.R", "motion": {
            "law": "harmonic", "mean": "20 deg", "amplitude": f"{8 + 3 * i} deg", "frequency": "2 Hz", "phase": f"{50 * i} deg"}}
            for i in (1, 2, 3)],
        "time": {"end": 0.5, "samples": 161},
    }


TRIPODS: dict[str, dict[str, Any]] = {
    "RPS": {"lower": HALF, "upper": UPPER},
    "PRS": {"rail": [0, 0, 1], "carriage": CARRIAGE, "rod": ROD, "start": 0.0},
    "RRS": {"zero": [1, 0, 0], "crank": CRANK, "rod": {"length": 0.8, "mass": 0.8}, "elbow": -1},
}


def tripod(kind: str, **top: Any) -> dict[str, Any]:
    """Three legs on hinges and balls under a platform that rises and tilts."""
    swing = lambda mean, amplitude, phase: {"law": "harmonic", "mean": mean, "amplitude": amplitude, "frequency": "1 Hz", "phase": phase}
    return {
        "space": "spatial", "gravity": [0.0, 0.0, -9.81],
        "frame": {"markers": {"B": {"at": [0.6, 0.0, 0.0], "repeat": 3, "about": "z"}}},
        "link": [{"name": "platform", "mass": 30.0, "cog": [0.02, 0.01, 0.05], "inertia": {"diagonal": [2.0, 2.1, 3.0]}, "start": {"position": [0.0, 0.0, 0.8]},
                  "markers": {"P": {"at": [0.4, 0.0, 0.0], "repeat": 3, "about": "z"}}}],
        "chain": [{"type": kind, "base": "frame.B#", "platform": "platform.P#", "repeat": 3, "about": "z", "axis": [0, 1, 0], **TRIPODS[kind], **top}],
        "coordinate": [{"link": "platform", "components": ["z", "roll", "pitch"],
                        "motion": {"z": swing(0.8, 0.04, 0), "roll": swing(0.0, 0.08, "1 rad"), "pitch": swing(0.0, 0.1, "2 rad")}}],
        "time": {"end": 1.0, "samples": 201},
    }


@pytest.mark.parametrize("kind", TRIPODS)
def test_tripods(kind: str) -> None:
    """Power balances, other solvers and virtual work agree; hinges keep the balls in their planes; legs are alike at rest."""
    scene = linkdyn.Scene(tripod(kind))
    run = scene.inverse(want="all")
    assert np.all(run.status == 0) and np.abs(run.power_imbalance).max() < 1e-11
    for solver in ("lapack", "reduced"):
        agree(run, scene.inverse(solver=solver))
    poses = scene.poses(run.q.values, in_order=True)
    for k in range(3):
        angle = 2 * np.pi * k / 3
        ball = poses.position[:, 0] + poses.rotation[:, 0] @ np.array([0.4 * np.cos(angle), 0.4 * np.sin(angle), 0.0])
        np.testing.assert_allclose(ball @ np.array([-np.sin(angle), np.cos(angle), 0.0]), 0.0, atol=1e-11)
    level = tripod(kind)
    level["link"][0]["cog"] = [0.0, 0.0, 0.0]
    force = linkdyn.Scene(level).inverse(q=[[0.8, 0.0, 0.0]], qd=np.zeros((1, 3)), qdd=np.zeros((1, 3))).driving_force.values[0]
    np.testing.assert_allclose(force, force[0], rtol=1e-9)


def test_tripod_as_it_is_written_out() -> None:
    """The example's legs by name: the same forces, and the hinges' zeros where the legs stand upright."""
    folder = Path(__file__).resolve().parents[2] / "examples" / "tripod"
    data = tomllib.loads((folder / "scene.toml").read_text())
    written = linkdyn.Scene(data, folder).inverse(want="all")
    lower, upper = ({key: link[key] for key in ("mass", "cog", "inertia")} for link in data["link"][1:])
    chain = {"type": "RPS", "base": "frame.B#", "platform": "platform.S#", "repeat": 3, "about": "z", "axis": [0, 1, 0], "lower": lower, "upper": upper, "start": 0.632}
    named = data | {"frame": {"markers": {"B": {"at": ["R", 0, 0], "repeat": 3, "about": "z"}}}, "link": data["link"][:1], "chain": [chain]}
    named.pop("joint"), named.pop("actuator")
    run = linkdyn.Scene(named, folder).inverse(want="all")
    agree(run, written, 1e-10)
    angles = [[str(v) for v in one["variable"].values] for one in (run, written)]
    for k in (1, 2, 3):
        first, second = (one.joint_variable.values[:, names.index(name)] for one, names, name in ((run, angles[0], f"leg{k}.R.angle"), (written, angles[1], f"H{k}.angle")))
        np.testing.assert_allclose(first, second, atol=1e-10)


def test_three_upu() -> None:
    """Universal joints whose outer axes are tangents, and parallel to each other in pairs: the platform shifts and does not turn."""
    spot = lambda r: {"at": [r, 0.0, 0.0], "repeat": 3, "about": "z"}
    swing = lambda mean, amplitude, phase: {"law": "harmonic", "mean": mean, "amplitude": amplitude, "frequency": "1 Hz", "phase": phase}
    scene = linkdyn.Scene({
        "space": "spatial", "gravity": [0.0, 0.0, -9.81], "frame": {"markers": {"B": spot(0.6)}},
        "link": [{"name": "platform", "mass": 10.0, "cog": [0.02, 0.01, 0.05], "inertia": {"diagonal": [0.2, 0.21, 0.3]}, "start": {"position": [0.05, 0.02, 0.8]}, "markers": {"P": spot(0.25)}}],
        "chain": [{"type": "UPU", "base": "frame.B#", "platform": "platform.P#", "repeat": 3, "about": "z", "axis": [0, 1, 0], "top_axis": [0, 1, 0], "lower": HALF, "upper": UPPER}],
        "coordinate": [{"link": "platform", "components": ["x", "y", "z"], "motion": {"x": swing(0.05, 0.04, 0), "y": swing(0.02, 0.05, "1 rad"), "z": swing(0.8, 0.05, "2 rad")}}],
        "time": {"end": 1.0, "samples": 201},
    })
    run = scene.inverse(want="all")
    assert np.all(run.status == 0) and np.abs(run.power_imbalance).max() < 1e-11
    for solver in ("lapack", "reduced"):
        agree(run, scene.inverse(solver=solver))
    poses = scene.poses(run.q.values, in_order=True)
    np.testing.assert_allclose(poses.rotation[:, 0], np.tile(np.eye(3), (len(run.q), 1, 1)), atol=1e-9)


@pytest.mark.thorough
def test_delta_with_its_rods() -> None:
    """Parallelograms keep the platform level, and take the torques of single rods between universal joints."""
    real, plain = (linkdyn.Scene(delta(kind)) for kind in ("R(SS)2", "RUU"))
    ours, theirs = real.inverse(), plain.inverse()
    assert np.all(ours.status == 0) and np.all(theirs.status == 0)
    assert len(ours.attrs["idle_spins"].split()) == 6
    agree(ours, theirs, 1e-10)
    poses = real.poses()
    np.testing.assert_allclose(poses.rotation[:, 0], np.broadcast_to(np.eye(3), (len(poses.rotation), 3, 3)), atol=1e-12)
    np.testing.assert_allclose(poses.position[:, 0], plain.poses().position[:, 0], atol=1e-12)
    assert np.abs(ours.power_imbalance).max() < 1e-11
    agree(ours, real.inverse(solver="reduced"))


@pytest.mark.parametrize("height", [0.6, -0.55])
@pytest.mark.parametrize("elbow", [1, -1, None])
def test_delta_by_its_tool_closes(height: float, elbow: int | None) -> None:
    """Whatever is said of its elbows: rods keep their length, from where the cranks' ends are to the platform. Out of reach it is told."""
    scene = delta("R(SS)2")
    scene["coordinate"] = [{"link": "platform", "components": ["x", "y", "z"], "start": {"z": height}}]
    scene["chain"][0] |= {"elbow": elbow}
    if elbow is None:
        del scene["chain"][0]["elbow"]
    made = linkdyn.Scene(scene)
    poses = made.poses()
    place, turn = dict(zip(made.links, poses.position[0], strict=True)), dict(zip(made.links, poses.rotation[0], strict=True))
    assert poses.status[0] == 0
    np.testing.assert_allclose(place["platform"], [0, 0, height], atol=1e-12)
    for leg in range(3):
        c, s = math.cos(leg * 2 * math.pi / 3), math.sin(leg * 2 * math.pi / 3)
        about = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        crank = about.T @ (place[f"arm{leg + 1}.rod1"] + place[f"arm{leg + 1}.rod2"]) / 2 - [0.2, 0, 0]      # its end, in the arm's own axes
        assert abs(np.linalg.norm(crank) - 0.3) < 1e-9 and abs(crank[1]) < 1e-9
        for rod, side in (("rod1", 0.04), ("rod2", -0.04)):
            top = place["platform"] + turn["platform"] @ about @ [0.05, side, 0]
            np.testing.assert_allclose(place[f"arm{leg + 1}.{rod}"] + turn[f"arm{leg + 1}.{rod}"] @ [0, 0, 0.8], top, atol=1e-9)
    scene["coordinate"][0]["start"] = {"z": 1.5}
    far = linkdyn.Scene(scene).inverse()
    assert (far.status == 1).all() and "'arm1.crank', 'arm1.rod1' cannot be closed at the start" in far.attrs["failure"]
    scene["link"][0]["start"]["angles"] = [0.0, 0.0, 0.7]            # by iteration
    with pytest.raises(linkdyn.SceneError, match="cannot be closed at the start, platform.x = 0 m, platform.y = 0 m, platform.z = 1.5 m"):
        linkdyn.Scene(scene)


def planar(kind: str, **leg: Any) -> dict[str, Any]:
    """A plate on three legs in a plane."""
    legs: dict[str, dict[str, Any]] = {
        "RRR": {"crank": {"length": 0.4, "mass": 1.0}, "rod": {"length": 0.5, "mass": 0.8}, "elbow": 1},
        "PRR": {"rail": [0, 1], "carriage": {"mass": 1.0}, "rod": {"length": 0.8, "mass": 0.8}},
        "RPR": {"lower": {"mass": 1.0, "cog": [0.2, 0.0], "inertia": 0.02}, "upper": {"mass": 0.5, "cog": [-0.2, 0.0], "inertia": 0.01}},
    }
    legs["cylinder"] = {"barrel": legs["RPR"]["lower"], "rod": legs["RPR"]["upper"]}
    swing = lambda amplitude: {"law": "harmonic", "amplitude": amplitude, "frequency": "1 Hz"}
    return {
        "title": f"3-{kind}", "space": "planar", "gravity": [0.0, -9.81],
        "frame": {"markers": {"B": {"at": [0.8, 0.0], "repeat": 3, "about": "z"}}},
        "link": [{"name": "plate", "mass": 4.0, "inertia": 0.1, "cog": [0.01, 0.02], "markers": {"P": {"at": [0.15, 0.12], "repeat": 3, "about": "z"}}}],
        "chain": [{"type": kind, "repeat": 3, "about": "z", "base": "frame.B#", "platform": "plate.P#", **legs[kind], **leg}],
        "coordinate": [{"link": "plate", "motion": {"x": swing("5 cm"), "yaw": swing("10 deg")}}],
        "time": {"end": 1.0, "samples": 201},
    }


@pytest.mark.parametrize("kind", ["RRR", "PRR", "RPR", "cylinder"])
def test_planar_legs(kind: str) -> None:
    """All closed forms; power and virtual work; legs alike at the centre."""
    scene = linkdyn.Scene(planar(kind))
    assert "Newton" not in scene.explain()
    run = scene.inverse()
    assert np.all(run.status == 0)
    assert np.abs(run.power_imbalance).max() < 1e-11
    for solver in ("lapack", "reduced"):
        agree(run, scene.inverse(solver=solver))
    home = scene.inverse(q=[[0.0, 0.0, 0.0]], want="all").joint_variable
    drives = home.sel(variable=[f"leg{i}.{'R1' if kind == 'RRR' else 'P'}" + (".angle" if kind == "RRR" else ".slide") for i in (1, 2, 3)])
    np.testing.assert_allclose(drives.values[0], drives.values[0, 0], rtol=1e-12)


def test_cylinder_is_a_leg() -> None:
    """Of a plane: the same as RPR."""
    agree(linkdyn.Scene(planar("RPR")).inverse(), linkdyn.Scene(planar("cylinder")).inverse())


def test_planar_elbow_and_mirror() -> None:
    """The elbow to the other side; an image has its elbow mirrored."""
    angle = lambda elbow: float(linkdyn.Scene(planar("RRR", elbow=elbow)).inverse(want="all").joint_variable.sel(variable="leg1.R2.angle")[0])
    assert angle(1) > 0 > angle(-1)
    scene = planar("RRR")
    scene["frame"]["markers"] = {"B": {"at": [0.5, 0.2], "mirror": "yz"}}
    scene["link"][0]["markers"] = {"P": {"at": [0.1, 0.1], "mirror": "yz"}}
    scene["chain"][0] |= {"mirror": "yz"}
    for key in ("repeat", "about"):
        del scene["chain"][0][key]
    scene["coordinate"][0]["motion"] = {"y": 0.3}
    # two legs hold the plate but for one freedom: a slide for the plate takes it
    scene["chain"].append(planar("PRR")["chain"][0] | {"name": "third", "base": "frame.B1", "platform": "plate.P1", "rail": [1, 0]})
    for key in ("repeat", "about"):
        del scene["chain"][1][key]
    run = linkdyn.Scene(scene).inverse(want="all").joint_variable
    left, right = (float(run.sel(variable=f"leg{i}.R2.angle")[0]) for i in (1, 2))
    assert left == pytest.approx(-right, abs=1e-12) and left > 0


@pytest.mark.parametrize(("change", "message"), [
    ({"type": "USP"}, "'type' = 'USP' is unknown (expected one of 'UPS', 'SPS'"),
    ({"type": "RRR"}, "a RRR chain exists in a plane only"),
    ({"rod": None}, "missing key 'rod' (expected { length = .., mass = .. })"),
    ({"rod": {"mass": 1.0}}, "missing key 'length'"),
    ({"rod": {"length": 0.0, "mass": 1.0}}, "'length' = 0 m (expected a length of more than zero)"),
    ({"elbow": 2}, "'elbow' = 2 (expected 1 or -1)"),
    ({"zero": [0, 1, 0]}, "'zero' lies along 'axis'"),
    ({"axis": None}, "missing key 'axis'"),
    ({"upper": UPPER}, "unknown key 'upper'"),
    ({"start": "3 mm"}, "'start' = '3 mm' is a length"),
])
def test_wrong_chains(change: dict[str, Any], message: str) -> None:
    """One line, that names the chain or its link."""
    scene = platform("RUS")
    chain = scene["chain"][0] | change
    scene["chain"] = [{key: value for key, value in chain.items() if value is not None}]
    with pytest.raises(linkdyn.SceneError) as refused:
        linkdyn.Scene(scene)
    assert message in str(refused.value) and "leg1" in str(refused.value)


def test_planar_kinds_and_width() -> None:
    """A spatial kind in a plane; a delta arm without its width."""
    scene = planar("RRR")
    scene["chain"][0]["type"] = "UPS"
    with pytest.raises(linkdyn.SceneError, match="a UPS chain does not exist in a plane"):
        linkdyn.Scene(scene)
    arms = delta("R(SS)2")
    arms["chain"][0]["width"] = 0.0
    with pytest.raises(linkdyn.SceneError, match="'width' = 0 m"):
        linkdyn.Scene(arms)


def test_a_leg_led_by_its_joint_is_drawn_out() -> None:
    """A hexapod led by a point of its platform, strokes and angles of its universal joints: at the angle that leg 4 is given it would reach its
    ball pushed through itself, too, with smaller angles."""
    led = tomllib.loads((Path(__file__).parents[2] / "examples" / "stewart_mathworks" / "scene.toml").read_text())
    drawn = linkdyn.Scene(led).inverse(t=[0.0])
    at = {str(name): float(value) for name, value in zip(drawn.variable.values, drawn.joint_variable.values[0])}
    joints = ["leg6.P.slide", "leg1.P.slide", "leg4.U.angle1", "leg2.U.angle2", "leg2.P.slide"]
    home = linkdyn.Scene(led).poses(drawn.q.values)
    platform = home.position[0, 0], home.rotation[0, 0]
    led["link"][0]["start"] = {"position": list(platform[0]), "rotation": platform[1].tolist()}
    led["coordinate"] = [
        {"marker": "platform.P5", "components": ["y"], "start": {"y": float((platform[0] + platform[1] @ led["link"][0]["markers"]["P5"])[1])}},
        *({"joint": name.rpartition(".")[0], "variable": name.rpartition(".")[2], "start": at[name]} for name in joints),
    ]
    led["time"] = {"samples": 1}
    run = linkdyn.Scene(led).inverse()
    slides = [name.endswith(".slide") for name in map(str, run.variable.values)]
    np.testing.assert_allclose(run.joint_variable.values[0, slides], drawn.joint_variable.values[0, slides], rtol=1e-12)
    np.testing.assert_allclose(run.driving_force.values, drawn.driving_force.values, rtol=1e-10)
