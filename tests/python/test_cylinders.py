"""Hydraulic cylinders whose pressures are states: against an independent program, closed forms and the balance of power."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn import cycle, efforts
from linkdyn._cycle import gas
from scipy.integrate import solve_ivp

pytestmark = pytest.mark.accuracy

M, BORE, ROD, DEAD, BETA, SUPPLY, TANK, FLOW, DROP, LAMINAR = 900.0, 0.08, 0.045, (2e-4, 3e-4), 1.4e9, 180e5, 4e5, 1e-3, 35e5, 1e5
AREA = (math.pi / 4 * BORE**2, math.pi / 4 * (BORE**2 - ROD**2))
SHORT, LONG = 0.6, 1.1
CRANE = Path(__file__).parents[2] / "examples" / "loader_crane" / "scene.toml"
KEYS = {
    "bore": BORE, "rod": ROD, "stroke": [SHORT, LONG], "dead_volumes": [*DEAD], "bulk_modulus": "1.4 GPa", "supply": "180 bar", "tank": "4 bar",
    "valve": {"flow": "60 litre/min", "drop": "35 bar"},
}  # fmt: skip


def machine(opening: Any = "0.5*step(time - 0.02 s)", *, start: float = 0.8, end: float = 0.2, samples: int = 201, inclined: float = 0.0, **keys: Any) -> dict[str, Any]:
    """A mass on a slide, up the incline, that a cylinder pushes; a damper is on the slide besides."""
    axis = [math.cos(inclined), math.sin(inclined)]
    return {
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"A": {"at": [0, 0], "axis": axis}}},
        "link": [{"name": "mass", "mass": M, "inertia": 1.0, "markers": {"O": {"at": [0, 0], "axis": axis}}}],
        "joint": [{"name": "A", "type": "prismatic", "between": ["frame.A", "mass.O"]}],
        "coordinate": [{"joint": "A", "start": {"position": start}}],
        "spring": [{"name": "oil", "joint": "A", "damping": 400}],
        "actuator": [{"joint": "A", "law": {"type": "valve", "value": opening}, "cylinder": {**KEYS, **keys}}],
        "time": {"end": end, "samples": samples},
    }  # fmt: skip


def edge(drop: float) -> float:
    """Flow over an edge that is wide open, its rated one at its rated drop."""
    return FLOW * drop / (drop**2 + LAMINAR**2) ** 0.25 * (DROP**2 + LAMINAR**2) ** 0.25 / DROP


def reference(opening: Any, start: np.ndarray, instants: np.ndarray, *, slope: float = 0.0, air: float = 0.0, leakage: float = 0.0) -> np.ndarray:
    """Place, speed, pressures by scipy, between kinks of the opening at the first of `instants` and its end."""

    def modulus(p: float) -> float:
        if air == 0:
            return BETA
        # of the volume that oil and air take, by a difference quotient: no formula of the engine
        def volume(p: float) -> float:
            return (1 - air) * math.exp(-p / BETA) + air * (101325 / (101325 + p)) ** (1 / 1.4)

        h = 1e-5 * (101325 + p)
        return -volume(p) * 2 * h / (volume(p + h) - volume(p - h))

    def rates(t: float, y: np.ndarray) -> list[float]:
        s, v, a, b = y
        u = opening(t)
        if u >= 0:
            qa, qb = u * edge(SUPPLY - a), -u * edge(b - TANK)
        else:
            qa, qb = u * edge(a - TANK), -u * edge(SUPPLY - b)
        lost = leakage * (a - b)
        va, vb = DEAD[0] + AREA[0] * (s - SHORT), DEAD[1] + AREA[1] * (LONG - s)
        force = a * AREA[0] - b * AREA[1]
        return [v, (force - 400 * v) / M - 9.81 * slope, modulus(a) / va * (qa - lost - AREA[0] * v), modulus(b) / vb * (qb + lost + AREA[1] * v)]

    scale = np.array([1e-9, 1e-9, 1e-2, 1e-2])
    found = solve_ivp(rates, (instants[0], instants[-1]), start, method="Radau", t_eval=instants, rtol=1e-10, atol=scale)
    assert found.success
    return found.y.T


@pytest.mark.parametrize(("keys", "sign"), [({}, 1), ({"leakage": "0.02 litre/min/bar"}, 1), ({"air": "2 %"}, 1), ({}, -1)])
@pytest.mark.parametrize("method", ["gbs", "seulex", "rkf45", "msbdf"])
def test_against_scipy(keys: dict[str, Any], sign: int, method: str) -> None:
    """Up an incline: the valve opens, one way or the other, shuts, and the mass rings on the oil."""
    slope = math.sin(0.4)
    scene = machine(f"{sign}*(0.3*step(time - 0.02 s) - 0.3*step(time - 0.12 s))", inclined=0.4, pressures=["60 bar", "20 bar"], **keys)
    run = linkdyn.Scene(scene).forward(method=method, rtol=1e-9, want="all")
    assert run.attrs["stopped"] == ""
    t = run.time.values
    y = np.array([0.8, 0.0, 60e5, 20e5])
    leakage = 0.02e-3 / 60 / 1e5 if "leakage" in keys else 0.0
    rows = [y[np.newaxis]]
    for first, last, u in ((0, 20, 0.0), (20, 120, 0.3 * sign), (120, 200, 0.0)):
        part = reference(lambda _, u=u: u, y, t[first : last + 1], slope=slope, air=0.02 if "air" in keys else 0.0, leakage=leakage)
        rows.append(part[1:])
        y = part[-1]
    exact = np.concatenate(rows)
    # tolerances of 1e-9 a step, over some hundred steps; forces are differences of pressures by area
    np.testing.assert_allclose(run.q.values[:, 0], exact[:, 0], rtol=0, atol=1e-7)
    np.testing.assert_allclose(run.qd.values[:, 0], exact[:, 1], rtol=0, atol=2e-6)
    np.testing.assert_allclose(run.cylinder_pressure.values[:, 0, :], exact[:, 2:], rtol=0, atol=2e2)
    force = exact[:, 2] * AREA[0] - exact[:, 3] * AREA[1]
    np.testing.assert_allclose(run.driving_force.values[:, 0], force, rtol=0, atol=2.0)
    assert run.cylinder_pressure.attrs["units"] == "Pa" and run.cylinder_flow.attrs["units"] == "m3/s"
    assert list(run.chamber.values) == ["head", "rod"] and list(run.cylinder.values) == ["A"]


def test_natural_frequency() -> None:
    """With the valve shut, small oscillations about the equilibrium have the frequency of the oil's springs."""
    middle = 0.85
    scene = machine(0.0, start=middle + 2e-5, end=0.5, samples=2001, pressures=[40e5, 40e5 * AREA[0] / AREA[1]])
    scene["spring"] = []
    scene["coordinate"][0]["start"]["position"] = middle
    scene["coordinate"][0]["start"]["velocity"] = 2e-4
    run = linkdyn.Scene(scene).forward(method="gbs", rtol=1e-10)
    volumes = (DEAD[0] + AREA[0] * (middle - SHORT), DEAD[1] + AREA[1] * (LONG - middle))
    omega = math.sqrt(BETA * (AREA[0] ** 2 / volumes[0] + AREA[1] ** 2 / volumes[1]) / M)
    expected = middle + 2e-4 / omega * np.sin(omega * run.time.values)
    # amplitude 1.5 um: of the third order are (amplitude/length of oil)^2 over all the periods
    np.testing.assert_allclose(run.q.values[:, 0], expected, rtol=0, atol=2e-4 * 2e-4 / omega)


