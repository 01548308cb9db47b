"""The ground truth against closed forms, exact arithmetic, and the cases where simpler rules fail."""

import numpy as np
import pytest
from builders import box, square
from oracles import distance_from_ray, exact_blockers, is_behind_box, is_turned_away_exactly
from surfaces import (
    corners_of,
    grid,
    homogeneous,
    receivers_at,
    scattered_receivers,
    soup,
    sphere,
    world_of,
)

from shadowbench import reference
from shadowbench.device.launch import Context
from shadowbench.device.visibility import plane_tolerance
from shadowbench.errors import SceneError, ShadowbenchError
from shadowbench.light_space import is_in_field_of_view
from shadowbench.reference import SELF_HIT, hard_reference
from shadowbench.scene import DirectionalLight, PointLight, RectangularLight, SpotLight
from shadowbench.world import World

CONTEXT = Context()

LIGHTS = {
    "directional": DirectionalLight((0.4, 1.0, 0.3)),
    "spot": SpotLight((1.5, 4.0, 1.0), (-1.5, -4.0, -1.0), 50.0),
    "point": PointLight((0.2, 0.6, 0.1)),
}


def reference_of(world, receivers, light="directional", context=CONTEXT):
    return hard_reference(world, receivers, world.lights[light], context)


def on_ground(world: World, count: int, rng: np.random.Generator):
    """Receivers on the first two triangles of a world, a square."""
    return receivers_at(world, rng.integers(0, 2, count), rng.dirichlet((1.0, 1.0, 1.0), count))


