"""The vases: one closed surface of revolution, four instances that differ by translation and scale only."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_files import is_closed, signed_volume
from scene_geometry import assert_lights_are_usable, digest, lowest, made, shares_seen, smallest_area

from shadowbench.scenes.vases import SIDES, Vases, vase
from shadowbench.world import World, place


@pytest.fixture(scope="module")
def world() -> World:
    return place(made(Vases))


def test_the_scene_has_the_stated_number_of_triangles(world: World) -> None:
    assert vase().triangle_count == 17_856
    assert world.casters.triangle_count == 71_424
    assert world.triangle_count == 71_426
    documented = __import__(Vases.__module__, fromlist=["x"]).__doc__ or ""
    assert "17,856 triangles, 71,424 for the four" in documented
    assert smallest_area(world) > 1e-6
    assert digest(made(Vases)) == digest(made(Vases))


def test_the_vase_is_closed_and_hollow() -> None:
    shape = vase()
    assert is_closed(shape.triangles)
    volume = signed_volume(shape.points, shape.triangles)
    assert volume > 0.0
    # full, it would hold what its outer profile sweeps: clay is a small part of it
    radius = np.hypot(shape.points[:, 0], shape.points[:, 2])
    heights = np.linspace(0.01, 1.27, 200)
    outer = [radius[np.abs(shape.points[:, 1] - y) < 0.03].max() for y in heights]
    assert volume < 0.4 * np.pi * (np.square(outer) * (heights[1] - heights[0])).sum()


def test_the_vase_is_a_surface_of_revolution() -> None:
    """Turned by one of its sides, it lies on itself."""
    shape = vase()
    again = shape.turned((0.0, 1.0, 0.0), 360.0 / SIDES)
    rings, turned = (s.points[np.hypot(s.points[:, 0], s.points[:, 2]) > 0.0] for s in (shape, again))
    rings, turned = rings.reshape(-1, SIDES, 3), turned.reshape(-1, SIDES, 3)
    np.testing.assert_allclose(turned, np.roll(rings, -1, axis=1), atol=1e-12)


def test_instances_differ_by_translation_and_scale_only(world: World) -> None:
    vases, floor = world.instances[:4], world.instances[4]
    assert [v.mesh for v in vases] == [0] * 4
    assert all(v.rotation.angle == 0.0 and v.scale[0] == v.scale[1] == v.scale[2] for v in vases)
    assert len({v.scale for v in vases}) == len({v.translation for v in vases}) == len({v.albedo for v in vases}) == 4
    assert all(v.casts and v.receives for v in vases)
    assert floor.receives
    assert not floor.casts


def test_vases_stand_on_the_floor_and_apart(world: World) -> None:
    assert lowest(world)["vase"] == [0.0] * 4
    assert lowest(world)["floor"] == [0.0]
    at = np.array([v.translation for v in world.instances[:4]])
    reach = 0.38 * np.array([v.scale[0] for v in world.instances[:4]])
    apart = np.linalg.norm(at[:, None] - at[None], axis=2)
    assert (apart + np.eye(4) > reach[:, None] + reach).all()


def test_lights_come_from_above(world: World) -> None:
    assert_lights_are_usable(world)


@pytest.mark.parametrize("camera", ["overview", "close", "low"])
def test_cameras_see_light_and_shadow(world: World, camera: str) -> None:
    share, lit, shadowed = shares_seen(world, camera)
    assert share > 0.4
    assert lit > 0.6
    assert shadowed > 0.08
