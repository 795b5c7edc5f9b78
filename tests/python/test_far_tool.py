"""A tool far from a loop says nothing of the loop: it is computed as fast, and as surely, as one without."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn.cli import quadruple_twin
from test_idle_spin import rssr

sys.path.insert(0, str(Path(__file__).parents[1] / "hard"))

from cases import Case  # noqa: E402
from estimates import assert_holds, join_samples  # noqa: E402
from twin import forces_of, quadruple_forces, ratio_to_estimate, true_errors  # noqa: E402

FAR = 1000.0       # [m] of a loop of one
T = np.linspace(0.0, 1.0, 400)
TWIN = quadruple_twin()
FEW = 40           # states of each scene: the twin takes its time

pytestmark = pytest.mark.accuracy


def with_tool(at: float) -> dict[str, Any]:
    """A rocker that carries a small tool on a boom of no mass."""
    scene = rssr()
    scene["link"][2]["markers"]["T"] = [0.0, at, 0.0]
    scene["link"].append({"name": "tool", "mass": 1e-3, "inertia": {"diagonal": [1e-6] * 3}, "markers": {"T": [0.0, 0.0, 0.0]}})
    scene["joint"].append({"name": "T", "type": "fixed", "between": ["rocker.T", "tool.T"]})
    return scene


def in_one_piece(at: float) -> dict[str, Any]:
    """The same with the tool's mass in the rocker."""
    scene = rssr()
    rocker = scene["link"][2]
    masses = np.array([1.5, 1e-3])
    places = np.array([[rocker["cog"][0], 0.0, 0.0], [0.0, at, 0.0]])
    cog = masses @ places / masses.sum()
    inertia = np.diag([0.001, 0.05, 0.05]) + 1e-6 * np.eye(3)
    for m, p in zip(masses, places - cog, strict=True):
        inertia += m * (p @ p * np.eye(3) - np.outer(p, p))
    rocker |= {"mass": masses.sum(), "cog": cog.tolist(), "inertia": [*np.diag(inertia).tolist(), inertia[0, 1], inertia[1, 2], inertia[2, 0]]}
    return scene


def test_it_is_left_to_the_record() -> None:
    """Code is made of records alone, where samples are surely certain: none was, and 8 of 9 parts of the time went to the lanes."""
    scene = linkdyn.Scene(with_tool(FAR))
    assert "driving_force" in scene.generate("inverse", want=["driving_force"]).header
    record, lanes = (scene.inverse(t=T, solver=solver) for solver in ("elimination", "gauss-jordan"))
    assert (record.status == 0).all() and (lanes.status == 0).all()
    scale = np.abs(lanes.reaction.values).max()
    assert np.abs(record.reaction - lanes.reaction).max() < 1e-10 * scale


def test_forces_are_those_of_one_piece() -> None:
    run, whole = (linkdyn.Scene(make(FAR)).inverse(t=T) for make in (with_tool, in_one_piece))
    assert (run.status == 0).all() and (whole.status == 0).all()
    np.testing.assert_allclose(run.driving_force.values, whole.driving_force.values, rtol=0, atol=1e-10 * np.abs(whole.driving_force.values).max())


def far_from_the_world() -> dict[str, Any]:
    """The loop on a carriage that stands far away: places round as they are far, which margins do not tell."""
    scene = rssr()
    scene["frame"]["markers"]["O"] = {"at": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0]}
    scene["link"].append({"name": "carriage", "mass": 1.0, "inertia": {"diagonal": [1.0] * 3},
                          "markers": {"O": {"at": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0]}, **{k: scene["frame"]["markers"][k] for k in "AD"}}})
    scene["joint"].append({"name": "O", "type": "prismatic", "between": ["frame.O", "carriage.O"]})
    for joint in scene["joint"][:4]:
        joint["between"] = [name.replace("frame", "carriage") for name in joint["between"]]
    scene["coordinate"].append({"joint": "O", "motion": {"law": "constant-rate", "start": FAR, "rate": 0.0}})
    scene["actuator"].append({"joint": "O"})
    return scene


@pytest.mark.twin
def test_estimates_hold() -> None:
    """Errors of forces against 34 digits are below their estimates as often as elsewhere, where the status is 0."""
    together = []
    for name, spec in (("tool", with_tool(FAR)), ("carriage", far_from_the_world())):
        rng = np.random.default_rng(8)
        q = rng.uniform(-3.0, 3.0, size=(FEW, len(spec["coordinate"])))
        q[:, 1:] = FAR
        qd, qdd = rng.normal(size=(2, *q.shape))
        case = Case(name, name, spec, q, qd, qdd, np.full(len(q), np.nan))
        run = linkdyn.Scene(spec).inverse(q=q, qd=qd, qdd=qdd, want="driving_force,reaction", error=True)
        assert (run.status == 0).all()
        together.append(ratio_to_estimate(true_errors(forces_of(run), quadruple_forces(TWIN, case)), forces_of(run, "_error")))
    assert_holds(join_samples(together), "far")