def test_begins_in_equilibrium() -> None:
    """Without a word about pressures a mass hangs at rest on its oil, and stays there."""
    run = linkdyn.Scene(machine(0.0, inclined=math.pi / 2, end=0.1)).forward()
    np.testing.assert_allclose(run.q.values, 0.8, rtol=0, atol=1e-9)
    a, b = run.cylinder_pressure.values[0, 0]
    assert a * AREA[0] - b * AREA[1] == pytest.approx(M * 9.81, rel=1e-9)
    assert a + b == pytest.approx(SUPPLY + TANK)


@pytest.mark.parametrize("opening", [0.3, -0.3])
def test_steady_speed(opening: float) -> None:
    """Speed at which the flows over both edges fit the areas, under the load: out of the orifice formula."""
    scene = machine(opening, start=0.7 if opening > 0 else 1.0, end=0.6, inclined=math.pi / 2)
    run = linkdyn.Scene(scene).forward()
    v, (a, b) = run.qd.values[-1, 0], run.cylinder_pressure.values[-1, 0]
    load = M * 9.81 + 400 * v
    gain = FLOW / math.sqrt(DROP)
    # p_a A_a - p_b A_b = load, with A v = u K sqrt(drop) at each edge
    if opening > 0:
        speed = opening * gain * math.sqrt((SUPPLY * AREA[0] - TANK * AREA[1] - load) / (AREA[0] ** 3 + AREA[1] ** 3))
    else:
        speed = opening * gain * math.sqrt((load - TANK * AREA[0] + SUPPLY * AREA[1]) / (AREA[0] ** 3 + AREA[1] ** 3))
    # the edges' flow differs from a root by (laminar drop/drop)^2/4
    assert v == pytest.approx(speed, rel=2e-3)
    np.testing.assert_allclose(run.cylinder_flow.values[-1, 0], [AREA[0] * v, -AREA[1] * v], rtol=2e-3)
    assert a * AREA[0] - b * AREA[1] == pytest.approx(load, rel=1e-3)


