"""Pins in slots: against the block, slide and hinge written by hand, and against Whitworth's and the Scotch yoke's closed forms."""

from __future__ import annotations

import copy
from typing import Any

import linkdyn
import numpy as np
import pytest
from test_joint_kinds import along, check_roads, keeps_energy, let_go
from test_space_cams import TILT, in_tilted_axes

pytestmark = pytest.mark.accuracy

CRANK, APART = 0.08, 0.15
SWAY = {"law": "harmonic", "mean": 0.3, "amplitude": 2.0, "frequency": "3 rad/s"}


def crank(**more: Any) -> dict[str, Any]:
    return {"name": "crank", "markers": {"O": [0, 0], "pin": [CRANK, 0]}, "mass": 2.0, "cog": [0.03, 0.01], "inertia": 0.01} | more


def whitworth(apart: float = APART, **more: Any) -> dict[str, Any]:
    """A crank turns a slotted lever: it rocks, or turns round if its pivot is nearer than the pin."""
    return {
        "space": "planar", "gravity": [0, -9.81], "time": {"end": 2, "samples": 201},
        "frame": {"markers": {"lever": [0, 0], "crank": [0, apart]}},
        "link": [crank(), {"name": "lever", "markers": {"O": [0, 0], "slot": {"at": [0.02, 0.01], "axis": [1, 0.1]}, "tip": [0.4, 0]},
                           "mass": 5.0, "cog": [0.2, 0.02], "inertia": 0.15}],
        "joint": [{"name": "crank", "type": "revolute", "between": ["frame.crank", "crank.O"]},
                  {"name": "lever", "type": "revolute", "between": ["frame.lever", "lever.O"]},
                  {"name": "S", "type": "slot", "between": ["lever.slot", "crank.pin"], "start": 0.15}],
        "coordinate": [along("crank", SWAY)], "actuator": [{"joint": "crank"}],
    } | more


def scotch_yoke() -> dict[str, Any]:
    """The slot is across the yoke's guide. Were the crank massless, nothing would move at the yoke's dead points: 0/0 in forward runs."""
    return {
        "space": "planar", "gravity": [0, -9.81], "time": {"end": 2, "samples": 201},
        "frame": {"markers": {"O": [0, 0], "guide": {"at": [0, 0.1], "axis": [1, 0]}}},
        "link": [crank(mass=0.1, inertia=0.002, cog=[0, 0]),
                 {"name": "yoke", "markers": {"guide": {"at": [0, 0.1], "axis": [1, 0]}, "slot": {"at": [0, 0], "axis": [0, 1]}}, "mass": 3.0, "cog": [0.05, 0.02]}],
        "joint": [{"name": "crank", "type": "revolute", "between": ["frame.O", "crank.O"]},
                  {"name": "guide", "type": "prismatic", "between": ["frame.guide", "yoke.guide"]},
                  {"name": "S", "type": "slot", "between": ["yoke.slot", "crank.pin"]}],
        "coordinate": [along("crank", {"law": "constant-rate", "rate": "5 rad/s", "start": 0.2})], "actuator": [{"joint": "crank"}],
    }


def by_hand(scene: dict[str, Any]) -> dict[str, Any]:
    """The block that a slot stands for."""
    written = copy.deepcopy(scene)
    slot = next(joint for joint in written["joint"] if joint["type"] == "slot")
    line, pin = slot["between"]
    slot |= {"type": "prismatic", "between": [line, "S.block.pin"]}
    written["link"].append({"name": "S.block", "markers": {"pin": [0, 0]}, "mass": 0})
    written["joint"].append({"name": "S.pin", "type": "revolute", "between": ["S.block.pin", pin]})
    return written


