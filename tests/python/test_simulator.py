"""Stepping from Python: against whole runs, closed forms, and what cannot go on."""

from __future__ import annotations

import subprocess
import sys
import threading
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn.errors import InputError
from integrators import METHODS

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

SLIDER: dict[str, Any] = {
    "space": "planar",
    "gravity": [0.0, -9.81],
    "frame": {"markers": {"A": {"at": [0.0, 0.0], "axis": [1.0, 0.0]}}},
    "link": [{"name": "mass", "mass": 2.0, "inertia": 0.01, "markers": {"A": {"at": [0.0, 0.0], "axis": [1.0, 0.0]}}}],
    "joint": [{"name": "A", "type": "prismatic", "between": ["frame.A", "mass.A"]}],
    "coordinate": [{"joint": "A", "start": {"position": 0.3, "velocity": -0.2}}],
    "actuator": [{"joint": "A"}],
}


@pytest.mark.parametrize("method", ["rk4", "gbs", None])
@pytest.mark.parametrize(("name", "t_end"), [("fourbar_constant_torque", 1.0), ("fivebar_motors", 0.2)])
def test_as_a_whole_run(name: str, t_end: float, method: str | None) -> None:
    """The forces of the first instant, held: as a forward run under these forces."""
    data = tomllib.loads((EXAMPLES / name / "scene.toml").read_text())
    for actuator in data["actuator"]:
        actuator["law"] = {"type": "constant", "value": 3.0}
    scene = linkdyn.Scene(data)
    run = scene.forward(t=np.linspace(0.0, t_end, 11))
    simulator = scene.simulator(method=method, step=1e-4 if method == "rk4" else 1e-3)
    assert (simulator.q == run.q.values[0]).all()
    for k in range(1, 11):
        simulator.step(t_end / 10, [3.0] * len(scene.actuators))
        assert simulator.t == pytest.approx(run.time.values[k], abs=1e-14)
        assert simulator.q == pytest.approx(run.q.values[k], abs=1e-7)
        assert simulator.qd == pytest.approx(run.qd.values[k], abs=1e-6)


def test_hexapod_in_space() -> None:
    """A platform's attitude goes as a quaternion inside, and comes out as angles."""
    data = tomllib.loads((EXAMPLES / "stewart_forward" / "scene.toml").read_text())
    for actuator in data["actuator"]:
        actuator["law"] = {"type": "constant", "value": 600.0}
    scene = linkdyn.Scene(data)
    run = scene.forward(t=[0.0, 0.05, 0.1])
    simulator = scene.simulator()
    for k in (1, 2):
        simulator.step(0.05, np.full(6, 600.0))
        assert simulator.q == pytest.approx(run.q.values[k], abs=1e-7)
        assert simulator.qd == pytest.approx(run.qd.values[k], abs=1e-6)


def test_sampled_controller_by_closed_form() -> None:
    """A mass under PD control that holds its force: the sampled system has an exact matrix."""
    mass, stiffness, damping, every = 2.0, 40.0, 6.0, 0.02
    run = linkdyn.Scene(SLIDER).simulator().run(lambda s: [-stiffness * s.q[0] - damping * s.qd[0]], t_end=2.0, every=every)
    x = np.array([0.3, -0.2])
    for k in range(101):
        assert run.q.values[k, 0] == pytest.approx(x[0], abs=1e-11)
        assert run.qd.values[k, 0] == pytest.approx(x[1], abs=1e-11)
        force = -stiffness * x[0] - damping * x[1]
        assert run.driving_force.values[min(k, 99), 0] == pytest.approx(force if k < 100 else run.driving_force.values[99, 0], abs=1e-9)
        x = np.array([x[0] + every * x[1] + every**2 / 2 * force / mass, x[1] + every * force / mass])
    assert run.attrs["stopped"] == ""
    assert run.sizes == {"sample": 101, "coordinate": 1, "actuator": 1}


def test_a_run_goes_to_its_end() -> None:
    """Where the time to it is no multiple of the controller's the last period is shorter: it ended at 0.9 s without a word."""
    run = linkdyn.Scene(SLIDER).simulator().run(lambda s: [4.0], t_end=1.0, every=0.3)
    np.testing.assert_allclose(run.time, [0.0, 0.3, 0.6, 0.9, 1.0], rtol=1e-15)
    assert run.q.values[-1, 0] == pytest.approx(0.3 - 0.2 + 1.0, abs=1e-12)
    np.testing.assert_array_equal(run.driving_force, np.full((5, 1), 4.0))
    once = linkdyn.Scene(SLIDER).simulator().run(lambda s: [4.0], t_end=0.1, every=0.3)
    np.testing.assert_array_equal(once.time, [0.0, 0.1])
    whole = linkdyn.Scene(SLIDER).simulator().run(lambda s: [4.0], t_end=0.3, every=0.1)    # 0.3/0.1 is less than 3
    np.testing.assert_allclose(whole.time, [0.0, 0.1, 0.2, 0.3], rtol=1e-15)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_forces_that_are_none_are_no_end_of_a_run(bad: float) -> None:
    simulator = linkdyn.Scene(SLIDER).simulator()
    with pytest.raises(InputError, match=rf"force\[0\] of actuator 'A' is {bad} \(expected a finite number\)"):
        simulator.run(lambda s: [0.0 if s.t < 0.25 else bad], t_end=1.0, every=0.1)
    assert simulator.t == pytest.approx(0.3)
    simulator.step(0.1, [0.0])      # it stands where it stood, and goes on


