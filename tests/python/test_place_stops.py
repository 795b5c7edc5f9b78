"""Stops of what measures tell: markers, distances, poses. Closed forms, numpy's rigid bodies and an integration of their own."""

from __future__ import annotations

import math
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import linkdyn

sys.path.insert(0, str(Path(__file__).parents[1] / "reference"))
import floor_oracle
from test_idle_spin import rssr

GRAVITY = 9.81
EXAMPLES = Path(__file__).parents[2] / "examples"


def kinds(run: xr.Dataset) -> list[str]:
    meanings = run.event_kind.attrs["flag_meanings"].split()
    return [meanings[kind] for kind in run.event_kind.values]


def assert_impacts_take_all_energy_lost(run: xr.Dataset, atol: float = 1e-9) -> None:
    energy = (run.kinetic_energy + run.potential_energy).values
    lost = np.concatenate([[0], np.cumsum(run.event_loss.values)])[np.searchsorted(run.event_time.values, run.time.values)]
    np.testing.assert_allclose(energy, energy[0] - lost, rtol=0, atol=atol)


def disc(start: dict[str, Any] | None = None, **parts: Any) -> linkdyn.Scene:
    """A body that is free in the plane, with a foot off its centre of mass."""
    description: dict[str, Any] = {
        "space": "planar",
        "gravity": [0, -GRAVITY],
        "frame": {"markers": {"O": [0, 0]}},
        "link": [{"name": "body", "markers": {"foot": [0.3, -0.2], "C": [0, 0]}, "mass": 2.0, "inertia": 0.05}],
        "coordinate": [{"link": "body", "start": start or {"position": [0.1, 1.0]}}],
        "measures": {"height": {"marker": "body.foot", "component": "y"}},
    }
    return linkdyn.Scene(description | parts)


def ball(start: dict[str, Any], **parts: Any) -> linkdyn.Scene:
    """A body that is free in space."""
    description: dict[str, Any] = {
        "space": "spatial",
        "gravity": [0, 0, -GRAVITY],
        "link": [{"name": "body", "markers": {"foot": [0.3, -0.2, -0.1]}, "mass": 2.0, "inertia": [0.05, 0.07, 0.04, 0.01, -0.005, 0.008]}],
        "coordinate": [{"link": "body", "start": start}],
        "measures": {"height": {"marker": "body.foot", "component": "z"}},
    }
    return linkdyn.Scene(description | parts)


TENSOR = np.array([[0.05, 0.01, 0.008], [0.01, 0.07, -0.005], [0.008, -0.005, 0.04]])


def rotation(roll: float, pitch: float, yaw: float) -> np.ndarray:
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]]) @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]) @ np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])


def axes_of_angles(roll: float, pitch: float) -> np.ndarray:
    """Columns: axes about which roll, pitch and yaw turn."""
    return np.array([[1, 0, math.sin(pitch)], [0, math.cos(roll), -math.sin(roll) * math.cos(pitch)], [0, math.sin(roll), math.cos(roll) * math.cos(pitch)]])


# ------------------------------------------------------------------------------------------------------------ hard
@pytest.mark.parametrize("stop", [{"coordinate": "body.z"}, {"measure": "place"}])
@pytest.mark.parametrize("method", ["gbs", "seulex", "rk4"])
def test_a_ball_bounces_in_closed_form(stop, method):
    e = 0.7
    scene = ball({"position": [0, 0, 1.2]}, measures={"place": {"coordinate": "body.z"}}, stop=[{"name": "floor", "min": 0.2, "restitution": e} | stop])
    run = scene.forward(t_end=2.0, method=method)
    fall = math.sqrt(2 / GRAVITY)
    n = len(run.event)
    assert n >= 3 and run.attrs["stopped"] == ""
    exact = fall * (1 + 2 * np.concatenate([[0], np.cumsum(e ** np.arange(1, n))]))
    np.testing.assert_allclose(run.event_time.values, exact, rtol=0, atol=1e-11)
    speed = GRAVITY * fall * e ** np.arange(n)
    np.testing.assert_allclose(run.event_impulse.values, 2 * (1 + e) * speed, rtol=1e-10)
    np.testing.assert_allclose(run.event_loss.values, (1 - e**2) * 2 * speed**2 / 2, rtol=1e-10)


def test_a_foot_off_the_centre_in_the_plane():
    # m_eff = 1/(1/m + d^2/I), d from the centre of mass to the foot across the floor's normal.
    e = 0.4
    run = disc({"position": [0.1, 1.0], "velocity": [0.3, -0.5], "angle": 0.4, "angular_rate": 2.0},
               stop=[{"name": "floor", "measure": "height", "min": 0, "restitution": e}]).forward(t_end=0.6)  # fmt: skip
    assert kinds(run)[0] == "impact" and list(run.event.values)[0] == "floor.min"
    x, y, angle = run.event_q.values[0]
    before, after = run.event_qd.values[0], run.event_qd_after.values[0]
    arm = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]) @ [0.3, -0.2]
    assert y + arm[1] == pytest.approx(0, abs=1e-12)
    row = np.array([0, 1, arm[0]])
    ease = row @ np.diag([1 / 2, 1 / 2, 1 / 0.05]) @ row
    speed = row @ before
    impulse = -(1 + e) * speed / ease
    assert float(run.event_impulse[0]) == pytest.approx(impulse, rel=1e-10)
    np.testing.assert_allclose(after, before + impulse * np.diag([1 / 2, 1 / 2, 1 / 0.05]) @ row, rtol=1e-9, atol=1e-12)
    assert float(run.event_loss[0]) == pytest.approx((1 - e**2) / 2 * speed**2 / ease, rel=1e-10)
    assert_impacts_take_all_energy_lost(run)


