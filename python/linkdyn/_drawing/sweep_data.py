"""What pictures and sheets read from the results of a sweep: bounds, places, samples in the cells of a grid."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..errors import InputError
from .style import readable

__all__ = [
    "LEAST",
    "Cells",
    "Grid",
    "axis_names",
    "cells_of",
    "chosen_axes",
    "describe_place",
    "entries_of",
    "mapped_axes",
    "mapped_cells",
    "need_sweep",
    "one_design",
    "unit_of",
    "values_of",
    "within_constraints",
    "worst_of",
]

LEAST = ("clearance", "determinant")
"""Quantities of which the least magnitude is the worst."""
BINS = 24
"""Cells along an axis whose samples are random."""


def need_sweep(run: Any, caller: str) -> None:
    """Refuse anything but results of a sweep."""
    if not isinstance(run, xr.Dataset) or "axis" not in run.dims or "outcome_count" not in run:
        raise InputError(f"{caller}: these are no results of a sweep (expected those of Scene.sweep or linkdyn sweep)")


def one_design(run: xr.Dataset, design: int | None, caller: str) -> xr.Dataset:
    """Results of one design; the only one if none is named."""
    if "design" not in run.dims:
        if design not in (None, 0):
            raise InputError(f"{caller}: design {design}: this sweep has one design only")
        return run
    if design is None and run.sizes["design"] > 1:
        raise InputError(f"{caller}: {run.sizes['design']} designs in this sweep (expected design = 0 ... one of them)")
    number = design or 0
    if not 0 <= number < run.sizes["design"]:
        raise InputError(f"{caller}: design {number} (expected 0 to {run.sizes['design'] - 1})")
    return run.isel(design=number)


def unit_of(run: xr.Dataset, quantity: str) -> str:
    """Unit of a reduced or kept quantity; of one with several units, that of the first entry."""
    for name in (quantity, f"{quantity}_max"):
        if name in run and "units" in run[name].attrs:
            return str(run[name].attrs["units"])
    return str(run[f"{quantity}_unit"].values.flat[0])


def entries_of(run: xr.Dataset, name: str) -> list[str]:
    """Labels of the entries of a variable: "leg1.P", or "leg1.S Fx" where there are two dimensions."""
    dims = [dim for dim in run[name].dims if dim not in ("sample", "design", "axis", "bin", "side", "bin_edge", "direction")]
    labels = [""]
    for dim in dims:
        labels = [f"{label} {value}".strip() for label in labels for value in run[dim].values]
    return labels


def values_of(run: xr.Dataset, quantity: str, at: str | None, caller: str) -> NDArray[np.float64]:
    """(sample, entry) values of a kept quantity; of one entry with ``at``."""
    if quantity not in run or "sample" not in run[quantity].dims:
        kept = [str(n) for n in run.data_vars if "sample" in run[n].dims and not str(n).startswith("sample_")]
        raise InputError(
            f"{caller}: {quantity!r} was not kept of every sample (expected one of {', '.join(kept) or 'none'}; "
            "keep = [...] in [sweep], or --keep)"
        )
    values = run[quantity].values.reshape(run.sizes["sample"], -1)
    if at is None:
        return values
    labels = entries_of(run, quantity)
    if at not in labels:
        raise InputError(f"{caller}: no {at!r} in {quantity} (expected one of {', '.join(labels)})")
    return values[:, [labels.index(at)]]


def within_constraints(run: xr.Dataset) -> NDArray[np.bool_]:
    """(sample,) which samples enter the reductions: computed, within all constraints; beyond a limit or not."""
    reduced = np.zeros(run.sizes["outcome"], dtype=bool)
    reduced[0] = True
    if "bound" in run.dims:
        reduced[-run.sizes["bound"] :] = run.bound_is_limit.values == 1
    entered: NDArray[np.bool_] = reduced[run.sample_outcome.values]
    return entered


def worst_of(quantity: str, values: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """What a designer fears of some values along an axis: the smallest gap or determinant, else the largest magnitude."""
    size = np.abs(values) if quantity != "clearance" else values
    filled = np.where(np.isnan(size), np.inf, size)
    if quantity in LEAST:
        worst = filled.min(axis=axis)
        return np.where(np.isinf(worst), np.nan, worst)
    worst = np.where(np.isnan(size), -np.inf, size).max(axis=axis)
    return np.where(np.isinf(worst), np.nan, worst)


def axis_names(run: xr.Dataset) -> list[str]:
    return [str(name) for name in run.axis.values]


def chosen_axes(run: xr.Dataset, axes: Iterable[str] | None, numbers: tuple[int, ...], caller: str) -> list[str]:
    """Axes to draw over: as asked for, else the first coordinates that vary, lengths before angles."""
    known = axis_names(run)
    if axes is not None:
        chosen = [axes] if isinstance(axes, str) else [str(name) for name in axes]
        for name in chosen:
            if name not in known:
                raise InputError(f"{caller}: no axis {name!r} in the sweep (expected one of {', '.join(known)})")
        if len(chosen) not in numbers:
            raise InputError(f"{caller}: {len(chosen)} axes (expected {' or '.join(map(str, numbers))})")
        return chosen
    units = dict(zip(known, map(str, run.axis_unit.values)))
    varied = [name for name, n in zip(known, run.axis_size.values) if n > 1]
    places = [name for name in varied if " " not in name]
    order = sorted(places, key=lambda name: units[name] != "m") + [name for name in varied if name not in places]
    if len(order) < numbers[0]:
        raise InputError(f"{caller}: only {len(order)} axes vary (expected {numbers[0]} at least)")
    lengths = [name for name in order if units[name] == "m"]
    return order[: max(numbers[0], min(numbers[-1], len(lengths)))]


@dataclass(frozen=True)
class Cells:
    """Samples sorted into the cells of a grid over some axes."""

    names: list[str]
    units: list[str]
    centres: list[NDArray[np.float64]]
    edges: list[NDArray[np.float64]]
    cell: NDArray[np.intp]
    """(picked samples,) number of the cell of each."""
    picked: NDArray[np.bool_]
    """(sample,) which samples are shown."""

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(values) for values in self.centres)

    def reduce(self, values: NDArray[np.float64], smallest: bool = False) -> NDArray[np.float64]:
        """Largest (smallest) value in every cell; NaN where there is none."""
        of_cell = np.full(int(np.prod(self.shape)), np.inf if smallest else -np.inf)
        picked = values[self.picked]
        there = ~np.isnan(picked)
        (np.minimum if smallest else np.maximum).at(of_cell, self.cell[there], picked[there])
        return np.where(np.isinf(of_cell), np.nan, of_cell).reshape(self.shape)

    def count(self, which: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Samples in every cell for which ``which`` (sample,) holds."""
        chosen = self.cell[which[self.picked]]
        return np.bincount(chosen, minlength=int(np.prod(self.shape))).reshape(self.shape)


