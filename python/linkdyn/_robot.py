"""Robots as other programs have them: a tree of bodies in a reference pose, and what closes its loops.

Readers of files make a `Robot`; `as_builder` makes a scene of it. What a scene has no place for is told, in `Robot.left_out`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ._builder import Builder, Link
from .errors import InputError

__all__ = ["Body", "Loop", "Robot", "TreeJoint", "angles_of", "as_builder", "turn"]

Array = NDArray[np.float64]
ALIGNED = 1e-9
"""Directions and places, over the size of the mechanism, that count as one."""
CLEARLY, INDEPENDENT = 0.03, 1e-7
"""Part of a column that others do not make up, above which it is one more pivot: at once, or where nothing better is."""
ROUND = 0.02
"""Part of its inertia by which a rod that may spin may differ from a body of revolution and be taken for one."""
EXACT = 1e-14
"""Directions and places [m] that differ by less are one: rounding."""
NAME_LENGTH = 64
MOST, LARGEST = 1000, 1e15
"""Bodies of a robot, and its numbers, at most."""


def zeros() -> Array:
    return np.zeros(3)


@dataclass
class TreeJoint:
    """How a body moves against its parent."""

    name: str
    kind: Literal["hinge", "slide", "screw", "ball", "free"]
    at: Array = field(default_factory=zeros)
    """A point of its axis, in the body's axes [m]."""
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    """In the body's axes."""
    reference: float = 0.0
    """Its variable in the reference pose [m, rad]; of a screw its angle."""
    pitch: float = 0.0
    """Of a screw: way over angle [m/rad]."""
    is_driven: bool = False
    armature: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    rest: float = 0.0

    @property
    def n_dof(self) -> int:
        return {"ball": 3, "free": 6}.get(self.kind, 1)


@dataclass
class Body:
    """A rigid body; one without joints is welded to its parent."""

    name: str
    parent: int
    """Number of a body before it; 0: the world."""
    position: Array = field(default_factory=zeros)
    """In the parent's axes, in the reference pose [m]."""
    rotation: Array = field(default_factory=lambda: np.eye(3))
    mass: float = 0.0
    cog: Array = field(default_factory=zeros)
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    """About the centre of mass, in the body's axes [kg m^2]."""
    joints: list[TreeJoint] = field(default_factory=list)
    markers: dict[str, Array] = field(default_factory=dict)
    """Points in the body's axes [m]."""
    mesh: tuple[str, str] | None = None
    """STL file and the unit of its coordinates."""


@dataclass
class Loop:
    """A joint that closes a loop."""

    name: str
    kind: Literal["spherical", "revolute", "prismatic", "fixed"]
    bodies: tuple[int, int]
    at: tuple[Array, Array]
    """The joint's point in the axes of both bodies [m]."""
    frames: tuple[Array, Array] = field(default_factory=lambda: (np.eye(3), np.eye(3)))
    """(3, 3) its axes, in columns, in the axes of both bodies; the last one is that of a hinge or slide."""
    is_driven: bool = False


@dataclass
class Robot:
    """A robot read from a file."""

    title: str
    gravity: Array
    bodies: list[Body]
    """The first one is the world."""
    loops: list[Loop] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    start: Array | None = None
    """How far each freedom of the tree has moved at the start from the reference pose [m, rad]; none: not at all."""

    def dofs(self) -> Iterator[tuple[int, TreeJoint, int]]:
        """Body, joint and number within the joint of each freedom of the tree."""
        for i, body in enumerate(self.bodies):
            for joint in body.joints:
                yield from ((i, joint, k) for k in range(joint.n_dof))


