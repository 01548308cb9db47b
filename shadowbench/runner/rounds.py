"""The statistics of interleaved rounds: who goes first, what the median is known to, when to stop.

Every round times every case of a comparison once, so that a machine that slows down slows all of them. Nothing is
dropped: a sample that lies far off is a fact about the machine, and a median can stand it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import TypeVar

T = TypeVar("T")

CONFIDENCE = 0.95
TIGHT = 0.05
"""An interval is tight when half its width is at most this share of the median."""

NEGLIGIBLE_MS = 0.05
"""Durations below this are mostly the clock and the interpreter; no round is spent on narrowing them."""


def order_of(members: Sequence[T], round_number: int) -> list[T]:
    """Return the order of a round: there and back in turn, and rotated by one after each return.

    Over ``2 n`` rounds each of ``n`` members stands at each place twice, and precedes another one as often as it
    follows it.
    """
    turn = round_number // 2 % len(members)
    turned = [*members[turn:], *members[:turn]]
    return turned[::-1] if round_number % 2 else turned


@dataclass(frozen=True)
class Interval:
    """A median and the interval that holds the true one; without low and high where there are too few samples."""

    median: float
    low: float | None
    high: float | None

    @property
    def is_tight(self) -> bool:
        """Whether more rounds would tell little more."""
        if self.low is None or self.high is None:
            return False
        return self.median < NEGLIGIBLE_MS or self.high - self.low <= 2.0 * TIGHT * self.median


def interval_of(samples: Sequence[float]) -> Interval:
    """Return the median of samples with its distribution-free interval of at least 95 %.

    The number of samples below the true median is binomial with p = 1/2, so the ``k``-th smallest and ``k``-th
    largest enclose it with probability ``1 - 2 P(X < k)`` (Conover, Practical Nonparametric Statistics, section 3.2).
    That takes six samples.
    """
    ordered = sorted(samples)
    count = len(ordered)
    tail, rank = 0.0, 0  # P(X < rank), and how many samples may be left out on each side
    while rank < count // 2:
        tail += math.comb(count, rank) / 2.0**count
        if 1.0 - 2.0 * tail < CONFIDENCE:
            break
        rank += 1
    if rank == 0:
        return Interval(median(ordered), None, None)
    return Interval(median(ordered), ordered[rank - 1], ordered[count - rank])


def sums(*series: Sequence[float]) -> list[float]:
    """Return the sums round by round, which keep what the parts of a round share."""
    return [sum(values) for values in zip(*series, strict=True)]
