"""Gears that share a load: planets, lay shafts, belts beside gears. By Willis, by springs between rigid wheels, by Newton and Euler."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from numpy.typing import NDArray
from test_gears import STEADY, SWAY, bevel, disc, five_bar as geared_five_bar, gear, hinge, planar, tilted
from test_joint_kinds import along, check_balance, check_roads, keeps_energy, let_go

pytestmark = pytest.mark.accuracy

Array = NDArray[np.float64]
ARM, SUN, PLANET, RING = 0.3, 24, 18, 60     # distance of the axes [m], teeth


def planets(n: int, ring_moves: bool = False, offset: float = 0.1) -> dict[str, Any]:
    """Sun, arm, n planets; the ring stands or moves. The planets' weight is not small."""
    angle = offset + 2 * np.pi * np.arange(n) / n
    pins = {f"P{k + 1}": [ARM * np.cos(a), ARM * np.sin(a)] for k, a in enumerate(angle)}
    ring = "ring.O" if ring_moves else "frame.O"
    scene = planar(
        frame={"markers": {"O": [0, 0]}},
        link=[disc("sun", {"O": [0, 0]}, cog=(0.01, 0.0)), disc("arm", {"O": [0, 0], **pins}, 4.0, 0.1, (0.05, 0.02)),
              *[disc(f"planet{k}", {"P": [0, 0]}, 5.0, 0.01) for k in range(1, n + 1)]],
        joint=[hinge("S", "frame.O", "sun.O"), hinge("C", "frame.O", "arm.O"), *[hinge(f"P{k}", f"arm.P{k}", f"planet{k}.P") for k in range(1, n + 1)],
               *[gear(f"SP{k}", "sun.O", f"planet{k}.P", [SUN, PLANET]) for k in range(1, n + 1)],
               *[gear(f"PR{k}", f"planet{k}.P", ring, [PLANET, RING], mesh="internal") for k in range(1, n + 1)]],
        load=[{"on": "arm.O", "moment": -50.0}],
        coordinate=[along("S", SWAY)], actuator=[{"joint": "S"}])
    if ring_moves:
        scene["link"].append(disc("ring", {"O": [0, 0]}, 6.0, 0.8, (0.01, 0.03)))
        scene["joint"].append(hinge("R", "frame.O", "ring.O"))
        scene["coordinate"].append(along("R", {"law": "harmonic", "amplitude": 1.0, "frequency": "2 rad/s"}))
        scene["actuator"].append({"joint": "R"})
    return scene


def bevel_with_two() -> dict[str, Any]:
    scene = bevel()
    cage, planet = (next(link for link in scene["link"] if link["name"] == name) for name in ("cage", "planet"))
    cage["markers"]["Q"] = {"at": [-0.08, 0, 0], "axis": [-1, 0, 0]}
    scene["link"].append(copy.deepcopy(planet) | {"name": "other", "markers": {"Q": {"at": [0, 0, 0], "axis": [-1, 0, 0]}}})
    scene["joint"] += [hinge("Q", "cage.Q", "other.Q"), gear("LQ", "left.L", "other.Q", [2, 1]), gear("RQ", "right.R", "other.Q", [2, 1])]
    return scene


def two_shafts(*ties: dict[str, Any]) -> dict[str, Any]:
    """Two shafts and what is between them."""
    return planar(
        frame={"markers": {"A": [0, 0], "B": [0.3, 0]}}, link=[disc("a", {"A": [0, 0]}), disc("b", {"B": [0, 0]}, 5.0, 0.3, (0.05, 0.1))],
        joint=[hinge("A", "frame.A", "a.A"), hinge("B", "frame.B", "b.B"), *ties], coordinate=[along("A", SWAY)], actuator=[{"joint": "A"}])


def belt_of(radii: list[float], name: str = "T", **more: Any) -> dict[str, Any]:
    return {"name": name, "type": "belt", "between": ["a.A", "b.B"], "radii": radii, **more}


def lay_shafts(last: float = 43) -> dict[str, Any]:
    """From a shaft by two lay shafts to another on the same axis."""
    return planar(
        frame={"markers": {"O": [0, 0], "L": [0.2, 0], "M": [-0.2, 0.0]}},
        link=[disc("input", {"O": [0, 0]}), disc("output", {"O": [0, 0]}, 3, 0.1, (0.02, 0)), disc("lay1", {"L": [0, 0]}), disc("lay2", {"M": [0, 0]})],
        joint=[hinge("I", "frame.O", "input.O"), hinge("O", "frame.O", "output.O"), hinge("L", "frame.L", "lay1.L"), hinge("M", "frame.M", "lay2.M"),
               gear("G1", "input.O", "lay1.L", [20, 30]), gear("G2", "lay1.L", "output.O", [17, 43]), gear("G3", "input.O", "lay2.M", [20, 30]),
               gear("G4", "lay2.M", "output.O", [17, last])],
        load=[{"on": "output.O", "moment": 12.0}], coordinate=[along("I", SWAY)], actuator=[{"joint": "I"}])


