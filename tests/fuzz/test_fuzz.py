"""The fuzzer's first cases; `make check` takes two thousand of them, `make fuzz` a hundred thousand."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

from fuzz_cases import Report  # noqa: E402
from fuzz import search_part  # noqa: E402

CASES = int(os.environ.get("LINKDYN_FUZZ_CASES", "200"))
PART = 100


@pytest.mark.parametrize("first", range(0, CASES, PART))
def test_no_case_is_a_finding(first: int) -> None:
    report: Report = search_part(range(first, min(first + PART, CASES)))
    assert len(report.findings) == 0, "\n".join(["", *map(str, report.findings[:10])])
    assert report.answered > report.calls / 4      # refusing everything would find nothing
