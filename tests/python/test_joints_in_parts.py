"""Universal, spherical and cylindrical joints that are written in parts, two hinges with the cross between them, three with two links between, a hinge
and a slide with the sleeve between: their loops are closed by the formulas of the whole joint."""

from __future__ import annotations

import copy
from typing import Any

import linkdyn
import numpy as np
import pytest
from cross_checks import agrees_with_itself, hold_together
from linkdyn._geometry import kinematics
from test_balance_of_links import SOLVERS, assert_balance
from test_rod_legs import written
from test_said_otherwise import turned, with_starts
from test_welded_loops import cut, read, roads
from test_written_legs import hexapod

pytestmark = pytest.mark.accuracy

Content = dict[str, Any]
ROUNDING = 1e-13
FLIPS = [(False, False), (True, False), (False, True), (True, True)]


def in_parts(content: Content, name: str, mass: float = 0.0, flip: tuple[bool, bool] = (False, False), hinge_first: bool = False,
             aside: float = 0.0) -> Content:
    """A joint as two, `{name}a` and `{name}b`, with the same variables; either may be written the other way round. The link between may have a mass,
    and a sleeve's slide and hinge may be `aside` [m] along both, and beside each other."""
    content = copy.deepcopy(content)
    joint = next(joint for joint in content["joint"] if joint["name"] == name)
    content["joint"].remove(joint)
    between = f"{name}_between"
    if joint["type"] == "universal":
        kinds = ["revolute", "revolute"]
        second: Content = {"at": [0, 0, 0], "axis": [0, 1, 0], "x": [1, 0, 0]}
    else:
        kinds = ["revolute", "prismatic"] if hinge_first else ["prismatic", "revolute"]
        second = {"at": [0, 0, aside], "axis": [0, 0, 1], "x": [1, 0, 0]}
    content["link"].append({"name": between, "mass": mass, "cog": [0.01, 0.02, 0.03], "inertia": (mass * np.array([0.01, 0.012, 0.015, 0.001, 0, 0])).tolist(),
                            "markers": {"first": {"at": [0, 0, 0], "axis": [0, 0, 1], "x": [1, 0, 0]}, "second": second}})
    ends = [[joint["between"][0], f"{between}.first"], [f"{between}.second", joint["between"][1]]]
    for letter, kind, end, reverse in zip("ab", kinds, ends, flip, strict=True):
        content["joint"].append({"name": name + letter, "type": kind, "between": end[::-1] if reverse else end})
    for actuator in content.get("actuator", []):
        if actuator["joint"] == name:
            actuator["joint"] = name + ("a" if kinds[0] == "prismatic" else "b")
            actuator.pop("variable", None)
    return content


def ball_in_parts(content: Content, name: str, mass: float = 0.0, flip: tuple[bool, bool, bool] = (False, False, False)) -> Content:
    """A ball as three hinges, `{name}a`, `{name}b` and `{name}c`: about z of its first marker, about x square to it, about z of its second marker."""
    content = copy.deepcopy(content)
    joint = next(joint for joint in content["joint"] if joint["name"] == name)
    content["joint"].remove(joint)
    along = {"at": [0, 0, 0], "axis": [0, 0, 1], "x": [1, 0, 0]}
    across = {"at": [0, 0, 0], "axis": [1, 0, 0], "x": [0, 0, 1]}
    for i, (first, second) in enumerate(((along, across), (across, along))):
        content["link"].append({"name": f"{name}_{i}", "mass": mass, "cog": [0.01, 0.02, 0.0],
                                "inertia": (mass * np.array([0.01, 0.012, 0.015, 0.001, 0, 0])).tolist(), "markers": {"first": dict(first), "second": dict(second)}})
    ends = [[joint["between"][0], f"{name}_0.first"], [f"{name}_0.second", f"{name}_1.first"], [f"{name}_1.second", joint["between"][1]]]
    for letter, end, reverse in zip("abc", ends, flip, strict=True):
        content["joint"].append({"name": name + letter, "type": "revolute", "between": end[::-1] if reverse else end})
    return content


def assert_same(whole: Any, parts: Any, signs: float = 1.0) -> None:
    np.testing.assert_array_equal(whole.status, parts.status)
    assert roads(parts) == roads(whole)
    joints = [joint for joint in whole.joint.values if joint in parts.joint.values]
    for part in (slice(0, 3), slice(3, None)) if joints else ():
        mine, its = (np.linalg.norm(run.reaction.sel(joint=joints).values[..., part], axis=-1) for run in (whole, parts))
        np.testing.assert_allclose(its, mine, rtol=0, atol=ROUNDING * float(np.abs(whole.reaction).max()))
    np.testing.assert_allclose(signs * parts.driving_force, whole.driving_force, rtol=0, atol=ROUNDING * float(np.abs(whole.driving_force).max()))


