"""What a row's number is known to: its value with an interval, and the ratio of two rows' numbers.

A counter, a size or a quality measure comes out the same every time: its interval is itself. A time is a median over
rounds; two times from the same interleaved rounds are compared by the ratio within each round, which a machine that
slows down does not change, and times of rounds of their own by all pairs of rounds (:mod:`shadowbench.statistics`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from shadowbench.rows import FRAME_RATES, ResultRow
from shadowbench.statistics import PairedContrast, SeparateContrast, paired, separate
from shadowbench.tables.columns import interval_of, unit_of, value_of

_PHASES = {
    "build_ms": ("build",),
    "shade_ms": ("shade",),
    "camera_ms": ("camera",),
    "static_frame_ms": ("camera", "shade"),
    "dynamic_frame_ms": ("camera", "build", "shade"),
}
"""Times that are sums of samples, round by round."""

AnyContrast = PairedContrast | SeparateContrast


@dataclass(frozen=True)
class Quantity:
    """A number and the interval that holds the true one, which is the number itself where it is exact.

    Attributes:
        value: As measured.
        low, high: 95 % interval; 0 and ``inf`` where too few rounds were taken for one.
        contrast: For a ratio of times what the rounds say, at any confidence.
    """

    value: float
    low: float
    high: float
    contrast: AnyContrast | None = field(default=None, compare=False, repr=False)

    @property
    def is_exact(self) -> bool:
        """Whether another measurement would give the same number."""
        return self.contrast is None and self.low == self.value == self.high


def exact(value: float) -> Quantity:
    """Return a number that every measurement gives."""
    value = float(value)
    return Quantity(value, value, value)


def is_time(name: str) -> bool:
    """Return whether a column holds a duration or its inverse, which no two measurements give alike."""
    return unit_of(name) in ("ms", "fps") or name == "peak_rss_bytes"


def quantity_of(row: ResultRow, name: str) -> Quantity | None:
    """Return a row's number under a column's name, or ``None`` where it has none.

    Where a row keeps no rounds of a stage, its interval is as wide, in proportion, as the wider one of its case's
    build and shade.
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
    return Quantity(float(value), *(interval or (0.0, math.inf)))


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
    if not is_time(name) and not is_time(to_name):
        return exact(one.value / other.value)
    durations, to_durations = durations_of(row, name), durations_of(to_row, to_name)
    if not durations or not to_durations or (name in FRAME_RATES) != (to_name in FRAME_RATES):
        return divided(one, other)
    if name in FRAME_RATES:  # twice as many frames in a second: half as long
        durations, to_durations = to_durations, durations
    in_same_rounds = row.comparison != "" and row.comparison == to_row.comparison
    in_same_rounds = in_same_rounds and len(durations) == len(to_durations)
    processes = row.round_processes or None
    contrast = (
        paired(durations, to_durations, processes)
        if in_same_rounds
        else separate(durations, to_durations, processes, to_row.round_processes or None)
    )
    found = contrast.interval()
    low, high = (0.0, math.inf) if found.low is None or found.high is None else (found.low, found.high)
    return Quantity(found.estimate, low, high, contrast)


def divided(one: Quantity, other: Quantity) -> Quantity:
    """Return the ratio of two numbers that are not negative, as far as their intervals tell."""
    low = one.low / other.high if other.high > 0.0 and one.low > 0.0 else 0.0
    return Quantity(one.value / other.value, low, one.high / other.low if other.low > 0.0 else math.inf)


def scaled(ratio: Quantity, factor: float) -> Quantity:
    """Return a ratio times a positive number that is exact."""
    contrast = None if ratio.contrast is None else _shifted(ratio.contrast, math.log(factor))
    return Quantity(ratio.value * factor, ratio.low * factor, ratio.high * factor, contrast)


def durations_of(row: ResultRow, name: str) -> list[float]:
    """Return a time, or the time that a frame rate is of, in every round [ms]; empty where the row keeps none."""
    if name.startswith("stages."):
        return list(row.samples.get(name, []))
    base = FRAME_RATES.get(name, name)
    if base == "static_frame_ms" and row.static_frame_ms == row.dynamic_frame_ms:
        base = "dynamic_frame_ms"  # a view-dependent method builds for every frame
    parts = [row.samples.get(phase, []) for phase in _PHASES.get(base, ())]
    if not parts or len({len(part) for part in parts}) > 1:
        return []
    return [sum(values) for values in zip(*parts, strict=True)]


def p_value(figure: Quantity, bound: float) -> float | None:
    """Return how probable a ratio as far from a bound as this one is where it is the bound; ``None`` if unknown."""
    if bound <= 0.0 or figure.contrast is None:
        return None
    return _shifted(figure.contrast, -math.log(bound)).p_value


def _shifted(contrast: AnyContrast, shift: float) -> AnyContrast:
    """Return a contrast whose ratios are larger by a factor, given as its logarithm."""
    if isinstance(contrast, PairedContrast):
        return replace(contrast, log_ratios=tuple(value + shift for value in contrast.log_ratios))
    return replace(contrast, first=tuple(value + shift for value in contrast.first))
