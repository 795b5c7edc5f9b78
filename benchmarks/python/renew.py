"""Put the tables and pictures that benchmarks have left under results/benchmarks where they are committed.

Usage: renew.py [NAME ...]    (default: all that lie there)

A table NAME.md goes between `<!-- NAME -->` and `<!-- /NAME -->` of the documents below, a picture NAME.png where one of
them shows it. What was not measured stays as it is; what no document shows is said.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

from report import FOLDER, ROOT

DOCUMENTS = (ROOT / "benchmarks" / "README.md", ROOT / "docs" / "accuracy.md")
PICTURE = re.compile(r"!\[[^]]*\]\(([^)]+\.png)\)")


def renew(results: Path, document: Path, names: set[str]) -> set[str]:
    """Renew one document and its pictures; the names of those that it shows."""
    shown = set()
    text = document.read_text()
    for table in sorted(results.glob("*.md")):
        begin, end = f"<!-- {table.stem} -->\n", f"<!-- /{table.stem} -->"
        before, found, rest = text.partition(begin)
        _, closed, after = rest.partition(end)
        if table.stem in names and found and closed:
            text = before + begin + table.read_text() + end + after
            shown.add(table.stem)
    document.write_text(text)
    for link in PICTURE.findall(text):
        picture = results / Path(link).name
        if picture.stem in names and picture.exists():
            (document.parent / link).parent.mkdir(exist_ok=True)
            shutil.copyfile(picture, document.parent / link)
            shown.add(picture.stem)
    return shown


def main(*wanted: str) -> None:
    """All documents."""
    there = {file.stem for file in FOLDER.glob("*") if file.suffix in (".md", ".png")}
    if unknown := set(wanted) - there:
        sys.exit(f"renew.py: not under {FOLDER}: {', '.join(sorted(unknown))} (make bench, bench-forward, accuracy)")
    names = set(wanted) or there
    shown = set().union(*(renew(FOLDER, document, names) for document in DOCUMENTS))
    print("renewed:", ", ".join(sorted(shown)) or "nothing")
    if names - shown:
        print("shown by no document:", ", ".join(sorted(names - shown)))


if __name__ == "__main__":
    main(*sys.argv[1:])
