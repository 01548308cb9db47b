"""The other side: a run from this machine's store to a results service.

Pictures go first, only those that the service lacks, then the run in one request. Every request may be repeated without
harm, so one that fails on the way is, after a pause that doubles; and a push that was broken off goes on where it
stopped when it is typed again. Uses nothing but the standard library: pushing needs no extra.
"""

from __future__ import annotations

import email.utils
import gzip
import http.client
import json
import os
import random
import ssl
import stat
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import quote, urlsplit

from shadowbench.errors import ShadowbenchError, UsageError
from shadowbench.rows import RunRecord
from shadowbench.store import Store
from shadowbench.store.documents import artifact_names, row_document, run_document

TOKEN_VARIABLE = "SHADOWBENCH_TOKEN"  # noqa: S105 - the variable's name
ATTEMPTS = 6
TIMEOUT_S = 60.0

_FIRST_PAUSE_S = 0.5
_LONGEST_PAUSE_S = 30.0
_WORTH_ANOTHER_TRY = frozenset({408, 425, 429, 500, 502, 503, 504})
_AT_ONCE = 1000
_LARGEST_ANSWER = 64 * 2**20


class PushError(ShadowbenchError):
    """The service refuses, or cannot be reached."""


class Progress(Protocol):
    """Is told what happens."""

    def sending(self, done: int, total: int) -> None:
        """Pictures are being sent."""

    def waiting(self, seconds: float, reason: str) -> None:
        """A request failed and is repeated after a pause."""


@dataclass(frozen=True)
class Pushed:
    """What a push did, or with ``dry_run`` would do."""

    run_id: str
    row_count: int
    picture_count: int
    sent_pictures: int
    sent_bytes: int
    kept: str


