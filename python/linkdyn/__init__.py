"""Forces and motion of link mechanisms.

>>> import linkdyn
>>> scene = linkdyn.load("examples/stewart_drilling/scene.toml")
>>> run = scene.inverse()                                   # xarray.Dataset
>>> run.driving_force.sel(actuator="leg1.P").max()          # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._after_import import when_imported
from .errors import ClosedSceneError, FileError, InputError, Interrupted, LinkdynError, MissingFileError, SceneError, UnavailableError

if TYPE_CHECKING:
    from . import cycle, efforts, laws, lecture, plot, widget
    from ._bind import code_in_use, use_code
    from ._builder import Builder
    from ._code import GeneratedCode
    from ._commands.new import new
    from ._convert.convert import Conversion, convert
    from ._pose import Pose
    from ._sheets.sheet import sheet
    from ._view.page import view
    from .results import read
    from .scene import Poses, Scene, load
    from .simulator import Simulator, SimulatorState

    __version__: str

__all__ = [
    "Builder",
    "Conversion",
    "ClosedSceneError",
    "FileError",
    "GeneratedCode",
    "InputError",
    "Interrupted",
    "LinkdynError",
    "MissingFileError",
    "Pose",
    "Poses",
    "Scene",
    "SceneError",
    "Simulator",
    "SimulatorState",
    "UnavailableError",
    "code_in_use",
    "convert",
    "cycle",
    "efforts",
    "laws",
    "lecture",
    "load",
    "new",
    "plot",
    "read",
    "sheet",
    "use_code",
    "view",
    "widget",
]

_MODULES = ("cycle", "efforts", "laws", "lecture", "plot", "widget")
_HOMES = {
    "Builder": "_builder",
    "Conversion": "_convert.convert",
    "convert": "_convert.convert",
    "GeneratedCode": "_code",
    "Pose": "_pose",
    "Poses": "scene",
    "Scene": "scene",
    "Simulator": "simulator",
    "SimulatorState": "simulator",
    "load": "scene",
    "new": "_commands.new",
    "read": "results",
    "sheet": "_sheets.sheet",
    "code_in_use": "_bind",
    "use_code": "_bind",
    "view": "_view.page",
}
"""Numpy, xarray and matplotlib take their time to load: only who computes or plots waits for them."""


if not TYPE_CHECKING:  # who checks types must see misspelt names

    def __getattr__(name: str) -> Any:
        from importlib import import_module

        if name == "__version__":
            return import_module("._bind", __name__).version()
        if name in _HOMES:
            value = globals()[name] = getattr(import_module(f".{_HOMES[name]}", __name__), name)
            return value
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


def _let_runs_have_it() -> None:
    """Runs that are read by others have ``run.linkdyn`` too."""
    from . import _accessor as _accessor


when_imported("xarray", _let_runs_have_it)
