"""What every look-up into a light's map begins with: which map, where in it, and with which bias.

Warp functions shared by the techniques that keep depth maps. A light's maps are one array of faces (one face, or six
around a point light); :func:`light_maps` packs them with the frames that made them. Definitions of spaces are in
:mod:`shadowbench.light_space`.
"""

from typing import Any

import numpy as np
import warp as wp

from shadowbench.device.launch import kernel_options
from shadowbench.light_space import Frame
from shadowbench.scene import DirectionalLight, Light, PointLight, SpotLight

wp.set_module_options(kernel_options(native=True))

STEEPEST_OFFSET = wp.constant(wp.float64(0.02))
"""A receiver's plane moves the compared depth by at most this much per texel [linear depth]: a plane seen edge-on
from the light has no bounded slope."""

_KINDS = {DirectionalLight: 0, SpotLight: 1, PointLight: 2}
DIRECTIONAL = wp.constant(0)
POINT = wp.constant(2)


@wp.struct
class LightMaps:
    """A light, its frames and the depth maps drawn through them.

    Attributes:
        depth: Linear depth, 1 where empty, shape [face, row, column].
        projection: Of each face, rows (u·w, v·w, depth, w).
        near: Planar distance below which nothing casts; -infinity for an orthographic frame.
        texel_extent: Side of a texel at w = 1, or anywhere in an orthographic map [scene units].
        kind: Directional 0, spot 1, point 2.
        position: Of a spot or point light.
        direction: Towards a directional light, or along a spot light's beam.
        cosine: Of half a spot light's opening angle.
    """

    depth: wp.array3d[wp.float32]
    projection: wp.array[wp.mat44d]
    near: wp.float64
    texel_extent: wp.float64
    kind: wp.int32
    position: wp.vec3d
    direction: wp.vec3d
    cosine: wp.float64


def light_maps(light: Light, frames: tuple[Frame, ...], depth: Any) -> LightMaps:
    """Pack a light's maps for kernels.

    Args:
        light: Directional, spot or point.
        frames: One frame a face.
        depth: float32, shape [face, resolution, resolution].
    """
    maps = LightMaps()
    maps.depth = depth
    stacked = np.stack([frame.projection for frame in frames])
    maps.projection = wp.array(stacked, dtype=wp.mat44d, device=depth.device)
    maps.near = -np.inf if frames[0].near is None else frames[0].near
    maps.texel_extent = frames[0].texel_size(depth.shape[2])
    maps.kind = _KINDS[type(light)]
    if isinstance(light, SpotLight | PointLight):
        maps.position = wp.vec3d(*light.position)
    if isinstance(light, DirectionalLight | SpotLight):
        maps.direction = wp.vec3d(*light.direction)
    if isinstance(light, SpotLight):
        maps.cosine = float(np.cos(np.radians(light.angle) / 2.0))
    return maps


@wp.struct
class MapPoint:
    """A receiver in a light's map.

    Attributes:
        face: Which map.
        x, y: Position in the map [texels]; texel (i, j) has its centre at (i + ½, j + ½).
        depth: Linear depth.
        w: Planar distance from the light; 1 in an orthographic frame.
        slope_x, slope_y: Change of depth along the receiver's plane per texel; 0 without receiver-plane bias.
        state: What is known without a look-up: 1 lit, 0 shadowed, -1 nothing.
    """

    face: wp.int32
    x: wp.float64
    y: wp.float64
    depth: wp.float64
    w: wp.float64
    slope_x: wp.float64
    slope_y: wp.float64
    state: wp.int32


@wp.func
def cube_face(offset: wp.vec3d):
    """Face of the largest component, of equal ones the first: +x, -x, +y, -y, +z, -z."""
    axis = wp.int32(0)
    if wp.abs(offset[1]) > wp.abs(offset[0]):
        axis = 1
    if wp.abs(offset[2]) > wp.abs(offset[axis]):
        axis = 2
    face = 2 * axis
    if offset[axis] < wp.float64(0.0):
        face += 1
    return face


@wp.func
def towards_light(maps: LightMaps, p: wp.vec3d):
    """Unit direction from a point to the light."""
    if maps.kind == DIRECTIONAL:
        return wp.normalize(maps.direction)
    return wp.normalize(maps.position - p)


@wp.func
def is_in_cone(maps: LightMaps, p: wp.vec3d):
    """Whether a spot light reaches a point; other lights reach all."""
    if maps.kind == DIRECTIONAL or maps.kind == POINT:
        return True
    offset = p - maps.position
    along = wp.dot(wp.normalize(maps.direction), offset)
    return along > wp.float64(0.0) and along * along >= maps.cosine * maps.cosine * wp.dot(offset, offset)


@wp.func
def offset_along_normal(maps: LightMaps, p: wp.vec3d, n: wp.vec3d, w: wp.float64, texels: wp.float64):
    """Normal offset (Holbert 2011): move the receiver off its surface before the look-up.

    By ``texels`` texels times the sine of the angle to the light, on the light's side: a surface that faces the light
    needs none, a slanted one needs a texel's slant.
    """
    cosine = wp.dot(n, towards_light(maps, p))
    sine = wp.sqrt(wp.max(wp.float64(1.0) - cosine * cosine, wp.float64(0.0)))
    side = wp.float64(1.0)
    if cosine < wp.float64(0.0):
        side = wp.float64(-1.0)
    return p + n * (side * sine * texels * maps.texel_extent * w)


