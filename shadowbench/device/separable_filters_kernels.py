"""Separable filters over maps: native bodies for strips of rows and, as their oracle, the same in plain Warp.

A body filters a strip in one sweep: each row of the source is filtered along itself into a ring of as many rows as the
filter has taps, and as soon as the ring holds a target row's neighbours they are combined. The intermediate rows are
float32 and stay in the cache, so that a filter costs one passage through memory (7 x 7 taps over 2048 x 2048 texels:
5 ms where plain Warp takes 110), and 8-bit maps are rounded once. Beyond an edge lies the edge's texel again.

Arguments the bodies share: ``start``, index of the map's first value; ``first`` and ``end``, rows of the strip;
``rows``, rows of the map; ``width``, values a row; ``channels``, values a texel, which lie side by side; ``weights``,
one a tap. Taps before the centre are half the number of taps, rounded down. CPU only: the bodies use Clang's vectors.
"""

import warp as wp

from shadowbench.device.elementary_functions import (
    VECTOR_EXPONENTIAL,
    VECTOR_LOGARITHM,
    exponential,
    logarithm,
)
from shadowbench.device.launch import kernel_options

wp.set_module_options(kernel_options(native=True))

MOST_TAPS = 63
MOST_CHANNELS = 64
_RING = 1 << 16
_LONGEST_TILE = 1 << 12
"""Values in the ring of rows, which share it, and the most of a row that are filtered at a time: whole rows where they
fit are what the processor fetches ahead best."""

# Weights sum to 1 only up to rounding. Written as the centre and weighted differences from it, the mean of equal
# values is that value to the last bit. Opposite taps of an odd filter share their weight.
_MEAN = """
    const int pairs = taps % 2 ? before : 0;
    auto combined = [&](int i) {
        const floats centre = at(tap[before] + i), twice = centre + centre;
        floats sum = centre;
        for (int k = 1; k <= pairs; ++k)
            sum += w[before + k] * ((at(tap[before - k] + i) + at(tap[before + k] + i)) - twice);
        for (int k = 0; k < taps && !pairs; ++k) sum += w[k] * (at(tap[k] + i) - centre);
        return sum;
    };
"""

_MAXIMUM = """
    auto combined = [&](int i) {
        floats most = at(tap[0] + i);
        for (int k = 1; k < taps; ++k) most = __builtin_elementwise_max(most, at(tap[k] + i));
        return most;
    };
"""

# x0 + ln(sum of w e^(c (x - x0))) / c, with x0 the largest x: no exponential exceeds 1
_LOGARITHMIC_MEAN = (
    VECTOR_EXPONENTIAL
    + VECTOR_LOGARITHM
    + """
    const float inverse = 1.0f / steepness;
    auto combined = [&](int i) {
        floats most = at(tap[0] + i);
        for (int k = 1; k < taps; ++k) most = __builtin_elementwise_max(most, at(tap[k] + i));
        const floats centre = exponential(steepness * (at(tap[before] + i) - most));
        floats sum = centre;
        for (int k = 0; k < taps; ++k) {
            if (k != before) sum += w[k] * (exponential(steepness * (at(tap[k] + i) - most)) - centre);
        }
        return most + logarithm(sum) * inverse;
    };
"""
)

_STORE_FLOATS = "*(unaligned_floats*)(into + i) = values;"
_STORE_BYTES = "*(unaligned_bytes*)(into + i) = __builtin_convertvector(values + 0.5f, bytes);"


