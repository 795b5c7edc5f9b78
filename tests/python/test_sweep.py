"""Sweeps against brute force: every sample once more through `Scene.inverse`, reduced with numpy."""

from __future__ import annotations

import copy
import itertools
import subprocess
from pathlib import Path

import numpy as np
import pytest
import tomli_w
import xarray as xr
from scipy.stats.qmc import Sobol

import linkdyn
from linkdyn.cli import executable

EPS = np.finfo(float).eps
AXES = {
    "platform.x": np.linspace(-1.7, -1.3, 5),
    "platform.y": np.array([-0.2, 0.1]),
    "platform.z": np.linspace(0.8, 1.2, 4),
    "platform.yaw": np.linspace(-0.5, 0.5, 7),
}
RATES = np.array([-0.5, 0.25])
LOADS = np.linspace(-10.0, 30.0, 3)


def sweep_file(scene: dict, folder: Path, *options: str, name: str = "scene.toml") -> xr.Dataset:
    """Results of the executable."""
    file = folder / name
    file.write_text(tomli_w.dumps(scene))
    output = folder / "results.nc"
    done = subprocess.run(
        [executable(), "sweep", file, "-o", output, "-q", *options], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    with xr.open_dataset(output) as results:
        return results.load()


@pytest.fixture()
def swept(tsai):
    """Poses, a rate and a load case; 1680 samples, which do not fill the blocks of lanes."""
    tsai["sweep"] = {
        "on": "platform.center",
        "reduce": [
            *("driving_force", "driving_position", "driving_speed", "driving_power", "reaction", "reaction_force"),
            *("reaction_moment", "joint_variable", "joint_rate", "force_amplification", "moment_amplification"),
            *("condition", "determinant", "swing", "clearance"),
        ],
        "chunk": 256,
        "axis": [
            *({"coordinate": name, "values": values.tolist()} for name, values in AXES.items()),
            {"rate": "platform.x", "values": RATES.tolist()},
            {"load": "platform.center", "component": "Fz", "linspace": [LOADS[0], LOADS[-1], len(LOADS)]},
        ],
    }
    return tsai


@pytest.fixture()
def grid():
    """(N, 6) values of the axes in the order of the samples."""
    return np.array(list(itertools.product(*AXES.values(), RATES, LOADS)))


def brute(scene: dict, grid: np.ndarray) -> xr.Dataset:
    """All samples of the sweep one by one."""
    plain = {key: value for key, value in scene.items() if key != "sweep"}
    model = linkdyn.Scene(plain)
    q = np.tile(model.motion(0.0)[0], (len(grid), 1))
    qd = np.zeros_like(q)
    for column, name in enumerate(AXES):
        q[:, model.coordinates.index(name)] = grid[:, column]
    qd[:, 0] = grid[:, 4]
    wrench = np.zeros((len(grid), 6))
    wrench[:, 2] = grid[:, 5]
    return model.inverse(q=q, qd=qd, wrench={"platform.center": wrench})


def check_reduction(results: xr.Dataset, name: str, values: np.ndarray, axes: np.ndarray, tolerance: float) -> None:
    """Extremes, their places, mean and rms of values (sample, ...); tolerance relative to the largest of all."""
    atol = tolerance * max(np.abs(values).max(), 1e-300)
    for side, extreme in (("min", values.min(axis=0)), ("max", values.max(axis=0))):
        assert results[f"{name}_{side}"].values == pytest.approx(extreme, rel=0, abs=atol), (name, side)
        sample = results[f"{name}_{side}_sample"].values
        there = np.take_along_axis(values, sample[np.newaxis], axis=0)[0]
        assert there == pytest.approx(extreme, rel=0, abs=atol), (name, side)
        assert np.array_equal(results[f"{name}_{side}_at"].values, axes[sample])
    # A mean of n values is as exact as they are, and as rounding of the sum allows.
    assert results[f"{name}_mean"].values == pytest.approx(values.mean(axis=0), rel=0, abs=2 * atol)
    assert results[f"{name}_rms"].values == pytest.approx(np.sqrt((values**2).mean(axis=0)), rel=0, abs=2 * atol)


def test_reductions_are_those_of_all_samples(swept, grid, tmp_path):
    results = sweep_file(swept, tmp_path)
    run = brute(swept, grid)
    assert results["samples"] == len(grid) == run.sizes["sample"]
    assert results["feasible_fraction"] == 1
    # The sweep plans its equations with all reactions, as the batch does: the same arithmetic but for the order of
    # samples on lanes. Angles of joints near zero come from differences of unit vectors.
    tolerance = 64 * EPS
    for name in ("driving_force", "driving_speed", "driving_power", "reaction", "joint_rate"):
        check_reduction(results, name, run[name].values, grid, tolerance)
    check_reduction(results, "joint_variable", run["joint_variable"].values, grid, 4 * tolerance)
    driven = run["joint_variable"].sel(variable=[f"{name}.slide" for name in run.actuator.values]).values
    check_reduction(results, "driving_position", driven, grid, tolerance)
    reaction = run["reaction"].values
    check_reduction(results, "reaction_force", np.linalg.norm(reaction[..., :3], axis=-1), grid, tolerance)
    check_reduction(results, "reaction_moment", np.linalg.norm(reaction[..., 3:], axis=-1), grid, tolerance)
    power = run["driving_power"].values
    back = -np.minimum(power, 0).sum(axis=0) / np.abs(power).sum(axis=0)
    assert results["regenerative_share"].values == pytest.approx(back, rel=1e-12)


def jacobian(model: linkdyn.Scene, q: np.ndarray) -> np.ndarray:
    """(N, 6, 6) rates of the actuators for unit velocities and angular velocities of the platform."""
    columns = []
    for k in range(6):
        qd = np.zeros_like(q)
        qd[:, k] = 1
        columns.append(model.inverse(q=q, qd=qd, want="power")["driving_speed"].values)
    by_rates = np.stack(columns, axis=-1)
    roll, pitch = q[:, 3], q[:, 4]
    # omega = E (roll', pitch', yaw'): roll about x, pitch about y turned by roll, yaw about the platform's z.
    e = np.zeros((len(q), 3, 3))
    e[:, 0, 0] = 1
    e[:, 1, 1], e[:, 2, 1] = np.cos(roll), np.sin(roll)
    e[:, 0, 2], e[:, 1, 2], e[:, 2, 2] = np.sin(pitch), -np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)
    by_rates[:, :, 3:] = by_rates[:, :, 3:] @ np.linalg.inv(e)
    return by_rates


