"""The client's side of a run on a cluster: whom to give what, what to do when a worker dies, rows into the store.

The client alone writes. A case is finished when its row is in the store; what a worker measured and could not hand over
is measured again. A job that died is given out again, and taken apart until the case that kills is alone; that one
ends as *crash*.
"""

from __future__ import annotations

import itertools
import secrets
import time
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from shadowbench.errors import ClusterError, ShadowbenchError
from shadowbench.rows import Outcome, ResultRow, RunRecord
from shadowbench.runner.cases import Case, ClusterAccess, Observer, Plan
from shadowbench.runner.cluster.access import checked_access, quiet_dask, require_distributed, security_of
from shadowbench.runner.cluster.jobs import RESOURCE, Ending, Job, Message, PluginFile, packed
from shadowbench.runner.row_making import ended_row

if TYPE_CHECKING:
    from distributed import Client, Future

    from shadowbench.runner.cluster.comrades import Comrade
    from shadowbench.runner.finished import Finished
    from shadowbench.store import Store

CONNECT_TIMEOUT_S = 10.0
RESULT_TIMEOUT_S = 10.0
"""For how a job ended, a few bytes, to come from the worker that has them."""

MOST_MESSAGES = 64
"""On their way to the client; workers wait when there are more."""

_POLL_S = 0.1


@dataclass
class Batch:
    """Cases of one comparison that wait for a worker.

    Attributes:
        comparison: All cases of the comparison.
        cases: Those to measure.
        deaths: How often a worker died over just these.
    """

    comparison: Sequence[Case]
    cases: list[Case]
    deaths: int = 0


@dataclass
class Flight:
    """A job at work.

    Attributes:
        batch: What it is made of.
        job: What was handed out.
        comrade: To whom.
        future: Of the dask task.
        suspect: Whose plugin's code the worker was last said to run.
    """

    batch: Batch
    job: Job
    comrade: Comrade
    future: Future[Any]
    suspect: Case | None = field(default=None)


def measure_on_cluster(plan: Plan, store: Store, record: RunRecord, observer: Observer, finished: Finished) -> None:
    """Have the workers of a cluster measure what a plan has left.

    Raises:
        UsageError: The address or the certificates are wrong, or the optional package is missing.
        ClusterError: The cluster cannot be reached, goes away, or no worker in it may measure the plan.
        StoreError: A row cannot be kept.
    """
    assert plan.options.cluster is not None
    with connected(plan.options.cluster) as client:
        handing = Handing(client, plan, store, record, observer, finished)
        with _named_if_lost(client, plan.options.cluster):
            handing.run()


