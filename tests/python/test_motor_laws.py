"""Laws at the motor in forward motion: torque, voltage, limits, brakes; what gears and screws lose on the way. Against closed forms, quadrature, energy by
hand, and inverse dynamics of the motion found."""

from __future__ import annotations

import copy
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn.errors import InputError
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson, solve_ivp
from test_drives import of_arm, of_hexapod, of_rod, on_the_coupler

pytestmark = pytest.mark.accuracy

G = 9.81
SHARP: dict[str, Any] = {"rtol": 1e-10, "atol": 1e-12}


def disc(start: float = 0.0, **actuator: Any) -> dict[str, Any]:
    """A disc of 0.3 kg m^2 on a motor."""
    return {
        "space": "planar",
        "frame": {"markers": {"O": [0.0, 0.0]}},
        "link": [{"name": "disc", "mass": 2.0, "inertia": 0.3, "markers": {"O": [0.0, 0.0]}}],
        "joint": [{"name": "O", "type": "revolute", "between": ["frame.O", "disc.O"]}],
        "coordinate": [{"joint": "O", "start": {"position": 0.2, "velocity": start}}],
        "actuator": [{"joint": "O", **actuator}],
    }


def lift(start: float = 0.0, mass: float = 200.0, **actuator: Any) -> dict[str, Any]:
    """A mass on a vertical screw."""
    return {
        "space": "planar",
        "gravity": [0.0, -G],
        "frame": {"markers": {"A": {"at": [0.0, 0.0], "axis": [0.0, 1.0]}}},
        "link": [{"name": "mass", "mass": mass, "inertia": 1.0, "markers": {"A": {"at": [0.0, 0.0], "axis": [0.0, 1.0]}}}],
        "joint": [{"name": "A", "type": "prismatic", "between": ["frame.A", "mass.A"]}],
        "coordinate": [{"joint": "A", "start": {"position": 0.5, "velocity": start}}],
        "actuator": [{"joint": "A", **actuator}],
    }


def at_motor(value: Any) -> dict[str, Any]:
    return {"type": "formula" if isinstance(value, str) else "constant", "value": value, "at": "motor"}


SCREW = {"lead": 0.01, "rotor_inertia": 2e-4}
N = 2 * np.pi / 0.01
"""Its ratio [rad/m]."""


# ---------------------------------------------------------------- one body, by hand


@pytest.mark.parametrize("efficiency", [1.0, 0.7])
def test_start_of_a_dc_motor(efficiency: float) -> None:
    """Torque K (U - K n w)/R drives (n^2 J + I/eta) w': exponential."""
    n, inertia, constant, resistance, voltage, start = 10.0, 1e-3, 0.5, 2.0, 48.0, 1.0
    scene = disc(start, law={"type": "voltage", "value": voltage},
                 drive={"ratio": n, "rotor_inertia": inertia, "torque_constant": constant, "resistance": resistance, "efficiency": efficiency})
    t = np.linspace(0, 1.5, 31)
    run = linkdyn.Scene(scene).forward(t=t, want="all", **SHARP)
    lag = (n**2 * inertia + 0.3 / efficiency) * resistance / (n * constant) ** 2
    end = voltage / (constant * n)
    speed = end + (start - end) * np.exp(-t / lag)
    assert np.abs(run.qd.values[:, 0] - speed).max() < 1e-8 * end
    way = 0.2 + end * t + (start - end) * lag * (1 - np.exp(-t / lag))
    assert np.abs(run.q.values[:, 0] - way).max() < 1e-8
    np.testing.assert_allclose(run.motor_current.values[:, 0], (voltage - constant * n * speed) / resistance, atol=1e-6)
    assert np.abs(run.power_imbalance).max() < 1e-11


