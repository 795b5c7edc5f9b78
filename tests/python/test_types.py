"""The package keeps to its types, and the engine's module to its stub."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from linkdyn import lecture

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
from write_engine_stub import STUB, stub  # noqa: E402

pytestmark = pytest.mark.python_alone


@pytest.mark.thorough
def test_strict():
    done = subprocess.run([sys.executable, "-m", "mypy", "--strict"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


PROGRAM = """
import linkdyn

scene = linkdyn.load("scene.toml")
number: int = linkdyn.__version__
linkdyn.lod("scene.toml")
"""


@pytest.mark.thorough
def test_checkers_see_misspelt_names(tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM)
    done = subprocess.run([sys.executable, "-m", "mypy", "--strict", "--config-file", str(ROOT / "pyproject.toml"), "program.py"],
                          cwd=tmp_path, env=os.environ | {"MYPYPATH": str(ROOT / "python")}, capture_output=True, text=True, check=False)  # fmt: skip
    lines = [line for line in done.stdout.splitlines() if line.startswith("program.py:")]
    assert len(lines) == 2, done.stdout
    assert "program.py:5:" in lines[0] and '"str"' in lines[0]
    assert "program.py:6:" in lines[1] and '"lod"' in lines[1]


def test_stub_of_the_engine():
    """Run tools/write_engine_stub.py after a change of the flat interface."""
    assert STUB.read_text(encoding="utf-8") == stub()
    assert f"def api_{lecture.rrr_links.__name__}(" in stub()