SCENES = {"lever": whitworth(), "turns round": whitworth(apart=0.05), "yoke": scotch_yoke()}


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_as_written_by_hand(scene: dict[str, Any]) -> None:
    """Bit for bit, names and all."""
    one, other = linkdyn.Scene(scene).inverse(want="all"), linkdyn.Scene(by_hand(scene)).inverse(want="all")
    assert set(one.data_vars) == set(other.data_vars)
    for name in one.data_vars:
        np.testing.assert_array_equal(one[name].values, other[name].values)
    for dim in one.dims:
        if dim in one.coords:
            np.testing.assert_array_equal(one[dim].values, other[dim].values)


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_every_road(scene: dict[str, Any]) -> None:
    check_roads(scene)


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_forward(scene: dict[str, Any]) -> None:
    """The forces found lead along the motion; without them energy stays."""
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 1, 21), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(run.q.values, linkdyn.Scene(scene).motion(run.time.values)[0], atol=1e-7)
    keeps_energy(let_go(scene))


def test_whitworth_in_closed_form() -> None:
    """The lever's angle is the direction to the pin; a straight slot through its pivot, without masses but the lever's."""
    scene = whitworth(gravity=[0, 0])
    scene["link"][0] |= {"mass": 0, "inertia": 0, "cog": [0, 0]}
    scene["link"][1]["markers"]["slot"] = {"at": [0, 0], "axis": [1, 0]}
    found = linkdyn.Scene(scene)
    run = found.inverse(want="all")
    q, qd, qdd = (x[:, 0] for x in found.motion())
    x, y = CRANK * np.cos(q), APART + CRANK * np.sin(q)
    square = x * x + y * y
    ratio = CRANK * (CRANK + APART * np.sin(q)) / square                                       # lever's rate over crank's
    slope = CRANK * APART * np.cos(q) * (square - 2 * CRANK * (CRANK + APART * np.sin(q))) / square**2
    lever = run.joint_variable.sel(variable="lever.angle").values
    np.testing.assert_allclose(np.exp(1j * lever), (x + 1j * y) / np.sqrt(square), atol=1e-14)
    np.testing.assert_allclose(run.joint_variable.sel(variable="S.slide").values, np.sqrt(square), rtol=1e-13)
    np.testing.assert_allclose(run.joint_rate.sel(variable="lever.angle").values, ratio * qd, atol=1e-12)
    inertia = 0.15 + 5.0 * (0.2**2 + 0.02**2)
    moment = inertia * (ratio * qdd + slope * qd**2)
    np.testing.assert_allclose(run.driving_force.values[:, 0], ratio * moment, atol=1e-11)
    force = run.reaction.sel(joint="S").values        # of the lever on the pin
    np.testing.assert_allclose(force[:, 0] * y - force[:, 1] * x, moment, atol=1e-11)
    np.testing.assert_allclose(force[:, 0] * x + force[:, 1] * y, 0.0, atol=1e-12)             # square to the slot
    np.testing.assert_allclose(force[:, 2], 0.0, atol=1e-12)


def test_scotch_yoke_in_closed_form() -> None:
    run = linkdyn.Scene(scotch_yoke()).inverse(want="all")
    angle = run.q.values[:, 0]
    np.testing.assert_allclose(run.joint_variable.sel(variable="guide.slide").values, CRANK * np.cos(angle), atol=1e-15)
    push = -3.0 * CRANK * 25.0 * np.cos(angle)
    np.testing.assert_allclose(run.reaction.sel(joint="S").values[:, 0], -push, atol=1e-11)
    np.testing.assert_allclose(run.driving_force.values[:, 0], -push * CRANK * np.sin(angle), atol=1e-11)


