"""Forward runs from Python: energy where nothing is lost, and what is refused."""

import contextlib
import math
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkdyn

EXAMPLES = Path(__file__).parents[2] / "examples"


def free_running(name: str) -> linkdyn.Scene:
    """An example whose actuators give nothing, so that kinetic and potential energy sum to a constant."""
    description = tomllib.loads((EXAMPLES / name / "scene.toml").read_text())
    for actuator in description["actuator"]:
        actuator["law"] = {"type": "constant", "value": 0.0}
    return linkdyn.Scene(description)


def test_energy_of_a_free_run_stays():
    # The power balance of a sample uses its own accelerations and cannot see a wrong bias acceleration; energy can.
    run = free_running("rcsp_start").forward(t_end=1.0, rtol=1e-11, atol=1e-12)
    total = (run.kinetic_energy + run.potential_energy).values
    swing = np.ptp(run.kinetic_energy.values)
    assert swing > 0.1  # it does move
    # Errors of some hundred steps at a tolerance of 1e-11 each.
    assert np.ptp(total) < 1e-8 * swing


@pytest.mark.parametrize("name", ["fourbar", "rcsp_start"])
def test_nothing_has_mass(name):
    """No coordinate helps where nothing resists a force: the message asks for mass, not for another coordinate."""
    description = tomllib.loads((EXAMPLES / name / "scene.toml").read_text())
    for link in description["link"]:
        link["mass"] = 0.0
        link.pop("inertia", None)
    for actuator in description["actuator"]:
        actuator["law"] = {"type": "constant", "value": 1.0}
    coordinate = description["coordinate"][0]
    with pytest.raises(linkdyn.InputError, match=rf"no link that coordinate '{coordinate['joint']}.*' moves has mass"):
        linkdyn.Scene(description).forward(t_end=0.1)


@pytest.mark.parametrize("name", ["fourbar", "fivebar_parallel", "slider_crank", "andrews"])
def test_planar_runs_find_the_motion_back(name):
    # The drives give what inverse dynamics of the motion asks for; started on the motion, the mechanism keeps to it.
    description = tomllib.loads((EXAMPLES / name / "scene.toml").read_text())
    motion = linkdyn.Scene(description).inverse()
    for k, coordinate in enumerate(description["coordinate"]):
        coordinate["start"] = {"position": float(motion.q[0, k]), "velocity": float(motion.qd[0, k])}
    run = linkdyn.Scene(description).forward(rtol=1e-13, atol=1e-13)
    # Local errors of some hundred steps, and their growth along the motion.
    for quantity in ("q", "reaction"):
        scale = abs(motion[quantity]).max()
        np.testing.assert_allclose(run[quantity], motion[quantity], rtol=0, atol=1e-9 * scale, err_msg=quantity)
    assert abs(run.closure).max() < 1e-14


ARM = """
space = "planar"
[frame]
markers = { O = [0, 0] }
[[link]]
name = "arm"
markers = { O = [0, 0] }
mass = 2.0
inertia = 0.5
[[joint]]
name = "J"
type = "revolute"
between = ["frame.O", "arm.O"]
[[coordinate]]
joint = "J"
start = 0.2
[[actuator]]
joint = "J"
law = { type = "constant", value = 1.0 }
[time]
end = 1.0
samples = 11
"""
"""An arm about its centre of mass: angle" = torque/0.5."""


def test_default_method():
    """Every build has one, and says which it was."""
    scene = linkdyn.Scene(ARM)
    try:
        best = scene.forward(method="rk8pd").attrs["method"]
    except linkdyn.UnavailableError:
        best = "gbs"
    assert scene.forward().attrs["method"] == best


def test_changes_by_path():
    scene = linkdyn.Scene(ARM)
    run = scene.with_({"actuator.J.law.value": 3.0, "link.arm.inertia": 0.25, "coordinate.J.start": 0.0}).forward()
    np.testing.assert_allclose(run.q[:, 0], 6 * run.time**2, atol=1e-12)
    assert float(scene.forward().q[0, 0]) == 0.2  # the scene itself has not changed
    spring = {"name": "S", "joint": "J", "stiffness": 2.0, "rest": 0.2}
    swinging = scene.with_({"spring.S": spring, "actuator.J": None, "coordinate.J.start": 0.3})
    assert swinging.actuators == ()
    run = swinging.forward(rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(run.q[:, 0], 0.2 + 0.1 * np.cos(2.0 * run.time), atol=1e-10)
    assert "driving_force" not in run
    stiffer = swinging.with_({"spring.S.stiffness": 8.0}).forward(rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(stiffer.q[:, 0], 0.2 + 0.1 * np.cos(4.0 * run.time), atol=1e-10)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("link.rocker.mass", "no link 'rocker' .expected one of 'arm'"),
        ("lnik.arm.mass", "no 'lnik'"),
        ("link.arm.mass.x", "no table above"),
        ("", "no path"),
    ],
)
def test_paths_that_lead_nowhere(path, message):
    with pytest.raises(linkdyn.InputError, match=message):
        linkdyn.Scene(ARM).with_({path: 1.0})


