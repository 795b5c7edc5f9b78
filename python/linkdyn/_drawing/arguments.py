"""Arguments of what draws: each is called the same everywhere, and checked by its name before anything is drawn."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from .._arguments import as_count, as_flag, as_floats, as_mapping, as_number, as_path, as_positive
from ..errors import InputError
from ..results import need_samples
from ..scene import Scene

__all__ = ["checked"]

Function = TypeVar("Function", bound=Callable[..., Any])


def checked(function: Function) -> Function:
    """Check the arguments of a function by their names; None passes where it is the default.

    Raises
    ------
    InputError
        "function: argument: what was expected, what was given".
    """
    signature = inspect.signature(function)

    @functools.wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        try:
            bound = signature.bind(*arguments, **named)
        except TypeError as error:
            raise TypeError(f"{function.__name__}: {error}") from None
        for name, value in bound.arguments.items():
            if value is not None or signature.parameters[name].default is not None:
                bound.arguments[name] = _KINDS[name](f"{function.__name__}: {name}", value)
        return function(*bound.args, **bound.kwargs)

    return call  # type: ignore[return-value]


def _as_run(name: str, value: Any) -> xr.Dataset:
    if not isinstance(value, xr.Dataset):
        raise InputError(f"{name}: these are no results of a sweep or of a run (expected an xarray.Dataset, got {type(value).__name__})")
    if "status" in value:
        need_samples(value, name)
    return value


def _as_scene(name: str, value: Any) -> Scene:
    if not isinstance(value, Scene):
        raise InputError(f"{name}: expected a Scene, got {type(value).__name__}")
    return value


def _as_source(name: str, value: Any) -> xr.Dataset | Scene:
    if not isinstance(value, (xr.Dataset, Scene)):
        raise InputError(f"{name}: expected the results of a run or a Scene, got {type(value).__name__}")
    return value


def _as_name(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise InputError(f"{name}: expected a name, got {type(value).__name__}")
    return str(value)


def _as_names(name: str, value: Any) -> str | tuple[str, ...]:
    """One name, or several."""
    if isinstance(value, (list, tuple, set, np.ndarray)) and np.ndim(list(map(str, value))) == 1:
        return tuple(_as_name(name, item) for item in value)
    return _as_name(name, value)


def _as_list(name: str, value: Any) -> tuple[str, ...]:
    """One name or several, as a tuple."""
    names = _as_names(name, value)
    return (names,) if isinstance(names, str) else names


def _as_files(name: str, value: Any) -> dict[str, str]:
    """Names of links and files."""
    return {_as_name(name, key): as_path(f"{name}[{key!r}]", file) for key, file in as_mapping(name, value).items()}


def _as_places(name: str, value: Any) -> dict[str, float]:
    """Axes and the values at which to look."""
    return {_as_name(name, key): as_number(f"{name}[{key!r}]", number) for key, number in as_mapping(name, value).items()}


def _as_index(name: str, value: Any) -> int:
    return as_count(name, value, 0)


def _as_curve(name: str, value: Any) -> np.ndarray:
    """Points (N, 2) of a limit."""
    return as_floats(name, value, (None, 2), "(N, 2)")


def _as_coordinates(name: str, value: Any) -> Any:
    """Checked by what knows the scene, and with it how many there are."""
    return value


def _as_axes(name: str, value: Any) -> Any:
    if not hasattr(value, "add_artist"):  # matplotlib takes its time to load
        raise InputError(f"{name}: expected matplotlib's Axes, got {type(value).__name__}")
    return value


_KINDS: dict[str, Callable[[str, Any], Any]] = {
    "run": _as_run,
    "result": _as_run,
    "source": _as_source,
    "scene": _as_scene,
    "file": as_path,
    "q": _as_coordinates,
    "ax": _as_axes,
    "quantity": _as_name,
    "components": _as_name,
    "coordinate": _as_name,
    "over": _as_name,
    "kind": _as_name,
    "cost": _as_name,
    "gain": _as_name,
    "joints": _as_names,
    "axes": _as_names,
    "at": _as_names,
    "forces": _as_names,
    "plots": _as_list,
    "traces": _as_list,
    "meshes": _as_files,
    "mesh_unit": as_positive,
    "where": _as_places,
    "design": _as_index,
    "frames": as_count,
    "fps": as_positive,
    "names": as_flag,
    "stacked": as_flag,
    "motor": _as_curve,
    "limit": _as_curve,
    "continuous": _as_curve,
    "lead": as_number,
    "ratio": as_number,
    "efficiency": as_number,
}
"""What an argument of a name is taken for."""
