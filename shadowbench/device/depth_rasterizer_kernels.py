"""Kernels of the depth rasteriser: bin triangles by bands of rows, then fill every band in the order of the triangles.

A *band* is a run of whole rows that fits a core's cache. Bands share no texel, so that they can be filled side by side
and the result does not depend on how. The host side is :mod:`shadowbench.device.depth_rasterizer`.
"""

import warp as wp

from shadowbench.device.depth_rows import (
    fill_depths,
    fill_ids,
    keep_nearest_linear,
    keep_nearest_linear_with_ids,
    keep_nearest_perspective,
    keep_nearest_perspective_with_ids,
)
from shadowbench.device.launch import kernel_options
from shadowbench.device.window_triangles import (
    covered_columns,
    covered_rows,
    doubled_area,
    edges_of,
    max3,
    min3,
    plane_at,
    plane_through,
    top_to_bottom,
    visible_polygon,
)

wp.set_module_options(kernel_options(native=True))


@wp.struct
class Window:
    """What a draw projects onto.

    ``from_world`` has rows (x·w, y·w, depth, w) with x, y in texels. Points with w <= ``near`` are clipped; ``near`` is
    0 in an orthographic view, where w is 1.
    """

    from_world: wp.mat44d
    near: wp.float64
    width: wp.int32
    height: wp.int32
    band_height: wp.int32


# --- binning


