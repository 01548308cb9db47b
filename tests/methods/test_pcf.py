import dataclasses

import numpy as np
import pytest
from builders import box_over_ground
from layers import RECEIVERS as ON_LAYERS
from layers import layered
from running import run_method

from shadowbench.camera_pass import render
from shadowbench.device.filter_weights import tap_weights
from shadowbench.errors import ParameterError
from shadowbench.light_space import light_frames
from shadowbench.method import Context
from shadowbench.methods.pcf import PercentageCloserFiltering
from shadowbench.parameters import parse_parameters

WORLD = box_over_ground()
RECEIVERS = render(WORLD, WORLD.cameras["front"], 120, 90, Context())


def _tests(depth, columns, rows, d, bias):
    size = depth.shape[1]
    return d - bias <= depth[np.clip(rows, 0, size - 1), np.clip(columns, 0, size - 1)]


def _place(resolution):
    (frame,) = light_frames(WORLD.lights["sun"], WORLD)
    u, v, d, _ = frame.project(RECEIVERS.position).T
    return u * resolution, v * resolution, d


@pytest.mark.parametrize("shape", ["box", "gauss"])
@pytest.mark.parametrize("kernel", [1, 2, 3, 4, 5, 8])
def test_the_result_is_the_weighted_mean_of_the_comparisons(shape, kernel):
    values = {"filter": shape, "kernel": kernel, "resolution": 150, "bias": 1e-4}
    visibility, trace = run_method("pcf", WORLD, RECEIVERS, **values)
    depth = trace.kept["shadow map"].numpy()[0]
    x, y, d = _place(150)
    # the texel centres of an odd footprint lie around the holding texel, of an even one around the nearest corner
    first_x = np.floor(x - (kernel % 2 == 0) * 0.5).astype(int) - (kernel - 1) // 2
    first_y = np.floor(y - (kernel % 2 == 0) * 0.5).astype(int) - (kernel - 1) // 2
    weights = tap_weights(shape, kernel)
    expected = np.zeros(RECEIVERS.count)
    for j in range(kernel):
        for i in range(kernel):
            expected += weights[i] * weights[j] * _tests(depth, first_x + i, first_y + j, d, 1e-4)
    differing = np.abs(visibility - expected) > 1e-5
    assert differing.sum() <= 2  # within rounding of a texel's border


def test_bilinear_weighs_the_four_comparisons_by_distance_to_the_centres():
    visibility, trace = run_method("pcf", WORLD, RECEIVERS, filter="bilinear", resolution=150, bias=1e-4)
    depth = trace.kept["shadow map"].numpy()[0]
    x, y, d = _place(150)
    expected = np.zeros(RECEIVERS.count)
    for j in (0, 1):
        for i in (0, 1):
            column, row = np.floor(x - 0.5).astype(int) + i, np.floor(y - 0.5).astype(int) + j
            share = np.clip(1.0 - np.abs(x - column - 0.5), 0, None) * np.clip(1.0 - np.abs(y - row - 0.5), 0, None)
            expected += share * _tests(depth, column, row, d, 1e-4)
    assert (np.abs(visibility - expected) > 1e-5).sum() <= 2


@pytest.mark.parametrize("light", ["sun", "spot", "lamp"])
def test_one_tap_is_the_shadow_map(light):
    filtered, _ = run_method("pcf", WORLD, RECEIVERS, light=light, kernel=1, resolution=256)
    nearest, _ = run_method("shadow-map", WORLD, RECEIVERS, light=light, resolution=256)
    assert (filtered == nearest).all()


@pytest.mark.parametrize("kernel", [2, 5, 8])
def test_a_bias_that_grows_with_the_footprint_leaves_no_acne_in_the_open(kernel):
    lit = box_over_ground(lift=0.0, lights={"sun": WORLD.lights["sun"]})
    on_top = (RECEIVERS.instance == 1) & (RECEIVERS.normal[:, 1] > 0.9)
    inner = on_top & (np.abs(RECEIVERS.position[:, [0, 2]]) < 0.3).all(axis=1)
    visibility, _ = run_method("pcf", lit, RECEIVERS, kernel=kernel, resolution=128)
    assert inner.sum() > 50
    assert (visibility[inner] == 1.0).all()
    shallow, _ = run_method("pcf", lit, RECEIVERS, kernel=kernel, resolution=128, slope_bias=0.2, bias=0.0)
    assert (shallow[inner] < 1.0).any()


def test_the_footprint_is_told_to_the_filtered_reference():
    method = PercentageCloserFiltering(PercentageCloserFiltering.Parameters(filter="gauss", kernel=5), Context())
    kernel = method.kernel(RECEIVERS)
    assert (kernel.shape, kernel.width, kernel.resolution) == ("gauss", 5.0, 1024)
    assert kernel.sigma == pytest.approx(1.1)


def test_bilinear_takes_no_other_width():
    model = PercentageCloserFiltering.Parameters
    assert parse_parameters(model, {"filter": "bilinear"}, owner="method 'pcf'").kernel == 2
    with pytest.raises(ParameterError, match="2 texels wide, not 5"):
        parse_parameters(model, {"filter": "bilinear", "kernel": "5"}, owner="method 'pcf'")


# --- taps over the pixel


