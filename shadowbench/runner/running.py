"""Running a plan: what is left of it, in order, every row durable before the next case ends.

A run can be killed at any moment. Running the same plan again goes on with the same run: cases that have a row keep
it, the others are measured. Another plan is another run, even if it has cases in common: times are compared within
rounds, so all of its cases are timed anew, but their quality is taken from the earlier rows
(:mod:`shadowbench.runner.reuse`). One run at a time works on a results folder.
"""

from __future__ import annotations

import datetime as dt
import fcntl
import json
import os
import secrets
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.errors import StoreError
from shadowbench.experiment import Experiment
from shadowbench.identity import code_version, environment, machine, plugin_origin
from shadowbench.rows import Outcome, RunRecord, RunStatus
from shadowbench.runner.bench import Bench
from shadowbench.runner.cache import Cache
from shadowbench.runner.cases import Case, Observer, Plan, SilentObserver
from shadowbench.runner.comparison import measure_comparison
from shadowbench.runner.pool import Pool, default_memory_limit
from shadowbench.runner.reuse import KnownQuality
from shadowbench.runner.row_making import now

if TYPE_CHECKING:
    from shadowbench.store import Store

DEFAULT_BUDGET_S = 30.0
CACHE_BYTES = 4 << 30
"""What the cache of worlds, receivers and references is cut back to after a run."""


def run(plan: Plan, store: Store, observer: Observer | None = None) -> RunRecord:
    """Measure what a plan has left to measure.

    Must be called from a thread that lives until it returns; the main thread, for Ctrl-C to work.

    Args:
        plan: Made on this machine with this code.
        store: The open store of the plan's results folder.
        observer: Told what happens.

    Returns:
        The run's record: *complete*, or *interrupted* by Ctrl-C with every finished row kept.

    Raises:
        StoreError: Another run is using the folder, or a row cannot be kept.
    """
    watching = SilentObserver() if observer is None else observer
    with _only_run_in(plan.options.results):
        earlier = None if plan.options.fresh else store.last_run(plan.plan_key)
        if earlier is not None and not earlier.status.is_resumable:
            watching.planned(plan, 0)
            watching.note(f"run {earlier.run_id} has a row for every case already; --fresh measures again")
            return earlier
        record = _new_record(plan) if earlier is None else earlier.model_copy(update={"status": RunStatus.RUNNING})
        store.start_run(record)
        try:
            _measure(plan, store, record, watching)
        except KeyboardInterrupt:
            return _finished(store, record, RunStatus.INTERRUPTED)
        except BaseException:
            store.finish_run(record.run_id, RunStatus.FAILED)
            raise
        Cache(plan.options.cache).prune(CACHE_BYTES)
        return _finished(store, record, RunStatus.COMPLETE)


def _finished(store: Store, record: RunRecord, status: RunStatus) -> RunRecord:
    end = now()
    store.finish_run(record.run_id, status, end)
    return record.model_copy(update={"status": status, "finished_at": end})


def _new_record(plan: Plan) -> RunRecord:
    stamp = dt.datetime.now(dt.UTC).strftime("%Y%m%d-%H%M%S")
    return RunRecord(
        run_id=f"{stamp}-{secrets.token_hex(2)}",
        plan_key=plan.plan_key,
        experiments=[experiment.name for experiment in plan.experiments],
        definitions=[_definition(experiment, plan) for experiment in plan.experiments],
        method_defaults=plan.method_defaults,
        argv=list(plan.options.argv),
        created_at=now(),
        machine=machine(),
        environment=_environment(plan),
        code_version=code_version(),
        case_count=len(plan.cases),
    )


def _environment(plan: Plan) -> dict[str, Any]:
    """Return what a run's results and times depend on beside its code version."""
    plugins = {file.name: plugin_origin(file) for file in plan.options.plugin_files}
    found = environment() | {"warp": plan.warp, "plugins": plugins}
    return {name: value for name, value in found.items() if value not in ({}, [], None)}


def _definition(experiment: Experiment, plan: Plan) -> dict[str, Any]:
    """Return an experiment as JSON, so that a run's tables need no file."""
    case_count = sum(case.experiment == experiment.name for case in plan.cases)
    definition: dict[str, Any] = json.loads(json.dumps(asdict(experiment)))
    return definition | {"case_count": case_count}


def _measure(plan: Plan, store: Store, record: RunRecord, observer: Observer) -> None:
    finished = {(row.experiment, row.case_key): row.outcome for row in store.rows(record.run_id)}
    remaining = [case for case in plan.cases if (case.experiment, case.case_key) not in finished]
    observer.planned(plan, len(remaining))
    if finished:
        observer.note(f"going on with run {record.run_id}")
    budgets = {experiment.name: experiment.budget_s or DEFAULT_BUDGET_S for experiment in plan.experiments}
    options = plan.options
    with (
        tempfile.TemporaryDirectory(prefix="shadowbench-") as pictures,  # outlives the workers that write to it
        Pool(options.plugin_files, options.memory_limit_bytes or default_memory_limit()) as pool,
    ):
        known = KnownQuality(store, only_run=record.run_id if options.fresh else None)
        bench = Bench(pool, options, record, store, observer, Path(pictures), known)
        for cases in plan.comparisons:
            left = [case for case in cases if (case.experiment, case.case_key) not in finished]
            if left:
                budget_s = options.budget_s or budgets[cases[0].experiment]
                measure_comparison(bench, left, _baseline(cases, finished), budget_s)


def _baseline(cases: Sequence[Case], finished: Mapping[tuple[str, str], Outcome]) -> Case | None:
    """Return the first case of a comparison that was or may yet be measured well."""
    for case in cases:
        if case.obstacle is None and finished.get((case.experiment, case.case_key), Outcome.OK) is Outcome.OK:
            return case
    return None


@contextmanager
def _only_run_in(folder: Path) -> Iterator[None]:
    """Hold the folder's lock; the system lets go of it when the process ends, however it ends.

    Raises:
        StoreError: Another process holds it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "run.lock").open("a+", encoding="ascii") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            stream.seek(0)
            holder = stream.read().strip() or "unknown"
            raise StoreError(
                f"{folder}: another run (process {holder}) is at work here; wait for it, or name another folder "
                "with --results"
            ) from None
        stream.truncate(0)
        stream.write(str(os.getpid()))
        stream.flush()
        yield
