"""Sweeps over workspaces, load cases and designs, as ``linkdyn sweep`` runs them."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from tqdm.auto import tqdm

from . import _bind
from ._listing import only
from ._output import Inputs, refuse_inputs, write_by
from .errors import InputError
from .results import run_attributes

__all__ = ["run_sweep"]
__dir__ = only(__all__)

NO_NETCDF = (".csv", ".xlsx", ".xls", ".ods", ".mat", ".json", ".html", ".pdf", ".png", ".parquet")
"""Endings of files of other kinds, which the command refuses too."""
MOST_READ = 1 << 20
"""Kept samples read from their file at a time."""


def run_sweep(
    handle: int,
    folder: str,
    scene: dict[str, Any],
    text: str,
    *,
    keep: str,
    solver: str,
    threads: int,
    progress: bool,
    output: str,
    resume: bool,
    checkpoint: float,
    inputs: Inputs,
) -> xr.Dataset:
    """Compute a sweep from its start, or from where an earlier run was interrupted, to its end.

    Parameters
    ----------
    handle, folder, scene, text
        Of the scene: its number in the engine, where its tables lie, its description, its file.
    keep
        Quantities kept of every sample, with commas between.
    solver, threads
        As for `Scene.inverse`.
    progress
        Show a bar.
    output, resume, checkpoint
        As for `Scene.sweep`; no output: an empty text.
    inputs
        Files that the output must not be.
    """
    if output:
        if output.lower().endswith(NO_NETCDF):
            raise InputError(f"output: {output!r}: sweeps are written as netCDF (expected a name that ends in .nc)")
        refuse_inputs(output, inputs)
    sweep, n_done, n_next = _bind.open_sweep(handle, folder, solver, keep, threads, output, resume, checkpoint)
    has_ended = False
    try:
        samples = np.empty((sweep.n_sample if sweep.width else 0, sweep.width))
        _advance(sweep, n_done, n_next, threads, samples, progress)
        if sweep.is_for_file:
            for first in range(0, len(samples), MOST_READ):
                rows = samples[first : first + MOST_READ]
                rows[:] = _bind.kept_samples(sweep, first, len(rows))
        data = _dataset(sweep, samples, run_attributes(scene, text, solver))
        if output:
            write_by(output, data.to_netcdf, inputs)
        has_ended = True
        return data
    finally:
        _bind.close_sweep(sweep, has_ended)


def _advance(sweep: _bind.Sweep, n_done: int, n_next: int, threads: int, samples: NDArray[np.float64], progress: bool) -> None:
    """All chunks, in the engine's rounds; an interrupt (Ctrl-C) is heard between two of them. Kept samples go into their rows."""
    first, is_over = 0, False
    with tqdm(total=sweep.n_sample, unit=" samples", unit_scale=True, disable=not progress, leave=False) as bar:
        bar.update(min(n_done * sweep.chunk, sweep.n_sample))
        while not is_over:
            is_over, n_done, n_next, records = _bind.advance_sweep(sweep, n_next, threads)
            samples[first : first + len(records)] = records
            first += len(records)
            bar.update(min(n_done * sweep.chunk, sweep.n_sample) - bar.n)


def _dataset(sweep: _bind.Sweep, samples: NDArray[np.float64], attributes: dict[str, Any]) -> xr.Dataset:
    """The Dataset, as xarray opens the executable's file."""
    schema, reals, integers = _bind.sweep_results(sweep)
    sizes = schema["dimensions"]
    variables: dict[str, Any] = {}
    for variable in schema["variables"]:
        shape = tuple(sizes[name] for name in variable["dims"])
        n = int(np.prod(shape))
        if variable["kind"] == "text":
            values: Any = np.array(variable["text"], dtype=object)
        elif variable["kind"] == "real":
            values, reals = reals[:n].reshape(shape), reals[n:]
        else:
            values, integers = integers[:n].astype(np.int64).reshape(shape), integers[n:]
        variables[variable["name"]] = (variable["dims"], values, _attributes(variable))
    place = 0
    for variable in schema["kept"]:
        shape = tuple(sizes[name] for name in variable["dims"])
        n = int(np.prod(shape))
        values = samples[:, place : place + n].reshape(-1, *shape)
        place += n
        if variable["is_integer"]:
            values = values.astype(np.intc)
        variables[variable["name"]] = (("sample", *variable["dims"]), values, _attributes(variable))
    coordinates = [name for name in variables if name in sizes or name.endswith("_unit")]
    extra = {
        name: value if isinstance(value, str) else float(value[0]) for name, value in schema["attributes"].items()
    }
    return xr.Dataset(variables, attrs=attributes | extra).set_coords(coordinates)


def _attributes(variable: dict[str, Any]) -> dict[str, str]:
    return {key: variable[key] for key in ("long_name", "units") if variable[key]}
