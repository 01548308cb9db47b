"""A source's printed numbers beside ours: which case they belong to, and how the columns for them are headed.

A column of values gets two more where any of its cases has a printed number: that number, and the ratio of ours to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Literal

from shadowbench.experiment import TableLayout
from shadowbench.rows import ResultRow
from shadowbench.tables.columns import Scalar, unit_of, value_of
from shadowbench.tables.table import Cell, Header

Kind = Literal["measured", "printed", "ratio"]

KINDS: tuple[Kind, ...] = ("measured", "printed", "ratio")
"""The columns of one value, from left to right."""


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


def header_of(kind: Kind, measured: Header) -> Header:
    """Return the heading of a column beside that of the measured values."""
    if kind == "measured":
        return measured
    beside = replace(measured, name=f"{measured.name} ({kind})", text=f"{measured.text} {kind}".lstrip())
    # a ratio has no unit of its own, whatever the column's is
    return beside if kind == "printed" else replace(beside, column="", unit="")
