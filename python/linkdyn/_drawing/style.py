"""Colours, dashes and units shared by all pictures."""

from __future__ import annotations

import math
import textwrap
from typing import Any

from .._printable import printable

__all__ = ["BAD", "COLOURS", "DIVERGING", "FRAME_COLOUR", "LINES", "SEQUENTIAL", "as_written", "fitting", "plain_units", "put_heading", "readable"]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Palette of Okabe and Ito, safe for colour-blind readers; its yellow is left out as too pale for lines."""

FRAME_COLOUR = "0.45"
SEQUENTIAL = "viridis"
DIVERGING = "PuOr"
"""Both keep their order for colour-blind readers and in grey."""
BAD = "#B2182B"
"""What is beyond a limit."""
LINES = ("-", "--", ":", "-.")


LETTER = 0.085
"""Width of a letter of a title [inch], with some room."""


def fitting(title: str, figure: Any) -> str:
    """A title, of one line or several, in lines that are no longer than the figure is wide."""
    letters = max(20, int(figure.get_size_inches()[0] / LETTER))
    return "\n".join(part for line in title.split("\n") for part in textwrap.wrap(printable(line), letters))


def put_heading(figure: Any, title: str, **style: Any) -> None:
    """Over a figure, as it is written: dollars in it are no formulas."""
    figure.suptitle(fitting(title, figure), parse_math=False, **style)


def as_written(legend: Any) -> None:
    """The same of the names in a legend."""
    for text in legend.get_texts():
        text.set_parse_math(False)


def plain_units(unit: str) -> str:
    """Unit as people write it in a picture."""
    return unit.replace("N m", "N·m").replace("s2", "s²")


def readable(unit: str, largest: float) -> tuple[float, str]:
    """Factor and unit in which people read numbers up to ``largest``: mm, deg, kN from 10 kN, MN from 10 MN on."""
    if unit == "1":
        return 1.0, ""
    if unit == "rad":
        return 180.0 / math.pi, "deg"
    if unit == "m" and largest < 10.0:
        return 1e3, "mm"
    if unit == "m/s" and largest < 0.1:
        return 1e3, "mm/s"
    if unit in ("N", "N m", "W", "J") and largest >= 1e7:
        return 1e-6, f"M{plain_units(unit)}"
    if unit in ("N", "N m", "W", "J") and largest >= 1e4:
        return 1e-3, f"k{plain_units(unit)}"
    return 1.0, plain_units(unit)
