"""The fuzzer's first cases; `make check` takes two thousand of them, `make fuzz` a hundred thousand."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

import fuzz_cases  # noqa: E402
import jail  # noqa: E402
from fuzz_cases import Report  # noqa: E402
from fuzz import search_part  # noqa: E402

CASES = int(os.environ.get("LINKDYN_FUZZ_CASES", "200"))
PART = 100


@pytest.mark.parametrize("first", range(0, CASES, PART))
def test_no_case_is_a_finding(first: int) -> None:
    report: Report = search_part(range(first, min(first + PART, CASES)))
    assert len(report.findings) == 0, "\n".join(["", *map(str, report.findings[:10])])
    assert report.answered > report.calls / 4      # refusing everything would find nothing


@pytest.mark.parametrize(("says", "is_finding"), [("load", True), ("poses(q=2)", True), ("forward", False), ("sweep(sweep={})", False)])
def test_work_without_end_is_a_finding(says: str, is_finding: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """But of a run or a sweep, which may be long: these have to hear the interrupt."""

    def forever() -> None:
        while True:
            pass

    def case(dice: object, how: list[str]) -> jail.Outcome:
        return jail.call(lambda: fuzz_cases.Calls(how)(says, forever))

    monkeypatch.setattr(jail, "ENOUGH", 0.2)
    for name in ("scene_case", "motion_case", "argument_case", "command_case", "lecture_case"):
        monkeypatch.setattr(fuzz_cases, name, case)
    found = [finding.what for finding in fuzz_cases.run_case(0).findings]
    assert found == ([f"at work for too long: {says}"] if is_finding else [])
