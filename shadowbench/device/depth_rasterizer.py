"""Watertight rasterisation of triangles into depth buffers, for shadow maps and for the camera pass alike.

A draw projects the triangles, bins them by bands of rows, and fills the bands side by side, each in the order of the
triangles (kernels: :mod:`shadowbench.device.depth_rasterizer_kernels`). In each row a triangle covers the span between
the crossings of two edges with the row's centre line. A crossing is computed in float64 from the edge's upper vertex
and slope, which are the same for both triangles at an edge: they round it to the same texel, and a closed surface has
no crack and no doubly covered texel, by construction. Nothing is accumulated from texel to texel or from row to row,
so that the picture is the same, bit for bit, for every number of threads.

Conventions of windows, depths and projections are those of :mod:`shadowbench.light_space`. The bodies that fill rows
are native, so that this runs on the CPU only.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.depth_rasterizer_kernels import (
    Window,
    count_in_bands,
    fill_depth,
    fill_depth_and_ids,
    find_bands,
    sort_into_bands,
)
from shadowbench.device.launch import Context, launch

_BAND_BYTES = 1 << 19
"""Largest part of the buffers that a band holds: about a core's second-level cache."""

_BANDS_PER_THREAD = 16
_SHORTEST_BAND = 4
"""Several threads get at least so many bands each, so that cuts between bands can even out the work, unless bands would
have fewer rows: a triangle is set up anew in each band."""

_BLOCKS_PER_THREAD = 4
_SHORTEST_BLOCK = 1 << 12
_SHORTEST_SORTING_BLOCK = 1 << 16
"""Least numbers of triangles worth handing to a thread: to find their bands (30 ns each), to sort them (5 ns each)."""

_ENTRY_WORK, _TEXEL_WORK, _LEAST_BLOCK_WORK = 100.0, 0.5, 2.0e5
"""Rough costs of drawing a triangle, of clearing and covering a texel; the least worth handing to a thread [ns]."""

_CACHE_LINE = 16
"""Numbers between the counters of two blocks, so that threads do not contend for a line of the cache."""

_LARGEST_CHUNK = 1 << 20
_MOST_ENTRIES = 1 << 25
"""Triangles are drawn in chunks of at most the first number, and so that bins hold at most the second."""


