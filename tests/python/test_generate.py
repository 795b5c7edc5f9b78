"""Generated C: compiled with the strictest warnings, it finds what the engine finds, and says so where it cannot."""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_cams import CAMS
from test_redundancy import SPATIAL, three_cranks
from test_space_cams import DRUMS, in_tilted_axes

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
STRICT = ("-std=c99 -Wall -Wextra -Wpedantic -Werror -Wconversion -Wshadow -Wstrict-prototypes -Wmissing-prototypes "
          "-Wdouble-promotion -Wundef -Wcast-qual -Wcast-align -Wwrite-strings -Wformat=2 -Wredundant-decls").split()
OK, NOT_A_NUMBER, OUT_OF_REACH, ALARM, _, NOT_FOLLOWED = range(6)
ROUNDING = 4000 * np.finfo(float).eps
"""Of the largest number: two roads round on their own, and Watt's dyads multiply that by some hundreds where they stretch."""


class Compiled:
    """Generated code as a shared library; its structs are read from its header."""

    def __init__(self, code: linkdyn.GeneratedCode, folder: Path, *options: str) -> None:
        folder.mkdir(exist_ok=True)
        self.header, source = code.write(folder)
        library = folder / f"{code.name}.so"
        subprocess.run(["cc", *STRICT, "-O1", "-fPIC", "-shared", *options, source, "-lm", "-o", library], check=True)
        self.prefix = re.search(r"#define (\w+)_H\n", code.header)[1].lower()
        self.counts = {name: int(n) for name, n in re.findall(r"(\w+_N_\w+) = (\d+)", code.header)}
        self.input, self.output = (self._struct(code.header, which) for which in ("input", "output"))
        self.state = self._struct(code.header, "state") if "_assembly;" in code.header else None
        self.library = ctypes.CDLL(str(library))
        self.call = getattr(self.library, f"{self.prefix}_evaluate")

    def _struct(self, header: str, which: str) -> np.dtype:
        body = re.search(rf"struct \w+_{which} {{\n(.*?)}};", header, re.S)[1]
        return np.dtype([
            (name, float, tuple(int(self.counts.get(size, size)) for size in re.findall(r"\[(\w+)\]", sizes)))
            for name, sizes in re.findall(r"double (\w+)((?:\[\w+\])+);", body)
        ])

    def start(self) -> np.ndarray:
        """The struct with the scene's start."""
        return self._constant("start", self.input)

    def assembly(self) -> np.ndarray:
        """And that of where links are that are placed by iteration."""
        return self._constant("assembly", self.state)

    def _constant(self, name: str, struct: np.dtype) -> np.ndarray:
        return np.frombuffer((ctypes.c_char * struct.itemsize).in_dll(self.library, f"{self.prefix}_{name}"), struct).copy()

    def __call__(self, *, state: np.ndarray | None = None, output: np.ndarray | None = None, **numbers: np.ndarray) -> tuple[int, np.void]:
        given = self.start()
        for name, values in numbers.items():
            given[name] = values
        found = np.full(1, np.nan, self.output) if output is None else output
        structs = [given, found] if self.state is None else [given, self.assembly() if state is None else state, found]
        status = self.call(*(struct.ctypes.data_as(ctypes.c_void_p) for struct in structs))
        return status, found[0]


def load(name: str) -> linkdyn.Scene:
    return linkdyn.load(EXAMPLES / name if name.endswith(".toml") else EXAMPLES / name / "scene.toml")


def samples(scene: linkdyn.Scene, n: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Instants of the scene's motion, moved a little, with rates and accelerations of their own."""
    random = np.random.default_rng(2)
    time = scene.description["time"]
    q, _, _ = scene.motion(random.uniform(time["first"], max(time["last"], time["first"] + 1.0), n))
    return q + 0.01 * random.normal(size=q.shape), random.normal(size=q.shape), random.normal(size=q.shape)


def assert_alike(found: np.ndarray, expected: np.ndarray) -> None:
    assert np.abs(found - expected).max() <= ROUNDING * np.abs(expected).max()


ARM = {
    "title": "An arm: turret, boom, telescope",
    "space": "spatial",
    "gravity": [0.0, 0.0, -9.81],
    "frame": {"markers": {"base": {"at": [0.0, 0.0, 0.0], "axis": [0.0, 0.0, 1.0], "x": [1.0, 0.0, 0.0]}}},
    "link": [
        {"name": "turret", "mass": 40.0, "cog": [0.1, 0.0, 0.4], "inertia": {"diagonal": [2.0, 2.5, 3.0]}, "markers": {
            "foot": {"at": [0.0, 0.0, 0.0], "axis": [0.0, 0.0, 1.0], "x": [1.0, 0.0, 0.0]},
            "top": {"at": [0.2, 0.0, 0.9], "axis": [0.0, -1.0, 0.0], "x": [1.0, 0.0, 0.0]}}},
        {"name": "boom", "mass": 25.0, "cog": [0.6, 0.0, 0.05], "inertia": {"diagonal": [0.4, 3.0, 3.1]}, "markers": {
            "root": {"at": [0.0, 0.0, 0.0], "axis": [0.0, -1.0, 0.0], "x": [1.0, 0.0, 0.0]},
            "rail": {"at": [0.3, 0.0, 0.1], "axis": [1.0, 0.0, 0.0], "x": [0.0, 1.0, 0.0]}}},
        {"name": "pole", "mass": 8.0, "cog": [0.5, 0.0, 0.0], "inertia": {"diagonal": [0.1, 0.9, 0.9]}, "markers": {
            "rail": {"at": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0], "x": [0.0, 1.0, 0.0]}, "hand": [1.2, 0.1, 0.0]}},
    ],
    "joint": [
        {"name": "slew", "type": "revolute", "between": ["frame.base", "turret.foot"]},
        {"name": "lift", "type": "revolute", "between": ["turret.top", "boom.root"]},
        {"name": "reach", "type": "prismatic", "between": ["boom.rail", "pole.rail"]},
    ],
    "coordinate": [
        {"joint": "slew", "motion": {"law": "harmonic", "mean": 0.3, "amplitude": 0.8, "frequency": "2 rad/s"}},
        {"joint": "lift", "motion": {"law": "harmonic", "mean": 0.5, "amplitude": 0.3, "frequency": "3 rad/s"}},
        {"joint": "reach", "motion": {"law": "harmonic", "mean": 0.8, "amplitude": 0.2, "frequency": "4 rad/s"}},
    ],
    "actuator": [{"joint": "slew"}, {"joint": "lift"}, {"joint": "reach"}],
    "load": [{"on": "pole.hand", "force": [10.0, 0.0, -50.0], "moment": [0.0, 3.0, 0.0]}],
    "time": {"end": 3.0, "samples": 31},
}


