from itertools import pairwise

import numpy as np
import pytest
from builders import LIGHTS, box_over_ground, square
from running import run_method

from shadowbench.camera_pass import render
from shadowbench.light_space import cube_face_of, is_in_field_of_view, light_frames
from shadowbench.method import Context
from shadowbench.metrics import measure
from shadowbench.reference import hard_reference
from shadowbench.scene import Camera, DirectionalLight, Instance, Mesh, PointLight, Scene
from shadowbench.scenes.random_triangles import RandomTriangles
from shadowbench.world import World, place


def _view(world: World, width: int = 160, height: int = 120):
    return render(world, next(iter(world.cameras.values())), width, height, Context(threads=2))


def _slanted_plane(slope: float) -> World:
    vertices, triangles = square(2.0)
    vertices[:, 1] = slope * vertices[:, 0]
    return place(
        Scene(
            (Mesh("plane", vertices, triangles),),
            (Instance(0),),
            {"sun": DirectionalLight((0.1, 1.0, 0.2)), "lamp": PointLight((0.3, 3.0, 0.2))},
            {"above": Camera((0.1, 5.0, 0.3), (0.0, 0.0, 0.0))},
        )
    )


def _expected(world: World, receivers, light, depth, bias: float):
    """The nearest-texel test in NumPy, from the kept map."""
    frames = light_frames(light, world)
    faces = np.zeros(receivers.count, int)
    if len(frames) == 6:
        faces = cube_face_of(receivers.position.astype(np.float64) - np.array(light.position))
    visibility = np.zeros(receivers.count, np.float32)
    size = depth.shape[2]
    for face, frame in enumerate(frames):
        here = np.flatnonzero(faces == face)
        u, v, d, _ = frame.project(receivers.position[here]).T
        column = np.clip(np.floor(u * size).astype(int), 0, size - 1)
        row = np.clip(np.floor(v * size).astype(int), 0, size - 1)
        visibility[here] = d - bias <= depth[face, row, column]
    return np.where(is_in_field_of_view(light, receivers.position), visibility, 0.0)


@pytest.mark.parametrize("light", sorted(LIGHTS))
def test_the_result_is_the_nearest_texels_depth_test(light):
    world = box_over_ground()
    receivers = _view(world)
    visibility, trace = run_method("shadow-map", world, receivers, light=light, resolution=200, bias=1e-4)
    expected = _expected(world, receivers, world.lights[light], trace.kept["shadow map"].numpy(), 1e-4)
    # a receiver within float64 rounding of a texel's border or of its depth may go either way
    assert (visibility != expected).sum() <= 2


@pytest.mark.parametrize("slope", [0.0, 0.4, 1.5])
def test_one_texel_of_slope_bias_is_exactly_what_a_plane_needs(slope):
    world = _slanted_plane(slope)
    receivers = _view(world)
    with_bias, _ = run_method("shadow-map", world, receivers, resolution=64, slope_bias=1.0, bias=1e-6)
    assert (with_bias == 1.0).all()
    without, _ = run_method("shadow-map", world, receivers, resolution=64, slope_bias=0.0, bias=1e-6)
    assert (without == 0.0).mean() > 0.2


@pytest.mark.parametrize("light", ["sun", "lamp"])
def test_receiver_plane_bias_leaves_no_acne_on_a_plane(light):
    world = _slanted_plane(0.7)
    values = {"resolution": 128, "slope_bias": 0.0, "bias": 1e-5 if light == "sun" else 1e-3, "receiver_plane": True}
    visibility, _ = run_method("shadow-map", world, _view(world), light=light, **values)
    assert (visibility == 1.0).all()


def test_normal_offset_leaves_no_acne_on_a_plane():
    world = _slanted_plane(0.7)
    values = {"resolution": 64, "slope_bias": 0.0, "bias": 1e-5}
    offset, _ = run_method("shadow-map", world, _view(world), normal_offset=2.0, **values)
    plain, _ = run_method("shadow-map", world, _view(world), normal_offset=0.0, **values)
    assert (offset == 1.0).all()
    assert (plain == 0.0).any()


def test_six_faces_meet_without_seams():
    world = _slanted_plane(0.0)
    visibility, trace = run_method("shadow-map", world, _view(world), light="lamp", resolution=256, bias=1e-4)
    assert trace.kept["shadow map"].shape == (6, 256, 256)
    assert (visibility == 1.0).all()


def _sweep(values: list[dict], world: World, size: tuple[int, int] = (320, 240)):
    receivers = _view(world, *size)
    reference = hard_reference(world, receivers, world.lights["sun"], Context(threads=2))
    results = []
    for parameters in values:
        visibility, _ = run_method("shadow-map", world, receivers, threads=2, **parameters)
        results.append(measure(world, receivers, reference, visibility, {}).columns)
    return results


@pytest.mark.slow
def test_failures_fall_monotonically_to_nothing_as_the_resolution_rises():
    scene = RandomTriangles()
    world = place(scene.make(scene.Parameters(triangles=1000)))
    swept = _sweep([{"resolution": r, "bias": 1e-6} for r in (256, 512, 1024, 2048, 4096, 8192)], world)
    failure = [columns["failure_percent"] for columns in swept]
    assert all(finer < coarser for coarser, finer in pairwise(failure)), failure
    assert failure[-1] < failure[0] / 10.0


def test_the_bias_sweep_goes_from_acne_to_peter_panning():
    # the light stands behind the box, so that the shadow's contact with it is seen
    world = box_over_ground(lights={"sun": DirectionalLight((-0.4, 1.0, -0.6))})
    biases = [0.0, 1e-2, 0.1]
    swept = _sweep([{"resolution": 256, "bias": b, "slope_bias": 0.0} for b in biases], world)
    too_little, right, too_much = swept
    assert too_little["acne_percent"] > 5.0 > right["acne_percent"]
    assert too_little["peter_panning_count"] == 0
    assert too_much["acne_count"] == 0
    assert too_much["peter_panning_count"] > 10 * max(1, right["peter_panning_count"])


def test_memory_is_counted_by_the_byte():
    world = box_over_ground()
    _, trace = run_method("shadow-map", world, _view(world), resolution=512)
    assert trace.bytes_by_name() == {"shadow map": 512 * 512 * 4}
