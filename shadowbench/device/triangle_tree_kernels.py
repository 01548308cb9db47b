"""Kernels that build a triangle tree: number the triangles along a curve, fill packs in that order, enclose.

The tree's layout is :class:`Tree`; what it is for and why its boxes are as large as they are is told in
:mod:`shadowbench.device.triangle_tree`.
"""

import warp as wp

from shadowbench.device.launch import kernel_options

wp.set_module_options(kernel_options(native=True) | {"max_unroll": 1})

LANE_BITS = wp.constant(3)
LANES = wp.constant(8)
"""Children of a node, triangles of a pack, as a power of two: one SIMD register of float32 on most machines."""

MAX_LEVELS = wp.constant(10)
"""Enough for 8^10 packs."""

CURVE_BITS = wp.constant(10)
"""Cells of the Hilbert curve along each axis, as a power of two."""


@wp.struct
class Tree:
    """A tree as kernels see it.

    Attributes:
        bounds: Of each node's children, float32: low x of all eight, then low y, low z, high x, high y, high z; an
            absent child is inside out. Flat, shape [node_count * 6 * 8].
        corners: Of each pack's triangles: a.x of all eight, a.y, a.z, b.x, ... c.z. Flat, shape [pack_count * 9 * 8].
        triangle: Caster triangle in each lane, shape [pack_count * 8]; the last pack repeats its last triangle.
        first_node: Number of each level's first node; level 0 holds the parents of packs.
        top: The root's level.
        scale: Largest absolute coordinate of the world [scene units].
    """

    bounds: wp.array[wp.float32]
    corners: wp.array[wp.float32]
    triangle: wp.array[wp.int32]
    first_node: wp.array[wp.int32]
    top: wp.int32
    scale: wp.float32


@wp.func
def spread_bits(x: wp.uint32):
    """Move bit i of a 10-bit number to bit 3i."""
    x = (x | (x << wp.uint32(16))) & wp.uint32(0x030000FF)
    x = (x | (x << wp.uint32(8))) & wp.uint32(0x0300F00F)
    x = (x | (x << wp.uint32(4))) & wp.uint32(0x030C30C3)
    return (x | (x << wp.uint32(2))) & wp.uint32(0x09249249)


@wp.func
def swap_below(x: wp.uint32, y: wp.uint32, bit: wp.uint32):
    """One step of Skilling's curve: what to flip in x and y below ``bit``, where y has the bit or not."""
    below = bit - wp.uint32(1)
    flip_x = below
    flip_y = wp.uint32(0)
    if (y & bit) == wp.uint32(0):
        flip_x = (x ^ y) & below
        flip_y = flip_x
    return flip_x, flip_y


@wp.func
def hilbert_index(x: wp.uint32, y: wp.uint32, z: wp.uint32):
    """Number of a cell along the Hilbert curve through 2^30 cells (Skilling 2004, Programming the Hilbert curve)."""
    one = wp.uint32(1)
    bit = wp.uint32(1 << (CURVE_BITS - 1))
    while bit > one:
        if (x & bit) != wp.uint32(0):
            x = x ^ (bit - one)
        flip_x, flip_y = swap_below(x, y, bit)
        x = x ^ flip_x
        y = y ^ flip_y
        flip_x, flip_z = swap_below(x, z, bit)
        x = x ^ flip_x
        z = z ^ flip_z
        bit = bit >> one
    # Gray code
    y = y ^ x
    z = z ^ y
    flip = wp.uint32(0)
    bit = wp.uint32(1 << (CURVE_BITS - 1))
    while bit > one:
        if (z & bit) != wp.uint32(0):
            flip = flip ^ (bit - one)
        bit = bit >> one
    return (spread_bits(x ^ flip) << wp.uint32(2)) | (spread_bits(y ^ flip) << one) | spread_bits(z ^ flip)


