"""Rays through a :class:`shadowbench.device.triangle_tree.TriangleTree`: shadow rays and nearest blockers.

A ray walks the tree with two eight-wide float32 tests written as native bodies, one over the boxes of a node and one
over the triangles of a pack. Both only ever reject: what they let through goes to the exact predicate
(:mod:`shadowbench.device.visibility`), so results are the predicate's, bit for bit, whatever the filters round. The
bound behind the box test is derived in :mod:`shadowbench.device.triangle_tree`, the one behind the triangle test at
:func:`triangles_not_missed`. At the end stand the two kernels that more than one tracer needs: nearest blockers, and
the usual offset rays.
"""

import warp as wp

from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.placed_triangles import PlacedTriangles, corners_of
from shadowbench.device.triangle_tree_kernels import LANE_BITS, LANES, MAX_LEVELS, Tree, load_vector
from shadowbench.device.visibility import (
    LightPoint,
    crossing,
    is_turned_away,
    light_point,
    reach_to_light,
    towards_light,
)
from shadowbench.receivers import Receivers
from shadowbench.scene import Light

wp.set_module_options(kernel_options(native=True))

STEEPEST = wp.constant(wp.float32(1.0e18))
"""A direction component below 1e-18 of the largest is taken as 1e-18, to keep inverses finite: over the whole scene
that moves the ray by less than a billionth of an ulp."""

LIMIT_SLACK = wp.constant(wp.float32(1.000001))
"""Where boxes are cut off at a distance, the distance grows by more than the box test's four roundings."""

SHORT_OF_LIGHT = wp.constant(wp.float64(1.0 - 2.0**-23))
"""Where an offset ray ends that runs up to a light at 1."""

CORNER_MARGIN = wp.constant(wp.float32(16.0 * 2.0**-23))
"""Rounding of a corner's offset from the ray in the triangle test, relative to the scene's largest coordinate."""


@wp.struct
class Ray:
    """A ray, exactly and as the filters see it.

    Attributes:
        origin: A float32 point.
        towards: Direction; its length is the unit of ``reach`` and of every parameter t.
        reach: Crossings at this parameter and beyond do not count.
        tolerance: Planes within this distance of the origin do not count [scene units].
        axis: Of the direction's largest component, along which the filters measure.
        unit: Length of that component.
        inverse: One over the direction scaled by ``unit``; ±1 along ``axis``.
        shear: The other two components of that direction, in the order of the axes, over the component along ``axis``.
    """

    origin: wp.vec3
    towards: wp.vec3d
    reach: wp.float64
    tolerance: wp.float64
    axis: wp.int32
    unit: wp.float64
    inverse: wp.vec3
    shear: wp.vec2


@wp.func
def finite_inverse(x: wp.float64):
    """One over x in float32, or :data:`STEEPEST`."""
    return wp.where(wp.abs(wp.float32(x)) < 1.0 / STEEPEST, STEEPEST, 1.0 / wp.float32(x))


@wp.func
def make_ray(origin: wp.vec3, towards: wp.vec3d, reach: wp.float64, tolerance: wp.float64):
    """Prepare a ray for the filters."""
    ray = Ray()
    ray.origin = origin
    ray.towards = towards
    ray.reach = reach
    ray.tolerance = tolerance
    axis = wp.int32(0)
    if wp.abs(towards[1]) > wp.abs(towards[0]):
        axis = 1
    if wp.abs(towards[2]) > wp.abs(towards[axis]):
        axis = 2
    unit = wp.abs(towards[axis])
    scaled = towards / unit
    ray.axis = axis
    ray.unit = unit
    ray.inverse = wp.vec3(finite_inverse(scaled[0]), finite_inverse(scaled[1]), finite_inverse(scaled[2]))
    along = towards[axis]
    ray.shear = wp.vec2(
        wp.float32(towards[wp.where(axis == 0, 1, 0)] / along), wp.float32(towards[wp.where(axis == 2, 1, 2)] / along)
    )
    return ray


