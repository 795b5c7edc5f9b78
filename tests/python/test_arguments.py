"""Whatever is given where an argument belongs: what is refused is refused in the package's words, by the argument's name."""

from __future__ import annotations

import math
import os
from functools import cache, partial
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
import tomli_w
import xarray
from matplotlib import pyplot

import linkdyn
from linkdyn import lecture, plot

ROOT = Path(__file__).resolve().parents[2]
NONSENSE = {
    "object": object(),
    "text": "nonsense",
    "letters": "ümläut",
    "null": "a\0b",
    "bytes": b"bytes",
    "ragged": [[1.0], [2.0, 3.0]],
    "complex": 1j,
    "too large": 10**400,
    "large": 2**40,
    "negative": -1,
    "zero": 0,
    "fraction": 0.5,
    "nan": math.nan,
    "infinite": math.inf,
    "nothing": None,
    "list of nothing": [None],
    "cube": np.zeros((2, 2, 2)),
    "empty": [],
    "dict": {"a": 1},
    "dict of objects": {1: object()},
    "set": {1},
    "dates": np.array(["2020-01-01"], dtype="datetime64[D]"),
    "type": int,
}


@pytest.fixture(scope="module")
def scene() -> linkdyn.Scene:
    scene = linkdyn.load(ROOT / "examples" / "fourbar" / "scene.toml")
    # a law of its own: members of an ensemble start off the motion
    law = {"type": "constant", "value": 0.0}
    return scene.with_({"sweep": {"axis": [{"coordinate": "J1", "linspace": [0.0, 1.0, 3]}]}, "actuator.J1.law": law})


@cache
def turning() -> linkdyn.Scene:
    """A crank that goes round."""
    return linkdyn.new("four-bar")


@cache
def cycle() -> Any:
    return turning().inverse().linkdyn


