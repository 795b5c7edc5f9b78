"""A picture of what counterweights do: the force on the frame before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib import pyplot
from matplotlib.figure import Figure

from .lines import draw_lines, scale_axis
from .style import COLOURS, put_heading, readable

if TYPE_CHECKING:
    from .._cycle.balance import Balance

__all__ = ["balance_plot"]


ROUNDING = 1e-12
"""A force below this part of the largest is none."""


def balance_plot(found: Balance) -> Figure:
    """Left the hodographs, in the plane in which the force is largest; right its size over time."""
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11.0, 4.2), layout="constrained", width_ratios=(1, 1.5))
    planes = [(0, 1)] if found.scene.planar else [(0, 1), (0, 2), (1, 2)]
    plane = max(planes, key=lambda pair: float((found.before[:, pair] ** 2).sum()))
    sizes = {"before": np.linalg.norm(found.before, axis=1), "after": np.linalg.norm(found.after, axis=1)}
    largest = float(max(size.max() for size in sizes.values()))
    sizes = {name: np.where(size > ROUNDING * largest, size, 0.0) for name, size in sizes.items()}
    factor, unit = readable("N", largest)
    left.axhline(0.0, color="0.75", linewidth=0.8, zorder=0)
    left.axvline(0.0, color="0.75", linewidth=0.8, zorder=0)
    for k, force in enumerate((found.before, found.after)):
        left.plot(*force[:, plane].T, color=COLOURS[k], linewidth=1.5)
    for side, place in zip(("x", "y"), plane):
        scale_axis(left, side, f"F{'xyz'[place]} on the frame", "N", largest, ticks=5)
    left.set_aspect("equal", adjustable="datalim")
    left.margins(0.08)
    left.grid(True, color="0.9", linewidth=0.6)
    left.spines[["top", "right"]].set_visible(False)
    scale_axis(right, "y", "force on the frame", "N", largest, ticks=5)
    scale_axis(right, "x", "time", "s", float(found.time[-1]))
    draw_lines(right, found.time, sizes, factor, unit, from_zero=True)
    words = ", ".join(f"{name} {row.moment:.4g} kg·m" + (f" at {np.degrees(row.angle):.4g}°" if found.scene.planar else "")
                      for name, row in found.counterweights.iterrows())
    put_heading(figure, f"{found.scene.title}\ncounterweights: {words}".strip(), fontsize="medium")
    return figure
