"""Scenes to start from: ``linkdyn new`` and ``linkdyn.new``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from .._output import write_output
from ..errors import FileError, InputError
from .common import Parser, emit, refuse, say

if TYPE_CHECKING:
    from ..scene import Scene

__all__ = ["kinds", "new", "new_command", "parser", "text_of"]

SCENES = Path(__file__).parent.parent / "_scenes"
DESCRIPTION = """\
Write a scene of a kind to start from: it runs, and its comments say what stands where. Without a KIND: list them."""


def parser() -> Parser:
    """What the command takes."""
    command = Parser("new", "[KIND]", DESCRIPTION)
    add = command.add_argument
    add("kind", metavar="KIND", nargs="?", help="; ".join(kinds()))
    add("-o", "--output", metavar="FILE", help="the scene; default: KIND.toml in this folder; - writes it to the terminal")
    add("--force", action="store_true", help="replace FILE if it is there")
    command.add_last()
    return command


def kinds() -> dict[str, str]:
    """All kinds, each with a line that says what it is."""
    files = sorted(SCENES.glob("*.toml"))
    return {file.stem: file.read_text(encoding="utf-8").partition("\n")[0].removeprefix("#").strip() for file in files}


def text_of(kind: str) -> str:
    """The scene file of a kind.

    Raises
    ------
    InputError
        There is no such kind.
    """
    from .._arguments import as_known

    kind = as_known("new", kind, kinds(), "kind")
    return (SCENES / f"{kind}.toml").read_text(encoding="utf-8")


def new(kind: str) -> Scene:
    """A scene to start from.

    Parameters
    ----------
    kind
        "four-bar", "slider-crank", "quick-return", "six-bar", "five-bar", "cam", "3-rrr", "arm", "excavator", "scissor-lift", "delta" or
        "hexapod": what ``linkdyn new`` lists. ``scene.text`` is the file with its comments, ``scene.with_({"variables.L": ..})`` the scene in another size.

    Raises
    ------
    InputError
        There is no such kind.

    Examples
    --------
    >>> scene = linkdyn.new("four-bar")
    >>> longer = scene.with_({"variables.coupler": 0.5})
    """
    from .._arguments import as_name
    from ..scene import Scene

    return Scene(text_of(as_name("kind", kind)))


def new_command(arguments: Sequence[str]) -> int:
    """Write the scene; the exit status."""
    options = parser().parse_args(arguments)
    if options.kind is None:
        if options.output is not None or options.force:
            return refuse("new: no KIND given (linkdyn new lists them)")
        for kind, summary in kinds().items():
            say(f"  {kind:14}{summary}")
        return 0
    try:
        text = text_of(options.kind)
    except InputError as error:
        return refuse(str(error))
    target = options.output if options.output is not None else f"{options.kind}.toml"
    if target == "-":
        emit(text)
        return 0
    try:
        write_output(target, text, replaces=options.force)
    except FileExistsError:
        return refuse(f"new: {target!r} is there already (expected another file, --output FILE, or --force)")
    except FileError as error:
        return refuse(f"new: {error}")
    if not options.quiet:
        say(f"  scene            {target}")
        say(f"  next             linkdyn inverse {target}")
    return 0
