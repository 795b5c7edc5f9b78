"""Bearings chosen by the reactions of a cycle: life of rolling ones by ISO 281, pressure times speed of plain ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .._arguments import as_known, as_number, as_positive
from .._geometry.kinematics import variable_of
from .._geometry.postures import find_postures, placed_poses
from ..errors import InputError
from ..results import need_result
from ..scene import Scene
from .averages import mean, power_mean, shares

__all__ = ["bearing_life", "plain_bearing"]

Values = NDArray[np.float64]
TURNING = ("revolute", "cylindrical")
MILLION = 1e6
NOTHING = 1e-9
"""A thrust or moment below this part of the radial load is rounding."""


def bearing_life(
    run: xr.Dataset,
    joint: str,
    scene: Scene,
    *,
    capacity: float,
    exponent: float = 3.0,
    radial_factor: float = 1.0,
    axial_factor: float | None = None,
    span: float | None = None,
) -> xr.Dataset:
    """Basic rating life of a joint's rolling bearing by ISO 281, from the loads and turning of a cycle.

    The equivalent load of a sample is the larger of Fr and X Fr + Y Fa; over the cycle its mean of the exponent's power, weighted by how fast the
    joint turns. An oscillating joint counts by the angle it sweeps. The driving force of a driven joint is not among the loads.

    Parameters
    ----------
    run
        Results along the cycle, with ``reaction`` and ``joint_rate``.
    joint
        A revolute or cylindrical joint.
    scene
        The scene that was run.
    capacity
        Basic dynamic load rating C [N].
    exponent
        3 of ball bearings, 10/3 of roller bearings.
    radial_factor, axial_factor
        X and Y of the bearing's catalogue; Y is wanted where the joint bears thrust.
    span
        Distance [m] of two bearings, half of it to each side of the joint's second marker, which share force and moment; each has the capacity, the
        more heavily loaded one is told, and thrust is borne by either. Wanted where the joint bears a moment across its axis.

    Returns
    -------
    xarray.Dataset
        ``equivalent_load`` [N], ``peak_load`` [N] (of the equivalent loads), ``life_turns`` [1], ``life_hours`` [h], ``turning`` [rad/s], the mean of the joint's speed without sign.
        Life is infinite where the joint does not turn or bears nothing.

    Raises
    ------
    InputError
        No such joint, a joint that does not turn, numbers that are not above zero, thrust without ``axial_factor``, moments without ``span``.
    """
    capacity = as_positive("bearing_life: capacity", capacity)
    exponent = as_number("bearing_life: exponent", exponent)
    if exponent not in (3.0, 10 / 3):
        raise InputError(f"bearing_life: exponent: {exponent:g}: ISO 281 has two (expected 3 of ball bearings or 10/3 of roller bearings)")
    load = _load_of(run, joint, scene, "bearing_life")
    radials = [load.radial_size]
    if span is not None:
        arm = as_positive("bearing_life: span", span)
        pair = np.cross(load.moment, load.axis) / arm
        radials = [np.linalg.norm(load.radial / 2 + side * pair, axis=1) for side in (1, -1)]
    elif (np.linalg.norm(load.moment, axis=1) > NOTHING * (load.radial_size + load.thrust).max() * load.length).any():
        raise InputError(f"bearing_life: joint {joint!r} bears a moment across its axis (expected span=, the distance of its two bearings)")
    x = as_positive("bearing_life: radial_factor", radial_factor)
    if axial_factor is None and (load.thrust > NOTHING * load.radial_size.max()).any():
        raise InputError(f"bearing_life: joint {joint!r} bears thrust (expected axial_factor=, the Y of its bearing)")
    y = 0.0 if axial_factor is None else as_number("bearing_life: axial_factor", axial_factor)
    if y < 0:
        raise InputError(f"bearing_life: axial_factor: expected a number from 0 on, got {y:g}")
    swept = load.weights * load.speed
    turning = float(mean(load.speed, load.weights))
    equivalents = [np.maximum(radial, x * radial + y * load.thrust) for radial in radials]
    whole = [float(power_mean(size, swept, exponent)) if swept.sum() > 0 else 0.0 for size in equivalents]
    worst = int(np.argmax(whole))
    equivalent = whole[worst]
    turns = MILLION * (capacity / equivalent) ** exponent if equivalent > 0 else np.inf
    values = {
        "equivalent_load": (equivalent, "N", "dynamic equivalent load of the cycle"),
        "peak_load": (float(equivalents[worst].max()), "N", "largest equivalent load of a sample"),
        "life_turns": (turns, "1", "turns that 90 % of such bearings reach, L10"),
        "life_hours": (turns / (turning / (2 * np.pi) * 3600) if turning > 0 else np.inf, "h", "the same in hours of this cycle"),
        "turning": (turning, "rad/s", "mean speed of the joint, without sign"),
    }
    return _told(values, {"joint": joint, "capacity": capacity, "exponent": exponent})


def plain_bearing(run: xr.Dataset, joint: str, scene: Scene, *, diameter: float, width: float) -> xr.Dataset:
    """Pressure, sliding speed and their product in a joint's plain bearing.

    Parameters
    ----------
    run
        Results along the cycle, with ``reaction`` and ``joint_rate``.
    joint
        A revolute or cylindrical joint.
    scene
        The scene that was run.
    diameter, width
        Of the bearing [m]: the pressure is radial force / (diameter width), the speed diameter / 2 times that of the joint.

    Returns
    -------
    xarray.Dataset
        ``peak_pressure`` [Pa], ``peak_speed`` [m/s], ``peak_pv`` and ``mean_pv`` [W/m^2].

    Raises
    ------
    InputError
        No such joint, a joint that does not turn, sizes that are not above zero.
    """
    diameter = as_positive("plain_bearing: diameter", diameter)
    width = as_positive("plain_bearing: width", width)
    load = _load_of(run, joint, scene, "plain_bearing")
    pressure, speed = load.radial_size / (diameter * width), load.speed * diameter / 2
    values = {
        "peak_pressure": (float(pressure.max()), "Pa", "largest pressure over the projected area"),
        "peak_speed": (float(speed.max()), "m/s", "largest sliding speed"),
        "peak_pv": (float((pressure * speed).max()), "W/m2", "largest product of pressure and speed"),
        "mean_pv": (float(mean(pressure * speed, load.weights)), "W/m2", "mean product of pressure and speed"),
    }
    return _told(values, {"joint": joint, "diameter": diameter, "width": width})


@dataclass(frozen=True)
class _Load:
    """Of a joint's bearing at the samples that did not fail."""

    axis: Values
    radial: Values
    """(N, 3) [N]"""
    thrust: Values
    """(N,) [N], without sign."""
    moment: Values
    """(N, 3) across the axis [N m], at the second marker."""
    speed: Values
    """(N,) [rad/s], without sign."""
    weights: Values
    """(N,) parts of the time."""
    length: float
    """Size of the mechanism [m]."""

    @property
    def radial_size(self) -> Values:
        sizes: Values = np.linalg.norm(self.radial, axis=1)
        return sizes


