"""Many steps, against exact solutions: rounding does not pile up, energies stay."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import linkdyn
import mpmath
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "hard"))

from long_runs import GRAVITY, spin, turning_link, whirl  # noqa: E402

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
    """Steps of gbs round like their way: 20 units of the last place, which the sums of a step may round off, of the angle,
    71 rad, and of the energy, which grows by 289."""
    run = spin(0, "gbs", rtol=1e-14, atol=1e-14)
    unit = 20 * np.finfo(float).eps
    assert run.state < 71 * unit and run.energy < 2 * 289 * unit


def pendulum(moved: float = 0.0, turns: int = 0) -> linkdyn.Scene:
    """The whirling pendulum from its lowest position, some turns on, with another velocity."""
    description = turning_link({"type": "constant", "value": 0.0}, GRAVITY, 8.0 + moved)
    description["coordinate"][0]["start"]["position"] += 2 * np.pi * turns
    return linkdyn.Scene(description)


def rounding_of_steps(n: int, end: float) -> float:
    """What n steps may round off of the angle: 20 units of the last place of the velocity, 8 rad/s, which the sums of a step
    may round off, all of one sign, each grown as the motion makes a moved velocity grow, half of the run in the mean."""
    first, other = (pendulum(moved).forward(t=[0.0, end], rtol=1e-12, atol=1e-12).q.values[-1, 0] for moved in (0.0, 1e-6))
    return n * 20 * np.finfo(float).eps * 8.0 * abs(other - first) / 1e-6 / 2


@pytest.mark.parametrize("method", ["rk8pd", "gbs", "rk4"])
def test_angles_of_many_turns_round_like_those_of_the_first(method: str) -> None:
    """A run that starts a thousand turns on takes the same steps and differs by rounding. With whole turns left in the
    angle, whose last place is 9e-13 there, the adaptive methods took three times the steps, and gbs was off by 2e-9."""
    settings = {"step": 0.86 / 400} if method == "rk4" else {"rtol": 1e-14, "atol": 1e-14}
    t = np.linspace(0.0, 40.0, 5)
    near, far = (pendulum(turns=turns).forward(t=t, method=method, **settings) for turns in (0, 1000))
    apart = np.abs(far.q.values - near.q.values - 2 * np.pi * 1000).max()
    assert apart < rounding_of_steps(near.attrs["steps"], t[-1])
    assert abs(far.attrs["steps"] - near.attrs["steps"]) <= 0.05 * near.attrs["steps"]


@pytest.mark.parametrize("method", ["rk8pd", "gbs"])
def test_tolerances_below_rounding(method: str) -> None:
    """Tolerances that cannot be held make nothing worse than rounding is, and take no more steps; this is told, and what is
    met is not."""
    steps = whirl(50, 5, method, rtol=1e-14, atol=1e-14).steps
    allowed = rounding_of_steps(steps, 43.0)
    for tolerance in (1e-16, 1e-19):
        run = whirl(50, 5, method, rtol=tolerance, atol=tolerance)
        assert run.state < allowed and run.steps < 1.3 * steps
    assert pendulum().forward(t=[0.0, 5.0], method=method, rtol=1e-9, atol=1e-9).attrs["rounding"] == ""
    told = pendulum().forward(t=[0.0, 5.0], method=method, rtol=1e-16, atol=1e-16).attrs["rounding"]
    assert "steps with errors above the tolerance, up to" in told
    assert float(told.split()[-1]) < 20 * np.finfo(float).eps * 8.0


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
    grows with the square of the time, the energy's with the time, by fits and starts where orders and steps change."""
    ten, twenty, fifty = (whirl(turns, 5, method, **settings) for turns in (10, 20, 50))
    assert fifty.state < state and fifty.energy < energy
    assert fifty.energy < max(8 * ten.energy, 4 * twenty.energy) + 1e-14


def exact_row(t: list[float]) -> list[float]:
    """The angle of a row of 40 parallelograms is a pendulum's, q'' = -c cos q: by Taylor series of order 30 in 30 digits."""
    n = 40
    with mpmath.workdps(30):
        c = mpmath.mpf("9.81") * (mpmath.mpf(n + 1) / 2 + n) / (mpmath.mpf(n + 1) / 3 + n)
        q, rate, now, angles = mpmath.mpf(math.pi / 2), mpmath.mpf(-1), mpmath.mpf(0), []
        for end in t:
            while now < end:
                step = min(mpmath.mpf(1) / 16, end - now)
                series, sine, cosine = [q, rate], [mpmath.sin(q)], [mpmath.cos(q)]
                for k in range(1, 30):
                    series.append(-c * cosine[k - 1] / (k * (k + 1)))
                    sine.append(sum(j * series[j] * cosine[k - j] for j in range(1, k + 1)) / k)
                    cosine.append(-sum(j * series[j] * sine[k - j] for j in range(1, k + 1)) / k)
                q = sum(term * step**j for j, term in enumerate(series))
                rate = sum(j * term * step ** (j - 1) for j, term in enumerate(series) if j > 0)
                now += step
            angles.append(float(q))
    return angles


@pytest.mark.thorough
@pytest.mark.long
def test_tolerances_of_a_row_of_parallelograms() -> None:
    """Twenty seconds, twenty times through change points, where the error is rounding: steps that leave 1e-9 (1 + 2 pi) each
    grow by less than 20 (a start moved by 1e-16, in 40 digits), and tolerances that rounding does not allow are no worse.
    Short steps among the change points once made 7.5e-6 rad of 1e-14, ten times what 1e-9 has."""
    scene = linkdyn.load(ROOT / "examples" / "n_fourbar" / "scene_40.toml")
    t = [0.0, 5.0, 10.0, 20.0]
    exact = exact_row(t)
    runs = {tolerance: scene.forward(t=t, rtol=tolerance, atol=tolerance, want="power") for tolerance in (1e-9, 1e-14)}
    error = {tolerance: np.abs(run.q.values[:, 0] - exact).max() for tolerance, run in runs.items()}
    assert error[1e-9] < 20 * runs[1e-9].attrs["steps"] * 1e-9 * (1 + 2 * np.pi)
    assert error[1e-14] < error[1e-9]
    assert "above the tolerance" in runs[1e-14].attrs["rounding"]


@pytest.mark.thorough
@pytest.mark.long
@pytest.mark.parametrize("tolerance", [1.11e-9, 1.03e-12])
def test_no_sample_is_lost_where_a_step_ends(tolerance: float) -> None:
    """An instant that no step from afar could reach was called singular though the next step ended there, unless the run had
    come back for want of time in between: one or two samples of these runs, other ones on each machine."""
    run = linkdyn.load(ROOT / "examples" / "n_fourbar" / "scene_40.toml").forward(rtol=tolerance, atol=tolerance, want="power")
    assert not run.status.values.any()


@pytest.mark.thorough
@pytest.mark.long
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
