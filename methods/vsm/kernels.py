"""Chebyshev's bound on the visibility, from means of the first two moments."""

import warp as wp

from shadowbench.device.filtered_lookup import (
    Corners,
    PixelPoints,
    Sampling,
    find_footprint,
    find_pixel,
    interpolate,
    mean_over_footprint,
    texels_read,
)
from shadowbench.device.launch import kernel_options
from shadowbench.device.mip_chains_kernels import ChainLayout
from shadowbench.device.shadow_lookup import LightMaps

wp.set_module_options(kernel_options(native=True))


@wp.func
def moments_of(values: wp.array[wp.float32], index: wp.int32):
    return wp.vec2(values[index], values[index + 1])


@wp.func
def moments_at(values: wp.array[wp.float32], corners: Corners, depth: wp.float32):  # noqa: ARG001 - means need no d
    return interpolate(
        corners,
        moments_of(values, corners.top_left),
        moments_of(values, corners.top_right),
        moments_of(values, corners.bottom_left),
        moments_of(values, corners.bottom_right),
    )


mean_moments = mean_over_footprint(moments_at)


@wp.func
def chebyshev_bound(moments: wp.vec2, depth: wp.float32, minimum_variance: wp.float32):
    """Largest share of depths that can be ``depth`` or more, by mean and variance (equation 5)."""
    if depth <= moments[0]:
        return wp.float32(1.0)
    # rounding may leave a negative variance; with none at all nothing lies beyond the mean
    variance = wp.max(moments[1] - moments[0] * moments[0], minimum_variance)
    distance = depth - moments[0]
    if variance <= wp.float32(0.0):
        return wp.float32(0.0)
    return variance / (variance + distance * distance)


@wp.func
def reduce_bleeding(bound: wp.float32, amount: wp.float32):
    """Cut off the tail that lets light through, and stretch the rest over [0, 1] (GPU Gems 3, chapter 8)."""
    return wp.clamp((bound - amount) / (wp.float32(1.0) - amount), wp.float32(0.0), wp.float32(1.0))


@wp.kernel
def look_up_moments(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    points: PixelPoints,
    bias: wp.float64,
    values: wp.array[wp.float32],
    layout: ChainLayout,
    sampling: Sampling,
    minimum_variance: wp.float32,
    bleeding_reduction: wp.float32,
    # outputs
    visibility: wp.array[wp.float32],
    texels: wp.array[wp.int32],
):
    i = wp.tid() + first
    found = find_pixel(maps, points, i)
    texels[i] = 0
    if found.state >= 0:
        visibility[i] = wp.float32(found.state)
    else:
        footprint = find_footprint(maps, found, points, i, layout, sampling)
        depth = wp.float32(found.depth - bias)
        moments = mean_moments(values, layout, found.face, footprint, depth)
        visibility[i] = reduce_bleeding(chebyshev_bound(moments, depth, minimum_variance), bleeding_reduction)
        texels[i] = wp.int32(points.valid[i]) * texels_read(footprint)
