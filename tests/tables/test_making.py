"""Every case has its place in a table, and every number in a table is in a row."""

from __future__ import annotations

import dataclasses
import io
import json
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rich.console import Console

from shadowbench import tables
from shadowbench.errors import ExperimentError, UsageError
from shadowbench.experiment import Printed, TableLayout
from shadowbench.rows import Outcome
from shadowbench.tables.printed import out_of_order
from shadowbench.tables.table import Cell, Table


def _grid(table: Table, **how: bool) -> list[list[str]]:
    return [[cell.text(**how) for cell in line] for line in table.body]


def _headers(table: Table) -> list[str]:
    return [header.line() for header in table.headers]


def _one(rows: Any, layout: TableLayout | None = None, run: Any = None) -> Table:
    layouts = None if layout is None else {"quick": [layout]}
    (table,) = tables.make(rows, layouts, run)
    return table


def test_the_default_table_has_what_varies_the_method_and_what_was_measured(make_row: Any) -> None:
    rows = [
        make_row(light=light, method=method, build_ms=1.25, failure_percent=0.001, bytes_kept=2**20)
        for light in ("sun", "lamp")
        for method in ("pcf", "vsm")
    ]
    table = _one(rows)
    assert _headers(table) == ["light", "method", "build [ms]", "kept [MiB]", "failure [%]"]
    assert _grid(table)[1] == ["sun", "vsm", "1.25", "1.000", "<0.01"]
    assert table.notes == ("all cases: scene bunny, camera main, 64x48, device cpu, threads 2",)
    assert (table.title, table.experiment, table.run_id) == ("quick", "quick", "run-1")


def test_a_layout_names_lines_and_values(make_row: Any) -> None:
    rows = [
        make_row(method_parameters={"resolution": r, "kernel": 3}, shade_ms=float(r), counters={"texels": r * r})
        for r in (512, 1024)
    ]
    table = _one(rows, TableLayout("T", ("method", "resolution"), ("counters.texels", "shade_ms", "rmse")))
    assert _headers(table) == ["method", "resolution", "texels", "shade [ms]", "RMSE"]
    assert _grid(table, thousands=True) == [
        ["pcf", "512", "262,144", "512", ""],
        ["pcf", "1024", "1,048,576", "1,024", ""],
    ]


def test_a_pivot_puts_values_side_by_side_in_the_order_of_numbers(make_row: Any) -> None:
    rows = [
        make_row(method=method, triangles=n, build_ms=float(n), shade_ms=1.0)
        for method in ("pcf", "vsm")
        for n in (100_000, 1000)
        if (method, n) != ("vsm", 1000)
    ]
    table = _one(rows, TableLayout("T", ("method",), ("build_ms", "shade_ms"), "triangles"))
    assert _headers(table) == [
        "method",
        "triangles=1000: build [ms]",
        "triangles=1000: shade [ms]",
        "triangles=100000: build [ms]",
        "triangles=100000: shade [ms]",
    ]
    assert [header.name for header in table.values][::2] == ["build_ms[triangles=1000]", "build_ms[triangles=100000]"]
    assert _grid(table) == [["pcf", "1000", "1.00", "100000", "1.00"], ["vsm", "", "", "100000", "1.00"]]


def test_measures_can_be_the_lines_as_in_the_papers(make_row: Any) -> None:
    rows = [
        make_row(triangles=n, scene_parameters={"triangles": n}, counters={"nodes visited": 5 * n}, bytes_kept=n)
        for n in (2**20, 2**21)
    ]
    table = _one(rows, TableLayout("T", ("measure",), ("counters.nodes visited", "bytes_kept"), "triangles"))
    assert _headers(table) == ["measure", "triangles=1048576", "triangles=2097152"]
    assert _grid(table) == [["nodes visited", "5242880", "10485760"], ["kept [MiB]", "1.000", "2.000"]]


@pytest.mark.parametrize("outcome", [outcome for outcome in Outcome if outcome is not Outcome.OK])
def test_a_case_that_is_not_ok_stands_in_its_place_without_a_number(make_row: Any, outcome: Outcome) -> None:
    rows = [
        make_row(method="a", build_ms=1.0, shade_ms=2.0),
        make_row(method="b", build_ms=3.0, shade_ms=4.0, outcome=outcome, reason="it\nbroke"),
        make_row(method="c", build_ms=5.0, shade_ms=6.0),
        make_row(method="d", outcome=outcome, reason="it\nbroke"),
        make_row(method="e", outcome=outcome),
    ]
    table = _one(rows, TableLayout("T", ("method",), ("build_ms", "shade_ms")))
    assert _grid(table) == [
        ["a", "1.00", "2.00"],
        ["b", f"{outcome} [1]", ""],
        ["c", "5.00", "6.00"],
        ["d", f"{outcome} [1]", ""],
        ["e", f"{outcome} [2]", ""],
    ]
    assert table.notes[1:] == (f"[1] {outcome}: it\\nbroke", f"[2] {outcome}: no reason given")
    assert [line[1].is_failure for line in table.body] == [False, outcome.is_failure, False, *[outcome.is_failure] * 2]