# ------------------------------------------------------------------------------------------------------------- rotations
def turn(axis: Array, angle: float) -> Array:
    """Rotation about an axis."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation: Array = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return rotation


def turn_by(vector: Array) -> Array:
    """Rotation by a vector, whose length is the angle."""
    angle = float(np.linalg.norm(vector))
    return turn(vector, angle) if angle > 0 else np.eye(3)


def angles_of(rotation: Array) -> list[float]:
    """Roll, pitch and yaw of a scene file: Rx(roll) Ry(pitch) Rz(yaw)."""
    r = rotation
    return [math.atan2(-r[1, 2], r[2, 2]), math.atan2(r[0, 2], math.hypot(r[0, 0], r[0, 1])), math.atan2(-r[0, 1], r[0, 0])]


def across(axis: Array) -> Array:
    """A direction square to an axis: that of x, if it may be."""
    axis = axis / np.linalg.norm(axis)
    rest = np.eye(3)[0 if abs(axis[0]) < 0.9 else 1]
    rest = rest - (rest @ axis) * axis
    found: Array = rest / np.linalg.norm(rest)
    return found


def axes_about(axis: Array) -> Array:
    """Axes in columns, the last one given, and x as a scene file has it where it is left out: turned the shortest way."""
    z = axis / np.linalg.norm(axis)
    if z[2] < -0.99:
        x = across(z)
    else:
        x = np.array([1.0, 0, 0]) - z[0] / (1 + z[2]) * np.array([z[0], z[1], 1 + z[2]])
    return np.column_stack([x, np.cross(z, x), z])


# ------------------------------------------------------------------------------------------------------- the tree in motion
@dataclass
class Pose:
    """Where the bodies are, and how each freedom of the tree would move what hangs on it."""

    position: list[Array]
    rotation: list[Array]
    lines: list[tuple[int, float, float, Array, Array]]
    """Body, how much it turns and goes, direction and point, for each freedom."""


def pose_of(robot: Robot, moved: Array) -> Pose:
    """The bodies after some motion from the reference pose: one number a freedom [m, rad]."""
    positions, rotations, lines = [zeros()], [np.eye(3)], []
    steps = iter(moved)
    for i, body in enumerate(robot.bodies[1:], start=1):
        p = positions[body.parent] + rotations[body.parent] @ body.position
        r = rotations[body.parent] @ body.rotation
        for joint in body.joints:
            point, axis = p + r @ joint.at, r @ joint.axis
            if joint.kind in ("hinge", "screw"):
                angle = next(steps)
                r = turn(axis, angle) @ r
                p = point - r @ joint.at + joint.pitch * angle * axis
                lines.append((i, 1.0, joint.pitch, axis, point))
            elif joint.kind == "slide":
                p = p + axis * next(steps)
                lines.append((i, 0.0, 1.0, axis, point))
            else:
                if joint.kind == "free":
                    lines += [(i, 0.0, 1.0, np.eye(3)[k], point) for k in range(3)]
                    p = p + np.array([next(steps) for _ in range(3)])
                    point = p + r @ joint.at
                axes = np.eye(3) if joint.kind == "free" else r
                r = turn_by(axes @ np.array([next(steps) for _ in range(3)])) @ r
                p = point - r @ joint.at
                axes = np.eye(3) if joint.kind == "free" else r      # a rod's line stays one of them
                lines += [(i, 1.0, 0.0, axes[:, k], point) for k in range(3)]
        positions.append(p)
        rotations.append(r)
    return Pose(positions, rotations, lines)


def gaps(robot: Robot, pose: Pose, size: float) -> tuple[Array, Array]:
    """How far the loops gape (n,), and what each freedom does about it (n, freedoms); lengths over the size of the mechanism."""
    if not robot.loops:
        return np.zeros(0), np.zeros((0, len(pose.lines)))
    carriers = [ancestors(robot, i) for i in range(len(robot.bodies))]
    values, rows = [], []
    for loop in robot.loops:
        point = [pose.position[i] + pose.rotation[i] @ at for i, at in zip(loop.bodies, loop.at)]
        frame = [pose.rotation[i] @ axes for i, axes in zip(loop.bodies, loop.frames)]
        way, turning = np.zeros((3, len(pose.lines))), np.zeros((3, len(pose.lines)))
        along = np.zeros((3, len(pose.lines)))      # the way that the first body's own turning takes its axes
        for k, (body, turns, goes, axis, at) in enumerate(pose.lines):
            for sign, end in ((-1, 0), (1, 1)):
                if body in carriers[loop.bodies[end]]:
                    way[:, k] += sign * (turns * np.cross(axis, point[end] - at) + goes * axis)
                    turning[:, k] += sign * turns * axis
                    if end == 0:
                        along[:, k] = turns * axis
        apart, (first, second) = point[1] - point[0], frame
        if loop.kind == "prismatic":
            for c in (0, 1):
                u = first[:, c]
                values.append(u @ apart / size)
                rows.append((u @ way + np.cross(u, apart) @ along) / size)
        else:
            values += list(apart / size)
            rows += list(way / size)
        pairs = {"spherical": (), "revolute": ((2, 0), (2, 1)), "prismatic": ((2, 0), (2, 1), (0, 1)), "fixed": ((2, 0), (2, 1), (0, 1))}[loop.kind]
        for of_second, of_first in pairs:
            a, b = second[:, of_second], first[:, of_first]
            values.append(a @ b)
            rows.append(np.cross(a, b) @ turning)
    return np.array(values), np.array(rows).reshape(len(values), len(pose.lines))


def ancestors(robot: Robot, body: int) -> set[int]:
    """The bodies that a body hangs on, itself among them."""
    found = {body}
    while body != 0:
        body = robot.bodies[body].parent
        found.add(body)
    return found


def closed(robot: Robot, moved: Array, size: float) -> Array | None:
    """The tree moved on until its loops close, by Newton's steps; None if they do not."""
    for _ in range(50):
        values, rows = gaps(robot, pose_of(robot, moved), size)
        if len(values) == 0 or np.abs(values).max() < 1e-13:
            return moved
        step = np.linalg.lstsq(rows, values, rcond=1e-10)[0]
        moved = moved - step * min(1.0, 0.5 / max(np.abs(step).max(), 1e-300))
        if np.abs(step).max() < 1e-14 and np.abs(values).max() < 1e-9:
            return moved
    return moved if np.abs(values).max() < 1e-9 else None


