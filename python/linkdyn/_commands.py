"""What the commands of the package have in common: their options are read, and what is wrong refused, alike."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import NoReturn

__all__ = ["BAD_INPUT", "SOME_FAILED", "Parser", "refuse", "write_whole"]

BAD_INPUT, SOME_FAILED = 2, 3
"""Exit statuses, as the executable has them."""


class Parser(argparse.ArgumentParser):
    """Of ``linkdyn NAME``, with an option for help of its own."""

    def __init__(self, name: str, arguments: str, description: str) -> None:
        self._name = name
        super().__init__(prog=f"linkdyn {name}", description=description, add_help=False, allow_abbrev=False,
                         usage=f"linkdyn {name} {arguments} [options]", formatter_class=argparse.RawDescriptionHelpFormatter)

    def add_last(self) -> None:
        """The options that every command has at its end."""
        self.add_argument("-q", "--quiet", action="store_true", help="do not say what was written")
        self.add_argument("-h", "--help", action="help", help="this text")

    def error(self, message: str) -> NoReturn:
        """One line, as the executable has it."""
        sys.exit(refuse(f"{self._name}: {message} (linkdyn {self._name} --help lists the options)"))


def refuse(message: str) -> int:
    """Say on one line what is wrong; the exit status."""
    print(f"linkdyn: {' '.join(message.split())}", file=sys.stderr)
    return BAD_INPUT


def write_whole(target: Path, text: str, replaces: bool) -> None:
    """The whole file or none: written beside it, then given its name, which must be free unless it may be replaced."""
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        part.write_text(text, encoding="utf-8")
        if replaces:
            part.replace(target)
        else:
            os.link(part, target)
    finally:
        part.unlink(missing_ok=True)