@wp.func
def cell_of(x: wp.float32, low: wp.float32, cells_per_unit: wp.float32):
    """Cell of the curve's grid along one axis."""
    return wp.uint32(wp.clamp(wp.int32((x - low) * cells_per_unit), 0, (1 << CURVE_BITS) - 1))


@wp.kernel
def write_keys(
    first: wp.int32,
    # inputs
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    low: wp.vec3,
    cells_per_unit: wp.float32,
    # outputs
    keys: wp.array[wp.uint64],
):
    """Number each triangle along the curve by its centroid; the triangle's own number makes keys unique."""
    t = wp.tid() + first
    sum = vertices[indices[3 * t]] + vertices[indices[3 * t + 1]] + vertices[indices[3 * t + 2]]
    centre = sum / 3.0
    index = hilbert_index(
        cell_of(centre[0], low[0], cells_per_unit),
        cell_of(centre[1], low[1], cells_per_unit),
        cell_of(centre[2], low[2], cells_per_unit),
    )
    keys[t] = (wp.uint64(index) << wp.uint64(32)) | wp.uint64(t)


@wp.func
def store_vector(values: wp.array[wp.float32], base: wp.int32, p: wp.vec3):
    """Write one lane of three components, each eight lanes wide."""
    values[base] = p[0]
    values[base + LANES] = p[1]
    values[base + 2 * LANES] = p[2]


@wp.func
def load_vector(values: wp.array[wp.float32], base: wp.int32):
    """Read what :func:`store_vector` wrote."""
    return wp.vec3(values[base], values[base + LANES], values[base + 2 * LANES])


@wp.func
def store_child(bounds: wp.array[wp.float32], node: wp.int32, lane: wp.int32, low: wp.vec3, high: wp.vec3):
    """Write one child's box into its node."""
    base = node * 6 * LANES + lane
    store_vector(bounds, base, low)
    store_vector(bounds, base + 3 * LANES, high)


@wp.kernel
def fill_packs(
    first: wp.int32,
    # inputs
    keys: wp.array[wp.uint64],
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    margin: wp.float32,
    # outputs
    corners: wp.array[wp.float32],
    triangle: wp.array[wp.int32],
    bounds: wp.array[wp.float32],
):
    """Copy eight sorted triangles into a pack, and their inflated box into the pack's parent."""
    pack = wp.tid() + first
    low = wp.vec3(wp.inf, wp.inf, wp.inf)
    high = -low
    for lane in range(LANES):
        place = wp.min(pack * LANES + lane, keys.shape[0] - 1)
        t = wp.int32(keys[place] & wp.uint64(0xFFFFFFFF))
        triangle[pack * LANES + lane] = t
        a = vertices[indices[3 * t]]
        b = vertices[indices[3 * t + 1]]
        c = vertices[indices[3 * t + 2]]
        base = pack * 9 * LANES + lane
        store_vector(corners, base, a)
        store_vector(corners, base + 3 * LANES, b)
        store_vector(corners, base + 6 * LANES, c)
        low = wp.min(low, wp.min(a, wp.min(b, c)))
        high = wp.max(high, wp.max(a, wp.max(b, c)))
    wide = wp.vec3(margin, margin, margin)
    store_child(bounds, pack // LANES, pack % LANES, low - wide, high + wide)


@wp.kernel
def enclose_children(
    first: wp.int32,
    # inputs
    first_node: wp.int32,
    first_parent: wp.int32,
    # outputs
    bounds: wp.array[wp.float32],
):
    """Write the union of a node's children into its parent, one level up."""
    node = wp.tid() + first
    base = (first_node + node) * 6 * LANES
    low = wp.vec3(wp.inf, wp.inf, wp.inf)
    high = -low
    for lane in range(LANES):
        low = wp.min(low, load_vector(bounds, base + lane))
        high = wp.max(high, load_vector(bounds, base + 3 * LANES + lane))
    store_child(bounds, first_parent + node // LANES, node % LANES, low, high)
