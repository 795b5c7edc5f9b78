"""What a planar mechanism looks like: bars and plates, pivots on hatched ground, sliders as blocks, names where there is room."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from .._geometry.cams import face, is_cam, roller, silhouettes
from .._geometry.springs import acts_along, ends_of, shape_of
from .._geometry.telescopes import is_telescope
from .._geometry.wheels import belt_runs, frame_of, is_geared, pitch_point, rim, wheels
from .names import Room, list_of, parts_of_slots, sampled
from .style import COLOURS, FRAME_COLOUR

if TYPE_CHECKING:
    from .._geometry.postures import Posture

__all__ = ["WIRE", "around", "distinct", "draw_planar", "jointed", "lighter", "link_colour", "name_style", "tell_left_out", "unit_of"]

Points = NDArray[np.float64]

BAR, EDGE = 5.0, 1.3
"""Width of a bar and of its dark edge [points]."""
FONT = 8.0
STRAIGHT = 1e-6
"""How far points may be from a line, as a part of its length, to lie on it."""
PLATE: dict[str, Any] = {"boxstyle": "square,pad=0.05", "facecolor": (1.0, 1.0, 1.0, 0.6), "edgecolor": "none"}
"""Names can be read where they have to stand on lines."""
WIRE = "#3a424b"
"""Colour of springs and dampers."""
SOLID = "solid"
"""Mark of the patches on which no name may stand."""


def draw_planar(ax: Axes, posture: Posture, slides: dict[str, tuple[float, float]], names: bool) -> None:
    """Draw a planar mechanism.

    Parameters
    ----------
    ax
        With limits that hold it.
    posture
        Where its markers are.
    slides
        Travel of each prismatic joint [m]: so long are the rails.
    names
        Write names of links and joints.
    """
    unit = unit_of(ax)
    joints = [joint for joint in posture.scene.description["joints"] if not is_geared(joint)]
    cylinders = _cylinders(posture, slides)
    for joint in joints:
        if 0 in joint["links"]:
            _draw_ground(ax, posture, joint, slides, unit)
    hidden = {link for cylinder in cylinders for link in cylinder.joint["links"]}
    for k, markers in enumerate(posture.markers[1:], start=1):
        if k not in hidden:
            _draw_link(ax, markers, jointed(posture, k), link_colour(k))
    for cylinder in cylinders:
        _draw_cylinder(ax, cylinder, unit)
    _draw_wheels(ax, posture)
    _draw_cams(ax, posture)
    _draw_springs(ax, posture, unit)
    told = [cylinder.joint["name"] for cylinder in cylinders]
    for joint in joints:
        if joint["type"] == "prismatic" and joint["name"] not in told:
            _draw_slider(ax, posture, joint, unit)
    pins = [_ends(posture, joint)[1] for joint in joints if joint["type"] == "revolute"]
    if pins:
        ax.plot(*np.array(pins).T, "o", markersize=6.5, markerfacecolor="white", markeredgecolor="0.1", zorder=6)
    welds = [_ends(posture, joint)[1] for joint in joints if joint["type"] == "fixed"]
    if welds:
        ax.plot(*np.array(welds).T, "s", markersize=6.0, markerfacecolor="0.1", markeredgecolor="0.1", zorder=6)
    if names:
        _write_names(ax, posture, unit, cylinders)


@dataclass(frozen=True)
class _Cylinder:
    """A driven slide between two links that hold one hinge more each, and nothing beside its line."""

    joint: dict[str, Any]
    foot: Points
    """The barrel's hinge."""
    head: Points
    """The rod's hinge."""
    barrel: float
    """Part of the way from foot to head."""

    @property
    def name(self) -> str:
        """Of its slide; of a chain's that of the chain."""
        owner, _, last = self.joint["name"].rpartition(".")
        return owner or str(last)


def _cylinders(posture: Posture, slides: dict[str, tuple[float, float]]) -> list[_Cylinder]:
    description = posture.scene.description
    found = []
    for joint in description["joints"]:
        others = [[other for other in description["joints"] if link in other["links"] and other is not joint] for link in joint["links"]]
        if not is_telescope(description, joint) or any(len(held) != 1 or held[0]["type"] != "revolute" for held in others):
            continue
        hinges = [_marker_on(posture, held[0], link) for link, held in zip(joint["links"], others)]
        along = hinges[1] - hinges[0]
        length = float(np.linalg.norm(along))
        axis = posture.axes[joint["links"][0]][joint["markers"][0]][:2]
        if length == 0.0 or not _are_slim(posture, joint["links"], hinges[0], axis, STRAIGHT * length):
            continue
        first, second = _ends(posture, joint)
        shortest = length - (float((second - first) @ axis) - slides[joint["name"]][0]) * np.sign(along @ axis)
        found.append(_Cylinder(joint, hinges[0], hinges[1], min(0.62, 0.9 * shortest / length)))
    return found


