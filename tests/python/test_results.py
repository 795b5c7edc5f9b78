"""Runs at hand: their index, `run.linkdyn`, what notebooks show, and what loads with the package."""

from __future__ import annotations

import csv
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import linkdyn
from linkdyn import cli
from linkdyn._geometry.postures import scene_of

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def test_time_is_the_index(run):
    at = run.sel(time=0.5, method="nearest")
    assert at.driving_force.dims == ("actuator",)
    place = int(np.argmin(np.abs(run.time.values - 0.5)))
    np.testing.assert_array_equal(at.driving_force, run.driving_force[place])
    part = run.sel(time=slice(0.5, 1.0))
    assert 0 < part.sizes["sample"] < run.sizes["sample"] and part.time.min() >= 0.5


def test_a_forward_run_too():
    run = linkdyn.load(EXAMPLES / "fourbar_constant_torque" / "scene.toml").forward(0.2)
    assert run.sel(time=0.1, method="nearest").q.sizes == {"coordinate": 1}


def test_batches_have_no_time(scene):
    assert "time" not in scene.inverse(scene.motion()[0]).indexes


def test_tables_of_the_scene_are_found_again(tmp_path, monkeypatch):
    """The scene in a run's attributes names its tables by paths from its folder, or beside the results."""
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    run = linkdyn.load(EXAMPLES / "stewart_drilling" / "scene.toml").inverse(t=np.linspace(2.0, 3.0, 5))
    assert set(run.linkdyn.joint("leg1.P").data_vars) and scene_of(run, "test").loads
    run.to_netcdf(tmp_path / "run.nc")
    alone = linkdyn.read(tmp_path / "run.nc")
    with pytest.raises(linkdyn.InputError, match=r"test: the scene in the run's attributes cannot be read, give scene= .*motion\.csv"):
        scene_of(alone, "test")
    for table in (EXAMPLES / "stewart_drilling").glob("*.csv"):
        shutil.copy(table, tmp_path)
    assert scene_of(alone, "test").loads == scene_of(run, "test").loads


def test_poses_are_told_in_a_line():
    scene = linkdyn.load(EXAMPLES / "stewart_tsai" / "scene.toml")
    q = scene.motion()[0][:3].copy()
    assert repr(scene.poses(q)) == "<linkdyn.Poses: 3 samples>"
    fourbar = linkdyn.load(EXAMPLES / "slider_crank" / "scene.toml")
    assert repr(fourbar.poses(fourbar.motion()[0][:1])) == "<linkdyn.Poses: 1 sample>"


def test_a_whole_table_is_no_value(scene):
    with pytest.raises(linkdyn.InputError, match=r"with_: 'link.platform' is a whole link \(expected a table or None for it, or the path of one"):
        scene.with_({"link.platform": 2.0})


def test_read(run, tmp_path):
    run.to_netcdf(tmp_path / "run.nc")
    again = linkdyn.read(tmp_path / "run.nc")
    assert again.equals(run) and "time" in again.indexes
    (tmp_path / "empty.nc").write_text("")
    for name in ("empty.nc", "nowhere.nc"):
        with pytest.raises(linkdyn.FileError, match=name):
            linkdyn.read(tmp_path / name)


def test_worst_reaction(run):
    worst = run.linkdyn.worst()
    force = np.linalg.norm(run.reaction.sel(joint="leg3.U", component=["Fx", "Fy", "Fz"]), axis=-1)
    assert worst.loc["leg3.U", "force"] == pytest.approx(force.max(), rel=1e-14)
    assert worst.loc["leg3.U", "force_time"] == run.time.values[force.argmax()]
    assert list(worst.index) == list(run.joint.values)


def test_worst_of_nothing():
    with pytest.raises(linkdyn.InputError, match="worst: there are no results of samples .expected a run"):
        xr.Dataset().linkdyn.worst()


