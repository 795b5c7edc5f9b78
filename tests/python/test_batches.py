"""Samples give the same bits however they come: cut into batches of any size, strided, in any order; so do loads at instants."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

import linkdyn

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SCENES = Path(__file__).resolve().parents[1] / "scenes"


CLOSED_FORMS = ["fourbar", "stewart_drilling", "sixbar_slider"]
BY_ITERATION = ["delta", "screw_lift"]


@pytest.fixture(scope="module", params=CLOSED_FORMS + BY_ITERATION)
def batch(request):
    """A scene, a motion of more than two blocks of lanes, and its results."""
    scene = linkdyn.load(EXAMPLES / request.param / "scene.toml")
    time = scene.description["time"]
    t = np.linspace(time["first"], time["last"], 75)
    motion = scene.motion(t)
    return scene, t, motion, scene.solve(*motion, t=t, want=None)


def assert_same(found, whole, rows):
    assert found.keys() == whole.keys()
    for name, values in found.items():
        np.testing.assert_array_equal(values, whole[name][rows], err_msg=name)
        assert values.tobytes() == whole[name][rows].tobytes(), name


@pytest.mark.parametrize("n", [1, 2, 7, 8, 9, 15, 16, 17, 31, 32, 33, 63, 64, 65, 74])
def test_batches_of_any_length(batch, n):
    scene, t, motion, whole = batch
    rows = slice(3, 3 + n) if n < 70 else slice(0, n)
    assert_same(scene.solve(*(x[rows] for x in motion), t=t[rows], want=None), whole, rows)


@pytest.mark.parametrize("want", ["driving_force", "reaction", "joint_variable", "power", "checks"])
def test_some_results_alone(batch, want):
    scene, t, motion, _ = batch
    whole = scene.solve(*motion, t=t, want=want)
    for n in (1, 13, 24):
        assert_same(scene.solve(*(x[:n] for x in motion), t=t[:n], want=want), whole, slice(0, n))


def test_strided_reversed_and_transposed(batch):
    scene, t, motion, whole = batch
    for rows in (slice(None, None, 3), slice(None, None, -1), slice(70, 2, -7)):
        assert_same(scene.solve(*(x[rows] for x in motion), t=t[rows], want=None), whole, rows)
    columns = [np.asfortranarray(x) for x in motion]
    assert_same(scene.solve(*columns, t=t, want=None), whole, slice(None))


def test_threads(batch):
    scene, t, motion, whole = batch
    assert_same(scene.solve(*motion, t=t, want=None, threads=2), whole, slice(None))


@pytest.fixture
def tables(tmp_path, tsai_file):
    """A scene's text with a load by two tables, a harmonic and a constant, one between the other."""
    (tmp_path / "a.csv").write_text("t [s],x [N],y [N]\n" + "".join(f"{k**1.5},{k % 7},{k % 3 - 1}\n" for k in range(90)))
    (tmp_path / "b.csv").write_text("t [s],z [N]\n-1,4\n0.1,5\n0.2,-3\n400,2\n")
    content = linkdyn.load(tsai_file).text + """
[[load]]
on = "platform.center"
force = [{ law = "table", table = "a.csv", column = "x", interpolation = "linear" }, { law = "table", table = "b.csv", column = "z" },
         { law = "table", table = "a.csv", column = "y" }]
moment = [0, { law = "harmonic", amplitude = 2.0, frequency = "1 rad/s" }, 3.0]
"""
    return content


