"""Rays through a forest of instances: what kernels see of it, and the walk.

A ray walks the tree over the instances' boxes in world space; in every instance whose box it crosses it goes on, moved
to the mesh's own space, through the mesh's tree. Both walks and their float32 filters are those of
:mod:`shadowbench.device.rays`. What the filters let through is placed in world space and decided there by the one exact
predicate: the same triangle, bit for bit, that flat arrays would hold. See :mod:`shadowbench.device.instance_forest`
for why the filters lose nothing.
"""

import warp as wp

from shadowbench.device.launch import kernel_options
from shadowbench.device.placed_triangles import PlacedTriangles, placed_vertex
from shadowbench.device.rays import (
    Ray,
    box_limit,
    candidates_in_pack,
    first_pack,
    lowest_lane,
    make_ray,
    next_pack,
    surface_ray,
    without_lowest,
)
from shadowbench.device.triangle_tree_kernels import LANES, MAX_LEVELS, Tree
from shadowbench.device.visibility import LightPoint, crossing

wp.set_module_options(kernel_options(native=True))


@wp.struct
class Forest:
    """A tree over instances, and one a mesh.

    Attributes:
        over: The tree over the instances' boxes; what it calls a pack is one instance.
        order: Instance of each of its packs.
        bounds, corners, triangle: As in :class:`Tree`, of all meshes' trees one after the other; a triangle is numbered
            within its mesh.
        first_node: Of each mesh's levels, numbers in ``bounds``, shape [mesh_count, MAX_LEVELS].
        top: Each mesh's root level.
        pack: Where each mesh's packs begin.
        scale: Largest coordinate that occurs in each mesh's space, for the triangle test.
        centre: Of each mesh's space, in the mesh's own coordinates.
        mesh: Of each instance.
        inverse: Mesh from world without translation, three rows an instance, shape [3 * instance_count].
        place: Of each instance in the world: where the mesh's own origin comes to lie.
        placed: The instances.
    """

    over: Tree
    order: wp.array[wp.int32]
    bounds: wp.array[wp.float32]
    corners: wp.array[wp.float32]
    triangle: wp.array[wp.int32]
    first_node: wp.array2d[wp.int32]
    top: wp.array[wp.int32]
    pack: wp.array[wp.int32]
    scale: wp.array[wp.float32]
    centre: wp.array[wp.vec3d]
    mesh: wp.array[wp.int32]
    inverse: wp.array[wp.vec3d]
    place: wp.array[wp.vec3d]
    placed: PlacedTriangles


@wp.func
def tree_of(forest: Forest, mesh: wp.int32):
    """One mesh's tree; its packs begin at ``forest.pack[mesh]``."""
    tree = Tree()
    tree.bounds = forest.bounds
    tree.corners = forest.corners
    tree.triangle = forest.triangle
    tree.first_node = forest.first_node[mesh]
    tree.top = forest.top[mesh]
    tree.scale = forest.scale[mesh]
    return tree


@wp.func
def turned_back(forest: Forest, instance: wp.int32, p: wp.vec3d):
    """A world direction in an instance's mesh space."""
    k = 3 * instance
    return wp.vec3d(wp.dot(forest.inverse[k], p), wp.dot(forest.inverse[k + 1], p), wp.dot(forest.inverse[k + 2], p))


@wp.func
def ray_in_mesh(forest: Forest, instance: wp.int32, ray: Ray):
    """The ray in the space of an instance's mesh, with the same parameter along it, as the filters need it."""
    origin = turned_back(forest, instance, wp.vec3d(ray.origin) - forest.place[instance])
    moved = wp.vec3(origin - forest.centre[forest.mesh[instance]])
    return make_ray(moved, turned_back(forest, instance, ray.towards), ray.reach, ray.tolerance)


@wp.func
def corners_in_instance(forest: Forest, instance: wp.int32, t: wp.int32):
    """World corners of triangle ``t`` of an instance's mesh."""
    k = wp.int64(3) * (forest.placed.pool_triangle[instance] + wp.int64(t))
    first = forest.placed.pool_vertex[instance]
    a = placed_vertex(forest.placed, instance, first + wp.int64(forest.placed.triangles[k]))
    b = placed_vertex(forest.placed, instance, first + wp.int64(forest.placed.triangles[k + wp.int64(1)]))
    c = placed_vertex(forest.placed, instance, first + wp.int64(forest.placed.triangles[k + wp.int64(2)]))
    return a, b, c


@wp.func
def crossing_in_instance(forest: Forest, ray: Ray, instance: wp.int32, t: wp.int32):
    """The exact predicate on one triangle of an instance."""
    a, b, c = corners_in_instance(forest, instance, t)
    return crossing(wp.vec3d(ray.origin), ray.towards, ray.reach, ray.tolerance, a, b, c)


