"""Links joined where they stand: bodies that dock, parts that are grasped, joints of several variables that lock.

Momentum, energy and the motion behind are reckoned here from masses and poses, by numpy alone; mechanisms that have the joint from the
start, or are one body, are other scenes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr

import linkdyn
from integrators import METHODS

TIGHT = {"rtol": 1e-12, "atol": 1e-12}

BODY: dict[str, dict[str, Any]] = {
    "a": {"mass": 2.0, "inertia": [0.3, 0.4, 0.5, 0.01, 0.02, -0.03], "cog": [0.1, -0.05, 0.02]},
    "b": {"mass": 3.0, "inertia": [0.2, 0.6, 0.7, 0.0, 0.0, 0.0], "cog": [0.0, 0.0, 0.03]},
    "c": {"mass": 0.7, "inertia": [0.05, 0.06, 0.02, 0.0, 0.01, 0.0], "cog": [0.02, 0.01, 0.0]},
}
MARKER = {"a": {"m": {"at": [0.5, 0, 0], "axis": [0.3, 1, 0.2]}}, "b": {"n": {"at": [-0.4, 0.1, 0], "axis": [1, 0.2, -0.1]}}, "c": {"k": [0, 0.2, 0]}}
START = {
    "a": {"position": [0, 0, 0], "angles": [0.1, 0.2, 0.3], "velocity": [1, 0, 0], "angular_rates": [0.5, -0.2, 0.8]},
    "b": {"position": [1.2, 0, 0], "angles": [-0.1, 0.5, 0], "velocity": [-1, 0.3, 0], "angular_rates": [0.1, 0.4, -2.0]},
    "c": {"position": [0.4, 1, 0.3], "angles": [1, 0.2, 0.4], "velocity": [0, -1.3, 0.2], "angular_rates": [0.6, 1.1, 0.3]},
}


# ------------------------------------------------------------------------------------------------------- rigid bodies, by hand
def rotation(angles) -> np.ndarray:
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    return np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]]) @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]]) @ np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])


def rate_axes(angles) -> np.ndarray:
    """About which roll, pitch and yaw turn, in columns."""
    roll = rotation([angles[0], 0, 0])
    return np.column_stack([[1, 0, 0], roll @ [0, 1, 0], rotation(angles) @ [0, 0, 1]])


def tensor(link: str) -> np.ndarray:
    xx, yy, zz, xy, yz, zx = BODY[link]["inertia"]
    return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])


class Motion:
    """Of one link, by its pose and the rates of that."""

    def __init__(self, link: str, q, qd) -> None:
        self.r, self.omega, self.at, self.velocity = rotation(q[3:]), rate_axes(q[3:]) @ qd[3:], np.array(q[:3]), np.array(qd[:3])
        self.mass = BODY[link]["mass"]
        self.inertia = self.r @ tensor(link) @ self.r.T
        self.cog = self.point(BODY[link]["cog"])
        self.cog_velocity = self.speed(self.cog)

    def point(self, own) -> np.ndarray:
        return self.at + self.r @ np.array(own, dtype=float)

    def speed(self, point) -> np.ndarray:
        return self.velocity + np.cross(self.omega, point - self.at)

    @property
    def momentum(self) -> np.ndarray:
        """Linear and angular, about the origin."""
        linear = self.mass * self.cog_velocity
        return np.concatenate([linear, self.inertia @ self.omega + np.cross(self.cog, linear)])

    @property
    def energy(self) -> float:
        return float(self.mass * self.cog_velocity @ self.cog_velocity + self.omega @ self.inertia @ self.omega) / 2


def motions(links: str, q, qd) -> list[Motion]:
    return [Motion(link, q[6 * k : 6 * k + 6], qd[6 * k : 6 * k + 6]) for k, link in enumerate(links)]


def as_one(bodies: list[Motion]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centre of mass, velocity there and angular velocity of bodies that keep their momentum and move as one."""
    mass = sum(b.mass for b in bodies)
    centre = sum(b.mass * b.cog for b in bodies) / mass
    total = sum(b.momentum for b in bodies)
    inertia = sum(b.inertia + b.mass * ((b.cog - centre) @ (b.cog - centre) * np.eye(3) - np.outer(b.cog - centre, b.cog - centre)) for b in bodies)
    velocity = total[:3] / mass
    return centre, velocity, np.linalg.solve(inertia, total[3:] - np.cross(centre, mass * velocity))


# -------------------------------------------------------------------------------------------------------------------- scenes
def floating(links: str = "ab", **parts: Any) -> linkdyn.Scene:
    """Free bodies that come together, without gravity."""
    description: dict[str, Any] = {
        "space": "spatial",
        "frame": {"markers": {"o": [0, 0, 0]}},
        "link": [{"name": link, "markers": MARKER[link], **BODY[link]} for link in links],
        "coordinate": [{"link": link, "start": START[link]} for link in links],
        "clutch": [{"name": "dock", "between": ["a.m", "b.n"], "from": 0.25, "until": 1.5}],
        "time": {"end": 2},
    }
    return linkdyn.Scene(description | parts)


