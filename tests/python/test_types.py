"""The package keeps to its types, and the engine's module to its stub."""

from __future__ import annotations

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


def test_stub_of_the_engine():
    """Run tools/write_engine_stub.py after a change of the flat interface."""
    assert STUB.read_text(encoding="utf-8") == stub()
    assert f"def api_{lecture.rrr_links.__name__}(" in stub()
