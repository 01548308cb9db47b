"""Filtered look-ups into mip chains: nearest, bilinear, trilinear and anisotropic, by the receiver's own footprint.

Warp functions shared by the techniques that filter their maps beforehand. A pixel's footprint in the map follows from
how the receiver's point moves along its plane from pixel to pixel (``position_dx``, ``position_dy``), not from
differences between pixels, which break at silhouettes. The filters are those of graphics hardware: the level of detail
is log2 of the footprint's longer side; an anisotropic look-up takes several taps along that side instead, at a level
that fits the shorter one. Beyond an edge of the map lies the edge's texel again, and a look-up stays in its face.

Every mean is a weighted sum ``(1 - t) a + t b`` of texels, so that equal texels give that value within 4 ulp, and
texels of very different size (exponentials) keep their relative accuracy.
"""

from typing import Any

import warp as wp

from shadowbench.device.elementary_functions import LOG2_E, logarithm
from shadowbench.device.launch import kernel_options
from shadowbench.device.mip_chains_kernels import ChainLayout, first_of_face, level_size
from shadowbench.device.shadow_lookup import LightMaps, MapPoint, find_in_map, motion_in_map, plane_slopes, texel_index
from shadowbench.receivers import DeviceReceivers

wp.set_module_options(kernel_options(native=True))

MOST_TEXELS = wp.constant(wp.float64(1.0e9))
"""A pixel's footprint is never taken for longer: a plane seen edge-on by the camera has no bounded one."""


@wp.struct
class Sampling:
    """How chains are sampled.

    Attributes:
        most_taps: 1, or as many as an anisotropic look-up may take.
        is_nearest: 1 to take the texel of level 0 that holds the receiver, 0 to interpolate.
    """

    most_taps: wp.int32
    is_nearest: wp.int32


def sampling_by(filtering: str, anisotropy: int) -> Sampling:
    """Pack how chains are sampled: ``filtering`` is nearest, bilinear, trilinear or anisotropic.

    Whether a look-up is bilinear or trilinear is up to the chain, which has one level or all.
    """
    sampling = Sampling()
    sampling.most_taps = anisotropy if filtering == "anisotropic" else 1
    sampling.is_nearest = int(filtering == "nearest")
    return sampling


@wp.struct
class PixelPoints:
    """Receivers with their motion from pixel to pixel; attributes as of :class:`shadowbench.receivers.Receivers`."""

    position: wp.array[wp.vec3]
    normal: wp.array[wp.vec3]
    position_dx: wp.array[wp.vec3]
    position_dy: wp.array[wp.vec3]
    valid: wp.array[wp.uint8]


def pixel_points(receivers: DeviceReceivers) -> PixelPoints:
    """Pack receivers for kernels."""
    points = PixelPoints()
    points.position, points.normal, points.valid = receivers.position, receivers.normal, receivers.valid
    points.position_dx, points.position_dy = receivers.position_dx, receivers.position_dy
    return points


@wp.struct
class Footprint:
    """What a look-up averages.

    Attributes:
        x, y: Place of the first tap [texels of level 0].
        step_x, step_y: From tap to tap [texels of level 0].
        taps: Number of taps along the longer side.
        level: The finer level of each tap.
        blend: Share of the next level, in [0, 1); 0 if only one is looked up.
    """

    x: wp.float64
    y: wp.float64
    step_x: wp.float64
    step_y: wp.float64
    taps: wp.int32
    level: wp.int32
    blend: wp.float32


@wp.struct
class Corners:
    """The four texels around a tap.

    Attributes:
        top_left, top_right, bottom_left, bottom_right: Index of each one's first value.
        right, down: Place between their centres, in [0, 1].
    """

    top_left: wp.int32
    top_right: wp.int32
    bottom_left: wp.int32
    bottom_right: wp.int32
    right: wp.float32
    down: wp.float32


