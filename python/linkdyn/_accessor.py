"""``run.linkdyn``: what can be done with a run, at hand where the run is."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Sized
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from . import _bind
from ._arguments import as_path
from ._output import write_output
from .errors import InputError, UnavailableError

if TYPE_CHECKING:
    import pandas as pd

    from numpy.typing import ArrayLike

    from ._event_sides import EventSides
    from ._view.page import View
    from .scene import Scene

__all__ = ["RunAccessor"]

GROUPS = {"force": "F", "moment": "M"}
"""Parts of a wrench, by the first letter of their components."""
ALIKE = 1e-12
"""Of a value: what is larger by less beside an event is what a sample has but for rounding."""
LABELLED = ("coordinate", "actuator", "joint", "variable", "component")
"""Dimensions by whose names results are found."""
OFFERS = ("view", "animate", "sheet", "worst", "joint", "to_frame", "to_csv", "to_parquet")
"""What there is to call, for those who ask by printing."""


@xr.register_dataset_accessor("linkdyn")  # type: ignore[no-untyped-call]
class RunAccessor:
    """Of the results of `Scene.inverse`, `Scene.forward` or a sweep.

    Examples
    --------
    >>> run = linkdyn.load("examples/fourbar/scene.toml").inverse()
    >>> round(run.linkdyn.worst("driving_force").loc["J1", "time"], 2)
    4.02
    """

    def __init__(self, run: xr.Dataset) -> None:
        self._given = run

    @property
    def _run(self) -> xr.Dataset:
        """The run with its samples first, as it was written.

        Raises
        ------
        InputError
            A dimension other than that of the samples is gone.
        """
        run = self._given
        for name, axis in run.coords.items():
            if name in LABELLED and axis.ndim == 0:
                raise InputError(f"the run has nothing but {name} {str(axis.values)!r} left (expected the whole run, or run.sel({name}=[{str(axis.values)!r}]))")
        if "sample" not in run.dims and "time" in run.dims:
            run = run.swap_dims(time="sample")
        if "sample" in run.dims and any("sample" in values.dims[1:] for values in run.data_vars.values()):
            run = run.transpose("sample", ..., "component", missing_dims="ignore")
        return run

    def view(self, file: str | os.PathLike[str] | None = None, **options: Any) -> View:
        """An interactive picture: `linkdyn.view`."""
        from ._view.page import view

        return view(self._run, file, **options)

    def animate(self, file: str | os.PathLike[str], **options: Any) -> Path:
        """A moving picture, ``.gif`` or ``.mp4``: `linkdyn.plot.animate`."""
        from ._drawing.animation import animate

        return animate(self._run, file, **options)

    def sheet(self, file: str | os.PathLike[str], **options: Any) -> Path:
        """The sheet of a run or a sweep, ``.html`` or ``.pdf``: `linkdyn.sheet`."""
        from ._sheets.sheet import sheet

        return sheet(self._run, file, **options)

    def marker(self, name: str, *, scene: Scene | None = None) -> xr.Dataset:
        """Position, velocity and acceleration of a marker, "coupler.P": `linkdyn.cycle.marker`."""
        from . import cycle

        return cycle.marker(self._run, name, self._scene("marker", scene))

    def relative_pose(self, link: str, seen_from: str, *, scene: Scene | None = None) -> xr.Dataset:
        """Where a link is, seen from another: `linkdyn.cycle.relative_pose`."""
        from . import cycle

        return cycle.relative_pose(self._run, link, seen_from, self._scene("relative_pose", scene))

    def shaking(self, about: ArrayLike | None = None, *, scene: Scene | None = None) -> xr.Dataset:
        """Force and moment on the frame, about a point: `linkdyn.cycle.shaking`."""
        from . import cycle

        return cycle.shaking(self._run, self._scene("shaking", scene), about)

    def contributions(self, *, scene: Scene | None = None) -> xr.Dataset:
        """Driving forces and reactions by cause, inertia, weight, each load and spring: `linkdyn.cycle.contributions`."""
        from . import cycle

        return cycle.contributions(self._run, self._scene("contributions", scene))

    def energy(self) -> xr.Dataset:
        """Power and energy of the drives, their fluctuation: `linkdyn.cycle.energy`."""
        from . import cycle

        return cycle.energy(self._run)

    def flywheel(self, fluctuation: float, actuator: str | None = None) -> xr.Dataset:
        """Inertia of the flywheel that keeps the speed within the fluctuation: `linkdyn.cycle.flywheel`."""
        from . import cycle

        return cycle.flywheel(self._run, fluctuation, actuator)

    def bearing_life(self, joint: str, *, scene: Scene | None = None, **options: Any) -> xr.Dataset:
        """Life of a joint's rolling bearing by ISO 281: `linkdyn.cycle.bearing_life`."""
        from . import cycle

        return cycle.bearing_life(self._run, joint, self._scene("bearing_life", scene), **options)

    def plain_bearing(self, joint: str, *, scene: Scene | None = None, **options: Any) -> xr.Dataset:
        """Pressure and pressure times speed of a joint's plain bearing: `linkdyn.cycle.plain_bearing`."""
        from . import cycle

        return cycle.plain_bearing(self._run, joint, self._scene("plain_bearing", scene), **options)

    def motor(self, actuator: str, *, scene: Scene | None = None, **options: Any) -> xr.Dataset:
        """Torque, speed, power and current of the motor behind an actuator's gear or screw: `linkdyn.cycle.motor`."""
        from . import cycle

        return cycle.motor(self._run, actuator, self._scene("motor", scene), **options)

    def cylinder(self, actuator: str, *, scene: Scene | None = None, **options: Any) -> xr.Dataset:
        """Pressures and flows of the cylinder that gives an actuator's force: `linkdyn.cycle.cylinder`."""
        from . import cycle

        if "bore" not in options:
            scene = self._scene("cylinder", scene)
        return cycle.cylinder(self._run, actuator, scene, **options)

    @property
    def determined(self) -> xr.DataArray:
        """Which components of reactions, world axes, the equations determine: the others are a choice, as the scene's ``redundancy`` says.

        Returns
        -------
        xarray.DataArray
            True or false for each joint and component. All are true where no constraint is redundant, none is where friction comes of
            what is shared. Where drives share the work, by the driving forces that are taken.

        Raises
        ------
        InputError
            The run has no reactions.

        Examples
        --------
        >>> run = linkdyn.load("examples/agile_eye/scene.toml").inverse()
        >>> exact = run.reaction.where(run.linkdyn.determined)
        """
        reaction = self._result("reaction")
        shared = str(self._run.attrs.get("shared_components", ""))
        parts = {f"{part}.{axis}": f"{letter}{axis}" for part, letter in GROUPS.items() for axis in "xyz"}
        found = reaction.isel(sample=0, drop=True).drop_vars("time", errors="ignore").astype(bool)
        found = found.copy(data=np.full(found.shape, shared != "all"))
        found.attrs = {"long_name": "determined by the equations"}
        for word in shared.split() if shared != "all" else ():
            joint, sort, axis = word.rsplit(".", 2)
            found.loc[{"joint": joint, "component": parts[f"{sort}.{axis}"]}] = False
        return found

    def rms(self, quantity: str = "driving_force") -> xr.DataArray:
        """Rms values over the run's time, as the summary tells them; samples that failed do not count.

        Raises
        ------
        InputError
            The run has no such result.
        """
        from ._cycle.averages import rms, shares
        from .results import need_result

        values = need_result(self._run, quantity, "rms")
        return values.isel(sample=0, drop=True).drop_vars("time", errors="ignore").copy(data=rms(values.values, shares(self._run)))

    def worst(self, quantity: str = "reaction") -> pd.DataFrame:
        """The largest magnitudes, and when they occur.

        Parameters
        ----------
        quantity
            A result with values at every sample.

        Returns
        -------
        pandas.DataFrame
            A row for each actuator, joint, ...: ``value``, in the unit ``unit``, with its sign, and ``time`` [s] (``sample``
            of a batch). Of reactions ``force`` [N] and ``moment`` [N m], magnitudes, each with its time. NaN where no
            sample could be computed. Of a forward run with events what is just before and just behind these counts, too: ``event``
            (``force_event``, ``moment_event``) tells of which, empty of a sample.

        Raises
        ------
        InputError
            The run has no such result.
        """
        import pandas as pd

        values = self._result(quantity)
        if "component" in values.dims:
            columns: dict[str, Any] = {}
            for part, letter in GROUPS.items():
                places = [k for k, name in enumerate(values.component.values) if str(name).startswith(letter)]
                size = np.linalg.norm(self._sides.behind(quantity)[..., places], axis=-1)
                columns |= self._peaks(size, part, f"{part}_")
            label = next(name for name in values.dims if name not in ("sample", "component"))
            return pd.DataFrame(columns, index=pd.Index(values[label].values, name=label))
        label = values.dims[1] if values.ndim > 1 else None
        told = self._sides.behind(quantity)
        columns = self._peaks(told.reshape(len(told), -1), "value")
        index = pd.Index(values[label].values, name=label) if label else pd.Index([quantity])
        table = pd.DataFrame(columns, index=index)
        table.insert(1, "unit", self._units(values))
        return table

    def joint(self, name: str) -> xr.Dataset:
        """Everything that belongs to one joint: reaction, driving force, joint variables.

        Raises
        ------
        InputError
            There is no joint of this name.
        """
        known = [str(other) for key in ("joint", "actuator") if key in self._run.coords for other in self._run[key].values]
        if name not in known:
            raise InputError(f"joint: there is no {name!r} among the results (expected one of {', '.join(map(repr, dict.fromkeys(known)))})")
        found = {}
        for key, dimension in (("joint", "joint"), ("actuator", "actuator"), ("variable", "variable")):
            for result, values in self._run.data_vars.items():
                if dimension not in values.dims:
                    continue
                labels = [str(label) for label in values[key].values]
                own = [label for label in labels if label == name or label.startswith(f"{name}.")]
                if own:
                    found[result] = values.sel({key: own if key == "variable" else own[0]}, drop=key != "variable")
        return xr.Dataset(found, attrs={"joint": name})

    def to_frame(self) -> pd.DataFrame:
        """All results as one wide table, a row for each sample: for pandas, Parquet, spreadsheets.

        Returns
        -------
        pandas.DataFrame
            Columns as in files written with ``--csv``: "driving_force leg1.P [N]", "reaction leg1.S Fx [N]"; flags are
            words. The index is the "time [s]", or the number of the "sample".
        """
        import pandas as pd

        from .results import need_samples

        need_samples(self._run, "to_frame")
        if "sample" not in self._run.dims:
            raise InputError("to_frame: there are no results of samples (expected a run, or a sweep that keeps samples)")
        columns: dict[str, Any] = {}
        for name, values in self._run.data_vars.items():
            if values.dims[:1] != ("sample",):
                continue
            flat, units = values.values.reshape(len(values), -1), self._units(values)
            if "flag_meanings" in values.attrs:
                words = np.array([*(word.replace("_", " ") for word in values.flag_meanings.split()), ""])
                flat, units = words[np.nan_to_num(flat, nan=-1).astype(int)], [""] * len(units)  # NaN: where it was taken away
            for label, unit, column in zip(self._labels(values), units, flat.T):
                columns[f"{name}{label}{f' [{unit}]' if unit else ''}"] = column
        return pd.DataFrame(columns, index=pd.Index(self._instants(), name="time [s]" if self._clock == "time" else "sample"))

    def to_csv(self, file: str | os.PathLike[str]) -> Path:
        """Write `to_frame` as CSV, the instants in its first column, numbers as ``--csv`` writes them; ``linkdyn inverse --states``
        takes such a file.

        Raises
        ------
        FileError
            It cannot be written, or is a file that the run was read or computed from.
        """
        return self._write(file, _as_csv)

    def to_parquet(self, file: str | os.PathLike[str]) -> Path:
        """Write `to_frame` as Parquet, for large tables that pandas, Polars, DuckDB or Spark read; needs pyarrow.

        Raises
        ------
        UnavailableError
            pyarrow is not installed.
        FileError
            It cannot be written, or is a file that the run was read or computed from.
        """
        try:
            return self._write(file, lambda table: table.to_parquet(engine="pyarrow"))
        except ImportError as error:
            raise UnavailableError.of("to_parquet needs pyarrow", "pyarrow", "parquet", error) from None

    def to_control(self) -> Any:
        """What `Scene.linearize` has given as a ``StateSpace`` of python-control, with its names (a dot in them becomes an underscore).

        Raises
        ------
        UnavailableError
            python-control is not installed.
        InputError
            It is no linearization.
        """
        from ._linear import to_control

        return to_control(self._given)

    def _write(self, file: str | os.PathLike[str], content: Callable[[pd.DataFrame], str | bytes]) -> Path:
        from .results import inputs_of

        path = Path(as_path("file", file))
        write_output(path, content(self.to_frame()), inputs_of(self._run))
        return path

    def __repr__(self) -> str:
        return f"<run.linkdyn: {count(range(self._run.sizes.get('sample', 1)), 'sample')}; {', '.join(OFFERS)}>"

    def _repr_html_(self) -> str:
        run = self._run
        rows = {
            "title": run.attrs.get("title", ""),
            "samples": f"{run.sizes.get('sample', 1)}{self._span()}",
            "failed": int((run.status.values != 0).sum()) if "status" in run else 0,
            "results": ", ".join(map(str, run.data_vars)),
        }
        if "driving_force" in run and run.sizes.get("actuator") and run.sizes.get("sample"):
            peaks = self.worst("driving_force")
            top = peaks.value.abs().idxmax() if peaks.value.notna().any() else None
            if top is not None:
                from ._drawing.style import readable

                factor, unit = readable(str(peaks.unit[top]), abs(peaks.value[top]))
                rows["largest driving force"] = f"{f'{factor * peaks.value[top]:.4g}'.replace('-', '−')} {unit}, {top}"
        return table(rows)

    # ---------------------------------------------------------------- parts

    def _scene(self, caller: str, given: Scene | None) -> Scene:
        """The scene given, or the one that the run keeps."""
        from ._geometry.postures import scene_of
        from .results import need_samples

        need_samples(self._run, caller)
        return given if given is not None else scene_of(self._run, caller)

    @property
    def _clock(self) -> str:
        return "time" if "time" in self._run.coords else "sample"

    def _instants(self) -> np.ndarray:
        return self._run.time.values if self._clock == "time" else np.arange(self._run.sizes["sample"])

    def _span(self) -> str:
        if self._clock == "sample" or not self._run.time.size:
            return ""
        instants = np.atleast_1d(self._instants())
        return f", {instants[0]:g} s to {instants[-1]:g} s"

    def _result(self, quantity: str) -> xr.DataArray:
        from .results import need_samples

        need_samples(self._run, "worst")
        known = [str(name) for name, values in self._run.data_vars.items() if values.dims[:1] == ("sample",) and values.dtype.kind == "f"]
        if not known:
            raise InputError("worst: there are no results of samples (expected a run, or a sweep that keeps samples)")
        if quantity not in known:
            raise InputError(f"worst: the run has no {quantity!r} (expected one of {', '.join(known)})")
        return self._run[quantity]

    @property
    def _sides(self) -> EventSides:
        from ._event_sides import EventSides

        return EventSides.of(self._run)

    def _peaks(self, values: np.ndarray, name: str, prefix: str = "") -> dict[str, Any]:
        """Of each column the value of largest magnitude, its instant, and the event that it stands beside, if some may; as columns of a table."""
        n, sides = self._run.sizes["sample"], self._sides
        size = np.where(np.isfinite(values), np.abs(values), -1.0)
        size[n:] *= 1.0 - ALIKE
        place = size.argmax(axis=0)
        columns = np.arange(values.shape[1])
        is_there = size[place, columns] >= 0
        instants = np.concatenate([self._instants(), sides.time[: len(values) - n]])
        found: dict[str, Any] = {name: np.where(is_there, values[place, columns], np.nan), f"{prefix}{self._clock}": np.where(is_there, instants[place], np.nan)}
        if len(values) > n:
            found[f"{prefix}event"] = [sides.words(int(k) - n) if k >= n else "" for k in place]
        return found

    def _labels(self, values: xr.DataArray) -> list[str]:
        labels = [""]
        for dimension in values.dims[1:]:
            labels = [f"{text} {label}" for text in labels for label in values[dimension].values]
        return labels

    def _units(self, values: xr.DataArray) -> list[str]:
        """Of each column, in the order of `_labels`."""
        from ._units import units_of

        n = int(np.prod(values.shape[1:]))
        return units_of(values) * (n // len(units_of(values)))


def count(things: Sized, name: str) -> str:
    """How many there are, in words: "1 link", "2 links"."""
    return f"{len(things)} {name}{'' if len(things) == 1 else 's'}"


def table(rows: dict[str, Any]) -> str:
    """Names and values as a small table of HTML."""
    cell = '<td style="text-align: left">'
    lines = "".join(f"<tr>{cell}{escape(name)}</td>{cell}{escape(str(value))}</td></tr>" for name, value in rows.items() if value != "")
    return f"<table>{lines}</table>"


def _as_csv(frame: pd.DataFrame) -> bytes:
    """The whole file, names first."""
    names = [str(frame.index.name), *map(str, frame.columns)]
    head = io.StringIO()
    csv.writer(head, lineterminator="\n").writerow(names)
    is_word = np.array([False, *(dtype.kind not in "biuf" for dtype in frame.dtypes)])
    words: list[str] = []
    values = np.empty((len(frame), len(names)))
    values[:, 0] = frame.index
    for k, word in enumerate(is_word[1:]):
        column = frame.iloc[:, k].to_numpy()
        if word:
            found, places = np.unique(column.astype(str), return_inverse=True)
            column = places + 1 + len(words)
            words += found.tolist()
        values[:, k + 1] = column
    return b"".join([head.getvalue().encode("utf-8", errors="surrogateescape"), *_bind.csv_rows(values, is_word, words)])
