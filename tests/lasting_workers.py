"""Worker processes that outlast the run they were started for, for tests in which starting them is not the point.

A run keeps the workers it has parked for its later cases and ends them when it is over. Within :func:`lasting_workers`
they wait for the next run instead, as if both were one: starting Python, Warp and plugins takes most of the time of a
run on a scene of four triangles. What has failed, or was at work, is killed as ever, and a run with other plugin
files, another memory limit or another environment gets workers of its own.
"""

from __future__ import annotations

import os
from collections.abc import Hashable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

import pytest

from shadowbench.runner.pool import Pool, Worker

_MOST_IDLE = 5
"""Of one test process: what a run of three cases starts."""

_idle: dict[Worker, Hashable] = {}
"""Worker -> what it was started with, the one that has waited longest first."""


class _LastingPool(Pool):
    def __init__(self, plugin_files: tuple[Path, ...], memory_limit: int) -> None:
        super().__init__(plugin_files, memory_limit)
        files = [(file.absolute(), file.stat().st_mtime_ns if file.exists() else 0) for file in plugin_files]
        environment = {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"}
        self._started_with = (*files, memory_limit, Path.cwd(), *sorted(environment.items()))
        self._parked = [worker for worker, started_with in _idle.items() if started_with == self._started_with]
        self._all = list(self._parked)
        for worker in self._parked:
            del _idle[worker]

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        waiting = [worker for worker in self._parked if not worker.has_ended()]
        self._all = [worker for worker in self._all if worker not in waiting]
        _idle.update(dict.fromkeys(waiting, self._started_with))
        end_idle_workers(but=_MOST_IDLE)
        super().__exit__(kind, error, trace)


def end_idle_workers(*, but: int = 0) -> None:
    """Kill the workers that nobody uses, those that have waited longest first."""
    for worker in list(_idle)[: max(0, len(_idle) - but)]:
        del _idle[worker]
        worker.kill()


def idle_process_ids() -> set[int]:
    """Return the processes that wait for another run; no run has left them behind."""
    return {worker.process_id for worker in _idle}


@contextmanager
def lasting_workers() -> Iterator[None]:
    """Have plans and runs of this process take workers that waited, and leave theirs for the next."""
    with pytest.MonkeyPatch.context() as patch:
        for module in ("planning", "running"):
            patch.setattr(f"shadowbench.runner.{module}.Pool", _LastingPool)
        yield
