"""Counting sorts of samples into strips and cells: the steps that sorting into the strip layout repeats.

They are bound by memory, and native because Warp's code for arrays takes two to three times as long as the sorts
themselves. Each has its twin in plain Warp, ``..._plainly``: the meaning, and the oracle in tests. All are stable, so
that the order of samples never depends on how work is divided.
"""

import warp as wp

from shadowbench.device.launch import kernel_options
from shadowbench.device.sample_scan import SampleArrays
from shadowbench.device.sample_space import FARTHEST

wp.set_module_options(kernel_options(native=True))


@wp.func
def slot(coordinate: wp.float32, low: wp.float32, per_unit: wp.float32, count: wp.int32):
    """Which of ``count`` equal intervals holds a coordinate; ascending with it, to the bit."""
    return wp.int32(wp.clamp((coordinate - low) * per_unit, 0.0, wp.float32(count - 1)))


@wp.func
def row_of(y: wp.float32, row_count: wp.int32):
    """The fine row that holds y."""
    return slot(y, -1.0, 0.5 * wp.float32(row_count), row_count)


@wp.func_native("""
    const wp::vec4* r = (const wp::vec4*)records.data;
    const float last = (float)(row_count - 1), per_unit = 0.5f * (float)row_count;
    for (int i = begin; i < end; ++i) {
        const float at = (r[i][1] + 1.0f) * per_unit;
        ++count.data[(int)(at < 0.0f ? 0.0f : at > last ? last : at)];
    }
""")
def count_by_row(
    records: wp.array[wp.vec4], begin: wp.int32, end: wp.int32, row_count: wp.int32, count: wp.array[wp.int32]
):
    """Histogram of records' fine rows."""


@wp.func
def count_by_row_plainly(
    records: wp.array[wp.vec4], begin: wp.int32, end: wp.int32, row_count: wp.int32, count: wp.array[wp.int32]
):
    """The meaning of :func:`count_by_row`."""
    for i in range(begin, end):
        row = row_of(records[i][1], row_count)
        count[row] = count[row] + 1


@wp.func_native("""
    const wp::vec4* r = (const wp::vec4*)records.data;
    wp::vec4* sorted = by_strip.data; int* next = cursor.data;
    const int row_count = strip_of_row.shape[0];
    const float last = (float)(row_count - 1), per_unit = 0.5f * (float)row_count;
    for (int i = begin; i < end; ++i) {
        const float at = (r[i][1] + 1.0f) * per_unit;
        sorted[next[strip_of_row.data[(int)(at < 0.0f ? 0.0f : at > last ? last : at)]]++] = r[i];
    }
""")
def scatter_by_row(
    records: wp.array[wp.vec4],
    begin: wp.int32,
    end: wp.int32,
    strip_of_row: wp.array[wp.int32],
    cursor: wp.array[wp.int32],
    by_strip: wp.array[wp.vec4],
):
    """Move each record to where its strip's cursor stands."""


@wp.func
def scatter_by_row_plainly(
    records: wp.array[wp.vec4],
    begin: wp.int32,
    end: wp.int32,
    strip_of_row: wp.array[wp.int32],
    cursor: wp.array[wp.int32],
    by_strip: wp.array[wp.vec4],
):
    """The meaning of :func:`scatter_by_row`."""
    for i in range(begin, end):
        s = strip_of_row[row_of(records[i][1], strip_of_row.shape[0])]
        by_strip[cursor[s]] = records[i]
        cursor[s] = cursor[s] + 1


