"""Teeth, worms, belts, cams and slots that stick in forward runs: by friction's cone, the textbook's efficiencies, an eccentric circle by hand, and an
integrator of one's own."""

from __future__ import annotations

import copy
import math
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_cam_friction import MASS, MU, OFF, PIN, ROLLER, ROUND, WEIGHT, eccentric
from test_gears import gear, hinge, pair, planar, planetary, rack_and_pinion
from test_joint_kinds import let_go
from test_mesh_losses import MESHES, rolled_teeth, torque_of_wolfrom, two_pulleys, with_losses, wolfrom
from test_space_cams import DRUMS, FAR, in_tilted_axes, slope

SLIPS, HOLDS = 1, 2
EXAMPLES = Path(__file__).parents[2] / "examples"
Scene = dict[str, Any]


def times(run: Any, kind: str) -> list[tuple[str, float]]:
    """Events of a kind, and when."""
    meanings = run.event_kind.attrs["flag_meanings"].split()
    return [(str(name), float(t)) for name, k, t in zip(run.event.values, run.event_kind.values, run.event_time.values) if meanings[k] == kind]


def ramp(middle: float, way: int, pace: float = 1.0, unit: str = "N*m") -> dict[str, Any]:
    """A load that grows, up or down, from where friction is not needed."""
    return {"type": "formula", "value": f"{middle!r} {unit} + {way * pace!r} {unit}/s*time"}


def check_power(run: Any) -> None:
    """What rubs takes power, and all power is accounted for."""
    assert (run.status == 0).all() and not run.attrs["stopped"]
    assert np.abs(run.power_imbalance).max() < 1e-12
    power = run.clutch_force * run.clutch_slip
    assert power.max() < 1e-9
    np.testing.assert_allclose(run.friction_power.values.sum(axis=1), -power.values.sum(axis=1), rtol=1e-9, atol=1e-9)    # a surface that is told to slip has a billionth of its creep speed


# ---------------------------------------------------------------- worms

LOAD, ALPHA, APART, TEETH = 300 * 9.81 * 0.075, math.radians(20), 0.105, 40
WORM, WHEEL = 0.0021, 0.052 + 300 * 0.075**2                 # inertia of the shaft, and of what hangs at the wheel


def winch(lead: float, coulomb: float, torque: Any = 0.0, rate: float = 0.0, **friction: Any) -> linkdyn.Scene:
    """The example's winch, let go: its load at the drum, a torque at the worm."""
    scene = tomllib.loads((EXAMPLES / "worm_winch" / "scene.toml").read_text(encoding="utf-8"))
    scene["variables"] |= {"lead": lead, "rubs": coulomb}
    scene["coordinate"] = [{"joint": "M", "start": {"position": 0.0, "velocity": rate}}]
    scene["actuator"] = [{"joint": "M", "law": torque if isinstance(torque, dict) else {"type": "constant", "value": torque}}]
    scene["friction"][0] |= {"sticking": True, **friction}
    return linkdyn.Scene(scene)


def thrust(lead: float) -> tuple[float, float]:
    """Along the worm, by the load, and the worm's pitch radius."""
    radius = APART / (1 + TEETH * math.tan(lead))
    return LOAD / (APART - radius), radius


@pytest.mark.parametrize("method", [None, "gbs", "seulex"])
def test_a_worm_that_locks_itself_holds_to_the_last_digit(method: str | None) -> None:
    lead = 0.0798
    run = winch(lead, 0.09).forward(t=np.linspace(0, 40, 41), method=method, want="all")
    np.testing.assert_array_equal(run.q, 0)
    np.testing.assert_array_equal(run.qd, 0)
    assert run.sizes.get("event", 0) == 0 and (run.clutch_state == HOLDS).all()
    # as a weight on a slope: nothing else pushes across the worm's axis
    np.testing.assert_allclose(np.abs(run.clutch_force), thrust(lead)[0] * math.sin(lead), rtol=1e-12)
    check_power(run)


