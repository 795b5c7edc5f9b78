"""Two slides and the hinge where they cross: as they become parallel the hinge goes away without end, and what closes beyond is
not what the motion comes to. Where both slides come to lie on one line, the hinge stays, and the motion goes through."""

from __future__ import annotations

import numpy as np
import pytest

import linkdyn

UNREACHABLE, BRANCH_LOST = 1, 5

TANGENT = """
space = "planar"
[frame]
markers = { O = [0.0, 0.0], guide = { at = [0.3, 0.0], axis = [0.0, 1.0] } }
[[link]]
name = "crank"
markers = { M = [0.0, 0.0] }
mass = 1.0
inertia = 0.1
[[link]]
name = "block"
markers = { M = [0.0, 0.0] }
mass = 0.5
inertia = 0.01
[[link]]
name = "cross"
markers = { C = { at = [0.0, 0.0], axis = [0.0, 1.0] } }
mass = 2.0
inertia = 0.1
[[joint]]
name = "O"
type = "revolute"
between = ["frame.O", "crank.M"]
[[joint]]
name = "S"
type = "prismatic"
between = ["crank.M", "block.M"]
[[joint]]
name = "C"
type = "revolute"
between = ["block.M", "cross.C"]
[[joint]]
name = "G"
type = "prismatic"
between = ["frame.guide", "cross.C"]
[[coordinate]]
joint = "O"
START
[[actuator]]
joint = "O"
"""

TWO_CRANKS = """
space = "planar"
PASS
[frame]
markers = { A = [0.0, 0.0], B = [1.0, 0.0] }
[[link]]
name = "first"
markers = { M = [0.0, 0.0] }
mass = 1.0
inertia = 0.1
[[link]]
name = "second"
markers = { M = [0.0, 0.0] }
mass = 1.0
inertia = 0.1
[[link]]
name = "slider"
markers = { M = [0.0, 0.0] }
mass = 0.2
inertia = 0.01
[[link]]
name = "rider"
markers = { M = [0.0, 0.0] }
mass = 0.2
inertia = 0.01
[[joint]]
name = "A"
type = "revolute"
between = ["frame.A", "first.M"]
[[joint]]
name = "B"
type = "revolute"
between = ["frame.B", "second.M"]
[[joint]]
name = "S"
type = "prismatic"
between = ["first.M", "slider.M"]
[[joint]]
name = "C"
type = "revolute"
between = ["slider.M", "rider.M"]
[[joint]]
name = "T"
type = "prismatic"
between = ["second.M", "rider.M"]
[[coordinate]]
joint = "A"
motion = { law = "constant-rate", start = 0.3, rate = -0.6 }
[[coordinate]]
joint = "B"
motion = { law = "constant-rate", start = 2.5415926535897931, rate = 1.2 }
[[actuator]]
joint = "A"
[[actuator]]
joint = "B"
"""


def tangent(start: str = "") -> linkdyn.Scene:
    return linkdyn.Scene(TANGENT.replace("START", start))


@pytest.mark.parametrize("n", [25, 4001])
def test_crank_past_the_parallel(n: int) -> None:
    """Few samples and many, on lanes and by records: beyond 90 degrees nothing is ok until the crank comes back to the start's side."""
    angle = np.linspace(0.1, 2 * np.pi + 0.1, n)
    run = tangent().inverse(q=angle[:, None], qd=np.ones((n, 1)), qdd=np.zeros((n, 1)))
    status = np.asarray(run["status"])
    away = np.cos(angle) < 0
    assert (status[away] == UNREACHABLE).all()
    near = np.abs(np.cos(angle)) > 1e-3
    assert (status[~away & near] == 0).all()
    # virtual work of two blocks that go by tan and, along the crank, by 1/cos
    c, s = np.cos(angle), np.sin(angle)
    # y = 0.3 tan a: y' = 0.3/c^2, y'' = 0.6 s/c^3; the force on both masses acts along y, the block turns with the crank
    force = 2.5 * 0.6 * s / c**3
    want = force * 0.3 / c**2
    got = np.asarray(run["driving_force"]).reshape(n)
    good = ~away & near
    np.testing.assert_allclose(got[good], want[good], rtol=1e-9, atol=1e-12)


def test_each_side_is_its_own_assembly() -> None:
    """Started beyond 90 degrees the mechanism closes there, and not before."""
    angle = np.radians([100.0, 180.0, 260.0, 280.0, 80.0])
    status = np.asarray(tangent('start = "170 deg"').inverse(q=angle[:, None])["status"])
    assert status.tolist() == [0, 0, 0, UNREACHABLE, UNREACHABLE]


@pytest.mark.thorough
def test_forward_run_ends_at_the_parallel() -> None:
    """A crank that turns evenly takes the slide to infinity in a quarter of a turn."""
    scene = linkdyn.Scene(TANGENT.replace("START", 'motion = { law = "constant-rate", rate = "60 rpm" }'))
    run = scene.forward(t=np.linspace(0.0, 0.4, 41))
    assert run.attrs["stopped"]
    status = np.asarray(run["status"])
    assert (status[run["time"].values < 0.245] == 0).all()
    assert (status[run["time"].values > 0.251] != 0).all()


@pytest.mark.parametrize("word, lost", [("", False), ('change_points = "stop"', True)])
@pytest.mark.parametrize("n", [60, 4000])
def test_slides_on_one_line_are_gone_through(word: str, lost: bool, n: int) -> None:
    """Cranks that turn by a and by -2 a: their slides come to lie on the line through both hinges at a = 0, where the hinge
    between goes through x = 2/3 of the way, as sin 2a / sin 3a says on both sides."""
    scene = linkdyn.Scene(TWO_CRANKS.replace("PASS", word))
    a = np.linspace(0.3, -0.3, n)
    run = scene.inverse(t=np.linspace(0.0, 1.0, n))
    status = np.asarray(run["status"])
    beyond = a < -1e-3
    assert (status[a > 1e-3] == 0).all()
    if lost:
        assert (status[beyond] == BRANCH_LOST).all()
        return
    assert (status[beyond] == 0).all()
    assert run.attrs["change_points_passed"] == 1
    along = np.asarray(run["joint_variable"].sel(variable="S.slide"))
    np.testing.assert_allclose(along[beyond], (np.sin(2 * a) / np.sin(3 * a))[beyond], rtol=1e-9)
