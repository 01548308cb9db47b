"""What each page says, but for leaderboards and histories: JSON values, and the lines of the CSV file."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

from shadowbench import tables
from shadowbench.errors import ExperimentError
from shadowbench.report.cards import reproduce_command
from shadowbench.report.summary import flattened
from shadowbench.rows import ResultRow, RunRecord
from shadowbench.service.problems import Problem
from shadowbench.service.responding import Answer
from shadowbench.service.standings import view_title
from shadowbench.store import Store
from shadowbench.store.catalogue import Catalogue, RunFilter, RunLine
from shadowbench.store.derived import VIEW_FIELDS
from shadowbench.store.documents import row_document, run_document
from shadowbench.tables.claims import answer_claims
from shadowbench.tables.comparing import compare_runs
from shadowbench.tables.comparison_text import render_comparison
from shadowbench.tables.csv_text import TIDY_COLUMNS
from shadowbench.tables.labels import Labels

RUNS_A_PAGE = 50
MOST_RUNS_A_PAGE = 200

_RUN_COLUMNS = (
    *("run_id", "title", "experiments", "created_at", "finished_at", "status", "case_count", "machine"),
    *("code_version", "outcomes", "is_uploaded"),
)
_CASE_COLUMNS = ("experiment", "case_key", "scene", "light", "camera", "width", "height", "method", "outcome", "reason")


def runs(catalogue: Catalogue, wanted: RunFilter, *, limit: int, after: str) -> Answer:
    """Return a page of runs, newest first."""
    found = catalogue.runs(wanted, limit=limit + 1, after=after)
    shown = [_run_line(run) for run in found[:limit]]
    document = {
        "runs": shown,
        "total": catalogue.count_runs(wanted),
        "next": shown[-1]["run_id"] if len(found) > limit else None,
    }
    lines = [[run[name] for name in _RUN_COLUMNS] for run in shown]
    content = {"wanted": dataclasses.asdict(wanted), "facets": catalogue.facets(), "limit": limit}
    return Answer("runs.html", document, _RUN_COLUMNS, lines, content)


def _run_line(run: RunLine) -> dict[str, Any]:
    values = dataclasses.asdict(run)
    values["is_uploaded"] = values.pop("token_id") is not None  # whose token it was is the operator's to know
    values["outcomes"] = {outcome.value: count for outcome, count in run.outcomes.items()}
    return values


def find_run(store: Store, run_id: str) -> RunRecord:
    """Return a run.

    Raises:
        Problem: There is none.
    """
    found = store.run(run_id)
    if found is None:
        raise Problem(404, "there is no run of this id")
    return found


def run(store: Store, run_id: str) -> Answer:
    """Return a run: the record, its rows without samples, its tables and claims."""
    record = find_run(store, run_id)
    rows = store.rows(run_id)
    documents = [row_document(row) for row in rows]
    for document in documents:
        del document["samples"]
    claims = _claims(record, rows)
    labels = Labels("method", rows, defaults=record.method_defaults)
    content = {
        "rows": rows,
        "titles": [labels.of(row) for row in rows],
        "tables": tables.make(rows, run=record) if rows else [],
        "environment": flattened(record.environment),
    }
    lines = [[document[name] for name in TIDY_COLUMNS] for document in documents]
    return Answer(
        "run.html", {"run": run_document(record), "rows": documents, "claims": claims}, TIDY_COLUMNS, lines, content
    )


def claims(store: Store, run_id: str) -> Answer:
    """Return the claims of a run's experiments with their verdicts."""
    found = _claims(find_run(store, run_id), store.rows(run_id))
    header = ("name", "experiment", "statement", "source", "verdict", "evidence", "case_keys")
    return Answer("claims.html", {"run_id": run_id, "claims": found}, header, [[c[n] for n in header] for c in found])


def _claims(record: RunRecord, rows: list[ResultRow]) -> list[dict[str, Any]]:
    try:
        answers = answer_claims(record, rows)
    except ExperimentError:
        return []  # an uploaded run's definitions may say anything
    names = ("name", "experiment", "statement", "source", "verdict", "evidence", "case_keys")
    return [{name: getattr(answer, name) for name in names} for answer in answers]


def case(store: Store, run_id: str, case_key: str, experiment: str) -> Answer:
    """Return one case of a run with everything that was measured."""
    record = find_run(store, run_id)
    found = store.rows(run_id, experiment or None, case_key)
    if not found:
        raise Problem(404, "the run has no such case")
    row = found[0]
    content = {
        "row": row,
        "run": record,
        "label": Labels("method", [row], defaults=record.method_defaults).of(row),
        "view": view_title({name: getattr(row, name) for name in VIEW_FIELDS}),
        "command": reproduce_command(row),
        "others": [other.experiment for other in found[1:]],
    }
    document = row_document(row)
    return Answer("case.html", document, tuple(document), [list(document.values())], content)


def experiments(catalogue: Catalogue) -> Answer:
    """Return all experiments that any run has."""
    names = catalogue.facets()["experiment"]
    return Answer("experiments.html", {"experiments": names}, ("experiment",), [[name] for name in names])


def methods(catalogue: Catalogue) -> Answer:
    """Return all methods that any row has."""
    names = catalogue.facets()["method"]
    return Answer("methods.html", {"methods": names}, ("method",), [[name] for name in names])


def machines(catalogue: Catalogue) -> Answer:
    """Return all machines."""
    found = catalogue.machines()
    header = ("machine", "runs", "first", "last", "last_run", "environment")
    lines = [[machine[name] for name in header] for machine in found]
    facts = [flattened(machine["environment"]) for machine in found]
    return Answer("machines.html", {"machines": found}, header, lines, {"environments": facts})


def choose(catalogue: Catalogue, a: str, b: str) -> Answer:
    """Return what there is to compare: the newest runs, and what was chosen already."""
    found = [_run_line(run) for run in catalogue.runs(RunFilter(), limit=MOST_RUNS_A_PAGE)]
    return Answer("choose.html", {"runs": found, "a": a, "b": b})


def compare(store: Store, a: str, b: str) -> Answer:
    """Return what changed from one run to another."""
    before, after = find_run(store, a), find_run(store, b)
    found = compare_runs(before, store.rows(a), after, store.rows(b))
    document = json.loads(str(render_comparison(found, "json")))
    header = ("experiment", "scene", "method", "method_parameters", "summary", "changed", "case_key_a", "case_key_b")
    lines = [[each[name] for name in header] for each in document["cases"]]
    rows = [each.row for each in found.cases]
    labels = Labels("method", rows, defaults=before.method_defaults | after.method_defaults)
    in_both = [case.before is not None and case.after is not None for case in found.cases]
    order = sorted(range(len(rows)), key=lambda place: (not in_both[place], found.cases[place].is_unchanged))
    content = {"labels": [labels.of(row) for row in rows], "summaries": found.summaries, "order": order}
    return Answer("compare.html", document, header, lines, content)
