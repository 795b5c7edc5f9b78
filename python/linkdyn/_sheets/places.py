"""What a sheet calls a sample: its instant, and where the crank is."""

from __future__ import annotations

import numpy as np
import xarray as xr

from .._event_sides import EventSides

__all__ = ["place_of", "turning_coordinate"]


def place_of(run: xr.Dataset, sample: int) -> str:
    """Numbers behind those of the samples are those of `EventSides`."""
    if sample >= run.sizes["sample"]:
        sides, row = EventSides.of(run), sample - run.sizes["sample"]
        return f"{sides.time[row]:.6g} s, {sides.words(row)}"
    if "time" not in run.coords:
        return f"sample {sample}"
    words = f"{float(run.time[sample]):.6g} s"
    crank = turning_coordinate(run)
    if crank is None:
        return words
    return f"{words}, {crank} {np.degrees(float(run.q[sample, 0])):.4g}°".replace("-", "−")


def turning_coordinate(run: xr.Dataset) -> str | None:
    """The crank: the only coordinate, an angle that turns on by a turn at least; None if there is no such."""
    if run.sizes.get("coordinate") != 1 or str(run.coordinate_unit.values[0]) != "rad" or run.sizes["sample"] < 2:
        return None
    steps = np.diff(run.q.values[:, 0])
    turns = abs(run.q.values[-1, 0] - run.q.values[0, 0])
    is_crank = ((steps > 0).all() or (steps < 0).all()) and turns > 2 * np.pi * (1 - 1e-9)
    return str(run.coordinate.values[0]) if is_crank else None
