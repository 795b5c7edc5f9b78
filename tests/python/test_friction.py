"""Friction in joints, driven by their reactions: each check by a road of its own.

Closed forms (block, wedge, screw, friction circle), Newton's method in 50 digits on all equations at once, virtual power by a
power balance made of results alone, solvers and engines against each other.
"""

from __future__ import annotations

import math
from pathlib import Path

import mpmath
import numpy as np
import pytest

import linkdyn

TESTS = Path(__file__).resolve().parents[1]
EXAMPLES = TESTS.parent / "examples"
SOLVERS = ("elimination", "gauss-jordan", "gauss-jordan-plain", "lapack")
G = 9.81

BLOCK = """
space = "planar"
gravity = [0, -9.81]
[frame]
markers = {{ O = {{ at = [0, 0], axis = [{c}, {s}] }} }}
[[link]]
name = "block"
mass = 3
inertia = 0.01
cog = [0, 0]
markers = {{ C = {{ at = [0, 0], axis = [{c}, {s}] }}, top = [0, 0.2] }}
[[joint]]
name = "incline"
type = "prismatic"
between = ["frame.O", "block.C"]
[[coordinate]]
joint = "incline"
[[actuator]]
joint = "incline"
[[load]]
on = "block.top"
force = [0, 0]
[[friction]]
joint = "incline"
{friction}
"""


def block(friction: str, angle: float = 0.4) -> linkdyn.Scene:
    """A block on an incline, pulled along it."""
    return linkdyn.Scene(BLOCK.format(c=math.cos(angle), s=math.sin(angle), friction=friction))


@pytest.mark.parametrize("solver", SOLVERS)
def test_block_on_incline(solver: str) -> None:
    """F = m a + m g sin(alpha) + mu N sign(v), N = m g cos(alpha); nothing of it at rest."""
    scene, v = block("coulomb = 0.3"), np.array([0.5, -0.5, 0.0])
    run = scene.inverse(q=np.zeros((3, 1)), qd=v[:, None], qdd=np.full((3, 1), 0.7), solver=solver)
    normal = 3 * G * math.cos(0.4)
    np.testing.assert_allclose(run.driving_force[:, 0], 3 * 0.7 + 3 * G * math.sin(0.4) + 0.3 * normal * np.sign(v), rtol=1e-13)
    np.testing.assert_allclose(run.friction_power[:, 0], 0.3 * normal * np.abs(v), rtol=1e-13)
    np.testing.assert_allclose(run.friction[:, 0, 0], -0.3 * normal * np.sign(v) * math.cos(0.4), rtol=1e-13)
    assert np.abs(run.power_imbalance).max() < 1e-14


def test_coefficients_over_speed() -> None:
    """Stribeck's curve, what is viscous, the preload, and the smooth passage through rest."""
    scene = block('coulomb = 0.1\nstatic = 0.25\nstribeck_speed = "20 mm/s"\nviscous = "40 N*s/m"\npreload = "100 N"\n'
                  'creep_speed = "2 mm/s"')
    v = np.array([1e-4, -1e-3, 0.01, -0.03, 0.2, 3.0])
    run = scene.inverse(q=np.zeros((6, 1)), qd=v[:, None], qdd=np.zeros((6, 1)))
    mu = 0.1 + 0.15 * np.exp(-((v / 0.02) ** 2))
    expected = 3 * G * math.sin(0.4) + mu * np.tanh(v / 0.002) * (3 * G * math.cos(0.4) + 100) + 40 * v
    np.testing.assert_allclose(run.driving_force[:, 0], expected, rtol=1e-13)


def test_ends_of_a_guide() -> None:
    """A force above the guide tilts the block: both ends carry, and the friction of both retards."""
    scene, pull, length = block('coulomb = 0.3\nlength = "100 mm"', 0.0), 40.0, 0.1
    run = scene.inverse(q=[[0.0]], qd=[[0.2]], qdd=[[0.0]], wrench={"block.top": [pull, 0, 0]})
    weight, moment = 3 * G, 0.2 * pull
    ends = abs(weight / 2 + moment / length) + abs(weight / 2 - moment / length)
    assert ends > 1.5 * weight
    np.testing.assert_allclose(run.driving_force[0, 0], 0.3 * ends - pull, rtol=1e-13)
