"""Exponential shadow maps: the leak, the classifications and their order, the fallback's bound, log space."""

import dataclasses

import numpy as np
import pytest
from builders import LIGHTS, box_over_ground
from layers import RECEIVERS, bilinear, convolved, corner_texels, depth_of, layered, window_means
from running import REGISTRY, run_method

from shadowbench.camera_pass import render
from shadowbench.errors import ParameterError
from shadowbench.light_space import cube_face_of, is_in_field_of_view, light_frames
from shadowbench.method import Context
from shadowbench.parameters import parse_parameters
from shadowbench.scene import DirectionalLight
from shadowbench.scenes.random_triangles import RandomTriangles
from shadowbench.world import place

BOX = box_over_ground()
ON_BOX = render(BOX, BOX.cameras["front"], 120, 90, Context())
EXACT = {"resolution": 128, "filtering": "bilinear", "bias": 0.0, "classification": "none"}


def _depths(world, receivers=RECEIVERS, light="sun", **values):
    _, trace = run_method("shadow-map", world, receivers, light=light, slope_bias=0.0, **values)
    return trace.kept["shadow map"].numpy().astype(np.float64)


def _raised(height):
    position = RECEIVERS.position.copy()
    position[:, 1] = height
    return dataclasses.replace(RECEIVERS, position=position)


# --- the test itself


@pytest.mark.parametrize("log_space", [False, True])
@pytest.mark.parametrize("c", [10.0, 80.0, 87.0])
@pytest.mark.parametrize("height", [0.01, 0.05, 0.3, 1.5])
def test_light_leaks_by_the_exponential_of_the_separation(height, c, log_space):
    world = layered((height, -2.0), (1.6, 1.9))
    visibility, _ = run_method("esm", world, RECEIVERS, c=c, log_space=log_space, **EXACT)
    separation = depth_of(world, 0.0) - depth_of(world, height)
    under_one_layer = RECEIVERS.position[:, 0] < 0.5
    # exponents are rounded: half an ulp of c each
    np.testing.assert_allclose(visibility[under_one_layer], np.exp(-c * separation), rtol=3e-5)


def test_the_leak_is_five_percent_at_a_27th_of_the_depth_range():
    assert np.exp(-80.0 * 0.0374) == pytest.approx(0.05, abs=3e-4)
    assert np.exp(-80.0 * 0.0693) == pytest.approx(1.0 / 255.0, abs=3e-5)


@pytest.mark.parametrize("kernel", [0, 3, 7])
@pytest.mark.parametrize("log_space", [False, True])
def test_the_result_is_the_clamped_mean_of_exponentials_over_the_window(log_space, kernel):
    world = layered((1.0, 0.013), (0.05, -0.4))
    visibility, _ = run_method("esm", world, RECEIVERS, kernel=kernel, log_space=log_space, **EXACT)
    tests = np.exp(80.0 * (_depths(world, resolution=128)[0] - depth_of(world, 0.0)))
    expected = np.minimum(window_means(world, tests, kernel), 1.0)
    assert ((expected > 0.05) & (expected < 0.95)).sum() >= 16
    np.testing.assert_allclose(visibility, expected, rtol=5e-5, atol=1e-7)


@pytest.mark.parametrize("kernel", [0, 7])
def test_far_behind_one_plane_of_blockers_the_result_is_the_lit_share(kernel):
    world = layered((1.0, 0.013))
    visibility, _ = run_method("esm", world, RECEIVERS, kernel=kernel, **EXACT)
    lit = _depths(world, resolution=128)[0] > 0.5 * (depth_of(world, 0.0) + depth_of(world, 1.0))
    np.testing.assert_allclose(visibility, window_means(world, lit, kernel), atol=2e-5)


