"""Sweeps over workspaces, load cases and designs, as ``linkdyn sweep`` runs them."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from tqdm.auto import tqdm

from . import _bind
from .results import run_attributes

__all__ = ["run_sweep"]

ROUND_SECONDS = 0.3
"""Of computing in one call of the engine: an interrupt (Ctrl-C) is heard between two calls."""
MOST_CHUNKS = 4096
MOST_KEPT = 1 << 24
"""Values kept by one call."""


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
) -> xr.Dataset:
    """Compute a sweep from its start to its end.

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
    """
    sweep = _bind.open_sweep(handle, folder, solver, keep)
    try:
        samples = np.empty((sweep.n_sample if sweep.width else 0, sweep.width))
        _advance(sweep, threads, samples, progress)
        return _dataset(sweep, samples, run_attributes(scene, text, solver))
    finally:
        _bind.close_sweep(sweep)


def _advance(sweep: _bind.Sweep, threads: int, samples: NDArray[np.float64], progress: bool) -> None:
    """All chunks, in calls of about equal time; kept samples into their rows."""
    most = MOST_CHUNKS if not sweep.width else max(1, min(MOST_CHUNKS, MOST_KEPT // (sweep.width * sweep.chunk)))
    least = min(threads, most)
    n_done, first, n_next = 0, 0, least
    with tqdm(total=sweep.n_sample, unit=" samples", unit_scale=True, disable=not progress, leave=False) as bar:
        while n_done < sweep.n_chunk:
            start = time.perf_counter()
            n_before = n_done
            n_done, records = _bind.advance_sweep(sweep, n_next, threads)
            samples[first : first + len(records)] = records
            first += len(records)
            bar.update(min(n_done * sweep.chunk, sweep.n_sample) - min(n_before * sweep.chunk, sweep.n_sample))
            seconds = max(time.perf_counter() - start, 1e-6)
            n_next = int(np.clip(n_next * np.clip(ROUND_SECONDS / seconds, 0.5, 2), least, most))


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