def test_reset_forgets() -> None:
    """The same way again, to the last bit; and from elsewhere."""
    simulator = linkdyn.load(EXAMPLES / "cart_pole" / "scene.toml").simulator()
    ways = []
    for _ in range(2):
        simulator.reset()
        for force in (3.0, -2.0, 0.5):
            simulator.step(0.05, [force])
        ways.append(np.concatenate([[simulator.t], simulator.q, simulator.qd]))
    assert (ways[0] == ways[1]).all()
    simulator.reset(q=[0.5, 0.1], qd=[0.0, 1.0], t=3.0)
    assert (simulator.t, *simulator.q, *simulator.qd) == (3.0, 0.5, 0.1, 0.0, 1.0)


@pytest.mark.parametrize("name", ["fourbar", "delta"])
@pytest.mark.parametrize("turns", [2, -50])
def test_full_turns_away_is_as_at_the_start(name: str, turns: int) -> None:
    """An assembly is not followed along turns that lead nowhere: one closed by formulas, one by iteration."""
    scene = linkdyn.load(EXAMPLES / name / "scene.toml")
    simulator = scene.simulator()
    by_turns = 2 * np.pi * turns * np.eye(simulator.q.size)[0]
    force = np.full(simulator.q.size, 0.5)
    near, far = [], []
    for found, q in (near, simulator.q + 0.5), (far, simulator.q + 0.5 + by_turns):
        simulator.reset(q=q, qd=np.ones(simulator.q.size))
        for _ in range(20):
            simulator.step(0.01, force)
            found.append([simulator.q, simulator.qd])
    np.testing.assert_allclose(np.array(far) - [by_turns, 0 * by_turns], near, rtol=0, atol=1e-7)

    q = np.array([simulator.q * 0 + 0.5, simulator.q * 0 + 0.5 + by_turns])
    run = scene.ensemble(q, np.ones_like(q), [0.0, 0.02])
    assert np.all(run.status == 0)
    np.testing.assert_allclose(run.qd[1], run.qd[0], rtol=1e-9, atol=1e-7)


def test_what_no_turn_brings_back_is_followed_from_the_start() -> None:
    """A motor on gears: the press behind them stands elsewhere after each turn. So far that nobody follows it is told."""
    scene = linkdyn.load(EXAMPLES / "planetary_crank" / "scene.toml")
    t = 0.3
    simulator = scene.simulator(t=t)
    np.testing.assert_allclose(simulator.q, scene.inverse(t=[t]).q.values[0], rtol=1e-15)
    simulator.step(0.001, scene.inverse(t=[t]).driving_force.values[0])
    np.testing.assert_allclose(simulator.q, scene.inverse(t=[t + 0.001]).q.values[0], rtol=1e-5)
    with pytest.raises(InputError, match="too far from the scene's start to follow the assembly"):
        simulator.reset(q=[-1e4])


def test_forces_stay_until_others_are_given() -> None:
    held, given = (linkdyn.Scene(SLIDER).simulator() for _ in range(2))
    held.step(0.1, [4.0])
    held.step(0.1)
    for _ in range(2):
        given.step(0.1, [4.0])
    assert (held.q == given.q).all()


