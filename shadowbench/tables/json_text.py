"""Tables as JSON: a list of objects with values at full precision.

::

    [{"title": "...", "experiment": "...", "run_id": "...",
      "columns": [{"name": "method", "text": "method", "unit": "", "role": "index"},
                  {"name": "build_ms", "text": "build", "unit": "ms", "role": "value"}],
      "body": [[{"value": "pcf"}, {"value": 1.25, "low": 1.2, "high": 1.3}],
               [{"value": "vsm"}, {"outcome": "crash", "reason": "..."}]],
      "notes": ["..."]}]

``unit`` is that of the values, bytes where a printed table shows MiB; it stands at the value where each line has its
own (index column ``measure``). A value that does not apply is ``null``.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from shadowbench.tables.columns import finite, unit_of
from shadowbench.tables.table import Cell, Header, Table


def as_json(tables: Sequence[Table]) -> str:
    """Return the tables as a JSON list; it is ASCII and has no NaN or infinity."""
    return json.dumps([_table(table) for table in tables], indent=1, allow_nan=False) + "\n"


def _table(table: Table) -> dict[str, Any]:
    columns = [
        {
            "name": header.name,
            "text": header.text,
            "unit": unit_of(header.column),
            "role": "index" if position < len(table.index) else "value",
        }
        for position, header in enumerate(table.headers)
    ]
    return {
        "title": table.title,
        "experiment": table.experiment,
        "run_id": table.run_id,
        "columns": columns,
        "body": [[_cell(*pair) for pair in zip(line, table.headers, strict=True)] for line in table.body],
        "notes": list(table.notes),
    }


def _cell(cell: Cell, header: Header) -> dict[str, Any]:
    if cell.outcome is not None:
        return {"outcome": cell.outcome.value, "reason": cell.reason}
    found: dict[str, Any] = {"value": finite(cell.value)}
    if cell.interval is not None:
        found["low"], found["high"] = (finite(end) for end in cell.interval)
    if cell.unit and not header.column:
        found["unit"] = cell.unit
    return found
