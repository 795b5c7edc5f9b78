"""Homework 3: J3 of the five-bar mechanism along a straight line."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np

import linkdyn

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "fivebar_parallel"
SPEC = importlib.util.spec_from_file_location("make_path", FOLDER / "make_path.py")
make_path = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(make_path)
EPS = np.finfo(float).eps

# Not at the rows of the table only.
T = np.linspace(0.0, 1.0, 57)


def test_the_point_follows_the_line() -> None:
    """The cranks' angles bring J3 where it shall be: forward by the engine, backward by the lecture's modules."""
    scene = linkdyn.load(FOLDER / "scene_path.toml")
    j3 = make_path.path(T)
    q, qd, qdd = make_path.crank_angles(T)
    rod = scene.links.index("rod1")  # its origin is J3
    assert np.abs(scene.poses(q).position[:, rod, :2] - j3.p).max() <= 16 * EPS
    # What the engine makes of rates and accelerations: by the power of a force at J3, along the line.
    work = scene.inverse(q=q, qd=qd, qdd=qdd, want="power,checks").driving_power.sum("actuator")
    still = scene.inverse(q=q, qd=qd, qdd=qdd, wrench={"rod1.J3": [-1.0, 0.0, 0.0]}, want="power").driving_power.sum("actuator")
    assert np.abs(still - work - j3.dp[:, 0]).max() <= 1e3 * EPS


def test_accelerations_are_derivatives() -> None:
    h = 1e-3
    inner = T[2:-2]
    q, qd, qdd = make_path.crank_angles(inner)
    ahead, behind = (make_path.crank_angles(inner + step) for step in (h, -h))
    # Central differences of order 2: the third derivatives of the angles stay below 500.
    assert np.abs((ahead[0] - behind[0]) / (2 * h) - qd).max() <= 500 * h**2
    assert np.abs((ahead[1] - behind[1]) / (2 * h) - qdd).max() <= 5e3 * h**2


def test_table_is_the_path() -> None:
    """The spline through the rows of path.csv, by which `linkdyn inverse` moves, agrees with the exact motion."""
    scene = linkdyn.load(FOLDER / "scene_path.toml")
    got, want = scene.motion(T), make_path.crank_angles(T)
    # Rows 2.5 ms apart: some h^4/384, h^3/24 and h^2/12 of fourth derivatives of a thousand rad/s4.
    for values, exact, error in zip(got, want, (1e-10, 6e-7, 5e-4)):
        assert np.abs(values - exact).max() <= error
    forces = scene.inverse(t=T).driving_force
    exact = scene.inverse(q=want[0], qd=want[1], qdd=want[2]).driving_force
    assert np.abs(forces.values - exact.values).max() <= 1e-5 * np.abs(exact.values).max()