@pytest.mark.parametrize(("start", "torque", "sense"), [(0.2, 8.0, 1), (-0.2, 8.0, -1), (-0.2, 1.0, -1), (0.4, -3.0, 1)])
def test_screw_lift(start: float, torque: float, sense: int) -> None:
    """Driving up, braking down, let down, thrown upwards against the motor: n T - I a is what is transmitted over the efficiency, or times that of the way back."""
    efficiency = 0.8
    back = 2 - 1 / efficiency
    scene = lift(start, law=at_motor(torque), drive={**SCREW, "efficiency": efficiency})
    t = np.linspace(0, 0.01, 11)
    run = linkdyn.Scene(scene).forward(t=t, want="all", **SHARP)
    reflected = N**2 * SCREW["rotor_inertia"]
    # what pushes the mass: positive in all of these but where the screw brakes it on its way up
    solved = {}
    for push in (1, -1):
        factor = 1 / efficiency if push * sense > 0 else back
        acceleration = (N * torque - 200 * G * factor) / (200 * factor + reflected)
        if push * (acceleration + G) > 0:
            solved[push] = acceleration
    (acceleration,) = solved.values()
    assert np.abs(run.qd.values[:, 0] - start - acceleration * t).max() < 1e-9
    assert (np.abs(run.qd.values) > 19 * 0.1 / N).all()
    np.testing.assert_allclose(run.motor_torque.values, torque, rtol=1e-9)
    # energy: what the motor gives is in the masses, or lost
    loss = run.transmission_loss.values[:, 0]
    assert (loss > 0).all()
    np.testing.assert_allclose(run.motor_power.values[:, 0], run.driving_power.values[:, 0] + loss, rtol=1e-12)
    given = torque * N * (run.q.values[-1, 0] - run.q.values[0, 0])
    stored = [float(run.kinetic_energy[k] + run.potential_energy[k]) for k in (0, -1)]
    lost = cumulative_simpson(loss, x=t)[-1]
    assert given == pytest.approx(stored[1] - stored[0] + lost, rel=1e-8)
    assert np.abs(run.power_imbalance).max() < 1e-11


@pytest.mark.parametrize(("efficiency", "mass"), [(0.4, 50.0), (0.3, 20.0)])
def test_self_locking_screw_holds(efficiency: float, mass: float) -> None:
    """Without a torque the load comes to rest, but for the creep at which friction holds it; a small torque down does not get it down."""
    creep = 0.02
    drive = {**SCREW, "efficiency": efficiency, "creep_speed": creep}
    share = 1 / efficiency - 1
    for torque in (0.0, -0.02):
        # n T + R = m g, R = c m g tanh
        hold = (mass * G - N * torque) / (share * mass * G)
        assert 0 < hold < 1
        run = linkdyn.Scene(lift(-0.05, mass, law=at_motor(torque), drive=drive)).forward(t=np.linspace(0, 3, 7), want="all", method="seulex", rtol=1e-8, atol=1e-10)
        assert run.motor_speed.values[-1, 0] == pytest.approx(-creep * np.arctanh(hold), rel=1e-4)
        assert run.driving_force.values[-1, 0] == pytest.approx(mass * G, rel=1e-6)
        np.testing.assert_allclose(run.motor_torque.values, torque, atol=1e-9 * mass * G / N)


def test_on_the_limit_of_self_locking() -> None:
    """An efficiency of zero backwards: the load neither speeds up nor comes to rest."""
    run = linkdyn.Scene(lift(-0.05, law=at_motor(0.0), drive={**SCREW, "back_efficiency": 0.0})).forward(t=np.linspace(0, 1, 7), **SHARP)
    assert np.abs(run.qd.values + 0.05).max() < 1e-10


def test_a_screw_that_jams() -> None:
    """A load too heavy for the rotor: no force stops both at once. A run says so, at its start or where it comes there."""
    drive = {**SCREW, "efficiency": 0.4}
    with pytest.raises(InputError, match="start: actuator 'A' jams"):
        linkdyn.Scene(lift(-0.05, 5000.0, law=at_motor(0.0), drive=drive)).forward(t=np.linspace(0, 1, 11))
    later = lift(-0.05, 50.0, law=at_motor(-1.0), drive=drive)
    later["payload"] = [{"on": "mass.A", "mass": 5000.0, "from": 0.05}]
    run = linkdyn.Scene(later).forward(t=np.linspace(0, 0.1, 11))
    assert "actuator 'A' jams" in str(run.attrs)
    assert (run.status.values[:5] == 0).all() and (run.status.values[7:] != 0).all()


# ---------------------------------------------------------------- mechanisms: inverse after forward


