"""Pressure and helix angles of gears: forces that drive wheels apart and along their axes, in balance link by link and by the formulas of
the textbooks (Shigley's Mechanical Engineering Design, 10th edition, chapter 13)."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn._geometry import kinematics
from test_balance_of_links import acting, axis_of, both_links, inertia_and_weight
from test_clutches import times as times_of
from test_designs import check_all_numbers
from test_generate import Compiled

ROOT = Path(__file__).parents[2]
SOLVERS = ["elimination", "lapack", "gauss-jordan"]


def pair(teeth: tuple[int, int], apart: float, mesh: str = "external", **angles: float) -> dict[str, Any]:
    """Two wheels in the frame, axes along z, the second `apart` along x: weightless, the second held by a torque of 100 N m."""

    def wheel(name: str) -> dict[str, Any]:
        return {"name": name, "mass": 0, "markers": {"O": [0, 0, 0]}}

    return {
        "space": "spatial",
        "frame": {"markers": {"A": [0, 0, 0], "B": [apart, 0, 0]}},
        "link": [wheel("one"), wheel("two")],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "one.O"]},
            {"name": "B", "type": "revolute", "between": ["frame.B", "two.O"]},
            {"name": "mesh", "type": "gear", "between": ["one.O", "two.O"], "teeth": list(teeth), "mesh": mesh} | angles,
        ],
        "coordinate": [{"joint": "A"}],
        "actuator": [{"joint": "A"}],
        "load": [{"on": "two.O", "moment": [0, 0, 100.0]}],
    }


def reactions(given: dict[str, Any], q: float = 0.3) -> dict[str, np.ndarray]:
    run = linkdyn.Scene(given).inverse([[q]])
    assert (run.status == 0).all()
    return {str(name): run.reaction[0, k].values for k, name in enumerate(run.joint.values)}


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("helix", [0.0, 30.0, -15.0])
def test_spur_and_helical_wheels(helix: float, side: int) -> None:
    """Wt = T/r, Wr = |Wt| tan(phi_n)/cos(psi), Wa = Wt tan(psi) (Shigley 13-39), directions by hand."""
    given = pair((20, 60), 0.2, pressure_angle=np.radians(20), helix_angle=np.radians(helix))
    given["load"][0]["moment"][2] *= side
    found = reactions(given)
    r2 = 0.15
    tangential = -side * 100 / r2      # on wheel two along theta there, which is -y at the pitch point
    radial = abs(tangential) * np.tan(np.radians(20)) / np.cos(np.radians(helix))
    # right-handed wheel one, so left-handed wheel two: its tooth leans back along z
    axial = tangential * np.tan(np.radians(helix))
    on_two = np.array([radial, -tangential, axial])
    np.testing.assert_allclose(found["mesh"][:3], on_two, atol=1e-10)
    np.testing.assert_allclose(found["B"][:3], -on_two, atol=1e-10)
    np.testing.assert_allclose(found["A"][:3], on_two, atol=1e-10)
    # the hinge takes what the axial force tilts the wheel with, about y: lever along x
    np.testing.assert_allclose(found["B"][3:], [0, -axial * 0.15, 0], atol=1e-10)
    np.testing.assert_allclose(found["A"][3:], [0, -axial * 0.05, 0], atol=1e-10)


@pytest.mark.parametrize("ring", [1, 2])
def test_internal_mesh(ring: int) -> None:
    """The pinion is pushed away from the ring's teeth, towards its own centre."""
    teeth = (60, 20) if ring == 1 else (20, 60)
    found = reactions(pair(teeth, 0.1, "internal", pressure_angle=np.radians(25)))
    # ring at 0 or 0.1 with radius 0.15, pinion 0.05: they touch beyond the pinion
    touches = 1.0 if ring == 1 else -1.0
    radius = 0.15 if ring == 2 else 0.05
    push = 100 / radius * np.tan(np.radians(25))
    on_pinion = np.array([-touches * push, 0, 0])
    pinion, wheel = ("B", "A") if ring == 1 else ("A", "B")
    assert found[pinion][0] == pytest.approx(-on_pinion[0], rel=1e-12)
    assert found[wheel][0] == pytest.approx(on_pinion[0], rel=1e-12)


