"""A grove of one tree, after Buntin and Stamminger: 105 instances x 36,000 triangles = 3,780,000, on gentle hills.

Every tree is the same mesh, turned about the vertical by any angle, scaled alike along its axes, and translated: what
per-object shadow maps can share. The trees alone cast, and they alone are the paper's 3,780,000 triangles. The ground
receives and does not cast; its 18,432 triangles are counted apart, so that a placed grove has 3,798,432. Trees stand in
a spiral that grows outwards, so that a grove of fewer instances is the middle of one of more.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from shadowbench.parameters import ParameterModel, parameter
from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Light,
    Mesh,
    PointLight,
    Rotation,
    Scene,
    ScenePlugin,
    SpotLight,
    Vector,
    cosine_sine,
)

from .plants import within
from .shapes import joined, sheet
from .trees import LEAST_TRIANGLES, tree
from .uniform_draws import UniformDraws
from .vectors import Array, vector

MOST_INSTANCES = 1000

TREE_HEIGHT, SINK = 8.5, 0.45
"""Of the mesh [scene units]: how high the tree is, and how deep its foot goes, so that it stands on slopes."""

SCALES = (0.75, 1.25)

SPACING = 8.0
"""A tree has the square of this for itself."""

GROUND_CELLS = 96
"""Along each side of the ground, whatever its size: 2 x 96² = 18,432 triangles."""

_GOLDEN_ANGLE = 137.50776405003785

_LATTICE = 32
_HILLS = ((26.0, 3.2), (9.0, 0.5))
"""Spacing of the lattices of random heights, and the heights' range [scene units]."""

SUN: Vector = (-0.62, 1.0, 0.45)

_SUMMER, _AUTUMN = np.array([0.26, 0.42, 0.14]), np.array([0.60, 0.44, 0.12])


class Grove(ScenePlugin):
    """See the module."""

    name = "grove"
    title = "Grove of one tree"
    source = "after Buntin and Stamminger, Instanced Shadow Maps, Figure 5"

    class Parameters(ParameterModel):
        """The number of trees, their size and the seed."""

        instances: int = parameter(105, unit="trees", help="How many trees there are.", ge=1, le=MOST_INSTANCES)
        triangles: int = parameter(
            36_000,
            unit="triangles",
            help="Of one tree; more of them make more and smaller leaves of the same area.",
            ge=LEAST_TRIANGLES,
            le=360_000,
        )
        seed: int = parameter(1, unit="1", help="Another seed grows another tree and other hills.", ge=0, lt=2**32)

    def make(self, parameters: BaseModel) -> Scene:
        """Grow one tree and plant it again and again."""
        assert isinstance(parameters, self.Parameters)
        count = parameters.instances
        mesh = joined(tree(parameters.triangles, UniformDraws(parameters.seed), TREE_HEIGHT, SINK)).mesh("tree")
        # drawn apart from the tree and for as many trees as there can be: neither number changes the others' places
        draw = UniformDraws(parameters.seed + 2**32)
        hills = Hills(draw)
        places, turns, scales, ripeness = _planted(draw, hills)
        trees = [
            Instance(
                0,
                translation=vector(places[k]),
                scale=(float(scales[k]),) * 3,
                rotation=Rotation((0.0, 1.0, 0.0), float(turns[k])),
                albedo=vector(_SUMMER + ripeness[k] * (_AUTUMN - _SUMMER)),
            )
            for k in range(count)
        ]
        radius = reach(count)
        ground = Instance(1, casts=False, albedo=(0.44, 0.50, 0.24))
        return Scene(
            meshes=(mesh, hills.ground(radius + 10.0)),
            instances=(*trees, ground),
            lights=_lights(places[0], hills, radius),
            cameras=_cameras(places[0], hills, radius),
        )


def reach(count: int) -> float:
    """Return the radius of the disk in which so many trees stand, with their crowns."""
    return SPACING * math.sqrt(count / math.pi) + 4.0


