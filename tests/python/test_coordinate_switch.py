"""Forward runs through the dead points of their own coordinates: the same motion as with coordinates that have none."""

from __future__ import annotations

import copy
import csv
import json
import subprocess
import tomllib
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import linkdyn
from linkdyn._geometry.postures import poses_of
from linkdyn.cli import executable, quadruple_twin
from integrators import METHODS

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
TIGHT = {"rtol": 1e-13, "atol": 1e-13}


def description(path: str) -> dict:
    return tomllib.loads((EXAMPLES / path).read_text())


def with_coordinates(given: dict, joints: tuple[str, ...], turns: float = 0.0) -> dict:
    """The scene with other joint variables ("J4", "C.slide") for coordinates, starting as it does: the links' start says on
    which assembly."""
    scene = linkdyn.Scene(given)
    q = np.array([[float(c["start"]["position"]) for c in given["coordinate"]]])
    qd = np.array([[float(c["start"].get("velocity", 0.0)) for c in given["coordinate"]]])
    poses = scene.poses(q)
    free = copy.deepcopy(given)
    for link, position, turn in zip(free["link"], poses.position[0], poses.rotation[0]):
        if given["space"] == "planar":
            start = {"position": position[:2].tolist(), "angle": float(np.arctan2(turn[1, 0], turn[0, 0]))}
        else:
            roll, yaw = np.arctan2(-turn[1, 2], turn[2, 2]), np.arctan2(-turn[0, 1], turn[0, 0])
            start = {"position": position.tolist(), "angles": [float(roll), float(np.arcsin(turn[0, 2])), float(yaw)]}
        link["start"] = start
    for joint in free["joint"]:
        joint.pop("branch", None)
    # As many actuators as coordinates, or there is no inverse dynamics.
    measured = given | {"actuator": [{"joint": c["joint"]} for c in given["coordinate"]]}
    start = linkdyn.Scene(measured).inverse(q=q, qd=qd, qdd=0 * q)
    kind = {joint["name"]: joint["type"] for joint in given["joint"]}
    free["coordinate"] = []
    for name in joints:
        joint, _, variable = name.partition(".")
        variable = variable or ("slide" if kind[joint] == "prismatic" else "angle")
        here = {"variable": f"{joint}.{variable}"}
        position = float(start.joint_variable.sel(here)[0]) + 2 * np.pi * turns
        coordinate = {"joint": joint, "start": {"position": position, "velocity": float(start.joint_rate.sel(here)[0])}}
        free["coordinate"].append(coordinate | ({"variable": variable} if kind[joint] == "cylindrical" else {}))
    return free


def slider_crank(torque: float = 0.0) -> dict:
    """The example, its crank free, at 40 rad/s: it turns fully at 0.1 to 0.2 s a turn."""
    given = description("slider_crank/scene.toml")
    given["coordinate"] = [{"joint": "A", "start": {"position": 1.7, "velocity": 40.0}}]
    given["actuator"] = [{"joint": "A", "law": {"type": "constant", "value": torque}}]
    given["load"] = [{"on": "piston.face", "force": [{"law": "harmonic", "mean": -4.0, "amplitude": 40.0, "frequency": 10.0}, 0.0]}]
    return given


def triple_rocker() -> dict:
    """No joint turns fully: every joint variable has dead points."""
    given = description("fourbar_constant_torque/scene.toml")
    given["frame"]["markers"]["J1"] = [18.0, 0.0]
    given["coordinate"] = [{"joint": "J1", "start": {"position": 2.2, "velocity": 1.5}}]
    given["actuator"] = [{"joint": "J1", "law": {"type": "constant", "value": 0.0}}]
    given["spring"] = []
    return given


def five_bar() -> dict:
    """Two freedoms; the rods in the middle come to be stretched now and then."""
    bar = {"mass": 1.0, "inertia": 0.1}
    return {
        "space": "planar",
        "gravity": [0.0, -2.0],
        "frame": {"markers": {"A": [0.0, 0.0], "E": [1.5, 0.0]}},
        "link": [
            {"name": "left", "markers": {"A": [0.0, 0.0], "B": [0.5, 0.0]}, "cog": [0.25, 0.0], **bar},
            {"name": "rod", "markers": {"B": [0.0, 0.0], "C": [1.0, 0.0]}, "cog": [0.5, 0.05], **bar},
            {"name": "bar", "markers": {"D": [0.0, 0.0], "C": [0.9, 0.0]}, "cog": [0.45, 0.0], **bar},
            {"name": "right", "markers": {"E": [0.0, 0.0], "D": [0.6, 0.0]}, "cog": [0.3, 0.0], **bar},
        ],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "left.A"]},
            {"name": "B", "type": "revolute", "between": ["left.B", "rod.B"]},
            {"name": "C", "type": "revolute", "between": ["rod.C", "bar.C"], "branch": 1},
            {"name": "D", "type": "revolute", "between": ["bar.D", "right.D"]},
            {"name": "E", "type": "revolute", "between": ["frame.E", "right.E"]},
        ],
        "coordinate": [
            {"joint": "A", "start": {"position": 1.0, "velocity": 4.0}},
            {"joint": "E", "start": {"position": 0.8, "velocity": -1.0}},
        ],
        "actuator": [{"joint": "E", "law": {"type": "spring-damper", "stiffness": 15.0, "damping": 0.2, "rest": 0.8}}],
        "time": {"end": 4.0},
    }


def gap(ours: xr.DataArray, theirs: xr.DataArray) -> float:
    """Largest difference, relative to the largest value."""
    return float(abs(ours - theirs).max() / abs(theirs).max())


def angles_apart(run: xr.Dataset, other: xr.Dataset) -> float:
    """Largest difference of joint variables, angles but for turns."""
    apart = (run.joint_variable - other.joint_variable).values
    is_angle = (run["variable_unit"] == "rad").values
    apart[:, is_angle] -= 2 * np.pi * np.round(apart[:, is_angle] / (2 * np.pi))
    return float(np.abs(apart).max())


