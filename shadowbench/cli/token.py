"""``shadowbench token``: who may upload to this store, or read from it where reading is not open."""

from __future__ import annotations

import datetime as dt
import re
from typing import Annotated

import typer

from shadowbench.cli.console import complain, plain, put
from shadowbench.cli.options import DEFAULT_RESULTS, DatabaseOption, ResultsOption
from shadowbench.errors import UsageError, did_you_mean

app = typer.Typer(help="Make, list and revoke the tokens of a results service.", no_args_is_help=True)

_SPANS = {"h": dt.timedelta(hours=1), "d": dt.timedelta(days=1), "w": dt.timedelta(weeks=1)}
_LONGEST_NAME = 100


@app.command()
def create(
    name: Annotated[str, typer.Option("--name", metavar="TEXT", help="Whose it is.", show_default=False)],
    scope: Annotated[
        str, typer.Option("--scope", metavar="SCOPE", help="read, upload (and read), or admin (replaces any run).")
    ] = "upload",
    expires: Annotated[str, typer.Option("--expires", metavar="SPAN", help="12h, 90d, 52w, or 'never'.")] = "90d",
    results: ResultsOption = DEFAULT_RESULTS,
    database: DatabaseOption = None,
) -> None:
    """Make a token and print it: the only time that it can be seen."""
    from shadowbench.store import Store
    from shadowbench.store.tokens import Scope, TokenBook

    if scope not in list(Scope):
        raise UsageError(f"there is no scope '{scope}'; {did_you_mean(scope, list(Scope), noun='scope')}")
    if not 0 < len(name.strip()) <= _LONGEST_NAME:
        raise UsageError(f"--name must have 1 to {_LONGEST_NAME} characters")
    with Store.open(results, database=database) as store:
        token, text = TokenBook(store).create(name.strip(), Scope(scope), _span(expires))
    print(text)
    complain(
        f"token {token.token_id} for '{name.strip()}', scope {scope},"
        f" {'until ' + token.expires_at if token.expires_at else 'without end'}; keep it: it is not shown again"
    )


@app.command("list")
def list_tokens(results: ResultsOption = DEFAULT_RESULTS, database: DatabaseOption = None) -> None:
    """List the tokens, without what only their owners know."""
    from rich.table import Table

    from shadowbench.store import Store
    from shadowbench.store.tokens import TokenBook

    with Store.open(results, create=False, database=database) as store:
        found = TokenBook(store).tokens()
    listed = Table(box=None, pad_edge=False, header_style="bold")
    for column in ("id", "name", "scope", "state", "created", "expires", "last used"):
        listed.add_column(column, overflow="fold")
    for token in found:
        moments = (token.created_at, token.expires_at or "never", token.last_used_at or "never")
        listed.add_row(*map(plain, (token.token_id, token.name, token.scope.value, token.state, *moments)))
    put(listed)


@app.command()
def revoke(
    token: Annotated[str, typer.Argument(metavar="ID|NAME", help="Which one.", show_default=False)],
    results: ResultsOption = DEFAULT_RESULTS,
    database: DatabaseOption = None,
) -> None:
    """Make a token worthless, at once and for ever."""
    from shadowbench.store import Store
    from shadowbench.store.tokens import TokenBook

    with Store.open(results, create=False, database=database) as store:
        revoked = TokenBook(store).revoke(token)
    put(plain(f"token {revoked.token_id} ('{revoked.name}') is revoked"))


def _span(text: str) -> dt.timedelta | None:
    if text == "never":
        return None
    match = re.fullmatch(r"([1-9][0-9]{0,4})([hdw])", text)
    if match is None:
        raise UsageError(f"--expires {text!r:.40} is not a span like 12h, 90d or 52w, nor 'never'")
    return int(match[1]) * _SPANS[match[2]]
