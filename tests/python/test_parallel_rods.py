"""Platforms that three pairs of parallel rods keep from turning, led by where they are: closed by formulas, against iteration and by
other roads."""

from __future__ import annotations

import copy
from typing import Any

import linkdyn
import numpy as np
import pytest
from cross_checks import agrees_with_itself, hold_together
from scipy.spatial.transform import Rotation
from test_said_otherwise import elements, matrix, write_markers

pytestmark = pytest.mark.accuracy

WIDTH = 0.045       # half of a pair's
ROD = 0.8
RADIUS = 0.05       # of the platform
LEADS = ["R", "P"]


def delta(lead: str = "R", turned: float = 0.0, longer: float = 0.0) -> dict[str, Any]:
    """A Delta robot with cranks, or carriages on upright rails. The platform may be written in axes that are turned about z, which its
    start takes back, and a rod may be longer than the other of its pair: the platform is then closed by iteration."""
    axes = Rotation.from_euler("z", turned)
    base: dict[str, Any] = {}
    top: dict[str, Any] = {"tool": axes.inv().apply([0.01, 0.02, -0.04]).tolist()}
    links: list[dict[str, Any]] = []
    joints: list[dict[str, Any]] = []
    for k in range(3):
        out, along = Rotation.from_euler("z", k * 2 * np.pi / 3).apply([[1, 0, 0], [0, 1, 0]])
        here = {"R": {"at": (0.2 * out).tolist(), "axis": along.tolist()}, "P": {"at": (0.5 * out).tolist(), "axis": [0, 0, 1]}}[lead]
        own = {"axis": [0, 1, 0] if lead == "R" else [0, 0, 1], "x": [1, 0, 0], "at": [0, 0, 0]}
        base[f"B{k}"] = here | {"x": out.tolist()}
        reach = 0.3 if lead == "R" else -0.02
        links.append({"name": f"lead{k}", "mass": 0.7, "cog": [0.1, 0.01, 0], "inertia": {"diagonal": [2e-4, 5e-3, 5e-3]},
                      "markers": {"B": own, "E0": [reach, WIDTH, 0], "E1": [reach, -WIDTH, 0]}})
        joints.append({"name": f"{lead}{k}", "type": {"R": "revolute", "P": "prismatic"}[lead], "between": [f"frame.B{k}", f"lead{k}.B"],
                       "start": 0.3 if lead == "R" else 0.0})
        for i, side in enumerate([1, -1]):
            end = ROD + (longer if (k, i) == (1, 1) else 0.0)
            links.append({"name": f"rod{k}{i}", "mass": 0.12, "cog": [0, 0, 0.4], "inertia": {"diagonal": [6e-3, 6e-3, 0]},
                          "inertia_check": False, "markers": {"E": [0, 0, 0], "P": [0, 0, end]}})
            top[f"P{k}{i}"] = axes.inv().apply(RADIUS * out + side * WIDTH * along).tolist()
            joints += [{"name": f"E{k}{i}", "type": "spherical", "between": [f"lead{k}.E{i}", f"rod{k}{i}.E"]},
                       {"name": f"P{k}{i}", "type": "spherical", "between": [f"rod{k}{i}.P", f"platform.P{k}{i}"]}]
    platform = {"name": "platform", "mass": 0.6, "cog": axes.inv().apply([0.01, 0, 0.02]).tolist(), "markers": top,
                "inertia": {"diagonal": [7e-4, 7e-4, 1e-3]}, "start": {"position": [0, 0, -0.72], "angles": [0, 0, turned]}}
    wave = {"law": "harmonic", "amplitude": 0.08, "frequency": 6.0}
    return {
        "title": "Delta robot", "space": "spatial", "gravity": [0, 0, -9.81], "frame": {"markers": base}, "link": [platform, *links], "joint": joints,
        "coordinate": [{"marker": "platform.tool", "components": ["x", "y", "z"],
                        "motion": {"x": wave, "y": wave | {"phase": 1.5}, "z": wave | {"mean": -0.72, "amplitude": 0.05, "frequency": 9.0}}}],
        "actuator": [{"joint": f"{lead}{k}"} for k in range(3)],
        "time": {"end": 1.0, "step": 0.01},
    }