def assert_alike(run: xr.Dataset, other: xr.Dataset, part: float) -> None:
    """Everything that does not depend on the coordinates."""
    assert run.attrs["stopped"] == other.attrs["stopped"] == ""
    assert angles_apart(run, other) < part
    for name in ("joint_rate", "reaction", "kinetic_energy", "potential_energy"):
        assert gap(run[name], other[name]) < part, name
    if "driving_force" in other and abs(other.driving_force).max() > 0:
        for name in ("driving_force", "driving_speed", "driving_power", "work"):
            assert gap(run[name], other[name]) < part, name
    # Sums of a dozen terms of which the largest is 1, in the place of the coordinates that were exchanged too.
    assert abs(run.power_imbalance).max() < 1e-12
    assert run.closure.max() < 1e-14 * 20


METHODS = {
    # Tolerances, of gbs and seulex far enough apart for its orders not to count, or steps, and by what the error must fall at least:
    # a little less than in proportion, and than with order 4; errors of these scatter by four at either end.
    "rk8pd": ({"rtol": 1e-9, "atol": 1e-9}, {"rtol": 1e-11, "atol": 1e-11}, 30.0),
    "rkf45": ({"rtol": 1e-8, "atol": 1e-8}, {"rtol": 1e-10, "atol": 1e-10}, 30.0),
    "gbs": ({"rtol": 1e-8, "atol": 1e-8}, {"rtol": 1e-11, "atol": 1e-11}, 60.0),
    "seulex": ({"rtol": 1e-8, "atol": 1e-8}, {"rtol": 1e-11, "atol": 1e-11}, 60.0),
    "msbdf": ({"rtol": 1e-6, "atol": 1e-6}, {"rtol": 1e-8, "atol": 1e-8}, 10.0),
    "rk4": ({"step": 4e-4}, {"step": 1e-4}, 4.0**3.8),
}


@pytest.mark.thorough
@pytest.mark.parametrize("method", METHODS)
def test_slider_crank_by_its_piston(method: str) -> None:
    """Many turns with the piston's slide for coordinate are those of the free crank, and as exact."""
    given = slider_crank(torque=1.0)
    t = np.linspace(0.0, 1.0, 101)
    crank, piston = linkdyn.Scene(given), linkdyn.Scene(with_coordinates(given, ("D",)))
    exact = crank.forward(t=t, **TIGHT)
    assert exact.q.values[-1, 0] - exact.q.values[0, 0] > 2 * np.pi * 6
    coarse, fine, least = METHODS[method]
    errors = []
    for settings in (coarse, fine):
        run = piston.forward(t=t, method=method, **settings)
        # Errors of gbs scatter by ten: the usual one is the largest at five tolerances, or steps, nearby.
        usual = max(
            gap(crank.forward(t=t, method=method, **{name: part * value for name, value in settings.items()}).joint_rate, exact.joint_rate)
            for part in (1.0, 0.9, 0.8, 0.7, 0.6)
        )
        assert run.attrs["coordinates_integrated"].startswith("slide of D until ")
        assert run.attrs["coordinates_integrated"].endswith(" s, then angle of A")
        # Tolerances are relative to other numbers for a tenth of a turn.
        allowed = 5 * usual + 1e-11
        errors.append(gap(run.joint_rate, exact.joint_rate))
        assert errors[-1] < allowed
        assert_alike(run, exact, 100 * allowed)
    assert errors[0] > least * errors[1]


def test_coordinates_stay_the_users() -> None:
    """q, qd, qdd are the piston's; `stand_in` names what was integrated."""
    given = slider_crank(torque=1.0)
    t = np.linspace(0.0, 0.5, 501)
    run = linkdyn.Scene(with_coordinates(given, ("D",))).forward(t=t, **TIGHT)
    crank = linkdyn.Scene(given).forward(t=t, **TIGHT)
    assert run.coordinate.values.tolist() == ["D"]
    np.testing.assert_allclose(run.q.values[:, 0], crank.joint_variable.sel(variable="D.slide"), rtol=0, atol=1e-11)
    np.testing.assert_allclose(run.qd.values[:, 0], crank.joint_rate.sel(variable="D.slide"), rtol=0, atol=1e-8)    # gbs, where GSL lacks, scatters by ten
    # The piston's acceleration by the crank's: x'' from x(q), differentiated by hand.
    q, qd, qdd = (crank[name].values[:, 0] for name in ("q", "qd", "qdd"))
    s, c, h, l = 0.08 * np.sin(q) - 0.02, 0.08 * np.cos(q), 0.3, 0.3
    root = np.sqrt(h**2 - s**2)
    first = -0.08 * np.sin(q) - s * c / root
    second = -c - (c**2 - s * 0.08 * np.sin(q)) / root - s**2 * c**2 / root**3
    np.testing.assert_allclose(run.qdd.values[:, 0], first * qdd + second * qd**2, rtol=0, atol=1e-8 * abs(run.qdd).max().item())
    meanings = run.stand_in.attrs["flag_meanings"].split()
    assert {meanings[i] for i in run.stand_in.values.ravel()} == {"none", "A.angle"}
    assert np.all(np.diff(run.stand_in.values[:, 0]) >= 0)
    # The dyad of the piston's scene is crank and rod, whatever is integrated: the angle between them.
    angle = run.joint_variable.sel(variable="B.angle").values
    np.testing.assert_allclose(np.sin(run.transmission_angle.values[:, 0]), abs(np.sin(angle)), rtol=0, atol=1e-12)


