"""Equal steps that are too long for what goes on in them end a run, and the words say what that is and how long steps may be."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
import xarray as xr

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def wheel(voltage: str = "24 V", damping: str = "0.05 N m s/rad", stiffness: str = "0 N m/rad", **drive: Any) -> linkdyn.Scene:
    """A flywheel on a gear motor."""
    return linkdyn.Scene(
        {
            "space": "planar", "gravity": [0, 0], "frame": {"markers": {"A": [0, 0]}},
            "link": [{"name": "wheel", "mass": 2.0, "inertia": 0.02, "markers": {"O": [0, 0]}}],
            "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "wheel.O"]}], "coordinate": [{"joint": "A"}],
            "spring": [{"name": "shaft", "joint": "A", "damping": damping, "stiffness": stiffness}],
            "actuator": [{"name": "motor", "joint": "A", "law": {"type": "voltage", "value": voltage},
                          "drive": {"ratio": 12, "rotor_inertia": 3e-5, "torque_constant": 0.08, "resistance": 0.6, "inductance": "4 mH", **drive}}],
            "time": {"end": 0.2, "samples": 201},
        }
    )  # fmt: skip


def proposed(words: str) -> float:
    """The step that a message asks for [s]."""
    found = re.search(r"expected steps of (\S+) s", words)
    assert found, words
    return float(found[1])


def both(scene: linkdyn.Scene, step: float) -> tuple[xr.Dataset, xr.Dataset]:
    t = np.linspace(0.0, 0.2, 201)
    alone = scene.forward(t=t, method="rk4", step=step, want="all")
    start = alone.q.values[:1], alone.qd.values[:1]
    return alone, scene.ensemble(*start, t, step=step)


def test_a_current_limit_is_too_fast() -> None:
    """Its controller has the time constant L/(100 R), 0.07 ms: steps of 1 ms made currents of anything. At the step proposed the run is right."""
    scene = wheel(current_limit="10 A")
    right = scene.forward(want="all")
    assert right.motor_current.values.max() == pytest.approx(10, abs=1e-3)
    alone, members = both(scene, 1e-3)
    assert "too long for the current of actuator 'A:motor'" in alone.attrs["stopped"]
    assert "too long for the current of actuator 'A:motor'" in members.attrs["stopped"]
    assert members.status.values.tolist() == [3] and alone.status.values[-1] == 3
    step = proposed(alone.attrs["stopped"])
    assert 1e-5 < step < 1e-4 and step == proposed(members.attrs["stopped"])
    alone, members = both(scene, step)
    assert alone.attrs["stopped"] == members.attrs["stopped"] == "" and members.status.values.tolist() == [0]
    np.testing.assert_allclose(alone.q.values, right.q.values, atol=2e-6)
    np.testing.assert_allclose(alone.motor_current.values[2:], right.motor_current.values[2:], atol=2e-3)
    np.testing.assert_allclose(members.q.values[0], right.q.values, atol=2e-6)


def test_without_a_limit_the_winding_is_slow() -> None:
    """L/R is 7 ms: the default step is short enough, and nothing is said."""
    alone, members = both(wheel(), 1e-3)
    right = wheel().forward(want="all")
    assert alone.attrs["stopped"] == members.attrs["stopped"] == ""
    np.testing.assert_allclose(alone.motor_current.values, right.motor_current.values, atol=1e-3)
    np.testing.assert_allclose(members.q.values[0], right.q.values, atol=1e-5)


@pytest.mark.parametrize("stiffness", [2.5e4, 1e5])
def test_a_stiff_spring_by_name(stiffness: float) -> None:
    """Of a period of 6.1 and 3.1 steps: the first is stable, and damped by the method alone."""
    scene = wheel(stiffness=f"{stiffness} N m/rad", damping="0 N m s/rad", torque_constant=1e-6)
    scene = scene.with_({"coordinate.A.start": {"position": 0.0, "velocity": 5.0}})
    alone, members = both(scene, 1e-3)
    for run in (alone, members):
        assert "too long for spring 'shaft'" in run.attrs["stopped"]
    alone, members = both(scene, proposed(alone.attrs["stopped"]))
    assert alone.attrs["stopped"] == members.attrs["stopped"] == ""


def test_friction_that_holds() -> None:
    """Near rest friction is a damper that no step of 1 ms resolves: a brake that holds a load shook."""
    scene = linkdyn.load(EXAMPLES / "hoist" / "scene.toml")
    run = scene.forward(method="rk4")
    assert "too long for" in run.attrs["stopped"] and run.status.values[-1] == 3
    assert 1e-5 < proposed(run.attrs["stopped"]) < 2e-4


@pytest.mark.parametrize("example", ["andrews", "belt_drive", "cart_pole", "fivebar_pick", "loader_crane", "stopped_rocker", "tripteron"])
def test_nothing_is_said_of_steps_that_serve(example: str) -> None:
    """Impacts, friction, controllers, motors: by the default step right to a thousandth."""
    scene = linkdyn.load(EXAMPLES / example / "scene.toml")
    run, right = scene.forward(method="rk4"), scene.forward()
    assert run.attrs["stopped"] == "" and (run.status.values == 0).all()
    assert abs(run.q.values - right.q.values).max() < 1e-3 * abs(right.q.values).max()


def test_a_simulator_says_so() -> None:
    scene = linkdyn.load(EXAMPLES / "hoist" / "scene.toml")
    simulator = scene.simulator(method="rk4", step=1e-3)
    with pytest.raises(linkdyn.InputError, match="beyond t = .* s: steps of 0.001 s are too long for"):
        simulator.step(0.1)
