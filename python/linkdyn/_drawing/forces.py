"""The forces of a run as arrows: where they act, and how large they are at every sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .._geometry.kinematics import variable_of
from .._geometry.postures import Postures, poses_of
from ..errors import InputError
from ..scene import Scene

__all__ = ["Forces", "borne", "find_forces", "force_kinds"]

Vectors = NDArray[np.float64]
Place = tuple[int, tuple[float, ...]]
"""Number of a link, and a point of it in its axes."""

KINDS = ("driving", "reaction", "load")
COMPONENTS = ("Fx", "Fy", "Fz")
ROUNDING = 1e-8
"""What is this part of the largest of its kind is the rounding of zero."""


@dataclass(frozen=True)
class Forces:
    """Arrows of one kind."""

    kind: str
    """Of `KINDS`."""
    label: str
    at: list[Place]
    force: Vectors
    """(N, arrows, 3) [N], or [N m]; world axes."""
    is_torque: bool = False

    def start(self, postures: Postures) -> Vectors:
        """(N, arrows, 3) where they begin [m]."""
        return np.stack([postures.point(link, point) for link, point in self.at], axis=1)


def borne(force: Vectors, moment: Vectors) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which joints bear a force and a moment, by the largest of each: the rounding of zero is none."""
    largest = force.max(initial=0.0)
    return force > ROUNDING * largest, moment > max(ROUNDING * moment.max(initial=0.0), np.finfo(float).eps * largest)


def force_kinds(caller: str, forces: str | tuple[str, ...] | None, is_planar: bool) -> tuple[str, ...]:
    """What to draw, as the argument ``forces`` of ``caller`` asks for it."""
    if forces is None:
        return KINDS if is_planar else ("driving", "load")
    kinds = KINDS if forces == "all" else (forces,) if isinstance(forces, str) else tuple(forces)
    for kind in kinds:
        if kind not in KINDS:
            raise InputError(f"{caller}: forces: unknown {kind!r} (expected {', '.join(KINDS)}, all{' or none' if caller == 'view' else ''})")
    return kinds


def find_forces(run: xr.Dataset, postures: Postures, kinds: tuple[str, ...] = KINDS) -> list[Forces]:
    """The arrows of a run, as far as it has them."""
    scene = postures.scene
    joints = {joint["name"]: joint for joint in scene.description["joints"]}
    found = []
    if "reaction" in kinds and "reaction" in run:
        places = [_place_of(scene, joints[str(name)]) for name in run.joint.values]
        found.append(Forces("reaction", "joint force", places, _in_space(run.reaction, run)))
    if "load" in kinds and "time" in run.coords and scene.loads:
        found += _loads(run, scene)
    if "load" in kinds and "wrench" in run:
        number = {link["name"]: k for k, link in enumerate(scene.description["links"])}
        places = [_marker_place(scene, *_place(str(name), number)) for name in run.loaded_marker.values]
        found.append(Forces("load", "load", places, _in_space(run.wrench, run)))
    if "driving" in kinds and "driving_force" in run:
        found += _drives(run, postures, joints)
    return found


def _in_space(values: xr.DataArray, run: xr.Dataset) -> Vectors:
    """The forces among the components of a wrench, three of them in the plane too."""
    components = [name for name in COMPONENTS if name in run.component.values]
    force = values.sel(component=components).values
    return force if force.shape[-1] == 3 else np.concatenate([force, np.zeros((*force.shape[:-1], 1))], axis=-1)


def _end(joint: dict[str, Any], side: int) -> tuple[int, str]:
    return joint["links"][side], joint["markers"][side]


def _marker_place(scene: Scene, link: int, marker: str) -> Place:
    return link, tuple(next(entry["at"] for entry in scene.description["links"][link]["markers"] if entry["name"] == marker))


def _place_of(scene: Scene, joint: dict[str, Any]) -> Place:
    """Where a joint's force acts: at the second link's marker; of teeth where they meet."""
    if joint["type"] in ("gear", "rack"):
        return joint["carrier"], tuple(joint["pitch"])
    return _marker_place(scene, *_end(joint, 1))


def _place(name: str, number: dict[str, int]) -> tuple[int, str]:
    """Of "platform.tool"; names of links and markers may have dots."""
    parts = name.split(".")
    splits = ((".".join(parts[:i]), ".".join(parts[i:])) for i in range(1, len(parts)))
    return next((number[link], marker) for link, marker in splits if link in number)


def _loads(run: xr.Dataset, scene: Scene) -> list[Forces]:
    """Forces of the scene's loads."""
    values = scene.load_values(run.time.values, run.q, run.qd, in_order=True)[..., :3]
    loads = scene.description["loads"]
    follows = [k for k, load in enumerate(loads) if load["axes"] == "link" and load["link"] != 0]
    if follows:
        turn = poses_of(scene, run).rotation
        for k in follows:
            values[:, k] = np.einsum("nij,nj->ni", turn[:, loads[k]["link"] - 1], values[:, k])
    return [Forces("load", "load", [_marker_place(scene, load["link"], load["marker"]) for load in loads], values)]


def _drives(run: xr.Dataset, postures: Postures, joints: dict[str, dict[str, Any]]) -> list[Forces]:
    """Driving forces along their slides; driving torques about their axes."""
    groups: dict[bool, list[tuple[Place, Vectors]]] = {False: [], True: []}
    units = dict(zip(run.actuator.values, run.actuator_unit.values))
    for name in map(str, run.actuator.values):
        joint = found[0] if (found := variable_of(postures.scene, name)) else joints[name]
        link, marker = _end(joint, 0)
        axis = postures.axes[link][marker]
        is_torque = units[name] == "N m"
        if is_torque and postures.scene.planar:
            axis = np.broadcast_to([0.0, 0.0, 1.0], axis.shape)
        value = run.driving_force.sel(actuator=name).values[:, np.newaxis] * axis
        groups[is_torque].append((_marker_place(postures.scene, *_end(joint, 1)), value))
    return [
        Forces("driving", "driving torque" if is_torque else "driving force", [place for place, _ in group],
               np.stack([value for _, value in group], axis=1), is_torque)
        for is_torque, group in groups.items()
        if group
    ]
