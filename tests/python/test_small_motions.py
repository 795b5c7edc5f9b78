"""Motions of a micrometre have digits as those of millimetres have: no scene says how far its parts will go."""

import numpy as np
import pytest

import linkdyn
from integrators import CONTROLLED

OMEGA = 100.0  # rad/s
OSCILLATOR = """
title = "mass on a spring"
space = "planar"
gravity = [0, 0]
[frame]
markers = {{ o = [0, 0], wall = [-2, 0] }}
[[link]]
name = "mass"
mass = 1
inertia = 1
markers = {{ a = [0, 0] }}
[[joint]]
name = "slide"
type = "prismatic"
between = ["frame.o", "mass.a"]
[[spring]]
name = "spring"
between = ["frame.wall", "mass.a"]
stiffness = 1e4
rest = 2
[[coordinate]]
joint = "slide"
start = {start!r}
[time]
end = 1
samples = 41
"""


def relative_error(amplitude: float, method: str) -> float:
    run = linkdyn.Scene(OSCILLATOR.format(start=amplitude)).forward(method=method)
    right = amplitude * np.cos(OMEGA * run.time.values)
    return float(np.abs(run.q.values[:, 0] - right).max() / amplitude)


@pytest.mark.parametrize("method", CONTROLLED)
@pytest.mark.parametrize("amplitude", [1e-3, 1e-6, 1e-9])
def test_digits_of_small_motions(amplitude: float, method: str) -> None:
    # A way below 0.01 is to its tolerance as a hundredth of a way of 1 is to 1e-9, and errors of steps add up by chance some times more
    # or less: it would be 30,000 times as much.
    # What is left at nanometres is rounding: of the spring's length, at each of some thousand evaluations, and of steps' errors.
    rounding = 100 * np.finfo(float).eps * 2.0 / amplitude
    assert relative_error(amplitude, method) < 500 * relative_error(1.0, method) + rounding


def test_what_stands_still_costs_no_steps() -> None:
    """A part that only rounding moves is not resolved to rounding."""
    at_rest = linkdyn.Scene(OSCILLATOR.format(start=0.0)).forward()
    assert abs(at_rest.q.values).max() < 1e-15
    assert at_rest.attrs["steps"] < 100


def held_arms(mass: float) -> tuple[linkdyn.Scene, list[float]]:
    """Two arms that torques hold against their weight."""
    half = 0.5 * mass * 9.81 * np.cos(0.7)
    torques = [1.5 * mass * 9.81 * np.cos(0.3) + half, half]
    return linkdyn.Scene({
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"A": [0, 0]}},
        "link": [{"name": name, "mass": mass, "inertia": mass, "cog": [0.5, 0], "markers": {near: [0, 0], far: [1, 0]}}
                 for name, near, far in (("first", "A", "B"), ("second", "B", "C"))],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "first.A"]},
                  {"name": "B", "type": "revolute", "between": ["first.B", "second.B"]}],
        "coordinate": [{"joint": "A", "start": {"position": 0.3}}, {"joint": "B", "start": {"position": 0.4}}],
        "actuator": [{"joint": name, "law": {"type": "constant", "value": torque}} for name, torque in zip("AB", torques)],
    }), torques


@pytest.mark.parametrize("method", ["rkf45", "rk8pd", "gbs", "seulex", "msbdf"])
def test_forces_that_hold_cost_no_steps(method: str) -> None:
    """What is held at rest moves by rounding, and so does the torques' work, however heavy it is: no reason for short steps."""
    for mass in (1.0, 1e4, 1e8, 1e12):
        scene, torques = held_arms(mass)
        run = scene.forward(t=np.linspace(0.0, 3.0, 4), method=method)
        assert run.attrs["stopped"] == ""
        assert run.attrs["steps"] < 50, "some ten, at every mass; by rounding the heaviest took up to 1,069"
        np.testing.assert_allclose(run.q.values[-1], [0.3, 0.4], atol=1e-12)
        assert float(abs(run.work).max()) < 1e-12 * sum(torques)


@pytest.mark.parametrize("method", ["rkf45", "seulex", "msbdf"])
def test_a_simulator_heeds_no_work(method: str) -> None:
    """Which it does not tell: the motion is the same for every mass, and so are the steps, but for rounding, which grows like exp(3 t)."""
    ways = []
    for mass in (1.0, 2.0**40):
        scene, torques = held_arms(mass)
        simulator = scene.simulator(method=method)
        way = []
        for k in range(60):
            simulator.step(0.05, [torque * (1 + 0.01 * np.sin(k)) for torque in torques])
            way += [*simulator.q, *simulator.qd]
        ways.append(way)
    np.testing.assert_allclose(ways[1], ways[0], rtol=0, atol=1e-10)


@pytest.mark.parametrize("method", ["rk8pd", "gbs", "msbdf"])
def test_work_that_cancels_costs_no_steps(method: str) -> None:
    """A crank turns on its coupler and rocker without a drive's work: what rounding makes of that, however heavy the machine, is small
    beside its kinetic energy, and no reason for short steps."""
    steps = []
    for mass in (1.0, 1e4, 1e8):
        links = [
            {"name": "crank", "markers": {"A": [0, 0], "B": [0.1, 0]}}, {"name": "coupler", "markers": {"B": [0, 0], "C": [0.3, 0]}},
            {"name": "rocker", "markers": {"D": [0, 0], "C": [0.3, 0]}},
        ]
        run = linkdyn.Scene({
            "space": "planar", "frame": {"markers": {"A": [0, 0], "D": [0.52, 0]}}, "link": [link | {"mass": mass} for link in links],
            "joint": [
                {"name": a + b, "type": "revolute", "between": [f"{a}.{c}", f"{b}.{c}"]}
                for a, b, c in (("frame", "crank", "A"), ("crank", "coupler", "B"), ("coupler", "rocker", "C"), ("frame", "rocker", "D"))
            ],
            "coordinate": [{"joint": "framecrank", "motion": {"law": "constant-rate", "rate": "60 rpm"}}], "actuator": [{"joint": "framecrank"}],
        }).forward(t=np.linspace(0.0, 0.2, 6), method=method)
        assert run.attrs["stopped"] == "" and run.attrs["rounding"] == ""
        np.testing.assert_allclose(run.q.values[-1], 0.4 * np.pi, rtol=1e-9)
        gained = run.kinetic_energy - run.kinetic_energy[0] - run.work
        assert float(abs(gained).max()) < 1e-8 * float(run.kinetic_energy.max())
        steps.append(run.attrs["steps"])
    assert max(steps) <= 2 * min(steps)
