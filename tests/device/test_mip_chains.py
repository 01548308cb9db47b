"""Mip chains against OpenCV's area means, against plain Warp bit for bit, and on their sizes."""

import cv2
import numpy as np
import pytest
import warp as wp

from shadowbench.device.launch import Context, kernel_options, launch
from shadowbench.device.mip_chains import MipChain, chain_texels, level_sizes
from shadowbench.device.mip_chains_kernels import (
    halved_logarithm,
    halved_maximum,
    halved_mean,
    halving_kernel,
    plain_halving,
)

wp.set_module_options(kernel_options(native=True))

RANDOM = np.random.default_rng(5)
STEEPNESS = 80.0
SIZES = [(1, 64, 1), (1, 37, 1), (2, 50, 2), (6, 21, 3), (1, 1, 1), (1, 3, 4), (1, 1201, 1), (1, 35, 32), (1, 1024, 1)]

PLAIN = {
    "means": halving_kernel(plain_halving(halved_mean), wp.float32),
    "maxima": halving_kernel(plain_halving(halved_maximum), wp.float32),
    "logarithms": halving_kernel(plain_halving(halved_logarithm), wp.float32),
}


def _chain(values, kind="means", threads=1):
    faces, size, _, channels = values.shape
    dtype = wp.uint8 if values.dtype == np.uint8 else wp.float32
    chain = MipChain(faces, size, Context(threads=threads), channels=channels, dtype=dtype)
    chain.level(0).assign(values)
    if kind == "means":
        chain.fill_with_means()
    elif kind == "maxima":
        chain.fill_with_maxima()
    else:
        chain.fill_with_logarithmic_means(STEEPNESS)
    return chain


def _values(faces, size, channels):
    return RANDOM.random((faces, size, size, channels)).astype(np.float32)


@pytest.mark.parametrize(("faces", "size", "channels"), SIZES)
@pytest.mark.parametrize("kind", sorted(PLAIN))
def test_native_and_plain_levels_agree_bit_for_bit_on_any_number_of_threads(kind, faces, size, channels):
    values = _values(faces, size, channels)
    plain = MipChain(faces, size, Context(), channels=channels)
    plain.level(0).assign(values)
    for level in range(plain.level_count - 1):
        inputs = [plain.layout, level, level + 1, 1, STEEPNESS]
        launch(PLAIN[kind], faces, inputs=inputs, outputs=[plain.values], context=Context())
    expected = plain.values.numpy().view(np.int32)
    for threads in (1, 2, 3):
        found = _chain(values, kind, threads).values.numpy().view(np.int32)
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("size", [64, 37, 50, 3, 255, 300])
@pytest.mark.parametrize("channels", [1, 2, 4])
def test_each_level_is_opencvs_area_mean_of_the_one_before(channels, size):
    chain = _chain(_values(1, size, channels))
    for number in range(1, chain.level_count):
        finer, found = chain.level(number - 1).numpy()[0], chain.level(number).numpy()[0]
        expected = cv2.resize(finer, found.shape[:2], interpolation=cv2.INTER_AREA).reshape(found.shape)
        np.testing.assert_allclose(found, expected, atol=3e-7)


@pytest.mark.parametrize("size", [64, 37, 100, 1023])
def test_every_level_has_the_mean_of_the_first(size):
    values = _values(2, size, 1)
    chain = _chain(values)
    for number in range(chain.level_count):
        means = chain.level(number).numpy().astype(np.float64).mean(axis=(1, 2, 3))
        np.testing.assert_allclose(means, values.astype(np.float64).mean(axis=(1, 2, 3)), rtol=1e-6)


@pytest.mark.parametrize("size", [64, 37, 100])
def test_a_texel_is_the_largest_of_all_texels_under_it(size):
    values = _values(1, size, 1)
    chain = _chain(values, "maxima")
    for number in range(1, chain.level_count):
        coarse = chain.level(number).numpy()[0, ..., 0]
        scale = size / coarse.shape[0]
        for _ in range(40):
            i, j = RANDOM.integers(0, coarse.shape[0], 2)
            first, end = [int(np.floor(k * scale)) for k in (i, j)], [int(np.ceil((k + 1) * scale)) for k in (i, j)]
            under = values[0, first[0] : end[0], first[1] : end[1], 0]
            assert coarse[i, j] >= under.max()
            if size == 64:
                assert coarse[i, j] == under.max()
    assert chain.level(chain.level_count - 1).numpy().max() == values.max()


@pytest.mark.parametrize("size", [32, 21])
def test_logarithmic_means_are_the_logarithms_of_means_of_exponentials(size):
    values = _values(1, size, 1)
    linear = _chain(np.exp(STEEPNESS * values))
    found = _chain(values, "logarithms")
    for number in range(found.level_count):
        expected = np.log(linear.level(number).numpy().astype(np.float64)) / STEEPNESS
        np.testing.assert_allclose(found.level(number).numpy(), expected, rtol=0.0, atol=5e-7)


@pytest.mark.parametrize("size", [64, 37])
@pytest.mark.parametrize("kind", sorted(PLAIN))
def test_a_constant_map_has_equal_levels_to_the_last_bit(kind, size):
    value = np.float32(0.7)
    assert (_chain(np.full((1, size, size, 1), value, np.float32), kind).values.numpy() == value).all()


def test_bytes_are_rounded_half_up_at_each_level():
    values = RANDOM.integers(0, 256, (2, 16, 16, 32), dtype=np.uint8)
    chain = _chain(values, threads=2)
    expected = values.astype(np.int64)
    for number in range(1, chain.level_count):
        faces, size, _, channels = expected.shape
        sums = expected.reshape(faces, size // 2, 2, size // 2, 2, channels).sum(axis=(2, 4))
        expected = (sums + 2) // 4
        np.testing.assert_array_equal(chain.level(number).numpy(), expected)


def test_a_chain_over_2048_texels_has_5592405():
    assert chain_texels(2048) == 5_592_405
    chain = MipChain(1, 2048, Context())
    assert chain.values.size == chain.texel_count == 5_592_405
    assert chain.level_count == 12
    assert chain.values.capacity == 22_369_620


def test_a_chain_without_levels_is_the_map():
    chain = MipChain(6, 10, Context(), channels=2, has_levels=False)
    assert (chain.level_count, chain.values.size) == (1, 1200)


def test_sizes_are_halved_and_rounded_down_to_one():
    assert level_sizes(37) == (37, 18, 9, 4, 2, 1)
    assert level_sizes(1) == (1,)


def test_a_chain_too_large_for_its_indices_is_refused():
    with pytest.raises(ValueError, match=r"2,863,311,5\d\d values"):
        MipChain(1, 8192, Context(), channels=32)
