"""Counterweights against what textbooks give in closed form, and against the engine's forces with them on."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib

import numpy as np
import pytest
from matplotlib import pyplot
from scipy import optimize

import linkdyn
from linkdyn._commands.balance import told
from machines import engine


def test_half_of_the_piston_balances_the_first_order():
    """A turning weight can take away half of a force that swings along a line: m r = piston mass * crank / 2, opposite the pin."""
    found = engine().balance(["crank"], "harmonics")
    row = found.counterweights.loc["crank"]
    assert row.moment == pytest.approx(0.5 * 0.05 / 2, rel=1e-9) and row.angle == pytest.approx(np.pi, abs=1e-9)
    first = found.figures.loc["harmonic 1"]
    assert first.after == pytest.approx(first.before / np.sqrt(2), rel=1e-9)     # two components of half the size
    second = found.figures.loc["harmonic 2"]
    assert second.after == pytest.approx(second.before, rel=1e-9)


def test_a_run_of_two_turns_has_the_same_harmonics():
    scene = engine(samples=1441)
    twice = scene.with_({"time.end": 2 * 60 / 6000.0})
    one, two = scene.balance(minimise="harmonics"), twice.balance(minimise="harmonics")
    np.testing.assert_allclose(one.moment, two.moment, atol=1e-12)
    np.testing.assert_allclose(scene.balance().moment, twice.balance().moment, atol=1e-10)
    alike = one.figures.index != "rms"      # which counts samples, and of two turns the ends less
    np.testing.assert_allclose(one.figures[alike], two.figures[alike], rtol=1e-6, atol=1e-6 * one.figures.before.max())
    for found in (one, two):
        for column, force in (("before", found.before), ("after", found.after)):
            assert found.figures.loc["rms", column] == pytest.approx(np.sqrt((force**2).sum(axis=1).mean()), rel=1e-12)


@pytest.mark.parametrize("goal", ["rms", "peak", "harmonics"])
def test_a_four_bar_is_balanced_completely(goal):
    """Berkof and Lowen: with m2 at (r2, theta2) on the coupler of length b, crank m1 r1 = m2 r2' a/b and rocker m3 r3 = m2 r2 c/b."""
    a, b, c, d = 0.1, 0.35, 0.25, 0.4
    r2, theta2, m1, m2, m3 = 0.15, 0.3, 1.0, 2.0, 1.5
    scene = linkdyn.Scene({
        "space": "planar",
        "frame": {"markers": {"A": [0, 0], "D": [d, 0]}},
        "link": [
            {"name": "crank", "markers": {"A": [0, 0], "B": [a, 0]}, "mass": m1, "cog": [0.03, 0.01], "inertia": 0.002},
            {"name": "coupler", "markers": {"B": [0, 0], "C": [b, 0]}, "mass": m2, "cog": [r2 * np.cos(theta2), r2 * np.sin(theta2)], "inertia": 0.01},
            {"name": "rocker", "markers": {"D": [0, 0], "C": [c, 0]}, "mass": m3, "cog": [0.1, -0.02], "inertia": 0.01},
        ],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]},
            {"name": "B", "type": "revolute", "between": ["crank.B", "coupler.B"]},
            {"name": "C", "type": "revolute", "between": ["coupler.C", "rocker.C"], "branch": 1},
            {"name": "D", "type": "revolute", "between": ["frame.D", "rocker.D"]},
        ],
        "coordinate": [{"joint": "A", "motion": {"law": "constant-rate", "rate": 40.0, "start": 0.2}}],
        "actuator": [{"joint": "A"}],
        "time": {"end": 2 * np.pi / 40, "samples": 181},
    })
    found = scene.balance(minimise=goal, harmonics=(1, 2, 3))
    coupler = r2 * np.exp(1j * theta2)
    wanted = {"crank": -(m1 * (0.03 + 0.01j) + m2 * a * (b - coupler) / b), "rocker": -(m3 * (0.1 - 0.02j) + m2 * c * coupler / b)}
    for name, moment in wanted.items():
        row = found.counterweights.loc[name]
        assert [row.x, row.y] == pytest.approx([moment.real, moment.imag], abs=1e-9)
    assert found.figures.after.max() < 1e-9 * found.figures.before.max()
    balanced = found.with_counterweights({"crank": 0.05, "rocker": 0.1}).inverse()
    drives = sum(balanced.reaction.sel(joint=name, component=["Fx", "Fy"]).values for name in "AD")
    np.testing.assert_allclose(drives, 0.0, atol=1e-9 * found.figures.before.max())


