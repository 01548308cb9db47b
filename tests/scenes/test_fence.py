"""The fence scene: the paper's count of triangles, wires that hook into each other, nothing that floats."""

from __future__ import annotations

import numpy as np
import pytest
from scene_geometry import (
    assert_lights_are_usable,
    corners_of,
    digest,
    lowest,
    made,
    overlaps_in_plan,
    shares_seen,
    smallest_area,
)

from shadowbench.errors import ParameterError
from shadowbench.parameters import parse_parameters
from shadowbench.scenes.fence import BUSHES, LEAST_TRIANGLES, WALL_Z, WIRE_HEIGHT, WIRE_Z, Fence
from shadowbench.scenes.sunflowers import PETALS, Sunflowers
from shadowbench.scenes.uniform_draws import UniformDraws
from shadowbench.world import World, place

GREEN = ("sunflower leaves", "potted plants", "bushes", "creepers", "tall grass", "lawn")


@pytest.fixture(scope="module")
def world() -> World:
    return place(made(Fence))


def test_the_default_scene_has_the_papers_number_of_faces(world: World) -> None:
    assert world.triangle_count == 365_000
    rigid = sum(world.meshes[i.mesh].triangle_count for i in world.instances if world.meshes[i.mesh].name not in GREEN)
    assert rigid < LEAST_TRIANGLES / 2


@pytest.mark.parametrize("triangles", [LEAST_TRIANGLES, 365_001, 365_002, 1_000_000])
def test_every_number_of_triangles_is_met_exactly(triangles: int) -> None:
    scene = made(Fence, triangles=triangles)
    assert scene.triangle_count == triangles
    assert smallest_area(place(scene)) > 0.0


def test_the_same_seed_gives_the_same_bits_whatever_was_drawn_elsewhere() -> None:
    before = digest(made(Fence, seed=7))
    np.random.default_rng(7).random(10)
    assert digest(made(Fence, seed=7)) == before
    assert digest(made(Fence, seed=8)) != before


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_no_triangle_is_degenerate(seed: int) -> None:
    assert smallest_area(place(made(Fence, seed=seed))) > 1e-6


def test_everything_stands_on_the_ground(world: World) -> None:
    low = lowest(world)
    for name in ("mortar", "wire post", "fence", "gate", "gate post", "bench", "pot", "crate", "tall grass", "lawn"):
        assert low[name] == pytest.approx([0.0] * len(low[name]), abs=1e-6), name
    assert -0.02 < min(low["ladder"] + low["stems"] + low["sunflower stems"]) <= 0.0
    bricks = min(low["bricks 1"] + low["bricks 2"] + low["bricks 3"])
    assert 0.0 < bricks < 0.01, "the lowest course begins half a joint up"


def test_things_do_not_stand_in_each_other(world: World) -> None:
    standing = ("mortar", "wires", "bench", "crate", "pot", "watering can", "gate")
    assert overlaps_in_plan(world, standing, [(b.x, b.z, b.radius) for b in BUSHES]) == []


def test_neighbouring_wires_cross_without_touching_where_they_hook_into_each_other(world: World) -> None:
    mesh = corners_of(world, "wires").reshape(-1, 3)
    bends = mesh[np.abs(mesh[:, 1] % 0.08 - 0.04) < 0.003]  # within the wires' thickness of a row of bends
    assert np.ptp(mesh[:, 1]) > WIRE_HEIGHT - 0.05
    behind, before = bends[bends[:, 2] < WIRE_Z], bends[bends[:, 2] > WIRE_Z]
    assert len(behind) > 10_000
    assert len(before) > 10_000
    # two wires meet in each bend, one on either side of the fence's plane
    columns = [set(np.round(side[:, 0] / 0.08 - 0.5).astype(int)) for side in (behind, before)]
    assert len(columns[0] & columns[1]) > 140


def test_wires_and_bricks_throw_their_shadows_close_by(world: World) -> None:
    assert 0.5 < WIRE_Z - WALL_Z < 1.0
    bricks = corners_of(world, "bricks 1", "bricks 2", "bricks 3")
    assert bricks[..., 2].max() - WALL_Z == pytest.approx(0.012, abs=1e-6)


def test_sunflowers_face_the_sun_on_stems_in_their_bed() -> None:
    flowers = Sunflowers(UniformDraws(1), 16, (-5.0, 5.0), (-3.0, -2.0))
    stems, petals, hearts = flowers.stems(), flowers.petals(), flowers.hearts()
    assert stems.triangle_count == 16 * 96
    assert petals.triangle_count == 16 * 4 * PETALS
    assert hearts.triangle_count == 16 * 32
    corners = petals.points[petals.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0.0).all()
    tops = stems.points.reshape(16, 9, 6, 3)[:, -1].mean(axis=1)
    middles = hearts.points.reshape(16, 18, 3).mean(axis=1)
    assert np.linalg.norm(tops - middles, axis=1).max() < 0.05
    roots = stems.points.reshape(16, 9, 6, 3)[:, 0].mean(axis=1)
    assert np.abs(roots[:, 1]).max() < 1e-12
    assert (np.diff(roots[:, 0]) > 0.2).all()


def test_everything_casts_receives_and_is_opaque(world: World) -> None:
    assert all(instance.casts and instance.receives for instance in world.instances)
    assert world.casters.is_opaque


def test_lights_come_from_above_and_reach_the_garden(world: World) -> None:
    assert_lights_are_usable(world)


@pytest.mark.parametrize(
    ("camera", "covered", "least_lit", "least_shadowed"),
    [("overview", 0.7, 0.5, 0.15), ("wires", 0.9, 0.3, 0.3), ("contact", 0.8, 0.5, 0.1), ("grazing", 0.5, 0.2, 0.4)],
)
def test_cameras_see_light_and_shadow(
    world: World, camera: str, covered: float, least_lit: float, least_shadowed: float
) -> None:
    share, lit, shadowed = shares_seen(world, camera)
    assert share >= covered
    assert lit >= least_lit
    assert shadowed >= least_shadowed


@pytest.mark.parametrize("values", [{"triangles": 99_999}, {"triangles": 4_000_001}, {"seed": -1}])
def test_parameters_outside_their_range_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(ParameterError, match=next(iter(values))):
        parse_parameters(Fence.Parameters, values, owner="scene 'fence'")
