"""A lower and an upper floor; the upper one covers the lower one from the light straight above."""

import numpy as np

from shadowbench.scene import Camera, DirectionalLight, Instance, Mesh, Scene, ScenePlugin


class Step(ScenePlugin):
    """Two floors, one above the other."""

    name = "umbra-step"
    title = "Two floors"

    def make(self, parameters):
        corners = np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], np.float32)
        floor = Mesh("floor", corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
        return Scene(
            meshes=(floor,),
            instances=(Instance(0), Instance(0, translation=(0.0, 1.0, 0.0), scale=(1.5, 1.0, 1.5))),
            lights={"above": DirectionalLight((0.0, 1.0, 0.0))},
            cameras={"front": Camera((0.0, 1.6, 5.0), (0.0, 0.4, 0.0))},
        )
