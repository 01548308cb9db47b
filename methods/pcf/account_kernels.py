"""The taps of one receiver's footprint, by the functions that filter: for its account only."""

import warp as wp

from shadowbench.device.filtered_lookup import PixelPoints
from shadowbench.device.launch import kernel_options
from shadowbench.device.shadow_lookup import LightMaps, MapPoint, find_in_map, texel_index
from shadowbench.methods.pcf.kernels import (
    bilinear_mean,
    first_tap,
    mean_over_pixel,
    point_beside,
    side_of_pixel,
    weighted_mean,
)

wp.set_module_options(kernel_options(native=True))


@wp.kernel
def tell_taps_in_map(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    points: PixelPoints,
    bias: wp.float64,
    normal_offset: wp.float64,
    plane: wp.float64,
    weights: wp.array[wp.float32],
    # outputs
    place: wp.array[MapPoint],
    texel: wp.array[wp.vec2i],
    mean: wp.array[wp.float32],
):
    """Texels of a footprint in the map, row by row, and the means that both filters make of it."""
    i = wp.tid() + first
    found = find_in_map(maps, points.position[i], points.normal[i], normal_offset, plane)
    width = weights.shape[0]
    column = first_tap(found.x, width)
    row = first_tap(found.y, width)
    for j in range(width):
        for k in range(width):
            texel[j * width + k] = wp.vec2i(column + k, row + j)
            place[j * width + k] = found
    mean[0] = weighted_mean(maps, found, weights, bias)
    mean[1] = bilinear_mean(maps, found, bias)


@wp.kernel
def tell_taps_over_pixel(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    points: PixelPoints,
    bias: wp.float64,
    normal_offset: wp.float64,
    plane: wp.float64,
    weights: wp.array[wp.float32],
    # outputs
    place: wp.array[MapPoint],
    texel: wp.array[wp.vec2i],
    mean: wp.array[wp.float32],
):
    """Points of a footprint over the pixel, row by row, and its mean."""
    i = wp.tid() + first
    found = find_in_map(maps, points.position[i], points.normal[i], normal_offset, plane)
    one = wp.float64(1.0)
    zero = wp.float64(0.0)
    half = wp.float64(0.5)
    across = side_of_pixel(maps, found, points.position_dx[i], wp.vec3d(one, zero, zero))
    down = side_of_pixel(maps, found, points.position_dy[i], wp.vec3d(zero, one, zero))
    width = weights.shape[0]
    for j in range(width):
        t = (wp.float64(j) + half) / wp.float64(width) - half
        for k in range(width):
            s = (wp.float64(k) + half) / wp.float64(width) - half
            point = point_beside(found, s * across + t * down)
            place[j * width + k] = point
            texel[j * width + k] = wp.vec2i(texel_index(point.x), texel_index(point.y))
    mean[0] = mean_over_pixel(maps, found, weights, across, down, bias)
