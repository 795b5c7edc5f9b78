"""Welds, planar joints and screws: by hand, against mechanisms without them, and one road of the engine against another."""

from __future__ import annotations

import copy
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn.cli import executable, quadruple_twin
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "hard"))

from cases import Case  # noqa: E402
from twin import quadruple_forces  # noqa: E402

pytestmark = pytest.mark.accuracy

GRAVITY = np.array([0.0, 0.0, -9.81])
FIRST, SECOND = 0, 1


# ---------------------------------------------------------------- roads


def tensor(inertia: list[float]) -> NDArray[np.float64]:
    """Ixx Iyy Izz Ixy Iyz Izx as a matrix."""
    xx, yy, zz, xy, yz, zx = inertia
    return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])


def components(t: NDArray[np.float64]) -> list[float]:
    return [t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[1, 2], t[2, 0]]


def merged(first: dict[str, Any], second: dict[str, Any], rotation: NDArray[np.float64], shift: NDArray[np.float64]) -> dict[str, Any]:
    """Mass properties of two bodies as one, in the first one's axes; the second has its origin at `shift`."""
    mass = first["mass"] + second["mass"]
    own, other = np.array(first["cog"]), shift + rotation @ np.array(second["cog"])
    cog = (first["mass"] * own + second["mass"] * other) / mass
    total = np.zeros((3, 3))
    for m, c, about in ((first["mass"], own, tensor(first["inertia"])), (second["mass"], other, rotation @ tensor(second["inertia"]) @ rotation.T)):
        r = c - cog
        total += about + m * (r @ r * np.eye(3) - np.outer(r, r))
    return {"mass": mass, "cog": cog.tolist(), "inertia": components(total)}


