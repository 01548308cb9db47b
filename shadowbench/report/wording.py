"""How the report writes values of a row: as the tables do, with the unit behind; a dash where a measure does not apply.

Everything here turns a value into text; escaping for HTML is the templates'.
"""

from __future__ import annotations

import datetime as dt
import math

from shadowbench.tables.numbers import MEBIBYTE, number_text
from shadowbench.tables.plain_text import plain, shortened

ABSENT = "\u2014"
"""Stands where a measure does not apply; never 0."""

_LONGEST_TEXT = 4000
"""Characters of a text of several lines, such as the end of what a worker wrote."""


def count(value: int | None) -> str:
    """Return a whole number."""
    return ABSENT if value is None else number_text(value, "", thousands=True)


def number(value: float | None) -> str:
    """Return a measure without a unit."""
    return ABSENT if value is None else number_text(value, "")


def percent(value: float | None) -> str:
    """Return a percentage; what is not 0 never reads as 0."""
    return ABSENT if value is None else f"{number_text(value, '%')} %"


def milliseconds(value: float | None) -> str:
    """Return a duration given in milliseconds."""
    return ABSENT if value is None or math.isnan(value) else f"{number_text(value, 'ms', thousands=True)} ms"


def interval(low: float | None, high: float | None) -> str:
    """Return the 95 % interval of a median, or an empty string."""
    return "" if low is None or high is None else f"[{number_text(low, 'ms')}, {number_text(high, 'ms')}]"


def byte_size(value: int | None) -> str:
    """Return a number of bytes, in MiB from a tenth of one on."""
    if value is None:
        return ABSENT
    if value < MEBIBYTE // 10:
        return f"{count(value)} bytes"
    return f"{number_text(value, 'bytes', thousands=True)} MiB"


def moment(iso: str) -> str:
    """Return an ISO 8601 time as ``2026-01-31 12:00 UTC``; other text unchanged."""
    try:
        when = dt.datetime.fromisoformat(iso)
    except ValueError:
        return iso
    if when.tzinfo is None:
        return when.strftime("%Y-%m-%d %H:%M")
    return when.astimezone(dt.UTC).strftime("%Y-%m-%d %H:%M UTC")


def shown(value: object) -> str:
    """Return any text with control characters as visible escapes, line ends kept, and very long ones cut."""
    return shortened("\n".join(plain(line) for line in str(value).split("\n")), _LONGEST_TEXT)
