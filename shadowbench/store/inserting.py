"""Rows into the database, many at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import insert
from sqlalchemy.orm import Session

from shadowbench.rows import ResultRow
from shadowbench.store.models import LONG_MODELS, StoredRow
from shadowbench.store.records import Values, long_values
from shadowbench.store.standings import rows_were_added

_AT_ONCE = 100


def insert_rows(session: Session, rows: Sequence[ResultRow], values: Sequence[Values]) -> None:
    """Add rows with all that belongs to them to the transaction.

    Args:
        session: The transaction.
        rows: The rows.
        values: The columns of each.
    """
    table = StoredRow.__table__
    for start in range(0, len(rows), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        added = insert(table).returning(table.c.id, sort_by_parameter_order=True)
        identifiers = session.connection().execute(added, list(values[part])).scalars()
        lines: dict[str, list[dict[str, Any]]] = {}
        for row, row_id in zip(rows[part], identifiers, strict=True):
            for name, found in long_values(row, row_id).items():
                lines.setdefault(name, []).extend(found)
        for name, found in lines.items():
            if found:
                session.connection().execute(insert(LONG_MODELS[name].__table__), found)  # type: ignore[attr-defined]
    rows_were_added(session, values)
