"""Losses in the meshes of gears and of belts: by the textbook's efficiencies of planetary stages, by teeth that slide on each other, by the balance of power."""

from __future__ import annotations

import copy
import itertools
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn._geometry import kinematics
from test_balance_of_links import acting, both_links, inertia_and_weight
from test_designs import check_all_numbers
from test_gears import FREE, PLANAR, SPATIAL, gear, hinge, pair, planar, planetary, rack_and_pinion
from test_joint_kinds import along, check_roads

pytestmark = pytest.mark.accuracy

def steady(scene: dict[str, Any], rate: float = 35.0) -> dict[str, Any]:
    """Without weight and inertia, the first coordinate at one speed: only loads and losses count."""
    scene = copy.deepcopy(scene) | {"gravity": [0, 0]}
    for link in scene["link"]:
        link |= {"mass": 0.0, "inertia": 0.0, "cog": [0.0, 0.0]}
    scene["coordinate"][0]["motion"] = {"law": "constant-rate", "rate": rate}
    return scene


def with_losses(scene: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Every mesh loses something."""
    meshes = [joint["name"] for joint in scene["joint"] if joint["type"] in ("gear", "rack", "belt")]
    return copy.deepcopy(scene) | {"friction": [{"joint": name, **(more or {"efficiency": 0.97 - 0.01 * k})} for k, name in enumerate(meshes)]}


def two_pulleys(radii: tuple[float, float], run: str = "open", **more: Any) -> dict[str, Any]:
    scene = pair()
    scene["joint"][2] = {"name": "G", "type": "belt", "between": ["pinion.A", "wheel.B"], "radii": list(radii), "run": run, **more}
    return scene


BELTS = {"belt": two_pulleys((0.06, 0.15)), "equal pulleys": two_pulleys((0.08, 0.08)), "crossed belt": two_pulleys((0.12, 0.06), "crossed")}
SINGLE = {"external": pair(), "internal": pair(mesh="internal"), "rack": rack_and_pinion()} | BELTS


@pytest.mark.parametrize("name", SINGLE)
@pytest.mark.parametrize("rate", [35.0, -20.0])
@pytest.mark.parametrize("load", [8.0, -8.0])
def test_what_comes_out_of_what_goes_in(name: str, rate: float, load: float) -> None:
    """Whichever way power flows, the part that the efficiency says arrives, and the rest is named."""
    scene = with_losses(steady(SINGLE[name], rate), efficiency=0.93)
    on = {"on": "rack.R", "force": [load, 0]} if name == "rack" else {"on": "wheel.B", "moment": load}
    run = linkdyn.Scene(scene | {"load": [on]}).inverse(want="all")
    assert (run.status == 0).all() and np.abs(run.power_imbalance).max() < 1e-13
    led = run.joint_rate.sel(variable="R.slide" if name == "rack" else "B.angle").values
    drive, taken = run.driving_force.values[:, 0] * run.joint_rate.values[:, 0], -load * led
    into, out = np.where(taken > 0, drive, -taken), np.where(taken > 0, taken, -drive)
    np.testing.assert_allclose(out, 0.93 * into, rtol=1e-12)
    np.testing.assert_allclose(run.friction_power.sel(joint="G"), 0.07 * into, rtol=1e-12)


@pytest.mark.parametrize("name", BELTS)
@pytest.mark.parametrize("load", [8.0, -8.0])
def test_shafts_of_belts(name: str, load: float) -> None:
    """Both wheels with their belt are in balance: across the line of centres bearings take what the torques of both leave, along it nothing."""
    scene = with_losses(steady(BELTS[name]), efficiency=0.93) | {"load": [{"on": "wheel.B", "moment": load}]}
    run = linkdyn.Scene(scene).inverse()
    apart = np.subtract(scene["frame"]["markers"]["B"], scene["frame"]["markers"]["A"])
    drive = run.driving_force.values[0, 0]
    across = np.array([-apart[1], apart[0]]) / (apart @ apart)
    np.testing.assert_allclose(run.reaction.sel(joint="B").values[0], [*(-(drive + load) * across), 0], atol=1e-11)
    np.testing.assert_allclose(run.reaction.sel(joint="A").values[0], [*((drive + load) * across), 0], atol=1e-11)
    # each wheel loses the same couple
    radii = scene["joint"][2]["radii"]
    force = run.reaction.sel(joint="G").values[0, 2] / radii[1]
    sign = -1 if scene["joint"][2]["run"] == "crossed" else 1
    lost = abs(drive - sign * radii[0] * force), abs(-load - radii[1] * force)
    np.testing.assert_allclose(*lost, rtol=1e-11)


@pytest.mark.parametrize("run", ["open", "crossed"])
@pytest.mark.parametrize("pull", [0.4e-3, -0.4e-3])
@pytest.mark.parametrize("rate", [20.0, -20.0])
def test_strands_that_lose(run: str, pull: float, rate: float) -> None:
    """Each wheel gets the difference of the tensions, less or more the couple that the efficiency makes of it."""
    r1, r2, efficiency, stiffness = 0.06, 0.15, 0.9, 2e5
    sign = -1 if run == "crossed" else 1
    scene = with_losses(steady(two_pulleys((r1, r2), run, strands={"stiffness": stiffness, "pretension": 300.0})), efficiency=efficiency)
    scene["coordinate"] = [along("A", {"law": "constant-rate", "rate": rate}),
                           along("B", {"law": "constant-rate", "start": -sign * pull / r2, "rate": sign * rate * r1 / r2})]
    scene["actuator"] = [{"joint": "A"}, {"joint": "B"}]
    found = linkdyn.Scene(scene).inverse(want="all")
    assert (found.status == 0).all() and np.abs(found.power_imbalance).max() < 1e-12
    force = 2 * stiffness * sign * pull                 # forwards on the first wheel's rim the second gets it
    first, second = (1 / r1, 1 / r2) if force * sign * rate > 0 else (1 / r2, 1 / r1)
    couple = abs(force) * (1 - efficiency) / (second + efficiency * first)
    way = np.sign(rate)
    np.testing.assert_allclose(found.driving_force.values[:, 0], sign * r1 * force + way * couple, rtol=1e-9)
    np.testing.assert_allclose(found.driving_force.values[:, 1], -r2 * force + sign * way * couple, rtol=1e-9)
    np.testing.assert_allclose(found.friction_power.sel(joint="G"), couple * abs(rate) * (1 + r1 / r2), rtol=1e-9)


def stretching(run: str, load: float) -> dict[str, Any]:
    """One shaft turns evenly, the other is free and has a load; damping lets what swings die out."""
    scene = with_losses(two_pulleys((0.06, 0.15), run, strands={"stiffness": 2e4, "damping": 400.0, "pretension": 300.0}), efficiency=0.9)
    scene["gravity"] = [0, 0]
    scene["coordinate"] = [along("A", {"law": "constant-rate", "rate": 20.0}, driven=True), {"joint": "B", "start": {"velocity": (-8.0 if run == "crossed" else 8.0)}}]
    return scene | {"actuator": [{"joint": "A"}, {"joint": "B", "law": {"type": "constant", "value": load}}]}


@pytest.mark.parametrize("run", ["open", "crossed"])
@pytest.mark.parametrize("load", [20.0, -20.0])
def test_strands_that_lose_in_a_run(run: str, load: float) -> None:
    """Once both turn evenly, what arrives is the part that the efficiency says."""
    found = linkdyn.Scene(stretching(run, load)).forward(t=[0.0, 2.0, 3.0], rtol=1e-10, atol=1e-10, want="all")
    assert (found.status == 0).all()
    drive, taken = found.driving_power.values[-1, 0], -load * found.qd.values[-1, 1]
    into, out = (drive, taken) if taken > 0 else (-taken, -drive)
    np.testing.assert_allclose(out, 0.9 * into, rtol=1e-7)
    np.testing.assert_allclose(found.friction_power.sel(joint="G").values[-1], 0.1 * into, rtol=1e-7)


@pytest.mark.parametrize("load", [-84.0, 84.0])
@pytest.mark.parametrize("sense", [1, -1])
def test_planetary_stage_by_the_textbook(load: float, sense: int) -> None:
    """Sun in, carrier out, ring stands: (1 + i n)/(1 + i) of the power arrives, i = 60/24 and n that of the train with its carrier held; back (1 + i)/(1 + i/n)."""
    i, held = 60 / 24, 0.98 * 0.99
    scene = steady(planetary(), sense * 35.0) | {"load": [{"on": "carrier.P", "moment": load}],
                                                 "friction": [{"joint": "SP", "efficiency": 0.98}, {"joint": "PR", "efficiency": 0.99}]}
    run = linkdyn.Scene(scene).inverse(want="all")
    assert np.abs(run.power_imbalance).max() < 1e-13
    drives = load * sense < 0
    sun = -load / (1 + i * held) if drives else -load / (1 + i / held)
    np.testing.assert_allclose(run.driving_force.values, sun, rtol=1e-12)
    np.testing.assert_allclose(run.friction_power.values.sum(axis=1), np.abs(run.driving_power.values.sum(axis=1) + load * sense * 10.0), rtol=1e-9)


def wolfrom(load: float) -> dict[str, Any]:
    """Wolfrom's drive: a planet rolls in a ring that stands and drives another one, with a tooth less each; a carrier that nobody holds."""
    return steady(planar(
        frame={"markers": {"O": [0, 0]}},
        link=[{"name": name, "markers": {"O": [0, 0]}} for name in ("sun", "ring")]
        + [{"name": "carrier", "markers": {"O": [0, 0], "P": [0.042, 0]}}, {"name": "planet", "markers": {"P": [0, 0]}}],
        joint=[hinge("S", "frame.O", "sun.O"), hinge("C", "frame.O", "carrier.O"), hinge("P", "carrier.P", "planet.P"), hinge("R", "frame.O", "ring.O"),
               gear("SP", "sun.O", "planet.P", [24, 18]), gear("PF", "planet.P", "frame.O", [18, 60], mesh="internal"),
               gear("PR", "planet.P", "ring.O", [17, 59], mesh="internal")],
        coordinate=[along("S", {"law": "constant-rate", "rate": 100.0})], actuator=[{"joint": "S"}],
        load=[{"on": "ring.O", "moment": load}]), 100.0)


def torque_of_wolfrom(load: float, n: float) -> list[float]:
    """The sun's torque with which all wheels are in balance: 24, 18, 60 and 17, 59 teeth, each mesh with the efficiency n as power flows seen from the carrier."""
    sun = 100.0
    carrier = sun / (1 + 60 / 24)
    rate = {"sun": sun - carrier, "planet": -(sun - carrier) * 24 / 18, "fixed": -carrier}
    rate["ring"] = rate["planet"] * 17 / 59
    meshes = [("sun", "planet"), ("planet", "fixed"), ("planet", "ring")]
    found = []
    for ways in itertools.product((True, False), repeat=3):
        # unknown: torques of the meshes on both of their wheels, and the sun's own
        matrix, right = np.zeros((7, 7)), np.zeros(7)
        for k, ((a, b), first_drives) in enumerate(zip(meshes, ways)):
            matrix[k, 2 * k:2 * k + 2] = [n * rate[a], rate[b]] if first_drives else [rate[a], n * rate[b]]
        matrix[3, [6, 0]] = 1                            # sun
        matrix[4, [1, 2, 4]] = 1                         # planet
        matrix[5, 5], right[5] = 1, -load                # ring that turns
        matrix[6, :6] = 1                                # nobody holds the carrier
        torque = np.linalg.solve(matrix, right)
        if all((torque[2 * k] * rate[a] < 0) == way for k, ((a, _), way) in enumerate(zip(meshes, ways))):
            found.append(float(torque[6]))
    return found


@pytest.mark.parametrize("efficiency", [0.995, 0.97])
@pytest.mark.parametrize("load", [-500.0, 500.0])
def test_wolfrom(efficiency: float, load: float) -> None:
    """Much power goes round in it. What is lost of that holds a load that would drive it, or locks."""
    scene = with_losses(wolfrom(load), efficiency=efficiency)
    run = linkdyn.Scene(scene).inverse(want="all")
    expected = torque_of_wolfrom(load, efficiency)
    assert (run.status == 0).all() and len(expected) == 1
    np.testing.assert_allclose(run.driving_force.values, expected[0], rtol=1e-11)
    assert np.abs(run.power_imbalance).max() < 1e-12
    turns = run.joint_rate.sel(variable="R.angle").values
    if load * turns[0] > 0 and efficiency == 0.97:
        assert (run.driving_force.values[:, 0] * 100.0 > 0).all()    # it has to be driven down: self-locking


def rolled_teeth(z: tuple[int, int], m: float, alpha: float, mesh: str, torque: float, speed: float, mu: float) -> float:
    """Mean power of friction of involute teeth, by where tooth pairs touch at many instants and how fast their flanks move there.

    The pinion turns at `speed` about the origin and takes `torque`; pairs that touch share the force in equal parts.
    """
    r1, r2 = m * z[0] / 2, m * z[1] / 2
    ring = mesh == "internal"
    centre = np.array([r2 + r1, 0.0]) if not ring else np.array([-(r2 - r1), 0.0])
    omega2 = speed * z[0] / z[1] * (1 if ring else -1)
    base, pitch_point = r1 * np.cos(alpha), np.array([r1, 0.0])
    line = np.array([np.sin(alpha), np.cos(alpha)])      # of action, through the pitch point
    normal_force = torque / base
    pitch = 2 * np.pi * base / z[0]
    spots = np.arange(-6, 7)[:, None] * pitch + np.linspace(0, pitch, 4001)[None, :-1] + pitch / 8001
    at = pitch_point + spots[..., None] * line
    from_first, from_second = np.linalg.norm(at, axis=-1), np.linalg.norm(at - centre, axis=-1)
    touching = (from_first < r1 + m) & ((from_second > r2 - m) if ring else (from_second < r2 + m))
    touching &= (spots > -r1 * np.sin(alpha)) & (ring | (spots < r2 * np.sin(alpha)))
    arm1, arm2 = at, at - centre
    slip = speed * np.stack([-arm1[..., 1], arm1[..., 0]], -1) - omega2 * np.stack([-arm2[..., 1], arm2[..., 0]], -1)
    assert np.abs((slip @ line)[touching]).max() < 1e-9 * np.abs(speed * r1)
    sliding = np.linalg.norm(slip, axis=-1)
    pairs = touching.sum(axis=0)
    assert pairs.min() >= 1
    return float(np.mean((touching * sliding).sum(axis=0) / pairs) * mu * normal_force)


@pytest.mark.parametrize(("teeth", "mesh"), [((20, 40), "external"), ((17, 103), "external"), ((35, 35), "external"), ((20, 60), "internal"), ((60, 90), "internal")])
@pytest.mark.parametrize("alpha", [20.0, 25.0])
def test_rubbing_teeth(teeth: tuple[int, int], mesh: str, alpha: float) -> None:
    """Against involutes that roll on each other, at 4000 places of a mesh."""
    scene = steady(pair(mesh=mesh), 50.0)
    scene["joint"][2] |= {"teeth": list(teeth), "pressure_angle": f"{alpha} deg"}
    mu, distance = 0.06, 0.3
    module = 2 * distance / (teeth[0] + teeth[1] if mesh == "external" else teeth[1] - teeth[0])
    scene |= {"load": [{"on": "wheel.B", "moment": 40.0}], "friction": [{"joint": "G", "coulomb": mu}]}
    run = linkdyn.Scene(scene).inverse(want="all")
    force = float(np.linalg.norm(run.reaction.sel(joint="G").values[0, :2]))
    expected = rolled_teeth(teeth, module, np.radians(alpha), mesh, tangential(force, alpha) * module * teeth[0] / 2, 50.0, mu)
    np.testing.assert_allclose(run.friction_power.sel(joint="G").values, expected, rtol=2e-4)
    assert np.abs(run.power_imbalance).max() < 1e-13


def tangential(force: float, alpha: float) -> float:
    """Of the whole force of teeth."""
    return force * float(np.cos(np.radians(alpha)))


MESHES = {**{name: PLANAR[name] for name in ("pair", "internal", "planetary", "differential", "rack", "slider-crank", "rack on a slider", "sector", "belt", "crossed belt")},
          **{f"{name} in space": SPATIAL[name] for name in ("pair", "differential", "rack", "bevel", "belt", "crossed belt")}}


RUBBED = [(name, rubs) for name in MESHES for rubs in (False, True) if not (rubs and ("rack" in name or "belt" in name))]    # of racks and belts an efficiency is told


@pytest.mark.parametrize(("name", "rubs"), RUBBED)
def test_every_road(name: str, rubs: bool) -> None:
    """Record, lanes and dense solver, and power."""
    scene = copy.deepcopy(MESHES[name])
    for joint in scene["joint"]:
        if joint["type"] == "gear" and joint["teeth"][0] < 10:
            joint["teeth"] = [20 * n for n in joint["teeth"]]        # only the ratio was meant
    check_roads(with_losses(scene, **({"coulomb": 0.05, "static": 0.09, "stribeck_speed": 0.02} if rubs else {})), reduced=False)


@pytest.mark.parametrize("name", FREE)
def test_forward(name: str) -> None:
    """The forces found lead along the motion."""
    scene = with_losses(FREE[name])
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 1, 21), rtol=1e-10, atol=1e-10, want="all")
    np.testing.assert_allclose(run.q.values, linkdyn.Scene(scene).motion(run.time.values)[0], atol=2e-6)
    assert np.abs(run.power_imbalance).max() < 1e-9


