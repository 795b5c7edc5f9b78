"""Links led by parts of their pose: the same forces as when joints lead the mechanism along the same motion."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
import xarray as xr

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
ROUNDING = 1e-11
"""Relative; what the examples' own condition leaves is 1e-14."""


def led(example: str, coordinates: list[dict[str, Any]], **other: Any) -> linkdyn.Scene:
    """An example with other coordinates, and no motion."""
    data = tomllib.loads((EXAMPLES / example / "scene.toml").read_text())
    return linkdyn.Scene(data | {"coordinate": coordinates} | other)


def compare(led_by_joints: linkdyn.Scene, run: xr.Dataset, other: linkdyn.Scene, marker: str, components: str) -> xr.Dataset:
    """Lead the other scene by where the marker was, how it moved and was accelerated."""
    motion = run.linkdyn.marker(marker, scene=led_by_joints)
    part = ["xyz".index(component) for component in components]
    again = other.inverse(q=motion.position.values[:, part], qd=motion.velocity.values[:, part], qdd=motion.acceleration.values[:, part])
    assert (again.status.values == 0).all()
    for name in ("driving_force", "reaction"):
        assert np.abs(again[name].values - run[name].values).max() < ROUNDING * np.abs(run[name].values).max()
    assert np.abs(again.power_imbalance.values).max() < ROUNDING
    return again


def test_five_bar_by_its_tip() -> None:
    """In the plane: x and y of the hinge between both rods."""
    scene = linkdyn.load(EXAMPLES / "fivebar_parallel" / "scene.toml")
    other = led("fivebar_parallel", [{"marker": "rod1.J3", "components": ["x", "y"], "start": {"x": -0.02, "y": 0.86}}])
    assert other.coordinates == ("rod1.J3.x", "rod1.J3.y")
    run = scene.inverse()
    again = compare(scene, run, other, "rod1.J3", "xy")
    # and what Python finds of its links' motion, by a road of its own
    for marker in ("crank2.J4", "rod2.J3"):
        one, two = (r.linkdyn.marker(marker, scene=s) for r, s in ((run, scene), (again, other)))
        for name in ("velocity", "acceleration"):
            assert np.abs(one[name] - two[name]).max() < 1e-9 * np.abs(one[name]).max()


def test_delta_by_its_tool() -> None:
    """In space: x, y and z of a marker; six rods between balls."""
    scene = linkdyn.load(EXAMPLES / "delta" / "scene.toml")
    other = led("delta", [{"marker": "platform.tool", "components": ["z", "x", "y"], "start": {"z": -0.75}}])
    assert other.coordinates == ("platform.tool.x", "platform.tool.y", "platform.tool.z")
    compare(scene, scene.inverse(), other, "platform.tool", "xyz")


@pytest.mark.parametrize(("leader", "height"), [({"marker": "platform.tool"}, -0.79), ({"link": "platform"}, -0.75)])
def test_a_pose_begins_where_its_link_starts(leader: dict[str, str], height: float) -> None:
    """The platform's start is 0.75 m below the motors, its tool 40 mm lower; the coordinates say nothing, or something else of one."""
    scene = led("delta", [leader | {"components": ["x", "y", "z"]}])
    np.testing.assert_allclose(scene.simulator().q, [0.0, 0.0, height], atol=1e-15)
    scene = led("delta", [leader | {"components": ["x", "y", "z"], "start": {"x": 0.01, "y": {"velocity": 0.2}}}])
    np.testing.assert_allclose(scene.simulator().q, [0.01, 0.0, height], atol=1e-15)
    moved = led("delta", [leader | {"components": ["x", "y", "z"], "motion": {"x": 0.0, "y": 0.0, "z": -0.7}}])
    np.testing.assert_allclose(moved.simulator().q, [0.0, 0.0, -0.7], atol=1e-15)


