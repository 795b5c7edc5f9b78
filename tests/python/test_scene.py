"""Scenes and batches from Python: the doors in, what is refused and how, loads, failed samples."""

from __future__ import annotations

import ctypes
import gc
import os
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import linkdyn
from linkdyn import _bind

SPREAD = np.array([0.1, -0.2, 1.2, 0.1, -0.05, 0.2])
"""A pose away from all symmetries."""


def batch(scene: linkdyn.Scene, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses with rates and accelerations that differ from sample to sample."""
    shape = (n, len(scene.coordinates))
    wave = np.sin(np.arange(n * shape[1])).reshape(shape)
    return SPREAD + 0.05 * wave, 0.5 * wave, 2.0 * wave


def assert_but_for_rounding(got, expected) -> None:
    """Equal but for a few hundred roundings of the largest value: another lane, another order of elimination."""
    scale = 1e3 * np.finfo(float).eps * float(np.abs(expected).max())
    np.testing.assert_allclose(got, expected, rtol=0, atol=scale)


def test_names(scene):
    assert scene.coordinates == tuple(f"platform.{name}" for name in ("x", "y", "z", "roll", "pitch", "yaw"))
    assert scene.actuators == tuple(f"leg{i}.P" for i in range(1, 7))
    assert len(scene.links) == 13 and len(scene.joints) == 18
    assert not scene.planar
    assert "Tsai" in scene.title


def test_path_text_and_dict_are_one_scene(tsai_file, tsai):
    runs = [linkdyn.Scene(source).inverse() for source in (tsai_file, str(tsai_file), tsai_file.read_text(), tsai)]
    for run in runs[1:]:
        xr.testing.assert_identical(runs[0].drop_attrs(), run.drop_attrs())


def test_numpy_values_in_a_dict(tsai):
    plain = linkdyn.Scene(tsai).inverse().driving_force
    tsai["frame"]["markers"] = {name: np.array(at) for name, at in tsai["frame"]["markers"].items()}
    tsai["link"][0]["mass"] = np.float64(tsai["link"][0]["mass"])
    np.testing.assert_array_equal(linkdyn.Scene(tsai).inverse().driving_force, plain)


def test_own_motion_is_a_batch_of_its_values(scene):
    along, given = scene.inverse(), scene.inverse(*scene.motion())
    assert "time" in along.coords and "time" not in given.coords
    for name in ("driving_force", "reaction", "joint_rate"):
        np.testing.assert_array_equal(along[name], given[name])


def test_derivatives_default_to_zero(scene):
    q, _, _ = batch(scene, 5)
    zero = np.zeros_like(q)
    np.testing.assert_array_equal(scene.inverse(q).driving_force, scene.inverse(q, zero, zero).driving_force)


def test_layout_of_arrays_does_not_matter(scene):
    q, qd, qdd = batch(scene, 40)
    expected = scene.inverse(q, qd, qdd).reaction
    np.testing.assert_array_equal(scene.inverse(np.asfortranarray(q), qd[:, :], qdd.tolist()).reaction, expected)
    assert_but_for_rounding(scene.inverse(q[::-1], qd[::-1], qdd[::-1]).reaction[::-1], expected)


def test_samples_do_not_depend_on_their_block(scene, monkeypatch):
    q, qd, qdd = batch(scene, 101)
    w = np.sin(np.arange(606.0)).reshape(101, 6)
    expected = scene.inverse(q, qd, qdd, wrench={"platform.center": w})
    monkeypatch.setattr("linkdyn.scene.BLOCK", 17)
    got = scene.inverse(q, qd, qdd, wrench={"platform.center": w}, threads=2)
    for name in ("driving_force", "reaction"):
        assert_but_for_rounding(got[name], expected[name])


@pytest.mark.parametrize("solver", ["elimination", "lapack", "gauss-jordan", "reduced"])
def test_threads_do_not_change_a_bit(scene, solver):
    q, qd, qdd = batch(scene, 1001)
    runs = [scene.solve(q, qd, qdd, want=None, solver=solver, threads=n) for n in (1, 2, 3)]
    assert set(runs[0]) >= {"driving_force", "power_imbalance", "status"}
    for run in runs[1:]:
        for name, values in runs[0].items():
            np.testing.assert_array_equal(run[name], values, err_msg=name)


def test_scene_serves_several_python_threads_at_once(scene):
    """The equations are planned once, scratch is shared out: no batch may see another's."""
    q, qd, qdd = batch(scene, 400)
    expected = scene.inverse(q, qd, qdd, solver="lapack")

    def one_after_another(first: int) -> list[np.ndarray]:
        return [linkdyn_scene.solve(q[i : i + 1], qd[i : i + 1], qdd[i : i + 1], want="reaction")["reaction"][0]
                for i in range(first, 400, 4)]

    linkdyn_scene = linkdyn.Scene(scene.text)    # nothing planned yet
    with ThreadPoolExecutor(4) as pool:
        for first, values in enumerate(pool.map(one_after_another, range(4))):
            assert_but_for_rounding(values, expected.reaction[first::4])


def test_blas_threads_are_as_before(scene):
    """The engine holds BLAS to one thread while it computes, also when several batches overlap."""
    try:
        blas = ctypes.CDLL("libopenblas.so.0", mode=os.RTLD_NOLOAD)    # the one that the engine has loaded
    except OSError:
        pytest.skip("another BLAS")
    before, seen = blas.openblas_get_num_threads(), set()
    q, qd, qdd = batch(scene, 64)
    try:
        blas.openblas_set_num_threads(2)
        if blas.openblas_get_num_threads() != 2:
            pytest.skip("a BLAS of one thread")
        with ThreadPoolExecutor(3) as pool:
            runs = [pool.submit(scene.solve, q, qd, qdd, solver="lapack") for _ in range(12)]
            while not all(run.done() for run in runs):
                seen.add(blas.openblas_get_num_threads())
        assert 1 in seen and blas.openblas_get_num_threads() == 2
    finally:
        blas.openblas_set_num_threads(before)


def test_solve_gives_the_arrays_of_inverse(scene):
    q, qd, qdd = batch(scene, 21)
    wrench = {"platform.center": np.arange(6.0)}
    run = scene.inverse(q, qd, qdd, wrench=wrench)
    arrays = scene.solve(q, qd, qdd, wrench=wrench, want="all")
    assert set(arrays) == set(run.data_vars) - {"q", "qd", "qdd", "wrench"}
    for name, values in arrays.items():
        np.testing.assert_array_equal(values, run[name])
        assert values.dtype == run[name].dtype
    assert set(scene.solve(q)) == {"driving_force", "status"}
    again = scene.solve(q, qd, qdd, wrench=wrench, want="all")
    assert not any(np.shares_memory(again[name], arrays[name]) for name in arrays)


def test_one_pose_is_one_call(scene, monkeypatch):
    """The light door plans nothing anew, describes nothing and builds no Dataset: once it was opened, a pose is one call of the
    engine."""
    called = []

    class Counting:
        def __getattr__(self, name):
            called.append(name)
            return getattr(engine, name)

    engine = _bind._api
    q, qd, qdd = batch(scene, 1)
    scene.solve(q, qd, qdd)
    monkeypatch.setattr(_bind, "_api", Counting())
    monkeypatch.setattr(xr, "Dataset", None)
    for _ in range(3):
        scene.solve(q, qd, qdd)
    assert called == ["api_inverse"] * 3


def test_reduced_gives_all_but_the_reactions(scene):
    q, qd, qdd = batch(scene, 5)
    assert set(scene.solve(q, qd, qdd, want=None)) - set(scene.solve(q, qd, qdd, want=None, solver="reduced")) == {"reaction"}
    with pytest.raises(linkdyn.InputError, match="'reduced' has no reactions"):
        scene.solve(q, want="all", solver="reduced")


def test_loads_at_other_markers_come_and_go(scene):
    q = np.tile(SPREAD, (2, 1))
    plain = scene.solve(q)["driving_force"]
    forces = [scene.solve(q, wrench={marker: np.ones(6)})["driving_force"] for marker in ("platform.center", "platform.P1")]
    assert np.abs(forces[0] - forces[1]).max() > 1e-3
    np.testing.assert_array_equal(scene.solve(q, wrench={"platform.center": np.ones(6)})["driving_force"], forces[0])
    np.testing.assert_array_equal(scene.solve(q)["driving_force"], plain)


def test_only_what_is_wanted(scene):
    q, qd, qdd = batch(scene, 3)
    everything = scene.inverse(q, qd, qdd)
    base = {"q", "qd", "qdd", "status"}
    for want, names in (
        ("driving_force", {"driving_force"}),
        (["reaction"], {"reaction"}),
        ("power", {"driving_speed", "driving_power"}),
        (("driving_force", "joint_variable"), {"driving_force", "joint_variable", "joint_rate"}),
        ("checks", {"power_imbalance"}),
        ("rcond", {"rcond"}),
    ):
        run = scene.inverse(q, qd, qdd, want=want)
        assert set(run.data_vars) == base | names
        for name in names - {"power_imbalance", "rcond"}:
            assert_but_for_rounding(run[name], everything[name])


def test_power_is_force_times_speed(scene):
    run = scene.inverse(*batch(scene, 4))
    speed = run.joint_rate.sel(variable=[f"leg{i}.P.slide" for i in range(1, 7)]).values
    np.testing.assert_array_equal(run.driving_speed, speed)
    np.testing.assert_array_equal(run.driving_power, run.driving_force.values * speed)


def test_wrench_acts_like_a_declared_load(scene, tsai):
    q, qd, qdd = batch(scene, 3)
    wrench = np.array([10.0, -20.0, 30.0, 4.0, 5.0, -6.0])
    tsai["load"] = [{"on": "platform.P2", "force": wrench[:3], "moment": wrench[3:]}]
    declared = linkdyn.Scene(tsai).inverse(q, qd, qdd)
    for values in (wrench, np.tile(wrench, (3, 1))):
        given = scene.inverse(q, qd, qdd, wrench={"platform.P2": values})
        np.testing.assert_array_equal(given.driving_force, declared.driving_force)
        np.testing.assert_array_equal(given.reaction, declared.reaction)
    assert np.abs(declared.driving_force - scene.inverse(q, qd, qdd).driving_force).max() > 1.0


def test_declared_loads_act_at_t(tsai):
    tsai["load"] = [{"on": "platform.center", "force": [0.0, 0.0, {"law": "constant-rate", "start": 1.0, "rate": 2.0}]}]
    scene = linkdyn.Scene(tsai)
    q = np.tile(SPREAD, (3, 1))
    force = scene.inverse(q, t=[0.0, 1.0, 2.0]).driving_force.values
    np.testing.assert_array_equal(scene.inverse(q).driving_force.values, np.tile(force[0], (3, 1)))
    # statics is linear in the load
    np.testing.assert_allclose(force[2] - force[1], force[1] - force[0], rtol=1e-10)
    assert np.abs(force[1] - force[0]).max() > 0.1


def test_failed_sample_is_flagged_and_its_neighbours_are_untouched(crossing):
    scene = linkdyn.Scene(crossing)
    run = scene.inverse()
    failed = run.status.values != 0
    np.testing.assert_array_equal(failed, [False, False, True, False, False])
    for name in ("driving_force", "reaction", "driving_power"):
        values = run[name].values.reshape(5, -1)
        np.testing.assert_array_equal(np.isnan(values).all(axis=1), failed)
        np.testing.assert_array_equal(np.isnan(values).any(axis=1), failed)
    q, qd, qdd = scene.motion()
    alone = scene.inverse(q[~failed], qd[~failed], qdd[~failed])
    assert_but_for_rounding(alone.reaction, run.reaction[~failed])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"q": np.zeros((6, 3))}, r"q: expected shape \(N, 6\), got \(6, 3\)"),
        ({"q": np.zeros(6)}, r"q: expected shape \(N, 6\), got \(6,\); q\[None\] is one sample$"),
        ({"q": np.ones((2, 6)), "qd": np.zeros((3, 6))}, r"qd: expected shape \(2, 6\), got \(3, 6\)"),
        ({"q": np.ones((2, 6)), "qdd": np.zeros((2, 5))}, r"qdd: expected shape \(2, 6\), got \(2, 5\)"),
        ({"q": np.ones((2, 6), dtype=complex)}, "q: expected real numbers .*complex128"),
        ({"q": np.ones((2, 6), dtype=bool)}, "q: expected real numbers .*bool"),
        ({"q": np.ones((2, 6), dtype=object)}, "q: expected real numbers .*object"),
        ({"q": [["a"] * 6]}, "q: expected real numbers"),
        ({"q": [[1.0, 2.0], [1.0]]}, "q: expected an array of numbers"),
        ({"qd": np.zeros((2, 6))}, "given without q"),
        ({"q": np.ones((2, 6)), "wrench": {"platform.center": np.ones((2, 3))}}, r"wrench\['platform.center'\]: expected"),
        ({"q": np.ones((2, 6)), "wrench": {"platform.centre": np.ones(6)}}, "no marker 'platform.centre'.*platform.center"),
        ({"q": np.ones((2, 6)), "wrench": {3: np.ones(6)}}, "expected marker names"),
        ({"q": np.ones((2, 6)), "want": "forces"}, "'forces' is not a result"),
        ({"q": np.ones((2, 6)), "solver": "lapak"}, "lapak.*lapack"),
        ({"q": np.ones((2, 6)), "threads": 0}, "threads: expected a whole number"),
        ({"q": np.ones((2, 6)), "threads": True}, "threads: expected a whole number"),
        ({"q": np.ones((2, 6)), "t": [0.0, 1.0, 2.0]}, r"t: expected one instant or shape \(2,\)"),
        ({"t": [0.0, np.nan]}, r"t\[1\] is not a finite number"),
    ],
)
def test_wrong_arguments_are_refused_by_name(scene, arguments, message):
    with pytest.raises(linkdyn.InputError, match=message):
        scene.inverse(**arguments)
    if "q" in arguments:
        with pytest.raises(linkdyn.InputError, match=message):
            scene.solve(**arguments)


