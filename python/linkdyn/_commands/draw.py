"""The command ``linkdyn draw``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from .common import Parser, draw_into_files, refuse, say

if TYPE_CHECKING:
    from .._geometry.postures import Postures
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
    add("--at", metavar="T", help="instant in s of the motion, or of the forward run if none is given; default: where it begins")
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
    from .._drawing.mechanisms import draw_alone, mechanism
    from .._output import picture
    from ..errors import LinkdynError
    from ..scene import Scene

    try:
        scene = Scene(Path(options.scene))
        if options.at is None:
            figure, _ = mechanism(scene, names=not options.no_names)
        else:
            figure, _ = draw_alone(_postures(options.at, scene), names=not options.no_names)
        picture(figure, file, scene._inputs(), dpi=150)   # type: ignore[arg-type]
    except LinkdynError as error:
        return refuse(str(error))
    except OSError as error:
        return refuse(f"{error.filename or file}: {error.strerror or error}")
    if not options.quiet:
        say(f"  picture          {file}")
    return 0


def _postures(at: str, scene: Scene) -> Postures:
    """Where everything is at an instant of the scene's run [s]."""
    from .._geometry.own_run import poses_at
    from .._geometry.postures import find_postures
    from ..errors import InputError

    try:
        instant = float(at)
        if not math.isfinite(instant):
            raise ValueError
    except ValueError:
        raise InputError(f"draw: --at: expected seconds, got {at!r}") from None
    try:
        postures, assembled = find_postures(scene, poses_at(scene, instant))
    except InputError as error:
        raise InputError(f"draw: --at: {error}") from error
    if not assembled[0]:
        raise InputError(f"draw: at {at} s the mechanism cannot be assembled")
    return postures
