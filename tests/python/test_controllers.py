"""Controllers of a scene: against the matrix exponential, discrete-time computation, small simulations of their own, and inverse dynamics."""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn.cli import executable
from linkdyn.errors import InputError
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SHARP: dict[str, Any] = {"rtol": 1e-11, "atol": 1e-13}
METHODS: list[tuple[str, dict[str, Any], float]] = [
    ("rk4", {"step": 5e-4}, 1e-9), ("rkf45", SHARP, 1e-9), ("rk8pd", SHARP, 1e-10), ("gbs", SHARP, 1e-10), ("seulex", SHARP, 1e-9),
    ("msbdf", {"rtol": 1e-10, "atol": 1e-12}, 1e-6),
]
MASS, DAMPING, STIFFNESS = 2.0, 1.5, 12.0
START = np.array([0.3, -0.2])
PLANT = np.array([[0.0, 1.0], [-STIFFNESS / MASS, -DAMPING / MASS]])


def slider(**controller: Any) -> dict[str, Any]:
    """A mass on a rail with a spring and a damper, and its controller."""
    marker = {"A": {"at": [0.0, 0.0], "axis": [1.0, 0.0]}}
    return {
        "space": "planar",
        "frame": {"markers": marker},
        "link": [{"name": "mass", "mass": MASS, "inertia": 0.01, "markers": marker}],
        "joint": [{"name": "A", "type": "prismatic", "between": ["frame.A", "mass.A"]}],
        "coordinate": [{"joint": "A", "start": {"position": START[0], "velocity": START[1]}}],
        "spring": [{"name": "spring", "joint": "A", "stiffness": STIFFNESS, "damping": DAMPING}],
        "actuator": [{"joint": "A"}],
        "controller": [{"actuator": "A", **controller}],
    }


def arm(gravity: float = 9.81, **tables: Any) -> dict[str, Any]:
    """Two links in a vertical plane, a motor at each joint; `tables` replace those of the scene."""
    return {
        "space": "planar",
        "gravity": [0.0, -gravity],
        "frame": {"markers": {"O": [0.0, 0.0]}},
        "link": [
            {"name": "upper", "mass": 3.0, "inertia": 0.05, "cog": [0.25, 0.0], "markers": {"O": [0.0, 0.0], "E": [0.5, 0.0]}},
            {"name": "lower", "mass": 2.0, "inertia": 0.02, "cog": [0.2, 0.0], "markers": {"E": [0.0, 0.0], "tip": [0.4, 0.0]}},
        ],
        "joint": [
            {"name": "S", "type": "revolute", "between": ["frame.O", "upper.O"]},
            {"name": "E", "type": "revolute", "between": ["upper.E", "lower.E"]},
        ],
        "coordinate": [
            {"joint": "S", "motion": {"law": "harmonic", "mean": 0.4, "amplitude": 0.5, "frequency": "0.7 Hz"}},
            {"joint": "E", "motion": {"law": "harmonic", "mean": -0.8, "amplitude": 0.6, "frequency": "1.1 Hz", "phase": 0.3}},
        ],
        "actuator": [{"joint": "S"}, {"joint": "E"}],
        "time": {"end": 1.5, "samples": 31},
        **tables,
    }


def hold(state: NDArray[Any], force: float, span: float) -> NDArray[Any]:
    """The slider after a time under a constant force."""
    whole = np.zeros((3, 3))
    whole[:2, :2] = PLANT
    whole[1, 2] = 1 / MASS
    return (expm(whole * span) @ [*state, force])[:2]


