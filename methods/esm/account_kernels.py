"""The exponential test of one receiver, by the functions that look up: for its account only."""

import warp as wp

from shadowbench.device.elementary_functions import exponential
from shadowbench.device.filtered_lookup import (
    PixelPoints,
    Sampling,
    corners_of,
    find_footprint,
    find_pixel,
    maximum_over_footprint,
    mean_over_footprint,
    polygon_offset_at,
)
from shadowbench.device.launch import kernel_options
from shadowbench.device.mip_chains_kernels import ChainLayout
from shadowbench.device.shadow_lookup import LightMaps
from shadowbench.methods.esm.kernels import linear_test, logarithmic_test, receiver_at, tests_at

wp.set_module_options(kernel_options(native=True))

VALUE_COUNT = 8
"""Written by the kernels: d, e^(-c d), the mean test, the polygon offset, the mean test without it, the four texels'
clamped tests, the farthest depth, and the depth that z-max compares with it."""


def account_kernel(test):
    """Make the kernel that tells all that the three look-up kernels find."""
    unclamped, clamped = tests_at(test)
    mean_test = mean_over_footprint(unclamped)

    @wp.kernel
    def tell_tests(
        first: wp.int32,
        # inputs
        maps: LightMaps,
        points: PixelPoints,
        bias: wp.float64,
        values: wp.array[wp.float32],
        layout: ChainLayout,
        sampling: Sampling,
        steepness: wp.float32,
        slope_bias: wp.float64,
        fallback: wp.array[wp.float32],
        maxima: wp.array[wp.float32],
        offset: wp.float32,
        # outputs
        told: wp.array[wp.float32],
    ):
        i = wp.tid() + first
        found = find_pixel(maps, points, i)
        footprint = find_footprint(maps, found, points, i, layout, sampling)
        receiver = receiver_at(found.depth - bias, steepness)
        result = mean_test(values, layout, found.face, footprint, receiver)
        polygon_offset = wp.float32(polygon_offset_at(maps, found, points.normal[i], slope_bias))
        told[0] = receiver.depth
        told[1] = receiver.falloff
        told[2] = result
        told[3] = polygon_offset
        told[4] = result * exponential(-(steepness * polygon_offset))
        told[5] = clamped(fallback, corners_of(layout, found.face, 0, found.x, found.y), receiver)
        if maxima.shape[0] > 0:
            told[6] = maximum_over_footprint(maxima, layout, found.face, footprint)
            told[7] = receiver.depth + polygon_offset + offset

    return tell_tests


tell_linear = account_kernel(linear_test)
tell_logarithmic = account_kernel(logarithmic_test)