def rack_between(tie: bool) -> dict[str, Any]:
    """A rack that two pinions hold, with a belt between both or without."""
    scene = planar(
        frame={"markers": {"A": [-0.1, 0.08], "B": [0.3, 0.08], "R": {"at": [0, 0], "axis": [1, 0]}}},
        link=[disc("p", {"A": [0, 0]}, cog=(0.02, 0)), disc("q", {"B": [0, 0]}, cog=(0.0, 0.02)), disc("rack", {"R": {"at": [0, 0], "axis": [1, 0]}}, 3.0, 0.0)],
        joint=[hinge("A", "frame.A", "p.A"), hinge("B", "frame.B", "q.B"), {"name": "R", "type": "prismatic", "between": ["frame.R", "rack.R"]},
               {"name": "G", "type": "rack", "between": ["p.A", "rack.R"]}, {"name": "H", "type": "rack", "between": ["q.B", "rack.R"]}],
        coordinate=[along("A", SWAY)], actuator=[{"joint": "A"}])
    if tie:
        scene["joint"].append({"name": "T", "type": "belt", "between": ["p.A", "q.B"], "radii": [0.05, 0.05]})
    return scene


def parallelogram(led_by: str = "A", start: float = 1.2, **belt: Any) -> dict[str, Any]:
    """Both cranks are coupled by a rod and by a belt; it passes the positions in which the rod alone leaves open how it goes on."""
    return planar(
        frame={"markers": {"A": [0, 0], "D": [0.4, 0]}},
        link=[disc("crank1", {"A": [0, 0], "B": [0.1, 0]}, 1.0, 0.004, (0.05, 0)), disc("rod", {"B": [0, 0], "C": [0.4, 0]}, 1.5, 0.02, (0.2, 0)),
              disc("crank2", {"D": [0, 0], "C": [0.1, 0]}, 1.0, 0.004, (0.05, 0))],
        joint=[hinge("A", "frame.A", "crank1.A"), hinge("B", "crank1.B", "rod.B"), hinge("C", "rod.C", "crank2.C"), hinge("D", "frame.D", "crank2.D", start=start),
               {"name": "T", "type": "belt", "between": ["crank1.A", "crank2.D"], "radii": [0.05, 0.05], **belt}],
        load=[{"on": "rod.C", "force": [10, -50]}],
        coordinate=[along(led_by, STEADY if led_by == "A" else {"law": "harmonic", "mean": -1.2, "amplitude": 0.4, "frequency": "3 rad/s"})], actuator=[{"joint": "A"}])


def press() -> dict[str, Any]:
    """Two cranks geared to each other push a ram that is guided besides."""
    return planar(
        frame={"markers": {"A": [-0.1, 0], "E": [0.1, 0], "S": {"at": [0, 0], "axis": [0, 1]}}},
        link=[disc("crank1", {"A": [0, 0], "B": [-0.05, 0]}, 1, 0.004), disc("crank2", {"E": [0, 0], "D": [0.05, 0]}, 1, 0.004),
              disc("rod1", {"B": [0, 0], "F": [0.3, 0]}, 1, 0.01, (0.15, 0)), disc("rod2", {"D": [0, 0], "G": [0.3, 0]}, 1, 0.01, (0.15, 0)),
              disc("ram", {"F": [-0.1, 0], "G": [0.1, 0], "S": {"at": [0, 0], "axis": [0, 1]}}, 5, 0.1)],
        joint=[hinge("A", "frame.A", "crank1.A"), hinge("E", "frame.E", "crank2.E"), hinge("B", "crank1.B", "rod1.B"), hinge("D", "crank2.D", "rod2.D"),
               hinge("F", "rod1.F", "ram.F"), hinge("G", "rod2.G", "ram.G"), gear("Z", "crank1.A", "crank2.E", [30, 30]),
               {"name": "S", "type": "prismatic", "between": ["frame.S", "ram.S"]}],
        load=[{"on": "ram.S", "force": [0, -100]}], coordinate=[along("A", STEADY)], actuator=[{"joint": "A"}])


def power_split() -> dict[str, Any]:
    """A planetary gear whose sun and ring one shaft drives."""
    scene = planets(2, ring_moves=True)
    scene["frame"]["markers"]["X"] = [0.5, 0]
    scene["link"].append(disc("side", {"X": [0, 0]}))
    scene["joint"] += [hinge("X", "frame.X", "side.X"), gear("XS", "side.X", "sun.O", [30, 20]), gear("XR", "side.X", "ring.O", [25, 70])]
    return scene | {"coordinate": [along("X", SWAY)], "actuator": [{"joint": "X"}]}


