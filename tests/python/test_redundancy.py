"""More constraints and more drives than needed: reactions by least squares and by elasticity of our own, from poses and told joints alone."""

from __future__ import annotations

import copy
import itertools
import subprocess
from collections.abc import Sequence
from typing import Any

import linkdyn
import numpy as np
import pytest
import tomli_w
from linkdyn.cli import executable, quadruple_twin
from numpy.typing import NDArray
from test_redundancy_words import CORNERS, Z, loop

pytestmark = pytest.mark.accuracy

Array = NDArray[np.float64]
GRAVITY = [0.0, 0.0, -9.81]
# forces and moments that a joint holds, by axes of its first marker, z along its axis; of universal joints across both of theirs
HELD = {"revolute": ([0, 1, 2], [0, 1]), "spherical": ([0, 1, 2], []), "cylindrical": ([0, 1], [0, 1]), "prismatic": ([0, 1], [0, 1, 2]),
        "universal": ([0, 1, 2], [2])}
SUFFICIENT = 1e-12    # of the largest reaction: closed by iteration to 1e-13, least squares of some hundred equations
ELASTIC = 1e-9        # stiffnesses of bearings and the whole differ by some thousand


# ---------------------------------------------------------------- mechanisms


def hinges(points: Sequence[Any], axes: Sequence[Any], kinds: Sequence[str] | None = None, rate: float = 0.3) -> dict[str, Any]:
    """A loop of links between joints at these points, their mass off the loop."""
    scene = loop(list(kinds or ["revolute"] * len(points)), [[float(x) for x in p] for p in points], [[float(x) for x in a] for a in axes])
    scene["gravity"] = GRAVITY
    for i, link in enumerate(scene["link"]):
        link["mass"] = 1.0 + i
        link["cog"] = [0.05 + 0.01 * i, -0.03, 0.02 * (i + 1)]
        link["inertia"] = [0.01 + 0.001 * i, 0.02, 0.015, 0.001, 0.0, -0.002]
    scene["coordinate"][0]["motion"] = {"law": "constant-rate", "start": 0.0, "rate": rate}
    return scene


def bennett_frames(first: float, lengths: tuple[float, float], twists: tuple[float, float]) -> list[Array]:
    """Of Bennett's loop the frames of its hinges: z along the hinge, x along the link to the next one. Opposite links are alike."""
    assert lengths[0] / np.sin(twists[0]) == pytest.approx(lengths[1] / np.sin(twists[1]), rel=1e-14)
    second = 2 * np.arctan(np.sin(sum(twists) / 2) / np.sin((twists[1] - twists[0]) / 2) / np.tan(first / 2))
    pose, frames = np.eye(4), []
    for turn, length, twist in zip((first, second, -first, -second), lengths * 2, twists * 2, strict=True):
        c, s = np.cos(turn), np.sin(turn)
        pose = pose @ np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        frames.append(pose)
        c, s = np.cos(twist), np.sin(twist)
        pose = pose @ np.array([[1, 0, 0, length], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])
    assert np.abs(pose - np.eye(4)).max() < 3e-15
    return frames


ACROSS = 0.3, 0.5                                                               # lengths of Bennett's links
TWISTS = float(np.radians(30)), float(np.arcsin(0.5 / 0.3 * np.sin(np.radians(30))))


def hinges_of(frames: Sequence[Array]) -> dict[str, Any]:
    return hinges([frame[:3, 3] for frame in frames], [frame[:3, 2] for frame in frames])


def bennett(first: float = 50.0) -> dict[str, Any]:
    """Bennett's loop: opposite links alike, a/sin(alpha) = b/sin(beta); its first angle in degrees."""
    return hinges_of(bennett_frames(np.radians(first), ACROSS, TWISTS))


def goldberg() -> dict[str, Any]:
    """Goldberg's five hinges: two of Bennett's loops, two links of which are made one; the link that they shared is not needed then."""
    one = bennett_frames(np.radians(50), ACROSS, TWISTS)
    twist = np.radians(70)
    other = bennett_frames(np.radians(80), (ACROSS[1], ACROSS[1] / np.sin(TWISTS[1]) * np.sin(twist)), (TWISTS[1], twist))
    other = [one[1] @ np.linalg.inv(other[0]) @ frame for frame in other]
    return hinges_of([one[0], other[3], other[2], one[2], one[3]])


def sarrus() -> dict[str, Any]:
    """Sarrus' linkage: two legs of three parallel hinges, square to each other, lift a platform straight up."""
    height, length, width = 0.5, 0.4, 0.3
    out = width + np.sqrt(length**2 - (height / 2) ** 2)
    points = [[0, width, 0], [0, out, height / 2], [0, width, height], [width, 0, height], [out, 0, height / 2], [width, 0, 0]]
    return hinges(points, [[1, 0, 0]] * 3 + [[0, 1, 0]] * 3)


def spherical() -> dict[str, Any]:
    """Four hinges whose axes meet in a point."""
    angles = np.array([(0, 0.1), (0.5, 0.6), (1.3, 1.1), (2.2, 0.9)])
    axes = [[np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)] for u, v in angles]
    return hinges(0.3 * np.array(axes), axes)


def slider() -> dict[str, Any]:
    """A slider-crank of a plane, drawn in space."""
    return hinges([[0, 0, 0], [0.2, 0.3, 0], [0.9, 0, 0], [1.5, 0, 0]], [Z, Z, Z, [1, 0, 0]], ["revolute"] * 3 + ["prismatic"])


def shaft() -> dict[str, Any]:
    """Two bearings on one axis."""
    scene = hinges([[0, 0, 0], [0, 0, 0.5]], [Z, Z])
    scene["link"][0]["cog"] = [0.01, 0.02, 0.2]
    return scene


