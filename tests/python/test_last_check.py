"""Nothing that is not finite stands beside a good outcome, whatever computes or writes it; what a run tells of its samples."""

from __future__ import annotations

import copy
import math
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
import xarray as xr

import linkdyn
from linkdyn.cli import executable

ROOT = Path(__file__).parents[2]
SAMPLES_FAILED = 3


def arm(**spring: Any) -> dict[str, Any]:
    """A bar that turns by t; a spring from its tip to the place where the tip is at t = 0."""
    return {
        "space": "planar",
        "gravity": [0.0, -9.81],
        "frame": {"markers": {"A": [0.0, 0.0], "G": [1.0, 0.0]}},
        "link": [{"name": "arm", "mass": 1.0, "cog": [0.5, 0.0], "inertia": 0.1, "markers": {"A": [0.0, 0.0], "T": [1.0, 0.0]}}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "arm.A"]}],
        "coordinate": [{"joint": "A", "motion": {"law": "constant-rate", "rate": 1.0}}],
        "actuator": [{"joint": "A"}],
        "spring": [{"name": "return", "between": ["frame.G", "arm.T"], "stiffness": 100.0, **spring}],
        "time": {"end": 0.4, "samples": 5},
    }


NO_DIRECTION = [{"rest": 0.2}, {"damping": 3.0}, {"rest": 0.2, "damping": 3.0}]


def unsound(run: xr.Dataset, outcome: np.ndarray) -> list[str]:
    """Variables with something not finite in a sample whose outcome is good."""
    good = np.flatnonzero(outcome == 0)
    return [name for name, values in run.data_vars.items()
            if "sample" in values.dims and values.dtype.kind == "f" and not np.isfinite(values.isel(sample=good)).all()]


def executed(command: str, scene: dict[str, Any], folder: Path, *options: str) -> tuple[subprocess.CompletedProcess, xr.Dataset]:
    (folder / "scene.toml").write_text(tomli_w.dumps(scene))
    result = subprocess.run([executable(), command, "scene.toml", "-o", "run.nc", *options], cwd=folder, capture_output=True, text=True)
    with xr.open_dataset(folder / "run.nc") as run:
        return result, run.load()


@pytest.mark.parametrize("spring", NO_DIRECTION)
@pytest.mark.parametrize("solver", ["elimination", "lapack", "gauss-jordan", "reduced"])
def test_spring_whose_ends_coincide(solver, spring, tmp_path):
    """Its force has no direction at t = 0: that sample is flagged, and no other."""
    scene = linkdyn.Scene(arm(**spring))
    for run in (scene.inverse(solver=solver), executed("inverse", arm(**spring), tmp_path, "--solver", solver)[1]):
        np.testing.assert_array_equal(run.status, [4, 0, 0, 0, 0])
        assert run.status.attrs["flag_meanings"].split()[4] == "undefined"
        assert np.isnan(run.driving_force.values[0]).all() and unsound(run, run.status.values) == []
    result, _ = executed("inverse", arm(**spring), tmp_path)
    assert result.returncode == SAMPLES_FAILED and "1 of 5, first at t = 0 s: undefined" in result.stderr


def test_spring_whose_ends_almost_coincide():
    """Within rounding of the markers the direction is noise, well beyond it is not."""
    run = linkdyn.Scene(arm(rest=0.2)).inverse(q=[[1e-15], [1e-9], [1e-6]])
    np.testing.assert_array_equal(run.status, [4, 4, 0])
    # weight and rest length pull: -k rest along the tangent, 1 m from the joint
    assert run.driving_force.values[2, 0] == pytest.approx(9.81 / 2 - 100 * 0.2, rel=1e-4)