def wolfrom() -> dict[str, Any]:
    """Three stepped planets between a ring that stands and one that turns slowly."""
    scene = planets(3)
    scene["link"].append(disc("output", {"O": [0, 0]}, 5, 0.5, (0.01, 0)))
    scene["joint"] += [hinge("R2", "frame.O", "output.O"), *[gear(f"Q{k}", f"planet{k}.P", "output.O", [17, 59], mesh="internal") for k in (1, 2, 3)]]
    return scene | {"load": [{"on": "output.O", "moment": -30.0}]}


def ring_of(n: int) -> dict[str, Any]:
    """Equal wheels, each in mesh with its two neighbours: an even number turns."""
    angle = 2 * np.pi * np.arange(n) / n
    places = {f"A{k}": [0.2 / np.sin(np.pi / n) * float(f(a)) for f in (np.cos, np.sin)] for k, a in enumerate(angle)}
    return planar(
        frame={"markers": places}, link=[disc(f"w{k}", {"A": [0, 0]}, cog=(0.01 * k, 0)) for k in range(n)],
        joint=[*[hinge(f"A{k}", f"frame.A{k}", f"w{k}.A") for k in range(n)], *[gear(f"G{k}", f"w{k}.A", f"w{(k + 1) % n}.A", [20, 20]) for k in range(n)]],
        coordinate=[along("A0", SWAY)], actuator=[{"joint": "A0"}])


def nested() -> dict[str, Any]:
    """The arm turns on the sun's shaft and the ring on the arm; the sun's wheel is welded to the shaft."""
    scene = planets(3, ring_moves=True)
    between = {"C": ["shaft.O", "arm.O"], "R": ["arm.O", "ring.O"], "S": ["frame.O", "shaft.O"]}
    for joint in scene["joint"]:
        joint["between"] = between.get(joint["name"], joint["between"])
    scene["link"].append(disc("shaft", {"O": [0, 0]}))
    scene["joint"].append({"name": "W", "type": "fixed", "between": ["shaft.O", "sun.O"]})
    return scene | {"coordinate": [along("S", SWAY), along("C", STEADY)], "actuator": [{"joint": "S"}, {"joint": "C"}]}


PLANAR = {"Wolfrom": wolfrom(), "ring of four": ring_of(4), "nested hinges": nested(), "two planets": planets(2), "three": planets(3), "four, differential": planets(4, ring_moves=True), "two gears": two_shafts(gear("G", "a.A", "b.B", [20, 40]), gear("H", "a.A", "b.B", [30, 60])),
          "gear and belt": two_shafts(gear("G", "a.A", "b.B", [40, 20], mesh="internal"), belt_of([0.1, 0.05])), "two belts": two_shafts(belt_of([0.1, 0.1]), belt_of([0.05, 0.05], "U")),
          "lay shafts": lay_shafts(), "rack": rack_between(tie=True), "parallelogram": parallelogram(), "led by the rod": parallelogram("B"), "press": press(), "power split": power_split()}
SPATIAL = {"Wolfrom": tilted(wolfrom()), "two planets": tilted(planets(2, ring_moves=True)), "three": tilted(planets(3)), "bevel": bevel_with_two(), "lay shafts": tilted(lay_shafts()), "rack": tilted(rack_between(tie=True))}


# ---------------------------------------------------------------- roads

@pytest.mark.parametrize("scene", [*PLANAR.values(), *SPATIAL.values()], ids=[*PLANAR, *(f"{name} in space" for name in SPATIAL)])
def test_every_road(scene: dict[str, Any]) -> None:
    mechanism = check_roads(scene)
    assert mechanism.inverse().attrs["shared_reactions"]


@pytest.mark.parametrize("name", SPATIAL)
def test_by_newton_and_euler(name: str) -> None:
    check_balance(SPATIAL[name], 0.31)
    check_balance(SPATIAL[name], 1.37)


@pytest.mark.parametrize("scene", [planets(3), parallelogram(), SPATIAL["bevel"], SPATIAL["three"]], ids=["three", "parallelogram", "bevel", "three in space"])
def test_forward(scene: dict[str, Any]) -> None:
    free = copy.deepcopy(scene)
    free.pop("load", None)
    run = linkdyn.Scene(free).forward(t=np.linspace(0, 1, 21), rtol=1e-11, atol=1e-11, want="all")
    np.testing.assert_allclose(run.q.values, linkdyn.Scene(free).motion(run.time.values)[0], atol=1e-7)
    inverse = linkdyn.Scene(free).inverse(*linkdyn.Scene(free).motion(run.time.values))
    np.testing.assert_allclose(run.reaction.values, inverse.reaction.values, atol=1e-6 * np.abs(inverse.reaction.values).max())
    keeps_energy(let_go(free))