def size_of(robot: Robot) -> float:
    """A length of the mechanism [m]."""
    return max((float(np.abs(body.position).max()) for body in robot.bodies), default=0.0) or 1.0


def leading(robot: Robot, moved: Array, size: float) -> list[int]:
    """Freedoms of the tree that lead the others by way of the loops: driven ones first, then those next to the world."""
    dofs = list(robot.dofs())
    if not robot.loops:
        return list(range(len(dofs)))
    near = np.random.default_rng(1).uniform(-0.05, 0.05, len(dofs))        # off dead points
    place = closed(robot, moved + near, size)
    _, rows = gaps(robot, pose_of(robot, moved if place is None else place), size)

    def last_to_lead(k: int) -> tuple[bool, bool, int]:
        _, joint, _ = dofs[k]
        return joint.is_driven, joint.n_dof == 1, -k

    led: set[int] = set()
    columns = rows / (float(np.abs(rows).max()) or 1.0)
    order = sorted(range(len(dofs)), key=last_to_lead)
    for least in CLEARLY, INDEPENDENT:       # what others nearly make up is led only if nothing better is
        for k in order:
            if k not in led and (left := float(np.linalg.norm(columns[:, k]))) > least:
                led.add(k)
                direction = columns[:, k] / left
                for _ in range(2):
                    columns = columns - np.outer(direction, direction @ columns)
    return [k for k in range(len(dofs)) if k not in led]


def idle_spins(robot: Robot, moved: Array, size: float, lead: list[int]) -> list[tuple[int, list[int], Array, Array]]:
    """Leading freedoms in which bodies between balls turn about their own line, and nothing else moves.

    Returns
    -------
    list
        The freedom, its bodies, and direction and a point of the line in the world.
    """
    pose = pose_of(robot, moved)
    _, rows = gaps(robot, pose, size)
    n = len(pose.lines)
    others = [k for k in range(n) if k not in lead]
    carriers = [ancestors(robot, i) for i in range(len(robot.bodies))]
    found = []
    for k in lead:
        if not robot.loops or list(robot.dofs())[k][1].kind != "ball":
            continue
        rates = np.zeros(n)
        rates[k] = 1.0
        rates[others] = -np.linalg.lstsq(rows[:, others], rows[:, k], rcond=1e-10)[0]
        twists = []
        for i in range(len(robot.bodies)):
            spin, way = np.zeros(3), np.zeros(3)     # of the point that lies in the world's origin
            for rate, (body, turns, goes, axis, at) in zip(rates, pose.lines):
                if body in carriers[i]:
                    spin = spin + rate * turns * axis
                    way = way + rate * (turns * np.cross(at, axis) + goes * axis)
            twists.append(np.concatenate([spin, way / size]))
        scale = max(float(np.abs(twist).max()) for twist in twists)
        moving = [i for i, twist in enumerate(twists) if np.abs(twist).max() > 1e-6 * scale]
        same = all(np.abs(twists[i] - twists[moving[0]]).max() < 1e-6 * scale for i in moving)
        if same and _hangs_on_balls(robot, moving):
            spin, way = twists[moving[0]][:3], size * twists[moving[0]][3:]
            found.append((k, moving, spin / np.linalg.norm(spin), np.cross(spin, way) / (spin @ spin)))
    return found


