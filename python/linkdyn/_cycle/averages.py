"""Averages over the samples of a run: the mean and rms of sheets and cycle results.

A sample stands for the time from half-way to the sample before to half-way to the one after; the first and the last for the whole
of their one gap. Evenly spaced samples so count alike, as those of a batch or a sweep do, and those whose instants do not increase:
poses without time in a file of the command. The command's summary has the same in Fortran (app/linkdyn_time_mean.f90).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..errors import InputError

__all__ = ["good_samples", "mean", "need_order", "power_mean", "rms", "shares"]

Values = NDArray[np.float64]


def good_samples(run: xr.Dataset) -> NDArray[np.bool_]:
    """(N,) which samples did not fail."""
    return run.status.values == 0 if "status" in run else np.ones(run.sizes["sample"], dtype=bool)


def need_order(run: xr.Dataset, caller: str) -> None:
    """Refuse instants that go back: a cycle, a film and a sheet follow a motion from sample to sample."""
    if "time" not in run.coords:
        return
    times = run.time.values
    if (back := np.flatnonzero(np.diff(times) < 0)).size:
        k = int(back[0])
        raise InputError(f"{caller}: the instants of the run go back, {times[k + 1]:g} s follows {times[k]:g} s (expected increasing ones)")


def shares(run: xr.Dataset) -> Values:
    """(N,) part of the time that each sample stands for; of those that failed none. Their sum is 1, or 0 where all failed."""
    n = run.sizes["sample"]
    if "time" in run.coords and n > 1:
        gaps = np.diff(run.time.values)
        weights = (np.append(gaps[0], gaps) + np.append(gaps, gaps[-1])) / 2 if np.all(gaps > 0) else np.ones(n)
    else:
        weights = np.ones(n)
    weights = np.where(good_samples(run), weights, 0.0)
    return weights / (weights.sum() or 1.0)


def power_mean(values: Any, weights: Values, exponent: float) -> Values:
    """(sum of weights * abs(values)**exponent)**(1/exponent) over the first dimension; NaN where no weight is.

    Values are scaled by their largest, so that no power of them is beyond all numbers.
    """
    used = weights > 0
    if not used.any():
        return np.full(np.shape(values)[1:], np.nan)
    sizes = np.abs(np.asarray(values, dtype=float)[used])
    largest = np.asarray(sizes.max(axis=0))
    scale = np.where(largest > 0, largest, 1.0)
    found: Values = scale * np.tensordot(weights[used] / weights[used].sum(), (sizes / scale) ** exponent, axes=1) ** (1 / exponent)
    return found


def rms(values: Any, weights: Values) -> Values:
    """Root of the weighted mean square over the first dimension."""
    return power_mean(values, weights, 2.0)


def mean(values: Any, weights: Values) -> Values:
    """Weighted mean over the first dimension; NaN where no weight is."""
    used = weights > 0
    if not used.any():
        return np.full(np.shape(values)[1:], np.nan)
    found: Values = np.tensordot(weights[used] / weights[used].sum(), np.asarray(values, dtype=float)[used], axes=1)
    return found
