"""Convolution shadow maps against the truncated Fourier series in float64."""

import numpy as np
import pytest
from builders import box_over_ground
from layers import RECEIVERS, depth_of, layered, window_means
from running import run_method

VALUES = {"resolution": 128, "filtering": "bilinear", "bias": 0.0}


def _series(difference, terms=16, attenuation=0.0):
    """Equation 9 of the paper over z - d, with damped terms."""
    k = np.arange(1, terms + 1)
    c = np.pi * (2 * k - 1)
    damping = np.exp(-attenuation * (k / terms) ** 2)
    return 0.5 + 2.0 * (np.sin(c * np.asarray(difference)[..., None]) / c * damping).sum(axis=-1)


@pytest.mark.parametrize("terms", [1, 4, 16, 32])
def test_the_series_is_a_half_at_the_step_and_peaks_first_at_one_over_twice_its_terms(terms):
    assert _series(0.0, terms) == 0.5
    z = np.linspace(0.0, 1.5 / (2 * terms), 30_001)
    values = _series(z, terms)
    assert z[values.argmax()] == pytest.approx(1.0 / (2 * terms), abs=1e-4)
    if terms == 16:
        assert values.max() == pytest.approx(1.0897, abs=1e-4)


@pytest.mark.parametrize("terms", [1, 4, 16, 32])
def test_a_receiver_at_its_blocker_is_half_lit_without_an_offset(terms):
    world = layered((1.0, 1.9))
    under_nothing = RECEIVERS.position[:, 0] < 0.5
    for basis, tolerance in (("float", 2e-5), ("8-bit", 0.02)):
        visibility, _ = run_method("csm", world, RECEIVERS, terms=terms, basis=basis, offset=0.0, **VALUES)
        np.testing.assert_allclose(visibility[under_nothing], 0.5, atol=tolerance)


@pytest.mark.parametrize("kernel", [0, 7])
@pytest.mark.parametrize("terms", [5, 16])
@pytest.mark.parametrize("attenuation", [0.0, 1.5])
@pytest.mark.parametrize("offset", [0.0, 0.01, 0.03125, 0.1])
def test_the_result_is_the_series_mean_over_the_window(offset, attenuation, terms, kernel):
    world = layered((1.0, 0.013), (0.05, -0.4))
    chosen = {"offset": offset, "attenuation": attenuation, "terms": terms, "kernel": kernel}
    visibility, trace = run_method("csm", world, RECEIVERS, basis="float", **chosen, **VALUES)
    _, of_map = run_method("shadow-map", world, RECEIVERS, resolution=128, slope_bias=0.0)
    depth = of_map.kept["shadow map"].numpy()[0].astype(np.float64)
    d = depth_of(world, 0.0) - offset
    expected = np.clip(window_means(world, _series(depth - d, terms, attenuation), kernel), 0.0, 1.0)
    np.testing.assert_allclose(visibility, expected, atol=3e-5)
    assert trace.bytes_by_name() == {"basis images": 128 * 128 * 2 * terms * 4}


@pytest.mark.parametrize("kernel", [0, 5])
def test_eight_bits_cost_no_more_than_their_rounding(kernel):
    world = layered((1.0, 0.013), (0.05, -0.4))
    exact, _ = run_method("csm", world, RECEIVERS, basis="float", kernel=kernel, **VALUES)
    coarse, trace = run_method("csm", world, RECEIVERS, basis="8-bit", kernel=kernel, **VALUES)
    c = np.pi * (2 * np.arange(1, 17) - 1)
    roundings = 1 if kernel == 0 else 2
    bound = roundings * (1.0 / 255.0) * (2.0 * np.sqrt(2.0) / c).sum()
    assert 0.0 < np.abs(exact - coarse).max() <= bound
    assert trace.bytes_by_name() == {"basis images": 128 * 128 * 32}


def test_contact_shadows_are_lost_up_to_the_offset():
    world = layered((0.02, 0.013), (2.0, 1.9))  # a hundredth of the depth range over the ground
    under = RECEIVERS.position[:, 0] > 0.1
    lost, _ = run_method("csm", world, RECEIVERS, kernel=0, **VALUES)
    assert lost[under].min() > 0.9
    without, _ = run_method("csm", world, RECEIVERS, kernel=0, offset=0.0, **VALUES)
    assert without[under].max() < 0.4


def test_more_terms_come_nearer_to_the_exact_window_mean():
    world = layered((1.0, 0.013))
    _, of_map = run_method("shadow-map", world, RECEIVERS, resolution=128, slope_bias=0.0)
    lit = of_map.kept["shadow map"].numpy()[0] > 0.5 * (depth_of(world, 0.0) + depth_of(world, 1.0))
    exact = window_means(world, lit, 7)
    errors = []
    for terms in (2, 4, 8, 16, 32):
        chosen = {"terms": terms, "basis": "float", "kernel": 7, "offset": 1.0 / (2 * terms)}
        visibility, _ = run_method("csm", world, RECEIVERS, **chosen, **VALUES)
        errors.append(np.sqrt(np.mean((visibility - exact) ** 2)))
    assert errors == sorted(errors, reverse=True)


def test_a_map_too_large_for_its_indices_is_skipped_with_the_reason():
    from running import REGISTRY

    from shadowbench.method import Context

    cls = REGISTRY.method("csm")
    world = box_over_ground()
    method = cls(cls.Parameters(resolution=8192), Context())
    assert "2,863,311,5" in method.supports(world, world.lights["sun"])
    assert cls(cls.Parameters(resolution=4096), Context()).supports(world, world.lights["sun"]) is None
