"""Words and numbers in text: what the readers of text formats share."""

from __future__ import annotations

import warnings
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", np.float64, np.int64)


def parsed_numbers(text: bytes, dtype: type[Number]) -> NDArray[Number] | None:
    """Return the numbers that white space separates in ``text``, or ``None`` if something else stands among them."""
    if not text.strip():
        return np.zeros(0, dtype)
    with warnings.catch_warnings():
        # NumPy warns, and stops, at the first word that is no number; later versions raise
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, dtype, sep=" ")
        except (DeprecationWarning, ValueError):
            return None


def word_counts(text: NDArray[np.uint8], line_starts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how many words each line of ``text`` has; every line ends in white space."""
    is_space = text <= ord(" ")
    begins = ~is_space
    begins[1:] &= is_space[:-1]
    first_words = np.searchsorted(np.flatnonzero(begins), np.append(line_starts, len(text)))
    return np.diff(first_words)


def quoted(text: str, longest: int = 60) -> str:
    """Return a piece of a file for a message: one line, nothing that a terminal would obey, not too long."""
    shown = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    return f"'{shown[:longest]}...'" if len(shown) > longest else f"'{shown}'"
