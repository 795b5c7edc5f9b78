"""Cams: against the linkages that an eccentric circle makes of them, against textbook formulas, and one road of the engine against another."""

from __future__ import annotations

import copy
import subprocess
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn.cli import executable
from linkdyn._geometry.kinematics import link_motion
from test_joint_kinds import along, check_roads, let_go

pytestmark = pytest.mark.accuracy

RADIUS, OFF, ROLLER = 0.04, 0.015, 0.01
STEADY = {"law": "constant-rate", "rate": "300 rpm", "start": 0.3}
SWAY = {"law": "harmonic", "mean": 0.3, "amplitude": 2.0, "frequency": "9 rad/s"}


def circle(points: int = 240) -> dict[str, Any]:
    """The radius of a circle about a point beside its centre."""
    angle = 2 * np.pi * np.arange(points) / points
    return {"angle": angle.tolist(), "radius": (OFF * np.cos(angle) + np.sqrt(RADIUS**2 - (OFF * np.sin(angle)) ** 2)).tolist()}


def scene(law: dict[str, Any] = SWAY, **parts: Any) -> dict[str, Any]:
    return {"space": "planar", "gravity": [0, -9.81], "time": {"end": 0.4, "samples": 201},
            "coordinate": [along("shaft", law)], "actuator": [{"joint": "shaft"}]} | parts


CAM = {"name": "cam", "markers": {"O": [0, 0], "M": [OFF, 0]}, "mass": 1.0, "cog": [0.01, 0.002], "inertia": 0.001}
SHAFT = {"name": "shaft", "type": "revolute", "between": ["frame.O", "cam.O"]}


def contact(follower: str, points: int = 240, **more: Any) -> dict[str, Any]:
    return {"name": "C", "type": "cam", "between": ["cam.O", "follower.R"], "follower": follower, "curve": circle(points)} | more


def lifter(*joints: dict[str, Any], links: tuple[dict[str, Any], ...] = (), law: dict[str, Any] = SWAY) -> dict[str, Any]:
    """A follower that slides up and down, beside the shaft."""
    follower = {"name": "follower", "markers": {"R": {"at": [0, 0], "axis": [0, -1]}, "guide": {"at": [0, 0.02], "axis": [0, 1]}}, "mass": 0.5, "cog": [0.003, 0.03]}
    guide = {"name": "guide", "type": "prismatic", "between": ["frame.guide", "follower.guide"], "start": 0.07}
    return scene(law, frame={"markers": {"O": [0, 0], "guide": {"at": [0.005, 0], "axis": [0, 1]}}}, link=[CAM, follower, *links], joint=[SHAFT, guide, *joints])


def lever(*joints: dict[str, Any], links: tuple[dict[str, Any], ...] = (), angle: float = 0.2) -> dict[str, Any]:
    """A follower that turns."""
    follower = {"name": "follower", "markers": {"A": [0, 0], "R": {"at": [-0.08, 0.0], "axis": [0, -1]}}, "mass": 0.5, "cog": [-0.03, 0.01], "inertia": 0.0008}
    hinge = {"name": "hinge", "type": "revolute", "between": ["frame.A", "follower.A"], "start": angle}
    return scene(frame={"markers": {"O": [0, 0], "A": [0.08, 0.05]}}, link=[CAM, follower, *links], joint=[SHAFT, hinge, *joints])


def rod(length: float) -> tuple[tuple[dict[str, Any], ...], tuple[dict[str, Any], ...]]:
    """What a circle and a roller are: a rod between their centres."""
    link = {"name": "rod", "markers": {"M": [0, 0], "R": [length, 0]}, "mass": 0}
    return ({"name": "M", "type": "revolute", "between": ["cam.M", "rod.M"]}, {"name": "C", "type": "revolute", "between": ["rod.R", "follower.R"]}), (link,)


def face(**more: Any) -> tuple[tuple[dict[str, Any], ...], tuple[dict[str, Any], ...]]:
    """What a circle and a straight face are: a slide at a distance, hinged in the circle's centre."""
    link = {"name": "slider", "markers": {"M": [0, 0], "face": {"at": [0, RADIUS], "axis": [1, 0]}}, "mass": 0}
    return ({"name": "M", "type": "revolute", "between": ["cam.M", "slider.M"]},
            {"name": "C", "type": "prismatic", "between": ["follower.face", "slider.face"]} | more), (link,)


