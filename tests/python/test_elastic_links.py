"""Links that give way: reactions shared by their bending, against closed forms and against displacements of a frame of beams."""

from __future__ import annotations

import copy
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
import tomli_w
from linkdyn.cli import executable, quadruple_twin
from numpy.typing import NDArray
from test_redundancy import HELD, SPATIAL, frame_about, hinges, rails, some_poses, three_cranks
from test_redundancy_words import Z

pytestmark = pytest.mark.accuracy

Array = NDArray[np.float64]
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
ELASTIC = 1e-8        # stiffnesses of beams, joints and the whole differ by some ten thousand


# ---------------------------------------------------------------- closed forms


@pytest.mark.parametrize("solver", ["elimination", "lapack"])
def test_a_shaft_clamped_by_its_bearings(solver: str) -> None:
    """A load between two bearings that hold tilts: the clamped beam of the books, and what carries it along."""
    length, a = 0.8, 0.3
    b = length - a
    scene = hinges([[0, 0, 0], [0, 0, length]], [Z, Z])
    link = scene["link"][0]
    link |= {"cog": [0, 0, a], "elastic": {"E": "210 GPa", "area": "12 cm^2", "I": "11 cm^4"}}
    scene |= {"redundancy": "stiffness", "gravity": [0.0, -9.81, -3.0]}
    q = np.zeros((1, 1))
    run = linkdyn.Scene(scene).inverse(q=q, qd=q, qdd=q, solver=solver)
    across, along = link["mass"] * 9.81, link["mass"] * 3.0
    first, second = run.reaction.values[0] * [[1.0], [-1.0]]        # the second hinge stands the other way round
    np.testing.assert_allclose([first[1], second[1]], across / length**3 * np.array([b**2 * (3 * a + b), a**2 * (a + 3 * b)]), rtol=1e-12)
    np.testing.assert_allclose([first[2], second[2]], along / length * np.array([b, a]), rtol=1e-12)
    np.testing.assert_allclose([first[3], second[3]], across / length**2 * np.array([-a * b**2, b * a**2]), rtol=1e-12)


@pytest.mark.parametrize("solver", ["elimination", "lapack"])
def test_a_beam_on_three_bars(solver: str) -> None:
    """The bar of a parallelogram with three cranks: two cantilevers from the middle crank, on bars that are compressed."""
    scene = three_cranks() | {"redundancy": "stiffness"}
    bar = scene["link"][3]
    bar |= {"cog": [1.0, 0.0], "elastic": {"E": "70 GPa", "I": "0.5 cm^4", "from": "B"}}
    for crank in scene["link"][:3]:
        crank |= {"mass": 0.0, "inertia": 0.0, "cog": [0.0, 0.0], "elastic": [{"E": 70e9, "area": 2e-6, "to": "E"}]}
    scene["coordinate"][0]["motion"] = {"law": "constant-rate", "start": 0.0, "rate": 0.0}
    q = np.zeros((1, 1))
    run = linkdyn.Scene(scene).inverse(q=q, qd=q, qdd=q, solver=solver)
    soft, bent = 0.5 / (70e9 * 2e-6), 1.0 / (3 * 70e9 * 0.5e-8)
    ends, middle = 1 / (soft + bent), 1 / soft
    expected = 9.81 * np.array([ends, middle, ends]) / (2 * ends + middle)
    np.testing.assert_allclose(run.reaction.sel(joint=["EA", "EB", "EC"], component="Fy").values[0], expected, rtol=1e-12)
    # the middle pin sits too high
    scene["joint"][3]["misfit"] = {"shift": [0.0, "0.3 mm"]}
    off = linkdyn.Scene(scene).inverse(q=q, qd=q, qdd=q, solver=solver)
    strain = 3e-4 / (3 * soft + bent) * np.array([-1, 2, -1])
    np.testing.assert_allclose(off.reaction.sel(joint=["EA", "EB", "EC"], component="Fy").values[0], expected + strain, rtol=1e-11)


