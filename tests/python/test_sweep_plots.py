"""Pictures of sweeps: what they show is what the samples say."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest

import linkdyn
from linkdyn import plot
from linkdyn._drawing import sweep_plots
from linkdyn.cli import executable

pytestmark = [pytest.mark.python_alone, pytest.mark.usefixtures("closed_figures")]

KEEP = ("driving_force", "driving_speed", "condition")


def table() -> dict:
    return {
        "reduce": ["driving_force", "driving_position", "driving_speed", "condition", "swing"],
        "histogram": {"bins": 12, "driving_force": True},
        "axis": [
            {"coordinate": "platform.x", "linspace": [-1.7, -1.3, 5]},
            {"coordinate": "platform.z", "linspace": [0.8, 1.1, 4]},
            {"coordinate": "platform.roll", "linspace": ["-20 deg", "20 deg", 3]},
            {"coordinate": "platform.y", "values": [-0.1, 0.0, 0.15]},
            {"rate": "platform.x", "values": [0.3, -0.2], "group": "case"},
            {"load": "platform.center", "component": "Fz", "values": [0, -25], "group": "case"},
        ],
        "constraint": [{"of": "driving_position", "at": "leg1.P", "max": 1.36, "name": "stroke"}],
        "limit": [{"of": "driving_force", "max": 17.5}],
    }


@pytest.fixture(scope="module")
def run(scene):
    return scene.sweep(table(), keep=KEEP)


@pytest.fixture(scope="module")
def designed(scene):
    sweep = table()
    sweep["axis"].insert(0, {"parameter": "link.platform.mass", "name": "mass", "values": [1, 2, 3]})
    return scene.sweep(sweep)


def mesh(axis) -> np.ndarray:
    """Values of a panel's cells, (x, y)."""
    return np.asarray(axis.collections[0].get_array().filled(np.nan)).reshape(axis.collections[0].get_coordinates().shape[0] - 1, -1).T


def of_cell(run, x: float, z: float, excluded: bool = False) -> np.ndarray:
    """Which samples lie at a place, and within the constraint or not."""
    names = list(run.axis.values)
    at = run.sample_axis.values
    here = (np.abs(at[:, names.index("platform.x")] - x) < 1e-12) & (np.abs(at[:, names.index("platform.z")] - z) < 1e-12)
    return here & ((run.outcome.values[run.sample_outcome.values] == "stroke") == excluded)


def test_workspace_shows_the_worst_of_each_cell(run):
    figure, axes = plot.workspace(run, axes=("platform.x", "platform.z"))
    assert axes.shape == (1,)
    shown = mesh(axes[0])
    assert shown.shape == (5, 4)
    for i, x in enumerate(np.linspace(-1.7, -1.3, 5)):
        for j, z in enumerate(np.linspace(0.8, 1.1, 4)):
            force = np.abs(run.driving_force.values[of_cell(run, x, z)])
            if len(force):
                assert shown[i, j] == force.max()
            else:
                assert np.isnan(shown[i, j])
    assert axes[0].get_xlabel() == "platform x [mm]"
    figure.canvas.draw()


def test_samples_beyond_a_constraint_are_not_shown(run):
    """Their condition is known, and kept, but they are no poses of the machine."""
    shown = mesh(plot.workspace(run, "condition", axes=("platform.x", "platform.z"))[1][0])
    n_smaller = 0
    for i, x in enumerate(np.linspace(-1.7, -1.3, 5)):
        for j, z in enumerate(np.linspace(0.8, 1.1, 4)):
            allowed = of_cell(run, x, z)
            if allowed.any():
                assert shown[i, j] == run.condition.values[allowed].max()
                n_smaller += shown[i, j] < run.condition.values[of_cell(run, x, z, excluded=True)].max(initial=0.0)
    assert n_smaller > 0


def test_the_sweeps_own_map_is_the_same_picture(run, scene):
    """Worst of each cell and its feasible share, from samples or as the sweep goes; over all axes of the map or over some."""
    mapped = scene.sweep(table() | {"map": ["platform.z", "platform.x", "platform.y"]})
    assert "sample_axis" not in mapped
    for quantity in ("driving_force", "condition", "feasible"):
        for axes in (("platform.x", "platform.z"), ("platform.x", "platform.z", "platform.y")):
            ours, theirs = (plot.workspace(results, quantity, axes=axes)[1] for results in (mapped, run))
            assert len(ours) == len(theirs)
            for one, other in zip(ours, theirs):
                np.testing.assert_allclose(mesh(one), mesh(other), rtol=1e-13)
    _, axes = plot.workspace(mapped)        # as the map is: slices over its last axis
    assert axes[0].get_xlabel() == "platform z [mm]" and axes[0].get_title() == "platform y = -100 mm"
    with pytest.raises(linkdyn.InputError, match="no samples"):
        plot.workspace(mapped, where={"platform.y": 0.0})