def test_spring_without_rest_has_a_force_everywhere():
    """It is stiffness times the way between the markers: none where they coincide."""
    run = linkdyn.Scene(arm()).inverse()
    assert (run.status == 0).all()
    assert run.driving_force.values[0, 0] == pytest.approx(9.81 / 2, rel=1e-14)
    t = run.time.values
    np.testing.assert_allclose(run.driving_force.values[:, 0], 9.81 / 2 * np.cos(t) + 100 * np.sin(t), rtol=1e-13)


@pytest.mark.parametrize("spring", NO_DIRECTION)
def test_forward_names_the_spring(spring, tmp_path):
    scene = arm(**spring)
    scene["actuator"][0]["law"] = {"type": "constant", "value": 0.0}
    with pytest.raises(linkdyn.InputError, match="spring 'return' has no direction, its ends coincide"):
        linkdyn.Scene(scene).forward(0.1)


def test_sweep_leaves_out_what_has_no_value(tmp_path):
    scene = arm(rest=0.2)
    scene["sweep"] = {"keep": ["driving_force"], "axis": [{"coordinate": "A", "linspace": [-0.4, 0.4, 5]}]}
    for run in (linkdyn.Scene(scene).sweep(), executed("sweep", scene, tmp_path)[1]):
        outcome = list(run.outcome.values)
        assert [outcome[code] for code in run.sample_outcome.values] == ["feasible", "feasible", "undefined", "feasible", "feasible"]
        assert unsound(run, run.sample_outcome.values) == []
        assert run.samples_reduced == 4 and np.isfinite(run.driving_force_max).all()


@pytest.mark.parametrize("command", ["inverse", "forward", "sweep"])
def test_forces_beyond_all_numbers(command, tmp_path):
    """A mass so large that its force, or the power of that, overflows."""
    scene = arm()
    del scene["spring"]
    scene["link"][0] |= {"mass": 1e308, "inertia": 1e307}
    scene["coordinate"][0]["motion"] = {"law": "harmonic", "amplitude": 1.0, "frequency": 1e3}
    scene["sweep"] = {"keep": ["driving_force", "driving_power"], "axis": [{"time": True, "linspace": [0.0, 0.4, 5]}]}
    model = linkdyn.Scene(scene)
    runs = {
        "inverse": lambda: (model.inverse(), executed("inverse", scene, tmp_path)[1]),
        "forward": lambda: (executed("forward", scene, tmp_path, "--method", "rk4", "--step", "1e-5")[1],),
        "sweep": lambda: (model.sweep(), executed("sweep", scene, tmp_path)[1]),
    }
    if command == "forward":
        with pytest.raises(linkdyn.InputError):
            model.forward(0.1)
        return
    for run in runs[command]():
        outcome = run.sample_outcome if command == "sweep" else run.status
        assert (outcome != 0).any() and unsound(run, outcome.values) == []


def test_power_alone_beyond_all_numbers():
    """Force and speed have values, their product has none."""
    scene = arm()
    del scene["spring"]
    scene["link"][0]["mass"] = 1e200
    run = linkdyn.Scene(scene).inverse(q=[[0.0], [0.0]], qd=[[1.0], [1e150]], want="driving_force,power")
    assert run.status.values[0] == 0 and run.status.values[1] == 4


@pytest.mark.parametrize("solver", ["elimination", "lapack", "gauss-jordan", "reduced"])
@pytest.mark.parametrize("name", ["fourbar", "stewart_tsai"])
def test_squares_of_speeds_beyond_all_numbers(name, solver):
    """Far from any singular position, and every link closes: it is their accelerations that have no value."""
    scene = linkdyn.load(ROOT / "examples" / name / "scene.toml")
    q = scene.motion()[0][[0, 0]]
    run = scene.inverse(q=q, qd=np.outer([1.0, 1e200], np.ones(q.shape[1])), want="driving_force", solver=solver)
    assert list(run.status.values) == [0, 4]


