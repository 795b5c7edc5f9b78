"""Scene.study and its picture."""

from __future__ import annotations

from pathlib import Path

import linkdyn
import linkdyn.cli
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


def test_a_wrong_reference_is_called_so(tmp_path, monkeypatch):
    """A twin that answers by a run at a loose tolerance: two methods agree, and not with it."""
    scene = linkdyn.Scene({
        "space": "planar", "gravity": [0.0, -9.81], "frame": {"markers": {"A": [0.0, 0.0]}},
        "link": [{"name": "rod", "mass": 1.0, "inertia": 0.1, "cog": [0.5, 0.0], "markers": {"A": [0.0, 0.0]}}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "rod.A"]}], "coordinate": [{"joint": "A", "start": {"position": 0.3, "velocity": 0.0}}],
    })  # fmt: skip
    scene.forward(0.1, method="rk8pd")    # one of the two: a build without it cannot tell
    command = linkdyn.cli.executable()
    twin = tmp_path / "linkdyn-real128"
    monkeypatch.setenv("LINKDYN_REAL128", str(twin))
    for tolerance, is_wrong in (("1e-4", True), ("1e-13", False)):
        twin.write_text(f"""#!/bin/sh
for word; do
    shift
    test "$word" = 1e-17 && word={tolerance}
    set -- "$@" "$word"
done
exec "{command}" "$@"
""")
        twin.chmod(0o755)
        report = scene.study(t_end=2.0).attrs["report"]
        assert "errors against the quadruple twin" in report
        assert ("the reference is wrong: rk8pd and gbs agree to" in report) == is_wrong


def slider_leads(start: float) -> linkdyn.Scene:
    """A slider-crank led by its slider, outwards by 0.2 m: the crank and the rod end at 0.7 m."""
    part = {"mass": 1.0, "inertia": 0.01}
    return linkdyn.Scene({
        "space": "planar", "gravity": [0.0, -9.81], "frame": {"markers": {"A": [0.0, 0.0]}}, "time": {"end": 1.0, "samples": 41},
        "link": [{"name": "crank", **part, "markers": {"A": [0.0, 0.0], "B": [0.2, 0.0]}}, {"name": "rod", **part, "markers": {"B": [0.0, 0.0], "C": [0.5, 0.0]}},
                 {"name": "slider", **part, "markers": {"C": [0.0, 0.0]}}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]}, {"name": "B", "type": "revolute", "between": ["crank.B", "rod.B"]},
                  {"name": "C", "type": "revolute", "between": ["rod.C", "slider.C"]}, {"name": "D", "type": "prismatic", "between": ["frame.A", "slider.C"]}],
        "coordinate": [{"joint": "D", "motion": {"law": "constant-rate", "start": start, "rate": 0.2}}], "actuator": [{"joint": "D"}],
    })  # fmt: skip


def test_samples_without_forces_are_left_out():
    """Errors of the samples that there are, against the quadruple twin, which then answers; of none of them nothing is recommended."""
    result = slider_leads(0.6).study(t_end=0.1)
    errors = result.error.values[result.analysis.values == "inverse"]
    assert np.nanmax(errors) < 1e-12
    assert 0 < (errors > 0).sum()
    assert result.attrs["reference"].startswith(("quadruple twin", "most careful result"))
    assert ("twin gave no answer" in result.attrs["reference"]) == ("twin gave no answer" in result.attrs["report"])
    if linkdyn.cli.quadruple_twin():
        assert "of inverse dynamics" not in result.attrs["reference"]
    report = slider_leads(0.75)
    with pytest.raises(linkdyn.LinkdynError, match="no sample of the motion has forces"):
        report.study(t_end=0.1)