def cross_matrix(v: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def check_balance(scene: dict[str, Any], t: float, tolerance: float = 2e-7) -> None:
    """Newton and Euler for every link of a spatial scene, from poses alone, by differences of sixth order: what a link needs is what
    the reactions, drives and loads of the results give it."""
    weights, h = np.array([2, -27, 270, -490, 270, -27, 2]) / 180, 2e-3
    mechanism = linkdyn.Scene(scene)
    instants = t + h * np.arange(-3, 4)
    run = mechanism.inverse(*mechanism.motion(instants), t=instants).isel(sample=3)
    poses = mechanism.poses(mechanism.motion(instants)[0], in_order=True)
    names = [link["name"] for link in scene["link"]]
    markers = {link["name"]: link["markers"] for link in [*scene["link"], {"name": "frame", **scene["frame"]}]}
    axes = {joint["name"]: joint["axes"] for joint in described(mechanism)}

    def place(name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if name == "frame":
            return np.zeros(3), np.eye(3)
        return poses.position[3, names.index(name)], poses.rotation[3, names.index(name)]

    def point(link: str, marker: str) -> NDArray[np.float64]:
        own = markers[link][marker]
        origin, rotation = place(link)
        return origin + rotation @ np.array(own["at"] if isinstance(own, dict) else own, dtype=float)

    acting: dict[str, list[tuple[Any, Any, Any]]] = {name: [] for name in [*names, "frame"]}    # force, moment, point
    for joint in scene["joint"]:
        (a, _), (b, second) = (end.split(".") for end in joint["between"])
        at = point(b, second)
        wrench = run.reaction.sel(joint=joint["name"]).values
        for actuator, force in zip(scene["actuator"], run.driving_force.values):
            if actuator["joint"] != joint["name"]:
                continue
            axis = place(a)[1] @ axes[joint["name"]][actuator.get("variable", "")]
            wrench = wrench + np.concatenate([axis, 0 * axis] if is_slide(joint, actuator) else [0 * axis, axis]) * force
        acting[b].append((wrench[:3], wrench[3:], at))
        acting[a].append((-wrench[:3], -wrench[3:], at))
    for load in scene.get("load", []):
        link, marker = load["on"].split(".")
        rotation = place(link)[1] if load.get("axes") == "link" else np.eye(3)
        acting[link].append((rotation @ load.get("force", [0, 0, 0]), rotation @ load.get("moment", [0, 0, 0]), point(link, marker)))
    largest = max(np.abs(force).max() for wrenches in acting.values() for force, _, _ in wrenches)
    for k, link in enumerate(scene["link"]):
        if link["mass"] == 0:
            inertia, cog = np.zeros((3, 3)), np.zeros(3)
        else:
            inertia, cog = tensor(link["inertia"]), np.array(link.get("cog", [0, 0, 0]))
        centre = poses.position[:, k] + poses.rotation[:, k] @ cog
        acceleration = np.einsum("n,nk->k", weights, centre) / h**2
        second_rate = np.einsum("n,nij->ij", weights, poses.rotation[:, k]) / h**2
        pseudo = np.trace(inertia) / 2 * np.eye(3) - inertia
        spin = second_rate @ pseudo @ poses.rotation[3, k].T - poses.rotation[3, k] @ pseudo @ second_rate.T
        force = sum(f for f, _, _ in acting[link["name"]]) - link["mass"] * (acceleration - scene["gravity"])
        moment = cross_matrix(sum(m + np.cross(p - centre[3], f) for f, m, p in acting[link["name"]])) - spin
        assert np.abs(force).max() < tolerance * largest, link["name"]
        assert np.abs(moment).max() < tolerance * largest, link["name"]


def described(mechanism: linkdyn.Scene) -> list[dict[str, Any]]:
    """Joints with the axes of their variables in the first link's axes."""
    joints = []
    for joint in mechanism.description["joints"]:
        link = mechanism.description["links"][joint["links"][FIRST]]
        marker = next(m for m in link["markers"] if m["name"] == joint["markers"][FIRST])
        z = np.array(marker["axis"])
        x = np.array(marker["x"])
        joints.append({"name": joint["name"], "axes": {"": z, "angle": z, "angle1": z, "slide": z, "x": x, "y": np.cross(z, x)}})
    return joints


def is_slide(joint: dict[str, Any], actuator: dict[str, Any]) -> bool:
    return joint["type"] == "prismatic" or actuator.get("variable") in ("slide", "x", "y")


def with_payload(scene: dict[str, Any], name: str, moved: list[str], *, is_welded: bool, is_parallel: bool) -> dict[str, Any]:
    """A body more on a link, as a link of its own that takes over some of its markers, or made one with it."""
    changed = copy.deepcopy(scene)
    link = next(link for link in changed["link"] if link["name"] == name)
    planar = scene["space"] == "planar"
    n = 2 if planar else 3
    shift = np.array([0.07, -0.04, 0.05])[:n]
    c, s = np.cos(0.6), np.sin(0.6)
    rotation = np.eye(n) if is_parallel else np.array([[c, -s], [s, c]]) if planar else np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ [[1, 0, 0], [0, c, -s], [0, s, c]]
    extra: dict[str, Any] = {"name": "extra", "mass": 0.7, "cog": [0.03, 0.06, -0.02][:n], "markers": {}}
    extra["inertia"] = 0.002 if planar else [0.002, 0.0023, 0.0021, 0.0002, 0.0001, -0.0003]
    if isinstance(link.get("inertia"), dict):
        link["inertia"] = [*link["inertia"]["diagonal"], 0.0, 0.0, 0.0]
    link.setdefault("cog", [0.0] * n)
    if not is_welded:
        if planar:
            total = merged(in_space(link), in_space(extra), block(rotation), np.append(shift, 0.0))
            link.update(mass=total["mass"], cog=total["cog"][:2], inertia=total["inertia"][2])
        else:
            link.update(merged(link, extra, rotation, shift))
        return changed
    for marker in moved:
        own = link["markers"].pop(marker)
        own = dict(own) if isinstance(own, dict) else {"at": own}
        own["at"] = (rotation.T @ (np.array(own["at"], dtype=float) - shift)).tolist()
        axis = np.array(own.get("axis", [1, 0] if planar else [0, 0, 1]), dtype=float)
        own["x"] = (rotation.T @ np.array(own.get("x", [1, 0] if planar else natural_x(axis)), dtype=float)).tolist()
        own["axis"] = (rotation.T @ axis).tolist()
        extra["markers"][marker] = own
    # the weld's own frame is turned against both links
    link["markers"]["weld"] = {"at": (shift + rotation @ [0.02, 0.01, 0.03][:n]).tolist(), "axis": (rotation @ [0.1, 0.2, 0.9][:n]).tolist()}
    extra["markers"]["weld"] = {"at": [0.02, 0.01, 0.03][:n], "axis": [0.1, 0.2, 0.9][:n]}
    x = np.array([0.1, 0.2]) if planar else np.cross([0.1, 0.2, 0.9], [0.3, 0.4, -0.2])
    link["markers"]["weld"]["x"], extra["markers"]["weld"]["x"] = (rotation @ x).tolist(), x.tolist()
    for joint in changed["joint"]:
        joint["between"] = [end.replace(f"{name}.", "extra.") if end.startswith(f"{name}.") and end.split(".")[1] in moved else end for end in joint["between"]]
    changed["link"].append(extra)
    changed["joint"].append({"name": "weld", "type": "fixed", "between": [f"{name}.weld", "extra.weld"]})
    return changed


def natural_x(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """The link's x turned by the smallest rotation that takes its z to the axis."""
    z = axis / np.linalg.norm(axis)
    v = cross_matrix(np.cross([0, 0, 1], z))
    return (np.eye(3) + v + v @ v / (1 + z[2]))[:, 0]


def in_space(link: dict[str, Any]) -> dict[str, Any]:
    """A planar body's mass properties in space."""
    return {"mass": link["mass"], "cog": [*link["cog"], 0.0], "inertia": [0.0, 0.0, link["inertia"], 0.0, 0.0, 0.0]}


def block(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    whole = np.eye(3)
    whole[:2, :2] = rotation
    return whole


def along(joint: str, law: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"joint": joint, "motion": law, **more}


def check_roads(scene: dict[str, Any], *, tolerance: float = 1e-10, reduced: bool = True) -> linkdyn.Scene:
    """Solvers that share little, the recorded and the other engine, power, forward after inverse."""
    mechanism = linkdyn.Scene(scene)
    run = mechanism.inverse(want="all")
    assert (run.status == 0).all()
    assert np.abs(run.power_imbalance).max() < tolerance
    q, qd, qdd = mechanism.motion()
    assert len(q) >= 128
    forces = np.abs(run.driving_force.values).max()
    reactions = np.abs(run.reaction.values).max()
    recorded = mechanism.inverse(q=q, qd=qd, qdd=qdd)
    single = mechanism.inverse(q=q[7:8], qd=qd[7:8], qdd=qdd[7:8])
    dense = mechanism.inverse(q=q, qd=qd, qdd=qdd, solver="lapack")
    for other in (recorded, dense):
        assert np.abs(other.driving_force.values - run.driving_force.values).max() <= tolerance * forces
        assert np.abs(other.reaction.values - run.reaction.values).max() <= tolerance * reactions
    assert np.abs(single.reaction.values - run.reaction.values[7:8]).max() <= tolerance * reactions
    if reduced:
        virtual = mechanism.inverse(q=q, qd=qd, qdd=qdd, solver="reduced")
        assert np.abs(virtual.driving_force.values - run.driving_force.values).max() <= tolerance * forces
    return mechanism


# ---------------------------------------------------------------- welds

ARM: dict[str, Any] = {
    "space": "spatial", "gravity": GRAVITY.tolist(),
    "frame": {"markers": {"A": [0.0, 0.0, 0.3]}},
    "link": [
        {"name": "column", "mass": 20.0, "cog": [0.02, 0.0, 0.25], "inertia": [1.2, 1.1, 0.3, 0.01, 0.02, 0.03],
         "markers": {"A": [0, 0, 0], "B": {"at": [0.1, 0, 0.5], "axis": [0, 1, 0]}}},
        {"name": "arm", "mass": 8.0, "cog": [0.3, 0.0, 0.0], "inertia": [0.05, 0.4, 0.4, 0.0, 0.01, 0.0],
         "markers": {"B": {"at": [0, 0, 0], "axis": [0, 1, 0]}, "W": {"at": [0.6, 0.05, 0.1], "axis": [1, 0, 0.2]}}},
        {"name": "payload", "mass": 5.0, "cog": [0.1, 0.05, 0.02], "inertia": [0.04, 0.05, 0.06, 0.002, 0.001, 0.003],
         "markers": {"W": {"at": [0.02, -0.03, 0.04], "axis": [0, 0.3, 1]}, "tip": [0.1, 0, 0]}},
    ],
    "joint": [
        {"name": "J1", "type": "revolute", "between": ["frame.A", "column.A"]},
        {"name": "J2", "type": "revolute", "between": ["column.B", "arm.B"]},
        {"name": "W", "type": "fixed", "between": ["arm.W", "payload.W"]},
    ],
    "load": [{"on": "payload.tip", "axes": "link", "force": [10, 20, -30], "moment": [1, 2, 3]}],
    "coordinate": [
        along("J1", {"law": "harmonic", "amplitude": "40 deg", "frequency": "2 rad/s"}),
        along("J2", {"law": "harmonic", "mean": 0.3, "amplitude": "30 deg", "frequency": "3 rad/s"}),
    ],
    "actuator": [{"joint": "J1"}, {"joint": "J2"}],
    "time": {"end": 2, "samples": 201},
}


@pytest.mark.parametrize("t", [0.31, 1.37])
def test_welded_payload_by_hand(t: float) -> None:
    """The weld's reaction is what Newton and Euler ask for the payload."""
    check_balance(ARM, t)


def test_welded_payload_every_road() -> None:
    mechanism = check_roads(ARM)
    assert "fixed" in mechanism.explain() and "payload by fixed joint W" in mechanism.explain()
    assert list(mechanism.inverse().variable.values) == ["J1.angle", "J2.angle"]


@pytest.mark.parametrize("is_parallel", [True, False])
def test_weld_against_one_body(is_parallel: bool) -> None:
    """Driving forces and all other reactions are those of the two bodies made one."""
    apart = linkdyn.Scene(with_payload(ARM, "column", ["B"], is_welded=True, is_parallel=is_parallel))
    whole = linkdyn.Scene(with_payload(ARM, "column", ["B"], is_welded=False, is_parallel=is_parallel))
    same_forces(apart, whole, 1e-13)
    check_roads(with_payload(ARM, "column", ["B"], is_welded=True, is_parallel=is_parallel))
    check_balance(with_payload(ARM, "column", ["B"], is_welded=True, is_parallel=is_parallel), 0.4)


def same_forces(one: linkdyn.Scene, other: linkdyn.Scene, tolerance: float) -> None:
    a, b = one.inverse(), other.inverse()
    assert (a.status == 0).all() and (b.status == 0).all()
    assert np.abs(a.driving_force.values - b.driving_force.values).max() <= tolerance * np.abs(b.driving_force.values).max()
    for joint in b.joint.values:
        theirs = b.reaction.sel(joint=joint).values
        assert np.abs(a.reaction.sel(joint=joint).values - theirs).max() <= tolerance * np.abs(b.reaction.values).max(), joint


def spatial_loop() -> dict[str, Any]:
    """The spatial slider-crank of the examples, its crank driven."""
    scene = tomllib.loads((ROOT / "examples" / "spatial_slider_crank" / "scene.toml").read_text())
    scene["coordinate"] = [along("A", {"law": "harmonic", "amplitude": "50 deg", "frequency": "3 rad/s"})]
    scene["actuator"] = [{"joint": "A"}]
    scene["time"] = {"end": 2.0, "samples": 201}
    for link in scene["link"]:
        link["inertia"] = [*link["inertia"]["diagonal"], 0.0, 0.0, 0.0]
    return scene


def planar_loop() -> dict[str, Any]:
    scene = tomllib.loads((ROOT / "examples" / "fourbar_start" / "scene.toml").read_text())
    scene.pop("load", None)
    for joint in scene["joint"]:
        joint.pop("branch", None)
    poses = linkdyn.Scene(scene).poses()
    for k, link in enumerate(scene["link"]):
        angle = np.arctan2(poses.rotation[0, k, 1, 0], poses.rotation[0, k, 0, 0])
        link["start"] = {"position": poses.position[0, k].tolist()[:2], "angle": float(angle)}
    return scene


@pytest.mark.parametrize("is_parallel", [True, False])
@pytest.mark.parametrize("link, moved", [("rod", ["C"]), ("slider", ["C"]), ("crank", ["B"])])
def test_weld_inside_a_spatial_loop(link: str, moved: list[str], is_parallel: bool) -> None:
    if link == "slider":    # its one marker holds both joints
        moved = []
    scene = with_payload(spatial_loop(), link, moved, is_welded=True, is_parallel=is_parallel)
    same_forces(linkdyn.Scene(scene), linkdyn.Scene(with_payload(spatial_loop(), link, moved, is_welded=False, is_parallel=is_parallel)), 1e-11)
    check_roads(scene)
    check_balance(scene, 0.7, 1e-6)


def test_welds_to_the_frame_and_in_a_row() -> None:
    """A base plate welded to the frame, a mast welded to it, the arm on that: reactions are those without, plus the weight."""
    scene = copy.deepcopy(ARM)
    plate = {"name": "plate", "mass": 30.0, "cog": [0, 0, 0.05], "inertia": [1, 1, 2, 0, 0, 0], "markers": {"F": [0, 0, 0], "M": {"at": [0.1, 0, 0.1], "axis": [0, 1, 1]}}}
    mast = {"name": "mast", "mass": 10.0, "cog": [0, 0, 0.1], "inertia": [0.2, 0.2, 0.1, 0, 0, 0], "markers": {"M": {"at": [0, 0, 0], "axis": [0, 1, 1]}, "A": [-0.1, 0, 0.2]}}
    scene["frame"]["markers"]["F"] = [0, 0, 0]
    scene["link"] += [plate, mast]
    scene["joint"][0]["between"] = ["mast.A", "column.A"]
    scene["joint"] += [{"name": "F", "type": "fixed", "between": ["frame.F", "plate.F"]}, {"name": "M", "type": "fixed", "between": ["mast.M", "plate.M"]}]
    same_forces(linkdyn.Scene(scene), linkdyn.Scene(ARM), 1e-13)
    check_roads(scene)
    check_balance(scene, 0.9)


@pytest.mark.parametrize("is_parallel", [True, False])
@pytest.mark.parametrize("link", [0, 1, 2])
def test_weld_in_a_planar_four_bar(link: int, is_parallel: bool) -> None:
    """A link in two pieces: the dyad becomes a group closed by iteration, or the crank a chain."""
    scene = planar_loop()
    held = [end.split(".")[1] for joint in scene["joint"] for end in joint["between"] if end.startswith(scene["link"][link]["name"] + ".")]
    name, moved = scene["link"][link]["name"], held[-1:]
    apart = with_payload(scene, name, moved, is_welded=True, is_parallel=is_parallel)
    same_forces(linkdyn.Scene(apart), linkdyn.Scene(with_payload(scene, name, moved, is_welded=False, is_parallel=is_parallel)), 1e-10)
    check_roads(apart)


def test_weld_in_forward_runs() -> None:
    """An arm that swings freely keeps its energy; one that is driven by the forces found follows its motion."""
    scene = copy.deepcopy(ARM)
    del scene["load"]
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 1, 21), rtol=1e-11, atol=1e-11, want="all")
    q = linkdyn.Scene(scene).motion(run.time.values)[0]
    np.testing.assert_allclose(run.q.values, q, atol=1e-8)
    for coordinate in scene["coordinate"]:
        coordinate["start"] = {"position": 0.4, "velocity": 0.5}
        del coordinate["motion"]
    del scene["actuator"]
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 2, 21), rtol=1e-11, atol=1e-11, want="all")
    energy = (run.kinetic_energy + run.potential_energy).values
    assert np.ptp(energy) < 1e-7 * np.ptp(run.kinetic_energy.values)


