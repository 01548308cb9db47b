"""Filters of maps against OpenCV, against plain Warp bit for bit, and on what they must leave alone."""

import cv2
import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.device.filter_weights import tap_weights
from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.separable_filters import convolve, convolve_logarithms, keep_maxima
from shadowbench.device.separable_filters_kernels import (
    logarithmic_mean_plain,
    maximum_plain,
    mean_plain,
    plain_filtering_kernel,
)

wp.set_module_options(kernel_options(native=True))

RANDOM = np.random.default_rng(3)
THREADS = [1, 2, 3]
SHAPES = [(1, 37, 53, 1), (2, 5, 1300, 2), (3, 20, 24, 4), (1, 9, 4300, 1), (6, 3, 11, 32), (1, 7, 90, 24)]
STEEPNESS = 80.0

PLAIN = {
    "mean": plain_filtering_kernel(mean_plain),
    "maximum": plain_filtering_kernel(maximum_plain),
    "logarithm": plain_filtering_kernel(logarithmic_mean_plain),
}


def _map(shape, dtype=np.float32):
    values = RANDOM.random(shape)
    return (values * 255.99).astype(np.uint8) if dtype == np.uint8 else values.astype(dtype)


def _filtered(kind, values, weights, threads=1):
    source = wp.array(values, dtype=wp.uint8 if values.dtype == np.uint8 else wp.float32, device="cpu")
    target = wp.zeros_like(source)
    context = Context(threads=threads)
    if kind == "mean":
        convolve(source, target, weights, context)
    elif kind == "maximum":
        keep_maxima(source, target, len(weights), context)
    else:
        convolve_logarithms(source, target, weights, STEEPNESS, context)
    return target.numpy()


def _filtered_plainly(kind, values, weights):
    _, rows, columns, channels = values.shape
    arrays = [wp.array(values.reshape(-1), dtype=wp.float32, device="cpu")]
    taps = wp.array(weights.astype(np.float32), device="cpu")
    for stride, count in ((channels, columns), (channels * columns, rows)):
        target = wp.zeros_like(arrays[-1])
        inputs = [arrays[-1], taps, STEEPNESS, stride, count]
        launch(PLAIN[kind], target.size, inputs=inputs, outputs=[target], context=Context())
        arrays.append(target)
    return arrays[-1].numpy().reshape(values.shape)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("width", [1, 2, 3, 6, 7, 63])
@pytest.mark.parametrize("kind", ["mean", "maximum", "logarithm"])
def test_native_and_plain_filters_agree_bit_for_bit_on_any_number_of_threads(kind, width, shape):
    values, weights = _map(shape), tap_weights("gauss", width)
    expected = _filtered_plainly(kind, values, weights).view(np.int32)
    for threads in THREADS:
        np.testing.assert_array_equal(_filtered(kind, values, weights, threads).view(np.int32), expected)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("width", [2, 7])
def test_bytes_are_filtered_as_floats_and_rounded_once(width, shape):
    values, weights = _map(shape, np.uint8), tap_weights("gauss", width)
    means = _filtered_plainly("mean", values.astype(np.float32), weights)
    for threads in THREADS:
        np.testing.assert_array_equal(_filtered("mean", values, weights, threads), np.floor(means + np.float32(0.5)))


@pytest.mark.parametrize("channels", [1, 2, 4])
@pytest.mark.parametrize("width", [3, 5, 7, 15])
def test_gauss_windows_filter_as_opencvs(width, channels):
    values, weights = _map((1, 61, 83, channels)), tap_weights("gauss", width)
    expected = cv2.sepFilter2D(values[0], -1, weights, weights, borderType=cv2.BORDER_REPLICATE)
    np.testing.assert_allclose(_filtered("mean", values, weights)[0], expected.reshape(61, 83, channels), atol=5e-7)


