"""Encodings of depth against NumPy's float64, and native bodies against plain Warp bit for bit."""

import numpy as np
import pytest
import warp as wp

from shadowbench.device.depth_encodings import encode_exponentials, encode_fourier_terms, encode_moments
from shadowbench.device.depth_encodings_kernels import (
    basis_kernel,
    basis_of_row_plain,
    exponential_kernel,
    exponentials_of_row_plain,
    moment_kernel,
    moments_of_row_plain,
)
from shadowbench.device.launch import Context, kernel_options, launch

wp.set_module_options(kernel_options(native=True))

RANDOM = np.random.default_rng(9)
SHAPES = [(1, 37, 37), (6, 16, 16), (1, 1, 1), (2, 2, 2), (1, 100, 100)]

exponentials_plain = exponential_kernel(exponentials_of_row_plain)
moments_plain = moment_kernel(moments_of_row_plain)
basis_plain = basis_kernel(basis_of_row_plain, wp.float32)
basis_in_bytes_plain = basis_kernel(basis_of_row_plain, wp.uint8)


def _depth(shape):
    return RANDOM.random(shape).astype(np.float32)


def _encoded(encode, depth, channels, dtype=wp.float32, threads=2):
    target = wp.zeros((*depth.shape, channels), dtype=dtype, device="cpu")
    encode(wp.array(depth, dtype=wp.float32, device="cpu"), target, Context(threads=threads))
    return target.numpy()


def _encoded_plainly(kernel, depth, channels, arguments, dtype=wp.float32):
    target = wp.zeros(depth.size * channels, dtype=dtype, device="cpu")
    inputs = [wp.array(depth.reshape(-1), dtype=wp.float32, device="cpu"), *arguments]
    launch(kernel, depth.shape[0] * depth.shape[1], inputs=inputs, outputs=[target], context=Context())
    return target.numpy().reshape(*depth.shape, channels)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("steepness", [1.0, 80.0, 87.0])
def test_exponentials(steepness, shape):
    depth = _depth(shape)
    found = _encoded(lambda d, t, c: encode_exponentials(d, t, steepness, c), depth, 1)
    np.testing.assert_array_equal(found, _encoded_plainly(exponentials_plain, depth, 1, [steepness, shape[2]]))
    exact = np.exp(steepness * depth.astype(np.float64))
    # the exponent itself is rounded: half an ulp of it
    np.testing.assert_allclose(found[..., 0], exact, rtol=2.0**-23 + steepness * 2.0**-24)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("has_slopes", [False, True])
def test_moments(has_slopes, shape):
    depth = _depth(shape)
    found = _encoded(lambda d, t, c: encode_moments(d, t, c, has_slopes=has_slopes), depth, 2)
    arguments = [0.25 if has_slopes else 0.0, shape[1], shape[2]]
    np.testing.assert_array_equal(found, _encoded_plainly(moments_plain, depth, 2, arguments))
    np.testing.assert_array_equal(found[..., 0], depth)
    if not has_slopes:
        np.testing.assert_array_equal(found[..., 1], depth * depth)


def test_a_planes_second_moment_grows_by_a_quarter_of_its_squared_slopes_at_edges_too():
    row, column = np.mgrid[0:24, 0:24]
    depth = (0.3 + column / 128.0 + row / 64.0).astype(np.float32)  # exact in float32
    found = _encoded(lambda d, t, c: encode_moments(d, t, c, has_slopes=True), depth[None], 2)[0]
    expected = depth.astype(np.float64) ** 2 + 0.25 * (1.0 / 128.0**2 + 1.0 / 64.0**2)
    np.testing.assert_allclose(found[..., 1], expected, rtol=1e-6)


def test_a_step_between_two_flat_surfaces_has_no_slope():
    depth = np.full((1, 8, 8), 0.25, np.float32)
    depth[:, :, 4:] = 0.75
    found = _encoded(lambda d, t, c: encode_moments(d, t, c, has_slopes=True), depth, 2)
    np.testing.assert_array_equal(found[..., 1], depth * depth)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("terms", [1, 5, 16, 20])
def test_fourier_terms(terms, shape):
    depth = _depth(shape)
    angles = np.pi * (2 * np.arange(terms) + 1) * depth[..., None].astype(np.float64)
    exact = np.concatenate([np.sin(angles), np.cos(angles)], axis=-1)

    found = _encoded(lambda d, t, c: encode_fourier_terms(d, t, terms, c), depth, 2 * terms)
    np.testing.assert_array_equal(found, _encoded_plainly(basis_plain, depth, 2 * terms, [terms, shape[2]]))
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=1e-5)

    found = _encoded(lambda d, t, c: encode_fourier_terms(d, t, terms, c), depth, 2 * terms, wp.uint8)
    plain = _encoded_plainly(basis_in_bytes_plain, depth, 2 * terms, [terms, shape[2]], wp.uint8)
    np.testing.assert_array_equal(found, plain)
    assert np.abs(found - (exact * 0.5 + 0.5) * 255.0).max() <= 0.5 + 255.0 * 1e-5
