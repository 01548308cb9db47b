"""Reports of runs, made once and kept, packed, in the results folder until their run changes.

A report of many cases embeds thousands of pictures, which takes its time; so one is made at a time, and what was made
is kept for all worker processes and across restarts, the oldest thrown away when there are too many bytes of them.
"""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import io
import re
from dataclasses import dataclass
from pathlib import Path

from anyio import CapacityLimiter, to_thread

import shadowbench
from shadowbench import report
from shadowbench.errors import StoreError
from shadowbench.service import answers
from shadowbench.store import Store
from shadowbench.store.artifacts import write_whole
from shadowbench.store.catalogue import Catalogue
from shadowbench.store.engine import store_errors

MOST_BYTES = 2**29
"""What all kept reports may take together."""

_FOLDER = "kept-reports"
_SUFFIX = ".html.gz"
_POLICY = re.compile(rb'http-equiv="Content-Security-Policy" content="([^"]*)"')


@dataclass(frozen=True)
class Report:
    """A report as it is sent."""

    packed: bytes
    """gzip."""
    key: str
    """Of the run as it was."""

    def unpacked(self) -> bytes:
        """Return its HTML text."""
        return gzip.decompress(self.packed)

    def policy(self) -> str:
        """Return its content policy, which names its style and script by their hashes."""
        with gzip.GzipFile(fileobj=io.BytesIO(self.packed)) as text:
            found = _POLICY.search(text.read(2**16))
        assert found is not None
        return found[1].decode("ascii").replace("&#39;", "'")


class Reports:
    """Gives out reports."""

    def __init__(self, store: Store, catalogue: Catalogue, most_bytes: int = MOST_BYTES) -> None:
        self._store, self._catalogue, self._most_bytes = store, catalogue, most_bytes
        self._folder = store.folder / _FOLDER
        self._one_at_a_time = CapacityLimiter(1)

    async def of(self, run_id: str) -> Report:
        """Return the report of a run.

        Raises:
            Problem: There is no such run.
            StoreError: It cannot be read.
        """
        found = await to_thread.run_sync(self._kept, run_id)
        if found is None:
            return await to_thread.run_sync(self._made, run_id, limiter=self._one_at_a_time)
        return found

    def _kept(self, run_id: str) -> Report | None:
        key = self._key(run_id)
        with contextlib.suppress(OSError):
            return Report(self._path(key).read_bytes(), key)
        return None

    def _made(self, run_id: str) -> Report:
        found = self._kept(run_id)  # while this one waited, say
        if found is not None:
            return found
        key = self._key(run_id)  # before the rows are read: what changes meanwhile is read again for the next one
        text = report.html(self._store, answers.find_run(self._store, run_id))
        made = Report(gzip.compress(text.encode("utf-8"), compresslevel=5, mtime=0), key)
        with contextlib.suppress(StoreError), store_errors(self._folder, "keep the report"):  # it can be made again
            self._make_room(len(made.packed))
            write_whole(self._path(key), made.packed)
        return made

    def _make_room(self, byte_count: int) -> None:
        oldest_first = sorted(self._folder.glob(f"*{_SUFFIX}"), key=lambda path: path.stat().st_mtime)
        sizes = [path.stat().st_size for path in oldest_first]
        left = sum(sizes) + byte_count
        for path, size in zip(oldest_first, sizes, strict=True):
            if left <= self._most_bytes:
                break
            path.unlink(missing_ok=True)
            left -= size

    def _key(self, run_id: str) -> str:
        state = f"{shadowbench.__version__} {run_id} {self._catalogue.state_of(run_id)}"
        return hashlib.sha256(state.encode("utf-8")).hexdigest()[:32]

    def _path(self, key: str) -> Path:
        return self._folder / f"{key}{_SUFFIX}"
