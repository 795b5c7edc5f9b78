"""What of reactions the equations leave open, told component by component: against the null space of our own equations of statics."""

from __future__ import annotations

import re
from typing import Any

import linkdyn
import numpy as np
import pytest
from numpy.typing import NDArray
from test_redundancy import SPATIAL, Statics, eight_legs, frame_about, hinges, some_poses, three_cranks
from test_redundancy_words import CORNERS, Z

Array = NDArray[np.float64]
NOTHING = 1e-9       # of a unit state of self-stress; loops are closed to 1e-12
DIRECTION = re.compile(r"(?P<sort>along|across) (?:(?P<axis>the axis)|(?P<axes>[xyz](?: and [xyz])*)|\((?P<vector>[^)]*)\))(?: of '(?P<link>[^']*)')?$")


def tilted() -> dict[str, Any]:
    """A planar four-bar in a plane that is none of the world's."""
    turn = frame_about(np.array([1.0, 2.0, 3.0]))
    return hinges([turn @ p for p in CORNERS], [turn[:, 2]] * 4)


def askew() -> dict[str, Any]:
    """Three cranks alike between parallel hinges, in space: rods that press each other, aslant in their axes."""
    ends = {"O": [0.0, 0.0, 0.0], "E": [0.3, 0.4, 0.0]}
    body = {"mass": 1.0, "cog": [0.1, 0.2, 0.03], "inertia": [0.1, 0.1, 0.1, 0.0, 0.0, 0.0]}
    cranks = {"A": 0.0, "B": 1.0, "C": 2.3}
    markers = {name: {"at": [x, 0.0, 0.0], "axis": Z} for name, x in cranks.items()}
    return {
        "space": "spatial", "gravity": [0.0, 0.0, -9.81], "frame": {"markers": markers},
        "link": [*({"name": f"crank{name}", **body, "markers": {end: {"at": at, "axis": Z} for end, at in ends.items()}} for name in cranks),
                 {"name": "bar", **body, "markers": markers}],
        "joint": [{"name": f"{end}{name}", "type": "revolute", "between": between} for name in cranks for end, between in (
            ("O", [f"frame.{name}", f"crank{name}.O"]), ("E", [f"crank{name}.E", f"bar.{name}"]))],
        "coordinate": [{"joint": "OA", "motion": {"law": "constant-rate", "start": "10 deg", "rate": 1.0}}], "actuator": [{"joint": "OA"}],
    }


SCENES = {**SPATIAL, "four-bar": lambda: hinges(CORNERS, [Z] * 4), "tilted four-bar": tilted, "askew": askew}


def poses_of(scene: dict[str, Any]) -> list[Statics]:
    rng = np.random.default_rng(5)
    q = np.concatenate([some_poses(scene), rng.uniform(-0.3, 0.3, size=(4, len(scene["coordinate"])))])
    poses = linkdyn.Scene(scene).poses(q=q * (0.2 if len(scene["coordinate"]) == 4 else 1.0))
    assert not poses.status.any()
    return [Statics(scene, position, rotation) for position, rotation in zip(poses.position, poses.rotation, strict=True)]


def stress_of(pose: Statics) -> Array:
    """What states of self-stress do at each joint, world axes: (joint, force or moment, axis, state)."""
    held = np.array([sort != "drive" for sort in pose.sort])
    _, values, rows = np.linalg.svd(pose.matrix[:, held])
    null = rows[np.count_nonzero(values > 1e-9 * values[0]):].T
    found = np.zeros((len(pose.scene["joint"]), 2, 3, null.shape[1]))
    unknown = [(j, int(sort == "moment"), axis) for j, sort, axis in zip(pose.joint, pose.sort, pose.axis, strict=True) if sort != "drive"]
    for (j, sort, axis), state in zip(unknown, null, strict=True):
        found[j, sort] += np.outer(axis, state)
    return found


def told_span(pose: Statics, joint: int, words: str) -> Array:
    """The directions that a clause of `shared_directions` tells, world axes (axis, direction)."""
    match = DIRECTION.match(words)
    assert match, words
    if match["axis"]:
        frame = frame_about(pose.marker(pose.scene["joint"][joint]["between"][0])[2])
        return frame[:, 2:] if match["sort"] == "along" else frame[:, :2]
    turn = pose.rotation[pose.links.index(match["link"])] if match["link"] else np.eye(3)
    if match["axes"]:
        return turn @ np.eye(3)[:, ["xyz".index(name) for name in match["axes"].split(" and ")]]
    frame = turn @ frame_about(np.array([float(x) for x in match["vector"].split(",")]))
    return frame[:, 2:] if match["sort"] == "along" else frame[:, :2]


