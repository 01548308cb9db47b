"""Meshes, worlds and receivers on them for the tests of rays and ground truth, made without a camera pass."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.receivers import Receivers
from shadowbench.scene import Camera, DirectionalLight, Instance, Light, Mesh, PointLight, Scene, SpotLight
from shadowbench.world import World, place

Floats = NDArray[np.floating[Any]]
Ints = NDArray[np.integer[Any]]


def homogeneous(light: Light) -> tuple[float, float, float, float]:
    """A light as (position, 1) or (direction towards it, 0)."""
    if isinstance(light, DirectionalLight):
        return (*light.direction, 0.0)
    assert isinstance(light, SpotLight | PointLight)
    return (*light.position, 1.0)


def world_of(
    *meshes: tuple[Floats, Ints], lights: dict[str, Light], casts: tuple[bool, ...] = (), **instance: Any
) -> World:
    """A placed world with one instance a mesh, all placed as modelled."""
    return place(
        Scene(
            meshes=tuple(Mesh(f"mesh {k}", v, f.astype(np.int32)) for k, (v, f) in enumerate(meshes)),
            instances=tuple(Instance(k, casts=casts[k] if casts else True, **instance) for k in range(len(meshes))),
            lights=lights,
            cameras={"front": Camera((0.3, 3.0, 4.0), (0.0, 0.0, 0.0))},
        )
    )


def corners_of(world: World) -> NDArray[np.float32]:
    """World-space corners of all triangles, shape [triangle_count, 3, 3]."""
    return world.vertices[world.triangles]


def receivers_at(
    world: World, triangle: Ints, barycentric: Floats, eye: tuple[float, float, float] = (0.3, 3.0, 4.0)
) -> Receivers:
    """Receivers on triangles of a world, as a camera pass would store them: interpolated, rounded to float32.

    Args:
        world: The placed scene.
        triangle: World triangles, shape [n].
        barycentric: Shape [n, 3].
        eye: Normals are turned towards it.
    """
    corners = corners_of(world)[triangle].astype(np.float64)
    position = (barycentric[:, :, None] * corners).sum(axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= np.where((normal * (np.asarray(eye) - position)).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    count = len(triangle)
    return Receivers(
        width=count,
        height=1,
        eye=eye,
        pixel=np.arange(count, dtype=np.int32),
        layer=np.zeros(count, np.int32),
        weight=np.ones(count, np.float32),
        alpha=np.ones(count, np.float32),
        position=position.astype(np.float32),
        normal=normal.astype(np.float32),
        instance=world.instance_of(triangle),
        triangle=triangle.astype(np.int32),
        position_dx=np.zeros((count, 3), np.float32),
        position_dy=np.zeros((count, 3), np.float32),
        valid=np.ones(count, bool),
        first_of_pixel=np.arange(count + 1, dtype=np.int32),
    )


def scattered_receivers(world: World, count: int, rng: np.random.Generator, *, on_edges: float = 0.0) -> Receivers:
    """Receivers on triangles drawn by area; a share of them exactly on edges, and half of those on vertices."""
    corners = corners_of(world).astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    triangle = rng.choice(len(corners), count, p=area / area.sum())
    barycentric = rng.dirichlet((1.0, 1.0, 1.0), count)
    special = np.flatnonzero(rng.random(count) < on_edges)
    on_vertex = special[: len(special) // 2]
    share = rng.integers(0, 17, len(special)) / 16.0
    share[: len(on_vertex)] = 0.0
    start = rng.integers(0, 3, len(special))
    barycentric[special] = 0.0
    barycentric[special, start] = 1.0 - share
    barycentric[special, (start + 1) % 3] += share
    return receivers_at(world, triangle, barycentric)


def soup(count: int, rng: np.random.Generator, *, area: float = 4.0) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Randomly placed and turned equilateral triangles of a total area, over a ground of two triangles."""
    centre = rng.uniform((-1.0, 0.05, -1.0), (1.0, 1.0, 1.0), (count, 3))
    first = rng.normal(size=(count, 3))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(first, rng.normal(size=(count, 3)))
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    radius = np.sqrt(area / count * 4.0 / (3.0 * np.sqrt(3.0)))
    angle = np.array([0.0, 2.0, 4.0]) * np.pi / 3.0
    around = np.cos(angle)[None, :, None] * first[:, None] + np.sin(angle)[None, :, None] * second[:, None]
    ground = [(-2.0, 0.0, -2.0), (-2.0, 0.0, 2.0), (2.0, 0.0, 2.0), (2.0, 0.0, -2.0)]
    vertices = np.concatenate([(centre[:, None] + radius * around).reshape(-1, 3), ground])
    triangles = np.arange(3 * count).reshape(-1, 3)
    triangles = np.concatenate([triangles, 3 * count + np.array([[0, 1, 2], [0, 2, 3]])])
    return vertices.astype(np.float32), triangles.astype(np.int32)


def sphere(subdivisions: int, centre: Floats, radius: float) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """A subdivided icosahedron with its vertices on the sphere."""
    g = (1.0 + np.sqrt(5.0)) / 2.0
    vertices = [(s * a, t * b, 0.0) for a, b in ((1.0, g),) for s in (-1, 1) for t in (-1, 1)]
    points = np.array([np.roll(v, k) for k in range(3) for v in vertices])
    edge = 2.0
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    near = np.abs(distance - edge) < 1e-6
    faces = np.array(
        [(i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]]
    )
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    for _ in range(subdivisions):
        ends = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
        edges, inverse = np.unique(ends, axis=0, return_inverse=True)
        middle = len(points) + inverse.reshape(-1, 3)
        new = points[edges].sum(axis=1)
        points = np.concatenate([points, new / np.linalg.norm(new, axis=1, keepdims=True)])
        a, b, c = faces.T
        ab, bc, ca = middle.T
        faces = np.concatenate([np.stack(x, axis=1) for x in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
    return (centre + radius * points).astype(np.float32), faces.astype(np.int32)


def grid(cells: int, half: float) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """A square in the plane y = 0, cut into ``cells x cells`` squares of two triangles."""
    line = np.linspace(-half, half, cells + 1)
    z, x = np.meshgrid(line, line, indexing="ij")
    vertices = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    below = corner + cells + 1
    triangles = np.concatenate(
        [np.stack([corner, below, below + 1], axis=1), np.stack([corner, below + 1, corner + 1], axis=1)]
    )
    return vertices, triangles.astype(np.int32)
