"""Locks that close while something rests at a stop: lifted off, or pressed there, by the impulse of the lock.

Velocities behind, the energy lost and which stops let go against a complementarity oracle of its own, by trying all sets of stops that push.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import linkdyn

METHODS = ["rk8pd", "rkf45", "gbs", "seulex", "msbdf", "rk4"]
RELEASE, CLOSE = 3, 6
INERTIA_A, INERTIA_B = 0.05, 0.09


def wheel_and_lever(ratio: float = -1.7, **lock: Any) -> dict[str, Any]:
    """Wheel A turns at -3 rad/s; lever B rests at its stop, pressed there by its weight; a lock joins them at 0.1 s."""
    return {
        "space": "planar",
        "gravity": [0, -9.81],
        "frame": {"markers": {"a": [0, 0], "b": [1, 0]}},
        "link": [
            {"name": "A", "mass": 1, "inertia": INERTIA_A, "markers": {"o": [0, 0]}},
            {"name": "B", "mass": 1, "inertia": INERTIA_B - 0.01, "cog": [0.1, 0], "markers": {"o": [0, 0], "t": [0.3, 0]}},
        ],
        "joint": [{"name": "a", "type": "revolute", "between": ["frame.a", "A.o"]}, {"name": "b", "type": "revolute", "between": ["frame.b", "B.o"]}],
        "coordinate": [{"joint": "a", "start": {"position": 0.0, "velocity": -3.0}}, {"joint": "b", "start": {"position": 0.0}}],
        "measures": {"tip": {"marker": "B.t", "component": "y"}, "turn": {"joint": "a"}},
        "clutch": [{"name": "lock", "joint": "a", "to": "b", "ratio": ratio, **(lock or {"from": 0.1})}],
        "stop": [{"name": "sb", "joint": "b", "min": 0.0, "restitution": 0.3}],
    }


def told(run: xr.Dataset, name: str, kind: int) -> list[int]:
    return [i for i in range(run.sizes.get("occurrence", len(run.event))) if run.event.values[i] == name and run.event_kind.values[i] == kind]


def lifted(ratio: float = -1.7, rate: float = -3.0) -> tuple[np.ndarray, float, float]:
    """Rates behind, impulse and energy lost, by hand."""
    impulse = -rate / (1 / INERTIA_A + ratio**2 / INERTIA_B)
    return np.array([rate + impulse / INERTIA_A, -ratio * impulse / INERTIA_B]), impulse, -impulse * rate / 2


def assert_energy_is_lost_where_told(run: xr.Dataset) -> None:
    assert run.attrs.get("stopped", "") == "" and np.all(run.status == 0)
    assert np.all(run.event_loss.values >= -1e-12)
    energy = (run.kinetic_energy + run.potential_energy - run.work).values
    # bounces between the samples are told as well
    assert energy[-1] - energy[0] == pytest.approx(-run.event_loss.values.sum(), abs=1e-8)


@pytest.mark.parametrize("method", METHODS)
def test_a_lock_lifts_what_rests_off_its_stop(method: str) -> None:
    run = linkdyn.Scene(wheel_and_lever()).forward(t=np.linspace(0, 0.2, 5), method=method)
    (close,), (release,) = told(run, "lock", CLOSE), told(run, "sb.min", RELEASE)
    after, impulse, loss = lifted()
    for i in (close, release):
        assert run.event_qd_after.values[i] == pytest.approx(after, rel=1e-12)
        assert run.event_time.values[i] == pytest.approx(0.1)
    assert run.event_impulse.values[close] == pytest.approx(impulse, rel=1e-12)
    assert run.event_loss.values[close] == pytest.approx(loss, rel=1e-12)
    assert run.qd.values[-1, 1] > 0.5
    assert_energy_is_lost_where_told(run)


def at_place(scene: dict[str, Any]) -> None:
    scene["stop"] = [{"name": "sb", "measure": "tip", "min": 0.0, "restitution": 0.3}]


def without_bounce(scene: dict[str, Any]) -> None:
    scene["stop"][0]["restitution"] = 0.0


def by_event(scene: dict[str, Any]) -> None:
    del scene["clutch"][0]["from"]
    scene["clutch"][0].update(from_event="go", begins="off")
    scene["event"] = [{"name": "go", "when": "turn+0.3 rad", "direction": "down"}]


def from_the_start(scene: dict[str, Any]) -> None:
    del scene["clutch"][0]["from"]


def at_zero(scene: dict[str, Any]) -> None:
    scene["clutch"][0]["from"] = 0.0


def beside_a_brake(scene: dict[str, Any]) -> None:
    scene["clutch"].append({"name": "brake", "joint": "b", "capacity": 0.2})


def that_sticks(scene: dict[str, Any]) -> None:
    scene["friction"] = [{"joint": "b", "coulomb": 0.1, "radius": 0.01, "sticking": True}]


@pytest.mark.parametrize("change", [at_place, without_bounce, by_event, from_the_start, at_zero, beside_a_brake, that_sticks])
def test_however_it_closes_and_whatever_stops(change) -> None:
    scene = wheel_and_lever()
    change(scene)
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 0.12, 5))
    (close,), releases = told(run, "lock", CLOSE), [i for i in range(len(run.event)) if run.event_kind.values[i] == RELEASE]
    after, _, loss = lifted()
    assert run.event_qd_after.values[close] == pytest.approx(after, rel=1e-9)
    assert run.event_loss.values[close] == pytest.approx(loss, rel=1e-9)
    assert len(releases) == 1
    assert run.attrs["stopped"] == "" and np.all(run.status == 0) and run.qd.values[-1, 1] > 0.5


def test_a_payload_of_that_instant_counts() -> None:
    scene = wheel_and_lever()
    scene["payload"] = [{"on": "B.t", "mass": 0.5, "from": 0.1}]
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 0.12, 5))
    impulse = 3 / (1 / INERTIA_A + 1.7**2 / (INERTIA_B + 0.5 * 0.3**2))
    (close,) = told(run, "lock", CLOSE)
    assert run.event_impulse.values[close] == pytest.approx(impulse, rel=1e-11)
    assert run.event_qd_after.values[close, 0] == pytest.approx(-3 + impulse / INERTIA_A, rel=1e-11)


def test_a_lock_that_presses_onto_a_stop_stops_all() -> None:
    """All of the wheel's momentum goes into the lock, all energy is lost; it was told as if the lever could go on through its stop."""
    run = linkdyn.Scene(wheel_and_lever(1.7)).forward(t=np.linspace(0, 0.2, 5))
    (close,) = told(run, "lock", CLOSE)
    assert run.event_impulse.values[close] == pytest.approx(3 * INERTIA_A, rel=1e-12)
    assert run.event_loss.values[close] == pytest.approx(9 * INERTIA_A / 2, rel=1e-12)
    assert np.abs(run.qd.values[-1]).max() < 1e-12 and not told(run, "sb.min", RELEASE)
    assert_energy_is_lost_where_told(run)


