"""Leaves, blades of grass and flowers: the fine structure of the outdoor scenes, from a few triangles each.

What stands for a plant is drawn large if there are few of it and small if there are many, so that a scene with more
triangles has the same shade in finer pieces (:func:`leaf_length`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .shapes import Shape, joined, repeated
from .tubes import tubes
from .uniform_draws import UniformDraws
from .vectors import Array, across, cross, dot, unit

UP = np.array([0.0, 1.0, 0.0])

LEAF_TRIANGLES = 2
LEAF_WIDTH = 0.55
"""Of a leaf's length."""

_FOLD = 0.14
"""How far a leaf's edges are raised above its midrib, of its length."""

BLADE_TRIANGLES = 3


def directions(draw: UniformDraws, count: int) -> Array:
    """Return unit vectors uniform over the sphere [count, 3], after Marsaglia 1972."""
    x, y, squared = draw.unit_disk(count)
    factor = 2.0 * np.sqrt(1.0 - squared)
    return np.stack([factor * x, factor * y, 1.0 - 2.0 * squared], axis=1)


def within(draw: UniformDraws, count: int, low: float, high: float) -> Array:
    """Return numbers uniform in [low, high), shape [count]."""
    return low + (high - low) * draw.unit_interval(count)


def leaf_length(leaf_count: int, area: float) -> float:
    """Return how long each leaf is, if so many have this area together."""
    return math.sqrt(area / max(leaf_count, 1) * 2.0 / LEAF_WIDTH)


def leaves(base: Array, along: Array, facing: Array, length: Array) -> Shape:
    """Return rhombic leaves folded along the midrib.

    Args:
        base: Where each is attached, shape [leaf_count, 3].
        along: Unit directions to the tips.
        facing: Roughly the upper side's normals; not along ``along``.
        length: From base to tip, shape [leaf_count].
    """
    side = unit(cross(along, facing))
    over = cross(side, along)
    size = length[:, None]
    rib = base + 0.45 * size * along + _FOLD * size * over
    points = [
        base,
        rib + 0.5 * LEAF_WIDTH * size * side,
        base + size * along,
        rib - 0.5 * LEAF_WIDTH * size * side,
    ]
    return Shape(np.stack(points, axis=1).reshape(-1, 3), repeated([(0, 1, 2), (0, 2, 3)], len(base), 4))


def leaves_about(draw: UniformDraws, base: Array, outward: Array, length: float, *, droop: float = 0.35) -> Shape:
    """Return leaves that point roughly ``outward`` [leaf_count, 3], hang a little and face the sky more or less."""
    count = len(base)
    along = unit(outward + 0.6 * directions(draw, count) - droop * UP)
    facing = unit(UP + 0.7 * directions(draw, count))
    # a leaf that points straight up has no upper side: any across it will do
    steep = np.abs(dot(along, facing)) > 0.99
    facing = np.where(steep[:, None], across(along), facing)
    return leaves(base, along, facing, length * within(draw, count, 0.7, 1.3))


def blades(root: Array, lean: Array, height: Array, width: float) -> Shape:
    """Return blades of grass that bend over: three triangles each.

    Args:
        root: Where they leave the ground, shape [blade_count, 3].
        lean: How far the tips hang over, horizontal, shape [blade_count, 3]; none may be 0.
        height: Of the tips above the roots, shape [blade_count].
        width: At the root [scene units].
    """
    side = 0.5 * width * unit(cross(np.broadcast_to(UP, lean.shape), lean))
    rise = height[:, None] * UP
    middle = root + 0.55 * rise + 0.3 * lean
    points = np.stack(
        [root - side, root + side, middle + 0.75 * side, middle - 0.75 * side, root + rise + lean], axis=1
    )
    return Shape(points.reshape(-1, 3), repeated([(0, 1, 2), (0, 2, 3), (3, 2, 4)], len(root), 5))


