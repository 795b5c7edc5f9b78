"""What pages and comments name is there, and the script that checks it sees what is not."""

from __future__ import annotations

import importlib
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.python_alone


@pytest.fixture()
def check_docs(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "tools")
    return importlib.import_module("check_docs")


def test_pages_name_what_is_there(check_docs) -> None:
    if not (ROOT / ".git").exists():
        pytest.skip("no repository: git tells which files there are")
    assert check_docs.find_untrue(ROOT) == []


@pytest.mark.parametrize(
    ("line", "finding"),
    [
        ("[page](docs/nowhere.md)", "no file docs/nowhere.md"),
        ("[page](docs/other.md#no-such-head)", "no heading #no-such-head in docs/other.md"),
        ("`fortran/model/linkdyn_nothing.f90`", "no file fortran/model/linkdyn_nothing.f90"),
        ("`model/linkdyn_there.nothing`", "no file model/linkdyn_there.nothing"),
        ("`sweep_%s`" % "cursor", "no name sweep_%s" % "cursor"),
        ("`close_leg` of `linkdyn_other`", "no close_leg in fortran/model/linkdyn_other.f90"),
    ],
)
def test_a_false_claim_is_seen(check_docs, tmp_path: Path, line: str, finding: str) -> None:
    for path, text in {
        "README.md": f"{line}\n`close_leg` of `linkdyn_there`, [a head](docs/other.md#its-head), `model/linkdyn_there.close_leg`, `docs/other.md`\n",
        "docs/other.md": "## Its `head`\n",
        "fortran/model/linkdyn_there.f90": "subroutine close_leg",
        "fortran/model/linkdyn_other.f90": "subroutine other",
    }.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    assert check_docs.find_untrue(tmp_path) == [f"README.md:1: {finding}"]


def test_a_comment_that_names_nothing_is_seen(check_docs, tmp_path: Path) -> None:
    """Other comments that say the same name do not make it one of the code."""
    for path, text in {
        "fortran/model/linkdyn_leg.f90": "!> As `close_leg` does, see `close_%s`.\nsubroutine close_leg" % "other_leg",
        "python/linkdyn/legs.py": '"""Made by `close_%s`."""' % "other_leg",
    }.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    finding = "no name close_%s" % "other_leg"
    assert check_docs.find_untrue(tmp_path) == [f"fortran/model/linkdyn_leg.f90:1: {finding}", f"python/linkdyn/legs.py:1: {finding}"]
