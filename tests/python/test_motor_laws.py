"""Laws at the motor in forward motion: torque, voltage, limits, brakes; what gears and screws lose on the way. Against closed forms, quadrature, energy by
hand, and inverse dynamics of the motion found."""

from __future__ import annotations

import copy
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
import xarray as xr
from linkdyn._sheets.sheet import sheet_page
from linkdyn.cli import executable, quadruple_twin
from linkdyn.errors import InputError
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson, solve_ivp
from test_drives import of_arm, of_hexapod, of_rod, on_the_coupler
from test_generate import Compiled

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
    told = run.linkdyn.motor("O")
    np.testing.assert_allclose(told.motor_voltage, voltage, rtol=1e-7)
    np.testing.assert_allclose(told.electric_power, told.motor_power + resistance * told.motor_current**2)
    np.testing.assert_array_equal(told.transmission_loss, run.transmission_loss.values[:, 0])
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


def test_forward_after_inverse(tmp_path: Any) -> None:
    """The torques that inverse dynamics finds of a crank that turns, put in as a table, return its motion: through both directions of power flow."""
    data = four()
    data["coordinate"] = [{"joint": "A", "motion": {"law": "constant-rate", "rate": 6.0}}]
    drive = {**data["actuator"][0]["drive"], "efficiency": 0.7, "back_efficiency": 0.5}
    data["actuator"] = [{"joint": "A", "drive": drive}]
    t = np.linspace(0, 1.0, 2001)
    inverse = linkdyn.Scene(data).inverse(t=t, want="all")
    flow = inverse.transmission_force.values[:, 0] * inverse.driving_speed.values[:, 0]
    assert (flow > 0).any() and (flow < 0).any()
    (tmp_path / "torque.csv").write_text("t,A\n" + "\n".join(f"{time!r},{torque!r}" for time, torque in zip(t.tolist(), inverse.motor_torque.values[:, 0].tolist())))
    data["actuator"][0]["law"] = {"type": "table", "table": "torque.csv", "interpolation": "spline", "at": "motor"}
    run = linkdyn.Scene(data, folder=tmp_path).forward(t=t[::100], want="all", **SHARP)
    assert np.abs(run.q.values - inverse.q.values[::100]).max() < 1e-6
    np.testing.assert_allclose(run.transmission_loss, inverse.transmission_loss.values[::100], atol=1e-3 * float(inverse.transmission_loss.max()))


def test_generated_code(tmp_path: Path) -> None:
    """Code of forward dynamics does not know of motors' laws: it takes driving forces, whatever the law is."""
    scene = linkdyn.Scene(motors_of(four(), [-0.8]))
    compiled = Compiled(scene.generate("forward", name="kernel"), tmp_path)
    run = scene.forward(t=np.linspace(0, 0.5, 6), want="all", **SHARP)
    for k in range(6):
        status, found = compiled(q=run.q.values[k], qd=run.qd.values[k], driving_force=run.driving_force.values[k])
        assert status == 0
        np.testing.assert_allclose(found["qdd"], run.qdd.values[k], rtol=1e-9)


@pytest.mark.parametrize("case", ["four-bar", "hexapod"])
def test_solvers(case: str) -> None:
    make, end = CASES[case]
    scene = linkdyn.Scene(make())
    t = np.linspace(0, end, 5)
    runs = [scene.forward(t=t, solver=solver, **SHARP) for solver in ("elimination", "lapack", "reduced")]
    for other in runs[1:]:
        assert np.abs(other.q.values - runs[0].q.values).max() < 1e-8