def in_two_parts(content: dict[str, Any]) -> dict[str, Any]:
    """One of the three legs holds a part of the platform that a hinge and a brace hold to the rest of it: iteration closes that."""
    content = copy.deepcopy(content)
    platform = content["link"][0]
    names = [name for name in platform["markers"] if name.startswith("P2")]
    content["link"].append({"name": "platform_other", "mass": 0.0, "markers": {name: platform["markers"].pop(name) for name in names}})
    for joint in content["joint"]:
        joint["between"] = [end.replace("platform.P2", "platform_other.P2") for end in joint["between"]]
    hold_together(content, "platform", "platform_other")
    return content


def pair(lead: str) -> tuple[linkdyn.Scene, linkdyn.Scene]:
    """By formulas and by iteration, which is told where all links are at the start: it finds assemblies with the platform turned, too."""
    closed = linkdyn.Scene(delta(lead))
    poses = closed.poses(q=closed.motion([0.0])[0])
    content = in_two_parts(delta(lead))
    for link in content["link"]:
        if "brace" in link["name"]:
            continue
        k = closed.links.index(link["name"].removesuffix("_other"))
        link["start"] = {"position": poses.position[0, k].tolist(), "rotation": poses.rotation[0, k].tolist()}
    for joint in content["joint"]:
        joint.pop("start", None)
    iterated = linkdyn.Scene(content)
    assert "Newton" not in closed.explain() and "Newton" in iterated.explain()
    return closed, iterated


def leads(run: Any, lead: str) -> np.ndarray:
    kind = {"R": "angle", "P": "slide"}[lead]
    return np.asarray(run.joint_variable.sel(variable=[f"{lead}{k}.{kind}" for k in range(3)]))


@pytest.mark.parametrize("lead", LEADS)
def test_explained(lead: str) -> None:
    text = linkdyn.Scene(delta(lead)).explain()
    assert "pose of platform from three coordinates, seen from frame, which it does not turn against" in text
    assert text.count(f"{lead}SS leg") == 3 and text.count("rod rod") == 3


def otherwise(content: dict[str, Any], rotation: np.ndarray, stands: bool = True) -> dict[str, Any]:
    """Its platform in axes that stand so in those it had; its start may be left out."""
    content = copy.deepcopy(content)
    platform = content["link"][0]
    write_markers(platform, rotation, np.zeros(3))
    platform["cog"] = (rotation.T @ platform["cog"]).tolist()
    platform["inertia"] = elements(rotation.T @ matrix(platform["inertia"]) @ rotation)
    stood = np.array(platform["start"].get("rotation", np.eye(3)))
    platform["start"] = {"position": platform["start"]["position"], "rotation": (stood @ rotation).tolist()}
    if not stands:
        del platform["start"]
    return content


TURNS = {"by 90 degrees": Rotation.from_euler("z", 90, degrees=True), "by 10 degrees": Rotation.from_euler("z", 10, degrees=True),
         "upside down": Rotation.from_euler("x", 180, degrees=True), "anyhow": Rotation.from_euler("XYZ", [1.0, -2.0, 0.5])}


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("lead", LEADS)
def test_platform_in_other_axes(lead: str, turn: str) -> None:
    """In whatever axes the platform is written, formulas close it, also where nothing is said of the start; what is told is the same, seen in
    those axes."""
    rotation = TURNS[turn].as_matrix()
    plain = linkdyn.Scene(delta(lead))
    t = np.linspace(0, 1, 51)
    run, poses = plain.inverse(*plain.motion(t), want="all"), plain.poses(q=plain.motion(t)[0])
    for stands in (True, False):
        other = linkdyn.Scene(otherwise(delta(lead), rotation, stands))
        assert "Newton" not in other.explain()
        its, there = other.inverse(*other.motion(t), want="all"), other.poses(q=other.motion(t)[0])
        assert its.attrs["samples_closed_form"] == 51 and (its.status == 0).all()
        np.testing.assert_allclose(its.driving_force, run.driving_force, rtol=0, atol=1e-13 * float(np.abs(run.driving_force).max()))
        np.testing.assert_allclose(leads(its, lead), leads(run, lead), rtol=0, atol=1e-14)
        np.testing.assert_allclose(there.position, poses.position, rtol=0, atol=1e-14)
        np.testing.assert_allclose(there.rotation[:, 0], np.broadcast_to(rotation, (51, 3, 3)), rtol=0, atol=1e-14)
        for solver in ("lapack", "gauss-jordan"):
            forces = other.inverse(*other.motion(t), solver=solver).driving_force
            np.testing.assert_allclose(forces, run.driving_force, rtol=0, atol=1e-12 * float(np.abs(run.driving_force).max()))