@pytest.mark.parametrize("name", ["q", "qd", "qdd"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused_by_name_and_place(scene, monkeypatch, name, bad):
    monkeypatch.setattr("linkdyn.scene.BLOCK", 4)
    arguments = dict(zip(("q", "qd", "qdd"), batch(scene, 10)))
    arguments[name][7, 2] = bad
    with pytest.raises(linkdyn.InputError, match=rf"^{name}\[7, 2\] \(coordinate 'platform.z'\) is not a finite number"):
        scene.inverse(**arguments)


def test_wrench_that_is_not_finite(scene):
    wrench = np.zeros((4, 6))
    wrench[3, 1] = np.nan
    with pytest.raises(linkdyn.InputError, match="'platform.center': sample 3"):
        scene.inverse(np.tile(SPREAD, (4, 1)), wrench={"platform.center": wrench})


def test_scene_errors_carry_the_readers_message(tsai, tmp_path):
    del tsai["link"][0]["mass"]
    with pytest.raises(linkdyn.SceneError, match=r"^scene\['link'\]\[0\]: link 'platform': missing key 'mass'"):
        linkdyn.Scene(tsai)
    file = tmp_path / "wrong.toml"
    file.write_text('title = "x"\nspace = "curved"\n')
    with pytest.raises(linkdyn.SceneError, match=r"wrong\.toml:2: .*curved"):
        linkdyn.load(file)


def test_missing_file_and_wrong_source():
    with pytest.raises(FileNotFoundError, match=r"^no_such_scene\.toml: there is no such file$") as caught:
        linkdyn.load("no_such_scene.toml")
    assert isinstance(caught.value, linkdyn.FileError)
    with pytest.raises(linkdyn.InputError, match="expected a path, a text or a dict"):
        linkdyn.Scene(3)


def test_no_samples_at_all(scene):
    run = scene.inverse(np.zeros((0, 6)))
    assert run.sizes["sample"] == 0 and run.reaction.shape == (0, 18, 6)
    assert scene.poses(np.zeros((0, 6))).position.shape == (0, 13, 3)


def test_poses_put_the_platform_where_it_is_told(scene):
    q = np.array([[0.5, -0.25, 1.25, 0.0, 0.0, np.pi / 2], SPREAD])
    poses = scene.poses(q)
    platform = scene.links.index("platform")
    np.testing.assert_array_equal(poses.position[:, platform], q[:, :3])
    # one rounding of cos(pi/2)
    np.testing.assert_allclose(
        poses.rotation[0, platform], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=2 * np.finfo(float).eps
    )
    np.testing.assert_allclose(
        poses.rotation @ poses.rotation.swapaxes(-1, -2), np.broadcast_to(np.eye(3), poses.rotation.shape), atol=1e-14
    )
    assert scene.poses(SPREAD).position.shape == (1, 13, 3)


def test_poses_need_no_actuators(tsai):
    posed = linkdyn.Scene(tsai).poses(SPREAD)
    tsai["chain"][0]["actuated"] = False
    scene = linkdyn.Scene(tsai)
    assert scene.actuators == ()
    np.testing.assert_array_equal(scene.poses(SPREAD).position, posed.position)
    np.testing.assert_array_equal(scene.poses(SPREAD).rotation, posed.rotation)
    with pytest.raises(linkdyn.InputError, match="actuator"):
        scene.solve(SPREAD[np.newaxis])


def test_explain_names_what_is_solved(scene):
    text = scene.explain()
    for name in (*scene.links, *scene.joints):
        assert name in text


def test_scenes_are_closed_with_their_objects(tsai_file):
    from linkdyn import _bind

    scene = linkdyn.load(tsai_file)
    handle = scene._handle
    del scene
    gc.collect()
    with pytest.raises(linkdyn.ClosedSceneError):
        _bind.explain(handle, False)


# ---------------------------------------------------------------- planar scenes


@pytest.fixture(scope="module")
def fivebar() -> linkdyn.Scene:
    return linkdyn.load(Path(__file__).resolve().parents[2] / "examples" / "fivebar_parallel" / "scene.toml")


def test_planar_wrench_has_three_components(fivebar):
    q = fivebar.motion(0.3)[0]
    pushed = fivebar.inverse(q=q, wrench={"rod1.J3": [3.0, 0.0, 0.5]})
    one_each = fivebar.inverse(q=q, wrench={"rod1.J3": [[3.0, 0.0, 0.5]]})
    np.testing.assert_array_equal(pushed.driving_force, one_each.driving_force)
    assert not np.array_equal(pushed.driving_force, fivebar.inverse(q=q).driving_force)
    assert list(pushed.component.values) == ["Fx", "Fy", "Mz"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"q": [[1.0]]}, r"q: expected shape \(N, 2\), got \(1, 1\)"),
        ({"q": [1.0, 2.0]}, r"q: expected shape \(N, 2\), got \(2,\)"),
        ({"q": [[1.0, 2.0]], "qd": [[0.0, 0.0]] * 2}, r"qd: expected shape \(1, 2\), got \(2, 2\)"),
        ({"q": [[1.0, 2.0j]]}, "q: expected real numbers"),
        ({"q": [[1.0, np.nan]]}, r"q\[0, 1\] \(coordinate 'J5'\) is not a finite number"),
        ({"q": [[1.0, 2.0]], "wrench": {"rod1.J3": [0.0] * 6}}, r"expected shape \(1, 3\) or \(3,\), got \(6,\)"),
        ({"q": [[1.0, 2.0]], "wrench": {"rod1.J3": [[0.0] * 3] * 2}}, r"expected shape \(1, 3\) or \(3,\), got \(2, 3\)"),
        ({"q": [[1.0, 2.0]], "wrench": {"rod1.J4": [0.0] * 3}}, "no marker 'rod1.J4'"),
        ({"q": [[1.0, 2.0]], "wrench": {"rod1.J3": [np.inf, 0.0, 0.0]}}, "is not a finite number"),
        ({"qd": [[1.0, 2.0]]}, "qd, qdd: given without q"),
    ],
)
def test_planar_input_that_is_wrong(fivebar, arguments, message):
    with pytest.raises(linkdyn.InputError, match=message):
        fivebar.inverse(**arguments)


