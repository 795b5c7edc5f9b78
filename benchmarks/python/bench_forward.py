#!/usr/bin/env python3
"""Time against error of the integrators in forward dynamics.

    python benchmarks/python/bench_forward.py [--program FILE] [--only EXAMPLE ...]

Runs the Fortran program bench_forward for times and states on each example, takes the errors against the references in
tests/reference/forward.json (solutions in many digits by other ways; the Stewart platform: the same equations in quadruple
precision), follows the energy of a free four-bar over 1000 turns. Tables `forward-rates`, `forward-times`, `forward-drift` and the
picture forward.png under results/benchmarks.
"""
from __future__ import annotations

import argparse
import csv
import io
import json
import os
import subprocess
import sys
import time
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import linkdyn
from report import ROOT, clear_axis, processor_line, save_picture, save_table

METHODS = ("rk4", "rkf45", "rk8pd", "gbs", "seulex", "msbdf")
COLOURS = dict(zip(METHODS, ("#d55e00", "#e69f00", "#0072b2", "#009e73", "#56b4e9", "#cc79a7")))
MARKS = dict(zip(METHODS, "so^DPv"))
TARGETS = (1e-4, 1e-6, 1e-8, 1e-10)
TURN = 2 * np.pi


@dataclass
class Case:
    """An example and how to run it."""

    name: str
    scene: str
    end: float
    """[s]"""
    steps: int
    """Fewest of rk4."""
    reference: str
    """In forward.json."""
    digits: int = 13
    """Tightest tolerance."""
    rows: list[dict] = field(default_factory=list)
    rates: list[dict] = field(default_factory=list)


CASES = (
    Case("fourbar_start", "fourbar_start/scene.toml", 10.0, 100, "fourbar_start"),
    Case("fourbar_constant_torque", "fourbar_constant_torque/scene.toml", 5.0, 100, "fourbar_constant_torque"),
    Case("fivebar_motors", "fivebar_motors/scene.toml", 1.0, 50, "fivebar_motors"),
    Case("andrews", "andrews/scene_forward.toml", 0.05, 200, "andrews"),
    # Nearer to the change points than this, rounding stops the adaptive methods.
    Case("n_fourbar, N = 2", "n_fourbar/scene.toml", 10.0, 200, "n_fourbar_2", digits=10),
    Case("n_fourbar, N = 40", "n_fourbar/scene_40.toml", 1.0, 50, "n_fourbar_40", digits=10),
    Case("flyball_governor", "flyball_governor/scene.toml", 0.1, 1000, "flyball_governor"),
    Case("rcsp_start", "rcsp_start/scene.toml", 2.0, 50, "rcsp_start"),
    Case("spatial_slider_crank", "spatial_slider_crank/scene.toml", 5.0, 200, "spatial_slider_crank"),
    Case("stewart_forward", "stewart_forward/scene.toml", 1.0, 50, "stewart_forward"),
)


# ------------------------------------------------------------------------------------------------- times and errors
def measure(program: Path, case: Case) -> str:
    """Fill the rows of a case; the first line of the program."""
    command = [program, ROOT / "examples" / case.scene, str(case.end), str(case.steps), str(case.digits)]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    text = subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True, text=True).stdout
    head, _, body = text.partition("\n")
    rates, _, methods = body.partition("method,")
    case.rates = [{"solver": row["solver"], "single": float(row["us_single"]), "member": float(row["us_per_member"]),
                   "ensemble": float(row["us_of_ensemble"] or "nan")} for row in csv.DictReader(io.StringIO(rates))]
    for line in list(csv.reader(io.StringIO(methods)))[1:]:
        method, setting, ms, count, *state = line
        case.rows.append({"method": method, "setting": float(setting), "ms": float(ms), "count": int(count),
                          "state": np.array(state, dtype=float)})
    return head


def exact_state(case: Case) -> np.ndarray:
    """q and qd at the end."""
    states = json.loads((ROOT / "tests" / "reference" / "forward.json").read_text())[case.reference]["states"]
    state = next(s for s in states if s["t"] == case.end)
    return np.array([float(x) for x in state["q"] + state["qd"]])


