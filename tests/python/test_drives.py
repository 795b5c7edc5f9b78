"""Motors behind gears and screws: rotors that take a part in the motion, torque, speed, power and current. Against rotors that are links of
their own behind gears, bodies with the inertia welded on, quadrature, differences, and calculation by hand."""

from __future__ import annotations

import copy
import sys
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn import cycle
from linkdyn.cli import quadruple_twin
from linkdyn.errors import InputError
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from linkdyn._sheets.sheet import sheet_page
from sheet_file import number
from test_frame_motion import arm, four_bar, hexapod, let_go, slider_crank_in_space, swing
from test_generate import Compiled

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "hard"))

from cases import Case  # noqa: E402
from twin import forces_of, quadruple_forces  # noqa: E402

pytestmark = pytest.mark.accuracy

GEAR = {"ratio": -40.0, "rotor_inertia": 3e-5}
SCREW = {"lead": 0.01, "rotor_inertia": 2e-5, "screw_inertia": 3e-5}
SOLVERS = ("elimination", "lapack", "gauss-jordan", "reduced")


def still(scene: dict[str, Any]) -> dict[str, Any]:
    scene["frame"].pop("motion")
    return scene


def four(**law: Any) -> dict[str, Any]:
    scene = still(four_bar())
    scene["actuator"] = [{"joint": "A", "drive": GEAR, **law}]
    return scene


def on_the_coupler(**law: Any) -> dict[str, Any]:
    """Between two moving links, at a variable that is no coordinate."""
    scene = still(four_bar())
    scene["actuator"] = [{"joint": "C", "drive": GEAR, **law}]
    return scene


def of_arm(**law: Any) -> dict[str, Any]:
    scene = still(arm())
    scene["actuator"] = [{"joint": f"J{i}", "drive": SCREW if i == 3 else {**GEAR, "ratio": 150.0}, **law} for i in (1, 2, 3)]
    return scene


def of_hexapod(**law: Any) -> dict[str, Any]:
    scene = still(hexapod())
    scene["chain"][0]["actuated"] = False
    scene["actuator"] = [{"joint": f"leg{i}.P", "drive": {**SCREW, "rotor_inertia": i * 1e-5}, **law} for i in range(1, 7)]
    return scene


def of_rod(**law: Any) -> dict[str, Any]:
    """Closed by iteration; what is driven is not the coordinate."""
    scene = still(slider_crank_in_space())
    scene["coordinate"] = [{"joint": "A", "motion": swing(0.7, 3.0)}]
    scene["actuator"] = [{"joint": "D", "drive": {**SCREW, "rotor_inertia": 2e-3}, **law}]
    return scene


MAKE = [four, on_the_coupler, of_arm, of_hexapod, of_rod]


def without(scene: dict[str, Any]) -> dict[str, Any]:
    changed = copy.deepcopy(scene)
    for actuator in changed["actuator"]:
        actuator.pop("drive")
    return changed


def reflected(scene: dict[str, Any]) -> NDArray[np.float64]:
    """Of each actuator [kg, kg m^2]."""
    drives = [actuator["drive"] for actuator in scene["actuator"]]
    return np.array([(d.get("ratio") or 2 * np.pi / d["lead"]) ** 2 * (d.get("rotor_inertia", 0) + d.get("screw_inertia", 0)) for d in drives])


