"""Cams in space: planar ones laid into tilted axes, and curves round a drum, against shoes on a swash plate and closed forms."""

from __future__ import annotations

import copy
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn._geometry.kinematics import link_motion
from test_cams import CAMS, LANES, same
from test_joint_kinds import along, check_roads, let_go

pytestmark = pytest.mark.accuracy

TILT = np.linalg.qr(np.array([[0.6, -0.5, 0.3], [0.2, 0.9, 0.4], [-0.7, 0.1, 0.8]]))[0]
TILT = TILT * np.sign(np.linalg.det(TILT))


def in_tilted_axes(planar: dict[str, Any]) -> dict[str, Any]:
    """The same mechanism in space, its plane along the first two columns of `TILT`; links keep their axes, the frame's are turned."""
    data = copy.deepcopy(planar)
    data |= {"space": "spatial", "gravity": (TILT[:, :2] @ planar["gravity"]).tolist()}
    ends = {end for joint in data["joint"] for end in joint["between"] if joint["type"] in ("revolute", "cam")}
    ends -= {joint["between"][1] for joint in data["joint"] if joint.get("follower") == "flat"}    # whose axis lies in the plane
    for body in [data["frame"] | {"name": "frame"}, *data["link"]]:
        axes = TILT if body["name"] == "frame" else np.eye(3)
        for name, marker in body["markers"].items():
            entry = marker if isinstance(marker, dict) else {"at": marker}
            placed = {"at": (axes[:, :2] @ entry["at"]).tolist()}
            if f"{body['name']}.{name}" in ends:
                placed |= {"axis": axes[:, 2].tolist(), "x": axes[:, 0].tolist()}
            elif "axis" in entry:
                placed |= {"axis": (axes[:, :2] @ entry["axis"]).tolist(), "x": axes[:, 2].tolist()}
            body["markers"][name] = placed
        if body["name"] != "frame":
            body["cog"] = [*body.get("cog", [0, 0]), 0]
            if body["mass"]:
                body["inertia"] = [1e-3 + body.get("inertia", 0), 1e-3 + body.get("inertia", 0), body.get("inertia", 1e-4), 0, 0, 0]
            body.setdefault("inertia_check", False)
    return data


@pytest.mark.parametrize("cam", CAMS.values(), ids=CAMS)
def test_a_planar_cam_in_tilted_axes(cam: dict[str, Any]) -> None:
    flat, tilted = linkdyn.Scene(cam), check_roads(in_tilted_axes(cam))
    one, other = flat.inverse(want="all"), tilted.inverse(want="all")
    for name in ("joint_variable", "joint_rate", "driving_force", "contact_force", "pressure_angle"):
        np.testing.assert_allclose(other[name].values, one[name].values, atol=1e-11 * np.abs(one[name].values).max() + 1e-13, err_msg=name)
    force = one.reaction.values[..., :2] @ TILT[:, :2].T
    np.testing.assert_allclose(other.reaction.values[..., :3], force, atol=1e-10 * np.abs(force).max())


# ---------------------------------------------------------------- round a drum
FAR, PACE = 0.08, 4 * np.pi
STEADY = {"law": "constant-rate", "rate": PACE, "start": 0.2}


def drum(follower: dict[str, Any], guide: dict[str, Any], *joints: dict[str, Any], links: tuple[dict[str, Any], ...] = (), place: list[float] | None = None) -> dict[str, Any]:
    """A drum about z, or about another axis, and what it moves."""
    body = {"name": "drum", "markers": {"O": [0, 0, 0]}, "mass": 5.0, "cog": [0.01, 0.0, 0.02], "inertia": [0.02, 0.021, 0.016, 0, 0, 0.001]}
    return {
        "space": "spatial", "gravity": [1.0, 2.0, -9.81], "frame": {"markers": {"O": [0, 0, 0], "G": place}}, "link": [body, follower, *links],
        "joint": [{"name": "shaft", "type": "revolute", "between": ["frame.O", "drum.O"]}, guide, *joints],
        "coordinate": [along("shaft", STEADY)], "actuator": [{"joint": "shaft"}], "time": {"end": 0.5, "samples": 201},
    }  # fmt: skip


def curve(height: Any, points: int = 720, **more: Any) -> dict[str, Any]:
    angle = 2 * np.pi * np.arange(points) / points
    return {"name": "C", "type": "cam", "between": ["drum.O", "follower.R"], "follower": "roller", "radius": 0.01,
            "curve": {"angle": angle.tolist(), "height": height(angle).tolist()}} | more  # fmt: skip


def wave(angle: np.ndarray) -> np.ndarray:
    return 0.05 + 0.02 * np.sin(2 * angle) + 0.004 * np.cos(3 * angle)


def slope(angle: np.ndarray) -> np.ndarray:
    return 0.04 * np.cos(2 * angle) - 0.012 * np.sin(3 * angle)


