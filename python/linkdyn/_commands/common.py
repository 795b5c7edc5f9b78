"""What the commands of the package have in common: their options are read, and what is wrong refused, alike."""

from __future__ import annotations

import argparse
import os
import sys
import textwrap
from typing import NoReturn

from .._printable import printable

__all__ = ["BAD_INPUT", "SOME_FAILED", "Parser", "draw_into_files", "emit", "refuse", "say", "say_beside"]

BAD_INPUT, SOME_FAILED = 2, 3
"""Exit statuses, as the executable has them."""


class _Filled(argparse.HelpFormatter):
    """Lines as wide as the terminal; names with hyphens stay whole."""

    def _split_lines(self, text: str, width: int) -> list[str]:
        return textwrap.wrap(" ".join(text.split()), width, break_on_hyphens=False)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "\n".join(indent + line for line in self._split_lines(text, width - len(indent)))


class Parser(argparse.ArgumentParser):
    """Of ``linkdyn NAME``, with an option for help of its own."""

    def __init__(self, name: str, arguments: str, description: str) -> None:
        self._name = name
        super().__init__(prog=f"linkdyn {name}", description=description, add_help=False, allow_abbrev=False,
                         usage=f"linkdyn {name} {arguments} [options]", formatter_class=_Filled)

    def add_last(self) -> None:
        """The options that every command has at its end."""
        self.add_argument("-q", "--quiet", action="store_true", help="do not say what was written")
        self.add_argument("-h", "--help", action="help", help="this text")

    def error(self, message: str) -> NoReturn:
        """One line, as the executable has it."""
        sys.exit(refuse(f"{self._name}: {message} (linkdyn {self._name} --help lists the options)"))


def refuse(message: str) -> int:
    """Say on one line what is wrong; the exit status."""
    print(f"linkdyn: {printable(' '.join(message.split()))}", file=sys.stderr)
    return BAD_INPUT


def say(text: str) -> None:
    """Lines on standard output, whatever stands in names and titles."""
    emit(printable(text, has_lines=True) + "\n")


def say_beside(text: str) -> None:
    """The same on standard error: beside a file that goes to standard output."""
    print(printable(text, has_lines=True), file=sys.stderr)


def emit(text: str) -> None:
    """Text on standard output as it is; the command ends at once where that does not take it."""
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())    # at its end Python would try once more
        sys.exit(refuse(f"standard output: cannot be written: {error.strerror}"))


def draw_into_files() -> None:
    """No windows; and letters that the font lacks become boxes without a word: the warning would have them raw on the terminal."""
    import warnings

    import matplotlib

    matplotlib.use("Agg")
    warnings.filterwarnings("ignore", r"Glyph \d+")