def accelerations(scene: linkdyn.Scene, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the driven joint variables, from their rates by differences of sixth order."""
    h = 1e-3
    weights = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60
    rates = [scene.inverse(t=t + k * h, want="power").driving_speed.values for k in range(-3, 4)]
    return np.einsum("k,kni->ni", weights, rates) / h


# ---------------------------------------------------------------- inverse


@pytest.mark.parametrize("make", MAKE)
def test_what_a_rotor_takes(make: Any) -> None:
    """The driving force grows by ratio^2 inertia times the acceleration of the joint variable; no reaction changes, and what gets to the links
    is what drove them before."""
    moving, bare = linkdyn.Scene(make()), linkdyn.Scene(without(make()))
    t = np.linspace(0.11, 1.83, 40)
    other = bare.inverse(t=t)
    taken = reflected(make()) * accelerations(bare, t)
    size = np.abs(other.driving_force.values).max() + np.abs(taken).max()
    assert np.abs(taken).max() > 0.02 * size
    for solver in SOLVERS:
        run = moving.inverse(t=t, solver=solver)
        assert (run.status == 0).all()
        assert np.abs(run.driving_force.values - other.driving_force.values - taken).max() < 1e-9 * size
        assert np.abs(run.transmission_force.values - other.driving_force.values).max() < 1e-11 * size
        assert np.abs(run.power_imbalance).max() < 1e-11
        if "reaction" in run:
            assert np.abs(run.reaction.values - other.reaction.values).max() < 1e-11 * np.abs(other.reaction.values).max()


@pytest.mark.parametrize("make", [four, of_arm, of_hexapod, of_rod])
def test_record_against_lanes(make: Any) -> None:
    """A long batch on the record, and the same sample by sample by LAPACK; errors are estimated."""
    moving = linkdyn.Scene(make())
    t = np.linspace(0.0, 2.0, 300)
    record, dense = (moving.inverse(t=t, solver=solver) for solver in ("elimination", "lapack"))
    for name in ("driving_force", "transmission_force", "motor_torque", "motor_speed", "motor_power"):
        assert np.abs(record[name].values - dense[name].values).max() < 1e-11 * np.abs(dense[name].values).max(), name
    assert moving.inverse(t=t[:20], error=True).error.max() < 1e-10


@pytest.mark.twin
@pytest.mark.parametrize("make", [four, of_hexapod])
def test_quadruple_precision(make: Any) -> None:
    moving = linkdyn.Scene(make())
    t = moving.times()[::20]
    q, qd, qdd = moving.motion(t)
    exact = quadruple_forces(quadruple_twin(), Case("drive", "drive", make(), q, qd, qdd, np.full(len(t), np.nan)), time=t)
    found = forces_of(moving.inverse(t=t, want=("driving_force", "reaction")))
    assert np.abs(found - exact).max() < 1e-12 * np.abs(exact).max()


def geared(ratio: float, inertia: float) -> dict[str, Any]:
    """The four-bar's crank with a rotor that is a link of its own, and a pair of gears."""
    scene = without(four())
    scene["frame"]["markers"]["M"] = [0.1 + 0.01 * (1 + ratio), 0.2]
    scene["link"].append({"name": "rotor", "markers": {"M": [0, 0]}, "mass": 0.4, "inertia": inertia})
    scene["joint"] += [{"name": "M", "type": "revolute", "between": ["frame.M", "rotor.M"]},
                       {"name": "mesh", "type": "gear", "between": ["crank.A", "rotor.M"], "teeth": [10 * ratio, 10]}]
    return scene


def test_rotor_as_a_link_behind_gears() -> None:
    """The same machine with wheels that mesh."""
    ratio = 40.0
    t = np.linspace(0, 2, 60)
    scene = four()
    scene["actuator"][0]["drive"] = {"ratio": ratio, "rotor_inertia": 3e-5}
    run, other = linkdyn.Scene(scene).inverse(t=t), linkdyn.Scene(geared(ratio, 3e-5)).inverse(t=t)
    np.testing.assert_allclose(run.driving_force, other.driving_force, rtol=0, atol=1e-10 * np.abs(other.driving_force).max())
    free, others = let_go({**scene, "frame": {**scene["frame"], "motion": {}}}), let_go(geared(ratio, 3e-5))
    runs = [linkdyn.Scene(one).forward(t=t, rtol=1e-11, atol=1e-12, want="all") for one in (free, others)]
    assert np.abs(runs[0].q.values - runs[1].q.values).max() < 1e-8
    np.testing.assert_allclose(runs[0].kinetic_energy, runs[1].kinetic_energy, rtol=1e-6, atol=1e-8)


# ---------------------------------------------------------------- forward


@pytest.mark.parametrize("make", MAKE)
@pytest.mark.parametrize("solver", SOLVERS)
def test_forward_keeps_the_equations(make: Any, solver: str) -> None:
    """Accelerations of a free run, given to inverse dynamics, ask for the forces that acted; on lanes (short) and on the record; energies close."""
    scene = let_go(make())
    if "chain" not in scene:
        for actuator in scene["actuator"]:
            actuator["law"] = {"type": "constant", "value": 0.6}
    scene["actuator"] = [{**made, **given} for made, given in zip(make()["actuator"], scene["actuator"])]
    moving = linkdyn.Scene(scene)
    want = ["driving_force", "power", "checks", "motor", "joint_variable"]
    for end in (0.02, 0.6) if solver == "elimination" else (0.02,):
        run = moving.forward(t=np.linspace(0, end, 11), solver=solver, rtol=1e-10, atol=1e-11, want=want)
        assert (run.status == 0).all() and not run.attrs["stopped"]
        again = moving.inverse(run.q.values, run.qd.values, run.qdd.values)
        size = np.abs(again.driving_force.values).max() + np.abs(again.transmission_force.values).max()
        assert np.abs(run.driving_force.values - again.driving_force.values).max() < 1e-7 * size
        assert np.abs(run.transmission_force.values - again.transmission_force.values).max() < 1e-7 * size
        assert np.abs(run.power_imbalance).max() < 1e-9
        if "chain" not in scene:
            energy = (run.kinetic_energy + run.potential_energy - run.work).values
            if "spring" not in scene:
                assert np.ptp(energy) < 1e-7 * max(1.0, np.abs(run.kinetic_energy).max())
            rotors = 0.5 * (reflected(scene) * run.driving_speed.values**2).sum(axis=1)
            links = linkdyn.Scene(without(scene)).forward(t=[0.0, 1e-9], want=["power"]).kinetic_energy.values[0]
            assert run.kinetic_energy.values[0] == pytest.approx(links + rotors[0], rel=1e-7)


@pytest.mark.parametrize("make", MAKE)
def test_mass_matrix(make: Any) -> None:
    """M grows by ratio^2 inertia (ds/dq)(ds/dq)^T: columns by inverse dynamics of unit accelerations, rates of the joint by unit rates."""
    moving, bare = linkdyn.Scene(make()), linkdyn.Scene(without(make()))
    q = moving.motion([0.37])[0]
    n = q.shape[1]
    rows = np.repeat(q, n, axis=0)
    rate = bare.inverse(rows, np.eye(n), 0 * rows, want="power").driving_speed.values          # (coordinate, actuator): ds/dq
    names = list(moving.actuators)

    def matrix(scene: linkdyn.Scene) -> NDArray[np.float64]:
        force = [scene.inverse(rows, 0 * rows, qdd).driving_force.values for qdd in (np.eye(n), 0 * np.eye(n))]
        return (force[0] - force[1]) @ rate.T                                                  # generalized forces of the coordinates

    if make is of_hexapod:
        return                                    # rates of a pose's angles are no columns of its turning: tested by forces above
    difference = matrix(moving) - matrix(bare)
    expected = rate @ np.diag(reflected(make())) @ rate.T
    assert len(names) == rate.shape[1]
    np.testing.assert_allclose(difference, expected, rtol=1e-8, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("make", MAKE)
def test_forward_after_inverse(make: Any) -> None:
    """Law `inverse` gives back the motion; so does the recorded motor torque of a drive without losses, times its ratio."""
    moving = linkdyn.Scene(make())
    t = np.linspace(0, 0.7, 15)
    run = moving.forward(t=t, rtol=1e-11, atol=1e-12)
    assert np.abs(run.q.values - moving.motion(t)[0]).max() < 1e-7
    torque = moving.inverse(t=t)
    ratio = np.array([2 * np.pi / d["lead"] if "lead" in d else d["ratio"] for d in (a["drive"] for a in make()["actuator"])])
    np.testing.assert_allclose(torque.motor_torque * ratio, torque.driving_force.values, rtol=1e-9, atol=1e-9 * np.abs(torque.driving_force).max())


def test_recorded_motor_torque_gives_back_the_motion(tmp_path: Path) -> None:
    """As a table over time."""
    scene = linkdyn.Scene(four())
    t = np.linspace(0, 1, 2001)
    run = scene.inverse(t=t)
    rows = [f"{a:.17g},{b:.17g}" for a, b in zip(t, -40.0 * run.motor_torque.values[:, 0])]
    (tmp_path / "torque.csv").write_text("t [s],torque [N m]\n" + "\n".join(rows) + "\n")
    content = four(law={"type": "table", "table": "torque.csv", "column": "torque", "interpolation": "spline"})
    again = linkdyn.Scene(content, folder=tmp_path).forward(t=t[::100], rtol=1e-10, atol=1e-11)
    assert np.abs(again.q.values - run.q.values[::100]).max() < 1e-6


def pendulum(**actuator: Any) -> dict[str, Any]:
    return {
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"O": [0, 0]}}, "time": {"end": 4, "samples": 161},
        "link": [{"name": "arm", "mass": 1.5, "cog": [0, -0.4], "inertia": 0.02, "markers": {"O": [0, 0]}}],
        "joint": [{"name": "O", "type": "revolute", "between": ["frame.O", "arm.O"]}], "coordinate": [{"joint": "O", "start": 0.6}],
        "actuator": [{"joint": "O", "law": {"type": "constant", "value": 0.5}, **actuator}],
    }


