"""The scene of a robot that was read from a file of another program.

Welds are taken in, loops are closed, freedoms that lead are found from the loops' rates off the start, and idle spins are found.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._builder import Builder, Link
from .couplings import Train, add_train, train_of
from .robot import (
    ALIGNED,
    EXACT,
    ROUND,
    Array,
    Robot,
    TreeJoint,
    ancestors,
    angles_of,
    axes_about,
    closed,
    followed,
    idle_spins,
    leading,
    pose_of,
    round_about,
    size_of,
    turn,
    without_welds,
    zeros,
)
from ..errors import InputError

__all__ = ["as_builder"]

NAME_LENGTH = 64
MOST, LARGEST = 1000, 1e15
"""Bodies of a robot, and its numbers, at most."""


class Names:
    """Names as a scene takes them, each once."""

    def __init__(self, *taken: str) -> None:
        self._taken = set(taken)

    def new(self, wanted: str, default: str) -> str:
        """The name wanted as far as it can be had."""
        plain = re.sub(r"[^A-Za-z0-9_.+-]", "_", wanted)[: NAME_LENGTH - 6] or default
        name, n = plain, 1
        while name in self._taken:
            n += 1
            name = f"{plain}_{n}"
        self._taken.add(name)
        return name


@dataclass
class Group:
    """Joints of the tree that are one of a scene."""

    kind: str
    at: Array
    axes: tuple[Array, Array]
    """Of the first and second link in the reference pose, in the body's axes."""
    joints: list[TreeJoint]
    variables: list[str]
    """Names of its variables, in the order of the freedoms."""

    @property
    def name(self) -> str:
        """That of its one joint; of joints ``C.angle`` and ``C.slide`` it is ``C``."""
        first = self.joints[0].name
        if len(self.joints) == 1:
            return first
        common = first.removesuffix(f".{self.variables[0]}")
        return common if all(joint.name == f"{common}.{variable}" for joint, variable in zip(self.joints, self.variables)) else first


def grouped(joints: list[TreeJoint], size: float) -> list[Group]:
    """Joints one after the other, pairs as cylindrical and universal joints where they are such."""
    groups, k = [], 0
    while k < len(joints):
        pair = joints[k : k + 2]
        kinds = [joint.kind for joint in pair]
        group = None
        if kinds in (["hinge", "slide"], ["slide", "hinge"]):
            group = _cylindrical(pair)
        elif kinds == ["hinge", "hinge"]:
            group = _universal(pair, size)
        group = group or _single(joints[k])
        groups.append(group)
        k += len(group.joints)
    return groups


def _single(joint: TreeJoint) -> Group:
    if joint.kind == "ball":
        return Group("spherical", joint.at, (np.eye(3), np.eye(3)), [joint], ["roll", "pitch", "yaw"])
    axes = axes_about(joint.axis)
    if joint.kind in ("hinge", "screw"):
        return Group("revolute" if joint.kind == "hinge" else "screw", joint.at, (axes, turn(joint.axis, joint.reference) @ axes), [joint], ["angle"])
    return Group("prismatic", joint.at, (axes, axes), [joint], ["slide"])


def _cylindrical(pair: list[TreeJoint]) -> Group | None:
    hinge, slide = sorted(pair, key=lambda joint: joint.kind)
    if np.linalg.norm(hinge.axis - slide.axis) > ALIGNED:
        return None
    axes = axes_about(hinge.axis)
    return Group("cylindrical", hinge.at, (axes, turn(hinge.axis, hinge.reference) @ axes), pair,
                 ["angle" if joint is hinge else "slide" for joint in pair])


