"""Arguments and options that several commands share, and the results folder behind ``--results``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.cli import completion

if TYPE_CHECKING:
    from shadowbench.store import Store

DEFAULT_RESULTS = Path("shadowbench-results")

ResultsOption = Annotated[
    Path,
    typer.Option("--results", metavar="DIR", envvar="SHADOWBENCH_RESULTS", file_okay=True, help="The results folder."),
]

DatabaseOption = Annotated[
    str | None,
    typer.Option(
        "--database",
        metavar="URL",
        envvar="SHADOWBENCH_DATABASE",
        help="A PostgreSQL database with the runs, postgresql://user@host/name; otherwise the folder's own.",
        show_default=False,
        show_envvar=True,
    ),
]

PluginOption = Annotated[
    list[Path] | None,
    typer.Option("--plugin", metavar="FILE.py", help="A file with methods or scenes of your own; may be repeated."),
]

TlsCaOption = Annotated[
    Path | None,
    typer.Option(
        "--tls-ca",
        metavar="FILE",
        envvar="SHADOWBENCH_TLS_CA",
        help="The authority behind all certificates (PEM).",
    ),
]

TlsCertOption = Annotated[
    Path | None,
    typer.Option("--tls-cert", metavar="FILE", envvar="SHADOWBENCH_TLS_CERT", help="This side's certificate (PEM)."),
]

TlsKeyOption = Annotated[
    Path | None,
    typer.Option("--tls-key", metavar="FILE", envvar="SHADOWBENCH_TLS_KEY", help="The certificate's key (PEM)."),
]

RunArgument = Annotated[
    str,
    typer.Argument(
        metavar="RUN",
        help="A run's id, the beginning of one, or 'latest'.",
        autocompletion=completion.runs,
        show_default=False,
    ),
]


def open_store(folder: Path, database: str | None = None) -> Store:
    """Open a results folder for reading.

    Args:
        folder: The folder.
        database: Address of the PostgreSQL database that has its runs, if one has.

    Raises:
        StoreError: There is none, or it cannot be read.
    """
    from shadowbench.store import Store

    return Store.open(folder, create=False, database=database)
