"""Payloads: masses on markers, picked up, put down, poured out; against links that have the mass, against closed equations, and one road of
the engine against another."""

from __future__ import annotations

import copy
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn import cycle
from linkdyn.cli import executable, quadruple_twin
from linkdyn.errors import InputError
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from test_frame_motion import arm, four_bar, hexapod, let_go, on_driven_ground, slider_crank_in_space, turned_back
from test_generate import Compiled
from test_joint_kinds import merged

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "hard"))

from cases import Case  # noqa: E402
from twin import forces_of, quadruple_forces  # noqa: E402

pytestmark = pytest.mark.accuracy

POUR = {"law": "polynomial-345", "from": 40.0, "to": 5.0, "begin": 0.3, "duration": 1.2}


def loaded(scene: dict[str, Any], link: str, at: list[float], *, is_at_rest: bool = True, **payload: Any) -> dict[str, Any]:
    changed = copy.deepcopy(scene)
    if is_at_rest:
        changed["frame"].pop("motion", None)
    body = next(part for part in changed["link"] if part["name"] == link)
    body["markers"]["hold"] = at
    changed.setdefault("payload", []).append({"on": f"{link}.hold", **payload})
    return changed


def four(**payload: Any) -> dict[str, Any]:
    return loaded(four_bar(), "coupler", [0.2, 0.1], **payload)


def of_arm(**payload: Any) -> dict[str, Any]:
    return loaded(arm(), "slider", [0.3, 0.1, -0.2], **payload)


def of_hexapod(**payload: Any) -> dict[str, Any]:
    return loaded(hexapod(), "platform", [0.3, 0.1, 0.4], **payload)


def of_rod(**payload: Any) -> dict[str, Any]:
    return loaded(slider_crank_in_space(), "rod", [0.0, 0.0, 0.2], **payload)


MAKE = [four, of_arm, of_hexapod, of_rod]


def one_body(scene: dict[str, Any], mass: float, inertia: Any = None) -> dict[str, Any]:
    """The payload's mass as part of the link."""
    changed = copy.deepcopy(scene)
    (payload,) = changed.pop("payload")
    link = next(part for part in changed["link"] if part["name"] == payload["on"].split(".")[0])
    at = np.array(link["markers"]["hold"])
    if scene["space"] == "planar":
        total = link["mass"] + mass
        cog = (link["mass"] * np.array(link["cog"]) + mass * at) / total
        link["inertia"] += link["mass"] * np.sum((cog - link["cog"]) ** 2) + mass * np.sum((cog - at) ** 2) + (inertia or 0.0)
        link.update(mass=total, cog=cog.tolist())
    else:
        point = {"mass": mass, "cog": [0.0, 0.0, 0.0], "inertia": inertia or [0.0] * 6}
        link.update(merged(link, point, np.eye(3), at))
    return changed


def same_forces(run: Any, other: Any, tolerance: float = 1e-11) -> None:
    for name in ("driving_force", "reaction"):
        if name in run and name in other:
            assert np.abs(run[name].values - other[name].values).max() < tolerance * np.abs(other[name].values).max(), name


@pytest.mark.parametrize("make", MAKE)
def test_against_one_body(make: Any) -> None:
    """A payload that stays is a part of its link."""
    scene = make(mass=3.0)
    expected = linkdyn.Scene(one_body(scene, 3.0)).inverse(solver="lapack")
    for solver in ("elimination", "lapack", "gauss-jordan", "reduced"):
        run = linkdyn.Scene(scene).inverse(solver=solver)
        same_forces(run, expected)
        assert np.abs(run.power_imbalance).max() < 1e-12
    without = linkdyn.Scene({key: value for key, value in scene.items() if key != "payload"}).inverse()
    assert np.abs(without.driving_force.values - expected.driving_force.values).max() > 0.01 * np.abs(expected.driving_force.values).max()


