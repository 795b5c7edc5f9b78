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
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for table in case.folder.glob("*.csv"):
            shutil.copy(table, folder)
        (folder / "scene.toml").write_text(tomli_w.dumps(case.scene))
        write_states(folder / "states.csv", case, time)
        command = [program, "inverse", "scene.toml", "--states", "states.csv", "--want", want]
        run = subprocess.run(
            [*command, "--solver", "lapack", "--csv", "-o", "results.csv", "--quiet"],
            cwd=folder, capture_output=True, text=True, check=False,
        )
        if run.returncode not in (0, 3):
            raise RuntimeError(f"{case.name}: {run.stderr}")
        header, *rows = csv.reader((folder / "results.csv").open())
    columns = [i for i, title in enumerate(header) if title.split(" ")[0] in want.split(",")]
    return np.array([[float(row[i]) for i in columns] for row in rows])


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
