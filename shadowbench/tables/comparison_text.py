"""A comparison of two runs as text: a table for the terminal, Markdown for a pull request, CSV and JSON.

For reading, the cases that changed come first and details follow; CSV and JSON hold every case, with values at full
precision. Ratios are B over A: below 1 is faster. Names are escaped by the modules that write tables.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args

from shadowbench.errors import UsageError, did_you_mean
from shadowbench.tables.columns import finite, scalar
from shadowbench.tables.comparing import CaseComparison, Change, RunComparison
from shadowbench.tables.csv_text import as_csv_tables
from shadowbench.tables.labels import Labels
from shadowbench.tables.markup import as_markdown, markdown_escaped
from shadowbench.tables.matching import SETTINGS
from shadowbench.tables.numbers import number_text
from shadowbench.tables.plain_text import LONGEST_NOTE, plain, shortened
from shadowbench.tables.table import Cell, Header, Table

if TYPE_CHECKING:
    from rich.console import RenderableType

    from shadowbench.statistics import Interval

ComparisonFormat = Literal["rich", "markdown", "csv", "json"]

COMPARISON_FORMATS: tuple[str, ...] = get_args(ComparisonFormat)

_MOST_NAMED = 4
"""Changed counters that a table names in a cell; the rest are counted."""


def render_comparison(comparison: RunComparison, format: str) -> str | RenderableType:  # noqa: A002 - the option's name
    """Write a comparison in one format.

    Returns:
        For ``rich`` something that ``rich.console.Console.print`` prints; text that ends with a line feed otherwise.

    Raises:
        UsageError: There is no such format.
    """
    if format == "rich":
        from shadowbench.tables.terminal import as_renderable

        return as_renderable([_table(comparison, comparison.cases, _title(comparison))])
    if format == "markdown":
        return _markdown(comparison)
    if format == "csv":
        return as_csv_tables([_tidy(comparison)])
    if format == "json":
        return json.dumps(_json(comparison), indent=1, allow_nan=False) + "\n"
    hint = did_you_mean(format, COMPARISON_FORMATS, noun="format")
    raise UsageError(f"no format of comparisons is called '{format}'; {hint}")


def _title(comparison: RunComparison) -> str:
    return plain(shortened(f"B {comparison.after.run_id} against A {comparison.before.run_id}", LONGEST_NOTE))


def _markdown(comparison: RunComparison) -> str:
    """Return the summary first, then the cases that changed, then everything folded."""
    changed = [case for case in comparison.cases if not case.is_unchanged]
    lines = "".join(f"- {count}: {_safe(summary)}\n" for summary, count in comparison.summaries.items())
    parts = [f"### {_safe(_title(comparison))}\n\n{_cases(len(comparison.cases))}, {len(changed)} changed\n\n{lines}"]
    if changed:
        table = _table(comparison, changed, "What changed")
        parts.append(as_markdown([table]).replace("### ", "#### ", 1))
    notes = "".join(f"- {_safe(note)}\n" for note in comparison.notes)
    parts.append(notes)
    folded = as_markdown([_table(comparison, comparison.cases, "All cases")]).partition("\n\n")[2]
    parts.append(f"<details><summary>All {len(comparison.cases)} cases</summary>\n\n{folded}\n</details>\n")
    return "\n".join(part for part in parts if part)


def _safe(text: str) -> str:
    return markdown_escaped(plain(shortened(text, LONGEST_NOTE)))


def _cases(count: int) -> str:
    return "1 case" if count == 1 else f"{count} cases"


def _table(comparison: RunComparison, cases: Sequence[CaseComparison], title: str) -> Table:
    """Return a table for reading: each case's verdict, and what it rests on."""
    index = _index(comparison)
    texts = [  # all of it is text: columns that name a line are aligned to the left and may be folded
        Header("result", "result", "B against A"),
        *(Header(name, name, f"{name} B/A") for name in ("build", "shade")),
        Header("details", "details", "details"),
    ]
    labels = _Names(comparison)
    body = []
    for case in cases:
        names = [Cell(labels.of(case, header.column)) for header in index]
        ratios = {time.name: _interval_text(time.ratio) for time in case.times}
        found = (case.summary, ratios.get("build"), ratios.get("shade"), _details(case))
        body.append((*names, *(Cell(text, shown=shortened(text or "", LONGEST_NOTE)) for text in found)))
    notes = [
        *(f"{count}: {summary}" for summary, count in comparison.summaries.items()),
        *comparison.notes,
        f"ratios are B/A, [low, estimate, high]; less than {comparison.threshold:.1%} apart is no difference",
    ]
    return Table(
        title=title,
        experiment="",
        run_id=comparison.after.run_id,
        index=(*index, *texts),
        values=(),
        body=tuple(body),
        notes=tuple(plain(shortened(note, LONGEST_NOTE)) for note in notes) if title == _title(comparison) else (),
        rows=(),
    )


