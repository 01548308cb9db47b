"""What a row's number is known to: its value with an interval, and the ratio of two rows' numbers.

A counter, a size or a quality measure comes out the same every time: its interval is itself. A time is a median over
rounds; two times from the same interleaved rounds are compared by the ratio within each round, which a machine that
slows down does not change, and others by their intervals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from shadowbench.rows import FRAME_RATES, ResultRow
from shadowbench.tables.columns import interval_of, unit_of, value_of

_PHASES = {
    "build_ms": ("build",),
    "shade_ms": ("shade",),
    "camera_ms": ("camera",),
    "static_frame_ms": ("camera", "shade"),
    "dynamic_frame_ms": ("camera", "build", "shade"),
}
"""Times that are sums of samples, round by round."""


@dataclass(frozen=True)
class Quantity:
    """A number and the interval that holds the true one, which is the number itself where it is exact.

    Attributes:
        value: As measured.
        low, high: 95 % interval; ``-inf`` and ``inf`` for a time of which too few rounds were taken.
    """

    value: float
    low: float
    high: float

    @property
    def is_exact(self) -> bool:
        """Whether another measurement would give the same number."""
        return self.low == self.value == self.high


def exact(value: float) -> Quantity:
    """Return a number that every measurement gives."""
    return Quantity(value, value, value)


def is_time(name: str) -> bool:
    """Return whether a column holds a duration or its inverse, which no two measurements give alike."""
    return unit_of(name) in ("ms", "fps") or name == "peak_rss_bytes"


def quantity_of(row: ResultRow, name: str) -> Quantity | None:
    """Return a row's number under a column's name, or ``None`` where it has none.

    A stage's interval is as wide, in proportion, as the wider one of its case's build and shade.
    """
    value = value_of(row, name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    if not is_time(name):
        return exact(float(value))
    interval = interval_of(row, name)
    if interval is None and name.startswith("stages."):
        spread = [_spread(row, phase) for phase in ("build_ms", "shade_ms")]
        below, above = (max(found) for found in zip(*spread, strict=True))
        interval = (value / below, value * above)
    return Quantity(float(value), *(interval or (-math.inf, math.inf)))


def _spread(row: ResultRow, name: str) -> tuple[float, float]:
    """Return by which factors a time may be smaller and larger than measured."""
    value, interval = value_of(row, name), interval_of(row, name)
    if not isinstance(value, int | float) or not value or interval is None:
        return (1.0, 1.0) if not value else (math.inf, math.inf)
    return value / interval[0] if interval[0] > 0.0 else math.inf, interval[1] / value


def ratio_of(row: ResultRow, name: str, to_row: ResultRow, to_name: str) -> Quantity | None:
    """Return the ratio of two rows' numbers, or ``None`` where one is missing or the second is 0."""
    one, other = quantity_of(row, name), quantity_of(to_row, to_name)
    if one is None or other is None or other.value == 0.0:
        return None
    if one.is_exact and other.is_exact:
        return exact(one.value / other.value)
    rounds, to_rounds = series_of(row, name), series_of(to_row, to_name)
    in_same_rounds = row.comparison and row.comparison == to_row.comparison and len(rounds) == len(to_rounds)
    if in_same_rounds and rounds and min(*rounds, *to_rounds) > 0.0:
        return _by_round([a / b for a, b in zip(rounds, to_rounds, strict=True)])
    low = one.low / other.high if other.high > 0.0 and one.low > 0.0 else 0.0
    return Quantity(one.value / other.value, low, one.high / other.low if other.low > 0.0 else math.inf)


def series_of(row: ResultRow, name: str) -> list[float]:
    """Return a time of every round, in the column's unit; empty where rows keep none."""
    base = FRAME_RATES.get(name, name)
    if base == "static_frame_ms" and row.static_frame_ms == row.dynamic_frame_ms:
        base = "dynamic_frame_ms"  # a view-dependent method builds for every frame
    parts = [row.samples.get(phase, []) for phase in _PHASES.get(base, ())]
    if not parts or len({len(part) for part in parts}) > 1:
        return []
    sums = [sum(values) for values in zip(*parts, strict=True)]
    return [1.0e3 / value for value in sums if value > 0.0] if name in FRAME_RATES else sums


def _by_round(ratios: Sequence[float]) -> Quantity:
    low, high = _median_interval(ratios)
    return Quantity(median(ratios), low, high)


def _median_interval(samples: Sequence[float]) -> tuple[float, float]:
    """Return the distribution-free interval of a median, of at least 95 %: that of the sign test."""
    ordered = sorted(samples)
    count, tail, rank = len(ordered), 0.0, 0
    while rank < count // 2:
        tail += math.comb(count, rank) / 2.0**count
        if 2.0 * tail > 0.05:
            break
        rank += 1
    return (ordered[rank - 1], ordered[count - rank]) if rank else (0.0, math.inf)