Q, POINT = [[0.1], [0.2]], lecture.Point((0.1, 0.2))
FAR, ANGLE = lecture.Point((1.0, 0.5)), lecture.Angle(0.3)
CALLS: dict[str, tuple[Any, dict[str, Any]]] = {
    "Scene": (lambda scene: linkdyn.Scene, {"source": None, "folder": "."}),
    "with_": (lambda scene: scene.with_, {"changes": {}}),
    "motion": (lambda scene: scene.motion, {"t": 0.1}),
    "load_values": (lambda scene: scene.load_values, {"t": 0.1}),
    "poses": (lambda scene: scene.poses, {"q": Q}),
    "poses of joints": (lambda scene: scene.poses, {"joint_variable": np.zeros((2, 4))}),
    "inverse": (lambda scene: scene.inverse, {
        "q": Q, "qd": Q, "qdd": Q, "wrench": {}, "t": 0.1, "want": "all", "solver": "lapack", "threads": 2}),
    "solve": (lambda scene: scene.solve, {"q": Q, "wrench": {}, "want": "all", "solver": "lapack", "threads": 2}),
    "forward": (lambda scene: scene.forward, {
        "t_end": 0.01, "method": "rk4", "step": 1e-3, "rtol": 1e-9, "atol": 1e-9, "want": "all", "solver": "lapack", "threads": 2}),
    "forward to instants": (lambda scene: scene.forward, {"t": [0.0, 0.01]}),
    "ensemble": (lambda scene: scene.ensemble, {"q": Q, "qd": Q, "t": [0.0, 0.01], "step": 1e-3, "threads": 2}),
    "sweep": (lambda scene: scene.sweep, {"sweep": {"axis": [{"coordinate": "J1", "linspace": [0.0, 1.0, 3]}]},
                                          "keep": "driving_force", "solver": "lapack", "threads": 2}),
    "study": (lambda scene: scene.study, {"t_end": 0.001}),
    "simulator": (lambda scene: scene.simulator, {"method": "rk4", "step": 1e-3, "rtol": 1e-9, "atol": 1e-9, "t": 0.0}),
    "step": (lambda scene: scene.simulator().step, {"dt": 1e-3, "force": [0.0]}),
    "reset": (lambda scene: scene.simulator().reset, {"q": [0.5], "qd": [0.0], "t": 0.0, "pressure": np.zeros((0, 2))}),
    "run of a simulator": (lambda scene: scene.simulator().run, {"controller": lambda simulator: [0.0], "t_end": 0.01, "every": 5e-3}),
    "balance": (lambda scene: turning().balance, {"links": ["crank"], "minimise": "harmonics", "harmonics": [1]}),
    "convert": (lambda scene: partial(linkdyn.convert, scene), {"closing": "fixed"}),
    "convert a file": (lambda scene: linkdyn.convert, {"source": ROOT / "examples" / "fourbar" / "scene.toml"}),
    "plot.assemblies": (lambda scene: plot.assemblies, {"scene": turning()}),
    "marker": (lambda scene: cycle().marker, {"name": "crank.B"}),
    "relative_pose": (lambda scene: cycle().relative_pose, {"link": "crank", "seen_from": "coupler"}),
    "shaking": (lambda scene: cycle().shaking, {"about": [0.0, 0.0]}),
    "flywheel": (lambda scene: cycle().flywheel, {"fluctuation": 0.02, "actuator": "A"}),
    "bearing_life": (lambda scene: cycle().bearing_life, {"joint": "B", "capacity": 1e4, "exponent": 3}),
    "plain_bearing": (lambda scene: cycle().plain_bearing, {"joint": "B", "diameter": 0.03, "width": 0.02}),
    "motor": (lambda scene: cycle().motor, {"actuator": "A", "ratio": 10.0, "efficiency": 0.9, "inertia": 1e-4}),
    "duty_cycle": (lambda scene: linkdyn.cycle.duty_cycle, {"phases": [], "quantity": "driving_force"}),
    "Pose.through": (lambda scene: linkdyn.Pose.through, {"t": [0.0, 1.0], "position": np.zeros((2, 3)), "quaternion": np.ones((2, 4))}),
    "Point": (lambda scene: lecture.Point, {"p": (0.0, 0.0), "dp": (0.0, 0.0), "ddp": (0.0, 0.0)}),
    "Angle": (lambda scene: lecture.Angle, {"the": 0.0, "dthe": 0.0, "ddthe": 0.0}),
    "Slide": (lambda scene: lecture.Slide, {"v": 0.0}),
    "Attitude": (lambda scene: lecture.Attitude, {"r": np.eye(3), "omega": np.zeros(3)}),
    "Coefficients": (lambda scene: lecture.Coefficients, {"of": np.zeros((1, 2)), "rest": np.zeros(2)}),
    "crank_input": (lambda scene: lecture.crank_input, {"j1": POINT, "length": 1.0, "theta": ANGLE, "base": ANGLE}),
    "rrr_links": (lambda scene: lecture.rrr_links, {"j1": POINT, "j2": FAR, "length1": 1.0, "length2": 1.0, "mode": 1}),
    "prr_links": (lambda scene: lecture.prr_links, {
        "j1": POINT, "length": 1.0, "rail": FAR, "psi": ANGLE, "xi": 0.0, "eta": 0.0, "mode": 1}),
    "coupler_point": (lambda scene: lecture.coupler_point, {"j1": POINT, "j2": FAR, "xi": 0.1, "eta": 0.1}),
    "link_angle": (lambda scene: lecture.link_angle, {"j1": POINT, "j2": FAR}),
    "fd_crank_input": (lambda scene: lecture.fd_crank_input, {
        "j1": POINT, "length": 1.0, "theta": ANGLE, "crank": 0, "cranks": 1, "j1_of": lecture.Coefficients(np.zeros((1, 2)))}),
    "s_crank_input": (lambda scene: lecture.s_crank_input, {
        "joint": lecture.Point((0.0, 0.0, 0.0)), "frame": lecture.Attitude(), "theta": ANGLE, "b": np.ones(3), "r_ab": np.eye(3)}),
    "csp_links": (lambda scene: lecture.csp_links, {
        "axis_point": lecture.Point((0.0, 0.0, 0.0)), "axis_frame": lecture.Attitude(), "slide_point": lecture.Point((0.5, 0.0, 0.0)),
        "slide_frame": lecture.Attitude(), "s_c": (1.0, 0.0, 0.0), "s_p": (0.0, 0.0, 0.0), "mode": 1}),
}


@pytest.fixture(scope="module")
def drawn(scene, tmp_path_factory) -> dict[str, Any]:
    """What pictures are made of."""
    platform = linkdyn.load(ROOT / "examples" / "stewart_tsai" / "scene.toml")
    axes = [{"coordinate": f"platform.{name}", "linspace": [at - 0.1, at + 0.1, 3]} for name, at in (("x", -1.5), ("y", 0.0))]
    sweep = {"reduce": ["driving_force", "driving_speed"], "histogram": {"driving_force": True}, "axis": axes}
    return {"inverse": scene.inverse(), "forward": scene.forward(0.1), "planar": scene, "spatial": platform,
            "sweep": platform.sweep(sweep, keep=["driving_force", "driving_speed"]), "folder": tmp_path_factory.mktemp("drawn"), "sound": set()}


