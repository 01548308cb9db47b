"""Boxes and their shadow volumes: states, edges and planes, as Warp functions.

Everything is worked out in *box space*, where the box is axis-aligned, the light is a homogeneous point (position, 1)
or (direction towards it, 0), and all formulas are per axis; affine maps keep sides, orders and incidences, so what
holds there holds in the world. What a volume is, is told in :mod:`shadowbench.device.bounding_volumes`.

A *state* says where the light is along each axis: 1 beyond the high face, -1 beyond the low face, 0 between them. A
face is *lit* if the light is beyond it. A box edge lies along one axis, on one side of the next and one side of the one
after; it is a *silhouette* edge if exactly one of its two faces is lit.
"""

import warp as wp

from shadowbench.device.launch import kernel_options

# loops over a box's edges stay loops: unrolled, they take the compiler a minute
wp.set_module_options({**kernel_options(native=True), "max_unroll": 1})

MOST_PLANES = wp.constant(9)
"""Three lit faces and six silhouette edges."""

MOST_VOLUME_PLANES = wp.constant(15)
"""Planes there may be in a volume, of which at most :data:`MOST_PLANES` are."""


@wp.struct
class Box:
    """One box in box space, its image where the shadow ends, and the eye there."""

    low: wp.vec3d
    high: wp.vec3d
    far_low: wp.vec3d
    far_high: wp.vec3d
    light: wp.vec4d
    state: wp.vec3i
    eye: wp.vec3d


@wp.func
def light_state(low: wp.vec3d, high: wp.vec3d, light: wp.vec4d):
    state = wp.vec3i(0, 0, 0)
    for axis in range(3):
        if light[axis] > high[axis] * light[3]:
            state[axis] = 1
        elif light[axis] < low[axis] * light[3]:
            state[axis] = -1
    return state


@wp.func
def face_at(low: wp.vec3d, high: wp.vec3d, axis: wp.int32, side: wp.int32):
    """Coordinate of a face along its axis."""
    return wp.where(side > 0, high[axis], low[axis])


@wp.func
def is_lit(box: Box, axis: wp.int32, side: wp.int32):
    return box.state[axis] == side


@wp.func
def edge_sides(edge: wp.int32):
    """Axis, and sides along the next two axes, of edge 0 ... 11."""
    return wp.vec3i(edge // 4, 2 * (edge % 2) - 1, 2 * (edge // 2 % 2) - 1)


@wp.func
def is_silhouette(box: Box, edge: wp.vec3i):
    first = is_lit(box, (edge[0] + 1) % 3, edge[1])
    second = is_lit(box, (edge[0] + 2) % 3, edge[2])
    return first != second


@wp.func
def edge_end(low: wp.vec3d, high: wp.vec3d, edge: wp.vec3i, side: wp.int32):
    """The vertex at one end of an edge."""
    p = wp.vec3d()
    p[edge[0]] = face_at(low, high, edge[0], side)
    p[(edge[0] + 1) % 3] = face_at(low, high, (edge[0] + 1) % 3, edge[1])
    p[(edge[0] + 2) % 3] = face_at(low, high, (edge[0] + 2) % 3, edge[2])
    return p


@wp.func
def centre_of(box: Box):
    return wp.float64(0.5) * (box.low + box.high)


@wp.func
def away_from_light(box: Box, p: wp.vec3d):
    """Direction in which the shadow of a point runs."""
    light = wp.vec3d(box.light[0], box.light[1], box.light[2])
    return p * box.light[3] - light


@wp.func
def face_plane(axis: wp.int32, side: wp.int32, coordinate: wp.float64):
    """Plane (n, c) of a face: n·x <= c on the box's side of it."""
    plane = wp.vec4d()
    plane[axis] = wp.float64(side)
    plane[3] = wp.float64(side) * coordinate
    return plane


@wp.func
def side_plane(box: Box, edge: wp.vec3i):
    """Plane (n, c) through a silhouette edge and the light: n·x <= c on the box's side."""
    p = edge_end(box.low, box.high, edge, 1)
    along = wp.vec3d()
    along[edge[0]] = wp.float64(1.0)
    n = wp.cross(along, away_from_light(box, p))
    n[edge[0]] = wp.float64(0.0)
    c = wp.dot(n, p)
    if wp.dot(n, centre_of(box)) > c:
        n = -n
        c = -c
    return wp.vec4d(n[0], n[1], n[2], c)


@wp.func
def height_over(plane: wp.vec4d, p: wp.vec3d):
    """How far a point lies outside a plane, in lengths of its normal."""
    return plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] - plane[3]


@wp.func
def face_is_front(box: Box, low: wp.vec3d, high: wp.vec3d, axis: wp.int32, side: wp.int32):
    """Whether a face of the box, or of its image, is turned to the eye."""
    return height_over(face_plane(axis, side, face_at(low, high, axis, side)), box.eye) > wp.float64(0.0)


@wp.func
def side_is_front(box: Box, edge: wp.vec3i):
    """Whether the plane through a silhouette edge is turned to the eye."""
    return height_over(side_plane(box, edge), box.eye) > wp.float64(0.0)


@wp.func
def volume_plane(box: Box, number: wp.int32):
    """Plane (n, c) of the volume: 0 ... 2 are of lit faces, 3 ... 14 of silhouette edges; n is 0 if there is none."""
    plane = wp.vec4d()
    if number < 3:
        side = box.state[number]
        if side != 0:
            plane = face_plane(number, side, face_at(box.low, box.high, number, side))
    else:
        edge = edge_sides(number - 3)
        if is_silhouette(box, edge):
            plane = side_plane(box, edge)
    return plane


@wp.func
def is_given(plane: wp.vec4d):
    zero = wp.float64(0.0)
    return plane[0] != zero or plane[1] != zero or plane[2] != zero


@wp.func
def world_plane(plane: wp.vec4d, box_from_world: wp.mat33d, origin: wp.vec3d):
    """A plane of box space in the world: (n, -c) with n of length 1, so that its value is a distance."""
    n = wp.transpose(box_from_world) * wp.vec3d(plane[0], plane[1], plane[2])
    length = wp.length(n)
    return wp.vec4d(n[0], n[1], n[2], -(plane[3] + wp.dot(n, origin))) / length


@wp.func
def distance_outside(plane: wp.vec4d, p: wp.vec3d):
    """Distance of a world point outside of a world plane; negative inside."""
    return plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] + plane[3]
