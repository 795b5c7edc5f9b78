"""A drawing of any scene, and how wide the picture must be. What links look like is told by
`planar_shapes` and `spatial_shapes`."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FuncFormatter
from numpy.typing import ArrayLike, NDArray

from .._arguments import as_floats
from .._geometry.postures import ELEVATION, Postures, best_azimuth, find_postures
from ..errors import InputError
from ..scene import Scene
from .arguments import checked
from .lines import scale_axis, tick_text
from .planar_shapes import draw_planar
from .spatial_axes import SpatialAxes, add_spatial_axes, set_apart
from .spatial_shapes import draw_spatial
from .style import fitting

__all__ = ["draw", "draw_alone", "drawn_room", "mechanism", "new_axes", "set_limits"]

Points = NDArray[np.float64]

LARGEST = (7.5, 7.0)
"""Of a picture [inch]."""
LOWEST = 2.4
LEAST = 0.5, 0.3
"""Width and height of a planar drawing, at least, as parts of the larger of both."""
FAR = 50.0
"""Sizes from zero, from where on the numbers of an axis are those from a round place nearby."""
LARGE = 2.0
"""From so many metres on a drawing is numbered in metres, else in millimetres."""


@checked
def mechanism(scene: Scene, q: ArrayLike | None = None, names: bool = True, ax: Axes | None = None) -> tuple[Figure | SubFigure, Axes]:
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
        ``q`` is not a finite number for each coordinate; the mechanism cannot be assembled there.
    """
    n = len(scene.coordinates)
    position = scene.motion()[0][0] if q is None else as_floats("mechanism: q", q, (n,), f"({n},) for one pose ({', '.join(scene.coordinates)})")
    postures, assembled = find_postures(scene, scene.poses(np.atleast_2d(position), in_order=False))
    if not assembled[0]:
        why = _failure(scene, position)
        raise InputError(f"mechanism: it cannot be assembled in this position{': ' if why else ''}{why}")
    return draw_alone(postures, names, ax)


def draw_alone(postures: Postures, names: bool = True, ax: Axes | None = None) -> tuple[Figure | SubFigure, Axes]:
    """The picture of a single posture, which can be assembled."""
    scene = postures.scene
    if ax is None:
        ax = new_axes(pyplot.figure(layout="constrained" if scene.planar else "none"), postures)
    set_limits(ax, postures)
    if scene.title and not isinstance(ax, SpatialAxes):     # before names are put into the room that it leaves
        ax.set_title(fitting(scene.title, ax.get_figure(root=True)), fontsize="medium", parse_math=False)
    draw(ax, postures, 0, names)
    if isinstance(ax, SpatialAxes):
        ax.put_title(fitting(scene.title, ax.get_figure(root=True)), fontsize="medium", parse_math=False)
        ax.crop()
    return ax.figure, ax


def _failure(scene: Scene, position: Points) -> str:
    """Which links cannot be closed there, as inverse dynamics says it; nothing if it has no words for it."""
    try:
        told = scene.inverse(np.atleast_2d(position), in_order=True, want="joint_variable").attrs.get("failure", "")
        return str(told).removeprefix("sample 0: ")
    except InputError:      # it asks for more than a position
        return ""


def new_axes(figure: Figure, postures: Postures, largest: tuple[float, float] = LARGEST) -> Axes:
    """The only axes of a figure, for a picture that is not larger than so much [inch]."""
    if not postures.scene.planar:
        return add_spatial_axes(figure, largest)
    figure.set_size_inches(picture_size(postures, largest))
    return figure.add_subplot()


def draw(ax: Axes, postures: Postures, sample: int, names: bool) -> None:
    """The mechanism at one sample, in axes whose limits are set."""
    posture = postures.at(sample)
    if not postures.scene.planar:
        fields = {joint["name"]: postures.field(joint) for joint in _joints(postures.scene) if joint["type"] == "planar"}
        draw_spatial(ax, posture, fields, names)
        return
    slides = {joint["name"]: postures.travel(joint) for joint in _joints(postures.scene) if joint["type"] == "prismatic"}
    draw_planar(ax, posture, slides, names)


def _joints(scene: Scene) -> list[dict[str, Any]]:
    joints: list[dict[str, Any]] = scene.description["joints"]
    return joints


def _limits(postures: Postures) -> tuple[Points, Points]:
    points = postures.points.reshape(-1, 3)
    lowest, highest = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    extent = float((highest - lowest).max()) or 1.0     # all in one point: [m]
    room = np.full(3, (0.13 if postures.scene.planar else 0.05) * extent)
    if postures.scene.planar:       # names stand beside what is narrow
        room[:2] = np.maximum(room[:2], 0.5 * (np.array(LEAST) * (extent + 2 * room[0]) - (highest - lowest)[:2]))
    return lowest - room, highest + room


def _offset(low: float, high: float, size: float) -> float:
    """What is taken off the numbers of an axis far from zero, as round as they are small [m]."""
    middle = 0.5 * (low + high)
    step = 10.0 ** np.ceil(np.log10(size))
    return float(step * np.round(middle / step)) if abs(middle) > FAR * size else 0.0


def drawn_room(postures: Postures) -> Points:
    """(2,) width and height of what a planar drawing shows [m]."""
    lowest, highest = _limits(postures)
    room: Points = (highest - lowest)[:2]
    return room


def picture_size(postures: Postures, largest: tuple[float, float]) -> tuple[float, float]:
    """Size of a planar picture [inch] in which nothing is lost to empty margins: a flat mechanism has a flat picture."""
    lowest, highest = _limits(postures)
    width, height = (highest - lowest)[:2]
    surround = (0.8, 1.0)  # numbers and names of the axes, title
    scale = min((largest[0] - surround[0]) / width, (largest[1] - surround[1]) / height)
    return max(4.5, width * scale + surround[0]), max(LOWEST, height * scale + surround[1])


def set_limits(ax: Any, postures: Postures) -> None:
    """Limits that hold the mechanism at every sample."""
    lowest, highest = _limits(postures)
    names = "xy" if postures.scene.planar else "xyz"
    extent = (highest - lowest)[: len(names)]
    size = float(extent.max())
    for name, low, high, part in zip(names, lowest, highest, extent / size):
        getattr(ax, f"set_{name}lim")(low, high)
        # numbers of a short axis lie closer, and over each other, in space above all
        ticks = min(6, max(2, round(10 * part))) if postures.scene.planar else max(2, round(6 * part))
        away = _offset(low, high, size)
        factor, unit = scale_axis(ax, name, name, "m" if size < LARGE else "", size, ticks=ticks)
        if 6 * part < 1:
            getattr(ax, f"set_{name}ticks")([0.5 * (low + high)])
        if size >= LARGE:
            getattr(ax, f"set_{name}label")(f"{name} [m]")
        if away:
            getattr(ax, f"{name}axis").set_major_formatter(FuncFormatter(lambda value, _, away=away: tick_text((value - away) * factor, size * factor)))
            getattr(ax, f"set_{name}label")(f"{name} {'−' if away > 0 else '+'} {abs(away):.9g} m [{unit or 'm'}]")
    if postures.scene.planar:
        ax.set_aspect("equal")
    else:
        ax.set_box_aspect(highest - lowest, zoom=0.95)
        ax.view_init(elev=ELEVATION, azim=best_azimuth(postures.points[0]))
        if isinstance(ax, SpatialAxes):
            ax.fill()
        set_apart(ax)
