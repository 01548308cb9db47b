"""Which row of a results folder a CASE names: a case key or the beginning of one, alone or as RUN:CASE."""

from __future__ import annotations

from typing import TYPE_CHECKING

from shadowbench.errors import UsageError
from shadowbench.rows import ResultRow, method_label

if TYPE_CHECKING:
    from shadowbench.store import Store

MOST_LISTED = 5
"""Cases that a message names."""


def find_case(store: Store, selector: str) -> ResultRow:
    """Return the row that a selector names; of several runs with that case, the newest one's.

    Args:
        store: The open results folder.
        selector: ``CASE`` or ``RUN:CASE``: a case key or the beginning of one, a run's id, its beginning, or
            ``latest``.

    Raises:
        UsageError: No case has this key, or cases of different keys begin with it.
        StoreError: No such run.
    """
    run, colon, key = selector.rpartition(":")
    runs = [store.find_run(run)] if colon else store.runs()
    if not key:
        raise UsageError("a case is named by its key or the beginning of it; 'shadowbench table --format csv' has them")
    found: dict[str, str] = {}
    for record in runs:
        for case_key in store.finished_case_keys(record.run_id):
            if case_key.startswith(key):
                found.setdefault(case_key, record.run_id)
    if not found:
        where = f"run {runs[0].run_id}" if colon else str(store.folder)
        raise UsageError(f"{where} has no case whose key begins with '{key}'")
    if len(found) > 1:
        listed = [_described(store, found[case_key], case_key) for case_key in sorted(found)[:MOST_LISTED]]
        more = ", ..." if len(found) > MOST_LISTED else ""
        raise UsageError(f"{len(found)} cases begin with '{key}': {', '.join(listed)}{more}; write more of the key")
    ((case_key, run_id),) = found.items()
    return _row(store, run_id, case_key)


def _row(store: Store, run_id: str, case_key: str) -> ResultRow:
    return next(row for row in store.rows(run_id) if row.case_key == case_key)


def _described(store: Store, run_id: str, case_key: str) -> str:
    row = _row(store, run_id, case_key)
    return f"{case_key} ({method_label(row.method, {})} on {row.scene})"
