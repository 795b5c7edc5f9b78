"""Springs and dampers in pictures: coils, barrels and rods between two points, spirals and shoes round a hinge, in world axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .wheels import frame_of

if TYPE_CHECKING:
    from .postures import Posture

__all__ = ["Shape", "acts_along", "acts_round", "ends_of", "shape_of"]

Points = NDArray[np.float64]

SLIDE, ANGLE = "slide", "angle"
"""Variables of joints at which a spring can be seen; of others it has no place."""
COILS = 8
LEAD = 0.1
"""Straight part at either end of a coil, of its length."""
WIDEST = 0.2
"""Of a coil: its radius, of its length."""
BARREL = 0.55
"""Of a damper: so much of its length is barrel, the rest rod."""
INNER, OUTER, TURNS = 1.0, 2.2, 2.25
"""Radii of a spiral in units, and how often it goes round."""
SHOE = 0.6
"""Half the angle of a brake's shoe [rad]."""


@dataclass(frozen=True)
class Shape:
    """What a spring is drawn as: lines of (n, 3) points."""

    coil: tuple[Points, ...]
    """Of wire: there if it has a stiffness or a law of its force."""
    barrel: tuple[Points, ...]
    """Of what damps: thick lines,"""
    rod: tuple[Points, ...]
    """and thin ones."""


def acts_along(spring: dict[str, Any]) -> bool:
    """It lies between two points: of its own, or of a slide."""
    return not spring["joint"] or spring["variable"] == SLIDE


def acts_round(spring: dict[str, Any]) -> bool:
    """It is wound round a hinge."""
    return bool(spring["joint"]) and spring["variable"] == ANGLE


def ends_of(posture: Posture, spring: dict[str, Any]) -> Points:
    """(2, 3) where it is held."""
    return np.array([posture.markers[link][name] for link, name in zip(spring["links"], spring["markers"])])


def shape_of(posture: Posture, spring: dict[str, Any], unit: float) -> Shape | None:
    """How it looks where links are; None where it has no length, or no place.

    Parameters
    ----------
    unit
        A length that small symbols are made of [m].
    """
    pulls, damps = bool(spring["stiffness"] or spring["has_force"]), bool(spring["damping"])
    if acts_round(spring):
        first, second = (frame_of(posture, link, name) for link, name in zip(spring["links"], spring["markers"]))
        return Shape((_spiral(*second, unit),) if pulls else (), tuple(_shoes(*first, unit)) if damps else (), ())
    if not acts_along(spring):
        return None
    start, end = ends_of(posture, spring)
    length = float(np.linalg.norm(end - start))
    if not length > 0.01 * unit:    # NaN, too
        return None
    middle = start + BARREL * (end - start)
    coil = _zigzag if posture.scene.planar else _helix
    return Shape((coil(start, end, min(unit, WIDEST * length)),) if pulls else (),
                 (np.array([start, middle]),) if damps else (), (np.array([middle, end]),) if damps else ())


def _across(along: Points) -> tuple[Points, Points]:
    """Two directions across a unit vector; in the plane the first lies in it."""
    other = np.array([0.0, 0.0, 1.0]) if abs(along[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    first = np.cross(other, along)
    first /= np.linalg.norm(first)
    return first, np.cross(along, first)


def _zigzag(start: Points, end: Points, radius: float) -> Points:
    """There and back once a coil, straight at both ends."""
    n = 2 * COILS
    along = np.concatenate([[0.0, LEAD], LEAD + (1 - 2 * LEAD) * (np.arange(n) + 0.5) / n, [1 - LEAD, 1.0]])
    off = np.concatenate([[0.0, 0.0], radius * (-1.0) ** np.arange(n), [0.0, 0.0]])
    across, _ = _across((end - start) / np.linalg.norm(end - start))
    line: Points = start + along[:, np.newaxis] * (end - start) + off[:, np.newaxis] * across
    return line


def _helix(start: Points, end: Points, radius: float, n: int = 24) -> Points:
    """A coil of n points a turn."""
    part = np.linspace(0.0, 1.0, n * COILS + 1)
    along = np.concatenate([[0.0], LEAD + (1 - 2 * LEAD) * part, [1.0]])
    turn = 2 * np.pi * COILS * part
    x, y = (np.concatenate([[0.0], radius * wave, [0.0]]) for wave in (np.cos(turn), np.sin(turn)))
    first, second = _across((end - start) / np.linalg.norm(end - start))
    line: Points = start + along[:, np.newaxis] * (end - start) + x[:, np.newaxis] * first + y[:, np.newaxis] * second
    return line


def _spiral(centre: Points, axis: Points, x: Points, unit: float, n: int = 80) -> Points:
    angle = np.linspace(0.0, 2 * np.pi * TURNS, n)
    radius = unit * np.linspace(INNER, OUTER, n)
    return _at_angles(centre, axis, x, angle, radius)


def _shoes(centre: Points, axis: Points, x: Points, unit: float) -> list[Points]:
    """Two arcs, opposite each other."""
    swing = np.linspace(-SHOE, SHOE, 15)
    return [_at_angles(centre, axis, x, middle + swing, np.full(15, OUTER * unit)) for middle in (0.5 * np.pi, 1.5 * np.pi)]


def _at_angles(centre: Points, axis: Points, x: Points, angle: Points, radius: Points) -> Points:
    line: Points = centre + radius[:, np.newaxis] * (np.cos(angle)[:, np.newaxis] * x + np.sin(angle)[:, np.newaxis] * np.cross(axis, x))
    return line
