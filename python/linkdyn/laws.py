"""Laws of motion for the scenes that `linkdyn.Builder` makes: each function gives the table of the scene file.

>>> from linkdyn import laws
>>> laws.harmonic(amplitude="20 mm", frequency="5 Hz")
{'law': 'harmonic', 'amplitude': '20 mm', 'frequency': '5 Hz'}

A law that is a number, or a text with its unit, stays at that value. Keys and defaults are those of
"Laws of time" in docs/scene-file.md; t is the time, u = (t - begin)/duration.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Literal

from ._listing import only
from ._scene_types import Quantity, Table, table_of

__all__ = ["constant", "constant_rate", "cycloidal", "cycloidal_start", "harmonic", "polynomial_345", "table"]
__dir__ = only(__all__)


def constant(value: Quantity) -> Table:
    """It stays.

    Parameters
    ----------
    value
        [m, rad], or what the law moves.
    """
    return _law("constant", locals())


def constant_rate(rate: Quantity, *, start: Quantity | None = None) -> Table:
    """Value start + rate t.

    Parameters
    ----------
    rate
        [m/s, rad/s]
    start
        Value at t = 0 [m, rad]; default: the coordinate's start.
    """
    return _law("constant-rate", locals())


def cycloidal_start(speed: Quantity, duration: Quantity, *, start: Quantity | None = None) -> Table:
    """From rest at t = 0 to a constant rate: speed (u - sin(2 pi u)/(2 pi)), then speed.

    Parameters
    ----------
    speed
        Rate that is reached [m/s, rad/s].
    duration
        How long that takes [s].
    start
        Value at t = 0 [m, rad]; default: the coordinate's start.
    """
    return _law("cycloidal-start", locals())


def cycloidal(
    *, from_: Quantity | None = None, to: Quantity | None = None, duration: Quantity | None = None, begin: Quantity | None = None,
    times: Sequence[Quantity] | None = None, values: Sequence[Quantity] | None = None,
) -> Table:  # fmt: skip
    """From rest to rest: from + (to - from)(u - sin(2 pi u)/(2 pi)).

    Parameters
    ----------
    from_, to
        Where it begins and ends [m, rad]; ``from_`` left out: the coordinate's start.
    duration, begin
        How long it takes, and when it begins [s]; ``begin`` left out: at 0.
    times, values
        Instead of the others: from rest to rest through all of them [s], [m, rad].
    """
    return _law("cycloidal", locals())


def polynomial_345(
    *, from_: Quantity | None = None, to: Quantity | None = None, duration: Quantity | None = None, begin: Quantity | None = None,
    times: Sequence[Quantity] | None = None, values: Sequence[Quantity] | None = None,
) -> Table:  # fmt: skip
    """From rest to rest: from + (to - from)(10 u^3 - 15 u^4 + 6 u^5).

    Parameters
    ----------
    from_, to
        Where it begins and ends [m, rad]; ``from_`` left out: the coordinate's start.
    duration, begin
        How long it takes, and when it begins [s]; ``begin`` left out: at 0.
    times, values
        Instead of the others: from rest to rest through all of them [s], [m, rad].
    """
    return _law("polynomial-345", locals())


def harmonic(amplitude: Quantity, frequency: Quantity, *, mean: Quantity | None = None, phase: Quantity | None = None) -> Table:
    """Value mean + amplitude sin(frequency t + phase).

    Parameters
    ----------
    amplitude, mean
        [m, rad]
    frequency
        Angular rate: a number is in rad/s, "2 Hz" is 4 pi rad/s.
    phase
        [rad]
    """
    return _law("harmonic", locals())


def table(
    table: str | os.PathLike[str], *, column: str | None = None, time: str | None = None, interpolation: Literal["spline", "linear"] | None = None,
    over: str | None = None, argument: str | None = None, period: Quantity | None = None,
) -> Table:  # fmt: skip
    """A column of a CSV file: over time, or, of loads and springs, over a measure.

    Parameters
    ----------
    table
        The file, beside the scene.
    column
        Its unit stands in the header; default: the name of the coordinate or component.
    time
        Column of the instants; default "t".
    interpolation
        Between rows; default: splines for motions, straight lines for forces.
    over
        Instead of ``time``: measure or law that the table is entered with.
    argument
        Column of the values of ``over``; default: as it is called.
    period
        The rows are one period of ``over``.
    """
    return table_of(locals())


def _law(name: str, keys: dict[str, Any]) -> Table:
    return {"law": name} | table_of(keys)
