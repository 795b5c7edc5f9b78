"""Results as an xarray.Dataset with the layout of the executable's netCDF files.

Names, units and dimensions come from the engine's own description, so the two cannot differ.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from . import _accessor, _bind  # noqa: F401  (run.linkdyn)
from ._arguments import as_path, quoted
from ._listing import only
from ._output import scene_inputs
from .errors import FileError, InputError, MissingFileError

if TYPE_CHECKING:
    from .scene import Scene

__all__ = [
    "FILE", "FOLDER", "RunTemplate", "ensemble_dataset", "inputs_of", "instants_of", "need_result", "read", "result_shapes", "run_attributes", "with_instants",
]
__dir__ = only(__all__)

INPUTS = ("time", "q", "qd", "qdd")
"""Variables that are given, not computed."""
ANEW = 2
"""What "assembly" says of a sample where it does not follow from the sample before by continuity alone."""
ROADS = ("samples_closed_form", "samples_iterated", "samples_dense")
"""Attributes: how many samples took which road."""
FOLDER, FILE = "scene_folder", "scene_file"
"""In the encoding of a run, while it is in memory: where the tables of its scene lie, and the scene's own file, if it has one."""
WISHES = {"driving_speed": "power", "driving_power": "power", "joint_rate": "joint_variable"}
"""What to want for a result that comes with others."""
COMPONENTS = {
    2: {"Fx": "N", "Fy": "N", "Mz": "N m"},
    3: {"Fx": "N", "Fy": "N", "Fz": "N", "Mx": "N m", "My": "N m", "Mz": "N m"},
}
"""Of a wrench in the plane and in space, with their units."""


def read(file: str | os.PathLike[str]) -> xr.Dataset:
    """Read the results that the executable or ``to_netcdf`` wrote.

    Parameters
    ----------
    file
        netCDF.

    Returns
    -------
    xarray.Dataset
        As `Scene.inverse`, `Scene.forward` or `Scene.sweep` give it, all of it in memory.

    Raises
    ------
    FileError
        It cannot be read, or is no netCDF file.
    """
    path = as_path("read: file", file)
    try:
        with xr.open_dataset(path, engine="netcdf4") as stored:
            return _by_time(stored.load())
    except FileNotFoundError:
        raise MissingFileError(f"{path}: there is no such file") from None
    except (OSError, ValueError, RuntimeError) as error:
        expected = {".toml": ", expected netCDF: a scene is read by linkdyn.load", ".csv": ", expected netCDF: a table is read by pandas"}
        hint = expected.get(os.path.splitext(path)[1], "")
        raise FileError(f"{path}: no results can be read from it ({getattr(error, 'strerror', None) or error}{hint})") from error


def inputs_of(run: xr.Dataset, scene: Scene | None = None) -> list[tuple[str, str]]:
    """Files that a run was read or computed from, and the scene given beside it: nothing made of it may replace them."""
    source = run.encoding.get("source")
    found = [(str(source), "is the file of results")] if source else []
    folder = run.encoding.get(FOLDER) or os.path.dirname(source or "")
    found += scene_inputs(run.encoding.get(FILE), str(run.attrs.get("scene", "")), folder)
    return found if scene is None else found + scene._inputs()


def need_samples(run: xr.Dataset, caller: str) -> None:
    """That a run has samples, and their dimension.

    Raises
    ------
    InputError
        It has none, or is a single one.
    """
    if "status" in run and run.status.ndim == 0:
        raise InputError(f"{caller}: the run is one sample without its dimension (expected run.isel(sample=[k]), or run.sel(time=[t], method='nearest'))")
    if run.sizes.get("sample") == 0:
        raise InputError(f"{caller}: the run has no samples (expected one at least)")


def need_result(run: xr.Dataset, name: str, caller: str) -> xr.DataArray:
    """A result with values at every sample.

    Raises
    ------
    InputError
        The run lacks it; the message says how to get it.
    """
    if not isinstance(name, str):
        raise InputError(f"{caller}: quantity: expected a name, got {quoted(name)}")
    need_samples(run, caller)
    if name in run and run[name].dims[:1] == ("sample",):
        return run[name]
    known = ", ".join(str(other) for other, values in run.data_vars.items() if values.dims[:1] == ("sample",) and values.dtype.kind == "f")
    wish = WISHES.get(name, name)
    raise InputError(f"{caller}: the run has no {name} (expected one that was asked for it, want={wish!r}; there are {known or 'none'})")


