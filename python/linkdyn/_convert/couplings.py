"""Joints that follow other joints: belts, racks and pinions that do it.

Both joints move in one link, the *carrier*: two of its children, or a child and its parent as seen from it. Hinges along each other
take a belt, a hinge and a slide across it are wheel and rack, two slides have a pinion between them, other hinges a rack.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from .robot import ALIGNED, Array, Coupling, Robot, TreeJoint, across, ancestors, axes_about

if TYPE_CHECKING:
    from .robot_scene import SceneMaker

__all__ = ["Train", "add_train", "train_of"]

PART = 0.1
"""Of the mechanism's size: radii that nothing else says."""


@dataclass
class Side:
    """What a joint moves, as it is seen from the carrier."""

    joint: TreeJoint
    body: int
    """The one that moves in the carrier."""
    sense: int
    """1: the joint's variable is its motion in the carrier; -1: its opposite."""
    point: Array
    """Of the axis; carrier axes."""
    axis: Array
    position: Array
    """Of the body in the carrier, and its axes, in the reference pose."""
    rotation: Array

    def place(self, at: Array) -> Array:
        """A point that is given in the carrier, in the body's axes."""
        return self.rotation.T @ (at - self.position)


@dataclass
class Train:
    """A coupling that a scene can have."""

    coupling: Coupling
    carrier: int
    leader: Side
    follower: Side

    @property
    def kinds(self) -> tuple[str, str]:
        return self.leader.joint.kind, self.follower.joint.kind

    @property
    def distance(self) -> Array:
        """From the leader's axis to the follower's, square to the former."""
        n, way = self.leader.axis, self.follower.point - self.leader.point
        return way - (way @ n) * n


def train_of(robot: Robot, coupling: Coupling) -> Train | str:
    """How both joints lie, or why nothing can be put between them."""
    numbers = {id(body.joints[0]): i for i, body in enumerate(robot.bodies) if len(body.joints) == 1}
    first, second = numbers.get(id(coupling.leader)), numbers.get(id(coupling.follower))
    if first is None or second is None or {coupling.leader.kind, coupling.follower.kind} - {"hinge", "slide"}:
        return "both have to be hinges or slides"
    if any(second in ancestors(robot, end) for loop in robot.loops for end in loop.bodies):
        return "a loop leads it"
    if coupling.ratio == 0:
        return "its multiplier is 0"
    parents = robot.bodies[first].parent, robot.bodies[second].parent
    if parents[0] == parents[1]:
        train = Train(coupling, parents[0], _child(robot, first), _child(robot, second))
    elif parents[1] == first:
        train = Train(coupling, first, _parent(robot, first), _child(robot, second))
    elif parents[0] == second:
        train = Train(coupling, second, _child(robot, first), _parent(robot, second))
    else:
        return "no link holds both joints: a gear, or links that do it, say it"
    if len(set(train.kinds)) == 2 and abs(train.leader.axis @ train.follower.axis) > ALIGNED:
        return "a slide that is not square to a hinge"
    return train


def _child(robot: Robot, i: int) -> Side:
    body = robot.bodies[i]
    joint = body.joints[0]
    return Side(joint, i, 1, body.position + body.rotation @ joint.at, body.rotation @ joint.axis, body.position, body.rotation)


def _parent(robot: Robot, i: int) -> Side:
    body = robot.bodies[i]
    joint = body.joints[0]
    return Side(joint, body.parent, -1, joint.at, joint.axis, -body.rotation.T @ body.position, body.rotation.T)


