"""GLB files of bodies, written here byte by byte: triangles are where nodes place them, what is not read is refused, damage ends in one line."""
from __future__ import annotations

import json
import random
import struct

import linkdyn
import numpy as np
import pytest
from linkdyn._view.glb import NotReadError, triangles_of

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
VOLUME = 1.0


def glb(document, binary=b"", version=2):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + (struct.pack("<I4s", len(binary), b"BIN\0") + binary if binary else b"")
    return struct.pack("<4sII", b"glTF", version, 12 + len(chunks)) + chunks


def body(nodes=({"mesh": 0},), kind=5123, **more):
    """A tetrahedron whose corners lie between other numbers, 24 bytes apart, behind its indices."""
    indices = FACES.astype({5121: "<u1", 5123: "<u2", 5125: "<u4"}[kind]).tobytes()
    indices += b"\0" * (-len(indices) % 4)
    points = np.hstack([CORNERS, np.full((4, 3), np.nan)]).astype("<f4").tobytes()
    document = {
        "asset": {"version": "2.0"},
        "nodes": [dict(node) for node in nodes],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}, {"attributes": {"POSITION": 0}, "mode": 1}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}, {"bufferView": 1, "componentType": kind, "count": 12, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteOffset": len(indices), "byteLength": 96, "byteStride": 24}, {"buffer": 0, "byteLength": len(indices)}],
        "buffers": [{"byteLength": len(indices) + 96}],
    } | more
    return document, indices + points


def volume(triangles):
    return np.linalg.det(triangles).sum() / 6


@pytest.mark.parametrize("kind", [5121, 5123, 5125])
def test_triangles_are_those_of_the_file(kind):
    found = triangles_of(glb(*body(kind=kind)))
    np.testing.assert_array_equal(found, CORNERS[FACES])
    assert volume(found) == pytest.approx(VOLUME)


