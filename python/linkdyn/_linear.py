"""A mechanism near a state as a linear system: its matrices, its poles, and the way to python-control."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from . import _bind
from ._arguments import as_finite, as_floats, as_known, as_names, as_number
from ._listing import only
from .errors import InputError, LinkdynError, UnavailableError

if TYPE_CHECKING:
    from .scene import Scene
    from .simulator import Simulator

    Floats = NDArray[np.float64]

__all__ = ["linearize", "to_control"]
__dir__ = only(__all__)

RESTS = 1e-9
"""Rates [m/s, rad/s, m/s2, rad/s2] below which a state is an equilibrium."""
KINDS = ("q", "qd", "qdd", "joint_variable", "joint_rate")
"""Of outputs."""


def linearize(
    scene: Scene, t: float | None, q: ArrayLike | None, qd: ArrayLike | None, effort: ArrayLike | None, outputs: Any
) -> xr.Dataset:
    """See `Scene.linearize`."""
    labels, units = _labels(scene)
    wanted = _wanted(outputs, labels)
    instant = scene.description["time"]["first"] if t is None else as_number("t", t)
    with scene.simulator(t=instant) as simulator:
        there = (simulator.q, simulator.qd) if t is None else _in_motion(scene, simulator)
        place, rate = (
            on_the_way if given is None else as_finite(name, given, (len(scene.coordinates),), "(n_q,), in the order of scene.coordinates")
            for name, given, on_the_way in (("q", q, there[0]), ("qd", qd, there[1]))
        )
        simulator.reset(place, rate, instant)
        held = np.zeros(len(scene.actuators))
        if effort is not None:
            held = as_finite("effort", effort, (len(scene.actuators),), "(n_actuator,), in the order of scene.actuators")
        elif not all(actuator["has_law"] for actuator in scene.description["actuators"]):
            held = _effort_that_leads(scene, simulator, q is not None or qd is not None)
        n_variable = len(labels["joint_variable"])
        told, value, column = _bind.linearize(simulator._handle, effort is None, held, len(scene.coordinates), n_variable)
        return _dataset(scene, simulator, labels, units, wanted, told, value, column)


def _labels(scene: Scene) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    """Names and units of outputs, by their kind."""
    schema = _bind.describe_results(scene._handle, "elimination", "joint_variable", False, is_forward=True)
    variable = next(of for of in schema["dimensions"] if of["name"] == "variable")
    unit = [coordinate["unit"] for coordinate in scene.description["coordinates"]]
    of = dict(zip(KINDS, (scene.coordinates, scene.coordinates, scene.coordinates, variable["labels"], variable["labels"]), strict=True))
    units = dict(zip(KINDS, (unit, _per(unit, "s"), _per(unit, "s2"), variable["units"], _per(variable["units"], "s")), strict=True))
    return {kind: [f"{kind}[{name}]" for name in names] for kind, names in of.items()}, units


def _per(units: list[str], time: str) -> list[str]:
    return [f"{unit}/{time}" for unit in units]


def _wanted(outputs: Any, labels: dict[str, list[str]]) -> list[str]:
    """Labels of the outputs asked for, by kind or one by one."""
    names = ["q", "qd"] if outputs is None else [name for name in as_names("outputs", outputs).split(",") if name]
    if not names:
        raise InputError("outputs: expected one at least, such as 'q'")
    singles = [label for of_kind in labels.values() for label in of_kind]
    wanted: list[str] = []
    for name in names:
        wanted += labels[name] if name in labels else [as_known("outputs", name, [*labels, *singles], "output")]
    return list(dict.fromkeys(wanted))


def _in_motion(scene: Scene, simulator: Simulator) -> tuple[Floats, Floats]:
    """Coordinates and rates of the scene's motion at an instant; of coordinates without one those of the start."""
    q, qd, _ = (values[0] for values in scene.motion([simulator.t]))
    leads = (q != simulator.q) | (qd != 0.0)
    return np.where(leads, q, simulator.q), np.where(leads, qd, simulator.qd)


