"""The run that a scene itself asks for, along its time or up to one instant of it."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from .postures import poses_of

if TYPE_CHECKING:
    import xarray as xr

    from ..scene import Poses, Scene

__all__ = ["poses_at", "run_of"]


def run_of(scene: Scene) -> xr.Dataset:
    """By the scene's motion; by its drives if no coordinate has one or actuators are missing."""
    return scene.inverse() if _is_inverse(scene, *_moves_and_drives(scene)) else scene.forward()


def poses_at(scene: Scene, instant: float) -> Poses:
    """Where the links are at an instant [s] of that run: one sample, and it may be one that cannot be assembled.

    Raises
    ------
    InputError
        Nothing moves the scene, or its forward run does not come so far.
    """
    first, last = scene.description["time"]["first"], scene.description["time"]["last"]
    moves, drives = _moves_and_drives(scene)
    inverse = _is_inverse(scene, moves, drives)
    if inverse and not moves:
        raise InputError("nothing moves the scene (expected a motion of a coordinate, or a law of an actuator)")
    if instant < first or first < last < instant:
        raise InputError(f"expected an instant of the motion, from {first:g} to {last:g} s, got {instant:g}" if first < last
                         else f"expected an instant from {first:g} s on, got {instant:g}")
    if inverse:
        before = scene.times()
        run = scene.inverse(t=np.append(before[before < instant], instant), want="joint_variable")
    else:
        run = scene.forward(t=[first, instant] if instant > first else [first], want="joint_variable")
        if run.time[-1] < instant or run.q[-1].isnull().any():
            raise InputError(f"the run does not come to {instant:g} s: {run.attrs['stopped']}")
    return poses_of(scene, run.isel(sample=[-1]))


def _is_inverse(scene: Scene, moves: bool, drives: bool) -> bool:
    return len(scene.actuators) == len(scene.coordinates) and (moves or not drives)


def _moves_and_drives(scene: Scene) -> tuple[bool, bool]:
    """Does a coordinate have a motion, an actuator a law?"""
    content = tomllib.loads(scene.text)
    return (any("motion" in entry for entry in content.get("coordinate", [])), any("law" in entry for entry in content.get("actuator", [])))
