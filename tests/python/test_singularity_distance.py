"""Distance to the next singular position, where the exact one is known."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "hard"))

from cases import Case, bar, hard_cases, planar, revolute  # noqa: E402
from test_rccc import cosine_of_closure, linkage  # noqa: E402

pytestmark = pytest.mark.accuracy

CASES = {case.name: case for case in hard_cases()}


def distance_of(case: Case, solver: str = "elimination") -> tuple[np.ndarray, float]:
    """Distances [m] and the length by which angles count [m]."""
    run = linkdyn.Scene(case.scene, case.folder).inverse(
        q=case.q, qd=case.qd, qdd=case.qdd, want="singularity_distance", solver=solver
    )
    return run.singularity_distance.values, run.singularity_distance.attrs["length"]


def test_fichter() -> None:
    """Singular at a yaw of 90 degrees, from 0.1 to 1e-10 rad. The states are off the centre by up to 0.05 of the platform's size,
    where other motions lead there too: the way is a thousandth shorter than by yaw alone, and curved at 0.1 rad."""
    case = CASES["fichter"]
    distance, length = distance_of(case)
    ratio = distance / (case.distance * length)
    assert np.all(ratio < 1 + 1e-6) and np.all(ratio > 1 - 2e-3 - 0.5 * case.distance)


@pytest.mark.parametrize("name", ["dead_centre_outer", "dead_centre_inner", "stretched_dyad", "four_bar_change_point"])
def test_limits_of_coordinates(name: str) -> None:
    """Dead centres of a driven slide, where the smallest singular value goes as the root of the distance, and a dyad folded by
    its crank, where it goes as the distance itself: the same formula for both."""
    case = CASES[name]
    distance, length = distance_of(case)
    exact = 2.0 - case.q[:, 0] if name == "stretched_dyad" else case.distance * (length if case.distance_unit == "rad" else 1.0)
    # First order leaves a part of the distance over the size of the mechanism, at the inner centre of its root (of the links'
    # velocities some do not grow); positions are uncertain by some epsilons over the distance, those of the dyad over its square.
    share = np.sqrt(exact) if name == "dead_centre_inner" else exact
    rounding = 100 * np.finfo(float).eps / (exact**2 if name == "four_bar_change_point" else exact)
    assert np.all(np.abs(distance / exact - 1) < share + rounding)


def five_bar() -> linkdyn.Scene:
    """Two cranks with motors on the frame, two couplers between them: singular where the couplers are in line."""
    scene = planar(
        "Five-bar linkage",
        frame={"markers": {"O": [0.0, 0.0], "Q": [3.0, 0.0]}},
        link=[bar("left", 1.0, 1.0), bar("right", 1.2, 1.0), bar("coupler", 2.0, 1.0), bar("other", 2.2, 1.0)],
        joint=[
            revolute("J1", "frame.O", "left.A"),
            revolute("J2", "frame.Q", "right.A"),
            revolute("J3", "left.B", "coupler.A"),
            revolute("J4", "coupler.B", "other.B", branch=1),
            revolute("J5", "right.B", "other.A"),
        ],
        coordinate=[{"joint": "J1"}, {"joint": "J2"}],
        actuator=[{"joint": "J1"}, {"joint": "J2"}],
    )
    return linkdyn.Scene(scene)


def test_parallel_singularity_of_a_five_bar() -> None:
    """Two coordinates: the way to the curve on which the cranks' ends are as far apart as the couplers reach."""
    scene = five_bar()
    rng = np.random.default_rng(1)
    seen = 0
    for gap in 10.0 ** -np.arange(2.0, 9.0):
        for _ in range(20):
            left = rng.uniform(1.8, 2.6)
            # The right crank's angle at which the ends are (4.2 - gap) apart, by bisection.
            low, high = 0.0, 1.6
            for _ in range(200):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if ends_apart(left, middle)[0] > 4.2 - gap else (low, middle)
            q = np.array([[left, high]])
            apart, slope = ends_apart(left, high)
            if abs(apart - 4.2 + gap) > 1e-12:
                continue
            run = scene.inverse(q=q, want="singularity_distance")
            length = run.singularity_distance.attrs["length"]
            exact = (4.2 - apart) / np.hypot(*slope) * length
            # Beside the first order, rounding of the reach.
            assert abs(run.singularity_distance.values[0] / exact - 1) < 3 * np.sqrt(gap) + 1e-13 / gap
            seen += 1
    assert seen > 50


