"""A frame that moves: against the same mechanism on a link that drives carry along, against closed equations, and one road of the engine
against another."""

from __future__ import annotations

import copy
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
import xarray as xr
from linkdyn import cycle
from linkdyn.cli import executable, quadruple_twin
from linkdyn.errors import InputError
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "hard"))

from cases import Case  # noqa: E402
from twin import forces_of, quadruple_forces  # noqa: E402

pytestmark = pytest.mark.accuracy

NAMES = ["x", "y", "z", "roll", "pitch", "yaw"]
AXES = np.eye(3)


def swing(amplitude: float, frequency: float, phase: float = 0.0, mean: float = 0.0) -> dict[str, Any]:
    return {"law": "harmonic", "amplitude": amplitude, "frequency": frequency, "phase": phase, "mean": mean}


PLANAR = {"x": swing(0.3, 3.0, 0.4), "y": swing(0.2, 5.0, 1.0, 0.5), "yaw": swing(0.6, 2.0, 0.3, 0.2)}
SPATIAL = {"x": swing(0.3, 3.0, 0.4), "y": swing(0.2, 5.0, 1.0, 0.5), "z": swing(0.4, 2.5, 0.1),
           "roll": swing(0.5, 2.2, 0.3, 0.1), "pitch": swing(0.4, 3.1, 1.3, -0.2), "yaw": swing(0.6, 2.0, 0.3, 0.2)}


def four_bar() -> dict[str, Any]:
    return {
        "space": "planar", "gravity": [0.4, -9.81], "time": {"end": 2, "samples": 161},
        "frame": {"markers": {"A": [0.1, 0.2], "D": [0.5, 0.15]}, "motion": PLANAR},
        "link": [
            {"name": "crank", "markers": {"A": [0, 0], "B": [0.12, 0]}, "mass": 1.2, "cog": [0.05, 0.01], "inertia": 0.004},
            {"name": "coupler", "markers": {"B": [0, 0], "C": [0.45, 0]}, "mass": 2.0, "cog": [0.2, 0.03], "inertia": 0.03},
            {"name": "rocker", "markers": {"D": [0, 0], "C": [0.3, 0]}, "mass": 1.5, "cog": [0.14, -0.02], "inertia": 0.012},
        ],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]}, {"name": "B", "type": "revolute", "between": ["crank.B", "coupler.B"]},
            {"name": "C", "type": "revolute", "between": ["coupler.C", "rocker.C"]}, {"name": "D", "type": "revolute", "between": ["frame.D", "rocker.D"]},
        ],
        "coordinate": [{"joint": "A", "motion": swing(2.0, 3.0)}], "actuator": [{"joint": "A"}],
        "spring": [{"name": "S", "between": ["frame.D", "coupler.C"], "stiffness": 50.0, "damping": 3.0, "rest": 0.25}],
    }


def hexapod() -> dict[str, Any]:
    def ring(name: str, radius: float, degrees: list[float]) -> dict[str, list[float]]:
        return {f"{name}{i}": [radius * float(np.cos(a)), radius * float(np.sin(a)), 0.0] for i, a in enumerate(np.radians(degrees), start=1)}

    return {
        "space": "spatial", "gravity": [0.3, -0.2, -9.81], "time": {"end": 2, "samples": 161},
        "frame": {"markers": ring("B", 1.0, [10, 110, 130, 230, 250, 350]), "motion": SPATIAL},
        "link": [{"name": "platform", "mass": 150.0, "cog": [0.08, -0.05, 0.2], "inertia": [31, 28.5, 42, -1.25, -0.95, 1.8],
                  "markers": ring("P", 0.6, [50, 70, 170, 190, 290, 310])}],
        "chain": [{"type": "UPS", "base": [f"frame.B{i}" for i in range(1, 7)], "platform": [f"platform.P{i}" for i in range(1, 7)], "axis": [0, 1, 0],
                   "lower": {"mass": 12, "cog": [0.01, 0.02, 0.35], "inertia": [1.6, 1.9, 0.35, 0.01, 0.02, 0.03]},
                   "upper": {"mass": 8, "cog": [0.02, 0.01, -0.3], "inertia": [0.72, 0.716, 0.06, 0.01, 0, 0.02]}}],
        "coordinate": [{"link": "platform", "motion": {"x": swing(0.1, 3.0), "y": swing(0.08, 2.0, 0.5), "z": swing(0.1, 4.0, 0, 1.2),
                                                       "roll": swing(0.15, 3.0), "pitch": swing(0.1, 5.0), "yaw": swing(0.2, 2.0)}}],
    }


