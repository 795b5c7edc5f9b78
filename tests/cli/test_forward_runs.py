"""`linkdyn forward`: runs that stop or are interrupted keep their file; what cannot run is refused in one line."""

from __future__ import annotations

import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import tomli_w
import xarray as xr

import linkdyn
from linkdyn.cli import executable

EXAMPLES = Path(__file__).parents[2] / "examples"
DONE, BAD_INPUT, STOPPED = 0, 2, 3
PATIENCE = 60
"""Seconds to wait for a process."""


def forward(folder: Path, *arguments: object) -> subprocess.CompletedProcess:
    command = [executable(), "forward", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=folder)


def changed(folder: Path, name: str, changes: dict) -> Path:
    """An example with some values changed, as a file."""
    path = folder / "changed.toml"
    path.write_text(linkdyn.load(EXAMPLES / name / "scene.toml").with_(changes).text)
    return path


def test_as_from_python(tmp_path):
    result = forward(tmp_path, EXAMPLES / "fourbar" / "scene.toml", "--until", 1, "--samples", 11, "-o", "run.nc")
    assert result.returncode == DONE, result.stderr
    scene = linkdyn.load(EXAMPLES / "fourbar" / "scene.toml")
    want = scene.forward(t=np.linspace(0, 1, 11))
    with xr.open_dataset(tmp_path / "run.nc") as run:
        for name in ("q", "qd", "qdd", "driving_force", "reaction", "joint_variable", "kinetic_energy", "work"):
            # The instants are not the same to the last bit.
            scale = float(abs(want[name]).max()) or 1.0
            np.testing.assert_allclose(run[name], want[name], rtol=0, atol=1e-11 * scale, err_msg=name)
        assert run.attrs["stopped"] == "" and int(run.attrs["steps"]) == want.attrs["steps"]


def run_interrupted(folder: Path, number: int, seconds: float) -> tuple[int, str]:
    """Exit status and messages of a run without end into run.nc, which gets a signal after so long."""
    arguments = ("forward", EXAMPLES / "fourbar" / "scene.toml", "--until", "1e5", "--samples", "1000001", "-o", "run.nc")
    process = subprocess.Popen([executable(), *map(str, arguments)], cwd=folder, stderr=subprocess.PIPE, text=True)
    time.sleep(seconds)
    process.send_signal(number)
    _, err = process.communicate(timeout=PATIENCE)
    return process.returncode, err


def n_samples(path: Path) -> int:
    """Of a run; 0 if it has left no file."""
    if not path.exists():
        return 0
    with xr.open_dataset(path) as run:
        return run.sizes["sample"]


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_interrupt_leaves_a_file_up_to_there(tmp_path, number, status):
    for seconds in (0.5, 2.0, 8.0, 32.0):    # within one of them even a crowded machine is on its way
        code, err = run_interrupted(tmp_path, number, seconds)
        if n_samples(tmp_path / "run.nc") > 10:
            break
    assert code == status
    assert "interrupted at t = " in err and err.count("\n") == 1
    with xr.open_dataset(tmp_path / "run.nc") as run:
        assert len(run.time) > 10
        assert np.all(np.isfinite(run.q)) and np.all(np.diff(run.time) > 0)
        assert run.attrs["stopped"].startswith("interrupted at t = ")
    assert [path.name for path in tmp_path.iterdir()] == ["run.nc"]


def test_a_stopped_run_keeps_its_file(tmp_path):
    changes = {"frame.markers.J1": [14.5, 0.0], "coordinate.J1.start": 2.6, "coordinate.J1.motion": None}
    scene = changed(tmp_path, "fourbar", changes | {"actuator.J1.law": {"type": "constant", "value": 0.0}})
    result = forward(tmp_path, scene, "--until", 10, "-o", "run.nc", "-q", "--method", "rk4", "--no-switch")
    assert result.returncode == STOPPED
    assert result.stderr.startswith(f"{scene}: stopped at t = ") and result.stderr.count("\n") == 1
    with xr.open_dataset(tmp_path / "run.nc") as run:
        good = np.isfinite(run.q[:, 0])
        assert good[0] and not good[-1]
        assert np.all(run.status[~good] != 0)
        assert run.attrs["stopped"] in result.stderr


