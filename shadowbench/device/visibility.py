"""Whether a triangle shadows a point: the one exact predicate of the project.

The ground truth, the ray tracers and every exact rasterising method decide with these Warp functions, and so agree bit
for bit. All is float64 on the original float32 positions, and no multiplication may be fused with an addition: kernels
that call them live in modules with ``kernel_options(native=True)``. What a filter cannot decide for certain in float32
is handed to :func:`crossing`; a filter that only ever rejects what :func:`crossing` would reject leaves no trace in
the result. Opaque casters need no more: any crossing shadows. Through translucent ones every crossing dims, and
:func:`crossing_once` counts. The rule as a whole, and why it is this one, is told in :mod:`shadowbench.reference`.

A light is a homogeneous point: (position, 1), or (direction towards it, 0), so that one formula serves both.
"""

import numpy as np
import warp as wp

from shadowbench.errors import SceneError
from shadowbench.scene import DirectionalLight, Light, PointLight, SpotLight

PLANE_TOLERANCE_ULPS = 16
"""A plane this near to a point, in ulps of the scene's largest coordinate, is taken to be the point's own surface. The
stored position is within 1 ulp of it, a coplanar neighbour's plane within a few more."""

ULP = 2.0**-23
"""Spacing of float32 numbers just above 1."""

NO_CROSSING = wp.constant(wp.float64(-1.0))


def plane_tolerance(scale: float) -> float:
    """Return the predicate's delta [scene units].

    Args:
        scale: The scene's largest absolute coordinate, :attr:`shadowbench.world.World.scale`.
    """
    return PLANE_TOLERANCE_ULPS * ULP * scale


@wp.struct
class LightPoint:
    """A directional, spot or point light as a homogeneous point.

    Attributes:
        point: (x, y, z, w) with w = 1 for a position, 0 for a direction towards the light.
        axes: Planar distance from a positional light is the largest absolute component of ``axes (p - light)``: the
            spot's axis in every row, or the axes of the six faces around a point light.
        near: Planar distance within which nothing casts [scene units].
    """

    point: wp.vec4d
    axes: wp.mat33d
    near: wp.float64


def light_point(light: Light) -> LightPoint:
    """Return a light as the predicate sees it.

    Raises:
        SceneError: The light has an area, so there is no one point to be hidden from.
    """
    packed = LightPoint()
    match light:
        case DirectionalLight():
            packed.point = wp.vec4d(*light.direction, 0.0)
        case SpotLight():
            axis = np.array(light.direction, dtype=np.float64)
            axis /= np.sqrt((axis * axis).sum())
            packed.point, packed.axes = wp.vec4d(*light.position, 1.0), wp.mat33d(*axis, *axis, *axis)
            packed.near = light.near or 0.0
        case PointLight():
            packed.point, packed.axes = wp.vec4d(*light.position, 1.0), wp.mat33d(*np.eye(3).ravel())
            packed.near = light.near or 0.0
        case _:
            raise SceneError("an area light has no hard shadow: it needs the area-light reference")
    return packed


@wp.func
def towards_light(light: LightPoint, p: wp.vec3d):
    """The direction from p to the light; for a positional light it ends there (parameter 1)."""
    h = light.point
    return wp.vec3d(h[0] - h[3] * p[0], h[1] - h[3] * p[1], h[2] - h[3] * p[2])


@wp.func
def reach_to_light(light: LightPoint, p: wp.vec3d):
    """The parameter along :func:`towards_light` beyond which nothing casts: at the near plane, or never."""
    reach = wp.float64(wp.inf)
    if light.point[3] != wp.float64(0.0):
        planar = wp.max(wp.abs(light.axes * towards_light(light, p)))
        reach = wp.float64(1.0) - light.near / planar
    return reach


@wp.func
def plane_normal(a: wp.vec3, b: wp.vec3, c: wp.vec3):
    """Normal of triangle abc, as long as twice its area."""
    origin = wp.vec3d(a)
    return wp.cross(wp.vec3d(b) - origin, wp.vec3d(c) - origin)


@wp.func
def is_turned_away(a: wp.vec3, b: wp.vec3, c: wp.vec3, eye: wp.vec3d, light: LightPoint):
    """Whether the plane of triangle abc parts the eye from the light."""
    zero = wp.float64(0.0)
    n = plane_normal(a, b, c)
    origin = wp.vec3d(a)
    eye_side = wp.dot(n, eye - origin)
    light_side = wp.dot(n, towards_light(light, origin))
    return (eye_side > zero and light_side < zero) or (eye_side < zero and light_side > zero)


