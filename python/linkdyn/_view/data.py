"""A run as the viewer takes it (viewer/src/data.js): a description for JSON, and one block of numbers.

Python says what is there (links, joints with their travel, forces and where they act, charts with units), JavaScript what it looks like.
Numbers are as exact as a screen needs and as small as a mail wants: of rotations two columns in 16 bit, positions in single precision,
results in single precision cut to 16 binary digits.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from .._cycle.averages import need_order
from .._drawing.forces import Forces, find_forces
from .._drawing.names import parts_of_slots
from .._drawing.style import COLOURS, readable
from .._event_sides import EventSides
from .._geometry.cams import face_radius, is_cam, outlines_in_link, roller_axis
from .._geometry.postures import ELEVATION, Postures, best_azimuth, find_postures, poses_of, seen_markers
from .._geometry.springs import acts_along
from .._geometry.telescopes import SLIDING, is_telescope
from .._geometry.wheels import is_geared, rack_end_in_link, runs_in_carrier, thread_in_link
from .._units import units_of
from ..errors import FileError, InputError
from ..scene import Scene
from .glb import NotReadError, triangles_of

__all__ = ["Block", "describe"]

MOST_FRAMES = 2000
"""Of a view: at 25 a second over a minute, and a file that browsers open at once."""
TURN = 32767
"""A component of a direction is sent as an integer of 16 bit: 3e-5 rad, less than a pixel."""
ROOM = 0.1
"""Round a planar mechanism, for arrows; of its extent."""
FAR = 5.0
"""Extents from the world's origin, from where on a picture has its own."""
FEW = 12
"""Joints whose names do not hide the picture."""
CLEAR = 8
"""Joints whose ways may all be drawn."""
TITLES = {"q": "coordinates", "qd": "rates of the coordinates", "qdd": "accelerations of the coordinates"}
LARGEST = 1e30
"""Numbers beyond are shown as none: they are sent in single precision, lengths are their squares."""
ENERGIES = ("kinetic_energy", "potential_energy", "work")
Values = NDArray[np.float64]


class Block:
    """Arrays of any kind, one after the other."""

    def __init__(self) -> None:
        self.entries: list[dict[str, Any]] = []
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, name: str, values: ArrayLike, dtype: str) -> str:
        """Put an array in; its name."""
        with np.errstate(over="ignore"):    # infinite ones are not drawn
            array = np.ascontiguousarray(values, dtype=np.dtype(dtype).newbyteorder("<"))
        if dtype == "float32":
            array = _short(array)
        self.entries.append({"name": name, "dtype": dtype, "shape": array.shape, "offset": self._size})
        part = array.tobytes()
        part += bytes(-len(part) % 8)  # each begins where the widest numbers may
        self._parts.append(part)
        self._size += len(part)
        return name

    def __bytes__(self) -> bytes:
        return b"".join(self._parts)


