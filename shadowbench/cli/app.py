"""The typer app: the commands in the order of ``--help``, and what stands above them."""

from __future__ import annotations

from typing import Annotated

import typer

from shadowbench import __version__
from shadowbench.cli.check import check
from shadowbench.cli.claims import claims
from shadowbench.cli.compare import compare
from shadowbench.cli.doctor import doctor
from shadowbench.cli.exit_status import ExitStatus
from shadowbench.cli.export import export_scene, score
from shadowbench.cli.listing import list_names, show
from shadowbench.cli.pareto import pareto
from shadowbench.cli.publication import publish, verify
from shadowbench.cli.push import push
from shadowbench.cli.results import report, table
from shadowbench.cli.run import run
from shadowbench.cli.serve import export_site, serve
from shadowbench.cli.token import app as token_app
from shadowbench.cli.transfer import backup, export_, import_, restore
from shadowbench.cli.view import view
from shadowbench.cli.worker import scheduler, worker

_EPILOG = (
    "Exit status: 0 all cases ok or skipped, 1 some case failed, 2 bad usage or a bad file, 70 a fault of shadowbench, "
    "130 interrupted (everything finished is kept)."
)

app = typer.Typer(
    name="shadowbench",
    help="Every shadow algorithm against one ray-traced ground truth.",
    epilog=_EPILOG,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _print_version(value: bool) -> None:
    if value:
        print(f"shadowbench {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Every shadow algorithm against one ray-traced ground truth."""
    del version
    if context.invoked_subcommand is None:
        print(context.get_help())
        raise typer.Exit(ExitStatus.USAGE)


app.command()(run)
app.command("list")(list_names)
app.command()(show)
app.command()(table)
app.command()(claims)
app.command()(pareto)
app.command()(report)
app.command()(compare)
app.command()(view)
app.command("export-scene")(export_scene)
app.command()(score)
app.command()(check)
app.command()(doctor)
app.command()(publish)
app.command()(verify)
app.command()(serve)
app.command()(push)
app.add_typer(token_app, name="token")
app.command("export-site")(export_site)
app.command("export")(export_)
app.command("import")(import_)
app.command()(backup)
app.command()(restore)
app.command()(worker)
app.command()(scheduler)
