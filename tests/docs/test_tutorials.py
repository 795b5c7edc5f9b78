"""The tutorials run, and what their words claim holds: each has cells, hidden on the site, that assert it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from pages import TUTORIALS, code_of, run_page  # noqa: E402


@pytest.mark.thorough
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_runs(page, tmp_path):
    done = run_page(page, tmp_path)
    assert done.returncode == 0, done.stderr
    written = {path.name for path in (tmp_path / "docs" / "tutorials").iterdir()} - {page.name, "__pycache__"}
    assert not written, "a page leaves files beside itself"


def test_what_is_claimed_is_asserted():
    assert len(TUTORIALS) == 6
    for page in TUTORIALS:
        code = code_of(page)
        assert "assert " in code and "linkdyn" in code, page.name
