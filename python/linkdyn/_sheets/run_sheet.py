"""The sheet of a run: drives and bearings with their loads, what is beyond a limit, pictures of the machine and its forces.

It is drawn as that of a sweep, by `html` and `pdf`.
"""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .._cycle.averages import good_samples, need_order, rms, shares
from .._cycle.energy import energy
from .._drawing.forces import borne
from .._drawing.style import plain_units, readable
from .._event_sides import EventSides
from .._geometry.kinematics import variable_of
from .._geometry.postures import scene_of
from .._printable import printable
from ..errors import InputError, LinkdynError
from ..scene import Scene
from .cylinder_sheet import cylinders_table
from .events_table import events_table
from .places import place_of, turning_coordinate
from .run_warnings import ROUNDED, warnings_table
from .sheet import NONE, Cell, Page, Picture, Table, cell_of, count_words, limits_table, machine_picture, provenance

__all__ = ["run_page"]

Values = NDArray[np.float64]

STRAIGHT = 0.01
"""Of its largest force: a curve that is not wider is a line."""
MOST_HODOGRAPHS = 6
"""Joints whose forces are drawn: those with the largest."""
LOWEST_TRANSMISSION = np.radians(40.0)
"""VDI 2125 wants no smaller transmission angle of what turns at speed."""
ROUNDING = 1e-12
"""Of the largest value: what is left of a sum that is zero."""


def run_page(run: xr.Dataset, scene: Scene | None) -> Page:
    """What stands on the sheet of a run.

    Raises
    ------
    InputError
        The run has neither driving forces nor reactions, or its instants go back.
    """
    if "driving_force" not in run and "reaction" not in run:
        raise InputError("sheet: the run has neither driving forces nor reactions (expected want='driving_force', 'reaction' or all)")
    need_order(run, "sheet")
    scene = scene if scene is not None else _kept(run)
    page = Page(printable(str(run.attrs.get("title") or "Run")))
    page.lines = _facts(run, scene)
    limits = _bounded(run, scene)
    page.tables = [
        table
        for table in (warnings_table(run, scene, limits), *_drives(run, scene), _motors(run, scene), cylinders_table(run, scene), _joints(run), events_table(run, scene), _transmission(run), _shaking(run, scene),
                      limits_table(limits) if limits is not None else None)
        if table is not None
    ]
    page.pictures = _pictures(run, scene)
    page.notes = _notes(run)
    return page


def _kept(run: xr.Dataset) -> Scene | None:
    """The scene that the run keeps, if it needs no other files."""
    try:
        return scene_of(run, "sheet")
    except LinkdynError:
        return None


# ---------------------------------------------------------------- head

def _facts(run: xr.Dataset, scene: Scene | None) -> list[str]:
    n = run.sizes["sample"]
    line = f"{count_words(n)} sample{'s' if n != 1 else ''}"
    if "time" in run.coords and n:
        line += f", {float(run.time[0]):g} s to {float(run.time[-1]):g} s"
    if "method" in run.attrs:
        line += f", forward dynamics by {run.attrs['method']}"
    frame = ["The frame moves: places, speeds and directions are as seen from it."] if scene is not None and scene.description["frame_moves"] else []
    return [line, *frame, provenance(run)]


def _notes(run: xr.Dataset) -> list[str]:
    over = "the run's time" if "time" in run.coords else "the samples"
    notes = [f"A driving force is positive where it drives its joint variable up. Rms values are over {over}."]
    if "reaction" in run:
        notes.append("Joint loads are magnitudes, without the driving force of a driven joint.")
    return notes


def _bounded(run: xr.Dataset, scene: Scene | None) -> xr.Dataset | None:
    """The bounds that the scene's sweep states, looked for along the run: as a sweep over its instants, where they exclude nothing."""
    if scene is None or "time" not in run.coords or "method" in run.attrs or run.sizes["sample"] < 2:
        return None
    table = tomllib.loads(scene.text).get("sweep", {})
    bounds = [*table.get("constraint", []), *table.get("limit", [])]
    if not bounds or not np.array_equal(scene.motion(run.time.values)[0], run.q.values):
        return None
    axis = {"time": True, "values": run.time.values.tolist()}
    kept = {key: table[key] for key in ("on", "length", "clearance", "swing") if key in table}
    try:
        return scene.sweep({**kept, "limit": bounds, "reduce": sorted({str(bound["of"]) for bound in bounds}), "axis": [axis]})
    except LinkdynError:    # a bound on what only its own axes bring
        return None


