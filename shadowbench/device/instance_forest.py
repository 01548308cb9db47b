"""A two-level bounding-volume hierarchy: one tree a mesh, in the mesh's own space, and a tree over the instances.

What a scene of one mesh and a thousand instances keeps is the mesh's tree and a box an instance. Answers are those of
the flat tree (:mod:`shadowbench.device.triangle_tree`) bit for bit, since what a ray crosses is decided in world space
on the very corners that flat arrays hold; only the filters work in the mesh's space. They must not lose a triangle:

Let a ray's origin lie within 1.35 S of the world's, as in the flat tree, and R be the largest coordinate that any such
point gets in the mesh's space, whose origin is the centre of the mesh's box. Vertices and origins lie within R, so that
the flat tree's bound for its own filters, 8 ulp, holds with R in place of S. To it come: rounding of the origin and of
the mesh's vertices to float32, half an ulp(R) each; the world's float32 rounding of a vertex, half an ulp(S) in every
direction, which the inverse matrix makes at most half an ulp(R); and the rays that the exact predicate accepts within
2.5 ulp(S) of a triangle, already counted there, likewise. What float64 loses in the inverse is bounded by the matrix's
condition and must be less than an eighth of that; otherwise there is no forest (:func:`tree_over`). Together that is
less than 11 ulp(R); boxes are inflated by twice :data:`BOX_MARGIN_ULPS`, and the triangle test reckons with 2 R.
Instances may then move as long as R does not double, before meshes' trees are built again.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.instance_forest_kernels import Forest
from shadowbench.device.launch import Context, launch
from shadowbench.device.triangle_tree import (
    BOX_MARGIN_ULPS,
    TriangleTree,
    first_nodes,
    node_counts,
)
from shadowbench.device.triangle_tree_kernels import LANES, MAX_LEVELS, MOST_CURVE_BITS, Tree, write_keys
from shadowbench.device.visibility import ULP
from shadowbench.scene import Mesh
from shadowbench.world import Casters, DeviceTriangles, bounds_of

FARTHEST_ORIGIN = 1.35
"""How far from the world's origin rays start, relative to its largest coordinate."""

_ROOM = 2.0
"""R may grow so much before meshes' trees are built again."""

_SMALLEST, _LARGEST = 1e-15, 1e15
"""Limits of R, as of a world's scale."""


