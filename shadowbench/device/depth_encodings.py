"""From linear depth to what a filter may average: exponentials, moments, and Fourier terms of a map's depths.

Maps are arrays of shape [face, row, column, channel], depth maps [face, row, column]. The bodies are native
(:mod:`shadowbench.device.depth_encodings_kernels`), so that this runs on the CPU only.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from shadowbench.device.depth_encodings_kernels import (
    write_basis,
    write_basis_in_bytes,
    write_exponentials,
    write_moments,
)
from shadowbench.device.launch import Context, launch

_SLOPE_SHARE = 0.25
"""A texel a standard deviation of half its side wide, seen on a plane: what GPU Gems 3, chapter 8, adds to M2."""


def encode_exponentials(depth: wp.array[Any], target: wp.array[Any], steepness: float, context: Context) -> None:
    """Write e^(c z) of each depth z; c is ``steepness``, at most 87; ``target`` has one channel of float32."""
    _encode(write_exponentials, depth, target, [steepness, depth.shape[2]], context)


def encode_moments(depth: wp.array[Any], target: wp.array[Any], context: Context, *, has_slopes: bool) -> None:
    """Write (z, z²) of each depth z.

    Args:
        depth: float32, shape [face, row, column].
        target: Two channels of float32.
        context: Where to run.
        has_slopes: Add ¼ (z_x² + z_y²) to z², z_x and z_y being the changes of depth to the next texels: the second
            moment of a plane within a texel. Of the changes to both sides the gentler counts, on a plane its slope
            and at a silhouette that of the surface.
    """
    share = _SLOPE_SHARE if has_slopes else 0.0
    _encode(write_moments, depth, target, [share, depth.shape[1], depth.shape[2]], context)


def encode_fourier_terms(depth: wp.array[Any], target: wp.array[Any], terms: int, context: Context) -> None:
    """Write sin(c_k z) of all terms k = 1 … M, then cos(c_k z), with c_k = π (2k - 1).

    ``target`` has 2M channels, of float32 (the values themselves, within 1e-5) or of 8 bits (a half plus half the
    value, in 255ths, rounded).
    """
    kernel = write_basis_in_bytes if target.dtype == wp.uint8 else write_basis
    _encode(kernel, depth, target, [terms, depth.shape[2]], context)


def _encode(
    kernel: wp.Kernel, depth: wp.array[Any], target: wp.array[Any], arguments: list[Any], context: Context
) -> None:
    launch(
        kernel,
        depth.shape[0] * depth.shape[1],
        inputs=[depth.flatten(), *arguments],
        outputs=[target.flatten()],
        context=context,
    )
