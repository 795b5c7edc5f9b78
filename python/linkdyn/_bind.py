"""Calls into the engine: arrays are checked in our words, codes become exceptions, nothing is copied needlessly."""

from __future__ import annotations

import ctypes
import json
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _engine
from ._arguments import as_name
from .errors import ClosedSceneError, FileError, InputError, LinkdynError, SceneError, UnavailableError

_api = _engine.linkdyn_f2py_api

BAD_INPUT, IO_ERROR, UNAVAILABLE, STALE_HANDLE, INTERRUPTED = 2, 4, 5, 7, 8
_ERRORS: dict[int, type[LinkdynError]] = {
    BAD_INPUT: InputError,
    IO_ERROR: FileError,
    UNAVAILABLE: UnavailableError,
    STALE_HANDLE: ClosedSceneError,
}
_NOTHING = np.zeros(1)
NO_ATTITUDE = _NOTHING
_TEXT_ROOM = 65536
_TEXT_BLOCK = 4_000_000
"""Letters of a table that are made at a time, at least a row."""
_LONGEST_NUMBER = 32
"""And its comma, in a table."""
LEAST_GIVEN_BACK, MOST_KEPT = 128 << 10, 32 << 20
"""Bytes of the smallest block that glibc may give back to the system, and of the largest that it keeps (DEFAULT_MMAP_THRESHOLD, .._MAX)."""
AT_A_TIME = 4
"""Times the results of a call, and nothing is given back between calls that follow each other."""
LOAD_WIDTH = 6
POSE_WIDTH = 6
"""Components of a load inside the engine: Fx Fy Fz Mx My Mz."""
ATTITUDE_WIDTH = 10
"""Numbers of an attitude: w x y z, angular velocity, angular acceleration."""

Floats = NDArray[np.float64]
Inputs = tuple[Floats, Floats, Floats, Floats, Floats, Floats]


def version() -> str:
    """Version of the engine."""
    return _api.api_version().decode().strip()


def use_code(name: str | None) -> None:
    """Choose the machine code that kernels are made of from now on, in this process; what they compute does not depend on it.

    Parameters
    ----------
    name
        ``"avx512"``, ``"avx2"``, ``"scalar"`` or ``"interpreter"``; code that the processor does not run is replaced by the best
        that it does, which a warning says. None: what the environment variable ``LINKDYN_CODE`` says, else the best.

    Raises
    ------
    InputError
        Another name.

    See Also
    --------
    code_in_use
    """
    check(*_api.api_choose_code("" if name is None else as_name("code", name) or " "))
    if name is not None and (runs := code_in_use()) != name:
        warnings.warn(f"code: {name!r} does not run here, kernels are made of {runs}", stacklevel=2)


def code_in_use() -> str:
    """What kernels run as: ``"avx512"``, ``"avx2"``, ``"scalar"``, or ``"interpreter"``, with the reason if that was not asked for.

    >>> linkdyn.code_in_use() in ("avx512", "avx2")             # doctest: +SKIP
    True
    """
    return _api.api_code().decode().strip()


def default_method() -> str:
    """Integrator of forward runs that name none: the best that this build has."""
    return _api.api_default_method().decode().strip()


def check(code: int, message: bytes, bad_input: type[LinkdynError] = InputError) -> None:
    """Raise the exception that belongs to a code of the engine.

    Raises
    ------
    LinkdynError
        One of its subclasses, with the engine's message.
    """
    if code == 0:
        return
    text = message.decode("utf-8", errors="replace").strip()
    raise bad_input(text) if code == BAD_INPUT else _ERRORS.get(code, LinkdynError)(text)


def _listen(procedure: Any, *arguments: Any) -> list[Any]:
    """Call a procedure that may take long: a signal such as Ctrl-C ends it within a fraction of a second.

    Python's own handler runs as soon as the call is back, and usually raises. If it does not, the program wants to go on, and
    the call is made once more.
    """
    results: list[Any]
    while True:
        *results, code, message = procedure(*arguments)
        if code != INTERRUPTED:
            check(code, message)
            return results


