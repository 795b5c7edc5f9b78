"""Linearizations: against closed forms, differences of inverse dynamics solved densely and of ensembles, runs, and what is refused."""

from __future__ import annotations

import math
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn.errors import InputError, UnavailableError
from scipy import linalg, signal

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

PENDULUM: dict[str, Any] = {
    "space": "planar",
    "gravity": [0.0, -9.81],
    "frame": {"markers": {"O": [0.0, 0.0]}},
    "link": [{"name": "bob", "mass": 2.0, "inertia": 0.05, "cog": [0.0, -0.4], "markers": {"O": [0.0, 0.0]}}],
    "joint": [{"name": "pin", "type": "revolute", "between": ["frame.O", "bob.O"]}],
    "coordinate": [{"joint": "pin", "start": {"position": 0.0, "velocity": 0.0}}],
    "spring": [{"name": "coil", "joint": "pin", "stiffness": 3.0, "damping": 0.4}],
    "actuator": [{"joint": "pin"}],
}
INERTIA = 0.05 + 2.0 * 0.4**2


def example(name: str) -> linkdyn.Scene:
    return linkdyn.load(EXAMPLES / name / "scene.toml")


def slopes(f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, h: float) -> np.ndarray:
    """Columns by each number of x, by differences of order 6 extrapolated once; f takes rows."""

    def by_steps(h: float) -> np.ndarray:
        steps, weights = np.array([-3, -2, -1, 1, 2, 3]), np.array([-1, 9, -45, 45, -9, 1]) / 60
        places = np.array([x + k * h * unit for unit in np.eye(len(x)) for k in steps])
        return np.einsum("k,nkm->mn", weights, f(places).reshape(len(x), len(steps), -1)) / h

    return (64 * by_steps(h / 2) - by_steps(h)) / 63


