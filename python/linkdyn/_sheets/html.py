"""A sizing sheet as one self-contained file of HTML that is XML as well."""

from __future__ import annotations

import base64
import io
from html import escape
from itertools import groupby

from matplotlib import rc_context

from .sheet import Cell, Page, Picture, Table

__all__ = ["html"]

LETTERS = 170
"""In a line of a table."""
EM = 7.5
"""Letters of the page's height in an inch of a picture: texts of 10 points in pictures are as large as those of the page, on screen and on paper."""
STYLE = """
@page { size: A4; margin: 11mm; }
html { background: #fff; color-scheme: light; }
body { font: 10px/1.35 "Helvetica Neue", Helvetica, Arial, "Liberation Sans", sans-serif; color: #1a1a1a; margin: 1.2em auto;
       max-width: 1000px; padding: 0 1em; }
h1 { font-size: 20px; margin: 0 0 .15em; }
h2 { font-size: 12px; margin: 0 0 .3em; color: #0072B2; }
p { margin: 0 0 .25em; }
p.fact { color: #444; }
p.note { color: #666; font-size: 9px; margin-top: .3em; }
section { margin: .9em 0 0; break-inside: avoid; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th { font-weight: 600; text-align: right; vertical-align: bottom; border-bottom: 1.2px solid #555; padding: .1em .5em .2em; white-space: pre-line; }
td { text-align: right; padding: .13em .5em; border-bottom: .5px solid #ddd; vertical-align: top; }
th.word, td.word { text-align: left; }
th:first-child, td:first-child { padding-left: 0; }
td.alarm { color: #B2182B; font-weight: 700; }
div.pair { display: grid; grid-template-columns: 1fr 1fr; column-gap: 2.4em; }
div.pictures { display: grid; grid-template-columns: 1fr 1fr; gap: .8em; margin-top: .9em; }
figure { margin: 0; break-inside: avoid; text-align: center; }
figure.wide { grid-column: 1 / -1; }
figure img { max-width: 100%; max-height: 430px; object-fit: contain; }
figure.whole img { max-height: none; }
figcaption { color: #444; text-align: center; }
@media screen and (max-width: 700px) { body { font-size: 12px; } p.note { font-size: 11px; } section { overflow-x: auto; }
  div.pair, div.pictures { grid-template-columns: minmax(0, 1fr); } figure.wide { grid-column: auto; }
  th { white-space: pre; } td { white-space: nowrap; } td.word { min-width: 7em; white-space: normal; }
  figure.whole { overflow-x: auto; } figure.whole img { max-width: none; } }
@media print { body { margin: 0; padding: 0; max-width: none; font-size: 7.4px; line-height: 1.22; } p.note { font-size: 6.4px; }
  h1 { font-size: 15px; } h2 { font-size: 9px; margin: 0; } section { margin-top: .55em; } td { padding: .05em .4em; }
  div.pictures { grid-template-columns: repeat(6, 1fr); gap: .3em; margin-top: .4em; }
  figure, figure.wide { grid-column: span 2; } figure.half { grid-column: span 3; }
  figure.whole { grid-column: 1 / -1; } figure.whole img { max-height: 92mm; }
  figure img { max-height: 175px; } }
"""


def html(page: Page) -> str:
    """The whole file."""
    body = [f"<h1>{escape(page.title)}</h1>", *(f'<p class="fact">{escape(line)}</p>' for line in page.lines)]
    body += _sections(page.tables)
    body += ["<section>", *(f'<p class="note">{escape(note)}</p>' for note in page.notes), "</section>"] if page.notes else []
    if page.pictures:
        body += ['<div class="pictures">', *_figures(page.pictures), "</div>"]
    head = f'<meta charset="utf-8"/>\n<meta name="viewport" content="width=device-width"/>\n<title>{escape(page.title)}</title>\n<style>{STYLE}</style>'
    return "\n".join(["<!DOCTYPE html>", '<html lang="en">', "<head>", head, "</head>", "<body>", *body, "</body>", "</html>", ""])


def _sections(tables: list[Table]) -> list[str]:
    """Narrow tables that follow each other stand side by side."""
    parts: list[str] = []
    waiting: list[str] = []
    for table in tables:
        narrow = len(table.head) <= 5 and max((len(cell.text) for row in table.rows for cell in row), default=0) <= 40
        if narrow and not waiting:
            waiting.append(_section(table))
            continue
        if narrow:
            parts += ['<div class="pair">', waiting.pop(), _section(table), "</div>"]
            continue
        parts += [*waiting, _section(table)]
        waiting.clear()
    return parts + waiting


def _section(table: Table) -> str:
    def word(k: int) -> str:
        return ' class="word"' if k in table.wide else ""

    lines = ["<section>", f"<h2>{escape(table.title)}</h2>", "<table>", *_widths(table), "<thead><tr>"]
    lines += [f"<th{word(k)}>{escape(text)}</th>" for k, text in enumerate(table.head)]
    lines += ["</tr></thead>", "<tbody>"]
    for row in table.rows:
        lines.append("<tr>" + "".join(_data(cell, k in table.wide) for k, cell in enumerate(row)) + "</tr>")
    lines += ["</tbody>", "</table>"]
    if table.note:
        lines.append(f'<p class="note">{escape(table.note)}</p>')
    return "\n".join([*lines, "</section>"])


def _widths(table: Table) -> list[str]:
    """Columns of long texts share the width; others are left to the browser."""
    letters = table.letters(LETTERS)
    if letters.sum() < 0.95 * LETTERS:
        return []
    return ["<colgroup>", *(f'<col style="width: {100 * n / letters.sum():.1f}%"/>' for n in letters), "</colgroup>"]


def _data(cell: Cell, is_word: bool) -> str:
    """The number in SI units goes along for programs that read the sheet."""
    names = " ".join(name for name, there in (("word", is_word), ("alarm", cell.alarm)) if there)
    attributes = f' class="{names}"' if names else ""
    if cell.value is not None:
        attributes += f' data-si="{cell.value!r}"'
    return f"<td{attributes}>{escape(cell.text)}</td>"


def _figures(pictures: list[Picture]) -> list[str]:
    """On screen two in a row, on paper three, or two where no third follows; one that would stand alone has the row."""
    drawn: list[str] = []
    for whole, group in groupby(pictures, key=lambda picture: picture.wide):
        members = list(group)
        if whole or len(members) == 1:
            drawn += [_figure(picture, "wide whole" if whole else "wide") for picture in members]
            continue
        on_paper = ["half"] if len(members) in (2, 4) else []
        drawn += [_figure(picture, " ".join(["wide"] * _is_broad(picture) + on_paper)) for picture in members]
    return drawn


def _is_broad(picture: Picture) -> bool:
    width, height = picture.figure.get_size_inches()
    return bool(width > 1.45 * height and width > 8)


def _figure(picture: Picture, classes: str) -> str:
    width, _ = picture.figure.get_size_inches()
    kind = f' class="{classes}"' if classes else ""
    form, mime = ("png", "image/png") if picture.raster else ("svg", "image/svg+xml")
    stream = io.BytesIO()
    with rc_context({"svg.hashsalt": "linkdyn"}):
        picture.figure.savefig(stream, format=form, dpi=150, bbox_inches="tight", metadata={} if picture.raster else {"Date": None})
    data = base64.b64encode(stream.getvalue()).decode()
    caption = escape(picture.caption)
    return f'<figure{kind}><img style="width: {EM * width:.3g}em" alt="{caption}" src="data:{mime};base64,{data}"/><figcaption>{caption}</figcaption></figure>'
