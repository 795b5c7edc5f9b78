"""Several hard stops at once: random linkages against an integration of their own (tests/reference/stops_oracle.py), and closed forms."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import linkdyn

sys.path.insert(0, str(Path(__file__).parents[1] / "reference"))
import stops_oracle

GRAVITY = 9.81
TIMES = np.linspace(0, 0.8, 9)


def compare(kind: str, seed: int, method: str = "gbs") -> None:
    """Two references that differ in tolerance and in the last bounces tell how far the motion can be known."""
    if kind == "five-bar":
        scene, linkage, angle, rate, to_joints = stops_oracle.random_fivebar(seed, 3)
    else:
        n = {"double": 2, "triple": 3}[kind]
        scene, linkage, angle, rate, to_joints = stops_oracle.random_chain(seed, n, n)
    fine, coarse = (stops_oracle.run(linkage, angle, rate, TIMES, rtol, weak) for rtol, weak in ((1e-11, 1e-6), (1e-10, 2e-6)))
    run = linkdyn.Scene(scene).forward(t=TIMES, rtol=1e-11, atol=1e-11, method=method)
    assert run.attrs["stopped"] == "" and np.all(run.status == 0)
    exact = fine.angle @ to_joints.T
    known = np.abs(coarse.angle @ to_joints.T - exact).max(axis=1)
    assert known.max() < 1e-3, "a motion that no two integrations agree on is no reference"
    error = np.abs(run.q.values - exact).max(axis=1)
    assert np.all(error < 1e-6 + 20 * known), f"{error} against {known}"
    assert_energy_is_lost_by_impacts_alone(run)
    struck = {name for _, name, _ in fine.events}
    assert struck == set(run.event.values)


def assert_energy_is_lost_by_impacts_alone(run: xr.Dataset) -> None:
    assert run.event_loss.values.min(initial=0) >= -1e-12
    energy = (run.kinetic_energy + run.potential_energy).values
    lost = np.concatenate([[0], np.cumsum(run.event_loss.values)])[np.searchsorted(run.event_time.values, run.time.values)]
    np.testing.assert_allclose(energy, energy[0] - lost, rtol=0, atol=1e-7)


# They lost a contact or chattered until 2026-11.
@pytest.mark.thorough
@pytest.mark.parametrize("seed", [1007, 1014])
def test_triple_pendulums_with_three_stops(seed):
    compare("triple", seed)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [102, 106])
def test_double_pendulums_with_two_stops(seed):
    compare("double", seed)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [1001, 1005, 1006, 1008])
def test_five_bars_with_three_stops(seed):
    compare("five-bar", seed)


def test_a_motion_that_rounding_decides_goes_on():
    """Two gaps close within 1e-12 s of each other, 0.377 s from the start: which impact is the first, no digit tells, and what follows depends on it."""
    scene = linkdyn.Scene(stops_oracle.random_chain(1010, 3, 3)[0])
    run = scene.forward(t=TIMES, rtol=1e-11, atol=1e-11, method="gbs")
    assert run.attrs["stopped"] == "" and np.all(run.status == 0)
    assert_energy_is_lost_by_impacts_alone(run)


def test_instants_of_output_change_no_impact():
    scene = linkdyn.Scene(stops_oracle.random_chain(1010, 3, 3)[0])
    few, many = (scene.forward(t=t, rtol=1e-9, atol=1e-9, method="gbs") for t in ([0, 0.8], np.linspace(0, 0.8, 200)))
    np.testing.assert_array_equal(few.event_time, many.event_time)
    np.testing.assert_array_equal(few.event, many.event)


def tower(**parts: Any) -> linkdyn.Scene:
    """A block of 2 kg on a vertical slide, and one of 1 kg that slides on it: x above the ground, s above the first."""
    axis = {"at": [0, 0], "axis": [0, 1]}
    description: dict[str, Any] = {
        "space": "planar",
        "gravity": [0, -GRAVITY],
        "frame": {"markers": {"O": axis}},
        "link": [{"name": "low", "markers": {"O": axis}, "mass": 2.0, "inertia": 1.0}, {"name": "high", "markers": {"O": axis}, "mass": 1.0, "inertia": 1.0}],
        "joint": [{"name": "x", "type": "prismatic", "between": ["frame.O", "low.O"]}, {"name": "s", "type": "prismatic", "between": ["low.O", "high.O"]}],
        "coordinate": [{"joint": "x", "start": 1.0}, {"joint": "s", "start": 0.0}],
    }
    return linkdyn.Scene(description | parts)


def test_an_impact_goes_through_a_contact_at_rest():
    # They fall as one and are thrown back as one: the upper block takes its part of the impulse from the lower one.
    e, fall = 0.5, math.sqrt(2 / GRAVITY)
    run = tower(stop=[{"name": "ground", "joint": "x", "min": 0, "restitution": e}, {"name": "seat", "joint": "s", "min": 0, "restitution": 0.3}]).forward(t_end=3.0)
    assert run.attrs["stopped"] == ""
    ground = run.event.values == "ground.min"
    speed = GRAVITY * fall
    np.testing.assert_allclose(run.event_time.values[ground][:2], [fall, fall * (1 + 2 * e)], rtol=0, atol=1e-11)
    np.testing.assert_allclose(run.event_impulse.values[ground][:2], [3 * (1 + e) * speed, 3 * (1 + e) * e * speed], rtol=1e-11)
    assert float(run.event_loss.sum()) == pytest.approx(3 * GRAVITY, rel=1e-10)
    assert np.abs(run.q.values[:, 1]).max() < 1e-10
    # At rest the ground carries both.
    assert np.abs(run.q.values[-1]).max() < 1e-10 and np.abs(run.qdd.values[-1]).max() < 1e-9


def test_an_impact_opens_a_contact_at_rest():
    # Thrown up against a ceiling, the upper block on its seat: the lower one is thrown back, and the upper one flies on.
    e, v = 0.5, 2.0
    run = tower(
        gravity=[0, 0],
        coordinate=[{"joint": "x", "start": {"position": 0.0, "velocity": v}}, {"joint": "s", "start": 0.0}],
        stop=[{"name": "ceiling", "joint": "x", "max": 1.0, "restitution": e}, {"name": "seat", "joint": "s", "min": 0, "restitution": 0.0}],
    ).forward(t=np.linspace(0, 1.0, 21))
    assert run.attrs["stopped"] == ""
    at = run.event.values == "ceiling.max"
    assert run.event_time.values[at][0] == pytest.approx(0.5, abs=1e-12)
    np.testing.assert_allclose(run.event_qd_after.values[at][0], [-e * v, v + e * v], rtol=1e-12)
    assert run.event_impulse.values[at][0] == pytest.approx(2 * (1 + e) * v, rel=1e-12)
    later = np.maximum(run.time.values - 0.5, 0)
    np.testing.assert_allclose(run.q.values[:, 1], 3 * later, rtol=0, atol=1e-10)


def test_two_impacts_at_the_same_instant():
    # Both blocks come to stops of their own at once, with different restitution: x' = -e1 u, and the relative one -e2 w.
    run = tower(
        gravity=[0, 0],
        coordinate=[{"joint": "x", "start": {"position": 0.0, "velocity": 1.0}}, {"joint": "s", "start": {"position": 0.0, "velocity": 2.0}}],
        stop=[{"name": "ceiling", "joint": "x", "max": 1.0, "restitution": 0.25}, {"name": "hook", "joint": "s", "max": 2.0, "restitution": 0.75}],
    ).forward(t_end=1.2)
    np.testing.assert_allclose(run.event_time.values[:2], [1, 1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.event_qd_after.values[1], [-0.25, -1.5], rtol=1e-12)
    # The hook pushes the upper block from 3 to -1.75; the ceiling what that and the lower block's change leave.
    impulse = dict(zip(run.event.values[:2], run.event_impulse.values[:2]))
    assert impulse["hook.max"] == pytest.approx(4.75, rel=1e-12)
    assert impulse["ceiling.max"] == pytest.approx(4.75 + 2 * 1.25, rel=1e-12)
    loss = (2 * 1 + 1 * 9) / 2 - (2 * 0.0625 + 1.75**2) / 2
    assert float(run.event_loss.sum()) == pytest.approx(loss, rel=1e-12)
