"""Tilts: the angle between two axes as a measure, and stops that bound it, such as the cone of a ball joint."""

from __future__ import annotations

import copy
from typing import Any

import linkdyn
import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

pytestmark = pytest.mark.accuracy

MASS, REACH, ROUND, LONG, CONE = 2.0, 0.4, 0.35, 0.02, 0.5


def hung(start: dict[str, Any], **parts: Any) -> dict[str, Any]:
    """A top that hangs on a ball joint in a socket with a mouth, its axis down."""
    return {
        "space": "spatial", "gravity": [0, 0, -9.81], "frame": {"markers": {"B": [0, 0, 0], "mouth": {"at": [0, 0, 0], "axis": [0, 0, -1]}}},
        "link": [{"name": "top", "markers": {"B": [0, 0, 0], "stem": {"at": [0, 0, -0.1], "axis": [0, 0, -1]}}, "mass": MASS, "cog": [0, 0, -REACH],
                  "inertia": [ROUND, ROUND, LONG, 0, 0, 0]}],
        "joint": [{"name": "B", "type": "spherical", "between": ["frame.B", "top.B"]}],
        "coordinate": [{"joint": "B", "variable": name, "start": start.get(name, 0)} for name in ("roll", "pitch", "yaw")],
        "measures": {"tilt": {"axes": ["frame.mouth", "top.stem"]}}, "time": {"end": 2},
    } | parts  # fmt: skip


def attitude(run: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3, 3) from the top to the world, (N, 3) angular velocities, both by the scene's convention alone."""
    (a, b, c), (da, db, dc) = run.q.values.T, run.qd.values.T

    def turn(axis: int, angle: np.ndarray) -> np.ndarray:
        r = np.zeros((len(angle), 3, 3))
        i, j = (axis + 1) % 3, (axis + 2) % 3
        r[:, axis, axis] = 1
        r[:, i, i] = r[:, j, j] = np.cos(angle)
        r[:, j, i], r[:, i, j] = np.sin(angle), -np.sin(angle)
        return r

    first, second = turn(0, a), turn(0, a) @ turn(1, b)
    omega = da[:, None] * [1.0, 0.0, 0.0] + db[:, None] * first[:, :, 1] + dc[:, None] * second[:, :, 2]
    return second @ turn(2, c), omega


def momentum(run: xr.Dataset) -> np.ndarray:
    """(N, 3) about the ball, world axes."""
    r, omega = attitude(run)
    inertia = np.diag([ROUND + MASS * REACH**2, ROUND + MASS * REACH**2, LONG])
    return np.einsum("nij,jk,nlk,nl->ni", r, inertia, r, omega)


def tilt_of(run: xr.Dataset) -> np.ndarray:
    return np.arccos(np.clip(attitude(run)[0][:, 2, 2], -1, 1))


@pytest.mark.parametrize("method", ["gbs", "seulex", "rk4"])
def test_in_a_plane_it_is_an_angle(method: str) -> None:
    """A top that swings about x alone strikes its cone as a hinge its stops."""
    settings = {"step": 1e-3} if method == "rk4" else {"rtol": 1e-11, "atol": 1e-12}
    t = np.linspace(0, 2, 41)
    cone = linkdyn.Scene(hung({"roll": {"position": 0.3, "velocity": 2.0}}, stop=[{"name": "mouth", "measure": "tilt", "max": CONE, "restitution": 0.6}]))
    run = cone.forward(t=t, method=method, **settings)
    hinge = hung({}, joint=[{"name": "B", "type": "revolute", "between": ["frame.B", "top.B"]}], coordinate=[{"joint": "B", "start": {"position": 0.3, "velocity": 2.0}}],
                 stop=[{"name": "mouth", "joint": "B", "min": -CONE, "max": CONE, "restitution": 0.6}], measures={})
    for body in (hinge["frame"], hinge["link"][0]):
        body["markers"]["B"] = {"at": [0, 0, 0], "axis": [1, 0, 0]}
    other = linkdyn.Scene(hinge).forward(t=t, method=method, **settings)
    np.testing.assert_allclose(run.q.values[:, 0], other.q.values[:, 0], atol=1e-8)
    np.testing.assert_allclose(run.q.values[:, 1:], 0, atol=1e-13)
    assert len(run.event_time) == len(other.event_time) == 3
    np.testing.assert_allclose(run.event_time, other.event_time, atol=1e-8)
    np.testing.assert_allclose(run.event_impulse, other.event_impulse, rtol=1e-6)
    np.testing.assert_allclose(run.event_loss, other.event_loss, rtol=1e-6)


