"""Many steps, against exact solutions: rounding does not pile up, energies stay."""

from __future__ import annotations

import sys
from pathlib import Path

import linkdyn
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "hard"))

from long_runs import spin, whirl  # noqa: E402

pytestmark = pytest.mark.accuracy

LEAST = 1e-6
"""What a step may err by, relative, where rounding leaves no more digits (docs/theory.md, "Steps")."""


def test_rounding_of_many_steps_of_rk4() -> None:
    """A rotor that speeds up evenly is a polynomial, exact for rk4: 10^5 steps leave rounding alone. Summed up as it comes it
    would make 6e-11 of the angle, 70 rad, since steps nearly alike round to the same side; its last place is 1.4e-14."""
    run = spin(100_000)
    assert run.steps == 100_000
    assert run.state < 5e-14 and run.energy < 5e-13


def test_rounding_of_extrapolation() -> None:
    """One step of gbs rounds like its way, not like the angle."""
    run = spin(0, "gbs", rtol=1e-14, atol=1e-14)
    assert run.state < 5e-14 and run.energy < 5e-13


@pytest.mark.parametrize(
    ("method", "settings", "state", "energy"),
    [
        ("rk4", {"per_turn": 400}, 3e-7, 5e-10),
        ("rkf45", {"rtol": 1e-10, "atol": 1e-10}, 5e-5, 1.5e-7),
        ("rk8pd", {"rtol": 1e-12, "atol": 1e-12}, 1.5e-8, 5e-11),
        ("msbdf", {"rtol": 1e-10, "atol": 1e-10}, 1.5e-5, 5e-8),
        ("gbs", {"rtol": 1e-12, "atol": 1e-12}, 1.2e-7, 3e-10),
    ],
)
def test_fifty_turns_of_a_pendulum(method: str, settings: dict, state: float, energy: float) -> None:
    """The bounds are two to three times what the methods reach (docs/accuracy.md has a thousand turns); the state's error
    grows with the square of the time, the energy's with the time."""
    short, long = (whirl(turns, 5, method, **settings) for turns in (10, 50))
    assert long.state < state and long.energy < energy
    assert long.energy < 8 * short.energy + 1e-14


def test_row_of_parallelograms() -> None:
    """Forty in a row come to their change points all at once, twenty times, the last one known the worst: the run goes through
    at loose and tight tolerances, keeps its energy, and comes to the same place.

    Where rounding leaves no more digits a step may err by `LEAST` of the rate and of the angle, which counts as a turn at most.
    The rate's part changes the energy by twice of it. A change dE of the energy is one of the speed v by v dE/2T, with T the
    kinetic energy, and all errors at the end are of the time at which the motion gets there, since it has one path only.
    """
    scene = linkdyn.load(ROOT / "examples" / "n_fourbar" / "scene_40.toml")
    ends, late = [], 0.0
    for tolerance in (1e-9, 1e-12):
        run = scene.forward(rtol=tolerance, atol=tolerance, want="power")
        assert run.attrs["stopped"] == "" and np.all(run.status == 0)
        passed = run.attrs["change_points_passed"]
        assert passed == 20
        energy, kinetic, speed = (run.kinetic_energy + run.potential_energy).values, run.kinetic_energy.values, np.abs(run.qd.values[:, 0])
        change = abs(energy - energy[0]).max()
        assert change < passed * 2 * LEAST * kinetic.max()
        late += np.trapezoid(change / (2 * kinetic), run.time.values) + passed * LEAST * 2 * np.pi / speed.min()
        ends.append(run.q.values[-1, 0])
    assert abs(ends[1] - ends[0]) < speed[-1] * late