def gimbal() -> dict[str, Any]:
    """A crank's pin in the slot of a lever that swings on a universal joint, as a gear lever does."""
    return {
        "space": "spatial", "gravity": [0, 0, -9.81], "time": {"end": 2, "samples": 201},
        "frame": {"markers": {"crank": [0, 0, 0], "U": {"at": [0.05, -0.02, -0.3], "axis": [1, 0, 0]}}},
        "link": [{"name": "crank", "markers": {"O": [0, 0, 0], "pin": [CRANK, 0, 0.01]}, "mass": 2.0, "cog": [0.03, 0.01, 0], "inertia": [0.01, 0.01, 0.01, 0, 0, 0]},
                 {"name": "lever", "markers": {"U": {"at": [0, 0, 0], "axis": [0, 1, 0]}, "slot": [0, 0, 0.1]}, "start": {"position": [0.05, -0.02, -0.3]},
                  "mass": 1.5, "cog": [0.01, -0.02, 0.25], "inertia": [0.02, 0.021, 0.003, 0.001, 0, 0]}],
        "joint": [{"name": "crank", "type": "revolute", "between": ["frame.crank", "crank.O"]},
                  {"name": "lever", "type": "universal", "between": ["frame.U", "lever.U"]},
                  {"name": "S", "type": "slot", "between": ["lever.slot", "crank.pin"], "start": 0.2}],
        "coordinate": [along("crank", SWAY)], "actuator": [{"joint": "crank"}],
    }


def test_in_space() -> None:
    """The block's pin is a ball there: the lever points at it, and is pushed square to the slot."""
    scene = gimbal()
    run = check_roads(scene).inverse(want="all")
    q = run.q.values[:, 0]
    pin = np.stack([CRANK * np.cos(q), CRANK * np.sin(q), 0 * q + 0.01], axis=1)
    reach = pin - [0.05, -0.02, -0.3]
    length = np.linalg.norm(reach, axis=1)
    np.testing.assert_allclose(run.joint_variable.sel(variable="S.slide"), length - 0.1, rtol=1e-13)
    push = run.reaction.sel(joint="S").values
    np.testing.assert_allclose((push[:, :3] * reach).sum(axis=1), 0, atol=1e-11)
    np.testing.assert_allclose(push[:, 3:], 0, atol=1e-11)
    # What turns the crank: its own weight is about its axis nowhere, and the lever's push.
    torque = -(pin[:, 0] * push[:, 1] - pin[:, 1] * push[:, 0]) + (0.01 + 2 * (0.03**2 + 0.01**2)) * linkdyn.Scene(scene).motion()[2][:, 0]
    np.testing.assert_allclose(run.driving_force.values[:, 0], torque, atol=1e-10)
    written = by_hand(scene)
    written["joint"][-1]["type"] = "spherical"
    written["joint"][-1]["between"][0] = "S.block.ball"
    written["link"][-1]["markers"] = {"pin": {"at": [0, 0, 0], "axis": [1, 0, 0], "x": [0, 1, 0]}, "ball": {"at": [0, 0, 0], "axis": [0, 1, 0], "x": [1, 0, 0]}}
    other = linkdyn.Scene(written).inverse(want="all")
    for name in run.data_vars:
        np.testing.assert_array_equal(run[name].values, other[name].values)
    keeps_energy(let_go(scene))


@pytest.mark.parametrize("name", SCENES)
def test_a_plane_in_tilted_axes(name: str) -> None:
    """In space the slot holds across the plane once more than needed: shared out, it carries nothing there."""
    flat, tilted = (linkdyn.Scene(scene).inverse(want="all") for scene in (SCENES[name], in_tilted_axes(SCENES[name])))
    np.testing.assert_allclose(tilted.driving_force, flat.driving_force, atol=1e-12 * float(np.abs(flat.driving_force).max()) + 1e-13)
    np.testing.assert_allclose(tilted.joint_variable.values[:, :3], flat.joint_variable.values[:, :3], atol=1e-14)
    force = flat.reaction.sel(joint="S").values[:, :2] @ TILT[:, :2].T
    np.testing.assert_allclose(tilted.reaction.sel(joint="S").values[:, :3], force, atol=1e-12 * np.abs(force).max())