class Discrete:
    """A sampled controller of the slider, exactly: matrix exponentials between instants at which anything happens."""

    def __init__(self, period: float, delay: float = 0.0, *, target: float = 0.1, kp: float = 0.0, ki: float = 0.0, kd: float = 0.0,
                 filter: float = 0.0, resolution: float = 0.0, output_resolution: float = 0.0, limit: float = np.inf,
                 anti_windup: str = "clamp", tracking_time: float = 1.0, measured_only: bool = False) -> None:
        self.__dict__.update({key: value for key, value in locals().items() if key != "self"})
        self.integral, self.slope, self.last = 0.0, 0.0, None

    def sample(self, place: float) -> tuple[float, float, bool]:
        """Error and output of a sample."""
        if self.resolution:
            place = self.resolution * np.round(place / self.resolution)
        error = self.target - place
        seen = -place if self.measured_only else error
        change = 0.0 if self.last is None else seen - self.last
        self.last = seen
        # T_f d' + d = kd s', backward differences
        self.slope = (self.filter / self.period * self.slope + self.kd * change / self.period) / (1 + self.filter / self.period)
        before = self.integral
        self.integral += self.ki * self.period * error
        asked = self.kp * error + self.integral + self.slope
        output = np.clip(asked, -self.limit, self.limit)
        if output != asked and self.anti_windup == "clamp" and np.sign(asked) == np.sign(self.ki * error):
            self.integral = before
            asked = self.kp * error + before + self.slope
            output = np.clip(asked, -self.limit, self.limit)
        elif output != asked and self.anti_windup == "back-calculation":
            self.integral += (output - asked) * min(1.0, self.period / self.tracking_time)
        limited = bool(output != asked)
        if self.output_resolution:
            output = self.output_resolution * np.round(output / self.output_resolution)
        return error, output, limited

    def run(self, instants: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """States, errors and outputs at instants, behind what happens there."""
        states, errors, outputs = [], [], []
        state, t, force, error = START.copy(), 0.0, 0.0, 0.0
        k, waiting = 0, []
        for instant in instants:
            while True:
                happens = min([k * self.period, *(when for when, _ in waiting)])
                if happens > instant + 1e-12:
                    break
                state, t = hold(state, force, happens - t), happens
                if k * self.period <= t + 1e-12:
                    error, output, _ = self.sample(state[0])
                    waiting.append((k * self.period + self.delay, output))
                    k += 1
                while waiting and waiting[0][0] <= t + 1e-12:
                    force = waiting.pop(0)[1]
            states.append(hold(state, force, instant - t))
            errors.append(error)
            outputs.append(force)
        return np.array(states), np.array(errors), np.array(outputs)


# ---------------------------------------------------------------- continuous


@pytest.mark.parametrize(("method", "accuracy", "bound"), METHODS)
@pytest.mark.parametrize("ki", [0.0, 60.0])
def test_continuous_pid(ki: float, method: str, accuracy: dict[str, Any], bound: float) -> None:
    """Position, speed and the integral of the error are linear: a matrix exponential."""
    kp, kd, target = 80.0, 9.0, 0.1
    gains = {"kp": kp, "kd": kd} | ({"ki": ki} if ki else {})
    t = np.linspace(0, 3, 31)
    run = linkdyn.Scene(slider(target=target, **gains)).forward(t=t, method=method, want="all", **accuracy)
    closed = np.zeros((4, 4))
    closed[:2, :2] = PLANT - np.array([[0.0, 0.0], [kp, kd]]) / MASS
    closed[1, 2:] = 1 / MASS, kp * target / MASS
    closed[2, [0, 3]] = -ki, ki * target
    exact = np.array([expm(closed * instant) @ [*START, 0.0, 1.0] for instant in t])
    assert np.abs(run.q.values[:, 0] - exact[:, 0]).max() < bound
    assert np.abs(run.qd.values[:, 0] - exact[:, 1]).max() < 10 * bound
    output = kp * (target - exact[:, 0]) - kd * exact[:, 1] + exact[:, 2]
    assert np.abs(run.controller_output.values[:, 0] - output).max() < 100 * bound
    np.testing.assert_array_equal(run.driving_force.values, run.controller_output.values)
    np.testing.assert_allclose(run.controller_error.values[:, 0], target - run.q.values[:, 0], atol=1e-15)
    np.testing.assert_array_equal(run.controller_target.values, target)
    assert not run.controller_limited.any()
    assert np.abs(run.power_imbalance).max() < 1e-12


def test_continuous_pid_with_filter_and_moving_target() -> None:
    """What a filter makes of the D part, and a target by a law of time with its rate."""
    kp, ki, kd, lag, speed = 80.0, 40.0, 6.0, 0.02, 5.0
    law = {"law": "harmonic", "mean": 0.1, "amplitude": 0.05, "frequency": speed}
    t = np.linspace(0, 2, 21)
    run = linkdyn.Scene(slider(target=law, kp=kp, ki=ki, kd=kd, filter=lag)).forward(t=t, **SHARP)

    def rates(instant: float, y: NDArray[Any]) -> list[float]:
        error = 0.1 + 0.05 * np.sin(speed * instant) - y[0]
        error_rate = 0.05 * speed * np.cos(speed * instant) - y[1]
        force = kp * error + y[2] + y[3]
        return [y[1], (force - STIFFNESS * y[0] - DAMPING * y[1]) / MASS, ki * error, (kd * error_rate - y[3]) / lag]

    own = solve_ivp(rates, (0, 2), [*START, 0.0, 0.0], method="DOP853", t_eval=t, rtol=1e-12, atol=1e-14).y
    assert np.abs(run.q.values[:, 0] - own[0]).max() < 1e-9
    assert np.abs(run.qd.values[:, 0] - own[1]).max() < 1e-8


def test_what_is_controlled() -> None:
    """The actuator's own joint, the coordinate, a measure of a marker: one motion. A formula for a target damps the measured value."""
    gains = {"kp": 80.0, "kd": 9.0}
    t = np.linspace(0, 1, 11)
    own = linkdyn.Scene(slider(target=0.1, **gains)).forward(t=t)
    for other in ({"joint": "A"}, {"coordinate": "A"}, {"measure": "x"}):
        scene = slider(target=0.1, **gains, **other) | {"measures": {"x": {"marker": "mass.A", "component": "x"}}}
        assert np.abs(linkdyn.Scene(scene).forward(t=t).q - own.q).max() < 1e-9
    scene = slider(target="0.1 m + 0*time*(1 m/s)", damps="measured", **gains)
    assert np.abs(linkdyn.Scene(scene).forward(t=t).q - own.q).max() < 1e-9


def test_speed_control() -> None:
    """PI on a rate: exponential approach."""
    scene = slider(measure="v", target=0.4, kp=30.0, ki=200.0) | {"measures": {"v": {"joint": "A", "rate": True}}, "spring": []}
    t = np.linspace(0, 1, 21)
    run = linkdyn.Scene(scene).forward(t=t, **SHARP)
    closed = np.array([[-30 / MASS, 1 / MASS, 30 * 0.4 / MASS], [-200.0, 0.0, 200 * 0.4], [0.0, 0.0, 0.0]])
    exact = [(expm(closed * instant) @ [START[1], 0.0, 1.0])[0] for instant in t]
    assert np.abs(run.qd.values[:, 0] - exact).max() < 1e-9
    assert run.controller_unit.values.tolist() == ["m/s"]


@pytest.mark.parametrize("bend", [(-0.8, 2.6), (0.3, 3.5)])
def test_angle_that_is_no_coordinate(bend: tuple[float, float]) -> None:
    """A four-bar whose coupler angle is controlled: its error is that of the shortest way."""
    data = tomllib.loads((EXAMPLES / "fourbar_constant_torque" / "scene.toml").read_text())
    data["actuator"] = [{"joint": data["actuator"][0]["joint"]}]
    other = next(joint["name"] for joint in data["joint"] if joint["type"] == "revolute" and joint["name"] != data["actuator"][0]["joint"])
    data["controller"] = [{"actuator": data["actuator"][0]["joint"], "joint": other, "target": bend[0], "kp": 5.0, "kd": 0.5}]
    t = np.linspace(0, 0.05, 6)
    one = linkdyn.Scene(data).forward(t=t)
    data["controller"][0]["target"] = bend[0] + 2 * np.pi
    two = linkdyn.Scene(data).forward(t=t)
    assert (np.abs(one.controller_error) <= np.pi).all()
    assert np.abs(one.q - two.q).max() < 1e-9


# ---------------------------------------------------------------- sampled


@pytest.mark.parametrize(("method", "accuracy", "bound"), METHODS)
@pytest.mark.parametrize("delay", [{}, {"delay_samples": 2}, {"delay": "3.7 ms"}, {"delay": "12.5 ms"}])
def test_sampled_pd(delay: dict[str, Any], method: str, accuracy: dict[str, Any], bound: float) -> None:
    """Zero-order hold, whole and broken delays: exact between instants."""
    scene = linkdyn.Scene(slider(target=0.1, kp=80.0, kd=9.0, rate="100 Hz", **delay))
    t = np.concatenate((np.arange(0, 0.4, 0.01), np.arange(0.4, 0.5, 0.0013)))
    run = scene.forward(t=t, method=method, **accuracy)
    late = {"delay_samples": 0.02}.get(next(iter(delay), ""), float(str(delay.get("delay", "0 ms")).split()[0]) / 1000)
    state, error, output = Discrete(0.01, late, kp=80.0, kd=9.0).run(t)
    assert np.abs(run.q.values[:, 0] - state[:, 0]).max() < bound
    assert np.abs(run.qd.values[:, 0] - state[:, 1]).max() < 10 * bound
    assert np.abs(run.controller_error.values[:, 0] - error).max() < bound
    assert np.abs(run.controller_output.values[:, 0] - output).max() < 2e4 * bound
    np.testing.assert_array_equal(run.driving_force.values, run.controller_output.values)


@pytest.mark.parametrize("options", [
    {"kp": 60.0, "ki": 300.0, "kd": 5.0, "filter": 0.02},
    {"kp": 60.0, "kd": 5.0, "resolution": 1e-4},
    {"kp": 60.0, "ki": 20.0, "kd": 5.0, "resolution": 2e-4, "output_resolution": 0.25},
    {"kp": 60.0, "ki": 300.0, "kd": 5.0, "damps": "measured", "limit": 6.0},
    {"kp": 60.0, "ki": 300.0, "limit": 4.0, "anti_windup": "back-calculation", "tracking_time": 0.05},
    {"kp": 60.0, "ki": 300.0, "limit": 4.0, "anti_windup": "none"},
])
def test_sampled_pid(options: dict[str, Any]) -> None:
    """Filter, quantisation, limits and what becomes of the integral there."""
    t = np.arange(0, 1.0, 0.0025)
    run = linkdyn.Scene(slider(target=0.15, rate="200/s", delay_samples=1, **options)).forward(t=t, **SHARP)
    own = {key: value for key, value in options.items() if key != "damps"}
    discrete = Discrete(0.005, 0.005, target=0.15, measured_only="damps" in options, **own)
    state, error, output = discrete.run(t)
    assert np.abs(run.q.values[:, 0] - state[:, 0]).max() < 1e-9
    assert np.abs(run.controller_error.values[:, 0] - error).max() < 1e-9
    assert np.abs(run.controller_output.values[:, 0] - output).max() < 1e-6
    if "limit" in options:
        limited = run.controller_limited.values[:, 0] == 1
        assert limited.any()
        np.testing.assert_array_equal(limited, np.abs(output) == options["limit"])


def test_rates_in_all_their_words() -> None:
    t = np.linspace(0, 0.1, 11)
    runs = [linkdyn.Scene(slider(target=0.1, kp=80.0, kd=9.0, rate=rate)).forward(t=t) for rate in ("1 kHz", "1000 Hz", "1000/s", 1000, "60000 rpm")]
    for run in runs[1:]:
        np.testing.assert_array_equal(run.q.values, runs[0].q.values)


def test_outputs_change_nothing() -> None:
    """Instants of output do not change the way, nor do pauses."""
    scene = linkdyn.Scene(slider(target=0.1, kp=80.0, ki=100.0, kd=9.0, rate="130 Hz", delay="3 ms", limit=6.0))
    few, many = scene.forward(t=[0.0, 0.5, 1.0]), scene.forward(t=np.linspace(0, 1, 1001))
    np.testing.assert_array_equal(few.q.values, many.q.values[::500])
    np.testing.assert_array_equal(few.controller_output.values, many.controller_output.values[::500])


# ---------------------------------------------------------------- limits of continuous ones


@pytest.mark.parametrize(("windup", "time"), [("back-calculation", 0.08), ("back-calculation", None), ("none", None)])
def test_continuous_limits(windup: str, time: float | None) -> None:
    """Against an integration of its own, in which the limit is a clip."""
    kp, ki, kd, limit = 100.0, 400.0, 8.0, 5.0
    extra = {} if time is None else {"tracking_time": time}
    t = np.linspace(0, 2, 201)
    run = linkdyn.Scene(slider(target=0.25, kp=kp, ki=ki, kd=kd, limit=limit, anti_windup=windup, **extra)).forward(t=t, **SHARP)
    back = 0.0 if windup == "none" else 1 / (time or np.sqrt(kd / ki))

    def asked(y: NDArray[Any]) -> Any:
        return kp * (0.25 - y[0]) + y[2] - kd * y[1]

    def rates(_: float, y: NDArray[Any]) -> list[float]:
        wanted = asked(y)
        force = np.clip(wanted, -limit, limit)
        return [y[1], (force - STIFFNESS * y[0] - DAMPING * y[1]) / MASS, ki * (0.25 - y[0]) + back * (force - wanted)]

    own = solve_ivp(rates, (0, 2), [*START, 0.0], method="DOP853", t_eval=t, rtol=1e-11, atol=1e-13, max_step=1e-3).y
    assert np.abs(run.q.values[:, 0] - own[0]).max() < 1e-7
    np.testing.assert_allclose(run.controller_output.values[:, 0], np.clip(asked(own), -limit, limit), atol=1e-5)
    limited = run.controller_limited.values[:, 0] == 1
    assert limited.any() and not limited.all()
    assert np.abs(run.power_imbalance).max() < 1e-11


def test_windup_is_worse_than_none() -> None:
    """An integral that goes on at the limit overshoots."""
    t = np.linspace(0, 4, 401)
    above = {}
    for windup in ("none", "back-calculation"):
        scene = slider(target=0.35, kp=40.0, ki=60.0, kd=8.0, limit=5.0, anti_windup=windup)
        above[windup] = float(linkdyn.Scene(scene).forward(t=t).q.max()) - 0.35
    assert above["back-calculation"] < above["none"] / 2


# ---------------------------------------------------------------- feed-forward


@pytest.mark.parametrize("method", ["rk8pd", "gbs", "seulex", "rk4"])
def test_computed_torque_follows_its_target(method: str) -> None:
    """Inverse dynamics of the motion ahead: nothing is left to correct."""
    law = {"target": "motion", "kp": 200.0, "ki": 300.0, "kd": 20.0, "feed_forward": "inverse"}
    scene = linkdyn.Scene(arm(controller=[{"actuator": "S", **law}, {"actuator": "E", **law}]))
    accuracy = {"step": 1e-4} if method == "rk4" else SHARP
    run = scene.forward(method=method, want="all", **accuracy)
    assert np.abs(run.controller_error).max() < 1e-10
    inverse = scene.inverse()
    np.testing.assert_allclose(run.driving_force.values, inverse.driving_force.values, atol=1e-7)
    assert np.abs(run.power_imbalance).max() < 1e-11


@pytest.mark.parametrize("rate", [{}, {"rate": "20 kHz"}])
def test_computed_torque_knows_what_gears_lose(rate: dict[str, Any]) -> None:
    """n T = F + R, R = c |F'| tanh(n s'/w0) with c by the direction of power: with that ahead nothing is left to correct."""
    n, rotor, eta, back, creep = 40.0, 2e-5, 0.6, 0.45, 0.5
    drive = {"ratio": n, "rotor_inertia": rotor, "efficiency": eta, "back_efficiency": back, "creep_speed": creep}
    law = {"at": "motor", "target": "motion", "kp": 8.0, "kd": 0.6, "feed_forward": "inverse", **rate}
    lossy = arm(actuator=[{"joint": joint, "drive": drive} for joint in "SE"], controller=[{"actuator": joint, **law} for joint in "SE"])
    scene = linkdyn.Scene(lossy | {"time": {"end": 0.6, "samples": 31}})
    run = scene.forward(want="all", method="gbs", rtol=1e-10, atol=1e-12)
    within = 1e-9 if not rate else 2e-4
    assert np.abs(run.controller_error).max() < within
    force = scene.inverse(t=run.time.values).driving_force.values
    t = run.time.values[:, None]
    amplitude, frequency, phase = np.array([0.5, 0.6]), 2 * np.pi * np.array([0.7, 1.1]), np.array([0, 0.3])
    speed = amplitude * frequency * np.cos(frequency * t + phase)
    sent = force + n**2 * rotor * amplitude * frequency**2 * np.sin(frequency * t + phase)
    lost = np.where(sent * speed > 0, 1 / eta - 1, 1 - back) * np.abs(sent) * np.tanh(n * speed / creep)
    torque = (force + lost) / n
    assert np.abs(lost).max() > 0.3 * np.abs(force).max() and (sent * speed > 0).any() and (sent * speed < 0).any()
    if not rate:
        np.testing.assert_allclose(run.controller_output.values, torque, rtol=0, atol=1e-6)


def test_gravity_holds() -> None:
    """Gravity alone ahead of a PD: the arm comes to rest at its target, which a PD alone does not reach; the output there is that of statics."""
    tables = {
        "coordinate": [{"joint": "S", "start": 0.2}, {"joint": "E", "start": -0.3}],
        "spring": [{"name": "counterbalance", "joint": "S", "stiffness": 8.0, "rest": 1.5}],
    }
    ends = {}
    for feed in (None, "gravity"):
        law = {"kp": 120.0, "kd": 25.0} | ({"feed_forward": feed} if feed else {})
        scene = linkdyn.Scene(arm(**tables, controller=[{"actuator": "S", "target": 0.7, **law}, {"actuator": "E", "target": -1.0, **law}]))
        ends[feed] = scene.forward(t=[0.0, 10.0, 20.0])
    assert np.abs(ends["gravity"].controller_error[-1]).max() < 1e-9
    assert np.abs(ends[None].controller_error[-1]).max() > 0.01
    static = linkdyn.Scene(arm(**tables)).inverse(q=[[0.7, -1.0]], qd=[[0.0, 0.0]], qdd=[[0.0, 0.0]])
    np.testing.assert_allclose(ends["gravity"].controller_output.values[-1], static.driving_force.values[0], rtol=1e-7)


def test_feed_forward_by_formula_and_law() -> None:
    """A spring's force taken off by a formula of the state; a constant one by a number."""
    t = np.linspace(0, 1, 11)
    free = slider(target=0.1, kp=80.0, kd=9.0)
    free["spring"][0]["stiffness"] = 0.0
    scene = slider(target=0.1, kp=80.0, kd=9.0, feed_forward=f"{STIFFNESS} N/m*x") | {"measures": {"x": {"joint": "A"}}}
    assert np.abs(linkdyn.Scene(scene).forward(t=t, **SHARP).q - linkdyn.Scene(free).forward(t=t, **SHARP).q).max() < 1e-9
    end = linkdyn.Scene(slider(target=0.1, kp=80.0, kd=9.0, feed_forward="1.2 N")).forward(t=[0.0, 20.0])
    assert float(end.q[-1, 0]) == pytest.approx(0.1, abs=1e-9)


# ---------------------------------------------------------------- at motors, records, ensembles, simulators


def test_at_the_motor() -> None:
    """The output is the motor's torque, or voltage; limits of the motor cut it off besides."""
    drive = {"ratio": 20.0, "rotor_inertia": 1e-3, "efficiency": 0.9, "torque_constant": 0.5, "resistance": 2.0}
    t = np.linspace(0, 0.5, 51)
    scene = arm(actuator=[{"joint": "S", "drive": drive}, {"joint": "E", "drive": drive}],
                controller=[{"actuator": name, "at": "motor", "target": "motion", "kp": 40.0, "kd": 2.0, "rate": "2 kHz"} for name in ("S", "E")])
    run = linkdyn.Scene(scene).forward(t=t, want="all")
    np.testing.assert_allclose(run.motor_torque.values, run.controller_output.values, rtol=1e-7, atol=1e-9)
    assert np.abs(run.power_imbalance).max() < 1e-10
    for table in scene["controller"]:
        table |= {"at": "terminals", "kp": 400.0, "kd": 20.0}
    run = linkdyn.Scene(scene).forward(t=t, want="all")
    torque = 0.5 * (run.controller_output.values - 0.5 * run.motor_speed.values) / 2
    np.testing.assert_allclose(run.motor_torque.values, torque, rtol=1e-7, atol=1e-7)
    assert run.attrs["stopped"] == ""


@pytest.mark.parametrize("rate", [{}, {"rate": "150 Hz", "delay": "4 ms"}])
def test_ensemble(rate: dict[str, Any]) -> None:
    """Each member has controllers of its own."""
    law = {"kp": 60.0, "ki": 200.0, "kd": 5.0, "limit": 9.0, **rate}
    scene = linkdyn.Scene(slider(target=0.1, **law))
    rng = np.random.default_rng(5)
    q, qd = rng.uniform(-0.3, 0.5, (37, 1)), rng.uniform(-0.5, 0.5, (37, 1))
    t = np.linspace(0, 1, 6)
    members = scene.ensemble(q, qd, t=t, step=1e-3)
    for k in (0, 3, 20, 36):
        data = slider(target=0.1, **law)
        data["coordinate"][0]["start"] = {"position": q[k, 0], "velocity": qd[k, 0]}
        one = linkdyn.Scene(data).forward(t=t, **SHARP)
        assert np.abs(members.q.values[k, :, 0] - one.q.values[:, 0]).max() < 1e-6


def test_simulator() -> None:
    """Controllers act in a simulator, whose forces come on top; a reset begins anew."""
    law = {"target": 0.1, "kp": 80.0, "ki": 100.0, "kd": 9.0, "rate": "300 Hz", "delay": "2 ms"}
    t = np.linspace(0, 0.4, 81)
    scene = linkdyn.Scene(slider(**law))
    run = scene.forward(t=t)
    with scene.simulator() as simulator:
        for _ in range(2):
            for k in range(1, len(t)):
                simulator.step(0.005)
                assert simulator.q[0] == pytest.approx(run.q.values[k, 0], abs=1e-8)
            simulator.reset()
    pushed = linkdyn.Scene(slider(**law, feed_forward=3.0)).forward(t=t)
    with linkdyn.Scene(slider(**(law | {"delay": 0}))).simulator() as simulator:
        simulator.step(0.4, [3.0])
        ahead = linkdyn.Scene(slider(**(law | {"delay": 0}), feed_forward=3.0)).forward(t=t)
        assert simulator.q[0] == pytest.approx(ahead.q.values[-1, 0], abs=1e-8)
        assert abs(simulator.q[0] - pushed.q.values[-1, 0]) > 1e-9


@pytest.mark.parametrize("rate", [{}, {"rate": "2 kHz"}])
def test_hexapod_legs_follow_the_platform(rate: dict[str, Any]) -> None:
    """Legs whose lengths are no coordinates follow the motion of the platform."""
    data = tomllib.loads((EXAMPLES / "stewart_drilling" / "scene.toml").read_text())
    names = linkdyn.Scene(data, folder=EXAMPLES / "stewart_drilling").actuators
    data["controller"] = [{"actuator": name, "target": "motion", "kp": "2e6 N/m", "kd": "4e4 N*s/m", "feed_forward": "inverse", **rate} for name in names]
    t = np.linspace(0, 0.2, 6)
    run = linkdyn.Scene(data, folder=EXAMPLES / "stewart_drilling").forward(t=t, rtol=1e-9)
    assert run.attrs["stopped"] == ""
    assert np.abs(run.controller_error).max() < (1e-5 if rate else 1e-9)


@pytest.mark.parametrize("rate", [{}, {"rate": "130 Hz", "delay_samples": 2}])
def test_through_dead_points(rate: dict[str, Any]) -> None:
    """A crank led by its piston's slide goes on in another coordinate at the dead point, and its controller with it: as the crank led by its own angle."""
    crank, rod, start = 0.1, 0.3, 1.0
    data: dict[str, Any] = {
        "space": "planar",
        "frame": {"markers": {"A": [0, 0], "guide": {"at": [0, 0], "axis": [1, 0]}}},
        "link": [
            {"name": "crank", "markers": {"A": [0, 0], "B": [crank, 0]}, "mass": 2.0, "inertia": 0.02},
            {"name": "rod", "markers": {"B": [0, 0], "C": [rod, 0]}, "mass": 1.0, "cog": [0.15, 0], "inertia": 0.01},
            {"name": "piston", "markers": {"C": {"at": [0, 0], "axis": [1, 0]}}, "mass": 1.5, "inertia": 0.001},
        ],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"], "start": start},
            {"name": "B", "type": "revolute", "between": ["crank.B", "rod.B"]},
            {"name": "C", "type": "revolute", "between": ["rod.C", "piston.C"]},
            {"name": "guide", "type": "prismatic", "between": ["frame.guide", "piston.C"], "start": 0.3},
        ],
        "measures": {"w": {"joint": "A", "rate": True}},
        "actuator": [{"joint": "A"}],
        "controller": [{"actuator": "A", "measure": "w", "target": 9.0, "kp": 0.3, "ki": 2.0, "feed_forward": "gravity", **rate}],
    }
    slide = crank * np.cos(start) + np.sqrt(rod**2 - (crank * np.sin(start)) ** 2)
    t = np.linspace(0, 1.5, 31)
    by_angle = linkdyn.Scene(data | {"coordinate": [{"joint": "A", "start": start}]}).forward(t=t, **SHARP)
    by_slide = linkdyn.Scene(data | {"coordinate": [{"joint": "guide", "start": slide}]}).forward(t=t, want="all", **SHARP)
    assert "then" in by_slide.attrs["coordinates_integrated"] and by_slide.attrs["stopped"] == ""
    assert np.abs(by_slide.controller_output - by_angle.controller_output).max() < 1e-6
    assert np.abs(by_slide.controller_error - by_angle.controller_error).max() < 1e-6
    assert np.abs(by_slide.power_imbalance).max() < 1e-9


