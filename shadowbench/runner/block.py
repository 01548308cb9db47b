"""Cases parked side by side, one worker each, and timed in interleaved rounds.

While rounds go on one worker is at work and the others wait, so that nothing but the machine itself disturbs a
measurement. A case that fails leaves with its row, and the rest go on.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

from shadowbench.identity import available_cores, key_of
from shadowbench.rows import Outcome
from shadowbench.runner.bench import OWN_WORK_TIMEOUT_S, Bench
from shadowbench.runner.cases import Case, Obstacle
from shadowbench.runner.pool import Worker
from shadowbench.runner.protocol import CaseFailure
from shadowbench.runner.rounds import interval_of, order_of
from shadowbench.runner.row_making import Timing, measured_row

MOST_PARKED = 16
"""Workers side by side: a large sweep reuses this many instead of starting one for each of its cases."""

_LEAST_WORKER_BYTES = 400 << 20
_SPARE_MEMORY = 0.8
"""Share of the free memory that the next worker may be expected to need."""


@dataclass(eq=False)
class Member:
    """A case in its worker.

    Attributes:
        case: The case.
        worker: Where it is loaded.
        compile_ms: What its kernels took.
        is_repeat: It has its row, and is timed again as the comparison's baseline.
        timing: Its rounds so far.
    """

    case: Case
    worker: Worker
    compile_ms: float
    is_repeat: bool
    timing: Timing = field(default_factory=Timing)

    def add_round(self, answer: dict[str, Any]) -> None:
        self.timing.build.append(answer["build"])
        self.timing.shade.append(answer["shade"])
        self.timing.stages.append(answer["stages"])

    @property
    def is_tight(self) -> bool:
        return self.timing.is_tight


@dataclass(eq=False)
class CameraMember:
    """The camera pass in its worker."""

    worker: Worker
    durations: list[float] = field(default_factory=list)

    def add_round(self, answer: dict[str, Any]) -> None:
        self.durations.append(answer["camera"])

    @property
    def is_tight(self) -> bool:
        return interval_of(self.durations).is_tight


class Block:
    """Cases of one comparison that are timed in the same rounds, with the camera pass of their view.

    Args:
        bench: The run's tools.
        entries: Names of the view's world, receivers and reference in the cache.
        case: Any of the comparison.
    """

    def __init__(self, bench: Bench, entries: dict[str, str], case: Case) -> None:
        self._bench, self._entries = bench, entries
        self._name = f"{bench.run.run_id}-{case.comparison}-{secrets.token_hex(3)}"
        self._members: list[Member] = []
        self._camera = self._load_camera(case)

    def has_room(self) -> bool:
        """Return whether another worker fits beside those that are parked; two always must, to be compared."""
        if len(self._members) < 2:
            return True
        largest = max(_LEAST_WORKER_BYTES, *(member.worker.resident_size() for member in self._members))
        return len(self._members) < MOST_PARKED and largest < _SPARE_MEMORY * psutil.virtual_memory().available

    def load(self, case: Case, *, is_repeat: bool = False) -> None:
        """Bring a case to the start of its rounds; one that fails or is skipped ends here."""
        bench = self._bench
        worker = bench.pool.take(case.threads)
        arguments = {
            "cache": bench.cache,
            "entries": self._entries,
            "light": case.view.light,
            "camera": case.view.camera,
            "moving": case.view.moving,
            "method": case.method,
            "parameters": case.method_parameters,
            "device": case.device,
            "threads": case.threads,
        }
        try:
            bench.observer.case_started(case, "load")
            loaded = worker.ask("load_case", arguments, bench.options.timeout_s)
            if "skipped" in loaded:
                bench.park(worker)
                bench.end(case, Obstacle(Outcome.SKIPPED, loaded["skipped"]))
                return
            bench.observer.case_started(case, "warm up")
            worker.ask("warm_up", {}, bench.options.timeout_s)
        except CaseFailure as failure:
            self._fail(case, worker, failure, is_repeat=is_repeat)
            return
        # what compiled a module first took longest; later workers find it in Warp's cache
        bench.kernel_ms = loaded["kernels"] | bench.kernel_ms
        compile_ms = sum(bench.kernel_ms[name] for name in loaded["kernels"])
        self._members.append(Member(case, worker, compile_ms, is_repeat))

    def time(self, budget_s: float) -> None:
        """Time rounds until every interval is tight or the budget does not hold another round."""
        options = self._bench.options
        begin, rounds = time.monotonic(), 0
        while self._members and rounds < options.max_rounds:
            for timed in order_of(self._everyone(), rounds):
                self._time_once(timed, rounds)
            rounds += 1
            if (time.monotonic() - begin) * (rounds + 1) / rounds > budget_s:
                return
            if rounds >= options.min_rounds and all(member.is_tight for member in self._everyone()):
                return

    def finish(self) -> None:
        """Measure what is left, on all cores since nothing is timed any more, keep the rows and park the workers."""
        ahead = available_cores()
        filtered = self._filter_reference()
        new = [member for member in self._members if not member.is_repeat]
        for index, member in enumerate(new):
            for upcoming in new[index : index + ahead]:
                if not upcoming.worker.is_busy:
                    arguments = {"pictures": str(self._bench.pictures), "filtered": filtered[upcoming]}
                    upcoming.worker.begin("measure", arguments)
            self._finish_one(member)
        for parked in self._everyone():
            self._bench.park(parked.worker)

    def _filter_reference(self) -> dict[Member, str | None]:
        """Have the view's reference filtered, once for each different kernel.

        Returns:
            The name of the cache's entry for each case that needs a row; ``None`` for a hard test, or where the
            reference cannot be made. A case that cannot tell its kernel ends here.
        """
        bench, found = self._bench, dict[Member, str | None]()
        entry_of: dict[str, str | None] = {}
        for member in [member for member in self._members if not member.is_repeat]:
            bench.observer.case_started(member.case, "filter the truth")
            try:
                kernel = member.worker.ask("kernel", {}, bench.options.timeout_s)
            except CaseFailure as failure:
                self._members.remove(member)
                self._fail(member.case, member.worker, failure, is_repeat=False)
                continue
            found[member] = None
            if kernel is not None:
                key = key_of(kernel)
                if key not in entry_of:
                    entry_of[key] = self._filtered_entry(member.case, kernel)
                found[member] = entry_of[key]
        return found

    def _filtered_entry(self, case: Case, kernel: dict[str, Any]) -> str | None:
        """Return the name of a filtered reference in the cache, or ``None`` if it cannot be made."""
        bench, cores = self._bench, available_cores()
        worker = bench.pool.take(cores)
        arguments = {
            "cache": bench.cache,
            "entries": self._entries,
            "light": case.view.light,
            "kernel": kernel,
            "threads": cores,
        }
        try:
            entry: str = worker.ask("prepare_filtered", arguments, OWN_WORK_TIMEOUT_S)
        except CaseFailure as failure:
            worker.kill()
            bench.observer.note(f"{case.view}: the reference cannot be filtered: {failure.reason}")
            return None
        bench.park(worker)
        return entry

    def _everyone(self) -> Sequence[Member | CameraMember]:
        return [*self._members, *([] if self._camera is None else [self._camera])]

    def _time_once(self, member: Member | CameraMember, round_number: int) -> None:
        if isinstance(member, Member):
            self._bench.observer.case_started(member.case, f"round {round_number + 1}")
        try:
            member.add_round(member.worker.ask("round", {}, self._bench.options.timeout_s))
        except CaseFailure as failure:
            if isinstance(member, Member):
                self._members.remove(member)
                self._fail(member.case, member.worker, failure, is_repeat=member.is_repeat)
            else:
                self._camera = None
                member.worker.kill()

    def _load_camera(self, case: Case) -> CameraMember | None:
        view, worker = case.view, self._bench.pool.take(case.threads)
        arguments = {
            "cache": self._bench.cache,
            "entries": self._entries,
            "camera": view.camera,
            "width": view.width,
            "height": view.height,
            "pixel_samples": view.pixel_samples,
            "layers": view.layers,
            "device": case.device,
            "threads": case.threads,
        }
        try:
            worker.ask("load_camera", arguments, OWN_WORK_TIMEOUT_S)
            worker.ask("warm_up", {}, OWN_WORK_TIMEOUT_S)
        except CaseFailure as failure:
            worker.kill()
            self._bench.observer.note(f"{view}: the camera pass cannot be timed: {failure.reason}")
            return None
        return CameraMember(worker)

    def _finish_one(self, member: Member) -> None:
        bench, case = self._bench, member.case
        bench.observer.case_started(case, "measure")
        try:
            measured = member.worker.end(bench.options.timeout_s)
        except CaseFailure as failure:
            self._fail(case, member.worker, failure, is_repeat=False)
            return
        baseline = next((other.timing for other in self._members if other.is_repeat), None)
        artifacts = {name: bench.keep_picture(Path(file)) for name, file in measured["pictures"].items()}
        bench.keep(
            measured_row(
                case,
                bench.run,
                comparison=self._name,
                compile_ms=member.compile_ms,
                timing=member.timing,
                camera=self._camera.durations if self._camera is not None else (),
                baseline=baseline,
                measured=measured,
                artifacts=artifacts,
            )
        )

    def _fail(self, case: Case, worker: Worker, failure: CaseFailure, *, is_repeat: bool) -> None:
        worker.kill()  # nobody knows what the plugin left behind in it
        if is_repeat:
            self._bench.failed.add(case.case_key)
            self._bench.observer.note(f"{case.method} cannot be timed again as the baseline: {failure.reason}")
        else:
            self._bench.end(case, failure)