def with_face(follower: dict[str, Any]) -> dict[str, Any]:
    """A marker along the face, where the other one is square to it."""
    written = copy.deepcopy(follower)
    link = next(link for link in written["link"] if link["name"] == "follower")
    link["markers"]["face"] = {"at": link["markers"]["R"]["at"], "axis": [1, 0]}
    return written


PAIRS = {
    "point, slides": (lifter(contact("point")), lifter(*rod(RADIUS)[0], links=rod(RADIUS)[1])),
    "roller, slides": (lifter(contact("roller", radius=ROLLER)), lifter(*rod(RADIUS + ROLLER)[0], links=rod(RADIUS + ROLLER)[1])),
    "face, slides": (lifter(contact("flat")), with_face(lifter(*face()[0], links=face()[1]))),
    "point, turns": (lever(contact("point")), lever(*rod(RADIUS)[0], links=rod(RADIUS)[1])),
    "roller, turns": (lever(contact("roller", radius=ROLLER)), lever(*rod(RADIUS + ROLLER)[0], links=rod(RADIUS + ROLLER)[1])),
    "face, turns": (lever(contact("flat"), angle=0.0), with_face(lever(*face(start=0.09)[0], links=face(start=0.09)[1], angle=0.0))),
    "inside a ring": (lifter(contact("roller", radius=ROLLER, side="inside")), lifter(*rod(RADIUS - ROLLER)[0], links=rod(RADIUS - ROLLER)[1])),
    "path of the centre": (lifter(contact("roller", radius=ROLLER, curve=circle() | {"of": "centre"})), lifter(*rod(RADIUS)[0], links=rod(RADIUS)[1])),
    "groove": (lifter(contact("roller", radius=ROLLER, side="groove")), lifter(*rod(RADIUS)[0], links=rod(RADIUS)[1])),
}


@pytest.mark.parametrize("cam, linkage", PAIRS.values(), ids=PAIRS)
def test_as_the_linkage(cam: dict[str, Any], linkage: dict[str, Any]) -> None:
    """An eccentric circle is a crank. What differs is the spline: fourth order in places, second in accelerations."""
    one, other = linkdyn.Scene(cam).inverse(want="all"), linkdyn.Scene(linkage).inverse(want="all")
    assert (one.status == 0).all() and (other.status == 0).all()
    guide = "guide.slide" if "guide.slide" in one.variable.values else "hinge.angle"
    for name, tolerance in (("joint_variable", 1e-8), ("joint_rate", 1e-6)):
        found, wanted = (run[name].sel(variable=guide).values for run in (one, other))
        np.testing.assert_allclose(found, wanted, atol=tolerance * np.abs(wanted).max())
    for name, tolerance in (("driving_force", 5e-4), ("reaction", 5e-4)):
        found, wanted = one[name].values, other[name].values
        if name == "reaction":
            found, wanted = (run[name].sel(joint="C").values for run in (one, other))
            if "slider" in str(linkage):
                found, wanted = found[:, :2], -wanted[:, :2]     # the slide's reaction is on its other link
        np.testing.assert_allclose(found, wanted, atol=tolerance * np.abs(wanted).max())


@pytest.mark.parametrize("follower", ["roller", "flat"])
def test_order(follower: str) -> None:
    """Twice the points: places sixteen, accelerations four times as good."""
    more = {"radius": ROLLER} if follower == "roller" else {}
    q = np.linspace(0.1, 6.1, 137)[:, np.newaxis]
    runs = [linkdyn.Scene(lifter(contact(follower, points, **more))).inverse(q=q, qd=0 * q + 30, qdd=0 * q, want="all") for points in (60, 120, 1920)]
    height = [run.joint_variable.sel(variable="guide.slide").values for run in runs]
    force = [run.contact_force.values for run in runs]
    assert np.abs(height[0] - height[2]).max() > 10 * np.abs(height[1] - height[2]).max()
    assert np.abs(force[0] - force[2]).max() > 3 * np.abs(force[1] - force[2]).max()
    assert np.abs(height[1] - height[2]).max() < 1e-8


CAMS = {name: cam for name, (cam, _) in PAIRS.items()}