@pytest.mark.parametrize("ring_moves", [False, True])
def test_as_many_planets_as_one_with_their_mass(ring_moves: bool) -> None:
    """Speeds, torques and what the planets' pins and the arm's hinge do together are those of a single planet, which in turn has a closed form of its own."""
    many = planets(3, ring_moves)
    one = planets(1, ring_moves)
    many["gravity"] = one["gravity"] = [0, 0]
    one["link"][2] |= {"inertia": 0.03, "mass": 15.0}
    first, second = linkdyn.Scene(many).inverse(want="all"), linkdyn.Scene(one).inverse(want="all")
    np.testing.assert_allclose(first.driving_force.values, second.driving_force.values, rtol=1e-11)
    for name in ("P1", "P2", "P3"):
        np.testing.assert_allclose(first.joint_rate.sel(variable=f"{name}.angle").values, second.joint_rate.sel(variable="P1.angle").values, rtol=1e-12, atol=1e-12)


# ---------------------------------------------------------------- by hand

@pytest.mark.parametrize("n", [2, 3, 4])
def test_planets_share_equally(n: int) -> None:
    """Steady: torques of sun, ring and arm as 24 : 60 : -84, each planet a part of it, though the planets have weights."""
    scene = planets(n)
    for link in scene["link"]:
        link["cog"] = [0.0, 0.0]
    scene["coordinate"][0]["motion"] = {"law": "constant-rate", "rate": 3.5}
    scene["load"] = [{"on": "arm.O", "moment": -84.0}]
    run = linkdyn.Scene(scene).inverse(want="all")
    np.testing.assert_allclose(run.joint_rate.sel(variable="C.angle"), 1.0, rtol=1e-13)
    np.testing.assert_allclose(run.driving_force.values, 24.0, rtol=1e-11)
    tooth = 24.0 / (ARM * SUN / (SUN + PLANET)) / n
    for k in range(1, n + 1):
        for mesh in ("SP", "PR"):
            force = np.linalg.norm(run.reaction.sel(joint=f"{mesh}{k}").values[:, :2], axis=1)
            np.testing.assert_allclose(force, tooth, rtol=1e-11)
        np.testing.assert_allclose(run.reaction.sel(joint=f"PR{k}").values[:, 2], -60.0 / n, rtol=1e-11)
    shared = run.attrs["shared_reactions"].split()
    assert {"SP1.force", "PR1.force", "P1.force"} <= set(shared) and "R.moment" not in shared


def test_a_welded_ring_takes_a_torque_that_is_determined() -> None:
    scene = planets(3, ring_moves=True)
    scene["joint"][-1] = {"name": "R", "type": "fixed", "between": ["frame.O", "ring.O"]}
    scene["coordinate"].pop()
    scene["actuator"].pop()
    run = linkdyn.Scene(scene).inverse(want="all")
    shared = run.attrs["shared_reactions"].split()
    assert "R.force" in shared and "R.moment" not in shared
    alone = linkdyn.Scene(planets(3)).inverse()
    np.testing.assert_allclose(run.driving_force.values, alone.driving_force.values, rtol=1e-11)
    # balance of moments of everything about the centre: weights, the load, and what all of it gains
    teeth = sum(alone.reaction.sel(joint=f"PR{k}").values[:, 2] for k in (1, 2, 3))
    weight = -6.0 * 9.81 * 0.01
    np.testing.assert_allclose(run.reaction.sel(joint="R").values[:, 2], -teeth - weight, rtol=1e-10, atol=1e-10)