@pytest.mark.parametrize("coulomb", [0.05, 0.09, 0.2])
@pytest.mark.parametrize("static", [1.0, 1.5])
def test_the_cone_of_friction(coulomb: float, static: float) -> None:
    """A load on the wheel drives the worm where its thread is steeper than the angle of friction, to nine digits of it."""
    limit = math.atan(static * coulomb / math.cos(ALPHA))
    more = {"static": static * coulomb, "stribeck_speed": 0.01} if static > 1 else {}
    for lead, state in ((limit * (1 - 1e-9), HOLDS), (limit * (1 + 1e-9), SLIPS)):
        run = winch(lead, coulomb, **more).forward(t=[0, 1e-3])
        assert (run.clutch_state == state).all()
        assert (np.abs(run.q[-1]) > 0) == (state == SLIPS)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(("lead", "coulomb", "static"), [(0.0798, 0.09, 1.0), (0.0798, 0.05, 1.0), (0.0798, 0.05, 2.4), (0.25, 0.05, 2.4)])
def test_a_worm_breaks_loose_where_its_thread_says(lead: float, coulomb: float, static: float, way: int) -> None:
    """At F r tan(lead +- rho), up and down; from there the shaft turns as the textbook's torques let it."""
    force, radius = thrust(lead)
    middle, rho = force * radius * math.tan(lead), math.atan(static * coulomb / math.cos(ALPHA))
    loose = abs(force * radius * math.tan(lead + way * rho) - middle)
    more = {"static": static * coulomb, "stribeck_speed": 0.05} if static > 1 else {}
    run = winch(lead, coulomb, ramp(middle, way), **more).forward(t=np.linspace(0, loose + 0.05, 21), want="all")
    assert times(run, "slip") == [("worm-gear", pytest.approx(loose, rel=1e-10))]
    held = run.time.values < loose
    assert np.ptp(run.q.values[held]) == 0 and (run.clutch_state.values[held] == HOLDS).all()
    assert way * run.qd.values[-1, 0] > 0 and run.event_direction.values[0] == -way
    check_power(run)
    if static > 1:
        return
    # T - F' r1 tan(lead +- rho) = I1 a, F' r2 - M = I2 r1 tan(lead)/r2 a: the wheel lags by its ratio
    wheel, slope = APART - radius, math.tan(lead + way * rho)
    excess = run.time.values[-1] - loose
    inertia = WORM + WHEEL * radius * math.tan(lead) / wheel * radius * slope / wheel
    np.testing.assert_allclose(run.qdd.values[-1, 0], way * excess / inertia, rtol=1e-8)


def test_a_worm_comes_to_rest_and_stays() -> None:
    """Let go while it goes up: it stops by its load and its thread, and holds from there."""
    lead, coulomb = 0.0798, 0.09
    run = winch(lead, coulomb, rate=150.0).forward(t=np.linspace(0, 40, 4001), want="all")
    force, radius = thrust(lead)
    wheel, slope = APART - radius, math.tan(lead + math.atan(coulomb / math.cos(ALPHA)))
    inertia = WORM + WHEEL * radius * math.tan(lead) / wheel * radius * slope / wheel
    (_, stops), = times(run, "stick")
    assert stops == pytest.approx(150.0 * inertia / (force * radius * slope), rel=1e-10)
    rest = run.q.values[run.time.values > stops]
    assert np.ptp(rest) == 0 and abs(rest[0, 0] - 75 * stops) < 1e-8 and (run.qd.values[run.time.values > stops] == 0).all()
    check_power(run)


# ---------------------------------------------------------------- gears, racks, belts

def at_rest(scene: Scene, joint: str, law: dict[str, Any], load: dict[str, Any] | None = None, **friction: Any) -> Scene:
    """A train without weight, led at one wheel by a torque, under a load; all of its meshes stick. `friction`: of all, or of each by its name."""
    scene = copy.deepcopy(scene) | {"gravity": [0, 0], "time": {"end": 1}}
    for link in scene["link"]:
        link |= {"cog": [0, 0], "mass": link.get("mass") or 1.0, "inertia": link.get("inertia") or 0.01}
    meshes = [part["name"] for part in scene["joint"] if part["type"] in ("gear", "rack", "belt")]
    scene["friction"] = [{"joint": name, "sticking": True, **friction.get(name, {} if set(friction) & set(meshes) else friction)} for name in meshes]
    scene["coordinate"] = [{"joint": joint, "start": 0.0}]
    scene["actuator"] = [{"joint": joint, "law": law}]
    return scene | ({"load": [load]} if load else {})


