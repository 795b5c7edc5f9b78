"""Hard stops of joints with several axes on links that turn, against others of the same place: markers as a link sees them, a row of hinges."""

from __future__ import annotations

import copy
from typing import Any

import linkdyn
import numpy as np
import pytest

pytestmark = pytest.mark.accuracy

PATH = 2e-8        # of places behind a dozen impacts, at 1e-11


def turning(amplitude: float = 0.5) -> dict[str, Any]:
    """A table about a leaning axis, driven to and fro."""
    return {"joint": "pivot", "driven": True, "motion": {"law": "harmonic", "amplitude": amplitude, "frequency": "1.3 Hz"}}


def puck(stop: dict[str, Any]) -> dict[str, Any]:
    """A plate that slides on a table, off its middle."""
    axis = [0.2, 0.1, 0.97]
    return {
        "space": "spatial", "gravity": [0.4, -0.3, -9.81], "frame": {"markers": {"O": {"at": [0, 0, 0], "axis": axis}}},
        "link": [{"name": "table", "mass": 4.0, "inertia": [0.5, 0.6, 0.7, 0, 0, 0], "markers": {
                    "O": {"at": [0, 0, 0], "axis": axis}, "top": {"at": [0.3, 0.1, 0.2], "axis": [0, 0, 1], "x": [1, 0, 0]}}},
                 {"name": "puck", "mass": 0.5, "cog": [0.01, 0.02, 0.03], "inertia": [1e-3, 1e-3, 2e-3, 0, 0, 0], "markers": {
                    "foot": {"at": [0, 0, 0], "axis": [0, 0, 1], "x": [1, 0, 0]}}}],
        "joint": [{"name": "pivot", "type": "revolute", "between": ["frame.O", "table.O"]},
                  {"name": "slide", "type": "planar", "between": ["table.top", "puck.foot"]}],
        "coordinate": [turning(), *({"joint": "slide", "variable": name, "start": {"position": 0.0, "velocity": v}}
                                    for name, v in (("x", 0.6), ("y", -0.4), ("angle", 1.5)))],
        "actuator": [{"joint": "pivot", "law": {"type": "inverse"}}],
        "measures": {"seen": {"marker": "puck.foot", "component": "x", "relative_to": "table"}},
        "stop": [{"name": "rim", **stop}],
    }  # fmt: skip


@pytest.mark.parametrize("restitution", [0.7, 0.0])
@pytest.mark.parametrize("method", ["rk8pd", "gbs"])
def test_a_plate_on_a_turning_table(method: str, restitution: float) -> None:
    """The joint's x is what the table sees of the plate's marker: bounces, and rest at the rim under Coriolis' force."""
    t = np.linspace(0, 1.5, 31)
    joint = linkdyn.Scene(puck({"joint": "slide", "variable": "x", "min": -0.05, "max": 0.08, "restitution": restitution}))
    marker = linkdyn.Scene(puck({"measure": "seen", "min": 0.25, "max": 0.38, "restitution": restitution}))
    one, other = (scene.forward(t=t, method=method, rtol=1e-11, atol=1e-11) for scene in (joint, marker))
    assert one.event.size == other.event.size >= 4
    np.testing.assert_allclose(one.event_time.values, other.event_time.values, rtol=0, atol=1e-7)
    np.testing.assert_allclose(one.q.values, other.q.values, rtol=0, atol=PATH)
    np.testing.assert_allclose(one.reaction.values, other.reaction.values, rtol=0, atol=1e-5 * np.abs(other.reaction.values).max())


def cardan(stop: str | None, joints: str) -> dict[str, Any]:
    """A pendulum on a universal joint of a turning arm; or on two hinges with a massless cross between."""
    first, second, arm = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.1, -0.2, 0.95]
    scene: dict[str, Any] = {
        "space": "spatial", "gravity": [0.0, 0.0, -9.81], "frame": {"markers": {"O": {"at": [0, 0, 0], "axis": arm}}},
        "link": [{"name": "arm", "mass": 3.0, "inertia": [0.3, 0.3, 0.4, 0, 0, 0], "markers": {
                    "O": {"at": [0, 0, 0], "axis": arm}, "end": {"at": [0.4, 0, 0], "axis": first, "x": second}}},
                 {"name": "bob", "mass": 1.0, "cog": [0.02, 0.01, -0.5], "inertia": [0.02, 0.03, 0.01, 0, 0, 0], "markers": {
                    "top": {"at": [0, 0, 0], "axis": second, "x": [0.0, 0.0, 1.0]}}}],
        "joint": [{"name": "pivot", "type": "revolute", "between": ["frame.O", "arm.O"]}],
        "coordinate": [turning(0.8)], "actuator": [{"joint": "pivot", "law": {"type": "inverse"}}],
    }  # fmt: skip
    if joints == "universal":
        scene["joint"].append({"name": "J", "type": "universal", "between": ["arm.end", "bob.top"]})
        angles = [("J", "angle1"), ("J", "angle2")]
    else:
        scene["link"].append({"name": "cross", "mass": 0.0, "markers": {"a": {"at": [0, 0, 0], "axis": first, "x": second}, "b": {"at": [0, 0, 0], "axis": second, "x": first}}})
        scene["joint"] += [{"name": "J1", "type": "revolute", "between": ["arm.end", "cross.a"]}, {"name": "J2", "type": "revolute", "between": ["cross.b", "bob.top"]}]
        angles = [("J1", None), ("J2", None)]
    for k, (joint, variable) in enumerate(angles):
        named = {"joint": joint} | ({"variable": variable} if variable else {})
        scene["coordinate"].append(named | {"start": {"position": START[joints][k], "velocity": (0.9, -0.6)[k]}})
        if stop == str(k + 1):
            scene["stop"] = [{"name": "horn", **named, "min": START[joints][k] - 0.15, "max": START[joints][k] + 0.2, "restitution": 0.5}]
    return scene


# the bob's axes are the arm's
START = {"universal": [-np.pi / 2, np.pi], "hinges": [0.0, -np.pi / 2]}


@pytest.mark.parametrize("stop", ["1", "2"])
def test_a_universal_joint_on_a_turning_arm(stop: str) -> None:
    t = np.linspace(0, 1.2, 25)
    one, other = (linkdyn.Scene(cardan(stop, joints)).forward(t=t, rtol=1e-11, atol=1e-11, method="rk8pd") for joints in ("universal", "hinges"))
    assert one.event.size == other.event.size >= 3
    np.testing.assert_allclose(one.event_time.values, other.event_time.values, rtol=0, atol=1e-7)
    np.testing.assert_allclose(one.qd.values, other.qd.values, rtol=0, atol=1e-6)
    np.testing.assert_allclose(one.q.values - one.q.values[0], other.q.values - other.q.values[0], rtol=0, atol=PATH)


def test_energy_is_lost_as_told() -> None:
    """On a table at rest: what impacts lose is what energy falls by."""
    scene = puck({"joint": "slide", "variable": "angle", "min": -0.1, "max": 0.4, "restitution": 0.6})
    scene["coordinate"][0]["motion"] = {"law": "constant", "value": 0.0}
    scene["gravity"] = [0.0, 0.0, 0.0]
    run = linkdyn.Scene(copy.deepcopy(scene)).forward(t_end=1.5, rtol=1e-11, atol=1e-11)
    assert run.event.size >= 2
    assert abs(run.kinetic_energy.values[-1] - run.kinetic_energy.values[0] + run.event_loss.values.sum()) < 1e-10
