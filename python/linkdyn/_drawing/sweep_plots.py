"""Pictures of sweeps: maps of a workspace, force-speed clouds against what a motor can do, histograms, designs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import pyplot
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from .._cycle.averages import rms, shares
from .arguments import checked
from .style import BAD, COLOURS, DIVERGING, SEQUENTIAL, put_heading, readable
from .sweep_data import (
    LEAST,
    Cells,
    Grid,
    axis_names,
    cells_of,
    chosen_axes,
    entries_of,
    mapped_axes,
    mapped_cells,
    need_sweep,
    one_design,
    unit_of,
    values_of,
    within_constraints,
    worst_of,
)
from ..errors import InputError

__all__ = ["designs", "force_map", "histograms", "screw_limit", "sizing", "workspace"]

MOST_SLICES = 6
EMPTY = "0.88"
"""Grey of cells without a feasible sample."""
TITLES = {
    "driving_force": "driving force",
    "driving_position": "stroke",
    "driving_speed": "driving speed",
    "driving_power": "driving power",
    "reaction": "reaction",
    "reaction_force": "joint force",
    "reaction_moment": "joint moment",
    "joint_variable": "joint variable",
    "joint_rate": "joint rate",
    "force_amplification": "force amplification",
    "moment_amplification": "moment amplification",
    "condition": "condition number",
    "determinant": "determinant",
    "swing": "joint swing",
    "clearance": "clearance",
}
Limit = Sequence[Sequence[float]]


@checked
def workspace(
    run: xr.Dataset,
    quantity: str = "driving_force",
    *,
    axes: Iterable[str] | None = None,
    at: str | None = None,
    where: Mapping[str, float] | None = None,
    kind: str = "slices",
    design: int | None = None,
) -> tuple[Figure, np.ndarray]:
    """Map of a workspace: in every cell the worst over all that is not shown (orientations, load cases, actuators).

    Parameters
    ----------
    run
        Results of a sweep with a ``map`` over the axes, or that keeps ``quantity`` of every sample.
    quantity
        A quantity of the map, or a kept one; "feasible": the share of feasible samples; "outcome": the most frequent reason
        against (of samples).
    axes
        Names of two or three axes; default: those of the map, or the coordinates that are lengths.
    at
        One entry of the quantity ("leg1.P"); default: the worst of all.
    where
        Axis to value [SI]: samples at the nearest value alone, instead of all.
    kind
        "slices": a panel for each value of the third axis (six at most, evenly chosen); "3d": cells in space, cut open.
    design
        Number of the design in a sweep of several with a map.

    Returns
    -------
    figure, axes
        ``axes`` of shape (panels,).

    Raises
    ------
    InputError
        The quantity was not kept, an unknown axis, entry or kind.
    """
    need_sweep(run, "workspace")
    if kind not in ("slices", "3d"):
        raise InputError(f"workspace: kind {kind!r} (expected slices or 3d)")
    mapped = mapped_axes(run, quantity) if at is None and not where else []
    numbers = (3,) if kind == "3d" else (2, 3)
    if axes is None and len(mapped) in numbers:
        names = mapped
    else:
        names = chosen_axes(run, axes, numbers, "workspace")
    if set(names) <= set(mapped):
        grid = mapped_cells(one_design(run, design, "workspace"), names, quantity)
    else:
        grid = _sampled(run, names, quantity, at, where)
    shown = _colours(run, quantity, at, grid)
    cells = grid.cells
    if kind == "3d":
        figure, panels = _space(cells, shown)
    else:
        figure, panels = _slices(cells, shown)
    hidden = [n for n in axis_names(run) if n not in names and n not in (where or {})]
    swept = [n for n, size in zip(axis_names(run), run.axis_size.values) if size > 1 and n in hidden]
    put_heading(figure, _heading(run, shown.title, _over(swept) if quantity not in ("feasible", "outcome") else ""))
    return figure, panels


class _Shown:
    """Values of cells and how they are to be coloured."""

    def __init__(self, values: NDArray[np.float64], share: NDArray[np.float64], title: str, label: str) -> None:
        self.values, self.share, self.title, self.label = values, share, title, label
        self.map: Any = pyplot.get_cmap(SEQUENTIAL)
        finite = values[np.isfinite(values)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
        self.norm = Normalize(low, high if high > low else low + 1.0)
        self.reasons: list[str] = []


def _sampled(run: xr.Dataset, names: list[str], quantity: str, at: str | None, where: Mapping[str, float] | None) -> Grid:
    """Samples put into cells."""
    cells = cells_of(run, names, where, "workspace")
    outcome = run.sample_outcome.values
    total = cells.count(np.ones(len(outcome), dtype=bool))
    with np.errstate(invalid="ignore"):
        share = np.where(total > 0, cells.count(outcome == 0) / total, np.nan)
    if quantity == "feasible":
        return Grid(cells, share, share)
    if quantity == "outcome":
        return Grid(cells, _reasons(run, cells), share)
    values = worst_of(quantity, values_of(run, quantity, at, "workspace"), axis=1)
    values = np.where(within_constraints(run), values, np.nan)
    return Grid(cells, cells.reduce(values, quantity in LEAST), share)


def _reasons(run: xr.Dataset, cells: Cells) -> NDArray[np.float64]:
    """Number of the most frequent outcome that is against a pose in each cell; 0 where there is none."""
    outcome = run.sample_outcome.values
    counts = np.stack([cells.count(outcome == k) for k in range(run.sizes["outcome"])])
    worst = np.where(counts[1:].sum(axis=0) > 0, 1.0 + counts[1:].argmax(axis=0), 0.0)
    return np.where(counts.sum(axis=0) > 0, worst, np.nan)


def _colours(run: xr.Dataset, quantity: str, at: str | None, grid: Grid) -> _Shown:
    if quantity == "feasible":
        shown = _Shown(100.0 * grid.share, grid.share, "feasible share of the samples", "feasible [%]")
        shown.norm = Normalize(0.0, 100.0)
        return shown
    if quantity == "outcome":
        seen = [int(k) for k in np.unique(grid.values[np.isfinite(grid.values)]) if k > 0]
        places = np.full(grid.values.shape, np.nan)
        for place, k in enumerate([0, *seen]):
            places[grid.values == k] = place
        shown = _Shown(places, grid.share, "why poses are not feasible", "")
        shown.reasons = ["feasible", *(str(run.outcome.values[k]).replace("_", " ") for k in seen)]
        shown.map = ListedColormap(["#DDEBF7", *(COLOURS[(k + 1) % len(COLOURS)] for k in range(len(seen)))])
        shown.norm = Normalize(-0.5, len(seen) + 0.5)
        return shown
    word = "smallest" if quantity in LEAST else "largest"
    factor, unit = readable(unit_of(run, quantity), float(np.nanmax(grid.values, initial=0.0)))
    title = f"{word} {TITLES.get(quantity, quantity)}" + (f" of {at}" if at else "")
    shown = _Shown(grid.values * factor, grid.share, title, f"{title} [{unit}]" if unit else title)
    if quantity in LEAST:
        shown.map = shown.map.reversed()
    return shown


def _slices(cells: Cells, shown: _Shown) -> tuple[Figure, np.ndarray]:
    three = len(cells.names) == 3
    n = cells.shape[2] if three else 1
    chosen = np.unique(np.round(np.linspace(0, n - 1, min(n, MOST_SLICES))).astype(int))
    columns = min(3, len(chosen))
    rows = -(-len(chosen) // columns)
    width, height = (2.9, 2.9) if three else (5.2, 4.6)
    figure, grid = pyplot.subplots(
        rows, columns, squeeze=False, sharex=True, sharey=True, layout="constrained",
        figsize=(1.8 + width * columns, 1.0 + height * rows),
    )
    factors = [readable(unit, float(np.abs(edges).max())) for unit, edges in zip(cells.units, cells.edges)]
    partly = False
    for axis, k in zip(grid.flat, chosen):
        values = shown.values[..., k] if three else shown.values
        share = shown.share[..., k] if three else shown.share
        axis.set_facecolor(EMPTY)
        drawn = axis.pcolormesh(
            cells.edges[0] * factors[0][0], cells.edges[1] * factors[1][0], values.T, cmap=shown.map, norm=shown.norm,
            rasterized=True,
        )
        partly |= _outline(axis, cells, share, factors) and not shown.reasons
        if cells.units[0] == cells.units[1]:
            axis.set_aspect("equal")
        if three:
            value = cells.centres[2][k] * factors[2][0]
            axis.set_title(f"{_plain(cells.names[2])} = {value:.4g} {factors[2][1]}", fontsize="medium", parse_math=False)
    for axis in grid.flat[len(chosen) :]:
        axis.set_visible(False)
    for axis in grid[-1]:
        axis.set_xlabel(_axis_label(cells.names[0], factors[0][1]), parse_math=False)
    for axis in grid[:, 0]:
        axis.set_ylabel(_axis_label(cells.names[1], factors[1][1]), parse_math=False)
    panels = grid.flat[: len(chosen)]
    if shown.reasons:
        handles = [Patch(color=shown.map(k), label=text) for k, text in enumerate(shown.reasons)]
        figure.legend(handles=handles, loc="outside right center", frameon=False)
    else:
        figure.colorbar(drawn, ax=grid, label=shown.label, shrink=0.9, pad=0.02)
    notes: list[Artist] = []
    if np.isnan(shown.values).any():
        notes.append(Patch(color=EMPTY, label="no sample within the constraints"))
    if partly:
        notes.append(Line2D([], [], color="white", linewidth=2.0, path_effects=_edge(), label="inside: every sample feasible"))
    if notes:
        figure.legend(handles=notes, loc="outside lower center", ncols=2, frameon=False, fontsize="small")
    return figure, panels


def _outline(axis: Axes, cells: Cells, share: NDArray[np.float64], factors: Sequence[tuple[float, str]]) -> bool:
    """Border of the cells in which every sample is feasible, along the cells' edges."""
    whole = np.pad(np.nan_to_num(share) >= 1.0, 1)
    if not whole.any() or whole[1:-1, 1:-1].all():
        return False
    x, y = (edges * factor for edges, (factor, _) in zip(cells.edges[:2], factors[:2]))
    lines = []
    for i, j in np.argwhere(whole[1:, 1:-1] != whole[:-1, 1:-1]):
        lines.append([(x[i], y[j]), (x[i], y[j + 1])])
    for i, j in np.argwhere(whole[1:-1, 1:] != whole[1:-1, :-1]):
        lines.append([(x[i], y[j]), (x[i + 1], y[j])])
    from matplotlib.collections import LineCollection

    axis.add_collection(LineCollection(lines, colors="white", linewidths=2.0, path_effects=_edge(), capstyle="projecting"))
    return True


