"""Look for faults with many random cases.

Usage: fuzz.py [--cases N] [--first I] [--jobs J] [--messages FILE]

A case follows from its number: `fuzz.py --first I --cases 1` repeats it. Findings are printed and kept under results/fuzz;
exit status 1 if there are any.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import os
import re
import sys
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from fuzz_cases import Finding, Report, run_case  # noqa: E402
from corpus import ROOT  # noqa: E402


def search(first: int, n: int, jobs: int, each: int = 50) -> Report:
    """Cases from one number on, shared by some processes."""
    total = Report()
    parts = [range(i, min(i + each, first + n)) for i in range(first, first + n, each)]
    with concurrent.futures.ProcessPoolExecutor(jobs) as pool:
        for part in pool.map(search_part, parts):
            total += part
    return total


def search_part(numbers: range) -> Report:
    """Some cases one after the other."""
    total = Report()
    for number in numbers:
        total += run_case(number)
    return total


def kind_of(finding: Finding) -> str:
    """What a finding has in common with others of its kind."""
    return re.sub(r"'[^']*'|\([^)]*\)|[\d.]+(e[-+]?\d+)?", "_", finding.what)[:100]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--messages", type=Path, help="keep all messages in this file, one of each kind")
    given = parser.parse_args()
    report = search(given.first, given.cases, given.jobs)
    folder = ROOT / "results" / "fuzz"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "findings.txt").write_text("\n\n".join(map(str, report.findings)) + "\n")
    kinds = Counter(map(kind_of, report.findings))
    shown: set[str] = set()
    for finding in report.findings:
        if kind_of(finding) not in shown:
            shown.add(kind_of(finding))
            print(f"{finding}\n")
    if given.messages:
        kept = {re.sub(r"'[^']*'|[\d.]+(e[-+]?\d+)?", "_", message): message for message in report.messages}
        given.messages.write_text("\n".join(sorted(kept.values())) + "\n")
    print(f"{given.cases} cases, {report.calls} calls ({report.answered} answered): {len(report.findings)} findings of {len(kinds)} kinds"
          " (all in results/fuzz/findings.txt)")
    return 1 if report.findings else 0


if __name__ == "__main__":
    sys.exit(main())
