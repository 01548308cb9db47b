"""``shadowbench serve`` and ``export-site``: the results folder as a web service, or as files for any web server."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.cli.options import DEFAULT_RESULTS, DatabaseOption, ResultsOption
from shadowbench.errors import UsageError

_MEBIBYTE = 2**20


def serve(
    host: Annotated[
        str, typer.Option("--host", metavar="ADDRESS", help="Where to listen; others than this machine need tokens.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", metavar="N", min=0, max=65535, help="0 for any free one.")] = 8765,
    results: ResultsOption = DEFAULT_RESULTS,
    database: DatabaseOption = None,
    workers: Annotated[int, typer.Option("--workers", metavar="N", min=1, max=64, help="Processes.")] = 1,
    private: Annotated[
        bool, typer.Option("--private", help="Reading needs a token as well, not uploading alone.")
    ] = False,
    allow_host: Annotated[
        list[str] | None,
        typer.Option(
            "--allow-host", metavar="NAME", help="A name that the service is asked for by; may be repeated; * for any."
        ),
    ] = None,
    behind_proxy: Annotated[
        bool, typer.Option("--behind-proxy", help="A proxy on this machine says who asks (X-Forwarded-For).")
    ] = False,
    rate: Annotated[
        float, typer.Option("--rate", metavar="N", min=0.0, help="Requests a second of one address; 0 for no limit.")
    ] = 50.0,
    largest_body: Annotated[
        int, typer.Option("--largest-body", metavar="MIB", min=1, max=4096, help="Of an uploaded run.")
    ] = 64,
    title: Annotated[str, typer.Option("--title", metavar="TEXT", help="What pages call it.")] = "shadowbench results",
) -> None:
    """Serve the results: pages, JSON, CSV, and uploads by token."""
    _check_extra()
    from shadowbench.service.settings import Settings

    settings = Settings(
        results=results,
        database=database,
        title=title,
        open_reading=not private,
        hosts=tuple(dict.fromkeys(("127.0.0.1", "localhost", "[::1]", host, *(allow_host or ())))),
        requests_a_second=rate,
        largest_body=largest_body * _MEBIBYTE,
    )
    from shadowbench.service.serving import serve as serve_it

    serve_it(settings, host, port, workers, is_proxied=behind_proxy)


def export_site(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Empty, or written by this before.", show_default=False)
    ],
    results: ResultsOption = DEFAULT_RESULTS,
    database: DatabaseOption = None,
    title: Annotated[str, typer.Option("--title", metavar="TEXT", help="What pages call it.")] = "shadowbench results",
) -> None:
    """Write all pages as files, for a web server that runs nothing (GitHub Pages)."""
    _check_extra()
    from shadowbench.cli.options import open_store
    from shadowbench.service.site import write_site

    with open_store(results, database) as store:
        count = write_site(store, folder, title)
    print(f"{folder}: {count} files")


def _check_extra() -> None:
    try:
        import fastapi  # noqa: F401
        import prometheus_client  # noqa: F401
        import uvicorn  # noqa: F401
    except ImportError as error:
        raise UsageError(f"the service needs {error.name}: pip install 'shadowbench[serve]'") from None