class InstanceForest:
    """The trees over a number of instances; building again reuses what can be.

    Args:
        context: Where to run.

    Attributes:
        bounds, corners: Of all meshes' trees, see :class:`shadowbench.device.instance_forest_kernels.Forest`.
        over: Boxes of the tree over the instances.
    """

    def __init__(self, context: Context) -> None:
        self.context = context
        self._planted: dict[int, tuple[Mesh, int, float]] = {}

    def fits(self, casters: Casters) -> bool:
        """Return whether :meth:`build` may be called with these casters."""
        return can_be_forest(casters)

    def build(self, casters: Casters) -> None:
        """Build the tree over the instances, and those of the meshes where they are not there yet."""
        self._casters = casters
        spaces = _Spaces(casters)
        wanted = {k: (casters.meshes[k], casters.meshes[k].version) for k in spaces.reach}
        known = {k: (mesh, version) for k, (mesh, version, _) in self._planted.items()}
        if wanted != known or any(spaces.reach[k] > self._planted[k][2] for k in wanted):
            self._plant(casters, spaces)
        self._place(casters, spaces)

    def _plant(self, casters: Casters, spaces: _Spaces) -> None:
        """Build the tree of every mesh that is used."""
        device, lanes = self.context.device, int(LANES)
        trees: list[TriangleTree] = []
        first_node = np.zeros((len(casters.meshes), int(MAX_LEVELS)), np.int32)
        top, pack = np.zeros(len(casters.meshes), np.int32), np.zeros(len(casters.meshes), np.int32)
        scale = np.zeros(len(casters.meshes), np.float32)
        centre = np.zeros((len(casters.meshes), 3))
        nodes = packs = 0
        self._planted = {}
        for k, reach in spaces.reach.items():
            mesh = casters.meshes[k]
            centre[k] = spaces.centre[k]
            vertices = (mesh.vertices.astype(np.float64) - centre[k]).astype(np.float32)
            tree = TriangleTree(mesh.triangle_count, self.context)
            triangles = as_warp(mesh.triangles.reshape(-1), wp.int32, device)
            tree.build_over(
                DeviceTriangles(as_warp(vertices, wp.vec3, device), triangles),
                *bounds_of(vertices),
                scale=2.0 * _ROOM * reach,
                margin=2.0 * BOX_MARGIN_ULPS * ULP * _ROOM * reach,
            )
            first_node[k, : len(tree.levels)] = np.add(tree.levels, nodes)
            top[k], pack[k], scale[k] = len(tree.levels) - 1, packs, 2.0 * _ROOM * reach
            nodes += tree.bounds.shape[0] // (6 * lanes)
            packs += tree.triangle.shape[0] // lanes
            trees.append(tree)
            self._planted[k] = (mesh, mesh.version, _ROOM * reach)
        self.bounds, self.corners = (_joined([getattr(t, n) for t in trees], device) for n in ("bounds", "corners"))
        self._triangle = _joined([t.triangle for t in trees], device)
        self._first_node = as_warp(first_node, wp.int32, device)
        self._top, self._pack = as_warp(top, wp.int32, device), as_warp(pack, wp.int32, device)
        self._scale, self._centre = as_warp(scale, wp.float32, device), as_warp(centre, wp.vec3d, device)

    def _place(self, casters: Casters, spaces: _Spaces) -> None:
        """Build the tree over the instances' boxes."""
        device, lanes, count = self.context.device, int(LANES), len(casters.instances)
        order = _along_curve(casters, self.context)
        counts = node_counts(count)
        boxes = np.empty((sum(counts), 2, 3, lanes), np.float32)
        boxes[:, 0], boxes[:, 1] = np.inf, -np.inf
        margin = np.float32(BOX_MARGIN_ULPS * ULP * casters.scale)
        place = np.arange(count)
        limits = casters.instance_bounds[order]
        boxes[place // lanes, 0, :, place % lanes] = limits[:, 0] - margin
        boxes[place // lanes, 1, :, place % lanes] = limits[:, 1] + margin
        begin = first_nodes(counts)
        for level in range(len(counts) - 1):
            child = np.arange(counts[level])
            parent = begin[level + 1] + child // lanes
            boxes[parent, 0, :, child % lanes] = boxes[begin[level] + child, 0].min(axis=2)
            boxes[parent, 1, :, child % lanes] = boxes[begin[level] + child, 1].max(axis=2)
        self.over = as_warp(boxes.reshape(-1), wp.float32, device)
        self._over_first_node, self._over_top = as_warp(np.array(begin, np.int32), wp.int32, device), len(counts) - 1
        self._order = as_warp(order.astype(np.int32), wp.int32, device)
        self._mesh = as_warp(np.array([i.mesh for i in casters.instances], np.int32), wp.int32, device)
        self._inverse = as_warp(spaces.inverse.reshape(-1, 3), wp.vec3d, device)
        self._at = as_warp(spaces.place, wp.vec3d, device)

    def packed(self) -> Forest:
        """Return the forest, once built, for kernels."""
        over: Any = Tree()
        over.bounds, over.first_node, over.top = self.over, self._over_first_node, self._over_top
        over.scale = self._casters.scale
        forest: Any = Forest()
        forest.over, forest.order = over, self._order
        forest.bounds, forest.corners, forest.triangle = self.bounds, self.corners, self._triangle
        forest.first_node, forest.top, forest.pack = self._first_node, self._top, self._pack
        forest.scale, forest.centre = self._scale, self._centre
        forest.mesh, forest.inverse, forest.place = self._mesh, self._inverse, self._at
        forest.placed = self._casters.lookup(self.context.device)
        return cast("Forest", forest)


class _Spaces:
    """How the world looks from the meshes' spaces.

    Attributes:
        centre: Of each used mesh's box, by its number.
        reach: Its R, the largest coordinate in its space.
        inverse: Mesh from world without translation, shape [instance_count, 3, 3].
        place: Where each instance's mesh has its origin in the world, shape [instance_count, 3].
        loss: What float64 may lose of a coordinate, relative to R, over all instances.
    """

    def __init__(self, casters: Casters) -> None:
        matrices = np.array([i.matrix() for i in casters.authored])
        linear = matrices[:, :, :3]
        self.place = matrices[:, :, 3] - np.array(casters.origin)
        self.inverse = np.linalg.inv(linear)
        mesh = np.array([i.mesh for i in casters.instances])
        limits = {int(k): bounds_of(casters.meshes[k].vertices) for k in np.unique(mesh)}
        self.centre = {k: (low.astype(np.float64) + high.astype(np.float64)) / 2.0 for k, (low, high) in limits.items()}
        sizes = np.abs(self.inverse).sum(axis=2)
        centres = np.array([self.centre[int(k)] for k in mesh])
        offset = np.abs(np.einsum("irc,ic->ir", self.inverse, self.place) + centres).max(axis=1)
        by_instance = FARTHEST_ORIGIN * casters.scale * sizes.max(axis=1) + offset
        self.reach = {k: float(by_instance[mesh == k].max()) for k in self.centre}
        condition = np.abs(linear).sum(axis=2).max(axis=1) * sizes.max(axis=1)
        terms = sizes.max(axis=1) * (2.0 * casters.scale + np.abs(self.place).max(axis=1)) + np.abs(centres).max(axis=1)
        self.loss = float((condition * terms / by_instance).max()) * 2.0**-48


def can_be_forest(casters: Casters) -> bool:
    """Return whether the filters can work in the meshes' spaces; with extreme matrices they cannot."""
    if not casters.instances:
        return False
    with np.errstate(all="ignore"):
        try:
            spaces = _Spaces(casters)
        except np.linalg.LinAlgError:
            return False
    reach = np.array(list(spaces.reach.values()))
    return bool((reach > _SMALLEST).all() and (reach < _LARGEST).all() and spaces.loss < ULP / 8.0)


def tree_over(casters: Casters, context: Context) -> TriangleTree | InstanceForest:
    """Return a tree for casters, not built yet: a forest of instances where there are no flat arrays."""
    if not casters.is_flat and can_be_forest(casters):
        return InstanceForest(context)
    return TriangleTree(casters.triangle_count, context)


def _along_curve(casters: Casters, context: Context) -> NDArray[np.int64]:
    """Return the instances in the order of their boxes' centres along the Hilbert curve."""
    centre = casters.instance_bounds.mean(axis=1, dtype=np.float64).astype(np.float32)
    low, high = bounds_of(centre)
    extent = float((high.astype(np.float64) - low).max())
    count = len(centre)
    bits = min(MOST_CURVE_BITS, (64 - count.bit_length()) // 3)
    cells_per_unit = (1 << bits) / extent if extent > 0.0 else 0.0
    numbers = np.repeat(np.arange(count, dtype=np.int32), 3)
    keys: Any = wp.empty(count, dtype=wp.uint64, device=context.device)
    inputs = [as_warp(centre, wp.vec3, context.device), as_warp(numbers, wp.int32, context.device)]
    origin = wp.vec3(*low.tolist())
    launch(write_keys, count, [*inputs, origin, cells_per_unit, bits, count.bit_length()], [keys], context=context)
    return np.argsort(keys.numpy(), kind="stable")


def _joined(arrays: list[Any], device: str) -> Any:
    """Return arrays one after the other."""
    if len(arrays) == 1:
        return arrays[0]
    return wp.array(np.concatenate([a.numpy() for a in arrays]), dtype=arrays[0].dtype, device=device)
