"""The force and moment by which a machine shakes its foundation.

They follow from the momentum of the links, their weight and their loads, not from reactions: so whatever acts between frame and links counts,
joints and drives, springs and dampers, and no list of these can be short of one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from .._arguments import as_finite
from .._geometry.frame_motion import frame_rates, gravity_at, with_frame
from .._geometry.kinematics import LinkMotion, link_motion
from ..errors import InputError
from ..results import instants_of
from ..scene import Scene
from .averages import good_samples

__all__ = ["inertia_size", "inertia_wrench", "shaking"]

Vectors = NDArray[np.float64]
PARTS = ("inertia", "weight", "load")


def shaking(run: xr.Dataset, scene: Scene, about: ArrayLike | None = None) -> xr.Dataset:
    """What the machine does to its frame.

    Parameters
    ----------
    run
        Results of `Scene.inverse` or `Scene.forward`. Of a batch to which no ``t`` was given the scene's loads are those at the instant 0.
    scene
        The scene that was run.
    about
        (3,), planar (2,): the point that the moment is about, world axes [m]; default: the origin.

    Returns
    -------
    xarray.Dataset
        ``force`` [N] and ``moment`` [N m], (sample, component): what links, drives and springs together exert on the frame, world axes; and by
        ``cause`` ("inertia", "weight", "load"), of which they are the sum, ``force_by_cause`` and ``moment_by_cause`` (cause, sample, component).
        Where the frame moves, inertia is that of the whole motion, and the axes are the frame's.
        Loads count as from outside. Planar: x, y and the moment about z. NaN at samples that failed. Where the frame moves also ``frame_power`` [W]
        (sample): what its drive gives to the mechanism, the power against this force and moment. With that of the drives and loads it changes the energy of
        the whole motion.

    Raises
    ------
    InputError
        A point of a wrong shape; a coordinate is an angle of a spherical joint; the frame moves, and the run has no time.
    """
    n_axes = 2 if scene.planar else 3
    point = np.zeros(3)
    if about is not None:
        point[:n_axes] = as_finite("shaking: about", about, (n_axes,))
    motion = with_frame(link_motion(scene, run), run, "shaking")
    parts = (inertia_wrench(motion, run, point), _weight(motion, run, point), _loads(motion, run, point))
    force, moment = (np.stack([part[i] for part in parts]) for i in (0, 1))
    force[:, ~good_samples(run)] = moment[:, ~good_samples(run)] = np.nan
    turns = moment[..., 2:] if scene.planar else moment
    axes = ["x", "y", "z"][:n_axes]
    dims, clock = ("sample", "force_axis"), {"time": run.time} if "time" in run.coords else {}
    words = "exerted on the frame, world axes"
    values: dict[str, Any] = {
        "force": (dims, force[..., :n_axes].sum(axis=0), {"units": "N", "long_name": f"force {words}"}),
        "moment": (("sample", "moment_axis"), turns.sum(axis=0), {"units": "N m", "long_name": f"moment {words}"}),
        "force_by_cause": (("cause", *dims), force[..., :n_axes], {"units": "N", "long_name": f"force {words}"}),
        "moment_by_cause": (("cause", "sample", "moment_axis"), turns, {"units": "N m", "long_name": f"moment {words}"}),
    }
    if scene.description["frame_moves"]:
        values["frame_power"] = ("sample", _frame_power(scene, run, force.sum(axis=0), moment.sum(axis=0), point),
                                 {"units": "W", "long_name": "power of the moving frame's drive on the mechanism"})
    labels = {"force_axis": axes, "moment_axis": ["z"] if scene.planar else axes, "cause": list(PARTS)}
    return xr.Dataset(values, {**clock, **labels}, {"about": point[:n_axes]})


def _frame_power(scene: Scene, run: xr.Dataset, force: Vectors, moment: Vectors, point: Vectors) -> Vectors:
    """Of the force and moment, about the point, that keep the frame on its way."""
    velocity, spin = frame_rates(scene, run, "shaking")
    power: Vectors = -np.einsum("ni,ni->n", force, velocity + np.cross(spin, point)) - np.einsum("ni,ni->n", moment, spin)
    return power


def inertia_wrench(motion: LinkMotion, run: xr.Dataset, point: Vectors) -> tuple[Vectors, Vectors]:
    """Minus the rate of momentum and of angular momentum about a point, (N, 3) each."""
    n = len(motion.position)
    force, moment = np.zeros((n, 3)), np.zeros((n, 3))
    for pull, lever, rate in _inertia_terms(motion, run, point):
        force += pull
        moment += np.cross(lever, pull) - rate
    return force, moment


def inertia_size(run: xr.Dataset, scene: Scene) -> tuple[float, float]:
    """Size of what `shaking` adds up to the force [N] and to the moment about the origin [N m] by inertia: by it rounding in them is known.

    Of each body the mass times acceleration, and this times its lever, whatever the angle between them, and the rate of its own angular momentum; the largest
    sum over the bodies in all samples that were computed.
    """
    motion = with_frame(link_motion(scene, run), run, "shaking")
    good = good_samples(run)
    force, moment = np.zeros(len(good)), np.zeros(len(good))
    for pull, lever, rate in _inertia_terms(motion, run, np.zeros(3)):
        size = np.linalg.norm(pull, axis=-1)
        force += size
        moment += size * np.linalg.norm(lever, axis=-1) + np.linalg.norm(rate, axis=-1)
    return float(force[good].max(initial=0.0)), float(moment[good].max(initial=0.0))


def _inertia_terms(motion: LinkMotion, run: xr.Dataset, point: Vectors) -> Iterator[tuple[Vectors, Vectors, Vectors]]:
    """Of each body minus mass times acceleration, its lever about a point, and the rate of the angular momentum about its centre of mass."""
    lines = {line["link"]: np.array(line["axis"]) for line in motion.scene.description["spin_lines"]}
    for k, mass, cog, inertia in _bodies(motion, run):
        place, _, acceleration = motion.of_point(k, cog)
        turn = motion.rotation[:, k]
        tensor = turn @ inertia @ np.swapaxes(turn, 1, 2)
        spin, spin_rate = motion.spin[:, k], motion.spin_rate[:, k]
        if k in lines:
            spin, spin_rate = _across(turn @ lines[k], spin, spin_rate)
        rate = _times(tensor, spin_rate) + np.cross(spin, _times(tensor, spin))
        yield -mass * acceleration, place - point, rate


def _across(line: Vectors, spin: Vectors, spin_rate: Vectors) -> tuple[Vectors, Vectors]:
    """Angular velocity and acceleration of a link without its idle spin: in axes at rest nothing turns it about its line, a frame that turns
    does not take it along."""
    about = np.einsum("ni,ni->n", spin, line)[:, np.newaxis]
    growth = np.einsum("ni,ni->n", spin_rate, line)[:, np.newaxis]
    return spin - about * line, spin_rate - growth * line - about * np.cross(spin, line)


def _weight(motion: LinkMotion, run: xr.Dataset, point: Vectors) -> tuple[Vectors, Vectors]:
    n, gravity = len(motion.position), gravity_at(motion.scene, run, "shaking")
    force, moment = np.zeros((n, 3)), np.zeros((n, 3))
    for k, mass, cog, _ in _bodies(motion, run):
        weight = mass * gravity
        force += weight
        moment += np.cross(motion.of_point(k, cog)[0] - point, weight)
    return force, moment


def _bodies(motion: LinkMotion, run: xr.Dataset) -> Iterator[tuple[int, Vectors, Any, Vectors]]:
    """Links and payloads: number of the link, (N, 1) mass, centre of mass and (N or 1, 3, 3) inertia about it in link axes."""
    for k, link in enumerate(motion.scene.description["links"][1:], start=1):
        yield k, np.full((1, 1), link["mass"]), link["cog"], _tensor(link["inertia"])
    payloads = motion.scene.description["payloads"]
    if not payloads:
        return
    instants = instants_of(run)
    if instants is None and motion.scene.description["wants_instants"]:
        raise InputError("shaking: the mass of a payload changes with time (expected a run along time)")
    masses = motion.scene.payload_masses(np.zeros(1) if instants is None else instants)
    for mass, payload in zip(masses.T, payloads):
        yield payload["link"], mass[:, np.newaxis], payload["at"], (mass[:, np.newaxis, np.newaxis] > 0) * _tensor(payload["inertia"])


def _tensor(elements: Any) -> Vectors:
    xx, yy, zz, xy, yz, zx = elements
    return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])


def _loads(motion: LinkMotion, run: xr.Dataset, point: Vectors) -> tuple[Vectors, Vectors]:
    """The scene's loads, and those given in the call."""
    n, scene = len(motion.position), motion.scene
    force, moment = np.zeros((n, 3)), np.zeros((n, 3))
    links = scene.description["links"]
    instants = instants_of(run)
    values = scene.load_values(np.zeros(1) if instants is None else instants, run.q, run.qd, in_order="time" in run.coords)
    given: list[tuple[int, str, Vectors]] = []
    for i, load in enumerate(scene.description["loads"]):
        wrench = np.broadcast_to(values[:, i], (n, 6))
        if load["axes"] == "link":
            turn = motion.rotation[:, load["link"]]
            wrench = np.hstack([_times(turn, wrench[:, :3]), _times(turn, wrench[:, 3:])])
        given.append((load["link"], load["marker"], wrench))
    if "wrench" in run:
        columns = [0, 1, 5] if scene.planar else list(range(6))
        for i, name in enumerate(map(str, run.loaded_marker.values)):
            wrench = np.zeros((n, 6))
            wrench[:, columns] = run.wrench.values[:, i]
            link, marker = next((k, m["name"]) for k, body in enumerate(links) for m in body["markers"] if f"{body['name']}.{m['name']}" == name)
            given.append((link, marker, wrench))
    for k, name, wrench in given:
        at = next(marker["at"] for marker in links[k]["markers"] if marker["name"] == name)
        force += wrench[:, :3]
        moment += np.cross(motion.of_point(k, at)[0] - point, wrench[:, :3]) + wrench[:, 3:]
    return force, moment


def _times(matrices: Vectors, vectors: Vectors) -> Vectors:
    turned: Vectors = np.einsum("nij,nj->ni", matrices, vectors)
    return turned
