"""How the links move along a run: velocities and accelerations from the constraints of all joints, differentiated once and twice.

The engine's closed forms are not used beyond the poses, so what follows from here (momentum, shaking forces) is a road of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .._arguments import by_labels
from .._cycle.averages import good_samples
from .._pose import poses_of
from ..errors import InputError
from ..scene import Scene
from .cams import Contact, Curve, contact_of
from .postures import placed_poses
from .wheels import is_geared

__all__ = ["LinkMotion", "Rows", "link_motion", "links_at_rest", "variable_acceleration", "variable_of"]

Vectors = NDArray[np.float64]

BLOCK = 256
"""Samples whose equations are solved together: some ten megabytes for a hexapod."""
AT_POLE = 1e-4
"""Cosine of the pitch below which accelerations from rates of angles have lost more than eight digits."""
INDEPENDENT = 1e-12
"""Smallest part of the largest pivot that still tells a velocity: below, rounding does."""


@dataclass(frozen=True)
class LinkMotion:
    """Of the frame (number 0) and all links, world axes; NaN at samples that failed."""

    scene: Scene
    position: Vectors
    """(N, link, 3) of the origins [m]."""
    rotation: Vectors
    """(N, link, 3, 3) from link to world axes."""
    velocity: Vectors
    """(N, link, 3) of the origins [m/s]."""
    spin: Vectors
    """(N, link, 3) angular velocity [rad/s]."""
    acceleration: Vectors
    """(N, link, 3) of the origins [m/s^2]."""
    spin_rate: Vectors
    """(N, link, 3) angular acceleration [rad/s^2]."""

    def of_point(self, link: int, at: Any) -> tuple[Vectors, Vectors, Vectors]:
        """Position, velocity and acceleration (N, 3) of a point of a link, given in its axes."""
        arm = self.rotation[:, link] @ np.asarray(at, dtype=float)
        spin = self.spin[:, link]
        swept = np.cross(spin, arm)
        return (
            self.position[:, link] + arm,
            self.velocity[:, link] + swept,
            self.acceleration[:, link] + np.cross(self.spin_rate[:, link], arm) + np.cross(spin, swept),
        )


@dataclass(frozen=True)
class Rows:
    """Linear equations for the velocities of some links, and what is left of their time derivatives at zero acceleration."""

    links: tuple[int, ...]
    factors: tuple[Vectors, ...]
    """(N, 6) of velocity and spin, for each link."""
    drift: Vectors
    """(N,)"""

    def plus(self, part: Vectors, other: Rows) -> Rows:
        """With so much (N,) of other equations for the same links."""
        factors = tuple(own + part[:, np.newaxis] * more for own, more in zip(self.factors, other.factors))
        return Rows(self.links, factors, self.drift + part * other.drift)


def link_motion(scene: Scene, run: xr.Dataset) -> LinkMotion:
    """Motion of all links at the samples of a run.

    Raises
    ------
    InputError
        A coordinate is an angle of a spherical joint, or a link is not held by joints and coordinates.
    """
    motion = links_at_rest(scene, run)
    parts = [_solved(motion, run, slice(k, k + BLOCK)) for k in range(0, len(motion.position), BLOCK)]
    joined = [np.concatenate(values) for values in zip(*parts)]
    bad = ~good_samples(run)
    for values in (motion.position, motion.rotation, *joined):
        values[bad] = np.nan
    return LinkMotion(scene, motion.position, motion.rotation, *joined)


def links_at_rest(scene: Scene, run: xr.Dataset) -> LinkMotion:
    """Where the links are, without velocities."""
    poses = placed_poses(scene, run, "motion of links")
    n = len(poses.status)
    position = np.concatenate([np.zeros((n, 1, 3)), poses.position], axis=1)
    rotation = np.concatenate([np.broadcast_to(np.eye(3), (n, 1, 3, 3)), poses.rotation], axis=1)
    still = np.zeros_like(position)
    return LinkMotion(scene, position, rotation, still, still, still, still)


def variable_of(scene: Scene, name: str) -> tuple[dict[str, Any], str] | None:
    """Joint and variable that a coordinate or actuator is called by: "J1", "C.slide", "J1:brake"; None if it is no joint's."""
    joints = {joint["name"]: joint for joint in scene.description["joints"]}
    if name not in joints and ":" in name:
        name = name.rpartition(":")[0]
    owner, _, variable = name.rpartition(".")
    if name in joints:
        return joints[name], "slide" if joints[name]["type"] == "prismatic" else "angle"
    return (joints[owner], variable) if owner in joints else None


