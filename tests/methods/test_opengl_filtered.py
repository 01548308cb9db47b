"""OpenGL's exponential and variance shadow maps, step by step, against NumPy and closed forms."""

import numpy as np
import pytest
from builders import square
from hypothesis import given, settings
from hypothesis import strategies as st
from map_filters import bilinear, blurred, four_places, trilinear
from opengl_peer import maps_of, needs_opengl, opengl
from running import run_method
from surfaces import scattered_receivers, soup, world_of
from tracing import shaded

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.errors import ParameterError
from shadowbench.light_space import light_frames
from shadowbench.methods.opengl.exponential import ExponentialParameters
from shadowbench.parameters import parse_parameters
from shadowbench.scene import DirectionalLight, PointLight, SpotLight

pytestmark = needs_opengl

LIGHTS = {
    "sun": DirectionalLight((0.4, 1.0, 0.3)),
    "spot": SpotLight((1.5, 4.0, 1.0), (-1.5, -4.0, -1.0), 70.0),
    "lamp": PointLight((0.2, 0.9, 0.1)),
}
SIZE = 128
WORLD = world_of(soup(400, np.random.default_rng(1)), lights=LIGHTS)
RECEIVERS = render(WORLD, WORLD.cameras["front"], 96, 72, Context())
(FRAME,) = light_frames(WORLD.lights["sun"], WORLD)
C = 80.0


def built(name, light="sun", **values):
    method = opengl(name, **{"resolution": SIZE, "kernel": 0, "bias": 0.0} | values)
    visibility, trace = shaded(method, WORLD, WORLD.lights[light], RECEIVERS)
    return method, visibility, trace


def placed():
    """Place in the sun's map, depth, and the pixel's footprint in the map as two vectors [texels]."""
    u, v, d, _ = FRAME.project(RECEIVERS.position).T
    steps = (RECEIVERS.position_dx, RECEIVERS.position_dy)
    return u, v, d, [SIZE * step.astype(np.float64) @ FRAME.projection[:2, :3].T for step in steps]


def filtered_by_numpy(method, filtering):
    """The maps' filtered values at the receivers."""
    u, v, _, footprint = placed()
    if filtering == "nearest":
        return maps_of(method)[0][np.floor(v * SIZE).astype(int), np.floor(u * SIZE).astype(int)]
    if filtering == "bilinear":
        return bilinear(maps_of(method)[0], u, v)
    chain = [maps_of(method, level)[0].astype(np.float64) for level in range(SIZE.bit_length())]
    sides = np.stack([np.linalg.norm(side, axis=1) for side in footprint])
    longer, shorter = sides.max(axis=0), sides.min(axis=0)
    assert (longer > 2.0).mean() > 0.1  # not all in the base level
    if filtering == "trilinear":
        return trilinear(chain, u, v, np.log2(np.maximum(longer, 1.0)))
    # EXT_texture_filter_anisotropic: N samples along the longer side
    count = np.minimum(np.ceil(longer / shorter), method.parameters.anisotropy)
    assert len(np.unique(count)) > 2
    along = np.where(sides[0] > sides[1], footprint[0].T, footprint[1].T) / SIZE
    detail = np.log2(np.maximum(longer / count, 1.0))
    total = 0.0
    for k in range(1, int(count.max()) + 1):
        du, dv = (k / (count + 1.0) - 0.5) * along
        total = total + np.where(k <= count, trilinear(chain, u + du, v + dv, detail).T, 0.0)
    return (total / count).T


def chebyshev(moments, d, least):
    variance = np.maximum(moments[:, 1] - moments[:, 0] ** 2, least)
    return np.where(d <= moments[:, 0], 1.0, variance / (variance + (d - moments[:, 0]) ** 2))


@pytest.mark.parametrize("light", LIGHTS)
def test_the_maps_hold_functions_of_the_depth_that_the_shadow_map_holds(light):
    shadow_map = opengl("shadow-map", resolution=SIZE, slope_bias=0.0)
    shaded(shadow_map, WORLD, WORLD.lights[light], RECEIVERS)
    z = maps_of(shadow_map).astype(np.float64)
    exponentials, moments = (maps_of(built(name, light)[0]) for name in ("esm", "vsm"))
    for depth in (np.log(exponentials.astype(np.float64)) / C, moments[..., 0]):
        # the depth buffer has 24 bits; across a triangle seen edge-on float32 loses more
        assert np.quantile(np.abs(depth - z), 0.999) < 1e-6
        np.testing.assert_allclose(depth, z, atol=1e-4)
    np.testing.assert_allclose(moments[..., 1], moments[..., 0] ** 2, atol=2e-7)


@pytest.mark.parametrize("kernel", [3, 5, 7])
@pytest.mark.parametrize("name", ["esm", "vsm"])
def test_the_blur_is_the_gauss_kernels(name, kernel):
    sharp, soft = maps_of(built(name)[0])[0], maps_of(built(name, kernel=kernel)[0])[0]
    np.testing.assert_allclose(soft, blurred(sharp, kernel), rtol=1e-5)
    assert not np.allclose(soft, sharp, rtol=1e-2)


