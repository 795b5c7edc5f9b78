"""Where what rubs carries nothing, or nothing but rounding: runs and samples go on, and what holds is found all the same."""

from __future__ import annotations

import linkdyn
import numpy as np
import pytest

COASTING = """
space = "planar"
[frame]
markers = { A = [0, 0], B = [0.12, 0], C = [0.5, 0] }
[[link]]
name = "in"
mass = 1
inertia = 0.02
markers = { O = [0, 0] }
[[link]]
name = "lay"
mass = 1
inertia = 0.05
markers = { O = [0, 0] }
[[link]]
name = "out"
mass = 3
inertia = 0.6
markers = { O = [0, 0] }
[[joint]]
name = "A"
type = "revolute"
between = ["frame.A", "in.O"]
[[joint]]
name = "B"
type = "revolute"
between = ["frame.B", "lay.O"]
[[joint]]
name = "C"
type = "revolute"
between = ["frame.C", "out.O"]
[[joint]]
name = "G"
type = "gear"
between = ["in.O", "lay.O"]
teeth = [20, 40]
[[friction]]
joint = "G"
efficiency = 0.95
[[coordinate]]
joint = "A"
start = { position = 0, velocity = 2 }
[[coordinate]]
joint = "C"
start = { position = 0, velocity = -1 }
[[clutch]]
name = "c"
joint = "C"
to = "B"
capacity = 5
[[load]]
on = "out.O"
moment = 1.0
"""


def test_a_clutch_holds_behind_a_gear_that_coasts() -> None:
    """The teeth carry nothing but for the clutch's torque: I1 a + T/2 = 0 and J a/2 + eta T + c = 0 for the shafts, Io a/2 = -1 - c for what
    the clutch holds, while power flows out of the first shaft."""
    run = linkdyn.Scene(COASTING).forward(0.5)
    assert not run.attrs["stopped"] and (run.status == 0).all()
    acceleration = -1 / (0.65 / 2 + 2 * 0.95 * 0.02)
    np.testing.assert_allclose(run.qdd.sel(coordinate="A"), acceleration, rtol=1e-9)
    np.testing.assert_allclose(run.clutch_force.sel(clutch="c"), 0.6 * -acceleration / 2 - 1, rtol=1e-9)


def test_a_block_rests_on_a_carriage_whose_motor_is_off() -> None:
    """It coasts, and its gear transmits nothing at all."""
    run = linkdyn.Scene("""
space = "planar"
gravity = [0, -9.81]
[frame]
markers = { O = [0, 0] }
[[link]]
name = "carriage"
mass = 2
markers = { O = [0, 0], Q = { at = [0, 0], axis = [1, 1] } }
[[link]]
name = "block"
mass = 3
markers = { Q = { at = [0, 0], axis = [1, 1] } }
[[joint]]
name = "P"
type = "prismatic"
between = ["frame.O", "carriage.O"]
[[joint]]
name = "Q"
type = "prismatic"
between = ["carriage.Q", "block.Q"]
[[coordinate]]
joint = "P"
start = { position = 0, velocity = 1.0 }
[[coordinate]]
joint = "Q"
start = 0
[[actuator]]
joint = "P"
law = { type = "constant", value = 0, at = "motor" }
drive = { ratio = 100, rotor_inertia = 1e-4, efficiency = 0.6 }
[[stop]]
name = "s"
joint = "Q"
min = 0
restitution = 0
""").forward(1.0)
    assert not run.attrs["stopped"] and (run.status == 0).all()
    assert abs(run.qdd.sel(coordinate="Q")).max() < 1e-12
    np.testing.assert_allclose(run.qd.sel(coordinate="P"), 1.0, atol=1e-9)


@pytest.mark.parametrize("method", ["gbs", "seulex"])
def test_a_hinge_that_carries_nothing_in_free_fall(method: str) -> None:
    """Hinged at both centres of mass: the reaction is nothing, and what is found of it rounding of the weights."""
    run = linkdyn.Scene("""
space = "planar"
gravity = [0, -9.81]
[[link]]
name = "A"
mass = 2.3
cog = [0.37, 0.11]
inertia = 0.05
markers = { J = [0.37, 0.11], K = [0, 0] }
[[link]]
name = "B"
mass = 0.7
inertia = 0.013
markers = { J = [0, 0] }
[[joint]]
name = "H"
type = "revolute"
between = ["A.J", "B.J"]
[[coordinate]]
link = "A"
start = { position = [0.1, 0.2], angle = 0.7, velocity = [1.3, 2.1], angular_rate = 0.9 }
[[coordinate]]
joint = "H"
start = { position = 0.3, velocity = 10 }
[[friction]]
joint = "H"
coulomb = 0.1
radius = 0.02
viscous = 0.001
[time]
end = 1
samples = 1001
""").forward(method=method)
    assert not run.attrs["stopped"] and (run.status == 0).all()
    assert np.abs(run.reaction.values[:, :, :2]).max() < 1e-12