@pytest.mark.parametrize("name", SCENES)
def test_components_and_directions(name: str) -> None:
    scene = SCENES[name]()
    run = linkdyn.Scene(scene).inverse(t=[0.0])
    poses = poses_of(scene)
    stress = [stress_of(pose) for pose in poses]
    joints = [joint["name"] for joint in scene["joint"]]
    sorts = ("force", "moment")
    is_open = np.max([np.abs(s).max(axis=-1) for s in stress], axis=0) > NOTHING
    wanted = {f"{joint}.{sort}.{axis}" for j, joint in enumerate(joints) for s, sort in enumerate(sorts) for a, axis in enumerate("xyz") if is_open[j, s, a]}
    assert set(run.attrs["shared_components"].split()) == wanted
    np.testing.assert_array_equal(run.linkdyn.determined.values, ~is_open.reshape(len(joints), 6))
    told = set()
    for clause in run.attrs["shared_directions"].split("; "):
        part, _, words = clause.partition(" ")
        joint, _, sort = part.rpartition(".")
        j, s = joints.index(joint), sorts.index(sort)
        told.add((j, s))
        if not words:
            assert max(np.linalg.matrix_rank(each[j, s], NOTHING) for each in stress) == 3
        elif words.startswith("in "):
            assert max(np.linalg.matrix_rank(each[j, s], NOTHING) for each in stress) == int(words.split()[1])
        else:
            parts = []
            for pose, each in zip(poses, stress, strict=True):
                span = told_span(pose, j, words)
                inside = span.T @ each[j, s]
                np.testing.assert_allclose(span @ inside, each[j, s], rtol=0, atol=2e-6)     # directions are told to six digits
                parts.append(inside)
            if "the axis" not in words:     # whose other axes turn as they like
                assert np.linalg.matrix_rank(np.hstack(parts), 1e-5) == len(parts[0])
    assert told == {(j, s) for j in range(len(joints)) for s in range(2) if is_open[j, s].any()}


def test_what_is_told_of_some() -> None:
    """Of a plane forces across it are open, and moments about its lines."""
    flat = linkdyn.Scene(SCENES["four-bar"]())
    run = flat.inverse(t=[0.0])
    assert run.attrs["shared_components"].split()[:3] == ["J1.force.z", "J1.moment.x", "J1.moment.y"]
    assert run.attrs["shared_directions"].startswith("J1.force along z; J1.moment along x and y; ")
    assert "forces along z and moments of joints J1, J2, J3, J4" in flat.explain()
    leaning = linkdyn.Scene(tilted())
    assert leaning.inverse(t=[0.0]).attrs["shared_directions"].startswith("J1.force along the axis; J1.moment across the axis; ")
    sarrus = linkdyn.Scene(SPATIAL["sarrus"]()).inverse(t=[0.0])
    assert set(sarrus.attrs["shared_components"].split()) == {f"J{k}.moment.z" for k in range(1, 7)}


@pytest.mark.parametrize("name", ["four-bar", "sarrus", "slider"])
def test_determined_components_do_not_move(name: str) -> None:
    """However the others are shared."""
    soft = SCENES[name]() | {"redundancy": "stiffness"}
    for i, joint in enumerate(soft["joint"]):
        keys = {"spherical": ("radial",), "prismatic": ("radial", "tilt")}.get(joint["type"], ("radial", "axial", "tilt"))
        joint["stiffness"] = {key: (1e8 if key != "tilt" else 1e5) * (1 + 0.7 * i) for key in keys}
    run, other = (linkdyn.Scene(scene).inverse(q=some_poses(soft), qd=some_poses(soft), qdd=some_poses(soft)) for scene in (SCENES[name](), soft))
    assert not run.status.values.any() and not other.status.values.any()
    exact = run.linkdyn.determined.values
    largest = np.abs(run.reaction.values).max()
    np.testing.assert_allclose(run.reaction.values[:, exact], other.reaction.values[:, exact], rtol=0, atol=1e-13 * largest)
    assert np.abs((run.reaction - other.reaction).values[:, ~exact]).max() > 1e-4 * largest


def test_without_redundancy_all_is_determined() -> None:
    """Drives share the work of eight legs: no reaction is open by the joints."""
    scene, _, _ = eight_legs()
    run = linkdyn.Scene(scene).inverse(q=[[0, 0, 0.6, 0, 0, 0.1]], qd=[[0.0] * 6], qdd=[[0.0] * 6])
    assert "shared_components" not in run.attrs and run.linkdyn.determined.values.all()


def test_in_the_plane() -> None:
    """Three cranks under one bar press each other along themselves; moments are no unknowns."""
    run = linkdyn.Scene(three_cranks()).inverse(t=[0.0])
    told = dict(clause.partition(" ")[::2] for clause in run.attrs["shared_directions"].split("; "))
    assert told == {f"{end}{name}.force": f"along y of 'crank{name}'" for end in "OE" for name in "ABC"}
    assert not run.linkdyn.determined.sel(component=["Fx", "Fy"]).values.any() and run.linkdyn.determined.sel(component="Mz").values.all()
    aslant = linkdyn.Scene(askew()).inverse(t=[0.0]).attrs["shared_directions"]
    assert "OB.force across (0.8, -0.6, 0) of 'crankB'" in aslant and "OB.moment along x and y" in aslant


def test_friction_reaches_everything() -> None:
    scene = SCENES["four-bar"]()
    scene["friction"] = [{"joint": "J2", "coulomb": 0.1, "radius": 0.02}]
    run = linkdyn.Scene(scene).inverse(t=[0.1])
    assert run.attrs["shared_components"] == "all" and not run.linkdyn.determined.values.any()


def test_files_tell_it(tmp_path: Any) -> None:
    run = linkdyn.Scene(SCENES["four-bar"]()).inverse(t=[0.0])
    run.to_netcdf(tmp_path / "run.nc")
    again = linkdyn.results.read(tmp_path / "run.nc")
    np.testing.assert_array_equal(again.linkdyn.determined.values, run.linkdyn.determined.values)
