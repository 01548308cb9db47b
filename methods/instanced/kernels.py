"""Look-ups into casters' own maps, and the two ways to apply them: caster by caster to candidates, or all to all."""

import warp as wp

from shadowbench.device.bounding_volume_geometry import MOST_PLANES
from shadowbench.device.bounding_volumes_kernels import span_of_row
from shadowbench.device.launch import kernel_options
from shadowbench.device.plane_tests import RUN_LENGTH, behind_planes
from shadowbench.device.rays import lowest_lane, without_lowest
from shadowbench.device.shadow_lookup import cube_face

wp.set_module_options(kernel_options(native=True))

NO_BLOCKER = wp.constant(wp.float64(-1.0e300))
"""Instead of a depth."""

FILL = wp.constant(0)
CANDIDATES = wp.constant(1)
LOOK_UPS = wp.constant(2)
SHADOWED = wp.constant(3)
LARGEST_OVERDRAW = wp.constant(4)
COUNTER_COUNT = 5
"""Columns of the counters."""


@wp.struct
class CasterMaps:
    """All maps, and how casters look them up. A *view* is one caster's use of one map.

    Attributes:
        depth: The texels of all maps; linear depth, 1 where empty.
        views_of_caster: How many views each caster has: those of caster c are numbered from c times this.
        texel_from_world: Rows x·w, y·w [texels], depth less the bias, and w of every view, each (n, d) of n·p + d;
            shape [4 · view_count].
        near: w below which nothing is in the map, of every view; orthographic ones have w = 1 everywhere.
        share: Of the result, where those of two maps are interpolated.
        length: The share times what a unit of depth is in the world [scene units], where depths are interpolated.
        place: Of every view, where its map begins, and its width and height [texels]; a width of 0 if it has no map.
        transmittance: Of each caster, by channel.
        light: Position of a point light.
    """

    depth: wp.array[wp.float32]
    views_of_caster: wp.int32
    texel_from_world: wp.array[wp.vec4d]
    near: wp.array[wp.float64]
    share: wp.array[wp.float64]
    length: wp.array[wp.float64]
    place: wp.array[wp.vec2i]
    transmittance: wp.array[wp.vec3]
    light: wp.vec3d


# --- one caster and one receiver


@wp.func
def row_at(maps: CasterMaps, view: wp.int32, row: wp.int32, p: wp.vec3d):
    r = maps.texel_from_world[4 * view + row]
    return r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3]


@wp.func
def depth_behind_texel(maps: CasterMaps, view: wp.int32, x: wp.float64, y: wp.float64, depth: wp.float64):
    """How far a depth is behind a texel's; :data:`NO_BLOCKER` if the texel is empty or not in the map."""
    behind = NO_BLOCKER
    place = maps.place[view]
    size = wp.float64(place[1])
    if x >= wp.float64(0.0) and x < size and y >= wp.float64(0.0) and y < size:
        # coordinates are not negative, so that conversion rounds down
        z = maps.depth[place[0] + wp.int32(y) * place[1] + wp.int32(x)]
        if z < 1.0:
            behind = depth - wp.float64(z)
    return behind


@wp.func
def depth_behind_in_orthographic(maps: CasterMaps, view: wp.int32, p: wp.vec3d):
    """How far a receiver is behind the nearest texel of an orthographic map, in the map's depth."""
    return depth_behind_texel(maps, view, row_at(maps, view, 0, p), row_at(maps, view, 1, p), row_at(maps, view, 2, p))


@wp.func
def depth_behind_in_perspective(maps: CasterMaps, view: wp.int32, p: wp.vec3d):
    """The same of a perspective map."""
    behind = NO_BLOCKER
    w = row_at(maps, view, 3, p)
    if w > maps.near[view]:
        x = row_at(maps, view, 0, p) / w
        y = row_at(maps, view, 1, p) / w
        behind = depth_behind_texel(maps, view, x, y, row_at(maps, view, 2, p))
    return behind


@wp.func
def is_behind(depth: wp.float64):
    return depth > wp.float64(0.0)


