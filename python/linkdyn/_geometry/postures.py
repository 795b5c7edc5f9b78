"""Where a mechanism's markers are along a run, in world axes: what every picture of it begins with."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .._cycle.averages import good_samples
from ..errors import InputError, SceneError
from ..results import FOLDER
from ..scene import Poses, Scene
from .cams import room_for_cams
from .wheels import rims

__all__ = ["ELEVATION", "Posture", "Postures", "best_azimuth", "find_postures", "placed_poses", "poses_of", "scene_of", "seen_markers"]

Points = NDArray[np.float64]

ELEVATION = 25.0
"""Of the eye over a spatial mechanism [deg]."""
CENTRE = "centre of mass"
"""Stands for one among the markers; names of markers have no blanks."""
APART = 1e-5
"""Poses further from each other are two assemblies: as a part of the mechanism's reach, and of a turn [rad]."""


@dataclass(frozen=True)
class Postures:
    """Where everything is at N samples, world axes."""

    scene: Scene
    markers: list[dict[str, Points]]
    """Of the frame and of every link: marker to (N, 3) [m]."""
    axes: list[dict[str, Points]]
    """Likewise: the markers' axes."""
    x_axes: list[dict[str, Points]]
    """And their x."""
    origins: list[Points]
    """(N, 3) of the frame and of every link [m]."""
    turns: list[Points]
    """(N, 3, 3) from link to world axes."""

    def point(self, link: int, at: Any) -> Points:
        """(N, 3) of a point of a link, given in its axes."""
        place: Points = self.origins[link] + self.turns[link] @ np.asarray(at, dtype=float)
        return place

    def at(self, sample: int) -> Posture:
        return Posture(
            self.scene,
            [{name: points[sample] for name, points in link.items()} for link in self.markers],
            *([{name: axis[sample] for name, axis in link.items()} for link in axes] for axes in (self.axes, self.x_axes)),
        )

    @property
    def points(self) -> Points:
        """(N, points, 3) of all markers, round all wheels and cams."""
        markers = np.stack([points for link in self.markers for points in link.values()], axis=1)
        return np.concatenate([markers, *rims(self), *room_for_cams(self)], axis=1)

    def travel(self, joint: dict[str, Any], held: NDArray[np.intp] | slice = slice(None)) -> tuple[float, float]:
        """Lowest and highest slide of a joint whose markers lie on a line, at some samples."""
        slide = self._offsets(joint, self.axes)[held]
        return float(slide.min()), float(slide.max())

    def field(self, joint: dict[str, Any], held: NDArray[np.intp] | slice = slice(None)) -> list[list[float]]:
        """The same of a planar joint: along x and along y of its first marker."""
        (link, _), (name, _) = joint["links"], joint["markers"]
        y_axes: list[dict[str, Points]] = [{} for _ in self.axes]
        y_axes[link] = {name: np.cross(self.axes[link][name], self.x_axes[link][name])}
        ways = [self._offsets(joint, axes)[held] for axes in (self.x_axes, y_axes)]
        return [[float(way.min()), float(way.max())] for way in ways]

    def _offsets(self, joint: dict[str, Any], axes: list[dict[str, Points]]) -> Points:
        """(N,) from a joint's first marker to its second, along an axis of the first."""
        (first, second), (a, b) = joint["links"], joint["markers"]
        offsets: Points = np.einsum("nk,nk->n", self.markers[second][b] - self.markers[first][a], axes[first][a])
        return offsets


@dataclass(frozen=True)
class Posture:
    """Where everything is at one sample: as `Postures`, without N."""

    scene: Scene
    markers: list[dict[str, Points]]
    axes: list[dict[str, Points]]
    x_axes: list[dict[str, Points]]


def poses_of(scene: Scene, run: xr.Dataset) -> Poses:
    """Poses along a run.

    Coordinates tell them up to the assembly, which is followed from sample to sample, straight; samples of a batch are each on their own, as where they
    were computed. Where the run has joint variables these tell the assembly: a forward run takes curved ways between its samples, may pass dead points of its
    coordinates, and a part of a run does not begin where the scene does.
    """
    passed = "stand_in" in run and np.any(run.stand_in != 0)
    if "joint_variable" not in run:
        if passed:
            raise InputError("the run passed dead points of its coordinates (expected joint variables among the results)")
        return _led_poses(scene, run)
    told = scene.poses(joint_variable=run.joint_variable)
    return told if passed else _as_told(_led_poses(scene, run), told)


