"""A scissor jack spread by a fine screw of many turns: the same as one whose nut slides, by the principle of virtual work."""
from __future__ import annotations

from typing import Any

import linkdyn
import numpy as np
import pytest

pytestmark = pytest.mark.accuracy

LEAD = 0.002                         # [m] a turn
PITCH = LEAD / (2 * np.pi)
SPAN = 173 * LEAD                    # between the blocks at the start [m]: whole turns, since the spindle stands at none
ARM = 0.2
SLOPE = float(np.arccos(SPAN / (2 * ARM)))
TURNS = 800.0                        # [rad] from there on


def at(place: list[float], axis: list[float]) -> dict[str, Any]:
    return {"at": place, "axis": axis}


def hinge(name: str, a: str, b: str) -> dict[str, Any]:
    return {"name": name, "type": "revolute", "between": [a, b]}


def arm(name: str, slope: float, place: list[float]) -> dict[str, Any]:
    return {"name": name, "mass": 1.0, "cog": [ARM / 2, 0, 0.01], "inertia": [0.001, 0.004, 0.004, 0, 0, 0],
            "start": {"position": place, "angles": [0, -slope, 0]}, "markers": {"a": at([0, 0, 0], [0, 1, 0]), "b": at([ARM, 0, 0], [0, 1, 0])}}


def block(name: str, place: list[float], axis: list[float], mass: float) -> dict[str, Any]:
    return {"name": name, "mass": mass, "inertia": [0.001, 0.001, 0.001, 0, 0, 0], "start": {"position": place},
            "markers": {"p": at([0, 0, 0], [0, 1, 0]), "s": at([0, 0, 0], axis)}}


def jack(led_by: str) -> dict[str, Any]:
    """Led by the hinge of its spindle (``B``), by the screw itself (``S``), or by a ``slide`` in their place."""
    x, z = SPAN / 2, ARM * np.sin(SLOPE)
    left, right = [-x, 0.0, z], [x, 0.0, z]
    scene = {
        "space": "spatial", "gravity": [0, 0, -9.81], "time": {"end": 1.0, "samples": 11},
        "frame": {"markers": {"p": at([0, 0, 0], [0, 1, 0]), "g": at([0, 0, 0], [0, 0, 1])}},
        "link": [arm("right", SLOPE, [0.0, 0.0, 0.0]), arm("left", np.pi - SLOPE, [0.0, 0.0, 0.0]), arm("upper_right", np.pi - SLOPE, right),
                 arm("upper_left", SLOPE, left), block("bearing", left, [1, 0, 0], 0.5), block("nut", right, [1, 0, 0], 0.5),
                 block("table", [0.0, 0.0, 2 * z], [0, 0, 1], 5.0)],
        "joint": [hinge("O1", "frame.p", "right.a"), hinge("O2", "frame.p", "left.a"), hinge("R1", "right.b", "nut.p"), hinge("L1", "left.b", "bearing.p"),
                  hinge("R2", "nut.p", "upper_right.a"), hinge("L2", "bearing.p", "upper_left.a"), hinge("T1", "upper_right.b", "table.p"),
                  hinge("T2", "upper_left.b", "table.p"), {"name": "G", "type": "prismatic", "between": ["frame.g", "table.s"]}],
        "load": [{"on": "table.p", "force": [0, 0, -1000.0]}],
    }
    if led_by == "slide":
        scene["joint"].append({"name": "S", "type": "prismatic", "between": ["bearing.s", "nut.s"], "start": SPAN})
        scene["coordinate"], scene["actuator"] = [{"joint": "S", "start": SPAN}], [{"joint": "S"}]
        return scene
    # a spindle that weighs nothing, and has no moment of inertia about itself: it changes no force
    scene["link"].append({"name": "spindle", "mass": 0.0, "start": {"position": left}, "markers": {"s": at([0, 0, 0], [1, 0, 0])}})
    scene["joint"] += [hinge("B", "bearing.s", "spindle.s"), {"name": "S", "type": "screw", "lead": LEAD, "between": ["spindle.s", "nut.s"], "start": SPAN / PITCH}]
    scene["coordinate"], scene["actuator"] = [{"joint": led_by, "start": SPAN / PITCH if led_by == "S" else 0.0}], [{"joint": led_by}]
    return scene


def ways(led_by: str, samples: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Coordinates of both jacks up to 800 rad from the start, and how far the slide goes per angle of the screw's jack."""
    turned = np.linspace(0.0, TURNS, samples)[:, np.newaxis]
    if led_by == "S":
        return SPAN / PITCH - turned, SPAN - PITCH * turned, PITCH
    return turned, SPAN - PITCH * turned, -PITCH


@pytest.mark.parametrize("in_order", [False, True], ids=["alone", "in order"])
@pytest.mark.parametrize("samples", [9, 401])
@pytest.mark.parametrize("led_by", ["B", "S"])
def test_against_a_slide(led_by: str, samples: int, in_order: bool) -> None:
    """Places, and forces by virtual work: on samples on their own, up to 127 turns from the start, and steps of up to 100 rad."""
    q, slid, pitch = ways(led_by, samples)
    qd, qdd = np.full_like(q, 100.0), np.full_like(q, -50.0)
    run = linkdyn.Scene(jack(led_by)).inverse(q=q, qd=qd, qdd=qdd, in_order=in_order, want=["driving_force", "joint_variable"])
    other = linkdyn.Scene(jack("slide")).inverse(q=slid, qd=pitch * qd, qdd=pitch * qdd, in_order=in_order, want=["driving_force", "joint_variable"])
    np.testing.assert_array_equal(run.status, 0)
    np.testing.assert_array_equal(other.status, 0)
    for joint in ("G.slide", "R1.angle", "T2.angle"):
        np.testing.assert_allclose(run.joint_variable.sel(variable=joint).values, other.joint_variable.sel(variable=joint).values, rtol=0, atol=1e-11)
    expected = pitch * other.driving_force.values
    np.testing.assert_allclose(run.driving_force.values, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_run_against_a_slide() -> None:
    """Set in motion by a constant torque, and by the thrust that it gives: the table goes the same way."""
    screw, slide = jack("B"), jack("slide")
    thrust = -2400.0
    screw["actuator"][0]["law"] = {"type": "constant", "value": -PITCH * thrust}
    slide["actuator"][0]["law"] = {"type": "constant", "value": thrust}
    t = np.linspace(0, 0.08, 5)
    run, other = (linkdyn.Scene(one).forward(t=t, rtol=1e-10, atol=1e-12) for one in (screw, slide))
    np.testing.assert_array_equal(run.status, 0)
    np.testing.assert_array_equal(other.status, 0)
    turned = (SPAN - other.q.values[:, 0]) / PITCH
    assert np.abs(turned).max() > 100
    np.testing.assert_allclose(run.q.values[:, 0], turned, rtol=0, atol=1e-7 * np.abs(turned).max())
