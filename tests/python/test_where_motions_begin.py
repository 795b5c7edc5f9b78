"""What a motion leaves open begins where the coordinate, its joint or its link does."""

from typing import Any

import linkdyn
import numpy as np
import pytest


def slide(coordinate: dict[str, Any], start: float = 0.25, **more: Any) -> linkdyn.Scene:
    return linkdyn.Scene({
        "space": "planar", "frame": {"markers": {"O": [0, 0]}}, "link": [{"name": "l", "mass": 1.0, "inertia": 0.1, "markers": {"A": [0, 0]}}],
        "joint": [{"name": "J", "type": "prismatic", "between": ["frame.O", "l.A"], "start": start}],
        "coordinate": [{"joint": "J"} | coordinate], "actuator": [{"joint": "J"}],
    } | more)  # fmt: skip


def body(coordinate: dict[str, Any]) -> linkdyn.Scene:
    link = {"name": "p", "mass": 1.0, "inertia": [0.1, 0.1, 0.1, 0, 0, 0], "markers": {"T": [0.1, 0.2, 0.3]}, "start": {"position": [1, 2, 3], "angles": [0.1, 0.2, 0.3]}}
    return linkdyn.Scene({"space": "spatial", "frame": {"markers": {"O": [0, 0, 0]}}, "link": [link], "joint": [], "coordinate": [coordinate]})


@pytest.mark.parametrize(("law", "place"), [
    ({"law": "constant-rate", "rate": 1.0}, 0.25), ({"law": "cycloidal", "to": 1.0, "duration": 1.0}, 0.25),
    ({"law": "cycloidal-start", "speed": 1.0, "duration": 1.0}, 0.25), ({"law": "constant-rate", "rate": 1.0, "start": 0.1}, 0.1),
])  # fmt: skip
def test_a_law_begins_at_the_start_of_the_joint(law: dict[str, Any], place: float) -> None:
    scene = slide({"motion": law})
    assert scene.motion([0.0])[0].ravel() == pytest.approx([place], abs=1e-15)
    assert scene.with_({"actuator.J.law": {"type": "constant", "value": 0.0}}).forward(t=[0, 0.1]).q.values[0] == pytest.approx([place], abs=1e-15)


def test_the_coordinate_s_own_start_comes_first() -> None:
    assert slide({"start": 0.5, "motion": {"law": "constant-rate", "rate": 1.0}}).motion([0.0])[0].ravel() == pytest.approx([0.5], abs=1e-15)


@pytest.mark.parametrize("whose", [{"link": "p"}, {"marker": "p.T"}])
def test_components_stay_where_the_link_begins(whose: dict[str, str]) -> None:
    still = body(whose).motion([0.0])[0].ravel()
    moves = body(whose | {"motion": {"y": {"law": "constant-rate", "rate": 1.0}, "yaw": {"law": "cycloidal", "to": 1.0, "duration": 1.0}}})
    np.testing.assert_allclose(moves.motion([0.0])[0].ravel(), still, rtol=0, atol=1e-15)
    np.testing.assert_allclose(moves.motion([1.0])[0].ravel(), [still[0], still[1] + 1, *still[2:5], 1.0], rtol=0, atol=1e-14)
