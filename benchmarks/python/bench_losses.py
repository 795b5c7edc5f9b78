#!/usr/bin/env python3
"""Forward runs of machines as they are against the same without losses: what an evaluation costs, in one run.

    python benchmarks/python/bench_losses.py

Motors behind gears with an efficiency, joints that rub smoothly, joints that stick. Classical Runge-Kutta, whose number of evaluations is known;
processor time, each scene's kinds in turns, so that the ratio hardly feels what else the machine does. The error is that of the way at the end against
the adaptive extrapolation method on lanes, which finds losses by another road. Table `losses` under results/benchmarks.
"""
from __future__ import annotations

import time
import tomllib
from typing import Any

import numpy as np

import linkdyn
from report import ROOT, processor_line, save_table

STEPS = 2000
TURNS = 5
GEAR = {"efficiency": "90 %", "back_efficiency": "80 %"}


def read(name: str) -> dict[str, Any]:
    return tomllib.loads((ROOT / "examples" / name / "scene.toml").read_text())


def motor(joint: str, torque: str, ratio: float, inertia: float, **losses: str) -> dict[str, Any]:
    law = {"type": "formula", "value": torque, "at": "motor"}
    return {"joint": joint, "law": law, "drive": {"ratio": ratio, "rotor_inertia": inertia, **losses}}


def four_bar(**losses: str) -> dict[str, Any]:
    return read("fourbar_start") | {"actuator": [motor("J1", "300 N*m*cos(2 rad/s*time)", 10, 1e-2, **losses)]}


def five_bar(**losses: str) -> dict[str, Any]:
    motors = [motor("J1", "1.5 N*m*cos(5 rad/s*time)", 10, 2e-4, **losses), motor("J5", "-0.9 N*m*cos(7 rad/s*time)", 10, 2e-4, **losses)]
    return read("fivebar_motors") | {"actuator": motors}


def hexapod(**losses: str) -> dict[str, Any]:
    legs = range(1, 7)
    torque = "0.002 N*m*cos({} rad/s*time)"
    return read("stewart_forward") | {"actuator": [motor(f"leg{i}.P", torque.format(3 + i), 600, 1e-5, **losses) for i in legs]}


def rubbing(scene: dict[str, Any], joints: str, **more: Any) -> dict[str, Any]:
    return scene | {"friction": [{"joint": joint, "coulomb": 0.1, "radius": "10 mm", **more} for joint in joints.split()]}


HINGES = "J1 J2 J3 J4"
CASES: dict[str, dict[str, dict[str, Any]]] = {
    "four-bar, 1 motor": {
        "plain": four_bar(),
        "efficiency": four_bar(**GEAR),
        "friction": rubbing(four_bar(), HINGES),
        "both": rubbing(four_bar(**GEAR), HINGES),
        "sticking": rubbing(four_bar(), HINGES, sticking=True),
    },
    "five-bar, 2 motors": {
        "plain": five_bar(),
        "efficiency": five_bar(**GEAR),
        "friction": rubbing(five_bar(), HINGES + " J5"),
        "both": rubbing(five_bar(**GEAR), HINGES + " J5"),
    },
    "hexapod, 6 motors": {"plain": hexapod(), "efficiency": hexapod(**GEAR)},
}
END = {"four-bar, 1 motor": 0.6, "five-bar, 2 motors": 0.5, "hexapod, 6 motors": 0.3}


def seconds(scene: linkdyn.Scene, end: float, steps: int) -> float:
    """Of the processor, for a run."""
    start = time.process_time()
    scene.forward(t=[0, end], method="rk4", step=end / steps, want="driving_force")
    return time.process_time() - start


def error(scene: linkdyn.Scene, end: float) -> float:
    """Of the way, relative to the largest coordinate."""
    way = scene.forward(t=[0, end], method="rk4", step=end / STEPS, want="driving_force").q.values[-1]
    other = scene.forward(t=[0, end], method="gbs", rtol=1e-10, atol=1e-12, solver="lapack", want="driving_force").q.values[-1]
    return float(np.abs(way - other).max() / np.abs(other).max())


def measure(case: str) -> list[dict[str, str]]:
    scenes = {kind: linkdyn.Scene(content) for kind, content in CASES[case].items()}
    end = END[case]
    for scene in scenes.values():       # programs are made
        seconds(scene, end, STEPS)
    # the short run has all that a run does but its steps
    taken = np.array([[seconds(scene, end, STEPS) - seconds(scene, end / STEPS * 100, 100) for scene in scenes.values()] for _ in range(TURNS)])
    us = taken / (4 * (STEPS - 100)) * 1e6
    return [
        {"scene": case, "losses": kind, "us an evaluation": f"{one.min():.2f}", "ratio": f"{np.median(one / us[:, 0]):.2f}",
         "error of the way": f"{error(scene, end):.0e}"}
        for (kind, scene), one in zip(scenes.items(), us.T)
    ]


def table(rows: list[dict[str, str]]) -> str:
    lines = [list(rows[0]), ["---", "---", "---:", "---:", "---:"], *(list(row.values()) for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> None:
    text = f"{processor_line()}; one thread.\n\n{table([row for case in CASES for row in measure(case)])}"
    save_table("losses", text)
    print(text)


if __name__ == "__main__":
    main()
