"""A run as a moving picture: the mechanism with its forces as arrows."""

from __future__ import annotations

import io
import os
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib import animation
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from PIL import Image

from .._geometry.postures import Postures, find_postures, poses_of, scene_of
from .._geometry.wheels import is_geared
from .._output import write_output
from .._printable import printable
from ..errors import InputError, UnavailableError
from ..results import inputs_of
from ..scene import Scene
from .arguments import checked
from .forces import Forces, find_forces, force_kinds
from .mechanisms import draw, new_axes, set_limits
from .planar_shapes import unit_of
from .spatial_axes import SpatialAxes
from .style import fitting

__all__ = ["animate"]

Points = NDArray[np.float64]
Corner = Literal["upper left", "upper right", "lower left", "lower right"]

LARGEST = (5.6, 5.2)
"""Of a picture [inch]."""
DPI = 80
NEAR, MOST_COVERED = 0.03, 0.2
"""Air round what the arrows mean, in parts of the axes; part of the frames in which it may lie on the mechanism or its arrows, else it stands below."""
COLOURS = 64
"""In the palette of a GIF: the shapes are plain, and it stays small."""
ARROW = 0.2
"""Length of the longest arrow, of the mechanism's extent."""
COLOUR = {"reaction": "#B2182B", "load": "#1B7837", "driving": "#5E2C91"}


@checked
def animate(
    run: xr.Dataset,
    file: str | os.PathLike[str],
    *,
    scene: Scene | None = None,
    frames: int = 40,
    fps: float = 15.0,
    forces: str | tuple[str, ...] | None = None,
    names: bool = False,
) -> Path:
    """Write a run as a moving picture.

    Joint reactions are red (what the first link of the joint exerts on the second), loads green, driving forces violet,
    all forces to one scale; driving torques are arcs. Samples that failed are left out.

    Parameters
    ----------
    run
        Of `Scene.inverse` or `Scene.forward`; its samples follow each other. Forces are drawn as far as it has them.
    file
        ``.gif``, or ``.mp4`` if ffmpeg is installed.
    scene
        The mechanism; default: the scene in the run's attributes. To be given if that reads tables.
    frames
        Number of pictures, spread over the run.
    fps
        Pictures per second.
    forces
        What to draw of "driving", "reaction" and "load", or "all", or () for none; default: all of a planar mechanism,
        driving forces and loads of a spatial one.
    names
        Write names of links and joints.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        Another kind of file, an unknown kind of force, nothing that could be drawn.
    FileError
        The file cannot be written, or is one that was read.
    UnavailableError
        An ``.mp4`` without ffmpeg, or with one that does not encode H.264.
    """
    path = Path(file)
    if path.suffix not in (".gif", ".mp4"):
        raise InputError(f"animate: file '{path.name}': expected a name that ends in .gif or .mp4")
    if path.suffix == ".mp4" and not animation.writers.is_available("ffmpeg"):
        raise UnavailableError("animate: .mp4 needs ffmpeg, which is not installed; .gif needs nothing")
    mechanism = scene_of(run, "animate") if scene is None else scene
    postures, assembled = find_postures(mechanism, poses_of(mechanism, run))
    shown = _choose_samples(run, postures, assembled, frames)
    arrows = find_forces(run, postures, force_kinds("animate", forces, mechanism.planar))
    figure = Figure(dpi=DPI, layout="constrained" if mechanism.planar else None)
    pictures = _draw_frames(FigureCanvasAgg(figure), run, postures, arrows, shown, names)
    if path.suffix == ".gif":
        film = _gif(pictures, fps, sorted({COLOUR[item.kind] for item in arrows}))
    else:
        film = _mp4(pictures, figure, fps)
    write_output(path, film, inputs_of(run, mechanism))
    return path


def _choose_samples(run: xr.Dataset, postures: Postures, assembled: NDArray[np.bool_], frames: int) -> NDArray[np.intp]:
    """Samples spread over the run; one that ends where it began is not shown there twice."""
    if frames < 1:
        raise InputError(f"animate: frames: expected a number from 1 on, got {frames}")
    good = np.flatnonzero(assembled & (run.status.values == 0))
    if good.size == 0:
        raise InputError("animate: no sample of the run could be computed")
    points = postures.points
    extent = np.ptp(points[good].reshape(-1, 3), axis=0).max()
    is_loop = good.size > 2 and np.abs(points[good[-1]] - points[good[0]]).max() < 1e-3 * extent
    places = np.linspace(0, good.size - 1, min(frames, good.size) + is_loop)
    chosen: NDArray[np.intp] = good[np.round(places).astype(int)[: len(places) - is_loop]]
    return chosen


def _largest(arrows: list[Forces], shown: NDArray[np.intp], is_torque: bool) -> float:
    sizes = [np.linalg.norm(item.force[shown], axis=-1) for item in arrows if item.is_torque == is_torque]
    return max((float(np.nanmax(size)) for size in sizes if size.size), default=0.0)


