"""``shadowbench export``, ``import``, ``backup`` and ``restore``: runs, or everything, as one file."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from shadowbench.cli import completion
from shadowbench.cli.console import plain, put
from shadowbench.cli.options import DEFAULT_RESULTS, DatabaseOption, ResultsOption, open_store


class RowsForm(StrEnum):
    """How rows are written."""

    CSV = "csv"
    PARQUET = "parquet"


def export_(
    run: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN...",
            help="Ids of runs, beginnings of them, or 'latest'.",
            autocompletion=completion.runs,
            show_default=False,
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The file to write.", show_default=False)
    ],
    rows: Annotated[
        RowsForm,
        typer.Option(
            "--rows",
            help="How rows are written: csv (and JSON, for `import`), or parquet (typed columns, samples too; needs"
            " pyarrow: the extra 'parquet').",
        ),
    ] = RowsForm.CSV,
    results: ResultsOption = DEFAULT_RESULTS,
    database: DatabaseOption = None,
) -> None:
    """Write runs, with their pictures, to one file that `import` reads."""
    from shadowbench.store.transfer import export_runs
    from shadowbench.tables.csv_text import as_tidy_csv

    with open_store(results, database) as store:
        found = {record.run_id: record for record in map(store.find_run, run)}
        export_runs(store, list(found.values()), output, as_tidy_csv if rows is RowsForm.CSV else None)
    print(output)


def import_(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What `export` wrote.", show_default=False)],
    replace: Annotated[
        bool, typer.Option("--replace", help="Let a run take the place of another one with the same id.")
    ] = False,
    results: ResultsOption = DEFAULT_RESULTS,
    database: DatabaseOption = None,
) -> None:
    """Put the runs of a file, with rows of either form, into the results folder; runs that are there already stay."""
    from shadowbench.store import Store
    from shadowbench.store.transfer import import_runs

    with Store.open(results, database=database) as store:
        for imported in import_runs(store, file, replace=replace):
            put(plain(f"run {imported.run.run_id}: {imported.kept}, {imported.row_count} rows"))


def backup(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write.", show_default=False)],
    results: ResultsOption = DEFAULT_RESULTS,
    database: DatabaseOption = None,
) -> None:
    """Write everything to one file, while others go on writing."""
    from shadowbench.store import backup as backups

    with open_store(results, database) as store:
        backups.backup(store, file)
    print(file)


def restore(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What `backup` wrote.", show_default=False)],
    results: ResultsOption = DEFAULT_RESULTS,
    database: DatabaseOption = None,
) -> None:
    """Make a results folder, or fill an empty database, from a backup."""
    from shadowbench.store import backup as backups

    backups.restore(file, results, database)
    print(results)
