"""A worker that somebody kills costs its own case at most: every other has its row, and none has two."""

from __future__ import annotations

import os
import signal
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import psutil
import pytest
from small_runs import Ended, carry_out, planned

from shadowbench.rows import Outcome
from shadowbench.runner.pool import Pool, Worker
from shadowbench.store import DATABASE_NAME

pytestmark = pytest.mark.usefixtures("lasting_workers")

METHODS = ("formula", "good:level=1/2", "pcf:resolution=64")


@pytest.fixture
def kill_during(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, int], None]:
    """Return a function that has the worker killed that is asked for something the n-th time."""

    def kill(call: str, time: int) -> None:
        begin = Worker.begin
        left = time

        def begin_and_die(worker: Worker, asked: str, arguments: dict[str, Any]) -> None:
            nonlocal left
            begin(worker, asked, arguments)
            left -= asked == call
            if asked == call and left == 0:
                os.killpg(worker._process.pid, signal.SIGKILL)

        monkeypatch.setattr(Worker, "begin", begin_and_die)

    return kill


def _run(folder: Path) -> Ended:
    plan = planned(folder, *METHODS)
    ended = carry_out(plan)
    assert len({(row.experiment, row.case_key) for row in ended.rows}) == len(ended.rows) == 4
    with closing(sqlite3.connect(folder / DATABASE_NAME)) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    again = carry_out(plan)
    assert again.seen.remaining == 0
    assert again.rows == ended.rows
    return ended


@pytest.mark.parametrize(
    "call",
    [
        "prepare",
        *(pytest.param(call, marks=pytest.mark.slow) for call in ("describe_method", "place_scene", "resolve_method")),
        *(pytest.param(call, marks=pytest.mark.slow) for call in ("compile_kernels", "prepare_filtered", "close")),
    ],
)
def test_a_worker_killed_in_what_runs_no_plugin_costs_no_case(
    tmp_path: Path, kill_during: Callable[[str, int], None], call: str
) -> None:
    kill_during(call, 1)
    assert [row.outcome for row in _run(tmp_path).rows] == [Outcome.OK] * 4


@pytest.mark.parametrize(
    ("call", "time"),
    [
        ("round", 2),
        *(
            pytest.param(call, time, marks=pytest.mark.slow)
            for call, time in (("load_case", 2), ("warm_up", 3), ("kernel", 1), ("measure", 4))
        ),
    ],
)
def test_a_worker_killed_with_a_case_costs_that_case(
    tmp_path: Path, kill_during: Callable[[str, int], None], call: str, time: int
) -> None:
    kill_during(call, time)
    rows = _run(tmp_path).rows
    assert sorted(row.outcome for row in rows) == [Outcome.CRASH, *[Outcome.OK] * 3]
    (crashed,) = (row for row in rows if row.outcome is Outcome.CRASH)
    assert "ended by SIGKILL (from the system's out-of-memory killer, or by hand)" in crashed.reason


def test_a_worker_killed_while_it_waits_is_not_asked_again() -> None:
    with Pool((), 4 << 30) as pool:
        first = pool.take(1)
        first.ask("names", {"kind": "scene"}, 60.0)
        pool.park(first)
        os.killpg(first._process.pid, signal.SIGKILL)
        psutil.wait_procs([psutil.Process(first._process.pid)], timeout=0.0)
        first._process.wait()
        second = pool.take(1)
        assert second is not first
        assert second.ask("names", {"kind": "scene"}, 60.0)
