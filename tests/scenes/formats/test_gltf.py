"""The glTF reader: node transforms, strips, sparse and quantised positions, and accessors held to their buffers."""

from __future__ import annotations

import copy
import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mesh_files import (
    CHANGES,
    TRIANGLES,
    VERTICES,
    changed,
    corners,
    glb,
    gltf,
    gltf_document,
    require_mesh_or_error,
    signed_volume,
    written,
)

from shadowbench.errors import SceneError
from shadowbench.scenes.formats.gltf import read
from shadowbench.scenes.formats.polygons import Polygons, check, triangulate

HALF = math.sqrt(0.5)


def _read(tmp_path: Path, document: dict[str, Any], buffer: bytes) -> Polygons:
    return read(written(tmp_path, "solid.glb", glb(document, buffer)))


def _with(**changes: Any) -> tuple[dict[str, Any], bytes]:
    """The solid's document with members replaced."""
    document, buffer = gltf_document()
    return {**document, **changes}, buffer


@pytest.mark.parametrize("write", [glb, gltf], ids=["glb", "gltf"])
def test_vertices_and_triangles_come_out_as_written(tmp_path: Path, write: Any) -> None:
    polygons = read(written(tmp_path, "solid", write(*gltf_document())))
    np.testing.assert_array_equal(polygons.vertices, VERTICES)
    np.testing.assert_array_equal(polygons.corners.reshape(-1, 3), TRIANGLES)
    assert polygons.up == "y"


def test_a_buffer_beside_the_file_is_found(tmp_path: Path) -> None:
    document, buffer = gltf_document()
    document["buffers"][0]["uri"] = "the%20solid.bin"
    path = written(tmp_path, "solid.gltf", json.dumps(document))
    with pytest.raises(SceneError, match=r"needs the file 'the%20solid\.bin'"):
        read(path)
    written(tmp_path, "the solid.bin", buffer)
    np.testing.assert_array_equal(read(path).vertices, VERTICES)


NODES = {
    "translation": [{"mesh": 0, "translation": [10, 20, 30]}],
    "rotation": [{"mesh": 0, "rotation": [0, HALF, 0, HALF]}],
    "scale": [{"mesh": 0, "scale": [2, 3, 4]}],
    "all three": [{"mesh": 0, "translation": [1, 2, 3], "rotation": [0.5, 0.5, 0.5, 0.5], "scale": [1, 2, 1]}],
    "matrix": [{"mesh": 0, "matrix": [0, 0, -2, 0, 0, 2, 0, 0, 2, 0, 0, 0, 5, 6, 7, 1]}],
    "nested": [
        {"children": [1], "translation": [10, 0, 0], "rotation": [0, HALF, 0, HALF]},
        {"mesh": 0, "children": [2], "scale": [1, 2, 3]},
        {"mesh": 0, "translation": [0, 7, 0]},
    ],
}


@pytest.mark.parametrize("nodes", NODES.values(), ids=NODES)
def test_vtk_places_nodes_the_same(tmp_path: Path, nodes: list[dict[str, Any]]) -> None:
    pyvista = pytest.importorskip("pyvista")
    path = written(tmp_path, "solid.glb", glb(*_with(nodes=nodes)))
    ours = read(path)
    surfaces = _leaves(pyvista.read(path))
    theirs = np.concatenate([s.points[s.faces.reshape(-1, 4)[:, 1:]] for s in surfaces]).astype(np.float64)
    soup = np.round(theirs, 4).reshape(-1, 3)
    np.testing.assert_allclose(
        corners(np.round(ours.vertices, 4), ours.corners), corners(soup, np.arange(len(soup))), atol=1e-5
    )


def _leaves(block: Any) -> list[Any]:
    return [leaf for child in block for leaf in _leaves(child)] if hasattr(block, "n_blocks") else [block]


def test_a_quarter_turn_about_y_takes_z_to_x(tmp_path: Path) -> None:
    polygons = _read(tmp_path, *_with(nodes=NODES["rotation"]))
    np.testing.assert_allclose(polygons.vertices, VERTICES[:, [2, 1, 0]] * [1, 1, -1], atol=1e-12)


def test_a_mirrored_node_still_faces_outwards(tmp_path: Path) -> None:
    polygons = _read(tmp_path, *_with(nodes=[{"mesh": 0, "scale": [-1, 1, 1]}]))
    assert signed_volume(polygons.vertices, triangulate(polygons)) == pytest.approx(signed_volume(VERTICES, TRIANGLES))


def test_without_scenes_the_nodes_without_parents_are_drawn(tmp_path: Path) -> None:
    document, buffer = _with(nodes=[{"mesh": 0, "translation": [0, 5, 0]}, {"children": [0], "scale": [1, 2, 1]}])
    del document["scenes"], document["scene"]
    np.testing.assert_array_equal(
        _read(tmp_path, document, buffer).vertices, (VERTICES + np.array([0, 5, 0])) * [1, 2, 1]
    )


@pytest.mark.parametrize(
    ("mode", "indices", "expected"),
    [
        (4, [0, 1, 2, 1, 3, 2, 4], [(0, 1, 2), (1, 3, 2)]),
        (5, [0, 1, 2, 3, 4], [(0, 1, 2), (1, 3, 2), (2, 3, 4)]),
        (6, [0, 1, 2, 3, 4], [(1, 2, 0), (2, 3, 0), (3, 4, 0)]),
    ],
)
def test_lists_strips_and_fans_follow_the_specification(
    tmp_path: Path, mode: int, indices: list[int], expected: list[tuple[int, int, int]]
) -> None:
    document, buffer = gltf_document()
    start = document["bufferViews"][1]["byteOffset"]
    packed = struct.pack(f"<{len(indices)}H", *indices)
    document["meshes"][0]["primitives"][0]["mode"] = mode
    document["accessors"][1]["count"] = len(indices)
    polygons = _read(tmp_path, document, buffer[:start] + packed + buffer[start + len(packed) :])
    assert polygons.corners.reshape(-1, 3).tolist() == [list(t) for t in expected]