@pytest.mark.thorough
@pytest.mark.parametrize("method", ["rk8pd", "gbs", "rkf45"])
def test_energy_through_dozens_of_exchanges(method: str) -> None:
    """Every coordinate comes to its dead points; what energy is lost is the integrator's."""
    scene = linkdyn.Scene(triple_rocker())
    t = np.linspace(0.0, 60.0, 301)
    drift = []
    for tolerance in (1e-8, 1e-10):
        run = scene.forward(t=t, method=method, rtol=tolerance, atol=tolerance)
        assert run.attrs["stopped"] == ""
        assert int(run.attrs["coordinates_integrated"].split("(")[1].split()[0]) > 24
        assert abs(run.power_imbalance).max() < 1e-12
        energy = run.kinetic_energy + run.potential_energy
        drift.append(float(abs(energy - energy[0]).max() / run.kinetic_energy.max()))
    assert drift[0] < 1e4 * 1e-8
    assert drift[1] < 0.1 * drift[0]


def test_against_reference() -> None:
    """The 50-digit solution of the four-bar, with the follower for coordinate, whose dead points the crank turns through."""
    reference = json.loads((ROOT / "tests" / "reference" / "forward.json").read_text())["fourbar_constant_torque"]
    states = reference["states"]
    scene = linkdyn.Scene(with_coordinates(description(reference["scene"]), ("J4",)))
    run = scene.forward(t=[0.0, *(float(state["t"]) for state in states)], rtol=1e-14, atol=1e-14)
    assert run.attrs["coordinates_integrated"].endswith("then angle of J1")
    for i, state in enumerate(states, start=1):
        turns = (run.joint_variable.sel(variable="J1.angle").values[i] - float(state["q"][0])) / (2 * np.pi)
        # As where the crank is the coordinate, times ten for the rate at which the exchange happens.
        assert abs(turns - round(turns)) * 2 * np.pi < 1e-10
        rate = float(state["qd"][0])
        assert abs(run.joint_rate.sel(variable="J1.angle").values[i] - rate) < 1e-10 * abs(rate)
        reactions = np.array([[float(x) for x in state["reaction"][joint]] for joint in run.joint.values])
        assert np.abs(run.reaction.values[i] - reactions).max() < 1e-9 * np.abs(reactions).max()


def spatial_four_bar() -> dict:
    """Crank, cylindrical joint, coupler, ball, slider: a group in closed form, but only as seen from the crank."""
    given = description("rcsp_start/scene.toml")
    given["coordinate"] = [{"joint": "R", "start": {"position": 0.5, "velocity": 10.0}}]
    given["actuator"] = [{"joint": "R", "law": {"type": "constant", "value": 0.3}}]
    return given


def rod_between_balls() -> dict:
    """RSSR, all links with mass; the rod spins idly about its line."""
    given = description("../tests/scenes/rssr.toml")
    for name, cog in (("crank", [0.1, 0.02, 0.0]), ("rocker", [0.3, 0.0, 0.03])):
        link = next(link for link in given["link"] if link["name"] == name)
        link |= {"mass": 1.5, "cog": cog, "inertia": {"diagonal": [0.01, 0.03, 0.03]}}
    given["gravity"] = [0.4, -0.7, -9.81]
    given["coordinate"] = [{"joint": "A", "start": {"position": 0.4, "velocity": 12.0}}]
    given["actuator"] = [{"joint": "A", "law": {"type": "constant", "value": 0.3}}]
    return given


SPATIAL = {
    "slider-crank by its slider": (description("spatial_slider_crank/scene.toml"), "D", "slide of D", "angle of A"),
    "four-bar by its slider": (spatial_four_bar(), "P", "slide of P", "angle of R"),
    "four-bar by the slide of a cylindrical joint": (spatial_four_bar(), "C.slide", "slide of C", "angle of R"),
}


@pytest.mark.parametrize("name", SPATIAL)
def test_in_space(name: str) -> None:
    """Loops in space by a coordinate that has dead points, against the crank."""
    given, joint, first, then = SPATIAL[name]
    t = np.linspace(0.0, 2.0, 81)
    crank = linkdyn.Scene(given).forward(t=t, **TIGHT)
    scene = linkdyn.Scene(with_coordinates(given, (joint,)))
    run = scene.forward(t=t, **TIGHT)
    assert run.attrs["coordinates_integrated"].startswith(first + " until ")
    assert run.attrs["coordinates_integrated"].endswith(then)
    assert_alike(run, crank, 1e-7)
    # The rate of the user's coordinate is the integral of its acceleration (Simpson's rule, step 5e-4 s).
    fine = scene.forward(t=np.linspace(0.0, 0.5, 1001), **TIGHT)
    assert np.any(fine.stand_in > 0)
    qdd, qd = fine.qdd.values[:, 0], fine.qd.values[:, 0]
    steps = (qdd[:-2:2] + 4 * qdd[1:-1:2] + qdd[2::2]) * (5e-4 / 3)
    np.testing.assert_allclose(qd[0] + np.cumsum(steps), qd[2::2], rtol=0, atol=1e-6 * np.abs(qd).max())


def test_a_rod_that_spins_idly() -> None:
    """Led by its rocker, against the crank: how the rod is turned about its line says nothing of whether another coordinate fits."""
    given = rod_between_balls()
    t = np.linspace(0.0, 1.0, 81)
    crank = linkdyn.Scene(given).forward(t=t, **TIGHT)
    run = linkdyn.Scene(with_coordinates(given, ("D",))).forward(t=t, **TIGHT)
    assert run.attrs["stopped"] == ""
    assert run.attrs["coordinates_integrated"].startswith("angle of D until ")
    for hinge in ("A.angle", "D.angle"):
        angles = [other.joint_variable.sel(variable=hinge).values for other in (run, crank)]
        assert np.abs(np.exp(1j * angles[0]) - np.exp(1j * angles[1])).max() < 1e-7
    for name in ("kinetic_energy", "driving_force", "reaction"):
        of_forces = {"component": ["Fx", "Fy", "Fz"]} if name == "reaction" else {}
        assert gap(run[name].sel(of_forces), crank[name].sel(of_forces)) < 1e-7, name