def test_pendulum_with_the_inertia_welded_on() -> None:
    """At a pin of the frame the rotor is a disc on the arm."""
    t = np.linspace(0, 4, 41)
    welded = pendulum()
    welded["link"][0]["inertia"] = 0.02 + 50**2 * 4e-5
    run, other = (linkdyn.Scene(one).forward(t=t, rtol=1e-11, atol=1e-12, want="all") for one in (pendulum(drive={"ratio": 50, "rotor_inertia": 4e-5}), welded))
    assert np.abs(run.q.values - other.q.values).max() < 1e-9
    np.testing.assert_allclose(run.kinetic_energy, other.kinetic_energy, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(run.driving_force, 0.5)
    np.testing.assert_allclose(run.motor_speed.values[:, 0], 50 * run.qd.values[:, 0])
    simulator = linkdyn.Scene(pendulum(drive={"ratio": 50, "rotor_inertia": 4e-5})).simulator(rtol=1e-11, atol=1e-12)
    for _ in range(10):
        simulator.step(0.1, [0.5])
    assert abs(simulator.q[0] - run.q.values[10, 0]) < 1e-8
    many = linkdyn.Scene(pendulum(drive={"ratio": 50, "rotor_inertia": 4e-5})).ensemble(np.full((20, 1), 0.6), np.zeros((20, 1)), t[:11], step=1e-3)
    assert np.abs(many.q.values - run.q.values[np.newaxis, :11]).max() < 1e-8


def test_start_of_a_crank_against_quadrature() -> None:
    """A slider-crank of which only the piston has mass, from rest by a constant torque: the energy at an angle gives the speed, a quadrature
    the time."""
    crank, rod, mass, torque, inertia = 0.05, 0.2, 0.8, 2.0, 30.0**2 * 1e-5
    scene = {
        "space": "planar", "frame": {"markers": {"A": [0, 0], "guide": {"at": [0, 0], "axis": [1, 0]}}}, "time": {"end": 1.0},
        "link": [{"name": "crank", "markers": {"A": [0, 0], "B": [crank, 0]}, "mass": 0}, {"name": "rod", "markers": {"B": [0, 0], "C": [rod, 0]}, "mass": 0},
                 {"name": "piston", "markers": {"C": {"at": [0, 0], "axis": [1, 0]}}, "mass": mass}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]}, {"name": "B", "type": "revolute", "between": ["crank.B", "rod.B"]},
                  {"name": "C", "type": "revolute", "between": ["rod.C", "piston.C"]},
                  {"name": "guide", "type": "prismatic", "between": ["frame.guide", "piston.C"], "start": crank + rod}],
        "coordinate": [{"joint": "A", "start": {"position": 0.5}}],
        "actuator": [{"joint": "A", "law": {"type": "constant", "value": torque}, "drive": {"ratio": 30, "rotor_inertia": 1e-5}}],
    }
    t = np.linspace(0, 0.6, 13)
    run = linkdyn.Scene(scene).forward(t=t, rtol=1e-11, atol=1e-12)

    def whole(angle: float) -> float:
        slope = -crank * np.sin(angle) - crank**2 * np.sin(angle) * np.cos(angle) / np.sqrt(rod**2 - (crank * np.sin(angle)) ** 2)
        return inertia + mass * slope**2

    assert run.q.values[-1, 0] > 20.0
    for k in (3, 7, 12):
        end = float(run.q.values[k, 0])
        # with angle = 0.5 + u^2 the integrand has no pole at the start
        time = quad(lambda u: 2 * u * np.sqrt(whole(0.5 + u * u) / (2 * torque * u * u)), 0, np.sqrt(end - 0.5), epsabs=1e-11, epsrel=1e-11, limit=400)[0]
        assert time == pytest.approx(t[k], rel=1e-8)


