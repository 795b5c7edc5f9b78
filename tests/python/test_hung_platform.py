"""Platforms that three pairs of parallel rods keep from turning, led by their drives: closed by formulas, against iteration and by other
roads."""

from __future__ import annotations

import copy
from typing import Any

import linkdyn
import numpy as np
import pytest
from cross_checks import agrees_with_itself
from scipy.spatial.transform import Rotation
from test_parallel_rods import LEADS, RADIUS, TURNS, WIDTH, delta, in_two_parts, leads, otherwise
from test_said_otherwise import with_starts, write_markers

pytestmark = pytest.mark.accuracy

RODS = np.array([0.8, 0.78, 0.83])     # unequal, spheres of three sizes
REACH = np.array([0.3, 0.26, 0.33])    # of the cranks
KIND = {"R": "angle", "P": "slide"}


def driven(lead: str = "R", unequal: bool = True, order: tuple[int, ...] = (0, 1, 2)) -> dict[str, Any]:
    """That of `delta`, its cranks or carriages led instead of its tool, arms of three sizes."""
    content = delta(lead)
    wave = {"law": "harmonic", "frequency": 6.0, "amplitude": 0.35 if lead == "R" else 0.1}
    means = [0.3, 0.35, 0.2] if lead == "R" else [0.0, 0.05, -0.05]
    content["coordinate"] = [{"joint": f"{lead}{k}", "motion": wave | {"phase": 1.7 * k, "mean": means[k]}} for k in order]
    for joint in content["joint"]:
        joint.pop("start", None)
    if not unequal:
        return content
    for link in content["link"]:
        name = link["name"]
        if name.startswith("rod"):
            link["markers"]["P"] = [0, 0, float(RODS[int(name[3])])]
        if name.startswith("lead") and lead == "R":
            for i, side in enumerate([1, -1]):
                link["markers"][f"E{i}"] = [float(REACH[int(name[4])]), side * WIDTH, 0]
    return content


def iterated_twin(closed: linkdyn.Scene, content: dict[str, Any]) -> linkdyn.Scene:
    """The same robot, its platform in two parts, so that it is closed by iteration. It is told where all links are at the start: it finds assemblies
    with the platform turned, too."""
    poses = closed.poses(q=closed.motion([0.0])[0])
    content = in_two_parts(content)
    for link in content["link"]:
        if "brace" in link["name"]:
            continue
        k = closed.links.index(link["name"].removesuffix("_other"))
        link["start"] = {"position": poses.position[0, k].tolist(), "rotation": poses.rotation[0, k].tolist()}
    iterated = linkdyn.Scene(content)
    assert "Newton" not in closed.explain() and "Newton" in iterated.explain()
    return iterated


def pair(lead: str, unequal: bool = True) -> tuple[linkdyn.Scene, linkdyn.Scene]:
    closed = linkdyn.Scene(driven(lead, unequal=unequal))
    return closed, iterated_twin(closed, driven(lead, unequal=unequal))


def upper_ends(lead: str, q: np.ndarray, unequal: bool = True) -> np.ndarray:
    """Centres of the spheres on which the platform's origin is (N, 3, 3)."""
    centre = np.zeros((len(q), 3, 3))
    for k in range(3):
        turn = Rotation.from_euler("z", k * 2 * np.pi / 3)
        reach = REACH[k] if unequal else 0.3
        if lead == "R":
            here = np.column_stack([0.2 + reach * np.cos(q[:, k]), 0 * q[:, k], -reach * np.sin(q[:, k])])
        else:
            here = np.column_stack([np.full(len(q), 0.48), 0 * q[:, k], q[:, k]])
        centre[:, k] = turn.apply(here - [RADIUS, 0, 0])
    return centre


@pytest.mark.parametrize("lead", LEADS)
def test_explained(lead: str) -> None:
    text = linkdyn.Scene(driven(lead)).explain()
    assert "platform platform on rods at P00 P10 P20, which does not turn against frame: closed form" in text
    assert text.count("rod rod") == 6


