"""Units of the columns of a result."""

from __future__ import annotations

import xarray as xr

__all__ = ["units_of"]

DRIVEN = {"N": "m", "N m": "rad"}
"""Unit of the joint variable that an actuator of this unit drives."""


def units_of(values: xr.DataArray) -> list[str]:
    """Of each label of the last dimension: of "m/s, rad/s" those of m and of rad."""
    dimension = values.dims[-1]
    n, units = values.sizes[dimension] if values.ndim > 1 else 1, str(values.attrs.get("units", "1")).split(", ")
    if len(units) == 1 or f"{dimension}_unit" not in values.coords:
        return [", ".join(units)] * n
    found = {unit.split("/")[0]: unit for unit in units}
    own = [str(unit) for unit in values.coords[f"{dimension}_unit"].values]
    return [found.get(unit) or found[DRIVEN[unit]] for unit in own]
