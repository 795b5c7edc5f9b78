"""The example that designs with scipy.signal: what it measures is what is there, what it predicts is what happens, what its page shows is printed."""
from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import linkdyn
import numpy as np
import pytest
from scipy import signal

from test_example_pages import is_line

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "swing_arm"


@pytest.fixture(scope="module")
def notch():
    spec = importlib.util.spec_from_file_location("notch", FOLDER / "notch.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["notch"] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def scene():
    return linkdyn.load(FOLDER / "scene.toml")


@pytest.fixture(scope="module")
def plant(notch, scene):
    return notch.identified(*notch.measure(scene.simulator()))


def test_the_measurement_finds_what_is_there(plant):
    """Two inertias on a spring."""
    arm = 0.9 * 0.35**2 * (1 / 12 + 0.45**2) + 0.25 * 0.35**2
    motor = 4.0 * (1e-5 + 100 * 2.6e-5)
    both = 1 / arm + 1 / motor
    resonance = np.sqrt(2 * 180e3 * 0.02546**2 * both)
    assert plant.resonance == pytest.approx(resonance, rel=2e-3)
    assert plant.damping == pytest.approx(0.5 * 2 * 60 * 0.02546**2 * both / resonance, rel=1e-2)
    assert plant.inertia == pytest.approx(arm + motor, rel=5e-3)


@pytest.mark.parametrize(("crossing", "with_notch"), [(3.0, False), (6.0, False), (6.0, True)])
def test_the_closed_loop_is_as_predicted(notch, scene, plant, crossing, with_notch):
    """A small step: the mechanism against the closed loop of transfer functions, whose poles are those that the page tells."""
    opened = notch.loop(plant, notch.controller(plant, crossing, with_notch))
    n = 400
    closed = signal.TransferFunction(opened.num, np.polyadd(opened.num, opened.den), dt=notch.EVERY)
    _, expected = signal.dlsim(closed, np.full(n + 1, 1e-3))
    of = notch.controller(plant, crossing, with_notch)
    run = scene.simulator().run(lambda s: [of(1e-3 - s.q[1])], t_end=n * notch.EVERY, every=notch.EVERY)
    np.testing.assert_allclose(run.q.sel(coordinate="arm"), expected[:, 0], rtol=0, atol=0.03 * np.abs(expected).max())
    assert (notch.slowest_decay(opened) > 0) == (with_notch or crossing < 5)


def test_the_page_shows_what_is_printed(tmp_path):
    done = subprocess.run([sys.executable, str(FOLDER / "notch.py"), "--out", str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    shown = (FOLDER / "README.md").read_text(encoding="utf-8").split("```text\n")[1].split("```")[0]
    lines = shown.splitlines()
    assert len(lines) == len(done.stdout.splitlines()) == 7
    assert all(is_line(*pair) for pair in zip(done.stdout.splitlines(), lines)), done.stdout
    assert (tmp_path / "notch.png").stat().st_size > 10_000