def test_amplification_condition_determinant(swept, grid, tmp_path):
    results = sweep_file(swept, tmp_path)
    model = linkdyn.Scene({key: value for key, value in swept.items() if key != "sweep"})
    q = brute(swept, grid)["q"].values
    zero = model.inverse(q=q, want="driving_force", wrench={"platform.center": np.zeros(6)})["driving_force"].values
    columns = [
        model.inverse(q=q, want="driving_force", wrench={"platform.center": unit})["driving_force"].values - zero
        for unit in np.eye(6)
    ]
    gain = np.stack(columns, axis=-1)    # (sample, actuator, wrench): what a unit wrench adds
    # Differences of forces lose what gravity has in digits.
    tolerance = 1e-12
    check_reduction(results, "force_amplification", np.linalg.norm(gain[..., :3], axis=-1), grid, tolerance)
    check_reduction(results, "moment_amplification", np.linalg.norm(gain[..., 3:], axis=-1), grid, tolerance)
    # The closed form is the largest over unit forces: no direction asks more, the stated one asks as much.
    random = np.random.default_rng(1).normal(size=(3, 4000))
    random /= np.linalg.norm(random, axis=0)
    worst = results["force_amplification_max_sample"].values
    rows = gain[worst, np.arange(6), :3]
    assert np.all(np.abs(rows @ random).max(axis=1) <= results["force_amplification_max"].values * (1 + tolerance))
    stated = np.einsum("ak,ak->a", rows, results["force_amplification_direction"].values)
    assert stated == pytest.approx(results["force_amplification_max"].values, rel=tolerance)
    scaled = jacobian(model, q)
    scaled[:, :, 3:] /= results.attrs["characteristic_length"]
    assert results.attrs["characteristic_length"] == pytest.approx(np.linalg.norm([0.17, 0.595, -0.4]), rel=1e-15)
    check_reduction(results, "condition", np.linalg.cond(scaled), grid, tolerance)
    check_reduction(results, "determinant", np.linalg.det(scaled), grid, tolerance)


