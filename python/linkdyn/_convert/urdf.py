"""URDF, by the standard library alone: the tree, mass properties, meshes, and loops as exporters write them.

Joints of a ``transmission``, or with a command interface of ``ros2_control``, are driven. A loop is a link that several joints have for child,
or a pair of links ``closing_NAME_1`` and ``closing_NAME_2``, frames that are to lie in each other.
"""

from __future__ import annotations

import math
import os
import re
from pathlib import Path
from typing import Any, Literal
from xml.etree.ElementTree import Element

import numpy as np

from .robot import Array, Body, Coupling, Loop, Robot, TreeJoint, across, axes_about, turn
from .xml_file import XmlFile

__all__ = ["read_urdf"]

KINDS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "fixed": "", "floating": "free", "planar": "planar"}
CLOSING = re.compile(r"closing_(.+)_([12])")
SCALES = {(1.0, 1.0, 1.0): "m", (0.01, 0.01, 0.01): "cm", (0.001, 0.001, 0.001): "mm", (0.0254, 0.0254, 0.0254): "in"}
"""Scales of meshes that a scene has a unit for."""
GRAVITY = np.array([0.0, 0.0, -9.80665])
Closing = Literal["revolute", "spherical", "fixed"]


def read_urdf(file: XmlFile, closing: Closing, folder: Path) -> Robot:
    """A robot of a URDF file; its root link is the frame.

    Parameters
    ----------
    file
        Parsed.
    closing
        The joint that pairs of closing frames stand for.
    folder
        Where the scene is to lie: names of meshes start there.
    """
    return _Reader(file, closing, folder).robot()