@pytest.mark.parametrize("method", ["rk8pd", "gbs"])
def test_only_the_bad_one_of_two_is_exchanged(method: str) -> None:
    """Where the rods of a five-bar are stretched its cranks depend on each other: one of them is kept, and the drive on it."""
    given = five_bar()
    t = np.linspace(0.0, 4.0, 201)
    run = linkdyn.Scene(given).forward(t=t, method=method, rtol=1e-12, atol=1e-12)
    assert np.any(run.stand_in.sel(coordinate="A") > 0)
    assert np.all(run.stand_in.sel(coordinate="E") == 0)
    other = linkdyn.Scene(with_coordinates(given, ("B", "C"))).forward(t=t, **TIGHT)
    # Errors of 1e-12 a step grow a thousandfold in chaotic motion of 4 s.
    assert_alike(run, other, 1e-8)


@pytest.mark.parametrize("joints", [("B", "C"), ("C", "D"), ("A", "C")])
def test_no_tolerance_stops_it(joints: tuple[str, ...]) -> None:
    """Energy is weighed by the record at one end of a step and by the lanes at the next, with turns left out in between."""
    scene = linkdyn.Scene(with_coordinates(five_bar(), joints))
    t = np.linspace(0.0, 4.0, 201)
    for tolerance in np.geomspace(1e-13, 1e-8, 26):
        assert scene.forward(t=t, rtol=tolerance, atol=tolerance).attrs["stopped"] == "", tolerance


def test_driven_coordinates_are_kept() -> None:
    """The left crank follows its law; it is the right one that is exchanged for the rods' joint."""
    given = five_bar()
    given["coordinate"][0] |= {"driven": True, "motion": {"law": "constant-rate", "start": 1.0, "rate": 4.0}}
    given["actuator"].append({"joint": "A"})
    t = np.linspace(0.0, 4.0, 201)
    run = linkdyn.Scene(given).forward(t=t, **TIGHT)
    assert np.all(run.stand_in.sel(coordinate="A") == 0)
    assert np.any(run.stand_in.sel(coordinate="E") > 0)
    np.testing.assert_allclose(run.q.sel(coordinate="A"), 1.0 + 4.0 * t, rtol=1e-14)
    free = copy.deepcopy(given)
    exchanged = with_coordinates(five_bar(), ("A", "C"))
    free |= {key: exchanged[key] for key in ("link", "joint")}
    free["coordinate"] = [given["coordinate"][0], exchanged["coordinate"][1]]
    other = linkdyn.Scene(free).forward(t=t, **TIGHT)
    assert_alike(run, other, 1e-8)
    energy = run.kinetic_energy + run.potential_energy - run.work
    assert abs(energy - energy[0]).max() < 1e-9 * run.kinetic_energy.max()


def test_turns_are_counted() -> None:
    """A spring at a coordinate that started three turns further on stays there while others stand in for the coordinate."""
    t = np.linspace(0.0, 12.0, 241)
    runs = []
    for turns in (0, 3):
        given = with_coordinates(triple_rocker(), ("J4",), turns)
        rest = given["coordinate"][0]["start"]["position"]
        given["actuator"] = [{"joint": "J4", "law": {"type": "spring-damper", "stiffness": 2e4, "damping": 10.0, "rest": rest}}]
        runs.append(linkdyn.Scene(given).forward(t=t, **TIGHT))
    assert np.any(runs[1].stand_in > 0)
    assert np.any(np.diff((runs[1].stand_in.values[:, 0] > 0).astype(int)) < 0)    # it comes back
    np.testing.assert_allclose(runs[1].q.values - 6 * np.pi, runs[0].q.values, rtol=0, atol=1e-7)
    assert gap(runs[1].driving_force, runs[0].driving_force) < 1e-7
    for run in runs:
        energy = run.kinetic_energy + run.potential_energy - run.work
        assert abs(energy - energy[0]).max() < 1e-9 * run.kinetic_energy.max()


def test_a_wound_spring_stays_wound() -> None:
    """A spring at the coordinate, one turn from its rest, pushes with that turn while another joint stands in."""
    given = with_coordinates(triple_rocker(), ("J4",))
    rest = given["coordinate"][0]["start"]["position"] - 2 * np.pi
    law = {"type": "spring-damper", "stiffness": 2e3, "damping": 10.0, "rest": rest}
    given["actuator"] = [{"joint": "J4", "law": law}]
    run = linkdyn.Scene(given).forward(t=np.linspace(0.0, 3.0, 121))
    assert np.any(run.stand_in > 0) and np.any(run.stand_in == 0)
    want = -(2e3 * (run.q.values - rest) + 10.0 * run.qd.values)
    np.testing.assert_allclose(run.driving_force.values, want, rtol=1e-10)


def test_a_stand_in_counts_no_turns() -> None:
    """A spring on a joint that is no coordinate is at the angle nearest to its rest, also while that joint stands in."""
    given = slider_crank()
    given["spring"] = [{"name": "spring", "joint": "A", "stiffness": 3.0, "rest": 0.5}]
    given |= {"actuator": [], "load": [], "time": {"end": 0.5}}
    t = np.linspace(0.0, 0.5, 101)
    # The spring jumps where the angle is half a turn off its rest, so that only loose tolerances get there.
    runs = [linkdyn.Scene(with_coordinates(given, (joint,))).forward(t=t, rtol=1e-8, atol=1e-8) for joint in ("D", "B")]
    assert runs[0].attrs["coordinates_integrated"].endswith("then angle of A")
    assert runs[1].attrs["coordinates_integrated"] == ""
    assert angles_apart(*runs) < 1e-4


