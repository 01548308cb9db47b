"""Two runs case by case: what changed in pixels, work, memory and time, each judged by itself.

* *Pixels* are compared exactly, by the digest of the visibility's bits. Where bits may differ without a change (a
  method that need not repeat them, another version or device of a peer's library, a filter on another machine, which
  is held to 1/255 only), the counts of failing receivers are compared instead, and the comparison says so.
* *Counters* and *memory* (bytes kept, by name) are compared exactly.
* *Times* are compared within one machine only, from every kept sample (:mod:`shadowbench.tables.changed_times`), and
  judged by :mod:`shadowbench.statistics` with a correction for the number of cases.

A difference in time is declared where the interval leaves out 1 and the estimate differs by the threshold or more.
Nothing here imports Warp or a plugin.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from shadowbench.rows import Outcome, ResultRow, RunRecord
from shadowbench.statistics import Verdict
from shadowbench.tables.changed_times import DEFAULT_THRESHOLD, TimeChange, TimeChanges, changed_times, not_comparable
from shadowbench.tables.matching import matched

_COUNTS = tuple(name for name in ResultRow.model_fields if name.endswith("_count") and name != "changed_count")


class Pixels(StrEnum):
    """What may be said of two pictures."""

    SAME = "same pixels"
    OTHER = "other pixels"
    SAME_COUNTS = "same failure counts"
    OTHER_COUNTS = "other failure counts"
    UNKNOWN = "pixels not known"


class Kind(StrEnum):
    """What ``--fail-on`` can name."""

    SLOWER = "slower"
    PIXELS = "pixels"
    COUNTERS = "counters"
    MEMORY = "memory"
    FAILURES = "failures"
    MISSING = "missing"


KIND_MEANINGS: dict[Kind, str] = {
    Kind.SLOWER: "build or shade takes longer in B, by the threshold or more",
    Kind.PIXELS: "other pixels, or other failure counts where bits may differ",
    Kind.COUNTERS: "a work counter has another value",
    Kind.MEMORY: "other bytes are kept",
    Kind.FAILURES: "the case fails in B and did not in A",
    Kind.MISSING: "B has no row of a case that A has",
}


@dataclass(frozen=True)
class Change:
    """A number that is not the same in both runs; ``None`` where a run has none of that name."""

    name: str
    before: int | None
    after: int | None


@dataclass(frozen=True)
class CaseComparison:
    """One case in two runs.

    Attributes:
        before, after: Its rows; ``None`` where a run has none.
        pixels: What may be said of them.
        pixels_note: Why counts were compared instead of bits; empty for bits.
        counts: Failure counts that differ.
        counters, memory: Those that differ.
        times: What was timed in both.
        times_note: Why times were not compared; empty if they were.
    """

    before: ResultRow | None
    after: ResultRow | None
    pixels: Pixels = Pixels.UNKNOWN
    pixels_note: str = ""
    counts: tuple[Change, ...] = ()
    counters: tuple[Change, ...] = ()
    memory: tuple[Change, ...] = ()
    times: tuple[TimeChange, ...] = ()
    times_note: str = ""

    @property
    def row(self) -> ResultRow:
        """Either row, for what both have in common."""
        found = self.before if self.after is None else self.after
        assert found is not None
        return found

    @property
    def is_measured(self) -> bool:
        """Whether both runs measured it."""
        return all(row is not None and row.outcome is Outcome.OK for row in (self.before, self.after))

    @property
    def kinds(self) -> frozenset[Kind]:
        """What changed, of what ``--fail-on`` can name."""
        changed = {
            Kind.SLOWER: any(time.verdict is Verdict.SLOWER for time in self.times),
            Kind.PIXELS: self.pixels in (Pixels.OTHER, Pixels.OTHER_COUNTS),
            Kind.COUNTERS: bool(self.counters),
            Kind.MEMORY: bool(self.memory),
            Kind.FAILURES: _fails(self.after) and not _fails(self.before),
            Kind.MISSING: self.after is None,
        }
        return frozenset(kind for kind, holds in changed.items() if holds)

    @property
    def is_unchanged(self) -> bool:
        """Whether there is nothing to look at."""
        if not self.is_measured:
            return _ended(self.before) == _ended(self.after)
        is_faster = any(time.verdict is Verdict.FASTER for time in self.times)
        return not self.kinds and not is_faster

    @property
    def summary(self) -> str:
        """The case in one plain line."""
        if self.before is None or self.after is None:
            return "only in B" if self.before is None else "only in A"
        if not self.is_measured:
            return self._unmeasured()
        times = self._time_summary()
        if self.is_unchanged and self.pixels in (Pixels.SAME, Pixels.SAME_COUNTS):
            same = "same in everything" if self.pixels is Pixels.SAME else "same failure counts, counters and bytes"
            return f"{same}, {times}" if times else f"{same} but time, which was not compared"
        parts = [self.pixels.value]
        parts += ["counters changed"] if self.counters else []
        parts += ["other bytes kept"] if self.memory else []
        parts += [times] if times else ["time not compared"]
        if times == Verdict.FASTER.value:  # the good news first
            parts = [times, *parts[:-1]]
        return ", ".join(parts)

    def _unmeasured(self) -> str:
        endings = {name: row for name, row in (("A", self.before), ("B", self.after)) if row is not None}
        said = {name: _ended(row) for name, row in endings.items() if row.outcome is not Outcome.OK}
        if len(said) == 2 and said["A"] == said["B"]:
            return f"{said['A'][0]} in both: {said['A'][1]}".removesuffix(": ")
        texts = [f"{verb} in {name}: {reason}".removesuffix(": ") for name, (verb, reason) in said.items()]
        return ", ".join(texts)

    def _time_summary(self) -> str:
        verdicts = {time.verdict for time in self.times} - {Verdict.NO_DIFFERENCE}
        if not self.times:
            return ""
        if not verdicts:
            return "no difference in time shown"
        if len(verdicts) == 1:
            return verdicts.pop().value
        return ", ".join(f"{time.verdict.value} {time.name}" for time in self.times)


@dataclass(frozen=True)
class RunComparison:
    """Two runs, and all their cases.

    Attributes:
        before, after: The runs.
        cases: In the order of the first run, then what only the second has.
        threshold: Smallest relative difference in time that is declared.
        notes: What holds for all cases.
    """

    before: RunRecord
    after: RunRecord
    cases: tuple[CaseComparison, ...]
    threshold: float
    notes: tuple[str, ...]

    def failing(self, kinds: Sequence[Kind]) -> dict[Kind, int]:
        """Return how many cases changed in each of some ways; those in which none did are left out."""
        counts = {kind: sum(kind in case.kinds for case in self.cases) for kind in kinds}
        return {kind: count for kind, count in counts.items() if count}

    @property
    def summaries(self) -> dict[str, int]:
        """How many cases each line is said of, the most frequent first."""
        return dict(Counter(case.summary for case in self.cases).most_common())


def compare_runs(
    before: RunRecord,
    rows_before: Sequence[ResultRow],
    after: RunRecord,
    rows_after: Sequence[ResultRow],
    *,
    threshold: float = DEFAULT_THRESHOLD,
) -> RunComparison:
    """Compare two runs case by case.

    Args:
        before, after: The runs, A and B.
        rows_before, rows_after: All their rows.
        threshold: Smallest relative difference in time that is declared, 0.02 for 2 %.
    """
    pairs = matched(rows_before, rows_after, before, after)
    times = changed_times(pairs, threshold)
    cases = tuple(_case(a, b, times.by_place.get(place, ()), (before, after)) for place, (a, b) in enumerate(pairs))
    return RunComparison(before, after, cases, threshold, tuple(_notes(before, after, cases, times)))


def _case(
    a: ResultRow | None, b: ResultRow | None, times: tuple[TimeChange, ...], runs: tuple[RunRecord, RunRecord]
) -> CaseComparison:
    if a is None or b is None or not (_is_ok(a) and _is_ok(b)):
        return CaseComparison(a, b)
    note = _pixels_note(a, b, runs)
    counts = _changes({n: getattr(a, n) for n in _COUNTS}, {n: getattr(b, n) for n in _COUNTS})
    return CaseComparison(
        a,
        b,
        pixels=_pixels(a, b, counts, exact=not note),
        pixels_note=note,
        counts=counts,
        counters=_changes(a.counters, b.counters),
        memory=_changes(a.kept, b.kept),
        times=times,
        times_note=not_comparable(a, b),
    )


def _pixels(a: ResultRow, b: ResultRow, counts: tuple[Change, ...], *, exact: bool) -> Pixels:
    if not a.visibility_digest or not b.visibility_digest:
        return Pixels.UNKNOWN
    if a.visibility_digest == b.visibility_digest:
        return Pixels.SAME
    if exact:
        return Pixels.OTHER
    return Pixels.OTHER_COUNTS if counts else Pixels.SAME_COUNTS


def _pixels_note(a: ResultRow, b: ResultRow, runs: tuple[RunRecord, RunRecord]) -> str:
    """Return why equal code need not give equal bits, or an empty string."""
    if a.visibility_digest == b.visibility_digest:
        return ""
    if a.changed_count is not None or b.changed_count is not None:
        return "bits may differ between repeats"
    own_a, own_b = (_own_libraries(row, run) for row, run in zip((a, b), runs, strict=True))
    if own_a != own_b:
        names = [n for n in dict.fromkeys([*own_a, *own_b]) if own_a.get(n) != own_b.get(n)]
        return ", ".join(f"{name} is {own_b.get(name, 'absent')}, was {own_a.get(name, 'absent')}" for name in names)
    if a.machine != b.machine and (a.reference_error is not None or b.reference_error is not None):
        return "filtered visibility may differ by 1/255 between machines"
    return ""


def _own_libraries(row: ResultRow, run: RunRecord) -> dict[str, str]:
    """Return what a row's method depends on beyond what its run names: a peer's device and its versions."""
    known, own = run.environment.get("libraries", {}), row.environment.get("libraries", {})
    return {name: str(text) for name, text in own.items() if name not in known}


def _changes(before: Mapping[str, int | None], after: Mapping[str, int | None]) -> tuple[Change, ...]:
    names = dict.fromkeys([*before, *after])
    return tuple(
        Change(name, before.get(name), after.get(name)) for name in names if before.get(name) != after.get(name)
    )


def _notes(before: RunRecord, after: RunRecord, cases: Sequence[CaseComparison], times: TimeChanges) -> list[str]:
    notes = []
    if before.code_version != after.code_version:
        notes.append(f"code: {before.code_version} in A, {after.code_version} in B")
    if before.machine != after.machine:
        notes.append(f"A on {before.machine}; B on {after.machine}: times were not compared")
    for name, a, b in _environment_changes(before, after):
        notes.append(f"{name}: {a or 'absent'} in A, {b or 'absent'} in B")
    notes += [note for note in (times.note(),) if note]
    notes += sorted({f"pixels of {c.row.method}: {c.pixels_note}" for c in cases if c.pixels_note})
    return notes


def _environment_changes(before: RunRecord, after: RunRecord) -> list[tuple[str, Any, Any]]:
    """Return versions that differ between two runs."""
    a, b = ({"python": run.environment.get("python")} | run.environment.get("libraries", {}) for run in (before, after))
    return [(name, a.get(name), b.get(name)) for name in dict.fromkeys([*a, *b]) if a.get(name) != b.get(name)]


def _is_ok(row: ResultRow) -> bool:
    return row.outcome is Outcome.OK


def _fails(row: ResultRow | None) -> bool:
    return row is not None and row.outcome.is_failure


def _ended(row: ResultRow | None) -> tuple[str, str]:
    """Return how a case ended, as a verb and a reason."""
    if row is None:
        return "absent", ""
    if row.outcome is Outcome.OK:
        return "measured", ""
    if row.outcome is Outcome.SKIPPED:
        return "skipped", row.reason
    return "failed", f"{row.outcome.value}: {row.reason}" if row.reason else row.outcome.value