def test_balance_of_power() -> None:
    """What flows in under pressure is the work of the piston, what is stored in the oil, and what leaks."""
    run = linkdyn.Scene(machine("0.6*sin(40 rad/s*time)", end=0.3, samples=6001, inclined=0.4, leakage="0.05 litre/min/bar")).forward(method="seulex", rtol=1e-10, want="all")
    p, q, t, s = run.cylinder_pressure.values[:, 0], run.cylinder_flow.values[:, 0], run.time.values, run.q.values[:, 0]
    volume = np.stack([DEAD[0] + AREA[0] * (s - SHORT), DEAD[1] + AREA[1] * (LONG - s)], axis=1)
    leak = 0.05e-3 / 60 / 1e5 * (p[:, 0] - p[:, 1]) ** 2
    inflow = (p * q).sum(axis=1)
    # compression: V/B p dp in each chamber
    stored = np.concatenate([[0], np.cumsum((0.5 * (volume * p)[1:] + 0.5 * (volume * p)[:-1]) * np.diff(p, axis=0) / BETA, axis=0).sum(axis=1)])
    gained = np.concatenate([[0], np.cumsum(0.5 * (inflow - leak)[1:] * np.diff(t) + 0.5 * (inflow - leak)[:-1] * np.diff(t))])
    # trapezoidal rule of 50 us on an oscillation of some hundred rad/s: parts in 1e5
    np.testing.assert_allclose(run.work.values + stored, gained, rtol=0, atol=3e-5 * np.abs(gained).max())
    assert np.abs(stored).max() > 1.0
    # and on the other side the work is what mass, height and damper take
    np.testing.assert_allclose(run.power_imbalance.values, 0, atol=1e-9)


def test_mirrored() -> None:
    """A cylinder the other way round: the slide grows while the rod goes in."""
    one = linkdyn.Scene(machine()).forward()
    scene = machine(start=-0.8, stroke=[-SHORT, -LONG])
    other = linkdyn.Scene(scene).forward()
    np.testing.assert_allclose(other.q.values, -one.q.values, rtol=0, atol=1e-9)
    np.testing.assert_allclose(other.cylinder_pressure.values, one.cylinder_pressure.values, rtol=0, atol=10)


def test_work_of_a_crane() -> None:
    """The cylinder's work is what boom, load and cylinder gain, but for the air that all of them lack."""
    run = linkdyn.load(CRANE).forward(want="all")
    assert run.attrs["stopped"] == "" and (run.status == 0).all()
    energy = run.kinetic_energy.values + run.potential_energy.values
    np.testing.assert_allclose(energy - energy[0], run.work.values, rtol=0, atol=1e-6 * np.abs(run.work.values).max())
    area = np.pi / 4 * np.array([0.08**2, 0.08**2 - 0.05**2])
    np.testing.assert_allclose(run.cylinder_pressure.values[:, 0] @ [area[0], -area[1]], run.driving_force.values[:, 0], rtol=1e-12, atol=1e-6)


