"""Planar dyads of which coordinates give a point, as either arm of a five-bar robot led by its tip: closed by formulas, against iteration and
by other roads."""

from __future__ import annotations

from typing import Any

import linkdyn
import numpy as np
import pytest

pytestmark = pytest.mark.accuracy

ARMS = {"RRR": "RRR", "PRR": "PRR", "RPR": "RPR", "PPR": "PPR"}


def arm(kind: str, split: bool = False, seen_from: str = "frame") -> dict[str, Any]:
    """Two links from the frame to a tip, by hinges and slides. `split`: x and y are seen from links of which one is welded to the other,
    which no formula knows: by iteration."""
    outer, inner = ("revolute" if letter == "R" else "prismatic" for letter in kind[:2])
    links: list[dict[str, Any]] = [
        {"name": "first", "mass": 1.2, "cog": [0.2, 0.05], "inertia": 0.02, "markers": {
            "A": {"at": [0.02, 0.01], "axis": [1, 0.1]}, "C": {"at": [0.5, 0.03], "axis": [0.9, 0.4]}}},
        {"name": "second", "mass": 0.8, "cog": [0.3, 0.02], "inertia": 0.015, "markers": {
            "C": {"at": [0.03, -0.02], "axis": [1, 0.2]}, "tip": [0.6, 0.04]}},
        {"name": "post", "mass": 1.0, "inertia": 0.1, "markers": {"O": [0, 0], "A": {"at": [0.1, 0.05], "axis": [1, 0.3]}, "origin": [0, 0]}},
    ]
    joints: list[dict[str, Any]] = [
        {"name": "A", "type": outer, "between": ["post.A", "first.A"]},
        {"name": "C", "type": inner, "between": ["first.C", "second.C"]},
        {"name": "O", "type": "revolute" if seen_from == "post" else "fixed", "between": ["frame.O", "post.O"]},
    ]
    if inner == "revolute":
        joints[1]["start"] = 1.0
    start = {"RRR": (0.75, 0.55), "PRR": (0.9, 0.4), "RPR": (0.95, 0.5), "PPR": (0.9, 0.45)}[kind]
    waves = {key: {"law": "harmonic", "mean": middle, "amplitude": 0.12, "frequency": pace, "phase": phase}
             for key, middle, pace, phase in (("x", start[0], 5.0, 0.2), ("y", start[1], 7.0, 1.4))}
    tables: list[dict[str, Any]] = [{"marker": "second.tip", "components": ["x", "y"], "motion": waves}]
    if split:
        tables = [{"marker": "second.tip", "components": [key], "motion": {key: waves[key]}} for key in ("x", "y")]
        tables[1]["relative_to"] = "post"
    coordinates = tables
    if seen_from == "post":
        tables[0]["relative_to"] = "post"
        coordinates = [*tables, {"joint": "O", "motion": {"law": "harmonic", "amplitude": 0.5, "frequency": 4.0}}]
    return {"title": kind, "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"O": [0, 0]}}, "link": links, "joint": joints,
            "coordinate": coordinates, "actuator": [{"joint": "A"}, {"joint": "C"}] + [{"joint": "O"}] * (seen_from == "post"),
            "time": {"end": 1.0, "step": 0.01}}


def five_bar(tip: list[float], split: bool = False) -> dict[str, Any]:
    bar = {"mass": 0.5, "cog": [0.15, 0.01], "inertia": 0.01}
    links = [bar | {"name": name, "markers": {"in": [0, 0], "out": [length, 0]}} for name, length in (("a", 0.3), ("b", 0.28), ("c", 0.4), ("d", 0.42))]
    links[2]["markers"]["tip"] = tip
    links.append({"name": "post", "mass": 1.0, "inertia": 0.1, "markers": {"O": [0, 0]}})
    pairs = [("A", "frame.A", "a.in"), ("B", "frame.B", "b.in"), ("AC", "a.out", "c.in"), ("BD", "b.out", "d.in"), ("T", "c.out", "d.out")]
    joints: list[dict[str, Any]] = [{"name": name, "type": "revolute", "between": [one, two]} for name, one, two in pairs]
    joints.append({"name": "weld", "type": "fixed", "between": ["frame.O", "post.O"]})
    joints[2]["start"], joints[3]["start"] = -1.2, 1.2
    waves = {"x": {"law": "harmonic", "mean": 0.02, "amplitude": 0.1, "frequency": 6.0}, "y": {"law": "harmonic", "mean": 0.5, "amplitude": 0.06, "frequency": 9.0}}
    tables: list[dict[str, Any]] = [{"marker": "c.tip", "components": ["x", "y"], "motion": waves}]
    if split:
        tables = [{"marker": "c.tip", "components": [key], "motion": {key: waves[key]}} for key in ("x", "y")]
        tables[1]["relative_to"] = "post"
    return {"space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"A": [-0.1, 0], "B": [0.1, 0], "O": [0, 0]}}, "link": links, "joint": joints,
            "coordinate": tables, "actuator": [{"joint": "A"}, {"joint": "B"}], "time": {"end": 1.0, "step": 0.01}}


