"""Scenes built in Python: the same dict, the same bits, the words of the reader and of its page and no others."""

from __future__ import annotations

import inspect
import re
import tomllib
import typing
from pathlib import Path

import numpy as np
import pytest
from linkdyn import _scene_types

import linkdyn
from linkdyn import Builder, efforts, laws
from linkdyn._builder import Frame, Link
from linkdyn._toml import as_toml

ROOT = Path(__file__).resolve().parents[2]
SCENES = sorted([*ROOT.glob("examples/*/scene*.toml"), *ROOT.glob("tests/scenes/*.toml"), *ROOT.glob("python/linkdyn/_scenes/*.toml")])
RUN = ("fourbar", "delta", "geared_fivebar", "planetary_crank", "screw_lift", "toggle_clamp", "four_stroke", "shaper", "knuckle_press", "ship_hexapod",
       "stewart_drilling", "stopped_rocker", "agile_eye", "tripod", "controlled_arm", "scene_forward", "hexapod", "excavator")
JOINTS = ("revolute", "prismatic", "cylindrical", "universal", "planar", "screw", "fixed", "gear", "rack", "belt", "slot", "cam", "spherical")
PATTERN = {"repeat", "about", "angles", "mirror"}


# ----------------------------------------------------------------------------------------- every scene, by the methods alone
def in_python(key):
    return "from_" if key == "from" else key


def call(method, table, **given):
    """A method with the keys of a table."""
    return method(**{in_python(key): value for key, value in table.items()}, **given)


def law_by_function(value):
    """A law given by a table, by the function of its name."""
    if isinstance(value, dict) and (name := value.get("law", "table" if "table" in value else None)):
        return call(getattr(laws, name.replace("-", "_")), {key: item for key, item in value.items() if key != "law"})
    return value


def motion_by_functions(motion, is_pose):
    if is_pose and isinstance(motion, dict) and "table" not in motion:
        return {component: law_by_function(law) for component, law in motion.items()}
    return motion if is_pose else law_by_function(motion)


def built(content):
    """The scene once more, by methods of the builder."""
    top = {key: value for key, value in content.items() if key in inspect.signature(Builder).parameters}
    b = Builder(**top)
    for name, value in content.get("variables", {}).items():
        assert b.variable(name, value) == name
    for name, value in content.get("measures", {}).items():
        call(b.measure, value, name=name)
    for name, value in content.get("laws", {}).items():
        b.law(name, value)
    put_markers(b.frame, content.get("frame", {}).get("markers", {}))
    if motion := content.get("frame", {}).get("motion"):
        b.frame.motion(**{key: law_by_function(value) if key in ("x", "y", "z", "roll", "pitch", "yaw") else value for key, value in motion.items()})
    for table in content.get("link", []):
        rest = {key: value for key, value in table.items() if key != "markers"}
        put_markers(call(b.link, rest), table.get("markers", {}))
    for table in content.get("joint", []):
        rest = {key: value for key, value in table.items() if key not in ("type", "between")}
        assert str(call(getattr(b, table["type"]), rest, first=table["between"][0], second=table["between"][1])) == table["name"]
    for table in content.get("coordinate", []):
        motion = {"motion": motion_by_functions(table["motion"], "joint" not in table)} if "motion" in table else {}
        call(b.coordinate, table | motion)
    for table in content.get("actuator", []):
        law = {"law": call(getattr(efforts, table["law"]["type"].replace("-", "_")), {k: v for k, v in table["law"].items() if k != "type"})} if "law" in table else {}
        call(b.actuator, table | law)
    for kind in ("chain", "load", "spring", "payload", "friction", "event", "stop", "clutch", "controller"):
        for table in content.get(kind, []):
            call(getattr(b, kind), table)
    if "time" in content:
        call(b.time, content["time"])
    if "sweep" in content:
        b.sweep(content["sweep"])
    return b


def put_markers(link, markers):
    for name, marker in markers.items():
        told = call(link.marker, marker, name=name) if isinstance(marker, dict) else link.marker(name, marker)
        assert told == link[name] == f"{link.name}.{name}"


def name_of(path):
    return path.parent.name if path.stem == "scene" else path.stem


@pytest.mark.parametrize("path", SCENES, ids=name_of)
def test_every_scene_can_be_said(path):
    """By methods, by `Builder.of`, and through the file that is written of it: the same dict."""
    content = tomllib.loads(path.read_text())
    b = built(content)
    assert normal(b.to_dict()) == normal(content)
    assert tomllib.loads(b.to_toml()) == b.to_dict()
    assert Builder.of(content).to_dict() == content