@pytest.mark.parametrize("options", [{}, {"method": "gbs"}, {"rtol": 1e-5, "atol": 1e-5}, {"rtol": 1e-11, "atol": 1e-11}], ids=str)
def test_what_cannot_go_on_says_so(options: dict[str, Any]) -> None:
    """A rocker pushed against the end of its way: the state is that of the last good instant, a reset goes on."""
    bars = {"crank": 0.3, "coupler": 0.25, "rocker": 0.2}
    scene = linkdyn.Scene({
        "space": "planar",
        "frame": {"markers": {"A": [0.0, 0.0], "D": [0.4, 0.0]}},
        "link": [{"name": name, "mass": 1.0, "inertia": 0.01, "markers": {"P": [0.0, 0.0], "Q": [length, 0.0]}} for name, length in bars.items()],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "crank.P"]},
            {"name": "B", "type": "revolute", "between": ["crank.Q", "coupler.P"]},
            {"name": "C", "type": "revolute", "between": ["coupler.Q", "rocker.Q"]},
            {"name": "D", "type": "revolute", "between": ["frame.D", "rocker.P"]},
        ],
        "coordinate": [{"joint": "A", "start": "40 deg"}],
        "actuator": [{"joint": "A"}],
    })
    simulator = scene.simulator(**options)
    with pytest.raises(InputError, match="cannot go on beyond t = .* s: coordinate 'A' comes to its dead point"):
        for _ in range(400):
            simulator.step(0.01, [2.0])
    t = np.append(0.0, np.linspace(0.29, 0.31, 2001))
    run = scene.with_({"actuator.A.law": {"type": "constant", "value": 2.0}}).forward(t=t, rtol=1e-10, atol=1e-10)
    # it stops where a forward run passes the end of the way, and not beyond: there steps would lead to a mechanism thrown back
    assert 0 <= t[run.q.values[:, 0].argmax()] - simulator.t < 1e-4
    assert np.isfinite(simulator.q).all()
    with pytest.raises(InputError, match="cannot go on"):
        simulator.step(0.01)
    run = scene.simulator().run(lambda s: [2.0], t_end=2.0, every=0.01)
    assert "cannot go on" in run.attrs["stopped"]
    assert run.sizes["sample"] < 200
    simulator.reset()
    simulator.step(0.01, [0.0])
    with pytest.raises(InputError, match="cannot be computed there"):
        simulator.reset(q=[3.0])
    with pytest.raises(InputError, match="has no valid state after a failed reset"):
        simulator.step(0.01)
    simulator.reset()
    simulator.step(0.01)


