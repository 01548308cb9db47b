"""Tables as JSON."""

from __future__ import annotations

import json
import math
from typing import Any

from shadowbench import tables
from shadowbench.experiment import TableLayout
from shadowbench.rows import ResultRow


def _parsed(made: Any) -> Any:
    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    return json.loads(str(tables.render(made, "json")), parse_constant=refuse)


def test_a_table_is_an_object_with_full_values_intervals_and_outcomes(make_row: Any) -> None:
    rows = [
        make_row(build_ms=1 / 3, build_ms_low=0.3, build_ms_high=0.4, bytes_kept=2**21, rmse=math.nan),
        make_row(method="vsm", outcome="crash", reason="signal 11"),
    ]
    (table,) = _parsed(
        tables.make(rows, {"quick": [TableLayout("T", ("method",), ("build_ms", "bytes_kept", "rmse"))]})
    )
    assert table == {
        "title": "T",
        "experiment": "quick",
        "run_id": "run-1",
        "columns": [
            {"name": "method", "text": "method", "unit": "", "role": "index"},
            {"name": "build_ms", "text": "build", "unit": "ms", "role": "value"},
            {"name": "bytes_kept", "text": "kept", "unit": "bytes", "role": "value"},
            {"name": "rmse", "text": "RMSE", "unit": "1", "role": "value"},
        ],
        "body": [
            [{"value": "pcf"}, {"value": 1 / 3, "low": 0.3, "high": 0.4}, {"value": 2**21}, {"value": None}],
            [{"value": "vsm"}, {"outcome": "crash", "reason": "signal 11"}, {"value": None}, {"value": None}],
        ],
        "notes": [
            "all cases: scene bunny, light sun, camera main, 64x48, device cpu, threads 2",
            "[1] crash: signal 11",
        ],
    }


def test_a_line_of_measures_has_the_unit_at_the_value(make_row: Any) -> None:
    layout = TableLayout("T", ("measure",), ("bytes_kept", "counters.nodes"), "triangles")
    (table,) = _parsed(
        tables.make([make_row(triangles=1, bytes_kept=2**20, counters={"nodes": 5})], {"quick": [layout]})
    )
    assert table["columns"][1]["name"] == "triangles=1"
    assert table["body"] == [
        [{"value": "bytes_kept"}, {"value": 2**20, "unit": "bytes"}],
        [{"value": "counters.nodes"}, {"value": 5, "unit": "1"}],
    ]


def test_hostile_names_come_back_as_they_were(hostile_rows: list[ResultRow], hostile: str) -> None:
    layouts = {"quick": [TableLayout("T", ("light", "method"), ("build_ms",))]}
    text = str(tables.render(tables.make(hostile_rows, layouts), "json"))
    assert text.isascii()
    (table,) = json.loads(text)
    assert table["body"][0][0]["value"] == hostile
    assert table["body"][1][2] == {"outcome": "crash", "reason": hostile}
