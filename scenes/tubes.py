"""Tubes along paths: wires, rods, stems, branches and hairs; many of the same kind at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shadowbench.scene import cosine_sine

from .shapes import Shape
from .vectors import Array, across, cross, dot, unit


def tube_triangles(tube_count: int, ring_count: int, sides: int) -> NDArray[np.int32]:
    """Return the triangles of open tubes, int32, shape [2 · sides · tube_count · (ring_count - 1), 3], facing out.

    The points of a tube are its rings one after another, each counter-clockwise seen from the tube's end.
    """
    here, beside = np.arange(sides), (np.arange(sides) + 1) % sides
    band = np.stack([here, beside, beside + sides, here, beside + sides, here + sides], axis=1).reshape(-1, 3)
    first = sides * (ring_count * np.arange(tube_count)[:, None] + np.arange(ring_count - 1))
    return (first[:, :, None, None] + band).reshape(-1, 3).astype(np.int32)


def tubes(paths: ArrayLike, radius: ArrayLike, sides: int) -> Shape:
    """Return open tubes: 2 · sides · (point_count - 1) triangles each.

    Args:
        paths: Points along the tubes' middles, shape [tube_count, point_count, 3]; no two in a row alike.
        radius: At each point, of a shape that broadcasts to [tube_count, point_count].
        sides: Of the polygon that is the tube's section.
    """
    path = np.asarray(paths, np.float64)
    along = tangents(path)
    radii = np.broadcast_to(np.asarray(radius, np.float64), path.shape[:2])[:, :, None, None]
    cosine, sine = (part[:, None] for part in cosine_sine(360.0 / sides * np.arange(sides)))
    side = across(along[:, 0])
    rings = []
    for ring in range(path.shape[1]):
        # the section is carried along without twisting: what has come to lean along the path is taken off
        side = unit(side - dot(side, along[:, ring])[:, None] * along[:, ring])
        rings.append(cosine * side[:, None] + sine * cross(along[:, ring], side)[:, None])
    points = path[:, :, None] + radii * np.stack(rings, axis=1)
    return Shape(points.reshape(-1, 3), tube_triangles(path.shape[0], path.shape[1], sides))


def tangents(paths: Array) -> Array:
    """Return the unit directions of paths [..., point_count, 3] at their points, the mean of the pieces that meet."""
    pieces = unit(paths[..., 1:, :] - paths[..., :-1, :])
    ends = np.concatenate([pieces[..., :1, :], pieces, pieces[..., -1:, :]], axis=-2)
    return unit(ends[..., 1:, :] + ends[..., :-1, :])
