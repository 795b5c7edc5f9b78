"""Gears and screws that lose some of their motors' torques: rates by records against a slider-crank written from scratch, against runs on lanes, where
losses grow from zero, by hand, and by the balance of power."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from scipy.integrate import solve_ivp

pytestmark = pytest.mark.accuracy

ROOT = Path(__file__).parents[2]
SHARP: dict[str, Any] = {"rtol": 1e-11, "atol": 1e-12}

# ---------------------------------------------------------------- a slider-crank from scratch

R, LENGTH, INERTIA, MASS, PUSH = 0.1, 0.35, 0.02, 1.5, -30.0
RATIO, ROTOR, EFFICIENCY, BACK, CREEP = 12.0, 3e-4, 0.75, 0.55, 0.1


def torque(t: float) -> float:
    return 0.6 * np.cos(9 * t) + 0.1


def crank_rates(t: float, y: Any) -> list[float]:
    """M q'' + M' q'^2/2 = F' + P x', n T = n^2 J q'' + F' + R: of both sides on which the power may flow that on which it does."""
    angle, rate = y
    tiny = 1e-30

    def way(angle: complex) -> complex:
        """dx/dq of the piston."""
        return -R * np.sin(angle) - R**2 * np.sin(angle) * np.cos(angle) / np.sqrt(LENGTH**2 - R**2 * np.sin(angle) ** 2)

    x, x2 = way(angle).real, way(angle + 1j * tiny).imag / tiny
    mass, bias = INERTIA + MASS * x**2, MASS * x * x2 * rate**2
    part = np.tanh(abs(RATIO * rate) / CREEP)
    sense = np.copysign(1.0, rate)
    fits = []
    for drives, share in ((True, 1 / EFFICIENCY - 1), (False, 1 - BACK)):
        # F' (1 + s c part sgn F') + n^2 J q'' = n T
        factor = 1 + share * part * (1 if drives else -1)
        acceleration = (RATIO * torque(t) - factor * (bias - PUSH * x)) / (RATIO**2 * ROTOR + factor * mass)
        transmitted = mass * acceleration + bias - PUSH * x
        if (transmitted * sense > 0) == drives:
            fits.append(acceleration)
    assert len(fits) == 1
    return [rate, fits[0]]


def slider_crank() -> dict[str, Any]:
    """The rod has no mass."""
    return {
        "space": "planar",
        "gravity": [0.0, 0.0],
        "frame": {"markers": {"O": [0.0, 0.0], "X": {"at": [0.0, 0.0], "axis": [1.0, 0.0]}}},
        "link": [
            {"name": "crank", "markers": {"O": [0.0, 0.0], "A": [R, 0.0]}, "mass": 1.0, "inertia": INERTIA},
            {"name": "rod", "markers": {"A": [0.0, 0.0], "B": [LENGTH, 0.0]}, "mass": 0.0, "inertia": 0.0},
            {"name": "piston", "markers": {"B": [0.0, 0.0], "X": {"at": [0.0, 0.0], "axis": [1.0, 0.0]}}, "mass": MASS, "inertia": 0.01},
        ],
        "joint": [
            {"name": "O", "type": "revolute", "between": ["frame.O", "crank.O"]},
            {"name": "A", "type": "revolute", "between": ["crank.A", "rod.A"]},
            {"name": "B", "type": "revolute", "between": ["rod.B", "piston.B"], "branch": 1},
            {"name": "X", "type": "prismatic", "between": ["frame.X", "piston.X"]},
        ],
        "coordinate": [{"joint": "O", "start": {"position": 0.4, "velocity": 3.0}}],
        "load": [{"on": "piston.B", "force": [PUSH, 0.0]}],
        "actuator": [
            {
                "joint": "O",
                "law": {"type": "formula", "value": "0.6 N*m*cos(9 rad/s*time) + 0.1 N*m", "at": "motor"},
                "drive": {"ratio": RATIO, "rotor_inertia": ROTOR, "efficiency": EFFICIENCY, "back_efficiency": BACK, "creep_speed": CREEP},
            }
        ],
    }


