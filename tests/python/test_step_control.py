"""Steps: narrow peaks are not leapt over, what is too stiff is named, no run goes on for ever."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

import linkdyn
from linkdyn import cli

SCENES = Path(__file__).with_name("scenes")


@pytest.mark.parametrize("method", ["rk8pd", "rkf45", "gbs", "seulex"])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_narrow_peak_is_no_noise(method: str, tolerance: float) -> None:
    """A parallelogram whose follower is longer by a millionth passes change points in milliseconds, with a peak of
    accelerations; 25 digits of the angle after them come from an integration in 40 digits."""
    scene = linkdyn.load(SCENES / "near_parallelogram.toml")
    run = scene.forward(method=method, rtol=tolerance, atol=tolerance)
    if run.attrs["stopped"]:
        assert tolerance < 1e-9 and "digits" in run.attrs["stopped"]
    else:
        # At the peak, a thousand times as fast as the motion, an error grows by as much.
        assert abs(run.q.values[-1, 0] - 6.4781251687566455) < max(1e3 * tolerance, 3e-8)


@pytest.mark.parametrize("method", ["rk8pd", "gbs", "seulex"])
def test_too_stiff_to_come_to_the_end(method: str) -> None:
    """A spring of 1e31 N/m moves its link in femtoseconds: the run ends and says so."""
    command = [cli.executable(), "forward", SCENES / "stiff_spring.toml", "--until", "0.05", "--method", method, "--no-output"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert run.returncode == 3
    assert "spring 'S5' is too stiff" in run.stderr and run.stderr.count("\n") < 4
