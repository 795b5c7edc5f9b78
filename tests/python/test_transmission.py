"""Transmission angles: by the geometry of the links, in every kind of run, in the report."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import linkdyn

pytestmark = pytest.mark.accuracy

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
EPS = np.finfo(float).eps


@pytest.fixture(scope="module")
def sixbar() -> linkdyn.Scene:
    return linkdyn.load(EXAMPLES / "sixbar_slider" / "scene.toml")


def test_angles_of_the_sixbar(sixbar) -> None:
    """RRR: between coupler and follower, by the law of cosines. PRR: between the rod and the normal of the rail."""
    run = sixbar.inverse()
    angle = run.transmission_angle
    assert list(angle.dyad.values) == ["J2", "J5"] and angle.attrs["units"] == "rad"
    theta = run.q.values[:, 0]
    square = (0.3 * np.cos(theta) + 0.72) ** 2 + (0.3 * np.sin(theta) + 0.21) ** 2
    between = np.arccos((0.8**2 + 0.5**2 - square) / (2 * 0.8 * 0.5))
    assert np.abs(angle.sel(dyad="J2") - np.minimum(between, np.pi - between)).max() <= 64 * EPS
    poses = sixbar.poses(run.q.values)
    rod = poses.rotation[:, sixbar.links.index("rod"), :, 0]  # along the rod; the rail is level
    assert np.abs(angle.sel(dyad="J5") - np.arccos(np.abs(rod[:, 1]))).max() <= 64 * EPS


def test_wanted_with_the_joint_variables(sixbar) -> None:
    assert "transmission_angle" in sixbar.inverse(want="joint_variable")
    assert "transmission_angle" not in sixbar.inverse(want="driving_force")
    spatial = linkdyn.load(EXAMPLES / "stewart_tsai" / "scene.toml")
    assert "transmission_angle" not in spatial.inverse()


def test_a_forward_run_has_them() -> None:
    scene = linkdyn.load(EXAMPLES / "fourbar_start" / "scene.toml")
    run = scene.forward(0.2, method="rk4", step=1e-2)
    again = scene.inverse(q=run.q.values, qd=run.qd.values, want="joint_variable")
    assert np.abs(run.transmission_angle - again.transmission_angle.values).max() <= 1e3 * EPS


def test_failed_samples_have_none(sixbar) -> None:
    scene = linkdyn.Scene(sixbar.text.replace("J1 = [0.3, 0.0]", "J1 = [0.6, 0.0]"))  # a crank that cannot turn fully
    run = scene.inverse(want="joint_variable")
    failed = run.status.values != 0
    assert failed.any() and not failed.all()
    assert (np.isnan(run.transmission_angle.values).all(axis=1) == failed).all()


def test_report_names_the_smallest(sixbar) -> None:
    said = [float(value) for value in re.findall(r"transmission angle down to ([\d.]+) deg", sixbar.explain())]
    smallest = np.degrees(sixbar.inverse().transmission_angle.min("sample").values)
    assert np.abs(said - smallest).max() <= 0.06  # printed to a tenth of a degree
