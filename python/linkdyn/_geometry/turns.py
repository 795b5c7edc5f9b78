"""Whole turns between samples, by how fast an angle changes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["turned_on"]

Values = NDArray[np.float64]


def turned_on(angle: Values, rate: Values, time: Values) -> Values:
    """An angle that goes on from sample to sample, of one that is known but for whole turns.

    From one sample to the next it turns by about the mean of its rates at both, however many turns that are; where a rate is not known
    by the nearest way, which is wrong from half a turn on.

    Parameters
    ----------
    angle
        (N,) [rad], each but for whole turns.
    rate
        (N,) [rad/s].
    time
        (N,) [s].
    """
    expected = np.nan_to_num(np.diff(time) * (rate[1:] + rate[:-1]) / 2)
    steps = np.diff(angle)
    steps = steps + 2 * np.pi * np.round((expected - steps) / (2 * np.pi))
    found: Values = angle[0] + np.concatenate([[0.0], np.cumsum(steps)])
    return found