def test_a_free_body_begins_where_its_link_starts() -> None:
    """All six components, of its origin and of a marker; the attitude turns what leads there."""
    angles = np.array([0.3, -0.4, 1.1])
    roll, pitch, yaw = angles
    turn = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    turn = turn @ [[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]]
    turn = turn @ [[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]]
    body = {
        "name": "body",
        "mass": 1.0,
        "inertia": {"diagonal": [0.1, 0.2, 0.25]},
        "markers": {"tip": [0.1, 0.2, 0.3]},
        "start": {"position": [1.0, 2.0, 3.0], "angles": list(angles)},
    }
    for leader, place in (({"link": "body"}, np.zeros(3)), ({"marker": "body.tip"}, turn @ [0.1, 0.2, 0.3])):
        scene = linkdyn.Scene({"title": "a body", "space": "spatial", "gravity": [0, 0, 0], "link": [body], "coordinate": [leader]})
        np.testing.assert_allclose(scene.simulator().q, [*(place + [1.0, 2.0, 3.0]), *angles], atol=1e-15)


def tripod_by_legs() -> linkdyn.Scene:
    return led("tripod", [{"joint": f"leg{k}", "start": "632.455532 mm"} for k in (1, 2, 3)])


def attitude(rotation: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw of Rx(roll) Ry(pitch) Rz(yaw)."""
    return np.stack([np.arctan2(-rotation[..., 1, 2], rotation[..., 2, 2]), np.arcsin(rotation[..., 0, 2]),
                     np.arctan2(-rotation[..., 0, 1], rotation[..., 0, 0])], axis=-1)


@pytest.mark.parametrize("components", [("z", "roll", "pitch")])
def test_tripod_by_height_and_tilt(components: tuple[str, ...]) -> None:
    """Positions and angles mixed, against legs as coordinates: rates from differences of sixth order."""
    legs = tripod_by_legs()
    t, h = np.linspace(0.0, 2.0, 17), 2e-3
    phase = np.arange(3)

    def length(t: np.ndarray) -> np.ndarray:
        return 0.632455532 + 0.05 * (np.sin(2 * t[:, np.newaxis] + phase) - np.sin(phase))

    def part(t: np.ndarray) -> np.ndarray:
        poses = legs.poses(q=length(t))
        assert (poses.status == 0).all()
        whole = np.concatenate([poses.position[:, 0], attitude(poses.rotation[:, 0])], axis=1)
        return whole[:, [["x", "y", "z", "roll", "pitch", "yaw"].index(name) for name in components]]

    angle = 2 * t[:, np.newaxis] + phase
    run = legs.inverse(q=length(t), qd=0.1 * np.cos(angle), qdd=-0.2 * np.sin(angle))
    at = {k: part(t + k * h) for k in range(-3, 4)}
    rate = (45 * (at[1] - at[-1]) - 9 * (at[2] - at[-2]) + (at[3] - at[-3])) / (60 * h)
    rate2 = (2 * (at[3] + at[-3]) - 27 * (at[2] + at[-2]) + 270 * (at[1] + at[-1]) - 490 * at[0]) / (180 * h * h)
    again = led("tripod", [{"link": "platform", "components": list(components), "start": {"z": 0.6}}]).inverse(q=at[0], qd=rate, qdd=rate2)
    assert (again.status.values == 0).all()
    differences = 1e-16 / h**2 * 100    # rounding of a second difference, a hundredfold for the forces it makes
    for name in ("driving_force", "reaction"):
        assert np.abs(again[name].values - run[name].values).max() < differences * np.abs(run[name].values).max()


def test_solvers_and_error_estimates_agree() -> None:
    """Gauss-Jordan and LAPACK on lanes against the record; errors are of rounding."""
    scene = linkdyn.load(EXAMPLES / "tripod" / "scene.toml")
    run = scene.inverse(error=True)
    size = np.abs(run.driving_force.values).max()
    for solver in ("gauss-jordan", "lapack"):
        assert np.abs(scene.inverse(solver=solver).driving_force.values - run.driving_force.values).max() < ROUNDING * size
    assert run.driving_force_error.values.max() < ROUNDING * size


def test_forward_after_inverse() -> None:
    """Left to itself from one state, the tripod goes the same way whatever its coordinates; energy is kept."""
    push = [{"joint": "leg#", "repeat": 3, "law": {"type": "constant", "value": 150.0}}]
    tilt = {"z": {"position": 0.6, "velocity": 0.1}, "roll": {"position": 0.05, "velocity": -0.3}, "pitch": {"position": -0.02, "velocity": 0.2}}
    tilted = led("tripod", [{"link": "platform", "components": ["z", "roll", "pitch"], "start": tilt}], actuator=push)
    first = tilted.inverse(q=[[0.6, 0.05, -0.02]], qd=[[0.1, -0.3, 0.2]], qdd=[[0.0, 0.0, 0.0]])
    where = {name: first.joint_variable.sel(variable=f"{name}.slide").item() for name in ("leg1", "leg2", "leg3")}
    speed = {name: float(first.driving_speed.values[0, k]) for k, name in enumerate(where)}
    by_legs = led("tripod", [{"joint": name, "start": {"position": where[name], "velocity": speed[name]}} for name in where], actuator=push)
    runs = [scene.forward(t=np.linspace(0.0, 0.15, 4)) for scene in (tilted, by_legs)]
    for run in runs:
        assert (run.status.values == 0).all()
    slides = [run.joint_variable.sel(variable=[f"{name}.slide" for name in where]).values for run in runs]
    assert np.abs(slides[0] - slides[1]).max() < 1e-8
    assert np.ptp(slides[0], axis=0).max() > 1e-2


ARM: dict[str, Any] = {
    "space": "spatial",
    "gravity": [0.0, -9.81, 0.0],
    "frame": {"markers": {"P": {"at": [0.0, 0.0, 0.1], "axis": [1.0, 0.2, 0.1]}}},
    "link": [
        {"name": "carriage", "mass": 3.0, "inertia": {"diagonal": [0.1, 0.1, 0.1]},
         "markers": {"P": {"at": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0]}, "A": {"at": [0.1, 0.05, 0.0], "axis": [0.0, 0.0, 1.0]}}},
        {"name": "upper", "mass": 1.0, "cog": [0.2, 0.0, 0.0], "inertia": {"diagonal": [0.001, 0.02, 0.02]},
         "markers": {"A": {"at": [0.0, 0.0, 0.0], "axis": [0.0, 0.0, 1.0]}, "B": {"at": [0.4, 0.0, 0.0], "axis": [0.0, 0.3, 1.0]}}},
        {"name": "lower", "mass": 0.7, "cog": [0.15, 0.0, 0.0], "inertia": {"diagonal": [0.001, 0.01, 0.01]},
         "markers": {"B": {"at": [0.0, 0.0, 0.0], "axis": [0.0, 0.0, 1.0]}, "tip": [0.3, 0.02, 0.05]}},
    ],
    "joint": [
        {"name": "P", "type": "cylindrical", "between": ["frame.P", "carriage.P"]},
        {"name": "A", "type": "revolute", "between": ["carriage.A", "upper.A"]},
        {"name": "B", "type": "revolute", "between": ["upper.B", "lower.B"], "start": 1.0},
    ],
    "actuator": [{"joint": "P", "variable": "slide"}, {"joint": "P", "variable": "angle"}, {"joint": "A"}, {"joint": "B"}],
}  # fmt: skip
CARRIAGE = [{"joint": "P", "variable": "slide"}, {"joint": "P", "variable": "angle"}]


@pytest.mark.parametrize("components", [("x", "y"), ("z", "pitch")])
def test_seen_from_a_moving_link(components: tuple[str, ...]) -> None:
    """An arm on a carriage that slides and turns, led by its tip as the carriage sees it."""
    by_joints = linkdyn.Scene(ARM | {"coordinate": [*CARRIAGE, {"joint": "A"}, {"joint": "B"}]})
    rng = np.random.default_rng(1)
    n, h = 24, 2e-3
    q = np.column_stack([rng.uniform(-0.3, 0.3, n), rng.uniform(-0.8, 0.8, n), rng.uniform(-0.5, 0.5, n), rng.uniform(0.7, 1.4, n)])
    qd, qdd = rng.normal(size=(n, 4)), 3 * rng.normal(size=(n, 4))

    def seen(t: float) -> np.ndarray:
        poses = by_joints.poses(q=q + t * qd + t * t / 2 * qdd)
        base, tool = poses.rotation[:, 0], poses.rotation[:, 2]
        tip = poses.position[:, 2] + tool @ np.array([0.3, 0.02, 0.05]) - poses.position[:, 0]
        whole = np.concatenate([np.einsum("nji,nj->ni", base, tip), attitude(np.einsum("nji,njk->nik", base, tool))], axis=1)
        return whole[:, [["x", "y", "z", "roll", "pitch", "yaw"].index(name) for name in components]]

    at = {k: seen(k * h) for k in range(-3, 4)}
    rate = (45 * (at[1] - at[-1]) - 9 * (at[2] - at[-2]) + (at[3] - at[-3])) / (60 * h)
    rate2 = (2 * (at[3] + at[-3]) - 27 * (at[2] + at[-2]) + 270 * (at[1] + at[-1]) - 490 * at[0]) / (180 * h * h)
    start = dict(zip(components, at[0].mean(axis=0).tolist()))
    scene = linkdyn.Scene(ARM | {"coordinate": [*CARRIAGE, {"marker": "lower.tip", "relative_to": "carriage", "components": list(components), "start": start}]})
    run, again = by_joints.inverse(q=q, qd=qd, qdd=qdd), scene.inverse(
        q=np.column_stack([q[:, :2], at[0]]), qd=np.column_stack([qd[:, :2], rate]), qdd=np.column_stack([qdd[:, :2], rate2]))
    assert (again.status.values == 0).all()
    assert np.abs(again.joint_variable.values - run.joint_variable.values).max() < 1e-9
    error = np.abs(again.driving_force.values - run.driving_force.values).max(axis=1) / np.abs(run.driving_force.values).max(axis=1)
    assert error.max() < 1e-8
    motion = [r.linkdyn.marker("lower.tip", scene=s).acceleration.values for r, s in ((run, by_joints), (again, scene))]
    assert np.abs(motion[0] - motion[1]).max() < 1e-7


SPATIAL = ["x", "y", "z", "roll", "pitch", "yaw"]


@pytest.mark.parametrize("tables", [[SPATIAL], [SPATIAL[:3], SPATIAL[3:]], [["y", "yaw"], ["x", "z", "roll", "pitch"]]])
@pytest.mark.parametrize("leader", [{"link": "platform"}, {"marker": "platform.center"}])
def test_all_components_are_the_pose(leader: dict[str, str], tables: list[list[str]]) -> None:
    """Named one by one, in one table or in several, also of a marker: they lead the link as the pose without names does, in closed form."""
    scene = linkdyn.load(EXAMPLES / "stewart_tsai" / "scene.toml")
    run = scene.inverse()
    first = dict(zip(SPATIAL, run.q.values[0].tolist()))
    other = led("stewart_tsai", [leader | {"components": table, "start": {name: first[name] for name in table}} for table in tables])
    assert "Newton's method" not in other.explain()
    order = [SPATIAL.index(name) for table in tables for name in sorted(table, key=SPATIAL.index)]
    for solver in ("elimination", "lapack"):
        again = other.inverse(q=run.q.values[:, order], qd=run.qd.values[:, order], qdd=run.qdd.values[:, order], solver=solver)
        assert again.attrs["samples_iterated"] == 0
        for name in ("driving_force", "reaction"):
            assert np.abs(again[name].values - run[name].values).max() < ROUNDING * np.abs(run[name].values).max()


@pytest.mark.parametrize("tables", [[["x", "y", "yaw"]], [["x", "y"], ["yaw"]], [["x"], ["yaw", "y"]]])
def test_a_point_of_a_link_and_its_angle_seen_from_a_crank(tables: list[list[str]]) -> None:
    """In the plane, against the slides and the hinge that carry the link on the crank; where the tip is and how it moves by hand."""
    tip = np.array([0.3, -0.2])
    data: dict[str, Any] = {
        "title": "A body on a crank", "space": "planar", "gravity": [0.0, -9.81], "frame": {"markers": {"O": [0.1, 0.2]}},
        "link": [
            {"name": "crank", "mass": 2.0, "cog": [0.1, 0.05], "inertia": 0.3, "markers": {"O": [0, 0], "x": {"at": [0.4, 0.1], "axis": [1, 0]}}},
            {"name": "sled", "mass": 0.5, "inertia": 0.1, "markers": {"x": {"at": [0, 0], "axis": [1, 0]}, "y": {"at": [0, 0], "axis": [0, 1]}}},
            {"name": "lift", "mass": 0.4, "inertia": 0.1, "markers": {"y": {"at": [0, 0], "axis": [0, 1]}, "B": [0, 0]}},
            {"name": "body", "mass": 1.5, "cog": [0.2, 0.1], "inertia": 0.2, "markers": {"B": [0, 0], "tip": list(tip)}},
        ],
        "joint": [
            {"name": "O", "type": "revolute", "between": ["frame.O", "crank.O"]},
            {"name": "x", "type": "prismatic", "between": ["crank.x", "sled.x"]},
            {"name": "y", "type": "prismatic", "between": ["sled.y", "lift.y"]},
            {"name": "B", "type": "revolute", "between": ["lift.B", "body.B"]},
        ],
        "actuator": [{"joint": name} for name in "OxyB"],
    }
    by_joints = linkdyn.Scene(data | {"coordinate": [{"joint": name} for name in "OxyB"]})
    other = linkdyn.Scene(data | {"coordinate": [{"joint": "O"}, *({"marker": "body.tip", "relative_to": "crank", "components": table} for table in tables)]})
    assert "Newton's method" not in other.explain()
    rng = np.random.default_rng(8)
    q, qd, qdd = (rng.uniform(-1.0, 1.0, (40, 4)) for _ in range(3))
    run = by_joints.inverse(q=q, qd=qd, qdd=qdd)
    cos, sin = np.cos(q[:, 3:]), np.sin(q[:, 3:])
    arm = np.hstack([cos * tip[0] - sin * tip[1], sin * tip[0] + cos * tip[1]])
    left = np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    names = {"x": 0, "y": 1, "yaw": 2}
    order = [names[name] for table in tables for name in sorted(table)]
    q2 = np.hstack([q[:, 1:3] + arm + [0.4, 0.1], q[:, 3:]])[:, order]
    qd2 = np.hstack([qd[:, 1:3] + qd[:, 3:] * left, qd[:, 3:]])[:, order]
    qdd2 = np.hstack([qdd[:, 1:3] + qdd[:, 3:] * left - qd[:, 3:] ** 2 * arm, qdd[:, 3:]])[:, order]
    for solver in ("elimination", "lapack"):
        again = other.inverse(q=np.hstack([q[:, :1], q2]), qd=np.hstack([qd[:, :1], qd2]), qdd=np.hstack([qdd[:, :1], qdd2]), solver=solver)
        assert (again.status.values == 0).all()
        for name in ("driving_force", "reaction", "joint_variable", "joint_rate"):
            assert np.abs(again[name].values - run[name].values).max() < ROUNDING * np.abs(run[name].values).max()


def test_assemblies_are_told_by_joints() -> None:
    """What leads a link tells no assemblies apart: starts of joints choose among them, and that of the link where the scene has one."""
    scene = linkdyn.load(EXAMPLES / "tripod" / "scene.toml")
    found = scene.assemblies()
    assert len(found) > 1
    assert all(name.split(".")[0] != "platform" for one in found for name in one.start)
    assert all(set(one.place) == {"platform"} for one in found)


def test_a_loop_that_closes_by_its_gear() -> None:
    """A geared five-bar led by the height of its tip: a part of its way, closed by iteration, is that led by the crank."""
    scene = linkdyn.load(EXAMPLES / "geared_fivebar" / "scene.toml")
    run = scene.inverse(t=np.linspace(0.0, 0.25, 401), want="all")
    height = run.linkdyn.marker("rod1.C", scene=scene).position.values[:, 1]
    first = 1 + int(np.argmax(np.abs(np.diff(height))))
    part = scene.inverse(t=run.time.values[first - 15:first + 15], want="all")
    data = tomllib.loads((EXAMPLES / "geared_fivebar" / "scene.toml").read_text())
    start = {name.rpartition(".")[0]: value for name, value in zip(part["variable"].values, part.joint_variable.values[0].tolist())}
    joints = [{key: value for key, value in joint.items() if key != "branch"} | ({"start": start[joint["name"]]} if joint["name"] in start else {}) for joint in data["joint"]]
    y = float(part.linkdyn.marker("rod1.C", scene=scene).position.values[0, 1])
    other = led("geared_fivebar", [{"marker": "rod1.C", "components": ["y"], "start": {"y": y}}], joint=joints)
    compare(scene, part, other, "rod1.C", "y")


def test_results_name_joints_only() -> None:
    """What leads a link is no joint: it has no reaction."""
    run = linkdyn.load(EXAMPLES / "tripod" / "scene.toml").inverse()
    assert list(run.joint.values) == [f"{name}{k}" for name in ("H", "leg", "S") for k in (1, 2, 3)]
    assert run.sizes["variable"] == 3 + 3 + 9