def _are_slim(posture: Posture, links: list[int], on: Points, axis: Points, off: float) -> bool:
    """Have the links all of their markers on a line? Else a cylinder would hide what is beside it."""
    offsets = np.array([point[:2] for link in links for point in posture.markers[link].values()]) - on
    return bool(np.abs(offsets[:, 0] * axis[1] - offsets[:, 1] * axis[0]).max() <= off)


def _marker_on(posture: Posture, joint: dict[str, Any], link: int) -> Points:
    point: Points = _ends(posture, joint)[joint["links"].index(link)]
    return point


def _draw_cylinder(ax: Axes, cylinder: _Cylinder, unit: float) -> None:
    """A barrel with a rod in it."""
    along = cylinder.head - cylinder.foot
    end = cylinder.foot + cylinder.barrel * along
    across = unit * 0.62 * np.array([-along[1], along[0]]) / np.linalg.norm(along)
    first, second = (link_colour(link) for link in cylinder.joint["links"])
    ax.plot(*np.array([end, cylinder.head]).T, color="0.1", linewidth=3.6, solid_capstyle="butt", zorder=3.6)
    ax.plot(*np.array([end, cylinder.head]).T, color=lighter(second, 0.6), linewidth=2.0, solid_capstyle="butt", zorder=3.7)
    corners = [cylinder.foot + across, end + across, end - across, cylinder.foot - across]
    ax.add_patch(Polygon(corners, facecolor=lighter(first, 0.6), edgecolor="0.1", linewidth=1.0, joinstyle="round", zorder=3.8, gid=SOLID))
    ax.plot(*np.array([cylinder.foot, end]).T, color=lighter(first, 0.35), linewidth=0.8, zorder=3.9)


def _draw_wheels(ax: Axes, posture: Posture) -> None:
    """Pitch circles with a spoke that turns along, pitch lines of racks, belts."""
    dash: dict[str, Any] = {"linestyle": (0, (9, 2, 1.5, 2)), "linewidth": 1.1}
    for link, marker, radius in sorted(wheels(posture.scene.description), key=lambda wheel: -wheel[2]):     # the smaller in front
        circle = rim(*frame_of(posture, link, marker), radius)[:, :2]
        colour = link_colour(link)
        if link != 0:
            ax.add_patch(Polygon(circle, facecolor=lighter(colour, 0.10), edgecolor="none", zorder=1.2))
            centre = posture.markers[link][marker][:2]
            ax.plot(*np.array([centre, circle[0]]).T, color=lighter(colour, 0.6), linewidth=1.0, zorder=1.3)
        ax.plot(*circle.T, color=tuple(0.8 * c for c in to_rgb(colour)), zorder=3.1, **dash)
    for joint in posture.scene.description["joints"]:
        if joint["type"] == "belt":
            for run in belt_runs(posture, joint):
                ax.plot(*np.array(run)[:, :2].T, color="0.15", linewidth=1.6, zorder=2.6)
        if joint["type"] == "rack":
            link, marker = joint["links"][1], joint["markers"][1]
            along = posture.axes[link][marker][:2]
            ends = np.array([posture.markers[link][marker][:2], pitch_point(posture, joint)[:2]])
            places = np.sort((ends - ends[0]) @ along) + joint["radii"][0] * np.array([-1.0, 1.0])
            ax.plot(*(ends[0] + places[:, np.newaxis] * along).T, color=link_colour(link), zorder=2.4, **dash)


def _draw_cams(ax: Axes, posture: Posture) -> None:
    """Outlines of cams, rollers with a spoke that turns with the follower, flat faces."""
    for joint in posture.scene.description["joints"]:
        if not is_cam(joint):
            continue
        first, second = (link_colour(link) for link in joint["links"])
        for line in silhouettes(posture, joint):
            if not joint["groove"] and joint["side"] > 0:
                ax.add_patch(Polygon(line[:, :2], facecolor=lighter(first, 0.18), edgecolor="none", zorder=1.2))
            ax.plot(*line[:, :2].T, color=tuple(0.8 * c for c in to_rgb(first)), linewidth=1.8, zorder=2.4)
        point = posture.markers[joint["links"][1]][joint["markers"][1]][:2]
        if joint["radius"] > 0:
            circle = roller(posture, joint)[:, :2]
            ax.add_patch(Polygon(circle, facecolor=lighter(second, 0.35), edgecolor=second, linewidth=1.3, zorder=3.2))
            ax.plot(*point, "o", markersize=5.0, markerfacecolor="white", markeredgecolor="0.1", zorder=6)
        if joint["follower"] == "flat":
            ax.plot(*face(posture, joint)[:, :2].T, color=second, linewidth=3.0, solid_capstyle="butt", zorder=3.2)


