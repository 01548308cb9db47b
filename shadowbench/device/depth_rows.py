"""Rows of a depth buffer: the innermost loops of rasterisation, as native bodies and, as their oracle, in plain Warp.

Each native body works on eight texels at a time: on rows of a large triangle four times as fast as its plain twin
(measured: 3.7 to 5.5), and the same bit for bit. Texels beyond the span are loaded and stored unchanged, but never
those of another row, which another thread may own. CPU only: the bodies use Clang's vectors.

Arguments they share: ``start``, the index of the span's first texel in the flat buffer; ``count``, texels in the span;
``room``, texels from ``start`` to the end of the row, at least ``count``; ``low`` and ``high``, least and greatest
depth of the triangle's vertices, which hold a sliver's steep plane in bounds. A texel keeps the lesser depth; of equal
ones, and of NaN, it keeps what it has.
"""

import warp as wp

from shadowbench.device.launch import kernel_options

wp.set_module_options(kernel_options(native=True))

_LINEAR_DEPTH = """
        const floats z = bounded(__builtin_convertvector(depth_at_start + depth_dx * x, floats));
"""

# depth / w and 1 / w are linear, depth is their quotient; the slope follows from the quotient's rule
_PERSPECTIVE_DEPTH = """
        const doubles w = 1.0 / (inverse_w[0] + inverse_w[1] * x);
        const doubles exact = (depth_over_w[0] + depth_over_w[1] * x) * w;
        const doubles slope_x = __builtin_elementwise_abs(depth_over_w[1] - exact * inverse_w[1]);
        const doubles slope_y = __builtin_elementwise_abs(depth_over_w[2] - exact * inverse_w[2]);
        const doubles slope = (slope_x > slope_y ? slope_x : slope_y) * w;
        const floats z = bounded(__builtin_convertvector(exact, floats))
            + __builtin_convertvector(slope * slope_bias + constant_bias, floats);
"""

# The store is volatile to keep the compiler from turning it into a masked one, which takes tens of cycles on AMD.
_KEEP_DEPTH = """
        *(volatile unaligned_floats*)depths = nearer ? z : stored;
"""

_KEEP_DEPTH_AND_ID = (
    _KEEP_DEPTH
    + """
        int* numbers = ids.data + start + i;
        if (is_partial) {
            for (int k = 0; k < room - i; ++k) numbers[k] = nearer[k] ? triangle : numbers[k];
        } else {
            const ints before = *(unaligned_ints*)numbers;
            *(volatile unaligned_ints*)numbers = nearer ? (ints)triangle : before;
        }
"""
)


def _row_body(depth_formula: str, keep: str) -> str:
    return (
        """
    typedef float floats __attribute__((ext_vector_type(8)));
    typedef double doubles __attribute__((ext_vector_type(8)));
    typedef int ints __attribute__((ext_vector_type(8)));
    typedef float unaligned_floats __attribute__((ext_vector_type(8), aligned(4)));
    typedef int unaligned_ints __attribute__((ext_vector_type(8), aligned(4)));
    const ints lane = {0, 1, 2, 3, 4, 5, 6, 7};
    auto bounded = [&](floats z) {
        z = z < low ? (floats)low : z;
        return z > high ? (floats)high : z;
    };
    for (int i = 0; i < count; i += 8) {
        const ints column = lane + i;
        const doubles x = __builtin_convertvector(column, doubles);"""
        + depth_formula
        + """
        float row_end[8] = {};
        const bool is_partial = room - i < 8;
        float* depths = is_partial ? row_end : depth.data + start + i;
        if (is_partial) for (int k = 0; k < room - i; ++k) row_end[k] = depth.data[start + i + k];
        const floats stored = *(unaligned_floats*)depths;
        const ints nearer = (z < stored) & (column < count);"""
        + keep
        + """
        if (is_partial) for (int k = 0; k < room - i; ++k) depth.data[start + i + k] = row_end[k];
    }
"""
    )


# --- depth linear in the window


@wp.func_native(_row_body(_LINEAR_DEPTH, _KEEP_DEPTH))
def keep_nearest_linear(
    depth: wp.array[wp.float32],
    ids: wp.array[wp.int32],
    start: wp.int32,
    count: wp.int32,
    room: wp.int32,
    depth_at_start: wp.float64,
    depth_dx: wp.float64,
    low: wp.float32,
    high: wp.float32,
    triangle: wp.int32,
): ...


