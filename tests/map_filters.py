"""Filters of square maps in NumPy, float64: what a graphics API does, written down independently of any."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]


def blurred(image: Floats, width: int) -> Floats:
    """Separable Gauss of ``width`` taps by OpenCV's rule, the border's texels going on; [row, column] and channels."""
    sigma = 0.3 * ((width - 1) * 0.5 - 1.0) + 0.8
    taps = np.exp(-0.5 * ((np.arange(width) - width // 2) / sigma) ** 2)
    taps /= taps.sum()
    for axis in (0, 1):
        pad = [(width // 2, width // 2) if a == axis else (0, 0) for a in range(image.ndim)]
        padded = np.pad(image.astype(np.float64), pad, mode="edge")
        image = sum(w * np.take(padded, np.arange(k, k + image.shape[axis]), axis) for k, w in enumerate(taps))
    return image


def four_places(size: int, u: Floats, v: Floats) -> Iterator[tuple[tuple[Any, Any], Floats]]:
    """Yield the four texels around each place as (row, column), clamped to the border, and their bilinear weights."""
    x, y = u * size - 0.5, v * size - 0.5
    for j in (0, 1):
        for i in (0, 1):
            column, row = np.floor(x).astype(int) + i, np.floor(y).astype(int) + j
            share = (1.0 - np.abs(x - column)) * (1.0 - np.abs(y - row))
            yield (np.clip(row, 0, size - 1), np.clip(column, 0, size - 1)), share


def bilinear(level: Floats, u: Floats, v: Floats) -> Floats:
    """Look up between the texels' centres; shape of u, and channels."""
    return sum((level[texel].T * share).T for texel, share in four_places(len(level), u, v))


def trilinear(chain: Sequence[Floats], u: Floats, v: Floats, detail: Floats) -> Floats:
    """Look up in the two levels around the level of detail, and between them."""
    detail = np.clip(detail, 0.0, len(chain) - 1)
    lower = np.minimum(np.floor(detail).astype(int), len(chain) - 2)
    every = np.arange(len(u))
    found = np.stack([bilinear(level, u, v) for level in chain])
    part = detail - lower
    return ((1.0 - part) * found[lower, every].T + part * found[lower + 1, every].T).T
