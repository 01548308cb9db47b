"""Exact percentage-closer filtering on a light's own maps: what a filtered map would be without its approximation.

A technique that filters depths (or functions of them) replaces the weighted mean of depth tests by something cheaper.
That mean itself, on the same map, with the same kernel, is what tells its approximation from the map's texels. Every
texel whose centre lies in the kernel, centred on the receiver itself, is tested with the depth of the receiver's plane
there, and the tests are averaged with the kernel's weights at those centres. A box of a whole number of texels and a
tent two wide are then PCF's and hardware's own filters.

The plane is followed exactly, under a perspective frame too, and never beyond the map's far plane, where nothing is
drawn. Texels beyond the map's border are left out of the mean.
"""

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.launch import Context, kernel_options, launch, synchronize
from shadowbench.device.shadow_lookup import DIRECTIONAL, LightMaps, MapPoint, find_in_map, project_point, texel_index
from shadowbench.light_space_kernel import LightSpaceKernel
from shadowbench.receivers import Receivers

wp.set_module_options(kernel_options(native=True))

GAUSS = wp.constant(1)
TENT = wp.constant(2)
_SHAPES = {"box": 0, "gauss": 1, "bilinear": 2}


@wp.struct
class Window:
    """A kernel in texels of the map.

    Attributes:
        shape: Box 0, Gauss 1, tent 2.
        half: Half the width.
        sigma: Standard deviation of a Gauss.
    """

    shape: wp.int32
    half: wp.float64
    sigma: wp.float64


@wp.func
def weight_at(window: Window, x: wp.float64):
    """A weight along one axis, up to a factor; 0 outside, the box being closed on its right."""
    weight = wp.float64(0.0)
    if x > -window.half and x <= window.half:
        weight = wp.float64(1.0)
        if window.shape == GAUSS:
            weight = wp.exp(wp.float64(-0.5) * (x / window.sigma) * (x / window.sigma))
        elif window.shape == TENT:
            weight = wp.float64(1.0) - wp.abs(x) / window.half
    return weight


@wp.struct
class PlaneInMap:
    """A receiver's plane as a linear function of the place in the map.

    Attributes:
        value: At the receiver: its depth under an orthographic frame, 1/w under a perspective one.
        along_x, along_y: Its change per texel.
        near: Planar distance where depth is 0.
        depth_per_w: Depth per planar distance; 0 under an orthographic frame.
    """

    value: wp.float64
    along_x: wp.float64
    along_y: wp.float64
    near: wp.float64
    depth_per_w: wp.float64


@wp.func
def plane_in_map(maps: LightMaps, found: MapPoint, p: wp.vec3d, n: wp.vec3d):
    """The plane (p, n) in the map; a plane seen edge-on has the receiver's depth everywhere.

    Both functions are exactly linear, so that their derivatives along two tangents are all there is to know.
    """
    zero = wp.float64(0.0)
    size = wp.float64(maps.depth.shape[2])
    m = maps.projection[found.face]
    h = project_point(m, p)
    axis = wp.vec3d(wp.float64(1.0), zero, zero)
    if wp.abs(n[0]) > wp.float64(0.6):
        axis = wp.vec3d(zero, wp.float64(1.0), zero)
    s = wp.normalize(wp.cross(n, axis))
    t = wp.cross(n, s)
    hs = m * wp.vec4d(s[0], s[1], s[2], zero)
    ht = m * wp.vec4d(t[0], t[1], t[2], zero)
    u = h[0] / h[3]
    v = h[1] / h[3]
    xs = (hs[0] - u * hs[3]) / h[3] * size
    ys = (hs[1] - v * hs[3]) / h[3] * size
    xt = (ht[0] - u * ht[3]) / h[3] * size
    yt = (ht[1] - v * ht[3]) / h[3] * size
    plane = PlaneInMap()
    plane.value = h[2]
    value_s = hs[2]
    value_t = ht[2]
    if maps.kind != DIRECTIONAL:
        forward = wp.vec3d(m[3, 0], m[3, 1], m[3, 2])
        plane.near = maps.near
        plane.depth_per_w = wp.dot(wp.vec3d(m[2, 0], m[2, 1], m[2, 2]), forward) / wp.dot(forward, forward)
        plane.value = wp.float64(1.0) / h[3]
        value_s = -hs[3] / (h[3] * h[3])
        value_t = -ht[3] / (h[3] * h[3])
    area = xs * yt - xt * ys
    if area != zero:
        plane.along_x = (value_s * yt - value_t * ys) / area
        plane.along_y = (value_t * xs - value_s * xt) / area
    return plane