def test_loads_at_instants_in_any_order(tables, tmp_path):
    scene = linkdyn.Scene(tables, folder=tmp_path)
    knots = np.arange(90) ** 1.5
    t = np.concatenate([np.linspace(-5, 900, 333), knots, knots[::-1], [0.1, 0.1, 1e9, -1e9], np.random.default_rng(4).uniform(-2, 900, 200)])
    together = scene.load_values(t)
    alone = np.stack([scene.load_values(instant)[0] for instant in t])
    np.testing.assert_array_equal(together, alone)
    order = np.random.default_rng(5).permutation(len(t))
    np.testing.assert_array_equal(scene.load_values(t[order]), together[order])
    load = together[:, -1]
    np.testing.assert_allclose(load[:, 0], np.interp(t, knots, np.arange(90) % 7), rtol=0, atol=1e-12)
    at_knots = slice(333, 423)
    np.testing.assert_allclose(load[at_knots, 2], np.arange(90) % 3 - 1, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(load[:, 5], 3.0)
    np.testing.assert_allclose(load[t > 400.0, 1], 2.0, rtol=0, atol=0)


@pytest.mark.parametrize("batch", BY_ITERATION, indirect=True)
def test_samples_before_matter_not(batch):
    """Nodes that are kept from sample to sample hurry, and change nothing: one after the other, in any order, a scene that knows none."""
    scene, t, motion, whole = batch
    fresh = linkdyn.Scene(scene.text, folder=scene.folder)
    fresh.solve(*motion, t=t, want=None)                # as many samples to come as the other one had
    for i in np.random.default_rng(3).permutation(len(t)):
        for one in (scene, fresh):
            assert_same(one.solve(*(x[i : i + 1] for x in motion), t=t[i : i + 1], want=None), whole, slice(i, i + 1))
    elsewhere = [x + 0.02 for x in motion]
    expected = fresh.solve(*elsewhere, t=t, want=None)
    for i in range(len(t)):
        assert_same(scene.solve(*(x[i : i + 1] for x in elsewhere), t=t[i : i + 1], want=None), expected, slice(i, i + 1))


@pytest.mark.parametrize("batch", CLOSED_FORMS, indirect=True)
@pytest.mark.parametrize("place", [0, 1, 7, 8, 15, 16, 40, 74])
def test_one_result_beyond_all_numbers(batch, place):
    """It is told of that sample alone, also where a result is one number a sample."""
    scene, t, motion, _ = batch
    for want in ("driving_force", "power", None):
        whole = scene.solve(*motion, t=t, want=want)
        q, qd, qdd = (x.copy() for x in motion)
        qdd[place] = 1e308
        found = scene.solve(q, qd, qdd, t=t, want=want)
        assert found["status"][place] != 0
        assert all(np.isnan(values[place]).all() for name, values in found.items() if values.dtype.kind == "f")
        others = np.arange(len(t)) != place
        assert_same({name: values[others] for name, values in found.items()}, {name: values[others] for name, values in whole.items()}, slice(None))


def test_batch_is_where_straight_ways_lead():
    """Poses beyond a narrow place, through which the ways to some near them lead and theirs do not: unreachable in a batch as on the lanes,
    which lead the mechanism to each from the start."""
    content = tomllib.loads((EXAMPLES / "double_wishbone" / "scene.toml").read_text())
    content["actuator"] = [{"joint": c["joint"]} for c in content["coordinate"]]
    scene = linkdyn.Scene(content, EXAMPLES / "double_wishbone")
    start = scene.motion(scene.times()[:1])[0][0]
    q = start + [1.1, -0.19] + np.random.default_rng(5).uniform(-1, 1, (3000, 2)) * [0.15, 0.03]
    status = scene.inverse(q, want="driving_force").status.values
    assert 1000 < (status == 0).sum() < 2000
    np.testing.assert_array_equal(status == 0, np.asarray(scene.poses(q).status) == 0)


def test_crank_out_of_reach():
    """A crank in space that cannot go round: samples are out of reach where the sphere about its end has left the rocker's circle on the way
    from the start, which a quadratic tells; a batch says so by recorded steps, a single pose by the lanes."""
    content = tomllib.loads((SCENES / "rssr.toml").read_text())
    long, rocker, rod = 0.5, 0.6, 0.9
    content["link"][0]["markers"]["B"] = [long, 0, 0]
    scene = linkdyn.Scene(content)
    q = np.sort(np.random.default_rng(7).uniform(-np.pi, np.pi, 3000))
    z = np.array([1.0, 0.2, 0.0])
    z /= np.linalg.norm(z)
    x = np.array([1 - z[0] ** 2 / (1 + z[2]), -z[0] * z[1] / (1 + z[2]), -z[0]])
    d = np.array([0.5, 0.2, 0.3]) - long * np.stack([np.cos(q), np.sin(q), 0 * q], axis=1)
    spare = 2 * rocker * np.hypot(d @ x, d @ np.cross(z, x)) - abs(rod**2 - rocker**2 - (d**2).sum(axis=1))
    limits = np.flatnonzero(np.diff(np.sign(spare)))
    below, above = limits[q[limits] < 0].max(), limits[q[limits] > 0].min()
    is_reached = (np.arange(len(q)) > below) & (np.arange(len(q)) <= above)
    assert 500 < is_reached.sum() < 2500
    status = np.asarray(scene.poses(q[:, None]).status)
    np.testing.assert_array_equal(status == 0, is_reached)
    assert set(status[~is_reached]) == {1}
    for i in (below, below + 1, above, above + 1, 0, len(q) - 1):
        assert scene.poses(q[i : i + 1, None]).status[0] == status[i]


def test_platform_out_of_reach():
    """A platform on cranks, of whose poses half are out of reach: a batch, which recorded steps lead to where legs are stretched, says of each
    what the lanes say of it alone."""
    content = tomllib.loads((SCENES / "hexapod_pattern.toml").read_text())
    content["chain"] = [{"type": "RUS", "repeat": 3, "about": "z", "mirror": "xz", "base": "frame.B#", "platform": "platform.P#", "axis": [0, 1, 0],
                         "zero": [1, 0, 0], "elbow": -1, "crank": {"length": 0.4, "mass": 1.0}, "rod": {"length": 1.0, "mass": 1.0}}]
    scene = linkdyn.Scene(content)
    start = scene.motion(scene.times()[:1])[0][0]
    q = start + np.random.default_rng(1).uniform(-1, 1, (600, 6)) * [0.3, 0.3, 0.3, 0.6, 0.6, 0.6]
    whole = scene.poses(q)
    status = np.asarray(whole.status)
    assert 150 < (status == 0).sum() < 450
    alone = [linkdyn.Scene(content).poses(one) for one in np.split(q, 6)]
    np.testing.assert_array_equal(status, np.concatenate([x.status for x in alone]))
    np.testing.assert_allclose(whole.position[status == 0], np.concatenate([x.position for x in alone])[status == 0], atol=1e-11)
