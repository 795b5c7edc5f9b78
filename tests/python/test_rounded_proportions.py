"""Mechanisms that move by their proportions alone, with numbers as drawings have them: rounded, or some of them measured."""
from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import linkdyn
import numpy as np
import pytest
from test_redundancy import GRAVITY, bennett, shaft, spherical, three_cranks

Scene = dict[str, Any]
MAY_GAPE = 1e-6
"""Part of the size, docs/scene-file.md."""


def rounded(part: Any, digits: int) -> Any:
    """Every number to so many digits behind the point."""
    if isinstance(part, dict):
        return {key: rounded(value, digits) for key, value in part.items()}
    if isinstance(part, list):
        return [rounded(value, digits) for value in part]
    return round(part, digits) if isinstance(part, float) else part


def turned(scene: Scene) -> Scene:
    """A planar scene whose links have axes of their own, so that their numbers are no longer round."""
    turned = copy.deepcopy(scene)
    for i, link in enumerate(turned["link"]):
        c, s = np.cos(0.3 + 0.2 * i), np.sin(0.3 + 0.2 * i)
        for marker in link["markers"].values():
            x, y = marker["at"]
            marker["at"] = [float(c * x - s * y), float(s * x + c * y)]
        x, y = link["cog"]
        link["cog"] = [float(c * x - s * y), float(s * x + c * y)]
    return turned


@pytest.mark.parametrize("digits", [12, 11, 10, 9, 8])
@pytest.mark.parametrize("make", [bennett, spherical, lambda: turned(three_cranks())], ids=["bennett", "spherical", "three cranks"])
def test_rounded_numbers(make: Callable[[], Scene], digits: int) -> None:
    """They run, and what they give is that of the exact ones within what was rounded: reactions share it by how the rounded ones stand."""
    exact = linkdyn.Scene(make())
    scene = linkdyn.Scene(rounded(make(), digits))
    q, zero = np.linspace(0.1, 0.6, 7)[:, np.newaxis], np.zeros((7, 1))
    run, wanted = scene.inverse(q=q, qd=zero + 1, qdd=zero, want="all"), exact.inverse(q=q, qd=zero + 1, qdd=zero, want="all")
    assert (run.status == 0).all()
    for name in ("driving_force", "reaction"):
        largest = np.abs(wanted[name].values).max()
        np.testing.assert_allclose(run[name].values, wanted[name].values, rtol=0, atol=300 * 10.0**-digits * largest)


@pytest.mark.parametrize("off", [1e-12, 1e-10, 1e-8])
def test_a_bearing_off_its_line(off: float) -> None:
    scene = shaft()
    exact = linkdyn.Scene(scene).inverse(t=[0.0, 0.3])
    scene["frame"]["markers"]["Z"]["at"][0] += off
    run = linkdyn.Scene(scene).inverse(t=[0.0, 0.3])
    assert (run.status == 0).all()
    np.testing.assert_allclose(run.reaction.values, exact.reaction.values, rtol=0, atol=100 * off * np.abs(exact.reaction.values).max())


def test_beyond_what_joints_may_gape() -> None:
    """Nothing is told of a mechanism whose joints do not fit, but which joint, and by how much."""
    scene = shaft()
    scene["frame"]["markers"]["Z"]["at"][0] += 20 * MAY_GAPE
    with pytest.raises(linkdyn.SceneError, match=r"closed as far as they can be, joint 'J[12]' stays open by .*e-\d+ m .*more digits"):
        linkdyn.Scene(scene)


# ---------------------------------------------------------------- slides and screws of one axis


def lead_screw(lead: str) -> Scene:
    """A spindle in a bearing, a nut on it in a guide."""
    marker = {"at": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0]}
    motion = {"law": "harmonic", "amplitude": 0.02 if lead in ("G", "nut") else 0.02 * 2 * np.pi / 0.005, "frequency": "1 Hz"}
    coordinate = {"joint": lead, "motion": motion}
    if lead == "nut":
        coordinate = {"link": "nut", "components": ["x"], "motion": {"x": motion}}
    return {
        "space": "spatial", "gravity": GRAVITY, "frame": {"markers": {"B": marker, "G": marker | {"at": [0.0, 0.1, 0.0]}}},
        "link": [{"name": "spindle", "mass": 2.0, "inertia": [1e-3, 2e-2, 2e-2, 0.0, 0.0, 0.0], "markers": {"B": marker, "S": marker}},
                 {"name": "nut", "mass": 30.0, "cog": [0.01, 0.0, 0.0], "inertia": [0.1, 0.1, 0.1, 0.0, 0.0, 0.0],
                  "markers": {"S": marker, "G": marker | {"at": [0.0, 0.1, 0.0]}}}],
        "joint": [{"name": "B", "type": "revolute", "between": ["frame.B", "spindle.B"]},
                  {"name": "S", "type": "screw", "between": ["spindle.S", "nut.S"], "lead": "5 mm"},
                  {"name": "G", "type": "prismatic", "between": ["frame.G", "nut.G"]}],
        "coordinate": [coordinate],
        "actuator": [{"joint": "B"}],
        "load": [{"on": "nut.S", "force": [-400.0, 0.0, 0.0]}],
        "time": {"end": 1.0, "samples": 21},
    }


