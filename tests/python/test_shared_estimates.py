"""Error estimates of reactions that the equations leave open, against the quadruple twin."""

from __future__ import annotations

import sys
from pathlib import Path

import linkdyn
import numpy as np
import pytest
from linkdyn.cli import quadruple_twin
from test_shared_by_record import SCENES, about_start

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "hard"))

from cases import Case  # noqa: E402
from estimates import assert_holds, assert_not_vague, join_samples  # noqa: E402
from twin import forces_of, quadruple_forces, ratio_to_estimate, true_errors  # noqa: E402

TWIN = quadruple_twin()
NEAR = 0.05
"""Reach of the coordinates about the start."""
FEW = 12
"""States of each scene: the twin takes its time."""

pytestmark = [
    pytest.mark.accuracy,
    pytest.mark.twin,
]


def ratios(spec: dict, name: str, solver: str = "elimination") -> np.ndarray:
    """True error over estimate (N, width)."""
    scene = linkdyn.Scene(spec)
    q, qd, qdd = (states[:FEW] for states in about_start(scene, NEAR))
    case = Case(name, name, spec, q, qd, qdd, np.full(len(q), np.nan))
    run = scene.inverse(q=q, qd=qd, qdd=qdd, want="driving_force,reaction", solver=solver, error=True)
    return ratio_to_estimate(true_errors(forces_of(run), quadruple_forces(TWIN, case)), forces_of(run, "_error"))


@pytest.mark.thorough
@pytest.mark.parametrize("solver", ["elimination", "lapack"])
def test_estimates_hold(solver: str) -> None:
    """By the sum of squares and by stiffness: of joints, and of links that give way."""
    together = join_samples([ratios(spec, name, solver) for name, spec in SCENES.items()])
    assert_holds(together, solver)
    assert_not_vague(together, solver)
