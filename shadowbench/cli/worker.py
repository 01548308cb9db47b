"""``shadowbench worker`` and ``shadowbench scheduler``: the processes of a cluster; ``run --cluster`` uses it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.cli.console import complain
from shadowbench.cli.options import TlsCaOption, TlsCertOption, TlsKeyOption

DEFAULT_LISTENING = "127.0.0.1:8786"


def worker(
    address: Annotated[
        str, typer.Argument(metavar="ADDRESS", help="The scheduler's, like tcp://127.0.0.1:8786.", show_default=False)
    ],
    cache: Annotated[
        Path | None,
        typer.Option("--cache", metavar="DIR", help="Where scenes and references are kept; by default ~/.cache."),
    ] = None,
    host: Annotated[
        str | None, typer.Option("--host", metavar="ADDRESS", help="The address of this machine to listen on.")
    ] = None,
    tls_ca: TlsCaOption = None,
    tls_cert: TlsCertOption = None,
    tls_key: TlsKeyOption = None,
) -> None:
    """Measure for a cluster's clients, until the scheduler goes away.

    Whoever reaches the scheduler can run code here: use TLS, or a network that you trust.
    """
    from shadowbench.runner.cases import ClusterAccess
    from shadowbench.runner.cluster.starting import default_folder, serve_worker

    access = ClusterAccess(address, tls_ca, tls_cert, tls_key)
    serve_worker(access, cache or default_folder(), host, complain)


def scheduler(
    address: Annotated[
        str, typer.Argument(metavar="[HOST:PORT]", help="Where to listen.", show_default=True)
    ] = DEFAULT_LISTENING,
    tls_ca: TlsCaOption = None,
    tls_cert: TlsCertOption = None,
    tls_key: TlsKeyOption = None,
) -> None:
    """Bring a cluster's workers and clients together, until interrupted.

    Whoever reaches it can run code on every worker: use TLS, or a network that you trust.
    """
    from shadowbench.runner.cases import ClusterAccess
    from shadowbench.runner.cluster.starting import serve_scheduler

    serve_scheduler(ClusterAccess(address, tls_ca, tls_cert, tls_key), complain)
