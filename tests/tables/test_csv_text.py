"""CSV: one line a case, every column, text that no spreadsheet executes."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from typing import Any

import pytest

from shadowbench import tables
from shadowbench.errors import UsageError
from shadowbench.experiment import TableLayout
from shadowbench.rows import ResultRow
from shadowbench.tables.csv_text import TIDY_COLUMNS, as_tidy_csv, rows_of_tidy_csv


def _read(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text, newline="")))


def test_tidy_csv_has_every_column_of_a_row_in_its_order_but_samples(make_row: Any) -> None:
    header = as_tidy_csv([make_row()]).splitlines()[0].split(",")
    assert header == [name for name in ResultRow.model_fields if name != "samples"] == list(TIDY_COLUMNS)


def test_tidy_csv_holds_values_as_they_are(make_row: Any) -> None:
    row = make_row(
        build_ms=1 / 3,
        false_lit_count=10**15,
        rmse=0.0,
        ssim=math.nan,
        method_parameters={"kernel": 3, "bias": 0.1},
        stages={"a, b": math.inf, "c": 2.0},
        warnings=['say "x", then\nstop'],
        stderr_tail="one\ntwo",
    )
    (line,) = _read(as_tidy_csv([row]))
    assert float(line["build_ms"]) == 1 / 3
    assert line["false_lit_count"] == "1000000000000000"
    assert (line["rmse"], line["ssim"], line["shade_ms"]) == ("0.0", "", "")
    assert json.loads(line["method_parameters"]) == {"kernel": 3, "bias": 0.1}
    assert json.loads(line["stages"]) == {"a, b": None, "c": 2.0}
    assert json.loads(line["warnings"]) == ['say "x", then\nstop']
    assert line["stderr_tail"] == r"one\ntwo"
    assert line["outcome"] == "ok"


def test_a_row_in_two_tables_is_one_line(make_row: Any) -> None:
    layout = TableLayout("T", ("method",), ("build_ms",))
    made = tables.make([make_row(), make_row(method="vsm", outcome="skipped")], {"quick": [layout, layout]})
    assert [line["method"] for line in _read(str(tables.render(made, "csv")))] == ["pcf", "vsm"]


def test_a_table_keeps_its_shape_with_full_numbers_and_reasons(make_row: Any) -> None:
    rows = [
        make_row(triangles=1, build_ms=1 / 3),
        make_row(triangles=2, outcome="crash", reason="signal 11, core"),
        make_row(triangles=1, method="vsm", build_ms=2.0),
    ]
    layouts = {"quick": [TableLayout("T", ("method",), ("build_ms",), "triangles")]}
    lines = _read(str(tables.render(tables.make(rows, layouts), "csv-table")))
    assert lines == [
        {
            "method": "pcf",
            "build_ms[triangles=1]": "0.3333333333333333",
            "build_ms[triangles=2]": "crash: signal 11, core",
        },
        {"method": "vsm", "build_ms[triangles=1]": "2.0", "build_ms[triangles=2]": ""},
    ]


def test_several_tables_have_titles_and_an_empty_line_between(make_row: Any) -> None:
    layout = TableLayout("T, 1", ("method",), ("build_ms",))
    text = tables.render(tables.make([make_row(build_ms=1.0)], {"quick": [layout, layout]}), "csv-table")
    assert text == '"T, 1"\nmethod,build_ms\npcf,1.0\n\n"T, 1"\nmethod,build_ms\npcf,1.0\n'


def test_no_field_is_a_formula_and_a_line_is_a_line(hostile_rows: list[ResultRow], hostile: str) -> None:
    layouts = {"quick": [TableLayout(hostile, (hostile, "method", "scene"), ("build_ms", f"stages.{hostile}x"))]}
    made = tables.make(hostile_rows, layouts)
    for text in (
        tables.render(made, "csv"),
        tables.render(made, "csv-table"),
        tables.render([*made, *made], "csv-table"),
    ):
        assert isinstance(text, str)
        text.encode()
        fields = [field for line in csv.reader(io.StringIO(text, newline="")) for field in line]
        for field in fields:
            is_number = field.removeprefix("-").replace(".", "", 1).isdigit()
            assert is_number or not field.lstrip().startswith(("=", "+", "-", "@")), field
            assert field.isprintable()
    assert str(tables.render(made, "csv")).count("\n") == 1 + len(hostile_rows)


def test_negative_numbers_stay_numbers(make_row: Any) -> None:
    (line,) = _read(as_tidy_csv([make_row(build_ms=-1.5, method="-1.5")]))
    assert (line["build_ms"], line["method"]) == ("-1.5", "'-1.5")


def test_tidy_csv_reads_back_as_the_rows_that_were_written(make_row: Any) -> None:
    rows = [
        make_row(build_ms=1 / 3, rmse=0.0, method_parameters={"kernel": 3, "name": "=1"}, warnings=['say "x"', "b"]),
        make_row(case_key="other", method="=cmd|x", reason="'quoted", counters={"a, b": 7}, environment={"a": [1]}),
    ]
    assert rows_of_tidy_csv(as_tidy_csv(rows), "rows.csv") == [r.model_copy(update={"samples": {}}) for r in rows]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "rows.csv is empty"),
        ("speed\n1\n", "has a column 'speed' that no row has"),
        ("run_id,rounds\nr,many\n", "rows.csv, line 2: this is no row"),
        ("run_id,method\nr\n", "rows.csv, line 2: this is no row"),
    ],
)
def test_what_is_no_table_of_rows_is_refused_by_line(text: str, message: str) -> None:
    with pytest.raises(UsageError, match=re.escape(message)):
        rows_of_tidy_csv(text, "rows.csv")