def arm() -> dict[str, Any]:
    """Two hinges and a slide; the tool has a spherical pendulum's freedom from the base by both hinges."""
    return {
        "space": "spatial", "gravity": [0.0, 0.0, -9.81], "time": {"end": 2, "samples": 161},
        "frame": {"markers": {"A": [0.1, 0.2, 0.3]}, "motion": SPATIAL},
        "link": [
            {"name": "column", "mass": 20.0, "cog": [0.02, 0.0, 0.25], "inertia": [1.2, 1.1, 0.3, 0.01, 0.02, 0.03],
             "markers": {"A": [0, 0, 0], "B": {"at": [0.1, 0, 0.5], "axis": [0, 1, 0]}}},
            {"name": "boom", "mass": 8.0, "cog": [0.3, 0.0, 0.02], "inertia": [0.05, 0.4, 0.42, 0.0, 0.01, 0.02],
             "markers": {"B": {"at": [0, 0, 0], "axis": [0, 1, 0]}, "C": {"at": [0.6, 0.05, 0.1], "axis": [1, 0, 0.2]}}},
            {"name": "slider", "mass": 5.0, "cog": [0.1, 0.05, 0.02], "inertia": [0.04, 0.05, 0.06, 0.002, 0.001, 0.003],
             "markers": {"C": {"at": [0.02, -0.03, 0.04], "axis": [0, 0.3, 1]}}},
        ],
        "joint": [{"name": "J1", "type": "revolute", "between": ["frame.A", "column.A"]}, {"name": "J2", "type": "revolute", "between": ["column.B", "boom.B"]},
                  {"name": "J3", "type": "prismatic", "between": ["boom.C", "slider.C"]}],
        "coordinate": [{"joint": "J1", "motion": swing(0.7, 2.0)}, {"joint": "J2", "motion": swing(0.5, 3.0, 0.0, 0.3)},
                       {"joint": "J3", "motion": swing(0.1, 4.0)}],
        "actuator": [{"joint": "J1"}, {"joint": "J2"}, {"joint": "J3"}],
    }


def slider_crank_in_space() -> dict[str, Any]:
    """Closed by iteration: the sleeve slides across the crank's plane. The rod may spin between its balls."""
    return {
        "space": "spatial", "gravity": [0.0, 0.0, -9.81], "time": {"end": 2, "samples": 401},
        "frame": {"markers": {"A": {"at": [0, 0.1, 0.12], "axis": [1, 0, 0]}, "D": {"at": [0.2, 0, 0], "axis": [1, 0, 0]}}, "motion": SPATIAL},
        "link": [
            {"name": "crank", "mass": 0.12, "cog": [0.01, 0, 0.04], "inertia": [1e-4, 1.05e-4, 1e-5, 0, 0, 1e-6],
             "markers": {"A": {"at": [0, 0, 0], "axis": [1, 0, 0]}, "B": [0, 0, 0.08]}, "start": {"position": [0, 0.1, 0.12]}},
            {"name": "rod", "mass": 0.5, "cog": [0, 0, 0.13], "inertia": [4e-3, 4e-3, 1e-4, 0, 0, 0],
             "markers": {"B": [0, 0, 0], "C": [0, 0, 0.3]}, "start": {"position": [0, 0.1, 0.2], "angles": [0.46, 2.32, 0]}},
            {"name": "sleeve", "mass": 2.0, "cog": [0.01, 0.02, 0.0], "inertia": [1e-3, 1.2e-3, 1.1e-3, 0, 0, 0],
             "markers": {"C": [0, 0, 0], "D": {"at": [0, 0, 0], "axis": [1, 0, 0]}}, "start": {"position": [0.2, 0, 0]}},
        ],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]}, {"name": "B", "type": "spherical", "between": ["crank.B", "rod.B"]},
                  {"name": "C", "type": "spherical", "between": ["rod.C", "sleeve.C"]}, {"name": "D", "type": "prismatic", "between": ["frame.D", "sleeve.D"]}],
        "coordinate": [{"joint": "A", "motion": {"law": "constant-rate", "rate": 3.0}}], "actuator": [{"joint": "A"}],
    }


