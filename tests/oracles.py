"""Independent answers to visibility questions: exact integer arithmetic, float64 NumPy, and closed forms.

Nothing here shares code with the program. A float32 number is an integer times a power of two, so the visibility rule
can be evaluated without any rounding: that is what :func:`exact_blockers` does, in Python's integers.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]

_SHIFT = 64
"""Numbers are scaled by 2**64 before they become integers: exact for float32 down to 2**-40 and their like."""


def exact(values: Any) -> NDArray[np.object_]:
    """Floats as integers, scaled by ``2**64``; an error where that would round."""
    scaled = [Fraction(float(x)) * 2**_SHIFT for x in np.asarray(values).ravel()]
    assert all(x.denominator == 1 for x in scaled)
    return np.array([int(x) for x in scaled], dtype=object).reshape(np.shape(values))


def _cross(a: Any, b: Any) -> Any:
    return np.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        axis=-1,
    )


def _dot(a: Any, b: Any) -> Any:
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def exact_blockers(point: Floats, corners: Floats, light: tuple[float, ...], tolerance: float) -> dict[int, Fraction]:
    """Triangles that shadow a point by step 3 of the rule, evaluated without rounding.

    Args:
        point: Shape [3].
        corners: Shape [triangle_count, 3, 3].
        light: (x, y, z, w), w = 1 for a position, 0 for a direction towards the light.
        tolerance: Distance of planes that do not count.

    Returns:
        The parameter along the ray, by triangle.
    """
    p, triangles = exact(point), exact(corners)
    towards = exact(light[:3]) - int(light[3]) * p
    a, b, c = (triangles[:, k] - p for k in range(3))
    u, v, w = _dot(_cross(b, c), towards), _dot(_cross(c, a), towards), _dot(_cross(a, b), towards)
    inside = ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0))
    found = {}
    delta = int(Fraction(tolerance) * 2**_SHIFT)
    for k in np.flatnonzero(inside):
        n = _cross(b[k] - a[k], c[k] - a[k])
        height, slope = _dot(n, a[k]), _dot(n, towards)
        if slope == 0 or height * height <= delta * delta * _dot(n, n):
            continue
        t = Fraction(height, slope)
        if t > 0 and (light[3] == 0.0 or t < 1):
            found[int(k)] = t
    return found


def is_turned_away_exactly(corners: Floats, eye: Floats, light: tuple[float, ...]) -> bool:
    """Step 2 of the rule for the triangle with these corners, without rounding."""
    a, b, c = exact(corners)
    n = _cross(b - a, c - a)
    to_light = exact(light[:3]) - int(light[3]) * a
    return bool(_dot(n, exact(eye) - a) * _dot(n, to_light) < 0)


def plane_hits(origin: Floats, towards: Floats, corners: Floats) -> tuple[Floats, Floats]:
    """Where a ray meets the planes of triangles, float64 (Moeller & Trumbore 1997).

    Returns:
        The ray parameter, shape [triangle_count], and the smallest barycentric coordinate there: positive inside the
        triangle, negative outside, 0 on an edge.
    """
    o, d, t = origin.astype(np.float64), towards.astype(np.float64), corners.astype(np.float64)
    e1, e2 = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
    p = np.cross(d, e2)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / (e1 * p).sum(axis=1)
        s = o - t[:, 0]
        u = (s * p).sum(axis=1) * inverse
        q = np.cross(s, e1)
        v = (q @ d) * inverse
        return (e2 * q).sum(axis=1) * inverse, np.minimum(np.minimum(u, v), 1.0 - u - v)


def is_behind_box(points: Floats, low: Floats, high: Floats, light: tuple[float, ...]) -> NDArray[np.bool_]:
    """Whether the segment from each point to the light passes through a box: the closed form of a box's shadow."""
    p = points.astype(np.float64)
    towards = np.asarray(light[:3]) - light[3] * p
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (low - p) / towards, (high - p) / towards
    enter = np.nanmax(np.minimum(first, second), axis=1)
    leave = np.nanmin(np.maximum(first, second), axis=1)
    end = 1.0 if light[3] else np.inf
    return (enter < leave) & (leave > 0.0) & (enter < end)


def distance_from_ray(points: Floats, centre: Floats, light: tuple[float, ...]) -> Floats:
    """Distance of ``centre`` from the segment between each point and the light: below r behind a sphere of radius r."""
    p = points.astype(np.float64)
    towards = np.asarray(light[:3]) - light[3] * p
    along = ((centre - p) * towards).sum(axis=1) / (towards * towards).sum(axis=1)
    along = np.clip(along, 0.0, 1.0 if light[3] else np.inf)
    distance: Floats = np.linalg.norm(centre - p - along[:, None] * towards, axis=1)
    return distance
