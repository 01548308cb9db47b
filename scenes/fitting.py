"""A ground, lights and cameras fitted round one solid, for every scene that is one object on a plane.

Whatever the solid's size and shape, it and its shadow fill the ``overview`` picture, the sun shines from the side, and
every light stays outside the solid's bounding sphere. Only sums, products, divisions and square roots decide where
things stand (sines and cosines lose their last bits first), so every machine fits alike.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from shadowbench.parameters import ParameterModel, parameter
from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Light,
    Mesh,
    PointLight,
    Scene,
    SpotLight,
    Vector,
)

Array = NDArray[np.float64]

SOLID_ALBEDO: Vector = (0.84, 0.66, 0.50)
GROUND_ALBEDO: Vector = (0.78, 0.78, 0.76)

_GROUND_RATIO = 4.0
"""Half the ground's side, relative to the radius of the solid with its shadow: the overview then sees little else."""

_FLAT = 0.01
"""A solid lower than this, relative to its size, floats that much above the ground: a flat sheet must not lie in it."""

_VERTICAL_ANGLE = 30.0
_ASPECT = 4.0 / 3.0
_FILL = 0.85
"""How much of the picture's width or height the content takes."""

_CONTACT_SHARE = 0.3
"""The close-up shows this lowest part of the solid."""

_LEAST_DISTANCE = 0.25
"""No camera is nearer to the content than this, relative to the content's diagonal."""


class FitParameters(ParameterModel):
    """Where a fitted scene's light comes from and where its camera stands.

    Azimuths are counted from +z towards +x, elevations from the horizon.
    """

    light_azimuth: float = parameter(
        -65.0, unit="degrees", help="Where the sun stands: 0 is +z, 90 is +x.", ge=-360.0, le=360.0
    )
    light_elevation: float = parameter(
        50.0, unit="degrees", help="The sun's height above the horizon.", ge=1.0, le=90.0
    )
    camera_azimuth: float = parameter(
        20.0, unit="degrees", help="Where the camera stands: 0 is +z, 90 is +x.", ge=-360.0, le=360.0
    )
    camera_elevation: float = parameter(
        35.0, unit="degrees", help="The camera's height above the horizon.", ge=0.0, le=90.0
    )


def _cosine_sine(degrees: float) -> tuple[float, float]:
    """Rounded to twelve decimals, which removes the last bits in which mathematical libraries differ."""
    angle = math.radians(degrees)
    return round(math.cos(angle), 12), round(math.sin(angle), 12)


def direction_of(azimuth: float, elevation: float) -> Vector:
    """Return the unit direction towards an azimuth and elevation [degrees]."""
    (cos_a, sin_a), (cos_e, sin_e) = _cosine_sine(azimuth), _cosine_sine(elevation)
    return (sin_a * cos_e, sin_e, cos_a * cos_e)


def fitted_scene(
    solid: Mesh,
    fit: FitParameters,
    *,
    translation: Vector = (0.0, 0.0, 0.0),
    with_ground: bool = True,
    notes: tuple[str, ...] = (),
) -> Scene:
    """Return the solid, placed at ``translation``, with all that a picture of it needs.

    The ground is the plane y = 0, which the solid must not pierce.
    """
    points = solid.vertices.astype(np.float64) + np.asarray(translation)
    low, high = points.min(axis=0), points.max(axis=0)
    centre, radius = (low + high) / 2.0, _length(high - low) / 2.0
    sun = direction_of(fit.light_azimuth, fit.light_elevation)
    content = points
    meshes: tuple[Mesh, ...] = (solid,)
    instances: tuple[Instance, ...] = (Instance(0, translation=translation, albedo=SOLID_ALBEDO),)
    if with_ground:
        level = -_FLAT * radius if high[1] < _FLAT * radius else 0.0
        content = np.concatenate([points, _shadow_on(level, points, sun)])
        meshes += (_ground(level, content),)
        instances += (Instance(1, albedo=GROUND_ALBEDO),)
    return Scene(
        meshes=meshes,
        instances=instances,
        lights=_lights(centre, radius, sun, fit),
        cameras=_cameras(points, content, fit),
        notes=notes,
    )


def _shadow_on(level: float, points: Array, sun: Vector) -> Array:
    """Where the points' shadows fall on the plane y = level."""
    steps = (points[:, 1] - level) / sun[1]
    return np.stack([points[:, 0] - steps * sun[0], np.full(len(points), level), points[:, 2] - steps * sun[2]], axis=1)


