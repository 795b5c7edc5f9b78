"""A scene as MJCF: a tree of bodies at the pose of the start; joints that close loops are equality constraints."""

from __future__ import annotations

import math
import tomllib
from collections import deque
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from .._pose import quaternion_of
from .._scene_types import n_copies
from ..errors import InputError
from ..scene import Scene
from .robot import Array

__all__ = ["as_mjcf"]

LIGHT = 1e-9
"""Mass [kg] and moment of inertia [kg m^2] of what has none: MuJoCo moves nothing without."""
DOFS = {
    "revolute": ("hinge",), "prismatic": ("slide",), "cylindrical": ("hinge", "slide"), "universal": ("hinge", "hinge"), "spherical": ("ball",),
    "fixed": (), "planar": ("slide", "slide", "hinge"), "screw": ("hinge", "slide"),
}  # fmt: skip
"""Joints of MuJoCo for one of a scene; gears, racks and belts have none."""
VARIABLES = {"cylindrical": ("angle", "slide"), "universal": ("angle1", "angle2"), "planar": ("x", "y", "angle"), "screw": ("angle", "slide")}
LAST = ("fixed", "revolute", "spherical")
"""What the tree takes after all others, so that loops are cut there: MuJoCo has constraints for these."""
LOSSES = ("efficiency", "back_efficiency", "brake", "torque_limit", "current_limit", "power_limit", "torque_curve")
"""Keys of a motor that MuJoCo's joints have nothing for."""
RATES = ("velocity", "angular_rate", "angular_rates", "angular_velocity")
TELL = {
    "load": "{} load(s)", "spring": "{} spring(s)", "friction": "friction of {} joint(s)", "event": "{} event(s)", "stop": "{} stop(s)",
    "clutch": "{} clutch(es)", "controller": "{} controller(s)",
}  # fmt: skip
"""Tables of a scene that have no place in the file, and what is said of so many parts."""


def as_mjcf(scene: Scene) -> tuple[str, list[str]]:
    """The text of a file for MuJoCo, and what was left out.

    The pose of the start is MuJoCo's reference pose. Hinges and slides have the joint variables of the scene for coordinates.
    """
    return _Writer(scene).written()