def test_names_and_wishes() -> None:
    scene = linkdyn.Scene(slider(target=0.1, kp=80.0, name="axis"))
    run = scene.forward(t=[0.0, 0.1], want="controller")
    assert run.controller.values.tolist() == ["axis"] == list(scene.controllers)
    told = linkdyn.load(EXAMPLES.parent / "tests" / "scenes" / "controlled_arm.toml").explain()
    assert re.search(r"shoulder +PID \[N m over rad\] at S, continuous, at least -60 N m, at most 60 N m, gravity ahead", told), told
    assert re.search(r"elbow +PD \[N m over rad\] at E, its motor, a sample every 0.001 s, 0.001 s late, inverse dynamics ahead", told), told
    assert {"controller_target", "controller_error", "controller_output", "controller_limited"} <= set(run.data_vars)
    assert "controller_output" not in scene.forward(t=[0.0, 0.1], want="driving_force")
    assert run.controller_output.attrs["units"] == "N"
    plain = slider(target=0.1, kp=80.0)
    del plain["controller"]
    with pytest.raises(InputError, match="the scene has no controller"):
        linkdyn.Scene(plain).forward(t=[0.0, 0.1], want="controller")


@pytest.mark.parametrize(("method", "accuracy", "bound"), METHODS)
def test_beside_events_and_stops(method: str, accuracy: dict[str, Any], bound: float) -> None:
    """What a run looks out for changes nothing in its samples; an impact between two of them does what the discrete system says."""
    law = {"target": 0.4, "kp": 80.0, "kd": 9.0, "rate": "100 Hz", "delay_samples": 1}
    stop = {"stop": [{"name": "end", "joint": "A", "max": 0.3001, "restitution": 0.5}]}
    watched = {"measures": {"x": {"joint": "A"}}, "event": [{"name": "passed", "when": "x - 0.25 m"}]}
    t = np.linspace(0, 0.5, 26)
    plain = linkdyn.Scene(slider(**law)).forward(t=t, method=method, **accuracy)
    run = linkdyn.Scene(slider(**law) | watched).forward(t=t, method=method, **accuracy)
    assert np.abs(run.q - plain.q).max() < 10 * bound
    run = linkdyn.Scene(slider(**law) | stop).forward(t=t, method=method, **accuracy)
    assert run.attrs["stopped"] == ""
    first = float(run.event_time[0])
    # the discrete system up to the impact, thrown back there, and on to the next instants
    exact = Discrete(0.01, 0.01, target=0.4, kp=80.0, kd=9.0).run(np.array([first]))[0][0]
    assert exact[0] == pytest.approx(0.3001, abs=10 * bound)
    assert float(run.event_qd_after[0, 0]) == pytest.approx(-0.5 * exact[1], abs=100 * bound)


