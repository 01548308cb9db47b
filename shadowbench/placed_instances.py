"""Meshes placed by instances: world-space triangles, streamed in batches, looked up, or flat.

A scene may hold one mesh a thousand times; its world-space copy need not exist. :class:`PlacedInstances` keeps meshes
and instances, and whoever wants triangles streams them through one scratch buffer (:meth:`PlacedInstances.batches`),
looks up those of a few receivers (:meth:`PlacedInstances.lookup`), or asks for the flat copy and pays for it
(:meth:`PlacedInstances.flat`). All three give the same float32 positions, bit for bit: those of
:func:`placed_vertices`, in float64 and without BLAS, so that they are the same on every machine.

Where little would be copied (:data:`COPIED_TRIANGLES`), the flat arrays are made once, when the scene is placed, and
batches and look-ups read them: a scene of meshes that are used once each pays nothing for all this.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.per_device import once_per_device
from shadowbench.scene import Instance, Mesh, Vector

if TYPE_CHECKING:
    import warp as wp

    from shadowbench.device.launch import Context
    from shadowbench.device.placed_triangles import PlacedTriangles, TriangleBatch

COPIED_TRIANGLES = 1 << 18
"""Flat arrays are kept if they hold at most so many triangles more than the meshes do: 3 MiB of indices, and a few
times that of vertices. Reading them is simpler than placing meshes anew, and no large scene is affected."""


def bounds_of(points: NDArray[np.floating]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the lowest and highest coordinates of points [n, 3], shape [3] each; n is at least 1."""
    # a column at a time: NumPy's reduction along the long axis of a narrow array is ten times slower
    columns = [points[:, axis] for axis in range(3)]
    return np.array([c.min() for c in columns]), np.array([c.max() for c in columns])


def placed_vertices(mesh: Mesh, authored: Instance, origin: Vector | None = None) -> NDArray[Any]:
    """Return a mesh's vertices in world space: float64, or less the world's origin, rounded to float32.

    Args:
        mesh: The mesh.
        authored: The instance as its author wrote it, before recentring.
        origin: What is subtracted from every position; ``None`` to leave positions as they are, in float64.
    """
    vertices = mesh.vertices.astype(np.float64)
    if not authored.is_placed_as_modelled:
        m = authored.matrix()
        x, y, z = vertices[:, 0], vertices[:, 1], vertices[:, 2]
        # written out: a matrix product would go through BLAS, whose summation order differs between machines
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused by place()
            vertices = np.stack([m[r, 0] * x + m[r, 1] * y + m[r, 2] * z + m[r, 3] for r in range(3)], axis=1)
    return vertices if origin is None else (vertices - np.array(origin)).astype(np.float32)


@dataclass(frozen=True, eq=False)
class TriangleBlock:
    """A run of triangles of one instance, in world space.

    Attributes:
        instance: Index into :attr:`PlacedInstances.instances`.
        first_triangle: Number of the first one within its mesh.
        corners: float32, shape [triangle_count, 3, 3].
    """

    instance: int
    first_triangle: int
    corners: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class FlatTriangles:
    """World-space triangles, every instance's apart.

    Attributes:
        vertices: float32, shape [vertex_count, 3].
        triangles: Vertex indices, int32, shape [triangle_count, 3]; instance by instance, in mesh order.
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]

    @property
    def byte_count(self) -> int:
        return self.vertices.nbytes + self.triangles.nbytes


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


@dataclass(frozen=True, eq=False)
class MeshPool:
    """The meshes that are used, one after the other, each once.

    Attributes:
        vertices: In the meshes' own spaces, float64, shape [vertex_count, 3].
        triangles: Vertex indices, counted from the mesh's own first vertex, int32, shape [triangle_count, 3].
        first_vertex, first_triangle: Of each mesh of the scene, int64, shape [mesh_count + 1].
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int32]
    first_vertex: NDArray[np.int64]
    first_triangle: NDArray[np.int64]


def pool_of(meshes: Sequence[Mesh], used: set[int]) -> MeshPool:
    """Put those meshes together whose numbers are in ``used``."""
    kept = [mesh for k, mesh in enumerate(meshes) if k in used]
    counts = [(len(mesh.vertices), mesh.triangle_count) if k in used else (0, 0) for k, mesh in enumerate(meshes)]
    first = np.concatenate([np.zeros((1, 2), np.int64), np.cumsum(np.array(counts, np.int64), axis=0)])
    return MeshPool(
        np.concatenate([mesh.vertices.astype(np.float64) for mesh in kept] or [np.zeros((0, 3))]),
        np.concatenate([mesh.triangles for mesh in kept] or [np.zeros((0, 3), np.int32)]),
        np.ascontiguousarray(first[:, 0]),
        np.ascontiguousarray(first[:, 1]),
    )


