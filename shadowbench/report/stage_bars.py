"""Where the time of a frame goes: one stacked bar a case, the camera pass first, then the method's stages."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from shadowbench.report import wording
from shadowbench.report.chart import CAMERA_STYLE, REST_STYLE, STYLE_COUNT, Axis, Bar, Bars
from shadowbench.rows import Outcome, ResultRow

MOST_BARS = 40
"""Bars of one chart; of more cases the quickest are shown."""

_CAMERA, _REST, _OTHERS = "camera pass", "not in any stage", "other stages"


def stage_styles(rows: Sequence[ResultRow]) -> dict[str, int]:
    """Return the style of each of the stages that take most of an experiment's time; the rest share one."""
    weight: Counter[str] = Counter()
    for row in rows:
        weight.update(_stages(row))
    most = STYLE_COUNT if len(weight) <= STYLE_COUNT else STYLE_COUNT - 1
    kept = {name for name, _ in weight.most_common(most)}
    return {name: style for style, name in enumerate(name for name in weight if name in kept)}


def stage_bars(
    title: str, rows: Sequence[ResultRow], names: Mapping[str, tuple[str, str]], styles: Mapping[str, int]
) -> Bars | None:
    """Return the chart of a view's cases, or ``None`` if none has a duration.

    Args:
        title: The view.
        rows: Its rows, whatever their outcome.
        names: Case key -> label and anchor in the page.
        styles: Stage -> style, as :func:`stage_styles` gives them.
    """
    timed = [row for row in rows if row.outcome is Outcome.OK and row.dynamic_frame_ms is not None]
    if not timed:
        return None
    shown = sorted(sorted(timed, key=_duration)[:MOST_BARS], key=timed.index)
    found = dict.fromkeys(name for row in shown for name in _stages(row))
    stages = [name for name in styles if name in found]
    others = any(name not in styles for name in found)
    notes = [f"the {MOST_BARS} quickest of {len(timed)} cases"] if len(timed) > MOST_BARS else []
    untimed = len(rows) - len(timed)
    if untimed:
        notes.append(f"{untimed} {'case has' if untimed == 1 else 'cases have'} no time")
    bars = tuple(_bar(row, stages, *names[row.case_key]) for row in shown)
    fastest = min(bars, key=lambda bar: bar.total)
    return Bars(
        title=f"Where a dynamic frame's time goes: {title}",
        axis=Axis("dynamic frame [ms]", is_log=False),
        part_names=(_CAMERA, *stages, *([_OTHERS] if others else []), _REST),
        part_styles=(
            CAMERA_STYLE,
            *(styles[name] for name in stages),
            *([STYLE_COUNT - 1] if others else []),
            REST_STYLE,
        ),
        bars=bars if others else tuple(replace(bar, parts=(*bar.parts[:-2], bar.parts[-1])) for bar in bars),
        summary=f"{len(bars)} cases; the quickest is {fastest.label} with {fastest.text}.",
        notes=(*notes, "whiskers: 95 % interval of the whole frame; parts are medians"),
    )


def _duration(row: ResultRow) -> float:
    return row.dynamic_frame_ms or 0.0


def _stages(row: ResultRow) -> dict[str, float]:
    """Return the stages that have a duration."""
    return {name: value for name, value in row.stages.items() if math.isfinite(value) and value > 0.0}


def _bar(row: ResultRow, stages: Sequence[str], label: str, anchor: str) -> Bar:
    """Return a bar: camera pass, the stages, all other stages, what no stage explains."""
    total = (row.build_ms or 0.0) + (row.shade_ms or 0.0)
    durations = _stages(row)
    others = sum(value for name, value in durations.items() if name not in stages)
    rest = max(0.0, total - sum(durations.values()))
    return Bar(
        label=label,
        parts=(row.camera_ms or 0.0, *(durations.get(name, 0.0) for name in stages), others, rest),
        low=row.dynamic_frame_ms_low,
        high=row.dynamic_frame_ms_high,
        text=wording.milliseconds(row.dynamic_frame_ms),
        anchor=anchor,
    )
