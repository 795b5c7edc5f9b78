"""Motors whose winding has an inductance: against the matrix exponential, and the voltage found again by inverse dynamics."""

from __future__ import annotations

from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn import cycle

pytestmark = pytest.mark.accuracy

J, ROTOR, N, K, R, L, C = 0.02, 3e-5, 12.0, 0.08, 0.6, 4e-3, 0.05


def machine(voltage: str = "24 V", **drive: Any) -> dict[str, Any]:
    """A flywheel behind a gear, with a viscous brake that is a spring of no stiffness."""
    return {
        "space": "planar", "gravity": [0, 0], "frame": {"markers": {"A": [0, 0]}},
        "link": [{"name": "wheel", "mass": 2.0, "inertia": J, "markers": {"O": [0, 0]}}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "wheel.O"]}], "coordinate": [{"joint": "A"}],
        "spring": [{"name": "oil", "joint": "A", "damping": C}],
        "actuator": [{"joint": "A", "law": {"type": "voltage", "value": voltage},
                      "drive": {"ratio": N, "rotor_inertia": ROTOR, "torque_constant": K, "resistance": R, "inductance": f"{1000 * L} mH", **drive}}],
        "time": {"end": 0.2, "samples": 401},
    }  # fmt: skip


def exponential(matrix: np.ndarray) -> np.ndarray:
    """By its series, scaled and squared."""
    halved = matrix / 2**10
    total = term = np.eye(len(matrix))
    for k in range(1, 25):
        term = term @ halved / k
        total = total + term
    for _ in range(10):
        total = total @ total
    return total


def test_against_the_matrix_exponential() -> None:
    """Angle, speed and current under a constant voltage."""
    run = linkdyn.Scene(machine()).forward(want="all")
    inertia = J + N**2 * ROTOR
    # y = (angle, speed, current, 1)
    a = np.array([[0, 1, 0, 0], [0, -C / inertia, N * K / inertia, 0], [0, -K * N / L, -R / L, 24.0 / L], [0, 0, 0, 0]])
    for k in range(0, 401, 40):
        q, qd, i, _ = exponential(a * run.time.values[k])[:, 3]
        assert run.q.values[k, 0] == pytest.approx(q, abs=2e-8)
        assert run.qd.values[k, 0] == pytest.approx(qd, abs=2e-7)
        assert run.motor_current.values[k, 0] == pytest.approx(i, abs=1e-6)


def test_without_inductance_nothing_lags() -> None:
    """A hundred thousandth of the inductance is as good as none, but at the first instant, when no current flows."""
    none = machine() | {"time": {"end": 0.05, "samples": 26}}
    none["actuator"][0]["drive"].pop("inductance")
    little = machine() | {"time": {"end": 0.05, "samples": 26}}
    little["actuator"][0]["drive"]["inductance"] = 4e-8
    found = linkdyn.Scene(little).forward(method="seulex", want="all")
    wanted = linkdyn.Scene(none).forward(want="all")
    np.testing.assert_allclose(found.qd.values, wanted.qd.values, atol=1e-4 * wanted.qd.values.max())
    assert found.motor_current.values[0, 0] == pytest.approx(0.0, abs=1e-12) and wanted.motor_current.values[0, 0] == pytest.approx(40.0)
    late = linkdyn.Scene(machine() | {"time": {"end": 0.05, "samples": 26}}).forward(method="seulex")
    assert late.qd.values[5, 0] < 0.9 * wanted.qd.values[5, 0] and np.all(late.status == 0)


def test_solvers_and_long_runs() -> None:
    """The record of a long run, and the lanes: one run."""
    scene = linkdyn.Scene(machine("24 V*sin(30 rad/s*time)") | {"time": {"end": 2.0, "samples": 201}})
    one, other = scene.forward(want="all"), scene.forward(want="all", solver="lapack")
    np.testing.assert_allclose(one.q.values, other.q.values, atol=1e-8 * np.abs(one.q.values).max())
    np.testing.assert_allclose(one.motor_current.values, other.motor_current.values, atol=1e-7)


def test_the_voltage_of_a_run() -> None:
    """R i + k w + L di/dt is the voltage that it was run with; also where samples are not evenly spaced."""
    scene = linkdyn.Scene(machine("12 V + 9 V*sin(60 rad/s*time)"))
    t = np.linspace(0.0, 0.2, 2001)
    t[1:-1] += 2e-5 * np.sin(50 * t[1:-1])
    run = scene.forward(t=t, want="all")
    voltage = 12 + 9 * np.sin(60 * t)
    told = cycle.motor(run, "A", scene)
    np.testing.assert_allclose(told.motor_voltage.values, voltage, atol=1e-4)


