"""Bodies that turn freely have no singular attitude, whatever angles describe them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkdyn

SCENES = Path(__file__).with_name("scenes")
METHODS = {
    "rk8pd": {"rtol": 1e-11, "atol": 1e-11},
    "rkf45": {"rtol": 1e-11, "atol": 1e-11},
    "gbs": {"rtol": 1e-11, "atol": 1e-11},
    "seulex": {"rtol": 1e-11, "atol": 1e-11},
    "rk4": {"step": 5e-4},
}


def ball_joint(slip: float) -> dict:
    """A body on a ball joint whose middle angle goes from 1 rad through 90 degrees at 8 rad/s, the others at `slip` rad/s."""
    given = tomllib.loads((SCENES / "ball_joint_past_pole.toml").read_text())
    for coordinate in (given["coordinate"][0], given["coordinate"][2]):
        coordinate["start"]["velocity"] = slip
    return given


def with_other_angles(given: dict) -> dict:
    """The same body, its joint's markers turned so that the motion is one of the last angle, far from any pole: z along the
    axis that was y, x along z, y along x."""
    turned = {"at": [0.0, 0.0, 0.0], "axis": [0.0, 1.0, 0.0], "x": [0.0, 0.0, 1.0]}
    given["frame"]["markers"]["S"] = given["link"][0]["markers"]["S"] = turned
    roll, pitch, yaw = (c["start"] for c in given["coordinate"][:3])
    angle = pitch["position"]
    omega = [roll["velocity"] + np.sin(angle) * yaw["velocity"], pitch["velocity"], np.cos(angle) * yaw["velocity"]]
    for start, position, velocity in zip((roll, pitch, yaw), (0.0, 0.0, angle), (omega[2], omega[0], omega[1]), strict=True):
        start["position"], start["velocity"] = position, float(velocity)
    return given


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("slip", [0.0, 1e-9, 1e-6, 1e-3])
def test_ball_joint_goes_on(method: str, slip: float) -> None:
    """By angles run after run stopped where the middle one is 90 degrees, or went on with another energy. A marker turned
    otherwise is the same body: energies and reactions are compared with it, beside the energy, which nothing changes."""
    t = np.linspace(0.0, 2.0, 401)
    run = linkdyn.Scene(ball_joint(slip)).forward(t=t, method=method, **METHODS[method])
    other = linkdyn.Scene(with_other_angles(ball_joint(slip))).forward(t=t, rtol=1e-12, atol=1e-12)
    assert run.attrs["stopped"] == "" and (run.status == 0).all()
    energy = run.kinetic_energy + run.potential_energy
    assert np.ptp(energy.values) < 1e-8 * abs(run.kinetic_energy).max()
    np.testing.assert_allclose(run.kinetic_energy, other.kinetic_energy, rtol=1e-6)
    np.testing.assert_allclose(run.reaction, other.reaction, atol=1e-6 * float(abs(other.reaction).max()))


@pytest.mark.parametrize("pitch", [0.5 * np.pi, -0.5 * np.pi])
@pytest.mark.parametrize("method", ["rk8pd", "gbs", "seulex"])
def test_ball_joint_starts_at_its_pole(method: str, pitch: float) -> None:
    """A pose that chooses the pivots of no equations: as few steps from there as from beside it."""
    given = ball_joint(1e-3)
    steps = []
    for start in (pitch, pitch - np.copysign(1e-9, pitch)):
        given["coordinate"][1]["start"]["position"] = start
        steps.append(linkdyn.Scene(given).forward(t=[0.0, 0.02], method=method).attrs["steps"])
    assert steps[0] <= steps[1] + 10


@pytest.mark.thorough
def test_angles_and_rates_of_a_ball_joint() -> None:
    """The angles told turn by the rates told, and those by the accelerations, away from the pole."""
    t = np.linspace(0.0, 0.5, 50001)
    run = linkdyn.Scene(ball_joint(0.3)).forward(t=t, want="all", rtol=1e-12, atol=1e-12)
    q, qd, qdd = (np.asarray(run[name]) for name in ("q", "qd", "qdd"))
    far = (np.abs(np.cos(q[1:-1, 1])) > 0.2) & (np.abs(np.diff(q, axis=0))[:-1].max(axis=1) < 1)
    far &= np.abs(np.diff(q, axis=0))[1:].max(axis=1) < 1
    assert far.sum() > 1000
    step = t[1] - t[0]
    for value, rate in ((q, qd), (qd, qdd)):
        difference = (value[2:] - value[:-2]) / (2 * step)
        scale = np.abs(rate[1:-1][far]).max()
        assert np.abs(difference - rate[1:-1])[far].max() < 1e-4 * scale


def loop_on_ball_joint(slip: float) -> dict:
    """The same body with a loop on it that is closed by iteration, its crank turning."""
    given = ball_joint(slip)
    loop = tomllib.loads((SCENES.parents[1] / "scenes" / "rusr_parallelogram.toml").read_text())
    loop["link"][2]["markers"]["C"] = [1.3, 0.0, 0.0]      # a rocker too long for a parallelogram
    for link in loop["link"]:
        del link["start"]
    for joint in loop["joint"]:
        joint["between"] = [marker.replace("frame.", "body.") for marker in joint["between"]]
    loop["joint"][-1]["start"] = 1.0
    given["link"][0]["markers"] |= loop["frame"]["markers"]
    given["link"] += loop["link"]
    given["joint"] += loop["joint"]
    given["coordinate"].append({"joint": "A", "start": {"position": 1.0, "velocity": 3.0}})
    return given


@pytest.mark.parametrize("slip", [0.0, 1e-9, 1e-3])
def test_loop_on_a_ball_joint_goes_on(slip: float) -> None:
    """A loop closed by iteration follows the body that carries it through 90 degrees: energy stays, and other angles of the
    ball joint tell the same motion."""
    t = np.linspace(0.0, 0.5, 51)
    run = linkdyn.Scene(loop_on_ball_joint(slip)).forward(t=t, rtol=1e-11, atol=1e-11, want="all")
    other = linkdyn.Scene(with_other_angles(loop_on_ball_joint(slip))).forward(t=t, rtol=1e-11, atol=1e-11, want="all")
    assert np.all(run.status == 0)
    energy = (run.kinetic_energy + run.potential_energy).values
    # local errors of some hundred steps
    assert np.ptp(energy) < 1e-8 * float(run.kinetic_energy.max())
    np.testing.assert_allclose(run.q[:, 3], other.q[:, 3], rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.kinetic_energy, other.kinetic_energy, rtol=1e-7)


def on_an_arm(middle: str) -> str:
    """A body on an arm that a hinge turns: by a ball joint, or by three hinges in a row whose angles are the ball's."""
    origin = "{{ at = [0, 0, 0], axis = [{}], x = [{}] }}".format
    axes = {"roll": origin("1, 0, 0", "0, 1, 0"), "pitch": origin("0, 1, 0", "0, 0, 1"), "yaw": origin("0, 0, 1", "1, 0, 0")}
    text = """
space = "spatial"
gravity = [0, 0, -9.81]
frame.markers = { O = { at = [0, 0, 0], axis = [0, 1, 0] } }
"""
    place = "[0.6, 0, 0]"
    arm = f"S = {{ at = {place}, axis = [0, 0, 1], x = [1, 0, 0] }}"
    body = "S = " + axes["yaw"]
    joints = [("A", "revolute", "frame.O", "arm.O")]
    links = ["arm", "body"]
    if middle == "ball":
        joints.append(("S", "spherical", "arm.S", "body.S"))
    else:
        arm = "S = " + axes["roll"].replace("[0, 0, 0]", place)
        joints += [("roll", "revolute", "arm.S", "x.S"), ("pitch", "revolute", "x.N", "y.S"), ("yaw", "revolute", "y.N", "body.S")]
        links += ["x", "y"]
    markers = {"arm": f"O = {{ at = [0, 0, 0], axis = [0, 1, 0] }}, {arm}", "body": body,
               "x": f"S = {axes['roll']}, N = {axes['pitch']}", "y": f"S = {axes['pitch']}, N = {axes['yaw']}"}
    masses = {"arm": "mass = 2\ncog = [0.3, 0.02, 0.05]\ninertia = { diagonal = [0.02, 0.1, 0.1] }",
              "body": "mass = 1\ncog = [0.1, 0.03, 0]\ninertia = [0.02, 0.02, 0.03, 0.001, 0, 0]", "x": "mass = 0", "y": "mass = 0"}
    for name in links:
        text += f"[[link]]\nname = '{name}'\n{masses[name]}\nmarkers = {{ {markers[name]} }}\n"
    for name, kind, first, second in joints:
        text += f"[[joint]]\nname = '{name}'\ntype = '{kind}'\nbetween = ['{first}', '{second}']\n"
    text += "[[coordinate]]\njoint = 'A'\nstart = { position = 0.2, velocity = -0.7 }\n"
    for name, velocity in (("roll", 0.4), ("pitch", -0.9), ("yaw", 1.3)):
        joint = f"joint = 'S'\nvariable = '{name}'" if middle == "ball" else f"joint = '{name}'"
        text += f"[[coordinate]]\n{joint}\nstart = {{ position = 0.1, velocity = {velocity} }}\n"
    return text


