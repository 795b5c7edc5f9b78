"""`linkdyn sweep`: resumed, changed, too large, full disk. What damage does: tests/faults."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
from pathlib import Path

import pytest
import tomli_w

from linkdyn.cli import executable

DONE, BAD_INPUT = 0, 2


def run(*arguments, **options) -> subprocess.CompletedProcess:
    return subprocess.run(
        [executable(), "sweep", *map(str, arguments)], capture_output=True, text=True, timeout=120, **options
    )


def refused(result: subprocess.CompletedProcess, *fragments: str) -> None:
    """One line on standard error, nothing on standard output, exit status 2."""
    assert result.returncode == BAD_INPUT, result
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1, result.stderr
    for fragment in fragments:
        assert fragment in result.stderr, result.stderr


@pytest.fixture()
def long_sweep(kept_sweep) -> dict:
    """Some seconds of work."""
    kept_sweep["sweep"]["axis"].append({"coordinate": "platform.yaw", "linspace": [-0.4, 0.4, 5]})
    return kept_sweep


def write(scene: dict, folder: Path) -> Path:
    file = folder / "scene.toml"
    file.write_text(tomli_w.dumps(scene))
    return file


def test_a_changed_scene_is_not_resumed(long_sweep, interrupt_sweep, tmp_path):
    scene, output = write(long_sweep, tmp_path), tmp_path / "results.nc"
    interrupt_sweep(scene, output)
    refused(run(scene, "-o", output, "--solver", "lapack"), "interrupted run is kept there", "--resume")
    refused(run(scene, "-o", output, "--resume"), "another scene, with other options")
    long_sweep["link"][0]["mass"] = 1.6
    write(long_sweep, tmp_path)
    refused(run(scene, "-o", output, "--resume", "--solver", "lapack"), "another scene, with other options", "remove this file")


def limit_file_size() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)


def test_a_full_disk_is_said_and_resumed(long_sweep, same, tmp_path):
    """The spool of kept samples outgrows what may be written."""
    scene, output, whole = write(long_sweep, tmp_path), tmp_path / "results.nc", tmp_path / "whole.nc"
    options = ("-q", "--solver", "lapack", "--checkpoint", "0")
    assert run(scene, "-o", whole, *options).returncode == DONE
    refused(run(scene, "-o", output, *options, preexec_fn=limit_file_size), "cannot be written")
    assert not output.exists()
    assert run(scene, "-o", output, "--resume", *options).returncode == DONE
    assert same(output, whole)


def test_large_requests_want_consent(tsai, tmp_path):
    tsai["sweep"] = {"reduce": ["driving_force"], "axis": [
        {"coordinate": f"platform.{name}", "linspace": [-0.01, 0.01, 1000]} for name in ("roll", "pitch", "yaw", "x", "y")
    ]}
    result = run(write(tsai, tmp_path), cwd=tmp_path)
    refused(result, "1000000000000000 samples take about", "years", "--yes")
    result = run(write(tsai, tmp_path), "--keep", "driving_force", cwd=tmp_path)
    refused(result, "1000000000000000 samples take about", "--yes")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["scene.toml"]  # no spool either
    tsai["sweep"]["axis"].append({"coordinate": "platform.z", "linspace": [-0.01, 0.01, 1000]})
    refused(run(write(tsai, tmp_path), "--yes", cwd=tmp_path), "more than 4.5e15 samples")


def test_table_and_default_name(tsai, tmp_path):
    tsai["sweep"] = {"reduce": ["driving_force", "reaction_force", "determinant"], "axis": [
        {"coordinate": "platform.x", "linspace": [-1.6, -1.4, 5]}
    ]}
    folder = tmp_path / "table"
    folder.mkdir()
    result = run(write(tsai, folder), cwd=folder)
    assert result.returncode == DONE and result.stderr == ""
    for text in ("5 samples", "leg1.P [N]", "largest at platform.x =", "largest joint force", "none crossed", "table_sweep.nc"):
        assert text in result.stdout, result.stdout
    assert sorted(path.name for path in folder.iterdir()) == ["scene.toml", "table_sweep.nc"]


@pytest.mark.parametrize(
    ("arguments", "fragments"),
    [
        (["--csv"], ["'--csv'", "unknown option"]),
        (["--resumee"], ["did you mean '--resume'"]),
        (["--keep", "driving_forces"], ["'driving_forces'", "did you mean 'driving_force'"]),
        (["--checkpoint", "-1"], ["--checkpoint"]),
        (["-o", "/nowhere/at/all.nc"], ["cannot be written"]),
    ],
)
def test_refused_arguments(arguments, fragments, tsai, tmp_path):
    tsai["sweep"] = {"axis": [{"coordinate": "platform.x", "linspace": [-1.6, -1.4, 5]}]}
    refused(run(write(tsai, tmp_path), *arguments, cwd=tmp_path), *fragments)


def test_a_scene_without_a_sweep(tsai, tmp_path):
    refused(run(write(tsai, tmp_path), cwd=tmp_path), "has no sweep", "[sweep]")


def test_help():
    result = run("--help")
    assert result.returncode == DONE
    for option in ("--output", "--keep", "--threads", "--resume", "--yes", "--checkpoint", "--solver", "--quiet"):
        assert option in result.stdout


mpirun = pytest.mark.skipif(shutil.which("mpirun") is None, reason="no mpirun here")


@mpirun
@pytest.mark.parametrize("n", [2, 4])
def test_processes_to_the_last_bit(n, long_sweep, same, tmp_path):
    """A build with MPI gives the same file; one without refuses to run several times side by side."""
    scene, one, many = write(long_sweep, tmp_path), tmp_path / "one.nc", tmp_path / "many.nc"
    assert run(scene, "-o", one, "-q").returncode == DONE
    command = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", str(n), executable(), "sweep", scene, "-o", many]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120)
    if "built without MPI" in result.stderr:
        assert "LINKDYN_HAS_MPI" not in os.environ      # tools/check.py knows what it has built
        assert result.returncode == BAD_INPUT and not many.exists()
        return
    assert result.returncode == DONE, result.stderr
    assert f"in each of {n} processes" in result.stdout
    assert same(one, many)