def segment_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Of two segments (2, 3), by ends against segments and by the common perpendicular."""

    def to_segment(point, s):
        line = s[1] - s[0]
        t = np.clip(np.dot(point - s[0], line) / np.dot(line, line), 0, 1)
        return np.linalg.norm(point - s[0] - t * line)

    best = min(to_segment(a[0], b), to_segment(a[1], b), to_segment(b[0], a), to_segment(b[1], a))
    u, v = a[1] - a[0], b[1] - b[0]
    st, *_ = np.linalg.lstsq(np.column_stack([u, -v]), b[0] - a[0], rcond=None)
    if np.all((st >= 0) & (st <= 1)):
        best = min(best, np.linalg.norm(a[0] + st[0] * u - b[0] - st[1] * v))
    return best


def test_clearance_wants_legs_or_segments():
    scene = linkdyn.load(Path(__file__).resolve().parents[1] / "scenes" / "rsur.toml")
    table = {"reduce": ["clearance"], "axis": [{"coordinate": "A", "linspace": [0, 1, 3]}], "clearance": {"diameter": 0.01}}
    with pytest.raises(linkdyn.InputError, match="there is no pair of legs without a common end .expected two legs, or 'segments' in its table"):
        scene.sweep(table)


@pytest.mark.thorough
def test_swing_and_clearance(swept, grid, tmp_path):
    swept["sweep"]["clearance"] = {"diameter": 0.05}
    given = np.array([0.2, 0.1, -1.0]) / np.linalg.norm([0.2, 0.1, -1.0])
    swept["sweep"]["swing"] = {"leg2.S": [0.2, 0.1, -1.0]}
    results = sweep_file(swept, tmp_path)
    swept["sweep"]["clearance"]["segments"] = [[f"frame.B{leg}", f"platform.P{leg}"] for leg in range(1, 7)]
    assert sweep_file(swept, tmp_path)["clearance_mean"].equals(results["clearance_mean"])
    model = linkdyn.Scene({key: value for key, value in swept.items() if key != "sweep"})
    q = brute(swept, grid)["q"].values
    poses, start = model.poses(q), model.poses(model.motion(0.0)[0])
    links = list(model.links)
    swing, ends = [], []
    platform = links.index("platform")
    for leg in range(1, 7):
        lower, upper = links.index(f"leg{leg}.lower"), links.index(f"leg{leg}.upper")
        axis, neutral = poses.rotation[:, lower, :, 2], start.rotation[0, lower, :, 2]
        swing.append(np.arccos(axis @ neutral))
        local = np.einsum("nji,nj->ni", poses.rotation[:, platform], axis)
        fixed = given if leg == 2 else start.rotation[0, platform].T @ neutral
        swing.append(np.arccos(np.clip(local @ fixed, -1, 1)))
        ends.append(np.stack([poses.position[:, lower], poses.position[:, upper]], axis=1))
    # The arc cosine near its end knows the angle to the square root of rounding.
    check_reduction(results, "swing", np.stack(swing, axis=-1), grid, 2e-8)
    pairs = list(itertools.combinations(range(6), 2))
    gap = [min(segment_distance(ends[i][n], ends[j][n]) for i, j in pairs) - 0.05 for n in range(len(grid))]
    check_reduction(results, "clearance", np.array(gap), grid, 1e-13)


def test_histogram(swept, grid, tmp_path):
    swept["sweep"]["histogram"] = {"bins": 10, "driving_force": {"from": -5, "to": 5}, "driving_speed": True}
    results = sweep_file(swept, tmp_path)
    run = brute(swept, grid)
    for name in ("driving_force", "driving_speed"):
        values, edges = run[name].values, results[f"{name}_bin_edge"].values
        assert "as given" in results[f"{name}_bin_edge"].attrs["long_name"] if name == "driving_force" else True
        for k in range(6):
            expected = np.histogram(values[:, k], edges[k])[0]
            got = results[f"{name}_histogram"].values[k]
            # A value on an edge may fall to either side of it.
            assert np.abs(np.cumsum(got) - np.cumsum(expected)).max() <= np.isclose(
                values[:, k, np.newaxis], edges[k], rtol=0, atol=1e-12
            ).sum()
            outside = results[f"{name}_outside"].values[k]
            assert got.sum() + outside.sum() == len(grid)
            assert outside[0] == (values[:, k] < edges[k, 0] - 1e-12).sum()


def test_constraints_and_limits(swept, grid, tmp_path):
    whole_condition = sweep_file(swept, tmp_path, "--keep", "condition")["condition"].values
    swept["sweep"]["constraint"] = [
        {"of": "driving_position", "at": ["leg1.P", "leg2.P"], "min": 1.0, "max": 1.7, "name": "stroke"},
        {"of": "condition", "max": 4.0},
    ]
    swept["sweep"]["limit"] = [{"of": "driving_force", "max": 8.0, "name": "motor"}]
    results = sweep_file(swept, tmp_path, "--keep", "driving_force,condition,reaction")
    run = brute(swept, grid)
    stroke = run["joint_variable"].sel(variable=["leg1.P.slide", "leg2.P.slide"]).values
    condition, force = results["condition"].values, run["driving_force"].values
    names = list(results["outcome"].values)
    assert names[-3:] == ["stroke", "condition", "motor"] and names[0] == "feasible"
    motor = len(names) - 1
    outcome = np.where(np.any((stroke < 1.0) | (stroke > 1.7), axis=1), motor - 2, np.where(
        condition > 4.0, motor - 1, np.where(force.max(axis=1) > 8.0, motor, 0)))
    assert np.array_equal(results["sample_outcome"], outcome)
    assert np.array_equal(results["outcome_count"], np.bincount(outcome, minlength=len(names)))
    assert set(outcome) == {0, motor - 2, motor - 1, motor}    # all cases occur
    # Limits mark a pose, constraints exclude it.
    inside = np.isin(outcome, [0, motor])
    assert results["samples_reduced"] == inside.sum()
    assert results["driving_force_max"].values == pytest.approx(force[inside].max(axis=0), rel=1e-12)
    assert results["driving_force_mean"].values == pytest.approx(force[inside].mean(axis=0), rel=1e-10)
    # What is kept is what the batch gives, forces where they were computed.
    assert np.array_equal(results["sample_axis"], grid)
    assert results["driving_force"].values[inside] == pytest.approx(force[inside], rel=1e-11)
    early = np.isin(outcome, [motor - 2, motor - 1])
    assert np.isnan(results["driving_force"].values[early]).all()
    assert results["condition"].values[early] == pytest.approx(whole_condition[early], rel=1e-12)
    assert results["reaction"].values[inside] == pytest.approx(run["reaction"].values[inside], abs=1e-11)


def test_feasible_volume(tsai, tmp_path):
    tsai["sweep"] = {"reduce": ["driving_position"], "constraint": [{"of": "driving_position", "max": 1.6}], "axis": [
        {"coordinate": "platform.x", "linspace": [-1.6, -1.2, 5]},
        {"coordinate": "platform.z", "sobol": {"from": 0.8, "to": 1.2, "n": 32}},
        {"coordinate": "platform.yaw", "linspace": [-0.1, 0.1, 3]},
    ]}
    results = sweep_file(tsai, tmp_path)
    assert results["swept_volume"] == pytest.approx(0.16) and results["swept_volume"].attrs["units"] == "m2"
    assert 0 < results["feasible_fraction"] < 1
    assert results["feasible_volume"] == pytest.approx(0.16 * float(results["feasible_fraction"]))


def test_map(swept, grid, tmp_path):
    """Worst values in the cells of two of the axes, in another order than theirs; one constraint, one limit."""
    swept["sweep"] |= {
        "map": ["platform.z", "platform.x"],
        "constraint": [{"of": "driving_position", "max": 1.65}],
        "limit": [{"of": "driving_force", "max": 8.0}],
    }
    results = sweep_file(swept, tmp_path, "--threads", "2")
    run = brute(swept, grid)
    inside = run["joint_variable"].sel(variable=[f"leg{i}.P.slide" for i in range(1, 7)]).max("variable").values <= 1.65
    feasible = inside & (run["driving_force"].values.max(axis=1) <= 8.0)
    assert 0 < feasible.sum() < inside.sum() < len(grid)
    whole = np.where(inside[:, np.newaxis], np.abs(run["driving_force"].values), np.nan)
    assert results["map_driving_force"].dims == ("platform.z", "platform.x")
    for i, z in enumerate(results["platform.z"].values):
        for j, x in enumerate(results["platform.x"].values):
            cell = (grid[:, 2] == z) & (grid[:, 0] == x)
            assert results["map_feasible_fraction"].values[i, j] == pytest.approx(feasible[cell].mean(), rel=1e-15)
            expected = np.nanmax(whole[cell]) if inside[cell].any() else np.nan
            assert results["map_driving_force"].values[i, j] == pytest.approx(expected, rel=1e-12, nan_ok=True)
    # The least determinant of all cells is that of the sweep, so is the largest condition.
    assert np.nanmin(results["map_determinant"]) == pytest.approx(np.abs(results["determinant_max"]).item(), rel=1e-15)
    assert np.nanmax(results["map_condition"]) == results["condition_max"]


def test_extremes_alone_are_the_same(swept, tmp_path):
    with_means = sweep_file(swept, tmp_path)
    swept["sweep"]["moments"] = False
    without = sweep_file(swept, tmp_path)
    assert "driving_force_mean" not in without and "regenerative_share" not in without
    for name in without.data_vars:
        assert without[name].equals(with_means[name]), name


def test_threads_to_the_last_bit(swept, tmp_path):
    one = sweep_file(swept, tmp_path, "--keep", "driving_force")
    two = sweep_file(swept, tmp_path, "--keep", "driving_force", "--threads", "2")
    assert set(one.variables) == set(two.variables)
    for name in one.variables:
        assert one[name].equals(two[name]), name


def test_python_and_executable_are_the_same(swept, tmp_path):
    swept["sweep"] |= {"histogram": {"driving_force": True}, "keep": ["reaction"], "map": ["platform.z"]}
    swept["sweep"]["axis"].append({"parameter": "link.platform.mass", "values": [1.0, 2.0]})
    swept["sweep"]["constraint"] = [{"of": "driving_position", "max": 1.8, "name": "stroke"}]
    written = sweep_file(swept, tmp_path, "--keep", "driving_force")
    scene = linkdyn.Scene(swept)
    run = scene.sweep(keep="driving_force", threads=2)
    assert set(run.variables) == set(written.variables) and run.sizes == written.sizes
    assert set(run.coords) == set(written.coords)
    for name in run.variables:
        assert run[name].equals(written[name]), name
        assert run[name].dtype.kind == written[name].dtype.kind, name
        attributes = {key: value for key, value in written[name].attrs.items() if key != "coordinates"}
        assert run[name].attrs == attributes, name
    # Texts may differ in what wrote them.
    for name in set(run.attrs) - {"history", "scene"}:
        assert np.array_equal(run.attrs[name], written.attrs[name]), name
    assert set(run.attrs) == set(written.attrs)
    again = linkdyn.Scene({key: value for key, value in swept.items() if key != "sweep"}).sweep(swept["sweep"], keep=["driving_force"])
    assert all(again[name].equals(run[name]) for name in run.variables)


def test_refused_from_python(tsai):
    with pytest.raises(linkdyn.InputError, match="has no sweep"):
        linkdyn.Scene(tsai).sweep()
    table = {"axis": [{"coordinate": "platform.x", "linspace": [-1.6, -1.4, 3]}]}
    with pytest.raises(linkdyn.InputError, match="driving_forces.*did you mean"):
        linkdyn.Scene(tsai).sweep(table, keep="driving_forces")
    with pytest.raises(linkdyn.InputError, match="solver"):
        linkdyn.Scene(tsai).sweep(table, solver="magic")
    for seconds in (float("nan"), -1):
        with pytest.raises(linkdyn.InputError, match="^checkpoint: .*expected seconds"):
            linkdyn.Scene(tsai).sweep(table, checkpoint=seconds)
    with pytest.raises(linkdyn.SceneError, match="empty axis"):
        linkdyn.Scene(tsai).sweep({"axis": [{"coordinate": "platform.x", "linspace": [-1.6, -1.4, 0]}]})


def test_an_interrupt_leaves_the_scene_usable(tsai, monkeypatch):
    table = {"chunk": 16, "axis": [{"coordinate": "platform.x", "linspace": [-1.6, -1.4, 4000]}]}
    scene = linkdyn.Scene(tsai | {"sweep": table})
    calls = []

    def interrupt(*arguments):
        calls.append(arguments)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return advance(*arguments)

    from linkdyn import _bind

    advance = _bind.advance_sweep
    monkeypatch.setattr(_bind, "advance_sweep", interrupt)
    with pytest.raises(KeyboardInterrupt):
        scene.sweep()
    monkeypatch.undo()
    assert scene.sweep()["samples"] == 4000


def test_chunks_change_rounding_alone(swept, tmp_path):
    small = sweep_file(swept, tmp_path)
    swept["sweep"]["chunk"] = 16384
    large = sweep_file(swept, tmp_path)
    for name in small.variables:
        if name.endswith(("_mean", "_rms")):
            assert small[name].values == pytest.approx(large[name].values, rel=1e-12, abs=1e-12), name
        elif not name.startswith("regenerative"):
            assert small[name].equals(large[name]), name


def test_sampled_axes(tsai, tmp_path):
    n = 64
    axes = [("platform.x", -1.6, -1.4), ("platform.y", -0.1, 0.1), ("platform.z", 0.9, 1.1)]
    for method, extra in (("sobol", {}), ("sobol", {"seed": 3}), ("latin-hypercube", {"seed": 3}), ("random", {"seed": 3})):
        scene = copy.deepcopy(tsai)
        scene["sweep"] = {"reduce": ["driving_position"], "keep": ["driving_position"], "combination": "zip", "axis": [
            {"coordinate": name, method: {"from": low, "to": high, "n": n, **extra}} for name, low, high in axes
        ]}
        results = sweep_file(scene, tmp_path)
        points = results["sample_axis"].values
        assert points.shape == (n, 3)
        unit = (points - [low for _, low, _ in axes]) / [high - low for _, low, high in axes]
        assert np.all((unit > -1e-12) & (unit < 1))
        if method == "sobol" and not extra:
            expected = Sobol(3, scramble=False).random(n)
            assert unit == pytest.approx(expected, abs=1e-13)
        if method != "random":    # one point in each of n equal parts, along every axis
            assert np.array_equal(np.sort(np.floor(unit * n + 1e-9), axis=0), np.tile(np.arange(n)[:, np.newaxis], 3))
        else:
            assert len(np.unique(points)) == 3 * n


def test_designs(tsai, tmp_path):
    tsai["link"][0]["mass"] = "1.5 kg"
    tsai["sweep"] = {"reduce": ["driving_force"], "axis": [
        {"coordinate": "platform.x", "linspace": [-1.6, -1.4, 5]},
        {"parameter": "link.platform.mass", "values": [1.0, "2000 g"]},
        {"coordinate": "platform.yaw", "linspace": [-0.2, 0.2, 3]},
        {"parameter": ["frame.markers.B1", "chain.leg.lower.mass"], "as": "factor", "values": [1.0, 1.1, 1.2]},
        {"parameter": ["frame.markers.B2[0]", "frame.markers.B3[0]"], "as": "offset", "weights": [1, -1], "values": [0.0, "2 cm"]},
    ]}
    results = sweep_file(tsai, tmp_path)
    assert results.sizes["design"] == 12 and results.sizes["parameter"] == 3
    expected_values = list(itertools.product([1.0, 2.0], [1.0, 1.1, 1.2], [0.0, 0.02]))
    assert np.array_equal(results["design_value"], expected_values)
    for design, (mass, factor, offset) in enumerate(expected_values):
        plain = copy.deepcopy(tsai)
        del plain["sweep"]
        plain["link"][0]["mass"] = mass
        markers = plain["frame"]["markers"]
        markers["B1"] = [factor * value for value in markers["B1"]]
        markers["B2"][0] += offset
        markers["B3"][0] -= offset
        plain["chain"][0]["lower"]["mass"] *= factor
        model = linkdyn.Scene(plain)
        q = np.tile(model.motion(0.0)[0], (15, 1))
        q[:, [0, 5]] = list(itertools.product(np.linspace(-1.6, -1.4, 5), np.linspace(-0.2, 0.2, 3)))
        force = model.inverse(q=q, want="driving_force")["driving_force"].values
        got = results.isel(design=design)
        assert got["driving_force_max"].values == pytest.approx(force.max(axis=0), rel=1e-12)
        assert got["driving_force_mean"].values == pytest.approx(force.mean(axis=0), rel=1e-12)
        assert np.array_equal(got["driving_force_max_sample"], 15 * design + force.argmax(axis=0))


def test_a_design_that_is_no_mechanism_is_counted(tsai, tmp_path):
    tsai["sweep"] = {"reduce": ["driving_force"], "axis": [
        {"parameter": "link.platform.mass", "values": [-1.0, 2.0]},
        {"coordinate": "platform.x", "linspace": [-1.6, -1.4, 5]},
    ]}
    results = sweep_file(tsai, tmp_path)
    assert np.array_equal(results["outcome_count"].sel(outcome="no_model"), [5, 0])
    assert np.isnan(results["driving_force_max"].values[0]).all() and np.isfinite(results["driving_force_max"].values[1]).all()


def test_along_the_motion(tsai, tmp_path):
    tsai["sweep"] = {"axis": [
        {"time": True, "linspace": [0.0, 2.0, 41]},
        {"load": "platform.center", "component": "Fx", "values": [0.0, 5.0]},
    ]}
    results = sweep_file(tsai, tmp_path)
    model = linkdyn.Scene({key: value for key, value in tsai.items() if key != "sweep"})
    q, qd, qdd = model.motion(np.linspace(0, 2, 41))
    highest = []
    for fx in (0.0, 5.0):
        run = model.inverse(q=q, qd=qd, qdd=qdd, wrench={"platform.center": [fx, 0, 0, 0, 0, 0]})
        highest.append(run["driving_power"].max("sample").values)
    assert results["driving_power_max"].values == pytest.approx(np.max(highest, axis=0), rel=1e-12)


def test_crossed_singularities(tmp_path):
    """Fichter's platform is singular at its yaw of zero, which every line along yaw crosses."""
    file = Path(__file__).resolve().parents[2] / "benchmarks" / "scenes" / "fichter.toml"
    import tomllib

    scene = tomllib.loads(file.read_text())
    link = scene["coordinate"][0]["link"]
    for chunk in (16384, 16, 7):
        scene["sweep"] = {"reduce": ["determinant", "condition"], "chunk": chunk, "axis": [
            {"coordinate": f"{link}.x", "linspace": [0.0, 0.1, 3]},
            {"coordinate": f"{link}.yaw", "linspace": ["-9 deg", "9.5 deg", 20]},
            {"load": "platform.tool", "component": "Fz", "values": [0, 1]},
        ]}
        results = sweep_file(scene, tmp_path)
        assert results["sign_changes"] == 3, chunk
        at = int(results["sign_change_sample"])
        yaw = np.repeat(np.linspace(-9, 9.5, 20), 2)
        assert yaw[(at - 1) % 40] < 0 < yaw[at % 40]
        assert results["determinant_min"] < 0 < results["determinant_max"]


