"""The statistics of rounds, against the binomial distribution and by counting."""

import math
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.runner.rounds import interval_of, order_of, sums


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8])
def test_over_two_rounds_a_member_everyone_stands_everywhere_twice_and_goes_first_as_often_as_last(count: int) -> None:
    members = list(range(count))
    places: Counter[tuple[int, int]] = Counter()
    follows: Counter[tuple[int, int]] = Counter()
    for round_number in range(2 * count):
        order = order_of(members, round_number)
        assert sorted(order) == members
        places.update(enumerate(order))
        follows.update((a, b) for i, a in enumerate(order) for b in order[i + 1 :])
    assert set(places.values()) == {2}
    assert all(follows[a, b] == follows[b, a] for a, b in follows)


@pytest.mark.parametrize(
    ("count", "low", "high"),
    [(6, 1, 6), (7, 1, 7), (8, 1, 8), (9, 2, 8), (11, 2, 10), (12, 3, 10), (15, 4, 12), (20, 6, 15), (30, 10, 21)],
)
def test_the_interval_is_the_one_of_the_printed_tables_for_a_median(count: int, low: int, high: int) -> None:
    found = interval_of([float(value) for value in range(count, 0, -1)])
    assert (found.low, found.high) == (low, high)


@pytest.mark.parametrize("count", range(6, 60))
def test_the_interval_is_the_narrowest_that_holds_the_median_in_95_of_100(count: int) -> None:
    found = interval_of([float(value) for value in range(1, count + 1)])
    assert found.low is not None
    assert found.high == count + 1 - found.low

    def coverage(rank: int) -> float:
        return 1.0 - 2.0 * sum(math.comb(count, k) for k in range(rank)) / 2.0**count

    assert coverage(int(found.low)) >= 0.95
    assert coverage(int(found.low) + 1) < 0.95


@pytest.mark.parametrize("count", [1, 2, 5])
def test_fewer_than_six_samples_have_a_median_but_no_interval(count: int) -> None:
    found = interval_of([1.0] * count)
    assert (found.median, found.low, found.high) == (1.0, None, None)
    assert not found.is_tight


@given(st.lists(st.floats(0.0, 1e6), min_size=6, max_size=40))
def test_the_median_lies_in_its_interval_and_order_does_not_matter(samples: list[float]) -> None:
    found = interval_of(samples)
    assert found.low is not None
    assert found.high is not None
    assert min(samples) <= found.low <= found.median <= found.high <= max(samples)
    assert found == interval_of(samples[::-1])


def test_an_interval_is_tight_within_a_twentieth_or_when_there_is_next_to_nothing_to_time() -> None:
    assert interval_of([100.0, 96.0, 104.0, 100.0, 99.0, 101.0]).is_tight
    assert not interval_of([100.0, 90.0, 110.0, 100.0, 99.0, 101.0]).is_tight
    assert interval_of([0.001, 0.04, 0.002, 0.003, 0.001, 0.002]).is_tight


def test_sums_are_formed_round_by_round() -> None:
    assert sums([1.0, 2.0], [10.0, 20.0], [100.0, 200.0]) == [111.0, 222.0]
