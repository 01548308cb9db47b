"""Kernels of the strip layout: sorting samples into cells, and rasterising triangles over them.

The window is cut into many fine rows of equal height, of which strips are made; ``strip_of_row`` says which strip holds
each of them, ascending.
"""

import warp as wp

from shadowbench.device.blocker_batches import BATCH, prepare_batch
from shadowbench.device.blocker_bins import (
    TRIANGLE_BLOCK,
    BlockerLists,
    Transmittances,
    transmittance_of,
)
from shadowbench.device.blockers import Blocker
from shadowbench.device.exact_decision import shadow_run
from shadowbench.device.launch import kernel_options
from shadowbench.device.sample_scan import DOUBTFUL_ROOM, SampleArrays
from shadowbench.device.sample_sorting import bounds_of, count_by_row, scatter_by_row, slot, sort_by_cell
from shadowbench.device.sample_space import SampleSpace
from shadowbench.device.strip_listing import count_strips, list_in_strips, strips_met

wp.set_module_options(kernel_options(native=True))

SAMPLE_BLOCK = wp.constant(1 << 17)
"""Samples a kernel handles in a row; fixed, so that their order never depends on the threads."""


@wp.struct
class Strip:
    """A strip's samples.

    Attributes:
        low, high: Bounds of (x, y).
        deepest: Largest depth.
        first_x: Where its first cell begins.
        cells_per_unit: Cells per unit of x.
    """

    low: wp.vec2
    high: wp.vec2
    deepest: wp.float32
    first_x: wp.float32
    cells_per_unit: wp.float32


# --------------------------------------------------------------------------------------------- sorting the samples


@wp.kernel
def count_rows(
    first: wp.int32,
    # inputs
    records: wp.array[wp.vec4],
    sample_count: wp.int32,
    # outputs
    count: wp.array2d[wp.int32],
):
    """Histogram of the fine rows of a block of samples."""
    block = wp.tid() + first
    count_by_row(
        records, block * SAMPLE_BLOCK, wp.min((block + 1) * SAMPLE_BLOCK, sample_count), count.shape[1], count[block]
    )


@wp.kernel
def scatter_to_strips(
    first: wp.int32,
    # inputs
    records: wp.array[wp.vec4],
    sample_count: wp.int32,
    strip_of_row: wp.array[wp.int32],
    # outputs
    cursor: wp.array2d[wp.int32],
    by_strip: wp.array[wp.vec4],
):
    """Counting sort by strip; ``cursor`` says where each block goes on in each strip."""
    block = wp.tid() + first
    end = wp.min((block + 1) * SAMPLE_BLOCK, sample_count)
    scatter_by_row(records, block * SAMPLE_BLOCK, end, strip_of_row, cursor[block], by_strip)


@wp.func
def sort_strip(
    by_strip: wp.array[wp.vec4],
    begin: wp.int32,
    end: wp.int32,
    cell_count: wp.int32,
    whole_width: wp.bool,
    scratch: wp.array[wp.int32],
    cells: wp.array[wp.int32],
    samples: SampleArrays,
):
    """Bound a strip and sort its samples into cells."""
    bounds = bounds_of(by_strip, begin, end)
    strip = Strip()
    strip.low = wp.vec2(bounds[0], bounds[1])
    strip.high = wp.vec2(bounds[3], bounds[4])
    strip.deepest = bounds[5]
    strip.first_x = bounds[0]
    width = bounds[3] - bounds[0]
    if whole_width:
        strip.first_x = -1.0
        width = 2.0
    strip.cells_per_unit = wp.float32(cell_count) / wp.max(width, 1.0e-30)
    sort_by_cell(by_strip, begin, end, strip.first_x, strip.cells_per_unit, cell_count, scratch, cells, samples)
    return strip


@wp.kernel
def sort_into_cells(
    first: wp.int32,
    # inputs
    by_strip: wp.array[wp.vec4],
    first_sample: wp.array[wp.int32],
    cell_count: wp.int32,
    whole_width: wp.bool,
    scratch: wp.array[wp.int32],
    # outputs
    strips: wp.array[Strip],
    first_of_cell: wp.array2d[wp.int32],
    samples: SampleArrays,
):
    """In each strip a counting sort by cell along x.

    Args:
        whole_width: Whether cells divide the window's width rather than the strip's own.
        scratch: Of no meaning, shape [sample_count].
    """
    s = wp.tid() + first
    cells = first_of_cell[s]
    strips[s] = sort_strip(
        by_strip, first_sample[s], first_sample[s + 1], cell_count, whole_width, scratch, cells, samples
    )


# --------------------------------------------------------------------------------------------- binning triangles