def test_planar_scene(tmp_path):
    file = Path(__file__).resolve().parents[2] / "examples" / "fivebar_parallel" / "scene.toml"
    import tomllib

    scene = tomllib.loads(file.read_text())
    model = linkdyn.load(file)
    start = model.motion()[0][0]
    values = [np.linspace(-0.05, 0.05, 5) + start[k] for k in range(2)]
    marker = next(f"{link['name']}.{name}" for link in scene["link"] for name in link.get("markers", {}))
    scene["sweep"] = {"on": marker, "reduce": ["driving_force", "driving_position", "driving_power", "reaction_force",
        "reaction_moment", "force_amplification", "moment_amplification", "condition", "determinant"], "axis": [
        {"coordinate": name, "values": value.tolist()} for name, value in zip(model.coordinates, values)]}
    (tmp_path / "tables").mkdir()
    for table in file.parent.glob("*.csv"):
        (tmp_path / table.name).write_text(table.read_text())
    results = sweep_file(scene, tmp_path)
    grid = np.array(list(itertools.product(*values)))
    run = model.inverse(q=grid)
    check_reduction(results, "driving_force", run["driving_force"].values, grid, 1e-12)
    reaction = run["reaction"].values
    check_reduction(results, "reaction_force", np.hypot(reaction[..., 0], reaction[..., 1]), grid, 1e-12)
    check_reduction(results, "reaction_moment", np.abs(reaction[..., 2]), grid, 1e-12)
    zero = model.inverse(q=grid, wrench={marker: [0, 0, 0]})["driving_force"].values
    unit = [model.inverse(q=grid, wrench={marker: w})["driving_force"].values - zero for w in 100 * np.eye(3)]
    gain = np.stack(unit, axis=-1) / 100
    # Differences: what one newton adds to forces of hundreds.
    check_reduction(results, "force_amplification", np.hypot(gain[..., 0], gain[..., 1]), grid, 1e-10)
    check_reduction(results, "moment_amplification", np.abs(gain[..., 2]), grid, 1e-10)


