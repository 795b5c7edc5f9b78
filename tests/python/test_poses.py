"""Attitudes given as quaternions and matrices: right at every attitude, angles' poles included.

The road apart: axes of a link are a matter of taste. Turned in the body, they put the pole elsewhere, where the same motion is far
from it and angles tell it as ever."""

from __future__ import annotations

import copy
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import linkdyn
from linkdyn.cli import executable

SCENES = Path(__file__).parents[1] / "scenes"
BY = Rotation.from_euler("y", 90, degrees=True)
"""How axes of the platform are turned: where it lies level they are at their pole."""
SOLVERS = ["elimination", "lapack", "gauss-jordan", "reduced"]


def turned_axes(given: dict[str, Any], link: str, by: Rotation = BY) -> dict[str, Any]:
    """The same body, written in axes that are turned: R of the new axes is that of the old ones times `by`."""
    given = copy.deepcopy(given)
    body = next(one for one in given["link"] if one["name"] == link)
    for name, marker in body["markers"].items():
        if not isinstance(marker, dict):
            marker = {"at": marker}
        at, axis, x = (by.inv().apply(marker.get(key, usual)) for key, usual in (("at", 0), ("axis", [0, 0, 1]), ("x", [1, 0, 0])))
        body["markers"][name] = {"at": at.tolist(), "axis": axis.tolist(), "x": x.tolist()}
    body["cog"] = by.inv().apply(body.get("cog", [0, 0, 0])).tolist()
    xx, yy, zz, xy, yz, zx = body["inertia"]
    tensor = by.inv().as_matrix() @ np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]) @ by.as_matrix()
    given["coordinate"][0]["start"]["quaternion"] = np.roll(by.as_quat(), 1).tolist()
    body["inertia"] = [float(tensor[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))]
    return given


def hexapod(kind: str = "UPS") -> dict[str, Any]:
    """A platform on six legs, its markers one by one."""
    turn = np.pi / 180 * np.array([10, -10, 130, 110, 250, 230])
    top = np.pi / 180 * np.array([50, -50, 170, 70, 290, 190])
    legs: dict[str, Any] = {
        "type": kind,
        "base": [f"frame.B{k}" for k in range(1, 7)],
        "platform": [f"platform.P{k}" for k in range(1, 7)],
        "axis": [0, 1, 0],
    }
    if kind == "UPS":
        legs["lower"] = {"mass": 10, "cog": [0, 0, 0.3], "inertia": [0.4, 0.4, 0.02, 0, 0, 0]}
        legs["upper"] = {"mass": 6, "cog": [0, 0, -0.3], "inertia": [0.3, 0.3, 0.01, 0, 0, 0]}
    else:
        legs |= {"zero": [1, 0, 0], "elbow": 1, "crank": {"length": 0.4, "mass": 3}, "rod": {"length": 1.0, "mass": 2}}
    return {
        "space": "spatial",
        "gravity": [0, 0, -9.81],
        "frame": {"markers": {f"B{k + 1}": [0.9 * np.cos(a), 0.9 * np.sin(a), 0] for k, a in enumerate(turn)}},
        "link": [
            {
                "name": "platform",
                "mass": 120,
                "cog": [0.03, -0.05, 0.1],
                "inertia": [8, 9, 15, 0.4, -0.3, 0.6],
                "markers": {f"P{k + 1}": [0.5 * np.cos(a), 0.5 * np.sin(a), 0] for k, a in enumerate(top)},
            }
        ],
        "chain": [legs],
        "coordinate": [{"link": "platform", "start": {"position": [0, 0, 0.9]}}],
    }


