"""What the tests of scenes ask of placed triangles, from the world's arrays alone."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.light_space import light_frames
from shadowbench.reference import hard_reference
from shadowbench.scene import PointLight, Scene, ScenePlugin, SpotLight
from shadowbench.world import World


def made(cls: type[ScenePlugin], **values: object) -> Scene:
    return cls().make(cls.Parameters(**values))


def digest(scene: Scene) -> str:
    """One number for everything that reaches vertices."""
    parts = [m.vertices.tobytes() + m.triangles.tobytes() for m in scene.meshes]
    parts += [repr((i.mesh, i.translation, i.scale, i.rotation)).encode() for i in scene.instances]
    return hashlib.sha256(b"".join(parts)).hexdigest()


def corners_of(world: World, *names: str) -> NDArray[np.float64]:
    """World-space corners of the triangles of all instances of the meshes called so, shape [n, 3, 3]."""
    chosen = [i for i, instance in enumerate(world.instances) if world.meshes[instance.mesh].name in names]
    assert chosen, f"no mesh is called {names}; there are {sorted({m.name for m in world.meshes})}"
    runs = [world.triangles[world.first_triangle[i] : world.first_triangle[i + 1]] for i in chosen]
    return world.vertices[np.concatenate(runs)].astype(np.float64)


def lowest(world: World) -> dict[str, list[float]]:
    """The lowest height of each instance, by its mesh's name."""
    found: dict[str, list[float]] = {}
    for i, instance in enumerate(world.instances):
        run = world.triangles[world.first_triangle[i] : world.first_triangle[i + 1]]
        found.setdefault(world.meshes[instance.mesh].name, []).append(float(world.vertices[run][..., 1].min()))
    return found


def overlaps_in_plan(world: World, names: Iterable[str], disks: Iterable[tuple[float, float, float]]) -> list[str]:
    """Which of the named instances' rectangles round them and of the disks (x, z, radius), seen from above, overlap."""
    found: list[tuple[str, NDArray[np.float64], NDArray[np.float64]]] = []
    for i, instance in enumerate(world.instances):
        if (name := world.meshes[instance.mesh].name) in set(names):
            run = world.vertices[world.triangles[world.first_triangle[i] : world.first_triangle[i + 1]]]
            plan = run.reshape(-1, 3)[:, [0, 2]].astype(np.float64)
            found.append((name, plan.min(axis=0), plan.max(axis=0)))
    found += [(f"disk {x}, {z}", np.array([x - r, z - r]), np.array([x + r, z + r])) for x, z, r in disks]
    return [
        f"{a} and {b}"
        for (a, low, high), (b, low_b, high_b) in combinations(found, 2)
        if (np.minimum(high, high_b) - np.maximum(low, low_b) > 1e-4).all()
    ]


def areas(corners: NDArray[Any]) -> NDArray[np.float64]:
    """Areas of triangles [n, 3, 3]."""
    a, b, c = np.moveaxis(np.asarray(corners, np.float64), 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def smallest_area(world: World) -> float:
    return float(areas(world.vertices[world.triangles]).min())


def shares_seen(world: World, camera: str, width: int = 96, height: int = 72) -> tuple[float, float, float]:
    """What a picture holds under the default light: the shares of covered pixels, and of lit and shadowed receivers."""
    context = Context(threads=2)
    receivers = render(world, world.cameras[camera], width, height, context)
    light = next(iter(world.lights.values()))
    scored = hard_reference(world, receivers, light, context)
    lit = float(scored.visibility.mean())
    return receivers.count / (width * height), lit, 1.0 - lit


def assert_lights_are_usable(world: World) -> None:
    """Named alike, from above, free of all geometry, and the spot's cone holds most of the world's middle."""
    assert list(world.lights) == ["sun", "spot", "lamp"]
    sun, spot, lamp = world.lights.values()
    assert sun.direction[1] > 0.3  # type: ignore[union-attr]
    assert isinstance(spot, SpotLight)
    assert isinstance(lamp, PointLight)
    assert spot.direction[1] < -0.3
    low, high = world.bounds()
    assert spot.position[1] > high[1], "the spot shines from above everything"
    assert (low < lamp.position).all()
    assert (lamp.position < high).all()
    for light in (spot, lamp):
        distance = np.linalg.norm(world.vertices - np.array(light.position), axis=1).min()
        assert distance > 0.005 * world.diagonal()
    (frame,) = light_frames(spot, world)
    assert frame.contains(world.vertices).mean() > 0.7
