"""A scene placed for the kernels: one recentred, float32 world.

:class:`World` is what every later stage reads. Placing is done once a scene, in float64 without BLAS, so that the
float32 positions are the same bits on every machine; they *are* the geometry from then on: the camera pass, the ground
truth and every method see these numbers and no others. A scene far from the origin is recentred first, since float32
positions a million units away would leave nothing of the surface.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import SceneError
from shadowbench.per_device import once_per_device
from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Light,
    Mesh,
    PointLight,
    RectangularLight,
    Scene,
    SpotLight,
    Vector,
)

if TYPE_CHECKING:
    import warp as wp

RECENTRE_RATIO = 4.0
"""A scene is recentred if its centre is farther from the origin than this many times its half extent."""

_LARGEST_COORDINATE = 1e30
"""Products of three coordinates must stay finite in float64."""

SMALLEST_SCALE, LARGEST_SCALE = 1e-15, 1e15
"""Limits of a placed world's largest coordinate. Far beyond them products of two leave float32's range, in which
tracers filter, and shadows would be wrong."""


def bounds_of(points: NDArray[np.floating]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the lowest and highest coordinates of points [n, 3], shape [3] each; n is at least 1."""
    # a column at a time: NumPy's reduction along the long axis of a narrow array is ten times slower
    columns = [points[:, axis] for axis in range(3)]
    return np.array([c.min() for c in columns]), np.array([c.max() for c in columns])