def test_changes_are_checked_like_a_scene():
    with pytest.raises(linkdyn.SceneError, match="mass"):
        linkdyn.Scene(ARM).with_({"link.arm.mass": -1.0})


@pytest.mark.parametrize("method", ["rk4", "rk8pd", "rkf45", "gbs"])
def test_torque_from_a_table(method, tmp_path):
    # Straight lines between rows: torque rises to 2 N m at 0.37 s, falls to 0 at 0.8 s; angles by integrating twice.
    (tmp_path / "torque.csv").write_text("t [ms], M\n0, 0\n370, 2\n800, 0\n2000, 0\n")
    law = {"type": "table", "table": "torque.csv", "column": "M"}
    scene = linkdyn.Scene(ARM, folder=tmp_path).with_({"actuator.J.law": law})
    t = np.linspace(0, 1, 21)
    knots, torque = np.array([0.0, 0.37, 0.8, 2.0]), np.array([0.0, 2.0, 0.0, 0.0])

    def angle(at: float) -> float:
        rate = angle = 0.0
        for first, last, m0, m1 in zip(knots, knots[1:], torque, torque[1:]):
            span = min(at, last) - first
            if span <= 0:
                break
            slope = (m1 - m0) / (last - first)
            angle += rate * span + (m0 * span**2 / 2 + slope * span**3 / 6) / 0.5
            rate += (m0 * span + slope * span**2 / 2) / 0.5
        return 0.2 + angle

    want = [angle(at) for at in t]
    # A cubic between the knots, which are hit exactly: every method is right to rounding.
    run = scene.forward(t=t, method=method, step=0.05)
    np.testing.assert_allclose(run.q[:, 0], want, atol=1e-13)
    np.testing.assert_allclose(run.driving_force[:, 0], np.interp(t, knots, torque), atol=1e-15)


def test_motor_target_from_a_table(tmp_path):
    motor = {"type": "dc-motor", "n": 10, "eta": 0.8, "K_T": 0.2, "K_E": 0.2, "K_P": 30, "R_a": 3.0}
    knots = np.linspace(0, 1, 201)
    rows = "".join(f"{t!r}, {0.5 * math.sin(3 * t)!r}\n" for t in knots.tolist())
    (tmp_path / "target.csv").write_text("t, angle\n" + rows)
    table = {"table": "target.csv", "column": "angle"}
    harmonic = {"law": "harmonic", "amplitude": 0.5, "frequency": 3.0}
    arm = linkdyn.Scene(ARM, folder=tmp_path)
    runs = [arm.with_({"actuator.J.law": motor | {"target": target}}).forward() for target in (table, harmonic)]
    assert abs(runs[1].q - 0.2).max() > 0.1
    # The spline through rows 5 ms apart is right to (3 rad/s 0.005 s)^4/384.
    np.testing.assert_allclose(runs[0].q, runs[1].q, atol=1e-9)


