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
