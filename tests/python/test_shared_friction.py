"""Friction of reactions that the equations leave open: joints share what it presses by, and it changes what they share."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from numpy.typing import NDArray
from test_redundancy import CORNERS, Z, hinges, shaft, three_cranks
from test_shared_by_record import SCENES, about_start

pytestmark = pytest.mark.accuracy

Array = NDArray[np.float64]
MU, RADIUS, CREEP = 0.3, 0.02, 1e-3
RUBS = ("revolute", "prismatic", "cylindrical", "universal", "spherical")
FORCES = "all"
TWO_ROADS = 3e-12            # of a sample's largest force, as without friction
FOLLOWS = 1e-9               # the integrators' tolerance


def rubbing(scene: dict[str, Any], mu: float = 0.1, **more: Any) -> dict[str, Any]:
    """Friction in every joint that may have it."""
    return copy.deepcopy(scene) | {"friction": [
        {"joint": joint["name"], "coulomb": mu, **({} if joint["type"] == "prismatic" else {"radius": RADIUS}), **more}
        for joint in scene["joint"] if joint["type"] in RUBS]}


@pytest.mark.parametrize("name", SCENES)
def test_record_against_lanes(name: str) -> None:
    """The record shares while it is traced, lanes share numbers: no formula is common. What drives supply is what friction takes, and inertia and weight."""
    scene = linkdyn.Scene(rubbing(SCENES[name]))
    q, qd, qdd = about_start(scene, 0.05)
    if name == "parallelogram":
        q += 0.8    # off its change point: belts carry least, so the loop carries all, and locks there
    record, lanes = (scene.inverse(q=q, qd=qd, qdd=qdd, solver=solver, want=FORCES) for solver in ("elimination", "gauss-jordan"))
    np.testing.assert_array_equal(record.status.values, lanes.status.values)
    good = record.status.values == 0
    assert good.all() and np.abs(record.friction_power.values[good]).max() > 0
    size = np.abs(lanes.reaction.values[good]).reshape(good.sum(), -1).max(axis=1)
    for found in ("driving_force", "reaction", "friction"):
        apart = np.abs(record[found].values - lanes[found].values)[good].reshape(good.sum(), -1).max(axis=1)
        assert (apart <= TWO_ROADS * size).all(), found
    assert np.abs(record.power_imbalance.values[good]).max() < 1e-12


def in_the_plane() -> dict[str, Any]:
    return three_cranks()


def in_space() -> dict[str, Any]:
    scene = hinges(CORNERS, [Z] * 4, rate=2.0)
    return scene | {"gravity": [0.0, -9.81, 0.5]}


@pytest.mark.parametrize("redundancy", ["minimum-norm", "stiffness"])
@pytest.mark.parametrize("make", [in_the_plane, in_space])
def test_friction_is_what_springs_would_do(make: Any, redundancy: str) -> None:
    """Torques of friction by hand from reactions and rates, put into the scene without friction as forces of springs: the same reactions, the same drive."""
    scene = make()
    if redundancy == "stiffness":
        scene["redundancy"] = "stiffness"
        soft = {"radial": 2e8} if scene["space"] == "planar" else {"radial": 2e8, "axial": 1e8, "tilt": 3e5}
        for i, joint in enumerate(scene["joint"]):
            joint["stiffness"] = {key: value * (1 + i) for key, value in soft.items()}
    names = [joint["name"] for joint in scene["joint"]]
    opened = linkdyn.Scene(rubbing(scene, MU))
    bare = linkdyn.Scene(scene)
    for t in (0.1, 0.7):
        run = opened.inverse(t=[t], want=FORCES)
        rate = run.joint_rate.values[0]
        press = np.hypot(run.reaction.values[0, :, 0], run.reaction.values[0, :, 1])
        torque = -MU * RADIUS * press * np.tanh(RADIUS * rate / CREEP)
        sprung = linkdyn.Scene(scene | {"spring": [{"name": f"brake_{name}", "joint": name, "force": f"{-value!r} N*m + 0 N*m/rad*stretch"} for name, value in zip(names, torque.tolist(), strict=True)]})
        by_hand, without = sprung.inverse(t=[t]), bare.inverse(t=[t])
        largest = np.abs(by_hand.reaction.values).max()
        assert np.abs(by_hand.driving_force.values - without.driving_force.values).max() > 1e-3 * np.abs(without.driving_force.values).max()
        assert np.abs(by_hand.reaction.values - without.reaction.values).max() > 1e-4 * largest
        np.testing.assert_allclose(run.reaction.values, by_hand.reaction.values, rtol=0, atol=1e-12 * largest)
        np.testing.assert_allclose(run.driving_force.values, by_hand.driving_force.values, rtol=0, atol=1e-12 * largest)


def test_shaft_in_two_bearings() -> None:
    """Least squares of forces, and of moments over half a metre, of a wheel out of the middle: its torque is that of both bearings."""
    scene = shaft() | {"gravity": [3.0, -9.0, 0.0]}
    run = linkdyn.Scene(rubbing(scene, MU)).inverse(q=[[0.4]], qd=[[5.0]], qdd=[[0.0]], want=FORCES)
    mass, size = scene["link"][0]["mass"], 0.5
    turn = np.array([[np.cos(0.4), -np.sin(0.4), 0.0], [np.sin(0.4), np.cos(0.4), 0.0], [0.0, 0.0, 1.0]])
    cog = turn @ np.array(scene["link"][0]["cog"])
    inertia = np.array(scene["link"][0]["inertia"])
    tensor = turn @ np.array([[inertia[0], inertia[3], inertia[5]], [inertia[3], inertia[1], inertia[4]], [inertia[5], inertia[4], inertia[2]]]) @ turn.T
    omega = np.array([0.0, 0.0, 5.0])
    weight = mass * np.array(scene["gravity"])
    inert = mass * np.cross(omega, np.cross(omega, cog))
    force = inert - weight
    moment = np.cross(omega, tensor @ omega) + np.cross(cog, force)
    # F1, F2, and of the moments what lies across the axis, over the size
    balance = np.zeros((5, 10))
    arm = np.array([0.0, 0.0, 0.5])
    for i in range(3):
        unit = np.eye(3)[i]
        balance[:3, i] = balance[:3, 3 + i] = unit
        balance[3:, 3 + i] = np.cross(arm, unit)[:2]
    balance[3:, 6:8] = balance[3:, 8:] = size * np.eye(2)
    found = np.linalg.lstsq(balance, np.concatenate([force, moment[:2]]), rcond=None)[0]
    press = np.hypot(*found[:2]) + np.hypot(*found[3:5])
    lost = MU * RADIUS * press
    np.testing.assert_allclose(run.reaction.values[0, :, :2], [found[:2], -found[3:5]], rtol=1e-12)    # the shaft is first of J2
    np.testing.assert_allclose(run.driving_force.values[0, 0], lost + moment[2], rtol=1e-12)
    np.testing.assert_allclose(run.friction_power.values.sum(), 5.0 * lost, rtol=1e-12)


@pytest.mark.parametrize("name", ["screws", "bennett", "agile_eye", "three cranks", "three", "elastic bennett", "four_legs"])
def test_forward_runs(name: str) -> None:
    """Forces of a motion lead along it; by constant forces inverse dynamics finds these again, and lanes alone go the same way."""
    scene = rubbing(SCENES[name])
    for actuator in scene["actuator"]:
        actuator["law"] = {"type": "inverse"}
    opened = linkdyn.Scene(scene)
    run = opened.forward(t_end=0.2)
    assert not run.status.values.any()
    np.testing.assert_allclose(run.q.values, opened.motion(run.time.values)[0], rtol=0, atol=FOLLOWS)
    for actuator in scene["actuator"]:
        actuator["law"] = {"type": "constant", "value": 0.3}
    opened = linkdyn.Scene(scene)
    run, lanes = (opened.forward(t_end=0.2, solver=solver) for solver in ("elimination", "gauss-jordan"))
    assert not run.status.values.any()
    again = opened.inverse(q=run.q.values, qd=run.qd.values, qdd=run.qdd.values)
    largest = max(1.0, np.abs(again.reaction.values).max())
    np.testing.assert_allclose(again.driving_force.values, 0.3, rtol=0, atol=1e-12 * largest)
    np.testing.assert_allclose(run.reaction.values, again.reaction.values, rtol=0, atol=1e-11 * largest)
    np.testing.assert_allclose(run.q.values, lanes.q.values, rtol=0, atol=FOLLOWS)
    assert np.abs(run.power_imbalance.values).max() < 1e-11


@pytest.mark.parametrize("rubs", [["J1"], ["J1", "J2"]], ids=["one", "both"])
def test_bearings_that_stick(rubs: list[str]) -> None:
    """Held by friction of what its bearings share, up to its last part; beyond, what is more than friction turns it."""
    scene = shaft() | {"gravity": [0.0, -9.81, 0.0]}
    scene["link"][0] |= {"cog": [0.0, 0.0, 0.2], "inertia": {"diagonal": [0.01, 0.02, 0.015]}}
    scene["coordinate"] = [{"joint": "J1", "start": 0.0}]
    still = linkdyn.Scene(scene).inverse(q=[[0.0]], qd=[[0.0]], qdd=[[0.0]])
    press = {name: np.hypot(*still.reaction.values[0, k, :2]) for k, name in enumerate(("J1", "J2"))}
    assert press["J1"] > 1.05 * press["J2"] > 1.0
    holds = MU * RADIUS * sum(press[name] for name in rubs)
    scene["friction"] = [{"joint": name, "coulomb": MU, "radius": RADIUS, "sticking": True} for name in rubs]
    for share in (0.999, 1.001, 1.5):
        scene["actuator"][0]["law"] = {"type": "constant", "value": float(share * holds)}
        run = linkdyn.Scene(scene).forward(t_end=0.5)
        expected = max(share - 1.0, 0.0) * holds / 0.015 * run.time.values
        np.testing.assert_allclose(run.qd.values[:, 0], expected, rtol=1e-8, atol=1e-12)


def test_sweeps_and_marks() -> None:
    scene = rubbing(in_space(), MU)
    opened = linkdyn.Scene(scene)
    run = opened.inverse(t=np.linspace(0.0, 1.0, 41))
    assert run.attrs["shared_reactions"].endswith(" J1.driving_force")
    assert "and what friction there makes of all others" in opened.explain()
    bare = linkdyn.Scene(in_space())
    assert "driving_force" not in bare.inverse(t=[0.0]).attrs["shared_reactions"] and "friction there" not in bare.explain()
    angles = np.linspace(0.1, 0.5, 9)
    scene["sweep"] = {"reduce": ["driving_force", "reaction_force"], "axis": [{"coordinate": "J1", "values": angles.tolist()}, {"rate": "J1", "values": [2.0]}]}
    sweep = linkdyn.Scene(scene).sweep()
    run = opened.inverse(q=angles[:, None], qd=np.full((9, 1), 2.0), qdd=np.zeros((9, 1)))
    np.testing.assert_allclose(sweep.driving_force_max.values[0], run.driving_force.values.max(), rtol=1e-12)


def test_what_is_refused() -> None:
    scene = rubbing(in_space())
    with pytest.raises(linkdyn.InputError, match="friction comes of reactions that the equations leave open, and has no error estimate"):
        linkdyn.Scene(scene).inverse(t=[0.0], want=["driving_force"], error=True)
    with pytest.raises(linkdyn.InputError, match="solver 'reduced' has no reactions, which friction at joint 'J1' comes from"):
        linkdyn.Scene(scene).inverse(t=[0.0], solver="reduced", want=["driving_force"])


def two_guides(length: tuple[float, float], gravity: list[float], velocity: float, push: list[float]) -> dict[str, Any]:
    """A table in two guides that brake each other by their tilting moments."""
    guides = {f"g{i}": {"at": at, "axis": [1, 0, 0]} for i, at in enumerate(([0, 0, 0], [0, 0.3, 0.1]))}
    table = {"name": "table", "markers": guides | {"hand": [0.3, 0.1, 0.3]}, "mass": 20.0, "cog": [0.04, 0.1, 0.06],
             "inertia": [4, 5, 3, 0.1, 0.2, -0.1]}
    return {
        "space": "spatial", "gravity": gravity, "frame": {"markers": guides}, "link": [table],
        "joint": [{"name": name, "type": "prismatic", "between": [f"frame.{name}", f"table.{name}"]} for name in guides],
        "coordinate": [{"joint": "g0", "start": {"position": 0.0, "velocity": velocity}}], "load": [{"on": "table.hand", "force": push}],
        "friction": [{"joint": name, "coulomb": GRIP[i], "length": length[i], "sticking": True} for i, name in enumerate(guides)]}


GRIP = (0.23, 0.24)


def grip_of_guides(reaction: Array, length: tuple[float, float]) -> Array:
    """What each can hold at most, of the pressures at its ends."""
    grip = np.empty(2)
    for i in range(2):
        across, tilt = reaction[i, 1:3], reaction[i, 4:6]
        arm = np.array([tilt[1], -tilt[0]]) / length[i]    # M x a over the length, seen along y and z
        grip[i] = GRIP[i] * (np.linalg.norm(across / 2 + arm) + np.linalg.norm(across / 2 - arm))
    return grip


def test_guides_that_stick_beside_each_other() -> None:
    """Both hold what moves the table, within what presses them."""
    length = (0.075, 0.04)
    scene = two_guides(length, [4.8, 7.1, 7.2], -0.1, [0, 0, 0]) | {"actuator": [{"joint": "g0", "law": {"type": "constant", "value": 5.0}}]}
    run = linkdyn.Scene(scene).forward(t=[0.0, 0.005, 0.0119], want="all")
    assert not run.status.values.any()
    assert abs(run.qd.values[1, 0]) > 0.01 and abs(run.qd.values[2, 0]) < 1e-15 and abs(run.qdd.values[2, 0]) < 1e-12
    force = run.clutch_force.values[2]
    np.testing.assert_allclose(force.sum(), -(20.0 * 4.8 + 5.0), rtol=1e-12)
    assert (abs(force) <= grip_of_guides(run.reaction.values[2], length) * (1 + 1e-11)).all()


@pytest.mark.parametrize("seed", [0, 1, 2, 4, 5, 7, 8])
def test_guides_at_rest_at_the_first_instant(seed: int) -> None:
    """Nothing is held by more than the grip, at the first sample either: what seems to hold while all do may have to slip."""
    random = np.random.default_rng(seed)
    length = tuple(random.uniform(0.03, 0.1, 2))
    scene = two_guides(length, list(random.uniform(-8, 8, 3)), 0.0, list(random.uniform(-30, 30, 3)))
    run = linkdyn.Scene(scene).forward(t=[0.0, 1e-4], want="all")
    assert not run.status.values.any()
    for sample in range(2):
        assert (abs(run.clutch_force.values[sample]) <= grip_of_guides(run.reaction.values[sample], length) * (1 + 1e-9)).all()
    np.testing.assert_allclose(run.qdd.values[0], run.qdd.values[1], rtol=1e-3, atol=1e-9)


def test_door_that_breaks_loose() -> None:
    """Its first hinge takes what it can, and what another holds then is at first but rounding: no reason to end the run."""
    hinges_at = {"h0": [0, 0, 0], "h1": [0, 0, 0.45], "h2": [0, 0, 1.0]}
    friction = [{"coulomb": 0.248, "radius": 0.0196, "length": 0.0675}, {"coulomb": 0.367, "radius": 0.0139, "collar": 0.0286}, {"coulomb": 0.357, "radius": 0.0107}]
    scene: dict[str, Any] = {
        "space": "spatial", "gravity": [2.68, 5.42, -8.76], "frame": {"markers": hinges_at},
        "link": [{"name": "door", "markers": {**hinges_at, "Q": [0.7, 0.1, 0.3]}, "mass": 20.0, "cog": [0.4, 0.01, 0.6], "inertia": [4, 5, 3, 0.1, 0.2, -0.1]}],
        "joint": [{"name": name, "type": "revolute", "between": [f"frame.{name}", f"door.{name}"]} for name in hinges_at],
        "coordinate": [{"joint": "h0", "start": 0.227}],
        "actuator": [{"joint": "h0", "law": {"type": "formula", "value": "18 N*m*sin(17.1 rad/s*time - 1.08 rad)"}}],
        "load": [{"on": "door.Q", "force": [17.4, -24.9, 26.4]}],
        "friction": [{"joint": name, "sticking": True, **of} for name, of in zip(hinges_at, friction, strict=True)]}
    run = linkdyn.Scene(scene).forward(t=[0.0, 0.016, 0.03], want="all")
    assert not run.status.values.any()
    np.testing.assert_array_equal(run.q.values[:2, 0], 0.227)
    still = linkdyn.Scene({key: part for key, part in scene.items() if key != "friction"}).inverse(q=run.q.values[:2], qd=np.zeros((2, 1)), qdd=np.zeros((2, 1)))
    np.testing.assert_allclose(run.clutch_force.values[1].sum() + run.driving_force.values[1, 0], still.driving_force.values[1, 0], rtol=1e-10)
    assert abs(run.qd.values[2, 0]) > 1e-4


def test_what_holds_while_all_rest() -> None:
    """A linkage comes to rest under a torque that swings: its hinges take turns in holding, one of them by what is but rounding."""
    run = linkdyn.load(Path(__file__).parent / "scenes" / "four_hinges_stick.toml").forward(t=[0.0, 0.034, 0.0365], want="all")
    assert run.attrs["stopped"] == "" and not run.status.values.any()
    assert run.qd.values[0, 0] > 1.0 and (np.abs(run.qd.values[1:, 0]) < 1e-12).all()


@pytest.mark.parametrize(("method", "tolerance"), [("rkf45", 1e-9), ("rkf45", 10**-10.3), ("seulex", 10**-9.3), ("seulex", 1e-11)])
def test_short_steps_lead_back_no_rounding(method: str, tolerance: float) -> None:
    """The first steps after the stop are short, and ask for what the hinges have turned since they hold in as short a time: of hinges that have turned
    by rounding alone that was accelerations that four hinges of a linkage cannot have at once, and runs ended there."""
    run = linkdyn.load(Path(__file__).parent / "scenes" / "four_hinges_stick.toml").forward(t=[0.0, 0.0325], method=method, rtol=tolerance, atol=tolerance / 100)
    assert run.attrs["stopped"] == "" and not run.status.values.any()