def test_driven_coordinate():
    five = tomllib.loads((EXAMPLES / "fivebar_parallel" / "scene.toml").read_text())
    laws = {"law": "harmonic", "mean": 1.0, "amplitude": 0.2, "frequency": 4.0}
    first, second = (coordinate["joint"] for coordinate in five["coordinate"])
    scene = linkdyn.Scene(five, folder=EXAMPLES / "fivebar_parallel").with_(
        {
            f"coordinate.{first}.motion": laws,
            f"coordinate.{first}.driven": True,
            f"actuator.{second}.law": {"type": "constant", "value": 0.02},
        }
    )
    t = np.linspace(0, 0.2, 21)
    run = scene.forward(t=t, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(run.q[:, 0], 1 + 0.2 * np.sin(4 * t), atol=1e-15)
    assert abs(run.q[:, 1] - run.q[0, 1]).max() > 1e-3
    np.testing.assert_allclose(run.driving_force[:, 1], 0.02)
    # What the driven joint takes is what inverse dynamics asks for on the same motion.
    again = scene.inverse(run.q.values, run.qd.values, run.qdd.values, t=t)
    np.testing.assert_allclose(again.driving_force, run.driving_force, atol=1e-12)


@pytest.mark.parametrize("method", ["rk8pd", "gbs", "rk4"])
def test_motion_of_a_drive_out_of_reach(method: str) -> None:
    """A crank that is driven to where coupler and rocker are stretched, and beyond. It was the energy that would have changed."""
    bars = {"crank": 2.0, "coupler": 1.5, "rocker": 1.2}
    scene = linkdyn.Scene({
        "space": "planar", "gravity": [0.0, -9.8], "frame": {"markers": {"O": [0.0, 0.0], "Q": [2.2, 0.0]}},
        "link": [{"name": n, "markers": {"A": [0.0, 0.0], "B": [a, 0.0]}, "mass": 1.0, "cog": [a / 2, 0.0], "inertia": 0.1} for n, a in bars.items()],
        "joint": [{"name": n, "type": "revolute", "between": b} for n, b in {"J1": ["frame.O", "crank.A"], "J2": ["crank.B", "coupler.A"],
                  "J3": ["coupler.B", "rocker.B"], "J4": ["frame.Q", "rocker.A"]}.items()],
        "coordinate": [{"joint": "J1", "driven": True, "motion": {"law": "harmonic", "mean": 1.2, "amplitude": 2.0, "frequency": 2.0}}],
        "actuator": [{"joint": "J1"}],
    })  # fmt: skip
    end = np.arccos((2.0**2 + 2.2**2 - 2.7**2) / (2 * 2.0 * 2.2))
    stopped = scene.forward(0.1, method=method).attrs["stopped"]
    assert "the motion of 'J1' leads out of reach: links 'coupler', 'rocker' cannot be closed beyond J1 = " in stopped
    assert abs(np.radians(float(stopped.split("beyond J1 = ")[1].split(" deg")[0])) - end) < 1e-6


def test_held_by_inverse_from_rest_only():
    """Without a motion the law `inverse` holds the start: a velocity there was taken, and drifted under forces of rest."""
    at_rest = {"actuator.J.law": {"type": "inverse"}}
    arm = linkdyn.Scene(ARM)
    np.testing.assert_allclose(arm.with_(at_rest).forward().q, 0.2, atol=1e-9)
    moving = arm.with_(at_rest | {"coordinate.J.start": {"position": 0.2, "velocity": 1.0}})
    with pytest.raises(linkdyn.InputError, match="coordinate 'J' starts with 1 rad/s and has no motion: the law \"inverse\""):
        moving.forward()


def test_start_chooses_how_a_spatial_group_closes():
    scene = linkdyn.load(EXAMPLES / "rcsp_start" / "scene.toml")
    q = scene.motion()[0][:1]

    def slide(changes: dict) -> float:
        return float(scene.with_(changes).inverse(q).joint_variable.sel(variable="P.slide")[0])

    farther, nearer = slide({"joint.S.branch": 1}), slide({"joint.S.branch": -1})
    assert farther > nearer
    for wanted in (farther, nearer):
        assert slide({"joint.S.branch": None, "joint.P.start": wanted + 0.01}) == wanted


LONG_RUN = """
import linkdyn, sys
scene = linkdyn.load({scene!r})
print("begin", flush=True)
run = None
while run is None:  # a signal may come before the first sample does
    try:
        scene.forward(1e5, method="rk4", step=1e-4)
    except linkdyn.Interrupted as interrupted:
        run = interrupted.result
print(len(run.time), float(run.time[-1]), run.attrs["stopped"])
"""


def test_interrupt_keeps_what_is_done():
    text = LONG_RUN.format(scene=str(EXAMPLES / "stewart_tsai" / "scene.toml"))
    process = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "begin\n"
    out = None
    while out is None:  # the run itself would take days
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            out, err = process.communicate(timeout=5)
    assert process.returncode == 0, err
    n, last, *stopped = out.split()
    assert int(n) == 1 and float(last) == 0.0  # the next output comes after hours
    assert " ".join(stopped).startswith("interrupted at t = ")


@pytest.mark.parametrize("method", ["rk4", "rk8pd", "gbs"])
def test_pauses_change_nothing(method, monkeypatch):
    scene = linkdyn.load(EXAMPLES / "fourbar" / "scene.toml")
    whole = scene.forward(0.5, method=method)
    monkeypatch.setattr("linkdyn.scene.BREATH", 1e-6)
    monkeypatch.setattr("linkdyn.scene.RUN_BLOCK", 17)
    in_pieces = scene.forward(0.5, method=method)
    np.testing.assert_array_equal(in_pieces.q, whole.q)
    np.testing.assert_allclose(in_pieces.reaction, whole.reaction, rtol=1e-13, atol=1e-8)


def test_progress_with_time_left(capsys, monkeypatch):
    monkeypatch.setattr("linkdyn._progress.PATIENCE", 0.0)
    monkeypatch.setattr("linkdyn._progress.REFRESH", 0.0)
    linkdyn.Scene(ARM).forward(progress=True)
    assert "% done, " in capsys.readouterr().err
    linkdyn.Scene(ARM).forward()
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"step": 0.0}, "step = 0"),
        ({"step": float("nan")}, "step = NaN"),
        ({"rtol": -1e-9}, "rtol"),
        ({"atol": float("inf")}, "atol"),
        ({"method": "euler"}, "method 'euler' is not known"),
        ({"solver": "magic"}, "solver 'magic' is not known"),
        ({"t_end": float("nan")}, "t"),
        ({"t": [0.0, 1.0, 1.0]}, "increasing"),
    ],
)
def test_refusals(options, message):
    with pytest.raises(linkdyn.InputError, match=message):
        linkdyn.Scene(ARM).forward(**options)


