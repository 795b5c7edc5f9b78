"""Impulses of stops and locks where a motor's transmission loses: a rotor that drives while its shaft is braked counts with its eta-th part, one
that is driven with one over it, and no finite load has a part in that."""

from __future__ import annotations

import linkdyn
import numpy as np
import pytest

SHAFT = """
space = "planar"
[frame]
markers = {{ O = [0, 0], Q = [1, 0] }}
[[link]]
name = "lever"
mass = 0.1
inertia = 1e-4
markers = {{ O = [0, 0] }}
[[joint]]
name = "A"
type = "revolute"
between = ["frame.O", "lever.O"]
[[coordinate]]
joint = "A"
start = {{ position = 0, velocity = {speed} }}
[[actuator]]
joint = "A"
law = {{ type = "constant", value = {torque}, at = "motor" }}
drive = {{ ratio = 10, rotor_inertia = 1e-6, efficiency = 0.6, back_efficiency = 0.6 }}
[[load]]
on = "lever.O"
moment = {load}
"""
STOP = """
[[stop]]
name = "s"
joint = "A"
max = 0.05
restitution = 0.0
"""
LOCK = """
[[link]]
name = "b"
mass = 0.1
inertia = 1e-4
markers = { O = [0, 0] }
[[joint]]
name = "B"
type = "revolute"
between = ["frame.Q", "b.O"]
[[coordinate]]
joint = "B"
[[clutch]]
name = "c"
joint = "A"
to = "B"
from = 0.005
"""


def scene(load: float, speed: float, more: str) -> linkdyn.Scene:
    """The motor balances the load, whichever way its gear loses."""
    torque = -load / 10 * 0.6
    return linkdyn.Scene(SHAFT.format(load=load, speed=speed, torque=torque) + more)


@pytest.mark.parametrize("load", [0.0, 0.01, 0.1, 1.0, 10.0])
def test_a_stop_brakes_a_rotor_behind_a_gear(load: float) -> None:
    run = scene(load, 10.0, STOP).forward(0.008)
    (impulse,), ((speed,),) = run.event_impulse.values[:1], run.event_qd.values[:1]
    np.testing.assert_allclose(impulse / speed, 1e-4 + 0.6e-4, rtol=1e-9)
    np.testing.assert_allclose(run.event_loss.values[0], (1e-4 + 0.6e-4) * speed**2 / 2, rtol=1e-9)


@pytest.mark.parametrize("load", [0.0, 0.01, 0.1])
@pytest.mark.parametrize("speed", [10.0, -10.0])
def test_a_lock_brakes_a_rotor_behind_a_gear(load: float, speed: float) -> None:
    """The same both ways, and the momentum that is left is shared by both shafts."""
    run = scene(load, speed, LOCK).forward(0.0051)
    before = run.event_qd.values[0, 0]
    np.testing.assert_allclose(run.event_qd_after.values[0], before * 1.6e-4 / 2.6e-4, rtol=1e-9)
    np.testing.assert_allclose(abs(run.event_impulse.values[0]), 1e-4 * abs(before) * 1.6 / 2.6, rtol=1e-9)


@pytest.mark.parametrize("way", [1, -1])
def test_a_lock_drives_a_rotor_behind_a_gear(way: int) -> None:
    """The gear takes what it loses from the shaft that drives the rotor on."""
    there = '[[coordinate]]\njoint = "B"\n'
    text = SHAFT.format(load=0.0, speed=way, torque=0.0) + LOCK.replace(there, f"{there}start = {{ position = 0, velocity = {10 * way} }}\n")
    run = linkdyn.Scene(text).forward(0.0051)
    slow, fast = 1e-4 * (1 + 1 / 0.6), 1e-4
    np.testing.assert_allclose(run.event_qd_after.values[0], way * (10 * fast + slow) / (fast + slow), rtol=1e-9)


def locked_speed(a: float, b: float) -> float:
    """Common speed of the shaft with the motor, at a, and the other one, at b: the motor may turn back on the way."""
    way, shaft, rotor = np.sign(b - a), 1e-4, 1e-4
    if a * way < 0:
        braked = shaft + 0.6 * rotor
        common = (braked * a + shaft * b) / (braked + shaft)
        if common * a > 0:
            return common
        b, a = b + braked * a / shaft, 0.0
    driven = shaft + rotor / 0.6
    return (driven * a + shaft * b) / (driven + shaft)


