"""Kernels of the alias-free rasteriser: the 2-D BSP over samples, and triangles through it.

The tree is complete and stored as a heap: node 1 is the root, node n has the children 2n and 2n + 1. At level l node k
(counted from the left) holds the samples ``k count / 2^l .. (k + 1) count / 2^l``, rounded down, which halves every
node's samples to within one and needs no stored index.
"""

import warp as wp

from shadowbench.device.blocker_batches import BATCH, prepare_batch
from shadowbench.device.blocker_bins import (
    TRIANGLE_BLOCK,
    BlockerLists,
    Transmittances,
    list_triangle,
    transmittance_of,
)
from shadowbench.device.blockers import EDGE_BAND, Blocker, blocker_of, box_of, meets_window, outlined
from shadowbench.device.exact_decision import shadow_run
from shadowbench.device.launch import kernel_options
from shadowbench.device.sample_partition import split_at_median
from shadowbench.device.sample_scan import DOUBTFUL_ROOM, SampleArrays, is_opaque
from shadowbench.device.sample_space import FARTHEST, SHADOWED, SampleSpace, window_point

wp.set_module_options(kernel_options(native=True))

SAMPLE_BLOCK = wp.constant(1 << 12)


@wp.struct
class Tree:
    """The BSP.

    Attributes:
        sample_count: Samples under the root.
        levels: Leaves are at this level, the root at 0.
        cut: Level whose nodes are the regions that threads own.
        bounds: Of each node's samples: (low x, low y, high x, high y), shape [2^(levels + 1)].
        deepest: Largest depth of each node's unshadowed samples, SHADOWED if there are none; without culling FARTHEST.
            Shape [2^(levels + 1)].
    """

    sample_count: wp.int32
    levels: wp.int32
    cut: wp.int32
    bounds: wp.array[wp.vec4]
    deepest: wp.array[wp.float32]


@wp.func
def first_of(number: wp.int32, level: wp.int32, sample_count: wp.int32):
    """Where the samples of a level's node begin."""
    return wp.int32((wp.int64(number) * wp.int64(sample_count)) >> wp.int64(level))


# ----------------------------------------------------------------------------------------------------- construction


@wp.func
def split_node(records: wp.array[wp.vec4], number: wp.int32, level: wp.int32, sample_count: wp.int32):
    """Halve a node's samples, along x at even levels and along y at odd ones."""
    split_at_median(
        records,
        first_of(number, level, sample_count),
        first_of(2 * number + 1, level + 1, sample_count),
        first_of(number + 1, level, sample_count),
        level % 2,
    )


@wp.kernel
def split_level(
    first: wp.int32,
    # inputs
    sample_count: wp.int32,
    level: wp.int32,
    # outputs
    records: wp.array[wp.vec4],
):
    split_node(records, wp.tid() + first, level, sample_count)


@wp.kernel
def build_subtrees(
    first: wp.int32,
    # inputs
    tree: Tree,
    culling: wp.bool,
    records: wp.array[wp.vec4],
    # outputs
    samples: SampleArrays,
):
    """Split a subtree below the cut down to its leaves, lay its samples down, and bound its nodes."""
    number = wp.tid() + first
    for level in range(tree.cut, tree.levels):
        below = level - tree.cut
        for k in range(number << below, (number + 1) << below):
            split_node(records, k, level, tree.sample_count)
    below_cut = tree.levels - tree.cut
    for k in range(number << below_cut, (number + 1) << below_cut):
        low = wp.vec2(FARTHEST, FARTHEST)
        high = -low
        deepest = -FARTHEST
        for i in range(first_of(k, tree.levels, tree.sample_count), first_of(k + 1, tree.levels, tree.sample_count)):
            r = records[i]
            samples.x[i] = r[0]
            samples.y[i] = r[1]
            samples.depth[i] = r[2]
            samples.source[i] = wp.cast(r[3], wp.int32)
            low = wp.min(low, wp.vec2(r[0], r[1]))
            high = wp.max(high, wp.vec2(r[0], r[1]))
            deepest = wp.max(deepest, r[2])
        node = (1 << tree.levels) + k
        tree.bounds[node] = wp.vec4(low[0], low[1], high[0], high[1])
        tree.deepest[node] = wp.where(culling, deepest, FARTHEST)
    for up in range(below_cut):
        level = tree.levels - 1 - up
        first_node = ((1 << tree.cut) + number) << (level - tree.cut)
        for node in range(first_node, first_node + (1 << (level - tree.cut))):
            join_children(tree, node)


@wp.func
def join_children(tree: Tree, node: wp.int32):
    """A node's bounds and depth from its children's."""
    a = tree.bounds[2 * node]
    b = tree.bounds[2 * node + 1]
    tree.bounds[node] = wp.vec4(wp.min(a[0], b[0]), wp.min(a[1], b[1]), wp.max(a[2], b[2]), wp.max(a[3], b[3]))
    tree.deepest[node] = wp.max(tree.deepest[2 * node], tree.deepest[2 * node + 1])


