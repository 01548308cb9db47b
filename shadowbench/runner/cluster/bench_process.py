"""The process that measures on a worker's machine: a local run's machinery, fed with jobs through a pipe.

Its parent, the dask worker, stays out of the measuring: case workers are children of this process, which polls them as
a local run does, and die with it. It is a process of its own so that it can be killed at any moment, by a cancelled
job or by a plugin.
"""

from __future__ import annotations

import hashlib
import os
import queue
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

from shadowbench.errors import ClusterError, PluginError, ShadowbenchError
from shadowbench.identity import code_version, environment, machine
from shadowbench.rows import ResultRow
from shadowbench.runner.bench import Bench
from shadowbench.runner.cache import Cache
from shadowbench.runner.cases import Case, Plan, RunOptions
from shadowbench.runner.cluster.host_lock import lock_folder, only_job_here
from shadowbench.runner.cluster.jobs import Ending, Job, Message, unpacked
from shadowbench.runner.comparison import measure_comparison
from shadowbench.runner.planning import resolve_again
from shadowbench.runner.pool import Pool, default_memory_limit
from shadowbench.runner.worker import die_with_parent

CACHE_BYTES = 4 << 30
_LEAST_BETWEEN_ROUNDS_S = 1.0
"""Rounds are told of at most this often: what travels while the clock runs could disturb it."""


class Desk:
    """Does one job after the other.

    Args:
        folder: Of this machine's worker: its cache and the plugin files sent to it.
        answers: Where messages go.
    """

    def __init__(self, folder: Path, answers: Connection) -> None:
        self._folder, self._answers = folder, answers
        self._pools = ExitStack()
        self._pool: Pool | None = None
        self._pool_settings: tuple[tuple[Path, ...], int] | None = None
        self._kernel_ms: dict[str, float] = {}

    def do(self, job: Job) -> Ending:
        """Measure a job's cases and send their rows."""
        sender = Sender(job, self._answers)
        try:
            with only_job_here(lock_folder(), lambda: sender.tell_phase(0, "wait for the machine")):
                self._measure(job, sender)
        except ShadowbenchError as error:
            return Ending("refused", str(error))
        except Exception as error:  # noqa: BLE001 - the client must hear of it, whatever it is
            traceback.print_exc()
            return Ending("failed", f"{type(error).__name__}: {error}".splitlines()[0])
        return Ending("done")

    def _measure(self, job: Job, sender: Sender) -> None:
        files = tuple(self._file(sent.name, sent.content) for sent in job.plugin_files)
        limit = job.options.memory_limit_bytes or default_memory_limit()
        options = replace(job.options, results=self._folder, plugin_files=files, cluster=None)
        pool = self._pool_for(files, limit)
        sender.tell_phase(0, "place the scene")
        cases = _resolved_here(pool, options, job.cases)
        _hold_to_plan(job.cases, cases)
        baseline = job.baseline
        if baseline in job.cases:
            baseline = cases[job.cases.index(baseline)]
        elif baseline is not None:
            (baseline,) = _resolved_here(pool, options, [baseline])
            baseline = baseline if baseline.obstacle is None else None
        sender.index_of = {case.case_key: index for index, case in enumerate(cases)}
        record = job.record.model_copy(
            update={"machine": machine(), "environment": environment(), "code_version": code_version()}
        )
        with tempfile.TemporaryDirectory(prefix="shadowbench-") as pictures:
            bench = Bench(pool, options, record, sender, sender, Path(pictures), kernel_ms=self._kernel_ms)
            measure_comparison(bench, cases, baseline, job.budget_s)
            self._kernel_ms = bench.kernel_ms
        Cache(options.cache).prune(CACHE_BYTES)

    def _file(self, name: str, content: bytes) -> Path:
        """Keep a plugin file under its digest, so that it is the same module in every job."""
        file = self._folder / "plugins" / hashlib.sha256(content).hexdigest()[:20] / Path(name).name
        if not file.is_file() or file.read_bytes() != content:
            file.parent.mkdir(parents=True, exist_ok=True)
            temporary = file.with_name(f".{file.name}.{os.getpid()}")
            temporary.write_bytes(content)
            temporary.replace(file)
        return file

    def _pool_for(self, files: tuple[Path, ...], limit: int) -> Pool:
        if self._pool is None or self._pool_settings != (files, limit):
            self._pools.close()
            self._pool, self._pool_settings = self._pools.enter_context(Pool(files, limit)), (files, limit)
        return self._pool