@pytest.mark.parametrize("law", [at_motor(-0.3), at_motor("-0.3 N*m*cos(3 rad/s*time)"), {"type": "voltage", "value": -12.0}])
def test_record_against_lanes(law: dict[str, Any]) -> None:
    """A motor at the coordinate, whose run goes by a record, and the same machine beside friction that is next to nothing, with which it stays on lanes."""
    data = motors_of(four(), [0.0], torque_constant=0.05, resistance=0.2, efficiency=0.7, torque_limit=0.4)
    data["actuator"][0]["law"] = law
    beside = {**data, "friction": [{"joint": "D", "viscous": 1e-14}]}
    t = np.linspace(0, 1.5, 16)
    # errors of q are some 30 tolerances, which a transmission near its creep speed makes 70 times as large: 2e-9
    run, lanes = (linkdyn.Scene(one).forward(t=t, want="all", rtol=1e-12, atol=1e-14) for one in (data, beside))
    for name in ("q", "qd", "motor_torque", "transmission_force", "transmission_loss"):
        assert np.abs(run[name].values - lanes[name].values).max() < 1e-7 * np.abs(run[name].values).max(), name


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


TWINS = {
    "four-bar": lambda: motors_of(four(), [-0.8]),
    "arm": lambda: motors_of(of_arm(), [0.2, -0.1, 0.4]),
    "self-locking screw": lambda: lift(-0.05, 50.0, law=at_motor(0.0), drive={**SCREW, "efficiency": 0.4, "creep_speed": 0.5}),
    "voltage and brake": lambda: disc(1.0, law={"type": "voltage", "value": 48.0}, drive={
        "ratio": 10, "rotor_inertia": 1e-3, "torque_constant": 0.5, "resistance": 2.0, "efficiency": 0.8, "current_limit": 20.0, "brake": {"torque": 3.0, "from": 0.2}}),
}


@pytest.mark.twin
@pytest.mark.thorough
@pytest.mark.parametrize("case", TWINS)
def test_quadruple_precision(case: str, tmp_path: Path) -> None:
    """The same steps in 34 digits: states, losses and forces agree to rounding. Steps short enough for the screw's creep."""
    file = tmp_path / "scene.toml"
    file.write_text(linkdyn.Scene({**TWINS[case](), "time": {"end": 0.3, "samples": 4}}).text)
    runs = []
    for program in (executable(), quadruple_twin()):
        out = tmp_path / f"{len(runs)}.nc"
        subprocess.run([program, "forward", file, "-o", out, "--want", "all", "--method", "rk4", "--step", "2e-4"], capture_output=True, check=True)
        runs.append(xr.load_dataset(out))
    for name in ("q", "qd", "motor_torque", "transmission_loss", "driving_force"):
        double, quadruple = (each[name].values for each in runs)
        # a motor torque that the law holds at nought is the difference of torques of the order of 1 N*m
        size = max(np.abs(quadruple).max(), 1.0 if name == "motor_torque" else 0.0)
        assert np.abs(double - quadruple).max() <= 1e-12 * size, name


def test_gear_without_losses() -> None:
    """A law at the motor of a gear that loses nothing is n times that at the joint."""
    t = np.linspace(0, 0.5, 6)
    drive = {"ratio": 40, "rotor_inertia": 3e-5}
    one, other = (linkdyn.Scene(disc(law=law, drive=drive)).forward(t=t, **SHARP) for law in (at_motor(0.1), {"type": "constant", "value": 4.0}))
    assert np.abs(one.q.values - other.q.values).max() < 1e-10


