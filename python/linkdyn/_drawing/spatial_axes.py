"""Axes for a mechanism in space: numbers stand clear of the lines that they number, and no paper is left blank round what is tall or flat."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d import Axes3D, proj3d
from numpy.typing import NDArray

__all__ = ["SpatialAxes", "add_spatial_axes", "outline", "set_apart"]

Points = NDArray[np.float64]

CLEAR = 5.0
"""Between an axis and its numbers, and between these and the axis' name [points]."""
TOUCHING = 3.0
"""Numbers of two axes are apart by as much at least [points]."""
BORDER = 0.08
"""Round what is drawn [inch]."""
SURROUND = 0.9, 1.1
"""For numbers and names of the axes, and the title [inch]."""
IN_A_ROW = 5
"""Entries of a legend."""
# matplotlib moves numbers and names of an axis from the middle of the box by so much of it for every point of their pads
MOVED = 0.08 * 48.0
NUMBER_PAD, NAME_PAD = 8.0, 21.0
"""Points that it adds to the pads of both."""


class SpatialAxes(Axes3D):  # type: ignore[misc]
    """Axes alone in a figure, which becomes as large as what is drawn: matplotlib's own are a square, however tall or flat the box that they hold."""

    largest: tuple[float, float]
    """Of the picture [inch]."""
    kept: dict[str, list[float]] | None = None
    """Numbers of x and y for which there is room, when that is known: frames of a film are cleared and drawn alike."""

    def fill(self) -> None:
        """So large that the box, whose limits and eye are set, fills the picture; once cropped it stays as it is."""
        if self.kept is not None:
            for name, places in self.kept.items():
                getattr(self, f"set_{name}ticks")(places)
            return
        low, high = outline(self)
        room = np.array(self.largest) - SURROUND
        side = float(np.min(room / np.maximum(high - low, 1e-3)))
        self.get_figure(root=True).set_size_inches(side, side)
        self.set_position((0.0, 0.0, 1.0, 1.0))

    def put_legend(self, handles: list[Any], **style: Any) -> None:
        """In rows above the box."""
        low, high = outline(self)
        place: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": ((low[0] + high[0]) / 2, high[1]), "borderaxespad": 0.3}
        self.legend(handles=handles, ncols=min(IN_A_ROW, len(handles)), columnspacing=1.4, handletextpad=0.4, frameon=False, **place, **style)

    def put_title(self, text: str, **style: Any) -> None:
        """Above the box and the legend."""
        low, high = outline(self)
        legend = self.get_legend()
        top = self.transAxes.inverted().transform(legend.get_window_extent().max)[1] if legend else high[1]
        self.set_title(text, y=top, **style).set_position(((low[0] + high[0]) / 2, top))    # matplotlib takes another y in space

    def crop(self, reach: Points | None = None) -> None:
        """Make the figure as large as what is drawn, and what will reach so far (n, 3); on paper it keeps its size."""
        figure: Any = self.get_figure(root=True)
        self._thin_out()
        box = figure.get_tightbbox()
        inches = figure.dpi_scale_trans.inverted()
        if reach is not None and len(reach):
            seen = np.stack(proj3d.proj_transform(*reach.T, self.get_proj())[:2], axis=-1)
            box = Bbox.union([box, Bbox.from_extents(*_ends(inches.transform(self.transData.transform(seen))))])
        box = box.padded(BORDER)
        place = self.bbox.transformed(inches)
        figure.set_size_inches(box.size)
        self.set_position((*((place.min - box.min) / box.size), *(place.size / box.size)))

    def _thin_out(self) -> None:
        """Leave out numbers of x and y that touch what stands beside the other."""
        figure: Any = self.get_figure(root=True)
        self.kept = {}
        shorter, longer = sorted((self.xaxis, self.yaxis), key=lambda axis: float(np.ptp(axis.get_view_interval())))
        for axis, other in ((shorter, longer), (longer, shorter)):
            figure.draw_without_rendering()
            low, high = sorted(axis.get_view_interval())
            shown = {tick.get_loc(): tick.label1.get_window_extent().padded(TOUCHING * figure.dpi / 72) for tick in axis.get_major_ticks()}
            taken = [text.get_window_extent() for text in (other.label, *(tick.label1 for tick in other.get_major_ticks()))]
            inside = [place for place in shown if low <= place <= high]
            kept = [place for place in inside if not any(shown[place].overlaps(box) for box in taken)]
            if kept and len(kept) < len(inside):
                self.kept[axis.axis_name] = kept
                axis.set_ticks(kept)

    def get_tightbbox(self, renderer: Any = None, **_: Any) -> Bbox:
        """Of the box with its numbers, of the title, and of what was added."""
        self.apply_aspect()
        legend = self.get_legend()      # faces in space do not know where they are seen, and none leaves the box
        parts = [*self._axis_map.values(), self.title, *self.lines, *self.texts, *([legend] if legend else [])]
        boxes = [part.get_tightbbox(renderer) for part in parts if part.get_visible()]
        return Bbox.union([box for box in boxes if box is not None and np.isfinite(box.extents).all() and (box.width > 0 or box.height > 0)])


