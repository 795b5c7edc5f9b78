"""The same scene drawn elsewhere in the world: what is told of it does not hang on where its drawing has the origin."""
from __future__ import annotations

import copy
from typing import Any

import linkdyn
import numpy as np
import pytest
from numpy.typing import NDArray
from test_all_assemblies import RSSR
from test_redundancy import SPATIAL, eight_legs, some_poses
from test_said_otherwise import other_world, with_starts

pytestmark = pytest.mark.accuracy

Array = NDArray[np.float64]
Content = dict[str, Any]
FAR = [10.0, 1000.0]    # [m]
ROUNDING = 2.0**-53


def shifted(content: Content, by: Array) -> Content:
    """What stands in the world, the frame's markers and the links' starts, is elsewhere."""
    scene = copy.deepcopy(content)
    for name, marker in scene["frame"]["markers"].items():
        words = dict(marker) if isinstance(marker, dict) else {"at": marker}
        words["at"] = (np.array(words["at"]) + by).tolist()
        scene["frame"]["markers"][name] = words
    for link in scene["link"]:
        start = link.setdefault("start", {})
        start["position"] = (np.array(start.get("position", 0 * by)) + by).tolist()
    return scene


def off(far: float) -> Array:
    return far * np.array([0.6, -0.64, 0.48])


def assert_alike(run: Any, other: Any, far: float, turn: Array | None = None) -> None:
    """Reactions, in axes that stand by ``turn`` in the world's, and drives. Places in metres round by so much; shares amplify that."""
    np.testing.assert_array_equal(run.status, 0)
    np.testing.assert_array_equal(other.status, 0)
    reaction = other.reaction.values
    if turn is not None:
        reaction = np.concatenate([reaction[..., :3] @ turn.T, reaction[..., 3:] @ turn.T], axis=-1)
    largest = np.abs(run.reaction.values).max()
    tolerance = (1e-12 + 1e4 * ROUNDING * far) * largest
    np.testing.assert_allclose(reaction, run.reaction.values, rtol=0, atol=tolerance)
    np.testing.assert_allclose(other.driving_force.values, run.driving_force.values, rtol=0, atol=tolerance)


@pytest.mark.parametrize("far", FAR)
@pytest.mark.parametrize("name", ["bennett", "slider", "shaft", "agile_eye"])
def test_shares(name: str, far: float) -> None:
    """Least squares of forces and moments, which a length compares."""
    scene = SPATIAL[name]()
    q = some_poses(scene)
    run, other = (linkdyn.Scene(one).inverse(q=q) for one in (scene, shifted(scene, off(far))))
    assert_alike(run, other, far)


@pytest.mark.parametrize("name", ["bennett", "shaft"])
def test_shares_in_other_axes(name: str) -> None:
    scene = SPATIAL[name]()
    q = some_poses(scene)
    run = linkdyn.Scene(scene).inverse(q=q)
    there = with_starts(copy.deepcopy(scene))
    other_world(there, np.random.default_rng(3))
    down, before = np.array(there["gravity"]), np.array(scene["gravity"])
    other = linkdyn.Scene(there).inverse(q=q)
    np.testing.assert_allclose(np.linalg.norm(down), np.linalg.norm(before))
    np.testing.assert_array_equal(other.status, 0)
    for part in (slice(0, 3), slice(3, 6)):
        mine, theirs = (np.linalg.norm(x.reaction.values[..., part], axis=-1) for x in (run, other))
        np.testing.assert_allclose(theirs, mine, rtol=0, atol=1e-11 * np.abs(run.reaction.values).max())


@pytest.mark.parametrize("far", FAR)
def test_eight_legs(far: float) -> None:
    scene = eight_legs()[0]
    there = shifted(scene, off(far))
    there["coordinate"][0]["start"]["position"] = (np.array([0, 0, 0.6]) + off(far)).tolist()
    q = np.array([0, 0, 0.6, 0, 0, 0.1]) + 0.05 * np.random.default_rng(5).normal(size=(40, 6))
    elsewhere = q.copy()
    elsewhere[:, :3] += off(far)
    want = ["driving_force", "reaction"]
    assert_alike(linkdyn.Scene(scene).inverse(q=q, want=want), linkdyn.Scene(there).inverse(q=elsewhere, want=want), far)


@pytest.mark.parametrize("far", FAR)
def test_assemblies(far: float) -> None:
    """As many, in the same order: of two that are about as near the same one stays the nearer."""
    found, others = (linkdyn.Scene(scene).assemblies() for scene in (RSSR, shifted(RSSR, off(far))))
    assert len(found) == len(others) == 2
    for one, other in zip(found, others, strict=True):
        for name, value in one.joint_variable.items():
            off_by = np.remainder(other.joint_variable[name] - value + np.pi, 2 * np.pi) - np.pi
            assert abs(off_by) < 1e-12 + 1e3 * ROUNDING * far, name
