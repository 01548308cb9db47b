"""Placing receivers in a light's windows: what is decided there, and native bodies against their plain twins."""

import numpy as np
import pytest
import warp as wp
from irregular import LIGHTS, WORLDS, soup_of

from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.light_samples import LightSamples, lay_down
from shadowbench.device.light_samples_kernels import (
    Sides,
    lay_down_in_sun,
    lay_down_plainly,
    sides_in_sun,
    sides_in_sun_plainly,
)
from shadowbench.device.sample_space import SampleSpace
from shadowbench.reference import hard_reference

wp.set_module_options(kernel_options(native=True))


@wp.kernel
def find_sides(
    first: wp.int32,
    plainly: wp.bool,
    position: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    valid: wp.array[wp.uint8],
    towards: wp.vec3,
    certain: wp.float32,
    window: wp.array[wp.uint8],
    sides: wp.array[Sides],
):
    if plainly:
        sides[0] = sides_in_sun_plainly(position, normal, valid, 3, position.shape[0] - 2, towards, certain, window)
    else:
        sides[0] = sides_in_sun(position, normal, valid, 3, position.shape[0] - 2, towards, certain, window)


@wp.kernel
def lay_down_both_ways(
    first: wp.int32,
    plainly: wp.bool,
    space: SampleSpace,
    window: wp.array[wp.uint8],
    position: wp.array[wp.vec3],
    records: wp.array[wp.vec4],
):
    if plainly:
        lay_down_plainly(space, 0, window, position, 3, position.shape[0] - 2, 5, records)
    else:
        lay_down_in_sun(space, window, position, 3, position.shape[0] - 2, 5, records)


def test_the_native_sides_mean_the_plain_ones():
    _, receivers = soup_of(60)
    receivers.valid[::7] = False
    on_device = receivers.on("cpu")
    results = []
    for plainly in (False, True):
        window = wp.zeros(receivers.count, dtype=wp.uint8, device="cpu")
        sides = wp.zeros(1, dtype=Sides, device="cpu")
        inputs = [plainly, on_device.position, on_device.normal, on_device.valid, wp.vec3(0.4, 0.9, 0.1), 0.2]
        launch(find_sides, 1, inputs, [window, sides], context=Context())
        results.append((window.numpy(), sides.numpy()))
    np.testing.assert_array_equal(results[0][0], results[1][0])
    np.testing.assert_array_equal(results[0][1], results[1][1])
    found, counts = results[0][0][3:-2], results[0][1][0, 6:]
    assert counts.tolist() == [(found == 0).sum(), (~np.isin(found, (0, 255))).sum()]
    assert (counts > 0).all()


def test_the_native_records_in_the_sun_are_the_plain_ones():
    world, receivers = soup_of(60)
    visibility = wp.empty(receivers.count, dtype=wp.float32, device="cpu")
    (window,) = LightSamples(Context()).place_receivers(receivers, world.lights["directional"], world, visibility)
    laid = []
    for plainly in (False, True):
        records = wp.zeros(window.count + 5, dtype=wp.vec4, device="cpu")
        inputs = [plainly, window.space, window.window, window.position]
        launch(lay_down_both_ways, 1, inputs, [records], context=Context())
        laid.append(records.numpy())
    np.testing.assert_array_equal(laid[0], laid[1])
    assert np.abs(laid[0][:, :3]).max() <= 1.0 + 1e-6


@pytest.mark.parametrize("light", LIGHTS)
def test_every_receiver_in_the_field_that_is_not_turned_away_is_a_sample_of_one_window(light):
    world, receivers = WORLDS["solids"]()
    visibility = wp.full(receivers.count, value=np.nan, dtype=wp.float32, device="cpu")
    windows = LightSamples(Context()).place_receivers(receivers, world.lights[light], world, visibility)
    truth = hard_reference(world, receivers, world.lights[light], Context())
    numbers = []
    for window in windows:
        records = wp.empty(window.count, dtype=wp.vec4, device="cpu")
        lay_down(window, records, Context())
        number = records.numpy()[:, 3].copy().view(np.int32)
        assert (np.diff(number) > 0).all()
        assert np.abs(records.numpy()[:, :2]).max() <= 1.0 + 1e-4
        numbers.append(number)
    asked = np.flatnonzero(truth.in_field & ~truth.turned_away)
    np.testing.assert_array_equal(np.sort(np.concatenate(numbers)), asked)
    assert (visibility.numpy() == 0.0).all()