def on_driven_ground(scene: dict[str, Any], *, is_free: bool = False) -> dict[str, Any]:
    """The same mechanism on a link without mass that slides and hinges in a row carry along as the frame moves."""
    changed = copy.deepcopy(scene)
    planar = scene["space"] == "planar"
    motion = changed["frame"].pop("motion")

    def carried(name: str) -> str:
        return name.replace("frame.", "ground.") if name.startswith("frame.") else name

    for joint in [*changed.get("joint", []), *changed.get("spring", [])]:
        joint["between"] = [carried(name) for name in joint["between"]]
    for chain in changed.get("chain", []):
        chain["base"] = [carried(name) for name in chain["base"]]
    for coordinate in changed["coordinate"]:
        if "link" in coordinate:
            coordinate["relative_to"] = "ground"
            start = coordinate.get("start")
            if start:
                place, rate = ([*start[a], *start[b]] for a, b in (("position", "angles"), ("velocity", "angular_rates")))
                coordinate["start"] = {name: {"position": place[k], "velocity": rate[k]} for k, name in enumerate(NAMES)}
    parts = [0, 1, 5] if planar else range(6)
    previous, markers = "frame", {}
    changed.setdefault("joint", [])
    changed.setdefault("actuator", [])
    for n, k in enumerate(parts):
        name = "ground" if n == len(parts) - 1 else f"carriage{n}"
        point: dict[str, Any] = {"at": [0.0] * (2 if planar else 3)}
        if k != 5 or not planar:
            point["axis"] = AXES[k % 3][: 2 if planar else 3].tolist()
        markers[previous] = {**markers.get(previous, {}), f"M{n}": point}
        markers[name] = {f"M{n}": point}
        changed["joint"].append({"name": f"G.{NAMES[k]}", "type": "prismatic" if k < 3 else "revolute", "between": [f"{previous}.M{n}", f"{name}.M{n}"]})
        changed["coordinate"].append({"joint": f"G.{NAMES[k]}", "motion": motion.get(NAMES[k], 0.0), **({"driven": True} if is_free else {})})
        changed["actuator"].append({"joint": f"G.{NAMES[k]}"})
        previous = name
    markers["ground"] |= changed["frame"]["markers"]
    changed["frame"] = {"markers": markers.pop("frame")}
    changed["link"] += [{"name": name, "mass": 0, "markers": points} for name, points in markers.items()]
    return changed


