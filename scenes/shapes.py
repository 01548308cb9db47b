"""Solids and sheets that scenes are put together from: boxes, bars, prisms, surfaces of revolution, sheets.

A :class:`Shape` is what a mesh is before it has a name: float64 points and triangles that face out. Shapes are moved,
turned, scaled and joined; ``mesh()`` ends it. Only sums, products, divisions and square roots decide where points lie.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shadowbench.scene import Mesh, Rotation, Vector, cosine_sine

from .vectors import Array, cross, unit

Opening = tuple[float, float, float, float]
"""A hole in a wall: x0, x1, y0, y1."""

Triangles = NDArray[np.int32]

_CORNERS = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
_QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
_BOX = np.array([t for a, b, c, d in _QUADS for t in ((a, b, c), (a, c, d))], np.int32)
"""A box's corners, by which end of x, y and z they take, and its triangles."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles in space.

    Attributes:
        points: float64, shape [point_count, 3].
        triangles: int32, shape [triangle_count, 3], counter-clockwise seen from outside.
    """

    points: Array
    triangles: Triangles

    @property
    def triangle_count(self) -> int:
        return len(self.triangles)

    def mesh(self, name: str) -> Mesh:
        """Return the shape as a mesh, in float32."""
        return Mesh(name, self.points.astype(np.float32), self.triangles)

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Shape:
        return Shape(self.points + np.array([x, y, z]), self.triangles)

    def scaled(self, x: float, y: float, z: float) -> Shape:
        """Return the shape scaled about the origin, by positive factors."""
        return Shape(self.points * np.array([x, y, z]), self.triangles)

    def turned(self, axis: Vector, degrees: float) -> Shape:
        """Return the shape rotated about an axis through the origin, by the right-hand rule."""
        m, (x, y, z) = Rotation(axis, degrees).matrix(), self.points.T
        return Shape(np.stack([m[r, 0] * x + m[r, 1] * y + m[r, 2] * z for r in range(3)], axis=1), self.triangles)

    def first(self, triangle_count: int) -> Shape:
        """Return the first triangles only, with the points they need; their points must come in the same order."""
        kept = self.triangles[:triangle_count]
        return Shape(self.points[: kept.max() + 1], kept)


def joined(shapes: Iterable[Shape]) -> Shape:
    """Return all shapes as one."""
    parts = list(shapes)
    first = np.cumsum([0, *(len(part.points) for part in parts[:-1])])
    triangles = [part.triangles + np.int32(start) for part, start in zip(parts, first, strict=True)]
    return Shape(np.concatenate([part.points for part in parts]), np.concatenate(triangles))


def repeated(triangles: ArrayLike, count: int, points_each: int) -> Triangles:
    """Return the triangles of ``count`` alike pieces of so many points, int32, shape [count · len(triangles), 3]."""
    one = np.asarray(triangles, np.int32)
    first = points_each * np.arange(count, dtype=np.int32)
    return (first[:, None, None] + one).reshape(-1, 3)


def boxes(low: ArrayLike, high: ArrayLike) -> Shape:
    """Return boxes along the axes between opposite corners, [..., 3] each: 8 points and 12 triangles a box."""
    low, high = np.broadcast_arrays(np.asarray(low, np.float64), np.asarray(high, np.float64))
    low, high = low.reshape(-1, 1, 3), high.reshape(-1, 1, 3)
    points = np.where(_CORNERS == 0.0, low, high)  # a choice, not a product: opposite faces that touch are equal
    return Shape(points.reshape(-1, 3), repeated(_BOX, len(low), 8))


def bars(start: ArrayLike, end: ArrayLike, width: float, thickness: float, up: ArrayLike = (0.0, 1.0, 0.0)) -> Shape:
    """Return straight bars of rectangular section, 12 triangles each.

    Args:
        start, end: The middles of the two ends, shape [..., 3].
        width: Across the bar and across ``up`` [scene units].
        thickness: Along ``up``, as far as that is across the bar [scene units].
        up: Must not run along a bar; shape [3] or [..., 3].
    """
    a, b = (np.asarray(point, np.float64).reshape(-1, 3) for point in (start, end))
    along = unit(b - a)
    side = unit(cross(along, np.broadcast_to(np.asarray(up, np.float64), along.shape)))
    over = cross(side, along)
    points = [
        point + x * width * side + y * thickness * over for point in (a, b) for y in (-0.5, 0.5) for x in (-0.5, 0.5)
    ]
    return Shape(np.stack(points, axis=1).reshape(-1, 3), repeated(_BOX, len(along), 8))


def prism(outline: Sequence[tuple[float, float]], low: float, high: float) -> Shape:
    """Return a convex outline (x, y), counter-clockwise, drawn out along z from ``low`` to ``high``."""
    flat = np.asarray(outline, np.float64)
    count = len(flat)
    points = [np.column_stack([flat, np.full(count, z)]) for z in (low, high)]
    caps = [t for k in range(1, count - 1) for t in ((0, k + 1, k), (count, count + k, count + k + 1))]
    sides = [
        t
        for k, j in zip(range(count), [*range(1, count), 0], strict=True)
        for t in ((k, j, count + j), (k, count + j, count + k))
    ]
    return Shape(np.concatenate(points), np.array(caps + sides, np.int32))


def revolved(profile: ArrayLike, sides: int) -> Shape:
    """Return the surface that a profile sweeps about the y axis.

    Args:
        profile: (radius, height) [n, 2], with the inside to the left seen along it in the plane of x and y: going up
            on the outside. Radii are positive, but the first and the last may be 0: then the surface is closed there.
        sides: How many edges make a circle.
    """
    radius, height = np.asarray(profile, np.float64).T
    closed_below, closed_above = radius[0] == 0.0, radius[-1] == 0.0
    inner = slice(1 if closed_below else 0, len(radius) - 1 if closed_above else len(radius))
    cosine, sine = cosine_sine(360.0 / sides * np.arange(sides))
    r, y = radius[inner, None], height[inner, None]
    rings = np.stack([r * cosine, np.broadcast_to(y, (len(r), sides)), -r * sine], axis=2)
    points = [rings.reshape(-1, 3)]
    triangles = [_bands(len(r), sides)]
    here, beside = np.arange(sides), (np.arange(sides) + 1) % sides
    for closed, level, ring, (a, b) in (
        (closed_below, height[0], 0, (beside, here)),
        (closed_above, height[-1], len(r) - 1, (here, beside)),
    ):
        if closed:
            pole = sum(len(p) for p in points)
            points.append(np.array([[0.0, level, 0.0]]))
            triangles.append(np.stack([np.full(sides, pole), sides * ring + a, sides * ring + b], axis=1))
    return Shape(np.concatenate(points), np.concatenate(triangles).astype(np.int32))


def _bands(ring_count: int, sides: int) -> NDArray[np.int64]:
    """Return the triangles between neighbouring rings of a surface of revolution, facing out if rings rise."""
    here, beside = np.arange(sides), (np.arange(sides) + 1) % sides
    band = np.stack([here, beside, beside + sides, here, beside + sides, here + sides], axis=1).reshape(-1, 3)
    return (sides * np.arange(ring_count - 1)[:, None, None] + band).reshape(-1, 3)


def cylinder(radius: float, low: float, high: float, sides: int = 16) -> Shape:
    """Return an upright closed cylinder: 4 · sides triangles."""
    return revolved([(0.0, low), (radius, low), (radius, high), (0.0, high)], sides)


def sphere(radius: float, sides: int = 24, rings: int = 12) -> Shape:
    """Return a ball round the origin by circles of latitude: 2 · sides · (rings - 1) triangles."""
    cosine, sine = cosine_sine(180.0 / rings * np.arange(rings + 1) - 90.0)
    profile = radius * np.stack([cosine, sine], axis=1)
    profile[[0, -1], 0] = 0.0
    return revolved(profile, sides)


def sheet(points: Array) -> Shape:
    """Return a surface through a grid of points [rows, columns, 3], facing rows x columns: 2 triangles a mesh."""
    rows, columns = points.shape[:2]
    corner = (columns * np.arange(rows - 1)[:, None] + np.arange(columns - 1)).reshape(-1)
    a, b, c, d = corner, corner + columns, corner + columns + 1, corner + 1
    triangles = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)
    return Shape(points.reshape(-1, 3), triangles.astype(np.int32))


def rectangle(x: tuple[float, float], z: tuple[float, float], y: float = 0.0) -> Shape:
    """Return a level rectangle facing up: 2 triangles."""
    corners = [(x[0], y, z[0]), (x[1], y, z[0]), (x[1], y, z[1]), (x[0], y, z[1])]
    return Shape(np.array(corners), np.array([(0, 2, 1), (0, 3, 2)], np.int32))


def wall(x: tuple[float, float], top: float, z: tuple[float, float], openings: Sequence[Opening] = ()) -> Shape:
    """Return an upright wall along x with rectangular holes, as boxes that meet exactly.

    Args:
        x, z: Where it begins and ends.
        top: Its height; it begins at y = 0.
        openings: Holes (x0, x1, y0, y1), which must not overlap.
    """
    cuts = sorted({*x, *(c for hole in openings for c in hole[:2])})
    low, high = [], []
    for x0, x1 in pairwise(cuts):
        level = 0.0
        for _, _, y0, y1 in sorted((h for h in openings if h[0] <= x0 and x1 <= h[1]), key=lambda h: h[2]):
            if y0 > level:
                low.append((x0, level, z[0]))
                high.append((x1, y0, z[1]))
            level = y1
        if top > level:
            low.append((x0, level, z[0]))
            high.append((x1, top, z[1]))
    return boxes(low, high)
