"""Code that pages show, run as their readers would."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TUTORIALS = sorted(path for path in (ROOT / "docs" / "tutorials").glob("*.md") if path.stem != "index")
CELL = re.compile(r"^```\{code-cell\}\n(.*?)^```", re.M | re.S)


def code_of(page: Path) -> str:
    """All cells of a page, in their order; blank lines elsewhere, so that a traceback tells the page's own line."""
    text = page.read_text(encoding="utf-8")
    lines = [""] * len(text.splitlines())
    for cell in CELL.finditer(text):
        first = text[: cell.start(1)].count("\n")
        for k, line in enumerate(cell[1].splitlines()):
            lines[first + k] = "" if re.match(r":\w+:", line) else line
    return "\n".join(lines) + "\n"


def run_page(page: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a page in a folder in which the examples lie where they lie beside the docs."""
    (folder / "examples").symlink_to(ROOT / "examples")
    here = folder / "docs" / "tutorials"
    here.mkdir(parents=True)
    (here / page.name).write_text(code_of(page), encoding="utf-8")
    return subprocess.run([sys.executable, page.name], cwd=here, capture_output=True, text=True, check=False)
