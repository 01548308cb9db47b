"""Tables for a terminal: fitted to its width, numbers to the right, colour for failures only.

With room for them times have their intervals; a table that is too wide even without goes on below, its index columns
repeated. Names fold within their column and stand only where they change; a number is never cut, nor broken over two
lines.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from rich import box
from rich.cells import cell_len, chop_cells
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table as Grid
from rich.text import Text

from shadowbench.tables.table import Table

_GAP = 2  # columns are this far apart
_NARROWEST_NAME = 6
_WIDEST_HEADING = 16
_JOINTS = re.compile(r"[^\s(,]*[(,]*\s*|.")


@dataclass(frozen=True)
class Tables:
    """Tables that ``rich`` can print."""

    tables: tuple[Table, ...]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield each table's title, its blocks of columns and its notes."""
        for position, table in enumerate(self.tables):
            if position > 0:
                yield Text()
            yield Text(table.title, style="bold")
            yield from _blocks(table, options.max_width)
            for note in table.notes:
                yield Text(note, style="dim")


def as_renderable(tables: Sequence[Table]) -> Tables:
    """Return something for ``Console.print``."""
    return Tables(tuple(tables))


@dataclass(frozen=True)
class _Column:
    """A column's texts and the width it gets."""

    heading: tuple[str, ...]
    cells: tuple[Text, ...]
    is_name: bool
    to_the_right: bool
    width: int


def _blocks(table: Table, room: int) -> Iterator[Grid | Text]:
    names = [_column(table, c, interval=False) for c in range(len(table.index))]
    values = [_column(table, c, interval=True) for c in range(len(table.index), len(table.headers))]
    if _width(names) + _width(values) > room:
        values = [_column(table, c, interval=False) for c in range(len(table.index), len(table.headers))]
    widest_value = max((column.width for column in values), default=0) + _GAP
    names = _narrowed(names, max(room - _width(values), min(room * 3 // 5, room - widest_value)))
    block: list[_Column] = []
    for column in values:
        if block and _width(names) + _width(block) + column.width > room:
            yield _grid(names + block)
            yield Text()
            block = []
        block.append(column)
    yield _grid(names + block)


def _column(table: Table, position: int, *, interval: bool) -> _Column:
    header = table.headers[position]
    cells = [
        Text(line[position].text(thousands=True, interval=interval), style="red" if line[position].is_failure else "")
        for line in table.body
    ]
    needed = max((cell.cell_len for cell in cells), default=0)
    longest_word = max((cell_len(word) for line in header.lines() for word in line.split()), default=1)
    width = max(needed, min(longest_word, _WIDEST_HEADING))
    is_name = position < len(table.index)
    return _Column(tuple(header.lines()), tuple(cells), is_name, table.is_numeric(position), width)


def _width(columns: Sequence[_Column]) -> int:
    return sum(column.width + _GAP for column in columns)


def _narrowed(columns: Sequence[_Column], room: int) -> list[_Column]:
    """Take width from the widest columns until all fit, but leave each enough to be read."""
    widths = [column.width for column in columns]
    while sum(widths) + _GAP * len(widths) > room and max(widths, default=0) > _NARROWEST_NAME:
        widths[widths.index(max(widths))] -= 1
    return [replace(column, width=width) for column, width in zip(columns, widths, strict=True)]


def _grid(columns: Sequence[_Column]) -> Grid:
    grid = Grid(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, _GAP - 1, 0, 0), header_style="")
    headings = [_folded(column.heading, column.width) for column in columns]
    tallest = max(map(len, headings))
    for column, heading in zip(columns, headings, strict=True):
        grid.add_column(
            Text("\n".join([""] * (tallest - len(heading)) + heading)),  # units in one line, at the bottom
            width=column.width,
            justify="right" if column.to_the_right else "left",
            overflow="fold",
        )
    above: tuple[str, ...] = ()
    for line in zip(*(column.cells for column in columns), strict=True):
        texts = tuple(cell.plain for cell in line)
        grid.add_row(
            *(
                Text() if column.is_name and texts[: position + 1] == above[: position + 1] else _fitted(cell, column)
                for position, (column, cell) in enumerate(zip(columns, line, strict=True))
            )
        )
        above = texts
    return grid


def _fitted(cell: Text, column: _Column) -> Text:
    return Text("\n".join(_folded([cell.plain], column.width)), style=cell.style) if column.is_name else cell


def _folded(lines: Sequence[str], width: int) -> list[str]:
    """Break lines where a label has its joints: after spaces, commas and opening brackets."""
    folded = []
    for line in lines:
        folded.append("")
        for part in (piece for joint in _JOINTS.findall(line) for piece in chop_cells(joint, width)):
            if folded[-1] and cell_len(folded[-1] + part.rstrip()) > width:
                folded.append("")
            folded[-1] += part
    return [line.rstrip() for line in folded]