def _strip_body(combined: str, *, element: str = "float", store: str = _STORE_FLOATS, lanes: int = 32) -> str:
    return f"""
    constexpr int LANES = {lanes}, RING = {_RING}, LONGEST_TILE = {_LONGEST_TILE}, MOST_TAPS = {MOST_TAPS};
    typedef {element} element;
    typedef float floats __attribute__((ext_vector_type({lanes})));
    typedef int ints __attribute__((ext_vector_type({lanes})));
    typedef unsigned char bytes __attribute__((ext_vector_type({lanes})));
    typedef float unaligned_floats __attribute__((ext_vector_type({lanes}), aligned(4)));
    typedef unsigned char unaligned_bytes __attribute__((ext_vector_type({lanes}), aligned(1)));
    const int taps = weights.shape[0], before = taps / 2, after = taps - 1 - before;
    const float* w = weights.data;
    const int tile_size = RING / taps < LONGEST_TILE ? RING / taps / LANES * LANES : LONGEST_TILE;
    alignas(64) float line[LONGEST_TILE + (MOST_TAPS - 1) * {MOST_CHANNELS} + LANES];
    alignas(64) float ring[RING];
    const float* tap[MOST_TAPS];
    auto at = [](const float* place) {{ return *(const unaligned_floats*)place; }};
    {combined}
    for (int tile = 0; tile < width; tile += tile_size) {{
        const int count = width - tile < tile_size ? width - tile : tile_size;
        for (int y = first - before; y < end + after; ++y) {{
            // the tile's part of the row, with its neighbours on both sides
            const element* row = source.data + start + (long long)(y < 0 ? 0 : y < rows ? y : rows - 1) * width;
            const int begin = tile - before * channels, needed = count + (taps - 1) * channels;
            const int beyond = width - begin < needed ? width - begin : needed;
            int j = 0;
            for (; begin + j < 0; ++j) line[j] = row[(tile + j) % channels];
            for (; j < beyond; ++j) line[j] = row[begin + j];
            for (; j < needed; ++j) line[j] = row[width - channels + (begin + j - width) % channels];

            float* filtered = ring + (y + before) % taps * tile_size;
            for (int k = 0; k < taps; ++k) tap[k] = line + k * channels;
            for (int i = 0; i < count; i += LANES) *(floats*)(filtered + i) = combined(i);

            if (y < first + after) continue;
            element* into = target.data + start + (long long)(y - after) * width + tile;
            for (int k = 0; k < taps; ++k) tap[k] = ring + (y - after + k) % taps * tile_size;
            int i = 0;
            for (; i + LANES <= count; i += LANES) {{
                const floats values = combined(i);
                {store}
            }}
            if (i < count) {{
                const floats values = combined(i);
                element rest[LANES];
                {store.replace("into + i", "rest")}
                for (int k = 0; i + k < count; ++k) into[i + k] = rest[k];
            }}
        }}
    }}
"""


@wp.func_native(_strip_body(_MEAN))
def mean_of_floats(
    source: wp.array[wp.float32],
    target: wp.array[wp.float32],
    weights: wp.array[wp.float32],
    steepness: wp.float32,
    start: wp.int32,
    first: wp.int32,
    end: wp.int32,
    rows: wp.int32,
    width: wp.int32,
    channels: wp.int32,
): ...


@wp.func_native(_strip_body(_MEAN, element="unsigned char", store=_STORE_BYTES))
def mean_of_bytes(
    source: wp.array[wp.uint8],
    target: wp.array[wp.uint8],
    weights: wp.array[wp.float32],
    steepness: wp.float32,
    start: wp.int32,
    first: wp.int32,
    end: wp.int32,
    rows: wp.int32,
    width: wp.int32,
    channels: wp.int32,
): ...


@wp.func_native(_strip_body(_MAXIMUM))
def maximum_of_floats(
    source: wp.array[wp.float32],
    target: wp.array[wp.float32],
    weights: wp.array[wp.float32],
    steepness: wp.float32,
    start: wp.int32,
    first: wp.int32,
    end: wp.int32,
    rows: wp.int32,
    width: wp.int32,
    channels: wp.int32,
): ...


@wp.func_native(_strip_body(_LOGARITHMIC_MEAN, lanes=16))
def logarithmic_mean_of_floats(
    source: wp.array[wp.float32],
    target: wp.array[wp.float32],
    weights: wp.array[wp.float32],
    steepness: wp.float32,
    start: wp.int32,
    first: wp.int32,
    end: wp.int32,
    rows: wp.int32,
    width: wp.int32,
    channels: wp.int32,
): ...


