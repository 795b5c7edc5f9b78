"""Worm gears: by the textbook (Shigley's Mechanical Engineering Design, 10th edition, 13-17; Niemann's efficiencies), by a program of one's own in
which a worm's flank, from the surface of its thread, presses and rubs on a body, and one road of the engine against another."""

from __future__ import annotations

import copy
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn._geometry import kinematics, wheels
from linkdyn._geometry.postures import find_postures
from numpy.typing import NDArray
from test_balance_of_links import acting, both_links, inertia_and_weight
from test_designs import check_all_numbers
from test_generate import Compiled
from test_gears import STEADY, SWAY, gear, hinge
from test_joint_kinds import GRAVITY, along, check_balance, check_roads, keeps_energy, let_go

pytestmark = pytest.mark.accuracy

Array = NDArray[np.float64]


def turned(angles: tuple[float, float, float]) -> Array:
    """Some attitude."""
    whole = np.eye(3)
    for axis, angle in enumerate(angles):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(3)
        turn[[i, j], [i, j]] = np.cos(angle)
        turn[j, i], turn[i, j] = np.sin(angle), -np.sin(angle)
        whole = whole @ turn
    return whole


def worm_and_wheel(lead: float, teeth: tuple[int, int] = (2, 30), distance: float = 0.08, side: int = 1, led: str = "A", attitude: Array | None = None,
                   weighs: bool = True, **more: Any) -> dict[str, Any]:
    """Worm along z of an attitude, its wheel along `side` x, `distance` away along y; hinges are off the mesh."""
    r = np.eye(3) if attitude is None else attitude
    z1, z2 = r[:, 2], side * r[:, 0]
    at = {"A": 0.07 * r[:, 2], "B": distance * r[:, 1] + 0.03 * r[:, 0]}
    marker = {"A": {"axis": z1.tolist(), "x": r[:, 1].tolist()}, "B": {"axis": z2.tolist(), "x": r[:, 1].tolist()}}

    def body(name: str, mark: str, mass: float, inertia: list[float]) -> dict[str, Any]:
        solid = {"mass": mass, "cog": [0.01, -0.004, 0.02], "inertia": inertia} if weighs else {"mass": 0.0}
        return {"name": name, "markers": {mark: {"at": [0, 0, 0], **marker[mark]}}, **solid}

    return {"space": "spatial", "gravity": GRAVITY.tolist() if weighs else [0, 0, 0],
            "frame": {"markers": {name: {"at": at[name].tolist(), **marker[name]} for name in "AB"}},
            "link": [body("worm", "A", 2.0, [0.004, 0.005, 0.003, 0.0002, -0.0001, 0.0003]), body("wheel", "B", 4.0, [0.02, 0.03, 0.025, 0.001, 0.002, -0.001])],
            "joint": [hinge("A", "frame.A", "worm.A"), hinge("B", "frame.B", "wheel.B"), gear("G", "worm.A", "wheel.B", list(teeth), lead_angle=lead, **more)],
            "coordinate": [along(led, SWAY)], "actuator": [{"joint": led}], "time": {"end": 2, "samples": 201}}


# ---------------------------------------------------------------- a flank that presses and rubs

def flank(radius: float, lead: float, alpha: float, upper: bool, e: Array, t: Array, z: Array) -> Array:
    """Outward normal of a thread's surface [(radius + u) e(phi), rise phi +- slope u] at u = 0, by differences of its points."""
    rise, slope = radius * np.tan(lead), np.tan(alpha) / np.cos(lead)
    sign = 1.0 if upper else -1.0

    def point(u: float, phi: float) -> Array:
        return np.asarray((radius + u) * (np.cos(phi) * e + np.sin(phi) * t) + (rise * phi - sign * slope * u) * z)

    h = 1e-6 * radius
    normal = np.cross(point(h, 0) - point(-h, 0), point(0, 1e-6) - point(0, -1e-6))
    normal /= np.linalg.norm(normal)
    return np.asarray(normal if normal @ z * sign > 0 else -normal)


