"""Generated code: what ``Scene.generate`` gives."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from ._arguments import as_path
from ._output import Inputs, refuse_inputs, write_output

__all__ = ["GeneratedCode"]


@dataclass(frozen=True)
class GeneratedCode:
    """A kernel of a scene in C99."""

    name: str
    """Of the files, without ending; identifiers begin with it."""
    header: str = field(repr=False)
    source: str = field(repr=False)
    _inputs: Inputs = field(default=(), repr=False)

    def write(self, folder: str | os.PathLike[str] = ".") -> tuple[Path, Path]:
        """Write both files.

        Parameters
        ----------
        folder
            Where to; default: the current folder.

        Returns
        -------
        tuple of Path
            Header and source.

        Raises
        ------
        FileError
            A file cannot be written, or is one that the scene was read from.
        """
        place = Path(as_path("folder", folder))
        files = place / f"{self.name}.h", place / f"{self.name}.c"
        for path in files:
            refuse_inputs(path, self._inputs)
        for path, text in zip(files, (self.header, self.source), strict=True):
            write_output(path, text)
        return files
