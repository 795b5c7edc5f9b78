"""A sizing sheet as PDF: A4, one page unless it holds more than fits."""

from __future__ import annotations

import io
import textwrap
from dataclasses import dataclass

import numpy as np
from matplotlib import pyplot
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .._drawing.lines import spread_names
from .._drawing.style import BAD, COLOURS
from .sheet import Page, Picture, Table

__all__ = ["pdf"]

WIDTH, HEIGHT = 8.27, 11.69
"""A4 [inch]."""
MARGIN = 0.45
SIZE = 5.6
"""Of the letters [pt]."""
LINE = 0.108
"""From line to line [inch]."""
NEXT = 0.092
"""To a further line of the same cell."""
NOTE_LINE = 0.085
LETTER = 0.0435
"""Mean width of a letter [inch]."""
LETTERS = (WIDTH - 2 * MARGIN) / LETTER
TITLE_LETTERS = 66
"""In a line of the title."""
GAP = 5
"""Letters between two tables."""
IN_A_ROW = 3
"""Pictures."""
LOWEST, FLATTEST = 1.15, 0.62
"""A picture less tall than this [inch], or a wide one less tall than this part of its own height, cannot be read."""
TALLEST, BESIDE, UNDER = 3.2, 0.12, 0.28
"""A picture among others, what is between two of them, and what its caption takes [inch]."""
BELOW = 0.4
"""Kept for the notes [inch]."""
DPI = 170
SCALE = 0.85
"""Of what is wide, at most: narrow panels are not blown up to the width of the page, their letters would be larger than all others."""


def pdf(page: Page) -> bytes:
    """The whole file."""
    writer = _Writer()
    for line in textwrap.wrap(page.title, TITLE_LETTERS):
        writer.text(line, size=12.5, weight="bold", step=0.2)
    for line in (part for line in page.lines for part in textwrap.wrap(line, 140)):
        writer.text(line, colour="0.3", size=6.6, step=0.125)
    for tables in _blocks(page.tables):
        _block(writer, tables)
    _pictures(writer, page.pictures)
    for note in page.notes:
        for line in textwrap.wrap(note, 190):
            writer.text(line, colour="0.4", size=5.0, step=NOTE_LINE)
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

    def rule(self, left: float, right: float, colour: str, width: float, up: float = 0.0) -> None:
        y = 1 - (self.at.y - up) / HEIGHT
        self.at.figure.add_artist(Line2D([left / WIDTH, right / WIDTH], [y, y], color=colour, linewidth=width))

    def finish(self, title: str) -> bytes:
        stream = io.BytesIO()
        with PdfPages(stream, metadata={"Title": title, "CreationDate": None}) as file:
            for place in self.pages:
                file.savefig(place.figure)
                pyplot.close(place.figure)
        return stream.getvalue()


def _blocks(tables: list[Table]) -> list[list[Table]]:
    """Tables that follow each other and are narrow enough stand side by side."""
    blocks: list[list[Table]] = []
    for table in tables:
        wanted = table.letters(np.inf).sum()
        if blocks and len(blocks[-1]) == 1 and blocks[-1][0].letters(np.inf).sum() + wanted < LETTERS - GAP:
            blocks[-1].append(table)
        else:
            blocks.append([table])
    return blocks


def _block(writer: _Writer, tables: list[Table]) -> None:
    tall = max(_height(table) for table in tables)
    if tall < HEIGHT - 2 * MARGIN:
        writer.room(tall)
    top, left, bottoms = writer.at.y, MARGIN, []
    for k, table in enumerate(tables):
        writer.at.y = top
        last = k == len(tables) - 1
        right = WIDTH - MARGIN if last else left + LETTER * table.letters(LETTERS).sum()
        _table(writer, table, left, right)
        bottoms.append(writer.at.y)
        left = right + LETTER * GAP
    writer.at.y = max(bottoms)


def _lines(table: Table) -> list[int]:
    """Of each row."""
    widths = _wraps(table)
    return [max(len(_wrap(cell.text, n)) for cell, n in zip(row, widths)) for row in table.rows]


def _wraps(table: Table) -> list[int]:
    return [max(4, int(n - 2)) for n in table.letters(LETTERS)]


def _wrap(text: str, n: int) -> list[str]:
    return textwrap.wrap(text, n) or [""]


def _height(table: Table) -> float:
    head = max(text.count("\n") + 1 for text in table.head)
    return 0.28 + LINE * head + sum(_row_height(n) for n in _lines(table)) + NOTE_LINE * len(textwrap.wrap(table.note, 190))


def _row_height(lines: int) -> float:
    return LINE + 0.012 + NEXT * (lines - 1)