@wp.kernel
def find_bands(
    first: wp.int32,
    # inputs
    window: Window,
    vertices: wp.array[wp.vec3],
    triangles: wp.array[wp.int32],
    begin: wp.int32,
    end: wp.int32,
    block_length: wp.int32,
    # outputs
    bands: wp.array[wp.vec2i],
    counts: wp.array2d[wp.int32],
):
    """Bands [first, end) that each triangle of a block may cover, and how many triangles of it each band gets."""
    block = wp.tid() + first
    for band in range(counts.shape[1]):
        counts[block, band] = 0
    for t in range(begin + block * block_length, wp.min(begin + (block + 1) * block_length, end)):
        polygon = visible_polygon(vertices, triangles, t, window.from_world, window.near)
        first_row = window.height
        end_row = wp.int32(0)
        for corner in range(polygon.count - 2):
            b = wp.where(corner == 0, polygon.b, polygon.c)
            c = wp.where(corner == 0, polygon.c, polygon.d)
            rows = covered_rows(polygon.a, b, c, window.width, window.height)
            if rows[0] < rows[1]:
                first_row = wp.min(first_row, rows[0])
                end_row = wp.max(end_row, rows[1])
        found = wp.vec2i(0, 0)
        if first_row < end_row:
            found = wp.vec2i(first_row // window.band_height, (end_row - 1) // window.band_height + 1)
        bands[t - begin] = found
        for band in range(found[0], found[1]):
            counts[block, band] = counts[block, band] + 1


@wp.kernel
def sort_into_bands(
    first: wp.int32,
    # inputs
    bands: wp.array[wp.vec2i],
    begin: wp.int32,
    end: wp.int32,
    block_length: wp.int32,
    # outputs
    next_entries: wp.array2d[wp.int32],
    entries: wp.array[wp.int32],
):
    """Counting sort: a band's entries are its triangles, in order. A block writes where earlier blocks leave off."""
    block = wp.tid() + first
    for t in range(begin + block * block_length, wp.min(begin + (block + 1) * block_length, end)):
        found = bands[t - begin]
        for band in range(found[0], found[1]):
            entry = next_entries[block, band]
            entries[entry] = t
            next_entries[block, band] = entry + 1


# --- filling


@wp.func
def entry_end(entry_ends: wp.array2d[wp.int32], band: wp.int32):
    """Where a band's entries end, which is where its last block's do; bands lie one after the other."""
    if band < 0:
        return wp.int32(0)
    return entry_ends[entry_ends.shape[0] - 1, band]


@wp.func_native("""
    const int ahead = entry + 16 < end ? entry + 16 : end - 1;
    __builtin_prefetch(triangles.data + 3 * entries.data[ahead]);
    const int soon = entry + 8 < end ? entry + 8 : end - 1;
    const char* vertex = (const char*)(vertices.data + triangles.data[3 * entries.data[soon]]);
    __builtin_prefetch(vertex);
    __builtin_prefetch(vertex + 3 * sizeof(wp::vec3) - 1);
""")
def prefetch(
    vertices: wp.array[wp.vec3],
    triangles: wp.array[wp.int32],
    entries: wp.array[wp.int32],
    entry: wp.int32,
    end: wp.int32,
):
    """Fetch coming triangles of a band; they are in order, but far apart in memory."""


def filling_kernel(keep_linear, keep_perspective):
    """Make the kernel that draws a band's triangles with the given row bodies."""

    @wp.kernel
    def fill_bands(
        first: wp.int32,
        # inputs
        window: Window,
        vertices: wp.array[wp.vec3],
        triangles: wp.array[wp.int32],
        entry_ends: wp.array2d[wp.int32],
        entries: wp.array[wp.int32],
        first_id: wp.int32,
        slope_bias: wp.float64,
        constant_bias: wp.float64,
        is_cleared: wp.bool,
        # outputs
        depth: wp.array[wp.float32],
        ids: wp.array[wp.int32],
    ):
        band = wp.tid() + first
        begin = band * window.band_height
        end = wp.min(begin + window.band_height, window.height)
        if is_cleared:
            fill_depths(depth, begin * window.width, (end - begin) * window.width, 1.0)
            if ids.shape[0] == depth.shape[0]:
                fill_ids(ids, begin * window.width, (end - begin) * window.width, -1)

        end_entry = entry_end(entry_ends, band)
        for entry in range(entry_end(entry_ends, band - 1), end_entry):
            prefetch(vertices, triangles, entries, entry, end_entry)
            t = entries[entry]
            polygon = visible_polygon(vertices, triangles, t, window.from_world, window.near)
            for corner in range(polygon.count - 2):
                b = wp.where(corner == 0, polygon.b, polygon.c)
                c = wp.where(corner == 0, polygon.c, polygon.d)
                top, middle, bottom = top_to_bottom(polygon.a, b, c)
                rows = covered_rows(top, middle, bottom, window.width, window.height)
                first_row = wp.max(rows[0], begin)
                end_row = wp.min(rows[1], end)
                if first_row < end_row and doubled_area(top, middle, bottom) != wp.float64(0.0):
                    edges = edges_of(top, middle, bottom)
                    p = plane_through(top, middle, bottom, 2)
                    low = min3(top[2] / top[3], middle[2] / middle[3], bottom[2] / bottom[3])
                    high = max3(top[2] / top[3], middle[2] / middle[3], bottom[2] / bottom[3])
                    low = wp.max(low, wp.float64(0.0))
                    if top[3] == middle[3] and top[3] == bottom[3]:
                        # one w, as in an orthographic view: depth itself is linear
                        w = wp.float64(1.0) / top[3]
                        offset = slope_bias * wp.max(wp.abs(p.dx), wp.abs(p.dy)) * w + constant_bias
                        for row in range(first_row, end_row):
                            columns = covered_columns(edges, row, window.width)
                            if columns[0] < columns[1]:
                                keep_linear(
                                    depth,
                                    ids,
                                    row * window.width + columns[0],
                                    columns[1] - columns[0],
                                    window.width - columns[0],
                                    plane_at(p, edges, columns[0], row) * w + offset,
                                    p.dx * w,
                                    wp.float32(low + offset),
                                    wp.float32(high + offset),
                                    first_id + t,
                                )
                    else:
                        q = plane_through(top, middle, bottom, 3)
                        for row in range(first_row, end_row):
                            columns = covered_columns(edges, row, window.width)
                            if columns[0] < columns[1]:
                                keep_perspective(
                                    depth,
                                    ids,
                                    row * window.width + columns[0],
                                    columns[1] - columns[0],
                                    window.width - columns[0],
                                    wp.vec3d(plane_at(p, edges, columns[0], row), p.dx, p.dy),
                                    wp.vec3d(plane_at(q, edges, columns[0], row), q.dx, q.dy),
                                    slope_bias,
                                    constant_bias,
                                    wp.float32(low),
                                    wp.float32(high),
                                    first_id + t,
                                )

    return fill_bands


fill_depth = filling_kernel(keep_nearest_linear, keep_nearest_perspective)
fill_depth_and_ids = filling_kernel(keep_nearest_linear_with_ids, keep_nearest_perspective_with_ids)


@wp.kernel
def count_in_bands(
    first: wp.int32,
    # inputs
    window: Window,
    vertices: wp.array[wp.vec3],
    triangles: wp.array[wp.int32],
    entry_ends: wp.array2d[wp.int32],
    entries: wp.array[wp.int32],
    # outputs
    counts: wp.array2d[wp.int32],
):
    """Add to each texel the number of triangles that cover its centre."""
    band = wp.tid() + first
    begin = band * window.band_height
    end = wp.min(begin + window.band_height, window.height)
    for entry in range(entry_end(entry_ends, band - 1), entry_end(entry_ends, band)):
        polygon = visible_polygon(vertices, triangles, entries[entry], window.from_world, window.near)
        for corner in range(polygon.count - 2):
            b = wp.where(corner == 0, polygon.b, polygon.c)
            c = wp.where(corner == 0, polygon.c, polygon.d)
            top, middle, bottom = top_to_bottom(polygon.a, b, c)
            rows = covered_rows(top, middle, bottom, window.width, window.height)
            if doubled_area(top, middle, bottom) != wp.float64(0.0):
                edges = edges_of(top, middle, bottom)
                for row in range(wp.max(rows[0], begin), wp.min(rows[1], end)):
                    columns = covered_columns(edges, row, window.width)
                    for column in range(columns[0], columns[1]):
                        counts[row, column] = counts[row, column] + 1
