"""Hard cases against the quadruple twin: error estimates hold and are not vague, methods reach what the data allow."""

from __future__ import annotations

import sys
from pathlib import Path

import linkdyn
import numpy as np
import pytest
from linkdyn.cli import quadruple_twin

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "hard"))

from cases import Case, examples, hard_cases  # noqa: E402
from twin import forces_of, quadruple_forces, true_errors  # noqa: E402

TWIN = quadruple_twin()
SOLVERS = ("elimination", "lapack", "gauss-jordan")
CASES = hard_cases()
DATA_LIMITED = ("stretched_dyad", "dead_centre_inner")
"""Here sum or difference of the lengths and the slide are exact by chance, and so is the closure; the estimate, which takes
data for rounded, cannot know."""

pytestmark = pytest.mark.skipif(TWIN is None, reason="linkdyn-real128 is not built (make real128)")


@pytest.fixture(scope="module")
def exact() -> dict[str, np.ndarray]:
    """Forces of all cases in quadruple precision."""
    return {case.name: quadruple_forces(TWIN, case) for case in [*CASES, *examples()]}


def run_case(case: Case, solver: str):
    return linkdyn.Scene(case.scene, case.folder).inverse(
        q=case.q, qd=case.qd, qdd=case.qdd, want="driving_force,reaction", solver=solver, error=True
    )


def ratios(case: Case, solver: str, exact: dict[str, np.ndarray]) -> np.ndarray:
    """True error over estimate, of all components that are not zero by nature."""
    run = run_case(case, solver)
    true, estimate = true_errors(forces_of(run), exact[case.name]), forces_of(run, "_error")
    counts = np.isfinite(true) & ((true > 0) | (estimate > 0))
    with np.errstate(divide="ignore"):
        return true[counts] / estimate[counts]


@pytest.mark.parametrize("solver", SOLVERS)
def test_estimates_hold(solver: str, exact: dict[str, np.ndarray]) -> None:
    """At least 99.9 % of all true errors are below their estimates, and the median estimate is no more than 100 times too
    large; for each case alone 200 times, where data are not exact by chance."""
    together = []
    for case in CASES:
        ratio = ratios(case, solver, exact)
        together.append(ratio)
        # One case has few samples, whose components err together: a sample in a hundred may be out, by a factor 3.
        assert np.mean(ratio > 1) <= 0.01 and ratio.max() < 3, case.name
        if case.name not in DATA_LIMITED:
            assert np.median(ratio) > 0.005, case.name
    ratio = np.concatenate(together)
    assert np.mean(ratio > 1) <= 0.001
    assert 0.01 < np.median(ratio) < 0.2


def test_estimates_hold_on_examples(exact: dict[str, np.ndarray]) -> None:
    """Easy samples are no exception."""
    ratio = np.concatenate([ratios(case, "elimination", exact) for case in examples()])
    assert np.mean(ratio > 1) <= 0.001
    assert np.median(ratio) > 0.01


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_methods_reach_what_data_allow(case: Case, exact: dict[str, np.ndarray]) -> None:
    """No solver errs by more than the change that the data's own last digits make, times a modest factor: none is
    unstable where the problem is only sensitive."""
    for solver in SOLVERS:
        run = run_case(case, solver)
        forces = forces_of(run)
        worst = true_errors(forces, exact[case.name]).max(axis=1) / np.abs(forces).max(axis=1)
        # error: the estimate, twenty times what changes of the last place do
        good = run.status.values == 0
        assert np.all((worst <= np.maximum(3 * run.error.values, 1e-14))[good]), solver


def test_failures_are_flagged() -> None:
    """At the dead point itself there is no number to be trusted: NaN and a status, or an infinite or useless estimate."""
    case = next(case for case in CASES if case.name == "dead_centre_outer")
    run = linkdyn.Scene(case.scene).inverse(q=[[1.03 + 2.97]], qd=[[0.1]], qdd=[[0.1]], error=True)
    assert run.status.values[0] != 0 or run.error.values[0] > 0.1