def _by_time(run: xr.Dataset) -> xr.Dataset:
    """With the time as index: ``run.sel(time=0.5, method="nearest")``."""
    return run.set_xindex("time") if "time" in run.coords and "time" not in run.indexes else run


def time_axis(dims: list[str], instants: NDArray[np.float64], attributes: dict[str, Any]) -> xr.Coordinates:
    """The same for a new run."""
    time = {"time": xr.Variable(dims, instants, attributes)}
    index = xr.indexes.PandasIndex.from_variables(time, options={})
    return xr.Coordinates(index.create_variables(time), {"time": index})


def result_shapes(schema: dict[str, Any], with_inputs: bool = False) -> dict[str, tuple[tuple[int, ...], type]]:
    """Shape of one sample and dtype of everything that is computed, by name; or of all, what may be given included."""
    sizes = {dimension["name"]: len(dimension.get("labels", ())) for dimension in schema["dimensions"]}
    return {
        variable["name"]: (
            tuple(sizes[name] for name in variable["dims"] if name != "sample"),
            np.intc if variable["is_integer"] else np.float64,
        )
        for variable in schema["variables"]
        if with_inputs or variable["name"] not in INPUTS
    }


class RunTemplate:
    """What the Datasets of all runs of one kind have in common: names, dimensions and units, their indexes made once.

    Parameters
    ----------
    schema
        Dimensions and variables, from the engine.
    scene
        The scene's description, from the engine.
    scene_text
        The scene file, kept as an attribute.
    solver
        Name of the solver used.
    markers
        ("platform.tool", ...) where loads are given beside those of the scene.
    """

    def __init__(
        self, schema: dict[str, Any], scene: dict[str, Any], scene_text: str, solver: str, markers: tuple[str, ...] = ()
    ) -> None:
        used = {name for variable in schema["variables"] for name in variable["dims"]}
        labels: dict[str, tuple[str, list[str]]] = {}
        for dimension in schema["dimensions"]:
            name = dimension["name"]
            if name in used and "labels" in dimension:
                labels[name] = (name, dimension["labels"])
                if "units" in dimension:
                    labels[f"{name}_unit"] = (name, dimension["units"])
        if markers:
            components = COMPONENTS[2 if scene["planar"] else 3]
            labels["loaded_marker"] = ("loaded_marker", list(markers))
            labels["component"] = ("component", list(components))
            labels["component_unit"] = ("component", list(components.values()))
        self._coordinates: xr.Coordinates = xr.Dataset(coords=labels).coords
        for name in set(labels) - set(self._coordinates.xindexes):
            self._coordinates[name].values.flags.writeable = False  # all runs share them; indexes cannot be written to
        self.jumps: list[str] = [variable["name"] for variable in schema["variables"] if variable["jumps"]]
        """Results that a forward run tells on both sides of events, too."""
        self._variables: list[tuple[str, list[str], dict[str, Any]]] = []
        for variable in schema["variables"]:
            attributes: dict[str, Any] = {"long_name": variable["long_name"], "units": variable["units"]}
            if "length" in variable:
                attributes["length"] = variable["length"]
            if variable["is_integer"]:
                attributes |= flag_attributes(variable["flags"])
            self._variables.append((variable["name"], variable["dims"], attributes))
        self._scene, self._scene_text, self._solver = scene, scene_text, solver
        self._last: tuple[int, xr.Dataset | None] = (-1, None)

    def fill(
        self,
        arrays: Mapping[str, NDArray[Any]],
        roads: NDArray[np.intc],
        passed: int,
        wrench: Mapping[str, NDArray[np.float64]] | None = None,
    ) -> xr.Dataset:
        """The Dataset of a run.

        Parameters
        ----------
        arrays
            Values by name, sample first; not copied.
        roads
            Samples whose links were placed in closed form, by iteration; that the dense solver took over.
        passed
            Change points passed.
        wrench
            (N, component) loads that were given, by their markers, world axes.
        """
        variables: dict[str, Any] = {
            name: (dims, arrays[name], attributes) for name, dims, attributes in self._variables if name in arrays
        }  # samples given in order have no clock of their own
        if wrench:
            variables["wrench"] = (("sample", "loaded_marker", "component"), np.stack(list(wrench.values()), axis=1), {
                "long_name": "wrench given in the call, at the marker, world axes", "units": "N, N m"})
        data = self._over_time(variables) if "time" in variables else self._of_poses(variables)
        data.attrs = run_attributes(self._scene, self._scene_text, self._solver) | dict(zip(ROADS, map(int, roads)))
        data.attrs["machine_code"] = _bind.code_in_use()
        if "assembly" in data:
            found = data["assembly"].values[data["status"].values == 0]
            data.attrs["change_points_passed"] = passed
            data.attrs["assemblies_found_anew"] = int(np.count_nonzero(found == ANEW))
        return data

    def beside_events(self, arrays: Mapping[str, NDArray[Any]]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Variables and coordinates of the results on both sides of events, (event, side, ...) by the names of the results."""
        variables = {
            f"event_{name}": (["event", "side", *dims[1:]], arrays[name], attributes | {"long_name": f"{attributes['long_name']}, just before and behind the event"})
            for name, dims, attributes in self._variables if name in arrays
        }
        return variables, {"side": ("side", EVENT_SIDES)} if variables else {}

    def _over_time(self, variables: dict[str, Any]) -> xr.Dataset:
        coordinates = self._coordinates | time_axis(*variables.pop("time"))
        return xr.Dataset(variables, coordinates)

    def _of_poses(self, variables: dict[str, Any]) -> xr.Dataset:
        """Making a Dataset takes five times as long as copying one of the same shape with other values: where batches of one length
        follow each other, the second leaves such a one, of values that take no memory.
        """
        n, (n_before, pattern) = len(variables["q"][1]), self._last
        if n == n_before and pattern is not None:
            return pattern.copy(data={name: values for name, (_, values, _) in variables.items()})
        data = xr.Dataset(variables, self._coordinates)
        nothing = {name: np.broadcast_to(values.dtype.type(0), values.shape) for name, (_, values, _) in variables.items()}
        self._last = (n, data.copy(data=nothing) if n == n_before else None)
        return data


def with_instants(run: xr.Dataset, instants: NDArray[np.float64]) -> xr.Dataset:
    """A batch with the instants, (N,) or (1,), that its loads were taken at: no clock, for its samples need not follow each other."""
    values = np.broadcast_to(instants, run.sizes["sample"]).copy()
    return run.assign_coords(instant=("sample", values, {"units": "s", "long_name": "instant that the loads of the sample are taken at"}))


def instants_of(run: xr.Dataset) -> NDArray[np.float64] | None:
    """(N,) instants that loads of a run were taken at: its time, or what a batch was given; None: a batch without."""
    for name in ("time", "instant"):
        if name in run.coords:
            values: NDArray[np.float64] = run[name].values
            return values
    return None


def flag_attributes(flags: list[str]) -> dict[str, Any]:
    """Attributes of a variable whose values 0, 1, ... have the names given."""
    values = np.arange(len(flags), dtype=np.intc)
    values.flags.writeable = False  # all runs of one kind share them
    return {
        "flag_values": values,
        "flag_meanings": " ".join(flag.replace(" ", "_") for flag in flags),
    }


EVENT_SIDES = ["before", "behind"]
EVENT_KINDS = ["crossing", "end", "contact", "release", "impact", "rest", "close", "open", "stick", "slip"]


def event_variables(
    scene: dict[str, Any], kinds: NDArray[np.intc], instants: NDArray[np.float64], states: NDArray[np.float64]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """What has happened in a run, along the dimension "event".

    Parameters
    ----------
    scene
        Its description.
    kinds, instants, states
        As `_bind.Run.events` has them.

    Returns
    -------
    variables, coordinates
        For a Dataset.
    """
    names = np.array([scene["events"][k - 1] for k in kinds[:, 0]], dtype=np.str_)
    of_state = ("event", "coordinate")
    variables = {
        "event_time": ("event", instants[:, 0], {"long_name": "instant of the event", "units": "s"}),
        "event_kind": ("event", kinds[:, 1], {"long_name": "what happened"} | flag_attributes(EVENT_KINDS)),
        "event_direction": ("event", kinds[:, 2], {"long_name": "1: the number crossed zero upwards, -1: downwards"}),
        "event_impulse": ("event", instants[:, 1], {"long_name": "impulse of the stop or clutch", "units": "N s or N m s"}),
        "event_loss": ("event", instants[:, 2], {"long_name": "energy lost in the impact, or by closing the clutch", "units": "J"}),
        "event_q": (of_state, states[:, 0], {"long_name": "generalized coordinate at the event", "units": "m or rad"}),
        "event_qd": (of_state, states[:, 1], {"long_name": "its rate before", "units": "m/s or rad/s"}),
        "event_qd_after": (of_state, states[:, 2], {"long_name": "its rate behind", "units": "m/s or rad/s"}),
    }
    return variables, {"event": ("event", names)}


def passed_stops(scene: dict[str, Any], run: xr.Dataset) -> str:
    """Stops with restitution that a motion passes, as the executable tells them; empty: none, or the run has no joint variables."""
    told = []
    for stop in scene["stops"]:
        if not stop["is_hard"] or "joint_variable" not in run or stop["variable"] not in run["variable"].values:
            continue
        beyond = stop["side"] * (run["joint_variable"].sel(variable=stop["variable"]).values - stop["bound"]) > 1e-9
        if not beyond.any():
            continue
        n, first = int(beyond.sum()), int(beyond.argmax())
        place = f"t = {float(run['time'][first]):.6g} s" if "time" in run.coords else f"sample {first}"
        told.append(f"'{stop['name']}' of {stop['what']} by {n} sample{'s' * (n > 1)}, first at {place}")
    return "; ".join(told)


def ensemble_dataset(
    schema: dict[str, Any],
    scene: dict[str, Any],
    scene_text: str,
    time: NDArray[np.float64],
    q: NDArray[np.float64],
    qd: NDArray[np.float64],
    good_until: NDArray[np.float64],
    crossed: NDArray[np.intc],
    outcome: NDArray[np.intc],
) -> xr.Dataset:
    """The Dataset of an ensemble of forward runs.

    Parameters
    ----------
    schema
        Variables of a run's samples, from the engine: what a status is called.
    scene, scene_text
        The scene's description and file.
    time
        (M,) [s].
    q, qd
        (N, M, n).
    good_until
        (N,) [s].
    crossed
        (N,) change points passed.
    outcome
        (N,) why each stopped, as the status of a sample; 0: it has not.
    """
    flags = next(variable["flags"] for variable in schema["variables"] if variable["name"] == "status")
    dims, coordinates = ("member", "time", "coordinate"), scene["coordinates"]
    variables = {
        "q": (dims, q, {"long_name": "generalized coordinate", "units": "m or rad"}),
        "qd": (dims, qd, {"long_name": "its rate", "units": "m/s or rad/s"}),
        "good_until": ("member", good_until, {"long_name": "last good instant", "units": "s"}),
        "change_points_passed": ("member", crossed, {"long_name": "change points passed"}),
        "status": ("member", outcome, {"long_name": "why the member stopped"} | flag_attributes(flags)),
    }
    axes = {
        "time": ("time", time, {"units": "s"}),
        "coordinate": ("coordinate", [c["name"] for c in coordinates]),
        "coordinate_unit": ("coordinate", [c["unit"] for c in coordinates]),
    }
    attributes = run_attributes(scene, scene_text, "") | {"method": "rk4"}
    del attributes["solver"]  # of forces at output instants, which an ensemble does not have
    return xr.Dataset(variables, axes, attributes)


def run_attributes(scene: dict[str, Any], scene_text: str, solver: str) -> dict[str, Any]:
    """What is said of a run as a whole.

    Parameters
    ----------
    scene
        The scene's description, from the engine.
    scene_text
        The scene file.
    solver
        Name of the solver used.
    """
    return {
        "title": scene["title"],
        "linkdyn_version": _bind.version(),
        "space": "planar" if scene["planar"] else "spatial",
        "solver": solver,
        "gravity": np.array(scene["gravity"][: 2 if scene["planar"] else 3]),
        **({"idle_spins": scene["idle_spins"]} if scene["idle_spins"] else {}),
        **({name: scene[name] for name in ("shared_reactions", "shared_components", "shared_directions", "redundancy")} if scene["shared_reactions"] else {}),
        "scene": scene_text,
        "history": f"{datetime.now().astimezone().isoformat(timespec='seconds')} {Path(sys.argv[0] or 'python').name}",
    }
