"""Weighted sums of interpolated channels against NumPy, and native bodies against plain Warp bit for bit."""

import numpy as np
import pytest
import warp as wp

from shadowbench.device.filtered_lookup import Corners
from shadowbench.device.fourier_sums import Coefficients, interpolated_sum, interpolated_sum_plain
from shadowbench.device.launch import Context, kernel_options, launch

wp.set_module_options(kernel_options(native=True))

TEXELS, COUNT = 64, 500


def summing_kernel(sum_of_channels, element):
    @wp.kernel
    def sum_channels(
        first: wp.int32,
        values: wp.array[element],
        weights: wp.array[wp.float32],
        corner: wp.array2d[wp.int32],
        place: wp.array[wp.vec2],
        sums: wp.array[wp.float32],
    ):
        i = wp.tid() + first
        count = weights.shape[0]
        held = Coefficients()
        for k in range(count):
            held[k] = weights[k]
        corners = Corners()
        corners.top_left = corner[i, 0] * count
        corners.top_right = corner[i, 1] * count
        corners.bottom_left = corner[i, 2] * count
        corners.bottom_right = corner[i, 3] * count
        corners.right = place[i][0]
        corners.down = place[i][1]
        sums[i] = sum_of_channels(values, corners, held, count)

    return sum_channels


KERNELS = {
    element: (summing_kernel(interpolated_sum, element), summing_kernel(interpolated_sum_plain, element))
    for element in (wp.float32, wp.uint8)
}


@pytest.mark.parametrize("element", [wp.float32, wp.uint8])
@pytest.mark.parametrize("channels", [2, 10, 32, 34, 64])
def test_sums(channels, element):
    random = np.random.default_rng(channels)
    values = random.integers(0, 256, (TEXELS, channels))
    weights = random.normal(size=channels).astype(np.float32)
    corner = random.integers(0, TEXELS, (COUNT, 4)).astype(np.int32)
    place = random.random((COUNT, 2)).astype(np.float32)
    place[:4] = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
    inputs = [
        wp.array(values.reshape(-1), dtype=element, device="cpu"),
        wp.array(weights, device="cpu"),
        wp.array(corner, device="cpu"),
        wp.array(place, dtype=wp.vec2, device="cpu"),
    ]
    found = []
    for kernel in KERNELS[element]:
        sums = wp.zeros(COUNT, dtype=wp.float32, device="cpu")
        launch(kernel, COUNT, inputs=inputs, outputs=[sums], context=Context())
        found.append(sums.numpy())
    np.testing.assert_array_equal(*found)
    right, down = place.astype(np.float64)[:, 0, None], place.astype(np.float64)[:, 1, None]
    a, b, c, d = (values[corner[:, k]] for k in range(4))
    mean = (a * (1 - right) + b * right) * (1 - down) + (c * (1 - right) + d * right) * down
    np.testing.assert_allclose(found[0], mean @ weights, atol=2e-4 * channels)
