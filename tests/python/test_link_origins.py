"""Where links have their origins does not count: drawings of many parts share one, far from the joints."""

import copy
import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_redundancy import SPATIAL, some_poses

SCENES = Path(__file__).parents[1] / "scenes"
FAR = np.array([1.9, -2.4, 0.6])
"""From the origins as they are to those elsewhere [m]: some times the size of these mechanisms."""


def with_origins_at(scene: dict[str, Any], aside: np.ndarray) -> dict[str, Any]:
    """The same spatial mechanism: the axes of its links keep their directions."""
    moved = json.loads(json.dumps(scene))
    for link in moved["link"]:
        if "position" in (start := link.get("start", {})):
            roll, pitch, yaw = (np.radians(float(a.removesuffix("deg"))) if isinstance(a, str) else a for a in start.get("angles", [0, 0, 0]))
            start["position"] = (start["position"] + Rotation.from_euler("ZYX", [yaw, pitch, roll]).apply(aside)).tolist()
        link["cog"] = (np.array(link.get("cog", [0, 0, 0])) - aside).tolist()
        for name, marker in link["markers"].items():
            if isinstance(marker, dict):
                marker["at"] = (np.array(marker.get("at", [0, 0, 0])) - aside).tolist()
            else:
                link["markers"][name] = (np.array(marker) - aside).tolist()
    return moved


def plain(scene: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    return copy.deepcopy(scene())


@pytest.mark.parametrize("name", ["bennett", "spherical", "agile_eye", "sarrus"])
def test_shared_reactions(name: str) -> None:
    """The least sum of squares weighs moments against forces by a length of the mechanism, not of its drawing."""
    scene = plain(SPATIAL[name]) | {"redundancy": "minimum-norm"}
    q = some_poses(scene)
    near, far = (linkdyn.Scene(one).inverse(q=q, qd=0 * q, qdd=0 * q) for one in (scene, with_origins_at(scene, FAR)))
    assert not near.status.values.any()
    assert not far.status.values.any()
    np.testing.assert_allclose(far.reaction, near.reaction, rtol=0, atol=1e-9 * float(np.abs(near.reaction).max()))


def test_distance_to_singular_positions() -> None:
    scene = plain(SPATIAL["bennett"])
    q = some_poses(scene)
    near, far = (linkdyn.Scene(one).inverse(q=q, want=["singularity_distance"]) for one in (scene, with_origins_at(scene, FAR)))
    assert far.singularity_distance.attrs.get("length") == pytest.approx(near.singularity_distance.attrs.get("length"), rel=1e-12)


def test_loops_closed_by_iteration() -> None:
    """A run of an arm that a screw lifts: no sample is called singular for its drawing's sake."""
    scene = tomllib.loads((SCENES / "screw_loop.toml").read_text(encoding="utf-8"))
    t = np.linspace(0, 2, 41)
    for one in (scene, with_origins_at(scene, FAR)):
        opened = linkdyn.Scene(one)
        assert not opened.inverse(t=t).status.values.any()
        assert not opened.forward(t=t).status.values.any()