@wp.func
def plane_crossing(
    p: wp.vec3d,
    towards: wp.vec3d,
    reach: wp.float64,
    tolerance: wp.float64,
    a: wp.vec3,
    b: wp.vec3,
    c: wp.vec3,
):
    """The parameter at which the ray p + t towards crosses the plane of triangle abc, or :data:`NO_CROSSING`.

    It counts if 0 < t < reach and if the plane is farther from p than ``tolerance``.
    """
    zero = wp.float64(0.0)
    t = NO_CROSSING
    n = plane_normal(a, b, c)
    height = wp.dot(n, wp.vec3d(a) - p)
    slope = wp.dot(n, towards)
    ahead = (height > zero and slope > zero) or (height < zero and slope < zero)
    within_reach = wp.abs(height) < reach * wp.abs(slope)
    beyond_own_plane = height * height > tolerance * tolerance * wp.dot(n, n)
    if ahead and within_reach and beyond_own_plane:
        t = height / slope
    return t


@wp.func
def crossing(
    p: wp.vec3d,
    towards: wp.vec3d,
    reach: wp.float64,
    tolerance: wp.float64,
    a: wp.vec3,
    b: wp.vec3,
    c: wp.vec3,
):
    """The parameter t at which the ray p + t towards crosses triangle abc, or :data:`NO_CROSSING`.

    The triangle is closed: a ray through an edge or vertex crosses everything that meets there. See
    :func:`plane_crossing` for what counts.
    """
    zero = wp.float64(0.0)
    t = NO_CROSSING
    # signed volumes that the ray spans with each edge; swapping an edge's ends flips the sign exactly, so that of two
    # triangles at an edge at least one is crossed
    to_a = wp.vec3d(a) - p
    to_b = wp.vec3d(b) - p
    to_c = wp.vec3d(c) - p
    u = wp.dot(towards, wp.cross(to_b, to_c))
    v = wp.dot(towards, wp.cross(to_c, to_a))
    w = wp.dot(towards, wp.cross(to_a, to_b))
    if (u >= zero and v >= zero and w >= zero) or (u <= zero and v <= zero and w <= zero):
        t = plane_crossing(p, towards, reach, tolerance, a, b, c)
    return t


@wp.func
def is_before(towards: wp.vec3d, to_a: wp.vec3d, to_b: wp.vec3d):
    """Whether vertex a comes before vertex b in an order of all vertices across the ray.

    Vertices are ordered by their place along one direction perpendicular to the ray, then along another, then by their
    coordinates. Every triangle that has a vertex sees it in the same place.
    """
    across = wp.vec3d(wp.float64(0.0), towards[2], -towards[1])
    if wp.abs(towards[0]) > wp.abs(towards[1]):
        across = wp.vec3d(-towards[2], wp.float64(0.0), towards[0])
    side_a = wp.dot(across, to_a)
    side_b = wp.dot(across, to_b)
    if side_a == side_b:
        beside = wp.cross(towards, across)
        side_a = wp.dot(beside, to_a)
        side_b = wp.dot(beside, to_b)
    for axis in range(3):
        if side_a == side_b:
            side_a = to_a[axis]
            side_b = to_b[axis]
    return side_a < side_b


@wp.func
def is_left_of_edge(towards: wp.vec3d, to_a: wp.vec3d, to_b: wp.vec3d):
    """On which side the ray passes edge ab, where a ray through the edge passes beside it.

    The edge's volume decides, and if it is 0, the order of its ends, as if the ray were moved by a length smaller than
    all others, in the same direction for all edges (Edelsbrunner & Muecke 1990, "Simulation of simplicity"). Swapping
    the ends swaps the side.
    """
    volume = wp.dot(towards, wp.cross(to_a, to_b))
    return volume > wp.float64(0.0) or (volume == wp.float64(0.0) and is_before(towards, to_a, to_b))


@wp.func
def crossing_once(
    p: wp.vec3d,
    towards: wp.vec3d,
    reach: wp.float64,
    tolerance: wp.float64,
    a: wp.vec3,
    b: wp.vec3,
    c: wp.vec3,
):
    """As :func:`crossing`, but a ray through an edge or vertex of a surface crosses one triangle of each sheet there.

    At a silhouette, where two triangles of a closed surface meet that lie on the same side of the ray, it crosses both
    or neither. This is the crossing to count where each dims the light: through translucent casters.
    """
    t = NO_CROSSING
    to_a = wp.vec3d(a) - p
    to_b = wp.vec3d(b) - p
    to_c = wp.vec3d(c) - p
    of_a = is_left_of_edge(towards, to_b, to_c)
    of_b = is_left_of_edge(towards, to_c, to_a)
    of_c = is_left_of_edge(towards, to_a, to_b)
    if of_a == of_b and of_b == of_c:
        t = plane_crossing(p, towards, reach, tolerance, a, b, c)
    return t
