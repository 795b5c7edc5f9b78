"""Followers that rub on their cams: an eccentric circle by hand, in the plane and in tilted axes; drums; every road of the engine."""

from __future__ import annotations

import copy
from typing import Any

import linkdyn
import numpy as np
import pytest
from test_space_cams import DRUMS, FAR, PACE, bend, in_tilted_axes, slope

pytestmark = pytest.mark.accuracy

ROUND, OFF, SPEED, MASS, WEIGHT = 0.03, 0.01, 25.0, 0.6, 9.81
ROLLER, PIN, MU = 0.012, 0.004, 0.15
SPLINE = 2e-5         # of accelerations along an outline of 720 points


def eccentric(follower: str, **friction: Any) -> dict[str, Any]:
    """A disc whose middle goes round, and what it lifts straight up."""
    angle = 2 * np.pi * np.arange(720) / 720
    outline = {"x": (OFF + ROUND * np.cos(angle)).tolist(), "y": (ROUND * np.sin(angle)).tolist()}
    cam = {"name": "C", "type": "cam", "between": ["cam.O", "lifter.R"], "follower": follower, "curve": outline}
    if follower == "roller":
        cam["radius"] = ROLLER
    return {
        "space": "planar", "gravity": [0.0, -WEIGHT], "frame": {"markers": {"O": [0, 0], "G": {"at": [0, 0], "axis": [0, 1]}}},
        "link": [{"name": "cam", "markers": {"O": [0, 0]}, "mass": 2.0, "inertia": 1e-3},
                 {"name": "lifter", "markers": {"R": {"at": [0, 0], "axis": [0, -1]}, "G": {"at": [0, 0], "axis": [0, 1]}}, "mass": MASS, "inertia": 1e-4}],
        "joint": [{"name": "shaft", "type": "revolute", "between": ["frame.O", "cam.O"]},
                  {"name": "G", "type": "prismatic", "between": ["frame.G", "lifter.G"], "start": 0.04}, cam],
        "coordinate": [{"joint": "shaft", "motion": {"law": "constant-rate", "rate": SPEED, "start": 0.3}}], "actuator": [{"joint": "shaft"}],
        "friction": [{"joint": "C", **({"creep_speed": 1e-4} if "coulomb" in friction else {}), **friction}], "time": {"end": 0.25, "samples": 101},
    }  # fmt: skip


