"""Rods between two balls: their idle spin is found, told and settled; forces are those of a rod that is free to spin."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import mpmath
import numpy as np
import pytest

pytestmark = pytest.mark.accuracy

ROOT = Path(__file__).resolve().parents[2]
CRANK, ROD, ROCKER = "0.2", "0.9", "0.6"     # [m]
PIVOT, AXIS = ("0.5", "0.2", "0.3"), ("1", "0.2", "0")   # of the rocker


def rssr(**rod: Any) -> dict[str, Any]:
    """Crank, rod between two balls, rocker about a skew axis. ``rod``: keys of the rod that are to be otherwise."""
    r, length, rocker = float(CRANK), float(ROD), float(ROCKER)
    return {
        "title": "RSSR", "space": "spatial", "gravity": [0.0, 0.0, -9.81],
        "frame": {"markers": {"A": [0.0, 0.0, 0.0], "D": {"at": [float(x) for x in PIVOT], "axis": [float(x) for x in AXIS]}}},
        "link": [
            {"name": "crank", "mass": 1.0, "cog": [r / 2, 0.0, 0.0], "inertia": {"diagonal": [0.001, 0.004, 0.004]},
             "markers": {"A": [0.0, 0.0, 0.0], "B": [r, 0.0, 0.0]}},
            {"name": "rod", "mass": 2.0, "cog": [0.4, 0.0, 0.0], "inertia": {"diagonal": [0.05, 0.2, 0.2]},
             "markers": {"B": [0.0, 0.0, 0.0], "C": [length, 0.0, 0.0]}, **rod},
            {"name": "rocker", "mass": 1.5, "cog": [rocker / 2, 0.0, 0.0], "inertia": {"diagonal": [0.001, 0.05, 0.05]},
             "markers": {"D": [0.0, 0.0, 0.0], "C": [rocker, 0.0, 0.0]}},
        ],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]},
            {"name": "B", "type": "spherical", "between": ["crank.B", "rod.B"]},
            {"name": "C", "type": "spherical", "between": ["rod.C", "rocker.C"]},
            {"name": "D", "type": "revolute", "between": ["frame.D", "rocker.D"], "start": "90 deg"},
        ],
        "coordinate": [{"joint": "A", "motion": {"law": "constant-rate", "rate": "60 rpm"}}],
        "actuator": [{"joint": "A"}],
        "time": {"end": 1.0, "samples": 201},
    }


def torque_by_lagrange(angles: np.ndarray, rate: float) -> np.ndarray:
    """The crank's torque at a constant rate by Lagrange's equation in 40 digits: no reactions, no joints, no rotations of the rod.

    Twice the kinetic energy is M(angle) rate**2; the torque M'/2 rate**2 + V'.
    """
    with mpmath.workdps(40):
        m = mpmath.mpf
        r, length, rocker = m(CRANK), m(ROD), m(ROCKER)
        pivot, axis = (mpmath.matrix([m(x) for x in v]) for v in (PIVOT, AXIS))
        z = axis / mpmath.norm(axis)
        # the marker's x: the world's x, turned by the smallest rotation from the world's z to the axis
        x = mpmath.matrix([1 - z[0] ** 2 / (1 + z[2]), -z[0] * z[1] / (1 + z[2]), -z[0]])
        y = mpmath.matrix([z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]])
        dot = lambda a, b: sum(p * q for p, q in zip(a, b))

        def places(t: Any) -> tuple[Any, Any, Any]:
            b = mpmath.matrix([r * mpmath.cos(t), r * mpmath.sin(t), 0])
            d = pivot - b
            u, v = 2 * rocker * dot(d, x), 2 * rocker * dot(d, y)
            w = (length**2 - rocker**2 - dot(d, d)) / mpmath.hypot(u, v)
            # of the two angles of the rocker, as a point on the circle, that nearer to 90 degrees at angle 0
            p = mpmath.atan2(v, u) + side * mpmath.acos(w)
            return b, pivot + rocker * (x * mpmath.cos(p) + y * mpmath.sin(p)), p

        def mass_and_height(t: Any) -> tuple[Any, Any]:
            h = m(10) ** -13
            before, now, after = (places(t + k * h) for k in (-1, 0, 1))
            vb, vc, rate_d = ((p - q) / (2 * h) for p, q in zip(after, before))
            b, c, _ = now
            part = m("0.4") / length
            vg = vb + part * (vc - vb)
            turn = vc - vb                            # square to the rod: its angular velocity times its length
            total = (m("0.004") + m(1) * (r / 2) ** 2 + 2 * dot(vg, vg) + m("0.2") * dot(turn, turn) / length**2
                     + (m("0.05") + m("1.5") * (rocker / 2) ** 2) * rate_d**2)
            height = m(1) * b[2] / 2 + 2 * (b + part * (c - b))[2] + m("1.5") * (pivot + c)[2] / 2
            return total, m("9.81") * height

        near = lambda s: abs(mpmath.expj(s) - mpmath.expj(mpmath.pi / 2))
        side = 1
        other = places(m(0))[2]
        side = -1
        side = 1 if near(other) < near(places(m(0))[2]) else -1
        torque = []
        for t in angles:
            h = m(10) ** -8
            (m1, v1), (m2, v2) = (mass_and_height(m(float(t)) + k * h) for k in (-1, 1))
            torque.append(float(((m2 - m1) / 2 * m(rate) ** 2 + v2 - v1) / (2 * h)))
        return np.array(torque)


def test_rssr_by_lagrange() -> None:
    """The torque of a turning RSSR loop, by an energy that knows the rod's ends only: its spin and its inertia about itself do
    not come into it."""
    run = linkdyn.Scene(rssr()).inverse()
    assert np.all(run.status == 0)
    pick = slice(0, None, 20)
    expected = torque_by_lagrange(run.q.values[pick, 0], 2 * np.pi)
    # differences of 40 digits leave 16
    np.testing.assert_allclose(run.driving_force.values[pick, 0], expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_balls_take_no_moment() -> None:
    """Whatever the solver; power balances without the moment that holds the spin."""
    scene = linkdyn.Scene(rssr())
    runs = [scene.inverse(solver=solver) for solver in ("elimination", "lapack", "gauss-jordan")]
    for run in runs:
        assert np.all(run.reaction.sel(joint=["B", "C"], component=["Mx", "My", "Mz"]) == 0)
        assert np.abs(run.power_imbalance).max() < 1e-12
        assert np.abs(run.reaction - runs[0].reaction).max() < 1e-12 * np.abs(runs[0].reaction).max()


def test_a_rod_that_really_spins() -> None:
    """The same loop with a hinge in the rod along itself, its spin a coordinate with inertia that nothing drives: from rest the
    crank moves alike, and the balls' forces are the same."""
    held = rssr()
    held["coordinate"] = [{"joint": "A", "start": {"position": 0.0}}]
    held["actuator"] = [{"joint": "A", "law": {"type": "constant", "value": 3.0}}]
    free = copy.deepcopy(held)
    free["link"].append({"name": "core", "mass": 0.0, "markers": {
        "B": {"at": [0.0, 0.0, 0.0], "axis": [0.0, 1.0, 0.0]}, "S": {"at": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0]}}})
    free["link"][1]["markers"]["S"] = {"at": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0]}
    free["joint"][1] = {"name": "B", "type": "universal", "between": ["crank.B", "core.B"]}
    free["joint"].append({"name": "spin", "type": "revolute", "between": ["core.S", "rod.S"]})
    free["coordinate"].append({"joint": "spin", "start": 0.0})
    t = np.linspace(0.0, 1.0, 21)
    ours, theirs = (linkdyn.Scene(scene).forward(t=t, rtol=1e-11, atol=1e-11) for scene in (held, free))
    assert np.ptp(ours.q.values[:, 0]) > 1.0
    assert np.ptp(theirs.q.values[:, 1]) > 0.01       # it spins against the crank's universal joint
    np.testing.assert_allclose(ours.q.values[:, 0], theirs.q.values[:, 0], rtol=0, atol=1e-8)
    forces = [run.reaction.sel(joint="C", component=["Fx", "Fy", "Fz"]).values for run in (ours, theirs)]
    np.testing.assert_allclose(*forces, rtol=0, atol=1e-7 * np.abs(forces[0]).max())