STRUT = {
    "title": "A lever on a telescope, drawn as it stands: links' axes are not along it, loads are in them",
    "space": "spatial",
    "gravity": [0.0, 0.0, -9.81],
    "frame": {"markers": {"pin": {"at": [1.0, 0.0, 0.2], "axis": [0.2, 1.0, 0.1]}, "foot": {"at": [0.4, -0.1, 0.9], "axis": [0.0, 1.0, 0.0]}}},
    "link": [
        {"name": "lever", "mass": 2.0, "cog": [0.1, 0.0, 0.0], "inertia": {"diagonal": [0.02, 0.03, 0.025]}, "start": {"position": [1.0, 0.0, 0.2]},
         "markers": {"pin": {"at": [0.0, 0.0, 0.0], "axis": [0.2, 1.0, 0.1]}, "eye": [-0.3, 0.1, 0.3]}},
        {"name": "barrel", "mass": 1.2, "cog": [0.1, 0.02, -0.1], "inertia": {"diagonal": [0.01, 0.012, 0.008]}, "start": {"position": [0.4, -0.1, 0.9]},
         "markers": {"foot": {"at": [0.0, 0.0, 0.0], "axis": [0.8, 0.0, 0.6]}, "bore": {"at": [0.0, 0.0, 0.0], "axis": [0.3, 0.2, -0.4], "x": [4.0, 0.0, 3.0]}, "side": [0.1, 0.2, 0.0]}},
        {"name": "rod", "mass": 0.7, "cog": [-0.05, 0.0, 0.1], "inertia": {"diagonal": [0.006, 0.007, 0.005]}, "start": {"position": [0.7, 0.1, 0.5]},
         "markers": {"bore": {"at": [0.0, 0.0, 0.0], "axis": [0.3, 0.2, -0.4], "x": [4.0, 0.0, 3.0]}, "eye": [0.0, 0.0, 0.0], "side": [0.0, 0.1, 0.1]}},
    ],
    "joint": [
        {"name": "pin", "type": "revolute", "between": ["frame.pin", "lever.pin"]},
        {"name": "foot", "type": "universal", "between": ["frame.foot", "barrel.foot"]},
        {"name": "bore", "type": "prismatic", "between": ["barrel.bore", "rod.bore"]},
        {"name": "eye", "type": "spherical", "between": ["rod.eye", "lever.eye"]},
    ],
    "coordinate": [{"joint": "pin", "motion": {"law": "harmonic", "amplitude": 0.2, "frequency": "3 rad/s"}}],
    "actuator": [{"joint": "bore"}],
    "load": [{"on": "barrel.side", "axes": "link", "force": [30.0, -20.0, 10.0], "moment": [4.0, -3.0, 2.0]},
             {"on": "rod.side", "axes": "link", "force": [-15.0, 25.0, 8.0], "moment": [1.0, 2.0, -5.0]}],
    "time": {"end": 2.0, "samples": 31},
}


def scene_of(name: str) -> linkdyn.Scene:
    if name == "strut":
        return linkdyn.Scene(STRUT)
    return linkdyn.Scene(ARM) if name == "arm" else load(name)


INVERSE = ["stewart_tsai", "stewart_drilling", "fourbar", "watt_i", "stephenson_iii", "sixbar_slider/scene_inclined.toml", "andrews",
           "rcsp_start", "fivebar_parallel", "arm", "air_bearing_stage", "../tests/scenes/screw_and_weld.toml", "planetary_gearbox", "hoist", "strut",
           "../tests/scenes/excavator.toml", "../tests/scenes/boom_by_stroke.toml"]


