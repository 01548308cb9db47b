"""The statistics of timing: what a median is known to, whether two cases differ, and which samples look odd.

Everything that judges times stands here, so that rows, tables, claims and comparisons of runs judge alike. Three rules
hold throughout. *Nothing is dropped*: odd samples are marked, and medians can stand them. *A whole process may be
shifted* (its memory is laid out differently): where samples come from several processes, an interval is the wider of
one that takes rounds as independent and one that takes processes as independent. *A verdict and its interval agree*:
a difference is declared exactly where the printed interval leaves out 1.

Durations are in milliseconds, ratios are of durations: below 1 is faster. Nothing here imports Warp.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from itertools import accumulate
from statistics import median
from typing import Protocol

CONFIDENCE = 0.95
"""Of every interval, before any correction over a table."""

LEAST_DURATION_MS = 1.0e-6
"""What counts as no time at all; logarithms are of nothing shorter."""

LAYOUT_SHIFT = 0.03
"""What is allowed for how one process happens to be laid out in memory, where there is no other to tell by."""

_RESAMPLES = 4000
_LEAST_SPREAD = 0.01
_FAR_OUT = 3.0
_LEAST_FOR_TWO_MODES = 16
_GAP_OF_TWO_MODES = 3.0
_MOST_PAIRS_COUNTED = 4000


@dataclass(frozen=True)
class Interval:
    """An estimate and the interval that holds the true value; without low and high where there are too few samples."""

    estimate: float
    low: float | None = None
    high: float | None = None

    @property
    def half_width(self) -> float | None:
        """Half the width as a share of the estimate, ``None`` without an interval."""
        if self.low is None or self.high is None or self.estimate == 0.0:
            return None
        return 0.5 * (self.high - self.low) / self.estimate

    def wider(self, other: Interval) -> Interval:
        """Return this estimate with an interval that holds both."""
        if self.low is None or self.high is None or other.low is None or other.high is None:
            return self
        return Interval(self.estimate, min(self.low, other.low), max(self.high, other.high))


class Verdict(StrEnum):
    """What may be said of two cases' times."""

    FASTER = "faster"
    SLOWER = "slower"
    NO_DIFFERENCE = "no difference shown"


# Medians


def interval_of(samples: Sequence[float], confidence: float = CONFIDENCE) -> Interval:
    """Return the median of samples with its distribution-free interval.

    The number of samples below the true median is binomial with p = 1/2, so the ``k``-th smallest and ``k``-th
    largest enclose it with probability ``1 - 2 P(X < k)`` (Conover, Practical Nonparametric Statistics, section 3.2).
    At 95 % that takes six samples.
    """
    ordered = sorted(samples)
    count = len(ordered)
    tail, rank = 0.0, 0  # P(X < rank), and how many samples may be left out on each side
    while rank < count // 2:
        tail += math.comb(count, rank) / 2.0**count
        if 2.0 * tail > (1.0 - confidence) * (1.0 + 1e-12):
            break
        rank += 1
    if rank == 0:
        return Interval(median(ordered))
    return Interval(median(ordered), ordered[rank - 1], ordered[count - rank])


def bootstrap_median(
    samples: Sequence[float],
    seed: int = 0,
    *,
    processes: Sequence[int] | None = None,
    confidence: float = CONFIDENCE,
) -> Interval:
    """Return the median of samples with its percentile bootstrap interval; the same for the same input.

    Args:
        samples: At least one.
        seed: Of the resampling.
        processes: Which process each sample is from. Several processes are drawn first, then samples of each.
        confidence: Of the interval.
    """
    import numpy as np

    rng = np.random.default_rng(seed)
    values = np.asarray(samples, dtype=np.float64)
    groups = _grouped(samples, processes)
    if len(groups) < 2:
        drawn = values[rng.integers(0, len(values), (_RESAMPLES, len(values)))]
    else:
        sizes = np.array([len(group) for group in groups])
        padded = np.array([[*group, *[math.nan] * (sizes.max() - len(group))] for group in groups])
        chosen = rng.integers(0, len(groups), (_RESAMPLES, len(groups)))
        places = rng.random((_RESAMPLES, len(groups), sizes.max()))
        drawn = padded[chosen[:, :, None], (places * sizes[chosen][:, :, None]).astype(int)]
        beyond = np.arange(sizes.max()) >= sizes[chosen][:, :, None]
        drawn = np.where(beyond, np.nan, drawn).reshape(_RESAMPLES, -1)
    medians = np.nanmedian(drawn, axis=1)
    tail = 0.5 * (1.0 - confidence)
    low, high = np.quantile(medians, (tail, 1.0 - tail))
    return Interval(float(np.median(values)), float(low), float(high))


