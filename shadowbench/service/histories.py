"""A method over time: every measurement of it in one view, and where its level changed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from shadowbench.service.problems import Problem
from shadowbench.service.responding import Answer
from shadowbench.service.standings import labels, view_title
from shadowbench.store.catalogue import Catalogue
from shadowbench.store.derived import LIKENESSES, MEASURES, TIMES
from shadowbench.tables.change_points import change_points

COLUMNS = (*TIMES, "bytes_kept", *MEASURES, *LIKENESSES)

_WIDTH, _HEIGHT = 860, 220
_LEFT, _RIGHT, _TOP, _BOTTOM = 70, 12, 14, 26


def history(
    catalogue: Catalogue, method: str, *, experiment: str, view: str, machine: str, technique: str, measure: str
) -> Answer:
    """Return the history of a method.

    Args:
        catalogue: Where from.
        method: Its name.
        experiment, view, machine, technique: Which measurements; the first or newest that there are if empty.
        measure: Which column.

    Raises:
        Problem: There is nothing of the kind.
    """
    if measure not in COLUMNS:
        detail = f"query.measure: there is no such column; known are {', '.join(COLUMNS)}"
        raise Problem(422, detail, place="query.measure")
    experiments = catalogue.experiments_of(method)
    chosen = experiment or next(iter(experiments), "")
    views = catalogue.views_of(method, chosen) if chosen in experiments else []
    chosen_view = next((one for one in views if one.view_key == view or not view), None)
    if chosen_view is None:
        raise Problem(404, "no run has such a row of a method of this name")
    ends = ("_low", "_high") if measure in TIMES else ()
    columns = ("run_id", "case_key", "technique_key", "machine", "code_version", "measured_at", "outcome")
    rows = catalogue.history(method, chosen, chosen_view.view_key, (*columns, measure, *(measure + e for e in ends)))
    techniques = {
        key: fields
        for key, fields in catalogue.techniques(chosen, chosen_view.view_key).items()
        if fields["method"] == method
    }
    named = labels(techniques)
    key = technique if technique in techniques else rows[-1].technique_key
    own = [row for row in rows if row.technique_key == key]
    machines = list(dict.fromkeys(row.machine for row in reversed(own)))
    chosen_machine = machine if machine in machines else machines[0]
    points = [_point(row, measure, bool(ends)) for row in own if row.machine == chosen_machine]
    changes = _mark_changes(points, exact=measure not in TIMES)
    document = {
        "method": method,
        "experiment": chosen,
        "view": {"key": chosen_view.view_key, "title": view_title(chosen_view.fields)} | chosen_view.fields,
        "technique": {"key": key, "label": named[key]} | techniques[key],
        "machine": chosen_machine,
        "measure": measure,
        "experiments": experiments,
        "views": [{"key": one.view_key, "title": view_title(one.fields)} for one in views],
        "techniques": [{"key": each, "label": label} for each, label in named.items()],
        "machines": machines,
        "points": points,
        "changes": changes,
    }
    header = ("measured_at", "code_version", "run_id", "case_key", "outcome", "value", "low", "high", "is_change")
    lines = [[point[name] for name in header] for point in points]
    return Answer("history.html", document, header, lines, {"chart": _chart(points), "columns": COLUMNS})


def _point(row: Any, measure: str, has_interval: bool) -> dict[str, Any]:
    return {
        "measured_at": row.measured_at,
        "code_version": row.code_version,
        "run_id": row.run_id,
        "case_key": row.case_key,
        "outcome": row.outcome,
        "value": getattr(row, measure),
        "low": getattr(row, f"{measure}_low") if has_interval else None,
        "high": getattr(row, f"{measure}_high") if has_interval else None,
        "is_change": False,
    }


def _mark_changes(points: list[dict[str, Any]], *, exact: bool) -> list[dict[str, Any]]:
    """Mark where a new level begins: of what repeats exactly wherever it differs, of times where ranks say so."""
    measured = [point for point in points if point["value"] is not None]
    values = [point["value"] for point in measured]
    if exact:
        places = [place for place in range(1, len(values)) if values[place] != values[place - 1]]
    else:
        places = change_points(values)
    bounds = [0, *places, len(values)]
    found = []
    for number, place in enumerate(places, 1):
        measured[place]["is_change"] = True
        before = _median(values[bounds[number - 1] : place])
        after = _median(values[place : bounds[number + 1]])
        found.append({**measured[place], "before": before, "after": after, "ratio": after / before if before else None})
    return found


def _median(values: Sequence[float]) -> float:
    ordered = sorted(values)
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else 0.5 * (ordered[middle - 1] + ordered[middle])


def _chart(points: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return where everything of the chart lies [pixels]."""
    measured = [point for point in points if point["value"] is not None]
    spread = [v for p in measured for v in (p["value"], p["low"], p["high"]) if v is not None] or [0.0, 1.0]
    low, high = min(spread), max(spread)
    room = (high - low) * 0.08 or abs(high) * 0.1 or 1.0
    low, high = (max(0.0, low - room) if low >= 0.0 else low - room), high + room
    step = (_WIDTH - _LEFT - _RIGHT) / max(1, len(measured) - 1)

    def x(number: int) -> float:
        return round(_LEFT + step * number, 1) if len(measured) > 1 else round(0.5 * (_LEFT + _WIDTH - _RIGHT), 1)

    def y(value: float) -> float:
        return round(_TOP + (high - value) / (high - low) * (_HEIGHT - _TOP - _BOTTOM), 1)

    marks = []
    for number, point in enumerate(measured):
        span = None if point["low"] is None or point["high"] is None else (y(point["low"]), y(point["high"]))
        marks.append({"x": x(number), "y": y(point["value"]), "span": span, "point": point})
    ticks = [(y(value), f"{value:.4g}") for value in _ticks(low, high)]
    return {"width": _WIDTH, "height": _HEIGHT, "marks": marks, "ticks": ticks, "left": _LEFT, "bottom": _HEIGHT - 8}


def _ticks(low: float, high: float) -> list[float]:
    power = 10.0 ** math.floor(math.log10((high - low) / 3.0))
    step = min((power * factor for factor in (1, 2, 5, 10)), key=lambda s: abs((high - low) / s - 4.0))
    first = math.ceil(low / step)
    return [step * number for number in range(first, math.floor(high / step) + 1)]
