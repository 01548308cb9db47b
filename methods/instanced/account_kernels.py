"""Every caster's maps at one receiver, by the functions that look up: for its account only."""

import warp as wp

from shadowbench.device.bounding_volume_geometry import MOST_PLANES
from shadowbench.device.bounding_volumes_kernels import span_of_row
from shadowbench.device.launch import kernel_options
from shadowbench.device.plane_tests import behind_planes
from shadowbench.device.shadow_lookup import cube_face
from shadowbench.methods.instanced.kernels import (
    CasterMaps,
    depth_behind_in_orthographic,
    depth_behind_in_perspective,
    row_at,
    share_by_cube_face,
    share_by_depth,
    share_by_one_map,
    share_by_result,
    share_by_spot,
)

wp.set_module_options(kernel_options(native=True))

VALUE_COUNT = 5
"""Of a view: number, x and y in the map [texels], the receiver's depth, and how far it is behind the texel's."""

MOST_VIEWS = wp.constant(2)


@wp.struct
class View:
    """A caster's use of a map at a receiver; see :data:`VALUE_COUNT`."""

    number: wp.int32
    x: wp.float64
    y: wp.float64
    depth: wp.float64
    behind: wp.float64


@wp.func
def in_orthographic(maps: CasterMaps, view: wp.int32, p: wp.vec3d):
    found = View()
    found.number = view
    found.x = row_at(maps, view, 0, p)
    found.y = row_at(maps, view, 1, p)
    found.depth = row_at(maps, view, 2, p)
    found.behind = depth_behind_in_orthographic(maps, view, p)
    return found


@wp.func
def in_perspective(maps: CasterMaps, view: wp.int32, p: wp.vec3d):
    found = View()
    found.number = view
    w = row_at(maps, view, 3, p)
    found.x = row_at(maps, view, 0, p) / w
    found.y = row_at(maps, view, 1, p) / w
    found.depth = row_at(maps, view, 2, p)
    found.behind = depth_behind_in_perspective(maps, view, p)
    return found


@wp.func
def parallel_view(maps: CasterMaps, c: wp.int32, k: wp.int32, p: wp.vec3d):
    return in_orthographic(maps, c * maps.views_of_caster + wp.min(k, maps.views_of_caster - 1), p)


@wp.func
def spot_view(maps: CasterMaps, c: wp.int32, k: wp.int32, p: wp.vec3d):  # noqa: ARG001 - a caster has one
    return in_perspective(maps, c * maps.views_of_caster, p)


@wp.func
def face_view(maps: CasterMaps, c: wp.int32, k: wp.int32, p: wp.vec3d):  # noqa: ARG001 - the place says which
    return in_perspective(maps, c * maps.views_of_caster + cube_face(p - maps.light), p)


def account_kernel(share_of_light, view_of):
    """Make the kernel that tells what one kind of look-up finds."""

    @wp.kernel
    def tell_casters(
        first: wp.int32,
        # inputs
        maps: CasterMaps,
        position: wp.array[wp.vec3],
        # outputs
        share: wp.array[wp.float32],
        views: wp.array2d[View],
    ):
        c = wp.tid() + first
        p = wp.vec3d(position[0])
        share[c] = share_of_light(maps, c, p)
        for k in range(MOST_VIEWS):
            views[c, k] = view_of(maps, c, k, p)

    return tell_casters


tell_by_one_map = account_kernel(share_by_one_map, parallel_view)
tell_by_depth = account_kernel(share_by_depth, parallel_view)
tell_by_result = account_kernel(share_by_result, parallel_view)
tell_by_spot = account_kernel(share_by_spot, spot_view)
tell_by_cube_face = account_kernel(share_by_cube_face, face_view)


@wp.kernel
def tell_candidates(
    first: wp.int32,
    # inputs
    planes: wp.array[wp.vec4d],
    plane_counts: wp.array[wp.vec2i],
    lines: wp.array2d[wp.vec3d],
    line_counts: wp.array[wp.int32],
    rows: wp.array[wp.vec2i],
    width: wp.int32,
    row: wp.int32,
    column: wp.int32,
    position: wp.array[wp.vec3],
    # outputs
    passed: wp.array[wp.int32],
):
    """For each caster how many of its volume's tests the receiver passes: outline, leading planes, the others."""
    c = wp.tid() + first
    passed[c] = 0
    if row >= rows[c][0] and row < rows[c][1]:
        span = span_of_row(lines, line_counts, c, row, width)
        if column >= span[0] and column < span[1]:
            passed[c] = 1
            counts = plane_counts[c]
            plane = c * MOST_PLANES
            if behind_planes(position, 0, 1, planes, plane, plane + counts[0]) != wp.uint32(0):
                passed[c] = 2
                if behind_planes(position, 0, 1, planes, plane + counts[0], plane + counts[1]) != wp.uint32(0):
                    passed[c] = 3