def agile_eye() -> dict[str, Any]:
    """Three legs of three hinges, all axes through one point: three turns of a camera."""
    frame, links, joints = {}, [{"name": "eye", "mass": 1.0, "cog": [0.02, 0.03, 0.05], "inertia": [0.01, 0.012, 0.009, 0, 0, 0], "markers": {}}], []
    for i in range(3):
        u = np.roll([1.0, 0.0, 0.0], i)
        v = -np.roll([0.0, 1.0, 0.0], i)
        w = np.cross(u, v)
        at = {name: {"at": (r * axis).tolist(), "axis": axis.tolist()} for name, r, axis in (("A", 0.3, u), ("B", 0.25, w), ("C", 0.2, v))}
        frame[f"A{i}"] = at["A"]
        links[0]["markers"][f"C{i}"] = at["C"]
        links += [{"name": f"in{i}", "mass": 0.5, "cog": (0.1 * (u + w)).tolist(), "inertia": [0.003, 0.004, 0.002, 0, 0, 0],
                   "markers": {"A": at["A"], "B": at["B"]}},
                  {"name": f"out{i}", "mass": 0.4, "cog": (0.1 * (v + w)).tolist(), "inertia": [0.002, 0.003, 0.002, 0, 0, 0],
                   "markers": {"B": at["B"], "C": at["C"]}}]
        joints += [{"name": f"{end}{i}", "type": "revolute", "between": between} for end, between in (
            ("A", [f"frame.A{i}", f"in{i}.A"]), ("B", [f"in{i}.B", f"out{i}.B"]), ("C", [f"out{i}.C", f"eye.C{i}"]))]
    motion = [{"law": "harmonic", "amplitude": 0.3, "frequency": f"{0.5 + 0.1 * i} Hz", "phase": 0.4 * i} for i in range(3)]
    return {"space": "spatial", "gravity": GRAVITY, "frame": {"markers": frame}, "link": links, "joint": joints,
            "coordinate": [{"joint": f"A{i}", "motion": motion[i]} for i in range(3)], "actuator": [{"joint": f"A{i}"} for i in range(3)]}


def three_cranks() -> dict[str, Any]:
    """A parallelogram with a third crank, in the plane."""
    cranks = [("A", 0.0), ("B", 1.0), ("C", 2.0)]
    body = {"mass": 1.0, "inertia": 0.1, "cog": [0.1, 0.2]}
    return {
        "space": "planar", "gravity": [0.0, -9.81], "frame": {"markers": {name: {"at": [x, 0.0]} for name, x in cranks}},
        "link": [*({"name": f"crank{name}", **body, "markers": {"O": {"at": [0.0, 0.0]}, "E": {"at": [0.0, 0.5]}}} for name, _ in cranks),
                 {"name": "bar", **body, "markers": {name: {"at": [x, 0.0]} for name, x in cranks}}],
        "joint": [{"name": f"{end}{name}", "type": "revolute", "between": between} for name, _ in cranks for end, between in (
            ("O", [f"frame.{name}", f"crank{name}.O"]), ("E", [f"crank{name}.E", f"bar.{name}"]))],
        "coordinate": [{"joint": "OA", "motion": {"law": "constant-rate", "start": "10 deg", "rate": 1.0}}], "actuator": [{"joint": "OA"}],
    }


def four_legs() -> dict[str, Any]:
    """A platform that moves freely and turns about z: four legs of a hinge and two universal joints, led by their cranks."""
    z = np.array([0.0, 0.0, 1.0])
    frame, links, joints = {}, [{"name": "platform", "mass": 2.0, "cog": [0.02, 0.01, 0.03], "inertia": [0.01, 0.012, 0.009, 0, 0, 0], "markers": {}}], []
    for i in range(4):
        out, turned = (np.array([np.cos(a), np.sin(a), 0.0]) for a in (i * np.pi / 2 + 0.1, i * np.pi / 2 + 0.7))
        base, knee = 0.4 * out, 0.4 * out + 0.2 * turned
        tip = 0.12 * np.array([np.cos(i * np.pi / 2 + 0.4), np.sin(i * np.pi / 2 + 0.4), 0.0]) - 0.5 * z
        across = np.cross(z, tip - knee)
        links[0]["markers"][f"P{i}"] = {"at": tip.tolist(), "axis": z.tolist()}
        frame[f"B{i}"] = {"at": base.tolist(), "axis": z.tolist()}
        links += [{"name": f"crank{i}", "mass": 0.5, "cog": (0.5 * (base + knee)).tolist(), "inertia": [0.003, 0.004, 0.002, 0, 0, 0],
                   "markers": {"B": {"at": base.tolist(), "axis": z.tolist()}, "K": {"at": knee.tolist(), "axis": z.tolist()}}},
                  {"name": f"rod{i}", "mass": 0.4, "cog": (0.5 * (knee + tip)).tolist(), "inertia": [0.002, 0.003, 0.002, 0, 0, 0],
                   "markers": {"K": {"at": knee.tolist(), "axis": across.tolist()}, "P": {"at": tip.tolist(), "axis": across.tolist()}}}]
        joints += [{"name": f"B{i}", "type": "revolute", "between": [f"frame.B{i}", f"crank{i}.B"]},
                   {"name": f"K{i}", "type": "universal", "between": [f"crank{i}.K", f"rod{i}.K"]},
                   {"name": f"P{i}", "type": "universal", "between": [f"rod{i}.P", f"platform.P{i}"]}]
    motion = [{"law": "harmonic", "amplitude": 0.1, "frequency": f"{0.5 + 0.1 * i} Hz", "phase": 0.4 * i} for i in range(4)]
    return {"space": "spatial", "gravity": GRAVITY, "frame": {"markers": frame}, "link": links, "joint": joints,
            "coordinate": [{"joint": f"B{i}", "motion": motion[i]} for i in range(4)], "actuator": [{"joint": f"B{i}"} for i in range(4)]}


SPATIAL = {"bennett": bennett, "sarrus": sarrus, "spherical": spherical, "slider": slider, "shaft": shaft, "agile_eye": agile_eye, "four_legs": four_legs}


# ---------------------------------------------------------------- statics of our own


def frame_about(axis: Array) -> Array:
    z = axis / np.linalg.norm(axis)
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(z, x), z]).T


def size_of(scene: dict[str, Any]) -> float:
    """How far a joint of a link is from the middle of the others there, or half of how far two on the frame are apart."""
    held: dict[str, list[Array]] = {}
    for joint in scene["joint"]:
        for link, marker in (name.split(".") for name in joint["between"]):
            body = scene["frame"] if link == "frame" else next(one for one in scene["link"] if one["name"] == link)
            held.setdefault(link, []).append(np.array(body["markers"][marker]["at"]))
    frame = held.pop("frame")
    across = [float(np.linalg.norm(p - q)) / 2 for p in frame for q in frame]
    return max(*across, *(float(np.linalg.norm(p - (sum(points) - p) / (len(points) - 1))) for points in held.values() if len(points) > 1 for p in points))


