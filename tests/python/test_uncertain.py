"""Near change points and dead points: what has lost its digits is flagged, by every solver alike."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import linkdyn

sys.path.insert(0, str(Path(__file__).parents[1] / "hard"))

from cases import four_bar  # noqa: E402

SOLVERS = ("elimination", "lapack", "gauss-jordan", "reduced")


def dyad() -> dict[str, Any]:
    return four_bar("Parallelogram", 1.0, 2.0, 1.0, 2.0) | {"load": []}


def group_in_the_plane() -> dict[str, Any]:
    """The coordinate is between crank and coupler, and turns against the crank."""
    scene = dyad()
    poses = [([0.0, 0.0], 1.0), ([float(np.cos(1.0)), float(np.sin(1.0))], 0.0), ([2.0, 0.0], 1.0)]
    scene["link"] = [link | {"start": {"position": at, "angle": angle}} for link, (at, angle) in zip(scene["link"], poses)]
    scene["joint"] = [{key: value for key, value in joint.items() if key != "branch"} for joint in scene["joint"]]
    return scene | {"coordinate": [{"joint": "J2", "start": -1.0}], "actuator": [{"joint": "J2"}]}


def pair_in_space() -> dict[str, Any]:
    return tomllib.loads((Path(__file__).parents[1] / "scenes" / "rusr_parallelogram.toml").read_text())


@pytest.mark.parametrize(("make", "sense", "inertia", "coupler", "flagged"), [
    # Crank of 2 kg and follower of 3 kg turn about their ends, the coupler of 5 kg moves along a circle.
    (dyad, 1, (2 + 3) * (0.1 + 0.5**2 + 0.0625**2) + 5, 5, 5e-4),
    (group_in_the_plane, -1, (2 + 3) * (0.1 + 0.5**2 + 0.0625**2) + 5, 5, 5e-4),
    (pair_in_space, 1, 2 * (0.09 + 0.5**2) + 2, 2, 5e-4),
])
@pytest.mark.parametrize("angle", 10.0 ** -np.arange(1.0, 13.0))
def test_change_point_of_a_parallelogram(
    make: Callable[[], dict[str, Any]], sense: int, inertia: float, coupler: float, flagged: float, angle: float
) -> None:
    """The parallelogram moves as its crank, so its torque is known by hand; it is right to three digits, or none is given. Of
    the solvers none says otherwise than the others, whether links are placed in closed form or by iteration."""
    scene = linkdyn.Scene(make() | {"gravity": [0.0] * (3 if make is pair_in_space else 2)})
    rate2 = 3.0
    q = sense * np.array([[np.pi - 0.5], [np.pi - angle]])
    states = {"q": q, "qd": [[sense * 4.0]] * 2, "qdd": [[sense * rate2]] * 2, "t": [0.0, 1.0]}
    found = []
    for solver in SOLVERS:
        run = scene.inverse(**states, solver=solver)
        found.append(int(run.status.values[-1]))
        if found[-1] == 0:
            want = sense * inertia * rate2
            # An error of the accelerations is one of forces of the coupler along the bars: its mass, 16 m/s^2.
            assert abs(run.driving_force.values[-1, 0] - want) < 1e-3 * (abs(want) + coupler * 16)
        else:
            assert np.isnan(run.driving_force.values[-1]).all()
    assert len(set(found)) == 1
    assert (found[0] == 0) == (angle > flagged)


def free_parallelogram() -> dict[str, Any]:
    """On its way through its change point at theta = 0, where M theta'' = -2 g cos(theta) with M = 1.7 kg m2."""
    links = [("crank", "A", "B", 1.0), ("coupler", "B", "C", 2.0), ("rocker", "D", "C", 1.0)]
    pairs = [("A", "frame", "crank"), ("B", "crank", "coupler"), ("C", "coupler", "rocker"), ("D", "frame", "rocker")]
    return {
        "space": "planar",
        "gravity": [0.0, -9.81],
        "frame": {"markers": {"A": [0.0, 0.0], "D": [2.0, 0.0]}},
        "link": [
            {"name": name, "mass": 1.0, "inertia": 0.1, "cog": [length / 2, 0.0], "markers": {a: [0.0, 0.0], b: [length, 0.0]}}
            for name, a, b, length in links
        ],
        "joint": [{"name": j, "type": "revolute", "between": [f"{one}.{j}", f"{other}.{j}"]} for j, one, other in pairs],
        "coordinate": [{"joint": "A", "start": {"position": 1.0, "velocity": -1.0}}],
        "actuator": [{"joint": "A", "law": {"type": "constant", "value": 0.0}}],
    }


def forward(scene: linkdyn.Scene, t: np.ndarray, method: str, **options: float) -> Any:
    return scene.forward(t=t, method=method, **options)


@pytest.mark.thorough
@pytest.mark.parametrize("method", ["rk8pd", "gbs", "rkf45", "seulex", "msbdf", "rk4"])
def test_runs_by_way_of_a_change_point(method: str) -> None:
    """An instant of output however near it: results are right or flagged, reactions too, and so is what follows."""
    scene = linkdyn.Scene(free_parallelogram())

    def rates(t: float, y: np.ndarray) -> list[float]:
        return [y[1], -2 * 9.81 * np.cos(y[0]) / 1.7]

    way = solve_ivp(rates, (0, 1.5), [1.0, -1.0], rtol=1e-13, atol=1e-13, method="DOP853", dense_output=True).sol
    instant = brentq(lambda t: way(t)[0], 0.0, 0.6)
    across = scene.inverse(q=[[0.05]], qd=[way(instant)[1:]], qdd=[rates(0.0, [0.05, 0.0])[1:]])
    largest = 1.1 * np.abs(across.reaction.values).max()
    for part in (0.0, 1e-7, 1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3):
        for side in (-1.0, 1.0):
            t = np.array([0.0, instant + side * part / way(instant)[1], 1.5])
            run = forward(scene, t, method)
            ok = run.status.values == 0
            # rk4 knows a wrong step by a hundred-thousandth of the energy in motion: 5e-6 of the speed, for the second that follows.
            assert np.abs(run.q.values[ok, 0] - way(t)[0][ok]).max() < 1e-5 * np.abs(way(t)[1]).max()
            assert np.abs(run.reaction.values[ok]).max() < largest


@pytest.mark.parametrize(
    ("method", "options"), [("rk4", {"step": 1e-2}), ("rk4", {"step": 1e-3})]
)
def test_steps_that_leap_over_a_peak_end_the_run(method: str, options: dict[str, float]) -> None:
    """A follower longer by 1e-6 m: near its change points forces rise for a moment that coarse steps pass by, and energy with them."""
    scene = free_parallelogram()
    scene["link"][2]["markers"]["C"] = [1.000001, 0.0]
    run = forward(linkdyn.Scene(scene), np.linspace(0.0, 1.5, 16), method, **options)
    energy = (run.kinetic_energy + run.potential_energy).values[run.status.values == 0]
    assert "energy would change" in run.attrs["stopped"] and "too long" in run.attrs["stopped"]
    assert np.ptp(energy) < 0.05 * energy[0]


def test_multistep_steps_do_not_leap_over_a_peak() -> None:
    """Links that have turned back over a step of msbdf make it shorter. At this tolerance the run once ended where energy changed."""
    scene = free_parallelogram()
    scene["link"][2]["markers"]["C"] = [1.000001, 0.0]
    t = np.linspace(0.0, 1.5, 16)
    good = forward(linkdyn.Scene(scene), t, "gbs", rtol=1e-10, atol=1e-10)
    run = forward(linkdyn.Scene(scene), t, "msbdf", rtol=1e-3, atol=1e-3)
    assert not run.status.values.any()
    np.testing.assert_allclose(run.q.values, good.q.values, rtol=0, atol=0.2)


def test_the_multistep_method_takes_such_steps_again() -> None:
    """At a fine tolerance, where its steps are short enough but for what the last ones were taken by."""
    scene = free_parallelogram()
    scene["link"][2]["markers"]["C"] = [1.000001, 0.0]
    run = forward(linkdyn.Scene(scene), np.linspace(0.0, 1.5, 16), "msbdf", rtol=1e-6, atol=1e-6)
    energy = (run.kinetic_energy + run.potential_energy).values[run.status.values == 0]
    assert run.attrs["stopped"] == "" and np.ptp(energy) < 1e-3 * energy[0]


@pytest.mark.parametrize("angle", [1e-2, 1e-3])
def test_estimates_of_groups_near_change_points(angle: float) -> None:
    """The torque is known by hand. Copies that begin where the sample's links are would err as they do: 50 to 20,000 times more than told."""
    scene = linkdyn.Scene(group_in_the_plane() | {"gravity": [0.0, 0.0]})
    q = np.array([[0.5 - np.pi], [angle - np.pi]])
    run = scene.inverse(q, [[-4.0]] * 2, [[-3.0]] * 2, t=[0.0, 1.0], error=True)
    want = -3 * ((2 + 3) * (0.1 + 0.5**2 + 0.0625**2) + 5)
    error = abs(run.driving_force.values[-1, 0] - want)
    assert run.status.values[-1] == 0 and 0 < error < run.driving_force_error.values[-1, 0] < 1e-4