def kinds(run: xr.Dataset) -> list[tuple[str, str]]:
    meanings = run.event_kind.attrs["flag_meanings"].split()
    return [(str(name), meanings[kind]) for name, kind in zip(run.event.values, run.event_kind.values)]


# -------------------------------------------------------------------------------------------------------- two bodies, by hand
@pytest.mark.parametrize("method", METHODS)
def test_two_free_bodies_stick_together(method):
    settings = {"step": 0.002} if method == "rk4" else {}
    run = floating().forward(method=method, t=np.linspace(0, 2, 41), **settings)
    assert kinds(run) == [("dock", "close"), ("dock", "open")]
    np.testing.assert_allclose(run.event_time, [0.25, 1.5], rtol=1e-14)
    before = motions("ab", run.event_q.values[0], run.event_qd.values[0])
    behind = motions("ab", run.event_q.values[0], run.event_qd_after.values[0])
    np.testing.assert_allclose(sum(b.momentum for b in behind), sum(b.momentum for b in before), rtol=0, atol=1e-12)
    centre, velocity, omega = as_one(before)
    for body in behind:
        np.testing.assert_allclose(body.omega, omega, rtol=0, atol=1e-12)
        np.testing.assert_allclose(body.cog_velocity, velocity + np.cross(omega, body.cog - centre), rtol=0, atol=1e-12)
    loss = sum(b.energy for b in before) - sum(b.energy for b in behind)
    assert loss > 1 and float(run.event_loss[0]) == pytest.approx(loss, rel=1e-12)
    jump = (behind[0].cog_velocity - before[0].cog_velocity) * behind[0].mass
    assert float(run.event_impulse[0]) == pytest.approx(np.linalg.norm(jump), rel=1e-12)
    # released, both go on as they were
    np.testing.assert_array_equal(run.event_qd.values[1], run.event_qd_after.values[1])
    assert np.isnan(run.event_loss[1]) or run.event_loss[1] == 0


def test_what_docks_moves_as_one_body():
    run = floating().forward(t=np.linspace(0, 1.45, 59), **TIGHT)
    a, b = motions("ab", run.event_q.values[0], run.event_qd_after.values[0])
    # the second body, welded to the first where it was caught, is a marker and axes of the first
    n = np.array(MARKER["b"]["n"]["at"])
    at = a.r.T @ (b.point(n) - a.at)
    turn = a.r.T @ b.r
    axes = {"axis": turn[:, 2].tolist(), "x": turn[:, 0].tolist()}
    start = {"position": a.at.tolist(), "angles": run.event_q.values[0][3:6].tolist(), "velocity": a.velocity.tolist(), "angular_rates": run.event_qd_after.values[0][3:6].tolist()}
    welded = linkdyn.Scene({
        "space": "spatial", "frame": {"markers": {"o": [0, 0, 0]}},
        "link": [{"name": "a", "markers": {"w": {"at": at.tolist(), **axes}}, **BODY["a"]}, {"name": "b", "markers": {"w": n.tolist()}, **BODY["b"]}],
        "joint": [{"name": "w", "type": "fixed", "between": ["a.w", "b.w"]}],
        "coordinate": [{"link": "a", "start": start}],
        "time": {"end": 1.2},
    })  # fmt: skip
    held = run.time.values > 0.2501
    other = welded.forward(t=[0, *(run.time.values[held] - 0.25)], **TIGHT).isel(sample=slice(1, None))
    np.testing.assert_allclose(run.q.values[held][:, :6], other.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.qd.values[held][:, :6], other.qd, rtol=0, atol=1e-9)
    # what holds is the weld's reaction, along the axes of the first marker
    marker = np.array(MARKER["a"]["m"]["axis"]) / np.linalg.norm(MARKER["a"]["m"]["axis"])
    along = [a_r @ marker for a_r in (rotation(q[3:6]) for q in run.q.values[held])]
    reaction = other.reaction.sel(joint="w").values
    force = np.array([np.dot(z, f[:3]) for z, f in zip(along, reaction)])
    moment = np.array([np.dot(z, f[3:]) for z, f in zip(along, reaction)])
    np.testing.assert_allclose(run.clutch_force.sel(clutch="dock.z").values[held], force, rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.clutch_force.sel(clutch="dock.about_z").values[held], moment, rtol=0, atol=1e-8)
    assert run.clutch_force.sel(clutch="dock.z").attrs == run.clutch_force.attrs