@pytest.mark.parametrize("rate", [{}, {"rate": "200 Hz", "delay_samples": 1}])
def test_estimated_errors(rate: dict[str, Any]) -> None:
    """Companion runs of other size have the same controllers."""
    data = arm(controller=[{"actuator": name, "target": "motion", "kp": 60.0, "ki": 40.0, "kd": 6.0, "limit": 30.0, "feed_forward": feed, **rate}
                           for name, feed in (("S", "gravity"), ("E", "inverse"))])
    data["coordinate"][0]["start"] = 0.2
    t = np.linspace(0, 0.5, 6)
    coarse = linkdyn.Scene(data).forward(t=t, error=True, rtol=1e-7, atol=1e-7)
    fine = linkdyn.Scene(data).forward(t=t, **SHARP)
    actual = np.abs(coarse.q - fine.q).max()
    assert coarse.q_error.max() < 1e-4
    assert actual < 10 * coarse.q_error.max() + 1e-12


def test_gravity_is_that_of_the_place_alone() -> None:
    """Whatever the velocity and the loads, ahead is what statics of the place ask for, payloads and springs with it; in space too."""
    tables = {
        "coordinate": [{"joint": "S", "start": {"position": 0.2, "velocity": 3.0}}, {"joint": "E", "start": {"position": -0.3, "velocity": -5.0}}],
        "spring": [{"name": "counterbalance", "joint": "S", "stiffness": 8.0, "damping": 2.0, "rest": 1.5}],
        "payload": [{"on": "lower.tip", "mass": 1.5}],
    }
    law = {"target": 0.0, "kp": 1e-12, "feed_forward": "gravity"}
    control = [{"actuator": "S", **law}, {"actuator": "E", **law}]
    run = linkdyn.Scene(arm(**tables, controller=control, load=[{"on": "lower.tip", "force": [30.0, -70.0]}])).forward(t=[0.0, 1e-3])
    static = linkdyn.Scene(arm(**tables)).inverse(q=[[0.2, -0.3]], qd=[[0.0, 0.0]], qdd=[[0.0, 0.0]])
    np.testing.assert_allclose(run.controller_output.values[0], static.driving_force.values[0], rtol=1e-9)
    data = tomllib.loads((EXAMPLES / "stewart_forward" / "scene.toml").read_text())
    for table in data["actuator"]:
        del table["law"]
    still = linkdyn.Scene(data)
    start = still.forward(t=[0.0, 1e-6])
    data["controller"] = [
        {"actuator": name, "target": float(start.joint_variable.sel(variable=f"{name}.slide")[0]), "kp": 2000.0, "kd": 60.0, "feed_forward": "gravity",
         "rate": "1 kHz"} for name in still.actuators
    ]
    run = linkdyn.Scene(data).forward(t=[0.0, 0.25, 0.5])
    assert np.abs(run.controller_error).max() < 1e-12