@pytest.mark.parametrize("lead", LEADS)
def test_lengths_by_hand(lead: str) -> None:
    """Where each lead is follows from one circle or line and a sphere."""
    scene = linkdyn.Scene(delta(lead))
    t = np.linspace(0, 1, 201)
    q = scene.motion(t)[0]
    run = scene.inverse(q=q, want="all")
    assert (run.status == 0).all()
    found = leads(run, lead)
    for k in range(3):
        turn = Rotation.from_euler("z", -k * 2 * np.pi / 3)
        p = turn.apply(q - [0.01, 0.02, -0.04]) + [RADIUS, 0, 0]      # middle of the platform's balls, as arm k sees it
        if lead == "R":
            x, y, z = (p - [0.2, 0, 0]).T
            e = 0.3 * np.column_stack([np.cos(found[:, k]), np.zeros_like(y), -np.sin(found[:, k])])
            np.testing.assert_allclose(np.linalg.norm(np.column_stack([x, y, z]) - e, axis=1), ROD, rtol=0, atol=2e-15)
        else:
            e = np.column_stack([np.full(len(p), 0.48), np.zeros(len(p)), found[:, k]])
            np.testing.assert_allclose(np.linalg.norm(p - e, axis=1), ROD, rtol=0, atol=2e-15)


@pytest.mark.parametrize("in_order", [True, False])
@pytest.mark.parametrize("lead", LEADS)
def test_against_iteration(lead: str, in_order: bool) -> None:
    """The same statuses, within reach and beyond, places and forces."""
    closed, iterated = pair(lead)
    q, qd, qdd = closed.motion(np.linspace(0, 1, 501))
    if not in_order:
        stream = np.random.default_rng(1)
        q = q[stream.permutation(501)]
        q[:, :2] *= stream.uniform(1, 9, (501, 1))
    one, two = (scene.inverse(q, qd, qdd, want="all", in_order=in_order) for scene in (closed, iterated))
    np.testing.assert_array_equal(one.status, two.status)
    ok = (one.status == 0).values
    assert ok.all() if in_order else 0.3 < ok.mean() < 1
    np.testing.assert_allclose(leads(one, lead)[ok], leads(two, lead)[ok], rtol=0, atol=1e-13)
    bound = 1e-11 * float(np.abs(two.driving_force[ok]).max())
    np.testing.assert_allclose(one.driving_force[ok], two.driving_force[ok], rtol=0, atol=bound)
    there, here = (scene.poses(q=q[ok]) for scene in (iterated, closed))
    np.testing.assert_allclose(here.position, there.position[:, : here.position.shape[1]], rtol=0, atol=1e-13)
    assert np.abs(here.rotation[:, 0] - np.eye(3)).max() == 0


@pytest.mark.parametrize("lead", LEADS)
def test_forces_and_rates(lead: str) -> None:
    agrees_with_itself(linkdyn.Scene(delta(lead)), step=1e-4, within=1e-8)


