"""The rounds of a case are divided among several worker processes, which must agree."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import once_a_session
import pytest
from small_runs import Ended, carry_out, kept, planned

from shadowbench.rows import Outcome

Measure = Callable[..., Ended]

THREE = {"processes": 3, "min_rounds": 9, "max_rounds": 9, "budget_s": 60.0}


def _carry_out(results: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FAILS_AGAIN_MARK", str(results / "mark"))
        methods = ("formula", "fickle-process", "counts-processes", "fickle-process-allowed", "fails-again", "good")
        carry_out(planned(results, *methods, **THREE))


@pytest.fixture(scope="module")
def ended() -> Ended:
    return kept(once_a_session.made("processes", _carry_out))


def test_every_round_names_its_process(ended: Ended) -> None:
    for method in ("formula", "good"):
        row = ended.row(method)
        assert row.outcome is Outcome.OK
        assert row.processes == 3
        assert row.round_processes == [0, 0, 0, 1, 1, 1, 2, 2, 2]
        assert row.rounds == len(row.samples["shade"]) == len(row.samples["camera"]) == 9
        # whether nine rounds happen to be tight is the machine's affair; tests of Pace settle which it is then
        assert row.ended_by in ("rounds", "interval")


def test_a_result_that_depends_on_the_process_is_invalid(ended: Ended) -> None:
    row = ended.row("fickle-process")
    assert (row.outcome, row.reason) == (Outcome.INVALID, "the visibility differs between two worker processes")
    row = ended.row("counts-processes")
    assert (row.outcome, row.reason) == (Outcome.INVALID, "a counter differs between two worker processes")


def test_a_peers_result_may_depend_on_the_process_and_says_so(ended: Ended) -> None:
    row = ended.row("fickle-process-allowed")
    assert row.outcome is Outcome.OK
    assert "receivers changed between worker processes" in row.warnings


def test_a_case_that_cannot_be_loaded_again_ends_and_the_others_go_on(ended: Ended) -> None:
    row = ended.row("fails-again")
    assert (row.outcome, row.reason) == (Outcome.ERROR, "RuntimeError: once was enough")
    assert ended.row("good").rounds == 9


def test_cases_are_compared_with_the_comparisons_first(ended: Ended) -> None:
    first = ended.row("formula")
    assert first.baseline_case == first.case_key == ended.row("good").baseline_case


def test_a_row_says_how_its_samples_were_taken(measure: Measure) -> None:
    (row,) = measure("formula", min_rounds=8, max_rounds=8).rows
    assert row.warm_up_frames is not None
    assert 2 <= row.warm_up_frames <= 10
    assert row.build_repeats is not None
    assert row.build_repeats > 1, "building nothing takes microseconds"
    assert row.shade_repeats is not None
    assert row.shade_repeats > 1
    assert row.counters["receivers looked at"] == row.receivers, "of one frame, not of all repeats"
    assert row.unexplained_ms is not None
    assert row.build_ms is not None
    assert row.shade_ms is not None
    frames = np.add(row.samples["build"], row.samples["shade"])
    assert row.unexplained_ms <= frames.max()
    assert sum(row.stages.values()) + row.unexplained_ms == pytest.approx(np.median(frames), rel=0.5)
    assert set(row.outlier_rounds) <= set(range(8))


def test_the_peak_of_memory_is_the_largest_of_all_processes(measure: Measure) -> None:
    big, small = measure("remembers:megabytes=300/1", **THREE).rows
    assert big.peak_rss_bytes is not None
    assert small.peak_rss_bytes is not None
    assert big.peak_rss_bytes - small.peak_rss_bytes == pytest.approx(299 << 20, rel=0.1)
    assert big.kept == {"nothing much": 300 << 20}
    assert big.bytes_kept == 300 << 20
