"""Where in a dict a line of the text stands that was written of it: users of a dict never see that text."""

from __future__ import annotations

import re
import tomllib
from typing import Any

from ._arguments import quoted

__all__ = ["told_by_keys"]

PLACE, OTHER = re.compile(r"\Ascene:(\d+): "), re.compile(r"\bon line (\d+)(?! of )")
HEADER, KEY = re.compile(r"\A(\[{1,2})(.+?)\]{1,2}\Z"), re.compile(r"""\A((?:"(?:[^"\\]|\\.)*"|[\w-]+)) = """)

ELEMENT = re.compile(r"\A {4}[^\s\]]")


def told_by_keys(message: str, text: str) -> str:
    """A message of the reader with places as they are in the dict, ``scene['link'][0]['mass']``, for lines.

    Parameters
    ----------
    message
        Begins with "scene:LINE: "; further on it may say "on line LINE".
    text
        What ``tomli_w`` wrote: each key on a line of its own that is not indented.
    """
    place = PLACE.match(message)
    if place is None:
        return message
    lines = text.splitlines()
    problem = OTHER.sub(lambda other: f"at {_place(lines[: int(other[1])])}", message[place.end() :])
    return f"{_place(lines[: int(place[1])])}: {problem}"


def _place(lines: list[str]) -> str:
    """What the last line says, as it is in the dict."""
    return "scene" + "".join(f"[{quoted(key)}]" for key in _keys_at(lines))


def _keys_at(lines: list[str]) -> list[Any]:
    """Keys and indices that lead to the last line."""
    count: dict[tuple[str, ...], int] = {}
    table: list[Any] = []
    key: list[Any] = []
    for line in lines:
        if header := HEADER.match(line):
            names = _names(header[2])
            if header[1] == "[[":
                count[names] = count.get(names, -1) + 1
                count = {path: n for path, n in count.items() if path == names or path[: len(names)] != names}
            table, key = _with_indices(names, count), []
        elif named := KEY.match(line):
            key = list(_names(named[1]))
        elif ELEMENT.match(line):  # of a list over several lines
            key = [*key[:1], key[1] + 1 if len(key) > 1 else 0]
    return table + key


def _names(dotted: str) -> tuple[str, ...]:
    """Names of a dotted key, with and without quotes."""
    names, inner = [], tomllib.loads(f"{dotted} = 0")
    while isinstance(inner, dict):
        ((name, inner),) = inner.items()
        names.append(name)
    return tuple(names)


def _with_indices(names: tuple[str, ...], count: dict[tuple[str, ...], int]) -> list[Any]:
    found: list[Any] = []
    for i, name in enumerate(names, start=1):
        found.append(name)
        if names[:i] in count:
            found.append(count[names[:i]])
    return found
