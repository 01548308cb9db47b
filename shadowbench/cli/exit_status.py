"""The exit statuses of the command line."""

from __future__ import annotations

from enum import IntEnum


class ExitStatus(IntEnum):
    """How a command ended, for scripts."""

    OK = 0
    """Done; in ``run`` every case is ok or skipped."""
    CASES_FAILED = 1
    """``run``: everything was tried, and at least one case failed. ``doctor``: something needed is missing."""
    USAGE = 2
    """Bad usage or a bad file; nothing, or nothing more, was measured."""
    INTERNAL = 70
    """A fault of shadowbench itself."""
    INTERRUPTED = 130
    """Interrupted; everything finished so far is kept."""
    READER_GONE = 141
    """Standard output was closed by its reader."""
