"""Tables on a terminal of any width."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import Any

import pytest
from rich.cells import cell_len
from rich.console import Console

from shadowbench import tables
from shadowbench.experiment import TableLayout
from shadowbench.rows import ResultRow
from shadowbench.tables.table import Table


def _printed(made: Sequence[Table], width: int, *, colour: bool = False) -> str:
    text = io.StringIO()
    console = Console(file=text, width=width, force_terminal=colour, color_system="standard" if colour else None)
    console.print(tables.render(made, "rich"))
    return text.getvalue()


@pytest.fixture
def rows(make_row: Any) -> list[ResultRow]:
    return [
        make_row(
            scene="random-triangles",
            scene_parameters={"triangles": 10**n},
            method="shadow-map",
            method_parameters={"resolution": r, "slope_bias": 1.5},
            **{
                f"{name}{end}": 10.0**n * factor
                for name in ("build_ms", "shade_ms", "dynamic_frame_ms")
                for end, factor in (("", 1.0), ("_low", 0.5), ("_high", 2.0))
            },
            bytes_kept=r * r * 4,
            failure_percent=100 / r,
            counters={"nodes visited": 10**n * r},
        )
        for n in range(3, 6)
        for r in (512, 2048)
    ]


def test_intervals_are_shown_where_there_is_room(rows: list[ResultRow]) -> None:
    made = tables.make(rows)
    assert "1,000 [500, 2,000]" in _printed(made, 200)
    assert "[500, 2,000]" not in _printed(made, 100)


@pytest.mark.parametrize("width", [200, 120, 80, 60, 40])
def test_nothing_is_cut_and_no_number_is_broken_at_any_width(rows: list[ResultRow], width: int) -> None:
    printed = _printed(tables.make(rows), width)
    assert all(cell_len(line) <= width for line in printed.splitlines())
    assert "…" not in printed
    for number in ("1,000", "10,000", "100,000", "1.000", "16.00", "0.20", "0.05"):
        assert len(re.findall(rf"(?<![\d,.]){re.escape(number)}(?![\d,.])", printed)) >= 2, number


def test_headings_have_units_and_numbers_are_aligned_to_the_right(rows: list[ResultRow]) -> None:
    lines = _printed(tables.make(rows), 110).splitlines()
    units = next(line for line in lines if "[ms]" in line)
    end = units.index("[ms]") + len("[ms]")
    measured = [line for line in lines if re.search(r"\d,000", line[:end])]
    assert [line[:end].split()[-1] for line in measured] == ["1,000", "1,000", "10,000", "10,000", "100,000", "100,000"]
    assert all(line[end] == " " for line in measured)


def test_a_label_that_the_line_above_has_is_not_repeated(rows: list[ResultRow]) -> None:
    printed = _printed(tables.make(rows), 200)
    assert printed.count("random-triangles(") == 3
    assert printed.count("shadow-map(resolution=512)") == 3


def test_colour_is_for_failures_only(make_row: Any) -> None:
    made = tables.make(
        [
            make_row(method="a", build_ms=1.0),
            make_row(method="b", outcome="skipped", reason="no"),
            make_row(method="c", outcome="crash", reason="11"),
        ]
    )
    printed = _printed(made, 100, colour=True)
    assert re.findall(r"\x1b\[([0-9;]+)m *([a-z]+ \[\d\])", printed) == [("31", "crash [2]")]
    colours = set(re.findall(r"\x1b\[([0-9;]+)m", printed)) - {"0", "1", "2"}
    assert colours == {"31"}


@pytest.mark.parametrize("width", [30, 100])
def test_hostile_names_appear_as_text(hostile_rows: list[ResultRow], hostile: str, width: int) -> None:
    layouts = {"quick": [TableLayout(hostile, ("method", hostile), ("build_ms", f"stages.{hostile}x"), "p")]}
    printed = _printed([*tables.make(hostile_rows), *tables.make(hostile_rows, layouts)], width)
    assert all(line.isprintable() for line in printed.split("\n"))
    assert all(cell_len(line) <= width for line in printed.split("\n"))
    assert "crash [1]" in printed
    assert "1.25" in printed


def test_a_table_without_cases_prints_its_headings(make_run: Any) -> None:
    assert "partial: 0 of 3 cases" in _printed(tables.make([], None, make_run(case_count=3)), 80)
