"""Cases parked side by side, one worker each, and timed in interleaved rounds.

While rounds go on one worker is at work and the others wait, so that nothing but the machine itself disturbs a
measurement. Where time allows, the rounds go on in fresh workers, in which each case is loaded again and must give
the same bits. A case that fails leaves with its row, and the rest go on.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Mapping, Sequence
from typing import Any

import psutil

from shadowbench.machine_state import Watch, Watched, load_average
from shadowbench.rows import Outcome, ResultRow
from shadowbench.runner.bench import OWN_WORK_TIMEOUT_S, Bench
from shadowbench.runner.cases import Case, Obstacle
from shadowbench.runner.finishing import Finish, Given
from shadowbench.runner.members import CameraMember, Member
from shadowbench.runner.pool import Worker
from shadowbench.runner.protocol import CaseFailure
from shadowbench.runner.rounds import EndedBy, Pace, Step, order_of

MOST_PARKED = 16
"""Workers side by side: a large sweep reuses this many instead of starting one for each of its cases."""

_STARTING_AHEAD = 2
"""Workers that start while one loads its case."""

_LEAST_WORKER_BYTES = 400 << 20
_SPARE_MEMORY = 0.8
"""Share of the free memory that the next worker may be expected to need."""

_START_S = 0.5
"""What a fresh worker takes at least to start [s]."""


class Block:
    """Cases of one comparison that are timed in the same rounds, with the camera pass of their view.

    Args:
        bench: The run's tools.
        entries: Names of the view's world and receivers in the cache, and of its reference if it is there already.
        case: Any of the comparison.
        known: Quality key -> an earlier row with that quality.
    """

    def __init__(
        self, bench: Bench, entries: dict[str, str], case: Case, known: Mapping[str, ResultRow] | None = None
    ) -> None:
        self._bench, self._entries, self._known = bench, entries, known or {}
        self._name = f"{bench.run.run_id}-{case.comparison}-{secrets.token_hex(3)}"
        self._members: list[Member] = []
        self._case = case
        self._begin = time.monotonic()
        self._camera: CameraMember | None = CameraMember(bench.pool.take(case.threads))
        self._load_camera(self._camera)
        self._pace: Pace | None = None
        self._seen = Watched()
        self._load_before = self._load_after = load_average()

    def has_room(self) -> bool:
        """Return whether another worker fits beside those that are parked; two always must, to be compared."""
        if len(self._members) < 2:
            return True
        largest = max(_LEAST_WORKER_BYTES, *(member.worker.resident_size() for member in self._members))
        return len(self._members) < MOST_PARKED and largest < _SPARE_MEMORY * psutil.virtual_memory().available

    def load(self, case: Case, *, is_repeat: bool = False) -> None:
        """Bring a case to the start of its rounds; one that fails or is skipped ends here."""
        bench = self._bench
        member = Member(case, bench.pool.take(case.threads), 0.0, is_repeat)
        try:
            loaded = self._ask_to_load(member)
            if "skipped" in loaded:
                bench.park(member.worker)
                bench.end(case, Obstacle(Outcome.SKIPPED, loaded["skipped"]))
                return
            self._warm_up(member)
        except CaseFailure as failure:
            self._fail(case, member.worker, failure, is_repeat=is_repeat)
            return
        # what compiled a module first took longest; later workers find it in Warp's cache
        bench.kernel_ms = loaded["kernels"] | bench.kernel_ms
        member.compile_ms = sum(bench.kernel_ms[name] for name in loaded["kernels"])
        self._members.append(member)

    def time(self, budget_s: float, loading_budget_s: float) -> None:
        """Time rounds until every interval is tight or the budget does not hold another round.

        Args:
            budget_s: For the rounds [s].
            loading_budget_s: For loading the cases again, in fresh workers [s].
        """
        options = self._bench.options
        self._pace = pace = Pace(
            budget_s=budget_s,
            loading_budget_s=loading_budget_s,
            loading_s=max(time.monotonic() - self._begin, _START_S * len(self._members)),
            min_rounds=options.min_rounds,
            max_rounds=options.max_rounds,
            most_processes=options.processes,
        )
        step, watch = Step.ROUND, self._watch()
        while self._members and step is not Step.END:
            if step is Step.RENEW:
                self._seen += watch.end()
                self._renew()
                watch = self._watch()
            begin = time.monotonic()
            for timed in order_of(self._everyone(), pace.rounds):
                self._time_once(timed, pace)
            step = pace.after_round(time.monotonic() - begin, lambda: all(m.is_tight for m in self._everyone()))
        self._seen += watch.end()
        self._load_after = load_average()

    def _watch(self) -> Watch:
        return Watch(timed.worker.process_id for timed in self._everyone())

    def _renew(self) -> None:
        """Load every case again in a fresh worker."""
        for member in list(self._members):
            try:
                self._note_peak(member)
            except CaseFailure as failure:
                self._leave(member, failure)
        for old in self._everyone():
            old.worker.kill()
        renewed = list(self._everyone())
        for position, old in enumerate(renewed):
            for upcoming in renewed[position : position + 1 + _STARTING_AHEAD]:
                if not upcoming.worker.is_alive:
                    upcoming.worker = self._bench.pool.take_fresh(upcoming.worker.threads)
            if isinstance(old, CameraMember):
                self._load_camera(old)
                continue
            try:
                self._ask_to_load(old)
                self._warm_up(old)
            except CaseFailure as failure:
                self._leave(old, failure)

    def _note_peak(self, member: Member) -> None:
        peak = member.worker.ask("peak_bytes", {}, self._bench.options.timeout_s)
        member.peak_rss_bytes = max(member.peak_rss_bytes, peak)

    def _ask_to_load(self, member: Member) -> dict[str, Any]:
        case, bench = member.case, self._bench
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
        bench.observer.case_started(case, "load")
        loaded: dict[str, Any] = member.worker.ask("load_case", arguments, bench.options.timeout_s)
        return loaded

    def _warm_up(self, member: Member) -> None:
        self._bench.observer.case_started(member.case, "warm up")
        arguments = {"repeats": member.repeats or None}
        member.add_warm_up(member.worker.ask("warm_up", arguments, self._bench.options.timeout_s))

    def finish(self) -> None:
        """Measure what is left, keep the rows and park the workers."""
        given = Given(
            name=self._name,
            members=self._members,
            camera=self._camera.durations if self._camera is not None else (),
            seen=self._seen,
            load_before=self._load_before,
            load_after=self._load_after,
            ended_by=self._pace.ended_by if self._pace is not None else EndedBy.BUDGET,
        )
        Finish(self._bench, self._entries, self._known, given, self._leave).run()
        for parked in self._everyone():
            self._bench.park(parked.worker)

    def _everyone(self) -> Sequence[Member | CameraMember]:
        return [*self._members, *([] if self._camera is None else [self._camera])]

    def _time_once(self, member: Member | CameraMember, pace: Pace) -> None:
        if isinstance(member, Member):
            self._bench.observer.case_started(member.case, f"round {pace.rounds + 1}")
        try:
            member.add_round(member.worker.ask("round", {}, self._bench.options.timeout_s), pace.process)
        except CaseFailure as failure:
            if isinstance(member, Member):
                self._leave(member, failure)
            else:
                self._camera = None
                member.worker.kill()

    def _load_camera(self, member: CameraMember) -> None:
        """Bring the camera pass to the start of its rounds; where it cannot be, there is none."""
        view, case = self._case.view, self._case
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
            member.worker.ask("load_camera", arguments, OWN_WORK_TIMEOUT_S)
            member.repeats = member.worker.ask("warm_up", {"repeats": member.repeats}, OWN_WORK_TIMEOUT_S)["repeats"]
        except CaseFailure as failure:
            member.worker.kill()
            self._camera = None
            self._bench.observer.note(f"{view}: the camera pass cannot be timed: {failure.reason}")

    def _leave(self, member: Member, failure: CaseFailure) -> None:
        self._members.remove(member)
        self._fail(member.case, member.worker, failure, is_repeat=member.is_repeat)

    def _fail(self, case: Case, worker: Worker, failure: CaseFailure, *, is_repeat: bool) -> None:
        worker.kill()  # nobody knows what the plugin left behind in it
        if is_repeat:
            self._bench.failed.add(case.case_key)
            self._bench.observer.note(f"{case.method} cannot be timed again as the baseline: {failure.reason}")
        else:
            self._bench.end(case, failure)
