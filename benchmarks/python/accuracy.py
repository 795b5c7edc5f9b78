"""Tables and pictures of docs/accuracy.md: hard cases against the quadruple twin, error estimates, forward runs, studies.

Usage: accuracy.py [--no-studies]; needs linkdyn installed and linkdyn-real128 beside it (`make accuracy` sees to both).
All goes under results/benchmarks.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import linkdyn
import matplotlib.pyplot as plt
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "hard"), str(ROOT / "benchmarks" / "python")]

from accuracy_runs import draw_long, draw_runs, long_table, measure_runs, motions_table, runs_table  # noqa: E402
from bench_inverse import COLOURS, PLAIN  # noqa: E402
from cases import Case, examples, hard_cases  # noqa: E402
from estimates import SAFETY  # noqa: E402
from linkdyn.cli import quadruple_twin  # noqa: E402
from report import clear_axis, legend_beside, save_picture, save_table  # noqa: E402
from twin import forces_of, quadruple_forces, ratio_to_estimate, true_errors  # noqa: E402

SOLVERS = ("elimination", "lapack", "gauss-jordan")
DRAWN = ("four_bar_change_point", "dead_centre_outer", "slider_crank_1e-06", "fichter")
STUDIED = ("stewart_tsai", "fourbar", "stewart_forward", "rcsp_start")


class Measured:
    """True and estimated errors of one case by one solver."""

    def __init__(self, case: Case, solver: str, exact: np.ndarray) -> None:
        run = linkdyn.Scene(case.scene, case.folder).inverse(
            q=case.q, qd=case.qd, qdd=case.qdd, want="driving_force,reaction", solver=solver, error=True
        )
        forces, estimate = forces_of(run), forces_of(run, "_error")
        true = true_errors(forces, exact)
        self.solved = int((run.status.values == 0).sum())
        ratio = ratio_to_estimate(true, estimate)
        self.ratio = ratio[~np.isnan(ratio)]
        self.relative = true.max(axis=1) / np.abs(forces).max(axis=1)
        self.estimated = run.error.values


Results = dict[str, tuple[Case, dict[str, Measured], np.ndarray]]
"""By case: measured by solver, and the errors without pivoting."""


def measure(program: Path) -> Results:
    """All cases by all solvers."""
    result = {}
    for case in [*hard_cases(), *examples()]:
        exact = quadruple_forces(program, case)
        result[case.name] = (case, {solver: Measured(case, solver, exact) for solver in SOLVERS}, plain_errors(case, exact))
    return result


def plain_errors(case: Case, exact: np.ndarray) -> np.ndarray:
    """Relative errors without pivoting, NaN where a pivot was zero."""
    run = linkdyn.Scene(case.scene, case.folder).inverse(
        q=case.q, qd=case.qd, qdd=case.qdd, want="driving_force,reaction", solver=PLAIN
    )
    forces = forces_of(run)
    return true_errors(forces, exact).max(axis=1) / np.abs(forces).max(axis=1)


def worst_digits(values: np.ndarray) -> str:
    """The largest, a relative error; above 1 nothing is left; failed if no sample was solved."""
    if np.isnan(values).all():
        return "failed"
    largest = np.nanmax(values)
    return "none left" if largest >= 1 else f"{largest:.0e}"


def case_table(result: Results) -> str:
    lines = [
        "| case | samples | data allow | " + " | ".join((*SOLVERS, "without pivoting")) + " | above estimate | estimate/true |",
        "|---|---:|---:|" + "---:|" * (len(SOLVERS) + 3),
    ]
    for name, (case, by_solver, plain) in result.items():
        if name.startswith("example_"):
            continue
        first = by_solver["elimination"]
        cells = [f"{case.title}", str(len(case.q)), worst_digits(first.estimated / SAFETY)]
        cells += [worst_digits(by_solver[solver].relative) for solver in SOLVERS]
        cells.append(worst_digits(plain))
        cells += [f"{100 * np.mean(first.ratio > 1):.2g} %", f"{1 / np.median(first.ratio):.2g}"]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def estimate_table(result: Results) -> str:
    lines = ["| solver | cases | numbers | above estimate | 99.9 % below | largest | median estimate/true |",
             "|---|---|---:|---:|---:|---:|---:|"]
    for solver in SOLVERS:
        for title, is_easy in (("hard", False), ("examples", True)):
            ratio = np.concatenate([
                by_solver[solver].ratio for name, (_, by_solver, _) in result.items() if name.startswith("example_") == is_easy
            ])
            lines.append(f"| {solver} | {title} | {len(ratio)} | {100 * np.mean(ratio > 1):.2g} % "
                         f"| {np.percentile(ratio, 99.9):.2g} | {ratio.max():.2g} | {1 / np.median(ratio):.2g} |")
    return "\n".join(lines)


def draw_histogram(result: Results) -> plt.Figure:
    figure, axis = plt.subplots(figsize=(7.5, 4.2), layout="constrained")
    bins = np.linspace(-7, 1, 81)
    for solver in SOLVERS:
        ratio = np.concatenate([m[solver].ratio for name, (_, m, _) in result.items() if not name.startswith("example_")])
        axis.hist(np.log10(np.clip(ratio, 10.0 ** bins[0], None)), bins=bins, histtype="step", color=COLOURS[solver], label=solver,
                  weights=np.full(len(ratio), 100 / len(ratio)), linewidth=1.4)
    axis.axvline(0, color="0.4", linewidth=0.9)
    axis.annotate("estimate too small", (0.05, 0.95), xycoords=("data", "axes fraction"), color="0.3", fontsize="small", va="top")
    axis.set(yscale="log", xlabel="log10 of true error / estimate (those below -7 in the first bin)", ylabel="share of all numbers [%]",
             title="All hard cases")
    clear_axis(axis)
    legend_beside(axis)
    return figure


def draw_families(result: Results) -> plt.Figure:
    """Where solvers err alike, their rings stand one inside the other."""
    figure, axes = plt.subplots(2, 2, figsize=(10, 7.5), layout="constrained")
    for axis, name in zip(axes.flat, DRAWN):
        case, by_solver, _ = result[name]
        for solver, size in zip(SOLVERS, (7.0, 4.5, 2.0)):
            axis.plot(case.distance, np.maximum(by_solver[solver].relative, 1e-17), "o", color=COLOURS[solver], markersize=size,
                      fillstyle="none", markeredgewidth=0.6, label=solver)
        axis.plot(case.distance, by_solver["elimination"].estimated, ".", color="0.7", markersize=3, label="estimate", zorder=0)
        axis.set(xscale="log", yscale="log", xlabel=f"distance [{case.distance_unit}]", ylabel="relative error", title=case.title)
        axis.set_ylim(5e-18, 1e2)
        clear_axis(axis)
        axis.invert_xaxis()
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=len(SOLVERS) + 1, frameon=False)
    return figure


def cost_table() -> str:
    """Time with estimates over time without, best of several."""
    lines = ["| scene | results | us a sample | with estimates | ratio |", "|---|---|---:|---:|---:|"]
    for name in ("stewart_tsai", "fourbar", "sixbar_slider", "andrews"):
        scene = linkdyn.load(ROOT / "examples" / name / "scene.toml")
        last = scene.description["time"]["last"]
        q, qd, qdd = scene.motion(np.linspace(0.0, last, 16384))
        for want in ("driving_force", "driving_force,reaction", "all"):
            best = {False: np.inf, True: np.inf}
            for _ in range(12):
                # One after the other: both find the memory for their results as the other has left it.
                for error in best:
                    start = time.perf_counter()
                    scene.solve(q, qd, qdd, want=want, error=error)
                    best[error] = min(best[error], 1e6 * (time.perf_counter() - start) / len(q))
            lines.append(f"| {name} | {want.replace(',', ', ').replace('_', ' ')} | {best[False]:.3g} | {best[True]:.3g} "
                         f"| {best[True] / best[False]:.2g} |")
    return "\n".join(lines)


def studies() -> str:
    parts = []
    for name in STUDIED:
        result = linkdyn.load(ROOT / "examples" / name / "scene.toml").study()
        figure, _ = linkdyn.plot.study(result)
        save_picture(figure, f"study_{name}")
        report = "\n".join("    " + line for line in result.attrs["report"].rstrip().splitlines())
        parts.append(f"`linkdyn study examples/{name}/scene.toml`\n\n{report}\n\n![{name}](accuracy/study_{name}.png)\n")
    return "\n".join(parts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-studies", action="store_true", help="all but the studies")
    given = parser.parse_args()
    program = quadruple_twin()
    if program is None:
        sys.exit("linkdyn-real128 is not built (expected it beside the executable: make real128)")
    result = measure(program)
    save_table("cases", case_table(result))
    save_table("estimates", estimate_table(result))
    save_table("cost", cost_table())
    save_picture(draw_histogram(result), "estimates")
    save_picture(draw_families(result), "families")
    runs = measure_runs(program)
    save_table("runs", runs_table(runs))
    save_picture(draw_runs(runs), "runs")
    save_table("motions", motions_table(program))
    save_table("long", long_table())
    save_picture(draw_long(), "long")
    if not given.no_studies:
        save_table("studies", studies())
    print(estimate_table(result))


if __name__ == "__main__":
    main()
