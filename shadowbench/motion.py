"""What moves between two frames: the frame before, and what a method is told of the step from it.

A method pays ``build()`` for what moved since the frame before, and only for that if it can. Which share of its work
it can keep depends on what moves, so a comparison says so (``moving``):

* ``everything``: all that can move did, and ``build()`` starts from nothing, as a scene-wide map must;
* ``object``: one caster, the first, took a step and turned;
* ``light``: the light took a step, or turned if it is parallel;
* ``camera``: the camera went round its target by a degree, and nothing else changed.

The step always *ends* in the scene as it was made. The picture, its receivers and its ground truth are therefore the
same whatever moves, and a method that keeps what it must not keep fails visibly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from shadowbench.light_space import axes_of, camera_frame
from shadowbench.method import Changes, View
from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Light,
    PointLight,
    RectangularLight,
    Rotation,
    SpotLight,
    Vector,
)
from shadowbench.world import World

STEP = 0.01
"""Length of a step, as a share of the world's diagonal."""

TURN = 7.0
"""An object's turn about its own axis [degrees]: no multiple of the steps of per-object maps."""

LIGHT_TURN = 1.0
"""A parallel light's turn [degrees]."""

CAMERA_TURN = 1.0
"""A camera's turn round its target [degrees]."""


@dataclass(frozen=True, eq=False)
class Moment:
    """What a frame is made of.

    Attributes:
        world: The placed scene.
        light: One of its lights.
        camera: One of its cameras.
    """

    world: World
    light: Light
    camera: Camera

    def view(self, width: int, height: int) -> View:
        """Return what the camera sees in a picture of a size [pixels]."""
        return View(self.camera, width, height, camera_frame(self.camera, width, height, self.world))


def everything_changed(world: World) -> Changes:
    """Return what a method is told before its first frame."""
    return Changes(light=True, instances=frozenset(range(len(world.casters.instances))), view=True)


def moment_before(now: Moment, moving: str) -> tuple[Moment, Changes]:
    """Return the frame before a frame, and what changed from the one to the other.

    Args:
        now: The frame.
        moving: One of :data:`shadowbench.choices.MOVING`.
    """
    match moving:
        case "everything":
            return now, everything_changed(now.world)
        case "object":
            caster = next((i for i, instance in enumerate(now.world.instances) if instance.casts), None)
            if caster is None:
                return now, Changes(light=False, instances=frozenset(), view=False)
            moved = now.world.moved({caster: _stepped(now.world, caster)})
            return replace(now, world=moved), Changes(light=False, instances=frozenset({0}), view=False)
        case "light":
            return replace(now, light=_light_before(now.light, now.world)), Changes(True, frozenset(), view=False)
        case "camera":
            return replace(now, camera=_camera_before(now.camera)), Changes(False, frozenset(), view=True)
        case _:
            raise ValueError(f"nothing moves like '{moving}'")


def _stepped(world: World, number: int) -> Instance:
    """Return an instance as authored, but a step nearer to the middle of the world along x and z, and turned."""
    low, high = (np.asarray(bound, np.float64) for bound in world.bounds())
    away = (low + high) / 2.0 - np.asarray(world.instances[number].translation)
    length = math.sqrt(away[0] ** 2 + away[2] ** 2)
    step = STEP * world.diagonal()
    along = (away[0] / length, away[2] / length) if length > step else (1.0, 0.0)
    instance = world.authored[number]
    x, y, z = instance.translation
    return replace(
        instance,
        translation=(x + step * float(along[0]), y, z + step * float(along[1])),
        rotation=replace(instance.rotation, angle=instance.rotation.angle + TURN),
        version=instance.version + 1,
    )


def _light_before(light: Light, world: World) -> Light:
    """Return a light a step aside, or turned about the vertical if it is parallel (about x if it is vertical)."""
    step = (STEP * world.diagonal(), 0.0, 0.0)
    match light:
        case DirectionalLight():
            x, _, z = light.direction
            axis = (0.0, 1.0, 0.0) if x * x + z * z > 0.0 else (1.0, 0.0, 0.0)
            return replace(light, direction=_turned(light.direction, axis, LIGHT_TURN))
        case SpotLight() | PointLight():
            return replace(light, position=_sum(light.position, step))
        case RectangularLight():
            return replace(light, corner=_sum(light.corner, step))
        case _:
            assert_never(light)


def _camera_before(camera: Camera) -> Camera:
    """Return a camera that has yet to go round its target by a degree."""
    away = np.subtract(camera.eye, camera.target)
    _, down, _ = axes_of(-away, camera.up)
    turned = _turned(_vector(away), _vector(-down), -CAMERA_TURN)
    return replace(camera, eye=_sum(camera.target, turned))


def _turned(vector: Vector, axis: Vector, degrees: float) -> Vector:
    matrix = Rotation(axis, degrees).matrix()
    return _vector((matrix * np.asarray(vector)).sum(axis=1))


def _sum(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _vector(array: NDArray[np.float64]) -> Vector:
    return (float(array[0]), float(array[1]), float(array[2]))
