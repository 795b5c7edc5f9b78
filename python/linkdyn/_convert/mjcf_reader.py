"""MJCF by MuJoCo's own reader, which knows defaults, classes, frames, and inertia of shapes."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, UnavailableError
from .robot import Array, Body, Coupling, Loop, Robot, TreeJoint, axes_about

__all__ = ["read_mjcf"]


def read_mjcf(path: Path) -> Robot:
    """A robot of an MJCF file that has been looked through (`xml_file`).

    Raises
    ------
    UnavailableError
        MuJoCo is not installed.
    InputError
        MuJoCo refuses the file.
    """
    try:
        import mujoco
    except ImportError as error:
        raise UnavailableError.of("convert: MJCF is read by MuJoCo", "mujoco", "mujoco", error) from None
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(f"{path}: MuJoCo refuses it: {' '.join(str(error).split())[:300]}") from None
    return _Reader(mujoco, model, path).robot()


class _Reader:
    def __init__(self, mujoco: Any, model: Any, path: Path) -> None:
        self.mujoco, self.model, self.path = mujoco, model, path
        self.left_out: list[str] = []
        self.threads: dict[str, str] = {}
        """Of each screw the name of its hinge."""
        self.pairs: list[int] = []
        """Equalities of two joints that are no thread."""

    def robot(self) -> Robot:
        m = self.model
        bodies = [self._body(i) for i in range(m.nbody)]
        for i in range(m.nsite):
            bodies[m.site_bodyid[i]].markers[self._name("SITE", i, f"site{i}")] = np.array(m.site_pos[i])
        self._motors(bodies)
        robot = Robot(self._title(), np.zeros(3) if self._lacks("GRAVITY") else np.array(m.opt.gravity), bodies)
        robot.loops = self._loops(bodies)
        if self._lacks("EQUALITY") or self._lacks("CONSTRAINT"):
            self.left_out += [f"equality '{loop.name}': the file disables it" for loop in robot.loops]
            robot.loops = []
        else:
            robot.couplings = self._couplings(bodies)
        if m.nkey:
            robot.start = self._keyframe(robot)
        self._tell_the_rest()
        robot.left_out = self.left_out
        return robot

    def _lacks(self, *words: str) -> bool:
        """Does the file disable this, by one of the names that it had in MuJoCo's versions?"""
        bits = [int(getattr(self.mujoco.mjtDisableBit, f"mjDSBL_{word}", 0)) for word in words]
        return any(int(self.model.opt.disableflags) & bit for bit in bits)

    def _title(self) -> str:
        names: bytes = self.model.names
        return names[: names.index(b"\0")].decode(errors="replace") or self.path.stem

    def _name(self, kind: str, number: int, default: str) -> str:
        found = self.mujoco.mj_id2name(self.model, getattr(self.mujoco.mjtObj, f"mjOBJ_{kind}"), number)
        return str(found) if found else default

    def _rotation(self, quaternion: Array) -> Array:
        flat = np.zeros(9)
        self.mujoco.mju_quat2Mat(flat, np.array(quaternion, dtype=float))
        return flat.reshape(3, 3)

    def _body(self, i: int) -> Body:
        m = self.model
        if i == 0:
            return Body("world", 0)
        axes = self._rotation(m.body_iquat[i])
        body = Body(
            self._name("BODY", i, f"body{i}"), int(m.body_parentid[i]), np.array(m.body_pos[i]), self._rotation(m.body_quat[i]),
            float(m.body_mass[i]), np.array(m.body_ipos[i]), axes @ np.diag(m.body_inertia[i]) @ axes.T,
        )  # fmt: skip
        body.joints = [self._joint(j) for j in range(m.body_jntadr[i], m.body_jntadr[i] + m.body_jntnum[i])]
        if m.body_mocapid[i] >= 0:
            self.left_out.append(f"body '{body.name}': moved by hand (mocap); it stands still")
        return body

    def _joint_name(self, j: int) -> str:
        return self._name("JOINT", j, f"{self._name('BODY', int(self.model.jnt_bodyid[j]), 'body')}_{j}")

    def _joint(self, j: int) -> TreeJoint:
        m = self.model
        kind = {0: "free", 1: "ball", 2: "slide", 3: "hinge"}[int(m.jnt_type[j])]
        joint = TreeJoint(self._joint_name(j), kind, np.array(m.jnt_pos[j]), np.array(m.jnt_axis[j]))  # type: ignore[arg-type]
        dof, place = int(m.jnt_dofadr[j]), int(m.jnt_qposadr[j])
        if kind in ("hinge", "slide"):
            joint.reference = float(m.qpos0[place])
            joint.rest = float(m.qpos_spring[place])
        stiffness = np.atleast_1d(np.asarray(m.jnt_stiffness[j], dtype=float)) * (not self._lacks("SPRING", "PASSIVE"))
        damping = np.atleast_1d(np.asarray(m.dof_damping[dof], dtype=float)) * (not self._lacks("DAMPER", "PASSIVE"))
        joint.stiffness, joint.damping, joint.armature = float(stiffness[0]), float(damping[0]), float(m.dof_armature[dof])
        for name, more in (("stiffness", stiffness[1:]), ("damping", damping[1:])):
            if np.any(more):
                self.left_out.append(f"joint '{joint.name}': {name} beyond its linear part")
        if m.dof_frictionloss[dof]:
            self.left_out.append(f"joint '{joint.name}': friction {m.dof_frictionloss[dof]:g} (a [[friction]] or a spring's force says it)")
        if m.jnt_limited[j] and kind == "ball":
            self.left_out.append(f"joint '{joint.name}': range to {m.jnt_range[j][1]:.6g} rad (a [[stop]] of a tilt says it)")
        if m.jnt_limited[j] and kind in ("hinge", "slide"):
            low, high = m.jnt_range[j]
            self.left_out.append(f"joint '{joint.name}': range {low:.6g} to {high:.6g} {'rad' if kind == 'hinge' else 'm'} (a [[stop]] says it)")
        return joint

    def _keyframe(self, robot: Robot) -> Array:
        """The first keyframe, from the reference pose on."""
        m = self.model
        self.left_out.append(f"keyframe '{self._name('KEY', 0, 'key0')}' is the start" + (f"; {m.nkey - 1} more" if m.nkey > 1 else ""))
        if np.any(m.key_qvel[0]):
            self.left_out.append("velocities of the keyframe: the scene starts at rest")
        key = np.array(m.key_qpos[0])
        steps: dict[str, list[float]] = {}
        for j in range(m.njnt):
            at, name = int(m.jnt_qposadr[j]), self._joint_name(j)
            if m.jnt_type[j] == 0:
                reference = self._rotation(m.qpos0[at + 3 : at + 7])
                turned = np.zeros(4)
                self.mujoco.mju_mat2Quat(turned, (self._rotation(key[at + 3 : at + 7]) @ reference.T).reshape(-1))
                steps[name] = [*(key[at : at + 3] - m.qpos0[at : at + 3]), *self._vector(turned)]
            elif m.jnt_type[j] == 1:
                steps[name] = list(self._vector(key[at : at + 4]))
            else:
                steps[name] = [key[at] - m.qpos0[at]]
        joints = [joint for body in robot.bodies for joint in body.joints]
        return np.array([step for joint in joints for step in steps[self.threads.get(joint.name, joint.name)]], dtype=float)

    def _vector(self, quaternion: Array) -> Array:
        """Axis times angle of a rotation."""
        found = np.zeros(3)
        self.mujoco.mju_quat2Vel(found, quaternion / np.linalg.norm(quaternion), 1.0)
        return found

    def _motors(self, bodies: list[Body]) -> None:
        m, kinds = self.model, self.mujoco.mjtTrn
        joints = {joint.name: joint for body in bodies for joint in body.joints}
        for i in range(m.nu):
            name = self._name("ACTUATOR", i, f"actuator{i}")
            joint = None
            if int(m.actuator_trntype[i]) in (int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT)):
                j = int(m.actuator_trnid[i][0])
                joint = joints.get(self._joint_name(j))
            if joint is None or joint.kind not in ("hinge", "slide"):
                self.left_out.append(f"actuator '{name}': it drives no hinge or slide")
                continue
            joint.is_driven = True
            gear = float(m.actuator_gear[i][0])
            if gear != 1 or m.actuator_biastype[i] or m.actuator_dyntype[i] or m.actuator_gainprm[i][0] != 1:
                self.left_out.append(f"actuator '{name}': its gear {gear:g}, gains and limits; the joint is driven, by a force that inverse dynamics finds")

    def _loops(self, bodies: list[Body]) -> list[Loop]:
        m, kinds = self.model, self.mujoco.mjtEq
        loops: list[Loop] = []
        points: dict[tuple[int, int], list[tuple[str, Array, Array]]] = {}
        for i in range(m.neq):
            name = self._name("EQUALITY", i, f"loop{i + 1}")
            kind = int(m.eq_type[i])
            if not m.eq_active0[i]:
                self.left_out.append(f"equality '{name}': it is not active")
            elif kind == int(kinds.mjEQ_CONNECT):
                first, second, at, frames = self._ends(i, is_weld=False)
                points.setdefault((first, second), []).append((name, at[0], at[1]))
            elif kind == int(kinds.mjEQ_WELD):
                first, second, at, frames = self._ends(i, is_weld=True)
                loops.append(Loop(name, "fixed", (first, second), at, frames))
            elif kind == int(kinds.mjEQ_JOINT):
                if not self._is_thread(i, bodies):
                    self.pairs.append(i)
            else:
                self.left_out.append(f"equality '{name}': {'couples tendons' if kind == int(kinds.mjEQ_TENDON) else 'neither connect nor weld'}")
        return self._by_points(points) + loops

    def _is_thread(self, i: int, bodies: list[Body]) -> bool:
        """Couples a hinge and a slide along it, which become a screw."""
        m = self.model
        numbers = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
        factors = np.array(m.eq_data[i][:5])
        if min(numbers) < 0 or factors[1] == 0 or np.any(factors[[0, 2, 3, 4]]) or m.jnt_bodyid[numbers[0]] != m.jnt_bodyid[numbers[1]]:
            return False
        body = bodies[m.jnt_bodyid[numbers[0]]]
        pair = [next((joint for joint in body.joints if joint.name == self._joint_name(j)), None) for j in numbers]
        slide, hinge = sorted((joint for joint in pair if joint is not None), key=lambda joint: joint.kind, reverse=True) if None not in pair else (None, None)
        if slide is None or hinge is None or (slide.kind, hinge.kind) != ("slide", "hinge") or slide.is_driven:
            return False
        order = [body.joints.index(slide), body.joints.index(hinge)]
        if np.linalg.norm(slide.axis - hinge.axis) > 1e-9 or abs(order[0] - order[1]) != 1 or slide.stiffness or slide.damping or slide.armature:
            return False
        name = hinge.name.removesuffix(".angle")
        self.threads[name] = hinge.name
        pitch = float(factors[1] if pair[0] is slide else 1 / factors[1])
        body.joints[min(order)] = replace(hinge, name=name, kind="screw", pitch=pitch)
        del body.joints[max(order)]
        return True

    def _couplings(self, bodies: list[Body]) -> list[Coupling]:
        """Joints that follow other joints."""
        m = self.model
        joints = {joint.name: joint for body in bodies for joint in body.joints}
        found: list[Coupling] = []
        for i in self.pairs:
            name, factors = self._name("EQUALITY", i, f"loop{i + 1}"), np.array(m.eq_data[i][:5])
            follower, leader = (joints.get(self._joint_name(int(j))) if j >= 0 else None for j in (m.eq_obj1id[i], m.eq_obj2id[i]))
            if m.eq_obj2id[i] < 0:
                why = "holds a joint: leave that out, or lock it"
            elif follower is None or leader is None:
                why = "couples a joint that has become a part of a screw"
            elif np.any(factors[2:]):
                why = "couples joints by more than a ratio (a cam says it)"
            elif any(other.follower is follower for other in found) or self._leads(found, follower, leader):
                why = f"joint '{follower.name}' follows or leads the other one already"
            else:
                found.append(Coupling(leader, follower, float(factors[1]), float(factors[0] + follower.reference - factors[1] * leader.reference)))
                continue
            self.left_out.append(f"equality '{name}': {why}")
        return found

    def _leads(self, couplings: list[Coupling], first: TreeJoint, last: TreeJoint) -> bool:
        """Does the last joint follow the first one, by way of others or itself?"""
        return last is first or any(c.follower is last and self._leads(couplings, first, c.leader) for c in couplings)

    def _ends(self, i: int, is_weld: bool) -> tuple[int, int, tuple[Array, Array], tuple[Array, Array]]:
        """Bodies, points and axes of what a connect or weld holds together."""
        m, data = self.model, np.array(self.model.eq_data[i])
        first, second = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
        if int(m.eq_objtype[i]) == int(self.mujoco.mjtObj.mjOBJ_SITE):
            bodies = int(m.site_bodyid[first]), int(m.site_bodyid[second])
            frames = self._rotation(m.site_quat[first]), self._rotation(m.site_quat[second])
            return *bodies, (np.array(m.site_pos[first]), np.array(m.site_pos[second])), frames
        if not is_weld:
            return first, second, (data[0:3], data[3:6]), (np.eye(3), np.eye(3))
        # a point in the second body's axes, the same in those of the first, the second one's attitude against the first
        return first, second, (data[3:6], data[0:3]), (self._rotation(data[6:10]), np.eye(3))

    def _by_points(self, points: dict[tuple[int, int], list[tuple[str, Array, Array]]]) -> list[Loop]:
        """A pair of bodies held at one point is a ball, at two a hinge, at three a weld."""
        loops = []
        for bodies, held in points.items():
            name, at, other = held[0]
            ways = [(a - at, b - other) for _, a, b in held[1:] if np.linalg.norm(a - at) > 1e-9]
            if not ways:
                loops.append(Loop(name, "spherical", bodies, (at, other)))
                continue
            axis = ways[0]
            away = [way for way in ways if np.linalg.norm(np.cross(way[0], axis[0])) > 1e-9 * np.linalg.norm(axis[0])]
            if not away:
                loops.append(Loop(name, "revolute", bodies, (at, other), (axes_about(axis[0]), axes_about(axis[1]))))
                continue
            frames = [_square(axis[k], away[0][k]) for k in (0, 1)]
            loops.append(Loop(name, "fixed", bodies, (at, other), (frames[0], frames[1])))
        return loops

    def _tell_the_rest(self) -> None:
        m = self.model
        shapes = Counter("mesh" if int(kind) == int(self.mujoco.mjtGeom.mjGEOM_MESH) else "shape" for kind in m.geom_type)
        for kind, n in shapes.items():
            self.left_out.append(f"{n} geom(s), {kind}: contacts and pictures (their masses count)")
        for word, n in (("tendon", m.ntendon), ("sensor", m.nsensor), ("camera", m.ncam), ("light", m.nlight),
                        ("plugin", m.nplugin), ("flex", m.nflex), ("skin", m.nskin)):
            if n:
                self.left_out.append(f"{n} {word}(s)")
        if np.any(m.body_gravcomp):
            self.left_out.append("gravcomp: gravity acts on all bodies")
        if m.opt.density or m.opt.viscosity:
            self.left_out.append("density and viscosity of the fluid around it")


def _square(z: Array, about: Array) -> Array:
    """Axes in columns: z, and x square to it and as near to the other direction as can be."""
    z = z / np.linalg.norm(z)
    x = about - (about @ z) * z
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
