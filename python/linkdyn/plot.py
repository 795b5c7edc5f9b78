"""Pictures of results and scenes. Every function returns ``(figure, axes)`` and shows nothing by itself."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ._drawing import scene3d
from ._style import COLOURS, LINES, plain_units
from .errors import InputError

__all__ = ["driving_forces", "reactions", "scene3d"]


def driving_forces(run: xr.Dataset) -> tuple[Figure, np.ndarray]:
    """Driving forces and torques over time, one panel per group of like actuators, peaks marked.

    Parameters
    ----------
    run
        Results with ``driving_force``.

    Returns
    -------
    figure, axes
        ``axes`` of shape (number of groups,).
    """
    _need(run, "driving_force")
    units = dict(zip(run.actuator.values, run.actuator_unit.values))
    groups = _groups(run.actuator.values, units)
    figure, axes = pyplot.subplots(
        len(groups), squeeze=False, sharex=True, figsize=(9.0, 1.2 + 3.0 * len(groups)), layout="constrained"
    )
    x, x_label = _abscissa(run)
    for axis, ((_, unit), names) in zip(axes[:, 0], groups.items()):
        for k, name in enumerate(names):
            force = run.driving_force.sel(actuator=name).values
            label = str(name)
            if np.isfinite(force).any():
                peak = int(np.nanargmax(np.abs(force)))
                label += f"  (peak {force[peak]:.4g} {plain_units(unit)} at {x[peak]:.4g})"
                axis.plot(x[peak], force[peak], "o", color=_colour(k), markersize=5)
            axis.plot(x, force, label=label, **_line(k))
        axis.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
        axis.set_ylabel(f"driving {'torque' if unit == 'N m' else 'force'} [{plain_units(unit)}]")
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")
    axes[-1, 0].set_xlabel(x_label)
    _finish(figure, axes, run)
    return figure, axes[:, 0]


def reactions(run: xr.Dataset) -> tuple[Figure, np.ndarray]:
    """Magnitudes of the joint reactions: a row per group of like joints; left force, right moment.

    Parameters
    ----------
    run
        Results with ``reaction``.

    Returns
    -------
    figure, axes
        ``axes`` of shape (number of groups, 2).
    """
    _need(run, "reaction")
    groups = _groups(run.joint.values, {})
    figure, axes = pyplot.subplots(
        len(groups), 2, squeeze=False, sharex=True, figsize=(10.0, 1.2 + 2.2 * len(groups)), layout="constrained"
    )
    x, x_label = _abscissa(run)
    for row, names in zip(axes, groups.values()):
        for axis, letter, quantity in ((row[0], "F", "force"), (row[1], "M", "moment")):
            components = [name for name in run.component.values if str(name).startswith(letter)]
            magnitude = np.sqrt((run.reaction.sel(component=components) ** 2).sum("component", skipna=False))
            unit = str(run.component_unit.sel(component=components[0]).values)
            for k, name in enumerate(names):
                axis.plot(x, magnitude.sel(joint=name), label=str(name), **_line(k))
            axis.set_ylabel(f"{quantity} [{plain_units(unit)}]")
            axis.set_ylim(bottom=0.0)
            if not magnitude.sel(joint=names).any():
                axis.text(0.5, 0.5, "none", transform=axis.transAxes, ha="center", va="center", color="0.4")
                axis.set_yticks([0.0])
        row[1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")
    for axis in axes[-1]:
        axis.set_xlabel(x_label)
    _finish(figure, axes, run)
    return figure, axes


def _need(run: Any, name: str) -> None:
    if name not in run:
        raise InputError(f"plot: the results have no {name} (expected a run that wants it)")


def _groups(names: Any, units: dict[str, str]) -> dict[tuple[str, str], list[str]]:
    """Names that differ by numbers only, and have one unit, belong together: leg1.P, leg2.P, ..."""
    groups: dict[tuple[str, str], list[str]] = {}
    for name in map(str, names):
        groups.setdefault((re.sub(r"\d+", "", name), units.get(name, "")), []).append(name)
    return groups


def _abscissa(run: xr.Dataset) -> tuple[np.ndarray, str]:
    if "time" in run.coords:
        return run.time.values, "time [s]"
    return np.arange(run.sizes["sample"]), "sample"


def _colour(k: int) -> str:
    return COLOURS[k % len(COLOURS)]


def _line(k: int) -> dict[str, Any]:
    """Colour and dashes of the k-th line: with more lines than colours the dashes tell them apart."""
    return {"color": _colour(k), "linestyle": LINES[(k // len(COLOURS)) % len(LINES)], "linewidth": 1.3}


def _finish(figure: Figure, axes: np.ndarray, run: xr.Dataset) -> None:
    axis: Axes
    for axis in axes.flat:
        axis.grid(True, color="0.9", linewidth=0.6)
        axis.spines[["top", "right"]].set_visible(False)
        axis.margins(x=0.0)
    if run.attrs.get("title"):
        figure.suptitle(run.attrs["title"])