def _hangs_on_balls(robot: Robot, bodies: list[int]) -> bool:
    """Is all that holds these bodies a ball?"""
    holds = [[joint.kind for joint in body.joints] for i, body in enumerate(robot.bodies) if i > 0 and (i in bodies) != (body.parent in bodies)]
    closing = [loop.kind for loop in robot.loops if (loop.bodies[0] in bodies) != (loop.bodies[1] in bodies)]
    return all(kinds == ["ball"] for kinds in holds) and all(kind == "spherical" for kind in closing)


def round_about(robot: Robot, moved: Array, body: int, axis: Array, point: Array) -> float:
    """Make a body one of revolution about a line; the largest change, as a part of its moments of inertia (a first moment over its arm)."""
    pose = pose_of(robot, moved)
    own = robot.bodies[body]
    z = pose.rotation[body].T @ axis
    at = pose.rotation[body].T @ (point - pose.position[body])
    off = own.cog - at
    off = off - (off @ z) * z
    frame = axes_about(z)
    tensor = frame.T @ own.inertia @ frame
    mean = 0.5 * (tensor[0, 0] + tensor[1, 1])
    even = np.diag([mean, mean, tensor[2, 2]])
    arm = math.sqrt(mean / own.mass) if own.mass > 0 and mean > 0 else 1.0
    change = max(float(np.abs(even - tensor).max()) / mean if mean > 0 else 0.0, float(np.linalg.norm(off)) / arm)
    if change <= ROUND:
        own.inertia = frame @ even @ frame.T
        own.cog = own.cog - off
    return change


# ---------------------------------------------------------------------------------------------------------- bodies that are one
def held(robot: Robot) -> Robot:
    """Bodies that float stand still where they start."""
    dofs = list(robot.dofs())
    moved = np.zeros(len(dofs)) if robot.start is None else robot.start
    floats = {i for i, joint, _ in dofs if joint.kind == "free"}
    pose = pose_of(robot, moved)
    bodies = [replace(body, parent=0, position=pose.position[i], rotation=pose.rotation[i], joints=[]) if i in floats else body
              for i, body in enumerate(robot.bodies)]
    left_out = [*robot.left_out, *(f"body '{robot.bodies[i].name}': it would float, and is a part of the frame" for i in sorted(floats))]
    return replace(robot, bodies=bodies, start=moved[[joint.kind != "free" for _, joint, _ in dofs]], left_out=left_out)


def without_welds(robot: Robot) -> Robot:
    """Bodies that do not move against their parents become parts of them."""
    home = [0]
    frames: list[tuple[Array, Array]] = [(zeros(), np.eye(3))]
    bodies = [replace(robot.bodies[0], markers=dict(robot.bodies[0].markers))]
    left_out = list(robot.left_out)
    for body in robot.bodies[1:]:
        p, r = frames[body.parent]
        position, rotation = p + r @ body.position, r @ body.rotation
        if body.joints:
            home.append(len(bodies))
            frames.append((zeros(), np.eye(3)))
            bodies.append(replace(body, parent=home[body.parent], position=position, rotation=rotation, markers=dict(body.markers)))
            continue
        home.append(home[body.parent])
        frames.append((position, rotation))
        owner = bodies[home[-1]]
        for name, at in body.markers.items():
            owner.markers[name if name not in owner.markers else f"{body.name}_{name}"] = position + rotation @ at
        if home[-1] == 0:
            continue
        if body.mass > 0:
            left_out.append(f"body '{body.name}': does not move against '{owner.name}', and is a part of it (its mass, too)")
        add_mass(owner, body.mass, position + rotation @ body.cog, rotation @ body.inertia @ rotation.T)
    loops = []
    for loop in robot.loops:
        ends = [frames[i] for i in loop.bodies]
        points = [p + r @ point for (p, r), point in zip(ends, loop.at)]
        axes = [r @ frame for (_, r), frame in zip(ends, loop.frames)]
        first, second = (home[i] for i in loop.bodies)
        if first == second:
            left_out.append(f"loop '{loop.name}': both its bodies are one")
            continue
        loops.append(replace(loop, bodies=(first, second), at=(points[0], points[1]), frames=(axes[0], axes[1])))
    return replace(robot, bodies=bodies, loops=loops, left_out=left_out)