def _effort_that_leads(scene: Scene, simulator: Simulator, moved: bool) -> Floats:
    """Driving forces of the scene's motion at its start or instant; elsewhere those that keep all rates. Zero where drives cannot do that."""
    q, qd, qdd = simulator.q, simulator.qd, np.zeros(len(scene.coordinates))
    if len(scene.actuators) < len(scene.coordinates):
        return np.zeros(len(scene.actuators))
    try:
        if not moved:
            there = [values[0] for values in scene.motion([simulator.t])]
            if np.array_equal(there[0], q) and np.array_equal(there[1], qd):
                qdd = there[2]
        run = scene.inverse(q=q[None], qd=qd[None], qdd=qdd[None], t=[simulator.t], want="driving_force")
    except LinkdynError:
        return np.zeros(len(scene.actuators))
    force: Floats = run.driving_force.values[0]
    return force if np.isfinite(force).all() else np.zeros(len(force))


def _dataset(
    scene: Scene,
    simulator: Simulator,
    labels: dict[str, list[str]],
    units: dict[str, list[str]],
    wanted: list[str],
    effort: Floats,
    value: Floats,
    column: Floats,
) -> xr.Dataset:
    n = len(scene.coordinates)
    of_state = np.eye(2 * n, column.shape[1])
    # all outputs in the order of KINDS: the engine's begin with accelerations
    everything = np.vstack([of_state, column])
    at = np.concatenate([simulator.q, simulator.qd, value])
    names = [label for kind in KINDS for label in labels[kind]]
    unit_of = dict(zip(names, (unit for kind in KINDS for unit in units[kind]), strict=True))
    rows = [names.index(label) for label in wanted]
    rates = np.vstack([of_state[n:], column[:n]])
    state = labels["q"] + labels["qd"]
    residual = np.concatenate([simulator.qd, value[:n]])
    poles = _poles(rates[:, : 2 * n])
    size = np.abs(poles)
    with np.errstate(divide="ignore", invalid="ignore"):
        damping = -poles.real / size
    return xr.Dataset(
        {
            "A": (("state", "state_in"), rates[:, : 2 * n], {"long_name": "rates of the state by the state"}),
            "B": (("state", "input"), rates[:, 2 * n :], {"long_name": "rates of the state by the inputs"}),
            "C": (("output", "state_in"), everything[rows, : 2 * n], {"long_name": "outputs by the state"}),
            "D": (("output", "input"), everything[rows, 2 * n :], {"long_name": "outputs by the inputs"}),
            "x": ("state", at[: 2 * n], {"long_name": "state linearized at"}),
            "u": ("input", effort, {"long_name": "inputs linearized at"}),
            "y": ("output", at[rows], {"long_name": "outputs there"}),
            "residual": ("state", residual, {"long_name": "rates of the state there: zero at an equilibrium"}),
            "growth": ("pole", poles.real, {"units": "1/s", "long_name": "real part of the pole"}),
            "angular_frequency": ("pole", poles.imag, {"units": "rad/s", "long_name": "imaginary part of the pole"}),
            "frequency": ("pole", size / (2 * np.pi), {"units": "Hz", "long_name": "natural frequency"}),
            "damping_ratio": ("pole", damping, {"units": "1", "long_name": "damping ratio; below zero: it grows"}),
        },
        {
            "state": state,
            "state_in": state,
            "input": [f"effort[{name}]" for name in scene.actuators],
            "output": wanted,
            "state_unit": ("state", units["q"] + units["qd"]),
            "input_unit": ("input", [actuator["effort_unit"] for actuator in scene.description["actuators"]]),
            "output_unit": ("output", [unit_of[label] for label in wanted]),
            "time": ((), simulator.t, {"units": "s", "long_name": "instant linearized at"}),
        },
        {
            "title": scene.title,
            "scene": scene.text,
            "is_equilibrium": int(np.abs(residual).max() <= RESTS),
        },
    )


def _poles(a: Floats) -> NDArray[np.complex128]:
    """Eigenvalues, slow ones first, of a pair the one that turns forwards."""
    poles: NDArray[np.complex128] = np.linalg.eigvals(a).astype(complex)
    return poles[np.lexsort((-poles.imag, poles.real, np.round(np.abs(poles), 12)))]


def to_control(data: xr.Dataset) -> Any:
    """See `RunAccessor.to_control`."""
    if not all(name in data for name in "ABCD"):
        raise InputError("to_control: this has no matrices A, B, C, D (expected what scene.linearize has given)")
    try:
        import control
    except ImportError as error:
        raise UnavailableError.of("to_control needs python-control", "control", "control", error) from None
    labels = {f"{name}s": [str(label).replace(".", "_") for label in data[name].values] for name in ("state", "input", "output")}
    return control.ss(*(as_floats(name, data[name].values, (None, None)) for name in "ABCD"), **labels)
