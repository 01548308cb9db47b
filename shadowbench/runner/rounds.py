"""Interleaved rounds: who goes first, when to go on in fresh processes, and when to stop.

Every round times every case of a comparison once, so that a machine that slows down slows all of them. The rounds are
divided among several processes a case, since how its memory happens to be laid out shifts a whole process.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import TypeVar

from shadowbench.statistics import Interval

T = TypeVar("T")

TIGHT = 0.05
"""An interval is tight when half its width is at most this share of the median."""

NEGLIGIBLE_MS = 0.05
"""Durations below this are mostly the clock and the interpreter; no round is spent on narrowing them."""

LEAST_ROUNDS_A_PROCESS = 3
"""Where there are several; a process's median of fewer would be its noise."""

LEAST_PROCESSES = 3
"""If more than one: two agree or differ by chance, and tell next to nothing of a third."""


def order_of(members: Sequence[T], round_number: int) -> list[T]:
    """Return the order of a round: there and back in turn, and rotated by one after each return.

    Over ``2 n`` rounds each of ``n`` members stands at each place twice, and precedes another one as often as it
    follows it.
    """
    turn = round_number // 2 % len(members)
    turned = [*members[turn:], *members[:turn]]
    return turned[::-1] if round_number % 2 else turned


def is_tight(found: Interval) -> bool:
    """Return whether more rounds would tell little more of a median."""
    if found.low is None or found.high is None:
        return False
    return found.estimate < NEGLIGIBLE_MS or found.high - found.low <= 2.0 * TIGHT * found.estimate


def sums(*series: Sequence[float]) -> list[float]:
    """Return the sums round by round, which keep what the parts of a round share."""
    return [sum(values) for values in zip(*series, strict=True)]


class Step(StrEnum):
    """What comes after a round."""

    ROUND = "another round"
    RENEW = "the next round, in fresh processes"
    END = "nothing"


class EndedBy(StrEnum):
    """Which rule ended the rounds."""

    INTERVAL = "interval"
    BUDGET = "budget"
    ROUNDS = "rounds"


class Pace:
    """Decides after each round.

    How many processes a case gets is decided after the first round, when it is known how long one takes: as many as
    asked for, if each has its three rounds within budget and number of rounds, and if loading all cases again takes no
    longer than is allowed for it; one, if that leaves two. Each process gets its share of both; it ends earlier once
    every interval is tight.

    Args:
        budget_s: For the rounds, loading not counted [s].
        loading_budget_s: For loading the cases again, all processes after the first together [s].
        loading_s: What loading them once is expected to take [s].
        min_rounds, max_rounds: Bounds on the number of rounds.
        most_processes: Asked for.

    Attributes:
        rounds: How many there were.
        process: The number of the process that the rounds are in, from 0.
        processes: How many there will be; known after the first round.
        ended_by: Set at the end.
    """

    def __init__(
        self,
        *,
        budget_s: float,
        loading_budget_s: float,
        loading_s: float,
        min_rounds: int,
        max_rounds: int,
        most_processes: int,
    ) -> None:
        self._budget_s, self._loading_budget_s, self._loading_s = budget_s, loading_budget_s, loading_s
        self._min_rounds, self._max_rounds = min_rounds, max(1, max_rounds)
        self._most_processes = most_processes
        self.rounds, self.process, self.processes = 0, 0, 1
        self.ended_by = EndedBy.BUDGET
        self._in_process, self._timed_s = 0, 0.0

    def after_round(self, seconds: float, all_tight: Callable[[], bool]) -> Step:
        """Return what comes next.

        Args:
            seconds: What the round took.
            all_tight: Whether every interval is tight; asked only where it matters.
        """
        self.rounds += 1
        self._in_process += 1
        self._timed_s += seconds
        if self.rounds == 1:
            self.processes = self._affordable_processes()
        share = (self.process + 1) / self.processes
        next_end_s = self._timed_s * (self.rounds + 1) / self.rounds
        least = max(LEAST_ROUNDS_A_PROCESS, math.ceil(self._min_rounds / self.processes))
        has_least = self._in_process >= (least if self.processes > 1 else self._min_rounds)
        is_tight = has_least and all_tight()
        is_full = self.rounds >= math.ceil(self._max_rounds * share)
        if not is_tight and not is_full and next_end_s <= self._budget_s * share:
            return Step.ROUND
        if self.process + 1 < self.processes:
            self.process += 1
            self._in_process = 0
            return Step.RENEW
        self.ended_by = EndedBy.INTERVAL if is_tight else EndedBy.ROUNDS if is_full else EndedBy.BUDGET
        return Step.END

    def _affordable_processes(self) -> int:
        rounds = min(float(self._max_rounds), self._budget_s / max(self._timed_s, 1.0e-9))
        by_rounds = int(rounds) // LEAST_ROUNDS_A_PROCESS
        by_loading = 1 + int(self._loading_budget_s / max(self._loading_s, 1.0e-9))
        found = min(self._most_processes, by_rounds, by_loading)
        return found if found >= LEAST_PROCESSES else 1
