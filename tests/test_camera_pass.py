import dataclasses

import numpy as np
import pytest
from builders import box_over_ground, square

from shadowbench.camera_pass import CameraPass, render
from shadowbench.device.picture_samples import sample_pattern
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


# --- several samples a pixel, several layers a sample


def _from_above(*instances: Instance) -> World:
    """Squares seen straight from above; a pixel of a 4 x 4 picture is one unit wide on the plane y = 0."""
    vertices, triangles = square(0.5)
    return place(
        Scene(
            (Mesh("square", vertices, triangles),),
            instances,
            {"sun": DirectionalLight((0.0, 1.0, 0.0))},
            {
                "above": Camera(
                    (0.0, 10.0, 0.0),
                    (0.0, 0.0, 0.0),
                    up=(0.0, 0.0, -1.0),
                    vertical_angle=float(np.degrees(2.0 * np.arctan(0.2))),
                )
            },
        )
    )


def _square(low, high, height=0.0, **fields) -> Instance:
    """The square between two corners (x, z)."""
    size, middle = np.subtract(high, low), np.add(high, low) / 2.0
    return Instance(0, translation=(middle[0], height, middle[1]), scale=(size[0], 1.0, size[1]), **fields)


def _above(world: World, *, samples: int = 1, layers: int = 1, threads: int = 1):
    return render(world, world.cameras["above"], 4, 4, Context(threads=threads), samples=samples, layers=layers)


@pytest.mark.parametrize("samples", [2, 4, 16])
def test_a_half_covered_pixel_is_half_covered(samples):
    # columns 0 and 1 are covered, column 2 to its half; of the rows, row 0 from a quarter on
    receivers = _above(_from_above(_square((-3.0, -1.75), (0.5, 3.0))), samples=samples)
    coverage = receivers.picture(np.ones(receivers.count))
    np.testing.assert_allclose(coverage[1:], [[1.0, 1.0, 0.5, 0.0]] * 3, atol=1e-6)
    if samples >= 4:
        np.testing.assert_allclose(coverage[0, :2], 0.75, atol=1e-6)
    sky = receivers.picture(np.zeros(receivers.count), background=1.0)
    np.testing.assert_allclose(sky, 1.0 - coverage, atol=1e-6)


@pytest.mark.parametrize("samples", [1, 3, 4, 7, 16])
def test_the_weights_of_a_covered_pixel_sum_to_one(samples):
    receivers = render(_soup(), _first_camera(_soup()), WIDTH, HEIGHT, Context(), samples=samples)
    assert receivers.count == samples * WIDTH * HEIGHT
    np.testing.assert_allclose(np.add.reduceat(receivers.weight, receivers.first_of_pixel[:-1]), 1.0, atol=1e-6)


def test_two_translucent_squares_over_an_opaque_ground_give_three_layers():
    world = _from_above(
        _square((-4.0, -4.0), (4.0, 4.0)),
        _square((-1.0, -4.0), (4.0, 4.0), height=0.5, transmittance=(0.9, 0.6, 0.3)),
        _square((1.05, -4.0), (4.0, 4.0), height=1.0, transmittance=(0.25, 0.25, 0.25)),
    )
    receivers = _above(world, layers=3)
    assert np.diff(receivers.first_of_pixel).reshape(4, 4).tolist() == [[1, 2, 2, 3]] * 4
    last = slice(receivers.first_of_pixel[3], receivers.first_of_pixel[4])
    assert receivers.instance[last].tolist() == [2, 1, 0]
    assert receivers.layer[last].tolist() == [0, 1, 2]
    np.testing.assert_allclose(receivers.position[last, 1], [1.0, 0.5, 0.0], atol=1e-6)
    np.testing.assert_allclose(receivers.alpha[last], [0.75, 0.4, 1.0], atol=1e-6)
    np.testing.assert_allclose(receivers.weight[last], 1.0)
    # front to back: 0.75 of the nearest, 0.4 of what it lets through, and the ground behind both
    seen = receivers.picture(np.array([5.0, 7.0, 11.0])[receivers.instance])
    expected = [5.0, 0.4 * 7.0 + 0.6 * 5.0, 0.4 * 7.0 + 0.6 * 5.0, 0.75 * 11.0 + 0.25 * (0.4 * 7.0 + 0.6 * 5.0)]
    np.testing.assert_allclose(seen, [expected] * 4, atol=1e-5)


def test_the_last_layer_is_taken_for_opaque_and_the_sky_shows_through_the_others():
    glass = {"transmittance": (0.5, 0.5, 0.5)}
    world = _from_above(_square((-4.0, -4.0), (4.0, 4.0), **glass), _square((-4.0, -4.0), (4.0, 4.0), 1.0, **glass))
    for layers, coverage in ((1, 1.0), (2, 1.0), (3, 0.75), (8, 0.75)):
        receivers = _above(world, layers=layers)
        np.testing.assert_allclose(receivers.picture(np.ones(receivers.count)), coverage)
        assert receivers.count == 16 * min(layers, 2)


