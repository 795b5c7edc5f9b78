"""Events and stops that are never reached change nothing of a run, and those that are reached within a long step are found."""

from pathlib import Path

import numpy as np
import pytest

import linkdyn
from integrators import METHODS

EXAMPLES = Path(__file__).parents[2] / "examples"
ONE_STEP = ["rk8pd", "rkf45"]
FAR = {
    "stop": '\n[[stop]]\nname = "far"\njoint = "{joint}"\nmin = "-1000 rad"\nrestitution = 0.5\n',
    "event": '\n[measures]\nbend = {{ joint = "{joint}" }}\n[[event]]\nname = "far"\nwhen = "bend + 1000 rad"\n',
}

# a mass on a spring, whose period is 2 pi s
SWINGING = """
space = "planar"
gravity = [0.0, 0.0]

[frame]
markers = {{ A = [0.0, 0.0] }}

[[link]]
name = "mass"
mass = 1.0
inertia = 1.0
markers = {{ A = [0.0, 0.0] }}

[[joint]]
name = "slide"
type = "prismatic"
between = ["frame.A", "mass.A"]

[[coordinate]]
joint = "slide"
start = {{ position = {start}, velocity = 0.0 }}

[[spring]]
name = "spring"
joint = "slide"
stiffness = 1.0

[measures]
x = {{ joint = "slide" }}

[[event]]
name = "mark"
when = "x - {mark} m"

[time]
end = {end}
"""


@pytest.mark.parametrize("kind", FAR)
@pytest.mark.parametrize("method", ONE_STEP)
@pytest.mark.parametrize(("name", "joint", "t_end"), [("fourbar_start", "J1", 3.0), ("spatial_slider_crank", "A", 1.0)])
def test_what_is_never_reached_changes_no_step(name: str, joint: str, t_end: float, method: str, kind: str) -> None:
    text = (EXAMPLES / name / "scene.toml").read_text(encoding="utf-8")
    t = np.linspace(0.0, t_end, 21)
    alone = linkdyn.Scene(text).forward(t=t, method=method, rtol=1e-8, atol=1e-8)
    watched = linkdyn.Scene(text + FAR[kind].format(joint=joint)).forward(t=t, method=method, rtol=1e-8, atol=1e-8)
    assert watched.attrs["steps"] == alone.attrs["steps"]
    assert watched.attrs["rejected_steps"] == alone.attrs["rejected_steps"]
    assert watched.sizes["event"] == 0
    np.testing.assert_allclose(watched.q, alone.q, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("mark", [0.999, -0.9, 0.2])
def test_every_crossing_of_a_swing_is_found(mark: float, method: str) -> None:
    n_period = 12
    scene = linkdyn.Scene(SWINGING.format(start=1.0, mark=mark, end=2 * np.pi * n_period))
    run = scene.forward(method=method, step=0.1 if method == "rk4" else 1e-3, rtol=1e-7, atol=1e-7)
    first = np.arccos(mark)
    expected = np.sort(np.concatenate([2 * np.pi * np.arange(n_period) + first, 2 * np.pi * np.arange(1, n_period + 1) - first]))
    assert run.sizes["event"] == 2 * n_period
    np.testing.assert_allclose(run.event_time, expected, atol=0.02)


@pytest.mark.parametrize("method", ["gbs", "rk8pd", "seulex"])
def test_a_swing_that_comes_back_within_a_step_is_no_rest(method: str) -> None:
    # the mark lies where the mass never comes but at its far turn, half a period from where steps may begin and end
    scene = linkdyn.Scene(SWINGING.format(start=1.0, mark=-0.9999, end=2 * np.pi * 40))
    run = scene.forward(method=method, step=1.0, rtol=1e-6, atol=1e-6)
    assert run.sizes["event"] == 80