@dataclass(frozen=True, eq=False)
class TriangleBlock:
    """A run of triangles of one instance, in world space.

    Attributes:
        instance: Index into :attr:`Casters.instances`.
        first_triangle: Number of the first one within its mesh.
        corners: float32, shape [triangle_count, 3, 3].
    """

    instance: int
    first_triangle: int
    corners: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Casters:
    """What casts shadows: meshes, their instances, and the same triangles in world space.

    Attributes:
        meshes: All meshes of the scene, by the index instances use.
        instances: The casting instances.
        vertices: World positions, float32, shape [vertex_count, 3].
        triangles: Vertex indices, int32, shape [triangle_count, 3]; instance by instance, in mesh order.
        first_triangle: int64, shape [instance_count + 1]; instance ``i`` owns triangles
            ``first_triangle[i] .. first_triangle[i + 1]``.
        world_triangle: int64, shape [instance_count]; add it to a caster triangle of instance ``i`` to get its number
            in the world (:attr:`Receivers.triangle`).
        world: The whole scene, for fitting light-space frames (:func:`shadowbench.light_space.light_frames`).
    """

    meshes: tuple[Mesh, ...]
    instances: tuple[Instance, ...]
    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]
    first_triangle: NDArray[np.int64]
    world_triangle: NDArray[np.int64]
    world: World

    @property
    def triangle_count(self) -> int:
        return len(self.triangles)

    @property
    def scale(self) -> float:
        """Largest absolute coordinate of the world, the ``S`` of the visibility predicate [scene units]."""
        return self.world.scale

    @property
    def is_opaque(self) -> bool:
        """Whether no caster lets light through."""
        return all(max(i.transmittance) == 0.0 for i in self.instances)

    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the lowest and highest coordinates over all casting vertices, shape [3] each."""
        return bounds_of(self.vertices)

    def blocks(self, size: int = 1 << 18) -> Iterator[TriangleBlock]:
        """Stream the triangles, at most ``size`` at a time, a block never crossing instances."""
        for instance in range(len(self.instances)):
            begin, end = int(self.first_triangle[instance]), int(self.first_triangle[instance + 1])
            for first in range(begin, end, size):
                corners = self.vertices[self.triangles[first : min(first + size, end)]]
                yield TriangleBlock(instance, first - begin, corners)

    def on(self, device: str) -> DeviceTriangles:
        """Return the flattened triangles as Warp arrays (zero-copy on the CPU)."""
        return _device_triangles(self, device)


@dataclass(frozen=True, eq=False)
class DeviceTriangles:
    """World-space triangles on a device.

    Attributes:
        vertices: wp.vec3, shape [vertex_count].
        triangles: int32, shape [3 * triangle_count].
    """

    vertices: wp.array[Any]
    triangles: wp.array[Any]

    @property
    def triangle_count(self) -> int:
        return self.triangles.shape[0] // 3


@once_per_device
def _device_triangles(owner: Casters | World, device: str) -> DeviceTriangles:
    import warp as wp  # lazily: authoring and listing scenes needs no Warp

    from shadowbench.device.arrays import as_warp

    return DeviceTriangles(
        as_warp(owner.vertices, wp.vec3, device), as_warp(owner.triangles.reshape(-1), wp.int32, device)
    )


@dataclass(frozen=True, eq=False)
class World:
    """All triangles of a scene in world space, casters and receivers alike.

    Attributes:
        meshes, instances: As authored, instances recentred.
        vertices: float32, shape [vertex_count, 3].
        triangles: int32, shape [triangle_count, 3].
        first_triangle: int64, shape [instance_count + 1].
        origin: What was subtracted from every position [scene units].
        scale: Largest absolute coordinate [scene units].
        lights, cameras: Recentred; a light's numbers are rounded to float32, since rays are float32.
        notes: Warnings for the user.
    """

    meshes: tuple[Mesh, ...]
    instances: tuple[Instance, ...]
    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]
    first_triangle: NDArray[np.int64]
    origin: Vector
    scale: float
    lights: dict[str, Light]
    cameras: dict[str, Camera]
    notes: tuple[str, ...] = ()

    @property
    def triangle_count(self) -> int:
        return len(self.triangles)

    def on(self, device: str) -> DeviceTriangles:
        """Return all triangles as Warp arrays (zero-copy on the CPU)."""
        return _device_triangles(self, device)

    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the lowest and highest coordinates, shape [3] each."""
        return self._bounds

    @functools.cached_property
    def _bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        return bounds_of(self.vertices)

    def diagonal(self) -> float:
        """Return the length of the bounding box's diagonal [scene units]."""
        low, high = self.bounds()
        return float(np.sqrt(((high.astype(np.float64) - low) ** 2).sum()))

    def instance_of(self, triangles: NDArray[np.integer]) -> NDArray[np.int32]:
        """Return the instance that owns each world triangle."""
        return (np.searchsorted(self.first_triangle, triangles, side="right") - 1).astype(np.int32)

    def moved(self, instances: Mapping[int, Instance]) -> World:
        """Return the world with some instances elsewhere; the origin stays, and all that is unchanged is shared.

        Args:
            instances: By number, placed relative to :attr:`origin` as those of this world are.
        """
        moved, vertices, at = list(self.instances), self.vertices.copy(), 0
        origin = np.asarray(self.origin)
        for number, instance in enumerate(self.instances):
            mesh = self.meshes[instance.mesh]
            if number in instances:
                moved[number] = instances[number]
                authored = replace(moved[number], translation=_shifted(moved[number].translation, -origin))
                vertices[at : at + len(mesh.vertices)] = _place_instance(mesh, authored) - origin
            at += len(mesh.vertices)
        return replace(self, instances=tuple(moved), vertices=vertices, scale=float(np.abs(vertices).max()))

    @functools.cached_property
    def casters(self) -> Casters:
        """The casting part of the world; shares its arrays where everything casts."""
        casting = [i for i, instance in enumerate(self.instances) if instance.casts]
        ranges = [(int(self.first_triangle[i]), int(self.first_triangle[i + 1])) for i in casting]
        counts = np.array([end - begin for begin, end in ranges], dtype=np.int64)
        first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        triangles = self.triangles
        if len(casting) < len(self.instances):
            parts = [self.triangles[begin:end] for begin, end in ranges]
            triangles = np.concatenate(parts) if parts else np.zeros((0, 3), np.int32)
        used = np.unique(triangles) if len(casting) < len(self.instances) else None
        vertices = self.vertices
        if used is not None:
            vertices = self.vertices[used]
            triangles = np.searchsorted(used, triangles).astype(np.int32)
        return Casters(
            meshes=self.meshes,
            instances=tuple(self.instances[i] for i in casting),
            vertices=vertices,
            triangles=triangles,
            first_triangle=first,
            world_triangle=np.array([begin for begin, _ in ranges], dtype=np.int64) - first[:-1],
            world=self,
        )