def test_a_failure_stands_in_its_place_of_a_pivot(make_row: Any) -> None:
    rows = [make_row(triangles=1, build_ms=1.0), make_row(triangles=2, outcome="timeout", reason="60 s")]
    table = _one(rows, TableLayout("T", ("method",), ("build_ms", "shade_ms"), "triangles"))
    assert _grid(table) == [["pcf", "1.00", "", "timeout [1]", ""]]


def test_an_index_that_does_not_tell_cases_apart_is_completed(make_row: Any) -> None:
    rows = [
        make_row(camera=camera, method_parameters={"kernel": k}, build_ms=1.0)
        for camera in ("near", "far")
        for k in (3, 7)
    ]
    table = _one(rows, TableLayout("T", ("scene",), ("build_ms",)))
    assert _headers(table)[:3] == ["scene", "method", "camera"]
    assert len({tuple(line[:3]) for line in _grid(table)}) == 4


def test_cases_that_differ_in_nothing_shown_are_told_apart_by_their_keys(make_row: Any) -> None:
    rows = [make_row(quality_key=key, build_ms=1.0) for key in "ab"]
    table = _one(rows, TableLayout("T", ("method",), ("build_ms",)))
    assert _grid(table) == [["pcf", rows[0].case_key, "1.00"], ["pcf", rows[1].case_key, "1.00"]]


def test_a_partial_run_says_so_in_the_title_and_why_below(make_row: Any, make_run: Any) -> None:
    run = make_run(
        experiments=["quick", "tour"],
        status="interrupted",
        case_count=9,
        definitions=[
            {"name": "quick", "title": "Quick look", "case_count": 3},
            {"name": "tour", "title": "", "case_count": 6},
        ],
    )
    quick, tour = tables.make([make_row(build_ms=1.0)], None, run)
    assert quick.title == "Quick look (partial: 1 of 3 cases)"
    assert "the run was interrupted; cases may be missing" in quick.notes
    assert tour.title == "tour (partial: 0 of 6 cases)"
    assert tour.body == ()
    (only,) = tables.make([make_row(build_ms=1.0)], None, run, experiment="quick")
    assert only.title == quick.title
    with pytest.raises(UsageError, match=r"no experiment 'toor'; did you mean 'tour'\?"):
        tables.make([], None, run, experiment="toor")


def test_a_run_of_one_experiment_needs_no_definition_to_be_known_as_partial(make_row: Any, make_run: Any) -> None:
    assert _one([make_row()], run=make_run(case_count=2)).title == "quick (partial: 1 of 2 cases)"
    assert _one([make_row()], run=make_run(case_count=1)).title == "quick"


def test_layouts_come_from_the_run_unless_others_are_given(make_row: Any, make_run: Any) -> None:
    stored = {"title": "Stored", "index": ["method"], "values": ["build_ms"], "columns": None}
    run = make_run(definitions=[{"name": "quick", "title": "Quick", "tables": [stored, stored]}])
    rows = [make_row(build_ms=1.0)]
    assert [table.title for table in tables.make(rows, None, run)] == ["Stored", "Stored"]
    assert [t.title for t in tables.make(rows, {"quick": [TableLayout("G", ("method",), ("build_ms",))]}, run)] == ["G"]
    broken = make_run(definitions=[{"name": "quick", "tables": [{"title": "no index"}]}])
    with pytest.raises(ExperimentError, match="a stored table layout cannot be used: KeyError"):
        tables.make(rows, None, broken)


def test_tables_follow_the_runs_order_of_experiments(make_row: Any, make_run: Any) -> None:
    rows = [make_row(experiment=name) for name in ("b", "a", "c")]
    assert [t.experiment for t in tables.make(rows, None, make_run(experiments=["a", "b"]))] == ["a", "b", "c"]
    assert [t.experiment for t in tables.make(rows)] == ["b", "a", "c"]
    assert tables.make([]) == []