PAIRS = {"external": (pair(), -0.5), "internal": (pair(mesh="internal"), 0.5), "open belt": (two_pulleys((0.06, 0.15)), 0.4),
         "equal pulleys": (two_pulleys((0.08, 0.08)), 1.0), "crossed belt": (two_pulleys((0.12, 0.06), "crossed"), -2.0), "rack": (rack_and_pinion(), 0.08)}


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("load", [50.0, -50.0])
@pytest.mark.parametrize("name", PAIRS)
def test_between_what_would_be_lost_either_way(name: str, load: float, way: int) -> None:
    """Held from the part of the torque without loss that the efficiency says to one over it, whichever way the load pulls."""
    scene, ratio = PAIRS[name]
    ideal = -load * ratio
    on = {"on": "rack.R", "force": [load, 0]} if name == "rack" else {"on": "wheel.B", "moment": load}
    loose = abs(ideal) * (1 / 0.93 - 1 if way * ideal > 0 else 1 - 0.93)
    run = linkdyn.Scene(at_rest(scene, "A", ramp(ideal, way), on, efficiency=0.93)).forward(t=np.linspace(0, loose + 0.1, 12), want="all")
    assert times(run, "slip") == [("G", pytest.approx(loose, rel=1e-10))]
    held = run.time.values < loose
    assert (run.q.values[held] == 0).all() and way * run.qd.values[-1, 0] > 0
    check_power(run)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("mesh", ["external", "internal"])
def test_teeth_that_rub_break_loose_by_rolled_involutes(mesh: str, way: int) -> None:
    teeth, mu, load, distance = (20, 60), 0.1, 40.0, 0.3
    scene = pair(mesh=mesh)
    scene["joint"][2] |= {"teeth": list(teeth), "pressure_angle": "20 deg"}
    ideal = load * teeth[0] / teeth[1] * (1 if mesh == "external" else -1)
    module = 2 * distance / (teeth[1] + teeth[0] * (1 if mesh == "external" else -1))
    loose = rolled_teeth(teeth, module, ALPHA, mesh, abs(ideal), 1.0, mu)
    run = linkdyn.Scene(at_rest(scene, "A", ramp(ideal, way, 0.1), {"on": "wheel.B", "moment": load}, coulomb=mu)).forward(t=[0, 10 * loose + 0.2], want="all")
    assert times(run, "slip")[0][1] / 10 == pytest.approx(loose, rel=0.02)    # F itself changes by what holds: by some loose/ideal
    check_power(run)


def two_stages() -> Scene:
    scene = planar(
        frame={"markers": {"A": [0, 0], "B": [0.2, 0], "C": [0.5, 0]}},
        link=[{"name": name, "markers": {name: [0, 0]}} for name in "ABC"],
        joint=[hinge(name, f"frame.{name}", f"{name}.{name}") for name in "ABC"] + [gear("G1", "A.A", "B.B", [20, 60]), gear("G2", "B.B", "C.C", [25, 50])])
    for link in scene["link"]:
        link["name"] = f"shaft{link['name']}"
    for joint in scene["joint"]:
        joint["between"] = [end if end.startswith("frame") else f"shaft{end}" for end in joint["between"]]
    return scene


