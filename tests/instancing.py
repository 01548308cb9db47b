"""Worlds of instances and runs of ``instanced`` for its tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from builders import square
from numpy.typing import NDArray

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.light_space import camera_frame
from shadowbench.method import Changes, Trace, View
from shadowbench.methods.instanced import Instanced
from shadowbench.plugins import Registry
from shadowbench.receivers import Receivers
from shadowbench.scene import Camera, DirectionalLight, Instance, Light, Mesh, PointLight, Rotation, Scene, SpotLight
from shadowbench.world import World, place

COPSE_FILE = Path(__file__).parent / "plugins" / "copse.py"
COPSE = Registry((COPSE_FILE,)).scene("copse")

LIGHTS: dict[str, Light] = {
    "sun": DirectionalLight((0.4, 1.0, 0.3)),
    "overhead": DirectionalLight((0.0, 1.0, 0.0)),
    "spot": SpotLight((1.5, 5.0, 1.0), (-1.5, -5.0, -1.0), 80.0),
    "lamp": PointLight((0.9, 2.2, 0.7)),
}
CAMERA = Camera((1.5, 4.0, 7.0), (0.0, 0.4, 0.0), vertical_angle=45.0)


def copse(**values: Any) -> World:
    """The scene of ``plugins/copse.py``."""
    return place(COPSE().make(COPSE.Parameters(**values)))


def world_of_instances(
    mesh: Mesh | tuple[NDArray[Any], NDArray[Any]],
    instances: list[Instance],
    *,
    camera: Camera = CAMERA,
    ground: float = 4.0,
) -> World:
    """Instances of one mesh, number 1, over a ground that casts nothing."""
    if not isinstance(mesh, Mesh):
        mesh = Mesh("object", np.asarray(mesh[0], np.float32), mesh[1])
    return place(
        Scene(
            meshes=(Mesh("ground", *square(ground)), mesh),
            instances=(Instance(0, casts=False), *instances),
            lights=LIGHTS,
            cameras={"front": camera},
        )
    )


def turned(angle: float, *, x: float = 0.0, z: float = 0.0, size: float = 1.0, **more: Any) -> Instance:
    """An instance of mesh 1, turned about the vertical."""
    return Instance(1, (x, 0.0, z), (size, size, size), Rotation((0.0, 1.0, 0.0), angle), **more)


def seen(world: World, width: int = 160, height: int = 120, **more: Any) -> Receivers:
    """What the world's first camera sees."""
    return render(world, next(iter(world.cameras.values())), width, height, Context(threads=2), **more)


def view_of(world: World, receivers: Receivers) -> View:
    """The view through the world's first camera."""
    camera = next(iter(world.cameras.values()))
    size = receivers.width, receivers.height
    return View(camera, *size, camera_frame(camera, *size, world))


def made(*, threads: int = 1, **values: Any) -> Instanced:
    """The method with these parameters."""
    return Instanced(Instanced.Parameters(**values), Context(threads=threads))


def built(
    method: Instanced,
    world: World,
    receivers: Receivers,
    light: str = "sun",
    *,
    changed: tuple[bool, frozenset[int] | None, bool] = (True, None, True),
) -> Trace:
    """Build; what changed is everything if not given: the light, instances (``None`` for all), the view."""
    trace = Trace(method.context)
    every = frozenset(range(len(world.casters.instances)))
    changes = Changes(changed[0], every if changed[1] is None else changed[1], changed[2])
    method.build(world.casters, world.lights[light], view_of(world, receivers), changes, trace)
    return trace


def shaded(method: Instanced, receivers: Receivers, *, channels: int = 0) -> tuple[NDArray[np.float32], Trace]:
    """Shade and explain what was built."""
    trace = Trace(method.context)
    shape = (receivers.count, channels) if channels else (receivers.count,)
    visibility: Any = wp.full(shape, value=np.nan, dtype=wp.float32, device="cpu")
    method.shade(receivers, visibility, trace)
    method.explain(receivers, trace)
    return visibility.numpy(), trace


def result(
    world: World, receivers: Receivers, light: str = "sun", *, threads: int = 1, channels: int = 0, **values: Any
) -> tuple[NDArray[np.float32], Trace]:
    """Build and shade once; the trace of both."""
    method = made(threads=threads, **values)
    building = built(method, world, receivers, light)
    visibility, trace = shaded(method, receivers, channels=channels)
    trace.counters |= building.counters
    trace.kept |= building.kept
    return visibility, trace
