"""The exact predicate: against integer arithmetic, and case by case."""

import numpy as np
import pytest
import warp as wp
from oracles import exact_blockers, is_turned_away_exactly

from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.visibility import (
    LightPoint,
    crossing,
    is_turned_away,
    light_point,
    plane_tolerance,
    reach_to_light,
    towards_light,
)
from shadowbench.errors import SceneError
from shadowbench.scene import DirectionalLight, PointLight, RectangularLight, SpotLight

wp.set_module_options(kernel_options(native=True))


@wp.kernel
def cross_pairs(
    first: wp.int32,
    light: LightPoint,
    tolerance: wp.float64,
    point: wp.array[wp.vec3],
    corner: wp.array2d[wp.vec3],
    parameter: wp.array[wp.float64],
):
    i = wp.tid() + first
    p = wp.vec3d(point[i])
    parameter[i] = crossing(
        p, towards_light(light, p), reach_to_light(light, p), tolerance, corner[i, 0], corner[i, 1], corner[i, 2]
    )


@wp.kernel
def turn_pairs(
    first: wp.int32, light: LightPoint, eye: wp.vec3d, corner: wp.array2d[wp.vec3], away: wp.array[wp.int32]
):
    i = wp.tid() + first
    away[i] = wp.int32(is_turned_away(corner[i, 0], corner[i, 1], corner[i, 2], eye, light))


def parameters(light, points, corners, tolerance=0.0):
    """The crossing of the ray from each point with the triangle of the same number."""
    points = np.ascontiguousarray(np.broadcast_to(np.asarray(points, np.float32), (len(corners), 3)))
    found = wp.empty(len(points), dtype=wp.float64, device="cpu")
    inputs = [
        light_point(light),
        tolerance,
        wp.array(points, dtype=wp.vec3, device="cpu"),
        wp.array(np.asarray(corners, np.float32), dtype=wp.vec3, device="cpu"),
    ]
    launch(cross_pairs, len(points), inputs, [found], context=Context())
    return found.numpy()


UP = DirectionalLight((0.0, 1.0, 0.0))
ABOVE = np.array([[[-1, 1, -1], [1, 1, -1], [0, 1, 1]]], np.float32)


def test_a_crossing_is_a_blocker_of_exact_arithmetic_with_its_parameter():
    rng = np.random.default_rng(3)
    corners = rng.uniform(-1.0, 1.0, (4000, 3, 3)).astype(np.float32)
    point = np.zeros(3, np.float32)
    for light, w in ((DirectionalLight((0.25, 0.5, -0.75)), 0.0), (PointLight((0.5, 0.25, 0.125)), 1.0)):
        numbers = (light.direction if w == 0.0 else light.position) + (w,)
        expected = exact_blockers(point, corners, numbers, 0.05)
        found = parameters(light, point, corners, 0.05)
        assert 50 < len(expected) == (found > 0.0).sum()
        assert set(np.flatnonzero(found > 0.0)) == set(expected)
        assert max(abs(found[k] - float(t)) for k, t in expected.items()) < 1e-12


def test_no_product_is_fused_with_a_sum():
    rng = np.random.default_rng(4)
    direction = (0.5, 0.75, 0.25)
    corners = rng.uniform(-1.0, 1.0, (5000, 3, 3)).astype(np.float32)
    points = rng.uniform(-1.0, 1.0, (5000, 3)).astype(np.float32)
    found = parameters(DirectionalLight(direction), points, corners)
    a, b, c = (corners[:, k].astype(np.float64) for k in range(3))

    def cross(x, y):
        return np.stack(
            [
                x[:, 1] * y[:, 2] - x[:, 2] * y[:, 1],
                x[:, 2] * y[:, 0] - x[:, 0] * y[:, 2],
                x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0],
            ],
            axis=1,
        )

    def dot(x, y):
        return x[:, 0] * y[:, 0] + x[:, 1] * y[:, 1] + x[:, 2] * y[:, 2]

    n = cross(b - a, c - a)
    with np.errstate(divide="ignore"):
        expected = dot(n, a - points.astype(np.float64)) / dot(n, np.tile(direction, (5000, 1)))
    hit = found > 0.0
    assert hit.sum() > 100
    np.testing.assert_array_equal(found[hit], expected[hit])


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 1, 0)], ids=["one way", "turned", "the other way"])
def test_rays_through_edges_and_vertices_cross_everything_that_meets_there(order):
    # a fan of eight triangles around (0, 1, 0) on a grid of exact numbers
    rim = np.array([[4, 0], [4, 4], [0, 4], [-4, 4], [-4, 0], [-4, -4], [0, -4], [4, -4]], np.float32)
    rim = np.insert(rim, 1, 1.0, axis=1)
    fan = np.stack([np.tile(np.float32([0, 1, 0]), (8, 1)), rim, np.roll(rim, -1, axis=0)], axis=1)[:, order]
    assert (parameters(UP, (0.0, 0.0, 0.0), fan) == 1.0).all()
    for k in range(8):
        on_edge = rim[k] * np.float32(0.5)
        on_edge[1] = 0.0
        crossed = parameters(UP, on_edge, fan) > 0.0
        assert set(np.flatnonzero(crossed)) == {k, (k - 1) % 8}