def normal(content):
    """Markers that are tables with a place alone mean the place; an empty table is none; `table` says which law it is."""
    content = without_law_of_tables({key: value for key, value in content.items() if value not in ({}, [])})
    for link in [content.get("frame", {}), *content.get("link", [])]:
        for name, marker in link.get("markers", {}).items():
            if isinstance(marker, dict) and list(marker) == ["at"]:
                link["markers"][name] = marker["at"]
    return content


def without_law_of_tables(value):
    if isinstance(value, dict):
        return {key: without_law_of_tables(item) for key, item in value.items() if not (key == "law" and item == "table")}
    return [without_law_of_tables(item) for item in value] if isinstance(value, list) else value


@pytest.mark.parametrize("path", [path for path in SCENES if name_of(path) in RUN], ids=name_of)
def test_the_same_bits(path, tmp_path):
    scene = linkdyn.load(path)
    b = built(tomllib.loads(path.read_text()))
    b.to_toml(tmp_path / "scene.toml")
    others = (b.scene(folder=path.parent), linkdyn.Scene((tmp_path / "scene.toml").read_text(), folder=path.parent))
    run = results(scene)
    assert all(results(other).identical(run) for other in others) and (run.status == 0).any()


def results(scene):
    """Of inverse dynamics; of scenes without motors, of a forward run."""
    led = len(scene.actuators) >= len(scene.coordinates)
    return (scene.inverse(want="all") if led else scene.forward(t_end=0.3)).drop_attrs()


# --------------------------------------------------------------------------------------- in step with the reader and its page
def words(function, *but):
    return {"from" if name == "from_" else name for name in inspect.signature(function).parameters} - {"self", *but}


def joint_words():
    found = set()
    for kind in JOINTS:
        found |= words(getattr(Builder, kind), "first", "second")
    return found | {"type", "between"}


CALL = {"link": words(Builder.link), "joint": joint_words(), "coordinate": words(Builder.coordinate), "actuator": words(Builder.actuator),
        "load": words(Builder.load), "spring": words(Builder.spring), "payload": words(Builder.payload), "friction": words(Builder.friction),
        "event": words(Builder.event), "stop": words(Builder.stop), "clutch": words(Builder.clutch), "controller": words(Builder.controller), "chain": words(Builder.chain)}
"""Keys that methods offer, by tables."""
START = {
    "space": "planar", "frame": {"markers": {"A": [0, 0]}}, "link": [{"name": "rod", "mass": 1, "inertia": 0.1, "markers": {"A": [0, 0], "B": [1, 0]}}],
    "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "rod.A"]}], "coordinate": [{"joint": "A"}], "actuator": [{"joint": "A"}],
}  # fmt: skip
"""A scene to put an unknown key into."""
TABLES = {
    "link": {"name": "other", "mass": 1}, "joint": {"name": "J"}, "coordinate": {"joint": "A"}, "actuator": {"joint": "A"}, "load": {"on": "rod.B"},
    "spring": {"name": "S"}, "payload": {"on": "rod.B", "mass": 1}, "friction": {"joint": "A"}, "event": {"name": "E", "when": "time - 1"},
    "stop": {"name": "T", "joint": "A"}, "clutch": {"name": "C", "joint": "A"}, "controller": {"actuator": "A"},
}  # fmt: skip


def known(content):
    """The keys that the reader knows, which it tells when it meets another."""
    with pytest.raises(linkdyn.SceneError) as caught:
        linkdyn.Scene(content)
    listed = re.search(r"unknown key 'zzz' \(expected one of (.*)\)", str(caught.value))
    assert listed, caught.value
    return set(re.findall(r"'([^']+)'", listed[1]))


@pytest.mark.parametrize("table", TABLES)
def test_keys_are_those_of_the_reader(table):
    wrong = START | {table: [*START.get(table, []), TABLES[table] | {"zzz": 1}]}
    assert CALL[table] - PATTERN == known(wrong) - PATTERN