def _draw_springs(ax: Axes, posture: Posture, unit: float) -> None:
    """Zigzags of wire over barrels and rods, between pins."""
    wire: dict[str, Any] = {"solid_joinstyle": "round", "solid_capstyle": "round"}
    for spring in posture.scene.description["springs"]:
        shape = shape_of(posture, spring, unit)
        if shape is None:
            continue
        for line in shape.barrel:
            ax.plot(*line[:, :2].T, color=WIRE, linewidth=5.0, solid_capstyle="butt", zorder=4.6)
            ax.plot(*line[:, :2].T, color=lighter(WIRE, 0.3), linewidth=3.0, solid_capstyle="butt", zorder=4.61)
        for line in shape.rod:
            ax.plot(*line[:, :2].T, color=WIRE, linewidth=1.6, zorder=4.6)
        for line in shape.coil:
            ax.plot(*line[:, :2].T, color="white", linewidth=2.6, zorder=4.7, **wire)
            ax.plot(*line[:, :2].T, color=WIRE, linewidth=1.3, zorder=4.8, **wire)
        if acts_along(spring):
            ends = ends_of(posture, spring)[:, :2]
            ax.plot(*ends.T, "o", color=WIRE, markersize=3.5, zorder=5)
            _hold_spring(ax, posture, spring, ends, unit)


def _hold_spring(ax: Axes, posture: Posture, spring: dict[str, Any], ends: Points, unit: float) -> None:
    """Ground at the frame's end, if no joint stands there."""
    if 0 not in spring["links"]:
        return
    side = spring["links"].index(0)
    if spring["markers"][side] in jointed(posture, 0):
        return
    away = ends[side] - ends[1 - side]
    away /= np.linalg.norm(away)
    along = unit * 1.4 * np.array([-away[1], away[0]])
    _hatch(ax, ends[side] - along, ends[side] + along, away, unit)


def unit_of(ax: Axes) -> float:
    """A length that small symbols are made of, in the units of the axes."""
    return float(0.018 * max(np.ptp(ax.get_xlim()), 1.4 * np.ptp(ax.get_ylim())))


def link_colour(k: int) -> str:
    """Colour of link k; 0 is the frame."""
    return FRAME_COLOUR if k == 0 else COLOURS[(k - 1) % (len(COLOURS) - 1)]


def lighter(colour: str, part: float) -> tuple[float, ...]:
    """The colour mixed with white."""
    return tuple(1.0 - part * (1.0 - c) for c in to_rgb(colour))


def jointed(posture: Posture, link: int) -> set[str]:
    """Markers of a link that hold a joint."""
    return {
        name
        for joint in posture.scene.description["joints"]
        for owner, name in zip(joint["links"], joint["markers"])
        if owner == link and not is_geared(joint)
    }


def distinct(points: Points) -> Points:
    """The points without repetitions, in their order."""
    size = np.ptp(points, axis=0).max()
    if size == 0.0:
        return points[:1]
    _, first = np.unique(np.round((points - points[0]) / (1e-6 * size)), axis=0, return_index=True)
    return points[np.sort(first)]


def around(points: Points) -> NDArray[np.intp]:
    """Order of the points around their centre, in the plane that fits them best."""
    offsets = points - points.mean(axis=0)
    plane = np.linalg.svd(offsets, full_matrices=False)[2][:2]
    first, second = plane @ offsets.T
    return np.argsort(np.arctan2(second, first))


def _hull(points: Points) -> list[int]:
    """Corners of the convex hull of points in the plane, all distinct, one after another around it."""
    order = np.lexsort(points.T[::-1])
    sides: list[list[int]] = [[], []]
    for side, way in zip(sides, (order, order[::-1])):
        for k in map(int, way):
            while len(side) > 1 and np.linalg.det([points[side[-1]] - points[side[-2]], points[k] - points[side[-1]]]) <= 0.0:
                side.pop()
            side.append(k)
    return sides[0][:-1] + sides[1][:-1]


def _ends(posture: Posture, joint: dict[str, Any]) -> Points:
    """(2, 2) points of a joint on its first and second link."""
    return np.array([posture.markers[link][name][:2] for link, name in zip(joint["links"], joint["markers"])])


