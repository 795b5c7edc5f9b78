"""Dyads with slides inside them that lead: a boom and its cylinder. Two links that such a slide holds together are as rigid as one, and the dyad closes
by the formulas of any other. Drawn at random, closed as drawn, with slides and hinges in all places, between links written either way round."""

from __future__ import annotations

import copy
import re
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn._geometry import kinematics
from test_balance_of_links import acting, inertia_and_weight

KINDS = ("RRR", "RRP", "PRR", "RPR", "PRP", "PPR", "RPP")
LED = ("1", "2", "12")
"""In which halves there is a slide that leads."""


def turn(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


class Drawing:
    """A dyad between two cranks. Links are laid down at random, and joints put between them where they lie."""

    def __init__(self, kind: str, led: str, seed: int) -> None:
        self.rng = np.random.default_rng([seed, *map(ord, kind + led)])
        self.pose: dict[str, tuple[np.ndarray, float]] = {"frame": (np.zeros(2), 0.0)}
        self.links: list[dict[str, Any]] = []
        self.joints: list[dict[str, Any]] = []
        self.leaders: list[dict[str, Any]] = []
        self.markers: dict[str, dict[str, Any]] = {"frame": {}}
        around = self.rng.uniform(-0.7, 0.7, (3, 2)) + [[-1.2, 0], [0, 1.2], [1.2, 0]]
        for crank in ("crank1", "crank2"):
            self.link(crank)
            self.lead(self.joint(f"at_{crank}", "R", "frame", crank, self.rng.uniform(-1, 1, 2)))
        halves = [[f"link{h}", f"tip{h}"] if h in led else [f"link{h}"] for h in "12"]
        for name in [*halves[0], *halves[1]]:
            self.link(name)
        self.joint("A", kind[0], "crank1", halves[0][0], around[0])
        self.joint("C", kind[1], halves[0][-1], halves[1][-1], around[1])
        self.joint("B", kind[2], "crank2", halves[1][0], around[2])
        for half in halves:
            if len(half) == 2:
                self.lead(self.joint(f"inside_{half[0]}", "P", *half, self.rng.uniform(-1, 1, 2)))
        self.markers[halves[0][-1]]["load"] = [0.1, 0.2]

    def link(self, name: str) -> None:
        self.pose[name] = (self.rng.uniform(-1, 1, 2), self.rng.uniform(-3, 3))
        position, angle = self.pose[name]
        self.markers[name] = {}
        self.links.append({"name": name, "mass": self.rng.uniform(1, 3), "cog": list(self.rng.uniform(-0.2, 0.2, 2)), "inertia": self.rng.uniform(0.1, 0.3),
                           "markers": self.markers[name], "start": {"position": list(position), "angle": angle}})

    def joint(self, name: str, kind: str, one: str, other: str, point: np.ndarray) -> dict[str, Any]:
        between = [one, other] if self.rng.random() < 0.5 else [other, one]
        angle, slide = self.rng.uniform(-3, 3), self.rng.uniform(0.2, 0.6) * self.rng.choice([-1, 1])
        along = np.array([np.cos(angle), np.sin(angle)])
        for k, link in enumerate(between):
            position, attitude = self.pose[link]
            at = turn(-attitude) @ (point + (k * slide * along if kind == "P" else 0.0) - position)
            self.markers[link][name] = {"at": list(at), "axis": list(turn(-attitude) @ along)} if kind == "P" else list(at)
        self.joints.append({"name": name, "type": "prismatic" if kind == "P" else "revolute", "between": [f"{link}.{name}" for link in between]})
        turned = self.pose[between[1]][1] - self.pose[between[0]][1]
        return {"joint": name, "start": slide if kind == "P" else float(np.angle(np.exp(1j * turned)))}

    def lead(self, leader: dict[str, Any]) -> None:
        self.leaders.append(leader)

    def data(self, leaders: list[dict[str, Any]] | None = None) -> dict[str, Any]:
        loaded = next(name for name, markers in self.markers.items() if "load" in markers)
        leaders = leaders or self.leaders
        return copy.deepcopy({
            "title": "A dyad with slides that lead", "space": "planar", "gravity": [0.0, -9.81], "frame": {"markers": self.markers["frame"]}, "link": self.links,
            "joint": self.joints, "coordinate": leaders, "actuator": [{"joint": each["joint"]} for each in leaders],
            "load": [{"on": f"{loaded}.load", "force": [3.0, -5.0]}],
        })


def states(scene: linkdyn.Scene, n: int = 24) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(5)
    q = np.array(scene.simulator().q) + rng.uniform(-0.03, 0.03, (n, len(scene.coordinates)))
    return {"q": q, "qd": rng.normal(size=q.shape), "qdd": rng.normal(size=q.shape)}


@pytest.mark.parametrize("led", LED)
@pytest.mark.parametrize("kind", KINDS)
def test_every_link_is_in_balance(kind: str, led: str) -> None:
    """Newton and Euler again, with accelerations from the joints' constraints: on lanes and by the record."""
    for seed in range(3):
        scene = linkdyn.Scene(Drawing(kind, led, seed).data())
        assert "Newton's method" not in scene.explain()
        for solver in ("elimination", "lapack"):
            run = scene.inverse(**states(scene), solver=solver)
            good = run.status.values == 0
            assert good.mean() > 0.3
            run = run.isel(sample=good).assign(time=("sample", np.arange(np.sum(good), dtype=float)))
            motion = kinematics.link_motion(scene, run)
            force, moment = inertia_and_weight(scene, motion)
            size = np.abs(force).max() + np.abs(run.reaction.values).max()
            for link, point, pull, moments in acting(scene, run, motion):
                force[:, link] += pull
                moment[:, link] += moments + np.cross(point - motion.position[:, link], pull)
            assert np.abs(force[:, 1:]).max() < 1e-8 * size
            assert np.abs(moment[:, 1:]).max() < 1e-8 * size


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "RPP"])
def test_led_by_another_joint(kind: str) -> None:
    """The slide inside left free and the outer joint leading instead: the dyad is then one of two links, and closes by another formula. Forward after inverse."""
    for seed in range(4):
        drawing = Drawing(kind, "1", seed)
        scene = linkdyn.Scene(drawing.data())
        there = states(scene)
        run = scene.inverse(**there)
        good = run.status.values == 0
        names = [str(name) for name in run.variable.values]
        outer = next(i for i, name in enumerate(names) if name.startswith("A."))
        inside = next(i for i, name in enumerate(names) if name.startswith("inside"))
        q, qd = there["q"][good].copy(), there["qd"][good].copy()
        q[:, 2], qd[:, 2] = run.joint_variable.values[good, outer], run.joint_rate.values[good, outer]
        start = {"joint": "A", "start": float(scene.inverse(q=[scene.simulator().q]).joint_variable.values[0, outer])}
        other = linkdyn.Scene(drawing.data([*drawing.leaders[:2], start])).inverse(q=q, qd=qd)
        back = other.status.values == 0
        assert back.mean() > 0.8
        slide = there["q"][good][back, 2]
        lever = 1 + np.abs(there["qd"][good][back, 2] / qd[back, 2]) + np.abs(qd[back, 2] / there["qd"][good][back, 2])
        clear = lever < 30      # at a dead point of either leader the other tells nothing
        assert clear.mean() > 0.5
        for found, given in ((other.joint_variable, slide), (other.joint_rate, there["qd"][good][back, 2])):
            assert np.abs(found.values[back, inside] - given)[clear].max() < 1e-10
        apart = other.joint_variable.values[back] - run.joint_variable.values[good][back]
        assert np.abs(np.where(np.abs(apart) > 6, np.abs(apart) - 2 * np.pi, apart))[clear].max() < 1e-10


