"""Kernels of bounding shadow volumes: their planes in the order of the tests, and their outlines in a picture.

The geometry, in box space, is :mod:`shadowbench.device.bounding_volume_geometry`; the host side, with the definitions,
:mod:`shadowbench.device.bounding_volumes`.
"""

import warp as wp

from shadowbench.device.bounding_volume_geometry import (
    MOST_VOLUME_PLANES,
    Box,
    away_from_light,
    centre_of,
    distance_outside,
    edge_end,
    edge_sides,
    face_at,
    face_is_front,
    face_plane,
    height_over,
    is_given,
    is_lit,
    is_silhouette,
    light_state,
    side_is_front,
    volume_plane,
    world_plane,
)
from shadowbench.device.launch import kernel_options

wp.set_module_options({**kernel_options(native=True), "max_unroll": 1})

MOST_LINES = wp.constant(24)
"""More than the edges that a volume's outline can have, which passes each of its vertices once."""

MOST_EDGES = wp.constant(32)
"""A volume's, where it is drawn: 12 of the box and of its image, and 8 from the one to the other."""

_MOST_CORNERS = wp.constant(32)
"""Of the picture's rectangle after it was cut by every line."""

_LEAST_SINE = wp.constant(wp.float64(1.0e-9))
"""A line through two places that the eye sees closer together than this has no direction to rely on: it is left out,
which makes the outline larger."""


@wp.struct
class Boxes:
    """Boxes by number.

    Attributes:
        low, high: Corners in box space, rounding included; low < high along every axis.
        lit_low, lit_high: Where the lit faces are for receivers, which are behind them or not.
        reach: How far the shadow matters: up to the box's image that is this many times as far from the light again as
            the box (for a direction, moved by so many lengths of it); infinite if no outline is wanted.
        origin: World position of box space's origin.
        box_from_world: Linear part.
        light: Homogeneous, in box space.
    """

    low: wp.array[wp.vec3d]
    high: wp.array[wp.vec3d]
    lit_low: wp.array[wp.vec3d]
    lit_high: wp.array[wp.vec3d]
    reach: wp.array[wp.float64]
    origin: wp.array[wp.vec3d]
    box_from_world: wp.array[wp.mat33d]
    light: wp.array[wp.vec4d]


@wp.struct
class Picture:
    """What rasterises the volumes.

    Attributes:
        eye: Of the camera.
        corner, per_column, per_row: The ray through pixel (column i, row j) has the direction
            ``corner + (i + ½) per_column + (j + ½) per_row``.
        width, height: [pixels].
        reach: A pixel is drawn if the outline comes this near to its centre, along rows and columns [pixels].
        near_miss: An eye this near to a volume is taken for inside [scene units].
        is_unknown: Which pixel sees which place is not known: every volume covers the picture.
    """

    eye: wp.vec3d
    corner: wp.vec3d
    per_column: wp.vec3d
    per_row: wp.vec3d
    width: wp.int32
    height: wp.int32
    reach: wp.float64
    near_miss: wp.float64
    is_unknown: wp.bool


@wp.func
def outline_normal(box: Box, u: wp.vec3d, v: wp.vec3d):
    """Normal of the plane through the eye that holds directions u and v, towards the box; 0 if they are too close."""
    n = wp.cross(u, v)
    if wp.length_sq(n) <= _LEAST_SINE * _LEAST_SINE * wp.length_sq(u) * wp.length_sq(v):
        return wp.vec3d()
    if wp.dot(n, centre_of(box) - box.eye) < wp.float64(0.0):
        n = -n
    return n


@wp.func
def picture_line(picture: Picture, box_from_world: wp.mat33d, n: wp.vec3d):
    """Where a plane through the eye cuts the picture: (a, b, c); pixel (i, j) is to be drawn if a i + b j + c >= 0."""
    a = wp.dot(n, box_from_world * picture.per_column)
    b = wp.dot(n, box_from_world * picture.per_row)
    c = wp.dot(n, box_from_world * picture.corner)
    return wp.vec3d(a, b, c + wp.float64(0.5) * (a + b) + picture.reach * (wp.abs(a) + wp.abs(b)))


@wp.func
def cut_polygon(line: wp.vec3d, corners: wp.array[wp.vec2d], count: wp.int32, scratch: wp.array[wp.vec2d]):
    """Keep the part of a convex polygon where a x + b y + c >= 0; return its number of corners."""
    zero = wp.float64(0.0)
    kept = wp.int32(0)
    for k in range(count):
        p = corners[k]
        q = corners[(k + 1) % count]
        at_p = line[0] * p[0] + line[1] * p[1] + line[2]
        at_q = line[0] * q[0] + line[1] * q[1] + line[2]
        if at_p >= zero:
            scratch[kept] = p
            kept += 1
        if (at_p >= zero) != (at_q >= zero):
            scratch[kept] = p + at_p / (at_p - at_q) * (q - p)
            kept += 1
    for k in range(kept):
        corners[k] = scratch[k]
    return kept