def by_hand(follower: str, t: np.ndarray, mu: float, damping: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What presses, the force on the follower (n, 2) and where it acts, (n, 2)."""
    angle = 0.3 + SPEED * t
    c, s = OFF * np.cos(angle), OFF * np.sin(angle)
    if follower == "flat":
        place, speed, rise = np.stack([c, s + ROUND], axis=1), SPEED * c, -(SPEED**2) * s
        normal, passing = np.tile([0.0, 1.0], (len(t), 1)), 1.0
    else:
        far = ROUND + (ROLLER if follower == "roller" else 0.0)
        up = np.sqrt(far**2 - c**2)
        speed = SPEED * (c + c * s / up)
        rise = SPEED**2 * (-s + (c**2 - s**2) / up - (c * s) ** 2 / up**3)
        normal = np.stack([-c, up], axis=1) / far
        place = np.stack([c, s], axis=1) + ROUND * normal
        passing = PIN / ROLLER if follower == "roller" else 1.0
    along = normal @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    slip = ((np.stack([0 * t, speed], axis=1) - SPEED * place @ np.array([[0.0, 1.0], [-1.0, 0.0]])) * along).sum(axis=1)
    held = -passing * mu * np.sign(slip)                          # force along, over what presses
    drag = -(passing**2) * damping * slip
    press = (MASS * (rise + WEIGHT) - drag * along[:, 1]) / (normal[:, 1] + held * along[:, 1])
    return press, press[:, None] * normal + (held * press + drag)[:, None] * along, place


@pytest.mark.parametrize("in_space", [False, True], ids=["plane", "space"])
@pytest.mark.parametrize("friction", [{"coulomb": MU}, {"viscous": 3.0}, {"coulomb": MU, "viscous": 3.0}], ids=["dry", "viscous", "both"])
@pytest.mark.parametrize("follower", ["flat", "roller", "point"])
def test_an_eccentric_circle(follower: str, friction: dict[str, Any], in_space: bool) -> None:
    pin = {"radius": PIN} if follower == "roller" else {}
    scene = eccentric(follower, **friction, **pin)
    run = linkdyn.Scene(in_tilted_axes(scene) if in_space else scene).inverse(want="all")
    assert not run.status.values.any() and np.abs(run.power_imbalance.values).max() < 1e-11
    press, force, place = by_hand(follower, run.time.values, friction.get("coulomb", 0.0), friction.get("viscous", 0.0))
    np.testing.assert_allclose(run.contact_force.values[:, 0], press, atol=SPLINE * np.abs(press).max())
    torque = place[:, 0] * force[:, 1] - place[:, 1] * force[:, 0]
    np.testing.assert_allclose(run.driving_force.values[:, 0], torque, atol=2 * SPLINE * np.abs(torque).max())
    takes = run.friction_power.sel(joint="C").values
    assert (takes > 0).all()


@pytest.mark.parametrize("solver", ["lapack", "gauss-jordan"])
@pytest.mark.parametrize("in_space", [False, True], ids=["plane", "space"])
@pytest.mark.parametrize("follower", ["flat", "roller", "point"])
def test_solvers_and_samples_alone(follower: str, in_space: bool, solver: str) -> None:
    scene = eccentric(follower, coulomb=MU, viscous=1.0, **({"radius": PIN} if follower == "roller" else {}))
    opened = linkdyn.Scene(in_tilted_axes(scene) if in_space else scene)
    t = np.linspace(0, 0.25, 201)
    one, other = opened.inverse(t=t), opened.inverse(t=t, solver=solver)
    alone = opened.inverse(q=one.q.values[7:8], qd=one.qd.values[7:8], qdd=one.qdd.values[7:8])
    for name in ("driving_force", "reaction", "friction"):
        size = np.abs(one[name].values).max()
        np.testing.assert_allclose(other[name].values, one[name].values, rtol=0, atol=1e-11 * size, err_msg=name)
        np.testing.assert_allclose(alone[name].values[0], one[name].values[7], rtol=0, atol=1e-11 * size, err_msg=name)


@pytest.mark.parametrize("in_space", [False, True], ids=["plane", "space"])
@pytest.mark.parametrize("follower", ["flat", "roller"])
def test_forward_after_inverse(follower: str, in_space: bool) -> None:
    """Under the torque that inverse dynamics asks for the cam turns as it was asked to; without, friction brings it to rest."""
    scene = eccentric(follower, coulomb=MU, **({"radius": PIN} if follower == "roller" else {}))
    opened = linkdyn.Scene(in_tilted_axes(scene) if in_space else scene)
    t = np.linspace(0, 0.2, 5)
    run = opened.forward(t=t, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(run.q.values[:, 0], 0.3 + SPEED * t, atol=2e-7)
    inverse = opened.inverse(t=t)
    np.testing.assert_allclose(run.reaction.values, inverse.reaction.values, rtol=0, atol=1e-4 * np.abs(inverse.reaction.values).max())
    scene["actuator"] = []
    free = linkdyn.Scene(scene).forward(t=t, rtol=1e-9, atol=1e-9)
    energy = (free.kinetic_energy + free.potential_energy).values
    assert (np.diff(energy) < 0).all()


@pytest.mark.parametrize("name", ["slides", "groove"])
def test_a_drum(name: str) -> None:
    """A roller round a drum: what presses by the slope's formulas; what friction takes is what the shaft gives more."""
    scene = copy.deepcopy(DRUMS[name])
    scene["friction"] = [{"joint": "C", "coulomb": MU, "radius": PIN, "creep_speed": 1e-4}]
    run, ideal = linkdyn.Scene(scene).inverse(want="all"), linkdyn.Scene(DRUMS[name]).inverse(want="all")
    assert not run.status.values.any() and np.abs(run.power_imbalance.values).max() < 1e-11
    angle = -(0.2 + PACE * run.time.values)
    steep = slope(angle) / FAR
    force = 0.7 * (PACE**2 * bend(angle) + 9.81)
    # the drum's surface goes along +y past the roller, which is held back the other way: down where the cam falls along y
    level = 1 / np.sqrt(1 + steep**2)
    held = MU * PIN / 0.01
    press = force / (level + np.sign(force) * held * steep * level)
    np.testing.assert_allclose(np.abs(run.contact_force.values[:, 0]), np.abs(press), rtol=0, atol=2e-4 * np.abs(press).max())
    more = (run.driving_force.values[:, 0] - ideal.driving_force.values[:, 0]) * PACE
    np.testing.assert_allclose(more, run.friction_power.sel(joint="C").values, rtol=0, atol=1e-10 * np.abs(more).max())


def test_causes_and_sweeps() -> None:
    """Friction of a cam is a cause of its own; a sweep goes over its coefficient."""
    scene = eccentric("flat", coulomb=MU)
    opened = linkdyn.Scene(scene)
    run = opened.inverse()
    causes = run.linkdyn.contributions()
    np.testing.assert_allclose(causes.driving_force.sum("cause").values, run.driving_force.values, rtol=0, atol=1e-11 * np.abs(run.driving_force.values).max())
    assert np.abs(causes.driving_force.sel(cause="friction")).max() > 0.01
    axes = [{"parameter": "friction.C.coulomb", "values": [0.0, MU]}, {"time": True, "values": run.time.values[::10].tolist()}]
    swept = linkdyn.Scene(scene | {"sweep": {"axis": axes, "keep": ["driving_force"]}}).sweep()
    n = len(axes[1]["values"])
    np.testing.assert_allclose(swept.driving_force.values.reshape(2, n)[1], run.driving_force.values[::10, 0], rtol=0, atol=1e-11)


# ---------------------------------------------------------------- flat faces in space


def test_a_face_that_leans() -> None:
    """A tappet's face that leans against the cam's axis is the line that is seen along it: as a wedge, steeper than it looks."""
    scene = in_tilted_axes(eccentric("flat", coulomb=0.0))
    del scene["friction"]
    straight = linkdyn.Scene(scene).inverse(want="all")
    lean = np.radians(8)
    face = next(link for link in scene["link"] if link["name"] == "lifter")["markers"]["R"]
    face["axis"] = [0.0, float(-np.cos(lean)), float(np.sin(lean))]
    run = linkdyn.Scene(scene).inverse(want="all")
    assert not run.status.values.any() and np.abs(run.power_imbalance.values).max() < 1e-11
    for name in ("joint_variable", "driving_force", "contact_force"):
        np.testing.assert_allclose(run[name].values, straight[name].values, rtol=0, atol=1e-11 * np.abs(straight[name].values).max(), err_msg=name)
