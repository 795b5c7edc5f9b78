"""Motors, screws and cylinders behind the drives, against hand calculation."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
import xarray as xr
from linkdyn.errors import InputError

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
G = 9.81


def lift(motion: dict[str, Any]) -> tuple[linkdyn.Scene, xr.Dataset]:
    """A mass of 100 kg, lifted and lowered."""
    scene = linkdyn.Scene({
        "space": "planar",
        "gravity": [0.0, -G],
        "frame": {"markers": {"A": {"at": [0.0, 0.0], "axis": [0.0, 1.0]}}},
        "link": [{"name": "table", "mass": 100.0, "inertia": 1.0, "markers": {"A": {"at": [0.0, 0.0], "axis": [0.0, 1.0]}}}],
        "joint": [{"name": "A", "type": "prismatic", "between": ["frame.A", "table.A"]}],
        "coordinate": [{"joint": "A", "motion": motion}],
        "actuator": [{"joint": "A"}],
        "time": {"end": 2.0, "samples": 401},
    })
    return scene, scene.inverse()


HARMONIC = {"law": "harmonic", "amplitude": 0.1, "frequency": "3 rad/s"}


def test_screw_by_hand() -> None:
    """Lead 5 mm, half of the power lost: up at twice the torque, down with none to hold (2 - 1/0.5 = 0); the rotor takes its own."""
    scene, run = lift(HARMONIC)
    t = run.time.values
    speed, acceleration = 0.3 * np.cos(3 * t), -0.9 * np.sin(3 * t)
    force, n = 100 * (G + acceleration), 2 * math.pi / 0.005
    expected = force / n * np.where(speed > 0, 2.0, 0.0) + 2e-4 * n * acceleration
    found = run.linkdyn.motor("A", lead=0.005, efficiency=0.5, inertia=2e-4, torque_constant=0.6, resistance=1.5)
    np.testing.assert_allclose(found.motor_torque, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.motor_speed, n * speed, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(found.electric_power, (1.5 * expected / 0.6 + 0.6 * n * speed) * expected / 0.6, rtol=1e-8, atol=1e-6)
    assert found.peak_torque == pytest.approx(np.abs(expected).max())
    assert found.rms_torque == pytest.approx(np.sqrt(np.mean(expected**2)), rel=2e-3)
    assert found.attrs["self_locking"] == 1
    assert run.linkdyn.motor("A", lead=0.005, efficiency=0.8).attrs["self_locking"] == 0


def test_screw_losses_close_the_power() -> None:
    """What the motor gives less what the load takes is friction: never negative."""
    _, run = lift(HARMONIC)
    found = run.linkdyn.motor("A", lead=0.01, efficiency=0.35)
    loss = found.motor_power.values - run.driving_power.values[:, 0]
    assert loss.min() > -1e-9
    assert loss.max() > 100.0


def test_standstill_takes_no_side() -> None:
    _, run = lift({"law": "constant-rate", "rate": "0 m/s"})
    assert run.linkdyn.motor("A", lead=0.01, efficiency=0.35).motor_torque.values == pytest.approx(100 * G * 0.01 / (2 * math.pi))


def test_gear_of_a_crank() -> None:
    """A crank at even speed: no inertia to be felt; a gear's efficiency holds both ways."""
    run = linkdyn.load(EXAMPLES / "fourbar" / "scene.toml").inverse()
    name = str(run.actuator.values[0])
    found = run.linkdyn.motor(name, ratio=-50.0, efficiency=0.9)
    torque, power = run.driving_force.values[:, 0], run.driving_power.values[:, 0]
    moving = np.abs(power) > 1e-9 * np.abs(power).max()
    np.testing.assert_allclose(found.motor_torque.values[moving], (torque / -50 * np.where(power > 0, 1 / 0.9, 0.9))[moving], rtol=1e-12)
    assert found.motor_speed.values == pytest.approx(-50 * run.driving_speed.values[:, 0])


