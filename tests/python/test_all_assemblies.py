"""All assemblies at the start: found, told, chosen again by the words that are told."""

from __future__ import annotations

import copy
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import linkdyn.plot
import numpy as np
import pytest
from test_chains import platform

pytestmark = pytest.mark.accuracy

ROOT = Path(__file__).resolve().parents[2]
RSSR = tomllib.loads((ROOT / "tests" / "scenes" / "rssr.toml").read_text())


def platform_on_cranks() -> linkdyn.Scene:
    """The hexapod of the patterns, on cranks and rods."""
    scene = tomllib.loads((ROOT / "tests" / "scenes" / "hexapod_pattern.toml").read_text())
    scene["chain"] = [{"type": "RUS", "repeat": 3, "about": "z", "mirror": "xz", "base": "frame.B#", "platform": "platform.P#", "axis": [0, 1, 0],
                       "zero": [1, 0, 0], "elbow": -1, "crank": {"length": 0.4, "mass": 1.0}, "rod": {"length": 1.0, "mass": 1.0}}]
    return linkdyn.Scene(scene)


def same(a: Any, b: Any) -> bool:
    """Two assemblies by the joint variables, but for whole turns."""
    return all(abs(np.exp(1j * a[k]) - np.exp(1j * b[k])) < 1e-9 if not k.endswith("slide") else abs(a[k] - b[k]) < 1e-9 for k in a)


def test_four_bar() -> None:
    """Two branches; the other one is what the scene has with its words."""
    content = tomllib.loads((ROOT / "examples" / "fourbar" / "scene.toml").read_text())
    found = linkdyn.Scene(content).assemblies()
    assert [one.number for one in found] == [1, 2] and found.is_complete
    (joint, first), = found[0].branch.items()
    assert found[1].branch == {joint: -first}
    again = linkdyn.Scene(found[1].apply(content)).assemblies()
    assert again[0].branch == found[1].branch
    assert same(again[0].joint_variable, found[1].joint_variable) and not same(again[0].joint_variable, found[0].joint_variable)


def test_rssr_has_two() -> None:
    """By the circle of the rocker's end and the sphere about the crank's: its two angles, whatever the rod's spin."""
    found = linkdyn.Scene(RSSR).assemblies()
    z = np.array([1.0, 0.2, 0.0])
    z /= np.linalg.norm(z)
    x = np.array([1 - z[0] ** 2 / (1 + z[2]), -z[0] * z[1] / (1 + z[2]), -z[0]])
    d = np.array([0.5, 0.2, 0.3]) - [0.2, 0.0, 0.0]
    r, rod = 0.6, 0.9
    u, v = 2 * r * d @ x, 2 * r * d @ np.cross(z, x)
    middle, half = np.arctan2(v, u), np.arccos((rod**2 - r**2 - d @ d) / np.hypot(u, v))
    expected = np.exp(1j * np.array([middle + half, middle - half]))
    angles = np.exp(1j * np.array([one.joint_variable["D.angle"] for one in found]))
    assert len(found) == 2
    np.testing.assert_allclose(np.sort_complex(angles), np.sort_complex(expected), atol=1e-12)
    other = linkdyn.Scene(found[1].apply(RSSR)).assemblies()
    assert same({"D": other[0].joint_variable["D.angle"]}, {"D": found[1].joint_variable["D.angle"]})


def test_every_one_closes() -> None:
    """Links are where the joints hold them: seen by the mechanism's own joint variables, in a Delta and a platform on cranks."""
    for scene in (linkdyn.new("delta"), platform_on_cranks()):
        found = scene.assemblies()
        assert len(found) > 1
        first = scene.poses(in_order=True)
        np.testing.assert_allclose(found[0].position, first.position[0], atol=1e-9)
        for one in found:
            for joint in scene.description["joints"]:
                ends = []
                for link, name in zip(joint["links"], joint["markers"]):
                    marker = next(m for m in scene.description["links"][link]["markers"] if m["name"] == name)
                    at = np.array(marker["at"])
                    ends.append(at if link == 0 else one.position[link - 1] + one.rotation[link - 1] @ at)
                assert np.abs(ends[0] - ends[1]).max() < 1e-9
        for i, a in enumerate(found):
            assert all(np.abs(a.position - b.position).max() > 1e-6 or np.abs(a.rotation - b.rotation).max() > 1e-6 for b in found[:i])


