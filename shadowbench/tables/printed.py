"""A source's printed numbers beside ours: which case they belong to, and how the columns for them are headed.

A column of values gets two more where any of its cases has a printed number: that number, and the ratio of ours to it.
A fourth marks what stands out of the source's order: of the cells of a value along a line, or down a column, the fewest
(as far as leaving out the worst one first finds them) without which ours and theirs go the same way. Times whose 95 %
intervals overlap, or of which too few rounds were taken, are in no order of ours, nor are equal numbers in theirs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal

from shadowbench.experiment import TableLayout
from shadowbench.rows import ResultRow
from shadowbench.tables.columns import Scalar, unit_of, value_of
from shadowbench.tables.table import Cell, Header

Kind = Literal["measured", "printed", "ratio", "order"]

KINDS: tuple[Kind, ...] = ("measured", "printed", "ratio", "order")
"""The columns of one value, from left to right."""

DIFFERS = Cell("differs", shown="\u2260")
"""In the column ``order``: out of the source's order."""


def matches(row: ResultRow, where: Mapping[str, Scalar]) -> bool:
    """Return whether a case has all of these values. ``method`` and ``scene`` are bare names, without parameters."""
    return all(value_of(row, name) == wanted for name, wanted in where.items())


def printed_cells(layout: TableLayout, row: ResultRow, name: str, measured: Cell) -> Iterator[tuple[Kind, Cell]]:
    """Yield the cells beside a measured one: none where nothing is printed, no ratio where nothing was measured."""
    found = (each.values[name] for each in layout.printed if name in each.values and matches(row, each.where))
    printed = next(found, None)
    if printed is None:
        return
    # a whole number as the source has it: 458000, not 4.58e5 nor 458000.0
    yield "printed", Cell(int(printed) if printed.is_integer() else printed, unit_of(name))
    if isinstance(measured.value, int | float) and printed != 0.0:
        yield "ratio", Cell(measured.value / printed, "1")


def header_of(kind: Kind, measured: Header, *, is_only_value: bool = False) -> Header:
    """Return the heading of a column beside that of the measured values.

    Args:
        kind: Which of the columns.
        measured: The heading of the measured values.
        is_only_value: Whether each of the table's groups of columns has this value only, which need not be said again.
    """
    if kind == "measured":
        return measured
    text = kind if measured.group and is_only_value else f"{measured.text} {kind}".lstrip()
    beside = replace(measured, name=f"{measured.name} ({kind})", text=text)
    # a ratio and a mark have no unit of their own, whatever the column's is
    return beside if kind == "printed" else replace(beside, column="", unit="")


def out_of_order(cells: Sequence[tuple[Cell, Cell]]) -> list[int]:
    """Return which cells of a line or column to leave out for ours and theirs to be in one order.

    Args:
        cells: Measured and printed, for every place of the line or column.
    """
    against = {
        (i, j)
        for i, (ours, theirs) in enumerate(cells)
        for j, (our_other, their_other) in enumerate(cells)
        if i != j and _is_below(theirs, their_other) and _is_below(our_other, ours)
    }
    found: list[int] = []
    while against:
        counts = Counter(place for pair in against for place in pair)
        worst = min(counts, key=lambda place: (-counts[place], place))
        found.append(worst)
        against = {pair for pair in against if worst not in pair}
    return sorted(found)


def _is_below(cell: Cell, other: Cell) -> bool:
    """Return whether one number is smaller than another for certain."""
    if not isinstance(cell.value, int | float) or not isinstance(other.value, int | float):
        return False
    high = cell.value if cell.bounds is None else cell.bounds[1]
    low = other.value if other.bounds is None else other.bounds[0]
    return cell.value < other.value and high < low
