"""Chains by name whose links and joints give way: what their reactions are where it is shared by stiffness."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest

pytestmark = pytest.mark.accuracy

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
Array = np.ndarray
MIRROR = np.diag([1.0, -1.0, 1.0])        # "xz"
BEAM = {"E": 7e9, "G": 3e9, "area": 4e-4, "Iy": 2e-8, "Iz": 7e-8, "J": 5e-8, "y": [0.3, 1.0, 0.1]}
MATRIX = np.array([[4, 1, 0, 0, 2, 1], [1, 3, 1, 0, 0, 1], [0, 1, 5, 1, 1, 0], [0, 0, 1, 90, 9, 4], [2, 0, 1, 9, 80, 7], [1, 1, 0, 4, 7, 99.0]]) * 1e-7
STIFF = [{"radial": 2e7, "axial": 1e7, "tilt": 4e4}, {"radial": 3e7, "tilt": 2e4}, {"axial": 5e6, "tilt": 5e4}]


def schoenflies() -> dict[str, Any]:
    """A platform on four legs of a hinge and two universal joints, two of them mirrored: eight moments hold what six could."""
    at = lambda r, degrees: [r * np.cos(np.radians(degrees)), r * np.sin(np.radians(degrees)), 0.0]
    return {
        "space": "spatial", "gravity": [0.4, 0.3, -9.81], "redundancy": "stiffness", "time": {"end": 1.0, "samples": 11},
        "frame": {"markers": {"B": {"at": at(0.4, 50), "repeat": 2, "about": "z", "mirror": "xz"}}},
        "link": [{"name": "platform", "mass": 2.0, "cog": [0.02, 0.01, 0.03], "inertia": [0.01, 0.012, 0.009, 0, 0, 0],
                  "markers": {"P": {"at": at(0.12, 20), "repeat": 2, "about": "z", "mirror": "xz"}}}],
        "chain": [{"type": "RUU", "repeat": 2, "about": "z", "mirror": "xz", "base": "frame.B#", "platform": "platform.P#", "axis": [0, 0, 1], "zero": at(1, 80), "elbow": 1,
                   "stiffness": copy.deepcopy(STIFF),
                   "crank": {"length": 0.2, "mass": 0.5, "cog": [0.01, 0.02, 0.1], "inertia": [0.003, 0.004, 0.002, 0, 0, 0],
                             "elastic": [BEAM | {"to": "R"}, {"to": "U1", "compliance": MATRIX.tolist()}]},
                   "rod": {"length": 0.5, "mass": 0.4, "inertia": [0.002, 0.003, 0.002, 0, 0, 0], "cog": [0.01, -0.015, 0.2], "elastic": BEAM | {"from": [0.02, 0.03, 0.1]}}}],
        "coordinate": [{"link": "platform", "components": ["x", "y", "z", "yaw"], "start": {"z": -0.4},
                        "motion": {"x": {"law": "harmonic", "amplitude": 0.02, "frequency": "1 Hz"}, "z": {"law": "harmonic", "mean": -0.4, "amplitude": 0.02, "frequency": "2 Hz"},
                                   "yaw": {"law": "harmonic", "amplitude": 0.1, "frequency": "1 Hz", "phase": "30 deg"}, "y": {"law": "constant", "value": 0.01}}}],
    }  # fmt: skip


def written(data: dict[str, Any], level: linkdyn.Scene) -> dict[str, Any]:
    """The same mechanism link by link. Images are mirrored in the world where all four legs stand alike, `level`: of legs 2 and 4 mass, section and matrix
    are those of legs 1 and 3 seen in the mirror."""
    poses = level.poses()
    stand, origin = dict(zip(level.links, poses.rotation[0], strict=True)), dict(zip(level.links, poses.position[0], strict=True))
    chain, scene = data["chain"][0], copy.deepcopy(data)
    del scene["chain"]
    frame, platform = {}, scene["link"][0]
    platform["markers"] = {}
    scene |= {"joint": [], "actuator": []}
    for leg in (1, 2, 3, 4):
        half = np.diag([-1.0, -1.0, 1.0]) if leg > 2 else np.eye(3)
        there = half @ (MIRROR if leg % 2 == 0 else np.eye(3))      # from leg 1 to this one, in the world
        both = np.kron(np.diag([1.0, np.linalg.det(there)]), np.eye(3)) @ np.kron(np.eye(2), there)
        crank, rod = f"leg{leg}.crank", f"leg{leg}.rod"
        spots = {"B": origin[crank], "K": origin[rod], "P": origin[rod] + stand[rod] @ [0, 0, 0.5]}
        across = stand[rod] @ [0, 1, 0]
        frame[f"B{leg}"] = {"at": spots["B"].tolist(), "axis": [0, 0, 1]}
        platform["markers"][f"P{leg}"] = {"at": (stand["platform"].T @ (spots["P"] - origin["platform"])).tolist(), "axis": [0, 0, 1]}
        for part, ends in (("crank", {"B": ("R", [0, 0, 1.0]), "K": ("U1", [0, 0, 1.0])}), ("rod", {"K": ("U1", across), "P": ("U2", across)})):
            name = f"leg{leg}.{part}"
            carry = stand[name].T @ there @ stand[f"leg1.{part}"]     # from what is written of leg 1 to this link's axes
            spec = chain[part]
            tensor = carry @ np.diag(spec["inertia"][:3]) @ carry.T
            link = {"name": name.replace(".", "_"), "mass": spec["mass"], "cog": (carry @ spec["cog"]).tolist(),
                    "inertia": [*np.diag(tensor), tensor[0, 1], tensor[1, 2], tensor[2, 0]],
                    "markers": {end: {"at": (stand[name].T @ (spots[end] - origin[name])).tolist(), "axis": (stand[name].T @ axis).tolist()} for end, (_, axis) in ends.items()}}
            elastic = copy.deepcopy(spec["elastic"])
            for beam in elastic if isinstance(elastic, list) else [elastic]:
                if "y" in beam:
                    beam["y"] = (carry @ beam["y"]).tolist()
                if "from" in beam:
                    beam["from"] = (carry @ beam["from"]).tolist()
                if "to" in beam:
                    beam["to"] = {"R": "B", "U1": "K"}[beam["to"]]
                if "compliance" in beam:
                    turn = np.kron(np.eye(2), stand[name].T) @ both @ np.kron(np.eye(2), stand[f"leg1.{part}"])
                    beam["compliance"] = (turn @ beam["compliance"] @ turn.T).tolist()
            scene["link"].append(link | {"elastic": elastic, "start": {"position": origin[name].tolist(), "rotation": stand[name].tolist()}})
        for word, kind, between, stiffness in zip("BKP", ("revolute", "universal", "universal"), ([f"frame.B{leg}", f"leg{leg}_crank.B"], [f"leg{leg}_crank.K", f"leg{leg}_rod.K"],
                                                                                              [f"leg{leg}_rod.P", f"platform.P{leg}"]), chain["stiffness"], strict=True):
            scene["joint"].append({"name": f"{word}{leg}", "type": kind, "between": between, "stiffness": stiffness})
        scene["actuator"].append({"joint": f"B{leg}"})
    scene["frame"] = {"markers": frame}
    return scene


def level_of(data: dict[str, Any]) -> linkdyn.Scene:
    level = copy.deepcopy(data)
    level["coordinate"][0].pop("motion")
    return linkdyn.Scene(level)


def test_links_of_legs_give_way() -> None:
    """Drives and reactions are those of the mechanism written link by link, images of what they are images of."""
    data = schoenflies()
    ours = linkdyn.Scene(data).inverse(want="all")
    theirs = linkdyn.Scene(written(data, level_of(data))).inverse(want="all")
    assert np.all(ours.status == 0) and np.all(theirs.status == 0) and ours.attrs["shared_reactions"]
    # an image's hinge turns the other way
    np.testing.assert_allclose(ours.driving_force * [1, -1, 1, -1], theirs.driving_force, atol=1e-9 * np.abs(theirs.driving_force.values).max())
    both = [(f"leg{leg}.{word}", f"{name}{leg}") for leg in (1, 2, 3, 4) for word, name in (("R", "B"), ("U1", "K"), ("U2", "P"))]
    first = np.array([ours.reaction.sel(joint=a).values for a, _ in both])
    second = np.array([theirs.reaction.sel(joint=b).values for _, b in both])
    np.testing.assert_allclose(first, second, atol=1e-8 * np.abs(second).max())
    # What gives way matters: rigid rods, or other joints, share otherwise.
    for change in ("rod", "stiffness"):
        other = schoenflies()
        if change == "rod":
            other["chain"][0]["rod"].pop("elastic")
        else:
            other["chain"][0]["stiffness"][1] = {"tilt": 50.0}
        assert np.abs(linkdyn.Scene(other).inverse(want="all").reaction.values - ours.reaction.values).max() > 1e-3 * np.abs(first).max()


def test_markers_of_drawn_legs() -> None:
    """Beams of a drawn leg, in space and mirrored, begin and end at markers called as its joints: at these points."""
    def made(start: Callable[[int, list[str]], Any]) -> linkdyn.Run:
        scene = tomllib.loads((EXAMPLES / "tripteron" / "scene.toml").read_text()) | {"redundancy": "stiffness"}
        scene["chain"][0]["stiffness"] = {"radial": 1e9, "axial": 1e9, "tilt": 1e7, "torsion": 1e7}
        for k, link in enumerate(scene["chain"][0]["links"][1:]):
            link["elastic"] = BEAM | {"to": f"R{k + 1}", "from": start(k, link["to"])}
        return linkdyn.Scene(scene, folder=EXAMPLES / "tripteron").inverse(t=[0.1, 0.4])
    first = made(lambda k, to: to)
    second = made(lambda k, to: f"R{k + 2}")
    np.testing.assert_allclose(second.reaction, first.reaction, atol=1e-9 * np.abs(first.reaction.values).max())


@pytest.mark.parametrize(("change", "words"), [
    ({"redundancy": "minimum-norm"}, "'stiffness' has no meaning here"),
    ({"stiffness": STIFF[:2]}, "'stiffness' has 2 elements"),
    ({"to": "S"}, "link 'leg1.rod', elastic: key 'to' = 'S' is no marker"),
])
def test_wrong_words(change: dict[str, Any], words: str) -> None:
    """What is no joint of the leg, or has no meaning."""
    data = schoenflies()
    if "redundancy" in change:
        data |= change
    elif "to" in change:
        data["chain"][0]["rod"]["elastic"] = BEAM | change
    else:
        data["chain"][0] |= change
    with pytest.raises(linkdyn.SceneError) as refused:
        linkdyn.Scene(data)
    assert words in str(refused.value)