def test_planar_poses(fivebar):
    with pytest.raises(linkdyn.InputError, match=r"q: expected shape \(N, 2\) or \(2,\), got \(3,\)"):
        fivebar.poses([1.0, 2.0, 3.0])
    poses = fivebar.poses([[1.0, 2.2], [0.6, 1.8]])
    tips = poses.position[:, 1] - poses.position[:, 2]  # J3 of rod1, J4 of rod2
    np.testing.assert_allclose(np.linalg.norm(tips, axis=1), 0.6, rtol=1e-15)


def test_poses_in_order_go_through_change_points():
    """A parallelogram's follower: alone on the branch of the start, in order parallel to the crank."""
    links = [
        {"name": name, "markers": {"a": [0.0, 0.0], "b": [length, 0.0]}, "mass": 1.0, "inertia": 1.0}
        for name, length in (("crank", 1.0), ("coupler", 2.0), ("follower", 1.0))
    ]
    ends = [("frame.O", "crank.a"), ("crank.b", "coupler.a"), ("coupler.b", "follower.b"), ("frame.C", "follower.a")]
    joints = [{"name": f"J{k}", "type": "revolute", "between": list(pair)} for k, pair in enumerate(ends)]
    scene = linkdyn.Scene(
        {
            "space": "planar",
            "frame": {"markers": {"O": [0.0, 0.0], "C": [2.0, 0.0]}},
            "link": links,
            "joint": [joint | ({"branch": 1} if joint["name"] == "J2" else {}) for joint in joints],
            "coordinate": [{"joint": "J0"}],
        }
    )
    q = np.linspace(0.5, 6.0, 50)[:, np.newaxis]
    past = q[:, 0] > np.pi
    for in_order, crossed in ((True, False), (False, True)):
        poses = scene.poses(q, in_order=in_order)
        parallel = np.abs(poses.rotation[:, 2] - poses.rotation[:, 0]).max(axis=(1, 2)) < 1e-9
        assert parallel[~past].all() and parallel[past].all() == (not crossed)


