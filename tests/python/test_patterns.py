"""Repeated and mirrored parts: a scene with them is the scene written out, mirrored machines have mirrored forces."""

from __future__ import annotations

import copy
import math
import subprocess
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w

import linkdyn
from linkdyn.cli import executable

SCENES = Path(__file__).resolve().parents[1] / "scenes"
HEXAPOD = tomllib.loads((SCENES / "hexapod_pattern.toml").read_text())
THREE_RRR = tomllib.loads((SCENES / "threerrr_pattern.toml").read_text())


def turned(by: float, point: list[float]) -> list[float]:
    """A point, or a direction, about z."""
    x, y, *z = point
    return [x * math.cos(by) - y * math.sin(by), x * math.sin(by) + y * math.cos(by), *z]


def same(one: linkdyn.Scene, other: linkdyn.Scene) -> None:
    """The same names, the same numbers to rounding."""
    assert one.links == other.links and one.joints == other.joints
    assert one.actuators == other.actuators and one.coordinates == other.coordinates
    a, b = one.inverse(), other.inverse()
    assert (a.status == 0).all() and (b.status == 0).all()
    for name in ("driving_force", "reaction", "joint_variable"):
        scale = np.abs(b[name]).max().item()
        np.testing.assert_allclose(a[name], b[name], rtol=0, atol=1e-12 * scale)


# ---- the same by hand


def hexapod_written_out() -> dict:
    scene = copy.deepcopy(HEXAPOD)
    del scene["variables"]
    base, platform = [], []
    for third in range(3):
        for side in (1, -1):
            for points, radius, angle in ((base, 0.9, 10), (platform, 0.5, 50)):
                at = [radius * math.cos(math.radians(angle)), side * radius * math.sin(math.radians(angle)), 0]
                points.append(turned(third * 2 * math.pi / 3, at))
    names = range(1, 7)
    scene["frame"]["markers"] = {f"B{i}": at for i, at in zip(names, base)}
    scene["link"][0]["markers"] = {f"P{i}": at for i, at in zip(names, platform)}
    del scene["chain"][0]["repeat"]
    scene["chain"][0] |= {"base": [f"frame.B{i}" for i in names], "platform": [f"platform.P{i}" for i in names]}
    return scene


def three_rrr_written_out() -> dict:
    scene = copy.deepcopy(THREE_RRR)
    del scene["variables"]
    base, crank, rod, plate = 0.6, 0.35, 0.4, 0.15
    turns = [k * 2 * math.pi / 3 for k in range(3)]
    scene["frame"]["markers"] = {f"A{k + 1}": turned(by, [base, 0]) for k, by in enumerate(turns)}
    elbow = [base + crank * math.cos(math.radians(150)), crank * math.sin(math.radians(150))]
    cranks, rods = [], []
    for k, by in enumerate(turns):
        cranks.append({
            "name": f"crank{k + 1}", "markers": {"A": [0, 0], "B": [crank, 0]}, "mass": 1.2, "cog": [crank / 2, 0.01], "inertia": 1.2 * crank**2 / 12,
            "start": {"position": turned(by, [base, 0]), "angle": math.radians(150) + by},
        })  # fmt: skip
        rods.append({
            "name": f"rod{k + 1}", "markers": {"B": [0, 0], "C": [rod, 0]}, "mass": 0.8, "cog": [rod / 2, 0], "inertia": 0.8 * rod**2 / 12,
            "start": {"position": turned(by, elbow), "angle": math.radians(-160) + by},
        })  # fmt: skip
    scene["link"] = [*cranks, *rods, scene["link"][2] | {"markers": {f"C{k + 1}": turned(by, [plate, 0]) for k, by in enumerate(turns)}}]
    pairs = {"A": "frame.A{} crank{}.A", "B": "crank{}.B rod{}.B", "C": "rod{}.C plate.C{}"}
    scene["joint"] = [
        {"name": f"{name}{k}", "type": "revolute", "between": between.format(k, k).split()} for name, between in pairs.items() for k in (1, 2, 3)
    ]
    scene["actuator"] = [{"joint": f"A{k}"} for k in (1, 2, 3)]
    scene["spring"] = [{"name": f"return{k}", "joint": f"A{k}", "stiffness": 2 * k, "rest": math.radians(140 + 5 * k)} for k in (1, 2, 3)]
    return scene