# ---------------------------------------------------------------- planar joints

TILT = {"axis": [0.2, -0.3, 1.0], "x": [1.0, 0.4, 0.1]}


def table(joints: list[dict[str, Any]], links: list[dict[str, Any]]) -> dict[str, Any]:
    """A body that slides on an inclined plane of an arm that swings."""
    arm = {"name": "arm", "mass": 8.0, "cog": [0.3, 0.0, 0.0], "inertia": [0.05, 0.4, 0.4, 0.0, 0.01, 0.0],
           "markers": {"A": {"at": [0, 0, 0], "axis": [0.1, 1, 0]}, "T": {"at": [0.5, 0.1, 0.05], **TILT}}}
    pad = {"name": "pad", "mass": 3.0, "cog": [0.05, 0.02, 0.1], "inertia": [0.02, 0.03, 0.04, 0.001, 0.002, -0.001],
           "markers": {"T": {"at": [0.01, 0.02, -0.03], "axis": [0.1, 0.2, 1], "x": [0.3, 1, 0]}, "tip": [0.1, 0, 0.2]}}
    return {
        "space": "spatial", "gravity": GRAVITY.tolist(), "frame": {"markers": {"A": {"at": [0.1, 0, 0.4], "axis": [0.1, 1, 0]}}},
        "link": [arm, *links, pad],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "arm.A"]}, *joints],
        "load": [{"on": "pad.tip", "axes": "link", "force": [10, 20, -30], "moment": [1, 2, 3]}],
        "coordinate": [along("A", {"law": "harmonic", "amplitude": "40 deg", "frequency": "2 rad/s"})], "actuator": [{"joint": "A"}],
        "time": {"end": 2.0, "samples": 201},
    }


