"""Paving and walls of bricks, laid in courses that are shifted by half a stone."""

from __future__ import annotations

import math

import numpy as np

from shadowbench.scene import Vector

from .shapes import Shape, boxes
from .uniform_draws import UniformDraws

STONES: tuple[Vector, ...] = ((0.68, 0.64, 0.57), (0.62, 0.58, 0.52), (0.73, 0.69, 0.60))
BRICKS: tuple[Vector, ...] = ((0.60, 0.29, 0.20), (0.53, 0.25, 0.18), (0.66, 0.36, 0.25))


def paving(
    draw: UniformDraws,
    x: tuple[float, float],
    z: tuple[float, float],
    size: tuple[float, float],
    joint: float,
    top: float,
) -> list[Shape]:
    """Return stones that stand on y = 0, with open joints, in three heaps to be coloured differently.

    Args:
        draw: Says which stone is of which heap.
        x, z: What they cover; z is divided into whole courses.
        size: Of a stone with its joint, along x and z.
        joint: Width of the gaps.
        top: Height of the stones.
    """
    courses = round((z[1] - z[0]) / size[1])
    depth = (z[1] - z[0]) / courses
    stones: list[list[tuple[float, float, float]]] = [[], [], []]
    for course in range(courses):
        first = x[0] + (size[0] if course % 2 else size[0] / 2.0)
        # no sliver at the end: the last cut leaves at least a quarter of a stone
        cuts = math.ceil((x[1] - size[0] / 4.0 - first) / size[0])
        edges = [x[0], *(first + size[0] * np.arange(cuts)).tolist(), x[1]]
        kinds = (3.0 * draw.unit_interval(len(edges) - 1)).astype(np.int64)
        for left, right, kind in zip(edges[:-1], edges[1:], kinds, strict=True):
            stones[kind].append((left, right, z[0] + course * depth))
    heaps = []
    for heap in stones:
        left, right, near = np.array(heap).reshape(-1, 3).T
        low = np.stack([left + joint / 2.0, np.zeros(len(left)), near + joint / 2.0], axis=1)
        high = np.stack([right - joint / 2.0, np.full(len(left), top), near + depth - joint / 2.0], axis=1)
        heaps.append(boxes(low, high))
    return heaps


def brick_facing(
    draw: UniformDraws, length: float, height: float, brick: tuple[float, float], joint: float, depth: float
) -> list[Shape]:
    """Return bricks that face +z and stand out from a wall at z = 0 by ``depth``, above y = 0; see :func:`paving`."""
    laid = paving(draw, (0.0, length), (-height, 0.0), brick, joint, depth)
    # stood up: what was above is in front, what was behind is above
    return [heap.turned((1.0, 0.0, 0.0), 90.0) for heap in laid]