def test_worst_keeps_the_sign(run):
    shifted = run.assign(driving_force=run.driving_force - 20.0)
    worst = shifted.linkdyn.worst("driving_force")
    assert (worst.value < 0).all() and set(worst.unit) == {"N"}
    assert worst.loc["leg1.P", "value"] == float(run.driving_force.sel(actuator="leg1.P").min()) - 20.0


def test_worst_without_failed_samples(crossing):
    run = linkdyn.Scene(crossing).inverse()
    worst = run.linkdyn.worst("driving_force")
    assert np.isfinite(worst.value).all() and 2.0 not in set(worst.time)
    nowhere = run.isel(sample=[2]).linkdyn.worst("driving_force")
    assert nowhere.value.isna().all() and nowhere.time.isna().all()


def test_worst_refuses(run):
    with pytest.raises(linkdyn.InputError, match="no 'heat'"):
        run.linkdyn.worst("heat")


def test_joint(run):
    leg = run.linkdyn.joint("leg2.P")
    np.testing.assert_array_equal(leg.driving_force, run.driving_force.sel(actuator="leg2.P"))
    np.testing.assert_array_equal(leg.reaction, run.reaction.sel(joint="leg2.P"))
    assert list(leg.variable.values) == ["leg2.P.slide"]
    assert "driving_force" not in run.linkdyn.joint("leg2.U")
    with pytest.raises(linkdyn.InputError, match="no 'leg9'"):
        run.linkdyn.joint("leg9")


def test_table(run):
    table = run.linkdyn.to_frame()
    assert len(table) == run.sizes["sample"] and table.index.name == "time [s]"
    np.testing.assert_array_equal(table["driving_force leg1.P [N]"], run.driving_force.sel(actuator="leg1.P"))
    np.testing.assert_array_equal(table["reaction leg3.S Fy [N]"], run.reaction.sel(joint="leg3.S", component="Fy"))
    np.testing.assert_array_equal(table["qd platform.yaw [rad/s]"], run.qd.sel(coordinate="platform.yaw"))
    assert table["driving_speed leg1.P [m/s]"].notna().all() and table.columns.is_unique
    assert set(table["status"]) == {"ok"}


def read_table(file: Path) -> dict[str, list[float] | list[str]]:
    """Columns by name; numbers to the last bit."""
    with file.open(newline="") as lines:
        names, *rows = csv.reader(lines)
    columns = dict(zip(names, zip(*rows)))
    return {name: list(map(float, values)) if values[0][-1:].isdigit() else list(values) for name, values in columns.items()}


def test_tables_in_files(run, scene, tmp_path):
    """The same columns, numbers and words as the executable writes; the executable takes them as states."""
    program = [cli.executable(), "inverse", EXAMPLES / "stewart_tsai" / "scene.toml", "-q", "--csv", "-o", tmp_path / "own.csv"]
    subprocess.run(program, check=True)
    own = read_table(tmp_path / "own.csv")
    assert read_table(run.linkdyn.to_csv(tmp_path / "run.csv")) == own
    stored = pd.read_parquet(run.linkdyn.to_parquet(tmp_path / "run.parquet")).reset_index()
    assert {name: list(stored[name]) for name in stored} == own
    subprocess.run([*program[:-1], tmp_path / "again.csv", "--states", tmp_path / "run.csv"], check=True)
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "own.csv").read_bytes()
    with pytest.raises(linkdyn.FileError, match="nowhere/run.csv: cannot be written"):
        run.linkdyn.to_csv(tmp_path / "nowhere" / "run.csv")


