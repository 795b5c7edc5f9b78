"""Clutches, brakes, dry friction and locks of forward runs, against closed forms, merged bodies and balances."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import linkdyn
from integrators import METHODS


def times(run: xr.Dataset, name: str, *kinds: str) -> np.ndarray:
    """Instants of an event, of some kinds only."""
    meanings = run.event_kind.attrs["flag_meanings"].split()
    told = np.array([meanings[kind] for kind in run.event_kind.values])
    return run.event_time.values[(run.event.values == name) & (np.isin(told, kinds) if kinds else True)]


def shafts(**parts: Any) -> linkdyn.Scene:
    """Two shafts "A", "B" of 0.3 and 1.1 kg m2; the first one turns at 100 rad/s."""
    links = [("engine", "A", 0.3), ("car", "B", 1.1)]
    description: dict[str, Any] = {
        "space": "spatial",
        "frame": {"markers": {"A": [0, 0, 0], "B": [0.2, 0, 0]}},
        "link": [{"name": link, "markers": {at: [0, 0, 0]}, "mass": 1, "inertia": [1, 1, inertia, 0, 0, 0]} for link, at, inertia in links],
        "joint": [{"name": at, "type": "revolute", "between": [f"frame.{at}", f"{link}.{at}"]} for link, at, _ in links],
        "coordinate": [{"joint": "A", "start": {"position": 0, "velocity": 100}}, {"joint": "B", "start": 0}],
        "actuator": [{"joint": "A", "law": {"type": "constant", "value": 20}}, {"joint": "B", "law": {"type": "constant", "value": -5}}],
        "clutch": [{"name": "C", "joint": "A", "to": "B", "capacity": 60, "from": 0.5}],
        "time": {"end": 2},
    }
    return linkdyn.Scene(description | parts)


# ---------------------------------------------------------------------------------------------------------------- slipping, holding
@pytest.mark.parametrize("method", METHODS)
def test_two_inertias_are_coupled_in_closed_form(method):
    run = shafts().forward(method=method, t=np.linspace(0, 2, 101))
    slip = 100 + 20 / 0.3 * 0.5 + 5 / 1.1 * 0.5
    slowing = (60 - 20) / 0.3 + (60 - 5) / 1.1
    error = 1e-5 if method == "msbdf" else 1e-11
    np.testing.assert_allclose(times(run, "C", "close"), [0.5], rtol=0, atol=1e-14)
    np.testing.assert_allclose(times(run, "C", "stick"), [0.5 + slip / slowing], rtol=error)
    late = run.sel(time=slice(1.3, None))
    together = (1.1 * 20 + 0.3 * 5) / 1.4  # what gets through, of forces alone
    np.testing.assert_allclose(late.clutch_force[:, 0], -together, rtol=1e-12)
    np.testing.assert_allclose(late.qdd, 15 / 1.4, rtol=1e-12)
    assert np.abs(late.clutch_slip).max() < 1e-12 * 100
    states = run.clutch_state.attrs["flag_meanings"].split()
    assert [states[k] for k in run.clutch_state.values[[0, 40, -1], 0]] == ["open", "slips", "holds"]
    # Heat, from the energies: what was put in is kinetic or lost; half of the capacity times slip and duration.
    lost = float(run.kinetic_energy[0] + run.work[-1] - run.kinetic_energy[-1])
    assert lost == pytest.approx(60 * slip**2 / slowing / 2, rel=1e-4 if method == "msbdf" else 1e-10)


def test_with_a_ratio_and_a_capacity_that_grows():
    # 0.3 w1' = 20 - c, 1.1 w2' = -5 + 3 c, s = w1 - 3 w2, c = 40 t
    run = shafts(clutch=[{"name": "C", "joint": "A", "to": "B", "ratio": 3, "capacity": "40 N m/s*time"}]).forward(t_end=4.0)
    b = 20 / 0.3 + 15 / 1.1
    a = 40 * (1 / 0.3 + 9 / 1.1)
    instant = (b + math.sqrt(b * b + 2 * a * 100)) / a
    np.testing.assert_allclose(times(run, "C", "stick"), [instant], rtol=1e-11)
    assert np.abs(run.clutch_slip.sel(time=slice(2.6, None))).max() < 1e-11


def belt(**parts: Any) -> linkdyn.Scene:
    """A mass of 2 kg on a spring of 800 N/m, on a belt that runs at 0.1 m/s."""
    axis = {"at": [0, 0], "axis": [1, 0]}
    description: dict[str, Any] = {
        "space": "planar",
        "gravity": [0, 0],
        "frame": {"markers": {"O": axis}},
        "link": [{"name": name, "markers": {"O": axis}, "mass": 2.0, "inertia": 1} for name in ("belt", "mass")],
        "joint": [{"name": name, "type": "prismatic", "between": ["frame.O", f"{link}.O"]} for name, link in (("b", "belt"), ("x", "mass"))],
        "coordinate": [
            {"joint": "b", "driven": True, "motion": {"law": "constant-rate", "start": 0, "rate": 0.1}},
            {"joint": "x", "start": {"position": 0, "velocity": 0.1}},
        ],
        "actuator": [{"joint": "b"}],
        "spring": [{"name": "k", "joint": "x", "stiffness": 800}],
        "clutch": [{"name": "rub", "joint": "x", "to": "b", "capacity": 6, "static": 1.5}],
        "time": {"end": 3},
    }
    return linkdyn.Scene(description | parts)


@pytest.mark.parametrize("method", METHODS)
def test_stick_slip_has_its_period(method):
    run = belt().forward(method=method, t=np.linspace(0, 3, 301))
    w, reach = math.sqrt(800 / 2), (9 - 6) / 800
    slips, sticks = 2 * (math.pi - math.atan(reach * w / 0.1)) / w, 2 * reach / 0.1
    error = 1e-5 if method in ("msbdf", "rk4") else 1e-7
    found = times(run, "rub", "slip")
    np.testing.assert_allclose(found[0], 9 / 800 / 0.1, rtol=error)
    np.testing.assert_allclose(np.diff(found), slips + sticks, rtol=error)
    np.testing.assert_allclose(times(run, "rub", "stick") - found[: len(times(run, "rub", "stick"))], slips, rtol=error)
    held = run.clutch_state.values[:, 0] == 2
    assert np.abs(run.qd.values[held, 1] - 0.1).max() < 1e-15
    np.testing.assert_allclose(run.clutch_force.values[held, 0], 800 * run.q.values[held, 1], rtol=1e-12)
    # The belt is driven by what the mass takes of it.
    np.testing.assert_allclose(run.driving_force.values[:, 0], run.clutch_force.values[:, 0], rtol=1e-12)


def incline(capacity: Any, **parts: Any) -> linkdyn.Scene:
    """3 kg on a slope of 30 degrees, held by dry friction."""
    axis = {"at": [0, 0], "axis": [math.cos(math.pi / 6), math.sin(math.pi / 6)]}
    description: dict[str, Any] = {
        "space": "planar",
        "gravity": [0, -9.81],
        "frame": {"markers": {"O": axis}},
        "link": [{"name": "block", "markers": {"O": {"at": [0, 0], "axis": [1, 0]}}, "mass": 3.0, "inertia": 1}],
        "joint": [{"name": "x", "type": "prismatic", "between": ["frame.O", "block.O"]}],
        "coordinate": [{"joint": "x", "start": 0}],
        "clutch": [{"name": "dry", "joint": "x", "capacity": capacity}],
        "time": {"end": 10},
    }
    return linkdyn.Scene(description | parts)


WEIGHT = 3 * 9.81 / 2


@pytest.mark.thorough
@pytest.mark.parametrize("method", METHODS)
def test_a_block_on_a_slope_does_not_creep(method):
    run = incline(15).forward(method=method, t=np.linspace(0, 1000, 11), **({"step": 0.1} if method == "rk4" else {}))
    np.testing.assert_array_equal(run.q, 0)
    assert run.sizes.get("event", 0) == 0
    np.testing.assert_allclose(run.clutch_force, WEIGHT, rtol=1e-13)
    # Whatever holds it, the reaction is that of a block at rest.
    np.testing.assert_allclose(np.linalg.norm(run.reaction.values[:, 0, :2], axis=1), 3 * 9.81 * math.cos(math.pi / 6), rtol=1e-12)


def test_it_breaks_loose_where_the_capacity_is_used_up():
    run = incline("20 N - 1 N/s*time").forward(t_end=8.0)
    begins = 20 - WEIGHT
    np.testing.assert_allclose(times(run, "dry", "slip"), [begins], rtol=1e-9)
    late = run.time.values > begins
    gone = run.time.values[late] - begins
    np.testing.assert_allclose(run.q.values[late, 0], -(gone**3) / 6 / 3, atol=1e-9)
    assert (run.q.values[~late] == 0).all()


def test_a_push_to_and_fro_comes_to_rest_between():
    # Slides where the force is above 15 N, stops when what it has gained is used up; each half wave alike.
    run = incline(12, gravity=[0, 0], load=[{"on": "block.O", "axes": "link", "force": ["20 N*sin(2 rad/s*time)", 0]}]).forward(
        t_end=2 * math.pi, rtol=1e-11, atol=1e-13
    )
    slips, sticks = times(run, "dry", "slip"), times(run, "dry", "stick")
    np.testing.assert_allclose(slips, math.asin(0.6) / 2 + np.arange(4) * math.pi / 2, rtol=1e-9)
    begins = math.asin(0.6)
    low, high = 2.0, 4.0
    for _ in range(200):  # 20 (cos b - cos x) = 12 (x - b)
        middle = (low + high) / 2
        low, high = (middle, high) if 20 * (math.cos(begins) - math.cos(middle)) > 12 * (middle - begins) else (low, middle)
    np.testing.assert_allclose(sticks[:3], low / 2 + np.arange(3) * math.pi / 2, rtol=1e-9)


# ---------------------------------------------------------------------------------------------------------------- locks
def arms(**parts: Any) -> dict[str, Any]:
    """A double pendulum in a plane."""
    return {
        "space": "planar",
        "gravity": [0, -9.81],
        "frame": {"markers": {"A": [0, 0]}},
        "link": [
            {"name": "upper", "markers": {"A": [0, 0], "B": [0.5, 0]}, "mass": 2.0, "cog": [0.2, 0.03], "inertia": 0.06},
            {"name": "lower", "markers": {"B": [0, 0]}, "mass": 1.2, "cog": [0.25, 0], "inertia": 0.04},
        ],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "upper.A"]},
            {"name": "B", "type": "revolute", "between": ["upper.B", "lower.B"]},
        ],
        "coordinate": [{"joint": "A", "start": {"position": 0.3, "velocity": 1.0}}, {"joint": "B", "start": {"position": 0.4, "velocity": -2.5}}],
        "time": {"end": 3},
    } | parts


def momentum(q: np.ndarray, qd: np.ndarray) -> tuple[float, float]:
    """Angular momentum of the double pendulum about A, and kinetic energy, from places and velocities alone."""
    total, energy = 0.0, 0.0
    for mass, inertia, corner, at, angle, rates in (
        (2.0, 0.06, None, (0.2, 0.03), q[0], (qd[0], 0.0)),
        (1.2, 0.04, (0.5, 0.0), (0.25, 0.0), q[0] + q[1], (qd[0], qd[0] + qd[1])),
    ):
        place, velocity, omega = 0j, 0j, qd[0]
        if corner is not None:
            place = complex(*corner) * np.exp(1j * q[0])
            velocity = 1j * qd[0] * place
            omega = rates[1]
        arm = complex(*at) * np.exp(1j * angle)
        place, velocity = place + arm, velocity + 1j * omega * arm
        total += mass * (place.conjugate() * velocity).imag + inertia * omega
        energy += mass * abs(velocity) ** 2 / 2 + inertia * omega**2 / 2
    return total, energy


def merged(q: np.ndarray, rate: float, start: float, end: float) -> xr.Dataset:
    """The pendulum of both links in one, from an instant on."""
    bend = q[1]
    mass = 3.2
    lower = complex(0.5, 0) + 0.25 * np.exp(1j * bend)
    cog = (2.0 * complex(0.2, 0.03) + 1.2 * lower) / mass
    inertia = 0.1 + 2.0 * abs(complex(0.2, 0.03) - cog) ** 2 + 1.2 * abs(lower - cog) ** 2
    data = arms(
        link=[{"name": "upper", "markers": {"A": [0, 0]}, "mass": mass, "cog": [cog.real, cog.imag], "inertia": inertia}],
        joint=arms()["joint"][:1],
        coordinate=[{"joint": "A", "start": {"position": q[0], "velocity": rate}}],
    )
    return linkdyn.Scene(data).forward(t=np.linspace(0, end - start, 11), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("method", ["gbs", "seulex", "rk4"])
@pytest.mark.parametrize("way", ["time", "event"])
def test_links_that_lock_go_on_as_one(method, way):
    parts: dict[str, Any] = {"clutch": [{"name": "L", "joint": "B", "from": 0.37}]}
    if way == "event":
        parts = {
            "measures": {"a": {"joint": "A"}},
            "event": [{"name": "there", "when": "a + 0.4 rad", "direction": "down"}],
            "clutch": [{"name": "L", "joint": "B", "from_event": "there"}],
        }
    run = linkdyn.Scene(arms(**parts)).forward(method=method, t=np.linspace(0, 3, 301), rtol=1e-12, atol=1e-12)
    k = int(np.flatnonzero((run.event.values == "L"))[0])
    q, before, after = run.event_q.values[k], run.event_qd.values[k], run.event_qd_after.values[k]
    assert abs(after[1]) < 1e-14 and abs(before[1]) > 0.1
    (spin_before, energy_before), (spin_after, energy_after) = momentum(q, before), momentum(q, after)
    assert spin_after == pytest.approx(spin_before, rel=1e-11)
    assert run.event_loss.values[k] == pytest.approx(energy_before - energy_after, rel=1e-10)
    locked = float(run.event_time[k])
    one = merged(q, after[0], locked, 3.0)
    error = 1e-8 if method == "rk4" else 1e-10
    assert float(run.q[-1, 0]) == pytest.approx(float(one.q[-1, 0]), abs=error)
    late = run.time.values > locked + 1e-9
    assert (run.q.values[late, 1] == q[1]).all()  # no creep
    # The clutch passes on what the merged body bears inside: its power balance and energy close.
    total = run.kinetic_energy + run.potential_energy
    assert np.abs(total.values[late] - total.values[-1]).max() < error * 100


def test_what_was_locked_is_released():
    scene = linkdyn.Scene(arms(clutch=[{"name": "L", "joint": "B", "until": 1.0}], coordinate=[{"joint": "A", "start": 0.3}, {"joint": "B", "start": 0.4}]))
    run = scene.forward(t=np.linspace(0, 2, 201))
    one = merged(np.array([0.3, 0.4]), 0.0, 0.0, 1.0)
    assert (run.q.values[:101, 1] == 0.4).all()
    assert float(run.q[100, 0]) == pytest.approx(float(one.q[-1, 0]), abs=1e-8)
    free = linkdyn.Scene(arms(coordinate=[{"joint": "A", "start": {"position": float(run.q[100, 0]), "velocity": float(run.qd[100, 0])}}, {"joint": "B", "start": 0.4}]))
    assert times(run, "L", "open") == [1.0]
    np.testing.assert_allclose(free.forward(t=[0, 1.0]).q[-1], run.q[-1], atol=1e-7)


def test_power_balances_while_a_joint_rubs_and_sticks():
    run = linkdyn.Scene(arms(clutch=[{"name": "L", "joint": "B", "capacity": "1.5 N m + 0.3 N m*sin(9 rad/s*time)", "static": 1.2}])).forward(
        t=np.linspace(0, 1, 5001), rtol=1e-11, atol=1e-11
    )
    assert float(np.abs(run.power_imbalance).max()) < 1e-10  # where it all but rests powers are small
    assert len(times(run, "L", "stick")) >= 2 and len(times(run, "L", "slip")) >= 1
    # Energy goes where slip and force say.
    energy = (run.kinetic_energy + run.potential_energy).values
    power = (run.clutch_force * run.clutch_slip).values[:, 0]
    assert power.max() <= 0
    assert energy[-1] - energy[0] == pytest.approx(np.trapezoid(power, run.time.values), rel=1e-5)
    held = run.clutch_state.values[:, 0] == 2
    assert (run.qd.values[held, 1] == 0).all() and held.any()


@pytest.mark.thorough
def test_an_angle_that_is_no_coordinate_is_held_without_creep():
    # Led by the lower link's attitude: the hinge B is no coordinate, and what holds it is not linear in those.
    data = arms(clutch=[{"name": "L", "joint": "C"}])
    data["link"] += [{"name": "bar", "markers": {"C": [0, 0], "D": [0.6, 0]}, "mass": 0.8, "cog": [0.3, 0], "inertia": 0.03}]
    data["link"][1]["markers"]["C"] = [0.5, 0]
    data["link"] += [{"name": "rocker", "markers": {"D": [0, 0], "E": [0.55, 0]}, "mass": 0.7, "cog": [0.2, 0], "inertia": 0.02}]
    data["frame"]["markers"]["E"] = [0.9, 0.2]
    data["joint"] += [
        {"name": "C", "type": "revolute", "between": ["lower.C", "bar.C"], "start": -1.8},
        {"name": "D", "type": "revolute", "between": ["bar.D", "rocker.D"], "start": 2.0},
        {"name": "E", "type": "revolute", "between": ["rocker.E", "frame.E"]},
    ]
    data["coordinate"] = [{"joint": "A", "start": 1.2}, {"joint": "B", "start": -0.6}]
    scene = linkdyn.Scene(data)
    run = scene.forward(t=np.linspace(0, 20, 201))
    assert (run.status == 0).all() and np.ptp(run.q.values[:, 0]) > 0.2
    angle = run.joint_variable.sel(variable="C.angle").values
    # What steps let slip is led back within some ten steps, each of which may err by the tolerance and, its error being a rate's,
    # some times over: it does not gather over the run's 300 to 3,000 steps, as it would in a square, 10 s times the tolerance a step.
    assert np.abs(angle - angle[0]).max() < 200 * 1e-9
    loose = scene.forward(t=np.linspace(0, 20, 201), rtol=1e-5, atol=1e-5).joint_variable.sel(variable="C.angle").values
    assert np.abs(loose - loose[0]).max() < 200 * 1e-5
    # Each step may make or lose the tolerance's part of what there is.
    total = (run.kinetic_energy + run.potential_energy).values
    assert np.abs(total - total[0]).max() < run.attrs["steps"] * 1e-9 * total[0]


def test_several_that_depend_on_each_other():
    # Three clutches round two shafts and the frame: any two hold all; what they pass on together is what one would.
    clutches = [{"name": "a", "joint": "A"}, {"name": "b", "joint": "B"}, {"name": "ab", "joint": "A", "to": "B"}]
    run = shafts(clutch=clutches, coordinate=[{"joint": "A", "start": 0}, {"joint": "B", "start": 0}]).forward(t=[0, 1.0])
    np.testing.assert_array_equal(run.qd, 0)
    force = run.clutch_force.values[-1]
    assert force[0] + force[2] == pytest.approx(-20) and force[1] - force[2] == pytest.approx(5)
    # Two brakes on one shaft hold as much as both: 12 and 10 against 20, which grows.
    pair = [{"name": name, "joint": "A", "capacity": capacity} for name, capacity in (("a", 12), ("b", 10))]
    coordinates = [{"joint": "A", "start": 0}, {"joint": "B", "start": 0}]
    actuators = [{"joint": "A", "law": {"type": "formula", "value": "4 N m/s*time"}}]
    run = shafts(clutch=pair, coordinate=coordinates, actuator=actuators).forward(t=np.linspace(0, 7, 71))
    still = run.time.values < 22 / 4
    assert np.abs(run.q.values[still, 0]).max() < 1e-12
    gone = run.time.values[~still] - 5.5
    np.testing.assert_allclose(run.q.values[~still, 0], 4 * gone**3 / 6 / 0.3, rtol=1e-6, atol=1e-9)


def test_a_lock_and_a_stop_strike_together():
    # The locked pendulum falls on a stop at A: as the merged one does.
    stop = [{"name": "s", "joint": "A", "min": -0.5, "restitution": 0.6}]
    start = [{"joint": "A", "start": 0.3}, {"joint": "B", "start": 0.4}]
    run = linkdyn.Scene(arms(stop=stop, clutch=[{"name": "L", "joint": "B"}], coordinate=start)).forward(t=np.linspace(0, 2, 21), rtol=1e-11)
    data = arms(stop=stop, coordinate=start)
    bend = 0.4
    lower = complex(0.5, 0) + 0.25 * np.exp(1j * bend)
    cog = (2.0 * complex(0.2, 0.03) + 1.2 * lower) / 3.2
    inertia = 0.1 + 2.0 * abs(complex(0.2, 0.03) - cog) ** 2 + 1.2 * abs(lower - cog) ** 2
    data["link"] = [{"name": "upper", "markers": {"A": [0, 0]}, "mass": 3.2, "cog": [cog.real, cog.imag], "inertia": inertia}]
    data["joint"], data["coordinate"] = data["joint"][:1], data["coordinate"][:1]
    one = linkdyn.Scene(data).forward(t=np.linspace(0, 2, 21), rtol=1e-11)
    hits, hits_of_one = times(run, "s.min", "impact"), times(one, "s.min", "impact")
    assert len(hits) > 2
    np.testing.assert_allclose(hits, hits_of_one, atol=1e-8)
    np.testing.assert_allclose(run.q[:, 0], one.q[:, 0], atol=1e-8)
    assert (run.q.values[:, 1] == 0.4).all()


def test_an_impact_is_more_than_a_capacity():
    stop = [{"name": "s", "joint": "A", "min": -0.5, "restitution": 0.6}]
    start = [{"joint": "A", "start": 0.3}, {"joint": "B", "start": 0.4}]
    scene = linkdyn.Scene(arms(stop=stop, clutch=[{"name": "L", "joint": "B", "capacity": 5.0}], coordinate=start))
    run = scene.forward(t=np.linspace(0, 0.6, 6001), rtol=1e-11, atol=1e-11, method="gbs")
    hits = times(run, "s.min", "impact")
    assert times(run, "L", "slip") == [hits[0]]
    energy = (run.kinetic_energy + run.potential_energy).values
    rubbed = np.trapezoid((run.clutch_force * run.clutch_slip).values[:, 0], run.time.values)
    assert energy[-1] - energy[0] == pytest.approx(rubbed - float(run.event_loss.sum()), rel=1e-3)


# ---------------------------------------------------------------------------------------------------------------- other ways to run
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rubs", ["clutch", "friction"])
def test_what_slips_is_thrown_back_and_slips_on(method, rubs):
    """A block that rubs between two walls, each of which takes 0.36 of its energy, step by step by hand."""
    axis, mu = {"at": [0, 0], "axis": [1, 0]}, 0.15
    rubbing = {"clutch": {"name": "rub", "joint": "x", "capacity": mu * 2 * 9.81}, "friction": {"joint": "x", "coulomb": mu, "sticking": True}}
    scene = linkdyn.Scene({
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"O": axis}},
        "link": [{"name": "block", "markers": {"O": axis}, "mass": 2.0, "inertia": 1}],
        "joint": [{"name": "x", "type": "prismatic", "between": ["frame.O", "block.O"]}],
        "coordinate": [{"joint": "x", "start": {"position": 0, "velocity": 4}}],
        "stop": [{"name": "walls", "joint": "x", "min": -0.3, "max": 0.3, "restitution": 0.8}],
        rubs: [rubbing[rubs]],
    })
    place, way, speed, t, struck = 0.0, 1, 4.0, 0.0, []
    while (square := speed**2 - 2 * mu * 9.81 * (0.3 - way * place)) > 0:
        t += (speed - math.sqrt(square)) / (mu * 9.81)
        struck.append(t)
        place, way, speed = way * 0.3, -way, 0.8 * math.sqrt(square)
    rest, end = place + way * speed**2 / (2 * mu * 9.81), t + speed / (mu * 9.81)
    assert len(struck) > 3
    run = scene.forward(method=method, t=np.linspace(0, 2, 41))
    error = 1e-5 if method == "msbdf" else 1e-9
    np.testing.assert_allclose(np.sort(np.append(times(run, "walls.min"), times(run, "walls.max"))), struck, rtol=error)
    np.testing.assert_allclose(times(run, "rub" if rubs == "clutch" else "x"), [end], rtol=error)
    np.testing.assert_allclose(run.q.values[-1, 0], rest, rtol=0, atol=error)
    assert (run.clutch_force * run.clutch_slip).max() <= 0


def test_ensembles_and_simulators_do_the_same():
    scene = belt()
    t = np.linspace(0, 1.5, 16)
    run = scene.forward(method="rk4", step=1e-3, t=t)
    q = np.array([[0, 0.0], [0, 0.002], [0, -0.004]])
    members = scene.ensemble(q, np.array([[0.1, 0.1], [0.1, 0.0], [0.1, 0.3]]), t, step=1e-3)
    np.testing.assert_allclose(members.q[0], run.q, atol=1e-12)
    for k in (1, 2):
        data = belt(coordinate=[belt_coordinate(), {"joint": "x", "start": {"position": q[k, 1], "velocity": [0.1, 0.0, 0.3][k]}}])
        alone = data.forward(method="rk4", step=1e-3, t=t)
        np.testing.assert_allclose(members.q[k], alone.q, atol=1e-12)
    scene = shafts(clutch=[{"name": "C", "joint": "A", "to": "B", "capacity": 60, "from": 0.5, "until": 1.6}])
    run = scene.forward(t=[0, 1.0, 1.5, 2.0])
    sim = scene.simulator()
    for instant in (1.0, 1.5, 2.0):
        while sim.t < instant - 1e-9:
            sim.step(0.05, [20, -5])
        np.testing.assert_allclose(sim.qd, run.qd.sel(time=instant), rtol=1e-8)


def belt_coordinate() -> dict[str, Any]:
    return {"joint": "b", "driven": True, "motion": {"law": "constant-rate", "start": 0, "rate": 0.1}}


def test_nothing_joins_two_that_are_driven():
    second = {"joint": "x", "driven": True, "motion": {"law": "constant-rate", "start": 0, "rate": 0.3}}
    data = belt(coordinate=[belt_coordinate(), second], actuator=[{"joint": "b"}, {"joint": "x"}], clutch=[{"name": "L", "joint": "x", "to": "b", "from": 0.5}])
    run = data.forward(t=np.linspace(0, 1, 11))
    assert "clutch 'L'" in run.attrs["stopped"] and "driven" in run.attrs["stopped"]


def test_inverse_dynamics_does_not_look_at_them():
    data = {"coordinate": [{"joint": name, "motion": {"law": "constant-rate", "start": 0, "rate": 1}} for name in "AB"]}
    with_one, without = shafts(**data), shafts(**data, clutch=[])
    assert with_one.inverse(t=[0.0, 1.0]).driving_force.identical(without.inverse(t=[0.0, 1.0]).driving_force)


# ---------------------------------------------------------------------------------------------------------------- friction of reactions
def slope(angle: float, coulomb: float, **friction: Any) -> linkdyn.Scene:
    """3 kg on a slope, rubbed by what presses it on."""
    axis = {"at": [0, 0], "axis": [math.cos(angle), math.sin(angle)]}
    return incline(1, frame={"markers": {"O": axis}}, clutch=[], friction=[{"joint": "x", "coulomb": coulomb, "sticking": True} | friction])


@pytest.mark.parametrize("method", METHODS)
def test_a_block_sticks_below_the_angle_of_friction_and_slides_above(method):
    settings = {"step": 0.1} if method == "rk4" else {}
    run = slope(0.3, math.tan(0.3) * 1.0001).forward(method=method, t=np.linspace(0, 300, 11), **settings)
    np.testing.assert_array_equal(run.q, 0)
    np.testing.assert_allclose(run.clutch_force, 3 * 9.81 * math.sin(0.3), rtol=1e-13)
    # The wrench of friction is what holds it, and all that the block feels carries its weight.
    felt = run.reaction.values[:, 0, :2] + run.friction.values[:, 0, :2]
    np.testing.assert_allclose(felt, np.tile([0, 3 * 9.81], (11, 1)), atol=1e-12)
    mu = math.tan(0.3) * 0.9
    run = slope(0.3, mu).forward(method=method, t=np.linspace(0, 1, 11))
    slows = 9.81 * (math.sin(0.3) - mu * math.cos(0.3))
    np.testing.assert_allclose(run.q.values[:, 0], -slows * run.time.values**2 / 2, atol=1e-6 if method == "msbdf" else 1e-9)
    np.testing.assert_allclose(run.clutch_force, 3 * 9.81 * mu * math.cos(0.3), rtol=1e-9)


def test_thrown_up_the_slope_it_stops_and_stays_or_comes_back():
    for mu, comes_back in ((0.5, False), (0.2, True)):
        scene = slope(0.3, mu).with_({"coordinate.x.start": {"position": 0.0, "velocity": 2.0}})
        run = scene.forward(t=np.linspace(0, 2, 201))
        up = 9.81 * (math.sin(0.3) + mu * math.cos(0.3))
        down = 9.81 * (math.sin(0.3) - mu * math.cos(0.3))
        top = 2.0 / up
        t = run.time.values
        expected = np.where(t < top, 2 * t - up * t**2 / 2, 2 / up - max(down, 0) * (t - top) ** 2 / 2)
        np.testing.assert_allclose(run.q.values[:, 0], expected, atol=1e-10)
        assert len(times(run, "x", "stick")) == (0 if comes_back else 1)
        if not comes_back:
            np.testing.assert_allclose(times(run, "x", "stick"), [top], rtol=1e-11)
            late = run.q.values[t > top, 0]
            assert (late == late[0]).all()


def test_stick_slip_by_stribeck_against_quadrature():
    # On the belt, pressed on by 20 N: mu falls from 0.4 to 0.25 over the slip. One slip from the other, by numpy alone.
    axis = {"at": [0, 0], "axis": [1, 0]}
    data = empty_belt()
    data["clutch"] = []
    data["link"] = [
        {"name": "belt", "markers": {"O": axis}, "mass": 1.0, "inertia": 1},
        {"name": "mass", "markers": {"O": axis, "M": [0, 0]}, "mass": 2.0, "inertia": 1},
    ]
    data["joint"] = [
        {"name": "b", "type": "prismatic", "between": ["frame.O", "belt.O"]},
        {"name": "x", "type": "prismatic", "between": ["belt.O", "mass.O"]},
    ]
    data["coordinate"] = [belt_coordinate(), {"joint": "x", "start": 0}]
    data["frame"]["markers"]["W"] = [-1.0, 0]
    data["spring"] = [{"name": "k", "between": ["frame.W", "mass.M"], "stiffness": 800, "rest": 1.0}]
    data["friction"] = [{"joint": "x", "coulomb": 0.25, "static": 0.4, "stribeck_speed": 0.05, "preload": 20, "sticking": True}]
    run = linkdyn.Scene(data).forward(t=np.linspace(0, 2, 101), rtol=1e-11, atol=1e-12)
    slips, sticks = times(run, "x", "slip"), times(run, "x", "stick")
    np.testing.assert_allclose(slips[0], 8 / 800 / 0.1, rtol=1e-9)

    def rates(y):
        slip = 0.1 - y[1]
        mu = 0.25 + 0.15 * math.exp(-((slip / 0.05) ** 2))
        return np.array([y[1], (20 * mu - 800 * y[0]) / 2])

    y, t, h = np.array([0.01, 0.1 - 1e-9]), 0.0, 1e-5
    while True:
        k1 = rates(y)
        k2 = rates(y + h / 2 * k1)
        k3 = rates(y + h / 2 * k2)
        k4 = rates(y + h * k3)
        new = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        if t > 0.02 and new[1] >= 0.1:
            t += h * (0.1 - y[1]) / (new[1] - y[1])
            break
        y, t = new, t + h
    # The slip grows out of nothing, exponentially: its beginning is rounding's, its end is not.
    stuck = (0.01 - y[0]) / 0.1
    np.testing.assert_allclose(np.diff(slips)[1:] - (sticks[1 : len(slips) - 1] - slips[1:-1]), stuck, rtol=1e-3)


def empty_belt() -> dict[str, Any]:
    axis = {"at": [0, 0], "axis": [1, 0]}
    return {"space": "planar", "gravity": [0, 0], "frame": {"markers": {"O": axis}}, "actuator": [{"joint": "b"}], "time": {"end": 2}}


@pytest.mark.thorough
@pytest.mark.parametrize("planar", [True, False])
def test_a_hinge_sticks_by_its_own_load(planar):
    # A lever on a thick pin: gravity's moment m g a cos(q) against mu r F. It rests wherever that is less.
    r, mu, a, mass = 0.02, 0.3, 0.05, 4.0
    zero = [0, 0] if planar else [0, 0, 0]
    data: dict[str, Any] = {
        "space": "planar" if planar else "spatial",
        "gravity": [0, -9.81] if planar else [0, -9.81, 0],
        "frame": {"markers": {"A": zero}},
        "link": [{"name": "lever", "markers": {"A": zero}, "mass": mass, "cog": [a, *zero[1:]], "inertia": 0.01 if planar else [0.01, 0.01, 0.01, 0, 0, 0]}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "lever.A"]}],
        "coordinate": [{"joint": "A", "start": 1.5}],
        "friction": [{"joint": "A", "coulomb": mu, "radius": r, "sticking": True}],
        "time": {"end": 3},
    }
    held = linkdyn.Scene(data).forward(t=[0, 1.0, 100.0])
    assert (held.q.values == 1.5).all()  # cos(1.5) 0.05 < 0.006
    np.testing.assert_allclose(held.clutch_force, mass * 9.81 * a * math.cos(1.5), rtol=1e-12)
    data["coordinate"][0]["start"] = 0.5
    run = linkdyn.Scene(data).forward(t=np.linspace(0, 20, 2001), rtol=1e-10, atol=1e-10)
    rest = run.q.values[-1, 0]
    assert abs(a * math.cos(rest)) < mu * r and len(times(run, "A", "stick")) >= 1
    late = run.time.values > times(run, "A", "stick")[-1]
    assert (run.q.values[late, 0] == rest).all()
    energy = (run.kinetic_energy + run.potential_energy).values
    assert np.trapezoid(run.friction_power.values[:, 0], run.time.values) == pytest.approx(energy[0] - energy[-1], rel=2e-3)
    # Far from rest it is the smooth law.
    smooth = linkdyn.Scene(data | {"friction": [{"joint": "A", "coulomb": mu, "radius": r, "creep_speed": "1e-6 m/s"}]})
    np.testing.assert_allclose(run.q.values[:40], smooth.forward(method="seulex", t=run.time.values[:40]).q, atol=1e-6)


def jack(coulomb: float, torque: str | None = None, **start: float) -> linkdyn.Scene:
    """30 kg on a spindle in a nut, lead 12 mm, that the weight may turn."""
    data: dict[str, Any] = {
        "space": "spatial",
        "gravity": [0, 0, -9.81],
        "frame": {"markers": {"N": [0, 0, 0]}},
        "link": [{"name": "spindle", "markers": {"N": [0, 0, 0]}, "mass": 30.0, "inertia": [0.05, 0.05, 0.002, 0, 0, 0]}],
        "joint": [{"name": "S", "type": "screw", "between": ["frame.N", "spindle.N"], "lead": 0.012}],
        "coordinate": [{"joint": "S", "start": {"position": 0.3} | start}],
        "friction": [{"joint": "S", "coulomb": coulomb, "radius": 0.01, "sticking": True}],
        "time": {"end": 1},
    }
    if torque:
        data["actuator"] = [{"joint": "S", "law": {"type": "formula", "value": torque}}]
    return linkdyn.Scene(data)


PITCH, SLOPE, LOAD = 0.012 / (2 * math.pi), math.atan(0.012 / (2 * math.pi) / 0.01), 30 * 9.81


def on_the_flank(mu: float, way: int) -> float:
    """Acceleration of a thread that slides up or down: the wedge that it is, unrolled."""
    along = np.array([math.cos(SLOPE), math.sin(SLOPE)])  # of slope: tangential, axial
    force = np.array([-math.sin(SLOPE), math.cos(SLOPE)]) - way * mu * along  # for a unit pressing force
    matrix = np.array([[0.002, -0.01 * force[0]], [30 * PITCH, -force[1]]])
    return float(np.linalg.solve(matrix, [0, -LOAD])[0])


def test_a_screw_sticks_below_its_angle_of_friction_and_runs_down_above():
    run = jack(math.tan(SLOPE) * 1.0001).forward(t=np.linspace(0, 300, 11))
    np.testing.assert_array_equal(run.q, 0.3)
    np.testing.assert_allclose(run.clutch_force, LOAD * PITCH, rtol=1e-13)
    # Reaction and friction carry the weight between them, and no moment about the axis.
    np.testing.assert_allclose((run.reaction + run.friction).values[:, 0], np.tile([0, 0, LOAD, 0, 0, 0], (11, 1)), atol=1e-11)
    mu = math.tan(SLOPE) * 0.9
    run = jack(mu).forward(t=np.linspace(0, 1, 11), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(run.q.values[:, 0], 0.3 + on_the_flank(mu, -1) * run.time.values**2 / 2, rtol=1e-9)
    # Turned up by hand it comes to rest, stays, and has lost what friction took.
    run = jack(0.3, velocity=20.0).forward(t=np.linspace(0, 1, 101), rtol=1e-10, atol=1e-12)
    stop = 20.0 / -on_the_flank(0.3, 1)
    np.testing.assert_allclose(times(run, "S", "stick"), [stop], rtol=1e-9)
    late = run.q.values[run.time.values > stop, 0]
    assert (late == late[0]).all() and late[0] == pytest.approx(0.3 + 10 * stop, rel=1e-9)


@pytest.mark.parametrize("way", [1, -1])
def test_a_screw_breaks_loose_at_the_torque_of_the_handbook(way):
    mu = 0.25
    breaks = LOAD * 0.01 * math.tan(SLOPE + way * math.atan(mu))
    run = jack(mu, f"{way * 10} N*m/s*time").forward(t=np.linspace(0, 1, 21), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(times(run, "S", "slip"), [abs(breaks) / 10], rtol=1e-9)
    assert way * run.q.values[-1, 0] > way * 0.3 and (run.status == 0).all()


def test_hinges_that_turn_back_do_not_stick_and_all_come_to_rest_together():
    data: dict[str, Any] = {
        "space": "planar",
        "gravity": [0, -9.81],
        "frame": {"markers": {"A": [0, 0], "D": [0.9, 0.1]}},
        "link": [
            {"name": "crank", "markers": {"A": [0, 0], "B": [0.3, 0]}, "mass": 2.0, "cog": [0.2, 0], "inertia": 0.02},
            {"name": "rod", "markers": {"B": [0, 0], "C": [0.9, 0]}, "mass": 1.0, "cog": [0.45, 0], "inertia": 0.07},
            {"name": "rocker", "markers": {"C": [0, 0], "D": [0.5, 0]}, "mass": 1.5, "cog": [0.25, 0], "inertia": 0.03},
        ],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]},
            {"name": "B", "type": "revolute", "between": ["crank.B", "rod.B"]},
            {"name": "C", "type": "revolute", "between": ["rod.C", "rocker.C"]},
            {"name": "D", "type": "revolute", "between": ["frame.D", "rocker.D"]},
        ],
        "coordinate": [{"joint": "A", "start": {"position": 0.4, "velocity": 14.0}}],
    }
    rubs = [{"joint": name, "coulomb": 0.25, "radius": 0.05} for name in "ABCD"]
    scene = linkdyn.Scene(data | {"friction": [friction | {"sticking": True} for friction in rubs]})
    t = np.linspace(0, 20, 401)
    run = scene.forward(t=t, method="gbs")
    assert (run.status == 0).all() and not run.attrs["stopped"]
    rest = float(run.event_time.max())
    assert rest < 19 and np.abs(run.qd.values[t > rest]).max() < 1e-13 and np.ptp(run.q.values[t > rest]) < 1e-12
    # Rocker and rod have turned back many times by then: nothing stuck there, and the smooth law goes the same way.
    turns = np.diff(np.sign(run.joint_rate.sel(variable="D.angle").values[t < rest]))
    assert (turns != 0).sum() > 3 and np.unique(np.round(run.event_time, 9)).size <= 3
    smooth = linkdyn.Scene(data | {"friction": [friction | {"creep_speed": "1e-5 m/s"} for friction in rubs]})
    early = t < 0.8 * rest
    np.testing.assert_allclose(run.q.values[early], smooth.forward(t=t[early], method="seulex").q, atol=2e-3)


def test_legs_of_a_platform_lock_one_after_the_other():
    # Six freedoms by a quaternion; strokes are no coordinates. What energy is lost is what is told.
    folder = Path(__file__).parents[2] / "examples" / "stewart_forward"
    data = tomllib.loads((folder / "scene.toml").read_text())
    data["clutch"] = [{"name": "first", "joint": "leg1.P", "from": 0.1, "until": 0.6}, {"name": "fourth", "joint": "leg4.P", "from": 0.2}]
    run = linkdyn.Scene(data, folder=folder).forward(t=np.linspace(0, 1, 51), method="gbs")
    assert not run.attrs["stopped"] and (run.status == 0).all() and float(np.abs(run.power_imbalance).max()) < 1e-12
    t, energy = run.time.values, (run.kinetic_energy + run.potential_energy - run.work).values
    for name, begin, end in (("leg1.P.slide", 0.1, 0.6), ("leg4.P.slide", 0.2, 1.0)):
        stroke = run.joint_variable.sel(variable=name).values
        held = (t > begin - 1e-9) & (t < end + 1e-9)
        assert np.ptp(stroke[held]) < 1e-10 < np.ptp(stroke)
    losses = run.event_loss.values
    assert (losses[:2] > 1e-6).all() and losses[2] == 0
    for begin, end, lost in ((0, 0.1, 0), (0.1, 0.2, losses[0]), (0.2, 0.6, losses[0] + losses[1]), (0.6, 1.0, losses[0] + losses[1])):
        there = energy[(t > begin + 1e-9) & (t < end - 1e-9)]
        np.testing.assert_allclose(energy[0] - there, lost, atol=1e-8)


# ---------------------------------------------------------------------------------------------------------------- another road
PAIRS = [(0, None), (1, None), (2, None), (0, 1), (1, 2), (0, 2)]


def three_masses(seed: int) -> dict[str, Any]:
    """Three masses on springs, pushed to and fro, that rub on the ground and on each other."""
    g = np.random.default_rng(seed)
    return {
        "mass": g.uniform(0.5, 3, 3), "capacity": g.uniform(0.5, 6, 6), "v": g.uniform(-1, 1, 3), "k": g.uniform(5, 40, 3),
        "force": g.uniform(2, 10, 3), "pace": g.uniform(1, 7, 3), "use": [i for i in range(6) if g.random() < 0.7],
    }  # fmt: skip


def by_engine(d: dict[str, Any]) -> linkdyn.Scene:
    axis = {"at": [0, 0], "axis": [1, 0]}
    return linkdyn.Scene({
        "space": "planar", "gravity": [0, 0], "frame": {"markers": {"O": axis}},
        "link": [{"name": f"m{i}", "markers": {"O": axis}, "mass": d["mass"][i], "inertia": 1} for i in range(3)],
        "joint": [{"name": f"j{i}", "type": "prismatic", "between": ["frame.O", f"m{i}.O"]} for i in range(3)],
        "coordinate": [{"joint": f"j{i}", "start": {"position": 0, "velocity": d["v"][i]}} for i in range(3)],
        "spring": [{"name": f"s{i}", "joint": f"j{i}", "stiffness": d["k"][i]} for i in range(3)],
        "load": [{"on": f"m{i}.O", "force": [f"{float(d['force'][i])!r} N*sin({float(d['pace'][i])!r} rad/s*time)", 0]} for i in range(3)],
        "clutch": [
            {"name": f"c{i}", "joint": f"j{PAIRS[i][0]}", "capacity": d["capacity"][i]} | ({} if PAIRS[i][1] is None else {"to": f"j{PAIRS[i][1]}"})
            for i in d["use"]
        ],
        "time": {"end": 4},
    })  # fmt: skip


def by_time_steps(d: dict[str, Any], h: float, end: float, n: int) -> np.ndarray:
    """Moreau's steps: no events, impulses of friction within bounds in each, by relaxation."""
    m, use = [float(x) for x in d["mass"]], d["use"]
    ease = [1 / m[p] + (0 if q is None else 1 / m[q]) for p, q in PAIRS]
    x, v = [0.0] * 3, [float(u) for u in d["v"]]
    impulse, told, steps = {i: 0.0 for i in use}, [[0.0] * 3], round(end / h)
    for step in range(steps):
        x = [x[i] + h / 2 * v[i] for i in range(3)]
        v = [v[i] + h * (d["force"][i] * math.sin(d["pace"][i] * (step + 0.5) * h) - d["k"][i] * x[i]) / m[i] for i in range(3)]
        v = [float(u) for u in v]
        for i in use:
            push(v, m, i, impulse[i])
        for _ in range(100):
            largest = 0.0
            for i in use:
                p, q = PAIRS[i]
                wanted = min(max(impulse[i] - (v[p] - (0 if q is None else v[q])) / ease[i], -h * d["capacity"][i]), h * d["capacity"][i])
                push(v, m, i, wanted - impulse[i])
                largest = max(largest, abs(wanted - impulse[i]))
                impulse[i] = wanted
            if largest < 1e-12:
                break
        x = [x[i] + h / 2 * v[i] for i in range(3)]
        if (step + 1) % (steps // n) == 0:
            told.append(list(x))
    return np.array(told)


def push(v: list[float], m: list[float], i: int, impulse: float) -> None:
    p, q = PAIRS[i]
    v[p] += impulse / m[p]
    if q is not None:
        v[q] -= impulse / m[q]


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(8))
def test_several_rub_stick_and_let_go_as_time_steps_find(seed):
    d = three_masses(seed)
    run = by_engine(d).forward(t=np.linspace(0, 4, 41))
    error = np.abs(by_time_steps(d, 1e-3, 4.0, 40) - run.q.values).max()
    assert error < 2e-3, error
    assert run.sizes["event"] > 2 and (run.status == 0).all()


