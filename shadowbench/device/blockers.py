"""Triangles as the float32 filter of the irregular rasterisers sees them, and the bounds that make it safe.

A :class:`Blocker` holds linear functions of a sample's coordinates (:mod:`shadowbench.device.sample_space`) with what
their rounding can move them by. :func:`blocker_of` says what it is, one triangle at a time;
:mod:`shadowbench.device.blocker_batches` makes several at once. No kernel lives here.

All coefficients are computed in float64 in homogeneous window coordinates (x w, y w, depth, w), where the edge function
of corners a and b is (a x b) . (x, y, 1) whatever the signs of w: a triangle that crosses the light's plane needs no
clipping (Olano & Greer 1997, "Triangle scan conversion using 2D homogeneous coordinates"). Only its window bounds do,
and are then the whole window.
"""

import warp as wp

from shadowbench.device.launch import kernel_options
from shadowbench.device.sample_space import FARTHEST, ROUNDING, SampleSpace, window_point

wp.set_module_options(kernel_options(native=True))

EDGE_BAND = wp.constant(wp.float32(16.0 * ROUNDING))
"""An edge function's float32 value is within this of the exact one.

With the coefficients' sizes summing to 1 and |x|, |y| <= 1: five roundings in the sample's coordinates (one under a
perspective frame), one each in the coefficients and products, and two sums: 9 in all."""

PLANE_BAND = wp.constant(wp.float64(14.0 * ROUNDING))
"""The same for the plane's function, relative to the sum of its terms' sizes: 5 + 2 + 3 roundings, and one to spare for
the coefficients that carry the bound."""

BOUNDS_MARGIN = wp.constant(wp.float64(16.0 * ROUNDING))
"""Window bounds grow by this: roundings of the sample and of the bounds."""

DEGENERATE = wp.constant(wp.float64(2.0**-22))
"""A triangle thinner than this in the window [window half widths] has no certain orientation, an edge shorter than
this no certain direction: every sample near it is doubtful. Above it, float64 errors are below 2^-30."""

NEEDLE = wp.constant(wp.float64(2.0**-52))
"""Least squared sine of the angle at a triangle's first corner for its plane to be certain."""

WINDOW_SLACK = wp.constant(wp.float64(1.0 + 2.0**-12))
"""A sample at the window's border may round to just outside."""


@wp.struct
class Box:
    """Bounds of a triangle.

    Attributes:
        low, high: Window bounds of (x, y).
        nearest: No sample nearer than this depth is shadowed.
    """

    low: wp.vec2
    high: wp.vec2
    nearest: wp.float32


@wp.struct
class Blocker:
    """A triangle as the float32 filter sees it: linear functions of a sample's (x, y, depth).

    Attributes:
        edge_a, edge_b, edge_c: Edge functions (x, y, 1), positive inside, coefficients' sizes summing to 1.
        plane: Coefficients of x and y in the plane's function, positive where the sample is behind the plane by more
            than the tolerance.
        plane_maybe, plane_surely: Coefficients of (depth, 1), raised and lowered by the rounding's bound: below 0, the
            first says surely not behind; above 0, the second says surely behind.
        plane_before: Coefficients of (depth, 1): below 0, the sample is nearer to the light than the plane by more than
            the tolerance; so it is neither behind the triangle nor on it.
        box: Bounds.
    """

    edge_a: wp.vec3
    edge_b: wp.vec3
    edge_c: wp.vec3
    plane: wp.vec2
    plane_maybe: wp.vec2
    plane_surely: wp.vec2
    plane_before: wp.vec2
    box: Box


@wp.func
def edge_function(a: wp.vec4d, b: wp.vec4d):
    """Coefficients of (x, y, 1) in the function that vanishes on the line through two window points."""
    return wp.vec3d(a[1] * b[3] - a[3] * b[1], a[3] * b[0] - a[0] * b[3], a[0] * b[1] - a[1] * b[0])


@wp.func
def size_of(e: wp.vec3d):
    return wp.abs(e[0]) + wp.abs(e[1]) + wp.abs(e[2])


@wp.func
def window_size(h: wp.vec4d):
    return wp.abs(h[0]) + wp.abs(h[1]) + wp.abs(h[3])


@wp.func
def inverse_or_zero(size: wp.float64, least: wp.float64):
    """1/size, or 0 for an edge too short to have a direction, which makes it doubtful everywhere."""
    if size > least:
        return wp.float64(1.0) / size
    return wp.float64(0.0)


@wp.func
def min3(a: wp.float64, b: wp.float64, c: wp.float64):
    return wp.min(a, wp.min(b, c))


@wp.func
def max3(a: wp.float64, b: wp.float64, c: wp.float64):
    return wp.max(a, wp.max(b, c))


