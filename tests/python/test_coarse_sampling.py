"""Samples of a motion too far from each other for peaks to be seen: told by the summary, the run, its sheet and a balance."""

from __future__ import annotations

import subprocess
from pathlib import Path

import linkdyn
import numpy as np
import pytest
from linkdyn.cli import executable


def long_run(end: str) -> linkdyn.Scene:
    """The slider-crank at 600 rpm, as the template writes it, for another time."""
    return linkdyn.new("slider-crank").with_({"time.end": end})


@pytest.mark.parametrize(("end", "degrees"), [("10 s", 180), ("2 s", 36)])
def test_a_crank_with_few_samples_a_turn_is_told(end: str, degrees: int) -> None:
    told = long_run(end).inverse().attrs["coarse_sampling"]
    assert told.startswith(f"'crank' turns by {degrees} deg from sample to sample: peaks between them are not seen (expected ")
    n = int(told.split("expected ")[1].split()[0])
    assert n == np.ceil(200 * degrees / 5) + 1
    times = np.linspace(0, float(end.split()[0]), n)
    assert long_run(end).inverse(t=times).attrs["coarse_sampling"] == ""


def test_samples_close_enough_are_not() -> None:
    assert long_run("0.2 s").inverse().attrs["coarse_sampling"] == ""
    assert linkdyn.new("hexapod").inverse().attrs["coarse_sampling"] == ""


def test_a_fast_swing_is_told() -> None:
    """It never goes far, yet there are two samples in each of its waves."""
    scene = linkdyn.new("arm").with_({"coordinate.elbow.motion": {"law": "harmonic", "amplitude": "1 deg", "frequency": "50 Hz"}})
    told = scene.inverse(t=np.linspace(0, 1, 98)).attrs["coarse_sampling"]
    assert told.startswith("'elbow' swings by 186 deg of an oscillation from sample to sample")


def test_summary_sheet_and_balance_tell_it(tmp_path: Path) -> None:
    scene = long_run("10 s")
    file = tmp_path / "fast.toml"
    file.write_text(scene.text)
    summary = subprocess.run([executable(), "inverse", str(file), "-o", str(tmp_path / "run.nc")], capture_output=True, text=True, check=True).stdout
    assert "  sampling         'crank' turns by 180 deg from sample to sample" in summary
    linkdyn.sheet(scene.inverse(), tmp_path / "sheet.html")
    assert "the sampling is coarse: " in (tmp_path / "sheet.html").read_text()
    assert scene.balance().coarse.startswith("'crank' turns by 180 deg")
