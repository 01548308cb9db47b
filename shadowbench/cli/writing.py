"""Where tables and answers go: to standard output, or to the file that ``--output`` names."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from shadowbench.cli.console import put
from shadowbench.errors import UsageError

if TYPE_CHECKING:
    from rich.console import RenderableType


def write_out(written: str | RenderableType, output: Path | None) -> None:
    """Write text, or what rich can print, to a file (then without colour, 160 columns wide) or to standard output.

    Raises:
        UsageError: The file cannot be written.
    """
    if output is not None:
        _write(output, written)
    elif isinstance(written, str):
        sys.stdout.write(written)
    else:
        put(written)


def _write(path: Path, written: str | RenderableType) -> None:
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            if isinstance(written, str):
                file.write(written)
            else:
                from rich.console import Console

                Console(file=file, width=160, highlight=False).print(written)
    except OSError as error:
        raise UsageError(f"--output {path}: {error.strerror}") from error
