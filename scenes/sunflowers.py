"""Sunflowers: stem, leaves, and a heart in two rings of petals, all turned to where the sun stands at noon."""

from __future__ import annotations

import numpy as np

from .plants import LEAF_TRIANGLES, UP, leaf_length, leaves, leaves_about, within
from .shapes import Shape, repeated
from .tubes import tubes
from .uniform_draws import UniformDraws
from .vectors import Array, across, cross, turned, unit

PETALS = 21
"""In each of the two rings."""

_SOUTH = np.array([-0.1, 0.35, 1.0])
_RIM = 16


class Sunflowers:
    """A row of sunflowers that stand on y = 0.

    Args:
        draw: Where chance comes from.
        count: How many.
        x, z: The bed: one flower in each of ``count`` parts along x, anywhere along z.
    """

    def __init__(self, draw: UniformDraws, count: int, x: tuple[float, float], z: tuple[float, float]) -> None:
        place = (np.arange(count) + 0.6 * draw.unit_interval(count)) / count
        root = np.stack([x[0] + (x[1] - x[0]) * place, np.zeros(count), within(draw, count, *z)], axis=1)
        tall = within(draw, count, 1.15, 1.95)[:, None, None]
        lean = np.stack([within(draw, count, -0.12, 0.12), np.zeros(count), within(draw, count, 0.0, 0.2)], axis=1)
        share = np.linspace(0.0, 1.0, 9)[:, None]
        self.count = count
        self._paths = root[:, None] + tall * (share * UP + share * share * lean[:, None])
        aside = [within(draw, count, -0.4, 0.4), within(draw, count, -0.25, 0.25), np.zeros(count)]
        self._facing = unit(_SOUTH + np.stack(aside, axis=1))
        self._heads = self._paths[:, -1] + 0.03 * self._facing

    def _rays(self, number: int, shift: float) -> Array:
        """Return so many unit vectors round each head, shape [count, number, 3]."""
        first = across(self._facing)
        angles = 360.0 * (np.arange(number) + shift) / number
        return turned(first[:, None], cross(self._facing, first)[:, None], angles)

    def stems(self) -> Shape:
        """Return the stems: 96 triangles each."""
        return tubes(self._paths, 0.014 * (1.0 - 0.4 * np.linspace(0.0, 1.0, 9)), 6)

    def petals(self) -> Shape:
        """Return the petals: 4 · PETALS triangles a flower; the inner ring stands up more than the outer."""
        rays = [
            unit(self._rays(PETALS, shift) + lift * self._facing[:, None]) for shift, lift in ((0.0, 0.25), (0.5, 0.05))
        ]
        out = np.concatenate(rays, axis=1)
        base = self._heads[:, None] + 0.055 * out
        facing = np.broadcast_to(self._facing[:, None], out.shape)
        return leaves(base.reshape(-1, 3), out.reshape(-1, 3), facing.reshape(-1, 3), np.full(out.size // 3, 0.13))

    def hearts(self) -> Shape:
        """Return the hearts, each a flat double cone: 32 triangles."""
        rim = self._heads[:, None] + 0.07 * self._rays(_RIM, 0.0)
        poles = self._heads[:, None] + np.array([0.035, -0.03])[:, None] * self._facing[:, None]
        here, beside = np.arange(_RIM), (np.arange(_RIM) + 1) % _RIM
        front = np.stack([here, beside, np.full(_RIM, _RIM)], axis=1)
        back = np.stack([beside, here, np.full(_RIM, _RIM + 1)], axis=1)
        points = np.concatenate([rim, poles], axis=1)
        return Shape(points.reshape(-1, 3), repeated(np.concatenate([front, back]), self.count, _RIM + 2))

    def leaves(self, draw: UniformDraws, triangle_count: int, area: float) -> Shape:
        """Return leaves of this area together along the stems, exactly so many triangles."""
        count = -(-triangle_count // LEAF_TRIANGLES)
        flower = np.arange(count) % self.count
        ring = 1 + (6.0 * draw.unit_interval(count)).astype(np.int64)
        east, south = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
        outward = turned(east, south, 360.0 * draw.unit_interval(count))
        base = self._paths[flower, ring]
        return leaves_about(draw, base, outward, leaf_length(count, area)).first(triangle_count)