def filtering_kernel(filter_strip, element):
    """Make the kernel that filters strips of rows of maps with the given body."""

    @wp.kernel
    def filter_strips(
        first: wp.int32,
        # inputs
        source: wp.array[element],
        weights: wp.array[wp.float32],
        steepness: wp.float32,
        strip_height: wp.int32,
        rows: wp.int32,
        width: wp.int32,
        channels: wp.int32,
        # outputs
        target: wp.array[element],
    ):
        i = wp.tid() + first
        strips = (rows + strip_height - 1) / strip_height
        row = (i % strips) * strip_height
        end = wp.min(row + strip_height, rows)
        start = (i / strips) * rows * width
        filter_strip(source, target, weights, steepness, start, row, end, rows, width, channels)

    return filter_strips


filter_floats = filtering_kernel(mean_of_floats, wp.float32)
filter_bytes = filtering_kernel(mean_of_bytes, wp.uint8)
filter_maxima = filtering_kernel(maximum_of_floats, wp.float32)
filter_logarithms = filtering_kernel(logarithmic_mean_of_floats, wp.float32)


# --- the plain twins: one passage along the rows, then one down the columns


@wp.func
def tap_at(
    source: wp.array[wp.float32],
    index: wp.int32,
    stride: wp.int32,
    place: wp.int32,
    count: wp.int32,
    offset: wp.int32,
):
    """Value ``offset`` texels from the one at ``index``, the ``place``-th of ``count`` along the filter's axis."""
    return source[index + (wp.clamp(place + offset, 0, count - 1) - place) * stride]


@wp.func
def mean_plain(
    source: wp.array[wp.float32],
    weights: wp.array[wp.float32],
    steepness: wp.float32,  # noqa: ARG001 - as its twins
    index: wp.int32,
    stride: wp.int32,
    place: wp.int32,
    count: wp.int32,
):
    """Weighted mean along one axis."""
    taps = weights.shape[0]
    before = taps // 2
    centre = source[index]
    total = wp.float32(centre)
    if taps % 2 == 1:
        for k in range(1, before + 1):
            pair = tap_at(source, index, stride, place, count, -k) + tap_at(source, index, stride, place, count, k)
            total += weights[before + k] * (pair - (centre + centre))
    else:
        for k in range(taps):
            total += weights[k] * (tap_at(source, index, stride, place, count, k - before) - centre)
    return total


@wp.func
def maximum_plain(
    source: wp.array[wp.float32],
    weights: wp.array[wp.float32],
    steepness: wp.float32,  # noqa: ARG001 - as its twins
    index: wp.int32,
    stride: wp.int32,
    place: wp.int32,
    count: wp.int32,
):
    """Largest value under the taps along one axis."""
    before = weights.shape[0] // 2
    most = source[index]
    for k in range(weights.shape[0]):
        most = wp.max(most, tap_at(source, index, stride, place, count, k - before))
    return most


@wp.func
def logarithmic_mean_plain(
    source: wp.array[wp.float32],
    weights: wp.array[wp.float32],
    steepness: wp.float32,
    index: wp.int32,
    stride: wp.int32,
    place: wp.int32,
    count: wp.int32,
):
    """Logarithm of the weighted mean of exponentials along one axis, by steepness."""
    taps = weights.shape[0]
    before = taps // 2
    most = maximum_plain(source, weights, steepness, index, stride, place, count)
    centre = exponential(steepness * (source[index] - most))
    total = wp.float32(centre)
    for k in range(taps):
        if k != before:
            x = tap_at(source, index, stride, place, count, k - before)
            total += weights[k] * (exponential(steepness * (x - most)) - centre)
    return most + logarithm(total) * (wp.float32(1.0) / steepness)


def plain_filtering_kernel(filter_along):
    """Make the kernel that filters floats along one axis: rows (stride: channels) or columns (stride: width)."""

    @wp.kernel
    def filter_values(
        first: wp.int32,
        # inputs
        source: wp.array[wp.float32],
        weights: wp.array[wp.float32],
        steepness: wp.float32,
        stride: wp.int32,
        count: wp.int32,
        # outputs
        target: wp.array[wp.float32],
    ):
        i = wp.tid() + first
        target[i] = filter_along(source, weights, steepness, i, stride, (i / stride) % count, count)

    return filter_values