def test_impacts_on_a_cone_in_space() -> None:
    """An impact turns the top about what is square to both axes: momentum about the upright and about its own axis stay, energy falls by what is told."""
    scene = linkdyn.Scene(hung({"roll": {"position": 0.3, "velocity": 1.0}, "pitch": {"position": 0.1, "velocity": -3.0}, "yaw": {"position": 0.0, "velocity": 4.0}},
                               stop=[{"name": "mouth", "measure": "tilt", "max": CONE, "restitution": 0.7}]))  # fmt: skip
    run = scene.forward(t=np.linspace(0, 2, 401), rtol=1e-11, atol=1e-12, method="gbs")
    assert (run.status == 0).all() and len(run.event_time) > 5
    r, omega = attitude(run)
    tilt = tilt_of(run)
    assert tilt.max() <= CONE + 1e-9
    upright = momentum(run)[:, 2]
    own = np.einsum("ni,ni->n", omega, r[:, :, 2])
    np.testing.assert_allclose(upright, upright[0], atol=1e-9)
    np.testing.assert_allclose(own, own[0], atol=1e-9)
    energy = (run.kinetic_energy + run.potential_energy).values
    lost = np.array([run.event_loss.values[run.event_time.values <= t].sum() for t in run.time.values])
    np.testing.assert_allclose(energy[0] - energy, lost, atol=1e-8)
    # With what is conserved the tilt is a motion of its own: theta'^2 = f(theta), reversed with the restitution.
    across = ROUND + MASS * REACH**2

    def speed(theta: float, total: float) -> float:
        precession = (upright[0] - LONG * own[0] * np.cos(theta)) / (across * np.sin(theta) ** 2)
        return float(np.sqrt(2 * (total + MASS * 9.81 * REACH * np.cos(theta)) / across - LONG * own[0] ** 2 / across - (precession * np.sin(theta)) ** 2))

    before = energy[0]
    for loss in run.event_loss.values[:4]:
        fast = speed(CONE, before)
        np.testing.assert_allclose(loss, 0.5 * across * fast**2 * (1 - 0.7**2), rtol=1e-7)
        before -= loss


def test_resting_on_a_cone_it_goes_round() -> None:
    """Pressed against the rim it keeps its tilt and its pace: a circle at a constant rate, and a moment that is the textbook's."""
    pace = 6.0                                              # fast enough to be pressed outwards
    start = {"roll": {"position": CONE, "velocity": 0.0}, "pitch": {"position": 0.0, "velocity": pace * np.sin(CONE)}, "yaw": {"position": 0.0, "velocity": 0.0}}
    scene = linkdyn.Scene(hung(start, stop=[{"name": "mouth", "measure": "tilt", "max": CONE, "restitution": 0}]))
    t = np.linspace(0, 0.2, 21)
    run = scene.forward(t=t, rtol=1e-11, atol=1e-12, method="gbs")
    np.testing.assert_allclose(tilt_of(run), CONE, atol=1e-9)
    r, omega = attitude(run)
    np.testing.assert_allclose(momentum(run)[:, 2], momentum(run)[0, 2], rtol=1e-10)
    way = np.unwrap(np.arctan2(r[:, 1, 2], r[:, 0, 2]))
    np.testing.assert_allclose(np.diff(way), way[1] - way[0], rtol=1e-8)