CURVE = [(0.0, 10.0), (100.0, 5.0)]
PICTURES: dict[str, tuple[Any, dict[str, Any]]] = {
    "mechanism": (plot.mechanism, {"scene": "planar", "q": [0.1], "names": True, "ax": None}),
    "driving_forces": (plot.driving_forces, {"run": "inverse"}),
    "reactions": (plot.reactions, {"run": "inverse"}),
    "hodograph": (plot.hodograph, {"run": "inverse", "joints": ["J1"], "components": "xy"}),
    "polar": (plot.polar, {"run": "inverse", "joints": ["J1"], "coordinate": "J1"}),
    "motion": (plot.motion, {"run": "forward"}),
    "energies": (plot.energies, {"run": "forward"}),
    "steps": (plot.steps, {"run": "forward"}),
    "animate": (plot.animate, {"run": "inverse", "file": "x.gif", "scene": "planar", "frames": 1, "fps": 5.0, "forces": "all", "names": False}),
    "workspace": (plot.workspace, {"run": "sweep", "quantity": "driving_force", "axes": ["platform.x", "platform.y"], "at": None,
                                   "where": {}, "kind": "slices", "design": None}),
    "force_map": (plot.force_map, {"run": "sweep", "axes": ["platform.x", "platform.y"], "where": {}}),
    "histograms": (plot.histograms, {"run": "sweep", "quantity": "driving_force", "at": None, "design": None}),
    "sizing": (plot.sizing, {"run": "sweep", "limit": CURVE, "continuous": CURVE, "design": None}),
    "screw_limit": (plot.screw_limit, {"motor": CURVE, "lead": 0.01, "ratio": 1.0, "efficiency": 0.9}),
    "sheet": (linkdyn.sheet, {"run": "sweep", "file": "x.html", "design": None, "scene": "spatial"}),
}


@pytest.mark.thorough
@pytest.mark.parametrize(("picture", "argument"), [(name, key) for name, (_, good) in PICTURES.items() for key in good])
@pytest.mark.filterwarnings("ignore")
def test_nonsense_is_not_drawn(picture, argument, drawn, monkeypatch):
    """The same of pictures and sheets."""
    monkeypatch.chdir(drawn["folder"])
    procedure, good = PICTURES[picture]
    good = {key: drawn.get(value, value) if isinstance(value, str) else value for key, value in good.items()}
    if picture not in drawn["sound"]:
        procedure(**good)
        drawn["sound"].add(picture)
    refused = set()
    for kind, value in NONSENSE.items():
        if argument == "frames" and "large" in kind:
            continue    # not wrong: all samples
        try:
            procedure(**good | {argument: value})
        except linkdyn.LinkdynError as error:
            assert picture in str(error) or argument in str(error) or "design" in str(error), (kind, error)
            refused.add(kind)
        finally:
            pyplot.close("all")
    assert "object" in refused


SLOW = {("study", "t_end", "large"), ("study", "t_end", "fraction"), ("forward", "t_end", "large"),
        ("study", "t_end", "nothing"), ("step", "dt", "large"), ("step", "dt", "fraction"), ("run of a simulator", "t_end", "large"),
        ("run of a simulator", "t_end", "fraction"), ("run of a simulator", "controller", "type")}
"""Not wrong, but long; and a callable of the caller's that fails."""


@pytest.mark.parametrize(("call", "argument"), [(call, name) for call, (_, good) in CALLS.items() for name in good])
def test_nonsense_is_refused_by_name(call, argument, scene):
    """Either it is taken, as a value that means something, or it is an error of the package's that names the argument."""
    procedure, good = CALLS[call]
    good = good | ({"source": scene.text} if call == "Scene" else {}) | ({"phases": [(scene.inverse(), 1.0)]} if "phases" in good else {})
    procedure(scene)(**good)
    for kind, value in NONSENSE.items():
        if (call, argument, kind) in SLOW:
            continue
        try:
            procedure(scene)(**good | {argument: value})
        except linkdyn.MissingFileError:
            assert argument in ("source", "folder")    # a text without line ends is a path
        except linkdyn.LinkdynError as error:
            known = {"quantity": ("quantity", "the run has no"), "source": ("source", "scene"), "sweep": ("sweep", "scene", "axis"), "changes": ("changes", "with_", "unknown key")}
            assert any(name in str(error) for name in known.get(argument, (argument,))), (kind, error)