@wp.func_native(_row_body(_LINEAR_DEPTH, _KEEP_DEPTH_AND_ID))
def keep_nearest_linear_with_ids(
    depth: wp.array[wp.float32],
    ids: wp.array[wp.int32],
    start: wp.int32,
    count: wp.int32,
    room: wp.int32,
    depth_at_start: wp.float64,
    depth_dx: wp.float64,
    low: wp.float32,
    high: wp.float32,
    triangle: wp.int32,
): ...


@wp.func
def keep_nearest_linear_plain(
    depth: wp.array[wp.float32],
    ids: wp.array[wp.int32],
    start: wp.int32,
    count: wp.int32,
    room: wp.int32,  # noqa: ARG001 - as its native twins
    depth_at_start: wp.float64,
    depth_dx: wp.float64,
    low: wp.float32,
    high: wp.float32,
    triangle: wp.int32,
):
    """Keep the lesser of the stored and a linear depth over a span, and the number of the triangle that has it."""
    for i in range(count):
        z = wp.clamp(wp.float32(depth_at_start + depth_dx * wp.float64(i)), low, high)
        if z < depth[start + i]:
            depth[start + i] = z
            ids[start + i] = triangle


# --- depth the quotient of two linear quantities


@wp.func_native(_row_body(_PERSPECTIVE_DEPTH, _KEEP_DEPTH))
def keep_nearest_perspective(
    depth: wp.array[wp.float32],
    ids: wp.array[wp.int32],
    start: wp.int32,
    count: wp.int32,
    room: wp.int32,
    depth_over_w: wp.vec3d,
    inverse_w: wp.vec3d,
    slope_bias: wp.float64,
    constant_bias: wp.float64,
    low: wp.float32,
    high: wp.float32,
    triangle: wp.int32,
): ...


@wp.func_native(_row_body(_PERSPECTIVE_DEPTH, _KEEP_DEPTH_AND_ID))
def keep_nearest_perspective_with_ids(
    depth: wp.array[wp.float32],
    ids: wp.array[wp.int32],
    start: wp.int32,
    count: wp.int32,
    room: wp.int32,
    depth_over_w: wp.vec3d,
    inverse_w: wp.vec3d,
    slope_bias: wp.float64,
    constant_bias: wp.float64,
    low: wp.float32,
    high: wp.float32,
    triangle: wp.int32,
): ...


@wp.func
def keep_nearest_perspective_plain(
    depth: wp.array[wp.float32],
    ids: wp.array[wp.int32],
    start: wp.int32,
    count: wp.int32,
    room: wp.int32,  # noqa: ARG001 - as its native twins
    depth_over_w: wp.vec3d,
    inverse_w: wp.vec3d,
    slope_bias: wp.float64,
    constant_bias: wp.float64,
    low: wp.float32,
    high: wp.float32,
    triangle: wp.int32,
):
    """As `keep_nearest_linear_plain`, for perspective views.

    ``depth_over_w`` and ``inverse_w`` hold a value at the span's first texel and its change per column and per row.
    """
    for i in range(count):
        x = wp.float64(i)
        w = wp.float64(1.0) / (inverse_w[0] + inverse_w[1] * x)
        exact = (depth_over_w[0] + depth_over_w[1] * x) * w
        slope_x = wp.abs(depth_over_w[1] - exact * inverse_w[1])
        slope_y = wp.abs(depth_over_w[2] - exact * inverse_w[2])
        offset = wp.max(slope_x, slope_y) * w * slope_bias + constant_bias
        z = wp.clamp(wp.float32(exact), low, high) + wp.float32(offset)
        if z < depth[start + i]:
            depth[start + i] = z
            ids[start + i] = triangle


# --- clearing


@wp.func_native("""
    for (int i = 0; i < count; ++i) depth.data[start + i] = value;
""")
def fill_depths(depth: wp.array[wp.float32], start: wp.int32, count: wp.int32, value: wp.float32): ...


@wp.func_native("""
    for (int i = 0; i < count; ++i) ids.data[start + i] = value;
""")
def fill_ids(ids: wp.array[wp.int32], start: wp.int32, count: wp.int32, value: wp.int32): ...
