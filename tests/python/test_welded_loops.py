"""Links of a loop that are welded together, as models from drawings have them: they are placed as one, with the results and the speed of one link in
their place."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from cross_checks import hold_together
from linkdyn._geometry import kinematics
from numpy.typing import NDArray
from test_balance_of_links import SOLVERS, assert_balance
from test_parallel_rods import delta
from test_rod_legs import written
from test_said_otherwise import elements, matrix, turned, with_starts, write_markers
from test_written_legs import hexapod

pytestmark = pytest.mark.accuracy

Array = NDArray[np.float64]
Content = dict[str, Any]
ROOT = Path(__file__).parents[2]
SCENES = ("examples/fourbar", "examples/sixbar_slider", "examples/stephenson_iii", "examples/watt_i", "examples/rcsp_start", "tests/scenes/rsur")
ROUNDING = 1e-13


def read(name: str) -> Content:
    path = ROOT / name
    return tomllib.loads((path / "scene.toml" if path.is_dir() else path.with_suffix(".toml")).read_text(encoding="utf-8"))


def renamed(part: Any, old: str, new: str) -> Any:
    if isinstance(part, dict):
        return {key: renamed(value, old, new) for key, value in part.items()}
    if isinstance(part, list):
        return [renamed(value, old, new) for value in part]
    return new if part == old else part


def cut(content: Content, name: str, moved: list[str], rotation: Array, origin: Array) -> Content:
    """The same machine, a link of it two that are welded: some markers and a part of the mass are another link's, whose axes stand so in those of
    the first."""
    content = copy.deepcopy(content)
    is_planar = content["space"] == "planar"
    link = next(link for link in content["link"] if link["name"] == name)
    half: Content = {"name": f"{name}_half", "mass": 0.4 * link["mass"], "markers": {marker: link["markers"].pop(marker) for marker in moved}}
    link["mass"] *= 0.6
    half["cog"] = (rotation.T @ (np.array(link.get("cog", 0 * origin), float) - origin)).tolist()
    if is_planar:
        half["inertia"], link["inertia"] = 0.4 * link.get("inertia", 0), 0.6 * link.get("inertia", 0)
    else:
        inertia = matrix(link.get("inertia", [0] * 6))
        half["inertia"], link["inertia"] = elements(rotation.T @ (0.4 * inertia) @ rotation), elements(0.6 * inertia)
        half["inertia_check"] = link["inertia_check"] = False
    write_markers(half, rotation, origin)
    seam = 0.5 * origin + 0.1
    for part, turn, at in ((link, np.eye(len(origin)), seam), (half, rotation.T, rotation.T @ (seam - origin))):
        part["markers"]["seam"] = {"at": at.tolist(), "x": turn[:, 0].tolist()} | ({} if is_planar else {"axis": turn[:, 2].tolist()})
    for marker in moved:
        content = renamed(content, f"{name}.{marker}", f"{name}_half.{marker}")
    content["link"].append(half)
    content["link"] = [link if one["name"] == name else one for one in content["link"]]
    content["joint"].append({"name": f"{name}_weld", "type": "fixed", "between": [f"{name}.seam", f"{name}_half.seam"]})
    return content


def cuts(content: Content, is_turned: bool = True) -> list[Content]:
    """Every link with more than one marker cut before each of them. In a plane, where angles count from the links' axes, these stay parallel."""
    random = np.random.default_rng(7)
    found = []
    for link in content["link"]:
        for marker in link["markers"] if len(link["markers"]) > 1 else []:
            if content["space"] == "planar":
                rotation, origin = np.eye(2), np.array([0.1, 0.2])
            else:
                rotation, origin = turned(random) if is_turned else np.eye(3), 0.3 * random.normal(size=3)
            found.append(cut(content, link["name"], [marker], rotation, origin))
    return found


def roads(run: Any) -> tuple[int, ...]:
    return tuple(run.attrs[f"samples_{road}"] for road in ("closed_form", "iterated", "dense"))


