"""Rays through translucent casters: every crossing dims the light by its caster's transmittance.

What rasterising methods do triangle by triangle (:mod:`shadowbench.device.exact_decision`) is done here ray by ray, by
the same predicate: a shared edge or vertex counts once, an opaque triangle ends the ray. Crossings are counted by
transmittance and multiplied in the order of the file, so that the product has the same bits.
"""

from __future__ import annotations

from itertools import groupby
from typing import Any

import numpy as np
import warp as wp

from shadowbench.device.arrays import as_warp
from shadowbench.device.blocker_bins import instances_of
from shadowbench.device.instance_forest import InstanceForest
from shadowbench.device.instance_forest_kernels import (
    Forest,
    corners_in_instance,
    crossing_in_instance,
    ray_in_mesh,
    tree_of,
)
from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.rays import (
    Ray,
    box_limit,
    candidates_in_pack,
    corner_of,
    crossing_in_pack,
    first_pack,
    lowest_lane,
    next_pack,
    surface_ray,
    without_lowest,
)
from shadowbench.device.triangle_tree import TriangleTree
from shadowbench.device.triangle_tree_kernels import LANES, MAX_LEVELS, Tree
from shadowbench.device.visibility import LightPoint, crossing_once, light_point, plane_tolerance
from shadowbench.scene import Light
from shadowbench.world import Casters

wp.set_module_options(kernel_options(native=True))

_SCRATCH = 1 << 24
"""Crossing counts held at a time, over all rays of a block."""


@wp.struct
class Glass:
    """Transmittances as they follow each other in the file.

    Attributes:
        instance: Of each caster triangle, shape [triangle_count]; empty for a forest, which knows.
        group: Of each instance, shape [instance_count]: neighbours of the same transmittance share one; -1 if opaque.
        transmittance: Of each group, shape [group_count].
    """

    instance: wp.array[wp.int32]
    group: wp.array[wp.int32]
    transmittance: wp.array[wp.vec3]


def glass_of(casters: Casters, device: str, *, by_triangle: bool) -> Glass:
    """Return the transmittances of casters that are not all opaque."""
    groups, transmittances = [], []
    for transmittance, instances in groupby(casters.instances, key=lambda i: i.transmittance):
        is_opaque = max(transmittance) == 0.0
        groups += [-1 if is_opaque else len(transmittances)] * sum(1 for _ in instances)
        transmittances += [] if is_opaque else [transmittance]
    glass = Glass()
    counts = np.diff(casters.first_triangle) if by_triangle else np.zeros(0, np.int64)
    glass.instance = instances_of(counts, 0, device)
    glass.group = as_warp(np.array(groups, np.int32), wp.int32, device)
    glass.transmittance = as_warp(np.array(transmittances, np.float32), wp.vec3, device)
    return glass


@wp.func
def crosses_once(tree: Tree, ray: Ray, pack: wp.int32, lane: wp.int32):
    """Whether a ray crosses a translucent triangle of a pack: the predicate that counts."""
    t = crossing_once(
        wp.vec3d(ray.origin),
        ray.towards,
        ray.reach,
        ray.tolerance,
        corner_of(tree, pack, lane, 0),
        corner_of(tree, pack, lane, 1),
        corner_of(tree, pack, lane, 2),
    )
    return t > wp.float64(0.0)


@wp.func
def count_crossings(tree: Tree, ray: Ray, glass: Glass, crossings: wp.array[wp.int32]):
    """Count the crossed triangles of each group; returns whether an opaque one ends the ray."""
    pending = wp.zeros(shape=(MAX_LEVELS,), dtype=wp.uint32)
    limit = box_limit(ray, ray.reach)
    blocked = wp.bool(False)
    cursor = first_pack(tree, ray, limit, pending)
    while cursor.pack >= 0:
        candidates = candidates_in_pack(tree, ray, cursor.pack)
        while candidates != wp.uint32(0) and not blocked:
            lane = lowest_lane(candidates)
            candidates = without_lowest(candidates)
            group = glass.group[glass.instance[tree.triangle[cursor.pack * LANES + lane]]]
            if group < 0:
                blocked = crossing_in_pack(tree, ray, cursor.pack, lane) > wp.float64(0.0)
            elif crosses_once(tree, ray, cursor.pack, lane):
                crossings[group] = crossings[group] + 1
        if blocked:
            cursor.pack = -1
        else:
            cursor = next_pack(tree, ray, limit, pending, cursor)
    return blocked


@wp.func
def product(crossings: wp.array[wp.int32], glass: Glass):
    """What is left of the light, multiplied in the order of the file."""
    through = wp.vec3(1.0, 1.0, 1.0)
    for group in range(glass.transmittance.shape[0]):
        for _ in range(crossings[group]):
            through = wp.cw_mul(through, glass.transmittance[group])
    return through


