"""Joint angles that are no coordinates count their turns, however far samples and instants of output lie apart."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkdyn
from linkdyn.cli import executable

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
OK = 0


def crank_rocker() -> dict[str, Any]:
    """Its coupler falls back by a turn against the crank in each of the crank's; the crank goes round from 0.4 rad at 3 rad/s."""
    joints = {"A": "frame.A crank.A", "B": "crank.B rod.B", "C": "rod.C rocker.C", "D": "frame.D rocker.D"}
    links = {"crank": ("A", "B", 0.08), "rod": ("B", "C", 0.28), "rocker": ("D", "C", 0.2)}
    return {
        "space": "planar", "gravity": [0, -9.81], "time": {"end": 20.0, "samples": 2001},
        "frame": {"markers": {"A": [0, 0], "D": [0.3, 0]}},
        "link": [{"name": name, "markers": {a: [0, 0], b: [length, 0]}, "mass": 1.0, "cog": [length / 2, 0], "inertia": 0.01}
                 for name, (a, b, length) in links.items()],
        "joint": [{"name": name, "type": "revolute", "between": between.split()} for name, between in joints.items()],
        "coordinate": [{"joint": "A", "motion": {"law": "constant-rate", "rate": 3.0, "start": 0.4}, "start": {"position": 0.4, "velocity": 3.0}}],
        "actuator": [{"joint": "A", "law": {"type": "constant", "value": 0.0}}],
    }


def geared(ratio: int) -> dict[str, Any]:
    """A wheel on the frame beside the crank, so many times as fast."""
    scene = crank_rocker()
    scene["frame"]["markers"]["W"] = [-0.2, 0]
    scene["link"].append({"name": "wheel", "markers": {"W": [0, 0]}, "mass": 1.0, "inertia": 0.001})
    scene["joint"] += [{"name": "W", "type": "revolute", "between": ["frame.W", "wheel.W"]},
                       {"name": "G", "type": "gear", "between": ["crank.A", "wheel.W"], "teeth": [20 * ratio, 20]}]
    return scene


def angles(data: Any) -> np.ndarray:
    assert np.all(data.status == OK)
    return data.joint_variable.values