def test_poses_beyond_all_numbers(tsai):
    scene = linkdyn.Scene(tsai)
    start = scene.motion()[0][0]
    q = np.stack([start, start])
    q[1, 0] = 1.7e308
    poses = scene.poses(q)
    assert poses.status[0] == 0 and np.isfinite(poses.position[0]).all()
    assert poses.status[1] != 0 or (np.isfinite(poses.position[1]).all() and np.isfinite(poses.rotation[1]).all())


@pytest.mark.thorough
def test_every_result_of_every_example_is_sound(tmp_path):
    """With all that can be wanted."""
    for file in sorted((ROOT / "examples").glob("*/scene.toml")):
        scene = linkdyn.load(file)
        if len(scene.actuators) != len(scene.coordinates):
            continue
        for solver in ("elimination", "lapack", "gauss-jordan"):
            run = scene.inverse(want="all,rcond", solver=solver)
            assert unsound(run, run.status.values) == [], (file, solver)


# ---- what a run tells of its samples


def led_by_its_slide() -> dict[str, Any]:
    """A slider-crank whose start is out of reach: no plan of the elimination can be tried there, so none is trusted."""
    bar = {"mass": 1.0, "inertia": 0.1}
    return {
        "space": "planar",
        "frame": {"markers": {"O": [0.0, 0.0]}},
        "link": [
            {"name": "crank", "markers": {"O": [0.0, 0.0], "A": [1.0, 0.0]}, **bar},
            {"name": "rod", "markers": {"A": [0.0, 0.0], "B": [3.0, 0.0]}, **bar},
            {"name": "slide", "markers": {"B": [0.0, 0.0]}, **bar},
        ],
        "joint": [
            {"name": "O", "type": "revolute", "between": ["frame.O", "crank.O"]},
            {"name": "A", "type": "revolute", "between": ["crank.A", "rod.A"], "branch": 1},
            {"name": "B", "type": "revolute", "between": ["rod.B", "slide.B"]},
            {"name": "rail", "type": "prismatic", "between": ["frame.O", "slide.B"]},
        ],
        "coordinate": [{"joint": "rail"}],
        "actuator": [{"joint": "rail"}],
    }


@pytest.mark.parametrize("n", [1, 201])
def test_samples_by_road(n, tmp_path):
    """No more of them than there are, whatever the number of lanes. A record's pivots are chosen by the batch where the scene has no pose to offer;
    estimates of errors take the elimination's plan, which has none here."""
    q = np.linspace(2.5, 3.5, n)
    (tmp_path / "states.csv").write_text("q rail\n" + "".join(f"{value!r}\n" for value in q.tolist()))
    result, stored = executed("inverse", led_by_its_slide(), tmp_path, "--states", "states.csv", "--error")
    scene = linkdyn.Scene(led_by_its_slide())
    roads = [(run.attrs["samples_closed_form"], run.attrs["samples_iterated"], run.attrs["samples_dense"])
             for run in (stored, scene.inverse(q=q[:, np.newaxis], error=True), scene.inverse(q=q[:, np.newaxis]))]
    assert roads == [(n, 0, n), (n, 0, n), (n, 0, 0)]
    assert f"took over {n} samples" in result.stdout


def test_samples_of_a_forward_run_by_road(tmp_path):
    """Also where errors are estimated, which computes in pieces."""
    scene = arm()
    scene["actuator"][0]["law"] = {"type": "constant", "value": 0.0}
    for options in ([], ["--error"]):
        _, stored = executed("forward", scene, tmp_path, *options, "--samples", "301")
        assert stored.attrs["samples_closed_form"] == 301 and stored.attrs["samples_dense"] == 0
    assert linkdyn.Scene(scene).forward(t=np.linspace(0, 0.4, 301)).attrs["samples_closed_form"] == 301


def test_iterated_samples_are_told(tmp_path):
    scene = tomllib.loads((ROOT / "examples" / "spatial_slider_crank" / "scene.toml").read_text())
    scene["link"][1]["markers"]["C"]["axis"] = [0.1, 1.0, 0.0]       # not square to the rod
    result, stored = executed("forward", scene, tmp_path, "--until", "0.01", "--samples", "7")
    assert (stored.attrs["samples_closed_form"], stored.attrs["samples_iterated"]) == (0, 7)
    assert "0 samples in closed form, 7 by iteration" in result.stdout