def assert_same(whole: Any, welded: Any, spins: bool = False) -> None:
    """Sizes of reactions, since these turn with the axes that they are told in; drives, variables and rates as they are, but for those of balls
    between which rods may spin."""
    np.testing.assert_array_equal(whole.status, welded.status)
    assert roads(welded) == roads(whole)
    joints = whole.joint.values
    n = 2 if whole.reaction.shape[-1] == 3 else 3
    for part in (slice(0, n), slice(n, None)):
        mine, its = (np.linalg.norm(run.reaction.sel(joint=joints).values[..., part], axis=-1) for run in (whole, welded))
        np.testing.assert_allclose(its, mine, rtol=0, atol=ROUNDING * max(float(mine.max()), 1e-6))
    for name in ("driving_force", "joint_variable", "joint_rate"):
        if name not in whole:
            continue
        mine, its = (run[name] for run in (whole, welded))
        if name.startswith("joint"):
            told = [one for one in mine["variable"].values if not (spins and one.endswith(("roll", "pitch", "yaw")))]
            mine, its = (values.sel(variable=told) for values in (mine, its))
        np.testing.assert_allclose(its, mine, rtol=0, atol=10 * ROUNDING * max(float(np.abs(mine).max()), 1.0), err_msg=name)


@pytest.mark.parametrize("name", SCENES)
def test_every_link_in_two_parts(name: str) -> None:
    """Nothing is told of where the parts begin: the assembly is that of the whole, by the same road."""
    content = read(name)
    whole = linkdyn.Scene(content).inverse(want="all")
    for parts in cuts(content):
        assert_same(whole, linkdyn.Scene(parts).inverse(want="all"))


@pytest.mark.parametrize("is_turned", [False, True])
@pytest.mark.parametrize("kind", ["UPS", "UCU"])
def test_halves_of_legs(kind: str, is_turned: bool) -> None:
    content = with_starts(hexapod(kind))
    whole = linkdyn.Scene(content).inverse(want="all")
    for parts in cuts(content, is_turned):
        if "platform_half" in str(parts):
            continue
        assert_same(whole, linkdyn.Scene(parts).inverse(want="all"))


@pytest.mark.parametrize("is_turned", [False, True])
@pytest.mark.parametrize("angle", [0.0, 0.5])
@pytest.mark.parametrize("lead", ["R", "P"])
def test_parts_of_a_delta(lead: str, angle: float, is_turned: bool) -> None:
    """Its platform, cranks or carriages, and rods that may spin; the platform in axes that stand as the base's do, or not."""
    content = delta(lead, turned=angle)
    whole = linkdyn.Scene(content).inverse(want="all")
    assert roads(whole)[1:] == (0, 0)
    for parts in [one for one in cuts(content, is_turned) if "'platform.seam'" in str(one) or "1_half" in str(one) or "d2_half" in str(one)]:
        assert_same(whole, linkdyn.Scene(parts).inverse(want="all"), spins=True)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", ["fourbar", "rcsp", "hexapod", "delta"])
