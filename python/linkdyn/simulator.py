"""A mechanism stepped from outside: for controllers written in Python, and for learning ones."""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn, Self

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from . import _bind
from ._arguments import as_finite, as_floats, as_number, as_positive, quoted
from ._listing import only
from .errors import InputError, LinkdynError
from .results import time_axis

if TYPE_CHECKING:
    from .scene import Scene

__all__ = ["Simulator", "SimulatorState"]
__dir__ = only(__all__)

ROUNDED = 1e-9
"""Of the time between samplings, and of that of a run: so little beside a multiple is rounding."""


class SimulatorState:
    """Where a simulator has stood, and all that it remembered there: see `Simulator.state`.

    Attributes
    ----------
    t : float
        [s]
    q, qd : numpy.ndarray
        (n_q,) Coordinates and their rates there [m, rad; /s]; to read only.
    """

    def __init__(self, handle: int, t: float, q: NDArray[np.float64], qd: NDArray[np.float64], force: NDArray[np.float64]) -> None:
        self._handle = handle
        self._finalizer = weakref.finalize(self, _bind.close_state, handle)
        self._force = force.copy()
        self.t = t
        self.q, self.qd = _read_only(q.copy()), _read_only(qd.copy())

    def __deepcopy__(self, _: object) -> Self:
        """It never changes, and what it remembers lies in the engine."""
        return self

    __copy__ = __deepcopy__

    def __reduce__(self) -> NoReturn:
        raise TypeError("a SimulatorState cannot be pickled, it lies in this process's memory (its t, q and qd go to Simulator.reset)")

    def __repr__(self) -> str:
        return f"<linkdyn.SimulatorState at t = {self.t:g} s>"


