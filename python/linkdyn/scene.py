"""The scene: a mechanism read, checked and planned by the engine."""

from __future__ import annotations

import os
import weakref
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from . import _bind
from .errors import InputError
from .results import result_arrays, to_dataset

__all__ = ["Scene", "Poses", "load"]

BLOCK = 65536
"""Samples in one call of the engine: an interrupt (Ctrl-C) is heard between two calls."""


@dataclass(frozen=True)
class Poses:
    """Where the moving links are."""

    position: NDArray[np.float64]
    """(N, n_link, 3) origins [m], in the order of ``scene.links``."""
    rotation: NDArray[np.float64]
    """(N, n_link, 3, 3) from link to world axes."""
    status: NDArray[np.intc]
    """(N,) 0 where the mechanism can be assembled."""


def load(path: str | os.PathLike[str]) -> Scene:
    """Read a scene file.

    Parameters
    ----------
    path
        TOML file; its tables are looked up beside it.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    SceneError
        Something is wrong in it: file, line, what, what was expected.
    """
    return Scene(Path(path))


class Scene:
    """A mechanism ready to be computed.

    Parameters
    ----------
    source
        A path (``str`` without line ends, or path object), the text of a scene file, or a mapping with the same
        content (numpy arrays and numbers are welcome).
    folder
        Where tables are looked up; default: the file's folder, or the current one.

    Attributes
    ----------
    title : str
    planar : bool
    coordinates : tuple of str
        Names of the generalized coordinates, in the order of the columns of ``q``.
    actuators, joints, links, loads : tuple of str
        Names; ``links`` are the moving ones.
    text : str
        The scene file.
    description : dict
        All of the above with units, markers and mass properties.
    """

    def __init__(
        self, source: str | os.PathLike[str] | Mapping[str, Any], folder: str | os.PathLike[str] | None = None
    ) -> None:
        data, name, beside = _source(source)
        self.text = data.decode("utf-8", errors="replace")
        handle = _bind.open_scene(data, name, os.fspath(folder if folder is not None else beside))
        self._finalizer = weakref.finalize(self, _bind.close_scene, handle)
        self._handle = handle
        self.description = _bind.describe_scene(handle)
        self.title: str = self.description["title"]
        self.planar: bool = self.description["planar"]
        self.coordinates = _names(self.description["coordinates"])
        self.actuators = _names(self.description["actuators"])
        self.joints = _names(self.description["joints"])
        self.links = _names(self.description["links"][1:])
        self.loads = _names(self.description["loads"])
        self._with_loads: tuple[tuple[str, ...], int] | None = None

    def __repr__(self) -> str:
        return (
            f"<linkdyn.Scene {self.title!r}: {len(self.links)} links, {len(self.joints)} joints, "
            f"{len(self.coordinates)} coordinates, {len(self.actuators)} actuators>"
        )

    def explain(self) -> str:
        """What is modelled, how it is computed, what is left out."""
        return _bind.explain(self._handle)

    def times(self) -> NDArray[np.float64]:
        """Instants of the scene's own run [s], shape (N,)."""
        time = self.description["time"]
        n = max(1, time["n_sample"])
        steps = np.arange(n) / max(1, n - 1)
        return time["first"] + (time["last"] - time["first"]) * steps

    def motion(self, t: ArrayLike | None = None) -> tuple[NDArray[np.float64], ...]:
        """The scene's own motion.

        Parameters
        ----------
        t
            (N,) instants [s]; default: `times`.

        Returns
        -------
        q, qd, qdd
            (N, n) coordinates [m, rad] and their time derivatives.
        """
        instants = self.times() if t is None else self._instants(t)
        return _bind.motion(self._handle, instants, len(self.coordinates), len(self.loads))[:3]

    def poses(self, q: ArrayLike | None = None) -> Poses:
        """Poses of all moving links.

        Parameters
        ----------
        q
            (N, n) or (n,) coordinates [m, rad]; default: the scene's motion.
        """
        if q is None:
            q = self.motion()[0]
        elif np.ndim(q) == 1:
            q = np.asarray(q)[np.newaxis]
        values = self._batch("q", q, None)
        return Poses(*_bind.poses(self._handle, values, len(self.links)))

    def inverse(
        self,
        q: ArrayLike | None = None,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
        *,
        wrench: Mapping[str, ArrayLike] | None = None,
        t: ArrayLike | None = None,
        want: str | Iterable[str] = "all",
        solver: str = "elimination",
        threads: int = 1,
    ) -> xr.Dataset:
        """Driving forces and joint reactions for a given motion.

        Without ``q``: along the scene's own motion (at ``t``, or at the scene's instants). With ``q``: for a batch.

        Parameters
        ----------
        q, qd, qdd
            (N, n) coordinates [m, rad] in the order of `coordinates`, and their time derivatives; a derivative that
            is not given is zero.
        wrench
            Loads beside those of the scene: marker ("platform.tool") to (N, 6) or (6,) values Fx Fy Fz [N] Mx My Mz
            [N m] in world axes; planar (N, 3) or (3,) Fx Fy Mz.
        t
            (N,) or one instant [s] at which the scene's loads act; default: the scene's instants without ``q``,
            else 0.
        want
            "driving_force", "reaction", "joint_variable", "power", "checks" or several of them, or "all". What is
            not wanted is not computed.
        solver
            "elimination", "lapack", "gauss-jordan" or "reduced".
        threads
            Number of threads.

        Returns
        -------
        xarray.Dataset
            As the executable writes it: driving_force (sample, actuator), reaction (sample, joint, component), ...
            A sample that failed is NaN, its ``status`` is not 0.

        Raises
        ------
        InputError
            A wrong shape or dtype, NaN or infinite values, an unknown marker, solver or result.
        """
        along_motion = q is None
        if along_motion and (qd is not None or qdd is not None):
            raise InputError("qd, qdd: given without q")
        wanted = want if isinstance(want, str) else ",".join(want)
        handle, names = self._handle_for(tuple(wrench or ()))
        schema = _bind.describe_results(handle, wanted, along_motion)
        loads = list((wrench or {}).items())
        if along_motion:
            instants = self.times() if t is None else self._instants(t)
            given: dict[str, Any] = {"time": instants}
            given["q"], given["qd"], given["qdd"], load = _bind.motion(
                handle, instants, len(self.coordinates), len(names)
            )
        else:
            given = {"q": self._batch("q", q, None)}
            n = len(given["q"])
            for name, values in (("qd", qd), ("qdd", qdd)):
                given[name] = np.zeros_like(given["q"]) if values is None else self._batch(name, values, n)
            load = self._loads_at(handle, 0.0 if t is None else t, n, len(names))
        n = len(given["q"])
        extra = [self._wrench(marker, values, n) for marker, values in loads]
        outputs = result_arrays(schema, n)
        _run(handle, str(solver), _count("threads", threads), given, load, extra, outputs)
        return to_dataset(schema, given | outputs, self.description, self.text, solver)

    def _handle_for(self, markers: tuple[str, ...]) -> tuple[int, tuple[str, ...]]:
        """Handle and load names of the scene with loads at these markers too; the last such scene is kept."""
        if not markers:
            return self._handle, self.loads
        if not all(isinstance(marker, str) for marker in markers):
            raise InputError('wrench: expected marker names such as "platform.tool" as keys')
        if self._with_loads is None or self._with_loads[0] != markers:
            handle = _bind.add_loads(self._handle, markers)
            weakref.finalize(self, _bind.close_scene, handle)
            self._with_loads = (markers, handle)
        return self._with_loads[1], self.loads + markers

    def _loads_at(self, handle: int, t: ArrayLike, n: int, n_load: int) -> NDArray[np.float64]:
        """The scene's loads (N or 1, n_load, 6) at the instants of a batch."""
        instants = self._instants(t)
        if len(instants) not in (1, n):
            raise InputError(f"t: expected one instant or shape ({n},), got ({len(instants)},)")
        return _bind.motion(handle, instants, len(self.coordinates), n_load)[3]

    def _batch(self, name: str, values: ArrayLike, n: int | None) -> NDArray[np.float64]:
        columns = len(self.coordinates)
        return _bind.as_floats(name, values, (n, columns), f"({'N' if n is None else n}, {columns})")

    def _instants(self, t: ArrayLike) -> NDArray[np.float64]:
        instants = _bind.as_floats("t", t, (None,) * min(1, np.ndim(t)), "(N,)").reshape(-1)
        bad = np.flatnonzero(~np.isfinite(instants))
        if bad.size:
            raise InputError(f"t[{bad[0]}] is not a finite number")
        return instants

    def _wrench(self, marker: str, values: ArrayLike, n: int) -> NDArray[np.float64]:
        """A given wrench as (N or 1, 6)."""
        name, width = f"wrench[{marker!r}]", 3 if self.planar else 6
        if np.ndim(values) == 1:
            array = _bind.as_floats(name, values, (width,), f"({n}, {width}) or ({width},)")[np.newaxis]
        else:
            array = _bind.as_floats(name, values, (n, width), f"({n}, {width}) or ({width},)")
        if not self.planar:
            return array
        full = np.zeros((len(array), _bind.LOAD_WIDTH))
        full[:, [0, 1, 5]] = array
        return full


