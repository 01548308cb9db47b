"""What a chart is before it is drawn: :mod:`.svg` draws it for the page, :mod:`.figures` for papers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

STYLE_COUNT = 8
"""Series are told apart by colour, marker and dash, which repeat after so many."""


@dataclass(frozen=True)
class Point:
    """A value, with its 95 % interval where it has one.

    Attributes:
        x, y: Position, in the axes' units.
        low, high: Interval of ``y``; equal to it where there is none.
        left, right: Interval of ``x``; likewise.
        label: What a reader is told who points at it.
        anchor: The case's id in the page, empty for none (a printed value).
        name: What stands beside the point, empty for nothing.
    """

    x: float
    y: float
    low: float
    high: float
    left: float
    right: float
    label: str
    anchor: str = ""
    name: str = ""


@dataclass(frozen=True)
class Series:
    """Points of one kind.

    Attributes:
        name: As the legend has it.
        style: Which of the colours, markers and dashes.
        points: In the order of the line.
        is_line: Whether they are joined.
        is_printed: Whether a paper printed them: hollow and dashed, in the colours of the measured ones.
        is_faint: Whether they recede behind the others.
    """

    name: str
    style: int
    points: tuple[Point, ...]
    is_line: bool = True
    is_printed: bool = False
    is_faint: bool = False


@dataclass(frozen=True)
class Axis:
    """An axis and its scale.

    Attributes:
        label: With the unit.
        is_log: Logarithmic; a value of 0 then stands on a line of its own below the others.
    """

    label: str
    is_log: bool


@dataclass(frozen=True)
class Plot:
    """Points in a plane.

    Attributes:
        title: Heading, and the name of the figure's file.
        summary: For readers who hear the page.
        notes: What is said below it.
    """

    title: str
    x: Axis
    y: Axis
    series: tuple[Series, ...]
    summary: str = ""
    notes: tuple[str, ...] = ()

    @property
    def points(self) -> list[Point]:
        """All points."""
        return [point for series in self.series for point in series.points]


@dataclass(frozen=True)
class Bar:
    """Parts that add up to one length.

    Attributes:
        label: The case.
        parts: Durations, one for each of the chart's part names [ms].
        low, high: 95 % interval of the whole, ``None`` where it has none [ms].
        text: The whole, as text.
        anchor: The case's id in the page.
    """

    label: str
    parts: tuple[float, ...]
    low: float | None
    high: float | None
    text: str
    anchor: str

    @property
    def total(self) -> float:
        """The bar's length [ms]."""
        return sum(self.parts)


@dataclass(frozen=True)
class Bars:
    """Stacked bars, one a case."""

    title: str
    axis: Axis
    part_names: tuple[str, ...]
    part_styles: tuple[int, ...]
    bars: tuple[Bar, ...]
    summary: str = ""
    notes: tuple[str, ...] = ()


Chart = Plot | Bars

REST_STYLE, CAMERA_STYLE = -1, -2
"""Styles of parts that are no stage of the method: what no stage explains, and the camera pass."""


@dataclass(frozen=True)
class Scale:
    """Maps values to positions on an axis of ``length`` pixels.

    Attributes:
        low, high: Ends of the axis; powers of ten need not be.
        zero_room: Pixels at the axis' beginning that are kept for values of 0 on a logarithmic axis.
    """

    low: float
    high: float
    length: float
    is_log: bool
    zero_room: float = 0.0

    def at(self, value: float) -> float:
        """Return the position of a value [pixels]; values beyond an end stand at it."""
        if self.is_log:
            if value <= 0.0:
                return 0.0
            share = math.log(value / self.low) / math.log(self.high / self.low)
        else:
            share = (value - self.low) / (self.high - self.low)
        return self.zero_room + min(max(share, 0.0), 1.0) * (self.length - self.zero_room)

    def ticks(self) -> list[float]:
        """Return the values to mark, 0 on a logarithmic axis that has room for it included."""
        found = _log_ticks(self.low, self.high) if self.is_log else _linear_ticks(self.low, self.high)
        return [0.0, *found] if self.zero_room else found


def scale_of(values: Iterable[float], length: float, *, is_log: bool, zero_room: float = 0.0) -> Scale:
    """Return a scale that holds all finite values, with a margin."""
    finite = [value for value in values if math.isfinite(value)]
    if not is_log:
        high = max([*finite, 0.0]) or 1.0
        return Scale(min([*finite, 0.0]), high * 1.05, length, is_log=False)
    positive = [value for value in finite if value > 0.0] or [1.0]
    low, high = min(positive), max(positive)
    margin = (high / low) ** 0.06 if high > low * 1.2 else 1.5
    has_zero = any(value == 0.0 for value in finite)
    return Scale(low / margin, high * margin, length, is_log=True, zero_room=zero_room if has_zero else 0.0)


def are_ticks(values: Sequence[float], scale: Scale, *, apart: float) -> bool:
    """Return whether the values themselves can be marked: few, short and apart, as those of a sweep are."""
    places = [scale.at(value) for value in values]
    are_short = all(value == float(f"{value:.4g}") for value in values)
    return 1 < len(values) <= 7 and are_short and all(b - a > apart for a, b in pairwise(places))


def _log_ticks(low: float, high: float) -> list[float]:
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    decades = last - first
    mantissas = (1.0,) if decades > 4 else (1.0, 2.0, 5.0) if decades <= 2 else (1.0, 3.0)
    step = max(1, decades // 6)
    found = [m * 10.0**power for power in range(first, last + 1, step) for m in mantissas]
    return [value for value in found if low <= value <= high]


def _linear_ticks(low: float, high: float) -> list[float]:
    rough = (high - low) / 5.0
    unit = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * unit for factor in (1.0, 2.0, 5.0, 10.0) if factor * unit >= rough)
    first = math.ceil(low / step)
    return [index * step for index in range(first, math.floor(high / step) + 1)]


def tick_text(value: float) -> str:
    """Return a tick's label, as short as it can be."""
    for limit, suffix in ((1e9, "G"), (1e6, "M"), (1e3, "K")):
        if abs(value) >= limit * 10 or (abs(value) >= limit and value % limit == 0):
            return f"{value / limit:.4g}{suffix}"
    return f"{value:.6g}" if abs(value) >= 1e-4 or value == 0.0 else f"{value:.0e}"