def test_what_is_driven_takes_the_lever_along() -> None:
    scene = wheel_and_lever()
    scene["coordinate"][0] = {"joint": "a", "driven": True, "motion": {"law": "constant-rate", "rate": -3.0}}
    scene["actuator"] = [{"joint": "a"}]
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 0.2, 5))
    (close,) = told(run, "lock", CLOSE)
    assert run.qd.values[-1] == pytest.approx([-3, 3 / 1.7], rel=1e-9)
    assert run.event_loss.values[close] == pytest.approx(INERTIA_B * (3 / 1.7) ** 2 / 2, rel=1e-10)
    assert_energy_is_lost_where_told(run)


def test_what_is_driven_onto_a_stop_is_told() -> None:
    scene = wheel_and_lever(1.7)
    scene["coordinate"][0] = {"joint": "a", "driven": True, "motion": {"law": "constant-rate", "rate": -3.0}}
    scene["actuator"] = [{"joint": "a"}]
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 0.2, 5))
    assert "stop 'sb.min' is driven" in run.attrs["stopped"]
    assert np.all(np.isnan(run.q.values[-1]))


def test_a_ball_is_caught_by_a_lever_at_rest() -> None:
    scene = wheel_and_lever()
    scene["link"][0] = {"name": "A", "mass": 1, "inertia": 0.01, "markers": {"o": [0, 0]}}
    scene["joint"], scene["measures"] = scene["joint"][1:], {}
    start = {"position": [1.3, -(3.981 * 0.1 - 9.81 * 0.01 / 2)], "angle": 0.0, "velocity": [0, 3.981], "angular_rate": 0.0}
    scene["coordinate"] = [scene["coordinate"][1], {"link": "A", "start": start}]
    scene["clutch"] = [{"name": "lock", "between": ["B.t", "A.o"], "type": "revolute", "from": 0.1}]
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 0.2, 5))
    (close,) = told(run, "lock", CLOSE)
    assert run.event_qd_after.values[close][:3] == pytest.approx([5, 0, 1.5], abs=1e-9)
    assert run.event_loss.values[close] == pytest.approx(2.25, rel=1e-9)
    assert_energy_is_lost_where_told(run)