MOVES = {"x": {"law": "harmonic", "mean": 0.1, "amplitude": 0.2, "frequency": "3 rad/s"},
         "y": {"law": "harmonic", "mean": -0.1, "amplitude": 0.1, "frequency": "4 rad/s"},
         "angle": {"law": "harmonic", "mean": 0.2, "amplitude": 0.9, "frequency": "2.5 rad/s"}}


def planar_table() -> dict[str, Any]:
    scene = table([{"name": "T", "type": "planar", "between": ["arm.T", "pad.T"]}], [])
    scene["coordinate"] += [along("T", law, variable=variable) for variable, law in MOVES.items()]
    scene["actuator"] += [{"joint": "T", "variable": variable} for variable in MOVES]
    return scene


def slides_table() -> dict[str, Any]:
    """Two slides and a hinge between massless links instead."""
    z = np.array(TILT["axis"]) / np.linalg.norm(TILT["axis"])
    x = np.array(TILT["x"]) - z * (z @ np.array(TILT["x"]))
    x /= np.linalg.norm(x)
    along_x, along_y = {"axis": x.tolist(), "x": z.tolist()}, {"axis": np.cross(z, x).tolist(), "x": z.tolist()}
    scene = table(
        [{"name": "X", "type": "prismatic", "between": ["arm.X", "first.X"]}, {"name": "Y", "type": "prismatic", "between": ["first.Y", "second.Y"]},
         {"name": "R", "type": "revolute", "between": ["second.R", "pad.T"]}],
        [{"name": "first", "mass": 0, "markers": {"X": {"at": [0, 0, 0], **along_x}, "Y": {"at": [0, 0, 0], **along_y}}},
         {"name": "second", "mass": 0, "markers": {"Y": {"at": [0, 0, 0], **along_y}, "R": {"at": [0, 0, 0], **TILT}}}],
    )
    scene["link"][0]["markers"]["X"] = {"at": [0.5, 0.1, 0.05], **along_x}
    scene["coordinate"] += [along(joint, law) for joint, law in zip("XYR", MOVES.values())]
    scene["actuator"] += [{"joint": joint} for joint in "XYR"]
    return scene


