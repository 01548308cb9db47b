"""A small house for the outdoor scenes: walls with set-back windows and a door, shutters, a tiled roof, a chimney.

Its parts come apart by colour, since an instance has one. The front faces +z and stands at z = 0, the ground at y = 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from shadowbench.scene import Vector

from .plants import within
from .shapes import Opening, Shape, bars, boxes, joined, prism, wall
from .tubes import tubes
from .uniform_draws import UniformDraws
from .vectors import Array, unit

_THICKNESS = 0.3
_EAVES, _GABLE = 0.5, 0.45
"""How far the roof stands out, along its slope's foot and beyond the gables."""

_SLAB = 0.14

TILE_ALBEDOS: tuple[Vector, ...] = ((0.58, 0.25, 0.17), (0.52, 0.21, 0.15), (0.63, 0.31, 0.20))
WALL_ALBEDO: Vector = (0.86, 0.81, 0.70)
WOOD_ALBEDO: Vector = (0.90, 0.90, 0.87)
SHUTTER_ALBEDO: Vector = (0.29, 0.42, 0.40)
PANE_ALBEDO: Vector = (0.12, 0.15, 0.18)
STONE_ALBEDO: Vector = (0.60, 0.58, 0.54)


@dataclass(frozen=True)
class House:
    """Its measures [metres].

    Attributes:
        x: Where the gables stand.
        depth: From front to back.
        eaves, ridge: Heights of the wall's top and of the roof's inner ridge.
        windows, door: Openings in the front.
    """

    x: tuple[float, float]
    depth: float
    eaves: float
    ridge: float
    windows: tuple[Opening, ...]
    door: Opening

    def parts(self, draw: UniformDraws) -> Iterator[tuple[str, Shape, Vector]]:
        """Yield name, shape and albedo of each part."""
        yield "house walls", self._walls(), WALL_ALBEDO
        yield "house frames", joined([*map(_frame, self.windows), _door_frame(self.door)]), WOOD_ALBEDO
        yield "house panes", joined(_pane(window) for window in self.windows), PANE_ALBEDO
        yield "house shutters", joined([*map(_shutters, self.windows), _door_leaf(self.door)]), SHUTTER_ALBEDO
        yield "house stones", self._stones(), STONE_ALBEDO
        yield "house gutter", self._gutter(), (0.45, 0.42, 0.38)
        yield "roof", self._slabs(), (0.50, 0.42, 0.34)
        tiles = self._tiles()
        kind = (3.0 * draw.unit_interval(len(tiles))).astype(np.int64)
        for k, albedo in enumerate(TILE_ALBEDOS):
            yield f"roof tiles {k + 1}", self._tile_bars(tiles[kind == k], draw), albedo

    def _walls(self) -> Shape:
        half = self.depth / 2.0
        outline = [(-half, 0.0), (half, 0.0), (half, self.eaves), (0.0, self.ridge), (-half, self.eaves)]
        gable = prism(outline, 0.0, _THICKNESS).turned((0.0, 1.0, 0.0), 90.0).moved(z=-half)
        inside = (self.x[0] + _THICKNESS, self.x[1] - _THICKNESS)
        front = wall(inside, self.eaves, (-_THICKNESS, 0.0), (*self.windows, self.door))
        back = wall(inside, self.eaves, (-self.depth, -self.depth + _THICKNESS))
        return joined([gable.moved(x=self.x[0]), gable.moved(x=self.x[1] - _THICKNESS), front, back])

    def _slopes(self) -> Iterator[tuple[Array, Array, Array, float]]:
        """Yield, for front and back: the ridge's middle, the way down the slope, the normal, the slope's length."""
        half, rise = self.depth / 2.0, self.ridge - self.eaves
        length = float(np.sqrt(half * half + rise * rise)) * (half + _EAVES) / half
        for side in (1.0, -1.0):
            ridge = np.array([(self.x[0] + self.x[1]) / 2.0, self.ridge, -half])
            yield ridge, unit((0.0, -rise, side * half)), unit((0.0, half, side * rise)), length

    def _slabs(self) -> Shape:
        reach = np.array([(self.x[1] - self.x[0]) / 2.0 + _GABLE, 0.0, 0.0])
        parts = []
        for ridge, down, normal, length in self._slopes():
            middle = ridge + 0.5 * length * down + 0.5 * _SLAB * normal
            parts.append(bars(middle - reach, middle + reach, length, _SLAB, up=normal))
        crest = prism([(-0.17, 0.0), (0.17, 0.0), (0.09, 0.19), (-0.09, 0.19)], -reach[0] - 0.03, reach[0] + 0.03)
        crest = crest.turned((0.0, 1.0, 0.0), 90.0).moved(float(ridge[0]), self.ridge + 0.06, float(ridge[2]))
        return joined([*parts, crest])

    def _tiles(self) -> Array:
        """Return slope (0 or 1), row from the ridge and place along the ridge of each tile, shape [tile_count, 3]."""
        (*_, length), _ = self._slopes()
        reach = (self.x[1] - self.x[0]) / 2.0 + _GABLE
        rows, columns = round(length / 0.34), round(2.0 * reach / 0.3)
        slope, row, column = np.meshgrid(np.arange(2), np.arange(rows), np.arange(columns), indexing="ij")
        along = -reach + (column + 0.5) * 2.0 * reach / columns
        return np.stack([slope.ravel(), row.ravel() / rows, along.ravel()], axis=1)

    def _tile_bars(self, tiles: Array, draw: UniformDraws) -> Shape:
        """Return tiles that overlap like scales: each lies on the next lower one and stands off it a little."""
        parts = []
        for k, (ridge, down, normal, length) in enumerate(self._slopes()):
            chosen = tiles[tiles[:, 0] == k]
            begin = ridge + chosen[:, 2:] * np.array([1.0, 0.0, 0.0]) + chosen[:, 1:2] * length * down
            lift = within(draw, len(chosen), 0.0, 0.012)[:, None]
            upper = begin + (_SLAB + 0.012) * normal
            lower = begin + 0.43 * down + (_SLAB + 0.052 + lift) * normal
            parts.append(bars(upper, lower, 0.285, 0.02, up=normal))
        return joined(parts)

    def _stones(self) -> Shape:
        """Return the chimney, the sills and the door's step."""
        x, z = self.x[0] + 0.3 * (self.x[1] - self.x[0]), -0.35 * self.depth
        chimney = boxes((x - 0.3, self.eaves, z - 0.3), (x + 0.3, self.ridge + 0.75, z + 0.3))
        cap = boxes((x - 0.37, self.ridge + 0.75, z - 0.37), (x + 0.37, self.ridge + 0.84, z + 0.37))
        flues = [
            boxes((c - 0.09, self.ridge + 0.84, z - 0.09), (c + 0.09, self.ridge + 1.1, z + 0.09))
            for c in (x - 0.15, x + 0.15)
        ]
        sills = [boxes((x0 - 0.06, y0 - 0.06, -0.18), (x1 + 0.06, y0, 0.07)) for x0, x1, y0, _ in self.windows]
        x0, x1, y0, _ = self.door
        step = boxes((x0 - 0.15, 0.0, 0.0), (x1 + 0.15, y0, 0.42))
        return joined([chimney, cap, *flues, *sills, step])

    def _gutter(self) -> Shape:
        ridge, down, normal, length = next(self._slopes())
        eave = ridge + length * down + 0.02 * normal
        x0, x1, y, z = self.x[0] - _GABLE, self.x[1] + _GABLE, float(eave[1]), float(eave[2]) + 0.06
        pipe = [(self.x[1] - 0.12, y, z), (self.x[1] - 0.12, y - 0.12, z), (self.x[1] - 0.12, y - 0.45, 0.07)]
        return joined(
            [tubes([[(x0, y, z), (x1, y, z)]], 0.06, 12), tubes([[*pipe, (pipe[0][0], 0.0, 0.07)]], 0.04, 12)]
        )


