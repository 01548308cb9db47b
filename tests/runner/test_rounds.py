"""The pace of rounds: their order, when they go on in fresh processes, and when they end."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np
import pytest

from shadowbench.runner.rounds import EndedBy, Pace, Step, is_tight, order_of, sums
from shadowbench.statistics import Verdict, interval_of, judge, paired


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


def test_an_interval_is_tight_within_a_twentieth_or_when_there_is_next_to_nothing_to_time() -> None:
    assert is_tight(interval_of([100.0, 96.0, 104.0, 100.0, 99.0, 101.0]))
    assert not is_tight(interval_of([100.0, 90.0, 110.0, 100.0, 99.0, 101.0]))
    assert is_tight(interval_of([0.001, 0.04, 0.002, 0.003, 0.001, 0.002]))
    assert not is_tight(interval_of([1.0] * 5))


def test_sums_are_formed_round_by_round() -> None:
    assert sums([1.0, 2.0], [10.0, 20.0], [100.0, 200.0]) == [111.0, 222.0]


def _paced(*, round_s: float = 1.0, tight_after: float = math.inf, **changes: Any) -> tuple[list[int], Pace]:
    """Return the number of rounds in each process, of rounds that all take the same time."""
    given = {
        "budget_s": 30.0,
        "loading_budget_s": 30.0,
        "loading_s": 2.0,
        "min_rounds": 6,
        "max_rounds": 30,
        "most_processes": 5,
    }
    pace = Pace(**(given | changes))
    rounds = [1]
    while (step := pace.after_round(round_s, lambda: pace.rounds >= tight_after)) is not Step.END:
        if step is Step.RENEW:
            rounds.append(0)
        rounds[-1] += 1
        assert sum(rounds) < 1000
    return rounds, pace


def test_rounds_are_divided_evenly_among_the_processes() -> None:
    rounds, pace = _paced()
    assert rounds == [6] * 5
    assert pace.processes == 5
    assert pace.rounds == 30
    assert pace.ended_by is EndedBy.ROUNDS


def test_every_process_ends_early_once_the_intervals_are_tight() -> None:
    rounds, pace = _paced(tight_after=6)
    assert rounds == [6, 3, 3, 3, 3]
    assert pace.ended_by is EndedBy.INTERVAL


def test_the_budget_ends_the_rounds_and_is_shared_by_the_processes() -> None:
    rounds, pace = _paced(round_s=1.5, budget_s=29.0)
    assert pace.ended_by is EndedBy.BUDGET
    assert 1.5 * sum(rounds) <= 29.0
    assert min(rounds) >= 3
    assert max(rounds) - min(rounds) <= 1


@pytest.mark.parametrize(
    ("changes", "processes"),
    [
        ({"round_s": 3.0}, 3),  # three rounds each take 27 of 30 s
        ({"round_s": 4.0}, 1),  # of two, 24 s, but two are too few
        ({"round_s": 6.0}, 1),
        ({"round_s": 100.0}, 1),
        ({"loading_s": 10.0}, 4),
        ({"loading_s": 31.0}, 1),
        ({"loading_budget_s": 1.0}, 1),
        ({"most_processes": 3}, 3),
        ({"most_processes": 2}, 1),
        ({"max_rounds": 9}, 3),
        ({"max_rounds": 1, "min_rounds": 1}, 1),
    ],
)
def test_there_are_as_many_processes_as_the_budgets_hold(changes: dict[str, Any], processes: int) -> None:
    rounds, pace = _paced(**changes)
    assert len(rounds) == pace.processes == processes
    assert all(rounds)


def test_a_round_longer_than_the_budget_is_still_one_round() -> None:
    rounds, pace = _paced(round_s=100.0)
    assert rounds == [1]
    assert pace.ended_by is EndedBy.BUDGET


def test_one_process_needs_no_more_rounds_than_asked_for() -> None:
    rounds, pace = _paced(most_processes=1, min_rounds=2, max_rounds=3, tight_after=1)
    assert rounds == [2]
    assert pace.ended_by is EndedBy.INTERVAL


@pytest.mark.parametrize("layout", [0.0, 0.01])
def test_stopping_when_intervals_are_tight_does_not_make_differences(layout: float) -> None:
    """Two equal cases, judged after rounds that end by the rule: simulated, one in twenty may pass for different."""
    rng = np.random.default_rng(21)
    found = []
    for _ in range(600):
        pace = Pace(budget_s=1e9, loading_budget_s=1e9, loading_s=1.0, min_rounds=6, max_rounds=30, most_processes=5)
        times: tuple[list[float], list[float]] = [], []
        processes: list[int] = []
        shift = rng.normal(0.0, layout, 2)
        step = Step.ROUND
        while step is not Step.END:
            if step is Step.RENEW:
                shift = rng.normal(0.0, layout, 2)
            common = rng.normal(0.0, 0.02)
            for case in (0, 1):
                times[case].append(math.exp(common + shift[case] + rng.normal(0.0, 0.04)))
            processes.append(pace.process)
            step = pace.after_round(1.0, lambda: all(is_tight(interval_of(each)) for each in times))  # noqa: B023
        found.append(judge([paired(*times, processes)])[0].verdict)
    declared = sum(verdict is not Verdict.NO_DIFFERENCE for verdict in found)
    assert declared <= 600 * 0.05 + 3.0 * math.sqrt(600 * 0.05 * 0.95)
