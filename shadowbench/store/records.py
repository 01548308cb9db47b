"""A :class:`~shadowbench.rows.ResultRow` or :class:`~shadowbench.rows.RunRecord` as database values, and back.

What comes back equals what went in, but for what no database or JSON can hold: a number that is not finite becomes
null (``None``; NaN in stages and samples), and a lone surrogate or NUL in a text becomes its escape.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import BaseModel

from shadowbench.rows import LONG_FIELDS, LONG_UNITS, ResultRow, RunRecord
from shadowbench.store.derived import derived_values

Values = dict[str, Any]
"""Column -> value of one database row."""

_UNHOLDABLE = {code: f"\\u{code:04x}" for code in range(0xD800, 0xE000)} | {0: "\\x00"}


def run_values(run: RunRecord) -> Values:
    """Return the values of a run's columns."""
    return _holdable_values(run)


def row_values(row: ResultRow) -> Values:
    """Return the values of a row's own columns, without the long tables."""
    values = _holdable_values(row, without=LONG_FIELDS)
    return values | derived_values(values)


def long_values(row: ResultRow, row_id: int) -> dict[str, list[Values]]:
    """Return long table -> its lines for this row, with ``row_id`` as their key."""
    found: dict[str, list[Values]] = {}
    for table in LONG_FIELDS:
        unit = LONG_UNITS[table]
        lines: list[Values] = []
        for position, (name, value) in enumerate(getattr(row, table).items()):
            line = {"row_id": row_id, "position": position, "name": _holdable(name), "unit": unit}
            if table == "samples":
                lines += [line | {"round": index, "value": _holdable(sample)} for index, sample in enumerate(value)]
            else:
                lines.append(line | {"value": _holdable(value)})
        found[table] = lines
    return found


def run_from(values: Mapping[Any, Any]) -> RunRecord:
    """Return the run that :func:`run_values` wrote."""
    return RunRecord.model_validate({name: values[name] for name in RunRecord.model_fields})


def row_from(values: Mapping[Any, Any], long: Mapping[str, Iterable[tuple[str, Any]]]) -> ResultRow:
    """Return the row that :func:`row_values` and :func:`long_values` wrote.

    Args:
        values: Column -> value.
        long: Long table -> its (name, value) pairs in order of position and round.
    """
    fields = {name: values[name] for name in ResultRow.model_fields if name not in LONG_FIELDS}
    for table in LONG_FIELDS:
        pairs = long.get(table, ())
        if table == "samples":
            samples: dict[str, list[float]] = {}
            for name, value in pairs:
                samples.setdefault(name, []).append(_number_or_nan(value))
            fields[table] = samples
        elif table == "stages":
            fields[table] = {name: _number_or_nan(value) for name, value in pairs}
        else:
            fields[table] = dict(pairs)
    return ResultRow.model_validate(fields)


def _holdable_values(model: BaseModel, *, without: Iterable[str] = ()) -> Values:
    return {name: _holdable(value) for name, value in model.model_dump(mode="json", exclude=set(without)).items()}


def _holdable(value: Any) -> Any:
    """Return a JSON value that every database can hold."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, str):
        return value.translate(_UNHOLDABLE)
    if isinstance(value, dict):
        return {_holdable(key): _holdable(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_holdable(inner) for inner in value]
    return value


def _number_or_nan(value: float | None) -> float:
    return math.nan if value is None else value