def test_told_on_the_command_line(tmp_path: Path) -> None:
    """The summary names controllers at their limits; a run that they make too stiff names them."""
    scene = linkdyn.Scene(slider(target=0.4, kp=80.0, kd=9.0, limit=4.0, name="axis") | {"time": {"end": 1.0}})
    (tmp_path / "scene.toml").write_text(scene.text)
    told = subprocess.run([executable(), "forward", "scene.toml"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert re.search(r"^  at their limits  controller 'axis' in \d+ samples, first at t = 0", told, re.M), told
    stiff = linkdyn.Scene(slider(target=0.4, kp=1e25, kd=1e20, name="axis")).forward(t=[0.0, 1.0])
    assert "controller 'axis' is too stiff" in stiff.attrs["stopped"]


def test_changes_by_path() -> None:
    """By the name, or that of the actuator, whatever variable is measured."""
    data = slider(target=0.1, kp=80.0, joint="A", variable="slide")
    other = linkdyn.Scene(data).with_({"controller.A.kp": 40.0}).forward(t=[0.0, 0.1])
    assert float(other.controller_output[0, 0]) == pytest.approx(40 * (0.1 - START[0]))
    with_one = linkdyn.Scene({key: value for key, value in data.items() if key != "controller"}).with_({"controller.A": {"actuator": "A", "target": 0.1, "kp": 40.0}})
    np.testing.assert_array_equal(with_one.forward(t=[0.0, 0.1]).q, other.q)


@pytest.mark.parametrize("rate", [{"damps": "measured"}, {"rate": "100 Hz"}])
def test_nothing_to_put_out(rate: dict[str, Any]) -> None:
    """A target that ends, and one that the mechanism's motion cannot have: the run ends there and names the controller."""
    run = linkdyn.Scene(slider(target="0.1 m + 1 mm*sqrt(0.503 - time/(1 s))", kp=80.0, kd=9.0, **rate)).forward(t=np.linspace(0, 1, 11))
    assert run.attrs["stopped"].startswith("stopped at t = 0.5") and "controller 'A' has no output" in run.attrs["stopped"]
    assert (run.status.values[:6] == 0).all() and np.isnan(run.controller_output.values[6:]).all()
    data = tomllib.loads((EXAMPLES / "fivebar_pick" / "scene.toml").read_text())
    data["coordinate"][0]["motion"]["x"] = {"law": "constant-rate", "rate": 3.0, "start": -0.1}
    run = linkdyn.Scene(data).forward(t_end=0.4)
    assert "controller 'A' has no output" in run.attrs["stopped"]