def _ground(level: float, content: Array) -> Mesh:
    low, high = content.min(axis=0), content.max(axis=0)
    half = _GROUND_RATIO * _length(high - low) / 2.0
    x, z = (low[0] + high[0]) / 2.0, (low[2] + high[2]) / 2.0
    corners = [
        (x - half, level, z - half),
        (x + half, level, z - half),
        (x + half, level, z + half),
        (x - half, level, z + half),
    ]
    return Mesh("ground", np.array(corners), np.array([(0, 2, 1), (0, 3, 2)], np.int32))


def _lights(centre: Array, radius: float, sun: Vector, fit: FitParameters) -> dict[str, Light]:
    # from three radii away the bounding sphere takes 39 degrees of the cone's 70
    spot = centre + 3.0 * radius * np.array(sun)
    lamp = centre + 1.6 * radius * np.array(direction_of(fit.light_azimuth + 30.0, max(fit.light_elevation, 40.0)))
    return {
        "sun": DirectionalLight(sun),
        "spot": SpotLight(_vector(spot), (-sun[0], -sun[1], -sun[2]), angle=70.0),
        "lamp": PointLight(_vector(lamp)),
    }


def _cameras(points: Array, content: Array, fit: FitParameters) -> dict[str, Camera]:
    return {
        "overview": fitted_camera(content, fit.camera_azimuth, fit.camera_elevation),
        "close-up": fitted_camera(_contact(points), fit.camera_azimuth, fit.camera_elevation),
        "top": fitted_camera(content, 0.0, 90.0),
    }


def _contact(points: Array) -> Array:
    """Return the lowest points, and some room about them for a solid that stands on a single one."""
    low, high = points.min(axis=0), points.max(axis=0)
    lowest = points[points[:, 1] <= low[1] + _CONTACT_SHARE * (high[1] - low[1])]
    middle = (lowest.min(axis=0) + lowest.max(axis=0)) / 2.0
    room = _CONTACT_SHARE * _length(high - low) / 2.0 * np.eye(3)
    return np.concatenate([lowest, middle + room, middle - room])


def fitted_camera(points: Array, azimuth: float, elevation: float) -> Camera:
    """Return the nearest camera in that direction [degrees] that has every point [n, 3] in its 4:3 picture.

    Let (x, y, z) be coordinates to the right, upwards and towards the eye. A point is inside the left and right edges
    if ``|x - eye_x| <= t (eye_z - z)``, that is if ``x + t z <= eye_x + t eye_z`` and ``-x + t z <= -eye_x + t eye_z``;
    so the two maxima over all points give ``eye_x`` and the least ``eye_z``. Likewise for the upper and lower edges.
    No point comes nearer than a share of the points' extent, lest a needle seen from its tip touch the eye.
    """
    (cos_a, sin_a), (cos_e, sin_e) = _cosine_sine(azimuth), _cosine_sine(elevation)
    right = np.array([cos_a, 0.0, -sin_a])
    up = np.array([-sin_a * sin_e, cos_e, -cos_a * sin_e])
    back = np.array(direction_of(azimuth, elevation))
    x, y, z = (_along(axis, points) for axis in (right, up, back))
    # the tangent of 15 degrees, half of _VERTICAL_ANGLE
    tangent_y = _FILL * (2.0 - math.sqrt(3.0))
    tangent_x = _ASPECT * tangent_y
    rightmost, leftmost = (x + tangent_x * z).max(), (-x + tangent_x * z).max()
    upmost, downmost = (y + tangent_y * z).max(), (-y + tangent_y * z).max()
    eye_x, eye_y = (rightmost - leftmost) / 2.0, (upmost - downmost) / 2.0
    nearest_z = z.max() + _LEAST_DISTANCE * _length(points.max(axis=0) - points.min(axis=0))
    eye_z = max((rightmost + leftmost) / (2.0 * tangent_x), (upmost + downmost) / (2.0 * tangent_y), nearest_z)
    middle_z = (z.min() + z.max()) / 2.0
    target = eye_x * right + eye_y * up + middle_z * back
    return Camera(_vector(target + (eye_z - middle_z) * back), _vector(target), _vector(up), _VERTICAL_ANGLE)


def _along(axis: Array, points: Array) -> Array:
    # written out: a matrix product would go through BLAS
    result: Array = axis[0] * points[:, 0] + axis[1] * points[:, 1] + axis[2] * points[:, 2]
    return result


def _length(a: Array) -> float:
    return math.sqrt(float(a[0]) ** 2 + float(a[1]) ** 2 + float(a[2]) ** 2)


def _vector(a: Array) -> Vector:
    return (float(a[0]), float(a[1]), float(a[2]))
