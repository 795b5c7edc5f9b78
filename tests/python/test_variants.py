"""Scenes made of one another by `with_` share what is traced: their forces are those of scenes read on their own."""

from __future__ import annotations

import concurrent.futures
import gc
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def scene_of(name: str) -> linkdyn.Scene:
    return linkdyn.load(EXAMPLES / name / "scene.toml")


def motion_of(scene: linkdyn.Scene, n: int = 5) -> dict[str, Any]:
    run = scene.inverse()
    return {name: run[name].values[:: len(run.time) // n] for name in ("q", "qd", "qdd")}


def has_forces_of_its_own(variant: linkdyn.Scene, motion: dict[str, Any], **options: Any) -> None:
    """Those of the same text, read by itself."""
    alone = linkdyn.Scene(variant.text, folder=variant.folder)
    for name in ("driving_force", "reaction"):
        ours, theirs = (scene.inverse(**motion, **options)[name].values for scene in (variant, alone))
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12 * np.abs(theirs).max())


@pytest.mark.parametrize("solver", ["elimination", "gauss-jordan", "lapack"])
@pytest.mark.parametrize("name, path, numbers", [
    ("fourbar", "link.crank.mass", (1.0, 250.0, 7.5)),
    ("fourbar", "frame.markers.J1[0]", (9.5, 10.5, 10.2)),
    ("stewart_aris", "link.platform.mass", (1.0, 25.0, 3.5)),
    ("stewart_aris", "frame.markers.B1[2]", (0.01, -0.02, 0.1)),
])  # fmt: skip
def test_numbers(name: str, path: str, numbers: tuple[float, ...], solver: str) -> None:
    first = scene_of(name)
    motion = motion_of(first)
    for number in numbers:
        has_forces_of_its_own(first.with_({path: number}), motion, solver=solver)


def test_of_one_another() -> None:
    """Variants of variants, after those that they were made of are gone."""
    scene = scene_of("stewart_aris")
    motion = motion_of(scene)
    for number in (3.0, 4.0, 5.0, 6.0):
        scene = scene.with_({"link.platform.mass": number})
        gc.collect()
        has_forces_of_its_own(scene, motion)


def test_more_than_numbers() -> None:
    """What is made of another one by more than a number is like it no longer, nor are its own variants."""
    first = scene_of("fourbar")
    motion = motion_of(first)
    has_forces_of_its_own(first.with_({"link.crank.mass": 3.0}), motion)
    weightless = first.with_({"gravity": [0, 0]})
    sprung = first.with_({"spring.S": {"name": "S", "between": ["frame.J4", "crank.J2"], "stiffness": 40.0, "rest": 1.0}})
    for number in (1.0, 2.0):
        for other in (weightless, sprung):
            has_forces_of_its_own(other.with_({"link.crank.mass": number}), motion)


def test_with_a_wrench_of_the_call() -> None:
    first = scene_of("stewart_aris")
    motion = motion_of(first)
    marker = f"platform.{next(marker['name'] for marker in first.description['links'][1]['markers'])}"
    for number in (3.0, 4.0):
        has_forces_of_its_own(first.with_({"link.platform.mass": number}), motion, wrench={marker: [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]})


def test_by_threads() -> None:
    """Made, computed and forgotten side by side."""
    first = scene_of("stewart_aris")
    motion = motion_of(first)

    def largest(number: float) -> float:
        return float(np.abs(first.with_({"link.platform.mass": number}).solve(**motion)["driving_force"]).max())

    numbers = [2.0 + k / 8 for k in range(24)]
    one_by_one = [largest(number) for number in numbers]
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        assert list(pool.map(largest, numbers)) == one_by_one


def test_many_samples_of_one() -> None:
    """A variant that is computed again and again gets a record of its own: roads differ, forces do not."""
    variant = scene_of("stewart_aris").with_({"link.platform.mass": 3.0})
    motion = motion_of(variant)
    few = variant.solve(**motion)["driving_force"]
    again = {name: np.tile(values, (5000, 1)) for name, values in motion.items()}
    many = variant.solve(**again)["driving_force"]
    np.testing.assert_allclose(many.reshape(5000, *few.shape), np.broadcast_to(few, (5000, *few.shape)), rtol=0, atol=1e-12 * np.abs(few).max())
