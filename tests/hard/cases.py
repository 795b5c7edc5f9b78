"""Mechanisms where digits are lost: near dead points and singular positions, badly scaled, unequal in size or mass.

Each case is a scene with states (q, qd, qdd) that are exact doubles: both precisions compute from the same numbers. A
family leads towards its difficulty; ``distance`` says how far each state is from it.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
GRAVITY = 9.80665
PER_STEP = 40
"""States at each distance."""


@dataclass(frozen=True)
class Case:
    """A scene and states."""

    name: str
    title: str
    scene: dict[str, Any]
    q: np.ndarray
    """(N, n_q)"""
    qd: np.ndarray
    qdd: np.ndarray
    distance: np.ndarray
    """(N,) from the difficulty; NaN where the case has none."""
    folder: Path = field(default=ROOT)
    """Where the scene's tables lie."""
    distance_unit: str = ""
    time: np.ndarray | None = None
    """(N,) [s] if the states follow each other along a motion; the assembly is followed then."""


# ------------------------------------------------------------------------------------------------- parts of scenes
def bar(name: str, length: float, mass: float, **more: Any) -> dict[str, Any]:
    """A straight link between markers A (origin) and B, its centre of mass a little beside the middle."""
    return {
        "name": name,
        "markers": {"A": [0.0, 0.0], "B": [length, 0.0]} | more,
        "mass": mass,
        "cog": [0.5 * length, 0.0625 * length],
        "inertia": mass * length**2 / 10,
    }


def revolute(name: str, first: str, second: str, **more: Any) -> dict[str, Any]:
    return {"name": name, "type": "revolute", "between": [first, second]} | more


def planar(title: str, **parts: Any) -> dict[str, Any]:
    """A planar scene in gravity, one driven coordinate J1 unless said otherwise."""
    return {
        "title": title,
        "space": "planar",
        "gravity": [0.0, -GRAVITY],
        "coordinate": [{"joint": "J1"}],
        "actuator": [{"joint": "J1"}],
        "time": {"start": 0.0, "end": 0.0, "samples": 1},
    } | parts


def four_bar(
    title: str, crank: float, coupler: float, follower: float, ground: float, masses: tuple[float, ...] = (2.0, 5.0, 3.0)
) -> dict[str, Any]:
    """Crank J1 at the origin, follower J4 on the x axis; the coupler carries a load."""
    tool = [0.4 * coupler, 0.3 * coupler]
    return planar(
        title,
        frame={"markers": {"O": [0.0, 0.0], "Q": [ground, 0.0]}},
        link=[bar("crank", crank, masses[0]), bar("coupler", coupler, masses[1], tool=tool), bar("follower", follower, masses[2])],
        joint=[
            revolute("J1", "frame.O", "crank.A"),
            revolute("J2", "crank.B", "coupler.A"),
            revolute("J3", "coupler.B", "follower.B", branch=1),
            revolute("J4", "frame.Q", "follower.A"),
        ],
        load=[{"on": "coupler.tool", "force": [30.0, -70.0], "moment": 11.0}],
    )


def slider_crank(title: str, crank: float, rod: float, driven: str, masses: tuple[float, ...] = (1.0, 2.0, 3.0)) -> dict[str, Any]:
    """Crank J1 at the origin, piston on the x axis; ``driven`` is J1 or the slide J4."""
    return planar(
        title,
        frame={"markers": {"O": [0.0, 0.0]}},
        link=[
            bar("crank", crank, masses[0]),
            bar("rod", rod, masses[1]),
            {"name": "piston", "markers": {"C": [0.0, 0.0]}, "mass": masses[2], "inertia": 0.1 * masses[2] * crank**2},
        ],
        joint=[
            revolute("J1", "frame.O", "crank.A"),
            revolute("J2", "crank.B", "rod.A", branch=1),
            revolute("J3", "rod.B", "piston.C", branch=1),
            {"name": "J4", "type": "prismatic", "between": ["frame.O", "piston.C"]},
        ],
        coordinate=[{"joint": driven}],
        actuator=[{"joint": driven}],
        load=[{"on": "piston.C", "force": [-200.0, 40.0]}],
    )