@pytest.mark.parametrize(("short", "long"), [(HEXAPOD, hexapod_written_out), (THREE_RRR, three_rrr_written_out)], ids=["hexapod", "3-RRR"])
def test_short_scenes_are_the_long_ones(short, long):
    same(linkdyn.Scene(short), linkdyn.Scene(long()))


def test_given_angles_and_other_axes():
    scene = copy.deepcopy(HEXAPOD)
    angles = [10, -10, 130, 110, 250, 230]
    scene["frame"]["markers"]["B"] = {"at": ["Rb", 0, 0], "about": [0, 0, 2], "angles": [f"{a} deg" for a in angles]}
    same(linkdyn.Scene(scene), linkdyn.Scene(HEXAPOD))


def markers_of(marker: dict, space: str = "spatial") -> list[dict]:
    """What the engine makes of one marker of the frame."""
    scene = copy.deepcopy(HEXAPOD if space == "spatial" else THREE_RRR)
    scene["frame"]["markers"]["M"] = marker
    return [m for m in linkdyn.Scene(scene).description["links"][0]["markers"] if m["name"].startswith("M")]


def test_markers_turn_with_their_axes():
    found = markers_of({"at": [1, 2, 3], "axis": [1, 0, 0], "about": "z", "repeat": 4})
    assert [m["name"] for m in found] == ["M1", "M2", "M3", "M4"]
    for k, (at, axis) in enumerate((([1, 2, 3], [1, 0, 0]), ([-2, 1, 3], [0, 1, 0]), ([-1, -2, 3], [-1, 0, 0]), ([2, -1, 3], [0, -1, 0]))):
        np.testing.assert_allclose(found[k]["at"], at, atol=1e-15)
        np.testing.assert_allclose(found[k]["axis"], axis, atol=1e-15)
    np.testing.assert_allclose(markers_of({"at": [1, 2, 3], "about": "x", "angles": ["90 deg"]})[0]["at"], [1, -3, 2], atol=1e-15)
    np.testing.assert_allclose(markers_of({"at": [1, 2, 3], "about": "y", "angles": ["90 deg"]})[0]["at"], [3, 2, -1], atol=1e-15)
    corner = markers_of({"at": [1, 0, 0], "about": [1, 1, 1], "repeat": 3})
    np.testing.assert_allclose([m["at"] for m in corner], np.eye(3), atol=1e-15)


@pytest.mark.parametrize(("plane", "sign"), [("yz", [-1, 1, 1]), ("xz", [1, -1, 1]), ("xy", [1, 1, -1])])
def test_markers_are_mirrored(plane, sign):
    first, image = markers_of({"at": [1, 2, 3], "axis": [0.6, 0, 0.8], "mirror": plane})
    np.testing.assert_array_equal(image["at"], np.array(first["at"]) * sign)
    np.testing.assert_array_equal(image["axis"], np.array(first["axis"]) * sign)


