"""The scene: a mechanism read, checked and planned by the engine."""

from __future__ import annotations

import datetime
import math
import os
import tomllib
import weakref
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from . import _bind
from ._accessor import count, table
from ._arguments import as_count, as_finite, as_flag, as_floats, as_mapping, as_name, as_names, as_number, as_path, as_real, by_labels, dimensions, quoted
from ._assemblies import Assemblies, assemblies_of
from ._changes import changed
from ._code import GeneratedCode
from ._lines_of_dict import told_by_keys
from ._listing import only
from ._other_assemblies import Stretch, count_others
from ._output import scene_inputs
from ._pose import Pose, as_poses, attitude_variables, pose_columns, quaternion_of
from ._progress import Progress
from .errors import FileError, InputError, Interrupted, MissingFileError, SceneError
from .results import FILE, FOLDER, RunTemplate, ensemble_dataset, event_variables, passed_stops, result_shapes, with_instants
from .study import run_study
from .sweep import run_sweep

if TYPE_CHECKING:
    from ._cycle.balance import Balance
    from .simulator import Simulator

__all__ = ["Scene", "Poses", "load"]
__dir__ = only(__all__)

BLOCK = 65536
"""Samples in one call of the engine: an interrupt (Ctrl-C) is heard between two calls."""
RUN_BLOCK, RUN_VALUES, BREATH = 4096, 1 << 20, 0.25
"""Instants of a forward run, their values, and seconds, in one call of the engine at most."""
ENSEMBLE_BLOCK = 512
"""Members of an ensemble in one call of the engine."""
_START = np.zeros(1)
"""The instant of states without one."""
DEEPEST = 32
"""Tables and lists inside each other, in a scene given as a mapping."""


@dataclass(frozen=True)
class _Job:
    """What calls of one kind have in common."""

    handle: int
    """Of the scene with the loads of ``wrench``."""
    n_load: int
    engine: _bind.Inverse
    shapes: dict[str, tuple[tuple[int, ...], type]]
    """Shape of one sample and dtype of every result."""
    sample_bytes: int
    """Memory of all results of a sample."""
    load: NDArray[np.float64]
    """(1, n_load, 6) loads of the scene at the instant 0."""
    template: Callable[[], RunTemplate]
    """Of the Datasets, made when it is wanted first."""


@dataclass(frozen=True)
class Poses:
    """Where the moving links are."""

    position: NDArray[np.float64]
    """(N, n_link, 3) origins [m], in the order of ``scene.links``."""
    rotation: NDArray[np.float64]
    """(N, n_link, 3, 3) from link to world axes."""
    status: NDArray[np.intc]
    """(N,) 0 where the mechanism can be assembled."""

    @property
    def quaternion(self) -> NDArray[np.float64]:
        """(N, n_link, 4) the same as unit quaternions w x y z, w not negative."""
        return quaternion_of(self.rotation)

    def __repr__(self) -> str:
        apart = np.flatnonzero(self.status)
        return f"<linkdyn.Poses: {count(self.position, 'sample')}{f', {len(apart)} of them cannot be assembled' if len(apart) else ''}>"


def load(path: str | os.PathLike[str]) -> Scene:
    """Read a scene file.

    Parameters
    ----------
    path
        TOML file; its tables are looked up beside it.

    Raises
    ------
    FileError
        It cannot be read; a `MissingFileError`, and so a `FileNotFoundError`, where there is none.
    SceneError
        Something is wrong in it: file, line, what, what was expected.
    """
    return Scene(Path(as_path("path", path)))


def _mass_text(mass: float) -> str:
    """With four digits, whole kilograms from 10 t on."""
    return f"{mass:.0f} kg" if 1e4 <= mass < 1e7 else f"{mass:.4g} kg"