class Statics:
    """Equilibrium of the links of a spatial scene at one pose: A x = b, x the forces and moments of the joints and the drives' torques."""

    def __init__(self, scene: dict[str, Any], position: Array, rotation: Array) -> None:
        self.scene, self.position, self.rotation = scene, position, rotation
        self.links = [link["name"] for link in scene["link"]]
        driven = {actuator["joint"] for actuator in scene["actuator"]}
        self.joint: list[int] = []
        self.sort: list[str] = []
        self.axis: list[Array] = []
        columns = []
        for j, joint in enumerate(scene["joint"]):
            (first, p1, axis), (second, p2, other) = map(self.marker, joint["between"])
            axes = frame_about(np.cross(axis, other) if joint["type"] == "universal" else axis)    # across both of its own
            forces, moments = HELD[joint["type"]]
            directions = [("force", k) for k in forces] + [("moment", k) for k in moments]
            for sort, k in [*directions, *([("drive", 2)] if joint["name"] in driven else [])]:
                column = np.zeros(6 * len(self.links))
                for link, sign in ((second, 1), (first, -1)):
                    if link < 0:
                        continue
                    force = axes[:, k] * (sort == "force")
                    moment = np.cross(p2 - position[link], force) + axes[:, k] * (sort != "force")
                    column[6 * link:6 * link + 6] += sign * np.concatenate([force, moment])
                columns.append(column)
                self.joint.append(j)
                self.sort.append(sort if sort != "force" or k < 2 else "thrust")
                self.axis.append(axes[:, k])
        self.matrix = np.array(columns).T
        self.right = np.zeros(6 * len(self.links))
        for i, link in enumerate(scene["link"]):
            weight = link["mass"] * np.array(scene["gravity"])
            self.right[6 * i:6 * i + 6] = -np.concatenate([weight, np.cross(rotation[i] @ link["cog"], weight)])

    def marker(self, name: str) -> tuple[int, Array, Array]:
        link, marker = name.split(".")
        if link == "frame":
            spec = self.scene["frame"]["markers"][marker]
            return -1, np.array(spec["at"]), np.array(spec["axis"])
        i = self.links.index(link)
        spec = self.scene["link"][i]["markers"][marker]
        return i, self.position[i] + self.rotation[i] @ spec["at"], self.rotation[i] @ spec["axis"]

    def least_squares(self) -> Array:
        """The least sum of squares of forces, and of moments over the mechanism's size. Drives are determined."""
        size = size_of(self.scene)
        scale = np.array([size if sort == "moment" else 1.0 for sort in self.sort])
        return scale * np.linalg.lstsq(self.matrix * scale, self.right, rcond=1e-10)[0]

    def elastic(self) -> Array:
        """Links on elastic joints, by their displacements. The drives' torques are determined: those of any solution."""
        drives = np.array([sort == "drive" for sort in self.sort])
        x = np.linalg.lstsq(self.matrix, self.right, rcond=1e-10)[0] * drives
        names = {"force": "radial", "thrust": "axial", "moment": "tilt"}
        stiffness = np.array([self.scene["joint"][j]["stiffness"][names[sort]] for j, sort in zip(self.joint, self.sort, strict=True) if sort != "drive"])
        held = self.matrix[:, ~drives]
        displacement = np.linalg.lstsq(held * stiffness @ held.T, self.right - self.matrix @ x, rcond=1e-13)[0]
        x[~drives] = stiffness * (held.T @ displacement)
        return x

    def reactions(self, x: Array) -> Array:
        total = np.zeros((len(self.scene["joint"]), 6))
        for j, sort, axis, size in zip(self.joint, self.sort, self.axis, x, strict=True):
            if sort != "drive":
                total[j, 3 * (sort == "moment"):3 * (sort == "moment") + 3] += size * axis
        return total

    def drives(self, x: Array) -> Array:
        return x[[sort == "drive" for sort in self.sort]]


def at_rest(scene: dict[str, Any], q: Array) -> tuple[Any, list[Statics]]:
    opened = linkdyn.Scene(scene)
    run = opened.inverse(q=q, qd=0 * q, qdd=0 * q)
    poses = opened.poses(q=q)
    return run, [Statics(scene, position, rotation) for position, rotation in zip(poses.position, poses.rotation, strict=True)]


def some_poses(scene: dict[str, Any]) -> Array:
    n = len(scene["coordinate"])
    return np.random.default_rng(3).uniform(-0.4, 0.6, size=(4, n))


@pytest.mark.parametrize("name", SPATIAL)
def test_least_squares(name: str) -> None:
    scene = SPATIAL[name]()
    run, statics = at_rest(scene, some_poses(scene) * (0.2 if name == "four_legs" else 1.0))    # they reach no farther
    assert not run.status.values.any() and run.attrs["redundancy"] == "minimum-norm"
    for i, pose in enumerate(statics):
        x = pose.least_squares()
        expected = pose.reactions(x)
        np.testing.assert_allclose(run.reaction.values[i], expected, rtol=0, atol=SUFFICIENT * np.abs(expected).max())
        np.testing.assert_allclose(run.driving_force.values[i], pose.drives(x), rtol=0, atol=SUFFICIENT * np.abs(expected).max())


@pytest.mark.parametrize("scene", [bennett(), bennett(57.3), goldberg()], ids=["bennett", "bennett-57", "goldberg"])
def test_the_order_of_joints_makes_no_pose_singular(scene: dict[str, Any]) -> None:
    """A loop that is regular all over its motion stays so whichever of its joints let go."""
    t = np.linspace(0, np.pi, 401)
    scene["coordinate"][0]["motion"] = {"law": "harmonic", "amplitude": 0.3, "frequency": 2.0}
    n = len(scene["joint"])
    driven = None
    for order in itertools.islice(itertools.permutations(range(n)), 0, None, 1 if n == 4 else 11):
        run = linkdyn.Scene(scene | {"joint": [scene["joint"][i] for i in order]}).inverse(t=t)
        assert not run.status.values.any(), order
        assert run.attrs["change_points_passed"] == 0, order
        driven = run.driving_force.values if driven is None else driven
        np.testing.assert_allclose(run.driving_force.values, driven, rtol=0, atol=1e-10 * np.abs(driven).max())


@pytest.mark.parametrize("name", ["bennett", "sarrus", "spherical", "shaft", "agile_eye"])
def test_elastic_joints(name: str) -> None:
    scene = SPATIAL[name]() | {"redundancy": "stiffness"}
    for i, joint in enumerate(scene["joint"]):
        joint["stiffness"] = {"radial": 1e8 * (1 + i), "axial": 5e7 * (2 + i), "tilt": 1e5 * (1 + 0.3 * i)}
    run, statics = at_rest(scene, some_poses(scene))
    assert not run.status.values.any()
    for i, pose in enumerate(statics):
        expected = pose.reactions(pose.elastic())
        np.testing.assert_allclose(run.reaction.values[i], expected, rtol=0, atol=ELASTIC * np.abs(expected).max())


