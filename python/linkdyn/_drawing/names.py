"""Where names stand in a drawing: near what they name, and clear of lines, joints and each other."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Room", "list_of", "parts_of_slots", "sampled"]

Points = NDArray[np.float64]

JOINT_RINGS = (0.6, 1.2, 2.0, 3.0)
LINK_RINGS = (0.7, 1.4, 2.4)
"""How far from its point a name may stand, in units."""
COVERED = 0.3
"""So far into another name a name may reach, in units: there is air round both."""


class Room:
    """What is left of a drawing for names.

    Parameters
    ----------
    taken
        (n, 2) points of lines and joints, so close that no name fits between two of a line.
    low, high
        Corners of the drawing.
    unit
        Half the height of a name is 0.62 of it; the distances of names from lines go by it.
    """

    def __init__(self, taken: Points, low: Points, high: Points, unit: float) -> None:
        self.taken, self.low, self.high, self.unit = taken, low, high, unit
        self.boxes: list[tuple[Points, Points]] = []

    def place(self, anchor: Points, half: Points, is_link: bool, rings: tuple[float, ...] = ()) -> Points | None:
        """Centre of the name, (2,) half as large, where it is farthest from lines and joints, and on no other; from then on it is taken.

        A name of a link may stand on its anchor. Further rings are those that a leader bridges. None where it would lie on others: two names in one
        place are none.
        """
        unit = self.unit
        places = _places_around(anchor, half, unit, is_link, rings)
        boxed = np.array([_clearance(self.taken, place, half) for place in places])
        outside = ((places - half < self.low) | (places + half > self.high)).any(axis=1)
        covered = np.array([sum(_overlap(place, half, *box) for box in self.boxes) for place in places])
        score = np.minimum(boxed, 1.2 * unit) - 0.25 * self._beyond(places, anchor, half) - 100 * unit * outside - 5 * covered
        best = int(np.argmax(score))
        if covered[best] > COVERED * unit:
            return None
        place: Points = places[best]
        self.take(place, half)
        return place

    def take(self, centre: Points, half: Points) -> None:
        """A box in which no further name is to stand."""
        self.boxes.append((centre, half))
        grid = np.linspace(-1.0, 1.0, 5)
        self.taken = np.concatenate([self.taken, centre + half * np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)])

    @staticmethod
    def _beyond(places: Points, anchor: Points, half: Points) -> Points:
        """Distance of the anchor from a name there: of a long name its end counts."""
        distance: Points = np.linalg.norm(np.maximum(np.abs(places - anchor) - half, 0.0), axis=1)
        return distance


def list_of(names: list[str]) -> str:
    """Names of what lies in one place."""
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} ... {names[-1]}"


def parts_of_slots(description: dict[str, Any]) -> set[str]:
    """Blocks and pins of a scene's slots: the engine has them besides the slide that goes by the slot's name, and that is named."""
    slides = {joint["name"] for joint in description["joints"] if joint["type"] == "prismatic"}
    blocks = {link["name"] for link in description["links"]}
    slots = {name for name in slides if f"{name}.block" in blocks}
    return {f"{name}.{part}" for name in slots for part in ("block", "pin")}


def sampled(corners: Points, step: float) -> Points:
    """Points along a line, a step apart or less; its gaps are left out."""
    parts = []
    for start, end in zip(corners[:-1], corners[1:]):
        length = np.linalg.norm(end - start)
        if np.isfinite(length):
            parts.append(start + np.linspace(0.0, 1.0, 2 + int(length / step))[:, np.newaxis] * (end - start))
    return np.concatenate([*parts, corners[np.isfinite(corners).all(axis=1)]])


def _places_around(anchor: Points, half: Points, unit: float, is_link: bool, further: tuple[float, ...]) -> Points:
    angles = np.arange(24) * (2 * np.pi / 24)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    rings = (*(LINK_RINGS if is_link else JOINT_RINGS), *further)
    places = [anchor + directions * (half + ring * unit) for ring in rings]
    return np.concatenate([[anchor], *places] if is_link else places)


def _overlap(centre: Points, half: Points, other: Points, other_half: Points) -> float:
    """How far one box would have to go to leave another; zero if it is outside."""
    return max(0.0, float(np.min(half + other_half - np.abs(centre - other))))


def _clearance(points: Points, centre: Points, half: Points) -> float:
    """Distance of the nearest point from a box; negative inside."""
    beyond = np.abs(points - centre) - half
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    inside = np.minimum(beyond.max(axis=1), 0.0)
    return float((outside + inside).min())
