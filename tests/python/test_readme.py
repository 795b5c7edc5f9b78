"""What the README shows is what the reader gets: its commands and Python lines are run, their output compared.

Numbers may differ in the last printed digit; lines that tell a computing time are not compared.
"""
from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
# Tables print six significant digits and arrays eight decimals: half a unit of the last digit and a little more.
TOLERANCE = 1e-5


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.M | re.S)


def run_outside(command: list[str], folder: Path) -> str:
    """Run in an empty folder in which `examples` is what the README calls so."""
    (folder / "examples").symlink_to(ROOT / "examples")
    here = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(command, cwd=folder, env=os.environ | {"PATH": here}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def assert_alike(printed: str, expected: str) -> None:
    """Line by line: the same words, numbers within the tolerance."""
    ours, shown = printed.rstrip().splitlines(), expected.rstrip().splitlines()
    assert len(ours) == len(shown), f"{len(ours)} lines printed, {len(shown)} in the README:\n{printed}"
    for line, wanted in zip(ours, shown):
        if "computing time" in wanted:
            assert "computing time" in line
            continue
        assert NUMBER.sub("#", line).split() == NUMBER.sub("#", wanted).split(), f"{line!r} is not {wanted!r}"
        for a, b in zip(NUMBER.findall(line), NUMBER.findall(wanted)):
            assert float(a) == pytest.approx(float(b), rel=TOLERANCE, abs=1e-8), f"{line!r} is not {wanted!r}"


@pytest.mark.parametrize("block", blocks("console"))
def test_commands(block, tmp_path):
    command, _, expected = block.partition("\n")
    assert command.startswith("$ ")
    assert_alike(run_outside(shlex.split(command[2:]), tmp_path), expected)


def test_python(tmp_path):
    (code,), (expected,) = blocks("python"), blocks("text")
    assert_alike(run_outside([sys.executable, "-c", code], tmp_path), expected)


def test_scene_excerpt():
    (excerpt,) = blocks("toml")
    scene = (ROOT / "examples" / "stewart_tsai" / "scene.toml").read_text(encoding="utf-8").splitlines()
    lines = [line for line in excerpt.splitlines() if line.strip()]
    assert len(lines) > 10
    for line in lines:
        assert line in scene, f"{line!r} is not in the scene file"
