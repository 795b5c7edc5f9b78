"""Joints that stick beside others that stick or rub, in loops and platforms: what holds and what rubs are found together."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import linkdyn

EXAMPLES = Path(__file__).parents[2] / "examples"
HOLDS = 2


def with_friction(name: str, joints: list[str], words: str) -> linkdyn.Scene:
    """An example, joints of which stick."""
    text = (EXAMPLES / name / "scene.toml").read_text(encoding="utf-8")
    tables = (f'[[friction]]\njoint = "{joint}"\ncoulomb = 0.1\nsticking = true\n{words}\n' for joint in joints)
    return linkdyn.Scene(text + "\n" + "\n".join(tables))


@pytest.mark.parametrize("method", [None, "gbs", "seulex"])
@pytest.mark.parametrize("joints", [["J1"], ["J1", "J2"], ["J1", "J2", "J3"]])
def test_held_by_nothing_but_rounding(joints: list[str], method: str | None) -> None:
    """At the first instant the drive carries 50 kN m of weight and nothing wants to move: rounding of these forces is all that there is to
    hold, and no reason to stop. Then all joints break loose at one instant, whatever the steps, and the linkage goes as its drive wants."""
    run = with_friction("fourbar_start", joints, 'radius = "10 mm"').forward(1.0, method=method)
    assert not run.attrs["stopped"]
    assert (run["status"].values == 0).all()
    assert (run["clutch_state"].values[0] == HOLDS).all()
    assert run.attrs["right_hand_sides"] < 20000


def test_six_slides_of_a_hexapod_stick() -> None:
    """All legs come to hold, and the platform to rest, and those that slide rub as Coulomb says."""
    run = with_friction("stewart_forward", [f"leg{i}.P" for i in range(1, 7)], 'preload = "10 N"').forward(1.5)
    assert not run.attrs["stopped"]
    assert (run["status"].values == 0).all()
    assert (run["clutch_state"].values[-1] == HOLDS).all()
    assert (np.abs(run["qd"].values[-1]) <= 1e-12 * np.abs(run["qd"].values).max()).all()  # as clutches have no slip
    force, slip = run["clutch_force"].values, run["clutch_slip"].values
    slides = (run["clutch_state"].values != HOLDS) & (slip != 0)
    # Coulomb's law with the preload and the reactions across each guide (they are measured at the second link's marker)
    across = []
    for i in range(1, 7):
        reaction = run["reaction"].sel(joint=f"leg{i}.P").values
        axis = leg_axis(run, i)
        across.append(np.linalg.norm(reaction[:, :3] - (reaction[:, :3] * axis).sum(1, keepdims=True) * axis, axis=1))
    want = -0.1 * (10 + np.transpose(across)) * np.sign(slip)
    np.testing.assert_allclose(force[slides], want[slides], rtol=1e-7)


def leg_axis(run, i: int) -> np.ndarray:
    """From base to platform, of each sample: the way that a leg's slide goes."""
    text = (EXAMPLES / "stewart_forward" / "scene.toml").read_text(encoding="utf-8")
    point = {m[0]: np.array([float(x) for x in m[1].split(",")]) for m in re.findall(r"^([BP]\d) = \[([^\]]*)\]", text, re.M)}
    x = run["q"].values
    (a, b, c), (s, t, u) = np.cos(x[:, 3:]).T, np.sin(x[:, 3:]).T
    zero = np.zeros_like(a)
    one = zero + 1
    stack = lambda *rows: np.moveaxis(np.array(rows), -1, 0)
    turn = (stack([one, zero, zero], [zero, a, -s], [zero, s, a]) @ stack([b, zero, t], [zero, one, zero], [-t, zero, b])
            @ stack([c, -u, zero], [u, c, zero], [zero, zero, one]))
    way = x[:, :3] + turn @ point[f"P{i}"] - point[f"B{i}"]
    return way / np.linalg.norm(way, axis=1, keepdims=True)


