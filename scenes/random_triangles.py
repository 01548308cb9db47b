"""Random triangles over a ground: the scene of Aila and Laine's scalability table.

Equilateral triangles of equal size and random place and attitude float in a box. Whatever their number, their total
area is the same, so that the share of the ground in shadow stays and only the detail grows: "thus eliminating the
effect of occlusion culling" (paper, section 6). The generator is written from raw 64-bit draws, whose stream NumPy
guarantees, and from arithmetic that IEEE 754 rounds in one way only, so every machine builds the same bits.
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
    Scene,
    ScenePlugin,
    SpotLight,
)

Array = NDArray[np.float64]

TOTAL_AREA = 4.0
"""Default total area, as large as the box's floor: the one number the paper leaves open. Half of it is the mean
projected area, which leaves e^-0.5, or 61 %, of the floor lit by the sun."""

BOX_HALF_WIDTH, BOX_HEIGHT = 1.0, 1.0
"""The triangles' centres lie in [-1, 1] x (0, 1] x [-1, 1]."""

GROUND_GAP = 0.005
"""No triangle comes nearer to the ground than this [scene units]; so none pierces it."""

LIGHTS: dict[str, Light] = {
    "sun": DirectionalLight((0.35, 0.9, 0.25)),
    "spot": SpotLight(position=(1.5, 5.0, 1.0), direction=(-1.5, -4.6, -1.0), angle=60.0),
    "lamp": PointLight((0.15, 0.7, 0.1)),
}

CAMERAS = {
    "middle": Camera(eye=(0.0, 2.2, 1.3), target=(0.0, 0.2, 0.05), vertical_angle=40.0),
    "zoom-out": Camera(eye=(0.0, 3.4, 2.05), target=(0.0, 0.2, 0.05), vertical_angle=40.0),
    "zoom-in": Camera(eye=(0.0, 2.2, 1.3), target=(0.0, 0.2, 0.05), vertical_angle=10.0),
}
"""``middle`` stands for the middle picture of Fig. 3's top row, from which Table 1 was taken; every pixel of it sees a
surface. The other two are its neighbours in the figure's zoom."""


class RandomTriangles(ScenePlugin):
    """See the module."""

    name = "random-triangles"
    title = "Random triangles of constant total area"
    source = "Aila and Laine 2004, Table 1 and Figure 3"

    class Parameters(ParameterModel):
        """The scene's size and seed."""

        triangles: int = parameter(
            10_000, unit="triangles", help="How many triangles float above the ground.", ge=1, le=4_000_000
        )
        seed: int = parameter(1, unit="1", help="Another seed is another draw of the same kind.", ge=0, lt=2**32)
        area: float = parameter(
            TOTAL_AREA, unit="square scene units", help="Area of all triangles together.", gt=0.0, le=100.0
        )
        ground: float = parameter(8.0, unit="scene units", help="Side of the square ground.", ge=2.0, le=1000.0)

    def make(self, parameters: BaseModel) -> Scene:
        """Draw the triangles and lay the ground."""
        assert isinstance(parameters, self.Parameters)
        soup = random_triangles(parameters.triangles, parameters.seed, parameters.area)
        half = parameters.ground / 2.0
        corners = [(-half, 0.0, -half), (half, 0.0, -half), (half, 0.0, half), (-half, 0.0, half)]
        ground = Mesh("ground", np.array(corners), np.array([(0, 2, 1), (0, 3, 2)], np.int32))
        return Scene(
            meshes=(soup, ground),
            instances=(Instance(0, albedo=(0.85, 0.62, 0.42)), Instance(1, albedo=(0.78, 0.78, 0.76))),
            lights=LIGHTS,
            cameras=CAMERAS,
        )


def random_triangles(triangle_count: int, seed: int, area: float) -> Mesh:
    """Return ``triangle_count`` equilateral triangles of total area ``area``, float32, no vertex shared.

    Centres are uniform in the box, attitudes uniform over all rotations.
    """
    # area of an equilateral triangle by its circumradius: 3/4 sqrt(3) r^2
    radius = math.sqrt(area / triangle_count * 4.0 / (3.0 * math.sqrt(3.0)))
    draw = _UniformDraws(seed)
    lowest = radius + GROUND_GAP
    highest = max(BOX_HEIGHT, lowest)
    centre = (
        BOX_HALF_WIDTH * (2.0 * draw.unit_interval(triangle_count) - 1.0),
        lowest + (highest - lowest) * draw.unit_interval(triangle_count),
        BOX_HALF_WIDTH * (2.0 * draw.unit_interval(triangle_count) - 1.0),
    )
    first_axis, second_axis = _plane_axes(draw.unit_quaternions(triangle_count))
    vertices = np.empty((triangle_count, 3, 3), np.float32)
    half_root = math.sqrt(3.0) / 2.0
    for corner, (cosine, sine) in enumerate(((1.0, 0.0), (-0.5, half_root), (-0.5, -half_root))):
        for axis in range(3):
            offset = cosine * first_axis[axis] + sine * second_axis[axis]
            vertices[:, corner, axis] = centre[axis] + radius * offset
    triangles = np.arange(3 * triangle_count, dtype=np.int32).reshape(-1, 3)
    return Mesh("triangles", vertices.reshape(-1, 3), triangles)


class _UniformDraws:
    """Random numbers from the raw stream of PCG64, the same in every NumPy version."""

    def __init__(self, seed: int) -> None:
        self._bits = np.random.PCG64(seed)

    def unit_interval(self, count: int) -> Array:
        """Uniform in [0, 1), multiples of 2^-53, shape [count]."""
        raw: Array = (self._bits.random_raw(count) >> np.uint64(11)).astype(np.float64)
        return raw * 2.0**-53

    def unit_disk(self, count: int) -> tuple[Array, Array, Array]:
        """Return x, y and x² + y² of points uniform in the open unit disk without its centre, by rejection."""
        kept: list[tuple[Array, Array, Array]] = []
        missing = count
        while missing > 0:
            tries = missing + missing // 2 + 8  # 4/pi = 1.27 are needed
            x, y = 2.0 * self.unit_interval(tries) - 1.0, 2.0 * self.unit_interval(tries) - 1.0
            squared = x * x + y * y
            inside = np.flatnonzero((squared < 1.0) & (squared > 0.0))[:missing]
            kept.append((x[inside], y[inside], squared[inside]))
            missing -= len(inside)
        x, y, squared = (np.concatenate(parts) for parts in zip(*kept, strict=True))
        return x, y, squared

    def unit_quaternions(self, count: int) -> tuple[Array, Array, Array, Array]:
        """Uniform over the rotations, after Marsaglia 1972, "Choosing a point from the surface of a sphere"."""
        x, y, first_squared = self.unit_disk(count)
        z, w, second_squared = self.unit_disk(count)
        factor = np.sqrt((1.0 - first_squared) / second_squared)
        return x, y, z * factor, w * factor


def _plane_axes(
    quaternions: tuple[Array, Array, Array, Array],
) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]]:
    """Return the images of the x and the y axis under the rotations."""
    w, x, y, z = quaternions
    first = (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y))
    second = (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x))
    return first, second
