"""The Dataset from Python and the executable's files are one and the same."""

from __future__ import annotations

import subprocess
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import linkdyn
from linkdyn.cli import executable


@pytest.fixture(scope="module", params=["all", "driving_force,power", "reaction"])
def both(request, tsai_file: Path, tmp_path_factory) -> tuple[xr.Dataset, xr.Dataset]:
    """The same run from Python and from the executable's netCDF file."""
    file = tmp_path_factory.mktemp("run") / "run.nc"
    subprocess.run([executable(), "inverse", tsai_file, "-q", "-o", file, "--want", request.param], check=True)
    with xr.open_dataset(file) as stored:
        return linkdyn.load(tsai_file).inverse(want=request.param), stored.load()


def test_same_variables_values_and_coordinates(both):
    ours, stored = both
    xr.testing.assert_equal(ours, stored)
    assert set(ours.coords) == set(stored.coords)
    assert {name: v.dims for name, v in ours.variables.items()} == {name: v.dims for name, v in stored.variables.items()}


def test_same_units_and_meanings(both):
    ours, stored = both
    for name in ours.variables:
        assert set(ours[name].attrs) == set(stored[name].attrs), name
        for key, value in ours[name].attrs.items():
            np.testing.assert_array_equal(value, stored[name].attrs[key])
    for name in ours.data_vars:
        assert ours[name].attrs["units"] and ours[name].attrs["long_name"]


def test_same_global_attributes(both, tsai_file):
    ours, stored = both
    assert set(ours.attrs) == set(stored.attrs)
    for name in set(ours.attrs) - {"history"}:
        np.testing.assert_array_equal(ours.attrs[name], stored.attrs[name])
    assert stored.attrs["scene"] == tsai_file.read_text()
    assert "linkdyn inverse" in stored.attrs["history"]


def test_scene_from_results_gives_the_same_results(both):
    _, stored = both
    again = linkdyn.Scene(stored.attrs["scene"]).inverse(want=[n for n in ("reaction",) if n in stored] or "driving_force")
    for name in set(again.data_vars) & set(stored.data_vars):
        np.testing.assert_allclose(again[name], stored[name], rtol=1e-9, atol=1e-9)


def test_flags(tsai_file):
    status = linkdyn.load(tsai_file).inverse().status
    meanings = dict(zip(status.attrs["flag_values"], status.attrs["flag_meanings"].split()))
    assert meanings == {0: "ok", 1: "unreachable", 2: "singular", 3: "not_converged", 4: "undefined", 5: "branch_lost", 6: "locked"}


def test_results_survive_a_netcdf_file_of_their_own(tsai_file, tmp_path):
    run = linkdyn.load(tsai_file).inverse()
    run.to_netcdf(tmp_path / "again.nc")
    with xr.open_dataset(tmp_path / "again.nc") as stored:
        xr.testing.assert_equal(run, stored)


def test_compressed_file_holds_the_same(tsai_file, tmp_path):
    for name, options in (("plain.nc", []), ("small.nc", ["--compress"])):
        subprocess.run([executable(), "inverse", tsai_file, "-q", "-o", tmp_path / name, *options], check=True)
    with xr.open_dataset(tmp_path / "plain.nc") as plain, xr.open_dataset(tmp_path / "small.nc") as small:
        xr.testing.assert_equal(plain, small)
        assert small.reaction.encoding["zlib"] and not plain.reaction.encoding["zlib"]


def test_runs_share_nothing_that_can_be_changed(tsai_file):
    scene = linkdyn.load(tsai_file)
    q, qd, qdd = scene.motion([0.0, 0.5])
    wrench = {"platform.P1": np.ones(6)}
    first, untouched = scene.inverse(q, qd, qdd, wrench=wrench), scene.inverse(q, qd, qdd, wrench=wrench)
    first["joint"].attrs["note"] = first["status"].attrs["note"] = first.attrs["note"] = "mine"
    with pytest.raises(ValueError):
        first["status"].attrs["flag_values"][:] = 7
    first.coords["joint"] = range(first.sizes["joint"])
    first["driving_force"][:] = 0.0
    for name in set(untouched.coords) - set(untouched.indexes):
        with pytest.raises(ValueError):
            untouched[name].values[:] = "mine"
    for name in untouched.indexes:
        with suppress(ValueError):                                 # or it goes to a copy
            first[name].values[:] = first[name].values[0]
    again = scene.inverse(q, qd, qdd, wrench=wrench)
    for run in (untouched, again):
        run.attrs.pop("history")
    assert again.identical(untouched)
    assert again.sel(joint=again["joint"].values[2], component="Fz")["reaction"].shape == (2,)
    along = scene.inverse()
    assert along.sel(time=0.5, method="nearest")["driving_force"].shape == (6,)
    assert along["time"].attrs["units"] == "s"


def test_batches_of_one_length_are_as_the_first(tsai_file):
    scene = linkdyn.load(tsai_file)
    q, qd, qdd = scene.motion(np.linspace(0.0, 1.0, 5))
    marker = "platform.center"
    for wrench in (None, {marker: np.ones(6)}, {marker: np.ones((5, 6))}):
        first = linkdyn.load(tsai_file).inverse(q, qd, qdd, wrench=wrench).drop_attrs(deep=False)
        for _ in range(4):
            run = scene.inverse(q, qd, qdd, wrench=wrench)
            xr.testing.assert_identical(run.drop_attrs(deep=False), first)
            run["joint"].attrs["note"] = run["status"].attrs["note"] = run.attrs["note"] = run.encoding["note"] = "mine"
            run["driving_force"][:] = 0.0
            run["joint_variable"].values[:] = 0.0
            run.coords["joint"] = range(run.sizes["joint"])
        assert "note" not in (again := scene.inverse(q, qd, qdd, wrench=wrench)).attrs | again.encoding
    assert len(scene.inverse(q[:3]).sample) == 3


def test_one_load_for_all_is_the_same_load_for_each(tsai_file):
    scene = linkdyn.load(tsai_file)
    q, qd, qdd = scene.motion(np.linspace(0.0, 1.0, 40))
    load = np.arange(1.0, 7.0)
    for solver in ("elimination", "lapack"):
        for t in (None, 0.25):
            one = scene.solve(q, qd, qdd, wrench={"platform.center": load}, t=t, want=None, solver=solver)
            each = scene.solve(q, qd, qdd, wrench={"platform.center": np.tile(load, (40, 1))}, t=t, want=None, solver=solver)
            assert all(np.array_equal(one[name], each[name], equal_nan=True) for name in each)
