"""The interactive picture of a run: one file of HTML with all that it needs, for any browser, without a network."""

from __future__ import annotations

import base64
import json
import os
import sys
import tempfile
import webbrowser
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path

import xarray as xr

from .._arguments import as_mapping, as_names, as_path
from .._drawing.arguments import checked
from .._drawing.forces import force_kinds
from .._geometry.own_run import run_of
from .._geometry.postures import scene_of
from .._output import write_output
from ..errors import InputError, UnavailableError
from ..results import inputs_of
from ..scene import Scene
from .data import describe

__all__ = ["View", "bundle", "view"]

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="linkdyn">
<title>{title}</title>
<style>html, body {{ height: 100%; margin: 0; }}</style>
</head>
<body>
<div id="linkdyn-view" style="height: 100%"></div>
<script type="application/json" id="linkdyn-run">{run}</script>
<script type="module">{code}</script>
</body>
</html>
"""
VIEWER = Path(__file__).parent.parent / "_viewer"
HEIGHT = 640
"""Of a view in a notebook [px]."""


@dataclass(frozen=True, repr=False)
class View:
    """An interactive picture; notebooks show it where it is the value of a cell."""

    html: str
    """The whole page."""
    title: str
    file: Path | None = None
    """Where it was written."""

    def __repr__(self) -> str:
        return f"<linkdyn.View {self.title!r}: {len(self.html) / 1e6:.1f} MB{f', {self.file}' if self.file else ''}>"

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {HEIGHT}px; border: 0; border-radius: 6px"
        return f'<iframe srcdoc="{escape(self.html)}" title="{escape(self.title)}" style="{style}"></iframe>'

    def open(self) -> bool:
        """Show it in the browser; False if there is none."""
        if not has_browser():
            return False
        path = self.file
        if path is None:
            with tempfile.NamedTemporaryFile("w", suffix=".html", prefix="linkdyn-", delete=False, encoding="utf-8") as file:
                file.write(self.html)
            path = Path(file.name)
        return webbrowser.open(path.resolve().as_uri())


@checked
def view(
    source: xr.Dataset | Scene,
    file: str | os.PathLike[str] | None = None,
    *,
    scene: Scene | None = None,
    forces: str | tuple[str, ...] | None = None,
    plots: str | tuple[str, ...] | None = None,
    traces: str | tuple[str, ...] | None = None,
    meshes: Mapping[str, str | os.PathLike[str]] | None = None,
    mesh_unit: float = 1.0,
) -> View:
    """An interactive picture of a run: play it, look from anywhere, with forces as arrows, ways of points, and results
    over time.

    Parameters
    ----------
    source
        A run of `Scene.inverse` or `Scene.forward`; or a scene: its own motion, or the motion that its drives bring about if
        no coordinate has one.
    file
        Where to write it, ``.html``; default: nowhere. The file needs no network and no other file.
    scene
        The mechanism; default: the scene in the run's attributes. To be given if that reads tables.
    forces
        What is shown at first of "driving", "reaction" and "load", or "all", or () for none; default: all of a planar
        mechanism, driving forces and loads of a spatial one. The reader of the page can switch them.
    plots
        Results that are plotted at first, "driving_force", "reaction", "q", ...; the reader can choose others.
    traces
        Markers ("coupler.tool") whose ways are drawn; default: those that hold no joint, of a small planar
        mechanism the joints too.
    meshes
        Link to STL or GLB file that shows its body, in the link's axes, in place of what is drawn for it; beside those that the
        scene names (``mesh``).
    mesh_unit
        Unit of the coordinates in these files [m]: 1e-3 for millimetres.

    Returns
    -------
    View
        Shown where it is the value of a notebook's cell; ``open()`` shows it in the browser.

    Raises
    ------
    InputError
        An unknown kind of force, result, marker or link; no sample that could be shown.
    FileError
        A file cannot be read or written, or would replace one that was read.
    UnavailableError
        The package was built without the viewer.
    """
    path = None if file is None else Path(file)
    if path is not None and path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"view: file '{path.name}': expected a name that ends in .html")
    code = bundle()
    scene, run = (source, run_of(source)) if isinstance(source, Scene) else (scene, source)
    if "sample" not in run.dims or "q" not in run or not run.sizes["sample"]:
        raise InputError("view: these are no samples of a mechanism's motion (expected results of inverse or forward)")
    mechanism = scene_of(run, "view") if scene is None else scene
    description, block = describe(
        run,
        mechanism,
        kinds=force_kinds("view", "all" if forces is None and "driving_force" not in run else forces, mechanism.planar),
        plots=plots,
        traces=traces,
        meshes=meshes_of(mechanism) | {link: (os.fspath(part), mesh_unit) for link, part in (meshes or {}).items()},
    )
    page = View(_page(code, description, block), mechanism.title or "linkdyn", path)
    if path is not None:
        drawn = [(os.fspath(part), "is a mesh of the picture") for part in (meshes or {}).values()]
        write_output(path, page.html, [*inputs_of(run, mechanism), *drawn])
    return page


def bundle() -> str:
    """The viewer's code, as the build made it of viewer/."""
    path = VIEWER / "viewer.js"
    if not path.is_file():
        raise UnavailableError(
            "view: this linkdyn was built without the viewer: node or the network were missing then "
            "(expected a build with -Dviewer=enabled, which says what it lacks)"
        )
    return path.read_text(encoding="utf-8")


def meshes_of(scene: Scene) -> dict[str, tuple[str, float]]:
    """Link to STL or GLB file and the unit of its coordinates [m], as the scene names them."""
    return {
        link["name"]: (os.path.join(scene.folder, link["mesh"]), link["mesh_unit"])
        for link in scene.description["links"]
        if "mesh" in link
    }


def has_browser() -> bool:
    """Is there one with windows? One in a terminal would take it over."""
    on_screen = sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    try:
        return on_screen and webbrowser.get() is not None
    except webbrowser.Error:
        return False


def _page(code: str, description: Mapping[str, object], block: bytes) -> str:
    """The file; `<` is written so that no text of a scene can end a script."""
    packed = base64.b64encode(zlib.compress(block, 9)).decode()
    run = json.dumps({"description": description, "block": packed}, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return PAGE.format(title=escape(str(description["title"])), run=run, code=code.replace("</script", "<\\/script"))