@pytest.mark.parametrize("lead", LEADS)
def test_distances_by_hand(lead: str) -> None:
    """The origin is as far from each centre as the rod is long, below all of them, and the platform stands upright."""
    scene = linkdyn.Scene(driven(lead))
    q = scene.motion(np.linspace(0, 1, 201))[0]
    poses = scene.poses(q=q)
    p = poses.position[:, scene.links.index("platform")]
    centre = upper_ends(lead, q)
    np.testing.assert_allclose(np.linalg.norm(p[:, None] - centre, axis=2), np.broadcast_to(RODS, (201, 3)), rtol=0, atol=3e-15)
    side = np.linalg.det(p[:, None] - centre)
    assert (np.sign(side) == np.sign(side[0])).all() and (p[:, 2] < centre[:, :, 2].min(axis=1)).all()
    assert np.abs(poses.rotation[:, scene.links.index("platform")] - np.eye(3)).max() == 0


@pytest.mark.parametrize("in_order", [True, False])
@pytest.mark.parametrize("lead", LEADS)
def test_against_iteration(lead: str, in_order: bool) -> None:
    """The same statuses, within reach and beyond, places and forces."""
    closed, iterated = pair(lead)
    q, qd, qdd = closed.motion(np.linspace(0, 1, 501))
    if not in_order:
        stream = np.random.default_rng(1)
        q = q[stream.permutation(501)] + stream.uniform(-0.4, 0.4, (501, 3)) * (1.0 if lead == "P" else 2.0)
    one, two = (scene.inverse(q, qd, qdd, want="all", in_order=in_order) for scene in (closed, iterated))
    np.testing.assert_array_equal(one.status, two.status)
    ok = (one.status == 0).values
    assert ok.all() if in_order else 0.3 < ok.mean()
    bound = 1e-11 * float(np.abs(two.driving_force[ok]).max())
    np.testing.assert_allclose(one.driving_force[ok], two.driving_force[ok], rtol=0, atol=bound)
    there, here = (scene.poses(q=q[ok]) for scene in (iterated, closed))
    np.testing.assert_allclose(here.position, there.position[:, : here.position.shape[1]], rtol=0, atol=1e-12)


@pytest.mark.parametrize("lead", LEADS)
def test_forces_and_rates(lead: str) -> None:
    agrees_with_itself(linkdyn.Scene(driven(lead)), step=1e-4, within=1e-8)


