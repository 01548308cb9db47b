"""Weighted means of depth tests."""

import warp as wp

from shadowbench.device.filtered_lookup import MOST_TEXELS, PixelPoints
from shadowbench.device.launch import kernel_options
from shadowbench.device.shadow_lookup import (
    STEEPEST_OFFSET,
    LightMaps,
    MapPoint,
    find_in_map,
    is_lit_at,
    motion_in_map,
    texel_index,
)

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


@wp.func
def side_of_pixel(maps: LightMaps, found: MapPoint, motion: wp.vec3, axis: wp.vec3d):
    """Change of (x, y, depth) over a pixel along one of its axes, at least a texel long.

    A side of no length or of no bounds is taken for a texel along ``axis``.
    """
    size = wp.float64(maps.depth.shape[2])
    uv = wp.vec2d(found.x / size, found.y / size)
    side = motion_in_map(maps.projection[found.face], uv, found.w, wp.vec3d(motion), size)
    length = wp.length(wp.vec2d(side[0], side[1]))
    if not (length > wp.float64(0.0) and length < MOST_TEXELS):
        return axis
    one = wp.float64(1.0)
    scale = wp.max(one / length, one)
    # a plane seen edge-on from the light has no bounded slope
    steepest = STEEPEST_OFFSET * length * scale
    return wp.vec3d(side[0] * scale, side[1] * scale, wp.clamp(side[2] * scale, -steepest, steepest))


@wp.func
def point_beside(found: MapPoint, offset: wp.vec3d):
    """A point at (x [texels], y [texels], depth) from the receiver."""
    point = MapPoint()
    point.face = found.face
    point.x = found.x + offset[0]
    point.y = found.y + offset[1]
    point.depth = found.depth + offset[2]
    point.slope_x = found.slope_x
    point.slope_y = found.slope_y
    return point


@wp.func
def is_point_lit(maps: LightMaps, found: MapPoint, offset: wp.vec3d, bias: wp.float64):
    """The depth test of a point beside the receiver, against the texel that holds it."""
    point = point_beside(found, offset)
    return is_lit_at(maps, point, texel_index(point.x), texel_index(point.y), bias)


@wp.func
def mean_over_pixel(
    maps: LightMaps, found: MapPoint, weights: wp.array[wp.float32], across: wp.vec3d, down: wp.vec3d, bias: wp.float64
):
    """Mean of the tests in the middles of K x K equal parts of the pixel."""
    width = weights.shape[0]
    half = wp.float64(0.5)
    mean = wp.float32(0.0)
    for j in range(width):
        t = (wp.float64(j) + half) / wp.float64(width) - half
        along = wp.float32(0.0)
        for i in range(width):
            s = (wp.float64(i) + half) / wp.float64(width) - half
            along += weights[i] * is_point_lit(maps, found, s * across + t * down, bias)
        mean += weights[j] * along
    return wp.clamp(mean, 0.0, 1.0)


@wp.kernel
def filter_weighted(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    points: PixelPoints,
    bias: wp.float64,
    normal_offset: wp.float64,
    plane: wp.float64,
    weights: wp.array[wp.float32],
    # outputs
    visibility: wp.array[wp.float32],
):
    i = wp.tid() + first
    found = find_in_map(maps, points.position[i], points.normal[i], normal_offset, plane)
    if found.state >= 0:
        visibility[i] = wp.float32(found.state)
    else:
        visibility[i] = weighted_mean(maps, found, weights, bias)


@wp.kernel
def filter_over_pixel(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    points: PixelPoints,
    bias: wp.float64,
    normal_offset: wp.float64,
    plane: wp.float64,
    weights: wp.array[wp.float32],
    # outputs
    visibility: wp.array[wp.float32],
):
    i = wp.tid() + first
    found = find_in_map(maps, points.position[i], points.normal[i], normal_offset, plane)
    if found.state >= 0:
        visibility[i] = wp.float32(found.state)
    else:
        one = wp.float64(1.0)
        zero = wp.float64(0.0)
        across = side_of_pixel(maps, found, points.position_dx[i], wp.vec3d(one, zero, zero))
        down = side_of_pixel(maps, found, points.position_dy[i], wp.vec3d(zero, one, zero))
        visibility[i] = mean_over_pixel(maps, found, weights, across, down, bias)


@wp.kernel
def filter_bilinear(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    points: PixelPoints,
    bias: wp.float64,
    normal_offset: wp.float64,
    plane: wp.float64,
    # outputs
    visibility: wp.array[wp.float32],
):
    i = wp.tid() + first
    found = find_in_map(maps, points.position[i], points.normal[i], normal_offset, plane)
    if found.state >= 0:
        visibility[i] = wp.float32(found.state)
    else:
        visibility[i] = bilinear_mean(maps, found, bias)
