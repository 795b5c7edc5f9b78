"""Sweeps from Python for a file: interrupted, killed, gone on with by Python and by the executable, to the same bits."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
import tomli_w
import xarray as xr

import linkdyn
from linkdyn import _bind

OPTIONS = {"solver": "lapack", "checkpoint": 0.0}
BY_COMMAND = ["-q", "--solver", "lapack", "--checkpoint", "0"]


@pytest.fixture()
def file(kept_sweep, tmp_path) -> Path:
    file = tmp_path / "scene.toml"
    file.write_text(tomli_w.dumps(kept_sweep))
    return file


@pytest.fixture()
def interrupted(file, tmp_path, monkeypatch) -> Path:
    """Output of a sweep that Ctrl-C has ended behind its third round."""
    output = tmp_path / "run.nc"
    rounds = iter(range(3))
    advance = _bind.advance_sweep

    def interrupt_later(*arguments):
        if next(rounds, None) is None:
            raise KeyboardInterrupt
        return advance(*arguments)

    with monkeypatch.context() as patch, contextlib.suppress(KeyboardInterrupt):
        patch.setattr(_bind, "advance_sweep", interrupt_later)
        linkdyn.load(file).sweep(output=output, solver="lapack", checkpoint=1000)
    assert not output.exists()
    assert Path(f"{output}.checkpoint").exists()    # though none was due
    return output


def whole(file: Path) -> xr.Dataset:
    return linkdyn.load(file).sweep(solver="lapack")


def is_same(one: xr.Dataset, two: xr.Dataset) -> bool:
    return set(one.variables) == set(two.variables) and all(one[name].equals(two[name]) for name in one.variables)


def test_an_output_is_what_is_given_back(file, names, tmp_path):
    run = linkdyn.load(file).sweep(output=tmp_path / "run.nc", **OPTIONS)
    assert names() == ["run.nc", "scene.toml"]
    with xr.open_dataset(tmp_path / "run.nc") as kept:
        assert is_same(run, kept.load())
        assert kept.attrs["solver"] == "lapack"
    assert is_same(run, whole(file))


def test_interrupted_it_goes_on(file, interrupted, names):
    run = linkdyn.load(file).sweep(output=interrupted, resume=True, threads=2, **OPTIONS)
    assert is_same(run, whole(file))
    assert names() == ["run.nc", "scene.toml"]


@pytest.mark.thorough
def test_the_executable_goes_on_with_it(file, interrupted, program, names):
    result = program("sweep", file, "-o", interrupted, "--resume", *BY_COMMAND)
    assert result.returncode == 0, result.stderr
    with xr.open_dataset(interrupted) as run:
        assert is_same(run.load(), whole(file))
    assert names() == ["run.nc", "scene.toml"]


@pytest.mark.thorough
def test_what_the_executable_has_begun_goes_on(file, interrupt_sweep, tmp_path):
    output = tmp_path / "run.nc"
    interrupt_sweep(file, output)
    assert is_same(linkdyn.load(file).sweep(output=output, resume=True, **OPTIONS), whole(file))


@pytest.mark.thorough
def test_killed_it_goes_on(file, wait_for, names, tmp_path):
    output = tmp_path / "run.nc"
    program = f"""
        import linkdyn
        linkdyn.load({str(file)!r}).sweep(output={str(output)!r}, resume=True, solver="lapack", checkpoint=0)
    """
    with subprocess.Popen([sys.executable, "-c", textwrap.dedent(program)], stderr=subprocess.PIPE, text=True) as process:
        wait_for(Path(f"{output}.checkpoint"), process)
        process.kill()
    assert process.returncode == -signal.SIGKILL
    assert is_same(linkdyn.load(file).sweep(output=output, resume=True, **OPTIONS), whole(file))
    assert names() == ["run.nc", "scene.toml"]


@pytest.mark.thorough
def test_results_that_cannot_be_written_are_not_lost(file, names, monkeypatch, tmp_path):
    """All is computed, the disk is full: once more, and nothing is computed again."""
    output = tmp_path / "run.nc"

    def full(*_, **__):
        raise OSError(28, os.strerror(28))

    with monkeypatch.context() as patch, pytest.raises(linkdyn.FileError, match="run.nc: cannot be written: No space left on device"):
        patch.setattr(xr.Dataset, "to_netcdf", full)
        linkdyn.load(file).sweep(output=output, **OPTIONS)
    assert names() == ["run.nc.checkpoint", "run.nc.spool", "scene.toml"]
    computed = []
    advance = _bind.advance_sweep
    monkeypatch.setattr(_bind, "advance_sweep", lambda *arguments: computed.append(advance(*arguments)) or computed[-1])
    assert is_same(linkdyn.load(file).sweep(output=output, resume=True, **OPTIONS), whole(file))
    assert computed[0][0] and len(computed[0][3]) == 0
    assert names() == ["run.nc", "scene.toml"]


def test_an_interrupted_run_is_not_overwritten(file, interrupted):
    with pytest.raises(linkdyn.InputError, match=r"run\.nc\.checkpoint: an interrupted run is kept there \(expected resume=True"):
        linkdyn.load(file).sweep(output=interrupted, **OPTIONS)
    assert Path(f"{interrupted}.checkpoint").exists()


def test_another_sweep_does_not_go_on_with_it(file, interrupted):
    other = linkdyn.load(file).with_({"link.platform.mass": 2.0})
    with pytest.raises(linkdyn.InputError, match="was made from another scene"):
        other.sweep(output=interrupted, resume=True, **OPTIONS)


def test_one_at_a_time(file, tmp_path):
    """A sweep of the same process, too, is at its file alone."""
    scene, output = linkdyn.load(file), tmp_path / "run.nc"
    sweep, *_ = _bind.open_sweep(scene._handle, scene.folder, "lapack", "", 1, str(output), False, 0.0)
    try:
        with pytest.raises(linkdyn.InputError, match=f"process {os.getpid()} on .* is writing there"):
            scene.sweep(output=output, **OPTIONS)
    finally:
        _bind.close_sweep(sweep, has_ended=False)
    scene.sweep(output=output, **OPTIONS)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"resume": True}, "resume: there is no output"),
        ({"output": 7}, "output: expected a path"),
        ({"output": "run.nc", "checkpoint": -1}, "checkpoint: -1 (expected seconds)"),
        ({"output": "run.nc", "checkpoint": "soon"}, "checkpoint"),
        ({"output": "run.nc", "resume": "yes"}, "resume"),
    ],
)
def test_wrong_arguments(wrong, says, file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(linkdyn.InputError) as refusal:
        linkdyn.load(file).sweep(**wrong)
    assert says in str(refusal.value)
    assert not (tmp_path / "run.nc.lock").exists()


def test_an_output_is_no_input(file):
    with pytest.raises(linkdyn.FileError, match="is the scene file"):
        linkdyn.load(file).sweep(output=file, **OPTIONS)
    assert linkdyn.load(file)


def test_an_output_is_a_file(file, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(linkdyn.FileError, match="is a device or a pipe"):
        linkdyn.load(file).sweep(output=tmp_path / "pipe", **OPTIONS)
    with pytest.raises(linkdyn.FileError, match="folder|directory"):
        linkdyn.load(file).sweep(output=tmp_path, **OPTIONS)
