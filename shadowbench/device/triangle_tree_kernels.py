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

MOST_CURVE_BITS = 14
"""Cells of the Hilbert curve along each axis, as a power of two, where the key has room for them."""


@wp.struct
class Tree:
    """A tree as kernels see it.

    Attributes:
        bounds: Of each node's children, float32: low x of all eight, then low y, low z, high x, high y, high z; an
            absent child is inside out. Flat, shape [node_count * 6 * 8].
        corners: Of each pack's triangles: a.x of all eight, a.y, a.z, b.x, ... c.z; NaN where the last pack has no
            triangle. Flat, shape [pack_count * 9 * 8].
        triangle: Caster triangle in each lane, shape [pack_count * 8]; -1 where there is none.
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
    """Move bit i of a number to bit 3i."""
    y = wp.uint64(x)
    y = (y | (y << wp.uint64(32))) & wp.uint64(0x001F00000000FFFF)
    y = (y | (y << wp.uint64(16))) & wp.uint64(0x001F0000FF0000FF)
    y = (y | (y << wp.uint64(8))) & wp.uint64(0x100F00F00F00F00F)
    y = (y | (y << wp.uint64(4))) & wp.uint64(0x10C30C30C30C30C3)
    return (y | (y << wp.uint64(2))) & wp.uint64(0x1249249249249249)


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
def hilbert_index(x: wp.uint32, y: wp.uint32, z: wp.uint32, highest_bit: wp.uint32):
    """Number of a cell along the Hilbert curve through a cube of cells (Skilling 2004, Programming the Hilbert curve).

    Args:
        highest_bit: Half the number of cells along each axis.
    """
    one = wp.uint32(1)
    bit = wp.uint32(highest_bit)
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
    bit = highest_bit
    while bit > one:
        if (z & bit) != wp.uint32(0):
            flip = flip ^ (bit - one)
        bit = bit >> one
    return (spread_bits(x ^ flip) << wp.uint64(2)) | (spread_bits(y ^ flip) << wp.uint64(1)) | spread_bits(z ^ flip)


@wp.kernel
def write_keys(
    first: wp.int32,
    # inputs
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    low: wp.vec3,
    cells_per_unit: wp.float32,
    curve_bits: wp.int32,
    number_bits: wp.int32,
    # outputs
    keys: wp.array[wp.uint64],
):
    """Number each triangle along the curve by its centroid; the triangle's own number makes keys unique."""
    t = wp.tid() + first
    sum = vertices[indices[3 * t]] + vertices[indices[3 * t + 1]] + vertices[indices[3 * t + 2]]
    cell = (sum / 3.0 - low) * cells_per_unit
    last = float((1 << curve_bits) - 1)
    index = hilbert_index(
        wp.uint32(wp.clamp(cell[0], 0.0, last)),
        wp.uint32(wp.clamp(cell[1], 0.0, last)),
        wp.uint32(wp.clamp(cell[2], 0.0, last)),
        wp.uint32(1 << (curve_bits - 1)),
    )
    keys[t] = (index << wp.uint64(number_bits)) | wp.uint64(t)


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
    number_bits: wp.int32,
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
    number_mask = (wp.uint64(1) << wp.uint64(number_bits)) - wp.uint64(1)
    nothing = wp.vec3(wp.nan, wp.nan, wp.nan)
    for lane in range(LANES):
        place = pack * LANES + lane
        base = pack * 9 * LANES + lane
        t = wp.int32(-1)
        a = nothing
        b = nothing
        c = nothing
        if place < keys.shape[0]:
            t = wp.int32(keys[place] & number_mask)
            a = vertices[indices[3 * t]]
            b = vertices[indices[3 * t + 1]]
            c = vertices[indices[3 * t + 2]]
            low = wp.min(low, wp.min(a, wp.min(b, c)))
            high = wp.max(high, wp.max(a, wp.max(b, c)))
        triangle[place] = t
        store_vector(corners, base, a)
        store_vector(corners, base + 3 * LANES, b)
        store_vector(corners, base + 6 * LANES, c)
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
