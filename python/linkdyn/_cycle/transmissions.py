"""From a drive's force in the mechanism to the motor, screw or cylinder behind it: torque, speed, current, pressure, flow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .._arguments import as_known, as_number, as_positive
from .._geometry.kinematics import link_motion, variable_acceleration, variable_of
from ..errors import InputError
from ..results import need_result
from ..scene import Scene
from .averages import good_samples, mean, rms, shares
from .gas import REFERENCE_WORDS, chamber_volumes, filling_flow, flow_power

__all__ = ["beyond_supply", "cylinder", "motor", "slide_beyond", "slide_of"]

Values = NDArray[np.float64]
STILL = 1e-9
"""A speed below this part of the largest is a standstill."""
ROUNDED = 1e-9
"""Of a pressure, and of a way [m]: what is at its limit is not beyond it."""
GIVE = 1e-3
"""Of a stroke: so far errors of steps let a piston beyond its stop in forward runs."""


def motor(
    run: xr.Dataset,
    actuator: str,
    scene: Scene,
    *,
    ratio: float | None = None,
    lead: float | None = None,
    inertia: float = 0.0,
    efficiency: float = 1.0,
    back_efficiency: float | None = None,
    torque_constant: float | None = None,
    resistance: float | None = None,
    inductance: float | None = None,
) -> xr.Dataset:
    """What an actuator's force or torque asks of the motor behind its gear or screw.

    Where the scene has a drive at the actuator, ``drive`` of its ``[[actuator]]``, it is that drive's motor, as the engine has found it, and no key
    but resistance and inductance is given (by default the drive's own). Else the keys say what stands behind the actuator, and the rotor is not part of the mechanism that was run.

    The motor turns n rad for a unit of the joint variable: n is the ratio, or 2 pi/lead. It gives the load's share, F/n over the efficiency where it drives the
    load, F/n times the back efficiency where the load drives it, and what its own inertia takes. At a standstill the share is F/n.

    Parameters
    ----------
    run
        Results with ``driving_force`` and ``driving_speed``.
    actuator
        Of a joint's angle or slide.
    scene
        The scene that was run.
    ratio
        Motor angle over joint angle of a gear; negative: it turns the other way. One of ratio and lead is wanted: ratio for torques, lead for forces.
    lead
        Way of the slide in a turn of the motor [m]: of a screw, of a belt or rack round its pinion.
    inertia
        Of the rotor and all that turns with it [kg m^2].
    efficiency
        Of gear or screw while the motor drives, in (0, 1].
    back_efficiency
        The same while the load drives, at most 1; zero or less: self-locking, the motor has to drive the load down too. Default: the efficiency of gears, of
        screws 2 - 1/efficiency, which is that of the same friction.
    torque_constant
        [N m/A] For the current.
    resistance
        [ohm] With the torque constant: for voltage and electric power.
    inductance
        [H] With the resistance: the voltage has its part L di/dt, too, by differences of fourth order over the samples. They stand close enough where the
        current between five of them is smooth; without instants there is no such voltage.

    Returns
    -------
    xarray.Dataset
        Along the run ``motor_speed`` [rad/s], ``motor_torque`` [N m], ``motor_power`` [W], with a torque constant ``motor_current`` [A], with a resistance too
        ``motor_voltage`` [V] and ``electric_power`` [W]; of the scene's drive ``transmission_loss`` [W], with limits ``torque_margin`` [N m], with a brake
        ``brake_torque`` [N m]. Of the whole ``rms_torque``, ``peak_torque`` [N m], ``peak_speed`` [rad/s], ``rms_current`` [A].
        ``attrs["self_locking"]``: 1 where the load cannot drive the motor.

    Raises
    ------
    InputError
        No such actuator, a ratio of a force or a lead of a torque, numbers out of range, keys beside the scene's drive.
    """
    if inductance is not None:
        as_positive("motor: inductance", inductance)
    inertia = as_number("motor: inertia", inertia)
    if inertia < 0:
        raise InputError(f"motor: inertia: expected a number from 0 on, got {inertia:g}")
    efficiency = as_positive("motor: efficiency", efficiency)
    if efficiency > 1:
        raise InputError(f"motor: efficiency: expected a number above 0, up to 1, got {efficiency:g}")
    given = ratio, lead, inertia or None, None if efficiency == 1.0 else efficiency, back_efficiency, torque_constant
    if (own := _drive_of(scene, actuator)) is not None:
        if any(key is not None for key in given):
            raise InputError(f"motor: the scene has a drive at {actuator!r} (expected no keys but resistance=, inductance=)")
        return _of_the_scene(run, actuator, own, resistance, inductance)
    n = _turns_of(run, actuator, ratio, lead)
    if back_efficiency is None:
        back = efficiency if lead is None else 2 - 1 / efficiency
    else:
        back = as_number("motor: back_efficiency", back_efficiency)
        if back > 1:
            raise InputError(f"motor: back_efficiency: expected a number up to 1, got {back:g}")
    force, speed = (need_result(run, name, "motor").sel(actuator=actuator).values for name in ("driving_force", "driving_speed"))
    power = force * speed
    still = np.abs(speed) <= STILL * np.nanmax(np.abs(speed), initial=0.0)
    torque = force / n * np.where(still | (power == 0), 1.0, np.where(power > 0, 1 / efficiency, back))
    if inertia > 0:
        torque = torque + inertia * n * _acceleration_of(run, actuator, scene)
    return _whole(run, actuator, torque, n * speed, torque_constant, resistance, inductance, back <= 0)


def cylinder(
    run: xr.Dataset,
    actuator: str,
    scene: Scene | None = None,
    *,
    bore: float | None = None,
    rod: float = 0.0,
    supply: float | None = None,
    tank: float = 0.0,
    extends: int = 1,
) -> xr.Dataset:
    """Pressures and flows of a hydraulic or pneumatic cylinder that gives an actuator's force.

    Where a forward run has the cylinder's pressures as states, ``cylinder_pressure``, they are these, and flows are those through its valve. Else the side that
    does not push stands under the tank's pressure; so the other has what the force asks for, which is the least.

    Flows of oil are the volumes that the piston sweeps. Flows of gas (``gas`` of the scene's cylinder) are told in the volume at 1 bar, by which valves and
    compressors are chosen, in every run: p_r Q = p A v + V p'/n with the absolute pressure p, its rate by differences of fourth order over the samples. A
    sample on its own does not tell that rate, which is the force's: without increasing instants, or without the joint variables, flows and power are NaN. Its power is the air power, p_r Q ln(p/p_tank) (Cai, Kawashima, Kagawa, J. Fluids Eng. 128 (2006) 402-405):
    the work that the gas could do on its way to the tank's pressure, at one temperature.

    Parameters
    ----------
    run
        Results with ``driving_force``, ``driving_speed``.
    actuator
        Of a slide.
    scene
        The scene of the run: where it has a ``cylinder`` at the actuator no other key is needed.
    bore, rod
        Diameters of piston and rod [m].
    supply
        Pressure of the supply [Pa]: samples that ask for more are counted.
    tank
        Pressure of the side that does not push [Pa].
    extends
        1: the cylinder grows longer as the slide grows; -1: it grows shorter.

    Returns
    -------
    xarray.Dataset
        Along the run ``head_pressure``, ``rod_pressure`` [Pa], ``head_flow``, ``rod_flow`` [m^3/s] into the sides without and with the rod, ``hydraulic_power`` [W] of
        both, above the tank's pressure. Of the whole ``peak_pressure`` [Pa], ``peak_flow``, ``mean_flow`` [m^3/s] out of the supply, ``stroke`` [m]
        and ``stroke_volume`` [m^3] where the joint variables are among the results. ``attrs["above_supply"]``: samples beyond the supply; ``attrs["beyond_stroke"]``: samples
        with the slide beyond the ends of the scene's cylinder; ``attrs["pressures_found"]``: 1 where the pressures are states of the run;
        ``attrs["has_gas"]``: 1 where flows are in the volume that the gas has at 1 bar; ``attrs["flows_known"]``: 0 where they are NaN for want of rates.

    Raises
    ------
    InputError
        No such actuator, one of a torque, a rod as thick as the piston, numbers out of range.
    """
    _known_actuator(run, actuator, "cylinder", "N")
    if bore is None:
        own = None if scene is None else next((found for found in scene.description["cylinders"] if found["name"] == actuator), None)
        if own is None:
            raise InputError(f"cylinder: the scene has no cylinder at {actuator!r} (expected bore=, rod=)")
        areas, stroke = (own["head_area"], own["rod_area"]), (own["retracted"], own["extended"])
        if is_found := "cylinder_pressure" in run and actuator in run["cylinder"].values:
            sides = _states(run, actuator)
        else:
            sides = _asked(run, actuator, areas, own["tank"], 1 if stroke[1] > stroke[0] else -1)
            if own["has_gas"]:
                sides = _filled(run, actuator, sides, areas, stroke, own)
        return _figures(run, actuator, sides, areas, own["supply"], own["tank"], stroke, is_found, own["has_gas"])
    bore = as_positive("cylinder: bore", bore)
    rod = as_number("cylinder: rod", rod)
    if not 0 <= rod < bore:
        raise InputError(f"cylinder: rod: expected a diameter from 0 on, less than the bore of {bore:g} m, got {rod:g}")
    if extends not in (1, -1):
        raise InputError(f"cylinder: extends: expected 1 or -1, got {extends!r}")
    tank = as_number("cylinder: tank", tank)
    head_area = math.pi / 4 * bore**2
    areas = (head_area, head_area - math.pi / 4 * rod**2)
    return _figures(run, actuator, _asked(run, actuator, areas, tank, extends), areas, supply, tank)


def slide_of(run: xr.Dataset, actuator: str) -> Values | None:
    """Along the run, of the slide that an actuator drives [m]; None if joint variables are not among the results."""
    name = f"{actuator.partition(':')[0].removesuffix('.slide')}.slide"
    if "joint_variable" not in run or name not in run["variable"].values:
        return None
    values: Values = run.joint_variable.sel(variable=name).values
    return values


def beyond_supply(pressure: Values, supply: float) -> Values:
    """What a pressure asks for above the supply's [Pa]; zero where that suffices, but for rounding."""
    above: Values = np.where(pressure > (1 + ROUNDED) * supply, pressure - supply, 0.0)
    return above


def slide_beyond(run: xr.Dataset, slide: Values, stroke: tuple[float, float]) -> Values:
    """How far a slide is beyond the ends of a cylinder [m]; zero within, where it touches an end, and where a sample failed."""
    give = GIVE * abs(stroke[1] - stroke[0]) if "method" in run.attrs else ROUNDED
    way = np.nan_to_num(np.maximum(min(stroke) - slide, slide - max(stroke)))
    beyond: Values = np.where((way > give) & good_samples(run), way, 0.0)
    return beyond


# ---------------------------------------------------------------- parts

@dataclass(frozen=True)
class _Sides:
    """Pressures of the sides without and with the rod [Pa], and flows into them [m^3/s]."""

    head: Values
    ring: Values
    head_flow: Values
    rod_flow: Values


def _asked(run: xr.Dataset, actuator: str, areas: tuple[float, float], tank: float, extends: int) -> _Sides:
    """What the force asks of the side that pushes."""
    head_area, rod_area = areas
    force, speed = (extends * need_result(run, name, "cylinder").sel(actuator=actuator).values for name in ("driving_force", "driving_speed"))
    pushes = force + tank * (rod_area - head_area) >= 0
    head = np.where(pushes, (force + tank * rod_area) / head_area, tank)
    ring = np.where(pushes, tank, (tank * head_area - force) / rod_area)
    gone = np.isnan(force)
    head[gone] = ring[gone] = np.nan
    return _Sides(head, ring, head_area * speed, -rod_area * speed)


def _filled(run: xr.Dataset, actuator: str, sides: _Sides, areas: tuple[float, float], stroke: tuple[float, float], own: dict[str, Any]) -> _Sides:
    """The same of gas: what fills the chambers, where the samples tell how fast their pressures change."""
    slide = slide_of(run, actuator)
    if slide is None or not _follow_each_other(run):
        unknown = np.full(len(sides.head), np.nan)
        return _Sides(sides.head, sides.ring, unknown, unknown)
    flows = [filling_flow(pressure, _slope(run.time.values, pressure), volume, swept, own["exponent"]) for pressure, volume, swept in zip(
        (sides.head, sides.ring), chamber_volumes(slide, areas, stroke, own["dead_volumes"]), (sides.head_flow, sides.rod_flow))]
    return _Sides(sides.head, sides.ring, *flows)


def _follow_each_other(run: xr.Dataset) -> bool:
    """Do the samples tell rates by their differences?"""
    return "time" in run.coords and run.sizes["sample"] > 1 and bool((np.diff(run.time.values) > 0).all())


def _states(run: xr.Dataset, actuator: str) -> _Sides:
    """What a forward run has found."""
    pressure, flow = (need_result(run, name, "cylinder").sel(cylinder=actuator) for name in ("cylinder_pressure", "cylinder_flow"))
    return _Sides(*(values.sel(chamber=chamber).values for values in (pressure, flow) for chamber in ("head", "rod")))


def _figures(
    run: xr.Dataset, actuator: str, sides: _Sides, areas: tuple[float, float], supply: float | None, tank: float,
    stroke: tuple[float, float] | None = None, is_found: bool = False, has_gas: bool = False,
) -> xr.Dataset:  # fmt: skip
    """Of both sides along the run, and of the whole."""
    weights, good = shares(run), good_samples(run)
    both = (sides.head, sides.head_flow), (sides.ring, sides.rod_flow)
    power = sum(flow_power(pressure, flow, tank) if has_gas else (pressure - tank) * flow for pressure, flow in both)
    in_volume = f", {REFERENCE_WORDS}" if has_gas else ""
    found = {
        "head_pressure": (sides.head, "Pa", "pressure on the side without the rod"),
        "rod_pressure": (sides.ring, "Pa", "pressure on the side with the rod"),
        "head_flow": (sides.head_flow, "m3/s", f"flow into the side without the rod{in_volume}"),
        "rod_flow": (sides.rod_flow, "m3/s", f"flow into the side with the rod{in_volume}"),
        "hydraulic_power": (power, "W", "power of the gas that flows in" if has_gas else "power of the oil that flows in"),
    }
    pressure = np.maximum(sides.head, sides.ring)
    drawn = np.maximum(np.maximum(sides.head_flow, sides.rod_flow), 0.0)
    whole = {
        "peak_pressure": (_peak(pressure, good), "Pa", "largest pressure"),
        "peak_flow": (_peak(drawn, good), "m3/s", f"largest flow out of the supply{in_volume}"),
        "mean_flow": (mean(drawn, weights), "m3/s", f"mean flow out of the supply{in_volume}"),
    }
    attributes = {"actuator": actuator, "above_supply": 0, "beyond_stroke": 0, "pressures_found": int(is_found), "has_gas": int(has_gas)}
    if supply is not None:
        attributes["above_supply"] = int(np.count_nonzero(beyond_supply(pressure[good], as_positive("cylinder: supply", supply))))
    slide = slide_of(run, actuator)
    attributes["flows_known"] = int(not has_gas or is_found or (slide is not None and _follow_each_other(run)))
    if slide is not None:
        way = np.ptp(slide[good]) if good.any() else np.nan
        whole["stroke"] = (way, "m", "way between both ends of the motion")
        whole["stroke_volume"] = (way * areas[0], "m3", "what the side without the rod takes over that way")
        if stroke is not None:
            attributes["beyond_stroke"] = int(np.count_nonzero(slide_beyond(run, slide, stroke)))
    return _told(run, found, whole, attributes)


def _drive_of(scene: Scene, actuator: str) -> dict[str, Any] | None:
    """The scene's own drive at an actuator."""
    return next((motor for motor in scene.description["motors"] if motor["name"] == actuator), None)


def _of_the_scene(run: xr.Dataset, actuator: str, drive: dict[str, Any], resistance: float | None, inductance: float | None) -> xr.Dataset:
    """As the engine has found it."""
    torque, speed = (need_result(run, name, "motor").sel(motor=actuator).values for name in ("motor_torque", "motor_speed"))
    known = drive["resistance"] if resistance is None else resistance
    wound = (drive["inductance"] or None) if inductance is None else inductance
    found = _whole(run, actuator, torque, speed, drive["torque_constant"] or None, known or None, wound, drive["back_efficiency"] <= 0)
    beside = [name for name in ("transmission_loss", "brake_torque", "torque_margin") if name in run]
    return found.assign({name: run[name].sel(motor=actuator, drop=True) for name in beside})


def _whole(
    run: xr.Dataset, actuator: str, torque: Values, speed: Values, torque_constant: float | None, resistance: float | None,
    inductance: float | None, locks: bool,
) -> xr.Dataset:  # fmt: skip
    """What follows from torque and speed along the run, and figures of the whole."""
    found: dict[str, tuple[Any, str, str]] = {
        "motor_speed": (speed, "rad/s", "speed of the motor"),
        "motor_torque": (torque, "N m", "torque of the motor"),
        "motor_power": (speed * torque, "W", "power of the motor at its shaft"),
    }
    weights, good = shares(run), good_samples(run)
    whole = {
        "rms_torque": (rms(torque, weights), "N m", "rms torque of the motor"),
        "peak_torque": (_peak(torque, good), "N m", "largest torque of the motor, without sign"),
        "peak_speed": (_peak(speed, good), "rad/s", "largest speed of the motor, without sign"),
    }
    if torque_constant is not None:
        constant = as_positive("motor: torque_constant", torque_constant)
        current = torque / constant
        found["motor_current"] = (current, "A", "current of the motor")
        whole["rms_current"] = (rms(current, weights), "A", "rms current of the motor")
        if resistance is not None:
            voltage = as_positive("motor: resistance", resistance) * current + constant * speed
            if inductance is not None and "time" in run.coords:
                voltage = voltage + inductance * _slope(run.time.values, current)
            if inductance is None or "time" in run.coords:
                found["motor_voltage"] = (voltage, "V", "voltage of the motor")
                found["electric_power"] = (voltage * current, "W", "electric power of the motor")
    elif resistance is not None:
        raise InputError("motor: resistance says nothing without torque_constant")
    if inductance is not None and (resistance is None or torque_constant is None):
        raise InputError("motor: inductance says nothing without torque_constant and resistance")
    return _told(run, found, whole, {"actuator": actuator, "self_locking": int(locks)})


def _slope(t: Values, y: Values) -> Values:
    """Derivative at the samples, of the polynomial through the five nearest of them, or through as many as there are."""
    n, width = len(t), min(5, len(t))
    first = np.clip(np.arange(n) - width // 2, 0, n - width)
    near = first[:, np.newaxis] + np.arange(width)
    # y' = V^-1 with the powers of the times from here: the row of the first power
    x = t[near] - t[:, np.newaxis]
    scale = np.abs(x).max(axis=1, keepdims=True)
    scale[scale == 0] = 1.0
    powers = (x / scale)[:, np.newaxis, :] ** np.arange(width)[:, np.newaxis]
    unit = np.zeros((n, width, 1))
    unit[:, min(1, width - 1), 0] = 1.0 if width > 1 else 0.0
    weights = np.linalg.solve(powers, unit)[..., 0] / scale
    slope: Values = np.sum(weights * y[near], axis=1)
    return slope


def _turns_of(run: xr.Dataset, actuator: str, ratio: float | None, lead: float | None) -> float:
    """Motor angle for a unit of the joint variable."""
    unit = _known_actuator(run, actuator, "motor")
    if (ratio is None) == (lead is None):
        raise InputError("motor: expected one of ratio= (of a torque) and lead= (of a force)")
    if ratio is not None:
        if unit == "N":
            raise InputError(f"motor: actuator {actuator!r} gives a force (expected lead=, the way of its slide in a turn of the motor)")
        n = as_number("motor: ratio", ratio)
        if n == 0:
            raise InputError("motor: ratio: expected a number that is not 0")
        return n
    if unit != "N":
        raise InputError(f"motor: actuator {actuator!r} gives a torque (expected ratio=, motor angle over joint angle)")
    way = as_number("motor: lead", lead)
    if way == 0:
        raise InputError("motor: lead: expected a way that is not 0")
    return 2 * math.pi / way


def _known_actuator(run: xr.Dataset, actuator: str, caller: str, unit: str | None = None) -> str:
    names = list(map(str, need_result(run, "driving_force", caller)["actuator"].values))
    as_known(f"{caller}: actuator", actuator, names, "actuator")
    found = str(run["actuator_unit"].values[names.index(actuator)])
    if unit is not None and found != unit:
        raise InputError(f"{caller}: actuator {actuator!r} gives a torque (expected one that gives a force)")
    return found


def _acceleration_of(run: xr.Dataset, actuator: str, scene: Scene) -> Values:
    found = variable_of(scene, actuator)
    if found is None:
        raise InputError(f"motor: the scene has no actuator {actuator!r} (expected the scene that was run)")
    return variable_acceleration(link_motion(scene, run), *found)


def _peak(values: Values, good: NDArray[np.bool_]) -> float:
    return float(np.abs(values[good]).max()) if good.any() else float("nan")


def _told(run: xr.Dataset, along: dict[str, tuple[Any, str, str]], whole: dict[str, tuple[Any, str, str]], attributes: dict[str, Any]) -> xr.Dataset:
    coordinates = run.coords["time"].coords if "time" in run.coords else {}
    return xr.Dataset(
        {name: ("sample", values, {"units": unit, "long_name": words}) for name, (values, unit, words) in along.items()}
        | {name: ((), value, {"units": unit, "long_name": words}) for name, (value, unit, words) in whole.items()},
        coordinates,
        attributes,
    )