def test_planar_joint_is_two_slides_and_a_hinge() -> None:
    scene = linkdyn.Scene(planar_table())
    ours, theirs = scene.inverse(), linkdyn.Scene(slides_table()).inverse()
    np.testing.assert_allclose(ours.driving_force.values, theirs.driving_force.values, rtol=0, atol=1e-12)
    assert list(ours.variable.values) == ["A.angle", "T.x", "T.y", "T.angle"]
    assert list(ours.actuator_unit.values) == ["N m", "N", "N", "N m"]
    np.testing.assert_allclose(ours.joint_variable.values, theirs.joint_variable.values, rtol=0, atol=1e-14)
    np.testing.assert_allclose(ours.joint_rate.values, theirs.joint_rate.values, rtol=0, atol=1e-13)
    # the hinge's reaction is the planar joint's and what drives the slides
    arm = scene.poses().rotation[:, 0]
    axes = described(scene)[1]["axes"]
    driven = sum(ours.driving_force.sel(actuator=f"T.{k}").values[:, np.newaxis] * (arm @ axes[k]) for k in "xy")
    reaction = ours.reaction.sel(joint="T").values
    np.testing.assert_allclose(reaction[:, :3] + driven, theirs.reaction.sel(joint="R").values[:, :3], rtol=0, atol=1e-11)
    np.testing.assert_allclose(reaction[:, 3:], theirs.reaction.sel(joint="R").values[:, 3:], rtol=0, atol=1e-11)
    # it transmits a force along its axis and moments across it
    axis = arm @ axes[""]
    assert np.abs(np.cross(reaction[:, :3], axis)).max() < 1e-11 and np.abs(np.einsum("nk,nk->n", reaction[:, 3:], axis)).max() < 1e-11


@pytest.mark.parametrize("t", [0.31, 1.37])
def test_planar_joint_by_hand(t: float) -> None:
    check_balance(planar_table(), t)


def test_planar_joint_every_road() -> None:
    mechanism = check_roads(planar_table())
    assert "1 force, 2 moments" in mechanism.explain()


def test_planar_joint_is_not_walked_backwards() -> None:
    scene = planar_table()
    scene["joint"][1]["between"].reverse()
    with pytest.raises(linkdyn.SceneError, match="exchange the two markers"):
        linkdyn.Scene(scene)


def test_planar_joint_in_forward_runs() -> None:
    scene = planar_table()
    del scene["load"]
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 1, 21), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(run.q.values, linkdyn.Scene(scene).motion(run.time.values)[0], atol=1e-8)
    free = let_go(scene)
    free["spring"] = [{"name": "home.x", "joint": "T", "variable": "x", "stiffness": 400, "rest": 0.1}, {"name": "home.y", "joint": "T", "variable": "y", "stiffness": 300},
                      {"name": "home", "joint": "T", "variable": "angle", "stiffness": 3}, {"name": "up", "joint": "A", "stiffness": 100}]
    keeps_energy(free)


def let_go(scene: dict[str, Any]) -> dict[str, Any]:
    free = copy.deepcopy(scene)
    for coordinate in free["coordinate"]:
        coordinate["start"] = {"position": 0.1, "velocity": 0.3}
        coordinate.pop("motion")
    free["actuator"] = []
    return free


def keeps_energy(scene: dict[str, Any], end: float = 2.0) -> Any:
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, end, 41), rtol=1e-11, atol=1e-11, want="all")
    assert (run.status == 0).all()
    energy = (run.kinetic_energy + run.potential_energy).values
    assert np.ptp(energy) < 1e-7 * np.ptp(run.kinetic_energy.values)
    return run


def sliding_pad(coordinate: dict[str, Any]) -> dict[str, Any]:
    """A pad slides on the floor; a rod that hangs on a universal joint runs through a slanted sleeve of it. One freedom."""
    rod = {"name": "rod", "mass": 2.0, "cog": [0.01, 0.02, -0.5], "inertia": [0.2, 0.2, 0.01, 0.001, 0.002, 0.001],
           "start": {"position": [0, 0, 1], "angles": [0, "20 deg", 0]},
           "markers": {"U": {"at": [0, 0, 0], "axis": [0, 1, 0]}, "C": {"at": [0, 0, -1.0], "axis": [0, 0, 1]}}}
    pad = {"name": "pad", "mass": 3.0, "cog": [0.02, 0.03, 0.05], "inertia": [0.02, 0.03, 0.04, 0.001, 0.002, -0.001],
           "start": {"position": [-0.36, 0, 0]},
           "markers": {"E": {"at": [0.05, 0.02, 0], "axis": [0, 0, 1]},
                       "C": {"at": [0, 0, 0.1], "axis": [float(np.sin(np.radians(20))), 0, float(np.cos(np.radians(20)))]}}}
    return {
        "space": "spatial", "gravity": GRAVITY.tolist(),
        "frame": {"markers": {"U": {"at": [0, 0, 1], "axis": [1, 0, 0]}, "E": {"at": [0.1, -0.2, 0], "axis": [0, 0, 1], "x": [1, 1, 0]}}},
        "link": [rod, pad],
        "joint": [{"name": "U", "type": "universal", "between": ["frame.U", "rod.U"]}, {"name": "C", "type": "cylindrical", "between": ["rod.C", "pad.C"]},
                  {"name": "E", "type": "planar", "between": ["frame.E", "pad.E"]}],
        "coordinate": [coordinate], "actuator": [{"joint": "E", "variable": "angle"}], "time": {"end": 2.0, "samples": 301},
    }