def test_a_run_that_cannot_go_on_says_where():
    # With its pivots so far apart the loop closes only while the crank points towards the follower.
    scene = linkdyn.load(EXAMPLES / "fourbar" / "scene.toml").with_(
        {
            "frame.markers.J1": [14.5, 0.0],
            "actuator.J1.law": {"type": "constant", "value": 0.0},
            "coordinate.J1.motion": None,
            "coordinate.J1.start": 2.6,
        }
    )
    assert scene.forward(10.0, method="rk4", step=1e-3).attrs["stopped"] == ""    # by other coordinates
    run = scene.forward(10.0, switch=False)
    assert run.attrs["stopped"].startswith("stopped at t = ")
    assert run.attrs["stopped"].endswith("s: coordinate 'J1' comes to its dead point")
    good = np.isfinite(run.q[:, 0].values)
    assert good[0] and not good[-1] and not np.any(good[1:] & ~good[:-1])
    assert abs(run.closure[good]).max() < 1e-13
    with pytest.raises(linkdyn.InputError, match="at its start: links 'follower', 'coupler' cannot be closed"):
        scene.with_({"coordinate.J1.start": 0.5}).forward(1.0)


def boom_on_a_leg(*, in_own_axes: bool) -> dict[str, Any]:
    """A boom that swings on a UPS leg with a spring; the leg's links along z from U and S, or in axes of their own."""
    along, square, lower, upper = ([1, 0, 0], [0, 0, 1], [0.1, 0, 0.3], [0.2, 0, 0]) if in_own_axes else ([0, 0, 1], [1, 0, 0], [0, 0, 0], [0, 0, 0])
    inertia = {"diagonal": [0.001 if k else 0.01 for k in along]}

    def beyond(point: list[float], by: float) -> list[float]:
        return [x + by * k for x, k in zip(point, along)]

    return {
        "space": "spatial", "gravity": [0, 0, -9.81], "time": {"end": 2, "samples": 21},
        "frame": {"markers": {"A": {"at": [0, 0, 0], "axis": [0, 1, 0]}, "B": {"at": [0.5, 0.05, -0.6], "axis": [0, 1, 0]}}},
        "link": [
            {"name": "boom", "mass": 10, "cog": [0.5, 0, 0], "inertia": {"diagonal": [0.1, 1, 1]}, "markers": {"A": {"at": [0, 0, 0], "axis": [0, 1, 0]}, "P": [0.8, 0.1, 0]}},
            {"name": "lower", "mass": 1, "cog": beyond(lower, 0.2), "inertia": inertia, "markers": {"U": {"at": lower, "axis": square}, "L": {"at": lower, "axis": along, "x": square}}},
            {"name": "upper", "mass": 1, "cog": beyond(upper, -0.2), "inertia": inertia, "markers": {"L": {"at": upper, "axis": along, "x": square}, "S": upper}}],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "boom.A"]}, {"name": "S", "type": "spherical", "between": ["upper.S", "boom.P"]},
            {"name": "U", "type": "universal", "between": ["frame.B", "lower.U"]}, {"name": "P", "type": "prismatic", "between": ["lower.L", "upper.L"], "start": 0.7}],
        "actuator": [{"joint": "P", "law": {"type": "spring-damper", "stiffness": 3000, "damping": 0, "rest": 0.7}}],
        "coordinate": [{"joint": "A", "start": {"position": 0.0, "velocity": 0.5}}]}