def test_a_crane_begins_in_equilibrium() -> None:
    """A cylinder that is no coordinate, with fewer drives than freedoms: its force by virtual work, and nothing moves until the valve opens."""
    scene = linkdyn.load(CRANE)
    run = scene.with_({"actuator.ram.P.cylinder.pressures": None, "actuator.ram.P.cylinder.leakage": None}).forward(t=np.linspace(0, 0.5, 6))

    def place(angle: float) -> np.ndarray:
        return np.array([1.4 * np.cos(angle) + 0.15 * np.sin(angle), 2.2 + 1.4 * np.sin(angle) - 0.15 * np.cos(angle)])

    def length(angle: float) -> float:
        return float(np.hypot(*(place(angle) - [0.35, 1.0])))

    def height(angle: float) -> float:
        along = (place(angle)[1] - 1.0) / length(angle)
        return 320 * 2.1 * np.sin(angle) + 900 * 4.5 * np.sin(angle) + 45 * (1 + 0.6 * along) + 30 * (place(angle)[1] - 0.5 * along)

    h, start = 1e-4, np.radians(10)
    force = 9.81 * (height(start + h) - height(start - h)) / (length(start + h) - length(start - h))
    assert run.driving_force.values[0, 0] == pytest.approx(force, rel=1e-6)
    assert run.cylinder_pressure.values[0, 0].sum() == pytest.approx(193e5)
    np.testing.assert_allclose(run.qd.values[:-1], 0, atol=1e-7)


def test_cylinders_side_by_side_share_the_start() -> None:
    """Two on one slide: of the forces that hold it each has the half."""
    scene = machine(0.0, inclined=math.pi / 2, end=0.05)
    scene["actuator"] = [{"joint": "A", "name": name, "law": {"type": "valve", "value": 0.0}, "cylinder": KEYS} for name in ("a", "b")]
    run = linkdyn.Scene(scene).forward()
    np.testing.assert_allclose(run.driving_force.values, M * 9.81 / 2, rtol=1e-7)
    np.testing.assert_allclose(run.q.values, 0.8, rtol=0, atol=1e-9)


def test_inverse_dynamics_asks_for_the_same_force() -> None:
    """A motion's pressures by inverse dynamics, and a run that has that motion by a table of the opening its flow asks for."""
    scene = machine(end=0.5, samples=501)
    scene["coordinate"][0] |= {"motion": {"law": "polynomial-345", "from": 0.8, "to": 0.9, "duration": "0.5 s"}}
    loaded = linkdyn.Scene(scene)
    run = loaded.inverse()
    found, by_keys = run.linkdyn.cylinder("A"), cycle.cylinder(run, "A", bore=BORE, rod=ROD, supply=SUPPLY, tank=TANK)
    for name in ("head_pressure", "rod_pressure", "head_flow", "rod_flow"):
        np.testing.assert_allclose(found[name].values, by_keys[name].values, rtol=1e-12)
    np.testing.assert_allclose(found.head_pressure * AREA[0] - found.rod_pressure * AREA[1], run.driving_force.values[:, 0], atol=1e-6)
    with pytest.raises(linkdyn.LinkdynError, match="no cylinder at 'A'"):
        cycle.cylinder(run, "A", linkdyn.Scene(machine() | {"actuator": [{"joint": "A"}]}))


def test_controller_at_the_valve() -> None:
    """A position loop on the valve: it comes to its target, its output within -1 to 1 without a word."""
    scene = machine(end=2.0)
    scene["actuator"][0].pop("law")
    scene["spring"][0]["damping"] = 3e4  # a loop of 6/s against an oscillation of 250 rad/s: less would not be stable
    scene["controller"] = [{"actuator": "A", "at": "valve", "target": "0.95 m", "kp": "20 1/m"}]
    run = linkdyn.Scene(scene).forward()
    assert run.q.values[-1, 0] == pytest.approx(0.95, abs=1e-5)
    assert run.controller_output.values[0, 0] == 1.0 and run.controller_output.attrs["units"] == "1"
    with pytest.raises(linkdyn.LinkdynError, match="no cylinder"):
        scene["actuator"][0].pop("cylinder")
        linkdyn.Scene(scene)


