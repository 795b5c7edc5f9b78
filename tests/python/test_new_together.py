"""Friction, moving frames, payloads, end stops and redundant constraints in one scene: the record against lanes, one solver against another."""

from __future__ import annotations

from typing import Any

import linkdyn
import numpy as np
import pytest
from test_redundancy import CORNERS, Z, eight_legs, hinges, three_cranks

pytestmark = pytest.mark.accuracy

FRAME = {"x": {"law": "harmonic", "amplitude": 0.1, "frequency": "1.3 Hz"}, "roll": {"law": "harmonic", "amplitude": 0.2, "frequency": "0.8 Hz"},
         "yaw": {"law": "constant-rate", "start": 0.1, "rate": 0.4}}


def loop_with(**more: Any) -> dict[str, Any]:
    """A spatial four-bar that is not over-constrained, on a moving frame, with a payload that comes."""
    scene = hinges(CORNERS, [Z] * 4, ["revolute", "revolute", "cylindrical", "spherical"], rate=2.0)
    scene["frame"]["motion"] = FRAME
    scene["payload"] = [{"on": "link2.Q", "mass": 3.0, "from": 0.2}, {"on": "link1.Q", "mass": {"law": "harmonic", "mean": 1.0, "amplitude": 0.5, "frequency": "1 Hz"}}]
    return scene | more


def compare(scene: dict[str, Any], n: int = 300) -> Any:
    """Many samples (by record, where there is one) against a few by LAPACK and Gauss-Jordan, and the power balance."""
    opened = linkdyn.Scene(scene)
    t = np.linspace(0, 0.6, n)
    run = opened.inverse(t=t, want=["driving_force", "reaction", "checks"])
    assert not run.status.values.any()
    assert np.abs(run.power_imbalance.values).max() < 1e-12
    for solver in ("lapack", "gauss-jordan", "elimination"):
        few = opened.inverse(t=t[:: n // 10], solver=solver)
        for name in ("driving_force", "reaction"):
            largest = np.abs(run[name].values).max()
            np.testing.assert_allclose(few[name].values, run[name].values[:: n // 10], rtol=0, atol=1e-10 * largest)
    return run


def test_friction_on_a_moving_frame_with_payloads() -> None:
    scene = loop_with(friction=[{"joint": "J1", "coulomb": 0.15, "radius": "10 mm", "length": "60 mm"}, {"joint": "J4", "coulomb": 0.1, "radius": "8 mm"}])
    rubbed = compare(scene)
    del scene["friction"]
    ideal = compare(scene)
    assert np.abs(rubbed.driving_force.values - ideal.driving_force.values).max() > 1e-3 * np.abs(ideal.driving_force.values).max()


def test_forward_with_all_of_it() -> None:
    """Forward after inverse, with friction, frame, payloads and a soft end stop that is reached."""
    scene = loop_with(friction=[{"joint": "J1", "coulomb": 0.1, "radius": "10 mm", "length": "60 mm"}])
    scene["coordinate"][0]["motion"] = {"law": "harmonic", "mean": 0.3, "amplitude": 0.4, "frequency": "1 Hz", "phase": "90 deg"}
    scene["stop"] = [{"name": "buffer", "joint": "J1", "max": 0.6, "stiffness": 50.0, "damping": 0.1}]
    t = np.linspace(0, 0.5, 6)
    asked = 0.3 + 0.4 * np.sin(2 * np.pi * t + np.pi / 2)
    run = linkdyn.Scene(scene).forward(t=t, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(run.q.values[:, 0], asked, atol=1e-7)


def test_redundant_constraints_on_a_moving_frame() -> None:
    scene = hinges(CORNERS, [Z] * 4, rate=2.0)
    scene["frame"]["motion"] = FRAME
    scene["payload"] = [{"on": "link2.Q", "mass": 3.0, "from": 0.2}]
    compare(scene)


def test_drives_that_share_on_a_moving_frame() -> None:
    scene = three_cranks() | {"actuator": [{"joint": "OA"}, {"joint": "OB"}]}
    scene["frame"]["motion"] = {"x": FRAME["x"], "yaw": FRAME["roll"]}
    scene["payload"] = [{"on": "bar.C", "mass": 2.0}]
    compare(scene)
    platform, *_ = eight_legs()
    platform["frame"]["motion"] = FRAME
    platform["payload"] = [{"on": "platform.P0", "mass": 4.0}]
    platform["coordinate"][0] = {"link": "platform", "motion": {
        "x": {"law": "harmonic", "amplitude": 0.05, "frequency": "1 Hz"}, "y": {"law": "constant", "value": 0.0}, "z": {"law": "constant", "value": 0.6},
        "roll": {"law": "harmonic", "amplitude": 0.1, "frequency": "1 Hz"}, "pitch": {"law": "constant", "value": 0.0}, "yaw": {"law": "constant", "value": 0.1}}}
    compare(platform, 100)


def test_friction_beside_drives_that_share_is_refused() -> None:
    rub = {"coulomb": 0.1, "radius": "10 mm"}
    four = three_cranks() | {"actuator": [{"joint": "OA"}, {"joint": "OB"}], "friction": [{"joint": "OA", **rub}]}
    four["link"] = [link for link in four["link"] if link["name"] != "crankC"]
    four["joint"] = four["joint"][:4]
    with pytest.raises(linkdyn.SceneError, match="friction at joint 'OA' and more actuators than coordinates"):
        linkdyn.Scene(four)


def test_redundant_loop_against_a_hard_stop() -> None:
    """A planar four-bar in space falls on a stop as the same one in the plane does."""
    def falling(space: str) -> Any:
        scene = hinges(CORNERS, [Z] * 4)
        scene["gravity"] = [0.0, -9.81, 0.0]
        scene["coordinate"] = [{"joint": "J1", "start": 0.3}]
        scene["actuator"] = []
        scene["stop"] = [{"name": "ground", "joint": "J1", "min": 0.1, "max": 1.5, "restitution": 0.4}]
        if space == "planar":
            scene["space"] = "planar"
            scene["gravity"] = [0.0, -9.81]
            for part in (scene["frame"], *scene["link"]):
                part["markers"] = {k: {"at": m["at"][:2]} for k, m in part["markers"].items()}
            for link in scene["link"]:
                link["cog"], link["inertia"] = link["cog"][:2], link["inertia"][2]
        return linkdyn.Scene(scene).forward(t=np.linspace(0, 1.0, 11), rtol=1e-10, atol=1e-10)

    spatial, planar = falling("spatial"), falling("planar")
    np.testing.assert_allclose(spatial.q.values, planar.q.values, atol=1e-6)
