"""Robots as other programs have them: a tree of bodies in a reference pose, and what closes its loops.

Readers of files make a `Robot`, `robot_scene` a scene of it. What a scene has no place for is told, in `Robot.left_out`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "ALIGNED", "EXACT", "ROUND", "Array", "Body", "Coupling", "Loop", "Robot", "TreeJoint", "ancestors", "angles_of", "axes_about", "closed", "followed", "gaps", "held", "idle_spins",
    "leading", "pose_of", "round_about", "size_of", "turn", "without_welds", "zeros",
]  # fmt: skip

Array = NDArray[np.float64]
ALIGNED = 1e-9
"""Directions and places, over the size of the mechanism, that count as one."""
CLEARLY, INDEPENDENT = 0.03, 1e-7
"""Part of a column that others do not make up, above which it is one more pivot: at once, or where nothing better is."""
ROUND = 0.02
"""Part of its inertia by which a rod that may spin may differ from a body of revolution and be taken for one."""
EXACT = 1e-14
"""Directions and places [m] that differ by less are one: rounding."""


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
    """STL or GLB file and the unit of its coordinates."""


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
    damping: float = 0.0


@dataclass
class Coupling:
    """A joint that follows another one: its variable is `ratio` times the other's, and `offset`."""

    leader: TreeJoint
    follower: TreeJoint
    ratio: float = 1.0
    offset: float = 0.0


@dataclass
class Robot:
    """A robot read from a file."""

    title: str
    gravity: Array
    bodies: list[Body]
    """The first one is the world."""
    loops: list[Loop] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
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
    x, square = np.array([1.0, 0, 0]), z[0] ** 2 + z[1] ** 2
    if square > 0:
        part = 1 / (1 + z[2]) if z[2] > 0 else (1 - z[2]) / square     # 1/(1 + z), also near -1
        x = x - z[0] * part * np.array([z[0], z[1], 0]) - np.array([0, 0, z[0]])
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


# ------------------------------------------------------------------------------------------------------- the tree in motion
@dataclass
class Pose:
    """Where the bodies are, and how each freedom of the tree would move what hangs on it."""

    position: list[Array]
    rotation: list[Array]
    lines: list[tuple[int, float, float, Array, Array]]
    """Body, how much it turns and goes, direction and point, for each freedom."""
    moved: Array


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
    return Pose(positions, rotations, lines, moved)


def gaps(robot: Robot, pose: Pose, size: float) -> tuple[Array, Array]:
    """How far loops gape and followers are off (n,), and what each freedom does about it (n, freedoms); lengths over the size of the mechanism."""
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
    numbers = {id(joint): k for k, (_, joint, _) in enumerate(robot.dofs())}
    for pair in robot.couplings:
        row, scale = np.zeros(len(pose.lines)), size if pair.follower.kind == "slide" else 1.0
        row[numbers[id(pair.follower)]], row[numbers[id(pair.leader)]] = 1 / scale, -pair.ratio / scale
        rows.append(row)
        values.append(row @ pose.moved + (pair.follower.reference - pair.ratio * pair.leader.reference - pair.offset) / scale)
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


def followed(robot: Robot, moved: Array) -> Array:
    """The tree moved on until followers stand where their leaders say, which stay."""
    numbers = {id(joint): k for k, (_, joint, _) in enumerate(robot.dofs())}
    moved = moved.copy()
    for _ in robot.couplings:       # leaders may be followers themselves
        for c in robot.couplings:
            leads, follows = numbers[id(c.leader)], numbers[id(c.follower)]
            moved[follows] = c.ratio * (moved[leads] + c.leader.reference) + c.offset - c.follower.reference
    return moved


def size_of(robot: Robot) -> float:
    """A length of the mechanism [m]."""
    return max((float(np.abs(body.position).max()) for body in robot.bodies), default=0.0) or 1.0


def leading(robot: Robot, moved: Array, size: float) -> list[int]:
    """Freedoms of the tree that lead the others by way of loops and couplings: driven ones first, then those next to the world."""
    dofs = list(robot.dofs())
    if not robot.loops and not robot.couplings:
        return list(range(len(dofs)))
    near = np.random.default_rng(1).uniform(-0.05, 0.05, len(dofs))        # off dead points
    place = closed(robot, moved + near, size)
    _, rows = gaps(robot, pose_of(robot, moved if place is None else place), size)

    followers = {id(coupling.follower) for coupling in robot.couplings}

    def last_to_lead(k: int) -> tuple[bool, bool, bool, int]:
        _, joint, _ = dofs[k]
        return joint.is_driven, id(joint) not in followers, joint.n_dof == 1, -k

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
