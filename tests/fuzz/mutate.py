"""Mutations: of values and structure of a scene, of text, of tables, of single arguments.

Each takes a random generator and changes what it is given in place (or returns the new bytes), and says in a few words
what it did, so that a finding can be read and repeated.
"""

from __future__ import annotations

import copy
import datetime
import random
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

NUMBERS = (
    0, -1, 1, 2, 3, 7, 0.5, -0.0, 1e-3, -1e-3, 1e-9, 1e-12, 1e-200, 5e-324, 1e6, -1e6, 1e9, 1e12, 1e100, 1e308,
    -1e308, float("nan"), float("inf"), float("-inf"), 2**31, 2**31 - 1, -(2**31), 2**53 + 1, 2**63 - 1, -(2**63),
)  # fmt: skip
FACTORS = (-1, 0, 2, 0.5, 10, 0.1, 100, 1e-3, 1e3, 1e-6, 1e6, 1e-12, 1e12, 1 + 1e-15, 1 - 1e-9, 1 + 1e-6, 1.01, 0.9)
SLIGHT_FACTORS = (2, 0.5, -1, 1.1, 0.9, 3, 0.3, 1.01, 10, 0.1)
WORDS = (
    "", " ", "x", "frame", "frame.", ".", "..", "frame.B1.P1", "none", "inverse", "revolute", "prismatic", "spherical",
    "universal", "cylindrical", "constant", "harmonic", "table", "planar", "spatial", "true", "1", "1 m", "1 mm", "90 deg", "-90deg",
    "3 furlong", "1e400 m", "1 m/0", "1/0", "2*pi", "pi", "sqrt(2)", "N m", "1 kg m2", "60 rpm", "2 Hz", "nan", "inf", "NaN m", "é", "名前", "\u202e",
    "a\nb", "a\tb", "\x1b[31mred\x1b[0m", "\x7f", "'", '"', "\\", "/", "../../etc/passwd", "/dev/zero", "x" * 40, "x" * 1000,
    "L/2", "2*r + 12 mm", "-r*cos(pi/3)", "sqrt(", "x^x", "1/(r-r)", "((((", "m*s", "2/s", "#", "leg#", "2*#", "z", "xz", "%s%n", "$(id)", "{0}", "name with blanks",
)  # fmt: skip
BYTES = (b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\x1b[2J", b"\r", b"\r\n", b"\n\n", b"\t", b"[", b"]", b"[[", b"{", b"}", b'"', b"'''", b"=", b"#",
         b",", b".", b"-", b"e9", b"_", b"\xc3", b"\xed\xa0\x80", b"nan", b"1e999", b"\x85", b"\xe2\x80\xa8")  # fmt: skip

Path = tuple[Any, ...]


def places(value: Any, path: Path = ()) -> Iterator[Path]:
    """Paths of all values inside a scene, tables and lists among them."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield (*path, key)
        yield from places(item, (*path, key))


def at(scene: Any, path: Path) -> Any:
    """What stands at a path."""
    for key in path:
        scene = scene[key]
    return scene


def put(scene: Any, path: Path, value: Any) -> None:
    """Put a value at a path."""
    at(scene, path[:-1])[path[-1]] = value


def words(path: Path) -> str:
    """A path as one writes it."""
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path).lstrip(".")


def shown(value: Any) -> str:
    """A value, not at length."""
    text = repr(value)
    return text if len(text) < 60 else f"{text[:57]}..."


def is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


# ------------------------------------------------------------------------------------------------------- of a scene
def pick(dice: random.Random, scene: Any, wanted: Callable[[Any], bool]) -> Path | None:
    """The path of one of the values that are wanted."""
    found = [path for path in places(scene) if wanted(at(scene, path))]
    return dice.choice(found) if found else None


def vary(dice: random.Random, scene: Any, other: Callable[[Any], Any]) -> str | None:
    """Another number for one of a scene's."""
    path = pick(dice, scene, is_number)
    if path is None:
        return None
    old = at(scene, path)
    new = other(old)
    put(scene, path, new)
    return f"{words(path)}: {shown(old)} -> {shown(new)}"


def change_number(dice: random.Random, scene: Any) -> str | None:
    def other(old: Any) -> Any:
        kind = dice.randrange(3)
        if kind == 0:
            return old * dice.choice(FACTORS)
        return old + dice.gauss(0, 1) if kind == 1 else dice.choice(NUMBERS)

    return vary(dice, scene, other)


def change_text(dice: random.Random, scene: Any) -> str | None:
    path = pick(dice, scene, lambda value: isinstance(value, str))
    if path is None:
        return None
    old = at(scene, path)
    others = [at(scene, other) for other in places(scene)]
    names = [other for other in others if isinstance(other, str)]
    new = dice.choice((dice.choice(WORDS), dice.choice(names), old[:-1], old + "x", old.upper()))
    put(scene, path, new)
    return f"{words(path)}: {shown(old)} -> {shown(new)}"


def change_type(dice: random.Random, scene: Any) -> str | None:
    path = pick(dice, scene, lambda value: True)
    if path is None:
        return None
    old = at(scene, path)
    new = dice.choice((
        True, [], {}, "", 0, 1.0, [old], {"x": old}, str(old)[:80], [1, 2, 3], ["a"], [[1.0, 2.0], [3.0]], {"law": "constant", "value": 1.0},
        datetime.date(2020, 1, 1), [0.0] * 50,
    ))  # fmt: skip
    put(scene, path, new)
    return f"{words(path)}: {shown(old)} -> {shown(new)}"


def take_out(dice: random.Random, scene: Any) -> str | None:
    path = pick(dice, scene, lambda value: True)
    if path is None:
        return None
    old = at(scene, path)
    del at(scene, path[:-1])[path[-1]]
    return f"{words(path)} ({shown(old)}) taken out"


def double(dice: random.Random, scene: Any) -> str | None:
    path = pick(dice, scene, lambda value: isinstance(value, list) and value)
    if path is None:
        return None
    items = at(scene, path)
    item = copy.deepcopy(dice.choice(items))
    if isinstance(item, dict) and "name" in item and dice.random() < 0.5:
        item["name"] = f"{item['name']}_2"
    items.insert(dice.randrange(len(items) + 1), item)
    return f"{words(path)}: an item twice ({shown(item)})"


def reorder(dice: random.Random, scene: Any) -> str | None:
    path = pick(dice, scene, lambda value: isinstance(value, list) and len(value) > 1)
    if path is None:
        return None
    dice.shuffle(at(scene, path))
    return f"{words(path)}: in another order"


def exchange(dice: random.Random, scene: Any) -> str | None:
    """Two values in each other's place, neither inside the other."""
    one, other = (pick(dice, scene, lambda value: True) for _ in range(2))
    if one is None or other is None or one[: len(other)] == other or other[: len(one)] == one:
        return None
    first, second = at(scene, one), at(scene, other)
    put(scene, one, second)
    put(scene, other, first)
    return f"{words(one)} and {words(other)} exchanged"


def rename_key(dice: random.Random, scene: Any) -> str | None:
    path = pick(dice, scene, lambda value: True)
    if path is None or not isinstance(path[-1], str):
        return None
    table, keys = at(scene, path[:-1]), [other[-1] for other in places(scene) if isinstance(other[-1], str)]
    new = dice.choice((path[-1] + "s", path[-1][:-1], dice.choice(WORDS), dice.choice(keys)))
    table[new] = table.pop(path[-1])
    return f"{words(path)}: key -> {shown(new)}"


def add_key(dice: random.Random, scene: Any) -> str | None:
    tables = [(), *(path for path in places(scene) if isinstance(at(scene, path), dict))]
    path = dice.choice(tables)
    keys = [other[-1] for other in places(scene) if isinstance(other[-1], str)]
    values = [at(scene, other) for other in places(scene)]
    key, value = dice.choice((*keys, "x")), copy.deepcopy(dice.choice((*values, 1.0, "x", True)))
    at(scene, path)[key] = value
    return f"{words((*path, key))}: added {shown(value)}"


def name_number(dice: random.Random, scene: Any) -> str | None:
    """A number by arithmetic with a variable, which may be broken."""
    path = pick(dice, scene, is_number)
    if path is None or not isinstance(scene.setdefault("variables", {}), dict):
        return None
    old, name = at(scene, path), dice.choice(("r", "q", "m", "s", "pi", "min", "x1"))
    scene["variables"][name] = dice.choice((old, f"{old} m", f"{old}*1", f"2*{name}", "r/q", "sqrt(q)", "1/(q - q)"))
    new = dice.choice((name, f"{name}/2 + {name}/2", f"2*{name}", f"{name} + 1 mm", f"-({name})^2", f"{name}*cos(30 deg)", f"atan2({name}, 1)"))
    put(scene, path, new)
    return f"{words(path)}: {shown(old)} -> {shown(new)}, {name} = {shown(scene['variables'][name])}"


def repeat(dice: random.Random, scene: Any) -> str | None:
    """Copies of a table, or of a marker."""
    path = pick(dice, scene, lambda value: isinstance(value, dict))
    if path is None:
        return None
    keys = {"repeat": dice.choice((0, 1, 2, 3, 6, 1001, "3", 2.5)), "about": dice.choice(("x", "z", "w", [0, 0, 1], [0, 0, 0])),
            "angles": dice.choice((["30 deg", "-30 deg"], [], [1, 2, 3], ["1 m"])), "mirror": dice.choice(("xy", "xz", "yz", "zz"))}  # fmt: skip
    chosen = {key: keys[key] for key in dice.sample(sorted(keys), dice.randrange(1, 4))}
    table = at(scene, path)
    table.update(chosen)
    for key in ("name", "joint", "base", "platform"):
        if isinstance(table.get(key), str) and dice.random() < 0.5:
            table[key] += "#"
    return f"{words(path)}: {chosen}"


def include(dice: random.Random, scene: Any) -> str | None:
    """Files that are there, or are not, or are the scene."""
    scene["include"] = dice.choice(("scene.toml", ".", "", "missing.toml", "/dev/zero", "../x.toml", ["a", 3], [], {"a": 1}, "/etc/passwd", "\n"))
    return f"include {scene['include']}"


def splice(other: dict[str, Any]) -> Callable[[random.Random, Any], str | None]:
    """A mutation that takes a table from another scene."""

    def take(dice: random.Random, scene: Any) -> str | None:
        key = dice.choice(list(other))
        value = copy.deepcopy(other[key])
        if isinstance(value, list) and isinstance(scene.get(key), list) and value:
            scene[key].append(dice.choice(value))
            return f"{key}: one of another scene's"
        scene[key] = value
        return f"{key}: another scene's"

    return take


OF_SCENES = (change_number,) * 10 + (change_text,) * 3 + (
    change_type, take_out, double, reorder, exchange, rename_key, add_key, name_number, name_number, repeat, repeat, include,
)  # fmt: skip


def change_slightly(dice: random.Random, scene: Any, n: int) -> list[str]:
    """Numbers of a scene, so that most scenes are mechanisms afterwards."""

    def other(old: Any) -> Any:
        return old * dice.choice(SLIGHT_FACTORS) if dice.random() < 0.7 else old + dice.gauss(0, 0.3)

    return [said for _ in range(n) if (said := vary(dice, scene, other)) is not None]


def mutate_scene(dice: random.Random, scene: dict[str, Any], other: dict[str, Any], n: int) -> list[str]:
    """A few mutations of a scene's content, in place; what they were."""
    done: list[str] = []
    while len(done) < n:
        change = dice.choice((*OF_SCENES, splice(other)))
        said = change(dice, scene)
        if said is not None:
            done.append(said)
    return done


# ---------------------------------------------------------------------------------------------------------- of text
def mutate_text(dice: random.Random, text: bytes) -> tuple[bytes, str]:
    """Bytes damaged in one place."""
    if not text:
        return b"\xff", "made of one byte"
    i, j = sorted(dice.randrange(len(text)) for _ in range(2))
    lines = text.split(b"\n")
    k = dice.randrange(len(lines))
    kind = dice.randrange(9)
    if kind == 0:
        return text[:i], f"cut after byte {i}"
    if kind == 1:
        j = min(j, i + dice.randint(1, 40))
        return text[:i] + text[j:], f"bytes {i} to {j} taken out"
    if kind == 2:
        more = dice.choice(BYTES) * dice.choice((1, 1, 1, 2, 50))
        return text[:i] + more + text[i:], f"{shown(more)} put in at byte {i}"
    if kind == 3:
        bits = bytes([text[i] ^ (1 << dice.randrange(8))])
        return text[:i] + bits + text[i + 1 :], f"a bit of byte {i} turned over"
    if kind == 4:
        return b"\n".join([*lines[:k], lines[k], *lines[k:]]), f"line {k + 1} twice"
    if kind == 5:
        return b"\n".join(lines[:k] + lines[k + 1 :]), f"line {k + 1} taken out"
    if kind == 6:
        m = dice.randrange(len(lines))
        lines[k], lines[m] = lines[m], lines[k]
        return b"\n".join(lines), f"lines {k + 1} and {m + 1} exchanged"
    if kind == 7:
        return text.replace(b"\n", dice.choice((b"\r\n", b"\r"))), "other line ends"
    deep = dice.choice((20, 300, 5000))
    return text + b"\nx = " + b"[" * deep + b"]" * deep + b"\n", f"{deep} brackets inside each other"


def mutate_table(dice: random.Random, table: bytes) -> tuple[bytes, str]:
    """A CSV table with a wrong number, row or column, or damaged like any text."""
    if dice.random() < 0.3:
        return mutate_text(dice, table)
    rows = [row.split(b",") for row in table.strip().split(b"\n")]
    k = dice.randrange(len(rows))
    c = dice.randrange(len(rows[k]))
    kind = dice.randrange(6)
    if kind == 0:
        rows[k][c] = str(dice.choice(NUMBERS)).encode()
        said = f"row {k + 1}, column {c + 1}: {rows[k][c].decode()}"
    elif kind == 1:
        rows[k][c] = dice.choice((b"", b" ", b"x", b"1e999", b"1,5", b'"', b"1 2", b"--1", b"0x10", b"1d3", b"+", b".", b"1_000", b"\xff"))
        said = f"row {k + 1}, column {c + 1}: {shown(rows[k][c])}"
    elif kind == 2:
        rows[k] = rows[k][:c]
        said = f"row {k + 1} ends before column {c + 1}"
    elif kind == 3:
        rows = [[value for i, value in enumerate(row) if i != c] for row in rows]
        said = f"column {c + 1} taken out"
    elif kind == 4:
        m = dice.randrange(len(rows))
        rows[k], rows[m] = rows[m], rows[k]
        said = f"rows {k + 1} and {m + 1} exchanged"
    else:
        rows = rows[: dice.choice((0, 1, 2, 3))]
        said = f"only {len(rows)} rows"
    return b"\n".join(b",".join(row) for row in rows) + b"\n", said


# ------------------------------------------------------------------------------------------------------ of arguments
def mutate_array(dice: random.Random, array: np.ndarray) -> Any:
    """An array of another shape, type or content, or no array at all."""
    array = np.array(array, dtype=float)
    kind = dice.randrange(22)
    if kind < 6 and array.size:
        array.flat[dice.randrange(array.size)] = float(dice.choice(NUMBERS))
        return array
    if kind == 6:
        return array * float(dice.choice(FACTORS))
    if kind == 7 and array.ndim:
        return array[..., :-1]
    if kind == 8:
        return np.concatenate([array, array[..., :1]], axis=-1) if array.ndim and array.size else array
    if kind == 9:
        return array[np.newaxis]
    if kind == 10:
        return array.ravel()
    if kind == 11:
        return array.astype(dice.choice((np.float32, np.longdouble, np.complex128, object, bool, np.float16)))
    if kind == 12:
        return np.nan_to_num(array).clip(-1e9, 1e9).astype(dice.choice((np.int8, np.int64, np.uint16)))
    if kind == 13:
        return array.tolist()
    if kind == 14 and array.ndim:
        return array[::-1].T
    if kind == 15:
        return np.ma.masked_invalid(array)
    if kind == 16:
        return np.asfortranarray(array)
    if kind == 17 and array.ndim:
        return array[:0]
    if kind == 18:
        return [[1.0], [1.0, 2.0]]
    return dice.choice(ODD)


ODD: tuple[Any, ...] = (
    None, True, False, "x", "", b"bytes", 0, -1, 1, 2.5, float("nan"), float("inf"), 10**30, 1j, [], (), {}, {"a": 1}, [None], ["1", "2"], object(),
    range(3), {1, 2}, np.float64(1.0), np.array("x"), np.array(None, dtype=object), datetime.date(2020, 1, 1), lambda: None, Ellipsis, type,
    np.datetime64("2020-01-01"), "é\x00", "\udcff", "x" * 5000, 2**31, 2**63, -(2**63), 0.1, [[[]]], ("a", 1), iter([1.0]),
)  # fmt: skip
"""What somebody may pass by mistake."""
