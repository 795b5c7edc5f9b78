"""Several drives on one joint variable, and drives that strain each other: by hand, by the same mechanism with a known torque in place of one, by the legs' directions."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn import Builder
from test_gears import SWAY, pair
from test_generate import Compiled
from test_redundancy import eight_legs
from test_trains import parallelogram, planets

pytestmark = pytest.mark.accuracy


def refused(scene: dict[str, Any]) -> str:
    with pytest.raises(linkdyn.SceneError) as error:
        linkdyn.Scene(scene).inverse()
    return str(error.value)


def two_motors(**more: Any) -> dict[str, Any]:
    """A pinion with two motors drives a wheel."""
    return pair(mesh="external") | {"actuator": [{"joint": "A"}, {"joint": "A", "name": "second", **more}]}


@pytest.mark.parametrize("share", [1.0, 3.0])
def test_two_motors_on_one_shaft(share: float) -> None:
    alone = linkdyn.Scene(pair(mesh="external")).inverse(want="all")
    both = linkdyn.Scene(two_motors(share=share)).inverse(want="all")
    assert list(both.actuator.values) == ["A", "A:second"]
    total = alone.driving_force.values[:, 0]
    np.testing.assert_allclose(both.driving_force.values, np.outer(total, np.array([1, share]) / (1 + share)), rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(both.reaction.values, alone.reaction.values, atol=1e-12 * np.abs(alone.reaction.values).max())
    assert np.abs(both.power_imbalance).max() < 1e-13
    np.testing.assert_array_equal(both.driving_speed.values[:, 0], both.driving_speed.values[:, 1])


def test_a_motor_that_drags_another() -> None:
    """A law on the one, what the motion asks for on the other: forward, the mechanism with both keeps to the motion."""
    scene = two_motors()
    scene["actuator"][1]["law"] = {"type": "spring-damper", "damping": 0.4}
    run = linkdyn.Scene(scene).inverse(want="all")
    # the first gives in a forward run what the motion takes and the second's damper, which is what inverse dynamics finds with it as a spring
    assisted = pair(mesh="external")
    assisted["spring"] = [{"name": "second", "joint": "A", "damping": 0.4}]
    single = linkdyn.Scene(assisted).inverse(want="all")
    np.testing.assert_allclose(single.driving_force.values[:, 0], run.driving_force.values.sum(axis=1) + 0.4 * run.driving_speed.values[:, 0], rtol=1e-11, atol=1e-12)
    scene["actuator"][0]["law"] = {"type": "formula", "value": "3 N*m*sin(5*time/(1 s))"}
    both = linkdyn.Scene(scene).forward(t=np.linspace(0, 1, 11), rtol=1e-10, atol=1e-10)
    assisted["actuator"][0]["law"] = scene["actuator"][0]["law"]
    one = linkdyn.Scene(assisted).forward(t=np.linspace(0, 1, 11), rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(both.q.values, one.q.values, atol=1e-8)


def test_forward_after_inverse() -> None:
    scene = two_motors(share=2.0, preload="3 N*m")
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 1, 11), rtol=1e-11, atol=1e-11, want="all")
    np.testing.assert_allclose(run.q.values, linkdyn.Scene(scene).motion(run.time.values)[0], atol=1e-7)
    inverse = linkdyn.Scene(scene).inverse(*linkdyn.Scene(scene).motion(run.time.values))
    np.testing.assert_allclose(run.driving_force.values, inverse.driving_force.values, atol=1e-6)


def test_two_motors_with_rotors() -> None:
    """Each rotor is felt through its own ratio."""
    scene = two_motors(drive={"ratio": 20, "rotor_inertia": 2e-4})
    scene["actuator"][0]["drive"] = {"ratio": 10, "rotor_inertia": 1e-4}
    run = linkdyn.Scene(scene).inverse(want="all")
    alone = pair(mesh="external")
    alone["link"][0]["inertia"] += 10**2 * 1e-4 + 20**2 * 2e-4
    single = linkdyn.Scene(alone).inverse()
    np.testing.assert_allclose(run.driving_force.values.sum(axis=1), single.driving_force.values[:, 0], rtol=1e-11, atol=1e-12)
    assert list(run.motor.values) == ["A", "A:second"]


@pytest.mark.parametrize("torque", [0.0, 7.0, -20.0])
def test_preload_on_one_shaft(torque: float) -> None:
    """Motors that strain each other: half of the work each, and the preload against each other."""
    scene = two_motors(preload=-torque)
    scene["actuator"][0]["preload"] = torque
    total = linkdyn.Scene(pair(mesh="external")).inverse().driving_force.values[:, 0]
    run = linkdyn.Scene(scene).inverse()
    np.testing.assert_allclose(run.driving_force.values, np.outer(total, [0.5, 0.5]) + np.array([torque, -torque]), rtol=1e-12, atol=1e-12)


def test_preload_goes_through_the_rod() -> None:
    """Both cranks of a parallelogram driven against each other: the rod is as strained as with that torque for a load."""
    scene = parallelogram()
    scene["joint"].pop()
    scene["coordinate"][0]["motion"] = SWAY | {"mean": 0.9, "amplitude": 0.5}
    scene["actuator"] = [{"joint": "A", "preload": 6.0}, {"joint": "D", "preload": -6.0}]
    scene["joint"][2]["branch"] = 1
    run = linkdyn.Scene(scene).inverse(want="all")
    assert (run.status == 0).all() and np.abs(run.power_imbalance).max() < 1e-13
    plain = copy.deepcopy(scene)
    for actuator in plain["actuator"]:
        actuator.pop("preload")
    mean = linkdyn.Scene(plain).inverse().driving_force.values
    np.testing.assert_allclose(mean[:, 0], mean[:, 1], rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(run.driving_force.values - mean, np.tile([6.0, -6.0], (len(mean), 1)), rtol=1e-10)
    k = 57
    known = copy.deepcopy(scene)
    known["actuator"] = [{"joint": "A"}]
    known["load"] = [*scene["load"], {"on": "crank2.D", "moment": float(run.driving_force.values[k, 1])}]
    single = linkdyn.Scene(known).inverse()
    np.testing.assert_allclose(single.driving_force.values[k, 0], run.driving_force.values[k, 0], rtol=1e-10)
    np.testing.assert_allclose(single.reaction.values[k], run.reaction.values[k], atol=1e-10 * np.abs(run.reaction.values).max())


def test_preloaded_legs() -> None:
    """Eight legs of which one pulls: the forces are the nearest to that which the platform allows, by the legs' directions."""
    scene, base, platform = eight_legs()
    scene["chain"][0]["actuated"] = False
    share = 1.0 + 0.25 * np.arange(8)
    preload = np.array([400.0, 0, 0, -100.0, 0, 0, 0, 0])
    scene["actuator"] = [{"joint": f"leg{i + 1}.P", "share": float(share[i]), "preload": float(preload[i])} for i in range(8)]
    q = np.array([[0.02, -0.01, 0.6, 0.03, 0.02, 0.1]])
    rates, second = np.full((1, 6), 0.2), np.full((1, 6), -0.5)
    strained = linkdyn.Scene(scene)
    run = strained.inverse(q=q, qd=rates, qdd=second, want=["driving_force", "reaction", "checks"])
    assert np.abs(run.power_imbalance.values).max() < 1e-13
    for actuator in scene["actuator"]:
        actuator.pop("preload")
    free = linkdyn.Scene(scene).inverse(q=q, qd=rates, qdd=second).driving_force.values[0]
    poses = strained.poses(q=q)
    arms = platform @ poses.rotation[0, 0].T
    legs = poses.position[0, 0] + arms - base
    legs /= np.linalg.norm(legs, axis=1)[:, np.newaxis]
    wrenches = np.concatenate([legs, np.cross(arms, legs)], axis=1).T               # of unit forces of the legs (6, leg)
    # the part of the preload that moves nothing, in the norm of the shares
    root = np.sqrt(share)
    weighted = wrenches * root
    idle = np.eye(8) - np.linalg.pinv(weighted) @ weighted
    np.testing.assert_allclose(run.driving_force.values[0] - free, root * (idle @ (preload / root)), atol=1e-9 * np.abs(preload).max())
    assert np.abs(run.driving_force.values[0] - free).max() > 20.0


