"""From timed cases to rows: quality taken over or measured anew, on all cores, since nothing is timed any more."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from shadowbench.identity import available_cores, key_of
from shadowbench.machine_state import Watched, warnings_of
from shadowbench.rows import ResultRow
from shadowbench.runner.bench import Bench
from shadowbench.runner.cases import Case
from shadowbench.runner.members import Member
from shadowbench.runner.protocol import CaseFailure
from shadowbench.runner.reuse import difference, reused
from shadowbench.runner.rounds import EndedBy
from shadowbench.runner.row_making import measured_row


@dataclass(frozen=True, eq=False)
class Given:
    """What the rounds of a block gave.

    Attributes:
        name: What its cases have in common in their rows.
        members: Those that are left; the first is the baseline.
        camera: The camera pass's durations by round; empty if it could not be timed.
        seen: What else the machine did meanwhile.
        load_before, load_after: Its load average.
        ended_by: What ended the rounds.
    """

    name: str
    members: list[Member]
    camera: Sequence[float]
    seen: Watched
    load_before: list[float]
    load_after: list[float]
    ended_by: EndedBy


class Finish:
    """Gives each case of a timed block its row.

    Args:
        bench: The run's tools.
        entries: Names of the view's world and receivers in the cache, and of its reference if it is there already.
        known: Quality key -> an earlier row with that quality.
        given: What the rounds gave.
        leave: Told of a case that fails, which it takes out of ``given.members``.
    """

    def __init__(
        self,
        bench: Bench,
        entries: dict[str, str],
        known: Mapping[str, ResultRow],
        given: Given,
        leave: Callable[[Member, CaseFailure], None],
    ) -> None:
        self._bench, self._entries, self._known, self._given, self._leave = bench, entries, known, given, leave

    def run(self) -> None:
        """Measure what is not known, and keep all rows."""
        ahead = available_cores()
        unknown = [member for member in list(self._given.members) if not member.is_repeat and not self._reuse(member)]
        filtered = self._filter_reference(self._make_reference(unknown))
        new = list(filtered)
        for index, member in enumerate(new):
            for upcoming in new[index : index + ahead]:
                if not upcoming.worker.is_busy:
                    arguments = {
                        "pictures": str(self._bench.pictures),
                        "reference": self._entries["reference"],
                        "filtered": filtered[upcoming],
                    }
                    upcoming.worker.begin("measure", arguments)
            self._measure(member)

    def _reuse(self, member: Member) -> bool:
        """Keep a case's row with the quality of an earlier one, if there is such and the case gives the same bits."""
        bench, case = self._bench, member.case
        known = self._known.get(case.quality_key)
        if known is None:
            return False
        try:
            seen = member.worker.ask("summary", {}, bench.options.timeout_s)
        except CaseFailure as failure:
            self._leave(member, failure)
            return True
        found, is_wrong = difference(known, seen, machine=bench.run.machine, deterministic=case.deterministic)
        if is_wrong:
            bench.observer.note(f"{case.method} on {case.view}: {found}, and should be the same; measured anew")
            member.warnings.append(f"{found}, and should be the same")
        if found:
            return False
        self._keep_row(member, reused(known, seen, bench.run.run_id), known.artifacts)
        return True

    def _make_reference(self, members: list[Member]) -> list[Member]:
        """Have the view's reference made if any case needs it; return those that can be measured with it."""
        if not members or "reference" in self._entries:
            return members
        try:
            self._entries = prepare_view(self._bench, members[0].case, with_reference=True)
        except CaseFailure as failure:
            for member in members:
                self._leave(member, failure)
            return []
        return members

    def _filter_reference(self, members: Sequence[Member]) -> dict[Member, str | None]:
        """Have the view's reference filtered, once for each different kernel of some cases.

        Returns:
            The name of the cache's entry for each case that needs a row; ``None`` for a hard test, or where the
            reference cannot be made. A case that cannot tell its kernel ends here.
        """
        bench, found = self._bench, dict[Member, str | None]()
        entry_of: dict[str, str | None] = {}
        for member in members:
            bench.observer.case_started(member.case, "filter the truth")
            try:
                kernel = member.worker.ask("kernel", {}, bench.options.timeout_s)
            except CaseFailure as failure:
                self._leave(member, failure)
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
        arguments = {
            "cache": bench.cache,
            "entries": self._entries,
            "light": case.view.light,
            "kernel": kernel,
            "threads": cores,
        }
        try:
            entry: str = bench.own_work("prepare_filtered", arguments, cores)
        except CaseFailure as failure:
            bench.observer.note(f"{case.view}: the reference cannot be filtered: {failure.reason}")
            return None
        return entry

    def _measure(self, member: Member) -> None:
        bench, case = self._bench, member.case
        bench.observer.case_started(case, "measure")
        try:
            measured = member.worker.end(bench.options.timeout_s)
        except CaseFailure as failure:
            self._leave(member, failure)
            return
        artifacts = {name: bench.keep_picture(Path(file)) for name, file in measured["pictures"].items()}
        self._keep_row(member, measured, artifacts)

    def _keep_row(self, member: Member, measured: dict[str, Any], artifacts: dict[str, str]) -> None:
        bench, case = self._bench, member.case
        measured["peak_rss_bytes"] = max(measured["peak_rss_bytes"], member.peak_rss_bytes)
        measured["warnings"] += member.warnings
        given = self._given
        baseline = given.members[0]  # the comparison's first case; where it failed, the first that did not
        surroundings = {"load_before": given.load_before, "load_after": given.load_after, **given.seen.record()}
        bench.keep(
            measured_row(
                case,
                bench.run,
                comparison=given.name,
                compile_ms=member.compile_ms,
                timing=member.timing,
                camera=given.camera,
                surroundings=surroundings,
                disturbances=warnings_of(given.seen, case.threads),
                ended_by=given.ended_by,
                repeats=member.repeats,
                baseline_case=baseline.case.case_key,
                baseline=baseline.timing if baseline.is_repeat else None,
                measured=measured,
                artifacts=artifacts,
            )
        )


def prepare_view(bench: Bench, case: Case, *, with_reference: bool) -> dict[str, str]:
    """Have the receivers of a case's view made, and its reference if it is needed; return their names in the cache.

    Raises:
        CaseFailure: They cannot be made.
    """
    bench.observer.case_started(case, "prepare")
    cores = available_cores()
    arguments = {"cache": bench.cache, "view": asdict(case.view), "threads": cores, "with_reference": with_reference}
    entries: dict[str, str] = bench.own_work("prepare", arguments, cores)
    return entries