def find_token(file: Path | None = None) -> str:
    """Return the token from the environment or from a file.

    Args:
        file: Instead of ``~/.config/shadowbench/token``, which need not be there.

    Raises:
        UsageError: There is none, or others may read the file.
    """
    if file is None and os.environ.get(TOKEN_VARIABLE):
        return os.environ[TOKEN_VARIABLE].strip()
    path = file or Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "shadowbench" / "token"
    try:
        mode = path.stat().st_mode
        text = path.read_text(encoding="utf-8").strip()
    except FileNotFoundError:
        raise UsageError(
            f"there is no token: set {TOKEN_VARIABLE}, or write it to {path} and type chmod 600 {path}"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: the token cannot be read: {error}") from None
    if stat.S_IMODE(mode) & 0o077:
        raise UsageError(f"{path}: others may read this token; type chmod 600 {path}")
    return text


class Client:
    """Requests to one service."""

    def __init__(
        self, address: str, token: str, progress: Progress | None = None, pause: Callable[[float], None] = time.sleep
    ) -> None:
        """Prepare to talk to the service at ``address``, e.g. ``https://results.example.org``.

        Raises:
            UsageError: The address is none, or would send the token in the clear to another machine.
        """
        parts = urlsplit(address)
        try:
            port = parts.port
        except ValueError:
            port = -1
        if parts.scheme not in ("http", "https") or not parts.hostname or port == -1 or parts.username:
            raise UsageError(f"{address!a:.100} is not an address like https://results.example.org")
        if parts.scheme == "http" and parts.hostname not in ("localhost", "127.0.0.1", "::1"):
            raise UsageError(f"{address!a:.100} is not encrypted, and the token would be sent in the clear; use https")
        if not token.isascii() or not token.isprintable() or not token:
            raise UsageError("the token has characters that no token has")
        self._parts, self._port, self._token = parts, port, token
        self._progress, self._pause = progress, pause
        self._connection: http.client.HTTPConnection | None = None

    def push(self, store: Store, run: RunRecord, *, dry_run: bool = False) -> Pushed:
        """Send a run, or find out what would be sent.

        Raises:
            PushError: The service refuses or cannot be reached.
            StoreError: A picture is missing or damaged here.
        """
        if run.finished_at is None:
            raise PushError(f"run '{run.run_id}' has not ended; push it when it has")
        rows = store.rows(run.run_id)
        names = artifact_names(rows)
        missing = self._missing(names)
        document = {"run": run_document(run), "rows": [row_document(row) for row in rows]}
        body = json.dumps(document, separators=(",", ":"), allow_nan=False).encode("ascii")
        packed = gzip.compress(body, 6, mtime=0)
        if dry_run:
            size = len(packed) + sum(store.artifacts.path(name).stat().st_size for name in missing)
            return Pushed(run.run_id, len(rows), len(names), len(missing), size, "would be sent")
        size = len(packed)
        for number, name in enumerate(missing):
            if self._progress is not None:
                self._progress.sending(number, len(missing))
            content = store.artifact(name)
            size += len(content)
            self._ask("PUT", f"/api/v1/artifacts/{quote(name)}", content, {"Content-Type": "image/png"})
        headers = {"Content-Type": "application/json", "Content-Encoding": "gzip"}
        kept = self._ask("PUT", f"/api/v1/runs/{quote(run.run_id, safe='')}", packed, headers)
        return Pushed(run.run_id, len(rows), len(names), len(missing), size, str(kept.get("kept", "")))

    def close(self) -> None:
        """Close the connection."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _missing(self, names: list[str]) -> list[str]:
        found: list[str] = []
        for start in range(0, len(names), _AT_ONCE):
            body = json.dumps({"names": names[start : start + _AT_ONCE]}).encode("ascii")
            answer = self._ask("POST", "/api/v1/artifacts/missing", body, {"Content-Type": "application/json"})
            found += [name for name in answer.get("missing", ()) if name in names]
        return found

    def _ask(self, method: str, path: str, body: bytes, headers: dict[str, str]) -> dict[str, Any]:
        """Send a request, again where that may help, and return the JSON object of the answer."""
        pause = _FIRST_PAUSE_S
        for attempt in range(1, ATTEMPTS + 1):
            try:
                status, answer_headers, content = self._send(method, path, body, headers)
            except (OSError, http.client.HTTPException) as error:
                self.close()
                reason, wished = f"{type(error).__name__}: {error}".rstrip(": "), None
            else:
                if status < 300:
                    return _object(content)
                reason = _reason(status, content)
                if status not in _WORTH_ANOTHER_TRY:
                    raise PushError(f"{self._place}: {reason}")
                wished = _seconds(answer_headers.get("retry-after"))
            if attempt < ATTEMPTS:
                seconds = min(_LONGEST_PAUSE_S, max(wished or 0.0, pause * random.uniform(0.75, 1.25)))  # noqa: S311
                if self._progress is not None:
                    self._progress.waiting(seconds, reason)
                self._pause(seconds)
                pause *= 2.0
        raise PushError(f"{self._place}: gave up after {ATTEMPTS} attempts: {reason}; type the same command to go on")

    @property
    def _place(self) -> str:
        return f"{self._parts.scheme}://{self._parts.hostname}" + (f":{self._port}" if self._port else "")

    def _send(
        self, method: str, path: str, body: bytes, headers: dict[str, str]
    ) -> tuple[int, http.client.HTTPMessage, bytes]:
        if self._connection is None:
            assert self._parts.hostname is not None
            if self._parts.scheme == "https":
                context = ssl.create_default_context()
                self._connection = http.client.HTTPSConnection(
                    self._parts.hostname, self._port, timeout=TIMEOUT_S, context=context
                )
            else:
                self._connection = http.client.HTTPConnection(self._parts.hostname, self._port, timeout=TIMEOUT_S)
        sent = {"Authorization": f"Bearer {self._token}", "Accept": "application/json", **headers}
        self._connection.request(method, self._parts.path.rstrip("/") + path, body, sent)
        with self._connection.getresponse() as answer:
            content = answer.read(_LARGEST_ANSWER)
        if answer.will_close:
            self.close()
        return answer.status, answer.headers, content


def _object(content: bytes) -> dict[str, Any]:
    try:
        found = json.loads(content)
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise PushError("the answer is not that of a results service; is the address right?")
    return found


def _reason(status: int, content: bytes) -> str:
    try:
        problem = json.loads(content)
        return f"{problem['detail']} ({status})"
    except (ValueError, KeyError, TypeError):
        return f"answered {status}"


def _seconds(retry_after: str | None) -> float | None:
    if retry_after is None:
        return None
    if retry_after.isdigit():
        return float(retry_after)
    moment = email.utils.parsedate_to_datetime(retry_after) if retry_after[:1].isalpha() else None
    return None if moment is None else max(0.0, moment.timestamp() - time.time())