@pytest.mark.parametrize(("make", "inertia"), [(four, 0.02), (of_arm, [0.1, 0.12, 0.09, 0.01, 0.02, -0.01]), (of_hexapod, [1.0, 1.2, 0.9, 0.1, 0.2, -0.1])])
def test_a_body_with_inertia(make: Any, inertia: Any) -> None:
    scene = make(mass=3.0, inertia=inertia)
    moving = linkdyn.Scene(scene)
    expected = linkdyn.Scene(one_body(scene, 3.0, inertia)).inverse()
    for solver in ("elimination", "lapack", "reduced"):
        same_forces(moving.inverse(solver=solver), expected)
    assert moving.inverse(error=True).error.max() < 1e-10
    same_forces(moving.inverse(*moving.motion()), expected)       # it does not change: no instants are asked for


@pytest.mark.parametrize("make", MAKE)
def test_mass_that_changes(make: Any) -> None:
    """At each instant the forces are those of the mass that is there: nothing comes of its rate."""
    scene = make(mass=POUR)
    moving = linkdyn.Scene(scene)
    run = moving.inverse()
    dense, virtual = (moving.inverse(solver=solver) for solver in ("lapack", "reduced"))
    same_forces(dense, run)
    same_forces(virtual, run)
    mass = moving.payload_masses()[:, 0]
    assert mass[0] == 40.0 and mass[-1] == 5.0
    assert np.abs(run.power_imbalance).max() < 1e-12
    for k in (0, 50, 90, -1):
        t = moving.times()[k : k + 1] if k >= 0 else moving.times()[-1:]
        there = linkdyn.Scene(one_body(scene, float(mass[k])))
        q, qd, qdd = moving.motion(t)
        expected = there.inverse(q, qd, qdd)
        assert np.abs(run.reaction.values[k] - expected.reaction.values[0]).max() < 1e-10 * np.abs(run.reaction.values).max()
    with pytest.raises(InputError, match=r"^t: the mass of a payload changes with time, and no instants are given"):
        moving.inverse(*moving.motion())


@pytest.mark.twin
@pytest.mark.parametrize("make", [four, of_hexapod])
def test_quadruple_precision(make: Any) -> None:
    moving = linkdyn.Scene(make(mass=POUR))
    t = moving.times()[::10]
    q, qd, qdd = moving.motion(t)
    exact = quadruple_forces(quadruple_twin(), Case("payload", "payload", make(mass=POUR), q, qd, qdd, np.full(len(t), np.nan)), time=t)
    found = forces_of(moving.inverse(t=t, want=("driving_force", "reaction")))
    assert np.abs(found - exact).max() < 1e-12 * np.abs(exact).max()


def test_picked_up_and_put_down() -> None:
    """There from an instant on, and no more from another; between them it is a part of its link."""
    scene = of_arm(mass=3.0, **{"from": 0.5, "until": 1.5})
    moving = linkdyn.Scene(scene)
    times = np.array([0.2, 0.5, 1.0, 1.5, 1.8])
    assert moving.payload_masses(times)[:, 0].tolist() == [0.0, 3.0, 3.0, 0.0, 0.0]
    found = moving.inverse(t=times)
    with_it, without = (linkdyn.Scene(one_body(scene, mass)).inverse(t=times) for mass in (3.0, 0.0))
    for k, other in enumerate([without, with_it, with_it, without, without]):
        assert np.abs(found.reaction.values[k] - other.reaction.values[k]).max() < 1e-11 * np.abs(other.reaction.values).max()


# ---------------------------------------------------------------- forward


@pytest.mark.parametrize("make", [four, of_arm, of_hexapod])
def test_forward_against_one_body(make: Any) -> None:
    """Short runs on lanes, long ones on the record; energies of the payload are told."""
    scene = let_go(make(mass=3.0))
    for end in (0.05, 2.0):
        t = np.linspace(0, end, 21)
        run, other = (linkdyn.Scene(one).forward(t=t, rtol=1e-11, atol=1e-12, want="all") for one in (scene, one_body(scene, 3.0)))
        assert (run.status == 0).all()
        assert np.abs(run.q.values - other.q.values).max() < 1e-8 * np.abs(other.q.values).max()
        same_forces(run, other, 1e-6)
        assert np.abs(run.kinetic_energy.values - other.kinetic_energy.values).max() < 1e-7 * other.kinetic_energy.max()
        assert np.abs(run.potential_energy.values - other.potential_energy.values).max() < 1e-7 * np.abs(other.potential_energy).max()