def contact_program(scene: dict[str, Any], alpha: float, mu: float, rate: float, torque: dict[str, float]) -> list[dict[str, Any]]:
    """Newton and Euler of worm and wheel where all angles are zero, with hinges that hold them and one flank or the other: every solution whose
    flank presses. Torques about the axes of A and B."""
    joint = scene["joint"][2]
    lead, (starts, teeth) = joint["lead_angle"], joint["teeth"]
    points = [np.array(scene["frame"]["markers"][name]["at"]) for name in "AB"]
    axes = [np.array(scene["frame"]["markers"][name]["axis"]) for name in "AB"]
    across = np.cross(axes[0], axes[1])
    apart = points[1] - points[0]
    across *= np.sign(across @ apart)
    radius = (apart @ across) / (1 + teeth / starts * abs(np.tan(lead)))
    contact = points[0] + (apart @ axes[0]) * axes[0] + radius * across
    arms = [contact - point for point in points]
    e, z = across, axes[0]
    t = np.cross(z, e)
    # the wheel's speed, so that its teeth do not run into the flank
    normal = flank(radius, lead, 0.0, True, e, t, z)
    speed = (normal @ np.cross(rate * z, arms[0])) / (normal @ np.cross(axes[1], arms[1]))
    omega = [rate * z, speed * axes[1]]
    slip = np.cross(omega[1], arms[1]) - np.cross(omega[0], arms[0])
    slip /= np.linalg.norm(slip)
    found = []
    for upper in (True, False):
        normal = flank(radius, lead, alpha, upper, e, t, z)
        force = normal - mu * slip                              # on the wheel, for a unit that presses
        matrix, right = np.zeros((23, 23)), np.zeros(23)
        for k, link in enumerate(scene["link"]):
            mass, cog = link["mass"], np.array(link["cog"])
            xx, yy, zz, xy, yz, xz = link["inertia"]
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            a, al, f, m = 6 * k, 6 * k + 3, 12 + 5 * k, 15 + 5 * k
            sides = np.linalg.svd(axes[k][None])[2][1:]
            skew = lambda v: np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])  # noqa: E731
            sign = 2 * k - 1                                    # of the flank's force
            # mass times acceleration of the centre of mass; Euler about it
            matrix[a:a + 3, a:a + 3] = mass * np.eye(3)
            matrix[a:a + 3, f:f + 3] = -np.eye(3)
            matrix[a:a + 3, 22] = -sign * force
            right[a:a + 3] = mass * np.array(scene["gravity"])
            matrix[al:al + 3, al:al + 3] = inertia
            matrix[al:al + 3, f:f + 3] = skew(cog)              # force at the marker, -cog from the centre of mass
            matrix[al:al + 3, m:m + 2] = -sides.T
            matrix[al:al + 3, 22] = -sign * np.cross(arms[k] - cog, force)
            right[al:al + 3] = torque["AB"[k]] * axes[k] - np.cross(omega[k], inertia @ omega[k])
            # the marker stays, and the body turns about its axis alone
            matrix[f:f + 3, a:a + 3] = np.eye(3)
            matrix[f:f + 3, al:al + 3] = skew(cog)              # alpha x (-cog)
            right[f:f + 3] = np.cross(omega[k], np.cross(omega[k], cog))
            matrix[m:m + 2, al:al + 3] = sides
            matrix[22, al:al + 3] = sign * np.cross(arms[k], normal)
        solution = np.linalg.solve(matrix, right)
        if solution[22] >= 0:
            hold = [np.concatenate([solution[12 + 5 * k:15 + 5 * k], np.linalg.svd(axes[k][None])[2][1:].T @ solution[15 + 5 * k:17 + 5 * k]]) for k in (0, 1)]
            found.append({"alpha": [solution[6 * k + 3:6 * k + 6] @ axes[k] for k in (0, 1)], "hold": hold, "contact": solution[22] * force,
                          "speed": speed, "loss": mu * solution[22] * abs(slip @ (np.cross(omega[1], arms[1]) - np.cross(omega[0], arms[0])))})
    return found