def test_a_foot_off_the_centre_in_space():
    e = 0.6
    run = ball({"position": [0, 0, 0.6], "angles": [0.4, -0.3, 0.9], "velocity": [0.2, 0.1, -1.0], "angular_rates": [1.0, -2.0, 0.5]},
               stop=[{"name": "floor", "measure": "height", "min": 0, "restitution": e}]).forward(t_end=1.0)  # fmt: skip
    assert kinds(run)[0] == "impact"
    place, angles = run.event_q.values[0, :3], run.event_q.values[0, 3:]
    r, axes = rotation(*angles), axes_of_angles(*angles[:2])
    arm = r @ [0.3, -0.2, -0.1]
    assert place[2] + arm[2] == pytest.approx(0, abs=1e-12)
    inverse_inertia = np.linalg.inv(r @ TENSOR @ r.T)
    normal = np.array([0, 0, 1])
    ease = 1 / 2 + np.cross(arm, normal) @ inverse_inertia @ np.cross(arm, normal)
    omega = axes @ run.event_qd.values[0, 3:]
    speed = run.event_qd.values[0, 2] + np.cross(omega, arm)[2]
    impulse = -(1 + e) * speed / ease
    assert float(run.event_impulse[0]) == pytest.approx(impulse, rel=1e-10)
    assert float(run.event_loss[0]) == pytest.approx((1 - e**2) / 2 * speed**2 / ease, rel=1e-10)
    np.testing.assert_allclose(run.event_qd_after.values[0, :3], run.event_qd.values[0, :3] + impulse / 2 * normal, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(axes @ run.event_qd_after.values[0, 3:], omega + impulse * inverse_inertia @ np.cross(arm, normal), rtol=1e-9, atol=1e-11)
    assert_impacts_take_all_energy_lost(run, atol=1e-8)


@pytest.mark.parametrize("angle", [0, 1, 2])
def test_an_angle_of_a_pose_in_space(angle):
    # The impulse is a moment along the gradient of the angle's rate over the angular velocity.
    e, name = 0.5, ["roll", "pitch", "yaw"][angle]
    rates = [[1.5, 0.2, -0.3], [0.2, 1.5, -0.3], [0.2, -0.3, 1.5]][angle]
    run = ball({"position": [0, 0, 0], "angles": [0.2, -0.1, 0.3], "angular_rates": rates}, gravity=[0, 0, 0],
               stop=[{"name": "tilt", "coordinate": f"body.{name}", "min": -0.4, "max": 0.6, "restitution": e}]).forward(t_end=1.5)  # fmt: skip
    assert list(run.event.values)[0] == "tilt.max" and kinds(run)[0] == "impact"
    angles = run.event_q.values[0, 3:]
    assert angles[angle] == pytest.approx(0.6, abs=1e-12)
    r, axes = rotation(*angles), axes_of_angles(*angles[:2])
    gradient = np.linalg.inv(axes)[angle]
    inverse_inertia = np.linalg.inv(r @ TENSOR @ r.T)
    ease = gradient @ inverse_inertia @ gradient
    before, after = run.event_qd.values[0, 3:], run.event_qd_after.values[0, 3:]
    assert float(run.event_impulse[0]) == pytest.approx((1 + e) * before[angle] / ease, rel=1e-9)
    np.testing.assert_allclose(axes @ (after - before), -float(run.event_impulse[0]) * inverse_inertia @ gradient, rtol=1e-8, atol=1e-10)
    assert after[angle] == pytest.approx(-e * before[angle], rel=1e-9)
    assert run.q.values[:, 3 + angle].max() <= 0.6 + 1e-12
    assert_impacts_take_all_energy_lost(run)


@pytest.mark.parametrize("stop", [{"coordinate": "platform.z", "min": 0.58}, {"coordinate": "platform.roll", "max": 0.04}, {"coordinate": "platform.pitch", "min": -0.02}])
def test_parts_of_a_pose(stop):
    """A platform on three legs that coordinates lead by height and tilt."""
    description = tomllib.loads((EXAMPLES / "tripod" / "scene.toml").read_text())
    for taken in ("load", "actuator"):
        description.pop(taken)
    description["coordinate"][0].pop("motion")
    description["coordinate"][0]["start"] = {"z": {"position": 0.6}, "roll": {"position": 0.02, "velocity": 1.0}, "pitch": {"position": 0.01, "velocity": -1.2}}
    run = linkdyn.Scene(description | {"stop": [{"name": "S", "restitution": 0.5} | stop]}).forward(t=np.linspace(0, 0.1, 11), rtol=1e-10, atol=1e-11)
    k = ["platform.z", "platform.roll", "platform.pitch"].index(stop["coordinate"])
    assert run.attrs["stopped"] == "" and kinds(run) == ["impact"]
    assert float(run.event_q[0, k]) == pytest.approx(stop.get("min", stop.get("max")), abs=1e-11)
    assert float(run.event_qd_after[0, k]) == pytest.approx(-0.5 * float(run.event_qd[0, k]), rel=1e-9)
    assert_impacts_take_all_energy_lost(run)


def test_an_angle_of_a_pose_counts_its_turns():
    # Free to turn backwards without end, and stopped forwards.
    def events(rate: float) -> int:
        start = {"position": [0, 0], "angle": 0.2, "angular_rate": rate}
        return disc(start, gravity=[0, 0], stop=[{"name": "end", "coordinate": "body.yaw", "max": 0.5, "restitution": 1}]).forward(t_end=3.0).sizes["event"]

    assert events(-7.0) == 0 and events(7.0) == 1


def pendulum_scene(pendulum: floor_oracle.Pendulum, angle: np.ndarray, **parts: Any) -> linkdyn.Scene:
    (l1, l2), (c1, c2) = pendulum.length, pendulum.middle
    description: dict[str, Any] = {
        "space": "planar",
        "gravity": [0, -GRAVITY],
        "frame": {"markers": {"O": [0, 0]}},
        "link": [
            {"name": "upper", "markers": {"O": [0, 0], "E": [l1, 0]}, "mass": pendulum.mass[0], "cog": [c1, 0], "inertia": pendulum.inertia[0]},
            {"name": "lower", "markers": {"E": [0, 0], "tip": [l2, 0]}, "mass": pendulum.mass[1], "cog": [c2, 0], "inertia": pendulum.inertia[1]},
        ],
        "joint": [{"name": "O", "type": "revolute", "between": ["frame.O", "upper.O"]}, {"name": "E", "type": "revolute", "between": ["upper.E", "lower.E"]}],
        "coordinate": [{"joint": "O", "start": angle[0]}, {"joint": "E", "start": angle[1] - angle[0]}],
        "measures": {"height": {"marker": "lower.tip", "component": "y"}},
        "stop": [{"name": "floor", "measure": "height", "min": pendulum.floor, "restitution": pendulum.restitution}],
    }
    return linkdyn.Scene(description | parts)


@pytest.mark.parametrize("restitution", [0.5, 0.0])
def test_a_double_pendulum_meets_a_floor(restitution):
    pendulum = floor_oracle.Pendulum(np.array([0.7, 0.6]), np.array([0.3, 0.25]), np.array([1.5, 0.8]), np.array([0.06, 0.03]), -0.9, restitution)
    angle, t = np.array([-0.3, 0.4]), np.linspace(0, 1.0, 11)
    exact, told = floor_oracle.run(pendulum, angle, np.zeros(2), t)
    run = pendulum_scene(pendulum, angle).forward(t=t, rtol=1e-11, atol=1e-12)
    assert len(told) >= 2 and kinds(run) == [kind for _, kind, _, _ in told]
    np.testing.assert_allclose(run.event_time.values, [at for at, _, _, _ in told], rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.event_impulse.values, [impulse for _, _, impulse, _ in told], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(run.event_loss.values, [loss for _, _, _, loss in told], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(run.q.values, np.column_stack([exact[:, 0], exact[:, 1] - exact[:, 0]]), rtol=0, atol=1e-7)
    assert_impacts_take_all_energy_lost(run, atol=1e-8)


def test_a_rope_becomes_taut_and_swings():
    # Thrown out level from below its peg the ball comes to the end of its rope, which takes the speed along it; from there it is a pendulum.
    length, v = 1.0, 1.5
    run = disc({"position": [0, -0.4], "velocity": [v, 0]},
               measures={"reach": {"between": ["frame.O", "body.C"]}},
               stop=[{"name": "rope", "measure": "reach", "max": length, "restitution": 0}]).forward(t=np.linspace(0, 1.0, 101), rtol=1e-11, atol=1e-12)  # fmt: skip
    # (v t)^2 + (0.4 + g t^2/2)^2 = 1
    square = np.roots([GRAVITY**2 / 4, v**2 + 0.4 * GRAVITY, 0.16 - length**2])
    assert float(run.event_time[0]) == pytest.approx(math.sqrt(square.max()), abs=1e-11)
    at, before = run.event_q.values[0, :2], run.event_qd.values[0, :2]
    along = at / length
    assert float(run.event_impulse[0]) == pytest.approx(2 * before @ along, rel=1e-9)
    assert float(run.event_loss[0]) == pytest.approx((before @ along) ** 2, rel=1e-9)
    taut = run.time.values > float(run.event_time[0])
    np.testing.assert_allclose(np.hypot(*run.q.values[taut, :2].T), length, rtol=0, atol=1e-9)
    assert_impacts_take_all_energy_lost(run)
    # T = m (g cos + v^2/l) is what bends the way: a + g has no other part.
    x, a, speed = run.q.values[taut, :2], run.qdd.values[taut, :2] + [0, GRAVITY], run.qd.values[taut, :2]
    expected = -(GRAVITY * -x[:, 1] / length + (speed**2).sum(axis=1) / length)[:, None] * x / length
    np.testing.assert_allclose(a, expected, rtol=0, atol=1e-8)


def table(load_cell: bool = False, **parts: Any) -> linkdyn.Scene:
    """A ball on a table that tilts about its middle, or that stands on a load cell; the ball is seen from the table."""
    hinge = {"name": "K", "type": "fixed" if load_cell else "revolute", "between": ["frame.O", "table.O"]}
    description: dict[str, Any] = {
        "space": "planar",
        "gravity": [0, -GRAVITY],
        "frame": {"markers": {"O": [0, 0]}},
        "link": [
            {"name": "table", "markers": {"O": [0, 0]}, "mass": 3.0, "inertia": 0.4},
            {"name": "ball", "markers": {"C": [0, 0]}, "mass": 1.2, "inertia": 0.01},
        ],
        "joint": [hinge],
        "coordinate": [{"joint": "K", "start": {"position": 0.1, "velocity": 0.3}}] * (not load_cell) + [{"link": "ball", "start": {"position": [0.4, 0.5]}}],
        "measures": {"above": {"marker": "ball.C", "component": "y", "relative_to": "table"}},
    }
    return linkdyn.Scene(description | parts)


def test_a_ball_on_a_load_cell_weighs_what_it_weighs():
    run = table(True, stop=[{"name": "top", "measure": "above", "min": 0.05, "restitution": 0.3}]).forward(t_end=1.5, want="all")
    assert kinds(run)[-1] == "rest"
    reaction = run.reaction.sel(joint="K").values
    np.testing.assert_allclose(reaction[0, :2], [0, 3.0 * GRAVITY], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(reaction[-1], [0, 4.2 * GRAVITY, 0.4 * 1.2 * GRAVITY], rtol=1e-9, atol=1e-9)


def test_a_ball_slides_down_a_table_that_tilts():
    # The impact keeps the angular momentum about the hinge; then the ball slides on the moving table without friction: energy stays.
    run = table(stop=[{"name": "top", "measure": "above", "min": 0.05, "restitution": 0}]).forward(t=np.linspace(0, 0.8, 81), rtol=1e-11, atol=1e-12)
    assert kinds(run)[:1] == ["rest"]
    q, before, after = run.event_q.values[0], run.event_qd.values[0], run.event_qd_after.values[0]

    def momentum(rate: np.ndarray) -> float:
        return float(0.4 * rate[0] + 1.2 * (q[1] * rate[2] - q[2] * rate[1]) + 0.01 * rate[3])

    assert momentum(after) == pytest.approx(momentum(before), rel=1e-10)
    normal, across = np.array([-math.sin(q[0]), math.cos(q[0])]), np.array([math.cos(q[0]), math.sin(q[0])])
    row = np.concatenate([[-(q[1:3] @ across)], normal, [0]])
    ease = row @ np.diag([1 / 0.4, 1 / 1.2, 1 / 1.2, 1 / 0.01]) @ row
    speed = row @ before
    assert float(run.event_impulse[0]) == pytest.approx(-speed / ease, rel=1e-9)
    assert float(run.event_loss[0]) == pytest.approx(speed**2 / 2 / ease, rel=1e-9)
    on = run.time.values > float(run.event_time[0])
    if run.sizes["event"] > 1:
        on &= run.time.values < float(run.event_time[1])
    angle, x, y = run.q.values[on, :3].T
    assert on.sum() > 20 and np.ptp(angle) > 0.3
    np.testing.assert_allclose(-np.sin(angle) * x + np.cos(angle) * y, 0.05, rtol=0, atol=1e-9)
    assert_impacts_take_all_energy_lost(run)


def test_what_rests_is_released_when_it_is_lifted():
    # A load that grows by 10 N a second lifts 2 kg after 1.962 s.
    run = ball({"position": [0, 0, 0]}, load=[{"on": "body.C", "force": {"z": "10 N/s*time"}}],
               link=[{"name": "body", "markers": {"C": [0, 0, 0]}, "mass": 2.0, "inertia": {"diagonal": [0.1, 0.1, 0.1]}}],
               measures={"height": {"marker": "body.C", "component": "z"}},
               stop=[{"name": "floor", "measure": "height", "min": 0, "restitution": 0.5}]).forward(t=[0, 1, 2, 3])  # fmt: skip
    assert kinds(run) == ["rest", "release"]
    lifted = 2 * GRAVITY / 10
    assert float(run.event_time[1]) == pytest.approx(lifted, abs=1e-10)
    flown = np.maximum(run.time.values - lifted, 0)
    np.testing.assert_allclose(run.q.values[:, 2], 10 / 2 * flown**3 / 6, rtol=0, atol=1e-10)


def test_several_feet_at_once():
    # A plate falls flat on four feet: together they take what one under its middle would, and it rests on them.
    feet = {f"F{i}": [x, y, -0.1] for i, (x, y) in enumerate([(0.3, 0.2), (0.3, -0.2), (-0.3, 0.2), (-0.3, -0.2)])}
    e, fall = 0.3, math.sqrt(2 * 0.5 / GRAVITY)
    run = ball({"position": [0, 0, 0.6]},
               link=[{"name": "body", "markers": feet, "mass": 2.0, "inertia": {"diagonal": [0.1, 0.1, 0.1]}}],
               measures={f"h{i}": {"marker": f"body.F{i}", "component": "z"} for i in range(4)},
               stop=[{"name": f"S{i}", "measure": f"h{i}", "min": 0, "restitution": e} for i in range(4)]).forward(t_end=1.5)  # fmt: skip
    assert run.attrs["stopped"] == ""
    first = np.abs(run.event_time.values - fall) < 1e-9
    assert first.sum() >= 2 and float(run.event_impulse.values[first].sum()) == pytest.approx(2 * (1 + e) * GRAVITY * fall, rel=1e-10)
    assert float(run.event_loss.sum()) == pytest.approx(2 * GRAVITY * 0.5, rel=1e-9)
    np.testing.assert_allclose(run.q.values[-1], [0, 0, 0.1, 0, 0, 0], rtol=0, atol=1e-9)


def test_a_hammer_meets_an_anvil_within_a_loop():
    # The rod's tip of a four-bar, which no coordinate leads: impulses take exactly the energy that is missing.
    def scene(**parts: Any) -> linkdyn.Scene:
        description: dict[str, Any] = {
            "space": "planar",
            "gravity": [0, -GRAVITY],
            "frame": {"markers": {"A": [0, 0], "D": [0.5, 0]}},
            "link": [
                {"name": "crank", "markers": {"A": [0, 0], "B": [0.2, 0]}, "mass": 1.0, "cog": [0.1, 0], "inertia": 0.01},
                {"name": "rod", "markers": {"B": [0, 0], "C": [0.45, 0], "tip": [0.7, 0.1]}, "mass": 1.5, "cog": [0.3, 0.05], "inertia": 0.04},
                {"name": "rocker", "markers": {"D": [0, 0], "C": [0.35, 0]}, "mass": 0.8, "cog": [0.17, 0], "inertia": 0.01},
            ],
            "joint": [
                {"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]},
                {"name": "B", "type": "revolute", "between": ["crank.B", "rod.B"]},
                {"name": "C", "type": "revolute", "between": ["rod.C", "rocker.C"]},
                {"name": "D", "type": "revolute", "between": ["frame.D", "rocker.D"]},
            ],
            "coordinate": [{"joint": "A", "start": 1.9}],
            "measures": {"tip": {"marker": "rod.tip", "component": "y"}, "gap": {"between": ["frame.A", "rod.tip"]}},
        }
        return linkdyn.Scene(description | parts)

    for bounded in {"measure": "tip", "min": 0.42}, {"measure": "gap", "min": 0.65}:
        run = scene(stop=[{"name": "anvil", "restitution": 0.5} | bounded]).forward(t_end=1.0, rtol=1e-10, atol=1e-11)
        assert run.attrs["stopped"] == "" and run.sizes["event"] > 1 and float(run.event_loss.max()) > 1e-2
        assert_impacts_take_all_energy_lost(run, atol=1e-8)


@pytest.mark.parametrize("relative_to", [{}, {"relative_to": "lower"}])
def test_a_wheel_meets_a_bump_stop(relative_to):
    # A marker of a loop in space that is closed by iteration, seen from the frame and from a moving arm.
    description = tomllib.loads((EXAMPLES / "double_wishbone" / "scene.toml").read_text())
    for taken in ("spring", "load", "friction"):
        description.pop(taken, None)
    for actuator in description["actuator"]:
        actuator["law"] = {"type": "constant", "value": 0.0}
    for coordinate in description["coordinate"]:
        coordinate.pop("driven", None)
    description["measures"] = {"hub": {"marker": "upright.hub", "component": "z"} | relative_to}
    bound = {"max": 0.08} if relative_to else {"min": 0.32}
    run = linkdyn.Scene(description | {"stop": [{"name": "bump", "measure": "hub", "restitution": 0.5} | bound]}).forward(t_end=0.2, rtol=1e-10, atol=1e-10)
    assert run.attrs["stopped"] == "" and run.sizes["event"] > 0 and float(run.event_loss.max()) > 1e-3
    assert_impacts_take_all_energy_lost(run, atol=1e-7)


def rod_at_a_stop(at, stop):
    """A rod between two balls, with a stop at a point of it."""
    return rssr(markers={"B": [0, 0, 0], "C": [0.9, 0, 0], "P": at}) | {
        "measures": {"z": {"marker": "rod.P", "component": "z"}},
        "stop": [{"name": "S", "measure": "z", "min": -1.0} | stop],
    }


@pytest.mark.parametrize("stop", [{"restitution": 0.5}, {"stiffness": 1e4}])
def test_a_rod_pushed_on_its_line_may_spin(stop):
    assert linkdyn.Scene(rod_at_a_stop([0.5, 0, 0], stop)).inverse().attrs["idle_spins"] == "rod"


@pytest.mark.parametrize("stop", [{"restitution": 0.5}, {"stiffness": 1e4}])
def test_a_spin_that_a_stop_feels_is_not_idle(stop):
    """Pushed off its line the rod would turn."""
    with pytest.raises(linkdyn.SceneError, match=r"may spin .* stop 'S\.min' pushes 'rod' off it"):
        linkdyn.Scene(rod_at_a_stop([0.5, 0.1, 0], stop))


# ------------------------------------------------------------------------------------------------------------ soft
def test_a_soft_floor_in_closed_form():
    # Half an oscillation about the place where the weight is carried.
    k, speed = 4000.0, math.sqrt(2 * GRAVITY * 0.5)
    scene = ball({"position": [0, 0, 0.7]}, stop=[{"name": "mat", "coordinate": "body.z", "min": 0.2, "stiffness": k}])
    omega, sag = math.sqrt(k / 2), 2 * GRAVITY / k
    lasts = (2 * math.pi - 2 * math.atan2(speed / omega, sag)) / omega
    run = scene.forward(t=np.linspace(0, 1.2, 121), rtol=1e-11, atol=1e-12)
    fall = math.sqrt(2 * 0.5 / GRAVITY)
    assert kinds(run)[:2] == ["contact", "release"]
    np.testing.assert_allclose(run.event_time.values[:2], [fall, fall + lasts], rtol=0, atol=1e-9)
    s = run.time.values - fall
    within = (s > 0) & (s < lasts)
    depth = sag * (1 - np.cos(omega * s)) + speed / omega * np.sin(omega * s)
    np.testing.assert_allclose(run.q.values[within, 2], 0.2 - depth[within], rtol=0, atol=1e-8)


SOFT = {"stiffness": 3000.0, "damping": 15.0}


@pytest.mark.parametrize(
    ("measures", "stop"),
    [
        ({"place": {"marker": "body.foot", "component": "y"}}, {"measure": "place", "min": 0.0}),
        ({"place": {"between": ["frame.O", "body.foot"]}}, {"measure": "place", "max": 0.65}),
        ({}, {"coordinate": "body.yaw", "min": -0.2, "max": 0.45}),
    ],
)
def test_a_soft_stop_as_a_force_of_ones_own(measures, stop):
    """scipy with the same one-sided springs, by gradients from differences."""
    scipy_integrate = pytest.importorskip("scipy.integrate")
    start = np.array([0.1, 0.5, 0.2, 0.3, 0.4, 2.0])
    t = np.linspace(0, 0.5, 11)
    inverse_mass = np.diag([1 / 2, 1 / 2, 1 / 0.05])

    def place(q: np.ndarray) -> float:
        c, s = math.cos(q[2]), math.sin(q[2])
        foot = q[:2] + [c * 0.3 + s * 0.2, s * 0.3 - c * 0.2]
        return float(q[2]) if "coordinate" in stop else float(np.hypot(*foot) if "between" in measures["place"] else foot[1])

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        q, qd = y[:3], y[3:]
        row = np.array([(place(q + step) - place(q - step)) / 2e-6 for step in 1e-6 * np.eye(3)])
        x, v = place(q), row @ qd
        push = 0.0
        for side, bound in ((-1, stop.get("min")), (1, stop.get("max"))):
            if bound is not None and side * (x - bound) > 0:
                push -= side * max(0, side * (SOFT["stiffness"] * (x - bound) + SOFT["damping"] * v))
        return np.concatenate([qd, inverse_mass @ (np.array([0, -2 * GRAVITY, 0]) + push * row)])

    exact = scipy_integrate.solve_ivp(rates, (0, 0.5), start, "LSODA", t_eval=t, rtol=1e-10, atol=1e-12, max_step=1e-3).y[:3].T
    scene = disc({"position": start[:2], "angle": start[2], "velocity": start[3:5], "angular_rate": start[5]}, measures=measures, stop=[{"name": "S"} | SOFT | stop])
    for method in ("gbs", "seulex"):
        run = scene.forward(t=t, method=method, rtol=1e-9, atol=1e-10)
        assert "contact" in kinds(run)
        np.testing.assert_allclose(run.q.values, exact, rtol=0, atol=2e-6)


def test_inverse_dynamics_has_the_force_of_a_soft_stop():
    pendulum = floor_oracle.Pendulum(np.array([0.7, 0.6]), np.array([0.3, 0.25]), np.array([1.5, 0.8]), np.array([0.06, 0.03]), -0.9, 0.0)
    moving = [{"joint": joint, "motion": {"law": "harmonic", "mean": mean, "amplitude": 0.5, "frequency": "3 rad/s"}} for joint, mean in (("O", -1.0), ("E", -0.4))]
    common: dict[str, Any] = {"coordinate": moving, "actuator": [{"joint": "O"}, {"joint": "E"}], "time": {"end": 2.0, "samples": 41}}
    k, c = 800.0, 12.0
    free = pendulum_scene(pendulum, np.zeros(2), **common, stop=[]).inverse()
    run = pendulum_scene(pendulum, np.zeros(2), **common, stop=[{"name": "mat", "measure": "height", "min": -0.9, "stiffness": k, "damping": c}]).inverse()
    angle = np.cumsum(run.q.values, axis=1)
    row = pendulum.length * np.cos(angle)
    height = np.sin(angle) @ pendulum.length
    rate = (row * np.cumsum(run.qd.values, axis=1)).sum(axis=1)
    push = np.where(height < -0.9, np.maximum(0, -k * (height + 0.9) - c * rate), 0)
    assert (push > 0).sum() > 5 and (push == 0).sum() > 5
    # Moments of both hinges' angles: the second one turns the tip alone, the first both links.
    expected = free.driving_force.values - push[:, None] * np.column_stack([row.sum(axis=1), row[:, 1]])
    np.testing.assert_allclose(run.driving_force.values, expected, rtol=1e-10, atol=1e-10)
    parts = run.linkdyn.contributions()
    np.testing.assert_allclose(parts.driving_force.sel(cause="stop mat").values, expected - free.driving_force.values, atol=1e-9)


# ------------------------------------------------------------------------------------------------------------ all ways to run
def test_ensembles_and_simulators_meet_them_too():
    scene = ball({"position": [0, 0, 1.0]}, stop=[{"name": "floor", "coordinate": "body.z", "min": 0, "restitution": 0.8}])
    height = np.array([1.0, 0.5, 2.0])
    q = np.zeros((3, 6))
    q[:, 2] = height
    members = scene.ensemble(q, 0 * q, [0.0, 0.7])
    simulator = scene.simulator(method="rk4", step=1e-3)
    simulator.step(0.7)
    fall = np.sqrt(2 * height / GRAVITY)
    flown, speed = 0.7 - fall, 0.8 * GRAVITY * fall
    expected = np.where(flown > 0, speed * flown - GRAVITY * flown**2 / 2, height - GRAVITY * 0.7**2 / 2)
    np.testing.assert_allclose(members.q.values[:, -1, 2], expected, rtol=0, atol=1e-9)
    assert simulator.q[2] == pytest.approx(expected[0], abs=1e-10)


def test_a_start_beyond_one_is_refused():
    with pytest.raises(linkdyn.InputError, match=r"stop 'floor\.min': measure 'height' starts 0\.2 beyond it"):
        disc({"position": [0, 0]}, stop=[{"name": "floor", "measure": "height", "min": 0, "restitution": 0.5}]).forward(t_end=0.1)


def test_a_simulator_stands_on_its_stop():
    # Put down on the floor it rests there, lifted it leaves, let go it bounces; beyond the floor it is refused.
    scene = ball({"position": [0, 0, 0.2]}, stop=[{"name": "floor", "coordinate": "body.z", "min": 0.2, "restitution": 0.5}])
    simulator = scene.simulator(method="gbs")
    simulator.step(0.5)
    assert simulator.q[2] == pytest.approx(0.2, abs=1e-12)
    place = simulator.q.copy()
    place[2] = 1.2
    simulator.reset(place)
    fall = math.sqrt(2 / GRAVITY)
    simulator.step(0.5)
    assert simulator.q[2] == pytest.approx(0.2 + 0.5 * GRAVITY * fall * (0.5 - fall) - GRAVITY * (0.5 - fall) ** 2 / 2, abs=1e-10)
    place[2] = 0.1
    with pytest.raises(linkdyn.InputError, match=r"coordinate 'body\.z' starts 0\.1 beyond it"):
        simulator.reset(place)


@pytest.mark.parametrize("floor", [0.0, 0.2])
@pytest.mark.parametrize(("speed", "begin"), [(1e-13, 0.0), (2e-16, 0.0), (1e-10, 0.15), (1e-8, 10.0), (1e-6, 1000.0)])
@pytest.mark.parametrize("method", ["rk8pd", "gbs", "seulex"])
def test_a_start_that_hardly_strikes_comes_to_rest(method, speed, begin, floor):
    # Bounces too short for the clock are none: the run gets to its end, and so does a step of a simulator.
    scene = ball({"position": [0, 0, floor], "velocity": [0, 0, -speed]}, stop=[{"name": "floor", "coordinate": "body.z", "min": floor, "restitution": 0.5}])
    run = scene.forward(t=begin + np.linspace(0, 0.002, 3), method=method)
    assert (run.status.values == 0).all() and run.event.size <= 60
    np.testing.assert_allclose(run.q.values[-1], [0, 0, floor, 0, 0, 0], rtol=0, atol=1e-12)
    assert run.qd.values[-1, 2] == 0
    simulator = scene.simulator(method=method)
    simulator.reset(run.q.values[-1], [0, 0, -speed, 0, 0, 0], t=begin)
    simulator.step(0.002)
    assert simulator.q[2] == pytest.approx(floor, abs=1e-12) and simulator.qd[2] == 0


def test_a_simulator_that_bounces_without_end_says_so():
    scene = ball({"position": [0, 0, 0.0], "velocity": [0, 0, -1e-12]}, stop=[{"name": "floor", "coordinate": "body.z", "min": 0.0, "restitution": 1.0}])
    simulator = scene.simulator()
    with pytest.raises(linkdyn.InputError, match="the step limit is reached"):
        simulator.step(0.1)


def test_a_sweep_has_the_force_of_a_soft_stop():
    # Over a coordinate and the place of the floor, against the moments by hand of the pendulum at rest.
    pendulum = floor_oracle.Pendulum(np.array([0.7, 0.6]), np.array([0.3, 0.25]), np.array([1.5, 0.8]), np.array([0.06, 0.03]), -0.9, 0.0)
    scene = pendulum_scene(
        pendulum, np.array([-1.0, -1.3]), variables={"floor": -0.9}, actuator=[{"joint": "O"}, {"joint": "E"}],
        stop=[{"name": "mat", "measure": "height", "min": "floor", "stiffness": 800.0}],
        sweep={"axis": [{"coordinate": "O", "values": [-1.2, -0.8, -0.3]}, {"parameter": "variables.floor", "values": [-1.3, -1.0, -0.7]}],
               "keep": ["driving_force"]},
    )  # fmt: skip
    found = scene.sweep()
    q1, floor = np.tile([-1.2, -0.8, -0.3], 3), np.repeat([-1.3, -1.0, -0.7], 3)  # designs come first
    angle = np.column_stack([q1, q1 - 0.3])
    row = pendulum.length * np.cos(angle)
    push = 800 * np.maximum(0, floor - np.sin(angle) @ pendulum.length)
    (m1, m2), (c1, c2) = pendulum.mass, pendulum.middle
    weight = GRAVITY * np.cos(angle) * np.array([m1 * c1 + m2 * pendulum.length[0], m2 * c2])
    both = weight - push[:, None] * row
    assert 2 < (push > 0).sum() < 8
    np.testing.assert_allclose(found.driving_force.values.reshape(-1, 2), np.column_stack([both.sum(axis=1), both[:, 1]]), rtol=1e-10)


# ------------------------------------------------------------------------------------------------------------ friction across
def test_a_body_slides_to_rest_on_a_soft_floor():
    # Straight on, whichever way, slowed down by mu g.
    k, mu = 4000.0, 0.3
    velocity = np.array([2.0, 1.5])
    start = {"position": [0.1, -0.2, 0.2 - 2 * GRAVITY / k], "velocity": [*velocity, 0]}
    scene = ball(start, stop=[{"name": "mat", "coordinate": "body.z", "min": 0.2, "stiffness": k, "coulomb": mu}])
    stops = np.linalg.norm(velocity) / (mu * GRAVITY)
    t = np.linspace(0, 1.5 * stops, 61)
    run = scene.forward(t=t, rtol=1e-10, atol=1e-11, method="seulex")
    slides = np.minimum(t, stops)
    way = np.linalg.norm(velocity) * slides - mu * GRAVITY * slides**2 / 2
    np.testing.assert_allclose(run.q.values[:, :2], [0.1, -0.2] + np.outer(way, velocity / np.linalg.norm(velocity)), rtol=0, atol=2e-6)
    np.testing.assert_allclose(run.q.values[:, 3:], 0, rtol=0, atol=1e-12)
    assert np.abs(run.qd.values[t > 1.1 * stops, :2]).max() < 1e-12


@pytest.mark.parametrize("side", [{"min": 0.0}, {"max": -0.1}])
def test_friction_across_as_a_load_of_ones_own(side):
    (bound,), sign = side.values(), 1 if "min" in side else -1
    stop = disc({"position": [0.1, 0.15 - 0.35 * (sign < 0)], "velocity": [0.7, -0.4 * sign], "angular_rate": 1.0}, gravity=[0, -GRAVITY * sign],
                stop=[{"name": "floor", "measure": "height", "stiffness": 3000.0, "damping": 15.0, "coulomb": 0.4, "creep_speed": 0.05} | side])
    own = disc({"position": [0.1, 0.15 - 0.35 * (sign < 0)], "velocity": [0.7, -0.4 * sign], "angular_rate": 1.0}, gravity=[0, -GRAVITY * sign],
               measures={"height": {"marker": "body.foot", "component": "y"}, "sinks": {"marker": "body.foot", "component": "y", "rate": True},
                         "slips": {"marker": "body.foot", "component": "x", "rate": True}},
               laws={"push": f"if({sign}*({bound!r} m - height), max(0 N, 3000 N/m*({bound!r} m - height)*{sign} - 15 N*s/m*sinks*{sign}), 0 N)"},
               load=[{"on": "body.foot", "force": ["-0.4*push*tanh(slips/(50 mm/s))", f"{sign}*push"]}])  # fmt: skip
    t = np.linspace(0, 0.4, 41)
    one, other = (scene.forward(t=t, rtol=1e-10, atol=1e-11, method="seulex") for scene in (stop, own))
    np.testing.assert_allclose(one.q, other.q, rtol=0, atol=2e-8)
    assert np.abs(one.qd.values[:, 2]).max() > 1.5


def test_a_foot_dragged_along_takes_its_friction():
    scene = linkdyn.Scene({
        "space": "planar", "gravity": [0, -GRAVITY], "frame": {"markers": {"G": {"at": [0, 0], "axis": [1, 0]}}},
        "link": [{"name": "sled", "markers": {"G": {"at": [0, 0], "axis": [1, 0]}, "foot": [0.2, -0.302]}, "mass": 3.0, "inertia": 0.1}],
        "joint": [{"name": "G", "type": "prismatic", "between": ["frame.G", "sled.G"]}],
        "coordinate": [{"joint": "G"}], "actuator": [{"joint": "G"}],
        "measures": {"height": {"marker": "sled.foot", "component": "y"}},
        "stop": [{"name": "floor", "measure": "height", "min": -0.3, "stiffness": 5e4, "coulomb": 0.25}], "time": {"end": 1},
    })  # fmt: skip
    q = np.linspace(-1, 1, 200)[:, np.newaxis]
    qd = np.where(np.arange(200) % 2, 0.5, -0.3)[:, np.newaxis]
    run = scene.inverse(q=q, qd=qd, qdd=0 * q)
    np.testing.assert_allclose(run.driving_force, np.sign(qd) * 0.25 * 100, rtol=1e-12)
    np.testing.assert_allclose(run.reaction.sel(joint="G").values[:, 1], 3 * GRAVITY - 100, rtol=1e-12)
    assert float(np.abs(run.power_imbalance).max()) < 1e-12
    assert float(np.abs(scene.inverse(q=q, qd=0 * qd, qdd=0 * q).driving_force).max()) == 0


def test_friction_between_two_bodies_keeps_their_momentum():
    # A foot grazes a table that floats as freely: what it does to the one it does to the other, in the same place.
    description = {
        "space": "planar", "gravity": [0, 0],
        "link": [{"name": "table", "markers": {"O": [0, 0]}, "mass": 5.0, "cog": [0.1, -0.05], "inertia": 0.4},
                 {"name": "body", "markers": {"foot": [0.1, -0.2]}, "mass": 2.0, "inertia": 0.05}],
        "coordinate": [{"link": "table", "start": {"velocity": [0.2, 0.3], "angular_rate": 0.5}},
                       {"link": "body", "start": {"position": [0.1, 0.25], "velocity": [1.5, -0.6], "angular_rate": -2.0}}],
        "measures": {"gap": {"marker": "body.foot", "component": "y", "relative_to": "table"}},
        "stop": [{"name": "top", "measure": "gap", "min": 0, "stiffness": 2000.0, "coulomb": 0.5, "creep_speed": 0.02}], "time": {"end": 1},
    }  # fmt: skip
    run = linkdyn.Scene(description).forward(t=np.linspace(0, 0.5, 101), rtol=1e-10, atol=1e-12, method="seulex")
    assert kinds(run)[:2] == ["contact", "release"]
    q, qd = run.q.values.reshape(-1, 2, 3), run.qd.values.reshape(-1, 2, 3)
    momentum = np.zeros((len(q), 3))
    for k, (mass, cog, inertia) in enumerate(((5.0, (0.1, -0.05), 0.4), (2.0, (0, 0), 0.05))):
        c, s = np.cos(q[:, k, 2]), np.sin(q[:, k, 2])
        arm = np.stack([c * cog[0] - s * cog[1], s * cog[0] + c * cog[1]], axis=1)
        place, velocity = q[:, k, :2] + arm, qd[:, k, :2] + qd[:, k, 2:] * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        momentum[:, :2] += mass * velocity
        momentum[:, 2] += inertia * qd[:, k, 2] + mass * (place[:, 0] * velocity[:, 1] - place[:, 1] * velocity[:, 0])
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), rtol=0, atol=1e-8)
    assert run.kinetic_energy.values[-1] < run.kinetic_energy.values[0] - 0.01


@pytest.mark.parametrize("method", ["rk4", "rkf45", "rk8pd", "gbs", "seulex", "msbdf"])
@pytest.mark.parametrize("bounds", [{"min": 1.0}, {"max": 1.0}, {"max": 1.0 + 1e-12}, {"min": 1.0, "max": 1.0 + 1e-9}])
def test_a_distance_that_never_changes_strikes_nothing(method: str, bounds: dict[str, float]) -> None:
    """From a pendulum's pivot to its tip: rounding alone leads it to its stop, where an impulse on a lever of rounding was any number. The
    pendulum swings as without the stop."""
    for rate in (0.0, 5.0):
        given = {
            "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"O": [0.1, 0.2]}},
            "link": [{"name": "rod", "mass": 1.3, "inertia": 0.1, "cog": [0.5, 0], "markers": {"O": [0, 0], "T": [0.6, 0.8]}}],
            "joint": [{"name": "O", "type": "revolute", "between": ["frame.O", "rod.O"]}],
            "coordinate": [{"joint": "O", "start": {"position": 0.3, "velocity": rate}}],
            "actuator": [{"joint": "O", "law": {"type": "constant", "value": 0.0}}],
        }
        free = linkdyn.Scene(given).forward(t=np.linspace(0, 2, 5), method=method)
        given |= {"measures": {"length": {"between": ["frame.O", "rod.T"]}}, "stop": [{"name": "end", "measure": "length", "restitution": 0.3} | bounds]}
        run = linkdyn.Scene(given).forward(t=np.linspace(0, 2, 5), method=method)
        assert run.attrs["stopped"] == ""
        np.testing.assert_allclose(run.q, free.q, rtol=0, atol=1e-5)
        energy = run.kinetic_energy + run.potential_energy
        assert float(abs(energy - energy[0]).max()) < 1e-4, "of 20 J; the impulses gained 0.75 J"
