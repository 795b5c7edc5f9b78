"""No step leaps over what laws do within it, however long it may be by its error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from integrators import CONTROLLED

HEIGHT, WIDTH = 2.0, np.radians(20.0)
"""Of a torque's triangle over the angle [N m]."""


def flywheel(**parts: Any) -> dict[str, Any]:
    return {
        "space": "planar",
        "frame": {"markers": {"O": [0, 0]}},
        "link": [{"name": "wheel", "mass": 2, "inertia": 0.5, "markers": {"O": [0, 0]}}],
        "joint": [{"name": "J", "type": "revolute", "between": ["frame.O", "wheel.O"]}],
        "coordinate": [{"joint": "J", "start": {"position": 0, "velocity": 10}}],
        "measures": {"phi": {"joint": "J"}},
        "time": {"end": 6, "samples": 2},
    } | parts


@pytest.mark.parametrize("method", CONTROLLED)
def test_a_pulse_in_every_turn(method: str, tmp_path: Path) -> None:
    """Of 20 degrees: each adds its area to the energy."""
    table = {"gas": {"table": "gas.csv", "column": "M", "over": "phi", "period": "360 deg"}}
    rows = ["phi,M", *(f"{np.radians(a)},{m}" for a, m in ((0, 0), (170, 0), (180, HEIGHT), (190, 0), (360, 0)))]
    (tmp_path / "gas.csv").write_text("\n".join(rows) + "\n")
    scene = linkdyn.Scene(flywheel(laws=table, load=[{"on": "wheel.O", "moment": "gas"}]), folder=tmp_path)
    run = scene.forward(method=method)
    turns = np.floor((run.q.values[-1, 0] - np.radians(190)) / (2 * np.pi)) + 1
    assert (run.status == 0).all()
    np.testing.assert_allclose(run.qd.values[-1, 0], np.sqrt(100 + 2 * turns * HEIGHT * WIDTH / 2 / 0.5), rtol=1e-5)


LOADS = {
    "triangle": ("20 N m*max(0, 1 - abs(time - 3.3 s)/(0.01 s))", 0.2),
    "box": ("20 N m*step(time - 3.3 s)*step(3.31 s - time)", 0.2),
    "bell": ("20 N m*exp(-((time - 3.3 s)/(0.01 s))^2)", 0.2 * np.sqrt(np.pi)),
    "dip": ("1 N m - 20 N m*max(0, 1 - abs(time - 3.3 s)/(0.01 s))", 6 - 0.2),
    "over the angle": ("20 N m*max(0, 1 - abs(phi - 33 rad)/(0.1 rad))", None),
}


@pytest.mark.parametrize("method", CONTROLLED)
@pytest.mark.parametrize("name", LOADS)
def test_a_push_in_a_long_run(name: str, method: str) -> None:
    """Of a few hundredths of a second in six, while the wheel turns evenly and steps grow."""
    formula, momentum = LOADS[name]
    run = linkdyn.Scene(flywheel(load=[{"on": "wheel.O", "moment": formula}])).forward(method=method)
    assert (run.status == 0).all()
    end = np.sqrt(100 + 2 * 20 * 0.1 / 0.5) if momentum is None else 10 + momentum / 0.5
    np.testing.assert_allclose(run.qd.values[-1, 0], end, rtol=1e-5)


@pytest.mark.parametrize("method", CONTROLLED)
def test_a_push_over_the_place_of_a_marker_that_is_driven_round(method: str) -> None:
    """Ten times a second; a mass on a slide beside it feels a force while the marker is near."""
    scene = flywheel(
        link=[
            {"name": "wheel", "mass": 2, "inertia": 0.5, "markers": {"O": [0, 0], "P": [1, 0]}},
            {"name": "mass", "mass": 2, "markers": {"O": [0, 0]}},
        ],
        joint=[
            {"name": "J", "type": "revolute", "between": ["frame.O", "wheel.O"]},
            {"name": "S", "type": "prismatic", "between": ["frame.O", "mass.O"]},
        ],
        coordinate=[{"joint": "J", "motion": {"law": "constant-rate", "rate": "600 rpm"}}, {"joint": "S", "start": 0}],
        measures={"x": {"marker": "wheel.P", "component": "x"}},
        load=[{"on": "mass.O", "force": ["10 N*max(0, (x - 0.95 m)/(1 m))", 0]}],
        time={"end": 2.05, "samples": 2},
    )
    run = linkdyn.Scene(scene).forward(method=method)
    top = np.arccos(0.95)
    impulse = 10 * (2 * np.sin(top) - 2 * 0.95 * top) / (20 * np.pi)
    # twenty times wholly, and half of it where the run begins
    np.testing.assert_allclose(run.qd.values[-1, 1], 20.5 * impulse / 2, rtol=1e-4)