def test_inverse_of_forward() -> None:
    """Inverse dynamics of the motion found gives the driving forces and reactions back, by coordinates without dead points."""
    given = with_coordinates(slider_crank(torque=1.0), ("D",))
    run = linkdyn.Scene(given).forward(t=np.linspace(0.0, 0.4, 41), **TIGHT)
    crank = slider_crank(torque=1.0)
    motion = linkdyn.Scene(crank).forward(t=run.time.values, **TIGHT)
    q = run.joint_variable.sel(variable="A.angle").values[:, None]
    qd = run.joint_rate.sel(variable="A.angle").values[:, None]
    crank["actuator"] = [{"joint": "A"}]
    inverse = linkdyn.Scene(crank).inverse(q=q, qd=qd, qdd=motion.qdd.values, t=run.time.values)
    assert gap(run.reaction, inverse.reaction) < 1e-8
    assert abs(inverse.driving_force - 1.0).max() < 1e-6


def test_round_trip_in_own_coordinates() -> None:
    """q, qd, qdd of the exchanged samples, put into the scene's own inverse dynamics: until the first dead point."""
    given = with_coordinates(slider_crank(torque=1.0), ("D",))
    t = np.linspace(0.0, 0.03, 301)
    run = linkdyn.Scene(given).forward(t=t, **TIGHT)
    slide = given | {"actuator": [{"joint": "A"}]}
    inverse = linkdyn.Scene(slide).inverse(q=run.q.values, qd=run.qd.values, qdd=run.qdd.values, t=t)
    exchanged = run.stand_in.values[:, 0] > 0
    turned = np.flatnonzero(run.qd.values[:, 0] * run.qd.values[0, 0] < 0)[0]
    # The piston is within 1e-3 of its own dead point in between, where its coordinate says little.
    compared = exchanged & (np.arange(len(t)) < turned) & (abs(np.sin(run.transmission_angle.values[:, 0])) > 0.03)
    assert compared.sum() > 3
    reaction = run.reaction.values[compared]
    assert np.abs(inverse.reaction.values[compared] - reaction).max() < 1e-5 * np.abs(reaction).max()


def test_change_points_are_no_dead_points() -> None:
    """A parallelogram through its change points, and one that is not quite: its crank stays the coordinate."""
    for longer in (0.0, 1e-4, 1e-2):
        bar = {"mass": 1.0, "cog": [0.5, 0.0], "inertia": 1 / 12}
        joints = [("J1", "frame.J1", "crank.J1"), ("J2", "crank.J2", "coupler.J2"), ("J3", "coupler.J3", "follower.J3"),
                  ("J4", "frame.J4", "follower.J4")]
        given = {
            "space": "planar",
            "gravity": [0.0, -9.81],
            "frame": {"markers": {"J1": [0.0, 0.0], "J4": [2.0, 0.0]}},
            "link": [
                {"name": "crank", "markers": {"J1": [0.0, 0.0], "J2": [1.0, 0.0]}, **bar},
                {"name": "coupler", "markers": {"J2": [0.0, 0.0], "J3": [2.0, 0.0]}, **bar, "start": {"angle": 0.0}},
                {"name": "follower", "markers": {"J4": [0.0, 0.0], "J3": [1.0 + longer, 0.0]}, **bar},
            ],
            "joint": [{"name": name, "type": "revolute", "between": [one, two]} for name, one, two in joints],
            "coordinate": [{"joint": "J1", "start": {"position": 1.0, "velocity": 9.0}}],
            "time": {"end": 2.0},
        }
        run = linkdyn.Scene(given).forward(t=np.linspace(0.0, 2.0, 101), rtol=1e-10, atol=1e-10)
        assert run.attrs["stopped"] == ""
        assert run.q.values[-1, 0] - run.q.values[0, 0] > 2 * np.pi
        assert run.attrs["coordinates_integrated"] == ""


def test_switching_can_be_forbidden() -> None:
    scene = linkdyn.Scene(with_coordinates(slider_crank(), ("D",)))
    run = scene.forward(t=np.linspace(0.0, 0.1, 11), switch=False)
    assert run.attrs["stopped"].endswith("s: coordinate 'D' comes to its dead point")
    assert np.all(run.stand_in == 0)
    assert np.isnan(run.q.values[-1, 0])


@pytest.mark.parametrize(("method", "tolerance"), [("rkf45", 3e-2), ("rkf45", 1e-2), ("rk8pd", 3e-3)])
def test_no_loose_step_leaps_a_dead_point(method: str, tolerance: float) -> None:
    """Steps at such tolerances ended behind the point, with all joints turning back: 1.2 to 1.9 rad off with status ok."""
    scene = linkdyn.Scene(triple_rocker())
    t = np.linspace(0.0, 3.0, 201)
    good = scene.forward(t=t, rtol=1e-11, atol=1e-11)
    run = scene.forward(t=t, method=method, rtol=tolerance, atol=tolerance, switch=False)
    assert run.attrs["stopped"].endswith("s: coordinate 'J1' comes to its dead point")
    ok = run.status.values == 0
    assert 10 < ok.sum() < 30 and (run.status.values[ok.sum() :] != 0).all()
    assert np.abs(run.q.values - good.q.values)[ok].max() < 0.3


def test_pauses_change_nothing() -> None:
    """A run that comes back every 50 microseconds, in the midst of phases too, gives the same numbers."""
    from linkdyn import _bind
    from linkdyn.results import result_shapes

    scene = linkdyn.Scene(triple_rocker())
    t = np.linspace(0.0, 6.0, 31)
    whole = scene.forward(t=t)
    assert np.any(whole.stand_in > 0)
    shapes = result_shapes(_bind.describe_results(scene._handle, "elimination", "", True, is_forward=True), True)
    run = _bind.Run(scene._handle, whole.attrs["method"], "elimination", 1, (1e-3, 1e-9, 1e-9), True, "", False, t[0], t[-1])
    parts, n_done, n_call = [], 0, 0
    while n_done < len(t):
        n, arrays = run.advance(t[n_done:], shapes, 5e-5)
        parts.append(arrays)
        n_done += n
        n_call += 1
    run.finish()
    assert n_call > 60
    for name in shapes:
        # A sample's place among those computed side by side shows in the last place of a sum, such as the energy.
        last_place = 1e-15 * float(np.abs(whole[name]).max())
        np.testing.assert_allclose(np.concatenate([part[name] for part in parts]), whole[name], 0, last_place, err_msg=name)
    assert run.coordinates == whole.attrs["coordinates_integrated"]