def _short(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Rounded to 16 binary digits, a relative 1e-5, finer than any screen: the zeros behind them take no room."""
    bits = values.view(np.uint32)
    finite = np.isfinite(values)
    return np.where(finite, (bits + np.uint32(0x80)) & np.uint32(0xFFFFFF00), bits).view(np.float32)


def describe(
    run: xr.Dataset,
    scene: Scene,
    *,
    kinds: Iterable[str],
    plots: Iterable[str] | None = None,
    traces: Iterable[str] | None = None,
    meshes: Mapping[str, tuple[str, float]] | None = None,
    origin: Sequence[float] | None = None,
) -> tuple[dict[str, Any], bytes]:
    """The description and the block of a run.

    Parameters
    ----------
    run
        Of `Scene.inverse` or `Scene.forward`; more than `MOST_FRAMES` samples are thinned out evenly.
    scene
        Its mechanism.
    kinds
        Forces that are shown at first.
    plots
        Names of two results at most; default: driving forces, and joint forces.
    traces
        Markers ("coupler.tool"); default: those that move and hold no joint, of a small planar mechanism the joints too.
    meshes
        Link to STL or GLB file, in the link's axes, and the unit of its coordinates [m].
    origin
        (3,) where the picture has its own [m]; default: the world's, or a round place nearby where that is far.
    """
    need_order(run, "view")
    kept = np.unique(np.round(np.linspace(0, run.sizes["sample"] - 1, min(MOST_FRAMES, run.sizes["sample"]))).astype(int))
    frames = run.isel(sample=kept)
    poses = poses_of(scene, run)
    postures, assembled = find_postures(scene, poses)
    if not assembled[kept].any():
        raise InputError("view: no sample of the run could be assembled")
    held = kept[_last_good(assembled[kept])]  # the picture stands still where there is none
    low, high = (edge(postures.points[held].reshape(-1, 3), axis=0) for edge in (np.min, np.max))
    extent = max(float((high - low).max()), 1e-6)
    up = _up(scene)
    here = _origin(low, high, extent) if origin is None else np.asarray(origin, dtype=float)
    low, high = low - here, high - here
    block = Block()
    timed = "time" in run.coords
    block.add("time", frames.time.values if timed else kept, "float64")
    block.add("status", np.where(assembled[kept], frames.status.values, np.maximum(frames.status.values, 1)), "uint8")
    block.add("position", poses.position[held] - here, "float32")
    block.add("axes", TURN * poses.rotation[held][..., :2].swapaxes(-1, -2), "int16")
    ground = float(((postures.points[held] - here) @ up).min()) - 0.032 * extent
    some = held[:: max(1, len(held) // 20)]
    block.add("cloud", (postures.points[some] - here).reshape(-1, 3), "float32")
    charts = _charts(frames, block)
    description = {
        "title": scene.title,
        "planar": scene.planar,
        "timed": timed,
        "stride": "" if len(kept) == run.sizes["sample"] else f"{len(kept)} of {run.sizes['sample']} samples",
        "flags": [flag.replace("_", " ") for flag in run.status.attrs.get("flag_meanings", "").split()],
        "up": up.tolist(),
        "ground": ground,
        "extent": extent,
        "origin": here.tolist(),
        "box": [(low - ROOM * extent).tolist(), (high + ROOM * extent).tolist()],
        "eye": [best_azimuth(postures.points[held[0]] @ _level(up)), ELEVATION],
        "palette": COLOURS[:-1],
        "links": [link | {"markers": seen_markers(scene, k)} for k, link in enumerate(scene.description["links"])],
        "joints": [_joint(joint, postures, held) for joint in scene.description["joints"]],
        "springs": scene.description["springs"],
        "arrows": [_arrows(item, k, kept, block) for k, item in enumerate(find_forces(run, postures))],
        "traces": [_trace(scene, link, marker) for link, marker in _traced(scene, postures, held, extent, traces)],
        "meshes": [_mesh(scene, link, file, unit, block) for link, (file, unit) in (meshes or {}).items()],
        "names": _names(scene, postures, held[0], extent),
        "charts": charts,
        "plots": _chosen(charts, plots),
        "shown": [*kinds, *(["traces"] if scene.planar or traces else []), *(["names"] if scene.planar and len(scene.joints) <= FEW else [])],
        "arrays": block.entries,
    }
    return _seen_from(here, description), bytes(block)


def _origin(low: Values, high: Values, extent: float) -> Values:
    """Where a picture far from the origin has its own: short numbers have no digits left there. Lines of the grid stay where they are."""
    middle = (low + high) / 2
    if np.abs(middle).max() <= FAR * extent:
        return np.zeros(3)
    step = 10.0 ** np.ceil(np.log10(extent))
    place: Values = step * np.round(middle / step)
    return place


def _seen_from(origin: Values, description: dict[str, Any]) -> dict[str, Any]:
    """What is told in axes of the frame, seen from the picture's origin; other links have their places among the numbers."""
    if not origin.any():
        return description

    def moved(point: Iterable[float]) -> list[float]:
        own: list[float] = (np.asarray(list(point), dtype=float) - origin).tolist()
        return own

    def place(told: list[Any]) -> list[Any]:
        return told if told[0] != 0 else [0, *moved(told[1:])]

    def joint(told: dict[str, Any]) -> dict[str, Any]:
        first, second = told["links"]
        changes: dict[str, Any] = {}
        if first == 0:
            changes |= {key: [moved(point) for point in told[key]] for key in ("thread",) if key in told}
            changes |= {key: [[moved(point) for point in line] for line in told[key]] for key in ("outlines",) if key in told}
        if told.get("carrier") == 0:
            changes |= {"pitch": moved(told["pitch"])}
            changes |= {key: [[moved(point) for point in run] for run in told[key]] for key in ("runs",) if key in told}
        if second == 0 and "rack_end" in told:
            changes |= {"rack_end": moved(told["rack_end"])}
        return told | changes

    frame, *links = description["links"]
    return description | {
        "links": [frame | {"markers": [marker | {"at": moved(marker["at"])} for marker in frame["markers"]]}, *links],
        "joints": [joint(told) for told in description["joints"]],
        "arrows": [arrow | {"at": [place(at) for at in arrow["at"]]} for arrow in description["arrows"]],
        "meshes": [mesh | {"offset": (-origin).tolist()} if mesh["link"] == 0 else mesh for mesh in description["meshes"]],
        "names": [[text, is_link, *(place(at) for at in places)] for text, is_link, *places in description["names"]],
    }


def _last_good(good: NDArray[np.bool_]) -> NDArray[np.intp]:
    """For each sample the last good one up to it; before the first, that."""
    last = np.maximum.accumulate(np.where(good, np.arange(len(good)), -1))
    return np.where(last < 0, np.argmax(good), last)


# ---------------------------------------------------------------- picture


def _up(scene: Scene) -> Values:
    """The axis that is nearest to against gravity; z without gravity."""
    gravity = np.array(scene.description["gravity"])
    axis = int(np.argmax(np.abs(gravity))) if gravity.any() and not scene.planar else 2
    up: Values = np.eye(3)[axis] * (1.0 if scene.planar or gravity[axis] <= 0 else -1.0)
    return up


def _level(up: Values) -> Values:
    """(3, 3) columns: two directions across ``up``, as viewer/src/stage.js has them, and ``up``."""
    side = np.array([0.0, 1.0, 0.0] if abs(up[0]) > 0.9 else [1.0, 0.0, 0.0])
    return np.stack([side, np.cross(up, side), up], axis=1)


def _joint(joint: dict[str, Any], postures: Postures, held: NDArray[np.intp]) -> dict[str, Any]:
    if is_cam(joint):
        seen = {key: value for key, value in joint.items() if key != "curve"}
        sample = int(held[0])
        turn = postures.turns[joint["links"][1]][sample]
        axis = roller_axis(postures.at(sample), joint)[0] @ turn
        lines = outlines_in_link(postures, sample, joint)
        return seen | {"outlines": [line[:-1].round(9).tolist() for line in lines], "roller_axis": axis.round(9).tolist(), "face_radius": face_radius(lines)}
    if joint["type"] == "belt":
        return joint | {"runs": runs_in_carrier(postures, joint, int(held[0]))}
    if joint["type"] == "rack":
        return joint | {"rack_end": rack_end_in_link(postures, joint, int(held[0]))}
    if joint.get("lead_angle"):
        return joint | {"thread": thread_in_link(postures, joint, int(held[0]))}
    if joint["type"] == "planar":
        return joint | {"field": postures.field(joint, held)}
    if joint["type"] in SLIDING:
        return joint | {"travel": list(postures.travel(joint, held)), "telescopes": is_telescope(postures.scene.description, joint)}
    return joint


def _marker(scene: Scene, link: int, marker: str) -> list[float]:
    return next(entry["at"] for entry in scene.description["links"][link]["markers"] if entry["name"] == marker)


def _arrows(item: Forces, k: int, kept: NDArray[np.intp], block: Block) -> dict[str, Any]:
    size = np.linalg.norm(item.force, axis=-1)
    seen = size[size < LARGEST]     # neither NaN nor infinite
    return {
        "kind": item.kind,
        "label": item.label,
        "torque": item.is_torque,
        "largest": float(seen.max(initial=0.0)),
        "values": block.add(f"arrows{k}", item.force[kept], "float32"),
        "at": [[link, *point] for link, point in item.at],
    }


def _trace(scene: Scene, link: int, marker: str) -> dict[str, Any]:
    return {"link": link, "at": _marker(scene, link, marker)}


def _traced(
    scene: Scene, postures: Postures, held: NDArray[np.intp], extent: float, traces: Iterable[str] | None
) -> list[tuple[int, str]]:
    """Markers whose ways are drawn, each way once."""
    links = scene.description["links"]
    markers = [(k, marker["name"]) for k, link in enumerate(links) for marker in link["markers"] if k > 0]
    if traces is not None:
        place = {f"{links[k]['name']}.{name}": (k, name) for k, name in markers}
        for name in traces:
            if name not in place:
                raise InputError(f"view: traces: there is no moving marker {name!r} (expected such as {next(iter(place), '')!r})")
        return [place[name] for name in traces]
    jointed = {end for joint in scene.description["joints"] if not is_geared(joint) for end in zip(joint["links"], joint["markers"])}
    most = CLEAR if scene.planar else 0
    found: list[tuple[int, str]] = []
    for link, name in markers:
        way = postures.markers[link][name][held]
        if ((link, name) in jointed and len(scene.joints) > most) or np.ptp(way, axis=0).max() < 1e-6 * extent:
            continue
        if all(np.abs(postures.markers[k][other][held] - way).max() > 1e-6 * extent for k, other in found):
            found.append((link, name))
    return found


def _mesh(scene: Scene, link: str, file: str, unit: float, block: Block) -> dict[str, Any]:
    names = [entry["name"] for entry in scene.description["links"]]
    if link not in names:
        raise InputError(f"view: meshes: there is no link {link!r} (expected one of {', '.join(map(repr, names))})")
    path = Path(file)
    kind = path.suffix.lower()
    if kind not in (".stl", ".glb"):
        raise InputError(f"view: meshes: '{path}': expected a file that ends in .stl or .glb")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FileError(f"view: meshes: '{path}': {error.strerror}") from error
    if kind == ".glb":
        content = _as_stl(path, content)
    elif not _has_triangles(content):
        raise InputError(f"view: meshes: '{path}': has no triangles, or fewer than it says (expected an STL file, as text or binary)")
    return {"link": names.index(link), "scale": unit, "values": block.add(f"mesh.{link}", np.frombuffer(content, np.uint8), "uint8")}


def _as_stl(path: Path, content: bytes) -> bytes:
    """Triangles of a GLB file as the browser reads them; it finds normals itself."""
    try:
        triangles = triangles_of(content)
    except NotReadError as error:
        raise InputError(f"view: meshes: '{path}': {error}") from error
    if not len(triangles):
        raise InputError(f"view: meshes: '{path}': has no triangles")
    facets = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    facets["corners"] = triangles
    return b" " * 80 + len(facets).to_bytes(4, "little") + facets.tobytes()


def _has_triangles(content: bytes) -> bool:
    """What the browser reads of an STL file: 80 bytes, a count and 50 bytes a triangle; or the words "solid", "facet", "vertex" of the text.

    Binary ones may begin with "solid" as well, so their length decides.
    """
    count = int.from_bytes(content[80:84], "little")
    if count and len(content) >= 84 + 50 * count:
        return True
    return content.lstrip()[:5].lower() == b"solid" and content.lower().count(b"vertex") >= 3


def _names(scene: Scene, postures: Postures, sample: int, extent: float) -> list[list[Any]]:
    """[text, is it a link's, places [link, x, y, z] whose middle it stands at]; those of a chain ("leg1.U", ...) as one."""
    gathered: dict[Any, tuple[list[str], list[list[Any]]]] = {}
    geared: list[list[Any]] = []
    of_slots = parts_of_slots(scene.description)
    for joint in scene.description["joints"]:
        if joint["name"] in of_slots:
            continue
        if is_geared(joint):
            geared.append([joint["name"], False, [joint["carrier"], *joint["pitch"]]])
            continue
        link, marker = joint["links"][1], joint["markers"][1]
        chain, dot, _ = joint["name"].partition(".")
        at = np.round(postures.markers[link][marker][sample] / (1e-3 * extent)) if not dot else chain
        texts, places = gathered.setdefault(chain if dot else tuple(at), ([], []))
        if (text := chain if dot else joint["name"]) not in texts:
            texts.append(text)
        places.append([link, *_marker(scene, link, marker)])
    found: list[list[Any]] = [[", ".join(texts), False, *places] for texts, places in gathered.values()] + geared
    for spring in filter(acts_along, scene.description["springs"]):
        found.append([spring["name"], False, *([link, *_marker(scene, link, marker)] for link, marker in zip(spring["links"], spring["markers"]))])
    for k, link_entry in enumerate(scene.description["links"]):
        if k > 0 and "." not in link_entry["name"] and link_entry["markers"]:
            found.append([link_entry["name"], True, *([k, *marker["at"]] for marker in link_entry["markers"])])
    return found


# ---------------------------------------------------------------- results


def _charts(run: xr.Dataset, block: Block) -> list[dict[str, Any]]:
    """Every result over the samples, like units together."""
    charts: list[dict[str, Any]] = []

    sides = EventSides.of(run)
    sides = EventSides(run, sides.events[:MOST_FRAMES], sides.time[: 2 * MOST_FRAMES])
    if sides.events.size:
        block.add("event_time", sides.time, "float64")

    def add(result: str, title: str, names: Iterable[Any], values: Values, unit: str, beside: Values | None = None) -> None:
        """Values at the samples, and beside events, where these have some."""
        values, beside = (np.where(np.abs(one) < LARGEST, one, np.nan) for one in (values, values[:0] if beside is None else beside))
        finite = np.abs(np.concatenate([values[np.isfinite(values)], beside[np.isfinite(beside)]]))
        if not finite.size:
            return
        factor, shown = readable(unit, float(finite.max()))
        name = block.add(f"chart{len(charts)}", factor * values, "float32")
        chart = {"result": result, "title": title, "unit": shown, "names": [str(text) for text in names], "values": name}
        if len(beside):
            chart["beside"] = block.add(f"beside{len(charts)}", factor * beside, "float32")
        charts.append(chart)

    for name, variable in run.data_vars.items():
        title = TITLES.get(str(name), str(name).replace("_", " "))
        if name == "reaction":
            for letter, quantity, unit in (("F", "force", "N"), ("M", "moment", "N m")):
                part = [k for k, text in enumerate(run.component.values) if str(text).startswith(letter)]
                size, beside = (np.linalg.norm(values[..., part], axis=-1) for values in (variable.values, sides.rows("reaction")))
                add("reaction", f"joint {quantity}", run.joint.values, size, unit, beside)
        elif name in ENERGIES or variable.dims[:1] != ("sample",) or variable.dtype.kind != "f":
            continue
        elif variable.ndim == 1:
            add(str(name), title, [title], variable.values[:, np.newaxis], variable.attrs.get("units", "1"), sides.rows(str(name))[:, np.newaxis])
        elif variable.ndim == 2:
            units = units_of(variable)
            for unit in dict.fromkeys(units):
                columns = [k for k, other in enumerate(units) if other == unit]
                quantity = "driving torque" if (name, unit) == ("driving_force", "N m") else title
                add(str(name), quantity, variable[variable.dims[1]].values[columns], variable.values[:, columns], unit, sides.rows(str(name))[:, columns])
    energies = [name for name in ENERGIES if name in run]
    if energies:
        values = np.stack([run[name].values for name in energies], axis=-1)
        add("kinetic_energy", "energies", [name.replace("_", " ") for name in energies], values, "J")
    return sorted(charts, key=lambda chart: _rank(chart["result"]))


def _rank(result: str) -> int:
    first = ("driving_force", "reaction", "driving_power", "driving_speed", "q", "qd", "qdd", "kinetic_energy", "joint_variable")
    return first.index(result) if result in first else len(first)


def _chosen(charts: list[dict[str, Any]], plots: Iterable[str] | None) -> list[int]:
    """Numbers of the charts that are shown at first."""
    results = [chart["result"] for chart in charts]
    if plots is None:
        wanted = [name for name in ("driving_force", "reaction", "q", "qd") if name in results][:2]
        return [results.index(name) for name in wanted]
    for name in plots:
        if name not in results:
            known = ", ".join(dict.fromkeys(results))
            raise InputError(f"view: plots: the run has no {name!r} (expected some of {known})")
    return [results.index(name) for name in plots]