@pytest.mark.parametrize("lead", ["B", "S", "G", "nut"])
def test_a_lead_screw(lead: str) -> None:
    """The torque is that of the load and of what is accelerated, whichever joint leads."""
    run = linkdyn.Scene(lead_screw(lead)).inverse(want="all")
    assert (run.status == 0).all()
    x = run.joint_variable.sel(variable="G.slide").values
    turns = 2 * np.pi / 0.005 * np.sign(run.joint_variable.sel(variable="B.angle").values[1] * x[1])    # of the spindle for a way of the nut
    acceleration = -(2 * np.pi) ** 2 * x
    wanted = (30.0 * acceleration + 400.0) / turns + 1e-3 * turns * acceleration
    np.testing.assert_allclose(run.driving_force.values[:, 0], wanted, rtol=1e-10, atol=1e-10)
    assert np.abs(run.power_imbalance.values).max() < 1e-12


FINE, COARSE = 0.005, 0.0042    # leads of a differential screw [m]


def differential_screw(lead: str) -> Scene:
    """A spindle of two threads, in a nut that stands and in one that a guide leads."""
    marker = {"at": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0]}
    way = 0.02 if lead == "G" else 0.02 * 2 * np.pi / (FINE - COARSE)
    return {
        "space": "spatial", "gravity": GRAVITY, "frame": {"markers": {"S": marker, "G": marker | {"at": [0.0, 0.1, 0.0]}}},
        "link": [{"name": "spindle", "mass": 2.0, "inertia": [1e-3, 2e-2, 2e-2, 0.0, 0.0, 0.0], "markers": {"S": marker, "T": marker}},
                 {"name": "nut", "mass": 30.0, "cog": [0.01, 0.0, 0.0], "inertia": [0.1, 0.1, 0.1, 0.0, 0.0, 0.0],
                  "markers": {"T": marker, "G": marker | {"at": [0.0, 0.1, 0.0]}}}],
        "joint": [{"name": "S", "type": "screw", "between": ["frame.S", "spindle.S"], "lead": FINE},
                  {"name": "T", "type": "screw", "between": ["spindle.T", "nut.T"], "lead": COARSE},
                  {"name": "G", "type": "prismatic", "between": ["frame.G", "nut.G"]}],
        "coordinate": [{"joint": lead, "motion": {"law": "harmonic", "amplitude": way, "frequency": "1 Hz"}}],
        "actuator": [{"joint": "S"}],
        "load": [{"on": "nut.T", "force": [-400.0, 0.0, 0.0]}],
        "time": {"end": 1.0, "samples": 21},
    }


@pytest.mark.parametrize("lead", ["S", "T", "G"])
def test_a_differential_screw(lead: str) -> None:
    """Whichever joint leads, the guide, too: the nut goes on by the difference of the leads, the spindle by its own."""
    scene = linkdyn.Scene(differential_screw(lead))
    run = scene.inverse(want="all")
    assert (run.status == 0).all()
    x = run.joint_variable.sel(variable="G.slide").values
    angle = run.joint_variable.sel(variable="S.angle").values
    np.testing.assert_allclose(x, (FINE - COARSE) / (2 * np.pi) * angle, rtol=0, atol=1e-12)
    acceleration = -(2 * np.pi) ** 2 * angle
    nut, spindle = (FINE - COARSE) / (2 * np.pi), FINE / (2 * np.pi)
    wanted = (30.0 * nut * acceleration + 400.0) * nut + 2.0 * spindle**2 * acceleration + 1e-3 * acceleration
    np.testing.assert_allclose(run.driving_force.values[:, 0], wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())
    assert np.abs(run.power_imbalance.values).max() < 1e-12
    thrust = run.reaction.sel(joint="T", component="Fx").values
    np.testing.assert_allclose(thrust, 30.0 * nut * acceleration + 400.0, rtol=0, atol=1e-9 * np.abs(thrust).max())
    lanes = scene.inverse(want="all", solver="lapack")
    np.testing.assert_allclose(lanes.reaction.values, run.reaction.values, rtol=0, atol=1e-9 * np.abs(run.reaction.values).max())