@wp.func
def count_crossings_in_instance(
    forest: Forest,
    ray: Ray,
    instance: wp.int32,
    glass: Glass,
    crossings: wp.array[wp.int32],
    pending: wp.array[wp.uint32],
):
    """:func:`count_crossings` of one instance."""
    mesh = forest.mesh[instance]
    tree = tree_of(forest, mesh)
    local = ray_in_mesh(forest, instance, ray)
    limit = box_limit(local, ray.reach)
    group = glass.group[instance]
    blocked = wp.bool(False)
    cursor = first_pack(tree, local, limit, pending)
    while cursor.pack >= 0:
        pack = forest.pack[mesh] + cursor.pack
        candidates = candidates_in_pack(tree, local, pack)
        while candidates != wp.uint32(0) and not blocked:
            triangle = forest.triangle[pack * LANES + lowest_lane(candidates)]
            candidates = without_lowest(candidates)
            if group < 0:
                blocked = crossing_in_instance(forest, ray, instance, triangle) > wp.float64(0.0)
            else:
                a, b, c = corners_in_instance(forest, instance, triangle)
                t = crossing_once(wp.vec3d(ray.origin), ray.towards, ray.reach, ray.tolerance, a, b, c)
                if t > wp.float64(0.0):
                    crossings[group] = crossings[group] + 1
        if blocked:
            cursor.pack = -1
        else:
            cursor = next_pack(tree, local, limit, pending, cursor)
    return blocked


@wp.func
def count_crossings_in_forest(forest: Forest, ray: Ray, glass: Glass, crossings: wp.array[wp.int32]):
    """:func:`count_crossings` through instances."""
    pending_over = wp.zeros(shape=(MAX_LEVELS,), dtype=wp.uint32)
    pending = wp.zeros(shape=(MAX_LEVELS,), dtype=wp.uint32)
    limit = box_limit(ray, ray.reach)
    blocked = wp.bool(False)
    cursor = first_pack(forest.over, ray, limit, pending_over)
    while cursor.pack >= 0:
        instance = forest.order[cursor.pack]
        blocked = count_crossings_in_instance(forest, ray, instance, glass, crossings, pending)
        if blocked:
            cursor.pack = -1
        else:
            cursor = next_pack(forest.over, ray, limit, pending_over, cursor)
    return blocked


@wp.kernel
def _trace_through_forest(
    first: wp.int32,
    # inputs
    forest: Forest,
    light: LightPoint,
    tolerance: wp.float64,
    glass: Glass,
    asked: wp.array[wp.uint8],
    position: wp.array[wp.vec3],
    crossings: wp.array2d[wp.int32],
    # outputs
    visibility: wp.array2d[wp.float32],
):
    i = wp.tid() + first
    through = wp.vec3(0.0, 0.0, 0.0)
    if asked[i] != wp.uint8(0):
        for group in range(glass.transmittance.shape[0]):
            crossings[i, group] = 0
        ray = surface_ray(light, position[i], tolerance)
        if not count_crossings_in_forest(forest, ray, glass, crossings[i]):
            through = product(crossings[i], glass)
    for channel in range(3):
        visibility[i, channel] = through[channel]


@wp.kernel
def _trace_through(
    first: wp.int32,
    # inputs
    tree: Tree,
    light: LightPoint,
    tolerance: wp.float64,
    glass: Glass,
    asked: wp.array[wp.uint8],
    position: wp.array[wp.vec3],
    crossings: wp.array2d[wp.int32],
    # outputs
    visibility: wp.array2d[wp.float32],
):
    i = wp.tid() + first
    through = wp.vec3(0.0, 0.0, 0.0)
    if asked[i] != wp.uint8(0):
        for group in range(glass.transmittance.shape[0]):
            crossings[i, group] = 0
        if not count_crossings(tree, surface_ray(light, position[i], tolerance), glass, crossings[i]):
            through = product(crossings[i], glass)
    for channel in range(3):
        visibility[i, channel] = through[channel]


def trace_through(
    tree: TriangleTree | InstanceForest,
    casters: Casters,
    light: Light,
    *,
    asked: wp.array[Any],
    position: wp.array[Any],
    visibility: wp.array[Any],
    context: Context,
) -> None:
    """Trace rays from surface points to a light through translucent casters.

    Args:
        tree: Over ``casters``.
        casters: Not all opaque.
        light: Directional, spot or point.
        asked: Which points to trace from, uint8, shape [n]; the others get 0.
        position: World positions, wp.vec3, shape [n].
        visibility: Becomes the product of the crossed casters' transmittances, float32, shape [n, 3]; or [n], which
            gets what red does.
        context: Where to run.
    """
    is_forest, count = isinstance(tree, InstanceForest), int(position.shape[0])
    glass = glass_of(casters, context.device, by_triangle=not is_forest)
    by_channel = visibility
    if visibility.ndim == 1:
        by_channel = wp.empty((count, 3), dtype=wp.float32, device=context.device)
    group_count = max(1, int(glass.transmittance.shape[0]))
    block = max(1, _SCRATCH // group_count)
    crossings = wp.empty((min(block, count), group_count), dtype=wp.int32, device=context.device)
    for begin in range(0, count, block):
        end = min(begin + block, count)
        launch(
            _trace_through_forest if is_forest else _trace_through,
            end - begin,
            inputs=[
                tree.packed(),
                light_point(light),
                plane_tolerance(casters.scale),
                glass,
                asked[begin:end],
                position[begin:end],
                crossings,
            ],
            outputs=[by_channel[begin:end]],
            context=context,
        )
    if visibility.ndim == 1:
        wp.copy(visibility, by_channel[:, 0].contiguous())
