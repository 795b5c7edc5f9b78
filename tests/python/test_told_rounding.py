"""What a run tells of rounding is about what its end is off by, where rates lose their digits on the way."""

import re

import pytest

import linkdyn

# A parallelogram whose follower is longer by 1e-9: it turns over within some 1e-5 rad of where it would lie flat, twice in the run.
OFF = """
space = "planar"

[frame]
markers = { J1 = [0, 0], J4 = [2, 0] }

[[link]]
name = "crank"
markers = { J1 = [0, 0], J2 = [1, 0] }
mass = 1
cog = [0.5, 0]
inertia = 0.1

[[link]]
name = "coupler"
markers = { J3 = [0, 0], J2 = [2, 0] }
mass = 2
cog = [1, 0]
inertia = 0.5

[[link]]
name = "follower"
markers = { J4 = [0, 0], J3 = [1.000000001, 0] }
mass = 1.5
cog = [0.5, 0]
inertia = 0.15

[[joint]]
name = "J1"
type = "revolute"
between = ["frame.J1", "crank.J1"]

[[joint]]
name = "J2"
type = "revolute"
between = ["coupler.J2", "crank.J2"]

[[joint]]
name = "J3"
type = "revolute"
between = ["follower.J3", "coupler.J3"]
branch = 1

[[joint]]
name = "J4"
type = "revolute"
between = ["frame.J4", "follower.J4"]

[[coordinate]]
joint = "J1"
start = { position = 1, velocity = 4 }

[time]
end = 1.2
samples = 13
"""
# A coupler longer by 1e-6, under gravity: neither side turns over, so they lead in turn.
EXCHANGED = """
space = "planar"
gravity = [0.0, -9.81]

[frame]
markers = { A = [0.0, 0.0], D = [1.0, 0.0] }

[[link]]
name = "crank"
markers = { A = [0.0, 0.0], B = [0.4, 0.0] }
mass = 1.0
cog = [0.2, 0.0]
inertia = 0.02

[[link]]
name = "coupler"
markers = { B = [0.0, 0.0], C = [1.000001, 0.0] }
mass = 2.0
cog = [0.5, 0.0]
inertia = 0.2

[[link]]
name = "rocker"
markers = { D = [0.0, 0.0], C = [0.4, 0.0] }
mass = 1.0
cog = [0.2, 0.0]
inertia = 0.02

[[joint]]
name = "A"
type = "revolute"
between = ["frame.A", "crank.A"]

[[joint]]
name = "B"
type = "revolute"
between = ["crank.B", "coupler.B"]

[[joint]]
name = "C"
type = "revolute"
between = ["coupler.C", "rocker.C"]

[[joint]]
name = "D"
type = "revolute"
between = ["frame.D", "rocker.D"]
start = "60 deg"

[[coordinate]]
joint = "A"
start = { position = "60 deg", velocity = "8.0 rad/s" }
"""
# of the integral of sqrt(M(q)/M(1))/4 from 1 rad, M the inertia at the crank, which takes 1.2 s: by mpmath, in 28 digits
ANGLE = 6.4767334241891


@pytest.mark.accuracy
@pytest.mark.parametrize("tolerance", [1e-10, 1e-11, 1e-12])
def test_the_sum_of_what_rounding_left_is_about_the_error(tolerance: float) -> None:
    run = linkdyn.Scene(OFF).forward(method="gbs", rtol=tolerance, atol=tolerance)
    together, count, steps, most = re.fullmatch(
        r"left (\S+) in (\d+) of (\d+) steps with errors above the tolerance, up to (\S+)", run.attrs["rounding"]
    ).groups()
    assert int(count) <= int(steps)
    assert float(most) <= float(together) <= int(count) * float(most) * 1.001
    assert abs(run.q.values[-1, 0] - ANGLE) < 10 * float(together)


def test_steps_are_counted_once_where_coordinates_are_exchanged() -> None:
    run = linkdyn.Scene(EXCHANGED).forward(t_end=2.0, method="gbs", rtol=1e-13, atol=1e-13)
    assert "then angle of" in run.attrs["coordinates_integrated"]
    count, steps = re.match(r"left \S+ in (\d+) of (\d+) steps", run.attrs["rounding"]).groups()
    assert int(count) <= int(steps)