@pytest.mark.accuracy
@pytest.mark.parametrize("name", INVERSE)
def test_inverse(name: str, tmp_path: Path) -> None:
    """Forces at random samples, with loads of their own; what has no solution has none for both."""
    scene = scene_of(name)
    compiled = Compiled(scene.generate(want="all", name="kernel"), tmp_path)
    q, qd, qdd = samples(scene)
    axes = {load["name"]: load["axes"] for load in scene.description["loads"]}
    random = np.random.default_rng(3)
    wrench = {load: random.normal(size=(len(q), 3 if scene.planar else 6)) for load in scene.loads if axes[load] == "world"}
    expected = scene.solve(q, qd, qdd, wrench=wrench, want=["driving_force", "reaction", "joint_variable"])
    n_lost = 0
    for i in range(len(q)):
        given = dict(q=q[i], qd=qd[i], qdd=qdd[i])
        if scene.loads:
            given["load"] = compiled.start()["load"][0] + np.array([wrench[load][i] if load in wrench else np.zeros(3 if scene.planar else 6) for load in scene.loads])
        status, found = compiled(**given)
        if status != OK:
            n_lost += expected["status"][i] == 0
            continue
        assert expected["status"][i] == 0
        for result in ("driving_force", "reaction", "joint_rate"):
            assert_alike(found[result], expected[result][i])
        apart = found["joint_variable"] - expected["joint_variable"][i]
        is_angle = [not label.endswith("slide") for label in compiled_labels(compiled, "variable")]
        assert_alike(np.where(is_angle, np.exp(1j * apart), 1 + apart), np.ones(len(apart)))
    assert n_lost <= 2      # alarms at which the engine goes on with pivots of its own
    assert (expected["status"] == 0).any()


def compiled_labels(compiled: Compiled, kind: str) -> list[str]:
    """What the comments of an enum call its values."""
    body = re.search(rf"enum \w+_{kind} {{\n(.*?)}};", compiled.header.read_text(), re.S)[1]
    return [label.split(" [")[0] for label in re.findall(r"/\* (.*?) \*/", body)]


@pytest.mark.accuracy
@pytest.mark.parametrize("name", ["stewart_tsai", "fourbar", "rcsp_start", "andrews", "arm", "air_bearing_stage", "planetary_gearbox",
                                  "../tests/scenes/screw_and_weld.toml", "strut"])
def test_forward_undoes_inverse(name: str, tmp_path: Path) -> None:
    """Accelerations by driving forces are those for which inverse dynamics, another elimination, asks for these forces."""
    scene = scene_of(name)
    compiled = Compiled(scene.generate("forward", want=["reaction", "joint_variable"], name="kernel"), tmp_path)
    q, qd, _ = samples(scene, 20)
    force = np.random.default_rng(4).normal(size=(len(q), len(scene.actuators)))
    n_alarm = 0
    for i in range(len(q)):
        status, found = compiled(q=q[i], qd=qd[i], driving_force=force[i])
        if status != OK:
            n_alarm += 1
            continue
        back = scene.solve(q[i : i + 1], qd[i : i + 1], [found["qdd"]], want=["driving_force", "reaction"])
        largest = np.abs(back["reaction"]).max()
        assert np.abs(back["driving_force"] - force[i]).max() <= ROUNDING * max(largest, np.abs(force).max())
        assert_alike(found["reaction"], back["reaction"][0])
    assert n_alarm <= 5


@pytest.mark.accuracy
def test_ball_at_its_pole(tmp_path: Path) -> None:
    """Angles of a ball joint tell its attitude at a pitch of 90 degrees, too: there roll and yaw alone are not certain, both together are."""
    at = {"at": [-0.3, 0.1, 0.3], "axis": [1.0, 0.0, 0.0], "x": [0.0, 1.0, 2.0]}
    scene = linkdyn.Scene({**STRUT, "link": [{**link, "markers": {**link["markers"], "eye": at}} if link["name"] == "lever" else link for link in STRUT["link"]]})
    compiled = Compiled(scene.generate(want="all", name="kernel"), tmp_path)
    ball = [label.startswith("eye.") for label in compiled_labels(compiled, "variable")]
    for q in np.linspace(-1e-15, 1e-15, 7):
        status, found = compiled(q=[q], qd=[0.0], qdd=[0.0])
        assert status == OK
        turn = scene.poses([[q]]).rotation[0]
        x = np.array([0.0, 1.0, 2.0]) / np.sqrt(5.0)
        marker = np.column_stack([x, np.cross([1.0, 0.0, 0.0], x), [1.0, 0.0, 0.0]])
        record, lanes = (scene.solve([[q]], [[0.0]], [[0.0]], want="joint_variable", solver=solver)["joint_variable"][0]
                         for solver in ("elimination", "gauss-jordan"))
        for told in (found["joint_variable"], record, lanes):
            np.testing.assert_allclose(Rotation.from_euler("XYZ", told[ball]).as_matrix(), turn[2].T @ turn[0] @ marker, atol=1e-13)


@pytest.mark.accuracy
@pytest.mark.parametrize("name", ["flyball_governor", "n_fourbar", "fivebar_motors", "fourbar_constant_torque", "stewart_forward",
                                  "sixbar_slider/scene_inclined.toml", "../tests/scenes/ball_joint.toml"])