@wp.func
def share_by_one_map(maps: CasterMaps, c: wp.int32, p: wp.vec3d):
    """Share of the light that a caster leaves a receiver: all or nothing, as its first map says."""
    return wp.where(is_behind(depth_behind_in_orthographic(maps, c * maps.views_of_caster, p)), 0.0, 1.0)


@wp.func
def share_by_depth(maps: CasterMaps, c: wp.int32, p: wp.vec3d):
    """Interpolate depths, of the receiver and of the two maps, then compare once (section 5.5).

    Depths are linear, so the two differences are interpolated, as lengths along the light. Where only one of the two
    texels holds a depth there is nothing to interpolate, and the map of the nearer angle, the first, decides.
    """
    view = c * maps.views_of_caster
    first = depth_behind_in_orthographic(maps, view, p)
    shadowed = is_behind(first)
    if maps.place[view + 1][1] > 0 and first > NO_BLOCKER:
        second = depth_behind_in_orthographic(maps, view + 1, p)
        if second > NO_BLOCKER:
            shadowed = is_behind(maps.length[view] * first + maps.length[view + 1] * second)
    return wp.where(shadowed, 0.0, 1.0)


@wp.func
def share_by_result(maps: CasterMaps, c: wp.int32, p: wp.vec3d):
    """Compare with the two maps, then interpolate the results (section 5.5, "the simplest solution")."""
    lit = wp.float64(1.0)
    for k in range(2):
        view = c * maps.views_of_caster + k
        if is_behind(depth_behind_in_orthographic(maps, view, p)):
            lit -= maps.share[view]
    return wp.float32(lit)


@wp.func
def share_by_spot(maps: CasterMaps, c: wp.int32, p: wp.vec3d):
    """As :func:`share_by_one_map`, under a spot light."""
    return wp.where(is_behind(depth_behind_in_perspective(maps, c * maps.views_of_caster, p)), 0.0, 1.0)


@wp.func
def share_by_cube_face(maps: CasterMaps, c: wp.int32, p: wp.vec3d):
    """As :func:`share_by_one_map`, with the map of the point light's face that the receiver is in."""
    view = c * maps.views_of_caster + cube_face(p - maps.light)
    return wp.where(is_behind(depth_behind_in_perspective(maps, view, p)), 0.0, 1.0)


@wp.func
def dim(visibility: wp.array2d[wp.float32], i: wp.int32, share: wp.float32, transmittance: wp.vec3):
    """Multiply a receiver's light, channel by channel; a translucent caster lets part of what it takes through."""
    for channel in range(visibility.shape[1]):
        visibility[i, channel] = visibility[i, channel] * (share + (1.0 - share) * transmittance[channel])


# --- all casters and all receivers


