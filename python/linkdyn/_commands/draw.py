"""The command ``linkdyn draw``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from .common import Parser, draw_into_files, refuse, say

if TYPE_CHECKING:
    from ..scene import Scene

__all__ = ["draw_command", "parser"]

DESCRIPTION = """\
The mechanism as it stands at the beginning of its motion, or at another instant, as a picture for paper: links, hinges, slides, cylinders and their
names. Moving and interactive pictures: linkdyn view."""
ENDINGS = (".png", ".svg", ".pdf")


def parser() -> Parser:
    """What the command takes."""
    draw = Parser("draw", "SCENE", DESCRIPTION)
    add = draw.add_argument
    add("scene", metavar="SCENE", help="a scene file")
    add("-o", "--output", metavar="FILE", help="the picture, .png, .svg or .pdf; default: the name of SCENE with .png in this folder")
    add("--at", metavar="T", help="instant of the motion in s; default: where it begins")
    add("--no-names", action="store_true", help="without names of links and joints")
    draw.add_last()
    return draw


def draw_command(arguments: Sequence[str]) -> int:
    """Draw the picture; the exit status."""
    options = parser().parse_args(arguments)
    file = Path(options.output) if options.output is not None else Path(f"{Path(options.scene).stem}.png")
    if file.suffix.lower() not in ENDINGS:
        return refuse(f"draw: {str(file)!r} (expected a file that ends in {', '.join(ENDINGS)})")
    draw_into_files()
    from .._drawing.mechanisms import mechanism
    from .._output import picture
    from ..errors import LinkdynError
    from ..scene import Scene

    try:
        scene = Scene(Path(options.scene))
        place = None if options.at is None else scene.inverse(t=[_instant(options.at, scene)], want="joint_variable")
        if place is not None and int(place.status[0]) != 0:
            return refuse(f"draw: at {options.at} s the mechanism cannot be assembled")
        figure, _ = mechanism(scene, None if place is None else place.q.values[0], names=not options.no_names)
        picture(figure, file, scene._inputs(), dpi=150)   # type: ignore[arg-type]
    except LinkdynError as error:
        return refuse(str(error))
    except OSError as error:
        return refuse(f"{error.filename or file}: {error.strerror or error}")
    if not options.quiet:
        say(f"  picture          {file}")
    return 0


def _instant(text: str, scene: Scene) -> float:
    """An instant of the scene's motion [s]."""
    from ..errors import InputError

    try:
        instant = float(text)
    except ValueError:
        raise InputError(f"draw: --at: expected seconds, got {text!r}") from None
    first, last = scene.description["time"]["first"], scene.description["time"]["last"]
    if first < last and not first <= instant <= last:
        raise InputError(f"draw: --at: expected an instant of the motion, from {first:g} to {last:g} s, got {text}")
    return instant
