"""What is wrong with an answer, in words; nothing if nothing is.

Status 0 means right: numbers beside it are finite, two solvers that share only the equations agree to within their estimates,
and so do two integrators, whose motion has the forces that inverse dynamics finds for it. What is refused is refused by one of
the package's own errors, in one line that names a place.
"""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path

import linkdyn
import numpy as np
import xarray as xr

MAY_BE_INFINITE = re.compile(r"error$|singularity_distance|growth")
"""An estimate is infinite where it says nothing; no singular position may be near; a pivot may be zero."""
PLACE = re.compile(r"'[^']*'|\"[^\"]*\"|^\w+( \w+)*(\[[^]]*\])*(, \w+)*:|line \d+|^[^\s:]+:(\d+:)? |^\w+ = |\[[\w.]+\]|^-{1,2}[a-z]|t = ")
"""A quoted name or key, an argument, a line, a file, a table, an option, an instant."""
LONGEST = 600
MARGIN = 100.0
"""Times both estimates, by which two solvers may differ: one estimate in a thousand is too small, by a factor of three."""
MOTION_MARGIN = 30.0
"""The same for integrators, whose estimates are of the whole run."""
LEAST_OF_MOTION = 1e-7
"""Less of the largest number of a sample, or of a radian, metre or newton, is no finding."""
RETURNED = 1e-6
"""Of the sample's largest force: what rounding may make of forces near singular positions."""
LEAST = 1e-9
"""Of the sample's largest force: less is no finding. With `singular` in sight estimates themselves have few digits."""


def message(text: str) -> list[str]:
    """One line of printable characters with a place in it."""
    wrong = []
    if "\n" in text.strip("\n") or not text.strip():
        wrong.append("not one line")
    if any(unicodedata.category(character) in ("Cc", "Cs") for character in text.strip("\n")):
        wrong.append("control characters")
    if len(text) > LONGEST:
        wrong.append(f"{len(text)} characters long")
    if not PLACE.search(text):
        wrong.append("no place")
    return [f"message with {', '.join(wrong)}: {text[:300]!r}"] if wrong else []


def raised(error: BaseException) -> list[str]:
    """An error that reached the caller."""
    if isinstance(error, linkdyn.MissingFileError):     # a text without line ends is a path
        return []
    if isinstance(error, linkdyn.LinkdynError):
        return message(str(error))
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    where = f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}" if trace else "?"
    return [f"raw {type(error).__name__} from {where}: {str(error)[:200]}"]


def numbers(run: xr.Dataset) -> list[str]:
    """Every number of a good sample is one."""
    if "status" not in run:
        return []
    good = run.status.values == 0
    wrong = []
    for name, values in run.variables.items():
        if values.dtype.kind != "f" or values.dims[:1] != ("sample",):
            continue
        of_good = values.values[good]
        bad = np.isnan(of_good) if MAY_BE_INFINITE.search(str(name)) else ~np.isfinite(of_good)
        if bad.any():
            wrong.append(f"{name} is {of_good[bad].flat[0]} beside status 0 (sample {np.flatnonzero(good)[np.argwhere(bad)[0][0]]})")
    return wrong


def forces(run: xr.Dataset, suffix: str = "") -> np.ndarray:
    """(N, width)"""
    n = run.sizes["sample"]
    names = [name for name in ("driving_force", "reaction") if name in run]
    return np.concatenate([run[name + suffix].values.reshape(n, -1) for name in names], axis=1)


def agree(one: xr.Dataset, other: xr.Dataset) -> list[str]:
    """Two solvers, the same samples, both with estimates."""
    good = (one.status.values == 0) & (other.status.values == 0)
    if not good.any():
        return []
    ours, theirs = forces(one)[good], forces(other)[good]
    with np.errstate(all="ignore"):
        # the worst of the batch: of one number alone the two copies behind an estimate may agree by chance
        relative = MARGIN * (one.error.values[good].max() + other.error.values[good].max())
        # forces beside moments: the largest of a sample is a scale for both, where lengths are of order one
        allowed = max(relative, LEAST) * np.abs(ours).max(axis=1, initial=0, keepdims=True)
        # a sample whose estimate is above one claims no digit
        claims = np.maximum(one.error.values[good], other.error.values[good]) < 1
        bad = (np.abs(ours - theirs) > allowed) & claims[:, np.newaxis]
    if not bad.any():
        return []
    i, k = np.argwhere(bad)[0]
    return [f"{one.attrs['solver']} gives {ours[i, k]:.9g}, {other.attrs['solver']} {theirs[i, k]:.9g}, both with status 0 and relative errors "
            f"below {relative / MARGIN:.2g}"]


def motions_agree(one: xr.Dataset, other: xr.Dataset) -> list[str]:
    """Two integrators, the same instants, both with estimates."""
    if "event" in one.dims:                     # which ends a run, or adds instants that methods find each for itself
        return []
    if not np.array_equal(one.time.values, other.time.values):
        return [f"{one.attrs['method']} has {one.sizes['time']} samples, {other.attrs['method']} {other.sizes['time']}"]
    good = (one.status.values == 0) & (other.status.values == 0)
    wrong = []
    for name in ("q", "qd", "qdd", "driving_force"):
        if f"{name}_error" not in one or f"{name}_error" not in other:
            continue
        ours, theirs, our_error, their_error = (run[key].values[good] for key in (name, f"{name}_error") for run in (one, other))
        with np.errstate(all="ignore"):
            allowed = MOTION_MARGIN * (our_error + their_error) + LEAST_OF_MOTION * (1 + np.abs(ours).max(axis=1, initial=0, keepdims=True))
            bad = np.abs(ours - theirs) > allowed
        if bad.any():
            at = tuple(np.argwhere(bad)[0])
            wrong.append(f"{name} is {ours[at]:.9g} by {one.attrs['method']}, {theirs[at]:.9g} by {other.attrs['method']}, both with status 0 "
                         f"and errors below {our_error[at] + their_error[at]:.2g}")
    return wrong


def returns(forward: xr.Dataset, inverse: xr.Dataset) -> list[str]:
    """Inverse dynamics of the good samples of a forward run: the forces that moved it."""
    good = forward.status.values == 0
    applied, found = forward.driving_force.values[good], inverse.driving_force.values
    reactions = np.abs(forward.reaction.values[good]).reshape(len(applied), -1)
    scale = np.maximum(np.abs(applied).max(axis=1, initial=0), reactions.max(axis=1, initial=0))
    bad = (np.abs(applied - found) > RETURNED * (1 + scale[:, np.newaxis])) & (inverse.status.values == 0)[:, np.newaxis]
    if not bad.any():
        return []
    i, k = np.argwhere(bad)[0]
    return [f"inverse dynamics finds {found[i, k]:.9g} where {applied[i, k]:.9g} was applied, both with status 0"]
