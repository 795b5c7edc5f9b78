"""Excavator and scissor lift: what their pages show is printed, and cylinders do the work that weights and teeth take."""
from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import linkdyn
import numpy as np
import pytest

from test_example_pages import is_line

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
GRAVITY = 9.81


@pytest.mark.parametrize(("name", "picture"), [("excavator", "cycle.png"), ("scissor_lift", "cylinder.png")])
def test_the_page_shows_what_is_printed(name, picture, tmp_path):
    done = subprocess.run([sys.executable, str(EXAMPLES / name / "run.py"), "--out", str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    shown = (EXAMPLES / name / "README.md").read_text(encoding="utf-8").split("    python run.py\n\n```text\n")[1].split("```")[0].splitlines()
    printed = done.stdout.splitlines()
    assert len(shown) == len(printed) and all(is_line(*pair) for pair in zip(printed, shown)), done.stdout
    assert (tmp_path / picture).stat().st_size > 10_000


def test_scissors_by_virtual_work():
    """Slow, the cylinder's force times its way is the weights' rise: by differences of poses, which know nothing of forces."""
    scene = linkdyn.load(EXAMPLES / "scissor_lift" / "scene.toml")
    h = 1e-5
    angles = np.radians(np.linspace(13, 52, 14))[:, np.newaxis]
    force = scene.inverse(angles).driving_force.values[:, 0]
    ends = [scene.inverse(angles + way, want="joint_variable").joint_variable.sel(variable="ram.P.slide").values for way in (-h, h)]
    stretch = (ends[1] - ends[0]) / (2 * h)
    heights = [heights_of(scene, angles + way) for way in (-h, h)]
    rise = (heights[1] - heights[0]) / (2 * h)
    masses = masses_of(scene)
    masses[scene.links.index("platform")] += 1000      # in the middle, where the platform's own is
    np.testing.assert_allclose(force * stretch, GRAVITY * rise @ masses, rtol=1e-7)


def masses_of(scene):
    return np.array([link["mass"] for link in scene.description["links"][1:]])


def heights_of(scene, q):
    """(N, links) of the centres of mass."""
    poses = scene.poses(q)
    centres = np.array([np.append(link["cog"], np.zeros(3))[:3] for link in scene.description["links"][1:]])
    return poses.position[:, :, 1] + np.einsum("nij,ij->ni", poses.rotation[:, :, 1], centres)


def test_teeth_by_virtual_work():
    """A unit of force across the bucket: what it adds to the cylinder is the lever of the teeth over that of the cylinder."""
    scene = linkdyn.load(EXAMPLES / "excavator" / "scene.toml")
    h = 1e-5
    bucket = np.radians(np.linspace(-15, -115, 11))
    q = np.column_stack([np.full_like(bucket, 0.02), np.full_like(bucket, -1.4), bucket])
    across = q.sum(axis=1)
    wrench = {"bucket.teeth": np.column_stack([-np.sin(across), np.cos(across), np.zeros_like(across)])}
    added = scene.inverse(q, wrench=wrench, t=0.0).driving_force - scene.inverse(q, t=0.0).driving_force
    for k, (cylinder, angle) in enumerate((("lift.P", 0), ("crowd.P", 1), ("curl.P", 2))):
        way = np.zeros(3)
        way[angle] = h
        ends = [scene.inverse(q + sign * way, t=0.0, want="joint_variable").joint_variable.sel(variable=f"{cylinder}.slide").values for sign in (-1, 1)]
        teeth = [np.array([marker_of(scene, q + sign * way)])[0] for sign in (-1, 1)]
        work = np.sum(wrench["bucket.teeth"][:, :2] * (teeth[1] - teeth[0]), axis=1)
        np.testing.assert_allclose(added.values[:, k] * (ends[1] - ends[0]) / (2 * h), -work / (2 * h), rtol=0, atol=1e-6)


def marker_of(scene, q):
    """(N, 2) of the teeth."""
    poses, link = scene.poses(q), scene.links.index("bucket")
    return poses.position[:, link, :2] + poses.rotation[:, link, :2, 0] * 1.45