@pytest.mark.parametrize("width", [2, 3, 4, 5, 8])
def test_boxes_filter_as_opencvs_even_ones_with_one_texel_more_before(width):
    values, weights = _map((1, 40, 40, 1)), tap_weights("box", width)
    expected = cv2.blur(values[0, ..., 0], (width, width), borderType=cv2.BORDER_REPLICATE)
    np.testing.assert_allclose(_filtered("mean", values, weights)[0, ..., 0], expected, atol=5e-7)


@pytest.mark.parametrize("width", [1, 2, 3, 7])
def test_maxima_are_opencvs_dilation(width):
    values = _map((1, 50, 41, 1))
    expected = cv2.dilate(values[0, ..., 0], np.ones((width, width), np.uint8), borderType=cv2.BORDER_REPLICATE)
    np.testing.assert_array_equal(_filtered("maximum", values, np.ones(width))[0, ..., 0], expected)


@pytest.mark.parametrize("width", [3, 7])
def test_logarithmic_means_are_the_logarithms_of_means_of_exponentials(width):
    values, weights = _map((1, 33, 47, 1)), tap_weights("gauss", width)
    powers = np.exp(STEEPNESS * values.astype(np.float64))[0, ..., 0]
    means = cv2.sepFilter2D(powers, -1, weights, weights, borderType=cv2.BORDER_REPLICATE)
    found = _filtered("logarithm", values, weights)[0, ..., 0]
    np.testing.assert_allclose(found, np.log(means) / STEEPNESS, rtol=0.0, atol=3e-7)


@settings(max_examples=50, deadline=None)
@given(
    value=st.floats(2.0**-100, 2.0**100, width=32),
    width=st.sampled_from([1, 2, 3, 4, 5, 7, 33]),
    kind=st.sampled_from(["mean", "maximum"]),
    shape=st.sampled_from(["gauss", "box"]),
)
def test_a_constant_map_comes_out_unchanged_to_the_last_bit(value, width, kind, shape):
    values = np.full((1, 9, 40, 2), value, np.float32)
    np.testing.assert_array_equal(_filtered(kind, values, tap_weights(shape, width)), values)


@settings(max_examples=30, deadline=None)
@given(value=st.floats(0.0, 1.0, width=32), width=st.sampled_from([1, 3, 7]))
def test_a_constant_map_comes_out_unchanged_in_log_space(value, width):
    values = np.full((1, 9, 40, 1), value, np.float32)
    np.testing.assert_array_equal(_filtered("logarithm", values, tap_weights("gauss", width)), values)


@pytest.mark.parametrize("value", [0, 1, 127, 128, 255])
def test_constant_bytes_come_out_unchanged(value):
    values = np.full((1, 9, 40, 32), value, np.uint8)
    np.testing.assert_array_equal(_filtered("mean", values, tap_weights("gauss", 7)), values)


def test_a_single_texel_of_any_size_leaves_the_others_means_positive_and_finite():
    values = np.ones((1, 15, 15, 1), np.float32)
    values[0, 7, 7] = np.exp(87.0)
    means = _filtered("mean", values, tap_weights("gauss", 7))[0, ..., 0]
    assert np.isfinite(means).all()
    assert (means >= 1.0).all()
    assert (means[:4] == 1.0).all()  # outside its windows
    weight = tap_weights("gauss", 7)[3] ** 2
    np.testing.assert_allclose(means[7, 7], weight * np.exp(87.0), rtol=1e-5)


def test_what_cannot_be_filtered_is_refused():
    source = wp.zeros((1, 4, 4, 1), dtype=wp.float32, device="cpu")
    target = wp.zeros_like(source)
    with pytest.raises(ValueError, match="another array"):
        convolve(source, source, tap_weights("gauss", 3), Context())
    with pytest.raises(ValueError, match="must be symmetric"):
        convolve(source, target, np.array([0.5, 0.3, 0.2]), Context())
    with pytest.raises(ValueError, match="65 taps"):
        convolve(source, target, tap_weights("gauss", 65), Context())
    with pytest.raises(ValueError, match="contiguous"):
        keep_maxima(wp.zeros((1, 4, 4, 2), dtype=wp.float32, device="cpu")[:, :, :, :1], target, 3, Context())