LOSSY = {"efficiency": 0.75}


def four(**law: Any) -> dict[str, Any]:
    from test_drives import four as make

    return make(**law)


def motors_of(scene: dict[str, Any], torques: list[Any], **more: Any) -> dict[str, Any]:
    changed = copy.deepcopy(scene)
    for actuator, torque in zip(changed["actuator"], torques, strict=True):
        actuator["law"] = at_motor(torque)
        actuator["drive"] = {**actuator["drive"], **LOSSY, **more}
    return changed


def torque_by_hand(drive: dict[str, Any], force: NDArray[np.float64], rate: NDArray[np.float64], acceleration: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of a motor whose force at the joint the inverse dynamics of the motion asks for."""
    n = drive.get("ratio") or 2 * np.pi / drive["lead"]
    inertia = drive.get("rotor_inertia", 0) + drive.get("screw_inertia", 0)
    efficiency = drive["efficiency"]
    back = drive.get("back_efficiency", 2 - 1 / efficiency if "lead" in drive else efficiency)
    sent = force - n**2 * inertia * acceleration
    share = np.where(sent * rate > 0, 1 / efficiency - 1, 1 - back)
    return (force + share * np.abs(sent) * np.tanh(abs(n) * rate / drive.get("creep_speed", 0.1))) / n


CASES = {
    "four-bar": (lambda: motors_of(four(), [-0.8]), 0.6),
    "at the coupler": (lambda: motors_of(on_the_coupler(), ["0.3 N*m*sin(9 rad/s*time)"]), 0.6),
    "arm": (lambda: motors_of(of_arm(), [0.2, -0.1, "0.4 N*m*cos(5 rad/s*time)"]), 0.3),
    "hexapod": (lambda: motors_of(of_hexapod(), [1.0, 0.6, 0.5, 1.1, 0.8, 0.7]), 0.1),
    "rod": (lambda: motors_of(of_rod(), [0.3], efficiency=0.45), 0.3),
}


@pytest.mark.parametrize("case", CASES)
def test_inverse_after_forward(case: str) -> None:
    """What inverse dynamics of the motion found asks of the motors is what their laws gave; the power balance closes with what is lost."""
    make, end = CASES[case]
    data = make()
    scene = linkdyn.Scene(data)
    t = np.linspace(0, end, 13)
    run = scene.forward(t=t, want="all", **SHARP)
    assert (run.status == 0).all()
    assert np.abs(run.power_imbalance).max() < 1e-9
    back = scene.solve(run.q.values, run.qd.values, run.qdd.values)
    given = run.motor_torque.values
    size = np.abs(given).max()
    h = 1e-5
    for i, actuator in enumerate(data["actuator"]):
        np.testing.assert_allclose(back["driving_force"][:, i], run.driving_force.values[:, i], atol=1e-8 * np.abs(run.driving_force.values).max())
        drive = actuator["drive"]
        n = drive.get("ratio") or 2 * np.pi / drive["lead"]
        inertia = drive.get("rotor_inertia", 0) + drive.get("screw_inertia", 0)
        taken = (run.driving_force.values - run.transmission_force.values)[:, i] / (n**2 * inertia)
        found = torque_by_hand(drive, back["driving_force"][:, i], run.driving_speed.values[:, i], taken)
        law = actuator["law"]["value"]
        expected = {"0.3 N*m*sin(9 rad/s*time)": 0.3 * np.sin(9 * t), "0.4 N*m*cos(5 rad/s*time)": 0.4 * np.cos(5 * t)}.get(law, law)
        assert np.abs(found - expected).max() < 1e-7 * size
        assert np.abs(given[:, i] - expected).max() < 1e-7 * size
    loss = run.transmission_loss.values
    assert (loss >= 0).all() and loss.max() > 0
    np.testing.assert_allclose(run.motor_power.values, run.driving_power.values + loss, atol=1e-9 * np.abs(loss).max())
    # accelerations of what the rotors turn with are those of the motion: by differences of a run beside
    near = scene.forward(t=np.sort(np.concatenate([[0.0], t[1:-1] - h, t[1:-1] + h])), want="all", **SHARP)
    rate = near.driving_speed.values[1:]
    numbers = [((a["drive"].get("ratio") or 2 * np.pi / a["drive"]["lead"]) ** 2) * (a["drive"].get("rotor_inertia", 0) + a["drive"].get("screw_inertia", 0)) for a in data["actuator"]]
    taken = (run.driving_force.values - run.transmission_force.values)[1:-1]
    by_difference = (rate[1::2] - rate[::2]) / (2 * h) * numbers
    assert np.abs(taken - by_difference).max() < 1e-4 * (np.abs(by_difference).max() + np.abs(run.driving_force.values).max())


@pytest.mark.parametrize("case", ["four-bar", "hexapod"])
def test_solvers(case: str) -> None:
    make, end = CASES[case]
    scene = linkdyn.Scene(make())
    t = np.linspace(0, end, 5)
    runs = [scene.forward(t=t, solver=solver, **SHARP) for solver in ("elimination", "lapack", "reduced")]
    for other in runs[1:]:
        assert np.abs(other.q.values - runs[0].q.values).max() < 1e-8


def test_ensemble_and_simulator() -> None:
    """Each member, and each step, is as the run alone."""
    make, end = CASES["four-bar"]
    scene = linkdyn.Scene(make())
    t = np.linspace(0, end, 4)
    run = scene.forward(t=t, method="rk4", step=1e-3)
    q, qd = run.q.values[0], run.qd.values[0]
    many = scene.ensemble(np.tile(q, (20, 1)), np.tile(qd, (20, 1)), t, step=1e-3)
    np.testing.assert_allclose(many.q.values[17], run.q.values, atol=1e-12)
    simulator = scene.simulator(method="rk4", step=1e-3)
    for k in range(1, 4):
        simulator.step(t[k] - t[k - 1], [-0.8])
        assert simulator.q == pytest.approx(run.q.values[k], abs=1e-10)


def test_beside_friction() -> None:
    """Joints that rub and gears that lose: both found together, and the balance closes."""
    data = motors_of(of_arm(), [0.2, -0.1, 0.4])
    data["friction"] = [{"joint": f"J{i}", "coulomb": 0.1, "radius": 0.03, "length": 0.2} for i in (1, 2)]
    scene = linkdyn.Scene(data)
    run = scene.forward(t=np.linspace(0, 0.2, 7), want="all", method="seulex", rtol=1e-9, atol=1e-10)
    assert np.abs(run.power_imbalance).max() < 1e-9
    assert np.abs(run.motor_torque.values - [0.2, -0.1, 0.4]).max() < 1e-8


def test_errors_of_a_run() -> None:
    """Estimated by a mechanism of another size, whose motors are of another size, too."""
    drive = {"lead": 0.01, "rotor_inertia": 2e-4, "efficiency": 0.8, "torque_constant": 0.5, "resistance": 1.5}
    for law in (at_motor(4.0), {"type": "voltage", "value": 30.0}, {"type": "voltage", "value": "30 V + 2 V*sin(time*20 rad/s)"}):
        run = linkdyn.Scene(lift(0.01, law=law, drive=drive)).forward(t=np.linspace(0, 0.2, 5), error=True)
        assert (run.q_error < 1e-6).all()


def test_gear_without_losses() -> None:
    """A law at the motor of a gear that loses nothing is n times that at the joint."""
    t = np.linspace(0, 0.5, 6)
    drive = {"ratio": 40, "rotor_inertia": 3e-5}
    one, other = (linkdyn.Scene(disc(law=law, drive=drive)).forward(t=t, **SHARP) for law in (at_motor(0.1), {"type": "constant", "value": 4.0}))
    assert np.abs(one.q.values - other.q.values).max() < 1e-10


# ---------------------------------------------------------------- limits


def test_start_along_a_speed_torque_curve() -> None:
    """A fan from rest with all that the motor has; against a quadrature."""
    speeds, torques = [0.0, 100.0, 200.0, 320.0], [4.0, 5.0, 3.5, 0.0]
    n, inertia, drag = 8.0, 2e-3, 0.9
    data = disc(2.0, law=at_motor(100.0), drive={"ratio": n, "rotor_inertia": inertia, "efficiency": 0.9, "torque_curve": {"speeds": speeds, "torques": torques}})
    data["measures"] = {"turning": {"joint": "O", "rate": True}}
    data["load"] = [{"on": "disc.O", "moment": f"-{drag} N*m*s^2/rad^2*turning^2"}]
    t = np.linspace(0, 3, 31)
    run = linkdyn.Scene(data).forward(t=t, want="all", **SHARP)

    def rate(_: float, y: NDArray[np.float64]) -> list[float]:
        torque = np.interp(n * y[0], speeds, torques)
        return [(n * torque - drag * y[0] ** 2 / 0.9) / (0.3 / 0.9 + n**2 * inertia)]

    exact = solve_ivp(rate, (0, 3), [2.0], method="LSODA", rtol=1e-11, atol=1e-12, t_eval=t, max_step=0.01).y[0]
    assert np.abs(run.qd.values[:, 0] - exact).max() < 1e-7 * exact.max()
    assert np.abs(run.torque_margin).max() < 1e-9 * 5
    np.testing.assert_allclose(run.motor_torque.values[:, 0], np.interp(n * exact, speeds, torques), rtol=1e-6)


@pytest.mark.parametrize(("limits", "largest"), [
    ({"torque_limit": 2.0}, lambda speed: np.full_like(speed, 2.0)),
    ({"torque_limit": 2.0, "power_limit": 90.0}, lambda speed: np.minimum(2.0, 90 / np.maximum(speed, 1e-9))),
    ({"current_limit": 6.0}, lambda speed: np.full_like(speed, 3.0)),
])
def test_limits_saturate(limits: dict[str, Any], largest: Any) -> None:
    """A motor at its voltage from rest: what its limits leave."""
    n, inertia, constant, resistance, voltage = 5.0, 2e-3, 0.5, 0.4, 60.0
    data = disc(law={"type": "voltage", "value": voltage}, drive={"ratio": n, "rotor_inertia": inertia, "torque_constant": constant, "resistance": resistance, **limits})
    t = np.linspace(0, 2, 21)
    run = linkdyn.Scene(data).forward(t=t, want="all", **SHARP)

    def rate(_: float, y: NDArray[np.float64]) -> list[float]:
        speed = n * y[0]
        torque = min(constant * (voltage - constant * speed) / resistance, float(largest(np.array(speed))))
        return [n * torque / (0.3 + n**2 * inertia)]

    exact = solve_ivp(rate, (0, 2), [0.0], method="LSODA", rtol=1e-11, atol=1e-12, t_eval=t, max_step=0.01).y[0]
    assert np.abs(run.qd.values[:, 0] - exact).max() < 1e-7 * exact.max()
    assert run.torque_margin.min() > -1e-9
    np.testing.assert_allclose(run.torque_margin.values[:, 0], largest(n * exact) - np.abs(run.motor_torque.values[:, 0]), atol=1e-6)


def test_margin_of_inverse_dynamics() -> None:
    """What the motor has beyond what the motion asks for, below zero where it has not; both engines."""
    curve = {"speeds": [0.0, 60.0, 120.0], "torques": [0.8, 0.6, 0.1]}
    data = four()
    data["actuator"][0]["drive"] = {**data["actuator"][0]["drive"], "efficiency": 0.8, "torque_curve": curve, "torque_limit": 0.7}
    scene = linkdyn.Scene(data)
    for solver in ("elimination", "lapack"):
        run = scene.inverse(t=np.linspace(0, 2, 200), solver=solver, want="all")
        speed, torque = np.abs(run.motor_speed.values), np.abs(run.motor_torque.values)
        assert speed.max() > 120 or speed.max() > 60
        beyond = curve["torques"][-1] * np.maximum(0.0, 1 - (speed - 120) / 1.2)
        largest = np.minimum(0.7, np.where(speed < 120, np.interp(speed, curve["speeds"], curve["torques"]), beyond))
        np.testing.assert_allclose(run.torque_margin.values, largest - torque, atol=1e-12)


def test_refusals() -> None:
    """From Python by the place in the scene."""
    with pytest.raises(linkdyn.errors.SceneError, match="drive"):
        linkdyn.Scene(disc(law=at_motor(1.0)))
