"""Run the Fortran suites and pytest, and count both together.

Usage: run_tests.py BUILD_FOLDER [PYTEST_ARGUMENT...]

The last line is `N passed, N failed`, also left in build/test-summary.txt; exit status 1 if
anything failed. Tests that were skipped are listed with their reasons before it.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SUMMARY = ROOT / "build" / "test-summary.txt"
CLOSING_LINE = re.compile(r"^(\d+) passed, (\d+) failed$", re.M)


@dataclass
class Count:
    """What came of some tests."""

    passed: int = 0
    failed: int = 0
    skipped: list[str] = field(default_factory=list)
    """Name and reason."""

    def __add__(self, other: Count) -> Count:
        return Count(self.passed + other.passed, self.failed + other.failed, self.skipped + other.skipped)

    def __str__(self) -> str:
        return f"{self.passed} passed, {self.failed} failed"


def run_fortran(build: Path, precision: str = "real64", environment: dict[str, str] | None = None) -> Count:
    """All suites of one precision; a suite that died counts as one failure."""
    log = build / "meson-logs" / "testlog.json"
    log.unlink(missing_ok=True)
    command = ["meson", "test", "-C", str(build), "--print-errorlogs", "--suite", precision]
    code = subprocess.run(command, env=os.environ | (environment or {}), check=False).returncode
    count = Count()
    for line in log.read_text(encoding="utf-8").splitlines() if log.exists() else []:
        suite = json.loads(line)
        counts = CLOSING_LINE.findall(suite.get("stdout", ""))
        refused = suite["result"] == "EXPECTEDFAIL"    # a program that was to refuse: one test
        passed, failed = map(int, counts[-1]) if counts else (int(refused), 0)
        if suite["result"] != "OK" and not refused and failed == 0:
            failed = 1
        count += Count(passed, failed)
    if code != 0 and count.failed == 0:    # did not even build
        count.failed = 1
    return count


def described(build: Path) -> dict[str, str]:
    """What tests are told of a build: where it is, and what it promises.

    That is GSL if it was found, parts that were asked for by name, and the twin, which `make test` and `make check` build before.
    Where one of them is missing a test fails that would be skipped in a build without it.
    """
    told = build / "meson-info"
    found = {each["name"] for each in json.loads((told / "intro-dependencies.json").read_text(encoding="utf-8"))} & {"gsl"}
    options = json.loads((told / "intro-buildoptions.json").read_text(encoding="utf-8"))
    promises = {"twin"} | found | {each["name"] for each in options if each["value"] == "enabled"}
    return {"LINKDYN_BUILD": str(build.resolve()), "LINKDYN_PROMISES": " ".join(sorted(promises))}


def run_python(report: Path, arguments: list[str], environment: dict[str, str] | None = None) -> Count:
    """Tests of pytest on all processors; a run that ended without a report counts as one failure."""
    report.unlink(missing_ok=True)
    # neighbours in one process, which share what a module prepares; who is done takes over from the others
    spread = ["-n", str(os.cpu_count()), "--dist", "worksteal"]
    command = [sys.executable, "-m", "pytest", f"--junitxml={report}", *spread, *arguments]
    code = subprocess.run(command, cwd=ROOT, env=os.environ | (environment or {}), check=False).returncode
    count = Count()
    for case in ElementTree.parse(report).getroot().iter("testcase") if report.exists() else []:
        ends = {end.tag: end for end in case}
        if "failure" in ends or "error" in ends:
            count.failed += 1
        elif "skipped" in ends:
            count.skipped.append(f"{case.get('name')}: {ends['skipped'].get('message')}")
        else:
            count.passed += 1
    if code != 0 and count.failed == 0:
        count.failed = 1
    return count


def run_all(build: Path, arguments: list[str]) -> Count:
    """Both, with a line on each."""
    fortran = run_fortran(build)
    python = run_python(build.resolve() / "pytest.xml", arguments, described(build))
    print(f"Fortran: {fortran}; Python and command line: {python}")
    return fortran + python


def close(count: Count) -> int:
    """Say what was skipped and the count, keep the count, give the exit status."""
    for line in count.skipped:
        print(f"skipped: {line}")
    SUMMARY.parent.mkdir(exist_ok=True)
    SUMMARY.write_text(f"{count}\n", encoding="utf-8")
    print(count, flush=True)
    return 1 if count.failed else 0


if __name__ == "__main__":
    sys.exit(close(run_all(Path(sys.argv[1]), sys.argv[2:])))