def test_tables_are_those_of_the_reader():
    offered = {name for name, _ in inspect.getmembers(Builder, inspect.isfunction) if not name.startswith(("_", "to_"))} - {"scene"} - set(JOINTS)
    offered = {{"variable": "variables", "measure": "measures", "law": "laws"}.get(name, name) for name in offered}
    assert offered | words(Builder) | {"frame", "joint"} == known(START | {"zzz": 1})
    assert words(Builder.time) == known(START | {"time": {"zzz": 1}})
    assert words(Builder.measure, "name") == known(START | {"measures": {"way": {"joint": "A", "zzz": 1}}})
    assert words(Link.marker, "name") - PATTERN == known(START | {"frame": {"markers": {"A": {"at": [0, 0], "zzz": 1}}}}) - PATTERN
    assert words(Frame.motion) >= known(START | {"frame": START["frame"] | {"motion": {"zzz": 1}}})


@pytest.mark.parametrize("law", ["constant", "constant-rate", "cycloidal-start", "cycloidal", "polynomial-345", "harmonic", "table"])
def test_laws_are_those_of_the_reader(law):
    motion = {"law": law, "zzz": 1} | ({"table": "x.csv"} if law == "table" else {})
    own = words(getattr(laws, law.replace("-", "_")))
    assert own - {"over", "argument", "period"} == known(START | {"coordinate": [{"joint": "A", "motion": motion}]}) - {"law"}


@pytest.mark.parametrize("law", ["constant", "table", "formula", "spring-damper", "dc-motor", "pd", "voltage"])
def test_efforts_are_those_of_the_reader(law):
    own = words(getattr(efforts, law.replace("-", "_")))
    assert own - {"over", "argument", "period"} == known(driven_by(law)) - {"type"}


def test_the_effort_of_the_motion_has_no_keys():
    with pytest.raises(linkdyn.SceneError, match="unknown key 'zzz'"):
        linkdyn.Scene(driven_by("inverse"))
    assert words(efforts.inverse) == set()


def driven_by(law):
    """A scene with a key that no reader knows in the law of its actuator."""
    return START | {"actuator": [{"joint": "A", "law": {"type": law, "zzz": 1}}]}


def test_nested_tables_are_those_of_the_reader():
    assert keys_of(_scene_types.Drive) == known(START | {"actuator": [{"joint": "A", "drive": {"zzz": 1}}]})
    stiff = START["joint"][0] | {"stiffness": {"zzz": 1}}
    assert keys_of(_scene_types.Brake) == known(START | {"actuator": [{"joint": "A", "drive": {"ratio": 1, "brake": {"zzz": 1}}}]})
    assert keys_of(_scene_types.Stiffness) == known(START | {"joint": [stiff], "redundancy": "stiffness"})
    assert keys_of(_scene_types.Marker) == words(Link.marker, "name")


def keys_of(table):
    return set(typing.get_type_hints(table))


def test_words_are_those_of_the_page():
    """Every key that docs/scene-file.md has in a table is offered there, and none else."""
    page = (ROOT / "docs" / "scene-file.md").read_text()
    parts = dict(re.findall(r"^##+ `\[\[?([\w.]+)\]\]?`\n(.*?)(?=^##+ `|^## |\Z)", page, re.M | re.S))
    for table, own in CALL.items():
        text = parts[table]
        if table == "link":
            text = text.partition("### Markers")[0]
        if table == "actuator":
            text = text.partition("### The motor")[0]
        told = keys_in(text, "type")
        if table == "joint":
            told |= keys_in(text, "of")
        if table == "chain":
            told |= {"names"}
        assert own - PATTERN == told, table
    assert set(JOINTS) == {word for row in re.findall(r'^\| ("\w+"|`"\w+"`(?:, `"\w+"`)*) \|', parts["joint"], re.M) for word in re.findall(r'"(\w+)"', row)}
    kinds = typing.get_args(typing.get_args(typing.get_type_hints(Builder.chain)["type"])[0])
    assert set(kinds) == set(re.findall(r'^\| `"([^"]+)"`', parts["chain"], re.M))
    assert keys_of(_scene_types.Drive) == keys_in(page.partition("### The motor behind it")[2].partition("\n## ")[0], "type")
    named = set(re.findall(r'^\| `"([\w-]+)"` \|', page.partition("## Laws of time")[2].partition("\n## ")[0], re.M))
    assert {name.replace("_", "-") for name in laws.__all__} == named
    kinds = set(re.findall(r'^\| `"([\w-]+)"` \|', parts["actuator"], re.M))
    assert {name.replace("_", "-") for name in efforts.__all__} == kinds
    assert words(Builder) | {"frame"} >= keys_in(page.partition("## Top of the file")[2].partition("\n## ")[0], "type")


