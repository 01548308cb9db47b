"""Rows and a layout -> a table: one place for every case, whatever its outcome, and nothing that no row holds."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from shadowbench.choices import EVERYTHING
from shadowbench.errors import UsageError, did_you_mean
from shadowbench.experiment import TableLayout
from shadowbench.rows import RATIOS, VERDICTS, Outcome, ResultRow, RunRecord, RunStatus, own_libraries
from shadowbench.tables.columns import (
    MEASURE,
    Scalar,
    header_text,
    header_unit,
    interval_of,
    is_known,
    parameter_names,
    scalar,
    unit_of,
    value_of,
)
from shadowbench.tables.labels import Labels
from shadowbench.tables.layout import (
    SETTING,
    Layouts,
    check_layout,
    completed_index,
    default_layout,
    layouts_of,
)
from shadowbench.tables.plain_text import LONGEST_NOTE, plain, shortened
from shadowbench.tables.printed import DIFFERS, KINDS, Kind, header_of, matches, out_of_order, printed_cells
from shadowbench.tables.quantities import quantity_of
from shadowbench.tables.table import Cell, Header, Table
from shadowbench.tables.verdicts import BASELINE, Verdicts, ratio_text

_ORDINARY = {"pixel_samples": 1, "layers": 1, "moving": EVERYTHING}
"""Settings of a picture that go without saying."""

_MOST_WARNINGS = 10

Place = tuple[Scalar, ...]
"""What names a line."""

Slot = tuple[Scalar, str, Kind]
"""What names a column of values: the pivot's value, the column, and which of the four beside each other."""

_UNFINISHED = {
    RunStatus.RUNNING: "the run has not ended",
    RunStatus.INTERRUPTED: "the run was interrupted",
    RunStatus.FAILED: "the run broke off",
}


def make_tables(
    rows: Sequence[ResultRow],
    layouts: Layouts | None = None,
    run: RunRecord | None = None,
    experiment: str | None = None,
) -> list[Table]:
    """Lay out tables; see :func:`shadowbench.tables.make`."""
    if layouts is None:
        layouts = layouts_of(run) if run is not None else {}
    names = list(dict.fromkeys([*(run.experiments if run is not None else ()), *(row.experiment for row in rows)]))
    if experiment is not None:
        if experiment not in names:
            raise UsageError(
                f"the run has no experiment '{experiment}'; {did_you_mean(experiment, names, noun='experiment')}"
            )
        names = [experiment]
    tables: list[Table] = []
    for name in names:
        own = [row for row in rows if row.experiment == name]
        title, case_count = _asked_for(name, run)
        own_layouts = layouts.get(name) or [default_layout(own, title)]
        missing = None if case_count is None or len(own) >= case_count else f"partial: {len(own)} of {case_count} cases"
        tables += [_Making(own, layout, name, run, missing).table() for layout in own_layouts]
    return tables


def _asked_for(experiment: str, run: RunRecord | None) -> tuple[str, int | None]:
    """Return an experiment's title and its number of planned cases, as far as the run knows them."""
    if run is None:
        return experiment, None
    found = next((d for d in run.definitions if d.get("name") == experiment), {})
    count = found.get("case_count", run.case_count if run.experiments == [experiment] else None)
    return str(found.get("title") or experiment), count