def test_ends_of_the_stroke() -> None:
    """Against a stop the head takes the supply's pressure; without one the run ends there, and says so."""
    scene = machine(1, end=2.0)
    run = linkdyn.Scene(scene).forward()
    assert "'A' has come to an end of its stroke" in run.attrs["stopped"]
    scene["stop"] = [{"name": "end", "joint": "A", "max": LONG, "restitution": 0}]
    run = linkdyn.Scene(scene).forward()
    assert run.attrs["stopped"] == ""
    assert run.q.values[-1, 0] == pytest.approx(LONG, abs=1e-9)
    np.testing.assert_allclose(run.cylinder_pressure.values[-1, 0], [SUPPLY, TANK], atol=1)


def test_oil_does_not_pull() -> None:
    """A valve shut too quickly draws the oil of a chamber apart: the run ends there, but for the air that fills it."""
    scene = machine("step(time - 0.02 s) - step(time - 0.12 s)", inclined=0.4)
    assert "would put the oil of a chamber under tension" in linkdyn.Scene(scene).forward().attrs["stopped"]
    scene["actuator"][0]["cylinder"]["air"] = 1e-3
    run = linkdyn.Scene(scene).forward()
    assert run.attrs["stopped"] == "" and -101325 < run.cylinder_pressure.values.min() < 0


@pytest.mark.parametrize(("scene", "told"), [
    (machine(start=0.2), "it starts at 0.2 m, which is not within the stroke"),
    (machine(inclined=1.5, supply="10 bar"), "which pressures between tank and supply do not give"),
])  # fmt: skip
def test_starts_that_are_none(scene: dict[str, Any], told: str) -> None:
    with pytest.raises(linkdyn.LinkdynError, match=told):
        linkdyn.Scene(scene).forward()


def test_simulator() -> None:
    """Openings in place of forces; pressures are told, set, and part of the state."""
    scene = linkdyn.Scene(machine(0.0, pressures=["60 bar", "20 bar"]))
    run = linkdyn.Scene(machine(0.4, end=0.05, samples=2, pressures=["60 bar", "20 bar"])).forward()
    with scene.simulator() as simulator:
        np.testing.assert_allclose(simulator.pressure, [[60e5, 20e5]])
        simulator.step(0.05, [0.4])
        assert simulator.q[0] == pytest.approx(run.q.values[-1, 0], abs=1e-8)
        np.testing.assert_allclose(simulator.pressure, run.cylinder_pressure.values[-1], atol=20)
        state = simulator.state
        simulator.step(0.02, [-0.3])
        there = simulator.pressure
        simulator.state = state
        simulator.step(0.02, [-0.3])
        np.testing.assert_array_equal(simulator.pressure, there)
        simulator.reset(pressure=[[10e5, 15e5]])
        np.testing.assert_allclose(simulator.pressure, [[10e5, 15e5]])
        simulator.reset()
        np.testing.assert_allclose(simulator.pressure, [[60e5, 20e5]])
        with pytest.raises(linkdyn.LinkdynError, match="pressure"):
            simulator.reset(pressure=[1e5, 2e5])


def test_ensemble() -> None:
    """Members hold their own starts, and move as single runs do."""
    t = np.linspace(0, 0.05, 6)
    starts = np.array([[0.7], [0.8], [0.95]])
    found = linkdyn.Scene(machine(0.3, inclined=0.4)).ensemble(starts, np.zeros((3, 1)), t, step=2e-5)
    for k, (start,) in enumerate(starts):
        run = linkdyn.Scene(machine(0.3, inclined=0.4, start=start)).forward(t=t)
        # of the fourth order in the step, times 250 rad/s: parts in 1e11
        np.testing.assert_allclose(found.q.values[k, :, 0], run.q.values[:, 0], rtol=0, atol=1e-9)