@pytest.mark.parametrize("offset", [0.0, 0.2])
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_slide_led_by_the_place_of_its_link(space: str, offset: float) -> None:
    """A link that does not turn against the frame stands as the frame does, which stays where it is."""
    n = 2 if space == "planar" else 3
    marker = {"at": [0.0, offset, 0.0][:n], "axis": [1.0, 0.0, 0.0][:n]}
    scene = {
        "space": space, "gravity": [-9.81, 0.0, 0.0][:n], "frame": {"markers": {"G": marker}},
        "link": [{"name": "nut", "mass": 2.0, "inertia": 1.0 if n == 2 else [1.0, 1.0, 1.0, 0.0, 0.0, 0.0], "markers": {"G": marker}}],
        "joint": [{"name": "G", "type": "prismatic", "between": ["frame.G", "nut.G"]}],
        "coordinate": [{"link": "nut", "components": ["x"], "motion": {"x": {"law": "constant-rate", "rate": 0.1}}}],
        "actuator": [{"joint": "G"}], "time": {"end": 1.0, "samples": 5},
    }
    run = linkdyn.Scene(scene).inverse(want="all")
    assert (run.status == 0).all()
    np.testing.assert_allclose(run.joint_variable.values[:, 0], 0.1 * run.time.values, atol=1e-14)
    np.testing.assert_allclose(run.driving_force.values[:, 0], 2.0 * 9.81, rtol=1e-14)


def wedge(lead: str, turned_over: bool = False) -> Scene:
    """A wedge slides under a plate that goes up and down."""
    slope = [float(np.cos(0.35)), 0.0, float(np.sin(0.35))]
    between = ["plate.W", "wedge.W"] if turned_over else ["wedge.W", "plate.W"]
    body = {"cog": [0.01, 0.02, 0.03], "inertia": [0.1, 0.1, 0.1, 0.0, 0.0, 0.0]}
    return {
        "space": "spatial", "gravity": GRAVITY,
        "frame": {"markers": {"X": {"at": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0]}, "Z": {"at": [0.0, 0.0, 0.2], "axis": [0.0, 0.0, 1.0]}}},
        "link": [{"name": "wedge", "mass": 1.0, **body, "markers": {"X": {"at": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0]}, "W": {"at": [0.0, 0.0, 0.0], "axis": slope}}},
                 {"name": "plate", "mass": 10.0, **body, "markers": {"Z": {"at": [0.0, 0.0, 0.2], "axis": [0.0, 0.0, 1.0]}, "W": {"at": [0.0, 0.0, 0.0], "axis": slope}}}],
        "joint": [{"name": "X", "type": "prismatic", "between": ["frame.X", "wedge.X"]}, {"name": "W", "type": "prismatic", "between": between},
                  {"name": "Z", "type": "prismatic", "between": ["frame.Z", "plate.Z"]}],
        "coordinate": [{"joint": lead, "motion": {"law": "harmonic", "amplitude": 0.03, "frequency": "1 Hz"}}],
        "actuator": [{"joint": "X"}], "time": {"end": 1.0, "samples": 21},
    }


@pytest.mark.parametrize("turned_over", [False, True])
@pytest.mark.parametrize("lead", ["X", "W", "Z"])
def test_a_wedge(lead: str, turned_over: bool) -> None:
    """Three slides of one plane, whichever leads: the force at the wedge is that of the weight on the slope and of both masses."""
    run = linkdyn.Scene(wedge(lead, turned_over)).inverse(want="all")
    assert (run.status == 0).all()
    x = run.joint_variable.sel(variable="X.slide").values
    z = run.joint_variable.sel(variable="Z.slide").values
    slope = np.tan(0.35)
    np.testing.assert_allclose(z, -slope * x, atol=1e-13)
    acceleration = -(2 * np.pi) ** 2 * x
    np.testing.assert_allclose(run.driving_force.values[:, 0], (1.0 + 10.0 * slope**2) * acceleration - 10.0 * 9.81 * slope, rtol=1e-11, atol=1e-10)
    assert np.abs(run.power_imbalance.values).max() < 1e-12
