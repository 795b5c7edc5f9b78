"""The work that peers are given, as trees of links with loops (see benchmarks/peers/work.py), from our own scenes."""

from __future__ import annotations

import tomllib
from collections import deque

import numpy as np

import linkdyn
from report import ROOT

EXAMPLES = ROOT / "examples"
LEGS = 6
STIFFNESS, DAMPING = 2000.0, 2.0
"""Of the feedback in the legs [N/m, N s/m]."""


def inertia_matrix(six: list[float]) -> list[float]:
    """Ixx Iyy Izz Ixy Ixz Iyz to nine."""
    xx, yy, zz, xy, xz, yz = six
    return [xx, xy, xz, xy, yy, yz, xz, yz, zz]


def marker(description: dict, link: int, name: str) -> np.ndarray:
    return np.array(next(one["at"] for one in description["links"][link]["markers"] if one["name"] == name))


# ---------------------------------------------------------------------------------------------------------- planar
class PlanarTree:
    """A tree as shallow as joints allow, numbered link after link along each branch, as peers want it; the other joints close loops.
    Revolute joints only."""

    def __init__(self, scene: linkdyn.Scene) -> None:
        self.description = scene.description
        poses = scene.poses(scene.motion()[0][:1])
        self.rotation = np.concatenate([np.eye(3)[None], np.asarray(poses.rotation)[0]])
        self.links: list[dict] = []
        self.place = {0: -1}
        """Of a scene's link in the tree; the ground is none."""
        self.origin = {0: np.zeros(3)}
        """Of the tree's link in the axes of the scene's."""
        self.behind: dict[str, int] = {}
        """The tree's link behind a joint."""
        leading = self._leading_joints()
        self._add_behind(0, leading)
        self.loops = [self._loop(joint) for joint in self.description["joints"] if joint["name"] not in self.behind]

    def _leading_joints(self) -> dict[int, list[tuple[dict, int]]]:
        """Of each link: the joints that lead on from it, with the link behind."""
        leading: dict[int, list[tuple[dict, int]]] = {0: []}
        waiting = deque([0])
        while waiting:
            parent = waiting.popleft()
            for joint in self.description["joints"]:
                child = sum(joint["links"]) - parent
                if parent in joint["links"] and child not in leading:
                    leading[parent].append((joint, child))
                    leading[child] = []
                    waiting.append(child)
        return leading

    def _point(self, joint: dict, link: int) -> np.ndarray:
        return marker(self.description, link, joint["markers"][joint["links"].index(link)])

    def _add_behind(self, parent: int, leading: dict[int, list[tuple[dict, int]]]) -> None:
        for joint, child in leading[parent]:
            link, origin = self.description["links"][child], self._point(joint, child)
            turned = self.rotation[parent].T @ self.rotation[child]
            self.behind[joint["name"]] = self.place[child] = len(self.links)
            self.origin[child] = origin
            self.links.append({
                "parent": self.place[parent], "at": (self._point(joint, parent) - self.origin[parent]).tolist(), "joint": "Rz",
                "mass": link["mass"], "cog": (np.array(link["cog"]) - origin).tolist(),
                "inertia": (link["inertia"][2] * np.eye(3)).ravel().tolist(),      # about axes in the plane nothing turns
                "q": float(np.arctan2(turned[1, 0], turned[0, 0])),
            })
            self._add_behind(child, leading)

    def _loop(self, joint: dict) -> dict:
        return {"links": [self.place[link] for link in joint["links"]],
                "points": [(self._point(joint, link) - self.origin[link]).tolist() for link in joint["links"]]}