@wp.func
def find_pixel(maps: LightMaps, points: PixelPoints, i: wp.int32):
    """Place a receiver in the light's map, as it is."""
    return find_in_map(maps, points.position[i], wp.vec3(), wp.float64(0.0), wp.float64(0.0))


@wp.func
def polygon_offset_at(maps: LightMaps, found: MapPoint, normal: wp.vec3, texels: wp.float64):
    """Polygon offset that the map was drawn with at a receiver, by the slope of its plane [depth]."""
    if texels == wp.float64(0.0):
        return wp.float64(0.0)
    size = wp.float64(maps.depth.shape[2])
    h = wp.vec4d(found.x / size * found.w, found.y / size * found.w, found.depth, found.w)
    slopes = plane_slopes(maps.projection[found.face], h, wp.vec3d(normal), size)
    return texels * wp.max(wp.abs(slopes[0]), wp.abs(slopes[1]))


@wp.func
def find_footprint(
    maps: LightMaps, found: MapPoint, points: PixelPoints, i: wp.int32, layout: ChainLayout, sampling: Sampling
):
    """Find what a receiver's look-up averages.

    Level of detail λ = log2 of the longer side; with several taps N = min(ceil(longer / shorter), most), each at
    λ = log2(longer / N), in the middles of N equal parts of the longer side (Annen et al. 2008; OpenGL's
    EXT_texture_filter_anisotropic). A chain of one level is looked up at level 0, whatever the footprint.

    Args:
        maps: The light and its maps.
        found: The receiver in the map.
        points, i: Where its motion from pixel to pixel is.
        layout: Of the chain.
        sampling: How to sample it.
    """
    footprint = Footprint()
    footprint.x = found.x
    footprint.y = found.y
    footprint.taps = 1
    if sampling.is_nearest != 0:
        footprint.x = wp.floor(found.x) + wp.float64(0.5)
        footprint.y = wp.floor(found.y) + wp.float64(0.5)
        return footprint
    if layout.level_count == 1:
        return footprint
    size = wp.float64(layout.size)
    uv = wp.vec2d(found.x / size, found.y / size)
    m = maps.projection[found.face]
    across = motion_in_map(m, uv, found.w, wp.vec3d(points.position_dx[i]), size)
    down = motion_in_map(m, uv, found.w, wp.vec3d(points.position_dy[i]), size)
    side = across
    other = down
    if down[0] * down[0] + down[1] * down[1] > across[0] * across[0] + across[1] * across[1]:
        side = down
        other = across
    longer = wp.sqrt(side[0] * side[0] + side[1] * side[1])
    shorter = longer
    if sampling.most_taps > 1 and longer < MOST_TEXELS:
        shorter = wp.sqrt(other[0] * other[0] + other[1] * other[1])
    if longer > shorter:
        footprint.taps = sampling.most_taps
        if longer < wp.float64(sampling.most_taps) * shorter:
            footprint.taps = wp.int32(wp.ceil(longer / shorter))
        count = wp.float64(footprint.taps)
        footprint.step_x = side[0] / count
        footprint.step_y = side[1] / count
        before = wp.float64(0.5) * (count - wp.float64(1.0))
        footprint.x -= before * footprint.step_x
        footprint.y -= before * footprint.step_y
        longer = longer / count
    width = wp.float32(longer)
    if width > wp.float32(1.0):
        # λ = log2(width), from its exponent and mantissa
        bits = wp.cast(width, wp.int32)
        footprint.level = wp.min((bits >> 23) - 127, layout.level_count - 1)
        if footprint.level < layout.level_count - 1:
            mantissa = wp.cast((bits & wp.int32(0x007FFFFF)) | wp.int32(0x3F800000), wp.float32)
            footprint.blend = wp.min(logarithm(mantissa) * LOG2_E, wp.float32(0.99999994))
    return footprint


