"""Who gets which cases, and what becomes of them when a worker dies: the client's bookkeeping, without any process."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from small_runs import Recorder
from stored_rows import some_run

from shadowbench import experiment
from shadowbench.errors import ClusterError
from shadowbench.rows import Outcome
from shadowbench.runner.cases import Case, Obstacle, Plan, RunOptions, View
from shadowbench.runner.cluster.comrades import Comrade
from shadowbench.runner.cluster.handing import Handing
from shadowbench.runner.cluster.jobs import Ending, Job, unpacked
from shadowbench.runner.finished import Finished
from shadowbench.runner.row_making import ended_row
from shadowbench.store import Store

Behaviour = Callable[[str, Job], Iterator[Any]]
"""What a worker does with a job: yields messages, and at last its :class:`Ending`, or ``None`` if it goes away."""


@dataclass
class Future:
    """A dask task that has ended as soon as it was handed out, but for one whose worker went away."""

    ending: Ending | None
    cancelled: bool = False
    status: str = "finished"
    is_lost: bool = False

    def done(self) -> bool:
        return self.ending is not None

    def result(self, *, timeout: float) -> dict[str, str]:
        assert timeout > 0.0
        if self.is_lost:
            raise TimeoutError
        assert self.ending is not None
        return self.ending.to_wire()

    def cancel(self, *, force: bool) -> None:
        self.cancelled = True


@dataclass
class Imagined:
    """A cluster whose workers do as they are told by a function."""

    behaviour: Behaviour
    joining: list[list[str]]
    status: str = "running"
    present: dict[str, Comrade] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    jobs: list[tuple[str, Job]] = field(default_factory=list)
    mail: list[Any] = field(default_factory=list)
    in_flight: int = 0
    most_in_flight: int = 0
    deferred: list[tuple[str, Job, Future]] = field(default_factory=list)

    # the dask client
    def submit(self, function: Any, content: bytes, *arguments: Any, workers: list[str], **options: Any) -> Future:
        assert options["retries"] == 0
        assert not options["allow_other_workers"]
        (name,) = workers
        job = unpacked(content)
        self.jobs.append((name, job))
        self.in_flight += 1
        self.most_in_flight = max(self.in_flight, self.most_in_flight)
        future = Future(None)
        self.deferred.append((name, job, future))
        return future

    def cancel(self, futures: list[Future], *, force: bool) -> None:
        for future in futures:
            future.cancel(force=force)

    # the queue
    name = "mail"

    def get(self, *, batch: bool) -> list[Any]:
        assert batch
        taken, self.mail = self.mail, []
        return taken

    def close(self) -> None:
        pass

    # the comrades
    def look(self) -> None:
        deferred, self.deferred = self.deferred, []
        for name, job, future in deferred:
            self.in_flight -= 1
            for said in self.behaviour(name, job):
                if said is None:
                    self.present.pop(name)
                    future.is_lost = True
                elif isinstance(said, Ending):
                    future.ending = said
                else:
                    self.mail.append(said)
        for name in self.joining.pop(0) if self.joining else []:
            self.present[name] = Comrade(name, name, "machine", "host", "code")

    def __iter__(self) -> Iterator[Comrade]:
        return iter(self.present.values())

    def has(self, comrade: Comrade) -> bool:
        return comrade.name in self.present

    def refuse(self, comrade: Comrade, reason: str) -> None:
        self.present.pop(comrade.name)
        self.refused[comrade.name] = f"{comrade.name} {reason}"


def case(number: int, comparison: int = 0, obstacle: Obstacle | None = None) -> Case:
    view = View(f"scene {comparison}", {}, "key", "content", 2, "sun", "above", 8, 8)
    return Case(
        "ad-hoc", comparison, view, "m", "M", {"n": number}, True, "cpu", 1, f"q{comparison}-{number}",
        f"c{comparison}-{number}", obstacle=obstacle,
    )  # fmt: skip


def row_of(job: Job, index: int, **changes: Any) -> dict[str, Any]:
    row = ended_row(job.cases[index], job.record, Outcome.OK, "").model_copy(update=changes)
    return {"kind": "row", "job": job.name, "index": index, "row": row.model_dump_json(), "pictures": {}}


def phase_of(job: Job, index: int, text: str) -> dict[str, Any]:
    return {"kind": "phase", "job": job.name, "index": index, "text": text}


def good(name: str, job: Job) -> Iterator[Any]:
    yield from (row_of(job, index, machine=name) for index in range(len(job.cases)))
    yield Ending("done")


def dies_over(number: int, *, ending: Ending | None) -> Behaviour:
    """A worker that measures up to one case, which kills it."""

    def behave(name: str, job: Job) -> Iterator[Any]:
        numbers = [c.method_parameters["n"] for c in job.cases]
        if number not in numbers:
            yield from good(name, job)
        else:
            yield phase_of(job, numbers.index(number), "warm up")
            yield ending

    return behave


@dataclass
class Handed:
    cluster: Imagined
    seen: Recorder
    outcomes: dict[tuple[str, int], Outcome]
    reasons: dict[int, str]


@pytest.fixture
def hand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Handed]:
    monkeypatch.setattr("shadowbench.runner.cluster.handing._POLL_S", 0.0)

    def carry_out(
        behaviour: Behaviour, *comparisons: list[Case], joining: list[list[str]], finished: tuple[Case, ...] = ()
    ) -> Handed:
        cluster = Imagined(behaviour, joining)
        monkeypatch.setattr("distributed.Queue", lambda *_, **__: cluster)
        monkeypatch.setattr("shadowbench.runner.cluster.comrades.Comrades", lambda *_: cluster)
        plan = Plan(
            (experiment.from_options(methods=["m"]),), RunOptions(tmp_path), tuple(map(tuple, comparisons)), "plan"
        )
        record, seen = some_run(), Recorder()
        with Store.open(tmp_path) as store:
            store.start_run(record)
            for done in finished:
                row = ended_row(done, record, Outcome.OK, "")
                store.add_row(row.model_copy(update={"case_key": "another machine's", "quality_key": "of a peer"}))
            known = Finished(plan, store.rows(record.run_id))
            Handing(cluster, plan, store, record, seen, known).run()  # type: ignore[arg-type]
            rows = store.rows(record.run_id)
        outcomes = {(row.scene, row.method_parameters["n"]): row.outcome for row in rows}
        assert len(outcomes) == len(rows)
        return Handed(cluster, seen, outcomes, {row.method_parameters["n"]: row.reason for row in rows})

    return carry_out


def test_one_job_a_worker_is_in_flight_however_long_the_sweep(hand: Callable[..., Handed]) -> None:
    comparisons = [[case(0, c), case(1, c)] for c in range(40)]
    handed = hand(good, *comparisons, joining=[["a", "b"]])
    assert handed.cluster.most_in_flight == 2
    assert len(handed.cluster.jobs) == 40
    assert set(handed.outcomes.values()) == {Outcome.OK}
    assert len(handed.outcomes) == 80


def test_a_worker_that_joins_late_gets_the_next_job(hand: Callable[..., Handed]) -> None:
    handed = hand(good, *([case(0, c)] for c in range(6)), joining=[["a"], [], ["late"]])
    assert "late" in {name for name, _ in handed.cluster.jobs}
    assert len(handed.outcomes) == 6


def test_a_case_that_has_its_row_from_any_machine_is_not_measured_again(hand: Callable[..., Handed]) -> None:
    comparison = [case(n) for n in range(3)]
    handed = hand(good, comparison, joining=[["a"]], finished=(comparison[0],))
    ((_, job),) = handed.cluster.jobs
    assert [c.method_parameters["n"] for c in job.cases] == [1, 2]
    assert job.baseline == comparison[0], "timed again beside the others"
    assert len(handed.seen.rows) == 2


def test_what_cannot_be_measured_ends_without_a_worker(hand: Callable[..., Handed]) -> None:
    skipped = case(0, obstacle=Obstacle(Outcome.SKIPPED, "not here"))
    handed = hand(good, [skipped], joining=[])
    assert handed.outcomes == {("scene 0", 0): Outcome.SKIPPED}
    assert handed.cluster.jobs == []


def test_a_machine_that_dies_costs_a_second_try_of_what_had_no_row(hand: Callable[..., Handed]) -> None:
    def behave(name: str, job: Job) -> Iterator[Any]:
        if name != "doomed":
            yield from good(name, job)
            return
        yield row_of(job, 0)
        yield None

    handed = hand(behave, [case(n) for n in range(3)], joining=[["doomed"], [], [], ["next"]])
    assert [[c.method_parameters["n"] for c in job.cases] for _, job in handed.cluster.jobs] == [[0, 1, 2], [1, 2]]
    assert set(handed.outcomes.values()) == {Outcome.OK}


def test_a_worker_that_goes_away_before_it_can_say_how_its_job_ended_is_no_reason_to_wait(
    hand: Callable[..., Handed],
) -> None:
    def behave(name: str, job: Job) -> Iterator[Any]:
        if name != "doomed":
            yield from good(name, job)
            return
        yield row_of(job, 0)
        yield Ending("done")
        yield None

    handed = hand(behave, [case(n) for n in range(2)], joining=[["doomed"], [], [], ["next"]])
    assert set(handed.outcomes.values()) == {Outcome.OK}
    assert [[c.method_parameters["n"] for c in job.cases] for _, job in handed.cluster.jobs] == [[0, 1], [1]]


@pytest.mark.parametrize("ending", [Ending("died", "the measuring process was ended by SIGKILL"), None])
def test_a_case_that_always_kills_its_worker_ends_as_crash_and_takes_no_other_with_it(
    hand: Callable[..., Handed], ending: Ending | None
) -> None:
    killer = dies_over(5, ending=ending)
    handed = hand(killer, [case(n) for n in range(12)], [case(0, 1)], joining=[["a"], *[[f"b{n}"] for n in range(30)]])
    assert [key for key, outcome in handed.outcomes.items() if outcome is not Outcome.OK] == [("scene 0", 5)]
    assert handed.outcomes["scene 0", 5] is Outcome.CRASH
    assert "times while it was measured alone" in handed.reasons[5]
    others = [job for _, job in handed.cluster.jobs if {c.method_parameters["n"] for c in job.cases} & {0, 11}]
    assert max(len(job.cases) for job in others[1:]) == 11 + (ending is None), "the others stay together"


def test_a_killer_that_nobody_suspects_is_found_by_halves(hand: Callable[..., Handed]) -> None:
    def behave(name: str, job: Job) -> Iterator[Any]:
        yield phase_of(job, 0, "compile")
        if any(c.method_parameters["n"] == 5 for c in job.cases):
            yield Ending("died", "the measuring process was ended by SIGKILL")
        else:
            yield from good(name, job)

    handed = hand(behave, [case(n) for n in range(16)], joining=[["a"]])
    assert [n for (_, n), outcome in handed.outcomes.items() if outcome is Outcome.CRASH] == [5]
    assert len(handed.cluster.jobs) <= 2 * 4 + 2


def test_a_row_that_comes_twice_is_kept_once(hand: Callable[..., Handed]) -> None:
    def behave(name: str, job: Job) -> Iterator[Any]:
        yield row_of(job, 0, machine="first")
        yield row_of(job, 0, machine="second", case_key="other")
        yield Ending("done")

    handed = hand(behave, [case(0)], joining=[["a"]])
    (row,) = handed.seen.rows
    assert row.machine == "first"


def test_a_row_that_gets_lost_is_measured_again(hand: Callable[..., Handed]) -> None:
    calls: list[str] = []

    def behave(name: str, job: Job) -> Iterator[Any]:
        calls.append(job.name)
        if len(calls) > 1:
            yield row_of(job, 0)
        yield Ending("done")

    assert hand(behave, [case(0)], joining=[["a"]]).outcomes == {("scene 0", 0): Outcome.OK}


def test_a_worker_that_refuses_gets_nothing_more_and_another_measures(hand: Callable[..., Handed]) -> None:
    def behave(name: str, job: Job) -> Iterator[Any]:
        if name == "stranger":
            yield Ending("refused", "method 'm' is not what the plan was made with")
        else:
            yield from good(name, job)

    handed = hand(behave, [case(0)], [case(0, 1)], joining=[["stranger", "friend"]])
    assert [name for name, _ in handed.cluster.jobs].count("stranger") == 1
    assert set(handed.outcomes.values()) == {Outcome.OK}


def test_a_run_that_every_worker_refuses_ends_with_the_reason(hand: Callable[..., Handed]) -> None:
    def behave(name: str, job: Job) -> Iterator[Any]:
        yield Ending("refused", "method 'm' is not what the plan was made with")

    with pytest.raises(ClusterError, match=r"no worker may measure this: a refuses the work: method 'm' is not what"):
        hand(behave, [case(0)], joining=[["a"]])


def test_rows_from_several_machines_are_noted(hand: Callable[..., Handed]) -> None:
    handed = hand(good, [case(0)], [case(0, 1)], joining=[["a", "b"]])
    assert handed.seen.notes[-1] == "measured on 2 kinds of machine: compare times within one only"