def test_cart_on_a_screw() -> None:
    """m + (2 pi/lead)^2 J; and a rotor between two moving carts feels their distance alone."""
    def cart(name: str, mass: float) -> dict[str, Any]:
        return {"name": name, "mass": mass, "inertia": 1.0, "markers": {"P": {"at": [0, 0], "axis": [1, 0]}}}

    scene = {
        "space": "planar", "frame": {"markers": {"P": {"at": [0, 0], "axis": [1, 0]}}}, "time": {"end": 1.0}, "link": [cart("one", 3.0), cart("two", 2.0)],
        "joint": [{"name": "X", "type": "prismatic", "between": ["frame.P", "one.P"]}, {"name": "Y", "type": "prismatic", "between": ["one.P", "two.P"]}],
        "coordinate": [{"joint": "X", "start": 0.0}, {"joint": "Y", "start": 0.0}],
        "actuator": [{"joint": "Y", "law": {"type": "constant", "value": 7.0}, "drive": {"lead": 0.02, "rotor_inertia": 5e-5}}],
    }
    inertia = (2 * np.pi / 0.02) ** 2 * 5e-5
    mass = np.array([[5.0, 2.0], [2.0, 2.0 + inertia]])
    expected = np.linalg.solve(mass, [0.0, 7.0])
    for solver in SOLVERS:
        run = linkdyn.Scene(scene).forward(t=np.linspace(0, 1, 5), solver=solver, want=["driving_force", "motor"])
        np.testing.assert_allclose(run.qdd, np.tile(expected, (5, 1)), rtol=1e-12)
        np.testing.assert_allclose(run.transmission_force.values[:, 0], 7.0 - inertia * expected[1], rtol=1e-11)


