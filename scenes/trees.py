"""Broad-leaved trees, grown level by level: trunk, boughs, branches, twigs, leaves.

A branch begins on its parent, at an angle to it and the golden angle round it from the one before; it bends upwards
and wanders a little as it grows. All branches of a level grow at once. A tree of more triangles has more branches and
more and smaller leaves of the same area together (so it casts about the same shade, in finer pieces), and it has
exactly the triangles asked for, as the leaves come in pairs of triangles and the last may be half a leaf.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .plants import LEAF_TRIANGLES, UP, directions, leaf_length, leaves_about, within
from .shapes import Shape, joined
from .tubes import tangents, tubes
from .uniform_draws import UniformDraws
from .vectors import Array, across, between, cross, turned, unit

LEAST_TRIANGLES = 1000
"""With fewer there is no telling trunk from leaves."""

WOOD_SHARE = 0.3
"""No more than this share of a tree's triangles is wood."""

LEAF_AREA = 2.2
"""Area of all leaves, in squares of the tree's height: so dense that the crown lets light through in specks."""

_GOLDEN_ANGLE = 137.50776405003785
"""[degrees] From one branch to the next round their parent: no two stand above each other."""


@dataclass(frozen=True)
class _Level:
    """How the branches of one level grow on those of the level before.

    Attributes:
        children: On each parent; for the trunk 1.
        seat: The part of the parent that bears them, as shares of its length.
        angle: Between parent and child [degrees], at the two ends of the seat.
        length: Of the child, relative to the parent's, at the two ends of the seat.
        slender: Radius at the base, relative to the child's length.
        rise: How strongly growth turns upwards over the whole length.
        wander: The same to random sides.
        pieces, sides: Of the tubes.
    """

    children: int
    seat: tuple[float, float]
    angle: tuple[float, float]
    length: tuple[float, float]
    slender: float
    rise: float
    wander: float
    pieces: int
    sides: int


@dataclass(frozen=True, eq=False)
class _Branches:
    """Branches of one level: their middles [branch_count, piece_count + 1, 3] and the radii there."""

    paths: Array
    radii: Array
    lengths: Array

    def at(self, branch: NDArray[np.integer], share: Array) -> tuple[Array, Array, Array]:
        """Return place, direction and radius at shares of the lengths of some branches."""
        pieces = self.paths.shape[1] - 1
        piece = np.minimum((share * pieces).astype(np.int64), pieces - 1)
        rest = share * pieces - piece
        a, b = (branch, piece), (branch, piece + 1)
        along = tangents(self.paths)
        direction = unit(between(along[a], along[b], rest))
        return (
            between(self.paths[a], self.paths[b], rest),
            direction,
            (1.0 - rest) * self.radii[a] + rest * self.radii[b],
        )


def _levels(detail: float) -> tuple[_Level, ...]:
    """Return trunk, boughs, branches and, if there is enough detail, twigs; detail 1 suits 36,000 triangles."""

    def some(ordinary: float, least: int) -> int:
        return max(least, round(ordinary * detail))

    def few(ordinary: float, least: int) -> int:
        return max(least, round(ordinary * math.sqrt(detail)))

    trunk = _Level(1, (0, 0), (0, 0), (1, 1), 0.03, 0.1, 0.3, few(14, 4), few(9, 4))
    boughs = _Level(few(17, 6), (0.4, 1.0), (74, 14), (0.62, 0.44), 0.026, 0.45, 0.6, few(7, 3), few(5, 3))
    branches = _Level(some(9, 2), (0.2, 1.0), (58, 36), (0.56, 0.34), 0.02, 0.3, 0.8, few(4, 2), few(4, 3))
    twigs = _Level(round(5 * detail), (0.2, 1.0), (52, 30), (0.5, 0.36), 0.014, 0.1, 0.9, few(2, 2), 3)
    return (trunk, boughs, branches, twigs) if twigs.children > 0 else (trunk, boughs, branches)


def _wood_triangles(levels: tuple[_Level, ...]) -> int:
    total, branches = 0, 1
    for level in levels:
        branches *= level.children
        total += branches * 2 * level.sides * level.pieces
    return total


def _levels_for(triangle_count: int) -> tuple[_Level, ...]:
    """Return the most detailed levels whose wood takes no more than its share."""
    for step in range(100, 0, -1):
        levels = _levels(step / 25.0)
        if _wood_triangles(levels) <= WOOD_SHARE * triangle_count:
            return levels
    raise AssertionError(f"a tree has at least {LEAST_TRIANGLES} triangles: {triangle_count}")


