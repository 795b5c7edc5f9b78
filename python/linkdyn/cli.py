"""The command ``linkdyn``: hands over to the executable inside the package."""

from __future__ import annotations

import os
import sys
from importlib.resources import files
from pathlib import Path

__all__ = ["executable", "main"]


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


def main() -> None:
    """Become the executable, with the same arguments."""
    try:
        path = executable()
    except FileNotFoundError as error:
        sys.exit(str(error))
    os.execv(path, ["linkdyn", *sys.argv[1:]])
