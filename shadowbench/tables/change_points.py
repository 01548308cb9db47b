"""Where a series of measurements changes its level: a method's times, from run to run.

Binary segmentation: the place where the ranks before and after differ most (the standardised rank sum of Wilcoxon and
Mann-Whitney) is a change point if hardly any of many shuffled series has a place that differs as much; then each side
is looked at by itself. Ranks do not care how times are distributed, and one run that went wrong is no change.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

LEAST_LENGTH = 4
"""A level lasts at least so many measurements."""

_SHUFFLES = 199
_LEVEL = 0.02
_LONGEST = 2000


def change_points(values: Sequence[float]) -> list[int]:
    """Return the places at which a new level begins, in ascending order; the same for the same values.

    Args:
        values: In order of time. Of very many only the last 2000 are looked at.
    """
    offset = max(0, len(values) - _LONGEST)
    series = np.asarray(values[offset:], dtype=np.float64)
    found: list[int] = []
    waiting = [(0, len(series))]
    while waiting:
        start, end = waiting.pop()
        place = _change(series[start:end])
        if place is not None:
            found.append(offset + start + place)
            waiting += [(start, start + place), (start + place, end)]
    return sorted(found)


def _change(series: NDArray[Any]) -> int | None:
    if len(series) < 2 * LEAST_LENGTH:
        return None
    ranks = _ranks(series)
    differences = _rank_differences(ranks[None])[0]
    place = int(np.argmax(differences))
    generator = np.random.default_rng(len(series))
    shuffled = generator.permuted(np.repeat(ranks[None], _SHUFFLES, axis=0), axis=1)
    as_large = int((_rank_differences(shuffled).max(axis=1) >= differences[place]).sum())
    return place + LEAST_LENGTH if (as_large + 1) / (_SHUFFLES + 1) <= _LEVEL else None


def _ranks(series: NDArray[Any]) -> NDArray[Any]:
    """Ranks from 1, the mean of their ranks for equal values."""
    _, place, count = np.unique(series, return_inverse=True, return_counts=True)
    last = np.cumsum(count)
    mean: NDArray[Any] = (last - (count - 1) / 2.0)[place]
    return mean


def _rank_differences(ranks: NDArray[Any]) -> NDArray[Any]:
    """For every place that leaves both sides long enough: how far the rank sum before it is from what is expected.

    In standard deviations; ``ranks`` has one series a row.
    """
    length = ranks.shape[1]
    before = np.arange(LEAST_LENGTH, length - LEAST_LENGTH + 1)
    sums = np.cumsum(ranks, axis=1)[:, before - 1]
    deviation = np.sqrt(before * (length - before) / (length - 1.0) * ranks.var(axis=1, keepdims=True))
    deviation = np.where(deviation > 0.0, deviation, np.inf)
    found: NDArray[Any] = np.abs(sums - before * (length + 1) / 2.0) / deviation
    return found