def test_ensembles_and_simulators_do_as_runs_do() -> None:
    scene = linkdyn.Scene(wheel_and_lever())
    t = np.linspace(0, 0.2, 5)
    alone = scene.forward(t=t)
    many = scene.ensemble(q=np.zeros((9, 2)), qd=np.column_stack([np.linspace(-3, -2, 9), np.zeros(9)]), t=t)
    assert np.all(many.status == 0)
    assert many.qd.values[0, -1] == pytest.approx(alone.qd.values[-1], rel=1e-7)
    other = wheel_and_lever()
    other["coordinate"][0]["start"]["velocity"] = -2.0
    assert many.qd.values[8, -1] == pytest.approx(linkdyn.Scene(other).forward(t=t).qd.values[-1], rel=1e-7)


@pytest.mark.parametrize("ratio", [-1.7, 1.7])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_what_locks_where_it_strikes_a_stop_comes_to_an_end(ratio: float, restitution: float) -> None:
    """The wheel is at its own stop at the instant of the lock: impulses of both come to an end, hundreds of events ended the run."""
    scene = wheel_and_lever(ratio)
    by_event(scene)
    scene["stop"].append({"name": "sa", "joint": "a", "min": -0.3, "restitution": restitution})
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 0.2, 5))
    assert_energy_is_lost_where_told(run)
    assert len(run.event) < 30
    assert run.q.values[:, 0].min() > -0.3 - 1e-7 and run.q.values[:, 1].min() > -1e-7
    slip = run.qd.values[-1, 0] - ratio * run.qd.values[-1, 1]
    assert abs(slip) < 1e-9