@pytest.mark.parametrize("name", ["esm", "vsm"])
def test_a_kernel_of_one_is_no_blur(name):
    np.testing.assert_array_equal(maps_of(built(name, kernel=1)[0]), maps_of(built(name)[0]))


@pytest.mark.parametrize("name", ["esm", "vsm"])
def test_each_level_of_the_mip_chain_is_the_mean_of_four(name):
    method, _, _ = built(name, kernel=3)
    finer = maps_of(method)[0].astype(np.float64)
    for level in range(1, SIZE.bit_length()):
        coarser = maps_of(method, level)[0]
        means = (finer[::2, ::2] + finer[1::2, ::2] + finer[::2, 1::2] + finer[1::2, 1::2]) / 4.0
        np.testing.assert_allclose(coarser, means, rtol=1e-6)
        finer = coarser.astype(np.float64)


@pytest.mark.parametrize("filtering", ["nearest", "bilinear", "trilinear", "anisotropic"])
def test_the_exponential_look_up_is_numpys(filtering):
    method, found, _ = built("esm", kernel=5, filtering=filtering, classification="none")
    expected = np.minimum(np.exp(-C * placed()[2]) * filtered_by_numpy(method, filtering), 1.0)
    # a place between texels or levels may have eight bits only
    assert np.quantile(np.abs(found - expected), 0.99) < 1e-3
    np.testing.assert_allclose(found, expected, atol=0.02)
    assert 0.2 < (found > 0.99).mean() < 0.95


@pytest.mark.parametrize("filtering", ["nearest", "bilinear", "trilinear", "anisotropic"])
def test_the_variance_look_up_is_numpys(filtering):
    method, found, _ = built("vsm", kernel=5, filtering=filtering, minimum_variance=1e-5, bleeding_reduction=0.2)
    moments = filtered_by_numpy(method, filtering)
    expected = np.clip((chebyshev(moments, placed()[2], 1e-5) - 0.2) / 0.8, 0.0, 1.0)
    assert np.quantile(np.abs(found - expected), 0.99) < 5e-3
    np.testing.assert_allclose(found, expected, atol=0.05)


def test_what_exceeds_one_falls_back_to_four_clamped_tests():
    epsilon = 0.05
    method, found, trace = built("esm", kernel=5, filtering="bilinear", epsilon=epsilon)
    method.explain(RECEIVERS, trace)
    u, v, d, _ = placed()
    base = maps_of(method)[0].astype(np.float64)
    product = np.exp(-C * d) * bilinear(base, u, v)
    doubtful = np.abs(product - 1.0 - epsilon) < 1e-3
    failing = product > 1.0 + epsilon
    classified = trace.masks["classified"]
    np.testing.assert_array_equal(classified[~doubtful], failing[~doubtful])
    assert 0.2 < failing.mean() < 0.95
    # the bilinear mean of clamped tests: clamp where the receiver compares, then weigh
    tests = sum(share * np.minimum(np.exp(-C * d) * base[texel], 1.0) for texel, share in four_places(SIZE, u, v))
    expected = np.where(failing, tests, np.minimum(product, 1.0))
    assert np.abs(found - expected)[~doubtful].max() < 2e-3
    _, unclassified, _ = built("esm", kernel=5, filtering="bilinear", classification="none")
    assert (found <= unclassified).all()
    assert (found < unclassified - 0.1).any()


@pytest.mark.parametrize("gap", [0.01, 0.03, 0.1])
def test_light_leaks_by_the_exponential_of_the_distance(gap):
    # a square over a ground, lit from straight above: deep in its shadow every filtered depth is the square's
    height = 1.0
    squares = square(2.0), square(1.0, height), square(0.5, height + gap)
    world = world_of(*squares, lights={"sun": DirectionalLight((0.0, 1.0, 0.0))})
    (frame,) = light_frames(world.lights["sun"], world)
    receivers = scattered_receivers(world, 4000, np.random.default_rng(2))
    separation = gap / frame.depth_range
    covered = (np.abs(receivers.position[:, [0, 2]]) < 0.3).all(axis=1) & (receivers.position[:, 1] == height)
    found, _ = shaded(opengl("esm", resolution=256, kernel=7, bias=0.0), world, world.lights["sun"], receivers)
    assert covered.sum() > 10
    np.testing.assert_allclose(found[covered], np.exp(-C * separation), rtol=1e-3)


