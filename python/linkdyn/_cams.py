"""Cams: their outlines in pictures, and where a follower touches them, found from poses alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ._postures import Posture, Postures

__all__ = ["Contact", "Curve", "contact_of", "is_cam", "outlines", "roller", "room_for_cams", "silhouettes"]

Points = NDArray[np.float64]

ROUND = 240
"""Points of an outline, about."""
STEPS = 40


def is_cam(joint: dict[str, Any]) -> bool:
    return bool(joint["type"] == "cam")


@dataclass(frozen=True)
class Curve:
    """A closed smooth curve as the engine describes it: a periodic cubic spline."""

    polar: bool
    u: Points
    """(n + 1) parameter at the knots."""
    value: Points
    """(n + 1, 1 or 2) radius, or x and y."""
    second: Points
    """Their second derivatives."""

    @staticmethod
    def of(joint: dict[str, Any]) -> Curve:
        curve = joint["curve"]
        u = np.array(curve["u"])
        return Curve(curve["polar"], u, np.array(curve["value"]).reshape(-1, len(u)).T, np.array(curve["second"]).reshape(-1, len(u)).T)

    def __call__(self, u: Points) -> tuple[Points, Points, Points]:
        """(..., 2) points with two derivatives by u."""
        u = self.u[0] + np.mod(u - self.u[0], self.u[-1] - self.u[0])
        i = np.clip(np.searchsorted(self.u, u, side="right") - 1, 0, len(self.u) - 2)
        h = (self.u[i + 1] - self.u[i])[..., np.newaxis]
        b = (u - self.u[i])[..., np.newaxis] / h
        a = 1 - b
        y0, y1, m0, m1 = self.value[i], self.value[i + 1], self.second[i], self.second[i + 1]
        s = a * y0 + b * y1 + ((a**3 - a) * m0 + (b**3 - b) * m1) * h**2 / 6
        s1 = (y1 - y0) / h + ((1 - 3 * a**2) * m0 + (3 * b**2 - 1) * m1) * h / 6
        s2 = a * m0 + b * m1
        if not self.polar:
            return s, s1, s2
        along = np.stack([np.cos(u), np.sin(u)], axis=-1)
        across = np.stack([-np.sin(u), np.cos(u)], axis=-1)
        return s * along, s1 * along + s * across, (s2 - s) * along + 2 * s1 * across

    def settle(self, given: Points, *, is_direction: bool) -> tuple[Points, Points, Points]:
        """(N, 2) points nearest to points, or farthest in directions, with the outward normals and (N) curvatures there."""
        start = np.linspace(self.u[0], self.u[-1], 8 * len(self.u))
        places = self(start)[0]
        if is_direction:
            best = -np.einsum("ij,nj->ni", places, given)
        else:
            best = ((places - given[:, np.newaxis]) ** 2).sum(axis=-1)
        u = start[np.argmin(best, axis=1)]
        for _ in range(STEPS):
            c, c1, c2 = self(u)
            apart = given if is_direction else c - given
            slope, growth = (c1 * apart).sum(axis=-1), (c2 * apart).sum(axis=-1)
            if not is_direction:
                growth = growth + (c1 * c1).sum(axis=-1)
            u = u - slope / growth
        c, c1, c2 = self(u)
        speed = np.linalg.norm(c1, axis=-1)
        normal = np.stack([c1[..., 1], -c1[..., 0]], axis=-1) / speed[..., np.newaxis]
        return c, normal, (c1[..., 0] * c2[..., 1] - c1[..., 1] * c2[..., 0]) / speed**3

    def outline(self, off: float) -> Points:
        """(n, 2) points all the way round, off along the normal."""
        c, c1, _ = self(np.linspace(self.u[0], self.u[-1], ROUND + 1))
        outward = np.stack([c1[:, 1], -c1[:, 0]], axis=-1) / np.linalg.norm(c1, axis=-1)[:, np.newaxis]
        points: Points = c + off * outward
        return points


@dataclass(frozen=True)
class Contact:
    """Where a follower touches, world axes (N, 3)."""

    point: Points
    """On the line of the force: the roller's centre; of a face the point that is touched."""
    normal: Points
    """Outwards from the cam."""
    round: Points
    """(N) curvature of the path of the roller's centre [1/m]; of a face the radius of the outline [m]."""


def contact_of(joint: dict[str, Any], place: Points, frame: Points, follower: Points, face: Points) -> Contact:
    """From poses: of the cam's marker (N, 3) and its frame (N, 3, 3), of the follower's marker and its axis."""
    curve = Curve.of(joint)
    flat = joint["follower"] == "flat"
    seen = np.einsum("nij,ni->nj", frame, -face if flat else follower - place)[:, :2]
    at, normal, curvature = curve.settle(seen, is_direction=flat)
    off = 0.0 if flat or joint["path"] else joint["side"] * joint["radius"]
    across = frame[:, :, :2]
    rounded = 1 / curvature if flat else curvature / (1 + off * curvature)
    return Contact(place + np.einsum("nij,nj->ni", across, at + off * normal), np.einsum("nij,nj->ni", across, normal), rounded)


# ---------------------------------------------------------------- pictures

def outlines(description: dict[str, Any], joint: dict[str, Any]) -> list[Points]:
    """(n, 3) what can be seen of a cam, in the axes of its link: its outline; of a groove both sides."""
    marker = next(entry for entry in description["links"][joint["links"][0]]["markers"] if entry["name"] == joint["markers"][0])
    x = np.array(marker["x"])
    x = x / np.linalg.norm(x)
    frame = np.stack([x, np.array([-x[1], x[0], 0.0])])
    offs = [0.0]
    if joint["path"]:
        offs = [joint["radius"], -joint["radius"]] if joint["groove"] else [-joint["side"] * joint["radius"]]
    return [np.array(marker["at"]) + Curve.of(joint).outline(off) @ frame for off in offs]


def silhouettes(posture: Posture | Postures, joint: dict[str, Any]) -> list[Points]:
    """The same in world axes: (..., n, 3)."""
    description = posture.scene.description
    link, marker = joint["links"][0], joint["markers"][0]
    entry = next(entry for entry in description["links"][link]["markers"] if entry["name"] == marker)
    own = np.array(entry["x"]) / np.linalg.norm(entry["x"])
    centre, x = posture.markers[link][marker], posture.x_axes[link][marker]
    cosine, sine = x @ own, x @ np.array([-own[1], own[0], 0.0])
    found = []
    for line in outlines(description, joint):
        arm = line - np.array(entry["at"])
        turned = np.stack([-arm[:, 1], arm[:, 0], arm[:, 2]], axis=-1)
        found.append(centre[..., np.newaxis, :] + np.asarray(cosine)[..., np.newaxis, np.newaxis] * arm + np.asarray(sine)[..., np.newaxis, np.newaxis] * turned)
    return found


def roller(posture: Posture | Postures, joint: dict[str, Any]) -> Points:
    """(..., n, 3) of a roller round its marker."""
    centre = posture.markers[joint["links"][1]][joint["markers"][1]]
    angles = np.linspace(0, 2 * np.pi, 49)
    circle = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    points: Points = centre[..., np.newaxis, :] + joint["radius"] * circle
    return points


def room_for_cams(postures: Postures) -> Iterable[Points]:
    """(N, n, 3) that pictures have room for."""
    cams = [joint for joint in postures.scene.description["joints"] if is_cam(joint)]
    return [points[:, ::12] for joint in cams for points in (*silhouettes(postures, joint), roller(postures, joint))]