class _Reader:
    def __init__(self, file: XmlFile, closing: Closing, folder: Path) -> None:
        self.file, self.closing, self.folder = file, closing, folder
        self.left_out: list[str] = []
        self.links = self._named("link")
        self.joints = self._named("joint")
        root = file.root
        driven = [*root.findall("transmission/joint"), *(j for j in root.findall("ros2_control/joint") if j.find("command_interface") is not None)]
        for joint in driven:
            if joint.get("name", "") not in self.joints:
                raise self.file.refuse(joint, "the robot has no such joint (expected one of its joints)")
        self.driven = {joint.get("name", "") for joint in driven}

    def robot(self) -> Robot:
        order, loops = self._tree()
        numbers = {name: i for i, (name, _) in enumerate(order)}
        bodies = []
        for name, joint in order:
            bodies.append(self._body(name, joint, numbers))
        if order and bodies[0].mass > 0:
            self.left_out.append(f"link '{order[0][0]}': it is the frame; its mass")
        bodies[0].mass = 0.0
        robot = Robot(self.file.root.get("name", ""), GRAVITY.copy(), bodies)
        robot.loops = [self._loop(joint, numbers) for joint in loops] + self._closing_frames(numbers)
        robot.couplings = self._couplings(robot)
        self._tell_the_rest()
        robot.left_out = self.left_out
        return robot

    # ------------------------------------------------------------------------------------------------------------- the tree
    def _named(self, tag: str) -> dict[str, Element]:
        found: dict[str, Element] = {}
        for element in self.file.root.findall(tag):
            name = element.get("name", "")
            if not name:
                raise self.file.refuse(element, "it has no name (expected name=\"..\")")
            if name in found:
                raise self.file.refuse(element, f"the name is taken already (expected each {tag} once)")
            found[name] = element
        return found

    def _end(self, joint: Element, tag: str) -> str:
        element = joint.find(tag)
        name = element.get("link", "") if element is not None else ""
        if name not in self.links:
            raise self.file.refuse(joint, f"{tag} {name[:60]!r} is no link of the robot (expected one of its links)")
        return name

    def _tree(self) -> tuple[list[tuple[str, Element | None]], list[Element]]:
        """Links with the joints that lead to them, parents first; joints that close loops."""
        if not self.links:
            raise self.file.refuse(self.file.root, "there is no link (expected <link name=\"..\">)")
        leading: dict[str, Element] = {}
        loops = []
        for joint in self.joints.values():
            child = self._end(joint, "child")
            if child in leading:
                loops.append(joint)
            else:
                leading[child] = joint
        roots = [name for name in self.links if name not in leading]
        if len(roots) != 1:
            told = ", ".join(repr(name[:60]) for name in roots[:4]) or "none"
            raise self.file.refuse(self.file.root, f"links that no joint leads to: {told} (expected one, the frame)")
        order: list[tuple[str, Element | None]] = [(roots[0], None)]
        children: dict[str, list[str]] = {}
        for child, joint in leading.items():
            children.setdefault(self._end(joint, "parent"), []).append(child)
        for name, _ in order:
            order += [(child, leading[child]) for child in children.get(name, [])]
        if len(order) < len(self.links):
            lost = next(name for name in self.links if name not in {known for known, _ in order})
            raise self.file.refuse(self.links[lost], "joints lead to it in a circle (expected a way from the root)")
        return order, loops

    def _body(self, name: str, joint: Element | None, numbers: dict[str, int]) -> Body:
        link = self.links[name]
        body = Body(name, 0)
        inertial = link.find("inertial")
        if inertial is not None:
            p, r = self._origin(inertial)
            body.mass = self._number(inertial.find("mass"), "value", inertial)
            tensor = inertial.find("inertia")
            ixx, ixy, ixz, iyy, iyz, izz = (self._number(tensor, key, inertial) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
            body.cog = p
            body.inertia = r @ np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]) @ r.T
        body.mesh = self._mesh(link)
        if joint is None:
            return body
        body.parent = numbers[self._end(joint, "parent")]
        body.position, body.rotation = self._origin(joint)
        body.joints = self._joints(joint)
        return body

    def _joints(self, joint: Element) -> list[TreeJoint]:
        kind = KINDS.get(joint.get("type", ""))
        name = joint.get("name", "")
        if kind is None:
            raise self.file.refuse(joint, f"type {joint.get('type', '')[:60]!r} (expected one of {', '.join(KINDS)})")
        if kind == "":
            return []
        if kind == "free":
            self._resistance(joint, takes_damping=False)
            return [TreeJoint(name, "free")]
        axis = self._axis(joint)
        if kind == "planar":
            x = across(axis)
            y = np.cross(axis, x)
            self._resistance(joint, takes_damping=False)
            return [TreeJoint(f"{name}_x", "slide", axis=x), TreeJoint(f"{name}_y", "slide", axis=y), TreeJoint(f"{name}_turn", "hinge", axis=axis)]
        found = TreeJoint(name, "hinge" if kind == "hinge" else "slide", axis=axis, is_driven=name in self.driven)
        found.damping = self._resistance(joint)
        self._tell_bounds(joint, found.kind)
        return [found]

    def _resistance(self, joint: Element, takes_damping: bool = True) -> float:
        """Damping of a joint; what there is no place for is told."""
        name, dynamics = joint.get("name", ""), joint.find("dynamics")
        if dynamics is None:
            return 0.0
        if friction := self._number(dynamics, "friction", joint, 0.0):
            self.left_out.append(f"joint '{name}': friction {friction:g} (a [[friction]] or a spring's force says it)")
        damping = self._number(dynamics, "damping", joint, 0.0)
        if takes_damping or not damping:
            return damping
        self.left_out.append(f"joint '{name}': damping {damping:g} of a {joint.get('type')} joint (a spring's damping says it)")
        return 0.0

    def _tell_bounds(self, joint: Element, kind: str) -> None:
        """Its range, and what its drive may do at most."""
        name, limit = joint.get("name", ""), joint.find("limit")
        if limit is None:
            return
        is_hinge = kind == "hinge"
        if joint.get("type") != "continuous" and (limit.get("lower") or limit.get("upper")):
            self.left_out.append(f"joint '{name}': range {limit.get('lower', '0')} to {limit.get('upper', '0')} {'rad' if is_hinge else 'm'} (a [[stop]] says it)")
        most = [(word, limit.get(key), unit) for word, key, unit in (
            ("effort", "effort", "N m" if is_hinge else "N"), ("velocity", "velocity", "rad/s" if is_hinge else "m/s"))]
        if told := " and ".join(f"{word} up to {value} {unit}" for word, value, unit in most if value and float(value) != 0):
            self.left_out.append(f"joint '{name}': {told} (limits of an actuator's drive, or of a [sweep], say it)")

    def _couplings(self, robot: Robot) -> list[Coupling]:
        """Joints that mimic others."""
        leaders = {name: mimic.get("joint", "") for name, joint in self.joints.items() if (mimic := joint.find("mimic")) is not None}
        known = {joint.name: joint for _, joint, _ in robot.dofs()}
        found = []
        for name, leader in leaders.items():
            mimic = self.joints[name].find("mimic")
            if leader not in self.joints:
                raise self.file.refuse(self.joints[name], f"it mimics {leader[:60]!r}, which is no joint of the robot (expected one of its joints)")
            above, chain = leader, {name}
            while above in leaders and above not in chain:
                chain.add(above)
                above = leaders[above]
            if above in chain:
                raise self.file.refuse(self.joints[name], "joints mimic each other in a circle (expected one that mimics none)")
            ratio, offset = (self._number(mimic, key, self.joints[name], default) for key, default in (("multiplier", 1.0), ("offset", 0.0)))
            if name in known and leader in known:
                found.append(Coupling(known[leader], known[name], ratio, offset))
            else:
                self.left_out.append(f"joint '{name}': it follows '{leader}' (both have to be hinges or slides of the tree)")
        return found

    # ---------------------------------------------------------------------------------------------------------------- loops
    def _loop(self, joint: Element, numbers: dict[str, int]) -> Loop:
        """A second joint that leads to a link."""
        kind = KINDS.get(joint.get("type", ""))
        p, r = self._origin(joint)
        bodies = numbers[self._end(joint, "parent")], numbers[self._end(joint, "child")]
        if kind not in ("hinge", "slide", ""):
            raise self.file.refuse(joint, f"type {joint.get('type', '')[:60]!r} closes a loop (expected revolute, continuous, prismatic or fixed)")
        axes = axes_about(self._axis(joint)) if kind else np.eye(3)
        word: Any = {"hinge": "revolute", "slide": "prismatic", "": "fixed"}[kind]
        loop = Loop(joint.get("name", ""), word, bodies, (p, np.zeros(3)), (r @ axes, axes))
        if kind:
            loop.is_driven, loop.damping = loop.name in self.driven, self._resistance(joint)
            self._tell_bounds(joint, kind)
        return loop

    def _closing_frames(self, numbers: dict[str, int]) -> list[Loop]:
        """Pairs of links that are to lie in each other; they turn about their z."""
        pairs: dict[str, dict[str, int]] = {}
        for name, number in numbers.items():
            if match := CLOSING.fullmatch(name):
                pairs.setdefault(match[1], {})[match[2]] = number
        loops = []
        for name, ends in pairs.items():
            if len(ends) < 2:
                self.left_out.append(f"link 'closing_{name}_{next(iter(ends))}': it has no other end")
                continue
            loops.append(Loop(name, self.closing, (ends["1"], ends["2"]), (np.zeros(3), np.zeros(3))))
            self.left_out.append(f"frames 'closing_{name}_1' and '_2' are a {self.closing} joint (--closing says another)")
        return loops

    # --------------------------------------------------------------------------------------------------------------- values
    def _mesh(self, link: Element) -> tuple[str, str] | None:
        """The one STL or GLB file of a link that lies in its axes."""
        name, found = link.get("name", ""), None
        for visual in link.findall("visual"):
            mesh = visual.find("geometry/mesh")
            if mesh is None:
                self.left_out.append(f"link '{name}': a picture that is no mesh")
                continue
            file = mesh.get("filename", "")
            p, r = self._origin(visual)
            scale = tuple(self._vector(mesh, "scale", np.ones(3)).tolist())
            where = self._find(file)
            reasons = [reason for is_wrong, reason in (
                (found is not None, "a second one"), (not file.lower().endswith((".stl", ".glb")), "neither STL nor GLB"), (scale not in SCALES, "scaled"),
                (np.abs(p).max() > 0 or np.abs(r - np.eye(3)).max() > 1e-12, "not in the link's axes"), (where is None, "the file is not there")) if is_wrong]
            if reasons:
                self.left_out.append(f"link '{name}': mesh '{file[:100]}' ({', '.join(reasons)})")
            elif where is not None:
                found = os.path.relpath(where, self.folder.absolute()), SCALES[scale]
        return found

    def _find(self, file: str) -> Path | None:
        """A mesh beside the robot, or in a folder above it, as packages have them."""
        plain = file.removeprefix("file://")
        if plain.startswith("package://"):
            inside = plain.removeprefix("package://")
            parts = [inside, inside.partition("/")[2]]
        else:
            parts = [plain]
        folder = self.file.path.absolute().parent
        for base in (folder, *list(folder.parents)[:3]):
            for part in parts:
                if part and (base / part).is_file():
                    return (base / part).resolve()
        return None

    def _origin(self, element: Element) -> tuple[Array, Array]:
        origin = element.find("origin")
        if origin is None:
            return np.zeros(3), np.eye(3)
        roll, pitch, yaw = self._vector(origin, "rpy", np.zeros(3))
        x, y, z = np.eye(3)
        return self._vector(origin, "xyz", np.zeros(3)), turn(z, yaw) @ turn(y, pitch) @ turn(x, roll)

    def _axis(self, joint: Element) -> Array:
        element = joint.find("axis")
        axis = np.array([1.0, 0, 0]) if element is None else self._vector(element, "xyz", np.array([1.0, 0, 0]))
        if not np.linalg.norm(axis) > 0:
            raise self.file.refuse(joint, "its axis has no direction (expected xyz=\"0 0 1\", for example)")
        unit: Array = axis / np.linalg.norm(axis)
        return unit

    def _vector(self, element: Element, key: str, default: Array) -> Array:
        text = element.get(key)
        if text is None:
            return default.copy()
        words = text.split()
        values = [self._finite(word) for word in words]
        if len(words) != 3 or None in values:
            raise self.file.refuse(element, f"{key} = {text[:60]!r} (expected three numbers)")
        return np.array(values, dtype=float)

    def _number(self, element: Element | None, key: str, owner: Element, default: float | None = None) -> float:
        text = element.get(key) if element is not None else None
        if text is None and default is not None:
            return default
        value = self._finite(text or "")
        if value is None:
            raise self.file.refuse(owner if element is None else element, f"{key} = {(text or '')[:60]!r} (expected a number)")
        return value

    @staticmethod
    def _finite(text: str) -> float | None:
        try:
            value = float(text)
        except ValueError:
            return None
        return value if math.isfinite(value) else None

    def _tell_the_rest(self) -> None:
        n = sum(1 for link in self.links.values() for _ in link.findall("collision"))
        if n:
            self.left_out.append(f"{n} collision shape(s)")
        others: dict[str, int] = {}
        for element in self.file.root:
            if element.tag not in ("link", "joint", "material", "transmission", "ros2_control"):
                others[element.tag] = others.get(element.tag, 0) + 1
        self.left_out += [f"{count} element(s) '{tag[:60]}'" for tag, count in others.items()]