def test_equations_written_out(fivebar):
    report, full = fivebar.explain(), fivebar.explain(matrix=True)
    assert full.startswith(report) and len(full) > len(report)
    for text in ("In symbols", "In numbers", "J1 Fx", "crank2 Mz", "yG-yJ"):
        assert text in full[len(report) :], text


def test_equations_written_out_of_what_is_driven_too_little_or_too_much():
    """As many columns as unknowns; rows are named by what stands in them, one in which nothing is unknown is none."""

    def table(text: str) -> list[list[str]]:
        return [line[24:].split()[:-1] for line in text.split("In numbers (SI units)\n")[1].splitlines()[1:]]

    def two_hinges(motors: list[str]) -> linkdyn.Scene:
        links = [{"name": name, "markers": {"o": [0, 0], "p": [1, 0]}, "cog": [0.5, 0], "mass": 1} for name in ("left", "right")]
        joints = [{"name": name, "type": "revolute", "between": ["frame.O", f"{name}.o"]} for name in ("left", "right")]
        scene = {"space": "planar", "frame": {"markers": {"O": [0, 0]}}, "link": links, "joint": joints, "gravity": [0, -10]}
        scene["coordinate"] = [{"joint": name} for name in ("left", "right")]
        scene["actuator"] = [{"name": f"motor{k}", "joint": name} for k, name in enumerate(motors)]
        return linkdyn.Scene(scene)

    few = two_hinges(["right"]).explain(matrix=True)
    assert [len(row) for row in table(few)] == 6 * [5]
    assert table(few)[2][-1] == "." and float(table(few)[5][-1]) == 1      # no drive turns the left one
    middles = linkdyn.Scene(
        {
            "space": "planar",
            "frame": {"markers": {"O": [0, 0]}},
            "link": [{"name": name, "markers": {"o": [0, 0]}, "mass": 1, "inertia": 1} for name in ("left", "right")],
            "joint": [{"name": name, "type": "revolute", "between": ["frame.O", f"{name}.o"]} for name in ("left", "right")],
            "coordinate": [{"joint": name} for name in ("left", "right")],
            "actuator": [{"joint": "right"}],
        }
    ).explain(matrix=True)
    assert [len(row) for row in table(middles)] == 5 * [5]
    assert "left Mz" not in middles.split("In numbers")[1]
    many = two_hinges(["left", "right", "right"]).explain(matrix=True)
    assert [len(row) for row in table(many)] == 6 * [7]
    assert [row[-2:] for row in table(many)] == 5 * [[".", "."]] + [["1.0000", "1.0000"]]


