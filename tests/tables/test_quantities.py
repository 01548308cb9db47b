"""What a row's number is known to, and the ratio of two rows' numbers."""

from __future__ import annotations

import math
from typing import Any

import pytest

from shadowbench import statistics
from shadowbench.statistics import ratio_by_round, ratio_of_runs
from shadowbench.tables.quantities import exact, p_value, quantity_of, ratio_of, scaled

ROUNDS = [3.0, 3.1, 2.9, 3.3, 3.05, 2.95, 3.2, 3.0]
SLOWER = [x * f for x, f in zip(ROUNDS, (1.1, 1.12, 1.09, 1.1, 1.13, 1.08, 1.11, 1.1), strict=True)]


def _timed(make_row: Any, shade: list[float], comparison: str, **fields: Any) -> Any:
    samples = {"build": [1.0] * len(shade), "shade": shade, "camera": [2.0] * len(shade)}
    ordered = sorted(shade)
    times = {"shade_ms": ordered[4], "shade_ms_low": ordered[0], "shade_ms_high": ordered[-1]}
    frames = {"dynamic_frame_ms": 3.0 + ordered[4], "static_frame_ms": 2.0 + ordered[4]}
    return make_row(comparison=comparison, samples=samples, **times, **frames, **fields)


def test_counters_bytes_and_percentages_are_exact_and_times_have_intervals(make_row: Any) -> None:
    row = make_row(
        bytes_kept=12, failure_percent=1.5, counters={"n": 7}, shade_ms=3.0, shade_ms_low=2.0, shade_ms_high=4.0
    )
    assert quantity_of(row, "bytes_kept") == exact(12)
    assert quantity_of(row, "failure_percent") == exact(1.5)
    assert quantity_of(row, "counters.n") == exact(7)
    shade = quantity_of(row, "shade_ms")
    assert shade is not None
    assert (shade.low, shade.value, shade.high) == (2.0, 3.0, 4.0)
    assert quantity_of(row, "rmse") is None
    assert quantity_of(row, "method") is None
    unknown = quantity_of(make_row(shade_ms=3.0), "shade_ms")
    assert unknown is not None
    assert (unknown.low, unknown.high) == (0.0, math.inf)


def test_a_stage_has_the_interval_of_its_own_rounds(make_row: Any) -> None:
    loose = [10.0, 30.0, 12.0, 28.0, 11.0, 29.0, 20.0, 21.0]
    fields = {"shade_ms": sum(loose), "shade_ms_low": 1.0, "shade_ms_high": 900.0}
    row = make_row(stages={"sort": 3.0}, samples={"shade": loose, "stages.sort": ROUNDS}, **fields)
    stage, rounds = quantity_of(row, "stages.sort"), statistics.interval_of(ROUNDS)
    assert stage is not None
    assert (stage.low, stage.high) == (rounds.low, rounds.high)


def test_two_stages_of_a_case_are_compared_within_each_round(make_row: Any) -> None:
    row = make_row(comparison="c", stages={"a": 1.0, "b": 1.0}, samples={"stages.a": SLOWER, "stages.b": ROUNDS})
    expected, found = ratio_by_round(SLOWER, ROUNDS), ratio_of(row, "stages.a", row, "stages.b")
    assert found is not None
    assert (found.value, found.low, found.high) == (expected.estimate, expected.low, expected.high)


def test_without_its_own_rounds_a_stages_interval_is_as_wide_as_its_cases(make_row: Any) -> None:
    row = make_row(shade_ms=4.0, shade_ms_low=2.0, shade_ms_high=6.0, stages={"sort": 1.0}, build_ms=0.0)
    stage = quantity_of(row, "stages.sort")
    assert stage is not None
    assert (stage.low, stage.value, stage.high) == (0.5, 1.0, 1.5)


def test_two_cases_of_the_same_rounds_are_compared_within_each_round(make_row: Any) -> None:
    slow, fast = _timed(make_row, SLOWER, "c"), _timed(make_row, ROUNDS, "c")
    expected = ratio_by_round(SLOWER, ROUNDS)
    found = ratio_of(slow, "shade_ms", fast, "shade_ms")
    assert found is not None
    assert (found.value, found.low, found.high) == (expected.estimate, expected.low, expected.high)
    assert found.low > 1.0, "though the two overlap"


def test_two_cases_of_rounds_of_their_own_are_compared_by_all_pairs(make_row: Any) -> None:
    slow, fast = _timed(make_row, SLOWER, "c"), _timed(make_row, ROUNDS, "d")
    expected = ratio_of_runs(SLOWER, ROUNDS)
    found = ratio_of(slow, "shade_ms", fast, "shade_ms")
    assert found is not None
    assert (found.value, found.low, found.high) == (expected.estimate, expected.low, expected.high)


def test_frames_are_sums_by_round_and_rates_their_inverse(make_row: Any) -> None:
    slow, fast = _timed(make_row, SLOWER, "c"), _timed(make_row, ROUNDS, "c")
    dynamic = [3.0 + x for x in SLOWER], [3.0 + x for x in ROUNDS]
    by_time = ratio_of(slow, "dynamic_frame_ms", fast, "dynamic_frame_ms")
    by_rate = ratio_of(slow, "dynamic_frame_fps", fast, "dynamic_frame_fps")
    static = ratio_of(slow, "static_frame_ms", slow, "dynamic_frame_ms")
    assert by_time is not None
    assert by_rate is not None
    assert static is not None
    assert by_time.value == pytest.approx(ratio_by_round(*dynamic).estimate)
    assert by_rate.value == pytest.approx(1.0 / by_time.value)
    assert (by_rate.low, by_rate.high) == pytest.approx((1.0 / by_time.high, 1.0 / by_time.low))
    assert static.value < 1.0


def test_a_view_dependent_methods_static_frame_holds_its_build(make_row: Any) -> None:
    row = _timed(make_row, ROUNDS, "c").model_copy(update={"static_frame_ms": 6.0, "dynamic_frame_ms": 6.0})
    ratio = ratio_of(row, "static_frame_ms", row, "dynamic_frame_ms")
    assert ratio is not None
    assert (ratio.low, ratio.value, ratio.high) == (1.0, 1.0, 1.0)


def test_the_chance_of_a_ratio_is_told_against_any_bound(make_row: Any) -> None:
    ratio = ratio_of(_timed(make_row, SLOWER, "c"), "shade_ms", _timed(make_row, ROUNDS, "c"), "shade_ms")
    assert ratio is not None
    assert p_value(ratio, 1.0) == 2.0 / 2**8, "all of eight rounds on one side"
    assert p_value(ratio, 2.0) == 2.0 / 2**8
    assert (p_value(ratio, 1.1) or 0.0) > 0.5
    assert p_value(scaled(ratio, 2.0), 2.2) == p_value(ratio, 1.1)
    assert p_value(exact(1.0), 1.0) is None


def test_no_ratio_to_nothing(make_row: Any) -> None:
    assert ratio_of(make_row(bytes_kept=3), "bytes_kept", make_row(bytes_kept=0), "bytes_kept") is None
    assert ratio_of(make_row(bytes_kept=3), "bytes_kept", make_row(), "bytes_kept") is None
