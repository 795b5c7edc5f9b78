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

from ._assemblies import draw_assemblies
from ._drawing.animation import animate
from ._drawing.arguments import checked
from ._drawing.forces import borne
from ._drawing.lines import MOST_LINES, abscissa, colour, draw_lines, line, scale_axis
from ._drawing.mechanisms import mechanism
from ._drawing.style import BAD, as_written, put_heading
from ._drawing.sweep_plots import designs, force_map, histograms, screw_limit, sizing, workspace
from ._event_sides import EventSides
from ._listing import only
from .errors import InputError
from .scene import Scene

__all__ = [
    "animate",
    "assemblies",
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
__dir__ = only(__all__)

scene3d = mechanism


@checked
def assemblies(scene: Scene) -> tuple[Figure, np.ndarray]:
    """A sheet with every assembly in which a scene closes at its start, each small and with its number; the scene's own is 1.

    Parameters
    ----------
    scene
        The mechanism.

    Returns
    -------
    figure, axes
    """
    figure = draw_assemblies(scene)
    return figure, np.array(figure.axes)


@checked
def driving_forces(run: xr.Dataset, over: str | None = None) -> tuple[Figure, np.ndarray]:
    """Driving forces and torques over time, one panel per group of like actuators, peaks marked and named beside the lines.

    Of more than eight lines the range is drawn, and the one with the largest peak. Where something happens in a forward run lines jump: what is just
    before and just behind counts as a peak, too.

    Parameters
    ----------
    run
        Results with ``driving_force``.
    over
        Angle to draw over, a coordinate; default: the time.

    Returns
    -------
    figure, axes
        ``axes`` of shape (number of groups,).
    """
    _need(run, "driving_force")
    run = EventSides.of(run).in_time("driving_force")
    units = dict(zip(run.actuator.values, run.actuator_unit.values))
    panels = [
        (f"driving {'torque' if unit == 'N m' else 'force'}", unit,
         {name: run.driving_force.sel(actuator=name).values for name in names})
        for (_, unit), names in _groups(run.actuator.values, units).items()
    ]
    figure, axes = _panels(run, [[panel] for panel in panels], over)
    for axis in axes[:, 0]:
        axis.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    return figure, axes[:, 0]


@checked
def reactions(run: xr.Dataset, over: str | None = None) -> tuple[Figure, np.ndarray]:
    """Magnitudes of the joint reactions; left force, right moment where there is one. More than eight joints have a row per group of like ones.

    Of more than eight lines the range is drawn, and the one with the largest peak. Lines jump as those of `driving_forces` do.

    Parameters
    ----------
    run
        Results with ``reaction``.
    over
        Angle to draw over, a coordinate; default: the time.

    Returns
    -------
    figure, axes
        ``axes`` of shape (number of groups, 2), (number of groups, 1) if no joint bears a moment. What would be empty is not visible, and left to
        its neighbour.
    """
    _need(run, "reaction")
    run = EventSides.of(run).in_time("reaction")
    sizes = {letter: _magnitude(run, letter) for letter in "FM"}
    peaks = {letter: np.nan_to_num(sizes[letter].values).max(axis=0, initial=0.0) for letter in "FM"}
    bears = {
        letter: {str(name) for name, acts in zip(run.joint.values, acting) if acts}
        for letter, acting in zip("FM", borne(peaks["F"], peaks["M"]))
    }
    rows = []
    joints = list(map(str, run.joint.values))
    for names in [joints] if len(joints) <= MOST_LINES else _groups(joints, {}).values():
        row: list[Panel | None] = []
        for letter, quantity in (("F", "force"), ("M", "moment")):
            acting = [name for name in names if name in bears[letter]] or (names if letter == "F" else [])
            lines = {name: sizes[letter].sel(joint=name).values for name in acting}
            row.append((quantity, "N" if letter == "F" else "N m", lines) if lines else None)
        rows.append(row if bears["M"] else row[:1])
    return _panels(run, rows, over, from_zero=True)


Panel = tuple[str, str, dict[str, np.ndarray]]
"""What it shows, its SI unit, lines by name."""


def _panels(run: xr.Dataset, rows: list[list[Panel | None]], over: str | None = None, from_zero: bool = False) -> tuple[Figure, np.ndarray]:
    """Panels over one abscissa."""
    columns = max(len(row) for row in rows)
    size = (9.0 if columns == 1 else 13.0, 1.0 + 2.3 * len(rows) + (0.5 if len(rows) == 1 else 0.0))
    figure, axes = pyplot.subplots(len(rows), columns, squeeze=False, sharex=True, figsize=size, layout="constrained")
    x, x_name, x_unit = abscissa(run, over)
    for drawn, row in zip(axes, rows):
        for axis, panel in zip(drawn, row):
            if panel is None:
                axis.set_visible(False)
                drawn[0].set_subplotspec(drawn[0].get_gridspec()[drawn[0].get_subplotspec().rowspan.start, :])
                continue
            quantity, unit, values = panel
            draw_lines(axis, x, values, *scale_axis(axis, "y", quantity, unit, _largest(*values.values()), ticks=5), from_zero=from_zero)
    for column in axes.T:
        shown = [axis for axis in column if axis.get_visible()]
        for axis, below in zip(shown, [*shown[1:], None]):
            if below is None or _width(axis) != _width(below):  # numbers below a wider panel are at other places
                scale_axis(axis, "x", x_name, x_unit, _largest(x), ticks=8)
                axis.tick_params(labelbottom=True)
    if run.attrs.get("title"):
        put_heading(figure, run.attrs["title"])
    return figure, axes


def _width(axis: Axes) -> int:
    """Columns that a panel takes."""
    place = axis.get_subplotspec()
    return len(place.colspan) if place is not None else 1


def _magnitude(run: xr.Dataset, letter: str) -> xr.DataArray:
    """Of the reactions' forces ("F") or moments ("M")."""
    components = [name for name in run.component.values if str(name).startswith(letter)]
    size: xr.DataArray = np.sqrt((run.reaction.sel(component=components) ** 2).sum("component", skipna=False))
    return size


@checked
def hodograph(run: xr.Dataset, joints: Iterable[str] | None = None, components: str = "xy") -> tuple[Figure, np.ndarray]:
    """Hodographs of the joint forces: the curve that the tip of each joint's force runs through, one panel a joint.

    Dots divide the run into twelve parts; the hollow one is its beginning, the red one the largest force, which stands above.

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
    run = EventSides.of(run).in_time("reaction")
    wanted = [f"F{letter}" for letter in components]
    known = [name for name in map(str, run.component.values) if name.startswith("F")]
    if len(wanted) != 2 or not set(wanted) <= set(known):
        raise InputError(f"hodograph: components {components!r} (expected two of {', '.join(name[1:] for name in known)})")
    names = _chosen_joints(run, joints, "hodograph")
    columns = 2 if len(names) == 4 else min(3, len(names))
    rows = -(-len(names) // columns)
    figure, axes = pyplot.subplots(
        rows, columns, squeeze=False, figsize=(1.0 + 3.0 * columns, 0.8 + 2.9 * rows), layout="constrained"
    )
    figure.set_layout_engine("constrained", h_pad=0.09)     # names of axes lie apart from titles below them
    for k, (axis, name) in enumerate(zip(axes.flat, names)):
        force = run.reaction.sel(joint=name, component=wanted).values
        axis.axhline(0.0, color="0.75", linewidth=0.8, zorder=0)
        axis.axvline(0.0, color="0.75", linewidth=0.8, zorder=0)
        axis.plot(*force.T, color=colour(k), linewidth=1.4)
        marks = np.round(np.arange(12) / 12 * (len(force) - 1)).astype(int)
        axis.plot(*force[marks].T, "o", color=colour(k), markersize=3.5)
        axis.plot(*force[0], "o", markerfacecolor="white", markeredgecolor=colour(k), markersize=6.0)
        sizes = np.linalg.norm(force, axis=1)
        largest = float(np.nanmax(sizes, initial=0.0))
        factor, unit = scale_axis(axis, "x", wanted[0], "N", largest, ticks=4)
        scale_axis(axis, "y", wanted[1], "N", largest, ticks=5)
        if largest > 0:
            top = force[int(np.nanargmax(sizes))]
            axis.plot(*top, "D", color=BAD, markersize=5.0, zorder=5)
            axis.annotate("", top, (0.0, 0.0), arrowprops={"arrowstyle": "-", "color": BAD, "linewidth": 0.7, "linestyle": ":"})
        axis.set_title(f"{name}: {largest * factor:.4g} {unit}{'' if len(known) == 2 else f' in {components}'}", fontsize="medium", parse_math=False)
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
    magnitude = _magnitude(run, "F")
    for k, name in enumerate(names):
        axis.plot(run.q.sel(coordinate=crank), magnitude.sel(joint=name), label=name, **line(k))
    axis.set_ylim(bottom=0.0)
    _, unit = scale_axis(axis, "y", "", "N", float(np.nanmax(magnitude.sel(joint=names), initial=0.0)), ticks=4)
    axis.set_ylabel("")
    axis.set_rlabel_position(22.5)  # type: ignore[attr-defined]  # of polar axes
    axis.tick_params(axis="y", labelsize="small")
    axis.grid(True, color="0.88", linewidth=0.6)
    as_written(axis.legend(loc="upper left", bbox_to_anchor=(1.08, 1.0), frameon=False, fontsize="small", title=f"joint force [{unit}]"))
    if run.attrs.get("title"):
        put_heading(figure, f"{run.attrs['title']}: forces over the angle of {crank}", fontsize="medium")
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
def motion(run: xr.Dataset, stacked: bool = False) -> tuple[Figure, np.ndarray]:
    """Coordinates and their rates: a row per unit; left position, right rate.

    Parameters
    ----------
    run
        Results along a motion, or of a forward run.
    stacked
        A column per unit; above position, below rate.

    Returns
    -------
    figure, axes
        ``axes`` of shape (number of units, 2), (2, number of units) if stacked.
    """
    _need(run, "q")
    units: dict[str, list[str]] = {}
    for name, unit in zip(map(str, run.coordinate.values), map(str, run.coordinate_unit.values)):
        units.setdefault(unit, []).append(name)
    rows: list[list[Panel | None]] = [
        [(what, unit + per, {name: values.sel(coordinate=name).values for name in names})
         for what, per, values in (("position", "", run.q), ("rate", "/s", run.qd))]
        for unit, names in units.items()
    ]
    return _panels(run, [list(row) for row in zip(*rows)] if stacked else rows)


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
    parts = {"kinetic_energy": "kinetic", "potential_energy": "potential", "work": "work of the drives"}
    for name in parts:
        _need(run, name, "a forward run with its energies")
    figure, axes = pyplot.subplots(2, sharex=True, figsize=(9.0, 5.5), layout="constrained", height_ratios=(2, 1))
    x, x_name, x_unit = abscissa(run)
    lines = {label: run[name].values for name, label in parts.items()}
    draw_lines(axes[0], x, lines, *scale_axis(axes[0], "y", "energy", "J", _largest(*lines.values()), ticks=5), peaks=False)
    balance = (run.kinetic_energy + run.potential_energy - run.work).values
    change = balance - balance[0]
    axes[1].plot(x, change, **line(3))
    scale_axis(axes[1], "y", "kinetic + potential\n- work, change", "J", _largest(change), ticks=4)
    scale_axis(axes[1], "x", x_name, x_unit, _largest(x), ticks=8)
    _finish(figure, axes, run)
    return figure, axes


def _largest(*values: np.ndarray) -> float:
    return max(float(np.nanmax(np.abs(y), initial=0.0)) for y in values)


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
    _need(run, "step", "a forward run")
    figure, axes = pyplot.subplots(1, squeeze=False, figsize=(9.0, 3.2), layout="constrained")
    x, x_label = _clock(run)
    step = run.step.values[1:]
    axes[0, 0].semilogy(x[1:], step, drawstyle="steps-pre", **line(0))
    _whole_decades(axes[0, 0], step)
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
    _need(result, "seconds", "that of Scene.study()")
    kinds = [kind for kind in ("inverse", "forward") if (result.analysis == kind).any()]
    figure, axes = pyplot.subplots(1, len(kinds), squeeze=False, figsize=(1.0 + 4.5 * len(kinds), 4.2), layout="constrained")
    for axis, kind in zip(axes[0], kinds):
        rows = result.isel(row=np.flatnonzero(result.analysis == kind))
        scale, unit = (1e6, "µs a sample") if kind == "inverse" else (1e3, "ms for the run")
        floor = np.finfo(float).eps / 4    # so that an error of zero has a place
        for k, method in enumerate(dict.fromkeys(rows.method.values)):
            chosen = rows.isel(row=np.flatnonzero(rows.method == method))
            axis.plot(scale * chosen.seconds, np.maximum(chosen.error, floor), "o-", label=str(method), color=colour(k),
                      markersize=5, linewidth=1.3)
        axis.set(xscale="log", yscale="log", xlabel=f"time [{unit}]", ylabel="relative error", title=f"{kind} dynamics")
        _whole_decades(axis, np.maximum(rows.error.values, floor))
        axis.grid(True, which="major", color="0.9", linewidth=0.6)
        axis.spines[["top", "right"]].set_visible(False)
        axis.legend(frameon=False, fontsize="small")
    return figure, axes[0]


def _whole_decades(axis: Axes, values: np.ndarray) -> None:
    """Of a logarithmic axis: what differs by rounding alone is one line."""
    known = values[np.isfinite(values) & (values > 0)]
    if known.size:
        low, high = np.floor(np.log10(known.min())), np.ceil(np.log10(known.max()))
        axis.set_ylim(10.0 ** (low - (low == high)), 10.0 ** (high + (low == high)))


def _need(run: Any, name: str, expected: str = "a run that wants it") -> None:
    if name not in run:
        raise InputError(f"plot: the results have no {name} (expected {expected})")


def _groups(names: Any, units: dict[str, str]) -> dict[tuple[str, str], list[str]]:
    """Names that differ by numbers only, and have one unit, belong together: leg1.P, leg2.P, ...; those that are alone share a panel."""
    groups: dict[tuple[str, str], list[str]] = {}
    for name in map(str, names):
        groups.setdefault((re.sub(r"\d+", "", name), units.get(name, "")), []).append(name)
    joined: dict[tuple[str, str], list[str]] = {}
    for (kind, unit), members in groups.items():
        joined.setdefault((kind if len(members) > 1 else "", unit), []).extend(members)
    return joined


def _clock(run: xr.Dataset) -> tuple[np.ndarray, str]:
    x, name, unit = abscissa(run)
    return x, f"{name} [{unit}]" if unit else name


def _finish(figure: Figure, axes: np.ndarray, run: xr.Dataset) -> None:
    axis: Axes
    for axis in axes.flat:
        axis.grid(True, color="0.9", linewidth=0.6)
        axis.spines[["top", "right"]].set_visible(False)
        axis.margins(x=0.0)
    if run.attrs.get("title"):
        put_heading(figure, run.attrs["title"])