@pytest.mark.parametrize("cam", CAMS.values(), ids=CAMS)
def test_every_road(cam: dict[str, Any]) -> None:
    """Solvers, power; poses differentiated by Python's own rows and its own search on the curve."""
    found = check_roads(cam)
    run = found.inverse(want="all")
    motion = link_motion(found, run)
    rates = run.joint_rate.values
    guide = list(run.variable.values).index("guide.slide" if "guide.slide" in run.variable.values else "hinge.angle")
    seen = motion.velocity[:, 2, 1] if run.variable.values[guide] == "guide.slide" else motion.spin[:, 2, 2]
    np.testing.assert_allclose(seen, rates[:, guide], atol=1e-11 * np.abs(rates).max())
    force = run.reaction.sel(joint="C").values
    marker = np.array(cam["link"][1]["markers"]["R"]["at"])
    if run.variable.values[guide] == "guide.slide":
        _, _, acceleration = motion.of_point(2, [*cam["link"][1]["cog"], 0])
        np.testing.assert_allclose(force[:, 1], 0.5 * (acceleration[:, 1] + 9.81), atol=1e-9)
    else:
        _, _, acceleration = motion.of_point(2, [*cam["link"][1]["cog"], 0])
        turn = motion.rotation[:, 2, :2, :2]
        cog, arm = turn @ np.array(cam["link"][1]["cog"]), turn @ marker
        moment = 0.0008 * motion.spin_rate[:, 2, 2] + 0.5 * (cog[:, 0] * (acceleration[:, 1] + 9.81) - cog[:, 1] * acceleration[:, 0])
        np.testing.assert_allclose(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0] + force[:, 2], moment, atol=1e-10)


FORWARD = ("roller, slides", "face, turns", "groove")


@pytest.mark.parametrize("name", FORWARD)
def test_forward(name: str) -> None:
    """The forces found lead along the motion; without them energy stays."""
    run = linkdyn.Scene(CAMS[name]).forward(t=np.linspace(0, 0.2, 9), rtol=1e-8, atol=1e-9, want="all")
    np.testing.assert_allclose(run.q.values, linkdyn.Scene(CAMS[name]).motion(run.time.values)[0], atol=1e-5)
    assert run.closure.max() < 1e-12
    free = linkdyn.Scene(let_go(CAMS[name])).forward(t=np.linspace(0, 0.3, 16), rtol=1e-8, atol=1e-9, want="all")
    energy = (free.kinetic_energy + free.potential_energy).values
    assert (free.status == 0).all() and np.ptp(energy) < 1e-5 * np.ptp(free.kinetic_energy.values)


# ---------------------------------------------------------------- by records

LANES = {"solver": "gauss-jordan"}
SHOWN = ("driving_force", "reaction", "joint_variable", "joint_rate", "contact_force", "pressure_angle")


def same(one: Any, other: Any) -> None:
    """But for rounding. Pressure angles may all be zero."""
    np.testing.assert_array_equal(one.status, other.status)
    for name in SHOWN:
        if name in other:
            largest = 1.0 if name == "pressure_angle" else np.nanmax(np.abs(other[name].values))
            np.testing.assert_allclose(one[name].values, other[name].values, atol=4e-14 * largest, err_msg=name)


@pytest.mark.parametrize("cam", CAMS.values(), ids=CAMS)
def test_record_against_lanes(cam: dict[str, Any], tmp_path: Path) -> None:
    """Operations of a record that look up in the curve, against the lanes' own search: along a motion, and each pose on its own."""
    found = linkdyn.Scene(cam)
    times = np.linspace(0, 0.7, 400)
    same(found.inverse(t=times, want="all"), found.inverse(t=times, want="all", **LANES))
    rng = np.random.default_rng(11)
    q, qd, qdd = rng.uniform(-2.5, 3.0, (400, 1)), rng.uniform(-30, 30, (400, 1)), rng.uniform(-300, 300, (400, 1))
    same(found.inverse(q=q, qd=qd, qdd=qdd, want="all"), found.inverse(q=q, qd=qd, qdd=qdd, want="all", **LANES))
    file = tmp_path / "cam.toml"
    file.write_text(found.text)
    told = subprocess.run([executable(), "explain", file], capture_output=True, text=True, check=True).stdout
    assert "look-ups in curves" in told


