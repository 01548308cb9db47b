"""Placing a scene: float32 positions as exact as can be, instances in order, casters apart from what only receives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import warp as wp
from builders import LIGHTS, SUN, box, square

from shadowbench.device import placed_triangles
from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.placed_triangles import PlacedTriangles, corners_of
from shadowbench.errors import SceneError
from shadowbench.identity import content_digest
from shadowbench.placed_instances import PlacedInstances
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
from shadowbench.world import World, bounds_of, place

wp.set_module_options(kernel_options(native=True))

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


def _same_world(one: World, other: World) -> None:
    assert one.origin == other.origin
    assert one.instances == other.instances
    assert one.authored == other.authored
    assert one.scale == other.scale
    assert content_digest(one) == content_digest(other)
    for a, b in ((one, other), (one.casters, other.casters)):
        np.testing.assert_array_equal(a.vertices, b.vertices)
        np.testing.assert_array_equal(a.triangles, b.triangles)
        np.testing.assert_array_equal(a.bounds(), b.bounds())


@pytest.mark.parametrize("copied_triangles", [1000, 0], ids=["flat", "streamed"])
@pytest.mark.parametrize("offset", [0.0, 1e6 + 1 / 3], ids=["near", "far"])
@pytest.mark.parametrize("ground_casts", [True, False])
def test_a_moved_world_is_the_moved_scene_placed_anew(copied_triangles: int, offset: float, ground_casts: bool) -> None:
    def at(x: float, turn: float, version: int) -> Instance:
        place = (offset + x, 0.1, -offset)
        return Instance(1, place, (1.0, 1.1, 0.9), Rotation((0.2, 1, 0), turn), version=version)

    ground = Instance(0, (offset, 0.0, -offset), casts=ground_casts)
    before = (ground, at(0.3, 10.0, 0), at(-1.1, 20.0, 0), at(0.9, 0.0, 0))
    after = (ground, before[1], at(-0.7, 33.0, 1), at(0.8, 45.0, 1))
    world = place(_scene(*before), copied_triangles=copied_triangles)
    casters = world.casters
    moved = world.moved({2: after[2], 3: after[3]})
    _same_world(moved, place(_scene(*after), copied_triangles=copied_triangles))
    _same_world(moved.moved({2: before[2], 3: before[3]}), world)
    assert moved.meshes is world.meshes
    assert moved.is_flat == (copied_triangles > 0)
    assert moved.casters is not casters
    if moved.is_flat:
        assert moved.triangles is world.triangles


def test_what_cannot_move_says_so() -> None:
    world = place(_scene(Instance(0), Instance(1)))
    with pytest.raises(SceneError, match="there is no instance 2"):
        world.moved({2: Instance(1)})
    with pytest.raises(SceneError, match="moves to no other"):
        world.moved({1: Instance(0)})
    with pytest.raises(SceneError, match="reach beyond"):
        world.moved({1: Instance(1, scale=(1e35, 1, 1))})


def _forest() -> Scene:
    rng = np.random.Generator(np.random.PCG64(4))
    tree = Mesh("tree", rng.normal(size=(70, 3)), rng.integers(0, 60, (90, 3)).astype(np.int32))
    soup = Mesh("soup", rng.normal(size=(40, 3)).astype(np.float32), rng.integers(0, 40, (50, 3)).astype(np.int32))
    trees = [
        Instance(
            k % 2,
            (1e5 + float(x), float(y), float(z)),
            (float(s), float(s), -float(s)),
            Rotation((0.1, 1.0, 0.0), 37.0 * k),
            casts=k % 3 > 0,
        )
        for k, (x, y, z, s) in enumerate(rng.uniform(0.5, 9.0, (13, 4)))
    ]
    return _scene(Instance(0), *trees, meshes=(tree, soup))


def test_streams_look_ups_and_blocks_hold_the_bits_of_numpys_flat_arrays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(placed_triangles, "BATCH_TRIANGLES", 200)
    flat, world = place(_forest()), place(_forest(), copied_triangles=0)
    assert flat.is_flat
    assert not world.is_flat
    for threads, (whole, streamed) in enumerate(((flat, world), (flat.casters, world.casters)), start=1):
        expected = whole.vertices[whole.triangles]
        found, at, sizes = [], 0, []
        for batch in streamed.batches(Context(threads=threads)):
            assert batch.first_triangle == at == streamed.first_triangle[batch.first_instance]
            at += batch.triangle_count
            sizes.append(batch.triangle_count)
            found.append(batch.vertices.numpy()[batch.triangles.numpy().reshape(-1, 3)])  # a copy: fancy indexing
        assert max(sizes) <= 200
        assert len(sizes) > 3
        assert np.concatenate(found).tobytes() == expected.tobytes()
        numbers = np.random.default_rng(1).permutation(streamed.triangle_count)
        assert streamed.corners_of(numbers).tobytes() == expected[numbers].tobytes()
        assert whole.corners_of(numbers).tobytes() == expected[numbers].tobytes()
        assert _looked_up(streamed, numbers).tobytes() == expected[numbers].tobytes()
        assert _looked_up(whole, numbers).tobytes() == expected[numbers].tobytes()
        assert np.concatenate([b.corners for b in streamed.blocks(33)]).tobytes() == expected.tobytes()
        assert "_flattened" not in streamed.__dict__
        assert streamed.flat().vertices[streamed.triangles].tobytes() == expected.tobytes()
    np.testing.assert_array_equal(world.bounds(), bounds_of(flat.vertices))
    assert world.scale == float(np.abs(flat.vertices).max())


@wp.kernel
def _look_up(first: wp.int32, placed: PlacedTriangles, number: wp.array[wp.int32], corner: wp.array2d[wp.vec3]) -> None:
    i = wp.tid() + first
    a, b, c = corners_of(placed, number[i])
    corner[i, 0] = a
    corner[i, 1] = b
    corner[i, 2] = c


def _looked_up(placed: PlacedInstances, numbers: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    corner: Any = wp.empty((len(numbers), 3), dtype=wp.vec3, device="cpu")
    number = wp.array(numbers, dtype=wp.int32, device="cpu")
    launch(_look_up, len(numbers), [placed.lookup("cpu"), number], [corner], context=Context(threads=2))
    found: np.ndarray[Any, Any] = corner.numpy()
    return found


def test_streams_may_be_nested_and_left_early() -> None:
    world = place(_forest(), copied_triangles=0)
    context = Context()
    for outer in world.batches(context):
        kept = outer.vertices.numpy().copy()
        for _ in world.casters.batches(context):
            break
        np.testing.assert_array_equal(outer.vertices.numpy(), kept)


def test_device_arrays_hold_the_worlds_numbers_without_a_copy() -> None:
    world = place(_scene(Instance(0), Instance(1)))
    device = world.on("cpu")
    assert device.triangle_count == world.triangle_count
    np.testing.assert_array_equal(device.vertices.numpy(), world.vertices)
    assert device.vertices.ptr == world.vertices.ctypes.data
    assert world.on("cpu") is device
