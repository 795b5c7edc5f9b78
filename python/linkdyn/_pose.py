"""Motions of links that are known as quaternions or rotation matrices: ``scene.inverse(pose={"platform": pose})``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ._arguments import as_floats, as_known, by_labels, dimensions
from ._bind import spline
from .errors import InputError

if TYPE_CHECKING:
    from .scene import Scene

__all__ = ["Pose", "as_poses", "attitude_variables", "pose_columns", "poses_of", "quaternion_of"]

Floats = NDArray[np.float64]
OFF = 1e-6
"""By how much a matrix may miss being a rotation: six digits may have been written."""


def quaternion_of(rotation: Floats) -> Floats:
    """Unit quaternions w x y z (..., 4) of rotations (..., 3, 3), w not negative."""
    r = rotation
    xx, yy, zz = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    wx, wy, wz = r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]
    xy, xz, yz = r[..., 1, 0] + r[..., 0, 1], r[..., 0, 2] + r[..., 2, 0], r[..., 2, 1] + r[..., 1, 2]
    # row k: 4 times component k times (w, x, y, z); the largest component loses no digits
    rows = np.stack([
        np.stack([1 + xx + yy + zz, wx, wy, wz], axis=-1),
        np.stack([wx, 1 + xx - yy - zz, xy, xz], axis=-1),
        np.stack([wy, xy, 1 - xx + yy - zz, yz], axis=-1),
        np.stack([wz, xz, yz, 1 - xx - yy + zz], axis=-1),
    ], axis=-2)  # fmt: skip
    largest = np.argmax(np.diagonal(rows, axis1=-2, axis2=-1), axis=-1)
    found = np.take_along_axis(rows, largest[..., np.newaxis, np.newaxis], axis=-2)[..., 0, :]
    found = found / np.linalg.norm(found, axis=-1, keepdims=True)
    signed: Floats = np.where(found[..., :1] < 0, -found, found)
    return signed


def rotation_of(quaternion: Floats) -> Floats:
    """Rotations (..., 3, 3) of quaternions w x y z (..., 4) of any length but zero."""
    w, x, y, z = np.moveaxis(quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


@dataclass(frozen=True, eq=False)
class Pose:
    """Where a link is and how it moves, sample by sample: its attitude as quaternions or rotation matrices, which have no pole.

    Parameters
    ----------
    position
        (N, 3) of the link's origin, or of the marker whose pose the coordinates are [m]; of a ball joint none.
    quaternion
        (N, 4) w x y z, of any length but zero: from link axes to world axes (of a pose ``relative_to`` a link, to that link's; of a
        ball joint, from the second marker's axes to the first's). Or one of the two that follow.
    rotation
        (N, 3, 3) rotation matrices.
    matrix
        (N, 4, 4) homogeneous matrices, which tell the position as well.
    velocity, acceleration
        (N, 3) of that point [m/s, m/s2]; left out, zero.
    angular_velocity, angular_acceleration
        (N, 3) in the axes to which the quaternion leads, as their link sees it [rad/s, rad/s2]; left out, zero.

    Examples
    --------
    >>> import numpy as np
    >>> pose = linkdyn.Pose(position=[[0.0, 0.0, 1.0]], quaternion=[[1.0, 0.0, 0.0, 0.0]], angular_velocity=[[0.0, 0.0, 2.0]])
    >>> pose.rotation[0]
    array([[1., 0., 0.],
           [0., 1., 0.],
           [0., 0., 1.]])

    Raises
    ------
    InputError
        None or several of ``quaternion``, ``rotation``, ``matrix``; a wrong shape; no rotation.
    """

    position: Floats
    quaternion: Floats
    velocity: Floats
    angular_velocity: Floats
    acceleration: Floats
    angular_acceleration: Floats
    has_position: bool

    def __init__(
        self,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
        *,
        rotation: ArrayLike | None = None,
        matrix: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        angular_velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        angular_acceleration: ArrayLike | None = None,
    ) -> None:
        place, attitude = _attitude(position, quaternion, rotation, matrix)
        n = len(attitude)
        rates = {
            "velocity": velocity,
            "angular_velocity": angular_velocity,
            "acceleration": acceleration,
            "angular_acceleration": angular_acceleration,
        }
        if place is None and (velocity is not None or acceleration is not None):
            raise InputError("pose: velocity, acceleration: given without position")
        self._set("has_position", place is not None)
        self._set("position", np.zeros((n, 3)) if place is None else place)
        self._set("quaternion", attitude)
        for name, values in rates.items():
            self._set(name, np.zeros((n, 3)) if values is None else as_floats(f"pose: {name}", values, (n, 3)))

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.quaternion)

    def __repr__(self) -> str:
        return f"<linkdyn.Pose: {len(self)} sample{'s' * (len(self) != 1)}>"

    @property
    def rotation(self) -> Floats:
        """(N, 3, 3) from link to world axes."""
        return rotation_of(self.quaternion)

    @property
    def matrix(self) -> Floats:
        """(N, 4, 4) homogeneous matrices."""
        found = np.zeros((len(self), 4, 4))
        found[:, :3, :3], found[:, :3, 3], found[:, 3, 3] = self.rotation, self.position, 1.0
        return found

    @classmethod
    def through(
        cls,
        t: ArrayLike,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
        *,
        rotation: ArrayLike | None = None,
        matrix: ArrayLike | None = None,
        at: ArrayLike | None = None,
    ) -> Pose:
        """The motion through poses at instants, with its velocities and accelerations.

        Splines go through positions and quaternions as through the columns of a table in a scene file: cubic, with continuous
        second derivative and not-a-knot ends; what they make of a quaternion's length has no part in the attitude.

        Parameters
        ----------
        t
            (M,) increasing instants [s], two at least.
        position, quaternion, rotation, matrix
            As of `Pose`, at these instants. A quaternion and its opposite are one attitude.
        at
            (N,) instants within ``t`` at which the motion is told [s]; default: ``t``.
        """
        place, attitude = _attitude(position, quaternion, rotation, matrix)
        t = as_floats("pose: t", t, (len(attitude),))
        if len(t) < 2 or not (np.diff(t) > 0).all():
            raise InputError("pose: t: expected two increasing instants at least")
        if place is not None and (lost := np.flatnonzero(~np.isfinite(place).all(axis=1))).size:
            raise InputError(f"pose: position[{lost[0]}] is not finite")
        at = t if at is None else as_floats("pose: at", at, (None,))
        if len(at) and not (t[0] <= at.min() and at.max() <= t[-1]):
            raise InputError(f"pose: at: expected instants from {t[0]:g} s to {t[-1]:g} s")
        p, p1, p2 = _spline(t, _lined_up(attitude), at)
        square = (p * p).sum(axis=1, keepdims=True)
        omega = 2 * _turning(p, p1) / square
        alpha = 2 * _turning(p, p2) / square - omega * (2 * (p * p1).sum(axis=1, keepdims=True) / square)
        given: dict[str, Any] = {"quaternion": p, "angular_velocity": omega, "angular_acceleration": alpha}
        if place is not None:
            given |= dict(zip(("position", "velocity", "acceleration"), _spline(t, place, at)))
        return cls(**given)


def as_poses(given: Mapping[str, Any], description: Mapping[str, Any]) -> dict[str, Pose]:
    """What a call says of poses, checked against the attitudes of the scene."""
    known = {attitude["name"]: attitude for attitude in description["attitudes"]}
    if not known:
        raise InputError("pose: no link's whole pose, and no ball joint's three angles, are coordinates of the scene (expected q)")
    if not given:
        raise InputError(f"pose: is empty (expected {', '.join(known)})")
    sizes = set()
    for name, pose in given.items():
        as_known("pose", name, list(known), "link or ball joint whose attitude is a coordinate")
        if not isinstance(pose, Pose):
            raise InputError(f"pose[{name!r}]: expected a linkdyn.Pose, got {type(pose).__name__}")
        if pose.has_position != known[name]["is_pose"]:
            raise InputError(f"pose[{name!r}]: {'expected position' if known[name]['is_pose'] else 'position: these coordinates have none'}")
        sizes.add(len(pose))
    if len(sizes) > 1:
        raise InputError(f"pose: expected as many samples of each, got {', '.join(map(str, sorted(sizes)))}")
    return dict(given)


def pose_columns(scene: Scene, name: str) -> list[int]:
    """Coordinates that a pose tells."""
    attitude = next(attitude for attitude in scene.description["attitudes"] if attitude["name"] == name)
    angles = [int(angle) for angle in attitude["angles"]]
    place = list(range(angles[0] - 3, angles[0])) if attitude["is_pose"] else []
    return place + angles


def attitude_variables(given: Mapping[str, Pose]) -> dict[str, Any]:
    """Attitudes that were given, for the Dataset of a run."""
    axes = {"attitude": list(given), "quaternion_component": list("wxyz"), "axis": list("xyz")}
    told = {
        "quaternion": ("quaternion_component", "1", "attitude that was given, as quaternion"),
        "angular_velocity": ("axis", "rad/s", "angular velocity that was given"),
        "angular_acceleration": ("axis", "rad/s2", "angular acceleration that was given"),
    }
    found: dict[str, Any] = {
        name: (("sample", "attitude", axis), np.stack([getattr(pose, name) for pose in given.values()], axis=1), {"units": unit, "long_name": words})
        for name, (axis, unit, words) in told.items()
    }
    return found | axes


def poses_of(run: xr.Dataset, scene: Scene) -> dict[str, Pose]:
    """The same, of a run that has them."""
    found = {}
    for k, name in enumerate(run.attitude.values.tolist() if "attitude" in run.coords else []):
        q, qd, qdd = (by_labels(variable, run[variable], scene.coordinates)[:, pose_columns(scene, name)] for variable in ("q", "qd", "qdd"))
        is_pose = q.shape[1] == 6
        place = {"position": q[:, :3], "velocity": qd[:, :3], "acceleration": qdd[:, :3]} if is_pose else {}
        found[name] = Pose(
            **place,
            quaternion=run.quaternion.values[:, k],
            angular_velocity=run.angular_velocity.values[:, k],
            angular_acceleration=run.angular_acceleration.values[:, k],
        )
    return found


def _attitude(
    position: ArrayLike | None, quaternion: ArrayLike | None, rotation: ArrayLike | None, matrix: ArrayLike | None
) -> tuple[Floats | None, Floats]:
    """Positions, and unit quaternions, from one of the three ways to give an attitude."""
    given = [name for name, values in (("quaternion", quaternion), ("rotation", rotation), ("matrix", matrix)) if values is not None]
    if len(given) != 1:
        raise InputError(f"pose: {', '.join(given) or 'no attitude'}: expected one of quaternion, rotation and matrix")
    place = position
    if matrix is not None:
        if position is not None:
            raise InputError("pose: position: given beside matrix, which tells it (expected one of them)")
        whole = as_floats("pose: matrix", matrix, (None, 4, 4))
        if not np.allclose(whole[:, 3], [0, 0, 0, 1], rtol=0, atol=OFF):
            raise InputError("pose: matrix: expected the last row 0 0 0 1")
        place, rotation = whole[:, :3, 3], whole[:, :3, :3]
    if rotation is not None:
        r = as_floats(f"pose: {given[0]}", rotation, (None, 3, 3))
        bad = np.flatnonzero(~(np.abs(r @ np.swapaxes(r, 1, 2) - np.eye(3)).max(axis=(1, 2)) <= OFF) | ~(np.linalg.det(r) > 0))
        if bad.size:
            raise InputError(f"pose: {given[0]}[{bad[0]}] is not a rotation (expected three orthonormal axes, determinant 1)")
        attitude = quaternion_of(r)
    else:
        assert quaternion is not None
        if dimensions("pose: quaternion", quaternion, "(N, 4)") == 1:
            raise InputError("pose: quaternion: expected shape (N, 4), got (4,)")
        attitude = as_floats("pose: quaternion", quaternion, (None, 4))
        size = np.linalg.norm(attitude, axis=1)
        bad = np.flatnonzero(~((size > 0) & np.isfinite(size)))
        if bad.size:
            raise InputError(f"pose: quaternion[{bad[0]}] is no attitude (expected w x y z, finite and not all zero)")
        attitude = attitude / size[:, np.newaxis]
    return (None if place is None else as_floats("pose: position", place, (len(attitude), 3))), attitude


def _lined_up(quaternion: Floats) -> Floats:
    """Each on the side of the one before: p and -p are one attitude."""
    near = (quaternion[1:] * quaternion[:-1]).sum(axis=1)
    far = np.flatnonzero(np.abs(near) < 0.5)  # the cosine of half of 120 degrees
    if far.size:
        raise InputError(f"pose: the attitude {far[0] + 1} is more than 120 degrees from the one before (expected ones near enough to define the rotation between them)")
    sign = np.cumprod(np.concatenate([[1.0], np.where(near < 0, -1.0, 1.0)]))
    lined: Floats = quaternion * sign[:, np.newaxis]
    return lined


def _turning(a: Floats, b: Floats) -> Floats:
    """The vector of b times the conjugate of a."""
    found: Floats = a[:, :1] * b[:, 1:] - b[:, :1] * a[:, 1:] - np.cross(b[:, 1:], a[:, 1:])
    return found


def _spline(t: Floats, values: Floats, at: Floats) -> tuple[Floats, Floats, Floats]:
    """The engine's splines through the columns of ``values``, and their first and second derivatives."""
    columns = [spline(t, column, at) for column in values.T]
    value, rate, acceleration = (np.stack(of_columns, axis=1) for of_columns in zip(*columns))
    return value, rate, acceleration
