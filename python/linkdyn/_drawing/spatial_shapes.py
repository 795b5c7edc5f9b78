"""What a spatial mechanism looks like: rods, plates, sleeves of slides, a symbol for each kind of joint."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation, Text
from mpl_toolkits.mplot3d import Axes3D, proj3d
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

from .._geometry.cams import face, is_cam, roller, silhouettes
from .._geometry.springs import acts_along, ends_of, shape_of
from .._geometry.telescopes import SLIDING
from .._geometry.wheels import belt_runs, frame_of, is_geared, pitch_point, rack_run, rim, shaft, thread, wheels, worms
from .names import Room, list_of, sampled
from .planar_shapes import WIRE, around, distinct, jointed, lighter, link_colour, name_style, tell_left_out
from .spatial_axes import SpatialAxes, outline

if TYPE_CHECKING:
    from .._geometry.postures import Posture

__all__ = ["draw_spatial"]

Points = NDArray[np.float64]

SYMBOLS = {"revolute": "o", "prismatic": "s", "cylindrical": "D", "universal": "P", "spherical": ".", "fixed": "X", "planar": "p", "screw": "H"}
SYMBOL_SIZES = {".": 12.0}
FONT = 8.0
HALO = withStroke(linewidth=2.5, foreground=(1.0, 1.0, 1.0, 0.75))
"""Names can be read on lines."""
FAR_RINGS = (4.5, 6.5, 9.0)
"""Where a name is put when there is no room beside what it names, in units: a leader goes there."""
LEADER = {"arrowstyle": "-", "color": "0.4", "linewidth": 0.6, "shrinkA": 1.0, "shrinkB": 3.0}
LED = 1.8
"""From so far on, in units, a leader is drawn."""
UNIT = 0.018
"""What springs are made of, as a part of the largest extent."""


def draw_spatial(ax: Axes3D, posture: Posture, fields: dict[str, list[list[float]]], names: bool) -> None:
    """Draw a spatial mechanism in three-dimensional axes whose limits are set.

    Parameters
    ----------
    ax
        Such axes.
    posture
        Where its markers are.
    fields
        Travel of each planar joint along x and y of its first marker [m]: so large are the tables.
    names
        Write names of links and joints, and a legend.
    """
    joints = posture.scene.description["joints"]
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((0.97, 0.97, 0.97, 1.0))
        axis._axinfo["grid"].update(color="0.88", linewidth=0.6)
    for k, markers in enumerate(posture.markers):
        _draw_link(ax, markers, jointed(posture, k), link_colour(k))
    _draw_wheels(ax, posture)
    _draw_cams(ax, posture)
    _draw_springs(ax, posture)
    listed: set[str] = set()
    for joint in joints:
        if is_geared(joint) or is_cam(joint):
            continue
        if joint["name"] in fields:
            _draw_table(ax, posture, joint, fields[joint["name"]])
        _draw_joint(ax, joint, _ends(posture, joint), listed)
    if names:
        if isinstance(ax, SpatialAxes):
            ax.put_legend(ax.get_legend_handles_labels()[0], fontsize="small")
        else:
            ax.legend(loc="upper left", frameon=False, fontsize="small", title="joints", title_fontsize="small")
        _write_names(ax, posture)


def _ends(posture: Posture, joint: dict[str, Any]) -> Points:
    """(2, 3) points of a joint on its first and second link."""
    return np.array([posture.markers[link][name] for link, name in zip(joint["links"], joint["markers"])])


def _draw_link(ax: Axes3D, markers: dict[str, Points], held: set[str], colour: str) -> None:
    """A rod between two joints, a plate between more; thin lines to all other markers."""
    if not markers:
        return
    corners = distinct(np.array([markers[name] for name in held or markers]))
    style: dict[str, Any] = {"color": colour, "linewidth": 2.6, "solid_capstyle": "round", "solid_joinstyle": "round"}
    if len(corners) > 2:
        outline = corners[around(corners)]
        ax.add_collection3d(Poly3DCollection([outline], facecolor=(*lighter(colour, 0.5), 0.45), edgecolor="none"))
        ax.plot(*np.concatenate([outline, outline[:1]]).T, **style)
    else:
        ax.plot(*corners.T, **style)
    centre = corners.mean(axis=0)
    for name, point in markers.items():
        if name not in held and not np.isclose(corners, point).all(axis=1).any():
            ax.plot(*np.array([centre, point]).T, color=colour, linewidth=0.9, linestyle=":", marker=".", markersize=4)


def _draw_joint(ax: Axes3D, joint: dict[str, Any], ends: Points, listed: set[str]) -> None:
    colour = link_colour(joint["links"][1])
    place = ends[1]
    if joint["type"] in SLIDING:
        place = ends.mean(axis=0)
        ax.plot(*np.array([ends[0], place]).T, color=link_colour(joint["links"][0]), linewidth=6.0, solid_capstyle="butt")
        ax.plot(*ends.T, color=colour, linewidth=2.0)
    marker = SYMBOLS[joint["type"]]
    ax.plot(
        *place[:, np.newaxis],
        marker=marker,
        markersize=SYMBOL_SIZES.get(marker, 7.0),
        markerfacecolor="white",
        markeredgecolor=colour,
        linestyle="none",
        label=None if joint["type"] in listed else joint["type"],
        zorder=15,
    )
    listed.add(joint["type"])


def _draw_wheels(ax: Axes3D, posture: Posture) -> None:
    """Pitch circles with a spoke, worms, pitch lines of racks, belts."""
    for link, marker, radius in wheels(posture.scene.description):
        frame = frame_of(posture, link, marker)
        circle = rim(*frame, radius)
        ax.plot(*circle.T, color=link_colour(link), linewidth=1.6)
        ax.plot(*np.array([frame[0], circle[0]]).T, color=link_colour(link), linewidth=0.8)
    for worm in worms(posture.scene.description):
        ax.plot(*np.array(shaft(posture, worm)).T, color=link_colour(worm["links"][0]), linewidth=2.6, solid_capstyle="round")
        ax.plot(*thread(posture, worm).T, color=link_colour(worm["links"][0]), linewidth=1.6)
    for joint in posture.scene.description["joints"]:
        if joint["type"] == "belt":
            for run in belt_runs(posture, joint):
                ax.plot(*np.array(run).T, color="0.15", linewidth=1.4)
        if joint["type"] == "rack":
            ax.plot(*np.array(rack_run(posture, joint)).T, color=link_colour(joint["links"][1]), linewidth=1.4)


def _draw_cams(ax: Axes3D, posture: Posture) -> None:
    """Outlines of cams and the drums that they go round, rollers."""
    for joint in filter(is_cam, posture.scene.description["joints"]):
        first, second = (link_colour(link) for link in joint["links"])
        lines = silhouettes(posture, joint)
        for line in lines:
            ax.plot(*line.T, color=first, linewidth=1.6)
        faces = lines if not joint["groove"] and joint["side"] > 0 else []
        if joint["barrel"]:
            faces = [np.array([*edge[k : k + 2], *end[k : k + 2][::-1]]) for edge, end in zip(lines[::2], lines[1::2]) for k in range(len(edge) - 1)]
        ax.add_collection3d(Poly3DCollection(faces, facecolor=(*lighter(first, 0.5), 0.45), edgecolor="none"))
        if joint["radius"] > 0:
            ax.add_collection3d(Poly3DCollection([roller(posture, joint)], facecolor=lighter(second, 0.35), edgecolor=second, linewidth=1.3))
        if joint["follower"] == "flat":
            ax.add_collection3d(Poly3DCollection([face(posture, joint)], facecolor=(*lighter(second, 0.35), 0.7), edgecolor=second, linewidth=1.3))


def _draw_springs(ax: Axes3D, posture: Posture) -> None:
    """Coils round barrels and rods."""
    unit = _unit_of(ax)
    for spring in posture.scene.description["springs"]:
        shape = shape_of(posture, spring, unit)
        if shape is None:
            continue
        for lines, width, colour in ((shape.barrel, 3.6, lighter(WIRE, 0.6)), (shape.rod, 1.5, WIRE), (shape.coil, 1.2, WIRE)):
            for line in lines:
                ax.plot(*line.T, color=colour, linewidth=width, solid_capstyle="butt")


def _unit_of(ax: Axes3D) -> float:
    """A length that springs are made of [m]."""
    return float(UNIT * max(np.ptp(limits) for limits in (ax.get_xlim(), ax.get_ylim(), ax.get_zlim())))


def _draw_table(ax: Axes3D, posture: Posture, joint: dict[str, Any], field: list[list[float]]) -> None:
    """The plane that a planar joint slides on, as large as its travel and a little more."""
    link, name = joint["links"][0], joint["markers"][0]
    point, x = posture.markers[link][name], posture.x_axes[link][name]
    y = np.cross(posture.axes[link][name], x)
    room = 0.12 * max(np.ptp(limits) for limits in (ax.get_xlim(), ax.get_ylim(), ax.get_zlim()))
    (left, right), (near, far) = ((low - room, high + room) for low, high in field)
    corners = [point + a * x + b * y for a, b in ((left, near), (right, near), (right, far), (left, far))]
    colour = link_colour(link)
    ax.add_collection3d(Poly3DCollection([corners], facecolor=(*lighter(colour, 0.3), 0.35), edgecolor=colour, linewidth=0.8))


class _Name(Annotation):
    """A name beside a point in space, from which it keeps its distance however the axes are turned."""

    axes: Any
    arrow_patch: Any

    def __init__(self, text: str, point: Points, **style: Any) -> None:
        super().__init__(text, (0.0, 0.0), (0.0, 0.0), textcoords="offset points", ha="center", va="center", annotation_clip=False, arrowprops=LEADER, **style)
        self.point = point

    def draw(self, renderer: Any) -> None:
        """At the place where its point is seen."""
        self.xy = proj3d.proj_transform(*self.point, self.axes.get_proj())[:2]
        super().draw(renderer)


def _write_names(ax: Axes3D, posture: Posture) -> None:
    """Each name where it is farthest from lines and joints as they are seen, and on no other name."""
    figure = ax.get_figure(root=True)
    figure.draw_without_rendering()     # where things are is known only then
    unit = FONT * figure.dpi / 72
    seen = [np.asarray(line.get_xydata()) for line in (*ax.lines, *(axis.line for axis in (ax.xaxis, ax.yaxis, ax.zaxis)))]
    seen += [path.vertices for faces in ax.collections for path in faces.get_paths()]
    low, high = ax.transAxes.transform(outline(ax))
    room = Room(np.concatenate([sampled(ax.transData.transform(line), 0.3 * unit) for line in seen]), low, high, unit)
    for artist in (ax.get_legend(), *(text for axis in (ax.xaxis, ax.yaxis, ax.zaxis) for text in axis.get_ticklabels())):
        _take(room, artist)
    n_left = 0
    for text, point, colour, is_link in _labels(posture, _unit_of(ax)):
        name = _Name(text, point, fontsize=FONT, zorder=20, path_effects=[HALO], parse_math=False, **name_style(colour, is_link))
        ax.add_artist(name)
        half = 0.5 * np.array(Text.get_window_extent(name).size) + 0.1 * unit
        anchor = ax.transData.transform(proj3d.proj_transform(*point, ax.get_proj())[:2])
        centre = room.place(anchor, half, is_link, FAR_RINGS)
        if centre is None:
            name.remove()
            n_left += 1
            continue
        offset = centre - anchor
        name.set_position(tuple(offset * 72 / figure.dpi))
        name.arrow_patch.set_visible(np.linalg.norm(np.maximum(np.abs(offset) - half, 0.0)) > LED * unit)
    tell_left_out(ax, n_left)


def _take(room: Room, artist: Any) -> None:
    box = artist.get_window_extent()
    room.take(np.array([box.x0 + box.x1, box.y0 + box.y1]) / 2, np.array(box.size) / 2)


def _place_of(posture: Posture, joint: dict[str, Any]) -> Points:
    """Where a joint is to be seen."""
    if is_geared(joint):
        return pitch_point(posture, joint)
    ends = _ends(posture, joint)
    place: Points = ends[1] if is_cam(joint) else ends.mean(axis=0)
    return place


def _on_chain(posture: Posture, name: str, middle: Points) -> Points:
    """Where a chain's lines come nearest to its middle, which lies between them if the chain is bent."""
    description = posture.scene.description
    lines = [_ends(posture, joint) for joint in description["joints"] if joint["name"].startswith(f"{name}.") and joint["type"] in SLIDING]
    for k, link in enumerate(description["links"]):
        if link["name"].startswith(f"{name}."):
            corners = np.array([posture.markers[k][marker] for marker in sorted(jointed(posture, k))])
            lines += [corners[i : i + 2] for i in range(len(corners) - 1)]
    places = [start + np.clip((middle - start) @ (end - start) / ((end - start) @ (end - start) or 1.0), 0.0, 1.0) * (end - start) for start, end in lines]
    nearest: Points = min(places or [middle], key=lambda place: float(np.linalg.norm(place - middle)))
    return nearest