CASES = [
    # lead, side, pressure angle, mu, rate of the worm, torques on worm and wheel
    (np.radians(9.0), 1, np.radians(20), 0.05, 40.0, (3.0, -30.0)),
    (np.radians(9.0), -1, np.radians(20), 0.05, 40.0, (-3.0, 80.0)),
    (np.radians(-9.0), 1, np.radians(14.5), 0.05, -25.0, (-2.0, -25.0)),
    (np.radians(-4.0), -1, np.radians(20), 0.12, 30.0, (3.0, 20.0)),
    (np.radians(4.0), 1, np.radians(20), 0.12, -30.0, (-3.0, 40.0)),
    (np.radians(30.0), 1, np.radians(25), 0.08, 15.0, (5.0, 12.0)),
    (np.radians(45.0), -1, np.radians(20), 0.1, 15.0, (0.0, 12.0)),
    (np.radians(30.0), 1, np.radians(25), 0.0, 15.0, (5.0, 12.0)),
]


@pytest.mark.parametrize("attitude", [(0.0, 0.0, 0.0), (0.4, -0.7, 1.1)])
@pytest.mark.parametrize(("lead", "side", "alpha", "mu", "rate", "torques"), CASES)
def test_against_a_flank_that_presses(lead: float, side: int, alpha: float, mu: float, rate: float, torques: tuple[float, float], attitude: tuple[float, float, float]) -> None:
    """Accelerations of a forward run, and all forces of inverse dynamics."""
    scene = worm_and_wheel(lead, side=side, attitude=turned(attitude), pressure_angle=alpha)
    found = contact_program(scene, alpha, mu, rate, dict(zip("AB", torques)))
    assert len(found) == 1
    expected = found[0]
    if mu > 0:
        scene["friction"] = [{"joint": "G", "coulomb": mu}]
    axis = np.array(scene["frame"]["markers"]["B"]["axis"])
    scene["load"] = [{"on": "wheel.B", "moment": (torques[1] * axis).tolist()}]
    mechanism = linkdyn.Scene(scene)
    run = mechanism.inverse([[0.0]], [[rate]], [[expected["alpha"][0]]], want="all")
    assert (run.status == 0).all()
    np.testing.assert_allclose(run.driving_force.values, torques[0], atol=1e-7 * max(np.abs(torques)))
    np.testing.assert_allclose(run.joint_rate.sel(variable="B.angle").values, expected["speed"], rtol=1e-9)
    size = np.linalg.norm(expected["contact"])
    for k, name in enumerate("AB"):
        np.testing.assert_allclose(run.reaction.sel(joint=name).values[0], expected["hold"][k], atol=1e-8 * size)
    rubs = run.friction.sel(joint="G").values[0, :3] if mu > 0 else 0.0
    np.testing.assert_allclose(run.reaction.sel(joint="G").values[0, :3] + rubs, expected["contact"], atol=1e-8 * size)
    if mu > 0:
        np.testing.assert_allclose(run.friction_power.sel(joint="G").values, expected["loss"], rtol=1e-8)
    scene["coordinate"] = [{"joint": "A", "start": {"position": 0.0, "velocity": rate}}]
    scene["actuator"] = [{"joint": "A", "law": {"type": "formula", "value": f"{torques[0]!r} N*m"}}]
    forward = linkdyn.Scene(scene).forward(t=[0.0, 1e-4])
    np.testing.assert_allclose(forward.qdd.values[0], expected["alpha"][0], rtol=1e-8)


# ---------------------------------------------------------------- the textbook

