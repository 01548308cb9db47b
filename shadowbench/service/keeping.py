"""What is done with what was uploaded: decoded, validated and kept; in this process, or in one beside it.

Half a thousand rows take most of half a second of an interpreter in which only one thread runs at a time, and readers
would wait for it. A service therefore has :class:`KeepingApart` do it: in a process of lower priority, which no request
for a page waits for, and which takes no reader with it if a picture brings its decoder down.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import cache
from typing import Any, Protocol, TypeVar

from shadowbench.errors import StoreError
from shadowbench.service.pictures import PictureError, check_png
from shadowbench.service.settings import Settings
from shadowbench.store import Store
from shadowbench.store.documents import DocumentError, parsed, rows_from_documents, run_from_document
from shadowbench.store.uploads import KeptRun, Uploader, put_picture, put_run

_Result = TypeVar("_Result")

_SUFFIX = ".png"

_NICENESS = 5
"""Where all cores are busy, readers get about three times the processor time of an upload."""


class Keeper(Protocol):
    """Keeps what was uploaded: on the disk before a method returns."""

    def keep_run(self, run_id: str, content: bytes, uploader: Uploader) -> KeptRun:
        """Keep a run that was uploaded to this id as a JSON text.

        Raises:
            DocumentError: It is none.
            StoreError: It is another's, lacks pictures, or cannot be written.
        """

    def keep_picture(self, name: str, content: bytes, uploader: Uploader) -> bool:
        """Keep a PNG file; return whether it is new.

        Raises:
            DocumentError: It is none, or not this one.
            StoreError: It cannot be written.
        """

    def close(self) -> None:
        """Return once what has begun is done."""


class Keeping:
    """Keeps in the calling thread."""

    def __init__(self, store: Store, most_pixels: int) -> None:
        self._store, self._most_pixels = store, most_pixels

    def keep_run(self, run_id: str, content: bytes, uploader: Uploader) -> KeptRun:
        """See :class:`Keeper`."""
        document = parsed(content, "body")
        if not isinstance(document, dict) or set(document) != {"run", "rows"}:
            raise DocumentError("body", "is not an object with 'run' and 'rows'")
        run = run_from_document(document["run"])
        if run.run_id != run_id:
            raise DocumentError("run.run_id", "is not the id in the address")
        if run.finished_at is None:
            raise DocumentError("run.finished_at", "the run has not ended")
        return put_run(self._store, run, rows_from_documents(document["rows"], run), uploader)

    def keep_picture(self, name: str, content: bytes, uploader: Uploader) -> bool:
        """See :class:`Keeper`."""
        try:
            self._store.artifacts.path(name)
        except StoreError as error:
            raise DocumentError("path.name", str(error)) from None
        if not name.endswith(_SUFFIX):
            raise DocumentError("path.name", "is not that of a PNG file: only pictures are taken")
        if hashlib.sha256(content).hexdigest() != name.removesuffix(_SUFFIX):
            raise DocumentError("body", "does not have the SHA-256 of its name")
        try:
            check_png(content, self._most_pixels)
        except PictureError as error:
            raise DocumentError("body", str(error)) from None
        return put_picture(self._store, content, uploader)

    def close(self) -> None:
        """Nothing has begun that is not done."""


class KeepingApart:
    """Keeps in a process of its own, which the first upload starts: one at a time, since one at a time writes."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._pool: ProcessPoolExecutor | None = None

    def keep_run(self, run_id: str, content: bytes, uploader: Uploader) -> KeptRun:
        """See :class:`Keeper`."""
        return self._do(_keep_run, run_id, content, uploader)

    def keep_picture(self, name: str, content: bytes, uploader: Uploader) -> bool:
        """See :class:`Keeper`."""
        return self._do(_keep_picture, name, content, uploader)

    def close(self) -> None:
        """See :class:`Keeper`."""
        with self._lock:
            pool, self._pool = self._pool, None
        if pool is not None:
            pool.shutdown()

    def _do(self, keep: Callable[..., _Result], *given: Any) -> _Result:
        with self._lock:
            if self._pool is None:
                self._pool = ProcessPoolExecutor(
                    max_workers=1,
                    mp_context=multiprocessing.get_context("spawn"),
                    initializer=_begin,
                )
            pool = self._pool
        try:
            return pool.submit(keep, self._settings, *given).result()
        except BrokenProcessPool:
            with self._lock:
                if self._pool is pool:  # the next upload starts another
                    self._pool = None
            pool.shutdown(wait=False)
            raise StoreError("the process that keeps uploads ended before this one was kept") from None


# what the process beside the service runs


def _begin() -> None:
    for number in (signal.SIGINT, signal.SIGTERM):  # sent to all processes of a terminal or unit: the service ends this
        signal.signal(number, signal.SIG_IGN)
    os.nice(_NICENESS)
    threading.Thread(target=_end_with_service, daemon=True).start()


def _end_with_service() -> None:
    """End when the service was killed: what is not acknowledged by then need not be kept, and is not by half."""
    service = multiprocessing.parent_process()
    assert service is not None
    service.join()
    os._exit(1)


@cache
def _keeping(settings: Settings) -> Keeping:
    return Keeping(Store.open(settings.results, database=settings.database), settings.most_pixels)


def _keep_run(settings: Settings, run_id: str, content: bytes, uploader: Uploader) -> KeptRun:
    return _keeping(settings).keep_run(run_id, content, uploader)


def _keep_picture(settings: Settings, name: str, content: bytes, uploader: Uploader) -> bool:
    return _keeping(settings).keep_picture(name, content, uploader)
