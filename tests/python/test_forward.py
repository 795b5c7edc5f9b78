"""Forward runs from Python: energy where nothing is lost, and what is refused."""

from pathlib import Path
import tomllib

import numpy as np
import pytest

import linkdyn

EXAMPLES = Path(__file__).parents[2] / "examples"


def free_running(name: str) -> linkdyn.Scene:
    """An example whose actuators give nothing, so that kinetic and potential energy sum to a constant."""
    description = tomllib.loads((EXAMPLES / name / "scene.toml").read_text())
    for actuator in description["actuator"]:
        actuator["law"] = {"type": "constant", "value": 0.0}
    return linkdyn.Scene(description)


def test_energy_of_a_free_run_stays():
    # The power balance of a sample uses its own accelerations and cannot see a wrong bias acceleration; energy can.
    run = free_running("rcsp_start").forward(t_end=1.0, rtol=1e-11, atol=1e-12)
    total = (run.kinetic_energy + run.potential_energy).values
    swing = np.ptp(run.kinetic_energy.values)
    assert swing > 0.1  # it does move
    # Errors of some hundred steps at a tolerance of 1e-11 each.
    assert np.ptp(total) < 1e-8 * swing


@pytest.mark.parametrize("name", ["fourbar", "fivebar_parallel", "slider_crank", "andrews"])
def test_planar_runs_find_the_motion_back(name):
    # The drives give what inverse dynamics of the motion asks for; started on the motion, the mechanism keeps to it.
    description = tomllib.loads((EXAMPLES / name / "scene.toml").read_text())
    motion = linkdyn.Scene(description).inverse()
    for k, coordinate in enumerate(description["coordinate"]):
        coordinate["start"] = {"position": float(motion.q[0, k]), "velocity": float(motion.qd[0, k])}
    run = linkdyn.Scene(description).forward(rtol=1e-13, atol=1e-13)
    # Local errors of some hundred steps, and their growth along the motion.
    for quantity in ("q", "reaction"):
        scale = abs(motion[quantity]).max()
        np.testing.assert_allclose(run[quantity], motion[quantity], rtol=0, atol=1e-9 * scale, err_msg=quantity)
    assert abs(run.closure).max() < 1e-14