def _table(writer: _Writer, table: Table, left: float, right: float) -> None:
    edges = [left, *(left + LETTER * np.cumsum(table.letters(LETTERS)))]
    widths = _wraps(table)

    def x(k: int) -> float:
        return float(edges[k] if k in table.wide else edges[k + 1] - 1.5 * LETTER)

    head = LINE * max(text.count("\n") + 1 for text in table.head)
    writer.at.y += 0.07
    writer.put(left, writer.at.y, table.title, size=7.2, weight="bold", colour=COLOURS[0])
    writer.at.y += 0.14
    for k, text in enumerate(table.head):
        down = head - LINE * (text.count("\n") + 1)
        writer.put(x(k), writer.at.y + down, text, right=k not in table.wide, weight="bold")
    writer.at.y += head + 0.02
    writer.rule(left, right, "0.3", 0.7)
    writer.at.y += 0.02
    for row, n in zip(table.rows, _lines(table)):
        writer.room(_row_height(n))
        for k, (cell, width) in enumerate(zip(row, widths)):
            writer.put(x(k), writer.at.y, "\n".join(_wrap(cell.text, width)), right=k not in table.wide,
                       colour=BAD if cell.alarm else "black", weight="bold" if cell.alarm else "normal")
        writer.at.y += _row_height(n)
        writer.rule(left, right, "0.88", 0.35, up=0.006)
    for line in textwrap.wrap(table.note, max(40, int((right - left) / LETTER * 1.12))):
        writer.put(left, writer.at.y, line, colour="0.4", size=5.0)
        writer.at.y += NOTE_LINE


@dataclass
class _Row:
    """Pictures side by side."""

    pictures: list[Picture]
    images: list[np.ndarray]

    @property
    def ratios(self) -> list[float]:
        return [image.shape[1] / image.shape[0] for image in self.images]

    @property
    def most(self) -> float:
        """Height over the whole width; of pictures that are not wide, one that is large enough."""
        over_all = (WIDTH - 2 * MARGIN - BESIDE * (len(self.images) - 1)) / sum(self.ratios)
        return min(over_all, SCALE * self.images[0].shape[0] / DPI, HEIGHT - 2 * MARGIN - BELOW - UNDER) if self.pictures[0].wide else min(over_all, TALLEST)

    @property
    def least(self) -> float:
        """Height below which it cannot be read; what is wide stays so, and is drawn anew."""
        return FLATTEST * self.most if self.pictures[0].wide else min(LOWEST, self.most)


def _pictures(writer: _Writer, pictures: list[Picture]) -> None:
    """In rows, as pixels: as many on a page as can be read there, and then as tall as the page allows. What is wide has a row of its own."""
    rows = [_Row(row, [_pixels(picture) for picture in row]) for row in _rows(pictures)]
    while rows:
        room = HEIGHT - MARGIN - BELOW - writer.at.y
        fit = int(np.sum(np.cumsum([row.least + UNDER for row in rows]) <= room))
        if fit == 0 and writer.at.y > MARGIN:
            writer.new_page()
            continue
        taken, rows = rows[: max(1, fit)], rows[max(1, fit) :]
        for row, height in zip(taken, _heights(taken, room - UNDER * len(taken))):
            _draw_row(writer, row, height)


def _heights(rows: list[_Row], room: float) -> list[float]:
    """Of rows that fill what room there is: none is less tall than can be read, none taller than it has to be."""
    low, high = 0.0, 1.0
    for _ in range(30):
        share = (low + high) / 2
        low, high = (low, share) if sum(max(row.least, share * row.most) for row in rows) > room else (share, high)
    return [max(row.least, high * row.most) for row in rows]


def _draw_row(writer: _Writer, row: _Row, height: float) -> None:
    if row.pictures[0].wide and height < row.most:
        row = _Row(row.pictures, [_pixels(row.pictures[0], height / row.most)])
        height = min(height, row.most)
    x = (WIDTH - height * sum(row.ratios) - BESIDE * (len(row.images) - 1)) / 2
    for picture, image, ratio in zip(row.pictures, row.images, row.ratios):
        frame = (x / WIDTH, 1 - (writer.at.y + 0.06 + height) / HEIGHT, ratio * height / WIDTH, height / HEIGHT)
        axis = writer.at.figure.add_axes(frame)
        axis.imshow(image, interpolation="antialiased")
        axis.axis("off")
        for k, line in enumerate(textwrap.wrap(picture.caption, max(20, int(ratio * height / LETTER)))[:2]):
            writer.put(x, writer.at.y + 0.08 + height + k * NOTE_LINE, line, colour="0.4", size=5.0)
        x += ratio * height + BESIDE
    writer.at.y += height + UNDER


def _rows(pictures: list[Picture]) -> list[list[Picture]]:
    rows: list[list[Picture]] = []
    for picture in pictures:
        if picture.wide or not rows or rows[-1][0].wide or len(rows[-1]) == IN_A_ROW:
            rows.append([])
        rows[-1].append(picture)
    return rows


def _pixels(picture: Picture, lower: float = 1.0) -> np.ndarray:
    """A picture, or one that is as wide and less tall, with letters of the same size."""
    stream, (width, height) = io.BytesIO(), picture.figure.get_size_inches()
    if lower < 1.0:
        picture.figure.set_size_inches(width, lower * height)
        for axis in picture.figure.axes:
            spread_names(axis)
    picture.figure.savefig(stream, format="png", dpi=DPI, bbox_inches="tight")
    stream.seek(0)
    return pyplot.imread(stream)