@pytest.mark.parametrize("light", sorted(LIGHTS))
def test_windows_and_look_ups_stay_in_the_receivers_face_and_repeat_its_edges(light):
    values = {**EXACT, "resolution": 40, "kernel": 5, "bias": 1e-4}
    visibility, _ = run_method("esm", BOX, ON_BOX, light=light, **values)
    depth = _depths(BOX, ON_BOX, light, resolution=40)
    frames = light_frames(LIGHTS[light], BOX)
    expected = np.zeros(ON_BOX.count)
    faces = np.zeros(ON_BOX.count, int)
    if light == "lamp":
        faces = cube_face_of(ON_BOX.position.astype(np.float64) - np.array(LIGHTS[light].position))
    for face, frame in enumerate(frames):
        here = faces == face
        u, v, d, _ = frame.project(ON_BOX.position[here]).T
        means = bilinear(convolved(np.exp(80.0 * depth[face]), 5), np.stack([u, v], axis=1) * 40)
        expected[here] = np.minimum(np.exp(-80.0 * (d - 1e-4)) * means, 1.0)
    seen = is_in_field_of_view(LIGHTS[light], ON_BOX.position)
    np.testing.assert_allclose(visibility[seen], expected[seen], atol=3e-5)


@pytest.mark.parametrize("filtering", ["nearest", "bilinear", "trilinear", "anisotropic"])
@pytest.mark.parametrize("light", sorted(LIGHTS))
def test_a_window_of_one_texel_is_no_convolution(light, filtering):
    values = {"light": light, "filtering": filtering, "resolution": 64}
    one, trace = run_method("esm", BOX, ON_BOX, kernel=1, **values)
    none, _ = run_method("esm", BOX, ON_BOX, kernel=0, **values)
    np.testing.assert_array_equal(one, none)
    assert "convolution" not in trace.stages


@pytest.mark.parametrize("filtering", ["nearest", "bilinear", "trilinear", "anisotropic"])
@pytest.mark.parametrize("classification", ["none", "threshold", "z-max"])
@pytest.mark.parametrize("light", sorted(LIGHTS))
def test_filtering_in_log_space_is_filtering_within_float_error(light, classification, filtering):
    values = {"light": light, "filtering": filtering, "classification": classification, "resolution": 100, "kernel": 3}
    linear, _ = run_method("esm", BOX, ON_BOX, **values)
    in_log_space, _ = run_method("esm", BOX, ON_BOX, log_space=True, **values)
    differing = np.abs(linear - in_log_space) > 1e-4
    # a mean within float error of the threshold may be classified either way
    assert differing.sum() <= 1


def test_a_steeper_exponential_in_log_space_leaks_less():
    world = layered((0.02, -2.0), (1.6, 1.9))
    steep, _ = run_method("esm", world, RECEIVERS, c=2000.0, log_space=True, **EXACT)
    separation = depth_of(world, 0.0) - depth_of(world, 0.02)
    np.testing.assert_allclose(steep[RECEIVERS.position[:, 0] < 0.5], np.exp(-2000.0 * separation), rtol=1e-3)


# --- failures


@pytest.fixture(scope="module")
def triangles():
    scene = RandomTriangles()
    world = place(scene.make(scene.Parameters(triangles=300)))
    return world, render(world, world.cameras["middle"], 160, 120, Context(threads=2))


@pytest.mark.parametrize("filtering", ["nearest", "bilinear", "trilinear", "anisotropic"])
@pytest.mark.parametrize("kernel", [0, 3, 7])
@pytest.mark.parametrize("light", ["sun", "lamp"])
def test_z_max_without_an_offset_finds_all_that_the_threshold_finds(triangles, light, kernel, filtering):
    world, receivers = triangles
    found = {}
    for classification, more in (("threshold", {"epsilon": 1e-4}), ("z-max", {"offset": 0.0})):
        values = {"light": light, "kernel": kernel, "filtering": filtering, "classification": classification, **more}
        _, trace = run_method("esm", world, receivers, resolution=128, threads=2, **values)
        found[classification] = trace.masks["classified"]
        assert trace.counters["receivers classified"] == trace.masks["classified"].sum()
    assert found["threshold"].sum() > 50
    assert not (found["threshold"] & ~found["z-max"]).any()


