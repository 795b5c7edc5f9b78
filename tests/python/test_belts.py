"""Belts that stretch: the oscillator of two shafts, strands along tangents, slack, against closed forms and integrations of our own."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import linkdyn
import linkdyn.cycle
import numpy as np
import pytest

pytestmark = pytest.mark.accuracy

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "stretching_belt.toml"
J1, J2, R1, R2, K, D, T0 = 4e-3, 30e-3, 0.04, 0.12, 2e5, 60.0, 600.0


def belt(**strands: Any) -> dict[str, Any]:
    """Two shafts without torques, and a belt."""
    data = tomllib.loads(SCENE.read_text())
    data["actuator"] = [{"joint": j, "law": {"type": "constant", "value": 0.0}} for j in "AB"]
    data["joint"][2]["strands"] = {"stiffness": K, "pretension": T0} | strands
    return data


def test_frequency_of_two_shafts() -> None:
    """The wheels turn against each other with w^2 = 2k (r1^2/J1 + r2^2/J2); what they turn together goes on."""
    data = belt()
    data["coordinate"] = [{"joint": "A", "start": {"position": 0.0, "velocity": 3.0}}, {"joint": "B", "start": {"position": 0.0, "velocity": 0.5}}]
    run = linkdyn.Scene(data).forward(0.4, want="all")
    w = np.sqrt(2 * K * (R1**2 / J1 + R2**2 / J2))
    stretch = R1 * run.q.values[:, 0] - R2 * run.q.values[:, 1]
    np.testing.assert_allclose(stretch, (R1 * 3.0 - R2 * 0.5) / w * np.sin(w * run.time.values), atol=2e-9)
    together = J1 / R1 * run.qd.values[:, 0] + J2 / R2 * run.qd.values[:, 1]
    np.testing.assert_allclose(together, J1 / R1 * 3.0 + J2 / R2 * 0.5, rtol=1e-9)
    np.testing.assert_allclose(run.strand_force.values, T0 + K * np.outer(stretch, [1, -1]), atol=1e-6)
    energy = run.kinetic_energy.values + run.potential_energy.values
    assert np.ptp(energy) < 1e-8 * energy.max()


def own_run(t: np.ndarray, torque: Any) -> tuple[np.ndarray, np.ndarray]:
    """Angles and rates, by steps of our own of fourth order."""
    def slope(time: float, y: np.ndarray) -> np.ndarray:
        pull = K * (R1 * y[0] - R2 * y[1]) + D * (R1 * y[2] - R2 * y[3])
        force = max(T0 + pull, 0.0) - max(T0 - pull, 0.0)
        a, b = torque(time)
        return np.array([y[2], y[3], (a - R1 * force) / J1, (b + R2 * force) / J2])

    y, out, n = np.zeros(4), [np.zeros(4)], 200
    for start, end in zip(t[:-1], t[1:]):
        h = (end - start) / n
        for k in range(n):
            time = start + k * h
            k1 = slope(time, y)
            k2 = slope(time + h / 2, y + h / 2 * k1)
            k3 = slope(time + h / 2, y + h / 2 * k2)
            k4 = slope(time + h, y + h * k3)
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        out.append(y)
    return np.array(out)[:, :2], np.array(out)[:, 2:]


@pytest.mark.parametrize("size", [12.0, 400.0])
def test_driven_belt(size: float) -> None:
    """Over many turns, with damping; under the large torque strands go slack by turns."""
    data = tomllib.loads(SCENE.read_text())
    data["actuator"][0]["law"]["value"] = f"{size} N*m*sin(40 rad/s*time)"
    t = np.linspace(0.0, 0.3, 61)
    run = linkdyn.Scene(data).forward(t=t, want="all")
    assert np.all(run.status == 0)
    q, qd = own_run(t, lambda s: (size * np.sin(40 * s), -2.0))
    np.testing.assert_allclose(run.q.values, q, atol=1e-6 * np.abs(q).max())
    np.testing.assert_allclose(run.qd.values, qd, atol=1e-6 * np.abs(qd).max())
    assert (run.strand_force.values.min() == 0.0) == (size > 50)
    assert np.abs(q).max() > 2 * np.pi
    lanes = linkdyn.Scene(data).forward(t=t, want="all", solver="lapack")
    np.testing.assert_allclose(lanes.q.values, run.q.values, atol=1e-7)
    np.testing.assert_allclose(lanes.reaction.values, run.reaction.values, atol=1e-4)


def cross(a: np.ndarray, b: np.ndarray) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def tangents(a: np.ndarray, b: np.ndarray, run: str) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Points on both wheels and the direction from the first to the second of the strand that pulls the first wheel backwards, and of the other."""
    found = []
    d, s = b - a, 1.0 if run == "open" else -1.0
    length, heading = np.hypot(*d), np.arctan2(d[1], d[0])
    for side in (1.0, -1.0):
        # the normal n of the line on whose side the first wheel touches: r1 = n.(p - a), s r2 = n.(q - b)
        angle = heading + side * np.arccos((R1 - s * R2) / length)
        n = np.array([np.cos(angle), np.sin(angle)])
        p, q = a + R1 * n, b + s * R2 * n
        u = (q - p) / np.hypot(*(q - p))
        found.append((p, q, u))
    # taut is the strand whose pull turns the first wheel backwards
    backwards = [cross(p - a, u) < 0 for p, _, u in found]
    return [found[backwards.index(True)], found[backwards.index(False)]]