@pytest.mark.parametrize("method", ["gbs", "rkf45"])
def test_slider_crank_from_scratch(method: str) -> None:
    t = np.linspace(0, 1.0, 41)
    own = solve_ivp(crank_rates, (0, 1.0), [0.4, 3.0], method="DOP853", t_eval=t, rtol=1e-11, atol=1e-12, max_step=2e-3)
    scene = slider_crank()
    run = linkdyn.Scene(scene).forward(t=t, want="all", method=method, **SHARP)
    assert (run.status == 0).all()
    # power flows both ways, and the crank turns both ways
    transmitted = run.motor_torque.values[:, 0] * RATIO - RATIO**2 * ROTOR * run.qdd.values[:, 0]
    power = transmitted * run.qd.values[:, 0]
    assert power.max() > 1 and power.min() < -1
    assert run.qd.values.max() > 1 and run.qd.values.min() < -1
    assert np.abs(run.q.values[:, 0] - own.y[0]).max() < 1e-8
    assert np.abs(run.qd.values[:, 0] - own.y[1]).max() < 1e-7
    assert np.abs(run.power_imbalance).max() < 1e-10


# ---------------------------------------------------------------- several motors


def five_bar(friction: bool) -> dict[str, Any]:
    scene, rubbing = (tomllib.loads((ROOT / "tests" / "scenes" / f"{name}.toml").read_text()) for name in ("fivebar_lossy", "rubbing/fivebar"))
    for actuator, value in zip(scene["actuator"], ("1.5 N*m*cos(5 rad/s*time)", "-0.9 N*m*cos(7 rad/s*time)"), strict=True):
        actuator["law"] = {"type": "formula", "value": value, "at": "motor"}
    return scene | {"friction": rubbing["friction"]} if friction else scene


def hexapod() -> dict[str, Any]:
    """Legs that are sprung at their motors."""
    scene = tomllib.loads((ROOT / "examples" / "stewart_forward" / "scene.toml").read_text())
    scene["measures"] = {}
    for i, actuator in enumerate(scene["actuator"]):
        law = actuator["law"]
        scene["measures"][f"l{i}"] = {"joint": actuator["joint"]}
        scene["measures"][f"v{i}"] = {"joint": actuator["joint"], "rate": True}
        value = f"(2000 N/m*({law['target']['from']} m + 0.03 m*sin({5 + i} rad/s*time) - l{i}) - 20 N*s/m*v{i})/(600 rad/m)"
        actuator["law"] = {"type": "formula", "value": value, "at": "motor"}
        actuator["drive"] = {"ratio": 600, "rotor_inertia": 1e-5, "efficiency": 0.9 - 0.05 * i, "back_efficiency": 0.8 - 0.1 * i}
    return scene


@pytest.mark.parametrize(("name", "friction"), [("five bars", False), ("five bars", True), ("hexapod", False)])
def test_records_go_the_way_of_lanes(name: str, friction: bool) -> None:
    """By closed forms and rounds, and by continuation from no loss: they share no formula."""
    scene = linkdyn.Scene(hexapod() if name == "hexapod" else five_bar(friction))
    t = np.linspace(0, 0.6, 61)
    by_record, by_lanes = (scene.forward(t=t, want="all", method="gbs", solver=solver, **SHARP) for solver in ("elimination", "lapack"))
    for run in (by_record, by_lanes):
        assert (run.status == 0).all()
        assert np.abs(run.power_imbalance).max() < 1e-9
    assert np.abs(by_record.q - by_lanes.q).max() < 1e-8
    assert np.abs(by_record.qd - by_lanes.qd).max() < 1e-7
    np.testing.assert_allclose(by_record.transmission_loss, by_lanes.transmission_loss, atol=1e-6 * float(by_lanes.transmission_loss.max()))
    assert (by_record.transmission_loss >= 0).all() and (by_record.transmission_loss.values.max(axis=0) > 0).all()
    # the work of the driving forces, which the run integrates along with its states, and what these are
    np.testing.assert_allclose(by_record.work, by_lanes.work, atol=1e-7 * float(np.abs(by_lanes.work).max()))
    np.testing.assert_allclose(by_record.motor_power - by_record.transmission_loss, by_record.driving_power, atol=1e-9 * float(by_record.motor_power.max()))