def test_one_of_two_triangles_at_an_edge_is_always_crossed():
    rng = np.random.default_rng(5)
    a, b, c, d = rng.uniform(-1.0, 1.0, (4, 20_000, 3)).astype(np.float32)
    share = rng.random((20_000, 1))
    on_edge = a + share * (b - a)
    light = DirectionalLight((0.123, 0.987, -0.321))
    # the opposite corners lie on both sides of the plane through the ray and the edge
    side = np.cross(b - a, light.direction)
    c, d = (np.where(((x - a) * side).sum(axis=1, keepdims=True) * s < 0, 2 * a - x, x) for x, s in ((c, 1), (d, -1)))
    points = (on_edge - 2.0 * np.asarray(light.direction)).astype(np.float32)
    near = np.stack([a, b, c], axis=1).astype(np.float32)
    far = np.stack([b, a, d], axis=1).astype(np.float32)
    assert ((parameters(light, points, near) > 0.0) | (parameters(light, points, far) > 0.0)).all()


def test_a_plane_within_the_tolerance_is_the_own_surface():
    assert parameters(UP, (0.0, 0.5, 0.0), ABOVE, tolerance=0.5)[0] < 0.0
    assert parameters(UP, (0.0, 0.5, 0.0), ABOVE, tolerance=0.4999)[0] == 0.5


def test_the_tolerance_is_measured_from_the_plane_and_not_along_the_ray():
    grazing = DirectionalLight((1.0, 0.001, 0.0))
    roof = np.array([[[50, 0.1, -50], [150, 0.1, -50], [100, 0.1, 50]]], np.float32)
    assert parameters(grazing, (0.0, 0.0, 0.0), roof, tolerance=0.09)[0] == pytest.approx(100.0)
    assert parameters(grazing, (0.0, 0.0, 0.0), roof, tolerance=0.11)[0] < 0.0


def test_what_lies_behind_the_point_or_beyond_the_light_does_not_count():
    assert parameters(UP, (0.0, 2.0, 0.0), ABOVE)[0] < 0.0
    assert parameters(PointLight((0.0, 0.5, 0.0)), (0.0, 0.0, 0.0), ABOVE)[0] < 0.0
    assert parameters(PointLight((0.0, 1.0, 0.0)), (0.0, 0.0, 0.0), ABOVE)[0] < 0.0  # the light is in its plane
    assert parameters(PointLight((0.0, 2.0, 0.0)), (0.0, 0.0, 0.0), ABOVE)[0] == 0.5


@pytest.mark.parametrize(
    "light",
    [
        PointLight((1.0, 2.0, 0.0), near=0.75),
        SpotLight((1.0, 2.0, 0.0), (-1.0, -2.0, 0.0), near=0.75 * 5.0**0.5 / 2.0),
    ],
    ids=["point", "spot"],
)
def test_nothing_casts_before_the_near_plane(light):
    # rays from the origin meet y = h at planar distance 2 - h of 2 from the light, or as much along the spot's axis
    def roof(height):
        return np.array([[[-9, height, -9], [9, height, -9], [0, height, 9]]], np.float32)

    assert parameters(light, (0.0, 0.0, 0.0), roof(1.2))[0] > 0.0
    assert parameters(light, (0.0, 0.0, 0.0), roof(1.3))[0] < 0.0


def test_triangles_seen_edge_on_or_without_area_are_never_crossed():
    edge_on = [[0, 1, -1], [0, 3, -1], [0, 2, 1]]
    point_like = [[0, 1, 0]] * 3
    needle = [[-1, 1, 0], [0, 1, 0], [1, 1, 0]]
    assert (parameters(UP, (0.0, 0.0, 0.0), [edge_on, point_like, needle]) < 0.0).all()


def test_a_surface_is_turned_away_if_its_plane_parts_eye_and_light():
    rng = np.random.default_rng(6)
    corners = rng.integers(-8, 9, (3000, 3, 3)).astype(np.float32)  # many planes pass through the eye or the light
    eye = (1.0, 2.0, 3.0)
    for light in (DirectionalLight((1.0, 2.0, -1.0)), PointLight((2.0, 2.0, 2.0))):
        away = wp.empty(len(corners), dtype=wp.int32, device="cpu")
        inputs = [light_point(light), wp.vec3d(*eye), wp.array(corners, dtype=wp.vec3, device="cpu")]
        launch(turn_pairs, len(corners), inputs, [away], context=Context())
        numbers = (*light.direction, 0.0) if isinstance(light, DirectionalLight) else (*light.position, 1.0)
        expected = [is_turned_away_exactly(t, np.array(eye), numbers) for t in corners]
        np.testing.assert_array_equal(away.numpy().astype(bool), expected)


def test_the_tolerance_is_sixteen_ulps_of_the_scene():
    assert plane_tolerance(4.0) == 16 * np.spacing(np.float32(4.0))


def test_an_area_light_is_no_point():
    with pytest.raises(SceneError, match="area"):
        light_point(RectangularLight((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