@wp.kernel
def find_strips(
    first: wp.int32,
    # inputs
    space: SampleSpace,
    strip_of_row: wp.array[wp.int32],
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    # outputs
    found: wp.array[wp.uint64],
    count: wp.array2d[wp.int32],
):
    """The strips that each triangle meets; counted by block and strip."""
    block = wp.tid() + first
    begin = block * TRIANGLE_BLOCK
    end = wp.min(begin + TRIANGLE_BLOCK, indices.shape[0] / 3)
    strips_met(space, strip_of_row, vertices, indices, begin, end, found)
    count_strips(found, begin, end, count[block])


@wp.kernel
def list_by_strip(
    first: wp.int32,
    # inputs
    found: wp.array[wp.uint64],
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    cursor: wp.array2d[wp.int32],
    # outputs
    lists: BlockerLists,
):
    """Copy each triangle into the lists of its strips."""
    block = wp.tid() + first
    begin = block * TRIANGLE_BLOCK
    end = wp.min(begin + TRIANGLE_BLOCK, indices.shape[0] / 3)
    list_in_strips(found, vertices, indices, begin, end, cursor[block], lists)


# --------------------------------------------------------------------------------------------- rasterising


@wp.func
def cut_by_edge(edge: wp.vec3, y_low: wp.float32, y_high: wp.float32, x: wp.vec2):
    """Narrow the range of x to where an edge function can be positive for some y of a range.

    The slack covers the roundings here; where the edge is nearly horizontal it says nothing.
    """
    most = wp.max(edge[1] * y_low, edge[1] * y_high) + edge[2] + 1.0e-5
    if edge[0] > 1.0e-3:
        x[0] = wp.max(x[0], -most / edge[0])
    elif edge[0] < -1.0e-3:
        x[1] = wp.min(x[1], -most / edge[0])
    return x


@wp.func
def run_of(blocker: Blocker, strip: Strip, cells: wp.array[wp.int32]):
    """The run of samples of a strip that the triangle may cover; (0, 0) if none."""
    box = blocker.box
    x = wp.vec2(wp.max(box.low[0], strip.low[0]), wp.min(box.high[0], strip.high[0]))
    y_low = wp.max(box.low[1], strip.low[1])
    y_high = wp.min(box.high[1], strip.high[1])
    if x[0] > x[1] or y_low > y_high or box.nearest >= strip.deepest:
        return wp.vec2i(0, 0)
    if box.high[1] - box.low[1] > 2.0 * (y_high - y_low):  # the strip cuts a slice out of the triangle
        x = cut_by_edge(blocker.edge_a, y_low, y_high, x)
        x = cut_by_edge(blocker.edge_b, y_low, y_high, x)
        x = cut_by_edge(blocker.edge_c, y_low, y_high, x)
        if x[0] > x[1]:
            return wp.vec2i(0, 0)
    cell_count = cells.shape[0] - 1
    left = slot(x[0], strip.first_x, strip.cells_per_unit, cell_count)
    right = slot(x[1], strip.first_x, strip.cells_per_unit, cell_count)
    return wp.vec2i(cells[left], cells[right + 1])


@wp.kernel
def rasterize_strips(
    first: wp.int32,
    # inputs
    space: SampleSpace,
    position: wp.array[wp.vec3],
    transmittances: Transmittances,
    lists: BlockerLists,
    strips: wp.array[Strip],
    first_of_cell: wp.array2d[wp.int32],
    # outputs
    samples: SampleArrays,
    counters: wp.array2d[wp.int32],
):
    """Every listed triangle over its run of samples, a strip at a time.

    Counters of a strip: runs scanned, samples tested, samples sent to the exact predicate.
    """
    s = wp.tid() + first
    strip = strips[s]
    cells = first_of_cell[s]
    doubtful = wp.zeros(shape=(DOUBTFUL_ROOM,), dtype=wp.int32)
    runs = wp.int32(0)
    tested = wp.int32(0)
    refined = wp.int32(0)
    blockers = wp.zeros(shape=(BATCH,), dtype=Blocker)
    for begin in range(lists.first[s], lists.first[s + 1], BATCH):
        count = wp.min(BATCH, lists.first[s + 1] - begin)
        prepare_batch(space, lists.corner, begin, count, blockers)
        for j in range(count):
            run = run_of(blockers[j], strip, cells)
            if run[0] < run[1]:
                runs += 1
                k = begin + j
                of_run, doubted = shadow_run(
                    samples,
                    position,
                    space.light,
                    space.tolerance,
                    blockers[j],
                    lists.corner[3 * k],
                    lists.corner[3 * k + 1],
                    lists.corner[3 * k + 2],
                    transmittance_of(transmittances, lists.number[k]),
                    run[0],
                    run[1],
                    doubtful,
                )
                tested += of_run
                refined += doubted
    counters[s, 0] = runs
    counters[s, 1] = tested
    counters[s, 2] = refined
