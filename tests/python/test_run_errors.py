"""Errors that forward runs estimate: they hold, they are not vague, and they change nothing in the run."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import tomllib
from pathlib import Path

import linkdyn
import numpy as np
import pytest
import tomli_w
import xarray as xr
from linkdyn.cli import executable, quadruple_twin

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
sys.path[:0] = [str(ROOT / "tests" / "hard"), str(ROOT / "tests" / "python")]

from cases import slider_crank  # noqa: E402
from estimates import PROMISED, assert_holds, assert_not_vague, join_samples  # noqa: E402
from test_coordinate_switch import slider_crank as free_crank  # noqa: E402
from test_coordinate_switch import with_coordinates  # noqa: E402
from twin import QUANTITIES, quadruple_run, run_ratios  # noqa: E402

pytestmark = pytest.mark.accuracy

REFERENCES = json.loads((ROOT / "tests" / "reference" / "forward.json").read_text())
TWIN = quadruple_twin()
SETTINGS = [
    *((method, {"rtol": tolerance, "atol": tolerance})
      for method in ("rkf45", "rk8pd", "msbdf", "gbs", "seulex") for tolerance in (1e-4, 1e-7, 1e-10)),
    *((method, {"rtol": 1e-13, "atol": 1e-13}) for method in ("rk8pd", "gbs")),
    ("rk4", {"step": 1 / 128}), ("rk4", {"step": 1 / 1024}),
]  # fmt: skip


def example(name: str, changes: dict | None = None) -> linkdyn.Scene:
    scene = linkdyn.load(EXAMPLES / name / "scene.toml")
    return scene.with_(changes) if changes else scene


@pytest.mark.thorough
@pytest.mark.twin
def test_estimates_hold_against_the_twin() -> None:
    """As often as promised, and not vaguely: from loose tolerances to where rounding is all that is left."""
    together = {method: [] for method, _ in SETTINGS}
    for name, end in (("fourbar", 2.0), ("fivebar_motors", 0.5), ("fivebar_parallel", 0.5), ("stewart_taghirad", 1.0)):
        exact = quadruple_run(TWIN, EXAMPLES / name / "scene.toml", end, 33)
        for method, setting in SETTINGS:
            run = example(name).forward(t=exact["time"], method=method, error=True, **setting)
            assert run.attrs["stopped"] == ""
            together[method].append(run_ratios(run, exact))
    for method, ratios in together.items():
        assert_holds(join_samples(ratios), method, PROMISED)
        assert_not_vague(join_samples(ratios), method)


def folding_slider_crank(folder: Path) -> Path:
    """A free slider-crank whose rod is as long as its crank: both lie on each other, square to the slide, after 0.3 s."""
    scene = slider_crank("Rod as long as the crank", 1.0, 1.0, "J1")
    scene |= {"coordinate": [{"joint": "J1", "start": {"position": 0.7, "velocity": 3.0}}], "load": [], "actuator": []}
    file = folder / "scene.toml"
    file.write_text(tomli_w.dumps(scene))
    return file


@pytest.mark.thorough
@pytest.mark.twin
@pytest.mark.parametrize("name, end", [("near_parallelogram", 0.625), ("row", 1.0), ("slider_crank", 0.5)])
def test_estimates_near_change_points(name: str, end: float, tmp_path: Path) -> None:
    """Through the first change point, or close by it: no number that is given as right is further off than ten estimates,
    and no more of them than promised are further off than one."""
    if name == "slider_crank":
        file = folding_slider_crank(tmp_path)
    else:
        scenes = {"near_parallelogram": ROOT / "tests" / "python" / "scenes" / "near_parallelogram.toml",
                  "row": EXAMPLES / "n_fourbar" / "scene.toml"}  # fmt: skip
        file = scenes[name]
    exact = quadruple_run(TWIN, file, end, 33)
    ratios = []
    for method in ("rk8pd", "gbs"):
        for tolerance in (1e-9, 1e-12):
            run = linkdyn.load(file).forward(t=exact["time"], method=method, error=True, rtol=tolerance, atol=tolerance)
            assert run.attrs["stopped"] == ""
            given = run.status.values == 0
            assert given.sum() > 25
            ratios.append(np.where(given[:, np.newaxis], run_ratios(run, exact), np.nan))
    together = join_samples(ratios)
    assert np.nanmax(together) < 10
    assert_holds(together, name, PROMISED)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["fourbar_constant_torque", "rcsp_start", "andrews"])
def test_estimates_hold_against_references(name: str) -> None:
    """Solutions in 50 digits that share nothing with the engine: states at a few instants."""
    states = REFERENCES[name]["states"]
    scene = linkdyn.load(EXAMPLES / REFERENCES[name]["scene"])
    t = np.array([0.0, *(float(state["t"]) for state in states)])
    joints = scene.joints
    exact = {
        quantity: np.array([[float(x) for x in state[quantity]] for state in states])
        for quantity in ("q", "qd", "driving_force") if states[0][quantity]
    }
    exact["reaction"] = np.array([[[float(x) for x in state["reaction"][joint]] for joint in joints] for state in states])
    ratios = []
    for method, setting in SETTINGS:
        if method == "rk4":
            setting = {"step": (t[-1] - t[0]) * setting["step"]}
        run = scene.forward(t=t, method=method, error=True, **setting).isel(sample=slice(1, None))
        if "reaction" in exact:  # planar references have Fx Fy, too
            exact["reaction"] = exact["reaction"][..., : run.sizes["component"]]
        ratios.append(run_ratios(run, {"reaction": 0.0} | exact, tuple(exact)))
    assert_holds(join_samples(ratios), name, PROMISED)
    assert_not_vague(join_samples(ratios), name)


SLIDING = {
    "constant": {"type": "constant", "value": 30.0},
    "spring-damper": {"type": "spring-damper", "stiffness": 60.0, "damping": 2.0, "rest": 2.1},
    "pd": {"type": "pd", "stiffness": 200.0, "damping": 9.0, "target": {"law": "harmonic", "mean": 2.1, "amplitude": 0.2, "frequency": 2.0}},
    "table": {"type": "table", "table": "force.csv", "column": "F"},
}
TURNING = SLIDING | {
    "spring-damper": {"type": "spring-damper", "stiffness": 60.0, "damping": 2.0, "rest": 0.7},
    "pd": {"type": "pd", "stiffness": 200.0, "damping": 9.0, "target": 1.2},
}
EXAMPLES_OF_DRIVES = {
    "dc-motor": ("fivebar_motors", {}),
    "inverse, loads": ("fivebar_parallel", {}),
    "legs, pd": ("stewart_forward", {}),
    "springs at joints": ("flyball_governor", {}),
}


def driven(name: str, folder: Path) -> linkdyn.Scene:
    """A scene with a drive of this kind, sliding or turning, with loads and a spring."""
    if name in EXAMPLES_OF_DRIVES:
        return example(*EXAMPLES_OF_DRIVES[name])
    kind, joint = name.split()
    (folder / "force.csv").write_text("t [s],F\n0,0\n0.125,40\n0.25,-20\n0.5,10\n")
    scene = slider_crank(kind, 1.03, 2.0, joint)
    scene["coordinate"][0]["start"] = {"position": 2.2 if joint == "J4" else 1.0, "velocity": 0.3}
    scene["actuator"][0]["law"] = (SLIDING if joint == "J4" else TURNING)[kind]
    scene["frame"]["markers"]["W"] = [5.0, 1.0]
    scene["spring"] = [{"name": "S", "between": ["frame.W", "rod.B"], "stiffness": 40.0, "damping": 3.0, "rest": 2.0}]
    return linkdyn.Scene(scene, folder)


@pytest.mark.parametrize("name", [*(f"{kind} {joint}" for kind in SLIDING for joint in ("J4", "J1")), *EXAMPLES_OF_DRIVES])
def test_similar_mechanisms_move_alike(name: str, tmp_path: Path) -> None:
    """At a tight tolerance the companions, which are of other sizes, show rounding alone: 1e-16, times what a stiff spring
    (800,000 N/m) makes of it, times the factor of the estimate (20). A quantity that were not scaled would show by a
    quarter."""
    run = driven(name, tmp_path).forward(t=np.linspace(0.0, 0.25, 5), rtol=1e-13, atol=1e-13, method="gbs", error=True)
    assert run.attrs["stopped"] == ""
    for quantity in QUANTITIES:
        if quantity not in run:
            continue
        largest = float(np.abs(run[quantity]).max())
        assert float(run[f"{quantity}_error"].max()) < 1e-7 * max(largest, 1e-3), quantity
        # and they do round differently
        assert largest == 0 or float(run[f"{quantity}_error"].max()) > 0, quantity


@pytest.mark.parametrize(("method", "tolerance"), [("rk8pd", 1e-5), ("rkf45", 1e-8), ("msbdf", 1e-7), ("gbs", 1e-9)])
def test_coordinates_exchanged_on_the_way(method: str, tolerance: float) -> None:
    """A piston that drives the crank through its dead centres: companions exchange coordinates as the run does."""
    scene, t = linkdyn.Scene(with_coordinates(free_crank(), ("D",))), np.linspace(0.0, 0.25, 26)
    exact = scene.forward(t=t, rtol=1e-14, atol=1e-14)
    run = scene.forward(t=t, method=method, rtol=tolerance, atol=tolerance, error=True)
    assert "then angle of A" in run.attrs["coordinates_integrated"]
    for name in ("q", "qd", "reaction"):
        error, estimate = np.abs(run[name] - exact[name]).values, run[f"{name}_error"].values
        assert np.all(error <= estimate + 1e-11 * np.abs(exact[name]).max().item()), name
    assert float(run.q_error.max()) < 100 * float(np.abs(run.q - exact.q).max())


def test_the_run_stays_what_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Results are those of a run without estimates; pieces and pauses change nothing in either."""
    scene, t = example("fourbar_constant_torque"), np.linspace(0.0, 3.0, 31)
    plain = scene.forward(t=t)
    run = scene.forward(t=t, error=True)
    for name in plain.data_vars:
        np.testing.assert_array_equal(plain[name], run[name], err_msg=name)
    assert set(run.data_vars) - set(plain.data_vars) == {f"{name}_error" for name in QUANTITIES}
    monkeypatch.setattr("linkdyn.scene.RUN_BLOCK", 7)
    monkeypatch.setattr("linkdyn.scene.BREATH", 1e-4)
    pieces = scene.forward(t=t, error=True)
    for name in run.data_vars:
        # A sample's place among those computed side by side shows in the last place of a sum.
        np.testing.assert_allclose(run[name], pieces[name], 0, 1e-15 * float(np.abs(run[name]).max()), err_msg=name)