def pendulum(**payload: Any) -> dict[str, Any]:
    return {
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"O": [0, 0]}}, "time": {"end": 4, "samples": 161},
        "link": [{"name": "arm", "mass": 1.5, "cog": [0, -0.4], "inertia": 0.02, "markers": {"O": [0, 0], "hold": [0.1, -0.8]}}],
        "joint": [{"name": "O", "type": "revolute", "between": ["frame.O", "arm.O"]}], "coordinate": [{"joint": "O", "start": 0.6}],
        "payload": [{"on": "arm.hold", **payload}],
    }


def swings(mass: Any, ends: list[float], t: NDArray[np.float64]) -> NDArray[np.float64]:
    """J(m) q'' = moment of weight, from kink to kink."""
    def rate(m: float, y: NDArray[np.float64]) -> list[float]:
        c, s = np.cos(y[0]), np.sin(y[0])
        arm_x = lambda x, z: x * c - z * s                                 # noqa: E731
        inertia = 0.02 + 1.5 * 0.16 + m * (0.01 + 0.64)
        return [y[1], -9.81 * (1.5 * arm_x(0, -0.4) + m * arm_x(0.1, -0.8)) / inertia]

    found, y = [], np.array([0.6, 0.0])
    for first, last in zip(ends[:-1], ends[1:]):
        inside = t[(t >= first) & (t < last)] if last < ends[-1] else t[t >= first]
        run = solve_ivp(lambda x, y: rate(mass(x, (first + last) / 2), y), (first, last), y, method="DOP853", rtol=1e-12, atol=1e-13,
                        t_eval=np.union1d(inside, [last]))
        found += run.y[0][: len(inside)].tolist()
        y = run.y[:, -1]
    return np.array(found)


@pytest.mark.parametrize("method", ["gbs", "rk8pd"])
def test_pendulum_that_picks_up(method: str) -> None:
    """Its velocity is the same before and after; then it swings with what it has."""
    t = np.linspace(0, 4, 41)
    run = linkdyn.Scene(pendulum(mass=2.0, **{"from": 1.03, "until": 2.57})).forward(t=t, method=method, rtol=1e-11, atol=1e-12)
    exact = swings(lambda _, middle: 2.0 * (1.03 <= middle < 2.57), [0.0, 1.03, 2.57, 4.0], t)
    assert not run.attrs["stopped"]
    assert np.abs(run.q.values[:, 0] - exact).max() < 1e-8


def test_sand_pours_out() -> None:
    t = np.linspace(0, 4, 41)
    run = linkdyn.Scene(pendulum(mass={"law": "polynomial-345", "from": 3.0, "to": 0.5, "begin": 0.5, "duration": 2.0})).forward(t=t, rtol=1e-11, atol=1e-12)

    def mass(x: float, _: float) -> float:
        u = min(max((x - 0.5) / 2.0, 0.0), 1.0)
        return 3.0 - 2.5 * (10 * u**3 - 15 * u**4 + 6 * u**5)

    assert np.abs(run.q.values[:, 0] - swings(mass, [0.0, 0.5, 2.5, 4.0], t)).max() < 1e-8


def test_four_bar_goes_on_through_a_jump() -> None:
    """Where assemblies are watched by energy: what joins brings its own, and is no jump of the links."""
    scene = let_go(four(mass=8.0, **{"from": 0.4, "until": 1.1}))
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 2, 41), rtol=1e-10, atol=1e-11, want="all")
    assert not run.attrs["stopped"] and (run.status == 0).all()
    lanes = linkdyn.Scene(scene).forward(t=np.linspace(0, 2, 41), rtol=1e-10, atol=1e-11, method="gbs")
    assert np.abs(run.q.values - lanes.q.values).max() < 1e-6


# ---------------------------------------------------------------- with all else


@pytest.mark.parametrize("make", [lambda: loaded(four_bar(), "coupler", [0.2, 0.1], is_at_rest=False, mass=POUR),
                                  lambda: loaded(hexapod(), "platform", [0.3, 0.1, 0.4], is_at_rest=False, mass=50.0, inertia=[1.0, 1.2, 0.9, 0.1, 0.2, -0.1])])