@wp.kernel
def join_level(
    first: wp.int32,
    # inputs
    first_node: wp.int32,
    tree: Tree,
):
    """Bound the nodes of a level above the cut."""
    join_children(tree, first_node + first + wp.tid())


# ------------------------------------------------------------------------------------------------------- traversal


@wp.func
def greatest_over(f: wp.vec3, node: wp.vec4):
    """The largest value of f.x x + f.y y + f.z in a node, rounded as the samples' own values are: none exceeds it."""
    return wp.max(f[0] * node[0], f[0] * node[2]) + wp.max(f[1] * node[1], f[1] * node[3]) + f[2]


@wp.func
def touches(blocker: Blocker, node: wp.vec4):
    """Whether a triangle may cover a sample within a node's bounds."""
    box = blocker.box
    if box.low[0] > node[2] or box.high[0] < node[0] or box.low[1] > node[3] or box.high[1] < node[1]:
        return False
    return (
        greatest_over(blocker.edge_a, node) >= -EDGE_BAND
        and greatest_over(blocker.edge_b, node) >= -EDGE_BAND
        and greatest_over(blocker.edge_c, node) >= -EDGE_BAND
    )


@wp.func
def is_culled(blocker: Blocker, deepest: wp.float32):
    """Whether a node's unshadowed samples are all nearer to the light than the whole triangle, or there are none."""
    return deepest <= blocker.box.nearest


@wp.func
def next_node(node: wp.int32, root: wp.int32):
    """The node after a finished one, depth first; 0 when the root is finished."""
    while node != root and node % 2 == 1:
        node = node / 2
    if node == root:
        return wp.int32(0)
    return node + 1


@wp.kernel
def find_subtrees(
    first: wp.int32,
    # inputs
    space: SampleSpace,
    tree: Tree,
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    # outputs
    found: wp.array[wp.uint64],
    count: wp.array2d[wp.int32],
):
    """The subtrees below the cut that each triangle reaches, as a bit each; counted by block and subtree.

    One more column counts the nodes visited down to the cut.
    """
    block = wp.tid() + first
    first_subtree = 1 << tree.cut
    visited = wp.int32(0)
    for t in range(block * TRIANGLE_BLOCK, wp.min((block + 1) * TRIANGLE_BLOCK, indices.shape[0] / 3)):
        a = window_point(space, vertices[indices[3 * t]])
        b = window_point(space, vertices[indices[3 * t + 1]])
        c = window_point(space, vertices[indices[3 * t + 2]])
        reached = wp.uint64(0)
        box = box_of(space, a, b, c)
        if meets_window(space, box, a, b, c):
            blocker, _is_thin = outlined(Blocker(), a, b, c)
            blocker.box = box
            node = wp.int32(1)
            while node != 0:
                visited += 1
                goes_down = touches(blocker, tree.bounds[node])
                if goes_down and node < first_subtree:
                    goes_down = not is_culled(blocker, tree.deepest[node])
                if goes_down and node >= first_subtree:
                    region = node - first_subtree
                    reached = reached | (wp.uint64(1) << wp.uint64(region))
                    count[block, region] = count[block, region] + 1
                    goes_down = False
                if goes_down:
                    node = 2 * node
                else:
                    node = next_node(node, 1)
        else:
            visited += 1  # the root
        found[t] = reached
    count[block, first_subtree] = visited


@wp.kernel
def list_by_subtree(
    first: wp.int32,
    # inputs
    found: wp.array[wp.uint64],
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    cursor: wp.array2d[wp.int32],
    # outputs
    lists: BlockerLists,
):
    """Copy each triangle into the lists of its subtrees."""
    block = wp.tid() + first
    for t in range(block * TRIANGLE_BLOCK, wp.min((block + 1) * TRIANGLE_BLOCK, indices.shape[0] / 3)):
        reached = found[t]
        region = wp.int32(0)
        while reached != wp.uint64(0):
            if reached & wp.uint64(1) != wp.uint64(0):
                k = cursor[block, region]
                cursor[block, region] = k + 1
                list_triangle(lists, k, t, vertices, indices)
            reached = reached >> wp.uint64(1)
            region += 1


# ------------------------------------------------------------------------------------------------------ rasterising


@wp.func
def update_depth(
    tree: Tree, leaf: wp.int32, begin: wp.int32, end: wp.int32, depth: wp.array[wp.float32], root: wp.int32
):
    """Recompute a leaf's largest unshadowed depth and carry it up, as far as it changes anything."""
    deepest = SHADOWED
    for i in range(begin, end):
        deepest = wp.max(deepest, depth[i])
    node = leaf
    changes = deepest < tree.deepest[node]
    tree.deepest[node] = deepest
    while changes and node != root:
        node = node / 2
        deepest = wp.max(tree.deepest[2 * node], tree.deepest[2 * node + 1])
        changes = deepest < tree.deepest[node]
        tree.deepest[node] = deepest


