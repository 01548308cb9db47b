"""Irregular z-buffer over strips and cells: the exact rasteriser that beats every tree tried.

Samples are sorted into strips in y and, in each strip, into cells of equal width in x, both by counting sort, so that a
triangle meets one contiguous run of samples a strip. Two layouts:

* ``uniform``: strips of equal height and cells over the whole width, which is the grid of lists of Johnson et al. 2004,
  "The irregular Z-buffer and its application to shadow mapping", section 4;
* ``adaptive``: strips of equal sample count and cells over each strip's own width.

Its weak point is strong clustering in y; the first histogram is fine enough for a ground seen at 600 : 1 depth.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.blocker_bins import BlockerBins, Transmittances, let_light_through, of_batch
from shadowbench.device.irregular_strips_kernels import (
    SAMPLE_BLOCK,
    Strip,
    count_rows,
    find_strips,
    list_by_strip,
    rasterize_strips,
    scatter_to_strips,
    sort_into_cells,
)
from shadowbench.device.launch import Context, launch
from shadowbench.device.light_samples import WindowSamples, exclusive_sums, lay_down
from shadowbench.device.placed_triangles import TriangleBatch
from shadowbench.device.sample_scan import bytes_of_samples, light_fully, room_for_samples, write_visibility

FINE_ROWS = 1 << 15
"""Rows of the first histogram, from which strips of equal count are cut."""

STRIP_ASPECT = 64.0
"""Samples in a strip per number of strips: how wide strips are for their height. Between 48 and 96, with 1024 cells,
rasterising was fastest at 1 K to 1 M triangles; with more strips, small triangles are listed in several of them."""


CELLS_SHOWN = 32
"""Cells side by side that a picture shows as one."""


@dataclass(frozen=True)
class StripCounts:
    """What rasterising took.

    Attributes:
        runs: Pairs of a triangle and a strip in which it met samples.
        tested: Samples whose depth was tested against a triangle that covers or may cover them.
        refined: Those that float32 could not decide.
    """

    runs: int
    tested: int
    refined: int


class IrregularStrips:
    """Samples of one window in strips and cells; memory is kept between frames.

    Args:
        context: Where to run.
        layout: See the module.
        resolution: Strips and cells of the uniform layout.
        cell_count: Cells a strip of the adaptive layout.
    """

    def __init__(
        self, context: Context, *, layout: Literal["adaptive", "uniform"], resolution: int, cell_count: int = 1024
    ) -> None:
        self.context = context
        self._layout: Literal["adaptive", "uniform"] = layout
        self._resolution = resolution
        self._cell_count = resolution if layout == "uniform" else cell_count
        self._bins = BlockerBins(context)
        self._capacity, self._translucency = -1, False
        self._first_of_cell: wp.array[Any] | None = None

    @property
    def kept_bytes(self) -> int:
        """Memory that stays alive between frames [bytes]."""
        if self._first_of_cell is None:
            return 0
        arrays = 2 * self._sorted.capacity + self._scratch.capacity + self._first_of_cell.capacity
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
        """Sort the samples into strips and cells."""
        device, count = self.context.device, self._window.count
        blocks = -(-count // int(SAMPLE_BLOCK))
        row_count = self._resolution if self._layout == "uniform" else FINE_ROWS
        in_row = wp.zeros((blocks, row_count), dtype=wp.int32, device=device)
        launch(count_rows, blocks, inputs=[self._records, count], outputs=[in_row], context=self.context, block_size=1)
        by_row = in_row.numpy()
        strip_of_row = self._cut_strips(by_row.sum(axis=0, dtype=np.int32), count)
        self.strip_count = int(strip_of_row[-1]) + 1
        self._strip_of_row = as_warp(strip_of_row, wp.int32, device)

        first_row = np.searchsorted(strip_of_row, np.arange(self.strip_count, dtype=np.int32))
        begins = exclusive_sums(np.add.reduceat(by_row, first_row, axis=1))
        first_sample = np.append(begins[0], np.int32(count))
        launch(
            scatter_to_strips,
            blocks,
            inputs=[self._records, count, self._strip_of_row],
            outputs=[as_warp(begins, wp.int32, device), self._sorted],
            context=self.context,
            block_size=1,
        )
        self._strips = wp.empty(self.strip_count, dtype=Strip, device=device)
        cells = (self.strip_count, self._cell_count + 1)
        if self._first_of_cell is None or self._first_of_cell.shape[0] < cells[0]:
            self._first_of_cell = wp.empty(cells, dtype=wp.int32, device=device)
        launch(
            sort_into_cells,
            self.strip_count,
            inputs=[
                self._sorted,
                as_warp(first_sample, wp.int32, device),
                self._cell_count,
                self._layout == "uniform",
                self._scratch,
            ],
            outputs=[self._strips, self._first_of_cell, self.samples],
            context=self.context,
        )
        light_fully(self.samples)

    def cells(self) -> NDArray[np.float32]:
        """Return boxes of ``CELLS_SHOWN`` neighbouring cells each, as high as their strip's samples, shape [n, 4]."""
        strips = self._strips.numpy()
        strips = strips[strips["low"][:, 1] <= strips["high"][:, 1]]  # the others hold no sample and have no bounds
        edges = np.arange(0, self._cell_count + CELLS_SHOWN, CELLS_SHOWN).clip(max=self._cell_count)
        x = strips["first_x"][:, None] + edges / strips["cells_per_unit"][:, None]
        y = (np.broadcast_to(strips[bound][:, 1, None], x.shape)[:, 1:] for bound in ("low", "high"))
        low, high = y
        return np.stack([x[:, :-1], low, x[:, 1:], high], axis=-1).reshape(-1, 4).astype(np.float32)

    def rasterize(self, casters: Iterable[TriangleBatch]) -> StripCounts:
        """Let triangles shadow the samples.

        Args:
            casters: Their batches, in file order.
        """
        counts = np.zeros(3, np.int64)
        for batch in casters:
            counts += self._rasterize(batch)
        return StripCounts(*(int(total) for total in counts))

    def _rasterize(self, triangles: TriangleBatch) -> NDArray[np.int64]:
        device = self.context.device
        lists, _ = self._bins.fill(
            find_strips, list_by_strip, triangles, self.strip_count, [self._window.space, self._strip_of_row]
        )
        counters = wp.empty((self.strip_count, 3), dtype=wp.int32, device=device)
        launch(
            rasterize_strips,
            self.strip_count,
            inputs=[
                self._window.space,
                self._window.position,
                of_batch(self._transmittances, triangles),
                lists,
                self._strips,
                self._first_of_cell,
            ],
            outputs=[self.samples, counters],
            context=self.context,
        )
        total: NDArray[np.int64] = counters.numpy().sum(axis=0, dtype=np.int64)
        return total

    def write(self, visibility: wp.array[Any]) -> None:
        """Set the visibility of all sampled points, float32, shape [point_count] or [point_count, 3]."""
        write_visibility(self.samples, self._window.count, visibility, self.context)

    def _cut_strips(self, in_row: np.ndarray, count: int) -> np.ndarray:
        if self._layout == "uniform":
            return np.arange(len(in_row), dtype=np.int32)
        wanted = max(1, int((count / STRIP_ASPECT) ** 0.5))
        before = np.cumsum(in_row, dtype=np.int64) - in_row
        strip = np.minimum((before + in_row // 2) * wanted // count, wanted - 1)
        return np.cumsum(np.diff(strip, prepend=strip[0]) > 0, dtype=np.int32)  # leave out empty strips

    def _reserve(self, count: int, translucency: bool) -> None:
        if count <= self._capacity and translucency == self._translucency:
            return
        device, self._capacity, self._translucency = self.context.device, count, translucency
        self._records, self._sorted = (wp.empty(max(count, 1), dtype=wp.vec4, device=device) for _ in range(2))
        self._scratch = wp.empty(max(count, 1), dtype=wp.int32, device=device)
        self.samples = room_for_samples(count, device, translucency=translucency)
