"""Checkpoint, spool and lock of a sweep: what was lost, changed or is another's never gets into the results."""

from __future__ import annotations

import os
import random
import signal
import time
from pathlib import Path

import pytest
import tomli_w
import xarray as xr

OPTIONS = ["-q", "--solver", "lapack", "--checkpoint", "0"]


@pytest.fixture()
def scene(kept_sweep, tmp_path) -> Path:
    file = tmp_path / "scene.toml"
    file.write_text(tomli_w.dumps(kept_sweep))
    return file


def truncate(data: bytearray) -> bytes:
    return data[: len(data) // 2]


def empty(_: bytearray) -> bytes:
    return b""


def flip_a_bit(data: bytearray) -> bytes:
    data[len(data) // 3] ^= 4
    return data


def flip_a_bit_of_the_head(data: bytearray) -> bytes:
    data[3] ^= 1
    return data


DAMAGES = [truncate, empty, flip_a_bit, flip_a_bit_of_the_head]


@pytest.mark.thorough
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_spool_is_not_gone_on_with(damage, scene, interrupt_sweep, refused, program, tmp_path):
    output = tmp_path / "run.nc"
    interrupt_sweep(scene, output)
    spool = tmp_path / "run.nc.spool"
    whole = spool.read_bytes()
    spool.write_bytes(damage(bytearray(whole)))
    refused("sweep", scene, "-o", output, "--resume", *OPTIONS, says=("run.nc.spool", "to start anew"))
    assert not output.exists()
    spool.write_bytes(whole)
    assert program("sweep", scene, "-o", output, "--resume", *OPTIONS).returncode == 0


@pytest.mark.thorough
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_checkpoint_is_not_gone_on_with(damage, scene, interrupt_sweep, refused, tmp_path):
    output = tmp_path / "run.nc"
    interrupt_sweep(scene, output)
    checkpoint = tmp_path / "run.nc.checkpoint"
    checkpoint.write_bytes(damage(bytearray(checkpoint.read_bytes())))
    refused("sweep", scene, "-o", output, "--resume", *OPTIONS, says="run.nc.checkpoint")
    assert not output.exists()


def test_a_lost_spool_is_missed(scene, interrupt_sweep, refused, tmp_path):
    output = tmp_path / "run.nc"
    interrupt_sweep(scene, output)
    (tmp_path / "run.nc.spool").unlink()
    refused("sweep", scene, "-o", output, "--resume", *OPTIONS, says=("run.nc.spool", "No such file"))


def test_the_spool_of_another_run_is_told(scene, interrupt_sweep, refused, tmp_path):
    """The same sweep, killed twice: each spool goes with its own checkpoint only."""
    for name in ("one.nc", "two.nc"):
        interrupt_sweep(scene, tmp_path / name)
    (tmp_path / "two.nc.spool").replace(tmp_path / "one.nc.spool")
    refused("sweep", scene, "-o", tmp_path / "one.nc", "--resume", *OPTIONS, says="belongs to another")


@pytest.mark.thorough
def test_a_spool_left_over_is_begun_anew(scene, same, program, tmp_path):
    """Killed before its first checkpoint, with some samples kept: nothing of them gets into the results."""
    whole, output, victim = tmp_path / "whole.nc", tmp_path / "run.nc", tmp_path / "victim"
    assert program("sweep", scene, "-o", whole, *OPTIONS).returncode == 0
    victim.write_text("precious")
    for left in (lambda spool: spool.write_bytes(b"x" * 10**6), lambda spool: spool.symlink_to(victim)):
        left(tmp_path / "run.nc.spool")
        assert program("sweep", scene, "-o", output, *OPTIONS).returncode == 0
        assert same(whole, output) and not (tmp_path / "run.nc.spool").exists()
        output.unlink()
    assert victim.read_text() == "precious"


@pytest.mark.thorough
def test_killed_at_any_moment(scene, start_sweep, same, program, names, tmp_path):
    """Killed again and again, while it computes, keeps and writes: what comes out in the end is the same, nothing else stays."""
    whole, output = tmp_path / "whole.nc", tmp_path / "run.nc"
    begin = time.monotonic()
    assert program("sweep", scene, "-o", whole, *OPTIONS).returncode == 0
    seconds = time.monotonic() - begin
    dice = random.Random(3)
    n_killed = 0
    for attempt in range(12):
        with start_sweep(scene, output, "--resume", *(("--threads", "2") if attempt % 2 else ())) as process:
            time.sleep(dice.uniform(0.1, 0.4) * seconds)
            process.kill()
        n_killed += process.returncode == -signal.SIGKILL
        if process.returncode == 0:
            break
        assert process.returncode == -signal.SIGKILL and not output.exists()
    assert n_killed > 2
    result = program("sweep", scene, "-o", output, "--resume", *OPTIONS)
    assert result.returncode == 0, result.stderr
    assert same(whole, output)
    assert names() == ["run.nc", "scene.toml", "whole.nc"]


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["run.nc", "link.nc"])
def test_one_sweep_at_a_time_writes_to_a_file(name, scene, start_sweep, wait_for, program, refused, tmp_path):
    """The second one is refused and told who is at it, also by another name of the file; the first one goes on."""
    output = tmp_path / "run.nc"
    (tmp_path / "link.nc").symlink_to(output)
    with start_sweep(scene, output) as first:
        wait_for(tmp_path / "run.nc.spool", first)    # made behind the lock
        first.send_signal(signal.SIGSTOP)
        try:
            refused("sweep", scene, "-o", tmp_path / name, *OPTIONS, says=f"process {first.pid} on {os.uname().nodename}")
        finally:
            first.send_signal(signal.SIGCONT)
        assert first.wait(timeout=60) == 0
    assert not (tmp_path / "run.nc.lock").exists()
    assert program("sweep", scene, "-o", tmp_path / name, *OPTIONS).returncode == 0


def test_a_lock_ends_with_its_holder(scene, interrupt_sweep, program, tmp_path):
    """Killed: the lock file stays, the lock does not."""
    output = tmp_path / "run.nc"
    interrupt_sweep(scene, output)
    assert (tmp_path / "run.nc.lock").exists()
    assert program("sweep", scene, "-o", output, "--resume", *OPTIONS).returncode == 0


@pytest.mark.thorough
def test_many_at_once(scene, start_sweep, tmp_path):
    """Of several that start together one writes, and the others are told."""
    output = tmp_path / "run.nc"
    runs = [start_sweep(scene, output) for _ in range(6)]
    outcomes = sorted((run.wait(timeout=120), run.stderr.read()) for run in runs)
    assert [code for code, _ in outcomes].count(0) >= 1
    assert all(code == 0 or "is writing there" in said for code, said in outcomes)
    xr.load_dataset(output)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.nc", "scene.toml"]
