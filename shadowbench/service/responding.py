"""An answer as a page, as JSON or as CSV, and kept until the store changes.

Every answer has an ETag: who asks again for what he has gets 304. What an answer was made from is known by the store's
:meth:`~shadowbench.store.catalogue.Catalogue.version`; while it stays, the answer stays. What is made of one run alone
outlives changes elsewhere. One thread makes an answer, others that want the same one wait for it.
"""

from __future__ import annotations

import hashlib
import json
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from fastapi import Request, Response

from shadowbench.service import rendering
from shadowbench.tables.columns import finite
from shadowbench.tables.csv_text import lines_of

MEDIA_TYPES = {"html": "text/html; charset=utf-8", "json": "application/json", "csv": "text/csv; charset=utf-8"}


@dataclass(frozen=True)
class Answer:
    """What there is to say.

    Attributes:
        template: How a page says it.
        document: All of it, as JSON values.
        header, lines: What of it is a table.
        content: What the page needs beside the document.
    """

    template: str
    document: Any
    header: Sequence[str] = ()
    lines: Sequence[Sequence[Any]] = ()
    content: dict[str, Any] = field(default_factory=dict)

    def text(self, form: str, **content: Any) -> str:
        """Return it in one of the forms ``html``, ``json`` and ``csv``."""
        if form == "json":
            return json.dumps(finite(self.document), allow_nan=False, separators=(",", ":")) + "\n"
        if form == "csv":
            return lines_of([self.header, *self.lines])
        return rendering.render(self.template, document=self.document, **(self.content | content))


@dataclass(frozen=True)
class _Kept:
    version: str
    state: str
    body: bytes
    etag: str


class Answers:
    """Answers in their forms, the most recently asked for kept."""

    def __init__(self, version: Callable[[], str], most: int) -> None:
        self._version, self._most = version, most
        self._kept: OrderedDict[str, _Kept] = OrderedDict()
        self._locks: dict[str, threading.Lock] = {}
        self._lock = threading.Lock()

    def respond(
        self, request: Request, form: str, make: Callable[[], Answer], state: Callable[[], str] | None = None
    ) -> Response:
        """Answer a request for a page or what is on it.

        Args:
            request: Its path and query name the answer.
            form: ``html``, ``json`` or ``csv``.
            make: Makes the answer; what it raises is raised.
            state: Returns what of the store the answer is made from; all of it by default.
        """
        name = f"{form} {request.url.path}?{request.url.query}"
        kept = self._find(name, lambda: make().text(form, request=request).encode("utf-8"), state)
        headers = {"ETag": kept.etag, "Cache-Control": "no-cache", "Vary": "Accept-Encoding, Authorization"}
        if form == "html":
            headers |= rendering.HEADERS
        if kept.etag in [tag.strip() for tag in request.headers.get("if-none-match", "").split(",")]:
            return Response(status_code=304, headers=headers)
        return Response(kept.body, headers=headers, media_type=MEDIA_TYPES[form])

    def _find(self, name: str, make: Callable[[], bytes], state: Callable[[], str] | None) -> _Kept:
        found = self._held(name, self._version(), state)
        if found is not None:
            return found
        with self._lock:
            lock = self._locks.setdefault(name, threading.Lock())
        try:
            with lock:
                version = self._version()  # before reading: what is read is this state or a later one
                found = self._held(name, version, state)
                if found is None:
                    seen = state() if state is not None else ""
                    body = make()
                    found = _Kept(version, seen, body, f'W/"{hashlib.sha256(body).hexdigest()[:24]}"')
                    self._keep(name, found)
                return found
        finally:
            with self._lock:
                self._locks.pop(name, None)

    def _held(self, name: str, version: str, state: Callable[[], str] | None) -> _Kept | None:
        with self._lock:
            found = self._kept.get(name)
            if found is not None and found.version == version:
                self._kept.move_to_end(name)
                return found
        if found is None or state is None or found.state != state():
            return None
        found = replace(found, version=version)
        self._keep(name, found)
        return found

    def _keep(self, name: str, kept: _Kept) -> None:
        with self._lock:
            self._kept[name] = kept
            self._kept.move_to_end(name)
            while len(self._kept) > self._most:
                self._kept.popitem(last=False)