def wobble(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A motion of the platform in angles, level at 0: it passes exactly through that attitude."""
    rate = np.array([3.0, 2.0, 2.5, 1.5, 4.0, 2.2])
    size = np.array([0.05, 0.04, 0.03, 0.12, -0.1, 0.15])
    phase = np.outer(t, rate)
    q = size * np.sin(phase) + np.array([0, 0, 0.9, 0, 0, 0])
    return q, size * rate * np.cos(phase), -size * rate**2 * np.sin(phase)


def spins(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angular velocity and acceleration of R = Rx Ry Rz: sums of rates about axes that earlier angles carry round."""
    x = np.broadcast_to([1.0, 0.0, 0.0], (len(q), 3))
    first = Rotation.from_euler("x", q[:, 3, None])
    y = first.apply([0.0, 1.0, 0.0])
    z = (first * Rotation.from_euler("y", q[:, 4, None])).apply([0.0, 0.0, 1.0])
    a, b, c = (qd[:, k, np.newaxis] for k in (3, 4, 5))
    omega = a * x + b * y + c * z
    alpha = qdd[:, 3, None] * x + qdd[:, 4, None] * y + qdd[:, 5, None] * z + a * b * np.cross(x, y) + c * np.cross(a * x + b * y, z)
    return omega, alpha


def rotation_of(q: np.ndarray) -> Rotation:
    return Rotation.from_euler("XYZ", q[:, 3:])


def quaternions(rotation: Rotation) -> np.ndarray:
    """The scalar first."""
    return np.roll(rotation.as_quat(), 1, axis=1)


def pose_of(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, by: Rotation = BY) -> linkdyn.Pose:
    omega, alpha = spins(q, qd, qdd)
    return linkdyn.Pose(
        q[:, :3],
        quaternions(rotation_of(q) * by),
        velocity=qd[:, :3],
        acceleration=qdd[:, :3],
        angular_velocity=omega,
        angular_acceleration=alpha,
    )


def close(one: Any, other: Any, tolerance: float = 1e-11) -> None:
    """To rounding, by the largest number."""
    np.testing.assert_allclose(one, other, rtol=0, atol=tolerance * float(np.abs(other).max()))


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("kind", ["UPS", "RUS"])
def test_platform_at_its_pole(kind: str, solver: str) -> None:
    """Forces of a hexapod that is level, where its axes have their pole, and about there, from centimetres and degrees down to 1e-9 s
    off: those of the same body in other axes."""
    around = np.outer([-1, 1], np.logspace(-9, -1, 20)).ravel()
    t = np.concatenate([[0.0], around, np.linspace(0, 2, 50)])
    given = wobble(t)
    scene = linkdyn.Scene(hexapod(kind))
    other = linkdyn.Scene(turned_axes(hexapod(kind), "platform"))
    straight = scene.inverse(*given, solver=solver)
    run = other.inverse(pose={"platform": pose_of(*given)}, solver=solver)
    assert (run.status == 0).all() and (straight.status == 0).all()
    for name in {"driving_force", "driving_speed", "reaction", "joint_rate"} & set(run.data_vars):
        if name == "joint_rate":      # but of the balls, whose angles hang on the platform's axes
            legs = [k for k, variable in enumerate(run.variable.values) if variable.split(".")[1] in ("U", "P", "R")]
            close(run[name].values[:, legs], straight[name].values[:, legs])
        else:
            close(run[name], straight[name])
    assert abs(run.power_imbalance).max() < 1e-12
    close(run.quaternion[:, 0], quaternions(rotation_of(given[0]) * BY) / 1.0)


def seen_from_carriage(coordinate: dict[str, Any]) -> dict[str, Any]:
    """The hexapod on a carriage that turns about x, its platform in axes that have their pole where it lies level on the carriage."""
    given = turned_axes(hexapod(), "platform")
    base = given["frame"]["markers"]
    given["frame"]["markers"] = {"O": {"at": [0, 0, 0], "axis": [1, 0, 0]}}
    carriage = {"name": "carriage", "mass": 50, "inertia": [5, 4, 3, 0.1, 0.2, 0.3], "markers": base | {"O": {"at": [0, 0, 0], "axis": [1, 0, 0]}}}
    given["link"].append(carriage)
    given["link"][0]["markers"]["tool"] = [0.1, 0.2, 0.3]
    given["joint"] = [{"name": "O", "type": "revolute", "between": ["frame.O", "carriage.O"]}]
    given["chain"][0]["base"] = [f"carriage.B{k}" for k in range(1, 7)]
    given["coordinate"] = [{"joint": "O"}, coordinate]
    given["actuator"] = [{"joint": "O"}]
    return given


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("point", ["platform", "platform.tool"])
def test_pose_seen_from_a_moving_link_at_its_pole(point: str, solver: str) -> None:
    """The place of a marker, and the attitude, as a link sees them that turns: forces are those of the same motion told from the
    frame."""
    of = {"marker": point} if "." in point else {"link": point}
    level = {"quaternion": np.roll(BY.as_quat(), 1).tolist()}
    straight = linkdyn.Scene(seen_from_carriage({"link": "platform", "start": {"position": [0, 0, 0.9]} | level}))
    start = {"x": 0, "y": 0, "z": 0.9, "roll": 0, "pitch": "90 deg", "yaw": 0}
    scene = linkdyn.Scene(seen_from_carriage(of | {"relative_to": "carriage", "start": start}))

    t = np.concatenate([[0.0], np.outer([-1, 1], np.logspace(-9, -1, 10)).ravel(), np.linspace(0, 2, 20)])
    q, qd, qdd = wobble(t)
    seen = pose_of(q, qd, qdd)
    arm = Rotation.from_quat(np.roll(seen.quaternion, -1, axis=1)).apply([0.1, 0.2, 0.3] if "." in point else [0, 0, 0])
    spin, spin_rate = seen.angular_velocity, seen.angular_acceleration
    tip = linkdyn.Pose(
        seen.position + arm,
        seen.quaternion,
        velocity=seen.velocity + np.cross(spin, arm),
        acceleration=seen.acceleration + np.cross(spin_rate, arm) + np.cross(spin, np.cross(spin, arm)),
        angular_velocity=spin,
        angular_acceleration=spin_rate,
    )
    angle, rate, rate2 = 0.5 * np.sin(3 * t), 1.5 * np.cos(3 * t), -4.5 * np.sin(3 * t)
    turn = Rotation.from_euler("x", angle[:, np.newaxis])
    w, w2 = (np.outer(one, [1.0, 0, 0]) for one in (rate, rate2))
    p, v, a, o, o2 = (turn.apply(one) for one in (seen.position, seen.velocity, seen.acceleration, spin, spin_rate))
    world = linkdyn.Pose(
        p,
        quaternions(turn * rotation_of(q) * BY),
        velocity=v + np.cross(w, p),
        acceleration=a + 2 * np.cross(w, v) + np.cross(w2, p) + np.cross(w, np.cross(w, p)),
        angular_velocity=w + o,
        angular_acceleration=w2 + o2 + np.cross(w, o),
    )
    columns = [np.column_stack([one, np.zeros((len(t), 6))]) for one in (angle, rate, rate2)]
    run = scene.inverse(*columns, pose={point: tip}, solver=solver)
    want = straight.inverse(*columns, pose={"platform": world}, solver=solver)
    assert (run.status == 0).all() and (want.status == 0).all()
    for name in {"driving_force", "driving_speed", "reaction"} & set(run.data_vars):
        close(run[name], want[name])
    assert abs(run.power_imbalance).max() < 1e-12


def test_far_from_the_pole_angles_are_as_good() -> None:
    """Poses by quaternion are computed as those by angles are, with whose accelerations they agree."""
    given = wobble(np.linspace(0, 3, 40))
    scene = linkdyn.Scene(hexapod())
    straight = scene.inverse(*given)
    run = scene.inverse(pose={"platform": pose_of(*given, by=Rotation.identity())})
    for name, values in zip(("q", "qd", "qdd"), given):
        close(run[name], values, 1e-13)
    close(run.driving_force, straight.driving_force, 1e-13)


def test_a_sample_does_not_hang_on_its_neighbours() -> None:
    """Those near the pole go their own way through the engine; the others' bits do not know of it."""
    given = wobble(np.linspace(0.0, 1.0, 64))
    scene = linkdyn.Scene(turned_axes(hexapod(), "platform"))
    whole = scene.inverse(pose={"platform": pose_of(*given)})
    for part in (slice(0, 1), slice(1, 64), slice(20, 40)):
        some = scene.inverse(pose={"platform": pose_of(*(values[part] for values in given))})
        assert np.array_equal(some.driving_force, whole.driving_force[part])
        assert np.array_equal(some.reaction, whole.reaction[part])


def test_matrices_and_rotations() -> None:
    """Three ways to say the same."""
    given = wobble(np.linspace(0, 1, 9))
    pose = pose_of(*given)
    rates = {name: getattr(pose, name) for name in ("velocity", "acceleration", "angular_velocity", "angular_acceleration")}
    scene = linkdyn.Scene(turned_axes(hexapod(), "platform"))
    runs = [
        scene.inverse(pose={"platform": one})
        for one in (pose, linkdyn.Pose(pose.position, rotation=pose.rotation, **rates), linkdyn.Pose(matrix=pose.matrix, **rates))
    ]
    np.testing.assert_allclose(pose.rotation, (rotation_of(given[0]) * BY).as_matrix(), atol=1e-15)
    for run in runs[1:]:
        close(run.driving_force, runs[0].driving_force, 1e-12)


def test_poses_tell_quaternions() -> None:
    """`Poses.quaternion` of links in space, and poses that are asked for by quaternion."""
    given = wobble(np.linspace(0, 1, 30))
    scene = linkdyn.Scene(turned_axes(hexapod(), "platform"))
    poses = scene.poses(pose={"platform": pose_of(*given)})
    assert (poses.status == 0).all()
    turned = Rotation.from_quat(np.roll(poses.quaternion[:, scene.links.index("platform")], -1, axis=1))
    assert ((rotation_of(given[0]) * BY).inv() * turned).magnitude().max() < 1e-15 * 8
    for k in range(len(scene.links)):
        np.testing.assert_allclose(Rotation.from_quat(np.roll(poses.quaternion[:, k], -1, axis=1)).as_matrix(), poses.rotation[:, k], atol=1e-14)
    seen = scene.inverse(pose={"platform": pose_of(*given)}).linkdyn.relative_pose("platform", "frame")
    np.testing.assert_allclose(seen.quaternion, poses.quaternion[:, scene.links.index("platform")], atol=1e-14)


def test_what_follows_from_a_run_at_the_pole() -> None:
    """Motion of markers, shaking forces and contributions by cause go by the angular velocity that was given."""
    given = wobble(np.concatenate([[0.0], np.logspace(-9, 0, 20)]))
    scene, other = linkdyn.Scene(hexapod()), linkdyn.Scene(turned_axes(hexapod(), "platform"))
    straight, run = scene.inverse(*given), other.inverse(pose={"platform": pose_of(*given)})
    one, two = (r.linkdyn.marker("platform.P1", scene=s) for r, s in ((straight, scene), (run, other)))
    for name in ("position", "velocity", "acceleration"):
        close(two[name], one[name])
    close(run.linkdyn.shaking(scene=other).force, straight.linkdyn.shaking(scene=scene).force)
    causes = run.linkdyn.contributions(scene=other)
    close(causes.driving_force.sum("cause"), straight.driving_force)
    # from angles alone nobody knows how it turns exactly there
    assert np.isnan(other.inverse(run.q, run.qd, run.qdd).linkdyn.marker("platform.P1", scene=other).velocity[0]).all()


def test_ball_joint_at_its_pole() -> None:
    """A body on a ball joint and three massless legs: Newton's and Euler's laws by hand."""
    given = tomllib.loads((Path(__file__).with_name("scenes") / "ball_joint_past_pole.toml").read_text())
    top = np.array([[0.5, 0.1, 0.0], [0.4, -0.3, 0.2], [0.45, 0.2, -0.3]])
    base = np.array([[0.3, 0.9, -1.0], [-0.2, -0.8, -1.1], [1.2, 0.1, -0.9]])
    given["link"][0]["markers"] |= {f"A{k}": at.tolist() for k, at in enumerate(top)}
    given["frame"]["markers"] |= {f"B{k}": at.tolist() for k, at in enumerate(base)}
    given["chain"] = [{
        "type": "SPS",
        "base": [f"frame.B{k}" for k in range(3)],
        "platform": [f"body.A{k}" for k in range(3)],
        "lower": {"mass": 0},
        "upper": {"mass": 0},
    }]  # fmt: skip
    rng = np.random.default_rng(5)
    n = 40
    lean = np.where(np.arange(n) % 4 == 0, 0.0, rng.normal(scale=1e-3, size=n))
    roll, yaw = rng.uniform(-3, 3, n), rng.uniform(-0.5, 0.5, n)
    attitude = Rotation.from_euler("XYZ", np.column_stack([roll, 0.5 * np.pi + lean, yaw - roll]))
    omega, alpha = rng.normal(size=(2, n, 3))
    pose = linkdyn.Pose(quaternion=quaternions(attitude), angular_velocity=omega, angular_acceleration=alpha)
    run = linkdyn.Scene(given).inverse(pose={"S": pose})
    assert (run.status == 0).all()
    weight, ball = np.array([0.0, 0.0, -2.0 * 9.81]), run.joint.values.tolist().index("S")
    for k in range(n):
        r = attitude[k].as_matrix()
        arm = r @ [0.3, 0.0, 0.0]
        inertia = r @ np.diag([0.02, 0.05, 0.06]) @ r.T
        at = top @ r.T
        along = (at - base) / np.linalg.norm(at - base, axis=1, keepdims=True)
        acceleration = np.cross(alpha[k], arm) + np.cross(omega[k], np.cross(omega[k], arm))
        momentum = inertia @ alpha[k] + np.cross(omega[k], inertia @ omega[k]) + 2.0 * np.cross(arm, acceleration)
        force = np.linalg.solve(np.cross(at, along).T, momentum - np.cross(arm, weight))
        close(run.driving_force[k], force, 1e-12 * np.linalg.cond(np.cross(at, along).T))
        close(run.reaction[k, ball, :3], 2.0 * acceleration - weight - along.T @ force, 1e-12 * np.linalg.cond(np.cross(at, along).T))


# ---------------------------------------------------------------- motions in tables


def write_table(file: Path, t: np.ndarray, position: np.ndarray, quaternion: np.ndarray) -> None:
    """Quaternions of any length, and now and then on the other side."""
    quaternion = quaternion * np.linspace(0.5, 2.0, len(t))[:, None] * np.where(np.arange(len(t)) % 3 == 1, -1, 1)[:, None]
    rows = np.column_stack([t, position, quaternion])
    file.write_text("t,x,y,z,qw,qx,qy,qz\n" + "\n".join(",".join(map(repr, row.tolist())) for row in rows) + "\n")


def with_table(given: dict[str, Any], file: str) -> dict[str, Any]:
    return given | {"coordinate": [{"link": "platform", "motion": {"table": file}}], "time": {"samples": 401}}


def test_table_of_quaternions_through_the_pole(tmp_path: Path) -> None:
    """A spline through quaternions does not know of axes that are turned in the body: both tables are one motion, one of them
    through the pole."""
    t = np.linspace(0, 2, 41)
    q = wobble(t)[0]
    write_table(tmp_path / "level.csv", t, q[:, :3], quaternions(rotation_of(q)))
    write_table(tmp_path / "pole.csv", t, q[:, :3], quaternions(rotation_of(q) * BY))
    straight = linkdyn.Scene(with_table(hexapod(), "level.csv"), folder=tmp_path).inverse(want="all")
    run = linkdyn.Scene(with_table(turned_axes(hexapod(), "platform"), "pole.csv"), folder=tmp_path).inverse(want="all")
    assert (run.status == 0).all() and (straight.status == 0).all()
    close(run.driving_force, straight.driving_force)
    close(run.reaction, straight.reaction)
    moved = [k for k, name in enumerate(run.variable.values) if ".S." not in name]
    close(run.joint_variable[:, moved], straight.joint_variable[:, moved])
    assert abs(np.diff(run.q[:, 3:], axis=0)).max() > 0.5 > 0.1 > abs(np.diff(straight.q[:, 3:], axis=0)).max()
    # the spline tells the motion that was sampled, to the fourth power of the rows' distance
    exact = linkdyn.Scene(hexapod()).inverse(*wobble(straight.time.values))
    close(straight.driving_force[40:-40], exact.driving_force[40:-40], 1e-3)


def test_table_and_python_lead_alike(tmp_path: Path) -> None:
    """`Pose.through` and a table of the same rows move alike; the way is that of scipy's splines, the rates those by differences."""
    t = np.sort(np.concatenate([[0, 2], np.random.default_rng(2).uniform(0, 2, 30)]))
    q = wobble(t)[0]
    write_table(tmp_path / "pole.csv", t, q[:, :3], quaternions(rotation_of(q) * BY))
    scene = linkdyn.Scene(with_table(turned_axes(hexapod(), "platform"), "pole.csv"), folder=tmp_path)
    run = scene.inverse()
    pose = linkdyn.Pose.through(t, q[:, :3], rotation=(rotation_of(q) * BY).as_matrix(), at=run.time.values)
    close(run.driving_force, scene.inverse(pose={"platform": pose}).driving_force)
    h = 1e-5
    at = np.array([0.31, 0.77, 1.9])
    before, here, after = (
        linkdyn.Pose.through(t, q[:, :3], quaternions(rotation_of(q) * BY), at=at + step) for step in (-h, 0.0, h)
    )
    for k, found in enumerate((here.position, here.velocity, here.acceleration)):
        np.testing.assert_allclose(found, CubicSpline(t, q[:, :3])(at, k), atol=1e-11)
    turn = Rotation.from_matrix(after.rotation @ np.swapaxes(before.rotation, 1, 2)).as_rotvec() / (2 * h)
    np.testing.assert_allclose(here.angular_velocity, turn, atol=1e-8)
    np.testing.assert_allclose(here.angular_acceleration, (after.angular_velocity - before.angular_velocity) / (2 * h), atol=1e-7)
    np.testing.assert_allclose(here.velocity, (after.position - before.position) / (2 * h), atol=1e-9)


@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_short_tables(n: int, tmp_path: Path) -> None:
    """Two rows are a straight line, three a parabola, four one cubic."""
    t = np.linspace(0, 1, n)
    rotation = Rotation.from_euler("XYZ", np.column_stack([0.2 * t, 0.1 * t**2, -0.3 * t]))
    place = np.column_stack([0.05 * t ** min(n - 1, 3), 0 * t, 0.9 + 0.02 * t])
    write_table(tmp_path / "m.csv", t, place, quaternions(rotation))
    scene = linkdyn.Scene(with_table(hexapod(), "m.csv"), folder=tmp_path)
    q, qd, qdd = scene.motion()
    at = scene.times()
    k = min(n - 1, 3)
    np.testing.assert_allclose(q[:, 0], 0.05 * at**k, atol=1e-14)
    np.testing.assert_allclose(qdd[:, 0], 0.05 * k * (k - 1) * at ** max(k - 2, 0), atol=1e-11)
    pose = linkdyn.Pose.through(t, place, quaternions(rotation), at=at)
    omega, alpha = spins(q, qd, qdd)
    np.testing.assert_allclose(pose.angular_velocity, omega, atol=1e-13)
    np.testing.assert_allclose(pose.angular_acceleration, alpha, atol=1e-11)


def test_many_turns(tmp_path: Path) -> None:
    """Angles of a table of quaternions go on counting turns."""
    t = np.linspace(0, 2, 61)
    yaw = 4 * np.pi * t
    write_table(tmp_path / "m.csv", t, 0 * np.outer(t, [1, 1, 1]), quaternions(Rotation.from_euler("z", yaw[:, None])))
    given = {
        "space": "spatial",
        "link": [{"name": "body", "mass": 1, "inertia": {"diagonal": [1, 1, 1]}}],
        "coordinate": [{"link": "body", "motion": {"table": "m.csv"}}],
        "time": {"samples": 301},
    }
    q, qd, _ = linkdyn.Scene(given, folder=tmp_path).motion()
    np.testing.assert_allclose(q[:, 5], 4 * np.pi * np.linspace(0, 2, 301), atol=2e-4)
    np.testing.assert_allclose(qd[:, 5], 4 * np.pi, atol=2e-2)


def test_command_line_goes_through_the_pole(tmp_path: Path) -> None:
    """The executable computes what Python does."""
    t = np.linspace(0, 2, 41)
    q = wobble(t)[0]
    write_table(tmp_path / "pole.csv", t, q[:, :3], quaternions(rotation_of(q) * BY))
    scene = linkdyn.Scene(with_table(turned_axes(hexapod(), "platform"), "pole.csv"), folder=tmp_path)
    (tmp_path / "scene.toml").write_text(scene.text)
    subprocess.run([executable(), "inverse", tmp_path / "scene.toml", "--output", tmp_path / "run.nc"], check=True)
    run, here = linkdyn.read(tmp_path / "run.nc"), scene.inverse()
    assert (run.status == 0).all()
    assert np.array_equal(run.driving_force, here.driving_force) and np.array_equal(run.qd, here.qd)


def test_an_assembly_is_not_followed_past_a_pole(tmp_path: Path) -> None:
    """Cranks with elbows: the way from sample to sample is one of angles."""
    t = np.linspace(0, 2, 41)
    q = wobble(t)[0]
    write_table(tmp_path / "pole.csv", t, q[:, :3], quaternions(rotation_of(q) * BY))
    scene = linkdyn.Scene(with_table(turned_axes(hexapod("RUS"), "platform"), "pole.csv"), folder=tmp_path)
    with pytest.raises(linkdyn.InputError, match="t = 0 s: the attitude of 'platform' is within 3 degrees of its pole"):
        scene.inverse()


def test_forward_runs_do_not_drive_through_a_pole(tmp_path: Path) -> None:
    """A driven pose goes by angles: the run ends in words."""
    t = np.linspace(0, 2, 41)
    q = np.column_stack([0 * t, 0 * t, 0.9 + 0 * t, 0 * t, 0.3 - 0.3 * t, 0 * t])
    write_table(tmp_path / "pole.csv", t, q[:, :3], quaternions(rotation_of(q) * BY))
    given = with_table(turned_axes(hexapod(), "platform"), "pole.csv")
    given["coordinate"][0]["driven"] = True
    given["actuator"] = [{"joint": f"leg{k}.P"} for k in range(1, 7)]
    given["chain"][0]["actuated"] = False
    run = linkdyn.Scene(given, folder=tmp_path).forward(t=np.linspace(0, 2, 21))
    assert "the motion is not finite" in run.attrs["stopped"]
    assert ((run.status == 0) == (run.time < 0.84)).all()


# ---------------------------------------------------------------- starts


@pytest.mark.parametrize("way", ["quaternion", "rotation"])
def test_starts(way: str) -> None:
    """A body in flight starts as by angles, and its angular velocity is that of the rates."""
    angles, rates = [0.4, -0.7, 1.1], [1.0, -2.0, 0.5]
    attitude = Rotation.from_euler("XYZ", angles)
    told = (2.5 * np.roll(attitude.as_quat(), 1)).tolist() if way == "quaternion" else attitude.as_matrix().tolist()
    omega, _ = spins(np.array([[0, 0, 0, *angles]]), np.array([[0, 0, 0, *rates]]), np.zeros((1, 6)))
    given: dict[str, Any] = {
        "space": "spatial",
        "link": [{"name": "body", "mass": 1, "inertia": {"diagonal": [1, 2, 2.5]}}],
        "coordinate": [{"link": "body", "start": {"position": [0, 0, 1], "angles": angles, "angular_rates": rates}}],
    }
    straight = linkdyn.Scene(given).forward(t=[0, 0.5])
    given["coordinate"][0]["start"] = {"position": [0, 0, 1], way: told, "angular_velocity": omega[0].tolist()}
    run = linkdyn.Scene(given).forward(t=[0, 0.5])
    np.testing.assert_allclose(run.q, straight.q, atol=1e-14)
    np.testing.assert_allclose(run.qd, straight.qd, atol=1e-14)


def test_starts_of_markers() -> None:
    """The pose of a marker begins as that of a link does, or component by component."""
    given: dict[str, Any] = {
        "space": "spatial",
        "link": [{"name": "body", "mass": 1, "inertia": {"diagonal": [1, 2, 2.5]}, "markers": {"T": [0.1, 0.2, 0.3]}}],
        "coordinate": [{"marker": "body.T"}],
    }
    whole = {"position": [0, 0, 1], "quaternion": [1, 0.2, 0.3, 0.4], "velocity": [1, 0, 0], "angular_velocity": [0.3, 0.2, 0.1]}
    given["coordinate"][0]["start"] = whole
    run = linkdyn.Scene(given).forward(t=[0, 0.5])
    words = ("x", "y", "z", "roll", "pitch", "yaw")
    begins = zip(words, run.q.values[0].tolist(), run.qd.values[0].tolist(), strict=True)
    given["coordinate"][0]["start"] = {word: {"position": q, "velocity": qd} for word, q, qd in begins}
    other = linkdyn.Scene(given).forward(t=[0, 0.5])
    assert run.qd.values[0, 0] == 1.0
    np.testing.assert_allclose(run.q, other.q, atol=1e-12)
    given["coordinate"][0]["start"] = {"position": [0, 0, 1], "x": 1}
    with pytest.raises(linkdyn.SceneError, match=r"\['x'\]: coordinate 'body.T', start: unknown key"):
        linkdyn.Scene(given)


@pytest.mark.parametrize("pitch", [0.3, 0.5 * np.pi, -0.5 * np.pi, 0.5 * np.pi - 1e-9])
def test_starts_of_links(pitch: float) -> None:
    """The assembly nearest to a start is the same, at the pole, too."""
    given = tomllib.loads((SCENES / "rssr.toml").read_text())
    for link in given["link"]:
        link["start"] = {"position": [0.1, 0.2, 0.3], "angles": [0.2, pitch, -0.4]}
    straight = linkdyn.Scene(given).poses()
    attitude = Rotation.from_euler("XYZ", [0.2, pitch, -0.4])
    for link in given["link"]:
        link["start"] = {"position": [0.1, 0.2, 0.3], "quaternion": np.roll(attitude.as_quat(), 1).tolist()}
    poses = linkdyn.Scene(given).poses()
    np.testing.assert_allclose(poses.rotation, straight.rotation, atol=1e-8)


# ---------------------------------------------------------------- what is refused

ONE = [[1.0, 0.0, 0.0, 0.0]]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda scene: linkdyn.Pose([[0, 0, 0]]), "pose: no attitude: expected one of quaternion, rotation and matrix"),
        (lambda scene: linkdyn.Pose([[0, 0, 0]], ONE, rotation=[np.eye(3)]), "pose: quaternion, rotation: expected one of"),
        (lambda scene: linkdyn.Pose([[0, 0, 0]], [[0, 0, 0, 0]]), r"pose: quaternion\[0\] is no attitude"),
        (lambda scene: linkdyn.Pose([[0, 0, 0]], [[np.nan, 0, 0, 1]]), r"pose: quaternion\[0\] is no attitude"),
        (lambda scene: linkdyn.Pose([[0, 0, 0]], [1.0, 0, 0, 0]), r"pose: quaternion: expected shape \(N, 4\)"),
        (lambda scene: linkdyn.Pose([[0, 0, 0]], rotation=[np.diag([1.0, 1, -1])]), r"pose: rotation\[0\] is not a rotation"),
        (lambda scene: linkdyn.Pose([[0, 0, 0]], rotation=[2 * np.eye(3)]), r"pose: rotation\[0\] is not a rotation"),
        (lambda scene: linkdyn.Pose([[0, 0, 0]], matrix=[np.eye(4)]), "pose: position: given beside matrix"),
        (lambda scene: linkdyn.Pose(matrix=[np.full((4, 4), 0.5)]), "pose: matrix: expected the last row 0 0 0 1"),
        (lambda scene: linkdyn.Pose(quaternion=ONE, velocity=[[0, 0, 0]]), "velocity, acceleration: given without position"),
        (lambda scene: linkdyn.Pose.through([0.0, 0.0], quaternion=ONE * 2), "pose: t: expected two increasing instants"),
        (lambda scene: linkdyn.Pose.through([0.0, 1.0], [[0, 0, 0], [0, 0, np.inf]], ONE * 2), r"pose: position\[1\] is not finite"),
        (lambda scene: linkdyn.Pose.through([0.0, 1.0], quaternion=ONE * 2, at=[2.0]), "pose: at: expected instants from 0 s to 1 s"),
        (lambda scene: linkdyn.Pose.through([0.0, 1.0], quaternion=[ONE[0], [0, 0, 0, 1]]), "attitude 1 is more than 120 degrees"),
        (lambda scene: scene.inverse(pose={}), "pose: is empty"),
        (lambda scene: scene.inverse(pose={"plat": linkdyn.Pose([[0, 0, 1]], ONE)}), "did you mean 'platform'"),
        (lambda scene: scene.inverse(pose={"platform": ONE}), "expected a linkdyn.Pose, got list"),
        (lambda scene: scene.inverse(pose={"platform": linkdyn.Pose(quaternion=ONE)}), "expected position"),
        (lambda scene: scene.inverse(np.zeros((2, 6)), pose={"platform": linkdyn.Pose([[0, 0, 1]], ONE)}), "expected 1 samples"),
        (lambda scene: linkdyn.new("four-bar").inverse(pose={"crank": linkdyn.Pose([[0, 0, 1]], ONE)}), "no link's whole pose"),
        (lambda scene: scene.poses(pose={"platform": linkdyn.Pose([[0, 0, 1]], ONE)}, joint_variable=[[0.0]]), "give one of them"),
    ],
)
def test_refused(call: Any, message: str) -> None:
    with pytest.raises(linkdyn.InputError, match=message):
        call(linkdyn.Scene(hexapod()))


