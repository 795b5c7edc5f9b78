"""The same machine in other words: how a scene is written decides nothing.

Links get other axes, parts another order, joints their links the other way round, the world other axes, links are two that are welded
together; each scene is written in all these ways that it admits.
"""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

pytestmark = pytest.mark.accuracy

Array = NDArray[np.float64]
Content = dict[str, Any]
ROOT = Path(__file__).parents[2]
SCENES = ("examples/rcsp_start", "examples/sixbar_slider", "examples/stephenson_iii", "examples/spatial_slider_crank", "examples/fivebar_motors",
          "tests/scenes/screw_loop", "tests/scenes/geared_loop", "tests/scenes/rsur", "tests/scenes/screw_and_weld",
          "tests/scenes/bevel_differential", "tests/scenes/excavator", "tests/scenes/wheel_by_coupler")
PARTS = ("link", "joint", "actuator", "spring", "load", "friction", "stop", "controller", "event")
LEADS = ("coordinate", "actuator", "spring", "friction", "stop", "clutch", "controller")
INVERSE, FORWARD = 1e-8, 1e-6    # of a result's largest value: the loops' closure through the worst of the transmission, and steps


class NotSo(Exception):
    """The scene cannot be written this way."""


def turned(random: np.random.Generator) -> Array:
    """Any rotation matrix."""
    q = np.linalg.qr(random.normal(size=(3, 3)))[0]
    return q * np.linalg.det(q)


def least_turn(axis: Array) -> Array:
    """The smallest rotation that takes z to an axis."""
    v, c = np.cross([0, 0, 1], axis), axis[2]
    cross = np.cross(v, np.eye(3)).T
    return np.eye(3) + cross + cross @ cross / (1 + c)


def matrix(inertia: Any) -> Array:
    if isinstance(inertia, dict):
        return np.diag(inertia["diagonal"]).astype(float)
    xx, yy, zz, xy, yz, zx = inertia
    return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])


def elements(inertia: Array) -> list[float]:
    return [float(inertia[i]) for i in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))]


def write_markers(part: Content, rotation: Array, origin: Array) -> None:
    """Markers of a link in axes that stand so in those it had."""
    for name, marker in part.get("markers", {}).items():
        words = dict(marker) if isinstance(marker, dict) else {"at": marker}
        if len(origin) == 3:
            axis = np.array(words.get("axis", [0, 0, 1]), float)
            axis /= np.linalg.norm(axis)
            if "x" not in words and axis[2] < -1 + 1e-9:
                raise NotSo
            x = np.array(words["x"], float) if "x" in words else least_turn(axis)[:, 0]
            words["x"] = (rotation.T @ (x - axis * (axis @ x))).tolist()
        else:
            axis = np.array(words.get("axis", [1, 0]), float)
        words["at"] = (rotation.T @ (np.array(words["at"], float) - origin)).tolist()
        words["axis"] = (rotation.T @ axis).tolist()
        part["markers"][name] = words


def other_link_axes(scene: Content, random: np.random.Generator) -> None:
    """Every link is written in axes of its own anywhere; in a plane these stay parallel, since joint angles count from them."""
    if any(load.get("axes") == "link" for load in scene.get("load", [])):
        raise NotSo
    for link in scene["link"]:
        is_planar = scene["space"] == "planar"
        rotation = np.eye(2) if is_planar else turned(random)
        origin = 0.3 * random.normal(size=len(rotation))
        write_markers(link, rotation, origin)
        link["cog"] = (rotation.T @ (np.array(link.get("cog", 0 * origin), float) - origin)).tolist()
        if not is_planar and "inertia" in link:
            link["inertia"] = elements(rotation.T @ matrix(link["inertia"]) @ rotation)
        start = link["start"]
        at, old = np.array(start["position"]), np.eye(2) if is_planar else np.array(start["rotation"])
        if is_planar:
            c, s = np.cos(start["angle"]), np.sin(start["angle"])
            old = np.array([[c, -s], [s, c]])
        else:
            start["rotation"] = (old @ rotation).tolist()
        start["position"] = (at + old @ origin).tolist()


def other_order(scene: Content, random: np.random.Generator) -> None:
    for part in PARTS:
        if part in scene:
            scene[part] = [scene[part][i] for i in random.permutation(len(scene[part]))]


def other_way_round(scene: Content, random: np.random.Generator) -> None:
    """Hinges that nothing speaks of join their links the other way round; it changes the sign of their reactions and variables."""
    spoken_of = " ".join(str(scene.get(part, "")) for part in (*LEADS, "measures"))
    hinges = [joint for joint in scene["joint"] if joint["type"] == "revolute" and set(joint) == {"name", "type", "between"}
              and f"'{joint['name']}'" not in spoken_of]
    if not hinges:
        raise NotSo
    for joint in hinges:
        joint["between"].reverse()