def test_through_dead_points() -> None:
    """A crank under its motor: the piston for coordinate, which hands over to the crank on the way, is the same motion; the brake's times go along."""
    data = tomllib.loads((Path(__file__).resolve().parents[2] / "examples" / "slider_crank" / "scene.toml").read_text())
    data = {key: value for key, value in data.items() if key not in ("time", "sweep")}
    drive = {"ratio": 5, "rotor_inertia": 2e-4, "efficiency": 0.8, "brake": {"torque": 5.0, "from": 0.11, "until": 0.16}}
    data["coordinate"] = [{"joint": "A", "start": {"position": 0.6, "velocity": 40.0}}]
    data["actuator"] = [{"joint": "A", "law": at_motor("6 N*m*cos(30 rad/s*time)"), "drive": drive}]
    scene = linkdyn.Scene(data)
    t = np.linspace(0, 0.3, 31)
    run = scene.forward(t=t, want="all", **SHARP)
    other = copy.deepcopy(data)
    first = {name: float(run[name].sel(variable="D.slide")[0]) for name in ("joint_variable", "joint_rate")}
    other["coordinate"] = [{"joint": "D", "start": {"position": first["joint_variable"], "velocity": first["joint_rate"]}}]
    poses = scene.poses(run.q.values[:1])
    for k, link in enumerate(other["link"]):
        x, turn = poses.position[0, k], poses.rotation[0, k]
        link["start"] = {"position": [float(x[0]), float(x[1])], "angle": float(np.arctan2(turn[1, 0], turn[0, 0]))}
    exchanged = linkdyn.Scene(other).forward(t=t, want="all", **SHARP)
    assert "then angle of A" in exchanged.attrs["coordinates_integrated"]
    for name in ("driving_speed", "motor_torque", "brake_torque", "transmission_loss"):
        assert np.abs(exchanged[name].values - run[name].values).max() < 1e-6 * np.abs(run[name].values).max(), name
    assert np.abs(exchanged.power_imbalance).max() < 1e-11


def test_impact_through_a_gear() -> None:
    """A screw drives a mass against a stop: the rotor strikes with the efficiency's part of its inertia, and thrown back the mass has to drive it through
    the screw's efficiency backwards, with the energy that the stop gives back; at rest there the motor pushes on without a loss."""
    data = lift(0.0, 50.0, law=at_motor(3.0), drive={**SCREW, "efficiency": 0.8})
    data["stop"] = [{"name": "end", "joint": "A", "max": 0.6, "restitution": 0.5}]
    run = linkdyn.Scene(data).forward(t=np.linspace(0, 1, 11), want="all", **SHARP)
    reflected = N**2 * SCREW["rotor_inertia"]
    acceleration = (3 * N - 50 * G / 0.8) / (50 / 0.8 + reflected)
    speed = np.sqrt(2 * acceleration * 0.1)
    assert run.event_qd.values[0, 0] == pytest.approx(speed, rel=1e-6)
    before, behind = 50 + 0.8 * reflected, 50 + reflected / (2 - 1 / 0.8)
    after = 0.5 * speed * np.sqrt(before / behind)
    assert run.event_qd_after.values[0, 0] == pytest.approx(-after, rel=1e-6)
    assert run.event_impulse.values[0] == pytest.approx(before * speed + behind * after, rel=1e-6)
    assert run.q.values[-1, 0] == pytest.approx(0.6, abs=1e-9)
    assert run.driving_force.values[-1, 0] == pytest.approx(3 * N, rel=1e-9)
    np.testing.assert_allclose(run.motor_torque, 3.0, rtol=1e-9)


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
        brakes = run.motor_speed.values * run.motor_torque.values < 0
        beyond = curve["torques"][-1] * np.where(brakes, 1.0, np.maximum(0.0, 1 - (speed - 120) / 1.2))
        largest = np.minimum(0.7, np.where(speed < 120, np.interp(speed, curve["speeds"], curve["torques"]), beyond))
        np.testing.assert_allclose(run.torque_margin.values, largest - torque, atol=1e-12)


