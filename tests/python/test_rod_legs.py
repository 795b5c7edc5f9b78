"""Cranks and carriages with a rod between two known links, closed by formulas: roots by other roads, both branches, the ends of
their reach, by name and link by link."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from cross_checks import agrees_with_itself
from scipy.spatial.transform import Rotation
from test_chains import platform

pytestmark = pytest.mark.accuracy

FILE = Path(__file__).parents[1] / "scenes" / "legs_with_rods.toml"
#: of the legs that the scene writes link by link: first, inner and outer joint
LEGS = {"R3": ("S3", "U3"), "P4": ("S4", "U4"), "R5": ("U5", "S5"), "P6": ("U6", "S6")}


def written() -> dict[str, Any]:
    return tomllib.loads(FILE.read_text())


def marker(scene: dict[str, Any], name: str) -> tuple[str, np.ndarray, np.ndarray]:
    """Link, point and frame of a marker."""
    link, name = name.split(".")
    markers = scene["frame"]["markers"] if link == "frame" else next(one for one in scene["link"] if one["name"] == link)["markers"]
    spec = markers[name]
    if isinstance(spec, list):
        return link, np.array(spec), np.eye(3)
    z = np.array(spec["axis"]) / np.linalg.norm(spec["axis"])
    x = np.array(spec.get("x", [0.9, 0.1, 0.2]))     # where it is left out nothing hangs on it here
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return link, np.array(spec["at"]), np.column_stack([x, np.cross(z, x), z])


def roots(scene: dict[str, Any], first: str, stand: dict[str, tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Both values of a leg's first variable at which its rod has its length: of E's distance from P, as it depends on the variable,
    three values tell all."""
    joint = {one["name"]: one for one in scene["joint"]}
    inner, outer = LEGS[first]
    lead = next(name.split(".")[0] for name in joint[inner]["between"] if not name.startswith("rod"))
    end_of_lead = next(marker(scene, name)[1] for name in joint[inner]["between"] if not name.startswith("rod"))
    rod = [next(marker(scene, name)[1] for name in joint[j]["between"] if name.startswith("rod")) for j in (inner, outer)]
    length = np.linalg.norm(rod[1] - rod[0])
    top, point, _ = next(marker(scene, name) for name in joint[outer]["between"] if not name.startswith("rod"))
    p = stand[top][0] + stand[top][1] @ point
    (link1, at1, frame1), (_, at2, frame2) = (marker(scene, name) for name in joint[first]["between"])

    def excess(variable: float) -> float:
        turn = Rotation.from_euler("z", variable if first[0] == "R" else 0.0).as_matrix()
        slide = np.array([0.0, 0.0, 0.0 if first[0] == "R" else variable])
        if link1 == lead:                             # the known link is the second
            base, at, frame, own_at, own_frame = joint[first]["between"][1].split(".")[0], at2, frame2, at1, frame1
            turn, slide = turn.T, -slide
        else:
            base, at, frame, own_at, own_frame = link1, at1, frame1, at2, frame2
        in_base = at + frame @ (slide + turn @ own_frame.T @ (end_of_lead - own_at))
        e = stand[base][0] + stand[base][1] @ in_base
        return float((p - e) @ (p - e) - length**2)

    if first[0] == "R":
        f = np.array([excess(k * 2 * np.pi / 3) for k in range(3)])
        turned = np.exp(-2j * np.pi / 3 * np.arange(3))
        wave = 2 / 3 * f @ turned                     # f = mean + Re(wave conj) ..
        across = np.arccos(-f.mean() / abs(wave))
        return np.array([-np.angle(wave) + across, -np.angle(wave) - across])
    f = [excess(x) for x in (-1.0, 0.0, 1.0)]
    return np.roots([(f[0] + f[2]) / 2 - f[1], (f[2] - f[0]) / 2, f[1]])