def test_a_shaft_welded_of_two() -> None:
    """A beam of two spans on three bearings, loaded in the middle of one: welds make any tree of beams. By the three moments."""
    span, weight = 0.5, 20.0
    at = {"A": 0.0, "P": span / 2, "B": span, "C": 2 * span}
    markers = {name: {"at": [0.0, 0.0, z], "axis": [0.0, 0.0, 1.0]} for name, z in at.items()}
    beam = {"E": 210e9, "I": 3e-8}
    scene = {
        "space": "spatial", "gravity": [0.0, -10.0, 0.0], "redundancy": "stiffness", "frame": {"markers": markers},
        "link": [{"name": "loaded", "mass": weight / 10, "cog": markers["P"]["at"], "inertia": [0.1, 0.1, 0.1, 0, 0, 0],
                  "markers": markers, "elastic": beam},
                 {"name": "free", "mass": 0.0, "markers": markers, "elastic": beam | {"from": "B"}}],
        # a bearing that holds no tilt: a ball that may slide
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "loaded.A"], "stiffness": {"tilt": 1e-3}},
                  {"name": "weld", "type": "fixed", "between": ["loaded.B", "free.B"]},
                  {"name": "B", "type": "cylindrical", "between": ["frame.B", "free.B"], "stiffness": {"tilt": 1e-3}},
                  {"name": "C", "type": "cylindrical", "between": ["frame.C", "free.C"], "stiffness": {"tilt": 1e-3}}],
        "coordinate": [{"joint": "A", "motion": {"law": "constant-rate", "start": 0.0, "rate": 0.0}}], "actuator": [{"joint": "A"}],
    }
    q = np.zeros((1, 1))
    run = linkdyn.Scene(scene).inverse(q=q, qd=q, qdd=q)
    # 4 M_B span = -3 weight span^2 / 8 for a load in the middle of the first span
    moment = 3 * weight * span / 32
    expected = np.array([weight / 2 - moment / span, weight / 2 + 2 * moment / span, -moment / span])
    np.testing.assert_allclose(run.reaction.sel(joint=["A", "B", "C"], component="Fy").values[0], expected, rtol=0, atol=1e-6 * weight)


@pytest.mark.parametrize("solver", ["elimination", "lapack"])
def test_a_bearing_that_is_off(solver: str) -> None:
    """A clamped beam one end of which is set off and turned: 12 EI/L^3, 6 EI/L^2, 4 EI/L, and a prestressed one."""
    length, bends, stretches = 0.5, 210e9 * 1e-8, 210e9 * 1e-4
    scene = hinges([[0, 0, 0], [0, 0, length]], [Z, Z]) | {"redundancy": "stiffness", "gravity": [0.0, 0.0, 0.0]}
    scene["link"][0] |= {"cog": [0.0, 0.0, 0.2], "elastic": {"E": 210e9, "area": 1e-4, "I": 1e-8}}
    q = np.zeros((1, 1))

    def ends(misfit: dict[str, Any]) -> Array:
        scene["joint"][0]["misfit"] = misfit
        return np.asarray(linkdyn.Scene(scene).inverse(q=q, qd=q, qdd=q, solver=solver).reaction.values[0, 0])

    # the frame's bearing holds the shaft's end off by this, and is pushed back
    off = ends({"shift": [0.0, 1e-4, 0.0]})
    np.testing.assert_allclose(off[[1, 3]], [12 * bends * 1e-4 / length**3, -6 * bends * 1e-4 / length**2], rtol=1e-11)
    turned = ends({"turn": ["0.1 deg", 0.0, 0.0]})
    angle = np.radians(0.1)
    np.testing.assert_allclose(turned[[1, 3]], [-6 * bends * angle / length**2, 4 * bends * angle / length], rtol=1e-11)
    tight = ends({"shift": [0.0, 0.0, "0.02 mm"]})
    np.testing.assert_allclose(tight[2], stretches * 2e-5 / length, rtol=1e-11)


# ---------------------------------------------------------------- a frame of beams of our own


