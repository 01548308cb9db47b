"""A copse: rotated, scaled instances of one mesh on a plane, for whatever shares work between instances."""

from typing import Literal

import numpy as np

from shadowbench.parameters import ParameterModel, parameter
from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Mesh,
    PointLight,
    Rotation,
    Scene,
    ScenePlugin,
    SpotLight,
)

SPACING = 3.0


class Copse(ScenePlugin):
    """Instances of a tree, round about its axis but for its leaves, or of a bench, which is not."""

    name = "copse"
    title = "A copse on a plane"

    class Parameters(ParameterModel):
        instances: int = parameter(9, unit="instances", help="How many stand on the plane.", ge=1, le=4000)
        triangles: int = parameter(600, unit="triangles", help="Of the mesh, about.", ge=100, le=1_000_000)
        model: Literal["tree", "bench"] = parameter("tree", unit="1", help="What stands there.")
        angle: float | None = parameter(None, unit="degrees", help="Of every instance, instead of any.")
        transmittance: float = parameter(0.0, unit="1", help="Of every instance.", ge=0.0, le=1.0)
        seed: int = parameter(1, unit="1", help="Another seed is another copse.", ge=0)

    def make(self, parameters):
        rng = np.random.default_rng(parameters.seed)
        side = int(np.ceil(np.sqrt(parameters.instances)))
        half = SPACING * (side / 2.0 + 1.0)
        grid = SPACING * (np.arange(side * side)[: parameters.instances, None] // (side, 1) % side - (side - 1) / 2.0)
        places = grid + rng.uniform(-0.25, 0.25, grid.shape) * SPACING
        instances = [Instance(0, casts=False, albedo=(0.62, 0.58, 0.45))]
        for x, z in places:
            size = rng.uniform(0.8, 1.2)
            angle = rng.uniform(0.0, 360.0)
            if parameters.angle is not None:
                angle = parameters.angle
            instances.append(
                Instance(
                    1,
                    (float(x), 0.0, float(z)),
                    (size, size, size),
                    Rotation(angle=angle),
                    transmittance=(parameters.transmittance,) * 3,
                    albedo=(0.42, 0.55, 0.30),
                )
            )
        ground = np.array([(-half, 0, -half), (-half, 0, half), (half, 0, half), (half, 0, -half)], np.float32)
        model = {"tree": tree, "bench": bench}[parameters.model]
        return Scene(
            meshes=(
                Mesh("ground", ground, np.array([(0, 1, 2), (0, 2, 3)], np.int32)),
                Mesh(parameters.model, *model(parameters.triangles, rng)),
            ),
            instances=tuple(instances),
            lights={
                "sun": DirectionalLight((0.5, 0.8, 0.35)),
                "spot": SpotLight((0.9 * half, 1.6 * half, 0.5 * half), (-0.9, -1.6, -0.5), 60.0),
                "lamp": PointLight((0.3, 3.5, -0.4)),
            },
            cameras={
                "overview": Camera((0.3 * half, 0.75 * half, 1.5 * half), (0.0, 0.5, 0.0), vertical_angle=45.0),
                "eye level": Camera((0.4, 1.6, half - 1.0), (0.0, 1.4, 0.0), vertical_angle=55.0),
                "far": Camera((0.6 * half, 1.5 * half, 3.0 * half), (0.0, 0.5, 0.0), vertical_angle=45.0),
            },
        )


def tree(triangle_count, rng):
    """A trunk of 64 triangles, and leaves of two triangles each in an egg-shaped crown."""
    turn = np.arange(16) * (2.0 * np.pi / 16.0)
    ring = np.stack([0.12 * np.cos(turn), np.zeros(16), 0.12 * np.sin(turn)], axis=1)
    middle = ring * (0.8, 0.0, 0.8) + (0.0, 0.9, 0.0)
    top = ring * (0.4, 0.0, 0.4) + (0.0, 1.8, 0.0)
    trunk = [np.concatenate([ring, middle, top])]
    k = np.arange(16)
    triangles = []
    for low in (0, 16):
        a, b = low + k, low + (k + 1) % 16
        triangles += [np.stack([a, a + 16, b], axis=1), np.stack([b, a + 16, b + 16], axis=1)]
    leaf_count = max(1, (triangle_count - 64) // 2)
    direction = rng.normal(size=(leaf_count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    centre = direction * (rng.uniform(0.3, 1.0, (leaf_count, 1)) ** 0.5) * (0.85, 1.0, 0.85) + (0.0, 2.0, 0.0)
    along = rng.normal(size=(leaf_count, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, rng.normal(size=(leaf_count, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    size = np.sqrt(3.0 / leaf_count)
    corners = [centre + size * (s * along + 0.5 * t * across) for s, t in ((-1, 0), (0, -1), (1, 0), (0, 1))]
    first = 48 + 4 * np.arange(leaf_count)[:, None]
    triangles.append((first[:, :, None] + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3))
    vertices = np.concatenate([*trunk, np.stack(corners, axis=1).reshape(-1, 3)])
    return vertices.astype(np.float32), np.concatenate(triangles).astype(np.int32)


def bench(triangle_count, rng):
    """A seat and a back on two boxes, each face cut into as many squares as it takes."""
    boxes = [
        ((-1.0, 0.45, -0.25), (1.0, 0.55, 0.25)),
        ((-1.0, 0.55, 0.2), (1.0, 1.1, 0.28)),
        ((-0.9, 0.0, -0.2), (-0.75, 0.45, 0.2)),
        ((0.75, 0.0, -0.2), (0.9, 0.45, 0.2)),
    ]
    cells = max(1, round(np.sqrt(triangle_count / (12 * len(boxes)))))
    line = np.linspace(0.0, 1.0, cells + 1)
    v, u = np.meshgrid(line, line, indexing="ij")
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    square = np.concatenate(
        [
            np.stack([corner, corner + 1, corner + cells + 2], axis=1),
            np.stack([corner, corner + cells + 2, corner + cells + 1], axis=1),
        ]
    )
    vertices, triangles = [], []
    for low, high in np.array(boxes):
        for axis in range(3):
            for side in (0, 1):
                place = np.empty((u.size, 3))
                place[:, axis] = (low, high)[side][axis]
                for other, share in (((axis + 1) % 3, u), ((axis + 2) % 3, v)):
                    place[:, other] = low[other] + (high[other] - low[other]) * share.ravel()
                triangles.append(len(vertices) * u.size + square[:, :: 1 if side else -1])
                vertices.append(place)
    return np.concatenate(vertices).astype(np.float32), np.concatenate(triangles).astype(np.int32)
