"""A scene placed for the kernels: one recentred, float32 world.

:class:`World` is what every later stage reads. Placing is done once a scene, in float64 without BLAS, so that the
float32 positions are the same bits on every machine; they *are* the geometry from then on: the camera pass, the ground
truth and every method see these numbers and no others. A scene far from the origin is recentred first, since float32
positions a million units away would leave nothing of the surface. How instances of meshes become triangles is told in
:mod:`shadowbench.placed_instances`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import SceneError
from shadowbench.placed_instances import (
    COPIED_TRIANGLES,
    DeviceTriangles,
    FlatTriangles,
    PlacedInstances,
    TriangleBlock,
    bounds_of,
    flattened,
    placed_vertices,
)
from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Light,
    PointLight,
    RectangularLight,
    Scene,
    SpotLight,
    Vector,
)

__all__ = ["Casters", "DeviceTriangles", "FlatTriangles", "TriangleBlock", "World", "bounds_of", "place"]

RECENTRE_RATIO = 4.0
"""A scene is recentred if its centre is farther from the origin than this many times its half extent."""

_LARGEST_COORDINATE = 1e30
"""Products of three coordinates must stay finite in float64."""

SMALLEST_SCALE, LARGEST_SCALE = 1e-15, 1e15
"""Limits of a placed world's largest coordinate. Far beyond them products of two leave float32's range, in which
tracers filter, and shadows would be wrong."""


@dataclass(frozen=True, eq=False)
class Casters(PlacedInstances):
    """What casts shadows: meshes and the casting instances of them; the rest comes from what this derives from.

    Attributes:
        world_triangle: int64, shape [instance_count]; add it to a caster triangle of instance ``i`` to get its number
            in the world (:attr:`Receivers.triangle`).
        world: The whole scene, for fitting light-space frames (:func:`shadowbench.light_space.light_frames`).
    """

    world_triangle: NDArray[np.int64]
    world: World

    @property
    def scale(self) -> float:
        """Largest absolute coordinate of the world, the ``S`` of the visibility predicate [scene units]."""
        return self.world.scale

    @property
    def is_opaque(self) -> bool:
        """Whether no caster lets light through."""
        return all(max(i.transmittance) == 0.0 for i in self.instances)

    @functools.cached_property
    def _bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        if self.kept_flat is not None:  # of casting vertices only, where a mesh has others
            return bounds_of(self.kept_flat.vertices)
        return super()._bounds


@dataclass(frozen=True, eq=False)
class World(PlacedInstances):
    """All triangles of a scene in world space, casters and receivers alike.

    Attributes:
        scale: Largest absolute coordinate [scene units].
        lights, cameras: Recentred; a light's numbers are rounded to float32, since rays are float32.
        notes: Warnings for the user.
    """

    scale: float
    lights: dict[str, Light]
    cameras: dict[str, Camera]
    notes: tuple[str, ...] = ()

    def diagonal(self) -> float:
        """Return the length of the bounding box's diagonal [scene units]."""
        low, high = self.bounds()
        return float(np.sqrt(((high.astype(np.float64) - low) ** 2).sum()))

    @functools.cached_property
    def casters(self) -> Casters:
        """The casting part of the world; shares its arrays where everything casts."""
        casting = [i for i, instance in enumerate(self.instances) if instance.casts]
        ranges = [(int(self.first_triangle[i]), int(self.first_triangle[i + 1])) for i in casting]
        counts = np.array([end - begin for begin, end in ranges], dtype=np.int64)
        first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        flat = self.kept_flat
        if flat is not None and len(casting) < len(self.instances):
            used, triangles = self._casting_part
            flat = FlatTriangles(flat.vertices[used], triangles)
        casters = Casters(
            meshes=self.meshes,
            instances=tuple(self.instances[i] for i in casting),
            authored=tuple(self.authored[i] for i in casting),
            first_triangle=first,
            origin=self.origin,
            instance_bounds=self.instance_bounds[casting],
            kept_flat=flat,
            world_triangle=np.array([begin for begin, _ in ranges], dtype=np.int64) - first[:-1],
            world=self,
        )
        casters.__dict__["pool"] = self.pool  # instances of one world share it
        return casters

    @functools.cached_property
    def _casting_part(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Numbers of the flat vertices that cast, and the casting triangles over them."""
        parts = [
            self.triangles[int(self.first_triangle[i]) : int(self.first_triangle[i + 1])]
            for i, instance in enumerate(self.instances)
            if instance.casts
        ]
        triangles = np.concatenate(parts) if parts else np.zeros((0, 3), np.int32)
        used = np.unique(triangles)
        return used, np.searchsorted(used, triangles).astype(np.int32)

    def moved(self, instances: Mapping[int, Instance]) -> World:
        """Return the world with some instances in other places, on the same origin.

        The result is what :func:`place` makes of the moved scene, if that gives it the same origin. Meshes, and
        everything else that does not change, are shared: the cost is that of placing the moved instances and, where
        flat arrays are kept, of one copy of all vertices.

        Args:
            instances: By number, as an author writes them: in the coordinates of :attr:`authored`, before recentring.

        Raises:
            SceneError: An instance that is not there or shows another mesh, or a coordinate that :func:`place` refuses.
        """
        authored, recentred = list(self.authored), list(self.instances)
        limits = self.instance_bounds.copy()
        vertices = None if self.kept_flat is None else self.kept_flat.vertices.copy()
        first_vertex = np.cumsum([0] + [len(self.meshes[i.mesh].vertices) for i in authored])
        for number, instance in instances.items():
            if not 0 <= number < len(authored):
                raise SceneError(f"there is no instance {number} to move, only {len(authored)}")
            if instance.mesh != authored[number].mesh:
                raise SceneError(f"instance {number} shows mesh {authored[number].mesh}, and moves to no other")
            _refuse_beyond_reason(*bounds_of(placed_vertices(self.meshes[instance.mesh], instance)))
            placed = placed_vertices(self.meshes[instance.mesh], instance, self.origin)
            authored[number], recentred[number] = instance, _recentred(instance, np.array(self.origin))
            limits[number] = bounds_of(placed)
            if vertices is not None:
                vertices[first_vertex[number] : first_vertex[number + 1]] = placed
        kept = None if vertices is None else FlatTriangles(vertices, self.triangles)
        world = replace(
            self,
            instances=tuple(recentred),
            authored=tuple(authored),
            instance_bounds=limits,
            kept_flat=kept,
            scale=_scale_of(limits),
        )
        shared: dict[str, Any] = {"pool": self.pool}
        if kept is not None and [i.casts for i in recentred] == [i.casts for i in self.instances]:
            shared["_casting_part"] = self._casting_part
        world.__dict__.update(shared)
        return world


def place(scene: Scene, *, copied_triangles: int = COPIED_TRIANGLES) -> World:
    """Place a scene: instances to world space, recentred, rounded to float32.

    Args:
        scene: What its author wrote.
        copied_triangles: How many triangles flat arrays may hold beyond those of the meshes, to be kept.

    Raises:
        SceneError: A placed coordinate is not finite or too large, or the scene as a whole too large or too small.
    """
    exact = np.array([bounds_of(placed_vertices(scene.meshes[i.mesh], i)) for i in scene.instances])
    low, high = exact[:, 0].min(axis=0), exact[:, 1].max(axis=0)
    _refuse_beyond_reason(low, high)
    origin = _recentring_origin((low + high) / 2.0, float((high - low).max()) / 2.0)
    # subtracting and rounding keep the order of coordinates, so that bounds of vertices become bounds of vertices
    limits = (exact - origin).astype(np.float32)
    at = _vector(origin)
    own = sum(scene.meshes[k].triangle_count for k in {i.mesh for i in scene.instances})
    is_flat = scene.triangle_count - own <= copied_triangles
    counts = [scene.meshes[i.mesh].triangle_count for i in scene.instances]
    return World(
        meshes=scene.meshes,
        instances=tuple(_recentred(i, origin) for i in scene.instances),
        authored=scene.instances,
        first_triangle=np.cumsum([0, *counts]).astype(np.int64),
        origin=at,
        instance_bounds=limits,
        kept_flat=flattened(scene.meshes, scene.instances, at) if is_flat else None,
        scale=_scale_of(limits),
        lights={name: _place_light(light, origin) for name, light in scene.lights.items()},
        cameras={
            name: replace(c, eye=_shifted(c.eye, origin), target=_shifted(c.target, origin))
            for name, c in scene.cameras.items()
        },
        notes=scene.notes,
    )


def _refuse_beyond_reason(low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
    if not (np.isfinite(low).all() and np.isfinite(high).all() and max(-low.min(), high.max()) < _LARGEST_COORDINATE):
        raise SceneError(f"the scene's coordinates reach beyond ±{_LARGEST_COORDINATE:g}")


def _scale_of(limits: NDArray[np.float32]) -> float:
    scale = float(np.abs(limits).max()) or 1.0
    if not SMALLEST_SCALE <= scale <= LARGEST_SCALE:
        raise SceneError(
            f"the scene's largest coordinate is {scale:.3g}, but must lie between {SMALLEST_SCALE:g} and "
            f"{LARGEST_SCALE:g}: scale it"
        )
    return scale


def _recentring_origin(centre: NDArray[np.float64], half: float) -> NDArray[np.float64]:
    """Return what to subtract: nothing, or the centre to within the scene's own size (so small scenes count too)."""
    farthest = float(np.abs(centre).max())
    if farthest <= RECENTRE_RATIO * half:
        return np.zeros(3)
    step = 2.0 ** (math.frexp(max(half, float(np.spacing(farthest))))[1] - 1)
    return np.round(centre / step) * step


def _recentred(instance: Instance, origin: NDArray[np.float64]) -> Instance:
    return replace(instance, translation=_shifted(instance.translation, origin))


def _vector(numbers: NDArray[np.float64]) -> Vector:
    return (float(numbers[0]), float(numbers[1]), float(numbers[2]))


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