def variable_acceleration(motion: LinkMotion, joint: dict[str, Any], variable: str) -> Vectors:
    """(N,) second derivative of a joint variable, of a joint that `variable_of` finds."""
    row = _of_variable(_Pair(motion, joint), joint, variable)
    found = row.drift.copy()
    for link, factor in zip(row.links, row.factors):
        found += np.einsum("ni,ni->n", factor, np.concatenate([motion.acceleration[:, link], motion.spin_rate[:, link]], axis=1))
    return found


def _solved(motion: LinkMotion, run: xr.Dataset, block: slice) -> tuple[Vectors, Vectors, Vectors, Vectors]:
    """Velocities and accelerations of a block of samples."""
    scene = motion.scene
    rest = LinkMotion(scene, *(values[block] for values in (
        motion.position, motion.rotation, motion.velocity, motion.spin, motion.acceleration, motion.spin_rate)))
    q, qd, qdd = (np.nan_to_num(by_labels(name, run[name], scene.coordinates)[block]) for name in ("q", "qd", "qdd"))
    given = {name: (pose.angular_velocity[block], pose.angular_acceleration[block]) for name, pose in poses_of(run, scene).items()}
    rows = _constraints(rest)
    leading, speeds, _ = _coordinates(rest, q, qd, qdd, given)
    n_bound = len(rows)
    matrix = _matrix([*rows, *leading], scene)
    if idle := len(scene.description["idle_spins"].split()):
        matrix = np.concatenate([matrix, _still_spins(matrix, idle)], axis=1)
    if matrix.shape[1] < matrix.shape[2]:
        raise InputError("the joints and coordinates do not hold every link (expected a scene that inverse dynamics takes)")
    basis, triangle = np.linalg.qr(matrix)
    pivots = np.abs(np.diagonal(triangle, axis1=1, axis2=2))
    is_told = pivots.min(axis=1) > INDEPENDENT * pivots.max(axis=1)
    triangle[~is_told] = np.eye(triangle.shape[-1])

    def solve(right: Vectors) -> Vectors:
        found = np.linalg.solve(triangle, np.swapaxes(basis, 1, 2) @ right[..., np.newaxis])[..., 0]
        found[~is_told] = np.nan
        n = len(found)
        return np.concatenate([np.zeros((n, 1, 6)), found.reshape(n, -1, 6)], axis=1)

    nothing = np.zeros(len(q))
    still = [nothing] * (matrix.shape[1] - n_bound - len(leading))
    rate = solve(np.stack([*[nothing] * n_bound, *speeds, *still], axis=1))
    moving = LinkMotion(scene, rest.position, rest.rotation, rate[..., :3], rate[..., 3:], rest.acceleration, rest.spin_rate)
    leading, _, accelerations = _coordinates(moving, q, qd, qdd, given)
    bound = [-row.drift for row in _constraints(moving)]
    led = [value - row.drift for value, row in zip(accelerations, leading)]
    change = solve(np.stack([*bound, *led, *still], axis=1))
    return rate[..., :3], rate[..., 3:], change[..., :3], change[..., 3:]


def _still_spins(matrix: Vectors, n_idle: int) -> Vectors:
    """(N, n_idle, columns): bodies of revolution that may spin about their own axis, and nothing is changed by it, do not.

    The axis is what the other equations leave open. It moves with the body, so that the rate of these equations has no further terms. Where a position leaves
    more open than that, the pivots tell.
    """
    turned = np.linalg.svd(matrix)[2]
    spins = turned[:, -n_idle:].copy()
    spins.reshape(len(spins), n_idle, -1, 2, 3)[:, :, :, 0] = 0.0     # of velocity and spin the latter
    return spins