TRAINS: dict[str, tuple[Scene, str, str, float, dict[str, Any], float, float]] = {
    # scene, driven hinge, loaded marker, ideal torque over load, losses, limits over the ideal
    "two stages": (two_stages(), "A", "shaftC.C", -1 / 6, {"G1": {"efficiency": 0.9}, "G2": {"efficiency": 0.8}}, 1 / 0.72, 0.72),
    "planetary": (planetary(), "S", "carrier.P", -1 / 3.5, {"SP": {"efficiency": 0.98}, "PR": {"efficiency": 0.99}},
                  3.5 / (1 + 2.5 * 0.98 * 0.99), 3.5 / (1 + 2.5 / (0.98 * 0.99))),
}


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("name", TRAINS)
def test_meshes_of_a_train_hold_together(name: str, way: int) -> None:
    """What all of them hold is the whole train's loss either way; nothing moves before."""
    scene, joint, marker, ratio, losses, most, least = TRAINS[name]
    ideal = 84.0 * ratio
    loose = abs(ideal) * abs((most if way * ideal > 0 else least) - 1)
    run = linkdyn.Scene(at_rest(scene, joint, ramp(ideal, way), {"on": marker, "moment": 84.0}, **losses)).forward(
        t=[*np.linspace(0, loose * (1 - 1e-9), 9), loose * (1 + 1e-6), loose + 0.1], want="all")
    assert (run.q.values[:9] == 0).all() and way * run.qd.values[-2, 0] > 0
    assert times(run, "slip")[-1][1] == pytest.approx(loose, rel=1e-10)
    check_power(run)


@pytest.mark.parametrize("load", [500.0, -500.0])
@pytest.mark.parametrize("way", [1, -1])
def test_wolfroms_drive_locks_itself(load: float, way: int) -> None:
    """By the torques that drive it up and down: it stays without one, and breaks loose where these say."""
    scene = wolfrom(load)
    up, down = (torque_of_wolfrom(pull, 0.97)[0] for pull in (load, -load))
    loose = sorted(abs(torque) for torque in (up, -down) if torque * way > 0)[0]
    run = linkdyn.Scene(at_rest(scene, "S", ramp(0.0, way), scene["load"][0], efficiency=0.97)).forward(
        t=[*np.linspace(0, loose * (1 - 1e-9), 9), loose + 0.1], want="all")
    assert (run.q.values[:9] == 0).all() and way * run.qd.values[-1, 0] > 0
    check_power(run)


def test_a_train_turns_as_one_body() -> None:
    """Sun and ring of two coordinates, at one speed: the mesh keeps the planet from rolling, so all has the inertia of one body."""
    scene = planetary(True) | {"gravity": [0, 0], "actuator": [], "time": {"end": 3}}
    inertias = {"sun": 0.02, "carrier": 0.1, "planet": 0.01, "ring": 0.055}
    for link in scene["link"]:
        link |= {"inertia": inertias[link["name"]], "cog": [0, 0]}
    scene["coordinate"] = [{"joint": joint, "start": {"position": 0.0, "velocity": 2.0}} for joint in ("S", "R")]
    scene["friction"] = [{"joint": "SP", "efficiency": 0.5, "sticking": True}]
    scene["load"] = [{"on": "carrier.P", "moment": "5 N*m*cos(time/0.3 s)"}]
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 3, 31), want="all")
    whole = sum(inertias.values()) + 1.5 * 0.3**2
    np.testing.assert_allclose(run.qd.values, np.tile((2 + 5 * 0.3 / whole * np.sin(run.time.values / 0.3))[:, None], 2), rtol=1e-9)
    assert (run.clutch_state == HOLDS).all() and np.abs(run.clutch_slip).max() < 1e-13
    check_power(run)


@pytest.mark.parametrize("name", ["planetary", "differential", "rack", "sector", "crossed belt", "differential in space", "rack in space", pytest.param("bevel in space", marks=pytest.mark.thorough)])
def test_trains_come_to_rest_or_turn_back(name: str) -> None:
    """Let go, with losses by which what rubs beside it presses a mesh otherwise than what holds it: all turn back at one instant, or none does."""
    scene = let_go(with_losses(MESHES[name], efficiency=0.5, sticking=True)) | {"time": {"end": 1.5}}
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 1.5, 31), want="all")
    check_power(run)
    held = run.clutch_state.values == HOLDS
    assert np.abs(run.clutch_slip.values[held]).max(initial=0) < 1e-12
    if name in ("sector", "rack in space"):
        rests = held.all(axis=1)
        assert rests[-1] and np.abs(np.diff(run.q.values[:, -1]))[rests[1:] & rests[:-1]].max() < 1e-12


