"""Joints that rub along several joint variables and stick: what slips comes to rest as a whole, and breaks loose as one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import linkdyn

G = 9.81
HOLDS, SLIPS = 2, 1
FINE = {"rtol": 1e-10, "atol": 1e-12}


def scene(kind: str, variables: dict[str, float], link: dict[str, Any], friction: dict[str, Any], **parts: Any) -> linkdyn.Scene:
    """One body at one joint of the frame, by its joint variables, with their rates at the start."""
    data: dict[str, Any] = {
        "space": "spatial",
        "gravity": [0, 0, -G],
        "frame": {"markers": {"J": [0, 0, 0]}},
        "link": [{"name": "body", "markers": {"J": [0, 0, 0]}} | link],
        "joint": [{"name": "J", "type": kind, "between": ["frame.J", "body.J"]}],
        "coordinate": [{"joint": "J", "variable": v, "start": {"position": 0, "velocity": rate}} for v, rate in variables.items()],
        "friction": [{"joint": "J", "sticking": True} | friction],
        "time": {"end": 1},
    }
    return linkdyn.Scene(data | parts)


def bush(spin: float, slide: float, inertia: float = 4e-4, **parts: Any) -> linkdyn.Scene:
    """2 kg in a bush that a spring presses."""
    link = {"mass": 2.0, "inertia": [0.01, 0.01, inertia, 0, 0, 0]}
    friction = {"coulomb": 0.3, "radius": 0.02, "preload": 25.0}
    return scene("cylindrical", {"angle": spin, "slide": slide}, link, friction, **({"gravity": [0, 0, 0]} | parts))


def to_rest(rates: Any, start: list[float], levers: list[float], end: float) -> Any:
    """Until the surface hardly slides any more; the state has as many places as rates behind it."""
    stop = lambda t, y: np.linalg.norm(y[-len(levers):] * np.array(levers)) - 1e-9
    stop.terminal = True
    return solve_ivp(rates, (0, end), start, rtol=1e-11, atol=1e-14, method="LSODA", events=stop)


@pytest.mark.parametrize("method", [None, "gbs", "seulex"])
def test_turns_and_slides_to_rest_along_a_helix_or_a_bend(method):
    """With J = m r^2 all directions are alike, the way stays and all stops after V m/(mu N); else it bends, and turns into the slower one."""
    run = bush(30.0, 0.8, 2 * 0.02**2 * 1.0).forward(t=np.linspace(0, 1, 21), method=method, **FINE)
    stop = np.hypot(0.02 * 30, 0.8) * 2 / (0.3 * 25)
    np.testing.assert_allclose(run.event_time, [stop], rtol=1e-8)
    np.testing.assert_allclose(run.q.values[-1], np.array([30.0, 0.8]) * stop / 2, rtol=1e-9)
    assert (run.qd.values[run.time.values > stop] == 0).all()
    run = bush(40.0, 0.5).forward(t=np.linspace(0, 1, 21), method=method, **FINE)

    def rates(t, y):
        speed = np.hypot(0.02 * y[2], y[3])
        return [y[2], y[3], -7.5 * 0.02**2 * y[2] / speed / 4e-4, -7.5 * y[3] / speed / 2]

    own = to_rest(rates, [0, 0, 40.0, 0.5], [0.02, 1], 1)
    np.testing.assert_allclose(run.event_time, own.t[-1:], rtol=1e-7)
    np.testing.assert_allclose(run.q.values[-1], own.y[:2, -1], rtol=1e-8)
    assert list(run.clutch.values) == ["J.angle", "J.slide"] and list(run.event.values) == ["J"]
    assert (run.clutch_state.values[0] == SLIPS).all() and (run.clutch_state.values[-1] == HOLDS).all()


@pytest.mark.parametrize("turns", [0.0, 0.8])
def test_a_plate_breaks_loose_where_the_vector_of_what_holds_it_is_used_up(turns):
    """Force and moment grow, each of them far within what it alone would take; from there it goes as Coulomb says."""
    radius, grip, mass, inertia = 0.05, 0.4 * 3 * G, 3.0, 0.02
    pull = np.array([30.0, 10.0, turns])
    load = [{"on": "body.J", "force": ["30 N/s*time", "10 N/s*time", 0], "moment": [0, 0, f"{turns} N*m/s*time"]}]
    link = {"mass": mass, "inertia": [0.01, 0.01, inertia, 0, 0, 0]}
    run = scene("planar", {"x": 0, "y": 0, "angle": 0}, link, {"coulomb": 0.4, "radius": radius}, load=load).forward(
        t=np.linspace(0, 1, 11), method="seulex", **FINE)
    on_surface = pull / [1, 1, radius]
    loose = grip / np.linalg.norm(on_surface)
    np.testing.assert_allclose(run.event_time, [loose], rtol=1e-10)
    held = run.clutch_state.values[:, 0] == HOLDS
    np.testing.assert_allclose(run.clutch_force.values[held], -run.time.values[held, None] * pull, atol=1e-11)
    assert (run.q.values[held] == 0).all() and held.sum() == 4

    def rates(t, y):
        speed = np.linalg.norm(y[3:] * [1, 1, radius])
        rub = grip * y[3:] * [1, 1, radius**2] / max(speed, 1e-300)
        return np.r_[y[3:], (pull * (t + loose) - rub) / [mass, mass, inertia]]

    start = 1e-11 * on_surface / np.linalg.norm(on_surface) / [1, 1, radius]
    own = solve_ivp(rates, (0, 1 - loose), np.r_[0, 0, 0, start], rtol=1e-10, atol=1e-15, method="Radau")
    np.testing.assert_allclose(run.qd.values[-1], own.y[3:, -1], rtol=1e-6, atol=1e-9)


def test_a_push_that_comes_at_once_makes_it_slide_the_way_that_it_keeps():
    """a - c W d = r d with |d| = 1: by one root, and at the first instant of the run."""
    load = [{"on": "body.J", "force": [20.0, 5.0, 0], "moment": [0, 0, 1.5]}]
    link = {"mass": 3.0, "inertia": [0.01, 0.01, 0.02, 0, 0, 0]}
    run = scene("planar", {"x": 0, "y": 0, "angle": 0}, link, {"coulomb": 0.4, "radius": 0.05}, load=load).forward(t=[0, 1e-3], **FINE)
    response = np.array([1 / 3, 1 / 3, 0.05**2 / 0.02])
    apart, grip = response * [20.0, 5.0, 1.5 / 0.05], 0.4 * 3 * G
    way = lambda r: apart / (r + grip * response)
    r = brentq(lambda r: np.linalg.norm(way(r)) - 1, 0, np.linalg.norm(apart), xtol=1e-14)
    np.testing.assert_allclose(run.qdd.values[0], r * way(r) / [1, 1, 0.05], rtol=1e-9)
    assert (run.clutch_state.values[0] == SLIPS).all()


def test_without_a_radius_a_plate_turns_freely_and_is_held_along():
    link = {"mass": 3.0, "inertia": [0.01, 0.01, 0.02, 0, 0, 0]}
    run = scene("planar", {"x": 0, "y": 0, "angle": 2.0}, link, {"coulomb": 0.4}).forward(t=[0, 1.0], **FINE)
    np.testing.assert_allclose(run.q.values[-1], [0, 0, 2.0], atol=1e-12)
    assert list(run.clutch.values) == ["J.x", "J.y"] and (run.clutch_state == HOLDS).all()


MASS, COG = 2.0, np.array((0.1, 0.02, -0.15))
ABOUT = np.diag((0.02, 0.03, 0.015)) + MASS * (COG @ COG * np.eye(3) - np.outer(COG, COG))


def ball(**friction: Any) -> linkdyn.Scene:
    link = {"mass": MASS, "cog": list(COG), "inertia": [0.02, 0.03, 0.015, 0, 0, 0]}
    friction = {"coulomb": 0.2, "radius": 0.03, "preload": 50.0} | friction
    return scene("spherical", {"roll": 2.0, "pitch": 1.0, "yaw": -3.0}, link, friction)


def rotation(q: np.ndarray) -> np.ndarray:
    a, b, c, d = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)],
                     [2 * (b * c + a * d), 1 - 2 * (b * b + d * d), 2 * (c * d - a * b)],
                     [2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)]])


def swing(t: float, y: np.ndarray) -> np.ndarray:
    """A body on a ball by quaternion and spin about its own axes; what presses the ball depends on how it is braked."""
    (a, b, c, d), w = y[:4], y[4:]
    weight = rotation(y[:4]).T @ [0, 0, -G]
    press = 50.0 + MASS * G
    for _ in range(12):                              # each takes away all but a hundredth
        moment = MASS * np.cross(COG, weight) - 0.2 * press * 0.03 * w / np.linalg.norm(w)
        spin = np.linalg.solve(ABOUT, moment - np.cross(w, ABOUT @ w))
        press = 50.0 + np.linalg.norm(MASS * (np.cross(spin, COG) + np.cross(w, np.cross(w, COG)) - weight))
    turn = 0.5 * np.array([-b * w[0] - c * w[1] - d * w[2], a * w[0] + c * w[2] - d * w[1], a * w[1] + d * w[0] - b * w[2],
                           a * w[2] + b * w[1] - c * w[0]])
    return np.r_[turn, spin]


def test_a_ball_sticks_by_its_own_load():
    run = ball().forward(t=np.linspace(0, 40, 161), want=["reaction", "friction", "power", "clutch", "checks"], **FINE)
    own = to_rest(swing, [1, 0, 0, 0, 2.0, 1.0, -3.0], [0.03] * 3, 2)
    np.testing.assert_allclose(run.event_time, own.t[-1:], rtol=1e-7)
    turned = rotation(own.y[:4, -1])
    angles = [np.arctan2(-turned[1, 2], turned[2, 2]), np.arcsin(turned[0, 2]), np.arctan2(-turned[0, 1], turned[0, 0])]
    late = run.q.values[run.time.values > own.t[-1]]
    np.testing.assert_allclose(late[0], angles, rtol=1e-7)
    assert (late == late[0]).all()                   # to the last digit, however long
    # what holds it carries the moment of its weight, about the axes of the frame, and the ball itself no moment
    moment = MASS * G * np.cross(turned @ COG, [0, 0, 1])
    np.testing.assert_allclose(run.clutch_force.values[-1], moment, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(run.friction.values[-1, 0], np.r_[0, 0, 0, moment], rtol=1e-6, atol=1e-8)
    assert np.abs(run.power_imbalance).max() < 1e-12


def test_energy_goes_where_friction_takes_it():
    t = np.linspace(0, 1.6, 3201)
    run = ball().forward(t=t, want=["friction", "power"], **FINE)
    energy = run.kinetic_energy + run.potential_energy
    taken = np.trapezoid(run.friction_power.sum("joint").values, t)
    assert (np.diff(energy) <= 1e-12).all()
    np.testing.assert_allclose(energy.values[0] - energy.values[-1], taken, rtol=1e-6)


@pytest.mark.thorough
def test_smooth_friction_comes_to_it_as_it_creeps_less():
    at = {"t": np.linspace(0, 1.5, 4), "method": "seulex", "rtol": 1e-9, "atol": 1e-11}
    true = ball().forward(**at).q.values[-1]
    off = [np.abs(ball(sticking=False, creep_speed=c).forward(**at).q.values[-1] - true).max() for c in (1e-3, 1e-4, 1e-5)]
    assert off[1] < off[0] / 5 and off[2] < off[1] / 5 and off[2] < 3e-4


def test_a_bush_that_its_own_acceleration_tilts_begins_the_way_it_goes_on():
    """Its centre of mass is beside the axis: who slides along it presses both ends, and the harder the faster; at rest it is held by another
    force than it slides against."""
    mass, off, length, mu, radius = 2.0, 0.15, 0.1, 0.1, 0.02
    link = {"mass": mass, "cog": [off, 0, 0], "inertia": [0.01, 0.01, 0.02, 0, 0, 0]}
    load = [{"on": "body.J", "force": [0, 0, 60.0], "moment": [0, 0, 1.0]}]
    friction = {"coulomb": mu, "radius": radius, "length": length, "preload": 5.0}
    run = scene("cylindrical", {"angle": 0, "slide": 0}, link, friction, load=load).forward(t=[0, 1e-4], **FINE)

    def found(way: float) -> np.ndarray:
        """Accelerations, of angle and slide, with friction against (cos, sin)(way)."""
        across, tilt, press = np.zeros(3), np.zeros(3), 0.0
        for _ in range(200):
            turn = (1.0 - mu * press * radius * np.cos(way)) / (0.02 + mass * off**2)
            slide = (60.0 - mu * press * np.sin(way)) / mass - G
            across = mass * np.array([0, off * turn, 0])
            tilt = mass * np.cross([off, 0, 0], [0, off * turn, slide + G])    # of the reaction about the marker
            tilt = np.cross(tilt * [1, 1, 0], [0, 0, 1]) / length
            press = 5.0 + np.linalg.norm(across / 2 + tilt) + np.linalg.norm(across / 2 - tilt)
        return np.array([turn, slide])

    def turns(way: float) -> float:
        turn, slide = found(way)
        return radius * turn * np.sin(way) - slide * np.cos(way)

    want = found(brentq(turns, 0.01, 1.56, xtol=1e-14))
    np.testing.assert_allclose(run.qdd.values[0], want, rtol=1e-8)


def test_each_pin_of_a_universal_joint_holds_for_itself():
    load = [{"on": "body.J", "moment": [0, "0.3 N*m/s*time", "0.8 N*m/s*time"]}]
    body = {"mass": 1.0, "inertia": [0.01, 0.012, 0.014, 0, 0, 0], "markers": {"J": {"at": [0, 0, 0], "axis": [0, 1, 0]}}}
    run = scene("universal", {"angle1": 0, "angle2": 0}, body, {"coulomb": 0.2, "radius": 0.02, "preload": 100.0}, load=load,
                gravity=[0, 0, 0]).forward(t=np.linspace(0, 1, 5), **FINE)
    np.testing.assert_allclose(run.event_time, [0.5], rtol=1e-10)
    assert list(run.event.values) == ["J.angle1"]
    np.testing.assert_allclose(run.q.values[-1], [0.8 / (6 * 0.014) * 0.5**3, 0], rtol=1e-8)


def rocker() -> dict[str, Any]:
    """A crank, a rod on a universal joint and a ball, a rocker: nobody counts how the rod's joints are turned."""
    return {
        "space": "spatial", "gravity": [0, 0, -G],
        "frame": {"markers": {"A": {"at": [0, 0, 0]}, "D": {"at": [0.5, 0.1, 0.0], "axis": [0, 1, 0]}}},
        "link": [{"name": "crank", "markers": {"A": [0, 0, 0], "B": [0.1, 0, 0.02]}, "mass": 0.5, "inertia": [0.001, 0.001, 0.002, 0, 0, 0]},
                 {"name": "rod", "markers": {"B": [0, 0, 0], "C": [0.45, 0, 0]}, "mass": 0.8, "cog": [0.2, 0.01, 0.02],
                  "inertia": [0.002, 0.01, 0.011, 0, 0, 0]},
                 {"name": "rocker", "markers": {"C": {"at": [0, 0, 0.3]}, "D": {"at": [0, 0, 0], "axis": [0, 1, 0]}}, "mass": 1.0,
                  "cog": [0, 0, 0.15], "inertia": [0.01, 0.01, 0.002, 0, 0, 0]}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]},
                  {"name": "B", "type": "universal", "between": ["crank.B", "rod.B"]},
                  {"name": "C", "type": "spherical", "between": ["rod.C", "rocker.C"]},
                  {"name": "D", "type": "revolute", "between": ["frame.D", "rocker.D"]}],
        "coordinate": [{"joint": "A", "start": {"position": 0.3, "velocity": 4.0}}],
        "friction": [{"joint": j, "coulomb": 0.1, "radius": 0.03, "preload": 60.0, "sticking": True} for j in "C"],
        "time": {"end": 20},
    }  # fmt: skip