@pytest.mark.parametrize("run", ["open", "crossed"])
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_strands_lie_along_tangents(run: str, space: str) -> None:
    """Forces of belt and hinges from the strands' lines, on a frame and on an arm that turns; torques from their moments; and the solvers."""
    data = tomllib.loads(SCENE.read_text())
    data["joint"][2] |= {"run": run}
    data["link"].append({"name": "arm", "mass": 3.0, "inertia": 0.1, "markers": {"O": [0, 0], "A": [0.1, 0.05], "B": [0.5, 0.15]}})
    data["frame"]["markers"] = {"O": [0, 0]}
    data["joint"][0]["between"], data["joint"][1]["between"] = ["arm.A", "motor.O"], ["arm.B", "drum.O"]
    data["joint"].append({"name": "S", "type": "revolute", "between": ["frame.O", "arm.O"]})
    data["coordinate"].append({"joint": "S"})
    data["actuator"].append({"joint": "S"})
    if space == "spatial":
        data |= {"space": "spatial", "gravity": [0, 0, 0]}
        data["frame"]["markers"] = {"O": [0, 0, 0]}
        for link in data["link"]:
            link["markers"] = {name: [*at, 0] for name, at in link["markers"].items()}
            link["inertia"] = {"diagonal": [link.pop("inertia") if link["name"] == "arm" else float(str(link.pop("inertia")).split()[0])] * 3}
    scene = linkdyn.Scene(data)
    order = [str(c) for c in linkdyn.Scene(data).inverse(q=np.zeros((1, 3)), qd=np.zeros((1, 3)), qdd=np.zeros((1, 3))).coordinate.values]
    q = np.array([[7.3, (1 if run == "open" else -1) * 7.3 / 3 - 0.004, 0.7]])[:, [["A", "B", "S"].index(c) for c in order]]
    qd = np.array([[2.0, 0.6 if run == "open" else -0.6, 0.4]])[:, [["A", "B", "S"].index(c) for c in order]]
    result = scene.inverse(q=q, qd=qd, qdd=np.zeros((1, 3)), want="all")
    other = scene.inverse(q=q, qd=qd, qdd=np.zeros((1, 3)), want="all", solver="lapack")
    sign = 1 if run == "open" else -1
    pull = K * (sign * R1 * 7.3 - R2 * q[0, order.index("B")]) + D * (sign * R1 * 2.0 - R2 * qd[0, order.index("B")])
    tension = T0 + pull * np.array([1, -1])
    np.testing.assert_allclose(result.strand_force.values[0], tension, rtol=1e-10)
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    a, b = turn @ [0.1, 0.05], turn @ [0.5, 0.15]
    lines = tangents(a, b, run)
    if run == "crossed":
        lines.reverse()
    force = -sum(T * u for T, (_, _, u) in zip(tension, lines))
    moment = -sum(T * cross(q2 - b, u) for T, (_, q2, u) in zip(tension, lines))
    got = result.reaction.sel(joint="belt").values[0]
    np.testing.assert_allclose([*got[:2], got[-1]], [*force, moment], rtol=1e-9)
    first = sum(T * cross(p - a, u) for T, (p, _, u) in zip(tension, lines))
    torques = {str(name): float(value) for name, value in zip(result.actuator.values, result.driving_force.values[0])}
    assert torques["A"] == pytest.approx(-first, rel=1e-9) and torques["B"] == pytest.approx(-moment, rel=1e-9)
    arm = result.reaction.sel(joint="B").values[0][:2]
    np.testing.assert_allclose(arm, 6 * -(0.4**2) * b - force, rtol=1e-9)      # the drum circles with the arm
    for name in ("reaction", "strand_force", "driving_force"):
        np.testing.assert_allclose(other[name].values, result[name].values, rtol=1e-10, atol=1e-9)
    assert np.abs(result.power_imbalance).max() < 1e-12


