"""How values grow with what an experiment sweeps, a paper's printed values beside ours: the plots of its tables.

A table that sweeps a number (triangles, a map's resolution) over three values or more becomes plots over that number,
one for each unit of its values. Where there are more series than one plot can tell apart, each value of another
parameter gets a plot of its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from shadowbench.experiment import TableLayout
from shadowbench.report.chart import STYLE_COUNT, Axis, Plot, Point, Series, tick_text
from shadowbench.rows import Outcome, ResultRow, RunRecord
from shadowbench.tables.columns import MEASURE, header_text, header_unit, interval_of, unit_of, value_of
from shadowbench.tables.labels import Labels
from shadowbench.tables.numbers import MEBIBYTE, number_text
from shadowbench.tables.printed import matches

MOST_PLOTS = 12
"""Plots of one table."""

_LEAST_VALUES = 3
_BESIDE = ("light", "camera", "size", "threads", "device")


@dataclass(frozen=True)
class _Sample:
    """One value of one case, and the printed one beside it."""

    row: ResultRow
    column: str
    x: float
    value: float
    printed: float | None
    series: str


def growth_plots(
    run: RunRecord, layout: TableLayout, rows: Sequence[ResultRow], anchors: Mapping[str, str]
) -> list[Plot]:
    """Return the plots of one table, none if it sweeps no number.

    Args:
        run: The run.
        layout: The table's layout.
        rows: The experiment's rows.
        anchors: Case key -> anchor in the page.
    """
    measured = [row for row in rows if row.outcome is Outcome.OK and matches(row, layout.where)]
    swept = _swept(layout, measured)
    if not swept:
        return []
    samples = _samples(run, layout, measured, swept)
    plots = []
    for unit in dict.fromkeys(unit_of(sample.column) for sample in samples):
        same_unit = [sample for sample in samples if unit_of(sample.column) == unit]
        for facet, group in _facets(layout, same_unit, swept):
            plot = _plot(layout, swept, unit, facet, group, anchors)
            if plot is not None:
                plots.append(plot)
    return plots[:MOST_PLOTS]


def _swept(layout: TableLayout, rows: Sequence[ResultRow]) -> str:
    """Return the number that the table sweeps: its pivot if that is one, else the index with most values.

    Of two with as many, the one that goes farther.
    """
    found: dict[str, tuple[int, float]] = {}
    for name in (*([layout.columns] if layout.columns else []), *layout.index):
        held = {value_of(row, name) for row in rows} if name not in (MEASURE, "method", "scene") else set()
        values = [value for value in held if isinstance(value, int | float) and _is_positive(value)]
        if len(values) == len(held) >= _LEAST_VALUES:
            found[name] = (len(values), max(values) / min(values))
    if layout.columns in found:
        return layout.columns or ""
    return max(found, key=lambda name: found[name], default="")


def _is_positive(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and value > 0


def _samples(run: RunRecord, layout: TableLayout, rows: Sequence[ResultRow], swept: str) -> list[_Sample]:
    columns = (swept,)
    methods = Labels("method", rows, with_columns=columns, defaults=run.method_defaults)
    scenes = Labels("scene", rows, with_columns=columns)
    beside = [name for name in _BESIDE if len({value_of(row, name) for row in rows}) > 1 and name != swept]
    one_method = len({methods.of(row) for row in rows}) == 1
    one_scene = len({scenes.of(row) for row in rows}) == 1
    values = [name for name in layout.values if unit_of(name)]
    found = []
    for row in rows:
        x = value_of(row, swept)
        place = [] if one_method and len(values) > 1 else [methods.of(row)]
        place += [] if one_scene else [scenes.of(row)]
        place += [f"{name} {value_of(row, name)}" for name in beside]
        for name in values:
            value = value_of(row, name)
            if _is_positive(value) and isinstance(x, int | float) and isinstance(value, int | float):
                printed = next(
                    (p.values[name] for p in layout.printed if name in p.values and matches(row, p.where)), None
                )
                own = [header_text(name)] if len({unit_of(v) for v in values}) < len(values) else []
                series = ", ".join([*own, *place]) or header_text(name)
                found.append(_Sample(row, name, float(x), float(value), printed, series))
    return found


def _facets(layout: TableLayout, samples: Sequence[_Sample], swept: str) -> list[tuple[str, list[_Sample]]]:
    """Return the samples of one plot each: all, or those that share a value of another index, or a column."""
    if len({sample.series for sample in samples}) <= STYLE_COUNT:
        return [("", list(samples))]
    groupings = [
        {sample.row.case_key + sample.column: f"{header_text(name)} {value_of(sample.row, name)}" for sample in samples}
        for name in (*layout.index, *([layout.columns] if layout.columns else []))
        if name not in (MEASURE, "method", "scene", swept)
    ]
    groupings.append({s.row.case_key + s.column: header_text(s.column) for s in samples})
    groupings.append({s.row.case_key + s.column: s.row.method for s in samples})
    best: list[tuple[str, list[_Sample]]] = []
    for grouping in groupings:
        groups: dict[str, list[_Sample]] = {}
        for sample in samples:
            groups.setdefault(grouping[sample.row.case_key + sample.column], []).append(sample)
        best = list(groups.items())
        if all(len({sample.series for sample in group}) <= STYLE_COUNT for group in groups.values()):
            break
    return best


def _plot(
    layout: TableLayout,
    swept: str,
    unit: str,
    facet: str,
    samples: Sequence[_Sample],
    anchors: Mapping[str, str],
) -> Plot | None:
    by_series: dict[str, dict[float, _Sample]] = {}
    for sample in samples:
        by_series.setdefault(sample.series, {}).setdefault(sample.x, sample)
    if max((len(found) for found in by_series.values()), default=0) < _LEAST_VALUES:
        return None
    names = list(by_series)[:STYLE_COUNT]
    series: list[Series] = []
    for style, name in enumerate(names):
        line = sorted(by_series[name].values(), key=lambda sample: sample.x)
        series.append(Series(name, style, tuple(_measured(s, anchors) for s in line)))
        printed = tuple(_printed(s, s.printed) for s in line if s.printed is not None and s.printed > 0.0)
        if printed:
            series.append(Series(f"{name}, printed", style, printed, is_printed=True))
    notes = [f"{len(by_series) - len(names)} more series are in the table"] if len(by_series) > len(names) else []
    if any(s.is_printed for s in series):
        notes.append("hollow and dashed: printed by the paper")
    shown = header_unit(samples[0].column)
    columns = list(dict.fromkeys(header_text(sample.column) for sample in samples))
    quantity = columns[0] if len(columns) == 1 else "time" if unit == "ms" else "count" if unit == "1" else "value"
    return Plot(
        title=f"{layout.title}: {quantity} over {header_text(swept)}" + (f", {facet}" if facet else ""),
        x=Axis(header_text(swept) + (f" [{header_unit(swept)}]" if header_unit(swept) else ""), is_log=True),
        y=Axis(quantity + (f" [{shown}]" if shown and shown != "1" else ""), is_log=True),
        series=tuple(series),
        summary="; ".join(_growth(s) for s in series if not s.is_printed and len(s.points) > 1) + ".",
        notes=tuple(notes),
    )


def _growth(series: Series) -> str:
    """Say from what to what a series goes, and the exponent between its ends."""
    first, last = series.points[0], series.points[-1]
    exponent = math.log(last.y / first.y) / math.log(last.x / first.x)
    return f"{series.name}: {number_text(first.y, 'ms')} to {number_text(last.y, 'ms')}, exponent {exponent:.2f}"


def _shown(sample: _Sample, value: float) -> float:
    return value / MEBIBYTE if unit_of(sample.column) == "bytes" else value


def _measured(sample: _Sample, anchors: Mapping[str, str]) -> Point:
    low, high = interval_of(sample.row, sample.column) or (sample.value, sample.value)
    y = _shown(sample, sample.value)
    text = number_text(sample.value, unit_of(sample.column), thousands=True)
    unit = header_unit(sample.column)
    label = f"{sample.series}: {text}{f' {unit}' if unit and unit != '1' else ''} at {tick_text(sample.x)}"
    anchor = anchors.get(sample.row.case_key, "")
    return Point(sample.x, y, _shown(sample, low), _shown(sample, high), sample.x, sample.x, label, anchor)


def _printed(sample: _Sample, value: float) -> Point:
    y = _shown(sample, value)
    label = f"{sample.series}: {value:g} printed at {tick_text(sample.x)}"
    return Point(sample.x, y, y, y, sample.x, sample.x, label)
