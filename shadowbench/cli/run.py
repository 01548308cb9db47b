"""``shadowbench run``: options -> experiments -> plan -> rows, and what is said about them at the end.

Without an experiment and without ``--method`` or ``--scene`` the ``quick`` experiment runs; with one of these two it
is an experiment of their own, made of every method or the default scene where only one is given. Beside a named
experiment, ``--method``, ``--scene``, ``--light``, ``--camera``, ``--size``, ``--pixel-samples``, ``--layers`` and
``--threads`` each replace what the experiment's comparisons say.
"""

from __future__ import annotations

import dataclasses
import json
import sys
from collections import Counter
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from shadowbench.cli import completion
from shadowbench.cli.console import complain, err, plain, put, reserved_stdout
from shadowbench.cli.exit_status import ExitStatus
from shadowbench.cli.interruption import ended_like_ctrl_c
from shadowbench.cli.options import DEFAULT_RESULTS, PluginOption, ResultsOption
from shadowbench.errors import ShadowbenchError

if TYPE_CHECKING:
    from shadowbench.experiment import Experiment
    from shadowbench.rows import ResultRow, RunRecord
    from shadowbench.runner import Plan
    from shadowbench.store import Store

DEFAULT_EXPERIMENT = "quick"

_GIB = 2**30


def run(
    context: typer.Context,
    experiment: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="EXPERIMENT|GROUP|FILE.toml",
            help=f"What to measure; '{DEFAULT_EXPERIMENT}' if nothing is said, 'papers' for all that papers print.",
            autocompletion=completion.experiments,
            show_default=False,
        ),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(
            "--method",
            "-m",
            metavar="NAME[:key=v,key=v/v]",
            help="A method and its parameters; v/v/v sweeps. May be repeated.",
            autocompletion=completion.methods,
        ),
    ] = None,
    scene: Annotated[
        list[str] | None,
        typer.Option(
            "--scene",
            "-s",
            metavar="NAME[:key=v]|MESHFILE",
            help="A scene and its parameters, or a mesh file. May be repeated.",
            autocompletion=completion.scenes,
        ),
    ] = None,
    light: Annotated[
        list[str] | None, typer.Option("--light", metavar="NAME", help="One of the scene's lights.")
    ] = None,
    camera: Annotated[
        list[str] | None, typer.Option("--camera", metavar="NAME", help="One of the scene's cameras.")
    ] = None,
    plugin: PluginOption = None,
    size: Annotated[
        list[str] | None, typer.Option("--size", metavar="WIDTHxHEIGHT", help="The picture's size, like 1024x768.")
    ] = None,
    pixel_samples: Annotated[
        list[int] | None,
        typer.Option("--pixel-samples", metavar="N", min=1, help="Samples of every pixel, each shadowed by itself."),
    ] = None,
    layers: Annotated[
        list[int] | None,
        typer.Option("--layers", metavar="N", min=1, help="Most surfaces a sample sees through translucent ones."),
    ] = None,
    moving: Annotated[
        list[str] | None,
        typer.Option(
            "--moving",
            metavar="WHAT",
            help="What moves between frames: everything, object, light or camera.",
            autocompletion=completion.movings,
        ),
    ] = None,
    device: Annotated[str, typer.Option("--device", metavar="NAME", help="The Warp device.")] = "cpu",
    threads: Annotated[
        list[int] | None,
        typer.Option("--threads", metavar="N", min=1, help="Threads a method may use; by default all cores."),
    ] = None,
    results: ResultsOption = DEFAULT_RESULTS,
    fresh: Annotated[
        bool,
        typer.Option(
            "--fresh",
            help="Begin a new run even if one of the same cases is there, and take over nothing that is known.",
        ),
    ] = False,
    timeout: Annotated[
        float | None, typer.Option("--timeout", metavar="S", help="Longest that a step of a case may take [s].")
    ] = None,
    budget: Annotated[
        float | None, typer.Option("--budget", metavar="S", help="Time for the rounds of one comparison [s].")
    ] = None,
    memory_limit: Annotated[
        float | None, typer.Option("--memory-limit", metavar="GIB", help="Memory at which a worker is stopped [GiB].")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the planned cases and measure nothing.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="One result row a line on standard output, as each case ends.")
    ] = False,
) -> None:
    """Measure experiments, or methods on scenes.

    The same command again goes on with its run, or shows it if it is complete. Other cases make another run: all of
    them are timed, in the same rounds, since times of different runs are not compared; but what a case looks like,
    counts and keeps is taken over from any earlier run, of any machine, that measured the same scene, method and code,
    once the case is seen to give the same bits.
    """
    from shadowbench.runner import RunOptions, plan

    choices = {
        "methods": method or [],
        "scenes": scene or [],
        "lights": light or [],
        "cameras": camera or [],
        "sizes": size or [],
        "pixel_samples": pixel_samples or [],
        "layers": layers or [],
        "moving": moving or [],
        "threads": threads or [],
    }
    given = {
        "timeout_s": _positive("--timeout", timeout),
        "budget_s": _positive("--budget", budget),
        "memory_limit_bytes": None if memory_limit is None else int(_positive("--memory-limit", memory_limit) * _GIB),
    }
    asked = experiments_of(experiment or [], choices)
    options = RunOptions(
        results=results,
        device=device,
        fresh=fresh,
        plugin_files=tuple(plugin or ()),
        argv=("shadowbench", *(context.obj or ())),
        **{name: value for name, value in given.items() if value is not None},
    )
    with ended_like_ctrl_c(), reserved_stdout() if as_json else nullcontext() as stream:
        with err().status("planning: finding methods, making scenes"):
            planned = plan(asked, options)
        if dry_run:
            _print_plan(planned, stream)
            return
        raise typer.Exit(_measure(planned, results, stream))


