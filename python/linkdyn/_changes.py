"""Values of a scene changed by their paths."""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from ._arguments import quoted_name
from .errors import InputError, SceneError

__all__ = ["changed"]

INDEXED = re.compile(r"(.+?)((?:\[-?\d+\])+)")
"""An element of a list: "cog[0]"."""
_LABELS = {"coordinate": ("joint", "link", "marker"), "actuator": ("name", "joint"), "friction": ("joint",), "load": ("on",),
           "payload": ("on",), "controller": ("name", "actuator")}  # fmt: skip
"""What names the tables of a list; others have a name."""
_NAMED = ("markers", "variables", "measures", "laws")
"""Tables whose keys are names."""


def changed(scene: Mapping[str, Any], changes: Mapping[str, Any], read: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
    """A copy of a scene's content with other values.

    Parameters
    ----------
    scene
        As in a scene file.
    changes
        Path to new value, e.g. ``"link.crank.mass"``, ``"link.crank.cog[0]"`` or ``"actuator.J1.law"``. ``None`` takes the key out. A list of
        tables takes the path to its end too: ``"spring.S1"`` with a table puts or replaces that spring.
    read
        What reads a scene's content, and raises `SceneError` at an unknown key.

    Raises
    ------
    InputError
        The path leads nowhere, or to a new variable or marker that nothing refers to; ``None`` for a key that no scene has.
    """
    result = dict(scene)
    idle = []
    for path, value in changes.items():
        if not path:
            raise InputError("with_: '' is no path (expected such as 'link.crank.mass')")
        top = re.split(r"[.[]", path)[0]
        if top in scene and result.get(top) is scene[top]:   # what no path leads into stays the scene's
            result[top] = copy.deepcopy(scene[top])
        before = copy.deepcopy(result) if value is None else None
        _put(result, path, path, value)
        if result == before:
            idle.append(path)
    for path in idle:
        _refuse_misspelt(result, path, read)
    for path in changes:
        _refuse_idle_variable(scene, result, path)
        _refuse_idle_marker(scene, result, path)
    return result


def _refuse_misspelt(result: Mapping[str, Any], path: str, read: Callable[[dict[str, Any]], object]) -> None:
    """What is to be taken out and is not there: fine, if the scene file has such a key. Its reader knows the keys."""
    above, _, name = path.rpartition(".")
    if above.rpartition(".")[2] in _NAMED:
        raise InputError(f"with_: {quoted_name(path)} leads nowhere: there is no {quoted_name(name)} to take out")
    trial = copy.deepcopy(dict(result))
    _put(trial, path, path, {})
    try:
        read(trial)
    except SceneError as error:
        if f"unknown key {name!r}" in str(error):
            raise InputError(f"with_: {quoted_name(path)} leads nowhere: {error}") from None


def _refuse_idle_variable(scene: Mapping[str, Any], result: Mapping[str, Any], path: str) -> None:
    """A new variable to which nothing refers is one that is spelt otherwise in the scene: nothing would follow it."""
    table, _, name = path.partition(".")
    variables = scene.get("variables", {})
    if table != "variables" or not name or name in variables or any(re.search(rf"\b{re.escape(name)}\b", text) for text in _texts(result)):
        return
    known = ", ".join(map(repr, variables)) or "none"
    raise InputError(f"with_: {quoted_name(path)} leads nowhere: nothing refers to a variable {quoted_name(name)} (expected one of {known})")


def _refuse_idle_marker(scene: Mapping[str, Any], result: Mapping[str, Any], path: str) -> None:
    """So is a new marker: what was to be moved stays where it is."""
    table, _, name = path.rpartition(".markers.")
    body = table.removeprefix("link.")
    if not body or not name or INDEXED.fullmatch(name):
        return
    known = _link(scene, body).get("markers", {})
    marker = re.compile(rf"{re.escape(name)}[#\d]*")                        # "#" and numbers: of copies
    of_link = re.compile(rf"{re.escape(body)}[#\d]*\.{marker.pattern}")
    if name in known or any(of_link.fullmatch(text) for text in _texts(result)):
        return
    if any(marker.fullmatch(text) for text in _texts(_link(result, body).get("elastic"))):
        return
    raise InputError(f"with_: {quoted_name(path)} leads nowhere: nothing refers to a marker {quoted_name(f'{body}.{name}')} (expected one of "
                     f"{', '.join(map(repr, known)) or 'none'}; for one to look at, the whole table {quoted_name(table + '.markers')})")


def _link(scene: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """The table of a link, or of the frame."""
    links: list[Mapping[str, Any]] = [{"name": "frame"} | scene.get("frame", {}), *scene.get("link", [])]
    return next((link for link in links if link.get("name") == name), {})


def _texts(value: Any) -> Iterator[str]:
    """All texts that are values in a scene, or parts of its lists and tables."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for item in value.values():
            yield from _texts(item)
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from _texts(item)


def _put(table: Any, rest: str, path: str, value: Any) -> None:
    """Go one step down the path, or put the value."""
    key, dot, below = rest.partition(".")
    if not isinstance(table, dict):
        raise InputError(f"with_: {quoted_name(path)} leads nowhere: there is no table above {quoted_name(key)}")
    if (place := INDEXED.fullmatch(key)) and key not in table:
        indices = [int(index) for index in re.findall(r"-?\d+", place[2])]
        if not dot:
            _put_at(table, place[1], indices, path, value)
        else:
            holder, last = _holder(table, place[1], indices, path)
            _put(holder[last], below, path, value)
        return
    inner = table.get(key)
    if not dot:
        if value is None:
            table.pop(key, None)
        else:
            table[key] = value
    elif isinstance(inner, list) and inner and all(isinstance(item, dict) for item in inner):
        _put_in_list(inner, key, below, path, value)
    elif inner is None and isinstance(value, Mapping) and "." not in below and key in ("spring", "load", "payload", "actuator", "friction", "controller", "clutch"):
        table[key] = [value]
    elif inner is None:
        known = ", ".join(repr(name) for name in table)
        raise InputError(f"with_: {quoted_name(path)} leads nowhere: there is no {quoted_name(key)} (expected one of {known})")
    else:
        _put(inner, below, path, value)


def _put_at(table: dict[str, Any], key: str, indices: list[int], path: str, value: Any) -> None:
    """Put an element of a list, or of a list in it."""
    if value is None:
        raise InputError(f"with_: {quoted_name(path)} leads nowhere: an element of a list can only be given another value")
    holder, last = _holder(table, key, indices, path)
    holder[last] = value


def _holder(table: dict[str, Any], key: str, indices: list[int], path: str) -> tuple[list[Any], int]:
    """The list that has an element, and which of its elements it is."""
    holder: Any = table.get(key)
    for depth, index in enumerate(indices, start=1):
        if not isinstance(holder, list) or not 0 <= index < len(holder):
            has = f"{len(holder)} elements" if isinstance(holder, list) else "no list"
            raise InputError(f"with_: {quoted_name(path)} leads nowhere: {quoted_name(key)} has {has} (the first is [0])")
        if depth < len(indices):
            holder = holder[index]
    return holder, indices[-1]


def _put_in_list(items: list[dict[str, Any]], key: str, rest: str, path: str, value: Any) -> None:
    """The table of a list whose name begins the rest of the path; names may have dots."""
    labels = [_label(key, item) for item in items]
    label = max((label for label in labels if f"{rest}.".startswith(f"{label}.")), key=len, default="")
    if label and labels.count(label) > 1:
        raise InputError(f"with_: {quoted_name(path)}: several in {quoted_name(key)} are called {quoted_name(label)} "
                         f"(expected one of them, by its number: {key}[{labels.index(label)}] is the first)")
    if label:
        i = labels.index(label)
        if rest != label:
            _put(items[i], rest[len(label) + 1 :], path, value)
            return
        if isinstance(value, Mapping):
            items[i] = dict(value)
            return
        if value is None:
            del items[i]
            return
    if isinstance(value, Mapping) and _label(key, value) == rest:
        items.append(dict(value))
        return
    if label:
        raise InputError(f"with_: {quoted_name(path)} is a whole {key} (expected a table or None for it, or the path of one of its values)")
    known = ", ".join(map(repr, labels))
    raise InputError(f"with_: {quoted_name(path)} leads nowhere: there is no {key} {quoted_name(rest.split('.')[0])} (expected one of {known})")


def _label(key: str, item: Mapping[str, Any]) -> str:
    """What a table of a list is called: "crank", "J1", "C.slide", "platform.tool"; a chain without name as its legs are."""
    name = next((str(item[label]) for label in _LABELS.get(key, ("name",)) if label in item), "leg" if key == "chain" else "")
    has_variable = "variable" in item and "name" not in item and key in _LABELS and key != "controller"
    return f"{name}.{item['variable']}" if has_variable else name