@pytest.mark.parametrize("flip", FLIPS)
@pytest.mark.parametrize("base_is_first", [True, False])
@pytest.mark.parametrize(("kind", "letters"), [("UPS", "U"), ("UCU", "U"), ("UCU", "S"), ("UCU", "US")])
def test_crosses_of_legs(kind: str, letters: str, base_is_first: bool, flip: tuple[bool, bool]) -> None:
    content = with_starts(hexapod(kind, base_is_first))
    parts = content
    for letter in letters:
        for k in range(6):
            parts = in_parts(parts, f"{letter}{k}", flip=flip)
    scene = linkdyn.Scene(parts)
    assert "Newton" not in scene.explain() and scene.explain().count(f"{kind} leg") == 6
    whole, run = linkdyn.Scene(content).inverse(want="all"), scene.inverse(want="all")
    assert_same(whole, run)
    names = [f"{letters[0]}{k}" for k in range(6)]
    for name in names:
        for i, letter in enumerate("ab"):
            mine, its = whole.joint_variable.sel(variable=f"{name}.angle{i + 1}"), run.joint_variable.sel(variable=f"{name}{letter}.angle")
            np.testing.assert_allclose(its * (-1 if flip[i] else 1), mine, rtol=0, atol=1e-12)


@pytest.mark.parametrize("flip", FLIPS)
@pytest.mark.parametrize("hinge_first", [False, True])
def test_sleeves(hinge_first: bool, flip: tuple[bool, bool]) -> None:
    """Of legs of a hexapod that they drive, and of a CSP group; the hinge of a sleeve is somewhere along it."""
    sign = -1.0 if flip[1 if hinge_first else 0] else 1.0
    content = with_starts(hexapod("UCU"))
    parts = content
    for k in range(6):
        parts = in_parts(parts, f"P{k}", hinge_first=hinge_first, flip=flip, aside=0.1 * k)
    assert_same(linkdyn.Scene(content).inverse(), linkdyn.Scene(parts).inverse(), sign)
    content = read("examples/rcsp_start")
    assert_same(linkdyn.Scene(content).inverse(), linkdyn.Scene(in_parts(content, "C", hinge_first=hinge_first, flip=flip, aside=0.05)).inverse())


def test_crosses_of_rods() -> None:
    """The universal joints of cranks and carriages with rods, alone and all at once."""
    content = written()
    whole = linkdyn.Scene(content).inverse()
    names = [joint["name"] for joint in content["joint"] if joint["type"] == "universal"]
    parts = content
    for name in names:
        assert_same(whole, linkdyn.Scene(in_parts(content, name)).inverse())
        parts = in_parts(parts, name)
    assert len(names) == 4
    assert_same(whole, linkdyn.Scene(parts).inverse())


@pytest.mark.parametrize("flip", [(False, False, False), (True, False, True), (True, True, True), (False, True, False)])
@pytest.mark.parametrize("base_is_first", [True, False])
def test_balls_of_legs(base_is_first: bool, flip: tuple[bool, bool, bool]) -> None:
    content = with_starts(hexapod("UPS", base_is_first))
    whole = linkdyn.Scene(content).inverse(want="all")
    for is_all in (False, True):
        parts = content
        for k in range(6):
            parts = ball_in_parts(parts, f"S{k}", flip=flip)
            if is_all:
                parts = in_parts(parts, f"U{k}", flip=flip[:2])
        scene = linkdyn.Scene(parts)
        assert "Newton" not in scene.explain()
        assert_same(whole, scene.inverse(want="all"))


