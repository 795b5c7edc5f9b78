"""The error that a forward run has gathered since its start, from a second, finer run."""

from __future__ import annotations

import numpy as np
import xarray as xr

__all__ = ["add_errors", "finer"]

QUANTITIES = ("q", "qd", "qdd", "driving_force", "reaction", "joint_rate")
"""What an error is given for."""
FINEST = 1e-14
"""Tolerance below which steps only gather rounding."""


def finer(method: str, settings: tuple[float, float, float]) -> tuple[float, float, float]:
    """Step, rtol and atol of the second run: half the step, or a hundredth of the tolerances."""
    step, rtol, atol = settings
    if method == "rk4":
        return step / 2, rtol, atol
    return step, max(rtol / 100, min(rtol, FINEST)), max(atol / 100, min(atol, FINEST))


def add_errors(run: xr.Dataset, reference: xr.Dataset, method: str) -> xr.Dataset:
    """The run with variables "q_error", "reaction_error", ...: the size of its difference from the finer run.

    A run of order 4 at half the step has a sixteenth of the error, so that the difference is 15/16 of it; that of an
    adaptive run at a hundredth of the tolerance is small against it.
    """
    part = 16 / 15 if method == "rk4" else 1.0
    for name in QUANTITIES:
        if name not in run:
            continue
        difference = (run[name] - reference[name]).values
        if name == "q":  # orientations may jump by a turn
            is_angle = (run["coordinate_unit"] == "rad").values
            difference[:, is_angle] -= 2 * np.pi * np.round(difference[:, is_angle] / (2 * np.pi))
        attributes = {"long_name": f"estimated error of {name}", "units": run[name].attrs["units"]}
        run[f"{name}_error"] = (run[name].dims, part * np.abs(difference), attributes)
    run.attrs["error_estimate"] = "against half the step" if method == "rk4" else "against a hundredth of the tolerances"
    return run
