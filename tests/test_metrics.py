import numpy as np
import pytest
from builders import box_over_ground, flat_receivers, stated_reference

from shadowbench.metrics import CONTACT_DISTANCE, EDGE_RADIUS, MEASURES, edge_band, failures, measure
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