def boom(**changes: Any) -> dict[str, Any]:
    """A boom on the frame, and a cylinder under it whose stroke is the coordinate; the eyes of barrel and rod are off the cylinder's axis."""
    data: dict[str, Any] = {
        "title": "Boom", "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"A": [0, 1], "P": [0.5, 0]}},
        "link": [
            {"name": "boom", "mass": 300, "cog": [2, 0], "inertia": 400, "markers": {"A": [0, 0], "Q": [1.5, 0.1]}},
            {"name": "barrel", "mass": 20, "inertia": 1, "markers": {"P": [0, 0], "bore": {"at": [0.2, 0.05], "axis": [1, 0.1]}}},
            {"name": "rod", "mass": 10, "inertia": 0.5, "markers": {"piston": {"at": [0, 0], "axis": [0, 1]}, "Q": [0.04, 0.9]}},
        ],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "boom.A"]},
            {"name": "P", "type": "revolute", "between": ["frame.P", "barrel.P"]},
            {"name": "ram", "type": "prismatic", "between": ["barrel.bore", "rod.piston"]},
            {"name": "Q", "type": "revolute", "between": ["boom.Q", "rod.Q"]},
        ],
        "coordinate": [{"joint": "ram", "motion": {"law": "polynomial-345", "from": 0.3, "to": 0.7, "duration": 1}}],
        "actuator": [{"joint": "ram"}],
        "time": {"end": 1, "samples": 51},
    }
    for name, more in changes.items():
        next(each for each in data["joint"] if each["name"] == name).update(more)
    return data


def length(stroke: np.ndarray) -> np.ndarray:
    """From eye to eye: along the cylinder's axis, and across it."""
    axis = np.array([1, 0.1]) / np.hypot(1, 0.1)
    from_barrel = np.array([0.2, 0.05])
    along = from_barrel @ axis + stroke + 0.9
    across = from_barrel @ [-axis[1], axis[0]] - 0.04
    return np.hypot(along, across)