def cells_of(run: xr.Dataset, names: list[str], where: Mapping[str, float] | None, caller: str) -> Cells:
    """Cells over the axes ``names``; of the other axes every value, or the one nearest to that in ``where``."""
    if "sample_axis" not in run:
        raise InputError(f"{caller}: no samples in these results (expected a sweep that keeps them: keep = [...], or --keep)")
    known = axis_names(run)
    axis = run.sample_axis.values
    picked = np.ones(len(axis), dtype=bool)
    for name, value in (where or {}).items():
        if name not in known:
            raise InputError(f"{caller}: no axis {name!r} in the sweep (expected one of {', '.join(known)})")
        distance = np.abs(axis[:, known.index(name)] - value)
        picked &= distance <= distance.min() * (1 + 1e-9) + 1e-12
    cell = np.zeros(int(picked.sum()), dtype=np.intp)
    centres, edges = [], []
    for name in names:
        values = axis[picked, known.index(name)]
        if str(run.axis_sampling.values[known.index(name)]) in ("linspace", "values"):
            middle, index = np.unique(values, return_inverse=True)
            border = _borders(middle)
        else:
            border = np.linspace(values.min(), values.max(), BINS + 1)
            index = np.clip(np.searchsorted(border, values, side="right") - 1, 0, BINS - 1)
            middle = (border[1:] + border[:-1]) / 2
        cell = cell * len(middle) + index
        centres.append(middle)
        edges.append(border)
    units = [str(run.axis_unit.values[known.index(name)]) for name in names]
    return Cells(names, units, centres, edges, cell, picked)