def _frame(window: Opening) -> Shape:
    """Return a window's frame and glazing bars, in the middle of the wall's thickness."""
    x0, x1, y0, y1 = window
    z0, z1 = -0.2, -0.13
    middle, upper = (x0 + x1) / 2.0, y0 + 0.62 * (y1 - y0)
    return joined(
        [
            boxes((x0, y0, z0), (x0 + 0.06, y1, z1)),
            boxes((x1 - 0.06, y0, z0), (x1, y1, z1)),
            boxes((x0 + 0.06, y0, z0), (x1 - 0.06, y0 + 0.06, z1)),
            boxes((x0 + 0.06, y1 - 0.06, z0), (x1 - 0.06, y1, z1)),
            boxes((middle - 0.035, y0 + 0.06, z0), (middle + 0.035, y1 - 0.06, z1)),
            boxes((x0 + 0.06, upper - 0.02, z0 + 0.01), (middle - 0.035, upper + 0.02, z1 - 0.01)),
            boxes((middle + 0.035, upper - 0.02, z0 + 0.01), (x1 - 0.06, upper + 0.02, z1 - 0.01)),
        ]
    )


def _pane(window: Opening) -> Shape:
    x0, x1, y0, y1 = window
    return boxes((x0, y0, -0.2), (x1, y1, -0.18))