def side_of_rod(run: Any) -> np.ndarray:
    """Above zero: the rod's eye is to the left of the way from boom's hinge to barrel's."""
    angle = run.joint_variable.sel(variable="A.angle").values
    eye = np.stack([np.cos(angle) * 1.5 - np.sin(angle) * 0.1, np.sin(angle) * 1.5 + np.cos(angle) * 0.1], axis=1)
    way = np.array([0.5, -1.0])
    assert np.allclose(np.linalg.norm(eye - way, axis=1), length(run.q.values[:, 0]), rtol=0, atol=1e-13)
    return way[0] * eye[:, 1] - way[1] * eye[:, 0]


@pytest.mark.parametrize("joint", ["A", "P", "Q", "ram"])
@pytest.mark.parametrize("branch", [1, -1])
def test_branch(joint: str, branch: int) -> None:
    """At any of its joints, also at the slide: the triangle by the law of cosines, its corner on the side that was said."""
    scene = linkdyn.Scene(boom(**{joint: {"branch": branch}}))
    run = scene.inverse()
    assert (run.status.values == 0).all()
    assert (branch * side_of_rod(run) > 0.1).all()
    assert "as 'branch' says" in scene.explain()
    # the first outer joint is that of the first link of the inner joint's 'between'
    turned = linkdyn.Scene(boom(**{joint: {"branch": branch}}) | {"joint": boom(Q={"between": ["rod.Q", "boom.Q"]})["joint"]})
    assert "nearest to joint variables of zero" in turned.explain()
    turned = linkdyn.Scene(boom(**{"Q": {"between": ["rod.Q", "boom.Q"], "branch": -branch}})).inverse()
    assert np.abs(turned.joint_variable.values[:, :2] - run.joint_variable.values[:, :2]).max() < 1e-13


def test_which_assembly_without_a_branch() -> None:
    """The nearest to what starts, else to joint variables of zero: told, and the same as where iteration looks for it."""
    for joint, start, side in (("A", "40 deg", 1), ("A", "-150 deg", -1), ("P", "170 deg", -1), ("P", "30 deg", 1)):
        assert (side * side_of_rod(linkdyn.Scene(boom(**{joint: {"start": start}})).inverse()) > 0.1).all(), (joint, start)
    scene = linkdyn.Scene(boom())
    assert "branch +1, nearest to joint variables of zero" in scene.explain()
    assert (side_of_rod(scene.inverse()) > 0.1).all()
    assert {each.branch["Q"] for each in scene.assemblies()} == {1, -1}


def test_contradicting_branches_are_refused() -> None:
    with pytest.raises(linkdyn.SceneError, match="'branch' contradicts that of another joint of the same dyad"):
        linkdyn.Scene(boom(ram={"branch": 1}, Q={"branch": -1}))
    with pytest.raises(linkdyn.SceneError, match="'branch' has no meaning here: a dyad with two slides has one assembly"):
        data = Drawing("PRP", "1", 0).data()
        data["joint"][-1]["branch"] = 1
        linkdyn.Scene(data)


def test_out_of_reach() -> None:
    """The triangle's inequality: within it every sample closes, beyond it none does, and words say which hinges are how far apart."""
    scene = linkdyn.Scene(boom())
    base, arm = np.hypot(0.5, 1.0), np.hypot(1.5, 0.1)
    stroke = np.linspace(-1.3, 2.2, 701)
    reaches = (length(stroke) < base + arm) & (length(stroke) > abs(base - arm))
    poses = scene.poses(q=stroke[:, np.newaxis])
    assert np.array_equal(poses.status == 0, reaches)
    assert 0.2 < reaches.mean() < 0.8
    data = boom()
    data["coordinate"][0]["motion"] = {"law": "constant", "value": 2.0}
    words = linkdyn.Scene(data).explain()
    told = re.search(r"links 'boom', 'barrel', 'rod' cannot be closed at the start: joints 'A' and 'P' are (\S+) m apart, the links reach from (\S+) m to (\S+) m", words)
    assert told is not None
    np.testing.assert_allclose([float(number) for number in told.groups()], [base, length(np.array(2.0)) - arm, length(np.array(2.0)) + arm], atol=1e-6)


def test_the_way_to_the_end_of_its_reach() -> None:
    """`singularity_distance` of a boom: how far the stroke is from where its triangle is flat."""
    scene = linkdyn.Scene(boom())
    base, arm = np.hypot(0.5, 1.0), np.hypot(1.5, 0.1)
    end = 1.5
    for _ in range(40):     # by Newton's method; the slope is nearly one
        end -= length(np.array(end)) - (base + arm)
    near = end - np.array([0.001, 0.003, 0.01])
    run = scene.inverse(q=near[:, np.newaxis], want=["driving_force", "singularity_distance"])
    np.testing.assert_allclose(run.singularity_distance.values, end - near, rtol=0.01)
