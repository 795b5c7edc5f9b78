"""Gears, racks and belts: by hand, by Willis, by Newton and Euler from poses alone, and one road of the engine against another."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from test_generate import Compiled
from test_joint_kinds import GRAVITY, along, check_balance, check_roads, keeps_energy, let_go

pytestmark = pytest.mark.accuracy

STEADY = {"law": "constant-rate", "rate": "5 rad/s"}
SWAY = {"law": "harmonic", "mean": 0.3, "amplitude": 2.0, "frequency": "3 rad/s"}


def hinge(name: str, first: str, second: str, **more: Any) -> dict[str, Any]:
    return {"name": name, "type": "revolute", "between": [first, second], **more}


def gear(name: str, first: str, second: str, teeth: list[float], **more: Any) -> dict[str, Any]:
    return {"name": name, "type": "gear", "between": [first, second], "teeth": teeth, **more}


def disc(name: str, markers: dict[str, Any], mass: float = 2.0, inertia: float = 0.02, cog: tuple[float, float] = (0.0, 0.0)) -> dict[str, Any]:
    return {"name": name, "markers": markers, "mass": mass, "cog": list(cog), "inertia": inertia}


def planar(**parts: Any) -> dict[str, Any]:
    return {"space": "planar", "gravity": [0, -9.81], "time": {"end": 2, "samples": 201}, **parts}


# ---------------------------------------------------------------- planar trains

def pair(**more: Any) -> dict[str, Any]:
    """A pinion drives a wheel, whose weight is off its axis."""
    return planar(
        frame={"markers": {"A": [0.1, 0.2], "B": [0.28, 0.44]}},
        link=[disc("pinion", {"A": [0, 0]}, cog=(0.02, 0.01)), disc("wheel", {"B": [0.01, 0.02]}, 5.0, 0.3, (0.05, 0.1))],
        joint=[hinge("A", "frame.A", "pinion.A"), hinge("B", "frame.B", "wheel.B"), gear("G", "pinion.A", "wheel.B", [20, 40], **more)],
        coordinate=[along("A", SWAY)], actuator=[{"joint": "A"}])


def planetary(ring_moves: bool = False, **parts: Any) -> dict[str, Any]:
    """Sun, planet, carrier and ring; the ring stands or is a coordinate."""
    scene = planar(
        frame={"markers": {"O": [0, 0]}},
        link=[disc("sun", {"O": [0, 0]}), disc("carrier", {"O": [0, 0], "P": [0.3, 0]}, 4.0, 0.1, (0.15, 0.02)), disc("planet", {"P": [0, 0]}, 1.5, 0.01)],
        joint=[hinge("S", "frame.O", "sun.O"), hinge("C", "frame.O", "carrier.O"), hinge("P", "carrier.P", "planet.P"),
               gear("SP", "sun.O", "planet.P", [24, 18]), gear("PR", "planet.P", "frame.O", [18, 60], mesh="internal")],
        coordinate=[along("S", SWAY)], actuator=[{"joint": "S"}])
    if ring_moves:
        scene["link"].append(disc("ring", {"O": [0, 0]}, 6.0, 0.8, (0.01, 0.03)))
        scene["joint"].append(hinge("R", "frame.O", "ring.O"))
        scene["joint"][4]["between"][1] = "ring.O"
        scene["coordinate"].append(along("R", {"law": "harmonic", "amplitude": 1.0, "frequency": "2 rad/s"}))
        scene["actuator"].append({"joint": "R"})
    return scene | parts


def rack_and_pinion() -> dict[str, Any]:
    return planar(
        frame={"markers": {"A": [0, 0.1], "R": {"at": [0.2, 0.02], "axis": [1, 0]}}},
        link=[disc("pinion", {"A": [0, 0]}, cog=(0.03, 0.0)), disc("rack", {"R": {"at": [0, 0], "axis": [1, 0]}}, 3.0, 0.0)],
        joint=[hinge("A", "frame.A", "pinion.A"), {"name": "R", "type": "prismatic", "between": ["frame.R", "rack.R"]},
               {"name": "G", "type": "rack", "between": ["pinion.A", "rack.R"], "phase": "50 mm"}],
        coordinate=[along("A", SWAY)], actuator=[{"joint": "A"}])


def belt(run: str = "open", radii: tuple[float, float] = (0.06, 0.15)) -> dict[str, Any]:
    """Two pulleys in a rocking arm, the second with a load."""
    return planar(
        frame={"markers": {"O": [0, 0]}},
        link=[disc("arm", {"O": [0, 0], "A": [0.1, 0.1], "B": [0.5, 0.2]}, 3.0, 0.2, (0.3, 0.1)), disc("small", {"A": [0, 0]}), disc("large", {"B": [0, 0]}, cog=(0.05, 0.0))],
        joint=[hinge("O", "frame.O", "arm.O"), hinge("A", "arm.A", "small.A"), hinge("B", "arm.B", "large.B"),
               {"name": "T", "type": "belt", "between": ["small.A", "large.B"], "radii": list(radii), "run": run}],
        load=[{"on": "large.B", "moment": 7.0, "force": [20, -30]}],
        coordinate=[along("O", {"law": "harmonic", "amplitude": 0.8, "frequency": "4 rad/s"}), along("A", SWAY)], actuator=[{"joint": "O"}, {"joint": "A"}])


def five_bar() -> dict[str, Any]:
    """Both cranks of a five-bar geared one to one by two wheels, each a disc welded to a crank; one freedom."""
    return planar(
        frame={"markers": {"A": [0, 0], "E": [0.3, 0]}},
        link=[disc("crank1", {"A": [0, 0], "B": [0.1, 0]}, 1.0, 0.004, (0.05, 0.0)), disc("rod1", {"B": [0, 0], "C": [0.35, 0]}, 1.5, 0.02, (0.17, 0.01)),
              disc("rod2", {"D": [0, 0], "C": [0.32, 0]}, 1.4, 0.02, (0.16, 0.0)), disc("crank2", {"E": [0, 0], "D": [0.12, 0]}, 1.1, 0.005, (0.06, 0.0))],
        joint=[hinge("A", "frame.A", "crank1.A"), hinge("B", "crank1.B", "rod1.B"), hinge("C", "rod1.C", "rod2.C", branch=1), hinge("D", "crank2.D", "rod2.D"),
               hinge("E", "frame.E", "crank2.E"), gear("G", "crank1.A", "crank2.E", [30, 30], phase="60 deg")],
        load=[{"on": "rod1.C", "force": [10, -50]}],
        coordinate=[along("A", STEADY)], actuator=[{"joint": "A"}])


def driven_slider_crank() -> dict[str, Any]:
    """Motor, two stages, slider-crank."""
    return planar(
        frame={"markers": {"M": [-0.25, 0], "L": [-0.1, 0.1], "A": [0, 0], "R": {"at": [0, 0], "axis": [1, 0]}}},
        link=[disc("motor", {"M": [0, 0]}, 1.0, 0.001), disc("lay", {"L": [0, 0]}, 2.0, 0.01), disc("crank", {"A": [0, 0], "B": [0.08, 0]}, 5.0, 0.05, (0.03, 0.0)),
              disc("rod", {"B": [0, 0], "C": [0.3, 0]}, 1.0, 0.01, (0.15, 0.0)), disc("slider", {"C": [0, 0]}, 3.0, 0.0)],
        joint=[hinge("M", "frame.M", "motor.M"), hinge("L", "frame.L", "lay.L"), hinge("A", "frame.A", "crank.A"), hinge("B", "crank.B", "rod.B"), hinge("C", "rod.C", "slider.C"),
               {"name": "R", "type": "prismatic", "between": ["frame.R", "slider.C"]},
               gear("G1", "motor.M", "lay.L", [17, 45]), gear("G2", "lay.L", "crank.A", [19, 53], phase="20 deg")],
        load=[{"on": "slider.C", "force": [-300, 0]}],
        coordinate=[along("M", {"law": "cycloidal-start", "speed": "40 rad/s", "duration": 1.0})], actuator=[{"joint": "M"}])


def oscillating_pinion() -> dict[str, Any]:
    """A slider-crank pushes a rack, which swings a pinion, and that by a second gear a flywheel: they follow from the loop."""
    return planar(
        frame={"markers": {"A": [0, 0], "R": {"at": [0, 0], "axis": [1, 0]}, "P": [0.45, 0.09], "F": [0.45, 0.24]}},
        link=[disc("crank", {"A": [0, 0], "B": [0.08, 0]}, 2.0, 0.01, (0.03, 0.01)), disc("rod", {"B": [0, 0], "C": [0.3, 0]}, 1.0, 0.01, (0.15, 0.0)),
              disc("slider", {"C": [0, 0], "T": {"at": [0.05, 0.03], "axis": [1, 0]}}, 3.0, 0.0), disc("pinion", {"P": [0, 0]}, 1.5, 0.004, (0.02, 0.0)),
              disc("flywheel", {"F": [0, 0]}, 4.0, 0.05, (0.0, 0.04))],
        joint=[hinge("A", "frame.A", "crank.A"), hinge("B", "crank.B", "rod.B"), hinge("C", "rod.C", "slider.C"),
               {"name": "R", "type": "prismatic", "between": ["frame.R", "slider.C"]}, hinge("P", "frame.P", "pinion.P"), hinge("F", "frame.F", "flywheel.F"),
               {"name": "G", "type": "rack", "between": ["pinion.P", "slider.T"], "phase": "0.3 m"}, gear("H", "pinion.P", "flywheel.F", [20, 30])],
        load=[{"on": "flywheel.F", "moment": 3.0}],
        coordinate=[along("A", STEADY)], actuator=[{"joint": "A"}])


def sector() -> dict[str, Any]:
    """A toothed sector on the rocker of a four-bar swings a pinion; on the coupler a planet turns on a sun that stands in the rocker."""
    return planar(
        frame={"markers": {"A": [0, 0], "D": [0.3, 0], "P": [0.3, 0.2]}},
        link=[disc("crank", {"A": [0, 0], "B": [0.08, 0]}, 2.0, 0.01, (0.03, 0.01)), disc("rod", {"B": [0, 0], "C": [0.28, 0]}, 1.0, 0.01, (0.15, 0.0)),
              disc("rocker", {"D": [0, 0], "C": [0.2, 0], "W": [0.05, 0.05]}, 3.0, 0.02), disc("pinion", {"P": [0, 0]}, 1.5, 0.004, (0.02, 0.0)),
              disc("planet", {"W": [0, 0]}, 0.7, 0.002, (0.01, 0.01))],
        joint=[hinge("A", "frame.A", "crank.A"), hinge("B", "crank.B", "rod.B"), hinge("C", "rod.C", "rocker.C", branch=1), hinge("D", "frame.D", "rocker.D", start=1.5),
               hinge("P", "frame.P", "pinion.P"), hinge("W", "rocker.W", "planet.W"),
               gear("G", "rocker.D", "pinion.P", [73, 20], phase="1 rad"), gear("K", "frame.D", "planet.W", [31, 17])],
        load=[{"on": "pinion.P", "moment": 2.0}],
        coordinate=[along("A", STEADY)], actuator=[{"joint": "A"}])


PLANAR = {"pair": pair(), "internal": pair(mesh="internal", phase="40 deg"), "planetary": planetary(), "differential": planetary(ring_moves=True), "rack": rack_and_pinion(),
          "belt": belt(), "crossed belt": belt("crossed"), "five-bar": five_bar(), "slider-crank": driven_slider_crank(), "rack on a slider": oscillating_pinion(), "sector": sector()}


# ---------------------------------------------------------------- in space

def tensor_of(link: dict[str, Any]) -> list[float]:
    about_z = max(link["inertia"], 0.01)
    return [0.6 * about_z, 0.7 * about_z, about_z, 0.05 * about_z, 0.02 * about_z, -0.03 * about_z]


def tilted(scene: dict[str, Any]) -> dict[str, Any]:
    """A planar scene as one in space, its frame a link that rocks about a slanted axis."""
    from_plane = copy.deepcopy(scene)

    def lifted(markers: dict[str, Any], joints: list[dict[str, Any]], link: str) -> dict[str, Any]:
        slides = {end.split(".")[1] for joint in joints for end in joint["between"] if joint["type"] == "prismatic" and end.startswith(link + ".")}
        whole = {}
        for name, marker in markers.items():
            at = marker["at"] if isinstance(marker, dict) else marker
            whole[name] = {"at": [*at, 0.0]}
            if name in slides:
                axis = marker.get("axis", [1, 0]) if isinstance(marker, dict) else [1, 0]
                whole[name] |= {"axis": [*axis, 0.0], "x": [-axis[1], axis[0], 0.0]}
        return whole

    base = {"name": "base", "markers": lifted(from_plane["frame"]["markers"], from_plane["joint"], "frame") | {"tilt": {"at": [0.1, 0, -0.1], "axis": [1, 0.5, 0.3]}},
            "mass": 3.0, "cog": [0.1, 0.1, 0.05], "inertia": [0.1, 0.2, 0.15, 0.01, 0.0, 0.02]}
    links = [link | {"markers": lifted(link["markers"], from_plane["joint"], link["name"]), "cog": [*link["cog"], 0.03], "inertia": tensor_of(link)} for link in from_plane["link"]]
    joints = [joint | {"between": [end.replace("frame.", "base.") for end in joint["between"]]} for joint in from_plane["joint"]]
    loads = [load | {"force": [*load.get("force", [0, 0]), 15.0], "moment": [1.0, 2.0, load.get("moment", 0.0)]} for load in from_plane.get("load", [])]
    return {"space": "spatial", "gravity": GRAVITY.tolist(), "time": from_plane["time"], "frame": {"markers": {"tilt": {"at": [0, 0, 0.2], "axis": [1, 0.5, 0.3]}}},
            "link": [base, *links], "joint": [hinge("tilt", "frame.tilt", "base.tilt"), *joints], "load": loads,
            "coordinate": [along("tilt", {"law": "harmonic", "amplitude": 0.6, "frequency": "2.5 rad/s"}), *from_plane["coordinate"]],
            "actuator": [{"joint": "tilt"}, *from_plane["actuator"]]}


def bevel(ratio: float = 0.5) -> dict[str, Any]:
    """A differential: both side wheels on one axis, a planet across it in a cage that is itself geared to an input; all of it on a rocking arm."""
    r, p = 0.08, 0.08 * ratio
    cross = [1, 0, 0]
    body = {"mass": 1.5, "cog": [0.01, 0.02, 0.005], "inertia": [0.02, 0.03, 0.025, 0.001, 0.002, -0.001]}
    return {"space": "spatial", "gravity": GRAVITY.tolist(), "time": {"end": 2, "samples": 201},
            "frame": {"markers": {"tilt": {"at": [0, 0, 0.2], "axis": [1, 0.5, 0.3]}}},
            "link": [{"name": "arm", "markers": {"tilt": {"at": [0.1, 0, 0], "axis": [1, 0.5, 0.3]}, "L": [0.3, 0.1, -p], "R": {"at": [0.3, 0.1, p], "axis": [0, 0, -1]},
                                                 "C": [0.3, 0.1, 0], "I": {"at": [0.3, 0.5, 0.02], "axis": [0, 0, 1]}}, **body},
                     {"name": "left", "markers": {"L": [0, 0, 0]}, **body}, {"name": "right", "markers": {"R": {"at": [0, 0, 0], "axis": [0, 0, -1]}}, **body},
                     {"name": "cage", "markers": {"C": [0, 0, 0], "P": {"at": [r, 0, 0], "axis": cross}}, **body},
                     {"name": "planet", "markers": {"P": {"at": [0, 0, 0], "axis": cross}}, **body}, {"name": "input", "markers": {"I": [0, 0, 0]}, **body}],
            "joint": [hinge("tilt", "frame.tilt", "arm.tilt"), hinge("L", "arm.L", "left.L"), hinge("R", "arm.R", "right.R"), hinge("C", "arm.C", "cage.C"),
                      hinge("P", "cage.P", "planet.P"), hinge("I", "arm.I", "input.I"),
                      gear("LP", "left.L", "planet.P", [2, 2 * ratio]), gear("RP", "right.R", "planet.P", [2, 2 * ratio]), gear("IC", "input.I", "cage.C", [15, 40])],
            "load": [{"on": "left.L", "axes": "link", "moment": [0, 0, 4.0]}, {"on": "right.R", "axes": "link", "moment": [0, 0, 3.0]}],
            "coordinate": [along("tilt", {"law": "harmonic", "amplitude": 0.6, "frequency": "2.5 rad/s"}), along("L", SWAY), along("I", STEADY)],
            "actuator": [{"joint": "tilt"}, {"joint": "L"}, {"joint": "I"}]}


LOOPS = ("five-bar", "slider-crank", "rack on a slider", "sector")
"""Rigid planes: in space their joints hold some directions twice."""
SPATIAL = {name: tilted(scene) for name, scene in PLANAR.items() if name not in LOOPS} | {"bevel": bevel()}


# ---------------------------------------------------------------- roads

@pytest.mark.parametrize("scene", [*PLANAR.values(), *SPATIAL.values()], ids=[*PLANAR, *(f"{name} in space" for name in SPATIAL)])
def test_every_road(scene: dict[str, Any]) -> None:
    mechanism = check_roads(scene)
    assert "driving forces only" in mechanism.explain().partition("Record of inverse dynamics")[2]


@pytest.mark.parametrize("scene", SPATIAL.values(), ids=SPATIAL)
def test_by_newton_and_euler(scene: dict[str, Any]) -> None:
    """What reactions and tooth forces give every link is what its motion needs."""
    check_balance(scene, 0.31)
    check_balance(scene, 1.37)


@pytest.mark.parametrize("name", PLANAR)
def test_generated_code(name: str, tmp_path: Path) -> None:
    scene = linkdyn.Scene(PLANAR[name])
    code = Compiled(scene.generate(want="all", name="geared"), tmp_path)
    run = scene.inverse()
    q, qd, qdd = scene.motion()
    loads = scene.load_values(scene.times()).reshape(len(q), -1, 6)[..., [0, 1, 5]]
    for i in (0, 77, 150):
        status, found = code(q=q[i], qd=qd[i], qdd=qdd[i], **({"load": loads[i]} if scene.loads else {}))
        assert status == 0
        np.testing.assert_allclose(found["reaction"], run.reaction.values[i], atol=1e-12 * np.abs(run.reaction.values).max())


@pytest.mark.parametrize("name", PLANAR)
def test_wheels_turn_with_their_teeth(name: str) -> None:
    """Speeds at the pitch point by poses alone: no sliding."""
    scene = linkdyn.Scene(PLANAR[name])
    run = scene.inverse(want="all")
    rates = {variable.split(".")[0]: run.joint_rate.sel(variable=variable).values for variable in run.variable.values}
    variables = {variable.split(".")[0]: run.joint_variable.sel(variable=variable).values for variable in run.variable.values}
    sums = {"pair": (("A", 20), ("B", 40)), "internal": (("A", 20), ("B", -40)), "planetary": (("S", 24), ("C", -24), ("P", 18)),
            "differential": (("S", 24), ("C", -24), ("P", 18)), "rack": (("A", 0.08), ("R", -1)), "belt": (("A", 0.06), ("B", -0.15)), "crossed belt": (("A", 0.06), ("B", 0.15)),
            "five-bar": (("A", 1), ("E", 1)), "rack on a slider": (("R", 1), ("F", 0.06 * 1.5)), "sector": (("D", 73), ("P", 20)), "slider-crank": (("M", 17 * 19), ("A", -45 * 53))}[name]
    speed = sum(weight * rates[joint] for joint, weight in sums)
    place = sum(weight * variables[joint] for joint, weight in sums)
    scale = max(np.abs(weight * rates[joint]).max() for joint, weight in sums)
    assert np.abs(speed).max() < 1e-13 * scale
    assert np.ptp(place) < 1e-12 * max(np.abs(weight * variables[joint]).max() for joint, weight in sums)


FREE = {"pair": pair(), "planetary": planetary(), "differential": planetary(ring_moves=True), "rack": rack_and_pinion(), "belt": belt("crossed"), "five-bar": five_bar(),
        "slider-crank": driven_slider_crank(), "rack on a slider": oscillating_pinion(), "sector": sector(), "bevel": bevel(), "planetary in space": tilted(planetary())}


@pytest.mark.parametrize("scene", FREE.values(), ids=FREE)
def test_forward(scene: dict[str, Any]) -> None:
    """The forces found lead along the motion; without them energy stays."""
    free = copy.deepcopy(scene)
    free.pop("load", None)
    run = linkdyn.Scene(free).forward(t=np.linspace(0, 1, 21), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(run.q.values, linkdyn.Scene(free).motion(run.time.values)[0], atol=1e-7)
    keeps_energy(let_go(free))


# ---------------------------------------------------------------- by hand

def test_planetary_by_willis() -> None:
    """Steady and without gravity only the load counts. Ratio 1 + 60/24, torques of sun, ring and carrier as 24 : 60 : -84."""
    scene = planetary(gravity=[0, 0])
    scene["coordinate"][0]["motion"] = {"law": "constant-rate", "rate": 3.5}
    scene["link"][1]["cog"] = [0.0, 0.0]
    scene["link"][2]["mass"] = 0.0
    scene["link"][2]["inertia"] = 0.0
    scene["load"] = [{"on": "carrier.P", "moment": -84.0}]
    run = linkdyn.Scene(scene).inverse(want="all")
    np.testing.assert_allclose(run.joint_rate.sel(variable="C.angle"), 1.0, rtol=1e-13)
    np.testing.assert_allclose(run.driving_force.values, 24.0, rtol=1e-12)
    tooth = 24.0 / (0.3 * 24 / 42)
    for name in ("SP", "PR"):
        force = np.linalg.norm(run.reaction.sel(joint=name).values[:, :2], axis=1)
        np.testing.assert_allclose(force, tooth, rtol=1e-12)
    # the housing is turned with the load's direction
    np.testing.assert_allclose(run.reaction.sel(joint="PR").values[:, 2], -60.0, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(run.reaction.sel(joint="P").values[:, :2], axis=1), 2 * tooth, rtol=1e-12)


def test_gear_reactions_by_hand() -> None:
    """A torque on the wheel at rest: the tooth's force is that by the pitch radius, across the line of centres; hinges bear it."""
    scene = pair(mesh="external")
    scene |= {"gravity": [0, 0], "load": [{"on": "wheel.B", "moment": 8.0}]}
    scene["coordinate"][0]["motion"] = 0.4
    run = linkdyn.Scene(scene).inverse()
    np.testing.assert_allclose(run.driving_force.values, 4.0, rtol=1e-13)
    along_centres = np.array([0.18, 0.24]) / 0.3
    tangent = np.array([-along_centres[1], along_centres[0]])
    np.testing.assert_allclose(run.reaction.sel(joint="G").values[0], [*(40.0 * tangent), -8.0], rtol=1e-12)
    np.testing.assert_allclose(run.reaction.sel(joint="B").values[0, :2], -40.0 * tangent, rtol=1e-12)
    np.testing.assert_allclose(run.reaction.sel(joint="A").values[0, :2], 40.0 * tangent, rtol=1e-12)


