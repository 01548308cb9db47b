"""Vectors in arrays [..., 3], with every sum written out: no BLAS, so every machine rounds alike."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shadowbench.scene import Vector, cosine_sine

Array = NDArray[np.float64]


def dot(a: Array, b: Array) -> Array:
    """Return the inner products, shape [...]."""
    result: Array = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
    return result


def cross(a: Array, b: Array) -> Array:
    """Return the vector products, shape [..., 3]."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def length(a: Array) -> Array:
    """Return the lengths, shape [...]."""
    return np.sqrt(dot(a, a))


def unit(a: ArrayLike) -> Array:
    """Return the vectors divided by their lengths, none of which may be 0."""
    vectors = np.asarray(a, np.float64)
    return vectors / length(vectors)[..., None]


def across(a: Array) -> Array:
    """Return some unit vector at right angles to each unit vector, [..., 3]: horizontal unless ``a`` is nearly so."""
    steep = np.abs(a[..., 1:2]) < 0.9
    return unit(cross(np.where(steep, np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])), a))


def turned(a: Array, b: Array, degrees: Array | float) -> Array:
    """Return the unit vectors that lie so far from ``a`` towards ``b``, two unit vectors at right angles, [..., 3]."""
    cosine, sine = cosine_sine(degrees)
    return cosine[..., None] * a + sine[..., None] * b


def between(a: Array, b: Array, share: Array | float) -> Array:
    """Return a + share · (b - a), for shares of shape [...]."""
    return a + np.asarray(share, np.float64)[..., None] * (b - a)


def vector(a: Sequence[float] | Array) -> Vector:
    """Return one vector as a tuple of numbers."""
    return (float(a[0]), float(a[1]), float(a[2]))