def test_a_run_that_blows_up(tmp_path):
    # A spring that pushes instead of pulling: the angle grows like exp(1e5 t).
    spring = {"name": "S", "joint": "J1", "stiffness": -1e15}
    scene = changed(tmp_path, "fourbar", {"actuator.J1.law": {"type": "constant", "value": 0.0}, "spring.S": spring})
    result = forward(tmp_path, scene, "--until", 2, "--samples", 5, "--method", "rk4", "--step", "1e-3", "-o", "run.nc", "-q")
    assert result.returncode == STOPPED, result
    assert "stopped at t = " in result.stderr
    with xr.open_dataset(tmp_path / "run.nc") as run:
        assert np.isfinite(run.q[0, 0]) and np.isnan(run.q[-1, 0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--step", "0"], "step = 0"),
        (["--step", "nan"], "--step"),
        (["--rtol", "-1"], "rtol"),
        (["--atol", "0"], "atol"),
        (["--method", "euler"], "'euler'"),
        (["--until", "nan"], "--until"),
        (["--until", "inf"], "--until"),
        (["--until", "-1"], "has no duration"),
        (["--samples", "0"], "--samples"),
        (["--samples", "2000000000"], "from 2, both ends, to 999999999"),
        (["--samples", "1"], "from 2, both ends"),
    ],
)
def test_refusals(tmp_path, arguments, message):
    result = forward(tmp_path, EXAMPLES / "fourbar" / "scene.toml", *arguments)
    assert result.returncode == BAD_INPUT
    assert message in result.stderr and result.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("method", "tolerances", "words"),
    [
        ("gbs", {}, "1e-9 relative, 1e-9 absolute, in a step"),
        ("gbs", {"rtol": 0.5}, "1e-4 relative (0.5 was asked for, too loose to judge steps by), 1e-9 absolute, in a step"),
        ("msbdf", {"atol": 3.0}, "1e-9 relative, 1e-5 absolute (3 was asked for, too loose to judge steps by), in a step"),
        ("rk4", {}, ""),
    ],
)
def test_tolerances_too_loose_are_told(tmp_path, method, tolerances, words):
    """They were replaced without a word."""
    scene = EXAMPLES / "fourbar_start" / "scene.toml"
    options = [text for name, value in tolerances.items() for text in (f"--{name}", value)]
    result = forward(tmp_path, scene, "--until", 0.2, "--samples", 5, "-o", "run.nc", "--method", method, *options)
    assert result.returncode == DONE, result
    assert (f"  tolerance        {words}\n" in result.stdout) == (words != "") and ("tolerance" in result.stdout) == (words != "")
    with xr.open_dataset(tmp_path / "run.nc") as run:
        assert run.attrs["tolerance"] == words
    assert linkdyn.load(scene).forward(0.2, method=method, **tolerances).attrs["tolerance"] == words


def test_a_start_that_cannot_be_assembled(tmp_path):
    scene = changed(tmp_path, "fourbar", {"frame.markers.J1": [30.0, 0.0]})
    result = forward(tmp_path, scene)
    assert result.returncode == BAD_INPUT
    assert "at its start: links 'follower', 'coupler' cannot be closed" in result.stderr


@pytest.mark.parametrize(
    ("start", "motion", "fragment"),
    [
        ("60 deg", {"law": "cycloidal", "from": 0.0, "to": 1.0, "duration": 1.0}, "starts at 1.047198 rad, its motion at 0 rad"),
        (0.0, {"law": "constant-rate", "rate": 2.0}, "starts with 0 rad/s, its motion with 2 rad/s"),
    ],
)
def test_a_start_off_the_motion_is_no_start_for_its_forces(start, motion, fragment, tmp_path):
    """The law "inverse" applies forces of the motion: from elsewhere they would move the mechanism along none that was asked for."""
    scene = {
        "space": "planar",
        "frame": {"markers": {"A": [0.0, 0.0]}},
        "link": [{"name": "arm", "mass": 1.0, "cog": [0.5, 0.0], "inertia": 0.1, "markers": {"A": [0.0, 0.0]}}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "arm.A"]}],
        "coordinate": [{"joint": "A", "start": start, "motion": motion}],
        "actuator": [{"joint": "A"}],
        "time": {"end": 0.1, "samples": 3},
    }
    file = tmp_path / "scene.toml"
    file.write_text(tomli_w.dumps(scene))
    result = forward(tmp_path, file, "--no-output")
    assert result.returncode == 2 and result.stderr.count("\n") == 1
    assert fragment in result.stderr and "'A'" in result.stderr
    for mended in ({"driven": True}, {"start": {"position": motion.get("from", 0.0), "velocity": motion.get("rate", 0.0)}}, {"start": None}):
        coordinate = scene["coordinate"][0] | mended
        scene["coordinate"] = [{key: value for key, value in coordinate.items() if value is not None}]
        file.write_text(tomli_w.dumps(scene))
        assert forward(tmp_path, file, "--no-output").returncode == 0
        scene["coordinate"] = [{"joint": "A", "start": start, "motion": motion}]
