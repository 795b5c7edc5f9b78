#!/usr/bin/env python3
"""Time against error of the solvers of inverse dynamics.

    python benchmarks/python/bench_inverse.py [--program FILE] [--runs N]

Runs the Fortran program bench_inverse for the times, compares every solver with the 50-digit references in
tests/reference for the errors; with the quadruple twin of the executable (`make real128`) follows the errors towards a
singularity too. Tables `times`, `singularity` and pictures time_error.png, singularity.png under results/benchmarks.
"""
from __future__ import annotations

import argparse
import csv
import io
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import linkdyn
from linkdyn.cli import quadruple_twin
from report import ROOT, clear_axis, legend_beside, processor_line, save_picture, save_table

SCENES = ("tsai", "aris", "drilling")
SOLVERS = ("gauss-jordan", "lapack", "elimination", "reduced")
"""Followed towards the singularity."""
PLAIN = "gauss-jordan-plain"
COLOURS = dict(zip((*SOLVERS, PLAIN), ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00")))
MARKS = dict(zip(SCENES, "os^"))
DISTANCES = [10.0**-k for k in range(1, 11)]
COMPONENTS = ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]


def relative_error(ours: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Largest difference in each sample, relative to the sample's largest value. Shape (N,)."""
    n = len(exact)
    scale = np.abs(exact).reshape(n, -1).max(axis=1)
    return np.abs(ours - exact).reshape(n, -1).max(axis=1) / scale


# ------------------------------------------------------------------------------------------ errors on regular poses
def reference_errors(name: str, solver: str, want: str) -> tuple[float, float]:
    """Largest relative error of the driving forces, and of the reactions (NaN if not wanted), over the states."""
    reference = json.loads((ROOT / "tests" / "reference" / f"stewart_{name}.json").read_text())
    states = reference["states"]
    scene = linkdyn.load(ROOT / "examples" / f"stewart_{name}" / "scene.toml")
    q, qd, qdd, wrench = (np.array([s[key] for s in states]) for key in ("q", "qd", "qdd", "wrench"))
    run = scene.inverse(q=q, qd=qd, qdd=qdd, wrench={reference["wrench_on"]: wrench}, solver=solver,
                        want="driving_force" if want == "driving_force" else "driving_force,reaction")
    exact = np.array([[float(x) for x in s["driving_force"]] for s in states])
    force = relative_error(run.driving_force.values, exact).max()
    if "reaction" not in run:
        return force, np.nan
    joints = list(states[0]["reaction"])
    exact = np.array([[[float(x) for x in s["reaction"][j]] for j in joints] for s in states])
    ours = run.reaction.sel(joint=joints, component=COMPONENTS).transpose("sample", "joint", "component").values
    return force, relative_error(ours, exact).max()


# ------------------------------------------------------------------------------------------------------------ times
def measure(program: Path, n_run: int) -> tuple[dict[str, str], list[dict]]:
    """Peak and lanes, and one row a scene, solver and want: the least disturbed of some runs of the Fortran program."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    peak, best = 0.0, {}
    for _ in range(n_run):
        text = subprocess.run([program], cwd=ROOT, env=environment, check=True, capture_output=True, text=True).stdout
        head, _, body = text.partition("\n")
        peak = max(peak, float(head.split("multiply-add peak")[1].split()[0]))
        lanes = head.rsplit(",", 1)[1].split()[0]
        for line in csv.DictReader(io.StringIO(body)):
            row = {"scene": Path(line["scene"]).parent.name.removeprefix("stewart_"), "solver": line["solver"],
                   "want": line["want"], "us": float(line["us_per_pose"]),
                   "flops": solve_flops(line["solver"], int(line["elimination_flops"])), "fallbacks": int(line["fallbacks"])}
            key = row["scene"], row["solver"], row["want"]
            if key not in best or row["us"] < best[key]["us"]:
                best[key] = row
    return {"peak": peak, "lanes": lanes}, list(best.values())


def solve_flops(solver: str, of_elimination: int) -> int:
    """Flops of solving the equations of a Stewart platform, kinematics and assembly not counted."""
    n = 6 if solver == "reduced" else 78
    if solver == "elimination":
        return of_elimination
    if solver == "lapack":      # LU and two triangular solves, without equilibration, refinement and condition number
        return round(2 * n**3 / 3 + 2 * n**2)
    return sum(2 * (n - 1) * (n + 1 - k) for k in range(1, n + 1))     # Gauss-Jordan, one right-hand side


def table(rows: list[dict], machine: dict[str, str]) -> str:
    lapack = {row["scene"]: row["us"] for row in rows if row["solver"] == "lapack" and row["want"] == "all"}
    lines = ["| scene | solver | results | us/pose | times faster than lapack | flops of the solve | of peak "
             "| error of driving forces | error of reactions |",
             "|---|---|---|---:|---:|---:|---:|---:|---:|"]
    for row in rows:
        reaction = "" if np.isnan(row["reaction"]) else f"{row['reaction']:.1e}"
        share = row["flops"] / (row["us"] * 1e-6) / (machine["peak"] * 1e9)
        lines.append(f"| {row['scene']} | {row['solver']} | {row['want'].replace('_', ' ')} | {row['us']:.3g} "
                     f"| {lapack[row['scene']] / row['us']:.3g} | {row['flops']} | {100 * share:.2g} % "
                     f"| {row['force']:.1e} | {reaction} |")
    return "\n".join(lines)


def draw_times(rows: list[dict]) -> plt.Figure:
    figure, axis = plt.subplots(figsize=(7.5, 4.5), layout="constrained")
    for row in rows:
        worst = np.nanmax([row["force"], row["reaction"]])
        axis.plot(row["us"], worst, MARKS[row["scene"]], color=COLOURS[row["solver"]], markersize=8,
                  fillstyle="full" if row["want"] == "all" else "none")
    for solver in dict.fromkeys(row["solver"] for row in rows):
        axis.plot([], [], "o", color=COLOURS[solver], label=solver)
    for scene in SCENES:
        axis.plot([], [], MARKS[scene], color="0.3", label=f"stewart_{scene}")
    axis.plot([], [], "o", color="0.3", fillstyle="none", label="driving forces only")
    axis.axhline(np.finfo(float).eps, color="0.6", linewidth=0.8)
    axis.annotate("eps", (0.99, np.finfo(float).eps), xycoords=("axes fraction", "data"), ha="right", va="bottom",
                  color="0.4")
    axis.set(xscale="log", yscale="log", xlabel="time per pose, one thread [us]",
             ylabel="largest relative error", title="From pose, velocity, acceleration to forces")
    clear_axis(axis)
    legend_beside(axis)
    return figure


# ------------------------------------------------------------------------------------------------------ singularity
def follow_singularity(quad: Path) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Errors of each solver by distance, 1/rcond by distance, and which of them elimination gave to the dense solver."""
    file = ROOT / "benchmarks" / "scenes" / "fichter.toml"
    text = file.read_text()
    scene = linkdyn.load(file)
    q, qd, qdd = (np.repeat(x, len(DISTANCES), axis=0) for x in scene.motion())
    q[:, scene.coordinates.index("platform.yaw")] = -np.array(DISTANCES)
    assert "yaw = -0.1\n" in text
    exact = np.array([quad_solution(quad, text.replace("yaw = -0.1\n", f"yaw = {-d!r}\n"), scene) for d in DISTANCES])
    n_drive = len(scene.actuators)
    errors = {}
    for solver in SOLVERS:
        full = solver != "reduced"
        run = scene.inverse(q=q, qd=qd, qdd=qdd, solver=solver, want="driving_force,reaction,checks" if full else "driving_force")
        values = [run.driving_force.values]
        if full:
            order = run.reaction.transpose("sample", "joint", "component").sel(joint=list(scene.joints), component=COMPONENTS)
            values.append(order.values.reshape(len(DISTANCES), -1))
        ours = np.concatenate(values, axis=1)
        errors[solver] = relative_error(ours, exact if full else exact[:, :n_drive])
        if solver == "lapack":
            condition = 1 / run.rcond.values
        if solver == "elimination":
            handed_on = np.array([scene.inverse(q=one[np.newaxis]).attrs["samples_dense"] > 0 for one in q])
    return errors, condition, handed_on


def quad_solution(quad: Path, text: str, scene: linkdyn.Scene) -> np.ndarray:
    """Driving forces and reactions of a one-sample scene from the quadruple twin."""
    with tempfile.TemporaryDirectory() as folder:
        path, out = Path(folder) / "scene.toml", Path(folder) / "out.csv"
        path.write_text(text)
        subprocess.run([quad, "inverse", path, "--csv", "-o", out, "--quiet", "--want", "driving_force,reaction"], check=True)
        header, values = list(csv.reader(out.open()))
    value = {name.rsplit(" [", 1)[0]: x for name, x in zip(header, values)}
    names = [f"driving_force {a}" for a in scene.actuators] + [f"reaction {j} {c}" for j in scene.joints for c in COMPONENTS]
    return np.array([float(value[name]) for name in names])


def singularity_table(errors: dict[str, np.ndarray], condition: np.ndarray, handed_on: np.ndarray) -> str:
    lines = ["| distance [rad] | 1/rcond | " + " | ".join(SOLVERS) + " | elimination handed it to lapack |",
             "|---:|---:|" + "---:|" * len(SOLVERS) + "---|"]
    for i, distance in enumerate(DISTANCES):
        lines.append(f"| {distance:.0e} | {condition[i]:.1e} | " + " | ".join(f"{errors[s][i]:.1e}" for s in SOLVERS)
                     + f" | {'yes' if handed_on[i] else 'no'} |")
    return "\n".join(lines)


def draw_singularity(errors: dict[str, np.ndarray]) -> plt.Figure:
    figure, axis = plt.subplots(figsize=(7.5, 4.5), layout="constrained")
    for solver in SOLVERS:
        axis.plot(DISTANCES, errors[solver], "o-", color=COLOURS[solver], label=solver, linewidth=1.2)
    axis.plot(DISTANCES, np.finfo(float).eps / np.array(DISTANCES), "--", color="0.6", label="eps/distance")
    axis.set(xscale="log", yscale="log", xlabel="distance of yaw from the singularity [rad]", ylabel="relative error",
             title="Fichter's platform")
    axis.invert_xaxis()
    clear_axis(axis)
    legend_beside(axis)
    return figure


# ---------------------------------------------------------------------------------------------------------- report
def machine_line(machine: dict[str, str]) -> str:
    return f"{processor_line()}; multiply-add peak of one core {machine['peak']:.1f} GFlop/s; {machine['lanes']} lanes."


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path, help="bench_inverse_real64 (default: the one under build)")
    parser.add_argument("--runs", type=int, default=3, help="runs of the Fortran program; the best time counts (default 3)")
    given = parser.parse_args()
    program = given.program or next(ROOT.glob("build/*/benchmarks/bench_inverse_real64"), None)
    if program is None:
        sys.exit("bench_inverse_real64 is not built (meson option benchmarks)")

    machine, rows = measure(program.resolve(), given.runs)
    for row in rows:
        row["force"], row["reaction"] = reference_errors(row["scene"], row["solver"], row["want"])
    times = table(rows, machine)
    save_table("times", f"{machine_line(machine)}\n\n{times}")
    save_picture(draw_times(rows), "time_error")
    print(times)
    quad = quadruple_twin()
    if quad is None:
        print("no linkdyn-real128: the way to the singularity is left out (make real128)")
        return
    errors, condition, handed_on = follow_singularity(quad)
    near = singularity_table(errors, condition, handed_on)
    save_table("singularity", near)
    save_picture(draw_singularity(errors), "singularity")
    print(near)


if __name__ == "__main__":
    main()
