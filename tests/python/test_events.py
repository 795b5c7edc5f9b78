"""Events and end stops of forward runs, against closed forms and balances that share no code with the engine."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import xarray as xr

import linkdyn
from integrators import METHODS

EXAMPLES = Path(__file__).parents[2] / "examples"
GRAVITY = 9.81


def slide(mass: float = 2.0, **parts: Any) -> linkdyn.Scene:
    """A mass on a vertical slide "h", its place x and velocity v as measures."""
    axis = {"at": [0, 0], "axis": [0, 1]}
    description: dict[str, Any] = {
        "space": "planar",
        "frame": {"markers": {"O": axis}},
        "link": [{"name": "mass", "markers": {"O": axis}, "mass": mass, "inertia": 1.0}],
        "joint": [{"name": "h", "type": "prismatic", "between": ["frame.O", "mass.O"]}],
        "coordinate": [{"joint": "h", "start": {"position": 1.0, "velocity": 0.0}}],
        "measures": {"x": {"joint": "h"}, "v": {"joint": "h", "rate": True}},
        "time": {"end": 2.0},
    }
    return linkdyn.Scene(description | parts)


def times(run: xr.Dataset, name: str, *kinds: str) -> np.ndarray:
    """Instants of an event, of some kinds only."""
    meanings = run.event_kind.attrs["flag_meanings"].split()
    told = np.array([meanings[kind] for kind in run.event_kind.values])
    chosen = (run.event.values == name) & (np.isin(told, kinds) if kinds else True)
    return run.event_time.values[chosen]


def bounces(n: int, e: float, g: float = GRAVITY, height: float = 1.0) -> tuple[list[Any], list[Any]]:
    """Instants and speeds of the impacts of a ball that is dropped, 30 digits."""
    with mp.workdps(30):
        g, e = mp.mpf(str(g)), mp.mpf(str(e))
        t = [mp.sqrt(2 * height / g)]
        v = [g * t[0]]
        for _ in range(n - 1):
            v.append(e * v[-1])
            t.append(t[-1] + 2 * v[-1] / g)
    return t, v


BALL = {"gravity": [0, -GRAVITY], "stop": [{"name": "floor", "joint": "h", "min": 0, "restitution": 0.8}]}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("n_output", [4, 333])
def test_a_ball_bounces_in_closed_form(method, n_output):
    run = slide(**BALL).forward(method=method, t=np.linspace(0, 2, n_output))
    exact_t, exact_v = bounces(4, 0.8)
    found = times(run, "floor.min", "impact")
    error = 1e-6 if method == "msbdf" else 1e-13  # low order at a tolerance of 1e-9; the others are exact on a parabola
    assert len(found) == 3 and exact_t[3] > 2
    np.testing.assert_allclose(found, [float(t) for t in exact_t[:3]], rtol=0, atol=error)
    np.testing.assert_allclose(run.event_qd.values[:, 0], [-float(v) for v in exact_v[:3]], rtol=10 * error)
    np.testing.assert_allclose(run.event_qd_after.values[:, 0], [float(v) for v in exact_v[1:]], rtol=10 * error)
    np.testing.assert_allclose(run.event_impulse.values, [float(2 * 1.8 * v) for v in exact_v[:3]], rtol=10 * error)
    np.testing.assert_allclose(run.event_loss.values, [float(2 * v**2 * (1 - mp.mpf("0.64")) / 2) for v in exact_v[:3]], rtol=10 * error)
    # Between the impacts, too, wherever output falls.
    before = np.searchsorted(found, run.time.values)
    start = np.concatenate([[0], found])[before]
    place = np.array([1.0, 0, 0, 0])[before]
    speed = np.concatenate([[0], run.event_qd_after.values[:, 0]])[before]
    flown = run.time.values - start
    np.testing.assert_allclose(run.q.values[:, 0], place + speed * flown - GRAVITY * flown**2 / 2, rtol=0, atol=10 * error)


def test_instants_do_not_depend_on_output():
    scene = slide(**BALL)
    found = [scene.forward(t=t).event_time.values for t in (np.linspace(0, 2, 3), np.linspace(0, 2, 1000), [0, 1.17396, 1.17397, 2])]
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


def test_bounces_that_die_out_come_to_rest():
    run = slide(**BALL).forward(t_end=6.0)
    end = float(bounces(2, 0.8)[0][0]) * (1 + 2 * 0.8 / 0.2)  # the sum of all flights
    rest = times(run, "floor.min", "rest")
    assert len(rest) == 1
    # What is left of the flights is a millionth of the first one's, by the rule.
    assert 0 < end - rest[0] < 2e-5
    late = run.sel(time=slice(rest[0], None))
    assert np.abs(late.q).max() < 1e-12 and np.abs(late.qd).max() < 1e-12 and np.abs(late.qdd).max() < 1e-9
    assert float(run.event_loss.sum()) == pytest.approx(2 * GRAVITY * 1.0, rel=1e-11)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9])
@pytest.mark.parametrize("restitution", [0.8, 0.3, 0.0])
def test_no_tolerance_keeps_msbdf_in_a_stop(restitution, tolerance):
    """What looks through its steps for crossings ends elsewhere, by the error of the step: between the two ends the ball was met by the
    floor again and again, in steps of no length."""
    scene = slide(gravity=[0, -GRAVITY], stop=[{"name": "floor", "joint": "h", "min": 0, "restitution": restitution}])
    run = scene.forward(method="msbdf", t=np.linspace(0, 6, 61), rtol=tolerance, atol=tolerance)
    assert not run.status.values.any()
    assert len(times(run, "floor.min", "rest")) == 1
    assert run.q.values.min() > -1e-12 and abs(run.q.values[-1, 0]) < 1e-12


@pytest.mark.parametrize("restitution", [0, 0.5])
@pytest.mark.parametrize("method", ["gbs", "rk4"])
def test_it_leaves_when_the_stop_would_pull(restitution, method):
    # Pressed down by F cos(w t) from the start on: it leaves at a quarter of the period, and is thrown off from there.
    w, force, mass = 3.0, 5.0, 2.0
    scene = slide(
        mass,
        coordinate=[{"joint": "h", "start": 0.25}],
        load=[{"on": "mass.O", "force": [0, "-5 N*cos(3 rad/s*time)"]}],
        stop=[{"name": "floor", "joint": "h", "min": 0.25, "restitution": restitution}],
    )
    run = scene.forward(t_end=1.5, method=method, rtol=1e-11, atol=1e-11)
    leaves = math.pi / 2 / w
    assert times(run, "floor.min", "rest") == [0]
    assert times(run, "floor.min", "release") == pytest.approx([leaves], abs=1e-10)
    t = np.maximum(run.time.values - leaves, 0)
    # x'' = F/m sin(w t) from rest there.
    exact = 0.25 + force / mass * (t / w - np.sin(w * t) / w**2)
    np.testing.assert_allclose(run.q.values[:, 0], exact, rtol=0, atol=1e-9)


@pytest.mark.parametrize("method", ["rk8pd", "gbs", "rkf45"])
def test_no_tolerance_stops_it_at_a_release(method):
    """A gap grows with the third power of time from a release: for long rounding has it on either side of nothing, which is no impact."""
    scene = linkdyn.load(EXAMPLES / "stopped_rocker/scene.toml")
    for tolerance in np.geomspace(1e-8, 1e-5, 25):
        run = scene.forward(method=method, rtol=tolerance, atol=tolerance)
        assert run.attrs["stopped"] == "", tolerance
        assert (run.event_kind.values[run.event_time.values > 1.0] == 3).sum() == 1


def test_between_two_stops():
    # No force between them: each flight takes 1/e of the time of the one before.
    e, width = 0.7, 0.6
    scene = slide(
        coordinate=[{"joint": "h", "start": {"position": 0.0, "velocity": 1.5}}],
        stop=[{"name": "box", "joint": "h", "min": -0.2, "max": 0.4, "restitution": e}],
    )
    run = scene.forward(t_end=8.0)
    flights = [0.4 / 1.5] + [width / (1.5 * e**k) for k in range(1, 6)]
    exact = np.cumsum(flights)
    exact = exact[exact < 8]
    np.testing.assert_allclose(run.event_time.values, exact, rtol=1e-13)
    assert list(run.event.values) == (["box.max", "box.min"] * 5)[: len(exact)]
    np.testing.assert_allclose(run.event_qd_after.values[:, 0], [1.5 * e ** (k + 1) * (-1) ** (k + 1) for k in range(len(exact))], rtol=1e-13)


def pendulum(**parts: Any) -> linkdyn.Scene:
    """A point mass of 1.3 kg on a rod of 0.7 m, angle from straight down."""
    description: dict[str, Any] = {
        "space": "planar",
        "gravity": [0, -GRAVITY],
        "frame": {"markers": {"O": [0, 0]}},
        "link": [{"name": "rod", "markers": {"O": [0, 0]}, "mass": 1.3, "cog": [0, -0.7]}],
        "joint": [{"name": "O", "type": "revolute", "between": ["frame.O", "rod.O"]}],
        "coordinate": [{"joint": "O", "start": 2.0}],
        "measures": {"phi": {"joint": "O"}, "w": {"joint": "O", "rate": True}},
    }
    return linkdyn.Scene(description | parts)


def falls_until(phi: float, start: float = 2.0, length: float = 0.7) -> Any:
    """Time of the pendulum from rest at `start` to `phi`: an elliptic integral, 30 digits."""
    with mp.workdps(30):
        start, phi, w0 = mp.mpf(str(start)), mp.mpf(str(phi)), mp.sqrt(mp.mpf(str(GRAVITY)) / mp.mpf(str(length)))
        k = mp.sin(start / 2)
        at = mp.asin(mp.sin(phi / 2) / k)
        return (mp.ellipk(k**2) - mp.ellipf(at, k**2)) / w0


@pytest.mark.parametrize(("method", "error"), [("rk8pd", 1e-11), ("gbs", 1e-11), ("seulex", 1e-10), ("rkf45", 1e-9), ("rk4", 1e-10), ("msbdf", 1e-6)])
def test_a_pendulum_against_a_wall(method, error):
    scene = pendulum(
        stop=[{"name": "wall", "joint": "O", "min": "-0.4 rad", "restitution": 0.9}],
        event=[{"name": "down", "when": "phi", "direction": "down"}, {"name": "turn", "when": "w", "direction": "up", "do": "note"}],
    )
    run = scene.forward(method=method, t_end=1.2, rtol=1e-12, atol=1e-12, step=2e-4)
    hit = float(falls_until(-0.4))
    assert times(run, "down")[0] == pytest.approx(float(falls_until(0)), abs=error)
    assert times(run, "wall.min") == pytest.approx([hit], abs=error)
    speed = math.sqrt(2 * GRAVITY / 0.7 * (math.cos(0.4) - math.cos(2.0)))
    assert float(run.event_qd.sel(event="wall.min").values[0]) == pytest.approx(-speed, abs=10 * error)
    assert float(run.event_qd_after.sel(event="wall.min").values[0]) == pytest.approx(0.9 * speed, abs=10 * error)
    # The moment's impulse, with the moment of inertia about the hinge.
    assert run.event_impulse.sel(event="wall.min").item() == pytest.approx(1.9 * 1.3 * 0.49 * speed, rel=10 * error)


def test_an_event_ends_the_run_where_it_is():
    scene = pendulum(event=[{"name": "here", "when": "phi - 30 deg", "direction": "down", "do": "stop"}])
    run = scene.forward(t_end=5.0, rtol=1e-12, atol=1e-12)
    assert float(run.time[-1]) == float(run.event_time[-1]) == pytest.approx(float(falls_until(math.pi / 6)), abs=1e-11)
    assert float(run.q[-1, 0]) == pytest.approx(math.pi / 6, abs=1e-14)
    assert np.all(run.status == 0) and np.isfinite(run.qdd).all()
    assert "event 'here'" in run.attrs["stopped"]
    assert list(run.event.values) == ["here"] and run.event_kind.values[0] == 1
    # The same run with estimates of its errors, and without results in between.
    again = scene.forward(t_end=5.0, rtol=1e-12, atol=1e-12, error=True)
    assert float(again.time[-1]) == pytest.approx(float(run.time[-1]), abs=1e-12)
    assert np.isfinite(again.q_error).all()


@pytest.mark.parametrize("method", ["rk8pd", "gbs"])
def test_a_short_visit_within_a_step_is_found(method):
    # Thrown up, above a height for 0.45 ms only, in a step of 0.1 s and more.
    top = 2.0**2 / (2 * GRAVITY)
    scene = slide(
        gravity=[0, -GRAVITY],
        coordinate=[{"joint": "h", "start": {"position": 0, "velocity": 2.0}}],
        event=[{"name": "above", "when": f"x - {top - 2.5e-7!r} m"}],
        time={"end": 0.7},
    )
    run = scene.forward(method=method)
    half = math.sqrt(2 * 2.5e-7 / GRAVITY)
    np.testing.assert_allclose(run.event_time.values, [2 / GRAVITY - half, 2 / GRAVITY + half], rtol=0, atol=1e-9)
    assert list(run.event_direction.values) == [1, -1]


def test_directions_and_simultaneous_events():
    turning = pendulum(event=[
        {"name": "both", "when": "phi"},
        {"name": "up", "when": "phi", "direction": "up"},
        {"name": "down", "when": "2*phi", "direction": "down"},
    ])
    run = turning.forward(t_end=4.0, rtol=1e-11, atol=1e-11)
    assert len(times(run, "up")) > 0 and len(times(run, "down")) > 0
    np.testing.assert_array_equal(np.sort(np.concatenate([times(run, "up"), times(run, "down")])), times(run, "both"))
    quarter = float(falls_until(0))
    np.testing.assert_allclose(times(run, "both"), quarter * np.arange(1, 2 * len(times(run, "both")), 2), rtol=1e-9)


@pytest.mark.parametrize("tolerance", [1e-9, 1e-11])
@pytest.mark.parametrize("method", METHODS)
def test_a_direction_is_the_one_asked_for(method, tolerance):
    """A free flywheel: crossings the other way are passed over and not found once more, nor at the instant of another event."""
    wheel = linkdyn.Scene({
        "space": "planar",
        "frame": {"markers": {"O": [0, 0]}},
        "link": [{"name": "wheel", "mass": 2, "inertia": 0.5, "markers": {"O": [0, 0]}}],
        "joint": [{"name": "J", "type": "revolute", "between": ["frame.O", "wheel.O"]}],
        "coordinate": [{"joint": "J", "start": {"position": 0, "velocity": 30}}],
        "measures": {"phi": {"joint": "J"}},
        "event": [
            {"name": "up", "when": "sin(phi) - 0.2", "direction": "up"},
            {"name": "down", "when": "sin(phi) - 0.2", "direction": "down"},
            {"name": "both", "when": "sin(phi) - 0.2"},
            {"name": "other", "when": "phi - 20 rad"},
        ],
        "time": {"end": 2, "samples": 11},
    })
    run = wheel.forward(method=method, rtol=tolerance, atol=tolerance)
    up, down = ((first + 2 * np.pi * np.arange(10)) / 30 for first in (math.asin(0.2), math.pi - math.asin(0.2)))
    for name, exact in (("up", up), ("down", down), ("both", np.sort(np.concatenate([up, down]))), ("other", [20 / 30])):
        np.testing.assert_allclose(times(run, name), exact, rtol=0, atol=1e-6, err_msg=name)
    for name, sense in (("up", 1), ("down", -1)):
        assert set(run.event_direction.values[run.event.values == name]) == {sense}


def test_a_soft_stop_in_closed_form():
    # It flies onto a spring with a damper at x = 0.3: x'' + 2 d x' + w0^2 x = 0 until the force is none, and flies back.
    mass, k, c, v = 2.0, 800.0, 12.0, 1.5
    scene = slide(
        mass,
        coordinate=[{"joint": "h", "start": {"position": 0.0, "velocity": v}}],
        stop=[{"name": "buffer", "joint": "h", "max": 0.3, "stiffness": k, "damping": c}],
        time={"end": 0.6, "samples": 601},
    )
    run = scene.forward(rtol=1e-12, atol=1e-13, want=["driving_force", "reaction", "power"])
    contact = 0.3 / v
    with mp.workdps(30):
        d, w0 = mp.mpf(c) / (2 * mass), mp.sqrt(mp.mpf(k) / mass)
        w = mp.sqrt(w0**2 - d**2)
        depth = lambda t: v / w * mp.exp(-d * t) * mp.sin(w * t)  # noqa: E731
        free = (mp.pi - mp.atan(c * w / (k - c * d))) / w  # where k depth + c depth' vanishes
        back, deep = mp.diff(depth, free), depth(free)
        gone = contact + free - deep / back
        assert abs(k * deep + c * back) < 1e-12
    assert times(run, "buffer.max", "contact") == pytest.approx([contact], abs=1e-13)
    assert times(run, "buffer.max", "release") == pytest.approx([float(gone)], abs=1e-10)
    assert float(run.event_qd.values[1, 0]) == pytest.approx(float(back), abs=1e-9)
    t = run.time.values
    inside = (t > contact) & (t < contact + float(free))
    np.testing.assert_allclose(run.q.values[inside, 0], [0.3 + float(depth(mp.mpf(x) - mp.mpf(contact))) for x in t[inside]], rtol=0, atol=1e-10)


@pytest.mark.parametrize("turned", [3.3, 9.0, -40.0])
@pytest.mark.parametrize("method", METHODS)
def test_a_soft_stop_behind_turns_is_one_like_others(method, turned):
    """What lanes compute in place of a record, which cannot be told of the turns of a spring, is no jump of a law."""

    def hits(start: float) -> xr.Dataset:
        scene = linkdyn.Scene({
            "space": "planar", "frame": {"markers": {"A": [0, 0]}}, "link": [{"name": "arm", "mass": 1, "inertia": 0.1, "markers": {"A": [0, 0]}}],
            "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "arm.A"]}],
            "coordinate": [{"joint": "A", "start": {"position": start, "velocity": 3}}],
            "stop": [{"name": "s", "joint": "A", "min": start - 0.6, "max": start + 0.6, "stiffness": 1000}],
        })  # fmt: skip
        return scene.forward(method=method, t=np.linspace(0, 1, 11), rtol=1e-10, atol=1e-10)

    run = hits(turned)
    error = 1e-5 if method in ("msbdf", "rk4") else 1e-8
    np.testing.assert_allclose(run.q.values, turned + hits(0.0).q.values, rtol=0, atol=error)
    np.testing.assert_allclose(run.event_time.values, [0.2, 0.2 + math.pi / 100, 0.6 + math.pi / 100, 0.6 + math.pi / 50], rtol=0, atol=error)


def test_rk4_keeps_its_order_at_a_damped_stop():
    """The force jumps where the damper is touched: steps end there, and no stage of them feels the other side. (Where the damper
    lets go the force has a kink, at no event.)"""
    scene = slide(
        gravity=[0, 0],
        coordinate=[{"joint": "h", "start": {"position": 0.0, "velocity": 1.3}}],
        spring=[{"name": "spring", "joint": "h", "stiffness": 30.0}],
        stop=[{"name": "wall", "joint": "h", "min": -0.07, "max": 0.11, "stiffness": 4000.0, "damping": 20.0}],
    )

    def errors(t_end):
        want = scene.forward(t=[0.0, t_end], rtol=1e-12, atol=1e-12).q.values[-1, 0]
        return [abs(scene.forward(t=[0.0, t_end], method="rk4", step=step).q.values[-1, 0] - want) for step in (5e-3, 2.5e-3, 1.25e-3)]

    touched, bounced = errors(0.12), errors(0.5)
    assert touched[0] < 1e-6 and touched[1] < touched[0] / 10 and touched[2] < touched[1] / 10, touched
    assert bounced[0] < 1e-4, bounced


def test_inverse_dynamics_has_the_force_of_a_soft_stop():
    scene = slide(
        gravity=[0, -GRAVITY],
        coordinate=[{"joint": "h", "motion": {"law": "harmonic", "mean": 0.2, "amplitude": 0.2, "frequency": "2 rad/s"}}],
        actuator=[{"joint": "h"}],
        stop=[{"name": "buffer", "joint": "h", "min": 0.1, "max": 0.3, "stiffness": 800.0, "damping": 12.0}],
        time={"end": 3.0, "samples": 301},
    )
    run = scene.inverse()
    x, v, a = run.q.values[:, 0], run.qd.values[:, 0], run.qdd.values[:, 0]
    above = np.where(x > 0.3, np.maximum(800 * (x - 0.3) + 12 * v, 0), 0)
    below = np.where(x < 0.1, np.maximum(800 * (0.1 - x) - 12 * v, 0), 0)
    assert above.max() > 50 and below.max() > 50
    np.testing.assert_allclose(run.driving_force.values[:, 0], 2.0 * (a + GRAVITY) + above - below, rtol=1e-12, atol=1e-12)


SLIDER_CRANK: dict[str, Any] = {
    "space": "planar",
    "gravity": [0, -GRAVITY],
    "frame": {"markers": {"O": [0, 0], "S": {"at": [0, 0], "axis": [1, 0]}}},
    "link": [
        {"name": "crank", "markers": {"O": [0, 0], "A": [0.1, 0]}, "mass": 1.2, "cog": [0.05, 0], "inertia": 0.002},
        {"name": "rod", "markers": {"A": [0, 0], "B": [0.3, 0]}, "mass": 0.8, "cog": [0.12, 0], "inertia": 0.006},
        {"name": "slider", "markers": {"B": {"at": [0, 0], "axis": [1, 0]}}, "mass": 0.5},
    ],
    "joint": [
        {"name": "O", "type": "revolute", "between": ["frame.O", "crank.O"]},
        {"name": "A", "type": "revolute", "between": ["crank.A", "rod.A"]},
        {"name": "B", "type": "revolute", "between": ["rod.B", "slider.B"]},
        {"name": "G", "type": "prismatic", "between": ["frame.S", "slider.B"]},
    ],
    "coordinate": [{"joint": "O", "start": "80 deg"}],
    "stop": [{"name": "end", "joint": "G", "max": 0.37, "restitution": 0.6}],
    "time": {"end": 1.5, "samples": 301},
}


def effective_mass(phi: float) -> float:
    """Of the slider-crank at its slider, from positions alone: kinetic energy at a unit rate of the crank by differences."""
    def places(angle: float) -> list[tuple[float, float, float, float, float]]:
        a = (0.1 * math.cos(angle), 0.1 * math.sin(angle))
        tilt = -math.asin(a[1] / 0.3)
        x = a[0] + 0.3 * math.cos(tilt)
        rod = (a[0] + 0.12 * math.cos(tilt), a[1] + 0.12 * math.sin(tilt))
        return [(1.2, a[0] / 2, a[1] / 2, 0.002, angle), (0.8, *rod, 0.006, tilt), (0.5, x, 0.0, 0.0, 0.0)]

    h = 1e-5
    twice, slider = 0.0, 0.0
    for up, down in zip(places(phi + h), places(phi - h)):
        vx, vy, w = ((up[k] - down[k]) / (2 * h) for k in (1, 2, 4))
        twice += up[0] * (vx**2 + vy**2) + up[3] * w**2
        slider = vx
    return twice / slider**2


@pytest.mark.parametrize("coordinate", ["O", "G"])
def test_a_slider_crank_drops_on_a_stop_of_its_slider(coordinate):
    # The stop is at a joint that is no coordinate, or is: energy goes by what the impacts take, and the impulses are those
    # of the mass that the mechanism has at its slider.
    start = {"O": "80 deg", "G": 0.1 * math.cos(math.radians(80)) + math.sqrt(0.09 - (0.1 * math.sin(math.radians(80))) ** 2)}
    scene = linkdyn.Scene(SLIDER_CRANK | {"coordinate": [{"joint": coordinate, "start": start[coordinate]}]})
    if coordinate == "G":
        scene = scene.with_({"joint.O.start": "80 deg", "joint.A.start": -1.73})
    run = scene.forward(rtol=1e-12, atol=1e-12)
    energy = (run.kinetic_energy + run.potential_energy).values
    lost = np.concatenate([[0], np.cumsum(run.event_loss.values)])
    np.testing.assert_allclose(energy, energy[0] - lost[np.searchsorted(run.event_time.values, run.time.values)], rtol=0, atol=1e-10)
    assert run.event_kind.values[-1] == 5 and np.all(run.event_kind.values[:-1] == 4)
    phi = math.acos((0.37**2 + 0.1**2 - 0.3**2) / (2 * 0.37 * 0.1))
    if coordinate == "O":
        np.testing.assert_allclose(run.event_q.values[:, 0], phi, rtol=1e-10)
    slide_of = run.joint_variable.sel(variable="G.slide")
    assert 0.37 - 1e-9 < float(slide_of.max()) < 0.37 + 1e-9
    # Loss (1 - e^2) m v^2/2 and impulse (1 + e) m v of one mass m, from both.
    speed = run.event_loss.values[:5] * 2 / (1 - 0.36) * 1.6 / run.event_impulse.values[:5]
    np.testing.assert_allclose(run.event_impulse.values[:5] / (1.6 * speed), effective_mass(phi), rtol=1e-8)
    np.testing.assert_allclose(speed[1:], 0.6 * speed[:-1], rtol=1e-8)


def test_an_impact_on_one_of_two_freedoms():
    # A cart with a pendulum runs into a wall: the pendulum's generalized momentum stays, as nothing turns it there.
    cart, bob, length, e = 3.0, 1.1, 0.6, 0.5
    scene = linkdyn.Scene({
        "space": "planar",
        "gravity": [0, -GRAVITY],
        "frame": {"markers": {"O": {"at": [0, 0], "axis": [1, 0]}}},
        "link": [
            {"name": "cart", "markers": {"O": {"at": [0, 0], "axis": [1, 0]}}, "mass": cart, "inertia": 1.0},
            {"name": "rod", "markers": {"O": [0, 0]}, "mass": bob, "cog": [0, -length]},
        ],
        "joint": [
            {"name": "x", "type": "prismatic", "between": ["frame.O", "cart.O"]},
            {"name": "p", "type": "revolute", "between": ["cart.O", "rod.O"]},
        ],
        "coordinate": [{"joint": "x", "start": {"position": 0, "velocity": 1.0}}, {"joint": "p", "start": {"position": 0.9, "velocity": 0.4}}],
        "stop": [{"name": "wall", "joint": "x", "max": 0.25, "restitution": e}, {"name": "inner", "joint": "p", "min": -0.3, "restitution": 0}],
        "time": {"end": 2.0},
    })
    run = scene.forward(rtol=1e-12, atol=1e-12)
    assert {"wall.max", "inner.min"} <= set(run.event.values)
    for k in range(run.sizes["event"]):
        x, p = run.event_q.values[k]
        mass = np.array([[cart + bob, bob * length * math.cos(p)], [bob * length * math.cos(p), bob * length**2]])
        before, after = run.event_qd.values[k], run.event_qd_after.values[k]
        change = mass @ (after - before)
        kind = run.event_kind.values[k]
        if kind == 3:
            assert np.abs(change).max() < 1e-9
            continue
        push = run.event_impulse.values[k]
        expected = [-push, 0] if run.event.values[k] == "wall.max" else [0, push]
        assert change == pytest.approx(expected, abs=1e-11)
        assert run.event_loss.values[k] == pytest.approx((before @ mass @ before - after @ mass @ after) / 2, abs=1e-11)
        if run.event.values[k] == "wall.max":
            assert after[0] == pytest.approx(-e * before[0], rel=1e-11)
        else:
            assert kind == 5 or kind == 4
            assert after[1] == pytest.approx(0, abs=1e-12)


def test_a_resting_joint_keeps_still_while_others_move():
    # The pendulum of a cart that a wind presses against a wall: while the cart rests it is a pendulum on a fixed hinge.
    scene = linkdyn.Scene({
        "space": "planar",
        "gravity": [0, -GRAVITY],
        "frame": {"markers": {"O": {"at": [0, 0], "axis": [1, 0]}}},
        "link": [
            {"name": "cart", "markers": {"O": {"at": [0, 0], "axis": [1, 0]}}, "mass": 3.0, "inertia": 1.0},
            {"name": "rod", "markers": {"O": [0, 0]}, "mass": 1.3, "cog": [0, -0.7]},
        ],
        "joint": [
            {"name": "x", "type": "prismatic", "between": ["frame.O", "cart.O"]},
            {"name": "p", "type": "revolute", "between": ["cart.O", "rod.O"]},
        ],
        "coordinate": [{"joint": "x"}, {"joint": "p", "start": 2.0}],
        "load": [{"on": "cart.O", "force": [80, 0]}],
        "measures": {"p": {"joint": "p"}},
        "event": [{"name": "down", "when": "p", "direction": "down"}],
        "stop": [{"name": "wall", "joint": "x", "max": 0, "restitution": 0}],
    })
    run = scene.forward(t_end=1.5, rtol=1e-12, atol=1e-12)
    assert times(run, "down")[0] == pytest.approx(float(falls_until(0)), abs=1e-10)
    assert np.abs(run.q.values[:, 0]).max() < 1e-12
    np.testing.assert_allclose(run.qdd.values[:, 1], -GRAVITY / 0.7 * np.sin(run.q.values[:, 1]), rtol=0, atol=1e-11)


def test_what_is_driven_through_a_stop_is_told():
    scene = slide(
        coordinate=[{"joint": "h", "driven": True, "motion": {"law": "constant-rate", "rate": -1.0, "start": 0.5}}],
        actuator=[{"joint": "h"}],
        stop=[{"name": "floor", "joint": "h", "min": 0, "restitution": 0.5}],
    )
    try:
        run = scene.forward(t_end=1.0)
    except linkdyn.InputError as error:
        assert "free" in str(error) or "driven" in str(error)  # noqa: PT017 - nothing is free at all
    else:
        assert "what strikes stop 'floor.min' is driven" in run.attrs["stopped"]


def test_a_start_beyond_a_stop_is_refused():
    with pytest.raises(linkdyn.InputError, match=r"stop 'floor\.min': joint 'h' starts 0\.25 beyond it"):
        slide(gravity=[0, -GRAVITY], stop=[{"name": "floor", "joint": "h", "min": 1.25, "restitution": 0.5}]).forward(t_end=0.1)


@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_what_falls_from_its_stop_has_struck_nothing(restitution):
    """A mass that hangs at its upper stop at rest and falls: no impact; with a push upwards it strikes at once."""
    top = {"name": "top", "joint": "h", "max": 1.0, "restitution": restitution}
    run = slide(gravity=[0, -GRAVITY], stop=[top]).forward(t_end=0.3)
    assert len(run.event) == 0
    assert run.q.values[-1, 0] == pytest.approx(1 - GRAVITY * 0.3**2 / 2, abs=1e-12)
    run = slide(gravity=[0, -GRAVITY], stop=[top], coordinate=[{"joint": "h", "start": {"position": 1.0, "velocity": 0.5}}]).forward(t_end=0.3)
    assert times(run, "top.max", "impact").tolist() == [0.0]
    assert run.event_impulse.values == pytest.approx([2.0 * 0.5 * (1 + restitution)])


def test_events_of_time_and_of_laws():
    scene = slide(laws={"wind": "5 N*sin(3 rad/s*time)"}, event=[
        {"name": "clock", "when": "time - 0.3 s"}, {"name": "calm", "when": "wind", "direction": "down"}])
    run = scene.forward(t_end=2.0)
    assert times(run, "clock") == pytest.approx([0.3], abs=5e-15)
    assert times(run, "calm") == pytest.approx([math.pi / 3], abs=5e-15)


def test_a_run_without_events_has_an_empty_table():
    run = slide(event=[{"name": "never", "when": "x + 1 m"}]).forward(t_end=0.1)
    assert run.sizes["event"] == 0


def test_each_member_of_an_ensemble_has_its_own_events():
    scene = slide(**BALL, event=[{"name": "low", "when": "x - 0.05 m", "direction": "down", "do": "stop"}])
    free = slide(**BALL)
    heights = np.linspace(0.2, 1.7, 37)
    q, qd = heights[:, None], np.zeros((37, 1))
    t = np.linspace(0, 0.9, 10)
    ends = scene.ensemble(q, qd, t, step=1e-2)
    exact = np.sqrt(2 * (heights - 0.05) / GRAVITY)
    assert np.all(ends.status == 0)
    np.testing.assert_allclose(ends.good_until, np.minimum(exact, 0.9), rtol=0, atol=1e-13)
    np.testing.assert_array_equal(ends.event_member, np.flatnonzero(exact < 0.9))
    np.testing.assert_allclose(ends.event_time, exact[exact < 0.9], rtol=0, atol=1e-13)
    assert np.isnan(ends.q.values[0, -1, 0]) and np.isfinite(ends.q.values[-1, 2]).all()
    bounce = free.ensemble(q, qd, t, step=1e-2, threads=2)
    for member in (0, 16, 36):
        alone = free.with_({"coordinate.h.start": float(heights[member])}).forward(t=t, method="rk4", step=1e-2)
        mine = bounce.event_member == member
        np.testing.assert_allclose(bounce.event_time[mine], alone.event_time, rtol=0, atol=1e-13)
        np.testing.assert_allclose(bounce.q[member], alone.q, rtol=0, atol=1e-12)
        assert np.all(bounce.event_kind[mine] == alone.event_kind)
    beyond = free.ensemble([[0.5], [-0.1]], np.zeros((2, 1)), t, step=1e-2)
    assert list(beyond.status) == [0, 1] and np.isnan(beyond.q.values[1]).all()


def test_more_events_than_there_is_room_for():
    # 16 a member is what is reckoned with.
    run = slide(event=[{"name": "tick", "when": "sin(100 rad/s*time)"}]).ensemble([[0.0]] * 3, [[0.0]] * 3, [0.0, 3.0])
    assert run.sizes["event"] == 3 * int(300 / math.pi)
    np.testing.assert_allclose(run.event_time[run.event_member == 2], np.arange(1, 96) * math.pi / 100, rtol=0, atol=1e-14)


def test_a_simulator_meets_stops():
    simulator = slide(**BALL, actuator=[{"joint": "h"}]).simulator(method="rk4", step=1e-3)
    exact_t, exact_v = bounces(2, 0.8)
    simulator.step(0.5, [0.0])
    flown = 0.5 - float(exact_t[0])
    assert simulator.q[0] == pytest.approx(float(exact_v[1]) * flown - GRAVITY * flown**2 / 2, abs=1e-12)


def test_a_motion_beyond_a_stop_is_told(tmp_path):
    scene = slide(
        coordinate=[{"joint": "h", "motion": {"law": "harmonic", "mean": 0.2, "amplitude": 0.2, "frequency": "2 rad/s"}}],
        actuator=[{"joint": "h"}],
        stop=[{"name": "end", "joint": "h", "min": 0, "max": 0.35, "restitution": 0.5}],
        time={"end": 3.0, "samples": 301},
    )
    run = scene.inverse()
    beyond = run.q.values[:, 0] > 0.35
    first = float(run.time[int(np.argmax(beyond))])
    assert run.attrs["beyond_stops"] == f"'end.max' of joint 'h' by {beyond.sum()} samples, first at t = {first:.6g} s"
    assert scene.with_({"stop.end.max": 0.4}).inverse().attrs["beyond_stops"] == ""
    np.testing.assert_allclose(run.driving_force.values[:, 0], 2 * run.qdd.values[:, 0], rtol=1e-12, atol=1e-12)


def without_drives(name: str, **parts: Any) -> linkdyn.Scene:
    description = tomllib.loads((EXAMPLES / name / "scene.toml").read_text())
    for actuator in description["actuator"]:
        actuator["law"] = {"type": "constant", "value": 0.0}
    for coordinate in description["coordinate"]:
        coordinate.pop("driven", None)
    return linkdyn.Scene(description | parts)


def test_a_stop_of_a_spatial_loop_takes_what_it_says():
    # At the slide of a cylindrical joint that is no coordinate.
    free = without_drives("rcsp_start").forward(t_end=1.0)
    way = free.joint_variable.sel(variable="C.slide").values
    bound = float(way[0] + 0.4 * (way[np.abs(way - way[0]).argmax()] - way[0]))
    stop = {"name": "S", "joint": "C", "variable": "slide", "max" if bound > way[0] else "min": bound, "restitution": 0.5}
    run = without_drives("rcsp_start", stop=[stop]).forward(t_end=1.0, rtol=1e-10, atol=1e-10)
    energy = (run.kinetic_energy + run.potential_energy).values
    lost = np.concatenate([[0], np.cumsum(run.event_loss.values)])[np.searchsorted(run.event_time.values, run.time.values)]
    assert run.event_kind.values[-1] == 5 and lost[-1] > 1.0
    np.testing.assert_allclose(energy - energy[0], -lost, rtol=0, atol=1e-9)
    assert np.abs(run.joint_variable.sel(variable="C.slide").values - bound).min() < 1e-12


def test_a_stop_within_a_group_closed_by_iteration_holds():
    # The gap of a joint found by iteration is zero to 1e-13 only when the joint has just been thrown back.
    free = without_drives("double_wishbone").forward(t_end=0.2)
    way = free.joint_variable.sel(variable="D.angle").values
    bound = 0.171
    assert way[0] < bound < way.max()
    scene = without_drives("double_wishbone", stop=[{"name": "S", "joint": "D", "max": bound, "restitution": 0.5}])
    runs = [scene.forward(t_end=0.2, rtol=1e-10, atol=1e-10, method=method) for method in ("gbs", "rk4")]
    for run in runs:
        assert float(run.joint_variable.sel(variable="D.angle").max()) < bound + 1e-9
        assert run.event_kind.values[-1] == 5
        assert float(run.event_time[-1]) == pytest.approx(float(runs[0].event_time[-1]), abs=1e-6)
    np.testing.assert_allclose(runs[0].event_impulse[:10], runs[1].event_impulse[:10], rtol=1e-5)


def test_what_a_soft_stop_contributes():
    scene = slide(
        gravity=[0, -GRAVITY],
        coordinate=[{"joint": "h", "motion": {"law": "harmonic", "mean": 0.2, "amplitude": 0.2, "frequency": "2 rad/s"}}],
        actuator=[{"joint": "h"}],
        stop=[{"name": "buffer", "joint": "h", "min": 0.1, "stiffness": 800.0}, {"name": "hard", "joint": "h", "max": 1, "restitution": 0}],
        time={"end": 3.0, "samples": 31},
    )
    run = scene.inverse()
    parts = run.linkdyn.contributions()
    x = run.q.values[:, 0]
    np.testing.assert_allclose(parts.driving_force.sel(cause="stop buffer").values[:, 0], -800 * np.maximum(0.1 - x, 0), atol=1e-10)