def tree(triangle_count: int, draw: UniformDraws, height: float, sink: float = 0.0) -> tuple[Shape, Shape]:
    """Return a tree's wood and its leaves, together exactly ``triangle_count`` triangles.

    Args:
        triangle_count: At least :data:`LEAST_TRIANGLES`.
        draw: Where chance comes from.
        height: Of the highest leaf; the trunk stands in the origin [scene units].
        sink: How far the trunk goes on below the ground [scene units].
    """
    levels = _levels_for(triangle_count)
    grown = [_trunk(draw, levels[0])]
    for level in levels[1:]:
        grown.append(_offshoots(draw, level, grown[-1]))
    leaves = _crown(draw, grown[-1], triangle_count - _wood_triangles(levels))
    scale = height / float(leaves.points[:, 1].max())
    grown[0].paths[0, 0, 1] = -sink / scale
    wood = joined(
        tubes(branches.paths, branches.radii, level.sides) for branches, level in zip(grown, levels, strict=True)
    )
    return wood.scaled(scale, scale, scale), leaves.scaled(scale, scale, scale)


def _trunk(draw: UniformDraws, level: _Level) -> _Branches:
    """Return the trunk of a tree about one unit high."""
    trunk = _grown(draw, level, np.zeros((1, 3)), UP[None], np.array([0.68]), np.array([level.slender]))
    flare = 1.0 - np.arange(level.pieces + 1) / level.pieces
    for _ in range(4):
        flare = flare * flare  # a product rounds alike everywhere, a power may not
    trunk.radii[0] *= 1.0 + 0.5 * flare
    return trunk


def _offshoots(draw: UniformDraws, level: _Level, parents: _Branches) -> _Branches:
    """Return what grows on the parents: the k-th child of each sits in the k-th part of the seat."""
    parent_count = len(parents.paths)
    parent = np.repeat(np.arange(parent_count), level.children)
    order = np.tile(np.arange(level.children), parent_count)
    count = len(parent)
    rank = (order + draw.unit_interval(count)) / level.children
    share = level.seat[0] + (level.seat[1] - level.seat[0]) * rank
    place, along, thick = parents.at(parent, share)
    turn = _GOLDEN_ANGLE * order + 360.0 * draw.unit_interval(parent_count)[parent] + within(draw, count, -25.0, 25.0)
    first = across(along)
    sideways = turned(first, cross(along, first), turn)
    angle = level.angle[0] + (level.angle[1] - level.angle[0]) * rank + within(draw, count, -8.0, 8.0)
    outwards = turned(along, sideways, angle)
    length = level.length[0] + (level.length[1] - level.length[0]) * rank
    length = length * parents.lengths[parent] * within(draw, count, 0.75, 1.2)
    return _grown(draw, level, place, outwards, length, np.minimum(level.slender * length, 0.75 * thick))


def _grown(
    draw: UniformDraws, level: _Level, start: Array, direction: Array, length: Array, radius: Array
) -> _Branches:
    """Return branches grown piece by piece, that taper to a fifth."""
    step = (length / level.pieces)[:, None]
    paths = [start]
    for _ in range(level.pieces):
        turn = level.rise * UP + level.wander * directions(draw, len(start))
        paths.append(paths[-1] + step * direction)
        direction = unit(direction + turn / level.pieces)
    taper = 1.0 - 0.8 * np.arange(level.pieces + 1) / level.pieces
    return _Branches(np.stack(paths, axis=1), radius[:, None] * taper, length)


def _crown(draw: UniformDraws, bearing: _Branches, triangle_count: int) -> Shape:
    """Return the leaves, spread evenly over the finest branches and denser towards their ends."""
    count = -(-triangle_count // LEAF_TRIANGLES)
    branch = np.arange(count) * len(bearing.paths) // count
    share = np.sqrt(within(draw, count, 0.01, 1.0))
    place, along, _ = bearing.at(branch, share)
    first = across(along)
    sideways = turned(first, cross(along, first), 360.0 * draw.unit_interval(count))
    outward = unit(0.7 * along + sideways)
    return leaves_about(draw, place, outward, leaf_length(count, LEAF_AREA)).first(triangle_count)