class DepthRasterizer:
    """A depth buffer that triangles are drawn into, with the number of the triangle seen at each texel if wanted.

    A fragment's depth is that of its triangle at the texel's centre. It is clamped to the triangle's own range, which
    only matters for slivers seen edge-on, and to 0 from below: what lies between an orthographic light and its near
    plane casts from the plane. The nearest fragment is kept; of equally near ones, the first drawn. An empty texel has
    depth 1, so that fragments at depth 1 or beyond, their offset included, are never kept. Both sides of a triangle
    are drawn.

    Args:
        width, height: Size of the buffer [texels], at least 1 each.
        context: Where to run.
        keep_ids: Whether to keep triangle numbers too.
        depth: Memory to draw into, contiguous float32, shape [height, width]; allocated if not given.

    Raises:
        ValueError: The size is not positive, larger than 2³¹ texels, or not that of ``depth``.
    """

    def __init__(
        self,
        width: int,
        height: int,
        context: Context,
        *,
        keep_ids: bool = False,
        depth: wp.array[Any] | None = None,
    ) -> None:
        self._bins = TriangleBins(width, height, context, bytes_per_texel=8 if keep_ids else 4)
        if depth is None:
            depth = wp.empty((height, width), dtype=wp.float32, device=context.device)
        elif depth.shape != (height, width) or not depth.is_contiguous:
            raise ValueError(f"depth must be contiguous with shape {(height, width)}, not {depth.shape}")
        self._depth = depth
        self._ids = wp.empty((height, width), dtype=wp.int32, device=context.device) if keep_ids else None
        self._flat = [depth.flatten(), None if self._ids is None else self._ids.flatten()]
        self._is_clear_due = True

    @property
    def depth(self) -> wp.array[Any]:
        """Depth of the nearest fragment, 1 where there is none; float32, shape [height, width]."""
        self._clear_if_due()
        return self._depth

    @property
    def ids(self) -> wp.array[Any] | None:
        """Number of the nearest fragment's triangle, -1 where there is none; int32, shape [height, width]."""
        self._clear_if_due()
        return self._ids

    def clear(self) -> None:
        """Empty the buffers: at the next draw, band by band while each is in the cache, or when next looked at."""
        self._is_clear_due = True

    def draw(
        self,
        vertices: wp.array[Any],
        triangles: wp.array[Any],
        projection: NDArray[np.float64],
        *,
        near: float | None,
        first_triangle: int = 0,
        slope_bias: float = 0.0,
        constant_bias: float = 0.0,
    ) -> None:
        """Draw triangles over what the buffers hold.

        Args:
            vertices: World positions, finite, wp.vec3, shape [vertex_count].
            triangles: Vertex indices, all valid, int32, shape [3 · triangle_count] or [triangle_count, 3].
            projection: Rows (u·w, v·w, depth, w), float64, shape [4, 4].
            near: Distance w of the near plane, positive, where triangles are clipped; ``None`` if w is 1 everywhere.
            first_triangle: Added to the triangle's index for its number.
            slope_bias, constant_bias: Polygon offset: ``m · slope_bias + constant_bias`` is added to a fragment's
                depth before it is compared and stored, m being the larger of the triangle's depth changes to the
                next column and the next row.

        Raises:
            ValueError: ``near`` is not positive.
        """
        for chunk in self._bins.of(vertices, triangles, projection, near):
            launch(
                fill_depth if self._ids is None else fill_depth_and_ids,
                self._bins.band_count,
                inputs=[*chunk, first_triangle, slope_bias, constant_bias, self._is_clear_due],
                outputs=self._flat,
                context=self._bins.context,
                cuts=self._bins.cuts,
            )
            self._is_clear_due = False
        self._clear_if_due()

    def finish(self) -> None:
        """Empty the buffers if that is due still, since nothing was drawn: for those who hold ``depth``'s memory."""
        self._clear_if_due()

    def _clear_if_due(self) -> None:
        if self._is_clear_due:
            self._depth.fill_(1.0)
            if self._ids is not None:
                self._ids.fill_(-1)
            self._is_clear_due = False


class FragmentCounter:
    """Counts how many triangles cover each texel: the picture of overdraw, and the exact test for cracks.

    Args:
        width, height: Size of the buffer [texels], at least 1 each.
        context: Where to run.

    Attributes:
        counts: Triangles drawn that cover the texel's centre and lie in front of the near plane, whatever their
            depth; int32, shape [height, width].

    Raises:
        ValueError: The size is not positive, or larger than 2³¹ texels.
    """

    def __init__(self, width: int, height: int, context: Context) -> None:
        self._bins = TriangleBins(width, height, context, bytes_per_texel=4)
        self.counts: wp.array[Any] = wp.zeros((height, width), dtype=wp.int32, device=context.device)

    def clear(self) -> None:
        """Set all counts to 0."""
        self.counts.zero_()

    def draw(
        self, vertices: wp.array[Any], triangles: wp.array[Any], projection: NDArray[np.float64], *, near: float | None
    ) -> None:
        """Count triangles; arguments as in :meth:`DepthRasterizer.draw`."""
        for chunk in self._bins.of(vertices, triangles, projection, near):
            launch(
                count_in_bands,
                self._bins.band_count,
                inputs=[*chunk],
                outputs=[self.counts],
                context=self._bins.context,
                cuts=self._bins.cuts,
            )


