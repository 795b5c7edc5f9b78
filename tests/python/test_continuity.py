"""Closed smooth paths in coordinate space: no joint jumps, the end is the start, and order, batches and threads do not matter."""

from __future__ import annotations

import sys
import tomllib
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn.cli import executable

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "hard"))

from cases import Case  # noqa: E402
from twin import run_states  # noqa: E402

pytestmark = pytest.mark.lanes

NOT_DRIVEN = frozenset({"ball_joint", "capture", "ship_hexapod"})
"""Inverse dynamics needs an actuator for each coordinate, which angles of a spherical joint and poses cannot have; on a ship it asks for instants."""


def names(file: Path) -> str:
    return file.stem if file.parent.name == "scenes" else file.parent.name


SCENES = sorted(
    file
    for file in (*ROOT.glob("examples/*/scene.toml"), *ROOT.glob("tests/scenes/*.toml"))
    if names(file) not in NOT_DRIVEN
)
REACH = {"near": (0.02, 0.02), "middle": (0.3, 0.3), "far": (1.2, 1.2), "round": (4.0, 0.5)}
"""How far a path goes: in radians, and in a third of the mechanism's size."""
SLOW = frozenset({"hexaglide"})
"""Platforms whose loops take as long as all other scenes together: fewer samples, and one path of each reach."""

ROUNDING = 1e-7
"""Of a joint variable [m, rad]: an assembly closed near its dead point has half of the digits."""


@dataclass(frozen=True)
class Motion:
    """A path with its results."""

    case: Case
    unit: np.ndarray
    """Of the joint variables."""
    results: dict[str, np.ndarray]
    told: np.ndarray
    """(n,) variables that have a meaning: not the angles of balls whose link spins idly, which pass their pole as that spin has it."""

    @property
    def good(self) -> np.ndarray:
        return self.results["status"][:, 0] == "ok"

    @property
    def variable(self) -> np.ndarray:
        """(N + 1, n), NaN where there is no solution."""
        return np.where(self.good[:, np.newaxis], self.results["joint_variable"], np.nan)

    @property
    def rate(self) -> np.ndarray:
        """The same of their rates."""
        return np.where(self.good[:, np.newaxis], self.results["joint_rate"], np.nan)

    def less_turns(self, difference: np.ndarray) -> np.ndarray:
        """Differences of the joint variables (..., n), those of angles without whole turns."""
        turns = np.where(self.unit == "rad", np.round(difference / (2 * np.pi)), 0)
        return difference - 2 * np.pi * turns


def driven(file: Path) -> dict[str, Any]:
    """The scene with as many actuators as coordinates: inverse dynamics is what gives joint variables along a path."""
    scene = linkdyn.load(file)
    content = tomllib.loads(file.read_text())
    if len(scene.actuators) != len(scene.coordinates):
        content["actuator"] = [{key: c[key] for key in ("joint", "variable") if key in c} for c in content["coordinate"]]
    for part in ("sweep", "payload"):    # what comes and goes with time moves nothing
        content.pop(part, None)
    return content


def variables_told(scene: linkdyn.Scene, variables: np.ndarray) -> np.ndarray:
    """(n,) false for the angles of balls on links with an idle spin."""
    links = [link["name"] for link in scene.description["links"]]
    spinning = scene.description["idle_spins"].split()
    balls = [joint["name"] for joint in scene.description["joints"]
             if joint["type"] == "spherical" and any(links[link] in spinning for link in joint["links"])]
    return np.array([name.rpartition(".")[0] not in balls for name in variables])


def size_of(scene: linkdyn.Scene) -> float:
    """Length of the longest link [m]."""
    spans = [0.0]
    for link in scene.description["links"]:
        points = np.array([marker["at"] for marker in link["markers"]])
        spans += [np.ptp(points, axis=0).max()] if len(points) else []
    return max(spans) or 1.0


def samples(file: Path) -> int:
    """Steps of a path."""
    return 500 if names(file) in SLOW else 2000


