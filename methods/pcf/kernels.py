"""Weighted means of depth tests."""

import warp as wp

from shadowbench.device.launch import kernel_options
from shadowbench.device.shadow_lookup import LightMaps, MapPoint, find_in_map, is_lit_at, texel_index

wp.set_module_options(kernel_options(native=True))


@wp.func
def first_tap(coordinate: wp.float64, width: wp.int32):
    """First texel of a footprint along one axis: centred on the holding texel (odd) or the nearest corner (even)."""
    if width % 2 == 1:
        return texel_index(coordinate) - width // 2
    return texel_index(coordinate + wp.float64(0.5)) - width // 2


@wp.func
def weighted_mean(maps: LightMaps, found: MapPoint, weights: wp.array[wp.float32], bias: wp.float64):
    width = weights.shape[0]
    column = first_tap(found.x, width)
    row = first_tap(found.y, width)
    mean = wp.float32(0.0)
    for j in range(width):
        along = wp.float32(0.0)
        for i in range(width):
            along += weights[i] * is_lit_at(maps, found, column + i, row + j, bias)
        mean += weights[j] * along
    return wp.clamp(mean, 0.0, 1.0)  # the weights sum to 1 but for rounding


@wp.func
def bilinear_mean(maps: LightMaps, found: MapPoint, bias: wp.float64):
    """The four tests around the receiver, weighted by its place between the texels' centres."""
    column = first_tap(found.x, 2)
    row = first_tap(found.y, 2)
    right = wp.float32(found.x - wp.float64(0.5) - wp.float64(column))
    down = wp.float32(found.y - wp.float64(0.5) - wp.float64(row))
    top = wp.lerp(is_lit_at(maps, found, column, row, bias), is_lit_at(maps, found, column + 1, row, bias), right)
    bottom = wp.lerp(
        is_lit_at(maps, found, column, row + 1, bias), is_lit_at(maps, found, column + 1, row + 1, bias), right
    )
    return wp.clamp(wp.lerp(top, bottom, down), 0.0, 1.0)


@wp.kernel
def filter_weighted(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    bias: wp.float64,
    normal_offset: wp.float64,
    plane: wp.float64,
    weights: wp.array[wp.float32],
    # outputs
    visibility: wp.array[wp.float32],
):
    i = wp.tid() + first
    found = find_in_map(maps, position[i], normal[i], normal_offset, plane)
    if found.state >= 0:
        visibility[i] = wp.float32(found.state)
    else:
        visibility[i] = weighted_mean(maps, found, weights, bias)


@wp.kernel
def filter_bilinear(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    bias: wp.float64,
    normal_offset: wp.float64,
    plane: wp.float64,
    # outputs
    visibility: wp.array[wp.float32],
):
    i = wp.tid() + first
    found = find_in_map(maps, position[i], normal[i], normal_offset, plane)
    if found.state >= 0:
        visibility[i] = wp.float32(found.state)
    else:
        visibility[i] = bilinear_mean(maps, found, bias)
