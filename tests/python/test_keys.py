"""Messages about dict scenes name keys; `with_` and sweeps have one syntax for paths."""

from __future__ import annotations

import copy
import tomllib
from functools import reduce
from pathlib import Path

import numpy as np
import pytest

import linkdyn

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture(scope="module")
def content():
    return tomllib.loads((EXAMPLES / "fourbar" / "scene.toml").read_text())


@pytest.mark.parametrize(
    ("keys", "value", "inside"),
    [
        (("link", 0, "mass"), "heavy", ()),
        (("link", 2, "inertia"), -1, ()),
        (("gravity",), [0, 0, 0, 0], ()),
        (("joint", 1, "between"), ["frame.X", "crank.J2"], (0,)),
        (("coordinate", 0, "motion"), {"law": "wind", "why": "so long that it takes a line of its own, " * 3}, ("law",)),
        (("link", 1, "markers", "J2"), [1, "x"], (1,)),
        (("frame", "markers", "J4"), ["a", 0], (0,)),
        (("link", 1, "colour of the paint"), 3, ()),
        (("space",), "flat", ()),
    ],
)
def test_messages_name_keys(content, keys, value, inside):
    wrong = copy.deepcopy(content)
    reduce(lambda table, key: table[key], keys[:-1], wrong)[keys[-1]] = value
    with pytest.raises(linkdyn.SceneError) as caught:
        linkdyn.Scene(wrong)
    assert str(caught.value).startswith(f"scene{''.join(f'[{key!r}]' for key in keys + inside)}: "), caught.value


def test_short_tables_in_lists_count(content):
    wrong = content | {"actuator": [*content["actuator"], {"joint": "J9"}]}
    with pytest.raises(linkdyn.SceneError) as caught:
        linkdyn.Scene(wrong)
    assert str(caught.value).startswith("scene['actuator'][1]: "), caught.value


def test_both_of_two_places_are_keys(content):
    """Of dicts and of what `with_` makes of a scene: nobody has seen these lines."""
    name = content["link"][0]["name"]
    wrong = content | {"link": [*content["link"], content["link"][0]]}
    for make in (lambda: linkdyn.Scene(wrong), lambda: linkdyn.Scene(content).with_({f"link.{content['link'][1]['name']}.name": name})):
        with pytest.raises(linkdyn.SceneError, match="another link of that name at scene\\['link'\\]\\[0\\]") as caught:
            make()
        assert " on line " not in str(caught.value)
    link = "[[link]]\nname = 'a'\nmass = 1\ninertia = 1\n"
    with pytest.raises(linkdyn.SceneError, match="^scene:6: .* on line 2"):
        linkdyn.Scene(f"space = 'planar'\n{link}{link}")


@pytest.mark.parametrize("value", [10**400, 10**5000, -(2**63) - 1], ids=["400 digits", "5000 digits", "64 bits"])
def test_numbers_that_no_file_holds_are_told_by_their_path(content, value):
    lengths = {"L": "1 m"}
    scene = linkdyn.Scene(content | {"variables": lengths, "link": [content["link"][0] | {"cog": ["2*L", 0]}, *content["link"][1:]]})
    for path in ("variables.L", "link.crank.mass"):
        if -(10**300) < value < 10**300 and path == "variables.L":
            continue    # a double holds it
        with pytest.raises(linkdyn.InputError, match=r"variables\.L|mass"):
            scene.with_({path: value})


def test_messages_of_texts_keep_their_lines():
    with pytest.raises(linkdyn.SceneError, match="^scene:2: "):
        linkdyn.Scene("title = 'a'\nfoo = 2\n")


@pytest.mark.parametrize("path", ["link.crank.cog[0]", "link.crank.mass", "link[0].mass", "frame.markers.J1[0]", "gravity[1]"])
def test_one_path_for_changes_and_sweeps(content, path):
    scene = linkdyn.Scene(content)
    number = {"link.crank.cog[0]": 1.5, "link.crank.mass": 300.0, "link[0].mass": 300.0, "frame.markers.J1[0]": 10.2, "gravity[1]": -5.0}[path]
    q = np.linspace(0.5, 3.0, 7)
    changed = scene.with_({path: number}).inverse(q[:, np.newaxis])
    assert np.abs(changed.driving_force - scene.inverse(q[:, np.newaxis]).driving_force).max() > 1.0
    axes = [{"parameter": path, "values": [number]}, {"coordinate": "J1", "values": q.tolist()}]
    swept = scene.sweep({"reduce": ["driving_force"], "axis": axes})
    assert swept.driving_force_max.squeeze().item() == pytest.approx(float(changed.driving_force.max()), rel=1e-12)


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("link.crank.cog[2]", 1.0, "'cog' has 2 elements"),
        ("link.crank.mass[0]", 1.0, "'mass' has no list"),
        ("link.crank.cog[0]", None, "another value"),
        ("link.crank.cog[0].x", 1.0, "no table above 'x'"),
        ("link[9].mass", 1.0, "'link' has"),
    ],
)
def test_elements_that_are_not_there(content, path, value, words):
    with pytest.raises(linkdyn.InputError, match=words.replace("[", r"\[")):
        linkdyn.Scene(content).with_({path: value})