@pytest.mark.parametrize("ring", [0, 1, 2])
@pytest.mark.parametrize("helix", [20.0, -35.0])
def test_thrust_of_a_helix(ring: int, helix: float) -> None:
    """A wheel screws itself along by its own torque and hand, -T tan(psi)/r for a right-handed one, whatever it meshes with and wherever:
    the normal of a flank with the lead 2 pi r/tan(psi) does no work in a screw motion with that lead."""
    teeth, apart = {0: ((20, 60), 0.2), 1: ((60, 20), 0.1), 2: ((20, 60), 0.1)}[ring]
    found = reactions(pair(teeth, apart, "internal" if ring else "external", helix_angle=np.radians(helix)))
    r2 = {0: 0.15, 1: 0.05, 2: 0.15}[ring]
    hand_of_two = np.radians(helix if ring else -helix)    # a ring and its pinion have the same hand
    thrust_on_two = 100.0 * np.tan(hand_of_two) / r2       # the teeth hold what the load of 100 N m turns
    np.testing.assert_allclose(found["mesh"][2], thrust_on_two, rtol=1e-12)
    np.testing.assert_allclose(found["B"][2], -thrust_on_two, rtol=1e-12)


def bevel_pair(shaft: float, first: int) -> tuple[dict[str, Any], np.ndarray]:
    """15 and 30 teeth whose axes meet at an angle; the pitch point is at 30 mm on x. Either may be the first wheel."""
    small = np.arctan2(np.sin(shaft), 2 + np.cos(shaft))
    along = [np.array([0, 0, 1.0]), np.array([np.sin(shaft), 0, np.cos(shaft)])]
    slant = 0.03 / np.sin(small)
    tip = np.array([0, 0, -slant * np.cos(small)])
    centre = [tip + slant * np.cos(cone) * axis for cone, axis in zip((small, shaft - small), along, strict=True)]
    given = pair((15, 30), 1.0, pressure_angle=np.radians(20))
    given["frame"]["markers"] = {name: {"at": at.tolist(), "axis": axis.tolist()} for name, at, axis in zip("AB", centre, along, strict=True)}
    given["load"][0]["moment"] = (-6.0 * along[1]).tolist()
    if first == 2:
        given["joint"][2] |= {"between": ["two.O", "one.O"], "teeth": [30, 15]}
    return given, slant * np.array([np.sin(small), 0, np.cos(small)])


@pytest.mark.parametrize("first", [1, 2])
@pytest.mark.parametrize("shaft", [60.0, 119.0, 121.0, 150.0, 179.9])
def test_bevel_wheels_with_teeth_inside(shaft: float, first: int) -> None:
    """The smaller wheel is pushed towards its own axis, square to the line from the cones' tip to the pitch point, also where the cone of
    the larger one is beyond a right angle: as the wheels of an internal spur pair are, of which this is nearly one at 179.9 degrees."""
    given, element = bevel_pair(np.radians(shaft), first)
    found = reactions(given)
    inwards = np.cross([0, 1.0, 0], element)               # of the smaller wheel, whose axis is z
    inwards *= np.sign(np.dot(inwards, [-1.0, 0, 0])) / np.linalg.norm(inwards)
    tangential = 6.0 / 0.06
    on_small = found["A"][:3] * -1
    np.testing.assert_allclose(abs(on_small[1]), tangential, rtol=1e-9)    # cones of 0.03 degrees have their tip far off
    np.testing.assert_allclose(on_small[[0, 2]], (tangential * np.tan(np.radians(20)) * inwards)[[0, 2]], rtol=1e-9)