def test_rack_by_hand() -> None:
    scene = rack_and_pinion()
    run = linkdyn.Scene(scene).inverse(want="all")
    q, _, qdd = linkdyn.Scene(scene).motion()
    acceleration = 0.08 * qdd[:, 0]      # the rack is below: turning left moves it right
    np.testing.assert_allclose(run.joint_variable.sel(variable="R.slide"), 0.05 + 0.08 * q[:, 0], atol=1e-14)
    np.testing.assert_allclose(run.reaction.sel(joint="G").values[:, 0], 3.0 * acceleration, atol=1e-12)
    weight = 2.0 * 9.81 * 0.03 * np.cos(q[:, 0])
    np.testing.assert_allclose(run.driving_force.values[:, 0], (0.02 + 2.0 * 0.03**2) * qdd[:, 0] + weight + 3.0 * 0.08 * acceleration, atol=1e-12)


@pytest.mark.parametrize("run, ratio", [("open", 0.4), ("crossed", -0.4)])
def test_belt_by_its_two_runs(run: str, ratio: float) -> None:
    """Hinges feel the two straight runs, pulled by half the difference more and less."""
    scene = belt(run)
    scene |= {"gravity": [0, 0], "load": [{"on": "large.B", "moment": 6.0}]}
    for coordinate in scene["coordinate"]:
        coordinate["motion"] = 0.0
    found = linkdyn.Scene(scene).inverse()
    np.testing.assert_allclose(found.driving_force.sel(actuator="A").values, -6.0 * ratio, rtol=1e-12)
    difference = 6.0 / 0.15
    distance = np.hypot(0.4, 0.1)
    sine = (0.15 - 0.06 if run == "open" else 0.15 + 0.06) / distance
    force = np.linalg.norm(found.reaction.sel(joint="T").values[0, :2])
    np.testing.assert_allclose(force, difference * sine, rtol=1e-12)
    np.testing.assert_allclose(found.reaction.sel(joint="T").values[0, 2], -6.0, rtol=1e-12)


