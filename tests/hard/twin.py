"""Answers of the quadruple twin, from exactly the double-precision states of a case."""

from __future__ import annotations

import csv
import shutil
import subprocess
import tempfile
from pathlib import Path

import linkdyn
import numpy as np
import tomli_w
import xarray as xr
from cases import Case

NEGLIGIBLE = 1e-25
"""Of the largest force of a sample: what is smaller is zero but for the twin's own rounding."""


def forces_of(run: xr.Dataset, suffix: str = "") -> np.ndarray:
    """Driving forces and reaction components (N, width) of a run, or their estimated errors (suffix "_error")."""
    n = run.sizes["sample"]
    parts = [run[f"{name}{suffix}"].values.reshape(n, -1) for name in ("driving_force", "reaction") if f"{name}{suffix}" in run]
    return np.concatenate(parts, axis=1)


def quadruple_forces(program: Path, case: Case, time: np.ndarray | None = None) -> np.ndarray:
    """What `forces_of` gives, computed by ``linkdyn-real128`` and rounded to doubles; arguments as in `quadruple_results`."""
    return quadruple_results(program, case, "driving_force,reaction", time)


def quadruple_results(program: Path, case: Case, want: str, time: np.ndarray | None = None) -> np.ndarray:
    """Results (N, width) computed by ``linkdyn-real128`` with the dense solver and rounded to doubles.

    Parameters
    ----------
    program
        The twin.
    case
        Scene and states.
    want
        Names of results, with commas.
    time
        (N,) if the states follow each other along a motion.
    """
    results = run_states(program, case, "--want", want, time=time)
    return np.concatenate([results[name] for name in results if name in want.split(",")], axis=1)


def run_states(
    program: Path, case: Case, *options: str, solver: str = "lapack", time: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    """Inverse dynamics of a case's states by an executable: results (N, width) as doubles, by name.

    Parameters
    ----------
    program
        ``linkdyn`` or its twin.
    options
        Of the command line, beside these.
    time
        (N,) if the states follow each other along a motion.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for table in case.folder.glob("*.csv"):
            shutil.copy(table, folder)
        (folder / "scene.toml").write_text(tomli_w.dumps(case.scene))
        write_states(folder / "states.csv", case, time)
        command = [program, "inverse", "scene.toml", "--states", "states.csv", "--solver", solver, *options]
        run = subprocess.run(
            [*command, "--csv", "-o", "results.csv", "--quiet"], cwd=folder, capture_output=True, text=True, check=False
        )
        if run.returncode not in (0, 3):
            raise RuntimeError(f"{case.name}: {run.stderr}")
        header, *rows = csv.reader((folder / "results.csv").open())
    columns: dict[str, list[int]] = {}
    for i, title in enumerate(header):
        columns.setdefault(title.split(" ")[0], []).append(i)
    results = {}
    for name, places in columns.items():
        kind = str if name in ("status", "assembly") else float
        results[name] = np.array([[kind(row[i]) for i in places] for row in rows])
    return results


def write_states(file: Path, case: Case, time: np.ndarray | None) -> None:
    """A file for ``--states``: 17 digits are exactly the doubles."""
    names = linkdyn.Scene(case.scene, case.folder).coordinates
    header = [f"{kind} {name}" for kind in ("q", "qd", "qdd") for name in names]
    columns = [case.q, case.qd, case.qdd]
    if time is not None:
        header.insert(0, "time")
        columns.insert(0, time[:, np.newaxis])
    np.savetxt(file, np.concatenate(columns, axis=1), "%.17g", ",", header=",".join(header), comments="")


def true_errors(forces: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """|difference|, zero where it is negligible beside the sample's largest force; NaN where either failed."""
    error = np.abs(forces - exact)
    largest = np.nanmax(np.abs(exact), axis=1, keepdims=True, initial=0.0)
    error[error < NEGLIGIBLE * largest] = 0.0
    return error


# --------------------------------------------------------------------------------------------------- forward runs
QUANTITIES = ("q", "qd", "qdd", "driving_force", "reaction", "joint_rate")
"""What forward runs estimate errors of."""


def quadruple_run(program: Path, scene: Path, end: float, n: int, tolerance: float = 1e-20) -> dict[str, np.ndarray]:
    """A forward run by ``linkdyn-real128``: times and quantities, (N, ...) as doubles.

    Parameters
    ----------
    program
        The twin.
    scene
        Scene file; its run starts at 0.
    end
        [s]; with n a power of two plus one, and few digits, the instants are exact doubles.
    n
        Number of instants.
    tolerance
        Of a step.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.csv"
        command = [program, "forward", scene, "--method", "gbs", "--rtol", tolerance, "--atol", tolerance, "--samples", n]
        command += ["--until", repr(float(end)), "--csv", "-q", "-o", file]
        run = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
        if run.returncode != 0:
            raise RuntimeError(f"{scene}: {run.stderr}")
        header, *rows = csv.reader(file.open())
    result = {}
    for name in ("time", *QUANTITIES):
        columns = [i for i, title in enumerate(header) if title.startswith(f"{name} ")]
        if columns:
            result[name] = np.array([[float(row[i]) for i in columns] for row in rows])
    return result | {"time": result["time"][:, 0]}


def run_ratios(run: xr.Dataset, exact: dict[str, np.ndarray], names: tuple[str, ...] = QUANTITIES) -> np.ndarray:
    """True error over estimate of all numbers of a forward run that are not zero by nature."""
    ratios = []
    for name in names:
        if name not in run:
            continue
        value, estimate = run[name].values, run[f"{name}_error"].values
        difference = value - exact[name].reshape(value.shape)
        if name == "q":  # orientations may jump by a turn
            turning = run["coordinate_unit"].values == "rad"
            difference[:, turning] -= 2 * np.pi * np.round(difference[:, turning] / (2 * np.pi))
        true = np.abs(difference)
        true[true < NEGLIGIBLE * np.nanmax(np.abs(value), initial=0.0)] = 0.0
        counts = np.isfinite(true) & ((true > 0) | (estimate > 0))
        ratios.append(true[counts] / np.maximum(estimate[counts], np.finfo(float).tiny))
    return np.concatenate(ratios)
