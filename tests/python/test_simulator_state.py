"""States of simulators: saved and put back, and the same steps made again, to the same bits."""

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
import test_belts
import test_clutches
import test_motor_laws
from linkdyn.errors import InputError
from test_controllers import arm, slider

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "reference"))
import stops_oracle

PID = {"target": 0.1, "kp": 80.0, "ki": 100.0, "kd": 9.0}


def example(name: str) -> linkdyn.Scene:
    return linkdyn.Scene(tomllib.loads((ROOT / "examples" / name / "scene.toml").read_text()))


def walled() -> linkdyn.Scene:
    data = slider(**PID)
    data["measures"] = {"x": {"joint": "A"}}
    data["event"] = [{"name": "far", "when": "x - 0.15 m"}]
    data["stop"] = [{"name": "wall", "joint": "A", "min": 0.08, "restitution": 0.4}]
    return linkdyn.Scene(data)


def braked() -> linkdyn.Scene:
    """A motor's brake comes on at an angle and lets go at another."""
    data = test_motor_laws.braked(5.0, {"torque": 6.0, "from_event": "there", "until_event": "back", "begins": "off"}, 2.0)
    data["measures"] = {"angle": {"joint": "O"}}
    data["event"] = [{"name": "there", "when": "angle - 1.5 rad"}, {"name": "back", "when": "angle - 1.8 rad"}]
    return linkdyn.Scene(data)


def bouncing_arm() -> linkdyn.Scene:
    elbow = {"actuator": "E", "target": 0.7, "kp": 60.0, "kd": 4.0, "rate": "130 Hz", "delay_samples": 2}
    return linkdyn.Scene(arm(controller=[elbow], stop=[{"name": "end", "joint": "S", "max": 0.4, "min": -1.6, "restitution": 0.5}]))


# A scene, how long its steps are [s], and how many of them there are before the state and behind it.
SCENES: dict[str, tuple[Callable[[], linkdyn.Scene], float, int, int]] = {
    "sampled PID with delay": (lambda: linkdyn.Scene(slider(**PID, rate="300 Hz", delay="7.1 ms")), 2.3e-3, 37, 40),
    "continuous PID with limits": (lambda: linkdyn.Scene(slider(**PID, limit=2.0)), 2.3e-3, 37, 40),
    "stops and an event": (walled, 3.1e-3, 40, 60),
    "arm at a stop": (bouncing_arm, 5e-3, 30, 60),
    "three stops": (lambda: linkdyn.Scene(stops_oracle.random_chain(3, 3, 3)[0]), 7e-3, 30, 60),
    "stick and slip": (test_clutches.belt, 7e-3, 30, 60),
    "sticks on a slope": (
        lambda: test_clutches.slope(0.3, 0.5).with_({"coordinate.x.start": {"position": 0.0, "velocity": 2.0}}), 5e-3, 30, 60,
    ),
    "clutch": (test_clutches.shafts, 0.02, 20, 60),
    "brake": (braked, 0.01, 26, 40),
    "belt": (lambda: linkdyn.Scene(test_belts.belt()), 1e-3, 50, 60),
    "four-bar, turns": (lambda: example("fourbar_constant_torque"), 0.03, 60, 40),
    "group": (lambda: example("spatial_slider_crank"), 0.03, 20, 20),
    "hexapod": (lambda: example("stewart_forward"), 2e-3, 20, 20),
}


def forces(scene: linkdyn.Scene, k: int) -> np.ndarray:
    return np.array([0.3 * math.sin(0.7 * k + i) for i in range(len(scene.actuators))])


def go_on(simulator: linkdyn.Simulator, dt: float, first: int, n: int) -> list[Any]:
    seen = []
    for k in range(first, first + n):
        # forces change with every third step, and are held between
        simulator.step(dt, forces(simulator.scene, k) if k % 3 == 0 else None)
        seen.append((simulator.t, *simulator.q, *simulator.qd))
    return seen


@pytest.mark.parametrize("method", [None, "rk4", "rkf45", "gbs", "seulex"])
@pytest.mark.parametrize("name", SCENES)
def test_the_same_steps_give_the_same_bits(name: str, method: str | None) -> None:
    make, dt, before, behind = SCENES[name]
    scene = make()
    step = 1e-4 if method == "rk4" and name in ("belt", "brake") else 1e-3  # the belt's vibration, what the brake holds
    simulator = scene.simulator(method=method, step=step)
    other = scene.simulator(method=method, step=step)
    go_on(simulator, dt, 0, before)
    saved = simulator.state
    assert saved.t == simulator.t and (saved.q == simulator.q).all() and (saved.qd == simulator.qd).all()
    first = go_on(simulator, dt, before, behind)
    simulator.state = saved
    assert (simulator.t, *simulator.q, *simulator.qd) == (saved.t, *saved.q, *saved.qd)
    assert go_on(simulator, dt, before, behind) == first
    # after a reset, too, and as often as one likes
    simulator.reset()
    go_on(simulator, dt, 0, 3)
    simulator.state = saved
    assert go_on(simulator, dt, before, behind) == first
    # and who looks changes nothing
    go_on(other, dt, 0, before)
    assert go_on(other, dt, before, behind) == first


def test_a_history_outside_begins_anew() -> None:
    """msbdf: the same motion within its accuracy."""
    simulator = example("fourbar_constant_torque").simulator(method="msbdf")
    go_on(simulator, 0.01, 0, 20)
    saved = simulator.state
    first = go_on(simulator, 0.01, 20, 20)
    simulator.state = saved
    np.testing.assert_allclose(go_on(simulator, 0.01, 20, 20), first, rtol=1e-4, atol=1e-5)


def test_whose_states_they_are() -> None:
    scene = example("fourbar_constant_torque")
    simulator, other = scene.simulator(), scene.simulator()
    simulator.step(0.01)
    saved = simulator.state
    assert "t = 0.01 s" in repr(saved)
    with pytest.raises(InputError, match="another simulator's"):
        other.state = saved
    with pytest.raises(InputError, match="no state of a simulator"):
        other.state = (0.0, [0.0], [0.0])  # type: ignore[assignment]
    with pytest.raises(ValueError, match="read-only"):
        saved.q[0] = 1.0
    simulator.close()
    with pytest.raises(linkdyn.errors.LinkdynError, match="was closed"):
        simulator.state = saved
