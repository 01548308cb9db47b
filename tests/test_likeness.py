"""Measures of degree: SSIM against scikit-image, FLIP against its formula on flat pictures, RMSE and leaks by hand."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from builders import flat_receivers
from skimage.metrics import structural_similarity as similarity_by_skimage

from shadowbench.likeness import flip_difference, likeness, root_mean_square, structural_similarity

WIDTH, HEIGHT = 40, 30
COUNT = WIDTH * HEIGHT
EVERY = np.ones(COUNT, bool)


def _column() -> np.ndarray:
    return np.arange(COUNT) % WIDTH


def _soft_edge() -> np.ndarray:
    """Shadow on the left, light on the right, between them a ramp eight pixels wide."""
    return np.clip((_column() - 16.0) / 8.0, 0.0, 1.0).astype(np.float32)


def _like(visibility, reference, scored=EVERY):
    return likeness(flat_receivers(WIDTH, HEIGHT), scored, reference, visibility.astype(np.float32))


@pytest.mark.parametrize("channels", [1, 3])
def test_structural_similarity_is_scikit_images(channels):
    rng = np.random.default_rng(1)
    first = rng.random((50, 61, channels))
    second = np.clip(first + rng.normal(0.0, 0.2, first.shape), 0.0, 1.0)
    options = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "data_range": 1.0, "full": True}
    _, expected = similarity_by_skimage(first, second, channel_axis=2, **options)
    np.testing.assert_allclose(structural_similarity(first, second), expected.mean(axis=2), atol=1e-12)


def test_the_reference_itself_is_like_itself():
    truth = _soft_edge()
    assert _like(truth, truth) == {"rmse": 0.0, "ssim": 1.0, "flip": 0.0, "leak_mean": 0.0, "leak_p99": 0.0}


def test_every_measure_tells_a_larger_error_from_a_smaller_one():
    rng = np.random.default_rng(2)
    noise = rng.normal(size=COUNT)
    found = [_like(np.clip(_soft_edge() + size * noise, 0.0, 1.0), _soft_edge()) for size in (0.0, 0.02, 0.1, 0.4)]
    for name in ("rmse", "flip", "leak_mean", "leak_p99"):
        assert np.all(np.diff([each[name] for each in found]) > 0.0), name
    assert np.all(np.diff([each["ssim"] for each in found]) < 0.0)


def _hunt_adjusted_lab(linear: tuple[float, float, float]) -> np.ndarray:
    """A colour in L*a*b* of the sRGB white, with a* and b* times L*/100 (Andersson et al. 2020, section 4.1.2)."""
    xyz_of_rgb = np.array(
        [[10135552, 8788810, 4435075], [5225488, 17577620, 1774030], [475044, 2929603, 23361790]]
    ) / np.array([[24577794.0], [24577794.0], [24577794.0]])
    x, y, z = (xyz_of_rgb @ linear) / (xyz_of_rgb @ np.ones(3))
    f = [t ** (1 / 3) if t > (6 / 29) ** 3 else t / (3 * (6 / 29) ** 2) + 4 / 29 for t in (x, y, z)]
    lightness = 116.0 * f[1] - 16.0
    return np.array([lightness, 500.0 * (f[0] - f[1]) * lightness / 100.0, 200.0 * (f[1] - f[2]) * lightness / 100.0])


def _flip_of_flat_colours(first: tuple[float, ...], second: tuple[float, ...]) -> float:
    """Section 4.1.3: HyAB distance to the power 0.7, its first 0.4 of the range mapped to 0.95 of the result."""

    def distance(a: np.ndarray, b: np.ndarray) -> float:
        return float((abs(a[0] - b[0]) + np.hypot(*(a[1:] - b[1:]))) ** 0.7)

    most = distance(_hunt_adjusted_lab((0.0, 1.0, 0.0)), _hunt_adjusted_lab((0.0, 0.0, 1.0)))
    found = distance(_hunt_adjusted_lab(first), _hunt_adjusted_lab(second))
    knee = 0.4 * most
    return 0.95 / knee * found if found < knee else 0.95 + (found - knee) / (most - knee) * 0.05


@pytest.mark.parametrize("pair", [(0.0, 1.0), (0.2, 0.25), (0.9, 1.0), (0.5, 0.5), (0.0, 0.01)])
def test_flip_of_flat_greys_is_their_distance_in_lightness(pair):
    first, second = (np.full((48, 64, 1), value) for value in pair)
    found = flip_difference(first, second)
    assert found.shape == (48, 64)
    expected = _flip_of_flat_colours((pair[0],) * 3, (pair[1],) * 3)
    np.testing.assert_allclose(found, expected, atol=2e-4)


def test_flip_sees_colours():
    first, second = np.zeros((24, 24, 3)), np.zeros((24, 24, 3))
    first[:], second[:] = (0.5, 0.2, 0.1), (0.1, 0.2, 0.5)
    expected = _flip_of_flat_colours((0.5, 0.2, 0.1), (0.1, 0.2, 0.5))
    np.testing.assert_allclose(flip_difference(first, second), expected, atol=2e-3)


def test_the_root_mean_square_is_over_the_chosen_receivers_and_all_channels():
    reference = np.zeros((4, 3), np.float32)
    visibility = np.array([[0.3, 0.0, 0.0], [0.0, 0.6, 0.0], [1.0, 1.0, 1.0], [0.0, 0.0, 0.0]], np.float32)
    chosen = np.array([True, True, False, True])
    assert root_mean_square(visibility, reference, chosen) == pytest.approx(np.sqrt((0.09 + 0.36) / 9.0))
    assert root_mean_square(visibility, reference, np.zeros(4, bool)) is None


def test_leaks_are_what_is_seen_where_the_reference_is_dark():
    truth = _soft_edge()
    visibility = truth.copy()
    dark = np.flatnonzero(truth == 0.0)
    visibility[dark[: len(dark) // 20]] = 0.4  # one in twenty
    visibility[truth > 0.0] = 0.9
    found = _like(visibility, truth)
    assert found["leak_mean"] == pytest.approx(0.4 / 20.0, rel=0.05)
    assert found["leak_p99"] == pytest.approx(0.4)


def test_of_a_leak_in_colours_the_brightest_counts():
    reference = np.zeros((COUNT, 3), np.float32)
    visibility = np.tile(np.array([0.1, 0.3, 0.2], np.float32), (COUNT, 1))
    assert _like(visibility, reference)["leak_mean"] == pytest.approx(0.3)


def test_what_is_not_scored_may_be_anything():
    truth = _soft_edge()
    scored = _column() < 30
    visibility = np.clip(truth + 0.1, 0.0, 1.0)
    wrong, unwritten = visibility.copy(), visibility.copy()
    wrong[~scored], unwritten[~scored] = 0.0, np.nan
    assert _like(visibility, truth, scored) == _like(wrong, truth, scored) == _like(unwritten, truth, scored)


def test_pixels_without_a_scored_receiver_improve_nothing():
    visibility = np.clip(_soft_edge() + 0.1, 0.0, 1.0)
    narrow, wide = flat_receivers(20, HEIGHT), flat_receivers(WIDTH, HEIGHT)
    half = np.where(_column() < 20, 1.0, 0.0).astype(bool)
    left = [values.reshape(HEIGHT, WIDTH)[:, :20].reshape(-1) for values in (_soft_edge(), visibility)]
    alone = likeness(narrow, np.ones(20 * HEIGHT, bool), *left)
    beside = likeness(wide, half, _soft_edge(), visibility)
    assert alone["rmse"] == pytest.approx(beside["rmse"])
    for name in ("ssim", "flip"):  # windows that reach over the border see what is there
        assert beside[name] == pytest.approx(alone[name], rel=0.15)


def test_nothing_scored_is_measured_by_nothing():
    found = _like(_soft_edge(), _soft_edge(), np.zeros(COUNT, bool))
    assert set(found.values()) == {None}
    lit = _like(np.full(COUNT, 0.9), np.ones(COUNT, np.float32))
    assert (lit["leak_mean"], lit["leak_p99"]) == (None, None)
    assert lit["rmse"] == pytest.approx(0.1)


def test_heavy_libraries_are_loaded_when_first_asked():
    program = "import sys, shadowbench.likeness; print('scipy' in sys.modules, 'flip_evaluator' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.split() == ["False", "False"]
