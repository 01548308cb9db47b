"""A scene while it is being put together: shapes become meshes, and places become instances of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shadowbench.scene import Camera, Instance, Light, Mesh, Rotation, Scene, Vector

from .shapes import Shape
from .vectors import vector

Place = tuple[float, float, float, float]
"""Where an instance stands: x, y, z and its turn about the vertical [degrees]."""

HERE: Place = (0.0, 0.0, 0.0, 0.0)


class Setting:
    """Meshes and instances so far."""

    def __init__(self) -> None:
        self._meshes: list[Mesh] = []
        self._instances: list[Instance] = []

    @property
    def triangle_count(self) -> int:
        """Triangles so far, over all instances."""
        return sum(self._meshes[instance.mesh].triangle_count for instance in self._instances)

    def add(self, name: str, shape: Shape, albedo: Vector | Sequence[Vector], *places: Place) -> None:
        """Add instances of a shape: one at each place, or one as modelled if there is none.

        Args:
            name: What reports call the mesh.
            shape: Its triangles.
            albedo: Of all instances, or those that take turns.
            places: Where the instances stand.
        """
        albedos = np.asarray(albedo, np.float64).reshape(-1, 3).tolist()
        for k, (x, y, z, degrees) in enumerate(places or [HERE]):
            self._instances.append(
                Instance(
                    len(self._meshes),
                    translation=(x, y, z),
                    rotation=Rotation((0.0, 1.0, 0.0), degrees),
                    albedo=vector(albedos[k % len(albedos)]),
                )
            )
        self._meshes.append(shape.mesh(name))

    def scene(self, lights: dict[str, Light], cameras: dict[str, Camera]) -> Scene:
        return Scene(tuple(self._meshes), tuple(self._instances), lights, cameras)