def _load_of(run: xr.Dataset, joint: str, scene: Scene, caller: str) -> _Load:
    kinds = {entry["name"]: entry for entry in scene.description["joints"]}
    turning = [name for name, entry in kinds.items() if entry["type"] in TURNING]
    if isinstance(joint, str) and joint in kinds and joint not in turning:
        raise InputError(f"{caller}: joint {joint!r} is {kinds[joint]['type']} (expected one that turns about an axis: {', '.join(turning) or 'there is none'})")
    as_known(f"{caller}: joint", joint, turning, "joint")
    reaction = need_result(run, "reaction", caller)
    rate = need_result(run, "joint_rate", caller)
    weights = shares(run)
    good = weights > 0
    if not good.any():
        raise InputError(f"{caller}: all samples failed")
    wrench = {str(name): reaction.sel(joint=joint, component=name).values[good] for name in reaction.component.values}
    zero = np.zeros(int(good.sum()))
    force, moment = (np.stack([wrench.get(f"{letter}{x}", zero) for x in "xyz"], axis=1) for letter in "FM")
    postures, _ = find_postures(scene, placed_poses(scene, run, caller))
    link, marker = kinds[joint]["links"][0], kinds[joint]["markers"][0]
    axis = np.tile([0.0, 0.0, 1.0], (len(zero), 1)) if scene.planar else postures.axes[link][marker][good]
    axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    along = np.einsum("nk,nk->n", force, axis)
    names = list(map(str, rate["variable"].values))
    place = next(i for i, name in enumerate(names) if (found := variable_of(scene, name)) and found[0]["name"] == joint and found[1] == "angle")
    points = postures.points[good].reshape(-1, 3)
    return _Load(
        axis=axis,
        radial=force - along[:, np.newaxis] * axis,
        thrust=np.abs(along),
        moment=moment - np.einsum("nk,nk->n", moment, axis)[:, np.newaxis] * axis,
        speed=np.abs(rate.values[good, place]),
        weights=weights[good],
        length=float(np.ptp(points, axis=0).max()),
    )


def _told(values: dict[str, tuple[float, str, str]], attributes: dict[str, str | float]) -> xr.Dataset:
    return xr.Dataset({name: ((), value, {"units": unit, "long_name": words}) for name, (value, unit, words) in values.items()}, attrs=attributes)