def test_a_stop_leaves_what_was_known() -> None:
    """From where the run stops there is neither value nor error."""
    changes = {"frame.markers.J1": [14.5, 0.0], "coordinate.J1.start": 2.6, "coordinate.J1.motion": None}
    scene = example("fourbar", changes | {"actuator.J1.law": {"type": "constant", "value": 0.0}})
    run = scene.forward(10.0, method="rk4", step=1e-2, error=True, switch=False)
    assert run.attrs["stopped"].startswith("stopped at t = ")
    good = np.isfinite(run.q.values[:, 0])
    assert good[0] and not good[-1]
    np.testing.assert_array_equal(np.isnan(run.q_error.values[:, 0]), ~good)


def test_command_line(tmp_path: Path) -> None:
    """The same numbers in netCDF and CSV, the worst one in the summary."""
    command = [executable(), "forward", EXAMPLES / "fourbar" / "scene.toml", "--until", "1", "--samples", "9", "--error"]
    netcdf = subprocess.run([*command, "-o", "run.nc"], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=True)
    subprocess.run([*command, "--csv", "-q", "-o", "run.csv"], cwd=tmp_path, timeout=60, check=True)
    want = example("fourbar").forward(t=np.linspace(0.0, 1.0, 9), error=True)
    header, *rows = csv.reader((tmp_path / "run.csv").open())
    with xr.open_dataset(tmp_path / "run.nc") as run:
        for name in QUANTITIES:
            np.testing.assert_array_equal(run[f"{name}_error"], want[f"{name}_error"], err_msg=name)
            assert run[f"{name}_error"].attrs == want[f"{name}_error"].attrs
        column = header.index("q_error J1 [rad]")
        assert [float(row[column]) for row in rows] == run.q_error.values[:, 0].tolist()
    summary = netcdf.stdout
    line = next(line for line in summary.splitlines() if line.strip().startswith("q [rad]"))
    worst = int(np.argmax(want.q_error.values[:, 0]))
    assert line.split()[2] == f"{want.q_error.values[worst, 0]:.1E}" and line.split()[5] == "J1"
    assert float(line.split()[4]) == pytest.approx(float(want.time[worst]), rel=1e-5)
    assert summary.count("(the worst)") == 1 and "1e-9 relative" in summary