# ---------------------------------------------------------------- tables

def _drives(run: xr.Dataset, scene: Scene | None) -> list[Table]:
    """One table for drives that push, one for those that turn."""
    if "driving_force" not in run:
        return []
    units = [str(unit) for unit in run.actuator_unit.values]
    return [_drive_table(run, scene, [k for k, other in enumerate(units) if other == unit], unit) for unit in dict.fromkeys(units)]


def _drive_table(run: xr.Dataset, scene: Scene | None, chosen: list[int], unit: str) -> Table:
    weights = shares(run)
    columns: list[tuple[str, list[Cell]]] = []

    def add(heads: list[str], values: list[Values], unit: str) -> None:
        factor, word = readable(unit, max(float(np.nanmax(np.abs(value), initial=0.0)) for value in values))
        columns.extend((f"{head}\n[{word}]", [cell_of(x, factor) for x in value]) for head, value in zip(heads, values))

    sides = EventSides.of(run)
    told, force = sides.behind("driving_force")[:, chosen], run.driving_force.values[:, chosen]
    words = ("highest\ntorque", "lowest\ntorque") if unit == "N m" else ("highest\nforce", "lowest\nforce")
    columns += _with_places(run, unit, {words[0]: _peak(told, 1), words[1]: _peak(told, -1), "rms": (np.atleast_1d(rms(force, weights)), None)})
    length = "rad" if unit == "N m" else "m"
    if scene is not None and "joint_variable" in run:
        path = np.stack([_path(run, scene, str(run.actuator.values[k])) for k in chosen], axis=1)
        add(["position\nfrom", "to"], [_peak(path, -1)[0], _peak(path, 1)[0]], length)
    if "driving_speed" in run:
        speed = run.driving_speed.values[:, chosen]
        turns = 30 / np.pi if unit == "N m" else 1.0     # as data sheets have it
        add(["peak\nspeed", "rms\nspeed"], [turns * _peak(np.abs(sides.behind("driving_speed")[:, chosen]), 1)[0], turns * np.atleast_1d(rms(speed, weights))], "rpm" if unit == "N m" else "m/s")
    if "driving_power" in run:
        power = run.driving_power.values[:, chosen]
        peaks = sides.behind("driving_power")[:, chosen]
        add(["power\nin", "power\nback"], [_only(_peak(peaks, 1)[0], 1), _only(_peak(peaks, -1)[0], -1)], "W")
        if "time" in run.coords and run.time[-1] > run.time[0] and good_samples(run).all():
            found = energy(run).isel(drive=chosen)
            mean = found.mean_power.values
            add(["mean\npower"], [np.where(np.abs(mean) < ROUNDING * np.abs(power).max(axis=0), 0.0, mean)], "W")
            add(["energy\nin", "energy\nback"], [found.energy_in.values, found.energy_back.values], "J")
    rows = [[Cell(str(run.actuator.values[k])), *(cells[i] for _, cells in columns)] for i, k in enumerate(chosen)]
    words_at = tuple(1 + i for i, (head, _) in enumerate(columns) if head == "at")
    return Table("Drives", ["drive", *(head for head, _ in columns)], rows, wide=(0, *words_at))


def _with_places(run: xr.Dataset, unit: str, columns: dict[str, tuple[Values, Any]]) -> list[tuple[str, list[Cell]]]:
    """Columns of one quantity in one unit, those that have samples with their places behind them."""
    factor, word = readable(unit, max(float(np.nanmax(np.abs(values), initial=0.0)) for values, _ in columns.values()))
    found: list[tuple[str, list[Cell]]] = []
    for head, (values, at) in columns.items():
        found.append((f"{head}\n[{word}]", [cell_of(x, factor) for x in values]))
        if at is not None:
            found.append(("at", [Cell(place_of(run, k)) if k >= 0 else Cell(NONE) for k in at]))
    return found


