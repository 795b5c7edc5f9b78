"""Cylinders of a run: pressures, flows and strokes that are asked of them, beside those that are there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .._cycle.gas import REFERENCE_WORDS
from .._cycle.transmissions import beyond_supply, cylinder, slide_beyond, slide_of
from .._drawing.style import readable
from ..scene import Scene
from .places import place_of
from .sheet import NONE, Cell, Table, cell_of

__all__ = ["Demand", "cylinders_table", "demands"]

Values = NDArray[np.float64]

BAR, LITRE_PER_MINUTE = 1e5, 1e-3 / 60
"""As data sheets have them."""


@dataclass(frozen=True)
class Demand:
    """What a run asks of a cylinder of its scene, along the samples."""

    name: str
    """Of the actuator."""
    supply: float
    """[Pa]"""
    ends: tuple[float, float]
    """Joint variable at the cylinder's ends, the lower first [m]."""
    found: xr.Dataset
    """As `linkdyn.cycle.cylinder` gives it."""
    pressure: Values
    """The larger of both chambers; zero where a sample failed [Pa]."""
    slide: Values | None
    """Joint variable, if it is among the results [m]."""
    above: Values
    """Pressure asked for beyond the supply [Pa]; zero where none is, and of pressures that a run has found."""
    beyond: Values
    """Way of the slide beyond an end [m]; zero where it is within."""


def demands(run: xr.Dataset, scene: Scene | None) -> list[Demand]:
    """Of each cylinder, if the run tells its force and speed."""
    if scene is None or "driving_force" not in run or "driving_speed" not in run or not run.sizes["sample"]:
        return []
    return [_demand(run, scene, own["name"], own["supply"], (own["retracted"], own["extended"]))
            for own in scene.description["cylinders"] if own["name"] in run.actuator.values]


def _demand(run: xr.Dataset, scene: Scene, name: str, supply: float, stroke: tuple[float, float]) -> Demand:
    found = cylinder(run, name, scene)
    pressure = np.nan_to_num(np.maximum(found.head_pressure.values, found.rod_pressure.values))
    slide = slide_of(run, name)
    beyond = np.zeros(len(pressure)) if slide is None else slide_beyond(run, slide, stroke)
    above = np.zeros(len(pressure)) if found.attrs["pressures_found"] else beyond_supply(pressure, supply)
    return Demand(name, supply, (min(stroke), max(stroke)), found, pressure, slide, above, beyond)


def cylinders_table(run: xr.Dataset, scene: Scene | None) -> Table | None:
    """A row for each cylinder."""
    asked = demands(run, scene)
    if not asked:
        return None
    columns: list[tuple[str, list[Cell]]] = []
    for chamber in ("head", "rod"):
        places = [_highest(demand.found[f"{chamber}_pressure"].values) for demand in asked]
        columns.append((f"{chamber}\npeak\n[bar]", [cell_of(value, 1 / BAR, alarm=bool(demand.above.any() and value > demand.supply))
                                                        for demand, (value, _) in zip(asked, places)]))
        columns.append(("at", [Cell(place_of(run, k)) if k >= 0 else Cell(NONE) for _, k in places]))
    columns.append(("supply\n[bar]", [cell_of(demand.supply, 1 / BAR) for demand in asked]))
    for head, name in (("peak", "peak_flow"), ("mean", "mean_flow")):
        columns.append((f"{head}\nflow\n[l/min]", [cell_of(float(demand.found[name]), 1 / LITRE_PER_MINUTE) for demand in asked]))
    power = [_highest(demand.found.hydraulic_power.values)[0] for demand in asked]
    factor, word = readable("W", float(np.nanmax(np.abs(power), initial=0.0)))
    columns.append((f"peak\npower\n[{word}]", [cell_of(value if value > 0 else np.nan, factor) for value in power]))
    columns += _strokes(asked)
    rows = [[Cell(demand.name), *(cells[i] for _, cells in columns)] for i, demand in enumerate(asked)]
    note = "Flow out of the supply, power of the oil or gas above the tank's pressure."
    if any(demand.found.attrs["has_gas"] for demand in asked):
        note += f" Flow of gas is told {REFERENCE_WORDS}."
    if not all(demand.found.attrs["pressures_found"] for demand in asked):
        note = "Pressures are the least that give the force: the other side is at the tank's. " + note
    return Table("Cylinders", ["cylinder at", *(head for head, _ in columns)], rows, note,
                 wide=(0, *(1 + i for i, (head, _) in enumerate(columns) if head == "at")))


def _strokes(asked: list[Demand]) -> list[tuple[str, list[Cell]]]:
    """From where to where the slide goes, and from where to where the cylinder reaches."""
    used = [(np.nan, np.nan) if demand.slide is None or np.isnan(demand.slide).all() else (np.nanmin(demand.slide), np.nanmax(demand.slide)) for demand in asked]
    factor, word = readable("m", float(np.nanmax(np.abs([*used, *(demand.ends for demand in asked)]))))
    columns = []
    for side, head in enumerate(("position\nfrom", "to")):
        columns.append((f"{head}\n[{word}]", [cell_of(place[side], factor, alarm=_is_beyond(demand, side)) for demand, place in zip(asked, used)]))
    for side, head in enumerate(("stroke\nfrom", "to")):
        columns.append((f"{head}\n[{word}]", [cell_of(demand.ends[side], factor) for demand in asked]))
    return columns


def _is_beyond(demand: Demand, side: int) -> bool:
    if demand.slide is None:
        return False
    out = demand.slide[demand.beyond > 0]
    return bool((out > demand.ends[1]).any() if side else (out < demand.ends[0]).any())


def _highest(values: Values) -> tuple[float, int]:
    """And its sample; NaN and -1 where there is none."""
    if np.isnan(values).all():
        return np.nan, -1
    k = int(np.nanargmax(values))
    return float(values[k]), k
