"""The grove: the paper's count of instances and triangles, one mesh, and trees that stand in the ground."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scene_geometry import assert_lights_are_usable, corners_of, digest, made, shares_seen, smallest_area

from shadowbench.errors import ParameterError
from shadowbench.parameters import parse_parameters
from shadowbench.scene import DirectionalLight, Scene
from shadowbench.scenes.grove import GROUND_CELLS, SCALES, SINK, SPACING, TREE_HEIGHT, Grove
from shadowbench.world import World, bounds_of, place

GROUND_TRIANGLES = 18_432


@pytest.fixture(scope="module")
def world() -> World:
    return place(made(Grove, instances=12, triangles=3000))


def _casting(scene: Scene) -> int:
    return sum(scene.meshes[i.mesh].triangle_count for i in scene.instances if i.casts)


def test_the_default_grove_has_the_papers_trees_and_triangles_and_a_ground_counted_apart() -> None:
    scene = made(Grove)
    assert len(scene.instances) == 105 + 1
    assert scene.meshes[0].triangle_count == 36_000
    assert _casting(scene) == 3_780_000
    assert scene.triangle_count == 3_780_000 + GROUND_TRIANGLES
    assert scene.meshes[1].triangle_count == GROUND_TRIANGLES == 2 * GROUND_CELLS**2


@pytest.mark.parametrize(("instances", "triangles"), [(1, 1000), (1, 360_000), (10, 1001), (1000, 36_000)])
def test_every_number_of_trees_and_of_triangles_is_met_exactly(instances: int, triangles: int) -> None:
    scene = made(Grove, instances=instances, triangles=triangles)
    assert _casting(scene) == instances * triangles
    assert len(scene.meshes) == 2, "the tree is one mesh, however often it stands there"


def test_only_the_ground_does_not_cast(world: World) -> None:
    assert [i.casts for i in world.instances] == [True] * 12 + [False]
    assert all(i.receives for i in world.instances)
    assert world.casters.triangle_count == 12 * 3000
    assert world.casters.is_opaque


def test_instances_differ_by_translation_by_one_scale_and_by_any_angle_about_the_vertical() -> None:
    trees = made(Grove).instances[:-1]
    assert {tree.mesh for tree in trees} == {0}
    assert {tree.rotation.axis for tree in trees} == {(0.0, 1.0, 0.0)}
    angles = np.array([tree.rotation.angle for tree in trees])
    assert 0.0 <= angles.min() < 20.0
    assert 340.0 < angles.max() < 360.0
    assert (np.abs(angles / 30.0 - np.round(angles / 30.0)) > 1e-3).all(), "none happens to be a step of the paper's"
    scales = np.array([tree.scale for tree in trees])
    assert (scales == scales[:, :1]).all()
    assert SCALES[0] <= scales.min() < scales.max() < SCALES[1]
    assert len({tree.albedo for tree in trees}) == 105


def test_a_smaller_grove_is_the_middle_of_a_larger_one() -> None:
    few, many = made(Grove, instances=10, triangles=1000), made(Grove, instances=200, triangles=1000)
    assert few.instances[:10] == many.instances[:10]
    assert (few.meshes[0].vertices == many.meshes[0].vertices).all()
    finer = made(Grove, instances=10, triangles=2000)
    assert finer.instances[:10] == few.instances[:10]
    assert finer.cameras == few.cameras


def test_the_same_seed_gives_the_same_bits_whatever_was_drawn_elsewhere() -> None:
    before = digest(made(Grove, seed=7))
    np.random.default_rng(7).random(10)
    assert digest(made(Grove, seed=7)) == before
    assert digest(made(Grove, seed=8)) != before


def test_no_triangle_is_degenerate(world: World) -> None:
    assert smallest_area(world) > 1e-6
    assert smallest_area(place(made(Grove, instances=1, triangles=360_000))) > 1e-8


def _ground_height(world: World, x: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Height of the placed ground at places, from the triangle above or below each."""
    mesh = world.vertices[np.unique(world.triangles[world.first_triangle[-2] :])].astype(np.float64)
    grid = mesh.reshape(GROUND_CELLS + 1, GROUND_CELLS + 1, 3)
    column, row = (
        (at - grid[0, 0, k]) / (grid[-1, -1, k] - grid[0, 0, k]) * GROUND_CELLS for at, k in ((x, 0), (z, 2))
    )
    i, j = row.astype(int), column.astype(int)
    s, t = row - i, column - j
    a, b, c, d = (grid[i + di, j + dj, 1] for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)))
    # split from (row, column) to (row + 1, column + 1)
    return np.where(s > t, a + s * (b - a) + t * (c - b), a + t * (d - a) + s * (c - d))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_trunks_stand_in_the_ground_all_round_and_are_not_buried(seed: int) -> None:
    scene = made(Grove, triangles=1000, seed=seed)
    world = place(scene)
    tree = scene.meshes[0].vertices
    foot = tree[tree[:, 1] < -0.9 * SINK]
    assert len(foot) >= 4
    for k, instance in enumerate(world.instances[:-1]):
        matrix = instance.matrix()
        corners = foot.astype(np.float64) @ matrix[:, :3].T + matrix[:, 3]
        ground = _ground_height(world, corners[:, 0], corners[:, 2])
        assert (corners[:, 1] < ground - 0.02).all(), k
        middle = _ground_height(world, *(np.array([instance.translation[axis]]) for axis in (0, 2)))
        assert abs(middle[0] - instance.translation[1]) < 0.15, k