def mirrored_arm(side: str) -> dict:
    """An arm of two crooked links on the left, on the right, or both by `mirror`."""
    mirror = {"both": {"mirror": "xz"}, "left": {}, "right": {}}[side]
    repeat = {"repeat": 2} if side == "both" else {}
    y = -1 if side == "right" else 1
    tensor = lambda *t: [t[0], t[1], t[2], y * t[3], y * t[4], t[5]]  # noqa: E731
    number = "#" if side == "both" else ""
    return {
        "space": "spatial",
        "gravity": [0, 0, -9.81],
        "frame": {"markers": {"O": {"at": [0.1, 0.3 * y, 0], "axis": [1, 0.2 * y, 0.1]} | mirror}},
        "link": [
            {"name": "upper", "markers": {"O": {"at": [0, 0, 0], "axis": [1, 0, 0]}, "E": {"at": [0.1, 0.5 * y, 0], "axis": [0.3, 0.2 * y, 1]}},
             "mass": 3, "cog": [0.02, 0.2 * y, 0.03], "inertia": tensor(0.3, 0.2, 0.4, 0.03, -0.02, 0.01)} | mirror,
            {"name": "lower", "markers": {"E": {"at": [0, 0.1 * y, 0], "axis": [0, 0, 1]}},
             "mass": 2, "cog": [0.01, 0.3 * y, 0.02], "inertia": tensor(0.1, 0.05, 0.12, 0.01, 0.005, -0.004)} | mirror,
        ],
        "joint": [{"name": "S", "type": "revolute", "between": [f"frame.O{number}", f"upper{number}.O"]} | repeat,
                  {"name": "E", "type": "revolute", "between": [f"upper{number}.E", f"lower{number}.E"]} | repeat],
        "coordinate": [{"joint": f"{joint}{number}", "motion": {"law": "harmonic", "amplitude": f"{0.4 * y * gain} rad" if side != "both" else f"{0.4 * gain}*(3 - 2*#)",
                        "frequency": 3}} | repeat for joint, gain in (("S", 1), ("E", 1.5))],
        "actuator": [{"joint": f"{joint}{number}"} | repeat for joint in ("S", "E")],
        "time": {"end": 1, "samples": 7},
    }  # fmt: skip


def test_an_image_is_the_body_on_the_other_side():
    """Both at once against each alone, the one on the right written by hand."""
    both = linkdyn.Scene(mirrored_arm("both")).inverse()
    left, right = (linkdyn.Scene(mirrored_arm(side)).inverse() for side in ("left", "right"))
    for joint in ("S", "E"):
        for number, alone in ((1, left), (2, right)):
            together = both.sel(joint=f"{joint}{number}").reaction
            np.testing.assert_allclose(together, alone.sel(joint=joint).reaction, atol=1e-12 * float(np.abs(alone.reaction).max()))
    # Forces are mirrored vectors, moments mirrored the other way, angles and torques opposite.
    np.testing.assert_allclose(right.reaction, left.reaction * np.array([1, -1, 1, -1, 1, -1]), atol=1e-11)
    np.testing.assert_allclose(right.driving_force, -left.driving_force, atol=1e-11)
    assert float(np.abs(left.driving_force).max()) > 1


def test_starts_of_copies_are_turned_and_mirrored():
    """Loops closed near the start: both images on the assembly that is the image of the first's."""
    scene = copy.deepcopy(THREE_RRR)
    run = linkdyn.Scene(scene).inverse()
    values = run.joint_variable.values[0, :3]
    turns = np.diff(values) / (2 * math.pi / 3)
    np.testing.assert_allclose(turns - np.round(turns / 3) * 3, 1, atol=1e-9)    # in the middle all legs are alike


@pytest.mark.parametrize("angles", [[0.3, -0.5, 0.9], [0, math.pi / 2, 0.4], [2.5, -1.2, -3], [0.2, -math.pi / 2, 0]])
@pytest.mark.parametrize("mirror", [False, True])
def test_attitudes_of_starts(angles, mirror):
    """The start's rotation is that of the copy: told by the angles of a free joint that starts there."""
    scene = {
        "space": "spatial",
        "frame": {"markers": {"O": [0, 0, 0]}},
        "link": [{"name": "body", "markers": {"O": [0, 0, 0]}, "mass": 1, "inertia": [1, 1, 1, 0, 0, 0], "start": {"angles": angles}, "about": [1, 2, 2],
                  "angles": [0.7]} | ({"mirror": "yz"} if mirror else {})],
        "joint": [{"name": "J", "type": "spherical", "between": ["frame.O", "body#.O"], "repeat": 2 if mirror else 1}],
        "coordinate": [{"joint": "J#", "variable": v, "start": 0, "repeat": 2 if mirror else 1} for v in ("roll", "pitch", "yaw")],
    }  # fmt: skip
    assert len(linkdyn.Scene(scene).links) == (2 if mirror else 1)


