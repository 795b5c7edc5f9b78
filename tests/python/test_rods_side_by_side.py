"""A platform on four rods side by side between universal joints: eight moments and four forces where two moments and three forces would do.

Their reactions by a statics of one's own, their motion as a pendulum's by Lagrange's equation.
"""

from __future__ import annotations

from typing import Any

import linkdyn
import numpy as np
import pytest
from scipy.integrate import solve_ivp

pytestmark = pytest.mark.accuracy

LENGTH, RODS, PLATE, ROD = 0.5, 4, 3.0, 0.5     # [m], rods, masses [kg]
ACROSS = 0.01                                   # moment of inertia of a rod, across it, about its centre [kg m2]
GRAVITY = np.array([0.3, 0.0, -9.81])


def spot(k: int) -> np.ndarray:
    return 0.3 * np.array([np.cos(2 * np.pi * k / RODS + 0.3), np.sin(2 * np.pi * k / RODS + 0.3), 0.0])


def scene(**lead: Any) -> dict[str, Any]:
    x, y = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]
    spots = {k: spot(k).tolist() for k in range(RODS)}
    rods = [{"name": f"rod{k}", "mass": ROD, "cog": [0, 0, 0.25], "inertia": [ACROSS, ACROSS, 0.001, 0, 0, 0],
             "markers": {"B": {"at": [0, 0, 0], "axis": y}, "P": {"at": [0, 0, LENGTH], "axis": y}}} for k in range(RODS)]
    plate = {"name": "plate", "mass": PLATE, "cog": [0.02, 0.01, 0.03], "inertia": [0.1, 0.1, 0.2, 0, 0, 0], "start": {"position": [0, 0, LENGTH]},
             "markers": {f"P{k}": {"at": spots[k], "axis": x} for k in range(RODS)}}
    joints = [{"name": f"{end}{k}", "type": "universal", "between": pair} for k in range(RODS) for end, pair in
              (("B", [f"frame.B{k}", f"rod{k}.B"]), ("P", [f"rod{k}.P", f"plate.P{k}"]))]
    return {"space": "spatial", "gravity": GRAVITY.tolist(), "frame": {"markers": {f"B{k}": {"at": spots[k], "axis": x} for k in range(RODS)}},
            "link": [plate, *rods], "joint": joints, **lead}  # fmt: skip


def test_falls_as_a_pendulum() -> None:
    """From a lean the plate goes round without turning; led by its own x and y, which no drive moves."""
    lead = {"coordinate": [{"link": "plate", "components": ["x", "y"], "start": {"x": 0.1}}]}
    t = np.linspace(0, 0.3, 7)
    run = linkdyn.Scene(scene(**lead)).forward(t=t, rtol=1e-10, atol=1e-12)
    mass = PLATE * LENGTH**2 + RODS * (ACROSS + ROD * LENGTH**2 / 4)
    arm = (PLATE + RODS * ROD / 2) * LENGTH
    fall = solve_ivp(lambda t, s: [s[1], arm * (GRAVITY[0] * np.cos(s[0]) - GRAVITY[2] * np.sin(s[0])) / mass], (0, 0.3), [np.arcsin(0.2), 0.0], t_eval=t, rtol=1e-11, atol=1e-13)
    assert (run.status == 0).all()
    np.testing.assert_allclose(run.q, np.array([LENGTH * np.sin(fall.y[0]), 0 * t]).T, atol=1e-8)


def test_reactions_by_least_squares() -> None:
    """At rest, leaning: the drives by any solution of statics, the rest the least sum of squares, of moments over the mechanism's size."""
    lean, roll = 0.5, 0.3
    lead = {"coordinate": [{"joint": "B0", "variable": "angle1", "start": roll}, {"joint": "B0", "variable": "angle2", "start": lean - np.pi / 2}],
            "actuator": [{"joint": "B0", "variable": "angle1"}, {"joint": "B0", "variable": "angle2"}]}
    made = linkdyn.Scene(scene(**lead))
    run, poses = made.inverse(want="all"), made.poses()
    assert run.status.values.tolist() == [0]
    assert {name.split(".")[0] for name in run.attrs["shared_reactions"].split()} == {f"{end}{k}" for end in "BP" for k in range(RODS)}
    place, turn = poses.position[0], poses.rotation[0]
    np.testing.assert_allclose(turn[0], np.eye(3), atol=1e-9)
    rod = turn[1]
    up, first, second = rod[:, 2], np.array([1.0, 0, 0]), rod[:, 1]
    for k in range(RODS):
        np.testing.assert_allclose(turn[1 + k] @ [0, 0, 1], up, atol=1e-9)
    np.testing.assert_allclose(place[0], LENGTH * up, atol=1e-9)
    moment = np.cross(first, second)
    columns = []

    def column(link: int, other: int, at: np.ndarray, force: np.ndarray, couple: np.ndarray) -> np.ndarray:
        """On link 1.. (rods), 0 (plate), and the opposite on another, -1: the frame; moments about the world's origin."""
        column = np.zeros(6 * (RODS + 1))
        for body, sign in ((link, 1), (other, -1)):
            if body >= 0:
                column[6 * body:6 * body + 6] += sign * np.concatenate([force, np.cross(at, force) + couple])
        return column

    for k in range(RODS):
        for link, other, at in ((1 + k, -1, spot(k)), (0, 1 + k, spot(k) + LENGTH * up)):
            columns += [column(link, other, at, e, 0 * e) for e in np.eye(3)] + [column(link, other, at, 0 * moment, moment / np.linalg.norm(moment))]
    drives = [column(1, -1, spot(0), 0 * first, first), column(1, -1, spot(0), 0 * second, second)]
    load = np.zeros(6 * (RODS + 1))
    for body in range(RODS + 1):
        weight = GRAVITY * (PLATE if body == 0 else ROD)
        centre = place[0] + [0.02, 0.01, 0.03] if body == 0 else spot(body - 1) + up * LENGTH / 2
        load[6 * body:6 * body + 6] = np.concatenate([weight, np.cross(centre, weight)])
    whole = np.linalg.lstsq(np.array(columns + drives).T, -load, rcond=1e-10)[0]
    np.testing.assert_allclose(run.driving_force.values[0], whole[-2:], atol=1e-9)
    size = np.tile([1.0, 1.0, 1.0, LENGTH], 2 * RODS)
    shared = size * np.linalg.lstsq(np.array(columns).T * size, -load - np.array(drives).T @ whole[-2:], rcond=1e-10)[0]
    ours = run.reaction.values[0].reshape(RODS, 2, 6)
    theirs = shared.reshape(RODS, 2, 4)
    np.testing.assert_allclose(ours[..., :3], theirs[..., :3], atol=1e-8 * np.abs(shared).max())
    np.testing.assert_allclose(ours[..., 3:] @ moment / np.linalg.norm(moment), theirs[..., 3], atol=1e-8 * np.abs(shared).max())
    assert all(np.abs(ours[..., 3:] @ axis).max() < 1e-9 for axis in (first, second))         # what a drive does is no reaction
