"""Light space for irregular samples: windows fitted to them, and where a receiver falls in one.

Exact rasterisers decide in float32 what float32 can decide, and hand every doubtful pair to the one exact predicate
(:mod:`shadowbench.device.visibility`). This module makes the samples' side of that float32 test,
:mod:`shadowbench.device.blockers` the triangles'. No kernel lives here.

*Sample coordinates* are (x, y, depth): x and y in [-1, 1] over a window that holds all samples, depth growing away from
the light and linear in the window, which is what makes a triangle's plane a linear function of the three:

* under a directional light (an orthographic window), depth is in [-1, 1], linear in distance;
* under a spot or point light (perspective), with w the planar distance, depth = 1/far - 1/w, which is at most 0.
"""

import math

import numpy as np
import warp as wp

from shadowbench.device.launch import kernel_options
from shadowbench.device.visibility import LightPoint, light_point, plane_tolerance
from shadowbench.errors import SceneError
from shadowbench.light_space import CUBE_AXES, axes_of
from shadowbench.scene import DirectionalLight, Light, PointLight, SpotLight, Vector

wp.set_module_options(kernel_options(native=True))

ROUNDING = 2.0**-24
"""Relative error of one float32 rounding."""

FARTHEST = wp.constant(wp.float32(3.0e38))
SHADOWED = wp.constant(wp.float32(-3.0e38))
"""Depth of a sample that needs no more tests: nearer to the light than every triangle."""


@wp.struct
class SampleSpace:
    """A light's window for irregular samples.

    Attributes:
        light: As the exact predicate sees it.
        window_from_world: Rows (x w, y w, depth, w); the depth row is 0 under a perspective frame.
        plane_from_world: Maps a world plane (n, -n . a), |n| = 1, to (cx, cy, cd, c1) with cx x + cy y + cd depth + c1
            the signed distance of a sample from it, divided by w.
        farthest_inverse: 1/far of a perspective frame, 0 for an orthographic one.
        is_perspective: 1 or 0.
        tolerance: The predicate's delta [scene units].
        centre, axes: Of an orthographic window, in float32: sample = axes (p - centre).
    """

    light: LightPoint
    centre: wp.vec3
    axes: wp.mat33
    window_from_world: wp.mat44d
    plane_from_world: wp.mat44d
    farthest_inverse: wp.float64
    is_perspective: wp.float64
    tolerance: wp.float64


def sample_spaces(light: Light, scale: float, low: np.ndarray, high: np.ndarray) -> tuple[SampleSpace, ...]:
    """Return a light's sample spaces, fitted to the samples: one, or six around a point light (order: cube faces).

    Args:
        light: Directional, spot or point.
        scale: The scene's largest absolute coordinate.
        low, high: Bounds of all samples in the world, shape [3].

    Raises:
        SceneError: An area light, which has no light space.
    """
    packed, tolerance = light_point(light), plane_tolerance(scale)
    low, high = low.astype(np.float64), high.astype(np.float64)
    match light:
        case DirectionalLight():
            axes = np.stack(axes_of(np.negative(light.direction)))
            return (_orthographic(packed, tolerance, axes, (low + high) / 2.0, (high - low) / 2.0, scale),)
        case SpotLight():
            axes = np.stack(axes_of(light.direction))
            tangent = math.tan(math.radians(light.angle) / 2.0)
            return (_perspective(packed, tolerance, axes, light.position, tangent, low, high),)
        case PointLight():
            return tuple(
                _perspective(packed, tolerance, np.stack(axes_of(forward, up)), light.position, 1.0, low, high)
                for forward, up in CUBE_AXES
            )
        case _:
            raise SceneError("an area light has no light space for samples")


def _orthographic(
    light: LightPoint, tolerance: float, axes: np.ndarray, centre: np.ndarray, half: np.ndarray, scale: float
) -> SampleSpace:
    centre = centre.astype(np.float32).astype(np.float64)  # the same point in both precisions
    extent = _sums(np.abs(axes), half)
    extent = np.maximum(extent, 1e-3 * max(float(extent.max()), 1e-3 * scale))
    rows = np.zeros((4, 4))
    rows[:3, :3] = axes / extent[:, None]
    rows[:3, 3] = -_sums(rows[:3, :3], centre)
    rows[3, 3] = 1.0
    # world position = centre + x extent_x right + y extent_y down + depth extent_z forward
    plane = np.zeros((4, 4))
    plane[:3, :3] = axes * extent[:, None]
    plane[3] = (*centre, 1.0)
    space = _packed(light, tolerance, rows, plane, 0.0)
    space.centre = wp.vec3(*centre)
    space.axes = wp.mat33(*rows[:3, :3].ravel())
    return space


def _perspective(
    light: LightPoint,
    tolerance: float,
    axes: np.ndarray,
    position: Vector,
    tangent: float,
    low: np.ndarray,
    high: np.ndarray,
) -> SampleSpace:
    eye = np.asarray(position, dtype=np.float64)
    reach = np.maximum(np.abs(low - eye), np.abs(high - eye))
    far = max(float(np.sqrt(_sums(reach[None], reach)[0])), 1e-30)
    rows = np.zeros((4, 4))
    for row, factor in ((0, 1.0 / tangent), (1, 1.0 / tangent), (3, 1.0)):
        axis = axes[min(row, 2)] * factor
        rows[row] = (*axis, -_sums(axis[None], eye)[0])
    # world position / w = eye / w + x tangent right + y tangent down + forward, with 1/w = 1/far - depth
    plane = np.zeros((4, 4))
    plane[:2, :3] = axes[:2] * tangent
    plane[2] = (*-eye, -1.0)
    plane[3] = (*(eye / far + axes[2]), 1.0 / far)
    return _packed(light, tolerance, rows, plane, 1.0 / far)


def _packed(
    light: LightPoint, tolerance: float, rows: np.ndarray, plane: np.ndarray, farthest_inverse: float
) -> SampleSpace:
    space = SampleSpace()
    space.light, space.tolerance = light, tolerance
    space.window_from_world = wp.mat44d(*rows.ravel())
    space.plane_from_world = wp.mat44d(*plane.ravel())
    space.farthest_inverse = farthest_inverse
    space.is_perspective = float(farthest_inverse > 0.0)
    return space


def _sums(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Matrix times vector without BLAS, whose summation order differs between machines."""
    product: np.ndarray = matrix[:, 0] * vector[0] + matrix[:, 1] * vector[1] + matrix[:, 2] * vector[2]
    return product


@wp.func
def window_point(space: SampleSpace, p: wp.vec3):
    """Homogeneous window coordinates (x w, y w, linear depth, w) of a world position."""
    m = space.window_from_world
    x = wp.float64(p[0])
    y = wp.float64(p[1])
    z = wp.float64(p[2])
    return wp.vec4d(
        m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3],
        m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3],
        m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3],
        m[3, 0] * x + m[3, 1] * y + m[3, 2] * z + m[3, 3],
    )


@wp.func
def sample_of(space: SampleSpace, p: wp.vec3):
    """Sample coordinates (x, y, depth) of a world position in front of the light.

    An orthographic window needs no more than float32: fitted to the samples, the terms' sizes sum to 1, and five
    roundings are within the bands.
    """
    if space.is_perspective == wp.float64(0.0):
        return space.axes * (p - space.centre)
    h = window_point(space, p)
    q = wp.float64(1.0) / h[3]
    return wp.vec3(wp.float32(h[0] * q), wp.float32(h[1] * q), wp.float32(space.farthest_inverse - q))
