"""Many forward runs at once: each member is the run it would be alone."""

from __future__ import annotations

from pathlib import Path

import linkdyn
import numpy as np
import pytest
import xarray as xr

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
TIMES = np.linspace(0.0, 0.2, 5)


@pytest.fixture(scope="module")
def motors() -> linkdyn.Scene:
    return linkdyn.load(EXAMPLES / "fivebar_motors" / "scene.toml")


def starts(scene: linkdyn.Scene, n: int) -> tuple[np.ndarray, np.ndarray]:
    home = scene.forward(t=[0.0], method="rk4").q.values
    rng = np.random.default_rng(1)
    return home + 0.05 * rng.normal(size=(n, home.shape[1])), 0.5 * rng.normal(size=(n, home.shape[1]))


def test_members_are_runs(motors: linkdyn.Scene) -> None:
    """Against `forward` by rk4 at the same step, one scene a member; more members than lanes, not a multiple of them."""
    q, qd = starts(motors, 37)
    many = motors.ensemble(q, qd, TIMES, step=2e-3)
    names = motors.coordinates
    for i in (0, 5, 36):
        start = {f"coordinate.{name}.start": {"position": q[i, k], "velocity": qd[i, k]} for k, name in enumerate(names)}
        alone = motors.with_(start).forward(t=TIMES, method="rk4", step=2e-3)
        # The same arithmetic but for its contraction on another lane, over a hundred steps.
        np.testing.assert_allclose(many.q.values[i], alone.q.values, rtol=0, atol=1e-12)
        np.testing.assert_allclose(many.qd.values[i], alone.qd.values, rtol=0, atol=1e-10)
    assert np.all(many.good_until == TIMES[-1])
    assert many.q.dims == ("member", "time", "coordinate")


def test_threads_change_nothing(motors: linkdyn.Scene) -> None:
    q, qd = starts(motors, 70)
    one, two = (motors.ensemble(q, qd, TIMES, step=2e-3, threads=n) for n in (1, 2))
    assert one.equals(two)


def test_one_bad_member(motors: linkdyn.Scene) -> None:
    """One that runs into a position where its motion is not determined is NaN from there; its neighbours are as they are without it."""
    q, qd = starts(motors, 3)
    good = motors.ensemble(q, qd, TIMES, step=2e-3)
    q[1] = [3.0, 0.1]
    mixed = motors.ensemble(q, qd, TIMES, step=2e-3)
    until = mixed.good_until.values[1]
    assert TIMES[0] < until < TIMES[-1]
    np.testing.assert_array_equal(np.isnan(mixed.q.values[1, :, 0]), until < TIMES)
    np.testing.assert_array_equal(mixed.q.values[[0, 2]], good.q.values[[0, 2]])
    assert status_names(good) == ["ok", "ok", "ok"]
    assert status_names(mixed)[0] == status_names(mixed)[2] == "ok" != status_names(mixed)[1]


def status_names(run: xr.Dataset) -> list[str]:
    names = run.status.attrs["flag_meanings"].split()
    return [names[value] for value in run.status.values]


def test_members_that_cannot_go_on_say_why() -> None:
    """A group that closes at the start alone ends every member there, each for its own reason and without a search that has no
    end; one that the step is too long for meets angles that no iteration can follow, or no numbers."""
    folding = linkdyn.load(Path(__file__).parent / "scenes" / "group_at_its_end.toml")
    start = folding.inverse(t=[0.0]).q.values
    run = folding.ensemble(np.repeat(start, 3, axis=0), np.zeros((3, start.shape[1])), np.linspace(0.0, 0.05, 3), step=0.0125)
    assert status_names(run) == ["unreachable"] * 3
    assert np.all(run.good_until < 0.05) and np.isnan(run.q.values[:, -1]).all()
    stiff = linkdyn.load(Path(__file__).parent / "scenes" / "stiff_spring.toml")
    run = stiff.ensemble([[0.0]], [[6.0]], [0.0, 1.0], step=1e-3)
    assert status_names(run)[0] in ("not_converged", "undefined") and run.good_until.values[0] < 1.0


def test_no_members(motors: linkdyn.Scene) -> None:
    assert motors.ensemble(np.empty((0, 2)), np.empty((0, 2)), TIMES).sizes["member"] == 0


def test_bad_input(motors: linkdyn.Scene) -> None:
    q, qd = starts(motors, 3)
    with pytest.raises(linkdyn.InputError, match="t: expected increasing instants"):
        motors.ensemble(q, qd, [0.1, 0.1])
    with pytest.raises(linkdyn.InputError, match="qd"):
        motors.ensemble(q, qd[:2], TIMES)
    with pytest.raises(linkdyn.InputError, match="step"):
        motors.ensemble(q, qd, TIMES, step=-1.0)
    q[2, 1] = np.nan
    with pytest.raises(linkdyn.InputError, match="J5"):
        motors.ensemble(q, qd, TIMES)


def test_members_that_all_stop_do_not_end_the_process() -> None:
    """Nobody watches for coordinates that could be exchanged: what the first member met is put into words all the same."""
    scene = linkdyn.load(Path(__file__).resolve().parents[1] / "scenes" / "hexaglide.toml")
    run = scene.forward(t=[0.0, 1e-4], method="rk4", step=1e-4)
    q, qd = (np.tile(run[name].values[0], (20, 1)) for name in ("q", "qd"))
    random = np.random.default_rng(3)
    runs = scene.ensemble(q + 1e-3 * random.standard_normal(q.shape), qd + 0.1 * random.standard_normal(q.shape), t=[0.0, 0.05, 0.1], step=1e-3)
    assert runs.status.shape == (20,) and np.all(runs.good_until <= 0.1)


def test_a_member_that_grows_beyond_all_numbers_is_undefined() -> None:
    """As a single run: of numbers near the largest friction cannot be found either, but that is not why it stops."""
    scene = linkdyn.Scene(
        {
            "space": "planar",
            "frame": {"markers": {"O": [0, 0]}},
            "link": [
                {"name": "a", "mass": 2.0, "inertia": 0.03, "cog": [0.3, 0], "markers": {"O": [0, 0], "A": {"at": [0.6, 0], "axis": [0.54, 0.84]}}},
                {"name": "b", "mass": 1.0, "inertia": 0.02, "markers": {"A": [0, 0]}},
            ],
            "joint": [
                {"name": "O", "type": "prismatic", "between": ["frame.O", "a.O"]},
                {"name": "A", "type": "prismatic", "between": ["a.A", "b.A"]},
            ],
            "coordinate": [{"joint": "O", "start": 0.2}, {"joint": "A", "start": 0.1}],
            "actuator": [{"joint": "O", "law": {"type": "spring-damper", "stiffness": -4e3, "damping": 0.0, "rest": 0.0}}],
            "friction": [{"joint": "A", "coulomb": 0.2}],
        }
    )
    t = np.linspace(0.0, 25.0, 5)
    alone = scene.forward(t=t, method="rk4", step=1e-3)
    assert "the motion grows without bound" in alone.attrs["stopped"]
    assert alone.status.values[-1] == 4
    assert scene.ensemble([[0.2, 0.1]], [[0.0, 0.0]], t, step=1e-3).status.values.tolist() == [4]
