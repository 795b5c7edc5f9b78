"""What the pages of the examples show is what the reader gets: their `linkdyn inverse` and `linkdyn forward` are run, their lines looked for.

Pages show lines that stay: what an integrator took, how long that was and where the file lies depend on the machine, or on the next better step, and are left out.
"""
from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from test_readme import NUMBER

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted((ROOT / "examples").glob("*/README.md"))
COMMAND = re.compile(r"linkdyn (?:inverse|forward) [^#`]+")
QUOTED = re.compile(r"`((?:linkdyn|python|run\.py|\./)[^`]*)`")
ROOM = " " * 4
FLEETING = re.compile(r"^ *(integrator|steps|tolerance|coordinates|dense solver|computing time|results) ", re.M)
RELATIVE = 2e-5
"""Six digits are printed."""
ROUNDING = 1e-9
"""Numbers below are zero but for rounding, as parts of the largest beside them."""


def shown(page: Path) -> list[tuple[str, list[str]]]:
    """Commands of a page, each with the lines that follow it there: that of the last paragraph that names one, or the first of its list;
    lists that end otherwise are of programs, which have tests of their own."""
    text = page.read_text(encoding="utf-8")
    found, start = [], 0
    for block in re.finditer(r"^```\w*\n(.*?)^```", text, re.M | re.S):
        before, start = text[start : block.start()], block.end()
        named = [names for names in map(commands_in, before.split("\n\n")) if names] if block[0].startswith("```text") else []
        if named and (command := COMMAND.match(named[-1][0])) and not any(name.startswith(("linkdyn balance", "python")) for name in named[-1]):
            found.append((command[0].strip(), block[1].rstrip().splitlines()))
    return found


def commands_in(paragraph: str) -> list[str]:
    lines = paragraph.strip("\n").splitlines()
    return [line.strip() for line in lines] if lines and lines[0].startswith(ROOM) else QUOTED.findall(paragraph)


CASES = [pytest.param(page.parent, command, lines, id=f"{page.parent.name}-{k}") for page in PAGES for k, (command, lines) in enumerate(shown(page))]


def is_line(line: str, wanted: str) -> bool:
    """The same words, and numbers within the last printed digit or that are zero but for rounding."""
    if NUMBER.sub("#", line).split() != NUMBER.sub("#", wanted).split():
        return False
    pairs = [(float(a), float(b)) for a, b in zip(NUMBER.findall(line), NUMBER.findall(wanted))]
    largest = max((abs(b) for _, b in pairs), default=0.0)
    return all(abs(a - b) <= RELATIVE * abs(b) + ROUNDING * largest for a, b in pairs)


@pytest.mark.parametrize(("folder", "command", "lines"), CASES)
def test_page_shows_what_is_printed(folder: Path, command: str, lines: list[str], tmp_path: Path) -> None:
    words = [sys.executable, "-m", "linkdyn", *shlex.split(command)[1:], "--output", str(tmp_path / "run.nc")]
    if "--sheet" in words:
        del words[words.index("--sheet") : words.index("--sheet") + 2]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    printed = done.stdout.splitlines()
    place = 0
    for wanted in filter(str.strip, lines):
        after = next((k for k in range(place, len(printed)) if is_line(printed[k], wanted)), None)
        assert after is not None, f"not printed: {wanted!r}\n{done.stdout}"
        place = after + 1


def test_pages_are_looked_at() -> None:
    assert len(CASES) > 40


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.parent.name)
def test_pages_show_no_line_that_changes(page: Path) -> None:
    fleeting = [line for _, lines in shown(page) for line in lines if FLEETING.match(line)]
    assert fleeting == []