def test_builder_and_words() -> None:
    """The builder takes the table and its law as the file does."""
    builder = linkdyn.Builder("oil", space="planar", gravity=[0, -9.81])
    assert efforts.valve(0.4) == {"type": "valve", "value": 0.4}
    scene = linkdyn.Scene(machine())
    assert [cylinder["name"] for cylinder in scene.description["cylinders"]] == ["A"]
    assert "hydraulic cylinder" in scene.explain()
    assert builder is not None


def test_a_simulator_says_where_it_ends() -> None:
    """The cylinder that has come to an end of its stroke, by name."""
    with linkdyn.Scene(machine(0.0, start=1.0)).simulator() as simulator, pytest.raises(linkdyn.LinkdynError, match="'A' has come to an end of its stroke"):
        simulator.step(2.0, [1.0])


# ---------------------------------------------------------------- gas

GAS = {
    "bore": 0.063, "rod": 0.02, "stroke": [0.0, 0.4], "dead_volumes": ["40 cm^3", "60 cm^3"], "gas": {"exponent": 1.3}, "supply": "6 bar", "tank": 0,
    "valve": {"conductance": "3 litre/s/bar", "critical_ratio": 0.35},
}  # fmt: skip


def pneumatic(opening: Any, *, end: float = 0.4, **keys: Any) -> dict[str, Any]:
    """A mass of 20 kg that air pushes up an incline."""
    scene = machine(opening, start=0.1, end=end, inclined=0.4)
    scene["link"][0]["mass"] = 20.0
    scene["actuator"][0]["cylinder"] = {**GAS, **keys}
    return scene


def edge_of_gas(first: float, last: float) -> float:
    """Of ISO 6358, into the second from the first, absolute pressures; in the volume at 1 bar."""
    c, b, up, down = 3e-3 / 1e5, 0.35, max(first, last), min(first, last)
    ratio = min(down / up, 0.999)
    shape = 1.0 if ratio <= b else math.sqrt(1 - ((ratio - b) / (1 - b)) ** 2)
    if down / up > 0.999:
        shape *= (1 - down / up) / 1e-3
    return math.copysign(c * up * shape, first - last)


@pytest.mark.parametrize("method", ["gbs", "seulex"])
def test_gas_against_scipy(method: str) -> None:
    """The valve opens, the other way, and shuts; masses and heat of the gas by a program of its own: m = p V^(1/n) grows as gas flows in."""
    area = (math.pi / 4 * 0.063**2, math.pi / 4 * (0.063**2 - 0.02**2))
    opening = ((0, 50, 0.0), (50, 150, 0.4), (150, 220, -0.5), (220, 400, 0.0))
    scene = pneumatic("0.4*step(time - 0.05 s) - 0.9*step(time - 0.15 s) + 0.5*step(time - 0.22 s)", pressures=["1 bar", "0.6 bar"])
    scene["time"]["samples"] = 401
    run = linkdyn.Scene(scene).forward(method=method, rtol=1e-10)
    assert run.attrs["stopped"] == ""
    n, zero = 1.3, 101325.0

    def volumes(s: float) -> tuple[float, float]:
        return 40e-6 + area[0] * s, 60e-6 + area[1] * (0.4 - s)

    def rates(_: float, y: np.ndarray, u: float) -> list[float]:
        # states: place, speed, and w = p V^n of each chamber, which only flow changes: w' = n V^(n-1) pr Q
        s, v, *w = y
        volume = volumes(s)
        p = [w[k] / volume[k] ** n for k in (0, 1)]
        sides = (6e5 + zero, zero) if u >= 0 else (zero, 6e5 + zero)
        flow = [abs(u) * edge_of_gas(sides[k], p[k]) for k in (0, 1)]
        force = (p[0] - zero) * area[0] - (p[1] - zero) * area[1]
        return [v, (force - 400 * v) / 20 - 9.81 * math.sin(0.4), *(n * volume[k] ** (n - 1) * 1e5 * flow[k] for k in (0, 1))]

    y = np.array([0.1, 0.0, *((p + zero) * v**n for p, v in zip((1e5, 0.6e5), volumes(0.1), strict=True))])
    exact = [y]
    for first, last, u in opening:
        found = solve_ivp(rates, (first / 1e3, last / 1e3), y, "Radau", np.arange(first, last + 1) / 1e3, rtol=1e-10, atol=1e-12, args=(u,))
        exact += list(found.y.T[1:])
        y = found.y.T[-1]
    exact = np.array(exact)
    np.testing.assert_allclose(run.q.values[:, 0], exact[:, 0], rtol=0, atol=2e-8)
    for k in (0, 1):
        volume = np.array([volumes(s)[k] for s in exact[:, 0]])
        np.testing.assert_allclose(run.cylinder_pressure.values[:, 0, k], exact[:, 2 + k] / volume**n - zero, rtol=0, atol=1.0)


