"""What every part of a run needs: workers, options, the store, and whom to tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.rows import Outcome, ResultRow, RunRecord
from shadowbench.runner.cases import Case, Observer, Obstacle, RunOptions
from shadowbench.runner.pool import Pool, Worker
from shadowbench.runner.protocol import CaseFailure
from shadowbench.runner.reuse import KnownQuality
from shadowbench.runner.row_making import ended_row

if TYPE_CHECKING:
    from shadowbench.store import Store

OWN_WORK_TIMEOUT_S = 3600.0
"""For what runs no plugin: receivers, reference and camera pass, with the compilation of their kernels."""


@dataclass
class Bench:
    """The tools of a run.

    Attributes:
        pool: Where workers come from.
        options: The run's.
        run: The run's record.
        store: Where rows and pictures are kept.
        observer: Told about each step.
        pictures: A folder for pictures on their way to the store.
        known_quality: What earlier runs have measured; ``None`` where nobody can be asked.
        failed: Keys of the cases that did not end well in this process.
        kernel_ms: How long each Warp module took to compile, or to load where it was compiled before [ms].
    """

    pool: Pool
    options: RunOptions
    run: RunRecord
    store: Store
    observer: Observer
    pictures: Path
    known_quality: KnownQuality | None = None
    failed: set[str] = field(default_factory=set)
    kernel_ms: dict[str, float] = field(default_factory=dict)

    @property
    def cache(self) -> str:
        """The cache's folder, for workers."""
        return str(self.options.cache)

    def end(self, case: Case, how: Obstacle | CaseFailure) -> None:
        """Keep the row of a case that was not measured."""
        if how.outcome is not Outcome.SKIPPED:
            self.failed.add(case.case_key)
        self.keep(ended_row(case, self.run, how.outcome, how.reason, how.stderr_tail))

    def known(self, cases: Sequence[Case]) -> dict[str, ResultRow]:
        """Return quality key -> an earlier row with that quality, for those of the cases."""
        return {} if self.known_quality is None else self.known_quality.of(cases)

    def keep(self, row: ResultRow) -> None:
        """Make a row durable, then tell about it."""
        self.store.add_row(row)
        self.observer.row_finished(row)

    def keep_picture(self, file: Path) -> str:
        """Move a picture to the store and return its name there."""
        name = self.store.put_artifact(file.read_bytes(), "png")
        file.unlink()
        return name

    def own_work(self, call: str, arguments: dict[str, Any], threads: int) -> Any:
        """Have a worker do something of the run's own and return its answer; nothing of a plugin's runs.

        A worker that somebody kills meanwhile is replaced once.

        Raises:
            CaseFailure: It cannot be done.
        """
        try:
            return self._own_work(call, arguments, threads)
        except CaseFailure as failure:
            if not failure.is_from_outside:
                raise
            self.observer.note(f"{failure.reason}; once more in another")
            return self._own_work(call, arguments, threads)

    def _own_work(self, call: str, arguments: dict[str, Any], threads: int) -> Any:
        worker = self.pool.take(threads)
        try:
            answer = worker.ask(call, arguments, OWN_WORK_TIMEOUT_S)
        except CaseFailure:
            worker.kill()
            raise
        self.park(worker)
        return answer

    def park(self, worker: Worker) -> None:
        """Have a worker let go of its case, and keep it for the next one if it still answers."""
        if not worker.is_alive:
            return
        try:
            worker.ask("close", {}, self.options.timeout_s)
        except CaseFailure:
            worker.kill()
        else:
            self.pool.park(worker)