def open_scene(text: bytes, file: str, folder: str, original: int = 0) -> int:
    """Read and plan a scene, which may be another one, given by its handle, with other values; returns its handle.

    Raises
    ------
    SceneError
        With the reader's message.
    """
    handle, code, message = _api.api_open(_to_codes(text), _to_codes(file), _to_codes(folder), original)
    check(code, message, SceneError)
    return handle


@dataclass(frozen=True)
class Sweep:
    """A sweep planned in the engine."""

    handle: int
    n_sample: int
    chunk: int
    """Samples of a chunk at most."""
    width: int
    """Values kept of a sample; 0: none."""
    is_for_file: bool
    """Kept samples, and what is done, lie beside the file for which the results are."""


def open_sweep(
    handle: int, folder: str, solver: str, keep: str, threads: int, output: str, resume: bool, checkpoint: float
) -> tuple[Sweep, int, int]:
    """Plan the sweep of a scene: the sweep, chunks that an earlier run has done, chunks of the next round at most."""
    sweep, n_sample, n_done, chunk, width, n_next = _listen(
        _api.api_sweep_open, handle, _to_codes(folder), solver, _to_codes(keep), threads, _to_codes(output), resume, checkpoint
    )
    return Sweep(sweep, int(n_sample), chunk, width, bool(output)), int(n_done), n_next


def advance_sweep(sweep: Sweep, n_chunk: int, threads: int) -> tuple[bool, int, int, Floats]:
    """Compute the next round of at most so many chunks.

    Returns
    -------
    is_over, n_done, n_next, records
        Whether all is computed, chunks done in all, chunks of the next round at most, and (samples, width) what is kept of this one's
        samples, if no file keeps them.
    """
    width = 0 if sweep.is_for_file else sweep.width
    records = np.empty(max(1, width * min(n_chunk * sweep.chunk, sweep.n_sample)))
    is_over, n_done, n_kept, n_next = _listen(_api.api_sweep_advance, sweep.handle, threads, records)
    return bool(is_over), int(n_done), n_next, records[: n_kept * width].reshape(n_kept, sweep.width)


def kept_samples(sweep: Sweep, first: int, n: int) -> Floats:
    """(n, width) what the file has kept of samples from one on."""
    records = np.empty((n, sweep.width))
    check(*_api.api_sweep_kept(sweep.handle, first, records.T))
    return records


def sweep_results(sweep: Sweep) -> tuple[dict[str, Any], Floats, Floats]:
    """Description of the results, and their numbers in the order of the variables: reals, integers."""
    schema = json.loads(_read_text(_api.api_sweep_describe, sweep.handle))
    count = {"real": 0, "integer": 0, "text": 0}
    for variable in schema["variables"]:
        count[variable["kind"]] += int(np.prod([schema["dimensions"][name] for name in variable["dims"]]))
    reals, integers = np.zeros(max(1, count["real"])), np.zeros(max(1, count["integer"]))
    check(*_api.api_sweep_values(sweep.handle, reals, integers))
    return schema, reals, integers


def close_sweep(sweep: Sweep, has_ended: bool) -> None:
    """Forget a sweep; one that has not come to its end is kept beside its file, if it has one."""
    _api.api_sweep_close(sweep.handle, has_ended)


def add_loads(handle: int, markers: Sequence[str]) -> int:
    """A second scene with loads at more markers ("link.marker"); returns its handle."""
    new_handle, code, message = _api.api_add_loads(handle, _to_codes("\n".join(markers)))
    check(code, message)
    return new_handle


def close_scene(handle: int) -> None:
    """Forget a scene; closing twice does no harm."""
    _api.api_close(handle)