# ---------------------------------------------------------------- against an integrator of one's own

TURN, BACK, SPRING, RATIO, PART, SWING, PULSE = 0.02, 0.3 + 5.0 * (0.01**2 + 0.02**2), 60.0, 0.5, 0.6, 9.0, 5.0


def stick_slip() -> Scene:
    scene = at_rest(pair(), "A", {"type": "formula", "value": f"{SWING} N*m*sin({PULSE} rad/s*time)"}, efficiency=PART)
    scene["spring"] = [{"name": "k", "joint": "B", "stiffness": SPRING}]
    scene["coordinate"][0]["start"] = {"position": 0.4, "velocity": 0.0}
    return scene


def own_course(end: float) -> list[tuple[float, float, float, bool]]:
    """Instant, angle, rate and whether it holds from there, of all changes: a wheel of the ratio `RATIO` against a spring, by what `PART` lets through."""
    torque = lambda t: SWING * math.sin(PULSE * t)  # noqa: E731

    def speeds_up(t: float, angle: float, way: int) -> float:
        # power goes on to the wheel by the part PART, or comes back by it
        for part, drives in ((PART, True), (1 / PART, False)):
            speed = (part * torque(t) / RATIO - SPRING * RATIO * angle) / (BACK * RATIO + part * TURN / RATIO)
            if ((torque(t) - TURN * speed) * way > 0) == drives:
                return speed
        raise AssertionError

    def reserve(t: float, angle: float) -> float:
        through, back = torque(t), SPRING * RATIO * angle * RATIO
        return min((through - PART * back) * np.sign(back), (back - PART * through) * np.sign(through))

    t, angle, rate, course = 0.0, 0.4, 0.0, []
    holds = reserve(t, angle) >= 0
    way = int(np.sign(speeds_up(t, angle, -1)))
    while t < end:
        course.append((t, angle, rate, holds))
        if holds:
            gone = lambda x, y: reserve(x, y[0])  # noqa: E731
            gone.terminal, gone.direction = True, -1
            found = solve_ivp(lambda x, y: [0.0], (t, end), [angle], events=gone, rtol=1e-12, atol=1e-14, max_step=1e-3)
        else:
            stops = lambda x, y: y[1] * way  # noqa: E731
            stops.terminal, stops.direction = True, -1
            found = solve_ivp(lambda x, y: [y[1], speeds_up(x, y[0], way)], (t, end), [angle, rate], events=stops, rtol=1e-11, atol=1e-13, max_step=1e-3)  # noqa: B023
        t, angle = float(found.t[-1]), float(found.y[0, -1])
        rate = 0.0 if holds else float(found.y[1, -1])
        if found.status == 0:
            break
        rate = 0.0
        if holds:
            holds = False
            way = int(np.sign(torque(t) - SPRING * RATIO * angle * RATIO))
        else:
            holds = reserve(t, angle) >= 0
            way = way if holds else -way
    course.append((t, angle, rate, holds))
    return course


@pytest.mark.parametrize("method", [None, "gbs", "seulex"])
def test_stick_slip_of_teeth_against_an_integrator(method: str | None) -> None:
    course = own_course(4.0)
    assert sum(change[3] for change in course) > 4
    run = linkdyn.Scene(stick_slip()).forward(t=[0.0, *(change[0] for change in course[1:])], method=method, rtol=1e-10, atol=1e-12, want="all")
    sticks = [when for _, when in times(run, "stick")]
    np.testing.assert_allclose(sticks, [a[0] for a, b in zip(course[1:-1], course) if a[3] and not b[3]], rtol=1e-7)
    np.testing.assert_allclose([when for _, when in times(run, "slip")], [a[0] for a, b in zip(course[1:-1], course) if b[3]], rtol=1e-7)
    np.testing.assert_allclose(run.q.values[:, 0], [change[1] for change in course], rtol=0, atol=1e-8)
    check_power(run)