def _matrix(rows: list[Rows], scene: Scene) -> Vectors:
    """(N, rows, 6 n_link); in the plane with what keeps every link in it."""
    n, n_link = len(rows[0].drift), len(scene.links)
    matrix = np.zeros((n, len(rows) + (3 * n_link if scene.planar else 0), 6 * (n_link + 1)))
    for i, row in enumerate(rows):
        for link, factor in zip(row.links, row.factors):
            matrix[:, i, 6 * link : 6 * link + 6] += factor
    if scene.planar:
        for k in range(n_link):
            for i, place in enumerate((2, 3, 4)):       # vz, and the spin about x and y
                matrix[:, len(rows) + 3 * k + i, 6 * (k + 1) + place] = 1.0
    return matrix[:, :, 6:]


# ---------------------------------------------------------------- joints

def _constraints(motion: LinkMotion) -> list[Rows]:
    joints = motion.scene.description["joints"]
    held = [row for joint in joints if not is_geared(joint) for row in _of_joint(motion, joint)]
    return held + [_of_gear(motion, joint) for joint in joints if is_geared(joint) and not joint["stretches"]]


def _of_gear(motion: LinkMotion, gear: dict[str, Any]) -> Rows:
    """The sum of joint variables that wheels keep."""
    joints = {joint["name"]: joint for joint in motion.scene.description["joints"]}
    links: list[int] = []
    factors: list[Vectors] = []
    drift = np.zeros(len(motion.position))
    for entry in gear["tied"]:
        joint, weight = joints[entry["joint"]], entry["weight"]
        row = _of_variable(_Pair(motion, joint), joint, "slide" if joint["type"] == "prismatic" else "angle")
        links += row.links
        factors += [weight * factor for factor in row.factors]
        drift = drift + weight * row.drift
    return Rows(tuple(links), tuple(factors), drift)


def _of_joint(motion: LinkMotion, joint: dict[str, Any]) -> list[Rows]:
    """What a joint forbids."""
    pair = _Pair(motion, joint)
    across = pair.across()
    whole = [motion.rotation[:, pair.first, :, i] for i in range(3)]
    match joint["type"]:
        case "revolute":
            return [pair.apart(e) for e in whole] + [pair.turning(e) for e in across]
        case "prismatic":
            return [pair.apart(e) for e in across] + [pair.turning(e) for e in whole]
        case "cylindrical":
            return [pair.apart(e) for e in across] + [pair.turning(e) for e in across]
        case "universal":
            return [*(pair.apart(e) for e in whole), pair.turning_between()]
        case "spherical":
            return [pair.apart(e) for e in whole]
        case "fixed":
            return [pair.apart(e) for e in whole] + [pair.turning(e) for e in whole]
        case "planar":
            return [pair.apart(pair.axes[0])] + [pair.turning(e) for e in across]
        case "screw":
            return [*(pair.apart(e) for e in across), *(pair.turning(e) for e in across), pair.advance(joint["lead"])]
        case "cam":
            rate = pair.rising if joint["barrel"] else pair.pressed if joint["follower"] == "flat" else pair.touching
            return [rate(joint)]
    raise AssertionError(joint["type"])


