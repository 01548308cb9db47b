"""Shadow rays: is anything between a receiver and the light?"""

import warp as wp

from shadowbench.device.instance_forest_kernels import Forest, is_blocked_in_forest
from shadowbench.device.launch import kernel_options
from shadowbench.device.placed_triangles import PlacedTriangles, corners_of
from shadowbench.device.rays import is_blocked, make_ray, surface_ray
from shadowbench.device.triangle_tree_kernels import Tree
from shadowbench.device.visibility import LightPoint, is_turned_away

wp.set_module_options(kernel_options(native=True))


@wp.kernel
def trace_from_surface(
    first: wp.int32,
    # inputs
    tree: Tree,
    light: LightPoint,
    eye: wp.vec3d,
    tolerance: wp.float64,
    placed: PlacedTriangles,
    asked: wp.array[wp.uint8],
    position: wp.array[wp.vec3],
    triangle: wp.array[wp.int32],
    # outputs
    visibility: wp.array[wp.float32],
):
    """The ground truth's rule: the ray starts on the surface, and planes through its start do not count."""
    i = wp.tid() + first
    visibility[i] = 0.0
    if asked[i] == wp.uint8(0):
        return
    a, b, c = corners_of(placed, triangle[i])
    if is_turned_away(a, b, c, eye, light):
        return
    if not is_blocked(tree, surface_ray(light, position[i], tolerance)):
        visibility[i] = 1.0


@wp.kernel
def trace_from_offset(
    first: wp.int32,
    # inputs
    tree: Tree,
    asked: wp.array[wp.uint8],
    origin: wp.array[wp.vec3],
    towards: wp.array[wp.vec3],
    reach: wp.array[wp.float32],
    # outputs
    visibility: wp.array[wp.float32],
):
    """The ordinary rule: the ray starts off the surface, and everything it crosses counts."""
    i = wp.tid() + first
    visibility[i] = 0.0
    if asked[i] == wp.uint8(0):
        return
    ray = make_ray(origin[i], wp.vec3d(towards[i]), wp.float64(reach[i]), wp.float64(0.0))
    if not is_blocked(tree, ray):
        visibility[i] = 1.0


@wp.kernel
def trace_from_surface_in_forest(
    first: wp.int32,
    # inputs
    forest: Forest,
    light: LightPoint,
    eye: wp.vec3d,
    tolerance: wp.float64,
    placed: PlacedTriangles,
    asked: wp.array[wp.uint8],
    position: wp.array[wp.vec3],
    triangle: wp.array[wp.int32],
    # outputs
    visibility: wp.array[wp.float32],
):
    """:func:`trace_from_surface` through instances."""
    i = wp.tid() + first
    visibility[i] = 0.0
    if asked[i] == wp.uint8(0):
        return
    a, b, c = corners_of(placed, triangle[i])
    if is_turned_away(a, b, c, eye, light):
        return
    if not is_blocked_in_forest(forest, surface_ray(light, position[i], tolerance)):
        visibility[i] = 1.0


@wp.kernel
def trace_from_offset_in_forest(
    first: wp.int32,
    # inputs
    forest: Forest,
    asked: wp.array[wp.uint8],
    origin: wp.array[wp.vec3],
    towards: wp.array[wp.vec3],
    reach: wp.array[wp.float32],
    # outputs
    visibility: wp.array[wp.float32],
):
    """:func:`trace_from_offset` through instances."""
    i = wp.tid() + first
    visibility[i] = 0.0
    if asked[i] == wp.uint8(0):
        return
    ray = make_ray(origin[i], wp.vec3d(towards[i]), wp.float64(reach[i]), wp.float64(0.0))
    if not is_blocked_in_forest(forest, ray):
        visibility[i] = 1.0