def test_the_engine_feels_the_counterweights():
    """Reactions at the frame of the scene with the weights on are the force after; nothing of the balance is used for them."""
    scene = linkdyn.new("slider-crank").with_({"gravity": [0.0, 0.0], "load": None})
    found = scene.balance(minimise="peak")
    run = found.with_counterweights({"crank": 0.06}).inverse()
    on_frame = [joint["name"] for joint in scene.description["joints"] if 0 in joint["links"]]
    force = -sum(run.reaction.sel(joint=name, component=["Fx", "Fy"]).values for name in on_frame)
    np.testing.assert_allclose(force, found.after[:, :2], rtol=0, atol=1e-10 * found.figures.before.max())


def carried(motion):
    """A four-bar, the hinge of its crank in the origin, with a payload on its coupler; on a frame that moves."""
    bar = tomllib.loads(linkdyn.new("four-bar").text)
    bar["payload"] = [{"on": "coupler.C", "mass": 0.3}]
    if motion:
        bar["frame"]["motion"] = motion
    return linkdyn.Scene(bar)


@pytest.mark.parametrize("radius", [0.02, 0.3])
@pytest.mark.parametrize("motion", [
    None,
    {"x": {"law": "constant-rate", "rate": 2.0, "start": 0.0}},
    {"yaw": {"law": "constant-rate", "rate": 3.0, "start": 0.1}},
], ids=["at rest", "straight on", "turned about the hinge"])
def test_the_force_after_is_there_whatever_the_radius(motion, radius):
    """Where the frame lets the hinge go straight on, or turns about it, mass times distance is all that counts; by the forces of the scene with the weights on."""
    found = carried(motion).balance(["crank"], "peak")
    with_weights = found.with_counterweights({"crank": radius}).inverse()
    force = with_weights.linkdyn.shaking().force_by_cause.sel(cause="inertia").values
    np.testing.assert_allclose(force, found.after[:, :2], rtol=0, atol=1e-10 * found.figures.before.max())
    assert found.figures.loc["rms", "after"] == pytest.approx(np.sqrt((force**2).sum(axis=1).mean()), rel=1e-9)


@pytest.mark.parametrize(("motion", "links", "named"), [
    ({"y": {"law": "harmonic", "amplitude": 0.1, "frequency": 5.0}}, ["crank"], "hinge of 'crank' by up to 2.5 m/s2"),
    ({"yaw": {"law": "constant-rate", "rate": 3.0, "start": 0.1}}, None, "hinge of 'rocker'"),
], ids=["shaken", "turned about another hinge"])
def test_hinges_that_the_frame_accelerates_are_refused(motion, links, named):
    """There the mass of a counterweight counts too, and with it the radius."""
    with pytest.raises(linkdyn.InputError, match=re.escape(named)):
        carried(motion).balance(links)


def test_the_peak_is_the_least():
    scene = linkdyn.new("slider-crank")
    found = scene.balance(minimise="peak")
    assert found.above_least <= 1e-4
    unit = [scene.balance(minimise=goal) for goal in ("rms", "harmonics")]
    base, effect = found.before, np.stack(
        [(b.after - b.before) for b in unit])       # two directions that a counterweight can push the force in

    def peak(parts):
        return np.linalg.norm(base + np.tensordot(parts, effect, axes=1), axis=1).max()

    best = min(optimize.minimize(peak, start, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-10, "maxiter": 4000}).fun
               for start in ([1.0, 0.0], [0.0, 1.0], [0.5, 0.5]))
    assert found.figures.loc["peak", "after"] <= best * (1 + 1e-4)
    for other in unit:
        assert found.figures.loc["peak", "after"] < other.figures.loc["peak", "after"]


def test_spatial_links_turn_about_any_axis():
    """A rotor's counterweight is its own imbalance turned round: mass times the part of its centre square to the axis."""
    axis, cog = np.array([1.0, 2.0, -2.0]) / 3, np.array([0.1, 0.05, 0.3])
    marker = {"at": [0.02, 0.0, 0.1], "axis": axis}
    scene = linkdyn.Scene({
        "space": "spatial",
        "frame": {"markers": {"A": {"at": [0, 0, 0], "axis": [0.2, -0.3, 1.0]}}},
        "link": [{"name": "rotor", "markers": {"A": marker}, "mass": 2.0, "cog": cog, "inertia": [0.1, 0.2, 0.25, 0.01, 0.02, -0.03]}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "rotor.A"]}],
        "coordinate": [{"joint": "A", "motion": {"law": "constant-rate", "rate": 30.0, "start": 0.0}}],
        "actuator": [{"joint": "A"}],
        "time": {"end": 2 * np.pi / 30, "samples": 73},
    })
    arm = cog - marker["at"]
    for goal in ("rms", "peak", "harmonics"):
        found = scene.balance(minimise=goal)
        np.testing.assert_allclose(found.moment[0], -2.0 * (arm - (arm @ axis) * axis), atol=1e-12)
    run = found.with_counterweights({"rotor": 0.07}).inverse()
    force = run.reaction.sel(joint="A", component=["Fx", "Fy", "Fz"])
    np.testing.assert_allclose(force, 0.0, atol=1e-9 * np.abs(found.before).max())