def test_equal_pulleys() -> None:
    """The runs are parallel: a couple alone."""
    scene = check_roads(belt(radii=(0.1, 0.1)))
    assert np.abs(scene.inverse().reaction.sel(joint="T").values[:, :2]).max() == 0.0
    check_roads(tilted(belt(radii=(0.1, 0.1))))


def test_bevel_differential_by_hand() -> None:
    """Without masses the cage's torque is shared equally, whatever the speeds; the mean of both speeds is the cage's."""
    scene = bevel()
    for link in scene["link"]:
        link.update(mass=0.0, inertia=[0.0] * 6, cog=[0.0] * 3)
    scene["load"] = [{"on": "left.L", "axes": "link", "moment": [0, 0, 4.0]}, {"on": "right.R", "axes": "link", "moment": [0, 0, 4.0]}]
    found = linkdyn.Scene(scene).inverse(want="all")
    rates = {name: found.joint_rate.sel(variable=f"{name}.angle").values for name in "LRCI"}
    np.testing.assert_allclose(rates["L"] - rates["R"], 2 * rates["C"], atol=1e-12)     # the right hinge's axis points to the left
    np.testing.assert_allclose(rates["C"], -15 / 40 * rates["I"], rtol=1e-12)
    np.testing.assert_allclose(found.driving_force.sel(actuator="L").values, 0.0, atol=1e-12)
    np.testing.assert_allclose(found.driving_force.sel(actuator="I").values, 8.0 * 15 / 40, rtol=1e-12)


