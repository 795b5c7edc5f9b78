"""What may be demanded of error estimates, from how they are made and with what confidence.

An estimate is SAFETY times the larger of two differences: of a number from itself in two similar mechanisms, which round
otherwise (linkdyn_error_probe.f90). Take the errors of the three as independent and normal with one spread. Then the true
error is above r estimates where both copies happen to err alike,

    exceed(r) = E[ P(|x1 - x0| < |x0| / (SAFETY r))^2 ],

3.1e-4 for r = 1 and falling with r^2: whatever the spread, whoever adds up. Numbers of one sample err together, so a sample
is what is counted: it adds the share of its numbers that are above. The sum over independent samples scatters no more than
a binomial variable does.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import binom, norm

SAFETY = 20
"""Of linkdyn_error_probe.f90."""
PROMISED = 1e-3
"""Share of all numbers that may be above their estimate, as the documents say."""
ALARM = 1e-6
"""Chance that a right engine on another processor fails one assertion."""
TOO_CAREFUL = 100
"""Times the true error, the median estimate at most: demanded in docs/accuracy.md. The model's own median is 40."""


def exceed(r: float) -> float:
    """Share of true errors above r times their estimate."""
    x, weight = np.polynomial.hermite_e.hermegauss(80)
    reach = np.abs(x) / (SAFETY * r)
    return float(np.sum(weight * (norm.cdf(x + reach) - norm.cdf(x - reach)) ** 2) / np.sqrt(2 * np.pi))


def most(n: int, share: float) -> int:
    """How many of n may be out where that share is right: more come up once in 1/ALARM times."""
    return int(binom.isf(ALARM, n, share))


def join_samples(tables: list[np.ndarray]) -> np.ndarray:
    """Samples of several cases (N, width), one under the other."""
    width = max(table.shape[1] for table in tables)
    return np.concatenate([np.pad(table, ((0, 0), (0, width - table.shape[1])), constant_values=np.nan) for table in tables])


def above(ratio: np.ndarray, r: float = 1.0) -> float:
    """Number of samples above r times their estimate; a sample counts by the share of its numbers.

    Parameters
    ----------
    ratio
        (N, width) true error over estimate; NaN where a number is zero by nature.
    """
    counts = np.isfinite(ratio)
    return float(np.sum((counts & (ratio > r)).sum(axis=1) / np.maximum(counts.sum(axis=1), 1)))


def assert_holds(ratio: np.ndarray, what: str, share: float | None = None) -> None:
    """Estimates are above the true errors as often as they should be.

    Parameters
    ----------
    ratio
        As for `above`; infinite where an estimate is zero and the error is not.
    share
        That may be above; default: the model's, for errors of rounding, at once and three times over.
    """
    n = len(ratio)
    ratio = np.where(np.isinf(ratio), 1e300, ratio)
    for r, expected in ((1.0, exceed(1.0)), (3.0, exceed(3.0))) if share is None else ((1.0, share),):
        found = above(ratio, r)
        assert found <= most(n, expected), f"{what}: {found:.1f} of {n} samples above {r:g} times the estimate, at most {most(n, expected)} expected"


def assert_not_vague(ratio: np.ndarray, what: str) -> None:
    """The median estimate is not more careful than demanded."""
    middle = np.nanmedian(ratio)
    assert middle > 1 / TOO_CAREFUL, f"{what}: the median estimate is {1 / middle:.0f} times the true error"