def _universal(pair: list[TreeJoint], size: float) -> Group | None:
    first, second = pair
    z1, z2 = first.axis, second.axis
    if abs(z1 @ z2) > ALIGNED or first.armature or second.armature:      # a motor with a rotor drives an axis of its own
        return None
    apart = second.at - first.at
    if abs(np.cross(z1, z2) @ apart) > ALIGNED * size:
        return None
    at = first.at + (z1 @ apart) * z1      # axes are square to each other
    z2 = z2 - (z1 @ z2) * z1
    y1 = turn(z1, -first.reference) @ z2   # angle1 is 0 where the second axis lies along y of the first marker
    axes = np.column_stack([np.cross(y1, z1), y1, z1])
    between = turn(np.array([0, 0, 1.0]), first.reference) @ turn(np.array([1.0, 0, 0]), -math.pi / 2) @ turn(np.array([0, 0, 1.0]), second.reference)
    return Group("universal", at, (axes, axes @ between), pair, ["angle1", "angle2"])


def as_builder(robot: Robot) -> Builder:
    """The scene of a robot; ``robot.left_out`` grows by what it cannot hold.

    Raises
    ------
    InputError
        It has too many bodies, or a number that is none.
    """
    if len(robot.bodies) > MOST:
        raise InputError(f"convert: the robot has {len(robot.bodies)} bodies (expected {MOST} at most)")
    _require_numbers(robot)
    return SceneMaker(robot).made()


def _require_numbers(robot: Robot) -> None:
    """What overflows, or is none, is no robot."""
    def check(what: str, *values: Any) -> None:
        for value in values:
            if not np.all(np.abs(value) < LARGEST):      # nor is what is not a number
                raise InputError(f"convert: {what} has a number that is none, or above {LARGEST:g}")

    check("gravity", robot.gravity, *([] if robot.start is None else [robot.start]))
    for body in robot.bodies:
        check(f"body '{body.name[:NAME_LENGTH]}'", body.position, body.rotation, body.mass, body.cog, body.inertia, *body.markers.values())
        if np.abs(body.rotation.T @ body.rotation - np.eye(3)).max() > ALIGNED:
            raise InputError(f"convert: body '{body.name[:NAME_LENGTH]}': its attitude is not a rotation")
        for joint in body.joints:
            check(f"joint '{joint.name[:NAME_LENGTH]}'", joint.at, joint.axis, joint.reference, joint.pitch, joint.armature, joint.stiffness, joint.damping, joint.rest)
            if joint.n_dof == 1 and abs(np.linalg.norm(joint.axis) - 1) > ALIGNED:
                raise InputError(f"convert: joint '{joint.name[:NAME_LENGTH]}': its axis has no direction")
    for loop in robot.loops:
        check(f"loop '{loop.name[:NAME_LENGTH]}'", *loop.at, *loop.frames)