def test_margin_in_sweeps() -> None:
    """The least margin over a parameter, and the share of samples in which a limit on it is kept."""
    data = four()
    data["actuator"][0]["drive"] = {**data["actuator"][0]["drive"], "torque_limit": 0.06, "power_limit": 2.0}
    data["sweep"] = {"axis": [{"parameter": "actuator.A.drive.rotor_inertia", "values": [0.0, 1e-5, 4e-5]}, {"time": True, "linspace": [0.0, 2.0, 41]}],
                     "limit": [{"of": "torque_margin", "min": 0}]}
    swept = linkdyn.Scene(data).sweep()
    least, short = [], 0
    for inertia in (0.0, 1e-5, 4e-5):
        data["actuator"][0]["drive"]["rotor_inertia"] = inertia
        margin = linkdyn.Scene(data).inverse(t=np.linspace(0, 2, 41)).torque_margin.values
        least.append(margin.min())
        short += int((margin < 0).sum())
    np.testing.assert_allclose(swept.torque_margin_min.values.reshape(3, -1)[:, 0], least, rtol=1e-10, atol=1e-14)
    assert 0 < short < 123
    assert int(swept.outcome_count.sel(outcome="torque_margin").sum()) == short


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("method", ["rk8pd", "gbs", "seulex"])
def test_a_motor_at_its_top_speed_brakes(method: str, sense: int) -> None:
    """It comes to the end of its curve, and to 101 rad/s as exp(-50 t) beyond; told to, it brakes from there with all its torque."""
    data = disc(law=at_motor(f"{5 * sense} N*m - {10 * sense} N*m*step(time - 3 s)"), drive={"ratio": 1.0, "torque_curve": {"speeds": [0.0, 100.0], "torques": [5.0, 5.0]}})
    data["link"][0]["inertia"] = 0.1
    t = np.linspace(0, 7, 71)
    run = linkdyn.Scene(data).forward(t=t, want="all", method=method, **SHARP)
    exact = np.where(t < 2, 50 * t, np.where(t < 3, 101 - np.exp(-50 * (t - 2)), 101 - 50 * (t - 3)))
    assert np.abs(sense * run.qd.values[:, 0] - exact).max() < 1e-7
    assert np.abs(run.torque_margin).max() < 1e-6


@pytest.mark.parametrize(("start", "torque", "largest"), [
    (50.0, 9.0, 4.0), (50.0, -9.0, 4.0), (-50.0, 9.0, 4.0), (90.0, 9.0, 0.8), (90.0, -9.0, 4.0), (-90.0, 9.0, 4.0), (-90.0, -9.0, 0.8), (150.0, 9.0, 0.0), (150.0, -9.0, 4.0), (-150.0, 3.0, 3.0),
])
def test_what_drives_and_what_brakes(start: float, torque: float, largest: float) -> None:
    """A curve that ends without a torque: from its last row with one on, that one brakes."""
    curve = {"speeds": [0.0, 50.0, 100.0], "torques": [4.0, 4.0, 0.0]}
    run = linkdyn.Scene(disc(start, law=at_motor(torque), drive={"ratio": 1.0, "torque_curve": curve})).forward(t=[0.0, 1e-6], want="all", **SHARP)
    assert run.motor_torque.values[0, 0] == pytest.approx(np.sign(torque) * largest, abs=1e-12)
    assert run.torque_margin.values[0, 0] == pytest.approx((4.0 if start * torque < 0 else largest) - largest, abs=1e-12)


@pytest.mark.parametrize("voltage", [60.0, -60.0])
def test_a_winding_at_its_top_speed_brakes(voltage: float) -> None:
    """The current controller leads the current to what brakes, there too."""
    drive = {"ratio": 1.0, "torque_constant": 0.5, "resistance": 0.4, "inductance": 1e-3, "torque_curve": {"speeds": [0.0, 20.0], "torques": [2.0, 2.0]}}
    run = linkdyn.Scene(disc(25.0, law={"type": "voltage", "value": voltage}, drive=drive)).forward(t=[0.0, 0.01], want="all", **SHARP)
    assert run.motor_torque.values[-1, 0] == pytest.approx(-2.0 if voltage < 0 else 0.0, abs=1e-9)


