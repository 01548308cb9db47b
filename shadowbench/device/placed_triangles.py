"""Instances on the device: the corners of one triangle by its number, and all triangles in batches.

Positions are those of :func:`shadowbench.placed_instances.placed_vertices`, bit for bit: the same float64 products and
sums in the same order, less the origin, rounded once. Where the world keeps flat arrays, they are read instead.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from shadowbench.device.arrays import as_warp
from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.per_device import once_per_device
from shadowbench.placed_instances import DeviceTriangles, MeshPool, PlacedInstances

wp.set_module_options(kernel_options(native=True))

BATCH_TRIANGLES = 1 << 19
"""Most triangles placed at a time, unless one instance has more: some 20 MiB, reused by batch after batch."""

_BLOCK = wp.constant(256)
"""Vertices or triangles placed in a row by one thread."""


@wp.struct
class PlacedTriangles:
    """World-space triangles as kernels look them up.

    Attributes:
        is_flat: Whether ``vertices`` and ``triangles`` are the world's; then all but ``first_triangle`` is empty.
        vertices: World positions.
        triangles: Vertex indices; of the pooled meshes, counted from each mesh's first vertex, if not flat.
        pool: Vertices of the pooled meshes, in their own spaces.
        first_triangle, first_vertex: Of each instance in the world, shape [instance_count + 1].
        pool_triangle, pool_vertex: Where each instance's mesh begins in the pool, shape [instance_count].
        row: World-from-mesh, three rows an instance, shape [3 * instance_count].
        is_as_modelled: Whether an instance's vertices keep their bits.
        origin: What is subtracted from every position.
    """

    is_flat: wp.bool
    vertices: wp.array[wp.vec3]
    triangles: wp.array[wp.int32]
    pool: wp.array[wp.vec3d]
    first_triangle: wp.array[wp.int64]
    first_vertex: wp.array[wp.int64]
    pool_triangle: wp.array[wp.int64]
    pool_vertex: wp.array[wp.int64]
    row: wp.array[wp.vec4d]
    is_as_modelled: wp.array[wp.uint8]
    origin: wp.vec3d


@dataclass(frozen=True, eq=False)
class TriangleBatch(DeviceTriangles):
    """Some of the triangles, in world space.

    Attributes:
        first_triangle: Number of the first of them; the others follow.
        first_instance: Of the instances they belong to, the first.
        triangle_counts: Of these instances, int64.
    """

    first_triangle: int
    first_instance: int
    triangle_counts: NDArray[np.int64]


@wp.func
def row_times(row: wp.vec4d, p: wp.vec3d):
    return row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]


@wp.func
def placed_vertex(placed: PlacedTriangles, owner: wp.int32, vertex: wp.int64):
    """World position of a vertex of the pool as an instance shows it."""
    p = placed.pool[vertex]
    if placed.is_as_modelled[owner] == wp.uint8(0):
        p = wp.vec3d(
            row_times(placed.row[3 * owner], p),
            row_times(placed.row[3 * owner + 1], p),
            row_times(placed.row[3 * owner + 2], p),
        )
    return wp.vec3(p - placed.origin)


@wp.func
def owner_of(number: wp.int64, first: wp.array[wp.int64], count: wp.int32):
    """The one of ``count`` ranges that holds ``number``, by bisection; ``first`` is where each begins."""
    low = wp.int32(0)
    high = wp.int32(count)
    while high - low > 1:
        middle = (low + high) // 2
        if first[middle] <= number:
            low = middle
        else:
            high = middle
    return low


@wp.func
def corners_of(placed: PlacedTriangles, t: wp.int32):
    """The three corners of triangle ``t``."""
    a = wp.vec3()
    b = wp.vec3()
    c = wp.vec3()
    if placed.is_flat:
        a = placed.vertices[placed.triangles[3 * t]]
        b = placed.vertices[placed.triangles[3 * t + 1]]
        c = placed.vertices[placed.triangles[3 * t + 2]]
    else:
        owner = owner_of(wp.int64(t), placed.first_triangle, placed.pool_triangle.shape[0])
        k = wp.int64(3) * (placed.pool_triangle[owner] + (wp.int64(t) - placed.first_triangle[owner]))
        vertex = placed.pool_vertex[owner]
        a = placed_vertex(placed, owner, vertex + wp.int64(placed.triangles[k]))
        b = placed_vertex(placed, owner, vertex + wp.int64(placed.triangles[k + wp.int64(1)]))
        c = placed_vertex(placed, owner, vertex + wp.int64(placed.triangles[k + wp.int64(2)]))
    return a, b, c


@wp.kernel
def _place_vertices(
    first: wp.int32,
    # inputs
    placed: PlacedTriangles,
    first_instance: wp.int32,
    count: wp.int32,
    # outputs
    vertices: wp.array[wp.vec3],
):
    """Place the vertices of a batch that begins with an instance."""
    begin = (wp.tid() + first) * _BLOCK
    before = placed.first_vertex[first_instance]
    number = before + wp.int64(begin)
    owner = owner_of(number, placed.first_vertex, placed.pool_vertex.shape[0])
    for i in range(begin, wp.min(begin + _BLOCK, count)):
        number = before + wp.int64(i)
        while number >= placed.first_vertex[owner + 1]:
            owner += 1
        vertices[i] = placed_vertex(placed, owner, placed.pool_vertex[owner] + (number - placed.first_vertex[owner]))


@wp.kernel
def _place_triangles(
    first: wp.int32,
    # inputs
    placed: PlacedTriangles,
    first_instance: wp.int32,
    count: wp.int32,
    # outputs
    triangles: wp.array[wp.int32],
):
    """Write the vertex indices of a batch that begins with an instance."""
    begin = (wp.tid() + first) * _BLOCK
    before = placed.first_triangle[first_instance]
    number = before + wp.int64(begin)
    owner = owner_of(number, placed.first_triangle, placed.pool_triangle.shape[0])
    for i in range(begin, wp.min(begin + _BLOCK, count)):
        number = before + wp.int64(i)
        while number >= placed.first_triangle[owner + 1]:
            owner += 1
        k = wp.int64(3) * (placed.pool_triangle[owner] + (number - placed.first_triangle[owner]))
        first_vertex = wp.int32(placed.first_vertex[owner] - placed.first_vertex[first_instance])
        triangles[3 * i] = placed.triangles[k] + first_vertex
        triangles[3 * i + 1] = placed.triangles[k + wp.int64(1)] + first_vertex
        triangles[3 * i + 2] = placed.triangles[k + wp.int64(2)] + first_vertex


@dataclass(frozen=True, eq=False)
class _PoolOnDevice:
    """The pooled meshes, and scratch that no stream is using."""

    vertices: wp.array[Any]
    triangles: wp.array[Any]
    scratch: list[tuple[wp.array[Any], wp.array[Any]]]


@once_per_device
def _pool_on_device(pool: MeshPool, device: str) -> _PoolOnDevice:
    return _PoolOnDevice(
        as_warp(pool.vertices, wp.vec3d, device), as_warp(pool.triangles.reshape(-1), wp.int32, device), []
    )


def lookup_of(placed: PlacedInstances, device: str) -> PlacedTriangles:
    """Return what :func:`corners_of` reads; see :meth:`PlacedInstances.lookup`."""
    packed: Any = PlacedTriangles()  # its members are Warp's types to a checker, Python's to us
    packed.first_triangle = as_warp(placed.first_triangle, wp.int64, device)
    packed.is_flat = placed.is_flat
    if placed.is_flat:
        flat = placed.on(device)
        packed.vertices, packed.triangles = flat.vertices, flat.triangles
        return packed  # type: ignore[no-any-return]
    meshes = np.array([i.mesh for i in placed.instances])
    on_device = _pool_on_device(placed.pool, device)
    packed.pool, packed.triangles = on_device.vertices, on_device.triangles
    vertex_counts = [len(placed.meshes[i.mesh].vertices) for i in placed.instances]
    packed.first_vertex = as_warp(np.cumsum([0, *vertex_counts], dtype=np.int64), wp.int64, device)
    packed.pool_triangle = as_warp(placed.pool.first_triangle[meshes], wp.int64, device)
    packed.pool_vertex = as_warp(placed.pool.first_vertex[meshes], wp.int64, device)
    packed.row = as_warp(np.concatenate([i.matrix() for i in placed.authored]), wp.vec4d, device)
    as_modelled = np.array([i.is_placed_as_modelled for i in placed.authored], np.uint8)
    packed.is_as_modelled = as_warp(as_modelled, wp.uint8, device)
    packed.origin = wp.vec3d(*placed.origin)
    return packed  # type: ignore[no-any-return]


def stream(placed: PlacedInstances, context: Context) -> Iterator[TriangleBatch]:
    """Yield all triangles in batches; see :meth:`PlacedInstances.batches`."""
    if placed.is_flat:
        flat = placed.on(context.device)
        if flat.triangle_count:
            yield TriangleBatch(flat.vertices, flat.triangles, 0, 0, np.diff(placed.first_triangle))
        return
    lookup, device = placed.lookup(context.device), context.device
    spans = batch_spans(placed)
    first_vertex: Any = lookup.first_vertex
    starts = first_vertex.numpy()
    vertex_count = max((int(starts[end] - starts[begin]) for begin, end in spans), default=0)
    triangle_count = max((_triangles_in(placed, *span) for span in spans), default=0)
    idle = _pool_on_device(placed.pool, device).scratch
    vertices, triangles = idle.pop() if idle else (wp.empty(0, dtype=wp.vec3), wp.empty(0, dtype=wp.int32))
    if vertices.shape[0] < vertex_count:
        vertices = wp.empty(vertex_count, dtype=wp.vec3, device=device)
    if triangles.shape[0] < 3 * triangle_count:
        triangles = wp.empty(3 * triangle_count, dtype=wp.int32, device=device)
    try:
        for begin, end in spans:
            own = int(starts[end] - starts[begin])
            count = _triangles_in(placed, begin, end)
            for kernel, number, output in ((_place_vertices, own, vertices), (_place_triangles, count, triangles)):
                blocks = -(-number // int(_BLOCK))
                launch(kernel, blocks, inputs=[lookup, begin, number], outputs=[output], context=context)
            counts = np.diff(placed.first_triangle[begin : end + 1])
            number = int(placed.first_triangle[begin])
            yield TriangleBatch(vertices[:own], triangles[: 3 * count], number, begin, counts)
    finally:
        idle.append((vertices, triangles))


def batch_spans(placed: PlacedInstances) -> list[tuple[int, int]]:
    """Cut the instances into runs of at most :data:`BATCH_TRIANGLES` triangles, or of one instance."""
    spans: list[tuple[int, int]] = []
    for k in range(len(placed.instances)):
        if spans and _triangles_in(placed, spans[-1][0], k + 1) <= BATCH_TRIANGLES:
            spans[-1] = (spans[-1][0], k + 1)
        else:
            spans.append((k, k + 1))
    return spans


def _triangles_in(placed: PlacedInstances, begin: int, end: int) -> int:
    return int(placed.first_triangle[end] - placed.first_triangle[begin])