def add_mass(body: Body, mass: float, cog: Array, inertia: Array) -> None:
    """Put a mass on a body."""
    total = body.mass + mass
    if total == 0:
        return
    middle = (body.mass * body.cog + mass * cog) / total
    body.inertia = body.inertia + inertia
    for part, at in ((body.mass, body.cog - middle), (mass, cog - middle)):
        body.inertia = body.inertia + part * ((at @ at) * np.eye(3) - np.outer(at, at))
    body.mass, body.cog = total, middle


# -------------------------------------------------------------------------------------------------------------- as a scene
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
            group = _cylindrical(pair, size)
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


def _cylindrical(pair: list[TreeJoint], size: float) -> Group | None:
    hinge, slide = sorted(pair, key=lambda joint: joint.kind)
    if np.linalg.norm(hinge.axis - slide.axis) > ALIGNED:
        return None
    axes = axes_about(hinge.axis)
    return Group("cylindrical", hinge.at, (axes, turn(hinge.axis, hinge.reference) @ axes), pair,
                 ["angle" if joint is hinge else "slide" for joint in pair])


def _universal(pair: list[TreeJoint], size: float) -> Group | None:
    first, second = pair
    z1, z2 = first.axis, second.axis
    if abs(z1 @ z2) > ALIGNED:
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
    return _SceneMaker(robot).made()


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
            raise InputError(f"convert: body '{body.name[:NAME_LENGTH]}': its attitude is no rotation")
        for joint in body.joints:
            check(f"joint '{joint.name[:NAME_LENGTH]}'", joint.at, joint.axis, joint.reference, joint.pitch, joint.armature, joint.stiffness, joint.damping, joint.rest)
            if joint.n_dof == 1 and abs(np.linalg.norm(joint.axis) - 1) > ALIGNED:
                raise InputError(f"convert: joint '{joint.name[:NAME_LENGTH]}': its axis has no direction")
    for loop in robot.loops:
        check(f"loop '{loop.name[:NAME_LENGTH]}'", *loop.at, *loop.frames)


class _SceneMaker:
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

    def made(self) -> Builder:
        moved = np.zeros(sum(1 for _ in self.robot.dofs())) if self.robot.start is None else self.robot.start
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
        self._add_coordinates()
        return self.b

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
                self.dof_names += [(self.links[i].name, component) for component in ("x", "y", "z", "roll", "pitch", "yaw")]
                first += 6
                continue
            groups = grouped(body.joints, self.size)
            chain = [self.links[body.parent], *self.between[i], self.links[i]]
            for k, group in enumerate(groups):
                n = sum(joint.n_dof for joint in group.joints)
                in_parent = (body.position, body.rotation) if k == 0 else (zeros(), np.eye(3))
                name = self.joint_names.new(group.name, "J")
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

    def _marker(self, link: Link, wanted: str, at: Array, axes: Array) -> str:
        """A point with axes in columns, written as short as they allow."""
        name = Names(*link._table.get("markers", {})).new(wanted.replace(".", "_"), "M")
        axis, x = _numbers(axes[:, 2]), _numbers(axes[:, 0])
        is_usual = np.abs(axes - axes_about(axes[:, 2])).max() < EXACT
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
        some = any(joint.is_driven for _, joint, _ in dofs)
        for k, (_, joint, _) in enumerate(dofs):
            name, variable = self.dof_names[k]
            drive: Any = {"ratio": 1, "rotor_inertia": joint.armature} if joint.armature else None
            if joint.n_dof == 1 and (joint.is_driven or (k in lead and not some)):
                self.b.actuator(name, variable=variable, drive=drive)
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
