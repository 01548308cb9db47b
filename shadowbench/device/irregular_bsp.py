"""The alias-free rasteriser (Aila & Laine 2004, section 5): triangles through a 2-D BSP over the samples.

:class:`IrregularBsp` builds the tree by alternating median splits and rasterises with occlusion culling;
:class:`BruteForce` tests every sample against every triangle, for small scenes and as the tree's oracle. Both give the
ground truth's shadows to the bit. Work below one fixed cut level is divided among threads by subtree, so results and
counters do not depend on the number of threads.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.blocker_bins import BlockerBins, Transmittances, let_light_through, of_batch
from shadowbench.device.blockers import Blocker
from shadowbench.device.irregular_bsp_kernels import (
    SAMPLE_BLOCK,
    Tree,
    build_subtrees,
    find_subtrees,
    join_level,
    list_by_subtree,
    prepare_blockers,
    rasterize_all,
    rasterize_subtrees,
    split_level,
    split_records,
)
from shadowbench.device.launch import Context, launch
from shadowbench.device.light_samples import WindowSamples, lay_down
from shadowbench.device.placed_triangles import TriangleBatch
from shadowbench.device.sample_scan import (
    SampleArrays,
    bytes_of_samples,
    light_fully,
    room_for_samples,
    write_visibility,
)

CELL_SAMPLES = 256
"""Most samples in a node that a picture shows (paper, Figure 4)."""

CUT_LEVEL = 6
"""Subtrees below this level are what threads own: 64, as many as a triangle's set of subtrees has bits."""


@dataclass(frozen=True)
class BspCounts:
    """What rasterising took.

    Attributes:
        leaves: Of the tree.
        visited: Nodes touched by a triangle, over all triangles.
        culled: Different nodes at which occlusion culling stopped a triangle.
        tested: Samples whose depth was tested against a triangle that covers or may cover them.
        refined: Those that float32 could not decide.
    """

    leaves: int
    visited: int
    culled: int
    tested: int
    refined: int


class IrregularBsp:
    """Samples of one window in a BSP; memory is kept between frames.

    Args:
        context: Where to run.
        leaf_size: A leaf holds fewer samples than this.
        culling: Whether nodes keep their largest unshadowed depth and stop triangles that cannot shadow anything.
    """

    def __init__(self, context: Context, *, leaf_size: int, culling: bool) -> None:
        self.context = context
        self._leaf_size, self._culling = leaf_size, culling
        self._bins = BlockerBins(context)
        self._capacity, self._node_capacity, self._translucency = -1, -1, False

    @property
    def kept_bytes(self) -> int:
        """Memory that stays alive between frames [bytes]."""
        if self._capacity < 0:
            return 0
        arrays = self._records.capacity + self._bounds.capacity + self._deepest.capacity
        return int(arrays) + bytes_of_samples(self.samples) + self._bins.kept_bytes

    def transform(self, window: WindowSamples, transmittances: Transmittances) -> None:
        """Transform a window's samples.

        Args:
            window: The samples.
            transmittances: Of the casters that will be rasterised.
        """
        self._transmittances = transmittances
        self._reserve(window.count, let_light_through(transmittances))
        self._window = window
        lay_down(window, self._records, self.context)

    def build(self) -> None:
        """Build the tree over the samples."""
        count = self._window.count
        levels = 0
        while -(-count >> levels) >= self._leaf_size:
            levels += 1
        self._reserve_nodes(levels)
        cut = min(levels, CUT_LEVEL)
        tree: Any = Tree()  # its members are Warp's types to a checker, Python's numbers to us
        tree.sample_count, tree.levels, tree.cut = count, levels, cut
        tree.bounds, tree.deepest = self._bounds, self._deepest
        self._tree = tree
        for level in range(cut):
            launch(
                split_level,
                1 << level,
                inputs=[count, level],
                outputs=[self._records],
                context=self.context,
                block_size=1,
            )
        launch(
            build_subtrees,
            1 << cut,
            inputs=[tree, self._culling, self._records],
            outputs=[self.samples],
            context=self.context,
            block_size=1,
        )
        for level in reversed(range(cut)):
            launch(join_level, 1 << level, inputs=[1 << level, tree], outputs=[], context=self.context)
        light_fully(self.samples)

    def cells(self) -> NDArray[np.float32]:
        """Return the bounds of the highest nodes with at most ``CELL_SAMPLES`` samples, shape [n, 4]."""
        levels = int(self._tree.levels)
        level = next((k for k in range(levels) if -(-self._window.count >> k) <= CELL_SAMPLES), levels)
        bounds: NDArray[np.float32] = self._bounds.numpy()[1 << level : 2 << level]
        return bounds

    def rasterize(self, casters: Iterable[TriangleBatch]) -> BspCounts:
        """Let triangles shadow the samples.

        Args:
            casters: Their batches, in file order.
        """
        was_culled = wp.zeros(2 << int(self._tree.levels), dtype=wp.uint8, device=self.context.device)
        counts = np.zeros(3, np.int64)
        for batch in casters:
            counts += self._rasterize(batch, was_culled)
        visited, tested, refined = (int(total) for total in counts)
        culled = int(np.count_nonzero(was_culled.numpy()))
        return BspCounts(1 << int(self._tree.levels), visited, culled, tested, refined)

    def _rasterize(self, triangles: TriangleBatch, was_culled: wp.array[Any]) -> NDArray[np.int64]:
        """Return the nodes visited, the samples tested and those refined; sets where culling stopped a triangle."""
        device, regions = self.context.device, 1 << int(self._tree.cut)
        lists, above = self._bins.fill(
            find_subtrees, list_by_subtree, triangles, regions, [self._window.space, self._tree], extra_counts=1
        )
        counters = wp.empty((regions, 3), dtype=wp.int64, device=device)
        launch(
            rasterize_subtrees,
            regions,
            inputs=[
                self._window.space,
                self._culling,
                self._window.position,
                of_batch(self._transmittances, triangles),
                lists,
            ],
            outputs=[self._tree, self.samples, was_culled, counters],
            context=self.context,
            block_size=1,
        )
        total: NDArray[np.int64] = counters.numpy().sum(axis=0)
        total[0] += above[0]
        return total

    def write(self, visibility: wp.array[Any]) -> None:
        """Set the visibility of all sampled points, float32, shape [point_count] or [point_count, 3]."""
        write_visibility(self.samples, self._window.count, visibility, self.context)

    def _reserve(self, count: int, translucency: bool) -> None:
        if count > self._capacity or translucency != self._translucency:
            device, self._capacity, self._translucency = self.context.device, count, translucency
            self._records = wp.empty(max(count, 1), dtype=wp.vec4, device=device)
            self.samples = room_for_samples(count, device, translucency=translucency)

    def _reserve_nodes(self, levels: int) -> None:
        if levels > self._node_capacity:
            self._node_capacity = levels
            self._bounds = wp.empty(2 << levels, dtype=wp.vec4, device=self.context.device)
            self._deepest = wp.empty(2 << levels, dtype=wp.float32, device=self.context.device)


