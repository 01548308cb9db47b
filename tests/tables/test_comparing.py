"""What changed between two runs: pixels, counters and memory exactly, each judged by itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from shadowbench.rows import ResultRow, RunRecord
from shadowbench.tables.comparing import CaseComparison, Change, Kind, Pixels, RunComparison, compare_runs

MakeRow = Callable[..., ResultRow]
MakeRun = Callable[..., RunRecord]

MEASURED: dict[str, Any] = {
    "machine": "one machine",
    "visibility_digest": "bits",
    "failure_count": 10,
    "false_lit_count": 10,
    "counters": {"nodes visited": 100, "tests": 7},
    "kept": {"map": 1024},
    "samples": {"build": [1.0 + 0.001 * i for i in range(10)], "shade": [2.0 + 0.001 * i for i in range(10)]},
}


@pytest.fixture
def compared(make_row: MakeRow, make_run: MakeRun) -> Callable[..., CaseComparison]:
    """Return a function that compares one measured case with another, given what is different in it."""

    def compare(change: dict[str, Any] | None = None, **before: Any) -> CaseComparison:
        rows = make_row(**(MEASURED | before)), make_row(**(MEASURED | before | (change or {})))
        comparison = compare_runs(make_run(), rows[:1], make_run(run_id="run-2"), rows[1:])
        (case,) = comparison.cases
        return case

    return compare


Compared = Callable[..., CaseComparison]


def _times(factor: float) -> dict[str, list[float]]:
    return {name: [factor * sample for sample in samples] for name, samples in MEASURED["samples"].items()}


def test_the_same_case_is_the_same_in_everything(compared: Compared) -> None:
    case = compared()
    assert case.summary == "same in everything, no difference in time shown"
    assert case.is_unchanged
    assert not case.kinds
    assert [time.ratio.estimate for time in case.times] == [1.0, 1.0]


@pytest.mark.parametrize(
    ("change", "summary", "kinds"),
    [
        ({"samples": _times(1.5)}, "same pixels, slower", {Kind.SLOWER}),
        ({"samples": _times(0.5)}, "faster, same pixels", set()),
        ({"samples": _times(0.5), "visibility_digest": "x"}, "faster, other pixels", {Kind.PIXELS}),
        (
            {"counters": {"nodes visited": 101, "tests": 7}},
            "same pixels, counters changed, no difference in time shown",
            {Kind.COUNTERS},
        ),
        ({"kept": {"map": 1024, "tree": 1}}, "same pixels, other bytes kept, no difference in time shown",
         {Kind.MEMORY}),
        ({"machine": "another"}, "same in everything but time, which was not compared", set()),
        ({"machine": "another", "visibility_digest": "x"}, "other pixels, time not compared", {Kind.PIXELS}),
        (
            {"samples": {"build": [5.0] * 10, "shade": [1.0] * 10}},
            "same pixels, slower build, faster shade",
            {Kind.SLOWER},
        ),
        ({"visibility_digest": ""}, "pixels not known, no difference in time shown", set()),
    ],
)  # fmt: skip
def test_a_plain_line_says_what_changed(
    compared: Compared, change: dict[str, Any], summary: str, kinds: set[Kind]
) -> None:
    case = compared(change)
    assert case.summary == summary
    assert case.kinds == kinds


def test_every_counter_and_array_that_changed_is_named_with_both_values(compared: Compared) -> None:
    case = compared({"counters": {"nodes visited": 101, "splits": 3}, "kept": {"map": 2048}})
    assert case.counters == (*(Change("nodes visited", 100, 101), Change("tests", 7, None), Change("splits", None, 3)),)
    assert case.memory == (Change("map", 1024, 2048),)


@pytest.mark.parametrize(
    ("before", "after", "outcome", "note"),
    [
        ({}, {"failure_count": 11}, Pixels.OTHER, ""),
        ({"changed_count": 0}, {"changed_count": 3}, Pixels.SAME_COUNTS, "bits may differ between repeats"),
        ({"changed_count": 0}, {"failure_count": 11}, Pixels.OTHER_COUNTS, "bits may differ between repeats"),
        (
            {"environment": {"libraries": {"embreex": "4.4.0"}}},
            {"environment": {"libraries": {"embreex": "4.5.0"}}},
            Pixels.SAME_COUNTS,
            "embreex is 4.5.0, was 4.4.0",
        ),
        ({"reference_error": 0.1}, {"machine": "another"}, Pixels.SAME_COUNTS, "1/255 between machines"),
        ({"reference_error": 0.1}, {}, Pixels.OTHER, ""),
        ({}, {"machine": "another"}, Pixels.OTHER, ""),
    ],
)
def test_counts_are_compared_only_where_bits_may_differ(
    compared: Compared, before: dict[str, Any], after: dict[str, Any], outcome: Pixels, note: str
) -> None:
    case = compared(after | {"visibility_digest": "other bits"}, **before)
    assert case.pixels is outcome
    assert note in case.pixels_note
    assert bool(note) == bool(case.pixels_note)


@pytest.mark.parametrize(
    ("a", "b", "summary", "kinds"),
    [
        ({}, {"outcome": "crash", "reason": "SIGSEGV"}, "failed in B: crash: SIGSEGV", {Kind.FAILURES}),
        ({"outcome": "error", "reason": "why"}, {}, "failed in A: error: why", set()),
        ({"outcome": "timeout"}, {"outcome": "timeout"}, "failed in both: timeout", set()),
        ({"outcome": "error"}, {"outcome": "crash"}, "failed in A: error, failed in B: crash", set()),
        ({"outcome": "skipped", "reason": "no lamp"}, {}, "skipped in A: no lamp", set()),
        ({"outcome": "skipped"}, {"outcome": "error"}, "skipped in A, failed in B: error", {Kind.FAILURES}),
    ],
)
def test_a_case_that_was_not_measured_says_where_and_why(
    make_row: MakeRow, make_run: MakeRun, a: dict[str, Any], b: dict[str, Any], summary: str, kinds: set[Kind]
) -> None:
    (case,) = compare_runs(make_run(), [make_row(**a)], make_run(), [make_row(**b)]).cases
    assert case.summary == summary
    assert case.kinds == kinds


def test_a_case_of_one_run_only_is_told(make_row: MakeRow, make_run: MakeRun) -> None:
    comparison = compare_runs(make_run(), [make_row(method="old")], make_run(), [make_row(method="new")])
    assert [case.summary for case in comparison.cases] == ["only in A", "only in B"]
    assert comparison.failing(list(Kind)) == {Kind.MISSING: 1}


def _noted(make_row: MakeRow, run_a: RunRecord, run_b: RunRecord) -> RunComparison:
    return compare_runs(run_a, [make_row(**MEASURED)], run_b, [make_row(**MEASURED)])


def test_versions_and_machines_that_differ_are_noted(make_row: MakeRow, make_run: MakeRun) -> None:
    a = make_run(code_version="1", machine="one", environment={"python": "3.11", "libraries": {"numpy": "2.0"}})
    b = make_run(code_version="2", machine="two", environment={"python": "3.11", "libraries": {"scipy": "1.0"}})
    assert _noted(make_row, a, b).notes == (
        "code: 1 in A, 2 in B",
        "A on one; B on two: times were not compared",
        "numpy: 2.0 in A, absent in B",
        "scipy: absent in A, 1.0 in B",
    )
    assert _noted(make_row, a, a).notes == ()