def test_curve_from_a_file(tmp_path: Any) -> None:
    """Two columns of a table are the two lists."""
    (tmp_path / "motor.csv").write_text("n [rpm], M [N m]\n0, 4\n1500, 4\n3000, 1\n")
    rpm = np.pi / 30
    made = [{"table": "motor.csv", "speed": "n", "torque": "M"}, {"speeds": [0.0, 1500 * rpm, 3000 * rpm], "torques": [4.0, 4.0, 1.0]}]
    runs = [linkdyn.Scene(disc(law=at_motor(9.0), drive={"ratio": 10, "torque_curve": one}), folder=tmp_path).forward(t=np.linspace(0, 1, 6)) for one in made]
    np.testing.assert_array_equal(runs[0].q, runs[1].q)


def test_overload_is_told(tmp_path: Any) -> None:
    """In the summary of the command and on the sheet: which motor, where, how much."""
    data = four()
    data["actuator"][0]["drive"] = {**data["actuator"][0]["drive"], "torque_limit": 0.05}
    scene = linkdyn.Scene(data)
    run = scene.inverse(t=np.linspace(0, 2, 161), want="all")
    worst = int(run.torque_margin.values[:, 0].argmin())
    asked = float(np.abs(run.motor_torque.values[worst, 0]))
    assert run.torque_margin.values[worst, 0] == pytest.approx(0.05 - asked, rel=1e-12) and asked > 0.05
    (table,) = [table for table in sheet_page(run, scene=scene).tables if table.title == "Warnings"]
    (row,) = [row for row in table.rows if "overloaded" in row[0].text]
    assert "motor of A" in row[0].text and "available 0.05 N·m" in row[0].text and f"{asked:.4g} N·m" in row[0].text
    assert f"{run.time.values[worst]:g}" in row[1].text
    file = tmp_path / "scene.toml"
    file.write_text(scene.text)
    done = subprocess.run([executable(), "inverse", file, "-o", tmp_path / "run.nc"], capture_output=True, text=True, check=True)
    (line,) = [line for line in done.stdout.splitlines() if "overloaded" in line]
    assert "motor of 'A' in" in line and "0.0500000 N m available" in line
    # a run that is cut off there is not overloaded
    data["actuator"][0]["law"] = at_motor(-0.8)
    free = linkdyn.Scene(data).forward(t=np.linspace(0, 0.1, 5), want="all")
    assert free.torque_margin.values == pytest.approx(0.0, abs=1e-12)
    assert not any(table.title == "Warnings" for table in sheet_page(free).tables)


# ---------------------------------------------------------------- brakes


def braked(start: float, brake: dict[str, Any], torque: Any = 0.0, **drive: Any) -> dict[str, Any]:
    return disc(start, law=at_motor(torque), drive={"ratio": 10, "rotor_inertia": 1e-3, "brake": brake, **drive})


INERTIA = 0.3 + 100 * 1e-3


@pytest.mark.parametrize("method", ["gbs", "rk4", "seulex"])
def test_brake_by_the_clock(method: str) -> None:
    """Runs down evenly while the brake is on, keeps its speed before and after."""
    data = braked(20.0, {"torque": 3.0, "from": 0.2, "until": 0.31})
    t = np.linspace(0, 0.5, 26)
    run = linkdyn.Scene(data).forward(t=t, want="all", method=method, rtol=1e-10, atol=1e-12, step=1e-3)
    speed = 20 - 30 / INERTIA * np.clip(t - 0.2, 0, 0.11)
    assert np.abs(run.qd.values[:, 0] - speed).max() < 1e-9
    np.testing.assert_allclose(run.brake_torque.values[:, 0], np.where((t > 0.2 - 1e-9) & (t < 0.31), 3.0, 0.0))
    np.testing.assert_allclose(run.motor_torque, 0.0, atol=1e-12)
    turned = np.linspace(0, 0.5, 5)
    simulator = linkdyn.Scene(data).simulator(method=method, rtol=1e-10, atol=1e-12, step=1e-3)
    for k in range(1, 5):
        simulator.step(turned[k] - turned[k - 1], [0.0])
        assert simulator.qd[0] == pytest.approx(20 - 30 / INERTIA * np.clip(turned[k] - 0.2, 0, 0.11), abs=1e-8)


