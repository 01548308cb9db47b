"""Results as a pandas DataFrame, for notebooks: :func:`load_results`, which is ``shadowbench.load_results``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from shadowbench.errors import StoreError, did_you_mean
from shadowbench.rows import LONG_FIELDS, LONG_UNITS, ResultRow
from shadowbench.store import DATABASE_NAME, Store
from shadowbench.tables.columns import ROW_COLUMNS

_FLATTENED = {"method_parameters": "method", "scene_parameters": "scene"}
_SPREAD = ("stages", "counters", "kept", "artifacts")
_WHOLE = [name for name, field in ResultRow.model_fields.items() if field.annotation in (int, int | None)]
_REAL = [name for name, field in ResultRow.model_fields.items() if field.annotation == float | None]


def load_results(path: str | Path, run: str | None = "latest", *, table: str = "rows") -> pd.DataFrame:
    """Return results as a tidy DataFrame.

    Args:
        path: A results folder, or the database in it.
        run: A run's id, a unique beginning of it, or ``latest``; ``None`` for all runs.
        table: ``rows`` for one line a case, whatever its outcome, with the columns of
            :class:`~shadowbench.rows.ResultRow`; parameters are columns ``method.resolution``, ``scene.triangles``, and
            stages, counters, kept arrays and artifacts ``stages.NAME`` and so on. ``stages``, ``counters``, ``kept``,
            ``samples`` or ``artifacts`` for one line a value: ``run_id, experiment, case_key, scene, method, name,
            value, unit``, samples with their ``round`` and ``process``.

    What does not apply to a case is missing (NaN or NA), never 0. Counts, sizes and whole parameters are ``Int64``,
    switches ``boolean``, measures ``float64``, all of which can be missing. Times are milliseconds, sizes bytes.

    Raises:
        StoreError: There is no such folder, run or table, or it cannot be read.

    >>> frame = load_results("shadowbench-results")  # doctest: +SKIP
    >>> frame[frame.outcome == "ok"].groupby("method").failure_percent.median()  # doctest: +SKIP
    """
    if table != "rows" and table not in LONG_FIELDS:
        known = ("rows", *LONG_FIELDS)
        raise StoreError(f"results have no table '{table}'; {did_you_mean(table, known, noun='table')}")
    folder = Path(path)
    if folder.name == DATABASE_NAME and folder.is_file():
        folder = folder.parent
    with Store.open(folder, create=False) as store:
        wanted = store.runs() if run is None else [store.find_run(run)]
        rows = [row for each in wanted for row in store.rows(each.run_id)]
    return _rows_frame(rows) if table == "rows" else _long_frame(rows, table)


def _rows_frame(rows: list[ResultRow]) -> pd.DataFrame:
    columns: dict[str, None] = {}
    for name in ROW_COLUMNS:
        if name in _FLATTENED:
            columns |= dict.fromkeys(f"{_FLATTENED[name]}.{key}" for row in rows for key in getattr(row, name))
        else:
            columns[name] = None
    for name in _SPREAD:
        columns |= dict.fromkeys(f"{name}.{key}" for row in rows for key in getattr(row, name))
    # as objects first: pandas makes whole numbers with gaps real ones, and inexact
    frame = pd.DataFrame([_flat(row) for row in rows], columns=list(columns), dtype=object)
    counted = [name for name in columns if name.startswith(("counters.", "kept."))]
    types = dict.fromkeys((*_WHOLE, *counted), "Int64") | dict.fromkeys(_REAL, "float64")
    for name in columns:
        if name.startswith(("method.", "scene.")):
            types |= _parameter_type(name, frame[name])
    return frame.astype(types).infer_objects()


def _parameter_type(name: str, values: pd.Series) -> dict[str, str]:
    """Return the type of a parameter that some cases lack: a resolution stays whole and a switch a truth value."""
    kinds = {type(value) for value in values.dropna()}
    for kind, dtype in ((bool, "boolean"), (int, "Int64")):
        if kinds == {kind}:
            return {name: dtype}
    return {}


def _flat(row: ResultRow) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name in ROW_COLUMNS:
        value = getattr(row, name)
        if name in _FLATTENED:
            values |= {f"{_FLATTENED[name]}.{key}": inner for key, inner in value.items()}
        else:
            values[name] = value.value if name == "outcome" else value
    for name in _SPREAD:
        values |= {f"{name}.{key}": inner for key, inner in getattr(row, name).items()}
    return values


def _long_frame(rows: list[ResultRow], table: str) -> pd.DataFrame:
    keys = ("run_id", "experiment", "case_key", "scene", "method")
    lines = []
    for row in rows:
        key = {name: getattr(row, name) for name in keys}
        for name, value in getattr(row, table).items():
            if table == "samples":
                processes = dict(enumerate(row.round_processes))
                lines += [
                    key | {"name": name, "round": i, "process": processes.get(i), "value": sample}
                    for i, sample in enumerate(value)
                ]
            else:
                lines.append(key | {"name": name, "value": value})
    rounds = ("round", "process") if table == "samples" else ()
    frame = pd.DataFrame(lines, columns=[*keys, "name", *rounds, "value"])
    frame = frame.astype({"process": "Int64"}) if rounds else frame
    return frame.assign(unit=LONG_UNITS[table])
