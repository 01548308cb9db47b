"""One job at a time a machine, whoever runs the workers: a queue of files, held by locks that die with their process.

Whoever comes takes a ticket, a file with the next number that he locks, and waits until every lower ticket is let go
of: first come, first served. The kernel lets go of a dead process's ticket, so that nobody waits for it.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

FOLDER_VARIABLE = "SHADOWBENCH_HOST_LOCK"
"""Names another folder; it must be the same for all workers of a machine, and on a disk of its own."""

_DOOR = "door"


def lock_folder() -> Path:
    """Return the folder of this machine's tickets."""
    named = os.environ.get(FOLDER_VARIABLE)
    if named:
        return Path(named)
    shared = Path("/run/lock")
    base = shared if os.access(shared, os.W_OK) else Path(tempfile.gettempdir())
    return base / "shadowbench"


@contextmanager
def only_job_here(folder: Path, waiting: Callable[[], None] | None = None) -> Iterator[None]:
    """Hold the machine.

    Args:
        folder: See :func:`lock_folder`.
        waiting: Called each time that somebody else turns out to have it.

    Raises:
        OSError: The folder cannot be used.
    """
    own, descriptor, earlier = _take_ticket(folder)
    try:
        for ticket in earlier:
            _outlast(ticket, waiting)
        yield
    finally:
        own.unlink(missing_ok=True)
        os.close(descriptor)


def _take_ticket(folder: Path) -> tuple[Path, int, list[Path]]:
    """Return a new ticket, its open file, and those before it."""
    if not folder.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        with suppress(PermissionError):
            folder.chmod(0o1777)
    door = _open(folder / _DOOR)
    try:
        fcntl.flock(door, fcntl.LOCK_EX)
        earlier = sorted(int(name) for name in os.listdir(folder) if name.isdecimal())  # noqa: PTH208 - names only
        own = folder / str(earlier[-1] + 1 if earlier else 1)
        descriptor = _open(own)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
    finally:
        os.close(door)
    return own, descriptor, [folder / str(number) for number in earlier]


def _outlast(ticket: Path, waiting: Callable[[], None] | None) -> None:
    """Wait until nobody holds a ticket, and throw away one that a dead process left."""
    try:
        descriptor = os.open(ticket, os.O_RDONLY)
    except FileNotFoundError:
        return
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if waiting is not None:
                waiting()
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        with suppress(PermissionError):  # another user's
            ticket.unlink(missing_ok=True)
    finally:
        os.close(descriptor)


def _open(file: Path) -> int:
    """Open a file that every user of the machine may lock; made if need be."""
    try:
        return os.open(file, os.O_RDONLY)
    except FileNotFoundError:
        descriptor = os.open(file, os.O_RDONLY | os.O_CREAT, 0o666)
        with suppress(PermissionError):
            os.fchmod(descriptor, 0o644)
        return descriptor
