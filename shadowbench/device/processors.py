"""Keeping a library's own threads to as many processors as a case may use.

Libraries such as Embree and Mesa start threads of their own, and some of them as many as the machine has processors.
A thread inherits the processors of the one that starts it, so what is started inside :func:`confined_to` stays there.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def confined_to(threads: int) -> Iterator[None]:
    """Let this thread, and threads started here, use only so many processors, where the system knows such a thing."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(allowed)[:threads])
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)
