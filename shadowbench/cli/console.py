"""Where text goes: standard output for results, standard error for everything else.

Rich decides about colour (only on a terminal, and ``NO_COLOR`` is honoured). Text that comes from users, plugins or
files passes :func:`plain`, so that no name can move the cursor or colour the terminal.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from typing import TYPE_CHECKING, TextIO

from shadowbench.tables import plain_text

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.text import Text


def out() -> Console:
    """Return a console on standard output; it never wraps what goes to a file or pipe."""
    return _console(sys.stdout)


def err() -> Console:
    """Return a console on standard error."""
    return _console(sys.stderr)


def _console(stream: TextIO) -> Console:
    from rich.console import Console

    width = None if stream.isatty() or "COLUMNS" in os.environ else 160
    return Console(file=stream, width=width, highlight=False, markup=False, emoji=False)


def put(renderable: RenderableType) -> None:
    """Print on standard output; off a terminal without the blanks that rich fills lines with."""
    console = out()
    if console.is_terminal:
        console.print(renderable)
        return
    with console.capture() as captured:
        console.print(renderable)
    sys.stdout.write("".join(line.rstrip() + "\n" for line in captured.get().splitlines()))


def plain(value: object, style: str = "") -> Text:
    """Return text for a rich console: no markup is read in it, all control characters but line ends show as escapes."""
    from rich.text import Text

    return Text("\n".join(map(plain_text.plain, str(value).split("\n"))), style=style)


def complain(message: str) -> None:
    """Write one line, ``shadowbench: MESSAGE``, to standard error."""
    line = plain_text.plain(" ".join(message.split("\n")))
    with suppress(OSError, ValueError):  # standard error may be closed: then there is nobody to tell
        print(f"shadowbench: {line}", file=sys.stderr, flush=True)


@contextmanager
def reserved_stdout() -> Iterator[TextIO]:
    """Yield standard output for this caller alone; whatever else prints there meanwhile reaches standard error.

    For JSON Lines: a plugin's ``print``, in this process or in a worker, must not come between the rows.
    """
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        with os.fdopen(os.dup(kept), "w", encoding="utf-8", buffering=1) as stream, redirect_stdout(sys.stderr):
            yield stream
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)