def test_ensembles_and_simulators_do_the_same() -> None:
    scene, t = linkdyn.Scene(stick_slip()), np.linspace(0, 0.5, 6)
    run = scene.forward(method="rk4", step=2e-3, t=t)
    q, qd = np.array([[0.4], [0.1], [-0.2]]), np.array([[0.0], [0.5], [0.0]])
    members = scene.ensemble(q, qd, t, step=2e-3)
    np.testing.assert_allclose(members.q[0], run.q, atol=1e-12)
    for k in (1, 2):
        data = stick_slip()
        data["coordinate"][0]["start"] = {"position": q[k, 0], "velocity": qd[k, 0]}
        np.testing.assert_allclose(members.q[k], linkdyn.Scene(data).forward(method="rk4", step=2e-3, t=t).q, atol=1e-12)
    data = stick_slip()
    data["actuator"][0]["law"] = {"type": "constant", "value": 6.0}
    scene = linkdyn.Scene(data)
    run, sim = scene.forward(t=[0, 0.5, 1.0, 1.5]), scene.simulator()
    for instant in (0.5, 1.0, 1.5):
        while sim.t < instant - 1e-9:
            sim.step(0.05, [6.0])
        np.testing.assert_allclose(sim.q, run.q.sel(time=instant), rtol=1e-7)
    assert sim.qd[0] == 0 and (run.clutch_state[-1] == HOLDS).all()


def test_belts_that_stretch_hold_what_their_strands_carry() -> None:
    """A steady pull, at rest: the torque of the first wheel may be between what the efficiency leaves of it and one over it."""
    for run_of, ratio in (("open", 0.4), ("crossed", -0.4)):
        scene = two_pulleys((0.06, 0.15), run_of, strands={"stiffness": 2e4, "damping": 200.0, "pretension": 600.0})
        for part, state in ((0.85, HOLDS), (1.1, HOLDS), (0.75, SLIPS), (1.3, SLIPS)):
            data = at_rest(scene, "A", {"type": "constant", "value": -15.0 * ratio * part}, {"on": "wheel.B", "moment": 15.0}, efficiency=0.8)
            # what a belt holds takes half of the difference from either wheel: F r1 + m = T, F r2 - m = M
            couple = 15.0 * abs(ratio) * (part - 1) / (1 + abs(ratio))
            force = (15.0 + couple) / 0.15
            data["coordinate"] = [{"joint": "A", "start": 0.0}, {"joint": "B", "start": force / 4e4 / 0.15}]
            run = linkdyn.Scene(data).forward(t=[0, 0.5], want="all")
            assert (run.clutch_state[0] == state).all(), (run_of, part)
            if state == HOLDS:
                np.testing.assert_allclose(run.q, np.tile(run.q.values[:1], (2, 1)), atol=1e-12)
            check_power(run)


# ---------------------------------------------------------------- cams

FOLLOWERS = ("flat", "point", "roller")


def resting(follower: str, law: dict[str, Any], angle: float) -> Scene:
    """The eccentric circle at rest under the follower's weight, a torque at its shaft."""
    scene = eccentric(follower, coulomb=MU, sticking=True, **({"radius": PIN} if follower == "roller" else {}))
    scene["coordinate"] = [{"joint": "shaft", "start": angle}]
    scene["actuator"] = [{"joint": "shaft", "law": law}]
    return scene | {"time": {"end": 1}}


def torque_by_hand(follower: str, angle: float, way: int) -> float:
    """At the shaft, where the follower is about to be passed that way."""
    middle = np.array([OFF * math.cos(angle), OFF * math.sin(angle)])
    far = ROUND + (ROLLER if follower == "roller" else 0.0)
    normal = np.array([0.0, 1.0]) if follower == "flat" else np.array([-middle[0], math.sqrt(far**2 - middle[0] ** 2)]) / far
    place = middle + ROUND * normal
    along = np.array([-normal[1], normal[0]])
    along *= np.sign(along @ [-place[1], place[0]])              # as the cam's surface goes when it turns on
    held = way * MU * (PIN / ROLLER if follower == "roller" else 1.0)
    press = MASS * WEIGHT / (normal[1] + held * along[1])
    force = press * (normal + held * along)
    return float(place[0] * force[1] - place[1] * force[0])


