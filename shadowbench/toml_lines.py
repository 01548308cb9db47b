"""Where in a TOML text a value stands: what `tomllib` does not tell.

An experiment file that parses may still be wrong (an unknown key, an impossible size); the message then names the
line. :func:`line_numbers` walks a text that ``tomllib`` has already accepted, so it need not check anything.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

Path = tuple[str | int, ...]
"""Keys and list positions from the root to a value, e.g. ``("comparison", 0, "method", 2)``."""

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_SCALAR = re.compile(r"[^,\]}\n#]*")
_STRINGS = (
    re.compile(r'"""(?:\\.|[^\\])*?"{3,5}', re.DOTALL),
    re.compile(r"'''.*?'{3,5}", re.DOTALL),
    re.compile(r'"(?:\\.|[^"\\\n])*"'),
    re.compile(r"'[^'\n]*'"),
)


def line_numbers(text: str) -> dict[Path, int]:
    """Return the line, from 1, on which each key, table and list element of a valid TOML text begins."""
    return _Walk(text).document()


def line_of(lines: dict[Path, int], path: Sequence[str | int]) -> int | None:
    """Return the line of the innermost part of ``path`` that stands in the text."""
    for length in range(len(path), 0, -1):
        if tuple(path[:length]) in lines:
            return lines[tuple(path[:length])]
    return None


class _Walk:
    """A position in the text, and the lines found so far."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.lines: dict[Path, int] = {}
        self.table_counts: dict[Path, int] = {}

    def document(self) -> dict[Path, int]:
        table: Path = ()
        while self.skip_blank():
            if self.take("[["):
                table = self.table_path(self.keys())
                number = self.table_counts.get(table, 0)
                self.table_counts[table] = number + 1
                self.record(table)
                table = (*table, number)
                self.record(table)
                self.take("]]")
            elif self.take("["):
                table = self.table_path(self.keys())
                self.record(table)
                self.take("]")
            else:
                self.key_and_value(table)
        return self.lines

    def table_path(self, keys: list[str]) -> Path:
        """Return where ``[a.b]`` stands: in the last element of each list of tables on the way."""
        path: Path = ()
        for key in keys:
            if path in self.table_counts:
                path = (*path, self.table_counts[path] - 1)
            path = (*path, key)
        return path

    def key_and_value(self, table: Path) -> None:
        begin = self.at
        path = (*table, *self.keys())
        for length in range(len(table) + 1, len(path) + 1):
            self.record(path[:length], begin)
        self.take("=")
        self.value(path)

    def value(self, path: Path) -> None:
        self.skip_blank()
        if self.take("["):
            index = 0
            while self.skip_blank() and not self.take("]"):
                self.record((*path, index))
                self.value((*path, index))
                index += 1
                self.skip_blank()
                self.take(",")
        elif self.take("{"):
            while self.skip_blank() and not self.take("}"):
                self.key_and_value(path)
                self.skip_blank()
                self.take(",")
        elif self.string() is None:
            self.at = _match(_SCALAR, self.text, self.at)

    def keys(self) -> list[str]:
        """Read a dotted key."""
        found = []
        while True:
            self.skip_blank()
            quoted = self.string()
            if quoted is None:
                end = _match(_BARE_KEY, self.text, self.at)
                quoted, self.at = self.text[self.at : end], end
            found.append(quoted)
            self.skip_blank()
            if not self.take("."):
                return found

    def string(self) -> str | None:
        """Read a string, if one begins here."""
        for pattern in _STRINGS:
            found = pattern.match(self.text, self.at)
            if found:
                self.at = found.end()
                return found.group().strip("\"'")
        return None

    def skip_blank(self) -> bool:
        """Go to the next thing that is no blank and no comment; return whether there is one."""
        self.at = _match(_BLANK, self.text, self.at)
        return self.at < len(self.text)

    def take(self, what: str) -> bool:
        found = self.text.startswith(what, self.at)
        self.at += len(what) if found else 0
        return found

    def record(self, path: Path, at: int | None = None) -> None:
        self.lines.setdefault(path, self.text.count("\n", 0, self.at if at is None else at) + 1)


def _match(pattern: re.Pattern[str], text: str, at: int) -> int:
    found = pattern.match(text, at)
    return found.end() if found else at