def planar_work(name: str, end: float) -> tuple[linkdyn.Scene, dict]:
    """A scene of revolute joints with a constant motor, dampers in joints that lead from the ground, springs from the ground."""
    file = EXAMPLES / name
    scene, content = linkdyn.load(file), tomllib.loads(file.read_text())
    tree = PlanarTree(scene)
    motor = content["actuator"][0]
    tree.links[tree.behind[motor["joint"]]]["force"] = motor["law"]["value"]
    springs = []
    names = [link["name"] for link in tree.description["links"]]
    for spring in content.get("spring", ()):
        if "joint" in spring:
            tree.links[tree.behind[spring["joint"]]]["damping"] = spring["damping"]
            continue
        ground, other = (part.split(".") for part in spring["between"])
        link = names.index(other[0])
        springs.append({"ground": marker(tree.description, 0, ground[1]).tolist(), "link": tree.place[link],
                        "point": (marker(tree.description, link, other[1]) - tree.origin[link]).tolist(),
                        "stiffness": spring["stiffness"], "rest": spring["rest"]})
    return scene, {"links": tree.links, "loops": tree.loops, "springs": springs, "gravity": tree.description["gravity"], "planar": True,
                   "end": end, "coordinates": [tree.behind[content["coordinate"][0]["joint"]]]}


# --------------------------------------------------------------------------------------------------------- hexapod
def hexapod_tree(scene: linkdyn.Scene, pose: np.ndarray, end: float) -> dict:
    """The platform behind Px Py Pz Rx Ry Rz, each leg behind Ry Rx Pz, joined where the spherical joints are."""
    description = scene.description
    links = {link["name"]: (i, link) for i, link in enumerate(description["links"])}
    joints = {joint["name"]: joint for joint in description["joints"]}

    def body(name: str) -> dict:
        link = links[name][1]
        return {"mass": link["mass"], "cog": link["cog"], "inertia": inertia_matrix(link["inertia"])}

    nowhere = [0.0, 0.0, 0.0]
    tree = [{"parent": i - 1, "at": nowhere, "joint": kind, "q": float(pose[i])} for i, kind in enumerate(("Px", "Py", "Pz", "Rx", "Ry", "Rz"))]
    tree[-1] |= body("platform")
    poses, loops = scene.poses(pose), []
    rotation, position = np.asarray(poses.rotation).reshape(-1, 3, 3)[0], np.asarray(poses.position).reshape(-1, 3)[0]
    for leg in range(1, LEGS + 1):
        base = marker(description, 0, joints[f"leg{leg}.U"]["markers"][0])
        top = marker(description, links["platform"][0], f"P{leg}")
        span = position + rotation @ top - base
        length = float(np.linalg.norm(span))
        first = len(tree)
        tree += [
            {"parent": -1, "at": base.tolist(), "joint": "Ry", "q": float(np.arctan2(span[0], span[2]))},
            {"parent": first, "at": nowhere, "joint": "Rx", "q": float(-np.arcsin(span[1] / length)), **body(f"leg{leg}.lower")},
            {"parent": first + 1, "at": nowhere, "joint": "Pz", "q": length, **body(f"leg{leg}.upper")},
        ]
        loops.append({"links": [LEGS - 1, first + 2], "points": [top.tolist(), nowhere]})
    return {"links": tree, "loops": loops, "springs": [], "gravity": description["gravity"], "planar": False, "end": end,
            "coordinates": list(range(6))}


def hexapod_forward(end: float) -> tuple[linkdyn.Scene, dict]:
    """examples/stewart_forward with nearer targets that are there from the start, since laws of time would be callbacks in Python to the peers,
    and damped little, so that it still swings at the end."""
    content = tomllib.loads((EXAMPLES / "stewart_forward" / "scene.toml").read_text())
    for actuator in content["actuator"]:
        law = actuator["law"]["target"]
        target = law["from"] + 0.25 * (law["to"] - law["from"])
        actuator["law"] |= {"target": target, "stiffness": STIFFNESS, "damping": DAMPING}
    scene = linkdyn.Scene(content)
    work = hexapod_tree(scene, np.array(content["coordinate"][0]["start"]["position"] + [0.0] * 3), end)
    for leg, actuator in enumerate(content["actuator"]):
        work["links"][8 + 3 * leg] |= {"stiffness": STIFFNESS, "damping": DAMPING, "rest": actuator["law"]["target"]}
    return scene, work


def hexapod_inverse() -> tuple[linkdyn.Scene, dict]:
    scene = linkdyn.load(EXAMPLES / "stewart_tsai" / "scene.toml")
    return scene, hexapod_tree(scene, scene.motion()[0][0], 0.0)
