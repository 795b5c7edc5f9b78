"""How much of every driving force and reaction is due to weight, to inertia, to each load, to each spring, to preloads of drives and to friction."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .._arguments import by_labels
from .._pose import poses_of
from ..errors import InputError
from ..results import instants_of
from ..scene import Scene
from .averages import good_samples

__all__ = ["contributions"]

QUANTITIES = ("driving_force", "reaction")
CLOSE = 1e-6
"""How near a sum must come to the total, as a part of the largest contribution: far above the rounding of poses that are reached by different
roads, far below anything that is left out."""

LEANING = ("pressure_angle", "helix_angle", "lead_angle")
"""Keys of gears and racks whose teeth push across their tangential force by its size."""


def contributions(run: xr.Dataset, scene: Scene) -> xr.Dataset:
    """Driving forces and reactions by cause; the causes of a sample add up to its forces.

    The scene is computed once for each cause along the same motion: inertia is what is left without gravity, loads and springs, and any
    other cause is what it adds to that. Where the frame moves, inertia is that of the motion seen from it, and "frame" what its own adds.

    Parameters
    ----------
    run
        Results of `Scene.inverse`, or of `Scene.forward` of a scene with as many actuators as coordinates. Of a batch to which no ``t`` was given
        the scene's loads are those at the instant 0.
    scene
        The scene that was run.

    Returns
    -------
    xarray.Dataset
        ``driving_force`` (cause, sample, actuator) and ``reaction`` (cause, sample, joint, component), as far as the run has them. ``cause``: "inertia"
        (with gyroscopic parts), "frame" where it moves, "weight", "load MARKER", "spring NAME", "stop NAME", "preload" of drives that share the work, "misfit" of joints,
        "given MARKER" of wrenches given in the call, and "friction", what it adds to all of these.

    Raises
    ------
    InputError
        The run has neither driving forces nor reactions, or what acts in the scene is more than the sum of these causes (samples in
        another assembly).
    """
    wanted = [name for name in QUANTITIES if name in run]
    if not wanted:
        raise InputError("contributions: the run has neither driving forces nor reactions (expected want='driving_force', 'reaction' or both)")
    content = tomllib.loads(scene.text)
    if any("strands" in joint for joint in content.get("joint", [])):
        raise InputError("contributions: a belt stretches, and what it pulls with is no cause that can be left out (expected a scene without 'strands')")
    causes = {"weight": _only(content, gravity=True)}
    for kind in ("load", "spring", "stop"):
        for i, table in enumerate(content.get(kind, [])):
            if "restitution" in table:
                continue  # no force where the motion is given
            causes[_free(f"{kind} {_label(kind, table)}", causes)] = _only(content, kept=(kind, i))
    if any("preload" in table for table in content.get("actuator", [])):
        causes["preload"] = _only(content, preload=True)
    if any("misfit" in table for table in content.get("joint", [])):
        causes["misfit"] = _only(content, misfit=True)
    for axis, names in (("actuator", scene.actuators), ("joint", scene.joints)):
        if axis in run.dims and sorted(map(str, run[axis].values)) == sorted(names):
            run = run.sel({axis: list(names)})
    given = _given(run)
    base = _forces(Scene(_only(content), folder=scene.folder), run, wanted)
    found = {"inertia": base}
    if scene.description["frame_moves"]:
        found = {"inertia": _forces(Scene(_at_rest(_only(content)), folder=scene.folder), run, wanted)}
        found["frame"] = _less(base, found["inertia"])
    for cause, changed in causes.items():
        found[cause] = _less(_forces(Scene(changed, folder=scene.folder), run, wanted), base)
    for marker, wrench in given.items():
        found[f"given {marker}"] = _less(_forces(Scene(_only(content), folder=scene.folder), run, wanted, {marker: wrench}), base)
    if content.get("friction"):
        # what the others do together: friction is what it adds to that, not what they leave open
        smooth = _forces(Scene({key: value for key, value in content.items() if key != "friction"}, folder=scene.folder), run, wanted, given)
        _check(run, content, found, smooth)
        found["friction"] = _less(_forces(scene, run, wanted, given), smooth)
    _check(run, content, found, {name: run[name].values for name in wanted})
    stacked = {name: np.stack([values[name] for values in found.values()]) for name in wanted}
    return xr.Dataset(
        {name: (("cause", *run[name].dims), stacked[name], run[name].attrs) for name in wanted},
        {"cause": list(found), **{name: run.coords[name] for name in run.coords if set(run.coords[name].dims) <= {d for q in wanted for d in run[q].dims}}},
        {"title": run.attrs.get("title", "")},
    )


def _only(
    content: dict[str, Any], gravity: bool = False, preload: bool = False, misfit: bool = False, kept: tuple[str, int] | None = None
) -> dict[str, Any]:
    """The scene with inertia, and gravity, preloads of drives, misfits of joints or one load, spring or stop if that is to be kept."""
    changed = {key: value for key, value in content.items() if key not in ("load", "spring", "friction", "stop", "sweep")}
    if not gravity:
        changed.pop("gravity", None)
    for key, where, stays in (("preload", "actuator", preload), ("misfit", "joint", misfit)):
        if not stays and where in content:
            changed[where] = [{name: value for name, value in table.items() if name != key} for table in content[where]]
    if kept:
        changed[kept[0]] = [content[kept[0]][kept[1]]]
    return changed


def _at_rest(content: dict[str, Any]) -> dict[str, Any]:
    """The scene on a frame that does not move."""
    return {**content, "frame": {key: value for key, value in content["frame"].items() if key != "motion"}}


def _label(kind: str, table: dict[str, Any]) -> str:
    return str(table["on" if kind == "load" else "name"])


def _free(name: str, taken: dict[str, Any]) -> str:
    """The name, with a number if several loads act on one marker."""
    n = sum(other == name or other.startswith(f"{name} (") for other in taken)
    return f"{name} ({n + 1})" if n else name


def _given(run: xr.Dataset) -> dict[str, NDArray[np.float64]]:
    return {str(name): run.wrench.values[:, i] for i, name in enumerate(run.loaded_marker.values)} if "wrench" in run else {}


def _forces(
    scene: Scene, run: xr.Dataset, wanted: list[str], wrench: dict[str, NDArray[np.float64]] | None = None
) -> dict[str, NDArray[np.float64]]:
    """Forces of another scene along the same motion: as the scene's own where the run was along that, else sample by sample."""
    time = run.time.values if "time" in run.coords else None
    good = good_samples(run)
    if time is not None and "method" not in run.attrs and np.array_equal(scene.motion(time)[0][good], by_labels("q", run.q, scene.coordinates)[good]):
        again = scene.inverse(t=time, want=wanted, wrench=wrench)
    else:
        states = (run[name].fillna(0) for name in ("q", "qd", "qdd"))
        again = scene.inverse(*states, pose=poses_of(run, scene) or None, t=instants_of(run), want=wanted, wrench=wrench)
    return {name: again[name].values for name in wanted}


