"""The lecture's main program, rebuilt from its modules, against the general engine on the same mechanism."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import linkdyn
from linkdyn.lecture import Angle

pytestmark = pytest.mark.accuracy

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SPEC = importlib.util.spec_from_file_location("sixbar", EXAMPLES / "lecture_sixbar" / "sixbar.py")
sixbar = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(sixbar)


@pytest.mark.parametrize("file, inclined", [("scene.toml", False), ("scene_inclined.toml", True)])
def test_forces(file: str, inclined: bool) -> None:
    scene = linkdyn.load(EXAMPLES / "sixbar_slider" / file)
    theta = np.radians(np.arange(361.0))
    found = sixbar.analyse(*sixbar.rail(inclined), Angle(theta, sixbar.RATE))
    q = theta[:, np.newaxis]
    run = scene.inverse(q=q, qd=np.full_like(q, sixbar.RATE), qdd=np.zeros_like(q))
    # Both roads lose a few roundings of the largest force; the linkage keeps well away from its dead points.
    tolerance = 32 * np.finfo(float).eps * float(abs(run.reaction).max())
    for k in range(6):
        got = run.reaction.sel(joint=f"J{k}", component=["Fx", "Fy"])
        assert np.abs(got.values - found["forces"][:, k]).max() <= tolerance, f"J{k}"
    psi = 0.2 * inclined
    wrench = run.reaction.sel(joint="J6").values
    assert np.abs(wrench[:, 0] - found["normal"] * np.sin(psi)).max() <= tolerance
    assert np.abs(wrench[:, 1] + found["normal"] * np.cos(psi)).max() <= tolerance
    assert np.abs(wrench[:, 2] - found["tau_j6"]).max() <= tolerance
    assert np.abs(run.driving_force.values[:, 0] - found["tau_i"]).max() <= tolerance


def test_power() -> None:
    """Over a full turn at constant rate the crank's work is that against the load, which gives back what it takes."""
    theta = Angle(np.linspace(0.0, 2 * np.pi, 720, endpoint=False), sixbar.RATE)
    found = sixbar.analyse(*sixbar.rail(True), theta)
    work = found["tau_i"].mean() * 2 * np.pi
    # The mean of a smooth periodic function over equal steps is its integral but for rounding.
    assert abs(work) <= 1e3 * np.finfo(float).eps * np.abs(found["tau_i"]).max()
