"""Arguments checked in our words: what is wrong in a call becomes an `InputError` that names the argument."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from .errors import InputError

__all__ = ["as_count", "as_mapping", "as_number", "as_path", "as_real", "as_word", "as_words"]


def as_real(name: str, value: Any) -> float:
    """One real number, which the engine may find fault with.

    Raises
    ------
    InputError
        Anything else, such as a text or an array of several.
    """
    try:
        array = np.asarray(value)
    except ValueError:  # rows of unequal length
        array = np.empty(2)
    if array.size != 1 or array.dtype.kind not in "fiu":
        raise InputError(f"{name}: expected a number, got {_shown(value)}")
    return float(array.reshape(())[()])


def as_number(name: str, value: Any) -> float:
    """One finite real number."""
    number = as_real(name, value)
    if not math.isfinite(number):
        raise InputError(f"{name}: expected a finite number, got {number}")
    return number


def as_count(name: str, value: Any) -> int:
    """A whole number from 1 on, as large as it may be: the engine's own limit is taken for anything above."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise InputError(f"{name}: expected a whole number from 1 on, got {_shown(value)}")
    return min(int(value), np.iinfo(np.intc).max)


def as_word(name: str, value: Any) -> str:
    """A text of plain letters, such as the name of a method."""
    if not isinstance(value, str) or not value.isascii() or "\0" in value:
        raise InputError(f"{name}: expected a name, got {_shown(value)}")
    return str(value)


def as_words(name: str, value: str | Iterable[str] | None) -> str:
    """Some words, with commas between; none is empty."""
    if value is None or isinstance(value, str):
        return as_word(name, value or "")
    if not isinstance(value, Iterable):
        raise InputError(f"{name}: expected a name or several, got {_shown(value)}")
    return ",".join(as_word(name, word) for word in value)


def as_mapping(name: str, value: Any) -> Mapping[Any, Any]:
    """A dict, or something like it."""
    if not isinstance(value, Mapping):
        raise InputError(f"{name}: expected a dict, got {_shown(value)}")
    return value


def as_path(name: str, value: Any) -> str:
    """The name of a file or folder."""
    if not isinstance(value, (str, os.PathLike)) or "\0" in (path := os.fsdecode(value)):
        raise InputError(f"{name}: expected a path, got {_shown(value)}")
    return path


def _shown(value: Any) -> str:
    """A value in a message: its type where it would be long."""
    text = repr(value)
    return text if len(text) <= 40 and "\n" not in text else f"a {type(value).__name__}"