def test_a_ball_in_a_loop_is_held_without_creep():
    atol = 1e-10
    run = linkdyn.Scene(rocker()).forward(t=np.linspace(0, 100, 51), rtol=1e-8, atol=atol, want=["clutch", "checks"])
    assert list(run.event.values) == ["C"] and (run.clutch_state.values[-1] == HOLDS).all()
    late = run.q.values[run.time.values > float(run.event_time[-1])]
    # what rounding of accelerations does over steps of seconds is within the tolerance; the methods differ in how long these are
    assert np.abs(late - late[-1]).max() < atol
    assert np.abs(run.power_imbalance).max() < 1e-12


def test_ensembles_and_simulators_do_the_same():
    s, t = bush(40.0, 0.5), np.linspace(0, 0.3, 7)
    rates = np.array([[40.0, 0.5], [20.0, 0.1], [0.0, 0.0]])
    members = s.ensemble(np.zeros((3, 2)), rates, t, step=1e-3)
    for k in range(3):
        alone = bush(*rates[k]).forward(method="rk4", step=1e-3, t=t)
        np.testing.assert_allclose(members.q[k], alone.q, atol=1e-12)
    assert (members.qd.values[:, -1] == 0).all()
    pushed = bush(40.0, 0.5, actuator=[{"joint": "J", "variable": "slide", "law": {"type": "constant", "value": 5.0}}])
    run = pushed.forward(t=[0, 0.1, 0.3], **FINE)
    simulator = pushed.simulator(**FINE)
    for k in range(1, 31):
        simulator.step(0.01, [5.0])
        if k == 10:
            np.testing.assert_allclose(simulator.qd, run.qd.values[1], rtol=1e-8)
    np.testing.assert_allclose(simulator.q, run.q.values[-1], rtol=1e-8)