@pytest.mark.parametrize("pace", [0.0, 1.3])
def test_measure_and_rate_by_differences(pace: float) -> None:
    """As loads that are made of them; the rate by complex steps of the tilt along the motion."""
    data = hung({}, load=[{"on": "top.B", "force": ["1 N/rad*tilt", "1 N*s/rad*fast", 0]}], coordinate=[{"link": "top", "motion": {}}])
    data["measures"] |= {"fast": {"axes": ["frame.mouth", "top.stem"], "rate": True}}
    data["joint"] = []
    data["link"][0]["markers"]["stem"]["axis"] = [0.3, -0.2, -1.0]
    data["coordinate"] = [{"link": "top"}]
    data["time"] = {"end": 1}
    scene = linkdyn.Scene(data)
    rng = np.random.default_rng(3)
    q, qd = rng.uniform(-1, 1, (40, 6)), pace * rng.uniform(-1, 1, (40, 6))
    qd[:, :3] = 0
    told = scene.load_values(q=q, qd=qd)
    told = np.asarray(told[0] if isinstance(told, tuple) else told).reshape(40, -1)

    def tilt(s: complex) -> np.ndarray:
        a, b, c = (q[:, 3:] + s * qd[:, 3:]).T.astype(complex)
        axis = np.array([0.3, -0.2, -1.0]) / np.sqrt(1.13)
        x, y, z = np.cos(c) * axis[0] - np.sin(c) * axis[1], np.sin(c) * axis[0] + np.cos(c) * axis[1], axis[2]
        x, z = np.cos(b) * x + np.sin(b) * z, -np.sin(b) * x + np.cos(b) * z
        return np.arccos(-(np.sin(a) * y + np.cos(a) * z))

    np.testing.assert_allclose(told[:, 0], tilt(0).real, atol=1e-14)
    np.testing.assert_allclose(told[:, 1], tilt(1e-30j).imag / 1e-30, atol=1e-12)


def test_a_soft_cone_pushes_back_by_its_stiffness() -> None:
    """In inverse dynamics too: held at rest beyond the rim by a drive, whose torque is weight less push. Upright there is no push, and no fault."""
    data = hung({}, joint=[{"name": "B", "type": "universal", "between": ["frame.B", "top.B"]}])
    data["frame"]["markers"]["B"] = {"at": [0, 0, 0], "axis": [1, 0, 0], "x": [0, 0, 1]}
    data["link"][0]["markers"]["B"] = {"at": [0, 0, 0], "axis": [0, 1, 0], "x": [0, 0, 1]}
    data |= {"coordinate": [{"joint": "B", "variable": name} for name in ("angle1", "angle2")], "actuator": [{"joint": "B", "variable": name} for name in ("angle1", "angle2")],
             "stop": [{"name": "mouth", "measure": "tilt", "max": 0.2, "stiffness": 50.0}]}  # fmt: skip
    scene = linkdyn.Scene(data)
    flat = scene.poses([[0.0, 0.0]]).rotation[0, 0]
    angles = np.array([[0.0, 0.0], [0.3, 0.0], [0.0, -0.4], [0.3, 0.35]])
    down = scene.poses(angles).rotation[:, 0, :, 2]
    tilt = np.arccos(np.clip(down[:, 2], -1, 1))
    bare = linkdyn.Scene(data | {"stop": []})
    run, without = scene.inverse(q=angles, qd=0 * angles, qdd=0 * angles), bare.inverse(q=angles, qd=0 * angles, qdd=0 * angles)
    assert (run.status == 0).all()
    extra = (run.driving_force - without.driving_force).values
    step = 1e-6
    for k in range(2):
        moved = angles + step * np.eye(2)[k]
        back = angles - step * np.eye(2)[k]
        slope = [np.arccos(np.clip(scene.poses(q).rotation[:, 0, 2, 2], -1, 1)) for q in (moved, back)]
        np.testing.assert_allclose(extra[1:, k], (50 * np.maximum(tilt - 0.2, 0) * (slope[0] - slope[1]) / (2 * step))[1:], atol=1e-6)
    np.testing.assert_allclose(extra[0] if abs(flat[2, 2] - 1) < 1e-9 else 0, 0, atol=1e-12)
    assert tilt[1:].min() > 0.2 and tilt[0] < 1e-7


def test_in_a_plane_and_across_links() -> None:
    data: dict[str, Any] = {
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"A": [0, 0]}},
        "link": [{"name": name, "markers": {"A": [0, 0], "B": {"at": [0.5, 0], "axis": [1, 0]}}, "mass": 1.0, "cog": [0.25, 0], "inertia": 0.02} for name in ("one", "two")],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "one.A"]}, {"name": "B", "type": "revolute", "between": ["one.B", "two.A"]}],
        "coordinate": [{"joint": "A", "start": -0.5}, {"joint": "B", "start": 0.4}], "time": {"end": 2},
    }  # fmt: skip
    by_joint = copy.deepcopy(data) | {"stop": [{"name": "S", "joint": "B", "min": -0.9, "max": 0.9, "restitution": 0.3}]}
    by_tilt = copy.deepcopy(data) | {"measures": {"bend": {"axes": ["one.B", "two.B"]}}, "stop": [{"name": "S", "measure": "bend", "max": 0.9, "restitution": 0.3}]}
    one, other = (linkdyn.Scene(scene).forward(t=np.linspace(0, 2, 21), rtol=1e-11, atol=1e-12, method="gbs") for scene in (by_joint, by_tilt))
    assert len(one.event_time) == len(other.event_time) == 2
    np.testing.assert_allclose(one.q, other.q, atol=1e-8)


