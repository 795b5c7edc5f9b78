"""[variables] and arithmetic in numbers: values against Python's own arithmetic, dimensions, refusals, what follows a change."""

from __future__ import annotations

import copy
import math
import random
import subprocess
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w

import linkdyn
from linkdyn.cli import executable

ROOT = Path(__file__).resolve().parents[2]

SLIDER_CRANK = (ROOT / "tests" / "scenes" / "variables.toml").read_text()


def values_of(**variables: object) -> dict[str, float]:
    """What the engine makes of some variables."""
    content = tomllib.loads(SLIDER_CRANK) | {}
    content["variables"] |= variables
    return {entry["name"]: entry["value"] for entry in linkdyn.Scene(content).description["variables"]}


def value_of(text: str, **others: object) -> float:
    return values_of(**others, x=text)["x"]


def written_out(r: float = 50 * 0.001, ratio: float = 3.5) -> dict:
    """The same mechanism in plain numbers, by Python's arithmetic."""
    scene = tomllib.loads(SLIDER_CRANK)
    del scene["variables"]
    rod, rho, area = ratio * r, 7850.0, math.pi / 4 * (20 * 0.001) ** 2
    m = rho * area * rod
    scene["gravity"][1] = -9.81
    crank, link, _ = scene["link"]
    crank |= {"markers": {"O": [0, 0], "A": [r, 0]}, "mass": 2 * rho * area * r, "cog": [r / 2, 0], "inertia": 0.5 * m * r**2}
    link |= {"markers": {"A": [0, 0], "B": [rod, 0]}, "mass": m, "cog": [rod / 2, 0], "inertia": m * rod**2 / 12}
    scene["joint"][3]["start"] = r + rod
    return scene


def assert_same_runs(one: linkdyn.Scene, other: linkdyn.Scene) -> None:
    a, b = one.inverse(), other.inverse()
    assert (a.status == 0).all()
    for name in ("driving_force", "reaction", "q"):
        np.testing.assert_allclose(a[name], b[name], rtol=1e-13, atol=1e-12)


def test_a_scene_with_variables_is_the_scene_written_out():
    assert_same_runs(linkdyn.Scene(SLIDER_CRANK), linkdyn.Scene(written_out()))


# ---- values

NAMES = {"sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "tan": math.tan, "atan2": math.atan2, "abs": abs, "min": min, "max": max,
         "pi": math.pi}  # fmt: skip


def random_text(dice: random.Random, depth: int) -> str:
    """Arithmetic that Python reads as it is, once ^ is **."""
    kind = dice.randrange(9) if depth else 0
    if kind <= 1:
        return dice.choice(["2", "0.5", "1.25e-1", "3", "pi", "u", "v", ".75", "4."])
    inner = [random_text(dice, depth - 1) for _ in range(2)]
    if kind <= 5:
        blank = dice.choice(["", " "])
        return f"{inner[0]}{blank}{dice.choice('+-*/')}{blank}{inner[1]}"
    if kind == 6:
        return f"{dice.choice(['', '-', 'sin', 'cos', 'abs'])}({inner[0]})"
    if kind == 7:
        return f"({inner[0]})^{dice.choice(['2', '-1', '3', '0'])}"
    return f"{dice.choice(['min', 'max', 'atan2'])}({inner[0]}, {inner[1]})"


def test_names_with_figures_behind_units_are_variables():
    """Nobody writes an exponent that is 1, and none is 0."""
    found = values_of(m0=3, m1="4 kg", s10=5, a="2 N*m0", b="10 m/s^2*m1", c="6 N/s10")
    assert (found["a"], found["b"], found["c"]) == (6, 40, 1.2)