def place(scene: Scene) -> World:
    """Place a scene: instances to world space, recentred, rounded to float32.

    Raises:
        SceneError: A placed coordinate is not finite or too large, or the scene as a whole too large or too small.
    """
    placed = [_place_instance(scene.meshes[i.mesh], i) for i in scene.instances]
    low = np.min([bounds_of(p)[0] for p in placed], axis=0)
    high = np.max([bounds_of(p)[1] for p in placed], axis=0)
    if not (np.isfinite(low).all() and np.isfinite(high).all() and max(-low.min(), high.max()) < _LARGEST_COORDINATE):
        raise SceneError(f"the scene's coordinates reach beyond ±{_LARGEST_COORDINATE:g}")
    origin = _recentring_origin((low + high) / 2.0, float((high - low).max()) / 2.0)

    vertices = np.concatenate([(p - origin).astype(np.float32) for p in placed])
    scale = float(np.abs(vertices).max()) or 1.0
    if not SMALLEST_SCALE <= scale <= LARGEST_SCALE:
        raise SceneError(
            f"the scene's largest coordinate is {scale:.3g}, but must lie between {SMALLEST_SCALE:g} and "
            f"{LARGEST_SCALE:g}: scale it"
        )
    first_vertex = np.cumsum([0] + [len(p) for p in placed])
    triangles = np.concatenate(
        [scene.meshes[i.mesh].triangles + np.int32(first_vertex[k]) for k, i in enumerate(scene.instances)]
    )
    counts = [scene.meshes[i.mesh].triangle_count for i in scene.instances]
    return World(
        meshes=scene.meshes,
        instances=tuple(replace(i, translation=_shifted(i.translation, origin)) for i in scene.instances),
        vertices=vertices,
        triangles=triangles.astype(np.int32),
        first_triangle=np.cumsum([0, *counts]).astype(np.int64),
        origin=(float(origin[0]), float(origin[1]), float(origin[2])),
        scale=scale,
        lights={name: _place_light(light, origin) for name, light in scene.lights.items()},
        cameras={
            name: replace(c, eye=_shifted(c.eye, origin), target=_shifted(c.target, origin))
            for name, c in scene.cameras.items()
        },
        notes=scene.notes,
    )


def _recentring_origin(centre: NDArray[np.float64], half: float) -> NDArray[np.float64]:
    """Return what to subtract: nothing, or the centre to within the scene's own size (so small scenes count too)."""
    farthest = float(np.abs(centre).max())
    if farthest <= RECENTRE_RATIO * half:
        return np.zeros(3)
    step = 2.0 ** (math.frexp(max(half, float(np.spacing(farthest))))[1] - 1)
    return np.round(centre / step) * step


def _place_instance(mesh: Mesh, instance: Instance) -> NDArray[np.float64]:
    vertices = mesh.vertices.astype(np.float64)
    if instance.is_placed_as_modelled:
        return vertices
    m = instance.matrix()
    x, y, z = vertices[:, 0], vertices[:, 1], vertices[:, 2]
    # written out: a matrix product would go through BLAS, whose summation order differs between machines
    with np.errstate(over="ignore", invalid="ignore"):  # place() refuses what is not finite
        return np.stack([m[r, 0] * x + m[r, 1] * y + m[r, 2] * z + m[r, 3] for r in range(3)], axis=1)


def _shifted(point: Vector, origin: NDArray[np.float64]) -> Vector:
    x, y, z = (float(p - o) for p, o in zip(point, origin, strict=True))
    return (x, y, z)


def _rounded(vector: Vector) -> Vector:
    x, y, z = (float(np.float32(c)) for c in vector)
    return (x, y, z)


def _unit(vector: Vector) -> Vector:
    length = float(np.sqrt(sum(c * c for c in vector)))
    return (vector[0] / length, vector[1] / length, vector[2] / length)


def _place_light(light: Light, origin: NDArray[np.float64]) -> Light:
    match light:
        case DirectionalLight():
            return replace(light, direction=_rounded(_unit(light.direction)))
        case SpotLight():
            position = _rounded(_shifted(light.position, origin))
            return replace(light, position=position, direction=_rounded(_unit(light.direction)))
        case PointLight():
            return replace(light, position=_rounded(_shifted(light.position, origin)))
        case RectangularLight():
            corner = _rounded(_shifted(light.corner, origin))
            return replace(light, corner=corner, edge_u=_rounded(light.edge_u), edge_v=_rounded(light.edge_v))