def test_five_bar_without_gear_needs_two_drives() -> None:
    """Both cranks driven: the power of both is that of the one drive with gears, and all reactions but the gear's and its hinges' are the same."""
    scene = five_bar()
    apart = copy.deepcopy(scene)
    apart["joint"].pop()
    apart["coordinate"].append(along("E", {"law": "constant-rate", "rate": "-5 rad/s", "start": "60 deg"}))
    apart["actuator"].append({"joint": "E"})
    one, two = linkdyn.Scene(scene).inverse(), linkdyn.Scene(apart).inverse()
    np.testing.assert_allclose(one.driving_force.values[:, 0], two.driving_force.values[:, 0] - two.driving_force.values[:, 1], rtol=1e-10)
    for joint in "BCD":
        np.testing.assert_allclose(one.reaction.sel(joint=joint).values, two.reaction.sel(joint=joint).values, rtol=1e-9, atol=1e-9)
    # the tooth at the middle between both shafts gives crank 2 the torque that its own drive gave it
    np.testing.assert_allclose(one.reaction.sel(joint="G").values[:, 2], two.driving_force.values[:, 1], rtol=1e-9, atol=1e-9)


def test_many_turns() -> None:
    """A ratio that is no whole number: after a turn of the pinion the wheel is elsewhere, in whatever order samples come."""
    scene = pair(mesh="external")
    scene["joint"][2]["teeth"] = [17, 45]
    scene["coordinate"][0]["motion"] = {"law": "constant-rate", "rate": 2 * np.pi}
    scene["time"] = {"end": 60, "samples": 61}
    one = linkdyn.Scene(scene)
    run = one.inverse(want="all")
    np.testing.assert_allclose(run.joint_variable.sel(variable="B.angle"), -17 / 45 * 2 * np.pi * np.arange(61), atol=1e-12)
    assert np.ptp(run.driving_force.values) > 1.0
    q, qd, qdd = one.motion()
    shuffled = np.random.default_rng(4).permutation(len(q))
    again = one.inverse(q=q[shuffled], qd=qd[shuffled], qdd=qdd[shuffled])
    np.testing.assert_allclose(again.driving_force.values, run.driving_force.values[shuffled], rtol=1e-12)