@pytest.mark.parametrize("classification", ["threshold", "z-max"])
def test_wider_windows_fail_at_more_receivers(triangles, classification):
    world, receivers = triangles
    counts = [
        run_method("esm", world, receivers, resolution=512, kernel=kernel, classification=classification)[1].counters[
            "receivers classified"
        ]
        for kernel in (0, 3, 5, 7)
    ]
    assert counts == sorted(counts)
    assert counts[0] < counts[-1]


@pytest.mark.parametrize(("kernel", "source"), [(0, "stored"), (7, "unblurred")])
@pytest.mark.parametrize("log_space", [False, True])
def test_the_fallback_is_bilinear_pcf_but_for_the_leak_of_its_shadowed_texels(triangles, log_space, kernel, source):
    world, receivers = triangles
    values = {"classification": "z-max", "offset": 0.0, "fallback_source": source, "log_space": log_space}
    visibility, trace = run_method("esm", world, receivers, resolution=128, kernel=kernel, bias=1e-4, **values)
    failing = np.flatnonzero(trace.masks["classified"])
    assert len(failing) > 500
    (frame,) = light_frames(world.lights["sun"], world)
    depth = _depths(world, receivers, resolution=128)[0]
    u, v, d, _ = frame.project(receivers.position[failing]).T
    texels, weights = corner_texels(depth, np.stack([u, v], axis=1) * 128)
    receiver = d[:, None] - 1e-4
    pcf = (weights * (receiver <= texels)).sum(axis=1)
    leak = np.where(receiver > texels, np.exp(-80.0 * np.maximum(receiver - texels, 0.0)), 0.0)
    bound = (weights * leak).sum(axis=1)
    excess = visibility[failing] - pcf
    assert (excess >= -1e-4).all()
    assert (excess <= bound + 1e-4).all()
    np.testing.assert_allclose(excess, bound, atol=1e-4)  # indeed the leak itself


@pytest.mark.parametrize("classification", ["threshold", "z-max"])
def test_a_far_background_floods_the_window_at_a_ledge_until_it_falls_back(classification):
    # a shelf in full shadow of a roof that ends where the shelf does: beyond them the ground lies far below
    world = layered((0.0, -2.0), (1.0, 0.1), (1.9, 0.1))
    receivers = _raised(1.0)
    shelf = receivers.position
    at_edge = (shelf[:, 0] > 0.1 + 1e-3) & (shelf[:, 0] < 0.1 + 1.5 * 4.0 / 128)
    values = {"resolution": 128, "kernel": 5, "filtering": "bilinear"}
    flooded, _ = run_method("esm", world, receivers, classification="none", **values)
    assert (flooded[at_edge] == 1.0).all()
    chosen = {"classification": classification, "fallback_source": "unblurred"}
    saved, trace = run_method("esm", world, receivers, **chosen, **values)
    assert trace.masks["classified"][at_edge].all()
    inside = at_edge & (shelf[:, 0] > 0.1 + 4.0 / 128)
    assert saved[inside].max() < 1e-3
    # the map that is kept is blurred itself: there the artefact stays, as published
    stored, _ = run_method("esm", world, receivers, **{**chosen, "fallback_source": "stored"}, **values)
    assert (stored[inside] == 1.0).any()


