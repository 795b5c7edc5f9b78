"""The shaking moment of a rod that spins idly, on a frame that turns: what the frame takes from the joints and the drive, and no more."""

from __future__ import annotations

import tomllib
from pathlib import Path

import linkdyn
import numpy as np
import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("about_line", [0.0, 0.05])
def test_a_frame_does_not_take_an_idle_spin_along(about_line: float) -> None:
    """By the reactions alone, whatever the rod's inertia about its line, which has no part in them."""
    scene = tomllib.loads((ROOT / "tests/scenes/rssr.toml").read_text(encoding="utf-8"))
    scene["link"][1]["inertia"] = {"diagonal": [about_line, 0.2, 0.2]}
    scene["frame"]["motion"] = {
        "yaw": {"law": "harmonic", "mean": 0.2, "amplitude": 0.8, "frequency": 3.0},
        "roll": {"law": "harmonic", "amplitude": 0.5, "frequency": 4.0},
    }
    scene["coordinate"][0]["motion"] = {"law": "harmonic", "amplitude": 0.5, "frequency": 6.0}
    scene["time"] = {"end": 1.0, "samples": 51}
    run = linkdyn.Scene(scene).inverse()
    assert (run.status == 0).all()
    shaking = run.linkdyn.shaking()
    force, moment = np.zeros((51, 3)), np.zeros((51, 3))
    for joint in "AD":
        marker = scene["frame"]["markers"][joint]
        place = np.array(marker["at"] if isinstance(marker, dict) else marker)
        reaction = -run.reaction.sel(joint=joint).values
        force += reaction[:, :3]
        moment += reaction[:, 3:] + np.cross(place, reaction[:, :3])
    moment[:, 2] -= run.driving_force.values[:, 0]           # at A, about z
    np.testing.assert_allclose(shaking.force.values, force, atol=1e-10 * np.abs(force).max())
    np.testing.assert_allclose(shaking.moment.values, moment, atol=1e-10 * np.abs(moment).max())