def steady(lead: float, load: float, rate: float = 40.0, led: str = "A", side: int = 1, friction: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    """Weightless, at one speed, a torque on the other wheel."""
    scene = worm_and_wheel(lead, side=side, led=led, weighs=False, **more)
    scene["coordinate"] = [along(led, {"law": "constant-rate", "rate": rate})]
    other = {"A": "wheel.B", "B": "worm.A"}[led]
    axis = np.array(scene["frame"]["markers"][other[-1]]["axis"])
    scene["load"] = [{"on": other, "moment": (load * axis).tolist()}]
    return scene | ({"friction": [{"joint": "G", **friction}]} if friction else {})


def test_example_of_shigley() -> None:
    """Example 13-10: 1 hp at 1200 rev/min, two starts, 30 teeth, six to the inch, worm of 2 in, 14.5 deg, f = 0.03: 52.5, 69.6 and 264 lbf."""
    inch, pound = 0.0254, 4.4482216
    lead = np.arctan(2 * np.pi / 6 / (np.pi * 2))
    assert np.degrees(lead) == pytest.approx(9.46, abs=5e-3)
    torque = 264 * pound * 2.5 * inch
    scene = steady(lead, torque, 1200 * np.pi / 30, distance=3.5 * inch, pressure_angle="14.5 deg", friction={"coulomb": 0.03})
    wheel = linkdyn.Scene(scene).inverse(want="all").joint_rate.sel(variable="B.angle").values[0]
    scene["load"][0]["moment"] = [-np.sign(wheel) * torque, 0, 0]
    run = linkdyn.Scene(scene).inverse(want="all")
    assert abs(wheel) == pytest.approx(1200 * np.pi / 30 * 2 / 30)
    on_worm = -(run.reaction.sel(joint="G").values[0, :3] + run.friction.sel(joint="G").values[0, :3]) / pound
    # x: round the worm, y: off the wheel, z: along the worm
    np.testing.assert_allclose(np.abs(on_worm), [52.5, 69.6, 264], rtol=4e-3)
    assert on_worm[1] < 0
    assert run.driving_power.values[0, 0] == pytest.approx(745.7, rel=5e-3)


@pytest.mark.parametrize("hand", [1, -1])
def test_which_way_it_turns(hand: int) -> None:
    """A right-handed worm that turns about z screws its wheel's teeth towards -z."""
    run = linkdyn.Scene(worm_and_wheel(hand * 0.2)).inverse(want="all")
    ratio = (run.joint_rate.sel(variable="B.angle") / run.joint_rate.sel(variable="A.angle")).values
    # the wheel's axis is x and its centre beyond, at +y: teeth at the worm move with omega x (-r y) = -omega r z
    np.testing.assert_allclose(ratio, hand * 2 / 30, rtol=1e-12)


@pytest.mark.parametrize("given", ["coulomb", "efficiency"])
@pytest.mark.parametrize("lead", [np.radians(12.0), -np.radians(5.0)])
@pytest.mark.parametrize("load", [50.0, -50.0])
@pytest.mark.parametrize("led", ["A", "B"])
def test_efficiencies(lead: float, load: float, led: str, given: str) -> None:
    """tan(lead)/tan(lead + rho) while the worm drives, tan(lead - rho)/tan(lead) while its wheel does; whoever is led."""
    mu, alpha = 0.06, np.radians(20)
    rho, slope = np.arctan(mu / np.cos(alpha)), abs(lead)
    there, back = np.tan(slope) / np.tan(slope + rho), np.tan(slope - rho) / np.tan(slope)
    scene = steady(lead, load, led=led, friction={"coulomb": mu} if given == "coulomb" else {"efficiency": there})
    run = linkdyn.Scene(scene).inverse(want="all")
    assert (run.status == 0).all() and np.abs(run.power_imbalance).max() < 1e-12
    rates = {name: run.joint_rate.sel(variable=f"{name}.angle").values[0] for name in "AB"}
    power = {led: run.driving_force.values[0, 0] * rates[led], "BA"["AB".index(led)]: load * rates["BA"["AB".index(led)]]}
    expected = there if power["A"] > 0 else back
    into, out = ("A", "B") if power["A"] > 0 else ("B", "A")
    np.testing.assert_allclose(-power[out], expected * power[into], rtol=1e-11)
    np.testing.assert_allclose(run.friction_power.sel(joint="G"), power["A"] + power["B"], rtol=1e-11)


LOCKING = {"coulomb": 0.12}
"""At 5 degrees, whose tangent is 0.087."""


def test_self_locking_lowers_by_power() -> None:
    """Its wheel's load wants to turn it and does not: the worm has to drive down, by tan(rho - lead)/tan(lead) of what the load gives."""
    lead, rho = np.radians(5), np.arctan(0.12 / np.cos(np.radians(20)))
    run = linkdyn.Scene(steady(lead, 50.0, friction=LOCKING)).inverse(want="all")
    assert (run.status == 0).all()
    load = 50.0 * run.joint_rate.sel(variable="B.angle").values
    assert (load > 0).all()
    np.testing.assert_allclose(run.driving_power.values[:, 0], load * np.tan(rho - lead) / np.tan(lead), rtol=1e-11)


def test_self_locking_wheel_cannot_drive() -> None:
    """Led by its wheel against a torque on the worm no force moves it: told, with the gear's name; samples in which the worm helps are right."""
    scene = linkdyn.Scene(steady(np.radians(5), 5.0, rate=-2.0, led="B", friction=LOCKING))
    run = scene.inverse()
    assert (run.status != 0).all()
    assert "'G'" in run.attrs["failure"] and "lock" in run.attrs["failure"]
    helped = linkdyn.Scene(steady(np.radians(5), 5.0, rate=2.0, led="B", friction=LOCKING)).inverse(want="all")
    assert (helped.status == 0).all()


@pytest.mark.parametrize(("friction", "holds"), [({"coulomb": 0.12, "creep_speed": "0.1 mm/s"}, True), ({"efficiency": 0.45, "creep_speed": "0.1 mm/s"}, True),
                                                 ({"coulomb": 0.05}, False)])
def test_load_on_a_worm_that_nobody_holds(friction: dict[str, Any], holds: bool) -> None:
    """It stays, but for creeping; a steeper worm or a smoother one runs off, as the power that gets through says."""
    lead = np.radians(5)
    scene = worm_and_wheel(lead, pressure_angle=0.0) | {"gravity": [0, 0, 0], "actuator": [], "friction": [{"joint": "G", **friction}],
                                                        "coordinate": [{"joint": "A"}]}
    for link in scene["link"]:
        link["cog"] = [0, 0, 0]
    scene["load"] = [{"on": "wheel.B", "moment": [50.0, 0, 0]}]
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 1, 11), method="seulex", rtol=1e-8, atol=1e-8, want="all")
    assert (run.status == 0).all()
    radius = 0.08 / (1 + 15 * np.tan(lead))
    crept = np.abs(run.qd.values[:, 0]) * radius / np.cos(lead)
    if holds:
        assert 0 < crept[-1] < 2e-4
        return
    rho = np.arctan(0.05 / np.cos(np.radians(20)))
    back, ratio = np.tan(lead - rho) / np.tan(lead), 2 / 30
    expected = back * ratio * 50.0 / (0.003 + back * ratio**2 * 0.02)
    np.testing.assert_allclose(run.qdd.values[3:, 0], expected, rtol=1e-6)