def test_start_at_a_dead_point_is_refused() -> None:
    """The piston at the end of its stroke does not say how fast the crank turns, nor where to."""
    given = with_coordinates(slider_crank(), ("D",))
    given["frame"]["markers"]["rail"] = [0.0, 0.0]
    given["coordinate"][0]["start"] = {"position": 0.38, "velocity": 0.0}
    with pytest.raises(linkdyn.InputError, match="at a dead point.*expected another coordinate.*'A'"):
        linkdyn.Scene(given).forward(0.1)


def test_files_and_summary_tell(tmp_path: Path) -> None:
    """The executable's summary, netCDF and CSV name the joints."""
    given = with_coordinates(slider_crank(), ("D",))
    scene = tmp_path / "piston.toml"
    scene.write_text(linkdyn.Scene(given).text)

    def run(*options: str) -> str:
        command = [executable(), "forward", str(scene), "--until", "0.1", "--samples", "11", *options]
        return subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path).stdout

    assert "  coordinates      slide of D until 0.0" in run()
    with xr.open_dataset(tmp_path / "piston.nc") as data:
        python = linkdyn.Scene(given).forward(t=data.time.values)     # to the last bit, on which a step may end
        assert data.attrs["coordinates_integrated"] == python.attrs["coordinates_integrated"]
        np.testing.assert_array_equal(data.stand_in.values, python.stand_in.values)
        assert data.stand_in.attrs["flag_meanings"] == python.stand_in.attrs["flag_meanings"]
        assert data.stand_in.dims == python.stand_in.dims
    run("--csv")
    rows = list(csv.DictReader((tmp_path / "piston.csv").open()))
    assert [row["stand_in D"] for row in rows][:1] + [row["stand_in D"] for row in rows][-1:] == ["none", "A.angle"]


@pytest.mark.twin
def test_quadruple_precision(tmp_path: Path) -> None:
    """The twin exchanges as well, and keeps the energy to the tolerance it was given; double precision agrees with it."""
    (tmp_path / "scene.toml").write_text(linkdyn.Scene(triple_rocker()).text)
    command = [quadruple_twin(), "forward", "scene.toml", "--until", "2", "--samples", "3", "--csv", "-o", "run.csv", "--quiet"]
    subprocess.run([*command, "--method", "gbs", "--rtol", "1e-20", "--atol", "1e-20"], check=True, cwd=tmp_path)
    rows = list(csv.DictReader((tmp_path / "run.csv").open()))
    assert {row["stand_in J1"] for row in rows} == {"none", "J4.angle"}
    energy = [Decimal(row["kinetic_energy [J]"]) + Decimal(row["potential_energy [J]"]) for row in rows]
    # A hundred steps, on a scale of 1e5 J.
    assert max(abs(value - energy[0]) for value in energy) < Decimal("1e-18") * energy[0].copy_abs() * 1000
    run = linkdyn.Scene(triple_rocker()).forward(t=[0.0, 1.0, 2.0], **TIGHT)
    np.testing.assert_allclose(run.q.values[:, 0], [float(row["q J1 [rad]"]) for row in rows], rtol=0, atol=1e-10)


@pytest.mark.parametrize("path", ["stewart_drilling", "sixbar_slider", "rcsp_start", "slider_crank", "spatial_slider_crank"])
def test_poses_by_joint_variables(path: str) -> None:
    """All joint variables place the links as the coordinates do."""
    scene = linkdyn.load(EXAMPLES / path / "scene.toml")
    if path == "spatial_slider_crank":
        run = scene.forward(t=np.linspace(0.0, 0.5, 11))
        want = scene.poses(run.q.values, in_order=True)
    else:
        run = scene.inverse()
        want = scene.poses()
    got = scene.poses(joint_variable=run.joint_variable.values)
    assert np.all(got.status == 0)
    np.testing.assert_allclose(got.position, want.position, rtol=0, atol=1e-12)
    np.testing.assert_allclose(got.rotation, want.rotation, rtol=0, atol=1e-12)


def test_animation_follows_through_dead_points(tmp_path: Path) -> None:
    """Where the coordinate is the piston's, pictures go by all joint variables: the crank turns fully."""
    scene = linkdyn.Scene(with_coordinates(slider_crank(), ("D",)))
    run = scene.forward(t=np.linspace(0.0, 0.3, 61))
    poses = poses_of(scene, run)
    angle = np.unwrap(np.arctan2(poses.rotation[:, 0, 1, 0], poses.rotation[:, 0, 0, 0]))
    assert angle[-1] - angle[0] > 2 * np.pi
    assert linkdyn.plot.animate(run, tmp_path / "run.gif", frames=5).exists()
    with pytest.raises(linkdyn.InputError, match="expected joint variables"):
        linkdyn.plot.animate(scene.forward(0.1, want="driving_force"), tmp_path / "run.gif")


def test_no_exchange_without_dead_point() -> None:
    """The crank of an RCSP moves a pin three times as fast as its own, and has no dead point: rk4 keeps to it, and to its
    order. The angle is known from an integration in 40 digits."""
    scene = linkdyn.load(Path(__file__).with_name("scenes") / "rcsp_by_torque.toml")
    errors = []
    for step in (5e-3, 2.5e-3, 1.25e-3):
        run = scene.forward(method="rk4", step=step)
        assert run.attrs["stopped"] == "" and run.attrs.get("coordinates_integrated", "") == ""
        errors.append(abs(run.q.values[-1, 0] - 6.287023252453347))
    assert errors[0] < 2e-3 and errors[1] < errors[0] / 2**3.8 and errors[2] < errors[1] / 2**3.8


# ---------------------------------------------------------------- coordinates that nothing can stand in for

SCENES = Path(__file__).resolve().parent / "scenes"


