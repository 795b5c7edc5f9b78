"""Independent references for the hard cases (tests/hard): the exact answers to their decimals.

The scene's numbers and the states are taken as the shortest decimals that read as the engine's doubles, not as the doubles:
what a user writes, and what a program with more digits would make of it. So true errors here contain half a unit in the
last place of every number given, multiplied by whatever the case does to it, besides all rounding.

Planar cases by planar_oracle.py: Newton's method on all joints in 80 digits, forces as multipliers; linkdyn's poses are the
first guess, which chooses the assembly. Fichter's platform by stewart_oracle.py: Taylor series, 78 momentum balances, and
virtual power.

Usage: python hard_oracle.py    (writes hard.json; needs linkdyn and mpmath)
"""
from __future__ import annotations

import json
import sys
from pathlib import Path

import linkdyn
import numpy as np
from mpmath import mp, mpf

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "hard"))

import stewart_oracle  # noqa: E402  (sets its own digits)
from cases import Case, hard_cases  # noqa: E402
from planar_oracle import Mechanism  # noqa: E402
from stewart_data import body  # noqa: E402

mp.dps = 80  # of which differences take up to 40, a dead point 10
DIGITS = 20
PER_DISTANCE = 2
"""States taken from the forty at each distance."""
AT_MOST = 24
"""States of a case."""


def decimal(value: float):
    """The shortest decimal that reads as this double."""
    return mpf(repr(float(value)))


def in_newtons(scene: dict) -> dict:
    """The scene with its loads as plain numbers."""
    units = {"MN": 10**6, "N*m": 1}
    plain = lambda x: float(x.split()[0]) * units[x.split()[1]] if isinstance(x, str) else x
    loads = [load | {"force": [plain(f) for f in load["force"]], "moment": plain(load.get("moment", 0))}
             for load in scene.get("load", [])]
    return scene | {"load": loads}


# ------------------------------------------------------------------------------------------------- planar
def planar_forces(case: Case, chosen: np.ndarray):
    """Driving forces and reactions (Fx Fy Mz by joint) of the chosen states."""
    mechanism = Mechanism(in_newtons(case.scene), decimal)
    poses = linkdyn.Scene(case.scene, case.folder).poses(case.q[chosen])
    for place, turn, i in zip(poses.position, poses.rotation, chosen):
        guess = [mpf(x) for p, r in zip(place, turn) for x in (p[0], p[1], np.arctan2(r[1, 0], r[0, 0]))]
        q, qd, qdd = (list(map(decimal, values[i])) for values in (case.q, case.qd, case.qdd))
        # The angles of the guess have lost their whole turns; Newton's method must not make them up, or it ends anywhere.
        gaps = mechanism.constraints(guess, q)[-len(q):]
        q = [value + 2 * mp.pi * mp.nint(gap / (2 * mp.pi)) if turns else value
             for value, gap, turns in zip(q, gaps, mechanism.coordinates_turn())]
        reaction, driving = mechanism.solve(guess, q, qd, qdd)
        yield driving, reaction


# ------------------------------------------------------------------------------------------------ Stewart
def platform_of(scene: dict) -> dict:
    """A scene of one platform on UPS legs in the form of stewart_data.py."""
    numbers = lambda values: list(map(decimal, values))
    (top,), (chain,), (load,) = scene["link"], scene["chain"], scene["load"]

    def inertia(values):
        xx, yy, zz, xy, yz, xz = numbers(values)
        return [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]

    link = lambda data: body(decimal(data["mass"]), numbers(data["cog"]), inertia(data["inertia"]))
    point = lambda name: numbers((scene["frame"] if name.startswith("frame.") else top)["markers"][name.split(".")[1]])
    return {
        "gravity": numbers(scene["gravity"]),
        "base": [point(name) for name in chain["base"]],
        "platform": [point(name) for name in chain["platform"]],
        "axis": [numbers(chain["axis"])] * 6,
        "top": link(top),
        "lower": [link(chain["lower"])] * 6,
        "upper": [link(chain["upper"])] * 6,
        "load_point": point(load["on"]),
        "wrench": numbers([*load["force"], *load["moment"]]),
    }


def stewart_forces(case: Case, chosen: np.ndarray):
    """Driving forces and reactions (Fx Fy Fz Mx My Mz by joint) of the chosen states."""
    platform = platform_of(case.scene)
    for i in chosen:
        q, qd, qdd = (list(map(decimal, values[i])) for values in (case.q, case.qd, case.qdd))
        result = stewart_oracle.solve(platform, q, qd, qdd, platform["wrench"])
        yield result["driving_force"], result["reaction"]


# -------------------------------------------------------------------------------------------------- files
def chosen_states(case: Case) -> np.ndarray:
    """Indices of a few states at every distance."""
    first = [i for start in range(0, len(case.q), 40) for i in range(start, min(start + PER_DISTANCE, len(case.q)))]
    return np.array(first[:AT_MOST])


def record(case: Case) -> dict:
    """The case with the exact answers of some of its states."""
    chosen = chosen_states(case)
    solve = planar_forces if case.scene["space"] == "planar" else stewart_forces
    states = []
    for i, (driving, reaction) in zip(chosen, solve(case, chosen)):
        tiny = mpf("1e-30") * max(abs(f) for r in reaction.values() for f in r)     # what is left of exact zeros
        text = lambda values: [mp.nstr(x, DIGITS) if abs(x) > tiny else "0" for x in values]
        states.append({"q": case.q[i].tolist(), "qd": case.qd[i].tolist(), "qdd": case.qdd[i].tolist(),
                       "driving_force": text(driving), "reaction": {joint: text(r) for joint, r in reaction.items()}})
    return {"name": case.name, "states": states}


def main() -> None:
    """Write hard.json, one state a line."""
    cases = []
    for case in hard_cases():
        lines = ",\n  ".join(json.dumps(state) for state in record(case)["states"])
        cases.append(f'"{case.name}": [\n  {lines}]')
        print(case.name)
    (HERE / "hard.json").write_text("{\n" + ",\n".join(cases) + "}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
