"""Bodies that turn freely have no singular attitude, whatever angles describe them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

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
        try:
            steps.append(linkdyn.Scene(given).forward(t=[0.0, 0.02], method=method).attrs["steps"])
        except linkdyn.UnavailableError:
            pytest.skip("built without GSL")
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
