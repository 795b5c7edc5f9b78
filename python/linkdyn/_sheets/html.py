"""A sizing sheet as one self-contained file of HTML that is XML as well."""

from __future__ import annotations

import base64
import io
from html import escape

from matplotlib import rc_context

from .sheet import Cell, Page, Picture, Table

__all__ = ["html"]

LETTERS = 170
"""In a line of a table."""
EM = 7.5
"""Letters of the page's height in an inch of a picture: texts of 10 points in pictures are as large as those of the page, on screen and on paper."""
STYLE = """
@page { size: A4; margin: 11mm; }
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
figure.wide { grid-column: 1 / 3; }
figure img { max-width: 100%; max-height: 430px; object-fit: contain; }
figure.whole img { max-height: none; }
figcaption { color: #444; text-align: center; }
@media print { body { margin: 0; padding: 0; max-width: none; font-size: 7.4px; line-height: 1.22; } p.note { font-size: 6.4px; }
  h1 { font-size: 15px; } h2 { font-size: 9px; margin: 0; } section { margin-top: .55em; } td { padding: .05em .4em; }
  div.pictures { grid-template-columns: 1fr 1fr 1fr; gap: .3em; margin-top: .4em; } figure.wide { grid-column: auto; }
  figure.whole { grid-column: 1 / 4; } figure.whole img { max-height: none; }
  figure img { max-height: 175px; } }
"""


def html(page: Page) -> str:
    """The whole file."""
    body = [f"<h1>{escape(page.title)}</h1>", *(f'<p class="fact">{escape(line)}</p>' for line in page.lines)]
    body += _sections(page.tables)
    if page.pictures:
        body += ['<div class="pictures">', *(_figure(picture) for picture in page.pictures), "</div>"]
    body += ["<section>", *(f'<p class="note">{escape(note)}</p>' for note in page.notes), "</section>"] if page.notes else []
    head = f'<meta charset="utf-8"/>\n<title>{escape(page.title)}</title>\n<style>{STYLE}</style>'
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


def _figure(picture: Picture) -> str:
    width, height = picture.figure.get_size_inches()
    kind = ' class="wide whole"' if picture.wide else ' class="wide"' if width > 1.45 * height and width > 8 else ""
    form, mime = ("png", "image/png") if picture.raster else ("svg", "image/svg+xml")
    stream = io.BytesIO()
    with rc_context({"svg.hashsalt": "linkdyn"}):
        picture.figure.savefig(stream, format=form, dpi=150, bbox_inches="tight", metadata={} if picture.raster else {"Date": None})
    data = base64.b64encode(stream.getvalue()).decode()
    caption = escape(picture.caption)
    return f'<figure{kind}><img style="width: {EM * width:.3g}em" alt="{caption}" src="data:{mime};base64,{data}"/><figcaption>{caption}</figcaption></figure>'
