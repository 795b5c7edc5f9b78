"""A line on the terminal that says how far a long run is."""

from __future__ import annotations

import math
import sys
import time

__all__ = ["Progress"]

PATIENCE, REFRESH = 2.0, 0.5
"""Seconds without a sign of life, and between two signs."""


class Progress:
    """Share done and time left, on standard error.

    Parameters
    ----------
    is_wanted
        None: if standard error is a terminal.
    """

    def __init__(self, is_wanted: bool | None) -> None:
        self._is_wanted = sys.stderr.isatty() if is_wanted is None else is_wanted
        self._start = self._last = time.monotonic()
        self._is_shown = False

    def show(self, share: float) -> None:
        """Share of the run that is done, 0 to 1; nothing is shown in a short run."""
        now = time.monotonic()
        elapsed = now - self._start
        if not self._is_wanted or elapsed < PATIENCE or now - self._last < REFRESH or share <= 0:
            return
        self._last = now
        self._is_shown = True
        left = math.ceil(elapsed * (1 - share) / share)
        print(f"\r{int(100 * share):4d} % done, {left} s left   ", end="", file=sys.stderr, flush=True)

    def end(self) -> None:
        """Wipe the line."""
        if self._is_shown:
            print("\r" + " " * 40 + "\r", end="", file=sys.stderr, flush=True)
