"""The command ``linkdyn convert``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from .common import Parser, emit, refuse, say, say_beside

if TYPE_CHECKING:
    from .._convert.convert import Conversion

__all__ = ["convert_command", "parser"]

DESCRIPTION = """\
A scene of a robot in MJCF (read by MuJoCo, which must be installed: pip install 'linkdyn[mujoco]') or URDF; or MJCF of a scene, loops as equality
constraints. Says, item by item, what was left out or taken for something else; of what goes to the terminal, on standard error."""


def parser() -> Parser:
    """What the command takes."""
    command = Parser("convert", "ROBOT|SCENE -o FILE", DESCRIPTION)
    add = command.add_argument
    add("source", metavar="ROBOT|SCENE", help="robot.xml or robot.urdf, of which a scene is made; or scene.toml, of which MJCF is made")
    add("-o", "--output", metavar="FILE", required=True, help="what is written: a scene ends in .toml, MJCF in .xml; - writes it to the terminal")
    add("--closing", metavar="NAME", default="revolute", help="joint that a URDF's frames closing_X_1, closing_X_2 stand for: revolute (default), spherical or fixed")
    add("--hold", action="store_true", help="bodies that float become parts of the frame where they start")
    add("--force", action="store_true", help="replace FILE if it is there")
    command.add_last()
    return command


def convert_command(arguments: Sequence[str]) -> int:
    """Write the file, say what was left out; the exit status."""
    options = parser().parse_args(arguments)
    makes_scene = not options.source.endswith(".toml")
    ending = ".toml" if makes_scene else ".xml"
    if options.output != "-" and Path(options.output).suffix.lower() != ending:
        return refuse(f"convert: {options.output!r} (expected a file that ends in {ending}: {'a scene' if makes_scene else 'MJCF'} is made of {options.source!r})")
    from .._convert.convert import convert
    from ..errors import LinkdynError

    try:
        found = convert(Path(options.source), options.closing, None if options.output == "-" else Path(options.output).parent, hold=options.hold)
    except LinkdynError as error:
        return refuse(str(error))
    if options.output == "-":
        emit(found.text)
        if found.left_out and not options.quiet:
            say_beside(_left_out(found))
        return 0
    try:
        found._write(options.output, replaces=options.force)
    except FileExistsError:
        return refuse(f"convert: {options.output!r} is there already (expected another file, --output FILE, or --force)")
    except LinkdynError as error:
        return refuse(f"convert: {error}")
    if not options.quiet:
        say(f"  {'scene' if makes_scene else 'MJCF':16} {options.output}")
        if found.left_out:
            say(_left_out(found))
    return 0


def _left_out(found: Conversion) -> str:
    """A line each."""
    return "\n".join(f"  {'left out' if k == 0 else '':16} {line}" for k, line in enumerate(found.left_out))
