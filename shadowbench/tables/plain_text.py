"""Names and messages as text that is safe to print: no control characters, no endless lines.

Plugins, scenes, experiments and error messages come from anybody. Whatever is not printable (control characters,
terminal escapes, direction marks, line ends, lone surrogates) is shown as its escape, so that it stays visible and
does nothing. What a format itself takes for markup is escaped by that format's module.
"""

from __future__ import annotations

LONGEST_NAME = 80
"""Characters of a name or label that tables for reading show; CSV and JSON hold all of it."""

LONGEST_NOTE = 400
"""Characters of a note (a reason, a warning) that tables for reading show."""


def plain(text: str) -> str:
    r"""Return ``text`` with every character that is not printable as its escape.

    >>> print(plain("a\tb" + chr(27) + "[31m"))
    a\tb\x1b[31m
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def shortened(text: str, length: int = LONGEST_NAME) -> str:
    """Return ``text``, or its beginning and its end around an ellipsis if it has more than ``length`` characters.

    >>> shortened("abcdefghij", 6)
    'abc…ij'
    """
    if len(text) <= length:
        return text
    tail = (length - 1) // 2
    return f"{text[: length - 1 - tail]}…{text[len(text) - tail :]}"
