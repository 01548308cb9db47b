"""Convolution, maximum and logarithmic convolution of maps with separable windows.

Maps are arrays of shape [face, row, column, channel]; a filter treats faces and channels alike and independently. A
window of K texels along each axis lies around the texel; of an even one, K/2 texels lie before it and K/2 - 1 after.
Beyond an edge lies the edge's texel again (faces of a cube do not see each other). Results do not depend on the number
of threads. The bodies are native (:mod:`shadowbench.device.separable_filters_kernels`), so that this runs on the CPU
only.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.launch import Context, launch
from shadowbench.device.separable_filters_kernels import (
    MOST_CHANNELS,
    MOST_TAPS,
    filter_bytes,
    filter_floats,
    filter_logarithms,
    filter_maxima,
)

_STRIPS_PER_THREAD = 4
_SHORTEST_STRIP = 16
"""Several threads get so many strips each, unless strips would be shorter: each filters its neighbours' rows anew."""


def convolve(
    source: wp.array[Any], target: wp.array[Any], weights: NDArray[np.floating[Any]], context: Context
) -> None:
    """Write the weighted means of ``source`` to ``target``.

    Equal values come out unchanged, bit for bit; other means of float32 are within a few ulp. 8-bit values are filtered
    in float32 and rounded once, half up.

    Args:
        source: float32 or uint8, contiguous, shape [face, row, column, channel].
        target: The same type and shape, other memory.
        weights: Of the taps along each axis, summing to 1; an odd number of them must be symmetric.
        context: Where to run.

    Raises:
        ValueError: More taps or channels than there may be, weights that are not symmetric, or unlike arrays.
    """
    if len(weights) % 2 and not np.array_equal(weights, weights[::-1]):
        raise ValueError("the weights of an odd number of taps must be symmetric")
    kernel = filter_bytes if source.dtype == wp.uint8 else filter_floats
    _filter(kernel, source, target, weights.astype(np.float32), 1.0, context)


def keep_maxima(source: wp.array[Any], target: wp.array[Any], width: int, context: Context) -> None:
    """Write the largest value of each window of ``width`` x ``width`` texels.

    Arguments as of :func:`convolve`, float32.
    """
    _filter(filter_maxima, source, target, np.zeros(width, np.float32), 1.0, context)


def convolve_logarithms(
    source: wp.array[Any],
    target: wp.array[Any],
    weights: NDArray[np.floating[Any]],
    steepness: float,
    context: Context,
) -> None:
    """Convolve e^(c z) of maps that hold z: write ln(sum of w e^(c z)) / c, where c is ``steepness``.

    The largest z of the window is factored out first, so that nothing overflows, whatever c. Arguments as of
    :func:`convolve`, float32.
    """
    _filter(filter_logarithms, source, target, weights.astype(np.float32), steepness, context)


def _filter(
    kernel: wp.Kernel,
    source: wp.array[Any],
    target: wp.array[Any],
    weights: NDArray[np.float32],
    steepness: float,
    context: Context,
) -> None:
    faces, rows, columns, channels = source.shape
    if target.shape != source.shape or target.dtype != source.dtype or target.ptr == source.ptr:
        raise ValueError("the target must be another array of the source's type and shape")
    if not (source.is_contiguous and target.is_contiguous):
        raise ValueError("maps must be contiguous")
    if not 1 <= len(weights) <= MOST_TAPS or channels > MOST_CHANNELS:
        raise ValueError(
            f"{len(weights)} taps over {channels} channels; at most {MOST_TAPS} and {MOST_CHANNELS} are possible"
        )
    strips = 1 if context.threads == 1 else _STRIPS_PER_THREAD * context.threads
    height = max(-(-rows * faces // strips), min(_SHORTEST_STRIP, rows))
    height = -(-rows // max(1, round(rows / height)))  # of equal height in each face
    launch(
        kernel,
        faces * -(-rows // height),
        inputs=[
            source.flatten(),
            as_warp(weights, wp.float32, context.device),
            steepness,
            height,
            rows,
            columns * channels,
            channels,
        ],
        outputs=[target.flatten()],
        context=context,
        block_size=1,
    )