def test_links_of_a_chain_have_no_weights_of_their_own():
    found = linkdyn.new("delta").balance()
    assert set(found.links) == {"arm1.crank", "arm2.crank", "arm3.crank"} and found.figures.loc["rms", "after"] < found.figures.loc["rms", "before"]
    with pytest.raises(linkdyn.InputError, match="there is no link 'arm1'"):
        found.with_counterweights(dict.fromkeys(found.links, 0.1))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"links": ["couplr"]}, "unknown link"),
        ({"links": ["coupler"]}, "'coupler' does not turn about a hinge of the frame"),
        ({"links": ["crank", "rocker", "crank"]}, "'crank' stands there twice"),
        ({"links": []}, "links: names none .expected one at least of crank, rocker"),
        ({"minimise": "best"}, "unknown goal"),
        ({"minimise": "harmonics", "harmonics": (0,)}, "whole number from 1 on"),
        ({"minimise": "harmonics", "harmonics": (150,)}, "too many for 201 samples"),
        ({"minimise": "harmonics", "harmonics": ()}, "names none"),
    ],
)
def test_refused(options, message):
    with pytest.raises(linkdyn.InputError, match=message):
        linkdyn.new("four-bar").balance(**options)


def test_a_radius_is_wanted():
    found = linkdyn.new("four-bar").balance()
    with pytest.raises(linkdyn.InputError, match="none of 'rocker'"):
        found.with_counterweights({"crank": 0.1})
    with pytest.raises(linkdyn.InputError, match="above zero"):
        found.with_counterweights({"crank": -0.1, "rocker": 0.1})


def test_half_a_cycle_has_no_harmonics():
    scene = linkdyn.new("four-bar")
    half = scene.with_({"time.end": 0.37})
    with pytest.raises(linkdyn.InputError, match="does not end as it begins"):
        half.balance(minimise="harmonics")
    found = half.balance()
    assert list(found.figures.index) == ["peak", "rms"] and "no closed cycle" in told(found)
    whole = scene.balance()
    assert "harmonic 1" in whole.figures.index and "no closed cycle" not in told(whole)


def command(*words, folder):
    return subprocess.run([sys.executable, "-m", "linkdyn", *words], cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.thorough
def test_command(tmp_path):
    (tmp_path / "scene.toml").write_text(engine().text)
    said = command("balance", "scene.toml", "--minimise", "harmonics", "-o", "b.png", folder=tmp_path)
    assert said.returncode == 0, said.stderr
    line = next(line for line in said.stdout.splitlines() if line.startswith("  crank"))
    assert [float(word) for word in line.split()[1:]] == pytest.approx([0.0125, 180.0], rel=1e-5)
    assert (tmp_path / "b.png").read_bytes()[:4] == b"\x89PNG"
    for words, message in (
        (("scene.toml", "--links", "crnk"), "did you mean 'crank'"),
        (("scene.toml", "--harmonics", "1"), "goes with --minimise harmonics"),
        (("scene.toml", "-o", "b.txt"), "ends in .png"),
        (("none.toml",), "none.toml"),
        (("scene.toml", "--wrong"), "--help lists the options"),
    ):
        said = command("balance", *words, folder=tmp_path)
        assert said.returncode == 2 and message in said.stderr and len(said.stderr.splitlines()) == 1, said.stderr


def test_it_tells_itself_in_a_line():
    """All its arrays were written out."""
    balance = linkdyn.new("four-bar").balance(["crank"])
    assert re.fullmatch(r"<linkdyn\.Balance of 'Four-bar linkage': crank [\d.]+ kg m; peak of the force of inertia [\d.]+ N, with them [\d.]+ N>", repr(balance))


def test_picture():
    figure = linkdyn.new("four-bar").balance(["crank"]).plot()
    figure.canvas.draw()
    assert figure.axes[0].get_xlabel() == "Fx on the frame [N]"
    pyplot.close(figure)
