"""What every mesh reader returns, and its way to triangles.

Readers give polygons as the file has them. Here they are checked, cut into triangles and merged; triangles without an
area are counted and dropped. All decisions are made by arithmetic that rounds alike everywhere, so that a quad is cut
along the same diagonal on every machine.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import SceneError

Coordinate = TypeVar("Coordinate", np.float32, np.float64)

LARGEST_COORDINATE = 1e30
"""Beyond this, squares of lengths would overflow in later stages."""


@dataclass(frozen=True, eq=False)
class Polygons:
    """Polygons over shared vertices.

    Attributes:
        vertices: float32 or float64, shape [vertex_count, 3].
        corner_counts: Corners of each polygon, int64, shape [polygon_count].
        corners: Vertex indices of all polygons, one after the other, int64, shape [sum of corner_counts];
            counter-clockwise seen from outside.
        up: The axis that the file itself calls up, ``y`` or ``z``, or ``None`` where the format does not say.
        notes: Warnings for the user.
    """

    vertices: NDArray[np.floating]
    corner_counts: NDArray[np.int64]
    corners: NDArray[np.int64]
    up: str | None = None
    notes: tuple[str, ...] = ()


def of_triangles(vertices: NDArray[np.floating], triangles: NDArray[np.integer]) -> Polygons:
    """Return triangles as polygons; ``triangles`` has the shape [triangle_count, 3]."""
    return Polygons(vertices, np.full(len(triangles), 3), triangles.astype(np.int64).reshape(-1))


def merged(parts: Iterable[Polygons]) -> Polygons:
    """Return all parts as one; there must be at least one."""
    parts = list(parts)
    starts = np.cumsum([0, *(len(p.vertices) for p in parts[:-1])])
    return Polygons(
        np.concatenate([p.vertices for p in parts]),
        np.concatenate([p.corner_counts for p in parts]),
        np.concatenate([p.corners + start for p, start in zip(parts, starts, strict=True)]),
        parts[0].up,
        tuple(note for p in parts for note in p.notes),
    )


def check(polygons: Polygons, path: Path) -> None:
    """Refuse polygons that have or name what is not there, and vertices that are not numbers.

    Raises:
        SceneError: Names the file, the polygon or the vertex (both counted from 0).
    """
    vertex_count = len(polygons.vertices)
    if len(polygons.corner_counts) == 0:
        what = f"only {vertex_count} points" if vertex_count else "nothing"
        raise SceneError(f"{path}: has no faces, {what}; a shadow needs triangles, so export the surface")
    promised = int(polygons.corner_counts.sum())
    fewest, held = int(polygons.corner_counts.min()), len(polygons.corners)
    if fewest < 0 or promised != held:
        what = (
            f"a face has {fewest} corners" if fewest < 0 else f"its faces promise {promised} corners, but have {held}"
        )
        raise SceneError(f"{path}: {what}; export the mesh again")
    wrong = (polygons.corners < 0) | (polygons.corners >= vertex_count)
    if wrong.any():
        corner = int(np.argmax(wrong))
        polygon = int(np.searchsorted(np.cumsum(polygons.corner_counts), corner, side="right"))
        raise SceneError(
            f"{path}: face {polygon} names vertex {int(polygons.corners[corner])}, but there are {vertex_count} "
            f"(0 to {vertex_count - 1}); export the mesh again"
        )
    usable = (np.abs(polygons.vertices) <= LARGEST_COORDINATE).all(axis=1)  # False for NaN
    if not usable.all():
        vertex = int(np.argmin(usable))
        x, y, z = polygons.vertices[vertex]
        why = "is not finite" if not np.isfinite((x, y, z)).all() else f"lies beyond ±{LARGEST_COORDINATE:g}"
        raise SceneError(f"{path}: vertex {vertex} ({x:g}, {y:g}, {z:g}) {why}; repair the mesh or export it again")


def triangulate(polygons: Polygons) -> NDArray[np.int32]:
    """Cut polygons into triangles, in the polygons' order, shape [triangle_count, 3].

    Where the fan round a polygon's first corner turns one way everywhere, that fan is taken, else ears are clipped.
    Polygons of fewer than three corners give none.
    """
    counts = polygons.corner_counts
    starts = np.cumsum(counts) - counts
    made = np.maximum(counts - 2, 0)
    first_made = np.cumsum(made) - made
    triangles = np.empty((int(made.sum()), 3), np.int32)
    for count in np.unique(counts[counts >= 3]).tolist():
        of_count = np.flatnonzero(counts == count)
        corners = polygons.corners[starts[of_count, None] + np.arange(count)]
        fan = np.stack([np.repeat(corners[:, :1], count - 2, axis=1), corners[:, 1:-1], corners[:, 2:]], axis=2)
        for row in np.flatnonzero(~_turns_one_way(polygons.vertices, corners, fan)) if count > 3 else ():
            fan[row] = corners[row][_clip_ears(polygons.vertices[corners[row]].astype(np.float64))]
        triangles[first_made[of_count, None] + np.arange(count - 2)] = fan
    return triangles


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The cross product along the last axis, written out."""
    ax, ay, az, bx, by, bz = (v[..., k] for v in (a, b) for k in range(3))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    result: NDArray[np.float64] = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
    return result


