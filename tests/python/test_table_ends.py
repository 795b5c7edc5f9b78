"""Tables say nothing beyond their rows: who would hear one there is refused before anything is computed, by name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from linkdyn.errors import InputError, SceneError

MOTOR = {"lead": 0.01, "rotor_inertia": 1e-3, "torque_constant": 0.5, "resistance": 0.6}
INVERSE = [{"joint": "g", "law": {"type": "inverse"}}]
MEASURES = {"x": {"joint": "g"}, "y": {"marker": "car.P", "component": "y"}}


def table(column: str, **keys: Any) -> dict[str, Any]:
    """Half a second of a column."""
    return {"law": "table", "table": "short.csv", "column": column, **keys}


def over(argument: str, **keys: Any) -> dict[str, Any]:
    """A force that is known between -50 and 50 mm, or for half a second."""
    name = {"time": "short.csv"}.get(argument, "stroke.csv")
    return {"table": name, "column": "F", "over": argument, "argument": "t" if argument == "time" else "x", **keys}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Tables of half a second, and of a stroke."""
    (tmp_path / "short.csv").write_text("t,F [N],y [m],U [V],m [kg]\n0,0,0,0,10\n0.25,50,0.05,20,15\n0.5,100,0.1,40,20\n")
    (tmp_path / "stroke.csv").write_text("x [mm],F [N]\n-50,0\n50,100\n")
    return tmp_path


def lift(folder: Path, **tables: Any) -> linkdyn.Scene:
    """A car in a vertical guide."""
    data = {
        "space": "planar",
        "gravity": [0, -9.81],
        "frame": {"markers": {"O": {"at": [0, 0], "axis": [0, 1]}}},
        "link": [{"name": "car", "mass": 100.0, "inertia": 1.0, "markers": {"P": {"at": [0, 0], "axis": [0, 1]}}}],
        "joint": [{"name": "g", "type": "prismatic", "between": ["frame.O", "car.P"]}],
        "coordinate": [{"joint": "g", "start": 0.0}],
    }
    return linkdyn.Scene({**data, **tables}, folder=folder)


PARTS: dict[str, tuple[str, dict[str, Any]]] = {
    "load": ("load on 'car.P': its table", {"load": [{"on": "car.P", "force": [0, table("F")]}]}),
    "law in a formula": (
        "load on 'car.P': the table of law 'f'",
        {"laws": {"f": over("time")}, "load": [{"on": "car.P", "force": [0, "2*f"]}]},
    ),
    "actuator": ("actuator 'g': its table", {"actuator": [{"joint": "g", "law": {"type": "table", "table": "short.csv", "column": "F"}}]}),
    "voltage": (
        "actuator 'g': its table",
        {"actuator": [{"joint": "g", "law": {"type": "voltage", "value": table("U")}, "drive": MOTOR}]},
    ),
    "pd": ("actuator 'g': its table", {"actuator": [{"joint": "g", "law": {"type": "pd", "stiffness": 1e4, "target": table("y")}}]}),
    "controller": (
        "controller 'g', target: its table",
        {"actuator": [{"joint": "g"}], "controller": [{"actuator": "g", "kp": 1e3, "target": table("y")}]},
    ),
    "feed_forward": (
        "controller 'g', feed_forward: its table",
        {"actuator": [{"joint": "g"}], "controller": [{"actuator": "g", "kp": 1.0, "target": 0.0, "feed_forward": table("F")}]},
    ),
    "clutch": ("clutch 'c', capacity: its table", {"clutch": [{"name": "c", "joint": "g", "capacity": table("F")}]}),
    "payload": ("payload on 'car.P': its table", {"payload": [{"on": "car.P", "mass": table("m")}]}),
    "frame": ("motion of the frame: its table", {"frame_motion": table("y")}),
    "driven": ("coordinate 'g': its table", {"coordinate": [{"joint": "g", "driven": True, "motion": table("y")}], "actuator": INVERSE}),
    "inverse": ("coordinate 'g': its table", {"coordinate": [{"joint": "g", "motion": table("y")}], "actuator": INVERSE}),
    "controller along the motion": (
        "controller 'g', target: its table",
        {
            "coordinate": [{"joint": "g", "motion": table("y")}],
            "actuator": [{"joint": "g"}],
            "controller": [{"actuator": "g", "kp": 1e3, "target": "motion"}],
        },
    ),
}
STEPPED = ["load", "law in a formula", "controller", "feed_forward", "clutch", "payload", "frame", "controller along the motion"]
HALF = {"end": 0.5, "samples": 11}
SHORT = " covers 0 s to 0.5 s (expected 0 s to 1 s, the time of the run)"