def test_an_opaque_world_is_the_same_however_many_layers_are_asked_for():
    world = _soup(500)
    one = render(world, _first_camera(world), WIDTH, HEIGHT, Context())
    more = render(world, _first_camera(world), WIDTH, HEIGHT, Context(), layers=4)
    for field in dataclasses.fields(one):
        np.testing.assert_array_equal(getattr(one, field.name), getattr(more, field.name), err_msg=field.name)


def test_each_sample_sees_what_a_ray_through_it_meets_one_after_the_other():
    world = place(
        Scene(
            tuple(Mesh(m.name, m.vertices, m.triangles) for m in _soup(60).meshes),
            (Instance(0, transmittance=(0.5, 0.5, 0.5)), Instance(1)),
            {"sun": DirectionalLight((0.0, 1.0, 0.0))},
            {"middle": _first_camera(_soup(60))},
        )
    )
    camera, samples, layers = world.cameras["middle"], 4, 3
    receivers = render(world, camera, WIDTH, HEIGHT, Context(), samples=samples, layers=layers)
    frame = camera_frame(camera, WIDTH, HEIGHT, world)
    pattern = sample_pattern(samples)
    pixel, sample = np.divmod(np.arange(WIDTH * HEIGHT * samples), samples)
    x = ((pixel % WIDTH + pattern[sample, 0]) / WIDTH - 0.5) * frame.extent[0]
    y = ((pixel // WIDTH + pattern[sample, 1]) / HEIGHT - 0.5) * frame.extent[1]
    right, down, forward = frame.axes
    directions = forward + x[:, None] * right + y[:, None] * down
    # every layer in turn: the nearest triangle that no layer before it has seen, unless one of those is the ground
    origin = np.array(camera.eye)
    distance = np.full((world.triangle_count, len(directions)), np.inf)
    for t in range(world.triangle_count):
        a, b, c = world.vertices[world.triangles[t]].astype(np.float64) - origin
        volumes = directions @ np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        inside = (volumes >= 0.0).all(axis=1) | (volumes <= 0.0).all(axis=1)
        along = (a @ np.cross(b - a, c - a)) / volumes.sum(axis=1)
        distance[t, inside] = along[inside]
    order = np.argsort(distance, axis=0)[:layers].T
    met = np.where(np.take_along_axis(distance.T, order, axis=1) < np.inf, order, -1)
    ground = met >= world.first_triangle[1]
    met[(np.cumsum(ground, axis=1) - ground) > 0] = -1
    found = np.full((WIDTH * HEIGHT * samples, layers), -1)
    first = np.concatenate([[0], np.cumsum(np.diff(np.flatnonzero(receivers.layer == 0)))])
    assert len(first) == len(found), "every sample sees a surface"
    owner = np.repeat(np.arange(len(found)), np.diff([*first, receivers.count]))
    found[owner, receivers.layer] = receivers.triangle
    assert (found != met).any(axis=1).sum() <= 8, "only where a ray passes within rounding of an edge"
    agree = found[owner, receivers.layer] == met[owner, receivers.layer]
    expected = origin + distance[receivers.triangle, owner][:, None] * directions[owner]
    assert np.abs(receivers.position - expected)[agree].max() < 4 * 2.0**-23 * world.scale


@pytest.mark.parametrize(("samples", "layers"), [(4, 1), (1, 3), (3, 2)])
def test_every_thread_count_gives_the_same_samples_and_layers(samples, layers):
    soup = _soup(3000)
    glass = tuple(dataclasses.replace(i, transmittance=(0.5, 0.5, 0.5)) for i in soup.instances)
    world = dataclasses.replace(soup, instances=glass)
    one, more = (
        render(world, _first_camera(world), 256, 192, Context(threads=n), samples=samples, layers=layers)
        for n in (1, 3)
    )
    for field in dataclasses.fields(one):
        np.testing.assert_array_equal(getattr(one, field.name), getattr(more, field.name), err_msg=field.name)


def test_the_memory_grows_with_the_receivers_and_runs_agree():
    world = _from_above(_square((-4.0, -4.0), (4.0, 4.0), transmittance=(0.5, 0.5, 0.5)), _square((-4, -4), (4, 4), -1))
    camera_pass = CameraPass(world, world.cameras["above"], 4, 4, Context(), samples=4, layers=2)
    first = camera_pass.run()
    assert first.count == 4 * 4 * 4 * 2
    before = first.position.copy()
    np.testing.assert_array_equal(camera_pass.run().position, before)


@pytest.mark.parametrize("wrong", [{"samples": 0}, {"layers": 0}])
def test_a_picture_without_samples_or_layers_is_refused(wrong):
    world = box_over_ground()
    with pytest.raises(ValueError, match="at least 1 sample and 1 layer"):
        CameraPass(world, world.cameras["front"], WIDTH, HEIGHT, Context(), **wrong)