def _sides(frame, receivers, resolution):
    """A pixel's two sides as changes of (x, y, depth), lengthened to a texel: a directional light's are exact."""
    here = frame.project(receivers.position)
    for motion in (receivers.position_dx, receivers.position_dy):
        side = (frame.project(receivers.position + motion) - here)[:, :3] * [resolution, resolution, 1.0]
        side *= np.maximum(1.0 / np.linalg.norm(side[:, :2], axis=1), 1.0)[:, None]
        steepest = 0.02 * np.linalg.norm(side[:, :2], axis=1)  # the bound that all biases by slope have
        yield np.column_stack([side[:, :2], np.clip(side[:, 2], -steepest, steepest)])


@pytest.mark.parametrize("resolution", [64, 2048])
@pytest.mark.parametrize("shape", ["box", "gauss"])
@pytest.mark.parametrize("kernel", [1, 4, 6, 8])
def test_taps_over_a_pixel_compare_points_of_its_surface(kernel, shape, resolution):
    values = {"filter": shape, "kernel": kernel, "resolution": resolution, "footprint": "pixel", "bias": 1e-4}
    visibility, trace = run_method("pcf", WORLD, RECEIVERS, **values)
    depth = trace.kept["shadow map"].numpy()[0]
    x, y, d = _place(resolution)
    (frame,) = light_frames(WORLD.lights["sun"], WORLD)
    across, down = _sides(frame, RECEIVERS, resolution)
    weights = tap_weights(shape, kernel)
    expected = np.zeros(RECEIVERS.count)
    for j in range(kernel):
        for i in range(kernel):
            moved = ((i + 0.5) / kernel - 0.5) * across + ((j + 0.5) / kernel - 0.5) * down
            column, row = np.floor(x + moved[:, 0]).astype(int), np.floor(y + moved[:, 1]).astype(int)
            expected += weights[i] * weights[j] * _tests(depth, column, row, d + moved[:, 2], 1e-4)
    differing = np.abs(visibility - expected) > 1e-5
    assert differing.sum() <= 0.002 * RECEIVERS.count  # a tap within rounding of a texel's border, or of its depth
    assert trace.counters["texels compared"] == RECEIVERS.count * kernel**2


@pytest.mark.parametrize("light", ["sun", "spot", "lamp"])
def test_one_tap_over_a_pixel_is_the_shadow_map(light):
    filtered, _ = run_method("pcf", WORLD, RECEIVERS, light=light, kernel=1, footprint="pixel", resolution=256)
    nearest, _ = run_method("shadow-map", WORLD, RECEIVERS, light=light, resolution=256)
    assert (filtered == nearest).all()


def test_a_magnified_map_is_filtered_as_by_interpolation():
    world = layered((1.0, 0.013))
    values = {"resolution": 16, "slope_bias": 0.0}  # a pixel is a tenth of a texel
    smooth, _ = run_method("pcf", world, ON_LAYERS, filter="bilinear", **values)
    assert ((smooth > 0.0) & (smooth < 1.0)).sum() > 0
    for kernel in (4, 8, 63):
        over_pixel, _ = run_method("pcf", world, ON_LAYERS, footprint="pixel", kernel=kernel, **values)
        assert np.abs(over_pixel - smooth).max() <= 0.5 / kernel + 1e-5


@pytest.mark.parametrize("light", ["sun", "lamp"])
@pytest.mark.parametrize("resolution", [64, 1024])
def test_taps_over_a_pixel_leave_no_acne_in_the_open_with_a_shadow_maps_bias(light, resolution):
    on_top = (RECEIVERS.instance == 1) & (RECEIVERS.normal[:, 1] > 0.9)
    inner = on_top & (np.abs(RECEIVERS.position[:, [0, 2]]) < 0.3).all(axis=1)
    values = {"footprint": "pixel", "kernel": 8, "resolution": resolution, "bias": 1e-4}
    visibility, _ = run_method("pcf", WORLD, RECEIVERS, light=light, **values)
    assert inner.sum() > 50
    assert (visibility[inner] == 1.0).all()


def test_a_minified_shadow_is_antialiased_over_the_pixel():
    # a pixel covers 20 texels: the edge's pixel is lit by as much of it as the layer leaves uncovered
    world = layered((1.0, 0.013))
    visibility, _ = run_method("pcf", world, ON_LAYERS, footprint="pixel", kernel=32, resolution=2048, slope_bias=0.0)
    side = 1.6 / 64
    lit = np.clip((0.013 - (ON_LAYERS.position[:, 0] - side / 2)) / side, 0.0, 1.0)
    np.testing.assert_allclose(visibility, lit, atol=1.0 / 32 + 2 * 4.0 / 2048 / side)


@pytest.mark.parametrize("motion", [0.0, 1e30, np.inf, np.nan])
def test_a_pixel_without_bounds_is_still_filtered(motion):
    changed = dataclasses.replace(RECEIVERS, position_dx=np.full_like(RECEIVERS.position_dx, motion))
    visibility, _ = run_method("pcf", WORLD, changed, light="lamp", footprint="pixel", kernel=4, resolution=64)
    assert ((visibility >= 0.0) & (visibility <= 1.0)).all()


def test_bilinear_taps_do_not_lie_over_a_pixel():
    with pytest.raises(ParameterError, match="lies between texels"):
        parse_parameters(
            PercentageCloserFiltering.Parameters, {"filter": "bilinear", "footprint": "pixel"}, owner="method 'pcf'"
        )
