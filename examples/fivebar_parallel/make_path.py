#!/usr/bin/env python3
"""The lecture's homework 3: what the two cranks must do so that J3 runs along a straight line. Writes path.csv.

Seen from J3, each crank with its rod is two links between two known points: the lecture's RRR_links gives the elbow with its
velocity and acceleration, link_angle the crank's angle.

    python make_path.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from linkdyn.lecture import Point, RRR_links, link_angle

FROM, TO = np.array([-0.15, 0.60]), np.array([0.20, 0.75])  # of J3 [m]
DURATION = 1.0  # [s]
CRANK, ROD = 0.4, 0.6  # [m]
J1, J5 = Point((0.05, 0.0)), Point((-0.05, 0.0))
ROWS = 401


def path(t: NDArray[np.float64]) -> Point:
    """J3: from rest to rest along the line, the way s = u - sin(2 pi u)/(2 pi) of it at u = t/DURATION."""
    turn = 2 * np.pi * t / DURATION
    s = (turn - np.sin(turn)) / (2 * np.pi)
    ds = (1 - np.cos(turn)) / DURATION
    dds = 2 * np.pi * np.sin(turn) / DURATION**2
    return Point(*(start + value[:, np.newaxis] * (TO - FROM) for start, value in ((FROM, s), (0.0, ds), (0.0, dds))))


def crank_angles(t: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Angles of the cranks at J1 and J5, their rates and accelerations, each (N, 2) [rad, rad/s, rad/s2]; elbows outward."""
    J3 = path(t)
    first = link_angle(J1, RRR_links(J1, J3, CRANK, ROD, -1))
    second = link_angle(J5, RRR_links(J5, J3, CRANK, ROD, +1))
    pairs = ((first.the, second.the), (first.dthe, second.dthe), (first.ddthe, second.ddthe))
    return tuple(np.stack(pair, axis=-1) for pair in pairs)


def main() -> None:
    t = np.linspace(0.0, DURATION, ROWS)
    rows = np.column_stack([t, crank_angles(t)[0]])
    file = Path(__file__).with_name("path.csv")
    np.savetxt(file, rows, fmt=["%.4f", "%.16g", "%.16g"], delimiter=",", header="t,J1 [rad],J5 [rad]", comments="")
    print(f"{file.name}: {ROWS} rows")


if __name__ == "__main__":
    main()
