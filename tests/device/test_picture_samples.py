"""Where samples lie in a pixel, and in which order what they see is listed."""

from dataclasses import replace

import numpy as np
import pytest
from builders import box_over_ground

from shadowbench.device.launch import Context
from shadowbench.device.picture_samples import PictureSamples, sample_pattern
from shadowbench.light_space import camera_frame


def seen_through(world, *numbers):
    """The world with these instances translucent."""
    glass = [replace(i, transmittance=(0.5, 0.5, 0.5)) if k in numbers else i for k, i in enumerate(world.instances)]
    return replace(world, instances=tuple(glass))


def test_one_sample_is_the_pixels_centre():
    assert sample_pattern(1).tolist() == [[0.5, 0.5]]


@pytest.mark.parametrize("samples", [2, 3, 4, 5, 9, 12, 16, 25, 64])
def test_each_column_and_each_row_of_a_pixel_has_one_sample_in_its_middle(samples):
    pattern = sample_pattern(samples)
    for axis in (0, 1):
        np.testing.assert_allclose(np.sort(pattern[:, axis]), (np.arange(samples) + 0.5) / samples, rtol=1e-15)


def test_four_samples_are_hammersleys():
    assert sample_pattern(4).tolist() == [[0.125, 0.125], [0.375, 0.625], [0.625, 0.375], [0.875, 0.875]]


@pytest.mark.parametrize("samples", [3, 5, 9, 12, 16, 25, 64])
def test_samples_are_spread_over_the_pixel(samples):
    pattern = sample_pattern(samples)
    # of a sequence of low discrepancy, a box from the corner has its share to within (log2(n) + 2) / n
    x, y = np.linspace(0.0, 1.0, 21)[:, None, None], np.linspace(0.0, 1.0, 21)[None, :, None]
    inside = ((pattern[:, 0] < x) & (pattern[:, 1] < y)).mean(axis=2)
    assert np.abs(inside - (x * y)[..., 0]).max() < (np.log2(samples) + 2.0) / samples


@pytest.mark.parametrize(("samples", "layers"), [(1, 1), (3, 1), (1, 4), (4, 3)])
def test_surfaces_are_sorted_by_pixel_then_sample_then_nearest_first(samples, layers):
    world = seen_through(box_over_ground(), 0, 1)
    frame = camera_frame(world.cameras["front"], 40, 30, world)
    drawn = PictureSamples(40, 30, samples, layers, Context())
    seen = drawn.find(world, frame)
    order = np.lexsort((seen.layer, seen.sample, seen.pixel))
    np.testing.assert_array_equal(order, np.arange(len(order)))
    assert seen.sample.max() == samples - 1
    assert seen.layer.max() == min(layers - 1, 2), "a box over a ground is three surfaces deep"
    after_first = np.flatnonzero(seen.layer > 0)
    np.testing.assert_array_equal(seen.layer[after_first - 1], seen.layer[after_first] - 1)
    np.testing.assert_array_equal(seen.sample[after_first - 1], seen.sample[after_first])


def test_nothing_is_seen_behind_an_opaque_surface():
    world = box_over_ground()
    frame = camera_frame(world.cameras["front"], 40, 30, world)
    is_box = np.arange(world.triangle_count) >= world.first_triangle[1]
    seen = PictureSamples(40, 30, 1, 5, Context()).find(seen_through(world, 0), frame)
    assert (seen.layer == 0).all(), "the box hides the ground, and nothing lies over the box"
    seen = PictureSamples(40, 30, 1, 5, Context()).find(seen_through(world, 1), frame)
    assert seen.layer.max() == 2
    assert (~is_box[seen.triangle[seen.layer == 2]]).all()
