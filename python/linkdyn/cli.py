"""The command ``linkdyn``: hands over to the executable inside the package."""

from __future__ import annotations

import os
import sys
from importlib.resources import files
from pathlib import Path

__all__ = ["executable", "main", "quadruple_twin"]


def executable() -> Path:
    """Path of the executable.

    Raises
    ------
    FileNotFoundError
        The package was built without it.
    """
    path = Path(str(files("linkdyn").joinpath("_bin", "linkdyn")))
    if not path.is_file():
        raise FileNotFoundError(f"{path}: the executable is not in the package (expected a build with its app)")
    return path


def quadruple_twin() -> Path | None:
    """Path of ``linkdyn-real128``, the same program in quadruple precision; None if it is not built.

    Looked for in the environment variable ``LINKDYN_REAL128``, then beside the executable, where ``make real128``
    puts it.
    """
    if given := os.environ.get("LINKDYN_REAL128"):
        return Path(given)
    path = Path(str(files("linkdyn").joinpath("_bin", "linkdyn-real128")))
    return path if path.is_file() else None


def main() -> None:
    """Become the executable, with the same arguments."""
    try:
        path = executable()
    except FileNotFoundError as error:
        sys.exit(str(error))
    if twin := quadruple_twin():
        os.environ["LINKDYN_REAL128"] = os.fspath(twin)
    os.execv(path, ["linkdyn", *sys.argv[1:]])