def test_record_with_laws_and_friction(tmp_path: Path) -> None:
    """A spring whose force is a table over the follower's way, and a guide that rubs: the record has these beside the cam."""
    (tmp_path / "pull.csv").write_text("way [mm],pull [N]\n0,60\n30,20\n50,5\n70,-5\n90,-40\n120,-90\n")
    cam = copy.deepcopy(CAMS["roller, slides"])
    cam["measures"] = {"way": {"joint": "guide"}}
    cam["laws"] = {"pull": {"table": "pull.csv", "column": "pull", "over": "way", "interpolation": "spline"}}
    cam["spring"] = [{"name": "S", "joint": "guide", "force": "pull"}]
    cam["friction"] = [{"joint": "shaft", "coulomb": 0.1, "radius": 0.01}]
    found = linkdyn.Scene(cam, folder=tmp_path)
    times = np.linspace(0, 0.7, 400)
    run = found.inverse(t=times, want="all")
    assert (run.status == 0).all()
    same(run, found.inverse(t=times, want="all", **LANES))


def test_record_out_of_reach() -> None:
    """A lever too short for the cam's nose: samples fail with the same status, along a motion and on their own."""
    cam = copy.deepcopy(CAMS["roller, turns"])
    cam["frame"]["markers"]["A"] = [0.128, 0.0]
    found = linkdyn.Scene(cam)
    q = np.linspace(0.3, 6.6, 500)[:, np.newaxis]
    for runs in ([found.inverse(q=q, qd=0 * q + 3, qdd=0 * q, want="all", **more) for more in ({}, LANES)],):
        assert set(np.unique(runs[1].status)) != {0}
        same(*runs)


# ---------------------------------------------------------------- by the textbook

LIFT, BASE = 0.012, 0.03


