"""Pictures: every line, label and unit is there."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from matplotlib import pyplot

import linkdyn
from linkdyn import plot


@pytest.fixture(scope="module")
def scene(tsai_file):
    return linkdyn.load(tsai_file)


@pytest.fixture(scope="module")
def run(scene):
    return scene.inverse()


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    pyplot.close("all")


def test_driving_forces(run):
    figure, axes = plot.driving_forces(run)
    assert axes.shape == (1,)
    legend = [text.get_text() for text in axes[0].get_legend().get_texts()]
    assert [text.split()[0] for text in legend] == list(run.actuator.values)
    force = run.driving_force.sel(actuator="leg1.P").values
    assert f"{force[np.argmax(np.abs(force))]:.4g} N" in legend[0]
    assert axes[0].get_ylabel() == "driving force [N]" and axes[0].get_xlabel() == "time [s]"
    figure.canvas.draw()


def test_reactions(run):
    figure, axes = plot.reactions(run)
    assert axes.shape == (3, 2)
    line = axes[0, 0].get_lines()[0]
    expected = np.linalg.norm(run.reaction.sel(joint="leg1.U", component=["Fx", "Fy", "Fz"]), axis=1)
    np.testing.assert_allclose(line.get_ydata(), expected, rtol=1e-14)
    assert axes[0, 1].get_ylabel() == "moment [N·m]"
    figure.canvas.draw()


def test_pictures_with_failed_samples(crossing):
    run = linkdyn.Scene(crossing).inverse()
    for draw in (plot.driving_forces, plot.reactions):
        figure, _ = draw(run)
        figure.canvas.draw()


def test_batch_without_time(scene):
    figure, axes = plot.driving_forces(scene.inverse(scene.motion()[0][:10]))
    assert axes[0].get_xlabel() == "sample"
    figure.canvas.draw()


def test_scene3d(scene):
    figure, axis = plot.scene3d(scene)
    texts = {text.get_text().strip() for text in axis.texts}
    assert {"platform", "frame", "leg1", "leg6"} <= texts
    assert [axis.get_xlabel(), axis.get_ylabel(), axis.get_zlabel()] == ["x [m]", "y [m]", "z [m]"]
    kinds = {text.get_text() for text in axis.get_legend().get_texts()}
    assert kinds == {"universal", "prismatic", "spherical"}
    figure.canvas.draw()


def test_scene3d_draws_the_platform_where_it_is(scene):
    q = np.array([0.1, -0.2, 1.2, 0.0, 0.0, 0.0])
    _, axis = plot.scene3d(scene, q)
    drawn = np.concatenate([np.array(line.get_data_3d()).T for line in axis.get_lines()])
    for name, at in {m["name"]: m["at"] for m in scene.description["links"][1]["markers"]}.items():
        distance = np.linalg.norm(drawn - (q[:3] + at), axis=1).min()
        assert distance < 1e-12, name


def test_what_cannot_be_drawn_is_refused(scene, crossing):
    with pytest.raises(linkdyn.InputError, match="no reaction"):
        plot.reactions(scene.inverse(scene.motion()[0][:2], want="driving_force"))
    wrong = linkdyn.Scene(crossing)
    with pytest.raises(linkdyn.InputError, match="cannot be assembled"):
        plot.scene3d(wrong, wrong.motion()[0][2])
