"""What a spatial mechanism looks like: rods, plates, sleeves of slides, a symbol for each kind of joint."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

from ._planar_shapes import around, distinct, jointed, lighter, link_colour

if TYPE_CHECKING:
    from ._postures import Posture

__all__ = ["draw_spatial"]

Points = NDArray[np.float64]

SYMBOLS = {"revolute": "o", "prismatic": "s", "cylindrical": "D", "universal": "P", "spherical": "."}
SYMBOL_SIZES = {".": 12.0}
SLIDING = ("prismatic", "cylindrical")
"""Joints whose two markers lie apart: what lies between them is drawn as rod and sleeve."""


def draw_spatial(ax: Axes3D, posture: Posture, names: bool) -> None:
    """Draw a spatial mechanism in three-dimensional axes whose limits are set."""
    joints = posture.scene.description["joints"]
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((0.97, 0.97, 0.97, 1.0))
        axis._axinfo["grid"].update(color="0.88", linewidth=0.6)
    for k, markers in enumerate(posture.markers):
        _draw_link(ax, markers, jointed(posture, k), link_colour(k))
    listed: set[str] = set()
    for joint in joints:
        _draw_joint(ax, joint, _ends(posture, joint), listed)
    if names:
        for text, point in _labels(posture).items():
            ax.text(*point, f"  {text}", fontsize=8, color="0.1", zorder=20)
        ax.legend(loc="upper left", frameon=False, fontsize="small", title="joints", title_fontsize="small")


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


def _labels(posture: Posture) -> dict[str, Points]:
    """Names and where to write them; of a chain the part before the dot, once."""
    gathered: dict[str, list[Points]] = {}
    description = posture.scene.description
    for joint in description["joints"]:
        gathered.setdefault(joint["name"].split(".")[0], []).append(_ends(posture, joint).mean(axis=0))
    for link, points in zip(description["links"], posture.markers):
        if "." not in link["name"] and points:
            gathered.setdefault(link["name"], []).append(np.mean(list(points.values()), axis=0))
    return {text: np.mean(points, axis=0) for text, points in gathered.items()}