# ---------------------------------------------------------------------------------------------------------------- estimates, members
def test_two_hinges_of_a_loop_that_hold_by_what_presses_them():
    """A four-bar rests at a stop, is held by two hinges as the push falls, and breaks loose: how hard it presses hangs on who holds."""
    hinges = [("A", "frame.A", "crank.A"), ("B", "crank.B", "rod.B"), ("C", "rod.C", "rocker.C"), ("D", "frame.D", "rocker.D")]
    data: dict[str, Any] = {
        "space": "planar",
        "gravity": [0, -9.81],
        "frame": {"markers": {"A": [0, 0], "D": [0.401, 0]}},
        "link": [
            {"name": "crank", "mass": 2.96, "inertia": 0.044, "cog": [0.0435, 0], "markers": {"A": [0, 0], "B": [0.112, 0]}},
            {"name": "rod", "mass": 0.69, "inertia": 0.0214, "cog": [0.286, 0], "markers": {"B": [0, 0], "C": [0.572, 0]}},
            {"name": "rocker", "mass": 0.596, "inertia": 0.0204, "cog": [0.165, 0], "markers": {"D": [0, 0], "C": [0.329, 0]}},
        ],
        "joint": [{"name": name, "type": "revolute", "between": links} for name, *links in hinges],
        "coordinate": [{"joint": "A", "start": {"position": 0.545, "velocity": -2.28}}],
        "actuator": [{"joint": "A", "law": {"type": "formula", "value": "4 N*m*cos(3 rad/s*time)"}}],
        "stop": [{"name": "s", "joint": "A", "min": -1.24, "max": 1.99, "restitution": 0}],
    }
    data["joint"][2]["branch"] = 1
    t = np.linspace(0, 1, 51)
    rubs = [{"joint": joint, "coulomb": 0.2, "radius": 0.015} for joint in "BC"]
    run = linkdyn.Scene(data | {"friction": [rub | {"sticking": True} for rub in rubs]}).forward(t=t, rtol=1e-8, atol=1e-8)
    creeping = linkdyn.Scene(data | {"friction": [rub | {"creep_speed": 1e-5} for rub in rubs]})
    other = creeping.forward(t=t, method="seulex", rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(run.q.values, other.q.values, rtol=0, atol=2e-3)
    assert (times(run, "s.max", "release")[0] < times(run, "B", "slip")).any() or (times(run, "s.max", "release")[0] < times(run, "C", "slip")).any()


@pytest.mark.parametrize("joint", ["A", "B", "C", "D"])
@pytest.mark.parametrize("what", ["lock", "stop"])
def test_joints_do_not_rub_by_impulses(joint, what):
    """What an impact loses is what is gone of the kinetic energy, with the mass that is felt without any friction."""
    hinges = [("A", "frame.A", "crank.A"), ("B", "crank.B", "rod.B"), ("C", "rod.C", "piston.C")]
    data: dict[str, Any] = {
        "space": "planar",
        "frame": {"markers": {"A": [0, 0], "rail": {"at": [0, 0.01], "axis": [1, 0]}}},
        "link": [
            {"name": "crank", "mass": 1.0, "inertia": 0.02, "markers": {"A": [0, 0], "B": [0.08, 0]}},
            {"name": "rod", "mass": 0.8, "inertia": 0.008, "cog": [0.14, 0], "markers": {"B": [0, 0], "C": [0.3, 0]}},
            {"name": "piston", "mass": 1.5, "inertia": 0.002, "markers": {"C": {"at": [0, 0], "axis": [1, 0]}}},
        ],
        "joint": [*({"name": name, "type": "revolute", "between": links} for name, *links in hinges),
                  {"name": "D", "type": "prismatic", "between": ["frame.rail", "piston.C"]}],
        "coordinate": [{"joint": "A", "start": {"position": 0.4, "velocity": 6}}],
        "actuator": [{"joint": "A", "law": {"type": "constant", "value": 0}}],
    }  # fmt: skip
    plain = linkdyn.Scene(data)
    data["friction"] = [{"joint": name, "coulomb": 0.2, "radius": 0.02} for name in "ABC"]
    data["friction"] += [{"joint": "D", "coulomb": 0.2}]
    if what == "lock":
        data["clutch"] = [{"name": "hit", "joint": joint, "from": 0.1}]
    else:
        name = joint + (".slide" if joint == "D" else ".angle")
        way = plain.inverse(q=[[0.4], [0.9]]).joint_variable.sel(variable=name).values
        data["stop"] = [{"name": "hit", "joint": joint, "restitution": 0.5, "max" if way[1] > way[0] else "min": float(way[1])}]
    run = linkdyn.Scene(data).forward(t=np.linspace(0, 0.2, 21), rtol=1e-10, atol=1e-10)
    q, before, after = (getattr(run, key).values[0, 0] for key in ("event_q", "event_qd", "event_qd_after"))
    assert after == pytest.approx(0 if what == "lock" else -0.5 * before, abs=1e-9)
    mass = plain.solve([[q]], [[0.0]], [[1.0]])["driving_force"][0, 0]
    assert float(run.event_loss[0]) == pytest.approx(mass * (before**2 - after**2) / 2, rel=1e-7)


def test_estimated_errors_of_a_run_that_sticks():
    run = belt().forward(t=np.linspace(0, 2, 21), error=True)
    assert float(run.q_error.max()) < 1e-6 and (run.status == 0).all()
    for scene in (belt(), slope(0.3, 0.5), slide_on_a_stop()):
        run = scene.forward(t=np.linspace(0, 2, 21), error=True)
        for name in ("driving_force_error", "reaction_error", "qdd_error"):
            assert name not in run or float(np.nanmax(np.abs(run[name].values), initial=0)) < 1e-5, name


def slide_on_a_stop() -> linkdyn.Scene:
    return incline(1, clutch=[], stop=[{"name": "s", "joint": "x", "min": -0.2, "restitution": 0}])


def test_members_stick_by_their_reactions():
    scene = slope(0.3, 0.5)
    t = np.linspace(0, 1, 11)
    q, qd = np.zeros((3, 1)), np.array([[0.0], [1.0], [2.5]])
    members = scene.ensemble(q, qd, t, step=1e-3)
    up = 9.81 * (math.sin(0.3) + 0.5 * math.cos(0.3))
    np.testing.assert_allclose(members.q.values[:, -1, 0], qd[:, 0] ** 2 / 2 / up, atol=1e-12)
    sim = scene.simulator()
    sim.reset([0.0], [2.5])
    for _ in range(20):
        sim.step(0.05)
    np.testing.assert_allclose(sim.q, members.q.values[2, -1], rtol=1e-9)
    assert sim.qd[0] == 0


def test_results_of_clutches_are_told_of_what_slips() -> None:
    """Clutches that hold two markers, or bodies that stick, have no joint variable."""
    run = linkdyn.load(Path(__file__).parents[2] / "examples" / "capture" / "scene.toml").forward(t=[0.0, 0.1])
    for name in ("clutch_force", "clutch_slip"):
        assert "joint" not in run[name].attrs["long_name"]


DRIVEN = """
space = "planar"
gravity = [0.0, 0.0]

[frame]
markers = { A = [0.0, 0.0], B = [1.0, 0.0] }

[[link]]
name = "shaft"
markers = { A = [0.0, 0.0] }
mass = 1.0
inertia = 0.5

[[link]]
name = "load"
markers = { B = [0.0, 0.0] }
mass = 1.0
inertia = 2.0

[[joint]]
name = "A"
type = "revolute"
between = ["frame.A", "shaft.A"]

[[joint]]
name = "B"
type = "revolute"
between = ["frame.B", "load.B"]

[[coordinate]]
joint = "A"
driven = true
motion = { law = "constant-rate", start = 0.0, rate = "10 rad/s" }

[[coordinate]]
joint = "B"
start = { position = 0.0, velocity = "2 rad/s" }

[[actuator]]
joint = "A"

[[clutch]]
name = "K"
joint = "A"
to = "B"
from = "0.5 s"

[time]
end = 1.0
samples = 11
"""


@pytest.mark.parametrize("method", ["rk8pd", "gbs", "seulex", "rk4"])
def test_a_drive_works_while_a_clutch_closes(method: str) -> None:
    """The shaft keeps its 10 rad/s, the load comes from 2 to 10 in no time: the clutch takes J s/2, the drive gives J w."""
    run = linkdyn.Scene(DRIVEN).forward(method=method, want="power")
    impulse, slip, speed = 2.0 * (10.0 - 2.0), 10.0 - 2.0, 10.0
    np.testing.assert_allclose(run.event_loss, [impulse * slip / 2], rtol=1e-12)
    np.testing.assert_allclose(run.work[[0, -1]], [0.0, impulse * speed], rtol=1e-12)
    gained = float(run.kinetic_energy[-1] - run.kinetic_energy[0])
    assert gained == pytest.approx(float(run.work[-1] - run.event_loss[0]), rel=1e-12)


TWO_BRAKES: dict[str, Any] = {
    "space": "planar",
    "gravity": [1.9788, -9.81],
    "frame": {"markers": {"A": [0.0, 0.0], "D": [0.3984, 0.0075]}},
    "link": [
        {"name": "a", "markers": {"P": [0, 0], "Q": [0.2666, 0]}, "mass": 1.3564, "cog": [0.1608, -0.0015], "inertia": 0.0139, "start": {"angle": "100 deg"}},
        {"name": "b", "markers": {"P": [0, 0], "Q": [0.3958, 0]}, "mass": 0.5435, "cog": [0.1575, 0.0053], "inertia": 0.0069, "start": {"angle": "0 deg"}},
        {"name": "e", "markers": {"P": [0, 0], "Q": [0.2566, 0]}, "mass": 0.6665, "cog": [0.1403, -0.01], "inertia": 0.0032, "start": {"angle": "80 deg"}},
    ],
    "joint": [
        {"name": "A", "type": "revolute", "between": ["frame.A", "a.P"]},
        {"name": "B", "type": "revolute", "between": ["a.Q", "b.P"]},
        {"name": "C", "type": "revolute", "between": ["b.Q", "e.Q"]},
        {"name": "D", "type": "revolute", "between": ["frame.D", "e.P"]},
    ],
    "coordinate": [{"joint": "A", "start": {"position": "70.48 deg", "velocity": 0.7097}}],
    "clutch": [
        {"name": "kA", "joint": "A", "capacity": 1.7793, "static": 1.0253, "from": 0.3},
        {"name": "kC", "joint": "C", "capacity": 2.0125, "static": 1.2319},
    ],
    "time": {"end": 0.6, "samples": 61},
}


@pytest.mark.parametrize("method", METHODS)
def test_a_brake_closes_where_another_one_holds_all(method: str) -> None:
    """It could not hold alone, and need not: both are told to hold, the first as before, and nothing happens any more."""
    run = linkdyn.Scene(TWO_BRAKES).forward(method=method)
    alone = linkdyn.Scene(TWO_BRAKES | {"clutch": TWO_BRAKES["clutch"][1:]}).forward(method=method)
    assert not run.stopped and np.all(run.status == 0)
    np.testing.assert_allclose(run.q, alone.q, rtol=0, atol=1e-9)
    held = run.time.values > 0.305
    assert np.all(run.clutch_state.values[held] == 2)
    np.testing.assert_allclose(run.clutch_force.values[held], alone.clutch_force.values[held] * [0, 1], rtol=0, atol=1e-9)
    assert 1.0253 * 1.7793 < 2 < run.clutch_force.values[-1, 1] < 1.2319 * 2.0125
    assert [str(name) for name in run.event.values] == ["kC", "kA"]


def test_brakes_that_hold_together_let_go_together() -> None:
    """Two on one mechanism, neither of which would hold the growing load: while the stronger one does the other is spared, then both help."""
    pushed = TWO_BRAKES | {
        "actuator": [{"joint": "A", "law": {"type": "formula", "value": "-20 N m/s*time*step(time-0.3 s)"}}],
        "time": {"end": 1.2, "samples": 121},
    }
    run = linkdyn.Scene(pushed).forward()
    assert not run.stopped and np.all(run.status == 0)
    slips = [float(t) for t, kind in zip(run.event_time.values, run.event_kind.values, strict=True) if str(kind) == "9"]
    weaker = linkdyn.Scene(pushed | {"clutch": pushed["clutch"][1:]}).forward()
    alone = [float(t) for t, kind in zip(weaker.event_time.values, weaker.event_kind.values, strict=True) if str(kind) == "9"]
    assert slips and alone and min(slips) > min(alone)
