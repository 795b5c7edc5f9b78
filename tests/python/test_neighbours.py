"""What a sample gives depends on the sample alone, to the last bit, whatever is computed beside it."""

from __future__ import annotations

from pathlib import Path

import linkdyn
import numpy as np
import pytest

pytestmark = pytest.mark.lanes

ROOT = Path(__file__).resolve().parents[2]
SCENES = [scene for scene in map(linkdyn.load, sorted(ROOT.glob("examples/*/scene.toml")))
          if len(scene.actuators) == len(scene.coordinates) and not scene.description["wants_instants"]]
SPOILED = 5
"""The sample made unreachable, or far out of the range in which sines are quick."""


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: Path(scene.description["file"]).parent.name)
@pytest.mark.parametrize("solver", ["elimination", "gauss-jordan", "reduced"])
def test_neighbours_keep_every_bit(scene: linkdyn.Scene, solver: str) -> None:
    if solver == "reduced" and "[[friction]]" in scene.text:
        pytest.skip("friction comes of reactions")
    first, last = scene.times()[[0, -1]]
    q, qd, qdd = scene.motion(np.linspace(first, last, 16))
    want = "driving_force" if solver == "reduced" else "all"
    before = scene.inverse(q=q, qd=qd, qdd=qdd, solver=solver, want=want)
    q[SPOILED] += 1e7
    after = scene.inverse(q=q, qd=qd, qdd=qdd, solver=solver, want=want)
    others = [i for i in range(16) if i != SPOILED]
    for name in set(before.data_vars) - {"q"}:
        if "sample" in before[name].dims:
            a, b = (run[name].isel(sample=others).values for run in (before, after))
            np.testing.assert_array_equal(a, b, err_msg=name)
