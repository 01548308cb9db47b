"""From linear depth to what a filter may average: native bodies for rows and, as their oracle, the same in plain Warp.

Arguments the bodies share: ``depth``, linear depths; ``begin`` and ``count``, first value and number of values of a
row. On 2048 x 2048 texels a body takes 1.5 ms (exponentials), 2 to 3 ms (moments) and 48 ms (32 basis images of 8
bits), its plain twin 18, 17 and 450. CPU only: the bodies use Clang's vectors.
"""

from typing import Any

import warp as wp

from shadowbench.device.elementary_functions import (
    VECTOR_EXPONENTIAL,
    VECTOR_SINE_AND_COSINE,
    exponential,
    sine_and_cosine,
)
from shadowbench.device.launch import kernel_options

wp.set_module_options(kernel_options(native=True))

_VECTORS = """
    constexpr int LANES = 16;
    typedef float floats __attribute__((ext_vector_type(LANES)));
    typedef int ints __attribute__((ext_vector_type(LANES)));
    typedef unsigned char bytes __attribute__((ext_vector_type(LANES)));
    typedef float unaligned __attribute__((ext_vector_type(LANES), aligned(4)));
"""

# --- e^(c z), Annen et al. 2008, equation 3


@wp.func_native(
    _VECTORS
    + VECTOR_EXPONENTIAL
    + """
    int i = 0;
    for (; i + LANES <= count; i += LANES) {
        *(unaligned*)(target.data + begin + i) = exponential(steepness * *(unaligned*)(depth.data + begin + i));
    }
    floats rest = 0.0f;
    for (int k = 0; i + k < count; ++k) rest[k] = depth.data[begin + i + k];
    rest = exponential(steepness * rest);
    for (int k = 0; i + k < count; ++k) target.data[begin + i + k] = rest[k];
"""
)
def exponentials_of_row(
    depth: wp.array[wp.float32], steepness: wp.float32, begin: wp.int32, count: wp.int32, target: wp.array[wp.float32]
): ...


@wp.func
def exponentials_of_row_plain(
    depth: wp.array[wp.float32], steepness: wp.float32, begin: wp.int32, count: wp.int32, target: wp.array[wp.float32]
):
    """Write e^(c z), c the steepness."""
    for i in range(begin, begin + count):
        target[i] = exponential(steepness * depth[i])


def exponential_kernel(exponentials_of_row):
    """Make the kernel that encodes rows with the given body."""

    @wp.kernel
    def write_exponentials(
        first: wp.int32,
        # inputs
        depth: wp.array[wp.float32],
        steepness: wp.float32,
        width: wp.int32,
        # outputs
        target: wp.array[wp.float32],
    ):
        row = wp.tid() + first
        exponentials_of_row(depth, steepness, row * width, width, target)

    return write_exponentials


write_exponentials = exponential_kernel(exponentials_of_row)

# --- (z, z²), Donnelly & Lauritzen 2006, section 4; and what a plane adds to the second moment within a texel


@wp.func_native("""
    const float* z = depth.data + begin;
    const float* above = depth.data + begin - (is_first ? 0 : count);
    const float* below = depth.data + begin + (is_last ? 0 : count);
    float* into = target.data + 2 * (long long)begin;
    // the gentler of the two sides' slopes; of the one side there is at an edge
    auto slope = [](float before, float here, float after, bool has_before, bool has_after) {
        const float back = here - before, ahead = after - here;
        const float gentler = __builtin_fabsf(back) < __builtin_fabsf(ahead) ? back : ahead;
        return has_before ? has_after ? gentler : back : has_after ? ahead : 0.0f;
    };
    if (share == 0.0f) {
        for (int i = 0; i < count; ++i) {
            into[2 * i] = z[i];
            into[2 * i + 1] = z[i] * z[i];
        }
        return;
    }
    auto write = [&](int i, bool has_left, bool has_right, bool has_above, bool has_below) {
        const float dx = slope(z[i - has_left], z[i], z[i + has_right], has_left, has_right);
        const float dy = slope(above[i], z[i], below[i], has_above, has_below);
        into[2 * i] = z[i];
        into[2 * i + 1] = z[i] * z[i] + share * (dx * dx + dy * dy);
    };
    write(0, false, count > 1, !is_first, !is_last);
    if (count > 1) write(count - 1, true, false, !is_first, !is_last);
    if (is_first || is_last) for (int i = 1; i + 1 < count; ++i) write(i, true, true, !is_first, !is_last);
    else for (int i = 1; i + 1 < count; ++i) write(i, true, true, true, true);
""")
def moments_of_row(
    depth: wp.array[wp.float32],
    share: wp.float32,
    begin: wp.int32,
    count: wp.int32,
    is_first: wp.bool,
    is_last: wp.bool,
    target: wp.array[wp.float32],
): ...


@wp.func
def gentler_slope(before: wp.float32, here: wp.float32, after: wp.float32, has_before: wp.bool, has_after: wp.bool):
    """Change of depth to the next texel: the gentler of the two sides' changes, so that a silhouette does not count."""
    back = here - before
    ahead = after - here
    if has_before and has_after:
        if wp.abs(back) < wp.abs(ahead):
            return back
        return ahead
    if has_before:
        return back
    if has_after:
        return ahead
    return wp.float32(0.0)