def _shutters(window: Opening) -> Shape:
    """Return two louvred shutters, folded back against the wall on both sides."""
    x0, x1, y0, y1 = window
    width = (x1 - x0) / 2.0
    louvres = round((y1 - y0 - 0.1) / 0.055)
    y = y0 + 0.06 + (np.arange(louvres) + 0.5) * (y1 - y0 - 0.12) / louvres
    parts = []
    for left in (x0 - width - 0.02, x1 + 0.02):
        right = left + width
        parts += [boxes((x, y0, 0.012), (x + 0.05, y1, 0.05)) for x in (left, right - 0.05)]
        parts += [boxes((left + 0.05, y, 0.012), (right - 0.05, y + 0.06, 0.05)) for y in (y0, y1 - 0.06)]
        parts += [boxes((left + 0.1, y, 0.0), (left + 0.16, y + 0.04, 0.012)) for y in (y0 + 0.2, y1 - 0.24)]
        ends = [
            np.stack([np.full(louvres, x), y, np.full(louvres, 0.031)], axis=1) for x in (left + 0.05, right - 0.05)
        ]
        parts.append(bars(ends[0], ends[1], 0.045, 0.008, up=unit((0.0, 0.75, 0.66))))
    return joined(parts)


def _door_frame(door: Opening) -> Shape:
    x0, x1, y0, y1 = door
    return joined(
        [
            boxes((x0, y0, -0.2), (x0 + 0.08, y1, -0.1)),
            boxes((x1 - 0.08, y0, -0.2), (x1, y1, -0.1)),
            boxes((x0 + 0.08, y1 - 0.08, -0.2), (x1 - 0.08, y1, -0.1)),
        ]
    )


def _door_leaf(door: Opening) -> Shape:
    """Return the door: four panels on a leaf, and a handle."""
    x0, x1, y0, y1 = door[0] + 0.08, door[1] - 0.08, door[2], door[3] - 0.08
    parts = [
        boxes((x0, y0, -0.18), (x1, y1, -0.14)),
        bars((x0 + 0.1, y0 + 0.95, -0.1), (x0 + 0.22, y0 + 0.95, -0.1), 0.02, 0.02),
    ]
    parts.append(bars((x0 + 0.11, y0 + 0.95, -0.14), (x0 + 0.11, y0 + 0.95, -0.09), 0.02, 0.02))
    middle = (x0 + x1) / 2.0
    for left, right in ((x0 + 0.12, middle - 0.06), (middle + 0.06, x1 - 0.12)):
        parts += [
            boxes((left, y0 + low, -0.14), (right, y0 + high, -0.125))
            for low, high in ((0.2, 0.85), (1.05, y1 - y0 - 0.15))
        ]
    return joined(parts)