@pytest.mark.parametrize("lead", LEADS)
def test_led_by_the_tool_and_back(lead: str) -> None:
    """What the drives of the robot led by its tool do leads it, as its drives, where its tool was."""
    scene = linkdyn.Scene(delta(lead))
    t, step = np.linspace(0, 1, 101), 1e-4
    motion = scene.motion(t)
    names = [f"{lead}{k}.{KIND[lead]}" for k in range(3)]
    run, *beside = (scene.inverse(*scene.motion(t + k * step), want="all") for k in (0, -2, -1, 1, 2))
    rates = [np.asarray(one.joint_rate.sel(variable=names)) for one in beside]
    rate, second = np.asarray(run.joint_rate.sel(variable=names)), (rates[0] - 8 * rates[1] + 8 * rates[2] - rates[3]) / (12 * step)
    back = linkdyn.Scene(driven(lead, unequal=False))
    found = back.inverse(leads(run, lead), rate, second, want="all")
    assert (found.status == 0).all()
    np.testing.assert_allclose(back.poses(q=leads(run, lead)).position[:, 0], scene.poses(q=motion[0]).position[:, 0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.driving_force, run.driving_force, rtol=0, atol=1e-8 * float(np.abs(run.driving_force).max()))


def test_reach() -> None:
    """Rods that cannot meet are `unreachable`, right up to where they can; there both assemblies come together."""
    closed, iterated = pair("P", unequal=False)
    q = np.zeros((801, 3))
    q[:, 0] = np.linspace(0, 1.9, 801)
    one, two = closed.inverse(q=q), iterated.inverse(q=q)
    np.testing.assert_array_equal(one.status == 0, two.status == 0)
    a, b = (upper_ends("P", q, unequal=False)[:, k] - upper_ends("P", q, unequal=False)[:, 0] for k in (1, 2))
    n = np.cross(a, b)
    f = ((a * a).sum(1) / 2)[:, None] * b - ((b * b).sum(1) / 2)[:, None] * a
    np.testing.assert_array_equal(one.status.values == 0, 0.64 * (n * n).sum(1) > (f * f).sum(1))
    assert 0 < (one.status.values != 0).sum() < 801


def test_branch_and_start() -> None:
    """Below and above the arms: as `branch` says, or nearest to the platform's start; both are in the list, and in neither does a motion
    come to the other."""
    content = driven("R")
    listed = linkdyn.Scene(content).assemblies()
    assert len(listed) == 2
    heights = {}
    for branch in (1, -1):
        chosen = driven("R")
        chosen["link"][0].pop("start")
        next(joint for joint in chosen["joint"] if joint["name"] == "P00")["branch"] = branch
        scene = linkdyn.Scene(chosen)
        q = scene.motion(np.linspace(0, 1, 51))[0]
        heights[branch] = scene.poses(q=q).position[:, 0, 2]
        assert (np.sign(heights[branch]) == np.sign(heights[branch][0])).all()
    assert heights[1][0] * heights[-1][0] < 0
    content["link"][0]["start"]["position"] = [0, 0, 0.72]
    above = linkdyn.Scene(content)
    z = above.poses(q=above.motion([0.0])[0]).position[0, 0, 2]
    assert z == max(heights[1][0], heights[-1][0])


@pytest.mark.parametrize("order", [(1, 0, 2), (2, 0, 1)])
def test_said_otherwise(order: tuple[int, ...]) -> None:
    """Coordinates and parts in another order, the base elsewhere: the same forces."""
    plain = linkdyn.Scene(driven("R"))
    q, qd, qdd = plain.motion(np.linspace(0, 1, 51))
    forces = plain.inverse(q, qd, qdd).driving_force.values
    content = driven("R", order=order)
    content["link"].reverse()
    content["joint"].reverse()
    shift = np.array([3.0, -2.0, 5.0])
    for marker in content["frame"]["markers"].values():
        marker["at"] = (np.array(marker["at"]) + shift).tolist()
    content["link"][-1]["start"]["position"] = ([0, 0, -0.72] + shift).tolist()
    other = linkdyn.Scene(content)
    assert "Newton" not in other.explain()
    k = list(order)
    run = other.inverse(q[:, k], qd[:, k], qdd[:, k])
    assert (run.status == 0).all()
    np.testing.assert_allclose(run.driving_force, forces, rtol=0, atol=1e-11 * np.abs(forces).max())


def seen_from_elsewhere(content: dict[str, Any]) -> dict[str, Any]:
    """World axes anywhere, but the links in their own axes as before."""
    content = copy.deepcopy(content)
    rotation, origin = Rotation.from_euler("XYZ", [0.3, -1.0, 2.0]).as_matrix(), np.array([1.0, -2.0, 0.5])
    write_markers(content["frame"], rotation, origin)
    content["gravity"] = (rotation.T @ content["gravity"]).tolist()
    start = content["link"][0]["start"]
    content["link"][0]["start"] = {"position": (rotation.T @ (start["position"] - origin)).tolist(), "rotation": rotation.T.tolist()}
    return content


WRITTEN = {"seen from elsewhere": seen_from_elsewhere} | {turn: (lambda content, turn=turn: otherwise(content, TURNS[turn].as_matrix())) for turn in TURNS}


@pytest.mark.parametrize("written", WRITTEN)
@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("lead", LEADS)
def test_written_otherwise(lead: str, single: bool, written: str) -> None:
    """In whatever axes platform and world are written, formulas close it: the same places and forces, in inverse and forward dynamics."""
    content = with_single_rods(lead) if single else driven(lead)
    plain, other = linkdyn.Scene(content), linkdyn.Scene(WRITTEN[written](content))
    assert "Newton" not in plain.explain() and "Newton" not in other.explain()
    t = np.linspace(0, 1, 51)
    run, its = (scene.inverse(*scene.motion(t), want="all") for scene in (plain, other))
    assert its.attrs["samples_closed_form"] == 51 and (its.status == 0).all()
    bound = 1e-12 * float(np.abs(run.driving_force).max())
    np.testing.assert_allclose(its.driving_force, run.driving_force, rtol=0, atol=bound)
    for solver in ("lapack", "gauss-jordan"):
        np.testing.assert_allclose(other.inverse(*other.motion(t), solver=solver).driving_force, run.driving_force, rtol=0, atol=10 * bound)
    falls = [scene.forward(0.1, step=0.02, rtol=1e-11, atol=1e-11).q for scene in (plain, other)]
    np.testing.assert_allclose(falls[0], falls[1], rtol=0, atol=1e-9)


def on_a_gantry() -> dict[str, Any]:
    """The base turns and shifts: it is a link that a planar joint leads."""
    content = driven("R")
    base = content["frame"]["markers"]
    content["frame"]["markers"] = {"O": {"at": [0, 0, 0], "axis": [1, 0, 0]}}
    content["link"].append({"name": "gantry", "mass": 5.0, "inertia": {"diagonal": [0.3, 0.4, 0.5]}, "markers": base | {"O": {"at": [0, 0, 0], "axis": [1, 0, 0]}}})
    for joint in content["joint"]:
        joint["between"] = [name.replace("frame.", "gantry.") for name in joint["between"]]
    content["joint"].append({"name": "tilt", "type": "revolute", "between": ["frame.O", "gantry.O"]})
    content["coordinate"].append({"joint": "tilt", "motion": {"law": "harmonic", "amplitude": 0.4, "frequency": 5.0, "mean": 0.1}})
    content["actuator"].append({"joint": "tilt"})
    content["link"][0].pop("start")
    next(joint for joint in content["joint"] if joint["name"] == "P00")["branch"] = int(np.sign(
        np.linalg.det([[0, 0, -0.72]] - upper_ends("R", np.array([[0.3, 0.3, 0.3]]))[0])))
    return content


def test_base_that_moves() -> None:
    """The platform turns as its base does: power is in balance, and solvers that do not know of it agree."""
    scene = linkdyn.Scene(on_a_gantry())
    assert "which does not turn against gantry" in scene.explain() and "Newton" not in scene.explain()
    step = 1e-4
    t = 0.3 + step * np.arange(-2, 3)
    run = scene.inverse(*scene.motion(t), want="all")
    assert (run.status == 0).all() and np.abs(run.power_imbalance).max() < 1e-12
    x = run.joint_variable.values
    slope = (x[0] - 8 * x[1] + 8 * x[3] - x[4]) / (12 * step)
    np.testing.assert_allclose(run.joint_rate.values[2], slope, rtol=0, atol=1e-8)
    lapack = scene.inverse(*scene.motion(t), solver="lapack")
    np.testing.assert_allclose(lapack.driving_force, run.driving_force, rtol=0, atol=1e-11 * float(np.abs(run.driving_force).max()))
    turn = scene.poses(q=scene.motion(t)[0]).rotation
    np.testing.assert_allclose(turn[:, scene.links.index("platform")], turn[:, scene.links.index("gantry")], rtol=0, atol=1e-15)


@pytest.mark.parametrize("turn", TURNS)
def test_base_that_moves_and_other_axes(turn: str) -> None:
    """Where all links begin is told, and the platform written in other axes: it stands so against its base."""
    content = on_a_gantry()
    plain = linkdyn.Scene(content)
    t = np.linspace(0, 1, 51)
    run = plain.inverse(*plain.motion(t))
    other = linkdyn.Scene(otherwise(with_starts(content), TURNS[turn].as_matrix()))
    assert "Newton" not in other.explain()
    its = other.inverse(*other.motion(t))
    assert (its.status == 0).all()
    np.testing.assert_allclose(its.driving_force, run.driving_force, rtol=0, atol=1e-12 * float(np.abs(run.driving_force).max()))


@pytest.mark.parametrize("lead", LEADS)
def test_forward(lead: str) -> None:
    """A robot that falls keeps its energy, and falls as the one closed by iteration does."""
    runs = [scene.forward(0.15, step=0.01, rtol=1e-11, atol=1e-11) for scene in pair(lead)]
    energy = runs[0].kinetic_energy + runs[0].potential_energy - runs[0].work
    assert np.abs(energy - energy[0]).max() < 1e-8
    np.testing.assert_allclose(runs[0].q, runs[1].q, rtol=0, atol=1e-8)


def test_volume_between_the_rods_vanishes() -> None:
    """Towards the limit of reach samples are right, to three digits at least, or `singular`, never of the other assembly."""
    closed, iterated = pair("P", unequal=False)
    q = np.zeros((401, 3))
    edge = _edge()
    q[:, 0] = edge - np.geomspace(1e-15, 1e-1, 401)
    stream = np.random.default_rng(2)
    rates = stream.uniform(-1, 1, (2, 401, 3))
    one, two = (scene.inverse(q, *rates, want="all") for scene in (closed, iterated))
    ok = one.status.values == 0
    both = ok & (two.status.values == 0)
    off = np.abs(one.driving_force - two.driving_force).max(axis=1) / np.abs(two.driving_force).max(axis=1)
    assert both.sum() > 200 and float(off[both].max()) < 1e-3
    assert (np.diff(ok.astype(int)) >= 0).all() and ok[-1] and not ok[0]
    place = closed.poses(q=q).position[ok, 0]
    centre = upper_ends("P", q[ok], unequal=False)
    side = np.linalg.det(place[:, None] - centre)
    first = closed.poses(q=closed.motion([0.0])[0]).position[0, 0]
    assert (np.sign(side) == np.sign(np.linalg.det(first - upper_ends("P", closed.motion([0.0])[0], unequal=False)[0]))).all()


def test_driven_over_the_limit_and_back() -> None:
    """Beyond it nothing is told, before and behind it what iteration tells."""
    closed, iterated = pair("P", unequal=False)
    q = np.zeros((401, 3))
    q[:, 0] = 1.05 * _edge() * np.sin(np.pi * np.linspace(0, 1, 401))
    one, two = (scene.inverse(q=q, in_order=True) for scene in (closed, iterated))
    np.testing.assert_array_equal(one.status == 0, two.status == 0)
    ok = one.status.values == 0
    assert 0.5 < ok.mean() < 1 and ok[-1] and "links 'platform' cannot be closed beyond P0" in one.attrs["failure"]
    here, there = (scene.poses(q=q, in_order=True).position[ok] for scene in (closed, iterated))
    np.testing.assert_allclose(here, there[:, : here.shape[1]], rtol=0, atol=1e-12)


def _edge() -> float:
    """How far the first carriage goes with the others at zero: bisected."""
    low, high = 0.0, 1.9
    for _ in range(200):
        middle = 0.5 * (low + high)
        centre = upper_ends("P", np.array([[middle, 0, 0]]), unequal=False)[0]
        a, b = centre[1] - centre[0], centre[2] - centre[0]
        n, f = np.cross(a, b), a @ a / 2 * b - b @ b / 2 * a
        low, high = (middle, high) if 0.64 * n @ n > f @ f else (low, middle)
    return low


def with_single_rods(lead: str = "R") -> dict[str, Any]:
    """One rod a leg, between universal joints, in place of two between balls."""
    content = driven(lead)
    kept = [link for link in content["link"] if not link["name"].endswith("1") or not link["name"].startswith("rod")]
    for link in kept:
        if link["name"].startswith("rod"):
            link["inertia"] = {"diagonal": [6e-3, 6e-3, 1e-4]}
            link["markers"] = {"E": {"at": [0, 0, 0], "axis": [1, 0, 0]}, "P": {"at": link["markers"]["P"], "axis": [1, 0, 0]}}
        if link["name"].startswith("lead"):
            link["markers"]["E0"] = {"at": [link["markers"]["E0"][0], 0, 0], "axis": [0, 1, 0]}
        if link["name"] == "platform":
            for k in range(3):
                out, along = Rotation.from_euler("z", k * 2 * np.pi / 3).apply([[1, 0, 0], [0, 1, 0]])
                link["markers"][f"P{k}0"] = {"at": (RADIUS * out).tolist(), "axis": along.tolist()}
    content["link"] = kept
    content["joint"] = [joint for joint in content["joint"] if not (joint["name"][0] in "EP" and len(joint["name"]) == 3 and joint["name"].endswith("1"))]
    for joint in content["joint"]:
        if joint["type"] == "spherical":
            joint["type"] = "universal"
    return content


@pytest.mark.parametrize("lead", LEADS)
def test_single_rods(lead: str) -> None:
    """Between universal joints a rod keeps the platform from turning like a pair: the same places, and forces as of solvers that know of no
    formula."""
    scene = linkdyn.Scene(with_single_rods(lead))
    text = scene.explain()
    assert "Newton" not in text and text.count("rod rod") == 3
    t = np.linspace(0, 1, 51)
    motion = scene.motion(t)
    run = scene.inverse(*motion, want="all")
    assert (run.status == 0).all() and np.abs(run.power_imbalance).max() < 1e-12
    pairs = linkdyn.Scene(driven(lead))
    np.testing.assert_allclose(scene.poses(q=motion[0]).position[:, 0], pairs.poses(q=motion[0]).position[:, 0], rtol=0, atol=1e-14)
    lapack = scene.inverse(*motion, solver="lapack")
    np.testing.assert_allclose(lapack.driving_force, run.driving_force, rtol=0, atol=1e-11 * float(np.abs(run.driving_force).max()))
    step = 1e-4
    x = scene.inverse(*scene.motion(0.3 + step * np.arange(-2, 3)), want="all")
    slope = (x.joint_variable[0] - 8 * x.joint_variable[1] + 8 * x.joint_variable[3] - x.joint_variable[4]) / (12 * step)
    np.testing.assert_allclose(x.joint_rate.values[2], slope, rtol=0, atol=1e-8)


def test_single_rods_against_iteration() -> None:
    """The same statuses, places and forces."""
    closed = linkdyn.Scene(with_single_rods())
    iterated = iterated_twin(closed, with_single_rods())
    one, two = (scene.inverse(*closed.motion(np.linspace(0, 1, 201)), want="all") for scene in (closed, iterated))
    np.testing.assert_array_equal(one.status, two.status)
    assert (one.status == 0).all()
    np.testing.assert_allclose(one.driving_force, two.driving_force, rtol=0, atol=1e-11 * float(np.abs(two.driving_force).max()))


def test_what_lets_the_platform_turn() -> None:
    """A rod longer than the other of its pair, or a universal joint whose outer axis is not along its crank's hinge, turns the platform: by
    iteration, as before."""
    longer = driven("R")
    next(link for link in longer["link"] if link["name"] == "rod11")["markers"]["P"][2] += 1e-3
    tilted = with_single_rods()
    next(link for link in tilted["link"] if link["name"] == "lead1")["markers"]["E0"]["axis"] = [0, 1, 1e-3]
    for content in (longer, tilted):
        scene = linkdyn.Scene(content)
        assert "Newton" in scene.explain()
        q = scene.motion(np.linspace(0, 1, 21))[0]
        assert (scene.inverse(q=q).status == 0).all()
        assert np.abs(scene.poses(q=q).rotation[:, scene.links.index("platform")] - np.eye(3)).max() > 1e-5
