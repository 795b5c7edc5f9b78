"""XML of strangers: no document types, no entities, bounded, with the line of each element."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

from ..errors import FileError, InputError, MissingFileError

__all__ = ["XmlFile"]

LARGEST = 16 * 1024 * 1024
DEEPEST = 256
MOST = 200_000
"""Bytes, elements within each other, and elements in all, of a file that is read."""


class XmlFile:
    """A file that was parsed.

    Attributes
    ----------
    root : xml.etree.ElementTree.Element
    path : pathlib.Path
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lines: dict[ElementTree.Element, int] = {}
        self._builder, self._depth = ElementTree.TreeBuilder(), 0
        self._parser = parser = expat.ParserCreate()
        parser.StartElementHandler, parser.EndElementHandler = self._begin, self._end
        parser.CharacterDataHandler = self._builder.data
        parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = self._refuse_type
        try:
            if path.stat().st_size > LARGEST:
                raise InputError(f"{path}: it has more than {LARGEST // 2**20} MiB (expected the XML of a robot)")
            parser.Parse(path.read_bytes(), True)
        except expat.ExpatError as error:
            raise InputError(f"{path}:{error.lineno}: {expat.ErrorString(error.code)} (expected XML)") from None
        except FileNotFoundError:
            raise MissingFileError(f"{path}: there is no such file") from None
        except (OSError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise FileError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
        self.root = self._builder.close()

    def place(self, element: ElementTree.Element) -> str:
        """ "FILE:LINE". """
        return f"{self.path}:{self._lines.get(element, 1)}"

    def refuse(self, element: ElementTree.Element, problem: str) -> InputError:
        """What is to be raised about an element."""
        name = element.get("name")
        return InputError(f"{self.place(element)}: {element.tag}{f' {name[:60]!r}' if name else ''}: {problem}")

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        if self._depth > DEEPEST or len(self._lines) >= MOST:
            raise InputError(f"{self.path}:{self._parser.CurrentLineNumber}: more than {DEEPEST} elements within each other, or {MOST} in all")
        self._lines[self._builder.start(tag, attributes)] = self._parser.CurrentLineNumber

    def _end(self, tag: str) -> None:
        self._depth -= 1
        self._builder.end(tag)

    def _refuse_type(self, *_: Any) -> None:
        raise InputError(f"{self.path}:{self._parser.CurrentLineNumber}: a document type or entity, which is not read (expected elements alone)")
