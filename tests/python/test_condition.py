"""Condition number of the equations: every solver's against numpy, LAPACK and the quadruple twin."""

from __future__ import annotations

import sys
from pathlib import Path

import linkdyn
import numpy as np
import pytest
from linkdyn.cli import quadruple_twin

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "hard"))

from cases import Case, examples, hard_cases  # noqa: E402
from twin import quadruple_results  # noqa: E402

pytestmark = pytest.mark.accuracy

TWIN = quadruple_twin()
CASES = [*hard_cases(), *examples()]
BY_NAME = {case.name: case for case in CASES}
OFF = 3.0
"""The estimator's factor: 1/rcond may be so much below the true condition number (Higham, ACM TOMS 14, 1988: hardly ever more),
and never above it."""
ROUNDING = 78 * np.finfo(float).eps
"""Times the condition number, of a norm estimated from its own factors: one rounding for each unknown of the largest case."""


def rcond(case: Case, solver: str) -> np.ndarray:
    scene = linkdyn.Scene(case.scene, case.folder)
    return scene.solve(case.q, case.qd, case.qdd, want="rcond", solver=solver)["rcond"]


def printed_matrix(scene: linkdyn.Scene) -> np.ndarray:
    """The matrix that ``explain`` writes in numbers, right-hand side left out."""
    _, *rows = scene.explain(matrix=True).split("In numbers (SI units)")[1].strip().splitlines()
    cells = [row[24:].split()[:-1] for row in rows]
    return np.array([[0.0 if cell == "." else float(cell) for cell in row] for row in cells])


def condition(matrix: np.ndarray) -> float:
    """1-norm condition number, rows and then columns divided by their largest entries."""
    scaled = matrix / np.abs(matrix).max(axis=1, keepdims=True)
    return float(np.linalg.cond(scaled / np.abs(scaled).max(axis=0), 1))


@pytest.mark.parametrize("name", [case.name for case in examples()])
def test_definition(name: str) -> None:
    """The number is that of the printed equations."""
    case = BY_NAME[name]
    scene = linkdyn.Scene(case.scene, case.folder)
    q, qd, qdd = scene.motion(scene.times()[:1])
    true = condition(printed_matrix(scene))
    for solver in ("elimination", "lapack", "gauss-jordan", "reduced"):
        ours = 1 / scene.solve(q, qd, qdd, want="rcond", solver=solver)["rcond"][0]
        # The print has five digits: a change of 5e-6 of the entries changes the condition number by that times itself at most.
        assert true / OFF * (1 - 1e-3) < ours < true * (1 + 1e-3), solver


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_every_solver_has_lapacks(case: Case) -> None:
    """LAPACK's estimator works the same way on other factors: mostly the same number, but for rounding times the condition.
    Rounding may lead one of them to another column of the inverse; both are still within the estimator's factor."""
    reference = rcond(case, "lapack")
    good = np.isfinite(reference)    # not so near to a change point that the sample is flagged
    assert good.mean() > 0.4
    rounding = (ROUNDING / reference)[good]
    for solver in ("elimination", "gauss-jordan", "reduced"):
        ratio = (rcond(case, solver) / reference)[good]
        assert np.all((ratio < OFF * (1 + rounding)) & (ratio > 1 / (OFF * (1 + rounding)))), solver
        assert np.median(np.abs(ratio - 1) / rounding) < 1, solver


@pytest.mark.thorough
@pytest.mark.twin
@pytest.mark.parametrize("name", ["fichter", "four_bar_change_point", "dead_centre_outer", "stretched_dyad", "example_stewart_tsai"])
def test_near_singular_positions(name: str) -> None:
    """Against all columns of the inverse in quadruple precision, to 1e-10 rad from Fichter's singularity."""
    case = BY_NAME[name]
    true = quadruple_results(TWIN, case, "rcond")[:, 0]
    ours = rcond(case, "elimination")
    # A double's rounding of the positions moves a singular matrix by about an epsilon, near dead points by more.
    allowed = 0.01 if name != "four_bar_change_point" else 0.5
    near = 1e4 * np.finfo(float).eps / true
    assert np.all(true <= ours * (1 + allowed + near)) and np.all(ours < OFF * true * (1 + allowed + near))
    if name == "fichter":
        assert true.min() < 1e-12 and 0.3 < np.median(true / case.distance) / np.median(true[-40:] / case.distance[-40:]) < 3


def test_wanted_only_when_asked() -> None:
    case = BY_NAME["example_fourbar"]
    scene = linkdyn.Scene(case.scene, case.folder)
    motion = (case.q, case.qd, case.qdd)
    assert "rcond" not in scene.solve(*motion, want="all")
    assert "rcond" in scene.solve(*motion, want="all,rcond")
    assert "rcond" in scene.solve(*motion, want="checks", solver="lapack")
    together = scene.solve(*motion, want="driving_force,reaction,rcond", error=True)
    np.testing.assert_array_equal(together["rcond"], rcond(case, "elimination"))


def test_errors_are_of_the_forces_whatever_is_wanted() -> None:
    case = BY_NAME["example_fourbar"]
    scene = linkdyn.Scene(case.scene, case.folder)
    motion = (case.q, case.qd, case.qdd)
    of_forces = scene.solve(*motion, want="driving_force", error=True)
    for want in ("rcond", "power", "joint_variable", "checks"):
        np.testing.assert_array_equal(scene.solve(*motion, want=want, error=True)["error"], of_forces["error"])


def test_failed_samples_have_none() -> None:
    """Out of reach: no pose, no matrix."""
    case = BY_NAME["dead_centre_outer"]
    run = linkdyn.Scene(case.scene).solve([[3.9], [4.1]], want="rcond")
    assert run["status"][1] != 0 and np.isnan(run["rcond"][1]) and np.isfinite(run["rcond"][0])


@pytest.mark.parametrize("name", ["fivebar_motors", "fivebar_pick", "stewart_forward", "spatial_slider_crank", "flyball_governor"])
def test_forward_runs_have_it(name: str) -> None:
    """Of the equations of forward dynamics, whose unknowns are accelerations too: as LAPACK's, but for the estimator's factor."""
    scene = linkdyn.load(ROOT / "examples" / name / "scene.toml")
    times = np.linspace(0.0, 0.1, 6)
    plan, lapack = (scene.forward(t=times, solver=solver, want="rcond").rcond.values for solver in ("elimination", "lapack"))
    assert np.all(np.maximum(plan / lapack, lapack / plan) < OFF * (1 + ROUNDING / lapack))


@pytest.mark.parametrize("solver", ["elimination", "lapack", "gauss-jordan", "gauss-jordan-plain", "reduced"])
@pytest.mark.parametrize("name", ["stewart_aris", "stewart_drilling", "tripod"])
def test_singular_poses_are_so_in_all_solvers(name: str, solver: str) -> None:
    """Platforms in the plane of their bases, where legs hold nothing up: what rounding leaves of pivots, or of whole columns, gave 1e19 N
    and 1e34 N with status 0."""
    scene = linkdyn.load(ROOT / "examples" / name / "scene.toml")
    n_q = len(scene.coordinates)
    motions = np.zeros((40, n_q))
    run = scene.inverse(q=motions, qd=motions, qdd=motions, solver=solver)
    assert (run.status == 2).all() and run.driving_force.isnull().all()
