"""``shadowbench compare``: two runs case by case, and an exit status for continuous integration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.cli import completion
from shadowbench.cli.console import complain
from shadowbench.cli.exit_status import ExitStatus
from shadowbench.cli.options import DEFAULT_RESULTS, ResultsOption, open_store
from shadowbench.cli.writing import write_out
from shadowbench.errors import UsageError, did_you_mean

if TYPE_CHECKING:
    from shadowbench.rows import ResultRow, RunRecord
    from shadowbench.tables.comparing import Kind, RunComparison

_KINDS = ("slower", "pixels", "counters", "memory", "failures", "missing")

_SELECTOR = "a run's id, the beginning of one, 'latest', or FOLDER:RUN for one in another results folder"


def compare(
    a: Annotated[
        str,
        typer.Argument(
            metavar="A",
            help=f"The run to compare with: {_SELECTOR}.",
            autocompletion=completion.runs,
            show_default=False,
        ),
    ],
    b: Annotated[
        str,
        typer.Argument(
            metavar="B", help="The run in question, named likewise.", autocompletion=completion.runs, show_default=False
        ),
    ],
    fail_on: Annotated[
        list[str] | None,
        typer.Option(
            "--fail-on",
            metavar="KIND[,KIND]",
            help=f"End with status 1 if a case changed so: {', '.join(_KINDS)}. May be repeated.",
            autocompletion=completion.change_kinds,
        ),
    ] = None,
    threshold: Annotated[
        float,
        typer.Option("--threshold", metavar="PERCENT", help="Smallest difference in time that matters [%]."),
    ] = 2.0,
    format: Annotated[  # noqa: A002 - the option's name
        str,
        typer.Option(
            "--format",
            "-f",
            metavar="FORMAT",
            help="rich, markdown (for a pull request), csv (a line a case) or json.",
            autocompletion=completion.comparison_formats,
        ),
    ] = "rich",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write to a file instead.", show_default=False),
    ] = None,
    results: ResultsOption = DEFAULT_RESULTS,
) -> None:
    """Compare two runs case by case: pixels, counters and memory exactly, times statistically.

    Cases are matched by what they measure, so that versions of the code and machines can be compared; times only
    within one machine. Ratios are B/A.
    """
    from shadowbench.tables.comparing import compare_runs
    from shadowbench.tables.comparison_text import render_comparison

    kinds = _kinds(fail_on or [])
    if not 0.0 <= threshold < float("inf"):
        raise UsageError(f"--threshold must be a percentage from 0 on, not {threshold:g}")
    runs = [_read(selector, results) for selector in (a, b)]
    comparison = compare_runs(*runs[0], *runs[1], threshold=threshold / 100.0)
    if not any(case.before is not None and case.after is not None for case in comparison.cases):
        raise UsageError(f"runs {comparison.before.run_id} and {comparison.after.run_id} have no case in common")
    written = render_comparison(comparison, format)
    write_out(written, output)
    if _is_refused(comparison, kinds):
        raise typer.Exit(ExitStatus.CASES_FAILED)


def _kinds(texts: list[str]) -> list[Kind]:
    from shadowbench.tables.comparing import Kind

    names = [name.strip() for text in texts for name in text.split(",")]
    for name in names:
        if name not in _KINDS:
            raise UsageError(f"--fail-on knows no '{name}'; {did_you_mean(name, _KINDS, noun='kind')}")
    return [Kind(name) for name in dict.fromkeys(names)]


def _read(selector: str, results: Path) -> tuple[RunRecord, list[ResultRow]]:
    """Return a run and its rows.

    Raises:
        StoreError: There is no such folder or run.
    """
    folder, separator, run = selector.rpartition(":")
    with open_store(Path(folder) if separator else results) as store:
        record = store.find_run(run or "latest")
        return record, store.rows(record.run_id)


def _is_refused(comparison: RunComparison, kinds: list[Kind]) -> bool:
    """Say what changed in a way that was asked about, and what could not be told."""
    from shadowbench.tables.comparing import KIND_MEANINGS, Kind

    reasons = {case.times_note for case in comparison.cases if case.is_measured and not case.times}
    if Kind.SLOWER in kinds and reasons:
        complain(f"warning: some times were not compared: {', '.join(sorted(reasons))}")
    found = comparison.failing(kinds)
    for kind, count in found.items():
        complain(f"{kind.value}: {count} of {len(comparison.cases)} cases ({KIND_MEANINGS[kind]})")
    return bool(found)