def skew(v: Array) -> Array:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def beam_stiffness(e: Array, length: float, section: dict[str, float], y: Array) -> Array:
    """Of the textbooks, 12 x 12, world axes: both ends move and turn."""
    ea, ei_y, ei_z, gj = (section[key] for key in ("EA", "EIy", "EIz", "GJ"))
    k = np.zeros((12, 12))
    k[np.ix_([0, 6], [0, 6])] = ea / length * np.array([[1, -1], [-1, 1]])
    k[np.ix_([3, 9], [3, 9])] = gj / length * np.array([[1, -1], [-1, 1]])
    for way, turn, ei, sign in ((1, 5, ei_z, 1), (2, 4, ei_y, -1)):
        phi = 12 * ei / (section["GA"] * length**2)
        six = sign * 6 * length
        own = np.array([[12, six, -12, six], [six, (4 + phi) * length**2, -six, (2 - phi) * length**2],
                        [-12, -six, 12, -six], [six, (2 - phi) * length**2, -six, (4 + phi) * length**2]])
        at = [way, turn, way + 6, turn + 6]
        k[np.ix_(at, at)] += ei / (1 + phi) / length**3 * own
    y = y - (y @ e) * e
    y /= np.linalg.norm(y)
    turn = np.kron(np.eye(4), np.array([e, y, np.cross(e, y)]))
    return turn.T @ k @ turn


class Frame:
    """Links as beams between their centres of mass and their joints: displacements, with the joints' forces as multipliers."""

    def __init__(self, scene: dict[str, Any], position: Array, rotation: Array, torque: Array) -> None:
        self.scene, self.position, self.rotation = scene, position, rotation
        links = [link["name"] for link in scene["link"]]
        n = len(links) + 2 * len(scene["joint"])
        stiffness, force = np.zeros((6 * n, 6 * n)), np.zeros(6 * n)
        rows: list[Array] = []
        off: list[float] = []
        soft, rests, of_joint, wrenches = [], [], [], []
        for i, link in enumerate(scene["link"]):
            force[6 * i:6 * i + 3] = link["mass"] * np.array(scene["gravity"])
        for j, joint in enumerate(scene["joint"]):
            axis, points = np.zeros(3), []
            for side, name in enumerate(joint["between"]):
                node = len(links) + 2 * j + side
                at = slice(6 * node, 6 * node + 6)
                of, marker = name.split(".")
                if of == "frame":
                    spec = scene["frame"]["markers"][marker]
                    points.append(np.array(spec["at"]))
                    rests += [*range(at.start, at.stop)]
                    if side == 0:
                        axis = np.array(spec["axis"])
                else:
                    i = links.index(of)
                    spec = scene["link"][i]["markers"][marker]
                    points.append(position[i] + rotation[i] @ spec["at"])
                    self.add_beam(stiffness, i, node, points[-1])
                    if side == 0:
                        axis = rotation[i] @ spec["axis"]
            # the second link is touched at its own marker, so is what is rigid on the first
            touched = [np.hstack([-np.eye(3), skew(points[1] - points[0])]), np.hstack([np.eye(3), np.zeros((3, 3))])]
            turned = [np.hstack([np.zeros((3, 3)), (2 * side - 1) * np.eye(3)]) for side in (0, 1)]
            first = 6 * (len(links) + 2 * j)
            for k, actuator in enumerate(scene["actuator"]):
                if actuator["joint"] == joint["name"]:
                    drives = touched if joint["type"] == "prismatic" else turned
                    force[first:first + 12] += torque[k] * axis @ np.hstack(drives)
            axes = frame_about(axis)
            for sort, held in zip(("force", "moment"), HELD[joint["type"]], strict=True):
                for k in held:
                    row = np.zeros(6 * n)
                    row[first:first + 12] = axes[:, k] @ np.hstack(turned if sort == "moment" else touched)
                    rows.append(row)
                    key = {"moment": ("tilt", "tilt", "torsion"), "force": ("radial", "radial", "axial")}[sort][k]
                    given = joint.get("stiffness", {}).get(key)
                    soft.append(1 / given if given else 0.0)
                    misfit = joint.get("misfit", {}).get("shift" if sort == "force" else "turn", [0.0, 0.0, 0.0])
                    first_link = joint["between"][0].split(".")[0]
                    off.append(axes[:, k] @ ((rotation[links.index(first_link)] if first_link in links else np.eye(3)) @ misfit))
                    of_joint.append(j)
                    wrenches.append(np.concatenate([axes[:, k] * (sort == "force"), axes[:, k] * (sort == "moment")]))
        moves = np.setdiff1d(np.arange(6 * n), rests)
        held = np.array(rows)[:, moves]
        unit = 1e7                           # in which forces are counted, so that both kinds of numbers are alike
        matrix = np.block([[stiffness[np.ix_(moves, moves)] / unit, held.T], [held, -np.diag(soft) * unit]])
        size = 1 / np.sqrt(np.abs(matrix).max(axis=1))
        right = size * np.concatenate([force[moves] / unit, off])
        solution = size * np.linalg.lstsq(matrix * size * size[:, None], right, rcond=1e-13)[0]
        self.reaction = np.zeros((len(scene["joint"]), 6))
        for j, wrench, x in zip(of_joint, wrenches, solution[len(moves):], strict=True):
            self.reaction[j] -= unit * x * wrench

    def add_beam(self, stiffness: Array, i: int, node: int, point: Array) -> None:
        link = self.scene["link"][i]
        cog = self.position[i] + self.rotation[i] @ link["cog"]
        way = point - cog
        length = np.linalg.norm(way)
        at = np.r_[6 * i:6 * i + 6, 6 * node:6 * node + 6]
        elastic = link["elastic"]
        section = {"EA": elastic["E"] * elastic["area"], "GA": elastic["G"] * elastic["shear_area"], "GJ": elastic["G"] * elastic["J"],
                   "EIy": elastic["E"] * elastic["Iy"], "EIz": elastic["E"] * elastic["Iz"]}
        stiffness[np.ix_(at, at)] += beam_stiffness(way / length, length, section, self.rotation[i] @ np.array(elastic["y"]))


