"""Inverse dynamics in all coordinates of all links, by Lagrange's multipliers: slow, plain, and nothing of it is linkdyn's.

Constraints of joints are written out (points that coincide, directions that stay square) and evaluated with first and second derivatives
along the motion; their rows follow from velocities of one. Reads scenes as dicts, with plain numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Multibody", "Taylor", "rotation", "sine_of_cross"]

Array = NDArray[np.float64]
Pose = list[tuple[Array, Array]]
Parts = list[tuple[Callable[[Any], Any], list[int]]]
"""Functions of the motion of all links, and the links each depends on."""
ALL = ["x", "y", "z", "roll", "pitch", "yaw"]
PLANE = ["x", "y", "yaw"]


@dataclass
class Taylor:
    """A value with its first and second derivative in time."""

    v: Any
    d: Any = 0.0
    a: Any = 0.0

    def __add__(self, other: Any) -> Taylor:
        o = of(other)
        return Taylor(self.v + o.v, self.d + o.d, self.a + o.a)

    def __sub__(self, other: Any) -> Taylor:
        o = of(other)
        return Taylor(self.v - o.v, self.d - o.d, self.a - o.a)

    def __matmul__(self, other: Any) -> Taylor:
        o = of(other)
        return Taylor(self.v @ o.v, self.d @ o.v + self.v @ o.d, self.a @ o.v + 2 * (self.d @ o.d) + self.v @ o.a)

    def __getitem__(self, k: Any) -> Taylor:
        return Taylor(self.v[k], self.d[k], self.a[k])

    def __neg__(self) -> Taylor:
        return Taylor(-self.v, -self.d, -self.a)

    @property
    def T(self) -> Taylor:  # noqa: N802
        return Taylor(self.v.T, self.d.T, self.a.T)


def of(value: Any) -> Taylor:
    return value if isinstance(value, Taylor) else Taylor(value, np.zeros_like(value, dtype=float), np.zeros_like(value, dtype=float))


def angle_of(sine: Taylor, cosine: Taylor) -> Taylor:
    square = sine.v**2 + cosine.v**2
    rate = (cosine.v * sine.d - sine.v * cosine.d) / square
    change = (cosine.v * sine.a - sine.v * cosine.a - 2 * rate * (sine.v * sine.d + cosine.v * cosine.d)) / square
    return Taylor(np.arctan2(sine.v, cosine.v), rate, change)


def root(x: Taylor) -> Taylor:
    r = np.sqrt(x.v)
    return Taylor(r, x.d / (2 * r), x.a / (2 * r) - x.d**2 / (4 * r**3))


def cross_matrix(w: Array) -> Array:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def rotation(vector: Array) -> Array:
    """By a vector's length about it."""
    k = cross_matrix(vector)
    size = np.linalg.norm(vector)
    return np.eye(3) + np.sinc(size / np.pi) * k + 0.5 * np.sinc(size / (2 * np.pi)) ** 2 * (k @ k)


def sine_of_cross(a: Array, b: Array) -> Array:
    """A unit vector square to both."""
    c = np.cross(a, b)
    return c / np.linalg.norm(c)


def three(values: Any) -> Array:
    return np.array([*values, 0.0][:3], dtype=float)


def stacked(values: list[Taylor]) -> Taylor:
    return Taylor(*(np.concatenate([np.atleast_1d(getattr(value, part)) for value in values]) for part in "vda"))