def test_led_by_the_slide() -> None:
    """The pin's way along the slot is a joint variable as any: a coordinate, a drive, a spring, friction."""
    scene = whitworth()
    scene["coordinate"] = [along("S", {"law": "harmonic", "mean": 0.17, "amplitude": 0.02, "frequency": "3 rad/s"})]
    scene["actuator"] = [{"joint": "S"}]
    scene["joint"][2].pop("start")
    scene["link"][0]["start"] = {"position": [0, APART], "angle": "70 deg"}
    scene["spring"] = [{"name": "k", "joint": "S", "stiffness": 300.0, "rest": 0.15}]
    check_roads(scene)
    scene["friction"] = [{"joint": "S", "coulomb": 0.1}]
    run = linkdyn.Scene(scene).inverse(want="all")
    assert (run.status == 0).all() and run.friction_power.sel(joint="S").values.min() >= 0 < run.friction_power.sel(joint="S").values.max()
    assert np.abs(run.power_imbalance).max() < 1e-10


def test_repeated() -> None:
    """Copies have a block each; a slot of a scene of Python's is found by its name."""
    scene = whitworth()
    scene["joint"][2] = {"name": "S#", "type": "slot", "between": ["lever.slot", "crank.pin"], "start": 0.15, "repeat": 1}
    found = linkdyn.Scene(scene)
    assert [joint["name"] for joint in found.description["joints"]] == ["crank", "lever", "S1", "S1.pin"]
    assert [link["name"] for link in found.description["links"]] == ["frame", "crank", "lever", "S1.block"]


def test_in_sweeps_and_ensembles() -> None:
    scene = linkdyn.Scene(whitworth())
    free = linkdyn.Scene(let_go(whitworth()))
    times = np.linspace(0, 0.5, 6)
    spun = free.ensemble([[0.1], [0.2]], [[0.3], [5.0]], times, step=1e-3)
    one = free.forward(t=times, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(spun.q.values[0, :, 0], one.q.values[:, 0], atol=1e-8)
    lengths, q = (0.06, 0.1), np.linspace(0.1, 6.0, 33)[:, None]
    swept = scene.sweep({"reduce": ["driving_force"], "axis": [{"coordinate": "crank", "linspace": [0.1, 6.0, 33]}, {"rate": "crank", "values": [5.0]},
                                                               {"parameter": "link.crank.markers.pin[0]", "values": list(lengths)}]})
    largest = max(float(scene.with_({"link.crank.markers.pin[0]": length}).inverse(q=q, qd=0 * q + 5, qdd=0 * q).driving_force.max()) for length in lengths)
    assert float(swept.driving_force_max.max()) == pytest.approx(largest, rel=1e-12)


@pytest.mark.parametrize("case", [0, 13, 34, 40, 53, 55])
def test_start_of_the_block(case: int) -> None:
    """Where `start` says where all links are, they are there: the block, to which nobody can give one, begins on its slot at its pin."""
    rng = np.random.default_rng(case)
    pivot, pin, hinge, _ = (rng.uniform(-0.3, 0.3, (4, 3)).round(2) + [3.0, 0.0, 0.0]).tolist()
    axis, line, first, other = rng.uniform(-1, 1, (4, 3)).round(1).tolist()
    crank = {"A": {"at": pivot, "axis": axis}, "pin": pin}
    arm = {"S": {"at": pin, "axis": line}, "B": {"at": hinge, "axis": np.cross(first, other).tolist()}}
    here = {"mass": 1.0, "inertia": {"diagonal": [0.01, 0.01, 0.01]}, "start": {"position": [0, 0, 0]}}
    scene = linkdyn.Scene({
        "space": "spatial", "frame": {"markers": {"A": crank["A"], "B": {"at": hinge, "axis": first}}},
        "link": [here | {"name": "crank", "markers": crank}, here | {"name": "arm", "markers": arm}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]}, {"name": "B", "type": "universal", "between": ["frame.B", "arm.B"]},
                  {"name": "S", "type": "slot", "between": ["arm.S", "crank.pin"]}],
        "coordinate": [{"joint": "A"}],
    })  # fmt: skip
    place = scene.poses(np.zeros((1, 1)))
    assert np.abs(place.position[0, :2]).max() < 1e-12 and np.abs(place.rotation[0, :2] - np.eye(3)).max() < 1e-12