def turning(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rx(roll) Ry(pitch) Rz(yaw)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles), np.sin(angles)
    return np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]]) @ [[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]] @ [[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]


def turned_back(scene: linkdyn.Scene, run: xr.Dataset, joints: list[str]) -> NDArray[np.float64]:
    """Reactions in the axes of the ground."""
    wrench = run.reaction.sel(joint=joints).values
    if scene.planar:
        full = np.zeros((*wrench.shape[:2], 6))
        full[..., [0, 1, 5]] = wrench
        wrench = full
    angles = np.zeros((len(wrench), 3))
    for k, name in enumerate(NAMES[3:]):
        if f"G.{name}" in run.coordinate:
            angles[:, k] = run.q.sel(coordinate=f"G.{name}").values
    turn = np.array([turning(one) for one in angles])
    back = np.concatenate([np.einsum("nji,nkj->nki", turn, part) for part in (wrench[..., :3], wrench[..., 3:])], axis=2)
    return back[..., [0, 1, 5]] if scene.planar else back


@pytest.mark.parametrize("make", [four_bar, hexapod, arm, slider_crank_in_space])
def test_against_driven_ground(make: Any) -> None:
    """Forces and reactions, by every solver."""
    scene = make()
    moving, driven = linkdyn.Scene(scene), linkdyn.Scene(on_driven_ground(scene))
    expected = driven.inverse(solver="lapack")
    joints, drives = list(moving.joints), list(moving.actuators)
    reactions = turned_back(driven, expected, joints)
    forces = expected.driving_force.sel(actuator=drives).values
    assert (expected.status == 0).all()
    for solver in ("elimination", "lapack", "gauss-jordan", "reduced"):
        run = moving.inverse(solver=solver)
        assert (run.status == 0).all()
        assert np.abs(run.driving_force.values - forces).max() < 1e-11 * np.abs(forces).max()
        assert np.abs(run.power_imbalance).max() < 1e-12
        if "reaction" in run:
            assert np.abs(run.reaction.values - reactions).max() < 1e-11 * np.abs(reactions).max()
    still = copy.deepcopy(scene)
    del still["frame"]["motion"]
    assert np.abs(linkdyn.Scene(still).inverse().driving_force.values - forces).max() > 0.1 * np.abs(forces).max()


@pytest.mark.parametrize("make", [four_bar, hexapod, slider_crank_in_space])
def test_states_with_instants(make: Any) -> None:
    """Samples one by one and as a batch, with their errors; without instants they are refused."""
    moving = linkdyn.Scene(make())
    t, (q, qd, qdd) = moving.times(), moving.motion()
    along = moving.inverse(error=True)
    batch = moving.inverse(q, qd, qdd, t=t)
    one = moving.solve(q[7:8], qd[7:8], qdd[7:8], t=t[7:8], want=("driving_force", "reaction"))
    size = np.abs(along.reaction.values).max()
    assert np.abs(batch.reaction.values - along.reaction.values).max() < 1e-11 * size
    assert np.abs(one["reaction"][0] - along.reaction.values[7]).max() < 1e-11 * size
    assert along.error.max() < 1e-10
    lapack = moving.inverse(solver="lapack")
    assert np.abs(lapack.reaction.values - along.reaction.values).max() < 1e-9 * size
    for compute in (moving.inverse, moving.solve):
        with pytest.raises(InputError, match=r"^t: the frame of the scene moves with time, and no instants are given"):
            compute(q, qd, qdd)


@pytest.mark.twin
@pytest.mark.parametrize("make", [four_bar, hexapod])
def test_quadruple_precision(make: Any) -> None:
    moving = linkdyn.Scene(make())
    t = moving.times()[::10]
    q, qd, qdd = moving.motion(t)
    case = Case("frame", "frame", make(), q, qd, qdd, np.full(len(t), np.nan))
    exact = quadruple_forces(quadruple_twin(), case, time=t)
    found = forces_of(moving.inverse(t=t, want=("driving_force", "reaction")))
    assert np.abs(found - exact).max() < 1e-12 * np.abs(exact).max()


def test_command_wants_instants(tmp_path: Path) -> None:
    """A file of states without time, and code for a controller."""
    (tmp_path / "scene.toml").write_text(linkdyn.Scene(four_bar()).text)
    (tmp_path / "states.csv").write_text("q A\n0.1\n0.2\n")
    run = subprocess.run([executable(), "inverse", "scene.toml", "--states", "states.csv", "-o", "r.nc"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert "time" in run.stderr
    run = subprocess.run([executable(), "generate", "scene.toml", "-o", "x.c"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert "the frame of the scene moves (expected a frame at rest, or the kernel kinematics)" in run.stderr


# ---------------------------------------------------------------- forward


def let_go(scene: dict[str, Any]) -> dict[str, Any]:
    """Free, but for springs and dampers at its drives."""
    free = copy.deepcopy(scene)
    for k, coordinate in enumerate(free["coordinate"]):
        if "link" in coordinate:
            coordinate["start"] = {"position": [0.05, 0.02, 1.2], "angles": [0.1, 0.05, -0.1], "velocity": [0.1, 0.2, 0.0], "angular_rates": [0.1, -0.2, 0.3]}
        else:
            coordinate["start"] = {"position": 0.3 + 0.1 * k, "velocity": 1.0 - 0.3 * k}
        coordinate.pop("motion")
    if "chain" in free:
        free["actuator"] = [{"joint": f"leg{i}.P", "law": {"type": "spring-damper", "stiffness": 2e4, "damping": 300.0, "rest": 1.3}} for i in range(1, 7)]
        free["chain"][0]["actuated"] = False
    else:
        for actuator in free["actuator"]:
            actuator["law"] = {"type": "spring-damper", "stiffness": 20.0, "damping": 0.2}
    return free


@pytest.mark.parametrize(("end", "method"), [(0.05, "gbs"), (2.0, "gbs"), (2.0, "rk8pd")])
@pytest.mark.parametrize("make", [four_bar, hexapod, arm])
def test_forward_against_driven_ground(make: Any, end: float, method: str) -> None:
    """Free runs, long enough for the record, and short, on lanes alone."""
    free = let_go(make())
    moving, driven = linkdyn.Scene(free), linkdyn.Scene(on_driven_ground(free, is_free=True))
    names = list(moving.coordinates)
    t = np.linspace(0, end, 21)
    run, other = (scene.forward(t=t, method=method, rtol=1e-11, atol=1e-12, want="all") for scene in (moving, driven))
    assert (run.status == 0).all() and not run.attrs["stopped"]
    size = np.abs(run.q.values).max()
    assert np.abs(run.q.values - other.q.sel(coordinate=names).values).max() < 1e-8 * size
    reactions = turned_back(driven, other, list(moving.joints))
    assert np.abs(run.reaction.values - reactions).max() < 1e-6 * np.abs(reactions).max()
    assert np.abs(run.power_imbalance).max() < 1e-9


def test_forward_after_inverse() -> None:
    """Driving forces found for a motion on the moving frame produce it."""
    scene = hexapod()
    for leg in range(1, 7):
        scene.setdefault("actuator", []).append({"joint": f"leg{leg}.P"})
    scene["chain"][0]["actuated"] = False
    moving = linkdyn.Scene(scene)
    t = np.linspace(0, 1.0, 21)
    run = moving.forward(t=t, rtol=1e-11, atol=1e-12)
    assert np.abs(run.q.values - moving.motion(t)[0]).max() < 1e-7


def test_simulator_and_ensemble() -> None:
    free = let_go(four_bar())
    moving = linkdyn.Scene(free)
    t = np.linspace(0, 0.5, 6)
    run = moving.forward(t=t, rtol=1e-11, atol=1e-12)
    many = moving.ensemble(np.full((20, 1), 0.3), np.full((20, 1), 1.0), t, step=5e-4)
    assert np.abs(many.q.values - run.q.values[np.newaxis]).max() < 1e-7
    free["actuator"][0]["law"] = {"type": "constant", "value": -0.4}
    pushed = linkdyn.Scene(free)
    simulator = pushed.simulator(rtol=1e-11, atol=1e-12)
    for _ in range(50):
        simulator.step(0.01, [-0.4])
    assert np.abs(simulator.q - pushed.forward(t=t, rtol=1e-11, atol=1e-12).q.values[-1]).max() < 1e-8


def test_mathieu() -> None:
    """A pendulum whose pivot shakes up and down: (g + a'') sin q, stable upright if it shakes fast enough."""
    length, amplitude, frequency = 0.4, 0.03, 120.0
    scene = {
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"O": [0, 0]}, "motion": {"y": swing(amplitude, frequency, np.pi / 2)}},
        "link": [{"name": "bob", "mass": 2.0, "cog": [0, length], "inertia": 0.0, "markers": {"O": [0, 0]}}],
        "joint": [{"name": "O", "type": "revolute", "between": ["frame.O", "bob.O"]}], "coordinate": [{"joint": "O", "start": 0.3}], "time": {"end": 3},
    }

    def upright(t: float, y: NDArray[np.float64]) -> list[float]:
        return [y[1], (9.81 - amplitude * frequency**2 * np.cos(frequency * t)) / length * np.sin(y[0])]

    t = np.linspace(0, 3, 61)
    run = linkdyn.Scene(scene).forward(t=t, rtol=1e-11, atol=1e-12)
    exact = solve_ivp(upright, (0, 3), [0.3, 0.0], method="DOP853", t_eval=t, rtol=1e-12, atol=1e-13).y[0]
    assert np.abs(run.q.values[:, 0] - exact).max() < 1e-8
    assert np.abs(exact).max() < 1.2                     # it does not fall


def test_seen_from_a_turning_frame() -> None:
    """Foucault: a free run seen from a frame that turns is the run at rest, turned back."""
    rate = 0.7
    scene = {
        "space": "spatial", "gravity": [0, 0, -9.81], "frame": {"markers": {"O": [0, 0, 0]}},
        "link": [{"name": "bob", "mass": 2.0, "cog": [0, 0, -0.8], "inertia": [0.02, 0.025, 0.01, 0.001, 0, 0], "markers": {"O": [0, 0, 0]}}],
        "coordinate": [{"link": "bob", "start": {"position": [0.1, 0.0, 0.0], "angles": [0.5, 0.2, 0.1], "velocity": [0.3, 0.1, 2.0],
                                                 "angular_rates": [0.2, 0.4, 0.3]}}], "time": {"end": 2},
    }
    t = np.linspace(0, 2, 21)
    still = linkdyn.Scene(scene).forward(t=t, rtol=1e-11, atol=1e-12)
    seen = copy.deepcopy(scene)
    seen["frame"]["motion"] = {"yaw": {"law": "constant-rate", "rate": rate}}
    # at t = 0 both axes coincide; velocities there are less rate x r, angular velocities less the rate, as rates of roll, pitch, yaw
    start = seen["coordinate"][0]["start"]
    start["velocity"] = (np.array(start["velocity"]) - np.cross([0, 0, rate], start["position"])).tolist()
    roll, pitch, _ = start["angles"]
    # z = (rows of the map from rates of roll, pitch, yaw to the angular velocity in world axes) solved for the frame's own turning
    columns = np.array([[1, 0, np.sin(pitch)], [0, np.cos(roll), -np.sin(roll) * np.cos(pitch)], [0, np.sin(roll), np.cos(roll) * np.cos(pitch)]])
    start["angular_rates"] = (np.array(start["angular_rates"]) - np.linalg.solve(columns, [0, 0, rate])).tolist()
    run = linkdyn.Scene(seen).forward(t=t, rtol=1e-11, atol=1e-12)
    poses, there = linkdyn.Scene(scene).poses(still.q.values), linkdyn.Scene(seen).poses(run.q.values)
    for k, instant in enumerate(t):
        turn = turning(np.array([0, 0, rate * instant]))
        assert np.abs(turn @ there.position[k, 0] - poses.position[k, 0]).max() < 1e-8
        assert np.abs(turn @ there.rotation[k, 0] - poses.rotation[k, 0]).max() < 1e-8


def test_centrifugal_force() -> None:
    """A slide on a table that turns steadily holds its mass by m w^2 r, and pushes it sideways by 2 m w v."""
    scene = {
        "space": "planar", "frame": {"markers": {"O": {"at": [0, 0], "axis": [1, 0]}}, "motion": {"yaw": {"law": "constant-rate", "rate": 3.0}}},
        "link": [{"name": "mass", "mass": 2.0, "inertia": 0.1, "markers": {"O": {"at": [0, 0], "axis": [1, 0]}}}],
        "joint": [{"name": "S", "type": "prismatic", "between": ["frame.O", "mass.O"]}], "coordinate": [{"joint": "S"}], "actuator": [{"joint": "S"}],
    }
    run = linkdyn.Scene(scene).inverse([[0.5]], [[0.2]], t=1.3)
    assert np.isclose(run.driving_force.values[0, 0], -2.0 * 9.0 * 0.5, rtol=1e-14)
    assert np.allclose(run.reaction.values[0, 0], [0.0, 2 * 2.0 * 3.0 * 0.2, 0.0], rtol=1e-14, atol=1e-14)


def test_tables_and_what_is_left_out(tmp_path: Path) -> None:
    """A table of the six components; a frame that stands askew, and one that says no more than that it moves."""
    scene = arm()
    t = np.linspace(0, 2, 2001)
    rows = [",".join(["t", *NAMES]), *(",".join(map(repr, [float(instant), *(
        law["mean"] + law["amplitude"] * float(np.sin(law["frequency"] * instant + law["phase"])) for law in SPATIAL.values())])) for instant in t)]
    (tmp_path / "sea.csv").write_text("\n".join(rows) + "\n")
    by_law = linkdyn.Scene(scene).inverse()
    by_table = linkdyn.Scene({**scene, "frame": {**scene["frame"], "motion": {"table": "sea.csv"}}}, folder=tmp_path).inverse()
    assert np.abs(by_table.reaction.values - by_law.reaction.values).max() < 1e-4 * np.abs(by_law.reaction.values).max()
    askew = linkdyn.Scene({**scene, "frame": {**scene["frame"], "motion": {"pitch": "30 deg"}}}).inverse()
    tilted = {**scene, "gravity": (turning(np.array([0, np.pi / 6, 0])).T @ scene["gravity"]).tolist(), "frame": {"markers": scene["frame"]["markers"]}}
    expected = linkdyn.Scene(tilted).inverse()
    assert np.abs(askew.reaction.values - expected.reaction.values).max() < 1e-12 * np.abs(expected.reaction.values).max()


# ---------------------------------------------------------------- sweeps, figures of a cycle


def test_sweep_at_the_first_instant() -> None:
    scene = four_bar()
    scene["time"] = {"start": 0.37, "end": 2, "samples": 161}
    scene["sweep"] = {"axis": [{"coordinate": "A", "linspace": [0.0, 6.0, 41]}]}
    swept = linkdyn.Scene(scene).sweep()
    moving = linkdyn.Scene(four_bar())
    forces = moving.inverse(np.linspace(0, 6, 41)[:, np.newaxis], t=0.37).driving_force.values[:, 0]
    assert np.isclose(float(swept.driving_force_max.values.squeeze()), forces.max(), rtol=1e-12)


@pytest.mark.parametrize("make", [four_bar, arm])
def test_shaking_force_is_what_joints_and_springs_do(make: Any) -> None:
    """The frame gets what its joints, drives and springs take: by momentum on the one hand, by reactions on the other."""
    scene = make()
    scene.pop("spring", None)
    moving = linkdyn.Scene(scene)
    run = moving.inverse()
    shaken = cycle.shaking(run, moving)
    held = [joint["name"] for joint in scene["joint"] if "frame" in joint["between"][0]]
    n = 2 if moving.planar else 3
    reaction = -run.reaction.sel(joint=held).values[..., :n].sum(axis=1)
    assert np.abs(shaken.force.values - reaction).max() < 1e-9 * np.abs(reaction).max()


def test_causes_add_up() -> None:
    moving = linkdyn.Scene(four_bar())
    run = moving.inverse()
    parts = cycle.contributions(run, moving)
    assert list(parts.cause.values) == ["inertia", "frame", "weight", "spring S"]
    assert np.abs(parts.driving_force.sum("cause").values - run.driving_force.values).max() < 1e-9 * np.abs(run.driving_force.values).max()
    assert np.abs(parts.driving_force.sel(cause="frame").values).max() > 0.1


def test_held_still_on_a_ship() -> None:
    """In axes at rest the platform of the example stands still: its legs give it its weight and what pushes it, at every instant."""
    held = linkdyn.load(ROOT / "examples" / "ship_hexapod" / "scene.toml")
    run = held.inverse()
    balls = [name for name in held.joints if name.endswith(".S")]
    given = run.reaction.sel(joint=balls).values[..., :3].sum(axis=1) + [-4e3, 0, 0]
    turn = np.array([turning(angles) for angles in held.frame_motion()[0][:, 3:]])
    weight = np.einsum("nij,nj->ni", turn, given)
    assert np.abs(weight - [0, 0, 9e3 * 9.81]).max() < 1e-3 * 9e3 * 9.81


@pytest.mark.parametrize("make", [four_bar, arm])
def test_power_of_the_frame(make: Any) -> None:
    """What drives and frame give is what the energy in axes at rest grows by: that of the same motion of the driven ground."""
    scene = make()
    scene.pop("spring", None)
    scene["time"] = {"end": 2, "samples": 2001}
    moving, driven = linkdyn.Scene(scene), linkdyn.Scene(on_driven_ground(scene))
    run, other = moving.inverse(), driven.inverse()
    power = cycle.shaking(run, moving).frame_power.values
    ground = [name for name in driven.actuators if name.startswith("G.")]
    given = other.driving_power.sel(actuator=ground).sum("actuator").values
    assert np.abs(power - given).max() < 1e-9 * np.abs(given).max()
    about = cycle.shaking(run, moving, about=[0.3, -0.4] if moving.planar else [0.3, -0.4, 0.2]).frame_power.values
    assert np.abs(about - given).max() < 1e-9 * np.abs(given).max()


def test_sweep_over_time() -> None:
    """With an axis over time each sample is taken where the frame is then."""
    scene = hexapod()
    scene["sweep"] = {"axis": [{"time": True, "linspace": [0.0, 2.0, 21]}]}
    swept = linkdyn.Scene(scene).sweep()
    run = linkdyn.Scene(hexapod()).inverse(t=np.linspace(0.0, 2.0, 21))
    assert np.allclose(swept.driving_force_max.values.squeeze(), run.driving_force.values.max(axis=0), rtol=1e-12)


@pytest.mark.parametrize("make", [four_bar, hexapod])
def test_errors_of_free_runs(make: Any) -> None:
    """The similar mechanisms that errors are estimated by move with a frame of their size."""
    moving = linkdyn.Scene(let_go(make()))
    t = np.linspace(0, 1, 11)
    run = moving.forward(t=t, error=True, want="all")
    exact = moving.forward(t=t, rtol=1e-12, atol=1e-13)
    assert (run.status == 0).all()
    assert 0 < run.q_error.max() < 1e-6
    assert np.abs(run.q.values - exact.q.values).max() < 10 * float(run.q_error.max()) + 1e-12


@pytest.mark.parametrize("begin", [0.0, 1.5])
def test_impacts_on_a_frame_that_moves(begin: float) -> None:
    """A body on a rope tied beside its centre of mass, from a hook on a frame that goes and turns: flight by the equations in the
    turning frame, impacts by momentum."""
    mass, inertia, length, restitution = 2.0, 0.3, 1.1, 0.6
    hook, arm, gravity = np.array([0.1, 0.2]), np.array([0.15, 0.12]), np.array([0.5, -9.81])    # arm: from the centre of mass to the eye
    cog = np.array([0.05, -0.02])
    scene = linkdyn.Scene({
        "space": "planar", "gravity": gravity.tolist(), "time": {"start": begin, "end": begin + 1, "samples": 21},
        "frame": {"markers": {"H": hook.tolist()}, "motion": {
            "x": {"law": "harmonic", "amplitude": 0.3, "frequency": 4.0, "phase": 0.2}, "yaw": {"law": "harmonic", "amplitude": 0.4, "frequency": 3.0, "phase": 0.5}}},
        "link": [{"name": "body", "mass": mass, "inertia": inertia, "cog": cog.tolist(), "markers": {"E": (cog + arm).tolist()}}],
        "coordinate": [{"link": "body", "start": {"position": [0.3, -0.2], "angle": 0.4, "velocity": [1.0, 2.0], "angular_rate": 3.0}}],
        "measures": {"far": {"between": ["body.E", "frame.H"]}},
        "stop": [{"name": "rope", "measure": "far", "max": length, "restitution": restitution}],
    })  # fmt: skip

    def turned(angle: float, v: Any) -> NDArray[np.float64]:
        return np.array([math.cos(angle) * v[0] - math.sin(angle) * v[1], math.sin(angle) * v[0] + math.cos(angle) * v[1]])

    def square(v: Any) -> NDArray[np.float64]:
        return np.array([-v[1], v[0]])

    def rates(t: float, y: NDArray[np.float64]) -> list[float]:
        own = np.array([-0.3 * 16 * math.sin(4 * t + 0.2), 0])
        yaw, w, a = 0.4 * math.sin(3 * t + 0.5), 1.2 * math.cos(3 * t + 0.5), -3.6 * math.sin(3 * t + 0.5)
        return [*y[3:], *(turned(-yaw, gravity - own) - 2 * w * square(y[3:5]) - a * square(y[:2]) + w * w * y[:2]), -a]

    def slack(_: float, y: NDArray[np.float64]) -> float:
        return length - float(np.linalg.norm(y[:2] + turned(y[2], arm) - hook))

    slack.terminal, slack.direction = True, -1      # type: ignore[attr-defined]
    settings: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    offset = turned(0.4, cog)
    y = np.array([*(np.array([0.3, -0.2]) + offset), 0.4, *(np.array([1.0, 2.0]) + 3 * square(offset)), 3.0])
    t, grid, expected, impacts = begin, np.linspace(begin, begin + 1, 21), np.zeros((21, 3)), []
    while t < grid[-1]:
        flight = solve_ivp(rates, (t, grid[-1]), y, events=slack, dense_output=True, **settings)
        for k in np.flatnonzero((grid >= t) & (grid <= flight.t[-1])):
            at = flight.sol(grid[k])
            expected[k] = [*(at[:2] - turned(at[2], cog)), at[2]]
        t, y = flight.t[-1], flight.y[:, -1].copy()
        if flight.status == 1:
            lever = turned(y[2], arm)
            along = (y[:2] + lever - hook) / length
            turn = lever[0] * along[1] - lever[1] * along[0]
            speed, yielding = y[3:5] @ along + y[5] * turn, 1 / mass + turn**2 / inertia
            push = (1 + restitution) * speed / yielding
            impacts.append([t, push, 0.5 * (1 - restitution**2) * speed**2 / yielding])
            y[3:5] -= push * along / mass
            y[5] -= push * turn / inertia
            t += 1e-7                               # off the rope, where the next flight begins
            y = solve_ivp(rates, (t - 1e-7, t), y, **settings).y[:, -1]
    run = scene.forward(rtol=1e-11, atol=1e-12)
    assert not run.attrs["stopped"] and len(impacts) >= 2
    np.testing.assert_allclose(run.q, expected, atol=1e-10)
    np.testing.assert_allclose(np.transpose([run.event_time, run.event_impulse, run.event_loss]), impacts, rtol=1e-8)