class _Making:
    """The making of one table."""

    def __init__(
        self,
        rows: Sequence[ResultRow],
        layout: TableLayout,
        experiment: str,
        run: RunRecord | None,
        missing: str | None,
    ) -> None:
        check_layout(layout)
        known = rows
        self.rows = rows = [row for row in rows if matches(row, layout.where)]
        self.layout, self.experiment, self.run, self.missing = layout, experiment, run, missing
        columns = (*layout.index, *([layout.columns] if layout.columns else []))
        defaults = run.method_defaults if run is not None else {}
        self.labels = {
            "method": Labels("method", rows, with_columns=columns, defaults=defaults),
            "scene": Labels("scene", rows, with_columns=columns),
        }
        self.index = completed_index(layout, rows, self.named)
        self.verdicts = Verdicts(rows, known, layout.values)
        self.reasons: dict[tuple[Outcome, str], int] = {}
        self.has_printed = self.has_marks = False

    def named(self, row: ResultRow, column: str) -> Scalar:
        """Return a row's value in an index or pivot column."""
        return self.labels[column].of(row) if column in self.labels else value_of(row, column)

    def table(self) -> Table:
        """Put each case's values at their places."""
        lines: dict[Place, dict[Slot, Cell]] = {}
        for row in self.rows:
            pivot = self.pivot(row)
            for name in self.layout.values:
                place = tuple(name if c == MEASURE else self.named(row, c) for c in self.index)
                cells = lines.setdefault(place, {})
                cell = replace(self.cell(row, name), case_key=row.case_key)
                cells[pivot, self.slot(name), "measured"] = cell
                for kind, beside in printed_cells(self.layout, row, name, cell):
                    cells[pivot, self.slot(name), kind] = beside
        self.mark_order(lines)
        held = {slot for cells in lines.values() for slot in cells}
        every = itertools.product(self.pivots(), dict.fromkeys(map(self.slot, self.layout.values)), KINDS)
        slots = [slot for slot in every if slot[2] == "measured" or slot in held]
        self.has_printed = any(kind == "printed" for _, _, kind in slots)
        body = tuple(
            (
                *(_index_cell(part, column) for part, column in zip(place, self.index, strict=True)),
                *(cells.get(slot, Cell()) for slot in slots),
            )
            for place, cells in lines.items()
        )
        return Table(
            title=self.title(),
            experiment=self.experiment,
            run_id=self.run.run_id if self.run is not None else next((row.run_id for row in self.rows), ""),
            index=tuple(Header(name, name, header_text(name), header_unit(name)) for name in self.index),
            values=tuple(
                header_of(kind, self.header(pivot, name), is_only_value=len(self.layout.values) == 1)
                for pivot, name, kind in slots
            ),
            body=body,
            notes=tuple(plain(shortened(note, LONGEST_NOTE)) for note in self.notes()),
            rows=tuple(self.rows),
        )

    def mark_order(self, lines: dict[Place, dict[Slot, Cell]]) -> None:
        """Mark the cells that stand out of the source's order, along lines and down columns of one value."""
        groups: dict[tuple[str, Any], list[tuple[Place, Scalar, str]]] = {}
        for place, cells in lines.items():
            for pivot, slot, kind in cells:
                if kind == "printed":
                    groups.setdefault(("along", (place, slot)), []).append((place, pivot, slot))
                    # where each line is a value of its own, a column compares nothing
                    if MEASURE not in self.index:
                        groups.setdefault(("down", (pivot, slot)), []).append((place, pivot, slot))
        for members in groups.values():
            pairs = [(lines[at][p, s, "measured"], lines[at][p, s, "printed"]) for at, p, s in members]
            for at, pivot, slot in (members[number] for number in out_of_order(pairs)):
                lines[at][pivot, slot, "order"] = DIFFERS
                self.has_marks = True

    def slot(self, name: str) -> str:
        """Return the column that a value stands in: its own, or the one for all where each has a line."""
        return "" if MEASURE in self.index else name

    def pivot(self, row: ResultRow) -> Scalar:
        """Return the row's value in the layout's pivot column."""
        return None if self.layout.columns is None else self.named(row, self.layout.columns)

    def pivots(self) -> list[Scalar]:
        """Return the values that become columns: numbers by size, others as they appear."""
        found = list(dict.fromkeys(self.pivot(row) for row in self.rows)) or [None]
        numbers = [value for value in found if isinstance(value, int | float)]
        return [*sorted(numbers)] if len(numbers) == len(found) else found

    def header(self, pivot: Scalar, name: str) -> Header:
        """Return the heading of a value's column."""
        against = self.against() if name in RATIOS or name in VERDICTS else ""
        if self.layout.columns is None:
            return Header(name, name or "value", header_text(name) or "value", header_unit(name), against)
        shown = "none" if pivot is None else f"{pivot:g}" if isinstance(pivot, float) else str(pivot)
        group = f"{header_text(self.layout.columns)}={shown}"
        full = f"{name}[{self.layout.columns}={shown}]" if name else f"{self.layout.columns}={shown}"
        return Header(name, full, " ".join(filter(None, (header_text(name), against))), header_unit(name), group)

    def against(self) -> str:
        """Return what the cases are compared with, as ``vs ray-traced``."""
        places = {id(row) for row in self.rows}
        firsts = {self.named(row, "method") if id(row) in places else row.method for row in self.verdicts.firsts()}
        return f"vs {firsts.pop()}" if len(firsts) == 1 else "vs first case"

    def cell(self, row: ResultRow, name: str) -> Cell:
        """Return a value, or for a case that is not ok its outcome in the place of its first value."""
        if row.outcome is Outcome.OK and (name in RATIOS or name in VERDICTS):
            return self.verdict_cell(row, name)
        if row.outcome is Outcome.OK:
            found = quantity_of(row, name)
            bounds = None if found is None or found.is_exact else (found.low, found.high)
            return Cell(scalar(value_of(row, name)), unit_of(name), interval_of(row, name), bounds=bounds)
        if name != self.layout.values[0]:
            return Cell()
        note = self.reasons.setdefault((row.outcome, row.reason), len(self.reasons) + 1)
        return Cell(outcome=row.outcome, reason=row.reason, note=note)

    def verdict_cell(self, row: ResultRow, name: str) -> Cell:
        """Return a ratio or a verdict."""
        judgement = self.verdicts.of(row, name)
        if judgement is None:
            return Cell(BASELINE) if name in VERDICTS and self.verdicts.is_first(row) else Cell()
        if name in VERDICTS:
            return Cell(judgement.verdict.value)
        ratio = judgement.ratio
        ends = None if ratio.low is None or ratio.high is None else (ratio.low, ratio.high)
        return Cell(ratio.estimate, unit_of(name), ends, shown=ratio_text(ratio))

    def title(self) -> str:
        """Return the heading, with what is missing."""
        title = plain(shortened(self.layout.title, LONGEST_NOTE))
        return f"{title} ({self.missing})" if self.missing else title

    def notes(self) -> list[str]:
        """Return what is said below the table."""
        notes = []
        shared = [self.shared(name) for name in SETTING if name not in (*self.index, self.layout.columns)]
        if any(shared):
            notes.append("all cases: " + ", ".join(filter(None, shared)))
        if self.layout.where:
            notes.append("only cases with " + ", ".join(f"{name} {value}" for name, value in self.layout.where.items()))
        if self.has_printed:
            notes.append(f"printed: {self.source()}; ratio: measured / printed")
        if self.has_marks:
            notes.append(f"{DIFFERS.shown}: not in the source's order, along its line or down its column")
        notes += self.verdicts.notes()
        if self.run is not None and self.run.status in _UNFINISHED:
            notes.append(f"{_UNFINISHED[self.run.status]}; cases may be missing")
        notes += _library_notes(self.run, self.rows)
        for name in (*self.layout.index, *([self.layout.columns] if self.layout.columns else [])):
            if self.rows and not is_known(name, self.rows):
                hint = did_you_mean(name, parameter_names(self.rows), noun="parameter")
                notes.append(f"no case has '{name}'; {hint}")
        for (outcome, reason), number in self.reasons.items():
            notes.append(f"[{number}] {outcome.value}: {reason or 'no reason given'}")
        return notes + _warning_notes(self.rows)

    def source(self) -> str:
        """Return where the printed values come from."""
        definitions = self.run.definitions if self.run is not None else []
        found = next((d.get("source") for d in definitions if d.get("name") == self.experiment), "")
        return str(found or "the source's values")

    def shared(self, name: str) -> str:
        """Return a setting that all cases have in common, as ``threads 2``, or an empty string."""
        found = {self.named(row, name) for row in self.rows}
        value = found.pop() if len(found) == 1 else ""
        if value == "" or _ORDINARY.get(name, "") == value:
            return ""
        return str(value) if name == "size" else f"{name} {value}"


def _library_notes(run: RunRecord | None, rows: Sequence[ResultRow]) -> list[str]:
    """Return what is not the run's alone: a peer's device, say."""
    return [f"{name}: {text}" for name, text in own_libraries(run, rows).items()] if run is not None else []


def _warning_notes(rows: Sequence[ResultRow]) -> list[str]:
    """Return each warning once, with the number of its cases."""
    warnings = Counter(warning for row in rows for warning in dict.fromkeys(row.warnings))
    notes = [
        f"warning ({count} case{'s' if count > 1 else ''}): {warning}"
        for warning, count in list(warnings.items())[:_MOST_WARNINGS]
    ]
    if len(warnings) > _MOST_WARNINGS:
        notes.append(f"{len(warnings) - _MOST_WARNINGS} more warnings; --format csv holds them all")
    return notes


def _index_cell(value: Scalar, column: str) -> Cell:
    if column != MEASURE:
        return Cell(value, unit_of(column))
    name, unit = header_text(str(value)), header_unit(str(value))
    return Cell(value, shown=f"{name} [{unit}]" if unit else name)