def test_a_rod_in_its_socket_may_spin() -> None:
    """A tilt of the rod's own line says nothing of its spin, which stays idle; one of a line beside it does."""
    rod = {"name": "rod", "markers": {"S": {"at": [0, 0, 0], "axis": [0, 0, 1]}, "T": [0, 0, 0.5], "side": {"at": [0, 0, 0], "axis": [0.2, 0, 1]}}, "mass": 1.0, "cog": [0, 0, 0.25], "inertia": [0.02, 0.02, 0.001, 0, 0, 0]}
    data: dict[str, Any] = {
        "space": "spatial", "gravity": [0, 0, -9.81], "frame": {"markers": {"S": [0, 0, 0], "G": {"at": [0, 0, 0.5], "axis": [1, 0, 0]}, "H": {"at": [0, 0, 0.6], "axis": [0, 0, 1]}}},
        "link": [rod | {"start": {"position": [0, 0, 0]}}, {"name": "slide", "markers": {"G": {"at": [0, 0, 0], "axis": [1, 0, 0]}}, "mass": 1.0, "inertia": [0.01, 0.01, 0.01, 0, 0, 0]},
                 {"name": "head", "markers": {"G": {"at": [0, 0, 0], "axis": [0, 0, 1]}, "T": [0, 0, 0]}, "mass": 0.5, "inertia": [0.001, 0.001, 0.001, 0, 0, 0], "start": {"position": [0, 0, 0.5]}}],
        "joint": [{"name": "S", "type": "spherical", "between": ["frame.S", "rod.S"]}, {"name": "G", "type": "prismatic", "between": ["frame.G", "slide.G"]},
                  {"name": "V", "type": "prismatic", "between": ["slide.G2", "head.G"]}, {"name": "T", "type": "spherical", "between": ["rod.T", "head.T"]}],
        "coordinate": [{"joint": "G", "start": {"position": 0.02, "velocity": 0.5}}], "time": {"end": 0.5}, "measures": {"tilt": {"axes": ["frame.H", "rod.S"]}},
        "stop": [{"name": "rim", "measure": "tilt", "max": 0.3, "restitution": 0.5}],
    }  # fmt: skip
    data["link"][1]["markers"]["G2"] = {"at": [0, 0, 0], "axis": [0, 0, 1]}
    run = linkdyn.Scene(data).forward(t=np.linspace(0, 0.5, 11))
    assert run.attrs["idle_spins"] == "rod" and len(run.event_time) >= 1 and (run.status == 0).all()
    assert np.arcsin(np.abs(run.q.values / 0.5)).max() <= 0.3 + 1e-9
    data["measures"]["tilt"]["axes"][1] = "rod.side"
    with pytest.raises(linkdyn.SceneError, match="mobility"):
        linkdyn.Scene(data)


def torsion(r: np.ndarray) -> np.ndarray:
    """Of a rotation (..., 3, 3) about its z once what tilts z is taken back by the least turn, by quaternions: twice the angle of (w, z)."""
    quaternion = Rotation.from_matrix(r.reshape(-1, 3, 3)).as_quat()
    twist = 2 * np.arctan2(quaternion[:, 2], quaternion[:, 3])
    return np.angle(np.exp(1j * twist)).reshape(r.shape[:-2])


SOCKET = Rotation.from_euler("XYZ", [0.4, -0.3, 1.1]).as_matrix()
STEM = Rotation.from_euler("XYZ", [-0.2, 0.5, 0.7]).as_matrix()