@pytest.mark.parametrize("angle", [0.3, 2.0, -1.1])
@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("follower", FOLLOWERS)
def test_followers_break_loose_by_hand(follower: str, way: int, angle: float) -> None:
    limit = {way: torque_by_hand(follower, angle, way) for way in (1, -1)}
    middle = (limit[1] + limit[-1]) / 2
    loose = abs(limit[way] - middle) / 0.1
    run = linkdyn.Scene(resting(follower, ramp(middle, way, 0.1), angle)).forward(t=np.linspace(0, loose + 0.02, 12), want="all")
    assert times(run, "slip") == [("C", pytest.approx(loose, abs=1e-6))]    # the spline's normal
    held = run.time.values < loose
    assert np.ptp(run.q.values[held]) == 0 and way * run.qd.values[-1, 0] > 0
    check_power(run)


def test_a_roller_in_space() -> None:
    law = ramp(torque_by_hand("roller", 0.3, 1), 1, 0.1)
    law["value"] = law["value"].replace(" N*m + ", " N*m - 2e-3 N*m + ")
    t = np.linspace(0, 0.1, 11)
    run, flat = (linkdyn.Scene(scene).forward(t=t, want="all") for scene in (in_tilted_axes(resting("roller", law, 0.3)), resting("roller", law, 0.3)))
    np.testing.assert_allclose(run.event_time, flat.event_time, rtol=1e-9)
    np.testing.assert_allclose(run.clutch_force, flat.clutch_force, rtol=1e-9)
    np.testing.assert_allclose(run.qd, flat.qd, rtol=1e-7, atol=1e-12)
    check_power(run)


@pytest.mark.parametrize("follower", FOLLOWERS)
def test_what_is_held_rolls_on(follower: str) -> None:
    """A follower that may swing and slide: while the surfaces stick it rolls on the cam, which turns on, and nothing slips."""
    scene = eccentric(follower, coulomb=3.0, sticking=True, **({"radius": ROLLER} if follower == "roller" else {}))
    scene["frame"]["markers"]["G"] = {"at": [0, 0.2], "axis": [0, 1]}
    scene["link"].append({"name": "guide", "markers": {"G": {"at": [0, 0], "axis": [0, 1]}}, "mass": 0.1, "inertia": 1e-5})
    scene["link"][1]["markers"]["G"] = {"at": [0, 0.16], "axis": [0, 1]}
    scene["link"][1]["inertia"] = 2e-3
    scene["joint"][1] = hinge("H", "frame.G", "guide.G")
    scene["joint"].insert(2, {"name": "G", "type": "prismatic", "between": ["guide.G", "lifter.G"], "start": 0.0})
    scene |= {"coordinate": [{"joint": "shaft", "start": 0.3}, {"joint": "H", "start": 0.0}], "actuator": [], "time": {"end": 0.08},
              "load": [{"on": "cam.O", "moment": "0.3 N*m*cos(time/0.05 s)"}, {"on": "lifter.R", "force": [0, -20.0]}]}
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 0.08, 17), want="all")
    assert (run.clutch_state == HOLDS).all() and np.abs(run.qd).max() > 4
    assert np.abs(run.clutch_slip).max() < 1e-8 and np.abs(run.clutch_force).max() > 0.1
    assert np.abs(run.power_imbalance).max() < 1e-12