def add_errors(case: Case, exact: np.ndarray) -> None:
    """Largest error of the coordinates and of their rates, each relative to the largest of the run."""
    run = linkdyn.load(ROOT / "examples" / case.scene).forward(case.end, want="driving_force")
    scale = np.repeat([np.abs(run.q.values).max(), np.abs(run.qd.values).max()], len(exact) // 2)
    for row in case.rows:
        error = (np.abs(row["state"] - exact) / scale).max()
        row["error"] = error if np.isfinite(error) else np.nan


# ----------------------------------------------------------------------------------------------------------- tables
def rates_table(cases: list[Case]) -> str:
    lines = ["| example | unknowns of a stage | us, one run | us, a member of an ensemble | us, the same with its steps |",
             "|---|---|---:|---:|---:|"]
    for case in cases:
        for row in case.rates:
            whole = f"{row['ensemble']:.3g}" if np.isfinite(row["ensemble"]) else ""
            lines.append(f"| {case.name} | {row['solver']} | {row['single']:.3g} | {row['member']:.3g} | {whole} |")
    return "\n".join(lines)


def times_table(cases: list[Case]) -> str:
    """Least time of each method for each error."""
    lines = ["| example | method | " + " | ".join(f"ms to {target:.0e}" for target in TARGETS) + " | least error |",
             "|---|---|" + "---:|" * (len(TARGETS) + 1)]
    for case in cases:
        for method in METHODS:
            rows = [row for row in case.rows if row["method"] == method and np.isfinite(row["error"])]
            if not rows:
                continue
            least = [min((row["ms"] for row in rows if row["error"] <= target), default=None) for target in TARGETS]
            lines.append(f"| {case.name}, {case.end:g} s | {method} | " + " | ".join("" if ms is None else f"{ms:.3g}" for ms in least)
                         + f" | {min(row['error'] for row in rows):.1e} |")
    return "\n".join(lines)


def draw(cases: list[Case]) -> plt.Figure:
    columns = 3
    n_row = -(-len(cases) // columns)
    figure, axes = plt.subplots(n_row, columns, figsize=(12, 3.6 * n_row), squeeze=False, layout="constrained")
    for axis in axes.flat[len(cases):]:
        axis.set_visible(False)
    for i, (axis, case) in enumerate(zip(axes.flat, cases)):
        for method in METHODS:
            rows = [row for row in case.rows if row["method"] == method]
            axis.plot([row["ms"] for row in rows], [max(row["error"], 1e-17) for row in rows], MARKS[method] + "-", label=method,
                      color=COLOURS[method], markersize=4, linewidth=1.1)
        axis.axhline(np.finfo(float).eps, color="0.6", linewidth=0.8)
        axis.set(xscale="log", yscale="log", ylim=(5e-18, 10.0), title=f"{case.name}, {case.end:g} s")
        clear_axis(axis)
        if i + columns >= len(cases):      # the lowest of its column
            axis.set_xlabel("time of the run, one thread [ms]")
    for axis in axes[:, 0]:
        axis.set_ylabel("relative error at the end")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=len(METHODS), frameon=False)
    return figure


# ----------------------------------------------------------------------------------------------------- energy drift
DRIFTS = (("rk4", {"step": 2e-3}), ("rk4", {"step": 1e-3}), ("rkf45", {"rtol": 1e-9, "atol": 1e-9}),
          ("rk8pd", {"rtol": 1e-9, "atol": 1e-9}), ("rk8pd", {"rtol": 1e-12, "atol": 1e-12}), ("gbs", {"rtol": 1e-9, "atol": 1e-9}),
          ("gbs", {"rtol": 1e-12, "atol": 1e-12}), ("msbdf", {"rtol": 1e-9, "atol": 1e-9}))


def drift_table() -> str:
    """The lecture's four-bar without drive and loads, let go at 8 rad/s: energy over 1000 turns."""
    given = tomllib.loads((ROOT / "examples" / "fourbar_start" / "scene.toml").read_text())
    given |= {"actuator": [], "load": [], "coordinate": [{"joint": "J1", "start": {"position": 0.5, "velocity": 8.0}}]}
    scene = linkdyn.Scene(given)
    lines = ["| method | setting | turns | change of the energy, relative to the kinetic | s |", "|---|---|---:|---:|---:|"]
    for method, settings in DRIFTS:
        begin = time.perf_counter()
        run = scene.forward(t=np.linspace(0.0, 700.0, 11), method=method, want="power", **settings)
        seconds = time.perf_counter() - begin
        energy = (run.kinetic_energy + run.potential_energy).values
        drift = np.abs(energy - energy[0]).max() / run.kinetic_energy.values.max()
        setting = f"step {settings['step']:g} s" if "step" in settings else f"tolerance {settings['rtol']:.0e}"
        lines.append(f"| {method} | {setting} | {run.q.values[-1, 0] / TURN:.0f} | {drift:.1e} | {seconds:.2g} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path, help="bench_forward_real64 (default: the one under build)")
    parser.add_argument("--only", nargs="+", help="these examples, and no table kept")
    given = parser.parse_args()
    program = given.program or next(ROOT.glob("build/*/benchmarks/bench_forward_real64"), None)
    if program is None:
        sys.exit("bench_forward_real64 is not built (meson option benchmarks)")
    cases = [case for case in CASES if not given.only or any(case.name.startswith(name) for name in given.only)]
    for case in cases:
        head = measure(program.resolve(), case)
        add_errors(case, exact_state(case))
    rates, times = rates_table(cases), times_table(cases)
    print(f"{rates}\n\n{times}")
    if given.only:
        return
    drift = drift_table()
    print(f"\n{drift}")
    machine = f"{processor_line()}; {head.rsplit(',', 1)[1].split()[0]} lanes."
    for marker, text in (("forward-rates", f"{machine}\n\n{rates}"), ("forward-times", times), ("forward-drift", drift)):
        save_table(marker, text)
    save_picture(draw(cases), "forward")


if __name__ == "__main__":
    main()
