"""Forward dynamics of the examples against independent solutions in many digits (tests/reference/forward_oracle.py), against
exact motions, against inverse dynamics, and by what must stay constant."""
from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

import linkdyn

pytestmark = pytest.mark.accuracy

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
REFERENCES = json.loads((ROOT / "tests" / "reference" / "forward.json").read_text())
CHAINS = ("n_fourbar_2", "n_fourbar_40")     # through their change points: a test of their own

TIGHT = {"rtol": 1e-14, "atol": 1e-14}
# The error allowed in a step, times some hundred steps, times what the motion itself makes of an error (3e3 at the worst).
STATES = 1e-11
# Accelerations and reactions of the governor lose 800,000 N/m * eps on bodies of a few kg; the others are 100 times better.
FORCES = 1e-10


def description(path: str) -> dict:
    return tomllib.loads((EXAMPLES / path).read_text())


def scene_of(name: str) -> linkdyn.Scene:
    """The scene of a reference."""
    given = description(REFERENCES[name]["scene"])
    if name == "rcsp_free":
        given["coordinate"][0] = {"joint": "R", "start": {"position": 0.0, "velocity": 10.0}}
        given["actuator"][0]["law"] = {"type": "constant", "value": 0.0}
    return linkdyn.Scene(given)


def numbers(values: list[str]) -> np.ndarray:
    return np.array([float(value) for value in values])


def assert_near(ours: np.ndarray, exact: np.ndarray, part: float, what: str, scale: float | None = None) -> None:
    """Differences are measured by the largest value, or by the scale."""
    difference = np.abs(ours - exact).max(initial=0.0)
    assert difference <= part * (np.abs(exact).max(initial=0.0) if scale is None else scale), f"{what}: {difference}"


@pytest.mark.parametrize("name", [name for name in REFERENCES if name not in CHAINS])
def test_against_reference(name):
    states = REFERENCES[name]["states"]
    run = scene_of(name).forward(t=[0.0, *(state["t"] for state in states)], **TIGHT)
    assert run.attrs["stopped"] == ""
    # Lengths are up to 10 m, and a gap is a difference of a few sums of them.
    assert run.closure.max() < 1e-14
    for i, state in enumerate(states, start=1):
        at = f"{name}, t = {state['t']}"
        assert_near(run.q.values[i], numbers(state["q"]), STATES, f"{at}: q")
        # What has settled has no rate to measure by.
        assert_near(run.qd.values[i], numbers(state["qd"]), STATES, f"{at}: qd", np.abs(run.qd.values).max())
        if state["driving_force"]:
            assert_near(run.driving_force.values[i], numbers(state["driving_force"]), FORCES, f"{at}: driving force")
        reactions = np.array([numbers(state["reaction"][joint]) for joint in run.joint.values])
        assert_near(run.reaction.values[i], reactions, FORCES, f"{at}: reactions")


def test_andrews_published_digits():
    """The test set's own numbers at its start, and at 0.03 s, where only ten digits of its solution are right."""
    run = linkdyn.load(EXAMPLES / "andrews" / "scene_forward.toml").forward(t=[0.0, 0.03], **TIGHT)
    assert run.qdd.values[0, 0] == pytest.approx(14222.4439199541138705911625887, rel=1e-14)
    np.testing.assert_allclose(
        run.reaction.sel(joint="E3").values[0, :2], [98.5668703962410896, -6.1226883442556651], rtol=1e-13
    )
    assert run.q.values[1, 0] == pytest.approx(15.81077119629904, rel=1e-10)
    assert run.q.values[1, 0] == pytest.approx(15.8107711951537071, rel=1e-13)


def test_rk4_is_of_order_4():
    """The exact motion is that of the law; its third derivative jumps at 2 s, which is the end of a step."""
    scene = linkdyn.load(EXAMPLES / "fourbar_start" / "scene.toml")
    exact = scene.motion([10.0])[0][0, 0]
    errors = [
        abs(scene.forward(t=[0.0, 10.0], method="rk4", step=step, want="driving_force").q.values[-1, 0] - exact)
        for step in (0.02, 0.01, 0.005, 0.0025)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 4.0, atol=0.2)


def with_inverse_drives(given: dict, motion: dict | None = None) -> linkdyn.Scene:
    """The scene, every coordinate driven by what inverse dynamics asks for; and moved by a law, if one is given."""
    given = given | {"actuator": [{"joint": c["joint"]} for c in given["coordinate"]]}
    if motion:
        given["coordinate"] = [{"joint": c["joint"], "start": position(c), "motion": motion} for c in given["coordinate"]]
    return linkdyn.Scene(given)


def position(coordinate: dict) -> float | str:
    start = coordinate.get("start", 0.0)
    return start["position"] if isinstance(start, dict) else start


FORWARD = {
    "andrews/scene_forward.toml": 0.03,
    "fivebar_motors/scene.toml": 0.2,
    "flyball_governor/scene.toml": 0.1,
    "fourbar_constant_torque/scene.toml": 2.5,
    "fourbar_start/scene.toml": 5.0,
    "n_fourbar/scene.toml": 0.6,
    "rcsp_start/scene.toml": 1.7,
    "spatial_slider_crank/scene.toml": 1.3,
}