def _read_again(text: str, folder: str, file: str | None) -> Scene:
    """A scene from what `Scene.__reduce__` keeps of it."""
    scene = Scene(text, folder=folder)
    scene._file = file
    return scene


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
    actuators, clutches, controllers, joints, links, loads : tuple of str
        Names; ``links`` are the moving ones.
    text : str
        The scene file; if it includes others, written anew with all of them.
    folder : str
        Where its tables are looked up.
    description : dict
        All of the above with units, markers and mass properties.
    """

    def __init__(
        self, source: str | os.PathLike[str] | Mapping[str, Any], folder: str | os.PathLike[str] | None = None
    ) -> None:
        data, name, beside, file = _source(source)
        where = as_path("folder", beside if folder is None else "." if isinstance(folder, str) and folder == "" else folder)
        self._open(data, name, where, None if file is None else os.path.abspath(file), by_keys=isinstance(source, Mapping))

    def _open(self, data: bytes, name: str, folder: str, file: str | None, by_keys: bool, original: int = 0) -> None:
        """Have a text read; faults in one that was made of a mapping are told by its keys."""
        text = data.decode("utf-8", errors="replace")
        try:
            handle = _bind.open_scene(data, name, folder, original)
        except SceneError as error:
            raise (SceneError(told_by_keys(str(error), text)) if by_keys else error) from None
        self._file = file
        self.folder = os.path.abspath(folder)  # the working folder may change before the tables are read again
        self._finalizer = weakref.finalize(self, _bind.close_scene, handle)
        self._handle = handle
        self.description = _bind.describe_scene(handle)
        self.text = self.description.pop("text", text)  # with what it includes
        self.title: str = self.description["title"]
        self.planar: bool = self.description["planar"]
        self.coordinates = _names(self.description["coordinates"])
        self.actuators = _names(self.description["actuators"])
        self.clutches = _names(self.description["clutches"])
        self.controllers = _names(self.description["controllers"])
        self.joints = _names(self.description["joints"])
        self.links = _names(self.description["links"][1:])
        self.loads = _names(self.description["loads"])
        self._handles: dict[tuple[str, ...], int] = {(): handle}
        self._clear: Stretch = None  # where no change point is met
        self._jobs: dict[tuple[Any, ...], _Job] = {}
        self._forward: dict[tuple[str, str, bool], tuple[dict[str, tuple[tuple[int, ...], type]], RunTemplate]] = {}

    def __reduce__(self) -> tuple[Callable[[str, str, str | None], Scene], tuple[str, str, str | None]]:
        """Copies, and what goes to other processes, are read anew: the engine's handle is this scene's, and this process's, own."""
        return _read_again, (self.text, self.folder, self._file)

    def __repr__(self) -> str:
        return (
            f"<linkdyn.Scene {self.title!r}: {count(self.links, 'link')}, {count(self.joints, 'joint')}, "
            f"{count(self.coordinates, 'coordinate')}, {count(self.actuators, 'actuator')}>"
        )

    def _repr_html_(self) -> str:
        kinds = Counter(joint["type"] for joint in self.description["joints"])
        return table(
            {
                "title": self.title,
                "space": "planar" if self.planar else "spatial",
                "links": f"{len(self.links)} moving, {_mass_text(sum(link['mass'] for link in self.description['links']))}",
                "joints": ", ".join(f"{n} {kind}" for kind, n in kinds.items()),
                "coordinates": ", ".join(self.coordinates),
                "actuators": ", ".join(self.actuators),
                "loads": ", ".join(self.loads),
            }
        )

    def with_(self, changes: Mapping[str, Any]) -> Scene:
        """The scene with some values changed; this one stays as it is.

        Parameters
        ----------
        changes
            Path in the scene file to new value. Tables of a list go by their name, coordinates and actuators by their
            joint (or link), loads by their marker: "link.crank.mass", "actuator.J1.law.value", "spring.S1.rest",
            "coordinate.J1.start", "time.end"; "link.crank.cog[0]" is the first of a list: as in sweeps. What refers to
            "variables.L" follows it. ``None`` takes a key or table out; a table puts or replaces one:
            ``{"actuator.J1.law": {"type": "constant", "value": 3.0}}``.

        Raises
        ------
        InputError
            A path leads nowhere.
        SceneError
            The scene changed so cannot be computed.

        Examples
        --------
        >>> scene = linkdyn.load("examples/fourbar/scene.toml")
        >>> heavier = scene.with_({"link.crank.mass": 300.0, "time.end": "2 s"})
        """
        paths = as_mapping("changes", changes, "new values by their paths, such as 'link.crank.mass'")
        plain = {path: None if value is None else _plain(value, path) for path, value in self._with_units(paths).items()}
        return self._variant(changed(self._content, plain, self._variant))

    def _variant(self, content: dict[str, Any]) -> Scene:
        """Another content, made of this scene's file, of what TOML knows: both share what is traced."""
        scene = Scene.__new__(Scene)
        scene._open(tomli_w.dumps(content).encode(), "scene", self.folder, self._file, by_keys=True, original=self._handle)
        scene._content = content
        return scene

    @cached_property
    def _content(self) -> dict[str, Any]:
        """What the text says, read once for all that is made of it: not to be changed."""
        return tomllib.loads(self.text)

    def _inputs(self) -> list[tuple[str, str]]:
        """Files that it was read from, and what each of them is: nothing made of it may replace them."""
        return list(scene_inputs(self._file, self.text, self.folder))

    @property
    def _origin(self) -> dict[str, str]:
        """Of the encoding of its runs."""
        return {FOLDER: self.folder} | ({} if self._file is None else {FILE: self._file})

    def _with_units(self, paths: Mapping[str, Any]) -> dict[str, Any]:
        """Numbers for variables that have a unit are in SI, as in sweeps: what refers to them wants the unit."""
        units = {f"variables.{variable['name']}": variable["unit"] for variable in self.description["variables"]}
        return {
            path: f"{float(value)!r} {units[path]}" if units.get(path) and _is_number(value) else value for path, value in paths.items()
        }

    def explain(self, matrix: bool = False) -> str:
        """What is modelled, how it is computed, what is left out.

        Parameters
        ----------
        matrix
            Write the equations [A]{F} = b at the scene's first instant out as well, in symbols and in numbers.

        Returns
        -------
        str
            As ``linkdyn explain`` prints it.
        """
        return _bind.explain(self._handle, as_flag("matrix", matrix))

    def assemblies(self) -> Assemblies:
        """All assemblies in which the mechanism closes at its start.

        Loops of dyads close by branches, all of which are found. Larger groups are closed from places at random until eight times as many as led to
        the last new assembly have led to none, 16384 at most: of a platform with forty postures all. Legs that are turned about themselves make
        no others.

        Returns
        -------
        Assemblies
            A list of `Assembly`, the scene's own first. Each has the words that choose it, its joint variables [m, rad] and the places of its links;
            ``is_complete`` of the list is false if there are more than 256, or if attempts came to their end while there still came new ones.

        Examples
        --------
        >>> for assembly in linkdyn.new("five-bar").assemblies():
        ...     print(assembly.number, assembly.words)
        """
        return assemblies_of(_bind.assemblies(self._handle), self.planar)

    def generate(self, kernel: str = "inverse", want: str | Iterable[str] | None = None, name: str | None = None) -> GeneratedCode:
        """C code of a kernel of the scene, for controllers: one file of C99 and its header, as ``linkdyn generate`` writes them.

        Parameters
        ----------
        kernel
            "inverse": driving forces from coordinates, their rates and accelerations, and loads. "forward":
            accelerations from coordinates, rates, loads and driving forces. "kinematics": links and joints from
            coordinates and rates.
        want
            Of "driving_force", "reaction", "joint_variable" and, of kinematics, "position", "velocity"; or "all". Default:
            driving forces of "inverse", all of "kinematics", none beside the accelerations of "forward".
        name
            Of the files, without ending; identifiers begin with it. Default: the kernel's name.

        Returns
        -------
        GeneratedCode
            Texts; ``write(folder)`` makes the files.

        Raises
        ------
        InputError
            A name is unknown, or the scene has no such kernel.

        Examples
        --------
        >>> code = linkdyn.load("examples/stewart_tsai/scene.toml").generate("inverse", name="hexapod")
        >>> code.write("controller")
        """
        kernel = as_name("kernel", kernel)
        name = as_name("name", kernel if name is None else name)
        return GeneratedCode(name, *_bind.generate(self._handle, kernel, as_names("want", want), name), tuple(self._inputs()))

    def times(self) -> NDArray[np.float64]:
        """Instants of the scene's own run [s], shape (N,)."""
        time = self.description["time"]
        n = max(1, time["n_sample"])
        steps = np.arange(n) / max(1, n - 1)
        instants: NDArray[np.float64] = time["first"] + (time["last"] - time["first"]) * steps
        return instants

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
        return self._motion(self._handle, instants, len(self.loads))[:3]

    def _motion(self, handle: int, instants: NDArray[np.float64], n_load: int) -> tuple[NDArray[np.float64], ...]:
        """q, qd, qdd, loads, and attitudes near their poles, which tables of quaternions alone lead there."""
        attitudes = self.description["attitudes"]
        n_attitude = len(attitudes) if any(attitude["by_table"] for attitude in attitudes) else 0
        return _bind.motion(handle, instants, len(self.coordinates), n_load, n_attitude)

    def frame_motion(self, t: ArrayLike | None = None) -> tuple[NDArray[np.float64], ...]:
        """How the frame moves in axes at rest; zeros if it does not.

        Parameters
        ----------
        t
            (N,) instants [s]; default: `times`.

        Returns
        -------
        pose, rate, acceleration
            (N, 6) x y z [m] roll pitch yaw [rad] of the frame's axes, and their time derivatives; of a planar scene (N, 3) x y yaw.
        """
        instants = self.times() if t is None else self._instants(t)
        values = _bind.frame_motion(self._handle, instants)[..., [0, 1, 5] if self.planar else slice(None)]
        return values[:, 0], values[:, 1], values[:, 2]

    def payload_masses(self, t: ArrayLike | None = None) -> NDArray[np.float64]:
        """Masses of the scene's payloads, in the order of the file: (N, number of payloads) [kg].

        Parameters
        ----------
        t
            (N,) instants [s]; default: `times`.
        """
        instants = self.times() if t is None else self._instants(t)
        return _bind.payloads(self._handle, instants, len(self.description["payloads"]))

    def load_values(
        self,
        t: ArrayLike | None = None,
        q: ArrayLike | None = None,
        qd: ArrayLike | None = None,
        *,
        in_order: bool | None = None,
    ) -> NDArray[np.float64]:
        """The scene's own loads: (N, number of loads, 6) Fx Fy Fz [N] Mx My Mz [N m], in the axes of each load.

        Parameters
        ----------
        t
            (N,) instants [s]; default: `times`, or 0 if there are states.
        q, qd
            (N, n) states of the mechanism, for loads that follow it; default: the scene's motion at ``t``.
        in_order
            The states follow each other along a motion, and so does the assembly; default: without ``q``.
        """
        if q is None and t is None:
            instants = self.times()
        else:
            instants = self._instant_or_0(t)
        if not any(load["follows_state"] for load in self.description["loads"]):
            return _bind.loads(self._handle, instants, len(self.loads))
        follows = q is None if in_order is None else as_flag("in_order", in_order)
        if q is None:
            q, qd, _ = self.motion(instants)
        given = self._given(q, qd, None)
        n = len(given["q"])
        if len(instants) not in (1, n):
            raise InputError(f"t: expected one instant or shape ({n},), got ({len(instants)},)")
        return _bind.state_loads(self._handle, follows, given["q"], given["qd"], np.array(np.broadcast_to(instants, n)), len(self.loads))

    def poses(
        self,
        q: ArrayLike | None = None,
        *,
        in_order: bool | None = None,
        joint_variable: ArrayLike | None = None,
        pose: Mapping[str, Pose] | None = None,
    ) -> Poses:
        """Poses of all moving links.

        Parameters
        ----------
        q
            (N, n) or (n,) coordinates [m, rad]; default: the scene's motion.
        in_order
            The samples follow each other along a motion, and so does the assembly, as in
            `inverse`; otherwise each is on the branch of the start. Default: only without ``q``.
        joint_variable
            (N, n_variable) all joint variables instead of the coordinates, as results have them [m, rad]: they tell the
            assembly, also where the coordinates do not, as in a forward run through their dead points (status 1 where no joints
            lead to a link from the frame).
        pose
            Poses of links that are coordinates, as in `inverse`.

        Returns
        -------
        Poses
            Of N samples: places and rotations of the links, and ``status``, 0 where the mechanism can be assembled.

        Raises
        ------
        InputError
            A wrong shape, no numbers, both ``q`` and ``joint_variable``.
        """
        if joint_variable is not None:
            if q is not None or pose is not None:
                raise InputError(f"{'q' if pose is None else 'pose'}, joint_variable: give one of them")
            schema = _bind.describe_results(self._handle, "elimination", "joint_variable", False, is_forward=True)
            (width,), _ = result_shapes(schema)["joint_variable"]
            joint_variable = by_labels("joint_variable", joint_variable, next(of["labels"] for of in schema["dimensions"] if of["name"] == "variable"))
            variables = as_floats("joint_variable", joint_variable, (None, width))
            return Poses(*_bind.poses(self._handle, variables, len(self.links), False, by_joints=True))
        follows = (q is None and pose is None) if in_order is None else as_flag("in_order", in_order)
        if pose is not None:
            q = self._given_poses(pose, q, None, None)[0]["q"]
        elif q is None:
            q = self.motion()[0]
        values = self._batch("q", q, None, one=True)
        return Poses(*_bind.poses(self._handle, values, len(self.links), follows))

    def inverse(
        self,
        q: ArrayLike | None = None,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
        *,
        pose: Mapping[str, Pose] | None = None,
        wrench: Mapping[str, ArrayLike] | None = None,
        t: ArrayLike | None = None,
        in_order: bool | None = None,
        want: str | Iterable[str] | None = None,
        solver: str = "elimination",
        threads: int = 1,
        error: bool = False,
    ) -> xr.Dataset:
        """Driving forces and joint reactions for a given motion.

        Without ``q``: along the scene's own motion (at ``t``, or at the scene's instants). With ``q``: for a batch.
        For many small batches `solve` is quicker.

        Parameters
        ----------
        q, qd, qdd
            (N, n) coordinates [m, rad] in the order of `coordinates`, and their time derivatives; a derivative that
            is not given is zero.
        pose
            Links whose pose is a coordinate, {"platform": `Pose`}, and ball joints whose three angles are: their attitudes as quaternions
            or rotation matrices, with angular velocities and accelerations, right at every attitude. Columns of ``q`` and its
            derivatives for these are not read, and ``q`` may be left out where nothing else is a coordinate. Results have them as
            ``quaternion``, ``angular_velocity``, ``angular_acceleration``; ``q``, ``qd``, ``qdd`` tell the angles, whose rates at the pole
            are as large as numbers are.
        wrench
            Loads beside those of the scene: marker ("platform.tool") to (N, 6) or (6,) values Fx Fy Fz [N] Mx My Mz
            [N m] in world axes; planar (N, 3) or (3,) Fx Fy Mz.
        t
            (N,) or one instant [s] at which the scene's loads act, with ``q`` kept in the results as the coordinate ``instant``; default: the
            scene's instants without ``q``, else 0. Where the frame moves or a payload's mass changes, ``q`` asks for it.
        in_order
            The samples follow each other along a motion that begins at the start of the scene, and so does the assembly, as in `poses`;
            otherwise each is on the branch of the start. Default: only without ``q`` and ``pose``.
        want
            "driving_force", "reaction", "joint_variable", "power", "checks", "friction", "motor", "rcond", "singularity_distance" or
            several of them, or "all": the first seven (solver lapack has "rcond" among its checks); default: all that the solver
            gives but the last two. What is not wanted is not computed.
        solver
            "elimination", "lapack", "gauss-jordan" or "reduced", which gives all but the reactions; "gauss-jordan-plain", which
            does not pivot, for comparison only.
        threads
            Number of threads.
        error
            Also the errors of driving forces and reactions, estimated: ``driving_force_error``, ``reaction_error`` and
            the worst of them relative to the largest force or moment, ``error``.

        Returns
        -------
        xarray.Dataset
            As the executable writes it: driving_force (sample, actuator), reaction (sample, joint, component), ...
            A sample that failed is NaN, its ``status`` is not 0. Of samples in order "assembly" says of a sample whether a change
            point was passed before it, or its assembly found anew from the start, and ``attrs["failure"]`` why the assembly was lost first, if it
            was, or which law or spring left a sample undefined. ``attrs["other_in_order"]`` of samples on their own counts those to
            which the way from the start leads on another assembly, past a change point: looked for where there is one coordinate, whose
            samples lie on one way, or where ``t`` increases; a warning says so. ``attrs["beyond_stops"]`` names end stops with
            `restitution` that the motion passes, ``attrs["coarse_sampling"]`` a coordinate that goes so far from sample to sample that peaks are missed.

        Raises
        ------
        InputError
            A wrong shape or dtype, NaN or infinite values, an unknown marker, solver or result.
        """
        if q is None and (qd is not None or qdd is not None):
            raise InputError("qd, qdd: given without q")
        along_motion = q is None and pose is None
        follows = along_motion if in_order is None else as_flag("in_order", in_order)
        job = self._job(want, solver, wrench, follows, error)
        if along_motion:
            instants = self.times() if t is None else self._instants(t)
            *motion, load, attitude = self._motion(job.handle, instants, job.n_load)
            given = {"time": instants} | dict(zip(("q", "qd", "qdd"), motion))
        else:
            self._require_instants(t)
            if q is None or pose is not None:
                given, attitude = self._given_poses(pose, q, qd, qdd)
            else:
                given, attitude = self._given(q, qd, qdd), _bind.NO_ATTITUDE
            load = self._loads_at(job, t, len(given["q"]))
        extra = self._wrenches(wrench, len(given["q"]))
        outputs, roads, passed, failure = self._run(
            job, threads, given, load, extra, self._instant_or_0(t), attitude, in_order=follows
        )
        told = self._told(extra, len(given["q"]))
        data = job.template().fill(given | outputs, roads, passed, told)
        if along_motion and not follows:
            data = with_instants(data, given["time"])
        elif t is not None and not along_motion:
            data = with_instants(data, self._instants(t))
        if pose:
            data = data.assign(attitude_variables(pose))
        data.encoding |= self._origin
        if "assembly" in data or failure:
            data.attrs["failure"] = failure
        if not follows and pose is None and self._has_assemblies:
            data.attrs["other_in_order"] = count_others(self, given["q"], data.status.values, None if t is None else self._instants(t))
        if along_motion:
            data.attrs["coarse_sampling"] = _bind.sampling(self._handle, given["time"], given["q"], given["qd"], given["qdd"])
        if any(stop["is_hard"] for stop in self.description["stops"]):
            data.attrs["beyond_stops"] = passed_stops(self.description, data)
        return data

    def simulator(
        self, *, method: str | None = None, step: float = 1e-3, rtol: float = 1e-9, atol: float = 1e-9, t: float = 0.0
    ) -> Simulator:
        """The mechanism at its start, to be stepped under forces that the caller gives: for controllers written in Python.

        Parameters
        ----------
        method, step, rtol, atol
            As for `forward`. "rk4" with a fixed step is the fastest where little accuracy is asked for.
        t
            Instant at which it begins [s].

        Returns
        -------
        Simulator

        Raises
        ------
        InputError
            The start cannot be assembled; a setting is wrong.

        Examples
        --------
        >>> simulator = linkdyn.load("examples/fivebar_motors/scene.toml").simulator()
        >>> simulator.step(1e-3, [0.5, -0.5])
        """
        from .simulator import Simulator

        settings = (as_real("step", step), as_real("rtol", rtol), as_real("atol", atol))
        method = _bind.default_method() if method is None else as_name("method", method)
        return Simulator(self, self._handle, method, settings, as_number("t", t))

    def linearize(
        self,
        t: float | None = None,
        *,
        q: ArrayLike | None = None,
        qd: ArrayLike | None = None,
        effort: ArrayLike | None = None,
        outputs: str | Iterable[str] | None = None,
    ) -> xr.Dataset:
        """The mechanism near a state as a linear system, x' = A x + B u, y = C x + D u, for the design of controllers.

        x are deviations of coordinates and their rates, u of what actuators are told. The matrices are exact derivatives of the equations of
        motion: no step is taken. Springs, dampers, friction, loads and laws over the state have their part in A, as have laws of actuators that
        compare the motion of a joint; u comes on top of these. Coordinates that a forward run leads along a motion are free here. What changes with time
        alone stands still.

        Parameters
        ----------
        t
            Instant [s] of laws, and of the scene's motion; default: its first one.
        q, qd
            (n_q,) Coordinates and their rates [m, rad; /s]; default: those of the scene's motion at ``t``, or of its start. Of several assemblies
            at q it is the one that the way from the scene's start leads to.
        effort
            (n_actuator,) What the actuators are told, as `Simulator.step` takes it: their laws play no part then. Default: what their laws
            tell; of an actuator without one the driving force of the scene's motion, or where q or qd is given the one that keeps all rates
            (zero where there are fewer drives than coordinates).
        outputs
            Of "q", "qd", "qdd", "joint_variable", "joint_rate", all of a kind, or single ones such as "qdd[J1]"; default: "q" and "qd".

        Returns
        -------
        xarray.Dataset
            "A" (state, state_in), "B" (state, input), "C" (output, state_in), "D" (output, input) in SI units; "x" (state), "u" (input) and "y"
            (output), the values linearized at; "residual" (state), the rates of the state there, zero at an equilibrium (``attrs["is_equilibrium"]``:
            1 where none exceeds 1e-9). Eigenvalues of A by "growth" [1/s] and "angular_frequency" [rad/s] (pole), their real and imaginary
            parts, with "frequency" [Hz] and "damping_ratio". Coordinates "state_unit", "input_unit", "output_unit".
            ``.linkdyn.to_control()`` makes it a system of python-control, ``scipy.signal.StateSpace(*(lin[m].values for m in "ABCD"))`` one of SciPy.

        Raises
        ------
        InputError
            A part with a state of its own or that may hold: a controller, clutch, brake, winding, cylinder, a joint that sticks, a motor that
            loses torque or is at its limits, a stop that is touched. A state that cannot be assembled, or at a dead point.

        Examples
        --------
        >>> lin = linkdyn.load("examples/fourbar/scene.toml").linearize(0.3, outputs=["q", "qdd[J1]"])
        >>> lin.A.shape, lin.D.shape
        ((2, 2), (2, 1))
        """
        from ._linear import linearize

        return linearize(self, t, q, qd, effort, outputs)

    def forward(
        self,
        t_end: float | None = None,
        *,
        t: ArrayLike | None = None,
        method: str | None = None,
        step: float = 1e-3,
        rtol: float = 1e-9,
        atol: float = 1e-9,
        want: str | Iterable[str] | None = None,
        solver: str = "elimination",
        threads: int = 1,
        progress: bool | None = None,
        error: bool = False,
        switch: bool = True,
    ) -> xr.Dataset:
        """Motion and joint reactions from the laws of the scene's actuators, from the scene's start on.

        Parameters
        ----------
        t_end
            End of the run [s]; default: the scene's. Output comes at as many instants as the scene has (201 if it
            says nothing).
        t
            (N,) increasing instants of output [s] instead; the run starts at the first.
        method
            "rk8pd" or "rkf45" (adaptive), "gbs" (adaptive, high order: many digits), "seulex" or "msbdf" (adaptive,
            for stiff scenes), "rk4" (fixed step). Default: "rk8pd"; "gbs" in a build without GSL.
        step
            The fixed step, or the first one tried [s].
        rtol, atol
            Error allowed in a step, relative and absolute [m, rad, and these in a second]; no more than 1e-4
            (msbdf: 1e-5) is, and ``attrs["tolerance"]`` says what was. What has gone less than 0.01 so far is allowed that much less, so that
            small motions have digits, too.
        want, solver, threads
            As for `inverse`, and "controller", "clutch" and "cylinder"; "power" brings the energies and the work too. Without ``want`` all is
            computed but the singularity distance and errors; what costs nothing, such as the motion, is always there.
        progress
            Say how far the run is and how long it will take, if it takes over two seconds; default: on a terminal.
        error
            Also the error that the run has gathered since its start, estimated: "q_error", "qd_error", "qdd_error",
            "driving_force_error", "reaction_error", "joint_rate_error". Takes up to five times as long.
        switch
            Let another joint variable be integrated where a coordinate comes to its dead point.
            The results stay in the scene's coordinates; "stand_in" and ``attrs["coordinates_integrated"]`` say what was
            integrated when. False: the run stops there.

        Returns
        -------
        xarray.Dataset
            As the executable writes it. A run that cannot go on is NaN from there: ``attrs["stopped"]`` says why. One that an
            event of the scene ends has its last sample at the instant of the event. What has happened, events and contacts with
            stops, stands along the dimension "event"; where forces are wanted results that jump there, "event_reaction" and others, are told
            along "side", just before and just behind it.

        Raises
        ------
        InputError
            Instants that do not increase, a step or tolerance that is not positive, an unknown method, a start that
            cannot be assembled, too many or too few actuators.
        UnavailableError
            "rk8pd", "rkf45" or "msbdf" in a build without GSL.
        Interrupted
            Ctrl-C, a `KeyboardInterrupt` that keeps the results so far as ``result``.
        """
        instants = self._output_instants(t_end) if t is None else self._increasing(t)
        if t is not None and t_end is not None:
            raise InputError("t, t_end: give one of them")
        wanted, has_errors = as_names("want", want), as_flag("error", error)
        method = _bind.default_method() if method is None else as_name("method", method)
        solver = as_name("solver", solver)
        shows = None if progress is None else as_flag("progress", progress)
        settings = (as_real("step", step), as_real("rtol", rtol), as_real("atol", atol))
        kind = (method, solver, as_count("threads", threads))
        kind_of_run = (solver, wanted, has_errors)
        if kind_of_run not in self._forward:
            schema = _bind.describe_results(self._handle, solver, wanted, True, is_forward=True, error=has_errors)
            template = RunTemplate(schema, self.description, self.text, solver)
            self._forward[kind_of_run] = (result_shapes(schema, True), template)
        span = (float(instants[0]), float(instants[-1]))
        run = _bind.Run(self._handle, *kind, settings, as_flag("switch", switch), wanted, has_errors, *span)
        try:
            return self._follow(run, instants, *self._forward[kind_of_run], method, shows)
        finally:
            run.finish()

    def _follow(
        self,
        run: _bind.Run,
        t: NDArray[np.float64],
        shapes: dict[str, tuple[tuple[int, ...], type]],
        template: RunTemplate,
        method: str,
        progress: bool | None,
    ) -> xr.Dataset:
        """Through all instants of output, with an ear for interrupts."""
        found: dict[str, NDArray[Any]] = {name: np.empty((len(t), *shape), kind) for name, (shape, kind) in shapes.items()}
        length = max(1, min(RUN_BLOCK, RUN_VALUES // sum(math.prod(shape) for shape, _ in shapes.values())))
        n_done = 0

        def result() -> xr.Dataset:
            arrays = {name: values[:n_done] for name, values in found.items()}
            data = template.fill(arrays, run.roads, run.n_passed)
            data.encoding |= self._origin
            names = ("steps", "rejected_steps", "right_hand_sides")
            data.attrs |= {"method": method, **dict(zip(names, map(int, run.statistics)))}
            data.attrs |= {"tolerance": run.tolerance, "rounding": run.rounding, "stopped": run.stopped}
            data.attrs["coordinates_integrated"] = run.coordinates
            if self.description["events"]:
                variables, labels = event_variables(self.description, *run.events(len(self.description["coordinates"])))
                data = data.assign(variables).assign_coords(labels)
                variables, labels = template.beside_events(run.event_results({name: shapes[name] for name in template.jumps}) if template.jumps else {})
                data = data.assign(variables).assign_coords(labels)
            return data

        sign = Progress(progress)
        try:
            while n_done < len(t):
                n, arrays = run.advance(t[n_done : n_done + length], shapes, BREATH)
                for name, values in arrays.items():
                    found[name][n_done : n_done + n] = values
                n_done += n
                if run.is_over:
                    break
                sign.show((run.reached - t[0]) / (t[-1] - t[0]) if len(t) > 1 else 1.0)
        except KeyboardInterrupt:
            run.stopped = f"interrupted at t = {min(run.reached, t[-1]):.6g} s"
            raise Interrupted(run.stopped, result() if n_done else None) from None
        finally:
            sign.end()
        return result()

    def ensemble(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        t: ArrayLike,
        *,
        step: float = 1e-3,
        threads: int = 1,
        progress: bool | None = None,
    ) -> xr.Dataset:
        """Many forward runs from different starts, side by side: a tenth of the time each takes alone, by method rk4.

        Parameters
        ----------
        q, qd
            (N, n) coordinates [m, rad] and rates at the first instant, one row a member.
        t
            (M,) increasing instants of output [s]; the runs start at the first.
        step
            The fixed step of the integrator [s].
        threads
            Threads that share the members.
        progress
            As for `forward`.

        Returns
        -------
        xarray.Dataset
            "q" and "qd" (member, time, coordinate), NaN from where a member cannot go on, "good_until" (member) [s], its
            last good instant, "status" (member), 0 if it came to the end (its own, where an event ends it) or what it met there,
            named as for `inverse`, and "change_points_passed" (member). Events as in `forward`, with "event_member". Forces at
            any of these states: `inverse`. A member for which `step` is too long ends as "not_converged" does: ``attrs["stopped"]``
            says what moves too fast and how long steps may be.

        Raises
        ------
        InputError
            Wrong shapes, numbers that are not finite, instants that do not increase, a step that is not positive.
        """
        instants = self._increasing(t)
        settings = (as_real("step", step), as_count("threads", threads))
        start = self._batch("q", q, None)
        rate = self._batch("qd", qd, len(start))
        parts: list[tuple[NDArray[Any], ...]] = []
        events: list[tuple[NDArray[Any], ...]] = []
        has_events, stopped = bool(self.description["events"]), ""
        n_done, sign = 0, Progress(None if progress is None else as_flag("progress", progress))
        try:
            while n_done < len(start) or not parts:
                block = slice(n_done, n_done + ENSEMBLE_BLOCK)
                part, happened, reason = _bind.ensemble(self._handle, start[block], rate[block], instants, *settings, has_events)
                happened[0][:, 0] += n_done
                stopped = stopped or reason
                parts.append(part)
                events.append(happened)
                n_done += ENSEMBLE_BLOCK
                sign.show(min(1.0, n_done / max(1, len(start))))
        finally:
            sign.end()
        schema = _bind.describe_results(self._handle, "elimination", "joint_variable", False, is_forward=True)
        data = ensemble_dataset(
            schema, self.description, self.text, instants, *(np.concatenate(arrays) for arrays in zip(*parts))
        )
        data.attrs["stopped"] = stopped
        data.encoding |= self._origin
        if not has_events:
            return data
        kinds, *rest = (np.concatenate(arrays) for arrays in zip(*events))
        variables, labels = event_variables(self.description, kinds[:, 1:], *rest)
        member = ("event", kinds[:, 0] - 1, {"long_name": "member that it happened to"})
        return data.assign(variables | {"event_member": member}).assign_coords(labels)

    def balance(
        self, links: Iterable[str] | None = None, minimise: str = "rms", harmonics: Iterable[int] = (1,)
    ) -> Balance:
        """Counterweights on links hinged to the frame that shake it least along the scene's motion.

        Parameters
        ----------
        links
            That may carry one; default: all that turn about a hinge of the frame.
        minimise
            "rms", "peak" or "harmonics" of the force of inertia on the frame.
        harmonics
            Which, for "harmonics": 1 is one wave a cycle.

        Returns
        -------
        Balance
            ``counterweights`` (mass times distance and angle), ``figures`` before and after, ``plot()``, ``with_counterweights(radius)``.

        Raises
        ------
        InputError
            A link that is not hinged to the frame, an unknown goal, samples that failed.

        Examples
        --------
        >>> found = linkdyn.load("examples/slider_crank/scene.toml").balance(["crank"], "harmonics")
        >>> found.with_counterweights({"crank": 0.06}).inverse()         # doctest: +SKIP
        """
        from ._cycle.balance import balance

        return balance(self, links, minimise, harmonics)

    def study(self, t_end: float | None = None) -> xr.Dataset:
        """Time against error of every solver and integrator on this scene.

        Errors are taken against the quadruple twin if it is built (``make real128``), else against the most careful
        result in double precision; ``attrs["reference"]`` says which. `linkdyn.plot.study` draws it.

        Parameters
        ----------
        t_end
            End of the forward runs [s]; default: the scene's.

        Returns
        -------
        xarray.Dataset
            A row for each method and setting: seconds, error, steps; ``attrs["report"]`` is the printed table, with
            recommendations.

        Raises
        ------
        LinkdynError
            Neither inverse nor forward dynamics of the scene can be computed.
        """
        return run_study(self.text, self.folder, None if t_end is None else float(self._output_instants(t_end)[-1]))

    def sweep(
        self,
        sweep: Mapping[str, Any] | None = None,
        *,
        keep: str | Iterable[str] = (),
        solver: str = "elimination",
        threads: int = 1,
        progress: bool = False,
        output: str | os.PathLike[str] | None = None,
        resume: bool = False,
        checkpoint: float = 5.0,
    ) -> xr.Dataset:
        """What the table ``[sweep]`` asks for: peaks over a workspace, load cases and designs.

        Memory does not grow with the number of samples, unless they are kept. A run of hours wants an ``output``: it can then be
        interrupted, by Ctrl-C, a signal or the loss of its machine, and gone on with, to the same last bit.

        Parameters
        ----------
        sweep
            The table, as in a scene file (``{"axis": [{"coordinate": "platform.x", "linspace": [0, 1, 5]}, ...]}``);
            default: the scene's own.
        keep
            Quantities to be kept of every sample, e.g. "driving_force", beside those that the table names.
        solver, threads
            As for `inverse`; the results do not depend on the number of threads.
        progress
            Show a bar.
        output
            File for the results, netCDF, as ``linkdyn sweep -o`` writes it. While the sweep is on its way, what is done is kept
            beside it (``FILE.checkpoint``, ``FILE.spool``).
        resume
            Go on with a run for the same ``output`` that was interrupted, in Python or of the executable; without one, begin.
        checkpoint
            Seconds between two checkpoints.

        Returns
        -------
        xarray.Dataset
            As the executable writes it: docs/sweep.md lists the variables.

        Raises
        ------
        SceneError
            Something is wrong in the table: what, what was expected.
        InputError
            The scene has no sweep; an unknown quantity or solver; too many or too few actuators; an interrupted run is kept beside
            the output, which ``resume`` does not ask for; another process is at it.
        FileError
            Output, checkpoint or kept samples cannot be read or written, or are those of another sweep.

        Examples
        --------
        >>> import linkdyn
        >>> scene = linkdyn.load("examples/stewart_workspace/scene.toml")
        >>> run = scene.sweep(output="workspace.nc", resume=True)  # doctest: +SKIP
        """
        if sweep is not None:
            content = self._content | {"sweep": _plain(as_mapping("sweep", sweep, "a table as in a scene file"), "sweep")}
            return self._variant(content).sweep(
                keep=keep, solver=solver, threads=threads, progress=progress, output=output, resume=resume, checkpoint=checkpoint
            )
        if resume and output is None:
            raise InputError("resume: there is no output (expected the name of the results, beside which the interrupted run is kept)")
        seconds = as_real("checkpoint", checkpoint)
        if not seconds >= 0:
            raise InputError(f"checkpoint: {seconds:g} (expected seconds)")
        data = run_sweep(
            self._handle,
            self.folder,
            self.description,
            self.text,
            keep=as_names("keep", keep),
            solver=as_name("solver", solver),
            threads=as_count("threads", threads),
            progress=as_flag("progress", progress),
            output="" if output is None else as_path("output", output),
            resume=as_flag("resume", resume),
            checkpoint=seconds,
            inputs=self._inputs(),
        )
        data.encoding |= self._origin
        return data

    def _output_instants(self, t_end: float | None) -> NDArray[np.float64]:
        """Instants of a forward run: the scene's, or as many up to another end."""
        time = self.description["time"]
        end = time["last"] if t_end is None else as_number("t_end", t_end)
        if not end > time["first"]:
            raise InputError(f"t_end: a run from {time['first']:g} s to {end:g} s has no duration (expected [time] end of the scene, or a later t_end)")
        n = time["n_sample"] if time["n_sample"] > 1 else 201
        return np.linspace(time["first"], end, n)

    def solve(
        self,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
        *,
        wrench: Mapping[str, ArrayLike] | None = None,
        t: ArrayLike | None = None,
        in_order: bool = False,
        want: str | Iterable[str] | None = "driving_force",
        solver: str = "elimination",
        threads: int = 1,
        error: bool = False,
    ) -> dict[str, NDArray[Any]]:
        """What `inverse` computes for a batch, as plain arrays.

        One pose takes some ten microseconds: for loops and optimizers, where the Dataset of `inverse` takes longer
        to build than the forces to compute.

        Parameters
        ----------
        q, qd, qdd, wrench, t, solver, threads, error
            As in `inverse`.
        in_order
            The samples follow each other along a motion from the start of the scene, and so does the assembly, which is among the results.
        want
            As in `inverse`; default: the driving forces alone.

        Returns
        -------
        dict of str to ndarray
            By name, sample first, in the order of `actuators`, `joints`, ...: "driving_force" (N, n_actuator),
            "reaction" (N, n_joint, n_component), ..., and always "status" (N,), 0 where the sample did not fail.
            Units as in `inverse`. The arrays are new and belong to the caller.

        Raises
        ------
        InputError
            As in `inverse`.

        Examples
        --------
        >>> import linkdyn
        >>> scene = linkdyn.load("examples/stewart_tsai/scene.toml")
        >>> q, qd, qdd = scene.motion(0.5)
        >>> scene.solve(q, qd, qdd)["driving_force"].shape
        (1, 6)
        """
        self._require_instants(t)
        follows = as_flag("in_order", in_order)
        job = self._job(want, solver, wrench, follows, error)
        given = self._given(q, qd, qdd)
        n = len(given["q"])
        loads = self._loads_at(job, t, n)
        return self._run(job, threads, given, loads, self._wrenches(wrench, n), self._instant_or_0(t), in_order=follows)[0]

    def _job(
        self,
        want: str | Iterable[str] | None,
        solver: str,
        wrench: Mapping[str, ArrayLike] | None,
        in_order: bool,
        error: bool,
    ) -> _Job:
        """Checked once for calls of one kind."""
        markers = () if wrench is None else tuple(as_mapping("wrench", wrench, 'marker names such as "platform.tool" with their values'))
        wanted, solver, has_errors = as_names("want", want), as_name("solver", solver), as_flag("error", error)
        key = (wanted, solver, markers, in_order, has_errors)
        job = self._jobs.get(key)
        if job is None:
            handle, n_load = self._with_loads(markers)
            schema = _bind.describe_results(handle, solver, wanted, in_order, error=has_errors)
            shapes = result_shapes(schema)
            n_bytes = sum(math.prod(shape) * np.dtype(dtype).itemsize for shape, dtype in shapes.values())
            load = _bind.loads(handle, np.zeros(1), n_load)
            template = cache(partial(RunTemplate, schema, self.description, self.text, solver, markers))
            job = _Job(handle, n_load, _bind.Inverse(handle, solver, shapes), shapes, n_bytes, load, template)
            self._jobs[key] = job
        return job

    @cached_property
    def _has_assemblies(self) -> bool:
        """Do loops close in several ways?"""
        return "assembly" in result_shapes(_bind.describe_results(self._handle, "elimination", "driving_force", True))

    def _with_loads(self, markers: tuple[str, ...]) -> tuple[int, int]:
        """Handle and number of loads of the scene with loads at these markers too."""
        if markers not in self._handles:
            handle = _bind.add_loads(self._handle, markers)
            weakref.finalize(self, _bind.close_scene, handle)
            self._handles[markers] = handle
        return self._handles[markers], len(self.loads) + len(markers)

    def _given(self, q: ArrayLike, qd: ArrayLike | None, qdd: ArrayLike | None) -> dict[str, NDArray[np.float64]]:
        """Coordinates and derivatives of a batch, checked."""
        values = self._batch("q", q, None)
        return {
            "q": values,
            "qd": np.zeros(values.shape) if qd is None else as_floats("qd", by_labels("qd", qd, self.coordinates), values.shape),
            "qdd": np.zeros(values.shape) if qdd is None else as_floats("qdd", by_labels("qdd", qdd, self.coordinates), values.shape),
        }

    def _given_poses(
        self, pose: Mapping[str, Pose] | None, q: ArrayLike | None, qd: ArrayLike | None, qdd: ArrayLike | None
    ) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.float64]]:
        """The same where attitudes are known as quaternions; and those that samples near a pole have to go by (N, n_attitude, 10)."""
        poses = as_poses(as_mapping("pose", pose, 'links that are coordinates, such as "platform", with their Pose'), self.description)
        n = len(next(iter(poses.values())))
        columns = [k for name in poses for k in pose_columns(self, name)]
        if q is None:
            missing = [name for k, name in enumerate(self.coordinates) if k not in columns]
            if missing:
                raise InputError(f"q: expected, for the coordinates that no pose tells: {', '.join(missing)}")
            q = np.zeros((n, len(self.coordinates)))
        given = {name: values.copy() for name, values in self._given(q, qd, qdd).items()}
        if len(given["q"]) != n:
            raise InputError(f"q: expected {n} samples, as many as the pose has, got {len(given['q'])}")
        attitude = np.zeros((n, len(self.description["attitudes"]), _bind.ATTITUDE_WIDTH))
        for k, its in enumerate(self.description["attitudes"]):
            if its["name"] not in poses:
                continue
            motion, angles = poses[its["name"]], [int(c) for c in its["angles"]]
            attitude[:, k] = np.hstack([motion.quaternion, motion.angular_velocity, motion.angular_acceleration])
            for values in given.values():
                values[:, angles] = 0
            if its["is_pose"]:
                place = slice(angles[0] - 3, angles[0])
                given["q"][:, place], given["qd"][:, place], given["qdd"][:, place] = motion.position, motion.velocity, motion.acceleration
        _bind.attitudes(self._handle, attitude, given["q"], given["qd"], given["qdd"])
        return given, attitude

    def _run(
        self,
        job: _Job,
        threads: int,
        given: dict[str, NDArray[np.float64]],
        load: NDArray[np.float64],
        wrench: dict[str, NDArray[np.float64]],
        t: NDArray[np.float64],
        attitude: NDArray[np.float64] | None = None,
        *,
        in_order: bool,
    ) -> tuple[dict[str, NDArray[Any]], NDArray[np.intc], int, str]:
        """Blocks of samples through the engine; loads are spread over the samples block by block.

        Results by name, the roads that samples took, the change points passed on their way, and why the first sample was lost that was:
        its assembly along a motion, or a joint that friction locks.
        """
        n, threads = len(given["q"]), as_count("threads", threads)
        _bind.keep_memory(n * job.sample_bytes)
        outputs: dict[str, NDArray[Any]] = {name: np.empty((n, *shape), dtype) for name, (shape, dtype) in job.shapes.items()}
        # A motion that may change its assembly on the way is one piece.
        pieces = _pieces(max(1, n) if in_order else BLOCK, given, load, list(wrench.values()), given.get("time", t), attitude, outputs)
        roads, failure, passed = None, "", 0
        for first, inputs, places in pieces:
            taken, passed, lost, why = job.engine.run(threads, first, in_order, inputs, places)
            roads = taken if roads is None else roads + taken
            if lost and not failure:
                place = f"t = {given['time'][first + lost - 1]:.6g} s" if "time" in given else f"sample {first + lost - 1}"
                failure = f"{place}: {why}"
        return outputs, np.zeros(3, dtype=np.intc) if roads is None else roads, passed, failure

    def _loads_at(self, job: _Job, t: ArrayLike | None, n: int) -> NDArray[np.float64]:
        """The scene's loads (N or 1, n_load, 6) at the instants of a batch."""
        if t is None:
            return job.load
        instants = self._instants(t)
        if len(instants) not in (1, n):
            raise InputError(f"t: expected one instant or shape ({n},), got ({len(instants)},)")
        return _bind.loads(job.handle, instants, job.n_load)

    def _require_instants(self, t: ArrayLike | None) -> None:
        """States do not tell where the frame is, and what payloads weigh."""
        if t is None and self.description["wants_instants"]:
            what = "the frame of the scene moves" if self.description["frame_moves"] else "the mass of a payload changes"
            raise InputError(f"t: {what} with time, and no instants are given (expected the instant of each sample)")

    def _instant_or_0(self, t: ArrayLike | None) -> NDArray[np.float64]:
        """Instants of a batch: (N,) or (1,)."""
        return _START if t is None else self._instants(t)

    def _batch(self, name: str, values: ArrayLike, n: int | None, one: bool = False) -> NDArray[np.float64]:
        """Values of the coordinates (N, n), or of one sample (n,) where that will do."""
        columns, values = len(self.coordinates), by_labels(name, values, self.coordinates)
        if one:
            says = f"({'N' if n is None else n}, {columns})"
            if dimensions(name, values, says) == 1:
                return as_floats(name, values, (columns,), f"{says} or ({columns},)")[np.newaxis]
        return as_floats(name, values, (n, columns))

    def _increasing(self, t: ArrayLike) -> NDArray[np.float64]:
        instants = self._instants(t)
        if len(instants) == 0:
            raise InputError("t: no instants were given (expected one at least)")
        if np.any(np.diff(instants) <= 0):
            raise InputError("t: expected increasing instants")
        return instants

    def _instants(self, t: ArrayLike) -> NDArray[np.float64]:
        if dimensions("t", t, "(N,)") == 0:
            return np.array([as_number("t", t)])
        return as_finite("t", t, (None,), "(N,)")

    def _wrenches(self, wrench: Mapping[str, ArrayLike] | None, n: int) -> dict[str, NDArray[np.float64]]:
        """All given wrenches as (N or 1, 6)."""
        return {marker: self._wrench(marker, values, n) for marker, values in (wrench or {}).items()}

    def _told(self, wrench: dict[str, NDArray[np.float64]], n: int) -> dict[str, NDArray[np.float64]]:
        """The same for the results: one a sample, in the components that the scene has."""
        columns = [0, 1, 5] if self.planar else slice(None)
        return {marker: np.broadcast_to(values[:, columns], (n, values[:, columns].shape[1])) for marker, values in wrench.items()}

    def _wrench(self, marker: str, values: ArrayLike, n: int) -> NDArray[np.float64]:
        """A given wrench as (N or 1, 6)."""
        name, width = f"wrench[{marker!r}]", 3 if self.planar else 6
        says = f"({n}, {width}) or ({width},)"
        if dimensions(name, values, says) == 1:
            array = as_floats(name, values, (width,), says)[np.newaxis]
        else:
            array = as_floats(name, values, (n, width), says)
        if not self.planar:
            return array
        full = np.zeros((len(array), _bind.LOAD_WIDTH))
        full[:, [0, 1, 5]] = array
        return full