def twisted(**parts: Any) -> dict[str, Any]:
    """The same with a key in the socket that feels how the top is twisted in it."""
    data = hung({}, **parts)
    data["frame"]["markers"]["key"] = {"at": [0, 0, 0], "axis": SOCKET[:, 2].tolist(), "x": SOCKET[:, 0].tolist()}
    data["link"][0]["markers"]["key"] = {"at": [0, 0, 0], "axis": STEM[:, 2].tolist(), "x": STEM[:, 0].tolist()}
    data["measures"] = {"twist": {"twist": ["frame.key", "top.key"]}, "fast": {"twist": ["frame.key", "top.key"], "rate": True}}
    return data


def test_twist_and_its_rate() -> None:
    """As loads that are made of them, by quaternions and their differences."""
    data = twisted(load=[{"on": "top.B", "force": ["1 N/rad*twist", "1 N*s/rad*fast", 0]}], coordinate=[{"link": "top"}], joint=[])
    rng = np.random.default_rng(4)
    q, qd = rng.uniform(-1, 1, (60, 6)), rng.uniform(-1, 1, (60, 6))
    q[:, 5] *= 3
    told = linkdyn.Scene(data).load_values(q=q, qd=qd)
    told = np.asarray(told[0] if isinstance(told, tuple) else told).reshape(60, -1)

    def twist(s: float) -> np.ndarray:
        return torsion(SOCKET.T @ Rotation.from_euler("XYZ", (q + s * qd)[:, 3:]).as_matrix() @ STEM)

    h = 1e-3                                               # differences of the sixth order: 1e-3^6 and 1e-16/1e-3
    change = [np.angle(np.exp(1j * (twist(k * h) - twist(-k * h)))) / (2 * k * h) for k in (1, 2, 3)]
    np.testing.assert_allclose(told[:, 0], twist(0), atol=1e-14)
    np.testing.assert_allclose(told[:, 1], 1.5 * change[0] - 0.6 * change[1] + 0.1 * change[2], atol=1e-10)


@pytest.mark.parametrize("kind", ["hard", "soft"])
def test_a_key_keeps_a_ball_from_twisting(kind: str) -> None:
    """A stop of the twist: it stays within, momentum about what is square to the push stays in an impact, energy falls by what is told, or is stored."""
    words = {"restitution": 0.4} if kind == "hard" else {"stiffness": 400.0}
    start = {"roll": {"position": 0.3, "velocity": 1.0}, "pitch": {"position": 0.1, "velocity": -2.0}, "yaw": {"position": 0.0, "velocity": 4.0}}
    data = twisted(stop=[{"name": "key", "measure": "twist", "min": "-40 deg", "max": "70 deg", **words}])
    data["coordinate"] = hung(start)["coordinate"]
    run = linkdyn.Scene(data).forward(t=np.linspace(0, 2, 401), rtol=1e-11, atol=1e-12, method="gbs")
    assert (run.status == 0).all() and run.attrs["stopped"] == ""
    twist = torsion(SOCKET.T @ attitude(run)[0] @ STEM)
    events = run.event_time.values
    energy = (run.kinetic_energy + run.potential_energy).values
    if kind == "hard":
        assert len(events) > 1
        assert -np.deg2rad(40) - 1e-9 <= twist.min() and twist.max() <= np.deg2rad(70) + 1e-9
        lost = np.array([run.event_loss.values[events <= t].sum() for t in run.time.values])
        np.testing.assert_allclose(energy[0] - energy, lost, atol=1e-8)
    else:
        beyond = np.maximum(twist - np.deg2rad(70), 0) + np.minimum(twist + np.deg2rad(40), 0)
        assert np.abs(beyond).max() > 1e-3
        np.testing.assert_allclose(energy + 200 * beyond**2, energy[0] + 200 * beyond[0] ** 2, atol=1e-7)


