"""Stiff scenes against exact solutions: a bar held by a spring and damper a million times faster than its motion."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import linkdyn

ROOT = Path(__file__).parents[2]
INERTIA, STIFFNESS, DAMPING = 0.75, 4e6, 3e4    # rates of -133.8 and -39866 1/s
TARGET = {"mean": 0.4, "amplitude": 0.3, "frequency": 2.0}


def led_bar() -> linkdyn.Scene:
    """A bar on a hinge without gravity, led along a harmonic target by a hard spring and damper; it starts off the target."""
    return linkdyn.Scene(
        {
            "space": "planar",
            "frame": {"markers": {"O": [0.0, 0.0]}},
            "link": [{"name": "bar", "markers": {"A": [0.0, 0.0]}, "mass": 2.0, "cog": [0.5, 0.0], "inertia": INERTIA - 0.5}],
            "joint": [{"name": "J", "type": "revolute", "between": ["frame.O", "bar.A"]}],
            "coordinate": [{"joint": "J", "start": {"position": 0.0, "velocity": 0.0}}],
            "actuator": [
                {"joint": "J", "law": {"type": "pd", "stiffness": STIFFNESS, "damping": DAMPING, "target": {"law": "harmonic", **TARGET}}}
            ],
        }
    )


def exact(t: np.ndarray) -> np.ndarray:
    """The angle, by the matrix exponential: the target swings as a pair of states of its own, its mean is a constant one."""
    k, d, w = STIFFNESS / INERTIA, DAMPING / INERTIA, TARGET["frequency"]
    system = np.array([
        [0, 1, 0, 0, 0],
        [-k, -d, k, d, k * TARGET["mean"]],
        [0, 0, 0, 1, 0],
        [0, 0, -(w**2), 0, 0],
        [0, 0, 0, 0, 0],
    ])  # fmt: skip
    start = np.array([0.0, 0.0, 0.0, TARGET["amplitude"] * w, 1.0])
    return np.array([(expm(system * time) @ start)[0] for time in t])


@pytest.mark.parametrize("tolerance", [1e-4, 1e-7, 1e-9])
def test_seulex_steps_over_what_has_died_out(tolerance: float) -> None:
    """The error is that of the tolerance, and the steps are a hundredth at most of those of an explicit method, whose
    stability ends near 2/4e4 s: sixty thousand of them."""
    t = np.linspace(0.0, 3.0, 61)
    run = led_bar().forward(t=t, method="seulex", rtol=tolerance, atol=tolerance)
    assert run.attrs["stopped"] == ""
    assert abs(run.q.values[:, 0] - exact(t)).max() < 20 * tolerance
    assert run.attrs["steps"] < 600


def test_start_off_the_slow_motion_is_followed() -> None:
    """Within the first milliseconds, where the bar is pulled to its target, as rk8pd has it."""
    t = np.linspace(0.0, 0.02, 41)
    run, other = (led_bar().forward(t=t, method=method, rtol=1e-9, atol=1e-9) for method in ("seulex", "rk8pd"))
    assert abs(run.q.values - other.q.values).max() < 1e-8
    assert abs(run.qd.values - other.qd.values).max() < 1e-8 * abs(other.qd.values).max()


def test_a_step_too_long_is_no_rounding() -> None:
    """A toggle press that a constant force lets run through its kinks: copies of the first long step part, those of a quarter do not."""
    scene = linkdyn.load(ROOT / "examples" / "toggle_clamp" / "scene.toml")
    content = {key: value for key, value in tomllib.loads(scene.text).items() if key not in ("stop", "time")}
    content["actuator"] = [{"joint": "nut", "law": {"type": "constant", "value": -7099.544968667589}}]
    scene, t = linkdyn.Scene(content, folder=scene.folder), np.linspace(0, 0.6, 16)
    run, other = (scene.forward(t=t, method=method, rtol=tolerance, atol=tolerance) for method, tolerance in (("seulex", 1e-7), ("gbs", 1e-10)))
    # Of tolerances about 1e-7 seulex makes 5e-9 to 2e-6, by where its steps meet the kinks, which hangs on the last bits of the rates.
    np.testing.assert_allclose(run.q.values, other.q.values, rtol=0, atol=4e-6)