def geared_loop(skew: float) -> dict[str, Any]:
    """A crank that gears turn leads a spatial loop; its rocker swings a wheel by a toothed sector. With its universal joint skew to the rod
    the loop is closed by iteration."""
    scene = tilted(pair())
    markers = scene["link"][2]["markers"]
    assert scene["link"][2]["name"] == "wheel"
    markers["C"] = {"at": [0.1, 0.0, 0.05]}
    scene["link"][0]["markers"]["D"] = {"at": [0.9, 0.5, 0.1], "axis": [0.1, 1.0, 0.3]}
    scene["link"] += [{"name": "rod", "markers": {"C": [0, 0, 0], "D": [0.5, 0, 0]}, "mass": 1.0, "cog": [0.25, 0, 0], "inertia": [0.001, 0.02, 0.02, 0, 0, 0]},
                      {"name": "rocker", "markers": {"D": [0, 0, 0.3], "E": {"at": [0, 0, 0], "axis": [0.1, 1.0, 0.3]}}, "mass": 1.0, "cog": [0, 0, 0.1], "inertia": [0.01, 0.01, 0.002, 0, 0, 0]}]
    scene["joint"] += [{"name": "C", "type": "spherical", "between": ["wheel.C", "rod.C"]}, {"name": "D", "type": "universal", "between": ["rocker.D", "rod.D"]},
                       hinge("E", "base.D", "rocker.E")]
    scene["link"][-1]["markers"]["D"] = {"at": [0, 0, 0.3], "axis": [0, 1, 0]}
    scene["link"][-2]["markers"]["D"] = {"at": [0.5, 0, 0], "axis": [skew, 0, 1]}
    scene["link"][0]["markers"]["W"] = {"at": [1.05, 0.5, 0.05], "axis": [0.1, 1.0, 0.3]}
    scene["link"].append({"name": "wheel2", "markers": {"W": {"at": [0, 0, 0], "axis": [0.1, 1.0, 0.3]}}, "mass": 0.5, "cog": [0.02, 0, 0.01], "inertia": [0.001, 0.001, 0.0015, 0, 0, 0]})
    scene["joint"] += [hinge("W", "base.W", "wheel2.W"), gear("H", "rocker.E", "wheel2.W", [31, 12])]
    return scene