def cycloid(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Up and down by cycloids, with dwells: lift and its derivatives by the angle."""
    span = np.radians(120)
    u = np.mod(angle, 2 * np.pi)
    lift, slope, bend = np.zeros_like(u), np.zeros_like(u), np.zeros_like(u)
    lift[u >= span] = LIFT
    down = u >= np.radians(180)
    x = np.where(down, u - np.radians(180), u) / span
    sign = np.where(down, -1.0, 1.0)
    moves = (x > 0) & (x < 1)
    rise = LIFT * (x - np.sin(2 * np.pi * x) / (2 * np.pi))
    lift = np.where(moves, np.where(down, LIFT - rise, rise), np.where(down & (x >= 1), 0.0, lift))
    slope[moves] = (sign * LIFT / span * (1 - np.cos(2 * np.pi * x)))[moves]
    bend[moves] = (sign * LIFT * 2 * np.pi / span**2 * np.sin(2 * np.pi * x))[moves]
    return lift, slope, bend


def radial(points: int = 720) -> dict[str, Any]:
    """A roller follower above the shaft, its law given as the path of its centre. The cam turns clockwise, so that its angles come round in their order."""
    angle = 2 * np.pi * np.arange(points) / points
    curve = {"angle": (angle + np.pi / 2).tolist(), "radius": cycloid(angle)[0].tolist(), "base": BASE, "of": "centre"}
    cam = lifter(contact("roller", radius=ROLLER, curve=curve), law={"law": "constant-rate", "rate": -30.0})
    cam["frame"]["markers"]["guide"]["at"] = [0, 0]
    cam["link"][1]["cog"] = [0, 0.03]
    cam["link"][0] = CAM | {"mass": 0, "inertia": 0, "cog": [0, 0]}
    cam["joint"][1]["start"] = 0.05
    return cam


def test_cycloidal_lift() -> None:
    """Lift, speed, acceleration, torque and pressure angle of a law that is known."""
    run = linkdyn.Scene(radial()).inverse(want="all")
    lift, slope, bend = cycloid(-run.q.values[:, 0])
    np.testing.assert_allclose(run.joint_variable.sel(variable="guide.slide") - 0.02, BASE + lift, atol=1e-8)
    np.testing.assert_allclose(run.joint_rate.sel(variable="guide.slide"), 30 * slope, atol=1e-5)
    force = 0.5 * (9.81 + 900 * bend)                       # along the guide
    alpha = np.arctan2(np.abs(slope), BASE + lift)          # tan = s' / (r + s)
    np.testing.assert_allclose(run.pressure_angle.values[:, 0], alpha, atol=1e-5)
    np.testing.assert_allclose(run.contact_force.values[:, 0], force / np.cos(alpha), atol=0.01)
    np.testing.assert_allclose(run.driving_force.values[:, 0], -force * slope, atol=2e-4)
    side = run.reaction.sel(joint="guide").values[:, 0]
    np.testing.assert_allclose(np.abs(side), np.abs(force) * np.tan(alpha), atol=0.01)


def test_pressure_angle_of_a_lever() -> None:
    """Between the normal and what is square to the arm: for an eccentric circle the normal lies along both centres."""
    found = linkdyn.Scene(CAMS["roller, turns"])
    run = found.inverse(want="all")
    q, hinge = run.q.values[:, 0], run.joint_variable.sel(variable="hinge.angle").values
    centre = OFF * np.exp(1j * q)
    arm = -0.08 * np.exp(1j * hinge)
    normal = 0.08 + 0.05j + arm - centre
    np.testing.assert_allclose(np.abs(normal), RADIUS + ROLLER, rtol=1e-8)
    wanted = np.arcsin(np.abs((normal * np.conj(arm)).real) / np.abs(normal * arm))
    np.testing.assert_allclose(run.pressure_angle.values[:, 0], wanted, atol=1e-6)


def test_flat_face_is_pressed_off_its_middle() -> None:
    """The moment about the follower's marker is the force times how far beside it the face is touched: the lift's slope."""
    run = linkdyn.Scene(lifter(contact("flat"), law=STEADY)).inverse(want="all")
    q = run.q.values[:, 0]
    np.testing.assert_allclose(run.joint_variable.sel(variable="guide.slide") - 0.02, RADIUS + OFF * np.sin(q), atol=1e-8)
    moment = run.contact_force.values[:, 0] * (OFF * np.cos(q) - 0.005)
    np.testing.assert_allclose(run.reaction.sel(joint="C").values[:, 2], moment, atol=1e-6)
    assert np.abs(run.pressure_angle).max() < 1e-12


# ---------------------------------------------------------------- where it would lift

def test_lift_is_told(tmp_path: Path) -> None:
    cam = lifter(contact("roller", radius=ROLLER), law=STEADY)
    run = linkdyn.Scene(cam).inverse(want="all")
    force = run.contact_force.values[:, 0]
    lifts = int((force < 0).sum())
    assert 0 < lifts < len(force) and (run.status == 0).all()
    file = tmp_path / "cam.toml"
    file.write_text(linkdyn.Scene(cam).text)
    told = subprocess.run([executable(), "inverse", file, "-o", tmp_path / "cam.nc"], capture_output=True, text=True, check=True).stdout
    assert f"lifts            'C': the follower would leave its cam in {100 * lifts / len(force):.4f}"[:80] in told and f"({lifts} samples, first at t = " in told
    heavy = copy.deepcopy(cam)
    heavy["spring"] = [{"name": "S", "joint": "guide", "stiffness": 800.0, "rest": 0.0}]
    assert linkdyn.Scene(heavy).inverse(want="all").contact_force.min() > 0
    heavy["joint"][2]["side"] = "groove"
    assert "lifts" not in told.replace("lifts            'C'", "")


def test_inside_presses_outwards() -> None:
    """Hanging in a ring the weight presses; above its middle it pulls: the force is counted from the side of the follower."""
    ring = lifter(contact("roller", radius=ROLLER, side="inside"))
    still = linkdyn.Scene(ring).inverse(q=[[0.3]], qd=[[0.0]], qdd=[[0.0]], want="all")
    low = copy.deepcopy(ring)
    low["joint"][1]["start"] = -0.02
    other = linkdyn.Scene(low).inverse(q=[[0.3]], qd=[[0.0]], qdd=[[0.0]], want="all")
    assert still.contact_force.item() < 0 < other.contact_force.item()


# ---------------------------------------------------------------- elsewhere

def test_table_and_points(tmp_path: Path) -> None:
    """Radii from a file, and points either way round, are one curve."""
    given = circle(360)
    angle, radius = np.array(given["angle"]), np.array(given["radius"])
    rows = "\n".join(f"{a!r},{1e3 * float(r)!r}" for a, r in zip(np.degrees(angle).tolist(), radius.tolist()))
    (tmp_path / "cam.csv").write_text(f"angle [deg],radius [mm]\n{rows}\n360,{1e3 * float(radius[0])!r}\n")
    q = np.linspace(0, 6, 50)[:, np.newaxis]
    runs = []
    for curve in (given, {"table": "cam.csv"}, {"x": (radius * np.cos(angle)).tolist(), "y": (radius * np.sin(angle)).tolist()},
                  {"x": (radius * np.cos(angle))[::-1].tolist(), "y": (radius * np.sin(angle))[::-1].tolist()}):
        cam = lifter(contact("roller", radius=ROLLER, curve=curve))
        file = tmp_path / "scene.toml"
        file.write_text(linkdyn.Scene(cam, folder=tmp_path).text)
        runs.append(linkdyn.load(file).inverse(q=q, qd=0 * q + 20, qdd=0 * q, want="all").contact_force.values)
    np.testing.assert_allclose(runs[1], runs[0], rtol=1e-9)
    np.testing.assert_allclose(runs[3], runs[2], rtol=1e-9)
    np.testing.assert_allclose(runs[2], runs[0], atol=2e-3)


def test_on_a_moving_link() -> None:
    """Cam on the coupler of a crank, marker askew: a lever on the crank rides on it. All roads, and the poses' own balance."""
    moving = scene(
        frame={"markers": {"O": [0, 0], "B": {"at": [0.3, 0], "axis": [1, 0]}}},
        link=[{"name": "crank", "markers": {"O": [0, 0], "A": [0.1, 0], "P": [0.05, 0.06]}, "mass": 1.0, "cog": [0.05, 0.01], "inertia": 0.002},
              {"name": "cam", "markers": {"A": [0, 0], "B": [0.3, 0], "K": {"at": [0.01, -0.005], "x": [1, 0.4]}}, "mass": 1.0, "cog": [0.1, 0.0], "inertia": 0.01},
              {"name": "block", "markers": {"B": {"at": [0, 0], "axis": [1, 0]}}, "mass": 0.7},
              {"name": "lever", "markers": {"P": [0, 0], "R": [0.07, -0.02]}, "mass": 0.3, "cog": [0.03, 0.0], "inertia": 0.0004}],
        joint=[{"name": "shaft", "type": "revolute", "between": ["frame.O", "crank.O"]}, {"name": "A", "type": "revolute", "between": ["crank.A", "cam.A"]},
               {"name": "B", "type": "revolute", "between": ["cam.B", "block.B"]}, {"name": "slide", "type": "prismatic", "between": ["frame.B", "block.B"]},
               {"name": "P", "type": "revolute", "between": ["crank.P", "lever.P"]},
               {"name": "C", "type": "cam", "between": ["cam.K", "lever.R"], "follower": "roller", "radius": 0.01, "curve": circle(360)}])
    moving["coordinate"][0]["motion"] = {"law": "harmonic", "mean": 0.3, "amplitude": 0.5, "frequency": "9 rad/s"}
    found = check_roads(moving)
    run = found.inverse(want="all")
    motion = link_motion(found, run)
    np.testing.assert_allclose(motion.spin[:, 4, 2] - motion.spin[:, 1, 2], run.joint_rate.sel(variable="P.angle").values, atol=1e-11)
    assert "pressure_angle" in run


def test_in_sweeps_and_ensembles() -> None:
    cam = CAMS["roller, slides"]
    found = linkdyn.Scene(cam)
    free = linkdyn.Scene(let_go(cam))
    times = np.linspace(0, 0.1, 3)
    spun = free.ensemble([[0.1], [0.2]], [[0.3], [5.0]], times, step=2e-4)
    np.testing.assert_allclose(spun.q.values[0, :, 0], free.forward(t=times, rtol=1e-8, atol=1e-9).q.values[:, 0], atol=1e-5)
    radii, q = (0.008, 0.02), np.linspace(0.1, 6.0, 33)[:, np.newaxis]
    swept = found.sweep({"reduce": ["driving_force"], "axis": [{"coordinate": "shaft", "linspace": [0.1, 6.0, 33]}, {"rate": "shaft", "values": [25.0]},
                                                               {"parameter": "joint.C.radius", "values": list(radii)}]})
    largest = max(float(found.with_({"joint.C.radius": radius}).inverse(q=q, qd=0 * q + 25, qdd=0 * q).driving_force.max()) for radius in radii)
    assert float(swept.driving_force_max.max()) == pytest.approx(largest, rel=1e-12)
    runs = [found.with_({"joint.C.radius": radius}).inverse(q=q, qd=0 * q + 25, qdd=0 * q, want="all") for radius in radii]
    more = {"reduce": ["contact_force", "pressure_angle"], "limit": [{"of": "contact_force", "min": 0}]}
    swept = found.sweep(more | {"axis": [{"coordinate": "shaft", "linspace": [0.1, 6.0, 33]}, {"rate": "shaft", "values": [25.0]},
                                         {"parameter": "joint.C.radius", "values": list(radii)}]})
    assert float(swept.contact_force_min.min()) == pytest.approx(min(float(run.contact_force.min()) for run in runs), rel=1e-12)
    assert float(swept.pressure_angle_max.max()) == pytest.approx(max(float(run.pressure_angle.max()) for run in runs), rel=1e-12)


def test_order_of_samples_does_not_matter() -> None:
    """A contact is found from the pose alone."""
    found = linkdyn.Scene(CAMS["roller, turns"])
    q = np.random.default_rng(4).uniform(-9, 9, 40)[:, np.newaxis]
    together = found.inverse(q=q, qd=0 * q + 3, qdd=0 * q, want="all")
    for k in (0, 7, 39):
        alone = found.inverse(q=q[k:k + 1], qd=[[3.0]], qdd=[[0.0]], want="all")
        np.testing.assert_array_equal(alone.contact_force.values[0], together.contact_force.values[k])


def test_error_estimates() -> None:
    """A spline's second derivatives magnify what its points round by one over the square of their distance, 1,460 here; estimates are
    some twenty times too large, and accelerations make less than all of the force."""
    for name in ("roller, slides", "face, turns"):
        run = linkdyn.Scene(CAMS[name]).inverse(want="all", error=True)
        magnified = 20 * np.finfo(float).eps * (240 / (2 * np.pi)) ** 2
        assert 0 < (run.driving_force_error / np.abs(run.driving_force).max()).max() < 5 * magnified


def test_nothing_but_a_curve() -> None:
    """All markers in one point: the size of the mechanism is that of the cam."""
    cam = radial(360)
    for link in cam["link"]:
        link["markers"] = {name: {"at": [0, 0]} | ({"axis": [0, 1]} if name == "guide" else {}) for name in link["markers"]}
    cam["joint"][1]["start"] = 0.03
    run = linkdyn.Scene(cam).inverse(want="all")
    np.testing.assert_allclose(run.joint_variable.sel(variable="guide.slide"), BASE + cycloid(-run.q.values[:, 0])[0], atol=2e-7)


def test_states_that_are_none() -> None:
    """They are refused or fail; they do not reach into the curve."""
    found = linkdyn.Scene(CAMS["roller, turns"])
    with pytest.raises(linkdyn.LinkdynError):
        found.inverse(q=[[np.nan]], qd=[[0.0]], qdd=[[0.0]])
    far = linkdyn.Scene(CAMS["face, slides"]).inverse(q=[[1e12]], qd=[[1e160]], qdd=[[0.0]])
    assert far.status.item() != 0


# ---------------------------------------------------------------- lifts that are narrower than steps


BASE, STEEP, WEIGHT, FLYWHEEL, SPEED = 0.03, 0.02, 20.0, 0.02, 30.0


def lifted(angle: np.ndarray, half: float) -> tuple[np.ndarray, np.ndarray]:
    """A lift (1 - (a/half)^2)^4 about the angle 0, as steep whatever its width, and its derivative."""
    a = (angle + np.pi) % (2 * np.pi) - np.pi
    part = np.maximum(1 - (a / half) ** 2, 0.0)
    return STEEP * half * part**4, -8 * STEEP * a / half * part**3


def nose(half: float) -> dict[str, Any]:
    """A flywheel with one lift, which raises a weight on a point."""
    angle = np.concatenate([np.linspace(-1.2 * half, 1.2 * half, 97), np.linspace(1.2 * half, 2 * np.pi - 1.2 * half, 60)[1:-1]])
    return {
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"O": [0, 0], "guide": {"at": [0, 0], "axis": [0, 1]}}},
        "link": [{"name": "cam", "mass": 1, "inertia": FLYWHEEL, "markers": {"O": [0, 0]}},
                 {"name": "weight", "mass": WEIGHT, "markers": {"R": {"at": [0, 0], "axis": [0, -1]}, "guide": {"at": [0, 0], "axis": [0, 1]}}}],
        "joint": [{"name": "shaft", "type": "revolute", "between": ["frame.O", "cam.O"]},
                  {"name": "guide", "type": "prismatic", "between": ["frame.guide", "weight.guide"], "start": BASE},
                  {"name": "C", "type": "cam", "between": ["cam.O", "weight.R"], "follower": "point",
                   "curve": {"angle": angle.tolist(), "radius": (BASE + lifted(angle, half)[0]).tolist()}}],
        "coordinate": [{"joint": "shaft", "start": {"position": 0.0, "velocity": SPEED}}],
    }  # fmt: skip