def _draw_frames(
    canvas: FigureCanvasAgg,
    run: xr.Dataset,
    postures: Postures,
    arrows: list[Forces],
    shown: NDArray[np.intp],
    names: bool,
) -> Iterator[NDArray[np.uint8]]:
    """One picture after another, each as (height, width, 4) bytes."""
    figure, planar = canvas.figure, postures.scene.planar
    ax: Any = new_axes(figure, postures, LARGEST)
    extent = np.ptp(postures.points.reshape(-1, 3), axis=0).max()
    force, torque = _largest(arrows, shown, False), _largest(arrows, shown, True)
    scale = ARROW * extent / force if force > 0 else 0.0
    paths = _paths(postures, run.status.values == 0) if planar else []
    starts = [item.start(postures) for item in arrows]
    tips = _tips(arrows, starts, shown, scale, ARROW * extent / torque if torque > 0 and not planar else 0.0)
    drawn = np.concatenate([postures.points[shown], tips], axis=1)[..., :2]
    for sample in shown:
        ax.clear()
        set_limits(ax, postures)
        for path in paths:
            ax.plot(*path.T, color="0.8", linewidth=0.9, zorder=0.5)
        draw(ax, postures, sample, names)
        for item, places in zip(arrows, starts):
            colour = COLOUR[item.kind]
            for start, value in zip(places[sample], item.force[sample]):
                if item.is_torque and planar:
                    _draw_arc(ax, start, value[2] / torque if torque > 0 else 0.0, colour)
                else:
                    length = ARROW * extent / torque if item.is_torque and torque > 0 else scale
                    _draw_arrow(ax, start, length * value, colour, planar)
        _write(ax, run, arrows, sample, force, torque, drawn)
        if sample == shown[0] and not planar:
            ax.crop(tips.reshape(-1, 3))
        canvas.draw()  # type: ignore[no-untyped-call]
        if sample == shown[0]:
            figure.set_layout_engine("none")  # frames of one size: what they say about it changes with the digits
        yield np.array(canvas.buffer_rgba())  # type: ignore[no-untyped-call]


def _tips(arrows: list[Forces], starts: list[Points], shown: NDArray[np.intp], scale: float, torque_scale: float) -> Points:
    """(frames, n, 3) where the arrows end; what has no arrow ends where it begins."""
    tips = [start[shown] + np.nan_to_num((torque_scale if item.is_torque else scale) * item.force[shown]) for item, start in zip(arrows, starts)]
    ends: Points = np.concatenate([np.zeros((len(shown), 0, 3)), *tips], axis=1)
    return ends


def _paths(postures: Postures, good: NDArray[np.bool_]) -> list[Points]:
    """Ways of the moving joints in the plane."""
    joints = postures.scene.description["joints"]
    moving = [(joint["links"][1], joint["markers"][1]) for joint in joints if 0 not in joint["links"] and not is_geared(joint)]
    return [postures.markers[link][marker][good, :2] for link, marker in moving]


def _draw_arrow(ax: Axes, start: Points, arrow: Points, colour: str, planar: bool) -> None:
    if not np.isfinite(arrow).all():
        return
    if not planar:
        ax.quiver(*start, *arrow, color=colour, linewidth=2.0, arrow_length_ratio=0.25, zorder=18)
        return
    if np.linalg.norm(arrow) > 0.3 * unit_of(ax):
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.8, "mutation_scale": 10, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", xytext=(start[0], start[1]), xy=(start[0] + arrow[0], start[1] + arrow[1]), arrowprops=style, zorder=8)