@pytest.mark.parametrize("variable, law", [
    ("angle", {"law": "harmonic", "mean": -0.78, "amplitude": 0.5, "frequency": "3 rad/s"}),
    ("y", {"law": "harmonic", "mean": 0.38, "amplitude": 0.05, "frequency": "3 rad/s"}),
])
def test_planar_joint_inside_a_loop(variable: str, law: dict[str, Any]) -> None:
    scene = sliding_pad(along("E", law, variable=variable))
    check_roads(scene, tolerance=1e-9)
    check_balance(scene, 0.7, 1e-6)


# ---------------------------------------------------------------- screws


def nut(lead: float) -> dict[str, Any]:
    """A disc that screws itself up an upright spindle that stands."""
    return {
        "space": "spatial", "gravity": GRAVITY.tolist(), "frame": {"markers": {"S": [0.1, 0.2, 0.3]}},
        "link": [{"name": "nut", "mass": 4.0, "cog": [0, 0, 0.1], "inertia": [0.02, 0.02, 0.03, 0, 0, 0], "markers": {"S": [0, 0, 0.05]}}],
        "joint": [{"name": "S", "type": "screw", "lead": lead, "between": ["frame.S", "nut.S"]}],
        "coordinate": [along("S", {"law": "harmonic", "mean": 10.0, "amplitude": 25.0, "frequency": "2 rad/s"})],
        "actuator": [{"joint": "S"}], "time": {"end": 3.0, "samples": 151},
    }


@pytest.mark.parametrize("lead", [0.01, -0.25])
def test_screw_by_formula(lead: float) -> None:
    """Torque for the weight and for both inertias; thrust and its moment at the thread."""
    scene, h = linkdyn.Scene(nut(lead)), lead / (2 * np.pi)
    run = scene.inverse(want="all")
    acceleration = run.qdd.values[:, 0]
    thrust = 4.0 * (9.81 + h * acceleration)
    np.testing.assert_allclose(run.driving_force.values[:, 0], 0.03 * acceleration + h * thrust, rtol=0, atol=1e-12)
    expected = np.zeros((len(thrust), 6))
    expected[:, 2], expected[:, 5] = thrust, -h * thrust
    np.testing.assert_allclose(run.reaction.values[:, 0], expected, rtol=0, atol=1e-11)
    np.testing.assert_allclose(run.joint_variable.values, run.q.values, rtol=0, atol=0)      # turns count
    np.testing.assert_allclose(scene.poses().position[:, 0, 2], 0.25 + h * run.q.values[:, 0], rtol=0, atol=1e-14)
    assert list(run.actuator_unit.values) == ["N m"] and list(run.variable.values) == ["S.angle"]
    check_roads(nut(lead))
    check_balance(nut(lead), 0.4)