def _labels(posture: Posture, unit: float) -> list[tuple[str, Points, str, bool]]:
    """Names, where they belong, their colours and whether they are links'; of a chain the part before the dot, once."""
    description = posture.scene.description
    chains: dict[str, list[Points]] = {}
    for joint in description["joints"]:
        chains.setdefault(joint["name"].split(".")[0], []).append(_place_of(posture, joint))
    extent = np.ptp([point for points in chains.values() for point in points], axis=0).max()
    gathered: dict[tuple[float, ...], list[str]] = {}
    places: dict[tuple[float, ...], Points] = {}
    for name, points in chains.items():
        place = _on_chain(posture, name, np.mean(points, axis=0))
        key = tuple(np.round(place / (0.01 * extent or 1.0)))
        gathered.setdefault(key, []).append(name)
        places.setdefault(key, place)
    labels = [(list_of(names), places[key], "0.1", False) for key, names in gathered.items()]
    for k, (link, markers) in enumerate(zip(description["links"], posture.markers)):
        if "." not in link["name"] and markers and link["name"] not in chains:
            corners = distinct(np.array([markers[name] for name in jointed(posture, k) or markers]))
            labels.append((link["name"], corners.mean(axis=0), link_colour(k), True))
    springs = (spring for spring in description["springs"] if acts_along(spring) and shape_of(posture, spring, unit))
    labels += [(spring["name"], ends_of(posture, spring).mean(axis=0), WIRE, False) for spring in springs]
    return labels
