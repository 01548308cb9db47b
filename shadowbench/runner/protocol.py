"""What the runner and its workers say to each other: one JSON value a line, over two pipes.

The runner asks ``{"call": name, "arguments": {...}}``; the worker answers ``{"result": value}`` or
``{"failure": {...}}``, and before that may say ``{"phase": text}`` any number of times. The worker's standard output
and error are a third pipe, which belongs to whatever the plugin prints.
"""

from __future__ import annotations

import json
import os
from typing import Any

import shadowbench.errors
from shadowbench.errors import PluginError, ShadowbenchError
from shadowbench.rows import Outcome


class CaseFailure(Exception):  # noqa: N818 - an outcome, not a mistake of the program
    """A worker could not do what it was asked.

    Attributes:
        outcome: How that counts.
        reason: One line.
        error_class: Name of the exception, if there was one.
        stderr_tail: The end of what the worker wrote.
        is_from_outside: The worker was killed, and not by the runner: what it did is not to blame.
    """

    def __init__(
        self,
        outcome: Outcome,
        reason: str,
        *,
        error_class: str = "",
        stderr_tail: str = "",
        is_from_outside: bool = False,
    ) -> None:
        super().__init__(reason)
        self.outcome = outcome
        self.reason = reason
        self.error_class = error_class
        self.stderr_tail = stderr_tail
        self.is_from_outside = is_from_outside

    def as_user_error(self) -> ShadowbenchError | None:
        """Return the error to show the user if it was one of :mod:`shadowbench.errors`, else ``None``."""
        kind = getattr(shadowbench.errors, self.error_class, None)
        if not (isinstance(kind, type) and issubclass(kind, ShadowbenchError)):
            return None
        return kind(self.reason) if kind.__init__ is ShadowbenchError.__init__ else PluginError(self.reason)


def outcome_of(error: BaseException) -> Outcome:
    """Return how an exception that a plugin raised counts."""
    if isinstance(error, shadowbench.errors.InvalidResultError):
        return Outcome.INVALID
    # Warp reports a failed allocation as a RuntimeError
    if isinstance(error, MemoryError) or "failed to allocate" in str(error).lower():
        return Outcome.OUT_OF_MEMORY
    return Outcome.ERROR


def reason_of(error: BaseException) -> str:
    """Return an exception as one line; one of shadowbench's own says enough without its class."""
    lines = str(error).strip().splitlines()
    first = lines[0] if lines else ""
    if isinstance(error, ShadowbenchError):
        return first
    return f"{type(error).__name__}: {first}" if first else type(error).__name__


def encode(message: dict[str, Any]) -> bytes:
    """Return a message as one line."""
    return json.dumps(message, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def decode(line: bytes) -> dict[str, Any]:
    """Return the message of one line."""
    message: dict[str, Any] = json.loads(line)
    return message


def write_all(descriptor: int, content: bytes) -> None:
    """Write to a pipe until all is written.

    Raises:
        BrokenPipeError: Nobody reads it any more.
    """
    view = memoryview(content)
    while view:
        view = view[os.write(descriptor, view) :]