# ------------------------------------------------------------------------------------------------------- families
def states(name: str, scene: dict[str, Any], q: np.ndarray, distance: np.ndarray, size: float = 1.0, **more: Any) -> Case:
    """A case with one coordinate at rates and accelerations of order one, all different."""
    rng = np.random.default_rng(sum(map(ord, name)))
    q = np.asarray(q, dtype=float).reshape(-1, 1)
    qd, qdd = (size * rng.uniform(0.5, 2.0, q.shape) * rng.choice([-1, 1], q.shape) for _ in range(2))
    return Case(name, scene["title"], scene, q, qd, qdd, np.asarray(distance, dtype=float), **more)


def towards(distances: np.ndarray, place: Callable[[np.ndarray], np.ndarray], seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates at some distances, each taken a few times, a little apart."""
    rng = np.random.default_rng(seed)
    distance = np.repeat(distances, PER_STEP) * rng.uniform(0.7, 1.4, len(distances) * PER_STEP)
    return place(distance), distance


def change_points() -> Iterator[Case]:
    """Four-bars that fold flat: their dyad's transmission angle goes to zero with the crank angle."""
    distances = 10.0 ** -np.arange(1.0, 7.0)
    for name, lengths in (("four_bar", (2.0, 4.0, 3.0, 3.0)), ("parallelogram", (2.0, 5.0, 2.0, 5.0))):
        q, distance = towards(distances, lambda d: d, 1)
        scene = four_bar(f"{name.replace('_', '-').capitalize()} towards its change point", *lengths)
        yield states(f"{name}_change_point", scene, q, distance, distance_unit="rad")
    q, distance = towards(distances[:-1], lambda d: math.pi - d, 2)
    scene = four_bar("Parallelogram towards its other change point", 2.0, 5.0, 2.0, 5.0)
    yield states("parallelogram_flat", scene, q, distance, distance_unit="rad")


def near_parallelograms() -> Iterator[Case]:
    """A parallelogram whose follower is a little too long, all round as far as it closes."""
    for excess in (1e-2, 1e-4, 1e-6):
        scene = four_bar(f"Near-parallelogram, follower longer by {excess:g}", 2.0, 5.0, 2.0 * (1 + excess), 5.0)
        reach = 2.5 * math.sqrt(excess)
        rng = np.random.default_rng(3)
        q = np.concatenate([rng.uniform(reach, math.pi - reach, 120), reach * rng.uniform(1.0, 3.0, 120)])
        yield states(f"near_parallelogram_{excess:.0e}", scene, q, np.full(len(q), excess), distance_unit="excess")


def slider_cranks() -> Iterator[Case]:
    """Rod hardly longer than the crank, at a crank angle of 90 degrees, where the rod stands square to the slide."""
    for excess in (1e-3, 1e-6):
        scene = slider_crank(f"Slider-crank, rod longer than the crank by {excess:g}", 1.0, 1.0 + excess, "J1")
        q, distance = towards(10.0 ** -np.arange(0.0, 7.0), lambda d: math.pi / 2 - d, 4)
        yield states(f"slider_crank_{excess:.0e}", scene, q, distance, distance_unit="rad")


def dead_centres() -> Iterator[Case]:
    """The piston drives the crank, near both dead centres."""
    for name, place in (("outer", lambda d: (1.03 + 2.97) - d), ("inner", lambda d: (2.97 - 1.03) + d)):
        scene = slider_crank(f"Slider-driven crank towards its {name} dead centre", 1.03, 2.97, "J4")
        q, distance = towards(10.0 ** -np.arange(1.0, 13.0), place, 5)
        yield states(f"dead_centre_{name}", scene, q, distance, 0.01, distance_unit="m")


def stretched() -> Iterator[Case]:
    """Two equal bars pulled straight by a slider, to 1e-8 rad from full stretch.

    There the slide is one unit in the last place below its end, which is a number that double precision holds.
    """
    scene = slider_crank("RRR dyad towards full stretch", 1.0, 1.0, "J4")
    q, distance = towards(10.0 ** -np.arange(1.0, 9.0), lambda d: 2.0 * np.cos(d / 2), 6)
    yield states("stretched_dyad", scene, q[q < 2], distance[q < 2], 0.01, distance_unit="rad")


def fichter() -> Iterator[Case]:
    """Fichter's platform towards a yaw of 90 degrees, which is the coordinate's zero in this scene."""
    scene = tomllib.loads((ROOT / "benchmarks" / "scenes" / "fichter.toml").read_text())
    yaw, distance = towards(10.0 ** -np.arange(1.0, 11.0), lambda d: -d, 7)
    rng = np.random.default_rng(8)
    n = len(yaw)
    q = np.column_stack([rng.uniform(-0.05, 0.05, (n, 2)), rng.uniform(0.7, 0.9, n), np.zeros((n, 2)), yaw])
    qd, qdd = rng.normal(0.0, 0.5, (2, n, 6))
    yield Case("fichter", scene["title"], scene, q, qd, qdd, distance, distance_unit="rad")


def unequal() -> Iterator[Case]:
    """Masses, sizes and units far apart in one scene."""
    rng = np.random.default_rng(9)
    q = rng.uniform(0.0, 2 * math.pi, 160)
    none = np.full(len(q), np.nan)
    lengths = (2.0, 6.0, 5.0, 7.0)
    yield states("mass_ratio", four_bar("Link masses from 0.1 g to 10 t", *lengths, masses=(1e-4, 1e4, 1.0)), q, none)
    yield states("mass_ratio_light_coupler", four_bar("A coupler of 0.1 g between heavy links", *lengths, masses=(1e4, 1e-4, 1e4)), q, none)
    millimetres = four_bar("Millimetres and meganewtons", *(1e-3 * x for x in lengths))
    millimetres["load"] = [{"on": "coupler.tool", "force": ["2 MN", "-3 MN"], "moment": "4 N*m"}]
    yield states("millimetres_meganewtons", millimetres, q, none)
    kilometres = four_bar("Kilometres and grams", *(1e3 * x for x in lengths), masses=(1e-3, 2e-3, 1e-3))
    yield states("kilometres_grams", kilometres, q, none, 1e-3)
    for size in (1e-3, 1e-6):
        small = states(f"small_on_large_{size:.0e}", small_on_large(size), q, none)
        yield replace(small, **{name: np.column_stack([getattr(small, name), rng.uniform(0.5, 2.0, len(q))]) for name in ("q", "qd", "qdd")})


def small_on_large(size: float) -> dict[str, Any]:
    """A four-bar of kilometres; another one, its size given, hangs at its coupler's end and is driven by it."""
    scene = four_bar(f"A four-bar of {size:g} m on one of kilometres", 2e3, 6e3, 5e3, 7e3)
    at = [1.0e3, 1.5e3]
    follower = scene["link"][2]
    follower["markers"] |= {"O2": at, "Q2": [at[0] + 7 * size, at[1]]}
    scene["link"] += [bar("small_crank", 2 * size, 1e-3), bar("small_coupler", 6 * size, 2e-3), bar("small_follower", 5 * size, 1e-3)]
    scene["joint"] += [
        revolute("S1", "follower.O2", "small_crank.A"),
        revolute("S2", "small_crank.B", "small_coupler.A"),
        revolute("S3", "small_coupler.B", "small_follower.B", branch=1),
        revolute("S4", "follower.Q2", "small_follower.A"),
    ]
    scene["coordinate"].append({"joint": "S1", "motion": 0.0})
    scene["actuator"].append({"joint": "S1"})
    return scene


def examples() -> Iterator[Case]:
    """The examples themselves, along their motions: nothing hard, so that easy samples are counted as well."""
    import linkdyn

    for file in sorted(ROOT.glob("examples/*/scene.toml")):
        scene = linkdyn.load(file)
        content = tomllib.loads(file.read_text())
        # a state alone must decide, and every solver take the scene
        if len(scene.actuators) != len(scene.coordinates) or scene.description["wants_instants"] or "friction" in content:
            continue
        time = scene.description["time"]
        rng = np.random.default_rng(10)
        q, qd, qdd = scene.motion(np.sort(rng.uniform(time["first"], time["last"], 150)))
        name = f"example_{file.parent.name}"
        yield Case(name, scene.title, content, q, qd, qdd, np.full(len(q), np.nan), file.parent)


# --------------------------------------------------------------------------------------------------- in motion order
N_IN_TURN = 720
OFF = 0.003
"""No sample of a turn falls on a difficulty exactly, but for the dead centres."""


def turning(name: str, scene: dict[str, Any], places: tuple[float, ...], turns: int = 1, **more: Any) -> Case:
    """The crank turns at 2 rad/s and speeds up a little; ``distance`` is that of the angle from the next difficulty."""
    t = np.linspace(0.0, math.pi * turns, N_IN_TURN * turns + 1)
    q = (OFF + 2.0 * t + 0.0625 * t**2)[:, np.newaxis]
    distance = np.min([np.abs(np.remainder(q[:, 0] - place + math.pi, 2 * math.pi) - math.pi) for place in places], axis=0)
    qd, qdd = (2.0 + 0.125 * t)[:, np.newaxis], np.full((len(t), 1), 0.125)
    return Case(name, scene["title"], scene, q, qd, qdd, distance, distance_unit="rad", time=t, **more)


def through_change_points() -> Iterator[Case]:
    """Four-bars that fold flat, carried through on their assembly, two turns."""
    yield turning("four_bar_through", four_bar("Four-bar through its change points", 2.0, 4.0, 3.0, 3.0), (0.0,), 2)
    yield turning("parallelogram_through", four_bar("Parallelogram through its change points", 2.0, 5.0, 2.0, 5.0), (0.0, math.pi), 2)


def near_parallelograms_turning() -> Iterator[Case]:
    """A follower a little too long: the transmission angle falls to the root of the excess, twice a turn."""
    for excess in (1e-2, 1e-4, 1e-6):
        scene = four_bar(f"Near-parallelogram turning, follower longer by {excess:g}", 2.0, 5.0, 2.0 * (1 + excess), 5.0)
        yield turning(f"near_parallelogram_turning_{excess:.0e}", scene, (0.0, math.pi))


def slider_cranks_turning() -> Iterator[Case]:
    """Rod hardly longer than the crank: at 90 degrees it stands square to the slide."""
    for excess in (1e-3, 1e-6):
        scene = slider_crank(f"Slider-crank turning, rod longer than the crank by {excess:g}", 1.0, 1.0 + excess, "J1")
        yield turning(f"slider_crank_turning_{excess:.0e}", scene, (math.pi / 2, -math.pi / 2))


def dead_centres_met() -> Iterator[Case]:
    """The piston drives the crank to both dead centres and back, as fast as a crank turning evenly would have it."""
    scene = slider_crank("Slider-driven crank to its dead centres and back", 1.03, 2.97, "J4")
    n = N_IN_TURN
    turn = 2 * math.pi * np.arange(5 * n // 4 + 1) / n + math.pi / 4
    sine, cosine = 1.03 * np.sin(turn), 1.03 * np.cos(turn)
    reach = np.sqrt(2.97**2 - sine**2)
    # of x = cosine + reach, the crank at 1 rad/s
    q = cosine + reach
    qd = -sine - sine * cosine / reach
    qdd = -cosine - (cosine**2 - sine**2) / reach - (sine * cosine) ** 2 / reach**3
    distance = np.abs(np.remainder(turn + math.pi / 2, math.pi) - math.pi / 2)
    columns = (np.asarray(column)[:, np.newaxis] for column in (q, qd, qdd))
    yield Case("dead_centres", scene["title"], scene, *columns, distance, distance_unit="rad", time=turn - turn[0])


FAMILIES = (change_points, near_parallelograms, slider_cranks, dead_centres, stretched, fichter, unequal)


def hard_cases() -> list[Case]:
    """All hard cases."""
    return [case for family in FAMILIES for case in family()]


MOTIONS = (through_change_points, near_parallelograms_turning, slider_cranks_turning, dead_centres_met)


def motion_cases() -> list[Case]:
    """Hard cases in motion order."""
    return [case for family in MOTIONS for case in family()]
