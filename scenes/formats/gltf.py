"""glTF 2.0 and GLB: the triangles of the default scene's nodes, each in its place.

Indexed or not, as lists, strips or fans; buffers embedded, beside the file or in the binary chunk; sparse and quantised
positions. Skins and morph targets are not applied: a figure is drawn in its rest pose. Accessors are held to their
buffers' lengths before a byte is read.
"""

from __future__ import annotations

import base64
import binascii
import json
import math
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import SceneError

from .polygons import Polygons, merged, of_triangles

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC3": 3}
_TRIANGLES, _TRIANGLE_STRIP, _TRIANGLE_FAN = 4, 5, 6
_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
_REMEDY = "export it again"

Array = NDArray[np.float64]


def read(path: Path) -> Polygons:
    """Read a .gltf or .glb file.

    Raises:
        SceneError: Damaged, compressed, or without a triangle.
    """
    data = path.read_bytes()
    text, chunk = _binary_parts(data, path) if data[:4] == b"glTF" else (data, None)
    try:
        document = json.loads(text)
    except json.JSONDecodeError as error:
        where = f"{path}:{error.lineno}" if chunk is None else f"{path}"
        raise SceneError(f"{where}: is not valid glTF: {error.msg}; {_REMEDY}") from None
    except RecursionError:
        raise SceneError(f"{path}: is not valid glTF: brackets nested too deeply; {_REMEDY}") from None
    except UnicodeDecodeError:
        raise SceneError(f"{path}: is not valid glTF: neither GLB nor text; {_REMEDY}") from None
    if not isinstance(document, dict) or "asset" not in document:
        raise SceneError(f"{path}: is JSON, but not glTF: it has no 'asset'")
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused later, as such
            return _Document(document, chunk, path).polygons()
    except (LookupError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise SceneError(f"{path}: is not valid glTF: {type(error).__name__} {error}; {_REMEDY}") from None


def _binary_parts(data: bytes, path: Path) -> tuple[bytes, bytes]:
    """Return a GLB container's JSON text and binary chunk."""
    version, length = (int.from_bytes(data[k : k + 4], "little") for k in (4, 8))
    if version != 2:
        raise SceneError(f"{path}: is GLB version {version}; only version 2 is read")
    if length > len(data):
        raise SceneError(f"{path}: the header promises {length} bytes, but the file has {len(data)}; it is cut short")
    chunks: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + 8]
        if at + 8 + size > length:
            raise SceneError(f"{path}: a chunk of {size} bytes reaches past the file's end; {_REMEDY}")
        chunks.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if b"JSON" not in chunks:
        raise SceneError(f"{path}: has no JSON chunk; {_REMEDY}")
    return chunks[b"JSON"], chunks.get(b"BIN\0", b"")


