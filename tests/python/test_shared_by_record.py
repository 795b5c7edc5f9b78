"""Reactions that the equations leave open: by record against the lanes, which share no formula with it, and against 40 digits."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import linkdyn
import mpmath as mp
import numpy as np
import pytest
from numpy.typing import NDArray
from test_redundancy import SPATIAL, hinges, rails, three_cranks
from test_redundancy_words import CORNERS, Z
from test_trains import PLANAR as PLANAR_TRAINS
from test_trains import SPATIAL as SPATIAL_TRAINS
from test_trains import planets, with_wheels

pytestmark = pytest.mark.accuracy

Array = NDArray[np.float64]
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
MANY = 300                   # samples: enough for a record of groups closed by iteration
TWO_ROADS = 3e-12            # of a sample's largest reaction: planets lose that on lanes, where large forces cancel


def elastic(scene: dict[str, Any]) -> dict[str, Any]:
    """All joints give way, each in its own way."""
    scene = copy.deepcopy(scene) | {"redundancy": "stiffness"}
    for i, joint in enumerate(scene["joint"]):
        soft = {"radial": 1e8 * (1 + i), "axial": 5e7 * (2 + i), "tilt": 1e5 * (1 + 0.3 * i), "torsion": 2e5 * (1 + i)}
        if joint["type"] in ("gear", "rack", "belt"):
            soft = {"tangential": 3e7 * (1 + i)}
        elif scene["space"] == "planar":
            soft = {"radial": soft["radial"]} | ({"tilt": soft["tilt"]} if joint["type"] == "prismatic" else {})
        else:
            lacks = {"prismatic": {"axial"}, "revolute": {"torsion"}, "screw": {"torsion"}, "cylindrical": {"axial", "torsion"},
                     "universal": {"torsion"}, "spherical": {"tilt", "torsion"}}
            soft = {key: value for key, value in soft.items() if key not in lacks[joint["type"]]}
        joint["stiffness"] = soft
    return scene


def between_corners(*kinds: str) -> dict[str, Any]:
    """A four-bar of a plane, drawn in space, its joints of other kinds."""
    scene = hinges(CORNERS, [Z] * 4, kinds)
    for joint in scene["joint"]:
        if joint["type"] == "screw":
            joint["lead"] = 0.02
    return scene


def jack(order: str) -> dict[str, Any]:
    """A spindle in a hinge A, a nut on its thread B and on a slide G, told in this order: of one of these some is let go."""
    axis = [1, 0, 0]
    on = {"A": {"at": [0, 0, 0], "axis": axis}, "B": {"at": [0.4, 0, 0], "axis": axis}, "G": {"at": [0.5, 0.05, 0.1], "axis": axis}}
    joints = {"A": {"name": "A", "type": "revolute", "between": ["frame.A", "spindle.A"]}, "G": {"name": "G", "type": "prismatic", "between": ["frame.G", "nut.G"]},
              "B": {"name": "B", "type": "screw", "lead": 0.007, "between": ["spindle.B", "nut.B"]}}
    return {"space": "spatial", "gravity": [0, 0, -9.81], "frame": {"markers": {name: on[name] for name in "AG"}},
            "link": [{"name": "spindle", "mass": 2.0, "cog": [0.2, 0.01, 0], "inertia": {"diagonal": [1e-3, 0.03, 0.03]}, "markers": {name: on[name] for name in "AB"}},
                     {"name": "nut", "mass": 5.0, "cog": [0.42, 0.03, 0.05], "inertia": {"diagonal": [0.02] * 3}, "markers": {name: on[name] for name in "BG"}}],
            "joint": [joints[name] for name in order], "coordinate": [{"joint": "A"}], "actuator": [{"joint": "A"}]}


KINDS = {"screws": between_corners("revolute", "screw", "cylindrical", "screw"), "universal joints": between_corners("revolute", "universal", "revolute", "universal"),
         "ball": between_corners("revolute", "revolute", "revolute", "spherical"), **{f"jack {order}": jack(order) for order in ("ABG", "AGB", "BAG", "BGA", "GAB", "GBA")}}
SCENES = {
    **KINDS, **{f"elastic {name}": elastic(scene) for name, scene in KINDS.items()},
    **{name: make() for name, make in SPATIAL.items()}, "three cranks": three_cranks(), "rails": rails("planar"), "rails in space": rails("spatial"),
    **PLANAR_TRAINS, **{f"{name} in space": scene for name, scene in SPATIAL_TRAINS.items()},
    **{f"elastic {name}": elastic(SPATIAL[name]()) for name in ("bennett", "sarrus", "spherical", "shaft", "agile_eye")},
    "elastic planets": elastic(planets(3)), "elastic cranks": elastic(three_cranks()), "elastic rails": elastic(rails("spatial")),
}


def about_start(scene: linkdyn.Scene, reach: float = 0.2) -> tuple[Array, Array, Array]:
    random = np.random.default_rng(7)
    start = scene.motion([0.0])[0]
    q = start + random.uniform(-reach, reach, (MANY, start.shape[1]))
    return q, random.normal(size=q.shape), random.normal(size=q.shape)


def has_record(scene: linkdyn.Scene) -> bool:
    """Code is made of records alone, after they have agreed with the lanes."""
    return "reaction" in scene.generate("inverse", want=["reaction"]).header


def assert_same_run(scene: linkdyn.Scene, q: Array, qd: Array, qdd: Array, tolerance: float = TWO_ROADS) -> Any:
    want = ["driving_force", "reaction"]
    record, again = (scene.inverse(q=q, qd=qd, qdd=qdd, threads=threads, want=want) for threads in (1, 2))
    lanes = scene.inverse(q=q, qd=qd, qdd=qdd, solver="gauss-jordan", want=want)
    np.testing.assert_array_equal(record.status.values, lanes.status.values)
    for name in want:
        np.testing.assert_array_equal(record[name].values, again[name].values)
        size = np.abs(lanes.reaction.values).reshape(len(q), -1).max(axis=1)
        apart = np.abs(record[name].values - lanes[name].values).reshape(len(q), -1).max(axis=1)
        good = record.status.values == 0
        assert (apart[good] <= tolerance * size[good]).all() and np.isnan(apart[~good]).all()
    return record


@pytest.mark.parametrize("name", SCENES)
def test_as_the_lanes(name: str) -> None:
    scene = linkdyn.Scene(SCENES[name])
    assert has_record(scene)
    assert not assert_same_run(scene, *about_start(scene, 10.0 if "jack" in name else 0.2)).status.values.any()


@pytest.mark.parametrize("name", ["screws", "universal joints", "sarrus", "nested hinges", "gear and belt", "rack in space", "power split"])
def test_what_is_determined_is_not_touched(name: str) -> None:
    """However the others are shared: but for multiply-adds that are formed elsewhere it is the same to the last digit."""
    scenes = [linkdyn.Scene(scene) for scene in (SCENES[name], elastic(SCENES[name]))]
    samples = about_start(scenes[0])
    by_norm, by_stiffness = (scene.inverse(*samples) for scene in scenes)
    forces = [component.startswith("F") for component in by_norm.component.values]
    determined = np.ones(by_norm.reaction.shape[1:], bool)
    for word in by_norm.attrs["shared_reactions"].split():
        joint, part = word.rsplit(".", 1)
        determined[list(scenes[0].joints).index(joint), np.array(forces) == (part == "force")] = False
    first, second = (run.reaction.values for run in (by_norm, by_stiffness))
    largest = np.abs(first).max()
    assert np.abs(first[:, determined]).max() > 1e-3 * largest
    assert np.abs(first - second).max() > 1e-3 * largest
    # Two roundings: where rows are turned into each other (power split), entries are sums of two products, either of which may be fused.
    np.testing.assert_allclose(first[:, determined], second[:, determined], rtol=0, atol=2 * np.finfo(float).eps * largest)


@pytest.mark.parametrize("name", ["agile_eye", "planetary_gearbox", "tripteron"])
def test_examples(name: str) -> None:
    """Along their motions, too."""
    scene = linkdyn.load(EXAMPLES / name / "scene.toml")
    assert has_record(scene)
    assert_same_run(scene, *about_start(scene, 0.02))
    t = np.linspace(0.0, 1.0, MANY)
    record, lanes = (scene.inverse(t=t, solver=solver) for solver in ("elimination", "lapack"))
    assert not record.status.values.any()
    largest = np.abs(lanes.reaction.values).max()
    np.testing.assert_allclose(record.reaction.values, lanes.reaction.values, rtol=0, atol=TWO_ROADS * largest)


@pytest.mark.parametrize(("scene", "flat", "fits"), [(with_wheels(), 0.0, 1), (three_cranks(), np.pi / 2, -1)], ids=["belt", "cranks"])
def test_what_fits_at_some_samples(scene: dict[str, Any], flat: float, fits: int) -> None:
    """Each sample on its own: beyond the position in which the cranks lie flat the same branch is the crossed linkage, which a belt or a third crank forbids."""
    opened = linkdyn.Scene(scene)
    assert has_record(opened)
    beyond = np.random.default_rng(8).uniform(-1.4, 1.4, (MANY, 1))
    beyond = beyond[np.abs(beyond[:, 0]) > 0.1]
    q = flat + beyond
    run = assert_same_run(opened, q, 0 * q, 0 * q)
    np.testing.assert_array_equal(run.status.values == 0, fits * beyond[:, 0] > 0)
    alone = opened.inverse(q=q, qd=0 * q, qdd=0 * q, want="driving_force")
    np.testing.assert_array_equal(alone.status.values, run.status.values)
    np.testing.assert_array_equal(np.isnan(alone.driving_force.values[:, 0]), fits * beyond[:, 0] < 0)


# ---------------------------------------------------------------- near singular positions


def three_cranks_exactly(q: float) -> Array:
    """Reactions of the parallelogram with a third crank at rest, of the least sum of squares, in 40 digits: equilibrium and its multipliers."""
    with mp.workdps(40):
        angle = mp.mpf(q)
        tip = (-mp.sin(angle) / 2, mp.cos(angle) / 2)
        cog = mp.mpf(0.1) * mp.cos(angle) - mp.mpf(0.2) * mp.sin(angle)    # of a crank, across from its foot
        weight = mp.mpf(-9.81)
        # unknowns: of each crank its force at the foot, that on the bar; the torque. Equations: cranks A, B, C, bar; Fx, Fy, M about the foot or the bar's origin
        balance, load = mp.zeros(12, 13), mp.zeros(12, 1)
        for k in range(3):
            foot, top, row = 4 * k, 4 * k + 2, 3 * k
            for axis in range(2):
                balance[row + axis, foot + axis] = 1
                balance[row + axis, top + axis] = -1
                balance[9 + axis, top + axis] = 1
            balance[row + 2, top], balance[row + 2, top + 1] = tip[1], -tip[0]
            balance[11, top + 1] = k
            load[row + 1], load[row + 2] = -weight, -weight * cog
        balance[2, 12] = 1
        load[10], load[11] = -weight, -weight * mp.mpf(0.1)
        system, right = mp.zeros(25, 25), mp.zeros(25, 1)
        for i in range(12):
            system[i, i] = 1                        # forces count alike, the torque does not
            right[13 + i] = load[i]
            for j in range(13):
                system[13 + i, j] = system[j, 13 + i] = balance[i, j]
        x = mp.lu_solve(system, right)
        return np.array([float(v) for v in x[:12]]).reshape(6, 2)


@pytest.mark.parametrize("off", [1.0, 1e-1, 1e-2, 1e-3, 1e-4])
def test_near_flat(off: float) -> None:
    """A flat parallelogram is singular: what counts as good is, to the digits that the distance leaves."""
    scene = linkdyn.Scene(three_cranks())
    assert list(scene.joints) == ["OA", "EA", "OB", "EB", "OC", "EC"]
    angles = np.pi / 2 - off * np.linspace(0.5, 1.0, 40)
    q = np.tile(angles, 8)[:, np.newaxis]
    record = assert_same_run(scene, q, 0 * q, 0 * q, tolerance=TWO_ROADS / off**2)
    good = record.status.values[:40] == 0
    assert good.all() or off < 1e-3
    for i in np.flatnonzero(good)[::5]:
        expected = three_cranks_exactly(angles[i])
        found = record.reaction.values[i, :, :2]
        np.testing.assert_allclose(found, expected, rtol=0, atol=30 * np.finfo(float).eps / off**2 * np.abs(expected).max())
