"""Triangles prepared for the float32 filter in batches, four at once in the lanes of vector registers.

Preparing a triangle (:func:`shadowbench.device.blockers.blocker_of`, the meaning) takes a few hundred float64
operations, half of all rasterising where triangles are small. The native body takes the same operations in the same
order, so its results are the plain function's, bit for bit; triangles that need a branch (thin ones, and those that
reach the light's plane or the near plane) are left to the plain function.
"""

import warp as wp

from shadowbench.device.blockers import (
    BOUNDS_MARGIN,
    DEGENERATE,
    NEEDLE,
    PLANE_BAND,
    WINDOW_SLACK,
    Blocker,
    blocker_of,
)
from shadowbench.device.launch import kernel_options
from shadowbench.device.sample_space import SampleSpace

wp.set_module_options(kernel_options(native=True))

LANES = 4
"""Triangles prepared at once; lists of corners are padded by as many triangles, which are read and never used."""

BATCH = wp.constant(16)
"""Triangles prepared in a row, a multiple of :data:`LANES`: few enough to stay in the first-level cache."""


@wp.func_native("""
    typedef double lanes __attribute__((ext_vector_type(4)));
    typedef float narrow __attribute__((ext_vector_type(4)));
    struct point { lanes x, y, z, w; };
    struct line { lanes x, y, one; };
    const auto least = [](lanes a, lanes b, lanes c) {
        return __builtin_elementwise_min(a, __builtin_elementwise_min(b, c));
    };
    const auto most = [](lanes a, lanes b, lanes c) {
        return __builtin_elementwise_max(a, __builtin_elementwise_max(b, c));
    };
    const auto size = [](lanes a, lanes b, lanes c) {
        return __builtin_elementwise_abs(a) + __builtin_elementwise_abs(b) + __builtin_elementwise_abs(c);
    };
    const auto edge = [](const point& a, const point& b) {
        return line{a.y * b.w - a.w * b.y, a.w * b.x - a.x * b.w, a.x * b.y - a.y * b.x};
    };
    const auto scale_of = [](lanes size, lanes least) { return size > least ? 1.0 / size : (lanes)0.0; };
    const auto put = [&](auto member, lanes value) {
        const narrow rounded = __builtin_convertvector(value, narrow);
        for (int lane = 0; lane < 4; ++lane) member(blockers.data[first + lane]) = rounded[lane];
    };
    const bool perspective = space.is_perspective != 0.0;
    const float* corners = (const float*)(corner.data + 3 * triangle);
    lanes world[3][3];
    point in_window[3];
    for (int v = 0; v < 3; ++v) {
        for (int k = 0; k < 3; ++k) {
            const float* c = corners + 3 * v + k;
            world[v][k] = lanes{c[0], c[9], c[18], c[27]};
        }
        lanes row[4];
        for (int r = 0; r < 4; ++r) {
            const auto& m = space.window_from_world.data[r];
            row[r] = m[0] * world[v][0] + m[1] * world[v][1] + m[2] * world[v][2] + m[3];
        }
        in_window[v] = point{row[0], row[1], row[2], row[3]};
    }
    const point a = in_window[0], b = in_window[1], c = in_window[2];
    const lanes nearest_w = least(a.w, b.w, c.w);
    auto irregular = nearest_w != nearest_w;
    if (space.light.near > 0.0) irregular |= nearest_w <= space.light.near * slack;
    if (perspective) irregular |= nearest_w * space.farthest_inverse <= degenerate;

    // edges: outlined()
    const line ea = edge(b, c), eb = edge(c, a), ec = edge(a, b);
    const lanes size_a = size(a.x, a.y, a.w), size_b = size(b.x, b.y, b.w), size_c = size(c.x, c.y, c.w);
    const lanes least_a = degenerate * (size_b * size_c), least_b = degenerate * (size_c * size_a);
    const lanes least_c = degenerate * (size_a * size_b);
    const lanes la = size(ea.x, ea.y, ea.one), lb = size(eb.x, eb.y, eb.one), lc = size(ec.x, ec.y, ec.one);
    const lanes volume = a.x * ea.x + a.y * ea.y + a.w * ea.one;
    irregular |= __builtin_elementwise_abs(volume) <= degenerate * most(la * size_a, lb * size_b, lc * size_c);
    irregular |= most(la - least_a, lb - least_b, lc - least_c) <= 0.0;
    const lanes sign = volume < 0.0 ? (lanes)-1.0 : (lanes)1.0;
    const lanes fa = sign * scale_of(la, least_a), fb = sign * scale_of(lb, least_b), fc = sign * scale_of(lc, least_c);
    put([](auto& t) -> float& { return t.edge_a[0]; }, ea.x * fa);
    put([](auto& t) -> float& { return t.edge_a[1]; }, ea.y * fa);
    put([](auto& t) -> float& { return t.edge_a[2]; }, ea.one * fa);
    put([](auto& t) -> float& { return t.edge_b[0]; }, eb.x * fb);
    put([](auto& t) -> float& { return t.edge_b[1]; }, eb.y * fb);
    put([](auto& t) -> float& { return t.edge_b[2]; }, eb.one * fb);
    put([](auto& t) -> float& { return t.edge_c[0]; }, ec.x * fc);
    put([](auto& t) -> float& { return t.edge_c[1]; }, ec.y * fc);
    put([](auto& t) -> float& { return t.edge_c[2]; }, ec.one * fc);

    // bounds: box_of()
    const lanes qa = perspective ? 1.0 / a.w : (lanes)1.0, qb = perspective ? 1.0 / b.w : (lanes)1.0;
    const lanes qc = perspective ? 1.0 / c.w : (lanes)1.0;
    put([](auto& t) -> float& { return t.box.low[0]; }, least(a.x * qa, b.x * qb, c.x * qc) - margin);
    put([](auto& t) -> float& { return t.box.low[1]; }, least(a.y * qa, b.y * qb, c.y * qc) - margin);
    put([](auto& t) -> float& { return t.box.high[0]; }, most(a.x * qa, b.x * qb, c.x * qc) + margin);
    put([](auto& t) -> float& { return t.box.high[1]; }, most(a.y * qa, b.y * qb, c.y * qc) + margin);
    const lanes q = most(qa, qb, qc), far = space.farthest_inverse;
    put([](auto& t) -> float& { return t.box.nearest; },
        perspective ? far - q - margin * (q + far) : least(a.z, b.z, c.z) - margin);

    // plane: with_plane()
    lanes ab[3], ac[3];
    for (int k = 0; k < 3; ++k) { ab[k] = world[1][k] - world[0][k]; ac[k] = world[2][k] - world[0][k]; }
    lanes nx = ab[1] * ac[2] - ab[2] * ac[1], ny = ab[2] * ac[0] - ab[0] * ac[2], nz = ab[0] * ac[1] - ab[1] * ac[0];
    const lanes squared = nx * nx + ny * ny + nz * nz;
    lanes offset = -(nx * world[0][0] + ny * world[0][1] + nz * world[0][2]);
    const auto& light = space.light.point;
    const lanes side = nx * light[0] + ny * light[1] + nz * light[2] + offset * light[3];
    const lanes ab_ab = ab[0] * ab[0] + ab[1] * ab[1] + ab[2] * ab[2];
    const lanes ac_ac = ac[0] * ac[0] + ac[1] * ac[1] + ac[2] * ac[2];
    irregular |= (side == 0.0) | (squared <= needle * ab_ab * ac_ac);
    const lanes inverse_length = 1.0 / __builtin_elementwise_sqrt(squared),
                inverse = side > 0.0 ? -inverse_length : inverse_length;
    nx *= inverse; ny *= inverse; nz *= inverse; offset *= inverse;
    lanes p[4];
    for (int r = 0; r < 4; ++r) {
        const auto& m = space.plane_from_world.data[r];
        p[r] = m[0] * nx + m[1] * ny + m[2] * nz + m[3] * offset;
    }
    const double shift = space.tolerance, one_inverse = perspective ? space.farthest_inverse : 1.0;
    const lanes depth = perspective ? p[2] + shift : p[2], one = p[3] - shift * one_inverse;
    const lanes of_depth = plane_band * __builtin_elementwise_abs(depth);
    const lanes scaled = perspective ? of_depth : (lanes)0.0;
    const lanes fixed = perspective ? plane_band * size(p[0], p[1], one)
                                    : plane_band * (size(p[0], p[1], one) + __builtin_elementwise_abs(depth));
    put([](auto& t) -> float& { return t.plane[0]; }, p[0]);
    put([](auto& t) -> float& { return t.plane[1]; }, p[1]);
    put([](auto& t) -> float& { return t.plane_maybe[0]; }, depth - scaled);
    put([](auto& t) -> float& { return t.plane_maybe[1]; }, one + fixed);
    put([](auto& t) -> float& { return t.plane_surely[0]; }, depth + scaled);
    put([](auto& t) -> float& { return t.plane_surely[1]; }, one - fixed);
    put([](auto& t) -> float& { return t.plane_before[0]; }, depth - 2.0 * space.is_perspective * shift);
    put([](auto& t) -> float& { return t.plane_before[1]; }, one + 2.0 * shift * one_inverse);

    int irregular_bits = 0;
    for (int lane = 0; lane < 4; ++lane) irregular_bits |= (irregular[lane] != 0) << lane;
    return irregular_bits;
""")
def _prepare_four(
    space: SampleSpace,
    corner: wp.array[wp.vec3],
    triangle: wp.int32,
    degenerate: wp.float64,
    slack: wp.float64,
    margin: wp.float64,
    plane_band: wp.float64,
    needle: wp.float64,
    first: wp.int32,
    blockers: wp.array[Blocker],
) -> wp.int32: ...


@wp.func
def prepare_batch(
    space: SampleSpace, corner: wp.array[wp.vec3], begin: wp.int32, count: wp.int32, blockers: wp.array[Blocker]
):
    """Prepare ``count`` triangles, at most :data:`BATCH`, from the one numbered ``begin`` in a list of corners."""
    for first in range(0, count, LANES):
        irregular = _prepare_four(
            space,
            corner,
            begin + first,
            DEGENERATE,
            WINDOW_SLACK,
            BOUNDS_MARGIN,
            PLANE_BAND,
            NEEDLE,
            first,
            blockers,
        )
        if irregular != 0:
            for lane in range(LANES):
                if (irregular >> lane) & 1 != 0 and first + lane < count:
                    k = 3 * (begin + first + lane)
                    blockers[first + lane] = blocker_of(space, corner[k], corner[k + 1], corner[k + 2])
