"""Exceptions. Messages from the engine are passed on as they are."""

from __future__ import annotations

__all__ = ["LinkdynError", "SceneError", "InputError", "FileError", "UnavailableError", "ClosedSceneError"]


class LinkdynError(Exception):
    """Base of all linkdyn exceptions."""


class SceneError(LinkdynError, ValueError):
    """A scene that is wrong or cannot be computed; the message says file, line, what and what was expected."""


class InputError(LinkdynError, ValueError):
    """An argument that is wrong: shape, dtype, NaN, unknown name."""


class FileError(LinkdynError, OSError):
    """A file that cannot be read or written."""


class UnavailableError(LinkdynError):
    """Built without the library that this needs."""


class ClosedSceneError(LinkdynError):
    """The scene was closed."""