def instants(turned: np.ndarray, half: float) -> np.ndarray:
    """When the flywheel has turned so far: speeds by the energy, the time by quadrature piece by piece."""
    ends = np.pi / 2 + 2 * np.pi * np.arange(-1, turned[-1] // (2 * np.pi) + 2)
    grid = np.unique(np.concatenate([[0.0], turned, (ends[:, np.newaxis] + half * np.linspace(-1, 1, 201)).ravel()]))
    grid = grid[(grid >= 0) & (grid <= turned[-1])]
    nodes, weights = np.polynomial.legendre.leggauss(8)
    place = (grid[1:] + grid[:-1])[:, np.newaxis] / 2 + np.diff(grid)[:, np.newaxis] / 2 * nodes
    lift, slope = lifted(np.pi / 2 - place, half)
    pace = np.sqrt((FLYWHEEL + WEIGHT * slope**2) / (FLYWHEEL * SPEED**2 - 2 * WEIGHT * 9.81 * lift))
    time = np.concatenate([[0.0], np.cumsum(pace @ weights * np.diff(grid) / 2)])
    return np.interp(turned, grid, time)


@pytest.mark.parametrize("method", ["gbs", "rk8pd", "rkf45", "seulex", "msbdf"])
@pytest.mark.parametrize(("half", "tolerance"), [(8, 1e-8), (3, 1e-8), (1, 1e-8), (8, 1e-10)])
def test_narrow_lifts_are_not_leapt_over(half: float, tolerance: float, method: str) -> None:
    """Between two lifts nothing asks for short steps, and a lift adds and takes no energy: whoever leaps over one is early, which only
    the instants tell: by 0.036 rad at least. At the tightest tolerance the dwell's steps are chosen among rounding."""
    half = np.radians(half)
    turned = np.linspace(0.0, 12 * 2 * np.pi, 13)
    t = instants(turned, half)
    run = linkdyn.Scene(nose(half)).forward(t=t, method=method, rtol=tolerance, atol=tolerance)
    assert not run.status.values.any()
    np.testing.assert_allclose(run.q.values[:, 0], turned, rtol=0, atol=1e-2)


@pytest.mark.parametrize("half", [1, 2, 8])
def test_no_speed_comes_of_a_lift_that_is_gone(half: float) -> None:
    """A Jacobian from the flank, kept in the dwell behind it, let the multistep method go on as its history did: at 1e-6 one lift made the
    flywheel faster by 0.3 % for good. What is left is ten thousand tolerances, step by step."""
    half = np.radians(half)
    turned = np.linspace(0.0, 12 * 2 * np.pi, 13)
    run = linkdyn.Scene(nose(half)).forward(t=instants(turned, half), method="msbdf", rtol=1e-6, atol=1e-6)
    assert not run.status.values.any()
    np.testing.assert_allclose(run.qd.values[:, 0], SPEED, rtol=1e-3)
    np.testing.assert_allclose(run.q.values[:, 0], turned, rtol=0, atol=3e-2)


@pytest.mark.parametrize("follower", ["roller", "flat", "point"])
@pytest.mark.parametrize("height", ["10 mm", "60 mm"])
def test_motion_of_an_oblique_lever(follower: str, height: str) -> None:
    """Velocity and acceleration of its marker are those of its positions, however far beside the cam's plane it is."""
    text = (Path(__file__).parents[1] / "scenes" / "flat_cam_3d.toml").read_text().replace("axis = [0.1, 1, 0.05]", "axis = [0.3, 1, 0.1]").replace('"10 mm", "-35 mm"', f'"{height}", "-35 mm"')
    radius = 'radius = "8 mm"' if follower == "roller" else ""
    text = text.replace("coulomb = 0.1", 'coulomb = 0.1\nradius = "3 mm"' if radius else "coulomb = 0.1")
    scene = linkdyn.Scene(text.replace('follower = "flat"', f'follower = "{follower}"\n{radius}'))
    step, steps = 1e-4, np.arange(-3, 4)
    for instant in (0.05, 0.13):
        run = scene.inverse(t=instant + step * steps)
        assert (run.status == 0).all()
        told = run.linkdyn.marker("lever.face")
        velocity = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60 @ told.position.values / step
        acceleration = np.array([2, -27, 270, -490, 270, -27, 2]) / 180 @ told.position.values / step**2
        np.testing.assert_allclose(told.velocity[3], velocity, atol=1e-9 * np.abs(velocity).max())
        np.testing.assert_allclose(told.acceleration[3], acceleration, atol=1e-7 * np.abs(acceleration).max())