@pytest.mark.parametrize(("load", "solutions"), [(-50.0, 2), (50.0, 0)])
def test_heavy_wheel_of_a_light_worm(load: float, solutions: int) -> None:
    """The wheel's inertia against a thread that locks: where its load drives it no flank presses as it would have to, and the run says so; where
    it brakes, either flank could, and that is taken which presses without friction."""
    lead, alpha = np.radians(5), np.radians(20)
    scene = worm_and_wheel(lead, pressure_angle=alpha) | {"gravity": [0, 0, 0]}
    for link, inertia in zip(scene["link"], ([1e-3, 1e-3, 1e-5, 0, 0, 0], [0.5, 0.5, 0.5, 0, 0, 0])):
        link |= {"cog": [0, 0, 0], "inertia": inertia}
    expected = contact_program(scene, alpha, 0.12, 30.0, {"A": 0.0, "B": load})
    assert len(expected) == solutions
    smooth = contact_program(scene, alpha, 0.0, 30.0, {"A": 0.0, "B": load})[0]
    scene |= {"friction": [{"joint": "G", "coulomb": 0.12}], "load": [{"on": "wheel.B", "moment": [load, 0, 0]}], "actuator": [],
              "coordinate": [{"joint": "A", "start": {"position": 0.0, "velocity": 30.0}}]}
    if not expected:
        with pytest.raises(linkdyn.LinkdynError, match="joint 'G' locks"):
            linkdyn.Scene(scene).forward(t=[0.0, 1e-3])
        return
    taken = next(one for one in expected if one["contact"] @ smooth["contact"] > 0)
    np.testing.assert_allclose(linkdyn.Scene(scene).forward(t=[0.0, 1e-3]).qdd.values[0], taken["alpha"][0], rtol=1e-8)


