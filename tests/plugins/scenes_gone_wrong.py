"""Scenes that each break in one way."""

import os
import time

import numpy as np

from shadowbench.errors import SceneError
from shadowbench.scene import Camera, DirectionalLight, Instance, Mesh, Scene, ScenePlugin


class _Wrong(ScenePlugin):
    """Breaks."""

    title = "Wrong"


class Crashing(_Wrong):
    name = "crashing"

    def make(self, parameters):
        os.abort()


class Raising(_Wrong):
    name = "raising"

    def make(self, parameters):
        raise KeyError("lost")


class Endless(_Wrong):
    name = "endless"

    def make(self, parameters):
        while True:
            time.sleep(1)


class Refusing(_Wrong):
    name = "refusing"

    def make(self, parameters):
        raise SceneError("there is nothing to see")


class LookingAway(_Wrong):
    """Nothing is in the picture, which shows only when receivers are made."""

    name = "looking-away"

    def make(self, parameters):
        corners = np.array([(0, 0, 0), (0, 0, 1), (1, 0, 0)], np.float32)
        return Scene(
            meshes=(Mesh("triangle", corners, np.array([[0, 1, 2]], np.int32)),),
            instances=(Instance(0),),
            lights={"sun": DirectionalLight((0, 1, 0))},
            cameras={"away": Camera((0, 1, 5), (0, 1, 10))},
        )