def csv_rows(values: NDArray[np.float64], is_word: NDArray[np.bool_], words: list[str]) -> Iterator[bytes]:
    """Rows of a table as CSV, in the form of the program's own files.

    Parameters
    ----------
    values
        (rows, columns); of words their places in the list, from 1 on.
    is_word
        (columns,).
    words
        Without line ends.
    """
    listed = [word.encode("utf-8", errors="surrogateescape") for word in words] or [b""]
    width = max(1, *map(len, listed))
    codes = _to_codes(b"".join(word.ljust(width) for word in listed))
    room = np.where(is_word, 2 * width + 3, _LONGEST_NUMBER).sum()
    step = max(1, _TEXT_BLOCK // int(room))
    text = np.zeros(1 + step * int(room) // 4, dtype=np.intc)
    for start in range(0, len(values), step):
        block = np.ascontiguousarray(values[start : start + step])
        length = _api.api_csv_rows(is_word.astype(np.intc), width, codes, block.reshape(-1), text)
        yield text.view(np.uint8)[:length].tobytes()


def describe_scene(handle: int) -> dict[str, Any]:
    """Names, units, links, joints, loads of the scene."""
    description: dict[str, Any] = json.loads(_read_text(_api.api_describe_scene, handle))
    return description


def describe_results(
    handle: int, solver: str, want: str, has_time: bool, is_forward: bool = False, error: bool = False
) -> dict[str, Any]:
    """Dimensions and variables of the results; ``want`` "" is all that the solver gives."""
    kind = 2 if is_forward else int(has_time)
    schema: dict[str, Any] = json.loads(_read_text(_api.api_describe_results, handle, solver, want, kind, int(error)))
    return schema


def explain(handle: int, with_matrix: bool) -> str:
    """The report of ``linkdyn explain``, with the equations if wanted."""
    return _read_text(_api.api_explain, handle, int(with_matrix))


def assemblies(handle: int) -> dict[str, Any]:
    """All assemblies at the start: see ``assemblies_of``."""
    found: dict[str, Any] = json.loads(_read_text(_api.api_assemblies, handle))
    return found


def generate(handle: int, kernel: str, want: str, name: str) -> tuple[str, str]:
    """Header and source of a kernel in C; ``want`` "" is what the kernel is usually for."""
    header, source = _read_text(_api.api_generate, handle, kernel, want, _to_codes(name)).split("\0")
    return header, source


def motion(handle: int, t: Floats, n_q: int, n_load: int, n_attitude: int = 0) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """The scene's own motion and loads.

    Parameters
    ----------
    n_attitude
        If attitudes are wanted near poles: how many there are.

    Returns
    -------
    q, qd, qdd
        (n, n_q) [m, rad] and rates.
    load
        (n, n_load, 6) [N, N m].
    attitude
        (n, n_attitude, 10) as `attitudes` leaves them; one zero: not asked for.
    """
    q, qd, qdd = (np.empty((len(t), n_q)) for _ in range(3))
    attitude = np.zeros((len(t), n_attitude, ATTITUDE_WIDTH)) if n_attitude and len(t) else _NOTHING
    load = np.empty((len(t), n_load, LOAD_WIDTH))
    if len(t):
        check(*_api.api_motion(handle, t, _flat(q), _flat(qd), _flat(qdd), _flat(attitude), _flat(load)))
    return q, qd, qdd, load, attitude


def attitudes(handle: int, attitude: Floats, q: Floats, qd: Floats, qdd: Floats) -> None:
    """Attitudes as coordinates: their angles and rates come into the arrays (n, n_q).

    Parameters
    ----------
    attitude
        (n, n_attitude, 10) quaternion w x y z, angular velocity and acceleration [rad/s, rad/s2]; zeros: by the angles in ``q``.
        Behind, what is not zero is of samples near a pole, which have to go by it.
    """
    check(*_api.api_attitudes(handle, len(q), _flat(attitude), _flat(q), _flat(qd), _flat(qdd)))


def spline(t: Floats, values: Floats, at: Floats) -> tuple[Floats, Floats, Floats]:
    """The cubic spline that a table of a scene has through ``values``, and its first two derivatives, at instants within ``t``."""
    value, rate, acceleration = (np.empty(len(at)) for _ in range(3))
    if len(at):
        _api.api_spline(t, np.ascontiguousarray(values), at, value, rate, acceleration)
    return value, rate, acceleration


def frame_motion(handle: int, t: Floats) -> Floats:
    """How the frame moves: (n, 3, 6) x y z [m] roll pitch yaw [rad], their first and second derivatives."""
    pose = np.empty((len(t), 3, POSE_WIDTH))
    if len(t):
        check(*_api.api_frame_motion(handle, t, _flat(pose)))
    return pose


def payloads(handle: int, t: Floats, n_payload: int) -> Floats:
    """Masses of the payloads (n, n_payload) [kg]."""
    mass = np.empty((len(t), n_payload))
    check(*_api.api_payloads(handle, t, _flat(mass)))
    return mass


def loads(handle: int, t: Floats, n_load: int) -> Floats:
    """The scene's own loads (n, n_load, 6) [N, N m]."""
    load = np.empty((len(t), n_load, LOAD_WIDTH))
    if len(t):
        check(*_api.api_loads(handle, t, _flat(load)))
    return load


def keep_memory(n_bytes: int) -> None:
    """Have the C library keep so much memory for the next call, once this one's results are forgotten.

    glibc gives free memory back to the system when it is more than twice the largest block that was freed before, and getting it
    again page by page takes longer than the forces of a closed form. A block freed untouched tells it how much is used at a time:
    beside all results those of the call before, which lie there until the new ones have their name, and what is freed in between.
    What is above its limit is given back in any case.
    """
    if LEAST_GIVEN_BACK <= n_bytes <= MOST_KEPT:
        np.empty(min(AT_A_TIME * n_bytes, MOST_KEPT), dtype=np.uint8)


def sampling(handle: int, t: Floats, q: Floats, qd: Floats, qdd: Floats) -> str:
    """Whether samples (n, n_q) of a motion are too far from each other for peaks to be seen, in words; empty: they are not."""
    told, code, message = _api.api_sampling(handle, t, _flat(q), _flat(qd), _flat(qdd))
    check(code, message)
    return told.decode("utf-8", errors="replace").strip()


def state_loads(handle: int, in_order: bool, q: Floats, qd: Floats, t: Floats, n_load: int) -> Floats:
    """The scene's own loads (n, n_load, 6) [N, N m] at states (n, n_q), those that follow the state too.

    Parameters
    ----------
    in_order
        The states follow each other along a motion, and so does the assembly.
    """
    load = np.empty((len(t), n_load, LOAD_WIDTH))
    check(*_api.api_state_loads(handle, int(in_order), _flat(q), _flat(qd), t, _flat(load)))
    return load


@cache
def _result_names() -> tuple[str, ...]:
    """Results of inverse dynamics, in the engine's order."""
    names, _ = _api.api_result_names()
    return tuple(names.decode().split())


class Inverse:
    """Inverse dynamics of one kind: made ready once, run for many batches.

    Parameters
    ----------
    handle
        Of the scene.
    names
        Results wanted; what is not among them is not computed.
    """

    def __init__(self, handle: int, solver: str, names: Iterable[str]) -> None:
        names = set(names)
        self._handle, self._solver = handle, solver
        order = _result_names()
        self._places = [(place, name) for place, name in enumerate(order) if name in names]
        self._nowhere = np.zeros(len(order), dtype=np.intp)

    def run(
        self,
        threads: int,
        first: int,
        in_order: bool,
        inputs: Inputs,
        outputs: dict[str, NDArray[Any]],
    ) -> tuple[NDArray[np.intc], int, int, str]:
        """Some samples, into the arrays given.

        Parameters
        ----------
        first
            Number of the first sample, for messages.
        in_order
            The samples follow each other: the assembly is followed by continuity.
        inputs
            q, qd, qdd (n, n_q), load (n or 1, n_load, 6), t (n or 1) and attitudes that `attitudes` has left (n, n_attitude, 10), or
            one zero.
        outputs
            Arrays of the results wanted by name, C-ordered, sample first, of the shapes that the engine describes, and "status".

        Returns
        -------
        roads
            Samples whose links were placed in closed form, by iteration; that the dense solver took over.
        passed
            Change points passed, where the samples follow each other.
        lost, why
            The first sample to which the assembly could not be followed, from 1, and why; 0 and "" if there is none.
        """
        places = self._nowhere.copy()
        for place, name in self._places:
            places[place] = _address(outputs[name])
        rows = [array.reshape(-1) if array.size else _NOTHING for array in inputs]  # as `_flat` does
        roads, passed, lost, why = _listen(
            _api.api_inverse, self._handle, self._solver, threads, first, in_order, places, *rows, outputs["status"]
        )
        return roads, passed, lost, why.decode("utf-8", errors="replace").strip() if lost else ""


class _Row:
    """Room for all results of one dtype, one after the other as the engine fills them."""

    def __init__(self, n: int, kind: type, shapes: dict[str, tuple[tuple[int, ...], type]]) -> None:
        self._shapes = {name: (n, *shape) for name, (shape, of) in shapes.items() if of is kind}
        self._ends = np.cumsum([int(np.prod(shape)) for shape in self._shapes.values()])
        self.values = np.empty(self._ends[-1], dtype=kind)

    def take(self, name: str) -> NDArray[Any]:
        """One of them in its shape."""
        i = list(self._shapes).index(name)
        return self.values[self._ends[i - 1] if i > 0 else 0 : self._ends[i]].reshape(self._shapes[name])


class Run:
    """A forward run under way.

    Parameters
    ----------
    handle
        Of the scene, which may be closed then.
    settings
        step [s], rtol, atol.
    switch
        Exchange coordinates at their dead points.
    error
        Estimate errors too.
    t_start, t_end
        [s].
    """

    def __init__(
        self,
        handle: int,
        method: str,
        solver: str,
        threads: int,
        settings: tuple[float, float, float],
        switch: bool,
        want: str,
        error: bool,
        t_start: float,
        t_end: float,
    ) -> None:
        self._handle, code, message = _api.api_forward(
            handle, method, solver, threads, *settings, int(switch), want, int(error), t_start, t_end
        )
        check(code, message)
        self.statistics = np.zeros(3, dtype=np.intc)
        """Steps, rejected steps, right-hand sides."""
        self.roads = np.zeros(3, dtype=np.intc)
        """As `inverse` returns them."""
        self.n_passed = 0
        """Change points passed since the start, up to the last instant dealt with or where the run stopped."""
        self.tolerance = ""
        """Errors that a step is allowed, and what was asked for if that is looser; empty of a fixed step."""
        self.rounding = ""
        """What it left of the tolerances; empty if these were met."""
        self.stopped = ""
        """Why the run stopped early; empty if it did not."""
        self.coordinates = ""
        """Which coordinates were integrated when; empty if none was exchanged."""
        self.n_events = 0
        """That have come so far."""
        self.is_over = False
        """An event has ended the run: no instant follows."""
        self.reached = t_start
        """Instant [s] at which the work stands: the mean of the run and of what estimates its errors."""

    def advance(
        self, t: Floats, shapes: dict[str, tuple[tuple[int, ...], type]], seconds: float
    ) -> tuple[int, dict[str, NDArray[Any]]]:
        """Go on through some instants of output [s], for about so many seconds of computing.

        Parameters
        ----------
        shapes
            Shape of one sample and dtype of the results by name, in the order of the engine's description.

        Returns
        -------
        n_done
            Instants dealt with.
        arrays
            Their results by name.
        """
        kinds: tuple[type, ...] = (np.float64, np.intc)
        rows = {kind: _Row(len(t), kind, shapes) for kind in kinds}
        n_done, self.reached, self.statistics, roads, self.n_passed, *words, self.n_events, is_over, code, message = (
            _api.api_advance(self._handle, t, seconds, rows[np.float64].values, rows[np.intc].values)
        )
        check(code, message)
        self.is_over = bool(is_over)
        self.roads += roads
        self.tolerance, self.rounding, self.stopped, self.coordinates = (text.decode("utf-8", errors="replace").strip() for text in words)
        return n_done, {name: rows[kind].take(name)[:n_done] for name, (shape, kind) in shapes.items()}

    def events(self, n_q: int) -> tuple[NDArray[np.intc], Floats, Floats]:
        """What has happened so far.

        Returns
        -------
        kinds
            (N, 3) number of the event from 1, kind, direction.
        instants
            (N, 3) instant [s], impulse, energy lost [J].
        states
            (N, 3, n_q) coordinates, their rates before and behind.
        """
        n = self.n_events
        kinds, instants = np.zeros((n, 3), np.intc), np.zeros((n, 3))
        states = np.zeros((n, 3, n_q))
        flat = np.zeros(states.size)
        if n > 0:
            check(*_api.api_events(self._handle, kinds.ravel(), instants.ravel(), flat))
        return kinds, instants, flat[: states.size].reshape(states.shape)

    def event_results(self, shapes: dict[str, tuple[tuple[int, ...], type]]) -> dict[str, NDArray[Any]]:
        """Results on both sides of what has happened so far, by name, (N, 2, ...): shapes as for `advance`, of those that jump."""
        kinds: tuple[type, ...] = (np.float64, np.intc)
        rows = {kind: _Row(2 * self.n_events, kind, shapes) for kind in kinds}
        if self.n_events > 0:
            check(*_api.api_event_results(self._handle, self.n_events, rows[np.float64].values, rows[np.intc].values))
        return {name: rows[kind].take(name).reshape(self.n_events, 2, *shape) for name, (shape, kind) in shapes.items()}

    def finish(self) -> None:
        """Give back what the run holds."""
        _api.api_finish(self._handle)


class Stopped(Exception):
    """A simulator came to where it cannot go on.

    Attributes
    ----------
    t : float
        Last good instant [s].
    """

    def __init__(self, message: str, t: float) -> None:
        super().__init__(message)
        self.t = t


def open_simulator(handle: int, method: str, settings: tuple[float, float, float], t: float) -> int:
    """A simulator of an open scene at its start; settings are step [s], rtol and atol."""
    simulator, code, message = _api.api_simulator(handle, method, *settings, t)
    check(code, message)
    return int(simulator)


def set_simulator(simulator: int, t: float, q: Floats, qd: Floats, pressure: Floats | None = None) -> None:
    """Put its mechanism somewhere else; without pressures, with those by which a run would begin."""
    check(*_api.api_set_simulator(simulator, t, q, qd, pressure is not None, np.zeros(1) if pressure is None else pressure.ravel()))


def pressures_of_simulator(simulator: int, n_cylinder: int) -> Floats:
    """(n_cylinder, 2) in head and rod chambers [Pa]."""
    pressure = np.zeros(2 * max(1, n_cylinder))
    check(*_api.api_simulator_pressures(simulator, pressure[: 2 * n_cylinder] if n_cylinder else pressure[:1]))
    return pressure[: 2 * n_cylinder].reshape(n_cylinder, 2)


def step_simulator(simulator: int, t_end: float, force: Floats, n_force: int, q: Floats, qd: Floats) -> float:
    """Go on to an instant [s], or for a quarter of a second; q and qd become those of the instant reached, which is returned."""
    t, code, message = _api.api_step_simulator(simulator, t_end, force[:n_force], q, qd)
    if code != 0:
        text = message.decode("utf-8", errors="replace").strip()
        if text.startswith("the simulation cannot"):
            raise Stopped(text, t)
        check(code, message)
    return float(t)


def linearize(simulator: int, follows_laws: bool, effort: Floats, n_q: int, n_variable: int) -> tuple[Floats, Floats, Floats]:
    """Efforts at which a simulator's mechanism is linearized where it stands; accelerations, joint variables and their rates there; how
    these change (of, by coordinates, rates, efforts)."""
    n, by = n_q + 2 * n_variable, 2 * n_q + len(effort)
    told, value, column = np.zeros(max(1, len(effort))), np.zeros(n), np.zeros((by, n))
    told[: len(effort)] = effort
    check(*_api.api_linearize(simulator, follows_laws, told[: len(effort)], value, column.ravel()))
    return told[: len(effort)], value, column.T


def keep_simulator(simulator: int) -> int:
    """Its state, to be closed by `close_state`."""
    state, code, message = _api.api_keep_simulator(simulator)
    check(code, message)
    return int(state)


def put_simulator_back(simulator: int, state: int) -> None:
    """Back to a state that was kept of it."""
    check(*_api.api_put_simulator_back(simulator, state))


def close_state(state: int) -> None:
    """Forget a state; nothing happens to one that was forgotten."""
    _api.api_close_state(state)


def close_simulator(simulator: int) -> None:
    """Give back what it holds; nothing happens to one that was closed."""
    _api.api_close_simulator(simulator)


_POSES_AT_ONCE = 1 << 14


def poses(handle: int, q: Floats, n_link: int, in_order: bool, by_joints: bool = False) -> tuple[Floats, Floats, NDArray[np.intc]]:
    """Poses of the moving links.

    Parameters
    ----------
    in_order
        The samples follow each other: the assembly is followed by continuity.
    by_joints
        ``q`` holds all joint variables instead of the coordinates.

    Returns
    -------
    position
        (n, n_link, 3) [m], of the links' origins.
    rotation
        (n, n_link, 3, 3), from link to world axes.
    status
        (n,), codes of the samples.
    """
    n = len(q)
    position = np.empty((n, n_link, 3))
    columns = np.empty((n, n_link, 3, 3))
    status = np.zeros(n, dtype=np.intc)
    kind = 2 if by_joints else int(in_order)
    # samples on their own in pieces: what is set up for all of a piece does not hear an interrupt
    piece = max(n, 1) if in_order else _POSES_AT_ONCE
    for first in range(0, n, piece):
        part = slice(first, first + piece)
        _listen(_api.api_poses, handle, kind, _flat(q[part]), _flat(position[part]), _flat(columns[part]), status[part])
    return position, columns.swapaxes(-1, -2), status


def ensemble(
    handle: int, q: Floats, qd: Floats, t: Floats, step: float, threads: int, has_events: bool
) -> tuple[tuple[Floats, Floats, Floats, NDArray[np.intc], NDArray[np.intc]], tuple[NDArray[np.intc], Floats, Floats], str]:
    """Forward runs by rk4 from the starts q, qd (n, n_q) at t[0].

    Returns
    -------
    q, qd
        (n, len(t), n_q) [m, rad] and rates; NaN once a member has stopped.
    good_until
        (n,) last good instant of each [s].
    crossed
        (n,) change points passed.
    outcome
        (n,) why each stopped, as the status of a sample; 0: it has not.
    events
        As `Run.events` has them, with the member, from 1, before the number of the event.
    reason
        Why the steps are too long, where a member has found that they are; else empty.
    """
    n, n_q = q.shape
    found, rate = np.empty((n, len(t), n_q)), np.empty((n, len(t), n_q))
    good_until, crossed, outcome = np.empty(n), np.empty(n, dtype=np.intc), np.empty(n, dtype=np.intc)
    room, reason = max(64, 16 * n) if has_events and n > 0 else 0, ""
    while True:
        kinds, instants, states = np.zeros((room, 4), np.intc), np.zeros((room, 3)), np.zeros((room, 3, n_q))
        if n == 0:
            break
        members = (good_until, crossed, outcome, _flat(q), _flat(qd), _flat(found), _flat(rate))
        rows = (kinds.reshape(-1) if room else np.zeros(1, np.intc), _flat(instants), _flat(states))
        n_events, told = _listen(_api.api_ensemble, handle, threads, step, t, *members, *rows)
        reason = told.decode("utf-8", errors="replace").strip()
        if n_events <= room or not has_events:
            kinds, instants, states = kinds[:n_events], instants[:n_events], states[:n_events]
            break
        room = n_events  # more than usual: once more, which gives the same
    return (found, rate, good_until, crossed, outcome), (kinds, instants, states), reason


def _flat(array: NDArray[Any]) -> NDArray[Any]:
    """The array as one row, without a copy; an empty one as one element, because f2py refuses none."""
    return array.reshape(-1) if array.size else _NOTHING


def _address(array: Any) -> int:
    """Where a contiguous numpy array lies, in a sixth of the time that numpy takes to tell; 0: it is empty."""
    return ctypes.addressof(ctypes.c_char.from_buffer(array)) if array.size else 0


def _to_codes(text: str | bytes) -> NDArray[np.intc]:
    """Bytes of a text as integers; an empty text as one blank."""
    data = text if isinstance(text, bytes) else text.encode("utf-8", errors="surrogateescape")
    return np.frombuffer(data or b" ", dtype=np.uint8).astype(np.intc)


def _read_text(call: Any, *arguments: Any) -> str:
    """Text of unknown length: once more with enough room if need be."""
    room = np.zeros(_TEXT_ROOM, dtype=np.intc)
    length, code, message = call(*arguments, room)
    check(code, message)
    if length > room.size:
        room = np.zeros(length, dtype=np.intc)
        length, code, message = call(*arguments, room)
        check(code, message)
    return room[:length].astype(np.uint8).tobytes().decode("utf-8", errors="replace")
