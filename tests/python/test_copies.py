"""Scenes copied and sent to other processes; what cannot be."""

import copy
import gc
import multiprocessing
import pickle
from pathlib import Path

import linkdyn
import numpy as np
import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
FOUR_BAR = EXAMPLES / "fourbar" / "scene.toml"
HEXAPOD = EXAMPLES / "stewart_tsai" / "scene.toml"


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda scene: pickle.loads(pickle.dumps(scene))])
def test_a_copy_outlives_what_it_is_a_copy_of(again):
    scene = linkdyn.load(FOUR_BAR)
    expected = scene.inverse()  # a scene that has been used
    other = again(scene)
    del scene
    gc.collect()
    others = [linkdyn.load(HEXAPOD) for _ in range(3)]  # take the places that are free
    np.testing.assert_array_equal(other.inverse().driving_force, expected.driving_force)
    assert other.coordinates == ("J1",) and len(others[0].coordinates) == 6


def forces(scene):
    linkdyn.load(HEXAPOD)
    return scene.inverse(want="driving_force").driving_force.values


def test_scenes_go_to_processes_that_have_others_open():
    scene = linkdyn.load(FOUR_BAR)
    with multiprocessing.get_context("spawn").Pool(1, initializer=linkdyn.load, initargs=(HEXAPOD,)) as pool:
        (found,) = pool.map(forces, [scene])
    np.testing.assert_array_equal(found, forces(scene))


def test_a_copy_finds_its_tables(tmp_path, monkeypatch):
    (tmp_path / "motion.csv").write_text("t,J1\n0,0\n1,1\n2,3\n")
    text = FOUR_BAR.read_text().replace("end = 6", "end = 2")
    begin = text.index("motion =")
    end = text.index("\n", begin)
    (tmp_path / "scene.toml").write_text(text[:begin] + 'motion = { table = "motion.csv" }' + text[end:])
    monkeypatch.chdir(tmp_path)
    kept = pickle.dumps(linkdyn.load("scene.toml"))
    monkeypatch.chdir("/")
    again = pickle.loads(kept)
    assert again.motion(2.0)[0] == pytest.approx(3.0)
    assert again.with_({"time.end": 1}).motion()[0][-1] == pytest.approx(1.0)


def test_simulators_say_that_they_stay_where_they_are():
    simulator = linkdyn.load(EXAMPLES / "fivebar_motors" / "scene.toml").simulator()
    for attempt in (copy.copy, copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match=r"a Simulator can be neither copied nor pickled"):
            attempt(simulator)
    state = simulator.state
    with pytest.raises(TypeError, match=r"a SimulatorState cannot be pickled"):
        pickle.dumps(state)
    kept = copy.deepcopy({"state": state})["state"]
    simulator.step(1e-2, [1.0, -1.0])
    there = simulator.q.copy()
    del state
    gc.collect()
    simulator.state = kept
    simulator.step(1e-2, [1.0, -1.0])
    np.testing.assert_array_equal(simulator.q, there)


def test_runs_go_to_other_processes():
    run = linkdyn.load(FOUR_BAR).inverse()
    assert pickle.loads(pickle.dumps(run)).linkdyn.worst().equals(run.linkdyn.worst())
