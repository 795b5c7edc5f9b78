"""A sizing sheet as PDF: A4, one page unless it holds more than fits."""

from __future__ import annotations

import io
import textwrap
from dataclasses import dataclass

import numpy as np
from matplotlib import pyplot
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from ._sheet import Page, Picture, Table
from ._style import BAD, COLOURS

__all__ = ["pdf"]

WIDTH, HEIGHT = 8.27, 11.69
"""A4 [inch]."""
MARGIN = 0.45
SIZE = 5.6
"""Of the letters [pt]."""
LINE = 0.108
"""From line to line [inch]."""
LETTER = 0.0435
"""Mean width of a letter [inch]."""


def pdf(page: Page) -> bytes:
    """The whole file."""
    writer = _Writer()
    writer.text(page.title, size=12.5, weight="bold", step=0.2)
    for line in page.lines:
        writer.text(line, colour="0.3", size=6.6, step=0.125)
    for table in page.tables:
        _table(writer, table)
    _pictures(writer, page.pictures)
    for note in page.notes:
        for line in textwrap.wrap(note, 190):
            writer.text(line, colour="0.4", size=5.0, step=0.09)
    return writer.finish(page.title)


@dataclass
class _Place:
    figure: Figure
    y: float
    """Inches from the top."""


class _Writer:
    """Lines from top to bottom, page after page."""

    def __init__(self) -> None:
        self.pages: list[_Place] = []
        self.new_page()

    def new_page(self) -> None:
        self.pages.append(_Place(pyplot.figure(figsize=(WIDTH, HEIGHT)), MARGIN))

    @property
    def at(self) -> _Place:
        return self.pages[-1]

    def room(self, height: float) -> None:
        """A new page if so much does not fit any more."""
        if self.at.y + height > HEIGHT - MARGIN and self.at.y > MARGIN:
            self.new_page()

    def put(self, x: float, y: float, text: str, *, right: bool = False, size: float = SIZE, colour: str = "black", weight: str = "normal") -> None:
        """Letters at inches from the left and from the top."""
        self.at.figure.text(x / WIDTH, 1 - y / HEIGHT, text, fontsize=size, color=colour, weight=weight,
                            ha="right" if right else "left", va="top", linespacing=1.05, parse_math=False)

    def text(self, text: str, *, step: float = LINE, size: float = SIZE, colour: str = "black", weight: str = "normal") -> None:
        self.room(step)
        self.put(MARGIN, self.at.y, text, size=size, colour=colour, weight=weight)
        self.at.y += step

    def rule(self, y: float, colour: str, width: float) -> None:
        place = self.at.figure
        place.add_artist(pyplot.Line2D([MARGIN / WIDTH, 1 - MARGIN / WIDTH], [1 - y / HEIGHT] * 2, color=colour, linewidth=width))

    def finish(self, title: str) -> bytes:
        stream = io.BytesIO()
        with PdfPages(stream, metadata={"Title": title, "CreationDate": None}) as file:
            for place in self.pages:
                file.savefig(place.figure)
                pyplot.close(place.figure)
        return stream.getvalue()


def _table(writer: _Writer, table: Table) -> None:
    edges, wraps = _columns(table)
    tall = [max(len(textwrap.wrap(cell.text, wrap) or [""]) for cell, wrap in zip(row, wraps)) for row in table.rows]
    head = LINE * max(text.count("\n") + 1 for text in table.head)
    writer.room(0.3 + head + sum(LINE * n for n in tall[:8]))
    writer.at.y += 0.07
    writer.text(table.title, size=7.2, weight="bold", colour=COLOURS[0], step=0.14)
    for k, text in enumerate(table.head):
        down = head - LINE * (text.count("\n") + 1)
        writer.put(_x(edges, k, table), writer.at.y + down, text, right=k not in table.wide, weight="bold")
    writer.at.y += head + 0.02
    writer.rule(writer.at.y, "0.3", 0.7)
    writer.at.y += 0.02
    for row, n in zip(table.rows, tall):
        writer.room(LINE * n)
        for k, (cell, wrap) in enumerate(zip(row, wraps)):
            writer.put(_x(edges, k, table), writer.at.y, "\n".join(textwrap.wrap(cell.text, wrap)), right=k not in table.wide,
                       colour=BAD if cell.alarm else "black", weight="bold" if cell.alarm else "normal")
        writer.at.y += LINE * n + 0.012
        writer.rule(writer.at.y - 0.004, "0.88", 0.35)
    for line in textwrap.wrap(table.note, 190):
        writer.text(line, colour="0.4", size=5.0, step=0.09)


def _columns(table: Table) -> tuple[list[float], list[int]]:
    """Edges of the columns [inch] and letters in a line of each: as wide as the longest text, if all fit."""
    letters = np.array([
        max([*(len(line) for line in head.split("\n")), *(len(row[k].text) for row in table.rows)])
        for k, head in enumerate(table.head)
    ], dtype=float) + 2.5
    whole = (WIDTH - 2 * MARGIN) / LETTER
    for _ in range(8):      # columns that ask for more than their share give way
        if letters.sum() <= whole:
            break
        long = letters > whole / len(letters)
        letters[long] = np.maximum(letters[long] * (whole - letters[~long].sum()) / letters[long].sum(), 8)
    edges = MARGIN + LETTER * np.concatenate([[0.0], np.cumsum(letters)])
    return edges.tolist(), [max(4, int(n - 2)) for n in letters]


def _x(edges: list[float], k: int, table: Table) -> float:
    return edges[k] if k in table.wide else edges[k + 1] - 1.5 * LETTER


def _pictures(writer: _Writer, pictures: list[Picture]) -> None:
    """In rows of two, as pixels."""
    gap = 0.15
    for first in range(0, len(pictures), 2):
        row = pictures[first : first + 2]
        images = [_pixels(picture) for picture in row]
        ratios = [image.shape[1] / image.shape[0] for image in images]
        height = min((WIDTH - 2 * MARGIN - gap * (len(row) - 1)) / sum(ratios), 2.5)
        writer.room(height + 0.2)
        x = MARGIN
        for image, ratio in zip(images, ratios):
            frame = (x / WIDTH, 1 - (writer.at.y + 0.08 + height) / HEIGHT, ratio * height / WIDTH, height / HEIGHT)
            axis = writer.at.figure.add_axes(frame)
            axis.imshow(image, interpolation="antialiased")
            axis.axis("off")
            x += ratio * height + gap
        writer.at.y += height + 0.16


def _pixels(picture: Picture) -> np.ndarray:
    stream = io.BytesIO()
    picture.figure.savefig(stream, format="png", dpi=170, bbox_inches="tight")
    stream.seek(0)
    return pyplot.imread(stream)
