"""``shadowbench pareto``: cost against quality, and the best method for a budget."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from shadowbench.cli import completion
from shadowbench.cli.options import DEFAULT_RESULTS, ResultsOption, RunArgument, open_store
from shadowbench.cli.writing import write_out
from shadowbench.errors import UsageError, did_you_mean

if TYPE_CHECKING:
    from shadowbench.tables import Format


def pareto(
    run: RunArgument,
    cost: Annotated[
        str,
        typer.Option(
            "--cost",
            metavar="COLUMN",
            help="Of which less is better: a time, bytes_kept, counters.NAME.",
            autocompletion=completion.costs,
        ),
    ] = "dynamic_frame_ms",
    quality: Annotated[
        str,
        typer.Option(
            "--quality",
            metavar="COLUMN",
            help="Of which less is better: a percentage of failures, rmse, flip, leak_mean.",
            autocompletion=completion.qualities,
        ),
    ] = "failure_percent",
    within_ms: Annotated[
        float | None,
        typer.Option("--within-ms", metavar="X", min=0.0, help="Instead: the best method within a time [ms]."),
    ] = None,
    within_mb: Annotated[
        float | None,
        typer.Option("--within-mb", metavar="X", min=0.0, help="Instead: the best within so much kept memory [MiB]."),
    ] = None,
    within_percent: Annotated[
        float | None,
        typer.Option("--within-percent", metavar="Y", min=0.0, help="Instead: the cheapest within so many failures."),
    ] = None,
    experiment: Annotated[
        str | None,
        typer.Option("--experiment", "-e", metavar="E", help="Only this experiment.", show_default=False),
    ] = None,
    format: Annotated[  # noqa: A002 - the option's name
        str,
        typer.Option(
            "--format",
            "-f",
            metavar="FORMAT",
            help="rich, csv, markdown, latex or json.",
            autocompletion=completion.claim_formats,
        ),
    ] = "rich",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write to a file instead.", show_default=False),
    ] = None,
    results: ResultsOption = DEFAULT_RESULTS,
) -> None:
    """Show which methods no other one beats in both cost and quality, or which is best within a limit."""
    from shadowbench import tables
    from shadowbench.tables.pareto_tables import Limits, pareto_tables

    with open_store(results) as store:
        record = store.find_run(run)
        rows = store.rows(record.run_id)
    limits = Limits(within_ms, within_mb, within_percent)
    made = pareto_tables(rows, record, cost=cost, quality=quality, limits=limits)
    if experiment is not None:
        if experiment not in record.experiments:
            hint = did_you_mean(experiment, record.experiments, noun="experiment")
            raise UsageError(f"the run has no experiment '{experiment}'; {hint}")
        made = [table for table in made if table.experiment == experiment]
    # each line is a method of a view: a tidy CSV already
    write_out(tables.render(made, cast("Format", "csv-table" if format == "csv" else format)), output)