def _less(values: dict[str, NDArray[np.float64]], base: dict[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    return {name: values[name] - base[name] for name in values}


def _check(
    run: xr.Dataset, content: dict[str, Any], found: dict[str, dict[str, NDArray[np.float64]]], together: dict[str, NDArray[np.float64]]
) -> None:
    """The causes must add up to what they do together, at every sample that did not fail; the others have none."""
    good = good_samples(run)
    for name, total in together.items():
        for values in found.values():
            values[name][~good] = np.nan
        parts = np.stack([values[name][good] for values in found.values()])
        missing = np.abs(parts.sum(axis=0) - total[good])
        if missing.size and not np.nanmax(missing, initial=0.0) <= CLOSE * np.nanmax(np.abs(parts), initial=0.0) or np.isnan(missing).any():
            raise InputError(f"contributions: {name}: {_why(content)}")


def _why(content: dict[str, Any]) -> str:
    """Why causes do not add up."""
    leaning = next((str(joint["name"]) for joint in content.get("joint", []) if any(key in joint for key in LEANING)), None)
    if leaning:
        return (
            f"the teeth of '{leaning}' lean and push wheels apart whichever way they are loaded, so causes do not add up "
            "(expected teeth that do not lean, or driving forces alone)"
        )
    return (
        "weight, inertia, loads and springs are not all that acts in this run (expected samples in the assembly of its start or along its motion)"
    )