def add_train(maker: SceneMaker, train: Train) -> str:
    """Put it into the scene; its name in words."""
    parallel = float(np.abs(np.cross(train.leader.axis, train.follower.axis)).max()) <= ALIGNED
    match train.kinds:
        case "hinge", "hinge" if parallel and np.linalg.norm(train.distance) > ALIGNED * maker.size:
            _add_belt(maker, train)
            return "a belt"
        case "hinge", "hinge":
            _add_rack_between(maker, train)
            return "a massless rack between them"
        case "slide", "slide":
            _add_pinion_between(maker, train)
            return "a massless pinion between them"
        case "hinge", "slide":
            _add_rack(maker, train, train.leader, train.follower, train.coupling.ratio, train.coupling.offset)
        case _:
            c = train.coupling
            _add_rack(maker, train, train.follower, train.leader, 1 / c.ratio, -c.offset / c.ratio)
    return "wheel and rack"


def _add_belt(maker: SceneMaker, train: Train) -> None:
    """Wheels in one plane, that have room beside each other."""
    first, second, ratio = train.leader, train.follower, train.coupling.ratio
    r2 = float(np.linalg.norm(train.distance)) / (2 * (1 + abs(ratio)))
    same_way = ratio * first.sense * second.sense * (first.axis @ second.axis) > 0
    ends = [maker.marker_on(side.body, _name(train), side.place(at), axes_about(side.rotation.T @ side.axis))
            for side, at in ((first, first.point), (second, first.point + train.distance))]
    maker.b.belt(maker.joint_names.new(_name(train), "belt"), *ends, radii=[abs(ratio) * r2, r2], run=None if same_way else "crossed",
                 phase=second.sense * train.coupling.offset or None)


def _add_rack(maker: SceneMaker, train: Train, wheel: Side, rack: Side, ratio: float, phase: float) -> None:
    """A rack that goes by `ratio` a radian of its wheel [m/rad], and stands at `phase` where that stands at zero."""
    radius = ratio * wheel.sense * rack.sense * np.cross(rack.axis, wheel.axis)
    ends = [maker.marker_on(side.body, _name(train), side.place(at), axes_about(side.rotation.T @ side.axis))
            for side, at in ((wheel, wheel.point), (rack, wheel.point + radius))]
    maker.b.rack(maker.joint_names.new(_name(train), "rack"), *ends, phase=rack.sense * phase or None)


def _add_rack_between(maker: SceneMaker, train: Train) -> None:
    """A rack that both wheels move."""
    first, second, c = train.leader, train.follower, train.coupling
    way = PART * maker.size / (1 + 1 / abs(c.ratio))      # for a radian of the leader
    rack = _add_part(maker, train, "slide", way * maker.variable(c.leader))
    _add_rack(maker, train, first, rack, way, 0.0)
    _add_rack(maker, train, second, rack, way / c.ratio, -way * c.offset / c.ratio)


def _add_pinion_between(maker: SceneMaker, train: Train) -> None:
    """A pinion, stepped if need be, that both slides turn."""
    first, second, c = train.leader, train.follower, train.coupling
    radius = PART * maker.size / (1 + abs(c.ratio))       # where the leader goes along it
    pinion = _add_part(maker, train, "hinge", maker.variable(c.leader) / radius)
    _add_rack(maker, train, pinion, first, radius, 0.0)
    _add_rack(maker, train, pinion, second, radius * c.ratio, c.offset)


def _add_part(maker: SceneMaker, train: Train, kind: Literal["hinge", "slide"], start: float) -> Side:
    """A massless link that turns about, or slides along, what is square to both joints; its axes are the carrier's, at the leader's axis."""
    square = np.cross(train.leader.axis, train.follower.axis)
    length = float(np.linalg.norm(square))
    axis = square / length if length > ALIGNED else across(train.leader.axis)
    name = f"{train.coupling.follower.name}_{'pinion' if kind == 'hinge' else 'rack'}"
    body = maker.add_part(name, kind, train.carrier, train.leader.point, axis, start)
    return Side(TreeJoint(name, kind, axis=axis), body, 1, train.leader.point, axis, train.leader.point, np.eye(3))


def _name(train: Train) -> str:
    return f"{train.coupling.follower.name}_mimic"
