import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.device.filter_weights import gauss_sigma, tap_weights


@settings(max_examples=60, deadline=None)
@given(shape=st.sampled_from(["box", "gauss"]), width=st.integers(1, 63))
def test_weights_are_symmetric_and_sum_to_one(shape, width):
    weights = tap_weights(shape, width)
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(weights, weights[::-1], rtol=1e-12)


@pytest.mark.parametrize(("width", "sigma"), [(3, 0.8), (5, 1.1), (7, 1.4)])
def test_gauss_widths_have_opencvs_deviations(width, sigma):
    assert gauss_sigma(width) == pytest.approx(sigma)


@pytest.mark.parametrize("width", [3, 5, 7, 21])
def test_gauss_weights_are_opencvs_of_the_same_deviation(width):
    expected = cv2.getGaussianKernel(width, gauss_sigma(width)).ravel()
    np.testing.assert_allclose(tap_weights("gauss", width), expected, rtol=1e-12)