def beams(scene: dict[str, Any]) -> dict[str, Any]:
    """Each link with a section of its own; joints give way as well."""
    scene = copy.deepcopy(scene) | {"redundancy": "stiffness"}
    for i, link in enumerate(scene["link"]):
        link["elastic"] = {"E": 2.1e9, "G": 8e8, "area": 8e-4 * (1 + 0.1 * i), "shear_area": 5e-4, "Iy": 4e-7 * (1 + 0.3 * i), "Iz": 9e-7, "J": 7e-7,
                           "y": [0.3, 0.5 - 0.1 * i, 1.0]}
    for i, joint in enumerate(scene["joint"]):
        joint["stiffness"] = {"radial": 1e8 * (1 + i), "axial": 5e7 * (2 + i), "tilt": 1e5 * (1 + 0.3 * i)}
    return scene


def misfitting(scene: dict[str, Any]) -> dict[str, Any]:
    """Joints that were not made as the links are: some tenths of a millimetre and of a degree."""
    rng = np.random.default_rng(7)
    for joint in scene["joint"]:
        joint["misfit"] = {"shift": (2e-4 * rng.normal(size=3)).tolist(), "turn": (2e-3 * rng.normal(size=3)).tolist()}
    return scene


SCENES = {**{name: beams(make()) for name, make in SPATIAL.items() if name != "four_legs"},    # these have universal joints
          "rails": beams(rails("spatial")),
          **{f"misfitting {name}": misfitting(beams(SPATIAL[name]())) for name in ("bennett", "slider", "shaft", "agile_eye")}}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("rigid_joints", [False, True])
def test_against_displacements(name: str, rigid_joints: bool) -> None:
    scene = copy.deepcopy(SCENES[name])
    for joint in scene["joint"]:
        if rigid_joints:
            del joint["stiffness"]
    q = some_poses(scene)
    opened = linkdyn.Scene(scene)
    run, poses = opened.inverse(q=q, qd=0 * q, qdd=0 * q), opened.poses(q=q)
    assert not run.status.values.any()
    for i in range(len(q)):
        expected = Frame(scene, poses.position[i], poses.rotation[i], run.driving_force.values[i]).reaction
        np.testing.assert_allclose(run.reaction.values[i], expected, rtol=0, atol=ELASTIC * np.abs(expected).max())


# ---------------------------------------------------------------- roads of the engine


