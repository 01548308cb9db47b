"""Kernels of the filtered reference: a footprint's points carried onto receivers' planes, and the means of their tests.

A place in the light's window is a ray of the light; the point is where that ray meets the plane through the receiver
at right angles to its normal. All is float64 but the stored point. Where the ray meets the plane farther away than any
caster, or not at all, the point is taken at that distance: nothing lies beyond, so its answer is that of any farther
point. See :mod:`shadowbench.filtered_reference`.
"""

import warp as wp

from shadowbench.device.launch import kernel_options
from shadowbench.device.shadow_lookup import cube_face

wp.set_module_options(kernel_options(native=True))


@wp.struct
class LightRays:
    """The rays of a light through its windows.

    Attributes:
        axes: Of each window, unit axes right, down, forward (the rows).
        texel: Width and height of a texel, at w = 1 for a positional light [scene units].
        position: Of a spot or point light.
        is_positional: 1 or 0.
        farthest: No caster is farther from a receiver along a directional light, or from a positional light along its
            window's axis [scene units].
        widest: Points stay within this tangent of a spot light's axis; infinite for other lights.
    """

    axes: wp.array[wp.mat33d]
    texel: wp.vec2d
    position: wp.vec3d
    is_positional: wp.int32
    farthest: wp.float64
    widest: wp.float64


@wp.func
def point_in_parallel_light(rays: LightRays, p: wp.vec3d, n: wp.vec3d, offset: wp.vec2d):
    """Where the ray of a directional light ``offset`` beside the one through p meets the plane (p, n)."""
    axes = rays.axes[0]
    zero = wp.float64(0.0)
    beside = axes[0] * offset[0] + axes[1] * offset[1]
    height = -wp.dot(n, beside)
    along = zero
    if height != zero:
        along = wp.clamp(height / wp.dot(n, axes[2]), -rays.farthest, rays.farthest)
    return p + beside + axes[2] * along


@wp.func
def within(rays: LightRays, tangent: wp.vec2d):
    """A place in a perspective window, as tangents, held inside the widest cone."""
    length = wp.length(tangent)
    if length > rays.widest:
        return tangent * (rays.widest / length)
    return tangent


@wp.func
def point_in_central_light(rays: LightRays, axes: wp.mat33d, p: wp.vec3d, n: wp.vec3d, offset: wp.vec2d):
    """Where the ray of a positional light ``offset`` (at w = 1) beside the one through p meets the plane (p, n)."""
    zero = wp.float64(0.0)
    q = axes * (p - rays.position)
    tangent = within(rays, wp.vec2d(q[0] / q[2] + offset[0], q[1] / q[2] + offset[1]))
    direction = axes[0] * tangent[0] + axes[1] * tangent[1] + axes[2]
    height = wp.dot(n, p - rays.position)
    w = q[2]  # where the light lies in the plane, every ray meets it nowhere else: as far away as the receiver
    if height != zero:
        w = height / wp.dot(n, direction)
        if w <= zero or w > rays.farthest:  # behind the light: the ray leaves the plane, which it met at infinity
            w = rays.farthest
    return rays.position + direction * w


@wp.kernel
def spread_points(
    first: wp.int32,
    # inputs
    rays: LightRays,
    offsets: wp.array[wp.vec2d],
    receiver: wp.array[wp.int32],
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    # outputs
    point: wp.array2d[wp.vec3],
):
    """Carry a footprint's points onto the planes of the receivers chosen.

    Args:
        offsets: The points [texels], shape [point_count].
        receiver: Numbers of the receivers, shape [chosen_count].
        point: World positions, shape [chosen_count, point_count].
    """
    i = wp.tid() + first
    p = wp.vec3d(position[receiver[i]])
    n = wp.vec3d(normal[receiver[i]])
    face = wp.int32(0)
    if rays.axes.shape[0] > 1:
        face = cube_face(p - rays.position)
    for k in range(offsets.shape[0]):
        offset = wp.cw_mul(offsets[k], rays.texel)
        if rays.is_positional != 0:
            point[i, k] = wp.vec3(point_in_central_light(rays, rays.axes[face], p, n, offset))
        else:
            point[i, k] = wp.vec3(point_in_parallel_light(rays, p, n, offset))


@wp.kernel
def average_halves(
    first: wp.int32,
    # inputs
    visibility: wp.array3d[wp.float32],
    receiver: wp.array[wp.int32],
    # outputs
    mean: wp.array2d[wp.float32],
    half_difference: wp.array2d[wp.float32],
):
    """The mean over each footprint's points, and half the difference of the means over its two halves.

    Args:
        visibility: Shape [chosen_count, point_count, channels].
        receiver: Whose footprint each is, shape [chosen_count].
        mean: Shape [receiver_count, channels], as is ``half_difference``.
    """
    i = wp.tid() + first
    half = visibility.shape[1] / 2
    for channel in range(visibility.shape[2]):
        early = wp.float64(0.0)
        late = wp.float64(0.0)
        for k in range(half):
            early += wp.float64(visibility[i, k, channel])
            late += wp.float64(visibility[i, half + k, channel])
        count = wp.float64(visibility.shape[1])
        mean[receiver[i], channel] = wp.float32((early + late) / count)
        half_difference[receiver[i], channel] = wp.float32(wp.abs(early - late) / count)
