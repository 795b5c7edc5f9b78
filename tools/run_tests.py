"""Run the Fortran suites and pytest, and count both together.

Usage: run_tests.py BUILD_FOLDER [PYTEST_ARGUMENT...]

The last line is `N passed, N failed`, also left in build/test-summary.txt; exit status 1 if
anything failed.
"""

import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CLOSING_LINE = re.compile(r"^(\d+) passed, (\d+) failed$", re.M)


def run_fortran(build: Path) -> tuple[int, int]:
    """Passed and failed tests of all suites; a suite that died counts as one failure."""
    log = build / "meson-logs" / "testlog.json"
    log.unlink(missing_ok=True)
    code = subprocess.run(["meson", "test", "-C", str(build), "--print-errorlogs", "--suite", "fortran"],
                          check=False).returncode
    passed = failed = 0
    for line in log.read_text(encoding="utf-8").splitlines() if log.exists() else []:
        suite = json.loads(line)
        counts = CLOSING_LINE.findall(suite.get("stdout", ""))
        n_passed, n_failed = map(int, counts[-1]) if counts else (0, 0)
        passed += n_passed
        failed += n_failed
        if suite["result"] != "OK" and n_failed == 0:
            failed += 1
    if code != 0 and failed == 0:    # did not even build
        failed = 1
    return passed, failed


def run_python(report: Path, arguments: list[str]) -> tuple[int, int]:
    """Passed and failed tests; a run that ended without a report counts as one failure."""
    report.unlink(missing_ok=True)
    code = subprocess.run([sys.executable, "-m", "pytest", f"--junitxml={report}", *arguments],
                          cwd=ROOT, check=False).returncode
    passed = failed = 0
    if report.exists():
        for suite in ElementTree.parse(report).getroot().iter("testsuite"):
            n_failed = int(suite.get("failures", 0)) + int(suite.get("errors", 0))
            failed += n_failed
            passed += int(suite.get("tests", 0)) - n_failed - int(suite.get("skipped", 0))
    if code != 0 and failed == 0:
        failed = 1
    return passed, failed


def main(build: str, *pytest_arguments: str) -> int:
    fortran = run_fortran(Path(build))
    python = run_python(Path(build).resolve() / "pytest.xml", list(pytest_arguments))
    passed, failed = fortran[0] + python[0], fortran[1] + python[1]
    closing = f"{passed} passed, {failed} failed"
    summary = ROOT / "build" / "test-summary.txt"
    summary.parent.mkdir(exist_ok=True)
    summary.write_text(closing + "\n", encoding="utf-8")
    print(f"Fortran: {fortran[0]} passed, {fortran[1]} failed; Python and command line: "
          f"{python[0]} passed, {python[1]} failed")
    print(closing, flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
