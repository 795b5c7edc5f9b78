"""Inverse dynamics of a hexapod with the dynamics of a tree: what a user of MuJoCo or Pinocchio writes round it, vectorised.

Neither finds the forces of a closed loop. Legs are cut from the platform; the tree's inverse dynamics gives what would drive all its
joints; forces at the cuts and of the slides are then what makes the joints without a motor free: three equations a leg, six in all.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from work import Mechanism, timed

LEGS = 6
Inverse = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Variables of the tree, rates, accelerations (N, 24) to generalized forces (N, 24)."""


def rotation_and_axes(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R = Rx Ry Rz of (N, 3) angles, and the axes of the three in the world as columns."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angle).T, np.sin(angle).T
    rotation = np.empty((len(angle), 3, 3))
    rotation[:, 0] = np.stack([cy * cz, -cy * sz, sy], axis=1)
    rotation[:, 1] = np.stack([cx * sz + sx * sy * cz, cx * cz - sx * sy * sz, -sx * cy], axis=1)
    rotation[:, 2] = np.stack([sx * sz - cx * sy * cz, sx * cz + cx * sy * sz, cx * cy], axis=1)
    axes = np.zeros_like(rotation)
    axes[:, 0, 0] = 1.0
    axes[:, 1, 1], axes[:, 2, 1] = cx, sx
    axes[:, :, 2] = rotation[:, :, 2]
    return rotation, axes


def leg_columns(a: np.ndarray, b: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Direction of legs d = Ry(a) Rx(b) ez, its derivatives by a and b, and the end's Jacobian (..., 3, 3)."""
    ca, sa, cb, sb = np.cos(a), np.sin(a), np.cos(b), np.sin(b)
    zero = np.zeros_like(a)
    d = np.stack([sa * cb, -sb, ca * cb], axis=-1)
    da = np.stack([ca * cb, zero, -sa * cb], axis=-1)
    db = np.stack([-sa * sb, -cb, -ca * sb], axis=-1)
    return d, da, db, np.stack([s[..., None] * da, s[..., None] * db, d], axis=-1)


class Hexapod:
    """A platform behind Px Py Pz Rx Ry Rz, six legs behind Ry Rx Pz: links 0 .. 5 and 6 + 3 i .. 8 + 3 i of the tree."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.base = np.array([mechanism.links[6 + 3 * i].at for i in range(LEGS)])
        self.top = np.array([loop.points[0] for loop in mechanism.loops])

    def tree(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple]:
        """Variables of the tree with rates (N, 24), and what the loops need of the pose."""
        n = len(q)
        rotation, axes = rotation_and_axes(q[:, 3:])
        omega = np.einsum("nij,nj->ni", axes, qd[:, 3:])
        turn = [qd[:, 3, None] * axes[:, :, 0], qd[:, 3, None] * axes[:, :, 0] + qd[:, 4, None] * axes[:, :, 1]]
        alpha = np.einsum("nij,nj->ni", axes, qdd[:, 3:])
        alpha += qd[:, 4, None] * np.cross(turn[0], axes[:, :, 1]) + qd[:, 5, None] * np.cross(turn[1], axes[:, :, 2])
        arm = np.einsum("nij,kj->nki", rotation, self.top)
        spin, grow = np.broadcast_to(omega[:, None], arm.shape), np.broadcast_to(alpha[:, None], arm.shape)
        swing = np.cross(spin, arm)
        span = q[:, None, :3] + arm - self.base
        velocity = qd[:, None, :3] + swing
        acceleration = qdd[:, None, :3] + np.cross(grow, arm) + np.cross(spin, swing)
        s = np.linalg.norm(span, axis=-1)
        b = -np.arcsin(span[..., 1] / s)
        a = np.arctan2(span[..., 0], span[..., 2])
        d, da, db, jacobian = leg_columns(a, b, s)
        inverse = np.linalg.inv(jacobian)
        rate = np.einsum("nkij,nkj->nki", inverse, velocity)
        ad, bd, sd = rate[..., 0, None], rate[..., 1, None], rate[..., 2, None]
        daa = np.stack([-d[..., 0], np.zeros_like(a), -d[..., 2]], axis=-1)
        dab = np.stack([db[..., 2], np.zeros_like(a), -db[..., 0]], axis=-1)
        bias = s[..., None] * (ad**2 * daa + 2 * ad * bd * dab - bd**2 * d) + 2 * sd * (ad * da + bd * db)
        second = np.einsum("nkij,nkj->nki", inverse, acceleration - bias)
        legs = np.stack([a, b, s], axis=-1)
        whole = [np.hstack([mine, of_legs.reshape(n, -1)]) for mine, of_legs in ((q, legs), (qd, rate), (qdd, second))]
        return *whole, (axes, arm, inverse)

    def close(self, force: np.ndarray, wrench: np.ndarray, pose: tuple) -> np.ndarray:
        """Forces of the slides (N, 6) from the tree's (N, 24) and the load on the platform's origin (N, 6)."""
        axes, arm, inverse = pose
        n = len(force)
        legs = force[:, 6:].reshape(n, LEGS, 3)
        # The platform pulls each leg's end with f: J' f + (0, 0, F) = what the tree wants; f = fixed + F along
        fixed = np.einsum("nkji,nkj->nki", inverse, legs)
        along = -inverse[..., 2, :]
        wanted = force[:, :6].copy()
        wanted[:, :3] -= wrench[:, :3]
        wanted[:, 3:] -= np.einsum("nij,ni->nj", axes, wrench[:, 3:])
        # -f of all legs drives the platform
        wanted[:, :3] += fixed.sum(axis=1)
        wanted[:, 3:] += np.einsum("nij,ni->nj", axes, np.cross(arm, fixed).sum(axis=1))
        matrix = np.empty((n, 6, LEGS))
        matrix[:, :3] = -along.transpose(0, 2, 1)
        matrix[:, 3:] = -np.einsum("nij,nki->njk", axes, np.cross(arm, along))
        return np.linalg.solve(matrix, wanted[..., None])[..., 0]

    def forces(self, inverse: Inverse, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        *whole, pose = self.tree(q, qd, qdd)
        return self.close(inverse(*whole), wrench, pose)


def measure(mechanism: Mechanism, samples: str, inverse: Inverse) -> dict:
    """Times of a batch, of one pose alone and of the peer's own calls [us a pose], and forces at the reference states."""
    hexapod, given = Hexapod(mechanism), np.load(samples)
    poses = [given[name] for name in ("q", "qd", "qdd")]
    load = np.zeros((len(poses[0]), 6))
    one = [array[:1] for array in (*poses, load)]
    *whole, _ = hexapod.tree(*poses)
    n = len(load)
    exact = hexapod.forces(inverse, *(given[f"reference_{name}"] for name in ("q", "qd", "qdd", "wrench")))

    def singles() -> None:
        for _ in range(100):
            hexapod.forces(inverse, *one)

    return {
        "batch": timed(lambda: hexapod.forces(inverse, *poses, load))[0] / n * 1e6,
        "calls": timed(lambda: inverse(*whole))[0] / n * 1e6,
        "single": timed(singles)[0] / 100 * 1e6,
        "forces": exact.tolist(),
    }
