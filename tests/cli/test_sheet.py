"""`linkdyn sweep --sheet`: the command of the Python package draws it, the bare executable says that it cannot."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import tomli_w

from linkdyn.cli import executable

pytestmark = pytest.mark.python_alone

COMMAND = [sys.executable, "-c", "from linkdyn.cli import main; main()", "sweep"]


def run(*arguments, **options) -> subprocess.CompletedProcess:
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=120, **options)


@pytest.fixture()
def scene(tsai, tmp_path) -> Path:
    tsai["sweep"] = {
        "reduce": ["driving_force", "driving_position"],
        "axis": [{"coordinate": "platform.x", "linspace": [-1.6, -1.4, 5]}],
    }
    file = tmp_path / "scene.toml"
    file.write_text(tomli_w.dumps(tsai))
    return file


def test_sheet_and_results(scene, tmp_path):
    done = run(scene, "--sheet", tmp_path / "out.html", "--threads", "1")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out.nc").exists()
    assert "<h2>Actuators</h2>" in (tmp_path / "out.html").read_text()
    assert done.stdout.splitlines()[-1].split() == ["sheet", str(tmp_path / "out.html")]


def test_quiet_pdf_and_named_results(scene, tmp_path):
    done = run("-q", f"--sheet={tmp_path / 'out.pdf'}", f"--output={tmp_path / 'other.nc'}", scene)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "out.pdf").read_bytes().startswith(b"%PDF") and (tmp_path / "other.nc").exists()


@pytest.mark.parametrize(
    ("target", "fragment"), [("out.doc", ".html or .pdf"), ("nowhere/out.html", "the folder is not there")]
)
def test_refused_before_the_run(target, fragment, scene, tmp_path):
    done = run(scene, "--sheet", tmp_path / target)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.count("\n") == 1 and fragment in done.stderr
    assert not list(tmp_path.glob("*.nc"))


def test_value_missing(scene):
    done = run(scene, "--sheet")
    assert done.returncode == 2 and done.stderr.count("\n") == 1


def test_a_failed_sweep_has_no_sheet(scene, tmp_path):
    done = run(scene, "--keep", "wind", "--sheet", tmp_path / "out.html")
    assert done.returncode == 2 and "wind" in done.stderr
    assert not (tmp_path / "out.html").exists()


def test_only_the_first_process_draws(scene, tmp_path, monkeypatch):
    monkeypatch.setenv("PMI_RANK", "1")
    assert run(scene, "-q", "--sheet", tmp_path / "out.html").returncode == 0
    assert not (tmp_path / "out.html").exists()


def test_the_bare_executable_says_so(scene, tmp_path):
    done = subprocess.run([executable(), "sweep", scene, "--sheet", "out.html"], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "--sheet" in done.stderr and "Python package" in done.stderr
    help_text = subprocess.run([executable(), "sweep", "--help"], capture_output=True, text=True).stdout
    assert "--sheet FILE" in help_text
