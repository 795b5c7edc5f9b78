"""What a wheel carries of others has its licence with it, as text."""

from __future__ import annotations

import re
from pathlib import Path

LICENCES = Path(__file__).resolve().parents[2] / "licenses"
TEXTS = {"GPL-3": "GNU GENERAL PUBLIC LICENSE", "LGPL-2.1": "GNU LESSER GENERAL PUBLIC LICENSE"}


def test_every_part_has_its_text() -> None:
    page = (LICENCES / "README.md").read_text(encoding="utf-8")
    rows = [row for row in re.findall(r"^\| (.*) \|$", page, re.M) if not row.startswith(("part", "---"))]
    for row in rows:
        *_, licence = row.split(" | ")
        assert "](" in licence or "viewer's own file" in licence, f"no text: {row}"
        for name in re.findall(r"\]\(([^)]+)\)", row):
            assert (LICENCES / name).is_file(), name
    for name, title in TEXTS.items():
        assert f"[{name}]({name}.txt)" in page
        assert title in (LICENCES / f"{name}.txt").read_text(encoding="utf-8")[:200]