@pytest.mark.parametrize("angle", [0.4, 1.9])
@pytest.mark.parametrize("way", [1, -1])
def test_a_roller_on_a_drum_breaks_loose_as_a_wedge(way: int, angle: float) -> None:
    """Weight on the slope of the curve, F r tan(slope +- angle of friction), that of the roller's pin at the roller."""
    scene = copy.deepcopy(DRUMS["slides"]) | {"gravity": [0, 0, -9.81]}
    scene["link"][0]["cog"] = [0, 0, 0]
    scene["friction"] = [{"joint": "C", "coulomb": MU, "radius": PIN, "sticking": True}]
    steep = -math.atan(slope(-angle) / FAR)
    limit = {sense: 0.7 * 9.81 * FAR * math.tan(steep + sense * math.atan(MU * PIN / 0.01)) for sense in (1, -1)}
    middle = (limit[1] + limit[-1]) / 2
    loose = (limit[way] - middle) * way / 0.1
    scene["coordinate"] = [{"joint": scene["coordinate"][0]["joint"], "start": angle}]
    scene["actuator"] = [{"joint": scene["coordinate"][0]["joint"], "law": ramp(middle, way, 0.1)}]
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, loose + 0.02, 12), want="all")
    assert times(run, "slip") == [("C", pytest.approx(loose, abs=1e-4))]    # the spline's slope
    held = run.time.values < loose
    assert np.ptp(run.q.values[held]) == 0 and way * run.qd.values[-1, 0] > 0
    check_power(run)


# ---------------------------------------------------------------- slots, and what is refused

def test_a_pin_sticks_in_its_slot() -> None:
    """A crank's pin in a straight slot across the way of a yoke (Scotch yoke), pulled by 40 N: the crank is held up to mu of what the slot carries."""
    for in_slot, torque, state in ((0.3, 1.0, HOLDS), (0.3, 0.9, SLIPS), (0.3, 3.0, HOLDS), (0.3, 3.1, SLIPS)):
        scene = {
            "space": "planar", "gravity": [0, 0], "frame": {"markers": {"O": [0, 0], "G": {"at": [0, 0], "axis": [1, 0]}}},
            "link": [{"name": "crank", "markers": {"O": [0, 0], "P": [0.1, 0]}, "mass": 1.0, "inertia": 0.01},
                     {"name": "yoke", "markers": {"G": {"at": [0, 0], "axis": [1, 0]}, "S": {"at": [0, 0], "axis": [0, 1]}}, "mass": 1.0, "inertia": 0.01}],
            "joint": [hinge("O", "frame.O", "crank.O"), {"name": "G", "type": "prismatic", "between": ["frame.G", "yoke.G"]},
                      {"name": "S", "type": "slot", "between": ["yoke.S", "crank.P"], "start": 0.05}],
            "coordinate": [{"joint": "O", "start": math.pi / 6}], "actuator": [{"joint": "O", "law": {"type": "constant", "value": torque}}],
            "load": [{"on": "yoke.G", "force": [40.0, 0]}], "friction": [{"joint": "S", "coulomb": in_slot, "sticking": True}], "time": {"end": 1},
        }
        run = linkdyn.Scene(scene).forward(t=[0, 0.01], want="all")
        # 40 N along x at the pin, friction along y at it: T = 40 l sin - f l cos, |f| <= 0.3 40
        assert (abs(40 * 0.1 * 0.5 - torque) <= in_slot * 40 * 0.1 * math.cos(math.pi / 6)) == (state == HOLDS)
        assert (run.clutch_state == state).all()
        if state == HOLDS:
            np.testing.assert_allclose(np.abs(run.clutch_force), abs(40 * 0.1 * 0.5 - torque) / (0.1 * math.cos(math.pi / 6)), rtol=1e-12)
            assert np.ptp(run.q.values) == 0


def sticking(scene: Scene, cam: str) -> Scene:
    rubs = {"joint": cam, "coulomb": 0.1, "sticking": True}
    return copy.deepcopy(scene) | {"friction": [rubs]}


def test_refused() -> None:
    for follower in ("point", "flat"):
        with pytest.raises(linkdyn.SceneError, match="joint 'C': key 'sticking' is for cams under a roller"):
            linkdyn.Scene(sticking(in_tilted_axes(resting(follower, ramp(0.0, 1), 0.3)), "C"))
    with pytest.raises(linkdyn.SceneError, match="its events have the name 'G'"):
        linkdyn.Scene(at_rest(pair(), "A", ramp(0.0, 1), efficiency=0.9) | {"clutch": [{"name": "G", "joint": "A"}]})
