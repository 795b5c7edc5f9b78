"""Planar inverse dynamics against independent 50-digit solutions (tests/reference/planar_oracle.py)."""
from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import linkdyn

pytestmark = pytest.mark.accuracy

ROOT = Path(__file__).resolve().parents[2]
REFERENCES = json.loads((ROOT / "tests" / "reference" / "planar.json").read_text())

# Rounded inputs (1 ulp each) and condition numbers up to 3,000.
PROMISED = 1e-12


@pytest.mark.parametrize("solver", ["elimination", "gauss-jordan", "lapack"])
@pytest.mark.parametrize("name", REFERENCES)
def test_forces(name, solver):
    """All reactions and driving torques, relative to the largest reaction of the state."""
    states = REFERENCES[name]
    scene = linkdyn.load(ROOT / "examples" / name)
    q, qd, qdd = (np.array([state[key] for state in states]) for key in ("q", "qd", "qdd"))
    run = scene.inverse(q=q, qd=qd, qdd=qdd, solver=solver)
    reactions = np.array([[[float(f) for f in r] for r in state["reaction"].values()] for state in states])
    torques = np.array([[float(t) for t in state["driving_force"]] for state in states])
    scale = np.abs(reactions).max(axis=(1, 2))
    assert np.all(np.abs(run.reaction.values - reactions).max(axis=(1, 2)) <= PROMISED * scale)
    assert np.all(np.abs(run.driving_force.values - torques).max(axis=1) <= PROMISED * scale)