def _motors(run: xr.Dataset, scene: Scene | None) -> Table | None:
    """What the motors behind gears and screws have to give."""
    if "motor_torque" not in run:
        return None
    weights = shares(run)
    columns: list[tuple[str, list[Cell]]] = []

    def add(heads: list[str], values: list[Values], unit: str) -> None:
        factor, word = readable(unit, max(float(np.nanmax(np.abs(value), initial=0.0)) for value in values))
        columns.extend((f"{head}\n[{word}]", [cell_of(x, factor) for x in value]) for head, value in zip(heads, values))

    sides = EventSides.of(run)
    torque, speed, power = (sides.behind(name) for name in ("motor_torque", "motor_speed", "motor_power"))
    columns += _with_places(run, "N m", {"peak\ntorque": _peak(np.abs(torque), 1), "rms\ntorque": (np.atleast_1d(rms(run.motor_torque.values, weights)), None)})
    add(["peak\nspeed"], [_peak(np.abs(speed), 1)[0] * 30 / np.pi], "rpm")  # as data sheets have it
    add(["power\nout", "power\nback"], [_only(_peak(power, 1)[0], 1), _only(_peak(power, -1)[0], -1)], "W")
    if "motor_current" in run:
        current = run.motor_current.values
        add(["peak\ncurrent", "rms\ncurrent"], [_peak(np.abs(sides.behind("motor_current")), 1)[0], np.atleast_1d(rms(current, weights))], "A")
    if "torque_margin" in run:
        margin = sides.behind("torque_margin")
        margin = np.where(np.abs(margin) <= ROUNDED * np.abs(torque), 0.0, margin)     # at its limit
        add(["least\nmargin"], [np.nanmin(margin, axis=0, initial=np.inf)], "N m")
    names = [str(name) for name in run.motor.values]
    if scene is not None:
        locks = {motor["name"] for motor in scene.description["motors"] if motor["back_efficiency"] <= 0}
        columns.append(("self-\nlocking", [Cell("yes" if name in locks else "no") for name in names]))
    rows = [[Cell(name), *(cells[i] for _, cells in columns)] for i, name in enumerate(names)]
    words_at = tuple(1 + i for i, (head, _) in enumerate(columns) if head == "at")
    return Table("Motors", ["motor of", *(head for head, _ in columns)], rows, wide=(0, *words_at))


def _path(run: xr.Dataset, scene: Scene, actuator: str) -> Values:
    """Joint variable that an actuator drives."""
    names = list(map(str, run["variable"].values))
    found = variable_of(scene, actuator)
    place = names.index(f"{found[0]['name']}.{found[1]}") if found else 0
    values: Values = run.joint_variable.values[:, place]
    return values