@wp.func
def is_outside_window(a: wp.vec4d, b: wp.vec4d, c: wp.vec4d):
    """Whether the triangle lies behind the light or wholly on the far side of one of the window's four borders."""
    s = WINDOW_SLACK
    zero = wp.float64(0.0)
    outside = max3(a[3], b[3], c[3]) < zero
    outside = outside or min3(a[0] - s * a[3], b[0] - s * b[3], c[0] - s * c[3]) > zero
    outside = outside or max3(a[0] + s * a[3], b[0] + s * b[3], c[0] + s * c[3]) < zero
    outside = outside or min3(a[1] - s * a[3], b[1] - s * b[3], c[1] - s * c[3]) > zero
    return outside or max3(a[1] + s * a[3], b[1] + s * b[3], c[1] + s * c[3]) < zero


@wp.func
def box_of(space: SampleSpace, a: wp.vec4d, b: wp.vec4d, c: wp.vec4d):
    """Bound a triangle; in the whole window, and from the light on, if it reaches the light's plane."""
    one = wp.float64(1.0)
    box = Box()
    if space.is_perspective == wp.float64(0.0):
        box.low = rounded_down(min3(a[0], b[0], c[0]), min3(a[1], b[1], c[1]))
        box.high = rounded_up(max3(a[0], b[0], c[0]), max3(a[1], b[1], c[1]))
        box.nearest = wp.float32(min3(a[2], b[2], c[2]) - BOUNDS_MARGIN)
    elif min3(a[3], b[3], c[3]) * space.farthest_inverse <= DEGENERATE:
        box.low = wp.vec2(-2.0, -2.0)
        box.high = wp.vec2(2.0, 2.0)
        box.nearest = -FARTHEST / 2.0
    else:
        qa = one / a[3]
        qb = one / b[3]
        qc = one / c[3]
        box.low = rounded_down(min3(a[0] * qa, b[0] * qb, c[0] * qc), min3(a[1] * qa, b[1] * qb, c[1] * qc))
        box.high = rounded_up(max3(a[0] * qa, b[0] * qb, c[0] * qc), max3(a[1] * qa, b[1] * qb, c[1] * qc))
        q = max3(qa, qb, qc)
        box.nearest = wp.float32(space.farthest_inverse - q - BOUNDS_MARGIN * (q + space.farthest_inverse))
    return box


@wp.func
def rounded_down(x: wp.float64, y: wp.float64):
    return wp.vec2(wp.float32(x - BOUNDS_MARGIN), wp.float32(y - BOUNDS_MARGIN))


@wp.func
def rounded_up(x: wp.float64, y: wp.float64):
    return wp.vec2(wp.float32(x + BOUNDS_MARGIN), wp.float32(y + BOUNDS_MARGIN))


@wp.func
def meets_window(space: SampleSpace, box: Box, a: wp.vec4d, b: wp.vec4d, c: wp.vec4d):
    """Whether a triangle, given its box, may reach the window."""
    meets = box.low[0] <= 1.0 and box.low[1] <= 1.0 and box.high[0] >= -1.0 and box.high[1] >= -1.0
    if meets and space.is_perspective != wp.float64(0.0):
        meets = not is_outside_window(a, b, c)
    return meets


@wp.func
def thickness(a: wp.vec4d, b: wp.vec4d, c: wp.vec4d):
    """How far a thin triangle reaches from its longest edge; unlimited if it reaches far out of the window."""
    w = wp.float64(8.0)
    beyond = max3(window_size(a) - w * a[3], window_size(b) - w * b[3], window_size(c) - w * c[3])
    return wp.where(beyond > wp.float64(0.0), wp.float64(4.0), wp.float64(16.0) * DEGENERATE)