def test_start_turns_the_links_between() -> None:
    """Those of a ball stand in two ways; the nearest to the start is taken, and the legs do not feel it."""
    content = ball_in_parts(with_starts(hexapod()), "S0", mass=1e-9)
    angles = []
    for start in (0.0, 180.0):
        for joint in content["joint"]:
            if joint["name"] == "S0a":
                joint["start"] = f"{start} deg"
        run = linkdyn.Scene(content).inverse(want="all")
        angles.append(run.joint_variable.sel(variable=["S0a.angle", "S0b.angle"]).values)
        forces = run.driving_force
    assert np.abs(angles[0][:, 0]).max() < np.pi / 2 < np.abs(angles[1][:, 0]).min()
    np.testing.assert_allclose(angles[1][:, 1], -angles[0][:, 1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(forces, linkdyn.Scene(with_starts(hexapod())).inverse().driving_force, rtol=0, atol=1e-7 * float(np.abs(forces).max()))


def heavy(kind: str) -> Content:
    """Crosses, links between hinges of balls, and sleeves with a mass, a link welded to one of them, welded halves among them."""
    content = with_starts(hexapod(kind))
    for k in range(6):
        content = in_parts(content, f"U{k}", mass=3.0, flip=FLIPS[k % 4])
        if kind == "UPS" and k % 2:
            content = ball_in_parts(content, f"S{k}", mass=2.0, flip=(k == 1, k == 3, k == 5))
        if kind == "UCU":
            content = in_parts(content, f"P{k}", mass=2.0, hinge_first=k % 2 == 0, flip=FLIPS[k % 4], aside=0.1)
    content["link"].append({"name": "sensor", "mass": 0.5, "cog": [0.02, 0, 0.01], "inertia": [1e-3, 2e-3, 2e-3, 0, 0, 0], "markers": {"W": [0, 0, 0]}})
    next(link for link in content["link"] if link["name"] == "U3_between")["markers"]["W"] = [0.1, 0, 0.05]
    content["joint"].append({"name": "W", "type": "fixed", "between": ["U3_between.W", "sensor.W"]})
    content = cut(content, "U5_between", ["second"], turned(np.random.default_rng(4)), np.array([0.1, 0.05, -0.1]))
    return cut(content, "lower4", ["U"], turned(np.random.default_rng(2)), np.array([0.1, -0.2, 0.1]))


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("kind", ["UPS", "UCU"])
def test_links_between_are_in_balance(kind: str, solver: str) -> None:
    scene = linkdyn.Scene(heavy(kind))
    assert "Newton" not in scene.explain()
    run = scene.inverse(solver=solver)
    assert_balance(scene, run, kinematics.link_motion(scene, run))


@pytest.mark.parametrize("kind", ["UPS", "UCU"])
def test_forces_and_rates(kind: str) -> None:
    agrees_with_itself(linkdyn.Scene(heavy(kind)), step=1e-4, within=1e-8)


@pytest.mark.parametrize("kind", ["UPS", "UCU"])
def test_against_iteration(kind: str) -> None:
    """A cross of two halves that a hinge and a brace hold, of which no closed form knows."""
    content = heavy(kind)
    other = copy.deepcopy(content)
    cross = next(link for link in other["link"] if link["name"] == "U2_between")
    other["link"].append({"name": "U2_half", "mass": 0.0, "markers": {"second": cross["markers"].pop("second")}})
    for joint in other["joint"]:
        joint["between"] = [end.replace("U2_between.second", "U2_half.second") for end in joint["between"]]
    stand = linkdyn.Scene(content)
    pose = stand.poses()
    k = stand.links.index("U2_between")
    for link in other["link"]:
        if link["name"] in ("U2_between", "U2_half"):
            link["start"] = {"position": pose.position[0, k].tolist(), "rotation": pose.rotation[0, k].tolist()}
    hold_together(other, "U2_between", "U2_half")
    closed, iterated = linkdyn.Scene(content), linkdyn.Scene(other)
    motion = closed.motion(np.linspace(0, 1, 51))
    one, two = (scene.inverse(*motion, want="all") for scene in (closed, iterated))
    assert roads(one) == (51, 0, 0) and roads(two) == (0, 51, 0)
    for name, tolerance in (("driving_force", 1e-12), ("joint_variable", 1e-12), ("joint_rate", 1e-11), ("reaction", 1e-12)):
        mine, its = one[name], two[name]
        if name.startswith("joint"):
            its = its.sel(variable=mine["variable"].values)
        elif name == "reaction":
            its = its.sel(joint=mine.joint.values)
        np.testing.assert_allclose(mine, its, rtol=0, atol=tolerance * max(1.0, float(np.abs(its).max())), err_msg=name)
    falls = [scene.forward(0.2, step=0.1, rtol=1e-10, atol=1e-10).q for scene in (closed, iterated)]
    np.testing.assert_allclose(falls[0], falls[1], rtol=0, atol=1e-8)


def test_other_numbers() -> None:
    """Scenes made of one another, with the cross elsewhere along an axis and the base elsewhere."""
    content = with_starts(hexapod())
    parts = in_parts(content, "U0")
    whole, scene = linkdyn.Scene(content), linkdyn.Scene(parts)
    moved = [1.55, 0.3, 0.05]
    name = "frame.markers.B0"
    marker = copy.deepcopy(content["frame"]["markers"]["B0"]) | {"at": moved}
    assert_same(*(one.with_({name: marker}).inverse(want="all") for one in (whole, scene)))


@pytest.mark.parametrize("change", ["oblique", "apart", "led"])
def test_what_is_no_universal_joint(change: str) -> None:
    """Axes that do not cross at right angles, or a hinge that is led: the loop is closed as ever."""
    content = in_parts(with_starts(hexapod()), "U0", mass=1.0)
    second = next(link for link in content["link"] if link["name"] == "U0_between")["markers"]["second"]
    if change == "oblique":
        second |= {"axis": [0, 1, 0.01], "x": [1, 0, 0]}
    elif change == "apart":
        second["at"] = [0.001, 0, 0]
    else:
        content["actuator"].append({"joint": "U0a"})
        content["redundancy"] = "minimum-norm"
    scene = linkdyn.Scene(content)
    run = scene.inverse()
    assert (run.status == 0).all()
    assert (run.attrs["samples_iterated"] > 0) == (change != "led")
    assert_balance(scene, run, kinematics.link_motion(scene, run))
