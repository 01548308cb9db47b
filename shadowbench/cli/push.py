"""``shadowbench push``: a run from here to a results service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.cli.console import complain, plain, put
from shadowbench.cli.options import DEFAULT_RESULTS, DatabaseOption, ResultsOption, RunArgument, open_store

_EVERY = 20


def push(
    run: RunArgument,
    address: Annotated[
        str, typer.Argument(metavar="URL", help="The service, https://results.example.org.", show_default=False)
    ],
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be sent and send nothing.")] = False,
    token_file: Annotated[
        Path | None,
        typer.Option(
            "--token-file",
            metavar="FILE",
            help="Has the token, with mode 600; by default SHADOWBENCH_TOKEN or ~/.config/shadowbench/token.",
            show_default=False,
        ),
    ] = None,
    results: ResultsOption = DEFAULT_RESULTS,
    database: DatabaseOption = None,
) -> None:
    """Send a run to a results service; typed again it goes on where it stopped."""
    from shadowbench.service.client import Client, find_token

    with open_store(results, database) as store:
        record = store.find_run(run)
        client = Client(address, find_token(token_file), _Progress())
        try:
            pushed = client.push(store, record, dry_run=dry_run)
        finally:
            client.close()
    put(
        plain(
            f"run {pushed.run_id}: {pushed.kept}, {pushed.row_count} rows, {pushed.sent_pictures} of"
            f" {pushed.picture_count} pictures, {pushed.sent_bytes:,} bytes"
        )
    )


class _Progress:
    def sending(self, done: int, total: int) -> None:
        if done % _EVERY == 0:
            complain(f"pictures: {done} of {total} sent")

    def waiting(self, seconds: float, reason: str) -> None:
        complain(f"{reason}; again in {seconds:.1f} s")
