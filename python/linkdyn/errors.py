"""Exceptions. Messages from the engine are passed on as they are."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from ._listing import only

__all__ = ["LinkdynError", "SceneError", "InputError", "FileError", "MissingFileError", "UnavailableError", "ClosedSceneError", "Interrupted"]
__dir__ = only(__all__)

LONGEST = 200
"""Characters of another package's message that one quotes."""


class LinkdynError(Exception):
    """Base of all linkdyn exceptions."""


class SceneError(LinkdynError, ValueError):
    """A scene that is wrong or cannot be computed; the message says file, line, what and what was expected."""


class InputError(LinkdynError, ValueError):
    """An argument that is wrong: shape, dtype, NaN, unknown name."""


class FileError(LinkdynError, OSError):
    """A file that cannot be read or written."""


class MissingFileError(FileError, FileNotFoundError):
    """There is no such file."""


class UnavailableError(LinkdynError):
    """Built without the library that this needs, or without a package of Python's."""

    @classmethod
    def of(cls, need: str, module: str, extra: str, error: ImportError) -> UnavailableError:
        """That a module is not installed; if it is, why it cannot be imported."""
        if isinstance(error, ModuleNotFoundError) and error.name == module or find_spec(module) is None:
            return cls(f"{need}, which is not installed (pip install 'linkdyn[{extra}]')")
        reason = " ".join(str(error).split())
        return cls(f"{need}, which is installed and cannot be imported: {reason[:LONGEST]}")


class ClosedSceneError(LinkdynError):
    """The scene was closed."""


class Interrupted(KeyboardInterrupt):
    """A forward run was interrupted (Ctrl-C); a `KeyboardInterrupt`, so that a program that does not catch it ends.

    Attributes
    ----------
    result : xarray.Dataset or None
        What was computed until then; None: nothing.
    """

    def __init__(self, message: str, result: Any) -> None:
        super().__init__(message)
        self.result = result