def bend(angle: np.ndarray) -> np.ndarray:
    return -0.08 * np.sin(2 * angle) - 0.036 * np.cos(3 * angle)


def lifted(*joints: dict[str, Any], links: tuple[dict[str, Any], ...] = ()) -> dict[str, Any]:
    """A follower that slides beside the drum, along its axis."""
    follower = {"name": "follower", "markers": {"R": [0, 0, 0], "G": [0, 0, 0]}, "mass": 0.7, "cog": [0.02, 0.01, 0.03], "inertia": [1e-3, 1e-3, 1e-3, 0, 0, 0]}
    guide = {"name": "G", "type": "prismatic", "between": ["frame.G", "follower.G"], "start": -0.25}
    return drum(follower, guide, *joints, links=links, place=[FAR, 0, 0.3])


def swung(**more: Any) -> dict[str, Any]:
    """A lever across the axis, whose roller goes up and down beside the drum."""
    follower = {"name": "follower", "markers": {"R": [0, -0.25, 0], "G": {"at": [0, 0, 0], "axis": [1, 0, 0]}}, "mass": 0.7, "cog": [0.02, -0.1, 0.03], "inertia": [1e-3, 1.2e-3, 1.4e-3, 0, 0, 0]}
    data = drum(follower, {"name": "G", "type": "revolute", "between": ["frame.G", "follower.G"], "start": 0.0}, curve(wave, **more))
    data["frame"]["markers"]["G"] = {"at": [FAR, 0.25, 0.05], "axis": [1, 0, 0]}
    return data


DRUMS = {"slides": lifted(curve(wave)), "turns": swung(), "groove": lifted(curve(wave, side="groove")), "from below": swung(side="inside")}


def test_a_slide_by_the_formulas() -> None:
    run = linkdyn.Scene(DRUMS["slides"]).inverse(want="all")
    angle = -(0.2 + PACE * run.time.values)  # of the follower, seen from the drum
    np.testing.assert_allclose(run.joint_variable.sel(variable="G.slide") + 0.3, wave(angle), atol=1e-10)
    np.testing.assert_allclose(run.joint_rate.sel(variable="G.slide"), -PACE * slope(angle), atol=1e-7)
    force = 0.7 * (PACE**2 * bend(angle) + 9.81)
    steep = slope(angle) / FAR
    np.testing.assert_allclose(run.contact_force.values[:, 0], force * np.sqrt(1 + steep**2), atol=1e-4 * np.abs(force).max())
    np.testing.assert_allclose(run.pressure_angle.values[:, 0], np.arctan(np.abs(steep)), atol=1e-6)
    push = run.reaction.sel(joint="C").values
    np.testing.assert_allclose(push[:, :3], np.stack([0 * force, -force * steep, force], axis=1), atol=1e-4 * np.abs(force).max())
    # What turns the drum: the work of lifting, its weight off the axis, and its middle held on a circle.
    weight = 5.0 * (0.01 * np.cos(-angle) * -2.0 - 0.01 * np.sin(-angle) * -1.0)
    np.testing.assert_allclose(run.driving_force.values[:, 0], -force * slope(angle) + weight, atol=2e-5)


def test_a_lever_by_implicit_differentiation() -> None:
    """Where height and lever agree, by Newton's method; how it moves, by the rule for implicit functions and complex steps."""

    def rate(q: Any, lever: Any) -> Any:
        y, z = 0.25 - 0.25 * np.cos(lever), -0.25 * np.sin(lever)
        dy, dz = -z, y - 0.25
        angle = np.arctan(y / FAR) - q
        return slope(angle) / (slope(angle) * FAR * dy / (FAR**2 + y**2) - dz)

    run = linkdyn.Scene(DRUMS["turns"]).inverse(want="all")
    q, lever = 0.2 + PACE * run.time.values, run.joint_variable.sel(variable="G.angle").values
    y, z = 0.25 - 0.25 * np.cos(lever), 0.05 - 0.25 * np.sin(lever)
    np.testing.assert_allclose(z, wave(np.arctan2(y, FAR) - q), atol=1e-10)
    first = rate(q, lever)
    second = (rate(q + 1e-30j, lever) + 0j).imag / 1e-30 + first * rate(q, lever + 1e-30j).imag / 1e-30
    np.testing.assert_allclose(run.joint_rate.sel(variable="G.angle"), PACE * first, atol=1e-6)
    # Moment that the lever asks for about its hinge, over the drum by virtual work.
    cosine, sine = np.cos(lever), np.sin(lever)
    arm_y, arm_z = -0.1 * cosine - 0.03 * sine, -0.1 * sine + 0.03 * cosine
    moment = (1e-3 + 0.7 * (0.1**2 + 0.03**2)) * PACE**2 * second + 0.7 * (arm_y * 9.81 + arm_z * 2.0)
    weight = 5.0 * (0.01 * np.cos(q) * -2.0 - 0.01 * np.sin(q) * -1.0)
    np.testing.assert_allclose(run.driving_force.values[:, 0], moment * first + weight, atol=1e-4)
    assert float(np.abs(run.power_imbalance).max()) < 1e-12