def test_a_preloaded_differential() -> None:
    """Sun and arm driven besides the ring: three drives for two freedoms; the strain has no power at any speeds, by Willis."""
    scene = planets(2, ring_moves=True)
    scene["actuator"] = [{"joint": "S", "preload": 5.0}, {"joint": "R"}, {"joint": "C"}]
    run = linkdyn.Scene(scene).inverse(want="all")
    plain = copy.deepcopy(scene)
    plain["actuator"][0].pop("preload")
    strain = run.driving_force.values - linkdyn.Scene(plain).inverse().driving_force.values
    np.testing.assert_allclose(strain / strain[:, :1], np.tile(np.array([24.0, 60.0, -84.0]) / 24.0, (len(strain), 1)), rtol=1e-8)
    assert np.abs((strain * run.driving_speed.values).sum(axis=1)).max() < 1e-10
    expected = 5.0 * np.array([24.0, 60.0, -84.0]) * 24.0 / (24.0**2 + 60.0**2 + 84.0**2)
    np.testing.assert_allclose(strain, np.tile(expected, (len(strain), 1)), rtol=1e-8)


def test_what_is_refused() -> None:
    twice = two_motors()
    twice["actuator"][1].pop("name")
    assert "already driven" in refused(twice) and "a 'name' of its own" in refused(twice)
    same = two_motors()
    same["actuator"].append({"joint": "A", "name": "second"})
    assert "already driven" in refused(same)
    assert "holds a colon" in refused(two_motors() | {"actuator": [{"joint": "A"}, {"joint": "A", "name": "a:b"}]})
    lone = pair(mesh="external")
    lone["actuator"][0]["preload"] = 3.0
    assert "actuator 'A': its 'preload' has no effect" in refused(lone)
    third = parallelogram("A")
    third["link"].append({"name": "other", "markers": {"X": [0, 0]}, "mass": 1.0, "inertia": 0.01})
    third["frame"]["markers"]["X"] = [1.0, 0]
    third["joint"].append({"name": "X", "type": "revolute", "between": ["frame.X", "other.X"]})
    third["coordinate"].append({"joint": "X", "motion": 0.1})
    third["actuator"] = [{"joint": "A"}, {"joint": "D"}, {"joint": "X", "preload": 1.0}]
    assert "actuator 'X': its 'preload' has no effect" in refused(third)


