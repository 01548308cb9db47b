"""Runs and rows as JSON documents, as they travel: strictly read, whoever wrote them.

A document is what ``model_dump`` gives, but for numbers that JSON lacks: ``null`` stands for a stage or sample that is
not a number. Reading refuses what the store could not give back unchanged or a page could not show: unknown fields,
numbers that are not finite or beyond 64 bits, endless nesting, names of files that are none, rows of another run.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import from_json

from shadowbench.errors import StoreError
from shadowbench.rows import ResultRow, RunRecord, RunStatus
from shadowbench.store.artifacts import ARTIFACT_NAME

RUN_ID = r"[A-Za-z0-9][A-Za-z0-9_-]{0,99}"
"""What a run may be called where others read it: it stands in addresses and names of files."""

MOST_ROWS = 20_000
"""Rows of one run."""

_Model = TypeVar("_Model", RunRecord, ResultRow)

_DEEPEST = 16
_LONGEST_NAME = 300
_LONGEST_TEXT = 100_000
_NAMES = ("experiment", "case_key", "quality_key", "scene", "method", "light", "camera", "device", "machine")


class DocumentError(StoreError):
    """A document that is none of ours.

    Attributes:
        place: Where the fault is: ``rows[3].failure_percent``.
        reason: What is wrong there.
    """

    def __init__(self, place: str, reason: str) -> None:
        super().__init__(f"{place}: {reason}" if place else reason)
        self.place = place
        self.reason = reason

    def __reduce__(self) -> tuple[Any, ...]:
        """Say how it is made again in another process."""
        return type(self), (self.place, self.reason)


def parsed(text: bytes, place: str = "") -> Any:
    """Return the value of a JSON text.

    Raises:
        DocumentError: It is no JSON, or has a number in it that is not finite.
    """
    try:
        return from_json(text, allow_inf_nan=False, cache_strings="keys")
    except ValueError as error:
        raise DocumentError(place, f"is not JSON: {str(error).splitlines()[0]}") from None


def run_document(run: RunRecord) -> dict[str, Any]:
    """Return a run as a document."""
    return _finite(run.model_dump(mode="json"))


def row_document(row: ResultRow) -> dict[str, Any]:
    """Return a row, with all that belongs to it, as a document."""
    return _finite(row.model_dump(mode="json"))


def run_from_document(document: Any, place: str = "run") -> RunRecord:
    """Read a run.

    Raises:
        DocumentError: It is none, or its id could not stand in an address.
    """
    run = _read(RunRecord, document, place)
    if not re.fullmatch(RUN_ID, run.run_id):
        raise DocumentError(f"{place}.run_id", "is not 1 to 100 letters, digits, '_' or '-'")
    return run


def rows_from_documents(documents: Any, run: RunRecord, place: str = "rows") -> list[ResultRow]:
    """Read the rows of a run.

    Raises:
        DocumentError: One is no row, belongs to another run, or stands there twice; or a complete run lacks some.
    """
    if not isinstance(documents, list):
        raise DocumentError(place, "is not a list")
    if len(documents) > MOST_ROWS:
        raise DocumentError(place, f"has {len(documents)} rows; {MOST_ROWS} are allowed")
    rows: list[ResultRow] = []
    seen: set[tuple[str, str]] = set()
    for number, document in enumerate(documents):
        here = f"{place}[{number}]"
        row = _row(document, here)
        if row.run_id != run.run_id:
            raise DocumentError(f"{here}.run_id", f"is not that of the run, '{run.run_id}'")
        if (row.experiment, row.case_key) in seen:
            raise DocumentError(f"{here}.case_key", "stands there twice for this experiment")
        seen.add((row.experiment, row.case_key))
        rows.append(row)
    if run.status is RunStatus.COMPLETE and len(rows) < run.case_count:
        raise DocumentError(place, f"has {len(rows)} of the {run.case_count} rows of a complete run")
    return rows


def artifact_names(rows: Iterable[ResultRow]) -> list[str]:
    """Return the names of all files that rows need, each once, in order of appearance."""
    return list(dict.fromkeys(name for row in rows for name in row.artifacts.values()))


def _row(document: Any, place: str) -> ResultRow:
    if isinstance(document, dict):
        document = dict(document)
        if isinstance(stages := document.get("stages"), dict):
            document["stages"] = {name: math.nan if value is None else value for name, value in stages.items()}
        if isinstance(samples := document.get("samples"), dict):
            document["samples"] = {
                name: [math.nan if v is None else v for v in found] if isinstance(found, list) else found
                for name, found in samples.items()
            }
    row = _read(ResultRow, document, place)
    for name in _NAMES:
        if len(getattr(row, name)) > _LONGEST_NAME:
            raise DocumentError(f"{place}.{name}", f"has more than {_LONGEST_NAME} characters")
    for name, file in row.artifacts.items():
        if not ARTIFACT_NAME.fullmatch(file):
            raise DocumentError(f"{place}.artifacts[{name!a:.60}]", "is not the name of an artifact")
    return row


def _read(model: type[_Model], document: Any, place: str) -> _Model:
    if not isinstance(document, dict):
        raise DocumentError(place, "is not an object")
    _check(document, place, _DEEPEST, ("stages", "samples") if model is ResultRow else ())
    try:
        return model.model_validate(document)
    except ValidationError as error:
        raise DocumentError(*_first_fault(error, place)) from None


def _first_fault(error: ValidationError, place: str) -> tuple[str, str]:
    fault = error.errors(include_url=False, include_input=False)[0]
    return ".".join([place, *map(str, fault["loc"])]), fault["msg"]


def _check(value: Any, place: str, depth: int, may_hold_nan: Sequence[str] = ()) -> None:
    """Refuse what no database or page can hold."""
    if isinstance(value, dict | list):
        if depth == 0:
            raise DocumentError(place, f"is nested more than {_DEEPEST} deep")
        for name, inner in value.items() if isinstance(value, dict) else enumerate(value):
            _check_name(name, place)
            here = f"{place}[{name}]" if isinstance(value, list) else f"{place}.{name:.60}"
            _check(_finite(inner) if name in may_hold_nan else inner, here, depth - 1)
    elif isinstance(value, float) and not math.isfinite(value):
        raise DocumentError(place, "is not a finite number")
    elif isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise DocumentError(place, "is outside 64 bits")
    elif isinstance(value, str) and len(value) > _LONGEST_TEXT:
        raise DocumentError(place, f"has more than {_LONGEST_TEXT} characters")


def _check_name(name: str | int, place: str) -> None:
    if isinstance(name, str) and len(name) > _LONGEST_NAME:
        raise DocumentError(place, f"has a name of more than {_LONGEST_NAME} characters")


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(inner) for name, inner in value.items()}
    if isinstance(value, list):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
