"""Chains that are words of joint letters: a Tripteron, a spherical wrist, arms of many joints, by roads that do not share code."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest

pytestmark = pytest.mark.accuracy

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
ROLL = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""A third of a turn about (1, 1, 1): x becomes y."""


def agree(first: Any, second: Any, digits: float = 1e-11) -> None:
    np.testing.assert_allclose(first, second, rtol=0, atol=digits * np.abs(second).max())


# ------------------------------------------------------------------------------------------------------------- Tripteron
def tripteron() -> dict[str, Any]:
    return tomllib.loads((EXAMPLES / "tripteron" / "scene.toml").read_text())


def arm_by_hand(shift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centres of mass (n, 3, 3) and angles (n, 2) of carriage, upper and lower arm of the leg along x, platform shifted (n, 3)."""
    base, hinge = np.array([-0.55, -0.35]), np.array([-0.1, -0.08])
    first, second = np.array([0.12, 0.48]), np.array([0.33, -0.21])
    a, b = np.linalg.norm(first), np.linalg.norm(second)
    way = hinge + shift[:, 1:] - base
    d = np.linalg.norm(way, axis=1)
    upper = np.arctan2(way[:, 1], way[:, 0]) + np.arccos((a**2 + d**2 - b**2) / (2 * a * d))
    elbow = base + a * np.column_stack([np.cos(upper), np.sin(upper)])
    rest = hinge + shift[:, 1:] - elbow
    lower = np.arctan2(rest[:, 1], rest[:, 0])
    along = shift[:, :1]
    middle = lambda p, q: np.hstack([along, (p + q) / 2])
    centres = np.stack([np.hstack([along, np.tile(base, (len(shift), 1))]), middle(base, elbow), middle(elbow, hinge + shift[:, 1:])], axis=1)
    return centres, np.column_stack([upper, lower])


def test_tripteron_by_virtual_work() -> None:
    """Carriage i moves with coordinate i alone: its force is the power of all inertia and weight for a unit of that speed, from places
    alone, differentiated by differences of sixth order."""
    scene = linkdyn.Scene(tripteron(), EXAMPLES / "tripteron")
    run = scene.inverse(want="all")
    assert np.all(run.status == 0) and np.abs(run.power_imbalance).max() < 1e-11
    t = run.time.values[::50]
    path = lambda s: np.column_stack([0.12 * np.sin(4 * np.pi * s), 0.12 * np.sin(4 * np.pi * s + np.pi / 2), 0.06 * np.sin(8 * np.pi * s)])
    agree(run.q.values[::50], path(t))

    def machine(q: np.ndarray) -> np.ndarray:
        """Places and angles of all bodies, each times the root of its mass or inertia (n, 3 + 3 (9 + 2)); weights apart."""
        parts = [np.sqrt(1.8) * q]
        for leg in range(3):
            turn = np.linalg.matrix_power(ROLL, leg)
            centres, angles = arm_by_hand(q @ turn)
            parts += [np.sqrt(m) * (centres[:, k] @ turn.T) for k, m in enumerate((2.4, 1.1, 0.8))]
            spans = (0.12**2 + 0.48**2, 0.33**2 + 0.21**2)
            parts.append(np.unwrap(angles, axis=0) * np.sqrt([m * s / 12 for m, s in zip((1.1, 0.8), spans)]))
        return np.hstack(parts)

    weight = np.zeros(3 + 3 * 11)
    weight[2] = 1.8 / np.sqrt(1.8)
    for leg in range(3):
        weight[3 + 11 * leg : 12 + 11 * leg] = [part for m in (2.4, 1.1, 0.8) for part in (0, 0, np.sqrt(m))]
    h, second = 2e-3, np.array([2, -27, 270, -490, 270, -27, 2]) / 180
    acceleration = sum(c * machine(path(t + k * h)) for c, k in zip(second, range(-3, 4))) / h**2
    slope = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60
    for i in range(3):
        unit = np.eye(3)[i] * h
        column = sum(c * machine(path(t) + k * unit) for c, k in zip(slope, range(-3, 4))) / h
        force = np.sum((acceleration + 9.81 * weight) * column, axis=1)
        agree(run.driving_force.values[::50, i], force, 2e-8)


def written(data: dict[str, Any]) -> dict[str, Any]:
    """The same Tripteron link by link, its markers turned by hand, arms in axes of their own."""
    links, joints = [data["link"][0]], []
    frame = {}
    for leg in range(3):
        turn = np.linalg.matrix_power(ROLL, leg)
        axis = [float(v) for v in turn @ [1, 0, 0]]
        hinge = lambda at: {"at": [float(v) for v in turn @ at], "axis": axis}
        name = f"leg{leg + 1}"
        frame[f"A{leg + 1}"] = hinge([0, -0.55, -0.35])
        to = ([0.0, 0.0, 0.0], [0.0, 0.12, 0.48], [0.0, 0.33, -0.21])
        for k, (mass, way) in enumerate(zip((2.4, 1.1, 0.8), to)):
            way = turn @ way
            inertia = turn @ np.diag([4e-3, 6e-3, 6e-3]) @ turn.T if k == 0 else mass / 12 * (way @ way * np.eye(3) - np.outer(way, way))
            links.append({"name": f"{name}.link{k + 1}", "mass": mass, "cog": list(way / 2), "markers": {"from": hinge([0, 0, 0]), "to": {"at": list(way), "axis": axis}},
                          "inertia": [inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[1, 2], inertia[2, 0]], "inertia_check": False})
        ends = [f"frame.A{leg + 1}", f"{name}.link1.from", f"{name}.link1.to", f"{name}.link2.from", f"{name}.link2.to", f"{name}.link3.from",
                f"{name}.link3.to", f"platform.C{leg + 1}"]
        joints += [{"name": f"{name}.{word}", "type": "prismatic" if word == "P" else "revolute", "between": ends[2 * k : 2 * k + 2]}
                   for k, word in enumerate(("P", "R1", "R2", "R3"))]
    for joint in joints:      # names of links have dots: underscores here, as markers are called link.marker
        joint["between"] = [end if end.startswith(("frame", "platform")) else end.replace(".", "_", 1) for end in joint["between"]]
    for link in links[1:]:
        link["name"] = link["name"].replace(".", "_", 1)
    top = links[0] | {"markers": {f"C{leg + 1}": {"at": list(np.linalg.matrix_power(ROLL, leg) @ [0, -0.1, -0.08]), "axis": list(np.linalg.matrix_power(ROLL, leg) @ [1.0, 0, 0])}
                                  for leg in range(3)}}
    rest = {key: value for key, value in data.items() if key not in ("link", "chain", "frame")}
    return rest | {"frame": {"markers": frame}, "link": [top, *links[1:]], "joint": joints, "actuator": [{"joint": f"leg{k}.P"} for k in (1, 2, 3)]}


def test_tripteron_as_it_is_written_out() -> None:
    """Driving forces and all that is determined: the chain is nothing but its links and joints."""
    ours, theirs = (linkdyn.Scene(d).inverse(want="all") for d in (tripteron(), written(tripteron())))
    agree(ours.driving_force.values, theirs.driving_force.values, 1e-10)
    agree(ours.reaction.values, theirs.reaction.sel(joint=ours.joint.values).values, 1e-9)


def test_tripteron_led_by_its_carriages() -> None:
    """Carriages go where the platform goes, so the same motion at the slides takes the same forces; forward is led back by them."""
    data = tripteron()
    one = linkdyn.Scene(data).inverse()
    motion = data["coordinate"][0]["motion"]
    data["coordinate"] = [{"joint": f"leg{k + 1}.P", "motion": motion[c]} for k, c in enumerate("xyz")]
    two = linkdyn.Scene(data).inverse(want="all")
    agree(two.driving_force.values, one.driving_force.values, 1e-10)
    assert np.all(two.status == 0)
    there = linkdyn.Scene(data).forward(t=two.time.values[:101:20])
    assert np.all(there.status == 0)
    np.testing.assert_allclose(there.q.values, two.q.values[:101:20], atol=1e-9)


# ------------------------------------------------------------------------------------------------------- spherical wrist
def eye(**change: Any) -> dict[str, Any]:
    """The example of a camera on three legs of three hinges, by name."""
    data = tomllib.loads((EXAMPLES / "agile_eye" / "scene.toml").read_text())
    stiff = [joint["stiffness"] for joint in data["joint"]]
    camera = data["link"][0]
    camera["markers"] = {"C": {"at": ["r*a", "-r*b", "-r*c"], "repeat": 3, "about": "z"}}
    chain = {
        "type": "RRR", "repeat": 3, "about": "z", "base": "frame.A#", "platform": "camera.C#", "stiffness": stiff,
        "axes": [["s", 0, "c"], ["a", "b", "-c"], ["a", "-b", "-c"]],
        "links": [
            {"to": ["M*a - R*s", "M*b", "-M*c - R*c"], "mass": 0.25, "cog": ["70 mm - R*s", "30 mm", "-R*c"], "inertia": {"diagonal": [6e-4, 6e-4, 8e-4]}},
            {"to": ["r*a - M*a", "-r*b - M*b", "-r*c + M*c"], "mass": 0.18, "cog": ["40 mm - M*a", "-M*b", "-60 mm + M*c"], "inertia": {"diagonal": [3e-4, 3e-4, 4e-4]}},
        ],
    } | change
    motion = [{"joint": f"leg{k + 1}.R1", "motion": c["motion"]} for k, c in enumerate(data["coordinate"])]
    keep = {key: data[key] for key in ("space", "gravity", "redundancy", "variables", "time")}
    return keep | {"frame": {"markers": {"A": {"at": ["R*s", 0, "R*c"], "repeat": 3, "about": "z"}}}, "link": [camera], "chain": [chain], "coordinate": motion}


def test_wrist_as_it_is_written_out() -> None:
    """Torques and the loads that stiffness shares are those of the example, which has other markers and origins."""
    ours = linkdyn.Scene(eye()).inverse(want="all")
    theirs = linkdyn.Scene(EXAMPLES / "agile_eye" / "scene.toml").inverse(want="all")
    agree(ours.driving_force.values, theirs.driving_force.values, 1e-9)
    for first, second in (("R1", "motor"), ("R2", "elbow"), ("R3", "wrist")):
        for k in (1, 2, 3):
            agree(ours.reaction.sel(joint=f"leg{k}.{first}").values, theirs.reaction.sel(joint=f"{second}{k}").values, 1e-8)


def test_wrist_starts() -> None:
    """Eight assemblies in its drawing's pose; `start` chooses another of them."""
    near = linkdyn.Scene(eye()).inverse(want="all")
    other = linkdyn.Scene(eye(start=[0, "70 deg", "70 deg"])).inverse(want="all")
    assert np.all(other.status == 0)
    elbow = lambda run: run.joint_variable.sel(variable="leg1.R2.angle").values[0]
    assert elbow(near) == pytest.approx(0, abs=1e-9) and abs(elbow(other)) > 0.5


# ------------------------------------------------------------------------------------------------ six joint variables a leg
THIN = {"mass": 0.8, "inertia_check": False}
LEGS: dict[str, dict[str, Any]] = {
    "RRRS": {"axes": [[0, 1, 0], [0.1, 0.9, 0.2], [0.4, 0.1, 0.9]], "links": [{"to": [0.15, 0.02, 0.3], "mass": 1.0}, {"to": [-0.1, 0.05, 0.2], **THIN}, {"to": [-0.5, 0.03, 0.3], **THIN}]},
    "PRRS": {"axes": [[0.1, 0.2, 1], [0, 1, 0], [1, 0.1, 0.1]], "links": [{"to": [0.05, 0, 0.05], "mass": 1.0, "inertia": [2e-2, 2e-2, 3e-2, 1e-3, 2e-3, -1e-3]},
                                                                        {"to": [-0.2, 0.1, 0.35], **THIN}, {"to": [-0.3, 0.0, 0.4], **THIN}]},
    "PUUR": {"axes": [[0.1, 0, 1], [[0, 1, 0], [1, 0, 0.3]], [[1, 0, 0.3], [0, 1, 0]], [0.1, 0.1, 1]],
             "links": [{"to": [0.05, 0, 0.1], "mass": 1.0, "cog": [0.02, 0.01, 0.03]}, {"to": [-0.4, 0.05, 0.6], **THIN}, {"to": [-0.1, 0.04, 0.1], **THIN}]},
    "CRS": {"axes": [[0, 0.2, 1], [0, 1, 0]], "links": [{"to": [0.05, 0, 0.2], "mass": 1.0}, {"to": [-0.5, 0.1, 0.6], **THIN}]},
    "RPSR": {"axes": [[0, 1, 0], [-0.3, 0, 0.6], [1, 0, 0.1]], "links": [{"to": [0.02, 0, 0.1], "mass": 1.0}, {"to": [-0.25, 0, 0.45], **THIN}, {"to": [-0.22, 0.09, 0.25], **THIN}]},
}  # fmt: skip


def platform(kind: str, by: str = "pattern") -> dict[str, Any]:
    """Six legs of a kind, threefold symmetric with images, under a platform."""
    spot = lambda r, degrees: [r * np.cos(np.radians(degrees)), r * np.sin(np.radians(degrees)), 0.0]
    swing = lambda mean, amplitude: {"law": "harmonic", "mean": mean, "amplitude": amplitude, "frequency": "1 Hz"}
    pattern = {"repeat": 3, "about": "z", "mirror": "xz"}
    return {
        "space": "spatial", "gravity": [0.0, 0.0, -9.81], "frame": {"markers": {"B": {"at": spot(0.9, 10), **pattern}}},
        "link": [{"name": "platform", "mass": 30.0, "cog": [0.02, 0.01, 0.05], "inertia": {"diagonal": [2.0, 2.1, 3.0]}, "markers": {"P": {"at": spot(0.5, 30), **pattern}}}],
        "chain": [{"type": kind, "base": "frame.B#", "platform": "platform.P#", **pattern, **LEGS[kind]}],
        "coordinate": [{"link": "platform", "start": {"position": [0.0, 0.0, 0.8]},
                        "motion": {"x": swing(0.0, 0.03), "z": swing(0.8, 0.03), "roll": swing(0.0, 0.05), "yaw": swing(0.0, 0.05)}}],
        "time": {"end": 1.0, "samples": 101},
    }  # fmt: skip


@pytest.mark.parametrize("kind", LEGS)
def test_platform_on_words(kind: str) -> None:
    """Power balances, other solvers agree; and in its middle the even machine takes the same of every leg, images and all."""
    scene = linkdyn.Scene(platform(kind))
    run = scene.inverse(want="all")
    assert np.all(run.status == 0) and np.abs(run.power_imbalance).max() < 1e-11
    for solver in ("lapack", "reduced"):
        agree(run.driving_force.values, scene.inverse(solver=solver).driving_force.values)
    level = platform(kind)
    level["link"][0]["cog"] = [0.0, 0.0, 0.0]
    home = linkdyn.Scene(level).inverse(q=[[0.0, 0.0, 0.8, 0.0, 0.0, 0.0]], qd=[[0, 0, 0.3, 0, 0, 0]], qdd=[[0, 0, 2.0, 0, 0, 0]], want="all")
    force = home.driving_force.values[0]
    np.testing.assert_allclose(force, force[0], rtol=1e-8)
    scalar = {v.partition(".")[2] for v in map(str, home.variable.values) if v.startswith("leg") and ".S" not in v}
    for variable in scalar - ({"C.angle"} if kind == "CRS" else set()):
        values = np.array([home.joint_variable.sel(variable=f"leg{k}.{variable}").values[0] for k in range(1, 7)])
        np.testing.assert_allclose(values, values[0], atol=1e-9)


# -------------------------------------------------------------------------------------------------------------- in a plane
def test_planar_words() -> None:
    """A four-bar's coupler and rocker as a leg of three hinges by another name, and a slide in a row of letters; images too."""
    base = {
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"A": [0, 0], "D": [0.4, 0.0]}},
        "link": [{"name": "crank", "mass": 1.0, "inertia": 0.01, "cog": [0.05, 0], "markers": {"A": [0, 0], "B": [0.1, 0]}}],
        "joint": [{"name": "J", "type": "revolute", "between": ["frame.A", "crank.A"]}], "actuator": [{"joint": "J"}],
        "coordinate": [{"joint": "J", "motion": {"law": "constant-rate", "rate": 6.0}}], "time": {"end": 1.0, "samples": 101},
    }  # fmt: skip
    word = base | {"chain": [{"type": "RPR", "base": "frame.D", "platform": "crank.B", "actuated": False, "lower": {"mass": 0.4, "inertia": 0.01}, "upper": {"mass": 0.3, "cog": [-0.1, 0], "inertia": 0.002}}]}
    named = linkdyn.Scene(word).inverse(want="all")
    assert np.all(named.status == 0)
    letters = {"type": "RR", "name": "rod", "base": "crank.B", "platform": "slider.C", "actuated": False, "links": [{"to": [0.3, 0.05], "mass": 0.5, "inertia": 0.004}]}
    slider = {"name": "slider", "mass": 0.7, "markers": {"C": [0, 0]}}
    slide = {"name": "P", "type": "prismatic", "between": ["frame.D", "slider.C"]}
    joined = base | {"link": [*base["link"], slider], "joint": [*base["joint"], slide], "chain": [letters]}
    coupler = {"name": "coupler", "mass": 0.5, "cog": [0.15, 0.025], "inertia": 0.004, "markers": {"B": [0, 0], "C": [0.3, 0.05]}}
    plain = base | {"link": [*base["link"], slider, coupler], "joint": [*base["joint"], slide, {"name": "B", "type": "revolute", "between": ["crank.B", "coupler.B"]},
                                                                  {"name": "C", "type": "revolute", "between": ["coupler.C", "slider.C"]}]}
    ours, theirs = (linkdyn.Scene(d) for d in (joined, plain))
    assert ours.explain().partition("Order of computation")[2].count("Newton") == 0
    agree(ours.inverse().driving_force.values, theirs.inverse().driving_force.values)