class Simulator:
    """A mechanism under way, made by `Scene.simulator`.

    Whoever steps it gives the forces of the actuators, which stay as they are during a step, and reads the coordinates at its end.
    Loads, springs, gravity, drives, brakes, clutches and controllers act as the scene says; the laws of its actuators play no part.

    Attributes
    ----------
    scene : Scene
    t : float
        Instant reached [s].
    q, qd : numpy.ndarray
        (n_q,) Coordinates and their rates there [m, rad; /s], in the order of ``scene.coordinates``.
    """

    def __init__(self, scene: Scene, handle: int, method: str, settings: tuple[float, float, float], t: float) -> None:
        self.scene = scene
        self._size = len(scene.actuators)
        self._n_cylinder = sum(cylinder["has_states"] for cylinder in scene.description["cylinders"])
        self._start = t
        self._handle = _bind.open_simulator(handle, method, settings, t)
        self._finalizer = weakref.finalize(self, _bind.close_simulator, self._handle)
        self._force = np.zeros(max(1, self._size))
        self._q, self._qd = np.empty(len(scene.coordinates)), np.empty(len(scene.coordinates))
        self._advance(-np.inf)
        self._first = (self._q.copy(), self._qd.copy())

    @property
    def t(self) -> float:
        """Instant reached [s]; `reset` puts the mechanism at another."""
        return self._t

    @property
    def q(self) -> NDArray[np.float64]:
        """(n,) coordinates [m, rad], in the order of the scene's `coordinates`: where it is now; later steps leave them alone."""
        return self._q.copy()

    @property
    def qd(self) -> NDArray[np.float64]:
        """(n,) their rates [m/s, rad/s]."""
        return self._qd.copy()

    @property
    def pressure(self) -> NDArray[np.float64]:
        """(n, 2) pressures in head and rod chamber of each cylinder whose valve is told how far to open [Pa], in the order of the actuators."""
        return _bind.pressures_of_simulator(self._handle, self._n_cylinder)

    def step(self, dt: float, force: ArrayLike | None = None) -> None:
        """Go on for a time.

        Parameters
        ----------
        dt
            [s], positive. As many steps of the integrator as its accuracy asks for lie within.
        force
            (n_actuator,) Force or torque of each actuator [N, N m], in the order of ``scene.actuators``; of one whose law is at
            its motor the motor's torque [N m], or voltage [V]; of a cylinder whose law is at its valve how far that is open, from -1 to 1. Where a controller of the scene drives, on top of its output. Default: as before, at first none.

        Raises
        ------
        InputError
            The mechanism cannot go on: a loop that does not close any further, a dead point of the coordinates. ``t``, ``q``, ``qd`` are those of
            the last good instant.
        """
        if force is not None:
            self._hold(force)
        if not (isinstance(dt, float) and 0.0 < dt < np.inf):
            dt = as_positive("dt", dt)
        self._advance(self.t + dt)

    def reset(
        self, q: ArrayLike | None = None, qd: ArrayLike | None = None, t: float | None = None, pressure: ArrayLike | None = None
    ) -> None:
        """Put the mechanism somewhere else; the forces are zero again, and controllers of the scene begin anew.

        Parameters
        ----------
        q, qd
            (n_q,) Coordinates and their rates [m, rad; /s]; default: those of the scene's start. Of several assemblies at q it is the one that
            the way from the scene's start leads to.
        t
            [s]; default: where the simulator began.
        pressure
            (n, 2) In head and rod chamber of each cylinder [Pa], as `pressure` has them; default: as a run begins, see the cylinder's `pressures`.

        Raises
        ------
        InputError
            It cannot be assembled there.
        """
        place, rate = (
            first if given is None else as_finite(name, given, (len(first),), "(n_q,), in the order of scene.coordinates")
            for name, given, first in (("q", q, self._first[0]), ("qd", qd, self._first[1]))
        )
        given = None if pressure is None else as_finite("pressure", pressure, (self._n_cylinder, 2), "(n, 2), in head and rod chamber")
        self._force[:] = 0.0
        _bind.set_simulator(self._handle, self._start if t is None else as_number("t", t), place, rate, given)
        self._advance(-np.inf)

    @property
    def state(self) -> SimulatorState:
        """Where the simulator stands, to be put back later: ``saved = sim.state``, and after any steps, or a `reset`, ``sim.state = saved``.

        With coordinates and rates it has the forces that are held, pressures of cylinders, what controllers remember (integrators, samples that wait for their delay), which
        brakes and clutches are closed and what sticks or rests at stops, how often angles have turned, the assembly, and what the integrator has learnt:
        the same steps from there give the same bits. (Method msbdf begins its history anew.) A state belongs to the simulator that it is of.
        """
        return SimulatorState(_bind.keep_simulator(self._handle), self.t, self._q, self._qd, self._force)

    @state.setter
    def state(self, state: SimulatorState) -> None:
        if not isinstance(state, SimulatorState):
            raise InputError(f"state = {state!r} is no state of a simulator (expected what `state` has given)")
        _bind.put_simulator_back(self._handle, state._handle)
        self._force[:] = state._force
        self._q[:], self._qd[:] = state.q, state.qd
        self._t = state.t

    def run(self, controller: Callable[[Simulator], ArrayLike], t_end: float, every: float) -> xr.Dataset:
        """Let a controller that samples at a rate lead the mechanism.

        Parameters
        ----------
        controller
            Called at each sampling instant with this simulator, whose ``t``, ``q`` and ``qd`` it reads. Returns the forces of the actuators until
            the next one, as `step` takes them.
        t_end
            [s]
        every
            Time between samplings [s]; where the time to the end is no multiple of it, the last is as much shorter.

        Returns
        -------
        xarray.Dataset
            "q" and "qd" (sample, coordinate) at the sampling instants and at the end, "driving_force" (sample, actuator) from there on, "time". A run that
            cannot go on ends early: ``attrs["stopped"]`` says why, else it is empty.

        Raises
        ------
        InputError
            An end that is not later than where the simulator stands, a time that is not positive; a controller that gives something else than a finite
            number for each actuator.
        """
        if not callable(controller):
            raise InputError(f"controller: expected a function of the simulator that gives forces, got {quoted(controller)}")
        every = as_positive("every", every)
        instants, stopped = self._samplings(as_number("t_end", t_end), every), ""
        t, q, qd, force = [self.t], [self._q.copy()], [self._qd.copy()], []
        for instant in instants:
            try:
                self._hold(controller(self))
                self._advance(instant)
            except LinkdynError as error:
                if str(error).startswith("the simulation cannot"):
                    stopped = str(error)
                    break
                raise
            force.append(self._force[: self._size].copy())
            t.append(self.t)
            q.append(self._q.copy())
            qd.append(self._qd.copy())
        force.append(self._force[: self._size].copy())
        return self._dataset(np.array(t), np.array(q), np.array(qd), np.array(force), stopped)

    def close(self) -> None:
        """Give back what it holds; done by itself at the end of a ``with``, or when nobody refers to it any more."""
        self._finalizer()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __reduce__(self) -> NoReturn:
        raise TypeError("a Simulator can be neither copied nor pickled (expected another one by scene.simulator(), or its `state`)")

    def __repr__(self) -> str:
        return f"<linkdyn.Simulator of {self.scene.title!r} at t = {self.t:g} s>"

    def _samplings(self, t_end: float, every: float) -> list[float]:
        """Instants to go to, one after the other; the last is the end, but for rounding."""
        begin = self.t
        whole = (t_end - begin) / every
        if not t_end - begin > ROUNDED * min(every, abs(t_end)):
            raise InputError(f"t_end = {t_end!r}: not later than t = {begin:g} s, where the simulator stands (expected a later end)")
        n = round(whole)
        if n > 0 and abs(whole - n) <= ROUNDED * max(1.0, whole):
            return [begin + k * every for k in range(1, n + 1)]
        return [*(begin + k * every for k in range(1, math.ceil(whole))), t_end]

    def _hold(self, force: ArrayLike) -> None:
        values = as_floats("force", force, (self._size,), "(n_actuator,), in the order of scene.actuators")
        if not np.isfinite(values).all():
            k = int(np.isfinite(values).argmin())
            raise InputError(f"force[{k}] of actuator {str(self.scene.actuators[k])!r} is {values[k]} (expected a finite number)")
        self._force[: self._size] = values

    def _advance(self, t_end: float) -> None:
        """In pieces, between which Python hears an interrupt."""
        try:
            while True:
                self._t = _bind.step_simulator(self._handle, t_end, self._force, self._size, self._q, self._qd)
                if self._t >= t_end:
                    return
        except _bind.Stopped as stopped:
            self._t = stopped.t
            raise InputError(str(stopped)) from None

    def _dataset(
        self, t: NDArray[Any], q: NDArray[Any], qd: NDArray[Any], force: NDArray[Any], stopped: str
    ) -> xr.Dataset:
        units = {kind: [entry["unit"] for entry in self.scene.description[f"{kind}s"]] for kind in ("coordinate", "actuator")}
        return xr.Dataset(
            {
                "q": (("sample", "coordinate"), q, {"units": "m, rad", "long_name": "coordinates"}),
                "qd": (("sample", "coordinate"), qd, {"units": "m/s, rad/s", "long_name": "rates of the coordinates"}),
                "driving_force": (("sample", "actuator"), force, {"units": "N, N m", "long_name": "driving force or torque, held until the next instant"}),
                "status": ("sample", np.zeros(len(t), dtype=np.intc), {"flag_meanings": "ok", "long_name": "all samples that there are have been computed"}),
            },
            xr.Coordinates({
                "coordinate": list(self.scene.coordinates),
                "coordinate_unit": ("coordinate", units["coordinate"]),
                "actuator": list(self.scene.actuators),
                "actuator_unit": ("actuator", units["actuator"]),
            }) | time_axis(["sample"], t, {"units": "s", "long_name": "time"}),
            {"title": self.scene.title, "scene": self.scene.text, "stopped": stopped},
        )


def _read_only(values: NDArray[np.float64]) -> NDArray[np.float64]:
    view = values.view()
    view.flags.writeable = False
    return view