def _pieces(
    length: int,
    given: dict[str, NDArray[np.float64]],
    load: NDArray[np.float64],
    extra: list[NDArray[np.float64]],
    t: NDArray[np.float64],
    attitude: NDArray[np.float64] | None,
    outputs: dict[str, NDArray[Any]],
) -> Iterator[tuple[int, _bind.Inputs, dict[str, NDArray[Any]]]]:
    """A batch in pieces of so many samples: the first sample's number, inputs and places of the results."""
    n = len(given["q"])
    turned = _bind.NO_ATTITUDE if attitude is None or attitude.ndim == 1 else attitude
    if 0 < n <= length:  # slices would take as long as a pose
        yield 0, (given["q"], given["qd"], given["qdd"], _spread(load, extra, slice(0, n)), t, turned), outputs
        return
    for first in range(0, n, length):
        block = slice(first, min(first + length, n))
        q, qd, qdd = given["q"][block], given["qd"][block], given["qdd"][block]
        at, turned_here = t if len(t) == 1 else t[block], turned if turned.ndim == 1 else turned[block]
        places = {name: values[block] for name, values in outputs.items()}
        yield first, (q, qd, qdd, _spread(load, extra, block), at, turned_here), places


def _spread(load: NDArray[np.float64], extra: list[NDArray[np.float64]], block: slice) -> NDArray[np.float64]:
    """Loads (samples, n_load, 6) of a block, or one for all (1, n_load, 6); those of ``wrench`` stand behind the scene's own."""
    if not extra:
        return load if len(load) == 1 else load[block]
    is_same = len(load) == 1 and all(len(values) == 1 for values in extra)
    spread = np.empty((1 if is_same else block.stop - block.start, *load.shape[1:]))
    n_own = load.shape[1] - len(extra)
    spread[:, :n_own] = (load if len(load) == 1 else load[block])[:, :n_own]
    for k, values in enumerate(extra):
        spread[:, n_own + k] = values if len(values) == 1 else values[block]
    return spread