@pytest.mark.parametrize("skew, road", [(0.1, "Newton"), (0.0, "between base and wheel: closed form")])
def test_loops_and_gears(skew: float, road: str) -> None:
    scene = geared_loop(skew)
    mechanism = check_roads(scene)
    assert road in mechanism.explain() and "wheel2 by revolute joint W from coordinate E by gears" in mechanism.explain()
    check_balance(scene, 0.4, 1e-6)
    free = copy.deepcopy(scene)
    run = mechanism.forward(t=np.linspace(0, 0.5, 6), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(run.q.values, mechanism.motion(run.time.values)[0], atol=1e-7)
    keeps_energy(let_go(free), 0.5)


def test_order_of_wheels() -> None:
    """A gear, rack or belt told the other way round is the same; its reaction is what the other wheel gets."""
    for scene, names in ((planetary(ring_moves=True), ("SP", "PR")), (belt("crossed"), ("T",)), (belt(), ("T",)), (pair(mesh="internal"), ("G",)), (tilted(planetary()), ("SP", "PR"))):
        turned = copy.deepcopy(scene)
        for joint in turned["joint"]:
            if joint["name"] in names:
                joint["between"].reverse()
                for key in ("teeth", "radii"):
                    if key in joint:
                        joint[key].reverse()
        one, other = linkdyn.Scene(scene).inverse(), linkdyn.Scene(turned).inverse()
        np.testing.assert_allclose(other.driving_force.values, one.driving_force.values, atol=1e-11 * np.abs(one.reaction.values).max())
        n = 2 if scene["space"] == "planar" else 3
        for joint in one.joint.values:
            sign = -1.0 if joint in names else 1.0
            np.testing.assert_allclose(other.reaction.sel(joint=joint).values[:, :n], sign * one.reaction.sel(joint=joint).values[:, :n], atol=1e-11 * np.abs(one.reaction.values).max())


def shaft_in_bearings(kind: str, bearings: Sequence[str], led: str) -> dict[str, Any]:
    """Bearings of a shaft that drives another, or rails of a rack that drives a pinion; whichever is told first, and whichever is led."""
    axis = {"axis": [0, 0, 1], "x": [1, 0, 0]} if kind == "revolute" else {"axis": [1, 0, 0], "x": [0, 0, 1]}
    seats = {name: {"at": at, **axis} for name, at in (("H1", [0, 0, 0]), ("H2", [0, 0, 0.4] if kind == "revolute" else [0, 0.4, 0.1]))}
    mesh = {"name": "mesh", "type": "gear", "between": ["shaft.wheel", "out.K"], "teeth": [20, 40]} if kind == "revolute" else \
           {"name": "mesh", "type": "rack", "between": ["out.K", "shaft.wheel"]}
    body = {"inertia": {"diagonal": [0.05, 0.05, 0.02]}}
    return {"space": "spatial", "gravity": GRAVITY.tolist(), "time": {"end": 1, "samples": 21},
            "frame": {"markers": {**seats, "K": {"at": [0.3, 0.3, 0.2], "axis": [0, 0, 1]}}},
            "link": [{"name": "shaft", "mass": 2.0, "cog": [0.01, 0, 0.2], "markers": {**seats, "wheel": {"at": [0, 0, 0.2], **axis}}, **body},
                     {"name": "out", "mass": 3.0, "cog": [0, 0.02, 0], "markers": {"K": {"at": [0, 0, 0], "axis": [0, 0, 1]}}, **body}],
            "joint": [*({"name": name, "type": kind, "between": [f"frame.{name}", f"shaft.{name}"]} for name in bearings), hinge("K", "frame.K", "out.K"), mesh],
            "coordinate": [along(led, {"law": "harmonic", "amplitude": 0.3, "frequency": "1 Hz"})], "actuator": [{"joint": led}]}


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_bearings_of_a_geared_shaft_in_any_order(kind: str) -> None:
    """Work and motion are those of the shaft in one bearing alone, whichever of two is a coordinate, and whichever is told first."""
    alone = linkdyn.Scene(shaft_in_bearings(kind, ["H1"], "H1")).inverse()
    for bearings in (["H1", "H2"], ["H2", "H1"]):
        for led in bearings:
            run = linkdyn.Scene(shaft_in_bearings(kind, bearings, led)).inverse()
            assert not run.status.any()
            np.testing.assert_allclose(run.driving_force.values, alone.driving_force.values, atol=1e-11 * np.abs(alone.driving_force.values).max())
            np.testing.assert_allclose(run.joint_variable.sel(variable="K.angle"), alone.joint_variable.sel(variable="K.angle"), atol=1e-13)
            assert np.abs(run.power_imbalance.values).max() < 1e-10


def test_axes_that_point_the_other_way() -> None:
    """A wheel whose hinge and marker have the opposite axis turns as before; its variable has the other sign."""
    scene = tilted(pair())
    turned = copy.deepcopy(scene)
    for link in turned["link"]:
        if "B" in link["markers"]:
            link["markers"]["B"] |= {"axis": [0, 0, -1], "x": [1, 0, 0]}
    one, other = linkdyn.Scene(scene).inverse(want="all"), linkdyn.Scene(turned).inverse(want="all")
    np.testing.assert_allclose(other.joint_variable.sel(variable="B.angle"), -one.joint_variable.sel(variable="B.angle"), atol=1e-13)
    np.testing.assert_allclose(other.reaction.values, one.reaction.values, atol=1e-11 * np.abs(one.reaction.values).max())


def test_led_inside_a_loop() -> None:
    """A five-bar led at the hinge between crank and rod, by which a gear leads the next hinge: one group closed by iteration."""
    start = linkdyn.Scene(five_bar()).inverse(q=[[0.35]], qd=[[0.0]], qdd=[[0.0]], want="all").joint_variable
    near = {name: float(start.sel(variable=f"{name}.angle")[0]) for name in "ABCDE"}
    scene = five_bar()
    scene["joint"][5] = gear("G", "crank1.B", "rod2.C", [20, 50], phase=near["C"] - 0.4 * near["B"])
    for joint in scene["joint"][:5]:
        joint.pop("branch", None)
        joint["start"] = near[joint["name"]]
    scene["coordinate"] = [along("B", {"law": "harmonic", "mean": near["B"], "amplitude": 0.12, "frequency": "3 rad/s"})]
    scene["actuator"] = [{"joint": "B"}]
    mechanism = check_roads(scene, tolerance=1e-9)
    assert "Newton" in mechanism.explain()
    run = mechanism.inverse(want="all")
    assert np.ptp(run.joint_variable.sel(variable="C.angle").values - 0.4 * run.joint_variable.sel(variable="B.angle").values) < 1e-13
    del scene["load"]
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 0.5, 6), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(run.q.values, mechanism.motion(run.time.values)[0], atol=1e-8)


