"""Instants of output are looked at within the steps: they change nothing of these, nor of each other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
METHODS = ["rk8pd", "rkf45", "gbs", "seulex"]
ENDS = {"fourbar_start": 1.0, "andrews": 0.03, "stewart_forward": 0.3, "spatial_slider_crank": 0.5, "cart_pole": 1.0,
        "stopped_rocker": 0.6, "fourbar_constant_torque": 0.5, "rcsp_start": 0.4, "flyball_governor": 0.2, "agile_eye": 1.0, "screw_lift": 1.0}  # fmt: skip
"""Closed forms, forces that the scene's motion asks for, groups closed by iteration, chains, controllers, end stops, exchange of coordinates, stiff [s]."""
EVERY = (200, 10, 1)
"""Of 401 instants."""


def load(name: str) -> linkdyn.Scene:
    return linkdyn.load(ROOT / "examples" / name / "scene.toml")


def run(name: str, every: int, n: int = 401, **options: Any) -> Any:
    return load(name).forward(t=np.linspace(0.0, ENDS[name], n)[::every], **options)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ENDS)
def test_they_change_nothing(name: str, method: str) -> None:
    """States and steps to the last bit; accelerations may come from a record of the batch, or not."""
    few, some, many = (run(name, every, method=method) for every in EVERY)
    for fewer, every in zip((few, some), EVERY):
        for said in ("steps", "rejected_steps", "stopped"):
            assert fewer.attrs[said] == many.attrs[said]
        same = many.isel(sample=slice(None, None, every))
        n = min(fewer.sizes["sample"], same.sizes["sample"])
        for result in ("q", "qd", "status"):
            np.testing.assert_array_equal(fewer[result].values[:n], same[result].values[:n], err_msg=result)
        np.testing.assert_allclose(fewer.qdd.values[:n], same.qdd.values[:n], rtol=1e-9, atol=1e-9 * np.abs(many.qdd).max().item())


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["fourbar_start", "andrews", "fivebar_motors", "engine_balance"])
def test_they_are_as_good_as_steps(name: str, method: str, tolerance: float) -> None:
    """Against a run of a tolerance ten times smaller or more, at instants that are ends of no step."""
    scene = load(name)
    t = scene.times()[:: max(1, len(scene.times()) // 200)]
    t = np.linspace(t[0], t[0] + min(0.05 if name == "andrews" else 0.4, t[-1] - t[0]), 301)
    good = scene.forward(t=t, method="gbs", rtol=1e-13, atol=1e-13)
    there = scene.forward(t=t, method=method, rtol=tolerance, atol=tolerance)
    ends = scene.forward(t=t[[0, -1]], method=method, rtol=tolerance, atol=tolerance)
    assert (there.status == 0).all()
    error = np.abs(there.q - good.q).max().item()
    at_end = np.abs(ends.q[-1] - good.q[-1]).max().item()
    assert error <= 10 * at_end + tolerance


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["fourbar_start", "andrews"])
def test_they_cost_no_steps_of_their_own(name: str, method: str) -> None:
    """What is looked at a hundred times in a step takes some iterations there."""
    few, many = run(name, 2000, 2001, method=method), run(name, 1, 2001, method=method)
    assert many.attrs["steps"] == few.attrs["steps"]
    assert many.attrs["right_hand_sides"] <= few.attrs["right_hand_sides"] + 60 * few.attrs["steps"]


AT_STEPS = {"fourbar_constant_torque": 5.0, "andrews": 0.05, "stewart_forward": 1.0, "spatial_slider_crank": 3.0, "rcsp_start": 2.0, "fourbar_start": 4.0}
"""Whole turns, exchanges of coordinates, and a run that may stop [s]."""


@pytest.mark.parametrize("method", ["rk8pd", "gbs"])
@pytest.mark.parametrize("name", AT_STEPS)
def test_instants_of_several_steps_are_told_as_each_alone(name: str, method: str) -> None:
    """About one instant a step: states of several steps stand on the lanes together, each with its own assembly, turns and step."""
    t = np.linspace(0.0, AT_STEPS[name], 161)
    many = load(name).forward(t=t, method=method, rtol=1e-6, atol=1e-6)
    few = load(name).forward(t=t[::20], method=method, rtol=1e-6, atol=1e-6)
    same = many.isel(sample=slice(None, None, 20))
    for said in ("steps", "stopped", "coordinates_integrated"):
        assert few.attrs[said] == many.attrs[said]
    for result in {"q", "qd", "status", "step", "stand_in"} & set(many):
        np.testing.assert_array_equal(few[result].values, same[result].values, err_msg=result)
    for result in ("joint_variable", "joint_rate", "reaction"):
        size = np.nanmax(np.abs(many[result].values))
        np.testing.assert_allclose(few[result].values, same[result].values, rtol=0.0, atol=1e-11 * size, err_msg=result)


@pytest.mark.parametrize(("name", "end", "method"), [("delta", 0.5, "rk8pd"), ("tripod", 0.5, "gbs"), ("valve_train", 0.3, "gbs"), ("valve_train", 0.3, "seulex")])
def test_where_a_run_takes_breath_changes_no_bit(name: str, end: float, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Forces of the scene's motion and solutions within a step were found from where groups had stood at whatever was evaluated before."""
    runs = []
    for breath, block in ((1e9, 4096), (1e9, 7), (1e-9, 4096)):
        monkeypatch.setattr("linkdyn.scene.BREATH", breath)
        monkeypatch.setattr("linkdyn.scene.RUN_BLOCK", block)
        runs.append(load(name).forward(t=np.linspace(0.0, end, 151), method=method, rtol=1e-7, atol=1e-7))
    for other in runs[1:]:
        for result, values in runs[0].data_vars.items():
            np.testing.assert_array_equal(other[result].values, values.values, err_msg=str(result))
