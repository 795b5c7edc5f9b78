"""A stop lets go of a joint that sticks: what the stop kept at rest is asked whether friction holds it."""

from __future__ import annotations

from pathlib import Path

import linkdyn
import numpy as np
import pytest
import xarray as xr

SCENES = Path(__file__).parent / "scenes"


def happened(run: xr.Dataset, event: str) -> list[tuple[str, float]]:
    """Kind and instant of what has happened to it."""
    names = run.event_kind.attrs["flag_meanings"].split()
    values = np.atleast_1d(run.event_kind.attrs["flag_values"]).tolist()
    return [
        (names[values.index(kind)], t)
        for kind, t, name in zip(run.event_kind.values.tolist(), run.event_time.values.tolist(), run.event.values.tolist())
        if name == event
    ]


@pytest.mark.parametrize("method", ["rk8pd", "gbs", "seulex", "msbdf", "rkf45", "rk4"])
def test_it_sticks_and_breaks_loose(method: str) -> None:
    """Runs ended at the release, in steps of no length."""
    run = linkdyn.load(SCENES / "stop_lets_go.toml").forward(method=method)
    assert run.attrs["stopped"] == "" and (run.status.values == 0).all()
    # At rest at its stop the joint may be pressed there by more or less of its friction, so when the stop lets go of it nobody can
    # tell; when it turns away does not hang on that.
    leaves = max(t for kind, t in happened(run, "st.max") + happened(run, "E") if 0.6 < t < 0.65 and kind in ("release", "slip"))
    assert leaves == pytest.approx(0.6061138, abs=1e-7 if method in ("rk8pd", "gbs", "seulex", "rkf45") else 2e-4)


def test_as_where_friction_creeps() -> None:
    """Against the same joints whose friction is smooth near rest, without any decision who holds."""
    scene = linkdyn.load(SCENES / "stop_lets_go.toml")
    sticks = scene.forward()
    creeps = scene.with_({f"friction.{joint}.sticking": False for joint in "AEBD"}).forward(method="seulex")
    assert creeps.attrs["stopped"] == ""
    np.testing.assert_allclose(sticks.q.values[:, 1], creeps.q.values[:, 1], atol=5e-3)
    np.testing.assert_allclose(sticks.q.values[:, 0], creeps.q.values[:, 0], atol=5e-2)


def test_a_joint_that_a_brake_keeps_from_moving() -> None:
    """A brake holds the crank, and the ram's guide sticks besides: one of them led back to where it was caught, and the other not,
    was more than any push could do, and `msbdf`, whose Jacobian asks for it, ended."""
    scene = linkdyn.load(SCENES / "braked_press.toml")
    run, right = scene.forward(method="msbdf"), scene.forward()
    assert run.attrs["stopped"] == "" and (run.status.values == 0).all()
    np.testing.assert_allclose(run.q.values, right.q.values, atol=1e-7)