def ends_apart(left: float, right: float) -> tuple[float, np.ndarray]:
    """How far the cranks' ends are apart [m], and its derivatives by the cranks' angles."""
    b = np.array([np.cos(left), np.sin(left)])
    d = np.array([3.0 + 1.2 * np.cos(right), 1.2 * np.sin(right)])
    way = (d - b) / np.linalg.norm(d - b)
    return float(np.linalg.norm(d - b)), np.array([-way @ [-b[1], b[0]], way @ [-d[1], d[0] - 3.0]])


def hexapod(rng: np.random.Generator) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """A platform on six legs between balls, feet and tops anywhere."""
    feet, tops = rng.normal(0, [1, 1, 0.3], (6, 3)), rng.normal(0, [0.6, 0.6, 0.2], (6, 3))
    leg = {"type": "SPS", "name": "leg", "base": [f"frame.B{i}" for i in range(6)], "platform": [f"table.P{i}" for i in range(6)],
           "lower": {"mass": 0}, "upper": {"mass": 0}}
    table = {"name": "table", "mass": 5.0, "inertia": {"diagonal": [1.0, 1.0, 1.5]}, "markers": {f"P{i}": p.tolist() for i, p in enumerate(tops)}}
    scene = {"space": "spatial", "frame": {"markers": {f"B{i}": p.tolist() for i, p in enumerate(feet)}}, "link": [table], "chain": [leg],
             "coordinate": [{"link": "table"}]}
    return scene, feet, tops


def volume(pose: np.ndarray, feet: np.ndarray, tops: np.ndarray) -> float:
    """Determinant of the legs' lines, zero where no six forces along them are determined."""
    arm = Rotation.from_euler("XYZ", pose[3:]).apply(tops)
    line = pose[:3] + arm - feet
    line /= np.linalg.norm(line, axis=1)[:, np.newaxis]
    return float(np.linalg.det(np.hstack([line, np.cross(arm, line)])))


def test_turned_platforms() -> None:
    """Hexapods anywhere near a singular pose, turned by up to a radian and more: to the nearest one in coordinates, which are angles. The
    engine's own columns of a pose are those of its angular velocity, along which it was up to a third longer or shorter."""
    rng = np.random.default_rng(5)
    seen = 0
    while seen < 12:
        scene, feet, tops = hexapod(rng)
        begin, way = np.append([0, 0, 1.5], rng.uniform(-1.2, 1.2, 3)), rng.normal(size=6)
        sides = [volume(begin + s * way, feet, tops) for s in np.linspace(0, 1, 200)]
        change = np.flatnonzero(np.diff(np.sign(sides)))
        if not len(change):
            continue
        at = brentq(lambda s: volume(begin + s * way, feet, tops), *np.linspace(0, 1, 200)[change[0] + np.arange(2)], xtol=1e-15)
        pose = begin + at * way - 1e-4 * way / np.linalg.norm(way)
        if abs(np.cos(pose[4])) < 0.2:
            continue
        run = linkdyn.Scene(scene).inverse(q=pose[np.newaxis], want="singularity_distance")
        unit = np.append(np.ones(3), np.full(3, run.singularity_distance.attrs["length"]))
        near = pose.copy()
        for _ in range(20):
            slope = np.array([volume(near + h, feet, tops) - volume(near - h, feet, tops) for h in 1e-6 * np.eye(6)]) / 2e-6 / unit
            near = pose + slope * (slope @ ((near - pose) * unit) - volume(near, feet, tops)) / (slope @ slope) / unit
        exact = np.linalg.norm((near - pose) * unit)
        # Of what is left out, the second order, the curvature of the surface may be some ten over the size.
        assert abs(run.singularity_distance.values[0] / exact - 1) < 30 * exact
        seen += 1


