"""Forward runs against the quadruple twin, for docs/accuracy.md: do the error estimates hold, and what do they cost?"""

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
from bench_inverse import finish
from twin import quadruple_run, run_ratios

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SCENES = (
    "andrews/scene_forward", "fivebar_motors/scene", "fivebar_parallel/scene", "fourbar/scene", "fourbar_constant_torque/scene",
    "fourbar_start/scene", "n_fourbar/scene", "rcsp_start/scene", "sixbar_slider/scene", "stephenson_iii/scene",
    "stewart_forward/scene", "stewart_tsai/scene", "watt_i/scene",
)  # fmt: skip
N_INSTANT = 65
TOLERANCES = {
    "rkf45": (1e-4, 1e-7, 1e-10), "rk8pd": (1e-4, 1e-7, 1e-10, 1e-12, 1e-14),
    "msbdf": (1e-4, 1e-7, 1e-10), "gbs": (1e-4, 1e-7, 1e-10, 1e-12, 1e-14),
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
            runs.append(Run(name, method, setting, run_ratios(run, exact), cost))
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


def draw_runs(runs: list[Run], file: Path) -> None:
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
    finish(figure, axis, file)