def _joints(run: xr.Dataset) -> Table | None:
    """A row for each joint: largest force and moment, when, and the components there."""
    if "reaction" not in run:
        return None
    components = [str(name) for name in run.component.values]
    parts = [[i for i, name in enumerate(components) if name.startswith(letter)] for letter in "FM"]
    values, n = EventSides.of(run).behind("reaction"), run.sizes["sample"]
    sizes = [np.linalg.norm(values[..., part], axis=-1) for part in parts]
    bears = borne(*(np.nan_to_num(_peak(size, 1)[0]) for size in sizes))
    columns: list[tuple[str, list[Cell]]] = []
    for word, unit, part, size, acts in zip(("force", "moment"), ("N", "N m"), parts, sizes, bears):
        peak, at = _peak(size, 1)
        if not acts.any():
            continue
        factor, name = readable(unit, float(np.nanmax(peak)))
        columns.append((f"peak\n{word}\n[{name}]", [cell_of(x, factor) if there else Cell(NONE) for x, there in zip(peak, acts)]))
        columns.append(("at", [Cell(place_of(run, k)) if there else Cell(NONE) for k, there in zip(at, acts)]))
        for i in part if len(part) > 1 else []:
            parts_there = np.array([values[k, joint, i] if there else np.nan for joint, (k, there) in enumerate(zip(at, acts))])
            parts_there[np.abs(parts_there) < ROUNDING * peak] = 0.0
            columns.append((f"{components[i]} there\n[{name}]", [cell_of(x, factor) for x in parts_there]))
        mean = np.atleast_1d(rms(size[:n], shares(run)))
        columns.append((f"rms {word}\n[{name}]", [cell_of(x, factor) if there else Cell(NONE) for x, there in zip(mean, acts)]))
    if not columns:
        return None
    told_by_slot = _told_by_slots(list(map(str, run.joint.values)), values)
    rows = [[Cell(str(name)), *(cells[k] for _, cells in columns)] for k, name in enumerate(run.joint.values) if str(name) not in told_by_slot]
    return Table("Bearings and guides", ["joint", *(head for head, _ in columns)], rows,
                 wide=(0, *(1 + i for i, (head, _) in enumerate(columns) if head == "at")))


def _told_by_slots(names: list[str], loads: Values) -> set[str]:
    """Pins of slots, called S.pin beside their S: what the slot bears they bear, and it stands there once."""
    pins = [(k, names.index(name.removesuffix(".pin"))) for k, name in enumerate(names) if name.endswith(".pin") and name.removesuffix(".pin") in names]
    return {names[pin] for pin, slot in pins if np.allclose(loads[:, pin], loads[:, slot], rtol=ROUNDING, atol=ROUNDING * np.nanmax(np.abs(loads)), equal_nan=True)}


def _transmission(run: xr.Dataset) -> Table | None:
    if "transmission_angle" not in run or not run.sizes.get("dyad"):
        return None
    angle = run.transmission_angle.values
    acute = np.minimum(angle, np.pi - angle)
    worst, at = _peak(-acute, 1)
    rows = [
        [Cell(str(name)), cell_of(-value, 180 / np.pi, alarm=-value < LOWEST_TRANSMISSION), Cell(place_of(run, k) if k >= 0 else NONE)]
        for name, value, k in zip(run.dyad.values, worst, at)
        if not -value > np.pi / 2 - 1e-6      # a guide that stands square, as a cylinder's always does
    ]
    if not rows:
        return None
    return Table("Transmission angles", ["dyad", "smallest\n[deg]", "at"], rows, "Red below 40 deg.", wide=(0, 2))


def _shaking(run: xr.Dataset, scene: Scene | None) -> Table | None:
    """On the frame, moment about the origin; without the constant weight. What inertia forces in balance leave of their sum is told as the zero that it is."""
    if scene is None or run.sizes["sample"] < 2:
        return None
    from .._cycle.shaking import inertia_size, shaking

    try:
        found = shaking(run, scene).sel(cause="inertia")
        sizes = inertia_size(run, scene)
    except LinkdynError:    # coordinates that do not tell the links' motion
        return None
    rows = []
    causes = (("force", found.force_by_cause, "N"), ("moment about the origin", found.moment_by_cause, "N m"))
    for (words, values, unit), terms in zip(causes, sizes):
        if terms == 0:      # nothing is accelerated
            continue
        size = np.linalg.norm(values.values, axis=-1)[:, np.newaxis]
        peak, at = _peak(size, 1)
        if peak[0] <= ROUNDING * terms:
            rows.append([Cell(words), Cell("0"), Cell(plain_units(unit)), Cell(NONE), Cell("0")])
            continue
        factor, name = readable(unit, float(peak[0]))
        rows.append([Cell(words), cell_of(peak[0], factor), Cell(name), Cell(place_of(run, int(at[0]))),
                     cell_of(float(rms(size[:, 0], shares(run))), factor)])
    return Table("Shaking of the frame by inertia", ["", "peak", "unit", "at", "rms"], rows, wide=(0, 2, 3)) if rows else None


