"""Long forward runs with exact solutions: a pendulum that whirls round, a rotor under a constant torque."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import linkdyn
import numpy as np
from cases import bar, planar, revolute

GRAVITY = 9.80665


@dataclass(frozen=True)
class LongRun:
    """What many steps have made of one run."""

    state: float
    """Largest error of the angle at the end of a part of the run [rad]."""
    energy: float
    """Largest change of the energy, relative to the kinetic energy at the start."""
    steps: int


def turning_link(law: dict[str, Any], gravity: float, velocity: float) -> dict[str, Any]:
    """A bar on a hinge: 2 kg, 1 m, its moment of inertia about the hinge 0.75 kg m2."""
    link = bar("bar", 1.0, 2.0) | {"cog": [0.5, 0.0], "inertia": 0.25}
    return planar(
        "A bar on a hinge",
        gravity=[0.0, -gravity],
        frame={"markers": {"O": [0.0, 0.0]}},
        link=[link],
        joint=[revolute("J", "frame.O", "bar.A")],
        coordinate=[{"joint": "J", "start": {"position": -math.pi / 2, "velocity": velocity}}],
        actuator=[{"joint": "J", "law": law}],
    )


def agm(a: float, b: float) -> float:
    """The arithmetic-geometric mean."""
    while abs(a - b) > 4e-16 * a:
        a, b = (a + b) / 2, math.sqrt(a * b)
    return a


def time_of_turn(velocity: float) -> float:
    """Of the pendulum, from its velocity at the lowest position [s]: pi/agm(v/2, sqrt(v^2/4 - w^2)), w that of small swings."""
    squared = 2.0 * GRAVITY * 0.5 / 0.75                       # of w
    return math.pi / agm(velocity / 2, math.sqrt(velocity**2 / 4 - squared))


def moved_start(turns: int, velocity: float = 8.0) -> LongRun:
    """What a unit in the last place of the velocity at the start makes of a run: a turn takes another time."""
    moved = 1e-5
    share = (time_of_turn(velocity + moved) - time_of_turn(velocity - moved)) / (2 * moved * time_of_turn(velocity))
    unit = math.ulp(velocity)
    return LongRun(2 * math.pi * turns * abs(share) * unit, 2 * unit / velocity, 0)


def whirl(turns: int, parts: int, method: str, velocity: float = 8.0, per_turn: int = 0, **settings: float) -> LongRun:
    """The pendulum whirls from its lowest position.

    Parameters
    ----------
    turns, parts
        How many, and after how many equal parts of the run to look; parts divides turns.
    velocity
        At the start [rad/s].
    per_turn
        Steps of a turn, for rk4.
    """
    turn = time_of_turn(velocity)
    if per_turn:
        settings["step"] = turn / per_turn
    scene = linkdyn.Scene(turning_link({"type": "constant", "value": 0.0}, GRAVITY, velocity))
    t = turn * (turns // parts) * np.arange(parts + 1)
    run = scene.forward(t=t, method=method, want="power", **settings)
    exact = -math.pi / 2 + 2 * math.pi * (turns // parts) * np.arange(parts + 1)
    energy = (run.kinetic_energy + run.potential_energy).values
    return LongRun(
        float(np.abs(run.q.values[:, 0] - exact).max()),
        float(np.abs(energy - energy[0]).max() / run.kinetic_energy.values[0]),
        int(run.attrs["steps"]),
    )


def spin(n_step: int, method: str = "rk4", **settings: float) -> LongRun:
    """The rotor speeds up evenly, so that no method errs but by rounding: 2 rad/s2 from 1 rad/s, for 8 s."""
    scene = linkdyn.Scene(turning_link({"type": "constant", "value": 1.5}, 0.0, 1.0))
    t = np.linspace(0.0, 8.0, 9)
    if method == "rk4":
        settings["step"] = 8.0 / n_step
    run = scene.forward(t=t, method=method, want="power", **settings)
    exact = -math.pi / 2 + t + t**2
    energy = (run.kinetic_energy - run.work).values
    return LongRun(
        float(np.abs(run.q.values[:, 0] - exact).max()),
        float(np.abs(energy - energy[0]).max() / energy[0]),
        int(run.attrs["steps"]),
    )