@pytest.mark.parametrize("method", CONTROLLED)
def test_a_table_over_time(method: str, tmp_path: Path) -> None:
    """Its rows end steps."""
    (tmp_path / "push.csv").write_text("time,M\n0,0\n3.3,0\n3.31,20\n3.32,0\n6,0\n")
    law = {"push": {"table": "push.csv", "column": "M", "over": "time"}}
    scene = linkdyn.Scene(flywheel(laws=law, load=[{"on": "wheel.O", "moment": "push"}]), folder=tmp_path)
    run = scene.forward(method=method)
    np.testing.assert_allclose(run.qd.values[-1, 0], 10 + 0.2 / 0.5, rtol=1e-8)


@pytest.mark.parametrize("method", CONTROLLED)
def test_a_spline_over_time(method: str, tmp_path: Path) -> None:
    """Its rows end no steps: 3 of 300 are not zero. What it adds comes from the same spline by scipy."""
    time = np.linspace(0.0, 6.0, 301)
    moment = np.where(np.abs(time - 3.3) < 0.03, 20.0, 0.0)
    (tmp_path / "push.csv").write_text("t,M\n" + "\n".join(f"{t:.17g},{m:.17g}" for t, m in zip(time, moment)) + "\n")
    load = {"on": "wheel.O", "moment": {"law": "table", "table": "push.csv", "column": "M", "interpolation": "spline"}}
    run = linkdyn.Scene(flywheel(load=[load]), folder=tmp_path).forward(method=method)
    added = CubicSpline(time, moment, bc_type="not-a-knot").integrate(0.0, 6.0) / 0.5
    np.testing.assert_allclose(run.qd.values[-1, 0], 10 + added, rtol=1e-6)


@pytest.mark.parametrize("method", CONTROLLED[:-1])
def test_instants_change_nothing(method: str) -> None:
    scene = linkdyn.Scene(flywheel(load=[{"on": "wheel.O", "moment": LOADS["over the angle"][0]}]))
    few, many = (scene.forward(t=np.linspace(0.0, 6.0, n), method=method) for n in (2, 301))
    np.testing.assert_array_equal(few.q.values[-1], many.q.values[-1])


def test_feedback_is_no_peak() -> None:
    """A law that is the small difference of large numbers, and the hump that interpolation makes of it, ask for no short steps."""
    law = "3 N m s/rad*(90 rad/s + 70 rad/s^2*min(time, 1.6 s) - w)"
    scene = flywheel(
        measures={"w": {"joint": "J", "rate": True}},
        actuator=[{"joint": "J", "law": {"type": "formula", "value": f"max(0 N m, min(130 N m, {law}))"}}],
    )
    run = linkdyn.Scene(scene).forward(method="rk8pd")
    assert run.attrs["steps"] < 300


WITHIN_ROUNDING = {
    "a hinge's own point, as the link sees it": {"marker": "frame.A", "component": "x", "rate": True, "relative_to": "L"},
    "two points of a link and its hinge": {"between": ["frame.A", "L.W"], "rate": True},
    "a difference of one speed from itself": {"marker": "L.W", "component": "x", "rate": True},
}


@pytest.mark.parametrize("method", CONTROLLED)
@pytest.mark.parametrize("measure", WITHIN_ROUNDING)
def test_what_is_zero_within_rounding_has_no_peaks(measure: str, method: str) -> None:
    """Its ups and downs are not looked at one by one: the run is that without it, as is the number of steps or nearly so."""
    plain: dict[str, Any] = {
        "space": "planar", "gravity": [0, -9.81],
        "frame": {"markers": {"A": [0.1, 0.2]}},
        "link": [{"name": "L", "mass": 1, "cog": [0.3, 0], "inertia": 0.01, "markers": {"A": [0.13, -0.07], "W": [0.3, 0.11], "V": [0.3, 0.11]}}],
        "joint": [{"name": "J", "type": "revolute", "between": ["frame.A", "L.A"]}],
        "coordinate": [{"joint": "J", "start": {"position": 0.2, "velocity": 0.5}}],
        "time": {"end": 0.5, "samples": 5},
    }
    other = {"marker": "L.V", "component": "x", "rate": True}
    force = "13 N*s/m*(w - v)" if measure.startswith("a difference") else "13 N*s/m*w"
    laws = {"measures": {"w": WITHIN_ROUNDING[measure], "v": other}, "load": [{"on": "L.W", "force": [0, force]}]}
    without, run = (linkdyn.Scene(scene).forward(method=method) for scene in (plain, plain | laws))
    assert (run.status == 0).all() and run.attrs["stopped"] == ""
    np.testing.assert_allclose(run.q, without.q, atol=1e-8)
    assert run.attrs["steps"] <= 2 * without.attrs["steps"] + 10
