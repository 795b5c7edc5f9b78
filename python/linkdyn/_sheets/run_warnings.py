"""What the sheet of a run tells before its numbers: what failed, what was chosen, what is asked of parts beyond what they can."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .._cycle.averages import good_samples
from .._drawing.style import readable
from .._drawing.sweep_data import describe_place
from .._event_sides import EventSides
from ..scene import Scene
from .cylinder_sheet import demands
from .places import place_of
from .sheet import Cell, Table, count_words

__all__ = ["ROUNDED", "warnings_table"]

ROUNDED = 1e-9
"""Of a torque, pressure or force: what is saturated at its limit is not beyond it."""
IMBALANCE = 1e-9
"""Of the power, as a part of its terms: rounding leaves some 1e-15."""


def warnings_table(run: xr.Dataset, scene: Scene | None, limits: xr.Dataset | None) -> Table | None:
    """What a designer must know before the numbers; nothing where there is nothing."""
    rows: list[tuple[str, str]] = []
    bad = ~good_samples(run)
    if bad.any():
        meanings = str(run.status.attrs.get("flag_meanings", "")).split()
        kinds = ", ".join(dict.fromkeys(meanings[code] if code < len(meanings) else str(code) for code in run.status.values[bad]))
        why = f": {run.attrs['failure']}" if run.attrs.get("failure") else ""
        rows.append((f"{count_words(int(bad.sum()))} of {count_words(len(bad))} samples failed ({kinds})", f"first at {place_of(run, int(bad.argmax()))}{why}"))
    if run.attrs.get("stopped"):
        rows.append(("the run stopped before its end", str(run.attrs["stopped"])))
    if coarse := str(run.attrs.get("coarse_sampling", "")):
        rows.append((f"the sampling is coarse: {coarse.partition(' (')[0]}", coarse.partition(" (")[2].removesuffix(")")))
    for name, words in (("change_points_passed", "change points passed"), ("assemblies_found_anew", "assemblies closed again from the start")):
        if n := int(run.attrs.get(name, 0)):
            code = 1 if name == "change_points_passed" else 2
            first = int((run.assembly.values == code).argmax()) if "assembly" in run else 0
            rows.append((f"{n} {words}", f"first at {place_of(run, first)}"))
    if "power_imbalance" in run:
        worst = np.nan_to_num(np.abs(run.power_imbalance.values))
        if worst.size and worst.max() > IMBALANCE:
            rows.append((f"the power balance is off by {worst.max():.2g} of its terms", f"at {place_of(run, int(worst.argmax()))}"))
    if shared := str(run.attrs.get("shared_reactions", "")):
        joints = list(dict.fromkeys(name.rpartition(".")[0] for name in shared.split(" ") if not name.endswith(".driving_force")))
        taken = {"stiffness": "the least elastic energy"}.get(str(run.attrs["redundancy"]), "the least sum of squares")
        felt = ", and all forces depend on it by friction" if ".driving_force" in shared else ""
        rows.append((f"reactions of {len(joints)} joints are not determined by the equations: taken is {taken}{felt}", ", ".join(joints)))
    rows += [*_stops_passed(run), *_overloads(run), *_cylinders(run, scene), *_limited(run), *_lifts(run, scene)]
    rows += _beyond(limits) if limits is not None else []
    if not rows:
        return None
    return Table("Warnings", ["what", "where"], [[Cell(what, alarm=True), Cell(where)] for what, where in rows], wide=(0, 1))


def _overloads(run: xr.Dataset) -> list[tuple[str, str]]:
    """Motors of which more torque is asked than they have at their speed, each with the worst sample."""
    if "torque_margin" not in run or not run.sizes["sample"]:
        return []
    rows, n, sides = [], run.sizes["sample"], EventSides.of(run)
    for k, name in enumerate(map(str, run.motor.values)):
        torque, margin = np.abs(sides.behind("motor_torque")[:, k]), np.nan_to_num(sides.behind("torque_margin")[:, k], nan=np.inf)
        short = margin < -ROUNDED * torque
        if not short.any():
            continue
        worst = int(margin.argmin())
        factor, word = readable("N m", float(torque[worst]))
        of = f"in {count_words(int(short[:n].sum()))} of {count_words(n)} samples" if short[:n].any() else "beside events"
        rows.append((f"the motor of {name} is overloaded {of}: {torque[worst] * factor:.4g} {word}, "
                     f"available {max(0.0, torque[worst] + margin[worst]) * factor:.4g} {word}", _most_and_first(run, worst, short)))
    return rows


def _stops_passed(run: xr.Dataset) -> list[tuple[str, str]]:
    """End stops with restitution that a given motion passes, as the run tells them."""
    told = [text.rpartition(", first at ") for text in str(run.attrs.get("beyond_stops", "")).split("; ") if text]
    return [(f"the motion passes the end stop {what}", f"first at {where.removeprefix('t = ')}") for what, _, where in told]


def _cylinders(run: xr.Dataset, scene: Scene | None) -> list[tuple[str, str]]:
    """Cylinders of which more pressure is asked than their supply has, or a place beyond their ends."""
    rows = []
    for demand in demands(run, scene):
        found = [("above supply", demand.above, f"{demand.pressure.max(initial=0.0) / 1e5:.4g} bar", f"{demand.supply / 1e5:.4g} bar")]
        if demand.slide is not None:
            worst = float(demand.slide[np.nan_to_num(demand.beyond).argmax()])
            factor, word = readable("m", max(abs(end) for end in (worst, *demand.ends)))
            low, high = (f"{end * factor:.6g}" for end in demand.ends)
            found.append(("beyond stroke", demand.beyond, f"{worst * factor:.6g} {word}", f"{low} {word} to {high} {word}"))
        for words, excess, asked, there in found:
            short = excess > 0
            if short.any():
                rows.append((f"the cylinder at {demand.name} is {words} in {count_words(int(short.sum()))} of {count_words(len(short))} samples: {asked}, available {there}"
                             .replace("-", "−"), _most_and_first(run, int(np.nan_to_num(excess).argmax()), short)))
    return rows


def _limited(run: xr.Dataset) -> list[tuple[str, str]]:
    """Controllers whose output is at a limit."""
    if "controller_limited" not in run:
        return []
    limited = (run.controller_limited.values > 0) & good_samples(run)[:, np.newaxis]
    return [(f"the controller {name} is at its limit in {count_words(int(of.sum()))} of {count_words(len(of))} samples", f"first at {place_of(run, int(of.argmax()))}")
            for name, of in zip(map(str, run.controller.values), limited.T) if of.any()]


def _lifts(run: xr.Dataset, scene: Scene | None) -> list[tuple[str, str]]:
    """Followers that nothing but their joint holds on their cams, with the force that a spring would lack."""
    if "contact_force" not in run or "reaction" not in run or not run.sizes["sample"]:
        return []
    forces = [str(name) for name in run.component.values if str(name).startswith("F")]
    largest = np.abs(run.reaction.sel(component=forces).values).max(axis=(1, 2))
    grooves = {joint["name"] for joint in scene.description["joints"] if joint.get("groove")} if scene is not None else set()
    rows = []
    for name, force in zip(map(str, run.cam.values), run.contact_force.values.T):
        lifts = force < -ROUNDED * largest
        if name in grooves or not lifts.any():
            continue
        worst = int(np.nanargmin(force))
        factor, word = readable("N", float(abs(force[worst])))
        rows.append((f"the follower of {name} would leave its cam in {count_words(int(lifts.sum()))} of {count_words(len(lifts))} samples: held by {force[worst] * factor:.4g} {word}"
                     .replace("-", "−"), _most_and_first(run, worst, lifts)))
    return rows


def _most_and_first(run: xr.Dataset, worst: int, where: NDArray[np.bool_]) -> str:
    return f"most at {place_of(run, worst)}, first at {place_of(run, int(where.argmax()))}"


def _beyond(limits: xr.Dataset) -> list[tuple[str, str]]:
    """Limits that are exceeded, each with the extreme that does and its instant."""
    rows = []
    for k, name in enumerate(map(str, limits.bound.values)):
        quantity, at, unit = str(limits.bound_of.values[k]), str(limits.bound_at.values[k]), str(limits.bound_unit.values[k])
        for side, sign in (("max", 1.0), ("min", -1.0)):
            allowed = float(limits[f"bound_{side}"].values[k])
            found, places = limits[f"{quantity}_{side}"], limits[f"{quantity}_{side}_at"].values
            labels = [" ".join(map(str, label)) for label in _labels(found)]
            values = found.values.reshape(-1)
            chosen = [i for i in range(len(values)) if not at or labels[i] in at.split(", ")]
            worst = max(chosen, key=lambda i: np.nan_to_num(sign * values[i], nan=-np.inf))
            if np.isnan(allowed) or not sign * values[worst] > sign * allowed:
                continue
            factor, word = readable(unit, max(abs(allowed), abs(float(values[worst]))))
            numbers = f"{values[worst] * factor:.4g} {word}, allowed {allowed * factor:.4g} {word}".replace("-", "−")
            rows.append((f"beyond the limit {name}: {labels[worst]} {numbers}".replace("  ", " "),
                         f"at {describe_place(limits, places.reshape(len(values), -1)[worst])}"))
    return rows


def _labels(values: xr.DataArray) -> list[tuple[Any, ...]]:
    labels: list[tuple[Any, ...]] = [()]
    for dimension in values.dims:
        labels = [(*before, label) for before in labels for label in values[dimension].values]
    return labels
