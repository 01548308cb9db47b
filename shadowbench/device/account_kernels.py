"""Kernels that tell what a look-up into a light's map sees: for accounts of one receiver, never for a frame.

They call the functions that the techniques look up with, and write down what those find.
"""

import warp as wp

from shadowbench.device.filtered_lookup import (
    PixelPoints,
    Sampling,
    corners_of,
    find_footprint,
    find_pixel,
    polygon_offset_at,
)
from shadowbench.device.launch import kernel_options
from shadowbench.device.mip_chains_kernels import ChainLayout
from shadowbench.device.shadow_lookup import LightMaps, MapPoint, depth_at_texel, find_in_map, is_lit_at, stored_depth
from shadowbench.device.visibility import (
    LightPoint,
    crossing,
    crossing_once,
    is_turned_away,
    plane_normal,
    reach_to_light,
    towards_light,
)

wp.set_module_options(kernel_options(native=True))

MOST_LOOKED_UP = 32
"""Taps of a footprint times the two levels of each."""


@wp.kernel
def tell_place(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    normal_offset: wp.float64,
    plane: wp.float64,
    # outputs
    place: wp.array[MapPoint],
):
    """Where receivers are in the map."""
    i = wp.tid() + first
    place[i] = find_in_map(maps, position[i], normal[i], normal_offset, plane)


@wp.kernel
def tell_depth_tests(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    place: wp.array[MapPoint],
    texel: wp.array[wp.vec2i],
    bias: wp.float64,
    # outputs
    compared: wp.array[wp.float64],
    stored: wp.array[wp.float32],
    is_lit: wp.array[wp.float32],
):
    """Depth tests against some texels, of one place, or of as many as there are texels."""
    k = wp.tid() + first
    column = texel[k][0]
    row = texel[k][1]
    found = place[wp.min(k, place.shape[0] - 1)]
    compared[k] = depth_at_texel(found, column, row, bias)
    stored[k] = stored_depth(maps, found.face, column, row)
    is_lit[k] = is_lit_at(maps, found, column, row, bias)


@wp.kernel
def tell_footprint(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    points: PixelPoints,
    layout: ChainLayout,
    sampling: Sampling,
    slope_bias: wp.float64,
    # outputs
    shape: wp.array[wp.float64],
    corners: wp.array2d[wp.int32],
    between: wp.array2d[wp.float32],
):
    """What the look-up of one receiver averages.

    ``shape`` gets the footprint (x, y, step x, step y, taps, level, blend) and the polygon offset at the receiver; a
    line of ``corners`` the level and the four texels of a tap (at its finer level, then at its coarser one), a line of
    ``between`` the place between them.
    """
    i = wp.tid() + first
    found = find_pixel(maps, points, i)
    footprint = find_footprint(maps, found, points, i, layout, sampling)
    shape[0] = footprint.x
    shape[1] = footprint.y
    shape[2] = footprint.step_x
    shape[3] = footprint.step_y
    shape[4] = wp.float64(footprint.taps)
    shape[5] = wp.float64(footprint.level)
    shape[6] = wp.float64(footprint.blend)
    shape[7] = polygon_offset_at(maps, found, points.normal[i], slope_bias)
    for tap in range(footprint.taps):
        x = footprint.x + wp.float64(tap) * footprint.step_x
        y = footprint.y + wp.float64(tap) * footprint.step_y
        for finer in range(2):
            level = wp.min(footprint.level + finer, layout.level_count - 1)
            found_corners = corners_of(layout, found.face, level, x, y)
            line = 2 * tap + finer
            corners[line, 0] = level
            corners[line, 1] = found_corners.top_left
            corners[line, 2] = found_corners.top_right
            corners[line, 3] = found_corners.bottom_left
            corners[line, 4] = found_corners.bottom_right
            between[line, 0] = found_corners.right
            between[line, 1] = found_corners.down


@wp.kernel
def tell_surface_ray(
    first: wp.int32,
    # inputs
    light: LightPoint,
    eye: wp.vec3d,
    own: wp.array[wp.vec3],
    position: wp.array[wp.vec3],
    # outputs
    towards: wp.array[wp.vec3d],
    reach: wp.array[wp.float64],
    turned_away: wp.array[wp.int32],
):
    """The ray from one surface point to the light, and whether its own triangle, ``own``, hides it."""
    i = wp.tid() + first
    p = wp.vec3d(position[i])
    towards[i] = towards_light(light, p)
    reach[i] = reach_to_light(light, p)
    turned_away[i] = wp.where(is_turned_away(own[0], own[1], own[2], eye, light), 1, 0)


@wp.kernel
def tell_crossings(
    first: wp.int32,
    # inputs
    corner: wp.array[wp.vec3],
    origin: wp.vec3d,
    towards: wp.vec3d,
    reach: wp.float64,
    tolerance: wp.float64,
    # outputs
    crossed: wp.array[wp.float64],
    crossed_once: wp.array[wp.float64],
    covers: wp.array[wp.int32],
    height: wp.array[wp.float64],
):
    """Every triangle against one ray: where it is crossed, by both predicates; whether it covers the ray's point in the
    light's window, wherever it lies along the ray; and how far its plane is from the origin.
    """
    k = wp.tid() + first
    a = corner[3 * k]
    b = corner[3 * k + 1]
    c = corner[3 * k + 2]
    crossed[k] = crossing(origin, towards, reach, tolerance, a, b, c)
    crossed_once[k] = crossing_once(origin, towards, reach, tolerance, a, b, c)
    # the same without the plane's test: infinite reach both ways
    zero = wp.float64(0.0)
    to_a = wp.vec3d(a) - origin
    to_b = wp.vec3d(b) - origin
    to_c = wp.vec3d(c) - origin
    u = wp.dot(towards, wp.cross(to_b, to_c))
    v = wp.dot(towards, wp.cross(to_c, to_a))
    w = wp.dot(towards, wp.cross(to_a, to_b))
    covers[k] = 0
    if (u >= zero and v >= zero and w >= zero) or (u <= zero and v <= zero and w <= zero):
        covers[k] = 1
    n = plane_normal(a, b, c)
    height[k] = zero
    length = wp.length(n)
    if length > zero:
        height[k] = wp.dot(n, to_a) / length