@pytest.mark.parametrize("method", METHODS)
def test_a_ball_behind_a_hinge(method: str) -> None:
    """Its attitude was counted by the kind of the scene's first joint: with a hinge there it had no place, and the run ended the process."""
    t = np.linspace(0.0, 0.5, 11)
    run, hinges = (linkdyn.Scene(on_an_arm(middle)).forward(t=t, method=method, **METHODS[method]) for middle in ("ball", "hinges"))
    assert (run.status == 0).all() and (hinges.status == 0).all()
    np.testing.assert_allclose(run.q, hinges.q, atol=1e-8)
    assert np.ptp(run.q.values, axis=0).min() > 0.1


def test_a_ball_before_a_hinge_in_the_file() -> None:
    """The other way round, a hinge was counted as a ball where the first joint is one."""
    text = on_an_arm("ball")
    head, hinge, ball = text.partition("[[joint]]\nname = 'A'")[0], *("[[joint]]\n" + part for part in text.split("[[joint]]\n")[1:])
    ball, tail = ball.split("[[coordinate]]", 1)
    t = np.linspace(0.0, 0.5, 11)
    runs = [linkdyn.Scene(scene).forward(t=t) for scene in (text, head + ball + hinge + "[[coordinate]]" + tail)]
    np.testing.assert_allclose(runs[0].q, runs[1].q, atol=1e-12)


