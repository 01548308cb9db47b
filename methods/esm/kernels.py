"""Exponential shadow tests over footprints, with and without the classification of failures."""

import warp as wp

from shadowbench.device.elementary_functions import exponential
from shadowbench.device.filtered_lookup import (
    Corners,
    PixelPoints,
    Sampling,
    corners_of,
    find_footprint,
    find_pixel,
    interpolate,
    maximum_over_footprint,
    mean_over_footprint,
    polygon_offset_at,
    texels_read,
)
from shadowbench.device.launch import kernel_options
from shadowbench.device.mip_chains_kernels import ChainLayout
from shadowbench.device.shadow_lookup import LightMaps

wp.set_module_options(kernel_options(native=True))


@wp.struct
class Receiver:
    """A receiver's side of the test.

    Attributes:
        steepness: c.
        depth: d, less the bias, in [0, 1].
        falloff: e^(-c d).
    """

    steepness: wp.float32
    depth: wp.float32
    falloff: wp.float32


@wp.func
def receiver_at(depth: wp.float64, steepness: wp.float32):
    """Prepare a receiver for its tests."""
    receiver = Receiver()
    receiver.steepness = steepness
    receiver.depth = wp.float32(wp.clamp(depth, wp.float64(0.0), wp.float64(1.0)))
    receiver.falloff = exponential(-(steepness * receiver.depth))
    return receiver


@wp.func
def linear_test(values: wp.array[wp.float32], index: wp.int32, receiver: Receiver):
    """e^(-c d) e^(c z), where e^(c z) is stored (equation 3)."""
    return receiver.falloff * values[index]


@wp.func
def logarithmic_test(values: wp.array[wp.float32], index: wp.int32, receiver: Receiver):
    """e^(c (z - d)), where z is stored."""
    return exponential(receiver.steepness * (values[index] - receiver.depth))


def tests_at(test):
    """Make the bilinear means of the four tests around a tap, as they are and each clamped to 1."""

    @wp.func
    def unclamped(values: wp.array[wp.float32], corners: Corners, receiver: Receiver):
        return interpolate(
            corners,
            test(values, corners.top_left, receiver),
            test(values, corners.top_right, receiver),
            test(values, corners.bottom_left, receiver),
            test(values, corners.bottom_right, receiver),
        )

    @wp.func
    def clamped(values: wp.array[wp.float32], corners: Corners, receiver: Receiver):
        one = wp.float32(1.0)
        return interpolate(
            corners,
            wp.min(test(values, corners.top_left, receiver), one),
            wp.min(test(values, corners.top_right, receiver), one),
            wp.min(test(values, corners.bottom_left, receiver), one),
            wp.min(test(values, corners.bottom_right, receiver), one),
        )

    return unclamped, clamped


def unclassified_kernel(test):
    """Make the kernel that clamps every look-up."""
    unclamped, _ = tests_at(test)
    mean_test = mean_over_footprint(unclamped)

    @wp.kernel
    def look_up(
        first: wp.int32,
        # inputs
        maps: LightMaps,
        points: PixelPoints,
        bias: wp.float64,
        values: wp.array[wp.float32],
        layout: ChainLayout,
        sampling: Sampling,
        steepness: wp.float32,
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
            receiver = receiver_at(found.depth - bias, steepness)
            visibility[i] = wp.min(mean_test(values, layout, found.face, footprint, receiver), wp.float32(1.0))
            texels[i] = wp.int32(points.valid[i]) * texels_read(footprint)

    return look_up


def threshold_kernel(test):
    """Make the kernel that calls a look-up over 1 + epsilon a failure, and falls back."""
    unclamped, clamped = tests_at(test)
    mean_test = mean_over_footprint(unclamped)

    @wp.kernel
    def look_up_by_threshold(
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
        greatest: wp.float32,
        # outputs
        visibility: wp.array[wp.float32],
        texels: wp.array[wp.int32],
        classified: wp.array[wp.uint8],
    ):
        i = wp.tid() + first
        found = find_pixel(maps, points, i)
        texels[i] = 0
        classified[i] = wp.uint8(0)
        if found.state >= 0:
            visibility[i] = wp.float32(found.state)
        else:
            footprint = find_footprint(maps, found, points, i, layout, sampling)
            receiver = receiver_at(found.depth - bias, steepness)
            result = mean_test(values, layout, found.face, footprint, receiver)
            read = texels_read(footprint)
            polygon_offset = wp.float32(polygon_offset_at(maps, found, points.normal[i], slope_bias))
            if result * exponential(-(steepness * polygon_offset)) > greatest:
                result = clamped(fallback, corners_of(layout, found.face, 0, found.x, found.y), receiver)
                read += 4
                classified[i] = points.valid[i]
            visibility[i] = wp.min(result, wp.float32(1.0))
            texels[i] = wp.int32(points.valid[i]) * read

    return look_up_by_threshold


def z_max_kernel(test):
    """Make the kernel that calls a receiver nearer than the farthest texel of its footprint a failure."""
    unclamped, clamped = tests_at(test)
    mean_test = mean_over_footprint(unclamped)

    @wp.kernel
    def look_up_by_z_max(
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
        visibility: wp.array[wp.float32],
        texels: wp.array[wp.int32],
        classified: wp.array[wp.uint8],
    ):
        i = wp.tid() + first
        found = find_pixel(maps, points, i)
        texels[i] = 0
        classified[i] = wp.uint8(0)
        if found.state >= 0:
            visibility[i] = wp.float32(found.state)
        else:
            footprint = find_footprint(maps, found, points, i, layout, sampling)
            receiver = receiver_at(found.depth - bias, steepness)
            result = wp.float32(0.0)
            read = 4 * footprint.taps
            polygon_offset = wp.float32(polygon_offset_at(maps, found, points.normal[i], slope_bias))
            if receiver.depth + polygon_offset + offset < maximum_over_footprint(maxima, layout, found.face, footprint):
                result = clamped(fallback, corners_of(layout, found.face, 0, found.x, found.y), receiver)
                read += 4
                classified[i] = points.valid[i]
            else:
                result = mean_test(values, layout, found.face, footprint, receiver)
                read += texels_read(footprint)
            visibility[i] = wp.min(result, wp.float32(1.0))
            texels[i] = wp.int32(points.valid[i]) * read

    return look_up_by_z_max


look_up_linear = unclassified_kernel(linear_test)
look_up_linear_by_threshold = threshold_kernel(linear_test)
look_up_linear_by_z_max = z_max_kernel(linear_test)
look_up_logarithmic = unclassified_kernel(logarithmic_test)
look_up_logarithmic_by_threshold = threshold_kernel(logarithmic_test)
look_up_logarithmic_by_z_max = z_max_kernel(logarithmic_test)