def by_springs(scene: dict[str, Any], q: float, stiffness: dict[str, float]) -> dict[str, Array]:
    """Forces between rigid wheels on springs, the motor's shaft held: K u = f with the displacements of all links, at rest. Pins are springs in both
    directions, teeth springs along the tangent; what is here called a planet's place is found without the engine."""
    arm_angle = q * SUN / (SUN + RING)
    n = sum(joint["name"].startswith("SP") for joint in scene["joint"])
    names = [link["name"] for link in scene["link"]]
    place = {"sun": np.zeros(2), "arm": np.zeros(2)}
    for k in range(1, n + 1):
        x, y = scene["link"][1]["markers"][f"P{k}"]
        place[f"planet{k}"] = np.array([x * np.cos(arm_angle) - y * np.sin(arm_angle), x * np.sin(arm_angle) + y * np.cos(arm_angle)])
    rows: list[tuple[str, Array, float]] = []

    def add(joint: str, first: str, second: str, point: Array, direction: Array, k: float) -> None:
        row = np.zeros(3 * len(names))
        for link, sign in ((first, -1.0), (second, 1.0)):
            if link == "frame":
                continue
            i = 3 * names.index(link)
            arm = point - place[link]
            row[i:i + 3] = sign * np.array([*direction, arm[0] * direction[1] - arm[1] * direction[0]])
        rows.append((joint, row, k))

    for joint in scene["joint"]:
        first, second = (end.split(".")[0] for end in joint["between"])
        if joint["type"] == "revolute":
            for direction in np.eye(2):
                add(joint["name"], first, second, place[second], direction, stiffness[joint["name"]])
            continue
        wheel = first if first.startswith("planet") else second
        radius = ARM * SUN / (SUN + PLANET) if joint["name"].startswith("SP") else ARM * RING / (RING - PLANET)
        unit = place[wheel] / np.linalg.norm(place[wheel])
        add(joint["name"], first, second, radius * unit, np.array([-unit[1], unit[0]]), stiffness[joint["name"]])
    force = np.zeros(3 * len(names))
    for i, link in enumerate(scene["link"]):
        turn = {"sun": q, "arm": arm_angle}.get(link["name"], 0.0)
        x, y = link["cog"]
        force[3 * i:3 * i + 3] = link["mass"] * -9.81 * np.array([0.0, 1.0, x * np.cos(turn) - y * np.sin(turn)])
    force[3 * names.index("arm") + 2] += scene["load"][0]["moment"]
    free = [i for i in range(len(force)) if i != 3 * names.index("sun") + 2]
    matrix = sum(k * np.outer(row, row) for _, row, k in rows)
    assert isinstance(matrix, np.ndarray)
    moved = np.zeros(len(force))
    moved[free] = np.linalg.solve(matrix[np.ix_(free, free)], force[free])
    found: dict[str, Array] = {}
    for joint_name in {name for name, _, _ in rows}:
        found[joint_name] = np.array([-k * row @ moved for name, row, k in rows if name == joint_name])
    return found


def test_stiffness_of_teeth_and_pins() -> None:
    """The stiffer mesh takes more, as springs between rigid wheels say."""
    scene = planets(3)
    stiffness = {joint["name"]: 1e8 * (1 + 0.4 * i) for i, joint in enumerate(scene["joint"])}
    scene["redundancy"] = "stiffness"
    for joint in scene["joint"]:
        joint["stiffness"] = {"tangential" if joint["type"] == "gear" else "radial": stiffness[joint["name"]]}
    q = 0.7
    run = linkdyn.Scene(scene).inverse(q=[[q]], qd=[[0.0]], qdd=[[0.0]])
    expected = by_springs(scene, q, stiffness)
    largest = max(np.abs(force).max() for force in expected.values())
    parts = []
    for joint in scene["joint"]:
        force = run.reaction.sel(joint=joint["name"]).values[0, :2]
        if joint["type"] == "revolute":
            np.testing.assert_allclose(force, expected[joint["name"]], atol=1e-9 * largest)
        else:
            np.testing.assert_allclose(np.linalg.norm(force), np.abs(expected[joint["name"]][0]), atol=1e-9 * largest)
            parts.append(np.linalg.norm(force))
    assert max(parts) > 1.2 * min(parts)


def test_belt_beside_a_gear_by_stiffness() -> None:
    """Two springs between the same shafts share a torque as their stiffness times the square of their radius."""
    scene = two_shafts(gear("G", "a.A", "b.B", [40, 20], mesh="internal", stiffness={"tangential": "3e8 N/m"}), belt_of([0.1, 0.05], stiffness={"tangential": "1e8 N/m"}))
    scene |= {"redundancy": "stiffness", "gravity": [0, 0], "load": [{"on": "b.B", "moment": 10.0}]}
    run = linkdyn.Scene(scene).inverse(q=[[0.0]], qd=[[0.0]], qdd=[[0.0]])
    moments = [-run.reaction.sel(joint=name).values[0, 2] for name in "GT"]
    weight = [3e8 * 0.3**2, 1e8 * 0.05**2]              # pitch radii of the second wheels
    np.testing.assert_allclose(moments, 10.0 * np.array(weight) / sum(weight), rtol=1e-10)
    np.testing.assert_allclose(run.driving_force.values, -20.0, rtol=1e-12)


# ---------------------------------------------------------------- loops that close by gears

def five_bar(teeth: list[int] | None = None) -> dict[str, Any]:
    scene = geared_five_bar()
    scene["joint"][5]["teeth"] = teeth or [30, 30]
    return scene


def led_by(scene: dict[str, Any], joint: str, **motion: Any) -> dict[str, Any]:
    """The same mechanism, led by another joint; where there was a branch now iteration closes."""
    other = copy.deepcopy(scene)
    for one in other["joint"]:
        one.pop("branch", None)
    return other | {"coordinate": [along(joint, {"law": "harmonic", "frequency": "3 rad/s", **motion})]}


