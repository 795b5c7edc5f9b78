"""Arguments as the engine takes them, or an `InputError` that names the argument and says what was expected."""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError

__all__ = [
    "as_count", "as_finite", "as_flag", "as_floats", "as_known", "as_mapping", "as_name", "as_names", "as_number", "as_path", "as_positive", "as_real",
    "dimensions", "quoted",
]  # fmt: skip

LONGEST = 60
"""Characters of a wrong value that a message quotes."""
LONGEST_NAME = 200
"""Characters of one of the engine's own names, or of several in one text."""
FLOATS = np.dtype(np.float64)
MOST = int(np.iinfo(np.intc).max)
"""The largest of the engine's integers."""


def quoted(value: Any) -> str:
    """A value as a message shows it: on one line, of bounded length."""
    try:
        text = " ".join(ascii(value).split())
    except Exception:  # noqa: BLE001 (whatever goes wrong in a stranger's repr)
        return f"a {type(value).__name__}"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def quoted_name(name: str) -> str:
    """A name or path as a message shows it: of one longer than any is, its beginning."""
    return repr(name if len(name) <= LONGEST_NAME else f"{name[:LONGEST]}...")


def dimensions(name: str, values: ArrayLike, says: str) -> int:
    """Number of dimensions of what should be an array of a shape."""
    try:
        return np.ndim(values)
    except ValueError:
        raise InputError(f"{name}: expected an array of numbers of shape {says}, got rows of unequal length") from None


def as_floats(name: str, values: ArrayLike, shape: tuple[int | None, ...], says: str = "") -> NDArray[np.float64]:
    """Values as a C-ordered float64 array; no copy if they are one already.

    Parameters
    ----------
    name
        Argument's name, for the message.
    values
        Numbers: int or float, nothing else.
    shape
        Expected shape; None stands for any length.
    says
        What is expected, in words, where it is more than this shape: "(N, 6) or (6,)".

    Raises
    ------
    InputError
        Complex, bool, object or text values; a wrong shape.
    """
    if type(values) is np.ndarray and values.dtype is FLOATS and values.flags.c_contiguous and _fits(values.shape, shape):
        return values  # as nearly always
    if np.ma.is_masked(values):
        raise InputError(f"{name}: some of its values are masked (expected numbers)")
    try:
        array = np.asarray(values)
    except ValueError:
        says = says or _shape_text(shape)
        raise InputError(f"{name}: expected an array of numbers of shape {says}, got rows of unequal length") from None
    if array.dtype != FLOATS and (array.dtype.kind not in "fiu" or array.dtype.itemsize > FLOATS.itemsize):
        raise InputError(f"{name}: expected real numbers (float64), got dtype {array.dtype}")
    if not _fits(array.shape, shape):
        raise InputError(f"{name}: expected shape {says or _shape_text(shape)}, got {_shape_text(array.shape)}{_forgotten_axis(name, array.shape, shape)}")
    return np.ascontiguousarray(array, dtype=FLOATS)


def by_labels(name: str, values: Any, labels: Sequence[str]) -> Any:
    """Labelled values, of xarray or pandas, in the order of the labels given and with these last; anything else as it is.

    Raises
    ------
    InputError
        Other labels.
    """
    if type(values) is np.ndarray:
        return values  # as nearly always
    if hasattr(values, "dims") and hasattr(values, "coords"):
        for axis in values.dims:
            if axis in values.coords and values.coords[axis].dtype.kind in "OUS":
                _same_labels(name, list(map(str, values.coords[axis].values)), labels)
                return values.sel({axis: list(labels)}).transpose(..., axis).values
        return values.values
    columns = getattr(values, "columns", None)
    if columns is not None and all(isinstance(column, str) for column in columns):
        _same_labels(name, list(columns), labels)
        return values[list(labels)].to_numpy()
    return values


def _same_labels(name: str, found: list[str], labels: Sequence[str]) -> None:
    if sorted(found) != sorted(labels):
        raise InputError(f"{name}: its labels are {', '.join(found) or 'none'} (expected {', '.join(labels)}, in any order, or an array without labels)")