class Sender:
    """Keeps rows and pictures by sending them to the client, and tells it what goes on.

    Args:
        job: Whose they are.
        answers: Where messages go.

    Attributes:
        index_of: Case key on this machine -> place in the job.
    """

    def __init__(self, job: Job, answers: Connection) -> None:
        self.index_of: dict[str, int] = {}
        self._job, self._answers = job.name, answers
        self._pictures: dict[str, bytes] = {}
        self._last_round_s = 0.0

    def put_artifact(self, content: bytes, suffix: str) -> str:
        """Hold a picture until its row is added."""
        name = f"{hashlib.sha256(content).hexdigest()}.{suffix}"
        self._pictures[name] = content
        return name

    def add_row(self, row: ResultRow) -> None:
        """Send a row with its pictures."""
        pictures, self._pictures = self._pictures, {}
        message = Message(kind="row", job=self._job, index=self.index_of[row.case_key], row=row.model_dump_json())
        self._answers.send(message | {"pictures": pictures})

    def tell_phase(self, index: int, text: str) -> None:
        """Say what comes next for a case."""
        self._answers.send(Message(kind="phase", job=self._job, index=index, text=text))

    def case_started(self, case: Case, phase: str) -> None:
        """Pass a phase on, of rounds only some."""
        index = self.index_of.get(case.case_key)
        if index is None:
            return
        if phase.startswith("round"):
            now_s = time.monotonic()
            if now_s - self._last_round_s < _LEAST_BETWEEN_ROUNDS_S:
                return
            self._last_round_s = now_s
        self.tell_phase(index, phase)

    def planned(self, plan: Plan, remaining: int) -> None:
        """Nothing: the client knows its plan."""

    def row_finished(self, row: ResultRow) -> None:
        """Nothing: the row itself was sent."""

    def note(self, text: str) -> None:
        """Pass a note on."""
        self._answers.send(Message(kind="note", job=self._job, text=text))


def _resolved_here(pool: Pool, options: RunOptions, cases: Sequence[Case]) -> list[Case]:
    """Resolve cases on this machine; the process that is asked may be killed by hand once.

    Raises:
        ShadowbenchError: As for :func:`shadowbench.runner.planning.resolve_again`.
    """
    with suppress(PluginError):
        return resolve_again(pool, options, cases)
    return resolve_again(pool, options, cases)


def _hold_to_plan(planned: Sequence[Case], here: Sequence[Case]) -> None:
    """Compare the keys of cases with those that the client gave them; only a peer's library may differ.

    Raises:
        ClusterError: They differ otherwise.
    """
    for ours, case in zip(planned, here, strict=True):
        if case.obstacle is not None or case.quality_key == ours.quality_key or case.libraries != ours.libraries:
            continue
        what = f"method '{case.method}'" if case.view.content == ours.view.content else f"scene '{case.view.scene}'"
        raise ClusterError(f"{what} is not what the plan was made with: its code, its files or a library differ")


def serve(asks: Connection, answers: Connection, folder: Path) -> None:
    """Do jobs until the other side closes."""
    desk = Desk(folder, answers)
    jobs: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_read_jobs, args=(asks, jobs), daemon=True).start()
    while True:
        ending = desk.do(unpacked(jobs.get()))
        answers.send({"kind": "end", **ending.to_wire()})


def _read_jobs(asks: Connection, jobs: queue.SimpleQueue[bytes]) -> None:
    try:
        while True:
            jobs.put(asks.recv_bytes())
    except (EOFError, OSError):
        os._exit(0)  # the dask worker is gone, or wants no more


def main() -> None:
    """Serve on the descriptors named on the command line."""
    die_with_parent()
    asks, answers = (Connection(int(number)) for number in sys.argv[1:3])
    for connection in (asks, answers):
        os.set_inheritable(connection.fileno(), False)
    serve(asks, answers, Path(sys.argv[3]))


if __name__ == "__main__":
    main()
