"""Inverse dynamics against itself by roads that share little."""
from __future__ import annotations

import linkdyn
import numpy as np


def agrees_with_itself(scene: linkdyn.Scene, step: float, within: float) -> None:
    """About 0.3 s of the motion power is in balance, solvers agree, rates are what differences of places say.

    Parameters
    ----------
    step
        Between the places [s].
    within
        How well rates are told by them [m/s, rad/s].
    """
    t = 0.3 + step * np.arange(-2, 3)
    run = scene.inverse(*scene.motion(t), want="all")
    assert np.abs(run.power_imbalance).max() < 1e-12
    for solver in ("lapack", "reduced"):
        other = scene.inverse(*scene.motion(t), solver=solver)
        np.testing.assert_allclose(other.driving_force, run.driving_force, rtol=0, atol=1e-11 * float(np.abs(run.driving_force).max()))
    x = run.joint_variable.values
    slope = (x[0] - 8 * x[1] + 8 * x[3] - x[4]) / (12 * step)
    np.testing.assert_allclose(run.joint_rate.values[2], slope, rtol=0, atol=within)