def test_forward_by_laws(name: str, tmp_path: Path) -> None:
    """Springs, motors, torques and bodies turned in space: accelerations where a run of the engine starts."""
    scene = load(name)
    compiled = Compiled(scene.generate("forward", name="kernel"), tmp_path)
    run = scene.forward(t_end=1e-3, want="driving_force")
    given = dict(q=run.q[0], qd=run.qd[0])
    if "driving_force" in compiled.input.names:
        given["driving_force"] = run.driving_force[0]
    status, found = compiled(**given)
    assert status == OK
    # Some begin in balance: what is left there is rounding of accelerations of about one.
    assert np.abs(found["qdd"] - run.qdd.values[0]).max() <= ROUNDING * max(1.0, np.abs(run.qdd.values[0]).max())


@pytest.mark.accuracy
@pytest.mark.parametrize("name", ["stewart_tsai", "watt_i", "rcsp_start", "arm", "../tests/scenes/ball_joint.toml"])
def test_kinematics(name: str, tmp_path: Path) -> None:
    """Places are those that the engine draws; velocities are their differences."""
    scene = scene_of(name)
    compiled = Compiled(scene.generate("kinematics", name="kernel"), tmp_path)
    q = np.tile(compiled.start()["q"], (8, 1)) + 0.02 * np.random.default_rng(5).normal(size=(8, len(scene.coordinates)))
    qd = np.random.default_rng(6).normal(size=q.shape)
    poses, step = scene.poses(q), 1e-6
    for i in range(len(q)):
        status, found = compiled(q=q[i], qd=qd[i])
        assert status == OK
        np.testing.assert_allclose(found["position"], poses.position[i], rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(found["rotation"], poses.rotation[i], rtol=0, atol=ROUNDING)
        (_, after), (_, before) = (compiled(q=q[i] + sign * step * qd[i], qd=qd[i]) for sign in (1, -1))
        velocity = (after["position"] - before["position"]) / (2 * step)
        spin = (after["rotation"] - before["rotation"]) / (2 * step) @ np.swapaxes(found["rotation"], 1, 2)
        omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
        np.testing.assert_allclose(found["velocity"], velocity, atol=1e-7)
        np.testing.assert_allclose(found["angular_velocity"], omega, atol=1e-7)


# ------------------------------------------------------------------------------------------------ loops closed by iteration
@pytest.mark.thorough
@pytest.mark.accuracy
@pytest.mark.parametrize("name", ["hexaglide", "rsur", "scissor_by_stroke", "screw_loop", "fivebar_by_gears", "fivebar_by_gears_3d",
                                  "wheel_by_coupler", "../../examples/tripod/scene", "../../examples/agile_eye/scene"])
def test_iteration_along_a_motion(name: str, tmp_path: Path) -> None:
    """Platforms on slides, spatial four-bars, loops closed by gears, three legs more than needed: from call to call in steps of a controller, all forces as the engine's."""
    scene = load(f"../tests/scenes/{name}.toml")
    compiled = Compiled(scene.generate(want="all", name="kernel"), tmp_path)
    time = scene.description["time"]
    t = np.linspace(time["first"], time["last"], 301)
    run = scene.inverse(t=t)
    loads = scene.load_values(t)[:, :, [0, 1, 5] if scene.planar else slice(None)]
    state, start = compiled.assembly(), compiled.start()["q"][0]
    for way in np.linspace(0.0, 1.0, 50):
        assert compiled(state=state, q=start + way * (run.q.values[0] - start))[0] == OK
    for i in range(len(t)):
        given = dict(q=run.q[i], qd=run.qd[i], qdd=run.qdd[i])
        if scene.loads:
            given["load"] = loads[i]
        status, found = compiled(state=state, **given)
        assert (status, int(run.status[i])) == (OK, 0)
        # a driving force that happens to vanish has the rounding of the reactions
        for results in (("driving_force", "reaction"), ("reaction",), ("joint_rate",)):
            assert_alike(*(np.concatenate([np.ravel(of[result]) for result in results]) for of in (found, run.isel(sample=i))))


CODED = {**{f"plane: {name}": cam for name, cam in CAMS.items()}, **{f"drum: {name}": drum for name, drum in DRUMS.items()},
         "tilted face": in_tilted_axes(CAMS["face, slides"])}


@pytest.mark.accuracy
@pytest.mark.parametrize("name", ["plane: roller, turns", "plane: face, slides", "drum: turns", "tilted face",
                                  *(pytest.param(name, marks=pytest.mark.thorough) for name in CODED)])
def test_cams(name: str, tmp_path: Path) -> None:
    """Where a follower touches is looked up in the outline by the code's own bounded search; each cam's table is there once."""
    scene = linkdyn.Scene(CODED[name])
    code = scene.generate(want="all", name="kernel")
    assert code.source.count("static const struct curve") == (2 if "drum" in name else 1)
    compiled = Compiled(code, tmp_path)
    time = scene.description["time"]
    run = scene.inverse(t=np.linspace(time["first"], time["last"], 1001))
    assert not run.status.values.any()
    q, qd, qdd = run.q.values, run.qd.values, run.qdd.values
    state, start = compiled.assembly(), compiled.start()["q"][0]
    for way in np.linspace(0.0, 1.0, 50):
        assert compiled(state=state, q=start + way * (q[0] - start))[0] == OK
    for i in range(len(q)):
        status, found = compiled(state=state, q=q[i], qd=qd[i], qdd=qdd[i])
        assert status == OK
        for result in ("driving_force", "reaction", "joint_rate"):
            assert np.abs(found[result] - run[result].values[i]).max() <= ROUNDING * np.abs(run[result].values).max()


@pytest.mark.accuracy
def test_cams_forward(tmp_path: Path) -> None:
    """Accelerations of a cam shaft under its torque: those for which inverse dynamics asks for this torque."""
    scene = linkdyn.Scene(CAMS["roller, slides"])
    compiled = Compiled(scene.generate("forward", name="kernel"), tmp_path)
    run = scene.inverse()
    state, start = compiled.assembly(), compiled.start()["q"][0]
    for way in np.linspace(0.0, 1.0, 50):
        assert compiled(state=state, q=start + way * (run.q.values[0] - start))[0] == OK
    for i in range(len(run.time)):
        status, found = compiled(state=state, q=run.q.values[i], qd=run.qd.values[i], driving_force=run.driving_force.values[i])
        assert status == OK
        np.testing.assert_allclose(found["qdd"], run.qdd.values[i], rtol=0, atol=1e-10 * np.abs(run.qdd.values).max())


@pytest.mark.accuracy
def test_iteration_forward(tmp_path: Path) -> None:
    """Accelerations, and poses with velocities, of a loop that no closed form closes."""
    content = tomllib.loads((EXAMPLES / "spatial_slider_crank" / "scene.toml").read_text())
    content["link"][1]["markers"]["C"]["axis"] = [0.1, 1.0, 0.0]     # not square to the rod
    scene = linkdyn.Scene(content)
    run = scene.forward(t_end=0.5)
    ahead = Compiled(scene.generate("forward", name="ahead"), tmp_path)
    poses = Compiled(scene.generate("kinematics", name="poses"), tmp_path)
    state, places = ahead.assembly(), poses.assembly()
    for i in range(len(run.time)):
        status, found = ahead(state=state, q=run.q[i], qd=run.qd[i])
        assert status == OK
        assert np.abs(found["qdd"] - run.qdd.values[i]).max() <= 1e-9 * max(1.0, np.abs(run.qdd.values).max())
        status, found = poses(state=places, q=run.q[i], qd=run.qd[i])
        assert status == OK
        np.testing.assert_allclose(found["joint_rate"], run.joint_rate.values[i], atol=1e-9 * np.abs(run.joint_rate.values).max())


@pytest.mark.parametrize("kernel", ["inverse", "kinematics"])
def test_groups_led_by_placed_links_alone(kernel: str, tmp_path: Path) -> None:
    """The third leg of a Tripteron hangs on its platform, which others place: its step takes nothing of what the caller gives."""
    compiled = Compiled(load("tripteron").generate(kernel, name="kernel"), tmp_path)
    assert compiled(q=compiled.start()["q"][0] + 0.01)[0] == OK


def test_iteration_from_too_far(tmp_path: Path) -> None:
    """A step through which the assembly cannot be followed is refused, whatever closes at its end; places stay, and smaller steps lead on."""
    scene = load("../tests/scenes/rsur.toml")
    compiled = Compiled(scene.generate(name="kernel"), tmp_path)
    state, start = compiled.assembly(), compiled.start()["q"]
    assert compiled(state=state, q=start)[0] == OK
    kept, far = state.copy(), start + 1.0
    output = np.full(1, 7.0, compiled.output)
    assert compiled(state=state, output=output, q=far)[0] == NOT_FOLLOWED
    assert state == kept
    assert output["driving_force"] == 7.0
    assert [compiled(state=state, q=start + way * (far - start))[0] for way in np.linspace(0.0, 1.0, 100)] == [OK] * 100
    for way in np.linspace(0.3, 6.3, 21):      # at -3 rad Newton's method would close it, beyond a gap in which nothing closes
        assert compiled(state=kept.copy(), q=start - way)[0] == NOT_FOLLOWED
    spoilt = state.copy()
    spoilt["place"][0, 0, 3] = np.nan
    assert compiled(state=spoilt, q=far)[0] == NOT_A_NUMBER


def test_iteration_ends_with_the_assembly(tmp_path: Path) -> None:
    """A platform led out of reach by its cranks: an alarm or no way on, where the engine's assembly ends; never other numbers."""
    scene = load("../tests/scenes/planar_platform.toml")
    compiled = Compiled(scene.generate(want="all", name="kernel"), tmp_path)
    run = scene.inverse(t=np.linspace(0.0, 1.0, 1001))
    end = int(np.argmax(run.status.values != 0))
    state = compiled.assembly()
    outcomes = []
    for i in range(end + 20):
        status, found = compiled(state=state, q=run.q[i], qd=run.qd[i], qdd=run.qdd[i])
        outcomes.append(status)
        if status == OK:
            assert np.abs(found["reaction"] - run.reaction.values[i]).max() <= 1e-6 * np.abs(run.reaction.values[i]).max()
    assert outcomes[: end - 2] == [OK] * (end - 2)
    assert OK not in outcomes[end:]


def test_long_code_is_cut(tmp_path: Path) -> None:
    """Functions of 2,000 statements at most, which hand on what the next ones need."""
    code = load("stewart_workspace").generate("forward", want="all", name="kernel")
    bodies = re.findall(r"^static void compute_\d\(.*?^}", code.source, re.S | re.M)
    assert len(bodies) > 1
    assert all(len(re.findall(r"const double t\d+ = ", body)) <= 2000 for body in bodies)
    assert "w[" in bodies[1]
    Compiled(code, tmp_path)


@pytest.mark.accuracy
def test_no_fused_products(tmp_path: Path) -> None:
    """Rounded once or twice: the same numbers but for rounding."""
    scene = load("stewart_tsai")
    found = []
    for fma in (0, 1):
        compiled = Compiled(scene.generate(name="kernel"), tmp_path / str(fma), f"-DKERNEL_FMA={fma}")
        found.append(compiled(qd=0.5, qdd=-0.7)[1]["driving_force"])
    assert_alike(*found)
    assert np.any(found[0] != found[1])


# ------------------------------------------------------------------------------------------------ where there is no answer
def four_bar(ground: float) -> linkdyn.Scene:
    """Crank 1 m, coupler 2 m, rocker 2 m."""
    bar = {"mass": 1.0, "inertia": 0.1}
    return linkdyn.Scene({
        "space": "planar", "gravity": [0.0, -9.81],
        "frame": {"markers": {"A": [0.0, 0.0], "D": [ground, 0.0]}},
        "link": [{"name": "crank", **bar, "cog": [0.5, 0.0], "markers": {"A": [0.0, 0.0], "B": [1.0, 0.0]}},
                 {"name": "coupler", **bar, "cog": [1.0, 0.0], "markers": {"B": [0.0, 0.0], "C": [2.0, 0.0]}},
                 {"name": "rocker", **bar, "cog": [1.0, 0.0], "markers": {"D": [0.0, 0.0], "C": [2.0, 0.0]}}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]},
                  {"name": "B", "type": "revolute", "between": ["crank.B", "coupler.B"]},
                  {"name": "C", "type": "revolute", "between": ["coupler.C", "rocker.C"], "branch": 1},
                  {"name": "D", "type": "revolute", "between": ["frame.D", "rocker.D"]}],
        "coordinate": [{"joint": "A", "start": {"position": 1.0}}],
        "actuator": [{"joint": "A"}],
    })