def test_positions_without_indices_are_triangles_in_order(tmp_path: Path) -> None:
    document, buffer = gltf_document()
    del document["meshes"][0]["primitives"][0]["indices"]
    document["accessors"][0]["count"] = 3
    assert _read(tmp_path, document, buffer).corners.tolist() == [0, 1, 2]


def test_interleaved_quantised_positions(tmp_path: Path) -> None:
    document, _ = gltf_document()
    quantised = np.zeros((5, 4), "<i2")
    quantised[:, :3] = [(0, 0, 0), (32767, 0, 0), (0, -32767, 0), (0, 0, -32768), (16384, 0, 0)]
    indices = TRIANGLES.astype("<u2").tobytes()
    document["accessors"][0] |= {"componentType": 5122, "normalized": True}
    document["bufferViews"] = [
        {"buffer": 0, "byteLength": 40, "byteStride": 8},
        {"buffer": 0, "byteOffset": 40, "byteLength": len(indices)},
    ]
    document["buffers"] = [{"byteLength": 40 + len(indices)}]
    vertices = _read(tmp_path, document, quantised.tobytes() + indices).vertices
    expected = [(0, 0, 0), (1, 0, 0), (0, -1, 0), (0, 0, -1), (16384 / 32767, 0, 0)]
    np.testing.assert_allclose(vertices, expected, atol=1e-15)


def test_sparse_positions_replace_some(tmp_path: Path) -> None:
    document, buffer = gltf_document()
    extra = struct.pack("<H2x", 3) + np.array([7, 8, 9], "<f4").tobytes()
    document["accessors"][0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": 2, "componentType": 5123},
        "values": {"bufferView": 2, "byteOffset": 4},
    }
    document["bufferViews"].append({"buffer": 0, "byteOffset": len(buffer), "byteLength": len(extra)})
    document["buffers"][0]["byteLength"] += len(extra)
    expected = VERTICES.copy()
    expected[3] = (7, 8, 9)
    np.testing.assert_array_equal(_read(tmp_path, document, buffer + extra).vertices, expected)


def test_lines_and_points_are_left_out_and_counted(tmp_path: Path) -> None:
    document, buffer = gltf_document()
    document["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": 1})
    polygons = _read(tmp_path, document, buffer)
    assert len(polygons.corner_counts) == len(TRIANGLES)
    assert len(polygons.notes) == 1
    assert "1 point or line" in polygons.notes[0]


def _edited(*path: str | int, value: Any) -> tuple[dict[str, Any], bytes]:
    document, buffer = gltf_document()
    place: Any = document
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return document, buffer


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (_edited("accessors", 0, "count", value=300_000), ["accessors[0]", "past"]),
        (_edited("accessors", 1, "count", value=-3), ["past"]),
        (_edited("accessors", 1, "bufferView", value=9), ["bufferViews[9]", "there are 2"]),
        (_edited("accessors", 0, "type", value="VEC2"), ["VEC2"]),
        (_edited("accessors", 0, "componentType", value=1), ["not valid glTF"]),
        (_edited("bufferViews", 0, "byteLength", value=10**12), ["bufferViews[0]", "past"]),
        (_edited("bufferViews", 1, "byteStride", value=0), ["past"]),
        (_edited("buffers", 0, "byteLength", value=10**6), ["buffers[0]", "cut short"]),
        (_edited("nodes", 0, "mesh", value=4), ["meshes[4]", "there are 1"]),
        (_edited("nodes", 0, "children", value=[0]), ["its own ancestor"]),
        (_edited("nodes", 0, "matrix", value=[1, 2, 3]), ["not valid glTF"]),
        (_edited("scene", value=5), ["not valid glTF"]),
        (_edited("scenes", 0, "nodes", value=[]), ["no triangles"]),
        (_edited("meshes", 0, "primitives", 0, "mode", value=0), ["no triangles", "points or lines"]),
        (_edited("extensionsRequired", value=["KHR_draco_mesh_compression"]), ["uncompressed"]),
    ],
)
def test_damage_is_named(tmp_path: Path, edit: tuple[dict[str, Any], bytes], words: list[str]) -> None:
    path = written(tmp_path, "bad.glb", glb(*copy.deepcopy(edit)))
    with pytest.raises(SceneError) as caught:
        read(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    for word in words:
        assert word in message


def test_an_index_out_of_range_is_refused(tmp_path: Path) -> None:
    document, buffer = gltf_document()
    path = written(tmp_path, "bad.glb", glb(document, buffer[:-2] + struct.pack("<H", 999)))
    with pytest.raises(SceneError, match="face 5 names vertex 999"):
        check(read(path), path)


def test_a_glb_cut_short_anywhere_is_refused(tmp_path: Path) -> None:
    content = glb(*gltf_document())
    path = tmp_path / "cut.glb"
    for length in range(1, len(content)):
        path.write_bytes(content[:length])
        with pytest.raises(SceneError):
            read(path)


def test_text_that_is_not_json_is_named_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"bad\.gltf:2: "):
        read(written(tmp_path, "bad.gltf", '{"asset": {},\n oops}'))


@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.sampled_from([glb(*gltf_document()), gltf(*gltf_document())]), changes=CHANGES)
def test_flipped_bytes_give_an_error_or_a_mesh_never_a_crash(
    tmp_path: Path, content: bytes, changes: list[tuple[int, int]]
) -> None:
    require_mesh_or_error(read, written(tmp_path, "flipped.glb", changed(content, changes)))