def test_on_a_frame_that_moves(make: Any) -> None:
    scene = make()
    moving, driven = linkdyn.Scene(scene), linkdyn.Scene(on_driven_ground(scene))
    expected = driven.inverse()
    forces = expected.driving_force.sel(actuator=list(moving.actuators)).values
    reactions = turned_back(driven, expected, list(moving.joints))
    for solver in ("elimination", "lapack", "reduced"):
        run = moving.inverse(solver=solver)
        assert np.abs(run.driving_force.values - forces).max() < 1e-11 * np.abs(forces).max()
        if "reaction" in run:
            assert np.abs(run.reaction.values - reactions).max() < 1e-11 * np.abs(reactions).max()


@pytest.mark.parametrize("make", [four, of_arm])
def test_shaking_and_causes(make: Any) -> None:
    scene = make(mass=POUR)
    scene.pop("spring", None)
    moving = linkdyn.Scene(scene)
    run = moving.inverse()
    shaken = cycle.shaking(run, moving)
    held = [joint["name"] for joint in scene["joint"] if "frame" in joint["between"][0]]
    reaction = -run.reaction.sel(joint=held).values[..., : 2 if moving.planar else 3].sum(axis=1)
    assert np.abs(shaken.force.values - reaction).max() < 1e-9 * np.abs(reaction).max()
    parts = cycle.contributions(run, moving)
    assert np.abs(parts.driving_force.sum("cause").values - run.driving_force.values).max() < 1e-9 * np.abs(run.driving_force.values).max()


def test_sweep() -> None:
    scene = four(mass=POUR)
    scene["time"] = {"start": 0.9, "end": 2, "samples": 161}
    scene["sweep"] = {"axis": [{"coordinate": "A", "linspace": [0.0, 6.0, 41]}]}
    swept = linkdyn.Scene(scene).sweep()
    forces = linkdyn.Scene(four(mass=POUR)).inverse(np.linspace(0, 6, 41)[:, np.newaxis], t=0.9).driving_force.values[:, 0]
    assert np.isclose(float(swept.driving_force_max.values.squeeze()), forces.max(), rtol=1e-12)


def test_mass_below_zero_is_flagged() -> None:
    """A law that runs out: no sample has forces of less than nothing."""
    for solver in ("elimination", "lapack", "reduced"):
        moving = linkdyn.Scene(four(mass={"law": "constant-rate", "start": 1.0, "rate": -1.0}))
        run = moving.inverse(solver=solver)
        over = moving.times() > 1.0 + 1e-9
        assert (run.status.values[over] != 0).all() and np.isnan(run.driving_force.values[over]).all()
        assert (run.status.values[moving.times() < 1.0 - 1e-9] == 0).all()
        assert re.search(r"payload on 'coupler\.\w+' has a mass below zero", run.attrs["failure"])
    free = linkdyn.Scene(pendulum(mass={"law": "constant-rate", "start": 1.0, "rate": -1.0})).forward(t=np.linspace(0, 2, 21))
    assert "payload on 'arm.hold' has a mass below zero" in free.attrs["stopped"]