def test_accelerations_by_a_road_of_their_own() -> None:
    """Inertia of motors at joints that are no coordinates: against differences of the speed over time."""
    scene = linkdyn.load(EXAMPLES / "stewart_tsai" / "scene.toml")
    run = scene.inverse(t=np.linspace(0.1, 0.5, 4001))
    name = str(run.actuator.values[2])
    with_rotor, without = (run.linkdyn.motor(name, lead=0.02, inertia=j).motor_torque.values for j in (1e-3, 0.0))
    n = 2 * math.pi / 0.02
    rate = np.gradient(run.driving_speed.values[:, 2], run.time.values, edge_order=2)
    np.testing.assert_allclose((with_rotor - without)[2:-2], (1e-3 * n * rate)[2:-2], atol=1e-4 * np.abs(1e-3 * n * rate).max())


def test_cylinder_by_hand() -> None:
    _, run = lift(HARMONIC)
    t = run.time.values
    force, speed = 100 * (G - 0.9 * np.sin(3 * t)), 0.3 * np.cos(3 * t)
    head, ring = math.pi / 4 * 0.05**2, math.pi / 4 * (0.05**2 - 0.03**2)
    found = run.linkdyn.cylinder("A", bore=0.05, rod=0.03, tank=2e5, supply=8e5)
    np.testing.assert_allclose(found.head_pressure, (force + 2e5 * ring) / head, rtol=1e-12)
    np.testing.assert_allclose(found.rod_pressure, 2e5)
    np.testing.assert_allclose(found.head_flow, head * speed, rtol=1e-9, atol=1e-12)
    assert found.peak_flow == pytest.approx(head * 0.3)
    assert found.stroke == pytest.approx(np.ptp(0.1 * np.sin(3 * t)))
    assert found.attrs["above_supply"] == np.sum((force + 2e5 * ring) / head > 8e5)
    named = run.assign_coords(actuator=[f"{name}:ram" if name == "A" else name for name in map(str, run.actuator.values)])
    assert named.linkdyn.cylinder("A:ram", bore=0.05).stroke == found.stroke      # one of several drives of its slide
    # hung the other way round it pulls: the ring carries the load
    pulls = run.linkdyn.cylinder("A", bore=0.05, rod=0.03, extends=-1)
    np.testing.assert_allclose(pulls.rod_pressure, force / ring, rtol=1e-12)
    np.testing.assert_allclose(pulls.hydraulic_power, force * speed, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("options", "message"), [
    ({}, "one of ratio= .* and lead="),
    ({"ratio": 3.0}, "gives a force .expected lead="),
    ({"lead": 0.0}, "lead"),
    ({"lead": 0.01, "efficiency": 0.0}, "efficiency"),
    ({"lead": 0.01, "efficiency": 1.2}, "efficiency"),
    ({"lead": 0.01, "back_efficiency": 1.2}, "back_efficiency"),
    ({"lead": 0.01, "inertia": -1.0}, "inertia"),
    ({"lead": 0.01, "resistance": 1.0}, "torque_constant"),
])  # fmt: skip
def test_wrong_motors(options: dict[str, float], message: str) -> None:
    _, run = lift(HARMONIC)
    with pytest.raises(InputError, match=message):
        run.linkdyn.motor("A", **options)


def test_wrong_cylinders() -> None:
    _, run = lift(HARMONIC)
    for options, message in (({"bore": 0.0}, "bore"), ({"bore": 0.05, "rod": 0.05}, "rod"), ({"bore": 0.05, "extends": 2}, "extends")):
        with pytest.raises(InputError, match=message):
            run.linkdyn.cylinder("A", **options)
    crank = linkdyn.load(EXAMPLES / "fourbar" / "scene.toml").inverse()
    with pytest.raises(InputError, match="gives a torque"):
        crank.linkdyn.cylinder(str(crank.actuator.values[0]), bore=0.1)
    with pytest.raises(InputError, match="actuator"):
        crank.linkdyn.motor("nobody", ratio=2.0)