# ---------------------------------------------------------------- poses of markers, and seen from moving links


def body_in_flight(seen: str, slip: float) -> dict:
    """The same body, unhindered and without weight: its own pose, that of a marker, that of both tables, or as a moving carriage sees it."""
    place = {"x": 0.1, "y": -0.2, "z": 0.3}
    turn = {"roll": {"position": 0.0, "velocity": slip}, "pitch": {"position": 1.0, "velocity": 8.0}, "yaw": {"position": 0.0, "velocity": slip}}
    body = {"name": "body", "mass": 2.0, "cog": [0.3, 0.0, 0.0], "inertia": {"diagonal": [0.02, 0.05, 0.06]}, "markers": {"S": [0.0, 0.0, 0.0]}}
    given: dict = {"space": "spatial", "gravity": [0, 0, 0], "link": [body]}
    if seen == "link":
        start = {"position": list(place.values()), "angles": [0.0, 1.0, 0.0], "velocity": [0, 0, 0], "angular_rates": [slip, 8.0, slip]}
        given["coordinate"] = [{"link": "body", "start": start}]
    elif seen == "marker":
        given["coordinate"] = [{"marker": "body.S", "start": place | turn}]
    elif seen == "tables":
        given["coordinate"] = [
            {"marker": "body.S", "components": list(place), "start": place},
            {"link": "body", "components": list(turn), "start": turn},
        ]
    else:
        given["link"].append({"name": "carriage", "mass": 1.0, "inertia": {"diagonal": [1, 1, 1]}, "markers": {"O": {"at": [0, 0, 0], "axis": [1, 0, 0]}}})
        given["frame"] = {"markers": {"O": {"at": [0, 0, 0], "axis": [1, 0, 0]}}}
        given["joint"] = [{"name": "rail", "type": "prismatic", "between": ["frame.O", "carriage.O"]}]
        given["coordinate"] = [
            {"joint": "rail", "start": {"position": 0.0, "velocity": 0.7}},
            {"link": "body", "relative_to": "carriage", "start": place | turn},
        ]
    return given


@pytest.mark.parametrize("method", ["gbs", "rk8pd", "seulex"])
@pytest.mark.parametrize("slip", [0.0, 1e-9, 1e-6, 1e-3, 0.5])
@pytest.mark.parametrize("seen", ["marker", "tables", "carriage"])
def test_poses_in_parts_go_on(seen: str, slip: float, method: str) -> None:
    """By angles runs stopped at 1e-9 rad/s, or took thirty times as many steps: a body's own pose knows nothing of its pole."""
    t = np.linspace(0.0, 1.0, 101)
    run = linkdyn.Scene(body_in_flight(seen, slip)).forward(t=t, method=method, rtol=1e-10, atol=1e-10)
    want = linkdyn.Scene(body_in_flight("link", slip)).forward(t=t, method=method, rtol=1e-10, atol=1e-10)
    assert run.attrs["stopped"] == "" and (run.status == 0).all()
    assert run.attrs["steps"] <= 1.5 * want.attrs["steps"]
    q, other = run.q.values[:, -6:], want.q.values
    np.testing.assert_allclose(q[:, :3], other[:, :3], atol=1e-7)      # the carriage goes on as it does
    attitudes = [Rotation.from_euler("XYZ", angles[:, 3:]) for angles in (q, other)]
    assert (attitudes[0].inv() * attitudes[1]).magnitude().max() < 1e-6
