import dataclasses

import numpy as np
import pytest
from builders import box_over_ground, square

from shadowbench.camera_pass import CameraPass, render
from shadowbench.errors import SceneError
from shadowbench.light_space import camera_frame
from shadowbench.method import Context
from shadowbench.scene import Camera, DirectionalLight, Instance, Mesh, Scene
from shadowbench.scenes.random_triangles import RandomTriangles
from shadowbench.world import World, place

WIDTH, HEIGHT = 64, 48


def _soup(triangle_count: int = 200) -> World:
    scene = RandomTriangles()
    return place(scene.make(scene.Parameters(triangles=triangle_count)))


def _first_camera(world: World) -> Camera:
    return next(iter(world.cameras.values()))


def _rays(world: World, camera: Camera):
    """Ray directions through all pixel centres, float64, by the definition of the camera's frame."""
    frame = camera_frame(camera, WIDTH, HEIGHT, world)
    right, down, forward = frame.axes
    pixel = np.arange(WIDTH * HEIGHT)
    x = ((pixel % WIDTH + 0.5) / WIDTH - 0.5) * frame.extent[0]
    y = ((pixel // WIDTH + 0.5) / HEIGHT - 0.5) * frame.extent[1]
    return forward + x[:, None] * right + y[:, None] * down


def _cast(world: World, eye: np.ndarray, directions: np.ndarray):
    """Nearest triangle along each ray by brute force: (triangle or -1, parameter, least barycentric of the hit)."""
    a, b, c = (world.vertices[world.triangles[:, k]].astype(np.float64) - eye for k in range(3))
    nearest = np.full(len(directions), np.inf)
    seen = np.full(len(directions), -1)
    margin = np.zeros(len(directions))
    for t in range(world.triangle_count):
        volumes = directions @ np.stack([np.cross(b[t], c[t]), np.cross(c[t], a[t]), np.cross(a[t], b[t])], axis=1)
        total = volumes.sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            weights = volumes / total[:, None]
            distance = (a[t] @ np.cross(b[t] - a[t], c[t] - a[t])) / total
        hit = (weights >= 0).all(axis=1) & (distance > 0) & (distance < nearest)
        nearest[hit], seen[hit], margin[hit] = distance[hit], t, weights[hit].min(axis=1)
    return seen, nearest, margin


@pytest.mark.parametrize("make", [_soup, box_over_ground], ids=["soup", "box"])
def test_each_pixel_sees_what_a_ray_through_its_centre_meets_first(make):
    world = make()
    camera = _first_camera(world)
    receivers = render(world, camera, WIDTH, HEIGHT, Context())
    directions = _rays(world, camera)
    seen, nearest, margin = _cast(world, np.array(camera.eye), directions)
    found = np.full(WIDTH * HEIGHT, -1)
    found[receivers.pixel] = receivers.triangle
    differing = np.flatnonzero(found != seen)
    # only where the ray passes within rounding of an edge, or where two surfaces are equally near
    assert len(differing) <= 2
    agreeing = receivers.triangle == seen[receivers.pixel]
    expected = np.array(camera.eye) + nearest[receivers.pixel, None] * directions[receivers.pixel]
    error = np.abs(receivers.position - expected)[agreeing]
    assert error.max() < 4 * 2.0**-23 * world.scale
    assert (margin[differing] < 1e-3).all()


def test_positions_lie_on_their_triangles_to_within_an_ulp():
    world = _soup(1000)
    receivers = render(world, _first_camera(world), 256, 192, Context())
    a, b, c = (world.vertices[world.triangles[receivers.triangle, k]].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    off = np.abs(((receivers.position - a) * normal).sum(axis=1))
    assert off.max() < 2.0**-23 * world.scale


def test_normals_are_unit_perpendicular_and_turned_to_the_camera():
    world = _soup()
    receivers = render(world, _first_camera(world), WIDTH, HEIGHT, Context())
    a, b, c = (world.vertices[world.triangles[receivers.triangle, k]].astype(np.float64) for k in range(3))
    np.testing.assert_allclose(np.linalg.norm(receivers.normal, axis=1), 1.0, atol=1e-6)
    assert np.abs(((b - a) * receivers.normal).sum(axis=1)).max() < 1e-6
    assert np.abs(((c - a) * receivers.normal).sum(axis=1)).max() < 1e-6
    assert (((np.array(receivers.eye) - receivers.position) * receivers.normal).sum(axis=1) >= 0).all()


@pytest.mark.parametrize(("field", "column_step", "row_step"), [("position_dx", 1, 0), ("position_dy", 0, 1)])
def test_derivatives_say_where_the_plane_is_one_pixel_on(field, column_step, row_step):
    width, height = 640, 480
    world = box_over_ground()
    receivers = render(world, _first_camera(world), width, height, Context())
    index_of_pixel = np.full((height, width), -1)
    index_of_pixel.reshape(-1)[receivers.pixel] = np.arange(receivers.count)
    here = index_of_pixel[: height - row_step, : width - column_step].reshape(-1)
    there = index_of_pixel[row_step:, column_step:].reshape(-1)
    same = (here >= 0) & (there >= 0) & (receivers.triangle[here] == receivers.triangle[there])
    step = receivers.position[there[same]] - receivers.position[here[same]]
    off = np.linalg.norm(step - getattr(receivers, field)[here[same]], axis=1)
    # to first order: a pixel's step is a few thousandths of the distance
    assert np.median(off / np.linalg.norm(step, axis=1)) < 1e-2


@pytest.mark.parametrize("threads", [2, 3])
def test_every_thread_count_gives_the_same_bits(threads):
    world = _soup(3000)
    one = render(world, _first_camera(world), 256, 192, Context(threads=1))
    more = render(world, _first_camera(world), 256, 192, Context(threads=threads))
    for field in dataclasses.fields(one):
        np.testing.assert_array_equal(getattr(one, field.name), getattr(more, field.name), err_msg=field.name)


def test_receivers_are_sorted_by_pixel_and_indexed():
    world = box_over_ground()
    receivers = render(world, Camera((0.0, 1.0, 8.0), (0.0, 3.0, 0.0)), WIDTH, HEIGHT, Context())
    assert 0 < receivers.count < WIDTH * HEIGHT  # part of the picture is sky
    assert (np.diff(receivers.pixel) > 0).all()
    counts = np.diff(receivers.first_of_pixel)
    assert counts.sum() == receivers.count
    assert (counts[receivers.pixel] == 1).all()


def test_instances_that_do_not_receive_are_seen_but_not_valid():
    vertices, triangles = square(1.0)
    world = place(
        Scene(
            (Mesh("square", vertices, triangles),),
            (Instance(0, receives=False), Instance(0, translation=(2.5, 0.0, 0.0))),
            {"sun": DirectionalLight((0.0, 1.0, 0.0))},
            {"above": Camera((1.2, 6.0, 0.1), (1.2, 0.0, 0.0), up=(0.0, 0.0, -1.0))},
        )
    )
    receivers = render(world, world.cameras["above"], WIDTH, HEIGHT, Context())
    assert set(np.unique(receivers.instance)) == {0, 1}
    assert (receivers.valid == (receivers.instance == 1)).all()


def test_a_run_reuses_the_memory_of_the_last():
    world = box_over_ground()
    camera_pass = CameraPass(world, world.cameras["front"], WIDTH, HEIGHT, Context())
    first, second = camera_pass.run(), camera_pass.run()
    assert first.position.ctypes.data == second.position.ctypes.data


def test_a_camera_that_sees_nothing_is_a_clear_error():
    world = box_over_ground()
    with pytest.raises(SceneError, match="the camera sees no surface"):
        render(world, Camera((0.0, 5.0, 0.0), (0.0, 10.0, 0.1)), WIDTH, HEIGHT, Context())
