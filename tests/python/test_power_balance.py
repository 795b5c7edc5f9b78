"""`power_imbalance` is a share of the powers that could be at work: rounding where forces balance each other or push across
the way, and what it says of a force that is wrong."""

from __future__ import annotations

import numpy as np
import pytest

import linkdyn

SOLVERS = ("elimination", "gauss-jordan", "lapack", "reduced")
ROUNDING = 1e-13


def scene_of(*, gravity: tuple[float, float], centre: float, far: float) -> linkdyn.Scene:
    """A crank at an even pace whose far end carries a link that turns against it; centre: of mass, along the crank from its
    end, which is its origin."""
    b = linkdyn.Builder("crank", "planar", gravity=gravity)
    crank = b.link("crank", mass=3, inertia=0.2, cog=(centre, 0), markers={"end": (0, 0), "hub": (-0.7, 0)})
    wheel = b.link("wheel", mass=far, inertia=0.1 * far, markers={"pin": (0, 0)})
    b.revolute("hinge", b.frame.marker("O", (0.3, 0.1)), crank["hub"])
    b.revolute("pin", crank["end"], wheel["pin"])
    for joint, speed in (("hinge", 3.7), ("pin", -5.3)):
        b.coordinate(joint, motion=linkdyn.laws.constant_rate(rate=speed, start=0.2))
        b.actuator(joint)
    return b.scene()


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(
    "scene",
    [
        dict(gravity=(0, 0), centre=0.1, far=2.0),  # every force goes across the way
        dict(gravity=(0, 0), centre=-0.7, far=0.0),  # no force at all: the centre lies on the hinge, the origin does not
        dict(gravity=(0, -9.81), centre=-0.7, far=0.0),  # gravity on what stands in balance
    ],
    ids=["across", "balanced", "weight"],
)
def test_rounding_is_no_imbalance(scene: dict, solver: str) -> None:
    run = scene_of(**scene).inverse(t=np.linspace(0, 2, 41), solver=solver)
    assert (run.status == 0).all()
    assert np.abs(run.power_imbalance.values).max() < ROUNDING


def test_nothing_moves_nothing_balances() -> None:
    run = scene_of(gravity=(0, -9.81), centre=0.1, far=2.0).inverse(q=[[0.3, 0.4]], qd=[[0, 0]], qdd=[[0, 0]])
    assert run.power_imbalance.values == 0
