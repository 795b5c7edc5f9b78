"""Screws in closed loops, several turns of them: against loops closed by hand, which know of turns what the engine is not told."""
from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_joint_kinds import along, lift, pusher

import linkdyn

LAW = "polynomial-345"


def angles(run: Any) -> np.ndarray:
    assert (run.status == 0).all()
    return run.joint_variable.sel(variable="S.angle").values


def angle_of_lift(arm: np.ndarray, lead: float) -> np.ndarray:
    """By the distance of the ball from the spindle's foot, 0.7 m at the start."""
    return (np.hypot(0.7 * np.cos(arm) - 0.7, 0.5 - 0.7 * np.sin(arm)) - 0.7) * 2 * np.pi / lead


def angle_of_pusher(spindle: np.ndarray, lead: float) -> np.ndarray:
    """The stay's length holds the nut: one equation for its turn, followed in steps of the spindle's angle from zero on."""
    h = lead / (2 * np.pi)

    def off(nut: float, turned: float) -> float:
        return (0.2 * np.cos(nut) - 0.2) ** 2 + (0.2 * np.sin(nut) + 0.6) ** 2 + (h * (nut - turned)) ** 2 - 0.36

    nut, found = 0.0, []
    for turned in spindle:
        for _ in range(50):
            step = off(nut, turned) * 2e-6 / (off(nut + 1e-6, turned) - off(nut - 1e-6, turned))
            nut -= step
            if abs(step) < 1e-13:
                break
        found.append(0.5 / h + nut - turned)
    return np.array(found)


def pusher_of(lead: float) -> dict[str, Any]:
    scene = pusher(0.3)
    scene["joint"][1].update(lead=lead, start=np.pi / lead)    # half a metre
    scene["link"][2].update(cog=[0, 0.3, 0], inertia=[0.01, 0.001, 0.01, 0, 0, 0])
    return scene


@pytest.mark.accuracy
@pytest.mark.parametrize("lead", [0.2, 0.05, 0.006])
def test_screw_turned_by_its_loop(lead: float) -> None:
    """Up to twenty turns, along a motion and each sample on its own."""
    data = lift()
    data["joint"][2]["lead"] = lead
    data["coordinate"] = [along("O", {"law": LAW, "from": 0.0, "to": "-10 deg", "duration": 2.0})]
    data["actuator"] = [{"joint": "O"}]
    scene = linkdyn.Scene(data)
    t = np.linspace(0, 2, 601)
    q, qd, qdd = scene.motion(t)
    expected = angle_of_lift(q[:, 0], lead)
    assert np.ptp(expected) > 0.1 / lead
    run = scene.inverse(t=t, want="all")
    np.testing.assert_allclose(angles(run), expected, rtol=0, atol=1e-13 * np.ptp(expected))
    order = np.random.default_rng(1).permutation(len(t))
    alone = scene.inverse(q=q[order], qd=qd[order], qdd=qdd[order], want="all")
    np.testing.assert_allclose(angles(alone), expected[order], rtol=0, atol=1e-13 * np.ptp(expected))
    np.testing.assert_allclose(alone.driving_force.values, run.driving_force.values[order], rtol=1e-10, atol=1e-10 * np.abs(run.driving_force.values).max())


@pytest.mark.accuracy
@pytest.mark.parametrize(("lead", "turns", "samples"), [(0.05, 3, 2001), (0.05, -4, 41), (0.005, 30, 301), (0.002, 100, 1001), (0.002, 60, 41)])
def test_nut_keeps_its_turn(lead: float, turns: int, samples: int) -> None:
    """Only the spindle's hinge is given, and after a turn of it all but the nut's height looks the same; from sample to sample up to three turns."""
    data = pusher_of(lead)
    data["coordinate"] = [along("A", {"law": LAW, "from": 0.0, "to": f"{turns} rev", "duration": 1.0})]
    data["actuator"] = [{"joint": "A"}]
    scene = linkdyn.Scene(data)
    often = scene.motion(np.linspace(0, 1, 8 * samples - 7))[0][:, 0]
    run = scene.inverse(t=np.linspace(0, 1, samples), want="all")
    np.testing.assert_allclose(angles(run), angle_of_pusher(often, lead)[::8], rtol=1e-14)


@pytest.mark.accuracy
@pytest.mark.parametrize("method", ["rk8pd", "gbs"])
@pytest.mark.parametrize(("lead", "tolerance"), [(0.05, 1e-10), (0.05, 1e-4), (0.01, 1e-6)])
def test_nut_sinks(method: str, lead: float, tolerance: float) -> None:
    """Let go, it turns the spindle, in steps as long as the tolerance lets them be: at the end of each it is where that says, and energy is kept."""
    run = linkdyn.Scene(pusher_of(lead)).forward(t=np.linspace(0, 1.0, 101), method=method, rtol=tolerance, atol=tolerance, want="all")
    turned = run.q.values[:, 0]
    assert turned[-1] > 1.5 * np.pi
    often = np.interp(np.linspace(0, 100, 1601), np.arange(101), turned)
    np.testing.assert_allclose(angles(run), angle_of_pusher(often, lead)[::16], rtol=1e-13)
    energy = (run.kinetic_energy + run.potential_energy).values
    assert np.ptp(energy) < 100 * tolerance * run.kinetic_energy.values.max()