@wp.func
def is_blocked_by_instance(forest: Forest, ray: Ray, instance: wp.int32, pending: wp.array[wp.uint32]):
    """Whether the ray crosses any triangle of an instance."""
    mesh = forest.mesh[instance]
    tree = tree_of(forest, mesh)
    local = ray_in_mesh(forest, instance, ray)
    limit = box_limit(local, ray.reach)
    blocked = wp.bool(False)
    cursor = first_pack(tree, local, limit, pending)
    while cursor.pack >= 0:
        pack = forest.pack[mesh] + cursor.pack
        candidates = candidates_in_pack(tree, local, pack)
        while candidates != wp.uint32(0) and not blocked:
            t = forest.triangle[pack * LANES + lowest_lane(candidates)]
            blocked = crossing_in_instance(forest, ray, instance, t) > wp.float64(0.0)
            candidates = without_lowest(candidates)
        if blocked:
            cursor.pack = -1  # one is enough
        else:
            cursor = next_pack(tree, local, limit, pending, cursor)
    return blocked


@wp.func
def is_blocked_in_forest(forest: Forest, ray: Ray):
    """Whether the ray crosses any triangle of any instance."""
    pending_over = wp.zeros(shape=(MAX_LEVELS,), dtype=wp.uint32)
    pending = wp.zeros(shape=(MAX_LEVELS,), dtype=wp.uint32)
    limit = box_limit(ray, ray.reach)
    blocked = wp.bool(False)
    cursor = first_pack(forest.over, ray, limit, pending_over)
    while cursor.pack >= 0:
        blocked = is_blocked_by_instance(forest, ray, forest.order[cursor.pack], pending)
        if blocked:
            cursor.pack = -1
        else:
            cursor = next_pack(forest.over, ray, limit, pending_over, cursor)
    return blocked


@wp.func
def nearest_in_instance(
    forest: Forest,
    ray: Ray,
    instance: wp.int32,
    pending: wp.array[wp.uint32],
    blocker: wp.int32,
    nearest: wp.float64,
):
    """The nearest of what was found before and what the ray crosses in an instance."""
    mesh = forest.mesh[instance]
    tree = tree_of(forest, mesh)
    local = ray_in_mesh(forest, instance, ray)
    limit = box_limit(local, wp.min(ray.reach, nearest))
    first_triangle = wp.int32(forest.placed.first_triangle[instance])
    cursor = first_pack(tree, local, limit, pending)
    while cursor.pack >= 0:
        pack = forest.pack[mesh] + cursor.pack
        candidates = candidates_in_pack(tree, local, pack)
        while candidates != wp.uint32(0):
            triangle = forest.triangle[pack * LANES + lowest_lane(candidates)]
            candidates = without_lowest(candidates)
            t = crossing_in_instance(forest, ray, instance, triangle)
            number = first_triangle + triangle
            if t > wp.float64(0.0) and (t < nearest or (t == nearest and number < blocker)):
                nearest = t
                blocker = number
                limit = box_limit(local, nearest)
        cursor = next_pack(tree, local, limit, pending, cursor)
    return blocker, nearest


@wp.func
def nearest_in_forest(forest: Forest, ray: Ray):
    """The caster triangle crossed first and its parameter t; of equally near ones the lowest; (-1, inf) if none."""
    pending_over = wp.zeros(shape=(MAX_LEVELS,), dtype=wp.uint32)
    pending = wp.zeros(shape=(MAX_LEVELS,), dtype=wp.uint32)
    limit = box_limit(ray, ray.reach)
    nearest = wp.float64(wp.inf)
    blocker = wp.int32(-1)
    cursor = first_pack(forest.over, ray, limit, pending_over)
    while cursor.pack >= 0:
        found, t = nearest_in_instance(forest, ray, forest.order[cursor.pack], pending, blocker, nearest)
        if t < nearest:
            limit = box_limit(ray, t)
        blocker = found
        nearest = t
        cursor = next_pack(forest.over, ray, limit, pending_over, cursor)
    return blocker, nearest


@wp.kernel
def find_nearest_blockers_in_forest(
    first: wp.int32,
    # inputs
    forest: Forest,
    light: LightPoint,
    tolerance: wp.float64,
    asked: wp.array[wp.uint8],
    position: wp.array[wp.vec3],
    # outputs
    blocker: wp.array[wp.int32],
    distance: wp.array[wp.float32],
):
    """As :func:`shadowbench.device.rays.find_nearest_blockers`."""
    i = wp.tid() + first
    blocker[i] = -1
    distance[i] = wp.inf
    if asked[i] != wp.uint8(0):
        ray = surface_ray(light, position[i], tolerance)
        found, t = nearest_in_forest(forest, ray)
        blocker[i] = found
        distance[i] = wp.float32(t * wp.length(ray.towards))
