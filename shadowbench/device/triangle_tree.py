"""A bounding-volume hierarchy over world-space triangles, made for rays that only ask whether something is in the way.

Triangles are sorted along a Hilbert curve and cut into packs of eight; eight packs have a node, eight nodes a node
above them, up to one root. The tree is complete, so it needs no pointers: child ``k`` of node ``n`` is number
``8n + k`` one level below. Sorting is the whole of construction, which makes a build many times cheaper than with a
surface-area heuristic, and a query hardly dearer. What a ray crosses does not depend on the tree: any tree gives the
same bits.

Boxes are inflated so that the float32 ray-box test of :mod:`shadowbench.device.rays` never misses a triangle that
:func:`shadowbench.device.visibility.crossing` accepts. With S the world's largest coordinate and u = 2^-24 (half an
ulp), origins within 1.35 S of the origin and triangles within S: a crossing lies at most 2.35 S from the ray's origin
along each axis. The test computes ``(bound - origin) * inverse`` with four roundings (scaled direction, inverse,
difference, product), which is to have moved the bound by at most 4u · 2.35 S < 5 ulp(S); rounding the inflated bound
moves it by half an ulp more. That the ray does pass through the triangle rests on float64: the predicate's signed
volumes are wrong by less than 140 · 2^-53 |direction| S^2, so a ray it accepts passes within twice that, over h, of a
triangle of height h as seen along the ray: under 2.5 ulp(S) for every triangle that appears at least an ulp thick.
Together that is less than 8 ulp. (A thinner sliver could be accepted from farther off only by a ray in line with it to
1e-14 S.)
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.launch import Context, launch
from shadowbench.device.triangle_tree_kernels import (
    LANES,
    MOST_CURVE_BITS,
    Tree,
    enclose_children,
    fill_packs,
    write_keys,
)
from shadowbench.device.visibility import ULP
from shadowbench.world import Casters, DeviceTriangles

BOX_MARGIN_ULPS = 8
"""How much boxes are inflated, in ulps of the world's largest coordinate."""

_KEY_BITS = 64
"""For a place along the curve and the triangle's number."""


def node_counts(pack_count: int) -> list[int]:
    """Return the number of nodes of each level, from the parents of packs to the root."""
    counts = [max(1, -(-pack_count // int(LANES)))]
    while counts[-1] > 1:
        counts.append(-(-counts[-1] // int(LANES)))
    return counts


def first_nodes(counts: list[int]) -> list[int]:
    """Return the number of each level's first node."""
    return [sum(counts[:level]) for level in range(len(counts))]


class TriangleTree:
    """The tree over a number of triangles; building again reuses the memory.

    Args:
        triangle_count: Triangles to hold; may be 0.
        context: Where to run.

    Attributes:
        bounds, corners, triangle: See :class:`shadowbench.device.triangle_tree_kernels.Tree`.
    """

    def __init__(self, triangle_count: int, context: Context) -> None:
        self.triangle_count, self.context = triangle_count, context
        lanes, device = int(LANES), context.device
        self._pack_count = -(-triangle_count // lanes)
        self._node_counts = node_counts(self._pack_count)
        self._first_node = first_nodes(self._node_counts)
        self._first_node_on_device: wp.array[Any] = wp.array(self._first_node, dtype=wp.int32, device=device)
        self.corners: wp.array[Any] = wp.empty(self._pack_count * 9 * lanes, dtype=wp.float32, device=device)
        self.triangle: wp.array[Any] = wp.empty(self._pack_count * lanes, dtype=wp.int32, device=device)
        absent = np.repeat(np.array([np.inf, -np.inf], np.float32), 3 * lanes)
        self.bounds: wp.array[Any] = wp.array(np.tile(absent, sum(self._node_counts)), dtype=wp.float32, device=device)

    def build(self, casters: Casters) -> None:
        """Build the tree over all triangles of ``casters``; the same bits for every number of threads."""
        self._scale = casters.scale
        if self.triangle_count:
            margin = BOX_MARGIN_ULPS * ULP * casters.scale
            self.build_over(casters.on(self.context.device), *casters.bounds(), scale=casters.scale, margin=margin)

    def build_over(
        self,
        triangles: DeviceTriangles,
        low: NDArray[np.floating],
        high: NDArray[np.floating],
        *,
        scale: float,
        margin: float,
    ) -> None:
        """Build the tree over triangles in any space.

        Args:
            triangles: As many as the tree holds, at least 1.
            low, high: Bounds of their vertices.
            scale: Largest absolute coordinate that the triangle test of rays is to reckon with.
            margin: How much boxes are inflated.
        """
        self._scale = scale
        extent = float((high.astype(np.float64) - low).max())
        number_bits = self.triangle_count.bit_length()
        curve_bits = min((_KEY_BITS - number_bits) // 3, MOST_CURVE_BITS)
        cells_per_unit = (1 << curve_bits) / extent if extent > 0.0 else 0.0
        keys = wp.empty(self.triangle_count, dtype=wp.uint64, device=self.context.device)
        self._launch(
            write_keys,
            self.triangle_count,
            [triangles.vertices, triangles.triangles, wp.vec3(*low.tolist()), cells_per_unit, curve_bits, number_bits],
            [keys],
        )
        keys.assign(np.sort(keys.numpy()))
        self._launch(
            fill_packs,
            self._pack_count,
            [keys, triangles.vertices, triangles.triangles, number_bits, margin],
            [self.corners, self.triangle, self.bounds],
        )
        for level, node_count in enumerate(self._node_counts[:-1]):
            levels = [self._first_node[level], self._first_node[level + 1]]
            self._launch(enclose_children, node_count, levels, [self.bounds])

    def _launch(self, kernel: wp.Kernel, count: int, inputs: list[Any], outputs: list[Any]) -> None:
        launch(kernel, count, inputs, outputs, context=self.context)

    @property
    def levels(self) -> list[int]:
        """Number of each level's first node, from the parents of packs to the root."""
        return self._first_node

    def fits(self, casters: Casters) -> bool:
        """Return whether :meth:`build` may be called with these casters."""
        return casters.triangle_count == self.triangle_count

    def packed(self) -> Tree:
        """Return the tree, once built, for kernels."""
        tree: Any = Tree()
        tree.bounds, tree.corners, tree.triangle = self.bounds, self.corners, self.triangle
        tree.first_node = self._first_node_on_device
        tree.top = len(self._node_counts) - 1
        tree.scale = self._scale
        return cast("Tree", tree)
