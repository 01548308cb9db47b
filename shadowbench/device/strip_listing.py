"""Which strips a triangle meets, and copying triangles into strips' lists: the steps that binning repeats.

Where triangles are small, half of all rasterising is spent here and on memory, and Warp's code for arrays takes two to
three times as long as the work itself; so they are native, four triangles at a time. Each has its twin in plain Warp,
``..._plainly``: the meaning, and the oracle in tests.
"""

import warp as wp

from shadowbench.device.blocker_bins import BlockerLists, list_triangle
from shadowbench.device.blockers import BOUNDS_MARGIN, box_of, meets_window
from shadowbench.device.launch import kernel_options
from shadowbench.device.sample_sorting import row_of
from shadowbench.device.sample_space import SampleSpace, window_point

wp.set_module_options(kernel_options(native=True))


@wp.func
def first_strip(found: wp.uint64):
    """Of the strips packed by :func:`strips_met`."""
    return wp.int32(found & wp.uint64(0xFFFFFFFF))


@wp.func
def end_of_strips(found: wp.uint64):
    return wp.int32(found >> wp.uint64(32))


@wp.func_native("""
    typedef double lanes __attribute__((ext_vector_type(4)));
    typedef float narrow __attribute__((ext_vector_type(4)));
    typedef int whole __attribute__((ext_vector_type(4)));
    const float* corner = (const float*)vertices.data;
    const int* index = indices.data;
    const float last = (float)(strip_of_row.shape[0] - 1), per_unit = 0.5f * (float)strip_of_row.shape[0];
    const auto rows_of = [&](narrow y) {
        const narrow at = (y + 1.0f) * per_unit;
        return __builtin_convertvector(at < 0.0f ? (narrow)0.0f : at > last ? (narrow)last : at, whole);
    };
    for (int t = begin; t < end; t += 4) {
        lanes low[2], high[2];
        for (int v = 0; v < 3; ++v) {
            lanes world[3];
            for (int lane = 0; lane < 4; ++lane) {
                const float* p = corner + 3 * (size_t)index[3 * (size_t)(t + lane < end ? t + lane : t) + v];
                for (int k = 0; k < 3; ++k) world[k][lane] = p[k];
            }
            for (int r = 0; r < 2; ++r) {
                const auto& m = space.window_from_world.data[r];
                const lanes at = m[0] * world[0] + m[1] * world[1] + m[2] * world[2] + m[3];
                low[r] = v == 0 ? at : __builtin_elementwise_min(low[r], at);
                high[r] = v == 0 ? at : __builtin_elementwise_max(high[r], at);
            }
        }
        const narrow left = __builtin_convertvector(low[0] - margin, narrow);
        const narrow top = __builtin_convertvector(low[1] - margin, narrow);
        const narrow right = __builtin_convertvector(high[0] + margin, narrow);
        const narrow bottom = __builtin_convertvector(high[1] + margin, narrow);
        const whole meets = (left <= 1.0f) & (top <= 1.0f) & (right >= -1.0f) & (bottom >= -1.0f);
        const whole first = rows_of(top), final = rows_of(bottom);
        for (int lane = 0; lane < 4 && t + lane < end; ++lane) {
            const uint64_t strip = strip_of_row.data[first[lane]];
            const uint64_t after = meets[lane] ? strip_of_row.data[final[lane]] + 1 : strip;
            found.data[t + lane] = after << 32 | strip;
        }
    }
""")
def _strips_met_orthographic(
    space: SampleSpace,
    strip_of_row: wp.array[wp.int32],
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    begin: wp.int32,
    end: wp.int32,
    margin: wp.float64,
    found: wp.array[wp.uint64],
): ...


@wp.func
def strips_met(
    space: SampleSpace,
    strip_of_row: wp.array[wp.int32],
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    begin: wp.int32,
    end: wp.int32,
    found: wp.array[wp.uint64],
):
    """Find the strips between the lowest and highest y of triangles ``begin .. end``, packed as (first, end)."""
    if space.is_perspective == wp.float64(0.0):
        _strips_met_orthographic(space, strip_of_row, vertices, indices, begin, end, BOUNDS_MARGIN, found)
    else:
        strips_met_plainly(space, strip_of_row, vertices, indices, begin, end, found)


@wp.func
def strips_met_plainly(
    space: SampleSpace,
    strip_of_row: wp.array[wp.int32],
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    begin: wp.int32,
    end: wp.int32,
    found: wp.array[wp.uint64],
):
    """The meaning of :func:`strips_met`."""
    row_count = strip_of_row.shape[0]
    for t in range(begin, end):
        a = window_point(space, vertices[indices[3 * t]])
        b = window_point(space, vertices[indices[3 * t + 1]])
        c = window_point(space, vertices[indices[3 * t + 2]])
        box = box_of(space, a, b, c)
        first = strip_of_row[row_of(box.low[1], row_count)]
        after = strip_of_row[row_of(box.high[1], row_count)] + 1
        after = wp.where(meets_window(space, box, a, b, c), after, first)
        found[t] = (wp.uint64(after) << wp.uint64(32)) | wp.uint64(first)


@wp.func_native("""
    for (int t = begin; t < end; ++t)
        for (uint32_t s = (uint32_t)found.data[t], after = (uint32_t)(found.data[t] >> 32); s < after; ++s)
            ++count.data[s];
""")
def count_strips(found: wp.array[wp.uint64], begin: wp.int32, end: wp.int32, count: wp.array[wp.int32]):
    """Count triangles ``begin .. end`` in each strip they meet."""


@wp.func
def count_strips_plainly(found: wp.array[wp.uint64], begin: wp.int32, end: wp.int32, count: wp.array[wp.int32]):
    """The meaning of :func:`count_strips`."""
    for t in range(begin, end):
        for s in range(first_strip(found[t]), end_of_strips(found[t])):
            count[s] = count[s] + 1


@wp.func_native("""
    struct triangle { float coordinate[9]; };
    const float* corner = (const float*)vertices.data;
    triangle* listed = (triangle*)lists.corner.data;
    for (int t = begin; t < end; ++t) {
        uint32_t s = (uint32_t)found.data[t];
        const uint32_t after = (uint32_t)(found.data[t] >> 32);
        if (s == after) continue;
        triangle copied;
        for (int v = 0; v < 3; ++v)
            for (int k = 0; k < 3; ++k)
                copied.coordinate[3 * v + k] = corner[3 * (size_t)indices.data[3 * (size_t)t + v] + k];
        for (; s < after; ++s) {
            const int place = cursor.data[s]++;
            listed[place] = copied;
            lists.number.data[place] = t;
        }
    }
""")
def list_in_strips(
    found: wp.array[wp.uint64],
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    begin: wp.int32,
    end: wp.int32,
    cursor: wp.array[wp.int32],
    lists: BlockerLists,
):
    """Copy triangles ``begin .. end`` to where the cursors of their strips stand."""


@wp.func
def list_in_strips_plainly(
    found: wp.array[wp.uint64],
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    begin: wp.int32,
    end: wp.int32,
    cursor: wp.array[wp.int32],
    lists: BlockerLists,
):
    """The meaning of :func:`list_in_strips`."""
    for t in range(begin, end):
        for s in range(first_strip(found[t]), end_of_strips(found[t])):
            k = cursor[s]
            cursor[s] = k + 1
            list_triangle(lists, k, t, vertices, indices)
