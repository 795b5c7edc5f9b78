"""Runs of a scene share what is traced of it: which run comes first, or on which thread, changes no bit."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
ENDS = {"fourbar_start": 0.5, "andrews": 0.02, "stewart_forward": 0.2, "spatial_slider_crank": 0.3, "valve_train": 0.004, "hoist": 0.3, "loader_crane": 0.7, "fivebar_pick": 0.1,
        "hill_start": 1.0, "agile_eye": 0.3, "knuckle_press": 0.1}  # fmt: skip
"""Closed forms, forces of a motion, legs, groups closed by iteration, cams, lossy motors, controllers, clutches, redundancy, friction [s]."""


def load(name: str) -> linkdyn.Scene:
    return linkdyn.load(ROOT / "examples" / name / "scene.toml")


def run(scene: linkdyn.Scene, name: str, method: str = "rk8pd") -> Any:
    return scene.forward(t=np.linspace(0.0, ENDS[name], 9), method=method)


def assert_same(a: Any, b: Any) -> None:
    for result in a.data_vars:
        np.testing.assert_array_equal(a[result].values, b[result].values, err_msg=str(result))
    for said in ("steps", "rejected_steps", "right_hand_sides", "stopped"):
        assert a.attrs[said] == b.attrs[said]


@pytest.mark.parametrize("name", ENDS)
def test_the_second_run_is_the_first(name: str) -> None:
    scene = load(name)
    first = run(scene, name)
    run(scene, name, "gbs")
    assert_same(run(scene, name), first)


@pytest.mark.parametrize("name", ["fourbar_start", "spatial_slider_crank"])
def test_on_threads(name: str) -> None:
    """Both want what the other may be making; the scene is let go of while they run."""
    alone = run(load(name), name)
    with ThreadPoolExecutor(4) as pool:
        waiting = [pool.submit(run, scene, name) for scene in [load(name)] * 4]
    for other in waiting:
        assert_same(other.result(), alone)


def test_simulators_start_again() -> None:
    scene = load("fourbar_constant_torque")

    def go(simulator: Any) -> Any:
        for _ in range(200):
            simulator.step(1e-3, [1.5])
        return np.concatenate([simulator.q, simulator.qd])

    simulator = scene.simulator()
    first = go(simulator)
    simulator.reset()
    np.testing.assert_array_equal(go(simulator), first)
    np.testing.assert_array_equal(go(scene.simulator()), first)
