"""Screws in closed loops, several turns of them: against loops closed by hand, which know of turns what the engine is not told."""
from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_joint_kinds import along, lift, pusher

import linkdyn

LAW = "polynomial-345"


def angles(run: Any) -> np.ndarray:
    assert (run.status == 0).all()
    return run.joint_variable.sel(variable="S.angle").values


def angle_of_lift(arm: np.ndarray, lead: float) -> np.ndarray:
    """By the distance of the ball from the spindle's foot, 0.7 m at the start."""
    return (np.hypot(0.7 * np.cos(arm) - 0.7, 0.5 - 0.7 * np.sin(arm)) - 0.7) * 2 * np.pi / lead


def angle_of_pusher(spindle: np.ndarray, lead: float) -> np.ndarray:
    """The stay's length holds the nut: one equation for its turn, followed in steps of the spindle's angle from zero on."""
    h = lead / (2 * np.pi)

    def off(nut: float, turned: float) -> float:
        return (0.2 * np.cos(nut) - 0.2) ** 2 + (0.2 * np.sin(nut) + 0.6) ** 2 + (h * (nut - turned)) ** 2 - 0.36

    nut, found = 0.0, []
    for turned in spindle:
        for _ in range(50):
            step = off(nut, turned) * 2e-6 / (off(nut + 1e-6, turned) - off(nut - 1e-6, turned))
            nut -= step
            if abs(step) < 1e-13:
                break
        found.append(0.5 / h + nut - turned)
    return np.array(found)


def pusher_of(lead: float) -> dict[str, Any]:
    scene = pusher(0.3)
    scene["joint"][1].update(lead=lead, start=np.pi / lead)    # half a metre
    scene["link"][2].update(cog=[0, 0.3, 0], inertia=[0.01, 0.001, 0.01, 0, 0, 0])
    return scene


@pytest.mark.accuracy
@pytest.mark.parametrize("lead", [0.2, 0.05, 0.006])
def test_screw_turned_by_its_loop(lead: float) -> None:
    """Up to twenty turns, along a motion and each sample on its own."""
    data = lift()
    data["joint"][2]["lead"] = lead
    data["coordinate"] = [along("O", {"law": LAW, "from": 0.0, "to": "-10 deg", "duration": 2.0})]
    data["actuator"] = [{"joint": "O"}]
    scene = linkdyn.Scene(data)
    t = np.linspace(0, 2, 601)
    q, qd, qdd = scene.motion(t)
    expected = angle_of_lift(q[:, 0], lead)
    assert np.ptp(expected) > 0.1 / lead
    run = scene.inverse(t=t, want="all")
    np.testing.assert_allclose(angles(run), expected, rtol=0, atol=1e-13 * np.ptp(expected))
    order = np.random.default_rng(1).permutation(len(t))
    alone = scene.inverse(q=q[order], qd=qd[order], qdd=qdd[order], want="all")
    np.testing.assert_allclose(angles(alone), expected[order], rtol=0, atol=1e-13 * np.ptp(expected))
    np.testing.assert_allclose(alone.driving_force.values, run.driving_force.values[order], rtol=1e-10, atol=1e-10 * np.abs(run.driving_force.values).max())


@pytest.mark.accuracy
@pytest.mark.parametrize(("lead", "turns", "samples"), [(0.05, 3, 2001), (0.05, -4, 41), (0.005, 30, 301), (0.002, 100, 1001), (0.002, 60, 41)])
def test_nut_keeps_its_turn(lead: float, turns: int, samples: int) -> None:
    """Only the spindle's hinge is given, and after a turn of it all but the nut's height looks the same; from sample to sample up to three turns."""
    data = pusher_of(lead)
    data["coordinate"] = [along("A", {"law": LAW, "from": 0.0, "to": f"{turns} rev", "duration": 1.0})]
    data["actuator"] = [{"joint": "A"}]
    scene = linkdyn.Scene(data)
    often = scene.motion(np.linspace(0, 1, 8 * samples - 7))[0][:, 0]
    run = scene.inverse(t=np.linspace(0, 1, samples), want="all")
    np.testing.assert_allclose(angles(run), angle_of_pusher(often, lead)[::8], rtol=1e-14)