def test_no_code_of_what_changes(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(linkdyn.Scene(four(mass=POUR)).text)
    run = subprocess.run([executable(), "generate", "scene.toml", "-o", "x.c"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert "the mass of the payload on coupler.hold changes with time" in run.stderr


def test_a_payload_off_an_idle_rod() -> None:
    with pytest.raises(linkdyn.errors.SceneError, match=r"the payload on 'rod.hold' is no point on it"):
        linkdyn.Scene(loaded(slider_crank_in_space(), "rod", [0.01, 0.0, 0.2], mass=1.0))


def test_varied() -> None:
    """By `with_`, in a sweep, and told by `explain`."""
    scene = linkdyn.Scene(four(mass=3.0))
    heavier = scene.with_({"payload.coupler.hold.mass": 5.0})
    assert heavier.payload_masses(0.0).tolist() == [[5.0]]
    same_forces(heavier.inverse(), linkdyn.Scene(four(mass=5.0)).inverse())
    assert "payload, 5 kg" in heavier.explain()
    swept = linkdyn.Scene({**four(mass=3.0), "sweep": {"axis": [{"parameter": "payload.coupler.hold.mass", "values": [3.0, 5.0]}, {"time": True, "linspace": [0.0, 2.0, 11]}]}}).sweep()
    peaks = [float(linkdyn.Scene(four(mass=mass)).inverse(t=np.linspace(0.0, 2.0, 11)).driving_force.max()) for mass in (3.0, 5.0)]
    assert np.allclose(swept.driving_force_max.values.squeeze(), peaks, rtol=1e-12)


def test_a_link_that_is_nothing_but_its_payload() -> None:
    """Without mass of its own: with its payload it swings, without there is nothing to swing, which is told."""
    scene = pendulum(mass=2.0)
    scene["link"][0].update(mass=0, inertia=0.0)
    t = np.linspace(0, 1, 11)
    run = linkdyn.Scene(scene).forward(t=t, rtol=1e-11, atol=1e-12)
    length, lead = np.hypot(0.1, 0.8), np.arctan2(0.1, 0.8)
    exact = solve_ivp(lambda _, y: [y[1], -9.81 / length * np.sin(y[0] + lead)], (0, 1), [0.6, 0.0], t_eval=t, method="DOP853", rtol=1e-12, atol=1e-13).y[0]
    assert np.abs(run.q.values[:, 0] - exact).max() < 1e-8
    scene["payload"][0]["until"] = 0.5
    run = linkdyn.Scene(scene).forward(t=t, rtol=1e-11, atol=1e-12)
    assert run.attrs["stopped"]
    assert np.abs(run.q.values[:5, 0] - exact[:5]).max() < 1e-8


@pytest.mark.parametrize("make", [four, of_arm, of_hexapod])
def test_code_with_a_payload(make: Any, tmp_path: Path) -> None:
    """One that is always there is in the forces of generated code."""
    scene = linkdyn.Scene(make(mass=3.0))
    compiled = Compiled(scene.generate(want="all", name="kernel"), tmp_path)
    q, qd, qdd = scene.motion(np.linspace(0.1, 1.9, 7))
    expected = scene.solve(q, qd, qdd)["driving_force"]
    for i in range(7):
        status, found = compiled(q=q[i], qd=qd[i], qdd=qdd[i])
        assert status == 0
        assert np.abs(found["driving_force"] - expected[i]).max() < 1e-11 * np.abs(expected).max()


@pytest.mark.parametrize("make", [four_bar, hexapod, slider_crank_in_space])
def test_kinematics_code_of_a_moving_frame(make: Any, tmp_path: Path) -> None:
    """Motion as seen from the frame asks for no instant, and neither does that of links whose payload changes."""
    scene = make()
    body = scene["link"][0]
    body["markers"]["hold"] = [0.0, 0.0, 0.01][: 2 if scene["space"] == "planar" else 3]
    scene["payload"] = [{"on": f"{body['name']}.hold", "mass": POUR}]
    mechanism = linkdyn.Scene(scene)
    compiled = Compiled(mechanism.generate(kernel="kinematics", want="all", name="kernel"), tmp_path)
    q, qd, _ = mechanism.motion([0.0])
    status, found = compiled(q=q[0], qd=qd[0])
    assert status == 0
    assert np.abs(found["position"] - mechanism.poses(q).position[0][:, : found["position"].shape[-1]]).max() < 1e-9


def test_a_mass_below_zero_is_named() -> None:
    """Where the law of a payload's mass falls below zero there are no forces, and it is said whose mass that is."""
    scene = four(mass={"law": "constant-rate", "start": 1.0, "rate": -2.0})
    scene["time"] = {"end": 1.0, "samples": 11}
    run = linkdyn.Scene(scene).inverse()
    assert run.status.values[:5].tolist() == [0] * 5 and (run.status.values[6:] == 4).all()
    assert run.attrs["failure"].endswith("payload on 'coupler.hold' has a mass below zero")
