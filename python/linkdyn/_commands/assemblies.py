"""``linkdyn assemblies``: all assemblies of a scene at its start, and what chooses each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .common import Parser, draw_into_files, refuse, say

__all__ = ["assemblies_command", "parser"]

DESCRIPTION = """\
List the assemblies in which a scene closes at its start, and the words that choose each in the scene. Those of larger loops are what attempts
find that go on until nothing new comes; legs turned about themselves make no others. The first is that which the scene has."""


def parser() -> Parser:
    """What the command takes."""
    command = Parser("assemblies", "SCENE", DESCRIPTION)
    add = command.add_argument
    add("scene", metavar="SCENE", help="the scene file")
    add("--picture", metavar="FILE", help="a sheet with every assembly small: .png, .pdf or .svg")
    command.add_last()
    return command


def assemblies_command(arguments: Sequence[str]) -> int:
    """Print the table; the exit status."""
    options = parser().parse_args(arguments)
    from ..errors import LinkdynError
    from ..scene import load

    if options.picture is not None and Path(options.picture).suffix.lower() not in (".png", ".pdf", ".svg"):
        return refuse(f"--picture: {options.picture!r} (expected a file that ends in .png, .pdf or .svg)")
    try:
        scene = load(options.scene)
        found = scene.assemblies()
    except LinkdynError as error:
        return refuse(str(error))
    say(scene.title or options.scene)
    for one in found:
        say(f"{one.number:4}  {one.words or 'the only one: nothing is to be chosen'}")
    if not found.is_complete:    # more than are listed, or attempts still found some when they had to end
        say("      and maybe more: the list ends here")
    if options.picture is None:
        return 0
    draw_into_files()
    from .._output import picture
    from ..plot import assemblies

    figure, _ = assemblies(scene)
    try:
        picture(figure, options.picture, scene._inputs(), dpi=120)
    except LinkdynError as error:
        return refuse(f"--picture: {error}")
    if not options.quiet:
        say(f"  picture          {options.picture}")
    return 0