def test_alarm_near_a_dead_point(tmp_path: Path) -> None:
    """The dyad of 2 m and 2 m is stretched where B is 4 m from D: beyond it nothing closes, close to it digits are lost."""
    scene = four_bar(ground=4.5)
    compiled = Compiled(scene.generate(want="all", name="kernel"), tmp_path)
    stretched = np.arccos((4.5**2 + 1.0 - 16.0) / (2 * 4.5))
    seen = {}
    for before in (1e-1, 1e-2, 1e-3, 1e-6, 1e-9, 1e-12, 0.0, -1e-9, -1e-2):
        output = np.full(1, 7.0, compiled.output)
        status, found = compiled(q=stretched - before, qd=1.0, qdd=0.5, output=output)
        seen[before] = status
        expected = scene.solve([[stretched - before]], [[1.0]], [[0.5]], want="all")
        if status == OK:
            assert np.abs(found["reaction"] - expected["reaction"][0]).max() <= 1e-3 * np.abs(expected["reaction"]).max()
        else:
            assert all((output[name] == 7.0).all() for name in output.dtype.names)     # nothing is handed out
    assert seen[1e-1] == seen[1e-2] == OK
    assert seen[1e-12] in (OUT_OF_REACH, ALARM)
    assert seen[0.0] in (OUT_OF_REACH, ALARM)
    assert seen[-1e-9] == seen[-1e-2] == OUT_OF_REACH


