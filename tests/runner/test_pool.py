"""Worker processes from the runner's side: asked, parked, found dead, and killed with all that they started."""

from __future__ import annotations

import os
import select
import signal
from collections.abc import Iterator

import psutil
import pytest
from small_runs import PLUGIN_FILES

from shadowbench.errors import InvalidResultError, PluginError, SceneError
from shadowbench.rows import Outcome
from shadowbench.runner.pool import Pool, Worker
from shadowbench.runner.protocol import CaseFailure, decode, encode, outcome_of, reason_of


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Pool(PLUGIN_FILES, 2 << 30) as opened:
        yield opened


def _process(worker: Worker) -> psutil.Process:
    return psutil.Process(worker._process.pid)


def _environment(worker: Worker) -> dict[str, str]:
    """The environment of a worker, asked first: until a process has its new image, the kernel shows an empty one."""
    worker.ask("names", {"kind": "method"}, 60.0)
    return _process(worker).environ()


def test_a_parked_worker_is_taken_again_for_the_same_threads_only(pool: Pool) -> None:
    worker = pool.take(1)
    assert "good" in worker.ask("names", {"kind": "method"}, 60.0)
    environment = _environment(worker)
    assert environment["OMP_NUM_THREADS"] == environment["LP_NUM_THREADS"] == "1"
    pool.park(worker)
    other = pool.take(2)
    assert other is not worker
    assert _environment(other)["OMP_NUM_THREADS"] == "2"
    assert pool.take(1) is worker
    pool.park(worker)


def test_an_exception_leaves_the_worker_alive_and_its_trace_readable(pool: Pool) -> None:
    worker = pool.take(1)
    with pytest.raises(CaseFailure) as caught:
        worker.ask("describe_method", {"name": "absent"}, 60.0)
    failure = caught.value
    assert failure.outcome is Outcome.ERROR
    assert failure.reason.startswith("no method is called 'absent'")
    assert isinstance(failure.as_user_error(), PluginError)
    assert "Traceback" in failure.stderr_tail
    assert worker.is_alive
    worker.forget_output()
    assert worker.output_tail() == ""
    assert "tiny" in worker.ask("names", {"kind": "scene"}, 60.0)
    pool.park(worker)


def test_a_worker_killed_by_somebody_else_is_a_crash_that_says_so(pool: Pool) -> None:
    worker = pool.take(1)
    worker.ask("names", {"kind": "method"}, 60.0)
    os.kill(_process(worker).pid, signal.SIGKILL)
    with pytest.raises(CaseFailure, match=r"ended by SIGKILL .*out-of-memory killer") as caught:
        worker.ask("names", {"kind": "method"}, 60.0)
    assert caught.value.outcome is Outcome.CRASH
    assert not worker.is_alive


def test_leaving_the_pool_kills_every_worker_busy_or_not() -> None:
    with Pool((), 2 << 30) as opened:
        workers = [opened.take(1) for _ in range(2)]
        opened.park(workers[0])
        processes = [_process(worker) for worker in workers]
    _, alive = psutil.wait_procs(processes, timeout=30)
    assert not alive


@pytest.mark.parametrize(
    ("error", "outcome", "reason"),
    [
        (ValueError("a\nb"), Outcome.ERROR, "ValueError: a"),
        (KeyError(), Outcome.ERROR, "KeyError"),
        (SceneError("no light"), Outcome.ERROR, "no light"),
        (MemoryError(), Outcome.OUT_OF_MEMORY, "MemoryError"),
        (RuntimeError("Failed to allocate 8 bytes on device 'cpu'"), Outcome.OUT_OF_MEMORY, "RuntimeError: Failed"),
        (InvalidResultError("3 receivers are NaN"), Outcome.INVALID, "3 receivers are NaN"),
        (SystemExit(3), Outcome.ERROR, "SystemExit: 3"),
    ],
)
def test_an_exception_has_its_outcome_and_one_line(error: BaseException, outcome: Outcome, reason: str) -> None:
    assert outcome_of(error) is outcome
    assert reason_of(error).startswith(reason)
    assert "\n" not in reason_of(error)


def test_a_message_is_one_line_and_reads_back() -> None:
    message = {"call": "x", "arguments": {"text": "two\nlines", "number": 1.5, "nothing": None}}
    assert encode(message).count(b"\n") == 1
    assert decode(encode(message)) == message


def test_answers_that_arrive_together_are_taken_one_after_the_other() -> None:
    """A worker that has ended starting and answered a call before anybody looked."""
    with Pool(PLUGIN_FILES, 2 << 30) as opened:
        worker = opened.take(1)
        worker.begin("names", {"kind": "method"})
        while worker._unread.count(b"\n") < 2:
            select.select([worker._answers], [], [])
            worker._read_answers()
        assert "good" in worker.end(30.0)