def path_from(start: np.ndarray, reach: np.ndarray, seed: int, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Three harmonics with random sizes and phases, from the start and back to it in 1 s: q, qd, qdd (n + 1, number of coordinates)."""
    rng = np.random.default_rng(seed)
    t = np.arange(n + 1)[:, np.newaxis] / n
    q, qd, qdd = (np.zeros((n + 1, len(start))) for _ in range(3))
    for k in (1, 2, 3):
        a, phase, w = reach * rng.uniform(-1, 1, len(start)) / k, rng.uniform(0, 2 * np.pi, len(start)), 2 * np.pi * k
        q += a * (np.sin(w * t + phase) - np.sin(phase))
        qd += a * w * np.cos(w * t + phase)
        qdd -= a * w**2 * np.sin(w * t + phase)
    q[-1] = q[0]
    return start + q, qd, qdd


def path(file: Path, reach: str, seed: int) -> tuple[Case, linkdyn.Scene]:
    """One of a scene's random paths."""
    content = driven(file)
    scene = linkdyn.Scene(content, file.parent)
    unit = np.array([c["unit"] for c in scene.description["coordinates"]])
    start = scene.motion(scene.times()[:1])[0][0]
    angle, length = REACH[reach]
    number = zlib.crc32(f"{names(file)} {reach} {seed}".encode())
    q, qd, qdd = path_from(start, np.where(unit == "rad", angle, length * size_of(scene) / 3), number, samples(file))
    return Case(names(file), scene.title, content, q, qd, qdd, np.full(len(q), np.nan), file.parent), scene


def move(file: Path, reach: str, seed: int, *options: str) -> Motion:
    """A scene along one of its random paths, followed in order."""
    case, scene = path(file, reach, seed)
    first, last = scene.times()[[0, -1]]                   # tables reach as far
    instants = np.linspace(first, last if last > first else first + 1.0, len(case.q))
    results = run_states(executable(), case, "--want", "joint_variable", *options, solver="elimination", time=instants)
    run = scene.inverse(case.q[:1], want="joint_variable")
    return Motion(case, run.variable_unit.values, results, variables_told(scene, run.variable.values))


MOTIONS = [
    pytest.param(file, reach, seed, marks=[pytest.mark.long] * (seed > 0) + [pytest.mark.thorough] * (seed > 0 or reach == "near"),
                 id=f"{names(file)}-{reach}-{seed}")
    for file in SCENES for reach in REACH for seed in range(1 if names(file) in SLOW else 2)
]


def jumps(motion: Motion) -> Iterator[str]:
    """Steps between good neighbours that the rates on both sides do not explain.

    Between two samples a rate is taken to stay within the range that it has there and at their neighbours, doubled about
    the mean; a joint variable that does more has jumped.
    """
    rate, step = motion.rate, 1 / (len(motion.rate) - 1)
    ahead, behind = np.vstack([rate[1:], rate[-1:]]), np.vstack([rate[:1], rate[:-1]])
    around = np.stack([behind[:-1], rate[:-1], rate[1:], ahead[1:]])
    middle, spread = around[1:3].mean(axis=0), np.fmax.reduce(around) - np.fmin.reduce(around)
    gone = np.diff(motion.variable, axis=0) - step * middle
    unexplained = np.abs(gone) - 2 * step * spread
    for i, k in np.argwhere((unexplained > ROUNDING) & motion.told):     # not beside a failed sample, which is NaN
        yield f"variable {k} from {motion.variable[i, k]:.9g} to {motion.variable[i + 1, k]:.9g} between samples {i} and {i + 1}"


@pytest.mark.parametrize(("file", "reach", "seed"), MOTIONS)
def test_nothing_jumps_and_the_end_is_the_start(file: Path, reach: str, seed: int) -> None:
    motion = move(file, reach, seed)
    assert motion.good[0]
    found = list(jumps(motion))
    assert not found, f"{len(found)} jumps: {found[:3]}"
    assert np.all(np.isfinite(motion.variable[motion.good]))
    if motion.good.all():
        # a hinge may have turned all the way round
        moved = motion.less_turns(motion.variable[-1] - motion.variable[0])
        assert np.abs(moved[motion.told]).max() < ROUNDING, moved


@pytest.mark.parametrize("file", SCENES, ids=names)
def test_poses_are_those_of_the_joints(file: Path) -> None:
    """Poses followed in order, and poses told by the joint variables of the same path, are the same."""
    motion = move(file, "middle", 0)
    scene = linkdyn.Scene(motion.case.scene, file.parent)
    followed = scene.poses(motion.case.q, in_order=True)
    good = motion.good & (followed.status == 0)
    assert good.any()
    told = scene.poses(joint_variable=motion.variable[good])
    assert np.all(told.status == 0)
    np.testing.assert_allclose(told.rotation, followed.rotation[good], atol=10 * ROUNDING)
    np.testing.assert_allclose(told.position, followed.position[good], atol=10 * ROUNDING * max(1.0, size_of(scene)))


@pytest.mark.parametrize("file", SCENES, ids=names)
def test_order_and_batches_do_not_matter(file: Path) -> None:
    """A sample on its own has the same numbers to the last bit wherever it stands, in whatever batch, on any thread."""
    case, scene = path(file, "middle", 1)
    q, qd, qdd = (values[::20] for values in (case.q, case.qd, case.qdd))
    whole = scene.solve(q, qd, qdd, want="all")
    rng = np.random.default_rng(1)
    order = rng.permutation(len(q))
    pieces = np.split(order, np.sort(rng.integers(0, len(q), 5)))
    parts = [scene.solve(q[piece], qd[piece], qdd[piece], want="all", threads=1 + k % 3) for k, piece in enumerate(pieces)]
    for name, values in whole.items():
        np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), values[order], err_msg=name)


@pytest.mark.thorough
@pytest.mark.parametrize("file", SCENES, ids=names)
def test_threads_do_not_matter_in_order(file: Path) -> None:
    """Nor for a motion that is followed."""
    one, three = (move(file, "far", 0, "--threads", n) for n in ("1", "3"))
    for name, values in one.results.items():
        np.testing.assert_array_equal(three.results[name], values, err_msg=name)
