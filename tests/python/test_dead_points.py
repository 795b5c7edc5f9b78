"""Dead points: dyads through full stretch and fold, mechanisms through their change points; exact values by mpmath."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

import linkdyn
from linkdyn.lecture import Angle, Point, PRR_links, RRR_links

pytestmark = pytest.mark.accuracy

EPS = np.finfo(float).eps
RNG = np.random.default_rng(7)


# ---------------------------------------------------------------- one dyad


def exact_angle(length1: float, length2: float, distance: mpmath.mpf) -> mpmath.mpf:
    """The lecture's beta, for these very doubles."""
    a, b = mpmath.mpf(length1), mpmath.mpf(length2)
    return mpmath.acos((a**2 + distance**2 - b**2) / (2 * a * distance))


def condition(length1: float, length2: float, distance: mpmath.mpf, beta: mpmath.mpf) -> mpmath.mpf:
    """Relative change of beta for relative changes of the three lengths."""
    a, b, d = mpmath.mpf(length1), mpmath.mpf(length2), distance
    of_cosine = abs(a**2 - d**2 + b**2) / (2 * a * d) + b**2 / (a * d) + abs(d**2 - a**2 + b**2) / (2 * a * d)
    return of_cosine / (mpmath.sin(beta) * beta)


@pytest.mark.parametrize("exponent", range(1, 8))
@pytest.mark.parametrize("alike", [True, False], ids=["equal links", "unequal links"])
def test_error_towards_full_stretch(exponent: int, alike: bool) -> None:
    """beta = 1e-1 ... 1e-7: no more error than the rounding of the lengths makes, 1.5/beta^2 eps for equal links. The slides'
    arc cosine has no digit left at 1e-8."""
    with mpmath.workdps(60):
        for _ in range(40):
            length1, length2 = RNG.uniform(0.3, 2.0, 2)
            length2 = length1 if alike else length2
            beta, way = mpmath.mpf(10) ** -exponent, RNG.uniform(-np.pi, np.pi)
            reach = length1 * mpmath.cos(beta) + mpmath.sqrt(mpmath.mpf(length2) ** 2 - (length1 * mpmath.sin(beta)) ** 2)
            span = np.array([float(reach * mpmath.cos(way)), float(reach * mpmath.sin(way))])
            distance = mpmath.sqrt(mpmath.mpf(span[0]) ** 2 + mpmath.mpf(span[1]) ** 2)
            if distance >= mpmath.mpf(length1) + mpmath.mpf(length2):
                continue  # rounding the inputs has stretched the links already
            want = exact_angle(length1, length2, distance)
            arm = RRR_links(Point((0.0, 0.0)), Point(span), length1, length2, +1).p
            got = mpmath.atan2(span[0] * mpmath.mpf(arm[1]) - span[1] * mpmath.mpf(arm[0]), span @ arm)
            limit = 1.5 / want**2 if alike else condition(length1, length2, distance, want)
            assert abs(got - want) <= limit * EPS * want


@pytest.mark.parametrize("exponent", range(1, 8))
def test_error_towards_fold(exponent: int) -> None:
    """Links folded on each other: the angle between them, nu, small."""
    with mpmath.workdps(60):
        for _ in range(40):
            length1, length2 = 1.0, RNG.uniform(0.3, 0.8)
            nu = mpmath.mpf(10) ** -exponent
            distance = float(mpmath.sqrt(length1**2 + mpmath.mpf(length2) ** 2 - 2 * length2 * mpmath.cos(nu)))
            if distance <= mpmath.mpf(length1) - mpmath.mpf(length2):
                continue
            joint = RRR_links(Point((0.0, 0.0)), Point((distance, 0.0)), length1, length2, +1).p
            first, second = joint, joint - [distance, 0.0]
            got = mpmath.atan2(abs(mpmath.mpf(first[0]) * second[1] - mpmath.mpf(first[1]) * second[0]), first @ second)
            d = mpmath.mpf(distance)
            want = mpmath.acos((1 + mpmath.mpf(length2) ** 2 - d**2) / (2 * mpmath.mpf(length2)))
            # nu^2 = (d^2 - (L1 - L2)^2)/(L1 L2) nearly: roundings of the factors, over nu^2.
            limit = (8 / (length2 * float(want) ** 2) + 8 / float(want)) * EPS
            assert abs(got - want) <= limit * want


def test_out_of_reach_at_either_end() -> None:
    """Through stretch and fold and beyond: NaN where the links cannot meet, and only there."""
    distance = np.linspace(0.05, 2.0, 1001)
    joint = RRR_links(Point((0.0, 0.0)), Point(np.stack([distance, 0 * distance], -1)), 1.0, 0.6, 1)
    meets = (distance >= 0.4) & (distance <= 1.6)
    on_edge = np.isclose(distance, 0.4, 0, 1e-12) | np.isclose(distance, 1.6, 0, 1e-12)
    assert (np.isfinite(joint.p).all(-1) == meets)[~on_edge].all()
    height = np.linspace(-1.5, 1.5, 1001)
    slide, _, joint = PRR_links(Point(np.stack([0 * height, height], -1)), 1.0, Point((0.0, 0.0)), Angle(0.0), 0.0, 0.0, 1)
    assert (np.isfinite(slide.v) == (np.abs(height) <= 1.0)).all()


# ---------------------------------------------------------------- mechanisms