class TriangleBins:
    """Triangles binned by the bands of rows of a window, for the kernels that fill bands (here and in `depth_layers`).

    Args:
        width, height: Size of the window [texels].
        context: Where to run.
        bytes_per_texel: What a band's kernel touches, so that a band fits a core's cache.

    Raises:
        ValueError: The size is not positive, or larger than 2³¹ texels.
    """

    def __init__(self, width: int, height: int, context: Context, *, bytes_per_texel: int) -> None:
        if width < 1 or height < 1 or width * height >= 1 << 31:
            raise ValueError(f"a buffer of {width} by {height} texels; it has at least 1 and less than 2**31 texels")
        self.context = context
        self._width, self._height = width, height
        self._band_height = max(1, min(height, _BAND_BYTES // (bytes_per_texel * width)))
        if context.threads > 1:
            evened = _ceil_div(height, _BANDS_PER_THREAD * context.threads)
            self._band_height = min(self._band_height, max(_SHORTEST_BAND, evened))
        self.band_count = _ceil_div(height, self._band_height)
        self._chunk_length = min(_LARGEST_CHUNK, _MOST_ENTRIES // self.band_count)
        self.cuts: list[int] = []
        self._bands = wp.empty(0, dtype=wp.vec2i, device=context.device)
        self._counts = wp.empty((0, 0), dtype=wp.int32, device=context.device)
        self._entries = wp.empty(0, dtype=wp.int32, device=context.device)

    def of(
        self, vertices: wp.array[Any], triangles: wp.array[Any], projection: NDArray[np.float64], near: float | None
    ) -> Iterator[tuple[Any, ...]]:
        """Yield by chunks what the filling kernels read: window, vertices, triangles, ends of entries, entries."""
        if near is not None and not near > 0.0:
            raise ValueError(f"the near plane of a perspective view lies at a positive w, not {near}")
        window = Window()
        size = np.array([[self._width], [self._height], [1.0], [1.0]])
        window.from_world = wp.mat44d(*(projection * size).ravel())
        window.near = wp.float64(near or 0.0)
        window.width, window.height = wp.int32(self._width), wp.int32(self._height)
        window.band_height = wp.int32(self._band_height)
        if triangles.ndim > 1:
            triangles = triangles.flatten()
        triangle_count = triangles.size // 3
        for begin in range(0, triangle_count, self._chunk_length):
            end = min(begin + self._chunk_length, triangle_count)
            yield window, vertices, triangles, *self._bin(window, vertices, triangles, begin, end)

    def _bin(
        self, window: Any, vertices: wp.array[Any], triangles: wp.array[Any], begin: int, end: int
    ) -> tuple[wp.array[Any], wp.array[Any]]:
        device, threads = self.context.device, self.context.threads
        block_count = 1 if threads == 1 else min(_BLOCKS_PER_THREAD * threads, _ceil_div(end - begin, _SHORTEST_BLOCK))
        block_length = _ceil_div(end - begin, block_count)
        if self._bands.size < end - begin:
            self._bands = wp.empty(end - begin, dtype=wp.vec2i, device=device)
        if self._counts.shape[0] != block_count:
            self._counts = wp.empty((block_count, self.band_count + _CACHE_LINE), dtype=wp.int32, device=device)
        launch(
            find_bands,
            block_count,
            inputs=[window, vertices, triangles, begin, end, block_length],
            outputs=[self._bands, self._counts],
            context=self.context,
            block_size=1,
        )

        # Band by band, and in each band block by block: where the block's entries begin, and after sorting, end.
        counted = self._counts.numpy().T[: self.band_count]
        ends = np.cumsum(counted).reshape(counted.shape)
        counted[:] = ends - counted
        if self._entries.size < ends[-1, -1]:
            self._entries = wp.empty(int(ends[-1, -1]), dtype=wp.int32, device=device)
        if threads > 1:
            self.cuts = self._cuts_by_work(ends[:, -1])
        launch(
            sort_into_bands,
            block_count,
            inputs=[self._bands, begin, end, block_length],
            outputs=[self._counts, self._entries],
            context=self.context,
            block_size=_ceil_div(_SHORTEST_SORTING_BLOCK, block_length),
        )
        return self._counts, self._entries

    def _cuts_by_work(self, band_ends: NDArray[np.int64]) -> list[int]:
        """Cut the bands into blocks of about equal work, several a thread, unless that makes the blocks too short."""
        work = _ENTRY_WORK * band_ends + _TEXEL_WORK * self._width * self._band_height * np.arange(
            1, len(band_ends) + 1
        )
        block_count = min(_BLOCKS_PER_THREAD * self.context.threads, int(work[-1] / _LEAST_BLOCK_WORK))
        cuts = np.searchsorted(work, work[-1] * np.arange(1, block_count) / max(1, block_count)) + 1
        return [int(cut) for cut in np.unique(cuts) if cut < self.band_count]


def _ceil_div(a: int, b: int) -> int:
    return -(-a // b)
