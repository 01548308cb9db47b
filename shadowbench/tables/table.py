"""What a table is before it has a format: headers, cells with their values, and notes."""

from __future__ import annotations

from dataclasses import dataclass, field

from shadowbench.rows import Outcome, ResultRow
from shadowbench.tables.columns import Scalar
from shadowbench.tables.numbers import number_text
from shadowbench.tables.plain_text import plain, shortened


@dataclass(frozen=True)
class Header:
    """A column's heading.

    Attributes:
        column: The column's name, ``build_ms``.
        name: The same for programs, unique in the table: ``build_ms`` or, pivoted, ``build_ms[resolution=512]``.
        text: For people, without unit: ``build``.
        unit: As shown: ``ms``, ``MiB``; empty for none.
        group: The pivot's name and value, ``resolution=512``; empty without a pivot.
    """

    column: str
    name: str
    text: str
    unit: str = ""
    group: str = ""

    def lines(self) -> list[str]:
        """Return group, text and unit as lines for a narrow column; names are safe to print."""
        unit = [f"[{self.unit}]"] if self.unit else []
        return [plain(shortened(line)) for line in (self.group, self.text) if line] + unit

    def line(self) -> str:
        """Return the same as one line."""
        lines = self.lines()
        return f"{lines[0]}: {' '.join(lines[1:])}" if self.group and len(lines) > 1 else " ".join(lines)


@dataclass(frozen=True)
class Cell:
    """A value, or how its case ended instead.

    Attributes:
        value: As the row holds it; ``None`` where a measure does not apply, and where the case is not ok.
        unit: Of ``value``.
        interval: 95 % interval of ``value``, where it has one.
        outcome: Set in the first value cell of a case that is not ok.
        reason: Why, in one line.
        shown: What tables for reading show instead of the value; the name of a measure, say.
        note: Number of the note that gives the reason; 0 for none.
        bounds: Between which the true value lies for all that is known, where it is no exact one: what orders it. A
            stage has bounds and no interval; they are without end where too few rounds were taken.
        case_key: Of the case whose value it is; empty in the columns that name a line.
    """

    value: Scalar = None
    unit: str = ""
    interval: tuple[float, float] | None = None
    outcome: Outcome | None = None
    reason: str = ""
    note: int = 0
    shown: str = ""
    bounds: tuple[float, float] | None = None
    case_key: str = field(default="", compare=False)

    @property
    def is_failure(self) -> bool:
        """Whether the case ended in a way that the exit status reports."""
        return self.outcome is not None and self.outcome.is_failure

    def text(self, *, thousands: bool = False, interval: bool = False) -> str:
        """Return the cell as tables for reading show it, safe to print; no format's markup is escaped."""
        if self.outcome is not None:
            return f"{self.outcome.value} [{self.note}]" if self.note else self.outcome.value
        if self.value is None:
            return ""
        if self.shown or isinstance(self.value, bool | str):
            return plain(shortened(self.shown or str(self.value)))
        if not self.unit:
            return f"{self.value:g}" if isinstance(self.value, float) else str(self.value)
        text = number_text(self.value, self.unit, thousands=thousands)
        if interval and self.interval is not None:
            low, high = (number_text(end, self.unit, thousands=thousands) for end in self.interval)
            return f"{text} [{low}, {high}]"
        return text


@dataclass(frozen=True)
class Table:
    """A table of one experiment.

    Attributes:
        title: Heading; says so if cases are missing.
        experiment, run_id: Where its rows come from.
        index: Headers of the columns that name a line.
        values: Headers of the columns that hold its numbers.
        body: Lines of ``len(index) + len(values)`` cells.
        notes: What holds for all cases, reasons of those that are not ok, warnings.
        rows: The rows it was made from.
    """

    title: str
    experiment: str
    run_id: str
    index: tuple[Header, ...]
    values: tuple[Header, ...]
    body: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...]
    rows: tuple[ResultRow, ...]

    @property
    def headers(self) -> tuple[Header, ...]:
        """All headers."""
        return self.index + self.values

    def is_numeric(self, column: int) -> bool:
        """Return whether a column holds numbers, and so is aligned to the right."""
        cells = [line[column] for line in self.body]
        found = [cell.value for cell in cells if cell.value is not None]
        if column >= len(self.index) and not found:
            return True
        return bool(found) and not any(isinstance(v, str | bool) for v in found)