def _source(source: Any) -> tuple[bytes, str, str | os.PathLike[str], Path | None]:
    """Bytes of a scene, its name in messages, its folder, its file if it has one."""
    if isinstance(source, Mapping):
        return tomli_w.dumps(_plain(source)).encode(), "scene", ".", None
    if isinstance(source, str) and ("\n" in source or not source.strip()):
        return source.encode(errors="surrogateescape"), "scene", ".", None
    if not isinstance(source, (str, os.PathLike)):
        raise InputError(f"scene: expected a path, a text or a dict, got {type(source).__name__}")
    path = Path(as_path("scene", source))
    try:
        return path.read_bytes(), str(path), path.parent, path
    except FileNotFoundError:
        raise MissingFileError(f"{path}: there is no such file") from None
    except OSError as error:
        raise FileError(f"{quoted(str(path))}: cannot be read: {error.strerror}") from error


def _plain(value: Any, place: str = "") -> Any:
    """Numpy arrays and numbers, tuples and paths as what TOML knows; keys whose value is None are left out."""
    if place.count(".") + place.count("[") > DEEPEST:
        raise InputError(f"scene: {quoted(place)} holds what a scene file cannot: tables inside each other without an end")
    if isinstance(value, Mapping):
        return {
            _plain(str(key), place): _plain(item, f"{place}.{key}".lstrip(".")) for key, item in value.items() if item is not None
        }
    if isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind in "biufU":
        return _plain(value.tolist(), place)
    if isinstance(value, (list, tuple)):
        return [_plain(item, f"{place}[{i}]") for i, item in enumerate(value)]
    if isinstance(value, os.PathLike):
        return as_path(f"scene: {place}", value)
    if isinstance(value, str) and not value.isascii() and any("\ud800" <= letter <= "\udfff" for letter in value):
        raise InputError(f"scene: {quoted(place)} holds what a scene file cannot: {quoted(value)}, half of a character")
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise InputError(f"scene: {quoted(place)} holds what a scene file cannot: {quoted(value)} (expected a whole number of 64 bits at most)")
    if not isinstance(value, (str, bool, int, float, datetime.date, datetime.time)):
        raise InputError(f"scene: {quoted(place)} holds what a scene file cannot: {quoted(value)} (expected a number, a text, a list or a table)")
    return value


def _is_number(value: Any) -> bool:
    """A number that a double holds; others the reader refuses, with their place."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _names(entries: list[dict[str, Any]]) -> tuple[str, ...]:
    return tuple(entry["name"] for entry in entries)