def test_words_beside_a_start_of_the_scene() -> None:
    """A platform on three cylinders whose place the scene tells, too: this pulled to another than the joints' starts chose."""
    feet, tops = [[-0.2, 0.1], [1.8, -0.1], [1.1, 1.5]], [[0.1, -0.1], [0.9, 0.0], [0.5, 0.9]]
    place, angle = np.array([0.4, 1.1]), -2.6
    turned = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    content: dict[str, Any] = {
        "space": "planar", "frame": {"markers": {f"A{i}": foot for i, foot in enumerate(feet)}}, "joint": [], "coordinate": [], "actuator": [],
        "link": [{"name": "platform", "mass": 2.0, "inertia": 0.1, "markers": {f"P{i}": top for i, top in enumerate(tops)},
                  "start": {"position": place.tolist(), "angle": angle}}],
    }
    for i, (foot, top) in enumerate(zip(feet, tops)):
        content["link"] += [{"name": f"{name}{i}", "mass": 1.0, "inertia": 0.1, "markers": {"A": [0, 0]}} for name in ("barrel", "rod")]
        content["joint"] += [{"name": f"A{i}", "type": "revolute", "between": [f"frame.A{i}", f"barrel{i}.A"]},
                             {"name": f"S{i}", "type": "prismatic", "between": [f"barrel{i}.A", f"rod{i}.A"]},
                             {"name": f"P{i}", "type": "revolute", "between": [f"rod{i}.A", f"platform.P{i}"]}]
        content["coordinate"].append({"joint": f"S{i}", "start": float(np.linalg.norm(place + turned @ top - foot))})
        content["actuator"].append({"joint": f"S{i}"})
    found = linkdyn.Scene(content).assemblies()
    assert len(found) == 4
    for one in found:
        told = one.place["platform"]
        assert len(told[0]) == 2 and "platform: start = { position = [" in one.words and "], angle = \"" in one.words
        again = linkdyn.Scene(one.apply(content)).assemblies()[0]
        np.testing.assert_allclose(again.position, one.position, atol=1e-9)


def test_loops_of_balls() -> None:
    """A plate on six rods between balls: nothing but links' starts can choose, and the words do."""
    feet = {f"B{i}": [np.cos(a), np.sin(a), 0.0] for i, a in enumerate(np.radians([5, 115, 125, 235, 245, 355]))}
    tops = {f"P{i}": [0.6 * np.cos(a), 0.6 * np.sin(a), 0.0] for i, a in enumerate(np.radians([55, 65, 175, 185, 295, 305]))}
    length = [np.linalg.norm(np.array(tops[f"P{i}"]) + [0.1, 0.05, 0.8] - feet[f"B{i}"]) for i in range(6)]
    content = {
        "space": "spatial", "gravity": [0.0, 0.0, -9.81], "frame": {"markers": feet | {"S": {"at": [0.0] * 3, "axis": [1, 0, 0]}}},
        "link": [{"name": "plate", "mass": 10.0, "inertia": {"diagonal": [1.0, 1.0, 2.0]}, "markers": tops, "start": {"position": [0.0, 0.0, 0.8]}},
                 {"name": "sled", "mass": 1.0, "inertia": {"diagonal": [0.1] * 3}, "markers": {"S": {"at": [0.0] * 3, "axis": [1, 0, 0]}, "B": feet["B0"]}}],
        "joint": [{"name": "S", "type": "prismatic", "between": ["frame.S", "sled.S"]}],
        "coordinate": [{"joint": "S", "start": 0.0}], "actuator": [{"joint": "S"}],
    }
    for i in range(6):
        content["link"].append({"name": f"rod{i}", "mass": 0.0, "markers": {"B": [0.0] * 3, "P": [float(length[i]), 0.0, 0.0]}})
        content["joint"] += [{"name": f"B{i}", "type": "spherical", "between": [f"{'sled.B' if i == 0 else f'frame.B{i}'}", f"rod{i}.B"]},
                             {"name": f"P{i}", "type": "spherical", "between": [f"rod{i}.P", f"plate.P{i}"]}]
    found = linkdyn.Scene(content).assemblies()
    assert len(found) >= 2
    for one in found:
        assert "plate: start = { position = [" in one.words
        again = linkdyn.Scene(one.apply(content)).assemblies()[0]
        np.testing.assert_allclose(again.position[0], one.position[0], atol=1e-6)
        np.testing.assert_allclose(again.rotation[0], one.rotation[0], atol=1e-6)


def read(name: str) -> dict[str, Any]:
    """A scene of the tests, or a template."""
    folders = (ROOT / "tests" / "scenes", ROOT / "tests" / "assemblies", ROOT / "python" / "linkdyn" / "_scenes")
    return tomllib.loads(next(path for folder in folders if (path := folder / f"{name}.toml").exists()).read_text())


def told(scene: dict[str, Any], words: str) -> dict[str, Any]:
    """A scene with words pasted as they are printed."""
    scene = copy.deepcopy(scene)
    for text in words.split("; "):
        name, _, entry = text.partition(": ")
        part = next(part for kind in ("link", "joint", "chain") for part in scene.get(kind, []) if part["name"] == name)
        if entry.startswith("branch"):
            part.pop("start", None)
        part |= tomllib.loads(entry)
    return scene