def test_bevel_wheels() -> None:
    """Wr = Wt tan(phi) cos(gamma), Wa = Wt tan(phi) sin(gamma) of either wheel (Shigley 13-38)."""
    given = pair((20, 40), 0.0, pressure_angle=np.radians(20))
    given["frame"]["markers"] = {"A": {"at": [0, 0, 0.1], "axis": [0, 0, 1]}, "B": {"at": [0.05, 0, 0], "axis": [1, 0, 0]}}
    given["link"][0]["markers"] = {"O": {"at": [0, 0, 0], "axis": [0, 0, 1]}}
    given["link"][1]["markers"] = {"O": {"at": [0, 0, 0], "axis": [1, 0, 0]}}
    given["load"][0]["moment"] = [100.0, 0, 0]
    given["load"][0]["axes"] = "world"
    found = reactions(given, 0.0)
    # radii 0.05 about z and 0.1 about x: they touch at (0.05, 0, 0.1)
    gamma = np.arctan(20 / 40)
    tangential = 100 / 0.1
    separating = tangential * np.tan(np.radians(20))
    # towards wheel two: away from the axis of one, by cos(gamma), and along -z, into its own
    push = separating * np.array([np.cos(gamma), 0, -np.sin(gamma)])
    assert abs(found["mesh"][1]) == pytest.approx(tangential, rel=1e-12)
    np.testing.assert_allclose(found["mesh"][[0, 2]], push[[0, 2]], rtol=1e-12)
    np.testing.assert_allclose(found["A"][[0, 2]], push[[0, 2]], rtol=1e-12)
    np.testing.assert_allclose(found["B"][[0, 2]], -push[[0, 2]], rtol=1e-12)


def test_rack() -> None:
    given = pair((1, 1), 0.0)
    given["frame"]["markers"]["B"] = {"at": [0, -0.05, 0], "axis": [1, 0, 0]}
    given["link"][1]["markers"] = {"O": {"at": [0, 0, 0], "axis": [1, 0, 0]}}
    given["joint"][1]["type"] = "prismatic"
    given["joint"][2] = {"name": "mesh", "type": "rack", "between": ["one.O", "two.O"], "pressure_angle": "20 deg"}
    given["load"] = [{"on": "two.O", "force": [400.0, 0, 0]}]
    for force in (400.0, -250.0):
        given["load"][0]["force"][0] = force
        found = reactions(given, 0.7)
        np.testing.assert_allclose(found["mesh"][:3], [-force, -abs(force) * np.tan(np.radians(20)), 0], atol=1e-10)
        np.testing.assert_allclose(found["B"][:3], [0, abs(force) * np.tan(np.radians(20)), 0], atol=1e-10)


# ---------------------------------------------------------------- trains, moving

def leaning(file: str, helix: bool) -> tuple[dict[str, Any], Path]:
    path = ROOT / file
    given = tomllib.loads(path.read_text())
    for k, joint in enumerate(given["joint"]):
        if joint["type"] in ("gear", "rack"):
            joint["pressure_angle"] = 0.35
            if helix and joint["type"] == "gear":
                joint["helix_angle"] = 0.3 * (-1) ** k
    return given, path.parent


TRAINS = [
    ("examples/planetary_crank/scene.toml", False),
    ("tests/scenes/geared_sector.toml", False),
    ("tests/scenes/bevel_differential.toml", False),
    ("tests/scenes/geared_loop.toml", False),
    ("tests/scenes/fivebar_by_gears_3d.toml", True),
    ("tests/scenes/platform_by_gear.toml", False),
    ("tests/scenes/helical_reducer.toml", False),
]