def as_finite(name: str, values: ArrayLike, shape: tuple[int | None, ...], says: str = "") -> NDArray[np.float64]:
    """The same of finite numbers: the message names the first that is none."""
    array = as_floats(name, values, shape, says)
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        raise InputError(f"{name}[{', '.join(map(str, bad[0]))}] is not a finite number")
    return array


def _fits(shape: tuple[int, ...], expected: tuple[int | None, ...]) -> bool:
    if shape == expected:
        return True
    if len(shape) != len(expected):
        return False
    for n, wanted in zip(shape, expected):
        if wanted is not None and n != wanted:
            return False
    return True


def _forgotten_axis(name: str, shape: tuple[int, ...], expected: tuple[int | None, ...]) -> str:
    """The end of a message to who left out that samples stand in rows."""
    if len(shape) != 1 or len(expected) != 2 or expected[0] is not None:
        return ""
    if expected[1] == 1:
        return f"; {name}[:, None] has a sample in each row"
    return f"; {name}[None] is one sample" if shape[0] == expected[1] else ""


def _shape_text(shape: tuple[int | None, ...]) -> str:
    lengths = ("N" if n is None else str(n) for n in shape)
    return f"({', '.join(lengths)}{',' if len(shape) == 1 else ''})"


def as_real(name: str, value: Any) -> float:
    """One real number; whether it is finite and of the right sign, the engine says."""
    array = np.asarray(value) if isinstance(value, (int, float, np.number, np.ndarray)) else None
    if array is None or array.ndim != 0 or array.dtype.kind not in "fiu":
        raise InputError(f"{name}: expected a number, got {quoted(value)}")
    return float(array)


def as_number(name: str, value: Any) -> float:
    """One finite real number."""
    number = as_real(name, value)
    if not math.isfinite(number):
        raise InputError(f"{name}: expected a finite number, got {number}")
    return number


def as_count(name: str, value: Any, first: int = 1) -> int:
    """A whole number from the first on; the largest that the engine's integers hold is taken for anything above."""
    if type(value) is int and first <= value <= MOST:
        return value  # as nearly always
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < first:
        raise InputError(f"{name}: expected a whole number from {first} on, got {quoted(value)}")
    return min(int(value), MOST)


def as_flag(name: str, value: Any) -> bool:
    """True or False; 0 and 1 will do."""
    if isinstance(value, (bool, np.bool_, int, np.integer)) and value in (0, 1):
        return bool(value)
    raise InputError(f"{name}: expected True or False, got {quoted(value)}")


def as_name(name: str, value: Any) -> str:
    """A name of the engine's own, such as a solver's."""
    if not isinstance(value, str) or not value.isascii() or not value.isprintable() or len(value) > LONGEST_NAME:
        raise InputError(f"{name}: expected a name, got {quoted(value)}")
    return value


def as_names(name: str, value: Any) -> str:
    """One name or several, with commas between; None: none."""
    if value is None or isinstance(value, str):
        return as_name(name, value or "")
    try:
        items = list(value)
    except TypeError:
        raise InputError(f"{name}: expected a name or several, got {quoted(value)}") from None
    return ",".join(as_name(name, item) for item in items)


def as_mapping(name: str, value: Any, says: str = "a dict with names as keys") -> Mapping[str, Any]:
    """A mapping from names."""
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise InputError(f"{name}: expected {says}, got {quoted(value)}")
    return value


def as_path(name: str, value: Any) -> str:
    """A path as text."""
    path = os.fspath(value) if isinstance(value, (str, os.PathLike)) else None
    if not isinstance(path, str) or not path or "\0" in path:
        raise InputError(f"{name}: expected a path, got {quoted(value)}")
    return path


def as_known(name: str, value: Any, known: Iterable[str], what: str) -> str:
    """One of the names of what there is; the message tells them, and the one that looks like what was given."""
    names = list(dict.fromkeys(known))
    if isinstance(value, str) and value in names:
        return value
    listed = ", ".join(names) or "none"
    near = difflib.get_close_matches(value, names, n=1) if isinstance(value, str) else []
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise InputError(f"{name}: {quoted(value)}: unknown {what} (expected one of {listed}){hint}")


def as_positive(name: str, value: Any) -> float:
    """One finite number above zero."""
    number = as_number(name, value)
    if number <= 0:
        raise InputError(f"{name}: expected a number above zero, got {number:g}")
    return number