def test_energy_of_a_run() -> None:
    """What the drives put in is in masses and strands, but for what the dampers take."""
    data = tomllib.loads(SCENE.read_text())
    data["time"] = {"end": 0.1, "samples": 4001}
    run = linkdyn.Scene(data).forward(want="power")
    rate = R1 * run.qd.values[:, 0] - R2 * run.qd.values[:, 1]
    lost = np.concatenate([[0.0], np.cumsum(D * (rate[1:] ** 2 + rate[:-1] ** 2) * np.diff(run.time.values))])
    held = run.kinetic_energy.values + run.potential_energy.values
    np.testing.assert_allclose(held - held[0], run.work.values - lost, atol=2e-6 * held.max())
    stretch = R1 * run.q.values[:, 0] - R2 * run.q.values[:, 1]
    np.testing.assert_allclose(run.potential_energy.values, T0**2 / K + K * stretch**2, rtol=1e-9)


def test_turns_are_counted() -> None:
    """A wheel on a linkage whose turns nobody counts is refused; contributions by cause are, too."""
    scene = linkdyn.Scene(led())
    with pytest.raises(linkdyn.InputError, match="a belt stretches"):
        linkdyn.cycle.contributions(scene.inverse(), scene)
    data = tomllib.loads(SCENE.read_text())
    data["coordinate"].pop(0)
    data["coordinate"].append({"joint": "C"})
    data["link"] += [{"name": "rod", "mass": 1, "markers": {"P": [0, 0], "Q": [0.3, 0]}}, {"name": "crank", "mass": 1, "inertia": 0.01, "markers": {"O": [0, 0], "Q": [0.05, 0]}}]
    data["link"][0]["markers"]["P"] = [0.2, 0]
    data["frame"]["markers"]["C"] = [0.25, -0.3]
    data["joint"] += [{"name": "P", "type": "revolute", "between": ["motor.P", "rod.P"]}, {"name": "Q", "type": "revolute", "between": ["crank.Q", "rod.Q"]},
                      {"name": "C", "type": "revolute", "between": ["frame.C", "crank.O"]}]
    with pytest.raises(linkdyn.SceneError, match="belt 'belt' stretches, and the turns of joint 'A' are not counted"):
        linkdyn.Scene(data)


def led(k: float = K, r: float = R1) -> dict[str, Any]:
    """Both shafts led by motions; stiffness and a radius are parameters."""
    data = belt(stiffness="k") | {"variables": {"k": str(k), "r": str(r)}}
    data["joint"][2]["radii"] = ["r", R2]
    data["coordinate"] = [{"joint": "A", "motion": {"law": "constant-rate", "rate": 3.0}}, {"joint": "B", "motion": {"law": "harmonic", "amplitude": 0.1, "frequency": 1}}]
    data["actuator"] = [{"joint": "A"}, {"joint": "B"}]
    return data


def test_designs_and_ensembles() -> None:
    """A sweep over stiffness and radius finds of each design what a scene of its own does; members of an ensemble are runs."""
    data = led()
    angles = ([0.02, 0.1], [0.0, 0.01])
    data["sweep"] = {"reduce": ["driving_force"], "axis": [
        {"coordinate": "A", "values": angles[0]}, {"coordinate": "B", "values": angles[1]},
        {"parameter": "variables.k", "values": [1e5, 2e5, 4e5]}, {"parameter": "variables.r", "values": [0.03, 0.04]}]}  # fmt: skip
    found = linkdyn.Scene(data).sweep()
    q = np.array([[a, b] for a in angles[0] for b in angles[1]])
    for i, (k, r) in enumerate(found.design_value.values):
        own = linkdyn.Scene(led(k, r)).inverse(q=q, qd=0 * q, qdd=0 * q).driving_force.values
        np.testing.assert_allclose(found.driving_force_max.values[i], own.max(axis=0), rtol=1e-12)
        np.testing.assert_allclose(found.driving_force_min.values[i], own.min(axis=0), rtol=1e-12)
        pull = k * (r * q[:, 0] - R2 * q[:, 1])
        force = np.maximum(T0 + pull, 0) - np.maximum(T0 - pull, 0)
        np.testing.assert_allclose(own, np.outer(force, [1, 0]) * r - np.outer(force, [0, 1]) * R2, atol=1e-9)
    t = np.linspace(0.0, 0.1, 21)
    start = np.array([[0.0, 0.0], [1.0, 0.33]])
    members = linkdyn.Scene(belt()).ensemble(q=start, qd=np.zeros((2, 2)), t=t, step=5e-5)
    for k in range(2):
        data = belt()
        data["coordinate"] = [{"joint": j, "start": v} for j, v in zip("AB", start[k])]
        np.testing.assert_allclose(members.q.values[k], linkdyn.Scene(data).forward(t=t).q.values, atol=1e-8)