def test_bounds_and_names_stand_in_the_results(tsai, tmp_path):
    tsai["sweep"] = {
        "reduce": ["driving_force"],
        "axis": [{"coordinate": "platform.x", "linspace": [-1.6, -1.4, 3], "name": "across"}],
        "constraint": [{"of": "swing", "max": "30 deg", "name": "joints"}],
        "limit": [{"of": "driving_position", "at": ["leg3.P", "leg1.P"], "min": "1.1 m", "max": "1.3 m"}],
    }
    results = sweep_file(tsai, tmp_path)
    assert results["axis"].values.tolist() == ["across"]
    assert results["bound"].values.tolist() == ["joints", "driving_position"]
    assert results["bound_of"].values.tolist() == ["swing", "driving_position"]
    assert results["bound_at"].values.tolist() == ["", "leg3.P, leg1.P"]
    assert results["bound_unit"].values.tolist() == ["rad", "m"]
    assert results["bound_is_limit"].values.tolist() == [0, 1]
    assert np.isnan(results["bound_min"].values[0]) and results["bound_max"].values[0] == pytest.approx(np.radians(30), rel=EPS)
    assert results["bound_min"].values[1] == 1.1 and results["bound_max"].values[1] == 1.3


def test_designs_change_numbers_in_the_order_of_the_axes(tsai):
    """Each design from the scene's own numbers, whichever design was there before it; axes that meet in one number follow each other."""
    axes = [
        {"parameter": "link.platform.mass", "values": [1.0, 2.0], "as": "factor"},
        {"parameter": ["link.platform.mass", "link.platform.cog[0]"], "values": [0.0, 0.25], "as": "offset"},
        {"parameter": "link.platform.cog", "values": [0.01, 0.0], "as": "offset"},
        {"coordinate": "platform.x", "linspace": [-1.6, -1.4, 3]},
    ]
    tsai["link"][0] |= {"mass": "1500 g", "cog": [0.1, "20 mm", 0.0]}
    plain = copy.deepcopy(tsai)
    swept = linkdyn.Scene(tsai).sweep({"reduce": ["driving_force"], "axis": axes, "chunk": 1}, threads=2)
    found = []
    for factor, addend, shift in itertools.product([1.0, 2.0], [0.0, 0.25], [0.01, 0.0]):
        plain["link"][0] |= {"mass": 1.5 * factor + addend, "cog": [0.1 + addend + shift, 0.02 + shift, shift]}
        scene = linkdyn.Scene(plain)
        q = np.tile(scene.motion(0.0)[0], (3, 1))
        q[:, 0] = np.linspace(-1.6, -1.4, 3)
        found.append(scene.inverse(q).driving_force.values.max(axis=0))
    np.testing.assert_allclose(swept.driving_force_max, found, rtol=1e-12)


