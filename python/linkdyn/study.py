"""Time against error of every method on one scene, measured by the executable."""

from __future__ import annotations

import csv
import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import xarray as xr

from ._listing import only
from .cli import executable, quadruple_twin
from .errors import LinkdynError

__all__ = ["run_study"]
__dir__ = only(__all__)

AGAINST = "  errors against the "
"""Begins the line of the report that says what errors are measured against."""
FAILED = 1e30
"""Errors from here on stand for a run that could not be finished."""


def run_study(text: str, folder: str, t_end: float | None) -> xr.Dataset:
    """What ``linkdyn study`` measures, as a Dataset.

    Parameters
    ----------
    text
        The scene file.
    folder
        Where its tables lie.
    t_end
        End of the forward runs [s]; None: the scene's.

    Raises
    ------
    LinkdynError
        With the executable's message.
    """
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        for entry in Path(folder).resolve().iterdir():
            if entry.name != "scene.toml":
                (work / entry.name).symlink_to(entry)
        (work / "scene.toml").write_text(text, encoding="utf-8")
        command = [os.fspath(executable()), "study", "scene.toml", "-o", "study.csv"]
        if t_end is not None:
            command += ["--until", repr(float(t_end))]
        twin = quadruple_twin()
        environment = os.environ | ({"LINKDYN_REAL128": os.fspath(twin)} if twin else {})
        run = subprocess.run(command, cwd=work, env=environment, capture_output=True, text=True, check=False)
        if run.returncode != 0:
            raise LinkdynError(run.stderr.strip().removeprefix("scene.toml: "))
        with (work / "study.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
    error = np.array([float(row["error [1]"]) for row in rows])
    error[error > FAILED] = np.nan
    against = next(line for line in run.stdout.splitlines() if line.startswith(AGAINST))
    return xr.Dataset(
        {
            "seconds": ("row", [float(row["seconds [s]"]) for row in rows], {
                "units": "s", "long_name": "time of a sample (inverse), of the whole run (forward)"}),
            "error": ("row", error, {"units": "1", "long_name": "relative error; NaN: the run failed"}),
            "steps": ("row", [int(row["steps [1]"]) for row in rows], {"units": "1", "long_name": "steps taken"}),
        },
        {key: ("row", [row[key] for row in rows]) for key in ("analysis", "method", "setting")},
        {"report": run.stdout, "reference": against.removeprefix(AGAINST)},
    )