@wp.func
def edge_normal(box: Box, low: wp.vec3d, high: wp.vec3d, lit: wp.bool, edge: wp.vec3i):
    """As :func:`outline_edge`, for an edge of the box, whose lit faces bound the volume, or of its image (unlit ones).

    It lies between two such faces, or between one and the plane of the silhouette edge.
    """
    n = wp.vec3d()
    first = (edge[0] + 1) % 3
    second = (edge[0] + 2) % 3
    first_bounds = is_lit(box, first, edge[1]) == lit
    second_bounds = is_lit(box, second, edge[2]) == lit
    if first_bounds or second_bounds:
        first_is_front = wp.bool(False)
        second_is_front = wp.bool(False)
        if first_bounds:
            first_is_front = face_is_front(box, low, high, first, edge[1])
        else:
            first_is_front = side_is_front(box, edge)
        if second_bounds:
            second_is_front = face_is_front(box, low, high, second, edge[2])
        else:
            second_is_front = side_is_front(box, edge)
        if first_is_front != second_is_front:
            n = outline_normal(box, edge_end(low, high, edge, -1) - box.eye, edge_end(low, high, edge, 1) - box.eye)
    return n


@wp.func
def ray_normal(box: Box, sides: wp.vec3i):
    """As :func:`outline_edge`, for the edge from a vertex to its image: between the planes of two silhouette edges."""
    meeting = wp.int32(0)
    fronts = wp.int32(0)
    for axis in range(3):
        edge = wp.vec3i(axis, sides[(axis + 1) % 3], sides[(axis + 2) % 3])
        if is_silhouette(box, edge):
            meeting += 1
            if side_is_front(box, edge):
                fronts += 1
    n = wp.vec3d()
    if meeting == 2 and fronts == 1:
        p = edge_end(box.low, box.high, wp.vec3i(0, sides[1], sides[2]), sides[0])
        n = outline_normal(box, p - box.eye, away_from_light(box, p))
    return n