def keys_in(text, second):
    """First column of the tables whose second one is called so."""
    found = set()
    for rows in re.findall(rf"^\| key \| {second} \|.*\n\|[-| ]+\|\n((?:\|.*\n)+)", text, re.M):
        for row in rows.splitlines():
            found |= set(re.findall(r"`([\w]+)`", row.split("|")[1]))
    return found


# --------------------------------------------------------------------------------------------------------------- how it feels
def pendulum():
    b = Builder("A pendulum", "planar", gravity=(0, -9.81))
    rod = b.link("rod", mass=2, inertia=0.06, cog=("0.3 m", 0), markers={"A": (0, 0)})
    pin = b.revolute("A", b.frame.marker("A", (0, 0)), rod["A"])
    b.coordinate(pin, motion=laws.harmonic("20 deg", "0.5 Hz"))
    b.actuator(pin)
    return b


def test_a_pendulum():
    scene = pendulum().scene()
    q, _, qdd = scene.motion()
    run = scene.inverse()
    expected = (0.06 + 2 * 0.3**2) * qdd + 2 * 9.81 * 0.3 * np.cos(q)
    np.testing.assert_allclose(run.driving_force, expected, rtol=1e-12, atol=1e-12)


def test_messages_name_the_part_and_the_line_that_built_it():
    b = pendulum()
    b.link("bob", mass="3 m"); line = inspect.currentframe().f_lineno  # noqa: E702
    with pytest.raises(linkdyn.SceneError) as caught:
        b.scene()
    assert str(caught.value).startswith("scene['link'][1]['mass']: link 'bob': ")
    assert caught.value.__notes__ == [f"built at {__file__}:{line}"]
    b = pendulum()
    b.revolute("B", "frame.A", "rod.Q"); line = inspect.currentframe().f_lineno  # noqa: E702
    with pytest.raises(linkdyn.SceneError, match="joint 'B'") as caught:
        b.scene()
    assert caught.value.__notes__ == [f"built at {__file__}:{line}"]


def test_parts_go_by_their_names():
    b = pendulum()
    b.friction(linkdyn._builder.Joint("A"), coulomb=0.1, radius=np.float64(0.01))
    b.coordinate(link=b.frame, relative_to=b.frame)
    content = b.to_dict()
    assert content["friction"] == [{"joint": "A", "coulomb": 0.1, "radius": 0.01}] and type(content["friction"][0]["radius"]) is float
    assert content["coordinate"][1] == {"link": "frame", "relative_to": "frame"}
    assert repr(b) == "<linkdyn.Builder 'A pendulum': 1 link, 1 joint, 2 coordinate, 1 actuator, 1 friction>"
    assert repr(b.frame) == "<linkdyn link 'frame': markers A>"


def test_actuators_and_events_are_called_as_what_was_built_says():
    b = Builder("names", "spatial")
    origin = b.frame.marker("O", (0, 0, 0))
    nut = b.link("nut", mass=1, inertia={"diagonal": (1, 1, 1)}, markers={"O": (0, 0, 0), "A": (0, 0, 1)})
    lever = b.link("lever", mass=1, inertia={"diagonal": (1, 1, 1)}, markers={"A": (0, 0, 0)})
    guide, hinge = b.cylindrical("C", origin, nut["O"]), b.revolute("H", nut["A"], lever["A"])
    for joint, variable in ((guide, "slide"), (guide, "angle"), (hinge, None)):
        b.coordinate(joint, variable=variable)
    names = [b.actuator(guide, variable="slide"), b.actuator(guide, variable="angle"), b.actuator(hinge, variable="angle"), b.actuator(hinge, name="brake")]
    assert tuple(names) == b.scene().actuators == ("C.slide", "C.angle", "H", "H:brake")
    moves = b.event("moves", when="time - 1 s")
    b.clutch("latch", joint=hinge, from_event=moves)
    b.controller(names[0], target=0, kp=1)
    assert b.scene().forward(t_end=0.1).attrs["stopped"] == ""


def test_a_dict_is_a_copy():
    b = pendulum()
    b.to_dict()["link"][0]["mass"] = 7
    assert b.to_dict()["link"][0]["mass"] == 2


