"""Wavefront OBJ: vertices and faces; materials, texture coordinates and normals play no part here."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import SceneError

from .polygons import Polygons
from .words import Number, parsed_numbers, quoted, word_counts

_REMEDY = "repair the line or export the mesh again"
_SPACE, _NEWLINE, _BACKSLASH = b" \n\\"


@dataclass(frozen=True)
class _Lines:
    """All lines of one kind, without their first word.

    Attributes:
        numbers: Where each stands in the file, counted from 1, shape [line_count].
        word_counts: int64, shape [line_count].
        text: The lines one after the other, each ending in a newline.
    """

    numbers: NDArray[np.int64]
    word_counts: NDArray[np.int64]
    text: bytes

    def quoted(self, line: int) -> str:
        return quoted(self.text.split(b"\n")[line].decode("latin-1"))


def read(path: Path) -> Polygons:
    """Read an OBJ file; relative (negative) indices and continued lines are understood.

    Raises:
        SceneError: Names file and line.
    """
    text, starts, numbers = _logical_lines(path.read_bytes())
    vertex_lines, face_lines = (_lines_of(kind, text, starts, numbers) for kind in (b"v", b"f"))
    if len(vertex_lines.numbers) + len(face_lines.numbers) == 0:
        raise SceneError(f"{path}: has neither vertices nor faces; is it a Wavefront OBJ file?")
    vertices = _vertices(vertex_lines, path)
    # vertices that came before each face: relative indices count back from there
    before = np.searchsorted(vertex_lines.numbers, face_lines.numbers)
    return Polygons(vertices, face_lines.word_counts, _corners(face_lines, before, len(vertices), path))


def _logical_lines(data: bytes) -> tuple[NDArray[np.uint8], NDArray[np.int64], NDArray[np.int64]]:
    """Return the text, where its lines start, and their numbers; lines ending in a backslash go on in the next."""
    text = np.frombuffer(bytearray(data.replace(b"\r", b" ") + b"\n"), np.uint8)
    newlines = np.flatnonzero(text == _NEWLINE)
    continued = np.zeros(len(newlines), dtype=bool)
    if b"\\" in data:
        for k, end in enumerate(newlines[:-1].tolist()):
            last = end - 1
            while last >= 0 and text[last] == _SPACE:
                last -= 1
            if last >= 0 and text[last] == _BACKSLASH:
                text[last], text[end], continued[k] = _SPACE, _SPACE, True
    is_start = np.concatenate([[True], ~continued[:-1]])
    starts = np.concatenate([[0], newlines[:-1] + 1])
    return text, starts[is_start], np.flatnonzero(is_start) + 1


def _lines_of(kind: bytes, text: NDArray[np.uint8], starts: NDArray[np.int64], numbers: NDArray[np.int64]) -> _Lines:
    """Return the lines whose first word is the letter ``kind``."""
    first = starts.copy()
    while (indented := (text[first] == _SPACE) | (text[first] == ord("\t"))).any():
        first[indented] += 1
    is_kind = text[first] == kind[0]
    is_kind[is_kind] = text[first[is_kind] + 1] <= _SPACE
    begins, ends = first[is_kind] + 1, np.append(starts[1:], len(text))[is_kind]
    if len(begins) == 0:
        return _Lines(begins, begins, b"")
    change = np.zeros(len(text) + 1, np.int8)
    change[begins] += 1
    change[ends] -= 1
    kept = text[np.cumsum(change[:-1], dtype=np.int8).astype(bool)]
    lengths = ends - begins
    return _Lines(numbers[is_kind], word_counts(kept, np.cumsum(lengths) - lengths), kept.tobytes())


def _vertices(lines: _Lines, path: Path) -> NDArray[np.float64]:
    short = lines.word_counts < 3
    values = None if short.any() else parsed_numbers(lines.text, np.float64)
    if values is None:
        line = int(np.argmax(short)) if short.any() else _first_bad_line(lines, np.float64)
        _fail(path, lines, line, "a vertex needs three numbers")
    first = np.cumsum(lines.word_counts) - lines.word_counts
    vertices: NDArray[np.float64] = values[first[:, None] + np.arange(3)]
    finite = np.isfinite(vertices).all(axis=1)
    if not finite.all():
        _fail(path, lines, int(np.argmin(finite)), "a vertex is not finite")
    return vertices


def _corners(lines: _Lines, before: NDArray[np.int64], vertex_count: int, path: Path) -> NDArray[np.int64]:
    """Return vertex indices from 0."""
    text = _vertex_words(lines.text)
    indices = parsed_numbers(text, np.int64)
    if indices is None or len(indices) != lines.word_counts.sum():
        line = _first_bad_line(_Lines(lines.numbers, lines.word_counts, text), np.int64)
        _fail(path, lines, line, "a face's corners must be whole numbers")
    line_of = np.repeat(np.arange(len(lines.numbers)), lines.word_counts)
    # OBJ counts from 1; -1 is the latest vertex
    corners = np.where(indices > 0, indices - 1, before[line_of] + indices)
    wrong = (corners < 0) | (corners >= vertex_count) | (indices == 0)
    if wrong.any():
        worst = int(np.argmax(wrong))
        index, line = int(indices[worst]), int(line_of[worst])
        why = "OBJ counts from 1" if index == 0 else f"the file has {vertex_count}"
        if index < 0:
            why = f"only {int(before[line])} come before it"
        _fail(path, lines, line, f"a face names vertex {index}, but {why}")
    return corners


def _vertex_words(text: bytes) -> bytes:
    """Cut every word at its first slash: 7/1/3 is vertex 7. In blocks, since a substitution's pieces take space."""
    size = 1 << 22
    cuts = [0, *(text.find(b"\n", at) + 1 for at in range(size, len(text), size)), len(text)]
    return b"".join(re.sub(rb"/\S*", b"", text[begin:end]) for begin, end in pairwise(cuts))


def _first_bad_line(lines: _Lines, dtype: type[Number]) -> int:
    """Return the first line in which something is not a number."""
    for k, (text, count) in enumerate(zip(lines.text.split(b"\n"), lines.word_counts.tolist(), strict=False)):
        values = parsed_numbers(text, dtype)
        if values is None or len(values) != count:
            return k
    return 0


def _fail(path: Path, lines: _Lines, line: int, what: str) -> NoReturn:
    raise SceneError(f"{path}:{int(lines.numbers[line])}: {what}: {lines.quoted(line)}; {_REMEDY}")
