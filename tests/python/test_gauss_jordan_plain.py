"""The plain method, which does not pivot: right where it works, and it says so where it does not."""

from __future__ import annotations

import sys
from pathlib import Path

import linkdyn
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "hard"))

from cases import Case, examples, hard_cases  # noqa: E402

pytestmark = pytest.mark.accuracy

PLAIN = "gauss-jordan-plain"
CASES = {case.name: case for case in [*hard_cases(), *examples()]}


def forces(case: Case, solver: str) -> tuple[np.ndarray, np.ndarray]:
    run = linkdyn.Scene(case.scene, case.folder).solve(case.q, case.qd, case.qdd, want="driving_force,reaction", solver=solver)
    n = len(case.q)
    return np.hstack([run[name].reshape(n, -1) for name in ("driving_force", "reaction")]), run["status"]


@pytest.mark.parametrize("name", [name for name in CASES if name.startswith("example_")])
def test_examples(name: str) -> None:
    """Rows in order, the plain method serves every example; three digits may go where a pivot comes out small."""
    ours, status = forces(CASES[name], PLAIN)
    reference, _ = forces(CASES[name], "lapack")
    assert (status == 0).all()
    assert np.abs(ours - reference).max() < 1e-12 * np.abs(reference).max()


def test_zero_pivots_are_flagged() -> None:
    """No representative pose closes, so nothing is known by which to put rows in order: the first zero on the diagonal ends it."""
    ours, status = forces(CASES["dead_centre_outer"], PLAIN)
    assert (status == 2).all() and np.isnan(ours).all()
    _, status = forces(CASES["dead_centre_outer"], "gauss-jordan")
    assert (status == 0).all()