@wp.func_native("""
    typedef float lanes __attribute__((ext_vector_type(8), aligned(4)));
    typedef bool lane_bits __attribute__((ext_vector_type(8)));
    const float* box = bounds.data + (size_t)node * 48;
    // where the ray enters and leaves each slab; which side is which depends on the direction's sign
    const int x = inverse[0] < 0.0f ? 24 : 0, y = inverse[1] < 0.0f ? 24 : 0, z = inverse[2] < 0.0f ? 24 : 0;
    lanes enter_x = (*(const lanes*)(box + x) - origin[0]) * inverse[0];
    lanes enter_y = (*(const lanes*)(box + 8 + y) - origin[1]) * inverse[1];
    lanes enter_z = (*(const lanes*)(box + 16 + z) - origin[2]) * inverse[2];
    lanes leave_x = (*(const lanes*)(box + 24 - x) - origin[0]) * inverse[0];
    lanes leave_y = (*(const lanes*)(box + 32 - y) - origin[1]) * inverse[1];
    lanes leave_z = (*(const lanes*)(box + 40 - z) - origin[2]) * inverse[2];
    lanes enter = enter_x > enter_y ? enter_x : enter_y, leave = leave_x < leave_y ? leave_x : leave_y;
    enter = enter > enter_z ? enter : enter_z, leave = leave < leave_z ? leave : leave_z;
    lane_bits crossed = __builtin_convertvector((enter <= leave) & (leave >= 0.0f) & (enter <= limit), lane_bits);
    unsigned char mask;
    __builtin_memcpy(&mask, &crossed, 1);
    return (uint32_t)mask;
""")
def boxes_crossed(
    bounds: wp.array[wp.float32], node: wp.int32, origin: wp.vec3, inverse: wp.vec3, limit: wp.float32
) -> wp.uint32:
    """Which children's boxes the ray crosses before ``limit``, as a bit a lane."""


@wp.func_native("""
    typedef float lanes __attribute__((ext_vector_type(8), aligned(4)));
    typedef bool lane_bits __attribute__((ext_vector_type(8)));
    const float* corner = corners.data + (size_t)pack * 72;
    const int i = axis == 0 ? 1 : 0, j = axis == 2 ? 1 : 2;
    const float oi = origin[i], oj = origin[j], ok = origin[axis], si = shear[0], sj = shear[1];
    lanes ak = *(const lanes*)(corner + 8 * axis) - ok;
    lanes bk = *(const lanes*)(corner + 24 + 8 * axis) - ok;
    lanes ck = *(const lanes*)(corner + 48 + 8 * axis) - ok;
    lanes ai = *(const lanes*)(corner + 8 * i) - oi - si * ak, aj = *(const lanes*)(corner + 8 * j) - oj - sj * ak;
    lanes bi = *(const lanes*)(corner + 24 + 8 * i) - oi - si * bk;
    lanes bj = *(const lanes*)(corner + 24 + 8 * j) - oj - sj * bk;
    lanes ci = *(const lanes*)(corner + 48 + 8 * i) - oi - si * ck;
    lanes cj = *(const lanes*)(corner + 48 + 8 * j) - oj - sj * ck;
    lanes u = ci * bj - cj * bi, v = ai * cj - aj * ci, w = bi * aj - bj * ai;
    lanes sum = __builtin_elementwise_abs(ai) + __builtin_elementwise_abs(aj) + __builtin_elementwise_abs(bi)
              + __builtin_elementwise_abs(bj) + __builtin_elementwise_abs(ci) + __builtin_elementwise_abs(cj);
    lanes band = margin * (sum + margin);
    lanes least = u < v ? u : v, most = u > v ? u : v;
    least = least < w ? least : w, most = most > w ? most : w;
    lanes foremost = ak * forward, b_ahead = bk * forward, c_ahead = ck * forward;
    foremost = foremost > b_ahead ? foremost : b_ahead, foremost = foremost > c_ahead ? foremost : c_ahead;
    // written so that an absent triangle, all NaN, is not kept
    lane_bits kept = __builtin_convertvector(((least >= -band) | (most <= band)) & (foremost >= -margin), lane_bits);
    unsigned char mask;
    __builtin_memcpy(&mask, &kept, 1);
    return (uint32_t)mask;
""")
def triangles_not_missed(
    corners: wp.array[wp.float32],
    pack: wp.int32,
    origin: wp.vec3,
    axis: wp.int32,
    forward: wp.float32,
    shear: wp.vec2,
    margin: wp.float32,
) -> wp.uint32:
    """Which triangles of a pack the ray does not certainly miss, as a bit a lane.

    Corners are taken relative to the origin and sheared so that the ray runs along its axis; the signs of the edge
    functions then tell inside from outside (Woop et al. 2013, Watertight ray/triangle intersection, section 3.1). With
    u = 2^-24, S the largest coordinate and origins within 1.35 S, each sheared coordinate is wrong by at most
    u (1 + 3) 2.35 S + u 4.7 S < 8 ulp(S), and a product of two by their sizes times u; together the edge function of
    two corners is wrong by less than ``margin * (sum of their coordinates + margin)`` with ``margin`` = 16 ulp(S). A
    triangle is rejected where two edge functions exceed that with opposite signs, or where it lies behind the origin by
    more than ``margin``; ``forward`` is the sign of the direction along the axis.
    """


