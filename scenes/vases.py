"""Four vases, translated and scaled instances of one surface of revolution on a floor, after Buntin and Stamminger.

Under parallel light one shadow map of the vase serves all four (their Figure 1). A vase has a wall, a lip and an inside
that shades itself: 17,856 triangles, 71,424 for the four, which alone cast; the floor's two receive.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel

from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Light,
    PointLight,
    Scene,
    ScenePlugin,
    SpotLight,
    Vector,
)

from .shapes import Shape, rectangle, revolved
from .vectors import Array

SIDES = 96

_OUTSIDE = [
    (0.17, 0.03),
    (0.16, 0.1),
    (0.34, 0.32),
    (0.37, 0.62),
    (0.2, 0.86),
    (0.085, 1.02),
    (0.085, 1.16),
    (0.17, 1.28),
]
_INSIDE = [(0.15, 1.275), (0.065, 1.155), (0.065, 1.02), (0.18, 0.845), (0.345, 0.62), (0.315, 0.33), (0.14, 0.14)]
"""Where the profile is drawn to: radius and height, up the outside and down the inside."""

PLACES: tuple[tuple[float, float, float, Vector], ...] = (
    (-0.95, -0.35, 1.0, (0.36, 0.50, 0.66)),
    (0.05, 0.15, 0.72, (0.80, 0.46, 0.32)),
    (0.95, -0.5, 1.3, (0.86, 0.80, 0.66)),
    (1.15, 0.75, 0.5, (0.42, 0.56, 0.40)),
)
"""x, z, scale and albedo of each."""

LIGHTS: dict[str, Light] = {
    "sun": DirectionalLight((-0.75, 1.0, 0.55)),
    "spot": SpotLight(position=(-2.8, 4.4, 2.6), direction=(2.9, -4.2, -2.6), angle=56.0),
    "lamp": PointLight((0.35, 1.5, 0.9)),
}

CAMERAS = {
    "overview": Camera(eye=(1.3, 2.3, 4.6), target=(0.25, 0.5, -0.15), vertical_angle=34.0),
    "close": Camera(eye=(0.9, 1.6, 2.1), target=(0.15, 0.4, 0.0), vertical_angle=34.0),
    "low": Camera(eye=(3.3, 0.45, 3.4), target=(0.1, 0.6, -0.3), vertical_angle=34.0),
}


class Vases(ScenePlugin):
    """See the module."""

    name = "vases"
    title = "Four instances of a vase"
    source = "after Buntin and Stamminger, Instanced Shadow Maps, Figure 1"

    def make(self, parameters: BaseModel) -> Scene:
        """Turn one vase and set it up four times."""
        vases = [
            Instance(0, translation=(x, 0.0, z), scale=(scale, scale, scale), albedo=albedo)
            for x, z, scale, albedo in PLACES
        ]
        floor = rectangle((-2.4, 3.2), (-2.4, 2.4)).mesh("floor")
        return Scene(
            meshes=(vase().mesh("vase"), floor),
            instances=(*vases, Instance(1, casts=False, albedo=(0.76, 0.73, 0.68))),
            lights=LIGHTS,
            cameras=CAMERAS,
        )


def vase() -> Shape:
    """Return the vase, which stands on the origin and is about as high as 1.28 [scene units]."""
    foot, bottom = [(0.0, 0.0), (0.17, 0.0)], [(0.0, 0.11)]
    return revolved(np.concatenate([foot, _smooth(_OUTSIDE), _smooth(_INSIDE), bottom]), SIDES)


def _smooth(corners: ArrayLike) -> Array:
    """Return the corners cut off three times (Chaikin 1974): a quadratic B-spline through both ends, near enough."""
    line = np.asarray(corners, np.float64)
    for _ in range(3):
        near, far = 0.75 * line[:-1] + 0.25 * line[1:], 0.25 * line[:-1] + 0.75 * line[1:]
        cut = np.stack([near, far], axis=1).reshape(-1, 2)
        line = np.concatenate([line[:1], cut[1:-1], line[-1:]])
    return line