def median_over_processes(samples: Sequence[float], processes: Sequence[int] | None) -> Interval:
    """Return the median with the interval of a row: the distribution-free one, or a wider one over the processes."""
    by_round = interval_of(samples)
    if processes is None or len(set(processes)) < 2:
        return by_round
    return by_round.wider(bootstrap_median(samples, processes=processes))


def _grouped(samples: Sequence[float], processes: Sequence[int] | None) -> list[list[float]]:
    """Return the samples of each process, in order of first appearance."""
    groups: dict[int, list[float]] = {}
    for sample, process in zip(samples, processes or [0] * len(samples), strict=True):
        groups.setdefault(process, []).append(sample)
    return list(groups.values())


# Two cases


class Contrast(Protocol):
    """Two cases' samples, ready to be judged at any confidence."""

    @property
    def p_value(self) -> float:
        """How probable a difference like this one is where there is none."""

    def interval(self, confidence: float = CONFIDENCE) -> Interval:
        """Return the ratio with its interval; it leaves out 1 exactly where ``p_value <= 1 - confidence``."""


@dataclass(frozen=True)
class PairedContrast:
    """Two cases that were timed in the same rounds.

    The estimate is the median of the rounds' ratios. The sign test takes rounds as independent. Where they are from
    several processes, Student's t of the processes' medians takes those as independent, and the wider interval and the
    larger p-value count: two cases whose processes merely were laid out differently are not called different. Rounds
    that are known to be from one process cannot tell, and :data:`LAYOUT_SHIFT` is allowed for on either side.

    Attributes:
        log_ratios: Logarithm of first over second, by round.
        processes: Which process each round's samples are from; empty for one.
    """

    log_ratios: tuple[float, ...]
    processes: tuple[int, ...] = ()

    @property
    def p_value(self) -> float:
        """See :class:`Contrast`."""
        medians = self._process_medians()
        if len(medians) < 2:
            return _sign_test(self.log_ratios, _allowance(self.processes))
        by_round = _sign_test(self.log_ratios)
        if median(self.log_ratios) * sum(medians) <= 0.0:  # they do not even agree on which is faster
            return 1.0
        return max(by_round, _student_p(medians))

    def interval(self, confidence: float = CONFIDENCE) -> Interval:
        """See :class:`Contrast`."""
        found = interval_of(self.log_ratios, confidence)
        medians = self._process_medians()
        if len(medians) < 2:
            return _exponential(_widened(found, _allowance(self.processes)))
        return _exponential(found.wider(_student_interval(medians, confidence)))

    def _process_medians(self) -> list[float]:
        return [median(group) for group in _grouped(self.log_ratios, self.processes or None)]


