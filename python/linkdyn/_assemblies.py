"""All assemblies of a mechanism at its start: a table, the words that choose each, and a picture sheet."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from .scene import Scene

__all__ = ["Assemblies", "Assembly", "assemblies_of", "draw_assemblies"]

PANEL = 3.2
"""Width and height of one picture, the larger of both [inch]."""
TITLE, LEAST_WIDTH = 0.35, 3.6
"""Height of a line over it, and width of a sheet [inch]."""
MOST_COLUMNS = 4
PLANE = 2
"""Dimensions of a position."""
LENGTHS = ("slide", "x", "y")
"""Joint variables that are no angles."""
PLACE_DIGITS = 8
"""Of a link: a loop all of whose links are told so is not searched for."""


@dataclass(frozen=True)
class Assembly:
    """One way in which a mechanism closes at its start."""

    number: int
    """From 1 on; 1 is that of the scene."""
    branch: dict[str, int]
    """Joint to 1 or -1, for loops that close by a branch."""
    start: dict[str, float]
    """Joint variable ("D.angle") to where it is [m, rad], for loops closed by iteration and for chains."""
    place: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
    """Link to position [m] and angles [rad], in a plane two and one: where hinges and slides of loops closed by iteration do not tell
    assemblies apart, and of links whose start the scene tells, which would choose besides."""
    chain: dict[str, dict[str, float]]
    """Chain to its keys ``elbow``, 1 or -1, and ``start`` [m, rad], which say so of its joints."""
    joint_variable: dict[str, float]
    """All joint variables [m, rad]."""
    position: NDArray[np.float64]
    """(n_link, 3) origins [m], in the order of ``scene.links``."""
    rotation: NDArray[np.float64]
    """(n_link, 3, 3) from link to world axes."""

    @property
    def words(self) -> str:
        """What chooses it in a scene: ``branch`` or ``start`` of joints, ``elbow`` or ``start`` of chains, ``start`` of links. Empty: there is no choice."""
        texts = [f"{joint}: branch = {sign}" for joint, sign in self.branch.items()]
        by_joint: dict[str, list[str]] = {}
        for label, value in self.start.items():
            joint, _, variable = label.rpartition(".")
            if joint.partition(".")[0] in self.chain:
                continue
            by_joint.setdefault(joint, []).append(f"{variable} = {_quantity(value, variable)}")
        texts += [f"{joint}: start = {{ {', '.join(parts)} }}" for joint, parts in by_joint.items()]
        for chain, keys in self.chain.items():
            texts += [f"{chain}: {key} = {value if key == 'elbow' else _quantity(value, self._kind_of_start(chain))}" for key, value in keys.items()]
        for link, (position, angles) in self.place.items():
            at, turn = (", ".join(_quantity(value, kind, PLACE_DIGITS) for value in values) for values, kind in ((position, "slide"), (angles, "angle")))
            attitude = f"angle = {turn}" if len(position) == PLANE else f"angles = [{turn}]"
            texts.append(f"{link}: start = {{ position = [{at}], {attitude} }}")
        return "; ".join(texts)

    def apply(self, scene: dict[str, Any]) -> dict[str, Any]:
        """A scene as a mapping, its joints told to take this assembly.

        Parameters
        ----------
        scene
            The content of the scene file. Copies by ``repeat`` that are told differently, or mirrored, are left as they are: write them out.

        Returns
        -------
        dict
            A copy with these starts and branches.
        """
        links, joints, chains = ([dict(part) for part in scene.get(kind, [])] for kind in ("link", "joint", "chain"))
        for link in links:
            if place := _told(link, self.place):
                position, angles = place
                attitude = {"angle": float(angles[0])} if len(position) == PLANE else {"angles": angles.tolist()}
                link["start"] = {"position": position.tolist()} | attitude
        starts: dict[str, dict[str, float]] = {}
        for label, value in self.start.items():
            joint, _, variable = label.rpartition(".")
            starts.setdefault(joint, {})[variable] = value
        for one in joints:
            if branch := _told(one, self.branch):
                one.pop("start", None)
                one["branch"] = branch
            if start := _told(one, starts):
                one["start"] = start
        for chain in chains:
            chain |= _told(chain, self.chain) or {}
        return scene | {"link": links, "joint": joints} | ({"chain": chains} if chains else {})

    def _kind_of_start(self, chain: str) -> str:
        """Whether a chain's ``start`` is that of a slide, by its variables."""
        return "slide" if any(label.startswith(f"{chain}.") and label.endswith(".slide") for label in self.joint_variable) else "angle"


class Assemblies(list[Assembly]):
    """All that were found, that of the scene first."""

    is_complete: bool = True
    """No more were found than are listed, and attempts had long found nothing new."""