@pytest.mark.parametrize(
    ("rows", "keys", "message"),
    [
        ("t,x,y,z,qw,qx,qy,qz\n0,0,0,1,1,0,0,0\n1,0,0,1,0,0,0,1\n", {}, "m.csv:3: the attitude is more than 120 degrees"),
        ("t,x,y,z,qw,qx,qy,qz\n0,0,0,1,1,0,0,0\n1,0,0,1,0,0,0,0\n", {}, "m.csv:3: qw, qx, qy, qz are zero"),
        ("t,x,y,z,qw,qx,qy\n0,0,0,1,1,0,0\n1,0,0,1,0,0,0\n", {}, "qz"),
        ("t,x,y,z,qw,qx,qy,qz,yaw\n0,0,0,1,1,0,0,0,0\n1,0,0,1,1,0,0,0,0\n", {}, "the column 'yaw' beside quaternions"),
        ("t,x,y,z,qw,qx,qy,qz\n0,0,0,1,1,0,0,0\n1,0,0,1,1,0,0,0\n", {"interpolation": "linear"}, "splines only"),
    ],
)
def test_refused_tables(rows: str, keys: dict[str, str], message: str, tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text(rows)
    given = with_table(hexapod(), "m.csv")
    given["coordinate"][0]["motion"] |= keys
    with pytest.raises(linkdyn.SceneError, match=message):
        linkdyn.Scene(given, folder=tmp_path)
