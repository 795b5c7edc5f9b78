"""Pictures of what is far from the origin, of worms and ropes, and of several assemblies; units of what was swept."""

from __future__ import annotations

from pathlib import Path

import linkdyn
import linkdyn.plot as plot
import numpy as np
import pytest
from linkdyn._geometry.postures import find_postures
from linkdyn._geometry.wheels import rack_run, shaft, thread
from linkdyn._sheets.pdf import DPI, SCALE, _Row
from linkdyn._sheets.sheet import Picture
from linkdyn._view.data import describe
from matplotlib import pyplot

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
AWAY = np.array([1000.0, 200.0, 0.0])
"""Whole steps of a grid."""


@pytest.fixture(autouse=True)
def _closed_figures():
    yield
    pyplot.close("all")


def moved() -> linkdyn.Scene:
    text = linkdyn.new("four-bar").text
    markers = 'markers = { A = [0, 0], D = ["ground", 0] }'
    assert markers in text
    return linkdyn.Scene(text.replace(markers, 'markers = { A = ["1000 m", "200 m"], D = ["1000 m + ground", "200 m"] }'))


def values_of(description: dict, block: bytes, name: str) -> np.ndarray:
    (entry,) = [entry for entry in description["arrays"] if entry["name"] == name]
    return np.frombuffer(block, entry["dtype"], int(np.prod(entry["shape"])), entry["offset"]).reshape(entry["shape"])


def test_views_have_an_origin_nearby():
    """Numbers of a picture have 16 binary digits: from the world's origin, a kilometre off, they would be centimetres apart."""
    near, far = linkdyn.new("four-bar"), moved()
    (there, numbers), (here, others) = (describe(scene.inverse(), scene, kinds=("reaction",)) for scene in (near, far))
    assert there["origin"] == [0.0, 0.0, 0.0]
    np.testing.assert_array_equal(here["origin"], AWAY)
    for name in ("position", "cloud"):
        np.testing.assert_allclose(values_of(here, others, name), values_of(there, numbers, name), atol=1e-4 * there["extent"])
    for key in ("box", "ground"):
        np.testing.assert_allclose(here[key], there[key], atol=1e-9)
    for k, link in enumerate(here["links"]):
        np.testing.assert_allclose([marker["at"] for marker in link["markers"]], [marker["at"] for marker in there["links"][k]["markers"]], atol=1e-9)
    for mine, other in zip(here["arrows"], there["arrows"], strict=True):
        np.testing.assert_allclose(mine["at"], other["at"], atol=1e-9)
    for mine, other in zip(here["names"], there["names"], strict=True):
        assert mine[:2] == other[:2]
        np.testing.assert_allclose(mine[2:], other[2:], atol=1e-9)


def test_geared_frames_have_the_same_origin():
    """Runs of belts, pitch points and ends of racks in the axes of the frame."""
    scene = linkdyn.load(EXAMPLES / "hoist" / "scene.toml")
    run = scene.forward()
    there, here = (describe(run, scene, kinds=(), origin=origin)[0] for origin in ([0.0, 0.0, 0.0], [10.0, 20.0, 0.0]))
    (rope,), (other,) = ([joint for joint in told["joints"] if joint["type"] == "rack"] for told in (there, here))
    assert rope["carrier"] == 0
    np.testing.assert_allclose(np.array(rope["pitch"]) - other["pitch"], [10.0, 20.0, 0.0])
    np.testing.assert_allclose(rope["rack_end"], other["rack_end"])


def test_axes_far_from_zero_count_from_nearby():
    figure, ax = plot.mechanism(moved())
    figure.draw_without_rendering()
    assert ax.get_xlabel() == "x − 1000 m [mm]" and ax.get_ylabel() == "y − 200 m [mm]"
    texts = [label.get_text() for label in (*ax.get_xticklabels(), *ax.get_yticklabels())]
    assert texts and all("e" not in text and len(text) <= 4 for text in texts), texts


def lines_of(ax: object) -> list[np.ndarray]:
    return [np.array(line.get_data_3d()).T for line in ax.get_lines()]      # type: ignore[attr-defined]


def test_worms_have_shafts_and_loads_ropes():
    scene = linkdyn.load(EXAMPLES / "worm_winch" / "scene.toml")
    posture = find_postures(scene, scene.poses(scene.motion()[0][:1]))[0].at(0)
    joints = scene.description["joints"]
    (worm,), (rope,) = ([joint for joint in joints if joint["type"] == kind] for kind in ("gear", "rack"))
    ends = np.array(shaft(posture, worm))
    marker, axis = (of[worm["links"][0]][worm["markers"][0]] for of in (posture.markers, posture.axes))
    across = (ends - marker) - ((ends - marker) @ axis)[:, np.newaxis] * axis
    np.testing.assert_allclose(across, 0.0, atol=1e-12)
    reach = (ends - marker) @ axis
    along = (thread(posture, worm) - marker) @ axis
    np.testing.assert_allclose(reach, [min(0.0, along.min()), max(0.0, along.max())], atol=1e-12)
    touches, end = rack_run(posture, rope)
    centre = posture.markers[rope["links"][0]][rope["markers"][0]]
    turns = posture.axes[rope["links"][0]][rope["markers"][0]]
    from_axis = (touches - centre) - ((touches - centre) @ turns) * turns
    assert abs(np.linalg.norm(from_axis) - rope["radii"][0]) < 1e-9
    load = posture.markers[rope["links"][1]][rope["markers"][1]]
    assert abs((load - end) @ posture.axes[rope["links"][1]][rope["markers"][1]]) < 1e-12
    drawn = lines_of(plot.mechanism(scene)[1])
    for pair in (ends, np.array([touches, end])):
        assert any(line.shape == (2, 3) and np.allclose(line, pair) for line in drawn)


@pytest.mark.parametrize(("kind", "width", "height"), [("slider-crank", 6.0, 2.6), ("arm", 4.0, 3.0)])
def test_sheets_of_assemblies_have_no_empty_half(kind, width, height):
    """As wide and high as what is on them, one below and beside the other."""
    figure, _ = plot.assemblies(linkdyn.new(kind))
    size = figure.get_size_inches()
    assert size[0] < width * 1.2 and size[1] < height, size


def test_wide_pictures_keep_the_size_of_their_letters():
    """Two narrow panels do not fill the width of a page."""
    figure = pyplot.figure()
    narrow = _Row([Picture("", figure, wide=True)], [np.zeros((3 * DPI, 4 * DPI, 3))])
    assert narrow.most == pytest.approx(SCALE * 3)


def test_what_was_swept_has_its_unit():
    scene = linkdyn.new("hexapod")
    assert [str(unit) for unit in scene.sweep().parameter_unit.values] == ["m"]
    axis = {"parameter": "variables.r", "as": "factor", "values": [1.0, 1.1]}
    by_factor = scene.sweep({"axis": [axis, {"time": True, "values": [0.0]}], "reduce": ["driving_force"]})
    assert [str(unit) for unit in by_factor.parameter_unit.values] == ["1"]
