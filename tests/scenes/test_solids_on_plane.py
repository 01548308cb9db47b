"""The box and the sphere: closed, outward, of the right size, standing where they should."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from mesh_files import is_closed, signed_volume
from numpy.typing import NDArray

from shadowbench.scene import Scene
from shadowbench.scenes.solids_on_plane import BoxOnPlane, SphereOnPlane, box, icosphere
from shadowbench.world import place


def _solid_points(scene: Scene) -> NDArray[np.float32]:
    world = place(scene)
    return world.vertices[np.unique(world.triangles[: world.first_triangle[1]])]


def test_the_box_is_a_closed_unit_cube_facing_out() -> None:
    mesh = box()
    assert mesh.triangle_count == 12
    assert is_closed(mesh.triangles)
    assert signed_volume(mesh.vertices, mesh.triangles) == 1.0
    assert np.abs(mesh.vertices).tolist() == [[0.5, 0.5, 0.5]] * 8


@pytest.mark.parametrize("subdivisions", range(5))
def test_the_sphere_is_closed_and_its_vertices_lie_on_it(subdivisions: int) -> None:
    mesh = icosphere(subdivisions)
    assert mesh.triangle_count == 20 * 4**subdivisions
    assert len(mesh.vertices) == 2 + 10 * 4**subdivisions  # Euler: V - E + F = 2
    assert is_closed(mesh.triangles)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.5, rtol=1e-15)


def test_the_spheres_volume_grows_to_that_of_a_ball() -> None:
    volumes = [signed_volume(m.vertices, m.triangles) for m in map(icosphere, range(6))]
    icosahedron = 5.0 / 12.0 * (3.0 + math.sqrt(5.0)) * (1.0 / math.sin(2.0 * math.pi / 5.0) / 2.0) ** 3
    assert volumes[0] == pytest.approx(icosahedron)
    assert volumes == sorted(volumes)
    assert volumes[-1] < math.pi / 6.0
    assert volumes[-1] == pytest.approx(math.pi / 6.0, rel=2e-3)


@pytest.mark.parametrize("height", [0.0, 0.25, 7.5])
@pytest.mark.parametrize(
    ("cls", "values"), [(BoxOnPlane, {}), (SphereOnPlane, {"subdivisions": 0}), (SphereOnPlane, {"subdivisions": 3})]
)
def test_the_gap_to_the_plane_is_the_height(cls: Any, values: dict[str, int], height: float) -> None:
    points = _solid_points(cls().make(cls.Parameters(height=height, **values)))
    assert points[:, 1].min() == pytest.approx(height, abs=1e-6)
    if height == 0.0 and cls is BoxOnPlane:
        assert points[:, 1].min() == 0.0


@pytest.mark.parametrize("cls", [BoxOnPlane, SphereOnPlane])
def test_solids_are_centred_on_the_origin(cls: Any) -> None:
    points = _solid_points(cls().make(cls.Parameters()))
    np.testing.assert_allclose(points.max(axis=0), [0.5, 1.0, 0.5], atol=1e-6)
    np.testing.assert_allclose(points.min(axis=0), [-0.5, 0.0, -0.5], atol=1e-6)