class _Pair:
    """Two links at a joint."""

    def __init__(self, motion: LinkMotion, joint: dict[str, Any], markers: list[dict[str, Any]] | None = None) -> None:
        self.first, self.second = joint["links"]
        markers = markers or [
            next(marker for marker in motion.scene.description["links"][link]["markers"] if marker["name"] == name)
            for link, name in zip(joint["links"], joint["markers"])
        ]
        self.arms = [motion.rotation[:, link] @ np.array(marker["at"]) for link, marker in zip(joint["links"], markers)]
        upright = {"revolute": (0, 1), "cam": (0,)}.get(joint["type"], ()) if motion.scene.planar else ()
        self.axes = [
            np.broadcast_to([0.0, 0.0, 1.0], self.arms[0].shape) if side in upright else motion.rotation[:, link] @ _unit(marker["axis"])
            for side, (link, marker) in enumerate(zip(joint["links"], markers))
        ]
        self.x = motion.rotation[:, self.first] @ _unit(markers[0]["x"])
        self.spins = [motion.spin[:, link] for link in joint["links"]]
        places = [motion.position[:, link] + arm for link, arm in zip(joint["links"], self.arms)]
        speeds = [motion.velocity[:, link] + np.cross(spin, arm) for link, spin, arm in zip(joint["links"], self.spins, self.arms)]
        self.gap, self.gap_rate = places[1] - places[0], speeds[1] - speeds[0]

    def across(self) -> list[Vectors]:
        """Two directions square to the first link's axis, fixed in it."""
        axis = self.axes[0]
        smallest = np.eye(3)[np.argmin(np.abs(axis), axis=1)]
        first = np.cross(axis, smallest)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        return [first, np.cross(axis, first)]

    def apart(self, e: Vectors) -> Rows:
        """Rate of the gap between both markers along a direction e of the first link."""
        first, second = self.spins
        turned = np.cross(first, e)
        factors = (np.hstack([-e, np.cross(e, self.arms[0] + self.gap)]), np.hstack([e, np.cross(self.arms[1], e)]))
        inward = np.cross(second, np.cross(second, self.arms[1])) - np.cross(first, np.cross(first, self.arms[0]))
        drift = _dot(inward, e) + 2 * _dot(self.gap_rate, turned) + _dot(self.gap, np.cross(first, turned))
        return Rows((self.first, self.second), factors, drift)

    def turning(self, c: Vectors, by: int = 0) -> Rows:
        """Relative spin about a direction c of the first link (or the second: ``by`` = 1)."""
        return self._turning(c, np.cross(self.spins[by], c))

    def advance(self, lead: float) -> Rows:
        """How far a screw goes beyond what its turning asks for."""
        return self.apart(self.axes[0]).plus(np.full(len(self.gap), -lead / (2 * np.pi)), self.turning(self.axes[0]))

    def touching(self, cam: dict[str, Any]) -> Rows:
        """Rate of the gap between follower and cam. To second order a roller's centre, or a point, goes on a circle fixed in the cam."""
        contact, speed = self._touch(cam)
        e, axis = contact.normal, self.axes[0]
        along = speed - _dot(speed, e)[:, np.newaxis] * e - _dot(speed, axis)[:, np.newaxis] * axis
        gap = self.apart(e)
        return Rows(gap.links, gap.factors, gap.drift + contact.round * _dot(along, along))

    def pressed(self, cam: dict[str, Any]) -> Rows:
        """The same of a face, whose trace in the cam's plane touches a circle fixed in the cam. The trace turns with the spin about
        ``across``, not about the axis alone: that of a face which leans turns with the spin about the normal, too.
        """
        contact, speed = self._touch(cam)
        e, axis = contact.normal, self.axes[0]
        way = np.cross(axis, e)
        upwards = _dot(self.axes[1], axis)
        lean = upwards / np.sqrt(1 - upwards**2)
        across = axis + lean[:, np.newaxis] * e
        spin = self.spins[1] - self.spins[0]
        turn, sideways = _dot(across, spin), _dot(way, spin)
        arm = _dot(self.gap - contact.point, way)
        rows = self.apart(e).plus(arm, self.turning(across))
        leaning = (1 + lean**2) * sideways * _dot(e, spin) + lean * turn * sideways    # `across` is not fixed in the cam
        return Rows(rows.links, rows.factors, rows.drift + arm * leaning + 2 * turn * _dot(way, speed) - turn**2 * contact.round)

    def _touch(self, cam: dict[str, Any]) -> tuple[Contact, Vectors]:
        """Contact as seen from the cam's marker, and how fast the follower's goes as the cam sees it."""
        contact = contact_of(cam, np.zeros_like(self.gap), self.frame(), self.gap, self.axes[1])
        return contact, self.gap_rate - np.cross(self.spins[0], self.gap)

    def rising(self, cam: dict[str, Any]) -> Rows:
        """Rate of the height of a follower above a curve round a drum. To second order that is a parabola over the angle, fixed in the cam."""
        frame = self.frame()
        seen = np.einsum("nij,ni->nj", frame, self.gap)
        speed = np.einsum("nij,ni->nj", frame, self.gap_rate - np.cross(self.spins[0], self.gap))
        far = np.hypot(seen[:, 0], seen[:, 1])
        _, slope, bend = Curve.of(cam).radius(np.arctan2(seen[:, 1], seen[:, 0]))
        turned = (seen[:, 0] * speed[:, 1] - seen[:, 1] * speed[:, 0]) / far**2
        away = (seen[:, 0] * speed[:, 0] + seen[:, 1] * speed[:, 1]) / far
        gradient = np.stack([slope * seen[:, 1] / far**2, -slope * seen[:, 0] / far**2, np.ones_like(far)], axis=1)
        rows = self.apart(np.einsum("nij,nj->ni", frame, gradient))
        return Rows(rows.links, rows.factors, rows.drift + 2 * slope * turned * away / far - bend * turned**2)

    def frame(self) -> Vectors:
        """(N, 3, 3) axes of the first marker, in columns."""
        return np.stack([self.x, np.cross(self.axes[0], self.x), self.axes[0]], axis=2)

    def turning_between(self) -> Rows:
        """Relative spin about what is square to both axes."""
        a, b = self.axes
        rate = np.cross(np.cross(self.spins[0], a), b) + np.cross(a, np.cross(self.spins[1], b))
        return self._turning(np.cross(a, b), rate)

    def _turning(self, c: Vectors, rate: Vectors) -> Rows:
        none = np.zeros_like(c)
        return Rows((self.first, self.second), (np.hstack([none, -c]), np.hstack([none, c])), _dot(self.spins[1] - self.spins[0], rate))


