"""Triangles in a window: projection, near clipping, the rows and columns a triangle covers, linear quantities.

Device functions for kernels that rasterise; no kernel lives here. All arithmetic is float64, so that a vertex has one
window position, to the bit, in every triangle that uses it, and crossings of edges are good to 1e-9 texels even where
a triangle reaches far outside the window.

A *window vertex* is ``(x, y, depth / w, 1 / w)`` with x, y in texels: four quantities that are linear in the window.
Conventions of windows and depths are those of :mod:`shadowbench.light_space`.
"""

import warp as wp

from shadowbench.device.launch import kernel_options

wp.set_module_options(kernel_options(native=True))


@wp.struct
class Polygon:
    """What is left of a triangle in front of the near plane: 0, 3 or 4 window vertices, in order."""

    count: wp.int32
    a: wp.vec4d
    b: wp.vec4d
    c: wp.vec4d
    d: wp.vec4d


@wp.struct
class Edges:
    """The edges of a triangle, each from its upper to its lower vertex.

    The *long* edge runs from the top vertex to the bottom vertex, the *upper* one from the top to the middle vertex,
    the *lower* one from the middle to the bottom vertex. A slope is dx/dy. Two triangles that share an edge hold the
    same upper end and the same slope for it: where it crosses a row, they agree to the bit.
    """

    top_x: wp.float64
    top_y: wp.float64
    middle_x: wp.float64
    middle_y: wp.float64
    long_slope: wp.float64
    upper_slope: wp.float64
    lower_slope: wp.float64
    middle_is_left: wp.bool


@wp.struct
class Plane:
    """A quantity that is linear in the window: its value at the top vertex and its change per texel."""

    at_top: wp.float64
    dx: wp.float64
    dy: wp.float64


# --- projection and near clipping


@wp.func
def row_times(m: wp.mat44d, row: wp.int32, p: wp.vec3d):
    """One homogeneous coordinate of a world position."""
    return m[row, 0] * p[0] + m[row, 1] * p[1] + m[row, 2] * p[2] + m[row, 3]


@wp.func
def transform(m: wp.mat44d, position: wp.vec3):
    """Homogeneous window coordinates (x·w, y·w, depth, w) of a world position."""
    p = wp.vec3d(position)
    return wp.vec4d(row_times(m, 0, p), row_times(m, 1, p), row_times(m, 2, p), row_times(m, 3, p))


@wp.func
def transform_orthographic(m: wp.mat44d, position: wp.vec3):
    """The same where w is 1, which makes them a window vertex."""
    p = wp.vec3d(position)
    return wp.vec4d(row_times(m, 0, p), row_times(m, 1, p), row_times(m, 2, p), wp.float64(1.0))


@wp.func
def window_vertex(h: wp.vec4d):
    """The homogeneous point divided by its w."""
    return wp.vec4d(h[0] / h[3], h[1] / h[3], h[2] / h[3], wp.float64(1.0) / h[3])


@wp.func
def near_crossing(outside: wp.vec4d, inside: wp.vec4d, near: wp.float64):
    """Window vertex where an edge meets the near plane.

    Always computed from the outside end, so that the two triangles at an edge get the same bits.
    """
    t = (near - outside[3]) / (inside[3] - outside[3])
    h = outside + t * (inside - outside)
    h[3] = near
    return window_vertex(h)


@wp.func
def clipped_to_corner(inside: wp.vec4d, following: wp.vec4d, last: wp.vec4d, near: wp.float64):
    """What is left of a triangle with one vertex in front of the near plane."""
    polygon = Polygon()
    polygon.count = 3
    polygon.a = window_vertex(inside)
    polygon.b = near_crossing(following, inside, near)
    polygon.c = near_crossing(last, inside, near)
    return polygon


@wp.func
def clipped_off_corner(outside: wp.vec4d, following: wp.vec4d, last: wp.vec4d, near: wp.float64):
    """What is left of a triangle with one vertex behind the near plane."""
    polygon = Polygon()
    polygon.count = 4
    polygon.a = window_vertex(following)
    polygon.b = window_vertex(last)
    polygon.c = near_crossing(outside, last, near)
    polygon.d = near_crossing(outside, following, near)
    return polygon


@wp.func
def clip_near(a: wp.vec4d, b: wp.vec4d, c: wp.vec4d, near: wp.float64):
    """The part of a triangle, given in homogeneous window coordinates, with w > near."""
    polygon = Polygon()
    if a[3] > near and b[3] > near and c[3] > near:
        polygon.count = 3
        polygon.a = window_vertex(a)
        polygon.b = window_vertex(b)
        polygon.c = window_vertex(c)
    elif a[3] > near and b[3] > near:
        polygon = clipped_off_corner(c, a, b, near)
    elif b[3] > near and c[3] > near:
        polygon = clipped_off_corner(a, b, c, near)
    elif c[3] > near and a[3] > near:
        polygon = clipped_off_corner(b, c, a, near)
    elif a[3] > near:
        polygon = clipped_to_corner(a, b, c, near)
    elif b[3] > near:
        polygon = clipped_to_corner(b, c, a, near)
    elif c[3] > near:
        polygon = clipped_to_corner(c, a, b, near)
    return polygon


