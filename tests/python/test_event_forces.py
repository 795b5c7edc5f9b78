"""Results just before and just behind the events of forward runs, against closed forms, and against samples put beside the events by hand."""

from __future__ import annotations

import math
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import linkdyn
import linkdyn.plot as plot
from integrators import METHODS
from linkdyn.cli import executable
from sheet_file import column, read

EXAMPLES = Path(__file__).parents[2] / "examples"
WITH_EVENTS = ("capture", "hill_start", "hoist", "stopped_rocker", "toggle_clamp")
GRAVITY = 9.81
BEFORE, BEHIND = 0, 1
MASS, ARM, INERTIA = 1.3, 0.7, 0.2


def pendulum(**parts: Any) -> linkdyn.Scene:
    """A body on a hinge "O", let go at 2 rad from where it hangs."""
    description: dict[str, Any] = {
        "space": "planar",
        "gravity": [0, -GRAVITY],
        "frame": {"markers": {"O": [0, 0]}},
        "link": [{"name": "bob", "markers": {"O": [0, 0]}, "cog": [0, -ARM], "mass": MASS, "inertia": INERTIA}],
        "joint": [{"name": "O", "type": "revolute", "between": ["frame.O", "bob.O"]}],
        "coordinate": [{"joint": "O", "start": {"position": 2.0, "velocity": 0.0}}],
        "measures": {"phi": {"joint": "O"}},
        "time": {"end": 2.0},
    }
    return linkdyn.Scene(description | parts)


def bearing(phi: float, rate: float, acceleration: float) -> np.ndarray:
    """Force of the frame on the pendulum: what its weight and the acceleration of its centre of mass leave."""
    along, across = np.array([math.sin(phi), -math.cos(phi)]), np.array([math.cos(phi), math.sin(phi)])
    return MASS * (ARM * acceleration * across - ARM * rate**2 * along + [0, GRAVITY])


def slide(mass: float = 2.0, **parts: Any) -> linkdyn.Scene:
    """A mass on a level slide "h", its place x as a measure."""
    axis = {"at": [0, 0], "axis": [1, 0]}
    description: dict[str, Any] = {
        "space": "planar",
        "gravity": [0, -GRAVITY],
        "frame": {"markers": {"O": axis}},
        "link": [{"name": "mass", "markers": {"O": axis}, "mass": mass, "inertia": 1.0}],
        "joint": [{"name": "h", "type": "prismatic", "between": ["frame.O", "mass.O"]}],
        "coordinate": [{"joint": "h", "start": {"position": 0.0, "velocity": 1.0}}],
        "measures": {"x": {"joint": "h"}},
        "time": {"end": 2.0},
    }
    return linkdyn.Scene(description | parts)


def kinds(run: xr.Dataset) -> list[str]:
    """What happened, event by event."""
    meanings = run.event_kind.attrs["flag_meanings"].split()
    return [meanings[kind] for kind in run.event_kind.values]


def example(name: str) -> linkdyn.Scene:
    return linkdyn.load(EXAMPLES / name / "scene.toml")


# ---------------------------------------------------------------------------------------------------------------- closed forms
@pytest.mark.parametrize("method", METHODS)
def test_an_impact_in_closed_form(method):
    run = pendulum(stop=[{"name": "wall", "joint": "O", "min": 0.2, "restitution": 0.9}]).forward(0.9, method=method, step=2e-4)
    assert kinds(run) == ["impact"] and (run.event_status.values == 0).all()
    about = INERTIA + MASS * ARM**2
    speed = math.sqrt(2 * MASS * GRAVITY * ARM * (math.cos(0.2) - math.cos(2.0)) / about)
    turning = -MASS * GRAVITY * ARM * math.sin(0.2) / about
    error = {"msbdf": 1e-5, "rk4": 1e-8}.get(method, 1e-8)
    for side, rate in ((BEFORE, -speed), (BEHIND, 0.9 * speed)):
        np.testing.assert_allclose(run.event_reaction.values[0, side, 0, :2], bearing(0.2, rate, turning), rtol=error)
        np.testing.assert_allclose(run.event_qdd.values[0, side], turning, rtol=error)
        np.testing.assert_allclose(run.event_joint_rate.values[0, side], rate, rtol=error)
    # no sample is there, and the largest force of all is that of the event
    peak = run.linkdyn.worst().loc["O"]
    assert peak.force == pytest.approx(np.linalg.norm(bearing(0.2, -speed, turning)), rel=error)
    assert peak.force > 1.0001 * np.linalg.norm(run.reaction.values[:, 0, :2], axis=1).max()
    assert peak.force_time == run.event_time.values[0] and peak.force_event == "just before impact of wall.min"
    assert peak.moment_event == ""