def test_names_that_no_case_has_are_noted_and_wrong_values_refused(make_row: Any) -> None:
    rows = [make_row(method_parameters={"resolution": 512}, build_ms=1.0)]
    table = _one(rows, TableLayout("T", ("method", "resolutoin"), ("build_ms",), "kernel"))
    assert "no case has 'resolutoin'; did you mean 'resolution'?" in table.notes
    assert "no case has 'kernel'; known parameters: resolution" in table.notes
    assert _grid(table) == [["pcf", "", "1.00"]]
    with pytest.raises(ExperimentError, match=r"table 'T': no value is called 'bild_ms'; did you mean 'build_ms'\?"):
        _one(rows, TableLayout("T", ("method",), ("bild_ms",)))
    with pytest.raises(ExperimentError, match="table 'T': needs at least one value"):
        _one(rows, TableLayout("T", ("method",), ()))
    with pytest.raises(ExperimentError, match="'measure' may stand in its index"):
        _one(rows, TableLayout("T", ("method",), ("build_ms",), "measure"))


def test_a_peers_device_is_noted(make_row: Any, make_run: Any) -> None:
    run = make_run(environment={"libraries": {"numpy": "2"}})
    own = make_row(environment={"libraries": {"numpy": "2", "renderer": "a card"}}, build_ms=1.0)
    assert _one([make_row(build_ms=1.0), own], run=run).notes[1:] == ("renderer: a card",)


def test_each_warning_is_noted_once_with_its_number_of_cases(make_row: Any) -> None:
    rows = [make_row(warnings=["same", f"own {i}", "same"], build_ms=1.0) for i in range(12)]
    notes = _one(rows).notes
    assert "warning (12 cases): same" in notes
    assert "warning (1 case): own 0" in notes
    assert notes[-1] == "3 more warnings; --format csv holds them all"


def test_printed_values_stand_beside_the_measured_with_the_ratio(make_row: Any, make_run: Any) -> None:
    rows = [
        make_row(method=method, scene_parameters={"triangles": n}, shade_ms=10.0, counters={"visited": 3 * n})
        for method in ("afsm", "embree")
        for n in (1000, 8000)
    ]
    layout = TableLayout(
        "T",
        ("method", "scene.triangles"),
        ("counters.visited", "shade_ms"),
        printed=(Printed({"method": "afsm", "scene.triangles": 1000}, {"counters.visited": 4000.0}),),
    )
    run = make_run(definitions=[{"name": "quick", "title": "Quick", "source": "Somebody 2004, table 1"}])
    table = _one(rows, layout, run)
    assert _headers(table) == ["method", "triangles", "visited", "visited printed", "visited ratio", "shade [ms]"]
    assert _grid(table) == [
        ["afsm", "1000", "3000", "4000", "0.7500", "10.0"],
        ["afsm", "8000", "24000", "", "", "10.0"],
        ["embree", "1000", "3000", "", "", "10.0"],
        ["embree", "8000", "24000", "", "", "10.0"],
    ]
    assert "printed: Somebody 2004, table 1; ratio: measured / printed" in table.notes
    assert "printed: the source's values; ratio: measured / printed" in _one(rows, layout).notes
    names = [header.name for header in table.values]
    assert names == ["counters.visited", "counters.visited (printed)", "counters.visited (ratio)", "shade_ms"]


def test_the_papers_table_has_a_printed_and_a_ratio_column_for_each_of_its_cases(make_row: Any) -> None:
    rows = [
        make_row(method="afsm", scene_parameters={"triangles": n}, stages={"sort": n / 100}, counters={"visited": n})
        for n in (1000, 8000)
    ]
    printed = tuple(
        Printed({"scene.triangles": n}, {"counters.visited": 500.0, "stages.sort": 4.0}) for n in (1000, 4000)
    )
    layout = TableLayout("T", ("measure",), ("counters.visited", "stages.sort"), "scene.triangles", printed=printed)
    table = _one(rows, layout)
    assert _headers(table) == [
        "measure",
        "triangles=1000",
        "triangles=1000: printed",
        "triangles=1000: ratio",
        "triangles=8000",
    ]
    assert _grid(table) == [["visited", "1000", "500", "2.000", "8000"], ["sort [ms]", "10.0", "4", "2.500", "80.0"]]
    assert len({header.name for header in table.headers}) == 5


