"""Newton and Euler, link by link: the forces that the engine finds, put into the equations again by another road.

Poses are the engine's; velocities and accelerations come from the joints' constraints, differentiated (`_geometry.kinematics`), and the sums are
numpy's. So nothing is shared with the kernels that write the equations down, in whatever axes, about whatever points.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn._geometry import kinematics

EXAMPLES = Path(__file__).parents[2] / "examples"
SCENES = [
    "fourbar", "sixbar_slider", "watt_i", "stephenson_iii", "slider_crank", "fivebar_parallel", "stewart_drilling", "stewart_tsai", "rcsp_start",
    "delta", "tripod",
]  # fmt: skip
SOLVERS = ["elimination", "lapack", "gauss-jordan", "gauss-jordan-plain"]
N_SAMPLES = 24
ROUNDING = 1e-8
"""Accelerations by two roads agree to some hundred roundings times the square of a condition number; a wrong arm shows in the first digit."""


@pytest.fixture(scope="module", params=SCENES)
def moved(request: pytest.FixtureRequest) -> tuple[linkdyn.Scene, Any, Any]:
    """A scene, its states and how the links move there."""
    scene = linkdyn.load(EXAMPLES / request.param / "scene.toml")
    run = scene.inverse()
    run = scene.inverse(t=run.time.values[:: max(1, run.time.size // N_SAMPLES)])
    return scene, run, kinematics.link_motion(scene, run)


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_link_is_in_balance(moved: tuple[linkdyn.Scene, Any, Any], solver: str) -> None:
    scene, run, motion = moved
    assert_balance(scene, scene.inverse(t=run.time.values, solver=solver), motion)


def assert_balance(scene: linkdyn.Scene, run: Any, motion: Any) -> None:
    """What acts on each link is what its motion asks for."""
    good = run.status.values == 0
    assert good.any()
    force, moment = inertia_and_weight(scene, motion)
    size = np.abs(force).max() + np.abs(run.reaction.values[good]).max()
    for link, point, pull, turn in acting(scene, run, motion):
        if link == 0:
            continue
        force[:, link] += pull
        moment[:, link] += turn + np.cross(point - motion.position[:, link], pull)
    reach = np.abs(motion.position[good]).max()
    assert np.abs(force[good, 1:]).max() <= ROUNDING * size
    assert np.abs(moment[good, 1:]).max() <= ROUNDING * size * max(reach, 1.0)


def inertia_and_weight(scene: linkdyn.Scene, motion: Any) -> tuple[Any, Any]:
    """(N, link, 3) each, moments about the links' origins."""
    force = np.zeros_like(motion.position)
    moment = np.zeros_like(motion.position)
    for k, link in enumerate(scene.description["links"][1:], start=1):
        centre, _, acceleration = motion.of_point(k, link["cog"])
        xx, yy, zz, xy, yz, zx = link["inertia"]
        turn = motion.rotation[:, k]
        tensor = turn @ np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]) @ np.swapaxes(turn, 1, 2)
        spin = motion.spin[:, k]
        force[:, k] = link["mass"] * (np.array(scene.description["gravity"]) - acceleration)
        moment[:, k] = np.cross(centre - motion.position[:, k], force[:, k])
        moment[:, k] -= np.einsum("nij,nj->ni", tensor, motion.spin_rate[:, k]) + np.cross(spin, np.einsum("nij,nj->ni", tensor, spin))
    return force, moment


def acting(scene: linkdyn.Scene, run: Any, motion: Any) -> list[tuple[int, Any, Any, Any]]:
    """Link, point, force, moment: reactions, drives and loads; at a joint on the second link, at its marker, and the opposite on the first."""
    found = []
    columns = [0, 1, 5] if scene.planar else list(range(6))
    for j, joint in enumerate(scene.description["joints"]):
        wrench = np.zeros((run.time.size, 6))
        wrench[:, columns] = run.reaction.values[:, j]
        found += both_links(joint, scene, motion, wrench[:, :3], wrench[:, 3:])
    joints = {joint["name"]: joint for joint in scene.description["joints"]}
    for i, actuator in enumerate(scene.description["actuators"]):
        joint = joints[actuator["name"].split(":")[0].split(".slide")[0].split(".angle")[0]]
        axis = np.array([0.0, 0.0, 1.0]) if scene.planar and actuator["unit"] != "N" else axis_of(joint, scene, motion)
        effort = run.driving_force.values[:, i, np.newaxis] * axis
        none = np.zeros_like(effort)
        found += both_links(joint, scene, motion, *((effort, none) if actuator["unit"] == "N" else (none, effort)))
    values = scene.load_values(run.time.values, run.q.values, run.qd.values, in_order=True)
    for i, load in enumerate(scene.description["loads"]):
        pull, turn = values[:, i, :3], values[:, i, 3:]
        if load["axes"] == "link":
            pull, turn = (np.einsum("nij,nj->ni", motion.rotation[:, load["link"]], v) for v in (pull, turn))
        at = marker_of(scene, load["link"], load["marker"])["at"]
        found.append((load["link"], motion.of_point(load["link"], at)[0], pull, turn))
    return found


def both_links(joint: Any, scene: linkdyn.Scene, motion: Any, force: Any, moment: Any) -> list[tuple[int, Any, Any, Any]]:
    first, second = joint["links"]
    point = motion.of_point(second, marker_of(scene, second, joint["markers"][1])["at"])[0]
    return [(second, point, force, moment), (first, point, -force, -moment)]


def axis_of(joint: Any, scene: linkdyn.Scene, motion: Any) -> Any:
    """Of a hinge or slide, world axes."""
    link, marker = joint["links"][0], joint["markers"][0]
    axis = np.array(marker_of(scene, link, marker)["axis"], dtype=float)
    return np.einsum("nij,j->ni", motion.rotation[:, link], axis / np.linalg.norm(axis))


def marker_of(scene: linkdyn.Scene, link: int, name: str) -> Any:
    return next(marker for marker in scene.description["links"][link]["markers"] if marker["name"] == name)