def test_one_blocker_over_a_parallel_plane_gives_the_lit_share():
    # Chebyshev's inequality is an equality for one blocker: within the blur of its edge, the share of lit texels
    world = world_of(square(2.0), square(1.0, 1.0), lights={"sun": DirectionalLight((0.0, 1.0, 0.0))})
    (frame,) = light_frames(world.lights["sun"], world)
    receivers = scattered_receivers(world, 20_000, np.random.default_rng(3))
    ground = receivers.position[:, 1] == 0.0
    method = opengl("vsm", resolution=SIZE, kernel=7, filtering="bilinear", minimum_variance=0.0, bias=0.0)
    found, _ = shaded(method, world, world.lights["sun"], receivers)
    u, v, _, _ = frame.project(receivers.position[ground]).T
    depth = opengl("shadow-map", resolution=SIZE, slope_bias=0.0)
    shaded(depth, world, world.lights["sun"], receivers)
    z = maps_of(depth)[0]
    lit = bilinear(blurred((z > (z.min() + 1.0) / 2.0).astype(float), 7), u, v)
    partial = (lit > 0.05) & (lit < 0.95)
    assert partial.sum() > 100
    np.testing.assert_allclose(found[ground][partial], lit[partial], atol=5e-3)


@pytest.mark.parametrize("filtering", ["trilinear", "anisotropic"])
@pytest.mark.parametrize(("name", "values"), [("esm", {}), ("vsm", {"minimum_variance": 1e-4})])
def test_a_plane_alone_is_lit_however_it_is_filtered(name, values, filtering):
    world = world_of(square(2.0), lights=LIGHTS)
    receivers = render(world, world.cameras["front"], 80, 60, Context())
    method = opengl(name, resolution=SIZE, filtering=filtering, bias=1e-3, slope_bias=1.0, **values)
    for light in ("sun", "lamp"):
        found, _ = shaded(method, world, world.lights[light], receivers)
        method.close()
        assert found.min() > 0.98


def test_anisotropy_blurs_less_than_the_longer_side_of_the_footprint():
    world = world_of(square(6.0), square(0.5, 0.6), lights={"sun": DirectionalLight((0.0, 1.0, 0.02))})
    receivers = render(world, world.cameras["front"], 60, 20, Context())
    values = {"resolution": 1024, "kernel": 0, "classification": "none"}
    soft, _ = run_method("opengl-esm", world, receivers, filtering="trilinear", **values)
    sharp, _ = run_method("opengl-esm", world, receivers, filtering="anisotropic", **values)
    half_lit = [((found > 0.1) & (found < 0.9)).sum() for found in (soft, sharp)]
    assert half_lit[1] <= half_lit[0]


@pytest.mark.parametrize(
    ("name", "kept", "byte_count"), [("esm", "exponential map", 22_369_620), ("vsm", "moment map", 44_739_240)]
)
def test_a_map_of_2048_texels_keeps_the_papers_bytes(name, kept, byte_count):
    method, _, trace = built(name, resolution=2048, kernel=7)
    found = trace.bytes_by_name()
    assert found[kept] == byte_count
    assert found["half-blurred map"] == {"esm": 1, "vsm": 2}[name] * 4 * 2048**2
    with method._device:
        (texture,), _ = method.sampled()
        assert sum(len(texture.read(level=level)) for level in range(12)) == byte_count


@settings(max_examples=25, deadline=None)
@given(
    name=st.sampled_from(["esm", "vsm"]),
    light=st.sampled_from(sorted(LIGHTS)),
    resolution=st.sampled_from([1, 2, 37, 64]),
    kernel=st.sampled_from([0, 1, 3, 9, 63]),
    filtering=st.sampled_from(["nearest", "bilinear", "trilinear", "anisotropic"]),
    bias=st.sampled_from([0.0, 1e-3, 1.0]),
    slope_bias=st.sampled_from([0.0, 1.0, 64.0]),
    extreme=st.booleans(),
)
def test_every_result_is_a_visibility(name, light, resolution, kernel, filtering, bias, slope_bias, extreme):
    own = {"esm": {"c": 87.0, "epsilon": 0.0}, "vsm": {"minimum_variance": 0.0, "slope_term": True}}[name]
    values = {
        "resolution": resolution,
        "kernel": kernel,
        "filtering": filtering,
        "bias": bias,
        "slope_bias": slope_bias,
    }
    method, found, _ = built(name, light, **values, **(own if extreme else {}))
    method.close()
    assert np.isfinite(found).all()
    assert ((found >= 0.0) & (found <= 1.0)).all()


def test_even_kernels_and_exponents_that_overflow_are_refused():
    with pytest.raises(ParameterError, match="parameter 'kernel' = '4': a blur's width is odd, or 0 for none"):
        parse_parameters(ExponentialParameters, {"kernel": "4"}, owner="method 'opengl-esm'")
    with pytest.raises(ParameterError, match=r"parameter 'c' = '88'.*less than or equal to 87"):
        parse_parameters(ExponentialParameters, {"c": "88"}, owner="method 'opengl-esm'")


def test_the_footprint_is_told_to_the_filtered_reference():
    kernel = opengl("esm", resolution=64, kernel=7).kernel(RECEIVERS)
    assert (kernel.shape, kernel.width, kernel.resolution) == ("gauss", 7.0, 64)
    assert kernel.sigma == pytest.approx(1.4)
    assert opengl("vsm", resolution=64, kernel=0).kernel(RECEIVERS).shape == "bilinear"
    assert opengl("vsm", resolution=64, kernel=1, filtering="nearest").kernel(RECEIVERS) is None
