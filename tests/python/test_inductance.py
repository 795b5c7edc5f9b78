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
