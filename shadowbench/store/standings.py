"""Standings, kept beside the rows: in the same transaction, by whoever changes rows.

The newest row of a technique in a view, on a machine and with a version stands for the others. Which one that is, is
looked up again, by an index, for every key that a row was added to or taken from: however rows came and went, standings
are those of the rows that are there. A leaderboard then reads a few hundred narrow rows that lie side by side, however
many runs there are.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from sqlalchemy import BindParameter, bindparam, delete, insert, literal_column, select
from sqlalchemy.orm import Session

from shadowbench.store.derived import STANDING_COLUMNS, STANDING_KEY
from shadowbench.store.models import StoredRow, StoredStanding

Key = tuple[str, ...]
"""The values of :data:`~shadowbench.store.derived.STANDING_KEY`."""

_ROWS = StoredRow.__table__.c
_STANDINGS = StoredStanding.__table__.c

_bound: dict[str, BindParameter[str]] = {name: bindparam(f"of_{name}") for name in STANDING_KEY}
_CLEARED = delete(StoredStanding.__table__).where(*(_STANDINGS[name] == value for name, value in _bound.items()))
_FILLED = insert(StoredStanding.__table__).from_select(
    [*STANDING_KEY, "row_id", *STANDING_COLUMNS],
    select(*(_ROWS[name] for name in (*STANDING_KEY, "id", *STANDING_COLUMNS)))
    .where(*(_ROWS[name] == value for name, value in _bound.items()))
    .order_by(_ROWS.measured_at.desc(), _ROWS.id.desc())
    .limit(literal_column("1")),
)


def rows_were_added(session: Session, values: Collection[Mapping[str, Any]]) -> None:
    """Bring standings up to date with rows that were added in this transaction.

    Args:
        session: The transaction.
        values: The columns of each row.
    """
    settle(session, {tuple(row[name] for name in STANDING_KEY) for row in values})


def delete_rows(session: Session, condition: Any) -> None:
    """Delete rows with all that belongs to them, and let the next newest stand where they stood.

    Args:
        session: The transaction.
        condition: Which rows.
    """
    held = select(*(_STANDINGS[name] for name in STANDING_KEY)).join(StoredRow.__table__).where(condition)
    keys = {tuple(key) for key in session.execute(held)}
    session.execute(delete(StoredRow.__table__).where(condition))
    settle(session, keys)


def settle(session: Session, keys: Collection[Key]) -> None:
    """Look up again which rows stand for these keys, whatever may have changed that in this transaction."""
    if keys:
        given = [{f"of_{name}": value for name, value in zip(STANDING_KEY, key, strict=True)} for key in sorted(keys)]
        session.connection().execute(_CLEARED, given)
        session.connection().execute(_FILLED, given)