def experiments_of(names: Sequence[str], choices: dict[str, Any]) -> list[Experiment]:
    """Return the experiments that arguments and options ask for.

    Raises:
        ExperimentError: There is no such experiment, or its file is wrong.
        UsageError: An option's text is wrong.
    """
    from shadowbench.experiment import from_options, with_options
    from shadowbench.experiment_groups import expanded, load_one

    if not names and (choices["methods"] or choices["scenes"]):
        return [from_options(**choices)]
    return [with_options(load_one(name), **choices) for name in expanded(names or (DEFAULT_EXPERIMENT,))]


def _measure(planned: Plan, results: Path, stream: TextIO | None) -> ExitStatus:
    from shadowbench import runner
    from shadowbench.cli.progress import JsonLines, showing_progress
    from shadowbench.rows import RunStatus
    from shadowbench.store import Store

    with Store.open(results) as store:
        with showing_progress(stream) as observer:
            record = runner.run(planned, store, observer)
        rows = store.rows(record.run_id)
        if isinstance(observer, JsonLines):
            observer.write_rest(rows)
        else:
            _print_tables(rows, record)
        _print_outcomes(rows, record)
        _print_claims(rows, record)
        _write_report(store, record)
    if record.status is RunStatus.INTERRUPTED:
        return ExitStatus.INTERRUPTED
    return ExitStatus.CASES_FAILED if any(row.outcome.is_failure for row in rows) else ExitStatus.OK


def _print_tables(rows: list[ResultRow], record: RunRecord) -> None:
    from shadowbench import tables

    if rows:
        put(tables.render(tables.make(rows, run=record), "rich"))
        sys.stdout.flush()


def _print_outcomes(rows: list[ResultRow], record: RunRecord) -> None:
    from rich.text import Text

    from shadowbench.cli.progress import outcome_text

    counts = Counter(row.outcome for row in rows)
    parts = [Text(f"{count} ") + outcome_text(outcome) for outcome, count in counts.items()]
    missing = record.case_count - len(rows)
    if missing > 0:
        parts.append(Text(f"{missing} not measured", style="yellow"))
    line = plain(f"run {record.run_id}: ") + Text(", ").join(parts or [Text("no case")])
    if missing > 0:
        line += Text(" (the same command goes on with it)")
    err().print(line, soft_wrap=True)


def _print_claims(rows: list[ResultRow], record: RunRecord) -> None:
    """Say how many of the experiments' claims hold; nothing where none is made."""
    from shadowbench.tables.claims import answer_claims
    from shadowbench.tables.claims_text import tally

    answers = answer_claims(record, rows)
    if answers:
        err().print(plain(f"claims: {tally(answers)} (shadowbench claims {record.run_id})"), soft_wrap=True)


def _write_report(store: Store, record: RunRecord) -> None:
    """Write the report and say where; measured rows are worth more than it, so failing here changes no exit status."""
    from shadowbench.report import default_path, write

    try:
        path = write(store, record, default_path(store, record))
    except ShadowbenchError as error:
        complain(f"warning: {error}")
    else:
        err().print(plain(f"report: {path}"), soft_wrap=True)


def _print_plan(planned: Plan, stream: TextIO | None) -> None:
    """Print the cases: a table, or with ``--json`` one object a line."""
    if stream is not None:
        for case in planned.cases:
            stream.write(json.dumps(dataclasses.asdict(case), default=str) + "\n")
        return
    from rich.table import Table

    from shadowbench.rows import method_label

    for number, cases in enumerate(planned.comparisons, 1):
        listed = Table(box=None, pad_edge=False, header_style="bold", title_justify="left", title_style="bold")
        listed.title = plain(f"comparison {number}: {cases[0].view}").plain if cases else None
        for column in ("method", "device", "threads", "note"):
            listed.add_column(column, overflow="fold")
        for case in cases:
            note = "" if case.obstacle is None else f"{case.obstacle.outcome}: {case.obstacle.reason}"
            label = method_label(case.method, case.method_parameters)
            listed.add_row(plain(label), plain(case.device), str(case.threads), plain(note, "yellow"))
        put(listed)
        print()
    for text in planned.notes:
        put(plain(f"note: {text}"))
    print(f"{len(planned.cases)} cases; nothing was measured")


def _positive(option: str, value: float | None) -> Any:
    from shadowbench.errors import UsageError

    if value is not None and not 0.0 < value < float("inf"):
        raise UsageError(f"{option} must be a positive number, not {value:g}")
    return value