def test_rigid_joints_of_a_stiff_scene() -> None:
    """What has no stiffness is rigid: as if it were very stiff. Without any, nothing is decided, which is said."""
    scene = shaft() | {"redundancy": "stiffness"}
    q = np.array([[0.3]])
    scene["joint"][0]["stiffness"] = {"radial": 1e6, "axial": 1e6, "tilt": 1e3}
    rigid, _ = at_rest(scene, q)
    scene["joint"][1]["stiffness"] = {"radial": 1e16, "axial": 1e16, "tilt": 1e13}
    _, statics = at_rest(scene, q)
    expected = statics[0].reactions(statics[0].elastic())
    np.testing.assert_allclose(rigid.reaction.values[0], expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    for joint in scene["joint"]:
        del joint["stiffness"]
    with pytest.raises(linkdyn.SceneError, match="stiffness"):
        linkdyn.Scene(scene)


# ---------------------------------------------------------------- in motion


@pytest.mark.parametrize("name", SPATIAL)
def test_power_and_other_roads(name: str) -> None:
    """Power balance, LAPACK's solution, elimination on lanes (few samples) and by record (many)."""
    scene = linkdyn.Scene(SPATIAL[name]())
    t = np.linspace(0, 1.5, 400)
    run = scene.inverse(t=t, want=["driving_force", "reaction", "checks"])
    assert not run.status.values.any()
    assert np.abs(run.power_imbalance.values).max() < 1e-12
    size = np.abs(run.reaction.values).max()
    for solver, step in (("lapack", 40), ("gauss-jordan", 40), ("elimination", 40)):
        few = scene.inverse(t=t[::step], solver=solver)
        np.testing.assert_allclose(few.reaction.values, run.reaction.values[::step], rtol=0, atol=1e-10 * size)


def test_a_planar_four_bar_in_space() -> None:
    """Forces in the plane are determined: those of the planar scene, to the last digits, in motion."""
    spatial = hinges(CORNERS, [Z] * 4, rate=2.0)
    planar = {"space": "planar", "frame": {"markers": {k: {"at": m["at"][:2]} for k, m in spatial["frame"]["markers"].items()}},
              "link": [{"name": link["name"], "mass": link["mass"], "cog": link["cog"][:2], "inertia": link["inertia"][2],
                        "markers": {k: {"at": m["at"][:2]} for k, m in link["markers"].items()}} for link in spatial["link"]],
              **{key: spatial[key] for key in ("joint", "coordinate", "actuator")}}
    del spatial["gravity"]
    t = np.linspace(0, 0.5, 9)
    here, there = (linkdyn.Scene(scene).inverse(t=t) for scene in (spatial, planar))
    assert not here.status.values.any()
    np.testing.assert_allclose(here.driving_force.values, there.driving_force.values, rtol=1e-12)
    np.testing.assert_allclose(here.reaction.values[..., :2], there.reaction.values[..., :2], rtol=0, atol=1e-12 * np.abs(there.reaction.values).max())


def test_a_third_crank_in_the_plane() -> None:
    """Equilibrium of all links, and no smaller sum of squares by a self-stress of the three cranks."""
    scene = three_cranks()
    q = np.array([[0.3], [1.2]])
    run = linkdyn.Scene(scene).inverse(q=q, qd=0 * q, qdd=0 * q)
    assert not run.status.values.any()
    for angle, reaction, torque in zip(q[:, 0], run.reaction.values, run.driving_force.values[:, 0], strict=True):
        # unknown: two forces a pin (frame on crank, crank on bar), the torque
        c, s = np.cos(angle), np.sin(angle)
        rows, right = [], []
        for i in range(3):                                   # cranks: their marker E is at [0, 0.5]
            arm, cog = 0.5 * np.array([-s, c]), np.array([0.1 * c - 0.2 * s, 0.1 * s + 0.2 * c])
            for k in range(2):
                row = np.zeros(13)
                row[4 * i + k], row[4 * i + 2 + k] = 1, -1
                rows.append(row)
                right.append(9.81 if k else 0.0)
            row = np.zeros(13)
            row[4 * i + 2:4 * i + 4] = [arm[1], -arm[0]]     # moment of minus the force on the bar about O
            row[12] = i == 0
            rows.append(row)
            right.append(9.81 * cog[0])
        for k in range(2):
            row = np.zeros(13)
            row[[2 + k, 6 + k, 10 + k]] = 1
            rows.append(row)
            right.append(9.81 if k else 0.0)
        row = np.zeros(13)
        row[[3, 7, 11]] = [0.0, 1.0, 2.0]
        rows.append(row)
        right.append(9.81 * 0.1)
        x = np.linalg.lstsq(np.array(rows)[:, :12], np.array(right) - np.array(rows)[:, 12] * torque, rcond=1e-12)[0]
        np.testing.assert_allclose(np.array(rows) @ np.append(x, torque), right, atol=1e-12)
        np.testing.assert_allclose(reaction[:, :2].reshape(12), x, atol=1e-12 * np.abs(x).max())


def test_forward_after_inverse() -> None:
    """Under the torque that inverse dynamics asks for, Bennett's loop moves as it was asked to; freely, it keeps its energy."""
    scene = bennett()
    scene["coordinate"][0]["motion"] = {"law": "harmonic", "amplitude": 0.3, "frequency": "1 Hz"}
    t = np.linspace(0, 1, 11)
    run = linkdyn.Scene(scene).forward(t=t, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(run.q.values[:, 0], 0.3 * np.sin(2 * np.pi * t), atol=1e-9)
    inverse = linkdyn.Scene(scene).inverse(t=t)
    np.testing.assert_allclose(run.reaction.values, inverse.reaction.values, rtol=0, atol=1e-7 * np.abs(inverse.reaction.values).max())
    scene["actuator"] = []
    free = linkdyn.Scene(scene).forward(t=t[:4], rtol=1e-11, atol=1e-11)
    energy = (free.kinetic_energy + free.potential_energy).values
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


@pytest.mark.twin
def test_quadruple_precision(tmp_path: Any) -> None:
    """The twin finds the same reactions."""
    scene = bennett()
    file = tmp_path / "scene.toml"
    file.write_text(tomli_w.dumps(scene | {"time": {"end": 1.0, "samples": 4}}))
    out = tmp_path / "run.csv"
    subprocess.run([str(quadruple_twin()), "inverse", str(file), "-o", str(out)], check=True, capture_output=True, timeout=120)
    lines = [line for line in out.read_text().splitlines() if not line.startswith("#")]
    names = lines[0].split(",")
    column = next(i for i, name in enumerate(names) if name.startswith("reaction J3 Fz") or ("J3" in name and "Fz" in name))
    found = [float(line.split(",")[column]) for line in lines[1:]]
    run = linkdyn.Scene(scene).inverse(t=np.linspace(0, 1, 4))
    np.testing.assert_allclose(run.reaction.sel(joint="J3", component="Fz").values, found, rtol=1e-10)


# ---------------------------------------------------------------- drives


def test_drives_that_share() -> None:
    """Cranks of a parallelogram turn alike: three drives share as they are asked to."""
    scene = three_cranks()
    alone = linkdyn.Scene(scene).inverse(t=[0.0, 0.4]).driving_force.values[:, 0]
    scene["actuator"] = [{"joint": "OA"}, {"joint": "OB"}, {"joint": "OC", "share": 2.0}]
    shared = linkdyn.Scene(scene).inverse(t=[0.0, 0.4], want=["driving_force", "reaction", "checks"])
    np.testing.assert_allclose(shared.driving_force.values, np.outer(alone, [1, 1, 2]) / 4, rtol=1e-12)
    assert np.abs(shared.power_imbalance.values).max() < 1e-14


def eight_legs() -> tuple[dict[str, Any], Array, Array]:
    """A platform on eight driven legs, two more than it has freedoms."""
    n = 8
    number = np.arange(n)
    foot = 2 * np.pi * (number + 0.15 * (-1) ** number) / n
    tip = 2 * np.pi * (number - 0.42 * (-1) ** number) / n
    base = np.array([0.5 * np.cos(foot), 0.5 * np.sin(foot), 0 * foot]).T
    platform = np.array([0.3 * np.cos(tip), 0.3 * np.sin(tip), 0 * tip]).T
    half = {"mass": 1.0, "cog": [0, 0, 0.1], "inertia": [0.01, 0.01, 0.001, 0, 0, 0]}
    scene = {
        "space": "spatial", "gravity": GRAVITY, "frame": {"markers": {f"B{i}": {"at": base[i].tolist()} for i in range(n)}},
        "link": [{"name": "platform", "mass": 20.0, "cog": [0, 0, 0.05], "inertia": [0.5, 0.6, 0.9, 0, 0, 0],
                  "markers": {f"P{i}": {"at": platform[i].tolist()} for i in range(n)}}],
        "chain": [{"type": "UPS", "name": "leg", "base": [f"frame.B{i}" for i in range(n)], "platform": [f"platform.P{i}" for i in range(n)],
                   "lower": half, "upper": half, "actuated": True, "axis": [[-float(np.sin(a)), float(np.cos(a)), 0.0] for a in foot]}],
        "coordinate": [{"link": "platform", "start": {"position": [0, 0, 0.6], "angles": [0, 0, 0.1]}}],
    }
    return scene, base, platform


def test_eight_legs() -> None:
    """Leg forces are a linear map of the legs' directions (the least squares), power balances, every solver agrees."""
    scene, base, platform = eight_legs()
    rng = np.random.default_rng(5)
    q = np.array([0, 0, 0.6, 0, 0, 0.1]) + 0.05 * rng.normal(size=(40, 6))
    qd, qdd = 0.3 * rng.normal(size=(40, 6)), rng.normal(size=(40, 6))
    opened = linkdyn.Scene(scene)
    run = opened.inverse(q=q, qd=qd, qdd=qdd, want=["driving_force", "reaction", "checks"])
    assert not run.status.values.any() and np.abs(run.power_imbalance.values).max() < 1e-14
    poses = opened.poses(q=q)
    for force, position, rotation in zip(run.driving_force.values, poses.position[:, 0], poses.rotation[:, 0], strict=True):
        arms = platform @ rotation.T
        legs = position + arms - base
        legs /= np.linalg.norm(legs, axis=1)[:, np.newaxis]
        wrenches = np.concatenate([legs, np.cross(arms, legs)], axis=1)
        part = np.linalg.lstsq(wrenches, force, rcond=None)[0]
        np.testing.assert_allclose(wrenches @ part, force, rtol=0, atol=1e-12 * np.abs(force).max())
    for solver in ("lapack", "gauss-jordan", "reduced"):
        want = ["driving_force"] if solver == "reduced" else ["driving_force", "reaction"]
        other = opened.inverse(q=q, qd=qd, qdd=qdd, solver=solver, want=want)
        for name in want:
            np.testing.assert_allclose(other[name].values, run[name].values, rtol=0, atol=1e-12 * np.abs(run[name].values).max())


def test_two_bearings_each_with_a_motor() -> None:
    scene = shaft()
    scene["actuator"] = [{"joint": "J1"}, {"joint": "J2"}]
    both = linkdyn.Scene(scene).inverse(t=[0.0, 0.2]).driving_force.values
    alone = linkdyn.Scene(shaft()).inverse(t=[0.0, 0.2]).driving_force.values
    np.testing.assert_allclose(both, np.repeat(alone / 2, 2, axis=1), rtol=1e-13)


def test_a_spring_at_a_joint_that_lets_go() -> None:
    """A door on three hinges closes by a spring at whichever hinge; forces at two other hinges are no less shared."""
    scene = shaft()
    scene["joint"].append({"name": "J3", "type": "revolute", "between": ["frame.A", "link1.P"]})
    torques = []
    for joint in ("J1", "J2", "J3"):
        scene["spring"] = [{"name": "closer", "joint": joint, "stiffness": 2.0, "damping": 0.3}]
        run = linkdyn.Scene(scene).inverse(t=np.linspace(0, 1, 300), want=["driving_force", "reaction", "checks"])
        assert not run.status.values.any() and np.abs(run.power_imbalance.values).max() < 1e-13
        torques.append(run.driving_force.values)
        few = linkdyn.Scene(scene).inverse(t=np.linspace(0, 1, 300)[::60], solver="lapack")
        np.testing.assert_allclose(few.reaction.values, run.reaction.values[::60], rtol=0, atol=1e-12 * np.abs(run.reaction.values).max())
    np.testing.assert_allclose(torques[1], torques[0], rtol=1e-12)
    np.testing.assert_allclose(torques[2], torques[0], rtol=1e-12)


def test_two_rods_side_by_side() -> None:
    """A second coupler between the same pins carries half, if it weighs nothing."""
    scene = hinges(CORNERS, [Z] * 4)
    for link in scene["link"]:
        link["cog"][2] = 0.0
    scene["gravity"] = [0.0, -9.81, 0.0]
    scene["link"][1] |= {"mass": 0.0, "cog": [0.0, 0.0, 0.0], "inertia": [0.0] * 6}
    alone = linkdyn.Scene(scene).inverse(t=[0.0, 0.5])
    scene["link"].append(copy.deepcopy(scene["link"][1]) | {"name": "twin"})
    scene["joint"] += [{"name": "T2", "type": "revolute", "between": ["link1.Q", "twin.P"]}, {"name": "T3", "type": "revolute", "between": ["twin.Q", "link3.P"]}]
    both = linkdyn.Scene(scene).inverse(t=[0.0, 0.5])
    assert not both.status.values.any()
    np.testing.assert_allclose(both.driving_force.values, alone.driving_force.values, rtol=1e-12)
    plane = ["Fx", "Fy"]
    for joint, twin in (("J2", "T2"), ("J3", "T3")):
        whole = alone.reaction.sel(joint=joint, component=plane).values
        for name in (joint, twin):
            np.testing.assert_allclose(both.reaction.sel(joint=name, component=plane).values, whole / 2, rtol=0, atol=1e-11 * np.abs(whole).max())


def test_a_schmidt_coupling_by_the_starts_of_its_links() -> None:
    """Two rows of three parallel links between discs that are offset, one link of each row too many. Only the links' starts say that they are parallel
    and not crossed; the shafts turn alike, the middle disc with them about a point at rest, links go round in circles without turning."""
    lower, upper, radius, mass = np.array([0.05, 0.04]), np.array([-0.02, 0.07]), 0.2, 0.4
    spots = [list(radius * np.array([np.cos(a), np.sin(a)])) for a in 0.3 + 2 * np.pi / 3 * np.arange(3)]
    pins = {f"P{i}": spot for i, spot in enumerate(spots)}
    scene: dict[str, Any] = {"space": "planar", "frame": {"markers": {"A": [0.0, 0.0], "B": list(lower + upper)}}, "link": [], "joint": []}
    for name, centre, inertia in (("first", [0.0, 0.0], 0.01), ("middle", list(lower), 0.02), ("last", list(lower + upper), 0.03)):
        scene["link"].append({"name": name, "mass": 1.0, "inertia": inertia, "markers": {"O": [0.0, 0.0], **pins}, "start": {"position": centre}})
    for row, (way, offset, discs) in enumerate(((lower, [0.0, 0.0], ["first", "middle"]), (upper, list(lower), ["middle", "last"]))):
        for i, spot in enumerate(spots):
            name = f"link{row}{i}"
            scene["link"].append({"name": name, "mass": mass, "inertia": 0.001, "markers": {"O": [0.0, 0.0], "T": list(way)},
                                  "start": {"position": list(np.add(offset, spot))}})
            scene["joint"] += [{"name": f"{name}.O", "type": "revolute", "between": [f"{discs[0]}.P{i}", f"{name}.O"]},
                               {"name": f"{name}.T", "type": "revolute", "between": [f"{name}.T", f"{discs[1]}.P{i}"]}]
    scene["joint"] += [{"name": "A", "type": "revolute", "between": ["frame.A", "first.O"]}, {"name": "B", "type": "revolute", "between": ["frame.B", "last.O"]}]
    scene |= {"coordinate": [{"joint": "A"}], "actuator": [{"joint": "A"}], "load": [{"on": "last.O", "moment": 2.5}]}
    run = linkdyn.Scene(scene).inverse(q=[[0.0], [0.2], [-0.3]], qd=[[1.0]] * 3, qdd=[[0.7]] * 3, want=["driving_force", "joint_variable"])
    assert not run.status.values.any()
    np.testing.assert_allclose(run.joint_variable.sel(variable="B.angle").values, [0.0, 0.2, -0.3], atol=1e-13)
    np.testing.assert_allclose(run.driving_force.values[:, 0], (0.06 + 6 * mass * radius**2) * 0.7 - 2.5, rtol=1e-12)


def test_drives_without_a_condition() -> None:
    scene, *_ = eight_legs()
    q = np.array([[0, 0, 0.6, 0, 0, 0.1]])
    with pytest.raises(linkdyn.InputError, match="more actuators than coordinates"):
        linkdyn.Scene(scene).inverse(q=q, qd=0 * q, qdd=0 * q, want=["driving_force", "rcond"])


# ---------------------------------------------------------------- what does not fit, and what is told


def test_a_loop_that_does_not_fit_cannot_move() -> None:
    """An axis a thousandth of a radian off: nothing is redundant, the loop is rigid, and it is refused."""
    scene = hinges(CORNERS, [Z, Z, Z, [0.001, 0.0, 1.0]])
    with pytest.raises(linkdyn.SceneError, match="over-constrain|one too many"):
        linkdyn.Scene(scene)


def test_assemblies_that_do_not_fit_are_none() -> None:
    """Three cranks: the antiparallelogram of two of them leaves no place for the third."""
    assert linkdyn.Scene(three_cranks()).inverse(t=[0.0]).status.item() == 0
    forced = three_cranks()
    for joint, branch in itertools.product(("EC", "EA", "OC"), (1, -1)):
        scene = copy.deepcopy(forced)
        next(j for j in scene["joint"] if j["name"] == joint)["branch"] = branch
        try:
            run = linkdyn.Scene(scene).inverse(t=[0.0])
        except linkdyn.SceneError:
            continue                                         # no dyad closes there
        assert run.status.item() in (0, 1)
        if run.status.item() == 1:
            return
    pytest.fail("no branch leads to the antiparallelogram")


def test_refusal_on_request() -> None:
    with pytest.raises(linkdyn.SceneError, match="3 constraint directions are redundant"):
        linkdyn.Scene(bennett() | {"redundancy": "refuse"})
    scene = three_cranks() | {"redundancy": "refuse", "actuator": [{"joint": "OA"}, {"joint": "OB"}]}
    del scene["joint"][5], scene["joint"][4], scene["link"][2]
    with pytest.raises(linkdyn.InputError, match="too many actuators: 2 actuators for 1 coordinate"):
        linkdyn.Scene(scene).inverse(t=[0.0])


def test_what_is_told(tmp_path: Any) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(tomli_w.dumps(bennett() | {"time": {"end": 1.0, "samples": 3}}))
    told = subprocess.run([executable(), "explain", file], capture_output=True, text=True, timeout=60, check=True).stdout
    assert "Redundant constraints: 3" in told and "not determined by the equations: forces and moments of joints J1, J2, J3, J4" in told
    summary = subprocess.run([executable(), "inverse", file, "-o", tmp_path / "run.nc"], capture_output=True, text=True, timeout=60, check=True).stdout
    assert "not determined   forces and moments of joints J1, J2, J3, J4: taken is the least sum of squares" in summary
    assert linkdyn.Scene(bennett()).inverse(t=[0.0], error=True, want="driving_force").driving_force_error.item() < 1e-10


@pytest.mark.parametrize("quantity", ["condition", "determinant", "force_amplification"])
def test_no_map_of_shared_drives_in_sweeps(quantity: str) -> None:
    scene, *_ = eight_legs()
    axes = [{"coordinate": "platform.x", "linspace": [-0.1, 0.1, 3]}]
    scene["sweep"] = {"on": "platform.P0", "reduce": ["driving_force"], "axis": axes}
    assert linkdyn.Scene(scene).sweep().driving_force_max.shape[-1] == 8
    scene["sweep"]["reduce"] = [quantity]
    with pytest.raises(linkdyn.LinkdynError, match="more actuators than coordinates"):
        linkdyn.Scene(scene).sweep()


def test_designs_of_a_sweep() -> None:
    """Each design shares its own reactions."""
    scene = hinges(CORNERS, [Z] * 4)
    masses = [1.0, 2.0, 3.0]
    scene["sweep"] = {"reduce": ["reaction_force"], "axis": [{"coordinate": "J1", "linspace": [-0.5, 0.5, 21]},
                                                             {"parameter": "link.link2.mass", "values": masses}]}
    found = linkdyn.Scene(scene).sweep().reaction_force_max.values
    q = np.linspace(-0.5, 0.5, 21)[:, np.newaxis]
    for mass, largest in zip(masses, found, strict=True):
        scene["link"][1]["mass"] = mass
        run = linkdyn.Scene(scene).inverse(q=q, qd=0 * q, qdd=0 * q)
        np.testing.assert_allclose(largest, np.linalg.norm(run.reaction.values[..., :3], axis=-1).max(axis=0), rtol=1e-12)


def rails(space: str) -> dict[str, Any]:
    """A carriage on two rails."""
    def at(x: float, y: float) -> dict[str, Any]:
        return {"at": [x, y] + [0.0] * (space == "spatial"), "axis": [1.0, 0.0] + [0.0] * (space == "spatial")}

    body = {"mass": 3.0, "cog": [0.1, 0.2], "inertia": 0.2} if space == "planar" else {"mass": 3.0, "cog": [0.1, 0.2, 0.3], "inertia": [0.2, 0.3, 0.4, 0, 0, 0]}
    return {
        "space": space, "gravity": [0.0, -9.81] + [0.0] * (space == "spatial"),
        "frame": {"markers": {"A": at(0.0, 0.0), "B": at(0.0, 0.5)}}, "link": [{"name": "carriage", **body, "markers": {"A": at(0.0, 0.0), "B": at(0.2, 0.5)}}],
        "joint": [{"name": name, "type": "prismatic", "between": [f"frame.{name}", f"carriage.{name}"]} for name in "AB"],
        "coordinate": [{"joint": "A", "motion": {"law": "harmonic", "amplitude": 0.3, "frequency": "1 Hz"}}], "actuator": [{"joint": "A"}],
    }


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_two_rails(space: str) -> None:
    """Newton's law of the carriage, both joint variables, one and two drives."""
    scene = rails(space)
    t = np.linspace(0, 1, 9)
    run = linkdyn.Scene(scene).inverse(t=t, want=["driving_force", "reaction", "joint_variable", "checks"])
    assert not run.status.values.any() and np.abs(run.power_imbalance.values).max() < 1e-14
    slide, acceleration = 0.3 * np.sin(2 * np.pi * t), -0.3 * (2 * np.pi) ** 2 * np.sin(2 * np.pi * t)
    np.testing.assert_allclose(run.driving_force.values[:, 0], 3.0 * acceleration, atol=1e-12)
    np.testing.assert_allclose(run.joint_variable.values, np.array([slide, slide + 0.2]).T, atol=1e-14)
    np.testing.assert_allclose(run.reaction.sel(component="Fy").values.sum(axis=1), 3.0 * 9.81, rtol=1e-13)
    scene["actuator"].append({"joint": "B", "share": 3.0})
    both = linkdyn.Scene(scene).inverse(t=t, want=["driving_force", "reaction", "checks"])
    np.testing.assert_allclose(both.driving_force.values, np.outer(3.0 * acceleration, [0.25, 0.75]), atol=1e-12)
    assert np.abs(both.power_imbalance.values).max() < 1e-14
    lapack = linkdyn.Scene(scene).inverse(t=t, solver="lapack")
    np.testing.assert_allclose(lapack.reaction.values, both.reaction.values, rtol=0, atol=1e-12 * np.abs(both.reaction.values).max())


def test_a_scissor_lift_with_two_rams() -> None:
    """Two scissors on one table, each with its own pair of bars: one is enough to hold it."""
    n = {"mass": 2.0, "cog": [0.5, 0.0], "inertia": 0.2}
    bars, joints = [], []
    for side, x in (("l", 0.0), ("r", 2.0)):
        bars += [{"name": f"up{side}", **n, "markers": {"O": [0.0, 0.0], "M": [0.5, 0.0], "T": [1.0, 0.0]}},
                 {"name": f"down{side}", **n, "markers": {"O": [0.0, 0.0], "M": [0.5, 0.0], "T": [1.0, 0.0]}}]
        joints += [{"name": f"O{side}", "type": "revolute", "between": [f"frame.O{side}", f"up{side}.O"]},
                   {"name": f"M{side}", "type": "revolute", "between": [f"up{side}.M", f"down{side}.M"]},
                   {"name": f"T{side}", "type": "revolute", "between": [f"down{side}.T", f"table.T{side}"]},
                   {"name": f"S{side}", "type": "revolute", "between": [f"slider{side}.O", f"down{side}.O"]},
                   {"name": f"P{side}", "type": "prismatic", "between": [f"frame.P{side}", f"slider{side}.P"]},
                   {"name": f"R{side}", "type": "revolute", "between": [f"up{side}.T", f"roller{side}.O"]},
                   {"name": f"Q{side}", "type": "prismatic", "between": [f"table.Q{side}", f"roller{side}.P"]}]
        bars += [{"name": f"{kind}{side}", "mass": 0.5, "cog": [0.0, 0.0], "inertia": 0.01,
                  "markers": {"O": [0.0, 0.0], "P": {"at": [0.0, 0.0], "axis": [1.0, 0.0]}}} for kind in ("slider", "roller")]
    frame = {f"O{s}": [x, 0.0] for s, x in (("l", 0.0), ("r", 2.0))} | {f"P{s}": {"at": [x, 0.0], "axis": [1.0, 0.0]} for s, x in (("l", 0.0), ("r", 2.0))}
    table = {f"T{s}": [x, 0.0] for s, x in (("l", 0.0), ("r", 2.0))} | {f"Q{s}": {"at": [x, 0.0], "axis": [1.0, 0.0]} for s, x in (("l", 0.0), ("r", 2.0))}
    angle = np.radians(40)
    start = {"up": ([0, 0], angle), "down": ([np.cos(angle), 0], np.pi - angle), "slider": ([np.cos(angle), 0], 0.0), "roller": ([np.cos(angle), np.sin(angle)], 0.0)}
    for bar in bars:
        (x, y), turn = start[bar["name"][:-1]]
        bar["start"] = {"position": [float(x) + 2.0 * (bar["name"][-1] == "r"), float(y)], "angle": float(turn)}
    scene = {"space": "planar", "gravity": [0.0, -9.81], "frame": {"markers": frame},
             "link": [*bars, {"name": "table", "mass": 20.0, "cog": [1.0, 0.1], "inertia": 5.0, "markers": table,
                              "start": {"position": [0.0, float(np.sin(angle))], "angle": 0.0}}], "joint": joints,
             "coordinate": [{"joint": "Ol", "start": float(angle)}], "actuator": [{"joint": "Ol"}]}
    opened = linkdyn.Scene(scene)
    q = np.radians([[35.0], [50.0]])
    run = opened.inverse(q=q, qd=0 * q, qdd=0 * q, want=["driving_force", "reaction"])
    assert not run.status.values.any()
    # virtual work: the bars' middles rise by half of what the table does, each bar's mass is at its middle
    height = 20.0 + 2 * 0.5 + 4 * 2.0 / 2
    np.testing.assert_allclose(run.driving_force.values[:, 0], 9.81 * height * np.cos(q[:, 0]), rtol=1e-10)
    poses = opened.poses(q=q)
    np.testing.assert_allclose(poses.position[:, list(opened.links).index("table"), 1], np.sin(q[:, 0]), atol=1e-10)


def test_a_sheet_warns(tmp_path: Any) -> None:
    sheet = linkdyn.sheet(linkdyn.Scene(bennett()).inverse(t=np.linspace(0, 1, 30)), tmp_path / "sheet.html")
    assert "reactions of 4 joints are not determined by the equations: taken is the least sum of squares" in sheet.read_text()


# ---------------------------------------------------------------- no lengths at all


@pytest.mark.parametrize("lead", ["A", "D"])
@pytest.mark.parametrize("bend", [0.3, 0.9])
def test_hookes_joint_drawn_from_its_centre(bend: float, lead: str) -> None:
    """A spherical four-bar all of whose points are one: there is no length in it. The shafts' angles by tan D = tan A cos bend, the torque by the power."""
    centre, out, side = [0, 0, 0], [np.cos(bend), np.sin(bend), 0], [-np.sin(bend), np.cos(bend), 0]
    first, second = 0.02, 0.05
    ends = {"A": {"at": centre, "axis": [1, 0, 0], "x": [0, 0, 1]}, "B": {"at": centre, "axis": [0, 0, 1]},
            "C": {"at": centre, "axis": side}, "D": {"at": centre, "axis": out, "x": side}}
    links = {"in": (first, {"A": ends["A"], "B": ends["B"]}), "cross": (0, {"B": ends["B"], "C": {"at": centre, "axis": [0, 1, 0]}}),
             "out": (second, {"C": ends["C"], "D": ends["D"]})}
    scene = {
        "space": "spatial", "frame": {"markers": {"A": ends["A"], "D": ends["D"]}},
        "link": [{"name": name, "mass": int(inertia > 0), "inertia": {"diagonal": [inertia] * 3}, "markers": markers, "start": {"position": centre}}
                 for name, (inertia, markers) in links.items()],
        "joint": [{"name": name, "type": "revolute", "between": between} for name, between in
                  {"A": ["frame.A", "in.A"], "B": ["in.B", "cross.B"], "C": ["cross.C", "out.C"], "D": ["frame.D", "out.D"]}.items()],
        "coordinate": [{"joint": lead, "motion": {"law": "harmonic", "amplitude": 1.0, "frequency": 3.0}}],
        "actuator": [{"joint": "A"}],
        "time": {"samples": 20},
    }
    run = linkdyn.Scene(scene).inverse()
    assert not run.status.any()
    turn = {name: run.joint_variable.sel(variable=f"{name}.angle").values for name in "AD"}
    np.testing.assert_allclose(np.tan(turn["D"]), np.tan(turn["A"]) * np.cos(bend), atol=1e-12)
    sine, cosine = np.sin(bend) ** 2 * np.sin(turn["A"]) ** 2, np.cos(bend)
    gain, slope = cosine / (1 - sine), cosine * np.sin(bend) ** 2 * np.sin(2 * turn["A"]) / (1 - sine) ** 2
    rate = run.qd.values[:, 0] / (gain if lead == "D" else 1)
    change = (run.qdd.values[:, 0] - slope * rate**2) / gain if lead == "D" else run.qdd.values[:, 0]
    torque = first * change + second * gain * (gain * change + slope * rate**2)
    np.testing.assert_allclose(run.driving_force[:, 0], torque, atol=1e-11 * np.abs(torque).max())


def centred_four_bar(seed: int) -> tuple[dict[str, Any], Array]:
    """Four axes at random through one point, at which all markers are; a crank at A and a rocker at D."""
    axes = np.random.default_rng(seed).normal(size=(4, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, np.newaxis]
    scene = hinges(np.zeros((4, 3)), axes)
    scene["time"] = {"end": 0.1, "samples": 3}
    return scene, axes


def reach_of_crank(axes: Array, angle: Array) -> Array:
    """What of the rocker's angle is known, cos x = c: beyond one nothing closes. Of B turned by the crank, C at its angle to B and to D."""
    a, b, c, d = axes
    turned = np.cos(angle)[:, np.newaxis] * b + np.sin(angle)[:, np.newaxis] * np.cross(a, b) + ((1 - np.cos(angle)) * (a @ b))[:, np.newaxis] * a
    across = c - (c @ d) * d
    return (b @ c - (c @ d) * (turned @ d)) / np.hypot(turned @ across, turned @ np.cross(d, c))


@pytest.mark.parametrize("first", range(0, 80, 20))
def test_spherical_four_bars_drawn_from_their_centre(first: int) -> None:
    """Poses far off in which the three free axes lie in a plane are dead points of the crank, and do not forbid to release forces along these axes."""
    for seed in range(first, first + 20):
        scene, axes = centred_four_bar(seed)
        run = linkdyn.Scene(scene).inverse()
        closes = np.abs(reach_of_crank(axes, run.q.values[:, 0] - run.q.values[0, 0]))
        assert not run.status.values[closes < 0.999].any(), seed
        assert run.status.values[closes > 1].all(), seed
