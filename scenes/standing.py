"""From a file's polygons to one clean mesh that stands upright on the origin, for the scenes read from files."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import SceneError
from shadowbench.scene import Mesh

from .formats.polygons import Polygons, check, has_area, triangulate, without_degenerate

_COMFORTABLE = 2.0**20
"""A mesh larger than this, or smaller than its inverse, is scaled by a power of two: exactly, and with a note."""

_UPRIGHT = {
    "x": ((1, -1.0), (0, 1.0), (2, 1.0)),
    "y": ((0, 1.0), (1, 1.0), (2, 1.0)),
    "z": ((0, 1.0), (2, 1.0), (1, -1.0)),
}
"""Which file axis, with which sign, becomes x, y and z: a rotation that takes the file's upward axis to y."""


def standing_mesh(polygons: Polygons, path: Path, *, up: str | None = None) -> tuple[Mesh, tuple[str, ...]]:
    """Return the polygons as triangles, upright, with their lowest point at y = 0 and centred on x = z = 0.

    Args:
        polygons: As read.
        path: For messages and the mesh's name.
        up: The file's upward axis (x, y or z) instead of what the file says.

    Returns:
        The mesh, float32, and notes for the user.

    Raises:
        SceneError: An index or vertex that cannot be used, or no triangle with an area.
    """
    check(polygons, path)
    triangles = triangulate(polygons)
    found = len(triangles)
    turned = [sign * polygons.vertices[:, axis].astype(np.float64) for axis, sign in _UPRIGHT[up or polygons.up or "y"]]
    vertices, triangles = without_degenerate(np.stack(turned, axis=1), triangles)
    while len(triangles):
        placed, scale = _placed(vertices)
        rounded = placed.astype(np.float32)
        kept = has_area(rounded, triangles)
        if kept.all():
            break
        # what vanishes in float32 may have set the extent: place again without it
        vertices, triangles = without_degenerate(vertices, triangles[kept])
    else:
        raise SceneError(f"{path}: none of its {len(polygons.corner_counts)} faces has an area; export the mesh again")
    notes = list(polygons.notes)
    if scale != 1.0:
        notes.append(f"{path}: its size is {_extent(vertices):g}; scaled by {scale:g} to suit float32 arithmetic")
    if len(triangles) < found:
        notes.append(f"{path}: {found - len(triangles)} of {found} triangles have no area and were left out")
    return Mesh(path.stem, rounded, triangles), tuple(notes)


def _placed(vertices: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return the vertices centred on x = z = 0, lowest at y = 0, and by what they were scaled."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    scale = _scale(_extent(vertices))
    return (vertices - [(low[0] + high[0]) / 2.0, low[1], (low[2] + high[2]) / 2.0]) * scale, scale


def _extent(vertices: NDArray[np.float64]) -> float:
    return float((vertices.max(axis=0) - vertices.min(axis=0)).max())


def _scale(extent: float) -> float:
    """Return 1, or the power of two that brings the extent to about 1."""
    if 1.0 / _COMFORTABLE <= extent <= _COMFORTABLE:
        return 1.0
    return 2.0 ** -math.frexp(extent)[1]