def test_sweeps_and_changes_reach_all_copies():
    scene = linkdyn.Scene(THREE_RRR)
    heavier = scene.with_({"link.rod.mass": 1.6, "variables.plate": 0.12})
    masses = {link["name"]: link["mass"] for link in heavier.description["links"]}
    assert masses["rod1"] == masses["rod2"] == masses["rod3"] == 1.6
    content = THREE_RRR | {"sweep": {"axis": [{"parameter": "link.rod.mass", "values": [0.8, 1.6]}, {"time": True, "linspace": [0, 0.4, 5]}]}}
    swept = linkdyn.Scene(content).sweep()
    by_hand = linkdyn.Scene(THREE_RRR).with_({"link.rod.mass": 1.6}).inverse(t=np.linspace(0, 0.4, 5))
    np.testing.assert_allclose(swept.driving_force_max.values[-1], by_hand.driving_force.max(axis=0), rtol=1e-9)


# ---- refusals


@pytest.mark.parametrize(
    ("path", "value", "fragment"),
    [
        (("link", 0, "repeat"), 0, "key 'repeat' = 0 (expected 1 to 1000)"),
        (("link", 0, "repeat"), 1_000_000_000, "expected 1 to 1000"),
        (("link", 0, "repeat"), -3, "expected 1 to 1000"),
        (("link", 0, "repeat"), 2.5, "is not an integer"),
        (("link", 0, "repeat"), "3", "is a string (expected an integer)"),
        (("link", 0, "about"), "w", "key 'about' = 'w' is unknown"),
        (("link", 0, "about"), [0, 0, 1], "key 'about' is a list"),
        (("link", 0, "mirror"), "xy", "key 'mirror' = 'xy' is unknown (expected one of 'yz', 'xz')"),
        (("link", 0, "angles"), ["10 deg"], "has 1 elements (expected 3, as many as 'repeat')"),
        (("link", 0, "angles"), ["10 mm"] * 3, "is a length (expected an angle"),
        (("link", 2, "about"), "z", "missing key 'repeat'"),
        (("joint", 0, "about"), "z", "unknown key 'about'"),
        (("joint", 0, "between"), ["frame.A", "crank#.A"], "did you mean 'A1'?"),
        (("joint", 0, "between"), ["frame.A#", "crank##.A"], "there is no link 'crank11'"),
        (("joint", 0, "repeat"), 4, "link 'frame' has no marker 'A4'"),
        (("joint", 0, "name"), "x" * 64, "is too long"),
        (("joint", 1, "name"), "A", "there is another joint of that name"),
        (("frame", "markers", "A"), {"at": [1, 0], "repeat": 3}, "missing key 'about'"),
        (("frame", "markers", "A1"), [1, 0], "there is another marker 'A1'"),
        (("frame", "markers", "A"), {"at": [1, 0], "repeat": 3, "about": "z", "mirorr": "xz"}, "unknown key 'mirorr'"),
        (("spring", 0, "stiffness"), "2 N*m/rad*(3 - #)", "'2 N*m/rad*(3 - 1)*1 s' is something"),
        (("spring", 0, "rest"), "1 deg/(3 - #)", "'1 deg/(3 - 3)' divides by zero"),
        (("time",), {"end": 1, "repeat": 2}, "unknown key 'repeat'"),
    ],
)  # fmt: skip
def test_bad_patterns_are_refused_in_one_line(path, value, fragment, tmp_path):
    scene = copy.deepcopy(THREE_RRR)
    table = scene
    for key in path[:-1]:
        table = table[key]
    table[path[-1]] = value
    if fragment.startswith("'2 N"):
        scene["spring"][0]["stiffness"] = "2 N*m/rad*(3 - #)*1 s"
    with pytest.raises(linkdyn.SceneError) as caught:
        linkdyn.Scene(scene)
    assert fragment in str(caught.value) and "\n" not in str(caught.value)
    file = tmp_path / "scene.toml"
    file.write_text(tomli_w.dumps(scene))
    result = subprocess.run([executable(), "explain", file], capture_output=True, text=True, timeout=30)
    assert result.returncode == 2 and result.stderr.count("\n") == 1 and fragment in result.stderr


