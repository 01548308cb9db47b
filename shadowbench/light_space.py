"""Light-space frames: how a view of the scene, a light's or a camera's, maps the world to a window.

Every convention of the project about spaces is stated here and nowhere else.

* World: right-handed, y up, float32 positions (:mod:`shadowbench.world`).
* A frame's axes are *right*, *down* and *forward*; forward points away from the light (or camera), so depth grows
  with distance from it.
* Window: ``u, v`` in [0, 1], u to the right, v **down** (row 0 of a buffer is at the top, v = 0). With a
  ``width x height`` buffer the texel (column i, row j) covers ``[i, i+1) x [j, j+1)`` in texels and its centre is at
  ``(i + 0.5, j + 0.5)``.
* Depth is **linear**: 0 at the near plane, 1 at the far plane. For spot lights, cube faces and cameras it is planar
  depth along the forward axis, not distance. The same numbers are stored in depth buffers, compared, and filtered.
* ``projection`` is 4x4 float64 with rows ``u·w, v·w, depth, w``: for a world point p, ``h = projection @ (p, 1)``;
  ``u = h0/h3``, ``v = h1/h3``, ``depth = h2`` (not divided), ``w = h3``. Orthographic frames have w = 1, perspective
  frames have w = distance along forward; a point with w <= near is outside.
* A visibility is 1 where lit and 0 where shadowed.

Frames are computed in float64 with every sum written out, so they are the same bits on every machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import SceneError
from shadowbench.scene import Camera, DirectionalLight, Light, PointLight, RectangularLight, SpotLight, Vector
from shadowbench.world import World

_MARGIN = 1.0e-3
"""A fitted window or depth range is this much larger than its content, on each side, relative to its size."""

_NEAREST = 1.0e-4
"""A fitted near plane is never nearer than this, relative to the world's diagonal."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Frame:
    """One window onto the world.

    Attributes:
        projection: Rows (u·w, v·w, depth, w), float64, shape [4, 4].
        axes: Unit axes right, down, forward (the rows), float64, shape [3, 3].
        near: Distance of the near plane for a perspective frame [scene units], ``None`` for an orthographic one.
        depth_range: Far minus near [scene units]: one unit of linear depth in scene units.
        extent: Width and height of the window at depth w = 1 for a perspective frame, anywhere for an orthographic
            one [scene units].
    """

    projection: Array
    axes: Array
    near: float | None
    depth_range: float
    extent: tuple[float, float]

    @property
    def is_orthographic(self) -> bool:
        return self.near is None

    def project(self, positions: NDArray[np.floating]) -> Array:
        """Return (u, v, depth, w) of world positions [n, 3], float64, shape [n, 4]."""
        p = positions.astype(np.float64)
        rows = self.projection
        h = np.stack([_affine(rows[r], p) for r in range(4)], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            h[:, 0] /= h[:, 3]
            h[:, 1] /= h[:, 3]
        return h

    def contains(self, positions: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Return which positions [n, 3] lie in the window and beyond the near plane."""
        h = self.project(positions)
        inside = (h[:, 0] >= 0.0) & (h[:, 0] <= 1.0) & (h[:, 1] >= 0.0) & (h[:, 1] <= 1.0)
        return inside & (h[:, 3] > (self.near or 0.0))

    def texel_size(self, resolution: int) -> float:
        """Return the side of a texel [scene units] (at w = 1 for a perspective frame)."""
        return max(self.extent) / resolution


def _affine(row: Array, points: Array) -> Array:
    """``row . (p, 1)`` for each point, summed in a fixed order."""
    result: Array = row[0] * points[:, 0] + row[1] * points[:, 1] + row[2] * points[:, 2] + row[3]
    return result


def _dot(a: Array, b: Array) -> float:
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _cross(a: Array, b: Array) -> Array:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _normalized(a: Array) -> Array:
    return a / math.sqrt(_dot(a, a))


def axes_of(forward: Vector | Array, up: Vector | None = None) -> tuple[Array, Array, Array]:
    """Return unit axes (right, down, forward).

    Args:
        forward: Viewing direction; need not be unit.
        up: Points upwards in the window; y, or z for a vertical view, if not given.
    """
    f = _normalized(np.asarray(forward, dtype=np.float64))
    if up is None:
        up = (0.0, 0.0, -1.0) if abs(f[1]) > 0.9 else (0.0, 1.0, 0.0)
    right = _normalized(_cross(f, np.asarray(up, dtype=np.float64)))
    return right, _cross(f, right), f


def orthographic_frame(
    forward: Vector | Array, low: Array, high: Array, axes: tuple[Array, Array, Array] | None = None
) -> Frame:
    """Return the frame whose window is the box ``low .. high`` in the axes' coordinates.

    Args:
        forward: Viewing direction.
        low, high: Bounds along (right, down, forward), shape [3]; each must span a length.
        axes: Axes to use instead of :func:`axes_of`.
    """
    right, down, ahead = axes or axes_of(forward)
    size = high - low
    projection = np.zeros((4, 4))
    for row, axis in enumerate((right, down, ahead)):
        projection[row, :3] = axis / size[row]
        projection[row, 3] = -low[row] / size[row]
    projection[3, 3] = 1.0
    return Frame(projection, np.stack([right, down, ahead]), None, float(size[2]), (float(size[0]), float(size[1])))


def perspective_frame(
    eye: Vector | Array, axes: tuple[Array, Array, Array], tangents: tuple[float, float], near: float, far: float
) -> Frame:
    """Return a perspective frame.

    Args:
        eye: The centre of projection.
        axes: Unit (right, down, forward).
        tangents: Half the window's width and height at w = 1.
        near, far: Distances of the planes where depth is 0 and 1 [scene units].
    """
    right, down, ahead = axes
    e = np.asarray(eye, dtype=np.float64)
    projection = np.zeros((4, 4))
    for row, axis, tangent in ((0, right, tangents[0]), (1, down, tangents[1])):
        # u·w = w/2 + (axis·(p - eye)) / (2 tangent)
        projection[row, :3] = 0.5 * ahead + 0.5 / tangent * axis
        projection[row, 3] = -_dot(projection[row, :3], e)
    projection[3, :3] = ahead
    projection[3, 3] = -_dot(ahead, e)
    projection[2] = projection[3] / (far - near)
    projection[2, 3] -= near / (far - near)
    extent = (2.0 * tangents[0], 2.0 * tangents[1])
    return Frame(projection, np.stack([right, down, ahead]), near, far - near, extent)


def light_frames(light: Light, world: World) -> tuple[Frame, ...]:
    """Return the frames in which a map-based method sees the world from ``light``.

    One orthographic frame fitted to the whole world for a directional light; one perspective frame for a spot light
    (the cone's bounding square); six for a point light, in the order of :data:`CUBE_AXES`.

    Raises:
        SceneError: An area light, which has no single frame.
    """
    match light:
        case DirectionalLight():
            axes = axes_of(np.negative(light.direction))
            low, high = _world_along(axes, world)
            return (orthographic_frame(axes[2], low, high, axes),)
        case SpotLight():
            axes = axes_of(light.direction)
            tangent = math.tan(math.radians(light.angle) / 2.0)
            tangents = (tangent, tangent)
            near, far = _depth_limits(light.position, tangents, light.near, world)
            return (perspective_frame(light.position, axes, tangents, near, far),)
        case PointLight():
            tangents = (1.0, 1.0)
            near, far = _depth_limits(light.position, tangents, light.near, world)
            return tuple(
                perspective_frame(light.position, _face_axes(face), tangents, near, far)
                for face in range(len(CUBE_AXES))
            )
        case RectangularLight():
            raise SceneError("an area light has no single light-space frame")
        case _:
            assert_never(light)


CUBE_AXES: tuple[tuple[Vector, Vector], ...] = (
    ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0)),
    ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
)
"""(forward, up) of the six faces around a point light: +x, -x, +y, -y, +z, -z. A direction belongs to the face of its
largest component; of equal ones, to the first axis in x, y, z order."""


def _face_axes(face: int) -> tuple[Array, Array, Array]:
    forward, up = CUBE_AXES[face]
    return axes_of(forward, up)


def cube_face_of(offsets: NDArray[np.floating]) -> NDArray[np.int32]:
    """Return the face (index into :data:`CUBE_AXES`) of each offset from the light, shape [n, 3]."""
    axis = np.argmax(np.abs(offsets), axis=1)  # the first of equals
    negative = np.take_along_axis(offsets, axis[:, None], axis=1)[:, 0] < 0.0
    return (2 * axis + negative).astype(np.int32)


def camera_frame(camera: Camera, width: int, height: int, world: World) -> Frame:
    """Return the camera's frame for a picture of ``width x height`` pixels (square pixels)."""
    axes = axes_of(np.subtract(camera.target, camera.eye), camera.up)
    tangent = math.tan(math.radians(camera.vertical_angle) / 2.0)
    tangents = (tangent * width / height, tangent)
    near, far = _depth_limits(camera.eye, tangents, None, world)
    return perspective_frame(camera.eye, axes, tangents, near, far)


def bounds_along(axes: tuple[Array, Array, Array], vertices: NDArray[np.floating]) -> tuple[Array, Array]:
    """Return the low and high corner, along the axes, of a window with a margin round all vertices [n, 3]."""
    points = vertices.astype(np.float64)
    low, high = np.empty(3), np.empty(3)
    for row, axis in enumerate(axes):
        along = _affine(np.append(axis, 0.0), points)
        low[row], high[row] = along.min(), along.max()
    return _with_margin(low, high)


def _world_along(axes: tuple[Array, Array, Array], world: World) -> tuple[Array, Array]:
    """:func:`bounds_along` of all vertices of a world, the same bits whether it is flat or not."""
    if world.is_flat:
        return bounds_along(axes, world.vertices)
    placed: dict[int, Array] = {}
    high = np.array([_farthest_along(axis, world, placed) for axis in axes])
    return _with_margin(-np.array([_farthest_along(-axis, world, placed) for axis in axes]), high)


def _with_margin(low: Array, high: Array) -> tuple[Array, Array]:
    size = high - low
    # a flat scene still needs a window and a depth range
    margin = _MARGIN * np.maximum(size, size.max() * 1.0e-2)
    return low - margin, high + margin


def _farthest_along(axis: Array, world: World, placed: dict[int, Array]) -> float:
    """Return how far vertices reach along an axis, looking at the vertices of as few instances as have to be.

    Args:
        axis: Unit vector.
        world: Instances of meshes.
        placed: Vertices of instances that were looked at, for the next call.
    """
    limits = world.instance_bounds.astype(np.float64)
    # of each box, and a little more than rounding can take away from it
    reach = (np.maximum(limits[:, 0] * axis, limits[:, 1] * axis)).sum(axis=1) + 1.0e-12 * world.scale
    farthest = -np.inf
    for k in np.argsort(-reach, kind="stable"):
        if reach[k] < farthest:
            break
        if k not in placed:
            placed[k] = world.vertices_of(int(k)).astype(np.float64)
        farthest = max(farthest, float(_affine(np.append(axis, 0.0), placed[k]).max()))
    return farthest


def _depth_limits(eye: Vector, tangents: tuple[float, float], near: float | None, world: World) -> tuple[float, float]:
    """Near and far planar depths between which lies all of the world that the window can show."""
    low, high = (b.astype(np.float64) for b in world.bounds())
    e = np.asarray(eye, dtype=np.float64)
    outside = np.maximum(np.maximum(low - e, e - high), 0.0)
    reach = np.maximum(np.abs(low - e), np.abs(high - e))
    nearest, farthest = math.sqrt(_dot(outside, outside)), math.sqrt(_dot(reach, reach))
    if near is None:
        # planar depth is distance times the cosine to the axis, smallest in the window's corners
        corner = 1.0 / math.sqrt(1.0 + tangents[0] ** 2 + tangents[1] ** 2)
        near = max((1.0 - _MARGIN) * corner * nearest, _NEAREST * world.diagonal())
    return near, max(farthest * (1.0 + _MARGIN), near * 2.0)


def is_in_field_of_view(light: Light, positions: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Return which positions [n, 3] the light can reach at all: everything, except outside a spot light's cone."""
    if not isinstance(light, SpotLight):
        return np.ones(len(positions), dtype=bool)
    offset = positions.astype(np.float64) - np.asarray(light.position)
    direction = _normalized(np.asarray(light.direction, dtype=np.float64))
    along = _affine(np.append(direction, 0.0), offset)
    squared = (offset * offset).sum(axis=1)
    cosine = math.cos(math.radians(light.angle) / 2.0)
    return (along > 0.0) & (along * along >= cosine * cosine * squared)