def test_as_a_shoe_on_a_swash_plate() -> None:
    """The height of a tilted plane is that of a swash plate: what moves, and what turns it, is the same."""
    tilt = 0.3
    cam = linkdyn.Scene(lifted(curve(lambda angle: FAR * np.tan(tilt) * np.cos(angle)))).inverse(want="all")
    shoe = {"name": "shoe", "markers": {"R": [0, 0, 0], "U": {"at": [0, 0, 0], "axis": [1, 0, 0]}}, "mass": 0}
    plate = lifted({"name": "plate", "type": "planar", "between": ["drum.plate", "shoe.R"]}, {"name": "C", "type": "universal", "between": ["shoe.U", "follower.U"]}, links=(shoe,))
    plate["link"][1]["markers"]["U"] = {"at": [0, 0, 0], "axis": [0, 1, 0]}
    plate["link"][0]["markers"]["plate"] = {"at": [0, 0, 0], "axis": [-np.sin(tilt), 0, np.cos(tilt)]}
    other = linkdyn.Scene(plate).inverse(want="all")
    for name in ("joint_variable", "joint_rate"):
        np.testing.assert_allclose(cam[name].sel(variable="G.slide"), other[name].sel(variable="G.slide"), atol=1e-6)
    np.testing.assert_allclose(cam.driving_force, other.driving_force, atol=1e-4)
    np.testing.assert_allclose(cam.reaction.sel(joint="C").values[:, 2], other.reaction.sel(joint="C").values[:, 2], atol=1e-3)


@pytest.mark.parametrize("data", DRUMS.values(), ids=DRUMS)
def test_every_road(data: dict[str, Any]) -> None:
    found = check_roads(data)
    run = found.inverse(want="all")
    motion, rates = link_motion(found, run), run.joint_rate.values
    seen = motion.spin[:, 2, 0] if "G.angle" in run.variable else motion.velocity[:, 2, 2]
    np.testing.assert_allclose(seen, rates[:, 1], atol=1e-11 * np.abs(rates).max())
    _, _, acceleration = motion.of_point(2, data["link"][1]["cog"])
    force = (run.reaction.sel(joint="C") + run.reaction.sel(joint="G")).values[:, :3]
    np.testing.assert_allclose(force, 0.7 * (acceleration - np.array(data["gravity"])), atol=1e-9)
    same(run, found.inverse(want="all", **LANES))
    rng = np.random.default_rng(11)
    q, qd, qdd = rng.uniform(-2.5, 3.0, (400, 1)), rng.uniform(-30, 30, (400, 1)), rng.uniform(-300, 300, (400, 1))
    same(found.inverse(q=q, qd=qd, qdd=qdd, want="all"), found.inverse(q=q, qd=qd, qdd=qdd, want="all", **LANES))


@pytest.mark.parametrize("name", ["slides", "turns"])
def test_forward(name: str) -> None:
    """The forces found lead along the motion; without them energy stays."""
    data = copy.deepcopy(DRUMS[name])
    run = linkdyn.Scene(data).forward(t=np.linspace(0, 0.2, 9), rtol=1e-8, atol=1e-9, want="all")
    np.testing.assert_allclose(run.q.values, linkdyn.Scene(data).motion(run.time.values)[0], atol=1e-5)
    assert run.closure.max() < 1e-12
    free = linkdyn.Scene(let_go(data)).forward(t=np.linspace(0, 0.3, 16), rtol=1e-8, atol=1e-9, want="all")
    energy = (free.kinetic_energy + free.potential_energy).values
    assert (free.status == 0).all() and np.ptp(energy) < 1e-5 * np.ptp(free.kinetic_energy.values)


def test_which_side_is_pressed() -> None:
    """A roller below the curve is pressed down: what is pressed from above would pull it."""
    above, below = (linkdyn.Scene(swung(side=side)).inverse(want="all") for side in ("outside", "inside"))
    np.testing.assert_allclose(above.contact_force, -below.contact_force, rtol=1e-12)
    np.testing.assert_allclose(above.driving_force, below.driving_force, rtol=1e-12)


def test_a_table_and_its_base(tmp_path: Any) -> None:
    angle = np.arange(0, 361, 2)
    rows = "\n".join(f"{a},{1e3 * wave(np.radians(a)) - 40!r}" for a in angle.tolist())
    (tmp_path / "drum.csv").write_text(f"angle [deg],height [mm]\n{rows}\n".replace("np.float64(", "").replace(")", ""))
    data = lifted(curve(wave, points=180))
    data["joint"][2]["curve"] = {"table": "drum.csv", "base": "40 mm"}
    one, other = linkdyn.Scene(lifted(curve(wave, points=180))).inverse(), linkdyn.Scene(data, folder=tmp_path).inverse()
    np.testing.assert_allclose(one.driving_force, other.driving_force, atol=1e-8)