@pytest.mark.parametrize("light", LIGHTS)
def test_every_receiver_of_a_soup_is_what_exact_arithmetic_says(light):
    rng = np.random.default_rng(1)
    world = world_of(soup(80, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 200, rng, on_edges=0.5)
    found = reference_of(world, receivers, light)
    placed, corners = world.lights[light], corners_of(world)
    numbers = homogeneous(placed)
    in_field = is_in_field_of_view(placed, receivers.position)
    np.testing.assert_array_equal(found.in_field, in_field)
    tolerance, length = plane_tolerance(world.scale), np.array(numbers[:3])
    shadowed = 0
    for i in np.flatnonzero(in_field):
        p = receivers.position[i]
        if is_turned_away_exactly(corners[receivers.triangle[i]], np.array(receivers.eye), numbers):
            assert (found.turned_away[i], found.visibility[i], found.blocker_distance[i]) == (True, 0.0, 0.0)
            assert found.blocker[i] == receivers.triangle[i]
            continue
        blockers = exact_blockers(p, corners, numbers, tolerance)
        assert not found.turned_away[i]
        assert found.visibility[i] == (0.0 if blockers else 1.0)
        if blockers:
            shadowed += 1
            nearest = min(blockers, key=lambda k: (blockers[k], k))
            assert found.blocker[i] == nearest
            distance = float(blockers[nearest]) * np.linalg.norm(length - numbers[3] * p.astype(np.float64))
            assert found.blocker_distance[i] == pytest.approx(distance, rel=1e-6)
        else:
            assert found.blocker[i] == -1
            assert np.isinf(found.blocker_distance[i])
    assert shadowed > 10


@pytest.mark.parametrize("light", ["directional", "spot", "above"])
def test_the_shadow_of_a_box_on_a_plane_is_its_closed_form(light):
    rng = np.random.default_rng(2)
    low, high = np.array((-0.5, 0.0, -0.5)), np.array((0.5, 1.0, 0.5))  # it stands on the ground
    lights = LIGHTS | {"above": PointLight((0.9, 1.4, 0.7))}
    world = world_of(square(3.0), box(tuple(low), tuple(high)), lights=lights)
    receivers = on_ground(world, 20_000, rng)
    found = reference_of(world, receivers, light)
    numbers = homogeneous(world.lights[light])
    inner, outer = (is_behind_box(receivers.position, low + e, high - e, numbers) for e in (1e-6, -1e-6))
    seen = found.in_field
    assert (seen & inner).sum() > 500
    assert (found.visibility[seen & inner] == 0.0).all()
    assert (found.visibility[seen & ~outer] == 1.0).all()
    assert (inner != outer).mean() < 0.01
    assert set(found.blocker[seen & inner]) <= set(range(2, 14))


@pytest.mark.parametrize("light", ["directional", "spot", "above"])
def test_the_shadow_of_a_sphere_on_a_plane_is_its_closed_form(light):
    rng = np.random.default_rng(3)
    centre, radius = np.array((0.1, 0.8, -0.2)), 0.5
    ball = sphere(4, centre, radius)
    lights = LIGHTS | {"above": PointLight((0.9, 2.4, 0.7))}
    world = world_of(square(3.0), ball, lights=lights)
    receivers = on_ground(world, 20_000, rng)
    found = reference_of(world, receivers, light)
    # the mesh lies between the sphere and the largest sphere within its faces
    corners = corners_of(world)[2:].astype(np.float64) - centre
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    within = np.abs((corners[:, 0] * normal).sum(axis=1) / np.linalg.norm(normal, axis=1)).min()
    distance = distance_from_ray(receivers.position, centre, homogeneous(world.lights[light]))
    seen = found.in_field
    assert 0.995 * radius < within < radius
    assert ((distance < within) & seen).sum() > 300
    assert (found.visibility[seen & (distance < within - 1e-6)] == 0.0).all()
    assert (found.visibility[seen & (distance > radius + 1e-6)] == 1.0).all()


def tilted(vertices, rng):
    """Vertices turned at random, so that rounding to float32 leaves no two faces exactly coplanar."""
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return (vertices @ axes.T).astype(np.float32), axes


@pytest.mark.parametrize("degrees", [0.1, 1.0, 30.0])
def test_a_tessellated_plane_lit_at_a_grazing_angle_does_not_shadow_itself(degrees):
    rng = np.random.default_rng(4)
    flat, triangles = grid(24, 1.0)
    vertices, axes = tilted(flat, rng)
    towards = axes @ (np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0)
    up = axes @ (0.0, 1.0, 0.0)
    world = world_of((vertices, triangles), lights={"low": DirectionalLight(tuple(towards))})
    receivers = scattered_receivers(world, 20_000, rng, on_edges=0.5)
    receivers = receivers_at(world, receivers.triangle, _barycentric(world, receivers), eye=tuple(3.0 * up))
    found = reference_of(world, receivers, "low")
    assert not found.turned_away.any()
    assert (found.visibility == 1.0).all()


def _barycentric(world, receivers):
    a, b, c = (corners_of(world)[receivers.triangle, k].astype(np.float64) for k in range(3))
    n = np.cross(b - a, c - a)
    p = receivers.position
    shares = [(np.cross(y - x, p - x) * n).sum(axis=1) for x, y in ((b, c), (c, a), (a, b))]
    return np.stack(shares, axis=1) / (n * n).sum(axis=1)[:, None]


def test_a_box_on_a_tessellated_plane_casts_its_long_shadow_at_a_tenth_of_a_degree():
    rng = np.random.default_rng(5)
    slope = np.tan(np.radians(0.1))
    light = DirectionalLight((1.0, slope, 0.0))
    low, high = np.array((0.9, 0.0, -0.25)), np.array((1.0, 0.001, 0.25))
    world = world_of(grid(24, 1.0), box(tuple(low), tuple(high)), lights={"low": light})
    receivers = receivers_at(world, rng.integers(0, 1152, 20_000), rng.dirichlet((1.0, 1.0, 1.0), 20_000))
    found = reference_of(world, receivers, "low")
    numbers = homogeneous(world.lights["low"])
    inner, outer = (is_behind_box(receivers.position, low + e, high - e, numbers) for e in (1e-5, -1e-5))
    assert (found.visibility[inner] == 0.0).all()
    assert (found.visibility[~outer] == 1.0).all()
    assert inner.sum() > 1000


def test_points_on_edges_and_vertices_of_a_closed_mesh_are_lit_where_they_face_the_light():
    # on a convex body nothing shadows anything; only what is turned away is dark
    rng = np.random.default_rng(6)
    ball = sphere(3, np.zeros(3), 1.0)
    light = DirectionalLight((0.3, 0.9, 0.2))
    world = world_of(ball, lights={"sun": light})
    receivers = scattered_receivers(world, 20_000, rng, on_edges=1.0)
    found = reference_of(world, receivers, "sun")
    normal = receivers.normal.astype(np.float64)
    outward = (normal * receivers.position).sum(axis=1) > 0.0
    facing = (normal @ world.lights["sun"].direction) > 1e-6
    assert (found.visibility[outward & facing] == 1.0).all()
    assert found.turned_away[outward & ~facing].mean() > 0.99
    assert (outward & facing).sum() > 4000


def test_a_duplicated_face_shadows_nothing_that_the_single_one_does_not():
    rng = np.random.default_rng(7)
    vertices, triangles = soup(300, rng)
    once = world_of((vertices, triangles), lights=LIGHTS)
    twice = world_of((vertices, triangles), (vertices.copy(), triangles[:, [1, 2, 0]]), lights=LIGHTS)
    receivers = scattered_receivers(once, 5000, rng, on_edges=0.3)
    for light in LIGHTS:
        single, double = reference_of(once, receivers, light), reference_of(twice, receivers, light)
        np.testing.assert_array_equal(single.visibility, double.visibility)
        np.testing.assert_array_equal(single.turned_away, double.turned_away)


def test_a_scene_far_from_the_origin_has_the_shadows_it_has_at_the_origin():
    rng = np.random.default_rng(8)
    vertices, triangles = soup(300, rng)
    here = world_of((vertices, triangles), lights=LIGHTS)
    shift = np.array((1e6, 3e6, -2e6))
    moved = {
        "directional": LIGHTS["directional"],
        "spot": SpotLight(tuple(shift + LIGHTS["spot"].position), LIGHTS["spot"].direction, LIGHTS["spot"].angle),
        "point": PointLight(tuple(shift + LIGHTS["point"].position)),
    }
    there = world_of((vertices.astype(np.float64) + shift, triangles), lights=moved)
    assert there.origin == tuple(shift)
    receivers = scattered_receivers(here, 5000, rng, on_edges=0.3)
    for light in LIGHTS:
        near, far = reference_of(here, receivers, light), reference_of(there, receivers, light)
        for name in ("visibility", "turned_away", "in_field", "blocker", "blocker_distance"):
            np.testing.assert_array_equal(getattr(near, name), getattr(far, name))


def test_the_same_bits_come_out_for_one_and_two_threads():
    rng = np.random.default_rng(9)
    world = world_of(soup(2000, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 20_000, rng, on_edges=0.1)
    for light in LIGHTS:
        one, two = (reference_of(world, receivers, light, Context(threads=n)) for n in (1, 2))
        for name in ("visibility", "turned_away", "in_field", "blocker", "blocker_distance"):
            np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


def test_what_does_not_cast_shadows_blocks_nothing_and_numbers_stay_those_of_the_world():
    lights = {"sun": DirectionalLight((0.0, 1.0, 0.0))}
    low_roof, high_roof = square(0.5, 1.0), square(1.0, 2.0)
    world = world_of(square(3.0), low_roof, high_roof, lights=lights, casts=(False, False, True))
    receivers = receivers_at(world, np.array([0, 0]), np.array([[0.5, 0.1, 0.4], [1.0, 0.0, 0.0]]))
    found = reference_of(world, receivers, "sun")
    np.testing.assert_array_equal(found.visibility, [0.0, 1.0])
    np.testing.assert_array_equal(found.blocker_distance, [2.0, np.inf])
    assert found.blocker[0] in (4, 5)
    assert found.blocker[1] == -1
    nothing_casts = world_of(square(3.0), low_roof, lights=lights, casts=(False, False))
    assert (reference_of(nothing_casts, receivers, "sun").visibility == 1.0).all()


def test_a_surface_seen_from_behind_is_dark_whatever_is_above_it():
    world = world_of(square(3.0), lights={"sun": DirectionalLight((0.0, 1.0, 0.0))})
    receivers = receivers_at(world, np.array([1]), np.array([[0.2, 0.3, 0.5]]), eye=(0.0, -2.0, 0.0))
    found = reference_of(world, receivers, "sun")
    assert (found.turned_away[0], found.visibility[0], found.blocker[0], found.blocker_distance[0]) == (True, 0, 1, 0)


def test_outside_a_spots_field_of_view_nothing_is_lit_and_nothing_blocks():
    lights = {"spot": SpotLight((0.0, 2.0, 0.0), (0.0, -1.0, 0.0), 40.0)}
    world = world_of(square(3.0), square(0.1, 1.0), lights=lights)
    receivers = receivers_at(world, np.array([0, 0]), np.array([[1.0, 0.0, 0.0], [0.5, 0.0, 0.5]]))
    found = reference_of(world, receivers, "spot")
    np.testing.assert_array_equal(found.in_field, [False, True])
    np.testing.assert_array_equal(found.visibility, [0.0, 0.0])
    np.testing.assert_array_equal(found.blocker >= 0, [False, True])
    np.testing.assert_array_equal(found.blocker_distance, [np.inf, 1.0])


def test_two_sheets_closer_than_the_tolerance_do_not_shadow_each_other():
    lights = {"sun": DirectionalLight((0.2, 1.0, 0.1))}
    delta = plane_tolerance(4.0)
    for gap, visibility in ((0.5 * delta, 1.0), (2.0 * delta, 0.0)):
        world = world_of(square(4.0), square(4.0, gap), lights=lights)
        receivers = receivers_at(world, np.array([0]), np.array([[0.3, 0.3, 0.4]]))
        assert reference_of(world, receivers, "sun").visibility[0] == visibility


def test_area_lights_are_refused_in_one_line():
    receivers = receivers_at(world_of(square(1.0), lights=LIGHTS), np.array([0]), np.array([[1.0, 0.0, 0.0]]))
    panel = {"panel": RectangularLight((0.0, 2.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))}
    lit_by_panel = world_of(square(1.0), lights=panel)
    with pytest.raises(SceneError, match="area"):
        reference_of(lit_by_panel, receivers, "panel")


def test_a_million_degenerate_triangles_block_nothing():
    corner, on_corner = np.array([[0.0, 1.0, 0.0]], np.float32), np.zeros((1_000_000, 3), np.int32)
    world = world_of(square(1.0), (corner, on_corner), lights={"sun": DirectionalLight((0.0, 1.0, 0.0))})
    receivers = receivers_at(world, np.array([0, 1]), np.array([[0.5, 0.0, 0.5], [0.3, 0.3, 0.4]]))
    np.testing.assert_array_equal(receivers.position[0], [0.0, 0.0, 0.0])
    assert (reference_of(world, receivers, "sun").visibility == 1.0).all()


def test_the_rule_has_a_name_and_is_told():
    assert SELF_HIT == "plane"
    assert reference.__doc__ is not None
    for word in ("turned away", "edges and\n   vertices", "16 ulp", "Limits"):
        assert word in reference.__doc__


@pytest.mark.parametrize("transmittance", [(0.0, 0.0, 0.0), (0.5, 0.75, 0.25)])
@pytest.mark.parametrize("light", LIGHTS)
def test_many_receivers_are_decided_as_few_are(light, transmittance, monkeypatch):
    """By the rasteriser, block by block, with rays as its check."""
    rng = np.random.default_rng(21)
    world = world_of(soup(300, rng), lights=LIGHTS, transmittance=transmittance)
    receivers = scattered_receivers(world, 3000, rng, on_edges=0.3)
    by_rays = reference_of(world, receivers, light)
    monkeypatch.setattr(reference, "MANY", 1000)
    rasterized = reference_of(world, receivers, light, Context(threads=2))
    np.testing.assert_array_equal(rasterized.visibility, by_rays.visibility)
    np.testing.assert_array_equal(rasterized.turned_away, by_rays.turned_away)
    dimmed = by_rays.visibility.reshape(3000, -1).min(axis=1) < 1.0
    np.testing.assert_array_equal(rasterized.blocker[dimmed], by_rays.blocker[dimmed])
    np.testing.assert_array_equal(rasterized.blocker_distance[dimmed], by_rays.blocker_distance[dimmed])


def test_a_rasteriser_that_is_wrong_is_found_out_by_the_rays(monkeypatch):
    rng = np.random.default_rng(22)
    world = world_of(soup(100, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 2000, rng)
    monkeypatch.setattr(reference, "MANY", 1000)

    class Optimist(reference.PointVisibility):
        def ask(self, position, visibility):
            visibility.fill_(1.0)

    monkeypatch.setattr(reference, "PointVisibility", Optimist)
    with pytest.raises(ShadowbenchError, match="disagree"):
        reference_of(world, receivers)