def test_arm_of_four_hinges() -> None:
    """A redundant arm in a plane, RRRR to its hand, led by all its joints; its image does the same."""
    swing = lambda k: {"law": "harmonic", "mean": f"{10 * k} deg", "amplitude": "20 deg", "frequency": "1 Hz", "phase": f"{40 * k} deg"}
    arm = {"type": "RRRR", "name": "arm", "base": "frame.A", "platform": "hand.O", "links": [{"to": [0.4, 0.1], "mass": 2}, {"to": [0.3, 0], "mass": 1}, {"to": [0.2, -0.1], "mass": 0.6}]}
    scene = {
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"A": [0.1, 0.2]}},
        "link": [{"name": "hand", "mass": 0.3, "inertia": 1e-3, "cog": [0.05, 0.01], "markers": {"O": [0, 0]}}], "chain": [arm],
        "actuator": [{"joint": f"arm.R{k}"} for k in (2, 3, 4)],
        "coordinate": [{"joint": f"arm.R{k}", "motion": swing(k)} for k in (1, 2, 3, 4)], "time": {"end": 1.0, "samples": 51},
    }  # fmt: skip
    run = linkdyn.Scene(scene).inverse(want="all")
    assert np.all(run.status == 0)
    q = run.q.values
    place, heading = np.tile([0.1, 0.2], (len(q), 1)), np.zeros(len(q))
    turned = lambda v, a: np.column_stack([v[0] * np.cos(a) - v[1] * np.sin(a), v[0] * np.sin(a) + v[1] * np.cos(a)])
    pose = linkdyn.Scene(scene).poses(q, in_order=True)
    for k, to in enumerate(([0.4, 0.1], [0.3, 0], [0.2, -0.1])):
        heading = heading + q[:, [str(c) for c in run.coordinate.values].index(f"arm.R{k + 1}")]
        place = place + turned(to, heading)
    np.testing.assert_allclose(pose.position[:, 0, :2], place, atol=1e-12)
    # the image in the plane x = 0 turns the other way by itself, and what it is told is the same
    image = scene | {"frame": {"markers": {"A": {"at": [0.1, 0.2], "repeat": 1, "mirror": "yz"}}}, "chain": [arm | {"base": "frame.A#", "platform": "hand#.O", "repeat": 1, "mirror": "yz", "start": [0.1, 0.2, 0.3, 0.4]}],
                     "link": [scene["link"][0] | {"name": "hand#", "repeat": 1, "mirror": "yz"}]}
    image["actuator"] = [{"joint": f"arm{i}.R{k}"} for i in (1, 2) for k in (2, 3, 4)]
    image["coordinate"] = [{"joint": f"arm{i}.R{k}", "motion": swing(k) if i == 1 else {"law": "harmonic", "mean": f"{-10 * k} deg", "amplitude": "-20 deg", "frequency": "1 Hz", "phase": f"{40 * k} deg"}}
                           for i in (1, 2) for k in (1, 2, 3, 4)]
    both = linkdyn.Scene(image).inverse(want="all")
    forces = {str(name): both.driving_force.values[:, i] for i, name in enumerate(both.actuator.values)}
    alone = {str(name): run.driving_force.values[:, i] for i, name in enumerate(run.actuator.values)}
    for k in (1, 2, 3, 4):
        agree(forces[f"arm1.R{k}"], alone[f"arm.R{k}"])
        agree(forces[f"arm2.R{k}"], -forces[f"arm1.R{k}"])