def test_voltage_of_a_motion() -> None:
    """Inverse dynamics of a harmonic motion: the voltage in closed form."""
    data = machine() | {"time": {"end": 0.2, "samples": 801}}
    data["coordinate"][0]["motion"] = {"law": "harmonic", "amplitude": "1.2 rad", "frequency": "9 Hz"}
    scene = linkdyn.Scene(data)
    run = scene.inverse(want="all")
    w, t, inertia = 18 * np.pi, run.time.values, J + N**2 * ROTOR
    rate, rate2, rate3 = (1.2 * w * np.cos(w * t), -1.2 * w**2 * np.sin(w * t), -1.2 * w**3 * np.cos(w * t))
    current = (inertia * rate2 + C * rate) / (N * K)
    voltage = R * current + K * N * rate + L * (inertia * rate3 + C * rate2) / (N * K)
    np.testing.assert_allclose(cycle.motor(run, "A", scene).motor_voltage.values, voltage, atol=1e-6 * np.abs(voltage).max())
    without = cycle.motor(run, "A", scene, inductance=1e-12).motor_voltage.values
    assert np.abs(without - voltage).max() > 0.1 * np.abs(voltage).max()


def test_a_controller_at_the_terminals() -> None:
    """A proportional controller of the angle that puts out a voltage: linear, so the matrix exponential again."""
    data = machine()
    data["actuator"][0].pop("law")
    data["controller"] = [{"actuator": "A", "measure": "turn", "target": 0.5, "kp": 40.0, "at": "terminals"}]
    data["measures"] = {"turn": {"joint": "A"}}
    run = linkdyn.Scene(data).forward(want="all")
    inertia = J + N**2 * ROTOR
    a = np.array([[0, 1, 0, 0], [0, -C / inertia, N * K / inertia, 0], [-40.0 / L, -K * N / L, -R / L, 20.0 / L], [0, 0, 0, 0]])
    for k in range(0, 401, 80):
        q, qd, i, _ = exponential(a * run.time.values[k])[:, 3]
        assert run.q.values[k, 0] == pytest.approx(q, abs=2e-8)
        assert run.motor_current.values[k, 0] == pytest.approx(i, abs=1e-6)


def first_instant(is_past: Any, last: float) -> float:
    """Of a change in between."""
    low, high = 0.0, last
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if is_past(middle) else (middle, high)
    return low


def limited_start(largest: float, t: np.ndarray) -> np.ndarray:
    """(angle, speed, current) under 24 V: the current is free, led to its limit, and free again; each part by the matrix exponential."""
    inertia, pace, out = J + N**2 * ROTOR, 100 * R / L, np.empty((len(t), 3))
    motion = [[0, 1, 0, 0], [0, -C / inertia, N * K / inertia, 0]]
    asked, led = np.array([0, -K * N, -R, 24.0]) / L, pace * np.array([0, 0, -1, largest])
    free, held = (np.array([*motion, row, [0, 0, 0, 0]]) for row in (asked, led))
    parts = [(0.0, np.array([0, 0, 0, 1.0]), free)]
    for matrix, more, last in ((held, asked - led, 5e-3), (free, led - asked, 0.2)):
        begin, start, before = parts[-1]
        lasts = first_instant(lambda s: more @ exponential(before * s) @ start > 0, last)
        parts.append((begin + lasts, exponential(before * lasts) @ start, matrix))
    for k, now in enumerate(t):
        begin, start, matrix = [part for part in parts if part[0] <= now][-1]
        out[k] = (exponential(matrix * (now - begin)) @ start)[:3]
    return out


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("limit", [{"current_limit": "9 A"}, {"torque_limit": 9 * K, "current_limit": "20 A"}])
@pytest.mark.parametrize("method", ["gbs", "seulex", "rk4"])
def test_a_current_within_its_limit(limit: dict[str, Any], sense: int, method: str) -> None:
    """The drive cuts the voltage to what leads the current to its limit, until less is asked for."""
    accuracy: dict[str, Any] = {"step": 1e-5} if method == "rk4" else {"rtol": 1e-9, "atol": 1e-10}
    scene = linkdyn.Scene(machine(f"{24 * sense} V", **limit) | {"time": {"end": 0.2, "samples": 101}})
    run = scene.forward(want="all", method=method, **accuracy)
    exact = sense * limited_start(9.0, run.time.values)
    assert 20 < np.count_nonzero(np.abs(exact[:, 2]) > 8.999) < 100
    np.testing.assert_allclose(run.q.values[:, 0], exact[:, 0], rtol=0, atol=1e-7)
    np.testing.assert_allclose(run.qd.values[:, 0], exact[:, 1], rtol=0, atol=1e-6)
    np.testing.assert_allclose(run.motor_current.values[:, 0], exact[:, 2], rtol=0, atol=2e-5)
    assert np.abs(run.motor_current.values).max() <= 9 + 1e-7  # but for errors of steps