def test_a_mesh_is_not_mirrored():
    scene = mirrored_arm("both")
    scene["link"][0]["mesh"] = "arm.stl"
    with pytest.raises(linkdyn.SceneError, match="key 'mesh' cannot be mirrored"):
        linkdyn.Scene(scene)


def crooked(mass: float, **more: float) -> dict:
    """No principal axis of it lies along its own."""
    return {"mass": mass, "cog": [0.03, -0.05, 0.11], "inertia": [0.05, 0.06, 0.04, 0.011, -0.007, 0.009], **more}


def bent(mass: float, **more: float) -> dict:
    return {"mass": mass, "cog": [0.11, 0.04], "inertia": 0.05, **more}


SKEW = [0.3, 1, 0.2]
LEGS = {
    "UPS": {"axis": SKEW, "lower": crooked(2), "upper": crooked(1)},
    "UCU": {"axis": SKEW, "top_axis": [1, 0.2, 0.1], "lower": crooked(2), "upper": crooked(1)},
    "PUS": {"axis": SKEW, "rail": [0.1, 0.2, 1], "carriage": crooked(2), "rod": crooked(1, length=1.1)},
    "RUS": {"axis": SKEW, "zero": [1, 0.1, 0.1], "elbow": 1, "crank": crooked(2, length=0.4), "rod": crooked(1, length=1.1)},
    # their hinges keep the platform's point in a plane
    "RPS": {"axis": [0.6, 0.8, 0], "lower": crooked(2), "upper": crooked(1)},
    "PRS": {"axis": [0.6, 0.8, 0], "rail": [0.8, -0.6, 0.5], "carriage": crooked(2), "rod": crooked(1, length=1.1)},
    "RRS": {"axis": [0.6, 0.8, 0], "zero": [0.8, -0.6, 0.1], "elbow": 1, "crank": crooked(2, length=0.4), "rod": crooked(1, length=1.1)},
    # in the plane
    "RRR": {"elbow": 1, "crank": bent(2, length=0.5), "rod": bent(1, length=1.1)},
    "PRR": {"rail": [0.3, 1], "carriage": bent(2), "rod": bent(1, length=1.1)},
    "RPR": {"lower": bent(2), "upper": bent(1)},
}


def on_leg_and_image(kind: str) -> dict:
    """A body that slides across and up, on a leg; and all of it mirrored."""
    planar, is_held = kind in ("RRR", "PRR", "RPR"), kind in ("RPS", "PRS", "RRS")
    mirror = {"mirror": "yz" if planar else "xz"}
    across, up, nowhere = ([1, 0], [0, 1], [0, 0]) if planar else ([0.6, 0.8, 0], [0, 0, 1], [0, 0, 0])
    body = {"mass": 3, "inertia": 0.1 if planar else {"diagonal": [0.1, 0.1, 0.1]}, **mirror}
    wave = {"law": "harmonic", "amplitude": 0.1, "phase": 0.4, "frequency": 3}
    return {
        "space": "planar" if planar else "spatial",
        "gravity": [0, -9.81] if planar else [1.5, 0, -9.81],
        "frame": {"markers": {"A": {"at": [0.9, 0.9] if planar else [0.82, 0.16, 1.05], "axis": across, **mirror},
                              "B": {"at": [0.5, 0.1] if planar else [0.5, 0.4, 0.1], **mirror}}},
        "link": [{"name": "sledge", "markers": {"A": {"at": nowhere, "axis": across}, "Z": {"at": nowhere, "axis": up}}, **body},
                 {"name": "lift", "markers": {"Z": {"at": nowhere, "axis": up}, "P": nowhere}, **body}],
        "joint": [{"name": "A#", "type": "prismatic", "between": ["frame.A#", "sledge#.A"], "repeat": 2},
                  {"name": "Z#", "type": "prismatic", "between": ["sledge#.Z", "lift#.Z"], "repeat": 2}],
        "chain": [{"type": kind, "base": "frame.B#", "platform": "lift#.P", **LEGS[kind], **mirror}],
        "coordinate": [{"joint": f"{joint}#", "repeat": 2, "motion": wave} for joint in ("Z" if is_held else "AZ")],
        "actuator": [] if is_held else [{"joint": "A#", "repeat": 2}],
        "time": {"end": 2, "samples": 11},
    }  # fmt: skip


