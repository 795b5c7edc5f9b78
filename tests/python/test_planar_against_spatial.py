"""The same plane mechanism declared planar and declared spatial: the same forces, both by the elimination."""

from __future__ import annotations

import linkdyn
import numpy as np
import planar_against_spatial as bench
import pytest
from report import ROOT

pytestmark = pytest.mark.accuracy


@pytest.mark.parametrize("case", [bench.slider_crank(), bench.arm(3), bench.arm(7)], ids=["slider-crank", "arm", "long arm"])
def test_same_forces(case) -> None:
    scene, kinds = case
    planar, spatial = linkdyn.Scene(scene), linkdyn.Scene(bench.as_spatial(scene, kinds))
    # Rounding of each link's equations adds up along the chain.
    assert bench.largest_difference(planar, spatial, 201) <= 64 * len(planar.links) * np.finfo(float).eps


@pytest.mark.parametrize("n", [6, 10, 16])
def test_a_long_arm_keeps_its_road_with_driving_forces_alone(n: int) -> None:
    """Rows were turned into each other for reactions nobody wants, while those to be solved for first found no pivot: all samples fell to
    the dense solver from eight links on."""
    spatial = linkdyn.Scene(bench.as_spatial(*bench.arm(n)))
    motion = dict(zip(("q", "qd", "qdd"), spatial.motion(np.linspace(0, 2, 5001)), strict=True))
    alone, beside = (spatial.inverse(**motion, want=want) for want in ("driving_force", ["driving_force", "reaction"]))
    assert alone.attrs["samples_dense"] == beside.attrs["samples_dense"] == 0    # no pivot vanishes between the poses it was chosen at
    size = np.abs(beside.driving_force.values).max()
    assert np.abs(alone.driving_force.values - beside.driving_force.values).max() <= 64 * n * np.finfo(float).eps * size


@pytest.mark.parametrize("scene", ["examples/rcsp_start/scene.toml", "tests/scenes/bevel_differential.toml"])
def test_no_pivot_changes_its_sign_where_rows_can_be_turned(scene: str) -> None:
    """Pivots with both signs at the poses they were chosen at were taken: in between, one sample in a thousand was solved densely."""
    scene = linkdyn.Scene(ROOT / scene)
    t = np.linspace(scene.description["time"]["first"], scene.description["time"]["last"], 20000)
    alone, beside = (scene.inverse(t=t, want=want) for want in ("driving_force", ["driving_force", "reaction"]))
    assert alone.attrs["samples_dense"] == beside.attrs["samples_dense"] == 0
    size = np.abs(beside.driving_force.values).max()
    assert np.abs(alone.driving_force.values - beside.driving_force.values).max() <= 4096 * np.finfo(float).eps * size


def test_links_that_turn_all_the_way_round_have_pivots() -> None:
    """The spatial slider-crank: no entry of the cylindrical joint's columns stays away from zero over a turn."""
    scene, kinds = bench.slider_crank()
    spatial = linkdyn.Scene(bench.as_spatial(scene, kinds))
    assert "pivots watched" in spatial.explain() and "dense solver" not in spatial.explain()
    q, qd, qdd = spatial.motion()
    ours = spatial.inverse(q=q, qd=qd, qdd=qdd).reaction.values
    theirs = spatial.inverse(q=q, qd=qd, qdd=qdd, solver="lapack").reaction.values
    assert np.abs(ours - theirs).max() <= 1e3 * np.finfo(float).eps * np.abs(theirs).max()
