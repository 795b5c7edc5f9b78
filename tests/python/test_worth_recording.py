"""Which batches go by the scene's record: told by the last bits, which records and lanes round each in their own way."""

from __future__ import annotations

from pathlib import Path

import linkdyn
import numpy as np
import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def four_bars(n: int) -> linkdyn.Scene:
    """Cranks in a row, each coupled to the next, which is a little longer or shorter."""
    frame = {f"A{i}": [1.0 * i, 0.0] for i in range(n + 1)}
    links, joints = [], []
    for i in range(n + 1):
        long = 1.0 + 0.05 * (i % 2)
        start = {"position": [1.0 * i, 0.0], "angle": 1.5}
        links.append({"name": f"crank{i}", "mass": 1.0, "inertia": 0.1, "cog": [0.5, 0.0], "start": start, "markers": {"A": [0, 0], "B": [long, 0]}})
        joints.append({"name": f"A{i}", "type": "revolute", "between": [f"frame.A{i}", f"crank{i}.A"], "start": 1.5})
    for i in range(n):
        start = {"position": [1.0 * i + 0.07, 1.0], "angle": 0.0}
        links.append({"name": f"bar{i}", "mass": 1.0, "inertia": 0.1, "cog": [0.5, 0.0], "start": start, "markers": {"B": [0, 0], "C": [1.02, 0]}})
        joints.append({"name": f"B{i}", "type": "revolute", "between": [f"crank{i}.B", f"bar{i}.B"]})
        joints.append({"name": f"C{i}", "type": "revolute", "between": [f"bar{i}.C", f"crank{i + 1}.B"]})
    return linkdyn.Scene(
        {
            "title": "four-bars in a row",
            "space": "planar",
            "gravity": [0, -9.81],
            "frame": {"markers": frame},
            "link": links,
            "joint": joints,
            "coordinate": [{"joint": "A0"}],
            "actuator": [{"joint": "A0"}],
        }
    )


def test_a_record_of_many_links_serves_small_batches_once_it_is_there() -> None:
    """More than 50 links are recorded for thousands of samples; a part of such a batch then has the bits that it had in it."""
    scene = four_bars(30)
    q = 1.5 + 0.05 * np.sin(np.linspace(0.0, 6.0, 4000))[:, None]
    whole = scene.inverse(q, want="driving_force")
    part = scene.inverse(q[:300], want="driving_force")
    assert np.all(whole.status == 0)
    np.testing.assert_array_equal(part.driving_force.values, whole.driving_force.values[:300])


@pytest.mark.parametrize("name", ["delta", "stewart_tsai"])
def test_poses_of_few_samples_go_the_way_of_many(name: str) -> None:
    """As forces do: a loop closed by iteration, and a hexapod that is closed at once."""
    scene = linkdyn.load(EXAMPLES / name / "scene.toml")
    times = scene.times()
    q = scene.motion(np.linspace(times[0], times[-1], 5000))[0]
    few, many = scene.poses(q[:100], in_order=False), scene.poses(q, in_order=False)
    assert np.all(many.status == 0)
    np.testing.assert_array_equal(few.position, many.position[:100])
    np.testing.assert_array_equal(few.rotation, many.rotation[:100])
