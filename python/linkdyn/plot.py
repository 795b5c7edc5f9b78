"""Pictures of results and scenes. Every function but `animate` and `screw_limit` returns ``(figure, axes)``; none shows anything by itself."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ._animation import animate
from ._drawing import mechanism
from ._drawing_arguments import checked
from ._style import COLOURS, LINES, plain_units
from ._sweep_plots import designs, force_map, histograms, screw_limit, sizing, workspace
from .errors import InputError

__all__ = [
    "animate",
    "designs",
    "driving_forces",
    "energies",
    "force_map",
    "histograms",
    "hodograph",
    "mechanism",
    "motion",
    "polar",
    "reactions",
    "scene3d",
    "screw_limit",
    "sizing",
    "steps",
    "study",
    "workspace",
]

scene3d = mechanism


@checked
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


@checked
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


@checked
def hodograph(run: xr.Dataset, joints: Iterable[str] | None = None, components: str = "xy") -> tuple[Figure, np.ndarray]:
    """Hodographs of the joint forces: the curve that the tip of each joint's force runs through, one panel a joint.

    Dots divide the run into twelve parts; the hollow one is its beginning.

    Parameters
    ----------
    run
        Results with ``reaction``.
    joints
        Names; default: all that transmit a force.
    components
        Two of "x", "y", "z": the axes of the panels.

    Returns
    -------
    figure, axes
        ``axes`` of shape (number of joints,).

    Raises
    ------
    InputError
        Reactions are not in the run, an unknown joint or component.
    """
    _need(run, "reaction")
    wanted = [f"F{letter}" for letter in components]
    known = [name for name in map(str, run.component.values) if name.startswith("F")]
    if len(wanted) != 2 or not set(wanted) <= set(known):
        raise InputError(f"hodograph: components {components!r} (expected two of {', '.join(name[1:] for name in known)})")
    names = _chosen_joints(run, joints, "hodograph")
    columns = min(3, len(names))
    rows = -(-len(names) // columns)
    figure, axes = pyplot.subplots(
        rows, columns, squeeze=False, figsize=(1.0 + 3.0 * columns, 0.8 + 2.9 * rows), layout="constrained"
    )
    for k, (axis, name) in enumerate(zip(axes.flat, names)):
        force = run.reaction.sel(joint=name, component=wanted).values
        axis.axhline(0.0, color="0.75", linewidth=0.8, zorder=0)
        axis.axvline(0.0, color="0.75", linewidth=0.8, zorder=0)
        axis.plot(*force.T, color=_colour(k), linewidth=1.4)
        marks = np.round(np.arange(12) / 12 * (len(force) - 1)).astype(int)
        axis.plot(*force[marks].T, "o", color=_colour(k), markersize=3.5)
        axis.plot(*force[0], "o", markerfacecolor="white", markeredgecolor=_colour(k), markersize=6.0)
        axis.set_title(name, fontsize="medium")
        axis.set_xlabel(f"{wanted[0]} [N]")
        axis.set_ylabel(f"{wanted[1]} [N]")
        axis.set_aspect("equal", adjustable="datalim")
    for axis in axes.flat[len(names) :]:
        axis.set_visible(False)
    _finish(figure, axes, run)
    for axis in axes.flat:
        axis.margins(0.08)
    return figure, axes.flat[: len(names)]


@checked
def polar(run: xr.Dataset, joints: Iterable[str] | None = None, coordinate: str | None = None) -> tuple[Figure, Axes]:
    """Magnitude of the joint forces over the crank's angle, as a polar diagram.

    Parameters
    ----------
    run
        Results with ``reaction``.
    joints
        Names; default: all that transmit a force.
    coordinate
        The crank: a coordinate that is an angle; default: the first one.

    Returns
    -------
    figure, axes

    Raises
    ------
    InputError
        Reactions are not in the run, an unknown joint, no such angle.
    """
    _need(run, "reaction")
    angles = [str(name) for name, unit in zip(run.coordinate.values, run.coordinate_unit.values) if unit == "rad"]
    crank = coordinate if coordinate is not None else next(iter(angles), "")
    if crank not in angles:
        raise InputError(f"polar: coordinate {crank!r} is no angle of the run (expected one of {', '.join(angles) or 'none'})")
    names = _chosen_joints(run, joints, "polar")
    figure, axis = pyplot.subplots(figsize=(6.6, 5.4), layout="constrained", subplot_kw={"projection": "polar"})
    forces = [name for name in run.component.values if str(name).startswith("F")]
    magnitude = np.sqrt((run.reaction.sel(component=forces) ** 2).sum("component", skipna=False))
    for k, name in enumerate(names):
        axis.plot(run.q.sel(coordinate=crank), magnitude.sel(joint=name), label=name, **_line(k))
    axis.set_ylim(bottom=0.0)
    axis.set_rlabel_position(22.5)  # type: ignore[attr-defined]  # of polar axes
    axis.tick_params(axis="y", labelsize="small")
    axis.grid(True, color="0.88", linewidth=0.6)
    axis.legend(loc="upper left", bbox_to_anchor=(1.08, 1.0), frameon=False, fontsize="small", title="joint force [N]")
    if run.attrs.get("title"):
        figure.suptitle(f"{run.attrs['title']}: forces over the angle of {crank}", fontsize="medium")
    return figure, axis


def _chosen_joints(run: xr.Dataset, joints: Iterable[str] | None, caller: str) -> list[str]:
    """Names of joints as asked for, or all in which a force acts."""
    known = list(map(str, run.joint.values))
    if joints is None:
        forces = run.reaction.sel(component=[name for name in run.component.values if str(name).startswith("F")])
        acting = np.nan_to_num(np.abs(forces.values)).max(axis=(0, 2)) > 0.0
        return [name for name, acts in zip(known, acting) if acts] or known
    chosen = [joints] if isinstance(joints, str) else list(joints)
    if not chosen:
        raise InputError(f"{caller}: joints: names none (expected one at least)")
    for name in chosen:
        if name not in known:
            raise InputError(f"{caller}: no joint {name!r} in the run (expected one of {', '.join(known)})")
    return chosen


@checked
def motion(run: xr.Dataset) -> tuple[Figure, np.ndarray]:
    """Coordinates and their rates: a row per unit; left position, right rate.

    Parameters
    ----------
    run
        Results along a motion, or of a forward run.

    Returns
    -------
    figure, axes
        ``axes`` of shape (number of units, 2).
    """
    _need(run, "q")
    units: dict[str, list[str]] = {}
    for name, unit in zip(map(str, run.coordinate.values), map(str, run.coordinate_unit.values)):
        units.setdefault(unit, []).append(name)
    figure, axes = pyplot.subplots(
        len(units), 2, squeeze=False, sharex=True, figsize=(10.0, 1.2 + 2.6 * len(units)), layout="constrained"
    )
    x, x_label = _abscissa(run)
    for row, (unit, names) in zip(axes, units.items()):
        for axis, values, what in ((row[0], run.q, unit), (row[1], run.qd, f"{unit}/s")):
            for k, name in enumerate(names):
                axis.plot(x, values.sel(coordinate=name), label=name, **_line(k))
            axis.set_ylabel(f"{'position' if axis is row[0] else 'rate'} [{what}]")
        row[1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")
    for axis in axes[-1]:
        axis.set_xlabel(x_label)
    _finish(figure, axes, run)
    return figure, axes


@checked
def energies(run: xr.Dataset) -> tuple[Figure, np.ndarray]:
    """Kinetic and potential energy and the work of the drives; below, what the balance of the three has lost or gained.

    Without dampers and loads the balance is constant: what it shows then is the error of the integration.

    Parameters
    ----------
    run
        Results of a forward run with its energies (``want="power"`` brings them).

    Returns
    -------
    figure, axes
        ``axes`` of shape (2,).
    """
    for name in ("kinetic_energy", "potential_energy", "work"):
        _need(run, name)
    figure, axes = pyplot.subplots(2, sharex=True, figsize=(9.0, 5.5), layout="constrained", height_ratios=(2, 1))
    x, x_label = _abscissa(run)
    for k, (name, label) in enumerate((("kinetic_energy", "kinetic"), ("potential_energy", "potential"), ("work", "work of the drives"))):
        axes[0].plot(x, run[name], label=label, **_line(k))
    balance = run.kinetic_energy + run.potential_energy - run.work
    axes[1].plot(x, balance - balance[0], **_line(3))
    axes[0].set_ylabel("energy [J]")
    axes[1].set_ylabel("kinetic + potential\n- work, change [J]")
    axes[0].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")
    axes[1].set_xlabel(x_label)
    _finish(figure, axes, run)
    return figure, axes


@checked
def steps(run: xr.Dataset) -> tuple[Figure, np.ndarray]:
    """Step of the integrator that led to each output instant.

    Parameters
    ----------
    run
        Results of a forward run.

    Returns
    -------
    figure, axes
        ``axes`` of shape (1,).
    """
    _need(run, "step")
    figure, axes = pyplot.subplots(1, squeeze=False, figsize=(9.0, 3.2), layout="constrained")
    x, x_label = _abscissa(run)
    step = run.step.values[1:]
    axes[0, 0].semilogy(x[1:], step, drawstyle="steps-pre", **_line(0))
    known = step[np.isfinite(step) & (step > 0)]
    if known.size:  # whole decades: equal steps, which differ by rounding, are one line
        low, high = np.floor(np.log10(known.min())), np.ceil(np.log10(known.max()))
        axes[0, 0].set_ylim(10.0 ** (low - (low == high)), 10.0 ** (high + (low == high)))
    axes[0, 0].set(xlabel=x_label, ylabel=f"step of {run.attrs.get('method', 'the integrator')} [s]")
    _finish(figure, axes, run)
    return figure, axes[:, 0]


@checked
def study(result: xr.Dataset) -> tuple[Figure, np.ndarray]:
    """Time against error: solvers as points, integrators as lines down their tolerances; lower left is best.

    Parameters
    ----------
    result
        Of ``Scene.study``.

    Returns
    -------
    figure, axes
        ``axes`` of shape (1 or 2,): inverse and forward dynamics, as far as there.
    """
    _need(result, "seconds")
    kinds = [kind for kind in ("inverse", "forward") if (result.analysis == kind).any()]
    figure, axes = pyplot.subplots(1, len(kinds), squeeze=False, figsize=(1.0 + 4.5 * len(kinds), 4.2), layout="constrained")
    for axis, kind in zip(axes[0], kinds):
        rows = result.isel(row=np.flatnonzero(result.analysis == kind))
        scale, unit = (1e6, "µs a sample") if kind == "inverse" else (1e3, "ms for the run")
        for k, method in enumerate(dict.fromkeys(rows.method.values)):
            chosen = rows.isel(row=np.flatnonzero(rows.method == method))
            floor = np.finfo(float).eps / 4    # so that an error of zero has a place
            axis.plot(scale * chosen.seconds, np.maximum(chosen.error, floor), "o-", label=str(method), color=_colour(k),
                      markersize=5, linewidth=1.3)
        axis.set(xscale="log", yscale="log", xlabel=f"time [{unit}]", ylabel="relative error", title=f"{kind} dynamics")
        axis.grid(True, which="major", color="0.9", linewidth=0.6)
        axis.spines[["top", "right"]].set_visible(False)
        axis.legend(frameon=False, fontsize="small")
    return figure, axes[0]


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