def by_inverse_dynamics(scene: linkdyn.Scene, lin: Any, h: float, h_rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What A and B should be where a drive moves each coordinate: u(q, q', q'') = u, by LAPACK on lanes."""
    n = len(scene.coordinates)
    q, qd, qdd, t = lin.x.values[:n], lin.x.values[n:], lin.residual.values[n:], float(lin.time)

    def force(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        rows = max(len(np.atleast_2d(v)) for v in (q, qd, qdd))
        given = (np.array(np.broadcast_to(v, (rows, n))) for v in (q, qd, qdd))
        return scene.inverse(*given, t=np.full(rows, t), solver="lapack", want="driving_force").driving_force.values

    mass = np.linalg.inv(slopes(lambda at: force(q, qd, at), qdd, h_rate))
    stiffness = slopes(lambda at: force(at, qd, qdd), q, h)
    damping = slopes(lambda at: force(q, at, qdd), qd, h_rate)
    return -mass @ stiffness, -mass @ damping, mass


def accelerations(scene: linkdyn.Scene, states: np.ndarray, t: float, dt: float) -> np.ndarray:
    """At the beginning of forward runs, from their rates after times that halve."""
    n = states.shape[1] // 2
    found = []
    for step in dt / 2.0 ** np.arange(5):
        qd = scene.ensemble(states[:, :n].copy(), states[:, n:].copy(), [t, t + step], step=step).qd.values
        found.append((qd[:, 1] - qd[:, 0]) / step)
    for m in range(1, 5):
        found = [(2**m * later - sooner) / (2**m - 1) for sooner, later in zip(found, found[1:])]
    return found[0]


def check_against_runs(scene: linkdyn.Scene, dt: float = 1e-4, **state: Any) -> Any:
    """A as forward runs have it, which know nothing of it."""
    lin = scene.linearize(**state)
    n, t = len(scene.coordinates), float(lin.time)
    there = accelerations(scene, lin.x.values[None], t, dt)[0]
    expected = slopes(lambda at: accelerations(scene, at, t, dt), lin.x.values, 2e-3)
    np.testing.assert_allclose(lin.residual.values[n:], there, atol=1e-9 * max(1.0, np.abs(there).max()))
    np.testing.assert_allclose(lin.A.values[n:], expected, atol=1e-8 * max(1.0, np.abs(expected).max()))
    return lin


# ---------------------------------------------------------------- closed forms


def test_pendulum() -> None:
    """A spring and a damper at its pin: J q'' = u - m g l sin q - k q - c q'."""
    scene = linkdyn.Scene(PENDULUM)
    lin = scene.linearize()
    weight = 2.0 * 9.81 * 0.4
    np.testing.assert_allclose(lin.A, [[0, 1], [-(weight + 3.0) / INERTIA, -0.4 / INERTIA]], rtol=1e-14)
    np.testing.assert_allclose(lin.B, [[0], [1 / INERTIA]], rtol=1e-14)
    assert (lin.C.values == np.eye(2)).all() and (lin.D.values == 0).all() and lin.is_equilibrium == 1
    assert list(lin.state.values) == ["q[pin]", "qd[pin]"] and list(lin.input.values) == ["effort[pin]"]
    assert list(lin.state_unit.values) == ["rad", "rad/s"] and list(lin.input_unit.values) == ["N m"]
    omega = math.sqrt((weight + 3.0) / INERTIA)
    np.testing.assert_allclose(lin.frequency, [omega / (2 * math.pi)] * 2, rtol=1e-14)
    np.testing.assert_allclose(lin.damping_ratio, [0.4 / (2 * INERTIA * omega)] * 2, rtol=1e-12)
    np.testing.assert_allclose(lin.growth.values + 1j * lin.angular_frequency.values, np.roots([INERTIA, 0.4, weight + 3.0]), rtol=1e-12)
    tilted = scene.linearize(q=[0.7], qd=[0.3], effort=[1.5])
    np.testing.assert_allclose(tilted.A[1], [-(weight * math.cos(0.7) + 3.0) / INERTIA, -0.4 / INERTIA], rtol=1e-13)
    np.testing.assert_allclose(tilted.residual, [0.3, (1.5 - weight * math.sin(0.7) - 3.0 * 0.7 - 0.4 * 0.3) / INERTIA], rtol=1e-13)
    assert tilted.is_equilibrium == 0 and tilted.u.values == [1.5]


def test_an_effort_that_keeps_the_state() -> None:
    """Of an actuator without a law, where none is given."""
    lin = linkdyn.Scene(PENDULUM).linearize(q=[0.7])
    assert lin.is_equilibrium == 1
    assert lin.u.values == pytest.approx([2.0 * 9.81 * 0.4 * math.sin(0.7) + 3.0 * 0.7], rel=1e-14)


def test_pole_on_a_cart() -> None:
    """Upright, by hand; the pole falls at the rate of its real pole."""
    lin = example("cart_pole").linearize(q=[0, 0], qd=[0, 0])
    cart, pole, length, inertia = 1.0, 0.1, 0.5, 8.333e-3
    mass = np.array([[cart + pole, -pole * length], [-pole * length, inertia + pole * length**2]])
    weight = np.array([[0, 0], [0, pole * 9.81 * length]])
    np.testing.assert_allclose(lin.A[2:], np.hstack([np.linalg.solve(mass, weight), np.zeros((2, 2))]), rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(lin.B[2:, 0], np.linalg.solve(mass, [1, 0]), rtol=1e-13)
    assert lin.growth.values[-1] == pytest.approx(math.sqrt(lin.A.values[3, 1]), rel=1e-12)
    assert lin.damping_ratio.values[-1] == pytest.approx(-1.0)


def test_resonance_of_a_belt() -> None:
    """Of the swing arm, as its page finds it by hand."""
    lin = example("swing_arm").linearize()
    assert lin.frequency.values[2:] == pytest.approx([25.72] * 2, abs=5e-3)
    assert lin.damping_ratio.values[2:] == pytest.approx([0.0269] * 2, abs=5e-5)


# ---------------------------------------------------------------- other roads

NEWTON = ["agile_eye", "tripod", "tripteron", "valve_train", "screw_lift"]
RUBBING = ["knuckle_press", "wolfrom_drive"]
CLOSED = ["fourbar", "delta", "fivebar_parallel", "geared_fivebar", "crankshaft_bearings", "rcsp_start", "stewart_mathworks", "stewart_tsai", "ship_hexapod"]


@pytest.mark.parametrize("name", [*NEWTON, *CLOSED, *RUBBING])
def test_against_inverse_dynamics(name: str) -> None:
    """Along the scene's own motion, in closed forms, in groups that are closed by iteration, and where friction hangs on what it changes."""
    scene = example(name)
    time = scene.description["time"]
    lin = scene.linearize(time["first"] + 0.37 * (time["last"] - time["first"]), outputs=["joint_variable", "joint_rate", "qdd"])
    if name in NEWTON:
        assert scene.inverse(t=[float(lin.time)]).attrs["samples_iterated"] == 1
    n = len(scene.coordinates)
    # without friction rates come in squares, accelerations at most once: long differences are exact, and round less
    by_q, by_qd, by_u = by_inverse_dynamics(scene, lin, 2e-3, 2e-3 if name in RUBBING else 0.1)
    size = max(1.0, np.abs(by_q).max())
    np.testing.assert_allclose(lin.A[n:, :n], by_q, atol=1e-10 * size)
    np.testing.assert_allclose(lin.A[n:, n:], by_qd, atol=1e-10 * size)
    np.testing.assert_allclose(lin.B[n:], by_u, atol=2e-10 * np.abs(by_u).max())
    # the rates of outputs go with the state as the outputs themselves do
    variables = [k for k, label in enumerate(lin.output.values) if label.startswith("joint_variable")]
    rates = [k for k, label in enumerate(lin.output.values) if label.startswith("joint_rate")]
    of_q = lin.C.values[variables, :n]
    np.testing.assert_allclose(of_q, lin.C.values[rates, n:], atol=1e-11 * max(1.0, np.abs(of_q).max()))
    assert (lin.C.values[variables, n:] == 0).all() and (lin.D.values[variables + rates] == 0).all()
    np.testing.assert_array_equal(lin.C.values[-n:], lin.A.values[n:])
    np.testing.assert_array_equal(lin.D.values[-n:], lin.B.values[n:])


@pytest.mark.parametrize("name", ["flyball_governor", "spatial_slider_crank", "stewart_forward", "fivebar_motors", "bricard", "four_stroke"])
def test_against_runs(name: str) -> None:
    """Springs, motors with feedback, gas: at the start of the scene's run."""
    check_against_runs(example(name))


BLOCK: dict[str, Any] = {
    "space": "planar",
    "gravity": [0.0, -9.81],
    "frame": {"markers": {"rail": {"at": [0.0, 0.0], "axis": [1.0, 0.0]}}},
    "link": [{"name": "block", "mass": 2.0, "inertia": 0.01, "markers": {"rail": {"at": [0.0, 0.0], "axis": [1.0, 0.0]}}}],
    "joint": [{"name": "rail", "type": "prismatic", "between": ["frame.rail", "block.rail"]}],
    "coordinate": [{"joint": "rail"}],
    "actuator": [{"joint": "rail"}],
    "friction": [{"joint": "rail", "coulomb": 0.2, "static": 0.3, "stribeck_speed": 0.05, "creep_speed": 0.01, "length": 0.1}],
}


@pytest.mark.parametrize("v", [0.0, 1e-5, 2.5e-4, 4e-4, 0.004, 0.03, 0.4])
def test_a_block_that_rubs(v: float) -> None:
    """Its weight presses: v' = -mu(v) tanh(v/creep) g, smooth also at rest."""
    lin = linkdyn.Scene(BLOCK).linearize(qd=[v], effort=[0.0])
    mu, bend = 0.2 + 0.1 * math.exp(-((v / 0.05) ** 2)), -0.2 * v / 0.05**2 * math.exp(-((v / 0.05) ** 2))
    slope = bend * math.tanh(v / 0.01) + mu / 0.01 / math.cosh(v / 0.01) ** 2
    assert lin.residual.values[1] == pytest.approx(-9.81 * mu * math.tanh(v / 0.01), rel=1e-13)
    assert lin.A.values[1] == pytest.approx([0.0, -9.81 * slope], rel=1e-11, abs=1e-12)


def test_friction_that_hangs_on_motion() -> None:
    """At a pendulum's pin, which is pressed by what swings; against runs."""
    friction = [{"joint": "pin", "coulomb": 0.2, "static": 0.25, "stribeck_speed": 0.02, "creep_speed": 0.005, "radius": 0.02}]
    lin = check_against_runs(linkdyn.Scene(PENDULUM | {"friction": friction, "actuator": [{"joint": "pin", "law": {"type": "constant", "value": 0.5}}]}),
                             q=[0.4], qd=[1.5])
    alone = linkdyn.Scene(PENDULUM).linearize(q=[0.4], qd=[1.5], effort=[0.5])
    assert abs(lin.A.values[1] - alone.A.values[1]).min() > 1e-3 and abs(lin.B.values[1] - alone.B.values[1]) > 1e-6


def test_joint_variables_against_poses() -> None:
    """C by differences of positions."""
    scene = example("delta")
    lin = scene.linearize(0.2, outputs="joint_variable")
    expected = slopes(lambda q: scene.inverse(q, 0 * q, 0 * q, want="joint_variable").joint_variable.values, lin.x.values[:3], 1e-3)
    np.testing.assert_allclose(lin.C[:, :3], expected, atol=1e-10)


def test_a_run_beside_the_state() -> None:
    """A hexapod on springs sinks to its equilibrium by a few steps with A; let go a little beside that it goes as exp(A t) says."""
    data = tomllib.loads((EXAMPLES / "stewart_forward" / "scene.toml").read_text())
    start = linkdyn.Scene(data)
    length = start.inverse(q=start.simulator().q[None], qd=np.zeros((1, 6)), qdd=np.zeros((1, 6)), want="joint_variable").joint_variable
    for actuator in data["actuator"]:
        rest = float(length.sel(variable=f"{actuator['joint']}.slide").values[0])
        actuator["law"] = {"type": "spring-damper", "stiffness": 2e4, "damping": 40.0, "rest": rest}
    scene = linkdyn.Scene(data)
    q = scene.simulator().q.copy()
    for _ in range(6):
        lin = scene.linearize(q=q, qd=np.zeros(6))
        q -= np.linalg.solve(lin.A.values[6:, :6], lin.residual.values[6:])
    lin = scene.linearize(q=q, qd=np.zeros(6))
    assert lin.is_equilibrium == 1 and (lin.growth.values < 0).all() and (lin.angular_frequency.values != 0).all()
    beside = np.zeros(12)
    beside[:6] = 1e-6 * np.array([1.0, -2.0, 1.5, 2.0, -1.0, 1.0])
    t = np.linspace(0.0, 0.4, 9)
    run = scene.ensemble(q[None] + beside[:6], np.zeros((1, 6)), t, step=1e-4)
    went = np.hstack([run.q.values[0] - q, run.qd.values[0]])
    expected = np.array([linalg.expm(lin.A.values * moment) @ beside for moment in t])
    assert np.abs(went - expected).max() < 1e-4 * np.abs(expected).max()


# ---------------------------------------------------------------- laws

LAWS = {
    "spring over its stretch": {"spring": [{"name": "coil", "joint": "pin", "force": "-2 N*m/rad^3*stretch^3 - 0.3 N*m*s/rad*rate*exp(-stretch/1 rad)"}]},
    "load over a marker": {"measures": {"side": {"marker": "bob.C", "component": "x"}, "pin": {"joint": "pin"}, "turning": {"joint": "pin", "rate": True}},
                           "load": [{"on": "bob.C",
                                     "force": [0.0, "3 N*sin(2*pin) - 0.2 N*s^2/rad^2*turning*abs(turning) + 1 N*tanh(side/1 m) + 1 N/(2 + side/1 m) + 2 N*sqrt(2 + side/1 m)"],
                                     "moment": "0.3 N*m*min(side/1 m, 5) + 0.1 N*m*max(side/1 m, -3) + 0.2 N*m*atan2(side, 2 m)/1 rad + 0.4 N*m*if(side, (side/1 m)^1.5, 0)*step(side)"}]},
    "drive over the state": {"measures": {"pin": {"joint": "pin"}, "turning": {"joint": "pin", "rate": True}},
                             "actuator": [{"joint": "pin", "law": {"type": "formula", "value": "-4 N*m/rad*pin - 0.5 N*m*s/rad*turning*cos(pin) + 2 N*m*log(3 + pin/1 rad)*(pin/1 rad)^2"}}]},
    "pd": {"actuator": [{"joint": "pin", "law": {"type": "pd", "stiffness": 12.0, "damping": 0.7, "target": {"law": "harmonic", "mean": 0.1, "amplitude": 0.3, "frequency": 1.5}}}]},
    "spring and damper": {"actuator": [{"joint": "pin", "law": {"type": "spring-damper", "stiffness": 5.0, "damping": 0.2}}]},
}


def with_law(change: dict[str, Any]) -> dict[str, Any]:
    data: dict[str, Any] = {**PENDULUM, "link": [{**PENDULUM["link"][0], "markers": {"O": [0.0, 0.0], "C": [0.1, -0.4]}}]}
    data["actuator"] = [{"joint": "pin", "law": {"type": "constant", "value": 0.8}}]
    return data | change


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_laws(law: dict[str, Any]) -> None:
    """They are in A; u comes on top of what they give."""
    scene = linkdyn.Scene(with_law(law))
    lin = check_against_runs(scene, q=[0.4], qd=[-0.9], t=0.3)
    np.testing.assert_allclose(lin.B[1], [1 / INERTIA], rtol=1e-13)
    alone = scene.linearize(q=[0.4], qd=[-0.9], t=0.3, effort=lin.u.values)
    np.testing.assert_allclose(alone.residual, lin.residual, rtol=1e-12)
    if "actuator" in law:
        assert not np.allclose(alone.A, lin.A)
    else:
        np.testing.assert_allclose(alone.A, lin.A, rtol=1e-13)


@pytest.mark.parametrize("interpolation", ["linear", "spline"])
def test_tables(tmp_path: Path, interpolation: str) -> None:
    """Over the state: between their rows they have a slope."""
    (tmp_path / "pull.csv").write_text("pin [rad],pull [N m]\n-1,2\n0,0.5\n0.5,-0.4\n1,-3\n")
    law = {"type": "table", "over": "pin", "table": "pull.csv", "column": "pull", "interpolation": interpolation}
    data = with_law({"measures": {"pin": {"joint": "pin"}}, "actuator": [{"joint": "pin", "law": law}]})
    lin = check_against_runs(linkdyn.Scene(data, folder=tmp_path), q=[0.3], qd=[-0.9])
    if interpolation == "linear":
        weight = 2.0 * 9.81 * 0.4 * math.cos(0.3) + 3.0
        np.testing.assert_allclose(lin.A.values[1, 0], (-0.9 / 0.5 - weight) / INERTIA, rtol=1e-13)


MOTOR = {"rotor_inertia": 1e-4, "ratio": 20.0, "torque_constant": 0.05, "resistance": 0.8}


@pytest.mark.parametrize("kind", ["voltage", "torque"])
def test_motors(kind: str) -> None:
    """What is free is what the motor is told: its voltage, against that of its turning rotor, or its torque."""
    law = {"type": "voltage", "value": "6 V"} if kind == "voltage" else {"type": "constant", "value": 0.02, "at": "motor"}
    motor = MOTOR if kind == "voltage" else {key: MOTOR[key] for key in ("rotor_inertia", "ratio")}
    scene = linkdyn.Scene(with_law({"actuator": [{"joint": "pin", "law": law, "drive": motor}]}))
    lin = check_against_runs(scene, q=[0.4], qd=[-0.9])
    inertia = INERTIA + 20.0**2 * 1e-4
    slope = 20.0 * (0.05 / 0.8 if kind == "voltage" else 1.0)
    damping = 0.4 + (20.0**2 * 0.05**2 / 0.8 if kind == "voltage" else 0.0)
    np.testing.assert_allclose(lin.B[1], [slope / inertia], rtol=1e-13)
    np.testing.assert_allclose(lin.A[1, 1], -damping / inertia, rtol=1e-13)
    assert list(lin.input_unit.values) == ["V" if kind == "voltage" else "N m"]


# ---------------------------------------------------------------- what it gives, what it refuses


def test_outputs() -> None:
    scene = example("fourbar")
    lin = scene.linearize(0.3, outputs=["qdd[J1]", "joint_rate"])
    assert lin.output.values[0] == "qdd[J1]" and lin.output_unit.values[0] == "rad/s2"
    assert all(label.startswith("joint_rate[") for label in lin.output.values[1:])
    run = scene.inverse(t=[0.3], want="joint_variable")
    np.testing.assert_allclose(lin.y[1:], run.joint_rate.values[0], rtol=1e-11)
    np.testing.assert_allclose(lin.y[0], run.qdd.values[0, 0], rtol=1e-9, atol=1e-9)
    with pytest.raises(InputError, match=r"unknown output .* did you mean 'qdd\[J1\]'"):
        scene.linearize(0.3, outputs="qdd[J2]")
    with pytest.raises(InputError, match="expected one at least"):
        scene.linearize(0.3, outputs=[])


def test_to_scipy_and_control(monkeypatch: pytest.MonkeyPatch) -> None:
    lin = linkdyn.Scene(PENDULUM).linearize()
    system = signal.StateSpace(*(lin.sel(output=["q[pin]"])[name].values for name in "ABCD"))
    np.testing.assert_allclose(sorted(system.poles.imag), sorted(lin.angular_frequency.values))
    with pytest.raises(InputError, match="no matrices"):
        example("fourbar").inverse(t=[0.0]).linkdyn.to_control()
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "control", None)
        with pytest.raises(UnavailableError, match=r"needs python-control"):
            lin.linkdyn.to_control()
    control = pytest.importorskip("control")
    plant = lin.linkdyn.to_control()
    assert isinstance(plant, control.StateSpace) and plant.state_labels == ["q[pin]", "qd[pin]"] and plant.input_labels == ["effort[pin]"]
    np.testing.assert_array_equal(plant.A, lin.A.values)


def test_is_written(tmp_path: Path) -> None:
    import xarray as xr

    lin = linkdyn.Scene(PENDULUM).linearize()
    lin.to_netcdf(tmp_path / "lin.nc")
    xr.testing.assert_identical(xr.load_dataset(tmp_path / "lin.nc"), lin)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("belt_drive", "'motor' has a winding"),
        ("capture", "clutch 'grasp.x' may hold"),
        ("fivebar_pick", "controller 'A'"),
        ("hill_start", "clutch 'clutch' may hold"),
        ("hoist", "'drum' has a brake"),
        ("loader_crane", "'ram.P' is a cylinder"),
    ],
)
def test_refusals(name: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        example(name).linearize()


def test_refused_states() -> None:
    scene = example("fourbar")
    with pytest.raises(InputError, match="q: expected"):
        scene.linearize(q=[0.0, 1.0])
    with pytest.raises(InputError, match="t: expected"):
        scene.linearize(math.nan)
    limited = linkdyn.Scene(with_law({"actuator": [{"joint": "pin", "law": {"type": "constant", "value": 0.5, "at": "motor"},
                                                    "drive": {"ratio": 20.0, "rotor_inertia": 1e-4, "torque_limit": 0.4}}]}))
    with pytest.raises(InputError, match="all the torque"):
        limited.linearize()
    limited.linearize(effort=[0.3])
    lossy = linkdyn.Scene(with_law({"actuator": [{"joint": "pin", "law": {"type": "constant", "value": 0.1, "at": "motor"},
                                                  "drive": {"ratio": 20.0, "rotor_inertia": 1e-4, "efficiency": 0.8}}]}))
    with pytest.raises(InputError, match="loses some"):
        lossy.linearize()


def test_pole_of_a_ball() -> None:
    """Angles tell no rates there."""
    scene = example("stewart_mathworks")
    q = scene.simulator().q.copy()
    q[4] = math.pi / 2
    with pytest.raises(InputError):
        scene.linearize(q=q)


def test_command(capsys: pytest.CaptureFixture[str]) -> None:
    from linkdyn._commands.linearize import linearize_command

    assert linearize_command([str(EXAMPLES / "swing_arm" / "scene.toml"), "--at", "0.1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split() == "at 0.1 s, an equilibrium".split()
    assert [line.split() for line in lines[3:]] == [["moves", "freely"], ["moves", "freely"], "25.72 Hz 2.69 % 0.2298 s swings and fades".split()]
    assert linearize_command([str(EXAMPLES / "cart_pole" / "scene.toml")]) == 0
    assert [line.split()[-1] for line in capsys.readouterr().out.splitlines()[3:]] == ["freely", "freely", "fades", "grows"]
    assert linearize_command([str(EXAMPLES / "hoist" / "scene.toml")]) == 2
    assert "has a brake" in capsys.readouterr().err