def test_gas_that_is_as_fast_as_sound() -> None:
    """At rest against a stop a chamber fills at a constant rate until the critical ratio: n pr C p/V."""
    scene = pneumatic(0.2, end=0.02, pressures=[0, "6 bar"])
    scene["coordinate"][0]["start"]["position"] = 0.0
    scene["stop"] = [{"name": "ends", "joint": "A", "min": 0, "max": 0.4, "restitution": 0}]
    run = linkdyn.Scene(scene).forward()
    rate = 1.3 / 40e-6 * 1e5 * 0.2 * 3e-3 / 1e5 * (6e5 + 101325)
    head, t = run.cylinder_pressure.values[:, 0, 0], run.time.values
    still = (head + 101325 < 0.35 * (6e5 + 101325)) & (np.abs(run.qd.values[:, 0]) < 1e-12)
    assert still.sum() > 5
    np.testing.assert_allclose(head[still], rate * t[still], rtol=1e-8, atol=1e-3)
    np.testing.assert_allclose(run.cylinder_flow.values[still, 0, 0], 0.2 * 3e-3 / 1e5 * (6e5 + 101325), rtol=1e-12)


def test_frequency_of_gas() -> None:
    """With the valve shut gas is a spring of n p A^2/V in each chamber."""
    area = (math.pi / 4 * 0.063**2, math.pi / 4 * (0.063**2 - 0.02**2))
    scene = pneumatic(0.0, end=1.0)
    scene["spring"] = []
    scene["coordinate"][0]["start"]["velocity"] = 1e-4
    run = linkdyn.Scene(scene).forward(rtol=1e-11)
    pressures = run.cylinder_pressure.values[0, 0] + 101325
    volumes = np.array([40e-6 + area[0] * 0.1, 60e-6 + area[1] * 0.3])
    omega = math.sqrt(1.3 * np.sum(pressures * np.square(area) / volumes) / 20)
    # amplitude a of some um: of second order are a^2/length of gas
    np.testing.assert_allclose(run.q.values[:, 0], 0.1 + 1e-4 / omega * np.sin(omega * run.time.values), rtol=0, atol=2e-4 * 1e-4 / omega)


