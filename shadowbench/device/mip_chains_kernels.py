"""Mip chains of maps: native bodies that halve rows of a level and, as their oracle, the same in plain Warp.

A level of n texels along each axis is followed by one of n/2, rounded down. Where n is even, a texel is made of the two
under it; where it is odd, of three, weighted by how much of each it covers, so that the mean of a level is that of the
level before. A body halves first down the columns, into a line in the cache, then along it.

Arguments the bodies share: ``fine`` and ``coarse``, index of the first value of the face's two levels; ``first`` and
``end``, rows of the coarse level; ``size``, texels along an axis of the fine one; ``channels``, values a texel. CPU
only: the bodies use Clang's vectors.
"""

from typing import Any

import warp as wp

from shadowbench.device.elementary_functions import (
    VECTOR_EXPONENTIAL,
    VECTOR_LOGARITHM,
    exponential,
    logarithm,
)
from shadowbench.device.launch import kernel_options
from shadowbench.device.separable_filters_kernels import MOST_CHANNELS

wp.set_module_options(kernel_options(native=True))


@wp.struct
class ChainLayout:
    """Where the texels of a chain's levels are in its array.

    Attributes:
        first: Index of each level's first value; int32, shape [level_count].
        level_count: Levels that there are, at least 1.
        size: Texels along each axis of level 0.
        channels: Values a texel, side by side.
    """

    first: wp.array[wp.int32]
    level_count: wp.int32
    size: wp.int32
    channels: wp.int32


def chain_layout(first: Any, size: int, channels: int, device: str) -> ChainLayout:
    """Pack where the levels begin, for kernels."""
    layout = ChainLayout()
    layout.first = wp.array(first, dtype=wp.int32, device=device)
    layout.level_count = len(first)
    layout.size = size
    layout.channels = channels
    return layout


@wp.func
def level_size(layout: ChainLayout, level: wp.int32):
    """Texels along each axis of a level."""
    return wp.max(layout.size >> level, 1)


@wp.func
def first_of_face(layout: ChainLayout, level: wp.int32, face: wp.int32):
    """Index of the first value of a face's level."""
    size = level_size(layout, level)
    return layout.first[level] + face * size * size * layout.channels


# Of two values or, where the fine level is odd, of three; written so that equal values come out unchanged.
_MEAN = """
    auto halved = [&](floats a, floats b, floats c, floats share_a, floats share_c) {
        return is_odd ? b + share_a * (a - b) + share_c * (c - b) : (a + b) * 0.5f;
    };
"""

_MAXIMUM = """
    auto halved = [&](floats a, floats b, floats c, floats share_a, floats share_c) {
        const floats most = __builtin_elementwise_max(a, b);
        return is_odd ? __builtin_elementwise_max(most, c) : most;
    };
"""

_LOGARITHMIC_MEAN = (
    VECTOR_EXPONENTIAL
    + VECTOR_LOGARITHM
    + """
    const float inverse = 1.0f / steepness;
    auto halved = [&](floats a, floats b, floats c, floats share_a, floats share_c) {
        floats most = __builtin_elementwise_max(a, b);
        most = is_odd ? __builtin_elementwise_max(most, c) : most;
        const floats ea = exponential(steepness * (a - most)), eb = exponential(steepness * (b - most));
        if (!is_odd) return most + logarithm((ea + eb) * 0.5f) * inverse;
        const floats ec = exponential(steepness * (c - most));
        return most + logarithm(eb + share_a * (ea - eb) + share_c * (ec - eb)) * inverse;
    };
"""
)

_STORE_FLOATS = "*(unaligned*)(into + i) = result;"
_STORE_BYTES = "*(unaligned*)(into + i) = __builtin_convertvector(result + 0.5f, bytes);"