@pytest.mark.parametrize("value", [object(), {1, 2}, 1j, b"x", lambda: None])
def test_what_no_scene_file_can_hold(value):
    with pytest.raises(linkdyn.InputError, match="holds what a scene file cannot"):
        linkdyn.Scene({"space": "planar", "title": value})


def test_a_scene_within_itself():
    loop: dict[str, Any] = {"space": "planar"}
    loop["link"] = [loop]
    with pytest.raises(linkdyn.InputError, match="holds what a scene file cannot"):
        linkdyn.Scene(loop)


def test_the_working_folder_may_change(tmp_path, monkeypatch, tsai):
    """Tables are found again by whatever reads the scene anew: changes, sweeps, studies."""
    folder = tmp_path / "here"
    folder.mkdir()
    (folder / "x.csv").write_text("t,x\n0,-1.6\n1,-1.5\n")
    tsai["coordinate"][0]["motion"] = {"x": {"table": "x.csv"}, "y": 0.0, "z": 1.0}
    tsai["time"] = {"end": 1, "samples": 3}
    (folder / "scene.toml").write_text(tomli_w.dumps(tsai))
    monkeypatch.chdir(folder)
    scenes = [linkdyn.load("scene.toml"), linkdyn.Scene(tsai), linkdyn.Scene(tsai, folder=".")]
    monkeypatch.chdir(tmp_path)
    for scene in scenes:
        changed = scene.with_({"time.samples": 5})
        np.testing.assert_allclose(changed.motion()[0][:, 0], np.linspace(-1.6, -1.5, 5), rtol=1e-14)
        axes = {"axis": [{"time": True, "linspace": [0.0, 1.0, 4]}]}
        assert scene.sweep(axes).samples_reduced == 4
        assert scene.with_({"sweep": axes}).sweep().samples_reduced == 4


@pytest.mark.parametrize(
    ("quantity", "says"),
    [("swing", "no universal or spherical joint"), ("clearance", "no pair of legs"), ("force_amplification", "no marker")],
)
def test_quantities_that_a_scene_lacks(quantity, says, scene, tmp_path):
    for kept in (quantity, ["driving_force", quantity]):
        with pytest.raises(linkdyn.LinkdynError, match=f"'{quantity}'.*{says}"):
            scene.sweep(keep=kept)
    file = tmp_path / "scene.toml"
    file.write_text(scene.text)
    result = os.popen(f"'{linkdyn.cli.executable()}' sweep '{file}' --keep {quantity} -o '{tmp_path}/run.nc' 2>&1").read()
    assert says in result and not (tmp_path / "run.nc").exists()


@pytest.mark.parametrize(("word", "reason"), [("motor", "no actuator of the scene has a drive"), ("friction", "no joint of the scene has friction")])
def test_results_of_parts_that_are_not_there(word: str, reason: str) -> None:
    """By name they are refused; `all` leaves them out."""
    scene = linkdyn.load(ROOT / "examples" / "fourbar" / "scene.toml")
    for compute in (scene.inverse, partial(scene.forward, t_end=0.01)):
        with pytest.raises(linkdyn.LinkdynError, match=f"'{word}': {reason}"):
            compute(want=f"reaction, {word}")
        assert not [name for name in compute(want="all") if name.startswith(word)]


def test_no_path_is_no_folder(tmp_path: Path) -> None:
    """It was read as the current one."""
    run = linkdyn.load(ROOT / "examples" / "fourbar" / "scene.toml").inverse()
    for attempt in (lambda: linkdyn.load(""), lambda: linkdyn.read(""), lambda: run.linkdyn.to_csv("")):
        with pytest.raises(linkdyn.InputError, match="expected a path, got ''"):
            attempt()


