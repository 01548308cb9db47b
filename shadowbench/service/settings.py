"""What an operator decides, in one frozen object that every worker process gets."""

from __future__ import annotations

import ipaddress
import json
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from shadowbench.errors import UsageError

ENVIRONMENT = "SHADOWBENCH_SERVICE_SETTINGS"
"""The variable through which worker processes get the settings."""

MEBIBYTE = 2**20

WRONG_TOKENS_A_SECOND = 1.0 / 6.0
"""How many wrong tokens an address may try, on average."""


class Settings(BaseModel):
    """How a service behaves. Sizes are in bytes, rates in requests a second."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    results: Path
    database: str | None = None
    title: str = "shadowbench results"
    open_reading: bool = True
    hosts: tuple[str, ...] = ("127.0.0.1", "localhost", "[::1]")
    """Names under which the service may be asked for; ``*`` for any. Others are refused (DNS rebinding)."""
    largest_body: int = Field(64 * MEBIBYTE, gt=0)
    largest_picture: int = Field(16 * MEBIBYTE, gt=0)
    most_pixels: int = Field(33_554_432, gt=0)
    requests_a_second: float = Field(50.0, ge=0.0)
    """Of one address, on average; 0 for no limit."""
    burst: int = Field(400, gt=0)
    wrong_tokens: int = Field(10, gt=0)
    """How many wrong tokens an address may try at once; then :data:`WRONG_TOKENS_A_SECOND`."""
    cached_answers: int = Field(256, ge=0)
    shared: Path | None = None
    """A folder for what the worker processes of one service share; ``None`` for a process by itself."""

    def as_text(self) -> str:
        """Return the settings for :data:`ENVIRONMENT`."""
        return json.dumps(self.model_dump(mode="json"))


def is_public(host: str) -> bool:
    """Return whether others than this machine could reach an address that is bound.

    Raises:
        UsageError: It is neither an address nor ``localhost``.
    """
    if host == "localhost":
        return False
    try:
        return not ipaddress.ip_address(host).is_loopback
    except ValueError:
        raise UsageError(f"--host {host!r:.80} is not an IP address: 127.0.0.1, 0.0.0.0, ::1 ...") from None
