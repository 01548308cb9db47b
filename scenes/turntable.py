"""One object turned about the vertical over a ground that casts nothing: what a map drawn at another angle gets wrong.

The angle is the instance's rotation, so that a technique which shares maps between angles can know it. All objects are
about as large and stand within the same circle, so that cameras and lights are the same for every object and angle.
``tree`` is the grove's, of 36,000 triangles and round about its trunk in the large; ``bench`` is long, narrow and full
of gaps; ``l-block`` is two walls at a right angle, large and flat, which look different from every side.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel

from shadowbench.parameters import ParameterModel, parameter
from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Light,
    PointLight,
    Rotation,
    Scene,
    ScenePlugin,
    SpotLight,
    Vector,
)

from .furniture import seat
from .shapes import Shape, boxes, joined, rectangle
from .trees import tree
from .uniform_draws import UniformDraws

RADIUS, HEIGHT = 1.0, 2.0
"""No object reaches farther from the axis, nor higher, at any angle [scene units]."""

GROUND = 4.5
"""Half the ground's side [scene units]."""

TREE_TRIANGLES = 36_000

_TREE_SINK = 0.03

ALBEDOS: dict[str, Vector] = {
    "tree": (0.30, 0.46, 0.18),
    "bench": (0.66, 0.46, 0.28),
    "l-block": (0.74, 0.52, 0.44),
}

LIGHTS: dict[str, Light] = {
    "sun": DirectionalLight((-0.75, 1.0, 0.55)),
    "spot": SpotLight(position=(-4.2, 5.6, 3.1), direction=(4.6, -5.4, -3.4), angle=62.0),
    "lamp": PointLight((-1.4, 1.25, 1.25)),
}

CAMERAS = {
    "overview": Camera(eye=(1.9, 3.5, 4.6), target=(0.55, 0.62, -0.3), vertical_angle=32.0),
    "close": Camera(eye=(0.3, 1.7, 3.3), target=(0.0, 0.72, 0.0), vertical_angle=36.0),
}


class Turntable(ScenePlugin):
    """See the module."""

    name = "turntable"
    title = "One object, turned"
    source = "for the rotations of Buntin and Stamminger, Instanced Shadow Maps"

    class Parameters(ParameterModel):
        """What stands there, and how it is turned."""

        object: Literal["tree", "bench", "l-block"] = parameter("tree", unit="1", help="What stands there.")
        angle: float = parameter(
            0.0,
            unit="degrees",
            help="Turn about the vertical, counter-clockwise seen from above.",
            ge=-360.0,
            le=360.0,
        )

    def make(self, parameters: BaseModel) -> Scene:
        """Put the object in the middle and turn it."""
        assert isinstance(parameters, self.Parameters)
        name = parameters.object
        shape = {"tree": _tree, "bench": _bench, "l-block": _l_block}[name]()
        turn = Rotation((0.0, 1.0, 0.0), parameters.angle)
        return Scene(
            meshes=(shape.mesh(name), rectangle((-GROUND, GROUND), (-GROUND, GROUND)).mesh("ground")),
            instances=(
                Instance(0, rotation=turn, albedo=ALBEDOS[name]),
                Instance(1, casts=False, albedo=(0.78, 0.77, 0.73)),
            ),
            lights=LIGHTS,
            cameras=CAMERAS,
        )


def _tree() -> Shape:
    return joined(tree(TREE_TRIANGLES, UniformDraws(1), HEIGHT, _TREE_SINK))


def _bench() -> Shape:
    return seat(1.05, arms=True).scaled(1.5, 1.5, 1.5)


def _l_block() -> Shape:
    """Return two walls along x and z that meet at a corner, the second lower."""
    along_x = boxes((-0.55, 0.0, -0.55), (0.75, 1.4, -0.3))
    along_z = boxes((-0.55, 0.0, -0.3), (-0.3, 0.8, 0.7))
    return joined([along_x, along_z])