def test_arithmetic_is_that_of_python():
    dice = random.Random(20261122)
    texts, expected = {}, {}
    outside = {"u": 1.75, "v": -0.3}
    while len(texts) < 400:
        text = random_text(dice, 4)
        try:
            value = eval(text.replace("^", "**"), {"__builtins__": {}}, NAMES | outside)  # noqa: S307 (our own text)
        except (ZeroDivisionError, OverflowError, ValueError):
            continue
        if isinstance(value, complex) or "atan2" in text or not 1e-6 < abs(value) < 1e6:
            continue
        texts[f"x{len(texts)}"] = text
        expected[f"x{len(expected)}"] = value
    found = values_of(**outside, **texts)
    for name, text in texts.items():
        assert found[name] == pytest.approx(expected[name], rel=1e-12), text


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("-2^2", -4), ("2^-1", 0.5), ("2^3^2", 512), ("8/4/2", 1), ("8 - 4 - 2", 2), ("-(-3)", 3), ("2*-3", -6), ("+4", 4), ("sqrt(2)", math.sqrt(2)),
        ("sin(30 deg)", 0.5), ("cos(pi/3)", 0.5), ("tan(45 deg)", 1), ("asin(0.5)", math.pi / 6), ("acos(0.5)/(1 deg)", 60),
        ("atan2(3 mm, -3 mm)", 0.75 * math.pi), ("abs(-r)", 0.05), ("min(r, d)", 0.02), ("max(r, d)", 0.05), ("sqrt(r^2 + (0.12 m)^2)", 0.13),
        ("12 mm + r/2", 0.037), ("12 N*m", 12), ("2*m/m", 2), ("1/2 mm", 500), ("3 kg*m^2/s^2", 3), ("2*min(1, 2)", 2), ("2 min", 120), ("r^0", 1),
        ("5 N/(m/s)*2", 10), ("60 rpm*1 s/(1 rev)", 1), ("(r*d)^0.5", math.sqrt(0.001)), ("pi*r^2*(3 Hz)/(1 m)^2", 0.015 * math.pi**2), ("50 %*r", 0.025), ("2·r²", 0.005),
    ],
)  # fmt: skip
def test_values(text, value):
    assert value_of(text) == pytest.approx(value, rel=4e-16, abs=0)


def test_units_are_carried():
    content = tomllib.loads(SLIDER_CRANK)
    content["variables"] |= {"torque": "5 N*m", "rate": "torque*1 rad/(2 J s)", "ratio2": "r/d", "bare": "3*ratio", "angle": "acos(0.5)"}
    units = {entry["name"]: entry["unit"] for entry in linkdyn.Scene(content).description["variables"]}
    assert units["torque"] == "kg m^2 s^-2" and units["rate"] == "s^-1 rad" and units["angle"] == "rad"
    assert units["ratio2"] == "" and units["bare"] == "" and units["r"] == "m"


@pytest.mark.parametrize("text", ["12 N*m", "3 m/s", "5 kg m^2", "7850 kg/m^3", "2 N/(m/s)", "2 m", "2 min", "0.22 N*m/A", "-1.5e2 um"])
def test_units_stay_units_beside_variables_of_their_names(text):
    """A text that is a number with its unit means the same whatever variables there are, once a unit has been met."""
    assert value_of(text, A="3 mm^2", s=2.5, min_="1", kg="2 m", N=7, h="3 m") == value_of(text)


def test_a_variable_before_a_unit_behind_a_plain_number():
    assert value_of("0.5*A*ratio", A=4) == 7
    assert value_of("2*A", A=4) == 8
    assert value_of("2 A/(1 A)", A=4) == 2


def test_plain_numbers_are_in_si():
    scene = tomllib.loads(SLIDER_CRANK)
    scene["variables"] |= {"r": 0.05, "d": 0.02, "rho": 7850, "g": 9.81}
    assert_same_runs(linkdyn.Scene(scene), linkdyn.Scene(written_out(r=0.05)))


# ---- refusals


def tomli_keys(table: dict) -> list[str]:
    """Keys as a TOML file has them."""
    return [tomli_w.dumps({key: 0}).partition(" = ")[0] for key in table]


