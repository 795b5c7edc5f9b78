"""Scene.study and its picture."""

from __future__ import annotations

from pathlib import Path

import linkdyn
import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")


@pytest.mark.thorough
def test_study_of_a_scene(tmp_path):
    """Rows of both analyses; a Dataset that a picture can be drawn from; a scene that cannot run says why."""
    scene = linkdyn.load("examples/rcsp_start/scene.toml")
    result = scene.study(t_end=0.2)
    assert set(result.analysis.values) == {"inverse", "forward"}
    assert np.all(result.seconds > 0)
    tightest = result.error.values[(result.method.values == "gbs") & (result.setting.values == "tol 1e-12")]
    assert tightest.size == 1 and tightest[0] < 1e-9
    assert "for 1e-6 use" in result.attrs["report"]
    figure, axes = linkdyn.plot.study(result)
    assert [axis.get_title() for axis in axes] == ["inverse dynamics", "forward dynamics"]
    figure.savefig(tmp_path / "study.png")
    text = Path("examples/fourbar/scene.toml").read_text()
    still = text.replace('[[actuator]]\njoint = "J1"\n', "").replace("end = 6.0\nsamples = 601", "end = 0.0\nsamples = 1")
    with pytest.raises(linkdyn.LinkdynError, match="neither inverse nor forward"):
        linkdyn.Scene(still).study()


@pytest.mark.thorough
def test_an_unstable_motion_is_called_so():
    """The five-bar under the torques of its motion, with nothing to hold it there: errors grow tenfold every 0.16 s."""
    report = linkdyn.load("examples/fivebar_parallel/scene.toml").study().attrs["report"]
    line = next(line for line in report.splitlines() if "unstable motion: errors grow tenfold every" in line)
    assert 0.1 < float(line.split("every")[1].split()[0]) < 0.3
    assert "unstable" not in linkdyn.load("examples/stephenson_iii/scene.toml").study().attrs["report"]