def _area_vectors(vertices: NDArray[np.floating], triangles: NDArray[np.integer]) -> NDArray[np.float64]:
    """Twice each triangle's area along its normal; ``triangles`` has the shape [..., 3]."""
    a, b, c = (vertices[triangles[..., k]].astype(np.float64) for k in range(3))
    return _cross(b - a, c - a)


def _newell_normal(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Twice the area vector of polygons [..., corner_count, 3] (Newell): independent of any triangulation."""
    offsets = points - points[..., :1, :]
    total = np.zeros((*points.shape[:-2], 3))
    for k in range(1, points.shape[-2] - 1):  # summed in a fixed order
        total += _cross(offsets[..., k, :], offsets[..., k + 1, :])
    return total


def _turns_one_way(
    vertices: NDArray[np.floating], corners: NDArray[np.int64], fan: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Whether all triangles of each polygon's fan face the polygon's way, shape [polygon_count]."""
    normal = _newell_normal(vertices[corners].astype(np.float64))
    facing = _dot(_area_vectors(vertices, fan), normal[:, None, :]) > 0.0
    return np.asarray(facing.all(axis=1))


def _clip_ears(points: NDArray[np.float64]) -> list[tuple[int, int, int]]:
    """Triangulate one polygon [corner_count, 3] by clipping ears (Meisters 1975), in its plane's projection.

    A polygon that crosses itself has no triangulation; it is cut all the same, into corner_count - 2 triangles.
    """
    normal = _newell_normal(points)
    axis = int(np.argmax(np.abs(normal)))
    side = 1.0 if normal[axis] >= 0.0 else -1.0
    u, v = points[:, (axis + 1) % 3], side * points[:, (axis + 2) % 3]

    def turn(a: int, b: int, c: NDArray[np.int64] | int) -> NDArray[np.float64]:
        result: NDArray[np.float64] = (u[b] - u[a]) * (v[c] - v[a]) - (v[b] - v[a]) * (u[c] - u[a])
        return result

    def is_ear(a: int, b: int, c: int) -> bool:
        if turn(a, b, c) <= 0.0:
            return False
        others = np.array(left)
        for corner in (a, b, c):  # a hole's bridge visits a point twice: its copy blocks no ear
            others = others[(u[others] != u[corner]) | (v[others] != v[corner])]
        return not ((turn(a, b, others) >= 0.0) & (turn(b, c, others) >= 0.0) & (turn(c, a, others) >= 0.0)).any()

    left = list(range(len(points)))
    ears: list[tuple[int, int, int]] = []
    while len(left) > 3:
        rings = ((left[k - 1], left[k], left[(k + 1) % len(left)]) for k in range(len(left)))
        a, b, c = next((ring for ring in rings if is_ear(*ring)), (left[0], left[1], left[2]))
        ears.append((a, b, c))
        left.remove(b)
    return [*ears, (left[0], left[1], left[2])]


def has_area(vertices: NDArray[np.floating], triangles: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Whether each triangle's corners are distinct and not in one line, shape [triangle_count]."""
    found = np.empty(len(triangles), dtype=bool)
    step = 1 << 20
    for first in range(0, len(triangles), step):
        part = slice(first, first + step)
        found[part] = (_area_vectors(vertices, triangles[part]) != 0.0).any(axis=1)
    return found


def without_degenerate(
    vertices: NDArray[Coordinate], triangles: NDArray[np.int32]
) -> tuple[NDArray[Coordinate], NDArray[np.int32]]:
    """Drop triangles of no area, then vertices that no triangle uses."""
    triangles = triangles[has_area(vertices, triangles)]
    is_used = np.zeros(len(vertices), dtype=bool)
    is_used[triangles] = True
    number = np.cumsum(is_used, dtype=np.int64) - 1
    return vertices[is_used], number[triangles].astype(np.int32)
