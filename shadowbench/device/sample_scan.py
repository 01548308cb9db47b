"""The inner loop of the irregular rasterisers: one triangle against a run of samples, sixteen at a time.

Samples lie in separate arrays, so that a run is contiguous. What an opaque triangle shadows gets the depth
``SHADOWED``, nearer to the light than everything, and no later test passes; a translucent one multiplies the samples'
share of light, channel by channel. :func:`scan` decides what float32 can decide and lists the doubtful samples, which
the caller hands to the exact predicate. :func:`scan_plainly` is the same function in plain Warp, one sample at a time:
the meaning, and the oracle in tests.
"""

import warp as wp

from shadowbench.device.blockers import EDGE_BAND, Blocker
from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.sample_space import SHADOWED

wp.set_module_options(kernel_options(native=True))

LANES = wp.constant(16)
"""Samples a step of :func:`scan`, which may read, but never uses or writes, as many beyond a run's end."""

BLOCK = wp.constant(1 << 14)
"""Samples that :func:`write_shadows` handles in a row."""

DOUBTFUL_ROOM = wp.constant(64)
"""Length of the list of doubtful samples; a scan stops early while a whole step still fits."""


@wp.struct
class SampleArrays:
    """Samples by their coordinates, in the order of some layout.

    Attributes:
        x, y, depth: Sample coordinates (:mod:`shadowbench.device.sample_space`), shape [sample_count + LANES] at least.
        source: Number of the point each sample came from, of the same shape.
        red, green, blue: Share of the light that translucent triangles let through so far, of the same shape; empty
            where all casters are opaque.
    """

    x: wp.array[wp.float32]
    y: wp.array[wp.float32]
    depth: wp.array[wp.float32]
    source: wp.array[wp.int32]
    red: wp.array[wp.float32]
    green: wp.array[wp.float32]
    blue: wp.array[wp.float32]


@wp.struct
class Scan:
    """What a scan found.

    Attributes:
        next: Where to go on; at or beyond the run's end when it is done.
        doubtful_count: How many doubtful samples were listed.
        tested_count: Unshadowed samples that the triangle covers or may cover and that do not lie in its plane (its own
            and its coplanar neighbours' samples do).
    """

    next: wp.int32
    doubtful_count: wp.int32
    tested_count: wp.int32