@pytest.mark.parametrize("path", FORWARD)
def test_inverse_of_forward(path):
    """Inverse dynamics of the motion found gives the driving forces and the reactions of the forward run."""
    given = description(path)
    run = linkdyn.Scene(given).forward(t=np.linspace(0.0, FORWARD[path], 7))
    inverse = with_inverse_drives(given).inverse(q=run.q.values, qd=run.qd.values, qdd=run.qdd.values, t=run.time.values)
    driving = np.zeros_like(inverse.driving_force.values)
    if "driving_force" in run:
        driving[:] = run.driving_force.values
    scale = np.abs(run.reaction.values).max()
    # The accelerations come from one system, the forces from another, of condition 1e4 at most; the governor's springs
    # make 1e-16 m into 1e-10 N.
    assert np.abs(inverse.driving_force.values - driving).max() <= 1e-11 * scale
    assert np.abs(inverse.reaction.values - run.reaction.values).max() <= 1e-11 * scale


@pytest.mark.parametrize("path", FORWARD)
def test_forward_of_inverse(path):
    """Driven by the forces that inverse dynamics finds for a gentle motion, every coordinate makes that motion.

    Nothing holds it there: the squeezer's spring makes an error of its crank 1e5 times larger in 0.03 s, so runs are short.
    """
    span = min(FORWARD[path] / 3, 0.2)
    law = {"law": "cycloidal-start", "speed": 0.05 / span, "duration": span}
    scene = with_inverse_drives(description(path), law)
    t = np.linspace(0.0, span, 5)
    run = scene.forward(t=t, **TIGHT)
    assert run.attrs["stopped"] == ""
    exact = scene.motion(t)[0]
    assert np.abs(run.q.values - exact).max() < 1e-12
    forces = scene.inverse(t=t).driving_force.values
    assert_near(run.driving_force.values, forces, 1e-10, "driving forces")


@pytest.mark.parametrize("method, drift", [("rk8pd", 1e-11), ("rkf45", 1e-8), ("rk4", 3e-8)])
def test_energy_of_a_conservative_crank_rocker(method, drift):
    """The lecture's four-bar turning freely, 20 turns: what a step may lose, times the number of steps. That of rk4
    falls by 32 with half the step; 1.3e-8 at this one."""
    given = description("fourbar_start/scene.toml")
    given["coordinate"][0] = {"joint": "J1", "start": {"position": 0.5, "velocity": 8.0}}
    given["actuator"], given["load"] = [], []
    scene = linkdyn.Scene(given)
    run = scene.forward(t=np.linspace(0.0, 16.0, 9), method=method, step=1e-3, rtol=1e-13 if method == "rk8pd" else 1e-11, atol=1e-11)
    assert run.q.values[-1, 0] > 20 * 2 * np.pi
    total = (run.kinetic_energy + run.potential_energy).values
    assert np.ptp(total) < drift * run.kinetic_energy.values.max()


@pytest.mark.parametrize("name, until", [("n_fourbar_2", 10.0), ("n_fourbar_40", 1.0)])
def test_chains_pass_their_change_points(name, until):
    """All bars flat twice a turn: at a sine s of their angle one rounding error changes accelerations by 1e-16/s^3, and
    whoever passes over the top multiplies errors. Nine digits are what one second leaves, six what ten leave."""
    states = [state for state in REFERENCES[name]["states"] if state["t"] <= until]
    run = scene_of(name).forward(t=[0.0, *(state["t"] for state in states)], rtol=1e-9, atol=1e-9)
    assert run.attrs["stopped"] == ""
    for i, state in enumerate(states, start=1):
        part = 1e-8 if state["t"] <= 1.0 else 1e-6
        at = f"{name}, t = {state['t']}"
        assert_near(run.q.values[i], numbers(state["q"]), part, f"{at}: q")
        assert_near(run.qd.values[i], numbers(state["qd"]), part, f"{at}: qd")
        reactions = np.array([numbers(state["reaction"][joint]) for joint in run.joint.values])
        assert_near(run.reaction.values[i], reactions, 10 * part, f"{at}: reactions")


# Where P3 is after a second, by the null space of the constraints in maximal coordinates, whose energy stays to 4e-14 J; ten digits.
BRICARD_P3 = (0.5105014612, -1.6491675994, 0.1401231146)


def test_bricard_falls():
    """The library's problem A04: a place known to ten digits, and the energy after ten seconds."""
    run = linkdyn.Scene(description("bricard/scene.toml")).forward(t=[0.0, 1.0, 10.0], rtol=1e-12, atol=1e-12)
    assert run.attrs["stopped"] == ""
    point = run.linkdyn.marker("rod3.P3").position.values[1]
    assert np.abs(point - BRICARD_P3).max() <= 1e-10
    energy = (run.kinetic_energy + run.potential_energy).values
    assert np.abs(energy - energy[0]).max() <= 1e-11 * np.abs(run.potential_energy.values).max()
