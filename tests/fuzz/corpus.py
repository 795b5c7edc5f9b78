"""What the fuzzer starts from: the examples' scenes, and those of the tests, with their tables."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
LARGEST = 200_000
"""Bytes of a table that is worth damaging."""


@dataclass(frozen=True)
class Seed:
    """A scene as it stands in its folder."""

    name: str
    text: bytes
    tables: dict[str, bytes]

    def content(self) -> dict[str, Any]:
        """A fresh copy of its content."""
        return tomllib.loads(self.text.decode())


@cache
def seeds() -> tuple[Seed, ...]:
    """All of them, in an order that does not depend on the machine."""
    found = []
    for file in sorted((*ROOT.glob("examples/*/scene*.toml"), *ROOT.glob("benchmarks/scenes/*.toml"), *ROOT.glob("tests/scenes/*.toml"),
                        *ROOT.glob("tests/assemblies/*.toml"), *ROOT.glob("python/linkdyn/_scenes/*.toml"))):
        tables = {table.name: table.read_bytes() for table in sorted(file.parent.glob("*.csv")) if table.stat().st_size < LARGEST}
        text = file.read_bytes()
        try:
            used = {name: table for name, table in tables.items() if name.encode() in text}
            tomllib.loads(text.decode())
        except (tomllib.TOMLDecodeError, UnicodeDecodeError):
            continue
        found.append(Seed(file.relative_to(ROOT).as_posix(), text, used))
    return tuple(found)