@wp.func_native("""
    typedef float lanes __attribute__((ext_vector_type(16)));
    typedef float loaded __attribute__((ext_vector_type(16), aligned(4)));
    typedef int mask __attribute__((ext_vector_type(16)));
    typedef bool bits __attribute__((ext_vector_type(16)));
    const auto bits_of = [](mask lanes_of) -> unsigned {
        const bits packed = __builtin_convertvector(lanes_of, bits);
        unsigned short which;
        __builtin_memcpy(&which, &packed, 2);
        return which;
    };
    const float* xs = samples.x.data; const float* ys = samples.y.data; float* depths = samples.depth.data;
    float* const light[3] = {samples.red.data, samples.green.data, samples.blue.data};
    const bool is_opaque = transmittance[0] == 0.0f && transmittance[1] == 0.0f && transmittance[2] == 0.0f;
    const float ax = blocker.edge_a[0], ay = blocker.edge_a[1], a1 = blocker.edge_a[2];
    const float bx = blocker.edge_b[0], by = blocker.edge_b[1], b1 = blocker.edge_b[2];
    const float cx = blocker.edge_c[0], cy = blocker.edge_c[1], c1 = blocker.edge_c[2];
    int doubtful_count = 0, i = begin;
    mask tested = 0;
    for (; i < end && doubtful_count <= room - 16; i += 16) {
        const lanes x = *(const loaded*)(xs + i), y = *(const loaded*)(ys + i), depth = *(const loaded*)(depths + i);
        const lanes a = ax * x + ay * y + a1, b = bx * x + by * y + b1, c = cx * x + cy * y + c1;
        const lanes inside = __builtin_elementwise_min(a, __builtin_elementwise_min(b, c));
        mask covered = (inside >= -band) & (depth > shadowed_depth);
        if (end - i < 16) {
            const mask lane = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
            covered &= lane < end - i;
        }
        if (__builtin_reduce_or(covered) == 0) continue;
        const lanes across = blocker.plane[0] * x + blocker.plane[1] * y;
        const lanes maybe = across + blocker.plane_maybe[0] * depth + blocker.plane_maybe[1];
        const lanes surely = across + blocker.plane_surely[0] * depth + blocker.plane_surely[1];
        const lanes before = across + blocker.plane_before[0] * depth + blocker.plane_before[1];
        const mask behind = covered & (depth > blocker.box.nearest) & (maybe > 0.0f);
        tested -= behind | (covered & (before < 0.0f));
        const mask shadowed = behind & (inside > band) & (surely > 0.0f);
        if (__builtin_reduce_or(shadowed) != 0) {
            if (end - i < 16)  // what follows the run may be another thread's: only the run's own samples are written
                for (unsigned rest = bits_of(shadowed); rest != 0; rest &= rest - 1) {
                    const int j = i + __builtin_ctz(rest);
                    if (is_opaque) depths[j] = shadowed_depth;
                    else for (int k = 0; k < 3; ++k) light[k][j] *= transmittance[k];
                }
            else if (is_opaque) *(loaded*)(depths + i) = shadowed ? (lanes)shadowed_depth : depth;
            else for (int k = 0; k < 3; ++k) {
                const lanes before_it = *(const loaded*)(light[k] + i);
                *(loaded*)(light[k] + i) = shadowed ? before_it * transmittance[k] : before_it;
            }
        }
        const mask doubtful = behind & ~shadowed;
        if (__builtin_reduce_or(doubtful) == 0) continue;
        for (unsigned rest = bits_of(doubtful); rest != 0; rest &= rest - 1)
            doubtful_list.data[doubtful_count++] = i + __builtin_ctz(rest);
    }
    return wp::vec_t<3, int>(i, doubtful_count, __builtin_reduce_add(tested));
""")
def _scan(
    samples: SampleArrays,
    blocker: Blocker,
    transmittance: wp.vec3,
    begin: wp.int32,
    end: wp.int32,
    band: wp.float32,
    shadowed_depth: wp.float32,
    room: wp.int32,
    doubtful_list: wp.array[wp.int32],
) -> wp.vec3i: ...


@wp.func
def scan(
    samples: SampleArrays,
    blocker: Blocker,
    transmittance: wp.vec3,
    begin: wp.int32,
    end: wp.int32,
    doubtful: wp.array[wp.int32],
):
    """Shadow what the triangle surely shadows of the samples ``begin .. end``, and list the doubtful ones."""
    counts = _scan(samples, blocker, transmittance, begin, end, EDGE_BAND, SHADOWED, DOUBTFUL_ROOM, doubtful)
    found = Scan()
    found.next = counts[0]
    found.doubtful_count = counts[1]
    found.tested_count = counts[2]
    return found


@wp.func
def is_opaque(transmittance: wp.vec3):
    return transmittance[0] == 0.0 and transmittance[1] == 0.0 and transmittance[2] == 0.0


@wp.func
def shadow(samples: SampleArrays, i: wp.int32, transmittance: wp.vec3):
    """Let a triangle shadow a sample: for good, or by its transmittance."""
    if is_opaque(transmittance):
        samples.depth[i] = SHADOWED
    else:
        samples.red[i] = samples.red[i] * transmittance[0]
        samples.green[i] = samples.green[i] * transmittance[1]
        samples.blue[i] = samples.blue[i] * transmittance[2]


