"""A board leaning over the ground, under a sun in the zenith: every separation of blocker and receiver, side by side.

The board rises evenly from the ground to height 1, the height of the whole scene, so that a place on the ground under
it at a share s of its length has its blocker s of the depth range above it. What a filtered map takes for visibility at
a separation, its step function, is painted on the ground: seen from the open side it runs from the hinge, where board
and ground meet, towards the eye.
"""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel

from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Mesh,
    NoParameters,
    PointLight,
    Scene,
    ScenePlugin,
    SpotLight,
)

LENGTH, HEIGHT, HALF_WIDTH = 2.0, 1.0, 1.0
"""Of the board's shadow on the ground, of its upper edge, and half the board's width [scene units]."""

GROUND = 3.0
"""Half the ground's side [scene units]."""


class LeaningBoard(ScenePlugin):
    """A board that leans over the ground."""

    name = "leaning-board"
    title = "A leaning board"
    source = "for the step functions of Annen et al. 2008, Figure 2"
    Parameters = NoParameters

    def make(self, parameters: BaseModel) -> Scene:
        """Lay the ground and lean the board."""
        half = LENGTH / 2.0
        ground = [(-GROUND, 0.0, -GROUND), (-GROUND, 0.0, GROUND), (GROUND, 0.0, GROUND), (GROUND, 0.0, -GROUND)]
        board = [
            (-half, 0.0, -HALF_WIDTH),
            (-half, 0.0, HALF_WIDTH),
            (half, HEIGHT, HALF_WIDTH),
            (half, HEIGHT, -HALF_WIDTH),
        ]
        quad = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
        return Scene(
            meshes=(Mesh("ground", np.array(ground), quad), Mesh("board", np.array(board), quad)),
            instances=(Instance(0, albedo=(0.80, 0.80, 0.78)), Instance(1, albedo=(0.72, 0.50, 0.32))),
            lights={
                "sun": DirectionalLight((0.0, 1.0, 0.0)),
                "spot": SpotLight(position=(0.3, 5.0, 0.2), direction=(-0.3, -5.0, -0.2), angle=50.0),
                "lamp": PointLight((0.4, 3.0, 0.3)),
            },
            cameras={
                "under": Camera(eye=(3.2, 0.62, 0.0), target=(0.0, 0.12, 0.0), vertical_angle=36.0),
                "hinge": Camera(eye=(0.35, 0.3, 0.0), target=(-1.0, 0.02, 0.0), vertical_angle=42.0),
            },
        )
