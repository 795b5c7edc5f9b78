"""The command ``linkdyn view``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from .common import SOME_FAILED, Parser, refuse, say

if TYPE_CHECKING:
    import xarray as xr

    from ..scene import Scene

__all__ = ["parser", "view_command"]

DESCRIPTION = """\
An interactive picture of a run as one file of HTML, for any browser, without a network: play it, look from anywhere,
forces as arrows, ways of points, results over time. A SCENE is computed first: by its motion, or by its drives if it has none."""


def parser() -> Parser:
    """What the command takes."""
    view = Parser("view", "SCENE|RUN.nc", DESCRIPTION)
    add = view.add_argument
    add("source", metavar="SCENE|RUN.nc", help="a scene file, or results of inverse or forward")
    add("-o", "--output", metavar="FILE", help="the page; default: the name of SCENE or RUN with .html in this folder")
    add("--no-open", action="store_true", help="do not open it in the browser")
    add("--forces", metavar="LIST", help="shown at first: driving, reaction, load (with commas between), all or none")
    add("--plots", metavar="LIST", help="results plotted at first, such as driving_force,reaction")
    add("--traces", metavar="LIST", help="markers whose ways are drawn, such as platform.tool")
    add("--scene", metavar="FILE", help="the scene of RUN.nc, if it reads tables")
    view.add_last()
    return view


def view_command(arguments: Sequence[str]) -> int:
    """Write the page and open it; the exit status."""
    options = parser().parse_args(arguments)
    from .._view.page import bundle
    from ..errors import LinkdynError

    source = Path(options.source)
    page = Path(options.output) if options.output else Path(f"{source.stem}.html")
    try:
        bundle()  # before a long run
        return _write(options, source, page)
    except LinkdynError as error:
        return refuse(str(error))
    except OSError as error:
        return refuse(f"{error.filename}: {error.strerror}")


def _write(options: argparse.Namespace, source: Path, page: Path) -> int:
    from .._geometry.own_run import run_of
    from .._view.page import view
    from ..results import read
    from ..scene import Scene

    scene = Scene(Path(options.scene)) if options.scene else None
    if source.suffix == ".nc":
        run = read(source)
        scene = scene or _kept_scene(run, source)
    else:
        scene = Scene(source)
        run = run_of(scene)
    shown = view(run, page, scene=scene, forces=_forces(options.forces), plots=_words(options.plots), traces=_words(options.traces))
    opened = not options.no_open and shown.open()
    if not options.quiet:
        say(f"  view             {page}{'' if opened else '   (open it in a browser)'}")
    return SOME_FAILED if (run.status.values != 0).any() else 0


def _kept_scene(run: xr.Dataset, source: Path) -> Scene:
    """The scene in the results; its tables are looked up beside them."""
    from ..errors import InputError, SceneError
    from ..scene import Scene

    if "scene" not in run.attrs:
        raise InputError(f"{source}: holds no scene (expected results of inverse or forward, or --scene)")
    try:
        return Scene(run.attrs["scene"], folder=source.parent)
    except SceneError as error:
        raise InputError(f"{source}: its scene cannot be read, name it by --scene ({error})") from error


def _words(text: str | None) -> tuple[str, ...] | None:
    return None if text is None else tuple(word for word in text.split(",") if word)


def _forces(text: str | None) -> str | tuple[str, ...] | None:
    return "all" if text == "all" else () if text == "none" else _words(text)
