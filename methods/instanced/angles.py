"""Which maps stand for a rotated instance: the neighbouring steps round the circle, and how much of each."""

from __future__ import annotations

import math

from shadowbench.scene import Rotation, Vector

SNAP = 1.0e-4
"""An angle this near to a step is the step [degrees]."""

_SHARES = 2.0**20
"""Shares are multiples of one over this, so that the two of an instance add up to 1 without rounding."""

Neighbours = tuple[tuple[Rotation, float], ...]
"""Rotations that maps are drawn at, the nearer first, and the share of each; the shares add up to 1."""

UNTURNED = Rotation()


def exact(rotation: Rotation) -> Neighbours:
    """Return the rotation itself, in the form that equal rotations share."""
    axis, angle = _canonical(rotation)
    return ((Rotation(axis, angle), 1.0),) if angle else ((UNTURNED, 1.0),)


def nearest(rotation: Rotation, step_count: int) -> Neighbours:
    """Return the nearest of ``step_count`` steps round the circle; of two equally near, the lower angle."""
    return ((interpolated(rotation, step_count)[0][0], 1.0),)


def interpolated(rotation: Rotation, step_count: int) -> Neighbours:
    """Return the steps below and above, shared linearly; a step alone where the angle is within :data:`SNAP` of it."""
    axis, angle = _canonical(rotation)
    step = 360.0 / step_count
    below = math.floor(angle / step)
    share_above = angle / step - below
    if share_above * step <= SNAP:
        return ((_step(axis, below, step_count), 1.0),)
    if (1.0 - share_above) * step <= SNAP:
        return ((_step(axis, below + 1, step_count), 1.0),)
    share_above = round(share_above * _SHARES) / _SHARES
    pair = (_step(axis, below, step_count), 1.0 - share_above), (_step(axis, below + 1, step_count), share_above)
    return pair if share_above <= 0.5 else pair[::-1]


def _step(axis: Vector, number: int, step_count: int) -> Rotation:
    number %= step_count
    return Rotation(axis, 360.0 * number / step_count) if number else UNTURNED


def _canonical(rotation: Rotation) -> tuple[Vector, float]:
    """Return a unit axis, on one side of the origin, and an angle in [0, 360): the same for equal rotations."""
    length = math.sqrt(sum(a * a for a in rotation.axis))
    x, y, z = (a / length for a in rotation.axis) if length > 0.0 else rotation.axis
    sign = next((math.copysign(1.0, a) for a in (x, y, z) if a != 0.0), 1.0)
    angle = (sign * rotation.angle) % 360.0
    return (sign * x, sign * y, sign * z), 0.0 if angle == 360.0 else angle