def _draw_ground(
    ax: Axes, posture: Posture, joint: dict[str, Any], slides: dict[str, tuple[float, float]], unit: float
) -> None:
    side = joint["links"].index(0)
    point = _ends(posture, joint)[side]
    if joint["type"] != "prismatic":
        foot = point + unit * np.array([[-1.3, -2.2], [1.3, -2.2]])
        ax.add_patch(Polygon([point, *foot], facecolor=lighter(FRAME_COLOUR, 0.25), edgecolor="0.2", zorder=2, gid=SOLID))
        _hatch(ax, foot[0] - [0.8 * unit, 0.0], foot[1] + [0.8 * unit, 0.0], np.array([0.0, -1.0]), unit)
        return
    along = posture.axes[0][joint["markers"][side]][:2]
    along = along if along[0] >= -1e-9 else -along
    below = np.array([along[1], -along[0]])
    # The slide counts along the first link's axis, from its marker to the second's.
    lowest, highest = slides[joint["name"]]
    sense = np.sign(along @ posture.axes[joint["links"][0]][joint["markers"][0]][:2]) * (1 if side == 0 else -1)
    ends = np.sort([sense * lowest, sense * highest])
    start = point + (ends[0] - 3.5 * unit) * along + 1.15 * unit * below
    stop = point + (ends[1] + 3.5 * unit) * along + 1.15 * unit * below
    _hatch(ax, start, stop, below, unit)


def _hatch(ax: Axes, start: Points, stop: Points, below: Points, unit: float) -> None:
    """Ground: a line with short strokes on its lower side."""
    ax.plot(*np.array([start, stop]).T, color="0.2", linewidth=1.4, solid_capstyle="butt", zorder=2)
    length = np.linalg.norm(stop - start)
    along = (stop - start) / length
    places = np.arange(0.45 * unit, length + 1e-9 * unit, 0.75 * unit)
    feet = start + places[:, np.newaxis] * along
    strokes = np.stack([feet, feet + 0.8 * unit * (below - 0.7 * along)], axis=1)
    gaps = np.full((len(strokes), 1, 2), np.nan)
    ax.plot(*np.concatenate([strokes, gaps], axis=1).reshape(-1, 2).T, color="0.35", linewidth=0.8, zorder=1.5)


def _corners(markers: dict[str, Points], held: set[str]) -> Points:
    """Between what a link is drawn: its joints; of a straight link its ends, which may lie beyond them."""
    everything = distinct(np.array([point[:2] for point in markers.values()]))
    offsets = everything - everything[0]
    farthest = offsets[np.argmax(np.linalg.norm(offsets, axis=1))]
    if np.abs(offsets[:, 0] * farthest[1] - offsets[:, 1] * farthest[0]).max() <= STRAIGHT * float(farthest @ farthest):
        places = offsets @ farthest
        return distinct(everything[[int(np.argmin(places)), int(np.argmax(places))]])
    return distinct(np.array([markers[name][:2] for name in held or markers]))


def _draw_link(ax: Axes, markers: dict[str, Points], held: set[str], colour: str) -> None:
    """A bar if it is straight or has two joints, a plate between more; further markers on a pale plate."""
    if not markers:
        return
    everything = distinct(np.array([point[:2] for point in markers.values()]))
    corners = _corners(markers, held)
    if len(everything) > max(2, len(corners)):
        hull = everything[_hull(everything)]
        ax.add_patch(Polygon(hull, facecolor=lighter(colour, 0.22), edgecolor=lighter(colour, 0.7), linewidth=1.2, zorder=2.5))
    elif len(everything) > len(corners):
        ax.plot(*everything.T, color=lighter(colour, 0.6), linewidth=1.5, zorder=2.5)
    if len(corners) > 2:
        corners = corners[_hull(corners)]     # what lies inside is on the plate
        ax.add_patch(Polygon(corners, facecolor=lighter(colour, 0.3), edgecolor="none", zorder=3))
        corners = np.concatenate([corners, corners[:1]])
    style: dict[str, Any] = {"solid_capstyle": "round", "solid_joinstyle": "round", "zorder": 4}
    ax.plot(*corners.T, color=tuple(0.65 * c for c in to_rgb(colour)), linewidth=BAR + EDGE, **style)
    ax.plot(*corners.T, color=lighter(colour, 0.75), linewidth=BAR - EDGE, **style)
    free = np.array([point[:2] for name, point in markers.items() if name not in held])
    if len(free):
        ax.plot(*free.T, "o", color=colour, markersize=3.5, zorder=5)


