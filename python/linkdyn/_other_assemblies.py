"""Samples on their own whose assembly is not the one that a motion would have there.

Each has the branch of the start. Past a change point that is another assembly than the motion goes on in: of a parallelogram the crossed one.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from . import _bind

if TYPE_CHECKING:
    from .scene import Scene

APART = 1e-6
"""Places of links farther from each other than this share of the mechanism's size are two places: rounding makes less of them but at change points."""
MARKS = 1000
"""Samples that are followed to see whether a way passes anything; if so, all are."""


Stretch = tuple[float, float] | None
"""Of the one coordinate of a scene, over which the way from the start passes no change point."""


def count_others(scene: Scene, q: NDArray[np.float64], status: NDArray[np.intc], t: NDArray[np.float64] | None) -> int:
    """How many samples without fault lie in another assembly than the way from the start leads to, which a warning says, too.

    The way is looked at where it is plain which one is meant.

    Parameters
    ----------
    q
        (N, n) coordinates.
    status
        (N,) of the samples, each on its own.
    t
        Their instants, (N,) or (1,); None: there are none.
    """
    ends = _ends(q)
    if _lies_within(ends, scene._clear):
        return 0
    sound = np.flatnonzero(status == 0)
    way = _way(q[sound], None if t is None or len(t) == 1 else t[sound])
    if way is None:
        return 0
    if _passed(scene, _marks(way)) == 0:
        if len(sound) == len(q):
            scene._clear = _both(ends, scene._clear)
        return 0
    led, own = scene.poses(way, in_order=True), scene.poses(way, in_order=False)
    both = (led.status == 0) & (own.status == 0)
    reach = np.abs(own.position[both]).max(initial=0.0)
    others = both & (
        (np.abs(led.position - own.position).max(axis=(1, 2), initial=0.0) > APART * reach)
        | (np.abs(led.rotation - own.rotation).max(axis=(1, 2, 3), initial=0.0) > APART)
    )
    n = int(np.count_nonzero(others))
    if n > 0:
        warnings.warn(
            f"{n} of {len(q)} samples on their own lie past a change point, on the branch of the start: a motion goes on "
            "in another assembly there (expected in_order=True, if the samples follow each other)",
            stacklevel=3,
        )
    return n


def _ends(q: NDArray[np.float64]) -> Stretch:
    """Of the samples, if one coordinate leads."""
    return (float(q.min()), float(q.max())) if q.shape[1] == 1 and len(q) > 0 else None


def _lies_within(ends: Stretch, clear: Stretch) -> bool:
    return ends is not None and clear is not None and clear[0] <= ends[0] and ends[1] <= clear[1]


def _both(a: Stretch, b: Stretch) -> Stretch:
    """The stretch over both: the start lies between them."""
    return a if a is None or b is None else (min(a[0], b[0]), max(a[1], b[1]))


def _way(q: NDArray[np.float64], t: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """The samples one after the other; None if nothing says how they lie along one way."""
    if len(q) == 0:
        return None
    if q.shape[1] == 1:
        return np.sort(q, axis=0)
    return q if t is not None and bool(np.all(np.diff(t) > 0)) else None


def _marks(way: NDArray[np.float64]) -> NDArray[np.float64]:
    """Samples that pass what all of them pass: of one coordinate some of many do, and of several but for excursions between them."""
    if len(way) <= MARKS:
        return way
    marks: NDArray[np.float64] = way[np.linspace(0, len(way) - 1, MARKS).round().astype(int)]
    return marks


def _passed(scene: Scene, way: NDArray[np.float64]) -> int:
    """Change points on the way from the start through these samples."""
    still, n_load = np.zeros(way.shape), len(scene.loads)
    inputs = (way, still, still, np.zeros((1, n_load, _bind.LOAD_WIDTH)), np.zeros(1), _bind.NO_ATTITUDE)
    engine = _bind.Inverse(scene._handle, "elimination", ())
    _, passed, _, _ = engine.run(1, 0, True, inputs, {"status": np.empty(len(way), dtype=np.intc)})
    return passed