def _halving_body(halved: str, *, element: str = "float", store: str = _STORE_FLOATS) -> str:
    return f"""
    constexpr int LANES = 16, TILE = 512, ROOM = 2 * TILE + {MOST_CHANNELS} + LANES;
    typedef {element} element;
    typedef float floats __attribute__((ext_vector_type(LANES)));
    typedef int ints __attribute__((ext_vector_type(LANES)));
    typedef unsigned char bytes __attribute__((ext_vector_type(LANES)));
    typedef {element} unaligned __attribute__((ext_vector_type(LANES), aligned(sizeof(element))));
    typedef long long pair __attribute__((aligned(4), may_alias));
    alignas(64) element ends[3][ROOM] = {{}};
    alignas(64) float line[ROOM], parts[3][TILE + LANES] = {{}}, shares[2][TILE + LANES] = {{}};
    const element* rows[3] = {{ends[0], ends[1], ends[2]}};
    const int coarse_size = size / 2, tile_size = TILE / channels;
    const bool is_odd = size % 2;
    auto at = [](const float* place) {{ return *(const floats*)place; }};
    auto row_at = [](const element* place) {{ return __builtin_convertvector(*(const unaligned*)place, floats); }};
    {halved}
    for (int tile = 0; tile < coarse_size; tile += tile_size) {{
        const int texels = coarse_size - tile < tile_size ? coarse_size - tile : tile_size;
        const int needed = (2 * texels + is_odd) * channels, count = texels * channels;
        for (int j = 0; j < count && is_odd; ++j) {{
            shares[0][j] = (float)(coarse_size - tile - j / channels) / (float)size;
            shares[1][j] = (float)(tile + j / channels + 1) / (float)size;
        }}
        for (int row = first; row < end; ++row) {{
            for (int k = 0; k < 2 + is_odd; ++k) {{
                rows[k] = values.data + fine + ((long long)(2 * row + k) * size + 2 * tile) * channels;
                if (needed % LANES) {{  // vectors would reach beyond the row
                    for (int j = 0; j < needed; ++j) ends[k][j] = rows[k][j];
                    rows[k] = ends[k];
                }}
            }}
            const floats above = (float)(coarse_size - row) / (float)size, below = (float)(row + 1) / (float)size;
            for (int j = 0; j < needed; j += LANES)
                *(floats*)(line + j) =
                    halved(row_at(rows[0] + j), row_at(rows[1] + j), row_at(rows[2] + j), above, below);

            // first, second and third of each texel's values along the line; vectors within a texel need no sorting
            const bool is_sorted = channels % LANES == 0;
            for (int k = 0; k < 2 + is_odd && !is_sorted; ++k) {{
                const float* from = line + k * channels;
                if (channels == 1) for (int t = 0; t < texels; ++t) parts[k][t] = from[2 * t];
                else if (channels == 2) for (int t = 0; t < texels; ++t) ((pair*)parts[k])[t] = ((pair*)from)[2 * t];
                else for (int t = 0; t < texels; ++t)
                    for (int c = 0; c < channels; ++c) parts[k][t * channels + c] = from[2 * t * channels + c];
            }}
            element* into = values.data + coarse + ((long long)row * coarse_size + tile) * channels;
            for (int i = 0; i < count; i += LANES) {{
                const float* part = is_sorted ? line + i + i / channels * channels : parts[0] + i;
                const int step = is_sorted ? channels : TILE + LANES;
                const floats a = at(part), b = at(part + step), c = is_odd ? at(part + 2 * step) : b;
                const floats result = halved(a, b, c, at(shares[0] + i), at(shares[1] + i));
                if (i + LANES <= count) {{
                    {store}
                }} else {{
                    element rest[LANES];
                    {store.replace("into + i", "rest")}
                    for (int k = 0; i + k < count; ++k) into[i + k] = rest[k];
                }}
            }}
        }}
    }}
"""


@wp.func_native(_halving_body(_MEAN))
def halve_floats(
    values: wp.array[wp.float32],
    steepness: wp.float32,
    fine: wp.int32,
    coarse: wp.int32,
    first: wp.int32,
    end: wp.int32,
    size: wp.int32,
    channels: wp.int32,
): ...


@wp.func_native(_halving_body(_MEAN, element="unsigned char", store=_STORE_BYTES))
def halve_bytes(
    values: wp.array[wp.uint8],
    steepness: wp.float32,
    fine: wp.int32,
    coarse: wp.int32,
    first: wp.int32,
    end: wp.int32,
    size: wp.int32,
    channels: wp.int32,
): ...


@wp.func_native(_halving_body(_MAXIMUM))
def halve_maxima(
    values: wp.array[wp.float32],
    steepness: wp.float32,
    fine: wp.int32,
    coarse: wp.int32,
    first: wp.int32,
    end: wp.int32,
    size: wp.int32,
    channels: wp.int32,
): ...


