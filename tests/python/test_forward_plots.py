"""Pictures of forward runs: what they show are the run's own numbers, with names and units."""
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import linkdyn
from linkdyn import plot

pytestmark = [pytest.mark.python_alone, pytest.mark.usefixtures("closed_figures")]

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture(scope="module")
def run():
    return linkdyn.load(EXAMPLES / "flyball_governor" / "scene.toml").forward(t=np.linspace(0.0, 0.01, 6))


def test_motion_has_a_row_for_each_unit(run):
    figure, axes = plot.motion(run)
    assert axes.shape == (2, 2)
    assert [axis.get_ylabel() for axis in axes.flat] == ["position [deg]", "rate [rad/s]", "position [mm]", "rate [mm/s]"]
    np.testing.assert_array_equal(axes[1, 1].get_lines()[0].get_ydata(), run.qd.sel(coordinate="guide"))
    assert {text.get_text().split()[0] for text in axes[0, 1].texts} == {"bearing", "pivot1", "pivot2"}
    figure.canvas.draw()


def test_motion_stacked_has_a_column_for_each_unit(run):
    _, axes = plot.motion(run, stacked=True)
    assert [axis.get_ylabel() for axis in axes.flat] == ["position [deg]", "position [mm]", "rate [rad/s]", "rate [mm/s]"]


def test_arguments_that_there_are_not(run):
    """The name of the function is told, as by Python itself."""
    with pytest.raises(TypeError, match="^motion: too many positional arguments"):
        plot.motion(run, False, 3)


def test_energies_with_their_balance(run):
    figure, axes = plot.energies(run)
    balance = axes[1].get_lines()[0].get_ydata()
    total = (run.kinetic_energy + run.potential_energy - run.work).values
    np.testing.assert_array_equal(balance, total - total[0])
    assert balance[0] == 0.0 and balance[-1] < 0.0      # the dampers take energy
    figure.canvas.draw()


def test_energies_are_told_in_units_that_suit(run):
    """In kJ or MJ, without an offset beside the axis, names where the lines end."""
    large = run.assign({name: (run[name].dims, 1e6 * run[name].values) for name in ("kinetic_energy", "potential_energy", "work")})
    figure, axes = plot.energies(large)
    figure.canvas.draw()
    assert axes[0].get_ylabel().endswith(("[kJ]", "[MJ]", "[GJ]"))
    assert not any(axis.yaxis.get_offset_text().get_text() for axis in axes)
    assert {text.get_text() for text in axes[0].texts} == {"kinetic", "potential", "work of the drives"}


def test_steps(run):
    figure, axes = plot.steps(run)
    np.testing.assert_array_equal(axes[0].get_lines()[0].get_ydata(), run.step.values[1:])
    assert axes[0].get_ylabel() == f"step of {run.attrs['method']} [s]"
    figure.canvas.draw()


def test_equal_steps_are_one_line(run):
    """What rounding makes of equal steps fills no picture: the axis spans a decade and more around them."""
    step = np.full(run.sizes["sample"], 1e-3) * (1 + 4e-16 * np.random.default_rng(1).integers(-3, 4, run.sizes["sample"]))
    for values in (step, np.full(len(step), 1e-3), np.full(len(step), 0.02)):
        _, axes = plot.steps(run.assign(step=("sample", values)))
        low, high = axes[0].get_ylim()
        assert high >= 9.99 * low and low < values[1:].min() and values[1:].max() < high


def test_missing_results_are_named(run):
    with pytest.raises(linkdyn.LinkdynError, match="kinetic_energy"):
        plot.energies(run.drop_vars("kinetic_energy"))
    with pytest.raises(linkdyn.LinkdynError, match="expected a forward run with its energies"):
        plot.energies(run.drop_vars("kinetic_energy"))
    with pytest.raises(linkdyn.LinkdynError, match="no step .expected a forward run"):
        plot.steps(run.drop_vars("step"))
    with pytest.raises(linkdyn.LinkdynError, match=r"expected that of Scene.study\(\)"):
        plot.study(run)
