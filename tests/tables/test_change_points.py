"""Where a series changes its level: found where it does, silent where it does not, whatever the distribution."""

from __future__ import annotations

import numpy as np
import pytest

from shadowbench.tables.change_points import LEAST_LENGTH, change_points


@pytest.mark.parametrize("place", [5, 12, 20])
def test_a_step_is_found_where_it_is(place: int) -> None:
    noise = np.random.default_rng(place).lognormal(0.0, 0.02, 30)
    series = noise * np.where(np.arange(30) < place, 10.0, 12.0)
    (found,) = change_points(series.tolist())
    assert abs(found - place) <= 1


def test_several_steps_are_found() -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.05, 60)
    series = noise + np.repeat([1.0, 2.0, 1.5], 20)
    assert [abs(a - b) <= 1 for a, b in zip(change_points(series.tolist()), (20, 40), strict=True)] == [True, True]


def test_noise_has_few_changes() -> None:
    """At the level of 2 % a hundred series without a change show about two."""
    generator = np.random.default_rng(7)
    false_alarms = sum(bool(change_points(generator.lognormal(0.0, 0.3, 25).tolist())) for _ in range(100))
    assert false_alarms <= 7


def test_one_run_that_went_wrong_is_no_change() -> None:
    series = [10.0, 10.1, 9.9, 10.0, 10.1, 50.0, 10.0, 9.9, 10.1, 10.0, 9.9, 10.0]
    assert change_points(series) == []


def test_equal_and_short_series_have_none() -> None:
    assert change_points([]) == []
    assert change_points([1.0] * 50) == []
    assert change_points([1.0] * (LEAST_LENGTH - 1) + [2.0] * LEAST_LENGTH) == []


def test_the_same_series_has_the_same_changes() -> None:
    series = np.random.default_rng(3).normal(0.0, 1.0, 40).tolist()
    assert change_points(series) == change_points(series)