def _peak(values: Values, sign: int) -> tuple[Values, NDArray[np.intp]]:
    """Of each column the largest (lowest for a sign of -1) value and its sample; NaN and -1 where there is none."""
    ranked = np.where(np.isfinite(values), sign * values, -np.inf)
    at = ranked.argmax(axis=0)
    columns = np.arange(values.shape[1])
    there = np.isfinite(ranked[at, columns])
    return np.where(there, values[at, columns], np.nan), np.where(there, at, -1)


def _only(values: Values, sign: int) -> Values:
    return np.where(sign * values > 0, values, np.nan)


# ---------------------------------------------------------------- pictures

def _pictures(run: xr.Dataset, scene: Scene | None) -> list[Picture]:
    from .. import plot

    crank = turning_coordinate(run)
    pictures = []
    drawing = machine_picture(run, scene)
    if drawing is not None:
        drawing.figure.axes[0].set_title("")
        pictures.append(drawing)
    if run.sizes["sample"] < 2 or not good_samples(run).any():
        return pictures
    over = f" over the angle of {crank}" if crank else ""
    if "driving_force" in run and run.sizes["actuator"]:
        figure, axes = plot.driving_forces(run, crank)
        figure.set_size_inches(8.0, max(4.4, 2.6 * len(axes)))
        pictures.append(_bare(f"Driving forces{over}", figure))
    elif "q" in run and "qd" in run:        # nothing drives it: how it goes by itself
        figure, _ = plot.motion(run, stacked=True)
        figure.set_size_inches(8.0, 5.2)
        pictures.append(_bare("Coordinates and their rates", figure))
    if "reaction" in run and np.nan_to_num(run.reaction.values).any():
        pictures.append(_bare(f"Joint forces and moments{over}", plot.reactions(run, crank)[0], wide=True))
        pictures += [_hodographs(run, pair, names) for pair, names in _largest(run) if _bent(run, pair, names)]
    return pictures


def _hodographs(run: xr.Dataset, pair: str, names: list[str]) -> Picture:
    from .. import plot

    bent = _bent(run, pair, names)
    straight = [name for name in names if name not in bent]
    without = f"; {', '.join(straight)} keep{'s' if len(straight) == 1 else ''} to one line" if straight else ""
    return _bare(f"Hodographs of the largest joint forces, in the {pair} plane{without}", plot.hodograph(run, bent, pair)[0], wide=True)


def _bent(run: xr.Dataset, pair: str, names: list[str]) -> list[str]:
    """Joints whose force leaves the line of its largest by more than that is wide in a panel: of the others the magnitude tells all."""
    found = []
    for name in names:
        force = np.nan_to_num(run.reaction.sel(joint=name, component=[f"F{letter}" for letter in pair]).values)
        top = force[np.argmax(np.linalg.norm(force, axis=1))]
        aside = np.abs(force @ [-top[1], top[0]])
        if aside.max() > STRAIGHT * (top @ top):
            found.append(name)
    return found


def _bare(caption: str, figure: Any, wide: bool = False) -> Picture:
    """Without the machine's name, which stands above."""
    figure.suptitle("")
    return Picture(caption, figure, wide=wide)


def _largest(run: xr.Dataset) -> list[tuple[str, list[str]]]:
    """Joints with the largest forces, and the plane to draw them in: that in which most of it lies."""
    forces = [str(name) for name in run.component.values if str(name).startswith("F")]
    values = np.nan_to_num(run.reaction.sel(component=forces).values)
    sizes = np.linalg.norm(values, axis=-1).max(axis=0)
    acts, _ = borne(sizes, np.zeros_like(sizes))
    order = [k for k in np.argsort(-sizes, kind="stable")[:MOST_HODOGRAPHS] if acts[k]]
    if not order:
        return []
    pairs = ["xy"] if len(forces) == 2 else ["xy", "xz", "yz"]
    pair = max(pairs, key=lambda p: sum(float((values[:, order, "xyz".index(x)] ** 2).sum()) for x in p))
    return [(pair, [str(run.joint.values[k]) for k in sorted(order)])]