def cardan() -> dict[str, Any]:
    """A wheel rolls in a ring of twice its size, and its rim goes along a line, on which it is guided besides."""
    return planar(
        frame={"markers": {"O": [0, 0], "S": {"at": [0, 0], "axis": [1, 0]}}},
        link=[disc("arm", {"O": [0, 0], "P": [0.1, 0]}, 1, 0.01), disc("planet", {"P": [0, 0], "Q": [0.1, 0]}, 1, 0.005), disc("slider", {"S": {"at": [0, 0], "axis": [1, 0]}, "Q": [0, 0]}, 2, 0.0)],
        joint=[hinge("O", "frame.O", "arm.O", start=1.0), hinge("P", "arm.P", "planet.P", start=-2.0), gear("G", "planet.P", "frame.O", [20, 40], mesh="internal"),
               hinge("Q", "planet.Q", "slider.Q"), {"name": "S", "type": "prismatic", "between": ["frame.S", "slider.S"]}],
        load=[{"on": "slider.S", "force": [-30, 0]}], coordinate=[along("O", STEADY)], actuator=[{"joint": "O"}])


def coupler_wheel() -> dict[str, Any]:
    """A wheel fixed to the coupler of a four-bar turns another one about the crank's hinge."""
    return planar(
        frame={"markers": {"A": [0, 0], "D": [0.3, 0]}},
        link=[disc("crank", {"A": [0, 0], "B": [0.08, 0]}, 2, 0.01), disc("rod", {"B": [0, 0], "C": [0.28, 0]}, 1, 0.01, (0.15, 0)), disc("rocker", {"D": [0, 0], "C": [0.2, 0]}, 3, 0.02),
              disc("sun", {"A": [0, 0]}, 1, 0.01)],
        joint=[hinge("A", "frame.A", "crank.A"), hinge("B", "crank.B", "rod.B"), hinge("C", "rod.C", "rocker.C", branch=1), hinge("D", "frame.D", "rocker.D"), hinge("S", "frame.A", "sun.A"),
               gear("G", "rod.B", "sun.A", [20, 20])],
        load=[{"on": "sun.A", "moment": 2.0}], coordinate=[along("A", STEADY)], actuator=[{"joint": "A"}])


def spatial_five_bar() -> dict[str, Any]:
    """Both cranks of a spatial five-bar geared; three freedoms, two of them those of the joint between crank and rod."""
    scene = tilted(five_bar())
    joints, links = {joint["name"]: joint for joint in scene["joint"]}, {link["name"]: link for link in scene["link"]}
    for name, kind in (("B", "universal"), ("C", "spherical"), ("D", "universal")):
        joints[name]["type"] = kind
    joints["C"].pop("branch")
    for link, name in (("crank1", "B"), ("crank2", "D")):
        links[link]["markers"][name]["axis"] = [0, 0, 1]
    for link, name in (("rod1", "B"), ("rod2", "D")):
        links[link]["markers"][name]["axis"] = [0, 1, 0]
    angles = [{"joint": "B", "variable": f"angle{k}", "motion": {"law": "harmonic", "mean": mean, "amplitude": 0.15, "frequency": f"{4 - k} rad/s"}} for k, mean in ((1, -1.0), (2, 0.1))]
    return scene | {"coordinate": [scene["coordinate"][0], *angles], "actuator": [{"joint": "tilt"}, {"joint": "A"}, {"joint": "B", "variable": "angle2"}]}


CLOSED_BY_GEARS = {"five-bar": led_by(five_bar(), "B", mean=-1.0, amplitude=0.2), "five-bar, 2:3": led_by(five_bar([30, 45]), "B", mean=-1.0, amplitude=0.2),
                   "cardan": led_by(cardan(), "S", mean=0.1, amplitude=0.05), "coupler wheel": led_by(coupler_wheel(), "S", mean=-1.0, amplitude=1.0), "five-bar in space": spatial_five_bar()}