# --------------------------------------------------------------------------------------------------- held as by other joints
FREE: dict[str, list[tuple[str, str, int]]] = {
    "spherical": [("roll", "turn", 0), ("pitch", "turn", 1), ("yaw", "turn", 2)],
    "revolute": [("angle", "turn", 2)],
    "cylindrical": [("angle", "turn", 2), ("slide", "slide", 2)],
    "prismatic": [("slide", "slide", 2)],
    "planar": [("x", "slide", 0), ("y", "slide", 1), ("angle", "turn", 2)],
}


@pytest.mark.parametrize("kind", FREE)
def test_held_as_by_a_joint_that_is_there_from_the_start(kind):
    load = {"load": [{"on": "b.n", "force": [0.3, -0.2, 0.5], "moment": [0.02, 0.05, -0.1]}], "gravity": [0, 0, -1]}
    end = 4.0  # the hinge goes round more than once
    run = floating(clutch=[{"name": "dock", "between": ["a.m", "b.n"], "type": kind, "from": 0.25}], **load).forward(t=np.linspace(0, end, 81), **TIGHT)
    a, b = motions("ab", run.event_q.values[0], run.event_qd_after.values[0])
    point = b.point(MARKER["b"]["n"]["at"])
    z = a.r @ (np.array(MARKER["a"]["m"]["axis"]) / np.linalg.norm(MARKER["a"]["m"]["axis"]))
    x = np.cross(z, [0, 0, 1])
    x /= np.linalg.norm(x)
    frame = np.column_stack([x, np.cross(z, x), z])
    turning, sliding = frame.T @ (b.omega - a.omega), frame.T @ (b.speed(point) - a.speed(point))
    free = FREE[kind]
    rates = {"turn": turning, "slide": sliding}
    # what is not free does not move
    for what in rates:
        fixed = [k for k in range(3) if all((w, i) != (what, k) for _, w, i in free)]
        np.testing.assert_allclose(rates[what][fixed], 0, atol=1e-12)

    def marker(body: Motion) -> dict[str, Any]:
        return {"at": (body.r.T @ (point - body.at)).tolist(), "axis": (body.r.T @ z).tolist(), "x": (body.r.T @ x).tolist()}

    q, qd = run.event_q.values[0], run.event_qd_after.values[0]
    start = {"position": q[:3].tolist(), "angles": q[3:6].tolist(), "velocity": qd[:3].tolist(), "angular_rates": qd[3:6].tolist()}
    jointed = linkdyn.Scene({
        "space": "spatial", "frame": {"markers": {"o": [0, 0, 0]}},
        "link": [{"name": "a", "markers": {"j": marker(a)}, **BODY["a"]}, {"name": "b", "markers": {"j": marker(b), **MARKER["b"]}, **BODY["b"]}],
        "joint": [{"name": "j", "type": kind, "between": ["a.j", "b.j"]}],
        "coordinate": [{"link": "a", "start": start}] + [
            {"joint": "j", "start": {"position": 0, "velocity": float(rates[what][k])}} | ({"variable": name} if len(free) > 1 else {})
            for name, what, k in free],
        "time": {"end": end - 0.25},
        **load,
    })  # fmt: skip
    late = run.time.values > 0.2501
    other = jointed.forward(t=[0, *(run.time.values[late] - 0.25)], **TIGHT).isel(sample=slice(1, None))
    assert (other.status == 0).all() and (run.status == 0).all()
    np.testing.assert_allclose(run.q.values[late][:, :6], other.q.values[:, :6], rtol=0, atol=2e-8)
    # and nothing has been carried off
    for q in run.q.values[late]:
        first, second = motions("ab", q, 0 * q)
        now = first.r @ a.r.T
        gap = second.point(MARKER["b"]["n"]["at"]) - first.point(a.r.T @ (point - a.at))
        lean = np.cross(now @ z, second.r @ b.r.T @ z)
        if kind != "planar":
            along = 0 if kind in ("spherical", "revolute") else now @ np.outer(z, z) @ now.T @ gap
            np.testing.assert_allclose(gap, along, rtol=0, atol=1e-9)
        if kind != "spherical":
            np.testing.assert_allclose(lean, 0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("tolerance", [1e-5, 1e-7])
def test_what_is_held_stays(tolerance: float) -> None:
    """Over a minute in which the hinge goes round gap and lean stay within a hundred tolerances of where they were."""
    load = [{"on": "b.n", "moment": [0.0, 0.05, -0.1]}]
    scene = floating(load=load, clutch=[{"name": "dock", "between": ["a.m", "b.n"], "type": "revolute", "from": 0.25}])
    run = scene.forward(t=np.linspace(0, 60, 61), rtol=tolerance, atol=tolerance)
    assert (run.status == 0).all()
    z = np.array(MARKER["a"]["m"]["axis"]) / np.linalg.norm(MARKER["a"]["m"]["axis"])

    def seen(q) -> tuple[np.ndarray, np.ndarray]:
        first, second = motions("ab", q, 0 * q)
        return first.r.T @ (second.point(MARKER["b"]["n"]["at"]) - first.at), first.r.T @ second.r

    gap, attitude = seen(run.event_q.values[0])
    places = [seen(q) for q in run.q.values[1:]]
    np.testing.assert_allclose([p[0] - gap for p in places], 0, atol=100 * tolerance)
    np.testing.assert_allclose([np.cross(p[1] @ attitude.T @ z, z) for p in places], 0, atol=100 * tolerance)


# ------------------------------------------------------------------------------------------------------------ several, again
def test_three_bodies_join_at_one_instant_and_part_one_by_one():
    clutches = [
        {"name": "ab", "between": ["a.m", "b.n"], "from": 0.25, "until": 0.6},
        {"name": "bc", "between": ["b.n", "c.k"], "from": 0.25, "until": 0.8},
    ]
    run = floating("abc", clutch=clutches).forward(t=np.linspace(0, 1, 21), **TIGHT)
    assert kinds(run) == [("ab", "close"), ("bc", "close"), ("ab", "open"), ("bc", "open")]
    before = motions("abc", run.event_q.values[0], run.event_qd.values[0])
    behind = motions("abc", run.event_q.values[1], run.event_qd_after.values[1])
    centre, velocity, omega = as_one(before)
    for body in behind:
        np.testing.assert_allclose(body.omega, omega, rtol=0, atol=1e-12)
        np.testing.assert_allclose(body.cog_velocity, velocity + np.cross(omega, body.cog - centre), rtol=0, atol=1e-12)
    loss = sum(b.energy for b in before) - sum(b.energy for b in behind)
    assert np.nansum(run.event_loss.values) == pytest.approx(loss, rel=1e-12)
    total = sum(b.momentum for b in before)
    for q, qd in zip(run.q.values, run.qd.values):
        np.testing.assert_allclose(sum(b.momentum for b in motions("abc", q, qd)), total, rtol=0, atol=1e-9)


def test_an_event_closes_and_each_closing_counts():
    gap = {"gap": {"between": ["a.m", "b.n"]}}
    events = [{"name": "near", "when": "gap - 350 mm", "direction": "down"}]
    scene = floating(measures=gap, event=events, clutch=[{"name": "dock", "between": ["a.m", "b.n"], "from_event": "near", "until": 1.0, "begins": "off"}])
    run = scene.forward(t=np.linspace(0, 2, 41), **TIGHT)
    # while it is held at the gap that closed it, that event does not happen again, whatever errors of the steps do to the gap
    assert kinds(run)[:3] == [("near", "crossing"), ("dock", "close"), ("dock", "open")]
    loose = scene.forward(t=np.linspace(0, 0.99, 100), rtol=1e-6, atol=1e-6)
    assert kinds(loose) == [("near", "crossing"), ("dock", "close")]
    q = run.event_q.values[1]
    a, b = motions("ab", q, 0 * q)
    assert np.linalg.norm(b.point(MARKER["b"]["n"]["at"]) - a.point(MARKER["a"]["m"]["at"])) == pytest.approx(0.35, abs=1e-9)


def test_ensembles_and_simulators_do_the_same():
    scene = floating()
    t = np.linspace(0, 2, 21)
    run = scene.forward(t=t, **TIGHT)
    start_q, start_qd = run.q.values[0], run.qd.values[0]
    many = scene.ensemble(q=np.array([start_q, start_q]), qd=np.array([start_qd, 0.5 * start_qd]), t=t)
    np.testing.assert_allclose(many.q[0], run.q, rtol=0, atol=1e-7)
    first = many.event_member.values == 0
    np.testing.assert_allclose(many.event_loss.values[first], run.event_loss, rtol=1e-7)
    assert many.event_loss.values[~first][0] < many.event_loss.values[first][0]
    simulator = scene.simulator(**TIGHT)
    for k, step in enumerate(np.diff(t)):
        simulator.step(step)
        np.testing.assert_allclose(simulator.q, run.q.values[k + 1], rtol=0, atol=1e-9)


def test_a_body_that_is_caught_by_the_frame_rests_and_is_carried():
    run = floating("a", gravity=[0, 0, -9.81], clutch=[{"name": "hook", "between": ["frame.o", "a.m"], "from": 0.1}]).forward(t=np.linspace(0, 3, 31), **TIGHT)
    late = run.sel(time=slice(0.11, None))
    np.testing.assert_allclose(late.q, np.broadcast_to(run.event_q.values[0], late.q.shape), rtol=0, atol=1e-11)
    np.testing.assert_allclose(late.clutch_force.values[:, :3], np.broadcast_to([0, 0, 2 * 9.81], (late.time.size, 3)), rtol=0, atol=1e-9)
    a = Motion("a", run.event_q.values[0], 0 * run.event_q.values[0])
    moment = np.cross(a.cog - a.point(MARKER["a"]["m"]["at"]), [0, 0, -2 * 9.81])
    np.testing.assert_allclose(late.clutch_force.values[:, 3:], np.broadcast_to(-moment, (late.time.size, 3)), rtol=0, atol=1e-9)
    assert late.clutch_slip.max() < 1e-11


def test_what_is_docked_strikes_a_wall_as_one():
    parts = {"measures": {"x": {"marker": "b.n", "component": "x"}}, "stop": [{"name": "wall", "measure": "x", "min": 0.4, "restitution": 0.5}]}
    run = floating(clutch=[{"name": "dock", "between": ["a.m", "b.n"], "from": 0.25}], **parts).forward(t=np.linspace(0, 6, 13), **TIGHT)
    told = kinds(run)
    assert told[0] == ("dock", "close") and told.count(("wall.min", "impact")) >= 2
    for k, (name, _) in enumerate(told):
        before, behind = (motions("ab", run.event_q.values[k], rates.values[k]) for rates in (run.event_qd, run.event_qd_after))
        np.testing.assert_allclose(behind[0].omega, behind[1].omega, rtol=0, atol=1e-12)
        loss = sum(b.energy for b in before) - sum(b.energy for b in behind)
        assert float(run.event_loss[k]) == pytest.approx(loss, rel=1e-9)
        jump = (sum(b.momentum for b in behind) - sum(b.momentum for b in before))[:3]
        if name == "wall.min":  # along its normal only, and by what is told
            np.testing.assert_allclose(jump, [float(run.event_impulse[k]), 0, 0], rtol=0, atol=1e-9)
            marker = [body.speed(body.point(MARKER["b"]["n"]["at"]))[0] for body in (before[1], behind[1])]
            assert marker[1] == pytest.approx(-0.5 * marker[0], rel=1e-9)


def test_what_is_held_twice_takes_the_force_once():
    one = {"name": "d1", "between": ["a.m", "b.n"], "from": 0.25}
    once = floating(clutch=[one]).forward(t=np.linspace(0, 1, 21), **TIGHT)
    twice = floating(clutch=[one, {"name": "d2", "between": ["b.n", "a.m"], "from": 0.25, "until": 0.5}]).forward(t=np.linspace(0, 1, 21), **TIGHT)
    assert kinds(twice) == [("d1", "close"), ("d2", "close"), ("d2", "open")]
    np.testing.assert_allclose(twice.q, once.q, rtol=0, atol=1e-9)
    assert np.nansum(twice.event_loss.values) == pytest.approx(float(once.event_loss[0]), rel=1e-12)


def test_caught_while_an_angle_of_a_body_is_at_its_pole():
    start = START["b"] | {"angles": [0.3, np.pi / 2 - 0.25 * 0.4, 0.2], "angular_rates": [0.1, 0.4, -0.3]}
    scene = floating(coordinate=[{"link": "a", "start": START["a"]}, {"link": "b", "start": start}], clutch=[{"name": "dock", "between": ["a.m", "b.n"], "from": 0.25}])
    run = scene.forward(t=np.linspace(0, 6, 61), **TIGHT)
    assert (run.status == 0).all()
    late = run.kinetic_energy.sel(time=slice(0.26, None))
    np.testing.assert_allclose(late, late[0], rtol=1e-10)


def test_a_rod_that_spins_idly_is_not_caught_off_its_line():
    description: dict[str, Any] = {
        "space": "spatial",
        "frame": {"markers": {"o": [0, 0, 0], "p": {"at": [0, 0, 0], "axis": [1, 0, 0]}}},
        "link": [
            {"name": "crank", "markers": {"o": [0, 0, 0], "e": [0.3, 0, 0]}, "mass": 1, "inertia": [0.1, 0.1, 0.1, 0, 0, 0]},
            {"name": "rod", "markers": {"e": [0, 0, 0], "s": [0.8, 0, 0], "side": [0.4, 0.1, 0]}, "mass": 1, "cog": [0.4, 0, 0], "inertia": [0.01, 0.1, 0.1, 0, 0, 0]},
            {"name": "slide", "markers": {"s": [0, 0, 0], "p": {"at": [0, 0, 0], "axis": [1, 0, 0]}}, "mass": 1, "inertia": [0.1, 0.1, 0.1, 0, 0, 0]},
            {"name": "part", "markers": {"m": [0, 0, 0]}, "mass": 1, "inertia": [0.1, 0.1, 0.1, 0, 0, 0]},
        ],
        "joint": [
            {"name": "O", "type": "revolute", "between": ["frame.o", "crank.o"]},
            {"name": "E", "type": "spherical", "between": ["crank.e", "rod.e"]},
            {"name": "S", "type": "spherical", "between": ["rod.s", "slide.s"]},
            {"name": "P", "type": "prismatic", "between": ["frame.p", "slide.p"], "start": 1.0},
        ],
        "coordinate": [{"joint": "O", "start": {"position": 0.5, "velocity": 1}}, {"link": "part", "start": {"position": [0.5, 0.5, 0]}}],
        "time": {"end": 1},
    }  # fmt: skip

    def caught(marker: str, kind: str) -> linkdyn.Scene:
        return linkdyn.Scene(description | {"clutch": [{"name": "hook", "between": [marker, "part.m"], "type": kind, "from": 0.3}]})

    with pytest.raises(linkdyn.LinkdynError, match="clutch 'hook' holds 'rod' off it"):
        caught("rod.side", "spherical").forward()
    with pytest.raises(linkdyn.LinkdynError, match="'rod' can spin between its spherical joints"):
        caught("rod.s", "fixed").forward()
    assert kinds(caught("rod.s", "spherical").forward()) == [("hook", "close")]


# ----------------------------------------------------------------------------------------------------------------- in a plane
def arm(**parts: Any) -> linkdyn.Scene:
    """An arm of two links that turns on its shoulder by its own momentum, and a part that comes along."""
    description: dict[str, Any] = {
        "space": "planar",
        "frame": {"markers": {"S": [0.2, 0.1]}},
        "link": [
            {"name": "upper", "markers": {"S": [0, 0], "E": [0.5, 0]}, "mass": 3, "cog": [0.2, 0], "inertia": 0.08},
            {"name": "hand", "markers": {"E": [0, 0], "palm": {"at": [0.4, 0], "axis": [1, 0.4]}}, "mass": 1.5, "cog": [0.15, 0.02], "inertia": 0.03},
            {"name": "part", "markers": {"grip": [-0.1, 0.03]}, "mass": 0.8, "cog": [0.01, 0], "inertia": 0.004},
        ],
        "joint": [
            {"name": "S", "type": "revolute", "between": ["frame.S", "upper.S"]},
            {"name": "E", "type": "revolute", "between": ["upper.E", "hand.E"]},
        ],
        "coordinate": [
            {"joint": "S", "start": {"position": 0.3, "velocity": 1.2}},
            {"joint": "E", "start": {"position": 0.7, "velocity": -0.8}},
            {"link": "part", "start": {"position": [0.9, 0.6], "angle": 0.2, "velocity": [-0.7, -0.4], "angular_rate": 2}},
        ],
        "clutch": [{"name": "grasp", "between": ["hand.palm", "part.grip"], "from": 0.2, "until": 1.2}],
        "time": {"end": 1.6},
    }  # fmt: skip
    return linkdyn.Scene(description | parts)


def planar_bodies(q, qd) -> list[tuple[float, float, np.ndarray, np.ndarray, float]]:
    """Mass, inertia, centre of mass, its velocity and the turning of upper arm, hand and part."""

    def turn(angle: float) -> np.ndarray:
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    across = np.array([[0, -1], [1, 0]])
    shoulder = np.array([0.2, 0.1])
    upper, hand = turn(q[0]), turn(q[0] + q[1])
    omega = [qd[0], qd[0] + qd[1], qd[4]]
    elbow = upper @ [0.5, 0]
    at = [upper @ [0.2, 0], elbow + hand @ [0.15, 0.02]]
    part = turn(q[4]) @ [0.01, 0]
    velocity = [omega[0] * across @ at[0], omega[0] * across @ elbow + omega[1] * across @ (at[1] - elbow), qd[2:4] + omega[2] * across @ part]
    centre = [shoulder + at[0], shoulder + at[1], q[2:4] + part]
    return list(zip((3, 1.5, 0.8), (0.08, 0.03, 0.004), centre, velocity, omega))


def momentum_about_shoulder(q, qd) -> float:
    return sum(m * ((c[0] - 0.2) * v[1] - (c[1] - 0.1) * v[0]) + i * w for m, i, c, v, w in planar_bodies(q, qd))


def planar_energy(q, qd) -> float:
    return sum(m * v @ v + i * w * w for m, i, c, v, w in planar_bodies(q, qd)) / 2


def test_an_arm_grasps_a_part_and_lets_it_go():
    run = arm().forward(t=np.linspace(0, 1.6, 33), **TIGHT)
    assert kinds(run) == [("grasp", "close"), ("grasp", "open")]
    assert [str(c) for c in run.clutch.values] == ["grasp.x", "grasp.y", "grasp.about_z"]
    q, before, behind = run.event_q.values[0], run.event_qd.values[0], run.event_qd_after.values[0]
    assert momentum_about_shoulder(q, behind) == pytest.approx(momentum_about_shoulder(q, before), rel=1e-12)
    assert float(run.event_loss[0]) == pytest.approx(planar_energy(q, before) - planar_energy(q, behind), rel=1e-12)
    # hand and part turn as one, about the same point
    assert behind[0] + behind[1] == pytest.approx(behind[4], abs=1e-12)
    _, hand, part = planar_bodies(q, behind)
    np.testing.assert_allclose(part[3] - hand[3], behind[4] * np.array([-(part[2] - hand[2])[1], (part[2] - hand[2])[0]]), rtol=0, atol=1e-12)
    # no impulse passes by the elbow: the part's momentum about it comes from the hand alone
    held = (run.time.values > 0.21) & (run.time.values < 1.19)
    energy = [planar_energy(*state) for state in zip(run.q.values[held], run.qd.values[held])]
    np.testing.assert_allclose(energy, energy[0], rtol=1e-10)
    np.testing.assert_allclose([momentum_about_shoulder(*state) for state in zip(run.q.values, run.qd.values)], momentum_about_shoulder(q, before), rtol=1e-10)
    np.testing.assert_array_equal(run.event_qd.values[1], run.event_qd_after.values[1])
    last = run.sel(time=slice(1.21, None))
    np.testing.assert_allclose(last.qd.values[:, 4], run.event_qd.values[1][4], rtol=1e-12)


def test_an_arm_that_is_driven_takes_the_part_along_or_says_that_nothing_gives_way():
    part = {"link": "part", "start": {"position": [0.9, 0.6], "angle": 0.2, "velocity": [-0.7, -0.4], "angular_rate": 2}}
    driven = [{"joint": name, "driven": True, "motion": {"law": "constant-rate", "rate": rate}} for name, rate in (("S", 1.0), ("E", -0.5))]
    work = [{"joint": name, "law": {"type": "inverse"}} for name in ("S", "E")]
    run = arm(coordinate=[*driven, part], actuator=work).forward(t=np.linspace(0, 1, 11), **TIGHT)
    np.testing.assert_allclose(run.qd.values[:, :2], np.broadcast_to([1, -0.5], (11, 2)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.qd.values[3:, 4], 0.5, rtol=1e-10)
    stuck = arm(coordinate=[*driven, part], actuator=work, clutch=[{"name": "stuck", "between": ["frame.S", "hand.palm"], "from": 0.2}])
    assert "nothing that clutch 'stuck' could join moves freely" in stuck.forward(t=np.linspace(0, 1, 11)).attrs["stopped"]


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_held_in_a_plane_as_by_a_joint(kind):
    run = arm(clutch=[{"name": "grasp", "between": ["hand.palm", "part.grip"], "type": kind, "from": 0.2}]).forward(t=np.linspace(0, 1.2, 49), **TIGHT)
    late = run.time.values > 0.201
    along = np.array([1, 0.4]) / np.hypot(1, 0.4)

    def seen(q) -> np.ndarray:
        """The grip as the hand sees it, along and across the palm's axis, and how the part is turned."""
        hand, part = q[0] + q[1], q[4]
        elbow = np.array([0.2, 0.1]) + 0.5 * np.array([np.cos(q[0]), np.sin(q[0])])
        grip = q[2:4] + np.array([[np.cos(part), -np.sin(part)], [np.sin(part), np.cos(part)]]) @ [-0.1, 0.03]
        own = np.array([[np.cos(hand), np.sin(hand)], [-np.sin(hand), np.cos(hand)]]) @ (grip - elbow)
        return np.array([own @ along, own @ [-along[1], along[0]], part - hand])

    places = np.array([seen(q) for q in run.q.values[late]])
    kept = {"revolute": [0, 1], "prismatic": [1, 2]}[kind]
    free = {"revolute": 2, "prismatic": 0}[kind]
    np.testing.assert_allclose(places[:, kept], np.broadcast_to(seen(run.event_q.values[0])[kept], (late.sum(), 2)), rtol=0, atol=1e-10)
    assert np.ptp(places[:, free]) > 0.05
    states = list(zip(run.q.values[late], run.qd.values[late]))
    np.testing.assert_allclose([planar_energy(*s) for s in states], planar_energy(*states[0]), rtol=1e-10)
    np.testing.assert_allclose([momentum_about_shoulder(*s) for s in states], momentum_about_shoulder(*states[0]), rtol=1e-10)


# ------------------------------------------------------------------------------------------------- all variables of one joint
HELD = {
    "spherical": ["roll", "pitch", "yaw"],
    "universal": ["angle1", "angle2"],
    "planar": ["x", "y", "angle"],
    "cylindrical": ["angle", "slide"],
}


def hung(kind: str, **parts: Any) -> linkdyn.Scene:
    """A body on a joint of one kind, in the frame."""
    second = {"axis": [0, 1, 0], "x": [0, 0, 1]} if kind == "universal" else {}
    starts = {"roll": 0.2, "pitch": -0.3, "yaw": 0.5, "angle1": 0.2, "angle2": -0.4, "x": 0.1, "y": 0.2, "angle": 0.3, "slide": 0.4}
    description: dict[str, Any] = {
        "space": "spatial",
        "gravity": [1, -2, -9.81],
        "frame": {"markers": {"J": [0, 0, 0]}},
        "link": [{"name": "a", "markers": {"J": {"at": [0.1, 0, 0.3], **second}}, **BODY["a"]}],
        "joint": [{"name": "J", "type": kind, "between": ["frame.J", "a.J"]}],
        "coordinate": [{"joint": "J", "variable": name, "start": {"position": starts[name], "velocity": 1 - k}} for k, name in enumerate(HELD[kind])],
        "clutch": [{"name": "lock", "joint": "J", "from": 0.3, "until": 0.7}],
        "time": {"end": 1},
    }
    return linkdyn.Scene(description | parts)


@pytest.mark.parametrize("kind", HELD)
def test_all_variables_of_a_joint_lock_at_once(kind):
    run = hung(kind).forward(t=np.linspace(0, 1, 41), **TIGHT)
    assert kinds(run) == [("lock", "close"), ("lock", "open")]
    assert run.clutch.size == len(HELD[kind])
    held = run.sel(time=slice(0.301, 0.699))
    np.testing.assert_allclose(held.q, np.broadcast_to(run.event_q.values[0], held.q.shape), rtol=0, atol=1e-13)
    assert not held.qd.values.any()
    # all kinetic energy of the body is gone: nothing of it is left to move
    energy = np.interp(0, [0], [0]) + float(run.event_loss[0])
    early = run.sel(time=slice(None, 0.299))
    total = early.kinetic_energy + early.potential_energy
    rest = float(held.potential_energy[0])
    assert energy == pytest.approx(float(total[0]) - rest, rel=1e-9)
    late = run.sel(time=slice(0.701, None))
    np.testing.assert_allclose(late.kinetic_energy + late.potential_energy, rest, rtol=0, atol=1e-9)
    # what holds is what gravity does along each variable
    one = {"spherical": "J.x", "universal": "J.angle1", "planar": "J.x", "cylindrical": "J.angle"}[kind].replace("J", "lock")
    if kind in ("planar", "spherical"):
        m, g = BODY["a"]["mass"], np.array([1, -2, -9.81])
        push = -m * g
        if kind == "spherical":
            arm = rotation(run.event_q.values[0]) @ (np.array(BODY["a"]["cog"]) - [0.1, 0, 0.3])
            push = np.cross(arm, -m * g)
        np.testing.assert_allclose(held.clutch_force.sel(clutch=one), push[0], rtol=1e-10)


def test_a_hinge_that_is_held_by_its_links_is_held_as_by_its_joint():
    joint = arm(clutch=[{"name": "lock", "joint": "E", "from": 0.2}]).forward(t=np.linspace(0, 1, 11), **TIGHT)
    links = arm(clutch=[{"name": "lock", "between": ["upper.E", "hand.palm"], "from": 0.2}]).forward(t=np.linspace(0, 1, 11), **TIGHT)
    np.testing.assert_allclose(links.q, joint.q, rtol=0, atol=1e-10)
    assert float(links.event_loss[0]) == pytest.approx(float(joint.event_loss[0]), rel=1e-10)


# ------------------------------------------------------------------------------------------------------------------- events
def test_an_event_is_told_the_way_it_was_asked_for():
    """Thrown up, it passes the height twice within one step; the way down alone counts, and is told as such."""
    scene = linkdyn.Scene({
        "space": "planar", "gravity": [0, -10], "frame": {"markers": {"o": [0, 0]}},
        "link": [{"name": "a", "markers": {"m": [0, 0]}, "mass": 1, "inertia": 1}],
        "coordinate": [{"link": "a", "start": {"position": [0, 0], "velocity": [1, 5]}}],
        "measures": {"height": {"marker": "a.m", "component": "y"}},
        "event": [{"name": "down", "when": "height - 1.2499 m", "direction": "down"}],
        "time": {"end": 3},
    })  # fmt: skip
    run = scene.forward(t=[0, 3])
    np.testing.assert_allclose(run.event_time, [0.5 + np.sqrt(0.00002)], rtol=1e-12)
    np.testing.assert_array_equal(run.event_direction, [-1])