def test_an_impact_is_more_than_it_holds():
    """It slides into a stop, which throws it back: it turns on, and comes to rest at last."""
    s = bush(20.0, 0.8, stop=[{"name": "wall", "joint": "J", "variable": "slide", "max": 0.03, "restitution": 0.5}])
    run = s.forward(t=np.linspace(0, 1, 41), **FINE)
    kinds = [str(n) for n in run.event.values]
    assert kinds == ["wall.max", "J"]

    def rates(t, y):
        speed = np.hypot(0.02 * y[2], y[3])
        return [y[2], y[3], -7.5 * 0.02**2 * y[2] / speed / 4e-4, -7.5 * y[3] / speed / 2]

    wall = lambda t, y: y[1] - 0.03
    wall.terminal = True
    first = solve_ivp(rates, (0, 1), [0, 0, 20.0, 0.8], rtol=1e-11, atol=1e-13, events=wall, method="DOP853")
    then = to_rest(rates, list(first.y[:3, -1]) + [-0.5 * first.y[3, -1]], [0.02, 1], 1)
    np.testing.assert_allclose(run.event_time, [first.t[-1], first.t[-1] + then.t[-1]], rtol=1e-7)
    np.testing.assert_allclose(run.q.values[-1], then.y[:2, -1], rtol=1e-7)