def test_a_wrench_given_is_kept_with_the_run(tsai, tmp_path):
    """One a sample, in the scene's components; also through a file."""
    scene = linkdyn.Scene(tsai)
    q = scene.motion([0.0, 0.1, 0.2])[0]
    each, one = np.arange(18.0).reshape(3, 6), np.arange(6.0)
    run = scene.inverse(q, wrench={"platform.center": each, "platform.P1": one})
    assert run.wrench.dims == ("sample", "loaded_marker", "component")
    np.testing.assert_array_equal(run.wrench.sel(loaded_marker="platform.center"), each)
    np.testing.assert_array_equal(run.wrench.sel(loaded_marker="platform.P1"), np.broadcast_to(one, (3, 6)))
    assert run.wrench.sel(component="Fz").component_unit.item() == "N"
    run.to_netcdf(tmp_path / "run.nc")
    xr.testing.assert_identical(xr.load_dataset(tmp_path / "run.nc").wrench, run.wrench.load())
    assert "wrench" not in scene.inverse(q)
    planar = linkdyn.Scene(copy.deepcopy(arm())).inverse(q=[[0.1]], wrench={"arm.T": [1.0, 2.0, 3.0]}, want="driving_force")
    np.testing.assert_array_equal(planar.wrench.values[0, 0], [1.0, 2.0, 3.0])
    assert list(planar.component.values) == ["Fx", "Fy", "Mz"]


def row_of_four_bars(n: int) -> dict[str, Any]:
    """Parallelograms in a row, led by the first bar from 60 to 20 degrees."""
    angle = math.radians(60)
    body = {"mass": 1.0, "cog": [0.5, 0.0], "inertia": 0.08}
    bars = [{"name": f"bar{i}", "markers": {"A": [0.0, 0.0], "B": [1.0, 0.0]}, **body,
             "start": {"position": [float(i), 0.0], "angle": angle}} for i in range(n + 1)]
    rods = [{"name": f"rod{i}", "markers": {"L": [0.0, 0.0], "R": [1.0, 0.0]}, **body,
             "start": {"position": [i - 1 + math.cos(angle), math.sin(angle)], "angle": 0.0}} for i in range(1, n + 1)]
    hinges = [("crank", "frame.A0", "bar0.A")]
    for i in range(1, n + 1):
        hinges += [(f"L{i}", f"bar{i - 1}.B", f"rod{i}.L"), (f"R{i}", f"bar{i}.B", f"rod{i}.R"), (f"A{i}", f"frame.A{i}", f"bar{i}.A")]
    return {
        "title": "a row of four-bars", "space": "planar", "gravity": [0.0, -9.81],
        "frame": {"markers": {f"A{i}": [float(i), 0.0] for i in range(n + 1)}},
        "link": bars + rods,
        "joint": [{"name": name, "type": "revolute", "between": [a, b]} for name, a, b in hinges],
        "coordinate": [{"joint": "crank", "start": angle, "motion": {"law": "cycloidal", "to": math.radians(20), "duration": 1.0}}],
        "actuator": [{"joint": "crank"}],
    }


def test_change_points_beside_a_motion_leave_the_plan() -> None:
    """Poses a step away from the motion stand for the scene; some of them are at change points of all four-bars at once."""
    scene = linkdyn.Scene(row_of_four_bars(6))
    planned, dense = scene.inverse(), scene.inverse(solver="lapack")
    assert planned.attrs["samples_dense"] == 0
    largest = np.abs(dense.driving_force.values).max()
    np.testing.assert_allclose(planned.driving_force, dense.driving_force, rtol=0, atol=1e-12 * largest)
