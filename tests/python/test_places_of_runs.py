"""Where the links of a run are: its joint variables tell, however far its samples are apart and wherever it begins."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from numpy.typing import NDArray

SCENES = Path(__file__).resolve().parents[1] / "scenes"
UPPER, FORE, RADIUS = 0.5, 0.3, 0.25
"""Lengths of an arm whose hand cannot come nearer to its shoulder than their difference, and the circle it goes round there."""
RATE = 2 * np.pi


def reaching_arm(samples: int) -> linkdyn.Scene:
    """Led by its hand, once round its shoulder at a constant speed: it turns as a rigid body does. No weight."""
    hand = {"amplitude": RADIUS, "frequency": RATE, "law": "harmonic"}
    return linkdyn.Scene({
        "space": "planar",
        "frame": {"markers": {"A": [0, 0]}},
        "link": [{"name": "upper", "mass": 2, "inertia": 0.1, "cog": [UPPER / 2, 0], "markers": {"A": [0, 0], "B": [UPPER, 0]}, "start": {"angle": "-60 deg"}},
                 {"name": "fore", "mass": 1, "inertia": 0.05, "cog": [FORE / 2, 0], "markers": {"B": [0, 0], "hand": [FORE, 0]},
                  "start": {"position": [UPPER, 0], "angle": "170 deg"}}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "upper.A"]}, {"name": "B", "type": "revolute", "between": ["upper.B", "fore.B"]}],
        "coordinate": [{"marker": "fore.hand", "components": ["x", "y"], "driven": True, "motion": {"x": {**hand, "phase": np.pi / 2}, "y": hand}}],
        "actuator": [{"joint": "A"}, {"joint": "B"}],
        "time": {"end": 1, "samples": samples},
    })


def elbow(run: Any) -> NDArray[np.float64]:
    """By the triangle of shoulder, elbow and hand, the elbow to the right of the way to the hand."""
    angle = RATE * run.time.values - np.arccos((UPPER**2 + RADIUS**2 - FORE**2) / (2 * UPPER * RADIUS))
    return UPPER * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def assert_turns(run: Any) -> None:
    """Places, velocities and accelerations of the elbow, and what two masses on circles do to the frame."""
    assert not run.status.any()
    told, place = run.linkdyn.marker("upper.B"), elbow(run)
    hand = RADIUS * np.stack([np.cos(RATE * run.time.values), np.sin(RATE * run.time.values)], axis=1)
    np.testing.assert_allclose(told.position, place, atol=1e-9)
    np.testing.assert_allclose(told.velocity, RATE * np.stack([-place[:, 1], place[:, 0]], axis=1), atol=1e-7)
    np.testing.assert_allclose(told.acceleration, -(RATE**2) * place, atol=1e-6)
    np.testing.assert_allclose(run.linkdyn.shaking().force, RATE**2 * (2 * place / 2 + 1 * (place + hand) / 2), atol=1e-6)


@pytest.mark.parametrize("method", ["rk8pd", "gbs"])
def test_four_samples_a_turn(method: str) -> None:
    """Straight ways between them lead where the arm cannot go. The run itself neither gains nor loses energy: rounding is none that jumps."""
    run = reaching_arm(5).forward(method=method)
    assert run.attrs["stopped"] == ""
    assert_turns(run)
    np.testing.assert_allclose(run.driving_force, np.broadcast_to(run.driving_force[0], run.driving_force.shape), atol=1e-7)


def test_a_part_of_a_run() -> None:
    run = reaching_arm(101).inverse()
    assert_turns(run)
    assert_turns(run.isel(sample=slice(37, None, 23)))


def test_coordinates_alone_may_not_tell() -> None:
    run = reaching_arm(5).forward().drop_vars(["joint_variable", "joint_rate"])
    for ask in (run.linkdyn.shaking, lambda: run.linkdyn.marker("upper.B"), lambda: run.linkdyn.relative_pose("fore", "upper")):
        with pytest.raises(linkdyn.InputError, match="do not tell where the links are at . samples .expected joint variables"):
            ask()


def test_joints_seen_from_behind() -> None:
    """Ball and universal joint of a loop written from the rocker's side: the way through the joints goes against them."""
    content = tomllib.loads((SCENES / "rsur.toml").read_text())
    crank = np.linspace(0, 1, 9)[:, np.newaxis]
    placed = linkdyn.Scene(content).poses(crank, in_order=True)
    for joint in content["joint"]:
        if joint["type"] in ("spherical", "universal"):
            joint["between"].reverse()
    content["joint"].sort(key=lambda joint: joint["type"] == "revolute")    # the rocker is not reached by its hinge
    scene = linkdyn.Scene(content)
    run = scene.inverse(crank, t=np.arange(9.0))
    assert not run.status.any() and not placed.status.any()
    told = scene.poses(joint_variable=run.joint_variable.values)
    assert not told.status.any()
    np.testing.assert_allclose(told.position, placed.position, atol=1e-10)
    np.testing.assert_allclose(told.rotation, placed.rotation, atol=1e-10)


def test_a_body_without_joints_is_not_told() -> None:
    scene = linkdyn.Scene({
        "space": "planar", "frame": {"markers": {"A": [0, 0]}},
        "link": [{"name": "rod", "mass": 1, "markers": {"A": [0, 0]}}, {"name": "stone", "mass": 1, "inertia": 0.1}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "rod.A"]}],
        "coordinate": [{"joint": "A"}, {"link": "stone", "start": {"position": [1, 2]}}],
    })
    assert scene.poses().status.tolist() == [0]
    assert scene.poses(joint_variable=[[0.3]]).status.tolist() == [1]