def scene_of(part: str, folder: Path) -> linkdyn.Scene:
    """The car with one of the parts."""
    tables = dict(PARTS[part][1])
    motion = tables.pop("frame_motion", None)
    if motion is not None:
        tables["frame"] = {"markers": {"O": {"at": [0, 0], "axis": [0, 1]}}, "motion": {"y": motion}}
    return lift(folder, time=HALF, **tables)


@pytest.mark.parametrize("part", PARTS)
def test_a_run_beyond_a_table_is_refused(part: str, folder: Path) -> None:
    """By the part, the table's range and that of the run; up to the table's end it goes."""
    scene = scene_of(part, folder)
    run = scene.forward(t=np.linspace(0.0, 0.5, 6))
    assert not run.attrs["stopped"]
    assert not run.status.any()
    with pytest.raises(InputError) as refused:
        scene.forward(t=np.linspace(0.0, 1.0, 11))
    assert PARTS[part][0] + SHORT in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("part", ["load", "law in a formula", "actuator", "controller", "payload"])
def test_an_ensemble_beyond_a_table_is_refused(part: str, folder: Path) -> None:
    """As a single run is."""
    scene = scene_of(part, folder)
    assert not scene.ensemble([[0.0]], [[0.0]], np.linspace(0.0, 0.5, 6)).status.any()
    with pytest.raises(InputError) as refused:
        scene.ensemble([[0.0]], [[0.0]], np.linspace(0.0, 1.0, 11))
    assert PARTS[part][0] + SHORT in str(refused.value)


@pytest.mark.parametrize("part", STEPPED)
def test_a_step_that_leaves_a_table_is_refused(part: str, folder: Path) -> None:
    """The simulator stands where it stood, and takes a step that stays."""
    scene = scene_of(part, folder)
    simulator = scene.simulator()
    force = [0.0] * len(scene.actuators)
    simulator.step(0.4, force)
    before = simulator.t, simulator.q.copy(), simulator.qd.copy()
    with pytest.raises(InputError) as refused:
        simulator.step(0.4, force)
    words = " covers 0 s to 0.5 s (expected 0.4 s to 0.8 s, the time of the step)"
    assert PARTS[part][0] + words in str(refused.value)
    assert simulator.t == before[0]
    assert (simulator.q == before[1]).all()
    assert (simulator.qd == before[2]).all()
    simulator.step(0.1, force)
    assert simulator.t == pytest.approx(0.5)


def test_steps_that_add_up_to_a_tables_end(folder: Path) -> None:
    """What rounding adds to five hundred of them is no step beyond."""
    simulator = scene_of("load", folder).simulator()
    for _ in range(500):
        simulator.step(1e-3, [])
    assert simulator.t == pytest.approx(0.5)
    with pytest.raises(InputError, match="its table covers"):
        simulator.step(1e-3, [])