def other_world(scene: Content, random: np.random.Generator) -> None:
    """World axes anywhere, in space."""
    if scene["space"] == "planar" or any("link" in c for c in scene["coordinate"]) or any(load.get("axes") != "link" for load in scene.get("load", [])):
        raise NotSo
    rotation, origin = turned(random), random.normal(size=3)
    write_markers(scene["frame"], rotation, origin)
    scene["gravity"] = (rotation.T @ np.array(scene.get("gravity", [0, 0, 0]), float)).tolist()
    for link in scene["link"]:
        start = link["start"]
        start["position"] = (rotation.T @ (np.array(start["position"]) - origin)).tolist()
        start["rotation"] = (rotation.T @ np.array(start["rotation"])).tolist()


def welded(scene: Content, random: np.random.Generator) -> None:
    """A part of the mass of each link is another link, welded to it."""
    for link in list(scene["link"]):
        if link["mass"] == 0:
            continue
        share = random.uniform(0.2, 0.8)
        other = {"name": f"{link['name']}_half", "cog": link.get("cog", [0, 0]), "mass": share * link["mass"]}
        link["mass"] *= 1 - share
        if scene["space"] == "planar":
            other["inertia"] = share * link.get("inertia", 0)
            link["inertia"] = link.get("inertia", 0) - other["inertia"]
        else:
            whole = np.array(elements(matrix(link["inertia"])))
            other["inertia"], link["inertia"] = (share * whole).tolist(), ((1 - share) * whole).tolist()
            other["cog"] = link.get("cog", [0, 0, 0])
        for half in (link, other):
            half.setdefault("markers", {})["seam"] = [0.1, 0.05, 0][: 2 if scene["space"] == "planar" else 3]
        scene["link"].append(other)
        scene["joint"].append({"name": f"{link['name']}_weld", "type": "fixed", "between": [f"{link['name']}.seam", f"{link['name']}_half.seam"]})


WAYS: tuple[Callable[[Content, np.random.Generator], None], ...] = (other_link_axes, other_order, other_way_round, other_world, welded)


def with_starts(content: Content) -> Content:
    """Links begin where they are: nothing is chosen by the axes that they are written in."""
    scene = linkdyn.Scene(content)
    poses = scene.poses()
    for link in content["link"]:
        i = scene.links.index(link["name"])
        place, rotation = poses.position[0, i], poses.rotation[0, i]
        link["start"] = ({"position": place[:2].tolist(), "angle": float(np.arctan2(rotation[1, 0], rotation[0, 0]))} if content["space"] == "planar"
                         else {"position": place.tolist(), "rotation": rotation.tolist()})
    return content


def inverse(content: Content) -> xr.Dataset:
    return linkdyn.Scene(content).inverse()


def forward(content: Content) -> xr.Dataset:
    return linkdyn.Scene(content).forward(t=np.linspace(0, 0.2, 5), rtol=1e-10, atol=1e-12)


def refused(run: Callable[[Content], xr.Dataset], content: Content) -> bool:
    """The scene is no scene for such a run."""
    try:
        run(content)
    except linkdyn.InputError:
        return True
    return False


def compare(run: xr.Dataset, other: xr.Dataset, tolerance: float) -> None:
    """What joints carry, in size, since it turns with the axes that it is told in; what drives do; where coordinates go."""
    np.testing.assert_array_equal(run.status, other.status)
    n = 2 if run.reaction.shape[-1] == 3 else 3
    pairs = [tuple(np.linalg.norm(x.reaction.sel(joint=run.joint.values).values[..., :n], axis=-1) for x in (run, other))]
    if "driving_force" in run:
        pairs.append(tuple(x.driving_force.sel(actuator=run.actuator.values).values for x in (run, other)))
    if "q" in run:
        pairs.append((run.q.values, other.q.values))
    for mine, theirs in pairs:
        assert np.abs(mine - theirs).max(initial=0) <= tolerance * max(np.abs(mine).max(initial=0), 1e-6)


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
@pytest.mark.parametrize("name", SCENES)
def test_said_otherwise(name: str, way: Callable[[Content, np.random.Generator], None], monkeypatch: pytest.MonkeyPatch) -> None:
    file = ROOT / (f"{name}/scene.toml" if name.startswith("examples") else f"{name}.toml")
    monkeypatch.chdir(file.parent)
    content = with_starts(tomllib.loads(file.read_text()) | {"time": {"start": 0.0, "end": 0.5, "samples": 11}})
    others = []
    for seed in range(2):
        others.append(copy.deepcopy(content))
        try:
            way(others[-1], np.random.default_rng([seed, 7]))
        except NotSo:
            pytest.skip("cannot be written this way")
    runs = [(run, tolerance) for run, tolerance in ((inverse, INVERSE), (forward, FORWARD)) if not refused(run, content)]
    assert runs
    for run, tolerance in runs:
        own = run(content)
        for other in others:
            compare(own, run(other), tolerance)


def test_rounding_is_no_arm() -> None:
    """The nut's pin lies on the screw's axis but for rounding, in most axes that its link may be written in. A forward run took that for the arm
    of a coordinate that does next to nothing, and exchanged the coordinate for another."""
    content = with_starts(tomllib.loads((ROOT / "tests" / "scenes" / "screw_loop.toml").read_text()))
    for seed in range(6):
        other = copy.deepcopy(content)
        other_link_axes(other, np.random.default_rng(seed))
        run = linkdyn.Scene(other).forward(t=[0, 0.1])
        assert run.attrs["coordinates_integrated"] == ""