@pytest.mark.parametrize("has_spring", [False, True])
@pytest.mark.parametrize("solver", ["elimination", "lapack", "gauss-jordan", "gauss-jordan-plain", "reduced"])
def test_designs_share_equations_and_no_numbers(tsai, solver, has_spring):
    """Equations are written down once for all designs, which differ in their numbers: lengths, masses, inertias, gravity. One that has another
    zero among them has equations of its own, and so has each with a spring between points, which may coincide."""
    tsai["link"][0] |= {"mass": 1.5, "cog": [0.1, 0.02, 0.03], "inertia": [0.08, 0.09, 0.08, 0.01, -0.02, 0.005]}
    tsai["link"][0]["markers"] |= {"hook": [0.1, 0.2, 0.0]}
    tsai["frame"]["markers"] |= {"hook": [-1.5, 0.1, 3.0]}
    if has_spring:
        tsai["spring"] = [{"name": "S", "between": ["frame.hook", "platform.hook"], "stiffness": 40.0, "rest": 1.0}]
    axes = [
        {"parameter": "link.platform.mass", "values": [1.0, 2.0]},
        {"parameter": "link.platform.cog[1]", "values": [0.05, 0.0]},
        {"parameter": "link.platform.inertia[3]", "values": [0.02, -0.01]},
        {"parameter": "frame.markers.B1[0]", "values": [0.1, -0.2], "as": "offset"},
        {"parameter": "gravity[2]", "values": [-9.81, -1.62]},
    ]
    plain = copy.deepcopy(tsai)
    swept = linkdyn.Scene(tsai).sweep(
        {"reduce": ["driving_force"], "axis": [*axes, {"coordinate": "platform.x", "linspace": [-1.6, -1.4, 2]}]}, solver=solver)
    found = []
    for mass, cog, product, shift, gravity in itertools.product(*(axis["values"] for axis in axes)):
        design = copy.deepcopy(plain)
        design["link"][0] |= {"mass": mass, "cog": [0.1, cog, 0.03], "inertia": [0.08, 0.09, 0.08, product, -0.02, 0.005]}
        design["frame"]["markers"]["B1"][0] += shift
        design["gravity"] = [0.0, 0.0, gravity]
        scene = linkdyn.Scene(design)
        q = np.tile(scene.motion(0.0)[0], (2, 1))
        q[:, 0] = [-1.6, -1.4]
        found.append(scene.inverse(q, solver=solver, want="driving_force").driving_force.values.max(axis=0))
    np.testing.assert_allclose(swept.driving_force_max, found, rtol=1e-11)