def linkage(crank: float, coupler: float, follower: float, ground: float, step: float) -> linkdyn.Scene:
    """A four-bar linkage whose crank turns twice, `step` radians a sample, from 0.5 rad on."""
    n = int(4 * np.pi / step) + 1
    bodies = {"crank": crank, "coupler": coupler, "follower": follower}
    links = [
        {"name": name, "markers": {"a": [0.0, 0.0], "b": [length, 0.0]}, "mass": 1.0, "cog": [length / 2, 0.0], "inertia": 0.1}
        for name, length in bodies.items()
    ]
    joints = [
        {"name": "O", "type": "revolute", "between": ["frame.O", "crank.a"]},
        {"name": "A", "type": "revolute", "between": ["crank.b", "coupler.a"]},
        {"name": "B", "type": "revolute", "between": ["coupler.b", "follower.b"], "branch": 1},
        {"name": "C", "type": "revolute", "between": ["frame.C", "follower.a"]},
    ]
    return linkdyn.Scene(
        {
            "space": "planar",
            "frame": {"markers": {"O": [0.0, 0.0], "C": [ground, 0.0]}},
            "link": links,
            "joint": joints,
            "coordinate": [{"joint": "O", "motion": {"law": "constant-rate", "rate": 1.0, "start": 0.5}}],
            "actuator": [{"joint": "O"}],
            "time": {"end": step * (n - 1), "samples": n},
        }
    )


def test_engine_flags_the_unreachable() -> None:
    """A double rocker whose crank is told to turn: status says where the loop cannot close."""
    scene = linkage(1.0, 1.2, 1.1, 2.4, 0.01)
    run = scene.inverse(want="driving_force,joint_variable")
    distance = np.sqrt(1.0 + 2.4**2 - 2 * 2.4 * np.cos(run.q.values[:, 0]))
    meets = distance <= 2.3
    assert (run.status.values[meets] == 0).all() and (run.status.values[~meets] == 1).all()
    assert np.isnan(run.driving_force.values[~meets]).all() and np.isfinite(run.driving_force.values[meets]).all()


@pytest.mark.parametrize("step", [0.3, 0.1, 0.017, 0.001])
def test_parallelogram_stays_one(step: float) -> None:
    """Through its change points at 0 and pi, at coarse and fine steps: the follower goes with the crank."""
    run = linkage(1.0, 2.0, 1.0, 2.0, step).inverse(want="joint_variable")
    theta = run.q.values[:, 0]
    turn = run.joint_variable.sel(variable="C.angle").values - theta
    # Rounding of the lengths, over the sine of the transmission angle; where it leaves forces less than three digits, no numbers.
    sine = np.abs(np.sin(theta))
    ok = run.status.values == 0
    assert (sine[~ok] ** 4 < 16 * EPS / 1e-3).all()
    assert (np.abs(np.angle(np.exp(1j * turn[ok]))) <= 16 * EPS / sine[ok] ** 2).all()


@pytest.mark.parametrize("excess", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("step", [0.1, 0.017, 0.001])
def test_near_parallelogram_turns_back(excess: float, step: float) -> None:
    """A longer follower makes it a crank-rocker, on one branch for ever: parallel for half a turn, crossed for the other."""
    run = linkage(1.0, 2.0, 1.0 + excess, 2.0, step).inverse(want="joint_variable")
    got = run.joint_variable.sel(variable="C.angle").values
    for theta, angle in list(zip(run.q.values[:, 0], got))[:: max(1, len(got) // 200)]:
        with mpmath.workdps(40):
            tip = mpmath.mpc(mpmath.cos(theta), mpmath.sin(theta))
            way = 2 - tip
            span, length = abs(way), mpmath.mpf(1.0 + excess)
            beta = mpmath.acos((4 + span**2 - length**2) / (4 * span))
            inner = tip + 2 * way / span * mpmath.expj(beta)  # to the left of the way from A to C
            want = mpmath.arg(inner - 2)
            sine = abs(mpmath.im((inner - tip) * mpmath.conj(inner - 2))) / (2 * length)
        assert abs(np.angle(np.exp(1j * (angle - float(want))))) <= 16 * EPS / float(sine) ** 2


# ---------------------------------------------------------------- power balance of every planar example that is fully driven


def planar_examples() -> list[str]:
    from pathlib import Path

    files = (Path(__file__).resolve().parents[2] / "examples").glob("*/scene*.toml")
    return sorted(str(file) for file in files if 'space = "planar"' in file.read_text() and is_driven(linkdyn.load(file)))


def is_driven(scene: linkdyn.Scene) -> bool:
    return len(scene.actuators) == len(scene.coordinates)


@pytest.mark.parametrize("file", planar_examples(), ids=lambda file: "/".join(file.split("/")[-2:]))
def test_power_balance(file: str) -> None:
    """Driving power and that of gravity, loads and springs is the change of kinetic energy, at every sample. Where little power is at
    work, as while a cam turns under a follower at rest, what is left of large forces that cancel is compared with the run's."""
    scene = linkdyn.load(file)
    run = scene.inverse(want="checks,power")
    power = np.abs(run.driving_power.values).max(axis=1)
    part = np.minimum(1, 1000 * power / power.max()) if power.any() else 1
    assert (run.status == 0).all() and float((part * np.abs(run.power_imbalance.values)).max()) <= 1e-12
