"""``linkdyn new``: every scene to start from runs, and is right; files are not replaced unasked."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot

import linkdyn
from linkdyn._commands.new import SCENES, kinds
from linkdyn.cli import executable

KINDS = (
    "3-rrr", "arm", "cam", "delta", "excavator", "five-bar", "four-bar", "hexapod", "quick-return", "scissor-lift", "six-bar", "slider-crank",
)  # fmt: skip
NO_FORWARD = ("cam", "delta", "excavator", "scissor-lift", "hexapod")
"""Their text promises no forward run."""


def command(*words: object, cwd: Path) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-m", "linkdyn", *map(str, words)], capture_output=True, text=True, timeout=120, cwd=cwd)


def refused(result: subprocess.CompletedProcess, fragment: str) -> None:
    assert result.returncode == 2 and result.stdout == "" and result.stderr.count("\n") == 1, result
    assert result.stderr.startswith("linkdyn: new: ") and fragment in result.stderr, result.stderr


def test_all_kinds_are_listed(tmp_path):
    lines = command("new", cwd=tmp_path).stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(KINDS) == list(kinds())
    assert all(len(line.split()) > 3 and len(line) < 120 for line in lines)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_scene_runs(kind, tmp_path):
    done = command("new", kind, cwd=tmp_path)
    assert done.returncode == 0 and done.stdout == f"  scene            {kind}.toml\n  next             linkdyn inverse {kind}.toml\n"
    assert (tmp_path / f"{kind}.toml").read_text() == linkdyn.new(kind).text == (SCENES / f"{kind}.toml").read_text()
    said = subprocess.run([executable(), "inverse", f"{kind}.toml", "--no-output"], capture_output=True, text=True, cwd=tmp_path, timeout=60)
    assert said.returncode == 0 and "failed samples   none" in said.stdout and said.stderr == ""


@pytest.mark.parametrize("kind", KINDS)
def test_forces_balance(kind):
    """No sample fails; power in is power stored; a second solver agrees; forces are not zero."""
    scene = linkdyn.new(kind)
    run = scene.inverse(want="all")
    assert (run.status == 0).all() and float(np.abs(run.driving_force).max()) > 0.1
    at_work = np.abs(run.driving_power).max("actuator") > 1e-9 * float(np.abs(run.driving_power).max())  # not in the dwell of a cam
    assert float(np.abs(run.power_imbalance[at_work]).max()) < 1e-9
    other = scene.inverse(solver="lapack")
    np.testing.assert_allclose(run.driving_force, other.driving_force, rtol=0, atol=1e-9 * float(np.abs(run.driving_force).max()))
    if "assembly" in run:
        assert (run.assembly == 0).all()    # no change point on the way


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in NO_FORWARD])
def test_forward_runs_as_promised(kind):
    scene = linkdyn.new(kind)
    assert "linkdyn forward FILE" in scene.text
    run = scene.forward()
    assert (run.status == 0).all() and run.attrs.get("stopped", "") == ""


@pytest.mark.parametrize("kind", KINDS)
def test_a_scene_teaches(kind):
    """Its first line says what it is, then what to do with it; it has variables, all of them used; it follows them."""
    text = linkdyn.new(kind).text
    lines = text.splitlines()
    assert lines[0].startswith("# A") and lines[0].endswith(".") and any(line.startswith("#   linkdyn inverse FILE ") for line in lines[:8])
    assert text.count("#") > 8 and "linkdyn forward" not in text or kind not in NO_FORWARD
    assert max(map(len, lines)) < 260
    variables = tomllib.loads(text)["variables"]
    for name in variables:
        assert len(re.findall(rf"\b{name}\b", re.sub(r"(^|  )# .*", "", text, flags=re.M))) > 1, name
    lengths = [entry for entry in linkdyn.new(kind).description["variables"] if entry["unit"] == "m"]
    name, value = lengths[0]["name"], lengths[0]["value"]
    longer = linkdyn.new(kind).with_({f"variables.{name}": 1.01 * value} if isinstance(variables[name], str) else {})
    assert (longer.inverse().status == 0).all()


@pytest.mark.parametrize("kind", KINDS)
def test_pictures_can_be_drawn(kind, tmp_path):
    scene = linkdyn.new(kind)
    figure, _ = linkdyn.plot.mechanism(scene)
    figure.savefig(tmp_path / "scene.png")
    assert (tmp_path / "scene.png").stat().st_size > 5000
    pyplot.close("all")


def test_files_are_not_replaced_unasked(tmp_path):
    scene = tmp_path / "four-bar.toml"
    scene.write_text("mine")
    refused(command("new", "four-bar", cwd=tmp_path), "'four-bar.toml' is there already (expected another file, --output FILE, or --force)")
    assert scene.read_text() == "mine"
    (tmp_path / "link.toml").symlink_to("nowhere.toml")
    refused(command("new", "four-bar", "-o", "link.toml", cwd=tmp_path), "is there already")
    assert command("new", "four-bar", "--force", "-q", cwd=tmp_path).stdout == ""
    assert scene.read_text() == linkdyn.new("four-bar").text
    assert sorted(os.listdir(tmp_path)) == ["four-bar.toml", "link.toml"]


def test_where_it_goes(tmp_path):
    assert command("new", "arm", "-o", "robot.toml", cwd=tmp_path).returncode == 0
    assert sorted(os.listdir(tmp_path)) == ["robot.toml"]
    assert command("new", "arm", "-o", "-", cwd=tmp_path).stdout == linkdyn.new("arm").text
    umask = os.umask(0)
    os.umask(umask)
    assert (tmp_path / "robot.toml").stat().st_mode & 0o777 == 0o666 & ~umask


@pytest.mark.parametrize(
    ("words", "fragment"),
    [
        (["fourbar"], "'fourbar': unknown kind (expected one of 3-rrr, arm"),
        (["fourbar"], "did you mean 'four-bar'?"),
        (["../arm"], "unknown kind"),
        ([""], "unknown kind"),
        (["arm", "delta"], "unrecognized arguments: delta"),
        (["arm", "--sheet"], "unrecognized arguments: --sheet"),
        (["--force"], "no KIND given"),
        (["arm", "-o"], "expected one argument"),
        (["arm", "-o", "missing/scene.toml"], "missing/scene.toml: cannot be written: there is no folder 'missing'"),
        (["arm", "-o", "."], ".: cannot be written: is a folder"),
        (["arm", "-o", ""], "'': cannot be written: No such"),
        (["arm", "-o", "x" * 300], "File name too long"),
    ],
)
def test_bad_words_are_refused_in_one_line(words, fragment, tmp_path):
    refused(command("new", *words, cwd=tmp_path), fragment)
    assert list(tmp_path.iterdir()) == []


def test_the_executable_alone_says_where_to_find_it(tmp_path):
    said = subprocess.run([executable(), "new", "arm"], capture_output=True, text=True, cwd=tmp_path, timeout=20)
    refused(said, "are in the Python package")


@pytest.mark.parametrize("kind", ["fourbar", "", 3, None])
def test_python_refuses_unknown_kinds(kind):
    with pytest.raises(linkdyn.InputError):
        linkdyn.new(kind)