def test_both_engines_and_any_order() -> None:
    """Batches follow the record, single samples the lanes; mixed up, samples give what they gave."""
    scene = linkdyn.Scene(rssr())
    q, qd, qdd = scene.motion()
    order = np.random.default_rng(5).permutation(len(q))
    straight = scene.inverse(q=q, qd=qd, qdd=qdd)
    mixed = scene.inverse(q=q[order], qd=qd[order], qdd=qdd[order])
    scale = np.abs(straight.driving_force).max().item()
    assert np.all(straight.status == 0) and np.all(mixed.status == 0)
    np.testing.assert_allclose(mixed.driving_force.values, straight.driving_force.values[order], rtol=0, atol=1e-11 * scale)
    for k in (0, 57, 140):
        one = scene.inverse(q=q[k:k + 1], qd=qd[k:k + 1], qdd=qdd[k:k + 1], solver="lapack")
        assert one.driving_force.item() == pytest.approx(straight.driving_force.values[k, 0], abs=1e-11 * scale)


def test_forward_after_inverse() -> None:
    """The torque of inverse dynamics leads the loop back along the motion."""
    scene = linkdyn.Scene(rssr())
    t = np.linspace(0.0, 1.0, 11)
    run = scene.forward(t=t, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(run.q.values[:, 0], 2 * np.pi * t, rtol=0, atol=1e-6)


def with_legs(legs: str) -> dict[str, Any]:
    """Tsai's platform, its legs written joint by joint: "SPS" (both halves spin as one) or "SCS" (each on its own)."""
    scene = tomllib.loads((ROOT / "examples" / "stewart_tsai" / "scene.toml").read_text())
    chain = scene.pop("chain")[0]
    scene["joint"], scene["actuator"] = [], []
    for i in range(6):
        for half, end in (("lower", "U"), ("upper", "S")):
            scene["link"].append({"name": f"leg{i + 1}.{half}", **chain[half], "markers": {end: [0.0] * 3, "P": [0.0] * 3}})
        middle = "prismatic" if legs == "SPS" else "cylindrical"
        scene["joint"] += [
            {"name": f"leg{i + 1}.U", "type": "spherical", "between": [chain["base"][i], f"leg{i + 1}.lower.U"]},
            {"name": f"leg{i + 1}.P", "type": middle, "between": [f"leg{i + 1}.lower.P", f"leg{i + 1}.upper.P"],
             "start": 1.5 if legs == "SPS" else {"slide": 1.5}},
            {"name": f"leg{i + 1}.S", "type": "spherical", "between": [f"leg{i + 1}.upper.S", chain["platform"][i]]},
        ]
        scene["actuator"].append({"joint": f"leg{i + 1}.P"} | ({} if legs == "SPS" else {"variable": "slide"}))
    return scene


@pytest.mark.parametrize("legs", ["SPS", "SCS"])
def test_hexapod_on_balls(legs: str) -> None:
    """Legs of thin rods: universal joints at their feet take no moment about the leg, so balls there change no drive's force."""
    theirs = linkdyn.Scene(tomllib.loads((ROOT / "examples" / "stewart_tsai" / "scene.toml").read_text())).inverse()
    scene = linkdyn.Scene(with_legs(legs))
    ours = scene.inverse()
    assert np.all(ours.status == 0)
    spins = ours.attrs["idle_spins"].split()
    assert spins == [f"leg{i}.lower+leg{i}.upper" for i in range(1, 7)] if legs == "SPS" else len(spins) == 12
    scale = np.abs(theirs.driving_force).max().item()
    np.testing.assert_allclose(ours.driving_force.values, theirs.driving_force.values, rtol=0, atol=1e-12 * scale)
    assert np.all(ours.reaction.sel(component=["Mx", "My", "Mz"], joint=[f"leg{i}.{j}" for i in range(1, 7) for j in "US"]) == 0)
    if legs == "SPS":
        assert scene.explain().count("UPS leg") == 6


def test_piston_on_a_ball() -> None:
    """RSSC: the rod between its balls spins, and so does the piston in its cylindrical joint. A piston that slides and cannot turn
    takes no moment about itself: the same torque at the crank."""
    def scene(kind: str) -> dict[str, Any]:
        made = rssr()
        made["frame"]["markers"]["D"] = {"at": [0.0, 0.1, 0.1], "axis": [1.0, 0.0, 0.0]}
        made["link"][2] = {"name": "piston", "mass": 1.5, "cog": [0.0, 0.0, 0.1], "inertia": {"diagonal": [0.01, 0.01, 0.004]},
                           "markers": {"D": [0.0, 0.0, 0.0], "C": [0.0, 0.0, 0.0]}}
        made["joint"][2]["between"] = ["rod.C", "piston.C"]
        made["joint"][3] = {"name": "D", "type": kind, "between": ["frame.D", "piston.D"],
                            "start": 0.9 if kind == "prismatic" else {"slide": 0.9}}
        return made

    turning, sliding = (linkdyn.Scene(scene(kind)).inverse() for kind in ("cylindrical", "prismatic"))
    assert set(turning.attrs["idle_spins"].split()) == {"rod", "piston"}
    assert sliding.attrs["idle_spins"] == "rod"
    assert np.all(turning.status == 0) and np.all(sliding.status == 0)
    scale = np.abs(sliding.driving_force).max().item()
    np.testing.assert_allclose(turning.driving_force.values, sliding.driving_force.values, rtol=0, atol=1e-11 * scale)


@pytest.mark.parametrize(("rod", "load", "why"), [
    ({"cog": [0.4, 0.003, 0.0]}, None, "the centre of mass of 'rod' is 0.003 m off it"),
    ({"inertia": {"diagonal": [0.05, 0.2, 0.19]}}, None, "the moments of inertia of 'rod' across it are not the same"),
    ({}, {"on": "rod.C", "moment": [0.0, 0.0, 1.0]}, "a load on 'rod.C' has a moment"),
    ({}, {"on": "rod.C", "axes": "link", "force": [1.0, 2.0, 0.0]}, "a load on 'rod.C' has a force across it"),
    ({"markers": {"B": [0.0] * 3, "C": [0.9, 0.0, 0.0], "E": [0.5, 0.1, 0.0]}}, {"on": "rod.E", "force": [0.0, 0.0, 1.0]},
     "a load on 'rod.E' acts off it"),
])
def test_a_spin_that_matters_is_refused(rod: dict[str, Any], load: dict[str, Any] | None, why: str) -> None:
    """What would be a wrong force is a line that says why."""
    scene = rssr(**rod)
    if load is not None:
        scene["load"] = [load]
    with pytest.raises(linkdyn.SceneError) as refused:
        linkdyn.Scene(scene)
    message = str(refused.value)
    assert "link 'rod' may spin about the line of its joints 'B' and 'C', and forces depend on how it does: " + why in message
    assert "\n" not in message


@pytest.mark.parametrize("is_steady", [True, False])
def test_a_load_along_a_line_across_the_links_axes(is_steady: bool) -> None:
    """A rod drawn along (1, 2, 2) in its axes, pushed along itself, is as one along x; refused, and told, once a component is out of proportion."""
    def law(size: float, mean: float = 1.0) -> Any:
        return 50 * size * mean if is_steady else {"law": "harmonic", "mean": 10 * size * mean, "amplitude": 30 * size, "frequency": "3 Hz"}

    straight = rssr()
    straight["load"] = [{"on": "rod.C", "axes": "link", "force": [law(1.0), 0.0, 0.0]}]
    d = np.array([1.0, 2.0, 2.0]) / 3
    inertia = 0.2 * np.eye(3) - 0.15 * np.outer(d, d)
    oblique = rssr(cog=(0.4 * d).tolist(), inertia=inertia[[0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]].tolist(),
                   markers={"B": [0.0] * 3, "C": (float(ROD) * d).tolist()})
    oblique["load"] = [{"on": "rod.C", "axes": "link", "force": [law(float(part)) for part in d]}]
    one, other = linkdyn.Scene(straight).inverse(), linkdyn.Scene(oblique).inverse()
    assert not one.status.any() and not other.status.any()
    np.testing.assert_allclose(other.driving_force.values, one.driving_force.values, atol=1e-11 * np.abs(one.driving_force.values).max())
    oblique["load"][0]["force"][2] = law(float(d[2]), mean=2.0)
    with pytest.raises(linkdyn.SceneError, match=r"a load on 'rod.C' has a force across it"):
        linkdyn.Scene(oblique)


def welded(parts: int = 2, **tip: Any) -> dict[str, Any]:
    """The rod in parts that are welded together, each with axes of its own. ``tip``: keys of the last that are to be otherwise."""
    scene = rssr()
    b, c = float(ROD) / 3, 2 * float(ROD) / 3
    first = {"name": "rod", "mass": 1.2, "cog": [0.1, 0.0, 0.0], "inertia": {"diagonal": [0.01, 0.02, 0.02]},
             "markers": {"B": [0.0, 0.0, 0.0], "W": {"at": [b, 0.0, 0.0], "axis": [1.0, 0.0, 0.0]}}}
    last = {"name": "tip", "mass": 0.8, "cog": [0.0, 0.0, 0.2], "inertia": {"diagonal": [0.03, 0.03, 0.002]},
            "markers": {"W": {"at": [0.0, 0.0, -0.1], "axis": [0.0, 0.0, 1.0]}, "C": [0.0, 0.0, c - 0.1]}, **tip}
    middle = {"name": "sleeve", "mass": 0.0, "markers": {"W": {"at": [0.0, 0.3, 0.0], "axis": [0.0, 1.0, 0.0]}, "V": {"at": [0.0, 0.3, 0.0], "axis": [0.0, 1.0, 0.0]}}}
    weld = {"name": "W", "type": "fixed", "between": ["rod.W", "tip.W"]}
    scene["link"][1:2] = [first, last] if parts == 2 else [first, middle, last]
    scene["joint"][2]["between"][0] = "tip.C"
    scene["joint"].append(weld if parts == 2 else weld | {"between": ["sleeve.W", "rod.W"]})
    if parts == 3:
        scene["joint"].append({"name": "V", "type": "fixed", "between": ["tip.W", "sleeve.V"]})
    return scene


@pytest.mark.parametrize("parts", [2, 3])
def test_a_rod_of_welded_parts(parts: int) -> None:
    """It spins as one, and is told so; forces are those of the same rod in one piece."""
    at = np.array([0.1, float(ROD) / 3 + 0.3])           # centres of mass, on the line
    mass = np.array([1.2, 0.8])
    cog = mass @ at / mass.sum()
    across = 0.02 + 0.03 + mass @ (at - cog) ** 2
    whole = linkdyn.Scene(rssr(mass=2.0, cog=[cog, 0.0, 0.0], inertia={"diagonal": [0.012, across, across]})).inverse()
    scene = linkdyn.Scene(welded(parts))
    run = scene.inverse()
    assert (run.status == 0).all() and set(run.attrs["idle_spins"].split("+")) == ({"rod", "tip"} if parts == 2 else {"rod", "sleeve", "tip"})
    assert "Idle spins" in scene.explain()
    scale = np.abs(whole.driving_force).max().item()
    np.testing.assert_allclose(run.driving_force.values, whole.driving_force.values, rtol=0, atol=1e-11 * scale)
    np.testing.assert_allclose(run.reaction.sel(joint=["B", "C"]).values, whole.reaction.sel(joint=["B", "C"]).values, rtol=0,
                               atol=1e-11 * np.abs(whole.reaction).max().item())
    assert np.abs(run.power_imbalance).max() < 1e-12


def test_welded_parts_that_feel_their_spin() -> None:
    with pytest.raises(linkdyn.SceneError) as refused:
        linkdyn.Scene(welded(cog=[0.0, 0.003, 0.2]))
    assert "links 'rod', 'tip' may spin about the line of their joints 'B' and 'C', and forces depend on how it does" in str(refused.value)
    assert "the centre of mass of 'tip' is 0.003 m off it" in str(refused.value)


def test_loads_on_the_line_do_not_matter() -> None:
    """A load on the rod's line is a load as any other: power balances, virtual work agrees."""
    scene = rssr(markers={"B": [0.0] * 3, "C": [0.9, 0.0, 0.0], "E": [0.5, 0.0, 0.0]})
    scene["load"] = [{"on": "rod.E", "force": [3.0, -20.0, 10.0]}, {"on": "rod.C", "axes": "link", "force": [50.0, 0.0, 0.0]}]
    scene["spring"] = [{"name": "s", "between": ["frame.D", "rod.E"], "stiffness": 100.0, "rest": 0.1}]
    made = linkdyn.Scene(scene)
    run, reduced = made.inverse(), made.inverse(solver="reduced")
    assert np.abs(run.power_imbalance).max() < 1e-12
    assert np.abs(run.driving_force - reduced.driving_force).max() < 1e-12 * np.abs(run.driving_force).max()
    assert np.abs(run.driving_force - linkdyn.Scene(rssr()).inverse().driving_force).max() > 1.0


def swash_pump() -> dict[str, Any]:
    """Three pistons of an axial pump, each with its shoe on the swash plate."""
    tilt, reach = 0.3, 0.04
    around = [2 * np.pi * k / 3 for k in range(3)]
    return {
        "space": "spatial", "gravity": [0, 0, -9.81], "time": {"end": 0.04, "samples": 201},
        "frame": {"markers": {"O": [0, 0, 0], "plate": {"at": [0, 0, 0.1], "axis": [-np.sin(tilt), 0, np.cos(tilt)]}}},
        "link": [
            {"name": "barrel", "mass": 3.0, "inertia": [0.01, 0.01, 0.008, 0, 0, 0],
             "markers": {"O": [0, 0, 0]} | {f"B{k}": [reach * np.cos(a), reach * np.sin(a), 0] for k, a in enumerate(around)}},
            *({"name": f"piston{k}", "mass": 0.1, "inertia": [1e-5, 1e-5, 3e-6, 0, 0, 0], "markers": {"B": [0, 0, 0], "S": [0, 0, 0.08]}} for k in range(3)),
            *({"name": f"shoe{k}", "mass": 0.02, "inertia": [1e-6, 1e-6, 1.5e-6, 0, 0, 0], "markers": {"S": [0, 0, 0], "P": [0.003, 0.001, 0.005]}} for k in range(3)),
        ],
        "joint": [
            {"name": "shaft", "type": "revolute", "between": ["frame.O", "barrel.O"]},
            *({"name": f"B{k}", "type": "prismatic", "between": [f"barrel.B{k}", f"piston{k}.B"]} for k in range(3)),
            *({"name": f"S{k}", "type": "spherical", "between": [f"piston{k}.S", f"shoe{k}.S"]} for k in range(3)),
            *({"name": f"P{k}", "type": "planar", "between": ["frame.plate", f"shoe{k}.P"]} for k in range(3)),
        ],
        "coordinate": [{"joint": "shaft", "motion": {"law": "constant-rate", "rate": "1500 rpm"}}],
        "actuator": [{"joint": "shaft"}],
        "load": [{"on": f"piston{k}.B", "force": [0, 0, 1000.0 * (k + 1)]} for k in range(3)],
    }  # fmt: skip


def test_shoes_on_a_swash_plate() -> None:
    """A shoe with a ball may turn on its plane: it does not, and pistons and torque are those of the tilted plane."""
    scene = linkdyn.Scene(swash_pump())
    run = scene.inverse(want="all")
    assert (run.status == 0).all() and run.attrs["idle_spins"] == "shoe0 shoe1 shoe2"
    turn = run.q.values[:, 0]
    torque = np.zeros_like(turn)
    for k in range(3):
        angle = turn + 2 * np.pi * k / 3
        slope, bend = -0.04 * np.tan(0.3) * np.sin(angle), -0.04 * np.tan(0.3) * np.cos(angle)
        push = 0.12 * (bend * (50 * np.pi) ** 2 + 9.81) - 1000.0 * (k + 1)
        torque += push * slope
        rate = run.joint_rate.sel(variable=f"B{k}.slide").values
        np.testing.assert_allclose(rate, slope * 50 * np.pi, atol=1e-11)
        # The plate pushes along its normal: what moves the piston is a part of that.
        plate = run.reaction.sel(joint=f"P{k}").values[:, :3]
        np.testing.assert_allclose(plate[:, 2], push, atol=1e-9)
        np.testing.assert_allclose(plate[:, 0], -np.tan(0.3) * push, atol=1e-9)
    np.testing.assert_allclose(run.driving_force.values[:, 0], torque, atol=1e-10)
    np.testing.assert_allclose(scene.inverse(solver="reduced").driving_force, run.driving_force, atol=1e-10)
    # A friction of the shoe would have to know how it turns.
    rubs = swash_pump() | {"friction": [{"joint": "P0", "coulomb": 0.1}]}
    with pytest.raises(linkdyn.SceneError, match="friction at joint 'P0' holds it back"):
        linkdyn.Scene(rubs)


def test_piston_and_shoe_both_spin() -> None:
    """Piston and shoe meet at one ball: the bore holds the one spin, the ball the other; forces are those of pistons that cannot spin."""
    loose = swash_pump()
    for k in range(3):
        loose["joint"][1 + k] |= {"type": "cylindrical", "start": {"angle": 0.5, "slide": 0.01}}
    scene = linkdyn.Scene(loose)
    held = linkdyn.Scene(swash_pump()).inverse(want="all")
    np.testing.assert_allclose(scene.inverse(solver="reduced").driving_force, held.driving_force, atol=1e-10)
    for solver in ("elimination", "lapack"):
        run = scene.inverse(want="all", solver=solver)
        assert (run.status == 0).all() and set(run.attrs["idle_spins"].split()) == {f"{part}{k}" for part in ("piston", "shoe") for k in range(3)}
        np.testing.assert_allclose(run.driving_force, held.driving_force, atol=1e-10)
        # where a shoe's marker is depends on how it spins, and so do moments about it
        np.testing.assert_allclose(run.reaction[..., :3], held.reaction[..., :3], atol=1e-8)
        np.testing.assert_allclose(run.reaction[:, :7], held.reaction[:, :7], atol=1e-8)
        for k in range(3):
            np.testing.assert_allclose(run.joint_variable.sel(variable=f"B{k}.slide"), held.joint_variable.sel(variable=f"B{k}.slide"), atol=1e-14)
            along = run.reaction.sel(joint=f"B{k}").values[:, 5]        # a bore takes no moment about itself
            assert np.abs(along).max() < 1e-11
    assert "cylindrical 2 forces, 2 moments, an idle spin held by no moment" in scene.explain()
    # A slide that is a coordinate keeps its joint: the ball holds one spin, and nothing the other.
    loose["coordinate"] = [{"joint": "B0", "variable": "slide"}]
    with pytest.raises(linkdyn.SceneError, match="link 'shoe0' may spin .* and so may 'piston0' on the other side of 'S0': neither is determined|link 'piston0' may spin"):
        linkdyn.Scene(loose)


def test_swash_plate_through_zero() -> None:
    """Where the plate is level piston and shoe spin about the same line: torques of barrel and plate by Lagrange in 40 digits."""
    data = swash_pump()
    plate = data["frame"]["markers"].pop("plate")
    data["frame"]["markers"]["T"] = {"at": plate["at"], "axis": [0, -1, 0]}
    data["link"].append({"name": "plate", "mass": 1.0, "inertia": [2e-3, 3e-3, 4e-3, 0, 0, 0],
                         "markers": {"T": {"at": [0, 0, 0], "axis": [0, -1, 0]}, "face": [0, 0, 0]}})
    data["joint"] += [{"name": "tilt", "type": "revolute", "between": ["frame.T", "plate.T"]}]
    for k in range(3):
        data["joint"][1 + k] |= {"type": "cylindrical"}
        data["joint"][7 + k]["between"][0] = "plate.face"
    rate = 50 * mpmath.pi
    data["coordinate"].append({"joint": "tilt", "motion": {"law": "harmonic", "amplitude": 0.3, "frequency": "80 rad/s"}})
    data["actuator"].append({"joint": "tilt"})
    run = linkdyn.Scene(data).inverse(want="all")
    assert (run.status == 0).all() and np.abs(run.q.values[:, 1]).min() < 1e-12       # the start stands level
    with mpmath.workdps(40):
        r, about, own = mpmath.mpf("0.04"), mpmath.mpf("0.1"), mpmath.mpf("0.005")

        def height(k: int, a: Any, b: Any) -> Any:          # of the ball's centre: the shoe's foot is 5 mm off it
            return about + (mpmath.sin(b) * r * mpmath.cos(a + 2 * mpmath.pi * k / 3) - own) / mpmath.cos(b)

        def energy(a: Any, b: Any, va: Any, vb: Any) -> Any:
            rise = [mpmath.diff(lambda s, k=k: height(k, a + s * va, b + s * vb), 0) for k in range(3)]
            # pistons turn about themselves without inertia, shoes tilt with the plate
            return (mpmath.mpf("0.008") * va**2 + (mpmath.mpf("3e-3") + 3 * mpmath.mpf("1e-6")) * vb**2 + mpmath.mpf("0.12") * sum(v**2 + r**2 * va**2 for v in rise)) / 2

        def potential(a: Any, b: Any) -> Any:
            return sum((mpmath.mpf("0.12") * mpmath.mpf("9.81") - 1000 * (k + 1)) * height(k, a, b) for k in range(3))

        for i in (0, 37, 111, 200):
            t = mpmath.mpf(float(run.time[i]))
            at = lambda s: (rate * s, mpmath.mpf("0.3") * mpmath.sin(80 * s))
            speed = lambda s: (rate, 24 * mpmath.cos(80 * s))
            for c in range(2):
                def momentum(s: Any, c: int = c) -> Any:
                    v = list(speed(s))
                    return mpmath.diff(lambda x: energy(*at(s), *[x if n == c else v[n] for n in range(2)]), v[c])
                place = list(at(t))
                lift = mpmath.diff(lambda x: energy(*[x if n == c else place[n] for n in range(2)], *speed(t)) - potential(*[x if n == c else place[n] for n in range(2)]), place[c])
                assert abs(float(mpmath.diff(momentum, t) - lift) - float(run.driving_force[i, c])) < 1e-8 * np.abs(run.driving_force.values).max()


def test_spins_are_told() -> None:
    """By `explain` and in the results; a scene without any says nothing."""
    scene = linkdyn.Scene(rssr())
    words = scene.explain()
    assert "Idle spins" in words and "rod about the line through its joints" in words
    assert "spherical   3 forces, an idle spin held by no moment" in words
    assert "universal" not in words
    assert scene.inverse().attrs["idle_spins"] == "rod"
    fixed = rssr()
    fixed["joint"][1]["type"] = "universal"
    fixed["link"][0]["markers"]["B"] = {"at": [float(CRANK), 0.0, 0.0], "axis": [0.0, 0.0, 1.0]}
    fixed["link"][1]["markers"]["B"] = {"at": [0.0, 0.0, 0.0], "axis": [0.0, 1.0, 0.0]}
    scene = linkdyn.Scene(fixed)
    assert "Idle spins" not in scene.explain()
    assert "idle_spins" not in scene.inverse().attrs
