"""Lines of a panel: names beside their ends, peaks marked, units that people read, and many lines as an envelope with the worst one named.

What is drawn stays in SI units, only the numbers along the axes are others: who adds something to a picture adds it in SI, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, MaxNLocator
from numpy.typing import NDArray

from ..errors import InputError
from .style import COLOURS, LINES, readable

__all__ = ["MOST_LINES", "abscissa", "colour", "draw_lines", "line", "scale_axis", "spread_names", "tick_text"]

MOST_LINES = 8
"""More lines than these cannot be told apart in a panel."""
LETTER_HEIGHT = 11.0
"""From one name to the next [points]."""


def colour(k: int) -> str:
    return COLOURS[k % len(COLOURS)]


def line(k: int) -> dict[str, Any]:
    """Colour and dashes of the k-th line: with more lines than colours the dashes tell them apart."""
    return {"color": colour(k), "linestyle": LINES[(k // len(COLOURS)) % len(LINES)], "linewidth": 1.4}


def abscissa(run: xr.Dataset, over: str | None = None) -> tuple[NDArray[np.float64], str, str]:
    """Values, name and unit of what the lines go over: the time, an angle, or the number of the sample.

    Raises
    ------
    InputError
        ``over`` is no coordinate of the run that is an angle.
    """
    if over is not None:
        angles = [str(name) for name, unit in zip(run.coordinate.values, run.coordinate_unit.values) if unit == "rad"]
        if over not in angles:
            raise InputError(f"over: coordinate {over!r} is no angle of the run (expected one of {', '.join(angles) or 'none'})")
        return run.q.sel(coordinate=over).values, f"angle of {over}", "rad"
    if "time" in run.coords:
        return run.time.values, "time", "s"
    return np.arange(run.sizes["sample"], dtype=float), "sample", ""


def scale_axis(axis: Axes, side: str, name: str, unit: str, largest: float, ticks: int = 6) -> tuple[float, str]:
    """Name an axis ("x", "y" or "z") and number it in the unit that suits its values; factor and unit."""
    factor, word = readable(unit, largest) if unit not in ("", "s") else (1.0, unit)
    one = getattr(axis, f"{side}axis")
    one.set_major_locator(_Locator(factor, ticks, integer=name == "sample"))
    one.set_major_formatter(FuncFormatter(lambda value, _: tick_text(value * factor, np.abs(one.get_view_interval()).max() * factor)))
    one.set_label_text(f"{name} [{word}]" if word else name, parse_math=False)
    return factor, word


def tick_text(value: float, largest: float) -> str:
    """The number of a tick; what is rounding beside the largest on its axis is zero."""
    places = 9 - int(np.floor(np.log10(largest))) if largest > 0 else 9
    digits = 6 if abs(value) < 1e5 else 9      # no exponents, which would hide what tells ticks apart
    return f"{round(value, places):.{digits}g}".replace("-", "−")


class _Locator(MaxNLocator):
    """Ticks that are round in another unit."""

    def __init__(self, factor: float, ticks: int, integer: bool = False) -> None:
        super().__init__(nbins=ticks, steps=[1, 2, 2.5, 3, 5, 10] if factor == 180 / np.pi else [1, 2, 2.5, 5, 10], integer=integer)
        self._factor = factor

    def tick_values(self, vmin: float, vmax: float) -> Any:
        return np.asarray(super().tick_values(vmin * self._factor, vmax * self._factor)) / self._factor


def draw_lines(
    axis: Axes, x: NDArray[np.float64], values: Mapping[str, NDArray[np.float64]], factor: float = 1.0, unit: str = "", peaks: bool = True,
    from_zero: bool = False,
) -> None:
    """The lines of a panel, whose limits are set by them; names and peaks at the right.

    Parameters
    ----------
    axis
        Not drawn in before, its unit chosen.
    x
        (N,) instants or angles.
    values
        (N,) by name, NaN where there is none.
    factor, unit
        In which peaks are told.
    peaks
        Mark the values of largest size.
    from_zero
        The panel begins at zero: magnitudes.
    """
    sizes = {name: float(np.nanmax(np.abs(y), initial=0.0)) for name, y in values.items()}
    worst = max(sizes, key=lambda name: sizes[name])
    shown = dict(values)
    labels: list[tuple[str, float, str]] = []
    if len(values) > MOST_LINES:
        stacked = np.stack([np.nan_to_num(y, nan=np.nan) for y in values.values()])
        there = np.isfinite(stacked).any(axis=0)
        low, high = (np.where(there, edge(np.where(np.isfinite(stacked), stacked, fill), axis=0), np.nan)
                     for edge, fill in ((np.min, np.inf), (np.max, -np.inf)))
        axis.fill_between(x, low, high, color="0.85", linewidth=0.0)
        shown = {worst: values[worst]}
        labels.append((f"all {len(values)}", float((low + high)[there][-1] / 2) if there.any() else 0.0, "0.45"))
    for k, (name, y) in enumerate(shown.items()):
        axis.plot(x, y, label=name, **line(k))
        good = np.flatnonzero(np.isfinite(y))
        label = name if len(values) <= MOST_LINES else f"{name}, the worst"
        if good.size and peaks:
            top = int(np.nanargmax(np.abs(y)))
            label += f"  peak {y[top] * factor:.4g} {unit}".rstrip().replace("-", "−")
            axis.plot(x[top], y[top], "o", color=colour(k), markersize=4.5, clip_on=False, zorder=5)
        labels.append((label, float(y[good[-1]]) if good.size else 0.0, colour(k)))
    axis.margins(x=0.0)
    axis.grid(True, color="0.9", linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)
    if from_zero:
        axis.set_ylim(0.0, 1.05 * sizes[worst] or None)     # what is all but constant lies below the edge, too
    _write_beside(axis, labels)


_BESIDE: WeakKeyDictionary[Axes, list[tuple[Text, float]]] = WeakKeyDictionary()
"""Names beside the lines of a panel, and where each would stand if it were alone."""


def _write_beside(axis: Axes, labels: list[tuple[str, float, str]]) -> None:
    """Names at the right edge, at the height where their lines end."""
    axis.set_ylim(*axis.get_ylim())
    _BESIDE[axis] = [(axis.text(1.015, 0.0, text, transform=axis.transAxes, color=tint, fontsize="small", va="center", ha="left", parse_math=False), at)
                     for text, at, tint in labels]
    spread_names(axis)


def spread_names(axis: Axes) -> None:
    """Move apart what would overlap of the names beside a panel's lines; anew where its figure has become another height."""
    names = _BESIDE.get(axis, [])
    if not names:
        return
    low, high = axis.get_ylim()
    rows = axis.get_gridspec().nrows if axis.get_subplotspec() else 1     # type: ignore[union-attr]
    height = axis.get_figure(root=True).get_size_inches()[1] * 72 / rows * 0.75     # type: ignore[union-attr]
    order = sorted(range(len(names)), key=lambda k: names[k][1])
    places = _apart(np.array([(names[k][1] - low) / (high - low) for k in order]), LETTER_HEIGHT / height)
    for k, place in zip(order, places):
        names[k][0].set_y(float(place))


def _apart(places: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Ascending places moved as little as need be until they are a step apart, within the panel: neighbours that touch move as one."""
    groups: list[list[float]] = []      # sum of wishes for the first of a group, and how many it holds
    for place in places:
        groups.append([place, 1])
        while len(groups) > 1 and groups[-2][0] / groups[-2][1] + step * groups[-2][1] > groups[-1][0] / groups[-1][1]:
            wishes, n = groups.pop()
            groups[-1][0] += wishes - n * step * groups[-1][1]
            groups[-1][1] += n
    moved = np.concatenate([wishes / n + step * np.arange(n) for wishes, n in groups])
    steps = step * np.arange(len(moved))
    moved = np.minimum(moved, 1.0 - steps[::-1])
    apart: NDArray[np.float64] = np.maximum(moved, steps)
    return apart