@pytest.mark.parametrize(
    ("variables", "fragment"),
    [
        ({"x": "r + m"}, "'r + m' adds a mass to a length"),
        ({"x": "r - 3"}, "takes a plain number from a length"),
        ({"x": "30 deg + 1"}, "adds a plain number to an angle (expected rad or deg behind the number)"),
        ({"x": "2*pi*3 Hz"}, "multiplies with pi what is given in turns"),
        ({"x": "-1500 rpm/60*(2*pi)"}, "multiplies with pi what is given in turns"),
        ({"x": "f*y", "f": "3 Hz", "y": "2*pi"}, "multiplies with pi what is given in turns"),
        ({"x": "r/0"}, "divides by zero"),
        ({"x": "0^-1"}, "divides by zero"),
        ({"x": "1e308*10"}, "is not a finite number"),
        ({"x": "1e400"}, "is not a finite number"),
        ({"x": "nan"}, "is not a finite number"),
        ({"x": "2*Infinity"}, "is not a finite number"),
        ({"x": float("nan")}, "is not a finite number"),
        ({"x": float("inf")}, "is not a finite number"),
        ({"x": "sqrt(-1)"}, "raises a negative number"),
        ({"x": "sqrt(r)"}, "a dimension with fractional or huge powers"),
        ({"x": "r^0.5"}, "a dimension with fractional or huge powers"),
        ({"x": "2^r"}, "raises to a length"),
        ({"x": "r^99^99"}, "a dimension with fractional or huge powers"),
        ({"x": "asin(2)"}, "asin of a value outside [-1, 1]"),
        ({"x": "atan2(0, 0)"}, "atan2 of two zeros"),
        ({"x": "atan2(r, 1 s)"}, "atan2 of a length and a time"),
        ({"x": "cos(r)"}, "cos of a length (expected an angle)"),
        ({"x": "min(r, 2)"}, "min of a length and a plain number"),
        ({"x": "min(r)"}, "where ',' is expected"),
        ({"x": "x"}, "refers to itself ('x')"),
        ({"x": "y + 1", "y": "2*z", "z": "x"}, "refers to itself ('x', 'y', 'z')"),
        ({"x": "raito*2"}, "did you mean 'ratio'?"),
        ({"x": "2*sqr(2)"}, "did you mean 'sqrt'?"),
        ({"x": "2*nothing_like_it"}, "unknown name 'nothing_like_it'"),
        ({"x": "(" * 200 + "1" + ")" * 200}, "nested too deep"),
        ({"x": "-" * 900 + "1"}, "nested too deep"),
        ({"x": "2^" * 400 + "1"}, "nested too deep"),
        ({"x": "1" + "+1" * 600}, "longer than 1000 letters"),
        ({f"x{i}": f"x{i + 1}" for i in range(200)} | {"x200": 1}, "nested too deep"),
        ({"x": "(r"}, "ends without ')'"),
        ({"x": "r)"}, "has ')' where an operator is expected"),
        ({"x": "2 +"}, "ends where a number or a name is expected"),
        ({"x": "r r"}, "'r' is not a unit that linkdyn knows"),
        ({"x": "3 furlong"}, "'furlong' is not a unit that linkdyn knows"),
        ({"x": "3,5*r"}, "has a comma (decimals have a point)"),
        ({"x": "__import__('os')"}, "'__import__' is no variable"),
        ({"x": ""}, "does not start with a number"),
        ({"x": "2/s", "s": 3}, "may mean the unit or the variable 's'"),
        ({"x": "2*(s)", "s": 3}, "may mean the unit or the variable 's'"),
        ({"x": "2 kg*m2", "m2": 3}, "may mean a power of the unit or the variable 'm2'"),
        ({"s": "3 s"}, "variable 's': is a time, as the unit of that name is"),
        ({"mm": "1 m"}, "variable 'mm': is a length, as the unit of that name is"),
        ({"pi": 3}, "variable 'pi': this name has a meaning in arithmetic"),
        ({"min": 3}, "variable 'min': this name has a meaning in arithmetic"),
        ({"a-b": 3}, "cannot be the name of a variable"),
        ({"2a": 3}, "cannot be the name of a variable"),
        ({"": 3}, "cannot be the name of a variable"),
        ({"a" * 65: 3}, "cannot be the name of a variable"),
        ({"größe": 3}, "cannot be the name of a variable"),
        ({"x": True}, "is true or false"),
        ({"x": [1]}, "is a list"),
        ({"x": {"y": 1}}, "is a table"),
    ],
)  # fmt: skip
def test_bad_variables_are_refused_in_one_line(variables, fragment, tmp_path):
    scene = tomllib.loads(SLIDER_CRANK)
    scene["variables"] |= variables
    file = tmp_path / "scene.toml"
    file.write_text(tomli_w.dumps(scene))
    result = subprocess.run([executable(), "explain", file], capture_output=True, text=True, timeout=30)
    assert result.returncode == 2 and result.stdout == "" and result.stderr.count("\n") == 1
    place, _, rest = result.stderr.removeprefix(f"{file}:").partition(": ")
    assert fragment in rest and rest.startswith("variable ")
    line = file.read_text().splitlines()[int(place) - 1]
    assert line.startswith(tuple(f"{key} = " for key in tomli_keys(variables))) or line == "[variables.x]"
    with pytest.raises(linkdyn.SceneError) as caught:
        linkdyn.load(file)
    assert fragment in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "value", "fragment"),
    [
        (("link", 0, "mass"), "r", "'r' is a length (expected a mass"),
        (("link", 0, "mass"), "m*r", "'m*r' is something in kg m (expected a mass"),
        (("link", 0, "cog"), ["r*30 deg", 0], "a factor or divisor of '1 rad' mends it"),
        (("link", 0, "mass"), "-m", "is negative"),
        (("coordinate", 0, "motion"), {"law": "constant-rate", "rate": "r/1 s"}, "is a speed (expected an angular rate"),
        (("variables",), [1], "this is a list (expected a table of names"),
        (("variables",), {}, "'-g' has the unknown name 'g'"),
        (("link", 0, "mass"), "2*mas", "unknown name 'mas'"),
        (("link", 0, "mass"), "if(1, 400 kg, 0)", "has if between a mass and a plain number (expected two of a kind; a zero has a unit, too: 0 N, 0 N m)"),
        (("link", 0, "mass"), "if(1, 400 kg, 2)", "has if between a mass and a plain number (expected two of a kind)"),
        (("link", 0, "mass"), "if(r > 1 m, 400 kg, 0 kg)", "a comparison (if(x - y, a, b) is a where x is above y, else b)"),
        (("link", 0, "mass"), "max(1 kg, 2)", "has max of a mass and a plain number (expected two of a kind)"),
    ],
)
def test_bad_use_is_refused_with_key_and_line(keys, value, fragment):
    scene = tomllib.loads(SLIDER_CRANK)
    table = scene
    for key in keys[:-1]:
        table = table[key]
    table[keys[-1]] = value
    with pytest.raises(linkdyn.SceneError) as caught:
        linkdyn.Scene(scene)
    assert fragment in str(caught.value)
    assert str(caught.value).startswith("scene['")
    assert str(caught.value).count("(expected ") <= 1