def test_angles_whose_turns_matter() -> None:
    """A crank that a loop turns all the way round: with a ratio of one the wheel follows, with another its turn cannot be told at half a turn."""
    scene = sector()
    scene["link"][0]["markers"]["B"] = [0.3, 0]      # drag link: both turn
    scene["link"][1]["markers"]["C"] = [0.35, 0]
    scene["link"][2]["markers"]["C"] = [0.32, 0]
    scene["frame"]["markers"]["D"] = [0.1, 0]
    scene["frame"]["markers"]["P"] = [0.1, 0.2]
    del scene["joint"][3]["start"]
    scene["coordinate"][0]["motion"] = {"law": "constant-rate", "rate": 2 * np.pi}
    scene["time"] = {"end": 1.0, "samples": 201}
    whole = copy.deepcopy(scene)
    whole["joint"][6]["teeth"] = [20, 20]
    whole["joint"][7]["teeth"] = [34, 17]
    run = linkdyn.Scene(whole).inverse(want="all")
    assert (run.status == 0).all()
    assert np.ptp(run.joint_variable.sel(variable="D.angle").values) > 6.0
    turned = linkdyn.Scene(scene).inverse(want="all")
    angle = np.angle(np.exp(1j * run.joint_variable.sel(variable="D.angle").values))
    lost = np.abs(angle) > 2.88
    assert 5 < lost.sum() < 40
    np.testing.assert_array_equal(turned.status.values, np.where(lost, 5, 0))
    q, qd, qdd = linkdyn.Scene(scene).motion()
    batch = linkdyn.Scene(scene).inverse(q=q[:200], qd=qd[:200], qdd=qdd[:200])
    np.testing.assert_array_equal(batch.status.values, turned.status.values[:200])
    dense = linkdyn.Scene(scene).inverse(q=q[:200], qd=qd[:200], qdd=qdd[:200], solver="lapack")
    np.testing.assert_array_equal(dense.status.values, turned.status.values[:200])


def test_teeth_are_a_parameter() -> None:
    scene = linkdyn.Scene(pair(mesh="external"))
    for teeth in (30, 55):
        run = scene.with_({"joint.G.teeth[1]": teeth}).inverse(want="all")
        np.testing.assert_allclose(run.joint_rate.sel(variable="B.angle"), -20 / teeth * run.joint_rate.sel(variable="A.angle"), rtol=1e-12)
    assert abs(float(scene.with_({"joint.G.phase": 0.7}).inverse(want="all").joint_variable.sel(variable="B.angle")[0]) - (0.7 - 0.15)) < 1e-14


def test_words() -> None:
    text = linkdyn.Scene(planetary(ring_moves=True)).explain(matrix=True)
    assert "carrier by revolute joint C from coordinate S and R by gears" in text and "SP Ft" in text


def test_estimates_and_other_numbers() -> None:
    for scene in (*PLANAR.values(), *SPATIAL.values()):
        run = linkdyn.Scene(scene).inverse(want="all,rcond,singularity_distance", error=True)
        assert (run.rcond > 1e-6).all()
        assert (run.driving_force_error < 1e-10 * np.abs(run.driving_force).max()).all()
