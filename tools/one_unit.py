"""Concatenate Fortran files into one translation unit, in the order of their dependencies.

Usage: one_unit.py OUTPUT FILE...

A compiler inlines across modules only within one file. Every part is preceded by a line marker,
so messages and the debugger name the file that was written by hand.
"""

import re
import sys
from pathlib import Path

DEFINES = re.compile(r"^\s*module\s+(?!procedure\b|subroutine\b|function\b)(\w+)\s*(?:!.*)?$", re.I | re.M)
SUBMODULE = re.compile(r"^\s*submodule\s*\(\s*(\w+)\s*(?::\s*(\w+)\s*)?\)\s*(\w+)", re.I | re.M)
USES = re.compile(r"^\s*use(?:\s*,\s*non_intrinsic)?\s*(?:::)?\s*(\w+)\b", re.I | re.M)


TYPE = re.compile(r"^\s*type\b(?!\s*\()[^!\n]*?(\w+)[ \t]*(?:![^\n]*)?$(.*?)^\s*end\s*type\b", re.I | re.M | re.S)
BOUND = re.compile(r"^\s*procedure\b[^!\n]*?::\s*([^!\n]*)", re.I | re.M)


def types_with_several_procedures(text: str) -> list[str]:
    """Types whose table of procedures has an order; gfortran chooses it anew in each file that defines the type."""
    return [name for name, body in TYPE.findall(text) if sum(len(names.split(",")) for names in BOUND.findall(body)) > 1]


def scan(text: str) -> tuple[set[str], set[str]]:
    """Names a source provides and names it needs; a submodule is called `ancestor:name`."""
    provides = {name.lower() for name in DEFINES.findall(text)}
    needs = {name.lower() for name in USES.findall(text)}
    for ancestor, parent, name in SUBMODULE.findall(text.lower()):
        provides.add(f"{ancestor}:{name}")
        needs.add(f"{ancestor}:{parent}" if parent else ancestor)
    return provides, needs - provides


def in_order(sources: dict[str, str]) -> list[str]:
    """Sort files so that each follows those it needs; otherwise keep the order given.

    Raises
    ------
    ValueError
        Two files define one module, or files need each other in a circle.
    """
    needs: dict[str, set[str]] = {}
    provider: dict[str, str] = {}
    for path, text in sources.items():
        provides, needs[path] = scan(text)
        for name in provides:
            if name in provider:
                raise ValueError(f"module {name} is defined by {provider[name]} and by {path}")
            provider[name] = path

    ordered: list[str] = []
    waiting = list(sources)
    while waiting:
        for path in waiting:
            if all(provider[name] in ordered for name in needs[path] if name in provider):
                break
        else:
            raise ValueError("modules need each other in a circle: " + ", ".join(waiting))
        ordered.append(path)
        waiting.remove(path)
    return ordered


def main(output: str, *paths: str) -> None:
    sources = {path: Path(path).read_text(encoding="utf-8") for path in paths}
    for path, text in sources.items():
        if several := types_with_several_procedures(text):
            sys.exit(f"one_unit.py: {path}: type {several[0]} has several procedures, in another order than where the file is compiled alone")
    try:
        ordered = in_order(sources)
    except ValueError as error:
        sys.exit(f"one_unit.py: {error}")
    parts = [f'# 1 "{path}"\n{sources[path].rstrip()}\n' for path in ordered]
    Path(output).write_text("".join(parts), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