def test_a_leg_in_axes_of_its_own() -> None:
    """The lanes iterate it, the record closes it at once: the run is that of the leg in its usual axes."""
    runs = [linkdyn.Scene(boom_on_a_leg(in_own_axes=own)).forward(t=np.linspace(0, 5, 21), rtol=1e-10, atol=1e-10, want="all") for own in (False, True)]
    np.testing.assert_allclose(runs[1].q.values, runs[0].q.values, atol=1e-7)
    np.testing.assert_allclose(runs[1].joint_variable.sel(variable="P.slide").values, runs[0].joint_variable.sel(variable="P.slide").values, atol=1e-7)
    for run in runs:
        energy = run.kinetic_energy + run.potential_energy - run.work
        assert np.ptp(energy.values) < 1e-7 * run.kinetic_energy.max()


def held_at_rest(name: str) -> linkdyn.Scene:
    """A mechanism that nothing is told of but where it starts: its drives are to hold it there."""
    if name == "arm":
        return linkdyn.Scene({
            "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"O": [0, 0]}},
            "link": [{"name": "arm", "mass": 1.0, "cog": [0.5, 0], "inertia": 0.1, "markers": {"O": [0, 0]}}],
            "joint": [{"name": "J", "type": "revolute", "between": ["frame.O", "arm.O"]}],
            "coordinate": [{"joint": "J", "start": "30 deg"}], "actuator": [{"joint": "J"}],
        })
    return linkdyn.load(EXAMPLES.parent / "tests" / "scenes" / f"{name}.toml")


@pytest.mark.parametrize("name", ["arm", "hexaglide", "excavator"])
@pytest.mark.parametrize("method", ["gbs", "seulex", "rk4"])
def test_drives_hold_what_has_no_motion(name: str, method: str) -> None:
    """A coordinate without a motion rests at its start. The record took it to be at zero: after the first instants an arm at 30 degrees
    was held by the torque for 0 degrees, and fell, with status 0."""
    scene = held_at_rest(name)
    run = scene.forward(t=np.linspace(0, 0.2, 3), method=method, step=1e-3)
    at_rest = scene.inverse(q=run.q.values[:1], qd=0 * run.q.values[:1], qdd=0 * run.q.values[:1])
    assert (run.status == 0).all()
    assert np.abs(run.q - run.q[0]).max() < 1e-9            # unstable ones leave by rounding, e-fold in 0.1 s or more
    scale = np.abs(at_rest.driving_force).max()
    assert np.abs(run.driving_force - at_rest.driving_force.values).max() < 1e-8 * scale


def test_members_are_held_that_have_no_motion() -> None:
    scene = held_at_rest("arm")
    start = np.full((20, 1), np.radians(30))
    members = scene.ensemble(start, 0 * start, t=[0.0, 0.1, 0.2], step=1e-3)
    assert np.abs(members.q - np.radians(30)).max() < 1e-12


def test_coordinates_begin_where_their_joints_do() -> None:
    """A joint's start was not looked at by its coordinate, which began at 0 without a word."""
    scene = linkdyn.Scene({
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"O": [0, 0]}},
        "link": [{"name": "arm", "mass": 1.0, "cog": [0.5, 0], "inertia": 0.1, "markers": {"O": [0, 0]}}],
        "joint": [{"name": "J", "type": "revolute", "between": ["frame.O", "arm.O"], "start": "30 deg"}],
        "coordinate": [{"joint": "J"}], "actuator": [{"joint": "J"}],
    })
    run = scene.forward(t=[0.0, 0.1])
    assert run.q[0, 0] == pytest.approx(np.radians(30))
    assert run.driving_force[0, 0] == pytest.approx(9.81 * 0.5 * np.cos(np.radians(30)))
    assert scene.inverse().driving_force[0, 0] == pytest.approx(9.81 * 0.5 * np.cos(np.radians(30)))


def test_a_spring_below_zero_pushes_away() -> None:
    """A negative stiffness is a magnet's pull, linearised: the mass runs off as cosh."""
    scene = linkdyn.Scene({
        "space": "planar", "gravity": [0, 0], "frame": {"markers": {"A": {"at": [0, 0], "axis": [1, 0]}}},
        "link": [{"name": "mass", "mass": 2.0, "inertia": 1.0, "markers": {"A": {"at": [0, 0], "axis": [1, 0]}}}],
        "joint": [{"name": "A", "type": "prismatic", "between": ["frame.A", "mass.A"]}],
        "coordinate": [{"joint": "A", "start": 0.11}],
        "spring": [{"name": "magnet", "joint": "A", "stiffness": -18.0, "rest": 0.1}],
    })  # fmt: skip
    run = scene.forward(t_end=1.0, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(run.q.values[:, 0], 0.1 + 0.01 * np.cosh(3.0 * run.time.values), rtol=1e-9)