def _index(comparison: RunComparison) -> list[Header]:
    """Return the columns that tell the cases apart."""
    rows = [case.row for case in comparison.cases]
    telling = [name for name in ("experiment", *SETTINGS) if len({getattr(row, name) for row in rows}) > 1]
    return [Header(name, name, name.replace("_", " ")) for name in ("scene", *telling, "method")]


class _Names:
    """What the index columns say of a case."""

    def __init__(self, comparison: RunComparison) -> None:
        rows = [row for case in comparison.cases for row in (case.before, case.after) if row is not None]
        self._labels = {
            "method": Labels("method", rows, defaults=comparison.after.method_defaults),
            "scene": Labels("scene", rows),
        }

    def of(self, case: CaseComparison, column: str) -> str:
        row = case.row
        return self._labels[column].of(row) if column in self._labels else str(getattr(row, column))


def _interval_text(ratio: Interval) -> str:
    if ratio.low is None or ratio.high is None:
        return f"{ratio.estimate:.3f}"
    return f"[{ratio.low:.3f}, {ratio.estimate:.3f}, {ratio.high:.3f}]"


def _details(case: CaseComparison) -> str:
    """Return what changed by name, with both values."""
    parts = []
    if case.pixels in ("other pixels", "other failure counts"):
        failing = [change for change in case.counts if change.name == "failure_count"]
        parts += [f"failures {_number(c.before)} → {_number(c.after)}" for c in failing] or ["as many failures"]
    parts += _named(case.counters, "")
    parts += _named(case.memory, "bytes")
    return "; ".join(parts)


def _named(changes: Sequence[Change], unit: str) -> list[str]:
    suffix = f" {unit}" if unit else ""
    texts = [f"{c.name} {_number(c.before)} → {_number(c.after)}{suffix}" for c in changes[:_MOST_NAMED]]
    more = len(changes) - _MOST_NAMED
    return [*texts, *([f"{more} more"] if more > 0 else [])]


def _number(value: int | None) -> str:
    return "none" if value is None else number_text(value, "", thousands=True)


# Every case, for programs

_PLAIN = ("experiment", "scene", "scene_parameters", "method", "method_parameters", *SETTINGS)


def _json(comparison: RunComparison) -> dict[str, Any]:
    return {
        "a": _run(comparison.before),
        "b": _run(comparison.after),
        "threshold": comparison.threshold,
        "notes": list(comparison.notes),
        "cases": [_case(case) for case in comparison.cases],
    }


def _run(run: Any) -> dict[str, Any]:
    return {name: getattr(run, name) for name in ("run_id", "created_at", "machine", "code_version")}


def _case(case: CaseComparison) -> dict[str, Any]:
    values: dict[str, Any] = {name: getattr(case.row, name) for name in _PLAIN}
    for side, row in (("a", case.before), ("b", case.after)):
        values[f"case_key_{side}"] = None if row is None else row.case_key
        values[f"outcome_{side}"] = None if row is None else row.outcome.value
        values[f"reason_{side}"] = None if row is None else row.reason
    values |= {
        "summary": case.summary,
        "changed": sorted(case.kinds),
        "pixels": case.pixels.value if case.is_measured else None,
        "pixels_note": case.pixels_note,
        "counts": {c.name: [c.before, c.after] for c in case.counts},
        "counters": {c.name: [c.before, c.after] for c in case.counters},
        "memory": {c.name: [c.before, c.after] for c in case.memory},
        "times_note": case.times_note,
        "times": {
            time.name: {
                "a_ms": time.before,
                "b_ms": time.after,
                "ratio": time.ratio.estimate,
                "low": time.ratio.low,
                "high": time.ratio.high,
                "verdict": time.verdict.value,
            }
            for time in case.times
        },
    }
    found: dict[str, Any] = finite(values)
    return found


def _tidy(comparison: RunComparison) -> Table:
    """Return one line a case; what is nested in JSON is a column of its own or JSON in a cell."""
    lines = []
    for case in comparison.cases:
        values = _case(case)
        times = values.pop("times")
        for name in ("build", "shade"):
            parts = times.get(name, {})
            for part in ("a_ms", "b_ms", "ratio", "low", "high", "verdict"):
                values[f"{name}_{part}"] = parts.get(part)
        lines.append({"a": comparison.before.run_id, "b": comparison.after.run_id} | values)
    names = list(dict.fromkeys(name for line in lines for name in line))
    body = tuple(tuple(Cell(scalar(line[name])) for name in names) for line in lines)
    headers = tuple(Header(name, name, name) for name in names)
    return Table(_title(comparison), "", comparison.after.run_id, headers, (), body, (), ())