def left_over(scene: linkdyn.Scene, run: Any, good: np.ndarray) -> tuple[np.ndarray, float]:
    """Forces, and moments about their origins, that act on moving links less what their motion asks for; and how far they reach."""
    motion = kinematics.link_motion(scene, run)
    force, moment = inertia_and_weight(scene, motion)
    acts = acting(scene, run, motion)
    if "friction" in run:
        columns = [0, 1, 5] if scene.planar else list(range(6))
        for j, joint in enumerate(scene.description["joints"]):
            wrench = np.zeros((run.time.size, 6))
            wrench[:, columns] = run.friction.values[:, j]
            acts += both_links(joint, scene, motion, wrench[:, :3], wrench[:, 3:])
    for link, point, pull, turn in acts:
        if link > 0:
            force[:, link] += pull
            moment[:, link] += turn + np.cross(point - motion.position[:, link], pull)
    return np.concatenate([force[good, 1:], moment[good, 1:]]), max(1.0, np.abs(motion.position[good]).max())


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(("file", "helix"), TRAINS)
def test_trains_are_in_balance(file: str, helix: bool, solver: str) -> None:
    """Every link, its inertia by another road; driving forces are those of teeth that do not lean."""
    given, folder = leaning(file, helix)
    scene = linkdyn.Scene(given, folder=folder)
    times = scene.times()[:: max(1, len(scene.times()) // 20)]
    run = scene.inverse(t=times, solver=solver)
    upright = [{key: value for key, value in joint.items() if not key.endswith("_angle")} for joint in given["joint"]]
    plain = linkdyn.Scene(given | {"joint": upright}, folder=folder).inverse(t=times, solver=solver)
    good = run.status.values == 0
    assert good.sum() > 10
    scale = np.abs(plain.driving_force.values[good]).max()
    np.testing.assert_allclose(run.driving_force.values[good], plain.driving_force.values[good], rtol=0, atol=1e-9 * scale)
    assert np.abs(run.reaction.values[good] - plain.reaction.values[good]).max() > 1e-3 * np.abs(run.reaction.values[good]).max()
    left, reach = left_over(scene, run, good)
    size = np.abs(run.reaction.values[good]).max()
    if helix:      # a universal joint's drive is about an axis that the sums do not know
        left = left - left_over(linkdyn.Scene(given | {"joint": upright}, folder=folder), plain, good)[0]
    assert np.abs(left).max() <= 1e-8 * size * reach
    assert np.abs(run.power_imbalance.values[good]).max() < 1e-9


def test_records_designs_and_forward_runs_agree() -> None:
    """By record, on lanes, one by one, behind a forward run: one physics. Teeth in a plane press along the line of action."""
    given, folder = leaning("examples/planetary_crank/scene.toml", False)
    scene = linkdyn.Scene(given, folder=folder)
    states = scene.motion()
    whole, lanes = (scene.inverse(*states, solver=solver) for solver in ("elimination", "lapack"))
    assert (whole.status == 0).all()
    size = float(abs(lanes.reaction).max())
    np.testing.assert_allclose(whole.reaction, lanes.reaction, atol=1e-10 * size)
    for k in (0, 7, 50):
        np.testing.assert_allclose(scene.inverse(*(values[k : k + 1] for values in states)).reaction[0], whole.reaction[k], atol=1e-12 * size)
    flat = linkdyn.Scene(given | {"joint": [{k: v for k, v in joint.items() if k != "pressure_angle"} for joint in given["joint"]]}, folder=folder)
    gears = [k for k, joint in enumerate(scene.description["joints"]) if joint["type"] == "gear"]
    along, tangential = (np.linalg.norm(run.reaction.values[:, gears, :2], axis=2) for run in (whole, flat.inverse(*states)))
    np.testing.assert_allclose(along, tangential / np.cos(0.35), rtol=1e-9, atol=1e-9 * size)


def test_designs() -> None:
    """Angles of teeth, and all else that turns a number of such a scene into another, are numbers of kernels that designs share."""
    path = ROOT / "tests/scenes/helical_reducer.toml"
    assert check_all_numbers(tomllib.loads(path.read_text()), path.parent) > 30


def test_forward_run() -> None:
    """Reactions at output instants are those of inverse dynamics at the same states."""
    given = pair((20, 60), 0.2, pressure_angle=0.35, helix_angle=0.3)
    for link in given["link"]:
        link |= {"mass": 1.0, "inertia": {"diagonal": [0.01, 0.01, 0.02]}}
    given["gravity"] = [0, -9.81, 0]
    given["actuator"][0]["law"] = {"type": "formula", "value": "3 N*m*cos(9*time/(1 s))"}
    scene = linkdyn.Scene(given)
    run = scene.forward(t=np.linspace(0, 1, 21))
    again = scene.inverse(run.q, run.qd, run.qdd)
    assert (run.status == 0).all()
    np.testing.assert_allclose(run.reaction, again.reaction, atol=1e-9 * float(abs(again.reaction).max()))


def test_generated_code(tmp_path: Path) -> None:
    """C has it, too."""
    given, folder = leaning("examples/planetary_crank/scene.toml", False)
    scene = linkdyn.Scene(given, folder=folder)
    compiled = Compiled(scene.generate(want=["driving_force", "reaction"], name="kernel"), tmp_path)
    states = scene.motion()
    expected = scene.inverse(*states).reaction.values
    for k in range(0, len(expected), 40):
        status, found = compiled(q=states[0][k], qd=states[1][k], qdd=states[2][k])
        assert status == 0
        np.testing.assert_allclose(found["reaction"], expected[k], rtol=0, atol=1e-10 * np.abs(expected).max())


# ---------------------------------------------------------------- bearings that rub

ALPHA = 0.35
RADIUS = 0.15      # of wheel two


def rubbing(**friction: Any) -> dict[str, Any]:
    """Spur wheels, the hinge of the second rubs."""
    return pair((20, 60), 0.2, pressure_angle=ALPHA) | {"friction": [{"joint": "B"} | friction]}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("arm", [0.02, 0.08, 0.13, 0.1405])
def test_a_pin_by_hand(arm: float, way: int, solver: str) -> None:
    """|F| r2 = 100 N m +- mu r |F|/cos(alpha), which is by rounds where friction is small, by continuation near where it locks, 0.1409 m."""
    scene = linkdyn.Scene(rubbing(coulomb=arm / 0.2, radius=0.2))
    run = scene.inverse([[0.3]], [[way * 2.0]], [[0.0]], solver=solver)
    assert run.status == 0
    along = 100 / (RADIUS - way * arm / np.cos(ALPHA))
    loss = arm / np.cos(ALPHA) * along * 2.0 / 3
    assert np.hypot(*run.reaction.values[0, 2, :2]) == pytest.approx(along / np.cos(ALPHA), rel=1e-10)
    assert run.driving_force.values[0, 0] == pytest.approx(along * 0.05, rel=1e-10)
    assert float(run.friction_power.sum()) == pytest.approx(loss, rel=1e-10)
    assert abs(float(run.power_imbalance[0])) < 1e-9


@pytest.mark.parametrize("way", [1, -1])
def test_a_guide_of_a_rack(way: int) -> None:
    """|F| = 400 N +- mu |F| tan(alpha)."""
    given = pair((1, 1), 0.0)
    given["frame"]["markers"]["B"] = {"at": [0, -0.05, 0], "axis": [1, 0, 0]}
    given["link"][1]["markers"] = {"O": {"at": [0, 0, 0], "axis": [1, 0, 0]}}
    given["joint"][1]["type"] = "prismatic"
    given["joint"][2] = {"name": "mesh", "type": "rack", "between": ["one.O", "two.O"], "pressure_angle": ALPHA}
    given["load"] = [{"on": "two.O", "force": [400.0, 0, 0]}]
    given["friction"] = [{"joint": "B", "coulomb": 0.5}]
    run = linkdyn.Scene(given).inverse([[0.7]], [[way * 2.0]], [[0.0]], error=True)
    assert run.status == 0
    pushes = np.sign(float(run.driving_power[0, 0]))       # the wheel drives the rack, or holds it back
    assert abs(float(run.driving_force[0, 0])) == pytest.approx(0.05 * 400 / (1 - pushes * 0.5 * np.tan(ALPHA)), rel=1e-10)
    assert float(run.driving_force_error[0, 0]) < 1e-10


def test_what_drives_wheels_apart_locks() -> None:
    """Between r2 cos(alpha) and r2: with straight teeth that press along the pitch circles alone the hinge would not hold."""
    given = rubbing(coulomb=0.1415 / 0.2, radius=0.2)
    assert linkdyn.Scene(given).inverse([[0.3]], [[2.0]], [[0.0]]).status == 6
    assert linkdyn.Scene(given).inverse([[0.3]], [[-2.0]], [[0.0]]).status == 0
    del given["joint"][2]["pressure_angle"]
    assert linkdyn.Scene(given).inverse([[0.3]], [[2.0]], [[0.0]]).status == 0


@pytest.mark.parametrize("way", [1, -1])
def test_pins_with_length_and_collars(way: int) -> None:
    """Helical wheels, whose axial force tilts the second on its pin: forces at both ends, one equation in F, by bisection."""
    alpha, psi, mu, r, length, collar = 0.35, 0.3, 0.15, 0.03, 0.12, 0.05
    given = pair((20, 60), 0.2, pressure_angle=alpha, helix_angle=psi)
    given["friction"] = [{"joint": "B", "coulomb": mu, "radius": r, "length": length, "collar": collar}]
    run = linkdyn.Scene(given).inverse([[0.3]], [[way * 2.0]], [[0.0]])
    assert run.status == 0

    def braking(along: float) -> float:
        """Torque of friction, of the reaction's force across, moment about the pin's middle, and force along."""
        across = np.array([along * np.tan(alpha) / np.cos(psi), along])
        axial = along * np.tan(psi)
        tilt = np.array([axial * RADIUS / length, 0])        # moment about y, cross z
        # which end is loaded more hangs on the directions, their sum on both
        ends = np.linalg.norm(across / 2 + tilt) + np.linalg.norm(across / 2 - tilt)
        return mu * (r * ends + collar * axial)

    low, high = 0.0, 1e5
    for _ in range(200):
        middle = (low + high) / 2
        if middle * RADIUS - way * braking(middle) < 100:
            low = middle
        else:
            high = middle
    assert run.driving_force.values[0, 0] == pytest.approx(low * 0.05, rel=1e-10)


CREEP = 1e-6
FRICTION = {
    "revolute": {"coulomb": 0.12, "radius": 0.02, "length": 0.05, "creep_speed": CREEP},
    "prismatic": {"coulomb": 0.1, "creep_speed": CREEP},
}


def train_that_rubs(file: str, helix: bool) -> tuple[dict[str, Any], Path]:
    """All hinges and slides rub."""
    given, folder = leaning(file, helix)
    given["friction"] = [{"joint": joint["name"]} | FRICTION[joint["type"]] for joint in given["joint"] if joint["type"] in FRICTION]
    if given.get("space") == "planar":
        for friction in given["friction"]:
            friction.pop("length", None)
    return given, folder


def check_a_pin(scene: linkdyn.Scene, run: Any, good: np.ndarray, j: int, joint: Any) -> None:
    """Friction of a hinge, from its reaction as told."""
    law = FRICTION["revolute"]
    reaction, felt = run.reaction.values[good, j], run.friction.values[good, j]
    rate = run.joint_rate.values[good, [str(v).split(".")[0] for v in run.variable.values].index(joint["name"])]
    if scene.planar:
        presses, moment = np.linalg.norm(reaction[:, :2], axis=1), felt[:, 2]
    else:
        axis = axis_of(joint, scene, kinematics.link_motion(scene, run))[good]
        moment = np.sum(axis * felt[:, 3:], axis=1)
        across = reaction[:, :3] - axis * np.sum(axis * reaction[:, :3], axis=1, keepdims=True)
        tilt = np.cross(reaction[:, 3:], axis) / law["length"]
        presses = np.linalg.norm(across / 2 + tilt, axis=1) + np.linalg.norm(across / 2 - tilt, axis=1)
    slides = law["radius"] * np.abs(rate) > 100 * CREEP
    wanted = -np.sign(rate) * law["coulomb"] * law["radius"] * presses
    np.testing.assert_allclose(moment[slides], wanted[slides], rtol=1e-9, atol=1e-10 * np.abs(run.reaction.values[good]).max())


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(("file", "helix"), TRAINS)
def test_trains_that_rub_are_in_balance(file: str, helix: bool, solver: str) -> None:
    """Link by link, and friction is what reactions as they are told, with what drives wheels apart, make of it (hinges: two ends)."""
    given, folder = train_that_rubs(file, helix)
    scene = linkdyn.Scene(given, folder=folder)
    times = scene.times()[:: max(1, len(scene.times()) // 20)]
    run = scene.inverse(t=times, solver=solver)
    good = run.status.values == 0
    assert good.sum() > 10
    if not helix:  # a universal joint's drive is about an axis that the sums do not know
        left, reach = left_over(scene, run, good)
        assert np.abs(left).max() <= 1e-8 * np.abs(run.reaction.values[good]).max() * reach
    assert np.abs(run.power_imbalance.values[good]).max() < 1e-9
    for j, joint in enumerate(scene.description["joints"]):
        if joint["type"] == "revolute":
            check_a_pin(scene, run, good, j, joint)
    deaf, _ = train_that_rubs(file, helix)
    for joint in deaf["joint"]:
        joint.pop("pressure_angle", None)
    other = linkdyn.Scene(deaf, folder=folder).inverse(t=times, solver=solver)
    both = good & (other.status.values == 0)
    assert np.abs((run.friction_power - other.friction_power).values[both]).max() > 1e-4 * np.abs(run.friction_power.values[both]).max()


@pytest.mark.parametrize("file", ["examples/planetary_crank/scene.toml", "tests/scenes/bevel_differential.toml"])
def test_records_of_trains_that_rub(file: str) -> None:
    """By record, on lanes, one by one: one physics."""
    given, folder = train_that_rubs(file, False)
    scene = linkdyn.Scene(given, folder=folder)
    states = scene.motion()
    whole, lanes = (scene.inverse(*states, solver=solver) for solver in ("elimination", "lapack"))
    good = (whole.status.values == 0) & (lanes.status.values == 0)
    assert good.mean() > 0.9
    np.testing.assert_array_equal(whole.status, lanes.status)
    size = float(abs(lanes.reaction.values[good]).max())
    np.testing.assert_allclose(whole.reaction.values[good], lanes.reaction.values[good], atol=1e-10 * size)
    for k in np.flatnonzero(good)[[0, 7, 40]]:
        one = scene.inverse(*(values[k : k + 1] for values in states))
        np.testing.assert_allclose(one.reaction.values[0], whole.reaction.values[k], atol=1e-11 * size)


def test_a_forward_run_that_rubs() -> None:
    """Forces of inverse dynamics along a forward run are those that it was driven by."""
    given = rubbing(coulomb=0.3, radius=0.05, length=0.1)
    given["load"] = []
    for link in given["link"]:
        link |= {"mass": 1.0, "inertia": {"diagonal": [0.01, 0.01, 0.02]}}
    given["actuator"][0]["law"] = {"type": "formula", "value": "3 N*m*cos(9*time/(1 s))"}
    scene = linkdyn.Scene(given)
    times = np.linspace(0, 1, 41)
    run = scene.forward(t=times)
    again = scene.inverse(run.q, run.qd, run.qdd)
    assert (run.status == 0).all()
    np.testing.assert_allclose(again.driving_force.values[:, 0], 3 * np.cos(9 * times), atol=1e-9)
    np.testing.assert_allclose(run.reaction, again.reaction, atol=1e-9 * float(abs(again.reaction).max()))


def test_a_hinge_that_sticks_feels_it() -> None:
    """The load turns both back, ever slower as the torque grows; the hinge of wheel two then holds until F r2 - 1 N m = mu r |F|/cos(alpha)."""
    given = rubbing(coulomb=0.3, radius=0.2, sticking=True)
    given["load"] = [{"on": "two.O", "moment": [0, 0, 1.0]}]
    for link in given["link"]:
        link |= {"mass": 1.0, "inertia": {"diagonal": [0.01, 0.01, 0.02]}}
    given["actuator"][0]["law"] = {"type": "formula", "value": "1 N*m/s*time"}
    run = linkdyn.Scene(given).forward(t=np.linspace(0, 2, 201))
    assert (run.status == 0).all()
    t = run.time.values
    turns = {}
    for way in (-1, 1):
        part = 0.05 / (RADIUS - way * 0.06 / np.cos(ALPHA))      # torque on wheel one for one on wheel two
        turns[way] = part, 0.02 * (1 + part / 3)
    # qdd = (t - part)/inertia, from rest
    sticks, loose = 2 * turns[-1][0], turns[1][0]
    assert times_of(run, "B", "stick") == pytest.approx([sticks], rel=1e-8)
    assert times_of(run, "B", "slip") == pytest.approx([loose], rel=1e-9)
    for way, when in ((-1, t < sticks), (1, t > loose)):
        np.testing.assert_allclose(run.qdd.values[when, 0], (t[when] - turns[way][0]) / turns[way][1], rtol=0, atol=1e-6)
    at_rest = (t > sticks) & (t < loose)
    assert np.ptp(run.q.values[at_rest]) == 0
    assert np.abs(run.qd.values[at_rest]).max() < 1e-15


def test_sweeps_and_ensembles_that_rub() -> None:
    """A sweep over the pressure angle by hand, runs of an ensemble as runs of their own."""
    given = rubbing(coulomb=0.4, radius=0.2)
    angles = [0.1, 0.35, 0.5]
    axes = [{"parameter": "joint.mesh.pressure_angle", "values": angles}, {"coordinate": "A", "values": [0.3]}, {"rate": "A", "values": [2.0, -2.0]}]
    swept = linkdyn.Scene(given).sweep({"reduce": ["driving_force"], "axis": axes}, keep="driving_force")
    wanted = [[100 * 0.05 / (RADIUS - way * 0.08 / np.cos(angle)) for way in (1, -1)] for angle in angles]
    np.testing.assert_allclose(np.abs(swept.driving_force.values).reshape(3, 2), wanted, rtol=1e-10)
    for link in given["link"]:
        link |= {"mass": 1.0, "inertia": {"diagonal": [0.01, 0.01, 0.02]}}
    given["load"] = [{"on": "two.O", "moment": [0, 0, 1.0]}]
    given["actuator"][0]["law"] = {"type": "formula", "value": "3 N*m*cos(9*time/(1 s))"}
    scene = linkdyn.Scene(given)
    times = np.linspace(0, 0.5, 6)
    one = scene.forward(t=times, method="rk4", step=1e-3)
    many = scene.ensemble([[0.0], [0.5]], [[0.0], [1.0]], times, step=1e-3)
    assert (many.status == 0).all()
    np.testing.assert_allclose(many.q.values[0], one.q.values, atol=1e-12)
    assert np.abs(one.q.values).max() > 0.1


def test_designs_that_rub() -> None:
    """Designs of a sweep, their kernels shared, are scenes of their own."""
    given, folder = train_that_rubs("tests/scenes/helical_reducer.toml", False)
    assert check_all_numbers(given, folder) > 30


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pressure_angle": "50 deg"}, "key 'pressure_angle' is 50 deg"),
        ({"pressure_angle": "-1 deg"}, "key 'pressure_angle' is -1 deg"),
        ({"helix_angle": "70 deg"}, "key 'helix_angle' is 70 deg"),
        ({"type": "belt", "teeth": None, "mesh": None, "radii": [0.05, 0.1], "pressure_angle": 0.3}, "has no meaning here"),
    ],
)
def test_refused(change: dict[str, Any], message: str) -> None:
    given = pair((20, 60), 0.2)
    given["joint"][2] = {key: value for key, value in (given["joint"][2] | change).items() if value is not None}
    with pytest.raises(linkdyn.SceneError, match=message):
        linkdyn.Scene(given)


def test_what_is_not_found_is_refused() -> None:
    given = pair((20, 60), 0.2, pressure_angle=0.3)
    shared = copy.deepcopy(given)
    shared["frame"]["markers"]["C"] = [0.2, 0, 0.1]
    shared["link"][1]["markers"]["C"] = [0, 0, 0.1]
    shared["joint"].append({"name": "C", "type": "cylindrical", "between": ["frame.C", "two.C"]})
    with pytest.raises(linkdyn.SceneError, match="gear 'mesh': pressure_angle where reactions are shared"):
        linkdyn.Scene(shared)
    flat = tomllib.loads((ROOT / "examples/planetary_crank/scene.toml").read_text())
    next(joint for joint in flat["joint"] if joint["type"] == "gear")["helix_angle"] = 0.2
    with pytest.raises(linkdyn.SceneError, match="pushes wheels along their axes"):
        linkdyn.Scene(flat, folder=ROOT / "examples/planetary_crank")


@pytest.mark.parametrize("rubs", [False, True])
def test_causes_of_leaning_teeth(rubs: bool) -> None:
    """|F| is no sum: what causes leave open of the reactions is not put down to friction. The driving forces are."""
    given = pair((20, 60), 0.2, pressure_angle=ALPHA)
    given["load"] = [{"on": "two.O", "moment": [0, 0, moment]} for moment in (100.0, -40.0)]
    if rubs:
        given["friction"] = [{"joint": "B", "coulomb": 0.1, "radius": 0.01}]
    run = linkdyn.Scene(given).inverse(q=[[0.3]], qd=[[2.0]])
    with pytest.raises(linkdyn.InputError, match="teeth of 'mesh' lean"):
        run.linkdyn.contributions()
    if not rubs:
        parts = run.drop_vars("reaction").linkdyn.contributions(scene=linkdyn.Scene(given))
        np.testing.assert_allclose(parts.driving_force.sum("cause").values, run.driving_force.values, atol=1e-9 * float(abs(run.driving_force).max()))
