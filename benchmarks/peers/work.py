"""What the programs of the peers share: the work that they are given, and how it is timed. Needs numpy only.

A mechanism is a tree of links, each behind one joint with one variable, and loops that close it: the only form that all peers take.
`bench_peers.py` writes it; a universal joint, or a body that is free, is a row of links without mass.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

Result = TypeVar("Result")
PATIENCE = 1.5
"""[s] of processor time for one run; one that takes longer is the last of its series."""


@dataclass
class Link:
    """A link of the tree: its frame lies in that of its parent, `at` apart, moved by its joint."""

    parent: int
    """-1: the ground."""
    at: list[float]
    joint: str
    """Px .. Pz, Rx .. Rz: along or about an axis of both frames."""
    mass: float = 0.0
    cog: tuple[float, float, float] = (0.0, 0.0, 0.0)
    inertia: tuple[float, ...] = (0.0,) * 9
    """(9,) at the centre of mass."""
    q: float = 0.0
    """At the start, from rest."""
    force: float = 0.0
    """Of a motor, constant."""
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0

    @property
    def axis(self) -> list[float]:
        return [float(self.joint[1] == letter) for letter in "xyz"]

    @property
    def slides(self) -> bool:
        return self.joint[0] == "P"


@dataclass
class Loop:
    """Two points that are one."""

    links: tuple[int, int]
    points: tuple[list[float], list[float]]


@dataclass
class Spring:
    """From a point of the ground to one of a link."""

    ground: list[float]
    link: int
    point: list[float]
    stiffness: float
    rest: float


@dataclass
class Mechanism:
    links: list[Link]
    loops: list[Loop]
    springs: list[Spring]
    gravity: list[float]
    planar: bool
    end: float
    """[s]"""
    coordinates: list[int]
    """Links whose variables are compared."""

    @classmethod
    def read(cls, file: str) -> Mechanism:
        content = json.loads(Path(file).read_text())
        content |= {name: [kind(**one) for one in content[name]] for name, kind in (("links", Link), ("loops", Loop), ("springs", Spring))}
        return cls(**content)

    @property
    def start(self) -> np.ndarray:
        return np.array([link.q for link in self.links])


def timed(work: Callable[[], Result], least: float = 0.3, passes: int = 50) -> tuple[float, Result]:
    """Processor time of the quickest pass, and what it gave; wall-clock time would count what others do on the machine."""
    best, spent = np.inf, 0.0
    for _ in range(passes):
        begin = time.process_time()
        result = work()
        one = time.process_time() - begin
        best, spent = min(best, one), spent + one
        if spent > least:
            break
    return best, result


def series(run: Callable[[float], np.ndarray], settings: Iterable[float], method: str) -> list[dict]:
    """Rows of runs with ever finer settings, until one takes too long; `run` gives coordinates and rates at the end."""
    rows = []
    for setting in settings:
        taken, state = timed(lambda: run(setting))
        rows.append({"method": method, "setting": setting, "ms": taken * 1e3, "state": state.tolist()})
        if taken > PATIENCE:
            break
    return rows


def more_steps(first: int) -> Iterator[int]:
    """Twice as many each time."""
    while True:
        yield first
        first *= 2


def say(**content: object) -> None:
    """To the program that has started this one."""
    json.dump(content, sys.stdout)
