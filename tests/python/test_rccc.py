"""RCCC linkages: their angles are those of a spherical four-bar, which closes in closed form."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn.cli import quadruple_twin

sys.path.insert(0, str(Path(__file__).parents[1] / "hard"))

from cases import Case  # noqa: E402
from twin import forces_of, quadruple_forces  # noqa: E402

NAMES = "ABCD"
LINKS = ("crank", "coupler", "rocker")
UNREACHABLE = 1


def numbers(v: np.ndarray) -> list[float]:
    return [float(x) for x in v]


def linkage(seed: int) -> tuple[dict[str, Any], np.ndarray]:
    """Axes at random, at the start; the scene swings by 0.3 rad."""
    rng = np.random.default_rng(seed)
    point = np.array([[0.0, 0.0, 0.0], [0.1, 0.2, 0.3], [1.0, 0.3, 0.4], [1.0, 0.0, 0.0]]) + 0.5 * rng.uniform(-1, 1, (4, 3))
    axis = rng.normal(size=(4, 3))
    axis /= np.linalg.norm(axis, axis=1)[:, np.newaxis]
    marker = [{"at": numbers(point[k]), "axis": numbers(axis[k])} for k in range(4)]
    scene: dict[str, Any] = {
        "space": "spatial",
        "frame": {"markers": {"A": marker[0], "D": marker[3]}},
        "link": [
            {"name": name, "mass": 1.0, "cog": numbers((point[k] + point[k + 1]) / 2), "inertia": {"diagonal": [0.02, 0.03, 0.025]},
             "markers": {NAMES[k]: marker[k], NAMES[k + 1]: marker[k + 1]}, "start": {"position": [0.0, 0.0, 0.0]}}
            for k, name in enumerate(LINKS)
        ],
        "joint": [
            {"name": NAMES[k], "type": "cylindrical" if k else "revolute", "between": [f"{a}.{NAMES[k]}", f"{b}.{NAMES[k]}"]}
            for k, (a, b) in enumerate([("frame", "crank"), ("crank", "coupler"), ("coupler", "rocker"), ("rocker", "frame")])
        ],
        "coordinate": [{"joint": "A", "motion": {"law": "harmonic", "amplitude": 0.3, "frequency": "1 rad/s"}}],
        "actuator": [{"joint": "A"}],
        "time": {"end": 6.283185307179586, "samples": 181},
    }  # fmt: skip
    return scene, axis


def cosine_of_closure(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Cosine that the rocker's angle would need, beside a constant: beyond one no rocker meets the coupler."""
    a, b, c, d = axis
    turned = (
        np.cos(angle)[:, np.newaxis] * b
        + np.sin(angle)[:, np.newaxis] * np.cross(a, b)
        + ((1 - np.cos(angle)) * (a @ b))[:, np.newaxis] * a
    )
    across = c - (c @ d) * d
    size = np.hypot(turned @ across, turned @ np.cross(d, c))
    return (b @ c - (c @ d) * (turned @ d)) / size


@pytest.mark.parametrize("seed", [1, 2, 3, 10, 11, 15, 18, 25, 28, 34, 7, 13])
def test_ends_of_reach_are_told_from_change_points(seed: int) -> None:
    """Near the ends slides move without bound, and the margin goes to zero evenly, as it does where assemblies meet."""
    scene, axis = linkage(seed)
    run = linkdyn.Scene(scene).inverse()
    closes = np.abs(cosine_of_closure(axis, run.q.values[:, 0]))
    status = run.status.values
    assert (status[closes < 0.998] == 0).all()
    assert (status[closes > 1] == UNREACHABLE).all()
    if (closes > 1).any():
        assert "cannot be closed beyond" in " ".join(str(v) for v in run.attrs.values())


def near_parallel(seed: int, angle: float) -> dict[str, Any]:
    """All axes within an angle of one direction."""
    scene, _ = linkage(seed)
    rng = np.random.default_rng(seed + 1000)
    axis = rng.normal(size=3)
    axis = axis / np.linalg.norm(axis) + np.tan(angle) * rng.uniform(-1, 1, (4, 3))
    scene["frame"]["markers"]["A"]["axis"], scene["frame"]["markers"]["D"]["axis"] = numbers(axis[0]), numbers(axis[3])
    for k, link in enumerate(scene["link"]):
        link["markers"][NAMES[k]]["axis"], link["markers"][NAMES[k + 1]]["axis"] = numbers(axis[k]), numbers(axis[k + 1])
    scene["time"]["samples"] = 31
    return scene


@pytest.mark.twin
@pytest.mark.parametrize("angle", [1.0, 2.0, 5.0])
def test_axes_nearly_parallel_keep_their_digits(angle: float) -> None:
    """The slides along them are ill determined, and nothing hangs on these. The margin alone called two thirds of the samples singular."""
    taken = there = 0
    for seed in (1, 2, 5, 8):
        scene = near_parallel(seed, np.radians(angle))
        run = linkdyn.Scene(scene).inverse(want=("driving_force", "reaction"))
        case = Case("rccc", "rccc", scene, *linkdyn.Scene(scene).motion(run.time.values), np.full(31, np.nan))
        exact = quadruple_forces(quadruple_twin(), case, time=run.time.values)
        good = run.status.values == 0
        size = np.abs(exact).max(axis=1)
        assert (np.abs(forces_of(run) - exact)[good].max(axis=1) < 1e-8 * size[good]).all()
        taken += int(good.sum())
        there += int(np.isfinite(size).sum())
    assert taken >= (0.9 if angle > 4 else 0.7) * there > 0