def test_too_stiff_a_belt_is_named() -> None:
    """Where its motion is too fast for any step the run says so, and how long it takes."""
    data = belt(stiffness=2e17, pretension=1e14)
    data["coordinate"] = [{"joint": "A", "start": {"position": 0.0, "velocity": 3.0}}, {"joint": "B"}]
    words = linkdyn.Scene(data).forward(5.0, method="rk8pd").attrs["stopped"]
    assert "belt 'belt' is too stiff" in words
    period = float(words.partition("its motion takes ")[2].partition(" s")[0])
    assert period == pytest.approx(2 * np.pi / np.sqrt(2 * 2e17 * (R1**2 / J1 + R2**2 / J2)), rel=1e-5)


def test_motion_of_a_rim() -> None:
    """Python's own motion of links takes such a belt for no constraint: a point on the drum goes round with the drum alone."""
    data = tomllib.loads(SCENE.read_text())
    data["link"][1]["markers"]["P"] = [0.1, 0.0]
    scene = linkdyn.Scene(data)
    run = scene.forward(0.05, want="all")
    told = linkdyn.cycle.marker(run, "drum.P", scene)
    angle, rate, rate2 = (run[name].values[:, 1] for name in ("q", "qd", "qdd"))
    arm = 0.1 * np.column_stack([np.cos(angle), np.sin(angle)])
    across = np.column_stack([-arm[:, 1], arm[:, 0]])
    np.testing.assert_allclose(told.acceleration.values[:, :2], rate2[:, np.newaxis] * across - (rate**2)[:, np.newaxis] * arm, atol=1e-8 * np.abs(rate2).max())


def test_beside_redundant_constraints() -> None:
    """A parallelogram with three cranks, one of them driven over a belt that stretches: what is shared does not count the belt."""
    crank = lambda name: {"name": name, "mass": 0.4, "inertia": 2e-3, "cog": [0.1, 0], "markers": {"O": [0, 0], "P": [0.2, 0]}}
    data = {
        "space": "planar", "gravity": [0, -9.81], "redundancy": "minimum-norm", "frame": {"markers": {"A": [0, 0], "B": [0.3, 0], "C": [0.6, 0], "M": [-0.4, 0.1]}},
        "link": [crank("a"), crank("b"), crank("c"), {"name": "rod", "mass": 1.0, "inertia": 0.05, "cog": [0.3, 0], "markers": {"A": [0, 0], "B": [0.3, 0], "C": [0.6, 0]}},
                 {"name": "motor", "mass": 1.0, "inertia": 1e-3, "markers": {"O": [0, 0]}}],
        "joint": [*({"name": f"{k}1", "type": "revolute", "between": [f"frame.{k}", f"{k.lower()}.O"]} for k in "ABC"),
                  *({"name": f"{k}2", "type": "revolute", "between": [f"{k.lower()}.P", f"rod.{k}"]} for k in "ABC"),
                  {"name": "M", "type": "revolute", "between": ["frame.M", "motor.O"]},
                  {"name": "belt", "type": "belt", "between": ["motor.O", "a.O"], "radii": [R1, R2], "strands": {"stiffness": K, "pretension": T0}}],
        "coordinate": [{"joint": "A1", "motion": {"law": "constant-rate", "rate": 2.0, "start": 0.4}}, {"joint": "M", "motion": {"law": "constant-rate", "rate": 6.0, "start": 1.21}}],
        "actuator": [{"joint": "A1"}, {"joint": "M"}], "time": {"end": 0.5, "samples": 26},
    }  # fmt: skip
    scene = linkdyn.Scene(data)
    told = scene.explain()
    redundant = told.partition("Redundant constraints")[2].partition("\n\n")[0]
    assert redundant.count("closes the loop") == 1 and "belt" not in redundant
    run = scene.inverse(want="all")
    assert np.all(run.status == 0) and np.abs(run.power_imbalance).max() < 1e-12
    stretch = R1 * run.q.values[:, 1] - R2 * run.q.values[:, 0]
    np.testing.assert_allclose(run.strand_force.values, T0 + K * np.outer(stretch, [1, -1]), rtol=1e-9)
    np.testing.assert_allclose(run.driving_force.values[:, 1], 2 * K * stretch * R1, rtol=1e-8)
    lanes = scene.inverse(want="all", solver="lapack")
    np.testing.assert_allclose(lanes.reaction.values, run.reaction.values, atol=1e-8 * T0)


def test_a_wheel_without_inertia() -> None:
    """About its axis a drum that is a point moves no mass: an equation without unknowns, which forward dynamics refuses."""
    data = tomllib.loads(SCENE.read_text())
    del data["link"][1]["inertia"]
    scene = linkdyn.Scene(data)
    run = scene.inverse()
    assert (run.status.values == 0).all()
    with pytest.raises(linkdyn.LinkdynError, match="the equations of motion are singular"):
        scene.forward(0.1)
    with pytest.raises(linkdyn.LinkdynError, match="the equations of motion are singular"):
        scene.forward(0.1, solver="reduced")
