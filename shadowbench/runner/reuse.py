"""Quality that an earlier run has measured: taken over, never trusted.

What a picture looks like depends on the quality key alone, so measures, counters, bytes and pictures of an earlier row
with the same key hold for a case as well, wherever they were measured. Times never do: the case is timed here, and what
its rounds give must have the bits of the earlier visibility, its counters and its bytes. Where it has not, quality is
measured anew; and where it should have, the row says so: one machine gives the same bits always, and hard visibility,
counters and bytes are the same on all machines (filtered visibility within 1/255).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from shadowbench.rows import ResultRow
from shadowbench.runner.cases import Case

if TYPE_CHECKING:
    from shadowbench.store import Store

_NAMES = list(ResultRow.model_fields)
QUALITY_COLUMNS = (
    *("receivers", "scored"),
    *_NAMES[_NAMES.index("false_lit_percent") : _NAMES.index("reference_error") + 1],
)
"""What comparing a result with the truth gives."""


class KnownQuality:
    """What a results folder knows already.

    Args:
        store: The folder's.
        only_run: Look into this run only, whose cases may have a key in common (on another number of threads, say).
    """

    def __init__(self, store: Store, only_run: str | None = None) -> None:
        self._store, self._only_run = store, only_run

    def of(self, cases: Sequence[Case]) -> dict[str, ResultRow]:
        """Return quality key -> a row whose quality is whole, its pictures included, for those of the cases."""
        found = self._store.latest_measured((case.quality_key for case in cases), self._only_run)
        return {key: row for key, row in found.items() if self._is_whole(row)}

    def _is_whole(self, row: ResultRow) -> bool:
        has_measures = row.visibility_digest != "" and row.rmse is not None
        return has_measures and all(self._store.artifacts.path(name).is_file() for name in row.artifacts.values())


def difference(known: ResultRow, seen: Mapping[str, Any], *, machine: str, deterministic: bool) -> tuple[str, bool]:
    """Return how what a case gave differs from an earlier row, and whether it should not.

    Args:
        known: The earlier row.
        seen: As :meth:`shadowbench.runner.case_host.CaseHost.summary` returns it.
        machine: This one's key.
        deterministic: As the method declares.

    Returns:
        One line, empty for no difference; ``True`` for a difference that the promises of a row rule out.
    """
    where = f"run {known.run_id}" + (f" on {known.machine}" if known.machine != machine else "")
    for what, before, now in (
        ("counter", known.counters, seen["counters"]),
        ("bytes kept for", known.kept, seen["kept"]),
    ):
        for name, value in now.items():  # those that are found out while measuring are not there yet
            if before.get(name) != value:
                return f"{what} '{name}' is {value} here and {before.get(name)} in {where}", deterministic
    if known.visibility_digest == seen["visibility_digest"]:
        return "", False
    is_filtering = known.reference_error is not None
    must_agree = deterministic and not (is_filtering and known.machine != machine)
    return f"the visibility is not that of {where}", must_agree


def reused(known: ResultRow, seen: Mapping[str, Any], run_id: str) -> dict[str, Any]:
    """Return what measuring would have returned, with the quality of an earlier row."""
    origin = known.quality_run or known.run_id
    return {
        **seen,
        "columns": {name: getattr(known, name) for name in QUALITY_COLUMNS},
        "counters": known.counters,
        "kept": known.kept,
        "quality_run": "" if origin == run_id else origin,
    }