@pytest.mark.parametrize("name", CLOSED_BY_GEARS)
def test_loops_closed_by_gears(name: str) -> None:
    scene = CLOSED_BY_GEARS[name]
    mechanism = check_roads(scene)
    assert "Newton" in mechanism.explain()
    free = copy.deepcopy(scene)
    free.pop("load", None)
    run = linkdyn.Scene(free).forward(t=np.linspace(0, 0.5, 6), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(run.q.values, linkdyn.Scene(free).motion(run.time.values)[0], atol=1e-7)


def test_half_a_turn_from_the_start() -> None:
    """Where a wheel's angle decides by a part of its turns, no sample beyond half a turn counts: a batch by record says of each what the lanes say, in order and each alone."""
    data = tomllib.loads((Path(__file__).resolve().parents[1] / "scenes" / "fivebar_by_gears.toml").read_text())
    mechanism = linkdyn.Scene(data)
    q = np.random.default_rng(1).uniform(-7.2, 2.2, (300, 1))
    alone = [mechanism.inverse(q=q, qd=q, qdd=q, solver=solver) for solver in ("elimination", "lapack")]
    data["coordinate"] = [along("B", {"law": "cycloidal", "from": -1.0, "to": -7.2, "duration": 1})]
    data["time"] = {"end": 1, "samples": 401}
    in_order = [linkdyn.Scene(data).inverse(solver=solver) for solver in ("elimination", "lapack")]
    for record, lanes in (alone, in_order):
        np.testing.assert_array_equal(record.status.values, lanes.status.values)
        good = record.status.values == 0
        assert set(record.status.values) == {0, 5} and 0.5 < good.mean()
        np.testing.assert_allclose(record.reaction.values[good], lanes.reaction.values[good], atol=1e-11 * np.abs(lanes.reaction.values[good]).max())


@pytest.mark.parametrize("name, wheel", [("five-bar", "A"), ("cardan", "O"), ("coupler wheel", "A")])
def test_led_by_a_wheel_it_is_the_same(name: str, wheel: str) -> None:
    """The motion that comes out for a wheel, given to the mechanism led by it, in closed form: the same reactions, and by power the same drive."""
    led = linkdyn.Scene(CLOSED_BY_GEARS[name]).inverse(want="all")
    variable = list(led["variable"].values).index(f"{wheel}.angle")
    t, h = led.time.values, led.time.values[1] - led.time.values[0]
    angle = np.unwrap(led.joint_variable.values[:, variable])
    rate = led.joint_rate.values[:, variable]
    inner = slice(3, -3)
    second = sum(w * np.roll(rate, -k) for k, w in ((1, 45), (2, -9), (3, 1), (-1, -45), (-2, 9), (-3, -1)))[inner] / (60 * h)
    direct = {"five-bar": five_bar(), "cardan": cardan(), "coupler wheel": coupler_wheel()}[name]
    direct["coordinate"] = [along(wheel, {"law": "constant-rate", "rate": 0.0, "start": float(angle[0])})]
    direct["actuator"] = copy.deepcopy(CLOSED_BY_GEARS[name]["actuator"])
    if name != "cardan":
        direct["joint"][2]["branch"] = 1 if np.sin(led.joint_variable.values[0, list(led["variable"].values).index("C.angle")]) > 0 else -1
    found = linkdyn.Scene(direct).inverse(q=angle[inner, np.newaxis], qd=rate[inner, np.newaxis], qdd=second[:, np.newaxis])
    assert (found.status == 0).all() and len(t) > 100
    np.testing.assert_allclose(found.reaction.values, led.reaction.values[inner], atol=1e-7 * np.abs(led.reaction.values).max())
    np.testing.assert_allclose(found.driving_force.values, led.driving_force.values[inner], atol=1e-7 * np.abs(led.driving_force.values).max())


def test_beside_a_cam() -> None:
    """A camshaft driven by two gears: the valve train is as without them."""
    folder = Path(__file__).resolve().parents[2] / "examples" / "valve_train"
    data = tomllib.loads((folder / "scene.toml").read_text())
    alone = linkdyn.Scene(data, folder).inverse(want="all")
    shaft = data["joint"][0]["between"][1]
    data["frame"]["markers"]["W"] = [-0.1, 0]
    data["link"].append(disc("idler", {"W": [0, 0]}))
    data["joint"] += [hinge("W", "frame.W", "idler.W"), gear("G", "idler.W", shaft, [20, 20]), gear("H", "idler.W", shaft, [30, 30])]
    both = linkdyn.Scene(data, folder).inverse(want="all")
    assert both.attrs["shared_reactions"] == "G.force G.moment H.force H.moment" and (both.status == 0).all()
    for joint in ("pivot", "lobe", "tip", "guide"):
        np.testing.assert_allclose(both.reaction.sel(joint=joint).values, alone.reaction.sel(joint=joint).values, atol=1e-10 * np.abs(alone.reaction.values).max())


# ---------------------------------------------------------------- what does not fit

def refused(scene: dict[str, Any]) -> str:
    with pytest.raises(linkdyn.SceneError) as error:
        linkdyn.Scene(scene).inverse()
    return str(error.value)


def test_another_ratio_locks() -> None:
    assert "gear 'H' locks coordinate 'A'" in refused(two_shafts(gear("G", "a.A", "b.B", [20, 40]), gear("H", "a.A", "b.B", [20, 41])))
    assert "gear 'G2' locks coordinate 'A0'" in refused(ring_of(3))
    assert "gear 'G4' locks coordinate 'I'" in refused(lay_shafts(44))
    assert "gears give the angle of joint 'D'" in refused(parallelogram(radii=[0.05, 0.06]))


def test_phases() -> None:
    """Phases have to fit each other. Both meshes of a planet may have one: it stands turned."""
    scene = planets(3)
    by_name = {joint["name"]: joint for joint in scene["joint"]}
    plain = linkdyn.Scene(scene).inverse(want="all")
    by_name["PR2"]["phase"] = "9 deg"
    assert "gear 'PR2': its phase does not fit those of the other gears between its wheels (expected phase = 0 rad)" in refused(scene)
    by_name["SP2"]["phase"] = "-30 deg"
    turned = linkdyn.Scene(scene).inverse(want="all")
    angle = turned.joint_variable.values - plain.joint_variable.values
    np.testing.assert_allclose(angle[:, list(turned.variable.values).index("P2.angle")], np.deg2rad(-30), atol=1e-12)
    assert np.abs(angle).sum(axis=0).max() == pytest.approx(np.abs(angle).sum())
    np.testing.assert_allclose(turned.driving_force.values, plain.driving_force.values, rtol=1e-12)


def with_wheels(**belt: Any) -> dict[str, Any]:
    """A parallelogram whose four hinges turn wheels: only the belt can let go."""
    scene = parallelogram(**belt)
    links = {link["name"]: link for link in scene["link"]}
    for crank, other in (("crank1", "B"), ("crank2", "C")):
        links[crank]["markers"]["X"] = [0.05, 0.06]
        scene["link"].append(disc(f"wheel{other}", {"X": [0, 0]}))
        scene["joint"] += [hinge(f"X{other}", f"{crank}.X", f"wheel{other}.X"), gear(f"K{other}", f"rod.{other}", f"wheel{other}.X", [20, 20])]
    scene["coordinate"] = [along("A", {"law": "harmonic", "mean": 1.2, "amplitude": 0.4, "frequency": "3 rad/s"})]
    return scene


def test_a_belt_that_the_cranks_contradict() -> None:
    """Where only the belt can let go, its phase and the other assembly are refused; else each sample says that the joints do not fit."""
    scene = with_wheels()
    check_roads(scene)
    assert "belt, its wheels are coupled without it" in linkdyn.Scene(scene).explain()
    # beyond the position in which the cranks lie flat the same branch is the crossed linkage, which the belt forbids: on its own such a sample is no assembly
    run = linkdyn.Scene(scene).inverse(q=[[1.2], [-1.2]], qd=np.zeros((2, 1)), qdd=np.zeros((2, 1)))
    assert list(run.status.values == 0) == [True, False] and np.isnan(run.driving_force.values[1]).all()
    across = copy.deepcopy(scene)
    across["coordinate"] = [along("A", {"law": "cycloidal", "from": 1.2, "to": -1.2, "duration": 1.0})]
    across["time"] = {"end": 1, "samples": 202}
    passed = linkdyn.Scene(across).inverse(want="all")
    assert (passed.status == 0).all()
    cranks = passed.joint_variable.sel(variable=["A.angle", "D.angle"]).values
    np.testing.assert_allclose(cranks[:, 0], cranks[:, 1], atol=1e-9)
    with_branch = copy.deepcopy(scene)
    for branch in (1, -1):
        with_branch["joint"][2]["branch"] = branch
        if branch == -1:
            assert "belt 'T' locks the mechanism" in refused(with_branch)
        else:
            assert (linkdyn.Scene(with_branch).inverse().status == 0).all()
    assert "belt 'T': its phase is not that of the wheels" in refused(with_wheels(phase=0.2))
    assert (linkdyn.Scene(with_wheels(phase=0.0)).inverse().status == 0).all()
    run = linkdyn.Scene(parallelogram(phase=0.2)).inverse()
    assert (run.status != 0).all() and "unreachable" in linkdyn.Scene(parallelogram(phase=0.2)).inverse().status.attrs["flag_meanings"]


def test_refusal_on_request() -> None:
    assert "how they share the load is not determined (expected redundancy =" in refused(planets(2) | {"redundancy": "refuse"})


def test_stiffness_must_decide() -> None:
    scene = planets(2) | {"redundancy": "stiffness"}
    assert "bends no joint that has a 'stiffness'" in refused(scene)


def test_a_ratio_beyond_all_trains_is_refused() -> None:
    scene = tomllib.loads((Path(__file__).parents[2] / "examples" / "geared_fivebar" / "scene.toml").read_text())
    gear = next(joint for joint in scene["joint"] if joint["type"] == "gear")
    gear["teeth"] = [1e12, 32]
    with pytest.raises(linkdyn.SceneError, match="teeth.*has a ratio of 3.125e10 .expected at most 1e6"):
        linkdyn.Scene(scene)