@wp.func
def outline_edge(box: Box, number: wp.int32):
    """Normal of the plane through the eye and edge 0 ... 31 of the volume, or 0 if the outline does not run along it.

    The outline runs between a face turned to the eye and one that is not.
    """
    n = wp.vec3d()
    if number < 12:
        n = edge_normal(box, box.low, box.high, True, edge_sides(number))
    elif number < 24:
        n = edge_normal(box, box.far_low, box.far_high, False, edge_sides(number - 12))
    else:
        n = ray_normal(box, wp.vec3i(2 * (number % 2) - 1, 2 * (number // 2 % 2) - 1, 2 * (number // 4 % 2) - 1))
    return n


@wp.func
def is_eye_within(box: Box, box_from_world: wp.mat33d, origin: wp.vec3d, eye: wp.vec3d, near_miss: wp.float64):
    """Whether the eye is in the part of a volume that matters, or as good as in it."""
    is_within = wp.bool(True)
    for number in range(MOST_VOLUME_PLANES + 6):
        plane = wp.vec4d()
        if number < MOST_VOLUME_PLANES:
            plane = volume_plane(box, number)
        else:
            axis = (number - MOST_VOLUME_PLANES) % 3
            side = 1 - 2 * ((number - MOST_VOLUME_PLANES) // 3)
            if not is_lit(box, axis, side):
                plane = face_plane(axis, side, face_at(box.far_low, box.far_high, axis, side))
        if is_given(plane):
            if distance_outside(world_plane(plane, box_from_world, origin), eye) > near_miss:
                is_within = False
    return is_within


@wp.func
def order_planes(
    boxes: Boxes,
    c: wp.int32,
    box: Box,
    covers_all: wp.bool,
    exits_first: wp.bool,
    # outputs
    planes: wp.array2d[wp.vec4d],
):
    """Store a volume's planes; return how many lead, and how many there are.

    The entry test of z-pass is against the planes turned to the eye, all of them: of the points where a ray crosses
    them it enters the volume at the last, which is on the face that a rasteriser would draw there. The exit test is
    against the others; where the eye is inside there are no others.
    """
    leading = wp.int32(0)
    count = wp.int32(0)
    for group in range(2):
        for number in range(MOST_VOLUME_PLANES):
            plane = volume_plane(box, number)
            if is_given(plane):
                is_front = height_over(plane, box.eye) > wp.float64(0.0)
                leads = covers_all or is_front != exits_first
                if leads == (group == 0):
                    if number < 3:
                        inner = wp.where(box.state[number] > 0, boxes.lit_high[c], boxes.lit_low[c])
                        plane = face_plane(number, box.state[number], inner[number])
                    planes[c, count] = world_plane(plane, boxes.box_from_world[c], boxes.origin[c])
                    count += 1
        if group == 0:
            leading = count
    return wp.vec2i(leading, count)


@wp.func
def draw_outline(
    picture: Picture,
    box_from_world: wp.mat33d,
    c: wp.int32,
    box: Box,
    covers_all: wp.bool,
    # outputs
    lines: wp.array2d[wp.vec3d],
    line_counts: wp.array[wp.int32],
    rows: wp.array[wp.vec2i],
    areas: wp.array[wp.float32],
):
    """Store a volume's outline: its lines, and what the picture's rectangle becomes when it is cut by all of them."""
    zero = wp.float64(0.0)
    right = wp.float64(picture.width - 1)
    bottom = wp.float64(picture.height - 1)
    corners = wp.zeros(shape=(_MOST_CORNERS,), dtype=wp.vec2d)
    scratch = wp.zeros(shape=(_MOST_CORNERS,), dtype=wp.vec2d)
    corners[0] = wp.vec2d(zero, zero)
    corners[1] = wp.vec2d(right, zero)
    corners[2] = wp.vec2d(right, bottom)
    corners[3] = wp.vec2d(zero, bottom)
    corner_count = wp.int32(4)
    line_count = wp.int32(0)
    if not covers_all:
        for number in range(MOST_EDGES):
            n = outline_edge(box, number)
            if wp.length_sq(n) > zero and line_count < MOST_LINES and corner_count > 0:
                line = picture_line(picture, box_from_world, n)
                corner_count = cut_polygon(line, corners, corner_count, scratch)
                size = wp.abs(line[0])
                if size > wp.float64(1.0e-12) * wp.abs(line[1]):  # one along the rows says nothing about columns
                    lines[c, line_count] = wp.vec3d(wp.sign(line[0]), line[1] / size, line[2] / size)
                    line_count += 1
    line_counts[c] = line_count

    top = bottom
    end = zero
    area = zero
    for k in range(corner_count):
        p = corners[k]
        q = corners[(k + 1) % corner_count]
        top = wp.min(top, p[1])
        end = wp.max(end, p[1])
        area += wp.float64(0.5) * (p[0] * q[1] - q[0] * p[1])
    drawn = wp.vec2i(0, 0)
    if corner_count > 0:
        drawn = wp.vec2i(wp.int32(wp.floor(top)), wp.int32(wp.ceil(end)) + 1)
    rows[c] = drawn
    # as many more pixels as there are rows, since the polygon runs through the centres of those on its border
    areas[c] = wp.float32(wp.abs(area)) + wp.float32(drawn[1] - drawn[0])


@wp.kernel
def outline_volumes(
    first: wp.int32,
    # inputs
    boxes: Boxes,
    picture: Picture,
    exits_first: wp.bool,
    # outputs
    planes: wp.array2d[wp.vec4d],
    plane_counts: wp.array[wp.vec2i],
    lines: wp.array2d[wp.vec3d],
    line_counts: wp.array[wp.int32],
    rows: wp.array[wp.vec2i],
    areas: wp.array[wp.float32],
):
    """Planes of each box's volume, those that are tested first leading, and its outline in the picture.

    Args:
        boxes: The boxes.
        picture: The picture and its eye.
        exits_first: Lead with the planes turned away from the eye (z-fail) even where the eye is outside.
        planes: Distance outside of each plane, shape [box, MOST_PLANES].
        plane_counts: Of each box, how many planes lead and how many there are.
        lines: (sign, slope, offset): ``sign · column + slope · row + offset >= 0`` within; shape [box, MOST_LINES].
        line_counts: Of each box.
        rows: First and end row of each outline.
        areas: Pixels within each outline, about.
    """
    c = wp.tid() + first
    box_from_world = boxes.box_from_world[c]
    box = Box()
    box.low = boxes.low[c]
    box.high = boxes.high[c]
    box.light = boxes.light[c]
    box.state = light_state(box.low, box.high, box.light)
    box.eye = box_from_world * (picture.eye - boxes.origin[c])

    reach = boxes.reach[c]
    covers_all = picture.is_unknown or not wp.isfinite(reach)
    if not covers_all:
        box.far_low = box.low + reach * away_from_light(box, box.low)
        box.far_high = box.high + reach * away_from_light(box, box.high)
        covers_all = is_eye_within(box, box_from_world, boxes.origin[c], picture.eye, picture.near_miss)
    plane_counts[c] = order_planes(boxes, c, box, covers_all, exits_first, planes)
    draw_outline(picture, box_from_world, c, box, covers_all, lines, line_counts, rows, areas)


@wp.func
def span_of_row(
    lines: wp.array2d[wp.vec3d], line_counts: wp.array[wp.int32], c: wp.int32, row: wp.int32, width: wp.int32
):
    """Columns [first, end) of a volume's outline in a row; none if first >= end."""
    left = wp.float64(0.0)
    right = wp.float64(width - 1)
    y = wp.float64(row)
    for k in range(line_counts[c]):
        line = lines[c, k]
        bound = line[1] * y + line[2]
        if line[0] > wp.float64(0.0):
            left = wp.max(left, -bound)
        else:
            right = wp.min(right, bound)
    span = wp.vec2i(0, 0)
    if left <= right:
        span = wp.vec2i(wp.int32(wp.ceil(left)), wp.int32(wp.floor(right)) + 1)
    return span