def test_an_impact_of_the_key_pushes_along_the_rate() -> None:
    """The jump of the angular momentum is the told impulse along the gradient of the twist, which differences tell."""
    start = {"roll": {"position": 0.3, "velocity": 1.0}, "pitch": {"position": 0.1, "velocity": -2.0}, "yaw": {"position": 0.0, "velocity": 4.0}}
    data = twisted(stop=[{"name": "key", "measure": "twist", "max": "70 deg", "restitution": 0.4}], gravity=[0, 0, 0])
    data["coordinate"] = hung(start)["coordinate"]
    scene = linkdyn.Scene(data)
    t = scene.forward(t=np.linspace(0, 2, 401), rtol=1e-11, atol=1e-12, method="gbs").event_time.values[0]
    run = scene.forward(t=np.array([0.0, t - 1e-7, t + 1e-7]), rtol=1e-11, atol=1e-12, method="gbs")
    jump = momentum(run)[2] - momentum(run)[1]
    r = attitude(run)[0][1]
    gradient = np.array([torsion(SOCKET.T @ Rotation.from_rotvec(1e-5 * axis).as_matrix() @ r @ STEM) - torsion(SOCKET.T @ Rotation.from_rotvec(-1e-5 * axis).as_matrix() @ r @ STEM)
                         for axis in np.eye(3)]) / 2e-5  # fmt: skip
    np.testing.assert_allclose(np.abs(jump), np.abs(run.event_impulse.values[0] * gradient), rtol=0, atol=1e-5 * np.abs(jump).max())


def test_pressed_against_the_key_it_swings_untwisted() -> None:
    """A moment presses it against its key: whichever way it swings then, the twist stays, and so does the energy."""
    start = {"roll": {"position": 0.3, "velocity": 1.0}, "pitch": {"position": 0.1, "velocity": -2.0}, "yaw": {"position": 0.0, "velocity": 4.0}}
    data = twisted(stop=[{"name": "key", "measure": "twist", "max": "70 deg", "restitution": 0}])
    data["coordinate"] = hung(start)["coordinate"]
    data["load"] = [{"on": "top.B", "axes": "link", "moment": [f"{m} N*m" for m in 5.0 * STEM[:, 2]]}]
    run = linkdyn.Scene(data).forward(t=np.linspace(0, 3, 301), rtol=1e-11, atol=1e-12, method="gbs")
    at_key = run.time.values > run.event_time.values[-1] + 1e-6
    assert at_key.sum() > 200, "it rests"
    r, omega = attitude(run)
    twist = torsion(SOCKET.T @ r @ STEM)
    np.testing.assert_allclose(twist[at_key], np.deg2rad(70), rtol=0, atol=1e-9)
    assert np.ptp(run.q.values[at_key, 0]) > 0.3, "it swings"
    assert abs(run.power_imbalance.values).max() < 1e-9


def test_a_twist_in_the_plane_is_refused() -> None:
    data: dict[str, Any] = {
        "space": "planar", "frame": {"markers": {"A": [0, 0]}}, "link": [{"name": "one", "markers": {"A": [0, 0]}, "mass": 1.0, "inertia": 0.02}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "one.A"]}], "coordinate": [{"joint": "A"}], "measures": {"turned": {"twist": ["frame.A", "one.A"]}},
    }  # fmt: skip
    with pytest.raises(linkdyn.SceneError, match="is for spatial scenes"):
        linkdyn.Scene(data)


def test_designs_that_turn_a_key_are_designs_of_their_own() -> None:
    """Only the marker's x differs between them."""
    data = hung({}, joint=[{"name": "B", "type": "universal", "between": ["frame.B", "top.B"]}], variables={"turned": 0.1})
    data["frame"]["markers"] |= {"B": {"at": [0, 0, 0], "axis": [1, 0, 0], "x": [0, 0, 1]}, "key": {"at": [0, 0, 0], "axis": [0, 0, 1], "x": ["cos(turned)", "sin(turned)", 0]}}
    data["link"][0]["markers"] |= {"B": {"at": [0, 0, 0], "axis": [0, 1, 0], "x": [0, 0, 1]}, "key": {"at": [0, 0, 0], "axis": [0, 0, 1], "x": [1, 0, 0]}}
    drives = [{"joint": "B", "variable": name} for name in ("angle1", "angle2")]
    data |= {"measures": {"twist": {"twist": ["frame.key", "top.key"]}}, "coordinate": drives, "actuator": drives,
             "load": [{"on": "top.B", "axes": "world", "moment": ["5 N*m/rad*twist", 0, 0]}]}  # fmt: skip
    scene, turns = linkdyn.Scene(data), [0.1, 0.4, 0.9]
    q = np.column_stack([np.linspace(0.1, 0.3, 400), np.full(400, 0.2)])
    sweep = scene.sweep({"axis": [{"parameter": "variables.turned", "values": turns}, {"coordinate": "B.angle1", "linspace": [0.1, 0.3, 400]},
                                  {"coordinate": "B.angle2", "values": [0.2]}], "keep": ["driving_force"]})  # fmt: skip
    told = sweep.driving_force.values.reshape(3, 400, 2)
    for turn, of_design in zip(turns, told, strict=True):
        anew = linkdyn.Scene(data | {"variables": {"turned": turn}}).inverse(q=q, qd=0 * q, qdd=0 * q).driving_force.values
        varied = scene.with_({"variables.turned": turn}).inverse(q=q, qd=0 * q, qdd=0 * q).driving_force.values
        np.testing.assert_allclose(of_design, anew, rtol=0, atol=1e-12)
        np.testing.assert_allclose(varied, anew, rtol=0, atol=1e-12)
    assert np.abs(told[1] - told[0]).max() > 1


