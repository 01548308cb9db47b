"""Kernels of the layered rasteriser: keep the several nearest fragments of every texel, nearest first.

Plain Warp. A fragment's depth is that of :mod:`shadowbench.device.depth_rows`, to the bit, so that the nearest layer is
what the depth rasteriser keeps. The host side is :mod:`shadowbench.device.depth_layers`.
"""

import warp as wp

from shadowbench.device.depth_rasterizer_kernels import Window, entry_end
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


@wp.func
def keep_among_nearest(
    depths: wp.array2d[wp.float32],
    ids: wp.array2d[wp.int32],
    texel: wp.int32,
    z: wp.float32,
    triangle: wp.int32,
):
    """Insert a fragment into a texel's list, which is sorted by depth; of equally near ones the first drawn leads."""
    slot = depths.shape[1] - 1
    if z < depths[texel, slot]:
        while slot > 0 and z < depths[texel, wp.max(slot - 1, 0)]:
            depths[texel, slot] = depths[texel, slot - 1]
            ids[texel, slot] = ids[texel, slot - 1]
            slot = slot - 1
        depths[texel, slot] = z
        ids[texel, slot] = triangle


@wp.kernel
def fill_layers(
    first: wp.int32,
    # inputs
    window: Window,
    vertices: wp.array[wp.vec3],
    triangles: wp.array[wp.int32],
    entry_ends: wp.array2d[wp.int32],
    entries: wp.array[wp.int32],
    first_triangle: wp.int32,
    # outputs
    depths: wp.array2d[wp.float32],
    ids: wp.array2d[wp.int32],
):
    """Draw a band's triangles in their order."""
    band = wp.tid() + first
    begin = band * window.band_height
    end = wp.min(begin + window.band_height, window.height)
    for entry in range(entry_end(entry_ends, band - 1), entry_end(entry_ends, band)):
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
                q = plane_through(top, middle, bottom, 3)
                is_flat = top[3] == middle[3] and top[3] == bottom[3]  # one w: depth itself is linear
                flat_w = wp.float64(1.0) / top[3]
                low = min3(top[2] / top[3], middle[2] / middle[3], bottom[2] / bottom[3])
                high = max3(top[2] / top[3], middle[2] / middle[3], bottom[2] / bottom[3])
                low = wp.max(low, wp.float64(0.0))
                for row in range(first_row, end_row):
                    columns = covered_columns(edges, row, window.width)
                    if columns[0] < columns[1]:
                        p_start = plane_at(p, edges, columns[0], row)
                        q_start = plane_at(q, edges, columns[0], row)
                        for column in range(columns[0], columns[1]):
                            x = wp.float64(column - columns[0])
                            depth = p_start * flat_w + p.dx * flat_w * x
                            if not is_flat:
                                w = wp.float64(1.0) / (q_start + q.dx * x)
                                depth = (p_start + p.dx * x) * w
                            z = wp.clamp(wp.float32(depth), wp.float32(low), wp.float32(high))
                            keep_among_nearest(depths, ids, row * window.width + column, z, t + first_triangle)
