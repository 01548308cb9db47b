"""Weights of the filters: one rule for every technique and for the filtered reference."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def gauss_sigma(width: int) -> float:
    """Standard deviation of a Gauss kernel of ``width`` taps [texels]: the rule of OpenCV's ``getGaussianKernel``."""
    return 0.3 * ((width - 1) * 0.5 - 1.0) + 0.8


def tap_weights(shape: str, width: int) -> NDArray[np.float64]:
    """Weights of ``width`` taps along one axis, summing to 1; ``shape`` is ``box`` or ``gauss``."""
    if shape == "box":
        return np.full(width, 1.0 / width)
    sigma = gauss_sigma(width)
    offsets = [k - (width - 1) / 2.0 for k in range(width)]
    values = [math.exp(-0.5 * (x / sigma) ** 2) for x in offsets]
    return np.array(values) / math.fsum(values)
