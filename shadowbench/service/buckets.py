"""How often an address may ask: token buckets in memory that all worker processes of a service share.

A table of fixed size, whatever strangers do: an address has its bucket in one of a few places that a keyed hash of it
names, and where all of them are taken, the fullest bucket, which tells the least, gives way. The table is a file that
each process maps; whoever changes it holds a lock that the system lets go of when a process dies. A bucket that was
half written then is bounded when it is read, so the worst that a crash can do is to let somebody ask a little more.
"""

from __future__ import annotations

import fcntl
import hashlib
import ipaddress
import math
import mmap
import os
import secrets
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

_KEY_BYTES = 32
_BUCKET = struct.Struct("=16sdd")
"""Hash of the address, level, and when that was [s of the system's monotonic clock, the same in all processes]."""

_SETS, _PLACES = 2048, 8
_SIZE = _KEY_BYTES + _SETS * _PLACES * _BUCKET.size
_NOBODY = bytes(16)
_NETWORK_BITS = 64


class Buckets:
    """A bucket for each address: so much at once, then so much a second."""

    def __init__(
        self, rate: float, burst: float, file: Path | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Make the buckets, or share those of other processes.

        Args:
            rate: What flows into a bucket [1/s].
            burst: What it holds, and begins with.
            file: The table that processes share; made by the first of them. ``None`` for a process by itself.
            clock: Tells the time [s].
        """
        self._rate, self._burst, self._clock = rate, burst, clock
        self._lock = threading.Lock()
        self._file = None if file is None else os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        with self._alone():
            if self._file is not None and os.fstat(self._file).st_size < _SIZE:
                os.ftruncate(self._file, _SIZE)
            self._table = mmap.mmap(-1 if self._file is None else self._file, _SIZE)
            if not any(self._table[:_KEY_BYTES]):
                self._table[:_KEY_BYTES] = secrets.token_bytes(_KEY_BYTES)
            self._key = bytes(self._table[:_KEY_BYTES])

    def wait(self, address: str, take: float = 1.0) -> float:
        """Take from an address's bucket and return 0, or take nothing and return how long to wait [s]."""
        name = hashlib.blake2b(network_of(address).encode("utf-8", "replace"), digest_size=16, key=self._key).digest()
        with self._alone():
            now = self._clock()
            place, level = self._find(name, now)
            wanting = 1.0 - level
            _BUCKET.pack_into(self._table, place, name, level - take if wanting <= 0.0 else level, now)
        return max(0.0, wanting / self._rate) if wanting > 0.0 else 0.0

    def close(self) -> None:
        """Let go of the table."""
        self._table.close()
        if self._file is not None:
            os.close(self._file)

    def _find(self, name: bytes, now: float) -> tuple[int, float]:
        """Return the place of a bucket and its level now; one that is new takes the fullest one's place."""
        begin = _KEY_BYTES + int.from_bytes(name[:4], "little") % _SETS * _PLACES * _BUCKET.size
        fullest, found = begin, -1.0
        for place in range(begin, begin + _PLACES * _BUCKET.size, _BUCKET.size):
            known, level, then = _BUCKET.unpack_from(self._table, place)
            level = self._burst if known == _NOBODY else self._level(level, then, now)
            if known == name:
                return place, level
            if level > found:
                fullest, found = place, level
        return fullest, self._burst

    def _level(self, level: float, then: float, now: float) -> float:
        risen = level + (now - then) * self._rate
        return max(0.0, min(self._burst, risen)) if math.isfinite(risen) else self._burst

    @contextmanager
    def _alone(self) -> Iterator[None]:
        with self._lock:
            if self._file is not None:
                fcntl.flock(self._file, fcntl.LOCK_EX)
            try:
                yield
            finally:
                if self._file is not None:
                    fcntl.flock(self._file, fcntl.LOCK_UN)


def network_of(address: str) -> str:
    """Return what is counted as one: an IPv4 address, or the 64 bits of an IPv6 address that a customer is given."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return address
    if isinstance(parsed, ipaddress.IPv4Address):
        return address
    if parsed.ipv4_mapped is not None:
        return str(parsed.ipv4_mapped)
    return str(ipaddress.ip_network((int(parsed), _NETWORK_BITS), strict=False))