# ---------------------------------------------------------------- in moving carriers, every road

def on_an_arm(lead: float, friction: bool = False, pressure_angle: float = 0.0) -> dict[str, Any]:
    """A worm and its wheel on a rocking arm; the wheel is the sun of nothing, but carries a load that is off its axis."""
    scene = worm_and_wheel(lead, attitude=turned((0.3, 0.5, -0.4)))
    scene["frame"]["markers"] |= {"tilt": {"at": [0, 0, 0.2], "axis": [1, 0.5, 0.3]}}
    markers = {name: scene["frame"]["markers"].pop(name) for name in "AB"}
    scene["link"].insert(0, {"name": "arm", "markers": markers | {"tilt": {"at": [0.1, 0, 0], "axis": [1, 0.5, 0.3]}}, "mass": 3.0, "cog": [0.1, 0.1, 0.05],
                             "inertia": [0.1, 0.2, 0.15, 0.01, 0.0, 0.02]})
    for joint in scene["joint"][:2]:
        joint["between"][0] = joint["between"][0].replace("frame", "arm")
    scene["joint"].insert(0, hinge("tilt", "frame.tilt", "arm.tilt"))
    scene["coordinate"] = [along("tilt", {"law": "harmonic", "amplitude": 0.6, "frequency": "2.5 rad/s"}), along("A", STEADY)]
    scene["actuator"] = [{"joint": "tilt"}, {"joint": "A"}]
    scene["load"] = [{"on": "wheel.B", "axes": "link", "force": [20.0, 10.0, -5.0], "moment": [6.0, 0, 2.0]}]
    if pressure_angle > 0:
        scene["joint"][3]["pressure_angle"] = pressure_angle
    return scene | ({"friction": [{"joint": "G", "coulomb": 0.06, "static": 0.09, "stribeck_speed": 0.05}]} if friction else {})


ROADS = {"right": on_an_arm(0.15), "left": on_an_arm(-0.5), "by its wheel": worm_and_wheel(0.6, led="B")}


@pytest.mark.parametrize("name", ROADS)
def test_every_road(name: str) -> None:
    check_roads(ROADS[name])
    check_balance(ROADS[name], 0.31)
    free = copy.deepcopy(ROADS[name])
    free.pop("load", None)
    keeps_energy(let_go(free))


