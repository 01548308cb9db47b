"""How much times differ on this machine without reason: the same calculation against itself, as cases are measured.

Two fresh processes at a time do a fixed calculation in turn, for some rounds, then two others. What the rounds' ratios
scatter by is the noise of a round; what the processes' medians scatter by beyond that is the noise of a process.
Together they say from which difference on a comparison of so many rounds can show it.
"""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from statistics import median, variance

from shadowbench.statistics import PairedContrast, paired

PROCESSES = 5
ROUNDS_A_PROCESS = 12

DEFAULT_ROUNDS = 30
"""Of a run whose budget holds them."""

_CALCULATION = """
import sys, time
for line in sys.stdin:
    begin, state = time.perf_counter(), 1
    for _ in range(40000):
        state = state * 1664525 + 1013904223 & 0xFFFFFFFF
    print((time.perf_counter() - begin) * 1e3, flush=True)
"""

_NORMAL_MAD = 1.4826
"""Standard deviation of normal values in units of their median distance from the median."""

_MEDIAN_VARIANCE = math.pi / 2.0
"""Variance of a median of many normal values in units of that of their mean."""

Sampler = Callable[[int, int], tuple[list[float], list[float], list[int]]]
"""Processes and rounds in each -> both sides' durations by round, and each round's process."""


@dataclass(frozen=True)
class Noise:
    """What log-ratios of equal cases scatter by.

    Attributes:
        of_rounds: Standard deviation from round to round.
        of_processes: The same from process to process.
    """

    of_rounds: float
    of_processes: float

    def smallest_difference(self, rounds: int, processes: int) -> float:
        """Return the half width of the 95 % interval of a ratio: a smaller difference is hardly ever shown.

        Args:
            rounds: All together.
            processes: That they are divided among, at least 2.
        """
        from scipy.special import stdtrit

        error = math.sqrt(self.of_processes**2 / processes + _MEDIAN_VARIANCE * self.of_rounds**2 / rounds)
        return math.expm1(float(stdtrit(processes - 1, 0.975)) * error)

    def rounds_for(self, difference: float, processes: int) -> int | None:
        """Return how many rounds show a difference, or ``None`` if no number does with so few processes."""
        from scipy.special import stdtrit

        error = math.log1p(difference) / float(stdtrit(processes - 1, 0.975))
        left = error**2 - self.of_processes**2 / processes
        if left <= 0.0:
            return None
        return max(processes, math.ceil(_MEDIAN_VARIANCE * self.of_rounds**2 / left))


def measured_noise(sampler: Sampler | None = None) -> Noise:
    """Measure the machine's noise; takes about a second.

    Args:
        sampler: Takes the samples, in the place of this machine.
    """
    first, second, processes = (sampler or take_samples)(PROCESSES, ROUNDS_A_PROCESS)
    return noise_of(paired(first, second, processes))


def noise_of(contrast: PairedContrast) -> Noise:
    """Return what the ratios of two equal cases scatter by; a few far outliers do not count."""
    groups: dict[int, list[float]] = {}
    for value, process in zip(contrast.log_ratios, contrast.processes, strict=True):
        groups.setdefault(process, []).append(value)
    medians = {process: median(values) for process, values in groups.items()}
    pairs = zip(contrast.log_ratios, contrast.processes, strict=True)
    rounds_a_process = len(contrast.log_ratios) / len(groups)
    of_few = rounds_a_process / (rounds_a_process - 0.8)  # Croux & Rousseeuw 1992
    of_rounds = _NORMAL_MAD * of_few * median(abs(value - medians[process]) for value, process in pairs)
    of_a_median = _MEDIAN_VARIANCE * of_rounds**2 * len(groups) / len(contrast.log_ratios)
    return Noise(of_rounds, math.sqrt(max(0.0, variance(medians.values()) - of_a_median)))


def take_samples(processes: int, rounds: int) -> tuple[list[float], list[float], list[int]]:
    """Take samples on this machine; see :data:`Sampler`."""
    sides: tuple[list[float], list[float]] = [], []
    numbers: list[int] = []
    for process in range(processes):
        with ExitStack() as stack:
            pair = [stack.enter_context(_started()) for _ in sides]
            for number in range(-2, rounds):  # two rounds warm up
                order = (0, 1) if number % 2 else (1, 0)
                durations = {side: _duration(pair[side]) for side in order}
                if number >= 0:
                    numbers.append(process)
                    for side in order:
                        sides[side].append(durations[side])
            for each in pair:
                each.communicate()
    return *sides, numbers


def _started() -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-I", "-S", "-c", _CALCULATION], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )


def _duration(process: subprocess.Popen[str]) -> float:
    if process.stdin is None or process.stdout is None:
        raise RuntimeError("the calculation has no pipes")
    process.stdin.write("\n")
    process.stdin.flush()
    return float(process.stdout.readline())