class BruteForce:
    """Every sample against every triangle; see :class:`IrregularBsp`, whose interface it has."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._capacity, self._translucency = -1, False

    @property
    def kept_bytes(self) -> int:
        """Memory that stays alive between frames [bytes]."""
        return 0 if self._capacity < 0 else int(self._records.capacity) + bytes_of_samples(self.samples)

    def transform(self, window: WindowSamples, transmittances: Transmittances) -> None:
        """Transform a window's samples; see :meth:`IrregularBsp.transform`."""
        self._transmittances = transmittances
        self._window = window
        translucency = let_light_through(transmittances)
        if window.count > self._capacity or translucency != self._translucency:
            device, self._capacity, self._translucency = self.context.device, window.count, translucency
            self._records = wp.empty(window.count, dtype=wp.vec4, device=device)
            self.samples: SampleArrays = room_for_samples(window.count, device, translucency=translucency)
        lay_down(window, self._records, self.context)

    def build(self) -> None:
        """Take the samples as they are."""
        launch(split_records, self._window.count, inputs=[self._records], outputs=[self.samples], context=self.context)
        light_fully(self.samples)

    def cells(self) -> NDArray[np.float32]:
        """Return no box: there is no structure."""
        return np.zeros((0, 4), np.float32)

    def rasterize(self, casters: Iterable[TriangleBatch]) -> BspCounts:
        """Let triangles shadow the samples; no node is visited or culled."""
        counts = np.zeros(2, np.int64)
        for batch in casters:
            counts += self._rasterize(batch)
        tested, refined = (int(total) for total in counts)
        return BspCounts(0, 0, 0, tested, refined)

    def _rasterize(self, triangles: TriangleBatch) -> NDArray[np.int64]:
        device, space = self.context.device, self._window.space
        geometry = [triangles.vertices, triangles.triangles]
        blockers = wp.empty(triangles.triangle_count, dtype=Blocker, device=device)
        launch(
            prepare_blockers,
            triangles.triangle_count,
            inputs=[space, *geometry],
            outputs=[blockers],
            context=self.context,
        )
        blocks = -(-self._window.count // int(SAMPLE_BLOCK))
        counters = wp.empty((blocks, 2), dtype=wp.int64, device=device)
        launch(
            rasterize_all,
            blocks,
            inputs=[
                space,
                self._window.position,
                *geometry,
                of_batch(self._transmittances, triangles),
                blockers,
                self._window.count,
            ],
            outputs=[self.samples, counters],
            context=self.context,
        )
        total: NDArray[np.int64] = counters.numpy().sum(axis=0)
        return total

    def write(self, visibility: wp.array[Any]) -> None:
        """Set the visibility of all sampled points, float32, shape [point_count] or [point_count, 3]."""
        write_visibility(self.samples, self._window.count, visibility, self.context)
