"""Triangles of a GLB file: the binary container of glTF 2.0, by the standard library and numpy.

Read are triangles of the file's scene, as its nodes place them; not materials and pictures, of which the viewer has no use, nor what moves.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["NotReadError", "triangles_of"]

MAGIC, JSON, BIN = b"glTF", b"JSON", b"BIN\0"
TRIANGLES = 4
LINES_AND_POINTS = range(4)
INDEX_TYPES = {5121: "<u1", 5123: "<u2", 5125: "<u4"}
FLOAT = 5126
ONLY_LOOKS = ("KHR_materials_", "KHR_texture_", "EXT_texture_")
"""Extensions that leave every triangle where it is."""

Matrix = NDArray[np.float64]


class NotReadError(ValueError):
    """What of a file is wrong, or not supported."""


def triangles_of(content: bytes) -> NDArray[np.float64]:
    """(N, 3, 3) corners of the triangles, in the file's own axes.

    Parameters
    ----------
    content
        Of the file.

    Raises
    ------
    NotReadError
        What the file is not, or what it has that is not read: all else than plain triangles in the file's own binary chunk.
    """
    try:
        document, binary = _chunks(content)
        _refuse_what_is_not_read(document)
        nodes = document.get("nodes", [])
        scenes = document.get("scenes")
        roots = scenes[document.get("scene", 0)].get("nodes", []) if scenes else _without_parent(nodes)
        found: list[NDArray[np.float64]] = []
        seen: set[int] = set()
        with np.errstate(all="ignore"):     # what is no number is told below
            for root in roots:
                _gather(document, binary, root, np.eye(4), seen, found)
    except NotReadError:
        raise
    except (AttributeError, IndexError, KeyError, RecursionError, TypeError, ValueError, struct.error) as error:
        raise NotReadError("is damaged, or no GLB file of glTF 2.0") from error
    triangles = np.concatenate(found) if found else np.empty((0, 3, 3))
    if not np.isfinite(triangles).all():
        raise NotReadError("has corners that are no numbers")
    return triangles


def _chunks(content: bytes) -> tuple[dict[str, Any], bytes]:
    """The description and the binary chunk, empty where there is none."""
    if content[:4] != MAGIC:
        raise NotReadError("is no GLB file")
    version, length = struct.unpack_from("<II", content, 4)
    if version != 2:
        raise NotReadError(f"is of version {version} of glTF (expected 2)")
    if length > len(content):
        raise NotReadError("is shorter than it says")
    chunks: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<I4s", content, at)
        chunks.setdefault(kind, content[at + 8 : min(at + 8 + size, length)])
        at += 8 + size
    document = json.loads(chunks[JSON])
    if not isinstance(document, dict):
        raise TypeError
    return document, chunks.get(BIN, b"")


def _refuse_what_is_not_read(document: dict[str, Any]) -> None:
    needed = [name for name in document.get("extensionsRequired", []) if not name.startswith(ONLY_LOOKS)]
    if needed:
        raise NotReadError(f"needs the extension {needed[0][:60]!r}, which is not read (expected one written without compression)")
    if any("uri" in buffer for buffer in document.get("buffers", [])):
        raise NotReadError("has its numbers in another file or as text, which is not read (expected them in its binary chunk)")


def _without_parent(nodes: list[dict[str, Any]]) -> list[int]:
    held = {child for node in nodes for child in node.get("children", [])}
    return [k for k in range(len(nodes)) if k not in held]


def _gather(document: dict[str, Any], binary: bytes, number: int, above: Matrix, seen: set[int], found: list[NDArray[np.float64]]) -> None:
    """Triangles of a node and of those below it."""
    if number in seen:
        raise NotReadError("has a node below two others, or in a circle")
    seen.add(number)
    node = document["nodes"][number]
    if "skin" in node:
        raise NotReadError("has a skin that bones move, which is not read (expected a rigid body)")
    place = above @ _placing(node)
    if "mesh" in node:
        for part in document["meshes"][node["mesh"]]["primitives"]:
            mode = part.get("mode", TRIANGLES)
            if mode in LINES_AND_POINTS:
                continue
            if mode != TRIANGLES:
                raise NotReadError("has strips or fans of triangles, which are not read (expected triangles one by one)")
            found.append(_placed(_corners(document, binary, part), place))
    for child in node.get("children", []):
        _gather(document, binary, child, place, seen, found)


def _placing(node: dict[str, Any]) -> Matrix:
    """From a node's axes to those above."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=float).reshape(4, 4).T
    x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=float)
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.array(node.get("scale", (1, 1, 1)), dtype=float)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def _placed(triangles: NDArray[np.float64], place: Matrix) -> NDArray[np.float64]:
    turned = triangles @ place[:3, :3].T + place[:3, 3]
    # an image has its corners the other way round: outside stays outside
    return turned[:, ::-1] if np.linalg.det(place[:3, :3]) < 0 else turned


def _corners(document: dict[str, Any], binary: bytes, part: dict[str, Any]) -> NDArray[np.float64]:
    """(N, 3, 3) of one primitive, in its node's axes."""
    places = document["accessors"][part["attributes"]["POSITION"]]
    if (places["type"], places["componentType"]) != ("VEC3", FLOAT):
        raise NotReadError("has places that are no floats, which are not read")
    points = _values(document, binary, places, "<f4", 3).astype(float)
    if "indices" not in part:
        return points[: len(points) // 3 * 3].reshape(-1, 3, 3)
    numbers = document["accessors"][part["indices"]]
    order = _values(document, binary, numbers, INDEX_TYPES[numbers["componentType"]], 1)[:, 0].astype(np.int64)
    return points[order[: len(order) // 3 * 3]].reshape(-1, 3, 3)


def _values(document: dict[str, Any], binary: bytes, accessor: dict[str, Any], kind: str, width: int) -> NDArray[Any]:
    """(count, width) numbers that an accessor names."""
    if "sparse" in accessor:
        raise NotReadError("has sparse accessors, which are not read")
    view = document["bufferViews"][accessor["bufferView"]]
    if view["buffer"] != 0:
        raise NotReadError("has several buffers, of which one is read")
    size = np.dtype(kind).itemsize
    stride = view.get("byteStride", width * size)
    first = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    count = accessor["count"]
    if min(first, count, stride - width * size) < 0 or (count and first + (count - 1) * stride + width * size > len(binary)):
        raise NotReadError("is shorter than it says")
    return np.ndarray((count, width), kind, binary, first, (stride, size))
