"""Joints of an over-constrained mechanism that fit in a pose alone: found by how they part, of which numpy tells by differences of poses."""

from __future__ import annotations

from typing import Any

import linkdyn
import numpy as np
import pytest
import tomli_w
from numpy.typing import NDArray
from test_redundancy import bennett

Array = NDArray[np.float64]
RADIUS, ROD, YAW = 0.4, 1.0, 0.6
AROUND = np.array([0.0, 1.3, 2.9, 4.4, 5.3, 5.9])
HEIGHT = float(np.sqrt(ROD**2 - (2 * RADIUS * np.sin(YAW / 2)) ** 2))
TILT = {"law": "harmonic", "amplitude": 0.05, "frequency": 3.0}


def ring(n: int) -> Array:
    return np.stack([RADIUS * np.cos(AROUND[:n]), RADIUS * np.sin(AROUND[:n]), 0 * AROUND[:n]], axis=1)


def wren(n: int, motion: dict[str, Any]) -> linkdyn.Scene:
    """A platform on n rods of one length between rings of one size: lines of a hyperboloid, so that three freedoms are left in this pose.

    It can move in a screw alone. Its coordinates are others.
    """
    points = ring(n).tolist()
    scene: dict[str, Any] = {
        "space": "spatial",
        "gravity": [0.0, 0.0, -9.81],
        "frame": {"markers": {f"B{i}": {"at": p, "axis": [1.0, 0.0, 0.0]} for i, p in enumerate(points)}},
        "link": [
            {
                "name": "platform",
                "mass": 3.0,
                "inertia": {"diagonal": [0.1, 0.12, 0.2]},
                "markers": {f"P{i}": p for i, p in enumerate(points)},
                "start": {"position": [0.0, 0.0, HEIGHT], "angles": [0.0, 0.0, YAW]},
            }
        ],
        "joint": [],
        "coordinate": [{"link": "platform", "components": list(motion), "motion": motion}],
        "actuator": [{"joint": f"U{i}", "variable": "angle1"} for i in range(3)],
        "time": {"end": 2.0, "samples": 21},
    }
    for i in range(n):
        markers = {"U": {"at": [0.0, 0.0, 0.0], "axis": [0.0, 1.0, 0.0]}, "S": [0.0, 0.0, ROD]}
        rod = {"name": f"rod{i}", "mass": 0.5, "cog": [0.0, 0.0, ROD / 2], "inertia": {"diagonal": [0.05, 0.05, 0.0]}, "markers": markers}
        scene["link"].append(rod)
        scene["joint"].append({"name": f"U{i}", "type": "universal", "between": [f"frame.B{i}", f"rod{i}.U"]})
        scene["joint"].append({"name": f"S{i}", "type": "spherical", "between": [f"rod{i}.S", f"platform.P{i}"]})
    return linkdyn.Scene(tomli_w.dumps(scene))


def parting(tilt: float) -> float:
    """By what a fourth rod misses its ball where three are closed, the platform tilted by roll and pitch at its height."""
    ca, sa = np.cos(tilt), np.sin(tilt)
    turned = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]]) @ np.array([[ca, 0, sa], [0, 1, 0], [-sa, 0, ca]])

    def lengths(x: Array) -> Array:
        c, s = np.cos(x[2]), np.sin(x[2])
        placed = ring(4) @ (turned @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])).T + [x[0], x[1], HEIGHT]
        return np.asarray(np.linalg.norm(placed - ring(4), axis=1) - ROD)

    x = np.array([0.0, 0.0, YAW])
    for _ in range(8):
        slope = np.stack([(lengths(x + 1e-6 * e)[:3] - lengths(x - 1e-6 * e)[:3]) / 2e-6 for e in np.eye(3)], axis=1)
        x = x - np.linalg.solve(slope, lengths(x)[:3])
    return float(lengths(x)[3])


@pytest.mark.parametrize("solver", ["elimination", "gauss-jordan"])
@pytest.mark.parametrize("n", [4, 5, 6])
def test_a_platform_that_fits_in_its_pose_alone(n: int, solver: str) -> None:
    """It passes through the pose where all rods fit: there, too, its motion is none that it has."""
    assert abs(parting(0.0)) < 1e-14
    assert abs(parting(1e-3) - 4 * parting(5e-4)) < 0.01 * abs(parting(1e-3))    # by the second rate alone
    assert abs(parting(1e-3)) > 1e-8
    scene = wren(n, {"z": HEIGHT, "roll": TILT, "pitch": TILT})
    for want in ("reaction", "power"):
        assert (scene.inverse(solver=solver, want=want).status == 1).all()


def test_the_same_at_rest() -> None:
    """Where nothing moves nothing parts: what the drives hold is the weight, by virtual work of the platform and its rods."""
    scene = wren(4, {"z": HEIGHT, "roll": 0.0, "pitch": 0.0})
    run = scene.inverse(want="all")
    assert (run.status == 0).all()
    weight = 9.81 * (3.0 + 4 * 0.5)
    on_frame = run.reaction.sel(joint=[f"U{i}" for i in range(4)]).values[0]
    assert abs(on_frame[:, 2].sum() - weight) < 1e-10 * weight


def test_a_folded_loop_is_singular() -> None:
    """Where it is folded the rates tell nothing: it is flagged as what it is, and its neighbours are taken."""
    angles = np.linspace(-3.14159, 3.14159, 20001)[np.r_[7122:7324, 17121:17324], None]
    run = linkdyn.Scene(tomli_w.dumps(bennett())).inverse(q=angles, qd=0 * angles + 1, qdd=0 * angles + 1)
    assert set(np.unique(run.status)) <= {0, 2}
    assert (run.status == 0).sum() >= 399                      # all but the three of either fold within 5e-4 rad of it
