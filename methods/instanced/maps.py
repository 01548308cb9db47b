"""Drawing casters' maps and keeping them: each is drawn from its mesh, once, in the mesh's own space."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import warp as wp

from shadowbench.device.arrays import as_warp
from shadowbench.device.depth_rasterizer import DepthRasterizer
from shadowbench.device.launch import Context
from shadowbench.device.map_pool import MapPool
from shadowbench.methods.instanced.windows import Array
from shadowbench.scene import Mesh, Rotation
from shadowbench.world import Casters, bounds_of

MapKey = tuple[Any, ...]
"""Tells maps apart: equal keys, equal maps."""


@dataclass(frozen=True, eq=False)
class MapRequest:
    """A map that is wanted.

    Attributes:
        mesh: Index of the mesh to draw.
        projection: From the mesh's space with the origin in the centre of its box, shape [4, 4].
        near: Distance of the near plane, ``None`` for an orthographic map.
        rotation: That the first caster's mesh is drawn at, under parallel light.
        face: Of a point light that sees it so.
        casters: Rows of :class:`Pairs` that look it up.
    """

    mesh: int
    projection: Array
    near: float | None
    rotation: Rotation | None = None
    face: int | None = None
    casters: list[int] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class CasterMesh:
    """A mesh moved to the centre of its bounding box.

    Attributes:
        mesh: As the scene has it.
        version: Of the mesh then.
        centre: Of the box, in the mesh's space.
        half: Half the box's sides.
        vertices: From the centre, wp.vec3; rounded to float32 after moving, which costs less than a texel of any map.
        triangles: Vertex indices, int32.
    """

    mesh: Mesh
    version: int
    centre: Array
    half: Array
    vertices: wp.array[Any]
    triangles: wp.array[Any]


class CasterMeshes:
    """Meshes by number, prepared when first asked for and again when they have changed.

    Args:
        device: Where maps are drawn.
    """

    def __init__(self, device: str) -> None:
        self._device = device
        self._known: dict[int, CasterMesh] = {}

    def of(self, casters: Casters, number: int) -> CasterMesh:
        """Return one of the casters' meshes."""
        mesh = casters.meshes[number]
        known = self._known.get(number)
        if known is None or known.mesh is not mesh or known.version != mesh.version:
            low, high = bounds_of(mesh.vertices[mesh.triangles.reshape(-1)])
            low, high = low.astype(np.float64), high.astype(np.float64)
            centre = (low + high) / 2.0
            vertices = (mesh.vertices.astype(np.float64) - centre).astype(np.float32)
            known = self._known[number] = CasterMesh(
                mesh,
                mesh.version,
                centre,
                (high - low) / 2.0,
                as_warp(vertices, wp.vec3, self._device),
                as_warp(mesh.triangles.reshape(-1), wp.int32, self._device),
            )
        return known


class CasterMapDrawer:
    """Keeps the maps that are wanted, and draws those that are not there yet.

    Args:
        meshes: What is drawn.
        slope_bias: Polygon offset's factor.
        context: Where to run.

    Attributes:
        pool: The maps.
    """

    def __init__(self, meshes: CasterMeshes, slope_bias: float, context: Context) -> None:
        self.pool = MapPool(context)
        self._meshes, self._slope_bias, self._context = meshes, slope_bias, context
        self._drawn: dict[MapKey, CasterMesh] = {}

    def draw(
        self, requests: Mapping[MapKey, MapRequest], resolutions: Mapping[MapKey, int], casters: Casters, *, anew: bool
    ) -> list[MapRequest]:
        """Have these maps and no others.

        Args:
            requests: What each shows.
            resolutions: Width and height of each [texels].
            casters: Whose meshes are drawn.
            anew: Draw all of them, those that are there too.

        Returns:
            Those that were drawn.
        """
        fresh = self.pool.arrange(resolutions)
        drawn = []
        for key, request in requests.items():
            mesh = self._meshes.of(casters, request.mesh)
            if anew or key in fresh or self._drawn.get(key) is not mesh:
                size = resolutions[key]
                rasterizer = DepthRasterizer(size, size, self._context, depth=self.pool.map(key))
                rasterizer.draw(
                    mesh.vertices, mesh.triangles, request.projection, near=request.near, slope_bias=self._slope_bias
                )
                self._drawn[key] = mesh
                drawn.append(request)
        self._drawn = {key: self._drawn[key] for key in requests}
        return drawn
