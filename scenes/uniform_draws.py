"""Random numbers that are the same bits on every machine, for the scenes that are drawn.

Made from raw 64-bit draws, whose stream NumPy guarantees, and from arithmetic that IEEE 754 rounds in one way only:
sums, products, quotients and square roots, but no library sine, no logarithm and no BLAS.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Axis = tuple[Array, Array, Array]
"""Vectors by coordinate: x, y and z, shape [count] each."""


class UniformDraws:
    """Random numbers from the raw stream of PCG64, the same in every NumPy version."""

    def __init__(self, seed: int) -> None:
        self._bits = np.random.PCG64(seed)

    def unit_interval(self, count: int) -> Array:
        """Uniform in [0, 1), multiples of 2^-53, shape [count]."""
        raw: Array = (self._bits.random_raw(count) >> np.uint64(11)).astype(np.float64)
        return raw * 2.0**-53

    def unit_disk(self, count: int) -> tuple[Array, Array, Array]:
        """Return x, y and x² + y² of points uniform in the open unit disk without its centre, by rejection."""
        kept: list[tuple[Array, Array, Array]] = []
        missing = count
        while missing > 0:
            tries = missing + missing // 2 + 8  # 4/pi = 1.27 are needed
            x, y = 2.0 * self.unit_interval(tries) - 1.0, 2.0 * self.unit_interval(tries) - 1.0
            squared = x * x + y * y
            inside = np.flatnonzero((squared < 1.0) & (squared > 0.0))[:missing]
            kept.append((x[inside], y[inside], squared[inside]))
            missing -= len(inside)
        x, y, squared = (np.concatenate(parts) for parts in zip(*kept, strict=True))
        return x, y, squared

    def unit_quaternions(self, count: int) -> tuple[Array, Array, Array, Array]:
        """Uniform over the rotations, after Marsaglia 1972, "Choosing a point from the surface of a sphere"."""
        x, y, first_squared = self.unit_disk(count)
        z, w, second_squared = self.unit_disk(count)
        factor = np.sqrt((1.0 - first_squared) / second_squared)
        return x, y, z * factor, w * factor


def rotated_axes(quaternions: tuple[Array, Array, Array, Array]) -> tuple[Axis, Axis, Axis]:
    """Return the images of the x, y and z axes under rotations (w, x, y, z), each as its three coordinates."""
    w, x, y, z = quaternions
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