def test_coordinates_are_exchanged() -> None:
    """A rotor on the rocker, which is the coordinate and comes to its dead points: the energy stays."""
    scene = still(four_bar())
    scene.pop("gravity")
    scene.pop("spring")
    scene["coordinate"] = [{"joint": "D", "start": {"position": 2.0, "velocity": 4.0}}]
    scene["actuator"] = [{"joint": "D", "law": {"type": "constant", "value": 0.0}, "drive": {"ratio": 30, "rotor_inertia": 2e-5}}]
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 3, 61), rtol=1e-10, atol=1e-11, want="all")
    assert (run.status == 0).all() and not run.attrs["stopped"]
    assert (run.stand_in > 0).any()
    assert np.ptp(run.kinetic_energy.values) < 1e-6 * run.kinetic_energy.values[0]
    speed = run.joint_rate.sel(variable="D.angle").values
    assert 0.5 * 30**2 * 2e-5 * speed.max() ** 2 > 0.02 * run.kinetic_energy.values[0]


def test_driven_coordinates_beside_free_ones() -> None:
    """One hinge of the arm follows its law, the other swings: rotors of both kinds."""
    scene = let_go(of_arm())
    scene["coordinate"][0] = {"joint": "J1", "motion": swing(0.7, 2.0), "driven": True}
    scene["actuator"] = [{**made, "law": law["law"]} for made, law in zip(of_arm()["actuator"], scene["actuator"])]
    scene["actuator"][0].pop("law")
    t = np.linspace(0, 0.5, 11)
    for solver in SOLVERS:
        moving = linkdyn.Scene(scene)
        run = moving.forward(t=t, solver=solver, rtol=1e-10, atol=1e-11, want=["driving_force", "motor", "checks", "power"])
        again = moving.inverse(run.q.values, run.qd.values, run.qdd.values)
        size = np.abs(again.driving_force.values).max()
        assert np.abs(run.driving_force.values - again.driving_force.values).max() < 1e-8 * size
        assert np.abs(run.power_imbalance).max() < 1e-9


# ---------------------------------------------------------------- motors


def lift(motion: dict[str, Any], drive: dict[str, Any], **more: Any) -> linkdyn.Scene:
    """A mass of 100 kg, lifted and lowered."""
    return linkdyn.Scene({
        "space": "planar", "gravity": [0.0, -9.81], "frame": {"markers": {"A": {"at": [0.0, 0.0], "axis": [0.0, 1.0]}}},
        "link": [{"name": "table", "mass": 100.0, "inertia": 1.0, "markers": {"A": {"at": [0.0, 0.0], "axis": [0.0, 1.0]}}}],
        "joint": [{"name": "A", "type": "prismatic", "between": ["frame.A", "table.A"]}], "coordinate": [{"joint": "A", "motion": motion}],
        "actuator": [{"joint": "A", "drive": drive}], "time": {"end": 2.0, "samples": 401}, **more,
    })


HARMONIC = {"law": "harmonic", "amplitude": 0.1, "frequency": "3 rad/s"}
BALL_SCREW = {"lead": "5 mm", "rotor_inertia": "1.5e-4 kg m^2", "screw_inertia": "0.5e-4 kg m^2", "efficiency": "50 %", "torque_constant": "0.6 N m/A"}