@wp.func
def scan_plainly(
    samples: SampleArrays,
    blocker: Blocker,
    transmittance: wp.vec3,
    begin: wp.int32,
    end: wp.int32,
    doubtful: wp.array[wp.int32],
):
    """The meaning of :func:`scan`."""
    found = Scan()
    i = begin
    while i < end and found.doubtful_count < DOUBTFUL_ROOM:
        x = samples.x[i]
        y = samples.y[i]
        depth = samples.depth[i]
        a = blocker.edge_a[0] * x + blocker.edge_a[1] * y + blocker.edge_a[2]
        b = blocker.edge_b[0] * x + blocker.edge_b[1] * y + blocker.edge_b[2]
        c = blocker.edge_c[0] * x + blocker.edge_c[1] * y + blocker.edge_c[2]
        inside = wp.min(a, wp.min(b, c))
        if inside >= -EDGE_BAND and depth > SHADOWED:
            across = blocker.plane[0] * x + blocker.plane[1] * y
            maybe = across + blocker.plane_maybe[0] * depth + blocker.plane_maybe[1]
            surely = across + blocker.plane_surely[0] * depth + blocker.plane_surely[1]
            before = across + blocker.plane_before[0] * depth + blocker.plane_before[1]
            behind = depth > blocker.box.nearest and maybe > 0.0
            if behind or before < 0.0:
                found.tested_count += 1
            if behind:
                if inside > EDGE_BAND and surely > 0.0:
                    shadow(samples, i, transmittance)
                else:
                    doubtful[found.doubtful_count] = i
                    found.doubtful_count += 1
        i += 1
    found.next = i
    return found


def room_for_samples(count: int, device: str, *, translucency: bool = False) -> SampleArrays:
    """Return arrays for ``count`` samples, with the padding that :func:`scan` reads beyond them.

    Args:
        count: Number of samples.
        device: Where.
        translucency: Whether casters may let light through.
    """
    samples = SampleArrays()
    padded = count + int(LANES)
    samples.x = wp.zeros(padded, dtype=wp.float32, device=device)
    samples.y = wp.zeros(padded, dtype=wp.float32, device=device)
    samples.depth = wp.full(padded, float(SHADOWED), dtype=wp.float32, device=device)
    samples.source = wp.zeros(padded, dtype=wp.int32, device=device)
    if translucency:
        samples.red, samples.green, samples.blue = (wp.empty(padded, dtype=wp.float32, device=device) for _ in range(3))
    return samples


def light_fully(samples: SampleArrays) -> None:
    """Undo what translucent triangles did."""
    for channel in (samples.red, samples.green, samples.blue):
        if channel is not None:
            channel.fill_(1.0)


def bytes_of_samples(samples: SampleArrays) -> int:
    """Return the memory of sample arrays [bytes]."""
    arrays = (samples.x, samples.y, samples.depth, samples.source, samples.red, samples.green, samples.blue)
    return sum(int(array.capacity) for array in arrays if array is not None)


@wp.kernel
def _write_shadows(
    first: wp.int32,
    # inputs
    samples: SampleArrays,
    sample_count: wp.int32,
    # outputs
    visibility: wp.array[wp.float32],
):
    """Carry what opaque triangles did back to the points."""
    block = wp.tid() + first
    for i in range(block * BLOCK, wp.min((block + 1) * BLOCK, sample_count)):
        visibility[samples.source[i]] = wp.where(samples.depth[i] == SHADOWED, wp.float32(0.0), wp.float32(1.0))


@wp.kernel
def _write_light(
    first: wp.int32,
    # inputs
    samples: SampleArrays,
    light: wp.array[wp.float32],
    sample_count: wp.int32,
    # outputs
    visibility: wp.array[wp.float32],
):
    """Carry what opaque and translucent triangles did to one channel back to the points."""
    block = wp.tid() + first
    for i in range(block * BLOCK, wp.min((block + 1) * BLOCK, sample_count)):
        visibility[samples.source[i]] = wp.where(samples.depth[i] == SHADOWED, wp.float32(0.0), light[i])


def write_visibility(samples: SampleArrays, sample_count: int, visibility: wp.array, context: Context) -> None:
    """Set the visibility of all points that have a sample.

    Args:
        samples: Rasterised.
        sample_count: Number of samples.
        visibility: float32, shape [point_count] or, by channel, [point_count, 3]; without channels, what red gets,
            since casters are then colourless.
        context: Where to run.
    """
    blocks = -(-sample_count // int(BLOCK))
    by_channel = [visibility] if visibility.ndim == 1 else [visibility[:, k] for k in range(3)]
    lights = (samples.red, samples.green, samples.blue)
    for channel, light in zip(by_channel, lights, strict=False):
        if light is None:
            launch(_write_shadows, blocks, inputs=[samples, sample_count], outputs=[channel], context=context)
        else:
            launch(_write_light, blocks, inputs=[samples, light, sample_count], outputs=[channel], context=context)
