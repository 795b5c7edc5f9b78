"""Every command says that it is at work and obeys the first signal; signals that were ignored at its start stay ignored."""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import tomli_w

from linkdyn.cli import executable

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = ["explain", "forward", "inverse", "study", "sweep"]
PATIENCE = 60
"""Seconds after which a test gives up: far more than anything here takes."""


@pytest.fixture(scope="module")
def large_scene(tmp_path_factory) -> Path:
    """A chain of four-bars that takes its time to be planned."""
    file = tmp_path_factory.mktemp("large") / "scene.toml"
    command = [sys.executable, ROOT / "examples" / "n_fourbar" / "make_scene.py", "12000", file]
    subprocess.run(command, check=True, capture_output=True)
    return file


@pytest.fixture()
def endless(request, tsai, tmp_path, large_scene) -> list[str]:
    """Minutes of work for a command."""
    command = request.param
    tsai["time"] = {"end": 1, "samples": 2_000_000_000}
    tsai["sweep"] = {"axis": [
        {"coordinate": f"platform.{name}", "linspace": [-0.01, 0.01, 1000]} for name in ("roll", "pitch", "yaw")]}
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(tsai))
    more = {"forward": ["--until", "1e6", "--samples", "1000000"], "inverse": ["--no-output"], "sweep": ["--yes"],
            "study": ["--until", "1e5"], "explain": []}[command]
    return [command, str(large_scene if command == "explain" else tmp_path / "scene.toml"), *more]


def start(arguments: list[str], folder: Path, **options) -> subprocess.Popen:
    return subprocess.Popen([executable(), *arguments], cwd=folder, stdout=subprocess.DEVNULL, **options)


@pytest.mark.thorough
@pytest.mark.parametrize("signal_number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
@pytest.mark.parametrize("endless", COMMANDS, indirect=True)
def test_sign_of_life_and_first_signal(endless, signal_number, tmp_path):
    """On a terminal a line says how long the command has been at work; the first signal ends it, the line is wiped or left whole."""
    ours, theirs = pty.openpty()
    process = start(endless, tmp_path, stderr=theirs)
    os.close(theirs)
    try:
        said, begin = "", time.monotonic()
        while not re.search(r"\d s so far", said):
            assert process.poll() is None and time.monotonic() - begin < PATIENCE, said
            if select.select([ours], [], [], 0.5)[0]:
                said += os.read(ours, 4096).decode()
        assert said.startswith("\r")
        process.send_signal(signal_number)
        code = process.wait(timeout=PATIENCE / 2)
        # by the signal, or by its own will after writing what there is
        assert code in (-signal_number, 128 + signal_number)
    finally:
        process.kill()
        process.wait()
        os.close(ours)
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.thorough
@pytest.mark.parametrize(("method", "stiffness"), [("rk8pd", "1e9"), ("gbs", "1e9"), ("seulex", "1e12")])
@pytest.mark.parametrize("signal_number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_signal_between_output_instants(method, stiffness, signal_number, tmp_path):
    """A stiff spring asks for a million steps up to the next instant of output, or for trials of a step that take seconds."""
    scene = (ROOT / "tests" / "python" / "scenes" / "stiff_spring.toml").read_text()
    assert "stiffness = 1e+31" in scene
    (tmp_path / "scene.toml").write_text(scene.replace("stiffness = 1e+31", f"stiffness = {stiffness}"))
    command = ["forward", "scene.toml", "--until", "50", "--samples", "2", "--method", method, "--no-output"]
    process = start(command, tmp_path, stderr=subprocess.DEVNULL)
    try:
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=3)
        process.send_signal(signal_number)
        assert process.wait(timeout=PATIENCE / 2) in (-signal_number, 128 + signal_number)
    finally:
        process.kill()
        process.wait()


def test_no_sign_where_nobody_looks(tsai, tmp_path):
    """Neither in a file nor with --quiet."""
    tsai["time"] = {"end": 1, "samples": 2_000_000_000}
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(tsai))
    ours, theirs = pty.openpty()
    with (tmp_path / "log").open("w") as log:
        runs = [start(["inverse", "scene.toml", "--no-output"], tmp_path, stderr=log),
                start(["inverse", "scene.toml", "--no-output", "--quiet"], tmp_path, stderr=theirs)]
        time.sleep(3)
        for run in runs:
            run.kill()
            run.wait()
    assert not select.select([ours], [], [], 0)[0]
    os.close(theirs)
    os.close(ours)
    assert (tmp_path / "log").read_text() == ""


@pytest.mark.thorough
@pytest.mark.parametrize("signal_number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], ids=lambda number: number.name)
@pytest.mark.parametrize("command", ["forward", "inverse", "sweep"])
def test_ignored_signals_stay_ignored(command, signal_number, tsai, tmp_path):
    """As under nohup, or in the background of a script."""
    tsai["time"] = {"end": 1, "samples": 200_001}
    tsai["sweep"] = {"keep": ["driving_force"], "axis": [
        {"coordinate": f"platform.{name}", "linspace": [-0.01, 0.01, 60]} for name in ("roll", "pitch", "yaw")]}
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(tsai))
    more = ["--until", "1", "--samples", "5001"] if command == "forward" else []
    process = start([command, "scene.toml", "-q", "-o", "run.nc", *more], tmp_path,
                    preexec_fn=lambda: signal.signal(signal_number, signal.SIG_IGN))
    while not (list(tmp_path.glob("*.part")) or list(tmp_path.glob("*.lock"))):
        assert process.poll() is None
        time.sleep(0.001)
    for _ in range(5):
        process.send_signal(signal_number)
        time.sleep(0.02)
    assert process.wait(timeout=PATIENCE) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.nc", "scene.toml"]


def test_interrupted_forward_run_keeps_what_it_has(tmp_path):
    """The first signal ends the run, with all samples so far; a second one would leave nothing."""
    scene = ROOT / "examples" / "n_fourbar" / "scene.toml"
    process = start(["forward", str(scene), "-q", "--until", "1e4", "--samples", "10000001", "--csv", "-o", "run.csv"], tmp_path,
                    stderr=subprocess.PIPE, text=True)
    while not any(path.stat().st_size > 10**5 for path in tmp_path.glob("*.part")):
        assert process.poll() is None
        time.sleep(0.001)
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=PATIENCE) == 128 + signal.SIGTERM
    assert "interrupted at t = " in process.stderr.read()
    process.stderr.close()
    rows = (tmp_path / "run.csv").read_text().splitlines()
    assert len({row.count(",") for row in rows}) == 1 and len(rows) > 100


def test_study_ends_its_twin(tsai, tmp_path):
    """A signal to the program alone ends the other one that it has started."""
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(tsai))
    twin = tmp_path / "twin"
    twin.write_text('#!/bin/sh\necho $$ > "$(dirname "$0")/process"\nexec sleep 1000\n')
    twin.chmod(0o755)
    process = start(["study", "scene.toml", "-q"], tmp_path, env=os.environ | {"LINKDYN_REAL128": str(twin)})
    while not (tmp_path / "process").exists() or not (tmp_path / "process").read_text().strip():
        assert process.poll() is None
        time.sleep(0.001)
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=PATIENCE) == -signal.SIGTERM
    child, begin = int((tmp_path / "process").read_text()), time.monotonic()
    while Path(f"/proc/{child}").exists() and "zombie" not in Path(f"/proc/{child}/status").read_text():
        assert time.monotonic() - begin < PATIENCE
        time.sleep(0.01)
