"""The smallest window round a box in a light's view: what one caster's map shows.

Depth is linear, as everywhere, but reaches only :data:`FAR_DEPTH` at the far side of the box: polygon offset then moves
a steep surface's depth beyond the box, where receivers may be, without reaching 1, the depth of an empty texel. A power
of two costs no precision.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.light_space import axes_of, bounds_along, orthographic_frame

Array = NDArray[np.float64]
Axes = tuple[Array, Array, Array]

FAR_DEPTH = 2.0**-10
"""Linear depth at the far side of a caster's box, which its window is fitted to."""

_MARGIN = 1.0e-3
"""A window is this much larger than what is in it, on each side, relative to its size."""

_CORNERS = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_EDGES = np.array([(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b).bit_count() == 1])


@dataclass(frozen=True, eq=False)
class Window:
    """What a map shows.

    Attributes:
        projection: Rows (u·w, v·w, depth, w), float64, shape [4, 4].
        near: Distance of the near plane, ``None`` for an orthographic window.
        depth_range: Length along the light from the near side of the box to its far side.
    """

    projection: Array
    near: float | None
    depth_range: float


def corners_of(half: Array) -> Array:
    """Return the corners of boxes round the origin, half their sides given, shape [..., 3] to [..., 8, 3]."""
    return _CORNERS * half[..., None, :]


def orthographic_window(half: Array, direction: Array) -> Window:
    """Return the window of parallel light round a box at the origin.

    Args:
        half: Half the box's sides, shape [3].
        direction: Unit, towards the light.
    """
    axes = axes_of(-direction)
    low, high = bounds_along(axes, corners_of(half))
    frame = orthographic_frame(axes[2], low, high, axes)
    projection = frame.projection.copy()
    projection[2] *= FAR_DEPTH
    return Window(projection, None, frame.depth_range)


class PerspectiveWindows:
    """Windows from one place, along one axis, on many boxes: a spot light's, or those of one face round a point light.

    Args:
        eye: Where the light is.
        axes: Unit (right, down, forward).
        tangent: Half the width of what the light or the face shows at distance 1.
        nearest: Nothing nearer than this along the forward axis casts.
        corners: World positions of all boxes' corners, shape [n, 8, 3].
    """

    def __init__(self, eye: Array, axes: Axes, tangent: float, nearest: float, corners: Array) -> None:
        self._eye, self._axes, self._tangent, self._nearest = eye, axes, tangent, nearest
        offset = corners - eye
        x, y, w = (offset[..., 0] * a[0] + offset[..., 1] * a[1] + offset[..., 2] * a[2] for a in axes)
        self._x, self._y, self._w = x, y, w
        reach = tangent * w
        beside = [(side > reach).all(axis=1) for side in (x, -x, y, -y)]
        self.seen: NDArray[np.intp] = np.flatnonzero((w > nearest).any(axis=1) & ~np.logical_or.reduce(beside))
        """Boxes that may be in sight."""

    def window(self, box: int) -> Window | None:
        """Return the window on one box; ``None`` if the light, or the face, does not see it."""
        x, y, w = self._x[box], self._y[box], self._w[box]
        near = max(self._nearest, float(w.min()) - _MARGIN * float(np.ptp(w)))
        far = float(w.max()) + _MARGIN * float(np.ptp(w))
        if not far > near:
            return None
        x, y, w = _beyond(near, x, y, w)
        bounds = [_fitted(side / w, self._tangent) for side in (x, y)]
        if any(high <= low for low, high in bounds):
            return None
        return Window(_projection(self._eye, self._axes, bounds, near, far), near, far - near)


def _beyond(near: float, x: Array, y: Array, w: Array) -> tuple[Array, Array, Array]:
    """Return the box's corners beyond the near plane, and where its edges cross it."""
    a, b = _EDGES.T
    crossing = (w[a] > near) != (w[b] > near)
    a, b = a[crossing], b[crossing]
    t = (near - w[a]) / (w[b] - w[a])
    ahead = w > near
    on_plane = [side[a] + t * (side[b] - side[a]) for side in (x, y)]
    return (
        np.append(x[ahead], on_plane[0]),
        np.append(y[ahead], on_plane[1]),
        np.append(w[ahead], np.full(len(a), near)),
    )


def _fitted(values: Array, limit: float) -> tuple[float, float]:
    low, high = max(float(values.min()), -limit), min(float(values.max()), limit)
    # a box seen edge-on still needs a window
    margin = _MARGIN * max(high - low, 1.0e-2 * limit)
    return (low - margin, high + margin) if low <= high else (low, high)


def _projection(eye: Array, axes: Axes, bounds: list[tuple[float, float]], near: float, far: float) -> Array:
    right, down, forward = (np.append(a, -(a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2])) for a in axes)
    rows = [(side - low * forward) / (high - low) for side, (low, high) in zip((right, down), bounds, strict=True)]
    depth = forward * (FAR_DEPTH / (far - near))
    depth[3] -= near * (FAR_DEPTH / (far - near))
    return np.stack([*rows, depth, forward])


def after(projection: Array, linear: Array, offset: Array) -> Array:
    """Return projections applied after affine maps, shapes [..., 4, 4], [..., 3, 3] and [..., 3].

    Written out: a matrix product would go through BLAS, whose summation order differs between machines.
    """
    columns = np.concatenate([linear, offset[..., None]], axis=-1)
    products = projection[..., :3, None] * columns[..., None, :, :]
    composed = products[..., 0, :] + products[..., 1, :] + products[..., 2, :]
    composed[..., 3] += projection[..., 3]
    return composed


def turned(linear: Array, vectors: Array) -> Array:
    """Return linear maps of vectors, shapes [..., 3, 3] and [..., 3], summed in a fixed order."""
    return (
        linear[..., 0] * vectors[..., None, 0]
        + linear[..., 1] * vectors[..., None, 1]
        + linear[..., 2] * vectors[..., None, 2]
    )