@pytest.mark.parametrize(("call", "message"), [
    (lambda s: s.step(0.0), "dt"),
    (lambda s: s.step(float("nan")), "dt"),
    (lambda s: s.step(0.1, [1.0, 2.0]), "force"),
    (lambda s: s.step(0.1, [float("nan")]), "force"),
    (lambda s: s.reset(q=[1.0, 2.0]), "q"),
    (lambda s: s.run(lambda _: [0.0], t_end=-1.0, every=0.1), "t_end"),
    (lambda s: s.run(lambda _: [0.0], t_end=1.0, every=0.0), "every"),
    (lambda s: s.scene.simulator(method="euler"), "method 'euler'"),
    (lambda s: s.scene.simulator(step=-1.0), "step"),
])  # fmt: skip
def test_wrong_arguments(call: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call(linkdyn.Scene(SLIDER).simulator())


def test_closed() -> None:
    simulator = linkdyn.Scene(SLIDER).simulator()
    simulator.close()
    simulator.close()
    with linkdyn.Scene(SLIDER).simulator() as other:
        other.step(0.1)
    for closed in (simulator, other):
        with pytest.raises(linkdyn.LinkdynError, match="closed"):
            closed.step(0.1)


def test_threads_of_their_own() -> None:
    """Simulators of one scene go side by side, each as if alone."""
    scene = linkdyn.load(EXAMPLES / "cart_pole" / "scene.toml")
    ends: dict[int, np.ndarray] = {}

    def go(k: int) -> None:
        simulator = scene.simulator()
        for i in range(200):
            simulator.step(0.005, [np.sin(0.1 * i + k)])
        ends[k] = simulator.q.copy()

    threads = [threading.Thread(target=go, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    alone = dict(ends)
    for k in range(4):
        go(k)
        assert (ends[k] == alone[k]).all()


@pytest.mark.parametrize(("program", "last"), [("balance.py", "at the end"), ("environment.py", "500.0 steps upright")])
def test_examples_run(program: str, last: str, tmp_path: Path) -> None:
    arguments = ["--out", str(tmp_path)] if program == "balance.py" else []
    done = subprocess.run([sys.executable, str(EXAMPLES / "cart_pole" / program), *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert last in done.stdout.splitlines()[-1]


def test_long_steps_can_be_interrupted() -> None:
    """A step of hours comes back to Python, which hears the signal."""
    program = f"""
import linkdyn, signal
simulator = linkdyn.load({str(EXAMPLES / "fivebar_motors" / "scene.toml")!r}).simulator()
signal.alarm(2)
signal.signal(signal.SIGALRM, signal.default_int_handler)
try:
    simulator.step(1e6, [0.3, -0.2])
except KeyboardInterrupt:
    print("heard")
except linkdyn.InputError as error:
    print("heard", error)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout.startswith("heard"), done.stderr


KINKS: dict[str, dict[str, Any]] = {
    "payload": {"payload": [{"on": "rod.E", "mass": 2.0, "from": 0.251, "until": 0.7}]},
    "poured": {"payload": [{"on": "rod.E", "mass": {"law": "polynomial-345", "from": 2.0, "to": 0.1, "begin": 0.251, "duration": 0.3}}]},
    "load": {"load": [{"on": "rod.E", "force": [{"law": "polynomial-345", "from": 0.0, "to": 6.0, "begin": 0.251, "duration": 0.05}, 0.0]}]},
    "ground": {"frame": {"markers": {"O": [0, 0]}, "motion": {"x": {"law": "cycloidal", "from": 0.0, "to": 0.2, "begin": 0.251, "duration": 0.2}}}},
    "brake": {"actuator": [{"joint": "J", "law": {"type": "constant", "value": 0.0, "at": "motor"}, "drive": {
        "ratio": 1.0, "rotor_inertia": 0.01, "brake": {"torque": 1.0, "from": 0.251, "until": 0.6}}}]},
}  # fmt: skip
"""What begins, ends or changes at instants that no step of the caller's ends at, and at one that it misses by rounding (0.6, 0.7)."""


def swinging(**parts: Any) -> linkdyn.Scene:
    return linkdyn.Scene({
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"O": [0, 0]}},
        "link": [{"name": "rod", "mass": 1.0, "inertia": 0.1, "cog": [0.3, 0], "markers": {"O": [0, 0], "E": [0.6, 0]}}],
        "joint": [{"name": "J", "type": "revolute", "between": ["frame.O", "rod.O"]}],
        "coordinate": [{"joint": "J", "start": 0}], "time": {"end": 1.0, "samples": 11},
    } | parts)  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", KINKS)
def test_steps_end_at_kinks(kind: str, method: str) -> None:
    """As the forward run, which ends steps there; seulex could not go on, or was 2e-5 off."""
    scene = swinging(**KINKS[kind])
    forces = [0.0] * len(scene.actuators)
    good = scene.forward(t=np.linspace(0.0, 1.0, 6), rtol=1e-12, atol=1e-12).q.values[1:, 0]
    for dt in (0.2, 0.1, 0.02):
        simulator = scene.simulator(method=method)
        found = []
        for k in range(1, round(1.0 / dt) + 1):
            simulator.step(dt, forces)
            assert simulator.t == pytest.approx(k * dt, abs=1e-13)
            if k % round(0.2 / dt) == 0:
                found.append(simulator.q[0])
        np.testing.assert_allclose(found, good, rtol=0, atol=1e-6 if method == "msbdf" else 2e-7)


@pytest.mark.parametrize("method", METHODS)
def test_an_edge_missed_by_rounding_is_met(method: str) -> None:
    """Ten steps of 0.1 s do not add up to 1 s: whatever begins there does so at the end of the tenth, not within the eleventh or twice."""
    scene = swinging(payload=[{"on": "rod.E", "mass": 2.0, "from": 1.0}], time={"end": 2.0})
    simulator = scene.simulator(method=method)
    for _ in range(20):
        before = simulator.t
        simulator.step(0.1)
        assert before + 0.1 <= simulator.t <= before + 0.1 + 1e-15
    good = scene.forward(t=[0.0, 2.0], rtol=1e-12, atol=1e-12).q.values[-1, 0]
    assert simulator.q[0] == pytest.approx(good, abs=3e-6 if method == "msbdf" else 5e-7)


def test_a_pose_that_cannot_go_on_is_told_as_forward_runs_tell_it() -> None:
    """Two links led by the place of their tip, which they reach no farther when they are stretched."""
    scene = linkdyn.Scene({
        "space": "planar",
        "frame": {"markers": {"H": [0.0, 0.0]}},
        "link": [
            {"name": "u", "mass": 2.0, "cog": [0.2, 0.02], "inertia": 0.05, "markers": {"H": [0.0, 0.0], "E": [0.4, 0.0]}},
            {"name": "f", "mass": 1.0, "cog": [0.15, 0.0], "inertia": 0.02, "markers": {"E": [0.0, 0.0], "T": [0.35, 0.02]}},
        ],
        "joint": [
            {"name": "H", "type": "revolute", "between": ["frame.H", "u.H"]},
            {"name": "E", "type": "revolute", "between": ["u.E", "f.E"], "start": 0.9},
        ],
        "coordinate": [
            {"marker": "f.T", "components": ["x", "y"], "start": {"x": {"position": 0.45, "velocity": 0.56}, "y": {"position": 0.4, "velocity": 0.4}}}
        ],
        "actuator": [{"joint": joint, "law": {"type": "constant", "value": 0.0}} for joint in ("H", "E")],
    })
    stopped = scene.forward(t=np.linspace(0, 2, 5), rtol=1e-9, atol=1e-9).attrs["stopped"]
    words = stopped.split(" s: ")[1]
    assert words.endswith("others can take their places)")
    simulator = scene.simulator(rtol=1e-9, atol=1e-9)
    with pytest.raises(InputError) as refusal:
        for _ in range(20):
            simulator.step(0.1, [0.0, 0.0])
    assert str(refusal.value).endswith(words)