class _Document:
    """A parsed document and its buffers."""

    def __init__(self, document: dict[str, Any], chunk: bytes | None, path: Path) -> None:
        self._document = document
        self._chunk = chunk
        self._path = path
        self._buffers: dict[int, bytes] = {}
        self._left_out = 0

    def polygons(self) -> Polygons:
        """Return all triangles of the default scene in world space."""
        for extension in self._document.get("extensionsRequired", []):
            if extension in _COMPRESSED:
                raise SceneError(
                    f"{self._path}: is compressed ({extension}), which is not read; export it uncompressed"
                )
        nodes = self._document.get("nodes", [])
        if "scenes" in self._document:
            roots = self._document["scenes"][self._document.get("scene", 0)].get("nodes", [])
        else:
            children = {child for node in nodes for child in node.get("children", [])}
            roots = [k for k in range(len(nodes)) if k not in children]
        parts: list[Polygons] = []
        for root in roots:
            self._collect(root, np.eye(4)[:3], (), parts)
        if not parts:
            what = f"; {self._left_out} primitives are points or lines" if self._left_out else ""
            raise SceneError(f"{self._path}: has no triangles in its scene{what}")
        whole = merged(parts)
        notes = (f"{self._path}: {self._left_out} point or line primitives were left out",) if self._left_out else ()
        return Polygons(whole.vertices, whole.corner_counts, whole.corners, "y", notes)

    def _collect(self, number: int, world: Array, above: tuple[int, ...], parts: list[Polygons]) -> None:
        """Add the triangles of a node and of those below it; ``world`` is world-from-parent, shape [3, 4]."""
        if number in above:
            raise SceneError(f"{self._path}: node {number} is its own ancestor; {_REMEDY}")
        node = self._item("nodes", number)
        world = _composed(world, _local_matrix(node))
        if "mesh" in node:
            for primitive in self._item("meshes", node["mesh"])["primitives"]:
                if primitive.get("mode", _TRIANGLES) < _TRIANGLES:
                    self._left_out += 1
                else:
                    parts.append(self._primitive(primitive, world))
        for child in node.get("children", []):
            self._collect(child, world, (*above, number), parts)

    def _primitive(self, primitive: dict[str, Any], world: Array) -> Polygons:
        vertices = _transformed(self._accessor(primitive["attributes"]["POSITION"], "VEC3"), world)
        if "indices" in primitive:
            corners = self._accessor(primitive["indices"], "SCALAR")[:, 0].astype(np.int64)
        else:
            corners = np.arange(len(vertices))
        triangles = _as_list(corners, primitive.get("mode", _TRIANGLES))
        if _determinant(world) < 0.0:  # a mirror turns the triangles inside out
            triangles = triangles[:, ::-1]
        return of_triangles(vertices, triangles)

    def _item(self, kind: str, number: int) -> dict[str, Any]:
        items = self._document.get(kind, [])
        if not (isinstance(number, int) and 0 <= number < len(items)):
            raise SceneError(f"{self._path}: names {kind}[{number}], but there are {len(items)}; {_REMEDY}")
        item: dict[str, Any] = items[number]
        return item

    def _accessor(self, number: int, kind: str) -> NDArray[Any]:
        """Return an accessor's elements, shape [count, width]; normalised integers as floats."""
        accessor = self._item("accessors", number)
        if accessor["type"] != kind:
            raise SceneError(f"{self._path}: accessors[{number}] is {accessor['type']} instead of {kind}; {_REMEDY}")
        component, count, width = np.dtype(_COMPONENTS[accessor["componentType"]]), accessor["count"], _WIDTHS[kind]
        what = f"accessors[{number}]"
        if "bufferView" in accessor:
            view, offset = accessor["bufferView"], accessor.get("byteOffset", 0)
            elements = self._elements(what, view, offset, component, count, width)
        else:
            elements = np.zeros((count, width), component)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            where, new = sparse["indices"], sparse["values"]
            index = np.dtype(_COMPONENTS[where["componentType"]])
            at = self._elements(what, where["bufferView"], where.get("byteOffset", 0), index, sparse["count"], 1)[:, 0]
            elements = elements.copy()
            elements[at] = self._elements(
                what, new["bufferView"], new.get("byteOffset", 0), component, sparse["count"], width
            )
        if accessor.get("normalized") and component.kind != "f":
            return np.maximum(elements.astype(np.float64) / np.iinfo(component).max, -1.0)
        return elements

    def _elements(
        self, what: str, view_number: int, offset: int, component: np.dtype[Any], count: int, width: int
    ) -> NDArray[Any]:
        """Return ``count`` elements of ``width`` components from a buffer view, shape [count, width]."""
        view = self._item("bufferViews", view_number)
        buffer = self._buffer(view["buffer"])
        start, length = view.get("byteOffset", 0), view["byteLength"]
        size = component.itemsize * width
        stride = view.get("byteStride", size)
        if min(start, length, offset, count) < 0 or start + length > len(buffer):
            raise SceneError(f"{self._path}: bufferViews[{view_number}] reaches past its buffer's end; {_REMEDY}")
        if count == 0:
            return np.zeros((0, width), component)
        if stride < size or offset + stride * (count - 1) + size > length:
            raise SceneError(f"{self._path}: {what} reaches past bufferViews[{view_number}]; {_REMEDY}")
        strides = (stride, component.itemsize)
        return np.ndarray((count, width), component, buffer, start + offset, strides)

    def _buffer(self, number: int) -> bytes:
        if number not in self._buffers:
            buffer = self._item("buffers", number)
            content = self._buffer_content(buffer)
            if len(content) < buffer["byteLength"]:
                raise SceneError(
                    f"{self._path}: buffers[{number}] should have {buffer['byteLength']} bytes, "
                    f"but {len(content)} are there; it is cut short: copy or export it again"
                )
            self._buffers[number] = content
        return self._buffers[number]

    def _buffer_content(self, buffer: dict[str, Any]) -> bytes:
        uri = buffer.get("uri")
        if uri is None:
            return self._chunk or b""
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except binascii.Error:
                raise SceneError(f"{self._path}: an embedded buffer is not valid base64; {_REMEDY}") from None
        beside = self._path.parent / unquote(uri)
        if "://" in uri or not beside.is_file():
            raise SceneError(f"{self._path}: needs the file '{uri}', which is not beside it; copy it there")
        return beside.read_bytes()


def _as_list(corners: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Return triangles [n, 3] of a list, strip or fan of corners; a rest of one or two is ignored."""
    if mode == _TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    count = max(len(corners) - 2, 0)
    k = np.arange(count)
    if mode == _TRIANGLE_STRIP:
        odd = k % 2  # every other triangle of a strip turns the other way
        return np.stack([corners[k], corners[k + 1 + odd], corners[k + 2 - odd]], axis=1)
    if mode == _TRIANGLE_FAN:
        return np.stack([corners[k + 1], corners[k + 2], np.broadcast_to(corners[:1], (count,))], axis=1)
    raise ValueError(f"primitive mode {mode}")


def _local_matrix(node: dict[str, Any]) -> Array:
    """Return parent-from-node, shape [3, 4]."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T[:3]  # stored by columns
    x, y, z, w = (float(c) for c in node.get("rotation", (0.0, 0.0, 0.0, 1.0)))
    length = math.sqrt(x * x + y * y + z * z + w * w) or 1.0
    x, y, z, w = x / length, y / length, z / length, w / length
    rotation = np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
    scale = np.array(node.get("scale", (1.0, 1.0, 1.0)), np.float64)
    translation = np.array(node.get("translation", (0.0, 0.0, 0.0)), np.float64)
    return np.column_stack([rotation * scale, translation])


def _composed(outer: Array, inner: Array) -> Array:
    """The product of two [3, 4] matrices, in a fixed order of summation."""
    linear = sum(outer[:, k, None] * inner[None, k, :] for k in range(3))
    result: Array = linear + np.column_stack([np.zeros((3, 3)), outer[:, 3]])
    return result


def _transformed(points: NDArray[Any], matrix: Array) -> Array:
    x, y, z = (points[:, k].astype(np.float64) for k in range(3))
    return np.stack([m[0] * x + m[1] * y + m[2] * z + m[3] for m in matrix], axis=1)


def _determinant(matrix: Array) -> float:
    (a, b, c), (d, e, f), (g, h, i) = matrix[:, :3].tolist()
    return float(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))
