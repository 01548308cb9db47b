"""From a picture of triangle numbers to surface points: the second half of the camera pass.

The rasteriser says which triangle a pixel sees; here the pixel's ray meets that triangle in float64, and the point is
interpolated from its barycentric coordinates, which keeps the stored float32 position within an ulp of the triangle
(a point computed as origin + t * direction would be several ulp off).
"""

import warp as wp

from shadowbench.device.launch import kernel_options
from shadowbench.device.placed_triangles import PlacedTriangles, corners_of, owner_of

wp.set_module_options(kernel_options(native=True))

LARGEST_DERIVATIVE = wp.constant(wp.float64(1.0e30))
"""Where a surface is seen edge-on its derivatives by pixel are unbounded; they are stored as at most this."""


@wp.struct
class PixelRays:
    """The camera's rays: through pixel (column i, row j) goes ``corner + (i + ½) per_column + (j + ½) per_row``.

    Directions have length 1 along the camera's forward axis.
    """

    eye: wp.vec3d
    corner: wp.vec3d
    per_column: wp.vec3d
    per_row: wp.vec3d
    width: wp.int32


@wp.func
def barycentric(d: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d):
    """Barycentric coordinates where the ray from the origin along ``d`` meets triangle abc, clamped into it.

    Signed volumes: the weight of a vertex is the volume that the ray spans with the opposite edge. The rasteriser
    rounds crossings, so that the exact ray may pass a hair outside; clamping keeps the point on the triangle.
    """
    zero = wp.float64(0.0)
    volumes = wp.vec3d(wp.dot(d, wp.cross(b, c)), wp.dot(d, wp.cross(c, a)), wp.dot(d, wp.cross(a, b)))
    total = volumes[0] + volumes[1] + volumes[2]
    weights = wp.vec3d(zero, zero, zero)
    if total != zero:
        w = wp.vec3d(
            wp.max(volumes[0] / total, zero), wp.max(volumes[1] / total, zero), wp.max(volumes[2] / total, zero)
        )
        sum = w[0] + w[1] + w[2]
        if sum > zero:
            weights = w / sum
    return weights


@wp.func
def along_plane(step: wp.vec3d, d: wp.vec3d, n: wp.vec3d, distance: wp.float64):
    """How the point where a ray along ``d`` meets a plane moves when ``d`` changes by ``step``."""
    moved = distance * (step - wp.dot(n, step) / wp.dot(n, d) * d)
    size = wp.max(wp.abs(moved))
    if not (size <= LARGEST_DERIVATIVE):  # also where it is NaN
        moved = wp.vec3d(LARGEST_DERIVATIVE, LARGEST_DERIVATIVE, LARGEST_DERIVATIVE)
    return moved


@wp.func
def store_surface_point(
    i: wp.int32,
    t: wp.int32,
    column: wp.float64,
    row: wp.float64,
    rays: PixelRays,
    placed: PlacedTriangles,
    receives: wp.array[wp.uint8],
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    instance: wp.array[wp.int32],
    triangle: wp.array[wp.int32],
    position_dx: wp.array[wp.vec3],
    position_dy: wp.array[wp.vec3],
    valid: wp.array[wp.uint8],
):
    """Receiver ``i``: where the ray through a point of the picture [pixels] meets triangle ``t``."""
    d = rays.corner + column * rays.per_column + row * rays.per_row

    # relative to the eye, so that the ray starts at the origin
    corner_a, corner_b, corner_c = corners_of(placed, t)
    a = wp.vec3d(corner_a) - rays.eye
    b = wp.vec3d(corner_b) - rays.eye
    c = wp.vec3d(corner_c) - rays.eye
    w = barycentric(d, a, b, c)
    p = w[0] * a + w[1] * b + w[2] * c

    n = wp.normalize(wp.cross(b - a, c - a))
    if wp.dot(n, a) > wp.float64(0.0):  # the eye is behind: turn the normal towards the camera
        n = -n

    owner = owner_of(wp.int64(t), placed.first_triangle, receives.shape[0])
    position[i] = wp.vec3(p + rays.eye)
    normal[i] = wp.vec3(n)
    instance[i] = owner
    triangle[i] = t
    # a pixel's step changes the ray's direction; its length along forward, |p| over |d|, is the distance
    distance = wp.dot(p, d) / wp.dot(d, d)
    position_dx[i] = wp.vec3(along_plane(rays.per_column, d, n, distance))
    position_dy[i] = wp.vec3(along_plane(rays.per_row, d, n, distance))
    # a pixel on an edge-on triangle of no area has no surface point
    valid[i] = wp.uint8(0)
    if wp.length_sq(n) > wp.float64(0.5) and w[0] + w[1] + w[2] > wp.float64(0.5):
        valid[i] = receives[owner]


@wp.kernel
def find_surface_points(
    first: wp.int32,
    # inputs
    pixels: wp.array[wp.int32],
    seen: wp.array[wp.int32],
    rays: PixelRays,
    placed: PlacedTriangles,
    receives: wp.array[wp.uint8],
    # outputs
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    instance: wp.array[wp.int32],
    triangle: wp.array[wp.int32],
    position_dx: wp.array[wp.vec3],
    position_dy: wp.array[wp.vec3],
    valid: wp.array[wp.uint8],
):
    """Receivers at pixel centres; ``seen`` is a picture."""
    i = wp.tid() + first
    pixel = pixels[i]
    column = wp.float64(pixel % rays.width) + wp.float64(0.5)
    row = wp.float64(pixel // rays.width) + wp.float64(0.5)
    store_surface_point(
        i,
        seen[pixel],
        column,
        row,
        rays,
        placed,
        receives,
        position,
        normal,
        instance,
        triangle,
        position_dx,
        position_dy,
        valid,
    )


@wp.kernel
def find_sample_points(
    first: wp.int32,
    # inputs
    pixels: wp.array[wp.int32],
    samples: wp.array[wp.int32],
    seen: wp.array[wp.int32],
    pattern: wp.array[wp.vec2d],
    rays: PixelRays,
    placed: PlacedTriangles,
    receives: wp.array[wp.uint8],
    # outputs
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    instance: wp.array[wp.int32],
    triangle: wp.array[wp.int32],
    position_dx: wp.array[wp.vec3],
    position_dy: wp.array[wp.vec3],
    valid: wp.array[wp.uint8],
):
    """Receivers at samples, each placed in its pixel as ``pattern`` says; ``seen`` holds a triangle per receiver."""
    i = wp.tid() + first
    pixel = pixels[i]
    place = pattern[samples[i]]
    column = wp.float64(pixel % rays.width) + place[0]
    row = wp.float64(pixel // rays.width) + place[1]
    store_surface_point(
        i,
        seen[i],
        column,
        row,
        rays,
        placed,
        receives,
        position,
        normal,
        instance,
        triangle,
        position_dx,
        position_dy,
        valid,
    )
