"""`linkdyn draw --at T`: the mechanism where its motion, or its forward run, has it at T."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import linkdyn
import matplotlib
import numpy as np
import pytest
from linkdyn._output import picture
from matplotlib import image, pyplot

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
GREY = 1.5 / 255
"""One step of a colour: two runs differ by rounding."""

FALLS = """
title = "A pendulum that is let go"
space = "planar"
gravity = [0, -9.81]
[[link]]
name = "rod"
markers = { O = [0, 0], P = [1, 0] }
cog = [0.5, 0]
mass = 1.0
inertia = 0.1
[frame]
markers = { O = [0, 0] }
[[joint]]
name = "J"
type = "revolute"
between = ["frame.O", "rod.O"]
[[coordinate]]
joint = "J"
"""


def draw(folder: Path, scene: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-c", "from linkdyn.cli import main; main()", "draw", str(scene), "-o", "at.png", "-q", *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, timeout=120, cwd=folder)


def drawn(folder: Path, scene: Path, instant: float) -> np.ndarray:
    done = draw(folder, scene, "--at", instant)
    assert done.returncode == 0, done.stderr
    return image.imread(folder / "at.png")


def pictured(folder: Path, scene: linkdyn.Scene, q: np.ndarray) -> np.ndarray:
    matplotlib.use("Agg")
    figure, _ = linkdyn.plot.mechanism(scene, q)
    picture(figure, folder / "q.png", (), dpi=150)
    pyplot.close("all")
    return image.imread(folder / "q.png")


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["stopped_rocker", "cart_pole", "stewart_forward"])
def test_forward_runs_are_drawn_at_their_instants(name: str, tmp_path: Path) -> None:
    file = EXAMPLES / name / "scene.toml"
    scene = linkdyn.load(file)
    run = scene.forward(t=[scene.times()[0], 0.7])
    np.testing.assert_allclose(drawn(tmp_path, file, 0.7), pictured(tmp_path, scene, run.q.values[-1]), atol=GREY)
    assert not np.array_equal(drawn(tmp_path, file, 0.7), drawn(tmp_path, file, 0.0))


def test_motions_are_drawn_as_before(tmp_path: Path) -> None:
    file = EXAMPLES / "sixbar_slider" / "scene.toml"
    scene = linkdyn.load(file)
    instant = float(scene.times()[37])
    np.testing.assert_allclose(drawn(tmp_path, file, instant), pictured(tmp_path, scene, scene.motion([instant])[0][0]), atol=GREY)


@pytest.mark.parametrize(("instant", "angle"), [(0.0, 0.0), (0.5, None)])
def test_a_run_without_an_end_is_drawn(instant: float, angle: float | None, tmp_path: Path) -> None:
    file = tmp_path / "falls.toml"
    file.write_text(FALLS)
    scene = linkdyn.load(file)
    q = scene.forward(t=[0.0, 0.5]).q.values[-1] if angle is None else np.array([angle])
    np.testing.assert_allclose(drawn(tmp_path, file, instant), pictured(tmp_path, scene, q), atol=GREY)


def refused(done: subprocess.CompletedProcess[str], words: str) -> None:
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
    assert words in done.stderr


def test_what_is_not_reached_is_refused(tmp_path: Path) -> None:
    refused(draw(tmp_path, EXAMPLES / "stopped_rocker" / "scene.toml", "--at", 4), "expected an instant of the motion, from 0 to 3.5 s, got 4")
    refused(draw(tmp_path, EXAMPLES / "cart_pole" / "scene.toml", "--at", "nan"), "expected seconds, got 'nan'")
    ends = tmp_path / "ends.toml"
    ends.write_text(FALLS + '[[event]]\nname = "low"\nwhen = "angle + 60 deg"\ndo = "stop"\n[measures]\nangle = { joint = "J" }\n')
    refused(draw(tmp_path, ends, "--at", 5), "the run does not come to 5 s: stopped at t = 0.393994 s: event 'low'")
    still = tmp_path / "still.toml"
    still.write_text(FALLS + '[[actuator]]\njoint = "J"\n')
    refused(draw(tmp_path, still, "--at", 5), "nothing moves the scene (expected a motion of a coordinate, or a law of an actuator)")
