"""What share of a filter's footprint lies on one side of a straight line: closed forms and Gauss-Legendre quadrature.

Independent of the program: nothing is sampled.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

Floats = NDArray[np.floating[Any]]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


def cumulative(kernel: Any, x: Floats) -> Floats:
    """The share of a kernel's weight below each ``x`` [texels] along one axis."""
    half = kernel.width / 2.0
    x = np.clip(x, -half, half)
    if kernel.shape == "box":
        return x / kernel.width + 0.5
    if kernel.shape == "gauss":
        root = np.sqrt(2.0) * kernel.sigma
        return 0.5 + 0.5 * erf(x / root) / erf(half / root)
    side = x / half
    return np.where(side < 0.0, 0.5 * (1.0 + side) ** 2, 1.0 - 0.5 * (1.0 - side) ** 2)


def density(kernel: Any, x: Floats) -> Floats:
    """The weight at each ``x`` [texels] of the footprint along one axis; its integral is 1."""
    half = kernel.width / 2.0
    if kernel.shape == "box":
        return np.full_like(x, 1.0 / kernel.width)
    if kernel.shape == "gauss":
        within = erf(half / (np.sqrt(2.0) * kernel.sigma))
        return np.exp(-0.5 * (x / kernel.sigma) ** 2) / (np.sqrt(2.0 * np.pi) * kernel.sigma * within)
    return (1.0 - np.abs(x) / half) / half


def half_plane_share(kernel: Any, direction: Floats, offset: float) -> float:
    """The share of the weight where ``direction . x < offset``, ``direction`` a unit vector.

    For a box, the area of the square that the line cuts off; for a tent or Gauss, that of one axis where the line is
    parallel to the other, and else an integral over one axis of the other's closed form, from kink to kink.
    """
    across, along = sorted(np.abs(direction).tolist())  # weights are symmetric in sign and axis
    half = kernel.width / 2.0
    if across < 1e-12:
        return float(cumulative(kernel, np.array(offset / along)))
    if kernel.shape == "box":
        return _clipped_square(across, along, offset / kernel.width)
    kinks = np.clip([(offset - s * along * half) / across for s in (-1.0, 0.0, 1.0)], -half, half)
    edges = np.sort([-half, *kinks, 0.0, half])
    x = edges[:-1, None] + np.diff(edges)[:, None] * (0.5 + 0.5 * _NODES)
    values = density(kernel, x) * cumulative(kernel, (offset - across * x) / along)
    return float((0.5 * np.diff(edges)[:, None] * _WEIGHTS * values).sum())


def _clipped_square(a: float, b: float, offset: float) -> float:
    """The area of ``a x + b y < offset`` in the unit square around the origin; 0 < a <= b."""

    def corner(t: float) -> float:
        return max(t, 0.0) ** 2 / (2.0 * a * b)

    t = offset + (a + b) / 2.0
    return corner(t) - corner(t - a) - corner(t - b) + corner(t - a - b)
