"""Request bodies, read within limits: what is sent compressed may not become larger than what may be sent plainly."""

from __future__ import annotations

import zlib
from typing import Any

from fastapi import Request
from starlette.requests import ClientDisconnect

from shadowbench.service.problems import Problem

_PART = 2**20


async def read(request: Request, largest: int) -> bytes:
    """Return the body of a request, unpacked if it says that it is ``gzip``.

    Raises:
        Problem: It is larger than ``largest`` bytes (413), packed in another way (415) or damaged (400).
    """
    encoding = request.headers.get("content-encoding", "identity").lower()
    if encoding not in ("identity", "gzip"):
        raise Problem(415, "the body may be sent as it is or as gzip", headers={"Accept-Encoding": "gzip"})
    announced = request.headers.get("content-length", "0")
    if announced.isdigit() and int(announced) > largest:
        raise _too_large(largest)
    unpacking = zlib.decompressobj(wbits=31) if encoding == "gzip" else None
    parts: list[bytes] = []
    size = 0
    try:
        async for part in request.stream():
            for plain in _unpacked(unpacking, part, largest - size + 1):
                size += len(plain)
                if size > largest:
                    raise _too_large(largest)
                parts.append(plain)
    except zlib.error as error:
        raise Problem(400, f"the body is not undamaged gzip: {error}") from None
    except ClientDisconnect:
        raise Problem(400, "the body broke off") from None
    if unpacking is not None and (not unpacking.eof or unpacking.unused_data):
        raise Problem(400, "the body is not one whole gzip stream")
    return b"".join(parts)


def _unpacked(unpacking: Any, part: bytes, wanted: int) -> list[bytes]:
    """Return what a part unpacks to, at most a little more than ``wanted`` bytes of it."""
    if unpacking is None:
        return [part]
    found: list[bytes] = []
    while part and wanted > 0:
        plain = unpacking.decompress(part, min(wanted, _PART))
        part = unpacking.unconsumed_tail
        wanted -= len(plain)
        found.append(plain)
    return found


def _too_large(largest: int) -> Problem:
    return Problem(413, f"the body has more than {largest} bytes, which is what this service takes")
