"""CSP groups next to where the slide touches the cylinder: what is given as right is right, what cannot be known is flagged."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn.cli import executable, quadruple_twin

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "hard"))

from cases import Case  # noqa: E402
from twin import run_states  # noqa: E402

pytestmark = pytest.mark.accuracy

TWIN = quadruple_twin()
CRANK = 0.125
LEAST_DIGITS = 1e-3
"""Relative error with which a force is still given as right (docs/theory.md, "What rounding leaves of a motion")."""


def crank_and_slide(coupler: float, offset: float, tilt: float = 0.0, branch: int = 1) -> dict[str, Any]:
    """A crank, 0.125 m, that carries the axis of a cylindrical joint; a slide along x at a distance from its own axis.

    Along the crank's axis, without tilt, it is a slider-crank: at the crank angle q the slide runs at the distance
    \\|offset - 0.125 sin q\\| from the cylinder, whose radius is the coupler's.
    """
    axis = [0.0, math.sin(tilt), math.cos(tilt)]
    return {
        "title": "Crank, coupler and slide",
        "space": "spatial",
        "gravity": [0.0, -9.81, 0.0],
        "frame": {"markers": {"R": [0.0, 0.0, 0.0], "P": {"at": [0.0, offset, 0.0], "axis": [1.0, 0.0, 0.0]}}},
        "link": [
            {"name": "crank", "mass": 1.0, "cog": [0.05, 0.0, 0.0], "inertia": {"diagonal": [0.001, 0.002, 0.002]},
             "markers": {"R": [0.0, 0.0, 0.0], "C": {"at": [CRANK, 0.0, 0.0], "axis": axis}}},
            {"name": "coupler", "mass": 2.0, "cog": [0.4 * coupler, 0.0, 0.01], "inertia": {"diagonal": [0.001, 0.01, 0.01]},
             "markers": {"C": [0.0, 0.0, 0.0], "S": [coupler, 0.0, 0.0]}},
            {"name": "output", "mass": 3.0, "cog": [0.0, 0.0, 0.0], "inertia": {"diagonal": [0.01, 0.01, 0.01]},
             "markers": {"P": {"at": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0]}, "S": [0.0, 0.0, 0.0]}},
        ],
        "joint": [
            {"name": "R", "type": "revolute", "between": ["frame.R", "crank.R"]},
            {"name": "C", "type": "cylindrical", "between": ["crank.C", "coupler.C"]},
            {"name": "S", "type": "spherical", "between": ["coupler.S", "output.S"], "branch": branch},
            {"name": "P", "type": "prismatic", "between": ["frame.P", "output.P"]},
        ],
        "coordinate": [{"joint": "R"}],
        "actuator": [{"joint": "R"}],
    }  # fmt: skip


CHANGE = -math.pi / 2
"""Where the coupler lies along the crank and square to the slide: the two assemblies cross."""
DEAD = math.asin(-0.5)
"""Beyond, the slide of the last scene misses the cylinder."""
SCENES = {
    "change point": (crank_and_slide(CRANK + 0.25, 0.25), CHANGE),
    "change point of equal links": (crank_and_slide(CRANK, 0.0), CHANGE),
    "dead point": (crank_and_slide(0.25, 0.1875), DEAD),
}


@pytest.mark.twin
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("solver", ["elimination", "lapack", "gauss-jordan", "reduced"])
def test_forces_are_right_or_flagged(name: str, solver: str) -> None:
    """From 1e-2 rad to 1e-10 rad off, at any speed and acceleration: three digits at least, against quadruple precision. At a
    dead point forces grow and keep their digits; at a change point they stay small and lose them."""
    scene, angle = SCENES[name]
    distance = np.repeat(10.0 ** -np.arange(2, 11), 8)
    rng = np.random.default_rng(1)
    shape = (len(distance), 1)
    case = Case(name, name, scene, (angle + distance)[:, np.newaxis], rng.uniform(-2, 2, shape), rng.uniform(-5, 5, shape), distance)
    want = ("driving_force",) if solver == "reduced" else ("driving_force", "reaction")
    run, exact = (run_states(program, case, "--want", ",".join(want), solver=by) for program, by in ((executable(), solver), (TWIN, "lapack")))
    forces, true = (np.concatenate([results[part] for part in want], axis=1) for results in (run, exact))
    good = run["status"][:, 0] == "ok"
    assert good[distance > 5e-3].all() and (name == "dead point") == good.all()
    assert np.all(exact["status"][good, 0] == "ok")
    assert np.all(np.isnan(forces[~good]))
    assert np.all(np.abs(forces - true)[good].max(axis=1) < LEAST_DIGITS * np.abs(true)[good].max(axis=1))


@pytest.mark.parametrize("samples", [40, 361, 2881])
def test_assembly_goes_through_a_change_point(samples: int) -> None:
    """Crank and coupler of one length, the slide through the crank's axis: it goes to 2 r cos q, through zero to the other side,
    whatever the stride. The other assembly stays at zero."""
    scene = crank_and_slide(CRANK, 0.0)
    scene["coordinate"][0]["motion"] = {"law": "constant-rate", "rate": "60 rpm", "start": 0.3}
    run = linkdyn.Scene(scene).inverse(t=np.linspace(0.0, 2.0, samples), want="joint_variable")
    good = run.status.values == 0
    slide = run.joint_variable.sel(variable=[v for v in run["variable"].values if str(v).startswith("P")]).values[:, 0]
    assert good.mean() > 0.95
    assert np.abs(slide - 2 * CRANK * np.cos(run.q.values[:, 0]))[good].max() < 1e-9
    assert np.sum(run["assembly"].values == 1) == 4    # of `flag_meanings`: change_point


@pytest.mark.parametrize("excess", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("samples", [40, 2881])
def test_assembly_stays_on_its_side(samples: int, excess: float) -> None:
    """The coupler is longer by a little: the slide stays on one side of the crank's axis."""
    scene = crank_and_slide(CRANK * (1 + excess), 0.0)
    scene["coordinate"][0]["motion"] = {"law": "constant-rate", "rate": "60 rpm", "start": 0.3}
    run = linkdyn.Scene(scene).inverse(t=np.linspace(0.0, 2.0, samples), want="joint_variable")
    good = run.status.values == 0
    q = run.q.values[:, 0]
    exact = CRANK * (np.cos(q) + np.sqrt((1 + excess) ** 2 - np.sin(q) ** 2))
    slide = run.joint_variable.sel(variable=[v for v in run["variable"].values if str(v).startswith("P")]).values[:, 0]
    assert good.mean() > 0.95
    # next to where it touches an error of the radius moves the slide by its root
    assert np.abs(slide - exact)[good].max() < 1e-7