@pytest.mark.parametrize(
    ("fields", "shown"),
    [
        ({"outcome": "crash", "reason": "it broke"}, ["crash [1]", "4.50"]),
        ({"shade_ms": None}, ["", "4.50"]),
        ({"shade_ms": 9.0}, ["9.00", "4.50", "2.000"]),
    ],
)
def test_a_printed_value_has_a_ratio_only_where_something_was_measured(
    make_row: Any, fields: dict[str, Any], shown: list[str]
) -> None:
    layout = TableLayout("T", ("method",), ("shade_ms",), printed=(Printed({"method": "pcf"}, {"shade_ms": 4.5}),))
    assert _grid(_one([make_row(**fields)], layout)) == [["pcf", *shown]]


def test_nothing_is_divided_by_a_printed_zero(make_row: Any) -> None:
    layout = TableLayout("T", ("method",), ("shade_ms",), printed=(Printed({}, {"shade_ms": 0.0}),))
    assert _grid(_one([make_row(shade_ms=1.0)], layout)) == [["pcf", "1.00", "0"]]


def test_without_a_printed_value_for_any_case_the_table_is_as_without_them(make_row: Any) -> None:
    rows = [make_row(shade_ms=1.0)]
    layout = TableLayout("T", ("method",), ("shade_ms",), printed=(Printed({"method": "other"}, {"shade_ms": 4.0}),))
    plain = _one(rows, TableLayout("T", ("method",), ("shade_ms",)))
    assert _one(rows, layout) == plain


@pytest.mark.parametrize("name", ["csv-table", "markdown", "latex", "json", "rich"])
def test_every_format_writes_printed_values(make_row: Any, name: Any) -> None:
    layout = TableLayout("T", ("measure",), ("shade_ms",), "triangles", printed=(Printed({}, {"shade_ms": 4.0}),))
    text = tables.render([_one([make_row(shade_ms=3.0, triangles=7)], layout)], name)
    if name == "rich":
        console = Console(width=100, file=io.StringIO())
        console.print(text)
        text = console.file.getvalue()
    assert "printed" in text
    assert "0.75" in text
    if name == "json":
        (found,) = json.loads(text)
        assert [cell.get("unit") for cell in found["body"][0][1:]] == ["ms", "ms", "1"]


def test_a_table_may_show_some_cases_only_and_is_not_partial_for_that(make_row: Any, make_run: Any) -> None:
    rows = [
        make_row(method=method, light=light, method_parameters={"kernel": kernel}, build_ms=float(kernel))
        for method in ("pcf", "vsm")
        for light in ("sun", "lamp")
        for kernel in (3, 7)
    ]
    layout = TableLayout("T", ("light",), ("build_ms",), where={"method": "pcf", "kernel": 7})
    table = _one(rows, layout, make_run(case_count=8))
    assert _grid(table) == [["sun", "7.00"], ["lamp", "7.00"]]
    assert table.title == "T"
    assert "only cases with method pcf, kernel 7" in table.notes
    assert {row.method for row in table.rows} == {"pcf"}
    assert _one(rows, layout, make_run(case_count=9)).title == "T (partial: 8 of 9 cases)"


def _beside(make_row: Any, ours: dict[tuple[str, int], float], theirs: dict[tuple[str, int], float]) -> Table:
    """A table of methods over resolutions, in percent, which are exact."""
    rows = [
        make_row(method=method, method_parameters={"resolution": r}, failure_percent=value)
        for (method, r), value in ours.items()
    ]
    printed = tuple(
        Printed({"method": method, "resolution": r}, {"failure_percent": value})
        for (method, r), value in theirs.items()
    )
    return _one(rows, TableLayout("T", ("method",), ("failure_percent",), "resolution", printed=printed))


def _marked(table: Table) -> list[tuple[str, str]]:
    """Line and column of every mark."""
    return [
        (line[0].text(), header.group)
        for line in table.body
        for header, cell in zip(table.headers, line, strict=True)
        if cell.value == "differs"
    ]


def test_cells_out_of_the_sources_order_are_marked(make_row: Any) -> None:
    theirs = {("a", 1): 1.0, ("a", 2): 2.0, ("a", 3): 3.0, ("b", 1): 4.0, ("b", 2): 5.0, ("b", 3): 6.0}
    same = {place: 10.0 * value for place, value in theirs.items()}
    assert _marked(_beside(make_row, same, theirs)) == []
    along = same | {("a", 1): 35.0}
    table = _beside(make_row, along, theirs)
    assert _marked(table) == [("a", "resolution=1")], "the one cell without which all is in order"
    assert "\u2260: not in the source's order, along its line or down its column" in table.notes
    assert [header.line() for header in table.headers[:5]] == [
        "method",
        "resolution=1: failure [%]",
        "resolution=1: printed [%]",
        "resolution=1: ratio",
        "resolution=1: order",
    ]
    down = same | {("b", 2): 15.0, ("b", 1): 12.0}
    assert _marked(_beside(make_row, down, theirs)) == [("a", "resolution=2")]
    missing = {place: value for place, value in along.items() if place != ("a", 1)}
    assert _marked(_beside(make_row, missing, theirs)) == []


