"""The sheet of a sweep: what a machine asks of its actuators and joints, on one page to hand on.

Here stands what is on the sheet; `html` and `pdf` draw it. That of a run is in `run_sheet`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .._drawing.arguments import checked
from .._drawing.style import readable
from .._drawing.sweep_data import axis_names, describe_place, entries_of, mapped_axes, need_sweep, one_design
from .._output import write_output
from .._printable import printable
from ..errors import InputError
from ..results import inputs_of
from ..scene import Scene

__all__ = ["NONE", "Cell", "Page", "Picture", "Table", "cell_of", "count_words", "limits_table", "machine_picture", "provenance", "sheet", "sheet_page", "sheet_path", "significant"]

NONE = "–"
BOLD = 1.15
"""Width of a bold letter, that of another being 1."""
MOST_DESIGNS = 80
"""Rows of a table of designs; of more, those of the Pareto front."""
FORCES = ("driving_force", "driving_position", "driving_speed", "driving_power")


@dataclass(frozen=True)
class Cell:
    """What is written, and the number behind it in SI units."""

    text: str
    value: float | None = None
    alarm: bool = False
    """Beyond what is allowed."""


@dataclass(frozen=True)
class Table:
    title: str
    head: list[str]
    rows: list[list[Cell]]
    note: str = ""
    wide: tuple[int, ...] = (0,)
    """Columns of words: aligned to the left."""

    def letters(self, whole: float) -> NDArray[np.float64]:
        """Letters in a line of each column; the longest columns give way until all fit in ``whole``."""
        wanted = np.array([
            max([*(BOLD * len(line) for line in head.split("\n")), *((BOLD if row[k].alarm else 1.0) * len(row[k].text) for row in self.rows)]) + 2.5
            for k, head in enumerate(self.head)
        ])
        if wanted.sum() <= whole:
            return wanted
        low, high = 0.0, float(wanted.max())
        for _ in range(30):
            middle = (low + high) / 2
            low, high = (low, middle) if np.minimum(wanted, middle).sum() > whole else (middle, high)
        narrowed: NDArray[np.float64] = np.minimum(wanted, low)
        return narrowed


@dataclass(frozen=True)
class Picture:
    caption: str
    figure: Any
    raster: bool = False
    """Better as pixels: spatial drawings."""
    wide: bool = False
    """Over the whole page: many panels."""


@dataclass
class Page:
    title: str
    lines: list[str] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


@checked
def sheet(run: xr.Dataset, file: str | os.PathLike[str], *, design: int | None = None, scene: Scene | None = None) -> Path:
    """Write the sheet of a run or of a sweep: what a machine asks of its drives and joints, with pictures inside the file.

    Of a run: drives, motors, cylinders and bearings with their peaks, where they are, rms values and power; transmission angles, shaking force; limits that the scene's ``[sweep]``
    states and where they are exceeded; samples that failed. Of a sweep, per actuator: push, pull and where, rms, stroke, speed, power; joint loads and swing; limits with
    margins; why poses are not feasible; worst load directions.

    Parameters
    ----------
    run
        Results of `Scene.inverse`, `Scene.forward` or `Scene.sweep`, or of the executable.
    file
        Ends in .html (self-contained) or .pdf.
    design
        Number of the design in a sweep of several; without it their comparison is written.
    scene
        For a drawing of the machine; default: as kept in the results, if it needs no other files.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    InputError
        No results of a run or a sweep, no such design, another ending; a run without driving forces and reactions.
    FileError
        The file cannot be written, or is one that was read.
    """
    from matplotlib import pyplot

    path = sheet_path(file, "sheet")
    renderers = {".html": _html, ".pdf": _pdf}
    page = sheet_page(run, design=design, scene=scene)
    try:
        data = renderers[path.suffix.lower()](page)
    finally:
        for picture in page.pictures:
            pyplot.close(picture.figure)
    write_output(path, data, inputs_of(run, scene))
    return path


def sheet_path(file: str | os.PathLike[str], caller: str) -> Path:
    """The file, if a sheet may be called so."""
    path = Path(file)
    if path.suffix.lower() not in (".html", ".pdf"):
        raise InputError(f"{caller}: {str(path)!r} (expected a file that ends in .html or .pdf)")
    return path


def _html(page: Page) -> bytes:
    from .html import html

    return html(page).encode()


def _pdf(page: Page) -> bytes:
    from .pdf import pdf

    return pdf(page)


@checked
def sheet_page(run: xr.Dataset, *, design: int | None = None, scene: Scene | None = None) -> Page:
    """What stands on the sheet; arguments as for `sheet`."""
    if scene is not None and "coordinate" in run and sorted(map(str, run.coordinate.values)) != sorted(scene.coordinates):
        raise InputError("sheet: scene: it has other coordinates than the run (expected the scene of the run)")
    if "status" in run:
        if design is not None:
            raise InputError("sheet: design: these are results of a run, which has one design")
        if "qdd" not in run:
            raise InputError("sheet: the run has no accelerations (expected results of inverse or forward)")
        from .run_sheet import run_page

        return run_page(run, scene)
    need_sweep(run, "sheet")
    if "design" in run.dims and design is None and run.sizes["design"] > 1:
        return _comparison(run)
    data = one_design(run, design, "sheet")
    page = Page(printable(str(run.attrs.get("title") or "Sweep")))
    page.lines = _facts(run, data, design)
    tables = [
        *_actuators(data),
        *_places(data),
        _joints(data),
        limits_table(data),
        _outcomes(data),
        _amplification(data),
        _quality(data),
        _axes(run),
    ]
    page.tables = [table for table in tables if table is not None]
    page.pictures = _pictures(run, data, design, scene)
    page.notes = _notes(run, data)
    return page


# ---------------------------------------------------------------- head

def _facts(run: xr.Dataset, data: xr.Dataset, design: int | None) -> list[str]:
    n, feasible = int(data.samples), int(data.outcome_count.values[0])
    first = f"{count_words(n)} samples, {count_words(feasible)} feasible ({_percent(feasible, n)})"
    if "feasible_volume" in data:
        unit = str(data.feasible_volume.attrs["units"]).replace("m2", "m²").replace("m3", "m³")
        first += f", {float(data.feasible_volume):.4g} of {float(data.swept_volume):.4g} {unit}"
    lines = [first]
    if "design" in run.dims:
        values = run.design_value.values[design or 0]
        words = [f"{name} = {number_words(value, unit)}" for name, value, unit in zip(run.parameter.values, values, run.parameter_unit.values)]
        lines.append(f"design {design or 0}: " + ", ".join(words))
    return [*lines, provenance(run)]


def provenance(run: xr.Dataset) -> str:
    """How and when the results were computed."""
    gravity = ", ".join(f"{value:g}" for value in np.atleast_1d(run.attrs.get("gravity", [])))
    return (
        f"gravity ({gravity}) m/s², solver {run.attrs.get('solver', '?')}, linkdyn {run.attrs.get('linkdyn_version', '?')}, "
        f"{str(run.attrs.get('history', ''))[:10]}"
    )


def _notes(run: xr.Dataset, data: xr.Dataset) -> list[str]:
    notes = [
        "Push (positive) acts in the direction of increasing joint variable, pull (negative) against it. Extremes, means and rms values are over the "
        f"{count_words(int(data.samples_reduced))} samples within all constraints; rms values are those of a duty cycle only if the "
        "samples are one.",
    ]
    if "reaction_force_max" in data:
        notes.append("Joint loads are without the driving force of a driven joint; components in world axes.")
    wishes = {"reaction": "joint loads by component", "reaction_force": "joint forces", "reaction_moment": "joint moments",
              "driving_speed": "speeds", "driving_power": "powers", "driving_position": "strokes"}
    if run.attrs.get("space") == "spatial":
        wishes |= {"swing": "joint swing", "clearance": "gaps between legs"}
    missing = [f"{words} ({name})" for name, words in wishes.items() if f"{name}_max" not in data]
    if missing:
        notes.append("Not in this sweep's 'reduce': " + ", ".join(missing) + ".")
    return notes


# ---------------------------------------------------------------- actuators

def _actuators(data: xr.Dataset) -> list[Table]:
    """One table for actuators that push, one for those that turn."""
    if not any(f"{name}_max" in data for name in FORCES):
        return []
    forces = _units(data, "driving_force", data.sizes["actuator"]) if "driving_force_max" in data else [""] * data.sizes["actuator"]
    return [_actuator_table(data, [k for k, unit in enumerate(forces) if unit == wanted], wanted) for wanted in dict.fromkeys(forces)]


def _actuator_table(data: xr.Dataset, chosen: list[int], unit: str) -> Table:
    names = [str(data.actuator.values[k]) for k in chosen]
    columns: list[tuple[str, list[Cell]]] = []

    def add(quantity: str, parts: Sequence[tuple[str, NDArray[np.float64]]]) -> None:
        if f"{quantity}_max" not in data:
            return
        values = [value for _, value in parts]
        factor, word = readable(_units(data, quantity, data.sizes["actuator"])[chosen[0]], float(np.nanmax(np.abs(values), initial=0.0)))
        columns.extend((f"{head}\n[{word}]", [cell_of(value, factor) for value in value_of]) for head, value_of in parts)

    def of(name: str) -> NDArray[np.float64]:
        return data[name].values[chosen] if name in data else np.full(len(chosen), np.nan)

    push, pull = of("driving_force_max"), of("driving_force_min")
    words = ("driving torque +", "driving torque −") if unit == "N m" else ("peak push", "peak pull")
    add("driving_force", [(words[0], np.where(push > 0, push, np.nan)), (words[1], np.where(pull < 0, pull, np.nan)), ("rms", of("driving_force_rms"))])
    low, high = of("driving_position_min"), of("driving_position_max")
    add("driving_position", [("position from", low), ("to", high), ("stroke", high - low)])
    slow, fast = of("driving_speed_min"), of("driving_speed_max")
    add("driving_speed", [("peak speed", np.fmax(np.abs(slow), np.abs(fast)))])
    back, there = of("driving_power_min"), of("driving_power_max")
    add("driving_power", [("power in", np.where(there > 0, there, np.nan)), ("power back", np.where(back < 0, back, np.nan))])
    if "regenerative_share" in data:
        columns.append(("regenerative\nshare [%]", [cell_of(value, 100.0, digits=3) for value in of("regenerative_share")]))
    rows = [[Cell(name), *(cells[k] for _, cells in columns)] for k, name in enumerate(names)]
    return Table("Actuators", ["actuator", *(head for head, _ in columns)], rows)


def _places(data: xr.Dataset) -> list[Table]:
    """Where the strongest push and pull are."""
    if "driving_force_max" not in data:
        return []
    rows = []
    for k, name in enumerate(map(str, data.actuator.values)):
        cells = [Cell(name)]
        for side, sign in (("max", 1), ("min", -1)):
            acts = sign * data[f"driving_force_{side}"].values[k] > 0
            cells.append(Cell(describe_place(data, data[f"driving_force_{side}_at"].values[k]) if acts else NONE))
        rows.append(cells)
    return [Table("Where the peaks are", ["actuator", "strongest push at", "strongest pull at"], rows, wide=(0, 1, 2))]


# ---------------------------------------------------------------- joints

def _joints(data: xr.Dataset) -> Table | None:
    """A row for like joints (leg1.U ... leg6.U), with the worst of them named."""
    if "joint" not in data.dims:
        return None
    groups: dict[str, list[int]] = {}
    for k, name in enumerate(map(str, data.joint.values)):
        groups.setdefault(re.sub(r"\d+(?=[^.]*\.)", "*", name), []).append(k)
    columns: list[tuple[str, list[Cell]]] = []
    for quantity, word in (("reaction_force", "peak force"), ("reaction_moment", "peak moment")):
        if f"{quantity}_max" not in data:
            continue
        peaks = data[f"{quantity}_max"].values
        factor, unit = readable("N" if quantity == "reaction_force" else "N m", float(np.nanmax(peaks, initial=0.0)))
        worst = [max(members, key=lambda k: np.nan_to_num(peaks[k], nan=-1.0)) for members in groups.values()]
        columns.append((f"{word}\n[{unit}]", [cell_of(peaks[k], factor) for k in worst]))
        columns.append(("in", [Cell(str(data.joint.values[k]) if peaks[k] > 0 else NONE) for k in worst]))
    if "reaction_max" in data:
        for i, component in enumerate(map(str, data.component.values)):
            peaks = np.fmax(np.abs(data.reaction_min.values[:, i]), np.abs(data.reaction_max.values[:, i]))
            factor, unit = readable("N" if component.startswith("F") else "N m", float(np.nanmax(peaks, initial=0.0)))
            columns.append((f"|{component}|\n[{unit}]", [cell_of(np.nanmax(peaks[members], initial=0.0), factor) for members in groups.values()]))
    if "swing_max" in data:
        swing = dict(zip(map(str, data.swing_joint.values), data.swing_max.values))
        joints = [[swing.get(str(data.joint.values[k]), np.nan) for k in members] for members in groups.values()]
        columns.append(("swing\n[deg]", [cell_of(max((v for v in values if v == v), default=np.nan), 180 / np.pi) for values in joints]))
    if not columns:
        return None
    rows = [[Cell(name), *(cells[k] for _, cells in columns)] for k, name in enumerate(groups)]
    words = tuple(1 + k for k, (head, _) in enumerate(columns) if head == "in")
    return Table("Joint loads", ["joint", *(head for head, _ in columns)], rows, wide=(0, *words))


# ---------------------------------------------------------------- limits

def limits_table(data: xr.Dataset) -> Table | None:
    if "bound" not in data.dims:
        return None
    rows = []
    codes = data.outcome_count.values[-data.sizes["bound"] :]
    n = int(data.samples)
    for k, name in enumerate(map(str, data.bound.values)):
        quantity, unit = str(data.bound_of.values[k]), str(data.bound_unit.values[k])
        low, high = float(data.bound_min.values[k]), float(data.bound_max.values[k])
        lowest, highest, where = _found(data, quantity, str(data.bound_at.values[k]), low, high)
        factor, word = readable(unit, float(np.nanmax(np.abs([low, high]))))
        margin = _margin(low, high, lowest, highest)
        beyond = margin < 0
        rows.append([
            Cell(name),
            Cell("limit" if data.bound_is_limit.values[k] else "constraint"),
            cell_of(low, factor), cell_of(high, factor), Cell(word),
            cell_of(lowest, factor, alarm=lowest < low), cell_of(highest, factor, alarm=highest > high),
            Cell(where),
            Cell(_tenths(100 * margin), margin, beyond) if np.isfinite(margin) else Cell(NONE),
            Cell(count_words(int(codes[k])), float(codes[k])),
            Cell(_percent(int(codes[k]), n)),
        ])
    head = ["", "kind", "allowed\nfrom", "to", "unit", "found\nfrom", "to", "nearest in", "margin\n[%]", "samples\nbeyond", "share"]
    note = ("Margin: what is left of the allowed value at the nearest extreme. Poses beyond a constraint are left out of all extremes, "
            "those beyond a limit are not. A sample counts for the first bound it breaks.")
    return Table("Limits", head, rows, note, wide=(0, 1, 4, 7))


def _found(data: xr.Dataset, quantity: str, at: str, low: float, high: float) -> tuple[float, float, str]:
    """Extremes of the entries that are bounded, and which entry has the least margin."""
    labels = entries_of(data, f"{quantity}_max")
    lowest, highest = data[f"{quantity}_min"].values.reshape(-1), data[f"{quantity}_max"].values.reshape(-1)
    chosen = list(range(len(labels)))
    if at:
        wanted = at.split(", ")
        if not set(wanted) <= set(labels):
            return np.nan, np.nan, NONE
        chosen = [labels.index(name) for name in wanted]
    margins = [_margin(low, high, lowest[k], highest[k]) for k in chosen]
    tightest = chosen[int(np.nanargmin(margins))] if np.isfinite(margins).any() else None
    found = [values[chosen] for values in (lowest, highest)]
    if not np.isfinite(found).any():
        return np.nan, np.nan, NONE
    return float(np.nanmin(found[0])), float(np.nanmax(found[1])), labels[tightest] or NONE if tightest is not None else NONE


def _margin(low: float, high: float, lowest: float, highest: float) -> float:
    """Share of the allowed value that is left, at the end where less is left; NaN if an allowed value is 0."""
    left = [(lowest - low) / abs(low)] if low == low and low != 0 else []
    left += [(high - highest) / abs(high)] if high == high and high != 0 else []
    return float(np.nanmin(left)) if left and np.isfinite(left).any() else np.nan


def _tenths(value: float) -> str:
    return f"{round(value, 1) + 0.0:.1f}".replace("-", "−")


def _outcomes(data: xr.Dataset) -> Table:
    n = int(data.samples)
    counts = data.outcome_count.values
    rows = [
        [Cell(str(name).replace("_", " ")), Cell(count_words(int(count)), float(count)), Cell(_percent(int(count), n))]
        for name, count in zip(data.outcome.values, counts)
        if count > 0
    ]
    return Table("Feasibility", ["outcome", "samples", "share"], rows)


# ---------------------------------------------------------------- worst load, condition

def _amplification(data: xr.Dataset) -> Table | None:
    kinds = [kind for kind in ("force", "moment") if f"{kind}_amplification_max" in data]
    if not kinds:
        return None
    head, columns = ["actuator"], []
    wide = [0]
    for kind in kinds:
        name = f"{kind}_amplification"
        units = _units(data, name, data.sizes["actuator"])
        load = "N" if kind == "force" else "N·m"
        same = all(unit == units[0] for unit in units)
        head += [f"per unit {kind}\n[{_ratio(units[0], load) if same else 'SI'}]", "worst direction (x, y, z)"]
        columns.append([cell_of(value) for value in data[f"{name}_max"].values])
        directions = data[f"{name}_direction"].values
        columns.append([Cell(NONE if np.isnan(row).any() else f"({', '.join(_component(v) for v in row)})") for row in directions])
        wide.append(2 * (kinds.index(kind) + 1))
    rows = [[Cell(str(name)), *(column[k] for column in columns)] for k, name in enumerate(data.actuator.values)]
    where = f" on {data.attrs['tool']}" if data.attrs.get("tool") else ""
    note = "The largest driving force over all directions of a unit load, at the worst pose; the opposite direction asks the opposite."
    return Table(f"Worst load{where}", head, rows, note, wide=tuple(wide))


def _component(value: float) -> str:
    return f"{round(float(value), 2) + 0.0:.2f}".replace("-", "−")


def _ratio(unit: str, load: str) -> str:
    """ "N per N" of the unit 1."""
    return {"1": f"N per {load}" if load == "N" else "N·m per N·m", "1/m": "N per N·m", "m": "N·m per N"}.get(unit, unit)


def _quality(data: xr.Dataset) -> Table | None:
    rows = []
    for quantity, side, words in (
        ("condition", "max", "largest condition number"),
        ("determinant", "min", "smallest determinant"),
        ("determinant", "max", "largest determinant"),
        ("clearance", "min", "smallest gap between legs"),
    ):
        if f"{quantity}_{side}" not in data:
            continue
        value = float(data[f"{quantity}_{side}"])
        factor, unit = readable(str(data[f"{quantity}_{side}"].attrs["units"]), abs(value))
        cell = cell_of(value, factor)
        rows.append([Cell(words), Cell(f"{cell.text} {unit}".strip(), cell.value), Cell(describe_place(data, data[f"{quantity}_{side}_at"].values))])
    if "sign_changes" in data:
        n = int(data.sign_changes)
        rows.append([Cell("singularities crossed between neighbours"), Cell(count_words(n), float(n), n > 0), Cell(NONE)])
    if not rows:
        return None
    note = ""
    if "characteristic_length" in data.attrs:
        length = float(np.atleast_1d(data.attrs["characteristic_length"])[0])
        note = f"Lengths over the characteristic length {length:.4g} m."
    return Table("Distance from singularities and collisions", ["", "value", "at"], rows, note, wide=(0, 2))


# ---------------------------------------------------------------- axes

def _axes(run: xr.Dataset) -> Table:
    """What was swept: axes of their own in one row, axes that advance together in another."""
    names, groups, sizes = axis_names(run), run.axis_group.values, run.axis_size.values
    members = [[k for k in range(len(names)) if groups[k] == group] for group in dict.fromkeys(groups.tolist())]
    alone = [group[0] for group in members if len(group) == 1]
    rows = []
    if alone:
        words = "; ".join(f"{names[k]} {_range(run, k)} ({count_words(int(sizes[k]))}{_sampling(run, k)})" for k in alone)
        rows.append((f"all of {words}", int(np.prod(sizes[alone]))))
    for group in members:
        if len(group) > 1:
            words = "; ".join(f"{names[k]} {_range(run, k)}{_sampling(run, k)}" for k in group)
            rows.append((f"together {words}", int(sizes[group[0]])))
    return Table("Swept", ["axes", "values"], [[Cell(words), Cell(count_words(n), float(n))] for words, n in rows])


def _sampling(run: xr.Dataset, k: int) -> str:
    sampling = str(run.axis_sampling.values[k])
    return "" if sampling in ("linspace", "values") else f", {sampling}"


def _range(run: xr.Dataset, k: int) -> str:
    low, high = float(run.axis_low.values[k]), float(run.axis_high.values[k])
    unit = str(run.axis_unit.values[k])
    factor, word = readable(unit, max(abs(low), abs(high))) if unit != "SI" else (1.0, "")
    if low == -high and high != 0:
        return f"±{high * factor:.4g} {word}".strip()
    text = f"{low * factor:.4g}" + (f" to {high * factor:.4g}" if low != high else "")
    return f"{text} {word}".strip().replace("-", "−")


# ---------------------------------------------------------------- several designs

def _comparison(run: xr.Dataset) -> Page:
    from .._drawing import sweep_plots

    n = run.sizes["design"]
    page = Page(printable(str(run.attrs.get("title") or "Sweep")))
    total, feasible = int(run.samples.sum()), int(run.outcome_count.values[:, 0].sum())
    page.lines = [f"{n} designs, {count_words(total)} samples, {count_words(feasible)} feasible ({_percent(feasible, total)})"]
    columns = _design_columns(run)
    gain = sweep_plots.usual_gain(run)
    front: list[int] = []
    if "driving_force_max" in run:
        cost, _ = sweep_plots._score(run, "driving_force")
        front = sweep_plots.pareto_front(cost, run[gain].values).tolist()
        page.pictures = [Picture("Peak force against workspace", sweep_plots.designs(run, gain=gain)[0])]
    shown = list(range(n)) if n <= MOST_DESIGNS else front or list(range(MOST_DESIGNS))
    rows = [
        [Cell(f"{k} ●" if k in front else str(k), float(k)), *(cells[k] for _, cells in columns)] for k in shown
    ]
    note = "● no other design has a smaller peak force and a larger feasible part (Pareto front)." if front else ""
    if len(shown) < n:
        note += f" {len(shown)} of {n} designs are shown."
    page.tables = [Table("Designs", ["design", *(head for head, _ in columns)], rows, note), _axes(run)]
    page.notes = ["The sheet of one design: linkdyn.sheet(run, file, design=NUMBER)."]
    return page


def _design_columns(run: xr.Dataset) -> list[tuple[str, list[Cell]]]:
    n = run.sizes["design"]
    columns = []
    for k, name in enumerate(map(str, run.parameter.values)):
        values, unit = run.design_value.values[:, k], str(run.parameter_unit.values[k])
        factor, word = readable(unit, float(np.abs(values).max())) if unit != "SI" else (1.0, "")
        columns.append((f"{name}\n[{word}]" if word else name, [cell_of(value, factor) for value in values]))

    def add(head: str, values: NDArray[np.float64], unit: str) -> None:
        factor, word = readable(unit, float(np.nanmax(np.abs(values), initial=0.0)))
        columns.append((f"{head}\n[{word}]" if word else head, [cell_of(value, factor) for value in values]))

    for quantity, sides in (
        ("driving_force", (("max", "peak push"), ("min", "peak pull"))),
        ("driving_position", (("min", "position from"), ("max", "to"))),
        ("driving_speed", (("max", "peak speed"),)),
        ("condition", (("max", "condition"),)),
    ):
        for side, head in sides:
            if f"{quantity}_{side}" not in run:
                continue
            values = run[f"{quantity}_{side}"].values.reshape(n, -1)
            if quantity == "driving_speed":
                values = np.fmax(np.abs(values), np.abs(run[f"{quantity}_min"].values.reshape(n, -1)))
            worst = np.array([np.nan if np.isnan(row).all() else np.nanmin(row) if side == "min" else np.nanmax(row) for row in values])
            add(head, worst, _units(run, quantity, values.shape[1])[0])
    columns.append(("feasible\n[%]", [cell_of(value, 100.0) for value in run.feasible_fraction.values]))
    if "feasible_volume" in run:
        unit = str(run.feasible_volume.attrs["units"]).replace("m2", "m²").replace("m3", "m³")
        columns.append((f"feasible\n[{unit}]", [cell_of(value) for value in run.feasible_volume.values]))
    return columns


# ---------------------------------------------------------------- pictures

def _pictures(run: xr.Dataset, data: xr.Dataset, design: int | None, scene: Scene | None) -> list[Picture]:
    from .._drawing import sweep_plots

    pictures = []
    drawing = machine_picture(run, scene)
    if drawing is not None:
        pictures.append(drawing)
    if "driving_force_max" in data:
        pictures.append(Picture("Push, pull and rms of each actuator", _bars(data)))
    if "driving_force_histogram" in data:
        pictures.append(Picture("How often which force", sweep_plots.histograms(run, design=design)[0]))
    has_samples = "sample_axis" in run and "design" not in run.dims
    places = [name for name, size in zip(axis_names(run), run.axis_size.values) if size > 1 and " " not in name]
    if len(mapped_axes(run, "driving_force")) in (2, 3) or has_samples and "driving_force" in run and len(places) >= 2:
        pictures.append(Picture("Peak force over the workspace", sweep_plots.workspace(run, design=design)[0]))
    if has_samples and sweep_plots._has_samples(run):
        pictures.append(Picture("Force and speed", sweep_plots.sizing(run)[0]))
    return pictures


def machine_picture(run: xr.Dataset, scene: Scene | None) -> Picture | None:
    """The scene as it starts, if it can be read and assembled."""
    from .._drawing.mechanisms import mechanism
    from ..errors import LinkdynError

    try:
        figure, _ = mechanism(scene or Scene(str(run.attrs["scene"]) + "\n"))
    except (LinkdynError, KeyError):
        return None
    return Picture("The machine where it starts", figure, raster=True)


def _bars(data: xr.Dataset) -> Any:
    """Push to the right, pull to the left, a mark at rms; one panel for each unit of force."""
    from matplotlib import pyplot

    from .._drawing.style import COLOURS

    units = _units(data, "driving_force", data.sizes["actuator"])
    kinds = list(dict.fromkeys(units))
    figure, axes = pyplot.subplots(
        len(kinds), squeeze=False, figsize=(6.4, 0.9 + 0.35 * len(units) + 0.5 * len(kinds)), layout="constrained",
        height_ratios=[units.count(kind) for kind in kinds],
    )
    for axis, kind in zip(axes[:, 0], kinds):
        chosen = [k for k, unit in enumerate(units) if unit == kind]
        push, pull = (np.nan_to_num(data[f"driving_force_{side}"].values[chosen]) for side in ("max", "min"))
        factor, word = readable(kind, float(max(push.max(), -pull.min(), 0.0)))
        place = np.arange(len(chosen))
        axis.barh(place, np.maximum(push, 0) * factor, color=COLOURS[1], height=0.62, label="push")
        axis.barh(place, np.minimum(pull, 0) * factor, color=COLOURS[0], height=0.62, label="pull")
        if "driving_force_rms" in data:
            axis.plot(data.driving_force_rms.values[chosen] * factor, place, "D", color="black", markersize=4, markeredgecolor="white", label="rms")
        axis.axvline(0.0, color="0.3", linewidth=0.8)
        axis.set_yticks(place, [str(data.actuator.values[k]) for k in chosen], parse_math=False)
        axis.invert_yaxis()
        axis.set_xlabel(f"driving {'torque' if kind == 'N m' else 'force'} [{word}]")
        axis.grid(True, axis="x", color="0.92", linewidth=0.6)
        axis.set_axisbelow(True)
        axis.spines[["top", "right", "left"]].set_visible(False)
    axes[0, 0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False, fontsize="small")
    return figure


# ---------------------------------------------------------------- words and numbers

def _units(data: xr.Dataset, quantity: str, n: int) -> list[str]:
    """Unit of each of n entries."""
    if f"{quantity}_unit" in data.variables:
        return [str(unit) for unit in data[f"{quantity}_unit"].values.flat]
    return [str(data[f"{quantity}_max"].attrs["units"])] * n


def cell_of(value: float, factor: float = 1.0, digits: int = 4, alarm: bool = False) -> Cell:
    """A number with some digits; a dash if there is none."""
    number = float(value)
    if not np.isfinite(number):
        return Cell(NONE)
    return Cell(significant(number * factor, digits), number, bool(alarm))


def significant(value: float, digits: int = 4) -> str:
    """Rounded to so many digits, without exponent where people write none."""
    if value == 0.0:
        return "0"
    if not 1e-4 <= abs(value) < 1e7:
        return f"{value:.{digits - 1}e}".replace("-", "−")
    places = max(0, digits - 1 - int(np.floor(np.log10(abs(value)))))
    return f"{round(value, places):.{places}f}".replace("-", "−")


def number_words(value: float, unit: str) -> str:
    factor, word = readable(unit, abs(value)) if unit != "SI" else (1.0, "")
    return f"{significant(value * factor)} {word}".strip()


def count_words(n: int) -> str:
    """ "11 114 334": groups of three, with narrow blanks."""
    return f"{n:,}".replace(",", "\u202f")


def _percent(n: int, total: int) -> str:
    share = 100.0 * n / max(1, total)
    if n and share < 0.01:
        return "< 0.01 %"
    return f"{share:.3g} %"