@pytest.mark.accuracy
@pytest.mark.parametrize("method", ["rk8pd", "gbs"])
@pytest.mark.parametrize(("lead", "tolerance"), [(0.05, 1e-10), (0.05, 1e-4), (0.01, 1e-6)])
def test_nut_sinks(method: str, lead: float, tolerance: float) -> None:
    """Let go, it turns the spindle, in steps as long as the tolerance lets them be: at the end of each it is where that says, and energy is kept."""
    run = linkdyn.Scene(pusher_of(lead)).forward(t=np.linspace(0, 1.0, 101), method=method, rtol=tolerance, atol=tolerance, want="all")
    turned = run.q.values[:, 0]
    assert turned[-1] > 1.5 * np.pi
    often = np.interp(np.linspace(0, 100, 1601), np.arange(101), turned)
    np.testing.assert_allclose(angles(run), angle_of_pusher(often, lead)[::16], rtol=1e-13)
    energy = (run.kinetic_energy + run.potential_energy).values
    assert np.ptp(energy) < 100 * tolerance * run.kinetic_energy.values.max()


AXLE = [0, 1, 0]


def boom(by: str, lead: float, turns: float = 20.0) -> dict[str, Any]:
    """An arm lifted by a nut on a spindle, which is borne in a trunnion; led by the screw's angle, or by that of the spindle's bearing."""
    ball = np.array([0.7 * np.cos(np.radians(20)), 0, 0.7 * np.sin(np.radians(20))])
    foot = np.array([0.7, 0, -0.5])
    reach = float(np.linalg.norm(ball - foot))
    lean = {"angles": [0, float(np.arctan2(ball[0] - foot[0], ball[2] - foot[2])), 0]}
    at_foot, at_ball = {"position": foot.tolist(), **lean}, {"position": ball.tolist(), **lean}
    return {
        "space": "spatial", "gravity": [0, 0, -9.81],
        "frame": {"markers": {"O": {"at": [0, 0, 0], "axis": AXLE}, "U": {"at": foot.tolist(), "axis": AXLE}}},
        "link": [
            {"name": "arm", "mass": 12.0, "cog": [0.5, 0, 0.02], "inertia": [0.1, 1.0, 1.0, 0, 0, 0], "start": {"angles": [0, "-20 deg", 0]},
             "markers": {"O": {"at": [0, 0, 0], "axis": AXLE}, "B": {"at": [0.7, 0, 0], "axis": AXLE}}},
            {"name": "housing", "mass": 2.0, "inertia": [0.02, 0.02, 0.005, 0, 0, 0], "start": at_foot,
             "markers": {"U": {"at": [0, 0, 0], "axis": AXLE}, "R": {"at": [0, 0, 0.1], "axis": [0, 0, 1]}, "M": {"at": [0, 0.1, 0.1], "axis": [0, 0, 1]}}},
            {"name": "spindle", "mass": 2.0, "cog": [0, 0, 0.2], "inertia": [0.03, 0.03, 0.0008, 0, 0, 0], "start": at_foot,
             "markers": {"R": {"at": [0, 0, 0.1], "axis": [0, 0, 1]}, "S": {"at": [0, 0, reach], "axis": [0, 0, 1]}}},
            {"name": "nut", "mass": 1.0, "inertia": [0.01, 0.01, 0.008, 0, 0, 0], "start": at_ball,
             "markers": {"S": {"at": [0, 0, 0], "axis": [0, 0, 1]}, "B": {"at": [0, 0, 0], "axis": AXLE}}},
        ],
        "joint": [
            {"name": "O", "type": "revolute", "between": ["frame.O", "arm.O"]},
            {"name": "U", "type": "revolute", "between": ["frame.U", "housing.U"]},
            {"name": "R", "type": "revolute", "between": ["housing.R", "spindle.R"]},
            {"name": "S", "type": "screw", "lead": lead, "between": ["spindle.S", "nut.S"]},
            {"name": "B", "type": "revolute", "between": ["nut.B", "arm.B"]},
        ],
        "coordinate": [along(by, {"law": LAW, "from": 0.0, "to": f"{turns} rev", "duration": 2.0})], "actuator": [{"joint": by}],
        "time": {"samples": 201},
    }


