"""``shadowbench publish`` and ``shadowbench verify``: results that a project stands behind, and code held to them."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.cli import completion
from shadowbench.cli.console import complain, err, plain, reserved_stdout
from shadowbench.cli.exit_status import ExitStatus
from shadowbench.cli.interruption import ended_like_ctrl_c
from shadowbench.cli.options import DEFAULT_RESULTS, ResultsOption, open_store
from shadowbench.cli.views import quieten_warp
from shadowbench.errors import ShadowbenchError, UsageError, did_you_mean

if TYPE_CHECKING:
    from shadowbench.rows import ResultRow


def publish(
    run: Annotated[
        str | None,
        typer.Argument(
            metavar="[RUN]",
            help="A run's id, the beginning of one, or 'latest'. Without it every experiment is measured, or gone on "
            "with, first: over an hour.",
            autocompletion=completion.runs,
            show_default=False,
        ),
    ] = None,
    to: Annotated[Path, typer.Option("--to", metavar="DIR", help="The folder to write.")] = Path("results"),
    results: ResultsOption = DEFAULT_RESULTS,
) -> None:
    """Write a run as pages, tables, claims, rows and small pictures that a repository can hold."""
    from shadowbench.publication.folder import write_folder

    quieten_warp()
    if run is None:
        run = _measured(results)
    with ended_like_ctrl_c(), reserved_stdout() as stream, open_store(results) as store:
        from shadowbench.publication.holding import computed_levels

        record = store.find_run(run)
        if not store.rows(record.run_id):
            raise UsageError(f"run {record.run_id} has no finished case yet")
        count = write_folder(store, record, to, lambda row: computed_levels(row, results))
        stream.write(f"{to / 'README.md'}\n")
    complain(f"run {record.run_id}: {len(record.experiments)} experiments, {count} cases to verify by")


def verify(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="The folder of published results.", show_default=False)
    ] = Path("results"),
    experiment: Annotated[
        list[str] | None,
        typer.Option("--experiment", "-e", metavar="E", help="Only this experiment's cases. May be repeated."),
    ] = None,
) -> int:
    """Compute a sample of published results again: the same counters, bytes and hard visibility, filtered within 1/255.

    Exit status 1 if any case moved; a line says which and how.
    """
    from shadowbench.publication.folder import read_rows, read_sample

    rows = read_rows(folder)
    published = read_sample(folder)
    by_key: dict[str, ResultRow] = {}
    for row in rows:
        by_key.setdefault(row.case_key, row)
    names = sorted({row.experiment for row in rows})
    for name in experiment or []:
        if name not in names:
            raise UsageError(f"{folder} has no experiment '{name}'; {did_you_mean(name, names, noun='experiment')}")
    unknown = [key for key in published if key not in by_key]
    if unknown:
        raise UsageError(f"{folder}/visibility/{unknown[0]}.png is of no case in any rows.csv")
    chosen = [by_key[key] for key in published if not experiment or by_key[key].experiment in experiment]
    if not chosen:
        raise UsageError(f"{folder} has no case to compute again; publish the run once more")
    chosen.sort(key=lambda row: (row.scene, str(row.scene_parameters), row.light, row.camera, row.experiment))
    quieten_warp()
    moved = 0
    with ended_like_ctrl_c(), reserved_stdout() as stream, tempfile.TemporaryDirectory(prefix="shadowbench-") as cache:
        from shadowbench.publication.holding import differences
        from shadowbench.rows import method_label

        for number, row in enumerate(chosen, 1):
            try:
                found = differences(row, published[row.case_key], Path(cache))
            except ShadowbenchError as error:
                found = [f"cannot be computed: {error}"]
            label = (
                f"{row.experiment}: {method_label(row.method, row.method_parameters)} on {row.scene}, {row.case_key}"
            )
            if found:
                moved += 1
                stream.write(f"moved {plain(label).plain}: {plain('; '.join(found)).plain}\n")
            else:
                stream.write(f"same  {plain(label).plain}\n")
            stream.flush()
            if err().is_terminal:
                err().print(f"{number} of {len(chosen)}", end="\r")
    sys.stdout.flush()
    complain(f"{moved} of {len(chosen)} cases moved" if moved else f"all {len(chosen)} cases are as published")
    return ExitStatus.CASES_FAILED if moved else ExitStatus.OK


def _measured(results: Path) -> str:
    """Measure every experiment, or go on with it, and return the run's id."""
    from shadowbench import runner
    from shadowbench.cli.progress import showing_progress
    from shadowbench.experiment_groups import EVERYTHING, expanded, load_one
    from shadowbench.rows import RunStatus
    from shadowbench.runner import RunOptions, plan
    from shadowbench.store import Store

    with ended_like_ctrl_c():
        options = RunOptions(results=results, argv=("shadowbench", "run", EVERYTHING))
        planned = plan([load_one(name) for name in expanded((EVERYTHING,))], options)
        with Store.open(results) as store, showing_progress(None) as observer:
            record = runner.run(planned, store, observer)
    if record.status is not RunStatus.COMPLETE:
        raise typer.Exit(ExitStatus.INTERRUPTED)
    return record.run_id
