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
]
__version__ = _version()


def __getattr__(name: str) -> Any:
    if name in ("lecture", "plot"):  # matplotlib takes its time to load: only who plots waits for it
        import importlib

        return importlib.import_module(f".{name}", __name__)
    if name == "sheet":
        from ._sheet import sheet

        return sheet
    if name == "view":
        from ._view import view

        return view
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