def test_alarm_near_a_singular_platform(tmp_path: Path) -> None:
    """With all joints in one plane the legs cannot carry the platform's weight: no forces without bound are handed out."""
    compiled = Compiled(load("stewart_tsai").generate(name="kernel"), tmp_path)
    q = compiled.start()["q"][0]
    outcome = {}
    for height in (0.5, 0.1, 1e-3, 1e-6, 1e-9, 0.0):
        q[2] = 0.4 + height
        outcome[height], _ = compiled(q=q)
    assert outcome[0.5] == outcome[0.1] == OK
    assert outcome[1e-6] == outcome[1e-9] == outcome[0.0] == ALARM


def stephenson_ii(size: float) -> dict[str, Any]:
    """Led at a joint between two of its moving links."""
    at = {"A": (0, 0), "D": (0.5, 0), "B": (0.1, 0.25), "C": (0.45, 0.35), "G": (0.25, 0.55), "F": (0.75, 0.6), "E": (0.8, 0.2)}
    links = {"frame": "AD", "l2": "AB", "l3": "BCG", "l4": "CF", "l5": "GE", "l6": "FED"}
    points = {name: size * np.array(point) for name, point in at.items()}
    scene: dict[str, Any] = {"space": "planar", "gravity": [0.3, -9.81], "link": [], "joint": []}
    for name, of in links.items():
        markers = {point: (points[point] - points[of[0]]).tolist() for point in of}
        if name == "frame":
            scene["frame"] = {"markers": {point: points[point].tolist() for point in of}}
        else:
            cog = np.mean(list(markers.values()), axis=0).tolist()
            scene["link"].append({"name": name, "mass": 2.0, "cog": cog, "inertia": 0.04 * size**2, "markers": markers, "start": {"position": points[of[0]].tolist()}})
    for point in "ABCGFED":
        first, second = (name for name, of in links.items() if point in of)
        scene["joint"].append({"name": point, "type": "revolute", "between": [f"{first}.{point}", f"{second}.{point}"]})
    return scene | {"coordinate": [{"joint": "G"}], "actuator": [{"joint": "G"}]}


