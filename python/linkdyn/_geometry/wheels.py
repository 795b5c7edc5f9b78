"""Gears, racks and belts in pictures: pitch circles, pitch lines and runs, in world axes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .postures import Posture, Postures

__all__ = ["belt_runs", "frame_of", "is_geared", "pitch_point", "rim", "rack_end_in_link", "rack_run", "rims", "runs_in_carrier", "shaft", "thread", "thread_in_link", "worms", "wheels"]

Points = NDArray[np.float64]
Wheel = tuple[int, str, float]
"""Link, marker of its centre, radius [m]."""

GEARED = ("gear", "rack", "belt")

TURNS = 3
"""Of a worm's thread in pictures: so many turns it has, but is no longer than so many pitch diameters."""


def is_geared(joint: dict[str, Any]) -> bool:
    """It holds no markers together: it ties what other joints leave."""
    return joint["type"] in GEARED


def wheels(description: dict[str, Any]) -> list[Wheel]:
    """All pitch circles, each once; worms have threads instead."""
    found = [
        (link, marker, round(radius, 12))
        for joint in description["joints"] if is_geared(joint)
        for link, marker, radius in list(zip(joint["links"], joint["markers"], joint["radii"]))[1 if joint["lead_angle"] else 0 :] if radius > 0
    ]
    return list(dict.fromkeys(found))


def rim(centre: Points, axis: Points, x: Points, radius: float, n: int = 121) -> Points:
    """(..., n, 3) points round a circle, the first in the direction x."""
    y = np.cross(axis, x)
    angles = np.linspace(0, 2 * np.pi, n)
    around: Points = np.cos(angles)[:, np.newaxis] * x[..., np.newaxis, :] + np.sin(angles)[:, np.newaxis] * y[..., np.newaxis, :]
    return centre[..., np.newaxis, :] + radius * around


def frame_of(posture: Posture | Postures, link: int, marker: str) -> tuple[Points, Points, Points]:
    """Centre, axis and x of a wheel."""
    centre, x = posture.markers[link][marker], posture.x_axes[link][marker]
    axis = np.broadcast_to([0.0, 0.0, 1.0], centre.shape) if posture.scene.planar else posture.axes[link][marker]
    return centre, axis, x


def rims(postures: Postures) -> Iterable[Points]:
    """(N, n, 3) of each pitch circle and thread: pictures have room for them."""
    circles = [rim(*frame_of(postures, link, marker), radius, 9) for link, marker, radius in wheels(postures.scene.description)]
    return circles + [thread(postures, joint) for joint in worms(postures.scene.description)]


def worms(description: dict[str, Any]) -> list[dict[str, Any]]:
    """All gears whose first wheel is a worm."""
    return [joint for joint in description["joints"] if is_geared(joint) and joint["lead_angle"]]


def thread(posture: Posture | Postures, worm: dict[str, Any], n: int = 121) -> Points:
    """(..., n, 3) points along the thread of a worm, about where it touches its wheel."""
    centre, axis, x = frame_of(posture, worm["links"][0], worm["markers"][0])
    radius, rise = worm["radii"][0], worm["radii"][0] * np.tan(worm["lead_angle"])
    middle = centre + _part(pitch_point(posture, worm) - centre, axis)
    most = min(TURNS * np.pi, TURNS * radius / abs(rise))
    angles = np.linspace(-most, most, n)[:, np.newaxis]
    around = np.cos(angles) * x[..., np.newaxis, :] + np.sin(angles) * np.cross(axis, x)[..., np.newaxis, :]
    line: Points = middle[..., np.newaxis, :] + radius * around + rise * angles * axis[..., np.newaxis, :]
    return line


def thread_in_link(postures: Postures, worm: dict[str, Any], sample: int) -> list[list[float]]:
    """The thread in the axes of the worm's link."""
    posture, link, name = postures.at(sample), worm["links"][0], worm["markers"][0]
    own = next(marker["at"] for marker in postures.scene.description["links"][link]["markers"] if marker["name"] == name)
    line: list[list[float]] = (own + (thread(posture, worm) - posture.markers[link][name]) @ postures.turns[link][sample]).round(9).tolist()
    return line