# ---------------------------------------------------------------- coordinates

def _coordinates(
    motion: LinkMotion, q: Vectors, qd: Vectors, qdd: Vectors, given: Mapping[str, tuple[Vectors, Vectors]]
) -> tuple[list[Rows], list[Vectors], list[Vectors]]:
    """Equations of the coordinates, with their rates and accelerations on the right; ``given`` are spins of links with their rates."""
    scene = motion.scene
    rows: list[Rows] = []
    rates: list[Vectors] = []
    accelerations: list[Vectors] = []
    numbers = {link["name"]: k for k, link in enumerate(scene.description["links"])}
    poses: dict[str, dict[str, int]] = {}
    for i, name in enumerate(scene.coordinates):
        described = scene.description["coordinates"][i]
        if "component" in described:
            rows.append(_of_component(motion, described))
            rates.append(qd[:, i])
            accelerations.append(qdd[:, i])
            continue
        found = variable_of(scene, name)
        if found is None:
            link, _, component = name.rpartition(".")
            poses.setdefault(link, {})[component] = i
            continue
        rows.append(_of_variable(_Pair(motion, found[0]), *found))
        rates.append(qd[:, i])
        accelerations.append(qdd[:, i])
    for link, places in poses.items():
        more_rows, more_rates, more_accelerations = _of_pose(motion, numbers[link], places, q, qd, qdd, given.get(link))
        rows += more_rows
        rates += more_rates
        accelerations += more_accelerations
    return rows, rates, accelerations


def _of_variable(pair: _Pair, joint: dict[str, Any], variable: str) -> Rows:
    if variable == "slide":
        return pair.apart(pair.axes[0])
    if joint["type"] == "planar" and variable in ("x", "y"):
        return pair.apart(pair.x if variable == "x" else np.cross(pair.axes[0], pair.x))
    if variable in ("angle", "angle1"):
        return pair.turning(pair.axes[0])
    if variable == "angle2":
        return pair.turning(pair.axes[1], by=1)
    raise InputError(f"coordinate '{joint['name']}.{variable}' is an angle of a spherical joint: motions of its links are not told "
                     "(expected other coordinates, such as the pose of a link)")