def test_every_part_is_in_balance(name: str, solver: str) -> None:
    """The reactions of the welds, too: sums of forces and moments that share nothing with the engine's."""
    random = np.random.default_rng(3)
    origin = np.array([0.1, -0.2, 0.3])
    if name == "fourbar":
        content = read("examples/fourbar")
        for link, marker in (("coupler", "J2"), ("follower", "J4")):
            content = cut(content, link, [marker], np.array([[0.8, -0.6], [0.6, 0.8]]), np.array([1.0, 2.0]))
    elif name == "rcsp":
        content = cut(cut(read("examples/rcsp_start"), "coupler", ["C"], turned(random), origin), "output", ["P"], np.eye(3), origin)
    elif name == "hexapod":
        content = with_starts(hexapod())
        for k in range(6):
            content = cut(content, f"lower{k}", ["P"], turned(random) if k % 2 else np.eye(3), origin)
            content = cut(content, f"upper{k}", ["S"], turned(random) if k % 3 else np.eye(3), origin)
    else:
        content = cut(delta(turned=0.5), "platform", ["P20", "P21", "tool"], np.eye(3), origin)
        content = cut(content, "rod00", ["P"], turned(random), 0 * origin)
    scene = linkdyn.Scene(content)
    assert "Newton" not in scene.explain()
    run = scene.inverse()
    run = scene.inverse(t=run.time.values[:: max(1, run.time.size // 24)], solver=solver)
    assert_balance(scene, run, kinematics.link_motion(scene, run))


def four_bar(first: list[str], welds: list[tuple[str, str]]) -> Content:
    """A coupler of parts, each with the same axes; `first` are the parts with the pins."""
    parts = sorted({name for weld in welds for name in weld})
    links: list[Content] = [
        {"name": "crank", "mass": 1.0, "cog": [0.05, 0], "inertia": 0.01, "markers": {"A": [0, 0], "B": [0.1, 0]}},
        {"name": "rocker", "mass": 2.0, "cog": [0.1, 0.02], "inertia": 0.03, "markers": {"C": [0.25, 0], "D": [0, 0]}}]
    links += [{"name": name, "mass": 0.5, "cog": [0.1, 0.03], "inertia": 0.002,
               "markers": {"B": [0, 0], "C": [0.3, 0.05], "W1": [0.1, 0.1], "W2": [0.2, -0.1]}} for name in parts]
    joints: list[Content] = [
        {"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]}, {"name": "B", "type": "revolute", "between": ["crank.B", f"{first[0]}.B"]},
        {"name": "C", "type": "revolute", "between": [f"{first[-1]}.C", "rocker.C"]}, {"name": "D", "type": "revolute", "between": ["rocker.D", "frame.D"]}]
    joints += [{"name": f"weld{i}", "type": "fixed", "between": [f"{a}.W{1 + i % 2}", f"{b}.W{1 + i % 2}"]} for i, (a, b) in enumerate(welds)]
    return {"title": "four-bar", "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"A": [0, 0], "D": [0.3, 0]}}, "link": links,
            "joint": joints, "coordinate": [{"joint": "A", "motion": {"law": "constant-rate", "rate": 3.0}}], "actuator": [{"joint": "A"}],
            "time": {"end": 2.0, "samples": 41}}


@pytest.mark.parametrize(("first", "welds"), [(["a", "d"], [("a", "b"), ("b", "c"), ("c", "d")]), (["a", "d"], [("c", "b"), ("d", "c"), ("b", "a")]),
                                              (["a", "b"], [("c", "a"), ("c", "b"), ("c", "d")]), (["c"], [("c", "a"), ("a", "b")])])
def test_chains_and_stars_of_welds(first: list[str], welds: list[tuple[str, str]]) -> None:
    scene = linkdyn.Scene(four_bar(first, welds))
    run = scene.inverse(want="all")
    assert (run.status == 0).all() and run.attrs["samples_closed_form"] == 41
    assert_balance(scene, run, kinematics.link_motion(scene, run))


def test_a_weld_too_many_is_refused_as_ever() -> None:
    with pytest.raises(linkdyn.SceneError, match="3 constraint directions are redundant"):
        linkdyn.Scene(four_bar(["a", "b"], [("a", "b"), ("a", "b")]) | {"redundancy": "refuse"})


def test_against_iteration() -> None:
    """The halves of a leg, welded, or held by a hinge and a brace, of which no closed form knows."""
    content = with_starts(hexapod())
    parts = cut(content, "lower2", ["P"], np.eye(3), np.zeros(3))
    other = copy.deepcopy(parts)
    weld = other["joint"].pop()
    start = next(link["start"] for link in other["link"] if link["name"] == "lower2")
    other["link"][-1]["start"] = start
    hold_together(other, "lower2", "lower2_half")
    closed, iterated = linkdyn.Scene(parts), linkdyn.Scene(other)
    assert "Newton" not in closed.explain() and "Newton" in iterated.explain()
    motion = closed.motion(np.linspace(0, 1, 51))
    one, two = (scene.inverse(*motion, want="all") for scene in (closed, iterated))
    assert one.attrs["samples_closed_form"] == 51 and two.attrs["samples_iterated"] == 51
    for name, tolerance in (("driving_force", 1e-12), ("joint_variable", 1e-12), ("joint_rate", 1e-11)):
        mine, its = one[name], two[name]
        if name.startswith("joint"):
            its = its.sel(variable=mine["variable"].values)
        np.testing.assert_allclose(mine, its, rtol=0, atol=tolerance * max(1.0, float(np.abs(its).max())), err_msg=name)
    held = sum(two.reaction.sel(joint=f"lower2_half_brace_{letter}").values[:, :3] * sign for letter, sign in (("R", 1), ("U", -1)))
    np.testing.assert_allclose(one.reaction.sel(joint=weld["name"]).values[:, :3], held, rtol=0, atol=1e-10 * float(np.abs(held).max()))
    falls = [scene.forward(0.2, step=0.1, rtol=1e-10, atol=1e-10).q for scene in (closed, iterated)]
    np.testing.assert_allclose(falls[0], falls[1], rtol=0, atol=1e-8)


def test_branch_and_start() -> None:
    """Both choose as they do for the whole; a start may be told of either part."""
    content = read("examples/fourbar")
    for joint in content["joint"]:
        joint.pop("branch", None)
    for branch in (1, -1):
        told = copy.deepcopy(content)
        told["joint"][1]["branch"] = branch
        whole = linkdyn.Scene(told)
        pose = whole.poses(q=[[0.5]])
        parts = cut(told, "coupler", ["J2"], np.eye(2), np.array([1.0, 2.0]))
        assert_same(whole.inverse(), linkdyn.Scene(parts).inverse())
        for k, (name, shift) in enumerate((("coupler", [0.0, 0.0]), ("coupler_half", [1.0, 2.0]))):
            started = cut(content, "coupler", ["J2"], np.eye(2), np.array([1.0, 2.0]))
            at, turn = pose.position[0, whole.links.index("coupler")], pose.rotation[0, whole.links.index("coupler")]
            next(link for link in started["link"] if link["name"] == name)["start"] = {
                "position": (at + turn @ [*shift, 0])[:2].tolist(), "angle": float(np.arctan2(turn[1, 0], turn[0, 0]))}
            assert_same(whole.inverse(), linkdyn.Scene(started).inverse())


def test_runs_sweeps_and_other_numbers() -> None:
    """Forward runs, designs that vary where the seam and the pins are, and scenes made of one another."""
    content = read("examples/fourbar")
    parts = cut(content, "coupler", ["J2"], np.eye(2), np.array([1.0, 2.0]))
    whole, welded = linkdyn.Scene(content), linkdyn.Scene(parts)
    falls = [scene.forward(t=np.linspace(0, 1, 11), rtol=1e-10, atol=1e-12) for scene in (whole, welded)]
    np.testing.assert_allclose(falls[0].q, falls[1].q, rtol=0, atol=1e-9)
    longer = [scene.with_(changes).inverse() for scene, changes in ((whole, {"link.coupler.markers.J3": [-0.3, 0.2]}), (welded, {"link.coupler.markers.J3": [-0.3, 0.2]}))]
    assert_same(*longer)
    assert np.abs(longer[0].driving_force - whole.inverse().driving_force).max() > 1
    seam = welded.with_({f"link.{name}.markers.seam": {"at": at, "x": [1, 0]} for name, at in (("coupler", [0.5, 0.3]), ("coupler_half", [-0.5, -1.7]))})
    assert_same(whole.inverse(), seam.inverse())


def test_legs_with_rods() -> None:
    """Cranks or carriages and the rods behind them, each of two parts."""
    content = written()
    whole = linkdyn.Scene(content).inverse(want="all")
    for parts in cuts(content):
        assert_same(whole, linkdyn.Scene(parts).inverse(want="all"))