@wp.func
def corners_of(layout: ChainLayout, face: wp.int32, level: wp.int32, x: wp.float64, y: wp.float64):
    """Find the four texels of a level around a place [texels of level 0]."""
    size = level_size(layout, level)
    scale = wp.float64(size) / wp.float64(layout.size)
    last = wp.float64(size - 1)
    column = wp.clamp(x * scale - wp.float64(0.5), wp.float64(0.0), last)
    row = wp.clamp(y * scale - wp.float64(0.5), wp.float64(0.0), last)
    left = texel_index(column)
    right = wp.min(left + 1, size - 1)
    i = texel_index(row)
    first = first_of_face(layout, level, face)
    top = i * size
    bottom = wp.min(i + 1, size - 1) * size
    corners = Corners()
    corners.top_left = first + (top + left) * layout.channels
    corners.top_right = first + (top + right) * layout.channels
    corners.bottom_left = first + (bottom + left) * layout.channels
    corners.bottom_right = first + (bottom + right) * layout.channels
    corners.right = wp.float32(column - wp.float64(left))
    corners.down = wp.float32(row - wp.float64(i))
    return corners


@wp.func
def interpolate(corners: Corners, top_left: Any, top_right: Any, bottom_left: Any, bottom_right: Any):
    """Bilinear mean of the four texels' values."""
    top = wp.lerp(top_left, top_right, corners.right)
    bottom = wp.lerp(bottom_left, bottom_right, corners.right)
    return wp.lerp(top, bottom, corners.down)


def mean_over_footprint(value_at):
    """Make the function that averages over a footprint what ``value_at(values, corners, receiver)`` gives for a tap."""

    @wp.func
    def mean(values: Any, layout: ChainLayout, face: wp.int32, footprint: Footprint, receiver: Any):
        total = value_at(values, corners_of(layout, face, footprint.level, footprint.x, footprint.y), receiver)
        if footprint.blend > wp.float32(0.0):
            coarser = corners_of(layout, face, footprint.level + 1, footprint.x, footprint.y)
            total = wp.lerp(total, value_at(values, coarser, receiver), footprint.blend)
        for tap in range(1, footprint.taps):
            x = footprint.x + wp.float64(tap) * footprint.step_x
            y = footprint.y + wp.float64(tap) * footprint.step_y
            part = value_at(values, corners_of(layout, face, footprint.level, x, y), receiver)
            if footprint.blend > wp.float32(0.0):
                coarser = corners_of(layout, face, footprint.level + 1, x, y)
                part = wp.lerp(part, value_at(values, coarser, receiver), footprint.blend)
            total = total + part
        return total / wp.float32(footprint.taps)

    return mean


@wp.func
def maximum_over_footprint(maxima: wp.array[wp.float32], layout: ChainLayout, face: wp.int32, footprint: Footprint):
    """Largest value of a chain of maxima under a footprint, or a larger one: at level ceil(λ), four texels a tap.

    The four texels at ceil(λ) hold what the four at each finer level hold, so that nothing is missed. A texel of no
    weight is left out.
    """
    level = footprint.level
    if footprint.blend > wp.float32(0.0):
        level += 1
    most = wp.float32(0.0)
    for tap in range(footprint.taps):
        x = footprint.x + wp.float64(tap) * footprint.step_x
        y = footprint.y + wp.float64(tap) * footprint.step_y
        corners = corners_of(layout, face, level, x, y)
        most = wp.max(most, maxima[corners.top_left])
        if corners.right > wp.float32(0.0):
            most = wp.max(most, maxima[corners.top_right])
        if corners.down > wp.float32(0.0):
            most = wp.max(most, maxima[corners.bottom_left])
        if corners.right > wp.float32(0.0) and corners.down > wp.float32(0.0):
            most = wp.max(most, maxima[corners.bottom_right])
    return most


@wp.func
def texels_read(footprint: Footprint):
    """Number of texels a look-up averages."""
    levels = 1
    if footprint.blend > wp.float32(0.0):
        levels = 2
    return 4 * levels * footprint.taps