@pytest.mark.parametrize("kind", LEGS)
def test_an_image_of_a_leg_has_its_masses_on_the_other_side(kind):
    run = linkdyn.Scene(on_leg_and_image(kind)).inverse()
    assert not run.status.any()
    drives = [[name for name in map(str, run.actuator.values) if name.startswith(f"leg{i}")] for i in (1, 2)]
    forces = [np.abs(run.driving_force.sel(actuator=names)) for names in drives]
    np.testing.assert_allclose(forces[1], forces[0], rtol=1e-9)
    for part in "FM":
        components = [name for name in map(str, run.component.values) if name.startswith(part)]
        sizes = np.sqrt((run.reaction.sel(component=components) ** 2).sum("component"))
        alike = [[f"A{i}", f"Z{i}", *(name for name in map(str, run.joint.values) if name.startswith(f"leg{i}."))] for i in (1, 2)]
        np.testing.assert_allclose(sizes.sel(joint=alike[1]), sizes.sel(joint=alike[0]), atol=1e-9 * float(sizes.max()))


def test_carriages_turn_with_their_legs():
    """Three legs about the vertical, under a platform that rises: their rails bear the same moments."""
    leg = {"type": "PUS", "rail": [0, 0, 1], "axis": [0, 1, 0], "carriage": crooked(2), "rod": {"length": 0.9, "mass": 1}}
    scene = {
        "space": "spatial",
        "gravity": [0, 0, -9.81],
        "frame": {"markers": {"B": {"at": [0.8, 0, 0], "repeat": 3, "about": "z"}, "C": {"at": [0.8, 0.1, 0], "repeat": 3, "about": "z"}}},
        "link": [{"name": "top", "mass": 5, "inertia": [0.2, 0.2, 0.3, 0, 0, 0],
                  "markers": {"P": {"at": [0.3, 0.2, 0], "repeat": 3, "about": "z"}, "Q": {"at": [0.3, -0.2, 0], "repeat": 3, "about": "z"}}}],
        "chain": [{"name": f"{n}#", "base": f"frame.{b}#", "platform": f"top.{p}#", "repeat": 3, "about": "z", **leg} for n, b, p in (("r", "B", "P"), ("l", "C", "Q"))],
        "coordinate": [{"link": "top", "motion": {"z": {"law": "harmonic", "mean": 0.7, "amplitude": 0.1, "frequency": 2}}}],
        "time": {"end": 2, "samples": 5},
    }  # fmt: skip
    run = linkdyn.Scene(scene).inverse()
    assert not run.status.any()
    for n in "rl":
        wrench = run.reaction.sel(joint=[f"{n}{i}.P" for i in (1, 2, 3)]).values
        for across in (wrench[..., :2], wrench[..., 3:5]):
            sizes = np.linalg.norm(across, axis=2)
            np.testing.assert_allclose(sizes, np.broadcast_to(sizes[:, :1], sizes.shape), rtol=1e-9)
            assert sizes.min() > 0.01
