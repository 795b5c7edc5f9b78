"""What is left of slides that let go of what others hold acts at the second marker, whichever link is named first.

By hand, and by the reduced solver, which asks for no reaction.
"""

from __future__ import annotations

from typing import Any

import linkdyn
import numpy as np
import pytest

SOLVERS = ["elimination", "gauss-jordan", "lapack"]
ORDERS = [False, True]


def joint(name: str, kind: str, first: str, second: str, swapped: bool) -> dict[str, Any]:
    return {"name": name, "type": kind, "between": [second, first] if swapped else [first, second]}


@pytest.mark.parametrize("swapped", ORDERS)
@pytest.mark.parametrize("solver", SOLVERS)
def test_moments_on_a_car_between_slides_add_up(solver: str, swapped: bool) -> None:
    """A cross slide whose head a guide holds, too: of three moments one is more than is needed, all forces are determinate."""
    along_x, along_y = {"axis": [1, 0]}, {"axis": [0, 1]}
    scene = linkdyn.Scene({
        "space": "planar", "gravity": [0, -10],
        "frame": {"markers": {"X": {"at": [-0.3, 0], **along_x}, "S": {"at": [0.1, 0], **along_y}}},
        "link": [
            {"name": "car", "mass": 1, "inertia": 1, "markers": {"X": {"at": [0, 0], **along_x}, "Z": {"at": [0, 0], **along_y}}},
            {"name": "head", "mass": 8, "inertia": 0.2, "cog": [0.05, 0],
             "markers": {"S": {"at": [0.1, 0], **along_y}, "Z": {"at": [0, 0], **along_y}}},
        ],
        "joint": [joint("X", "prismatic", "car.X", "frame.X", swapped), joint("Z", "prismatic", "car.Z", "head.Z", False),
                  joint("S", "prismatic", "frame.S", "head.S", False)],
        "coordinate": [{"joint": "Z"}], "actuator": [{"joint": "Z"}],
    })
    run = scene.inverse([[0.5]], solver=solver)
    assert run.status.values.tolist() == [0]
    first, second = (run.reaction.sel(joint=name).values[0] for name in ("X", "Z"))
    # a reaction is what acts on the second link, at the second marker
    sign, arm = (1, 0.0) if swapped else (-1, -0.3)
    on_car = sign*(first[2] + arm*first[1]) - (second[2] - 0.5*second[0])
    assert sign*first[1] == pytest.approx(90, abs=1e-10)
    assert on_car == pytest.approx(0, abs=1e-10)


@pytest.mark.parametrize("swapped", ORDERS)
def test_torque_of_a_turntable_that_rubs(swapped: bool) -> None:
    """A body on a hinge, whose middle slides on oil: the pad is at the body's own marker or at the frame's, 0.3 m from the hinge or
    where that turns to."""
    scene = linkdyn.Scene({
        "space": "spatial", "gravity": [0, 0, -9.81],
        "frame": {"markers": {"S": {"at": [0, 0, 0], "axis": [0, 0, 1]}, "R": {"at": [0.3, 0, 0], "axis": [0, 0, 1]}}},
        "link": [{"name": "b", "mass": 5, "cog": [0.1, 0, 0.2], "inertia": {"diagonal": [0.1, 0.1, 0.1]},
                  "markers": {"S": {"at": [0.1, 0.2, 0], "axis": [0, 0, 1]}, "R": {"at": [0.1, -0.3, 0], "axis": [0, 0, 1]}}}],
        "joint": [joint("S", "planar", "frame.S", "b.S", swapped), joint("R", "revolute", "frame.R", "b.R", False)],
        "friction": [{"joint": "S", "viscous": 30, "radius": 0.05}],
        "coordinate": [{"joint": "R"}], "actuator": [{"joint": "R"}],
    })
    rate = 3.0
    run = scene.inverse([[0.9], [2.0]], [[rate], [rate]], want="all")
    arm = 0.3 if swapped else 0.5              # of the second marker from the hinge
    np.testing.assert_allclose(run.driving_force[:, 0], 30*(arm**2 + 0.05**2)*rate, rtol=1e-12)


@pytest.mark.parametrize("swapped", ORDERS)
@pytest.mark.parametrize("redundancy", ["minimum-norm", "stiffness"])
def test_drives_of_slides_on_a_turning_arm(redundancy: str, swapped: bool) -> None:
    """The drives are determinate, whoever shares what is not: as without any reaction."""
    along = {name: {"axis": axis} for name, axis in (("x", [1, 0, 0]), ("y", [0, 1, 0]), ("z", [0, 0, 1]))}
    gives = {"stiffness": {"radial": 1e6, "tilt": 1e4, "torsion": 1e4}} if redundancy == "stiffness" else {}
    scene = linkdyn.Scene({
        "space": "spatial", "gravity": [0, 0, -9.81], "redundancy": redundancy,
        "frame": {"markers": {"O": {"at": [0, 0, 0], **along["y"]}}},
        "link": [
            {"name": "arm", "mass": 2, "inertia": {"diagonal": [1, 1, 1]},
             "markers": {"O": {"at": [0, 0, 0], **along["y"]}, "S": {"at": [0.1, 0.1, 0], **along["z"]}, "X": {"at": [0, 0, 0], **along["x"]}}},
            {"name": "car", "mass": 1, "inertia": {"diagonal": [1, 1, 1]},
             "markers": {"X": {"at": [0, 0, 0], **along["x"]}, "Z": {"at": [0, 0, 0], **along["z"]}}},
            {"name": "top", "mass": 8, "cog": [0.05, 0.02, 0.13], "inertia": {"diagonal": [0.2, 0.18, 0.14]},
             "markers": {"S": {"at": [0.1, 0.1, 0], **along["z"]}, "Z": {"at": [0, 0, 0], **along["z"]}, "L": [0.2, 0.3, 0.1]}},
        ],
        "joint": [joint("O", "revolute", "frame.O", "arm.O", False),
                  *({**slide, **gives} for slide in (joint("X", "prismatic", "arm.X", "car.X", False), joint("Z", "prismatic", "car.Z", "top.Z", False),
                                                     joint("S", "cylindrical", "arm.S", "top.S", swapped)))],
        "coordinate": [{"joint": "O"}, {"joint": "Z"}], "actuator": [{"joint": "O"}, {"joint": "Z"}],
        "load": [{"on": "top.L", "force": [100, -50, -200], "moment": [5, 7, 9]}],
    })
    q, qd, qdd = [[0.4, 0.48], [3.0, 0.47]], [[3.0, 0.2], [3.0, -0.1]], [[0.0, 1.0], [2.0, -3.0]]
    run = scene.inverse(q, qd, qdd, want="all")
    reduced = scene.inverse(q, qd, qdd, solver="reduced")
    assert run.status.values.tolist() == [0, 0]
    np.testing.assert_allclose(run.driving_force, reduced.driving_force, rtol=1e-11)
    assert np.abs(run.power_imbalance).max() < 1e-9