def in_motion(scene: dict[str, Any]) -> dict[str, Any]:
    """With what else acts at joints: a motor, springs, a payload, a load on a marker of none."""
    scene = copy.deepcopy(scene)
    joint = scene["joint"][-1]["name"]
    scene["spring"] = [{"name": "spring", "joint": joint, "stiffness": 30.0, "damping": 2.0}]
    scene["payload"] = [{"on": scene["joint"][0]["between"][1], "mass": 0.4}]
    scene["actuator"][0]["drive"] = {"ratio": 20, "rotor_inertia": 1e-4}
    return scene


@pytest.mark.parametrize("name", SCENES)
def test_records_lanes_and_other_solvers(name: str) -> None:
    scene = in_motion(SCENES[name])
    opened = linkdyn.Scene(scene)
    n = len(scene["coordinate"])
    rng = np.random.default_rng(5)
    q, qd, qdd = rng.uniform(-0.2, 0.3, size=(300, n)), rng.normal(size=(300, n)), rng.normal(size=(300, n))
    run = opened.inverse(q=q, qd=qd, qdd=qdd)
    assert not run.status.values.any()
    size = np.abs(run.reaction.values).max(axis=(1, 2))[:, None, None]
    for solver in ("lapack", "gauss-jordan"):
        other = opened.inverse(q=q, qd=qd, qdd=qdd, solver=solver)
        assert np.abs((other.reaction.values - run.reaction.values) / size).max() < 1e-11
    alone = opened.inverse(q=q[:3], qd=qd[:3], qdd=qdd[:3])
    assert np.abs((alone.reaction.values - run.reaction.values[:3]) / size[:3]).max() < 1e-11


@pytest.mark.twin
@pytest.mark.parametrize("name", ["bennett", "slider"])
def test_quadruple_precision(name: str, tmp_path: Any) -> None:
    scene = in_motion(SCENES[name])
    scene["time"] = {"end": 0.5, "samples": 6}
    path = tmp_path / "scene.toml"
    path.write_text(tomli_w.dumps(scene))
    runs = []
    for program in (executable(), quadruple_twin()):
        out = tmp_path / "out.csv"
        subprocess.run([str(program), "inverse", str(path), "-o", str(out)], check=True, capture_output=True, timeout=120)
        names, *rows = (line.split(",") for line in out.read_text().splitlines() if not line.startswith("#"))
        runs.append(np.array([[float(x) for name, x in zip(names, row, strict=True) if name.startswith("reaction")] for row in rows]))
    np.testing.assert_allclose(runs[0], runs[1], rtol=0, atol=1e-11 * np.abs(runs[1]).max())


# ---------------------------------------------------------------- words of the scene


def reactions(scene: dict[str, Any]) -> Array:
    q = some_poses(scene)
    return np.asarray(linkdyn.Scene(scene).inverse(q=q, qd=0 * q, qdd=0 * q).reaction.values)