@contextmanager
def connected(access: ClusterAccess) -> Iterator[Client]:
    """Yield a client of a scheduler.

    Raises:
        UsageError: The address or the certificates are wrong, or the optional package is missing.
        ClusterError: Nobody answers.
    """
    require_distributed()
    access = checked_access(access)
    with quiet_dask():
        from distributed import Client

        security = security_of(access)
        try:
            client = Client(access.address, security=security, timeout=CONNECT_TIMEOUT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ClusterError(
                f"no scheduler answers at {access.address} within {CONNECT_TIMEOUT_S:g} s; `shadowbench scheduler` "
                f"starts one, and both sides must agree on TLS ({type(error).__name__})"
            ) from error
        try:
            yield client
        finally:
            with suppress(Exception):  # it may have lost its scheduler
                client.close(timeout=2.0)


@contextmanager
def _named_if_lost(client: Client, access: ClusterAccess) -> Iterator[None]:
    """Turn whatever dask raises when its scheduler is gone into one sentence."""
    try:
        yield
    except ShadowbenchError:
        raise
    except Exception as error:
        if isinstance(error, OSError) or client.status != "running":
            raise ClusterError(
                f"the scheduler at {access.address} went away; what is finished is kept, and the same command goes on"
            ) from error
        raise


class Handing:
    """Hands out a plan and takes in its rows.

    Args:
        client: Connected to the scheduler.
        plan: The run's.
        store: Where rows go.
        record: The run's.
        observer: Told what happens.
        finished: What the run has already; kept up to date.
    """

    def __init__(
        self, client: Client, plan: Plan, store: Store, record: RunRecord, observer: Observer, finished: Finished
    ) -> None:
        from distributed import Queue

        from shadowbench.runner.cluster.comrades import Comrades

        self._client, self._plan, self._store, self._record = client, plan, store, record
        self._observer, self._finished = observer, finished
        self._comrades = Comrades(client, plan, observer)
        self._name = f"{record.run_id}-{secrets.token_hex(3)}"
        self._messages = Queue(f"shadowbench-{self._name}", client=client, maxsize=MOST_MESSAGES)
        self._numbers = itertools.count(1)
        self._waiting: deque[Batch] = deque()
        self._flights: dict[str, Flight] = {}
        self._jobs: dict[str, Job] = {}
        self._machines: set[str] = set()
        self._plugin_files = tuple(PluginFile(f.name, f.read_bytes()) for f in plan.options.plugin_files)

    def run(self) -> None:
        """Measure all that is left."""
        for cases in self._plan.comparisons:
            left = self._finished.left(cases)
            for case in [case for case in left if case.obstacle is not None]:
                assert case.obstacle is not None
                self._end(case, case.obstacle.outcome, case.obstacle.reason, case.obstacle.stderr_tail)
            measurable = [case for case in left if case.obstacle is None]
            if measurable:
                self._waiting.append(Batch(cases, measurable))
        try:
            while self._waiting or self._flights:
                self._comrades.look()
                self._hand_out()
                if not self._receive():
                    time.sleep(_POLL_S)
                self._take_back()
        finally:
            futures = [flight.future for flight in self._flights.values()]
            with suppress(Exception):  # the scheduler may be gone, and the jobs with it
                self._client.cancel(futures, force=True)
                self._messages.close()
        if len(self._machines) > 1:
            self._observer.note(f"measured on {len(self._machines)} kinds of machine: compare times within one only")

    def _hand_out(self) -> None:
        """Give every worker that has nothing to do the next job."""
        for comrade in list(self._comrades):
            if not self._waiting:
                return
            if comrade.name not in self._flights:
                self._give(comrade, self._waiting.popleft())
        if self._waiting and not self._flights and self._comrades.refused and not list(self._comrades):
            reasons = "; ".join(self._comrades.refused.values())
            raise ClusterError(f"no worker may measure this: {reasons}")

    def _give(self, comrade: Comrade, batch: Batch) -> None:
        from shadowbench.runner.cluster.serving import measure

        batch.cases = self._finished.left(batch.cases)  # a row may have come late
        if not batch.cases:
            return
        job = Job(
            name=f"{self._name}-{next(self._numbers)}",
            record=self._record,
            options=self._plan.options,
            cases=tuple(batch.cases),
            baseline=self._baseline(batch),
            budget_s=self._plan.budget_s(batch.comparison),
            plugin_files=self._plugin_files,
        )
        self._jobs[job.name] = job
        future = self._client.submit(
            measure,
            packed(job),
            comrade.code,
            self._messages.name,
            key=f"shadowbench-{job.name}",
            workers=[comrade.address],
            allow_other_workers=False,
            resources={RESOURCE: 1},
            retries=0,
            pure=False,
        )
        self._flights[comrade.name] = Flight(batch, job, comrade, future)

    def _baseline(self, batch: Batch) -> Case | None:
        """Return the comparison's first case, to be timed again beside these; not one that may be at work elsewhere."""
        baseline = self._finished.baseline(batch.comparison)
        if baseline in batch.cases:
            return baseline
        return self._finished.baseline(batch.comparison, must_be_ok=True)

    def _receive(self) -> bool:
        """Take in what the workers said; return whether there was anything."""
        messages: list[Message] = self._messages.get(batch=True)
        for message in messages:
            job = self._jobs.get(message["job"])
            if job is None:
                continue
            if message["kind"] == "note":
                self._observer.note(message["text"])
            elif message["kind"] == "row":
                self._keep(job.cases[message["index"]], message)
            else:
                case = job.cases[message["index"]]
                self._observer.case_started(case, message["text"])
                for flight in self._flights.values():
                    if flight.job is job:
                        flight.suspect = case if _runs_plugin(message["text"]) else None
        return bool(messages)

    def _keep(self, case: Case, message: Message) -> None:
        """Make a row durable, unless the case has one already."""
        if self._finished.outcome(case) is not None:
            return
        names = {}
        for name, content in message["pictures"].items():
            names[name] = self._store.put_artifact(content, name.rpartition(".")[2])
        row = ResultRow.model_validate_json(message["row"])
        artifacts = {picture: names[name] for picture, name in row.artifacts.items()}
        row = row.model_copy(update={"run_id": self._record.run_id, "artifacts": artifacts})
        self._machines.add(row.machine)
        self._add(case, row)

    def _end(self, case: Case, outcome: Outcome, reason: str, stderr_tail: str = "") -> None:
        """Keep the row of a case that no worker can give one."""
        self._add(case, ended_row(case, self._record, outcome, reason, stderr_tail))

    def _add(self, case: Case, row: ResultRow) -> None:
        self._store.add_row(row)
        self._finished.add(case, row.outcome)
        self._observer.row_finished(row)

    def _take_back(self) -> None:
        """See to jobs that ended, and to those whose worker is no longer there."""
        ended = [flight for flight in self._flights.values() if flight.future.done()]
        gone = [f for f in self._flights.values() if f not in ended and not self._comrades.has(f.comrade)]
        if not ended and not gone:
            return
        self._receive()  # a job's rows are in the queue before it ends
        for flight in [*ended, *gone]:
            del self._flights[flight.comrade.name]
            ending = _ending_of(flight.future) if flight in ended else None
            flight.future.cancel(force=True)
            self._settle(flight, ending)

    def _settle(self, flight: Flight, ending: Ending | None) -> None:
        """Decide about what a job left without a row.

        Args:
            flight: The job, no longer at work.
            ending: How it ended; ``None`` if its worker went away.
        """
        left = self._finished.left(flight.batch.cases)
        if ending is not None and ending.how in ("refused", "failed"):
            said = "refuses the work" if ending.how == "refused" else "fails"
            self._comrades.refuse(flight.comrade, f"{said}: {ending.reason}")
            self._waiting.appendleft(Batch(flight.batch.comparison, left, flight.batch.deaths))
            return
        if not left:
            return
        reason = "the worker went away" if ending is None else ending.reason or "its row was lost"
        self._observer.note(f"{flight.comrade}: {reason}; {len(left)} cases without a row are given out again")
        batch = Batch(flight.batch.comparison, left, flight.batch.deaths + 1)
        self._waiting.extendleft(reversed(self._after_death(batch, flight.suspect, reason, was_machine=ending is None)))

    def _after_death(self, batch: Batch, suspect: Case | None, reason: str, *, was_machine: bool) -> list[Batch]:
        """Return what to hand out instead of a batch over which a worker died.

        A machine may just have been switched off, so its cases are first tried again together. A measuring process
        most likely fell to the case it had at work, which goes on alone.
        """
        alone = len(batch.cases) == 1
        if batch.deaths < (2 if alone else 1) + was_machine:
            return [batch]
        if alone:
            (case,) = batch.cases
            text = f"its worker died {batch.deaths} times while it was measured alone; the last time {reason}"
            self._end(case, Outcome.CRASH, text)
            return []
        if suspect in batch.cases:
            parts = [[c for c in batch.cases if c != suspect], [c for c in batch.cases if c == suspect]]
        else:
            half = len(batch.cases) // 2
            parts = [batch.cases[:half], batch.cases[half:]]
        return [Batch(batch.comparison, part) for part in parts]


def _runs_plugin(phase: str) -> bool:
    """Return whether a phase runs one case's own code, so that it can be suspected."""
    return phase.startswith("round") or phase in ("load", "warm up", "filter the truth", "measure")


def _ending_of(future: Any) -> Ending | None:
    """Return how a dask task ended; ``None`` if its worker went away."""
    from distributed.scheduler import KilledWorker

    if future.status == "finished":
        try:
            return Ending.from_wire(future.result(timeout=RESULT_TIMEOUT_S))
        except (TimeoutError, CancelledError):
            return None  # it ended, and its worker went away before it could be asked how
    if future.status == "error":
        error = future.exception()
        return None if isinstance(error, KilledWorker) else Ending("failed", f"{type(error).__name__}: {error}")
    return None