def test_arithmetic_needs_no_variables():
    scene = written_out()
    scene["link"][1]["cog"] = ["175 mm/2", 0]
    scene["coordinate"][0]["start"] = "pi/6"
    changed = linkdyn.Scene(scene)
    assert changed.description["links"][2]["cog"][0] == pytest.approx(0.0875, rel=1e-15)
    assert changed.description["variables"] == []


@pytest.mark.parametrize(("text", "value"), [
    ("2 m-0.5 m", 1.5), ("if(1 m-2 m, 5 m, 6 m)", 6.0), ("3 m-10%*2 m", 2.8), ("3 m-.5 m", 2.5), ("9 m s^-1*1 s-2 m", 7.0),
    ("9 m^3 m-2", 9.0), ("5 m s-1*2 s", 10.0), ("1 m-2 m", -1.0), ("300 mm-1 m", -0.7), ("3 m-1 m-1 m", 1.0), ("-3 m-1 m", -4.0),
])  # fmt: skip
def test_a_minus_behind_a_unit_takes_off(text, value):
    """Unless a digit alone follows: that is an exponent."""
    scene = written_out()
    scene["link"][1]["cog"] = [text, 0]
    assert linkdyn.Scene(scene).description["links"][2]["cog"][0] == pytest.approx(value, rel=1e-15)


def test_a_minus_in_a_variable_takes_off():
    """It was read as the unit m^-1 m, so as a plain number: 3 m where 2 m are meant, without a word."""
    scene = written_out() | {"variables": {"L": "3 m-1 m", "density": "5 kg m-1 m-2", "flux": "2 kg m-2 s-1"}}
    scene["link"][1]["cog"] = ["L", 0]
    scene["link"][1]["mass"] = "density*1 m^3 + flux*1 m^2*1 s"
    link = linkdyn.Scene(scene).description["links"][2]
    assert link["cog"][0] == pytest.approx(2.0, rel=1e-15)
    assert link["mass"] == pytest.approx(7.0, rel=1e-15)


# ---- what follows a change


@pytest.mark.parametrize("value", [0.06, "60 mm", "3*d"])
def test_all_that_depends_follows_in_with(value):
    changed = linkdyn.Scene(SLIDER_CRANK).with_({"variables.r": value})
    assert_same_runs(changed, linkdyn.Scene(written_out(r=0.06)))
    assert_same_runs(changed.with_({"variables.ratio": 4}), linkdyn.Scene(written_out(r=0.06, ratio=4)))


