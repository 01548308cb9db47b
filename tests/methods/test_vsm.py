"""Variance shadow maps: the paper's exact cases, and rounding that must do no harm."""

import numpy as np
import pytest
from builders import box_over_ground
from layers import RECEIVERS, depth_of, layered, window_means
from running import run_method

from shadowbench.camera_pass import render
from shadowbench.method import Context

VALUES = {"resolution": 128, "filtering": "bilinear", "bias": 1e-6, "minimum_variance": 0.0}


def _depths(world):
    _, trace = run_method("shadow-map", world, RECEIVERS, resolution=128, slope_bias=0.0)
    return trace.kept["shadow map"].numpy()[0]


@pytest.mark.parametrize("kernel", [0, 3, 7])
def test_behind_one_plane_of_blockers_the_bound_is_the_lit_share_exactly(kernel):
    world = layered((1.0, 0.013))
    visibility, _ = run_method("vsm", world, RECEIVERS, kernel=kernel, **VALUES)
    lit = (_depths(world) > 0.5 * (depth_of(world, 0.0) + depth_of(world, 1.0))).astype(float)
    expected = window_means(world, lit, kernel)
    assert ((expected > 0.0) & (expected < 1.0)).sum() > 16
    np.testing.assert_allclose(visibility, expected, atol=5e-6)


@pytest.mark.parametrize("kernel", [0, 5])
@pytest.mark.parametrize("heights", [(1.0, 0.5), (1.0, 0.1)])
def test_two_blockers_leak_light_by_the_variance_between_them(heights, kernel):
    above, below = heights
    world = layered((above, 0.013), (below, -2.0))
    visibility, _ = run_method("vsm", world, RECEIVERS, kernel=kernel, **VALUES)
    a, b, c = (depth_of(world, y) for y in (above, below, 0.0))
    assert (_depths(world) < c - 1e-3).all()  # everything is in shadow
    q = window_means(world, (_depths(world) > 0.5 * (a + b)).astype(float), kernel)
    mean, variance = (1.0 - q) * a + q * b, q * (1.0 - q) * (b - a) ** 2
    expected = variance / (variance + (c - mean) ** 2)
    assert expected.max() > 0.05
    rounding = 2.0**-22 / (c - b) ** 2  # of the float32 variance, a difference of two numbers up to 1
    np.testing.assert_allclose(visibility, expected, rtol=0.0, atol=rounding + 2e-6)


def test_bleeding_reduction_cuts_the_tail_off_and_stretches_the_rest():
    world = layered((1.0, 0.013))
    plain, _ = run_method("vsm", world, RECEIVERS, kernel=7, **VALUES)
    reduced, _ = run_method("vsm", world, RECEIVERS, kernel=7, bleeding_reduction=0.3, **VALUES)
    np.testing.assert_allclose(reduced, np.clip((plain - 0.3) / 0.7, 0.0, 1.0), atol=1e-6)


def test_the_minimum_variance_is_what_the_bound_takes_where_there_is_none():
    world = layered((1.0, -2.0))
    visibility, _ = run_method("vsm", world, RECEIVERS, **{**VALUES, "minimum_variance": 1e-3})
    distance = depth_of(world, 0.0) - depth_of(world, 1.0)
    np.testing.assert_allclose(visibility, 1e-3 / (1e-3 + distance**2), rtol=1e-3)


def test_a_variance_that_rounding_makes_negative_neither_lights_nor_breaks():
    # constant maps over many depths: about half of their variances come out below zero
    for height in np.linspace(0.1, 1.9, 40):
        world = layered((float(height), -2.0), (2.0, 1.9))
        visibility, _ = run_method("vsm", world, RECEIVERS, kernel=7, **VALUES)
        assert np.isfinite(visibility).all()
        assert visibility[RECEIVERS.position[:, 0] < 0.5].max() < 1e-4


def test_a_lit_plane_is_lit_with_or_without_the_slope_term():
    world = box_over_ground()
    receivers = render(world, world.cameras["front"], 120, 90, Context())
    far = (receivers.instance == 0) & (np.linalg.norm(receivers.position[:, [0, 2]], axis=1) > 2.2)
    far &= (np.abs(receivers.position[:, [0, 2]]) < 2.9).all(axis=1)
    assert far.sum() > 100
    for slope_term in (False, True):
        visibility, _ = run_method("vsm", world, receivers, slope_term=slope_term, resolution=256)
        assert visibility[far].min() > 0.999


def test_the_slope_term_adds_to_the_variance_of_a_slanted_plane():
    world = box_over_ground()
    receivers = render(world, world.cameras["front"], 120, 90, Context())
    traces = [run_method("vsm", world, receivers, slope_term=term, kernel=0)[1] for term in (False, True)]
    without, with_term = (trace.kept["moment map"].numpy().reshape(-1, 2) for trace in traces)
    np.testing.assert_array_equal(without[:, 0], with_term[:, 0])
    assert (with_term[:, 1] >= without[:, 1]).all()
    assert (with_term[:, 1] > without[:, 1]).mean() > 0.3