@wp.func
def motion_in_map(m: wp.mat44d, uv: wp.vec2d, w: wp.float64, motion: wp.vec3d, size: wp.float64):
    """Change of (x [texels], y [texels], depth) as a point moves, to first order.

    Args:
        m: The frame's projection.
        uv: Where the point is in the window.
        w: Its planar distance.
        motion: In the world.
        size: Texels across the window.
    """
    x = m[0, 0] * motion[0] + m[0, 1] * motion[1] + m[0, 2] * motion[2]
    y = m[1, 0] * motion[0] + m[1, 1] * motion[1] + m[1, 2] * motion[2]
    depth = m[2, 0] * motion[0] + m[2, 1] * motion[1] + m[2, 2] * motion[2]
    away = m[3, 0] * motion[0] + m[3, 1] * motion[1] + m[3, 2] * motion[2]
    texels = size / w
    return wp.vec3d((x - uv[0] * away) * texels, (y - uv[1] * away) * texels, depth)


@wp.func
def plane_slopes(m: wp.mat44d, h: wp.vec4d, n: wp.vec3d, size: wp.float64):
    """Change of linear depth per texel along x and y in the plane with normal ``n`` through the point projected to h.

    Moves along two tangents and solves the 2x2 system of their window and depth differences, so it holds for
    orthographic and perspective frames alike. It uses the receiver's own plane: differences between pixels break at
    silhouettes.
    """
    zero = wp.float64(0.0)
    axis = wp.vec3d(wp.float64(1.0), zero, zero)
    if wp.abs(n[0]) > wp.float64(0.6):
        axis = wp.vec3d(zero, wp.float64(1.0), zero)
    tangent = wp.normalize(wp.cross(n, axis))
    uv = wp.vec2d(h[0] / h[3], h[1] / h[3])
    s = motion_in_map(m, uv, h[3], tangent, size)
    t = motion_in_map(m, uv, h[3], wp.cross(n, tangent), size)
    area = s[0] * t[1] - t[0] * s[1]
    if area == zero:
        return wp.vec2d(zero, zero)
    slope_x = (s[2] * t[1] - t[2] * s[1]) / area
    slope_y = (s[0] * t[2] - s[2] * t[0]) / area
    return wp.vec2d(
        wp.clamp(slope_x, -STEEPEST_OFFSET, STEEPEST_OFFSET), wp.clamp(slope_y, -STEEPEST_OFFSET, STEEPEST_OFFSET)
    )


@wp.func
def project_point(m: wp.mat44d, p: wp.vec3d):
    return m * wp.vec4d(p[0], p[1], p[2], wp.float64(1.0))


@wp.func
def find_in_map(maps: LightMaps, position: wp.vec3, normal: wp.vec3, normal_offset: wp.float64, plane: wp.float64):
    """Place a receiver in the light's map.

    Args:
        maps: The light and its maps.
        position: World position.
        normal: Unit normal, on either side.
        normal_offset: [texels].
        plane: 1 to give the slopes of the receiver's plane, 0 for slopes of 0.
    """
    found = MapPoint()
    found.state = -1
    p = wp.vec3d(position)
    n = wp.vec3d(normal)
    if not is_in_cone(maps, p):
        found.state = 0
        return found
    if maps.kind == POINT:
        found.face = cube_face(p - maps.position)
    m = maps.projection[found.face]
    h = project_point(m, p)
    if h[3] <= maps.near:  # nothing nearer than the near plane is in the map
        found.state = 1
        return found
    if normal_offset != wp.float64(0.0):
        h = project_point(m, offset_along_normal(maps, p, n, h[3], normal_offset))
    size = wp.float64(maps.depth.shape[2])
    found.x = h[0] / h[3] * size
    found.y = h[1] / h[3] * size
    found.depth = h[2]
    found.w = h[3]
    if plane != wp.float64(0.0):
        slopes = plane * plane_slopes(m, h, n, size)
        found.slope_x = slopes[0]
        found.slope_y = slopes[1]
    return found


@wp.func
def depth_at_texel(found: MapPoint, column: wp.int32, row: wp.int32, bias: wp.float64):
    """The depth that a texel is compared with: the receiver's plane's at the texel's centre, less the constant bias.

    With slopes of 0, the receiver's own.
    """
    d = found.depth - bias
    d += found.slope_x * (wp.float64(column) + wp.float64(0.5) - found.x)
    d += found.slope_y * (wp.float64(row) + wp.float64(0.5) - found.y)
    return d


@wp.func
def stored_depth(maps: LightMaps, face: wp.int32, column: wp.int32, row: wp.int32):
    """The depth that a texel holds. A texel beyond the map's border is the border's."""
    size = maps.depth.shape[2]
    return maps.depth[face, wp.clamp(row, 0, size - 1), wp.clamp(column, 0, size - 1)]


@wp.func
def is_lit_at(maps: LightMaps, found: MapPoint, column: wp.int32, row: wp.int32, bias: wp.float64):
    """The depth test of one texel: 1 lit, 0 shadowed."""
    if depth_at_texel(found, column, row, bias) <= wp.float64(stored_depth(maps, found.face, column, row)):
        return wp.float32(1.0)
    return wp.float32(0.0)


@wp.func
def texel_index(coordinate: wp.float64):
    """The texel that holds a coordinate [texels]."""
    return wp.int32(wp.floor(coordinate))