def test_instants_of_inverse_dynamics_beyond_a_table(folder: Path) -> None:
    """Those of a call, and those of a sweep."""
    motion = [{"joint": "g", "motion": {"law": "harmonic", "amplitude": 0.1, "frequency": 3.0}}]
    scene = lift(folder, coordinate=motion, actuator=INVERSE, time=HALF, load=[{"on": "car.P", "force": [0, table("F")]}])
    assert not scene.inverse(t=[0.0, 0.5]).status.any()
    with pytest.raises(InputError, match=r"load on 'car.P': its table covers 0 s to 0.5 s \(expected 0 s to 1 s"):
        scene.inverse(t=[0.0, 1.0])
    sweep = {"reduce": ["driving_force"], "axis": [{"time": True, "linspace": [0, 2.0, 21]}]}
    with pytest.raises(SceneError, match=r"load on 'car.P': its table covers 0 s to 0.5 s \(expected 0 s to 2 s, the time of the sweep"):
        scene.sweep(sweep=sweep)


def test_what_is_not_heard_may_be_short(folder: Path) -> None:
    """A motion that free coordinates only begin on, what is off beyond, what begins anew."""
    t = np.linspace(0.0, 1.0, 11)
    off = {"name": "c", "joint": "g", "capacity": table("F"), "until": 0.5}
    for tables in (
        {"coordinate": [{"joint": "g", "motion": table("y")}]},
        {"clutch": [off]},
        {"payload": [{"on": "car.P", "mass": table("m"), "until": 0.5}]},
        {"laws": {"f": over("time", period=0.6)}, "load": [{"on": "car.P", "force": [0, "f"]}]},
    ):
        run = lift(folder, time=HALF, **tables).forward(t=t)
        assert not run.attrs["stopped"]
        assert not run.status.any()


@pytest.mark.parametrize("where", ["load", "formula", "spring"])
def test_a_table_that_the_motion_leaves(where: str, folder: Path) -> None:
    """Over a coordinate that has a motion: in a load, through a law and a formula, in a spring."""
    motion = [{"joint": "g", "motion": {"law": "harmonic", "amplitude": 0.1, "frequency": 3.0}}]
    tables: dict[str, Any] = {
        "load": {"load": [{"on": "car.P", "force": [0, over("x")]}]},
        "formula": {"laws": {"f": over("x")}, "load": [{"on": "car.P", "force": [0, "-f"]}]},
        "spring": {"spring": [{"name": "s", "joint": "g", "force": over("x")}]},
    }[where]
    words = {
        "load": "load on 'car.P': its table covers",
        "formula": "load on 'car.P': the table of law 'f' covers",
        "spring": "spring 's': its table covers",
    }[where]
    keys = {"coordinate": motion, "actuator": INVERSE, "measures": MEASURES, **tables}
    with pytest.raises(SceneError) as refused:
        lift(folder, time={"end": 2.0, "samples": 401}, **keys)
    assert words + " x = -0.05 to 0.05 m (expected -0.1 to" in str(refused.value)
    lift(folder, time={"end": 0.1, "samples": 11}, **keys)


def test_a_law_that_an_if_leaves_out_is_not_asked(folder: Path) -> None:
    """Where its table ends another branch begins: nothing is refused, and every sample has a value."""
    motion = [{"joint": "g", "motion": {"law": "harmonic", "amplitude": 0.1, "frequency": 3.0}}]
    load = [{"on": "car.P", "force": [0, "if(0.05 m - abs(x), f, 0 N)"]}]
    scene = lift(folder, coordinate=motion, actuator=INVERSE, measures=MEASURES, laws={"f": over("x")}, load=load, time={"end": 2.0})
    assert not scene.inverse().status.any()


def test_a_run_that_a_law_ends_is_undefined(folder: Path) -> None:
    """Its samples beyond say so, as the words do."""
    scene = lift(folder, measures=MEASURES, load=[{"on": "car.P", "force": [0, over("y")]}])
    run = scene.forward(t=np.linspace(0.0, 1.0, 11))
    assert "is outside its table" in run.attrs["stopped"]
    assert set(run.status.values[~np.isfinite(run.q.values[:, 0])]) == {4}
