"""Power and energy of the drives over a cycle, and the flywheel that evens it out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .._arguments import as_known, as_number, as_positive, quoted
from .._geometry.turns import turned_on
from ..errors import InputError
from ..results import need_result
from .averages import good_samples, need_order, rms, shares

__all__ = ["duty_cycle", "energy", "flywheel"]

Values = NDArray[np.float64]


def energy(run: xr.Dataset) -> xr.Dataset:
    """Power and energy of every drive, and of all together.

    Parameters
    ----------
    run
        Results along time with ``driving_power``; one cycle of the machine, first and last sample included.

    Returns
    -------
    xarray.Dataset
        By ``drive``, the actuators and "all": ``peak_power``, ``lowest_power``, ``mean_power``, ``rms_power`` [W]; ``energy_in`` and ``energy_back`` [J], what goes into
        the machine and what comes back out of it; ``energy`` [J], their difference; ``fluctuation`` [J], from the lowest to the highest of
        the energy that a supply of the mean power has to store. Energies are by the trapezoidal rule, and the mean power is the energy over the time.

    Raises
    ------
    InputError
        The run has no power or no time, its instants go back, or samples failed.
    """
    time = _clock(run, "driving_power", "energy")
    each = run.driving_power.values
    power = np.column_stack([each, each.sum(axis=1)])
    work = running(power, time)
    whole = work[-1]
    duration = time[-1] - time[0]
    stored = work - np.outer(time - time[0], whole / duration)
    values = {
        "peak_power": (power.max(axis=0), "W", "largest power into the machine"),
        "lowest_power": (power.min(axis=0), "W", "lowest power; negative: out of the machine"),
        "mean_power": (whole / duration, "W", "energy over the time"),
        "rms_power": (rms(power, shares(run)), "W", "rms value of the power"),
        "energy_in": (running(np.maximum(power, 0.0), time)[-1], "J", "energy into the machine"),
        "energy_back": (running(np.maximum(-power, 0.0), time)[-1], "J", "energy out of the machine"),
        "energy": (whole, "J", "energy into the machine less that out of it"),
        "fluctuation": (np.ptp(stored, axis=0), "J", "what a supply of the mean power stores"),
    }
    return xr.Dataset(
        {name: ("drive", array, {"units": unit, "long_name": words}) for name, (array, unit, words) in values.items()},
        {"drive": [*map(str, run.actuator.values), "all"]},
        {"duration": duration},
    )


def flywheel(run: xr.Dataset, fluctuation: float, actuator: str | None = None) -> xr.Dataset:
    """The flywheel on a shaft that is to be driven by a constant torque.

    Classical: J = E / (delta w^2), with the energy E that the torque of one cycle has above and below its mean, over the angle. The run has the
    speed that is wanted, nearly constant.

    Parameters
    ----------
    run
        Results along time, one cycle, with ``driving_force`` and ``joint_variable``.
    fluctuation
        Coefficient of speed fluctuation delta, (highest - lowest) / mean speed.
    actuator
        Torque drive of the shaft; default: the only one.

    Returns
    -------
    xarray.Dataset
        ``inertia`` [kg m^2], ``energy`` [J], ``mean_torque`` [N m], ``mean_speed`` [rad/s], and where the shaft is slowest and fastest: ``slowest_at``,
        ``fastest_at`` [s].

    Raises
    ------
    InputError
        No such drive, a drive that pushes, a shaft that turns back or stands, a fluctuation that is not above zero.
    """
    delta = as_positive("flywheel: fluctuation", fluctuation)
    turning = [str(name) for name, unit in zip(run.actuator.values, run.actuator_unit.values) if unit == "N m"] if "actuator" in run.coords else []
    if actuator is None and len(turning) != 1:
        raise InputError(f"flywheel: actuator: the run has {len(turning)} drives that turn (expected actuator=, one of {', '.join(turning) or 'none'})")
    name = as_known("flywheel: actuator", turning[0] if actuator is None else actuator, turning, "actuator")
    time = _clock(run, "driving_force", "flywheel")
    _clock(run, "driving_speed", "flywheel")
    torque = run.driving_force.sel(actuator=name).values
    speed = run.driving_speed.sel(actuator=name).values
    angle = turned_on(_angle(run, name), speed, time)
    if not (speed > 0).all() and not (speed < 0).all():
        raise InputError(f"flywheel: the shaft of {name} stands or turns back (expected a run in which it turns on)")
    work = running(torque[:, np.newaxis], angle)[:, 0]
    mean_torque = work[-1] / (angle[-1] - angle[0])
    stored = mean_torque * (angle - angle[0]) - work
    mean_speed = abs(angle[-1] - angle[0]) / (time[-1] - time[0])
    varied = float(np.ptp(stored))
    values = {
        "inertia": (varied / (delta * mean_speed**2), "kg m2", f"inertia of a flywheel on the shaft of {name}"),
        "energy": (varied, "J", "energy that it takes up and gives back"),
        "mean_torque": (mean_torque, "N m", "torque of the drive"),
        "mean_speed": (mean_speed, "rad/s", "of the shaft"),
        "slowest_at": (time[stored.argmin()], "s", "when the shaft is slowest"),
        "fastest_at": (time[stored.argmax()], "s", "when the shaft is fastest"),
    }
    return xr.Dataset({key: ((), value, {"units": unit, "long_name": words}) for key, (value, unit, words) in values.items()},
                      attrs={"actuator": name, "fluctuation": delta})


def duty_cycle(phases: list[tuple[xr.Dataset | float, float]], quantity: str = "driving_force") -> xr.DataArray:
    """Rms value over phases that follow each other: the torque a motor is chosen by.

    Parameters
    ----------
    phases
        (run, seconds) or (value, seconds): the run repeated for so long, or a constant value (a pause: 0.0).
    quantity
        A result of the runs with values by actuator.

    Returns
    -------
    xarray.DataArray
        (actuator,), in the unit of the quantity.

    Raises
    ------
    InputError
        No run among the phases, runs of different actuators, a run without a sample that could be computed, a value that is no finite number,
        a time that is not above zero.
    """
    if not isinstance(phases, Iterable):
        raise InputError(f"duty_cycle: phases: expected a list of (run, seconds) and (value, seconds), got {quoted(phases)}")
    pairs = [_phase(i, phase) for i, phase in enumerate(phases)]
    runs = [phase for phase, _ in pairs if isinstance(phase, xr.Dataset)]
    if not runs:
        raise InputError("duty_cycle: phases: there is no run among them (expected (run, seconds), and (value, seconds) of pauses)")
    first = need_result(runs[0], quantity, "duty_cycle")
    squares, whole = np.zeros(first.shape[1:]), 0.0
    for i, (phase, duration) in enumerate(pairs):
        if isinstance(phase, xr.Dataset):
            values = need_result(phase, quantity, "duty_cycle")
            if not values.isel(sample=0, drop=True).coords.to_dataset().drop_vars("time", errors="ignore").equals(
                    first.isel(sample=0, drop=True).coords.to_dataset().drop_vars("time", errors="ignore")):
                raise InputError(f"duty_cycle: phases[{i}]: its {quantity} is of other parts than that of the first run")
            if not good_samples(phase).any():
                raise InputError(f"duty_cycle: phases[{i}]: all samples failed (expected a run of which some can be computed)")
            level = rms(values.values, shares(phase))
        else:
            level = np.full(first.shape[1:], abs(phase))
        squares += duration * level**2
        whole += duration
    return first.isel(sample=0, drop=True).drop_vars("time", errors="ignore").copy(data=np.sqrt(squares / whole))


def _phase(i: int, phase: Any) -> tuple[xr.Dataset | float, float]:
    """A run or a constant value, and how long it lasts."""
    if not isinstance(phase, (tuple, list)) or len(phase) != 2:
        raise InputError(f"duty_cycle: phases[{i}]: expected (run, seconds) or (value, seconds)")
    of, seconds = phase
    duration = as_positive(f"duty_cycle: phases[{i}]: seconds", seconds)
    return of if isinstance(of, xr.Dataset) else as_number(f"duty_cycle: phases[{i}]: value", of), duration


def running(values: Values, over: Values) -> Values:
    """Integral from the first sample to each, by the trapezoidal rule along the first dimension."""
    steps = np.diff(over)[:, np.newaxis] * (values[1:] + values[:-1]) / 2
    return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(steps, axis=0)])


def _clock(run: xr.Dataset, quantity: str, caller: str) -> Values:
    """Instants of a run that can be integrated."""
    need_result(run, quantity, caller)
    if "time" not in run.coords or run.sizes["sample"] < 2:
        raise InputError(f"{caller}: the run has no instants to integrate over (expected a run along a motion)")
    need_order(run, caller)
    if n := int((~good_samples(run)).sum()):
        raise InputError(f"{caller}: {n} sample{'s' if n > 1 else ''} failed (expected a run of which all can be computed)")
    times: Values = run.time.values
    if not times[-1] > times[0]:
        raise InputError(f"{caller}: all samples of the run are at {times[0]:g} s (expected a run along a motion)")
    return times


def _angle(run: xr.Dataset, actuator: str) -> Values:
    """Of the shaft, but for whole turns."""
    if "joint_variable" not in run:
        raise InputError("flywheel: the run has no joint_variable (expected a run that wants it)")
    names = list(map(str, run["variable"].values))
    driven = {actuator, actuator.rpartition(":")[0]} - {""}
    place = next(i for i, name in enumerate(names) if name in driven or name.rpartition(".")[0] in driven)
    values: Values = run.joint_variable.values[:, place]
    return values
