"""Labelled values are known by their labels: whatever order xarray or pandas have put them in, the mechanism is the same."""

from __future__ import annotations

from pathlib import Path

import linkdyn
import numpy as np
import pytest
import xarray as xr


@pytest.fixture(scope="module")
def arm() -> linkdyn.Scene:
    return linkdyn.new("arm")


@pytest.fixture(scope="module")
def run(arm: linkdyn.Scene) -> xr.Dataset:
    return arm.inverse()


@pytest.mark.parametrize("dimension", ["coordinate", "actuator", "joint", "variable"])
def test_what_is_sorted_by_name_is_the_same_run(run: xr.Dataset, dimension: str) -> None:
    for mixed in (run.sortby(dimension), run.sortby(dimension, ascending=False), run.transpose()):
        np.testing.assert_allclose(mixed.linkdyn.marker("hand.tool").position, run.linkdyn.marker("hand.tool").position, atol=1e-12)
        np.testing.assert_allclose(mixed.linkdyn.shaking().force, run.linkdyn.shaking().force, atol=1e-9)
        np.testing.assert_allclose(mixed.linkdyn.contributions().driving_force.sel(actuator="elbow"),
                                   run.linkdyn.contributions().driving_force.sel(actuator="elbow"), atol=1e-9)


def test_motions_are_put_in_order(arm: linkdyn.Scene, run: xr.Dataset) -> None:
    mixed = run.sortby("coordinate")
    assert list(mixed.coordinate.values) != list(arm.coordinates)
    again = arm.inverse(q=mixed.q, qd=mixed.qd, qdd=mixed.qdd)
    np.testing.assert_allclose(again.driving_force, run.driving_force, rtol=1e-12)
    few = run.isel(sample=[0, 50, 100])
    np.testing.assert_allclose(arm.solve(few.q.T, few.qd.T, few.qdd.T)["driving_force"], few.driving_force, rtol=1e-12)
    table = run.q.to_pandas()[["wrist", "elbow", "shoulder"]]
    np.testing.assert_array_equal(arm.solve(table)["driving_force"], arm.solve(run.q.values)["driving_force"])
    np.testing.assert_array_equal(arm.poses(mixed.q).position, arm.poses(run.q.values).position)


def test_other_labels_are_refused(arm: linkdyn.Scene, run: xr.Dataset) -> None:
    renamed = run.q.assign_coords(coordinate=["a", "b", "c"])
    with pytest.raises(linkdyn.InputError, match="q: its labels are a, b, c \\(expected shoulder, elbow, wrist, in any order"):
        arm.solve(renamed)
    with pytest.raises(linkdyn.InputError, match="masked"):
        arm.solve(np.ma.masked_array(np.zeros((2, 3)), [[1, 0, 0], [0, 0, 0]]))


@pytest.mark.parametrize("dimension", ["joint", "actuator", "variable"])
def test_what_is_cut_to_one_is_told(run: xr.Dataset, dimension: str) -> None:
    one = run.sel({dimension: str(run[dimension].values[0])})
    for call in (one.linkdyn.worst, one.linkdyn.to_frame, one.linkdyn.energy, one.linkdyn.shaking):
        with pytest.raises(linkdyn.InputError, match=f"nothing but {dimension} .* left"):
            call()


def test_time_may_lead(run: xr.Dataset) -> None:
    by_time = run.swap_dims(sample="time")
    assert by_time.linkdyn.worst().equals(run.linkdyn.worst())
    with pytest.raises(linkdyn.InputError, match="marker: the run is one sample"):
        run.sel(time=0.5, method="nearest").linkdyn.marker("hand.tool")


def test_what_was_taken_away_is_empty_in_tables(run: xr.Dataset) -> None:
    some = run.where(run.time < 0.5).linkdyn.to_frame()
    assert set(some["status"]) == {"ok", ""}


def test_sweeps_are_netcdf(tmp_path: Path) -> None:
    scene = linkdyn.new("hexapod")
    with pytest.raises(linkdyn.InputError, match="written as netCDF"):
        scene.sweep(output=tmp_path / "w.csv")
    with pytest.raises(linkdyn.InputError, match="no results of samples"):
        scene.sweep().linkdyn.to_frame()


def test_a_sheet_is_of_its_own_machine(run: xr.Dataset, tmp_path: Path) -> None:
    with pytest.raises(linkdyn.InputError, match="other coordinates than the run"):
        linkdyn.sheet(run, tmp_path / "w.html", scene=linkdyn.new("four-bar"))


def test_runs_of_simulators_are_runs(arm: linkdyn.Scene, tmp_path: Path) -> None:
    simulator = arm.simulator()
    told = simulator.run(lambda _: [20.0, 5.0, 1.0], 0.1, 0.01)
    assert set(told.linkdyn.worst("driving_force").unit) == {"N m"}
    told.linkdyn.view(tmp_path / "v.html")
    with pytest.raises(linkdyn.InputError, match="no accelerations"):
        told.linkdyn.sheet(tmp_path / "s.html")
    with pytest.raises(AttributeError):
        simulator.t = 1.0  # type: ignore[misc]
