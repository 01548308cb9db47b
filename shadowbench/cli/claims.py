"""``shadowbench claims``: what a run says of its experiments' claims, and an exit status for CI."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.cli import completion
from shadowbench.cli.console import complain
from shadowbench.cli.exit_status import ExitStatus
from shadowbench.cli.options import DEFAULT_RESULTS, ResultsOption, RunArgument, open_store
from shadowbench.cli.writing import write_out
from shadowbench.errors import UsageError, did_you_mean

if TYPE_CHECKING:
    from shadowbench.rows import ResultRow, RunRecord
    from shadowbench.tables.claims import ClaimAnswer

FAILURES = ("does-not-hold", "undecided")
"""What ``--fail-on`` takes; the second includes the first."""


def claims(
    run: RunArgument,
    experiment: Annotated[
        str | None,
        typer.Option("--experiment", "-e", metavar="E", help="Only this experiment's claims.", show_default=False),
    ] = None,
    format: Annotated[  # noqa: A002 - the option's name
        str,
        typer.Option(
            "--format",
            "-f",
            metavar="FORMAT",
            help="rich, csv, markdown, latex or json (with every group of cases and its figure).",
            autocompletion=completion.claim_formats,
        ),
    ] = "rich",
    claims_of: Annotated[
        list[str] | None,
        typer.Option(
            "--claims-of",
            metavar="EXPERIMENT|GROUP|FILE.toml",
            help="Answer the claims that this experiment's file holds now, not those recorded with the run.",
            autocompletion=completion.experiments,
        ),
    ] = None,
    fail_on: Annotated[
        str | None,
        typer.Option(
            "--fail-on",
            metavar="VERDICT",
            help="End with status 1 if a claim does-not-hold, or (undecided) if any one is not shown to hold.",
            autocompletion=completion.claim_failures,
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write to a file instead.", show_default=False),
    ] = None,
    results: ResultsOption = DEFAULT_RESULTS,
) -> int:
    """Answer the claims of a run's experiments: holds, does not hold or undecided, and why.

    Without --fail-on the exit status is 0 whatever the verdicts: that a claim does not hold here is a result too.
    """
    from shadowbench.tables.claims import Verdict
    from shadowbench.tables.claims_text import render_claims

    if fail_on is not None and fail_on not in FAILURES:
        raise UsageError(f"--fail-on cannot be '{fail_on}'; {did_you_mean(fail_on, FAILURES)}")
    with open_store(results) as store:
        record = store.find_run(run)
        rows = store.rows(record.run_id)
    answers = _answers(record, rows, claims_of or [], experiment)
    if not answers:
        complain(
            f"no experiment of run {record.run_id} made a claim when it was measured; "
            "--claims-of NAME takes an experiment's present ones"
        )
    write_out(render_claims(answers, format), output)
    failing = {Verdict.DOES_NOT_HOLD} | ({Verdict.UNDECIDED} if fail_on == "undecided" else set())
    failed = fail_on is not None and any(answer.verdict in failing for answer in answers)
    return ExitStatus.CASES_FAILED if failed else ExitStatus.OK


def _answers(
    record: RunRecord, rows: list[ResultRow], files: list[str], experiment: str | None
) -> tuple[ClaimAnswer, ...]:
    from shadowbench.experiment_groups import expanded, groups, load_one
    from shadowbench.tables.claims import answer_claims, answers_of

    if experiment is not None and experiment not in record.experiments:
        raise UsageError(
            f"the run has no experiment '{experiment}'; "
            f"{did_you_mean(experiment, record.experiments, noun='experiment')}"
        )
    counts = {str(d.get("name", "")): d.get("case_count") for d in record.definitions}
    answers = answer_claims(record, rows) if not files else ()
    members = {member for name in files for member in groups().get(name, ())}
    for read in map(load_one, expanded(files)):
        if read.name in members and read.name not in counts:
            continue
        if read.name not in counts:
            raise UsageError(
                f"the run has no experiment '{read.name}'; {did_you_mean(read.name, counts, noun='experiment')}"
            )
        answers += tuple(answers_of(read.name, read.claims, rows, source=read.source, case_count=counts[read.name]))
    return tuple(answer for answer in answers if experiment in (None, answer.experiment))