def test_more_laws_than_coordinates_and_loads():
    """Each has a course of its own; those that share one are told apart by their sizes."""

    def law(size: float, end: float) -> dict:
        return {"law": "cycloidal", "times": [0.0, end], "values": [0.0, size]}

    def arm(sizes: list[float], ends: list[float]) -> xr.Dataset:
        names = ("x", "y", "yaw")
        return linkdyn.Scene({
            "space": "planar",
            "frame": {"markers": {"O": [0, 0]}, "motion": {name: law(s, e) for name, s, e in zip(names, sizes, ends)}},
            "link": [{"name": "arm", "mass": 1, "inertia": 0.1, "cog": [0.5, 0], "markers": {"O": [0, 0]}}],
            "joint": [{"name": "O", "type": "revolute", "between": ["frame.O", "arm.O"]}],
            "coordinate": [{"joint": "O", "motion": law(1.0, 2.0)}],
            "actuator": [{"joint": "O"}],
            "payload": [{"on": "arm.O", "mass": law(0.5, 0.7)}],
            "time": {"end": 2.0, "samples": 9},
        }).inverse()

    run = arm([0.3, 0.2, 0.1], [2.0, 1.0, 1.5])
    assert np.all(run.status == 0)
    alone = [arm([size if i == k else 0.0 for i in range(3)], [2.0, 1.0, 1.5]).driving_force for k, size in enumerate((0.3, 0.2))]
    still = arm([0.0, 0.0, 0.0], [2.0, 1.0, 1.5]).driving_force
    both = arm([0.3, 0.2, 0.0], [2.0, 1.0, 1.5]).driving_force
    np.testing.assert_allclose(both - still, sum(one - still for one in alone), atol=1e-13)


@pytest.mark.parametrize("name", ["cycle", "efforts", "errors", "laws", "lecture", "plot", "results", "scene", "simulator", "study", "sweep"])
def test_modules_list_what_there_is_for_users(name: str) -> None:
    """Not what they import."""
    module = import_module(f"linkdyn.{name}")
    assert dir(module) == sorted(module.__all__)