class Multibody:
    """Of a scene whose markers have an `axis` and an `x` where joints need them."""

    def __init__(self, scene: dict[str, Any]) -> None:
        self.scene, self.planar = scene, scene["space"] == "planar"
        self.links = [link["name"] for link in scene["link"]]
        self.joints = {joint["name"]: joint for joint in scene["joint"]}
        self.gravity = three(scene.get("gravity", [0, 0, 0]))
        self.markers = {}
        for name, markers in [("frame", scene["frame"]["markers"]), *((link["name"], link["markers"]) for link in scene["link"])]:
            for key, marker in markers.items():
                self.markers[f"{name}.{key}"] = (name, *self._marker(marker))

    def _marker(self, marker: Any) -> tuple[Array, Array]:
        if not isinstance(marker, dict):
            marker = {"at": marker}
        if self.planar:
            x, z = three(marker.get("axis", [1, 0])), np.array([0.0, 0, 1])
            x /= np.linalg.norm(x)
        else:
            z = np.array(marker.get("axis", [0.0, 0, 1]))
            z = z / np.linalg.norm(z)
            x = np.array(marker.get("x", [1.0, 0, 0]))
            x = x - (x @ z) * z
            x /= np.linalg.norm(x)
        return three(marker["at"]), np.column_stack([x, np.cross(z, x), z])

    # ---------------------------------------------------------------- kinematics

    def moving(self, pose: Pose, rate: Array | None = None, change: Array | None = None) -> list[tuple[Taylor, Taylor]]:
        """Origins and rotations of the links, with velocities and accelerations (6 n) of both."""
        still = np.zeros(6 * len(pose))
        rates, changes = (np.reshape(still if x is None else x, (-1, 2, 3)) for x in (rate, change))
        found = []
        for (place, turn), (v, w), (a, alpha) in zip(pose, rates, changes):
            spin = cross_matrix(w)
            found.append((Taylor(place, v, a), Taylor(turn, spin @ turn, (cross_matrix(alpha) + spin @ spin) @ turn)))
        return found

    def marker(self, name: str, motion: Any) -> tuple[Taylor, Taylor]:
        link, at, axes = self.markers[name]
        if link == "frame":
            return of(at), of(axes)
        place, turn = motion[self.links.index(link)]
        return place + turn @ at, turn @ of(axes)

    def _pair(self, joint: dict[str, Any], motion: Any) -> tuple[Taylor, Taylor, Taylor]:
        (p, a), (q, b) = (self.marker(name, motion) for name in joint["between"])
        return q - p, a, b

    def constraints_of(self, joint: dict[str, Any], motion: Any) -> Taylor:
        gap, a, b = self._pair(joint, motion)
        x, y, z = (a[:, i] for i in range(3))
        if self.planar:
            return stacked({"revolute": [gap[0], gap[1]], "prismatic": [y @ gap, x @ b[:, 1]]}[joint["type"]])
        parallel, across = [x @ b[:, 2], y @ b[:, 2]], [x @ gap, y @ gap]
        return stacked({
            "revolute": [gap, *parallel], "spherical": [gap], "cylindrical": across + parallel, "prismatic": [*across, *parallel, x @ b[:, 1]],
            "universal": [gap, z @ b[:, 2]],
        }[joint["type"]])

    def constraints(self) -> Parts:
        parts: Parts = [(lambda m, j=joint: self.constraints_of(j, m), self._ends(joint)) for joint in self.scene["joint"]]
        if self.planar:
            parts += [(lambda m, k=k: stacked([m[k][0][2], m[k][1][0, 2], m[k][1][1, 2]]), [k]) for k in range(len(self.links))]
        return parts

    def _ends(self, joint: dict[str, Any]) -> list[int]:
        """The moving links that a joint holds."""
        return [self.links.index(link) for link in (self.markers[marker][0] for marker in joint["between"]) if link != "frame"]

    def variable(self, joint: dict[str, Any], name: str | None, motion: Any) -> Taylor:
        gap, a, b = self._pair(joint, motion)
        if name == "slide" or joint["type"] == "prismatic":
            return a[:, 0 if self.planar else 2] @ gap
        return angle_of(b[:, 0] @ a[:, 1], b[:, 0] @ a[:, 0])

    def coordinates(self) -> Parts:
        parts: Parts = []
        for c in self.scene["coordinate"]:
            if "joint" in c:
                parts.append(self._driven(c))
                continue
            links = [self.links.index(c[key]) for key in ("link", "relative_to") if key in c]
            links += [self.links.index(self.markers[c["marker"]][0])] if "marker" in c else []
            parts += [(lambda m, c=c, name=name: stacked([self._component(c, name, m)]), links)
                      for name in (PLANE if self.planar else ALL) if name in c["components"]]
        return parts

    def _driven(self, table: dict[str, Any]) -> tuple[Callable[[Any], Taylor], list[int]]:
        """The joint variable that a coordinate or an actuator is."""
        joint = self.joints[table["joint"]]
        return lambda m: stacked([self.variable(joint, table.get("variable"), m)]), self._ends(joint)

    def _component(self, c: dict[str, Any], name: str, motion: Any) -> Taylor:
        link = c.get("link") or self.markers[c["marker"]][0]
        place, turn = motion[self.links.index(link)]
        if "marker" in c:
            place = place + turn @ self.markers[c["marker"]][1]
        if "relative_to" in c:
            base, axes = motion[self.links.index(c["relative_to"])]
            place, turn = axes.T @ (place - base), axes.T @ turn
        if name in ("x", "y", "z"):
            return place["xyz".index(name)]
        return {
            "roll": lambda: angle_of(-turn[1, 2], turn[2, 2]), "yaw": lambda: angle_of(-turn[0, 1], turn[0, 0]),
            "pitch": lambda: angle_of(turn[0, 2], root(turn[1, 2:3] @ turn[1, 2:3] + turn[2, 2:3] @ turn[2, 2:3])),
        }[name]()

    def rows(self, parts: Parts, pose: Pose) -> Array:
        """(rows, 6 n): rates for a unit of each velocity."""
        still, found = self.moving(pose), []
        units = [[self.moving([one], unit)[0] for unit in np.eye(6)] for one in pose]
        for function, links in parts:
            block = np.zeros((len(function(still).v), 6 * len(pose)))
            for k in links:
                for i in range(6):
                    block[:, 6 * k + i] = function([*still[:k], units[k][i], *still[k + 1 :]]).d
            found.append(block)
        return np.concatenate(found)

    @staticmethod
    def values(parts: Parts, motion: Any) -> Taylor:
        return stacked([function(motion) for function, _ in parts])

    def place(self, q: Array, pose: Pose) -> Pose:
        """Newton's method from a pose near by."""
        for _ in range(12):
            motion = self.moving(pose)
            off = q - self.values(self.coordinates(), motion).v
            off = np.where(np.abs(off) > np.pi, off - 2 * np.pi * np.round(off / (2 * np.pi)), off)
            matrix = self.rows(self.constraints() + self.coordinates(), pose)
            step = np.linalg.solve(matrix, np.concatenate([-self.values(self.constraints(), motion).v, off])).reshape(-1, 2, 3)
            pose = [(p + dp, rotation(w) @ r) for (p, r), (dp, w) in zip(pose, step)]
            if np.abs(step).max() < 1e-13:
                break
        return pose

    # ---------------------------------------------------------------- forces

    def inverse(self, q: Array, qd: Array, qdd: Array, pose: Pose) -> tuple[Array, dict[str, Array], Pose]:
        """Driving forces; reactions on the second links at their markers; poses."""
        pose = self.place(q, pose)
        closed, led = self.rows(self.constraints(), pose), self.rows(self.coordinates(), pose)
        matrix = np.vstack([closed, led])
        rate = np.linalg.solve(matrix, np.concatenate([np.zeros(len(closed)), qd]))
        motion = self.moving(pose, rate)
        drift = [self.values(parts, motion).a for parts in (self.constraints(), self.coordinates())]
        change = np.linalg.solve(matrix, np.concatenate([-drift[0], qdd - drift[1]]))
        driven = self.rows([self._driven(actuator) for actuator in self.scene["actuator"]], pose)
        asked = self._asked(pose, rate, change)
        force = np.linalg.solve(np.vstack([closed, driven]).T, asked)
        reaction, first = {}, 0
        for name, joint in self.joints.items():
            n = len(self.constraints_of(joint, motion).v)
            links = [self.markers[marker][0] for marker in joint["between"]]
            side = 1 if links[1] != "frame" else 0
            k = self.links.index(links[side])
            pull = (2 * side - 1) * closed[first : first + n, 6 * k : 6 * k + 6].T @ force[first : first + n]
            at = self.marker(joint["between"][1], motion)[0].v
            reaction[name] = np.concatenate([pull[:3], pull[3:] - np.cross(at - pose[k][0], pull[:3])])
            first += n
        return force[len(closed) :], reaction, pose

    def _asked(self, pose: Pose, rate: Array, change: Array) -> Array:
        """Inertia less weight and loads, about the links' origins."""
        asked = np.zeros((len(pose), 2, 3))
        motion = self.moving(pose, rate, change)
        for k, link in enumerate(self.scene["link"]):
            turn, spin, spin_rate = pose[k][1], rate[6 * k + 3 : 6 * k + 6], change[6 * k + 3 : 6 * k + 6]
            centre = motion[k][0] + motion[k][1] @ three(link["cog"])
            tensor = link["inertia"]
            tensor = np.diag([0, 0, tensor]) if self.planar else np.array([[tensor[0], tensor[3], tensor[5]], [tensor[3], tensor[1], tensor[4]], [tensor[5], tensor[4], tensor[2]]])
            tensor = turn @ tensor @ turn.T
            pull = link["mass"] * (centre.a - self.gravity)
            asked[k] = pull, tensor @ spin_rate + np.cross(spin, tensor @ spin) + np.cross(centre.v - pose[k][0], pull)
        for load in self.scene.get("load", []):
            name, at, _ = self.markers[load["on"]]
            k = self.links.index(name)
            pull = three(load["force"])
            asked[k] -= pull, np.cross(pose[k][1] @ at, pull)
        return asked.reshape(-1)
