"""A box and a sphere over a plane: the scenes whose shadows have closed forms.

Under the sun a box's shadow on the plane is a hexagon (its top and bottom faces, sheared along the light, and their
hull) and a sphere's is an ellipse, so every method's result can be checked without any ray. With ``height`` 0 the solid
touches the plane, which shows whether a shadow is attached; raised, it shows the shadow alone.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from shadowbench.parameters import parameter
from shadowbench.scene import Mesh, Scene, ScenePlugin

from .fitting import FitParameters, fitted_scene

RADIUS = 0.5
"""The sphere's radius and half the box's side [scene units]."""

_GOLDEN = (1.0 + math.sqrt(5.0)) / 2.0

_ICOSAHEDRON_VERTICES = [(x, y * _GOLDEN, 0.0) for y in (1.0, -1.0) for x in (-1.0, 1.0)]
_ICOSAHEDRON_VERTICES += [(0.0, y, z * _GOLDEN) for z in (1.0, -1.0) for y in (-1.0, 1.0)]
_ICOSAHEDRON_VERTICES += [(x * _GOLDEN, 0.0, z) for x in (1.0, -1.0) for z in (-1.0, 1.0)]

_ICOSAHEDRON_FACES = [
    *[(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11)],
    *[(1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8)],
    *[(3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9)],
    *[(4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)],
]


class _OnPlaneParameters(FitParameters):
    height: float = parameter(
        0.0, unit="scene units", help="Gap between the solid and the plane; 0 for contact.", ge=0.0, le=100.0
    )


class BoxOnPlane(ScenePlugin):
    """A unit cube, its faces along the axes."""

    name = "box-on-plane"
    title = "Box on a plane"
    Parameters: ClassVar[type[BaseModel]] = _OnPlaneParameters

    def make(self, parameters: BaseModel) -> Scene:
        """Place the cube."""
        assert isinstance(parameters, _OnPlaneParameters)
        return fitted_scene(box(), parameters, translation=(0.0, RADIUS + parameters.height, 0.0))


class SphereOnPlane(ScenePlugin):
    """A sphere of diameter 1, as a subdivided icosahedron whose vertices lie on it."""

    name = "sphere-on-plane"
    title = "Sphere on a plane"

    class Parameters(_OnPlaneParameters):
        """The sphere's fineness."""

        subdivisions: int = parameter(
            5, unit="1", help="Times that each triangle of an icosahedron is split in four.", ge=0, le=8
        )

    def make(self, parameters: BaseModel) -> Scene:
        """Place the sphere."""
        assert isinstance(parameters, self.Parameters)
        solid = icosphere(parameters.subdivisions)
        # a coarse sphere stands on its lowest vertex, not on the sphere's pole
        lift = -float(solid.vertices[:, 1].min()) + parameters.height
        return fitted_scene(solid, parameters, translation=(0.0, lift, 0.0))


def box() -> Mesh:
    """Return the cube [-1/2, 1/2]³: 8 vertices, 12 triangles, counter-clockwise from outside."""
    signs = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return Mesh("box", RADIUS * signs, np.array(triangles, np.int32))


def icosphere(subdivisions: int) -> Mesh:
    """Return a sphere of radius 1/2 round the origin: 20 · 4^subdivisions triangles, counter-clockwise from outside."""
    vertices, triangles = _on_sphere(np.array(_ICOSAHEDRON_VERTICES)), np.array(_ICOSAHEDRON_FACES)
    for _ in range(subdivisions):
        vertices, triangles = _subdivided(vertices, triangles)
    return Mesh("sphere", RADIUS * vertices, triangles.astype(np.int32))


def _on_sphere(points: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    return points / np.sqrt(x * x + y * y + z * z)[:, None]


def _subdivided(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Split each triangle in four at its edges' midpoints, pushed out to the sphere."""
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    pairs, of_edge = np.unique(edges[:, 0] * len(vertices) + edges[:, 1], return_inverse=True)
    midpoints = _on_sphere(vertices[pairs // len(vertices)] + vertices[pairs % len(vertices)])
    ab, bc, ca = len(vertices) + of_edge.reshape(3, -1)
    a, b, c = triangles.T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([vertices, midpoints]), np.concatenate([np.stack(part, axis=1) for part in parts])