def test_tables_hold_any_word_and_number(tmp_path):
    """Words that need quotes, in columns anywhere; numbers of all sizes, to the last bit; more rows than are made at a time."""
    from linkdyn._accessor import _as_csv

    n = 20_001
    rng = np.random.default_rng(2)
    numbers = rng.normal(size=n) * 10.0 ** rng.integers(-300, 300, n)
    numbers[:4] = [np.nan, np.inf, -np.inf, -0.0]
    word = np.array(['he said "no"', "a, b", "", "Türen"])
    table = pd.DataFrame({"x, y [m]": numbers, "word": word[np.arange(n) % 4], "n": np.arange(n), "other": word[np.arange(n) % 3]},
                         index=pd.Index(0.001 * np.arange(n), name="time [s]"))
    (tmp_path / "table.csv").write_bytes(_as_csv(table))
    again = pd.read_csv(tmp_path / "table.csv", index_col=0, keep_default_na=False, na_values={"x, y [m]": ["NaN"]}, dtype={"word": object, "other": object})
    pd.testing.assert_frame_equal(again, table.astype({"word": object, "other": object}), check_exact=True)
    assert _as_csv(table.iloc[:0]).decode() == 'time [s],"x, y [m]",word,n,other\n'


def test_parquet_without_its_library(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(linkdyn.UnavailableError, match=r"pip install 'linkdyn\[parquet\]'"):
        run.linkdyn.to_parquet(tmp_path / "run.parquet")


def test_pictures_by_the_accessor(tmp_path):
    run = linkdyn.load(EXAMPLES / "fourbar" / "scene.toml").inverse()
    assert run.linkdyn.view(tmp_path / "run.html").file.exists()
    assert run.linkdyn.animate(tmp_path / "run.gif", frames=2).exists()


def test_notebooks_show_it_in_short(scene, run):
    for shown in (scene._repr_html_(), run.linkdyn._repr_html_()):
        assert "Stewart platform of Tsai" in shown and len(shown) < 2500 and "[[" not in shown
    assert "15.26 N, leg4.P" in run.linkdyn._repr_html_()
    examples = Path(__file__).resolve().parents[2] / "examples"
    ship = linkdyn.load(examples / "ship_hexapod" / "scene.toml")       # as people write them: 1.296e+04 kg, 3.575e+04 N
    assert "13 moving, 12960 kg" in ship._repr_html_() and "35.75 kN, leg2.P" in ship.inverse().linkdyn._repr_html_()
    assert "−95.74 kN·m, J1" in linkdyn.load(examples / "fourbar" / "scene.toml").inverse().linkdyn._repr_html_()
    assert "&lt;b&gt;" in scene.with_({"title": "<b>"})._repr_html_()


def test_the_prompt_shows_it_in_one_line(scene, run):
    fourbar = linkdyn.load(EXAMPLES / "fourbar" / "scene.toml")
    assert repr(fourbar).endswith("3 links, 4 joints, 1 coordinate, 1 actuator>")
    words = repr(run.linkdyn)
    assert "241 samples" in words and "\n" not in words
    for name in words.rpartition("; ")[2].rstrip(">").split(", "):
        assert callable(getattr(run.linkdyn, name))


def test_what_users_see():
    assert {"load", "Scene", "view", "plot", "sheet", "read", "lecture", "widget"} <= set(dir(linkdyn))
    assert not [name for name in dir(linkdyn) if name.startswith("_") and name != "__version__"]
    assert all(getattr(linkdyn, name) is not None for name in dir(linkdyn))
    with pytest.raises(AttributeError, match="no attribute 'wind'"):
        linkdyn.wind


def modules_after(code: str) -> set[str]:
    done = subprocess.run([sys.executable, "-c", f"{code}; import sys; print(*sys.modules)"], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_import_loads_nothing_large():
    assert not {"numpy", "xarray", "pandas", "matplotlib", "linkdyn._engine"} & modules_after("import linkdyn")
    assert not {"numpy", "linkdyn._engine", "argparse", "subprocess"} & modules_after("import linkdyn.cli")


@pytest.mark.parametrize("code", ["import xarray, linkdyn", "import linkdyn, xarray", "import linkdyn; linkdyn.read; import xarray"])
def test_the_accessor_is_there(code):
    assert "linkdyn._accessor" in modules_after(f"{code}; xarray.Dataset().linkdyn")


def test_as_a_module():
    done = subprocess.run([sys.executable, "-m", "linkdyn", "--version"], capture_output=True, text=True)
    assert done.stdout == f"linkdyn {linkdyn.__version__}\n"