@dataclass(frozen=True)
class SeparateContrast:
    """Two cases that were timed in rounds of their own.

    The estimate is the median of all pairs' ratios, its interval that of the Mann-Whitney test (Hodges & Lehmann 1963;
    Conover, section 5.4). Several processes on both sides are judged by Welch's t as well, and the wider counts; for
    one that is known, :data:`LAYOUT_SHIFT` is allowed. What
    changed on the machine between the two counts as a difference: only rounds in common can tell that apart.

    Attributes:
        first, second: Logarithms of the durations.
        first_processes, second_processes: Which process each is from; empty for one.
    """

    first: tuple[float, ...]
    second: tuple[float, ...]
    first_processes: tuple[int, ...] = ()
    second_processes: tuple[int, ...] = ()

    @property
    def p_value(self) -> float:
        """See :class:`Contrast`."""
        differences = self._differences()
        tails = _rank_sum_tails(len(self.first), len(self.second))
        medians = self._process_medians()
        reach = self._allowance() if medians is None else 0.0
        against = min(sum(d <= reach for d in differences), sum(d >= -reach for d in differences))
        by_sample = min(1.0, 2.0 * tails[against])
        if medians is None:
            return by_sample
        if median(differences) * _welch(*medians)[0] <= 0.0:
            return 1.0
        return max(by_sample, _welch_p(*medians))

    def interval(self, confidence: float = CONFIDENCE) -> Interval:
        """See :class:`Contrast`."""
        differences = self._differences()
        tails = _rank_sum_tails(len(self.first), len(self.second))
        rank = sum(2.0 * tail <= (1.0 - confidence) * (1.0 + 1e-12) for tail in tails)  # may be left out on each side
        found = Interval(median(differences))
        if 0 < rank <= len(differences) // 2:
            found = Interval(found.estimate, differences[rank - 1], differences[-rank])
        medians = self._process_medians()
        if medians is None:
            return _exponential(_widened(found, self._allowance()))
        return _exponential(found.wider(_welch_interval(*medians, confidence)))

    def _allowance(self) -> float:
        return max(_allowance(self.first_processes), _allowance(self.second_processes))

    def _differences(self) -> list[float]:
        return sorted(a - b for a in self.first for b in self.second)

    def _process_medians(self) -> tuple[list[float], list[float]] | None:
        sides = (self.first, self.first_processes), (self.second, self.second_processes)
        first, second = ([median(group) for group in _grouped(v, p or None)] for v, p in sides)
        return (first, second) if min(len(first), len(second)) >= 2 else None


def paired(a: Sequence[float], b: Sequence[float], processes: Sequence[int] | None = None) -> PairedContrast:
    """Return what durations of two cases in the same rounds say about ``a / b``."""
    logs = [x - y for x, y in zip(_logs(a), _logs(b), strict=True)]
    return PairedContrast(tuple(logs), tuple(processes or ()))


def separate(
    a: Sequence[float],
    b: Sequence[float],
    a_processes: Sequence[int] | None = None,
    b_processes: Sequence[int] | None = None,
) -> SeparateContrast:
    """Return what durations of two cases in rounds of their own say about ``a / b``."""
    return SeparateContrast(tuple(_logs(a)), tuple(_logs(b)), tuple(a_processes or ()), tuple(b_processes or ()))


def ratio_by_round(
    a: Sequence[float],
    b: Sequence[float],
    processes: Sequence[int] | None = None,
    confidence: float = CONFIDENCE,
) -> Interval:
    """Return ``a / b`` of two cases that were timed in the same rounds; see :class:`PairedContrast`."""
    return paired(a, b, processes).interval(confidence)


def ratio_of_runs(
    a: Sequence[float],
    b: Sequence[float],
    a_processes: Sequence[int] | None = None,
    b_processes: Sequence[int] | None = None,
    confidence: float = CONFIDENCE,
) -> Interval:
    """Return ``a / b`` of two cases that were timed in rounds of their own; see :class:`SeparateContrast`."""
    return separate(a, b, a_processes, b_processes).interval(confidence)


def _logs(durations: Sequence[float]) -> list[float]:
    return [math.log(max(duration, LEAST_DURATION_MS)) for duration in durations]


def _allowance(processes: Sequence[int]) -> float:
    """Return what may be layout, as a logarithm: nothing where it is not known which processes rounds are from."""
    return math.log1p(LAYOUT_SHIFT) if processes else 0.0


