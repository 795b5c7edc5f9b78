"""Which assembly a mechanism is in: followed along motions, found from the start, told, or refused.

What is right is computed here from triangles, circles and Newton's method in small steps, by roads that share nothing
with the engine.
"""

from __future__ import annotations

import copy
import csv
import math
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import linkdyn
from linkdyn.cli import executable

TESTS = Path(__file__).resolve().parents[1]
FILES = TESTS / "assemblies"
"""Scenes of these tests alone, and states."""
STATUSES = ["ok", "unreachable", "singular", "not_converged", "undefined", "branch_lost", "locked"]
WAYS = ["continuous", "change_point", "anew"]
OK, UNREACHABLE, NOT_CONVERGED, BRANCH_LOST = 0, 1, 3, 5
STRAIGHT, THROUGH_CHANGE_POINT, ANEW = range(3)


def path_of(name: str) -> Path:
    return next(file for folder in (FILES, TESTS / "scenes") if (file := folder / name).exists())


def read(name: str) -> dict[str, Any]:
    return tomllib.loads(path_of(name).read_text())


def run(*arguments: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run([executable(), *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)


def number(text: str) -> float:
    """Of a table's field; words by their codes."""
    for words in (STATUSES, WAYS):
        if text in words:
            return float(words.index(text))
    return float(text or "nan")


def states_run(name: str, states: str, folder: Path) -> dict[str, NDArray[np.float64]]:
    """Columns of the table that `inverse --states` writes."""
    output = folder / "run.csv"
    run("inverse", path_of(name), "--states", FILES / states, "--csv", "-o", output, "-q")
    with output.open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return {key.split(" [")[0]: np.array([number(row[key]) for row in rows]) for key in rows[0]}


def column(name: str, states: str) -> NDArray[np.float64]:
    with (FILES / states).open() as file:
        return np.array([float(row[name]) for row in csv.DictReader(file)])


def marker_of(scene: dict[str, Any], link: str, marker: str) -> dict[str, Any]:
    body = scene["frame"] if link == "frame" else next(each for each in scene["link"] if each["name"] == link)
    found = body["markers"][marker]
    return found if isinstance(found, dict) else {"at": found}


def axes_of(marker: dict[str, Any]) -> NDArray[np.float64]:
    """A spatial marker's axes as columns."""
    z = np.asarray(marker["axis"]) / np.linalg.norm(marker["axis"])
    x = np.asarray(marker["x"]) - np.dot(marker["x"], z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def origins(scene: linkdyn.Scene, link: str, q: NDArray[np.float64] | None = None, **options: Any) -> NDArray[np.float64]:
    """Where a link is (N, 3)."""
    return scene.poses(q, **options).position[:, scene.links.index(link)]


def turn_about_z(angle: float) -> NDArray[np.float64]:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


# ---------------------------------------------------------------- groups closed by iteration, along a motion


def test_excavator_keeps_its_assembly(tmp_path: Path) -> None:
    """The rocker's angle on the stick is that of a triangle with the third cylinder."""
    scene = read("excavator.toml")
    found = states_run("excavator.toml", "excavator_jump.csv", tmp_path)
    assert np.all(found["status"] == OK)
    h, u3, v3 = (np.asarray(marker_of(scene, *at.split("."))["at"]) for at in ("stick.H", "stick.U3", "rocker.V3"))
    base, rocker, stroke = np.linalg.norm(u3 - h), np.linalg.norm(v3), column("q Z3", "excavator_jump.csv")
    at_hinge = np.arccos((base**2 + rocker**2 - stroke**2) / (2 * base * rocker))
    towards = math.atan2(*(u3 - h)[::-1]) - math.atan2(*v3[::-1])
    expected = min((towards + at_hinge, towards - at_hinge), key=lambda angle: abs(math.remainder(angle[0] - found["joint_variable H.angle"][0], math.tau)))
    assert np.max(np.abs(np.exp(1j * expected) - np.exp(1j * found["joint_variable H.angle"]))) < 1e-9
    assert np.max(np.abs(np.diff(found["joint_variable H.angle"]))) < 0.2


def rocker_angles(crank: NDArray[np.float64]) -> NDArray[np.float64]:
    """Both angles of the rocker of the RSUR four-bar (2, n); NaN where it does not close."""
    scene = read("rsur.toml")
    frame = {joint: marker_of(scene, "frame", joint) for joint in "AD"}
    body = {"A": marker_of(scene, "crank", "A"), "D": marker_of(scene, "rocker", "D")}
    b, c = marker_of(scene, "crank", "B"), marker_of(scene, "rocker", "C")
    rod = marker_of(scene, "coupler", "C")
    length = np.linalg.norm(rod["at"])
    towards_rod = abs(np.dot(rod["at"], rod["axis"])) / length / np.linalg.norm(rod["axis"])

    def rotation(joint: str, angle: float) -> NDArray[np.float64]:
        return axes_of(frame[joint]) @ turn_about_z(angle) @ axes_of(body[joint]).T

    angles = np.full((2, len(crank)), np.nan)
    for i, q in enumerate(crank):
        at_b = frame["A"]["at"] + rotation("A", q) @ b["at"]
        # |C - B|^2 - length^2 is m + x cos + y sin of the rocker's angle.
        ways = [frame["D"]["at"] + rotation("D", angle) @ c["at"] - at_b for angle in (0.0, math.pi / 2, math.pi)]
        gap = [way @ way - length**2 for way in ways]
        m, x = (gap[0] + gap[2]) / 2, (gap[0] - gap[2]) / 2
        y = gap[1] - m
        if abs(m) > math.hypot(x, y):
            continue
        for branch, sign in enumerate((1, -1)):
            angle = math.atan2(y, x) + sign * math.acos(-m / math.hypot(x, y))
            way = frame["D"]["at"] + rotation("D", angle) @ c["at"] - at_b
            # The coupler's axis of the cross lies on a cone about the rod, and must be square to the rocker's.
            along = abs(rotation("D", angle) @ c["axis"] @ way) / length / np.linalg.norm(c["axis"])
            if towards_rod * along <= math.sqrt((1 - towards_rod**2) * (1 - along**2)):
                angles[branch, i] = angle
    return angles


def nearest_to(angle: float, both: NDArray[np.float64]) -> int:
    return int(np.nanargmin(np.abs(np.exp(1j * both) - np.exp(1j * angle))))


def test_rsur_comes_back_on_one_assembly(tmp_path: Path) -> None:
    """Beyond what it cannot reach it is on the assembly that it had before; flagged is what does not close."""
    found = states_run("rsur.toml", "rsur_reopen.csv", tmp_path)
    crank, ok = column("q A", "rsur_reopen.csv"), found["status"] == OK
    both, outward = rocker_angles(crank), np.arange(0.0, -1.5, -1e-3)
    branch = nearest_to(found["joint_variable D.angle"][0], both[:, 0])
    expected, limit = both[branch], outward[np.argmax(np.isnan(rocker_angles(outward)[branch]))]
    assert np.array_equal(ok, crank > limit) and not np.all(ok)
    assert np.all(found["status"][~ok] == UNREACHABLE)
    assert np.max(np.abs(np.exp(1j * expected) - np.exp(1j * found["joint_variable D.angle"]))[ok]) < 1e-8


def test_rsur_poses_on_their_own() -> None:
    """A sample on its own is reached straight from the start, or flagged: what lies beyond a gap is."""
    scene, crank = linkdyn.Scene(read("rsur.toml")), np.arange(-1.5, 3.1, 0.01)
    data = scene.inverse(q=crank[:, None])
    angle, both = data.joint_variable.sel(variable="D.angle").values, rocker_angles(crank)
    middle = int(np.argmin(np.abs(crank)))
    expected = both[nearest_to(angle[middle], both[:, middle])]
    gaps = np.flatnonzero(np.isnan(expected))
    first, last = gaps[gaps < middle][-1] + 1, gaps[gaps > middle][0] - 1
    assert np.any(~np.isnan(both[:, last + 1 :])), "there is an assembly beyond the gap"
    assert np.array_equal(np.flatnonzero(data.status == OK), np.arange(first, last + 1))
    assert np.max(np.abs(np.exp(1j * expected) - np.exp(1j * angle))[first : last + 1]) < 1e-8
    shuffled = np.random.default_rng(3).permutation(len(crank))
    again = scene.inverse(q=crank[shuffled, None], threads=2)
    assert np.array_equal(again.status.values, data.status.values[shuffled])
    assert np.array_equal(again.joint_variable.values, data.joint_variable.values[shuffled], equal_nan=True)


# ---------------------------------------------------------------- a fold of a platform on six sliders


def hexaglide(scene: dict[str, Any]) -> Any:
    """Errors of the six rods' lengths and their derivatives by the platform's place, a function of slides and place."""
    foot = [marker_of(scene, "frame", f"P{i}") for i in range(1, 7)]
    top = np.array([marker_of(scene, "platform", f"S{i}")["at"] for i in range(1, 7)])
    length = np.array([np.linalg.norm(marker_of(scene, f"rod{i}", f"S{i}")["at"]) for i in range(1, 7)])
    at = np.array([marker["at"] for marker in foot])
    along = np.array([marker["axis"] for marker in foot])

    def errors(q: NDArray[np.float64], origin: NDArray[np.float64], rotation: NDArray[np.float64]) -> tuple[Any, Any]:
        arm = top @ rotation.T
        rod = origin + arm - at - q[:, None] * along
        return (np.sum(rod**2, axis=1) - length**2) / 2, np.hstack([rod, np.cross(arm, rod)])

    return errors


def turned(rotation: NDArray[np.float64], by: NDArray[np.float64]) -> NDArray[np.float64]:
    angle = np.linalg.norm(by)
    if angle == 0:
        return rotation
    x, y, z = by / angle
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return (np.eye(3) + math.sin(angle) * skew + (1 - math.cos(angle)) * skew @ skew) @ rotation


def goes_straight(errors: Any, q0: NDArray[np.float64], q1: NDArray[np.float64], origin: Any, rotation: Any, steps: int) -> Any:
    """Origin of the platform at q1, led from q0 in small steps; None if it meets a fold: its determinant changes sign."""
    sign = np.sign(np.linalg.det(errors(q0, origin, rotation)[1]))
    for part in np.linspace(0, 1, steps + 1)[1:]:
        q = q0 + part * (q1 - q0)
        for _ in range(8):
            gap, matrix = errors(q, origin, rotation)
            shift = np.linalg.solve(matrix, -gap)
            origin, rotation = origin + shift[:3], turned(rotation, shift[3:])
        gap, matrix = errors(q, origin, rotation)
        if np.max(np.abs(gap)) > 1e-10 or np.max(np.abs(shift)) > 1e-6 or np.sign(np.linalg.det(matrix)) != sign:
            return None
    return origin


@pytest.mark.thorough
def test_hexaglide_samples_on_their_own() -> None:
    """Where the straight way from the start ends in a fold a sample has no number, elsewhere it has the right one."""
    description = read("pus6_fold.toml")
    scene, errors = linkdyn.Scene(description), hexaglide(description)
    start = scene.inverse()
    q0 = start.q.values[0]
    at, platform = scene.poses(q0[None, :]), scene.links.index("platform")
    origin, rotation = at.position[0, platform], at.rotation[0, platform]
    q = q0 + np.random.default_rng(5).uniform(-0.05, 0.05, (60, 6))
    status = scene.inverse(q=q, want="driving_force").status.values
    ends = [goes_straight(errors, q0, each, origin, rotation, 400) for each in q]
    folds = np.array([end is None for end in ends])
    assert 5 <= np.count_nonzero(folds) <= 55, "both kinds are tried"
    assert np.array_equal(status == OK, ~folds)
    assert np.all(status[folds] == UNREACHABLE)
    found = origins(scene, "platform", q[~folds])
    assert np.max(np.abs(found - np.array([end for end in ends if end is not None]))) < 1e-8


# ---------------------------------------------------------------- change points


@pytest.fixture(params=["spatial", "planar"])
def parallelogram(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Closed by iteration in space, in closed form in the plane; its crank goes round from 1 rad at 3 rad/s."""
    return read("rusr_parallelogram.toml" if request.param == "spatial" else "parallelogram.toml")


def test_parallelogram_stays_one(parallelogram: dict[str, Any]) -> None:
    """Driven round, through four change points, which are told."""
    data = linkdyn.Scene(parallelogram).inverse()
    angle = data.joint_variable.sel(variable=["A.angle", "D.angle"]).values
    assert np.all(data.status == OK)
    assert np.max(np.abs(angle[:, 0] - angle[:, 1])) < 1e-7
    assert np.max(np.abs(angle[:, 0] - data.q.values[:, 0])) < 1e-12, "turns are counted"
    passed = np.flatnonzero(data.assembly == THROUGH_CHANGE_POINT)
    assert np.allclose(data.q.values[passed, 0], np.pi * np.arange(1, 5), atol=0.03)
    assert data.attrs["change_points_passed"] == 4


def test_parallelogram_stays_one_in_free_motion(parallelogram: dict[str, Any]) -> None:
    parallelogram["coordinate"][0]["start"]["velocity"] = 8.0
    data = linkdyn.Scene(parallelogram).forward(t=np.linspace(0, 2, 101), rtol=1e-11, atol=1e-11)
    energy = data.kinetic_energy + data.potential_energy
    angle = data.joint_variable.sel(variable=["A.angle", "D.angle"]).values
    assert data.attrs["stopped"] == "" and np.all(data.status == OK)
    assert np.max(np.abs(energy - energy[0])) < 1e-5 * abs(energy[0])
    assert np.max(np.abs(angle[:, 0] - angle[:, 1])) < 1e-7
    assert data.attrs["change_points_passed"] == np.floor(angle[-1, 0] / np.pi) > 0


@pytest.mark.parametrize("method", ["rkf45", "rk8pd", "gbs", "msbdf"])
@pytest.mark.parametrize("is_driven", [False, True])
def test_fast_steps_count_what_they_pass(parallelogram: dict[str, Any], method: str, is_driven: bool) -> None:
    """Nothing but the assembly keeps steps short: one of several turns had the margin of its loop at both ends, and counted none."""
    parallelogram["gravity"] = [0.0] * len(parallelogram["gravity"])
    crank = parallelogram["coordinate"][0]
    for start, rate, end in ((1.0, 8.0, 1.5), (0.3, -20.0, 1.45)):
        crank["start"] = {"position": start, "velocity": rate}
        if is_driven:
            crank |= {"driven": True, "motion": {"law": "constant-rate", "rate": rate, "start": start}}
            crank.pop("start")
            parallelogram["actuator"] = [{"joint": "A"}]
        data = linkdyn.Scene(parallelogram).forward(t=[0, end], method=method, rtol=1e-3, atol=1e-3)
        assert data.attrs["stopped"] == ""
        angle = data.joint_variable.sel(variable=["A.angle", "D.angle"]).values[-1]
        assert np.max(np.abs(angle - start - rate * end)) < 1e-2, "of both cranks: ten tolerances"
        assert data.attrs["change_points_passed"] == abs(np.floor((start + rate * end) / np.pi) - np.floor(start / np.pi))


def test_driven_parallelogram_stays_one(parallelogram: dict[str, Any]) -> None:
    """A coordinate that keeps to its motion in a forward run."""
    parallelogram["coordinate"][0] |= {"driven": True}
    parallelogram["coordinate"][0].pop("start")
    parallelogram["actuator"] = [{"joint": "A"}]
    data = linkdyn.Scene(parallelogram).forward(t=np.linspace(0, 2, 101))
    angle = data.joint_variable.sel(variable=["A.angle", "D.angle"]).values
    assert data.attrs["stopped"] == "" and np.all(data.status == OK)
    assert np.max(np.abs(angle[:, 0] - angle[:, 1])) < 1e-7
    assert data.attrs["change_points_passed"] == 2


def test_stops_at_change_point_if_wished(parallelogram: dict[str, Any]) -> None:
    parallelogram["change_points"] = "stop"
    scene = linkdyn.Scene(parallelogram)
    data = scene.inverse()
    before = data.q.values[:, 0] < np.pi
    assert np.all(data.status[before] == OK)
    assert np.all(data.status[~before] == BRANCH_LOST)
    assert np.all(np.isnan(data.reaction.values[~before]))
    for word in ("'coupler'", "'rocker'", "change point at A = 1"):
        assert word in data.attrs["failure"], data.attrs["failure"]
    run = scene.forward(t=np.linspace(0, 2, 101))
    for word in ("'coupler'", "'rocker'", "change point"):
        assert word in run.attrs["stopped"], run.attrs["stopped"]
    assert np.nanmax(run.q.values) < np.pi + 1e-9


def test_ensemble_goes_as_forward_runs_do(parallelogram: dict[str, Any]) -> None:
    starts, t = np.array([0.8, 1.0, 1.2]), np.linspace(0, 1, 11)
    rates = np.array([8.0, 8.0, -8.0])
    members = linkdyn.Scene(parallelogram).ensemble(starts[:, None], rates[:, None], t)
    for i, (position, velocity) in enumerate(zip(starts, rates)):
        one = copy.deepcopy(parallelogram)
        one["coordinate"][0]["start"] = {"position": position, "velocity": velocity}
        for link in one["link"]:
            link.pop("start", None)
        alone = linkdyn.Scene(one).forward(t=t)
        assert np.max(np.abs(alone.q.values[:, 0] - members.q.values[i, :, 0])) < 1e-4
        assert members.change_points_passed[i] == alone.attrs["change_points_passed"] > 0
    stopping = linkdyn.Scene(parallelogram | {"change_points": "stop"}).ensemble(starts[:, None], rates[:, None], t)
    assert np.all(stopping.good_until < 1) and np.all(np.isnan(stopping.q.values[:, -1]))


@pytest.mark.parametrize("n", [2, 5, 41, 1001])
def test_change_points_are_counted_not_samples(parallelogram: dict[str, Any], n: int, tmp_path: Path) -> None:
    """As many whatever the samples are, told alike by the command, which has blocks of 256, and by Python."""
    for way in ("inverse", "forward"):
        given = copy.deepcopy(parallelogram)
        t = np.linspace(0, 4 if way == "inverse" else 2, n)
        given["time"] = {"end": float(t[-1]), "samples": n}
        scene = linkdyn.Scene(given)
        data = scene.inverse() if way == "inverse" else scene.forward(t=t)
        want = np.floor(float(data.q.values[-1, 0]) / np.pi)
        assert data.attrs.get("stopped", "") == "" and data.status.values[-1] == OK and want == (4 if way == "inverse" else want) > 1
        assert data.attrs["change_points_passed"] == want
        (tmp_path / "scene.toml").write_text(scene.text)
        said = run(way, tmp_path / "scene.toml", "-o", tmp_path / "run.nc")
        assert f"change points    {want:.0f} passed on the smooth continuation, the first before t = " in said.stdout, said
        assert int(linkdyn.read(tmp_path / "run.nc").attrs["change_points_passed"]) == want


def test_loops_that_lie_flat_together_are_at_one_change_point() -> None:
    """A row of two parallelograms; and two that lie flat one after the other are at two."""
    for apart, want in ((0.0, 1), (0.3, 2)):
        links, joints = [], []
        for name, turned in (("a", 0.0), ("b", apart)):
            x, y = 2 * np.cos(turned), 2 * np.sin(turned)
            ground = {f"{name}D": [x, y]}
            links += [{"name": f"{name}coupler", "mass": 1.0, "inertia": 0.1, "markers": {"B": [0, 0], "C": [x, y]}},
                      {"name": f"{name}rocker", "mass": 1.0, "inertia": 0.1, "markers": {"D": [0, 0], "C": [1, 0]}}]
            joints += [{"name": f"{name}B", "type": "revolute", "between": ["crank.B", f"{name}coupler.B"]},
                       {"name": f"{name}C", "type": "revolute", "between": [f"{name}coupler.C", f"{name}rocker.C"]},
                       {"name": f"{name}D", "type": "revolute", "between": [f"frame.{name}D", f"{name}rocker.D"], "start": 1.0}]
            frame = ground if name == "a" else frame | ground
        given = {"space": "planar", "gravity": [0, 0], "frame": {"markers": {"A": [0, 0], **frame}}, "link": [
            {"name": "crank", "mass": 1.0, "inertia": 0.1, "markers": {"A": [0, 0], "B": [1, 0]}}, *links],
            "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]}, *joints],
            "coordinate": [{"joint": "A", "start": {"position": 1.0, "velocity": -1.0}}],
            "actuator": [{"joint": "A", "law": {"type": "constant", "value": 0.0}}]}
        for n in (2, 50):
            data = linkdyn.Scene(given).forward(t=np.linspace(0, 1.5, n))
            assert np.all(data.status == OK) and data.q.values[-1, 0] < 0
            assert data.attrs["change_points_passed"] == want


@pytest.mark.parametrize("method", ["rk8pd", "gbs"])
def test_a_change_point_that_a_flagged_sample_is_on_is_counted(method: str, tmp_path: Path) -> None:
    """The first sample beyond, or at the very place, is flagged: the run has passed it all the same."""
    given = read("parallelogram.toml")
    given["gravity"] = [0, 0]
    given["coordinate"][0]["start"]["velocity"] = -1.0
    scene = linkdyn.Scene(given)
    data = scene.forward(t=[0, 0.5, 1.0, 1.0 + 1e-6, 1.5], method=method)
    assert data.attrs["stopped"] == "" and data.status.values[-1] == OK and np.any(data.status.values[2:4] != OK)
    assert data.attrs["change_points_passed"] == 1
    (tmp_path / "scene.toml").write_text(scene.text)
    said = run("forward", tmp_path / "scene.toml", "--until", 2, "--samples", 3, "--method", method, "-o", tmp_path / "run.nc")
    assert "failed samples   1 of 3" in said.stdout and "change points    1 passed" in said.stdout, said
    assert int(linkdyn.read(tmp_path / "run.nc").attrs["change_points_passed"]) == 1


def test_end_of_reach_is_no_change_point() -> None:
    """There two assemblies meet, too, but none goes on."""
    for choice in ("pass", "stop"):
        data = linkdyn.Scene(read("crank_out_of_reach.toml") | {"change_points": choice}).inverse()
        failed = data.status.values[data.status.values != OK]
        assert len(failed) == 45 and np.all(failed == UNREACHABLE)
        assert "cannot be closed beyond" in data.attrs["failure"]


def test_a_start_that_others_close_too_far_away() -> None:
    """A second dyad reaches the first one's pin only where that closes the other way, which nothing says: that is told, and how to go on."""
    def bar(name: str, length: float) -> dict[str, Any]:
        return {"name": name, "mass": 1.0, "markers": {"P": [0.0, 0.0], "Q": [length, 0.0]}}

    scene = {"space": "planar", "frame": {"markers": {"A": [0.0, 0.0], "D": [0.4, 0.0], "F": [0.3, -0.6]}},
             "link": [bar("crank", 0.1), bar("rod", 0.4), bar("rocker", 0.3), bar("pull", 0.3), bar("lever", 0.25)],
             "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "crank.P"]}, {"name": "B", "type": "revolute", "between": ["crank.Q", "rod.P"]},
                       {"name": "C", "type": "revolute", "between": ["rod.Q", "rocker.Q"]}, {"name": "D", "type": "revolute", "between": ["frame.D", "rocker.P"]},
                       {"name": "C2", "type": "revolute", "between": ["rod.Q", "pull.P"]}, {"name": "E", "type": "revolute", "between": ["pull.Q", "lever.Q"]},
                       {"name": "F", "type": "revolute", "between": ["frame.F", "lever.P"]}],
             "coordinate": [{"joint": "A", "start": "90 deg"}], "actuator": [{"joint": "A"}]}
    lost = linkdyn.Scene(scene)
    told = lost.inverse().attrs["failure"]
    assert "links 'pull', 'lever' cannot be closed at the start: joints 'C2' and 'F' are 0.896951 m apart, the links reach from 0.05 m to 0.55 m" in told
    assert "; nothing says how the loops before them close (linkdyn assemblies lists what does)" in told
    assert "Reach from the start\n  does not close at the start\n" in lost.explain()
    choice = lost.assemblies()[0].branch
    for joint in scene["joint"]:
        joint |= {"branch": choice[joint["name"]]} if joint["name"] in choice else {}
    closed = linkdyn.Scene(scene)
    assert not closed.inverse().status.values.any() and "does not close" not in closed.explain()


def test_order_and_threads_change_nothing() -> None:
    """A motion is followed from sample to sample, however many threads compute them."""
    scene = linkdyn.Scene(read("rusr_parallelogram.toml"))
    one, four = scene.inverse(), scene.inverse(threads=4)
    assert one.drop_attrs().identical(four.drop_attrs())


# ---------------------------------------------------------------- bounds on work


def test_far_samples_end() -> None:
    """Full turns are left out of a way; one of too many strides is refused: both at once."""
    program = f"""
import linkdyn, numpy as np
scene = linkdyn.load({str(path_of("rsur.toml"))!r})
turns = 2*np.pi*1000000
near, far = (scene.inverse(q=[[0.5 + by]], want="driving_force,joint_variable") for by in (0, turns))
assert far.status[0] == {OK}
assert np.allclose(near.driving_force, far.driving_force, rtol=1e-6)
assert scene.inverse(q=[[1e300]], want="driving_force").status[0] == {NOT_CONVERGED}
slides = linkdyn.load({str(path_of("pus6_fold.toml"))!r})
assert slides.inverse(q=[[1e9]*6], want="driving_force").status[0] == {NOT_CONVERGED}
"""
    assert subprocess.run([sys.executable, "-c", program], timeout=100, check=False).returncode == 0


# ---------------------------------------------------------------- the start


def delta(arm_start: float | None = None) -> dict[str, Any]:
    """A Delta on three arms, each with a rod between universal joints; at joint variables of zero the arms point
    outward and the rods hang down."""
    base, arm, rod, platform = 0.3, 0.2, 0.5, 0.1
    scene: dict[str, Any] = {
        "title": "Delta", "space": "spatial", "gravity": [0.0, 0.0, -9.81], "frame": {"markers": {}},
        "link": [{"name": "platform", "mass": 1.0, "inertia": {"diagonal": [0.01, 0.01, 0.02]}, "markers": {}}],
        "joint": [], "coordinate": [], "actuator": [],
    }
    for i in range(3):
        way = 2 * math.pi / 3 * i
        out, across = [math.cos(way), math.sin(way), 0.0], [-math.sin(way), math.cos(way), 0.0]
        down = {"axis": across, "x": [0.0, 0.0, -1.0]}
        cross = {"axis": out, "x": [0.0, 0.0, -1.0]}
        scene["frame"]["markers"][f"A{i}"] = {"at": [base * c for c in out], "axis": across, "x": out}
        scene["link"][0]["markers"][f"C{i}"] = {"at": [platform * c for c in out], **down}
        scene["link"] += [
            {"name": f"arm{i}", "mass": 0.5, "inertia": {"diagonal": [0.002, 0.002, 0.002]},
             "markers": {"A": {"at": [0.0, 0.0, 0.0], "axis": across, "x": out}, "B": {"at": [arm * c for c in out], **down}}},
            {"name": f"rod{i}", "mass": 0.2, "cog": [0.0, 0.0, -rod / 2], "inertia": {"diagonal": [0.005, 0.005, 0.0001]},
             "markers": {"B": {"at": [0.0, 0.0, 0.0], **cross}, "C": {"at": [0.0, 0.0, -rod], **cross}}},
        ]
        joint: dict[str, Any] = {"name": f"A{i}", "type": "revolute", "between": [f"frame.A{i}", f"arm{i}.A"]}
        scene["joint"] += [
            joint,
            {"name": f"B{i}", "type": "universal", "between": [f"arm{i}.B", f"rod{i}.B"]},
            {"name": f"C{i}", "type": "universal", "between": [f"platform.C{i}", f"rod{i}.C"]},
        ]
        scene["coordinate"].append({"joint": f"A{i}"})
        scene["actuator"].append({"joint": f"A{i}"})
    return scene


def test_delta_hangs_down() -> None:
    """Without any start the assembly nearest to joint variables of zero is taken, and said."""
    scene = linkdyn.Scene(delta())
    data = scene.inverse()
    variables = data.joint_variable.values[0]
    assert np.max(np.abs(variables)) < math.pi / 2, variables
    assert origins(scene, "platform", data.q.values)[0, 2] == pytest.approx(-math.sqrt(0.5**2 - 0.4**2), abs=1e-9)
    assert "nearest to joint variables of zero" in scene.explain()


def test_start_of_a_link_decides() -> None:
    """Asked for above the arms, the platform is above."""
    upside = delta()
    upside["link"][0]["start"] = {"position": [0.0, 0.0, 0.3]}
    scene = linkdyn.Scene(upside)
    assert origins(scene, "platform", np.zeros((1, 3)))[0, 2] == pytest.approx(0.3, abs=1e-9)
    assert "nearest to 'start'" in scene.explain()


def test_boom_by_its_cylinder() -> None:
    """A driven slide within a loop: the triangle closes without a start, and a joint's start chooses."""
    description = read("boom_by_stroke.toml")
    a, p = np.array([0.0, 1.0]), np.array([0.5, 0.0])
    base = p - a
    for start, sign in ((None, None), ("40 deg", 1), ("-150 deg", -1)):
        one = copy.deepcopy(description)
        if start is not None:
            one["joint"][0]["start"] = start
        data = linkdyn.Scene(one).inverse()
        assert np.all(data.status == OK)
        stroke = data.q.values[:, 0]
        at_a = np.arccos((base @ base + 1.5**2 - stroke**2) / (2 * np.linalg.norm(base) * 1.5))
        both = math.atan2(base[1], base[0]) + np.outer([1, -1], at_a)
        angle = data.joint_variable.sel(variable="A.angle").values
        off = np.max(np.abs(np.exp(1j * both) - np.exp(1j * angle)), axis=1)
        assert np.min(off) < 1e-9
        if sign is not None:
            assert off[0 if sign > 0 else 1] < 1e-9


def test_scissor_by_its_cylinder() -> None:
    """Starts of joints are heard in the plane, too."""
    description = read("scissor_by_stroke.toml")
    data = linkdyn.Scene(description).inverse()
    assert np.all(data.status == OK)
    c1, c2 = np.array([0.5, -0.1]), np.array([1.4, 0.1])

    def stroke(angle: float) -> float:
        """Between the cylinder's ends with arm1 at an angle and arm2 its mirror image."""
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        back = np.array([[-math.cos(angle), -math.sin(angle)], [math.sin(angle), -math.cos(angle)]])
        return float(np.linalg.norm(turn @ c1 - (np.array([2 * math.cos(angle), 0.0]) + back @ c2)))

    angle = data.joint_variable.sel(variable="A.angle").values
    assert np.all((angle > 0) & (angle < np.pi / 2))
    assert np.allclose([stroke(each) for each in angle], data.q.values[:, 0], atol=1e-9)


def test_branch_without_meaning_is_refused() -> None:
    """In a group closed by iteration; a boom's cylinder obeys."""
    scene = read("scissor_by_stroke.toml")
    joint = scene["joint"][2]
    joint["branch"] = -1
    with pytest.raises(linkdyn.SceneError, match=f"joint '{joint['name']}': 'branch' has no meaning here: its links are closed by iteration"):
        linkdyn.Scene(scene)
    scene = read("boom_by_stroke.toml")
    scene["joint"][2]["branch"] = -1
    angle = np.degrees(linkdyn.Scene(scene).inverse().joint_variable.sel(variable="A.angle").values[0])
    assert angle == pytest.approx(-120.776, abs=1e-3)     # by the law of cosines


# ---------------------------------------------------------------- words


def test_words_name_loop_sample_and_range(tmp_path: Path) -> None:
    """Which links could not be closed, at which instant, how far from closing, and the range of their crank."""
    limit = math.degrees(math.acos((0.1**2 + 0.52**2 - 0.6**2) / (2 * 0.1 * 0.52)))
    result = run("inverse", path_of("crank_out_of_reach.toml"), "-o", tmp_path / "run.nc")
    said = run("explain", path_of("crank_out_of_reach.toml")).stdout
    for text in (result.stderr, result.stdout, said):
        for words in ("'coupler', 'rocker'", "cannot be closed", f"from A = -{limit:.3f}", f"to {limit:.3f}"):
            assert words in text, text
    assert "t = 0.39" in result.stderr and f"{140.4 - limit:.4f}"[:-1] in result.stderr
    assert "instants along the motion" in said


def test_summary_tells_assembly_and_change_points(tmp_path: Path) -> None:
    result = run("inverse", path_of("rusr_parallelogram.toml"), "-o", tmp_path / "run.nc")
    assert "'rocker', 'coupler': branch -1, nearest to 'start'" in result.stdout
    assert "change points    4 passed" in result.stdout
    assert "branch +1" in run("explain", path_of("crank_out_of_reach.toml")).stdout


def test_sweep_flags_what_the_start_does_not_reach() -> None:
    """Samples of a sweep are on their own."""
    description = read("rsur.toml")
    description["sweep"] = {"axis": [{"coordinate": "A", "linspace": [-1.5, 3.0, 46]}], "keep": ["driving_force"]}
    sweep = linkdyn.Scene(description).sweep()
    alone = linkdyn.Scene(read("rsur.toml")).inverse(q=np.linspace(-1.5, 3.0, 46)[:, None])
    assert np.array_equal(np.isnan(sweep.driving_force.values.ravel()), alone.status.values != OK)


def test_closed_paths_come_back() -> None:
    """Smooth closed paths: the pose at the end is that at the start, and no step is larger than the rates explain."""
    scene = linkdyn.Scene(read("excavator.toml"))
    middle = scene.inverse().q.values[0]
    rng = np.random.default_rng(11)
    for _ in range(4):
        phase = np.linspace(0, 2 * np.pi, 201)
        way = sum(np.outer(np.cos(k * phase) - 1, rng.uniform(-0.03, 0.03, 3)) + np.outer(np.sin(k * phase), rng.uniform(-0.03, 0.03, 3)) for k in (1, 2))
        poses = scene.poses(middle + way, in_order=True)
        assert np.all(poses.status == OK)
        assert np.max(np.abs(poses.position[0] - poses.position[-1])) < 1e-9
        assert np.max(np.abs(poses.rotation[0] - poses.rotation[-1])) < 1e-9
        turn = np.max(np.abs(np.diff(poses.rotation, axis=0)), axis=(1, 2, 3))
        assert np.max(turn) < 4 * np.median(turn) + 0.02


def rotation_of(angles: list[float]) -> NDArray[np.float64]:
    """Of roll, pitch and yaw about axes that go along."""
    about = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}
    r = np.eye(3)
    for axis, angle in zip("xyz", angles, strict=True):
        i, j = about[axis]
        turn = np.eye(3)
        turn[i, i] = turn[j, j] = math.cos(angle)
        turn[j, i] = math.sin(angle)
        turn[i, j] = -turn[j, i]
        r = r @ turn
    return r


def turned_a_little(rng: np.random.Generator, angle: float) -> NDArray[np.float64]:
    axis = rng.normal(size=3)
    a, b, c = axis / np.linalg.norm(axis)
    cross = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


@pytest.mark.parametrize("dropped", [0.0, 0.5])
@pytest.mark.parametrize("degrees", [0, 12, 25])
@pytest.mark.parametrize("name", ["upu_by_slides.toml", "strut_by_slide.toml"])
def test_none_is_nearer_than_the_one_taken(name: str, degrees: int, dropped: float) -> None:
    """Starts that are turned some way off, or left out: the assembly that was drawn has a distance, and what is taken none that is
    larger. There are dozens of others."""
    drawn = read(name)
    rng = np.random.default_rng(5)
    for _ in range(6):
        data = copy.deepcopy(drawn)
        there = {link["name"]: (np.array(link["start"]["position"]), rotation_of(link["start"]["angles"])) for link in data["link"]}
        given: dict[str, NDArray[np.float64]] = {}
        for link in data["link"]:
            del link["start"]["angles"]
            given[link["name"]] = turned_a_little(rng, math.radians(degrees)) @ there[link["name"]][1]
            link["start"]["rotation"] = given[link["name"]].tolist()
            if rng.uniform() < dropped:
                del link["start"], given[link["name"]]
        if not given:
            continue
        scene = linkdyn.Scene(data)
        found = scene.poses(np.zeros((1, len(data["coordinate"]))))
        assert found.status[0] == OK
        taken = 0.0
        for link, attitude in given.items():
            k = list(scene.links).index(link)
            # sizes of the mechanisms are less than a metre
            taken += float(np.sum((found.position[0, k] - there[link][0]) ** 2)) + angle_between(found.rotation[0, k], attitude) ** 2
        # six digits of the drawing
        assert taken <= len(given) * math.radians(degrees) ** 2 + 1e-4


@pytest.mark.parametrize("said", [1.0, 0.6])
@pytest.mark.parametrize("degrees", [0, 10])
@pytest.mark.parametrize("name", ["upu_by_slides.toml", "strut_by_slide.toml"])
def test_starts_of_joints_decide_in_whatever_order_their_links_are(name: str, degrees: int, said: float) -> None:
    """The same by variables of joints, universal ones that are written from either side among them; balls say nothing."""
    drawn = read(name)
    q = np.zeros((1, len(drawn["coordinate"])))

    def variables(data: dict[str, Any]) -> dict[str, float]:
        run = linkdyn.Scene(data).inverse(q=q, want="joint_variable")
        assert run.status.values[0] == OK
        return dict(zip(map(str, run.variable.values), run.joint_variable.values[0], strict=True))

    there = variables(drawn)
    rng = np.random.default_rng(7)
    for _ in range(6):
        data = copy.deepcopy(drawn)
        for link in data["link"]:
            del link["start"]
        given: dict[str, float] = {}
        for joint in data["joint"]:
            if joint["type"] == "spherical" or rng.uniform() > said:
                continue
            start = {}
            for variable in (v for v in there if v.split(".")[0] == joint["name"]):
                kind = variable.split(".")[1]
                given[variable] = there[variable] + (math.radians(degrees) * rng.choice([-1, 1]) if "angle" in kind else 0)
                start[kind] = float(given[variable])
            joint["start"] = start if len(start) > 1 else next(iter(start.values()))
        found = variables(data)
        # slides count as parts of a size, which is less than a metre
        off = [found[v] - given[v] for v in given]
        taken = sum((math.remainder(x, 2 * math.pi) if "angle" in v else x) ** 2 for v, x in zip(given, off, strict=True))
        assert taken <= sum("angle" in v for v in given) * math.radians(degrees) ** 2 + 1e-4


def angle_between(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    return math.acos(max(-1.0, min(1.0, (np.trace(a.T @ b) - 1) / 2)))