def placed_poses(scene: Scene, run: xr.Dataset, caller: str) -> Poses:
    """The same, where every sample that did not fail must have its place."""
    poses = poses_of(scene, run)
    if n := int((good_samples(run) & (poses.status != 0)).sum()):
        raise InputError(f"{caller}: the coordinates alone do not tell where the links are at {n} sample{'s' if n > 1 else ''} "
                         "(expected joint variables among the results)")
    return poses


def _led_poses(scene: Scene, run: xr.Dataset) -> Poses:
    return scene.poses(run.q.fillna(0), in_order="time" in run.coords or "assembly" in run)


def _as_told(led: Poses, told: Poses) -> Poses:
    """Poses by the coordinates, which have the most digits; where these have led to another assembly, or to none, as the joint variables tell."""
    sure = told.status == 0
    reach = np.abs(told.position[sure]).max(initial=0.0)
    strays = np.abs(led.position - told.position).max(axis=(1, 2), initial=0.0) > APART * reach
    strays |= np.abs(led.rotation - told.rotation).max(axis=(1, 2, 3), initial=0.0) > APART
    taken = sure & (strays | (led.status != 0))
    if not taken.any():
        return led
    return Poses(*(np.where(taken.reshape(-1, *[1] * (ours.ndim - 1)), theirs, ours) for ours, theirs in (
        (led.position, told.position), (led.rotation, told.rotation), (led.status, told.status))))


def find_postures(scene: Scene, poses: Poses) -> tuple[Postures, NDArray[np.bool_]]:
    """Markers and axes in world axes at every sample; and which samples can be assembled."""
    n = len(poses.status)
    markers: list[dict[str, Points]] = []
    axes: list[dict[str, Points]] = []
    x_axes: list[dict[str, Points]] = []
    origins, turns = [], []
    for k, link in enumerate(scene.description["links"]):
        origin = np.zeros((n, 3)) if k == 0 else poses.position[:, k - 1]
        turn = np.broadcast_to(np.eye(3), (n, 3, 3)) if k == 0 else poses.rotation[:, k - 1]
        origins.append(origin)
        turns.append(turn)
        markers.append({marker["name"]: origin + turn @ np.array(marker["at"]) for marker in seen_markers(scene, k)})
        axes.append({marker["name"]: turn @ np.array(marker["axis"]) for marker in link["markers"]})
        x_axes.append({marker["name"]: turn @ np.array(marker["x"]) for marker in link["markers"]})
    return Postures(scene, markers, axes, x_axes, origins, turns), poses.status == 0


def seen_markers(scene: Scene, k: int) -> list[dict[str, Any]]:
    """Markers between which link k is drawn: a pendulum that has only its pivot is drawn to its centre of mass."""
    link = scene.description["links"][k]
    markers: list[dict[str, Any]] = link["markers"]
    held = sum(k in joint["links"] for joint in scene.description["joints"])
    if k == 0 or held != 1 or not link["mass"] or any(marker["at"] != link["markers"][0]["at"] for marker in markers) or link["cog"] == markers[0]["at"]:
        return markers
    return [*markers, markers[0] | {"name": CENTRE, "at": link["cog"]}]


def scene_of(run: xr.Dataset, caller: str) -> Scene:
    """The scene in a run's attributes, its tables where they were, or beside the file of results; ``caller`` is named in messages."""
    if "scene" not in run.attrs:
        raise InputError(f"{caller}: the run has no attribute 'scene' (expected scene=)")
    beside = os.path.dirname(run.encoding["source"]) if "source" in run.encoding else None
    try:
        return Scene(run.attrs["scene"], folder=run.encoding.get(FOLDER, beside))
    except SceneError as error:
        raise InputError(f"{caller}: the scene in the run's attributes cannot be read, give scene= ({error})") from error


def best_azimuth(points: Points) -> float:
    """The usual view from the side [deg]; another one if the mechanism would be seen edge on."""
    elevation = np.radians(ELEVATION)
    offsets = points - points.mean(axis=0)
    spread = {}
    for azimuth in (-60.0, -30.0, -90.0, 0.0, -120.0):
        c, s = np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))
        right = np.array([-s, c, 0.0])
        up = np.array([-c * np.sin(elevation), -s * np.sin(elevation), np.cos(elevation)])
        spread[azimuth] = np.linalg.svd(offsets @ np.array([right, up]).T, compute_uv=False)[1]
    widest = max(spread.values())
    return next(azimuth for azimuth, width in spread.items() if width >= 0.6 * widest)