@settings(max_examples=80, deadline=None)
@given(pairs=st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=8))
def test_without_the_marked_cells_ours_and_theirs_go_the_same_way(pairs: list[tuple[int, int]]) -> None:
    marked = out_of_order([(Cell(ours), Cell(theirs)) for ours, theirs in pairs])
    left = [pair for place, pair in enumerate(pairs) if place not in marked]
    assert not any(a[0] < b[0] and a[1] > b[1] for a in left for b in left)
    opposed = any(a[0] < b[0] and a[1] > b[1] for a in pairs for b in pairs)
    assert bool(marked) is opposed


def test_what_is_equal_or_cannot_be_told_apart_is_in_any_order(make_row: Any) -> None:
    def times(reach: float) -> Table:
        rows = [
            make_row(method=m, shade_ms=t, shade_ms_low=t - reach, shade_ms_high=t + reach)
            for m, t in (("a", 2.0), ("b", 1.0))
        ]
        printed = tuple(Printed({"method": m}, {"shade_ms": t}) for m, t in (("a", 1.0), ("b", 2.0)))
        return _one(rows, TableLayout("T", ("method",), ("shade_ms",), printed=printed))

    assert len(_marked(times(0.4))) == 1
    assert _marked(times(0.6)) == [], "their intervals overlap"
    equal = {("a", 1): 1.0, ("a", 2): 1.0}
    assert _marked(_beside(make_row, {("a", 1): 2.0, ("a", 2): 1.0}, equal)) == []


def test_lines_of_different_measures_are_in_no_order(make_row: Any) -> None:
    rows = [make_row(method_parameters={"n": n}, counters={"visited": 9 * n}, stages={"sort": n}) for n in (1, 2)]
    printed = tuple(Printed({"n": n}, {"counters.visited": 1.0 * n, "stages.sort": 5.0 * n}) for n in (1, 2))
    layout = TableLayout("T", ("measure",), ("counters.visited", "stages.sort"), "n", printed=printed)
    assert _marked(_one(rows, layout)) == []


def test_conditions_and_printed_values_are_kept_with_the_run(make_row: Any, make_run: Any) -> None:
    layout = TableLayout("T", ("method",), ("shade_ms",), None, {"light": "sun"}, (Printed({}, {"shade_ms": 4.0}),))
    stored = json.loads(json.dumps(dataclasses.asdict(layout)))
    run = make_run(definitions=[{"name": "quick", "title": "Quick", "tables": [stored]}])
    rows = [make_row(light=light, shade_ms=2.0) for light in ("sun", "lamp")]
    assert _one(rows, None, run).body == _one(rows, layout).body
    assert _grid(_one(rows, None, run)) == [["pcf", "2.00", "4", "0.5000"]]


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(drawn=st.data())
def test_every_case_has_one_place_and_every_number_is_a_rows(make_row: Any, drawn: st.DataObject) -> None:
    choices: dict[str, list[Any]] = {
        "scene": ["bunny", "box"],
        "light": ["sun", "lamp"],
        "method": ["pcf", "vsm"],
        "threads": [1, 2],
        "outcome": list(Outcome),
    }
    rows = []
    for number in range(1, drawn.draw(st.integers(1, 12)) + 1):
        fields = {name: drawn.draw(st.sampled_from(values)) for name, values in choices.items()}
        parameters = {"kernel": drawn.draw(st.sampled_from([3, 7]))}
        rows.append(make_row(build_ms=float(number), method_parameters=parameters, **fields))
    index = tuple(drawn.draw(st.lists(st.sampled_from(["scene", "light", "threads", "kernel"]), unique=True)))
    pivot = drawn.draw(st.sampled_from([None, "method", "threads", "kernel", "scene"]))
    cells = [cell for line in _one(rows, TableLayout("T", index, ("build_ms",), pivot)).body for cell in line]
    outcomes = sorted(cell.outcome for cell in cells if cell.outcome is not None)
    assert outcomes == sorted(row.outcome for row in rows if row.outcome is not Outcome.OK)
    measured = sorted(cell.value for cell in cells if cell.unit == "ms" and cell.value is not None)
    assert measured == [row.build_ms for row in rows if row.outcome is Outcome.OK]