def _run(
    handle: int,
    solver: str,
    threads: int,
    given: dict[str, NDArray[np.float64]],
    load: NDArray[np.float64],
    extra: list[NDArray[np.float64]],
    outputs: dict[str, NDArray[Any]],
) -> None:
    """Blocks of samples through the engine; loads are spread over the samples block by block."""
    n = len(given["q"])
    n_own = load.shape[1] - len(extra)
    for first in range(0, n, BLOCK):
        block = slice(first, min(first + BLOCK, n))
        if extra or len(load) != n:
            spread = np.empty((block.stop - first, *load.shape[1:]))
            spread[:, :n_own] = (load if len(load) == 1 else load[block])[:, :n_own]
            for k, values in enumerate(extra):
                spread[:, n_own + k] = values if len(values) == 1 else values[block]
        else:
            spread = load[block]
        inputs = (given["q"][block], given["qd"][block], given["qdd"][block], spread)
        _bind.inverse(handle, solver, threads, first, inputs, {name: values[block] for name, values in outputs.items()})


def _source(source: Any) -> tuple[bytes, str, str | os.PathLike[str]]:
    """Bytes of a scene, its name in messages, its folder."""
    if isinstance(source, Mapping):
        return tomli_w.dumps(_plain(source)).encode(), "scene", "."
    if isinstance(source, str) and ("\n" in source or not source.strip()):
        return source.encode(), "scene", "."
    if not isinstance(source, (str, os.PathLike)):
        raise InputError(f"scene: expected a path, a text or a dict, got {type(source).__name__}")
    path = Path(source)
    return path.read_bytes(), str(path), path.parent


def _plain(value: Any) -> Any:
    """Numpy arrays and numbers, tuples and paths as what TOML knows; values that are None are left out."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (np.ndarray, np.generic)):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def _names(entries: list[dict[str, Any]]) -> tuple[str, ...]:
    return tuple(entry["name"] for entry in entries)


def _count(name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise InputError(f"{name}: expected a whole number from 1 on, got {value!r}")
    return int(value)
