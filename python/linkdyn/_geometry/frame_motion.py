"""The motion of links in axes at rest, where the frame moves itself: what inertia and weight have to do with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..errors import InputError
from ..scene import Scene
from .kinematics import LinkMotion

__all__ = ["frame_rates", "gravity_at", "with_frame"]

Vectors = NDArray[np.float64]


def with_frame(motion: LinkMotion, run: xr.Dataset, what: str) -> LinkMotion:
    """Velocities and accelerations in axes at rest, as vectors in the frame's axes; places and attitudes stay those seen from the frame.

    Raises
    ------
    InputError
        The frame moves, and the run has no time.
    """
    if not motion.scene.description["frame_moves"]:
        return motion
    turn, velocity, acceleration, spin, spin_rate = _frame(motion.scene, run, what)
    place = motion.position
    swept = np.cross(spin, place)
    return replace(
        motion,
        velocity=motion.velocity + velocity + swept,
        spin=motion.spin + spin,
        acceleration=motion.acceleration + acceleration + np.cross(spin_rate, place) + np.cross(spin, swept + 2.0 * motion.velocity),
        spin_rate=motion.spin_rate + spin_rate + np.cross(spin, motion.spin),
    )


def frame_rates(scene: Scene, run: xr.Dataset, what: str) -> tuple[Vectors, Vectors]:
    """(N, 3) velocity of the frame's origin and its angular velocity, in its axes."""
    _, velocity, _, spin, _ = _frame(scene, run, what)
    return velocity[:, 0], spin[:, 0]


def gravity_at(scene: Scene, run: xr.Dataset, what: str) -> Vectors:
    """(N, 3) gravity in the frame's axes [m/s^2]."""
    gravity = np.array(scene.description["gravity"])
    if not scene.description["frame_moves"]:
        return np.broadcast_to(gravity, (run.sizes["sample"], 3))
    turned: Vectors = np.einsum("nji,j->ni", _frame(scene, run, what)[0], gravity)
    return turned


def _frame(scene: Scene, run: xr.Dataset, what: str) -> tuple[Vectors, ...]:
    """Rotation (N, 3, 3), and (N, 1, 3) velocity and acceleration of the origin, angular velocity and acceleration, in the frame's axes."""
    if "time" not in run.coords:
        raise InputError(f"{what}: the frame of the scene moves with time (expected a run along time)")
    columns = [0, 1, 5] if scene.planar else slice(None)
    pose, rate, second = (np.zeros((run.sizes["sample"], 6)) for _ in range(3))
    for full, own in zip((pose, rate, second), scene.frame_motion(run.time.values)):
        full[:, columns] = own
    (roll, pitch, yaw), zero = pose[:, 3:].T, np.zeros(len(pose))
    axis = [np.stack(rows, axis=-1) for rows in (
        (1.0 + zero, zero, zero), (zero, np.cos(roll), np.sin(roll)), (np.sin(pitch), -np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)))]
    # the three axes about which roll, pitch and yaw turn, in axes at rest, each carried along by those before it
    spin = sum(axis[k] * rate[:, 3 + k, np.newaxis] for k in range(3))
    carried = [zero[:, np.newaxis], axis[0] * rate[:, 3:4], axis[0] * rate[:, 3:4] + axis[1] * rate[:, 4:5]]
    spin_rate = sum(axis[k] * second[:, 3 + k, np.newaxis] + np.cross(np.broadcast_to(carried[k], axis[k].shape), axis[k]) * rate[:, 3 + k, np.newaxis]
                    for k in range(3))
    yawed = np.stack([np.stack([np.cos(yaw), -np.sin(yaw), zero], -1), np.stack([np.sin(yaw), np.cos(yaw), zero], -1),
                      np.stack([zero, zero, 1.0 + zero], -1)], axis=1)
    nodding = np.stack([np.stack([np.cos(pitch), zero, np.sin(pitch)], -1), np.stack([zero, 1.0 + zero, zero], -1),
                        np.stack([-np.sin(pitch), zero, np.cos(pitch)], -1)], axis=1)
    rolled = np.stack([np.stack([1.0 + zero, zero, zero], -1), np.stack([zero, np.cos(roll), -np.sin(roll)], -1),
                       np.stack([zero, np.sin(roll), np.cos(roll)], -1)], axis=1)
    turn = rolled @ nodding @ yawed
    return turn, *(np.einsum("nji,nj->ni", turn, v)[:, np.newaxis] for v in (rate[:, :3], second[:, :3], spin, spin_rate))
