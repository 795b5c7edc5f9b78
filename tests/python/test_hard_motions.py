"""Hard cases in motion order: mechanisms are carried through what is hard on their assembly, the forces are as good as the data
allow, and what cannot be known is flagged."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from linkdyn.cli import executable, quadruple_twin

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "hard"))

from cases import Case, motion_cases  # noqa: E402
from estimates import assert_holds, exceed, most  # noqa: E402
from twin import ratio_to_estimate, run_states, true_errors  # noqa: E402

pytestmark = pytest.mark.accuracy

TWIN = quadruple_twin()
CASES = {case.name: case for case in motion_cases()}
SOLVERS = ("elimination", "lapack", "gauss-jordan")
EPS = np.finfo(float).eps
WANT = ("--want", "driving_force,reaction,joint_variable", "--error")


def run(case: Case, solver: str = "elimination", program: Path | None = None) -> dict[str, np.ndarray]:
    return run_states(program or executable(), case, *WANT, solver=solver, time=case.time)


def stacked(results: dict[str, np.ndarray], suffix: str = "") -> np.ndarray:
    return np.concatenate([results[f"driving_force{suffix}"], results[f"reaction{suffix}"]], axis=1)


def between(angle: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Difference of two angles but for turns."""
    return np.abs(np.remainder(angle - other + np.pi, 2 * np.pi) - np.pi)


def follower_angle(case: Case, folds: tuple[float, ...]) -> np.ndarray:
    """Of a four-bar, from two circles; it changes sides where it folds flat, at these crank angles."""
    crank, coupler, follower = (link["markers"]["B"][0] for link in case.scene["link"])
    ground = case.scene["frame"]["markers"]["Q"][0]
    q = case.q[:, 0]
    side = np.ones(len(q))
    for fold in folds:
        side *= (-1.0) ** np.floor((q - fold) / (2 * np.pi)) * (-1.0) ** np.floor((q[0] - fold) / (2 * np.pi))
    x, y = crank * np.cos(q), crank * np.sin(q)
    dx, dy = ground - x, -y
    distance = np.hypot(dx, dy)
    along = (coupler**2 - follower**2 + distance**2) / (2 * distance)
    off = side * np.sqrt(np.maximum(coupler**2 - along**2, 0))
    tip_x, tip_y = x + (along * dx - off * dy) / distance, y + (along * dy + off * dx) / distance
    return np.arctan2(tip_y, tip_x - ground)


@pytest.mark.parametrize(
    ("name", "folds"),
    [("four_bar_through", (0.0,)), ("parallelogram_through", (0.0, np.pi))]
    + [(name, ()) for name in CASES if name.startswith("near_parallelogram")],
)
def test_four_bars_keep_their_assembly(name: str, folds: tuple[float, ...]) -> None:
    case = CASES[name]
    results = run(case)
    assert np.all(results["status"] == "ok")
    # Two circles that nearly touch lose half of the digits, 1e-8, over the distance.
    error = between(results["joint_variable"][:, 3], follower_angle(case, folds))
    assert error.max() < 1e-5
    if name == "parallelogram_through":
        assert between(results["joint_variable"][:, 3], case.q[:, 0]).max() < 1e-13


@pytest.mark.parametrize("name", [name for name in CASES if name.startswith("slider_crank")])
def test_slider_cranks_keep_their_assembly(name: str) -> None:
    """The piston stays on its side of the crank, where both sides come within a thousandth of the crank's length."""
    case = CASES[name]
    results = run(case)
    assert np.all(results["status"] == "ok")
    rod = case.scene["link"][1]["markers"]["B"][0]
    want = np.cos(case.q[:, 0]) + np.sqrt((rod - np.sin(case.q[:, 0])) * (rod + np.sin(case.q[:, 0])))
    np.testing.assert_allclose(results["joint_variable"][:, 3], want, atol=1e-12)


def test_a_driven_crank_at_its_dead_centres() -> None:
    """Two samples are dead centres: no number there. A slide's positions do not say whether the crank turns on or back; it is
    taken to turn back."""
    case = CASES["dead_centres"]
    results = run(case)
    dead = case.distance < 1e-6
    assert dead.sum() == 2 and np.all(results["status"][dead] == "singular") and np.all(results["status"][~dead] == "ok")
    assert np.all(np.isnan(stacked(results)[dead]))
    # Near a dead centre the slide, a double, says where the crank is to 1e-16/distance.
    want = np.arccos(np.cos(case.time[~dead] + np.pi / 4))
    assert between(results["joint_variable"][~dead, 0], want).max() < 1e-12


@pytest.mark.thorough
@pytest.mark.twin
def test_forces_and_estimates() -> None:
    """Against the twin along the same motion: estimates hold, and no solver is worse than the data."""
    for case in CASES.values():
        exact = stacked(run_states(TWIN, case, "--want", "driving_force,reaction", time=case.time))
        for solver in SOLVERS:
            results = run(case, solver)
            forces, estimate = stacked(results), stacked(results, "_error")
            good = results["status"][:, 0] == "ok"
            # the dead centres themselves, two samples of one motion
            assert np.sum(~good) <= np.sum(case.distance < 1e-6)
            true = true_errors(forces, exact)
            worst = true[good].max(axis=1) / np.abs(exact[good]).max(axis=1)
            rounding = forces.shape[1] * EPS
            out = worst > np.maximum(results["error"][good, 0], rounding)
            assert np.sum(out) <= most(len(out), exceed(1.0)), (case.name, solver)
            # What is not near a difficulty has its digits: three go with each decade of the distance.
            far = case.distance[good] > 0.3
            assert worst[far].max() < rounding / 0.3**3, (case.name, solver)
            assert_holds(ratio_to_estimate(true, estimate), f"{case.name}, {solver}")