@wp.func
def depth_of(plane: PlaneInMap, x: wp.float64, y: wp.float64):
    """The plane's depth ``x, y`` texels beside the receiver, at most 1: behind the far plane, or beyond the horizon."""
    one = wp.float64(1.0)
    depth = plane.value + plane.along_x * x + plane.along_y * y
    if plane.depth_per_w != wp.float64(0.0):
        inverse = depth
        depth = one
        if inverse > wp.float64(0.0):
            depth = (one / inverse - plane.near) * plane.depth_per_w
    return wp.min(depth, one)


@wp.func
def test(maps: LightMaps, found: MapPoint, plane: PlaneInMap, column: wp.int32, row: wp.int32, bias: wp.float64):
    """The depth test of a texel: 1 lit, 0 shadowed."""
    x = wp.float64(column) + wp.float64(0.5) - found.x
    y = wp.float64(row) + wp.float64(0.5) - found.y
    if depth_of(plane, x, y) - bias <= wp.float64(maps.depth[found.face, row, column]):
        return wp.float64(1.0)
    return wp.float64(0.0)


@wp.func
def mean_of_tests(maps: LightMaps, found: MapPoint, plane: PlaneInMap, window: Window, bias: wp.float64):
    size = maps.depth.shape[2]
    half = wp.float64(0.5)
    column = texel_index(found.x - window.half + half)
    row = texel_index(found.y - window.half + half)
    taps = wp.int32(wp.ceil(wp.float64(2.0) * window.half))
    lit = wp.float64(0.0)
    total = wp.float64(0.0)
    for j in range(wp.max(row, 0), wp.min(row + taps, size)):
        down = weight_at(window, wp.float64(j) + half - found.y)
        for i in range(wp.max(column, 0), wp.min(column + taps, size)):
            weight = down * weight_at(window, wp.float64(i) + half - found.x)
            if weight > wp.float64(0.0):
                lit += weight * test(maps, found, plane, i, j, bias)
                total += weight
    if total == wp.float64(0.0):  # narrower than a texel, and between two centres: the texel that holds the receiver
        column = wp.clamp(texel_index(found.x), 0, size - 1)
        row = wp.clamp(texel_index(found.y), 0, size - 1)
        return wp.float32(test(maps, found, plane, column, row, bias))
    return wp.float32(lit / total)


@wp.kernel
def average_tests(
    first: wp.int32,
    # inputs
    maps: LightMaps,
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    window: Window,
    bias: wp.float64,
    # outputs
    visibility: wp.array[wp.float32],
):
    i = wp.tid() + first
    found = find_in_map(maps, position[i], normal[i], wp.float64(0.0), wp.float64(0.0))
    if found.state >= 0:
        visibility[i] = wp.float32(found.state)
    else:
        plane = plane_in_map(maps, found, wp.vec3d(position[i]), wp.vec3d(normal[i]))
        visibility[i] = mean_of_tests(maps, found, plane, window, bias)


def percentage_closer(
    maps: LightMaps, receivers: Receivers, kernel: LightSpaceKernel, bias: float, context: Context
) -> NDArray[np.float32]:
    """Return the kernel-weighted mean of depth tests on a light's maps, shape [receiver_count].

    Args:
        maps: The light's maps (:func:`shadowbench.device.shadow_lookup.light_maps`).
        receivers: The visible samples.
        kernel: The filter, in texels of its own resolution.
        bias: Taken off each receiver's depth [linear depth].
        context: Where to run.
    """
    texels = maps.depth.shape[2] / kernel.resolution
    window = Window()
    window.shape, window.half, window.sigma = _SHAPES[kernel.shape], 0.5 * kernel.width * texels, kernel.sigma * texels
    on_device = receivers.on(context.device)
    visibility = wp.empty(receivers.count, dtype=wp.float32, device=context.device)
    inputs = [maps, on_device.position, on_device.normal, window, bias]
    launch(average_tests, receivers.count, inputs=inputs, outputs=[visibility], context=context)
    synchronize(context)
    return visibility.numpy()
