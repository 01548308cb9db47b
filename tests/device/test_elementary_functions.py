"""Polynomials against NumPy's float64 functions, and vectors of sixteen against numbers one by one."""

import numpy as np
import pytest
import warp as wp

from shadowbench.device.elementary_functions import (
    VECTOR_EXPONENTIAL,
    VECTOR_LOGARITHM,
    VECTOR_SINE_AND_COSINE,
    exponential,
    logarithm,
    sine_and_cosine,
)
from shadowbench.device.launch import Context, kernel_options, launch

wp.set_module_options(kernel_options(native=True))

COUNT = 1 << 16
RANDOM = np.random.default_rng(11)

_VECTORS = """
    typedef float floats __attribute__((ext_vector_type(16)));
    typedef int ints __attribute__((ext_vector_type(16)));
    typedef float unaligned __attribute__((ext_vector_type(16), aligned(4)));
    auto at = [&](wp::array_t<float>& values) -> unaligned& { return *(unaligned*)(values.data + i); };
"""


@wp.func_native(
    _VECTORS
    + VECTOR_EXPONENTIAL
    + VECTOR_LOGARITHM
    + VECTOR_SINE_AND_COSINE
    + """
    floats s, c;
    sine_and_cosine(at(x), s, c);
    at(power) = exponential(at(x));
    at(log) = logarithm(at(positive));
    at(sine) = s;
    at(cosine) = c;
"""
)
def sixteen(
    x: wp.array[wp.float32],
    positive: wp.array[wp.float32],
    i: wp.int32,
    power: wp.array[wp.float32],
    log: wp.array[wp.float32],
    sine: wp.array[wp.float32],
    cosine: wp.array[wp.float32],
): ...


@wp.kernel
def evaluate_vectors(
    first: wp.int32,
    x: wp.array[wp.float32],
    positive: wp.array[wp.float32],
    power: wp.array[wp.float32],
    log: wp.array[wp.float32],
    sine: wp.array[wp.float32],
    cosine: wp.array[wp.float32],
):
    i = 16 * (wp.tid() + first)
    sixteen(x, positive, i, power, log, sine, cosine)


@wp.kernel
def evaluate(
    first: wp.int32,
    x: wp.array[wp.float32],
    positive: wp.array[wp.float32],
    power: wp.array[wp.float32],
    log: wp.array[wp.float32],
    sine: wp.array[wp.float32],
    cosine: wp.array[wp.float32],
):
    i = wp.tid() + first
    power[i] = exponential(x[i])
    log[i] = logarithm(positive[i])
    pair = sine_and_cosine(x[i])
    sine[i] = pair[0]
    cosine[i] = pair[1]


@pytest.fixture(scope="module")
def values():
    x = RANDOM.uniform(-87.0, 88.0, COUNT).astype(np.float32)
    x[:8] = [0.0, -0.0, 1.0, -1.0, 0.5, -87.0, 88.0, 1e-30]
    positive = np.exp(RANDOM.uniform(-80.0, 80.0, COUNT)).astype(np.float32)
    positive[: COUNT // 2] = RANDOM.uniform(0.5, 2.0, COUNT // 2)
    positive[:4] = [1.0, 0.5, 2.0, np.nextafter(np.float32(1.0), np.float32(0.0))]
    inputs = [wp.array(a, dtype=wp.float32, device="cpu") for a in (x, positive)]
    found = [[wp.empty(COUNT, dtype=wp.float32, device="cpu") for _ in range(4)] for _ in range(2)]
    launch(evaluate, COUNT, inputs=inputs, outputs=found[0], context=Context())
    launch(evaluate_vectors, COUNT // 16, inputs=inputs, outputs=found[1], context=Context())
    single, vectors = ([a.numpy() for a in arrays] for arrays in found)
    return x.astype(np.float64), positive.astype(np.float64), single, vectors


def test_the_exponential_is_within_an_ulp(values):
    x, _, (power, *_), _ = values
    np.testing.assert_allclose(power, np.exp(x), rtol=2.0**-23)
    assert (power[x == 0.0] == 1.0).all()


def test_the_logarithm_is_within_an_ulp(values):
    _, positive, (_, log, *_), _ = values
    exact = np.log(positive)
    assert (np.abs(log - exact) <= np.spacing(np.abs(exact).astype(np.float32))).all()
    assert (log[positive == 1.0] == 0.0).all()


def test_sine_and_cosine_are_within_an_ulp_of_one(values):
    x, _, (_, _, sine, cosine), _ = values
    np.testing.assert_allclose(sine, np.sin(np.pi * x), rtol=0.0, atol=2.0**-23)
    np.testing.assert_allclose(cosine, np.cos(np.pi * x), rtol=0.0, atol=2.0**-23)


def test_vectors_equal_single_numbers_bit_for_bit_but_for_the_sign_of_a_zero(values):
    for one_by_one, together in zip(*values[2:], strict=True):
        np.testing.assert_array_equal(one_by_one, together)


def test_the_exponential_stays_normal_and_finite_outside_its_range():
    x = wp.array([-1000.0, -88.0, 89.0, 1e30], dtype=wp.float32, device="cpu")
    ones = wp.full(4, 1.0, dtype=wp.float32, device="cpu")
    found = [wp.empty(4, dtype=wp.float32, device="cpu") for _ in range(4)]
    launch(evaluate, 4, inputs=[x, ones], outputs=found, context=Context())
    power = found[0].numpy()
    assert np.isfinite(power).all()
    assert (power >= np.finfo(np.float32).tiny).all()