@pytest.mark.parametrize("seed", [1, 2])
def test_trees_keep_their_distance(seed: int) -> None:
    at = np.array([i.translation for i in made(Grove, instances=1000, triangles=1000, seed=seed).instances[:-1]])
    apart = np.linalg.norm(at[:, None, [0, 2]] - at[None, :, [0, 2]], axis=2)
    apart[np.diag_indices(len(at))] = np.inf
    assert apart.min() > 0.5 * SPACING
    assert apart.min(axis=1).max() < 1.5 * SPACING


def test_hills_are_gentle(world: World) -> None:
    corners = corners_of(place(made(Grove, triangles=1000)), "ground")
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    up = normal[:, 1] / np.linalg.norm(normal, axis=1)
    assert up.min() > np.cos(np.radians(25.0)), "so steep that the sun never leaves any of it"
    assert np.ptp(corners[..., 1]) > 1.5, "and yet not flat"


@pytest.mark.parametrize(("instances", "seed"), [(1, 1), (12, 1), (105, 1), (105, 2)])
def test_the_near_camera_stands_within_the_first_trees_shadow_volume(instances: int, seed: int) -> None:
    world = place(made(Grove, instances=instances, triangles=1000, seed=seed))
    sun = world.lights["sun"]
    assert isinstance(sun, DirectionalLight)
    eye, towards = np.array(world.cameras["near"].eye), np.array(sun.direction)
    low, high = bounds_of(world.vertices[world.triangles[: world.first_triangle[1]]].reshape(-1, 3))
    # the ray from the eye to the sun passes through the tree's box
    enter, leave = np.sort([(low - eye) / towards, (high - eye) / towards], axis=0)
    assert max(enter.max(), 0.0) < leave.min()
    crown = world.vertices[world.triangles[: world.first_triangle[1]]].reshape(-1, 3)
    beside = crown - eye - ((crown - eye) @ towards)[:, None] * towards
    assert np.linalg.norm(beside, axis=1).min() < 0.5, "and close by some leaf or branch"
    ground = _ground_height(world, eye[:1], eye[2:])
    assert eye[1] - ground[0] == pytest.approx(1.7, abs=0.1)


@pytest.mark.parametrize("instances", [1, 12, 105])
def test_lights_come_from_above_and_reach_the_trees(instances: int) -> None:
    assert_lights_are_usable(place(made(Grove, instances=instances, triangles=1000)))


@pytest.mark.parametrize("instances", [1, 12, 105])
@pytest.mark.parametrize("camera", ["overview", "near", "far"])
def test_cameras_see_light_and_shadow(instances: int, camera: str) -> None:
    share, lit, shadowed = shares_seen(place(made(Grove, instances=instances, triangles=1000)), camera)
    assert share > 0.15
    assert lit > 0.3
    assert shadowed > 0.02


def test_the_far_camera_sees_trees_smaller_than_the_overview_does(world: World) -> None:
    assert list(world.cameras) == ["overview", "near", "far"]
    overview, far = (np.linalg.norm(world.cameras[name].eye) for name in ("overview", "far"))
    assert far > 1.8 * overview


def test_the_tree_has_its_height_above_the_ground() -> None:
    mesh = made(Grove, instances=1).meshes[0]
    assert mesh.vertices[:, 1].max() == pytest.approx(TREE_HEIGHT, abs=1e-5)
    assert mesh.vertices[:, 1].min() == pytest.approx(-SINK, abs=1e-5)


@pytest.mark.parametrize(
    "values", [{"instances": 0}, {"instances": 1001}, {"triangles": 999}, {"triangles": 360_001}, {"seed": -1}]
)
def test_parameters_outside_their_range_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(ParameterError, match=next(iter(values))):
        parse_parameters(Grove.Parameters, values, owner="scene 'grove'")