class _Writer:
    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.links: list[dict[str, Any]] = scene.description["links"]
        self.joints: list[dict[str, Any]] = scene.description["joints"]
        self.left_out: list[str] = []
        q = scene.motion(float(scene.times()[0]))[0]
        poses = scene.poses(q)
        if poses.status[0] != 0:
            raise InputError("convert: the mechanism cannot be assembled at the start of the scene (linkdyn inverse says why)")
        self.position = [np.zeros(3), *poses.position[0]]
        self.rotation = [np.eye(3), *poses.rotation[0]]
        self.size = max(float(np.abs(self.position).max()), *(abs(x) for link in self.links for m in link["markers"] for x in m["at"]), 1e-6)
        self.driven = {actuator["name"].partition(":")[0] for actuator in scene.description["actuators"]}
        self.joint_names = {joint["name"] for joint in self.joints}
        self.named: set[str] = set()
        """Joint variables that the file has."""
        self.content = tomllib.loads(scene.text)
        self.springs = self._springs_at_joints()
        self.n_written = 0
        """Springs that the file has."""

    def written(self) -> tuple[str, list[str]]:
        root = Element("mujoco", model=self.scene.title or "linkdyn")
        add(root, "compiler", angle="radian", autolimits="true")
        option = add(root, "option", gravity=_text(self.scene.description["gravity"]))
        add(option, "flag", contact="disable")
        world = add(root, "worldbody")
        self.equality = Element("equality")
        self.elements: list[Element] = [world] + [world] * (len(self.links) - 1)
        tree = self._tree()
        self._fill(world, 0)
        cuts = [k for k in range(len(self.joints)) if k not in {k for _, k in tree.values()}]
        self._add_bodies(tree)
        for k in cuts:
            self._cut(self.joints[k])
        if len(self.equality):
            root.append(self.equality)
        self._add_motors(root)
        self._tell()
        ElementTree.indent(root)
        return ElementTree.tostring(root, encoding="unicode") + "\n", self.left_out

    # ------------------------------------------------------------------------------------------------------------- the tree
    def _order(self, k: int) -> tuple[int, int]:
        """What the tree takes first: driven joints, then those that MuJoCo cannot close loops by."""
        joint = self.joints[k]
        driven = any(f"{joint['name']}{suffix}" in self.driven for suffix in ("", ".angle", ".slide", ".angle1", ".angle2", ".x", ".y"))
        return (0 if driven else 1 + (LAST.index(joint["type"]) + 1 if joint["type"] in LAST else 0)), k

    def _tree(self) -> dict[int, tuple[int, int]]:
        """Of each link its parent and the joint between; no joint (-1): it floats."""
        home = list(range(len(self.links)))

        def root_of(i: int) -> int:
            while home[i] != i:
                i = home[i]
            return i

        near: dict[int, list[tuple[int, int]]] = {}
        for k in sorted((k for k, joint in enumerate(self.joints) if joint["type"] in DOFS), key=self._order):
            first, second = self.joints[k]["links"]
            if root_of(first) != root_of(second):
                home[root_of(first)] = root_of(second)
                near.setdefault(first, []).append((second, k))
                near.setdefault(second, []).append((first, k))
        tree: dict[int, tuple[int, int]] = {}
        reached, queue = {0}, deque([0])
        while True:
            while queue:
                i = queue.popleft()
                for j, k in sorted(near.get(i, []), key=lambda pair: pair[1]):
                    if j not in reached:
                        tree[j] = (i, k)
                        reached.add(j)
                        queue.append(j)
            apart = [i for i in range(len(self.links)) if i not in reached]
            if not apart:
                return tree
            tree[apart[0]] = (0, -1)
            reached.add(apart[0])
            queue.append(apart[0])

    def _add_bodies(self, tree: dict[int, tuple[int, int]]) -> None:
        for i, (parent, k) in tree.items():         # parents stand first
            body = add(self.elements[parent], "body", name=self.links[i]["name"], **self._place(parent, self.position[i], self.rotation[i]))
            self.elements[i] = body
            if k < 0:
                add(body, "freejoint", name=f"{self.links[i]['name']}_free")
            else:
                self._add_joints(body, self.joints[k], is_reversed=self.joints[k]["links"][0] == i, place=(self.position[i], self.rotation[i]))
            self._fill(body, i)

    def _place(self, parent: int, position: Array, rotation: Array) -> dict[str, str]:
        """Where a body is in its parent's axes."""
        r = self.rotation[parent].T
        return {"pos": _text(r @ (position - self.position[parent])), "quat": _text(quaternion_of(r @ rotation))}

    def _add_joints(self, body: Element, joint: dict[str, Any], is_reversed: bool, place: tuple[Array, Array]) -> None:
        """The joints of MuJoCo that move a body against its parent; where the body is the first link of the joint, they are turned round."""
        at, axes, values = self._lines(joint)
        names = [joint["name"]] if len(DOFS[joint["type"]]) == 1 else [f"{joint['name']}.{variable}" for variable in VARIABLES.get(joint["type"], ())]
        steps = list(zip(DOFS[joint["type"]], axes, values, names))
        for kind, axis, value, name in reversed(steps) if is_reversed else steps:
            keys = {"name": name, "type": kind, "pos": _text(place[1].T @ (at - place[0]))}
            if kind != "ball":
                keys |= {"axis": _text(place[1].T @ axis * (-1 if is_reversed else 1)), "ref": repr(float(value))}
                self.named.add(name)
                keys |= self._spring(name)
                if (motor := self._rotor(joint["name"] if joint["type"] == "screw" and kind == "hinge" else name)) > 0:
                    keys["armature"] = repr(motor)
            add(body, "joint", **keys)
        if joint["type"] == "screw":
            self._add_thread(joint)

    def _lines(self, joint: dict[str, Any]) -> tuple[Array, list[Array], list[float]]:
        """Point, axes in the world, and values of a joint's variables at the start."""
        (p1, r1), (p2, r2) = (self._marker(i, name, joint["type"]) for i, name in zip(joint["links"], joint["markers"]))
        turned, z = r1.T @ r2, r1[:, 2]
        angle = math.atan2(turned[1, 0], turned[0, 0])
        slide = float(z @ (p2 - p1))
        if joint["type"] == "universal":
            first, second = turned[:, 2], turned.T[:, 2]
            return p1, [z, r2[:, 2]], [math.atan2(-first[0], first[1]), math.atan2(-second[0], -second[1])]
        if joint["type"] == "planar":
            return p2, [r1[:, 0], r1[:, 1], z], [float(r1[:, 0] @ (p2 - p1)), float(r1[:, 1] @ (p2 - p1)), angle]
        return p2, [z, z], {"prismatic": [slide], "spherical": [0.0]}.get(joint["type"], [angle, slide])

    def _marker(self, link: int, name: str, kind: str) -> tuple[Array, Array]:
        """Place and axes of a joint's marker in the world; in a plane hinges turn about z."""
        marker = next(m for m in self.links[link]["markers"] if m["name"] == name)
        z, x = np.array(marker["axis"]), np.array(marker["x"])
        if self.scene.planar:
            along = z
            z, x = (along, np.cross([0.0, 0.0, 1.0], along)) if kind == "prismatic" else (np.array([0.0, 0.0, 1.0]), along)
        axes = np.column_stack([x, np.cross(z, x), z])
        return self.position[link] + self.rotation[link] @ np.array(marker["at"]), self.rotation[link] @ axes

    def _add_thread(self, joint: dict[str, Any]) -> None:
        """A screw's slide follows its angle."""
        add(self.equality, "joint", name=f"{joint['name']}_thread", joint1=f"{joint['name']}.slide", joint2=f"{joint['name']}.angle",
            polycoef=_text([0.0, joint["lead"] / (2 * math.pi), 0, 0, 0]))

    def _springs_at_joints(self) -> dict[str, list[dict[str, Any]]]:
        """By the names that joint variables have in the file. A ball's have none; a force that is no straight line over the stretch has no place."""
        kinds = {joint["name"]: joint["type"] for joint in self.joints}
        found: dict[str, list[dict[str, Any]]] = {}
        for spring in self.scene.description["springs"]:
            if (joint := spring["joint"]) and not spring["has_force"]:
                found.setdefault(f"{joint}.{spring['variable']}" if kinds.get(joint) in VARIABLES else joint, []).append(spring)
        return found

    def _spring(self, name: str) -> dict[str, str]:
        """Attributes of the springs at a joint variable: side by side they are as stiff as their sum, about a rest between theirs."""
        springs = self.springs.get(name, [])
        stiffness, damping = (sum(spring[key] for spring in springs) for key in ("stiffness", "damping"))
        first = springs[0]["rest"] if springs else 0.0
        pull = sum(spring["stiffness"] * (spring["rest"] - first) for spring in springs)
        if stiffness == 0 and pull != 0:        # a constant force is left of them
            return {}
        self.n_written += len(springs)
        rest = first + pull / stiffness if stiffness != 0 else 0.0
        return {key: repr(float(value)) for key, value in (("stiffness", stiffness), ("damping", damping), ("springref", rest)) if value != 0}

    # ---------------------------------------------------------------------------------------------------------------- loops
    def _cut(self, joint: dict[str, Any]) -> None:
        """A joint that is not in the tree."""
        kind, name = joint["type"], joint["name"]
        if kind not in DOFS:
            self.left_out.append(f"joint '{name}': a {kind}")
            return
        first, second = joint["links"]
        at = self._marker(second, joint["markers"][1], kind)[0]
        if kind == "fixed":
            self._hold("weld", name, first, second)
        elif kind in ("spherical", "revolute"):
            self._hold("connect", name, first, second, at)
            if kind == "revolute" and not self.scene.planar:
                self._hold("connect", f"{name}_axis", first, second, at + 0.1 * self.size * self._marker(first, joint["markers"][0], kind)[1][:, 2])
        else:
            # a body of next to no mass stands for the second link in the tree
            body = add(self.elements[first], "body", name=f"{name}_end", **self._place(first, self.position[second], self.rotation[second]))
            self._add_joints(body, joint, is_reversed=False, place=(self.position[second], self.rotation[second]))
            add(body, "inertial", pos="0 0 0", mass=repr(LIGHT), diaginertia=_text([LIGHT] * 3))
            ends = {"body1": f"{name}_end"} | ({"body2": self.links[second]["name"]} if second else {})
            add(self.equality, "weld", name=name, **ends, relpose="0 0 0 1 0 0 0")
            self.left_out.append(f"joint '{name}': closes a loop as a {kind} joint to a body of {LIGHT:g} kg, welded to '{self.links[second]['name']}'")

    def _hold(self, tag: str, name: str, first: int, second: int, at: Array | None = None) -> None:
        """A constraint between two links; MuJoCo's world needs no name where it is the second."""
        if first == 0:
            first, second = second, first
        keys = {"name": name, "body1": self.links[first]["name"]}
        if second != 0:
            keys["body2"] = self.links[second]["name"]
        if at is not None:
            keys["anchor"] = _text(self.rotation[first].T @ (at - self.position[first]))
        add(self.equality, tag, **keys)

    # --------------------------------------------------------------------------------------------------------------- bodies
    def _fill(self, element: Element, i: int) -> None:
        """Mass, points and a picture of a link."""
        link = self.links[i]
        if i > 0:
            self._add_inertia(element, link, i)
        used = {(n, name) for joint in self.joints for n, name in zip(joint["links"], joint["markers"])}
        places = [np.array(m["at"]) for m in link["markers"] if (i, m["name"]) in used]
        for marker in link["markers"]:
            if (i, marker["name"]) not in used:
                add(element, "site", name=f"{link['name']}.{marker['name']}", pos=_text(marker["at"]), size=repr(0.01 * self.size))
        middle = np.mean(places, axis=0) if places else np.zeros(3)
        for at in places if i > 0 else []:
            if np.linalg.norm(at - middle) > 1e-3 * self.size:
                add(element, "geom", type="capsule", fromto=f"{_text(middle)} {_text(at)}", size=repr(0.01 * self.size), contype="0", conaffinity="0")

    def _add_inertia(self, element: Element, link: dict[str, Any], i: int) -> None:
        mass, cog, tensor = float(link["mass"]), np.array(link["cog"], dtype=float), _matrix(link["inertia"])
        if self.scene.planar:
            tensor[0, 0] = tensor[1, 1] = 0.5 * tensor[2, 2]     # of no effect in a plane
        for payload, more in zip(self.scene.description["payloads"], self._payload_masses()):
            if payload["link"] == i:
                mass, cog, tensor = _joined((mass, cog, tensor), (float(more), np.array(payload["at"]), _matrix(payload["inertia"])))
        if mass <= 0:
            self.left_out.append(f"link '{link['name']}': it has no mass; {LIGHT:g} kg are written, since MuJoCo moves nothing without")
            mass, tensor = LIGHT, LIGHT * np.eye(3)
        bodily = _bodily(tensor, mass, self.size)
        if np.abs(bodily - tensor).max() > 1e-6 * np.abs(bodily).max() and mass > LIGHT:
            self.left_out.append(f"link '{link['name']}': moments of inertia of zero, or that no body has: they are raised as little as MuJoCo asks for")
        order = bodily[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        add(element, "inertial", pos=_text(cog), mass=repr(mass), fullinertia=_text(order))

    def _payload_masses(self) -> Array:
        return self.scene.payload_masses(self.scene.times()[:1])[0] if self.scene.description["payloads"] else np.zeros(0)

    def _rotor(self, name: str) -> float:
        """Inertia of a motor at its joint."""
        return float(sum(motor["inertia"] * motor["ratio"] ** 2 for motor in self.scene.description["motors"] if motor["name"].partition(":")[0] == name))

    # ---------------------------------------------------------------------------------------------------------------- motors
    def _add_motors(self, root: Element) -> None:
        motors = Element("actuator")
        for actuator in self.scene.description["actuators"]:
            driven = actuator["name"].partition(":")[0]
            name = next((name for name in (driven, f"{driven}.angle") if name in self.named), None)     # that of a screw
            if name:
                add(motors, "motor", name=actuator["name"], joint=name)
            else:
                self.left_out.append(f"actuator '{actuator['name']}': its joint closes a loop")
        if len(motors):
            root.append(motors)

    def _tell(self) -> None:
        content = self.content
        for key, words in TELL.items():
            n = len(self.scene.description["springs"]) - self.n_written if key == "spring" else sum(map(n_copies, content.get(key, [])))
            if n > 0:
                self.left_out.append(words.format(n))
        if "sweep" in content:
            self.left_out.append("the sweep")
        actuators = content.get("actuator", [])
        if n := sum(n_copies(part) for part in actuators if "law" in part):
            self.left_out.append(f"law(s) of {n} actuator(s): MuJoCo takes forces from its controls")
        if n := sum(n_copies(part) for part in actuators if set(part.get("drive", {})) & set(LOSSES)):
            self.left_out.append(f"efficiency, brake or limits of {n} actuator(s)")
        if n := len(self.scene.description["cylinders"]):
            self.left_out.append(f"cylinder(s) of {n} actuator(s): areas, pressures, valves")
        if any(_has_rate(part.get("start")) for part in content.get("coordinate", [])):
            self.left_out.append("velocities of the start: the file has its pose")
        if any("motion" in part for part in content.get("coordinate", [])):
            self.left_out.append("the motion: the file has the pose of the start, and motors without a controller")
        if self.scene.description["frame_moves"]:
            self.left_out.append("the motion of the frame")
        if self.scene.description["payloads"]:
            self.left_out.append("payloads are parts of their links, as they are at the start")


def add(parent: Element, tag: str, **keys: str) -> Element:
    """An element with its attributes."""
    return SubElement(parent, tag, keys)


def _has_rate(start: Any) -> bool:
    """Does a start say how fast, of a joint variable, a pose or its components?"""
    return isinstance(start, dict) and any(key in RATES or _has_rate(value) for key, value in start.items())


def _matrix(elements: Any) -> Array:
    xx, yy, zz, xy, yz, zx = elements
    return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]], dtype=float)


def _joined(a: tuple[float, Array, Array], b: tuple[float, Array, Array]) -> tuple[float, Array, Array]:
    """Mass, centre and inertia about it, of two as one."""
    total = a[0] + b[0]
    if total <= 0:
        return a
    middle = (a[0] * a[1] + b[0] * b[1]) / total
    tensor = a[2] + b[2]
    for mass, cog, _ in (a, b):
        arm = cog - middle
        tensor = tensor + mass * ((arm @ arm) * np.eye(3) - np.outer(arm, arm))
    return total, middle, tensor


def _bodily(tensor: Array, mass: float, size: float) -> Array:
    """The nearest tensor that MuJoCo takes: moments above zero, none above the sum of the others."""
    moments, axes = np.linalg.eigh(tensor)
    least = max(1e-9 * float(moments[-1]), 1e-12 * mass * size**2, 1e-14)
    if moments[0] >= least and moments[0] + moments[1] >= moments[2]:
        return tensor
    moments = np.maximum(moments, least)
    moments[0] += max(0.0, moments[2] * (1 + 1e-9) - moments[0] - moments[1])
    found: Array = axes @ np.diag(moments) @ axes.T
    return found


def _text(values: Any) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)