def turned(angle: float) -> np.ndarray:
    """About z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def written_out(scene: dict[str, Any]) -> dict[str, Any]:
    """Three chains of their own in place of one that is repeated, each to be told."""
    chain, = scene["chain"]
    scene["chain"] = [{**{key: value for key, value in chain.items() if key not in ("repeat", "about")},
                       "name": f"{chain['name']}{k}", "base": f"frame.B{k}", "platform": f"platform.P{k}",
                       **{key: (turned(2 * np.pi * (k - 1) / 3) @ chain[key]).tolist() for key in ("axis", "zero") if key in chain}} for k in (1, 2, 3)]
    return scene


def points(scene: linkdyn.Scene, at: Any) -> np.ndarray:
    """All markers in the world, but those of the frame."""
    return np.concatenate([at.position[i] + at.rotation[i] @ np.resize([*marker["at"], 0.0], 3)
                           for i, link in enumerate(scene.description["links"][1:]) for marker in link["markers"]])


CHAINS = ("delta", "delta_of_single_rods")
LOOPS = ("excavator", "fivebar_by_gears", "flat_cam_3d", "hexaglide", "mcpherson", "planar_platform", "platform_by_gear", "pus6_fold", "rsur", "scissor_by_stroke",
         "screw_loop", "wheel_by_coupler", "wishbone")


@pytest.mark.parametrize("name", [*CHAINS, *LOOPS])
def test_words_choose(name: str) -> None:
    """Each assembly has words of its own, which give it and no other when they are pasted into the scene, and when they are applied."""
    content = written_out(read(name)) if name in CHAINS else read(name)
    scene = linkdyn.Scene(content)
    found = scene.assemblies()
    places = [points(scene, one) for one in found]
    assert len(found) > 1 and len({one.words for one in found}) == len(found)
    for k, one in enumerate(found):
        for again in (told(content, one.words), one.apply(content)):
            there = points(scene, linkdyn.Scene(again).assemblies()[0])
            apart = [np.abs(place - there).max() for place in places]
            assert int(np.argmin(apart)) == k and apart[k] < 1e-5 * np.abs(there).max(), one.words


def test_elbows_of_copies_are_told_together() -> None:
    """A Delta's chain is written once for three arms, and its elbow counts besides the platform's start."""
    scene = read("delta")
    found = linkdyn.Scene(scene).assemblies()
    assert len(found) == 2 and all(f"arm{k}: elbow = -1" in found[1].words for k in (1, 2, 3))
    other = found[1].apply(scene)
    assert other["chain"][0]["elbow"] == -1
    np.testing.assert_allclose(linkdyn.Scene(other).assemblies()[0].position[0], found[1].position[0], atol=1e-9)


def test_legs_without_keys_are_told_by_their_joints() -> None:
    """A Tripteron's elbows leave the platform where it is, and its chains have no key for them: joints tell its assemblies apart."""
    found = linkdyn.load(ROOT / "examples" / "tripteron" / "scene.toml").assemblies()
    assert len({one.words for one in found}) == len(found) == 8
    assert not found[0].chain and "leg2.R2: start = { angle = " in found[0].words


def test_no_choice() -> None:
    """An open chain has one assembly, and no words."""
    one, = linkdyn.new("arm").assemblies()
    assert one.words == "" and one.number == 1


def test_command_and_picture(tmp_path: Path) -> None:
    """A table on the terminal, a sheet in a file; wrong words in one line."""
    scene = ROOT / "examples" / "fourbar" / "scene.toml"
    command = [sys.executable, "-c", "from linkdyn.cli import main; main()", "assemblies", str(scene)]
    sheet = tmp_path / "sheet.png"
    said = subprocess.run([*command, "--picture", str(sheet)], capture_output=True, text=True, timeout=60)
    assert said.returncode == 0 and said.stdout.count("branch = ") == 2 and sheet.stat().st_size > 5000
    for wrong, message in (([str(tmp_path / "none.toml")], "none.toml"), (["--picture", "sheet.doc"], "--picture: 'sheet.doc' (expected")):
        refused = subprocess.run([*command, *wrong], capture_output=True, text=True, timeout=60)
        assert refused.returncode == 2 and message in refused.stderr and refused.stderr.count("\n") == 1


@pytest.mark.usefixtures("closed_figures")
def test_sheet() -> None:
    """One panel an assembly."""
    scene = linkdyn.Scene(RSSR)
    figure, axes = linkdyn.plot.assemblies(scene)
    assert len(axes) == len(scene.assemblies()) == 2 and figure.axes[0].get_title() == "1"


# ---------------------------------------------------------------- forty postures

FEET = np.array([[0, 0, 0], [1.107915, 0, 0], [0.549094, 0.756063, 0], [0.735077, -0.223935, 0.525991], [0.514188, -0.526063, -0.368418],
                 [0.590473, 0.094733, -0.205018]])
