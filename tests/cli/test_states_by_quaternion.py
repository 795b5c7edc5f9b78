"""`--states` with attitudes as quaternions: Python's numbers, at the pole of the angles, too."""

from __future__ import annotations

import subprocess
from pathlib import Path

import linkdyn
import numpy as np
import pytest
import xarray as xr
from linkdyn.cli import executable

ROOT = Path(__file__).resolve().parents[2]
SCENE = ROOT / "examples" / "stewart_tsai" / "scene.toml"
N = 41


def call(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([executable(), *map(str, arguments)], capture_output=True, text=True, timeout=60)


def motion() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Instants, places and quaternions (not of unit length, some of them the opposite) of a platform that tilts past its pole."""
    t = np.linspace(0.0, 1.0, N)
    place = linkdyn.load(SCENE).motion(t)[0][:, :3]
    tilt, yaw = np.pi / 2 - 0.4 * np.cos(3 * t) * (1 - t), 0.2 * np.sin(2 * t)
    half = np.stack([np.cos(tilt / 2) * np.cos(yaw / 2), np.sin(tilt / 2) * np.sin(yaw / 2), np.sin(tilt / 2) * np.cos(yaw / 2), np.cos(tilt / 2) * np.sin(yaw / 2)], axis=1)
    return t, place, half * np.where(np.arange(N) % 3 == 0, -2.0, 0.5)[:, np.newaxis]


def write(file: Path, columns: dict[str, np.ndarray]) -> Path:
    file.write_text("\n".join([",".join(columns), *(",".join(f"{x:.17g}" for x in row) for row in np.array(list(columns.values())).T)]) + "\n")
    return file


def forces(tmp_path: Path, columns: dict[str, np.ndarray]) -> np.ndarray:
    out = tmp_path / "out.nc"
    states = write(tmp_path / "states.csv", columns)
    done = call("inverse", SCENE, "--states", states, "--output", out)
    assert done.returncode == 0, done.stderr
    with xr.open_dataset(out) as run:
        return run.driving_force.values


def named(prefix: str, values: np.ndarray, letters: str = "xyz") -> dict[str, np.ndarray]:
    return {f"{prefix}{letter}": column for letter, column in zip(letters, values.T, strict=True)}


def test_samples_and_motions(tmp_path: Path) -> None:
    """Poses at rest, with given rates, and along a motion that gets its rates from the splines of tables."""
    t, place, quaternion = motion()
    scene = linkdyn.load(SCENE)
    at = named("q platform.", place) | {f"q platform.q{letter}": column for letter, column in zip("wxyz", quaternion.T, strict=True)}
    rest = linkdyn.Pose(position=place, quaternion=quaternion)
    np.testing.assert_allclose(forces(tmp_path, at), scene.inverse(pose={"platform": rest}).driving_force, rtol=1e-12)
    spline = linkdyn.Pose.through(t, position=place, quaternion=quaternion)
    expected = scene.inverse(pose={"platform": spline}).driving_force
    rates = named("qd platform.", spline.velocity) | named("qdd platform.", spline.acceleration)
    spins = named("omega platform.", spline.angular_velocity) | named("alpha platform.", spline.angular_acceleration)
    np.testing.assert_allclose(forces(tmp_path, at | rates | spins), expected, rtol=1e-12)
    np.testing.assert_allclose(forces(tmp_path, {"time": t} | at), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(forces(tmp_path, {"time": t} | at | rates | spins), expected, rtol=1e-12)


def by_matrix(quaternion: np.ndarray) -> dict[str, np.ndarray]:
    """The nine columns of rotation matrices, by turning the axes."""
    w, v = np.split(quaternion / np.linalg.norm(quaternion, axis=1)[:, np.newaxis], [1], axis=1)
    w = w[:, 0]
    turned = []
    for e in np.eye(3):
        twice = 2 * np.cross(v, e)
        turned.append(e + w[:, np.newaxis] * twice + np.cross(v, twice))
    r = np.stack(turned, axis=2)
    return {f"q platform.r{i + 1}{j + 1}": r[:, i, j] for i in range(3) for j in range(3)}


def test_rotation_matrices(tmp_path: Path) -> None:
    """The forces of quaternions, in poses, with rates and along splines; six digits will do for a matrix."""
    t, place, quaternion = motion()
    scene = linkdyn.load(SCENE)
    at = named("q platform.", place) | by_matrix(quaternion)
    rest = linkdyn.Pose(position=place, quaternion=quaternion)
    expected = scene.inverse(pose={"platform": rest}).driving_force
    np.testing.assert_allclose(forces(tmp_path, at), expected, rtol=1e-11)
    np.testing.assert_allclose(forces(tmp_path, {name: np.round(column, 6) for name, column in at.items()}), expected, atol=1e-4 * np.abs(expected).max())
    spline = linkdyn.Pose.through(t, position=place, quaternion=quaternion)
    expected = scene.inverse(pose={"platform": spline}).driving_force
    rates = named("qd platform.", spline.velocity) | named("qdd platform.", spline.acceleration)
    spins = named("omega platform.", spline.angular_velocity) | named("alpha platform.", spline.angular_acceleration)
    np.testing.assert_allclose(forces(tmp_path, {"time": t} | at | rates | spins), expected, rtol=1e-11)
    np.testing.assert_allclose(forces(tmp_path, {"time": t} | at), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(("change", "words"), [
    (lambda r: -r, "states.csv:7: the rotation of 'platform' mirrors (expected a rotation, whose determinant is 1)"),
    (lambda r: 1.001 * r, "states.csv:7: the rotation of 'platform' is not a rotation: its rows are not orthonormal, by 0.002"),
    (lambda r: 0 * r, "states.csv:7: the rotation of 'platform' is not a rotation"),
    (lambda r: r * 1e200, "states.csv:7: the rotation of 'platform' is not a rotation"),
    (lambda r: r * np.nan, "states.csv:7: "),
    (lambda r: np.zeros(8), "states.csv: "),
])
def test_what_is_no_rotation(tmp_path: Path, change, words: str) -> None:
    """In one line, with the line of the sample."""
    _, place, quaternion = motion()
    columns = named("q platform.", place) | by_matrix(quaternion)
    names = [name for name in columns if ".r" in name]
    changed = change(np.array([columns[name][5] for name in names]))
    for name, value in zip(names, changed):
        columns[name][5] = value
    columns = {name: column for name, column in columns.items() if name in names[: len(changed)] or name not in names}
    done = call("inverse", SCENE, "--states", write(tmp_path / "states.csv", columns), "--no-output")
    assert done.returncode != 0 and words in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr


@pytest.mark.parametrize(("change", "words"), [
    ({"q platform.r11": 1.0}, "'platform' has columns of a quaternion and of a rotation matrix (expected one or the other)"),
    ({"q platform.roll": 0.0}, "column 'q platform.roll': stands beside the quaternion or matrix of the same attitude"),
    ({"q platform.qz": None}, "'q platform.qz'"),
    ({"omega base.x": 0.0}, "column 'omega base.x': no attitude of that name is told by its quaternion"),
    ({"omega platform.x": 0.0, "time": 1.0}, "a motion with some of the rates"),
    ({f"q platform.q{letter}": 0.0 for letter in "wxyz"}, "the quaternion of 'platform' is zero"),
])
def test_wrong_columns(tmp_path: Path, change: dict[str, float | None], words: str) -> None:
    """In one line, with the column."""
    t, place, quaternion = motion()
    columns = named("q platform.", place) | {f"q platform.q{letter}": column for letter, column in zip("wxyz", quaternion.T, strict=True)}
    columns |= {name: t * value if name == "time" else np.full(N, value) for name, value in change.items() if value is not None}
    columns = {name: column for name, column in columns.items() if change.get(name, 0.0) is not None}
    done = call("inverse", SCENE, "--states", write(tmp_path / "states.csv", columns), "--no-output")
    assert done.returncode != 0 and words in done.stderr and len(done.stderr.splitlines()) == 1
