"""STL, binary and text. Corners with equal coordinates become one vertex."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import SceneError

from .polygons import Polygons, of_triangles

_HEADER_BYTES = 84
_REMEDY = "export or copy it again"
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read(path: Path) -> Polygons:
    """Read an STL file.

    Raises:
        SceneError: A binary file whose length differs from what its count says, or text that is not STL.
    """
    data = path.read_bytes()
    return _welded(_text_corners(data, path) if _is_text(data) else _binary_corners(data, path))


def _is_text(data: bytes) -> bool:
    # binary headers may begin with "solid" too, but then a zero byte follows soon
    return data.lstrip()[:5].lower() == b"solid" and b"\0" not in data[:512]


def _binary_corners(data: bytes, path: Path) -> NDArray[np.float32]:
    if len(data) < _HEADER_BYTES:
        raise SceneError(f"{path}: is too short for an STL file ({len(data)} bytes); {_REMEDY}")
    promised = int.from_bytes(data[80:84], "little")
    expected = _HEADER_BYTES + promised * _FACET.itemsize
    if len(data) != expected:
        held = (len(data) - _HEADER_BYTES) / _FACET.itemsize
        raise SceneError(
            f"{path}: the header promises {promised} triangles, but the file has room for {held:.5g}; "
            f"it is cut short or damaged: {_REMEDY}"
        )
    facets = np.frombuffer(data, _FACET, offset=_HEADER_BYTES)
    return np.ascontiguousarray(facets["corners"])


def _text_corners(data: bytes, path: Path) -> NDArray[np.float64]:
    corners: list[tuple[float, float, float]] = []
    begun = 0  # corners before the current loop
    is_ended = False
    for number, line in enumerate(data.splitlines(), start=1):
        words = line.split()
        match words[0].lower() if words else b"":
            case b"vertex":
                try:
                    x, y, z = (float(word) for word in words[1:])
                except ValueError:
                    raise SceneError(f"{path}:{number}: a vertex needs three numbers; {_REMEDY}") from None
                corners.append((x, y, z))
            case (b"outer" | b"endloop") as word:
                count = len(corners) - begun
                if count != (3 if word == b"endloop" else 0):
                    raise SceneError(f"{path}:{number}: a facet has {count} corners instead of 3; {_REMEDY}")
                begun = len(corners)
            case b"solid":
                is_ended = False
            case b"endsolid":
                is_ended = True
    if not is_ended or begun != len(corners):
        raise SceneError(f"{path}: the text ends before 'endsolid'; it is cut short: {_REMEDY}")
    return np.array(corners, np.float64).reshape(-1, 3, 3)


def _welded(corners: NDArray[np.floating]) -> Polygons:
    with np.errstate(invalid="ignore"):  # NaN is refused later, as such
        points = corners.reshape(-1, 3) + corners.dtype.type(0.0)  # -0 becomes 0
    order = np.lexsort((points[:, 2], points[:, 1], points[:, 0]))
    in_order = points[order]
    is_new = np.ones(len(points), dtype=bool)
    is_new[1:] = (in_order[1:] != in_order[:-1]).any(axis=1)
    vertex = np.empty(len(points), np.int64)
    vertex[order] = np.cumsum(is_new) - 1
    return of_triangles(in_order[is_new], vertex.reshape(-1, 3))