def test_every_solver_and_size() -> None:
    """A matter of the mechanism alone: the same with every solver, and as many times as large as the mechanism."""
    case = CASES["fichter"]
    near = case.distance > 1e-6
    reference, length = distance_of(case)
    for solver in ("lapack", "gauss-jordan", "reduced"):
        np.testing.assert_array_equal(distance_of(case, solver)[0], reference)
    scene = linkdyn.Scene(case.scene, case.folder)
    rng = np.random.default_rng(2)
    q = case.q[near] + np.column_stack([rng.uniform(-0.02, 0.02, (near.sum(), 5)), np.zeros(near.sum())])
    alone = [scene.solve(q[i : i + 1], want="singularity_distance")["singularity_distance"][0] for i in range(0, len(q), 17)]
    np.testing.assert_array_equal(scene.solve(q, want="singularity_distance")["singularity_distance"][::17], alone)
    assert length > 0


def test_files_say_the_length(tmp_path: Path) -> None:
    """The executable writes the distance and by which length angles count; nothing of it unless it is wanted."""
    program = Path(linkdyn.__file__).parent / "_bin" / "linkdyn"
    scene = ROOT / "examples" / "stewart_tsai" / "scene.toml"
    for want, is_there in (("driving_force,singularity_distance", True), ("all", False)):
        out = tmp_path / f"{is_there}.nc"
        subprocess.run([program, "inverse", scene, "-o", out, "--quiet", "--want", want], check=True)
        with xr.open_dataset(out) as run:
            assert ("singularity_distance" in run) is is_there
            if is_there:
                ours = linkdyn.load(scene).inverse(want=want)
                np.testing.assert_array_equal(run.singularity_distance, ours.singularity_distance)
                assert run.singularity_distance.attrs == ours.singularity_distance.attrs
                assert run.singularity_distance.attrs["units"] == "m" and run.singularity_distance.attrs["length"] > 0


def test_failed_samples_have_none() -> None:
    run = linkdyn.Scene(CASES["dead_centre_outer"].scene).solve([[3.9], [4.1]], want="singularity_distance")
    assert np.isfinite(run["singularity_distance"][0]) and np.isnan(run["singularity_distance"][1])


def test_forward_runs_refuse_it() -> None:
    with pytest.raises(linkdyn.InputError, match="singularity_distance"):
        linkdyn.load(ROOT / "examples" / "fourbar_start" / "scene.toml").forward(0.1, want="singularity_distance")
    program = Path(linkdyn.__file__).parent / "_bin" / "linkdyn"
    scene = ROOT / "examples" / "fourbar_start" / "scene.toml"
    run = subprocess.run([program, "forward", scene, "--want", "singularity_distance"], capture_output=True, text=True, check=False)
    assert run.returncode == 2 and "singularity_distance" in run.stderr


@pytest.mark.parametrize("exponent", range(2, 9))
def test_end_of_reach(exponent: int) -> None:
    """A five-bar led by its tool: the equations are regular where an arm is stretched, but nothing goes on there."""
    scene = linkdyn.load(Path(__file__).with_name("scenes") / "fivebar_stretched.toml")
    gap = 10.0**-exponent
    height = 0.1
    q = np.array([[np.sqrt((0.6 - gap) ** 2 - height**2) - 0.05, height]])
    run = scene.inverse(q=q, want="singularity_distance")
    exact = 0.6 - np.hypot(q[0, 0] + 0.05, height)
    # Beside the first order, rounding of the reach.
    assert abs(run.singularity_distance.values[0] / exact - 1) < 20 * gap + 1e-13 / gap


@pytest.mark.parametrize("seed", [1, 11, 15, 18, 28])
def test_slides_that_run_away(seed: int) -> None:
    """RCCC linkages at the end of their reach: angles move as the root of the distance, slides without bound, and the smallest singular
    value goes as the third power of the root. Taken for a root, as which angles move, 0.56 of the distance was told."""
    scene, axis = linkage(seed)
    angles = np.linspace(0, 3.1, 400)
    beyond = np.flatnonzero(np.abs(cosine_of_closure(axis, angles)) > 1)[0]
    end = brentq(lambda angle: abs(cosine_of_closure(axis, np.array([angle]))[0]) - 1, angles[beyond - 1], angles[beyond], xtol=1e-15)
    gap = np.geomspace(end, 1e-4, 200)
    run = linkdyn.Scene(scene).inverse(q=(end - gap)[:, np.newaxis], want="singularity_distance")
    ratio = run.singularity_distance.values / (gap * run.singularity_distance.attrs["length"])
    near = gap < 1e-2
    assert near.sum() > 50 and (np.abs(ratio[near] - 1) < 2 * np.sqrt(gap[near])).all()