@pytest.mark.thorough
def test_many_designs_by_values(tmp_path):
    """Lists of values as long as there are designs: minutes, and hours of more of them, where each design reads the lists once more."""
    scene = linkdyn.load(Path(__file__).parents[2] / "examples" / "sixbar_slider" / "scene.toml")
    n = 8_000
    axes = [{"parameter": path, "group": "mc", "values": np.random.default_rng(k).normal(mean, 1e-3, n)}
            for k, (path, mean) in enumerate((("link.coupler.markers.J1[0]", 0.8), ("link.rod.markers.J4[0]", 0.8), ("link.crank.mass", 4.72)))]
    file = tmp_path / "scene.toml"
    file.write_text(scene.with_({"sweep": {"reduce": ["driving_force"], "axis": [*axes, {"time": True, "linspace": [0.0, 1.0, 2]}]}}).text)
    subprocess.run([executable(), "sweep", file, "-q", "--yes", "-o", tmp_path / "run.nc"], check=True, timeout=150)
    with xr.open_dataset(tmp_path / "run.nc") as run:
        assert run.sizes["design"] == n and np.isfinite(run.driving_force_max).all()


@pytest.mark.thorough
def test_threads_read_designs_at_once() -> None:
    """Units and messages are texts, which gfortran's functions return through memory that threads share: a thread that read `20 mm` while
    another one read a unit took 20 m, once in a thousand designs, with status ok."""
    bodies = {"crank": ("100 mm", "400 g", ["50 mm", "1 mm"], "0.4 g*m^2"), "coupler": ("280 mm", "900 g", ["140 mm", "2 mm"], "6 g*m^2"),
              "rocker": ("200 mm", "700 g", ["0.1 m", "3 mm"], "2 g*m^2")}
    scene = linkdyn.Scene({
        "space": "planar", "gravity": [0.0, "-9.81 m/s^2"],
        "frame": {"markers": {"A": [0.0, 0.0], "D": ["300 mm", "0 mm"]}},
        "link": [{"name": name, "markers": {"from": ["0 mm", 0.0], "to": [length, "0 mm"]}, "mass": mass, "cog": cog, "inertia": inertia}
                 for name, (length, mass, cog, inertia) in bodies.items()],
        "joint": [{"name": name, "type": "revolute", "between": between} for name, between in {
            "A": ["frame.A", "crank.from"], "B": ["crank.to", "coupler.from"], "C": ["coupler.to", "rocker.from"], "D": ["frame.D", "rocker.to"],
        }.items()],
        "coordinate": [{"joint": "A"}], "actuator": [{"joint": "A"}],
    })
    sweep = {"reduce": ["driving_force"], "chunk": 1, "axis": [
        {"parameter": "link.crank.mass", "linspace": [1.0, 2.0, 2000], "as": "factor"}, {"coordinate": "A", "values": [0.7, 1.0]}]}
    alone = scene.sweep(sweep, threads=1)
    together = scene.sweep(sweep, threads=2)
    np.testing.assert_array_equal(together.driving_force_max, alone.driving_force_max)