@pytest.mark.parametrize("name", ["belt", "crossed belt"])
def test_belts_every_link(name: str) -> None:
    """In balance on a carrier that moves, in space."""
    scene = linkdyn.Scene(with_losses(SPATIAL[name], efficiency=0.9))
    run = scene.inverse(want="all")
    motion = kinematics.link_motion(scene, run)
    force, moment = inertia_and_weight(scene, motion)
    mesh = next(k for k, joint in enumerate(scene.description["joints"]) if joint["type"] == "belt")
    rubs = run.friction.values[:, mesh]
    for link, point, pull, turn in [*acting(scene, run, motion), *both_links(scene.description["joints"][mesh], scene, motion, rubs[:, :3], rubs[:, 3:])]:
        force[:, link] += pull
        moment[:, link] += turn + np.cross(point - motion.position[:, link], pull)
    size = np.abs(run.reaction.values).max()
    assert np.abs(force[:, 1:]).max() < 1e-8 * size and np.abs(moment[:, 1:]).max() < 1e-8 * size


def test_belt_beside_a_gear() -> None:
    """A crossed belt and a gear that say the same: both lose, and share."""
    scene = pair() | {"redundancy": "minimum-norm"}
    scene["joint"].append({"name": "T", "type": "belt", "between": ["pinion.A", "wheel.B"], "radii": [0.04, 0.08], "run": "crossed"})
    run = linkdyn.Scene(with_losses(scene, efficiency=0.9)).inverse(want="all")
    assert (run.status == 0).all() and np.abs(run.power_imbalance).max() < 1e-12
    assert (run.friction_power.sel(joint=["G", "T"]).values > 0).any(axis=0).all()


