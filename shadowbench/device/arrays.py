"""NumPy arrays as Warp arrays, without a copy where the device allows it."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray


def as_warp(array: NDArray[Any], dtype: Any, device: str) -> wp.array[Any]:
    """Return ``array`` as a Warp array of ``dtype`` on ``device``.

    On the CPU the memory is shared, read-only memory maps included: kernels must treat such an array as input.

    Args:
        array: C-contiguous. For a vector ``dtype`` its last axis has the vector's length.
        dtype: A Warp scalar or vector type.
        device: A Warp device name.
    """
    return wp.array(np.ascontiguousarray(array), dtype=dtype, device=device, copy=device != "cpu")