@pytest.mark.parametrize("lead", [0.15, -0.5, 0.05])
def test_every_road_with_losses(lead: float) -> None:
    """Power, record, lanes, dense solver; every link in balance; forward behind inverse."""
    scene = on_an_arm(lead, friction=True, pressure_angle=0.35)
    mechanism = check_roads(scene, reduced=False)
    run = mechanism.inverse(want="all")
    motion = kinematics.link_motion(mechanism, run)
    force, moment = inertia_and_weight(mechanism, motion)
    for link, point, pull, turn in acting(mechanism, run, motion):
        force[:, link] += pull
        moment[:, link] += turn + np.cross(point - motion.position[:, link], pull)
    rubs = run.friction.sel(joint="G").values
    for link, point, pull, turn in both_links(mechanism.description["joints"][3], mechanism, motion, rubs[:, :3], rubs[:, 3:]):
        force[:, link] += pull
        moment[:, link] += turn + np.cross(point - motion.position[:, link], pull)
    assert np.abs(force[:, 1:]).max() < 1e-8 * np.abs(run.reaction.values).max()
    assert np.abs(moment[:, 1:]).max() < 1e-8 * np.abs(run.reaction.values).max()
    forward = linkdyn.Scene(scene).forward(t=np.linspace(0, 0.5, 11), rtol=1e-10, atol=1e-10, want="all")
    np.testing.assert_allclose(forward.q.values, mechanism.motion(forward.time.values)[0], atol=2e-6)


def test_generated_code(tmp_path: Any) -> None:
    scene = linkdyn.Scene(on_an_arm(0.15, pressure_angle=0.35) | {"load": []})
    code = Compiled(scene.generate(want=["driving_force", "reaction"], name="worm"), tmp_path)
    run = scene.inverse()
    q, qd, qdd = scene.motion()
    for i in (0, 77, 150):
        status, found = code(q=q[i], qd=qd[i], qdd=qdd[i])
        assert status == 0
        np.testing.assert_allclose(found["reaction"], run.reaction.values[i], atol=1e-12 * np.abs(run.reaction.values).max())


@pytest.mark.parametrize("friction", [False, True])
def test_designs(friction: bool, tmp_path: Any) -> None:
    """Lead angles, teeth, places, coefficients, each in a design of its own."""
    assert check_all_numbers(on_an_arm(0.15, friction, 0.35), tmp_path) > 20


def test_pictures_touch() -> None:
    """The thread goes through where worm and wheel meet, as far from both axes as their radii."""
    scene = linkdyn.Scene(on_an_arm(0.15))
    worm = next(joint for joint in scene.description["joints"] if joint["name"] == "G")
    postures, _ = find_postures(scene, scene.poses(np.array([[0.3, 0.0], [-0.2, 1.0]])))
    posture = postures.at(1)
    point = wheels.pitch_point(posture, worm)
    for side in (0, 1):
        centre, axis, _ = wheels.frame_of(posture, worm["links"][side], worm["markers"][side])
        assert np.linalg.norm(np.cross(point - centre, axis)) == pytest.approx(worm["radii"][side], rel=1e-9)
    centre, axis, _ = wheels.frame_of(posture, worm["links"][0], worm["markers"][0])
    line = wheels.thread(posture, worm)
    np.testing.assert_allclose(np.linalg.norm(np.cross(line - centre, axis), axis=1), worm["radii"][0], rtol=1e-9)
    np.testing.assert_allclose((line.mean(axis=0) - point) @ axis, 0, atol=1e-3)
    steps = np.diff(line, axis=0)
    np.testing.assert_allclose(np.arcsin(steps @ axis / np.linalg.norm(steps, axis=1)), 0.15, atol=1e-3)
    inner = np.array(wheels.thread_in_link(postures, worm, 1))
    np.testing.assert_allclose(postures.origins[worm["links"][0]][1] + inner @ postures.turns[worm["links"][0]][1].T, line, atol=1e-8)


# ---------------------------------------------------------------- words

@pytest.mark.parametrize(("friction", "words"), [
    ({"coulomb": 0.02}, "driven by its wheel 0.755"), ({"coulomb": 0.12}, "self-locking: its wheel cannot drive it"),
    ({"coulomb": 0.02, "static": 0.12, "stribeck_speed": 0.1}, "self-locking at rest"), ({"efficiency": 0.8}, "efficiency 0.8"),
    ({"efficiency": 0.45}, "self-locking: its wheel cannot drive it")])
def test_explain_says_so(friction: dict[str, Any], words: str) -> None:
    assert words in linkdyn.Scene(steady(np.radians(5), 1.0, friction=friction)).explain()