def add_spatial_axes(figure: Figure, largest: tuple[float, float]) -> SpatialAxes:
    """Axes for a figure without others, for a picture of such a size [inch] at most."""
    axes: Any = figure.add_axes((0.0, 0.0, 1.0, 1.0), axes_class=SpatialAxes)
    axes.largest = largest
    in_space: SpatialAxes = axes
    return in_space


def outline(ax: Axes3D) -> tuple[Points, Points]:
    """Lower left and upper right corner of the box as it is seen, in parts of the axes."""
    corners = _corners(ax)
    return corners.min(axis=(0, 1, 2)), corners.max(axis=(0, 1, 2))


def set_apart(ax: Axes3D) -> None:
    """Numbers beside their axis and names beside the numbers, however narrow the box is: matplotlib's pads are parts of it."""
    size = ax.bbox.size / ax.get_figure(root=True).dpi * 72
    corners = _corners(ax) * size
    for k, name in enumerate("xyz"):
        axis = getattr(ax, f"{name}axis")
        lines = np.moveaxis(corners, k, 2).reshape(4, 2, 2)      # the edges along it, both ends
        along = lines[0, 1] - lines[0, 0]
        offsets = lines.mean(axis=1) - corners.mean(axis=(0, 1, 2))
        across = np.abs(along[0] * offsets[:, 1] - along[1] * offsets[:, 0])
        offset = offsets[np.argmax(across)]         # it stands on an edge of the silhouette
        distance = float(np.linalg.norm(offset))
        if not distance > 0.0:
            continue
        letters = axis.get_major_formatter()
        low, high = sorted(getattr(ax, f"get_{name}lim")())
        longest = max((len(letters(tick)) for tick in axis.get_majorticklocs() if low <= tick <= high), default=1)
        half = 0.5 * np.array([0.62 * longest, 1.0]) * 10.0
        reach = float(np.abs(offset / distance) @ half)     # of a number, the way that it is moved
        moved = 2 * MOVED / float(size.sum()) * distance    # points for a point of the pads
        axis.set_tick_params(pad=(CLEAR + reach) / moved - NUMBER_PAD)
        axis.labelpad = (2 * (CLEAR + reach) + 8.0) / moved - NAME_PAD


def _corners(ax: Axes3D) -> Points:
    """(2, 2, 2, 2) of the box by the ends of x, y and z, in parts of axes that are square."""
    limits = (ax.get_xlim(), ax.get_ylim(), ax.get_zlim())
    points = np.array(list(product(*limits)))
    seen = np.stack(proj3d.proj_transform(*points.T, ax.get_proj())[:2], axis=-1)
    low, high = ax.viewLim.min, ax.viewLim.max
    corners: Points = ((seen - low) / (high - low)).reshape(2, 2, 2, 2)
    return corners


def _ends(points: Points) -> tuple[float, ...]:
    return (*points.min(axis=0), *points.max(axis=0))
