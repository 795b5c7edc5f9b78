"""Colours, dashes and units shared by all pictures."""

from __future__ import annotations

__all__ = ["COLOURS", "FRAME_COLOUR", "LINES", "plain_units"]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Palette of Okabe and Ito, safe for colour-blind readers; its yellow is left out as too pale for lines."""

FRAME_COLOUR = "0.45"
LINES = ("-", "--", ":", "-.")


def plain_units(unit: str) -> str:
    """Unit as people write it in a picture."""
    return unit.replace("N m", "N·m").replace("s2", "s²")