def _draw_slider(ax: Axes, posture: Posture, joint: dict[str, Any], unit: float) -> None:
    """A block on its rail, or on the rod of another link."""
    ends = _ends(posture, joint)
    first, second = joint["links"]
    on_second = second != 0
    along = posture.axes[first][joint["markers"][0]][:2]
    centre, body = (ends[1], second) if on_second else (ends[0], first)
    if 0 not in joint["links"]:
        rod = np.array([ends[0], ends[1] + 3.0 * unit * along * np.sign(along @ (ends[1] - ends[0]) or 1.0)])
        ax.plot(*rod.T, color=link_colour(first), linewidth=2.5, zorder=4.2)
    across = np.array([-along[1], along[0]])
    corners = [centre + unit * (a * 2.1 * along + b * 1.15 * across) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    style: dict[str, Any] = {"edgecolor": "0.15", "linewidth": 1.2, "joinstyle": "round", "zorder": 4.5, "gid": SOLID}
    ax.add_patch(Polygon(corners, facecolor=lighter(link_colour(body), 0.55), **style))


def _write_names(ax: Axes, posture: Posture, unit: float, cylinders: list[_Cylinder]) -> None:
    """Each name where it is farthest from lines and joints, and on no other name; a cylinder has one name."""
    told = {cylinder.name: 0.5 * (cylinder.foot + cylinder.head) for cylinder in cylinders}
    hidden = {link for cylinder in cylinders for link in cylinder.joint["links"]}
    of_slots = parts_of_slots(posture.scene.description)
    joints = [joint for joint in posture.scene.description["joints"] if joint["name"].rpartition(".")[0] not in told and joint["name"] not in {*told, *of_slots}]
    gathered: dict[tuple[float, ...], list[str]] = {}
    for joint in joints:
        point = pitch_point(posture, joint)[:2] if is_geared(joint) else _ends(posture, joint)[1]
        gathered.setdefault(tuple(np.round(point / (0.2 * unit))), []).append(joint["name"])
    anchors: list[tuple[str, Points, str, bool]] = []
    for place, names in gathered.items():
        anchors.append((list_of(names), 0.2 * unit * np.array(place), "0.1", False))
    anchors += [(name, place, "0.1", True) for name, place in told.items()]
    springs = (spring for spring in posture.scene.description["springs"] if acts_along(spring) and shape_of(posture, spring, unit))
    anchors += [(spring["name"], ends_of(posture, spring)[:, :2].mean(axis=0), WIRE, False) for spring in springs]
    for k, markers in enumerate(posture.markers[1:], start=1):
        name = posture.scene.description["links"][k]["name"]
        if k in hidden or name in of_slots or not markers:
            continue
        corners = _corners(markers, jointed(posture, k))
        anchors.append((name, corners.mean(axis=0), link_colour(k), True))
    taken = np.concatenate([sampled(np.asarray(line.get_xydata()), 0.3 * unit) for line in ax.lines])
    for patch in ax.patches:
        if isinstance(patch, Polygon) and patch.get_gid() == SOLID:
            outline = sampled(patch.get_xy(), 0.3 * unit)
            centre = outline.mean(axis=0)
            taken = np.concatenate([taken, *(centre + part * (outline - centre) for part in (1.0, 0.6, 0.2))])
    low, high = np.array([ax.get_xlim(), ax.get_ylim()]).T
    room = Room(taken, low, high, unit)
    n_left = 0
    for text, anchor, colour, is_link in anchors:
        centre = room.place(anchor, unit * np.array([0.36 * len(text), 0.62]) * (FONT / 8.0), is_link)
        if centre is None:
            n_left += 1
            continue
        ax.text(centre[0], centre[1], text, fontsize=FONT, ha="center", va="center", zorder=7, bbox=PLATE, parse_math=False, **name_style(colour, is_link))
    tell_left_out(ax, n_left)


def tell_left_out(ax: Any, n: int) -> None:
    """How many names found no room, in a corner."""
    if n:
        write = ax.text2D if hasattr(ax, "text2D") else ax.text
        write(0.995, 0.01, f"{n} name{'s' if n > 1 else ''} left out: no room", transform=ax.transAxes, fontsize=6.0, color="0.45", ha="right", va="bottom")


def name_style(colour: str, is_link: bool) -> dict[str, Any]:
    """Names of links are slanted, in the link's colour."""
    return {"fontstyle": "italic", "color": tuple(0.7 * c for c in to_rgb(colour))} if is_link else {"color": colour}