def test_gas_flows_are_told_in_one_volume() -> None:
    """A piston that goes at a constant speed against a spring: what is asked for by hand, in the volume at 1 bar, filling included."""
    bore, speed, stiffness, exponent = 0.05, 0.2, 4000.0, 1.3
    scene = linkdyn.Scene({
        "space": "planar", "frame": {"markers": {"A": {"at": [0, 0], "axis": [1, 0]}}},
        "link": [{"name": "piston", "markers": {"A": {"at": [0, 0], "axis": [1, 0]}}, "mass": 2}],
        "joint": [{"name": "A", "type": "prismatic", "between": ["frame.A", "piston.A"]}],
        "coordinate": [{"joint": "A", "motion": {"law": "constant-rate", "start": 0.05, "rate": speed}}],
        "spring": [{"name": "back", "joint": "A", "stiffness": stiffness}],
        "actuator": [{"joint": "A", "cylinder": {
            "bore": bore, "stroke": [0, 0.4], "dead_volumes": [5e-5, 5e-5], "gas": {"exponent": exponent}, "supply": 8e5, "tank": 0,
            "valve": {"conductance": 2e-8, "critical_ratio": 0.3}}}],
        "time": {"end": 1.0, "samples": 41},
    })  # fmt: skip
    run = scene.inverse()
    found = run.linkdyn.cylinder("A")
    area = np.pi / 4 * bore**2
    s = 0.05 + speed * run.time.values
    pressure = 101325 + stiffness * s / area
    flow = (pressure * area * speed + (5e-5 + area * s) * stiffness * speed / area / exponent) / 1e5
    np.testing.assert_allclose(found.head_flow, flow, rtol=1e-9)
    np.testing.assert_allclose(found.rod_flow, -101325 * area * speed / 1e5, rtol=1e-9)
    np.testing.assert_allclose(found.hydraulic_power, 1e5 * flow * np.log(pressure / 101325), rtol=1e-9)
    assert found.attrs["has_gas"] == found.attrs["flows_known"] == 1 and "at 1 bar" in found.head_flow.attrs["long_name"] and found.peak_flow > 3 * area * speed
    unknown = scene.inverse(q=run.q.values).linkdyn.cylinder("A", scene=scene)      # poses on their own do not tell how pressures change
    assert np.isnan(unknown.head_flow).all() and not np.isnan(unknown.head_pressure).any()
    one_place = scene.inverse(q=run.q.values, t=np.zeros(41)).linkdyn.cylinder("A", scene=scene)       # nor do poses at one instant
    for poses in (unknown, one_place, scene.inverse(want="driving_force,power").linkdyn.cylinder("A", scene=scene)):
        assert poses.attrs["flows_known"] == 0 and np.isnan([poses.peak_flow, poses.mean_flow]).all() and np.isnan(poses.hydraulic_power).all()
    oil = scene.inverse(q=run.q.values, qd=run.qd.values).linkdyn.cylinder("A", bore=bore)
    assert oil.attrs["flows_known"] == 1 and np.isfinite(oil.head_flow).all()


def test_gas_flows_are_those_of_a_forward_run_with_such_pressures() -> None:
    """Through the valve flows what fills the chambers, by the formula of inverse runs."""
    scene = mass_on_cylinder_of_gas()
    run = scene.forward(t=np.linspace(0.0, 0.5, 201))
    own = scene.description["cylinders"][0]
    areas, stroke = (own["head_area"], own["rod_area"]), (own["retracted"], own["extended"])
    volumes = gas.chamber_volumes(run.q.values[:, 0], areas, stroke, own["dead_volumes"])
    for k, (volume, side) in enumerate(zip(volumes, (areas[0], -areas[1]))):
        pressure, flow = run.cylinder_pressure.values[:, 0, k], run.cylinder_flow.values[:, 0, k]
        found = gas.filling_flow(pressure, np.gradient(pressure, run.time.values, edge_order=2), volume, side * run.qd.values[:, 0], own["exponent"])
        np.testing.assert_allclose(found[20:-20], flow[20:-20], rtol=0, atol=2e-3 * np.abs(flow).max())


def mass_on_cylinder_of_gas() -> linkdyn.Scene:
    """40 kg on a slide, against 600 N and 3 kN s/m."""
    b = linkdyn.Builder("gas", "planar")
    piston = b.link("piston", mass="40 kg", markers={"p": (0, 0)})
    b.prismatic("s", b.frame.marker("g", (0, 0)), piston["p"])
    b.coordinate("s", start="10 mm")
    b.measure("v", joint="s", rate=True)
    b.load(piston["p"], force=("-600 N", 0))
    b.load(piston["p"], force=("-3000 N*s/m*v", 0))
    b.actuator("s", law={"type": "valve", "value": 0.1}, cylinder={
        "bore": "50 mm", "rod": "20 mm", "stroke": (0, "0.4 m"), "dead_volumes": ("0.05 litre", "0.05 litre"), "gas": {"exponent": 1.3},
        "supply": "6 bar", "valve": {"conductance": "2 litre/s/bar", "critical_ratio": 0.3}})  # fmt: skip
    return b.scene()
