"""Scene files as people write them: a table a part, what is small on one line."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

import tomli_w

__all__ = ["as_toml"]

WIDTH = 130
"""Characters of a line, as far as its content can be parted."""
BARE = re.compile(r"[A-Za-z0-9_-]+")


def as_toml(content: Mapping[str, Any]) -> str:
    """Text of a scene.

    Parameters
    ----------
    content
        As ``tomllib`` reads it: values first, then tables and lists of tables in their order.
    """
    values = {key: value for key, value in content.items() if not _is_part(value)}
    blocks = [_lines(values)] if values else []
    for key, value in content.items():
        if isinstance(value, Mapping):
            blocks.append([f"[{_key(key)}]", *_lines(value)])
        elif _is_part(value):
            blocks += [[f"[[{_key(key)}]]", *_lines(entry)] for entry in value]
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def _is_part(value: Any) -> bool:
    """Has it a header of its own?"""
    return isinstance(value, Mapping) or (isinstance(value, Sequence) and not isinstance(value, str) and len(value) > 0 and isinstance(value[0], Mapping))


def _lines(table: Mapping[str, Any]) -> list[str]:
    """A line for each key; for each of its elements where that would be too long a line."""
    lines = []
    for key, value in table.items():
        line = f"{_key(key)} = {_inline(value)}"
        if len(line) > WIDTH and isinstance(value, Mapping):
            lines += [f"{_key(key)}.{inner}" for inner in _lines(value)]
        elif len(line) > WIDTH and isinstance(value, Sequence) and not isinstance(value, str):
            lines.append("\n".join([f"{_key(key)} = [", *(f"    {_inline(item)}," for item in value), "]"]))
        else:
            lines.append(line)
    return lines


def _inline(value: Any) -> str:
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(key)} = {_inline(item)}" for key, item in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Sequence):
        return f"[{', '.join(map(_inline, value))}]"
    return tomli_w.dumps({"x": value})[4:].rstrip("\n")


def _key(key: str) -> str:
    return key if BARE.fullmatch(key) else json.dumps(key, ensure_ascii=False)