@wp.func_native("""
    typedef float record __attribute__((ext_vector_type(4)));
    const record* r = (const record*)by_strip.data;
    float* xs = samples.x.data; float* ys = samples.y.data; float* depths = samples.depth.data;
    int* from = samples.source.data; int* cell_of = scratch.data; int* cell = cells.data;
    const float last = (float)(cell_count - 1);
    for (int c = 0; c <= cell_count; ++c) cell[c] = 0;
    for (int i = begin; i < end; ++i) {
        const float at = (r[i][0] - first_x) * cells_per_unit;
        cell_of[i] = (int)(at < 0.0f ? 0.0f : at > last ? last : at);
    }
    for (int i = begin; i < end; ++i) ++cell[cell_of[i] + 1];
    cell[0] = begin;
    for (int c = 0; c < cell_count; ++c) cell[c + 1] += cell[c];
    for (int i = begin; i < end; ++i) from[cell[cell_of[i]]++] = i;
    // each cell's cursor has become the next cell's beginning: move them back by one
    for (int c = cell_count; c > 0; --c) cell[c] = cell[c - 1];
    cell[0] = begin;
    // gathering in the new order writes each array in a row, where scattering would jump about in four
    for (int k = begin; k < end; ++k) {
        const int i = from[k];
        xs[k] = r[i][0]; ys[k] = r[i][1]; depths[k] = r[i][2];
        __builtin_memcpy(from + k, (const char*)(r + i) + 12, 4);
    }
""")
def sort_by_cell(
    by_strip: wp.array[wp.vec4],
    begin: wp.int32,
    end: wp.int32,
    first_x: wp.float32,
    cells_per_unit: wp.float32,
    cell_count: wp.int32,
    scratch: wp.array[wp.int32],
    cells: wp.array[wp.int32],
    samples: SampleArrays,
):
    """Counting sort of a strip by cell; native, since it is half of all sorting."""


@wp.func
def sort_by_cell_plainly(
    by_strip: wp.array[wp.vec4],
    begin: wp.int32,
    end: wp.int32,
    first_x: wp.float32,
    cells_per_unit: wp.float32,
    cell_count: wp.int32,
    cells: wp.array[wp.int32],
    samples: SampleArrays,
):
    """The meaning of :func:`sort_by_cell`."""
    for cell in range(cell_count + 1):
        cells[cell] = 0
    for i in range(begin, end):
        cell = slot(by_strip[i][0], first_x, cells_per_unit, cell_count)
        cells[cell + 1] = cells[cell + 1] + 1
    cells[0] = begin
    for cell in range(cell_count):
        cells[cell + 1] = cells[cell + 1] + cells[cell]
    for i in range(begin, end):
        r = by_strip[i]
        cell = slot(r[0], first_x, cells_per_unit, cell_count)
        k = cells[cell]
        cells[cell] = k + 1
        samples.x[k] = r[0]
        samples.y[k] = r[1]
        samples.depth[k] = r[2]
        samples.source[k] = wp.cast(r[3], wp.int32)
    for back in range(cell_count):
        cells[cell_count - back] = cells[cell_count - back - 1]
    cells[0] = begin


Bounds = wp.types.vector(length=6, dtype=wp.float32)


@wp.func_native("""
    typedef float record __attribute__((ext_vector_type(4)));
    const record* r = (const record*)records.data;
    record low = 3.0e38f, high = -3.0e38f;
    for (int i = begin; i < end; ++i) {
        low = __builtin_elementwise_min(low, r[i]);
        high = __builtin_elementwise_max(high, r[i]);
    }
    wp::vec_t<6, float> bounds;
    for (int k = 0; k < 3; ++k) { bounds[k] = low[k]; bounds[3 + k] = high[k]; }
    return bounds;
""")
def bounds_of(records: wp.array[wp.vec4], begin: wp.int32, end: wp.int32) -> Bounds:
    """Least and most (x, y, depth) of a run of records."""


@wp.func
def bounds_of_plainly(records: wp.array[wp.vec4], begin: wp.int32, end: wp.int32):
    """The meaning of :func:`bounds_of`."""
    low = wp.vec4(FARTHEST, FARTHEST, FARTHEST, FARTHEST)
    high = -low
    for i in range(begin, end):
        low = wp.min(low, records[i])
        high = wp.max(high, records[i])
    return Bounds(low[0], low[1], low[2], high[0], high[1], high[2])