@pytest.mark.thorough
@pytest.mark.parametrize(("tolerance", "within"), [(1e-9, 2e-6), (1e-6, 1e-4)])
@pytest.mark.parametrize("method", ["rk8pd", "rkf45", "gbs", "seulex"])
@pytest.mark.parametrize(("name", "end"), [("fivebar_by_tip", 0.281655), ("hooke_by_angle", 0.365021)])
def test_nothing_is_thrown_back(name: str, end: float, method: str, tolerance: float, within: float) -> None:
    """At its dead point a pose turns back and the mechanism goes on. A state before that point has the same coordinates as one
    behind it: a step over it would end in the former, with all joints turning the other way."""
    run = linkdyn.load(SCENES / f"{name}.toml").forward(method=method, rtol=tolerance, atol=tolerance, step=2e-3, want="power")
    good = run.status.values == 0
    assert (good == (run.time.values < end)).all()
    energy = (run.kinetic_energy + run.potential_energy).values[good]
    assert np.ptp(energy) < 100 * tolerance * np.abs(energy).max() + 10 * tolerance
    assert float(run.attrs["stopped"].split("t = ")[1].split(" s")[0]) == pytest.approx(end, abs=within)


@pytest.mark.thorough
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("name", "coordinates"), [("fivebar_by_tip", ("r1.C.x", "r1.C.y")), ("hooke_by_angle", ("U.angle1", "U angle1", "U"))])
def test_one_message_for_a_dead_point(name: str, coordinates: tuple[str, ...], method: str) -> None:
    """However steps end there, by their shortness, by the energy that they would make or thrown back: one cause, with its name."""
    settings = {"step": 1e-3} if method == "rk4" else {}
    run = linkdyn.load(SCENES / f"{name}.toml").forward(method=method, want="power", **settings)
    stopped = run.attrs["stopped"]
    assert "comes to its dead point, where it turns back" in stopped, stopped
    assert any(f"coordinate '{each}'" in stopped for each in coordinates), stopped


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize(("name", "end"), [("hooke_by_angle", 0.365021), ("fivebar_by_tip", 0.281655)])
def test_msbdf_is_not_thrown_back(name: str, end: float, tolerance: float) -> None:
    """Its steps end by errors of their own order and went on behind these dead points, Hooke's joint to the end at each tolerance."""
    run = linkdyn.load(SCENES / f"{name}.toml").forward(t=np.linspace(0.0, 0.6, 121), method="msbdf", rtol=tolerance, atol=tolerance)
    assert "comes to its dead point, where it turns back" in run.attrs["stopped"]
    assert float(run.attrs["stopped"].split("t = ")[1].split(" s")[0]) == pytest.approx(end, abs=3e-3)


def test_the_tip_of_a_five_bar_by_its_cranks() -> None:
    """The instant of the test above, by coordinates that have no dead point there."""
    scene = tomllib.loads((SCENES / "fivebar_by_tip.toml").read_text())
    scene["coordinate"] = [{"joint": "A", "start": {"position": 2.0, "velocity": 1.0}}, {"joint": "D", "start": {"position": 1.1, "velocity": 2.0}}]
    scene["measures"] = {"elbow": {"joint": "B"}}
    scene["event"] = [{"name": "stretched", "when": "sin(elbow)"}]
    run = linkdyn.Scene(scene).forward(0.4, **TIGHT)
    assert run.event_time.values[0] == pytest.approx(0.281655, abs=1e-6)


def test_bodies_beside_an_exchange() -> None:
    """What tumbles freely does so whatever coordinate stands in elsewhere: accelerations of its angles are those of the body alone."""
    scene = tomllib.loads((SCENES / "tumbler_beside_fourbar.toml").read_text())
    run = linkdyn.Scene(scene).forward(**TIGHT)
    assert (run.stand_in.values != 0).any()
    alone = {key: scene[key] for key in ("space", "gravity", "time")} | {"link": scene["link"][:1], "coordinate": scene["coordinate"][:1]}
    body = linkdyn.Scene(alone).forward(**TIGHT)
    assert np.abs(body.qdd).max() > 10
    assert np.abs(run.qdd.values[:, :6] - body.qdd.values).max() < 1e-9


@pytest.mark.thorough
@pytest.mark.parametrize("tolerance", [1e-9, 1e-11])
@pytest.mark.parametrize("method", ["rk8pd", "rkf45", "gbs", "seulex"])
@pytest.mark.parametrize(("name", "end", "other"), [
    ("guide_turns_back", 0.176308, {"joint": "J2", "variable": "angle2"}),
    ("planar_joint_by_x", 0.061319, {"joint": "J0", "variable": "angle"}),
])  # fmt: skip
def test_what_has_no_stand_in_stops(name: str, end: float, other: dict[str, str], method: str, tolerance: float) -> None:
    """All that could stand in for the coordinate turns back with it, or nothing could. The same mechanism led by another joint variable
    goes on: until the stop both are one."""
    t = np.linspace(0.0, 0.6, 13)
    file = SCENES / f"{name}.toml"
    scene = tomllib.loads(file.read_text())
    start = linkdyn.load(file).forward(t=[0, 1e-9]).isel(sample=0).sel(variable=f"{other['joint']}.{other['variable']}")
    scene["coordinate"][0] = {**other, "start": {"position": float(start.joint_variable), "velocity": float(start.joint_rate)}}
    goes_on = linkdyn.Scene(scene).forward(t=t, **TIGHT)
    assert (goes_on.status.values == 0).all()
    run = linkdyn.load(file).forward(t=t, method=method, rtol=tolerance, atol=tolerance)
    good = run.status.values == 0
    assert (good == (t < end)).all()
    assert np.abs(run.joint_variable - goes_on.joint_variable).values[good].max() < 100 * tolerance
    assert float(run.attrs["stopped"].split("t = ")[1].split(" s")[0]) == pytest.approx(end, abs=2e-6)