def test_reach() -> None:
    """Beyond the reach of an arm a pose is `unreachable`, right up to where it is, as by iteration."""
    closed, iterated = pair("R")
    q = np.zeros((601, 3))
    q[:] = [0.01, 0.02, 0.0]                          # the middle
    q[:, 2] = np.linspace(-0.9, -1.2, 601)
    one, two = closed.inverse(q=q), iterated.inverse(q=q)
    lowest = -np.sqrt(1.1**2 - 0.15**2) - 0.04
    np.testing.assert_array_equal(one.status, two.status)
    np.testing.assert_array_equal(one.status.values == 0, q[:, 2] > lowest)


def elbows_in(turned: float = 0.0) -> dict[str, Any]:
    """Hanging low, cranks inwards, as far as need be for rods that are upright as the platform comes up: the pairs let it turn then."""
    content = delta("R", turned)
    content["link"][0]["start"]["position"] = [0, 0, -1.085]
    content["coordinate"][0].pop("motion")
    content["coordinate"][0]["start"] = {"x": 0.01, "y": 0.02, "z": -1.125}
    for joint in content["joint"]:
        joint.pop("start", None)
        if joint["name"] in ("E00", "E10", "E20"):
            joint["branch"] = 1
    return content


def test_where_nothing_holds_the_attitude() -> None:
    """All rods upright, a change point: the platform goes through it as it came, and is told; close to it it is `singular`."""
    scene = linkdyn.Scene(elbows_in())
    upright = -0.3 * np.sin(np.radians(120)) - ROD - 0.04     # of the tool
    q = np.zeros((201, 3))
    q[:] = [0.01, 0.02, 0.0]
    q[:, 2] = np.linspace(-1.125, -1.05, 201)
    run = scene.inverse(q=q, want="all", in_order=True)
    assert (run.status == 0).all() and run.attrs["change_points_passed"] == 1
    angle = leads(run, "R")
    assert np.degrees(angle.min()) < 115 and np.degrees(angle.max()) > 125 and np.abs(np.diff(angle, axis=0)).max() < 0.02
    own = scene.inverse(q=q)
    np.testing.assert_allclose(own.driving_force, run.driving_force, rtol=0, atol=1e-12)
    off = np.geomspace(1e-12, 1e-2, 201)
    q[:, 2] = upright + off
    near = scene.inverse(q=q).status.values
    codes = {meaning: code for code, meaning in enumerate(run.status.attrs["flag_meanings"].split())}
    assert (near[off < 3e-8] == codes["singular"]).all() and (near[off > 1e-6] == codes["ok"]).all()
    assert (np.diff((near == codes["ok"]).astype(int)) >= 0).all()


def test_pairs_that_are_not_parallel() -> None:
    """A rod longer than the other of its pair turns the platform: by iteration, as before."""
    scene = linkdyn.Scene(delta("R", longer=1e-3))
    assert "Newton" in scene.explain()
    q = scene.motion()[0]
    assert (scene.inverse(q=q).status == 0).all()
    assert np.abs(scene.poses(q=q).rotation[:, 0] - np.eye(3)).max() > 1e-4


def test_branch_and_elbow() -> None:
    """Elbows out and in, as their joints' `branch` says, and both are in the list."""
    content = delta("R")
    scene = linkdyn.Scene(content)
    listed = scene.assemblies()
    assert len(listed) == 8
    angles = set()
    for branch in (1, -1):
        next(joint for joint in content["joint"] if joint["name"] == "E00")["branch"] = branch
        other = linkdyn.Scene(content)
        run = other.inverse(q=other.motion([0.0])[0], want="all")
        assert run.status[0] == 0
        angles.add(round(float(leads(run, "R")[0, 0]), 6))
    assert len(angles) == 2


def test_forward() -> None:
    """A robot that falls keeps its energy, and falls as the one closed by iteration does."""
    runs = []
    for scene in pair("R"):
        runs.append(scene.forward(0.15, step=0.01, rtol=1e-11, atol=1e-11))
    energy = runs[0].kinetic_energy + runs[0].potential_energy - runs[0].work
    assert np.abs(energy - energy[0]).max() < 1e-8
    np.testing.assert_allclose(runs[0].q, runs[1].q, rtol=0, atol=1e-8)