def _of_component(motion: LinkMotion, coordinate: dict[str, Any]) -> Rows:
    """A part of a link's pose as another link, or the frame, sees it."""
    first, second = coordinate["links"]
    markers = motion.scene.description["links"][second]["markers"]
    at = next((marker["at"] for marker in markers if marker["name"] == coordinate["marker"]), [0.0, 0.0, 0.0])
    pair = _Pair(motion, {"links": [first, second], "type": "measure"}, [_marker(), _marker(at)])
    turned = motion.rotation[:, first]
    component = coordinate["component"]
    if component in ("x", "y", "z"):
        return pair.apart(turned[:, :, "xyz".index(component)])
    # the spin between both links is the sum of the angles' rates about three axes that turn with what comes before; square to two
    # of them is what tells the rate about the third
    roll, yaw = turned[:, :, 0], motion.rotation[:, second, :, 2]
    pitch = np.cross(yaw, roll)
    cosine = np.linalg.norm(pitch, axis=1, keepdims=True)
    pitch = pitch / cosine
    tells = {"roll": np.cross(pitch, yaw) / cosine, "pitch": pitch, "yaw": np.cross(roll, pitch) / cosine}
    spins = pair.spins
    rates = {name: _dot(tells[name], spins[1] - spins[0])[:, np.newaxis] for name in tells}
    drift = (rates["roll"] * np.cross(spins[0], roll) + rates["pitch"] * np.cross(spins[0] + rates["roll"] * roll, pitch)
             + rates["yaw"] * np.cross(spins[1], yaw))
    c = tells[component]
    none = np.zeros_like(c)
    return Rows((first, second), (np.hstack([none, -c]), np.hstack([none, c])), -_dot(c, drift))


def _of_pose(
    motion: LinkMotion, link: int, places: dict[str, int], q: Vectors, qd: Vectors, qdd: Vectors, given: tuple[Vectors, Vectors] | None
) -> tuple[list[Rows], list[Vectors], list[Vectors]]:
    """R = Rx(roll) Ry(pitch) Rz(yaw): the spin is the sum of the rates about the axes that each turns about.

    At the pole, pitch a right angle, these rates do not tell it: it is NaN there, unless it is given.
    """
    n = len(q)

    def of(values: Vectors, name: str) -> Vectors:
        return values[:, places[name]] if name in places else np.zeros(n)

    def row(place: int) -> Rows:
        factor = np.zeros((n, 6))
        factor[:, place] = 1.0
        return Rows((0, link), (np.zeros((n, 6)), factor), np.zeros(n))

    roll, pitch = of(q, "roll"), of(q, "pitch")
    zero, one = np.zeros(n), np.ones(n)
    axes = {
        "roll": np.stack([one, zero, zero], axis=1),
        "pitch": np.stack([zero, np.cos(roll), np.sin(roll)], axis=1),
        "yaw": np.stack([np.sin(pitch), -np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)], axis=1),
    }
    spin, spin_rate = np.zeros((n, 3)), np.zeros((n, 3))
    for name, axis in axes.items():
        rate = of(qd, name)[:, np.newaxis] * axis
        spin_rate += of(qdd, name)[:, np.newaxis] * axis + np.cross(spin, rate)
        spin += rate
    if given is not None:
        spin, spin_rate = given
    else:
        at_pole = np.abs(np.cos(pitch)) < AT_POLE
        spin[at_pole], spin_rate[at_pole] = np.nan, np.nan
    rows, rates, accelerations = [], [], []
    for place, name in enumerate("xyz"):
        if name in places:
            rows.append(row(place))
            rates.append(of(qd, name))
            accelerations.append(of(qdd, name))
    for place in (2,) if motion.scene.planar else (0, 1, 2):
        rows.append(row(3 + place))
        rates.append(spin[:, place])
        accelerations.append(spin_rate[:, place])
    return rows, rates, accelerations


def _marker(at: Sequence[float] = (0.0, 0.0, 0.0)) -> dict[str, Any]:
    """A marker that no scene has, in the link's axes."""
    return {"at": at, "axis": [0.0, 0.0, 1.0], "x": [1.0, 0.0, 0.0]}


def _unit(vector: Any) -> Vectors:
    values: Vectors = np.asarray(vector, dtype=float)
    values = values / np.linalg.norm(values)
    return values


def _dot(a: Vectors, b: Vectors) -> Vectors:
    products: Vectors = np.einsum("nk,nk->n", a, b)
    return products