@wp.func_native(_halving_body(_LOGARITHMIC_MEAN))
def halve_logarithms(
    values: wp.array[wp.float32],
    steepness: wp.float32,
    fine: wp.int32,
    coarse: wp.int32,
    first: wp.int32,
    end: wp.int32,
    size: wp.int32,
    channels: wp.int32,
): ...


# --- the plain twins


@wp.func
def halved_mean(a: wp.float32, b: wp.float32, c: wp.float32, shares: wp.vec2, is_odd: wp.bool, steepness: wp.float32):  # noqa: ARG001
    """Mean of two values or, weighted, of three."""
    if is_odd:
        return b + shares[0] * (a - b) + shares[1] * (c - b)
    return (a + b) * wp.float32(0.5)


@wp.func
def halved_maximum(
    a: wp.float32,
    b: wp.float32,
    c: wp.float32,
    shares: wp.vec2,  # noqa: ARG001 - as its twins
    is_odd: wp.bool,
    steepness: wp.float32,  # noqa: ARG001 - as its twins
):
    """Larger of two values or of three."""
    most = wp.max(a, b)
    if is_odd:
        most = wp.max(most, c)
    return most


@wp.func
def halved_logarithm(
    a: wp.float32, b: wp.float32, c: wp.float32, shares: wp.vec2, is_odd: wp.bool, steepness: wp.float32
):
    """Logarithm of the mean of two or three exponentials, by steepness."""
    most = halved_maximum(a, b, c, shares, is_odd, steepness)
    ea = exponential(steepness * (a - most))
    eb = exponential(steepness * (b - most))
    mean = (ea + eb) * wp.float32(0.5)
    if is_odd:
        ec = exponential(steepness * (c - most))
        mean = eb + shares[0] * (ea - eb) + shares[1] * (ec - eb)
    return most + logarithm(mean) * (wp.float32(1.0) / steepness)


def plain_halving(halved):
    """Make the plain twin of a native body from the mean of two or three values."""

    @wp.func
    def halve_plain(
        values: wp.array[wp.float32],
        steepness: wp.float32,
        fine: wp.int32,
        coarse: wp.int32,
        first: wp.int32,
        end: wp.int32,
        size: wp.int32,
        channels: wp.int32,
    ):
        coarse_size = size // 2
        is_odd = size % 2 == 1
        width = size * channels
        for row in range(first, end):
            down = wp.vec2(wp.float32(coarse_size - row), wp.float32(row + 1)) / wp.float32(size)
            for i in range(coarse_size * channels):
                column = i // channels
                along = wp.vec2(wp.float32(coarse_size - column), wp.float32(column + 1)) / wp.float32(size)
                parts = wp.vec3()
                for k in range(2 + size % 2):
                    at = fine + 2 * row * width + (2 * column + k) * channels + i % channels
                    third = wp.float32(0.0)
                    if is_odd:
                        third = values[at + 2 * width]
                    parts[k] = halved(values[at], values[at + width], third, down, is_odd, steepness)
                mean = halved(parts[0], parts[1], parts[2], along, is_odd, steepness)
                values[coarse + row * coarse_size * channels + i] = mean

    return halve_plain


# ---


def halving_kernel(halve, element):
    """Make the kernel that fills levels ``begin + 1 … end`` of strips of each face with the given body.

    More than one level at a time only where strips are halved evenly, or a strip is a whole face.
    """

    @wp.kernel
    def halve_strips(
        first: wp.int32,
        # inputs
        layout: ChainLayout,
        begin: wp.int32,
        end: wp.int32,
        strips: wp.int32,
        steepness: wp.float32,
        # outputs
        values: wp.array[element],
    ):
        i = wp.tid() + first
        face = i / strips
        for level in range(begin, end):
            rows = level_size(layout, level + 1)
            height = (rows + strips - 1) / strips
            row = wp.min((i % strips) * height, rows)
            halve(
                values,
                steepness,
                first_of_face(layout, level, face),
                first_of_face(layout, level + 1, face),
                row,
                wp.min(row + height, rows),
                level_size(layout, level),
                layout.channels,
            )

    return halve_strips


fill_with_means = halving_kernel(halve_floats, wp.float32)
fill_with_byte_means = halving_kernel(halve_bytes, wp.uint8)
fill_with_maxima = halving_kernel(halve_maxima, wp.float32)
fill_with_logarithms = halving_kernel(halve_logarithms, wp.float32)