@wp.kernel
def rasterize_subtrees(
    first: wp.int32,
    # inputs
    space: SampleSpace,
    culling: wp.bool,
    position: wp.array[wp.vec3],
    transmittances: Transmittances,
    lists: BlockerLists,
    # outputs
    tree: Tree,
    samples: SampleArrays,
    was_culled: wp.array[wp.uint8],
    counters: wp.array2d[wp.int64],
):
    """Every listed triangle down the subtree, in file order.

    Counters of a subtree: nodes visited, samples tested, samples sent to the exact predicate.
    """
    number = wp.tid() + first
    root = (1 << tree.cut) + number
    first_leaf = 1 << tree.levels
    doubtful = wp.zeros(shape=(DOUBTFUL_ROOM,), dtype=wp.int32)
    visited = wp.int64(0)
    tested = wp.int64(0)
    refined = wp.int64(0)
    blockers = wp.zeros(shape=(BATCH,), dtype=Blocker)
    for first_k in range(lists.first[number], lists.first[number + 1], BATCH):
        count = wp.min(BATCH, lists.first[number + 1] - first_k)
        prepare_batch(space, lists.corner, first_k, count, blockers)
        for j in range(count):
            k = first_k + j
            blocker = blockers[j]
            through = transmittance_of(transmittances, lists.number[k])
            node = root
            nodes = wp.int32(-1)  # the root was counted when it was found
            while node != 0:
                nodes += 1
                goes_down = touches(blocker, tree.bounds[node])
                if goes_down and is_culled(blocker, tree.deepest[node]):
                    was_culled[node] = wp.uint8(1)
                    goes_down = False
                if goes_down and node >= first_leaf:
                    begin = first_of(node - first_leaf, tree.levels, tree.sample_count)
                    end = first_of(node - first_leaf + 1, tree.levels, tree.sample_count)
                    found, doubted = shadow_run(
                        samples,
                        position,
                        space.light,
                        space.tolerance,
                        blocker,
                        lists.corner[3 * k],
                        lists.corner[3 * k + 1],
                        lists.corner[3 * k + 2],
                        through,
                        begin,
                        end,
                        doubtful,
                    )
                    tested += wp.int64(found)
                    refined += wp.int64(doubted)
                    if culling and found > 0 and is_opaque(through):
                        update_depth(tree, node, begin, end, samples.depth, root)
                    goes_down = False
                if goes_down:
                    node = 2 * node
                else:
                    node = next_node(node, root)
            visited += wp.int64(nodes)
    counters[number, 0] = visited
    counters[number, 1] = tested
    counters[number, 2] = refined


@wp.kernel
def prepare_blockers(
    first: wp.int32,
    # inputs
    space: SampleSpace,
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    # outputs
    blockers: wp.array[Blocker],
):
    """Prepare every triangle; what is outside the window covers nothing."""
    t = wp.tid() + first
    a = vertices[indices[3 * t]]
    b = vertices[indices[3 * t + 1]]
    c = vertices[indices[3 * t + 2]]
    blocker = blocker_of(space, a, b, c)
    in_window = meets_window(space, blocker.box, window_point(space, a), window_point(space, b), window_point(space, c))
    if not in_window:
        blocker.edge_a = wp.vec3(0.0, 0.0, -1.0)
    blockers[t] = blocker


@wp.kernel
def rasterize_all(
    first: wp.int32,
    # inputs
    space: SampleSpace,
    position: wp.array[wp.vec3],
    vertices: wp.array[wp.vec3],
    indices: wp.array[wp.int32],
    transmittances: Transmittances,
    blockers: wp.array[Blocker],
    sample_count: wp.int32,
    # outputs
    samples: SampleArrays,
    counters: wp.array2d[wp.int64],
):
    """Brute force (paper, section 5): every triangle over every sample, a block of samples at a time."""
    block = wp.tid() + first
    doubtful = wp.zeros(shape=(DOUBTFUL_ROOM,), dtype=wp.int32)
    tested = wp.int64(0)
    refined = wp.int64(0)
    begin = block * SAMPLE_BLOCK
    end = wp.min(begin + SAMPLE_BLOCK, sample_count)
    for t in range(blockers.shape[0]):
        found, doubted = shadow_run(
            samples,
            position,
            space.light,
            space.tolerance,
            blockers[t],
            vertices[indices[3 * t]],
            vertices[indices[3 * t + 1]],
            vertices[indices[3 * t + 2]],
            transmittance_of(transmittances, t),
            begin,
            end,
            doubtful,
        )
        tested += wp.int64(found)
        refined += wp.int64(doubted)
    counters[block, 0] = tested
    counters[block, 1] = refined


@wp.kernel
def split_records(
    first: wp.int32,
    # inputs
    records: wp.array[wp.vec4],
    # outputs
    samples: SampleArrays,
):
    """Samples in the order of the points."""
    i = wp.tid() + first
    r = records[i]
    samples.x[i] = r[0]
    samples.y[i] = r[1]
    samples.depth[i] = r[2]
    samples.source[i] = wp.cast(r[3], wp.int32)