def bricard(joint: str) -> dict:
    """Six hinges between thin rods, each square to the next: a loop with a constraint too much, of which any hinge comes to rest
    and turns back. At the start all of them stand at 90 degrees, along the edges of a cube."""
    start = {"J0": 90, "J1": 90, "J2": -90, "J3": 90, "J4": -90, "J5": -90}      # degrees
    rods, joints = [], []
    for i in range(6):
        ends = {"a": {"at": [0, 0, 0], "axis": [0, 0, 1]}, "b": {"at": [1, 0, 0], "axis": [0, (-1) ** (i + 1), 0]}}
        rods.append({"name": f"rod{i + 1}", "mass": 1.0, "cog": [0.5, 0, 0], "inertia": {"diagonal": [0, 1 / 12, 1 / 12]}, "markers": ends})
        between = [f"rod{i}.b" if i > 0 else "frame.A", f"rod{i + 1}.a" if i < 5 else "frame.F"]
        joints.append({"name": f"J{i}", "type": "revolute", "between": between, "start": f"{start[f'J{i}']} deg"})
    frame = {"markers": {"A": {"at": [0, 0, 0], "axis": [0, 0, 1]}, "F": {"at": [1, 0, 0], "axis": [0, 1, 0]}}}
    return {"space": "spatial", "gravity": [0, 0, -9.81], "redundancy": "minimum-norm", "frame": frame, "link": rods[:5], "joint": joints,
            "coordinate": [{"joint": joint, "start": f"{start[joint]} deg"}]}


def keeps_energy(run: xr.Dataset, tolerance: float) -> None:
    """The bricard's energy within as much as the tolerance in each step, of what five rods of 1 kg have gained after 2 m."""
    energy = (run.kinetic_energy + run.potential_energy).values
    assert np.abs(energy - energy[0]).max() < tolerance * run.attrs["steps"] * 5 * 9.81 * 2


def test_an_overconstrained_loop_falls() -> None:
    """Through some exchanges: whatever hinge leads it, and so whichever joints let go, it falls alike."""
    grid = np.linspace(0.0, 3.0, 31)
    runs = [linkdyn.Scene(bricard(joint)).forward(t=grid, rtol=1e-11, atol=1e-11) for joint in ("J0", "J5")]
    for run in runs:
        assert run.attrs["stopped"] == "" and run.attrs["coordinates_integrated"].count("until") >= 2
        keeps_energy(run, 1e-11)
    at = [run.linkdyn.marker("rod3.b").position.values for run in runs]
    assert np.abs(at[1] - at[0]).max() < 1e-7


@pytest.mark.parametrize(("instant", "joint"), [(1.0, "J2"), (4.0, "J5"), (4.1, "J2")])
def test_joints_let_go_where_nothing_is_singular_on_the_way(instant: float, joint: str) -> None:
    """A run that begins anywhere on the way goes on as the one from the start: joints that let go by how the linkage stands at the
    start alone left it singular later on, and such runs stopped."""
    there = linkdyn.Scene(bricard("J0")).forward(t=[0.0, instant], rtol=1e-11, atol=1e-11).isel(sample=1)
    given = bricard(joint)
    for k, one in enumerate(given["joint"]):
        one["start"] = float(there.joint_variable[k])
    k = int(joint[1])
    given["coordinate"] = [{"joint": joint, "start": {"position": float(there.joint_variable[k]), "velocity": float(there.joint_rate[k])}}]
    run = linkdyn.Scene(given).forward(t=np.linspace(0.0, 3.0, 61), rtol=1e-11, atol=1e-11)
    assert run.attrs["stopped"] == "" and (run.status == 0).all()
    keeps_energy(run, 1e-11)


def test_a_hinge_that_nothing_can_stand_in_for_is_told() -> None:
    """Both cranks are at rest at once, only a universal joint's cross goes on: the message asked for hinges as coordinates, which were there."""
    scene = linkdyn.load(ROOT / "tests" / "python" / "scenes" / "cross_goes_on_alone.toml")
    rest = "coordinate 'J1' comes to its dead point"
    assert scene.forward().attrs["stopped"].endswith(f"{rest}, and no other joint variable can take its place")
    assert scene.forward(switch=False).attrs["stopped"].endswith(rest)


@pytest.mark.parametrize("name", ["examples/tripteron/scene.toml", "tests/scenes/barrel_cam.toml", "tests/scenes/flat_cam_3d.toml"])
@pytest.mark.parametrize("method", ["gbs", "rk8pd"])
def test_what_stands_still_is_not_thrown_back(name: str, method: str) -> None:
    """Held where it is by its drives, all that moves is rounding, and turns round at will: that is no dead point leapt over."""
    file = ROOT / name
    content = tomllib.loads(file.read_text())
    for coordinate in content["coordinate"]:
        coordinate.pop("motion", None)
    run = linkdyn.Scene(content, folder=file.parent).forward(t=np.linspace(0, 0.05, 3), method=method)
    assert run.attrs["stopped"] == "" and not run.status.values.any()
    assert run.attrs["right_hand_sides"] < 10_000


@pytest.mark.parametrize("solver", ["elimination", "lapack"])
def test_drives_follow_the_motion_through_phases(solver: str) -> None:
    """A phase that takes over where another stood begins without records: that of the motion's own forces was read after its end.

    What the drives apply is open loop, and a load that pulls makes it unstable, so the run leaves the motion; the balance of energy does not.
    """
    run = linkdyn.load(ROOT / "tests" / "python" / "scenes" / "toggle_by_cylinder.toml").forward(solver=solver)
    assert run.attrs["stopped"] == "" and not run.status.values.any()
    assert "angle of A" in run.attrs["coordinates_integrated"]
    motion = linkdyn.load(ROOT / "tests" / "python" / "scenes" / "toggle_by_cylinder.toml").inverse(want="driving_force")
    np.testing.assert_allclose(run.driving_force, motion.driving_force, rtol=1e-9, atol=1e-6)
    assert run.power_imbalance.max() < 1e-9
