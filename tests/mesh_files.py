"""Mesh files written byte by byte, independently of the readers: a lopsided solid in every format."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from shadowbench.errors import SceneError
from shadowbench.scenes.formats.polygons import Polygons, check, triangulate

VERTICES = np.array([(1, 2, 3), (5, 2, 3), (1, 8, 3), (1, 2, 4), (4.5, 6.25, 3.5)], np.float64)
TRIANGLES = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 4, 3), (3, 4, 2), (1, 2, 4)], np.int32)
"""Closed, 4 x 6 x 1, counter-clockwise from outside, no two extents or corners alike; exact in float32."""


def corners(vertices: NDArray[Any], triangles: NDArray[Any]) -> NDArray[np.float64]:
    """Triangles as coordinates, shape [n, 3, 3], in an order that does not depend on how vertices are numbered."""
    soup = np.asarray(vertices, np.float64)[np.asarray(triangles).reshape(-1, 3)]
    return np.array(sorted(soup.tolist()))


def signed_volume(vertices: NDArray[Any], triangles: NDArray[Any]) -> float:
    """Volume of a closed mesh by the divergence theorem; positive if its triangles face outwards."""
    a, b, c = np.moveaxis(np.asarray(vertices, np.float64)[triangles], 1, 0)
    return float((np.cross(a, b) * c).sum() / 6.0)


def is_closed(triangles: NDArray[Any]) -> bool:
    """Whether every directed edge meets exactly one of the opposite direction."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    forth, back = sorted(map(tuple, edges.tolist())), sorted(map(tuple, edges[:, ::-1].tolist()))
    return forth == back and len(set(forth)) == len(forth)


def ply(
    form: str = "ascii",
    *,
    scalar: str = "float",
    vertices: NDArray[Any] = VERTICES,
    faces: list[list[int]] | None = None,
    vertex_count: int | None = None,
    face_count: int | None = None,
) -> bytes:
    """A PLY file; the counts in the header may lie."""
    faces = TRIANGLES.tolist() if faces is None else faces
    header = (
        f"ply\nformat {form} 1.0\ncomment by hand\n"
        f"element vertex {len(vertices) if vertex_count is None else vertex_count}\n"
        f"property {scalar} x\nproperty {scalar} y\nproperty {scalar} z\n"
        f"element face {len(faces) if face_count is None else face_count}\n"
        "property list uchar int vertex_indices\nend_header\n"
    ).encode()
    if form == "ascii":
        lines = [" ".join(repr(float(c)) for c in v) for v in vertices.tolist()]
        lines += [" ".join(map(str, [len(face), *face])) for face in faces]
        return header + ("\n".join(lines) + "\n").encode()
    order = "<" if form == "binary_little_endian" else ">"
    body = np.asarray(vertices).astype(order + ("f8" if scalar in ("double", "float64") else "f4")).tobytes()
    return header + body + b"".join(struct.pack(f"{order}B{len(face)}i", len(face), *face) for face in faces)


def obj(vertices: NDArray[Any] = VERTICES, triangles: NDArray[Any] = TRIANGLES) -> bytes:
    lines = ["# by hand", "o solid", *(f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()), "vn 0 0 1", "s off"]
    lines += [f"f {a}//1 {b}//1 {c}//1" for a, b, c in (triangles + 1).tolist()]
    return ("\n".join(lines) + "\n").encode()


def stl_binary(soup: NDArray[Any] | None = None, *, count: int | None = None, header: bytes = b"by hand") -> bytes:
    """A binary STL of triangles [n, 3, 3]; the count may lie."""
    soup = VERTICES[TRIANGLES] if soup is None else soup
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, *map(float, t.reshape(-1)), 0) for t in soup)
    return header.ljust(80, b" ") + struct.pack("<I", len(soup) if count is None else count) + facets


def stl_text() -> bytes:
    lines = ["solid by hand"]
    for triangle in VERTICES[TRIANGLES]:
        lines += ["  facet normal 0 0 0", "    outer loop"]
        lines += [f"      vertex {x!r} {y!r} {z!r}" for x, y, z in triangle.tolist()]
        lines += ["    endloop", "  endfacet"]
    return ("\n".join([*lines, "endsolid by hand"]) + "\n").encode()


def gltf_document() -> tuple[dict[str, Any], bytes]:
    """A glTF document of the solid, and its one buffer."""
    positions = VERTICES.astype("<f4").tobytes()
    indices = TRIANGLES.astype("<u2").tobytes()
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(VERTICES), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": TRIANGLES.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(positions)},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": len(indices)},
        ],
        "buffers": [{"byteLength": len(positions) + len(indices)}],
    }
    return document, positions + indices


def glb(document: dict[str, Any], buffer: bytes) -> bytes:
    """A GLB container."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    buffer += b"\0" * (-len(buffer) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def gltf(document: dict[str, Any], buffer: bytes) -> bytes:
    """A .gltf file with its buffer embedded."""
    uri = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    embedded = [{**document["buffers"][0], "uri": uri}]
    return json.dumps({**document, "buffers": embedded}).encode()


def usda(*, up: str = "Y", mesh: str = "", xform: str = "") -> str:
    """A USD stage with the solid; ``mesh`` and ``xform`` are lines added to the prims."""
    points = ", ".join(str(tuple(v)) for v in VERTICES.tolist())
    indices = ", ".join(map(str, TRIANGLES.reshape(-1).tolist()))
    return f"""#usda 1.0
(
    upAxis = "{up}"
)

def Xform "root"
{{
    {xform}

    def Mesh "solid"
    {{
        int[] faceVertexCounts = [{", ".join(["3"] * len(TRIANGLES))}]
        int[] faceVertexIndices = [{indices}]
        point3f[] points = [{points}]
        {mesh}
    }}
}}
"""


def written(folder: Path, name: str, content: bytes | str) -> Path:
    """Write a file and return its path."""
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


CHANGES = st.lists(st.tuples(st.integers(0, 100_000), st.integers(0, 255)), min_size=1, max_size=6)
"""Damage for :func:`changed`: places and new bytes."""


def changed(content: bytes, changes: list[tuple[int, int]]) -> bytes:
    """Overwrite single bytes."""
    damaged = bytearray(content)
    for place, value in changes:
        damaged[place % len(damaged)] = value
    return bytes(damaged)


def require_mesh_or_error(read: Callable[[Path], Polygons], path: Path) -> None:
    """A damaged file ends in one line, or in polygons that can be cut into triangles; in nothing else."""
    message = ""
    try:
        polygons = read(path)
        check(polygons, path)
        triangulate(polygons)
    except SceneError as error:
        message = str(error)
    assert "\n" not in message
    assert not message or message.startswith(str(path))