class Hills:
    """Smooth heights from lattices of random numbers, the same for every size of the grove."""

    def __init__(self, draw: UniformDraws) -> None:
        self._lattices = [draw.unit_interval(_LATTICE * _LATTICE).reshape(_LATTICE, _LATTICE) - 0.5 for _ in _HILLS]

    def height(self, x: Array, z: Array) -> Array:
        """Return the ground's height at places of any one shape [scene units]."""
        total = np.zeros(np.shape(x))
        for (size, range_), lattice in zip(_HILLS, self._lattices, strict=True):
            column, across = _cell(np.asarray(x) / size)
            row, down = _cell(np.asarray(z) / size)
            beside, below = (column + 1) % _LATTICE, (row + 1) % _LATTICE
            near = lattice[row, column] + across * (lattice[row, beside] - lattice[row, column])
            far = lattice[below, column] + across * (lattice[below, beside] - lattice[below, column])
            total += range_ * (near + down * (far - near))
        return total

    def ground(self, half: float) -> Mesh:
        """Return a square of ground round the origin."""
        side = np.linspace(-half, half, GROUND_CELLS + 1)
        z, x = np.meshgrid(side, side, indexing="ij")
        return sheet(np.stack([x, self.height(x, z), z], axis=2)).mesh("ground")


def _cell(place: Array) -> tuple[NDArray[np.int64], Array]:
    """Return the lattice cell and the smooth share of the way through it (Perlin 2002: 6 t⁵ - 15 t⁴ + 10 t³)."""
    cell = np.floor(place)
    t = place - cell
    return cell.astype(np.int64) % _LATTICE, t * t * t * (t * (6.0 * t - 15.0) + 10.0)


def _planted(draw: UniformDraws, hills: Hills) -> tuple[Array, Array, Array, Array]:
    """Return places, turns [degrees], scales and colours of all trees there can be, from the middle outwards."""
    k = np.arange(MOST_INSTANCES)
    # Vogel 1979: in a spiral by the golden angle every tree has the same area
    radius = SPACING * np.sqrt((k + 0.5) / math.pi)
    cosine, sine = cosine_sine(_GOLDEN_ANGLE * k)
    aside_x, aside_z, _ = draw.unit_disk(MOST_INSTANCES)
    x, z = radius * cosine + 0.14 * SPACING * aside_x, radius * sine + 0.14 * SPACING * aside_z
    turns = within(draw, MOST_INSTANCES, 0.0, 360.0)
    scales = within(draw, MOST_INSTANCES, *SCALES)
    ripeness = draw.unit_interval(MOST_INSTANCES)
    return np.stack([x, hills.height(x, z), z], axis=1), turns, scales, ripeness * ripeness


def _lights(first: Array, hills: Hills, radius: float) -> dict[str, Light]:
    """The lamp is a lantern low beside the first tree, opposite to the near camera."""
    x, z = float(first[0]) - 2.2, float(first[2]) + 1.6
    return {
        "sun": DirectionalLight(SUN),
        "spot": SpotLight(
            (-1.1 * radius, 1.6 * radius + 12.0, 0.9 * radius), (1.1, -1.6 - 12.0 / radius, -0.9), angle=62.0
        ),
        "lamp": PointLight((x, _height(hills, x, z) + 1.3, z)),
    }


def _height(hills: Hills, x: float, z: float) -> float:
    return float(hills.height(np.array(x), np.array(z)))


def _cameras(first: Array, hills: Hills, radius: float) -> dict[str, Camera]:
    """``near`` stands where the first tree's crown throws its shadow, so within its shadow volume."""
    above = 0.45 * TREE_HEIGHT
    x, z = float(first[0]) - above * SUN[0] / SUN[1], float(first[2]) - above * SUN[2] / SUN[1]
    eye = (x, _height(hills, x, z) + 1.7, z)
    return {
        "overview": Camera(
            (0.35 * radius, 0.55 * radius + 7.0, 1.32 * radius + 9.0), (0.0, 1.5, 0.08 * radius), vertical_angle=40.0
        ),
        "near": Camera(eye, (float(first[0]) - 2.0, float(first[1]) + 0.9, float(first[2]) + 0.3), vertical_angle=60.0),
        "far": Camera((0.8 * radius, 1.3 * radius + 14.0, 3.2 * radius + 20.0), (0.0, 0.0, 0.0), vertical_angle=30.0),
    }