def _widened(found: Interval, reach: float) -> Interval:
    if found.low is None or found.high is None:
        return found
    return Interval(found.estimate, found.low - reach, found.high + reach)


def _exponential(found: Interval) -> Interval:
    low, high = (None if end is None else math.exp(end) for end in (found.low, found.high))
    return Interval(math.exp(found.estimate), low, high)


# Judging many at once


@dataclass(frozen=True)
class Judgement:
    """What is said of two cases.

    Attributes:
        ratio: ``a / b`` with the interval that decided.
        verdict: Of ``a``, against ``b``.
        confidence: Of that interval; above 95 % where others were judged beside it.
    """

    ratio: Interval
    verdict: Verdict
    confidence: float


def judge(contrasts: Sequence[Contrast]) -> list[Judgement]:
    """Judge all pairs of one table, corrected for their number.

    By Benjamini and Hochberg's procedure: of the differences declared, no more than one in twenty is expected to be
    none (and where there are no differences at all, none is declared in nineteen tables of twenty). Holm's would bound
    the chance of a single wrong one, but a sign test of few rounds can never pass it in a table of many cases, however
    far they are apart. The intervals are Benjamini and Yekutieli's (2005): of ``m`` pairs of which ``r`` differ, at
    confidence ``1 - 0.05 r / m``. Those of the others are at ``1 - 0.05 (r + 1) / m``; all of them hold 1.
    """
    count, allowed = len(contrasts), 1.0 - CONFIDENCE
    p_values = [contrast.p_value for contrast in contrasts]
    differing = differences_among(p_values)
    found = []
    for contrast, differs in zip(contrasts, differing, strict=True):
        confidence = 1.0 - allowed * min(count, sum(differing) + (not differs)) / count
        ratio = contrast.interval(confidence)
        verdict = Verdict.NO_DIFFERENCE
        if differs:
            verdict = Verdict.FASTER if ratio.estimate < 1.0 else Verdict.SLOWER
        found.append(Judgement(ratio, verdict, confidence))
    return found


def differences_among(p_values: Sequence[float]) -> list[bool]:
    """Return which of many tests show a difference, by Benjamini and Hochberg's procedure."""
    allowed, count = 1.0 - CONFIDENCE, len(p_values)
    order = sorted(range(count), key=p_values.__getitem__)
    passed = [rank for rank, place in enumerate(order, 1) if p_values[place] <= _rounded_up(allowed * rank / count)]
    differing = set(order[: max(passed, default=0)])
    return [place in differing for place in range(count)]


def _rounded_up(level: float) -> float:
    """Return a level such that a p-value that equals it on paper does so in floating point."""
    return level * (1.0 + 1e-12)


# Odd samples


def outliers(samples: Sequence[float]) -> list[int]:
    """Return the places of samples that lie far out: beyond the quartiles by three times their distance (Tukey 1977).

    Samples within 1 % of the median never do. They are marked, not dropped.
    """
    if len(samples) < 4:
        return []
    low, middle, high = (_quantile(sorted(samples), share) for share in (0.25, 0.5, 0.75))
    reach = _FAR_OUT * (high - low)
    least = _LEAST_SPREAD * abs(middle)
    return [
        place
        for place, sample in enumerate(samples)
        if (sample > high + reach or sample < low - reach) and abs(sample - middle) > least
    ]


def has_two_modes(samples: Sequence[float]) -> bool:
    """Return whether samples fall into two groups with next to nothing between, so that a median says little.

    From 16 samples on: somewhere in the order, with at least a fifth of the samples on each side, lies a gap of more
    than three times the larger interquartile range of the two sides, and of more than 1 % of the median. Fewer than
    one in a hundred sets of normal, uniform or exponential samples have one.
    """
    count = len(samples)
    if count < _LEAST_FOR_TWO_MODES:
        return False
    ordered = sorted(samples)
    aside = max(3, math.ceil(count / 5))
    place = max(range(aside, count - aside + 1), key=lambda cut: ordered[cut] - ordered[cut - 1])
    gap = ordered[place] - ordered[place - 1]
    spread = max(_quantile(side, 0.75) - _quantile(side, 0.25) for side in (ordered[:place], ordered[place:]))
    return gap > _GAP_OF_TWO_MODES * spread and gap > _LEAST_SPREAD * abs(median(ordered))


