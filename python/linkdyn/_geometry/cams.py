"""Cams: their outlines in pictures, and where a follower touches them, found from poses alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .wheels import frame_of, rim

if TYPE_CHECKING:
    from collections.abc import Iterable

    from .postures import Posture, Postures

__all__ = ["Contact", "Curve", "contact_of", "face", "face_radius", "is_cam", "outlines_in_link", "roller", "roller_axis", "room_for_cams", "silhouettes"]

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
        s, s1, s2 = self._splined(u)
        if not self.polar:
            return s, s1, s2
        along = np.stack([np.cos(u), np.sin(u)], axis=-1)
        across = np.stack([-np.sin(u), np.cos(u)], axis=-1)
        return s * along, s1 * along + s * across, (s2 - s) * along + 2 * s1 * across

    def _splined(self, u: Points) -> tuple[Points, Points, Points]:
        u = self.u[0] + np.mod(u - self.u[0], self.u[-1] - self.u[0])
        i = np.clip(np.searchsorted(self.u, u, side="right") - 1, 0, len(self.u) - 2)
        h = (self.u[i + 1] - self.u[i])[..., np.newaxis]
        b = (u - self.u[i])[..., np.newaxis] / h
        a = 1 - b
        y0, y1, m0, m1 = self.value[i], self.value[i + 1], self.second[i], self.second[i + 1]
        s = a * y0 + b * y1 + ((a**3 - a) * m0 + (b**3 - b) * m1) * h**2 / 6
        return s, (y1 - y0) / h + ((1 - 3 * a**2) * m0 + (3 * b**2 - 1) * m1) * h / 6, a * m0 + b * m1

    def radius(self, angle: Points) -> tuple[Points, Points, Points]:
        """(...) radius at angles with two derivatives, of a polar curve."""
        s, s1, s2 = self._splined(angle)
        return s[..., 0], s1[..., 0], s2[..., 0]

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

def outlines(posture: Posture | Postures, joint: dict[str, Any]) -> list[Points]:
    """(n, 3) what can be seen of a cam, in the axes of its marker: its outline, of a groove both sides; round a drum each followed by
    that end of the drum to which it goes on.
    """
    curve, radius = Curve.of(joint), joint["radius"]
    offs = [0.0]
    if joint["path"] or joint["barrel"]:
        offs = [radius, -radius] if joint["groove"] else [-joint["side"] * radius]
    if not joint["barrel"]:
        lines = [curve.outline(off) for off in offs]
        return [np.concatenate([line, np.zeros((len(line), 1))], axis=1) for line in lines]
    far = float(np.linalg.norm(_across(posture, joint), axis=-1).flat[0])
    angle = np.linspace(curve.u[0], curve.u[-1], ROUND + 1)
    height, slope, _ = curve.radius(angle)
    height = height + joint["ground"]
    steep = slope / far
    level = 1 / np.sqrt(1 + steep**2)
    room = max(2.0 * radius, 0.15 * float(np.ptp(height)))
    found = []
    for off in offs:
        end = float(height.max()) + room if off > 0 or (joint["side"] < 0 and not joint["groove"]) else float(height.min()) - room
        found += [_on_drum(far, angle - off * steep * level / far, height + off * level), _on_drum(far, angle, np.full_like(angle, end))]
    return found


def _on_drum(far: float, angle: Points, height: Points) -> Points:
    return np.stack([far * np.cos(angle), far * np.sin(angle), height], axis=-1)


def _across(posture: Posture | Postures, joint: dict[str, Any]) -> Points:
    """(..., 3) from the axis of a cam to its follower, world axes."""
    (cam, follower), (first, second) = joint["links"], joint["markers"]
    centre, axis, _ = frame_of(posture, cam, first)
    gap = posture.markers[follower][second] - centre
    across: Points = gap - np.einsum("...k,...k->...", gap, axis)[..., np.newaxis] * axis
    return across


def silhouettes(posture: Posture | Postures, joint: dict[str, Any]) -> list[Points]:
    """The same in world axes: (..., n, 3)."""
    centre, axis, x = frame_of(posture, joint["links"][0], joint["markers"][0])
    frame = np.stack([x, np.cross(axis, x), axis], axis=-2)
    return [centre[..., np.newaxis, :] + line @ frame for line in outlines(posture, joint)]


def outlines_in_link(postures: Postures, sample: int, joint: dict[str, Any]) -> list[Points]:
    """The same in the axes of the cam's link."""
    link, name = joint["links"][0], joint["markers"][0]
    marker = next(entry for entry in postures.scene.description["links"][link]["markers"] if entry["name"] == name)
    x = np.array(marker["x"])
    axis = np.array([0.0, 0.0, 1.0] if postures.scene.planar else marker["axis"])
    frame = np.stack([x, np.cross(axis, x), axis])
    return [np.array(marker["at"]) + line @ frame for line in outlines(postures.at(sample), joint)]


def roller_axis(posture: Posture | Postures, joint: dict[str, Any]) -> tuple[Points, Points]:
    """(..., 3) about which a roller turns, along the cam's axis or across that of a drum, and a direction across it."""
    _, axis, x = frame_of(posture, joint["links"][0], joint["markers"][0])
    if not joint["barrel"]:
        return axis, x
    across = _across(posture, joint)
    return across / np.linalg.norm(across, axis=-1, keepdims=True), axis


def roller(posture: Posture | Postures, joint: dict[str, Any]) -> Points:
    """(..., n, 3) of a roller round its marker."""
    return rim(posture.markers[joint["links"][1]][joint["markers"][1]], *roller_axis(posture, joint), joint["radius"], 49)


def face_radius(lines: list[Points]) -> float:
    """Of a flat face in pictures, by the outline that it lies on."""
    spans = np.sort(np.ptp(lines[0], axis=0))
    return 0.5 * float(spans[-2])


def face(posture: Posture | Postures, joint: dict[str, Any]) -> Points:
    """(..., n, 3) of a flat face across its marker's axis: a round plate, in a plane a line."""
    link, name = joint["links"][1], joint["markers"][1]
    radius = face_radius(outlines(posture, joint))
    if not posture.scene.planar:
        return rim(*frame_of(posture, link, name), radius, 49)
    along = np.cross([0.0, 0.0, radius], posture.axes[link][name])
    ends: Points = posture.markers[link][name][..., np.newaxis, :] + np.array([[-1.0], [1.0]]) * along[..., np.newaxis, :]
    return ends


def room_for_cams(postures: Postures) -> Iterable[Points]:
    """(N, n, 3) that pictures have room for."""
    cams = [joint for joint in postures.scene.description["joints"] if is_cam(joint)]
    riders = [face(postures, joint) if joint["follower"] == "flat" else roller(postures, joint)[:, ::12] for joint in cams]
    return [points[:, ::12] for joint in cams for points in silhouettes(postures, joint)] + riders