def grass(draw: UniformDraws, root: Array, height: float, width: float) -> Shape:
    """Return one blade of grass at each root [blade_count, 3], of about this height, leaning anywhere."""
    count = len(root)
    x, z, _ = draw.unit_disk(count)
    tall = height * within(draw, count, 0.55, 1.25)
    lean = 0.6 * tall[:, None] * np.stack([x, np.zeros(count), z], axis=1)
    return blades(root, lean, tall, width)


class Bush(NamedTuple):
    """A bush or a potted plant: where it stands, how far it reaches along x and z, how high it is."""

    x: float
    y: float
    z: float
    radius: float
    height: float

    @property
    def outline(self) -> float:
        """About its area seen from the side."""
        return self.radius * self.height


def bushes(draw: UniformDraws, triangle_count: int, those: Sequence[Bush], density: float) -> Shape:
    """Return the leaves of bushes, denser towards their skins, which share the triangles by their outlines.

    Args:
        draw: Where chance comes from.
        triangle_count: Of all together, exactly; enough for a leaf each.
        those: The bushes.
        density: Leaf area for each unit of a bush's outline.
    """
    until = np.cumsum([bush.outline for bush in those])
    ends = np.floor(triangle_count * (until / until[-1])).astype(np.int64)
    counts = np.diff(ends, prepend=0)
    return joined(_bush(draw, int(n), bush, density * bush.outline) for n, bush in zip(counts, those, strict=True))


def _bush(draw: UniformDraws, triangle_count: int, bush: Bush, area: float) -> Shape:
    count = -(-triangle_count // LEAF_TRIANGLES)
    outward = directions(draw, count)
    # the largest of three numbers is as the distances in a ball are: uniform by volume
    distance = np.maximum(np.maximum(draw.unit_interval(count), draw.unit_interval(count)), draw.unit_interval(count))
    half = np.array([bush.radius, bush.height / 2.0, bush.radius])
    long = leaf_length(count, area)
    base = half * outward * np.maximum(1.0 - 1.3 * long / half.min(), 0.4) * distance[:, None]
    base[:, 1] = np.maximum(base[:, 1] + half[1], 1.3 * long)
    return leaves_about(draw, base, outward, long).first(triangle_count).moved(bush.x, bush.y, bush.z)


def bush_stems(draw: UniformDraws, those: Sequence[Bush]) -> Shape:
    """Return nine stems a bush, which carry its leaves: 162 triangles each."""
    share = np.array([0.0, 0.35, 0.7, 1.0])[:, None]
    parts = []
    for bush in those:
        upward = directions(draw, 9)
        upward[:, 1] = np.abs(upward[:, 1]) + 0.5
        tips = 0.8 * unit(upward) * np.array([bush.radius, bush.height, bush.radius])
        # they leave the ground more steeply than they end
        paths = tips[:, None] * share * np.where(UP > 0.0, 1.5 - 0.5 * share, 1.0)
        parts.append(tubes(paths, 0.02 * bush.height * (1.0 - 0.7 * share[:, 0]), 3).moved(bush.x, bush.y, bush.z))
    return joined(parts)


def along(draw: UniformDraws, count: int, edges: ArrayLike) -> Array:
    """Return points [count, 2] uniform along edges (x, z) to (x, z), shape [edge_count, 4]."""
    lines = np.asarray(edges, np.float64)
    start, way = lines[:, :2], lines[:, 2:] - lines[:, :2]
    until = np.cumsum(np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1]))
    edge = np.minimum(np.searchsorted(until / until[-1], draw.unit_interval(count)), len(lines) - 1)
    return start[edge] + draw.unit_interval(count)[:, None] * way[edge]


def tufts(draw: UniformDraws, triangle_count: int, centres: Array, spread: float, height: float, width: float) -> Shape:
    """Return blades of grass that stand round centres (x, z) [tuft_count, 2] on y = 0, exactly so many triangles."""
    count = -(-triangle_count // BLADE_TRIANGLES)
    centre = centres[np.arange(count) % len(centres)]
    dx, dz, _ = draw.unit_disk(count)
    root = np.stack([centre[:, 0] + spread * dx, np.zeros(count), centre[:, 1] + spread * dz], axis=1)
    return grass(draw, root, height, width).first(triangle_count)
