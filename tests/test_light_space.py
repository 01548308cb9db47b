"""Light-space frames against hand-computed windows: directions, depths, texels, cube faces, pixel rays."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from builders import box, square
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from shadowbench.errors import SceneError
from shadowbench.light_space import (
    CUBE_AXES,
    axes_of,
    camera_frame,
    cube_face_of,
    is_in_field_of_view,
    light_frames,
    orthographic_frame,
    perspective_frame,
)
from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Light,
    Mesh,
    PointLight,
    RectangularLight,
    Scene,
    SpotLight,
    Vector,
)
from shadowbench.world import World, place

COORDINATES = st.tuples(*[st.floats(-3.0, 3.0)] * 3)
DIRECTIONS = COORDINATES.filter(lambda d: sum(c * c for c in d) > 0.1)


def _world(light: Light | None = None, camera: Camera | None = None) -> World:
    """A box of 2 x 1 x 2 standing on a ground of 8 x 8."""
    return place(
        Scene(
            meshes=(Mesh("ground", *square(4.0)), Mesh("box", *box((-1.0, 0.0, -1.0), (1.0, 1.0, 1.0)))),
            instances=(Instance(0), Instance(1)),
            lights={"light": light or DirectionalLight((0.0, 1.0, 0.0))},
            cameras={"camera": camera or Camera((0.0, 3.0, 9.0), (0.0, 0.0, 0.0))},
        )
    )


def _frames(light: Light) -> tuple[World, Any]:
    world = _world(light)
    return world, light_frames(world.lights["light"], world)


@given(forward=DIRECTIONS)
def test_axes_are_orthonormal_and_right_down_forward(forward: Vector) -> None:
    right, down, ahead = axes_of(forward)
    np.testing.assert_allclose(np.array([right, down, ahead]) @ np.array([right, down, ahead]).T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(right, down), ahead, atol=1e-12)
    np.testing.assert_allclose(np.cross(ahead, forward), 0.0, atol=1e-12)


def test_looking_along_minus_z_has_x_to_the_right_and_y_upwards() -> None:
    right, down, ahead = axes_of((0.0, 0.0, -2.0))
    assert (right.tolist(), down.tolist(), ahead.tolist()) == ([1, 0, 0], [0, -1, 0], [0, 0, -1])


def test_an_orthographic_frame_maps_its_box_to_the_unit_cube() -> None:
    frame = orthographic_frame((0.0, 0.0, -1.0), np.array([-1.0, -2.0, -3.0]), np.array([3.0, 6.0, 5.0]))
    # right is x, down is -y, forward is -z
    points = np.array([(-1.0, 2.0, 3.0), (3.0, -6.0, -5.0), (1.0, -2.0, -1.0)])
    np.testing.assert_allclose(frame.project(points), [[0, 0, 0, 1], [1, 1, 1, 1], [0.5, 0.5, 0.5, 1]], atol=1e-15)
    assert frame.is_orthographic
    assert frame.depth_range == 8.0
    assert frame.extent == (4.0, 8.0)


def test_a_perspective_frame_maps_its_frustum() -> None:
    frame = perspective_frame((0.0, 0.0, 0.0), axes_of((0.0, 0.0, -1.0)), (2.0, 1.0), 1.0, 5.0)
    points = np.array([(0, 0, -1), (0, 0, -5), (2, 1, -1), (-6, -3, -3), (2, -1, -2)], float)
    expected = [(0.5, 0.5, 0.0, 1), (0.5, 0.5, 1.0, 5), (1, 0, 0, 1), (0, 1, 0.5, 3), (0.75, 0.75, 0.25, 2)]
    np.testing.assert_allclose(frame.project(points), expected, atol=1e-15)
    assert not frame.is_orthographic
    assert frame.depth_range == 4.0
    assert frame.extent == (4.0, 2.0)


def test_depth_is_linear_along_the_forward_axis_not_along_the_ray() -> None:
    frame = perspective_frame((1.0, 2.0, 3.0), axes_of((1.0, -1.0, 0.5)), (1.0, 1.0), 0.5, 4.5)
    right, down, ahead = axes_of((1.0, -1.0, 0.5))
    distance = np.linspace(0.5, 4.5, 9)
    for aside in (0.0 * right, 0.7 * right - 0.4 * down):
        points = np.array([1.0, 2.0, 3.0]) + distance[:, None] * (ahead + aside)
        np.testing.assert_allclose(frame.project(points)[:, 2], np.linspace(0.0, 1.0, 9), atol=1e-12)


@given(direction=DIRECTIONS)
def test_a_directional_frame_holds_the_whole_world_with_little_to_spare(direction: Vector) -> None:
    world, (frame,) = _frames(DirectionalLight(direction))
    h = frame.project(world.vertices)
    assert h[:, :3].min() >= 0.0
    assert h[:, :3].max() <= 1.0
    # a thousandth of the larger side on each side, or of a hundredth of it where the world is flat
    np.testing.assert_allclose(h[:, :3].min(axis=0), 0.0, atol=0.1)
    assert np.ptp(h[:, :3], axis=0).max() > 0.99
    assert frame.contains(world.vertices).all()


def test_depth_grows_away_from_a_directional_light() -> None:
    _, (frame,) = _frames(DirectionalLight((0.3, 1.0, 0.2)))
    towards = np.array([0.3, 1.0, 0.2])
    depths = frame.project(np.array([0.0 * towards, 0.5 * towards]))[:, 2]
    assert depths[1] < depths[0]
    assert (depths[0] - depths[1]) * frame.depth_range == pytest.approx(0.5 * np.linalg.norm(towards), rel=1e-6)


def test_a_texel_covers_its_square_and_row_0_is_at_the_top() -> None:
    # straight down: right is x, and up in the window is -z
    world, (frame,) = _frames(DirectionalLight((0.0, 1.0, 0.0)))
    resolution = 16
    texel = frame.texel_size(resolution)
    assert texel == pytest.approx(8.0 / resolution, rel=3e-3)
    low = frame.project(np.array([(-4.0, 0.0, -4.0)]))[0, :2]
    np.testing.assert_allclose(low, 0.0, atol=2e-3)
    centre_of_texel_3_5 = np.array([[-4.0 + 3.5 * 0.5, 0.0, -4.0 + 5.5 * 0.5]])
    np.testing.assert_allclose(frame.project(centre_of_texel_3_5)[0, :2] * resolution, (3.5, 5.5), atol=0.02)
    assert world.triangle_count == 14


def test_a_spot_frame_is_the_square_round_its_cone() -> None:
    light = SpotLight((0.0, 5.0, 0.0), (0.0, -1.0, 0.0), angle=90.0)
    world, (frame,) = _frames(light)
    rim = np.array([(5.0, 0.0, 0.0), (-5.0, 0.0, 0.0), (0.0, 0.0, -5.0), (0.0, 0.0, 5.0)])
    np.testing.assert_allclose(frame.project(rim)[:, :2], [(1, 0.5), (0, 0.5), (0.5, 0), (0.5, 1)], atol=1e-12)
    h = frame.project(world.vertices)
    seen = frame.contains(world.vertices)
    assert (h[seen, 2] >= 0.0).all()
    assert (h[seen, 2] <= 1.0).all()


def test_a_given_near_plane_is_kept() -> None:
    _, (frame,) = _frames(SpotLight((0.0, 5.0, 0.0), (0.0, -1.0, 0.0), near=4.5))
    assert frame.near == 4.5
    points = np.array([(0.0, 0.5001, 0.0), (0.0, 0.4999, 0.0)])
    assert frame.contains(points).tolist() == [False, True]
    np.testing.assert_allclose(frame.project(points)[:, 2], 0.0, atol=1e-4)


@pytest.mark.parametrize(
    "light",
    [SpotLight((3.0, 5.0, 2.0), (-3.0, -5.0, -2.0), angle=170.0), PointLight((3.0, 2.0, 1.5)), PointLight((0, 0.5, 0))],
)
def test_fitted_depth_planes_leave_nothing_out(light: Light) -> None:
    world, frames = _frames(light)
    near_enough = 1e-3
    for frame in frames:
        h = frame.project(world.vertices)
        inside = (np.abs(h[:, :2] - 0.5) <= 0.5).all(axis=1) & (h[:, 3] > near_enough)
        assert (h[inside, 2] >= 0.0).all()
        assert (h[inside, 2] <= 1.0).all()


@given(offset=COORDINATES.filter(lambda d: max(map(abs, d)) > 1e-3))
def test_the_six_faces_partition_all_directions(offset: Vector) -> None:
    light = PointLight((0.25, 2.0, -0.5))
    _, frames = _frames(light)
    point = np.array([light.position]) + np.array([offset])
    face = int(cube_face_of(np.array([offset]))[0])
    h = np.array([frame.project(point)[0] for frame in frames])
    # the face is the one in front of which the point lies farthest, and the point lies in its window
    assert h[face, 3] == pytest.approx(h[:, 3].max(), abs=1e-12)
    assert np.abs(h[face, :2] - 0.5).max() <= 0.5 + 1e-12
    largest = np.sort(np.abs(offset))
    if largest[2] - largest[1] > 1e-9:  # off the edges, no other window holds it
        others = [k for k in range(6) if k != face and h[k, 3] > 0.0 and np.abs(h[k, :2] - 0.5).max() <= 0.5]
        assert others == []


def test_equal_components_belong_to_the_first_axis() -> None:
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    assert cube_face_of(signs).tolist() == [1, 1, 1, 1, 0, 0, 0, 0]
    edges = np.array([(0.0, 1.0, -1.0), (0.0, -1.0, 1.0), (0.0, 0.0, -1.0)])
    assert cube_face_of(edges).tolist() == [2, 3, 5]


def test_cube_faces_come_in_the_stated_order() -> None:
    _, frames = _frames(PointLight((0.0, 2.0, 0.0)))
    assert [tuple(np.round(frame.axes[2], 12).tolist()) for frame in frames] == [f for f, _ in CUBE_AXES]
    directions = np.array([f for f, _ in CUBE_AXES])
    assert cube_face_of(directions).tolist() == [0, 1, 2, 3, 4, 5]


def _pixel_ray(camera: Camera, column: float, row: float, width: int, height: int) -> NDArray[np.float64]:
    """The ray through a place in the picture, from the definition of a pinhole camera (not from a frame)."""
    forward = np.subtract(camera.target, camera.eye)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right = right / np.linalg.norm(right)
    up = np.cross(right, forward)
    half = math.tan(math.radians(camera.vertical_angle) / 2.0)
    x, y = (2.0 * column / width - 1.0) * half * width / height, (1.0 - 2.0 * row / height) * half
    return np.asarray(forward + x * right + y * up)


@pytest.mark.parametrize("up", [(0.0, 1.0, 0.0), (0.3, 1.0, -0.2)])
@pytest.mark.parametrize("place_in_picture", [(0.5, 0.5), (63.5, 47.5), (12.5, 40.5), (32.0, 24.0)])
def test_points_on_a_pixels_ray_project_to_the_pixel(place_in_picture: tuple[float, float], up: Vector) -> None:
    camera = Camera((3.0, 4.0, 9.0), (0.5, 0.0, 1.0), up=up, vertical_angle=35.0)
    world = _world(camera=camera)
    frame = camera_frame(world.cameras["camera"], 64, 48, world)
    ray = _pixel_ray(camera, *place_in_picture, 64, 48)
    points = np.array(camera.eye) + np.array([2.0, 5.0, 20.0])[:, None] * ray
    h = frame.project(points)
    np.testing.assert_allclose(h[:, :2] * [64, 48], [place_in_picture] * 3, atol=1e-10)
    np.testing.assert_allclose(h[:, 3], [2.0, 5.0, 20.0], atol=1e-12)


def test_the_camera_window_has_square_pixels() -> None:
    world = _world()
    frame = camera_frame(world.cameras["camera"], 1024, 768, world)
    assert frame.extent[0] / 1024 == pytest.approx(frame.extent[1] / 768)


def test_contains_excludes_what_is_beside_or_behind() -> None:
    world = _world()
    frame = camera_frame(Camera((0.0, 0.0, 9.0), (0.0, 0.0, 0.0), vertical_angle=90.0), 100, 100, world)
    points = np.array([(0, 0, 0), (8.9, 0, 0), (9.1, 0, 0), (0, 8.9, 0), (0, -9.1, 0), (0, 0, 18), (0, 0, 9)], float)
    assert frame.contains(points).tolist() == [True, True, False, True, False, False, False]


def test_only_a_spot_light_leaves_places_dark_by_itself() -> None:
    points = np.array([(0, 0, 0), (4.9, 0, 0), (5.1, 0, 0), (0, 6, 0), (0, 5, 0)], float)
    spot = SpotLight((0.0, 5.0, 0.0), (0.0, -2.0, 0.0), angle=90.0)
    assert is_in_field_of_view(spot, points).tolist() == [True, True, False, False, False]
    for light in (DirectionalLight((0, 1, 0)), PointLight((0, 5, 0))):
        assert is_in_field_of_view(light, points).all()


def test_an_area_light_has_no_single_frame() -> None:
    world = _world()
    with pytest.raises(SceneError, match="area light"):
        light_frames(RectangularLight((0, 3, 0), (1, 0, 0), (0, 0, 1)), world)