def agree(closed: linkdyn.Scene, iterated: linkdyn.Scene, q: Any, qd: Any, qdd: Any, in_order: bool) -> np.ndarray:
    assert "Newton" not in closed.explain() and "Newton" in iterated.explain()
    one, two = (scene.inverse(q, qd, qdd, want="all", in_order=in_order) for scene in (closed, iterated))
    np.testing.assert_array_equal(one.status == 0, two.status == 0)
    ok = (one.status == 0).values
    bound = 1e-11 * float(np.abs(two.driving_force[ok]).max())
    np.testing.assert_allclose(one.driving_force[ok], two.driving_force[ok], rtol=0, atol=bound)
    here, there = (scene.poses(q=q[ok], in_order=in_order).position for scene in (closed, iterated))
    np.testing.assert_allclose(here, there, rtol=0, atol=1e-12)
    return ok


@pytest.mark.parametrize("kind", ARMS)
def test_arms_against_iteration(kind: str) -> None:
    closed, iterated = (linkdyn.Scene(arm(kind, split)) for split in (False, True))
    assert "(point from coordinates second.tip.x second.tip.y)" in closed.explain()
    assert agree(closed, iterated, *closed.motion(np.linspace(0, 1, 301)), in_order=True).all()


@pytest.mark.parametrize("tip", [[0.4, 0.0], [0.5, 0.1]])
@pytest.mark.parametrize("in_order", [True, False])
def test_five_bar_against_iteration(tip: list[float], in_order: bool) -> None:
    """Within reach and beyond, at the hinge of both arms and at the end of a coupler that goes on beyond it."""
    closed, iterated = (linkdyn.Scene(five_bar(tip, split)) for split in (False, True))
    q, qd, qdd = closed.motion(np.linspace(0, 1, 301))
    if not in_order:
        stream = np.random.default_rng(3)
        q = q + stream.uniform(-0.25, 0.25, q.shape)
    ok = agree(closed, iterated, q, qd, qdd, in_order)
    assert ok.all() if in_order else 0.3 < ok.mean() < 1


@pytest.mark.parametrize("kind", ARMS)
@pytest.mark.parametrize("seen_from", ["frame", "post"])
def test_rates_and_forces(kind: str, seen_from: str) -> None:
    """The tip is where it is told, also as a link sees it that turns; rates are what differences say, power is in balance, solvers agree."""
    scene = linkdyn.Scene(arm(kind, seen_from=seen_from))
    assert "Newton" not in scene.explain()
    step = 1e-4
    t = 0.3 + step * np.arange(-2, 3)
    q, qd, qdd = scene.motion(t)
    run = scene.inverse(q, qd, qdd, want="all")
    assert (run.status == 0).all() and np.abs(run.power_imbalance).max() < 1e-12
    poses = scene.poses(q=q)
    k, post = scene.links.index("second"), scene.links.index("post")
    tip = poses.position[:, k, :2] + poses.rotation[:, k, :2, :2] @ [0.6, 0.04]
    seen = np.einsum("nji,nj->ni", poses.rotation[:, post, :2, :2], tip)
    np.testing.assert_allclose(seen, q[:, :2], rtol=0, atol=2e-15)
    x = run.joint_variable.values
    slope = (x[0] - 8 * x[1] + 8 * x[3] - x[4]) / (12 * step)
    np.testing.assert_allclose(run.joint_rate.values[2], slope, rtol=0, atol=1e-8 * max(1, np.abs(slope).max()))
    for solver in ("lapack", "reduced"):
        other = scene.inverse(q, qd, qdd, solver=solver)
        np.testing.assert_allclose(other.driving_force, run.driving_force, rtol=0, atol=1e-11 * float(np.abs(run.driving_force).max()))


def test_branch_chooses() -> None:
    """Elbow up and down, at the elbow's hinge, which links closed by iteration refuse."""
    lean = {}
    for branch in (1, -1):
        content = five_bar([0.4, 0.0])
        content["joint"][2].pop("start")
        content["joint"][2]["branch"] = branch
        scene = linkdyn.Scene(content)
        lean[branch] = scene.poses(q=scene.motion([0.0])[0]).position[0, scene.links.index("c"), 0]
    assert lean[1] != lean[-1]
    assert len(linkdyn.Scene(five_bar([0.4, 0.0])).assemblies()) == 4


def test_forward_after_inverse() -> None:
    """Forces of a motion, put in again, give the motion."""
    scene = linkdyn.Scene(five_bar([0.5, 0.1]))
    run = scene.forward(0.3, step=0.01, rtol=1e-10, atol=1e-10)
    assert np.abs((run.kinetic_energy + run.potential_energy - run.work) - float(run.kinetic_energy[0] + run.potential_energy[0])).max() < 1e-7