HEADS = np.array([[0, 0, 0], [0.542805, 0, 0], [0.956919, -0.528915, 0], [0.665885, -0.353482, 1.402538], [0.478359, 1.158742, 0.107672],
                  [-0.137087, -0.235121, 0.353913]])
LENGTHS = np.array([1.0, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071])


def dietmaier() -> dict[str, Any]:
    """A platform led by the lengths of its legs that has as many postures as there can be (Dietmaier 1998)."""
    return {
        "space": "spatial", "gravity": [0, 0, 0], "frame": {"markers": {f"A{i + 1}": list(at) for i, at in enumerate(FEET)}},
        "link": [{"name": "platform", "mass": 1.0, "inertia": [1, 1, 1, 0, 0, 0], "markers": {f"B{i + 1}": list(at) for i, at in enumerate(HEADS)}}],
        "chain": [{"type": "UPS", "axis": [0.3, 0.2, 0.93], "lower": {"mass": 0}, "upper": {"mass": 0},
                   "base": [f"frame.A{i + 1}" for i in range(6)], "platform": [f"platform.B{i + 1}" for i in range(6)]}],
        "coordinate": [{"joint": f"leg{i + 1}.P", "start": float(length)} for i, length in enumerate(LENGTHS)]}


@pytest.mark.thorough
def test_forty_postures_of_a_platform() -> None:
    """All are found, no leg turned about itself makes another, and the platform's start chooses each."""
    content = dietmaier()
    found = linkdyn.Scene(content).assemblies()
    assert len(found) == 40
    for one in found:
        assert list(one.place) == ["platform"] and not one.branch and not one.start
        heads = one.position[0] + HEADS @ one.rotation[0].T
        np.testing.assert_allclose(np.linalg.norm(heads - FEET, axis=1), LENGTHS, rtol=1e-12)
    for i, a in enumerate(found):
        assert all(np.abs(a.position[0] - b.position[0]).max() + np.abs(a.rotation[0] - b.rotation[0]).max() > 1e-3 for b in found[:i])
    for one in found[::6]:
        again = linkdyn.Scene(one.apply(content)).poses(in_order=True)
        np.testing.assert_allclose(again.position[0, 0], one.position[0], atol=1e-9)
        np.testing.assert_allclose(again.rotation[0, 0], one.rotation[0], atol=1e-9)


def boom(leads: str) -> dict[str, Any]:
    """On a cylinder that is a chain, led by its stroke or by the boom's hinge."""
    return {
        "title": "boom", "space": "planar", "frame": {"markers": {"A": [0, 1], "P": [0.5, 0]}},
        "link": [{"name": "boom", "mass": 300, "cog": [2, 0], "inertia": 400, "markers": {"A": [0, 0], "Q": [1.5, 0]}}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "boom.A"]}],
        "chain": [{"type": "cylinder", "name": "ram", "base": "frame.P", "platform": "boom.Q", "actuated": False,
                   "barrel": {"mass": 20, "inertia": 1}, "rod": {"mass": 10, "inertia": 0.5}}],
        "coordinate": [{"joint": leads, "start": 1.5 if leads == "ram.P" else 0.3}],
    }


def test_a_branch_is_named_where_it_can_be_written() -> None:
    """Of a boom led by its cylinder's stroke at its hinge, for joints of a chain have no `branch`."""
    found = linkdyn.Scene(boom("ram.P")).assemblies()
    assert [list(one.branch) for one in found] == [["A"], ["A"]]
    for one in found:
        again = linkdyn.Scene(one.apply(boom("ram.P"))).assemblies()[0]
        assert again.branch == one.branch
        np.testing.assert_allclose(again.position, one.position, atol=1e-12)


def test_where_chains_have_no_branch_their_start_chooses() -> None:
    """A cylinder behind a boom that leads is drawn out one way or the other, as the key `start` of its chain says."""
    content = boom("A")
    found = linkdyn.Scene(content).assemblies()
    assert len(found) == 2 and not any(one.branch for one in found)
    for one in found:
        (name, value), = one.start.items()
        assert name == "ram.P.slide"
        content["chain"][0]["start"] = float(value)
        again = linkdyn.Scene(content).assemblies()[0]
        np.testing.assert_allclose(again.joint_variable["ram.P.slide"], value, atol=1e-12)


@pytest.mark.parametrize("elbow", [1, -1])
def test_where_cranks_have_no_branch_their_elbow_chooses(elbow: int) -> None:
    """What the word `start` says of the angle between crank and rod has the sign of the chain's `elbow`."""
    found = linkdyn.Scene(platform("RUS", elbow=elbow)).assemblies()
    assert len(found) == 64 and not any(one.branch for one in found)
    assert [np.sign(value) for value in found[0].start.values()] == [elbow] * 6