def carried_stage() -> linkdyn.Builder:
    """A stage on a table, three coordinates of one joint; two springs that only names tell apart, two payloads on one marker."""
    b = linkdyn.Builder("Stage", "spatial", gravity=(0, -3, -9))
    stage = b.link("stage", mass=2, inertia={"diagonal": [0.1, 0.2, 0.3]}, markers={"A": (0, 0, 0), "tool": (0.3, 0.1, 0.2)})
    table = b.planar("table", b.frame.marker("A", (0, 0, 0)), stage["A"])
    for k, variable in enumerate(("x", "y", "angle")):
        b.coordinate(table, variable=variable, motion={"law": "harmonic", "amplitude": 0.1 + 0.1 * k, "frequency": 3})
        b.actuator(table, variable=variable)
    b.payload(stage["tool"], mass=1)
    b.payload(stage["tool"], mass=3)
    b.time(end=1, samples=5)
    return b


@pytest.mark.parametrize(("path", "called"), [
    ("coordinate.table.motion.amplitude", "table"), ("payload.stage.tool.mass", "stage.tool"),
])
def test_names_that_several_bear_lead_nowhere(path, called):
    """The first of them was taken without a word."""
    scene = carried_stage().scene()
    with pytest.raises(linkdyn.SceneError, match=rf"several in '\w+' are called '{called}' \(expected one of them, by its number: \w+\[0\] is the first"):
        scene.sweep({"axis": [{"parameter": path, "values": [0.1]}]})
    with pytest.raises(linkdyn.InputError, match=r"several in 'payload' are called" if "payload" in path else r"there is no coordinate 'table' \(expected one of 'table.x'"):
        scene.with_({path: 0.1})


@pytest.mark.parametrize("path", ["coordinate.table.y.motion.amplitude", "coordinate[1].motion.amplitude", "payload[1].mass"])
def test_variables_and_numbers_tell_tables_apart(path):
    """Sweeps and `with_` take the same of them."""
    scene = carried_stage().scene()
    run = scene.sweep({"axis": [{"parameter": path, "values": [0.35, 7]}, {"time": True, "linspace": [0, 1, 5]}]}, keep="driving_force")
    expected = [scene.with_({path: value}).inverse().driving_force.values for value in (0.35, 7)]
    assert np.abs(expected[0] - expected[1]).max() > 0.1
    np.testing.assert_allclose(run.driving_force.values.reshape(2, 5, 3), expected, rtol=1e-12, atol=1e-12)


def test_coordinates_of_markers_and_controllers_have_paths():
    """Coordinates are called by their marker, a controller by its actuator, not by what it measures."""
    scene = linkdyn.load(Path(__file__).resolve().parents[2] / "examples" / "fivebar_pick" / "scene.toml")
    for path in ("coordinate.carrier.C.motion.y.values[1]", "controller.A.kp"):
        changed = scene.with_({path: 0.123})
        assert "0.123" in changed.text and "0.123" not in scene.text
        sweep = {"axis": [{"parameter": path, "as": "factor", "values": [1.0]}], "reduce": ["driving_force"]}
        if path.startswith("coordinate"):
            assert scene.sweep(sweep).sizes["design"] == 1
        else:    # inverse dynamics does not ask controllers: each value gave the same forces
            with pytest.raises(linkdyn.SceneError, match="parameter 'controller.A.kp' only affects forward runs"):
                scene.sweep(sweep)


def test_whole_numbers_stay_whole():
    """Branches are integers: 1.0 in their place made each design one that is no mechanism."""
    scene = linkdyn.load(Path(__file__).resolve().parents[2] / "examples" / "fourbar" / "scene.toml")
    axes = [{"parameter": "joint.J3.branch", "values": [-1, 1, 0.5, 1]}, {"coordinate": "J1", "linspace": [0.3, 0.7, 3]}]
    run = scene.sweep({"axis": axes, "keep": ["driving_force"]})
    expected = [scene.with_({"joint.J3.branch": branch}).inverse(q=np.linspace(0.3, 0.7, 3)[:, np.newaxis]).driving_force.values
                for branch in (-1, 1)]
    assert np.array_equal(run.outcome_count.sel(outcome="no_model"), [0, 0, 3, 0])
    np.testing.assert_allclose(run.driving_force.values.reshape(4, 3, 1)[[0, 1, 3]], [*expected, expected[1]], rtol=1e-12)
