"""PLY (the Stanford polygon format), text and binary of either byte order.

The header says how many rows of what follow; a file that ends before is refused, not filled with zeros. Rows of equal
length, which is to say nearly every file, are read in one go; others row by row.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import SceneError

from .polygons import Polygons
from .words import parsed_numbers, quoted

_TYPES: dict[str, np.dtype[Any]] = {
    "char": np.dtype("i1"),
    "uchar": np.dtype("u1"),
    "short": np.dtype("i2"),
    "ushort": np.dtype("u2"),
    "int": np.dtype("i4"),
    "uint": np.dtype("u4"),
    "float": np.dtype("f4"),
    "double": np.dtype("f8"),
    **{name: np.dtype(name) for name in ("int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64")},
}
_ORDERS: dict[str, Literal["=", "<", ">"]] = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_FACE_LISTS = ("vertex_indices", "vertex_index")
_REMEDY = "export or copy it again"

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Property:
    name: str
    value: np.dtype[Any]
    length: np.dtype[Any] | None = None  # of a list's length; None for a single number


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


@dataclass(frozen=True)
class _Column:
    """One property of all rows: the values one after the other, and how many each row has."""

    values: NDArray[Any]
    lengths: NDArray[np.int64]


_Columns = dict[str, _Column]


def read(path: Path) -> Polygons:
    """Read a PLY file's vertices and faces; other elements and properties are skipped.

    Raises:
        SceneError: A header that is not PLY's, or a body that is shorter than the header promises.
    """
    data = path.read_bytes()
    is_text, elements, start = _header(data, path)
    rows = _text_rows(data[start:], elements, path) if is_text else _binary_rows(data, start, elements, path)
    vertex, face = rows.get("vertex", {}), rows.get("face", {})
    if not all(axis in vertex and (vertex[axis].lengths == 1).all() for axis in "xyz"):
        raise SceneError(f"{path}: has no element 'vertex' with properties x, y and z; export the mesh again")
    axes = [vertex[axis].values.astype(vertex[axis].values.dtype.newbyteorder("=")) for axis in "xyz"]
    vertices = np.stack(axes, axis=1)
    if vertices.dtype not in (np.float32, np.float64):
        vertices = vertices.astype(np.float64)
    if "tristrips" in rows and not any(name in face for name in _FACE_LISTS):
        raise SceneError(f"{path}: holds triangle strips, which are not read; export the mesh with faces")
    nothing = _Column(np.zeros(0), np.zeros(0, np.int64))
    corners = next((face[name] for name in _FACE_LISTS if name in face), nothing)
    return Polygons(vertices, corners.lengths, corners.values.astype(np.int64))


def _header(data: bytes, path: Path) -> tuple[bool, list[_Element], int]:
    """Return whether the body is text, the elements, and where the body starts."""
    if data[:3] != b"ply":
        raise SceneError(f"{path}: does not begin with 'ply'; is it a PLY file?")
    form: str | None = None
    elements: list[_Element] = []
    start = 0
    while (end := data.find(b"\n", start)) >= 0:
        line, start = data[start:end].decode("latin-1").strip(), end + 1
        words = line.split()
        if words == ["end_header"]:
            if form is None:
                raise SceneError(f"{path}: the header names no format; {_REMEDY}")
            return form == "ascii", [_in_order(element, _ORDERS[form]) for element in elements], start
        if words[:1] == ["format"] and words[1:2] and words[1] in _ORDERS and words[2:] == ["1.0"]:
            form = words[1]
        elif words and words[0] not in ("ply", "comment", "obj_info") and not _declare(words, elements):
            number = data.count(b"\n", 0, start)
            raise SceneError(f"{path}:{number}: not a line of a PLY header: {quoted(line)}; {_REMEDY}")
    raise SceneError(f"{path}: the header has no 'end_header'; the file is cut short: {_REMEDY}")


def _declare(words: list[str], elements: list[_Element]) -> bool:
    """Add what a header line declares to ``elements``; return whether it is such a line, and no name comes twice."""
    match words:
        case ["element", name, count] if count.isdecimal() and name not in [e.name for e in elements]:
            elements.append(_Element(name, int(count)))
        case ["property", *types, name] if elements and name not in [p.name for p in elements[-1].properties]:
            match types:
                case ["list", length, value] if length in _TYPES and value in _TYPES:
                    elements[-1].properties.append(_Property(name, _TYPES[value], _TYPES[length]))
                case [value] if value in _TYPES:
                    elements[-1].properties.append(_Property(name, _TYPES[value]))
                case _:
                    return False
        case _:
            return False
    return True


def _in_order(element: _Element, order: Literal["=", "<", ">"]) -> _Element:
    properties = [
        _Property(p.name, p.value.newbyteorder(order), None if p.length is None else p.length.newbyteorder(order))
        for p in element.properties
    ]
    return _Element(element.name, element.count, properties)


def _cut_short(path: Path, element: _Element, held: int) -> SceneError:
    return SceneError(
        f"{path}: the header promises {element.count} rows of '{element.name}', but the file ends in row {held + 1}; "
        f"it is cut short: {_REMEDY}"
    )


def _damaged(path: Path, element: _Element, row: int) -> SceneError:
    return SceneError(f"{path}: row {row + 1} of '{element.name}' does not hold the numbers promised; {_REMEDY}")


def _text_rows(body: bytes, elements: list[_Element], path: Path) -> dict[str, _Columns]:
    numbers = parsed_numbers(body, np.float64)  # exact for whole numbers below 2^53
    if numbers is None:
        raise SceneError(f"{path}: there is something that is not a number after the header; {_REMEDY}")
    rows, at = {}, 0
    for element in elements:
        rows[element.name], at = _text_columns(numbers, at, element, path)
    return rows


def _text_columns(numbers: Array, at: int, element: _Element, path: Path) -> tuple[_Columns, int]:
    """Take an element's rows from the numbers of a text body, beginning with number ``at``."""
    if element.count == 0 or not element.properties:
        return _no_columns(element), at
    begins, lengths, end = _walked_numbers(numbers, at, element, 1, path)
    width = end - at
    table = numbers[at : at + width * element.count]
    table = table[: len(table) // width * width].reshape(-1, width)
    columns = [k for k, p in enumerate(element.properties) if p.length is not None]
    if len(table) == element.count and all((table[:, begins[0, k] - at - 1] == lengths[0, k]).all() for k in columns):
        begins = begins + width * np.arange(element.count)[:, None]
        lengths = np.repeat(lengths, element.count, axis=0)
        end = at + width * element.count
    else:
        begins, lengths, end = _walked_numbers(numbers, at, element, element.count, path)
    found = {}
    for k, p in enumerate(element.properties):
        # every value's place: its row's first one, and how many came before it in the row
        before = np.arange(lengths[:, k].sum()) - np.repeat(np.cumsum(lengths[:, k]) - lengths[:, k], lengths[:, k])
        values = numbers[np.repeat(begins[:, k], lengths[:, k]) + before]
        if p.value.kind == "f":
            with np.errstate(over="ignore"):  # what becomes infinite is refused as such
                values = values.astype(p.value)
        elif ((values == np.floor(values)) & (np.abs(values) < 2.0**53)).all():
            values = values.astype(np.int64)
        else:
            raise SceneError(f"{path}: '{element.name}' has a '{p.name}' that is not a whole number; {_REMEDY}")
        found[p.name] = _Column(values, lengths[:, k])
    return found, end


def _walked_numbers(
    numbers: Array, at: int, element: _Element, row_count: int, path: Path
) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """Return where each property's values begin, how many they are (both [row_count, property_count]), and the end."""
    # a row has at least one number, so a count beyond what is there is met before the last of these rows
    row_count = min(row_count, len(numbers) - at + 1)
    begins = np.empty((row_count, len(element.properties)), np.int64)
    lengths = np.ones_like(begins)
    for row in range(row_count):
        for k, p in enumerate(element.properties):
            if p.length is not None:
                length = numbers[at] if at < len(numbers) else 0.0
                if not (length >= 0.0 and float(length).is_integer()):
                    raise _damaged(path, element, row)
                lengths[row, k] = min(length, len(numbers))
                at += 1
            begins[row, k] = at
            at += int(lengths[row, k])
        if at > len(numbers):
            raise _cut_short(path, element, row)
    return begins, lengths, at


def _no_columns(element: _Element) -> _Columns:
    return {p.name: _Column(np.zeros(0, p.value), np.zeros(0, np.int64)) for p in element.properties}


def _binary_rows(data: bytes, at: int, elements: list[_Element], path: Path) -> dict[str, _Columns]:
    rows = {}
    for element in elements:
        if element.count == 0 or not element.properties:
            rows[element.name] = _no_columns(element)
            continue
        first, _ = _walked_columns(data, at, element, 1, path)
        found = _equal_columns(data, at, element, [int(c.lengths[0]) for c in first.values()])
        rows[element.name], at = found or _walked_columns(data, at, element, element.count, path)
    return rows


def _equal_columns(data: bytes, at: int, element: _Element, lengths: list[int]) -> tuple[_Columns, int] | None:
    """Read all rows at once if every list is as long as in the first row; ``None`` if not."""
    fields: list[tuple[Any, ...]] = []
    for k, p in enumerate(element.properties):
        if p.length is not None:
            fields.append((f"length {k}", p.length))
        fields.append((f"values {k}", p.value, (lengths[k],)))
    row = np.dtype(fields)
    if at + row.itemsize * element.count > len(data):
        return None
    table = np.frombuffer(data, row, element.count, at)
    columns = {}
    for k, p in enumerate(element.properties):
        if p.length is not None and (table[f"length {k}"] != lengths[k]).any():
            return None
        columns[p.name] = _Column(table[f"values {k}"].reshape(-1), np.full(element.count, lengths[k], np.int64))
    return columns, at + row.itemsize * element.count


def _walked_columns(data: bytes, at: int, element: _Element, row_count: int, path: Path) -> tuple[_Columns, int]:
    """Read row by row."""
    chunks: list[list[bytes]] = [[] for _ in element.properties]
    lengths: list[list[int]] = [[] for _ in element.properties]
    for row in range(row_count):
        for k, p in enumerate(element.properties):
            length = 1
            if p.length is not None:
                if at + p.length.itemsize > len(data):
                    raise _cut_short(path, element, row)
                length = int(np.frombuffer(data, p.length, 1, at)[0])
                at += p.length.itemsize
            if length < 0:
                raise _damaged(path, element, row)
            end = at + length * p.value.itemsize
            if end > len(data):
                raise _cut_short(path, element, row)
            chunks[k].append(data[at:end])
            lengths[k].append(length)
            at = end
    columns = {
        p.name: _Column(np.frombuffer(b"".join(chunks[k]), p.value), np.array(lengths[k], np.int64))
        for k, p in enumerate(element.properties)
    }
    return columns, at
