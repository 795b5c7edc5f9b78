"""How far a coordinate goes before a loop ends its way: `explain` against triangles."""

from __future__ import annotations

import math
import re
from typing import Any

import linkdyn
import numpy as np
import pytest


def four_bar(crank: float, coupler: float, rocker: float, base: float) -> dict[str, Any]:
    def bar(name: str, first: str, second: str, length: float) -> dict[str, Any]:
        return {"name": name, "mass": 1.0, "inertia": 0.01, "markers": {first: [0.0, 0.0], second: [length, 0.0]}}

    return {
        "space": "planar",
        "frame": {"markers": {"A": [0.0, 0.0], "D": [base, 0.0]}},
        "link": [bar("crank", "A", "B", crank), bar("coupler", "B", "C", coupler), bar("rocker", "D", "C", rocker)],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]},
            {"name": "B", "type": "revolute", "between": ["crank.B", "coupler.B"]},
            {"name": "C", "type": "revolute", "between": ["coupler.C", "rocker.C"]},
            {"name": "D", "type": "revolute", "between": ["frame.D", "rocker.D"]},
        ],
        "coordinate": [{"joint": "A", "start": "40 deg"}],
        "actuator": [{"joint": "A"}],
    }


def reach(scene: dict[str, Any]) -> str:
    """The line under the title."""
    found = re.search(r"^Reach from the start.*\n +(.*)$", linkdyn.Scene(scene).explain(), re.M)
    assert found
    return found[1]


def test_crank_goes_round() -> None:
    """Grashof: shortest and longest together are less than the others."""
    assert reach(four_bar(0.1, 0.3, 0.25, 0.3)) == "A goes all the way round"


@pytest.mark.parametrize(("crank", "coupler", "rocker", "base"), [(0.3, 0.25, 0.2, 0.4), (0.5, 0.3, 0.35, 0.45)])
def test_rocker_ends_where_the_others_are_in_line(crank: float, coupler: float, rocker: float, base: float) -> None:
    """Coupler and rocker stretched: a triangle of three sides."""
    end = math.degrees(math.acos((crank**2 + base**2 - (coupler + rocker) ** 2) / (2 * crank * base)))
    numbers = [float(number) for number in re.findall(r"-?[\d.]+(?= deg)", reach(four_bar(crank, coupler, rocker, base)))]
    assert numbers == pytest.approx([-end, end], abs=1e-5)


def test_slide_ends_where_the_crank_is_in_line() -> None:
    """A piston that leads: crank and rod stretched, or one on the other."""
    scene = four_bar(0.1, 0.3, 0.2, 0.5)
    scene["frame"]["markers"]["S"] = {"at": [0.0, 0.0], "axis": [1.0, 0.0]}
    scene["link"][2] = {"name": "piston", "mass": 1.0, "inertia": 0.01, "markers": {"C": [0.0, 0.0], "S": {"at": [0.0, 0.0], "axis": [1.0, 0.0]}}}
    scene["joint"][2:] = [
        {"name": "C", "type": "revolute", "between": ["coupler.C", "piston.C"]},
        {"name": "S", "type": "prismatic", "between": ["frame.S", "piston.S"]},
    ]
    scene["coordinate"], scene["actuator"] = [{"joint": "S", "start": 0.33}], [{"joint": "S"}]
    numbers = [float(number) for number in re.findall(r"-?[\d.]+(?= m\b)", reach(scene))]
    assert numbers == pytest.approx([0.2, 0.4], abs=1e-6)


def tangent_mechanism(n: int) -> linkdyn.Scene:
    """A block on a crank leads a slide along the line x = 1: its place is the tangent of the crank's angle. Drawn in space, closed by iteration."""
    hinge, along, across = ({"axis": axis, "x": x} for axis, x in (([0, 0, 1], [1, 0, 0]), ([1, 0, 0], [0, 0, 1]), ([0, 1, 0], [0, 0, 1])))
    body = {"mass": 1.0, "inertia": {"diagonal": [1, 1, 1]}}
    at = {"at": [0, 0, 0]}
    return linkdyn.Scene({
        "space": "spatial",
        "gravity": [0, -9.81, 0],
        "frame": {"markers": {"A": at | hinge, "G": {"at": [1, 0, 0]} | across}},
        "link": [
            {"name": "crank", "markers": {"A": at | hinge, "S": at | along}} | body,
            {"name": "block", "markers": {"S": at | along, "B": at | hinge}} | body,
            {"name": "slide", "markers": {"B": at | hinge, "G": at | across}} | body,
        ],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]},
            {"name": "S", "type": "prismatic", "between": ["crank.S", "block.S"], "start": 1.0},
            {"name": "B", "type": "revolute", "between": ["block.B", "slide.B"]},
            {"name": "G", "type": "prismatic", "between": ["frame.G", "slide.G"]},
        ],
        "coordinate": [{"joint": "A", "motion": {"law": "constant-rate", "rate": 1.0, "start": 0.2}}],
        "actuator": [{"joint": "A"}],
        "time": {"end": 3.0, "samples": n},
    })


@pytest.mark.parametrize("n", [11, 45, 101, 1001])
def test_no_motion_goes_by_way_of_infinity(n):
    """At 90 degrees the slide is infinitely far away; what closes beyond is no continuation, however many samples there are."""
    run = tangent_mechanism(n).inverse()
    crank = 0.2 + run.time.values
    assert ((run.status.values == 0) == (crank < np.pi / 2)).all()
    assert run.attrs["change_points_passed"] == 0
    reached = run.status.values == 0
    assert run.joint_variable.sel(variable="G.slide").values[reached] == pytest.approx(np.tan(crank[reached]), rel=1e-9)