def test_a_limited_current_in_long_runs_and_ensembles() -> None:
    """The record of a long run and the lanes; members of an ensemble. The voltage told is the one that the drive has cut."""
    scene = linkdyn.Scene(machine("24 V*sin(30 rad/s*time)", current_limit="6 A") | {"time": {"end": 1.0, "samples": 1001}})
    accuracy: dict[str, Any] = {"method": "gbs", "rtol": 1e-8, "atol": 1e-9}
    one, other = scene.forward(want="all", **accuracy), scene.forward(want="all", solver="lapack", **accuracy)
    np.testing.assert_allclose(one.q.values, other.q.values, atol=1e-6)
    held = np.abs(one.motor_current.values[:, 0]) > 6 * (1 - 1e-6)
    assert held.sum() > 100
    members = scene.ensemble([[0.0]] * 2, [[0.0]] * 2, [0.0, 1.0], step=2e-5)
    np.testing.assert_allclose(members.q.values[:, -1, 0], one.q.values[-1, 0], atol=1e-6)
    told = cycle.motor(one, "A", scene).motor_voltage.values
    asked = 24 * np.sin(30 * one.time.values)
    within = np.logical_and.reduce([np.roll(held, k) for k in range(-3, 4)])
    np.testing.assert_allclose(told[within], R * one.motor_current.values[within, 0] + K * N * one.qd.values[within, 0], atol=1e-2)
    assert np.all(np.sign(one.motor_current.values[within, 0]) * (asked - told)[within] > -1e-2)


def test_a_limit_that_falls_with_the_speed() -> None:
    """The current follows what a power limit leaves of it, later by the controller's time."""
    run = linkdyn.Scene(machine("24 V", current_limit="20 A", power_limit="60 W")).forward(want="all", rtol=1e-9, atol=1e-10)
    left = 60 / (K * N * np.maximum(run.qd.values[:, 0], 1e-9))
    current = run.motor_current.values[:, 0]
    slope = np.gradient(left, run.time.values)
    at = slice(20, 60)  # 10 to 30 ms: the speed has come to where the power counts
    assert np.all(current[at] > 0.5 * left[at]) and np.all(left[at] < 20)
    np.testing.assert_allclose(current[at], left[at] - slope[at] * L / (100 * R), rtol=2e-3)


@pytest.mark.parametrize("tolerance", [1e-8, 1e-9, 1e-10, 1e-11])
def test_a_current_that_stays_at_its_limit_is_not_taken_for_rounding(tolerance: float) -> None:
    """There it stands still to the last digit, and steps are a hundred times as long as its time constant: what the step makes of a last
    place was taken for rates too rough, and the run stopped."""
    drive = {"ratio": 15, "rotor_inertia": 1.6e-4, "efficiency": 0.8, "torque_constant": 0.2, "resistance": 2.4, "current_limit": 4, "inductance": "8 mH"}
    scene = linkdyn.Scene({
        "space": "planar", "gravity": [0, 0], "frame": {"markers": {"A": [0, 0]}},
        "link": [{"name": "arm", "mass": 2.3, "inertia": 0.04, "cog": [0.16, 0], "markers": {"A": [0, 0], "B": [0.5, 0]}},
                 {"name": "hand", "mass": 0.5, "inertia": 0.044, "cog": [0.15, -0.025], "markers": {"B": [0, 0]}}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "arm.A"]}, {"name": "B", "type": "revolute", "between": ["arm.B", "hand.B"]}],
        "coordinate": [{"joint": "A", "start": {"position": -1.74, "velocity": -1.9}}, {"joint": "B", "start": {"position": 0.42, "velocity": -0.6}}],
        "actuator": [{"joint": "A", "law": {"type": "voltage", "value": "16 V*sin(3 rad/s*time)"}, "drive": drive}],
        "stop": [{"name": "buffer", "joint": "A", "max": -0.75, "stiffness": 4600, "damping": 18}],
    })  # fmt: skip
    t = np.linspace(0, 1.6, 41)
    run, other = scene.forward(t=t, method="rk8pd", rtol=tolerance, atol=tolerance), scene.forward(t=t, method="seulex", rtol=1e-11, atol=1e-11)
    assert "stopped" not in run.attrs or not run.attrs["stopped"]
    # of 48 tolerances from 1e-11 to 1e-10 the worst left 130 times its own, by when the steps happen to meet the buffer and the limit
    np.testing.assert_allclose(run.q.values, other.q.values, rtol=0, atol=1000 * max(tolerance, 1e-11))