@pytest.mark.parametrize("method", ["gbs", "rkf45"])
@pytest.mark.parametrize("back", [0.55, -0.1])
def test_losses_and_friction_settle_together(back: float, method: str) -> None:
    """A slide and a hinge that rub hard beside a gear that loses much, by single samples and by many at once."""
    scene = slider_crank()
    scene["actuator"][0]["drive"].update(efficiency=0.45, back_efficiency=back)
    scene["friction"] = [{"joint": "X", "coulomb": 0.3, "creep_speed": "0.1 m/s"}, {"joint": "O", "coulomb": 0.3, "radius": "30 mm", "creep_speed": "0.05 m/s"}]
    t = np.linspace(0, 0.5, 26)
    by_record, by_lanes = (linkdyn.Scene(scene).forward(t=t, want="all", method=method, solver=solver, **SHARP) for solver in ("elimination", "lapack"))
    for run in (by_record, by_lanes):
        assert (run.status == 0).all()
        assert np.abs(run.power_imbalance).max() < 1e-9
    assert by_record.qd.values.min() < -1 and by_record.qd.values.max() > 1
    assert np.abs(by_record.q - by_lanes.q).max() < 1e-9
    assert np.abs(by_record.qd - by_lanes.qd).max() < 1e-8
    np.testing.assert_allclose(by_record.transmission_loss, by_lanes.transmission_loss, atol=1e-7 * float(by_lanes.transmission_loss.max()))


def test_hoist_both_ways() -> None:
    """A drum with a load on its rope, behind a worm gear: up by its efficiency, down by that of the way back, which the motor has to help or not."""
    ratio, inertia, mass, radius, rotor = 40.0, 0.8, 150.0, 0.2, 2e-3
    load = mass * 9.81 * radius
    for efficiency, back, motor, start in ((0.7, 0.57, 12.0, 1.0), (0.7, 0.57, 2.0, -1.0), (0.45, -0.2, 0.0, -1.0), (0.45, -0.2, -9.0, -1.0)):
        scene = {
            "space": "planar",
            "frame": {"markers": {"O": [0.0, 0.0]}},
            "link": [{"name": "drum", "mass": 5.0, "inertia": inertia + mass * radius**2, "markers": {"O": [0.0, 0.0]}}],
            "joint": [{"name": "O", "type": "revolute", "between": ["frame.O", "drum.O"]}],
            "coordinate": [{"joint": "O", "start": {"position": 0.0, "velocity": start}}],
            "load": [{"on": "drum.O", "moment": -load}],
            "actuator": [{"joint": "O", "law": {"type": "constant", "value": motor, "at": "motor"},
                          "drive": {"ratio": ratio, "rotor_inertia": rotor, "efficiency": efficiency, "back_efficiency": back}}],
        }
        moved = inertia + mass * radius**2
        solutions = []
        for push in (1, -1):
            share = 1 / efficiency if push * start > 0 else back
            acceleration = (ratio * motor - share * load) / (ratio**2 * rotor + share * moved)
            if push * (moved * acceleration + load) > 0:
                solutions.append(acceleration)
        (acceleration,) = solutions
        t = np.linspace(0, 0.02, 11)
        run = linkdyn.Scene(scene).forward(t=t, want="all", **SHARP)
        assert np.abs(run.qd.values[:, 0] - start - acceleration * t).max() < 1e-9
        assert np.abs(run.power_imbalance).max() < 1e-11


@pytest.mark.parametrize("method", ["gbs", "rkf45"])
def test_joints_that_may_stick_slide_by_records(method: str) -> None:
    """They turn back without being held (tests of sticking have what is held): way and balance are those of lanes."""
    scene = five_bar(friction=True)
    for friction in scene["friction"]:
        friction["sticking"] = True
    t = np.linspace(0, 0.6, 31)
    by_record, by_lanes = (linkdyn.Scene(scene).forward(t=t, want="all", method=method, solver=solver, **SHARP) for solver in ("elimination", "lapack"))
    assert by_record.qd.values.min() < -1 and by_record.qd.values.max() > 1
    assert list(by_record.event.values) == list(by_lanes.event.values)
    np.testing.assert_allclose(by_record.event_time, by_lanes.event_time, atol=1e-8)
    assert np.abs(by_record.q - by_lanes.q).max() < 1e-8
    assert np.abs(by_record.qd - by_lanes.qd).max() < 1e-7
    assert np.abs(by_record.power_imbalance).max() < 1e-9