@dataclass(frozen=True)
class Grid:
    """What a map shows of each cell."""

    cells: Cells
    values: NDArray[np.float64]
    share: NDArray[np.float64]
    """Of feasible samples."""


def mapped_axes(run: xr.Dataset, quantity: str) -> list[str]:
    """Axes of the map that the sweep kept of a quantity; none if it kept none."""
    name = _map_variable(quantity)
    if name not in run:
        return []
    dims = [dim for dim in run[name].dims if dim != "design"]
    by_dim = {re.sub("[ /]", "_", name): name for name in axis_names(run)}
    return [by_dim[str(dim)] for dim in dims]


def mapped_cells(data: xr.Dataset, names: list[str], quantity: str) -> Grid:
    """The sweep's own map over the axes ``names``, of one design; the worst over its other axes."""
    dims = [re.sub("[ /]", "_", name) for name in names]
    values, share = (
        data[name].sortby(dims).transpose(*dims, ...) for name in (_map_variable(quantity), "map_feasible_fraction")
    )
    centres = [values[dim].values for dim in dims]
    known = axis_names(data)
    units = [str(data.axis_unit.values[known.index(name)]) for name in names]
    shape = tuple(len(middle) for middle in centres)
    worst = worst_of(quantity, values.values.reshape(*shape, -1), axis=-1)
    nothing = np.zeros(0, dtype=np.intp)
    cells = Cells(names, units, centres, [_borders(middle) for middle in centres], nothing, nothing.astype(bool))
    return Grid(cells, worst, share.values.reshape(*shape, -1).mean(axis=-1))


def _map_variable(quantity: str) -> str:
    return "map_feasible_fraction" if quantity == "feasible" else f"map_{quantity}"


def _borders(middle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half way between neighbours; the first and last cell are as wide as their neighbours' gap."""
    if len(middle) == 1:
        return np.array([middle[0] - 0.5, middle[0] + 0.5])
    between = (middle[1:] + middle[:-1]) / 2
    return np.concatenate([[2 * middle[0] - between[0]], between, [2 * middle[-1] - between[-1]]])


def describe_place(run: xr.Dataset, values: NDArray[np.float64]) -> str:
    """A sample in words: "x 250 mm, roll −20 deg; Fz −8115 N". Of axes that advance together only what is not 0."""
    if np.isnan(values).any():
        return "–"
    groups = run.axis_group.values
    together = {group for group in groups if (groups == group).sum() > 1}
    parts: dict[str, list[str]] = {}
    for k, name in enumerate(axis_names(run)):
        if (groups[k] in together and values[k] == 0.0) or run.axis_size.values[k] == 1:
            continue
        largest = max(abs(float(run.axis_low.values[k])), abs(float(run.axis_high.values[k])))
        unit = str(run.axis_unit.values[k])
        factor, word = readable(unit, largest) if unit != "SI" else (1.0, "")
        kind, short = _short(name)
        number = f"{values[k] * factor + 0.0:.4g}".replace("-", "−")
        parts.setdefault(kind, []).append(f"{short} {number} {word}".strip())
    if together and not any(groups[k] in together and values[k] != 0.0 for k in range(len(groups))):
        parts["rest"] = ["all else 0"]
    named = {"rate": "rates ", "acceleration": "accelerations "}
    return "; ".join(named.get(kind, "") + ", ".join(words) for kind, words in parts.items())


def _short(name: str) -> tuple[str, str]:
    """Kind and short name of an axis: place and "x" of "platform.x", load and "Fz" of "Fz on platform.tool"."""
    if " on " in name:
        return "load", name.split(" on ")[0]
    kind, of, what = name.partition(" of ")
    if of and kind in ("rate", "acceleration"):
        return kind, what.split(".")[-1]
    return "place", name.split(".")[-1] if name.count(".") == 1 and " " not in name else name