def delta_by_tool() -> linkdyn.Scene:
    """The robot of `examples/delta` led by the place of its platform: all loops are closed arm by arm."""
    scene = linkdyn.Builder.of(linkdyn.load(ROOT / "examples" / "delta" / "scene.toml")).to_dict()
    lead = {"link": "platform", "components": ["x", "y", "z"], "start": {"z": -0.75}}
    return linkdyn.Scene(scene | {"coordinate": [lead]})


def way_to_end_of_reach(place: np.ndarray) -> float:
    """Of the wrist of each arm from the two surfaces at the rod's length from the circle on which the elbow goes: there the arm is stretched, or folded."""
    crank, rod, radius = 0.3, 0.8, 0.2 - 0.05
    ways = []
    for angle in 2 * np.pi / 3 * np.arange(3):
        outwards = place[0] * np.cos(angle) + place[1] * np.sin(angle) - radius
        sideways = place[1] * np.cos(angle) - place[0] * np.sin(angle)
        out = np.hypot(outwards, place[2])
        ways += [rod - np.hypot(out - crank, sideways), np.hypot(out + crank, sideways) - rod]
    return min(ways)


@pytest.mark.parametrize("towards", [(0.1, 0.05, -1.0), (0.8, 0.1, -0.6), (-0.3, 0.5, -0.9), (0.1, 0.0, 0.3)])
@pytest.mark.parametrize("exponent", range(4, 9))
def test_end_of_reach_of_a_delta(towards: tuple[float, ...], exponent: int) -> None:
    """The equations are regular where an arm is stretched or folded, but nothing goes on there."""
    gap, start = 10.0**-exponent, np.array([0.1, 0.05, -0.75])
    direction = np.array(towards) / np.linalg.norm(towards)
    share = brentq(lambda s: way_to_end_of_reach(start + s * direction) - gap, 0.0, 1.0, xtol=1e-15)
    q = (start + share * direction)[np.newaxis]
    run = delta_by_tool().inverse(q=q, want="singularity_distance")
    # The margin goes as the root of the distance, and what first order leaves as the margin (here up to 25 times that root, in metres).
    assert run.status.item() == 0
    assert abs(run.singularity_distance.item() / gap - 1) < 40 * np.sqrt(gap) + 1e-13 / gap


@pytest.mark.parametrize("turn", [0.0, 0.05])
def test_angle_of_a_planar_platform_counts_by_its_size(turn: float) -> None:
    """Not by that of its base: a leg of 3-RRR comes to its end by moving and turning, the nearest place by hand."""
    base, size, crank, rod = 0.5, 0.12, 0.25, 0.3
    hips = [[base * np.cos(a), base * np.sin(a)] for a in np.radians([90, 216, 325])]
    knees = np.array([[size * np.cos(a), size * np.sin(a)] for a in np.radians([95, 210, 336])])
    scene = {
        "space": "planar",
        "frame": {"markers": {f"B{i}": p for i, p in enumerate(hips)}},
        "link": [{"name": "platform", "mass": 1, "inertia": 0.01, "markers": {f"P{i}": list(p) for i, p in enumerate(knees)}}],
        "coordinate": [{"link": "platform"}],
        "chain": [
            {"type": "RRR", "base": [f"frame.B{i}" for i in range(3)], "platform": [f"platform.P{i}" for i in range(3)], "elbow": 1, "zero": [1, 0],
             "crank": {"length": crank, "mass": 0.3}, "rod": {"length": rod, "mass": 0.2}},
        ],
    }  # fmt: skip
    cosine, sine = np.cos(turn), np.sin(turn)
    arm = np.array([[cosine, -sine], [sine, cosine]]) @ knees[0]
    way = np.array([0.28, -0.96])                                  # from the hip along the stretched leg
    gap = 1e-6
    place = np.array(hips[0]) + (crank + rod - gap) * way - arm
    run = linkdyn.Scene(scene).inverse(q=[[*place, turn]], want="singularity_distance")
    steepness = np.array([*way, (arm[0] * way[1] - arm[1] * way[0]) / size])    # of the leg's length, the angle in metres
    assert run.singularity_distance.attrs["length"] == pytest.approx(size, rel=1e-15)
    assert run.status.values == [0]
    assert run.singularity_distance.values[0] == pytest.approx(gap / np.linalg.norm(steepness), rel=1e-3)
