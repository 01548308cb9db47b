"""Every way in which a plugin can go wrong is its own outcome, with a reason, and costs its own case only."""

from __future__ import annotations

import json
from pathlib import Path

import lasting_workers
import once_a_session
import psutil
import pytest
from small_runs import Ended, carry_out, kept, planned

from shadowbench.rows import Outcome, RunStatus

pytestmark = pytest.mark.slow  # a new worker process for each broken one, and some time-outs

EXPECTED: dict[str, tuple[Outcome, str]] = {
    "raises": (Outcome.ERROR, "ValueError: no tree could be built"),
    "raises-later": (Outcome.ERROR, "RuntimeError: tired"),
    "exits": (Outcome.CRASH, "the worker left with exit status 7 during build"),
    "exits-politely": (Outcome.ERROR, "SystemExit: enough"),
    "segfaults": (Outcome.CRASH, "the worker ended by SIGSEGV during shade"),
    "aborts": (Outcome.CRASH, "the worker ended by SIGABRT during shade"),
    "writes-to-receivers": (Outcome.CRASH, "the worker ended by SIGSEGV during shade"),
    "loops": (Outcome.TIMEOUT, "no end of shade within 5 s"),
    "loops-in-c": (Outcome.TIMEOUT, "no end of shade within 5 s"),
    "starts-a-process": (Outcome.TIMEOUT, "no end of shade within 5 s"),
    "allocates": (Outcome.OUT_OF_MEMORY, "of memory during shade; its limit is 0.59 GiB"),
    "allocates-at-once": (Outcome.OUT_OF_MEMORY, "MemoryError: Unable to allocate"),
    "nan": (Outcome.INVALID, "3 of {valid} valid receivers are NaN or were not written"),
    "unwritten": (Outcome.INVALID, "10 of {valid} valid receivers are NaN or were not written"),
    "out-of-range": (Outcome.INVALID, "{valid} valid receivers are outside [0, 1], for instance 1.5"),
    "fickle": (Outcome.INVALID, "1 of {valid} receivers differ between two repeats"),
    "fickle-counter": (Outcome.INVALID, "counter 'frames' is 1 in one repeat and 2 in another"),
    "wrong-mask": (Outcome.INVALID, "mask 'classified' has shape (3,)"),
    "wrong-picture": (Outcome.INVALID, "heat map 'heat' has shape ({valid}, 2)"),
    "unsupporting": (Outcome.SKIPPED, "it likes no light"),
    "unavailable": (Outcome.SKIPPED, "needs a library that nobody has"),
    "cuda-only": (Outcome.SKIPPED, "runs on cuda, not on cpu"),
    "fickle-allowed": (Outcome.OK, ""),
    "formula": (Outcome.OK, ""),
    "good": (Outcome.OK, ""),
}


def _carry_out(results: Path) -> None:
    carry_out(planned(results, "formula"))  # compiles and prepares without a time limit that bites
    plan = planned(results, *EXPECTED, timeout_s=5.0, memory_limit_bytes=600 << 20)
    carry_out(plan)
    left = [p for p in psutil.process_iter(["cmdline"]) if _is_worker(p) and _started_here(p)]
    (results / "left.json").write_text(json.dumps([process.info["cmdline"] for process in left]))


@pytest.fixture(scope="module")
def results() -> Path:
    return once_a_session.made("outcomes", _carry_out)


@pytest.fixture(scope="module")
def ended(results: Path) -> Ended:
    return kept(results)


@pytest.mark.parametrize("method", EXPECTED)
def test_it_ends_as_its_own_outcome_with_a_reason(ended: Ended, method: str) -> None:
    outcome, reason = EXPECTED[method]
    row = ended.row(method)
    assert row.outcome is outcome
    assert reason.format(valid=ended.row("good").receivers) in row.reason
    assert "\n" not in row.reason


def test_no_case_lacks_its_row_and_the_run_is_complete(ended: Ended) -> None:
    assert ended.record.status is RunStatus.COMPLETE
    assert {row.method for row in ended.rows} == EXPECTED.keys()
    assert len(ended.rows) == ended.record.case_count


def test_what_the_plugin_wrote_is_kept_with_where_it_failed(ended: Ended) -> None:
    raised = ended.row("raises").stderr_tail
    assert "a word before the end" in raised
    assert "in build" in raised
    assert "second line" in raised
    assert "Fatal Python error: Segmentation fault" in ended.row("segfaults").stderr_tail
    assert "in shade" in ended.row("segfaults").stderr_tail
    assert "in shade" in ended.row("loops").stderr_tail, "a timeout says where it hung"


def test_receivers_that_change_are_counted_where_they_may(ended: Ended) -> None:
    (warning,) = (w for w in ended.row("fickle-allowed").warnings if "changed" in w)
    assert "receivers changed between repeats" in warning


def test_the_good_ones_are_timed_beside_the_bad_ones(ended: Ended) -> None:
    assert ended.row("good").comparison == ended.row("formula").comparison
    assert ended.row("good").rounds == 3
    assert ended.row("formula").failure_count == 0


def test_no_process_is_left_behind(results: Path) -> None:
    assert json.loads((results / "left.json").read_text()) == []


def _is_worker(process: psutil.Process) -> bool:
    is_waiting = process.pid in lasting_workers.idle_process_ids()
    return "shadowbench.runner.worker" in (process.info["cmdline"] or ()) and not is_waiting


def _started_here(process: psutil.Process) -> bool:
    """Children of this process, and what a plugin's children became when their worker was killed."""
    try:
        return process.ppid() in (psutil.Process().pid, 1)
    except psutil.NoSuchProcess:
        return False
