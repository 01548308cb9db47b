"""Being asked to end: SIGTERM and SIGHUP end a run as Ctrl-C does, with everything finished kept and status 130."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_ENDING = (signal.SIGTERM, signal.SIGHUP)


@contextmanager
def ended_like_ctrl_c() -> Iterator[None]:
    """Raise ``KeyboardInterrupt`` where a service manager, a batch system or a closing terminal asks to end.

    A signal that the caller has made this process ignore (``nohup``) or handles itself stays as it is.
    """
    if threading.current_thread() is not threading.main_thread():  # only there can signals be handled
        yield
        return
    taken = [number for number in _ENDING if signal.getsignal(number) is signal.SIG_DFL]
    for number in taken:
        signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)
