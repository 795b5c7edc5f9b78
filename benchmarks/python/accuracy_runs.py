"""Motions, for docs/accuracy.md: forward runs against the quadruple twin (do the error estimates hold, what do they cost?), hard
cases in motion order, long runs."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import linkdyn
import matplotlib.pyplot as plt
import numpy as np
from bench_forward import COLOURS
from cases import motion_cases
from estimates import SAFETY
from linkdyn.cli import executable
from long_runs import moved_start, spin, whirl
from report import ROOT, clear_axis, legend_beside, processor_line
from twin import quadruple_run, ratio_to_estimate, run_ratios, run_states, true_errors

EXAMPLES = ROOT / "examples"
SCENES = (
    "andrews/scene_forward", "fivebar_motors/scene", "fivebar_parallel/scene", "fourbar/scene", "fourbar_constant_torque/scene",
    "fourbar_start/scene", "n_fourbar/scene", "rcsp_start/scene", "sixbar_slider/scene", "stephenson_iii/scene",
    "stewart_forward/scene", "stewart_tsai/scene", "watt_i/scene",
)  # fmt: skip
N_INSTANT = 33
TOLERANCES = {
    "rkf45": (1e-4, 1e-7, 1e-10), "rk8pd": (1e-4, 1e-7, 1e-10, 1e-12, 1e-14),
    "msbdf": (1e-4, 1e-7, 1e-10), "gbs": (1e-4, 1e-7, 1e-10, 1e-12, 1e-14), "seulex": (1e-4, 1e-7, 1e-10),
}  # fmt: skip
STEPS = (64, 400, 3200, 12800)
"""Of rk4, in a whole run."""


@dataclass(frozen=True)
class Run:
    """One run with its estimates."""

    scene: str
    method: str
    setting: float
    """Tolerance, or step [s]."""
    ratio: np.ndarray
    """True error over estimate, of all numbers."""
    cost: float
    """Time with estimates over time without."""


def settings(length: float) -> Iterator[tuple[str, float, dict[str, Any]]]:
    """Methods and what they are run with, from loose to where rounding is all that is left."""
    for method, ladder in TOLERANCES.items():
        for tolerance in ladder:
            yield method, tolerance, {"rtol": tolerance, "atol": tolerance}
    for n in STEPS:
        yield "rk4", length / n, {"step": length / n}


def short(end: float) -> float:
    """An instant of few binary digits just before the end, so that all instants of output are exact doubles."""
    part = 2.0 ** (math.floor(math.log2(end)) - 5)
    return math.floor(end / part) * part


def measure_runs(program: Path) -> list[Run]:
    """All scenes by all methods down their ladders."""
    runs = []
    for name in SCENES:
        file = EXAMPLES / f"{name}.toml"
        scene = linkdyn.load(file)
        end = short(scene.description["time"]["last"])
        exact = quadruple_run(program, file, end, N_INSTANT)
        for method, setting, chosen in settings(end):
            start = time.perf_counter()
            scene.forward(t=exact["time"], method=method, **chosen)
            plain = time.perf_counter() - start
            run = scene.forward(t=exact["time"], method=method, error=True, **chosen)
            cost = (time.perf_counter() - start - plain) / plain
            ratio = run_ratios(run, exact)
            runs.append(Run(name, method, setting, ratio[~np.isnan(ratio)], cost))
    return runs


def runs_table(runs: list[Run]) -> str:
    """A row for each method."""
    lines = ["| method | runs | numbers | above estimate | 99.9 % below | largest | median estimate/true | cost |",
             "|---|---:|---:|---:|---:|---:|---:|---:|"]
    for method in (*TOLERANCES, "rk4"):
        chosen = [run for run in runs if run.method == method]
        ratio = np.concatenate([run.ratio for run in chosen])
        lines.append(f"| {method} | {len(chosen)} | {len(ratio)} | {100 * np.mean(ratio > 1):.2g} % | {np.percentile(ratio, 99.9):.2g} "
                     f"| {ratio.max():.2g} | {1 / np.median(ratio):.2g} | {np.median([run.cost for run in chosen]):.1f} |")
    return "\n".join(lines)


def draw_runs(runs: list[Run]) -> plt.Figure:
    """Histogram of true error over estimate."""
    figure, axis = plt.subplots(figsize=(7.5, 4.2), layout="constrained")
    bins = np.linspace(-7, 1, 81)
    for method in (*TOLERANCES, "rk4"):
        ratio = np.concatenate([run.ratio for run in runs if run.method == method])
        axis.hist(np.log10(np.clip(ratio, 10.0 ** bins[0], None)), bins=bins, histtype="step", color=COLOURS[method], label=method,
                  weights=np.full(len(ratio), 100 / len(ratio)), linewidth=1.4)
    axis.axvline(0, color="0.4", linewidth=0.9)
    axis.annotate("estimate too small", (0.05, 0.95), xycoords=("data", "axes fraction"), color="0.3", fontsize="small", va="top")
    axis.set(yscale="log", xlabel="log10 of true error / estimate (those below -7 in the first bin)", ylabel="share of all numbers [%]",
             title="Forward runs of all examples")
    clear_axis(axis)
    legend_beside(axis)
    return figure


# ------------------------------------------------------------------------------------------- hard cases in motion order
def motions_table(program: Path) -> str:
    """Largest error of each solver along each motion, relative to the sample's largest force or moment."""
    solvers = ("elimination", "lapack", "gauss-jordan")
    lines = ["| motion | samples | nearest | flagged | data allow | " + " | ".join(solvers) + " | above estimate | estimate/true |",
             "|---|---:|---:|---:|---:|" + "---:|" * (len(solvers) + 2)]
    for case in motion_cases():
        exact = _forces(run_states(program, case, "--want", "driving_force,reaction", time=case.time))
        cells: list[str] = []
        for solver in solvers:
            results = run_states(executable(), case, "--want", "driving_force,reaction", "--error", solver=solver, time=case.time)
            good = results["status"][:, 0] == "ok"
            true, estimate = true_errors(_forces(results), exact), _forces(results, "_error")
            worst = true[good].max(axis=1) / np.abs(exact[good]).max(axis=1)
            if solver == solvers[0]:
                ratio = ratio_to_estimate(true, estimate)
                ratio = ratio[~np.isnan(ratio)]
                # a part of an estimate is what changes of the data's last place do
                cells += [f"{case.distance[good].min():.0e} {case.distance_unit}", str(np.sum(~good)), f"{results['error'][good].max() / SAFETY:.0e}"]
            cells.append(f"{worst.max():.0e}")
        cells += [f"{100 * np.mean(ratio > 1):.2g} %", f"{1 / np.median(ratio):.2g}"]
        lines.append(f"| {case.title} | {len(case.q)} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _forces(results: dict[str, np.ndarray], suffix: str = "") -> np.ndarray:
    return np.concatenate([results[f"driving_force{suffix}"], results[f"reaction{suffix}"]], axis=1)


# ------------------------------------------------------------------------------------------------------------ long runs
LONG = (
    ("rk4", "400 steps a turn", {"per_turn": 400}), ("rk4", "1000 steps a turn", {"per_turn": 1000}),
    *((method, f"tol {tolerance:.0e}", {"rtol": tolerance, "atol": tolerance})
      for method, ladder in (("rkf45", (1e-8, 1e-11)), ("rk8pd", (1e-10, 1e-14)), ("msbdf", (1e-8, 1e-11)), ("gbs", (1e-10, 1e-14)))
      for tolerance in ladder),
)  # fmt: skip
TURNS, PARTS = 1000, 25


def long_table() -> str:
    """A thousand turns of a pendulum by every method, and a million steps of rk4 on a rotor."""
    lines = ["| run | method | setting | steps | s | angle [rad] | energy |", "|---|---|---|---:|---:|---:|---:|"]
    for method, setting, chosen in LONG:
        start = time.perf_counter()
        run = whirl(TURNS, PARTS, method, **chosen)
        lines.append(f"| pendulum, {TURNS} turns | {method} | {setting} | {run.steps} | {time.perf_counter() - start:.2g} "
                     f"| {run.state:.0e} | {run.energy:.0e} |")
    for n in (10**4, 10**5, 10**6):
        start = time.perf_counter()
        run = spin(n)
        lines.append(f"| rotor, 70 rad | rk4 | {8.0 / n:.0e} s | {run.steps} | {time.perf_counter() - start:.2g} "
                     f"| {run.state:.0e} | {run.energy:.0e} |")
    return "\n".join([*lines, "", f"Seconds: {processor_line()}."])


def draw_long() -> plt.Figure:
    """How errors grow with the turns, beside what the last place of the start makes of the motion."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    turns = (10, 30, 100, 300, 1000)
    for method, setting, chosen in LONG:
        runs = [whirl(n, 10, method, **chosen) for n in turns]
        style = "-" if setting == next(s for m, s, _ in LONG if m == method) else "--"
        for axis, values in zip(axes, ([run.state for run in runs], [run.energy for run in runs])):
            axis.plot(turns, values, f"o{style}", color=COLOURS[method], markersize=3, linewidth=1.1, label=f"{method}, {setting}")
    moved = [moved_start(n) for n in turns]
    for axis, values in zip(axes, ([run.state for run in moved], [run.energy for run in moved])):
        axis.plot(turns, values, ":", color="0.4", linewidth=1.1, label="start moved by its last place")
    for axis, title in zip(axes, ("error of the angle [rad]", "change of the energy, relative")):
        axis.set(xscale="log", yscale="log", xlabel="turns of a pendulum", title=title)
        axis.set_xticks(turns, [f"{n}" for n in turns])
        axis.minorticks_off()
        clear_axis(axis)
    legend_beside(axes[1])
    return figure