def test_screw_by_hand() -> None:
    """Lead 5 mm, half of the power lost: up at twice the torque, down with none to hold (2 - 1/0.5 = 0); the rotor takes its own."""
    scene = lift(HARMONIC, BALL_SCREW)
    run = scene.inverse()
    t = run.time.values
    speed, acceleration = 0.3 * np.cos(3 * t), -0.9 * np.sin(3 * t)
    force, n = 100 * (9.81 + acceleration), 2 * np.pi / 0.005
    expected = force / n * np.where(speed > 0, 2.0, 0.0) + 2e-4 * n * acceleration
    np.testing.assert_allclose(run.motor_torque.values[:, 0], expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(run.motor_speed.values[:, 0], n * speed, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(run.motor_power, run.motor_torque * run.motor_speed)
    np.testing.assert_allclose(run.motor_current, run.motor_torque / 0.6)
    np.testing.assert_allclose(run.driving_force.values[:, 0], force + 2e-4 * n**2 * acceleration, rtol=1e-10)
    assert run.motor_torque.attrs["units"] == "N m" and run.motor_current.attrs["units"] == "A"
    assert "self-locking" in scene.explain()
    assert "self-locking" not in lift(HARMONIC, {**BALL_SCREW, "efficiency": 0.8}).explain()


def test_what_is_lost_is_never_gained() -> None:
    """The motor's power, less that of the rotor and of the load, is friction."""
    for drive in (BALL_SCREW, {**BALL_SCREW, "efficiency": 0.3}, {"ratio": "-900 rad/m", "efficiency": 0.7, "rotor_inertia": 1e-4}):
        run = lift(HARMONIC, drive).inverse()
        rotor = (run.driving_force.values - run.transmission_force.values) * run.driving_speed.values
        loss = run.motor_power.values - rotor - run.transmission_force.values * run.driving_speed.values
        assert loss.min() > -1e-9 and loss.max() > 50.0


def test_standstill_takes_no_side() -> None:
    run = lift({"law": "constant-rate", "rate": "0 m/s"}, {"lead": 0.01, "efficiency": 0.35}).inverse()
    assert run.motor_torque.values == pytest.approx(100 * 9.81 * 0.01 / (2 * np.pi))


def test_the_accessor_takes_the_scenes_drive() -> None:
    """`run.linkdyn.motor` without keys tells of the scene's drive; with keys it agrees with it."""
    run = lift(HARMONIC, BALL_SCREW).inverse()
    found = run.linkdyn.motor("A")
    np.testing.assert_array_equal(found.motor_torque, run.motor_torque.values[:, 0])
    np.testing.assert_array_equal(found.motor_current, run.motor_current.values[:, 0])
    assert found.attrs["self_locking"] == 1
    bare = lift(HARMONIC, {"lead": 1.0}).with_({"actuator.A.drive": None}).inverse()
    other = bare.linkdyn.motor("A", lead=0.005, efficiency=0.5, inertia=2e-4, torque_constant=0.6)
    for name in ("motor_torque", "motor_speed", "motor_power", "motor_current", "rms_torque", "peak_torque", "peak_speed", "rms_current"):
        np.testing.assert_allclose(other[name], found[name], rtol=1e-9, atol=1e-9)
    with pytest.raises(InputError, match=r"^motor: the scene has a drive at 'A' \(expected no keys"):
        run.linkdyn.motor("A", lead=0.01)


def test_sweep() -> None:
    """Motor torque over the rotor's inertia, which is varied, and limits on it."""
    table = {"axis": [{"parameter": "actuator.A.drive.rotor_inertia", "values": [0.0, 1e-4, 4e-4]}, {"time": True, "linspace": [0.0, 2.0, 41]}],
             "reduce": ["motor_torque", "motor_speed", "motor_power", "motor_current"], "limit": [{"of": "motor_torque", "max": "1.5 N*m"}]}
    swept = lift(HARMONIC, BALL_SCREW, sweep=table).sweep()
    for k, inertia in enumerate((0.0, 1e-4, 4e-4)):
        run = lift(HARMONIC, {**BALL_SCREW, "rotor_inertia": inertia}).inverse(t=np.linspace(0, 2, 41))
        for name in ("motor_torque", "motor_speed", "motor_power", "motor_current"):
            assert float(swept[f"{name}_max"].values.reshape(3, -1)[k, 0]) == pytest.approx(float(run[name].max()), rel=1e-12), name


def test_causes_add_up() -> None:
    """The rotor's part is one of inertia."""
    scene = linkdyn.Scene(of_arm())
    run = scene.inverse()
    parts = cycle.contributions(run, scene)
    assert np.abs(parts.driving_force.sum("cause").values - run.driving_force.values).max() < 1e-9 * np.abs(run.driving_force.values).max()


@pytest.mark.parametrize("make", [four, of_hexapod])
def test_generated_code(make: Any, tmp_path: Path) -> None:
    """What a controller computes has the rotors in it."""
    scene = linkdyn.Scene(make())
    compiled = Compiled(scene.generate(want="all", name="kernel"), tmp_path)
    q, qd, qdd = scene.motion(np.linspace(0.1, 1.9, 5))
    expected = scene.solve(q, qd, qdd)["driving_force"]
    for i in range(5):
        status, found = compiled(q=q[i], qd=qd[i], qdd=qdd[i])
        assert status == 0
        assert np.abs(found["driving_force"] - expected[i]).max() < 1e-11 * np.abs(expected).max()


@pytest.mark.parametrize("make", [four, of_arm, of_hexapod])
def test_generated_code_of_forward_dynamics(make: Any, tmp_path: Path) -> None:
    """Accelerations by driving forces, for which inverse dynamics asks for these."""
    scene = linkdyn.Scene(make())
    compiled = Compiled(scene.generate("forward", name="kernel"), tmp_path)
    q, qd, qdd = scene.motion(np.linspace(0.1, 1.9, 5))
    force = scene.solve(q, qd, qdd)["driving_force"]
    for i in range(5):
        status, found = compiled(q=q[i], qd=qd[i], driving_force=force[i])
        assert status == 0
        back = scene.solve(q[i : i + 1], qd[i : i + 1], [found["qdd"]])["driving_force"]
        assert np.abs(back - force[i]).max() < 1e-10 * np.abs(force).max()


def test_dc_motor_and_its_rotor() -> None:
    """The law's gear is that of the drive: n^2 J + link, against its differential equation."""
    law = {"type": "dc-motor", "n": 20, "eta": 1.0, "K_T": 0.1, "K_E": 0.1, "K_P": 30.0, "R_a": 2.0, "target": 1.0}
    scene = pendulum(law=law, drive={"ratio": 20, "rotor_inertia": 8e-5, "torque_constant": 0.1})
    t = np.linspace(0, 2, 21)
    run = linkdyn.Scene(scene).forward(t=t, rtol=1e-11, atol=1e-12, want="all")
    inertia = 0.02 + 1.5 * 0.16 + 400 * 8e-5

    def rate(_: float, y: NDArray[np.float64]) -> list[float]:
        torque = 20 * 0.1 * (30 * (1 - y[0]) - 0.1 * 20 * y[1]) / 2
        return [y[1], (torque - 1.5 * 9.81 * 0.4 * np.sin(y[0])) / inertia]

    exact = solve_ivp(rate, (0, 2), [0.6, 0.0], method="DOP853", rtol=1e-12, atol=1e-13, t_eval=t).y
    assert np.abs(run.q.values[:, 0] - exact[0]).max() < 1e-8
    np.testing.assert_allclose(run.motor_current.values[:, 0], (30 * (1 - exact[0]) - 2 * exact[1]) / 2, atol=1e-6)


# ---------------------------------------------------------------- with all else


def test_friction_comes_from_what_gets_to_the_links() -> None:
    """Friction and rotors beside each other: the rotor changes neither reactions nor friction; a free run keeps the equations."""
    scene = of_arm()
    scene["friction"] = [{"joint": f"J{i}", "coulomb": 0.1, "radius": 0.03, "length": 0.2} for i in (1, 2)]
    moving, bare = linkdyn.Scene(scene), linkdyn.Scene(without(scene))
    t = np.linspace(0.11, 1.83, 40)
    run, other = moving.inverse(t=t), bare.inverse(t=t)
    np.testing.assert_allclose(run.friction_power, other.friction_power, rtol=1e-9, atol=1e-10)
    taken = reflected(scene) * accelerations(bare, t)
    assert np.abs(run.driving_force.values - other.driving_force.values - taken).max() < 1e-8 * np.abs(run.driving_force.values).max()
    assert np.abs(run.power_imbalance).max() < 1e-11
    for solver in ("elimination", "lapack"):
        again = moving.forward(t=np.linspace(0, 0.3, 7), solver=solver, rtol=1e-9, atol=1e-10)
        assert np.abs(again.q.values - moving.motion(again.time.values)[0]).max() < 1e-6


@pytest.mark.parametrize("make", [of_arm, of_hexapod])
def test_on_a_frame_that_moves(make: Any) -> None:
    """As seen from the frame: the rotor takes the same."""
    scene = make()
    scene["frame"]["motion"] = {"z": swing(0.4, 2.5, 0.1), "roll": swing(0.5, 2.2, 0.3, 0.1)}
    moving, bare = linkdyn.Scene(scene), linkdyn.Scene(without(scene))
    t = np.linspace(0.11, 1.83, 40)
    taken = reflected(scene) * accelerations(bare, t)
    for solver in ("elimination", "lapack", "reduced"):
        run, other = moving.inverse(t=t, solver=solver), bare.inverse(t=t)
        assert np.abs(run.driving_force.values - other.driving_force.values - taken).max() < 1e-8 * np.abs(run.driving_force.values).max()
        assert np.abs(run.power_imbalance).max() < 1e-11


def test_drives_that_share_the_work() -> None:
    """Two motors on the four-bar: they share what gets to the links, and each has its rotor besides."""
    scene = still(four_bar())
    scene["actuator"] = [{"joint": "A", "drive": GEAR}, {"joint": "D", "share": 2.0, "drive": {**GEAR, "rotor_inertia": 5e-5}}]
    moving, bare = linkdyn.Scene(scene), linkdyn.Scene(without(scene))
    t = np.linspace(0.11, 1.83, 40)
    taken = reflected(scene) * accelerations(bare, t)
    other = bare.inverse(t=t)
    for solver in ("elimination", "lapack", "reduced"):
        run = moving.inverse(t=t, solver=solver)
        assert np.abs(run.driving_force.values - other.driving_force.values - taken).max() < 1e-8 * np.abs(run.driving_force.values).max()
        assert np.abs(run.transmission_force.values - other.driving_force.values).max() < 1e-10 * np.abs(other.driving_force.values).max()
        assert np.abs(run.power_imbalance).max() < 1e-11


def test_impact_with_a_rotor() -> None:
    """What strikes a stop brings the rotor's inertia: as with a disc welded on, impulse and all."""
    def stopped(**actuator: Any) -> dict[str, Any]:
        scene = pendulum(**actuator)
        scene["stop"] = [{"name": "S", "joint": "O", "min": -0.2, "restitution": 0.6}]
        return scene

    t = np.linspace(0, 3, 31)
    welded = stopped()
    welded["link"][0]["inertia"] = 0.02 + 50**2 * 4e-5
    run, other = (linkdyn.Scene(one).forward(t=t, rtol=1e-11, atol=1e-12) for one in (stopped(drive={"ratio": 50, "rotor_inertia": 4e-5}), welded))
    assert run.sizes["event"] > 1
    assert np.abs(run.q.values - other.q.values).max() < 1e-8
    np.testing.assert_allclose(run.event_impulse, other.event_impulse, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("name", ["screw_lift", "geared_fivebar"])
def test_screw_joints_and_gears(name: str) -> None:
    """Driven joints of other kinds."""
    scene = linkdyn.load(ROOT / "examples" / name / "scene.toml")
    actuators = list(scene.actuators)
    moving = scene.with_({f"actuator.{one}.drive": {"ratio": 20, "rotor_inertia": 2e-4} for one in actuators})
    time = scene.times()
    t = time[0] + (time[-1] - time[0]) * np.linspace(0.1, 0.9, 30)
    taken = 400 * 2e-4 * accelerations(scene, t)
    for solver in SOLVERS:
        run, other = moving.inverse(t=t, solver=solver), scene.inverse(t=t)
        assert np.abs(run.driving_force.values - other.driving_force.values - taken).max() < 1e-7 * np.abs(run.driving_force.values).max()
        assert np.abs(run.power_imbalance).max() < 1e-10
    again = moving.forward(t=time[time <= time[0] + 0.2 * (time[-1] - time[0])], rtol=1e-10, atol=1e-11)
    assert np.abs(again.q.values - moving.motion(again.time.values)[0]).max() < 1e-6


def test_released_joints() -> None:
    """A loop with more constraints than needed, driven where a joint lets go of what others hold."""
    scene = linkdyn.load(ROOT / "examples" / "agile_eye" / "scene.toml")
    moving = scene.with_({"actuator.motor#.drive": {"ratio": 30, "rotor_inertia": 1e-4}})
    time = scene.times()
    t = time[0] + (time[-1] - time[0]) * np.linspace(0.1, 0.9, 20)
    taken = 900 * 1e-4 * accelerations(scene, t)
    for solver in ("elimination", "lapack"):
        run, other = moving.inverse(t=t, solver=solver, want=["driving_force", "checks"]), scene.inverse(t=t)
        assert np.abs(run.driving_force.values - other.driving_force.values - taken).max() < 1e-6 * np.abs(run.driving_force.values).max()


def test_errors_of_a_free_run() -> None:
    run = linkdyn.Scene(pendulum(drive={"ratio": 50, "rotor_inertia": 4e-5})).forward(t=np.linspace(0, 2, 11), error=True)
    assert (run.q_error < 1e-6).all() and (run.driving_force_error.values < 1e-6).all()


def test_sheet_tells_of_motors() -> None:
    scene = linkdyn.load(ROOT / "examples" / "toggle_clamp" / "scene.toml").with_({"actuator.nut.drive.efficiency": 0.4})
    run = scene.inverse()
    (table,) = [table for table in sheet_page(run, scene=scene).tables if table.title == "Motors"]
    assert table.rows[0][-1].text == "yes"
    assert number(table.rows[0][1]) == pytest.approx(float(np.abs(run.motor_torque).max()), rel=1e-2)


def test_a_drive_without_inertia_costs_nothing() -> None:
    """Bit for bit what it was."""
    scene = four()
    scene["actuator"][0]["drive"] = {"ratio": 40, "efficiency": 0.9}
    for solver in SOLVERS:
        run, other = (linkdyn.Scene(one).inverse(solver=solver) for one in (scene, without(scene)))
        np.testing.assert_array_equal(run.driving_force, other.driving_force)