# --------------------------------------------------------------------------------------------------------------- many, against an oracle
class Rotors:
    """Rotors, of which some rest at stops, and locks between them that close at one instant."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        self.n = int(random.integers(2, 6))
        self.inertia = random.uniform(0.02, 0.3, self.n)
        self.rests = random.random(self.n) < 0.6
        self.side = random.choice([-1, 1], self.n)
        self.rate = np.where(self.rests, 0.0, random.uniform(-4, 4, self.n))
        pairs = list(itertools.combinations(range(self.n), 2))
        chosen = random.choice(len(pairs), int(random.integers(1, min(4, len(pairs) + 1))), replace=False)
        self.locks = [(*pairs[i], float(random.choice([-1, 1]) * random.uniform(0.4, 2.5))) for i in chosen]
        self.restitution = random.uniform(0, 1, self.n)

    def scene(self) -> dict[str, Any]:
        names = [f"r{i}" for i in range(self.n)]
        return {
            "space": "planar",
            "frame": {"markers": {f"m{i}": [i, 0] for i in range(self.n)}},
            "link": [{"name": f"L{i}", "mass": 1, "inertia": self.inertia[i], "markers": {"o": [0, 0]}} for i in range(self.n)],
            "joint": [{"name": names[i], "type": "revolute", "between": [f"frame.m{i}", f"L{i}.o"]} for i in range(self.n)],
            "coordinate": [{"joint": names[i], "start": {"position": 0.0, "velocity": self.rate[i]}} for i in range(self.n)],
            "spring": [{"name": f"k{i}", "joint": names[i], "stiffness": 2.0, "rest": -0.5 * self.side[i]} for i in range(self.n) if self.rests[i]],
            "stop": [
                {"name": f"s{i}", "joint": names[i], "min" if self.side[i] > 0 else "max": 0.0, "restitution": self.restitution[i]}
                for i in range(self.n)
                if self.rests[i]
            ],
            "clutch": [
                {"name": f"lock{k}", "joint": names[a], "to": names[b], "ratio": ratio, "from": 0.01} for k, (a, b, ratio) in enumerate(self.locks)
            ],
        }

    def behind(self) -> np.ndarray:
        """Rates behind the impulses: of all sets of stops that push the one that fits."""
        slip = np.zeros((len(self.locks), self.n))
        for k, (a, b, ratio) in enumerate(self.locks):
            slip[k, a], slip[k, b] = 1, -ratio
        apart = np.diag(self.side.astype(float))[self.rests]
        for n in range(len(apart) + 1):
            for pushing in itertools.combinations(range(len(apart)), n):
                rows = np.vstack([slip, apart[list(pushing)]])
                push = np.linalg.lstsq(rows @ (rows / self.inertia).T, -rows @ self.rate, rcond=1e-10)[0]
                after = self.rate + rows.T @ push / self.inertia
                if np.all(push[len(slip) :] >= -1e-10) and np.all(apart @ after >= -1e-10) and np.allclose(rows @ after, 0, atol=1e-9):
                    return after
        raise AssertionError("no set of stops fits")


@pytest.mark.parametrize("seed", range(60))
def test_random_rotors_behind_locks(seed: int) -> None:
    rotors = Rotors(seed)
    scene = rotors.scene()
    run = linkdyn.Scene(scene).forward(t=np.linspace(0, 0.02, 3), rtol=1e-11, atol=1e-11)
    closes = [i for i in range(len(run.event)) if run.event_kind.values[i] == CLOSE]
    assert len(closes) == len(rotors.locks)
    before, told_after = run.event_qd.values[closes[0]], run.event_qd_after.values[closes[0]]
    assert before == pytest.approx(rotors.rate, abs=1e-9)
    after = rotors.behind()
    assert told_after == pytest.approx(after, abs=1e-9)
    loss = rotors.inertia @ (before**2 - told_after**2) / 2
    assert run.event_loss.values[closes].sum() == pytest.approx(loss, rel=1e-9, abs=1e-12)
    lifts = {f"s{i}.{'min' if rotors.side[i] > 0 else 'max'}" for i in range(rotors.n) if rotors.rests[i] and rotors.side[i] * after[i] > 1e-9}
    at_once = np.abs(run.event_time.values - 0.01) < 1e-9
    assert lifts <= set(run.event.values[at_once & (run.event_kind.values == RELEASE)])
    assert_energy_is_lost_where_told(run)


# ------------------------------------------------------------------------------------------------------------------ joined links in space
def body_and_lever(kind: str, rise: float) -> dict[str, Any]:
    """A body that flies by is joined to a lever which a spring presses onto its stop."""
    start = {"position": [0.3, 0.1, -0.02], "angles": [0.1, 0.2, 0.3], "velocity": [0.4, -0.3, rise], "angular_rates": [0.5, -0.8, 1.0]}
    lever = {"o": {"at": [0, 0, 0], "axis": [0, -1, 0]}, "t": {"at": [0.3, 0.05, 0], "axis": [0.2, 0.3, 1]}}
    return {
        "space": "spatial",
        "gravity": [0, 0, 0],
        "frame": {"markers": {"b": {"at": [0, 0, 0], "axis": [0, -1, 0]}}},
        "link": [
            {"name": "B", "mass": 1.3, "inertia": [0.05, 0.08, 0.06, 0, 0, 0], "cog": [0.15, 0.01, 0.02], "markers": lever},
            {"name": "A", "mass": 0.8, "inertia": [0.02, 0.03, 0.015, 0, 0, 0], "markers": {"g": {"at": [0.05, 0, 0.02], "axis": [0, 0.4, 1]}}},
        ],
        "joint": [{"name": "b", "type": "revolute", "between": ["frame.b", "B.o"]}],
        "coordinate": [{"joint": "b", "start": {"position": 0.0}}, {"link": "A", "start": start}],
        "spring": [{"name": "k", "joint": "b", "stiffness": 2.0, "rest": -0.5}],
        "clutch": [{"name": "lock", "between": ["B.t", "A.g"], "type": kind, "from": 2e-4}],
        "stop": [{"name": "s", "joint": "b", "min": 0.0, "restitution": 0.4}],
    }


@pytest.mark.parametrize("kind", ["fixed", "spherical", "revolute", "prismatic", "cylindrical"])
@pytest.mark.parametrize("rise", [3.0, -3.0])
def test_links_joined_in_space_lift_or_press(kind: str, rise: float) -> None:
    """Lifted off, all is as without the stop; pressed onto it, as with a lever that is held."""
    scene = body_and_lever(kind, rise)
    t = [0.0, 2e-4, 4e-4]
    run = linkdyn.Scene(scene).forward(t=t, rtol=1e-12, atol=1e-12)
    other = {key: value for key, value in scene.items() if key not in ("stop", "spring")}
    if rise < 0:
        other = {**other, "clutch": [*scene["clutch"], {"name": "hold", "joint": "b"}]}
    expected = linkdyn.Scene(other).forward(t=t, rtol=1e-12, atol=1e-12)
    (close,), (like,) = told(run, "lock", CLOSE), told(expected, "lock", CLOSE)
    assert run.event_qd_after.values[close] == pytest.approx(expected.event_qd_after.values[like], abs=1e-12)
    assert len(told(run, "s.min", RELEASE)) == (rise > 0)
    assert_energy_is_lost_where_told(run)


@pytest.mark.parametrize("method", ["gbs", "seulex", "rk4"])
def test_a_brake_on_what_rests_at_its_stop_holds_it(method: str) -> None:
    """The impact has left a speed of 1e-16 rad/s, either way: that is no slip."""
    run = linkdyn.load(Path(__file__).parents[1] / "holding" / "brake_at_stop.toml").forward(method=method)
    assert run.attrs["stopped"] == ""
    held = run.isel(sample=run.time.values > 0.51)
    holds = list(run.clutch_state.attrs["flag_meanings"].split()).index("holds")
    assert (held.clutch_state == holds).all()
    assert abs(held.clutch_force).max() <= 3.0
