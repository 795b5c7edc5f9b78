"""Forces and motion of link mechanisms.

>>> import linkdyn
>>> scene = linkdyn.load("examples/stewart_drilling/scene.toml")
>>> run = scene.inverse()                                   # xarray.Dataset
>>> run.driving_force.sel(actuator="leg1.P").max()          # doctest: +SKIP
"""

from __future__ import annotations

from typing import Any

from ._bind import version as _version
from .errors import ClosedSceneError, FileError, InputError, Interrupted, LinkdynError, SceneError, UnavailableError
from .scene import Poses, Scene, load

__all__ = [
    "ClosedSceneError",
    "FileError",
    "InputError",
    "Interrupted",
    "LinkdynError",
    "Poses",
    "Scene",
    "SceneError",
    "UnavailableError",
    "lecture",
    "load",
    "plot",
    "sheet",
    "view",
    "widget",
]
__version__ = _version()

_MODULES = ("lecture", "plot", "widget")
_FUNCTIONS = {"sheet": "_sheet", "view": "_view"}
"""What takes its time to load waits until somebody asks for it."""


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name in _FUNCTIONS:
        return getattr(import_module(f".{_FUNCTIONS[name]}", __name__), name)
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return import_module(f".{name}", __name__)
    except ModuleNotFoundError as error:
        if error.name != "anywidget":
            raise
        raise UnavailableError("linkdyn.widget needs anywidget, which is not installed (pip install 'linkdyn[widget]')") from error


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