def shaft(posture: Posture | Postures, worm: dict[str, Any]) -> tuple[Points, Points]:
    """(..., 3) ends of the shaft of a worm: along its axis, from its marker through all of its thread."""
    centre, axis, _ = frame_of(posture, worm["links"][0], worm["markers"][0])
    line = thread(posture, worm)
    along = [np.einsum("...k,...k->...", line[..., end, :] - centre, axis) for end in (0, -1)]
    low, high = np.minimum(0.0, np.minimum(*along)), np.maximum(0.0, np.maximum(*along))
    return centre + low[..., np.newaxis] * axis, centre + high[..., np.newaxis] * axis


def rack_run(posture: Posture | Postures, joint: dict[str, Any]) -> tuple[Points, Points]:
    """(..., 3) from where a rack, or a rope, touches its wheel along its pitch line to the rack's marker."""
    touches = pitch_point(posture, joint)
    (_, link), (_, marker) = joint["links"], joint["markers"]
    end = touches + _part(posture.markers[link][marker] - touches, posture.axes[link][marker])
    return touches, end


def rack_end_in_link(postures: Postures, joint: dict[str, Any], sample: int) -> list[float]:
    """The end of a rack's pitch line in the axes of its link."""
    link, name = joint["links"][1], joint["markers"][1]
    own = next(marker["at"] for marker in postures.scene.description["links"][link]["markers"] if marker["name"] == name)
    _, end = rack_run(postures.at(sample), joint)
    place: list[float] = (own + (end - postures.at(sample).markers[link][name]) @ postures.turns[link][sample]).round(9).tolist()
    return place


def pitch_point(posture: Posture | Postures, joint: dict[str, Any]) -> Points:
    """(..., 3) where both wheels touch; of a belt the middle between them."""
    (a, b), (first, second) = joint["links"], joint["markers"]
    start, axis, _ = frame_of(posture, a, first)
    apart = posture.markers[b][second] - start
    point: Points = start + 0.5 * apart
    if joint["type"] == "belt":
        return point
    if joint["type"] == "rack":
        along = posture.axes[b][second]
        apart = apart - _part(apart, along)
        point = start + apart - _part(apart, axis)
        return point
    across = apart - _part(apart, axis)
    if joint["lead_angle"]:
        start = start + _part(apart, axis)
        across = across - _part(across, posture.axes[b][second])
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    inside = joint["crossed"] and joint["radii"][1] > joint["radii"][0]
    point = start + (-1.0 if inside else 1.0) * joint["radii"][0] * across / np.where(length > 0, length, 1.0)
    return point


def belt_runs(posture: Posture | Postures, joint: dict[str, Any]) -> list[tuple[Points, Points]]:
    """Both straight runs of a belt, from the first wheel to the second."""
    (a, b), (first, second) = joint["links"], joint["markers"]
    centre, axis, _ = frame_of(posture, a, first)
    apart = posture.markers[b][second] - centre
    offset = _part(apart, axis)
    distance = np.linalg.norm(apart - offset, axis=-1, keepdims=True)
    e = (apart - offset) / distance
    side = np.cross(axis, e)
    sign = -1.0 if joint["crossed"] else 1.0
    cosine = (joint["radii"][0] - sign * joint["radii"][1]) / distance
    runs = []
    for way in (1.0, -1.0):
        normal = cosine * e + way * np.sqrt(1 - cosine**2) * side
        runs.append((centre + joint["radii"][0] * normal, centre + apart + sign * joint["radii"][1] * normal))
    return runs


def runs_in_carrier(postures: Postures, joint: dict[str, Any], sample: int) -> list[list[list[float]]]:
    """The runs of a belt in the axes of the link that carries both wheels."""
    markers = postures.scene.description["links"][joint["carrier"]]["markers"]
    posture = postures.at(sample)
    name = markers[0]["name"]
    origin, axis, x = frame_of(posture, joint["carrier"], name)
    own_axis = np.array([0.0, 0.0, 1.0] if postures.scene.planar else markers[0]["axis"])
    own_x = np.array(markers[0]["x"])
    own = np.stack([own_x, np.cross(own_axis, own_x), own_axis], axis=1)
    world = np.stack([x, np.cross(axis, x), axis], axis=1)
    turn = own @ world.T
    return [[(np.array(markers[0]["at"]) + turn @ (end - origin)).tolist() for end in run] for run in belt_runs(posture, joint)]


def _part(v: Points, along: Points) -> Points:
    """What of v lies along a unit vector."""
    part: Points = np.einsum("...k,...k->...", v, along)[..., np.newaxis] * along
    return part