@pytest.mark.parametrize("method", METHODS)
def test_rest_and_release_in_closed_form(method):
    """It falls on a stop that takes all speed, is pressed there, and lifted off by a moment that grows: nothing jumps then."""
    scene = pendulum(
        stop=[{"name": "rest", "joint": "O", "min": 0.5, "restitution": 0}],
        actuator=[{"joint": "O", "law": {"type": "formula", "value": "40 N m/s * (time - 1 s) * step(time - 1 s)"}}],
        event=[{"name": "drive", "when": "time - 1 s"}],
    )
    run = scene.forward(method=method, t_end=1.5)
    assert kinds(run) == ["rest", "crossing", "release"] and (run.event_status.values == 0).all()
    weight = np.array([0, MASS * GRAVITY])
    reaction = run.event_reaction.values[:, :, 0, :2]
    for event, side in ((0, BEHIND), (1, BEFORE), (1, BEHIND), (2, BEFORE), (2, BEHIND)):
        np.testing.assert_allclose(reaction[event, side], weight, atol=1e-5 * weight[1])
    about = INERTIA + MASS * ARM**2
    speed = math.sqrt(2 * MASS * GRAVITY * ARM * (math.cos(0.5) - math.cos(2.0)) / about)
    error = 1e-5 if method == "msbdf" else 1e-8
    np.testing.assert_allclose(reaction[0, BEFORE], bearing(0.5, -speed, -MASS * GRAVITY * ARM * math.sin(0.5) / about), rtol=error)
    np.testing.assert_allclose(run.event_driving_force.values[2], MASS * GRAVITY * ARM * math.sin(0.5), rtol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_a_law_that_switches_with_an_event(method):
    """The event's formula has its zero where the law's has, but rounds otherwise: the force jumps there all the same."""
    scene = slide(
        actuator=[{"joint": "h", "law": {"type": "formula", "value": "100 N - 70 N * step(x - 0.7 m)"}}],
        event=[{"name": "there", "when": "3*x - 2.1 m"}],
    )
    run = scene.forward(0.5, method=method)
    assert kinds(run) == ["crossing"] and (run.event_status.values == 0).all()
    np.testing.assert_allclose(run.event_driving_force.values[0, :, 0], [100, 30], rtol=1e-12)
    np.testing.assert_allclose(run.event_qdd.values[0, :, 0], [50, 15], rtol=1e-12)
    speed = math.sqrt(1 + 2 * 50 * 0.7)
    np.testing.assert_allclose(run.event_driving_power.values[0, :, 0], [100 * speed, 30 * speed], rtol={"msbdf": 1e-5, "rk4": 1e-3}.get(method, 1e-8))


@pytest.mark.parametrize("method", METHODS)
def test_what_comes_to_rest_by_friction(method):
    """A mass slides until Coulomb's friction has stopped it, which then holds what pushes it."""
    scene = slide(
        friction=[{"joint": "h", "coulomb": 0.3, "sticking": True}],
        load=[{"on": "mass.O", "force": [2.0, 0.0]}],
    )
    run = scene.forward(1.0, method=method)
    assert kinds(run) == ["stick"] and (run.event_status.values == 0).all()
    slides = 0.3 * 2.0 * GRAVITY
    assert run.event_time.values[0] == pytest.approx(2.0 / (slides - 2.0), rel=1e-6)
    np.testing.assert_allclose(run.event_friction.values[0, :, 0, 0], [-slides, -2.0], rtol=1e-9)
    np.testing.assert_allclose(run.event_qdd.values[0, :, 0], [(2.0 - slides) / 2.0, 0.0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(np.abs(run.event_clutch_force.values[0, :, 0]), [slides, 2.0], rtol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_a_soft_stop_with_a_damper(method):
    """The damper takes up the speed at once: 50 N s/m times 1 m/s."""
    run = slide(stop=[{"name": "pad", "joint": "h", "max": 0.3, "stiffness": 1e4, "damping": 50}]).forward(0.31, method=method)
    assert kinds(run)[0] == "contact"
    np.testing.assert_allclose(run.event_qdd.values[0, :, 0], [0, -25], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_a_clutch_that_closes_at_an_instant(method):
    """No number crosses zero there: the instant is known beforehand."""
    scene = slide(clutch=[{"name": "brake", "joint": "h", "capacity": 3, "from": 0.25}])
    run = scene.forward(0.5, method=method)
    assert kinds(run) == ["close"] and run.event_time.values[0] == 0.25
    np.testing.assert_allclose(run.event_clutch_force.values[0, :, 0], [0, -3], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(run.event_qdd.values[0, :, 0], [0, -1.5], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_an_event_where_something_is_known_to_happen(method):
    """A load leaves and a brake comes on at an instant that the run knows beforehand: an event of the time has both sides of that."""
    drive = {"ratio": 10, "brake": {"torque": 0.2, "from": 0.25, "begins": "off"}}
    scene = slide(
        actuator=[{"joint": "h", "law": {"type": "constant", "value": 0.1, "at": "motor"}, "drive": drive}],
        payload=[{"on": "mass.O", "mass": 3.0, "until": 0.25}],
        event=[{"name": "dropped", "when": "time - 0.25 s"}],
    )
    run = scene.forward(0.5, method=method)
    assert kinds(run) == ["crossing"] and (run.event_status.values == 0).all()
    np.testing.assert_allclose(run.event_reaction.values[0, :, 0, 1], [5 * GRAVITY, 2 * GRAVITY], rtol=1e-12)
    np.testing.assert_allclose(np.abs(run.event_brake_torque.values[0, :, 0]), [0, 0.2], rtol=1e-12)
    np.testing.assert_allclose(run.event_driving_force.values[0, :, 0], [1, -1], rtol=1e-12)


# ---------------------------------------------------------------------------------------------------------------- samples by hand
def compare_with_samples(scene: linkdyn.Scene, method: str, error: float) -> int:
    """Samples a nanosecond before and behind each event have what is told beside it; how many events were compared."""
    run = scene.forward(method=method)
    instants, end = run.event_time.values, float(run.time[-1])
    near = 1e-9 * max(1.0, end)
    alone = [t for t in np.unique(instants) if (np.abs(instants - t)[instants != t] > 20 * near).all() and near < t < end - near]
    closer = scene.forward(t=np.unique([run.time.values[0], end, *(np.array(alone) - near), *(np.array(alone) + near)]), method=method)
    np.testing.assert_array_equal(closer.event_time, run.event_time)
    for name in (str(name)[len("event_"):] for name, values in run.data_vars.items() if "side" in values.dims and values.dtype.kind == "f"):
        if name == "power_imbalance":
            continue
        scale = float(np.nanmax(np.abs(closer[name].values))) or 1.0
        for event, t in enumerate(instants):
            if t not in alone:
                continue
            for side, at in ((BEFORE, t - near), (BEHIND, t + near)):
                by_hand = closer.isel(sample=int(np.abs(closer.time.values - at).argmin()))[name].values
                np.testing.assert_allclose(run[f"event_{name}"].values[event, side], by_hand, rtol=0, atol=error * scale, err_msg=f"{name} at {t}")
    assert (run.event_status.values == 0).all()
    return len(alone)


@pytest.mark.parametrize(("name", "error"), [("stopped_rocker", 1e-6), ("hoist", 5e-6)])
def test_samples_put_beside_events_by_hand_are_the_same(name, error):
    assert compare_with_samples(example(name), "gbs", error) > 0


@pytest.mark.thorough
@pytest.mark.parametrize("method", ["rk8pd", "gbs", "seulex"])
@pytest.mark.parametrize("name", WITH_EVENTS)
def test_samples_put_beside_events_of_every_example(name, method):
    # a stiff clamp's forces grow by 1e4 of their largest in a second
    assert compare_with_samples(example(name), method, {"toggle_clamp": 2e-5, "hoist": 5e-6}.get(name, 1e-6)) > 0


@pytest.mark.parametrize("start", ["angles", "pose"])
def test_a_body_in_space(start):
    """A top swings in a socket that stops it where its axis tilts too far; or a plate falls freely on a floor under one corner."""
    swings = {
        "frame": {"markers": {"B": [0, 0, 0], "mouth": {"at": [0, 0, 0], "axis": [0, 0, -1]}}},
        "link": [{"name": "top", "markers": {"B": [0, 0, 0], "stem": {"at": [0, 0, -0.1], "axis": [0, 0, -1]}}, "mass": 2, "cog": [0, 0, -0.4], "inertia": [0.31, 0.3, 0.02, 0, 0, 0]}],
        "joint": [{"name": "B", "type": "spherical", "between": ["frame.B", "top.B"]}],
        "coordinate": [{"joint": "B", "variable": name, "start": value} for name, value in (("roll", {"position": 0.3, "velocity": 1.5}), ("pitch", 0.2), ("yaw", {"position": 0, "velocity": 5}))],
        "measures": {"tilt": {"axes": ["frame.mouth", "top.stem"]}},
        "stop": [{"name": "cone", "measure": "tilt", "max": 0.4, "restitution": 0.6}],
    }
    falls = {
        "link": [{"name": "plate", "mass": 2, "inertia": [0.1, 0.2, 0.3, 0, 0, 0], "markers": {"corner": [0.3, 0.2, 0], "arm": [0, 0, 0.1]}},
                 {"name": "bob", "mass": 0.5, "inertia": [0.01, 0.01, 0.01, 0, 0, 0], "cog": [0, 0, 0.1], "markers": {"foot": [0, 0, 0]}}],
        "joint": [{"name": "J", "type": "spherical", "between": ["plate.arm", "bob.foot"]}],
        "coordinate": [{"link": "plate", "start": {"position": [0, 0, 0.4], "angles": [0.3, 0.2, 0.1], "angular_velocity": [1, 2, 3]}},
                       *({"joint": "J", "variable": name, "start": 0.1} for name in ("roll", "pitch", "yaw"))],
        "frame": {"markers": {"O": [0, 0, 0]}},
        "measures": {"height": {"marker": "plate.corner", "component": "z"}},
        "stop": [{"name": "floor", "measure": "height", "min": 0, "restitution": 0.5}],
    }
    scene = linkdyn.Scene({"space": "spatial", "gravity": [0, 0, -GRAVITY], "time": {"end": 0.6}} | (swings if start == "angles" else falls))
    assert compare_with_samples(scene, "gbs", 1e-6) > 0


def test_a_coordinate_that_stands_in_for_another():
    """Events where other coordinates are integrated, and where they are exchanged between."""
    scene = tomllib.loads((EXAMPLES / "slider_crank" / "scene.toml").read_text(encoding="utf-8"))
    scene["coordinate"] = [{"joint": "A", "start": {"position": 1.7, "velocity": 40.0}}]
    scene["actuator"] = [{"joint": "A", "law": {"type": "constant", "value": 0}}]
    turned = linkdyn.Scene(scene)
    start = linkdyn.Scene(scene).inverse(q=[[1.7]], qd=[[40.0]], qdd=[[0.0]])
    sliding = next(str(v) for v in start["variable"].values if str(v).endswith(".slide"))
    joint = sliding.removesuffix(".slide")
    scene["measures"] = scene.get("measures", {}) | {"angle": {"joint": "A"}}
    scene["event"] = [{"name": "across", "when": "sin(2*angle)"}]
    by_crank = linkdyn.Scene(scene).forward(0.3)
    links = turned.poses(np.array([[1.7]]))
    for link, position, turn in zip(scene["link"], links.position[0], links.rotation[0]):
        link["start"] = {"position": position[:2].tolist(), "angle": float(np.arctan2(turn[1, 0], turn[0, 0]))}
    for one in scene["joint"]:
        one.pop("branch", None)
    here = {"variable": sliding}
    scene["coordinate"] = [{"joint": joint, "start": {"position": float(start.joint_variable.sel(here)[0]), "velocity": float(start.joint_rate.sel(here)[0])}}]
    by_slide = linkdyn.Scene(scene).forward(0.3)
    assert by_slide.attrs["coordinates_integrated"] and by_slide.sizes["event"] == by_crank.sizes["event"] > 4
    scale = float(np.abs(by_crank.reaction.values).max())
    np.testing.assert_allclose(by_slide.event_reaction, by_crank.event_reaction, rtol=0, atol=1e-5 * scale)
    assert (by_slide.event_status.values == 0).all()


# ---------------------------------------------------------------------------------------------------------------- nothing is felt
@pytest.mark.parametrize("method", METHODS)
def test_the_run_does_not_feel_who_looks(method):
    scene = example("stopped_rocker")
    looked, alone = scene.forward(method=method), scene.forward(method=method, want="joint_variable")
    for name in ("q", "qd", "event_time", "event_qd", "event_qd_after", "event_impulse"):
        np.testing.assert_array_equal(looked[name], alone[name])
    assert "event_reaction" in looked and "side" in looked.dims
    assert not [name for name, values in alone.data_vars.items() if "side" in values.dims]
    assert looked.attrs["right_hand_sides"] == alone.attrs["right_hand_sides"]


@pytest.mark.thorough
@pytest.mark.parametrize("method", ["rk8pd", "gbs", "seulex", "rk4"])
@pytest.mark.parametrize("name", WITH_EVENTS)
def test_no_example_feels_who_looks(name, method):
    looked, alone = (example(name).forward(method=method, want=want) for want in (None, "joint_variable"))
    for variable in ("q", "qd", "event_time", "event_q", "event_qd_after"):
        np.testing.assert_array_equal(looked[variable], alone[variable])


def test_estimates_of_errors_change_nothing():
    scene = example("stopped_rocker")
    np.testing.assert_array_equal(scene.forward(1.0, error=True).event_reaction, scene.forward(1.0).event_reaction)


def test_what_is_told_is_what_is_wanted():
    run = example("hoist").forward(want="driving_force")
    told = {name for name, values in run.data_vars.items() if "side" in values.dims}
    assert "event_driving_force" in told and not told & {"event_reaction", "event_motor_torque", "event_joint_variable", "event_time"}
    assert not [name for name in linkdyn.load(EXAMPLES / "fourbar" / "scene.toml").forward(0.1).data_vars if str(name).startswith("event_")]
    empty = slide(event=[{"name": "far", "when": "x - 100 m"}]).forward(0.1)
    assert empty.event_reaction.shape == (0, 2, 1, 3) and list(empty.linkdyn.worst()) == ["force", "force_time", "moment", "moment_time"]


@pytest.mark.parametrize("name", WITH_EVENTS)
def test_nothing_that_is_no_number_stands_beside_a_good_outcome(name):
    run = example(name).forward()
    for variable, values in run.data_vars.items():
        if "side" in values.dims and values.dtype.kind == "f":
            finite = np.isfinite(values.values).reshape(*values.shape[:2], -1).all(axis=2)
            assert (finite | (run.event_status.values != 0)).all(), variable


def test_events_of_the_start_have_no_sides():
    """Nothing is before the start, and behind it stands the first sample."""
    run = pendulum(coordinate=[{"joint": "O", "start": 0.5}], stop=[{"name": "rest", "joint": "O", "min": 0.5, "restitution": 0}]).forward(0.1)
    assert kinds(run) == ["rest"] and run.event_time.values[0] == 0
    assert (run.event_status.values != 0).all() and np.isnan(run.event_reaction.values).all()
    np.testing.assert_allclose(run.reaction.values[:, 0, 1], MASS * GRAVITY, rtol=1e-12)
    assert run.linkdyn.worst().force_event.tolist() == [""]


def test_an_event_that_ends_the_run():
    run = pendulum(event=[{"name": "down", "when": "phi", "do": "stop"}]).forward()
    assert kinds(run) == ["end"]
    for side in (BEFORE, BEHIND):
        np.testing.assert_allclose(run.event_reaction.values[0, side], run.reaction.values[-1], rtol=1e-9, atol=1e-9)


def test_a_run_that_cannot_go_on_behind_an_event():
    """What is driven strikes a stop: nothing can give way, and nothing is told of behind."""
    scene = slide(
        coordinate=[{"joint": "h", "driven": True, "motion": {"law": "constant-rate", "rate": -1.0, "start": 0.5}}],
        actuator=[{"joint": "h"}],
        stop=[{"name": "floor", "joint": "h", "min": 0, "restitution": 0.5}],
    )
    run = scene.forward(t_end=1.0)
    assert run.attrs["stopped"]
    assert (np.isfinite(run.event_reaction.values).all(axis=(2, 3)) == (run.event_status.values == 0)).all()


# ---------------------------------------------------------------------------------------------------------------- told
def test_a_part_of_a_run_has_its_own_peaks():
    run = example("stopped_rocker").forward()
    early = run.sel(time=slice(0, 0.3))
    largest = np.linalg.norm(early.reaction.values[..., :2], axis=-1).max(axis=0)
    np.testing.assert_allclose(early.linkdyn.worst().force, np.maximum(largest, np.linalg.norm(run.event_reaction.values[0, ..., :2], axis=-1).max(axis=0)))
    assert "event" in run.linkdyn.worst("joint_rate") and "event" not in run.linkdyn.worst("joint_variable")
    assert run.isel(joint=[1]).linkdyn.worst().force_event.tolist() == ["just before impact of bumper.min"]


def test_the_executable_says_the_same(tmp_path):
    command = [executable(), "forward", str(EXAMPLES / "stopped_rocker" / "scene.toml"), "-o", "run.nc"]
    told = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=tmp_path)
    assert told.returncode == 0, told.stderr
    run, own = linkdyn.read(tmp_path / "run.nc"), example("stopped_rocker").forward()
    beside = [name for name, values in own.data_vars.items() if "event" in values.dims]
    assert len(beside) > 8 and run.side.values.tolist() == ["before", "behind"]
    for name in beside:
        assert run[name].dims == own[name].dims and run[name].attrs["long_name"] == own[name].attrs["long_name"]
        assert run[name].attrs.get("units", "") == own[name].attrs.get("units", "")
        np.testing.assert_array_equal(run[name], own[name])
    worst = own.linkdyn.worst().loc["A"]
    line = next(line for line in told.stdout.splitlines() if "largest reaction force" in line)
    assert line.split()[3] == f"{worst.force:.2f}" and line.endswith(f"at A, t = {worst.force_time:.6f} s, just before impact 'bumper.min'")
    assert "may be larger" not in told.stdout


def test_the_summary_marks_peaks_of_drives(tmp_path):
    scene = slide(
        actuator=[{"joint": "h", "law": {"type": "formula", "value": "1 N + (70 N/m^3) * x^3 * (1 - step(x - 0.7 m))"}}],
        event=[{"name": "there", "when": "x - 0.7 m"}],
    )
    (tmp_path / "scene.toml").write_text(scene.text)
    told = subprocess.run([executable(), "forward", "scene.toml", "--samples", "5", "-o", "run.nc"], capture_output=True, text=True, timeout=60, cwd=tmp_path)
    lines = told.stdout.splitlines()
    drive = next(line for line in lines if line.strip().startswith("h [N]")).split()
    run = linkdyn.read(tmp_path / "run.nc")
    assert float(drive[4]) == pytest.approx(1 + 70 * 0.343, rel=1e-5) and drive[5].endswith("*")
    assert float(run.linkdyn.worst("driving_force").value.iloc[0]) == pytest.approx(1 + 70 * 0.343, rel=1e-9)
    assert any(line.startswith("  * t = ") and line.endswith("just before crossing 'there'") for line in lines)


def test_the_sheet_tells_events_and_their_peaks(tmp_path):
    run = example("stopped_rocker").forward()
    _, tables = read(linkdyn.sheet(run, tmp_path / "run.html"))
    worst = run.linkdyn.worst()
    joints = tables["Bearings and guides"]
    np.testing.assert_allclose(column(joints, 1), worst.force, rtol=1e-12)
    assert joints[0][2].text == f"{worst.force_time.iloc[0]:.6g} s, just before impact of bumper.min"
    top = run.event_reaction.values[1, BEFORE, 0]
    np.testing.assert_allclose([column(joints, 3)[0], column(joints, 4)[0]], top[:2], rtol=1e-12)
    size = np.linalg.norm(run.reaction.values[..., :2], axis=-1)
    np.testing.assert_allclose(column(joints, 5), run.linkdyn.rms("reaction").pipe(lambda x: np.linalg.norm(x.values[:, :2], axis=-1)), rtol=1e-9)
    assert size.max() < 0.7 * worst.force.max()
    events = tables["Events"]
    assert len(events) == 30 and events[0][1].text == "impact of bumper.min" and events[0][3].text == "7.852 N·m s"
    assert column(events, 5)[0] == pytest.approx(worst.force.max(), rel=1e-12)
    assert column(events, 7)[0] == pytest.approx(np.linalg.norm(run.event_reaction.values[1, BEHIND, :, :2], axis=-1).max(), rel=1e-12)


def test_pictures_mark_the_peaks(closed_figures):
    run = example("stopped_rocker").forward()
    figure, axes = plot.reactions(run)
    texts = [text.get_text() for text in axes[0, 0].texts]
    assert any(f"A  peak {run.linkdyn.worst().force['A']:.4g} N" in text for text in texts)
    _, panels = plot.hodograph(run, ["A"])
    assert panels[0].get_title().startswith(f"A: {run.linkdyn.worst().force['A']:.4g} N")
