"""The command line: ``shadowbench`` and ``python -m shadowbench``.

::

    __init__.py     main(): every way a command can end becomes one line and an exit status
    app.py          the typer app: commands in the order of --help
    options.py      arguments and options that several commands share
    completion.py   what the shell completes
    console.py      where text goes: terminals, colours, stdout kept for JSON Lines
    run.py          run; interruption.py ends it when it is asked to
    progress.py     what a running plan shows
    listing.py      list, show
    results.py      table, report
    claims.py       claims
    pareto.py       pareto
    writing.py      what --output does
    publication.py  publish, verify
    serve.py        serve, export-site
    push.py         push
    transfer.py     export, import, backup, restore
    token.py        token create, list, revoke
    compare.py      compare
    view.py         view; receiver_text.py prints what --pixel finds
    export.py       export-scene, score
    views.py        options of commands that need a scene, a light and a camera
    check.py        check
    worker.py       worker, scheduler
    doctor.py       doctor; machine_checks.py has what it looks at

Commands import what they need when they run: ``shadowbench --help`` must not wait for NumPy or Warp.
"""

from __future__ import annotations

import errno
import io
import os
import sys
import tempfile
import traceback
from collections.abc import Sequence
from pathlib import Path

import typer

from shadowbench.cli.console import complain
from shadowbench.cli.exit_status import ExitStatus
from shadowbench.errors import ShadowbenchError

__all__ = ["main"]

_UsageError, _TyperError = typer.BadParameter.__mro__[1:3]
"""Typer's base classes of wrong usage and of all its messages, whichever copy of click it carries."""

_USERS_OWN = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EACCES, errno.EPERM, errno.EROFS})
"""Errors of the file system that the user can mend."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status; nothing is raised.

    Args:
        arguments: Instead of ``sys.argv[1:]``.
    """
    from shadowbench.cli.app import app

    given = list(sys.argv[1:] if arguments is None else arguments)
    _make_streams_take_all()
    try:
        ended = app(args=given, prog_name="shadowbench", standalone_mode=False, obj=tuple(given))
        sys.stdout.flush()
    except ShadowbenchError as error:
        return _refused(str(error), error)
    except (KeyboardInterrupt, typer.Abort):
        complain("interrupted")
        return ExitStatus.INTERRUPTED
    except BrokenPipeError:
        return _reader_gone()
    except SystemExit as request:  # typer's shell completion ends this way, and typer on a closed pipe
        if isinstance(request.__context__, BrokenPipeError):
            return _reader_gone()
        return request.code if isinstance(request.code, int) else ExitStatus.OK
    except Exception as error:  # noqa: BLE001 - the last line of defence: a user never sees a traceback
        return _unforeseen(error)
    return ended if isinstance(ended, int) else ExitStatus.OK


def _make_streams_take_all() -> None:
    """Let standard output and error take every character, and exist.

    What their encoding lacks (a non-UTF-8 locale, half a character in a file's name) becomes a question mark; a stream
    that the caller closed becomes the null device, before a results file can take its number.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 - as long as the process
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def _refused(message: str, error: BaseException) -> int:
    if _is_debugging():
        traceback.print_exception(error)
    complain(f"error: {message}")
    return ExitStatus.USAGE


def _unforeseen(error: Exception) -> int:
    if isinstance(error, _TyperError):
        return _refused(_typer_message(error), error)
    if isinstance(error, OSError) and error.errno in _USERS_OWN:
        where = f"{error.filename}: " if error.filename is not None else ""
        return _refused(f"{where}{os.strerror(error.errno)}", error)
    if _is_debugging():
        traceback.print_exception(error)
        where = "the traceback is above"
    else:
        where = f"the traceback is in {_written_traceback(error)}"
    reason = next(iter(str(error).splitlines()), "").strip()
    said = f"{type(error).__name__}: {reason}" if reason else type(error).__name__
    complain(f"internal error: {said}; please report it: {where}")
    return ExitStatus.INTERNAL


def _typer_message(error: Exception) -> str:
    """One line from a message of typer's, with the command whose ``--help`` says more."""
    said = error.format_message() if hasattr(error, "format_message") else str(error)
    said = " ".join(str(said).split()).rstrip(".")
    context = getattr(error, "ctx", None)
    hint = f" (see '{context.command_path} --help')" if isinstance(error, _UsageError) and context is not None else ""
    return said[:1].lower() + said[1:] + hint


def _written_traceback(error: Exception) -> str:
    """Write the traceback to a new file and return its path."""
    try:
        handle, path = tempfile.mkstemp(prefix="shadowbench-error-", suffix=".txt")
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write(f"shadowbench {' '.join(sys.argv[1:])}\n\n")
            file.writelines(traceback.format_exception(error))
    except OSError:
        return "no file (none could be written; SHADOWBENCH_DEBUG=1 prints it)"
    return path


def _reader_gone() -> int:
    """End quietly, as other programs do when ``| head`` has seen enough."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, sys.stdout.fileno())  # so that the flush at exit does not complain either
    return ExitStatus.READER_GONE


def _is_debugging() -> bool:
    return os.environ.get("SHADOWBENCH_DEBUG", "") not in ("", "0")
