"""What has happened in a run, on its sheet: when, by which impulse, and the largest forces just before and just behind."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .._drawing.style import plain_units, readable
from .._event_sides import EventSides, event_words, events_within
from ..scene import Scene
from .sheet import NONE, Cell, Table, cell_of, count_words, significant

__all__ = ["events_table"]

MOST_EVENTS = 30
"""Rows; of more events those with the largest forces beside them."""
SAME_SPEED = 1e-9
"""Of the largest rate of a run: what changes by less has not jumped."""


def events_table(run: xr.Dataset, scene: Scene | None) -> Table | None:
    """A row for each event within the run's samples."""
    events = events_within(run)
    if not events.size:
        return None
    instants = run.event_time.values
    loads = _loads(run, events)
    impulse, lost = run.event_impulse.values[events], run.event_loss.values[events]
    note = "Forces are those just before and just behind" + ("; that of an impulse is not finite." if (impulse > 0).any() else ".")
    shown = np.arange(len(events))
    if len(events) > MOST_EVENTS:
        sizes = np.max([np.nan_to_num(values / np.nanmax(values, initial=np.finfo(float).tiny)).max(axis=1) for _, _, values, _ in loads], axis=0) if loads else np.zeros(len(events))
        shown = np.sort(np.argsort(-sizes, kind="stable")[:MOST_EVENTS])
        note = f"{MOST_EVENTS} of {count_words(len(events))} events, those with the largest forces beside them. {note}"
    columns: list[tuple[str, list[Cell]]] = [
        ("at [s]", [Cell(f"{instants[events[k]]:.6g}", float(instants[events[k]])) for k in shown]),
        ("what", [Cell(event_words(run, int(events[k]))) for k in shown]),
    ]
    jumps = _jumps(run, events)
    if any(jumps):
        columns.append(("velocity jumps", [Cell(jumps[k] or NONE) for k in shown]))
    if (impulse > 0).any():
        columns.append(("impulse", [_impulse(impulse[k], run, scene, str(run.event.values[events[k]])) for k in shown]))
    if (lost > 0).any():
        factor, shown_unit = readable("J", float(lost.max()))
        columns.append((f"energy\nlost\n[{shown_unit}]", [cell_of(lost[k] if lost[k] > 0 else np.nan, factor) for k in shown]))
    for word, unit, values, where in loads:
        factor, shown_unit = readable(unit, float(np.nanmax(values, initial=0.0)))
        for side, name in enumerate(map(str, run.side.values)):
            columns.append((f"{word}\n{name}\n[{shown_unit}]", [cell_of(values[k, side], factor) for k in shown]))
            columns.append(("in", [Cell(where[k, side] or NONE) for k in shown]))
    words = tuple(i for i, (head, _) in enumerate(columns) if head in ("what", "velocity jumps", "in"))
    rows = [[cells[i] for _, cells in columns] for i in range(len(shown))]
    return Table("Events", [head for head, _ in columns], rows, note, wide=words)


def _impulse(size: float, run: xr.Dataset, scene: Scene | None, name: str) -> Cell:
    """With its unit, as far as the scene tells it."""
    if not size > 0:
        return Cell(NONE)
    known = scene.description if scene is not None else {"clutches": [], "stops": []}
    units = [str(clutch["unit"]) for clutch in known["clutches"] if clutch["name"] == name or clutch["name"].startswith(f"{name}.")]
    if "variable" in run.coords:
        of = dict(zip(map(str, run["variable"].values), map(str, run.variable_unit.values)))
        units += [{"m": "N", "rad": "N m"}[of[stop["variable"]]] for stop in known["stops"] if stop["name"] == name and stop["variable"] in of]
    unit = "N s or N m s" if not units else "N s" if "N" in units else "N m s"
    return Cell(f"{significant(size)} {plain_units(unit)}", size)


def _loads(run: xr.Dataset, events: NDArray[np.intp]) -> list[tuple[str, str, NDArray[np.float64], NDArray[np.str_]]]:
    """Largest forces on both sides: what they are, their unit, (event, side) their sizes, and which joint or drive has each."""
    sides = EventSides.of(run)
    found = []

    def add(word: str, unit: str, size: NDArray[np.float64], names: NDArray[np.str_]) -> None:
        ranked = np.where(np.isfinite(size), size, -1.0)
        at = ranked.argmax(axis=1)
        most = ranked[np.arange(len(at)), at]
        if most.max(initial=0.0) > 0:
            there = most > 0
            found.append((word, unit, np.where(most >= 0, most, np.nan).reshape(-1, 2), np.where(there, names[at], "").reshape(-1, 2)))

    if "reaction" in run and len(rows := sides.rows("reaction")):
        forces = [k for k, name in enumerate(run.component.values) if str(name).startswith("F")]
        add("joint force", "N", np.linalg.norm(rows[..., forces], axis=-1), run.joint.values.astype(str))
    if "driving_force" in run and len(rows := np.abs(sides.rows("driving_force"))):
        units = run.actuator_unit.values.astype(str)
        for unit, word in (("N", "driving\nforce"), ("N m", "driving\ntorque")):
            if (of := units == unit).any():
                add(word, unit, rows[:, of], run.actuator.values.astype(str)[of])
    return found


def _jumps(run: xr.Dataset, events: NDArray[np.intp]) -> list[str]:
    """The coordinate whose rate jumps most, from which to which; empty where none does."""
    before, behind = run.event_qd.values[events], run.event_qd_after.values[events]
    largest = np.maximum(np.abs(before), np.abs(behind)).max(axis=0, initial=0.0)
    found = []
    for one, other in zip(before, behind):
        parts = np.abs(other - one) / np.where(largest > 0, largest, 1.0)
        k = int(parts.argmax()) if parts.size else 0
        if not parts.size or not parts[k] > SAME_SPEED:
            found.append("")
            continue
        unit = str(run.coordinate_unit.values[k])
        factor, word = readable(f"{unit}/s", float(max(abs(one[k]), abs(other[k]))))
        found.append(f"{run.coordinate.values[k]}: {factor * one[k]:.4g} to {factor * other[k]:.4g} {word}".replace("-", "−"))
    return found