@wp.func_native("return __builtin_ctz(mask);")
def lowest_lane(mask: wp.uint32) -> wp.int32:
    """Number of the lowest set bit; the mask must not be 0."""


@wp.func
def without_lowest(mask: wp.uint32):
    return mask & (mask - wp.uint32(1))


@wp.struct
class Cursor:
    """A place in the walk through a tree.

    Attributes:
        level: Of the node; above the root's when the walk is over.
        node: Number within its level.
        pack: To be looked at now; -1 when the walk is over.
    """

    level: wp.int32
    node: wp.int32
    pack: wp.int32


@wp.func
def next_pack(tree: Tree, ray: Ray, limit: wp.float32, pending: wp.array[wp.uint32], cursor: Cursor):
    """Walk on, depth first, to the next pack whose box the ray crosses before ``limit``.

    Args:
        pending: Children still to be visited, one mask a level from the root's down to the cursor's.
    """
    level = cursor.level
    node = cursor.node
    pack = wp.int32(-1)
    while pack < 0 and level <= tree.top:
        children = pending[level]
        if children == wp.uint32(0):
            level += 1
            node = node >> LANE_BITS
        else:
            pending[level] = without_lowest(children)
            child = (node << LANE_BITS) + lowest_lane(children)
            if level == 0:
                pack = child
            else:
                level -= 1
                node = child
                pending[level] = boxes_crossed(
                    tree.bounds, tree.first_node[level] + node, ray.origin, ray.inverse, limit
                )
    cursor.level = level
    cursor.node = node
    cursor.pack = pack
    return cursor


@wp.func
def first_pack(tree: Tree, ray: Ray, limit: wp.float32, pending: wp.array[wp.uint32]):
    """Begin the walk at the root; see :func:`next_pack`."""
    cursor = Cursor()
    cursor.level = tree.top
    cursor.node = 0
    pending[tree.top] = boxes_crossed(tree.bounds, tree.first_node[tree.top], ray.origin, ray.inverse, limit)
    return next_pack(tree, ray, limit, pending, cursor)


@wp.func
def corner_of(tree: Tree, pack: wp.int32, lane: wp.int32, corner: wp.int32):
    return load_vector(tree.corners, (pack * 9 + corner * 3) * LANES + lane)


@wp.func
def crossing_in_pack(tree: Tree, ray: Ray, pack: wp.int32, lane: wp.int32):
    """The exact predicate on one triangle of a pack."""
    return crossing(
        wp.vec3d(ray.origin),
        ray.towards,
        ray.reach,
        ray.tolerance,
        corner_of(tree, pack, lane, 0),
        corner_of(tree, pack, lane, 1),
        corner_of(tree, pack, lane, 2),
    )


@wp.func
def candidates_in_pack(tree: Tree, ray: Ray, pack: wp.int32):
    forward = ray.inverse[ray.axis]
    return triangles_not_missed(
        tree.corners, pack, ray.origin, ray.axis, forward, ray.shear, CORNER_MARGIN * tree.scale
    )


@wp.func
def box_limit(ray: Ray, t: wp.float64):
    """How far boxes matter, along the ray's axis, if only crossings before ``t`` do."""
    return LIMIT_SLACK * wp.float32(t * ray.unit)


@wp.func
def is_blocked(tree: Tree, ray: Ray):
    """Whether the ray crosses any triangle."""
    pending = wp.zeros(shape=(MAX_LEVELS,), dtype=wp.uint32)
    limit = box_limit(ray, ray.reach)
    blocked = wp.bool(False)
    cursor = first_pack(tree, ray, limit, pending)
    while cursor.pack >= 0:
        candidates = candidates_in_pack(tree, ray, cursor.pack)
        while candidates != wp.uint32(0) and not blocked:
            blocked = crossing_in_pack(tree, ray, cursor.pack, lowest_lane(candidates)) > wp.float64(0.0)
            candidates = without_lowest(candidates)
        if blocked:
            cursor.pack = -1  # one is enough
        else:
            cursor = next_pack(tree, ray, limit, pending, cursor)
    return blocked