def _edge() -> list[Any]:
    """A dark rim: a white line is seen on pale cells, too."""
    from matplotlib import patheffects

    return [patheffects.withStroke(linewidth=3.6, foreground="0.15")]


def _space(cells: Cells, shown: _Shown) -> tuple[Figure, np.ndarray]:
    """Cells as blocks in space; the quarter towards the eye is taken away so that the inside is seen."""
    figure = pyplot.figure(figsize=(7.6, 6.4), layout="constrained")
    axis = figure.add_subplot(projection="3d")
    filled = np.isfinite(shown.values)
    if not shown.reasons:
        filled &= np.nan_to_num(shown.share) > 0
    middle = [len(values) // 2 for values in cells.centres]
    filled[middle[0] + 1 :, : middle[1], :] = False
    factors = [readable(unit, float(np.abs(edges).max())) for unit, edges in zip(cells.units, cells.edges)]
    corners = np.meshgrid(*(edges * factor for edges, (factor, _) in zip(cells.edges, factors)), indexing="ij")
    colours = shown.map(shown.norm(np.nan_to_num(shown.values)))
    axis.voxels(*corners, filled, facecolors=colours, edgecolors=(1, 1, 1, 0.35), linewidth=0.3, shade=False)
    for letter, name, (_, unit) in zip("xyz", cells.names, factors):
        getattr(axis, f"set_{letter}label")(_axis_label(name, unit))
    if len(set(cells.units)) == 1:
        spans = np.array([np.ptp(edges) for edges in cells.edges])
        axis.set_box_aspect(np.maximum(spans, 0.35 * spans.max()), zoom=0.9)
    axis.view_init(elev=24.0, azim=-52.0)
    if shown.reasons:
        handles = [Patch(color=shown.map(k), label=text) for k, text in enumerate(shown.reasons)]
        figure.legend(handles=handles, loc="outside right center", frameon=False)
    else:
        drawn = pyplot.cm.ScalarMappable(cmap=shown.map, norm=shown.norm)
        figure.colorbar(drawn, ax=axis, label=shown.label, shrink=0.7, pad=0.08)
    return figure, np.array([axis])


@checked
def force_map(
    run: xr.Dataset, *, axes: Iterable[str] | None = None, where: Mapping[str, float] | None = None
) -> tuple[Figure, np.ndarray]:
    """Each actuator's strongest force over two axes, with its sign: push positive, pull negative; one panel an actuator.

    Parameters
    ----------
    run
        Results of a sweep that keeps ``driving_force``.
    axes
        Names of two axes; default: the first two coordinates that are lengths.
    where
        Axis to value [SI]: samples at the nearest value alone, instead of the strongest over all.

    Returns
    -------
    figure, axes
        ``axes`` of shape (actuators,).

    Raises
    ------
    InputError
        The force was not kept, an unknown axis.
    """
    need_sweep(run, "force_map")
    names = chosen_axes(run, axes, (2,), "force_map")
    cells = cells_of(run, names, where, "force_map")
    force = np.where(within_constraints(run)[:, np.newaxis], values_of(run, "driving_force", None, "force_map"), np.nan)
    actuators = [str(name) for name in run.actuator.values]
    strongest = []
    for values in force.T:
        push, pull = cells.reduce(values), cells.reduce(values, smallest=True)
        strongest.append(np.where(push >= -pull, push, pull))
    largest = float(np.nanmax(np.abs(strongest), initial=0.0)) or 1.0
    factor, unit = readable(unit_of(run, "driving_force"), largest)
    norm = Normalize(-largest * factor, largest * factor)
    columns = min(3, len(actuators))
    rows = -(-len(actuators) // columns)
    figure, grid = pyplot.subplots(
        rows, columns, squeeze=False, sharex=True, sharey=True, layout="constrained",
        figsize=(1.8 + 2.9 * columns, 1.0 + 2.9 * rows),
    )
    factors = [readable(unit_, float(np.abs(edges).max())) for unit_, edges in zip(cells.units, cells.edges)]
    for axis, name, values in zip(grid.flat, actuators, strongest):
        axis.set_facecolor(EMPTY)
        drawn = axis.pcolormesh(
            cells.edges[0] * factors[0][0], cells.edges[1] * factors[1][0], values.T * factor,
            cmap=pyplot.get_cmap(DIVERGING).reversed(), norm=norm, rasterized=True,
        )
        axis.set_title(name, fontsize="medium", parse_math=False)
        if cells.units[0] == cells.units[1]:
            axis.set_aspect("equal")
        if np.isfinite(values).any():
            i, j = np.unravel_index(np.nanargmax(np.abs(values)), values.shape)
            axis.plot(cells.centres[0][i] * factors[0][0], cells.centres[1][j] * factors[1][0], "k+", markersize=9)
            axis.set_title(f"{name}  {values[i, j] * factor:+.4g} {unit}", fontsize="medium", parse_math=False)
    for axis in grid.flat[len(actuators) :]:
        axis.set_visible(False)
    for axis in grid[-1]:
        axis.set_xlabel(_axis_label(names[0], factors[0][1]), parse_math=False)
    for axis in grid[:, 0]:
        axis.set_ylabel(_axis_label(names[1], factors[1][1]), parse_math=False)
    figure.colorbar(drawn, ax=grid, label=f"strongest driving force, push positive [{unit}]", shrink=0.9, pad=0.02)
    swept = [n for n, size in zip(axis_names(run), run.axis_size.values) if size > 1 and n not in (*names, *(where or {}))]
    put_heading(figure, _heading(run, "strongest force of each actuator (+: where)", _over(swept)))
    return figure, grid.flat[: len(actuators)]


@checked
def screw_limit(motor: Limit, lead: float, *, ratio: float = 1.0, efficiency: float = 0.9) -> list[tuple[float, float]]:
    """Force-speed curve of a motor behind a screw, for `sizing`.

    Parameters
    ----------
    motor
        Points (speed [rad/s], torque [N m]) of the motor's curve.
    lead
        Travel per turn of the screw [m].
    ratio
        Turns of the motor per turn of the screw.
    efficiency
        Of screw and gear together, when driving.

    Returns
    -------
    list of (float, float)
        Points (speed [m/s], force [N]).
    """
    if not (lead > 0 and ratio > 0 and 0 < efficiency <= 1):
        raise InputError("screw_limit: expected lead > 0, ratio > 0, efficiency above 0 and up to 1")
    turn = lead / (2 * np.pi * ratio)      # travel per radian of the motor
    return [(float(speed) * turn, float(torque) * efficiency / turn) for speed, torque in motor]


@checked
def sizing(
    run: xr.Dataset, limit: Limit | None = None, continuous: Limit | None = None, *, design: int | None = None
) -> tuple[Figure, np.ndarray]:
    """Force over speed of each actuator against what motor and screw can do; a cross at the rms values.

    Parameters
    ----------
    run
        Results of a sweep that keeps ``driving_force`` and ``driving_speed``, or of `Scene.inverse`; without samples the
        box of the extremes is drawn, which holds them all.
    limit
        Points (speed [m/s], force [N]) of the peak curve, speeds increasing from 0; the same for all directions of motion
        and force. `screw_limit` makes one from a motor's curve.
    continuous
        Likewise: the curve the rms values must stay below.
    design
        Number of the design in a sweep of several.

    Returns
    -------
    figure, axes
        ``axes`` of shape (actuators,). Titles give the use of the peak curve: 1 touches it.

    Raises
    ------
    InputError
        Neither samples nor extremes of force and speed; a curve that is none.
    """
    swept = "axis" in run.dims
    data = one_design(run, design, "sizing") if swept else run
    curves = [_curve(points, name) for points, name in ((limit, "limit"), (continuous, "continuous"))]
    clouds = _clouds(data, run, design)
    names = [str(name) for name in run.actuator.values]
    extent = [max(float(np.nanmax(np.abs(cloud[:, k]), initial=0.0)) for cloud in clouds) for k in (0, 1)]
    units = _driving_units(run)
    (by_speed, speed_unit), (by_force, force_unit) = (readable(unit, size) for unit, size in zip(units, extent))
    columns = min(3, len(names))
    rows = -(-len(names) // columns)
    figure, grid = pyplot.subplots(
        rows, columns, squeeze=False, sharex=True, sharey=True, layout="constrained",
        figsize=(1.2 + 3.2 * columns, 1.1 + 2.9 * rows),
    )
    room = [1.08 * max([size, *(float(curve[:, k].max()) for curve in curves if curve is not None)]) for k, size in enumerate(extent)]
    for k, (axis, name, cloud) in enumerate(zip(grid.flat, names, clouds)):
        axis.axhline(0.0, color="0.75", linewidth=0.8, zorder=0)
        axis.axvline(0.0, color="0.75", linewidth=0.8, zorder=0)
        for curve, style in zip(curves, ({"color": BAD, "linewidth": 1.6}, {"color": BAD, "linewidth": 1.2, "linestyle": "--"})):
            if curve is not None:
                axis.plot(*_four_ways(curve, by_speed, by_force), **style)
        used = _use(cloud, curves[0])
        _draw_cloud(axis, cloud, used, by_speed, by_force, room)
        mean_speed, mean_force = _rms(data, k, cloud)
        axis.plot(mean_speed * by_speed, mean_force * by_force, "X", color="black", markeredgecolor="white", markersize=8)
        title = f"{name}   rms {mean_force * by_force:.4g} {force_unit}"
        if used is not None:
            title += f"\nuse of the limit {np.nanmax(used, initial=0.0):.2f}"
            beyond = int((used > 1.0).sum())
            if beyond:
                title += f", {beyond} samples beyond" if _has_samples(run) else ", beyond"
        axis.set_title(title, fontsize="medium", parse_math=False, color=BAD if used is not None and np.nanmax(used, initial=0.0) > 1 else "black")
        widest, highest = (room[0] * by_speed or 1.0), (room[1] * by_force or 1.0)     # at rest, or without force: about zero
        axis.set_xlim(-widest, widest)
        axis.set_ylim(-highest, highest)
        axis.grid(True, color="0.93", linewidth=0.6)
        axis.spines[["top", "right"]].set_visible(False)
    for axis in grid.flat[len(names) :]:
        axis.set_visible(False)
    for axis in grid[-1]:
        axis.set_xlabel(f"speed [{speed_unit}]")
    for axis in grid[:, 0]:
        axis.set_ylabel(f"{'torque' if units[1] == 'N m' else 'force'} [{force_unit}]")
    _sizing_legend(figure, curves, _has_samples(run))
    put_heading(figure, _heading(run, "", "force and speed of each actuator"))
    return figure, grid.flat[: len(names)]


def _has_samples(run: xr.Dataset) -> bool:
    return all(name in run and "sample" in run[name].dims for name in ("driving_force", "driving_speed"))


def _driving_units(run: xr.Dataset) -> tuple[str, str]:
    """Of speed and force; actuators of both kinds in one machine are drawn in the units of the first."""
    if "actuator_unit" in run.coords:
        force = str(run.actuator_unit.values.flat[0])
    else:
        force = unit_of(run, "driving_force")
    return ("rad/s" if force == "N m" else "m/s", force)


def _curve(points: Limit | None, name: str) -> NDArray[np.float64] | None:
    if points is None:
        return None
    curve = np.asarray(points, dtype=float)
    if curve.ndim != 2 or curve.shape[1] != 2 or len(curve) < 2 or np.any(np.diff(curve[:, 0]) < 0) or np.any(curve < 0):
        raise InputError(f"sizing: {name} (expected two points or more (speed, force), none negative, speeds increasing)")
    return curve


def _clouds(data: xr.Dataset, run: xr.Dataset, design: int | None) -> list[NDArray[np.float64]]:
    """(sample, 2) speed and force of each actuator; the corners of their box without samples."""
    if _has_samples(run):
        speed, force = run.driving_speed.values, run.driving_force.values
        if "sample_outcome" in run:
            force = np.where(within_constraints(run)[:, np.newaxis], force, np.nan)
        if "design" in run.dims:
            share = len(speed) // run.sizes["design"]
            part = slice((design or 0) * share, ((design or 0) + 1) * share)
            speed, force = speed[part], force[part]
        return [np.stack([speed[:, k], force[:, k]], axis=1) for k in range(speed.shape[1])]
    ends = [f"{name}_{side}" for name in ("driving_speed", "driving_force") for side in ("min", "max")]
    if any(name not in data for name in ends):
        raise InputError("sizing: force and speed are not in the results (expected driving_force and driving_speed)")
    box = [data[name].values for name in ends]
    return [
        np.array([[box[i][k], box[2 + j][k]] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]) for k in range(len(box[0]))
    ]


def _four_ways(curve: NDArray[np.float64], by_speed: float, by_force: float) -> tuple[Any, Any]:
    """The closed curve for both directions of motion and force."""
    speed, force = curve.T
    quarter = np.stack([np.append(speed, speed[-1]), np.append(force, 0.0)], axis=1)
    left, right = quarter[::-1] * (-1, 1), quarter
    upper = np.concatenate([left, right])
    closed = np.concatenate([upper, upper[::-1] * (1, -1)])
    return closed[:, 0] * by_speed, closed[:, 1] * by_force


def _use(cloud: NDArray[np.float64], curve: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """How much of the curve each sample uses: the factor by which the curve must grow (in both directions) to touch it."""
    if curve is None:
        return None
    speed, force = np.abs(cloud).T
    low, high = np.zeros(len(speed)), np.ones(len(speed))

    def beyond(scale: NDArray[np.float64]) -> NDArray[np.bool_]:
        with np.errstate(divide="ignore", invalid="ignore"):
            v, f = speed / scale, force / scale
        is_within: NDArray[np.bool_] = (v <= curve[-1, 0]) & (f <= np.interp(v, curve[:, 0], curve[:, 1]))
        return ~is_within

    for _ in range(60):
        wide = beyond(high) & np.isfinite(speed + force)
        if not wide.any():
            break
        high[wide] *= 2.0
    for _ in range(40):
        middle = (low + high) / 2
        out = beyond(middle)
        low, high = np.where(out, middle, low), np.where(out, high, middle)
    return np.where(np.isfinite(speed + force), high, np.nan)


def _draw_cloud(axis: Axes, cloud: Any, used: Any, by_speed: float, by_force: float, room: list[float]) -> None:
    there = np.isfinite(cloud).all(axis=1)
    points = cloud[there] * (by_speed, by_force)
    if len(points) == 4 and len(np.unique(cloud, axis=0)) <= 4:       # the box of the extremes
        axis.fill(*points.T, facecolor=COLOURS[5], alpha=0.35, edgecolor=COLOURS[0], linewidth=1.2)
        return
    if len(points) > 3000:
        window = (-room[0] * by_speed, room[0] * by_speed, -room[1] * by_force, room[1] * by_force)
        colours = pyplot.get_cmap("Blues")(np.linspace(0.3, 1.0, 256))
        axis.hexbin(
            *points.T, gridsize=60, extent=window, mincnt=1, norm=LogNorm(), cmap=ListedColormap(colours), linewidths=0.2,
            rasterized=True,
        )
    else:
        axis.plot(*points.T, ".", color=COLOURS[0], markersize=2.5, alpha=0.6, rasterized=True)
    if used is not None:
        out = points[used[there] > 1.0]
        axis.plot(*out.T, ".", color=BAD, markersize=2.0, rasterized=True)


def _rms(data: xr.Dataset, k: int, cloud: NDArray[np.float64]) -> tuple[float, float]:
    """Of speed and force over the samples, as a sweep and the printed summary have it."""
    if "driving_force_rms" in data and "driving_speed_rms" in data:
        return float(data.driving_speed_rms.values[k]), float(data.driving_force_rms.values[k])
    is_there = np.isfinite(cloud).all(axis=1)
    weights = shares(data) if "status" in data else is_there.astype(float)
    speed, force = rms(cloud, np.where(is_there, weights, 0.0))
    return float(speed), float(force)


def _sizing_legend(figure: Figure, curves: list[Any], has_samples: bool) -> None:
    line = Line2D
    handles: list[Any] = [
        line([], [], color=COLOURS[0], marker="o", linestyle="", markersize=4, label="samples")
        if has_samples
        else Patch(facecolor=COLOURS[5], alpha=0.35, edgecolor=COLOURS[0], label="between the extremes"),
        line([], [], color="black", marker="X", linestyle="", markersize=7, label="rms"),
    ]
    if curves[0] is not None:
        handles.append(line([], [], color=BAD, linewidth=1.6, label="limit"))
    if curves[1] is not None:
        handles.append(line([], [], color=BAD, linewidth=1.2, linestyle="--", label="continuous limit"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize="small")


@checked
def histograms(
    run: xr.Dataset, quantity: str = "driving_force", *, at: Iterable[str] | None = None, design: int | None = None
) -> tuple[Figure, np.ndarray]:
    """How often which value occurs, one panel an entry; a line at the rms value, marks at the extremes.

    Parameters
    ----------
    run
        Results of a sweep with a histogram of the quantity, or that keeps it.
    quantity
        As in "reduce" of the scene.
    at
        Names of entries ("leg1.P", "leg1.S Fx"); default: all, twelve at most.
    design
        Number of the design in a sweep of several.

    Returns
    -------
    figure, axes
        ``axes`` of shape (entries,).

    Raises
    ------
    InputError
        Neither histogram nor samples of the quantity, an unknown entry.
    """
    need_sweep(run, "histograms")
    data = one_design(run, design, "histograms")
    edges, counts, labels = _bins(run, data, quantity)
    chosen = labels[:12] if at is None else [at] if isinstance(at, str) else list(at)
    if not chosen:
        raise InputError("histograms: at: names no entry (expected one at least)")
    for name in chosen:
        if name not in labels:
            raise InputError(f"histograms: no {name!r} in {quantity} (expected one of {', '.join(labels)})")
    factor, unit = readable(unit_of(run, quantity), float(np.nanmax(np.abs(edges))))
    columns = min(3, len(chosen))
    rows = -(-len(chosen) // columns)
    figure, grid = pyplot.subplots(
        rows, columns, squeeze=False, sharex=True, layout="constrained", figsize=(0.8 + 3.0 * columns, 0.9 + 2.1 * rows)
    )
    for axis, name in zip(grid.flat, chosen):
        k = labels.index(name)
        share = 100.0 * counts[k] / max(1, counts[k].sum())
        axis.stairs(share, edges[k] * factor, fill=True, color=COLOURS[5], alpha=0.55)
        axis.stairs(share, edges[k] * factor, color=COLOURS[0], linewidth=1.2)
        for side, colour in (("min", COLOURS[1]), ("max", COLOURS[1])):
            if f"{quantity}_{side}" in data:
                axis.axvline(float(data[f"{quantity}_{side}"].values.reshape(-1)[k]) * factor, color=colour, linewidth=1.0)
        title = name
        if f"{quantity}_rms" in data:
            title += f"  rms {float(data[f'{quantity}_rms'].values.reshape(-1)[k]) * factor:.4g} {unit}"
        axis.set_title(title, fontsize="medium", parse_math=False)
        axis.spines[["top", "right"]].set_visible(False)
        axis.set_ylim(bottom=0.0)
    for axis in grid.flat[len(chosen) :]:
        axis.set_visible(False)
    for axis in grid[-1]:
        axis.set_xlabel(f"{TITLES.get(quantity, quantity)} [{unit}]" if unit else TITLES.get(quantity, quantity))
    for axis in grid[:, 0]:
        axis.set_ylabel("share of the samples [%]")
    put_heading(figure, _heading(run, "", f"how often which {TITLES.get(quantity, quantity)}; vertical lines: extremes"))
    return figure, grid.flat[: len(chosen)]


def _bins(run: xr.Dataset, data: xr.Dataset, quantity: str) -> tuple[Any, Any, list[str]]:
    """(entry, bin edge), (entry, bin), labels: from the sweep's histogram, else from samples."""
    if f"{quantity}_histogram" in run:
        counts = data[f"{quantity}_histogram"].values
        edges = run[f"{quantity}_bin_edge"].values
        return edges.reshape(-1, edges.shape[-1]), counts.reshape(-1, counts.shape[-1]), entries_of(run, f"{quantity}_histogram")
    if quantity not in run or "sample" not in run[quantity].dims:
        raise InputError(
            f"histograms: neither histogram nor samples of {quantity!r} in the results "
            f"(expected histogram = {{ {quantity} = true }} or keep = [...] in [sweep])"
        )
    values = values_of(run, quantity, None, "histograms")
    parts = [np.histogram(column[np.isfinite(column)], bins=60) for column in values.T]
    return np.array([edge for _, edge in parts]), np.array([count for count, _ in parts]), entries_of(run, quantity)


@checked
def designs(run: xr.Dataset, cost: str = "driving_force", gain: str | None = None) -> tuple[Figure, Axes]:
    """Designs of a sweep against each other: a cost that should be small over a gain that should be large.

    The line joins the designs that no other one beats in both (the Pareto front); their parameters are written there.

    Parameters
    ----------
    run
        Results of a sweep with axes over parameters.
    cost
        A reduced quantity: its worst over all entries and samples.
    gain
        "feasible_volume" or "feasible_fraction", or a reduced quantity to be kept small, too ("condition"). Without, the volume, or
        the fraction where no coordinate of the sweep is a length.

    Returns
    -------
    figure, axes

    Raises
    ------
    InputError
        No designs in the results, a quantity that is not there.
    """
    need_sweep(run, "designs")
    if "design" not in run.dims:
        raise InputError("designs: one design only (expected a sweep with axes over parameters)")
    gain = usual_gain(run) if gain is None else gain
    y, y_label = _score(run, cost)
    x, x_label = _score(run, gain)
    front = pareto_front(y, x if gain.startswith("feasible") else -x)
    names = [_design_name(run, k) for k in range(run.sizes["parameter"])]
    values = run.design_value.values
    figure, axis = pyplot.subplots(figsize=(8.4, 5.6), layout="constrained")
    markers = "osD^vP*X"
    first, second = values[:, 0], values[:, 1] if values.shape[1] > 1 else np.zeros(len(values))
    steps = np.unique(second)
    factors = [_design_unit(run, k) for k in range(values.shape[1])]
    norm = Normalize(first.min() * factors[0][0], first.max() * factors[0][0])
    for k, step in enumerate(steps):
        chosen = second == step
        drawn = axis.scatter(
            x[chosen], y[chosen], c=first[chosen] * factors[0][0], cmap=SEQUENTIAL, norm=norm, s=42, zorder=3,
            marker=markers[k % len(markers)], edgecolors="white", linewidths=0.6,
            label=f"{step * factors[1][0]:.4g} {factors[1][1]}".strip() if values.shape[1] > 1 else None,
        )
    axis.plot(x[front], y[front], "o-" if len(front) > 1 else "o", color=COLOURS[1], linewidth=1.5, zorder=2, markersize=11.5, markerfacecolor="none",
              markeredgewidth=1.3, label="no design is better in both")
    figure.colorbar(drawn, ax=axis, label=_axis_label(names[0], factors[0][1]), pad=0.02)
    for k in _apart(x[front], y[front]):
        design = front[k]
        text = ", ".join(f"{v * factor:.4g}{' ' + unit if unit else ''}" for v, (factor, unit) in zip(values[design], factors))
        axis.annotate(f"{design}: {text}", (x[design], y[design]), xytext=(8, -12), textcoords="offset points", fontsize="small", zorder=5)
    axis.set_xlabel(x_label)
    axis.set_ylabel(y_label)
    axis.grid(True, color="0.92", linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(title=_axis_label(names[1], "") if values.shape[1] > 1 else None, fontsize="small", frameon=False, loc="best")
    axis.margins(0.08)
    put_heading(figure, _heading(run, "", f"{run.sizes['design']} designs"))
    return figure, axis


def usual_gain(run: xr.Dataset) -> str:
    """How much of the workspace a design reaches: a volume, if it has one."""
    return "feasible_volume" if "feasible_volume" in run else "feasible_fraction"


def pareto_front(cost: NDArray[np.float64], gain: NDArray[np.float64]) -> NDArray[np.intp]:
    """Numbers of the designs that no other beats in both, by rising gain."""
    order = [int(k) for k in np.lexsort((cost, -gain)) if np.isfinite(cost[k]) and np.isfinite(gain[k])]
    front, lowest = [], np.inf
    for k in order:
        if cost[k] < lowest:
            front.append(k)
            lowest = cost[k]
    return np.array(front[::-1], dtype=np.intp)


def _score(run: xr.Dataset, name: str) -> tuple[NDArray[np.float64], str]:
    """(design,) one number a design, and what it is."""
    if name in ("feasible_volume", "feasible_fraction") and name in run:
        factor, unit = (100.0, "%") if name == "feasible_fraction" else (1.0, str(run[name].attrs["units"]).replace("m3", "m³"))
        return run[name].values * factor, f"feasible {name.split('_')[1].replace('fraction', 'share')} [{unit}]"
    if f"{name}_max" not in run:
        raise InputError(f"designs: {name!r} is not in the results (expected one of 'reduce', feasible_volume, feasible_fraction)")
    n = run.sizes["design"]
    both = np.stack([run[f"{name}_min"].values.reshape(n, -1), run[f"{name}_max"].values.reshape(n, -1)], axis=1).reshape(n, -1)
    worst = worst_of(name, both, axis=1)
    if name in LEAST:
        worst = worst_of(name, run[f"{name}_min"].values.reshape(n, -1), axis=1)
    factor, unit = readable(unit_of(run, name), float(np.nanmax(worst)))
    words = f"{'smallest' if name in LEAST else 'largest'} {TITLES.get(name, name)}"
    return worst * factor, f"{words} [{unit}]" if unit else words


def _apart(x: NDArray[np.float64], y: NDArray[np.float64]) -> list[int]:
    """Points far enough from each other for a text at each."""
    chosen: list[int] = []
    span = (np.ptp(x) or 1.0, np.ptp(y) or 1.0)
    for k in range(len(x)):
        if all(abs(x[k] - x[c]) > 0.12 * span[0] or abs(y[k] - y[c]) > 0.08 * span[1] for c in chosen):
            chosen.append(k)
    return chosen


def _design_name(run: xr.Dataset, k: int) -> str:
    return str(run.parameter.values[k])


def _design_unit(run: xr.Dataset, k: int) -> tuple[float, str]:
    unit = str(run.parameter_unit.values[k])
    return readable(unit, float(np.abs(run.design_value.values[:, k]).max())) if unit not in ("SI", "1") else (1.0, "")


def _heading(run: xr.Dataset, what: str, of: str) -> str:
    title = str(run.attrs.get("title", ""))
    second = " ".join(part for part in (what, of) if part)
    return "\n".join(part for part in (title, second) if part)


def _over(names: list[str]) -> str:
    """What a map takes the worst of, in words."""
    if not names:
        return ""
    places = [_plain(name).split()[-1] for name in names if " " not in name]
    others = [name for name in names if " " in name]
    words = ([f"all {', '.join(places)}"] if places else []) + (["load cases" if len(others) > 1 else others[0]] if others else [])
    return "over " + " and ".join(words)


def _plain(name: str) -> str:
    """ "platform x" of "platform.x"."""
    return name.replace(".", " ")


def _axis_label(name: str, unit: str) -> str:
    return f"{_plain(name)} [{unit}]" if unit else _plain(name)
