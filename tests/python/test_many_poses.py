"""Poses of large batches, which records place, against those of small ones, which lanes do; and what both inverse dynamics says of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import linkdyn

ROOT = Path(__file__).resolve().parents[2]
ITERATED = ["examples/delta/scene.toml", "examples/agile_eye/scene.toml", "examples/tripod/scene.toml", "tests/scenes/planar_platform.toml"]
"""Loops closed by iteration; of `agile_eye` some constraints are redundant."""
CLOSED = ["examples/stewart_tsai/scene.toml", "examples/watt_i/scene.toml", "tests/scenes/threerrr_pattern.toml", "tests/scenes/geared_loop.toml"]
SMALL = 100


def load(file):
    return linkdyn.load(ROOT / file)


def start(scene):
    return np.array(scene.motion(np.zeros(1))[0][0])


def scattered(scene, n, width):
    where = start(scene)
    return where + width * np.random.default_rng(7).uniform(-1.0, 1.0, (n, len(where)))


def assert_alike(many, few):
    np.testing.assert_array_equal(many.status, few.status)
    placed = many.status == 0
    assert placed.sum() > 20
    size = np.abs(few.position[placed]).max()
    # near singular positions rounding moves links by more than itself
    np.testing.assert_allclose(many.position[placed], few.position[placed], rtol=0.0, atol=1e-11 * max(size, 1e-3))
    np.testing.assert_allclose(many.rotation[placed], few.rotation[placed], rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("file", ITERATED + CLOSED)
def test_many_poses_as_few_at_a_time(file):
    scene = load(file)
    q = scattered(scene, 600 if file in ITERATED else 4200, 0.4)
    parts = [scene.poses(q[first : first + SMALL]) for first in range(0, len(q), SMALL)]
    few = linkdyn.Poses(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("position", "rotation", "status")))
    assert_alike(scene.poses(q), few)


@pytest.mark.parametrize("file", ITERATED + CLOSED)
def test_many_poses_along_a_motion_as_a_few_of_them(file):
    scene = load(file)
    where = start(scene)
    n, every = (1201, 8) if file in ITERATED else (6001, 20)
    turn = np.linspace(0.0, 2.0 * np.pi, n)[:, None] * np.arange(1, 1 + len(where))
    q = where + 0.2 * np.sin(turn)
    many = scene.poses(q, in_order=True)
    few = scene.poses(q[::every], in_order=True)
    assert_alike(linkdyn.Poses(many.position[::every], many.rotation[::every], many.status[::every]), few)


@pytest.mark.parametrize("file", ["examples/delta/scene.toml", "examples/agile_eye/scene.toml"])
def test_poses_say_of_far_samples_what_inverse_dynamics_says(file):
    scene = load(file)
    q = scattered(scene, 1250, 3.0)
    np.testing.assert_array_equal(scene.poses(q).status, scene.inverse(q=q).status)
