"""The head of the page: what is called fastest and best, and what is not called so."""

from __future__ import annotations

from typing import Any

import pytest
from stored_rows import some_row, some_run

from shadowbench.report.embedding import PicturePool, Pool
from shadowbench.report.summary import Finding, Verdict, flattened, summarize
from shadowbench.report.views import SceneView, scene_views
from shadowbench.rows import Outcome, ResultRow, RunStatus
from shadowbench.tables.claims import ClaimAnswer
from shadowbench.tables.claims import Verdict as ClaimVerdict


def views_of(*rows: ResultRow) -> list[SceneView]:
    return scene_views(some_run(), rows, PicturePool(lambda name: b""))


def verdict_of(*rows: ResultRow) -> Verdict:
    return summarize(some_run(), rows, views_of(*rows)).verdicts[0]


def names(found: Finding | None) -> list[str]:
    return [] if found is None else [title for title, _ in found.cases]


def timed(method: str, low: float, median: float, high: float, failures: int = 0, **fields: Any) -> ResultRow:
    times = {"dynamic_frame_ms": median, "dynamic_frame_ms_low": low, "dynamic_frame_ms_high": high}
    return some_row(method, **times, failure_count=failures, failure_percent=failures / 8.0, **fields)


def test_fastest_exact_and_best_approximate_are_told_apart() -> None:
    verdict = verdict_of(
        timed("slow-exact", 9, 10, 11), timed("exact", 7, 8, 8.5), timed("good", 4, 5, 6, 1), timed("bad", 1, 2, 3, 9)
    )
    assert names(verdict.exact) == ["exact"]
    assert names(verdict.approximate) == ["good"]
    assert names(verdict.fastest) == ["bad"]


def test_overlapping_intervals_are_named_together() -> None:
    verdict = verdict_of(timed("a", 4, 5, 6), timed("b", 5.5, 6.5, 7.5), timed("c", 6.1, 7, 8))
    assert names(verdict.fastest) == ["a", "b"]


def test_rounds_in_common_tell_apart_what_intervals_do_not() -> None:
    drift = [1.0 + number for number in range(12)]  # a machine that slows down widens both intervals alike

    def in_rounds(method: str, factor: float) -> ResultRow:
        samples = {"build": [0.0] * 12, "shade": [factor * value for value in drift], "camera": [0.0] * 12}
        return timed(method, 3.0, 6.5 * factor, 10.0, comparison="c", samples=samples)

    assert names(verdict_of(in_rounds("b", 1.1), in_rounds("a", 1.0), timed("c", 4, 7, 9)).fastest) == ["a", "c"]
    assert names(verdict_of(in_rounds("a", 1.0), in_rounds("b", 1.0)).fastest) == ["a", "b"]


def test_many_equals_are_counted() -> None:
    verdict = verdict_of(*(timed(name, 4, 5, 6) for name in "abcde"))
    assert names(verdict.fastest) == ["a", "b", "c"]
    assert verdict.fastest is not None
    assert verdict.fastest.more == 2


def test_cases_of_another_view_are_not_compared() -> None:
    rows = [timed("a", 4, 5, 6), timed("b", 1, 2, 3, light="lamp")]
    assert [names(v.fastest) for v in summarize(some_run(), rows, views_of(*rows)).verdicts] == [["a"], ["b"]]


def test_unscored_and_failed_cases_win_nothing() -> None:
    verdict = verdict_of(
        timed("a", 4, 5, 6, 1), some_row("b", failure_count=None, failure_percent=None), some_row("c", outcome="crash")
    )
    assert names(verdict.exact) == []
    assert names(verdict.approximate) == ["a"]
    assert names(verdict.fastest) == ["b"]


def test_outcomes_are_counted_in_a_fixed_order() -> None:
    rows = [some_row(outcome="crash"), some_row(), some_row(outcome="crash")]
    tallies = summarize(some_run(), rows, views_of(*rows)).tallies
    assert [(tally.outcome, tally.count) for tally in tallies] == [(Outcome.OK, 1), (Outcome.CRASH, 2)]


@pytest.mark.parametrize("status", [status for status in RunStatus if status is not RunStatus.COMPLETE])
def test_run_that_did_not_end_says_so(status: RunStatus) -> None:
    assert "This run" in summarize(some_run(status=status), [], []).notices[0]


def test_warning_names_its_cases() -> None:
    rows = [some_row(name, warnings=["tiny triangles"]) for name in "abcd"]
    (warned,) = summarize(some_run(), rows, views_of(*rows)).warnings
    assert [title for title, _ in warned.cases] == ["a", "b", "c"]
    assert (warned.more, warned.varies) == (1, False)


def test_warnings_that_differ_in_figures_are_one() -> None:
    rows = [some_row("a", warnings=["interval 12.5 %"]), some_row("b", warnings=["interval 7 %"])]
    (warned,) = summarize(some_run(), rows, views_of(*rows)).warnings
    assert (warned.text, len(warned.cases), warned.varies) == ("interval 12.5 %", 2, True)


def test_title_is_the_experiments_own_if_the_run_knows_it() -> None:
    assert summarize(some_run(), [], []).title == "quick"
    assert summarize(some_run(definitions=[{"name": "quick", "title": "A quick look"}]), [], []).title == "A quick look"


def test_a_peers_device_is_named_beside_the_runs_environment() -> None:
    own = some_row("gl", environment={"libraries": {"numpy": "2.4", "renderer": "a card"}})
    facts = summarize(some_run(), [some_row(), own], views_of(own)).environment
    assert facts == [("python", "3.11"), ("libraries, numpy", "2.4"), ("renderer", "a card")]
    (card,) = views_of(own)[0].cards
    measured = next(section for section in card.sections if section.title == "Measured")
    assert ("renderer", "a card") in measured.lines


def test_nested_environment_is_flattened() -> None:
    nested = {"python": "3.11", "libraries": {"numpy": "2.4", "none": None}, "load_average": [0.5, 1.0]}
    expected = [("python", "3.11"), ("libraries, numpy", "2.4"), ("load average", "0.5, 1.0")]
    assert flattened(nested) == expected


def test_many_experiments_are_counted_in_the_title_and_named_below_it() -> None:
    summary = summarize(some_run(experiments=["a", "b", "c"]), [], [])
    assert (summary.title, summary.subtitle) == ("a, and 2 more experiments", "a, b, c")


def test_claims_are_counted_by_verdict() -> None:
    verdicts = [ClaimVerdict.UNDECIDED, ClaimVerdict.HOLDS, ClaimVerdict.HOLDS]
    claims = [ClaimAnswer("c", "quick", "It is so.", "", verdict, "") for verdict in verdicts]
    assert summarize(some_run(), [], [], claims).claims == [(ClaimVerdict.HOLDS, 2), (ClaimVerdict.UNDECIDED, 1)]


def test_extent_counts_what_was_compared() -> None:
    rows = [some_row("a"), some_row("b"), some_row("b", light="lamp")]
    assert summarize(some_run(), rows, views_of(*rows)).extent == [(1, "experiment"), (2, "methods"), (2, "views")]


def test_what_the_bound_on_the_size_cost_is_said() -> None:
    pool = Pool(left_out=frozenset({3, 4}), reduced_to=240)
    notices = summarize(some_run(), [], [], pool=pool).notices
    assert [text for text in notices if "240 pixels" in text]
    assert [text for text in notices if text.startswith("To keep this page small, 2 of")]
    assert summarize(some_run(), [], []).notices == []