def _quantile(ordered: Sequence[float], share: float) -> float:
    place = share * (len(ordered) - 1)
    below = math.floor(place)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])


# Tests


def _sign_test(values: Sequence[float], reach: float = 0.0) -> float:
    """Two-sided, of a median within ``reach`` of 0; a value of exactly that counts against either side."""
    count = len(values)
    against = min(sum(v <= reach for v in values), sum(v >= -reach for v in values))
    return min(1.0, 2.0 * sum(math.comb(count, k) for k in range(against + 1)) / 2.0**count)


def _student_p(values: Sequence[float]) -> float:
    from scipy.special import stdtr

    mean, error = _mean_and_error(values)
    if error == 0.0:
        return 1.0 if mean == 0.0 else 0.0
    return float(2.0 * stdtr(len(values) - 1, -abs(mean) / error))


def _student_interval(values: Sequence[float], confidence: float) -> Interval:
    from scipy.special import stdtrit

    mean, error = _mean_and_error(values)
    reach = float(stdtrit(len(values) - 1, 0.5 * (1.0 + confidence))) * error
    return Interval(mean, mean - reach, mean + reach)


def _welch_p(first: Sequence[float], second: Sequence[float]) -> float:
    from scipy.special import stdtr

    difference, error, freedom = _welch(first, second)
    if error == 0.0:
        return 1.0 if difference == 0.0 else 0.0
    return float(2.0 * stdtr(freedom, -abs(difference) / error))


def _welch_interval(first: Sequence[float], second: Sequence[float], confidence: float) -> Interval:
    from scipy.special import stdtrit

    difference, error, freedom = _welch(first, second)
    reach = float(stdtrit(freedom, 0.5 * (1.0 + confidence))) * error
    return Interval(difference, difference - reach, difference + reach)


def _welch(first: Sequence[float], second: Sequence[float]) -> tuple[float, float, float]:
    """Return the difference of means, its standard error, and the degrees of freedom (Welch & Satterthwaite)."""
    (mean_a, error_a), (mean_b, error_b) = _mean_and_error(first), _mean_and_error(second)
    error = math.hypot(error_a, error_b)
    if error == 0.0:
        return mean_a - mean_b, 0.0, 1.0
    # shares of the variance, so that nothing underflows
    shares = (error_a / error) ** 4 / (len(first) - 1) + (error_b / error) ** 4 / (len(second) - 1)
    return mean_a - mean_b, error, 1.0 / shares


def _mean_and_error(values: Sequence[float]) -> tuple[float, float]:
    mean = math.fsum(values) / len(values)
    variance = math.fsum((value - mean) ** 2 for value in values) / (len(values) - 1)
    return mean, math.sqrt(variance / len(values))


@cache
def _rank_sum_tails(first: int, second: int) -> list[float]:
    """Return P(U <= u) of the Mann-Whitney statistic for u = 0, 1, ... ``first * second``.

    Its generating function is the Gaussian binomial coefficient, the product of (1 - x^(second + i)) / (1 - x^i). From
    many pairs on it is normal.
    """
    count = first * second
    if count > _MOST_PAIRS_COUNTED:
        spread = math.sqrt(count * (first + second + 1) / 6.0)  # by sqrt(2), for the error function
        return [0.5 * math.erfc((0.5 * count - u - 0.5) / spread) for u in range(count + 1)]
    ways = [1] + [0] * count
    for i in range(1, first + 1):
        for u in range(count, second + i - 1, -1):
            ways[u] -= ways[u - second - i]
        for u in range(i, count + 1):
            ways[u] += ways[u - i]
    total = math.comb(first + second, first)
    return [below / total for below in accumulate(ways)]