@pytest.mark.parametrize(("brake", "on"), [
    ({}, [True, True, True]),
    ({"until": 0.2}, [True, False, False]),
    ({"from": 0.2}, [False, True, True]),
    ({"from": 0.4, "until": 0.2}, [True, False, True]),
    ({"from": 0.2, "until": 0.4}, [False, True, False]),
    ({"from": 0.2, "begins": "on"}, [True, True, True]),
])
def test_when_a_brake_is_on(brake: dict[str, Any], on: list[bool]) -> None:
    run = linkdyn.Scene(braked(50.0, {"torque": 1.0, **brake})).forward(t=[0.0, 0.1, 0.3, 0.5], want="all")
    np.testing.assert_allclose(run.brake_torque.values[1:, 0], np.where(on, 1.0, 0.0))


def test_brake_by_events() -> None:
    """A motor whose brake comes on at an angle and lets go at another; three members of an ensemble meet them at times of their own."""
    data = braked(5.0, {"torque": 6.0, "from_event": "there", "until_event": "back", "begins": "off"}, 2.0)
    data["measures"] = {"angle": {"joint": "O"}}
    data["event"] = [{"name": "there", "when": "angle - 1.5 rad", "direction": "up"}, {"name": "back", "when": "angle - 1.8 rad", "direction": "up"}]
    scene = linkdyn.Scene(data)
    t = np.linspace(0, 0.4, 9)
    run = scene.forward(t=t, want="all", **SHARP)

    def exact(start: float) -> tuple[Any, list[float]]:
        """Speeds at t by energy: v^2 changes evenly with the angle."""
        up, down = 20 / INERTIA, -40 / INERTIA
        top = np.sqrt(start**2 + 2 * up * 1.3)
        low = np.sqrt(top**2 + 2 * down * 0.3)
        first = (top - start) / up
        second = first + (low - top) / down
        return np.where(t < first, start + up * t, np.where(t < second, top + down * (t - first), low + up * (t - second))), [first, second]

    speed, switched = exact(5.0)
    assert np.abs(run.qd.values[:, 0] - speed).max() < 1e-7
    np.testing.assert_allclose(run.event_time, switched, atol=1e-9)
    many = scene.ensemble([[0.2], [0.2], [0.2]], [[5.0], [6.0], [8.0]], t, step=1e-3)
    for k, start in enumerate((5.0, 6.0, 8.0)):
        assert np.abs(many.qd.values[k, :, 0] - exact(start)[0]).max() < 1e-6


def test_brake_holds() -> None:
    """A load on a drum: the brake holds it by its friction, creeping where torque tanh is what the load asks for; gears help it."""
    data = lift(0.0, 100.0, law=at_motor(0.0), drive={"ratio": 50, "rotor_inertia": 2e-3, "efficiency": 0.9, "creep_speed": 0.05, "brake": {"torque": 40.0}})
    run = linkdyn.Scene(data).forward(t=np.linspace(0, 3, 4), want="all", method="seulex")
    # n T_b tanh = m g (1 - c tanh) at rest, c = 1 - 0.9
    held = 100 * G / (50 * 40.0 + 0.1 * 100 * G)
    assert run.motor_speed.values[-1, 0] == pytest.approx(-0.05 * np.arctanh(held), rel=1e-6)
    assert run.driving_force.values[-1, 0] == pytest.approx(100 * G, rel=1e-6)
    assert abs(run.motor_torque.values[-1, 0]) < 1e-6
    balance = run.motor_power - run.driving_power.values - run.transmission_loss - run.brake_torque * run.motor_speed
    assert np.abs(balance).max() < 1e-9


def test_refusals() -> None:
    """From Python by the place in the scene."""
    with pytest.raises(linkdyn.errors.SceneError, match="drive"):
        linkdyn.Scene(disc(law=at_motor(1.0)))