@wp.func
def nearest_blocker(tree: Tree, ray: Ray):
    """The caster triangle crossed first and its parameter t; of equally near ones the lowest; (-1, inf) if none."""
    pending = wp.zeros(shape=(MAX_LEVELS,), dtype=wp.uint32)
    limit = box_limit(ray, ray.reach)
    nearest = wp.float64(wp.inf)
    blocker = wp.int32(-1)
    cursor = first_pack(tree, ray, limit, pending)
    while cursor.pack >= 0:
        candidates = candidates_in_pack(tree, ray, cursor.pack)
        while candidates != wp.uint32(0):
            lane = lowest_lane(candidates)
            candidates = without_lowest(candidates)
            t = crossing_in_pack(tree, ray, cursor.pack, lane)
            triangle = tree.triangle[cursor.pack * LANES + lane]
            if t > wp.float64(0.0) and (t < nearest or (t == nearest and triangle < blocker)):
                nearest = t
                blocker = triangle
                limit = box_limit(ray, nearest)
        cursor = next_pack(tree, ray, limit, pending, cursor)
    return blocker, nearest


@wp.func
def surface_ray(light: LightPoint, position: wp.vec3, tolerance: wp.float64):
    """The ray from a surface point to the light, with no offset."""
    p = wp.vec3d(position)
    return make_ray(position, towards_light(light, p), reach_to_light(light, p), tolerance)


@wp.kernel
def find_turned_away(
    first: wp.int32,
    # inputs
    light: LightPoint,
    eye: wp.vec3d,
    placed: PlacedTriangles,
    triangle: wp.array[wp.int32],
    # outputs
    turned_away: wp.array[wp.uint8],
):
    """Whether each point's own triangle hides it from the light."""
    i = wp.tid() + first
    a, b, c = corners_of(placed, triangle[i])
    turned_away[i] = wp.where(is_turned_away(a, b, c, eye, light), wp.uint8(1), wp.uint8(0))


@wp.kernel
def find_nearest_blockers(
    first: wp.int32,
    # inputs
    tree: Tree,
    light: LightPoint,
    tolerance: wp.float64,
    asked: wp.array[wp.uint8],
    position: wp.array[wp.vec3],
    # outputs
    blocker: wp.array[wp.int32],
    distance: wp.array[wp.float32],
):
    """Which caster triangle hides each asked point first; -1 for none, and for points not asked."""
    i = wp.tid() + first
    blocker[i] = -1
    distance[i] = wp.inf
    if asked[i] != wp.uint8(0):
        ray = surface_ray(light, position[i], tolerance)
        found, t = nearest_blocker(tree, ray)
        blocker[i] = found
        distance[i] = wp.float32(t * wp.length(ray.towards))


@wp.kernel
def make_offset_rays(
    first: wp.int32,
    # inputs
    light: LightPoint,
    offset: wp.float64,
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    # outputs
    origin: wp.array[wp.vec3],
    towards: wp.array[wp.vec3],
    reach: wp.array[wp.float32],
):
    """The shadow rays of an ordinary ray tracer, in float32.

    From a point moved off its surface by ``offset`` [scene units], to the light's side; a directional light's direction
    as it is, otherwise up to the light and just short of it.
    """
    i = wp.tid() + first
    p = wp.vec3d(position[i])
    n = wp.vec3d(normal[i])
    side = wp.where(wp.dot(n, towards_light(light, p)) < wp.float64(0.0), wp.float64(-1.0), wp.float64(1.0))
    moved = wp.vec3(p + (offset * side) * n)
    origin[i] = moved
    towards[i] = wp.vec3(towards_light(light, wp.vec3d(moved)))
    reach[i] = wp.inf
    if light.point[3] != wp.float64(0.0):
        reach[i] = wp.float32(wp.clamp(reach_to_light(light, wp.vec3d(moved)), wp.float64(0.0), SHORT_OF_LIGHT))


class OffsetRays:
    """The rays of :func:`make_offset_rays`, one a receiver.

    Args:
        receivers: Where they start.
        light: Where they lead; not an area light.
        offset: Along the normal, to the light's side [scene units].
        context: Where to run.

    Attributes:
        origin, towards: wp.vec3, shape [n].
        reach: Parameter along ``towards`` where the ray ends, infinite for a directional light, float32, shape [n].
    """

    def __init__(self, receivers: Receivers, light: Light, offset: float, context: Context) -> None:
        on_device = receivers.on(context.device)
        self.origin = wp.empty(receivers.count, dtype=wp.vec3, device=context.device)
        self.towards = wp.empty(receivers.count, dtype=wp.vec3, device=context.device)
        self.reach = wp.empty(receivers.count, dtype=wp.float32, device=context.device)
        launch(
            make_offset_rays,
            receivers.count,
            inputs=[light_point(light), offset, on_device.position, on_device.normal],
            outputs=[self.origin, self.towards, self.reach],
            context=context,
        )
