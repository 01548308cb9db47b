"""What the processes of one test session share: made by the first that needs it, gone when the session ends."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

_VARIABLE = "SHADOWBENCH_TEST_SESSION"


def begin() -> None:
    """Make the folder that the session's processes share; call it in the process that starts the others."""
    os.environ[_VARIABLE] = tempfile.mkdtemp(prefix="shadowbench-tests-")


def end() -> None:
    """Remove it."""
    shutil.rmtree(os.environ.pop(_VARIABLE))


def made(name: str, make: Callable[[Path], object]) -> Path:
    """Return a folder that is filled once a session; who comes meanwhile waits.

    Args:
        name: What it is called.
        make: Fills the empty folder. If it raises, the next process tries again.
    """
    shared, mark = _folder(name), _folder(f"{name}.made")
    with _folder(f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not mark.exists():
            shutil.rmtree(shared, ignore_errors=True)
            shared.mkdir()
            make(shared)
            mark.touch()
    return shared


def _folder(name: str) -> Path:
    return Path(os.environ[_VARIABLE]) / name