def with_motor(scene: dict[str, Any], teeth: list[int], turns: float) -> dict[str, Any]:
    """On the housing beside the spindle, geared to it."""
    housing = scene["link"][1]["start"]
    scene["link"].append({"name": "motor", "mass": 1.0, "inertia": [1e-3, 1e-3, 1e-3, 0, 0, 0], "start": housing,
                          "markers": {"M": {"at": [0, 0.1, 0.1], "axis": [0, 0, 1]}}})
    scene["joint"] += [{"name": "M", "type": "revolute", "between": ["housing.M", "motor.M"]},
                       {"name": "Z", "type": "gear", "teeth": teeth, "between": ["motor.M", "spindle.R"]}]
    scene["coordinate"] = [along("M", {"law": LAW, "from": 0.0, "to": f"{turns} rev", "duration": 2.0})]
    scene["actuator"] = [{"joint": "M"}]
    return scene


def angle_of_boom(run: Any, lead: float) -> np.ndarray:
    """Of the screw, by the arm's: the nut's distance from the trunnion."""
    arm = run.joint_variable.sel(variable="O.angle").values
    reach = np.hypot(0.7 * np.cos(arm) - 0.7, 0.5 - 0.7 * np.sin(arm))
    return (reach - np.hypot(0.7 * np.cos(np.radians(20)) - 0.7, 0.5 + 0.7 * np.sin(np.radians(20)))) * 2 * np.pi / lead


@pytest.mark.accuracy
@pytest.mark.parametrize("lead", [0.006, 0.001])
def test_fine_thread_led_by_its_angle(lead: float) -> None:
    """As many digits as where the spindle's bearing leads, so that a record serves it, which code is made of; each sample on its own and along the way."""
    by_screw, by_bearing = linkdyn.Scene(boom("S", lead)), linkdyn.Scene(boom("R", lead, -20.0))
    assert "driving_force" in by_screw.generate("inverse", want=["driving_force"]).header
    run, other = by_screw.inverse(want="all"), by_bearing.inverse(want="all")
    np.testing.assert_allclose(angle_of_boom(run, lead), angles(run), rtol=0, atol=1e-12 / lead)
    np.testing.assert_allclose(run.joint_variable.sel(variable="R.angle"), -angles(run), rtol=0, atol=1e-12)
    largest = np.abs(other.driving_force.values).max()
    np.testing.assert_allclose(run.driving_force.values, -other.driving_force.values, rtol=0, atol=1e-9 * largest)
    q, qd, qdd = by_screw.motion()
    order = np.random.default_rng(1).permutation(len(q))
    alone = by_screw.inverse(q=q[order], qd=qd[order], qdd=qdd[order])
    np.testing.assert_allclose(alone.driving_force.values, run.driving_force.values[order], rtol=0, atol=1e-9 * largest)


@pytest.mark.accuracy
def test_spindle_geared_to_its_motor() -> None:
    """Samples on their own, up to a hundred turns of the motor from the start: a stride is as long as takes the nut a tenth of the mechanism's size."""
    scene = linkdyn.Scene(with_motor(boom("S", 0.006), [20, 60], 100.0))
    q, qd, qdd = scene.motion()
    order = np.random.default_rng(2).permutation(len(q))
    alone, along_way = scene.inverse(q=q[order], qd=qd[order], qdd=qdd[order], want="all"), scene.inverse(want="all")
    np.testing.assert_allclose(angles(along_way), angle_of_boom(along_way, 0.006), rtol=0, atol=1e-9)
    np.testing.assert_allclose(angles(along_way), q[:, 0] / 3, rtol=1e-12, atol=1e-11)
    np.testing.assert_allclose(angles(alone), angles(along_way)[order], rtol=1e-12, atol=1e-11)
