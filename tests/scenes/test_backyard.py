"""The backyard: its count of triangles, the same bits every time, and nothing that floats or that no camera sees."""

from __future__ import annotations

import numpy as np
import pytest
from scene_geometry import (
    areas,
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
from shadowbench.scenes.backyard import BUSHES, LEAST_TRIANGLES, PATIO_TOP, Backyard
from shadowbench.world import World, place

GREEN = (
    "tree leaves",
    "vine leaves",
    "potted plants 1",
    "potted plants 2",
    "bushes 1",
    "bushes 2",
    "vegetables",
    "grass",
)


@pytest.fixture(scope="module")
def world() -> World:
    return place(made(Backyard))


def test_the_default_yard_has_the_stated_number_of_triangles(world: World) -> None:
    assert world.triangle_count == 150_000
    assert "150,000 triangles" in (__import__(Backyard.__module__, fromlist=["x"]).__doc__ or "")


@pytest.mark.parametrize("triangles", [LEAST_TRIANGLES, 60_001, 100_003, 400_000])
def test_every_number_of_triangles_is_met_exactly(triangles: int) -> None:
    scene = made(Backyard, triangles=triangles)
    assert scene.triangle_count == triangles
    assert smallest_area(place(scene)) > 0.0


def test_more_triangles_are_more_and_smaller_leaves_of_the_same_area(world: World) -> None:
    finer = place(made(Backyard, triangles=400_000))
    for name in GREEN[:-1]:
        few, many = corners_of(world, name), corners_of(finer, name)
        assert len(many) > 2.5 * len(few)
        assert areas(many).sum() == pytest.approx(areas(few).sum(), rel=0.1)
    assert finer.triangle_count - 400_000 == 0
    rigid = {mesh.name: mesh.triangle_count for mesh in world.meshes if mesh.name not in GREEN and mesh.name != "tree"}
    assert rigid == {m.name: m.triangle_count for m in finer.meshes if m.name not in GREEN and m.name != "tree"}


def test_the_same_seed_gives_the_same_bits_whatever_was_drawn_elsewhere() -> None:
    before = digest(made(Backyard, seed=7))
    np.random.default_rng(7).random(10)
    assert digest(made(Backyard, seed=7)) == before
    assert digest(made(Backyard, seed=8)) != before


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_no_triangle_is_degenerate(seed: int) -> None:
    assert smallest_area(place(made(Backyard, seed=seed))) > 1e-6


def test_what_stands_on_the_ground_touches_it_and_what_stands_on_the_patio_touches_that(world: World) -> None:
    low = lowest(world)
    on_the_lawn = ("house walls", "bench", "parasol pole", "side table", "kennel", "ball", "raised bed", "fence")
    for name in (*on_the_lawn, "stepping stone", "house stones", "washing line", "grass", "paving 1"):
        assert low[name] == pytest.approx([0.0] * len(low[name]), abs=1e-6), name
    for name in ("table", "chair", "pot", "watering can", "pergola"):
        assert low[name] == pytest.approx([PATIO_TOP] * len(low[name]), abs=1e-6), name
    # feet of leaning things are cut at right angles to their length, so that an edge of them goes in
    for name in ("deck chair", "ladder"):
        assert -0.025 < low[name][0] <= 0.0, name
    assert low["tree"] == pytest.approx([-0.1])
    assert low["crate"] == pytest.approx([PATIO_TOP, PATIO_TOP + 0.36, PATIO_TOP])
    for name in ("bowl", "bottle", "glass"):
        assert low[name] == pytest.approx([PATIO_TOP + 0.74] * len(low[name])), name


def test_things_do_not_stand_in_each_other(world: World) -> None:
    standing = ("house walls", "table", "pot", "kennel", "raised bed", "bench", "ball", "side table", "watering can")
    overlaps = overlaps_in_plan(world, (*standing, "fence"), [(b.x, b.z, 0.9 * b.radius) for b in BUSHES])
    assert set(overlaps) == {"fence and fence"}, "only panels of the fence, which share their posts"


def test_leaves_hang_on_wood(world: World) -> None:
    wood = corners_of(world, "tree").reshape(-1, 3)
    bases = corners_of(world, "tree leaves")[::100, 0]
    distance = np.array([np.sqrt(((wood - base) ** 2).sum(axis=1).min()) for base in bases])
    assert distance.max() < 0.6
    assert np.median(distance) < 0.1


def test_everything_is_inside_the_fence_and_nothing_is_below_the_lawn_but_the_trees_foot(world: World) -> None:
    low, high = world.bounds()
    np.testing.assert_allclose(low, [-12.0, -0.1, -13.0], atol=1e-6)
    np.testing.assert_allclose([high[0], high[2]], [12.0, 11.0], atol=1e-6)
    assert high[1] == pytest.approx(7.0)


def test_everything_casts_receives_and_is_opaque(world: World) -> None:
    assert all(instance.casts and instance.receives for instance in world.instances)
    assert world.casters.is_opaque
    assert len({instance.albedo for instance in world.instances}) > 15


def test_lights_come_from_above_and_reach_the_yard(world: World) -> None:
    assert_lights_are_usable(world)


@pytest.mark.parametrize(
    ("camera", "covered", "least_lit", "least_shadowed"),
    [("overview", 0.7, 0.5, 0.1), ("contact", 1.0, 0.2, 0.4), ("layers", 0.95, 0.3, 0.3), ("grazing", 0.6, 0.3, 0.1)],
)
def test_cameras_see_light_and_shadow(
    world: World, camera: str, covered: float, least_lit: float, least_shadowed: float
) -> None:
    share, lit, shadowed = shares_seen(world, camera)
    assert share >= covered
    assert lit >= least_lit
    assert shadowed >= least_shadowed


def test_the_overview_is_the_default_and_the_grazing_view_runs_along_the_lawn(world: World) -> None:
    assert list(world.cameras) == ["overview", "contact", "layers", "grazing"]
    grazing = world.cameras["grazing"]
    assert grazing.eye[1] < 1.0
    assert grazing.eye[2] - world.bounds()[0][2] > 20.0


@pytest.mark.parametrize("values", [{"triangles": 59_999}, {"triangles": 4_000_001}, {"seed": -1}, {"seed": 2**32}])
def test_parameters_outside_their_range_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(ParameterError, match=next(iter(values))):
        parse_parameters(Backyard.Parameters, values, owner="scene 'backyard'")