def test_planets_that_share() -> None:
    """Three planets share losses as they share forces: the torque is that of one planet."""
    one = steady(planetary()) | {"load": [{"on": "carrier.P", "moment": -84.0}]}
    three = copy.deepcopy(one) | {"redundancy": "minimum-norm"}
    for k in (2, 3):
        at = [0.3 * np.cos(2 * np.pi * (k - 1) / 3), 0.3 * np.sin(2 * np.pi * (k - 1) / 3)]
        three["link"][1]["markers"][f"P{k}"] = at
        three["link"].append({"name": f"planet{k}", "markers": {"P": [0, 0]}, "mass": 0.0, "inertia": 0.0})
        three["joint"] += [hinge(f"P{k}", f"carrier.P{k}", f"planet{k}.P"), gear(f"SP{k}", "sun.O", f"planet{k}.P", [24, 18]),
                           gear(f"PR{k}", f"planet{k}.P", "frame.O", [18, 60], mesh="internal")]
    alone = linkdyn.Scene(with_losses(one, efficiency=0.98)).inverse(want="all")
    shared = linkdyn.Scene(with_losses(three, efficiency=0.98)).inverse(want="all")
    assert (shared.status == 0).all()
    np.testing.assert_allclose(shared.driving_force, alone.driving_force, rtol=1e-11)
    np.testing.assert_allclose(shared.friction_power.sum("joint"), alone.friction_power.sum("joint"), rtol=1e-11)


def test_designs_of_a_sweep() -> None:
    """Efficiencies, coefficients, teeth and places, each in a design of its own."""
    scene = with_losses(planetary()) | {"load": [{"on": "carrier.P", "moment": 8.0}]}
    scene["friction"][1] = {"joint": "PR", "coulomb": 0.06}
    scene["joint"][4]["pressure_angle"] = 0.4
    assert check_all_numbers(scene, Path()) > 10


@pytest.mark.parametrize("name", ["belt", "crossed belt"])
def test_designs_of_belts(name: str) -> None:
    assert check_all_numbers(with_losses(PLANAR[name], efficiency=0.9), Path()) > 10


def test_designs_of_strands() -> None:
    scene = stretching("open", 20.0)
    scene["coordinate"][1] = along("B", {"law": "constant-rate", "start": 0.002, "rate": 8.0})
    assert check_all_numbers(scene, Path()) > 10