def test_slices_one_entry_and_one_value(run):
    figure, axes = plot.workspace(run, "driving_force", at="leg4.P", where={"platform.roll": 0.3})
    assert axes.shape == (3,)    # of y
    assert [axis.get_title() for axis in axes] == ["platform y = -100 mm", "platform y = 0 mm", "platform y = 150 mm"]
    roll = run.sample_axis.values[:, list(run.axis.values).index("platform.roll")]
    chosen = (roll > 0.1) & (run.outcome.values[run.sample_outcome.values] != "stroke")
    largest = max(np.nanmax(mesh(axis)) for axis in axes)
    assert largest == np.abs(run.driving_force.sel(actuator="leg4.P").values[chosen]).max()
    figure.canvas.draw()


def test_feasible_share_and_reasons(run):
    share = mesh(plot.workspace(run, "feasible", axes=("platform.x", "platform.z"))[1][0])
    here = np.abs(run.sample_axis.values[:, :1] + 1.7)[:, 0] < 1e-12
    here &= np.abs(run.sample_axis.values[:, 1] - 1.1) < 1e-12
    assert share[0, 3] == pytest.approx(100 * (run.sample_outcome.values[here] == 0).mean(), abs=1e-12)
    figure, _ = plot.workspace(run, "outcome")
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == ["feasible", "stroke", "driving force"]


def test_workspace_in_space(run):
    figure, axes = plot.workspace(run, "condition", kind="3d")
    assert axes[0].name == "3d"
    figure.canvas.draw()


def test_random_samples_are_put_into_cells(scene):
    sweep = {
        "reduce": ["driving_force"],
        "axis": [
            {"coordinate": name, "sobol": {"from": low, "to": high, "n": 512, "seed": 3}, "group": "s"}
            for name, low, high in (("platform.x", -1.7, -1.3), ("platform.y", -0.2, 0.2))
        ],
    }
    samples = scene.sweep(sweep, keep="driving_force")
    shown = mesh(plot.workspace(samples)[1][0])
    assert shown.shape == (24, 24)
    assert np.nanmax(shown) == np.abs(samples.driving_force).max()


def test_force_map_has_signs(run):
    figure, axes = plot.force_map(run, axes=("platform.x", "platform.z"))
    assert len(axes) == 6
    for k, axis in enumerate(axes):
        strongest = max(run.driving_force_max.values[k], run.driving_force_min.values[k], key=abs)
        shown = mesh(axis)
        assert shown.flat[np.nanargmax(np.abs(shown))] == strongest
    figure.canvas.draw()


def test_sizing_uses_of_the_limit(run):
    """A rectangle: the use is the larger of speed and force over theirs."""
    speed, force = 0.5, 20.0
    _, axes = plot.sizing(run, [(0, force), (speed, force)])
    reduced = run.outcome.values[run.sample_outcome.values] != "stroke"
    for k, axis in enumerate(axes):
        v, f = run.driving_speed.values[reduced, k], run.driving_force.values[reduced, k]
        use = np.maximum(np.abs(v) / speed, np.abs(f) / force)
        assert f"use of the limit {use.max():.2f}" in axis.get_title()
        assert ("beyond" in axis.get_title()) == (use.max() > 1)
        assert f"rms {float(run.driving_force_rms[k]):.4g} N" in axis.get_title()


def test_use_of_a_sloping_limit():
    """Force 10 - 5 v: the curve grown by s touches (1, 15) where 15 = s (10 - 5/s): s = 2."""
    use = sweep_plots._use(np.array([[1.0, 15.0], [-1.0, -15.0], [0.0, 5.0], [np.nan, 1.0]]), np.array([[0.0, 10.0], [2.0, 0.0]]))
    assert use[:3] == pytest.approx([2.0, 2.0, 0.5], rel=1e-9) and np.isnan(use[3])


def test_sizing_of_a_run_along_time(scene):
    run = scene.inverse()
    _, axes = plot.sizing(run, [(0, 20), (1, 20)], [(0, 9), (1, 9)])
    rms = np.sqrt(np.mean(run.driving_force.values[:, 0] ** 2))
    assert f"leg1.P   rms {rms:.4g} N" in axes[0].get_title()


def test_one_rms(scene, tmp_path):
    """Along the same instants the summary, the picture and a sweep say the same, each sample counting alike."""
    time = scene.description["time"]
    axis = {"time": True, "linspace": [time["first"], time["last"], time["n_sample"]]}
    swept = scene.sweep({"reduce": ["driving_force", "driving_speed"], "axis": [axis]})
    run = scene.inverse()
    np.testing.assert_allclose(swept.driving_force_rms, np.sqrt((run.driving_force.values**2).mean(axis=0)), rtol=1e-13)
    titles = [[axis.get_title() for axis in plot.sizing(data, [(0, 20), (1, 20)], [(0, 9), (1, 9)])[1]] for data in (run, swept)]
    pairs = [tuple(title[: title.index(" N") + 2] for title in pair) for pair in zip(*titles)]
    assert len(pairs) == 6 and all(one == other for one, other in pairs)
    file = tmp_path / "scene.toml"
    file.write_text(scene.text)
    said = subprocess.run([executable(), "inverse", file, "--no-output"], capture_output=True, text=True, check=True).stdout
    printed = [float(line.split()[-1]) for line in said.splitlines() if line.startswith("  leg")]
    np.testing.assert_allclose(printed, swept.driving_force_rms, rtol=1e-5)    # six digits


