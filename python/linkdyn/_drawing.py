"""A drawing of any scene: where its markers are, and how wide the picture must be. What links look like is told by
`_planar_shapes` and `_spatial_shapes`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from ._drawing_arguments import checked
from ._planar_shapes import draw_planar
from ._spatial_shapes import draw_spatial
from .errors import InputError
from .scene import Poses, Scene

__all__ = ["Postures", "draw", "find_postures", "mechanism", "picture_size", "poses_of", "set_limits"]

Points = NDArray[np.float64]

LARGEST = (7.5, 7.0)
"""Of a picture [inch]."""
LOWEST = 2.4
ELEVATION = 25.0
"""Of the eye over a spatial mechanism [deg]."""


@dataclass(frozen=True)
class Postures:
    """Where everything is at N samples, world axes."""

    scene: Scene
    markers: list[dict[str, Points]]
    """Of the frame and of every link: marker to (N, 3) [m]."""
    axes: list[dict[str, Points]]
    """Likewise: the markers' axes."""

    def at(self, sample: int) -> Posture:
        return Posture(
            self.scene,
            [{name: points[sample] for name, points in link.items()} for link in self.markers],
            [{name: axis[sample] for name, axis in link.items()} for link in self.axes],
        )

    @property
    def points(self) -> Points:
        """(N, markers, 3)."""
        return np.stack([points for link in self.markers for points in link.values()], axis=1)

    def travel(self, joint: dict[str, Any]) -> tuple[float, float]:
        """Lowest and highest slide of a joint whose markers lie on a line."""
        (first, second), (a, b) = joint["links"], joint["markers"]
        slide = np.einsum("nk,nk->n", self.markers[second][b] - self.markers[first][a], self.axes[first][a])
        return float(slide.min()), float(slide.max())


@dataclass(frozen=True)
class Posture:
    """Where everything is at one sample: as `Postures`, without N."""

    scene: Scene
    markers: list[dict[str, Points]]
    axes: list[dict[str, Points]]


def poses_of(scene: Scene, run: xr.Dataset) -> Poses:
    """Poses along a run: where other joint variables stood in for its coordinates, these do not tell the assembly."""
    if "stand_in" in run and np.any(run.stand_in != 0):
        if "joint_variable" not in run:
            raise InputError("the run passed dead points of its coordinates (expected joint variables among the results)")
        return scene.poses(joint_variable=run.joint_variable.values)
    return scene.poses(np.nan_to_num(run.q.values), in_order=True)


def find_postures(scene: Scene, poses: Poses) -> tuple[Postures, NDArray[np.bool_]]:
    """Markers and axes in world axes at every sample; and which samples can be assembled."""
    n = len(poses.status)
    markers: list[dict[str, Points]] = []
    axes: list[dict[str, Points]] = []
    for k, link in enumerate(scene.description["links"]):
        origin = np.zeros((n, 3)) if k == 0 else poses.position[:, k - 1]
        turn = np.broadcast_to(np.eye(3), (n, 3, 3)) if k == 0 else poses.rotation[:, k - 1]
        markers.append({marker["name"]: origin + turn @ np.array(marker["at"]) for marker in link["markers"]})
        axes.append({marker["name"]: turn @ np.array(marker["axis"]) for marker in link["markers"]})
    return Postures(scene, markers, axes), poses.status == 0


@checked
def mechanism(scene: Scene, q: ArrayLike | None = None, names: bool = True, ax: Axes | None = None) -> tuple[Figure, Axes]:
    """Draw a scene in one position; planar scenes in the plane.

    Parameters
    ----------
    scene
        The mechanism.
    q
        (n,) coordinates [m, rad]; default: where the scene's motion begins.
    names
        Write names of links and joints; those of a chain ("leg1.U", "leg1.P", ...) as one ("leg1").
    ax
        Axes to draw in (three-dimensional for a spatial scene); default: a new figure.

    Returns
    -------
    figure, axes

    Raises
    ------
    InputError
        The mechanism cannot be assembled at ``q``.
    """
    position = scene.motion()[0][0] if q is None else np.asarray(q)
    postures, assembled = find_postures(scene, scene.poses(np.atleast_2d(position), in_order=False))
    if not assembled[0]:
        raise InputError("mechanism: it cannot be assembled in this position")
    if ax is None:
        figure = pyplot.figure(figsize=picture_size(postures), layout="constrained")
        ax = figure.add_subplot(projection=None if scene.planar else "3d")
    set_limits(ax, postures)
    draw(ax, postures, 0, names)
    if scene.title:
        ax.set_title(scene.title, fontsize="medium")
    return ax.figure, ax


def draw(ax: Axes, postures: Postures, sample: int, names: bool) -> None:
    """The mechanism at one sample, in axes whose limits are set."""
    posture = postures.at(sample)
    if not postures.scene.planar:
        draw_spatial(ax, posture, names)
        return
    slides = {joint["name"]: postures.travel(joint) for joint in _joints(postures.scene) if joint["type"] == "prismatic"}
    draw_planar(ax, posture, slides, names)


def _joints(scene: Scene) -> list[dict[str, Any]]:
    return scene.description["joints"]


def _limits(postures: Postures) -> tuple[Points, Points]:
    points = postures.points.reshape(-1, 3)
    lowest, highest = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    extent = max(float((highest - lowest).max()), np.finfo(float).tiny)
    room = (0.13 if postures.scene.planar else 0.05) * extent
    return lowest - room, highest + room


def picture_size(postures: Postures, largest: tuple[float, float] = LARGEST) -> tuple[float, float]:
    """Size of a picture [inch] in which nothing is lost to empty margins: a flat mechanism has a flat picture."""
    if not postures.scene.planar:
        return largest
    lowest, highest = _limits(postures)
    width, height = (highest - lowest)[:2]
    surround = (0.8, 1.0)  # numbers and names of the axes, title
    scale = min((largest[0] - surround[0]) / width, (largest[1] - surround[1]) / height)
    return max(4.5, width * scale + surround[0]), max(LOWEST, height * scale + surround[1])


def set_limits(ax: Axes, postures: Postures) -> None:
    """Limits that hold the mechanism at every sample."""
    lowest, highest = _limits(postures)
    for name, low, high in zip("xy" if postures.scene.planar else "xyz", lowest, highest):
        getattr(ax, f"set_{name}lim")(low, high)
        getattr(ax, f"set_{name}label")(f"{name} [m]")
    if postures.scene.planar:
        ax.set_aspect("equal")
    else:
        ax.set_box_aspect(highest - lowest, zoom=0.95)
        ax.view_init(elev=ELEVATION, azim=_best_azimuth(postures.points[0]))


def _best_azimuth(points: Points) -> float:
    """The usual view from the side; another one if the mechanism would be seen edge on."""
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