def test_screw_on_a_moving_arm() -> None:
    """A slide driven by a screw in a chain, walked in both senses, everything askew."""
    scene = table([{"name": "T", "type": "screw", "lead": "20 mm", "between": ["arm.T", "pad.T"]}], [])
    scene["coordinate"].append(along("T", {"law": "harmonic", "mean": 3, "amplitude": 30, "frequency": "2 rad/s"}))
    scene["actuator"].append({"joint": "T"})
    mechanism = check_roads(scene)
    assert "3 forces, 2 moments" in mechanism.explain()
    check_balance(scene, 0.6)
    run = mechanism.inverse()
    scene["joint"][1]["between"].reverse()    # the second link's axis as seen from behind: angle and slide change sign
    scene["coordinate"][1]["motion"] = {"law": "harmonic", "mean": -3, "amplitude": -30, "frequency": "2 rad/s"}
    turned = check_roads(scene).inverse()
    np.testing.assert_allclose(turned.driving_force.values, run.driving_force.values * [1, -1], rtol=0, atol=1e-10)
    check_balance(scene, 0.6)
    forward = linkdyn.Scene(scene).forward(t=np.linspace(0, 1, 11), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(forward.q.values, linkdyn.Scene(scene).motion(forward.time.values)[0], atol=1e-7)
    del scene["load"]
    keeps_energy(let_go(scene))


LIFT_LEAD = 0.006


def lift(mass: float = 2.0) -> dict[str, Any]:
    """An arm lifted by a spindle: its nut hangs in a universal joint, its end in a ball of the arm. Driven by the screw's angle."""
    heavy = mass > 0
    arm = {"name": "arm", "mass": 12.0, "cog": [0.5, 0, 0.02], "inertia": [0.1, 1.0, 1.0, 0, 0, 0], "start": {"angles": [0, "-20 deg", 0]},
           "markers": {"O": {"at": [0, 0, 0], "axis": [0, 1, 0]}, "B": [0.7, 0.0, 0.0], "load": [1.0, 0.1, 0]}}
    housing = {"name": "housing", "mass": mass, "start": {"position": [0.7, 0, -0.5]}, "markers": {"U": {"at": [0, 0, 0], "axis": [1, 0, 0]}, "S": {"at": [0, 0, 0.1], "axis": [0, 0, 1]}}}
    spindle = {"name": "spindle", "mass": mass, "start": {"position": [0.7, 0, 0.0]}, "markers": {"S": {"at": [0, 0, -0.4], "axis": [0, 0, 1]}, "B": [0, 0, 0.2]}}
    if heavy:
        housing.update(cog=[0.01, 0.02, 0.05], inertia=[0.02, 0.02, 0.005, 0.001, 0, 0])
        spindle.update(cog=[0, 0, -0.1], inertia=[0.03, 0.03, 0.0008, 0, 0, 0])
    return {
        "space": "spatial", "gravity": GRAVITY.tolist(), "frame": {"markers": {"O": {"at": [0, 0, 0], "axis": [0, 1, 0]}, "U": {"at": [0.7, 0, -0.5], "axis": [0, 1, 0]}}},
        "link": [arm, housing, spindle],
        "joint": [{"name": "O", "type": "revolute", "between": ["frame.O", "arm.O"]}, {"name": "U", "type": "universal", "between": ["frame.U", "housing.U"]},
                  {"name": "S", "type": "screw", "lead": LIFT_LEAD, "between": ["housing.S", "spindle.S"]}, {"name": "B", "type": "spherical", "between": ["spindle.B", "arm.B"]}],
        "coordinate": [along("S", {"law": "polynomial-345", "from": 0.0, "to": "20 rev", "duration": 2.0})], "actuator": [{"joint": "S"}],
        "load": [{"on": "arm.load", "force": [0, 0, -500.0]}], "time": {"samples": 201},
    }


def test_lift_by_hand() -> None:
    """Without mass of the spindle its torque is thrust times lead over a turn, the thrust that of the arm's moments."""
    scene = linkdyn.Scene(lift(0.0))
    run = scene.inverse(want="all")
    assert (run.status == 0).all()
    poses = scene.poses()
    angle = np.arcsin(-poses.rotation[:, 0, 2, 0])    # the arm's, down
    assert angle[0] > angle[-1] and np.ptp(angle) > 0.1
    t, h = scene.times(), 1e-4
    angles = [np.arcsin(-linkdyn.Scene(lift(0.0)).poses(scene.motion(np.clip(t[5:-5] + k * h, 0, 2))[0], in_order=True).rotation[:, 0, 2, 0]) for k in (-1, 0, 1)]
    second = (angles[0] - 2 * angles[1] + angles[2]) / h**2
    rotation = poses.rotation[5:-5, 0]
    ball = rotation @ [0.7, 0, 0]
    line = ball - [0.7, 0, -0.5]
    line /= np.linalg.norm(line, axis=1)[:, np.newaxis]
    cog, load = rotation @ [0.5, 0, 0.02], rotation @ [1.0, 0.1, 0]
    # about y: inertia, weight, load, thrust
    inertia = 1.0 + 12.0 * (0.5**2 + 0.02**2)
    moment = inertia * second - 12.0 * 9.81 * cog[:, 0] - 500.0 * load[:, 0]
    thrust = moment / np.cross(ball, line)[:, 1]
    np.testing.assert_allclose(run.driving_force.values[5:-5, 0], thrust * LIFT_LEAD / (2 * np.pi), rtol=1e-5)


def test_screw_inside_a_loop() -> None:
    mechanism = check_roads(lift(), tolerance=1e-8)
    check_balance(lift(), 0.8, 2e-6)
    # a sample on its own, turns away from the start, stands where the motion leads
    q, qd, qdd = mechanism.motion()
    alone = mechanism.inverse(q=q[150:151], qd=qd[150:151], qdd=qdd[150:151])
    many = mechanism.inverse(q=q[::-1], qd=qd[::-1], qdd=qdd[::-1])
    run = mechanism.inverse()
    np.testing.assert_allclose(alone.driving_force.values[0], run.driving_force.values[150], rtol=1e-9)
    np.testing.assert_allclose(many.driving_force.values[::-1], run.driving_force.values, rtol=1e-8, atol=1e-9)
    forward = mechanism.forward(t=np.linspace(0, 2, 11), rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(forward.q.values, mechanism.motion(forward.time.values)[0], atol=1e-5)


def test_lift_led_by_its_arm() -> None:
    """The screw turns because the arm moves: not self-locking. The torque at the arm is what the spindle's inertia asks for."""
    scene = lift()
    screw = linkdyn.Scene(scene).inverse()
    scene["coordinate"] = [along("O", {"law": "polynomial-345", "from": 0.0, "to": "-10 deg", "duration": 2.0})]
    scene["actuator"] = [{"joint": "O"}]
    mechanism = check_roads(scene, tolerance=1e-8)
    turns = np.ptp(mechanism.inverse(want="all").joint_variable.sel(variable="S.angle").values) / (2 * np.pi)
    assert 15 < turns < 25
    check_balance(scene, 0.8, 2e-6)
    assert screw.driving_force.values.max() < 5.0


def pusher(mass: float) -> dict[str, Any]:
    """A heavy nut drives a flywheel: the spindle hinged upright, the nut kept from turning by a rod to the frame."""
    return {
        "space": "spatial", "gravity": GRAVITY.tolist(),
        "frame": {"markers": {"A": [0, 0, 0], "F": {"at": [0.2, -0.6, 0.5], "axis": [1, 0, 0]}}},
        "link": [
            {"name": "spindle", "mass": 3.0, "cog": [0, 0, 0.3], "inertia": [0.2, 0.2, 0.01, 0, 0, 0], "markers": {"A": [0, 0, 0], "S": [0, 0, 0]}},
            {"name": "nut", "mass": 6.0, "cog": [0, 0, 0], "inertia": [0.02, 0.02, 0.03, 0, 0, 0], "start": {"position": [0, 0, 0.5]}, "markers": {"S": [0, 0, 0], "N": [0.2, 0, 0]}},
            {"name": "stay", "mass": mass, "start": {"position": [0.2, -0.6, 0.5]}, "markers": {"F": {"at": [0, 0, 0], "axis": [0, 0, 1]}, "N": [0, 0.6, 0]}},
        ],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "spindle.A"]},
            {"name": "S", "type": "screw", "lead": "50 mm", "between": ["spindle.S", "nut.S"], "start": "10 rev"},
            {"name": "N", "type": "spherical", "between": ["nut.N", "stay.N"]},
            {"name": "F", "type": "universal", "between": ["frame.F", "stay.F"]},
        ],
        "coordinate": [{"joint": "A"}],
        "time": {"end": 1.0, "samples": 41},
    }