@pytest.mark.thorough
def test_friction_of_next_to_nothing_does_not_stop_a_run() -> None:
    """Massless legs press their guides with a hundred-thousandth of a newton: the platform swings down to speeds of 1e-10 m/s, which have
    rounding of the stiff legs' forces, and slips that are to turn back at an instant must do so from zero. What presses comes down to
    rounding itself, a 1e-14th of the legs' forces, and so does what it rubs."""
    scene = with_friction("stewart_forward", [f"leg{i}.P" for i in range(1, 7)], "")
    for end in (1.85, 1.95, 2.1, 2.2):
        run = scene.forward(end)
        assert not run.attrs["stopped"]
        assert (run["status"].values == 0).all()


@pytest.mark.parametrize(("method", "speed"), [
    *(("gbs", speed) for speed in (-8.85, -8.05, -7.75, -6.15, -5.2)), *(("seulex", speed) for speed in (-7.7, -7.2, -6.85, -6.3, -5.6)),
])
def test_what_turns_back_together_jumps_nowhere(method: str, speed: float) -> None:
    """At the dead centre of a ram its guide and the joint on it turn back at once; nothing drives the mechanism, so its energy cannot rise."""
    text = (Path(__file__).parents[1] / "holding" / "sticks_at_dead_centres.toml").read_text().replace("velocity = -6.2", f"velocity = {speed}")
    run = linkdyn.Scene(text).forward(method=method)
    assert (run.status == 0).all()
    energy = (run.kinetic_energy + run.potential_energy).values
    assert np.diff(energy).max() < 1e-7 * energy[0]


ALL_AT_REST = """
space = "planar"
gravity = [0, -9.81]
measures.cv = { joint = "A", rate = true }
frame.markers = { A = [-0.1, 0], E = [0.1, 0] }
link = [
  { name = "l", mass = 1, inertia = 0.01, cog = [0.1, 0.01], markers = { A = [0, 0], B = [0.24, 0] } },
  { name = "r", mass = 1, inertia = 0.01, cog = [0.1, 0.01], markers = { A = [0, 0], B = [0.24, 0] } },
  { name = "lr", mass = 0.6, inertia = 0.01, cog = [0.2, 0], markers = { B = [0, 0], C = [0.42, 0] } },
  { name = "rr", mass = 0.6, inertia = 0.01, cog = [0.2, 0], markers = { B = [0, 0], C = [0.42, 0] } },
]
joint = [
  { name = "A", type = "revolute", between = ["frame.A", "l.A"], start = 2.6 },
  { name = "E", type = "revolute", between = ["frame.E", "r.A"], start = 0.5 },
  { name = "B", type = "revolute", between = ["l.B", "lr.B"] },
  { name = "D", type = "revolute", between = ["r.B", "rr.B"] },
  { name = "C", type = "revolute", between = ["lr.C", "rr.C"] },
]
coordinate = [
  { joint = "A", start = { position = 2.6, velocity = -0.5712426493162122 } },
  { joint = "E", start = { position = 0.5, velocity = 0.9904492682727644 } },
]
stop = [{ name = "st", joint = "E", min = 0.2, max = 0.9, restitution = 0.0 }]
actuator = [{ joint = "A", law = { type = "formula", value = "22.5859 N m*step(time-0.2 s)-0.3 N m s/rad*cv" } }]
clutch = [{ name = "cl", joint = "D", capacity = 34.904564495501475, from = 0.2817938898779448, until = 0.5487426203139298 }]
spring = [{ name = "sp", joint = "E", stiffness = 72.3766998224912, rest = 0.2, damping = 0.5205100160815932 }]
time = { end = 0.9, samples = 46 }

[[friction]]
joint = "B"
coulomb = 0.2974381722020764
radius = 0.0156615312092871
static = 0.29785838552782384
stribeck_speed = 0.04176995394008475
preload = 13.492036613166478
viscous = 0.2296389282765831
sticking = true

[[friction]]
joint = "D"
coulomb = 0.05545950710324034
radius = 0.011499164222534974
preload = 17.980576435165304
viscous = 0.07133900657934876
sticking = true
"""


def test_what_follows_on_itself_at_an_instant_ends() -> None:
    """A stop, a clutch and two rubbing joints come to rest at once, where more holds than moves: told by name, not in endless steps."""
    run = linkdyn.Scene(ALL_AT_REST).forward(method="gbs")
    assert not run.stopped or re.search("what happens at '[BD]'.* follows on itself at this instant without end", run.stopped)
    assert np.all(run.status[run.time > 0.4] == (3 if run.stopped else 0))