@dataclass(frozen=True, eq=False)
class PlacedInstances:
    """Instances of meshes in world space.

    Attributes:
        meshes: All meshes of the scene, by the index instances use.
        instances: As their author wrote them, but recentred.
        authored: As their author wrote them; positions are computed from these.
        first_triangle: int64, shape [instance_count + 1]; instance ``i`` owns triangles
            ``first_triangle[i] .. first_triangle[i + 1]``.
        origin: What was subtracted from every position [scene units].
        instance_bounds: Lowest and highest coordinates of each instance's vertices, float32, shape
            [instance_count, 2, 3].
        kept_flat: The flat arrays, where they are kept.
    """

    meshes: tuple[Mesh, ...]
    instances: tuple[Instance, ...]
    authored: tuple[Instance, ...]
    first_triangle: NDArray[np.int64]
    origin: Vector
    instance_bounds: NDArray[np.float32]
    kept_flat: FlatTriangles | None

    @property
    def triangle_count(self) -> int:
        """Triangles over all instances."""
        return int(self.first_triangle[-1])

    @property
    def is_flat(self) -> bool:
        """Whether the flat arrays are there anyway; if not, :meth:`flat` makes a copy of every mesh an instance."""
        return self.kept_flat is not None

    def flat(self) -> FlatTriangles:
        """Return the flat arrays, made at the first call and kept: 12 bytes a triangle and 12 a vertex, an instance."""
        return self.kept_flat or self._flattened

    @functools.cached_property
    def _flattened(self) -> FlatTriangles:
        return flattened(self.meshes, self.authored, self.origin)

    @property
    def vertices(self) -> NDArray[np.float32]:
        """World positions of :meth:`flat`, float32, shape [vertex_count, 3]."""
        return self.flat().vertices

    @property
    def triangles(self) -> NDArray[np.int32]:
        """Vertex indices of :meth:`flat`, int32, shape [triangle_count, 3]; instance by instance, in mesh order."""
        return self.flat().triangles

    def on(self, device: str) -> DeviceTriangles:
        """Return :meth:`flat` as Warp arrays (zero-copy on the CPU)."""
        return _on_device(self.flat(), device)

    def batches(self, context: Context) -> Iterator[TriangleBatch]:
        """Stream the world-space triangles as Warp arrays, all of them once, in the order of their numbers.

        Flat arrays come as one batch. Otherwise instances are placed on the device, as many at a time as have
        :data:`shadowbench.device.placed_triangles.BATCH_TRIANGLES` together, at least one; a batch's arrays are
        overwritten by the next.
        """
        from shadowbench.device.placed_triangles import stream  # lazily: authoring and listing scenes needs no Warp

        return stream(self, context)

    def lookup(self, device: str) -> PlacedTriangles:
        """Return what kernels look up the corners of single triangles in, by number."""
        return _lookup(self, device)

    def corners_of(self, triangles: NDArray[np.integer]) -> NDArray[np.float32]:
        """Return the corners of a few triangles, by number, float32, shape [n, 3, 3]."""
        numbers = np.asarray(triangles, np.int64)
        if self.kept_flat is not None:
            return self.kept_flat.vertices[self.kept_flat.triangles[numbers]]
        corners = np.empty((len(numbers), 3, 3), np.float32)
        owners = self.instance_of(numbers)
        for owner in np.unique(owners):
            mine = np.flatnonzero(owners == owner)
            mesh = self.meshes[self.instances[owner].mesh]
            used = mesh.triangles[numbers[mine] - self.first_triangle[owner]].reshape(-1)
            part = Mesh(mesh.name, mesh.vertices[used], np.arange(len(used), dtype=np.int32).reshape(-1, 3))
            corners[mine] = placed_vertices(part, self.authored[owner], self.origin).reshape(-1, 3, 3)
        return corners

    def vertices_of(self, instance: int) -> NDArray[np.float32]:
        """Return the world positions of one instance's vertices, float32, shape [vertex_count, 3]."""
        return placed_vertices(self.meshes[self.instances[instance].mesh], self.authored[instance], self.origin)

    def blocks(self, size: int = 1 << 18) -> Iterator[TriangleBlock]:
        """Stream the triangles as NumPy arrays, at most ``size`` at a time, a block never crossing instances."""
        for instance in range(len(self.instances)):
            begin, end = int(self.first_triangle[instance]), int(self.first_triangle[instance + 1])
            if self.kept_flat is not None:
                vertices, triangles = self.kept_flat.vertices, self.kept_flat.triangles[begin:end]
            else:
                mesh = self.meshes[self.instances[instance].mesh]
                vertices, triangles = self.vertices_of(instance), mesh.triangles
            for first in range(0, end - begin, size):
                yield TriangleBlock(instance, first, vertices[triangles[first : first + size]])

    def instance_of(self, triangles: NDArray[np.integer]) -> NDArray[np.int32]:
        """Return the instance that owns each triangle."""
        return (np.searchsorted(self.first_triangle, triangles, side="right") - 1).astype(np.int32)

    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the lowest and highest coordinates over all vertices, shape [3] each; there must be an instance."""
        return self._bounds

    @functools.cached_property
    def _bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        return self.instance_bounds[:, 0].min(axis=0), self.instance_bounds[:, 1].max(axis=0)

    @functools.cached_property
    def pool(self) -> MeshPool:
        """The meshes that these instances use."""
        return pool_of(self.meshes, {i.mesh for i in self.instances})


def flattened(meshes: Sequence[Mesh], authored: Sequence[Instance], origin: Vector) -> FlatTriangles:
    """Place every instance's own copy of its mesh."""
    placed = [placed_vertices(meshes[i.mesh], i, origin) for i in authored]
    first_vertex = np.cumsum([0] + [len(p) for p in placed])
    triangles = [meshes[i.mesh].triangles + np.int32(first_vertex[k]) for k, i in enumerate(authored)]
    return FlatTriangles(
        np.concatenate(placed or [np.zeros((0, 3), np.float32)]),
        np.concatenate(triangles or [np.zeros((0, 3), np.int32)]).astype(np.int32),
    )


@once_per_device
def _on_device(flat: FlatTriangles, device: str) -> DeviceTriangles:
    import warp as wp

    from shadowbench.device.arrays import as_warp

    return DeviceTriangles(
        as_warp(flat.vertices, wp.vec3, device), as_warp(flat.triangles.reshape(-1), wp.int32, device)
    )


@once_per_device
def _lookup(placed: PlacedInstances, device: str) -> PlacedTriangles:
    from shadowbench.device.placed_triangles import lookup_of

    return lookup_of(placed, device)