@wp.func
def visible_polygon(
    vertices: wp.array[wp.vec3],
    triangles: wp.array[wp.int32],
    t: wp.int32,
    window_from_world: wp.mat44d,
    near: wp.float64,
):
    """Triangle ``t`` in the window; clipped by the near plane, unless ``near`` is 0: then the view is orthographic."""
    a = vertices[triangles[3 * t]]
    b = vertices[triangles[3 * t + 1]]
    c = vertices[triangles[3 * t + 2]]
    if near > wp.float64(0.0):
        return clip_near(
            transform(window_from_world, a), transform(window_from_world, b), transform(window_from_world, c), near
        )
    polygon = Polygon()
    polygon.count = 3
    polygon.a = transform_orthographic(window_from_world, a)
    polygon.b = transform_orthographic(window_from_world, b)
    polygon.c = transform_orthographic(window_from_world, c)
    return polygon


# --- coverage


@wp.func
def first_centre(position: wp.float64, size: wp.int32):
    """The first of ``size`` texels whose centre does not come before ``position``; ``size`` if there is none."""
    texel = wp.ceil(position - wp.float64(0.5))
    return wp.int32(wp.clamp(texel, wp.float64(0.0), wp.float64(size)))


@wp.func
def min3(a: wp.float64, b: wp.float64, c: wp.float64):
    return wp.min(a, wp.min(b, c))


@wp.func
def max3(a: wp.float64, b: wp.float64, c: wp.float64):
    return wp.max(a, wp.max(b, c))


@wp.func
def covered_rows(a: wp.vec4d, b: wp.vec4d, c: wp.vec4d, width: wp.int32, height: wp.int32):
    """Rows [first, end) whose centre lines a triangle meets; none if its bounds hold no texel's centre."""
    first_row = first_centre(min3(a[1], b[1], c[1]), height)
    end_row = first_centre(max3(a[1], b[1], c[1]), height)
    if first_row < end_row:
        if first_centre(min3(a[0], b[0], c[0]), width) == first_centre(max3(a[0], b[0], c[0]), width):
            end_row = first_row
    return wp.vec2i(first_row, end_row)


@wp.func
def top_to_bottom(a: wp.vec4d, b: wp.vec4d, c: wp.vec4d):
    """Three vertices in the order of y."""
    top = a
    middle = b
    bottom = c
    if b[1] < a[1]:
        top = b
        middle = a
    if c[1] < middle[1]:
        bottom = middle
        middle = c
        if c[1] < top[1]:
            middle = top
            top = c
    return top, middle, bottom


@wp.func
def doubled_area(top: wp.vec4d, middle: wp.vec4d, bottom: wp.vec4d):
    """Twice the signed area [texels²]; negative if the middle vertex is left of the long edge."""
    return (middle[0] - top[0]) * (bottom[1] - top[1]) - (bottom[0] - top[0]) * (middle[1] - top[1])


@wp.func
def edges_of(top: wp.vec4d, middle: wp.vec4d, bottom: wp.vec4d):
    """Edges of a triangle with an area. The slope of a horizontal edge is never used: no row crosses it."""
    edges = Edges()
    edges.top_x = top[0]
    edges.top_y = top[1]
    edges.middle_x = middle[0]
    edges.middle_y = middle[1]
    edges.long_slope = (bottom[0] - top[0]) / (bottom[1] - top[1])
    edges.upper_slope = (middle[0] - top[0]) / (middle[1] - top[1])
    edges.lower_slope = (bottom[0] - middle[0]) / (bottom[1] - middle[1])
    edges.middle_is_left = doubled_area(top, middle, bottom) < wp.float64(0.0)
    return edges


@wp.func
def covered_columns(edges: Edges, row: wp.int32, width: wp.int32):
    """Columns [first, end) whose centres a triangle covers in one of its rows; none if first >= end.

    Top-left rule: a centre on an edge belongs to the triangle right of the edge, or below it. Adjoining triangles
    round the same crossing to the same column, and so share out a row without a gap and without overlap.
    """
    y = wp.float64(row) + wp.float64(0.5)
    long_x = edges.top_x + (y - edges.top_y) * edges.long_slope
    short_x = edges.middle_x + (y - edges.middle_y) * edges.lower_slope
    if y < edges.middle_y:
        short_x = edges.top_x + (y - edges.top_y) * edges.upper_slope
    left = wp.where(edges.middle_is_left, short_x, long_x)
    right = wp.where(edges.middle_is_left, long_x, short_x)
    return wp.vec2i(first_centre(left, width), first_centre(right, width))


# --- linear quantities


@wp.func
def plane_through(top: wp.vec4d, middle: wp.vec4d, bottom: wp.vec4d, component: wp.int32):
    """The plane through one component of three vertices (Cramer's rule)."""
    scale = wp.float64(1.0) / doubled_area(top, middle, bottom)
    to_middle = middle[component] - top[component]
    to_bottom = bottom[component] - top[component]
    plane = Plane()
    plane.at_top = top[component]
    plane.dx = (to_middle * (bottom[1] - top[1]) - to_bottom * (middle[1] - top[1])) * scale
    plane.dy = (to_bottom * (middle[0] - top[0]) - to_middle * (bottom[0] - top[0])) * scale
    return plane


@wp.func
def plane_at(plane: Plane, edges: Edges, column: wp.int32, row: wp.int32):
    """Value of a plane at a texel's centre."""
    x = wp.float64(column) + wp.float64(0.5) - edges.top_x
    y = wp.float64(row) + wp.float64(0.5) - edges.top_y
    return plane.at_top + plane.dx * x + plane.dy * y