def test_without_indices_three_corners_each():
    document, _ = body()
    document["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 4}]}]
    document["accessors"] = [{"bufferView": 0, "componentType": 5126, "count": 12, "type": "VEC3", "byteOffset": 12}]
    document["bufferViews"] = [{"buffer": 0, "byteOffset": 0, "byteLength": 156}]
    found = triangles_of(glb(document, bytes(12) + CORNERS[FACES].astype("<f4").tobytes()))
    np.testing.assert_array_equal(found, CORNERS[FACES])


def test_nodes_place_what_is_below_them():
    """A quarter turn about z and a shift, twice as large; below it one by a matrix, of column after column; an image stays outside out."""
    half = np.sqrt(0.5)
    nodes = [
        {"children": [1, 2], "rotation": [0, 0, half, half], "translation": [10, 0, 0], "scale": [2, 2, 2]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
        {"mesh": 0, "scale": [-1, 1, 1]},
    ]
    found = triangles_of(glb(*body(nodes)))
    x, y, z = np.moveaxis(CORNERS[FACES], -1, 0)
    np.testing.assert_allclose(found[:4], np.stack([10 - 2 * y, 2 * x, 2 * (z + 5)], axis=-1), atol=1e-12)
    np.testing.assert_allclose(np.sort(found[4:], axis=1), np.sort(np.stack([10 - 2 * y, -2 * x, 2 * z], axis=-1), axis=1), atol=1e-12)
    assert volume(found[4:] - [10, 0, 0]) == pytest.approx(8 * VOLUME)


def test_the_scene_says_which_nodes_there_are():
    nodes = [{"mesh": 0}, {"mesh": 0, "translation": [1, 1, 1]}]
    assert len(triangles_of(glb(*body(nodes)))) == 8
    found = triangles_of(glb(*body(nodes, scene=1, scenes=[{"nodes": [0]}, {"nodes": [1]}])))
    np.testing.assert_array_equal(found, CORNERS[FACES] + 1)


def changed(change):
    document, binary = body()
    change(document)
    return glb(document, binary)


REFUSED = [
    (lambda: b"solid x", "is no GLB file"),
    (lambda: glb(*body(), version=1), "is of version 1 of glTF"),
    (lambda: glb(*body())[:-8], "is shorter than it says"),
    (lambda: changed(lambda d: d["accessors"][0].update(count=5)), "is shorter than it says"),
    (lambda: changed(lambda d: d["bufferViews"][0].update(byteStride=4)), "is shorter than it says"),
    (lambda: changed(lambda d: d.update(extensionsRequired=["KHR_draco_mesh_compression"])), "needs the extension 'KHR_draco_mesh_compression'"),
    (lambda: changed(lambda d: d["buffers"][0].update(uri="part.bin")), "in another file or as text"),
    (lambda: changed(lambda d: d["accessors"][0].update(sparse={})), "sparse"),
    (lambda: changed(lambda d: d["accessors"][0].update(componentType=5123)), "no floats"),
    (lambda: changed(lambda d: d["meshes"][0]["primitives"][0].update(mode=5)), "strips or fans"),
    (lambda: changed(lambda d: d["nodes"][0].update(skin=0)), "skin"),
    (lambda: changed(lambda d: d.update(nodes=[{"children": [1, 1]}, {"mesh": 0}])), "below two others"),
    (lambda: changed(lambda d: d.update(nodes=[{"children": [0]}], scenes=[{"nodes": [0]}])), "in a circle"),
    (lambda: changed(lambda d: d["nodes"][0].update(translation=["x", 0, 0])), "is damaged"),
    (lambda: changed(lambda d: d["nodes"][0].update(translation=[1e999, 0, 0])), "no numbers"),
    (lambda: changed(lambda d: d.update(meshes=3)), "is damaged"),
    (lambda: glb([1, 2]), "is damaged"),
]


@pytest.mark.parametrize(("make", "told"), REFUSED)
def test_what_is_not_read_is_told(make, told):
    with pytest.raises(NotReadError, match=told):
        triangles_of(make())


def test_extensions_of_looks_are_no_matter():
    assert len(triangles_of(changed(lambda d: d.update(extensionsRequired=["KHR_materials_unlit"])))) == 4


@pytest.mark.parametrize("first", range(0, 2000, 500))
def test_damage_ends_in_one_line(first):
    good = glb(*body([{"children": [1], "rotation": [0, 0, 0, 1]}, {"mesh": 0, "scale": [1, 1, 1]}]))
    words = [b"-1", b"1e308", b"null", b"true", b"[]", b"{}", b'"x"', b"99999999999", b"0.5"]
    for seed in range(first, first + 500):
        draw = random.Random(seed)
        damaged = bytearray(good)
        for _ in range(draw.choice([1, 1, 2, 5])):
            at = draw.randrange(len(damaged))
            word = draw.choice(words) if draw.random() < 0.5 else bytes([draw.randrange(256)])
            damaged[at : at + len(word)] = word
        try:
            assert triangles_of(bytes(damaged)).shape[1:] == (3, 3)
        except NotReadError as error:
            assert "\n" not in str(error), seed


def test_views_have_them(tmp_path):
    """In a scene, and by name; a wrong one is refused with its name."""
    scene = linkdyn.new("four-bar")
    (tmp_path / "part.glb").write_bytes(glb(*body()))
    (tmp_path / "wrong.GLB").write_bytes(glb(*body(), version=1))
    (tmp_path / "empty.glb").write_bytes(glb({"asset": {"version": "2.0"}}))
    try:
        html = linkdyn.view(scene, meshes={"crank": tmp_path / "part.glb"}, mesh_unit=0.5).html
    except linkdyn.UnavailableError:
        pytest.skip("built without the viewer")
    assert '"meshes":[{"link":1,"scale":0.5' in html
    for name, told in (("wrong.GLB", "is of version 1"), ("empty.glb", "has no triangles")):
        with pytest.raises(linkdyn.InputError, match=f"{name}': {told}"):
            linkdyn.view(scene, meshes={"crank": tmp_path / name})
