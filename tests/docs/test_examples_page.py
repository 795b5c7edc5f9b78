"""examples/README.md lists every example, by its title and with a command of its page."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
ROWS = re.findall(r"^\| \[(\w+)\]\((\w+)\) \| (.+?) \| (.+?) \| `(.+?)` \|$", (EXAMPLES / "README.md").read_text(encoding="utf-8"), re.M)

pytestmark = pytest.mark.python_alone


def test_every_folder_is_listed_once():
    folders = sorted(path.parent.name for path in EXAMPLES.glob("*/README.md"))
    assert sorted(name for name, *_ in ROWS) == folders


@pytest.mark.parametrize(("name", "target", "machine", "teaches", "command"), ROWS, ids=[row[0] for row in ROWS])
def test_a_row_is_true_of_its_folder(name, target, machine, teaches, command):
    page = (EXAMPLES / name / "README.md").read_text(encoding="utf-8")
    assert target == name and teaches
    assert page.partition("\n")[0] == f"# {machine}"
    assert f"    {command}" in page