def strained_cranks() -> dict[str, Any]:
    """A parallelogram driven at both cranks against each other."""
    scene = parallelogram()
    scene["joint"].pop()
    scene["joint"][2]["branch"] = 1
    scene["coordinate"][0]["motion"] = SWAY | {"mean": 0.9, "amplitude": 0.5}
    return scene | {"actuator": [{"joint": "A", "preload": 6.0, "share": 2.0}, {"joint": "D", "preload": -6.0}]}


def strained_legs() -> dict[str, Any]:
    scene, _, _ = eight_legs()
    scene["chain"][0]["actuated"] = False
    return scene | {"actuator": [{"joint": f"leg{i + 1}.P", "share": 1 + 0.25 * i, "preload": 100.0 * (-1) ** i} for i in range(8)]}


@pytest.mark.parametrize("scene", [two_motors(share=3.0, preload="4 N*m"), two_motors(drive={"ratio": 20, "rotor_inertia": 2e-4}), strained_cranks(), strained_legs()],
                         ids=["one shaft", "rotors", "cranks", "legs"])
def test_by_record_and_on_lanes(scene: dict[str, Any]) -> None:
    """The record has how drives share the work among its equations, the lanes behind them: by two other solvers the same forces, and power is in balance."""
    mechanism = linkdyn.Scene(scene)
    assert "Record of inverse dynamics\n  all unknowns:" in mechanism.explain()
    random = np.random.default_rng(5)
    q, qd, qdd = (x + scale * random.normal(size=x.shape) for x, scale in zip(mechanism.motion(random.uniform(0, 2, 200)), (0.01, 1.0, 3.0)))
    record = mechanism.inverse(q=q, qd=qd, qdd=qdd, want="all")
    assert (record.status == 0).all() and np.abs(record.power_imbalance).max() < 1e-13
    for solver in ("lapack", "gauss-jordan"):
        lanes = mechanism.inverse(q=q, qd=qd, qdd=qdd, solver=solver)
        for result in ("driving_force", "reaction"):
            np.testing.assert_allclose(record[result].values, lanes[result].values, atol=1e-12 * np.abs(lanes[result].values).max())


def test_code_of_shared_drives(tmp_path: Path) -> None:
    assert "FORWARD_ACTUATOR_A_SECOND" in linkdyn.Scene(two_motors()).generate(kernel="forward").header
    scene = linkdyn.Scene(strained_cranks())
    compiled = Compiled(scene.generate(want=["driving_force", "reaction"], name="cranks"), tmp_path)
    run = scene.inverse()
    loads = scene.load_values(run.time.values)[:, :, [0, 1, 5]]
    for i in range(0, len(run.time), 10):
        status, found = compiled(q=run.q[i], qd=run.qd[i], qdd=run.qdd[i], load=loads[i])
        assert status == 0
        for result in ("driving_force", "reaction"):
            np.testing.assert_allclose(found[result], run[result].values[i], atol=1e-12 * np.abs(run[result].values).max())


def test_paths_of_changes() -> None:
    scene = linkdyn.Scene(two_motors())
    run = scene.with_({"actuator.second.share": 2.0}).inverse()
    np.testing.assert_allclose(run.driving_force.values[:, 1], 2 * run.driving_force.values[:, 0], rtol=1e-12, atol=1e-13)


def test_built_in_python() -> None:
    builder = Builder("A pendulum", "planar")
    rod = builder.link("rod", mass=2, inertia=0.06, cog=("0.3 m", 0), markers={"A": (0, 0)})
    pin = builder.revolute("A", builder.frame.marker("A", (0, 0)), rod["A"])
    builder.coordinate(pin, motion=0.3)
    builder.actuator(pin, preload=2.0)
    builder.actuator(pin, name="second", share=1.0)
    np.testing.assert_allclose(builder.scene().inverse(t=[0.0]).driving_force.values[0], [1.0, -1.0], atol=1e-12)
