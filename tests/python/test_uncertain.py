"""Near change points and dead points: what has lost its digits is flagged, by every solver alike."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import linkdyn

sys.path.insert(0, str(Path(__file__).parents[1] / "hard"))

from cases import four_bar  # noqa: E402

SOLVERS = ("elimination", "lapack", "gauss-jordan", "reduced")


@pytest.mark.parametrize("angle", 10.0 ** -np.arange(1.0, 13.0))
def test_change_point_of_a_parallelogram(angle: float) -> None:
    """The parallelogram moves as its crank, so its torque is known by hand; it is right to three digits, or none is given. Of
    the solvers none says otherwise than the others."""
    given = four_bar("Parallelogram", 1.0, 2.0, 1.0, 2.0) | {"gravity": [0.0, 0.0], "load": []}
    scene = linkdyn.Scene(given)
    rate2 = 3.0
    states = {"q": [[np.pi - 0.5], [np.pi - angle]], "qd": [[4.0]] * 2, "qdd": [[rate2]] * 2}
    found = []
    for solver in SOLVERS:
        run = scene.inverse(**states, solver=solver)
        found.append(int(run.status.values[-1]))
        if found[-1] == 0:
            # Crank of 2 kg and follower of 3 kg turn about their ends, the coupler of 5 kg moves along a circle.
            want = ((2 + 3) * (0.1 + 0.5**2 + 0.0625**2) + 5) * rate2
            # An error of the accelerations is one of forces of the coupler along the bars: 5 kg, 16 m/s^2.
            assert abs(run.driving_force.values[-1, 0] - want) < 1e-3 * (want + 5 * 16)
        else:
            assert np.isnan(run.driving_force.values[-1]).all()
    assert len(set(found)) == 1
    assert (found[0] == 0) == (angle > 5e-4)