def assemblies_of(found: dict[str, Any], planar: bool) -> Assemblies:
    """What the engine found, with the places of the links.

    Parameters
    ----------
    found
        From the engine: ``branch_joint``, ``start_variable`` (numbers of joint variables), ``chain_key`` (of each, if a chain's key says it),
        ``placed_link`` (numbers of links), ``variable`` and ``link`` (labels), ``assemblies``.
    planar
        Links have two numbers and an angle.
    """
    result = Assemblies()
    result.is_complete = found["is_complete"]
    labels = found["variable"]
    for number, one in enumerate(found["assemblies"], start=1):
        value = dict(zip(labels, one["variable"]))
        position, rotation = np.reshape(one["position"], (-1, 3)), np.reshape(one["rotation"], (-1, 3, 3))
        start: dict[str, float] = {}
        chain: dict[str, dict[str, float]] = {}
        for k, key in zip(found["start_variable"], found["chain_key"]):
            start[labels[k]] = one["variable"][k]
            if key:
                chain.setdefault(labels[k].partition(".")[0], {})[key] = (-1 if one["variable"][k] < 0 else 1) if key == "elbow" else one["variable"][k]
        result.append(Assembly(
            number, dict(zip(found["branch_joint"], one["branch"])), start,
            {found["link"][k]: _place(position[k], rotation[k], planar) for k in found["placed_link"]}, chain, value, position, rotation,
        ))
    return result


def draw_assemblies(scene: Scene) -> Figure:
    """Every assembly small, with its number; the scene's own in bold."""
    from matplotlib import pyplot

    from ._drawing.mechanisms import draw, drawn_room, set_limits
    from ._drawing.style import put_heading
    from ._geometry.postures import find_postures
    from .scene import Poses

    found = scene.assemblies()
    poses = Poses(np.stack([one.position for one in found]), np.stack([one.rotation for one in found]), np.zeros(len(found), dtype=np.intc))
    postures, _ = find_postures(scene, poses)
    columns = min(MOST_COLUMNS, len(found))
    rows = math.ceil(len(found) / columns)
    width, height = np.array([1.0, 1.0]) if not scene.planar else drawn_room(postures) / drawn_room(postures).max()
    size = max(LEAST_WIDTH, PANEL * width * columns), (PANEL * height + TITLE) * rows + TITLE
    figure = pyplot.figure(figsize=size, layout="constrained")
    for k, one in enumerate(found):
        ax = figure.add_subplot(rows, columns, k + 1, projection=None if scene.planar else "3d")
        set_limits(ax, postures)
        draw(ax, postures, k, names=False)
        if legend := ax.get_legend():
            legend.remove()
        ax.tick_params(labelbottom=False, labelleft=False)
        for axis in "xyz"[:2 if scene.planar else 3]:
            getattr(ax, f"set_{axis}label")("")
            getattr(ax, f"set_{axis}ticklabels")([])
        ax.set_title(f"{one.number}", fontsize="medium", fontweight="bold" if one.number == 1 else "normal")
    put_heading(figure, f"{scene.title}: assemblies at the start" if scene.title else "Assemblies at the start", fontsize="medium")
    return figure


def _place(position: NDArray[np.float64], rotation: NDArray[np.float64], planar: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A link's start as a scene tells it."""
    angles = _angles(rotation)
    return (position[:PLANE], angles[PLANE:]) if planar else (position, angles)


def _told(part: dict[str, Any], said: dict[str, Any]) -> Any:
    """What is said of a part of a scene, or alike of all its copies; None: nothing."""
    name = part.get("name", "")
    if name in said or "mirror" in part:
        return said.get(name)
    copies = part.get("repeat", len(part.get("angles", [])))
    told = [said.get(name.replace("#", str(k)) if "#" in name else f"{name}{k}") for k in range(1, copies + 1)]
    return told[0] if told and all(isinstance(each, (int, dict)) and each == told[0] for each in told) else None


def _angles(r: NDArray[np.float64]) -> NDArray[np.float64]:
    """Roll, pitch and yaw of a rotation Rx Ry Rz; yaw is what is left once roll and pitch are taken away, so that the three tell it near the pole."""
    roll = math.atan2(-r[1, 2], r[2, 2])
    s, c = math.sin(roll), math.cos(roll)
    return np.array([roll, math.atan2(r[0, 2], math.hypot(r[1, 2], r[2, 2])), math.atan2(c * r[1, 0] + s * r[2, 0], c * r[1, 1] + s * r[2, 1])])


def _quantity(value: float, variable: str, digits: int = 6) -> str:
    number, unit = (value * 1e3, "mm") if variable in LENGTHS else (math.degrees(value), "deg")
    return f'"{round(number, 9) + 0.0:.{digits}g} {unit}"'     # what rounding leaves of zero is zero, without a sign