@pytest.mark.parametrize("solver", ["elimination", "lapack"])
def test_a_turn_about_the_axis_tilts_nothing(solver: str) -> None:
    """The axes of a hinge stay parallel, whatever rounding makes of the angle between them: its rate was up to that of the hinge."""
    axis = [0.3, -0.5, 0.7]
    body = {"markers": {"H": {"at": [0, 0, 0], "axis": axis}}, "mass": 1.0, "inertia": {"diagonal": [0.1] * 3}}
    scene = linkdyn.Scene({
        "space": "spatial", "frame": {"markers": {"H": {"at": [0, 0, 0], "axis": axis}, "S": [0, 0, 0]}},
        "link": [{"name": "rod"} | body, {"name": "sled", "mass": 1.0, "inertia": {"diagonal": [0.1] * 3}, "markers": {"S": [0, 0, 0]}}],
        "joint": [{"name": "H", "type": "revolute", "between": ["frame.H", "rod.H"]}, {"name": "S", "type": "prismatic", "between": ["frame.S", "sled.S"]}],
        "coordinate": [{"joint": "H"}, {"joint": "S"}], "actuator": [{"joint": "H"}, {"joint": "S"}],
        "measures": {"lean": {"axes": ["frame.H", "rod.H"], "rate": True}},
        "load": [{"on": "sled.S", "force": [0, 0, "lean*(1 N s/rad)"]}],
    })  # fmt: skip
    angle = np.linspace(-3, 3, 200)
    run = scene.inverse(q=np.column_stack([angle, 0 * angle]), qd=np.tile([2.0, 0.0], (200, 1)), want="driving_force", solver=solver)
    assert (run.status == 0).all()
    assert np.abs(run.driving_force.sel(actuator="S")).max() < 1e-14


@pytest.mark.parametrize("rate", [False, True])
@pytest.mark.parametrize("solver", ["elimination", "lapack"])
def test_opposite_axes_have_no_twist(solver: str, rate: bool) -> None:
    """Nothing says by which way a lean of half a turn is taken back: of two markers against each other on one hinge rounding told it."""
    body = {"mass": 1.0, "inertia": {"diagonal": [0.1] * 3}}
    scene = linkdyn.Scene({
        "space": "spatial", "frame": {"markers": {"H": {"at": [0, 0, 0], "axis": [0.3, -0.5, 0.7]}, "S": [0, 0, 0]}},
        "link": [{"name": "rod", "markers": {"H": {"at": [0, 0, 0], "axis": [0.3, -0.5, 0.7]}, "end": {"at": [0, 0, 0], "axis": [-0.3, 0.5, -0.7]}}} | body,
                 {"name": "sled", "markers": {"S": [0, 0, 0]}} | body],
        "joint": [{"name": "H", "type": "revolute", "between": ["frame.H", "rod.H"]}, {"name": "S", "type": "prismatic", "between": ["frame.S", "sled.S"]}],
        "coordinate": [{"joint": "H"}, {"joint": "S"}], "actuator": [{"joint": "H"}, {"joint": "S"}],
        "measures": {"turn": {"twist": ["frame.H", "rod.end"], "rate": rate}},
        "load": [{"on": "sled.S", "force": [0, 0, "turn*(1 N s/rad)" if rate else "turn*(1 N/rad)"]}],
    })  # fmt: skip
    angle = np.linspace(-3, 3, 50)
    run = scene.inverse(q=np.column_stack([angle, 0 * angle]), qd=np.tile([2.0, 0.0], (50, 1)), want="driving_force", solver=solver)
    assert (run.status == 4).all()