@pytest.mark.parametrize("log_space", [False, True])
def test_one_column_of_texels_of_a_huge_exponent_floods_its_windows_and_no_more(log_space):
    # a slit in a roof and in the shelf under it, through which one column of texels sees the ground far below
    slit = (0.3, 0.335)
    world = layered(*((height, *span) for height in (1.0, 1.9) for span in ((-2.0, slit[0]), (slit[1], 2.0))))
    receivers = _raised(1.0)
    values = {**EXACT, "c": 87.0, "kernel": 7, "log_space": log_space}
    flooded, trace = run_method("esm", world, receivers, **values)
    assert all(np.isfinite(array.numpy()).all() for array in trace.kept.values())
    (frame,) = light_frames(world.lights["sun"], world)
    columns = np.flatnonzero((_depths(world, resolution=128)[0] > depth_of(world, 0.5)).any(axis=0))
    assert len(columns) == 1
    distance = np.abs(frame.project(receivers.position)[:, 0] * 128 - (columns[0] + 0.5))
    assert (flooded[distance < 3.9] == 1.0).all()
    assert flooded[distance > 4.1].max() < 1e-15
    # the fallback tests single texels: of the blurred map they are flooded too, of the other one only the slit's is
    stored, _ = run_method("esm", world, receivers, **{**values, "classification": "threshold"})
    assert (stored[distance < 2.0] == 1.0).all()
    unblurred = {"classification": "threshold", "fallback_source": "unblurred"}
    rescued, _ = run_method("esm", world, receivers, **{**values, **unblurred})
    assert rescued[distance > 1.1].max() < 1e-15


@pytest.mark.parametrize("classification", ["threshold", "z-max"])
def test_polygon_offset_alone_does_not_fail_a_plane(classification):
    world = box_over_ground(lights={"sun": DirectionalLight((0.8, 1.0, 0.3))})
    receivers = render(world, world.cameras["front"], 120, 90, Context())
    on_ground = (receivers.instance == 0) & (receivers.position[:, 2] > 1.5) & (receivers.position[:, 0] > 0.0)
    on_ground &= (np.abs(receivers.position[:, [0, 2]]) < 2.6).all(axis=1)
    assert on_ground.sum() > 100
    values = {"classification": classification, "kernel": 3, "filtering": "bilinear", "resolution": 512}
    _, trace = run_method("esm", world, receivers, slope_bias=4.0, offset=0.02, **values)
    assert not trace.masks["classified"][on_ground].any()


# --- what is declared


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({}, {"exponential map": 22_369_620}),
        ({"classification": "z-max"}, {"exponential map": 22_369_620, "maximum map": 22_369_620}),
        ({"fallback_source": "unblurred"}, {"exponential map": 22_369_620, "unblurred map": 16_777_216}),
        ({"fallback_source": "unblurred", "kernel": 0}, {"exponential map": 22_369_620}),
        ({"fallback_source": "unblurred", "classification": "none"}, {"exponential map": 22_369_620}),
        ({"filtering": "bilinear"}, {"exponential map": 16_777_216}),
        ({"log_space": True}, {"logarithmic map": 22_369_620}),
    ],
)
def test_memory_is_counted_by_the_byte(values, expected):
    _, trace = run_method("esm", BOX, ON_BOX, resolution=2048, threads=2, **values)
    assert trace.bytes_by_name() == expected


def test_stages_are_the_papers_steps():
    _, trace = run_method("esm", BOX, ON_BOX, classification="z-max")
    expected = ["depth map", "exponential map", "convolution", "mip chain", "maximum map", "look-up"]
    assert list(trace.stages) == expected


@pytest.mark.parametrize(("filtering", "texels"), [("nearest", 4), ("bilinear", 4)])
def test_texels_are_counted(filtering, texels):
    values = {"filtering": filtering, "classification": "none", "resolution": 64}
    _, trace = run_method("esm", BOX, ON_BOX, **values)
    assert trace.counters["texels looked up"] == texels * ON_BOX.count
    assert trace.counters["chain texels"] == 64 * 64


def test_a_steepness_that_overflows_float32_is_refused_unless_in_log_space():
    model = REGISTRY.method("esm").Parameters
    with pytest.raises(ParameterError, match=r"c = 88 overflows float32.* at most 87, or set log_space"):
        parse_parameters(model, {"c": "88"}, owner="method 'esm'")
    assert parse_parameters(model, {"c": "88", "log_space": "true"}, owner="method 'esm'").c == 88.0
    assert parse_parameters(model, {"c": "87"}, owner="method 'esm'").c == 87.0