@wp.func
def outlined(blocker: Blocker, ha: wp.vec4d, hb: wp.vec4d, hc: wp.vec4d):
    """Set the edge functions of a triangle given by its window points; returns also whether it is thin."""
    ea = edge_function(hb, hc)
    eb = edge_function(hc, ha)
    ec = edge_function(ha, hb)
    size_a = window_size(ha)
    size_b = window_size(hb)
    size_c = window_size(hc)
    least_a = DEGENERATE * (size_b * size_c)
    least_b = DEGENERATE * (size_c * size_a)
    least_c = DEGENERATE * (size_a * size_b)
    la = size_of(ea)
    lb = size_of(eb)
    lc = size_of(ec)
    volume = ha[0] * ea[0] + ha[1] * ea[1] + ha[3] * ea[2]  # its sign is the triangle's orientation in the window
    is_thin = wp.abs(volume) <= DEGENERATE * max3(la * size_a, lb * size_b, lc * size_c)
    is_thin = is_thin or max3(la - least_a, lb - least_b, lc - least_c) <= wp.float64(0.0)
    if is_thin:
        # Orientation uncertain: what may be covered lies along the longest edge, and nothing is certain there.
        along = ea * inverse_or_zero(la, least_a)
        if lb > la and lb >= lc:
            along = eb * inverse_or_zero(lb, least_b)
        elif lc > la:
            along = ec * inverse_or_zero(lc, least_c)
        beside = wp.vec3d(wp.float64(0.0), wp.float64(0.0), thickness(ha, hb, hc))
        blocker.edge_a = wp.vec3(beside + along)
        blocker.edge_b = wp.vec3(beside - along)
    else:
        sign = wp.sign(volume)
        blocker.edge_a = wp.vec3(ea * (sign * inverse_or_zero(la, least_a)))
        blocker.edge_b = wp.vec3(eb * (sign * inverse_or_zero(lb, least_b)))
        blocker.edge_c = wp.vec3(ec * (sign * inverse_or_zero(lc, least_c)))
    return blocker, is_thin


@wp.func
def with_plane(blocker: Blocker, space: SampleSpace, a: wp.vec3, b: wp.vec3, c: wp.vec3, is_doubtful: wp.bool):
    """Set the plane's function: by how much a sample is behind it, less the tolerance."""
    zero = wp.float64(0.0)
    two = wp.float64(2.0)
    origin = wp.vec3d(a)
    ab = wp.vec3d(b) - origin
    ac = wp.vec3d(c) - origin
    n = wp.cross(ab, ac)
    squared = wp.dot(n, n)
    offset = -wp.dot(n, origin)
    light = space.light.point
    side = n[0] * light[0] + n[1] * light[1] + n[2] * light[2] + offset * light[3]
    blocker.plane_maybe = wp.vec2(0.0, 1.0)
    blocker.plane_surely = wp.vec2(0.0, -1.0)
    blocker.plane_before = wp.vec2(0.0, 1.0)
    # float64 knows the normal's direction unless the triangle is a needle of 1 : 2^26
    if is_doubtful or side == zero or squared <= NEEDLE * wp.dot(ab, ab) * wp.dot(ac, ac):
        return blocker  # all is left to the exact predicate
    # of unit length, or the products of three lengths that follow would leave float32's range in a scene of any size
    inverse = wp.float64(1.0) / wp.sqrt(squared)
    if side > zero:  # a sample behind the plane is on the side away from the light
        inverse = -inverse
    n = n * inverse
    offset = offset * inverse
    p = space.plane_from_world * wp.vec4d(n[0], n[1], n[2], offset)
    # the tolerance is a distance too: divided by w under a perspective frame, where 1/w = 1/far - depth
    shift = space.tolerance
    one_inverse = wp.float64(1.0)
    p_depth = p[2]
    p_one = p[3] - shift
    scaled = zero
    fixed = PLANE_BAND * (wp.abs(p[0]) + wp.abs(p[1]) + wp.abs(p_one) + wp.abs(p_depth))  # |depth| <= 1
    if space.is_perspective != zero:
        one_inverse = space.farthest_inverse
        p_depth = p[2] + shift
        p_one = p[3] - shift * one_inverse
        scaled = PLANE_BAND * wp.abs(p_depth)  # relative to depth, which is at most 0
        fixed = PLANE_BAND * (wp.abs(p[0]) + wp.abs(p[1]) + wp.abs(p_one))
    blocker.plane = wp.vec2(wp.float32(p[0]), wp.float32(p[1]))
    blocker.plane_maybe = wp.vec2(wp.float32(p_depth - scaled), wp.float32(p_one + fixed))
    blocker.plane_surely = wp.vec2(wp.float32(p_depth + scaled), wp.float32(p_one - fixed))
    before_depth = wp.float32(p_depth - two * space.is_perspective * shift)
    blocker.plane_before = wp.vec2(before_depth, wp.float32(p_one + two * shift * one_inverse))
    return blocker


@wp.func
def blocker_of(space: SampleSpace, a: wp.vec3, b: wp.vec3, c: wp.vec3):
    """Prepare a triangle that is not outside the window for the filter; conservative in both directions."""
    ha = window_point(space, a)
    hb = window_point(space, b)
    hc = window_point(space, c)
    near = space.light.near
    crosses_near = near > wp.float64(0.0) and min3(ha[3], hb[3], hc[3]) <= near * WINDOW_SLACK
    blocker, is_thin = outlined(Blocker(), ha, hb, hc)
    blocker = with_plane(blocker, space, a, b, c, is_thin or crosses_near)
    blocker.box = box_of(space, ha, hb, hc)
    return blocker
