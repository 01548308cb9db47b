"""Which of a run of points lie behind all of some planes: the innermost loop of filling a convex body's outline.

The native body works on eight points at a time, in a quarter of its plain twin's time for points along a picture's rows
and in a tenth for points in no order (`tests/benchmarks/plane_tests.py`), and its answers are the same bit for bit. CPU
only: it uses Clang's vectors.
"""

import warp as wp

from shadowbench.device.launch import kernel_options

wp.set_module_options(kernel_options(native=True))

RUN_LENGTH = wp.constant(32)
"""Points tested in one call: an answer has a bit for each."""


@wp.func_native("""
    typedef float floats __attribute__((ext_vector_type(8), aligned(4)));
    typedef double lanes __attribute__((ext_vector_type(8)));
    typedef bool lane_bits __attribute__((ext_vector_type(8)));
    uint32_t found = 0;
    for (int i = 0; i < count; i += 8) {
        const int rest = count - i < 8 ? count - i : 8;
        const float* p = (const float*)(position.data + start + i);
        float last[24] = {};
        if (rest < 8) {
            for (int k = 0; k < 3 * rest; ++k) last[k] = p[k];
            p = last;
        }
        // xyzxyzxy zxyzxyzx yzxyzxyz
        const floats a = *(const floats*)p, b = *(const floats*)(p + 8), c = *(const floats*)(p + 16);
        const floats xs = __builtin_shufflevector(
            __builtin_shufflevector(a, b, 0, 3, 6, 9, 12, 15, -1, -1), c, 0, 1, 2, 3, 4, 5, 10, 13);
        const floats ys = __builtin_shufflevector(
            __builtin_shufflevector(a, b, 1, 4, 7, 10, 13, -1, -1, -1), c, 0, 1, 2, 3, 4, 8, 11, 14);
        const floats zs = __builtin_shufflevector(
            __builtin_shufflevector(a, b, 2, 5, 8, 11, 14, -1, -1, -1), c, 0, 1, 2, 3, 4, 9, 12, 15);
        const lanes x = __builtin_convertvector(xs, lanes);
        const lanes y = __builtin_convertvector(ys, lanes);
        const lanes z = __builtin_convertvector(zs, lanes);
        uint32_t bits = (1u << rest) - 1;
        for (int k = first_plane; k < end_plane && bits != 0; ++k) {
            const double* plane = (const double*)(planes.data + k);
            const lanes outside = plane[0] * x + plane[1] * y + plane[2] * z + plane[3];
            const lane_bits is_behind = __builtin_convertvector(outside <= 0.0, lane_bits);
            unsigned char mask;
            __builtin_memcpy(&mask, &is_behind, 1);
            bits &= mask;
        }
        found |= bits << i;
    }
    return found;
""")
def behind_planes(
    position: wp.array[wp.vec3],
    start: wp.int32,
    count: wp.int32,
    planes: wp.array[wp.vec4d],
    first_plane: wp.int32,
    end_plane: wp.int32,
) -> wp.uint32:
    """Which of the points ``start … start + count - 1`` are outside of no plane, as a bit a point.

    Args:
        position: Points.
        start: The first point.
        count: 1 to :data:`RUN_LENGTH`.
        planes: (n, d), a point p being outside where n·p + d > 0.
        first_plane, end_plane: Which planes to test; without any, all points pass.
    """


@wp.func
def behind_planes_plain(
    position: wp.array[wp.vec3],
    start: wp.int32,
    count: wp.int32,
    planes: wp.array[wp.vec4d],
    first_plane: wp.int32,
    end_plane: wp.int32,
):
    """As :func:`behind_planes`."""
    found = wp.uint32(0)
    for i in range(count):
        p = wp.vec3d(position[start + i])
        k = first_plane
        while k < end_plane and (
            planes[k][0] * p[0] + planes[k][1] * p[1] + planes[k][2] * p[2] + planes[k][3] <= wp.float64(0.0)
        ):
            k += 1
        if k == end_plane:
            found = found | (wp.uint32(1) << wp.uint32(i))
    return found
