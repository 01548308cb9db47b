"""Rows and tables as CSV: UTF-8, commas, line feeds, a header line, numbers at full precision, empty for no value.

*Tidy* CSV has one line a case and every column of :class:`~shadowbench.rows.ResultRow` under its own name and in its
order, but for ``samples``, which stay in the store. Parameters, environment, warnings, stages, counters, kept and
artifacts are JSON. *Table-shaped* CSV has the lines and columns of the printed table.

A text that a spreadsheet would take for a formula (it begins with ``=``, ``+``, ``-`` or ``@``) has an apostrophe put
before it; characters that are not printable, line ends among them, are escapes, so that a line is always a line.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from typing import Any

from shadowbench.errors import UsageError
from shadowbench.rows import ResultRow
from shadowbench.tables.columns import finite
from shadowbench.tables.plain_text import plain
from shadowbench.tables.table import Cell, Table

TIDY_COLUMNS = tuple(name for name in ResultRow.model_fields if name != "samples")
"""The columns of tidy CSV."""

_STRUCTURED = frozenset(name for name in TIDY_COLUMNS if ResultRow.model_fields[name].default_factory is not None)
"""Columns whose fields are JSON."""

_FORMULA_STARTS = ("=", "+", "-", "@")


def as_tidy_csv(rows: Iterable[ResultRow]) -> str:
    """Return one line per case; a row that occurs twice is written once."""
    unique = {(row.run_id, row.experiment, row.case_key): row for row in rows}
    lines = [[_field(value) for value in _tidy_values(row)] for row in unique.values()]
    return _written([list(TIDY_COLUMNS), *lines])


def rows_of_tidy_csv(text: str, file: str) -> list[ResultRow]:
    """Return the rows that :func:`as_tidy_csv` wrote; without samples, which it leaves out.

    Args:
        text: The file's content.
        file: Its name, for messages.

    Raises:
        UsageError: The text is no such table; names file and line.
    """
    lines = csv.reader(io.StringIO(text))
    header = next(lines, [])
    unknown = [name for name in header if name not in TIDY_COLUMNS]
    if not header or unknown:
        said = f"has a column '{unknown[0]}' that no row has" if unknown else "is empty"
        raise UsageError(f"{file} {said}; it is not a table of rows that shadowbench wrote")
    rows = []
    for values in lines:
        try:
            given = {name: _parsed(name, value) for name, value in zip(header, values, strict=True)}
            rows.append(ResultRow.model_validate({name: value for name, value in given.items() if value is not None}))
        except ValueError as error:  # of pydantic and json too
            reason = next(iter(str(error).splitlines()), "")
            raise UsageError(f"{file}, line {lines.line_num}: this is no row: {reason}") from None
    return rows


def _parsed(name: str, text: str) -> Any:
    """Return a field's value; ``None`` for an empty one, whose column has its default."""
    if not text:
        return None
    if name in _STRUCTURED:
        return json.loads(text)
    return text[1:] if text.startswith("'") and text[1:].lstrip().startswith(_FORMULA_STARTS) else text


def _tidy_values(row: ResultRow) -> list[Any]:
    values = finite(row.model_dump(mode="json", exclude={"samples"}))
    return [values[name] for name in TIDY_COLUMNS]


def as_csv_tables(tables: Sequence[Table]) -> str:
    """Return the tables in their own shape, an empty line between two.

    Several tables have their titles as a line before each; a single one has none, so that any program can read it.
    """
    parts = []
    for table in tables:
        heading = [[_field(table.title)]] if len(tables) > 1 else []
        headers = [_field(header.name) for header in table.headers]
        parts.append(_written([*heading, headers, *([_cell(cell) for cell in line] for line in table.body)]))
    return "\n".join(parts)


def lines_of(lines: Iterable[Sequence[Any]]) -> str:
    """Return lines of values as CSV, each made harmless."""
    return _written([_field(value) for value in line] for line in lines)


def _cell(cell: Cell) -> str:
    if cell.outcome is not None:
        return _field(f"{cell.outcome.value}: {cell.reason}" if cell.reason else cell.outcome.value)
    return _field(cell.value)


def _field(value: Any) -> str:
    value = finite(value)
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    text = plain(value if isinstance(value, str) else json.dumps(value))
    return "'" + text if text.lstrip().startswith(_FORMULA_STARTS) else text


def _written(lines: Iterable[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    return text.getvalue()