def test_a_compliance_says_the_same() -> None:
    """A cantilever's deflections by the handbook, as a matrix, in place of its section."""
    scene = beams(SPATIAL["bennett"]())
    for link in scene["link"]:
        link["elastic"] = {"E": 2e9, "G": 8e8, "area": 8e-4, "I": 4e-7, "J": 7e-7}
    expected = reactions(scene)
    for link in scene["link"]:
        parts = []
        for name, marker in link["markers"].items():
            way = np.array(marker["at"]) - link["cog"]
            length = np.linalg.norm(way)
            axes = frame_about(way)[:, [2, 0, 1]]
            own = np.diag([length / 1.6e6, length**3 / 2400, length**3 / 2400, length / 560, length / 800, length / 800])
            own[1, 5] = own[5, 1] = length**2 / 1600
            own[2, 4] = own[4, 2] = -(length**2) / 1600
            turn = np.kron(np.eye(2), axes)
            parts.append({"to": name, "compliance": (turn @ own @ turn.T).tolist()})
        link["elastic"] = parts
    np.testing.assert_allclose(reactions(scene), expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_tables_for_some_markers() -> None:
    """What is said of a marker counts before what is said of all; where a beam begins may be said by a marker or a point."""
    scene = beams(SPATIAL["bennett"]())
    first, second = scene["link"][:2]
    expected = reactions(scene)
    first["elastic"] = [first["elastic"] | {"E": 1.0, "from": "Q"}, first["elastic"] | {"to": ["P", "Q"], "from": first["cog"]}]
    np.testing.assert_allclose(reactions(scene), expected, rtol=1e-11, atol=1e-11 * np.abs(expected).max())
    second["elastic"] |= {"from": "P"}
    at_marker = reactions(scene)
    second["elastic"] |= {"from": second["markers"]["P"]["at"]}
    np.testing.assert_array_equal(at_marker, reactions(scene))
    assert np.abs(at_marker - expected).max() > 1e-3 * np.abs(expected).max()


def test_an_image() -> None:
    """A mechanism and its mirror image: the section's axes, and a compliance, are mirrored with the link."""
    right = beams(SPATIAL["bennett"]())
    section = right["link"][0]["elastic"]
    matrix = np.random.default_rng(2).normal(size=(6, 6))
    right["link"][0]["elastic"] = [section, {"to": "Q", "compliance": (1e-8 * matrix @ matrix.T).tolist()}]
    left = copy.deepcopy(right)
    for marker in left["frame"]["markers"].values():
        marker["at"][1] *= -1
        marker["axis"] = [-marker["axis"][0], marker["axis"][1], -marker["axis"][2]]    # so that angles are the same
    for link in left["link"]:
        for marker in link["markers"].values():
            marker["axis"] = (-np.array(marker["axis"])).tolist()
        link |= {"repeat": 1, "mirror": "xz"}
    left["link"] = [link | {"name": link["name"] + "#"} for link in left["link"]]
    for joint in left["joint"]:
        joint["between"] = [of.replace(".", "2.") if of.startswith("link") else of for of in joint["between"]]
    # originals beside the images hang on hinges of their own
    for i, link in enumerate(right["link"]):
        left["frame"]["markers"][f"S{i}"] = {"at": [0.0, 0.0, 3.0 + i], "axis": [0.0, 0.0, 1.0]}
        left["joint"].append({"name": f"S{i}", "type": "fixed", "between": [f"frame.S{i}", link["name"] + "1.P"]})
    expected = reactions(right)
    found = reactions(left)[:, :4] * [1, -1, 1, -1, 1, -1]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_designs_of_a_sweep() -> None:
    """A section that varies changes how reactions are shared, design by design."""
    scene = beams(SPATIAL["bennett"]()) | {"variables": {"I": "4e-7 m^4"}}
    scene["link"][1]["elastic"]["Iy"] = "I"
    axes = [{"parameter": "variables.I", "values": [4e-7, 4e-6]}, {"coordinate": "J1", "values": [0.1, 0.3]}]
    swept = linkdyn.Scene(scene | {"sweep": {"axis": axes, "keep": ["reaction"]}}).sweep()
    q = np.array([[0.1], [0.3]])
    for i, second in enumerate(axes[0]["values"]):
        scene["variables"]["I"] = second
        run = linkdyn.Scene(scene).inverse(q=q, qd=0 * q, qdd=0 * q)
        np.testing.assert_allclose(swept.reaction.values[2 * i:2 * i + 2], run.reaction.values, rtol=0, atol=1e-11 * np.abs(run.reaction.values).max())


def test_explain_names_them() -> None:
    text = linkdyn.Scene(beams(SPATIAL["bennett"]())).explain()
    assert "least elastic energy" in text and "links that give way: link1, link2, link3" in text


@pytest.mark.parametrize("name", ["bennett", "rails", "misfitting bennett"])
def test_causes_and_forward_runs(name: str) -> None:
    """What causes bend links with adds up; a forward run that is led as the inverse one tells the same reactions."""
    scene = in_motion(SCENES[name])
    scene["coordinate"][0]["motion"] = {"law": "harmonic", "amplitude": 0.2, "frequency": "1 Hz"}
    t = np.linspace(0, 0.5, 6)
    run = linkdyn.Scene(scene).inverse(t=t, want=["driving_force", "reaction", "checks"])
    assert np.abs(run.power_imbalance.values).max() < 1e-12 and "J1" in run.attrs["shared_reactions"] or name == "rails"
    size = np.abs(run.reaction.values).max()
    np.testing.assert_allclose(run.linkdyn.contributions().reaction.sum("cause").transpose(*run.reaction.dims).values, run.reaction.values,
                               rtol=0, atol=1e-10 * size)
    forward = linkdyn.Scene(scene).forward(t=t, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(forward.reaction.values, run.reaction.values, rtol=0, atol=1e-6 * size)


def test_rows_of_letters() -> None:
    """Links of a drawn leg: those of its image are mirrored; their markers are called as their joints."""
    scene = tomllib.loads((EXAMPLES / "tripteron" / "scene.toml").read_text()) | {"redundancy": "stiffness"}
    rigid = copy.deepcopy(scene)
    rigid["chain"][0]["stiffness"] = {"radial": 1e9, "axial": 1e9, "tilt": 1e7, "torsion": 1e7}
    scene["chain"][0]["stiffness"] = rigid["chain"][0]["stiffness"]
    for link in scene["chain"][0]["links"][1:]:
        link["elastic"] = {"E": "70 GPa", "G": "26 GPa", "area": "3 cm^2", "I": "1.2 cm^4", "J": "2.4 cm^4"}
    t = [0.1, 0.4]
    soft, lanes = (linkdyn.Scene(scene, folder=EXAMPLES / "tripteron").inverse(t=t, solver=solver) for solver in ("elimination", "lapack"))
    size = np.abs(soft.reaction.values).max()
    np.testing.assert_allclose(lanes.reaction.values, soft.reaction.values, rtol=0, atol=1e-10 * size)
    stiff = linkdyn.Scene(rigid, folder=EXAMPLES / "tripteron").inverse(t=t)
    np.testing.assert_allclose(stiff.driving_force.values, soft.driving_force.values, rtol=1e-11)
    assert np.abs(stiff.reaction.values - soft.reaction.values).max() > 1e-3 * size
    scene["chain"][0]["links"][1]["elastic"]["from"] = "P"
    with pytest.raises(linkdyn.SceneError, match="'P' is no marker of link 'leg1.link2' .expected the name alone, one of 'R1', 'R2'"):
        linkdyn.Scene(scene)


def bars(hub: bool) -> dict[str, Any]:
    """Two alike, pinned together at both ends, on a hinge; 100 N along the second at its middle."""
    bar = {"mass": 1, "cog": [0.5, 0], "inertia": 0.1, "elastic": {"E": 210e9, "area": 1e-4}}
    links = [{"name": "beam", **bar, "markers": {"O": [0, 0], "P": [1, 0]}}, {"name": "bar", **bar, "markers": {"O": [0, 0], "P": [1, 0], "W": [0.5, 0]}}]
    joints = [{"name": name, "type": "revolute", "between": ends} for name, ends in (("O", ["beam.O", "bar.O"]), ("P", ["beam.P", "bar.P"]))]
    foot = "beam.O"
    if hub:
        links.append({"name": "hub", "mass": 0, "inertia": 0, "markers": {"O": [0, 0]}})
        joints.append({"name": "weld", "type": "fixed", "between": ["hub.O", "beam.O"]})
        joints[0]["between"][0] = foot = "hub.O"
    joints.append({"name": "F", "type": "revolute", "between": ["frame.O", foot]})
    return {"space": "planar", "redundancy": "stiffness", "frame": {"markers": {"O": [0, 0]}}, "link": links, "joint": joints,
            "coordinate": [{"joint": "F"}], "actuator": [{"joint": "F"}], "load": [{"on": "bar.W", "force": [100, 0]}]}


def test_two_joints_at_one_end_of_a_beam_are_refused() -> None:
    """What both do bends it together. On a hub they come in one: then 100 N goes to the foot by three lengths of bar beside one."""
    with pytest.raises(linkdyn.SceneError, match="'beam' is 'elastic', and joints 'O' and 'F' hold it at one marker"):
        linkdyn.Scene(bars(False))
    run = linkdyn.Scene(bars(True)).inverse([[0.0]])
    assert abs(run.reaction.sel(joint="P").values[0, 0]) == pytest.approx(25, rel=1e-9)