def _draw_arc(ax: Axes, centre: Points, part: float, colour: str) -> None:
    """A torque as an arc with an arrowhead, up to three quarters of a turn."""
    if not np.isfinite(part) or abs(part) < 0.02:
        return
    radius = 2.6 * unit_of(ax)
    angle = np.pi / 2 + np.linspace(0.0, 1.5 * np.pi * part, 40)
    arc = centre[:2] + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    ax.plot(*arc.T, color=colour, linewidth=2.0, zorder=8)
    tangent = np.sign(part) * np.array([-np.sin(angle[-1]), np.cos(angle[-1])])
    style = {"arrowstyle": "-|>", "color": colour, "linewidth": 0, "mutation_scale": 13, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", xytext=arc[-1] - 0.1 * radius * tangent, xy=arc[-1] + 0.45 * radius * tangent, arrowprops=style, zorder=8)


def _write(ax: Axes, run: xr.Dataset, arrows: list[Forces], sample: int, force: float, torque: float, drawn: Points) -> None:
    """Title, instant, and what the arrows mean; in all frames in the same place."""
    figure: Any = ax.get_figure(root=True)
    moment = f"t = {run.time.values[sample]:.3f} s" if "time" in run.coords else f"sample {sample}"
    title = run.attrs.get("title", "")
    heading = f"{title}\n{moment}" if title else moment
    forces = [item for item in arrows if not item.is_torque and force > 0]
    labels = [(COLOUR[item.kind], item.label) for item in forces]
    if forces:
        labels[0] = (labels[0][0], f"{labels[0][1]} (longest arrow {_round(force)}N)")
    labels += [(COLOUR[item.kind], f"{item.label} (longest {_round(torque)}N·m)") for item in arrows if item.is_torque and torque > 0]
    if labels:
        handles = [Line2D([], [], color=colour, linewidth=2.0, label=label) for colour, label in labels]
        if isinstance(ax, SpatialAxes):
            ax.put_legend(handles, fontsize=6.5)
        elif not figure.legends:
            legend = ax.legend(handles=handles, loc="upper left", framealpha=0.8, edgecolor="none", fontsize=6.5)
            figure.draw_without_rendering()     # how large the axes are is known only then
            corner = _empty_corner(ax, drawn, np.array(legend.get_window_extent().transformed(ax.transAxes.inverted()).size))
            legend.remove()
            (ax if corner else figure).legend(handles=handles, loc=corner or "outside lower center", framealpha=0.8, edgecolor="none", fontsize=6.5)
    if isinstance(ax, SpatialAxes):
        ax.put_title(fitting(heading, figure), fontsize="small", parse_math=False)
    else:
        ax.set_title(fitting(heading, figure), fontsize="small", parse_math=False)


def _empty_corner(ax: Axes, drawn: Points, size: Points) -> Corner | None:
    """Where mechanism and arrows, (frames, n, 2), come into a box of a size, in parts of the axes, in the fewest frames; None if they do so in many everywhere."""
    points = ax.transLimits.transform(drawn.reshape(-1, 2)).reshape(drawn.shape)
    corners: dict[Corner, tuple[int, int]] = {"upper left": (0, 1), "upper right": (1, 1), "lower left": (0, 0), "lower right": (1, 0)}
    taken = {name: float(np.any(np.all(np.abs(points - corner) < size + NEAR, axis=2), axis=1).mean()) for name, corner in corners.items()}
    best = min(taken, key=lambda name: taken[name])
    return best if taken[best] <= MOST_COVERED else None


def _round(value: float) -> str:
    """Two digits and a prefix for the unit."""
    power = max(-2, min(2, int(np.floor(np.log10(float(f"{value:.1e}")) / 3))))
    prefix = {-2: "µ", -1: "m", 0: "", 1: "k", 2: "M"}[power]
    return f"{float(f'{value:.2g}') / 1000.0**power:.3g} {prefix}"


def _mp4(pictures: Iterator[NDArray[np.uint8]], figure: Figure, fps: float) -> bytes:
    """By ffmpeg, which wants a file to move about in."""
    writer = animation.FFMpegWriter(fps=fps)  # type: ignore[arg-type]  # ffmpeg takes fractions
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        next(pictures)      # from then on the figure has its size
        try:
            with writer.saving(figure, path, DPI):
                writer.grab_frame()
                for _ in pictures:
                    writer.grab_frame()
        except subprocess.CalledProcessError as error:
            said = str(error.stderr or "").strip().splitlines()
            raise UnavailableError(f"animate: .mp4: ffmpeg failed{': ' + printable(said[-1]) if said else ''} (expected one that encodes H.264; .gif needs nothing)") from None
        return path.read_bytes()


def _gif(pictures: Iterator[NDArray[np.uint8]], fps: float, colours: list[str]) -> bytes:
    images = [Image.fromarray(picture).convert("RGB") for picture in pictures]
    palette = _palette(images, colours)
    reduced = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    stream = io.BytesIO()
    reduced[0].save(
        stream, "GIF", save_all=True, append_images=reduced[1:], duration=max(20, round(1000.0 / fps)), loop=0, optimize=True
    )
    return stream.getvalue()


def _palette(images: list[Image.Image], colours: list[str]) -> Image.Image:
    """One palette for all pictures, with white and these colours, the rest from a few of them side by side."""
    some = images[:: max(1, len(images) // 4)]
    sheet = Image.new("RGB", (some[0].width, some[0].height * len(some)))
    for k, image in enumerate(some):
        sheet.paste(image, (0, k * image.height))
    own = np.array([(255, 255, 255), *(np.round(255 * np.array(to_rgb(name))) for name in colours)])
    n_found = COLOURS - len(own)
    found = np.array((sheet.quantize(n_found).getpalette() or [])[: 3 * n_found]).reshape(-1, 3)
    # A shade next to white would take its place: paper stays white, arrows keep their colours.
    apart = np.abs(found[:, np.newaxis] - own).max(axis=2).min(axis=1) > 8
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.concatenate([own, found[apart]]).astype(int).ravel().tolist())
    return palette
