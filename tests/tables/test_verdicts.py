"""Times against the first case's, as tables show them: by round, corrected over the table, in every format."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from shadowbench import tables
from shadowbench.experiment import TableLayout
from shadowbench.rows import ResultRow
from shadowbench.statistics import Verdict
from shadowbench.tables.table import Table
from shadowbench.tables.verdicts import contrast_of

MakeRow = Callable[..., ResultRow]

LAYOUT = TableLayout("Times", ("method",), ("shade_ms", "shade_ratio", "shade_verdict"))
PROCESSES = [0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2]
DRIFT = np.linspace(10.0, 30.0, 12)


def _timed(make_row: MakeRow, method: str, factors: Any, **fields: Any) -> ResultRow:
    shade = list(DRIFT * factors)
    given = {
        "method": method,
        "comparison": "c",
        "baseline_case": "first",
        "shade_ms": float(np.median(shade)),
        "round_processes": PROCESSES,
        "samples": {"build": [1.0] * 12, "shade": shade, "camera": [0.5] * 12},
    }
    return make_row(**(given | fields))


@pytest.fixture
def rows(make_row: MakeRow) -> list[ResultRow]:
    noise = 1.0 + 0.001 * np.resize([-2, 1, 2, -1, 0], 12)
    return [
        _timed(make_row, "ray-traced", 1.0, case_key="first"),
        _timed(make_row, "pcf", 2.0 * noise),
        _timed(make_row, "vsm", 0.5 * noise),
        _timed(make_row, "esm", noise),
        make_row(method="csm", outcome="crash", reason="it fell", comparison=""),
    ]


def _one(rows: list[ResultRow], layout: TableLayout = LAYOUT) -> Table:
    (table,) = tables.make(rows, {"quick": [layout]})
    return table


def test_each_case_stands_beside_the_first_with_an_interval_and_a_plain_word(rows: list[ResultRow]) -> None:
    table = _one(rows)
    assert [header.line() for header in table.values] == [
        "shade [ms]",
        "vs ray-traced: shade ratio",
        "vs ray-traced: shade verdict",
    ]
    shown = {line[0].text(): [cell.text() for cell in line[2:]] for line in table.body}
    assert shown["ray-traced"] == ["", "baseline"]
    assert shown["pcf"] == ["[2.00, 2.00, 2.00]", "slower"]
    assert shown["vsm"] == ["[0.499, 0.500, 0.501]", "faster"]
    assert shown["esm"][1] == "no difference shown"
    assert shown["csm"] == ["", ""]
    assert any("by round" in note and "corrected" in note for note in table.notes)


def test_a_drift_that_both_share_does_not_widen_the_ratio(rows: list[ResultRow]) -> None:
    found = contrast_of(rows[1], rows[0], "shade_ms")
    assert found is not None
    interval = found.interval()
    assert interval.low is not None
    assert interval.high is not None
    assert interval.high / interval.low < 1.02


def test_a_ratio_of_frames_is_of_their_sums(rows: list[ResultRow]) -> None:
    found = contrast_of(rows[1], rows[0], "dynamic_frame_ms")
    assert found is not None
    expected = (np.array(rows[1].samples["shade"]) + 1.5) / (DRIFT + 1.5)
    assert np.exp(found.log_ratios) == pytest.approx(expected)
    assert found.processes == tuple(PROCESSES)


def test_a_case_of_another_block_is_compared_with_the_rounds_of_the_first_case_there(
    make_row: MakeRow, rows: list[ResultRow]
) -> None:
    again = {"baseline build": [1.0] * 12, "baseline shade": list(0.1 * DRIFT)}
    shade = list(0.3 * DRIFT)
    samples = {"build": [1.0] * 12, "shade": shade, "camera": [0.5] * 12} | again
    later = _timed(make_row, "late", 0.3, comparison="d", samples=samples)
    table = _one([*rows, later])
    (line,) = (line for line in table.body if line[0].value == "late")
    assert line[2].value == pytest.approx(3.0)
    assert line[3].value == "slower"


def test_without_rounds_in_common_there_is_no_ratio(make_row: MakeRow, rows: list[ResultRow]) -> None:
    other = _timed(make_row, "elsewhere", 1.0, comparison="d")
    broken = _timed(make_row, "broken", 1.0, samples={"shade": [1.0] * 5})
    alone = _timed(make_row, "alone", 1.0, baseline_case="gone")
    table = _one([*rows, other, broken, alone])
    for line in table.body:
        if line[0].value in ("elsewhere", "broken", "alone"):
            assert [cell.value for cell in line[2:]] == [None, None]


def test_the_first_case_may_be_left_out_of_the_table(rows: list[ResultRow]) -> None:
    layout = TableLayout("Times", ("method",), LAYOUT.values, where={"method": "pcf"})
    table = _one(rows, layout)
    assert [cell.text() for cell in table.body[0]][3] == "slower"
    assert table.values[1].group == "vs ray-traced"


def test_more_cases_in_a_table_ask_for_plainer_differences(make_row: MakeRow) -> None:
    first = _timed(make_row, "ray-traced", 1.0, case_key="first", round_processes=[])
    doubtful = _timed(make_row, "pcf", [1.1] * 10 + [0.9] * 2, round_processes=[])  # p = 0.039
    even = [_timed(make_row, f"m{n}", [1.1, 0.9] * 6, round_processes=[]) for n in range(8)]
    assert _one([first, doubtful]).body[1][3].value == Verdict.SLOWER
    assert _one([first, doubtful, *even]).body[1][3].value == Verdict.NO_DIFFERENCE


def test_cases_of_one_process_are_said_to_be_such(make_row: MakeRow) -> None:
    first = _timed(make_row, "ray-traced", 1.0, case_key="first", round_processes=[0] * 12)
    other = _timed(make_row, "pcf", 2.0, round_processes=[0] * 12)
    assert any(note.startswith("1 of 1 ratios are from one process a case") for note in _one([first, other]).notes)


def test_several_first_cases_are_not_named_as_one(make_row: MakeRow, rows: list[ResultRow]) -> None:
    others = [
        _timed(make_row, "shadow-map", 1.0, case_key="second", baseline_case="second", comparison="e"),
        _timed(make_row, "pcf", 2.0, baseline_case="second", comparison="e", light="lamp"),
    ]
    table = _one([*rows, *others], TableLayout("Times", ("light", "method"), LAYOUT.values))
    assert table.values[1].group == "vs first case"


def test_a_pivot_keeps_what_is_compared_with(rows: list[ResultRow]) -> None:
    table = _one(rows, TableLayout("Times", ("light",), LAYOUT.values, columns="method"))
    assert any(header.line() == "method=pcf: shade ratio vs ray-traced" for header in table.values)


@pytest.mark.parametrize("format_name", ["markdown", "latex", "csv-table", "json", "rich"])
def test_every_format_shows_ratio_and_verdict(rows: list[ResultRow], format_name: Any) -> None:
    made = tables.make(rows, {"quick": [LAYOUT]})
    rendered = tables.render(made, format_name)
    if format_name == "rich":
        from rich.console import Console

        console = Console(file=io.StringIO(), width=120)
        console.print(rendered)
        rendered = console.file.getvalue()  # type: ignore[attr-defined]
    assert isinstance(rendered, str)
    if format_name == "json":
        cells = json.loads(rendered)[0]["body"][1]
        assert cells[2]["low"] <= cells[2]["value"] <= cells[2]["high"]
        assert cells[3] == {"value": "slower"}
    elif format_name == "csv-table":
        line = list(csv.DictReader(io.StringIO(rendered)))[1]
        assert float(line["shade_ratio"]) == pytest.approx(2.0)
        assert line["shade_verdict"] == "slower"
    else:
        assert "2.00, 2.00, 2.00]" in rendered
        assert "slower" in rendered


def test_the_default_table_compares_whatever_was_timed_beside_a_first_case(rows: list[ResultRow]) -> None:
    (table,) = tables.make(rows)
    assert {"dynamic_frame_ratio", "dynamic_frame_verdict"} <= {header.column for header in table.values}
    (lonely,) = tables.make(rows[:1])
    assert "dynamic_frame_ratio" not in {header.column for header in lonely.values}