@pytest.mark.parametrize("size", [3.0, 1.0, 0.5, 0.1, 0.01])
def test_size_does_not_decide_about_a_record(size: float) -> None:
    """Driving forces are solved for last where nothing else is wanted; in N m against forces in N these were no pivots then."""
    assert "driving_force" in linkdyn.Scene(stephenson_ii(size)).generate(want=["driving_force"]).header


@pytest.mark.parametrize("make", [SPATIAL["bennett"], SPATIAL["spherical"], three_cranks], ids=["bennett", "spherical", "cranks"])
def test_shared_reactions_at_rest(make: Callable[[], dict[str, Any]], tmp_path: Path) -> None:
    """How the sides of joints part there is the rounding of weights, and no reason for an alarm."""
    scene = linkdyn.Scene(make())
    compiled = Compiled(scene.generate(want=["driving_force", "reaction"], name="kernel"), tmp_path)
    q = scene.motion([0.0])[0] + np.outer(np.linspace(0.0, 0.3, 40), np.linspace(1.0, 0.7, len(scene.coordinates)))
    expected = scene.inverse(q=q, in_order=True, want=["driving_force", "reaction"])
    assert (expected["status"] == 0).all()
    state = None if compiled.state is None else compiled.assembly()
    for i in range(len(q)):
        status, found = compiled(state=state, q=q[i], qd=0 * q[i], qdd=0 * q[i])
        assert status == OK
        assert_alike(found["reaction"], expected["reaction"].values[i])


def test_what_is_no_number(tmp_path: Path) -> None:
    compiled = Compiled(load("fourbar").generate(name="kernel"), tmp_path)
    for name in compiled.input.names:
        for value in (np.nan, np.inf):
            assert compiled(**{name: value})[0] == NOT_A_NUMBER
    assert compiled(qd=1e200)[0] not in (OK, NOT_A_NUMBER)


# ------------------------------------------------------------------------------------------------ the text
def test_same_text_every_time() -> None:
    """In one process and in another, with other lanes and other instructions."""
    scene = load("rcsp_start")
    code = scene.generate(want="all", name="kernel")
    assert code == scene.generate(want="all", name="kernel")
    program = ("import linkdyn, sys\n"
               f"code = linkdyn.load({str(EXAMPLES / 'rcsp_start' / 'scene.toml')!r}).generate(want='all', name='kernel')\n"
               "sys.stdout.write(code.header + code.source)")
    for machine in ("plain", "avx2"):
        said = subprocess.run([sys.executable, "-c", program], env={**os.environ, "LINKDYN_MACHINE": machine},
                              capture_output=True, text=True, check=True).stdout
        assert said == code.header + code.source


def test_command_writes_the_same(tmp_path: Path) -> None:
    scene = EXAMPLES / "fourbar" / "scene.toml"
    done = subprocess.run([linkdyn_command(), "generate", scene, "--lang", "c", "--kernel", "inverse", "--want", "driving_force,reaction",
                           "-o", tmp_path / "bar"], capture_output=True, text=True, check=True)
    code = linkdyn.load(scene).generate("inverse", ["driving_force", "reaction"], "bar")
    assert (tmp_path / "bar.h").read_text() == code.header
    assert (tmp_path / "bar.c").read_text() == code.source
    assert "bar.h" in done.stdout
    assert "bar.c" in done.stdout


def linkdyn_command() -> Path:
    from linkdyn.cli import executable

    return executable()