@pytest.mark.parametrize("speed", [0.0, 1e-9, -1e-9, 1e-3, -1.0, -3.0, -20.0])
def test_a_lock_turns_a_motor_back(speed: float) -> None:
    """From where the rotor stands still its load drives it; one at rest is driven from the beginning."""
    there = '[[coordinate]]\njoint = "B"\n'
    text = SHAFT.format(load=0.0, speed=speed, torque=0.0) + LOCK.replace(there, f"{there}start = {{ position = 0, velocity = 10 }}\n")
    run = linkdyn.Scene(text).forward(0.0051)
    np.testing.assert_allclose(run.event_qd_after.values[0], locked_speed(speed, 10.0), rtol=1e-9)


@pytest.mark.parametrize("restitution", [0.3, 0.9, 1.0])
def test_a_stop_gives_back_energy_not_speed(restitution: float) -> None:
    """Thrown back the shaft has to drive its rotor, which then counts with more: no stop gives more than it has taken."""
    run = scene(0.0, 10.0, STOP.replace("restitution = 0.0", f"restitution = {restitution}")).forward(0.006)
    before, behind = 1.6e-4, 1e-4 + 1e-4 / 0.6
    (speed,), (after,) = run.event_qd.values[0], run.event_qd_after.values[0]
    np.testing.assert_allclose(after / speed, -restitution * np.sqrt(before / behind), rtol=1e-9)
    np.testing.assert_allclose(run.event_loss.values[0], before * speed**2 / 2 * (1 - restitution**2), rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(run.event_impulse.values[0], before * speed - behind * after, rtol=1e-9)


def self_locking(text: str) -> str:
    return text.replace("efficiency = 0.6, back_efficiency = 0.6", "efficiency = 0.4, back_efficiency = -0.5")


def test_what_cannot_be_driven_back_is_not_thrown_back() -> None:
    text = self_locking(SHAFT.format(load=0.0, speed=10.0, torque=0.0)) + STOP.replace("restitution = 0.0", "restitution = 0.7")
    run = linkdyn.Scene(text).forward(0.008)
    assert (run.status == 0).all()
    assert run.event_qd_after.values[0] == 0
    np.testing.assert_allclose(run.event_impulse.values[0], 1.4e-4 * 10, rtol=1e-9)


def test_a_lock_that_would_drive_a_self_locking_gear_is_refused() -> None:
    there = '[[coordinate]]\njoint = "B"\n'
    text = self_locking(SHAFT.format(load=0.0, speed=-1.0, torque=0.0))
    run = linkdyn.Scene(text + LOCK.replace(there, f"{there}start = {{ position = 0, velocity = 10 }}\n")).forward(0.0051)
    assert "transmissions lose jams the mechanism where clutch 'c' acts" in run.attrs["stopped"]
    np.testing.assert_array_equal(run.event_qd_after.values[0], run.event_qd.values[0])


ARM = """
space = "planar"
[frame]
markers = { O = [0, 0] }
[[link]]
name = "one"
mass = 2.0
inertia = 0.02
cog = [0.25, 0]
markers = { O = [0, 0], P = [0.5, 0] }
[[link]]
name = "two"
mass = 1.0
inertia = 0.01
cog = [0.2, 0.05]
markers = { P = [0, 0] }
[[joint]]
name = "A"
type = "revolute"
between = ["frame.O", "one.O"]
[[joint]]
name = "B"
type = "revolute"
between = ["one.P", "two.P"]
[[coordinate]]
joint = "A"
start = { position = 0, velocity = 2 }
[[coordinate]]
joint = "B"
start = { position = 0.7, velocity = RATE }
[[actuator]]
joint = "A"
law = { type = "constant", value = 0, at = "motor" }
drive = { ratio = 20, rotor_inertia = 1e-3, efficiency = 0.8, back_efficiency = 0.7 }
[[actuator]]
joint = "B"
law = { type = "constant", value = 0, at = "motor" }
drive = { ratio = 10, rotor_inertia = 2e-3, efficiency = 0.7, back_efficiency = 0.5 }
[[stop]]
name = "s"
joint = "A"
max = 0.001
restitution = RESTITUTION
"""


def thrown_back(angle: float, rate: np.ndarray, restitution: float) -> np.ndarray:
    """Rates of the arm behind its stop: its own equations of motion, the impulse grown from turn to turn of its motors."""
    one, two, length, com = 0.02 + 2.0 * 0.25**2, 0.01 + 1.0 * (0.2**2 + 0.05**2), 0.5, np.array([0.2, 0.05])
    across = length * (com[0] * np.cos(angle) - com[1] * np.sin(angle))
    mass = np.array([[one + two + length**2 + 2 * across, two + across], [two + across, two]])
    rotor, braking, driven = np.array([0.4, 0.2]), np.array([0.8, 0.7]), 1 / np.array([0.7, 0.5])

    def change(sense: np.ndarray) -> np.ndarray:
        for which in np.ndindex(2, 2):
            gain = np.linalg.solve(mass + np.diag(rotor * np.where(which, braking, driven)), [-1.0, 0.0])
            if ((gain * sense < 0) == np.array(which, dtype=bool)).all():
                return gain
        raise AssertionError("no way fits")

    taken = given = 0.0
    sense = np.sign(rate)
    while True:
        gain = change(sense)
        part = np.array([-r / g if r * g < 0 else np.inf for r, g in zip(rate, gain, strict=True)])
        grown = part.min()
        if rate[0] <= 0:  # it is thrown back: until as much is given back as should be
            a, b, c = -gain[0] / 2, -rate[0], given - restitution**2 * taken
            last = (-b + np.sqrt(b**2 - 4 * a * c)) / (2 * a)
            if last <= grown:
                return rate + last * gain
            given += grown * (-rate[0] - gain[0] * grown / 2)
        else:
            taken += grown * (rate[0] + gain[0] * grown / 2)
        rate = rate + grown * gain
        turned = part == grown
        rate[turned], sense[turned] = 0.0, -sense[turned]


@pytest.mark.parametrize("restitution", [0.2, 0.8])
@pytest.mark.parametrize("rate", [-3.0, -0.5, 0.2, 4.0])
def test_an_arm_with_two_motors_that_turn_back(rate: float, restitution: float) -> None:
    run = linkdyn.Scene(ARM.replace("RATE", str(rate)).replace("RESTITUTION", str(restitution))).forward(0.001)
    expected = thrown_back(run.event_q.values[0, 1], run.event_qd.values[0], restitution)
    np.testing.assert_allclose(run.event_qd_after.values[0], expected, rtol=1e-8)


@pytest.mark.parametrize("capacity", [2.6, 2.7, 2.9, 3.1, 3.2, 4.0])
def test_a_clutch_behind_a_gear_holds_what_it_can(capacity: float) -> None:
    """What the gear loses goes by what the clutch holds: by the responses without loss it would have to hold 3.14 N m."""
    text = SHAFT.replace("rotor_inertia = 1e-6", "rotor_inertia = 3e-3").replace("inertia = 1e-4", "inertia = 0.01", 1)
    text = text.format(load=0.0, speed=8, torque=1.0) + f"""
[[link]]
name = "fly"
mass = 5
inertia = 0.1
markers = {{ O = [0, 0] }}
[[joint]]
name = "B"
type = "revolute"
between = ["frame.Q", "fly.O"]
[[coordinate]]
joint = "B"
start = {{ position = 0, velocity = 5 }}
[[load]]
on = "fly.O"
moment = -1
[[clutch]]
name = "c"
joint = "A"
to = "B"
capacity = {capacity}
"""
    run = linkdyn.Scene(text).forward(3.0)
    assert run.attrs["stopped"] == ""
    driven, fly = 0.01 + 0.6 * 100 * 3e-3, 0.1
    held = (0.6 * 10 / driven + 1 / fly) / (1 / driven + 1 / fly)
    np.testing.assert_allclose(abs(run.clutch_force.values[-1]), min(held, capacity), rtol=1e-9)