def stands(scene: linkdyn.Scene, poses: linkdyn.Poses, k: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    known = {name: (poses.position[k, i], poses.rotation[k, i]) for i, name in enumerate(scene.links)}
    return known | {"frame": (np.zeros(3), np.eye(3))}


def off(a: Any, b: Any, joint: str) -> Any:
    """Difference of two variables, of angles within half a turn."""
    return np.angle(np.exp(1j * (a - b))) if joint[0] == "R" else a - b


def test_roots_by_another_road() -> None:
    """Along the motion each crank and carriage is at one of the two roots, and always at the same one of both."""
    scene = linkdyn.Scene(FILE)
    run = scene.inverse(want="all")
    poses = scene.poses(q=scene.motion()[0])
    assert (run.status == 0).all()
    for first in LEGS:
        name = next(str(v) for v in run.variable.values if str(v).startswith(first + "."))
        value = run.joint_variable.sel(variable=name).values
        found = np.array([roots(written(), first, stands(scene, poses, k)) for k in range(len(value))])
        assert np.isreal(found).all()
        gap = np.abs(off(found.real, value[:, None], first))
        assert gap.min(axis=1).max() < 1e-13
        assert gap.max(axis=1).min() > 0.1
        assert np.abs(np.diff(value)).max() < 0.05


def test_forces_and_rates() -> None:
    """Power is in balance, solvers agree, rates are what differences of places say."""
    scene = linkdyn.Scene(FILE)
    text = scene.explain()
    assert text.count(": closed form") == 6 and "Newton" not in text
    assert "RSU leg crank3, rod3 between frame and platform: closed form" in text
    agrees_with_itself(scene, step=1e-5, within=1e-9)


@pytest.mark.parametrize("first", LEGS)
def test_branch_chooses(first: str) -> None:
    """Both branches, as the words for them say; the rest of the mechanism does not care."""
    inner, _ = LEGS[first]
    at = {}
    for branch in (1, -1):
        content = written()
        next(joint for joint in content["joint"] if joint["name"] == inner)["branch"] = branch
        scene = linkdyn.Scene(content)
        q = scene.motion([0.0])[0]
        run = scene.inverse(q=q, want="all")
        poses = scene.poses(q=q)
        assert run.status[0] == 0
        for other in LEGS:
            name = next(str(v) for v in run.variable.values if str(v).startswith(other + "."))
            value = float(run.joint_variable.sel(variable=name)[0])
            assert np.abs(off(roots(content, other, stands(scene, poses, 0)), value, other)).min() < 1e-13
            if other == first:
                at[branch] = value
    sense = -1 if first in ("R3", "P4") else 1        # their leads are the joints' first links
    if first[0] == "P":
        assert sense * at[1] > sense * at[-1] + 0.1
    else:
        assert abs(off(at[1], at[-1], first)) > 0.1


def test_branch_elsewhere_is_refused() -> None:
    content = written()
    next(joint for joint in content["joint"] if joint["name"] == "U3")["branch"] = 1
    with pytest.raises(ValueError, match="joint 'U3': 'branch' has no meaning here"):
        linkdyn.Scene(content)


@pytest.mark.parametrize("kind", ["RUS", "PUS", "RSS", "PSS"])
def test_there_and_back(kind: str) -> None:
    """Led by its drives the platform, then closed by iteration, comes back to the poses that led it."""
    scene = linkdyn.Scene(platform(kind))
    q = scene.motion()[0]
    drive = "R.angle" if kind[0] == "R" else "P.slide"
    run = scene.inverse(want="all")
    led = [run.joint_variable.sel(variable=f"leg{k}.{drive}").values for k in range(1, 7)]
    back = platform(kind)
    back["coordinate"] = [{"joint": f"leg{k}.{drive[0]}", "start": float(led[k - 1][0])} for k in range(1, 7)]
    back["link"][0]["start"] = {"position": q[0, :3].tolist(), "angles": q[0, 3:].tolist()}
    poses = linkdyn.Scene(back).poses(q=np.column_stack(led))
    assert (poses.status == 0).all()
    np.testing.assert_allclose(poses.position[:, 0], q[:, :3], rtol=0, atol=1e-12)
    turned = Rotation.from_matrix(poses.rotation[:, 0]).as_matrix() - Rotation.from_euler("XYZ", q[:, 3:]).as_matrix()
    assert np.abs(turned).max() < 1e-12


@pytest.mark.parametrize("kind", ["RUS", "PSS"])
def test_out_of_reach(kind: str) -> None:
    """Beyond the reach of a leg a pose is `unreachable`, just before it is not, and the words name the leg; samples on their own and
    along a motion."""
    content = platform(kind)
    scene = linkdyn.Scene(content)
    height = np.linspace(0.8, 1.4, 601) if kind == "RUS" else None
    q = np.zeros((601, 6))
    q[:, 2] = 0.8
    if kind == "RUS":
        q[:, 2] = height
        base, top = 0.9 * np.array([np.cos(np.radians(10)), np.sin(np.radians(10))]), 0.5 * np.array([np.cos(np.radians(50)), np.sin(np.radians(50))])
        x, y = top - base                             # hinge along y of leg 1: rod and crank in line at the highest
        reach = np.sqrt((0.3 + np.sqrt(0.9**2 - y**2)) ** 2 - x**2)
        can = q[:, 2] < reach
    else:
        q[:, 0] = np.linspace(0.0, 0.6, 601)
        base = 0.9 * np.array([[np.cos(a), np.sin(a)] for a in np.radians([10, 130, 250, -10, 110, 230])])
        top = 0.5 * np.array([[np.cos(a), np.sin(a)] for a in np.radians([50, 170, 290, -50, 70, 190])])
        can = np.array([np.linalg.norm(top + [x, 0] - base, axis=1).max() < 0.9 for x in q[:, 0]])
    assert can.any() and not can.all()
    for order in (np.arange(601), np.random.default_rng(2).permutation(601)):
        run = scene.inverse(q=q[order])
        codes = {meaning: code for code, meaning in enumerate(run.status.attrs["flag_meanings"].split())}
        assert ((run.status.values == codes["ok"]) == can[order]).all()
        assert (run.status.values[~can[order]] == codes["unreachable"]).all()


def dead_points(n: int) -> tuple[linkdyn.Scene, np.ndarray, tuple[np.ndarray, ...]]:
    """A crank led by the slide behind its rod, which goes through its dead points: the motion of a crank that turns evenly."""
    r, length = 0.3, 0.8
    scene = linkdyn.Scene({
        "title": "slide that leads a crank", "space": "spatial", "gravity": [0, 0, -9.81],
        "frame": {"markers": {"A": {"at": [0, 0, 0], "axis": [0, 0, 1], "x": [1, 0, 0]}, "G": {"at": [0, 0, 0.1], "axis": [1, 0, 0], "x": [0, 1, 0]}}},
        "link": [
            {"name": "crank", "mass": 1.0, "cog": [0.1, 0, 0], "inertia": {"diagonal": [0.01, 0.01, 0.01]},
             "markers": {"A": {"at": [0, 0, 0], "axis": [0, 0, 1], "x": [1, 0, 0]}, "E": [r, 0, 0]}},
            {"name": "rod", "mass": 0.5, "cog": [0, 0, 0.4], "inertia": {"diagonal": [0.03, 0.03, 0.0]}, "inertia_check": False,
             "markers": {"E": [0, 0, 0], "P": [0, 0, length]}},
            {"name": "piston", "mass": 2.0, "inertia": {"diagonal": [0.01, 0.01, 0.01]},
             "markers": {"G": {"at": [0, 0, 0], "axis": [1, 0, 0], "x": [0, 1, 0]}, "P": [0, 0, 0]}},
        ],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"], "start": 1.0},
            {"name": "E", "type": "spherical", "between": ["crank.E", "rod.E"]},
            {"name": "P", "type": "spherical", "between": ["rod.P", "piston.P"]},
            {"name": "G", "type": "prismatic", "between": ["frame.G", "piston.G"]},
        ],
        "coordinate": [{"joint": "G", "start": r * np.cos(1.0) + np.sqrt(length**2 - 0.01 - (r * np.sin(1.0)) ** 2)}],
        "actuator": [{"joint": "G"}],
    })
    angle = np.linspace(1.0, 1.0 + 4 * np.pi, n)
    root = np.sqrt(length**2 - 0.01 - (r * np.sin(angle)) ** 2)
    q = r * np.cos(angle) + root
    slope = -r * np.sin(angle) - r**2 * np.sin(angle) * np.cos(angle) / root
    bend = np.gradient(slope, angle, edge_order=2)
    return scene, angle, (q[:, None], slope[:, None], bend[:, None])