@pytest.mark.parametrize("mechanism", [crank_rocker(), geared(1), geared(12)], ids=["coupler", "wheel", "fast wheel"])
@pytest.mark.parametrize("samples", [11, 26, 101])
def test_samples_far_apart(mechanism: dict[str, Any], samples: int) -> None:
    """6, 2.4 and 0.6 rad apart: what is nearest to the sample before is another turn, of the coupler or of a wheel."""
    fine = angles(linkdyn.Scene(mechanism).inverse(want="joint_variable"))
    mechanism = mechanism | {"time": {"end": 20.0, "samples": samples}}
    coarse = angles(linkdyn.Scene(mechanism).inverse(want="joint_variable"))
    assert np.ptp(fine, axis=0).max() > 50, "there are turns"
    np.testing.assert_allclose(coarse, fine[:: 2000 // (samples - 1)], rtol=0, atol=1e-9)


def test_samples_at_rest(tmp_path: Path) -> None:
    """Positions alone tell no rates: angles are followed along the straight way."""

    def found(q: np.ndarray, name: str) -> np.ndarray:
        (tmp_path / name).write_text("time,q J1\n" + "".join(f"{i},{at!r}\n" for i, at in enumerate(q.tolist())))
        output = tmp_path / f"{name}.nc"
        subprocess.run([executable(), "inverse", EXAMPLES / "fourbar" / "scene.toml", "--states", tmp_path / name, "-o", output, "-q"], check=True)
        return angles(linkdyn.read(output))

    fine = 0.5 - 0.02 * np.arange(1501)
    reference = found(fine, "fine.csv")
    assert np.ptp(reference, axis=0).max() > 25, "there are turns"
    np.testing.assert_allclose(found(fine[::125], "coarse.csv"), reference[::125], rtol=0, atol=1e-9)


@pytest.mark.parametrize("method", ["rk8pd", "gbs", "rk4"])
def test_instants_far_apart(method: str) -> None:
    """A forward run's steps tell the turns, whatever instants are asked for; also of a coordinate that starts beyond half a turn."""
    scene = linkdyn.Scene(geared(12))
    settings = {"method": method} | ({"step": 0.01} if method == "rk4" else {"rtol": 1e-10, "atol": 1e-10})
    fine = scene.forward(t=np.linspace(0.0, 6.0, 1201), **settings)
    coarse = scene.forward(t=np.array([0.0, 1.5, 6.0]), **settings)
    assert np.ptp(angles(fine), axis=0).max() > 100, "there are turns"
    np.testing.assert_allclose(angles(coarse), angles(fine)[[0, 300, 1200]], rtol=0, atol=1e-6)


LIFT = linkdyn.load(EXAMPLES / "screw_lift" / "scene.toml")
"""A screw of 55 turns with a ball at its end: steps hold a turn each."""


@pytest.fixture(scope="module")
def lifted() -> Any:
    return LIFT.inverse(t=np.linspace(0.0, 4.0, 4001), want="joint_variable")


@pytest.mark.parametrize("samples", [2, 17, 201, 4001])
@pytest.mark.parametrize("method", ["rk8pd", "rkf45", "gbs", "seulex"])
def test_steps_of_a_turn(lifted: Any, method: str, samples: int) -> None:
    """Angles are followed within steps, too: of a ball on a screw 7 to 44 rad were lost in pitch alone, which never goes round."""
    run = LIFT.forward(t=np.linspace(0.0, 4.0, samples), method=method)
    np.testing.assert_allclose(angles(run), angles(lifted)[:: 4000 // (samples - 1)], rtol=0, atol=1e-4)


@pytest.mark.parametrize("method", ["rk8pd", "gbs", "seulex"])
def test_steps_of_many_turns(method: str) -> None:
    """A crank that turns evenly, on loose tolerances, with a wheel thirty times as fast on it: what turns the fastest says how closely to look."""
    mechanism = geared(30)
    for link in mechanism["link"][1:]:
        link["mass"], link["inertia"] = 1e-6, 1e-8
    mechanism["link"][0]["inertia"] = 10.0
    mechanism["gravity"] = [0, 0]
    run = linkdyn.Scene(mechanism).forward(t=[0.0, 8.0], method=method, rtol=1e-5, atol=1e-5)
    turned = run.q.values[-1, 0] - run.q.values[0, 0]
    assert run.attrs["steps"] < turned / (2 * np.pi) * 30 / 4, "steps hold turns of the wheel"
    start, end = angles(run)
    way = dict(zip(run.variable.values.tolist(), end - start, strict=True))
    assert way["W.angle"] == pytest.approx(-30 * turned, abs=1e-6)
    assert way["B.angle"] == pytest.approx(-turned, abs=np.pi), "the rod falls back by a turn in each of the crank's"
    assert max(abs(way["C.angle"]), abs(way["D.angle"])) < np.pi, "rods and rocker swing"


@pytest.mark.parametrize("method", ["rk8pd", "gbs", "seulex"])
def test_looking_within_changes_no_step(method: str) -> None:
    """Whether joint angles are wanted or not, the run is the same to the last bit."""
    t = np.linspace(0.0, 4.0, 5)
    with_angles, without = (LIFT.forward(t=t, method=method, want=want) for want in ("joint_variable", "driving_force"))
    assert with_angles.attrs["steps"] == without.attrs["steps"]
    np.testing.assert_array_equal(with_angles.q.values, without.q.values)
    np.testing.assert_array_equal(with_angles.qd.values, without.qd.values)


def test_pitch_has_no_turns() -> None:
    """In inverse dynamics with samples far apart neither."""
    run = LIFT.inverse(t=np.linspace(0.0, 4.0, 9), want="joint_variable")
    assert np.abs(run.joint_variable.sel(variable="B.pitch").values).max() < np.pi / 2


def test_a_coordinate_has_its_turns() -> None:
    """Where all joint angles are coordinates nothing is followed; they are what they are."""
    pendulum: dict[str, Any] = {
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"O": [0, 0]}},
        "link": [{"name": "bar", "markers": {"O": [0, 0]}, "mass": 1.0, "cog": [0.5, 0], "inertia": 0.1}],
        "joint": [{"name": "O", "type": "revolute", "between": ["frame.O", "bar.O"]}],
        "coordinate": [{"joint": "O", "start": {"position": 9.0, "velocity": 20.0}}],
    }
    run = linkdyn.Scene(pendulum).forward(t=np.array([0.0, 1.0, 5.0]))
    assert np.ptp(run.q.values) > 50, "there are turns"
    np.testing.assert_allclose(run.joint_variable.values, run.q.values, rtol=0, atol=1e-12)


def folded(rng: np.random.Generator) -> tuple[dict[str, Any], float]:
    """Some crank-rocker and the crank's angle at which its rod lies back over the crank: the hinge between them is at half a turn."""
    scene = crank_rocker()
    crank, rod, rocker, base = (length * rng.uniform(0.95, 1.05) for length in (0.08, 0.28, 0.2, 0.3))
    scene["frame"]["markers"]["D"] = [base, 0]
    for link, (tip, length) in zip(scene["link"], {"B": crank, "C": rod, "C ": rocker}.items(), strict=True):
        link["markers"][tip.strip()] = [length, 0]
    reach = rod - crank
    return scene, np.pi + np.arccos((reach**2 + base**2 - rocker**2) / (2 * reach * base))


def test_half_a_turn_is_told_as_one_up() -> None:
    """Whichever way rounding has it, by whatever road."""
    rng = np.random.default_rng(5)
    for _ in range(30):
        scene, angle = folded(rng)
        coordinate = {"joint": "A", "start": {"position": angle, "velocity": 0.0}, "motion": {"law": "constant-rate", "start": angle, "rate": 0.01}}
        mechanism = linkdyn.Scene(scene | {"coordinate": [coordinate], "time": {"end": 1.0, "samples": 3}})
        on_its_own = mechanism.solve(np.full((9, 1), angle), want="joint_variable")["joint_variable"][:, 1]
        led = mechanism.inverse(want="joint_variable").joint_variable.sel(variable="B.angle").values[0]
        forward = mechanism.forward(want="joint_variable").joint_variable.sel(variable="B.angle").values[0]
        np.testing.assert_allclose([*on_its_own, led, forward], np.pi, rtol=0, atol=1e-12)


def test_half_a_turn_of_a_stage_at_rest() -> None:
    """The sign of a zero decided."""
    stage = linkdyn.load(EXAMPLES / "air_bearing_stage" / "scene.toml")
    led, forward = (run.joint_variable.values[0] for run in (stage.inverse(want="joint_variable"), stage.forward(want="joint_variable")))
    assert np.count_nonzero(np.abs(led - np.pi) < 1e-12) == 4
    np.testing.assert_allclose(forward, led, rtol=0, atol=1e-12)
