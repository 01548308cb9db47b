"""Small scenes, receivers and references for tests, with exact expectations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.receivers import Receivers
from shadowbench.scene import Camera, DirectionalLight, Instance, Light, Mesh, PointLight, Rotation, Scene, SpotLight
from shadowbench.world import World, place


def square(half: float, height: float = 0.0) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """A horizontal square of two triangles, facing up."""
    corners = [(-half, height, -half), (-half, height, half), (half, height, half), (half, height, -half)]
    return np.array(corners, np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> tuple[NDArray[Any], NDArray[Any]]:
    """A closed axis-aligned box of 12 triangles facing out."""
    corners = np.array([[(low, high)[(k >> a) & 1][a] for a in range(3)] for k in range(8)], np.float32)
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return corners, np.array(triangles, np.int32)


SUN = DirectionalLight((0.4, 1.0, 0.3))
SPOT = SpotLight((1.5, 4.0, 1.0), (-1.5, -4.0, -1.0), 70.0)
LAMP = PointLight((0.9, 1.4, 0.7))
LIGHTS: dict[str, Light] = {"sun": SUN, "spot": SPOT, "lamp": LAMP}


def box_over_ground(*, lift: float = 0.0, lights: dict[str, Light] | None = None) -> World:
    """A unit box over a ground, its lower side ``lift`` above it."""
    ground, on_ground = square(3.0)
    solid, of_solid = box((-0.5, lift, -0.5), (0.5, lift + 1.0, 0.5))
    return place(
        Scene(
            meshes=(Mesh("ground", ground, on_ground), Mesh("box", solid, of_solid)),
            instances=(Instance(0), Instance(1)),
            lights=lights or LIGHTS,
            cameras={"front": Camera((1.5, 2.5, 4.0), (0.0, 0.4, 0.0))},
        )
    )


def windows_over_ground() -> World:
    """Turned boxes, opaque and translucent, that share a mesh, over a ground."""
    ground, on_ground = square(3.0)
    solid, of_solid = box((-0.3, 0.0, -0.3), (0.3, 0.8, 0.3))
    colours = ((0.0, 0.0, 0.0), (0.2, 0.5, 0.8), (0.9, 0.4, 0.1))
    places = ((-1.0, -1.0, 10.0), (0.0, -0.6, 47.0), (0.8, 0.1, 101.0), (-0.5, 0.6, 200.0), (0.3, 1.0, 0.0))
    boxes = [
        Instance(1, (x, 0.05, z), rotation=Rotation(angle=angle), transmittance=colours[k % 3])
        for k, (x, z, angle) in enumerate(places)
    ]
    return place(
        Scene(
            meshes=(Mesh("ground", ground, on_ground), Mesh("box", solid, of_solid)),
            instances=(Instance(0), *boxes),
            lights=LIGHTS,
            cameras={"front": Camera((1.5, 2.5, 4.0), (0.0, 0.4, 0.0))},
        )
    )


def flat_receivers(width: int, height: int, *, extent: float = 1.0) -> Receivers:
    """One receiver per pixel on the plane y = 0, x to the right, z down, over ``±extent``."""
    count = width * height
    column, row = np.arange(count) % width, np.arange(count) // width
    position = np.zeros((count, 3), np.float32)
    position[:, 0] = ((column + 0.5) / width * 2.0 - 1.0) * extent
    position[:, 2] = ((row + 0.5) / height * 2.0 - 1.0) * extent
    up = np.tile(np.array([0.0, 1.0, 0.0], np.float32), (count, 1))
    return Receivers(
        width=width,
        height=height,
        eye=(0.0, 5.0, 0.0),
        pixel=np.arange(count, dtype=np.int32),
        layer=np.zeros(count, np.int32),
        weight=np.ones(count, np.float32),
        alpha=np.ones(count, np.float32),
        position=position,
        normal=up,
        instance=np.zeros(count, np.int32),
        triangle=np.zeros(count, np.int32),
        position_dx=np.tile(np.array([2.0 * extent / width, 0.0, 0.0], np.float32), (count, 1)),
        position_dy=np.tile(np.array([0.0, 0.0, 2.0 * extent / height], np.float32), (count, 1)),
        valid=np.ones(count, bool),
        first_of_pixel=np.arange(count + 1, dtype=np.int32),
    )


@dataclass
class StatedReference:
    """A reference that a test states instead of computing."""

    visibility: NDArray[np.float32]
    turned_away: NDArray[np.bool_]
    in_field: NDArray[np.bool_]
    blocker_distance: NDArray[np.float32]
    blocker: NDArray[np.int32]


def stated_reference(visibility: NDArray[Any], **changes: NDArray[Any]) -> Any:
    """A reference with everything turned to the light and, where shadowed, a blocker far away."""
    count = len(visibility)
    fields: dict[str, Any] = {
        "visibility": visibility.astype(np.float32),
        "turned_away": np.zeros(count, bool),
        "in_field": np.ones(count, bool),
        "blocker_distance": np.where(visibility.reshape(count, -1).min(axis=1) < 0.5, 1e3, np.inf).astype(np.float32),
        "blocker": np.where(visibility.reshape(count, -1).min(axis=1) < 0.5, 0, -1).astype(np.int32),
    }
    return StatedReference(**(fields | changes))
