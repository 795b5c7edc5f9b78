"""Exceptions. Messages from the engine are passed on as they are."""

from __future__ import annotations

from typing import Any

__all__ = ["LinkdynError", "SceneError", "InputError", "FileError", "MissingFileError", "UnavailableError", "ClosedSceneError", "Interrupted"]


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
    """Built without the library that this needs."""


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
