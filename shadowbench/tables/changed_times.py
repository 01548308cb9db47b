"""The times of two runs: which of them differ, and not merely because the machine did.

Two runs of the same code at different times rarely take equally long. Where both timed something that did not change in
the same rounds as a case (a case with the same key, which is the same code on the same machine; if any case has the
same quality key, the camera pass as well), its durations are also taken as shares of that, round by round, and a
difference must show both ways: in the shares, which a machine that was slower as a whole leaves alone, and in the
durations themselves, which are free of what disturbed the others. The interval that is given holds both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from shadowbench.rows import Outcome, ResultRow
from shadowbench.statistics import CONFIDENCE, Contrast, Interval, Judgement, Verdict, judge, separate
from shadowbench.tables.matching import Pair

DEFAULT_THRESHOLD = 0.02
"""Two runs of the same code on a quiet machine differ by up to this, since each of their processes is laid out anew."""

NEGLIGIBLE_MS = 0.05
"""Durations below this are mostly the clock and the interpreter; they are not compared."""

TIMED = ("build", "shade")
"""The parts of a case that are compared."""

Measured = tuple[ResultRow, ResultRow]


@dataclass(frozen=True)
class TimeChange:
    """A part of a case, timed in both runs.

    Attributes:
        name: ``build`` or ``shade``.
        before, after: Medians [ms].
        ratio: After over before, with its interval; as shares of what did not change where there is such.
        verdict: Of the second run.
    """

    name: str
    before: float
    after: float
    ratio: Interval
    verdict: Verdict


@dataclass(frozen=True)
class TimeChanges:
    """The times of all cases.

    Attributes:
        by_place: Place among the pairs -> what was timed in both.
        drift: How much longer what did not change took in the second run, for each duration that was compared with it.
    """

    by_place: Mapping[int, tuple[TimeChange, ...]]
    drift: tuple[float, ...]

    def note(self) -> str:
        """Return what the machine did between the runs, or an empty string."""
        if not self.drift:
            return ""
        percent = 100.0 * (median(self.drift) - 1.0)
        return (
            f"what did not change took {abs(percent):.1f} % {'longer' if percent >= 0.0 else 'shorter'} in B"
            f" (median of {len(self.drift)} comparisons); ratios are of shares of it, round by round"
        )


def not_comparable(a: ResultRow, b: ResultRow) -> str:
    """Return why the times of two rows must not be compared, or an empty string."""
    if a.machine != b.machine:
        return "measured on another machine"
    if not all(row.samples.get(name) for row in (a, b) for name in TIMED):
        return "no samples are kept"
    if not any(_is_long_enough(a, b, name) for name in TIMED):
        return f"shorter than {NEGLIGIBLE_MS} ms"
    return ""


def changed_times(pairs: Sequence[Pair], threshold: float) -> TimeChanges:
    """Judge all times of two runs at once, corrected for their number.

    Args:
        pairs: All cases.
        threshold: Smallest relative difference that is declared.
    """
    measured = {
        place: (a, b)
        for place, (a, b) in enumerate(pairs)
        if a is not None and b is not None and a.outcome is b.outcome is Outcome.OK
    }
    drift = _Drift(list(measured.values()))
    named: list[tuple[int, str]] = []
    contrasts: list[Contrast] = []
    for place, (a, b) in measured.items():
        for name in TIMED if not not_comparable(a, b) else ():
            if _is_long_enough(a, b, name):
                named.append((place, name))
                contrasts.append(drift.contrast(a, b, name))
    found: dict[int, tuple[TimeChange, ...]] = {}
    for (place, name), judgement in zip(named, judge(contrasts), strict=True):
        a, b = measured[place]
        before, after = median(a.samples[name]), median(b.samples[name])
        change = TimeChange(name, before, after, judgement.ratio, _verdict(judgement, threshold))
        found[place] = (*found.get(place, ()), change)
    return TimeChanges(found, tuple(drift.ratios))


def _is_long_enough(a: ResultRow, b: ResultRow, name: str) -> bool:
    return max(median(a.samples[name]), median(b.samples[name])) >= NEGLIGIBLE_MS


def _verdict(judgement: Judgement, threshold: float) -> Verdict:
    estimate = judgement.ratio.estimate
    matters = max(estimate, 1.0 / estimate) >= 1.0 + threshold
    return judgement.verdict if matters else Verdict.NO_DIFFERENCE


@dataclass(frozen=True)
class _BothWays:
    """A :class:`~shadowbench.statistics.Contrast` that shows what shares and durations agree in.

    Attributes:
        shares: Of what did not change; the estimate is theirs.
        durations: As such.
    """

    shares: Contrast
    durations: Contrast

    @property
    def p_value(self) -> float:
        """The larger one; 1 where the two contradict each other."""
        directions = (self.shares.interval().estimate - 1.0) * (self.durations.interval().estimate - 1.0)
        return max(self.shares.p_value, self.durations.p_value) if directions > 0.0 else 1.0

    def interval(self, confidence: float = CONFIDENCE) -> Interval:
        """Return the estimate of the shares with an interval that holds both."""
        return self.shares.interval(confidence).wider(self.durations.interval(confidence))


class _Drift:
    """What the machine did between two runs, seen in what did not change."""

    def __init__(self, measured: Sequence[Measured]) -> None:
        self._is_camera_unchanged = any(a.quality_key == b.quality_key for a, b in measured)
        self._unchanged: dict[tuple[str, str], list[Measured]] = {}
        for a, b in measured:
            if a.case_key == b.case_key:
                self._unchanged.setdefault((a.comparison, b.comparison), []).append((a, b))
        self.ratios: list[float] = []

    def contrast(self, a: ResultRow, b: ResultRow, name: str) -> Contrast:
        """Return the second row's times against the first one's."""
        processes = _processes(b), _processes(a)
        durations = separate(b.samples[name], a.samples[name], *processes)
        beside = self._beside(a, b)
        if beside is None:
            return durations
        before, after = beside
        self.ratios.append(median(after) / median(before))
        shares = separate(_shares(b.samples[name], after), _shares(a.samples[name], before), *processes)
        return _BothWays(shares, durations)

    def _beside(self, a: ResultRow, b: ResultRow) -> tuple[list[float], list[float]] | None:
        """Return how long, by round and in either run, the unchanged cases of the same rounds took together."""
        others = [pair for pair in self._unchanged.get((a.comparison, b.comparison), []) if pair[0] is not a]
        series = [(x.samples.get(name, []), y.samples.get(name, [])) for x, y in others for name in TIMED]
        if self._is_camera_unchanged:
            series.append((a.samples.get("camera", []), b.samples.get("camera", [])))
        rounds = len(a.samples[TIMED[0]]), len(b.samples[TIMED[0]])
        whole = [pair for pair in series if (len(pair[0]), len(pair[1])) == rounds]  # one that left early has fewer
        if not whole:
            return None
        before, after = ([sum(values) for values in zip(*side, strict=True)] for side in zip(*whole, strict=True))
        return (before, after) if min(*before, *after) >= NEGLIGIBLE_MS else None


def _shares(durations: Sequence[float], beside: Sequence[float]) -> list[float]:
    return [duration / rest for duration, rest in zip(durations, beside, strict=True)]


def _processes(row: ResultRow) -> list[int] | None:
    """Return which worker process each round's samples are from, where the row knows."""
    return row.round_processes or None