def test_a_marker_that_no_link_has_is_refused_at_once():
    """It was taken, and refused only when the scene was read, far from the line that asks for it."""
    b = Builder("", "spatial")
    cam = b.link("cam", mass=1, inertia=[1, 1, 1, 0, 0, 0], markers={"O": (0, 0, 0), "P": {"at": (1, 0, 0), "repeat": 2, "mirror": "xz"}, "Q#a": {"at": (0, 1, 0), "angles": [0, 1, 2]}})
    assert cam.marker("T", (0, 0, 1)) == "cam.T" == cam["T"] and b["cam"]["P4"] == "cam.P4" and cam["Q3a"] == "cam.Q3a" and cam["P#"] == "cam.P#"
    with pytest.raises(linkdyn.InputError, match=r"link 'cam': 'nix': unknown marker \(expected one of O, P, P1, P2, P3, P4, Q#a, Q1a, Q2a, Q3a, T\)"):
        cam["nix"]
    for name in ("P5", "P0", "Q4a", 3):
        with pytest.raises(linkdyn.InputError, match="unknown marker"):
            cam[name]
    with pytest.raises(linkdyn.InputError, match="link 'frame': 'A': unknown marker .expected one of none"):
        b.frame["A"]
    assert b.frame.marker("A", (0, 0, 0), repeat=3) == "frame.A" and b.frame["A3"] == "frame.A3"
    assert Builder(include="base.toml").frame["A"] == Builder.of({"include": "base.toml"}).frame["A"] == "frame.A"     # which may stand there


def test_going_on_from_a_scene():
    b = Builder.of(linkdyn.new("four-bar"))
    b.payload(b["coupler"].marker("bag", ("100 mm", 0)), mass="0.5 kg")
    more = b.scene().inverse().driving_force - linkdyn.new("four-bar").inverse().driving_force
    assert float(abs(more).max()) > 0.1
    assert b["frame"] is b.frame and repr(b["crank"]).startswith("<linkdyn link 'crank': markers A")
    with pytest.raises(linkdyn.InputError, match="link: 'cranck': unknown link .* did you mean 'crank'"):
        b["cranck"]
    path = ROOT / "examples" / "fourbar" / "scene.toml"
    with_table = Builder.of(ROOT / "examples" / "four_stroke" / "scene.toml")     # found where it lies
    assert with_table.scene().links == Builder.of(with_table.scene()).scene().links
    assert Builder.of(path).to_dict() == tomllib.loads(path.read_text())


def test_files_are_as_people_write_them():
    content = {
        "title": 'Dashes \\ "quotes" \x7f, umlaut ü', "gravity": [0, -9.81], "variables": {"L": "3 mm"},
        "link": [{"name": "a", "markers": {f"M{i}": {"at": [0.1, 0.2, i], "axis": [0.0, 0, 1]} for i in range(4)}, "inertia": [1e-30, 2.5] * 30, "inertia_check": False}],
        "coordinate": [{"joint": "A", "motion": {"law": "cycloidal", "times": [0.1 * i for i in range(50)]}}], "key with blanks": {"a b": {}},
    }  # fmt: skip
    text = as_toml(content)
    assert tomllib.loads(text) == content
    assert max(len(line) for line in text.splitlines()) < 400 and "[[link]]\nname = \"a\"\nmarkers.M0 = { at = [0.1, 0.2, 0], axis = [0.0, 0, 1] }" in text


def test_a_link_is_no_joint():
    """A link where a joint is wanted is told at once, with the key that takes it."""
    b = Builder("cam", "planar")
    cam = b.link("cam", mass=1, markers={"A": (0, 0)})
    with pytest.raises(linkdyn.SceneError, match="^coordinate: joint: 'cam' is a link, no joint .expected link=cam"):
        b.coordinate(cam)
    with pytest.raises(linkdyn.SceneError, match="^actuator: joint: 'cam' is a link, no joint .expected one of its joints"):
        b.actuator(cam)


def test_a_chain_is_no_joint():
    """Of a chain where a joint is wanted the joints are told: `air` has `air.P`."""
    content = tomllib.loads((ROOT / "python" / "linkdyn" / "_scenes" / "excavator.toml").read_text())
    content["coordinate"][0]["joint"] = "cylinder1"
    with pytest.raises(linkdyn.SceneError, match="no such joint .*'cylinder1' is a chain with the joints .*'cylinder1.P'"):
        linkdyn.Scene(content)
