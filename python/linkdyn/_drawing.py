"""A drawing of any scene: links between their markers, joints as symbols, names."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from ._style import COLOURS, FRAME_COLOUR
from .errors import InputError
from .scene import Scene

__all__ = ["scene3d"]

SYMBOLS = {"revolute": "o", "prismatic": "s", "cylindrical": "D", "universal": "P", "spherical": "."}
SYMBOL_SIZES = {".": 12.0}
SLIDING = ("prismatic", "cylindrical")
"""Joints whose two markers lie apart: what lies between them is drawn as rod and sleeve."""

Points = NDArray[np.float64]


def scene3d(scene: Scene, q: ArrayLike | None = None, names: bool = True, ax: Axes | None = None) -> tuple[Figure, Axes]:
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
    pose = scene.poses(position)
    if pose.status[0] != 0:
        raise InputError("scene3d: the mechanism cannot be assembled in this position")
    if ax is None:
        figure = pyplot.figure(figsize=(7.5, 7.0), layout="constrained")
        ax = figure.add_subplot(projection=None if scene.planar else "3d")
    markers = _world_markers(scene, pose.position[0], pose.rotation[0])
    joints = _joint_points(scene, markers)
    canvas = _Canvas(ax, 2 if scene.planar else 3)
    for k, points in enumerate(markers):
        _draw_link(canvas, points, _jointed(scene, k), _link_colour(k))
    for joint, ends in zip(scene.description["joints"], joints):
        _draw_joint(canvas, joint, ends)
    if names:
        for text, point in _labels(scene, markers, joints).items():
            canvas.write(point, text)
    canvas.finish(np.concatenate([np.array(list(points.values())).reshape(-1, 3) for points in markers]), scene.title)
    return ax.figure, ax


class _Canvas:
    """Axes of two or three dimensions under one set of calls."""

    def __init__(self, ax: Axes, dimensions: int) -> None:
        self.ax = ax
        self.dimensions = dimensions
        self.listed: set[str] = set()

    def line(self, points: Points, **style: Any) -> None:
        self.ax.plot(*points.T[: self.dimensions], **style)

    def symbol(self, point: Points, kind: str, colour: str) -> None:
        marker = SYMBOLS[kind]
        self.line(
            point[np.newaxis],
            marker=marker,
            markersize=SYMBOL_SIZES.get(marker, 7.0),
            markerfacecolor="white",
            markeredgecolor=colour,
            linestyle="none",
            label=None if kind in self.listed else kind,
            zorder=5,
        )
        self.listed.add(kind)

    def write(self, point: Points, text: str) -> None:
        self.ax.text(*point[: self.dimensions], f" {text}", fontsize=8, color="0.15", zorder=6)

    def finish(self, points: Points, title: str) -> None:
        self.ax.set_aspect("equal")
        lowest, highest = points.min(axis=0), points.max(axis=0)
        room = 0.05 * max((highest - lowest).max(), np.finfo(float).tiny)
        for name, low, high in zip("xyz"[: self.dimensions], lowest, highest):
            getattr(self.ax, f"set_{name}lim")(low - room, high + room)
            getattr(self.ax, f"set_{name}label")(f"{name} [m]")
        self.ax.set_aspect("equal")
        if title:
            self.ax.set_title(title, fontsize="medium")
        if self.listed:
            self.ax.legend(loc="upper left", frameon=False, fontsize="small", title="joints", title_fontsize="small")


def _world_markers(scene: Scene, position: Points, rotation: Points) -> list[dict[str, Points]]:
    """Markers of the frame and of every link in world axes, by name."""
    placed = []
    for k, link in enumerate(scene.description["links"]):
        origin, axes = (np.zeros(3), np.eye(3)) if k == 0 else (position[k - 1], rotation[k - 1])
        placed.append({marker["name"]: origin + axes @ np.array(marker["at"]) for marker in link["markers"]})
    return placed


def _joint_points(scene: Scene, markers: list[dict[str, Points]]) -> list[Points]:
    """(2, 3) points of each joint on its first and second link."""
    return [
        np.array([markers[link][name] for link, name in zip(joint["links"], joint["markers"])])
        for joint in scene.description["joints"]
    ]


def _jointed(scene: Scene, link: int) -> set[str]:
    """Markers of a link that hold a joint."""
    return {
        name
        for joint in scene.description["joints"]
        for owner, name in zip(joint["links"], joint["markers"])
        if owner == link
    }


def _link_colour(k: int) -> str:
    return FRAME_COLOUR if k == 0 else COLOURS[(k - 1) % (len(COLOURS) - 1)]


def _draw_link(canvas: _Canvas, markers: dict[str, Points], jointed: set[str], colour: str) -> None:
    """A line or a closed outline through the joints; thin lines to all other markers."""
    if not markers:
        return
    corners = _distinct(np.array([markers[name] for name in jointed or markers]))
    style = {"color": colour, "linewidth": 2.2, "solid_capstyle": "round"}
    if len(corners) > 2:
        outline = corners[_around(corners)]
        canvas.line(np.concatenate([outline, outline[:1]]), **style)
    else:
        canvas.line(corners, **style)
    centre = corners.mean(axis=0)
    for name, point in markers.items():
        if name not in jointed and not np.isclose(corners, point).all(axis=1).any():
            canvas.line(np.array([centre, point]), color=colour, linewidth=0.9, linestyle=":", marker=".", markersize=4)


def _distinct(points: Points) -> Points:
    size = max(np.ptp(points, axis=0).max(), 1.0)
    _, first = np.unique(np.round(points / (1e-9 * size)), axis=0, return_index=True)
    return points[np.sort(first)]


def _around(points: Points) -> NDArray[np.intp]:
    """Order of the points around their centre, in the plane that fits them best."""
    offsets = points - points.mean(axis=0)
    plane = np.linalg.svd(offsets, full_matrices=False)[2][:2]
    first, second = plane @ offsets.T
    return np.argsort(np.arctan2(second, first))


def _draw_joint(canvas: _Canvas, joint: dict[str, Any], ends: Points) -> None:
    colour = _link_colour(joint["links"][1])
    if joint["type"] in SLIDING:
        middle = ends.mean(axis=0)
        canvas.line(np.array([ends[0], middle]), color=_link_colour(joint["links"][0]), linewidth=4.0, alpha=0.9)
        canvas.line(ends, color=colour, linewidth=1.6)
        canvas.symbol(middle, joint["type"], colour)
    else:
        canvas.symbol(ends[1], joint["type"], colour)


def _labels(scene: Scene, markers: list[dict[str, Points]], joints: list[Points]) -> dict[str, Points]:
    """Names and where to write them; of a chain the part before the dot, once."""
    gathered: dict[str, list[Points]] = {}
    for joint, ends in zip(scene.description["joints"], joints):
        gathered.setdefault(joint["name"].split(".")[0], []).append(ends.mean(axis=0))
    for link, points in zip(scene.description["links"], markers):
        if "." not in link["name"] and points:
            gathered.setdefault(link["name"], []).append(np.mean(list(points.values()), axis=0))
    return {text: np.mean(points, axis=0) for text, points in gathered.items()}