def test_what_is_no_result_of_linkdyn_says_so(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text('space = "planar"\n')
    with pytest.raises(linkdyn.FileError, match=r"a scene is read by linkdyn\.load"):
        linkdyn.read(scene)
    with pytest.raises(linkdyn.InputError, match=r"worst: there are no results of samples \(expected a run"):
        xarray.Dataset().linkdyn.worst()


def test_no_instants() -> None:
    with pytest.raises(linkdyn.InputError, match="t: no instants were given"):
        linkdyn.load(ROOT / "examples" / "fourbar" / "scene.toml").forward(t=[])


@pytest.mark.parametrize("change", [
    {"coordinate.{}.start": 1.0}, {"{}": 1}, {"link.crank.{}": 1}, {"link.crank.mass": "{}"}, {"link.crank.mass": "3 {}"}, {"link.crank.mass[{}]": 1},
])  # fmt: skip
def test_a_long_name_is_not_echoed_in_full(change: dict[str, Any]) -> None:
    scene = linkdyn.load(ROOT / "examples" / "fourbar" / "scene.toml")
    long = "name" * 200
    ((path, value),) = change.items()
    with pytest.raises(linkdyn.LinkdynError) as refused:
        scene.with_({path.format(long): value.format(long) if isinstance(value, str) else value})
    assert "namename" in str(refused.value)
    assert "name" * 51 not in str(refused.value)


@pytest.mark.parametrize("name", ["motion", "frame_motion", "load_values", "payload_masses"])
def test_of_no_instants_there_is_nothing(name: str) -> None:
    values = getattr(turning(), name)([])
    assert all(len(array) == 0 for array in (values if isinstance(values, tuple) else (values,)))


def test_a_simulator_is_told_where_it_is_put() -> None:
    with pytest.raises(linkdyn.InputError, match=r"^q\[0\] is not a finite number$"):
        turning().simulator().reset(q=[math.nan])


@pytest.mark.parametrize(("path", "says"), [
    ("variables.cranck", "nothing refers to a variable 'cranck' .expected one of 'ground', 'crank'"),
    ("link.crank.cog[-1]", r"'cog' has 2 elements .the first is \[0\]"),
    ("link.crank.markers.b", "nothing refers to a marker 'crank.b' .expected one of 'A', 'B'; for one to look at, the whole table 'link.crank.markers'"),
    ("frame.markers.d", "nothing refers to a marker 'frame.d' .expected one of 'A', 'D'"),
])  # fmt: skip
def test_a_path_that_changes_nothing_is_refused(path: str, says: str) -> None:
    """The first was taken, and the machine stayed as it was."""
    with pytest.raises(linkdyn.InputError, match=says):
        turning().with_({path: 0.2})


@pytest.mark.parametrize(("path", "says"), [
    ("link.crank.cogg", "link 'crank': unknown key 'cogg'; did you mean 'cog'"),
    ("actuator.A.law.valu", "unknown key 'valu'"),
    ("link.crank.markers.Q", "there is no 'Q' to take out"),
    ("grravity", "unknown key 'grravity'; did you mean 'gravity'"),
])  # fmt: skip
def test_what_is_not_there_cannot_be_taken_out(path: str, says: str) -> None:
    with pytest.raises(linkdyn.InputError, match=says):
        turning().with_({path: None})


def test_what_a_scene_may_have_can_be_taken_out_twice() -> None:
    """Whoever takes a key out need not ask first whether it is there."""
    scene = turning().with_({"link.crank.start": None, "link.crank.cog": None})
    assert scene.with_({"link.crank.cog": None}).text == scene.text


def test_a_new_marker_that_is_used() -> None:
    """By name, by the name of a copy, or as one of a new table."""
    load = {"on": "crank.tip", "force": [0.0, 1.0]}
    assert turning().with_({"link.crank.markers.tip": [0.1, 0.0], "load.crank.tip": load}).inverse().linkdyn is not None
    copied = {"at": [0.1, 0.0], "repeat": 3, "about": "z"}
    assert turning().with_({"link.crank.markers.tip": copied, "load.crank.tip2": load | {"on": "crank.tip2"}}).inverse().linkdyn is not None
    markers = {"A": [0, 0], "B": ["crank", 0], "looked_at": [0.3, 0.0]}
    assert "looked_at" in turning().with_({"link.crank.markers": markers}).text


def test_a_new_variable_that_is_used() -> None:
    assert turning().with_({"variables.grown": "0.2 m", "variables.crank": "grown"}).inverse().linkdyn is not None


@pytest.mark.parametrize(("part", "says"), [({"sample": 0}, "one sample without its dimension"), ({"sample": slice(0, 0)}, "has no samples")])
def test_of_one_sample_without_its_dimension_and_of_none(part: dict[str, Any], says: str, tmp_path: Path) -> None:
    run = turning().inverse().isel(part)
    own = run.linkdyn
    for call in (own.worst, own.rms, own.to_frame, own.energy, partial(own.flywheel, 0.1), partial(own.to_csv, tmp_path / "x.csv"), partial(own.sheet, tmp_path / "x.html"),
                 *(partial(draw, run) for draw in (plot.driving_forces, plot.reactions, plot.hodograph, plot.polar, plot.motion))):  # fmt: skip
        with pytest.raises(linkdyn.InputError, match=says):
            call()
    assert "samples" in own._repr_html_()