def test_sizing_without_samples_is_the_box(designed):
    _, axes = plot.sizing(designed, design=1)
    corners = axes[0].patches[0].get_xy()
    assert corners[:, 1].max() == designed.driving_force_max.values[1, 0]
    assert corners[:, 0].min() == designed.driving_speed_min.values[1, 0]


def test_screw_limit_keeps_the_power():
    (v, f), = plot.screw_limit([(100.0, 3.0)], 0.02, ratio=2.0, efficiency=0.8)
    assert v == pytest.approx(100 * 0.02 / (2 * np.pi * 2), rel=1e-15)
    assert f * v == pytest.approx(0.8 * 100 * 3, rel=1e-15)


def test_histograms(run, scene):
    _, axes = plot.histograms(run)
    share = axes[2].patches[0].get_data().values
    counts = run.driving_force_histogram.values[2]
    np.testing.assert_allclose(share, 100 * counts / counts.sum(), rtol=1e-14)
    _, axes = plot.histograms(run, "condition")       # from samples
    assert axes[0].patches[0].get_data().values.sum() == pytest.approx(100)


def test_designs_show_the_front(designed):
    _, axis = plot.designs(designed, gain="condition")
    assert axis.get_ylabel() == "largest driving force [N]"
    points = np.concatenate([np.asarray(c.get_offsets()) for c in axis.collections[:1]])
    assert sorted(points[:, 1]) == sorted(np.maximum(designed.driving_force_max, -designed.driving_force_min).max("actuator").values)


def test_pareto_front():
    cost, gain = np.array([3.0, 1.0, 2.0, 2.0, np.nan]), np.array([3.0, 1.0, 2.0, 1.5, 9.0])
    assert sweep_plots.pareto_front(cost, gain).tolist() == [1, 2, 0]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda run, designed: plot.workspace(run, "clearance"), "'clearance' was not kept"),
        (lambda run, designed: plot.workspace(run, axes=("platform.q", "platform.x")), "no axis 'platform.q'"),
        (lambda run, designed: plot.workspace(run, axes=("platform.x",)), "1 axes"),
        (lambda run, designed: plot.workspace(run, at="leg9.P"), "no 'leg9.P'"),
        (lambda run, designed: plot.workspace(run, kind="4d"), "kind '4d'"),
        (lambda run, designed: plot.workspace(designed), "no samples"),
        (lambda run, designed: plot.force_map(run, where={"wind": 1.0}), "no axis 'wind'"),
        (lambda run, designed: plot.sizing(run, [(0, 1)]), "limit"),
        (lambda run, designed: plot.sizing(designed), "3 designs"),
        (lambda run, designed: plot.sizing(designed, design=3), "design 3"),
        (lambda run, designed: plot.histograms(run, "swing"), "neither histogram nor samples"),
        (lambda run, designed: plot.histograms(run, at=["leg9.P"]), "no 'leg9.P'"),
        (lambda run, designed: plot.designs(run), "one design only"),
        (lambda run, designed: plot.designs(designed, "swinge"), "'swinge' is not in the results"),
        (lambda run, designed: plot.screw_limit([(0, 1)], 0.0), "lead > 0"),
        (lambda run, designed: plot.workspace(linkdyn.load), "no results of a sweep"),
    ],
)
def test_refused(run, designed, call, message):
    with pytest.raises(linkdyn.InputError, match=message):
        call(run, designed)


def test_designs_without_a_workspace_have_a_share():
    """No coordinate is a length: nothing has a volume, and the picture is drawn all the same."""
    axes = [{"parameter": "variables.rocker", "values": [0.34, 0.35]}, {"coordinate": "A", "linspace": [0.0, 6.0, 13]}]
    run = linkdyn.new("four-bar").sweep({"axis": axes})
    assert "feasible_volume" not in run
    _, axis = plot.designs(run)
    assert axis.get_xlabel().startswith("feasible")


def test_a_front_of_one_design_is_a_ring() -> None:
    """The legend showed a line that was nowhere in the picture."""
    axes = [{"coordinate": "A", "linspace": [0.0, 6.0, 13]}, {"parameter": "variables.line", "values": [1.0, 2.0]}]
    _, axis = plot.designs(linkdyn.new("four-bar").sweep({"axis": axes}), gain="feasible_fraction")
    (front,) = (line for line in axis.lines if line.get_label() == "no design is better in both")
    assert (len(front.get_xdata()), front.get_marker(), front.get_linestyle()) == (1, "o", "None")