SWEEPS = {
    "set": ([{"parameter": "variables.r", "values": [0.04, "50 mm", "0.03 m*2"]}], [{"variables.r": r} for r in (0.04, 0.05, 0.06)]),
    "times": ([{"parameter": "variables.r", "as": "factor", "values": [0.8, 1.2]}], [{"variables.r": r} for r in (0.04, 0.06)]),
    "a number that follows": (
        [{"parameter": "variables.r", "values": [0.04, 0.06]}, {"parameter": "variables.rod", "as": "factor", "values": [1, 1.5]}],
        [{"variables.r": r, "variables.rod": f"{f}*ratio*r"} for r in (0.04, 0.06) for f in (1, 1.5)],
    ),
    "a chain": (
        [{"parameter": "variables.d", "values": [0.01, 0.03]}, {"parameter": "variables.area", "as": "factor", "values": [1, 2]},
         {"parameter": "variables.m", "as": "factor", "values": [1, 3]}, {"parameter": "link.rod.mass", "as": "offset", "values": [0, 0.25]}],
        [{"variables.d": d, "variables.area": f"{f}*(pi/4*d^2)", "variables.m": f"{k}*(rho*area*rod)", "link.rod.mass": f"m + {o} kg"}
         for d in (0.01, 0.03) for f in (1, 2) for k in (1, 3) for o in (0, 0.25)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SWEEPS)
def test_all_that_depends_follows_in_sweeps(name):
    """The largest torque of each design is that of the scene changed by hand."""
    axes, changes = SWEEPS[name]
    content = tomllib.loads(SLIDER_CRANK)
    scene = linkdyn.Scene(content | {"sweep": {"axis": [*axes, {"time": True, "linspace": [0, 1, 9]}]}})
    swept = scene.sweep()
    peaks = [float(np.abs(linkdyn.Scene(content).with_(change).inverse().driving_force).max()) for change in changes]
    largest = max(peaks)
    found = max(np.abs(swept[f"driving_force_{side}"].values).max() for side in ("min", "max"))
    assert found == pytest.approx(largest, rel=1e-12)


def test_a_sweep_does_not_ask_for_what_it_varies():
    content = tomllib.loads(SLIDER_CRANK)
    axes = [{"parameter": "variables.r", "values": ["0.8*r", "1.2*r"]}, {"time": True, "linspace": [0, 1, 9]}]
    with pytest.raises(linkdyn.SceneError, match="varies the variable 'r' and asks for it in a number of its own"):
        linkdyn.Scene(content | {"sweep": {"axis": axes}})
    axes = [{"parameter": "variables.r", "values": ["rod/4"]}, {"time": True, "linspace": [0, 1, 9]}]    # through another one
    with pytest.raises(linkdyn.SceneError, match="varies the variable 'r'"):
        linkdyn.Scene(content | {"sweep": {"axis": axes}})
    axes = [{"parameter": "variables.r", "values": ["2*d"]}, {"time": True, "linspace": [0, 1, 9]}]
    assert linkdyn.Scene(content | {"sweep": {"axis": axes}}).sweep() is not None


def test_the_text_of_the_file_is_kept():
    run = linkdyn.Scene(SLIDER_CRANK).inverse()
    assert run.attrs["scene"] == SLIDER_CRANK
    assert copy.deepcopy(linkdyn.Scene(run.attrs["scene"]).inverse()).equals(run)


@pytest.mark.parametrize("name", ["nominal", "n_min", "minute"])
def test_names_of_variables_are_no_units(name: str) -> None:
    """A minute in the name of a variable says nothing of how an angular rate is counted."""
    scene = {"space": "planar", "variables": {name: "5/s"}, "frame": {"markers": {"O": [0, 0]}},
             "link": [{"name": "arm", "mass": 1.0, "inertia": 0.1, "markers": {"O": [0, 0]}}],
             "joint": [{"name": "J", "type": "revolute", "between": ["frame.O", "arm.O"]}],
             "coordinate": [{"joint": "J", "motion": {"law": "constant-rate", "rate": f"2*{name}"}}], "actuator": [{"joint": "J"}]}
    assert linkdyn.Scene(scene).motion([0.0])[1].ravel() == pytest.approx([10.0])