class SceneMaker:
    def __init__(self, robot: Robot) -> None:
        whole = without_welds(robot)
        robot.left_out[:] = whole.left_out
        self.robot, self.left_out = whole, robot.left_out
        self.size = size_of(whole)
        self.b = Builder(robot.title or None, "spatial", gravity=_numbers(robot.gravity))
        self.links: list[Link] = [self.b.frame]
        self.names = Names("frame")
        self.joint_names = Names()
        self.dof_names: list[tuple[str, str | None]] = []
        """Joint and variable, or link and component, of each freedom."""
        self.trains = self._find_trains()
        self.loop_motors: list[str] = []
        """Joints that close loops and are driven."""

    def made(self) -> Builder:
        moved = np.zeros(sum(1 for _ in self.robot.dofs())) if self.robot.start is None else self.robot.start
        moved = followed(self.robot, moved)
        place = closed(self.robot, moved, self.size)
        if place is None:
            self.left_out.append("the loops do not close near the pose that the file has: give the joints a start")
        self.moved = moved if place is None else place
        self.moved[np.abs(self.moved) < 1e-12] = 0.0
        self.lead = leading(self.robot, self.moved, self.size)
        self._settle_spins()
        self._add_links()
        self._add_tree_joints()
        self._add_loops()
        self._add_trains()
        self._add_coordinates()
        return self.b

    def _find_trains(self) -> list[Train]:
        """What couples joints; the robot keeps only couplings that a scene can have."""
        trains = []
        for coupling in self.robot.couplings:
            train = train_of(self.robot, coupling)
            if isinstance(train, Train):
                trains.append(train)
            else:
                self.left_out.append(f"joint '{coupling.follower.name}': it follows '{coupling.leader.name}' ({train})")
        self.robot.couplings = [train.coupling for train in trains]
        return trains

    def _settle_spins(self) -> None:
        """Rods between balls: the engine holds their spin, if they are bodies of revolution."""
        for k, bodies, axis, point in idle_spins(self.robot, self.moved, self.size, self.lead):
            self.lead.remove(k)
            for i in bodies:
                name = self.robot.bodies[i].name
                change = round_about(self.robot, self.moved, i, axis, point)
                if change > ROUND:
                    self.left_out.append(f"body '{name}': spins between balls and is no body of revolution: give it a universal joint at one end")
                elif change > 1e-6:
                    self.left_out.append(f"body '{name}': spins between balls; it is taken for a body of revolution, which changes its inertia by {100 * change:.2g} %")

    # ------------------------------------------------------------------------------------------------------------ parts
    def _add_links(self) -> None:
        """Bodies; where several joints move one, massless links between them."""
        self.between: list[list[Link]] = [[]]
        for name, at in self.robot.bodies[0].markers.items():
            self.b.frame.marker(Names(*self.b.frame._table.get("markers", {})).new(name.rpartition(".")[2], "M"), _numbers(at))
        pose = pose_of(self.robot, self.moved)
        for i, body in enumerate(self.robot.bodies[1:], start=1):
            name = self.names.new(body.name, "link")
            if name != body.name:
                self.left_out.append(f"body '{body.name[:NAME_LENGTH]}': it is called '{name}'")
            groups = grouped(body.joints, self.size) if body.joints[0].kind != "free" else []
            self.between.append([self.b.link(self.names.new(f"{name}_{group.name}", "part"), mass=0) for group in groups[:-1]])
            keys: dict[str, Any] = {}
            if body.mesh:
                keys = {"mesh": body.mesh[0], "mesh_unit": body.mesh[1]}
            if body.mass > 0:
                tensor = body.inertia
                keys |= {"cog": _numbers(body.cog), "inertia": _numbers(tensor[[0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]], EXACT * float(np.abs(tensor).max()))}
            elif np.any(body.inertia):
                self.left_out.append(f"body '{body.name[:NAME_LENGTH]}': its inertia, which is without mass")
            if self.robot.loops and any(i in ancestors(self.robot, end) for loop in self.robot.loops for end in loop.bodies):
                keys["start"] = {"position": _numbers(pose.position[i]), "angles": _numbers(angles_of(pose.rotation[i]))}
            link = self.b.link(name, mass=float(body.mass), **keys)
            for marker, at in body.markers.items():
                link.marker(Names(*link._table.get("markers", {})).new(marker.rpartition(".")[2], "M"), _numbers(at))
            self.links.append(link)

    def _add_tree_joints(self) -> None:
        first = 0
        for i, body in enumerate(self.robot.bodies[1:], start=1):
            if body.joints[0].kind == "free":
                if body.joints[0].stiffness or body.joints[0].damping:
                    self.left_out.append(f"joint '{body.joints[0].name}': stiffness and damping of a body that floats")
                self.dof_names += [(self.links[i].name, component) for component in ("x", "y", "z", "roll", "pitch", "yaw")]
                first += 6
                continue
            groups = grouped(body.joints, self.size)
            chain = [self.links[body.parent], *self.between[i], self.links[i]]
            for k, group in enumerate(groups):
                n = sum(joint.n_dof for joint in group.joints)
                in_parent = (body.position, body.rotation) if k == 0 else (zeros(), np.eye(3))
                name = self.joint_names.new(group.name, "J")
                if group.name not in ("", name):
                    self.left_out.append(f"joint '{group.name[:NAME_LENGTH]}': it is called '{name}'")
                self._add_joint(name, group, chain[k], chain[k + 1], in_parent, self.moved[first : first + n])
                self._add_spring(name, group)
                first += n

    def _add_joint(self, name: str, group: Group, parent: Link, child: Link, in_parent: tuple[Array, Array], moved: Array) -> None:
        """Markers on both links, and the joint between them; a slide's zero is moved along the axis by its reference."""
        p, r = in_parent
        slide = sum({"slide": 1.0, "screw": joint.pitch}.get(joint.kind, 0.0) * joint.reference for joint in group.joints)
        at = group.at - slide * group.axes[0][:, 2]
        first = self._marker(parent, name, p + r @ at, r @ group.axes[0])
        second = self._marker(child, name, group.at, group.axes[1])
        references = [joint.reference for joint in group.joints] if group.kind != "spherical" else [0.0] * 3
        values = [float(reference + way) for reference, way in zip(references, moved)]
        start: Any = None
        if any(values) and group.kind != "spherical":
            start = values[0] if len(values) == 1 else dict(zip(group.variables, values))
        keys: dict[str, Any] = {} if start is None else {"start": start}
        if group.kind == "screw":
            keys["lead"] = 2 * math.pi * group.joints[0].pitch
        getattr(self.b, group.kind)(name, first, second, **keys)
        self.dof_names += [(name, variable if len(group.variables) > 1 else None) for variable in group.variables]

    def _add_spring(self, name: str, group: Group) -> None:
        for joint, variable in zip(group.joints, group.variables):
            if joint.stiffness == 0 and joint.damping == 0:
                continue
            if joint.kind == "ball":
                self.left_out.append(f"joint '{joint.name}': stiffness and damping of a ball")
                continue
            keys: dict[str, Any] = {key: value for key, value in (("stiffness", joint.stiffness), ("damping", joint.damping), ("rest", joint.rest)) if value}
            self.b.spring(f"{name}_spring" if joint is group.joints[0] else f"{name}_spring_{variable}", joint=name,
                          variable=variable if len(group.joints) > 1 else None, **keys)

    def _add_loops(self) -> None:
        for loop in self.robot.loops:
            name = self.joint_names.new(loop.name, "loop")
            markers = [self._marker(self.links[i], name, at, axes) for i, at, axes in zip(loop.bodies, loop.at, loop.frames)]
            getattr(self.b, loop.kind)(name, *markers)
            if loop.damping:
                self.b.spring(f"{name}_spring", joint=name, damping=loop.damping)
            if loop.is_driven:
                self.loop_motors.append(name)

    def _add_trains(self) -> None:
        for train in self.trains:
            c = train.coupling
            self.left_out.append(f"joint '{c.follower.name}': it follows '{c.leader.name}' by {add_train(self, train)}, whose forces joints carry, too")

    def variable(self, joint: TreeJoint) -> float:
        """Of a hinge or slide, at the start."""
        return float(joint.reference + next(way for way, (_, other, _) in zip(self.moved, self.robot.dofs()) if other is joint))

    def add_part(self, name: str, kind: str, carrier: int, at: Array, axis: Array, start: float) -> int:
        """A massless link in a hinge or slide of a body, with that body's axes where its variable is zero; its number."""
        self.links.append(self.b.link(self.names.new(name, "part"), mass=0))
        markers = [self.marker_on(carrier, name, at, axes_about(axis)), self.marker_on(len(self.links) - 1, name, zeros(), axes_about(axis))]
        add = self.b.revolute if kind == "hinge" else self.b.prismatic
        add(self.joint_names.new(name, "J"), *markers, start=start or None)
        return len(self.links) - 1

    def marker_on(self, body: int, wanted: str, at: Array, axes: Array) -> str:
        return self._marker(self.links[body], wanted, at, axes)

    def _marker(self, link: Link, wanted: str, at: Array, axes: Array) -> str:
        """A point with axes in columns, written as short as they allow."""
        name = Names(*link._table.get("markers", {})).new(wanted.replace(".", "_"), "M")
        axis, x = _numbers(axes[:, 2]), _numbers(axes[:, 0])
        is_usual = np.abs(axes - axes_about(np.array(axis))).max() < EXACT     # as the reader will have it of these digits
        return link.marker(name, _numbers(at), axis=None if axis == [0, 0, 1] and is_usual else axis, x=None if is_usual else x)

    # ----------------------------------------------------------------------------------------------------------- what leads
    def _add_coordinates(self) -> None:
        dofs = list(self.robot.dofs())
        lead = self.lead
        pose = pose_of(self.robot, self.moved)
        told = set()
        for k in lead:
            body, joint, _ = dofs[k]
            name, variable = self.dof_names[k]
            if joint.kind != "free":
                start = float(self.moved[k] + (joint.reference if joint.kind != "ball" else 0.0))
                self.b.coordinate(name, variable=variable, start=start or None)
                continue
            if body not in told:
                told.add(body)
                own = [n for n in lead if dofs[n][0] == body]
                place = [*_numbers(pose.position[body]), *_numbers(angles_of(pose.rotation[body]))]
                if len(own) == 6:
                    self.b.coordinate(link=name, start={"position": place[:3], "angles": place[3:]})
                else:
                    words: list[Any] = [self.dof_names[n][1] for n in own]
                    start_of = dict(zip(("x", "y", "z", "roll", "pitch", "yaw"), place))
                    self.b.coordinate(link=name, components=words, start={word: start_of[word] for word in words})
        self._add_actuators(dofs, lead)

    def _add_actuators(self, dofs: list[tuple[int, TreeJoint, int]], lead: list[int]) -> None:
        """Motors; where the file has some, what leads without one gets one that has no force in forward runs."""
        some = any(joint.is_driven for _, joint, _ in dofs) or bool(self.loop_motors)
        led_by_loops = len(self.loop_motors)      # freedoms that need no motor beside those in loops
        for name in self.loop_motors:
            self.b.actuator(name)
        for k, (_, joint, _) in enumerate(dofs):
            name, variable = self.dof_names[k]
            drive: Any = {"ratio": 1, "rotor_inertia": joint.armature} if joint.armature else None
            if joint.n_dof == 1 and (joint.is_driven or (k in lead and not some)):
                self.b.actuator(name, variable=variable, drive=drive)
            elif joint.n_dof == 1 and k in lead and led_by_loops > 0:
                led_by_loops -= 1
                if joint.armature:
                    self.left_out.append(f"joint '{joint.name}': armature {joint.armature:g} kg m^2, since no motor is there")
            elif joint.n_dof == 1 and k in lead:
                self.b.actuator(name, variable=variable, law={"type": "constant", "value": 0}, drive=drive)
                self.left_out.append(f"joint '{joint.name}': has no motor and leads: an actuator of no force, of which inverse dynamics says what would hold it")
            else:
                if joint.armature:
                    self.left_out.append(f"joint '{joint.name}': armature {joint.armature:g} kg m^2, since no motor is there")
                if k in lead and joint.kind == "ball" and dofs[k - 1][1] is not joint:
                    self.left_out.append(f"joint '{joint.name}': a ball that nothing drives leads: inverse dynamics will ask for its motors")
                if k in lead and joint.kind == "free" and dofs[k - 1][1] is not joint:
                    self.left_out.append(f"joint '{joint.name}': a body that floats: inverse dynamics will ask for its motors (--hold makes it a part of the frame)")


def _numbers(values: Any, least: float = EXACT) -> list[float]:
    """Numbers of a file, without what rounding has left of zeros."""
    return [float(f"{value:.14g}") if abs(value) > least else 0.0 for value in np.asarray(values, dtype=float)]
