"""Placing a scene: float32 positions as exact as can be, instances in order, casters apart from what only receives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from builders import LIGHTS, SUN, box, square

from shadowbench.errors import SceneError
from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Light,
    Mesh,
    PointLight,
    RectangularLight,
    Rotation,
    Scene,
    SpotLight,
)
from shadowbench.world import World, place

CAMERA = Camera((3.0, 4.0, 5.0), (0.0, 0.5, 0.0))
GROUND = Mesh("ground", *square(2.0))
BOX = Mesh("box", *box((-0.5, 0.0, -0.25), (0.5, 1.0, 0.25)))


def _scene(*instances: Instance, meshes: tuple[Mesh, ...] = (GROUND, BOX), **changes: Any) -> Scene:
    return Scene(meshes, instances, changes.get("lights", LIGHTS), changes.get("cameras", {"front": CAMERA}))


def _corners(world: World, instance: int) -> np.ndarray[Any, Any]:
    begin, end = world.first_triangle[instance : instance + 2]
    return world.vertices[world.triangles[begin:end]]


def test_an_instance_placed_as_modelled_keeps_its_bits() -> None:
    vertices = np.random.Generator(np.random.PCG64(1)).random((30, 3)).astype(np.float32) - np.float32(0.5)
    mesh = Mesh("soup", vertices, np.arange(30, dtype=np.int32).reshape(-1, 3))
    world = place(_scene(Instance(0), meshes=(mesh,)))
    np.testing.assert_array_equal(world.vertices, vertices)
    assert world.origin == (0.0, 0.0, 0.0)


def test_a_quarter_turn_takes_a_box_exactly_onto_a_box() -> None:
    world = place(_scene(Instance(1), Instance(1, rotation=Rotation((0, 1, 0), 90.0))))
    # about y, x goes to -z and z to x
    np.testing.assert_array_equal(_corners(world, 1), _corners(world, 0)[..., [2, 1, 0]] * np.float32([1, 1, -1]))


def test_instances_keep_their_order_and_know_their_triangles() -> None:
    world = place(_scene(Instance(1), Instance(0), Instance(1, translation=(0, 2, 0))))
    assert world.first_triangle.tolist() == [0, 12, 14, 26]
    assert world.triangle_count == 26
    assert world.instance_of(np.array([0, 11, 12, 13, 14, 25])).tolist() == [0, 0, 1, 1, 2, 2]
    np.testing.assert_array_equal(_corners(world, 2), _corners(world, 0) + np.float32([0, 2, 0]))


@pytest.mark.parametrize("offset", [(1e6, -2e6, 3e6), (1e6 + 1 / 3, 0.1, -0.7), (0.0, 1e5, 0.0)])
def test_a_scene_far_away_keeps_its_shape(offset: tuple[float, float, float]) -> None:
    near = place(_scene(Instance(1)))
    far = place(_scene(Instance(1, translation=offset)))
    edges = far.vertices[1:] - far.vertices[:1]
    np.testing.assert_allclose(edges, near.vertices[1:] - near.vertices[:1], rtol=1e-6, atol=1e-9)
    assert far.scale < 4.0
    np.testing.assert_allclose(np.add(far.origin, far.vertices.mean(axis=0)), np.add(offset, (0, 0.5, 0)), atol=1e-6)


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1.0, 1e6])
@pytest.mark.parametrize("place_in_sizes", [5.0, 1e3, 1e5])
def test_small_and_large_scenes_are_recentred_alike(size: float, place_in_sizes: float) -> None:
    offset = np.array([place_in_sizes, 0.3 * place_in_sizes, -place_in_sizes]) * size
    mesh = Mesh("box", BOX.vertices.astype(np.float64) * size + offset, BOX.triangles)
    world = place(_scene(Instance(0), meshes=(mesh,)))
    assert world.scale < 2.0 * size
    shape = (world.vertices[1:].astype(np.float64) - world.vertices[:1]) / size
    np.testing.assert_allclose(shape, BOX.vertices[1:] - BOX.vertices[:1], atol=1e-6)


def test_a_scene_near_the_origin_stays_where_it_is() -> None:
    world = place(_scene(Instance(1, translation=(1.5, 0.0, 0.0))))
    assert world.origin == (0.0, 0.0, 0.0)
    assert world.vertices[:, 0].min() == 1.0


def _beyond(origin: Any, x: float, y: float, z: float) -> tuple[float, float, float]:
    return (float(origin[0] + x), float(origin[1] + y), float(origin[2] + z))


def test_lights_and_cameras_move_with_a_recentred_scene() -> None:
    offset = np.array([1e6, 2e6, -3e6])
    lights: dict[str, Light] = {
        "spot": SpotLight(_beyond(offset, 1, 4, 1), (-1, -4, -1)),
        "lamp": PointLight(_beyond(offset, 1, 2, 3)),
        "window": RectangularLight(_beyond(offset, 0, 3, 0), (1, 0, 0), (0, 0, 1)),
        "sun": SUN,
    }
    cameras = {"front": Camera(_beyond(offset, 3, 4, 5), tuple(offset))}
    world = place(_scene(Instance(1, translation=tuple(offset)), lights=lights, cameras=cameras))
    shift = offset - world.origin
    spot, lamp, window, sun = (world.lights[name] for name in ("spot", "lamp", "window", "sun"))
    assert isinstance(spot, SpotLight)
    assert isinstance(lamp, PointLight)
    assert isinstance(window, RectangularLight)
    assert isinstance(sun, DirectionalLight)
    np.testing.assert_allclose(spot.position, _beyond(shift, 1, 4, 1))
    np.testing.assert_allclose(lamp.position, _beyond(shift, 1, 2, 3))
    np.testing.assert_allclose(window.corner, _beyond(shift, 0, 3, 0))
    np.testing.assert_allclose(world.cameras["front"].eye, _beyond(shift, 3, 4, 5))
    np.testing.assert_allclose(world.cameras["front"].target, shift)
    np.testing.assert_allclose(np.cross(sun.direction, SUN.direction), 0.0, atol=1e-7)


def test_a_lights_numbers_are_float32_and_its_direction_is_a_unit_vector() -> None:
    lights: dict[str, Light] = {
        "sun": DirectionalLight((0.1, 0.7, 0.3)),
        "spot": SpotLight((0.1, 4.1, 0.3), (0.1, -3.0, 0.2)),
        "window": RectangularLight((0.1, 3.1, 0.3), (0.1, 0, 0), (0, 0, 0.1)),
    }
    world = place(_scene(Instance(0), Instance(1), lights=lights))
    numbers = []
    for light in world.lights.values():
        for name in ("direction", "position", "corner", "edge_u", "edge_v"):
            numbers += list(getattr(light, name, ()))
        if hasattr(light, "direction"):
            assert np.linalg.norm(light.direction) == pytest.approx(1.0, abs=1e-6)
    assert len(numbers) == 3 + 6 + 9
    assert all(float(np.float32(x)) == x for x in numbers)


@pytest.mark.parametrize("instance", [Instance(1, scale=(1e35, 1, 1)), Instance(1, scale=(1e300, 1e300, 1))])
def test_coordinates_beyond_reason_are_refused(instance: Instance) -> None:
    with pytest.raises(SceneError, match="reach beyond"):
        place(_scene(instance))


@pytest.mark.parametrize("size", [1e-20, 1e-16, 2e15, 1e20])
def test_scenes_too_large_or_too_small_for_float32_are_refused(size: float) -> None:
    with pytest.raises(SceneError, match=r"between 1e-15 and 1e\+15: scale it"):
        place(_scene(Instance(1, scale=(size, size, size))))


def test_casters_share_the_worlds_arrays_where_everything_casts() -> None:
    world = place(_scene(Instance(0), Instance(1)))
    assert world.casters.vertices is world.vertices
    assert world.casters.triangle_count == world.triangle_count
    assert world.casters.world_triangle.tolist() == [0, 0]
    assert world.casters is world.casters


def test_what_does_not_cast_is_left_out_of_the_casters() -> None:
    world = place(_scene(Instance(0, casts=False), Instance(1), Instance(0, casts=False), Instance(1, (0, 3, 0))))
    casters = world.casters
    assert casters.first_triangle.tolist() == [0, 12, 24]
    assert [i.translation for i in casters.instances] == [(0.0, 0.0, 0.0), (0.0, 3.0, 0.0)]
    assert len(casters.vertices) == 16
    corners = casters.vertices[casters.triangles]
    for instance, whole in enumerate((1, 3)):
        mine = corners[casters.first_triangle[instance] : casters.first_triangle[instance + 1]]
        np.testing.assert_array_equal(mine, _corners(world, whole))
        number = casters.first_triangle[instance] + casters.world_triangle[instance]
        assert number == world.first_triangle[whole]
    np.testing.assert_array_equal(casters.bounds()[1], [0.5, 4.0, 0.25])
    assert casters.scale == world.scale


def test_blocks_stream_every_triangle_once_and_never_cross_instances() -> None:
    casters = place(_scene(Instance(1), Instance(0), Instance(1))).casters
    blocks = list(casters.blocks(5))
    assert [(b.instance, b.first_triangle, len(b.corners)) for b in blocks] == [
        *[(0, 0, 5), (0, 5, 5), (0, 10, 2)],
        (1, 0, 2),
        *[(2, 0, 5), (2, 5, 5), (2, 10, 2)],
    ]
    np.testing.assert_array_equal(np.concatenate([b.corners for b in blocks]), casters.vertices[casters.triangles])


def test_one_clear_caster_makes_the_casters_translucent() -> None:
    assert place(_scene(Instance(0), Instance(1))).casters.is_opaque
    assert not place(_scene(Instance(0), Instance(1, transmittance=(0.0, 0.0, 0.1)))).casters.is_opaque


def test_bounds_scale_and_diagonal_are_those_of_the_vertices() -> None:
    world = place(_scene(Instance(1)))
    np.testing.assert_array_equal(world.bounds(), [[-0.5, 0.0, -0.25], [0.5, 1.0, 0.25]])
    assert world.scale == 1.0
    assert world.diagonal() == pytest.approx(1.5)


def test_placing_twice_gives_the_same_bits() -> None:
    scene = _scene(Instance(0), Instance(1, (0.1, 0.2, 0.3), (1.1, 0.9, 1.3), Rotation((1, 2, 3), 33.0)))
    np.testing.assert_array_equal(place(scene).vertices, place(scene).vertices)


def test_device_arrays_hold_the_worlds_numbers_without_a_copy() -> None:
    world = place(_scene(Instance(0), Instance(1)))
    device = world.on("cpu")
    assert device.triangle_count == world.triangle_count
    np.testing.assert_array_equal(device.vertices.numpy(), world.vertices)
    assert device.vertices.ptr == world.vertices.ctypes.data
    assert world.on("cpu") is device