def test_passive_screw() -> None:
    """Let go, the nut sinks and turns the spindle. At first, the stay square to the nut's way, the nut does not turn."""
    scene = pusher(0.0)
    run = keeps_energy(scene, 1.5)
    h = 0.05 / (2 * np.pi)
    # sinking by h an angle: 6 g h = (0.01 + 6 h^2) angle''
    expected = 6 * 9.81 * h / (0.01 + 6 * h**2)
    assert run.qdd.values[0, 0] == pytest.approx(expected, rel=1e-9)
    assert run.q.values[-1, 0] > 4 * np.pi                                      # some turns
    sunk = run.joint_variable.sel(variable="S.angle").values
    np.testing.assert_allclose(sunk[0], 20 * np.pi, rtol=1e-12)
    assert sunk[-1] < 20 * np.pi - 4 * np.pi + 1


def test_many_turns_of_a_hinge_unscrew() -> None:
    """After a whole turn of the spindle's hinge the nut is elsewhere: no sample is taken for one a turn before."""
    scene = pusher(0.0)
    scene["coordinate"] = [along("A", {"law": "polynomial-345", "from": 0.0, "to": "3 rev", "duration": 1.0})]
    scene["actuator"] = [{"joint": "A"}]
    mechanism = linkdyn.Scene(scene)
    q = mechanism.motion()[0]
    along_motion = mechanism.poses(q, in_order=True).position[:, 1, 2]
    alone = mechanism.poses(q, in_order=False).position[:, 1, 2]
    assert along_motion[-1] == pytest.approx(0.5 - 3 * 0.05, abs=0.02)
    np.testing.assert_allclose(alone, along_motion, atol=1e-12)
    check_roads({**scene, "time": {"samples": 201}}, tolerance=1e-8)


# ---------------------------------------------------------------- everywhere else


def test_lead_is_a_parameter() -> None:
    """Sweeps and `with_` vary it; torque without inertia goes with it."""
    scene = nut(0.02)
    scene["link"][0]["inertia"] = [0.02, 0.02, 1e-9, 0, 0, 0]
    scene["coordinate"][0]["motion"] = {"law": "constant", "value": 1.0}
    for lead in (0.01, 0.04, -0.02):
        torque = linkdyn.Scene(scene).with_({"joint.S.lead": lead}).inverse().driving_force.values
        np.testing.assert_allclose(torque, 4.0 * 9.81 * lead / (2 * np.pi), rtol=1e-13)
    with pytest.raises(linkdyn.SceneError, match="lead"):
        linkdyn.Scene(scene).with_({"joint.S.lead": 0.0})


def test_equations_in_symbols() -> None:
    text = linkdyn.Scene(planar_table()).explain(matrix=True)
    for unknown in ("T F1", "T M1", "T M2", "F T.x", "F T.y", "tau T.angle"):
        assert unknown in text
    text = linkdyn.Scene(lift()).explain(matrix=True)
    assert re.search(r"S F1 +S F2 +S F3 +S M1 +S M2", text) and "(J-G)xn-hn" in text and "-(J-G)xn+hn" in text


def test_estimates_and_other_numbers() -> None:
    for scene in (ARM, planar_table(), nut(0.02), lift()):
        run = linkdyn.Scene(scene).inverse(want="all,rcond,singularity_distance", error=True)
        assert (run.rcond > 1e-4).all() and (run.singularity_distance > 0).all()
        assert (run.driving_force_error < 1e-11 * np.abs(run.driving_force).max()).all()


@pytest.mark.twin
@pytest.mark.parametrize("scene", [ARM, planar_table(), nut(0.02), lift(), sliding_pad(along("E", {"law": "harmonic", "mean": -0.78, "amplitude": 0.5, "frequency": "3 rad/s"}, variable="angle"))],
                         ids=["weld", "planar", "screw", "screw in a loop", "planar in a loop"])
def test_against_the_quadruple_twin(scene: dict[str, Any]) -> None:
    """The same sources in quadruple precision: other rounding, and the dense solver."""
    mechanism = linkdyn.Scene(scene)
    t = mechanism.times()
    run = mechanism.inverse()
    case = Case("scene", "", scene, *mechanism.motion(), distance=np.full(len(t), np.nan), time=t)
    exact = quadruple_forces(quadruple_twin(), case, t)
    ours = np.concatenate([run.driving_force.values, run.reaction.values.reshape(len(t), -1)], axis=1)
    assert np.abs(ours - exact).max() <= 1e-12 * np.abs(exact).max()


@pytest.mark.parametrize("solver", ["elimination", "lapack", "gauss-jordan"])
def test_structure(solver: str, tmp_path: Path) -> None:
    """A sensor and what it carries bolted to the frame: nothing moves, the reactions are the weight's. There is no forward run of it."""
    scene = {"space": "spatial", "gravity": GRAVITY.tolist(), "frame": {"markers": {"A": [0, 0, 1]}},
             "link": [{"name": "sensor", "mass": 0.5, "cog": [0.02, 0, 0], "inertia": [1e-4, 1e-4, 1e-4, 0, 0, 0], "markers": {"A": [0, 0, 0], "B": [0.05, 0, 0]}},
                      {"name": "lamp", "mass": 2.0, "cog": [0.3, 0.1, 0], "inertia": [0.01, 0.01, 0.01, 0, 0, 0], "markers": {"B": [0, 0, 0]}}],
             "joint": [{"name": "A", "type": "fixed", "between": ["frame.A", "sensor.A"]}, {"name": "B", "type": "fixed", "between": ["sensor.B", "lamp.B"]}]}
    structure = linkdyn.Scene(scene)
    run = structure.inverse(solver=solver)
    np.testing.assert_allclose(run.reaction.values[0, 1], [0, 0, 19.62, 1.962, -5.886, 0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(run.reaction.values[0, 0], [0, 0, 24.525, 1.962, -5.886 - 0.05 * 19.62 - 0.02 * 4.905, 0], rtol=0, atol=1e-13)
    (tmp_path / "scene.toml").write_text(structure.text)
    told = subprocess.run([executable(), "inverse", "scene.toml", "--solver", solver], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    assert "24.5250 N" in told
    with pytest.raises(linkdyn.LinkdynError, match="nothing moves"):
        structure.forward(t=[0.0, 1.0])