@wp.func
def moments_of_row_plain(
    depth: wp.array[wp.float32],
    share: wp.float32,
    begin: wp.int32,
    count: wp.int32,
    is_first: wp.bool,
    is_last: wp.bool,
    target: wp.array[wp.float32],
):
    """Write z and z² plus ``share`` of the squared slopes."""
    up = wp.where(is_first, 0, count)
    down = wp.where(is_last, 0, count)
    for i in range(begin, begin + count):
        z = depth[i]
        has_left = i > begin
        has_right = i + 1 < begin + count
        left = wp.where(has_left, 1, 0)
        right = wp.where(has_right, 1, 0)
        dx = gentler_slope(depth[i - left], z, depth[i + right], has_left, has_right)
        dy = gentler_slope(depth[i - up], z, depth[i + down], not is_first, not is_last)
        target[2 * i] = z
        target[2 * i + 1] = z * z + share * (dx * dx + dy * dy)


def moment_kernel(moments_of_row):
    """Make the kernel that encodes rows with the given body."""

    @wp.kernel
    def write_moments(
        first: wp.int32,
        # inputs
        depth: wp.array[wp.float32],
        share: wp.float32,
        rows: wp.int32,
        width: wp.int32,
        # outputs
        target: wp.array[wp.float32],
    ):
        row = wp.tid() + first
        moments_of_row(depth, share, row * width, width, row % rows == 0, row % rows == rows - 1, target)

    return write_moments


write_moments = moment_kernel(moments_of_row)

# --- sin(c_k z) and cos(c_k z), c_k = π (2k - 1), k = 1 … M, Annen et al. 2007, equation 9


def _basis_body(element: str, stored: str) -> str:
    return (
        _VECTORS
        + VECTOR_SINE_AND_COSINE
        + f"""
    const floats lane = {{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}};
    for (int i = begin; i < begin + count; ++i) {{
        {element}* into = target.data + 2 * (long long)terms * i;
        for (int k = 0; k < terms; k += LANES) {{
            floats sine, cosine;
            sine_and_cosine(depth.data[i] * (2.0f * (lane + (float)k) + 1.0f), sine, cosine);
            {stored}
        }}
    }}
"""
    )


_BASIS_OF_FLOATS = _basis_body(
    "float",
    """
            if (terms - k >= LANES) {
                *(unaligned*)(into + k) = sine;
                *(unaligned*)(into + terms + k) = cosine;
            } else {
                for (int j = 0; j < terms - k; ++j) {
                    into[k + j] = sine[j];
                    into[terms + k + j] = cosine[j];
                }
            }
""",
)

# B / 2 + 1 / 2 in 255ths, rounded
_BASIS_OF_BYTES = _basis_body(
    "unsigned char",
    """
            typedef unsigned char unaligned_bytes __attribute__((ext_vector_type(LANES), aligned(1)));
            const bytes sines = __builtin_convertvector(sine * 127.5f + 128.0f, bytes);
            const bytes cosines = __builtin_convertvector(cosine * 127.5f + 128.0f, bytes);
            if (terms - k >= LANES) {
                *(unaligned_bytes*)(into + k) = sines;
                *(unaligned_bytes*)(into + terms + k) = cosines;
            } else {
                for (int j = 0; j < terms - k; ++j) {
                    into[k + j] = sines[j];
                    into[terms + k + j] = cosines[j];
                }
            }
""",
)


@wp.func_native(_BASIS_OF_FLOATS)
def basis_of_row(
    depth: wp.array[wp.float32], terms: wp.int32, begin: wp.int32, count: wp.int32, target: wp.array[wp.float32]
): ...


@wp.func_native(_BASIS_OF_BYTES)
def basis_of_row_in_bytes(
    depth: wp.array[wp.float32], terms: wp.int32, begin: wp.int32, count: wp.int32, target: wp.array[wp.uint8]
): ...


@wp.func
def stored_basis(value: wp.float32, like: wp.float32):  # noqa: ARG001 - tells the type
    return value


@wp.func
def stored_basis(value: wp.float32, like: wp.uint8):  # noqa: ARG001, F811 - tells the type
    return wp.uint8(value * wp.float32(127.5) + wp.float32(128.0))


@wp.func
def basis_of_row_plain(
    depth: wp.array[wp.float32], terms: wp.int32, begin: wp.int32, count: wp.int32, target: wp.array[Any]
):
    """Write the sines of all terms, then the cosines."""
    for i in range(begin, begin + count):
        for k in range(terms):
            pair = sine_and_cosine(depth[i] * wp.float32(2 * k + 1))
            target[2 * terms * i + k] = stored_basis(pair[0], target[0])
            target[2 * terms * i + terms + k] = stored_basis(pair[1], target[0])


def basis_kernel(basis_of_row, element):
    """Make the kernel that encodes rows with the given body."""

    @wp.kernel
    def write_basis(
        first: wp.int32,
        # inputs
        depth: wp.array[wp.float32],
        terms: wp.int32,
        width: wp.int32,
        # outputs
        target: wp.array[element],
    ):
        row = wp.tid() + first
        basis_of_row(depth, terms, row * width, width, target)

    return write_basis


write_basis = basis_kernel(basis_of_row, wp.float32)
write_basis_in_bytes = basis_kernel(basis_of_row_in_bytes, wp.uint8)
