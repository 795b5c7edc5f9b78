"""Inverse dynamics against itself by roads that share little."""
from __future__ import annotations

from typing import Any

import linkdyn
import numpy as np


def hold_together(content: dict[str, Any], first: str, second: str, size: float = 0.5) -> None:
    """Hold two links of a spatial scene whose axes coincide, as a weld would, by a hinge and a brace, which closed forms know nothing of: what
    loops they are in is closed by iteration.

    Parameters
    ----------
    size
        How far the ends of the brace are from the hinge [m].
    """
    brace = f"{second}_brace"
    links = {link["name"]: link for link in content["link"]}
    links[first]["markers"] |= {"hinge": [0, 0, 0], "brace": [size, 0, 0]}
    links[second]["markers"] |= {"hinge": [0, 0, 0], "brace": {"at": [0, size, 0], "axis": [0, 0, 1]}}
    content["link"].append({"name": brace, "mass": 0.0, "markers": {"U": {"at": [0, 0, 0], "axis": [1, 0, 0]}, "S": [0, 0, size * 2**0.5]}})
    content["joint"] += [{"name": f"{brace}_R", "type": "revolute", "between": [f"{first}.hinge", f"{second}.hinge"]},
                         {"name": f"{brace}_U", "type": "universal", "between": [f"{second}.brace", f"{brace}.U"]},
                         {"name": f"{brace}_S", "type": "spherical", "between": [f"{brace}.S", f"{first}.brace"]}]


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