@pytest.mark.parametrize("n", [401, 1000])
def test_through_dead_points(n: int) -> None:
    """Right or flagged: with the rates of a crank that turns on, that goes on through its dead points, where both roots meet."""
    scene, angle, motion = dead_points(n)
    run = scene.inverse(*motion, want="all", in_order=True)
    ok = run.status.values == 0
    turned = run.joint_variable.sel(variable="A.angle").values
    assert ok.mean() > 0.9
    apart = np.abs(off(turned, angle, "R"))[ok]
    mirrored = np.abs(off(turned, -angle, "R"))[ok]
    assert np.minimum(apart, mirrored).max() < 1e-6   # one of both roots, to what the slide tells near its dead points
    jump = np.abs(off(turned[1:], turned[:-1], "R"))[ok[1:] & ok[:-1]]
    assert jump.max() < 2.5 * (angle[1] - angle[0])


def test_written_otherwise() -> None:
    """The joints count, not how they are written: markers exchanged, links in other axes, the same forces."""
    content = written()
    other = copy.deepcopy(content)
    for joint in other["joint"]:
        if joint["type"] == "spherical":
            joint["between"].reverse()
    a, b = linkdyn.Scene(content).inverse(), linkdyn.Scene(other).inverse()
    np.testing.assert_allclose(a.driving_force, b.driving_force, rtol=0, atol=1e-12 * float(np.abs(a.driving_force).max()))


def test_singularity_distance() -> None:
    """Of the slide that leads a crank how far it is from its outer dead point; platforms on legs with rods alone have one, too."""
    scene = dead_points(3)[0]
    gap = np.geomspace(1e-3, 1e-7, 9)
    run = scene.inverse(q=(0.3 + np.sqrt(0.8**2 - 0.01) - gap)[:, None], want="singularity_distance")
    assert (run.status == 0).all()
    np.testing.assert_allclose(run.singularity_distance / gap, 1, rtol=0, atol=2e-2)
    for kind in ("RUS", "PSS"):
        still = linkdyn.Scene(platform(kind)).inverse(q=[[0.0, 0.0, 0.8, 0.0, 0.0, 0.0]], want="singularity_distance")
        assert still.status[0] == 0 and 0 < still.singularity_distance.item() < 2