def kernels_by(share_of_light):
    """Make both kernels that apply maps with one kind of look-up."""

    @wp.kernel
    def apply_to_candidates(
        first: wp.int32,
        # inputs
        maps: CasterMaps,
        planes: wp.array[wp.vec4d],
        plane_counts: wp.array[wp.vec2i],
        lines: wp.array2d[wp.vec3d],
        line_counts: wp.array[wp.int32],
        rows: wp.array[wp.vec2i],
        skips_other_test: wp.bool,
        width: wp.int32,
        height: wp.int32,
        band_height: wp.int32,
        first_of_pixel: wp.array[wp.int32],
        position: wp.array[wp.vec3],
        valid: wp.array[wp.uint8],
        # outputs
        visibility: wp.array2d[wp.float32],
        overdraw: wp.array[wp.int32],
        covered: wp.array[wp.int32],
        candidates: wp.array[wp.int32],
        counters: wp.array2d[wp.int64],
    ):
        """Apply the maps one by one to the receivers of a band of rows (section 5.3).

        A receiver under a volume's outline passes or fails the depth test, which is against the leading planes, then
        the test against the others; both tests are needed to be a candidate, but not for a look-up if
        ``skips_other_test``. ``overdraw`` counts look-ups by receiver; if they have room, ``covered`` counts outlines
        over it, and ``candidates`` volumes that it is in.
        """
        band = wp.tid() + first
        first_row = band * band_height
        end_row = wp.min(first_row + band_height, height)
        begin = first_of_pixel[first_row * width]
        end = first_of_pixel[end_row * width]
        for i in range(begin, end):
            for channel in range(visibility.shape[1]):
                visibility[i, channel] = 1.0
            overdraw[i] = 0

        fill = wp.int64(0)
        candidate_count = wp.int64(0)
        look_up_count = wp.int64(0)
        shadowed_count = wp.int64(0)
        for c in range(rows.shape[0]):
            counts = plane_counts[c]
            first_plane = c * MOST_PLANES
            for row in range(wp.max(rows[c][0], first_row), wp.min(rows[c][1], end_row)):
                span = span_of_row(lines, line_counts, c, row, width)
                first_under = first_of_pixel[row * width + span[0]]
                end_under = first_of_pixel[row * width + span[1]]
                fill += wp.int64(end_under - first_under)
                if covered.shape[0] > 0:
                    for i in range(first_under, end_under):
                        covered[i] = covered[i] + 1
                for start in range(first_under, end_under, RUN_LENGTH):
                    length = wp.min(RUN_LENGTH, end_under - start)
                    passed = behind_planes(position, start, length, planes, first_plane, first_plane + counts[0])
                    inside = passed
                    if passed != wp.uint32(0):
                        inside = passed & behind_planes(
                            position, start, length, planes, first_plane + counts[0], first_plane + counts[1]
                        )
                    if not skips_other_test:
                        passed = inside
                    while passed != wp.uint32(0):
                        lane = lowest_lane(passed)
                        passed = without_lowest(passed)
                        i = start + lane
                        if valid[i] != wp.uint8(0):
                            if (inside >> wp.uint32(lane)) & wp.uint32(1) != wp.uint32(0):
                                candidate_count += wp.int64(1)
                                if candidates.shape[0] > 0:
                                    candidates[i] = candidates[i] + 1
                            look_up_count += wp.int64(1)
                            overdraw[i] = overdraw[i] + 1
                            share = share_of_light(maps, c, wp.vec3d(position[i]))
                            if share < 1.0:
                                shadowed_count += wp.int64(1)
                                dim(visibility, i, share, maps.transmittance[c])

        largest = wp.int32(0)
        for i in range(begin, end):
            largest = wp.max(largest, overdraw[i])
        counters[band, FILL] = fill
        counters[band, CANDIDATES] = candidate_count
        counters[band, LOOK_UPS] = look_up_count
        counters[band, SHADOWED] = shadowed_count
        counters[band, LARGEST_OVERDRAW] = wp.int64(largest)

    @wp.kernel
    def apply_to_all(
        first: wp.int32,
        # inputs
        maps: CasterMaps,
        block_length: wp.int32,
        position: wp.array[wp.vec3],
        valid: wp.array[wp.uint8],
        # outputs
        visibility: wp.array2d[wp.float32],
        counters: wp.array2d[wp.int64],
    ):
        """Query every caster's maps for each receiver of a block (Rege 2004)."""
        block = wp.tid() + first
        look_up_count = wp.int64(0)
        shadowed_count = wp.int64(0)
        for i in range(block * block_length, wp.min((block + 1) * block_length, position.shape[0])):
            for channel in range(visibility.shape[1]):
                visibility[i, channel] = 1.0
            if valid[i] != wp.uint8(0):
                p = wp.vec3d(position[i])
                for c in range(maps.transmittance.shape[0]):
                    look_up_count += wp.int64(1)
                    share = share_of_light(maps, c, p)
                    if share < 1.0:
                        shadowed_count += wp.int64(1)
                        dim(visibility, i, share, maps.transmittance[c])
        counters[block, LOOK_UPS] = look_up_count
        counters[block, SHADOWED] = shadowed_count

    return apply_to_candidates, apply_to_all


one_map_to_candidates, one_map_to_all = kernels_by(share_by_one_map)
depths_to_candidates, depths_to_all = kernels_by(share_by_depth)
results_to_candidates, results_to_all = kernels_by(share_by_result)
spot_to_candidates, spot_to_all = kernels_by(share_by_spot)
faces_to_candidates, faces_to_all = kernels_by(share_by_cube_face)
