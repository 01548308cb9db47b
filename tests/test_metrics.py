import numpy as np
import pytest
from builders import box_over_ground, flat_receivers, stated_reference

from shadowbench.filtered_reference import FilteredReference
from shadowbench.metrics import (
    CONTACT_DISTANCE,
    EDGE_RADIUS,
    MEASURES,
    edge_band,
    failures,
    measure,
    measure_likeness,
)
from shadowbench.rows import ResultRow

WIDTH, HEIGHT = 40, 30


def _column() -> np.ndarray:
    return np.arange(WIDTH * HEIGHT) % WIDTH


def _left_half_shadowed() -> np.ndarray:
    return (_column() >= WIDTH // 2).astype(np.float32)


def _measure(visibility, reference, masks=None):
    return measure(
        box_over_ground(), flat_receivers(WIDTH, HEIGHT), reference, visibility.astype(np.float32), masks or {}
    )


def test_the_reference_itself_has_no_failures():
    truth = _left_half_shadowed()
    measured = _measure(truth, stated_reference(truth))
    counts = {name: value for name, value in measured.columns.items() if name.endswith("_count") and value is not None}
    assert set(counts.values()) == {0}
    assert measured.columns["scored"] == WIDTH * HEIGHT


def test_one_half_counts_as_lit():
    reference = np.array([0.0, 0.0, 1.0, 1.0], np.float32)
    visibility = np.array([0.5, 0.4999, 0.5, 0.4999], np.float32)
    false_lit, false_shadow = failures(reference, visibility)
    assert false_lit.tolist() == [True, False, False, False]
    assert false_shadow.tolist() == [False, False, False, True]


def test_the_channel_with_the_largest_error_decides():
    reference = np.array([[0.2, 0.2, 0.2], [1.0, 1.0, 1.0]], np.float32)
    visibility = np.array([[0.2, 0.8, 0.1], [1.0, 0.9, 0.1]], np.float32)
    false_lit, false_shadow = failures(reference, visibility)
    assert false_lit.tolist() == [True, False]
    assert false_shadow.tolist() == [False, True]


def test_the_edge_band_reaches_radius_pixels_on_both_sides():
    truth = _left_half_shadowed()
    band = edge_band(flat_receivers(WIDTH, HEIGHT), truth, np.ones(WIDTH * HEIGHT, bool))
    edge = WIDTH // 2
    expected = (_column() >= edge - 1 - EDGE_RADIUS) & (_column() <= edge + EDGE_RADIUS)
    assert (band == expected).all()


def test_receivers_that_are_not_scored_make_no_edge():
    truth = _left_half_shadowed()
    scored = _column() >= WIDTH // 2
    assert not edge_band(flat_receivers(WIDTH, HEIGHT), truth, scored).any()


def test_acne_is_false_shadow_away_from_edges_only():
    truth = _left_half_shadowed()
    visibility = truth.copy()
    inside, at_edge = WIDTH - 3, WIDTH // 2
    visibility[(_column() == inside) | (_column() == at_edge)] = 0.0
    columns = _measure(visibility, stated_reference(truth)).columns
    assert columns["false_shadow_count"] == 2 * HEIGHT
    assert columns["acne_count"] == HEIGHT
    assert columns["interior_count"] == HEIGHT
    assert columns["edge_band_count"] == HEIGHT
    band_pixels = (2 * EDGE_RADIUS + 2) * HEIGHT
    assert columns["edge_band_percent"] == pytest.approx(100.0 * HEIGHT / band_pixels)


@pytest.mark.parametrize(("share", "expected"), [(0.5, HEIGHT), (1.5, 0)])
def test_peter_panning_needs_a_near_blocker(share, expected):
    truth = _left_half_shadowed()
    visibility = truth.copy()
    visibility[_column() == 3] = 1.0
    distance = np.full(len(truth), share * CONTACT_DISTANCE * box_over_ground().diagonal(), np.float32)
    columns = _measure(visibility, stated_reference(truth, blocker_distance=distance)).columns
    assert columns["false_lit_count"] == HEIGHT
    assert columns["peter_panning_count"] == expected


def test_receivers_turned_away_or_out_of_the_field_are_scored_apart():
    truth = _left_half_shadowed()
    away, outside = _column() < 5, _column() >= WIDTH - 5
    wrong = np.where(away | outside, 1.0 - truth, truth)
    columns = _measure(wrong, stated_reference(truth, turned_away=away, in_field=~outside)).columns
    assert columns["failure_count"] == 0
    assert columns["scored"] == (WIDTH - 10) * HEIGHT
    assert columns["turned_away_percent"] == 100.0


def test_classified_is_a_share_of_all_pixels():
    truth = _left_half_shadowed()
    classified = _column() < 4
    columns = _measure(truth, stated_reference(truth), {"classified": classified}).columns
    assert columns["classified_percent"] == pytest.approx(100.0 * 4 / WIDTH)


def test_a_measure_that_does_not_apply_is_empty():
    truth = np.ones(WIDTH * HEIGHT, np.float32)
    columns = _measure(truth, stated_reference(truth)).columns
    assert columns["edge_band_percent"] is None
    assert columns["turned_away_percent"] is None
    assert "classified_percent" not in columns


def test_every_measure_is_a_column_with_a_count():
    for name in MEASURES:
        assert name in ResultRow.model_fields
        assert name.replace("_percent", "_count") in ResultRow.model_fields


def _likeness(visibility, reference, **beside):
    return measure_likeness(flat_receivers(WIDTH, HEIGHT), reference, visibility.astype(np.float32), **beside)


def test_a_hard_result_is_likened_to_the_hard_reference():
    truth = _left_half_shadowed()
    visibility = truth.copy()
    visibility[_column() == 3] = 1.0
    columns = _likeness(visibility, stated_reference(truth))
    assert columns["rmse"] == pytest.approx(np.sqrt(1.0 / WIDTH))
    assert columns["leak_mean"] == pytest.approx(2.0 / WIDTH)
    assert columns["edge_band_rmse"] == 0.0
    assert columns["interior_rmse"] == pytest.approx(np.sqrt(1.0 / (WIDTH - 2 * EDGE_RADIUS - 2)))
    assert not {"reference_error", "approximation_rmse", "discretisation_rmse"} & columns.keys()


def _filtered(values, half_difference=None):
    filtered = values.astype(np.float32)
    return FilteredReference(filtered, np.zeros_like(filtered) if half_difference is None else half_difference)


def test_a_filtering_methods_result_is_likened_to_the_filtered_reference():
    truth, ramp = _left_half_shadowed(), np.clip((_column() - 10) / 20.0, 0.0, 1.0)
    inner = (_column() > 10) & (_column() < 30)
    estimated = np.where(inner, 0.02, 0.0).astype(np.float32)
    columns = _likeness(np.where(inner, ramp + 0.1, ramp), stated_reference(truth), filtered=_filtered(ramp, estimated))
    share = np.mean(inner)
    assert columns["rmse"] == pytest.approx(0.1 * np.sqrt(share), rel=1e-5)
    assert columns["edge_band_rmse"] == pytest.approx(0.1, rel=1e-5)  # the penumbra, which holds the edge band
    assert columns["interior_rmse"] == 0.0
    assert columns["leak_mean"] == 0.0
    assert columns["reference_error"] == pytest.approx(0.02 * np.sqrt(share), rel=1e-5)


def test_a_filters_approximation_is_told_from_its_maps_texels():
    truth, ramp = _left_half_shadowed(), np.clip((_column() - 10) / 20.0, 0.0, 1.0)
    on_map = np.clip(ramp + 0.03, 0.0, 2.0).astype(np.float32)
    columns = _likeness(on_map + 0.04, stated_reference(truth), filtered=_filtered(ramp), on_map=on_map)
    assert columns["approximation_rmse"] == pytest.approx(0.04, rel=1e-5)
    assert columns["discretisation_rmse"] == pytest.approx(0.03, rel=1e-5)
    assert columns["rmse"] == pytest.approx(0.07, rel=1e-5)


def test_receivers_that_are_not_scored_have_no_part_in_likeness():
    truth = _left_half_shadowed()
    away, outside = _column() < 5, _column() >= WIDTH - 5
    reference = stated_reference(truth, turned_away=away, in_field=~outside)
    wrong = np.where(away | outside, np.nan, truth)
    columns = _likeness(wrong, reference, filtered=_filtered(truth), on_map=wrong.astype(np.float32))
    assert (columns["rmse"], columns["ssim"], columns["flip"]) == (0.0, 1.0, 0.0)
    assert (columns["approximation_rmse"], columns["discretisation_rmse"]) == (0.0, 0.0)