def test_default_files(tmp_path: Path) -> None:
    scene = EXAMPLES / "fourbar" / "scene.toml"
    subprocess.run([linkdyn_command(), "generate", scene, "-q", "--kernel=kinematics"], cwd=tmp_path, check=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fourbar_kinematics.c", "fourbar_kinematics.h"]


def test_odd_names(tmp_path: Path) -> None:
    """Whatever a scene calls its parts, the code compiles, and parts whose names differ only in what C does not allow stay apart."""
    names = {"A": "a-1", "B": "a_1", "C": "*/int/*", "D": "Gelenk-\u00e4??/"}
    text = four_bar(ground=3.0).text
    for old, new in names.items():
        text = re.sub(rf'name = "{old}"', f'name = "{new}"', text)
        text = re.sub(rf'joint = "{old}"', f'joint = "{new}"', text)
    compiled = Compiled(linkdyn.Scene(text).generate(want="all", name="6-bar.v2"), tmp_path)
    assert compiled.prefix == "scene_6_bar_v2"
    assert compiled()[0] == OK
    header = compiled.header.read_text()
    assert "JOINT_A_1 = 0" in header
    assert "JOINT_A_1_2 = 1" in header


def test_two_threads(tmp_path: Path) -> None:
    """Nothing is kept between calls: two threads at once find what one finds."""
    scene = load("stewart_tsai")
    compiled = Compiled(scene.generate(want="all", name="kernel"), tmp_path)
    q, qd, qdd = samples(scene, 200)
    alone = [compiled(q=q[i], qd=qd[i], qdd=qdd[i])[1].tobytes() for i in range(len(q))]
    with ThreadPoolExecutor(2) as pool:
        for _ in range(3):
            together = list(pool.map(lambda i: compiled(q=q[i], qd=qd[i], qdd=qdd[i])[1].tobytes(), range(len(q))))
            assert together == alone


@pytest.mark.thorough
def test_written_while_others_compute() -> None:
    """Whoever makes a record waits for texts: neither keeps the other waiting for ever."""
    program = """
import concurrent.futures, sys, linkdyn
def compute(i):
    return linkdyn.load(sys.argv[1]).inverse(want=["driving_force", "reaction"][: 1 + i % 2]).status.values.max()
def write(i):
    return linkdyn.load(sys.argv[1]).generate(want="all").source
with concurrent.futures.ThreadPoolExecutor(4) as pool:
    work = [pool.submit([compute, write][i % 2], i) for i in range(40)]
    found = [one.result() for one in work]
assert len(set(found[1::2])) == 1
"""
    subprocess.run([sys.executable, "-c", program, EXAMPLES / "stewart_tsai" / "scene.toml"], check=True, timeout=120)


# ------------------------------------------------------------------------------------------------ what is refused
@pytest.mark.parametrize(("arguments", "message"), [
    (dict(kernel="statics"), "kernel: 'statics' is not a kernel (expected one of 'inverse', 'forward', 'kinematics')"),
    (dict(want="power"), "want: 'power' is not a result of the kernel inverse (expected 'driving_force', 'reaction', "
                         "'joint_variable' or 'all')"),
    (dict(kernel="kinematics", want="reaction"), "want: 'reaction' is not a result of the kernel kinematics (expected "
                                                 "'joint_variable', 'position', 'velocity' or 'all')"),
    (dict(name="folder/bar"), "name: 'folder/bar' is not a name of files that C includes"),
    (dict(name=""), "name: '' is not a name of files"),
])
def test_refused_arguments(arguments: dict[str, str], message: str) -> None:
    with pytest.raises(linkdyn.InputError, match=re.escape(message)):
        load("fourbar").generate(**arguments)


def test_refused_scenes() -> None:
    driven = load("fourbar").with_({"coordinate.J1.driven": True})
    with pytest.raises(linkdyn.InputError, match="no code can be generated: nothing is free to move"):
        driven.generate("forward")
    with pytest.raises(linkdyn.InputError, match="inverse dynamics needs as many actuators"):
        load("flyball_governor").generate("inverse")
    assert "driving_force" in load("screw_lift").with_({"variables.lead": "1 mm"}).generate("inverse", want=["driving_force"]).header
    by_arm = tomllib.loads((EXAMPLES / "screw_lift" / "scene.toml").read_text(encoding="utf-8"))
    by_arm["variables"]["lead"] = "1 mm"
    by_arm["coordinate"] = [{"joint": "O", "motion": {"law": "polynomial-345", "from": 0, "to": "-10 deg", "duration": "4 s"}}]
    by_arm["actuator"] = [{"joint": "O"}]
    with pytest.raises(linkdyn.InputError, match="links 'spindle', 'housing' are placed with too few digits .* threads whose lead is small"):
        linkdyn.Scene(by_arm).generate("inverse")
    assert "driving_force" in load("screw_lift").generate("inverse", want=["driving_force"]).header    # its tip, far from the thread, does not count
    for name, kernel, law in [("four_stroke", "inverse", "load on 'piston.pin', force"), ("toggle_clamp", "inverse", "stop 'mould'"),
                              ("hoist", "forward", "actuator 'drum', law, value")]:
        with pytest.raises(linkdyn.InputError, match=f"no code can be generated: {law} follows the state"):
            load(name).generate(kernel)


@pytest.mark.parametrize(("words", "message"), [
    (["--lang", "rust"], "linkdyn: --lang: 'rust' is not a language of generated code (expected c)"),
    (["--kernel", "invers"], "linkdyn: --kernel: 'invers' is not a kernel (expected one of 'inverse', 'forward', 'kinematics')"),
    (["--want", "rcond"], "linkdyn: --want: 'rcond' is not a result of the kernel inverse"),
    (["-o", "/no/such/folder/bar"], "/no/such/folder/bar"),
    (["--csv"], "unknown option of linkdyn generate"),
])
def test_refused_commands(words: list[str], message: str, tmp_path: Path) -> None:
    done = subprocess.run([linkdyn_command(), "generate", EXAMPLES / "fourbar" / "scene.toml", *words], cwd=tmp_path,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_neither_file_without_the_other(tmp_path: Path) -> None:
    """A header beside a source that could not be written would belong to another one."""
    (tmp_path / "bar.c").mkdir()
    done = subprocess.run([linkdyn_command(), "generate", EXAMPLES / "fourbar" / "scene.toml", "-o", tmp_path / "bar"],
                          capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "bar.c: cannot be written: is a folder" in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bar.c"]


# ------------------------------------------------------------------------------------------------ the example
@pytest.mark.accuracy
def test_controller(tmp_path: Path) -> None:
    """A loop of 1 kHz in plain C finds linkdyn's forces, in every period."""
    command = [sys.executable, EXAMPLES / "controller_c" / "run.py", "--out", tmp_path, "--seconds", "0.2"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    periods, force, apart = re.search(r"(\d+) periods of 1 ms\nlargest driving force (\S+) N, largest difference from linkdyn (\S+) of it\n",
                                      done.stdout).groups()
    assert int(periods) == 200
    assert float(force) > 5.0
    assert float(apart) <= ROUNDING
    assert re.search(r"time a call: median \d+\.\d\d us, worst \d+\.\d\d us\n$", done.stdout)
    assert done.stderr == ""
