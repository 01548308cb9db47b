"""``shadowbench table`` and ``shadowbench report``: what is made of a run that has been measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from shadowbench.cli import completion
from shadowbench.cli.console import complain
from shadowbench.cli.options import DEFAULT_RESULTS, ResultsOption, RunArgument, open_store
from shadowbench.cli.writing import write_out
from shadowbench.errors import UsageError

if TYPE_CHECKING:
    from shadowbench.tables import Format


def table(
    run: RunArgument,
    experiment: Annotated[
        str | None,
        typer.Option("--experiment", "-e", metavar="E", help="Only this experiment's tables.", show_default=False),
    ] = None,
    format: Annotated[  # noqa: A002 - the option's name
        str,
        typer.Option(
            "--format",
            "-f",
            metavar="FORMAT",
            help="rich, csv (tidy: every column, a line a case), csv-table (as printed), markdown, latex or json.",
            autocompletion=completion.formats,
        ),
    ] = "rich",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write to a file instead.", show_default=False),
    ] = None,
    results: ResultsOption = DEFAULT_RESULTS,
) -> None:
    """Print the tables of a run."""
    from shadowbench import tables

    with open_store(results) as store:
        record = store.find_run(run)
        rows = store.rows(record.run_id)
    if not rows:
        complain(f"run {record.run_id} has no finished case yet")
    written = tables.render(tables.make(rows, run=record, experiment=experiment), cast("Format", format))
    write_out(written, output)


def report(
    run: RunArgument,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE.html", help="Where to; by default beside the run.", show_default=False
        ),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(
            "--figures", metavar="DIR", help="Write the charts for papers, as PDF and SVG, instead.", show_default=False
        ),
    ] = None,
    results: ResultsOption = DEFAULT_RESULTS,
) -> None:
    """Write a run's report, one HTML file to read offline; or with --figures its charts, for papers."""
    from shadowbench.report import default_path, write, write_figures

    if figures is not None and output is not None:
        raise UsageError("--figures writes no report: leave out --output, or ask twice")
    with open_store(results) as store:
        record = store.find_run(run)
        if figures is None:
            written = [write(store, record, output or default_path(store, record))]
        else:
            written = write_figures(store, record, figures)
            if not written:
                complain(f"run {record.run_id} has no chart: no case of it was timed")
    for path in written:
        print(path)
