"""Near change points and dead points: what has lost its digits is flagged, by every solver alike."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkdyn

sys.path.insert(0, str(Path(__file__).parents[1] / "hard"))

from cases import four_bar  # noqa: E402

SOLVERS = ("elimination", "lapack", "gauss-jordan", "reduced")


def dyad() -> dict[str, Any]:
    return four_bar("Parallelogram", 1.0, 2.0, 1.0, 2.0) | {"load": []}


def group_in_the_plane() -> dict[str, Any]:
    """The coordinate is between crank and coupler, and turns against the crank."""
    scene = dyad()
    poses = [([0.0, 0.0], 1.0), ([float(np.cos(1.0)), float(np.sin(1.0))], 0.0), ([2.0, 0.0], 1.0)]
    scene["link"] = [link | {"start": {"position": at, "angle": angle}} for link, (at, angle) in zip(scene["link"], poses)]
    scene["joint"] = [{key: value for key, value in joint.items() if key != "branch"} for joint in scene["joint"]]
    return scene | {"coordinate": [{"joint": "J2", "start": -1.0}], "actuator": [{"joint": "J2"}]}


def group_in_space() -> dict[str, Any]:
    return tomllib.loads((Path(__file__).parents[1] / "scenes" / "rusr_parallelogram.toml").read_text())


@pytest.mark.parametrize(("make", "sense", "inertia", "coupler", "flagged"), [
    # Crank of 2 kg and follower of 3 kg turn about their ends, the coupler of 5 kg moves along a circle.
    (dyad, 1, (2 + 3) * (0.1 + 0.5**2 + 0.0625**2) + 5, 5, 5e-4),
    (group_in_the_plane, -1, (2 + 3) * (0.1 + 0.5**2 + 0.0625**2) + 5, 5, 2e-3),
    (group_in_space, 1, 2 * (0.09 + 0.5**2) + 2, 2, 2e-3),
])
@pytest.mark.parametrize("angle", 10.0 ** -np.arange(1.0, 13.0))
def test_change_point_of_a_parallelogram(
    make: Callable[[], dict[str, Any]], sense: int, inertia: float, coupler: float, flagged: float, angle: float
) -> None:
    """The parallelogram moves as its crank, so its torque is known by hand; it is right to three digits, or none is given. Of
    the solvers none says otherwise than the others, whether links are placed in closed form or by iteration."""
    scene = linkdyn.Scene(make() | {"gravity": [0.0] * (3 if make is group_in_space else 2)})
    rate2 = 3.0
    q = sense * np.array([[np.pi - 0.5], [np.pi - angle]])
    states = {"q": q, "qd": [[sense * 4.0]] * 2, "qdd": [[sense * rate2]] * 2, "t": [0.0, 1.0]}
    found = []
    for solver in SOLVERS:
        run = scene.inverse(**states, solver=solver)
        found.append(int(run.status.values[-1]))
        if found[-1] == 0:
            want = sense * inertia * rate2
            # An error of the accelerations is one of forces of the coupler along the bars: its mass, 16 m/s^2.
            assert abs(run.driving_force.values[-1, 0] - want) < 1e-3 * (abs(want) + coupler * 16)
        else:
            assert np.isnan(run.driving_force.values[-1]).all()
    assert len(set(found)) == 1
    assert (found[0] == 0) == (angle > flagged)
