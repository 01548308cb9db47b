"""Rows become charts: where the time goes, how it grows, what it buys."""

from __future__ import annotations

import math
from typing import Any

import pytest
from stored_rows import some_row, some_run

from shadowbench.experiment import Printed, TableLayout
from shadowbench.report.chart import Bars, Plot, are_ticks, scale_of, tick_text
from shadowbench.report.growth import growth_plots
from shadowbench.report.pareto_plot import pareto_plot
from shadowbench.report.stage_bars import MOST_BARS, stage_bars, stage_styles
from shadowbench.rows import ResultRow
from shadowbench.tables.pareto import fronts


def named(rows: list[ResultRow]) -> dict[str, tuple[str, str]]:
    return {row.case_key: (row.method, f"case-{number}") for number, row in enumerate(rows)}


def bars_of(*rows: ResultRow) -> Bars:
    found = stage_bars("a view", rows, named(list(rows)), stage_styles(rows))
    assert found is not None
    return found


def timed(method: str, total: float, **fields: Any) -> ResultRow:
    times = {"dynamic_frame_ms": total, "dynamic_frame_ms_low": total - 1, "dynamic_frame_ms_high": total + 1}
    return some_row(method, **(times | {"camera_ms": 1.0, "build_ms": 1.0, "shade_ms": total - 2.0} | fields))


# Where the time goes


def test_parts_of_a_bar_add_up_to_the_frame() -> None:
    chart = bars_of(timed("a", 10.0, stages={"fill": 5.0, "look-up": 3.0}))
    assert chart.part_names == ("camera pass", "fill", "look-up", "not in any stage")
    (bar,) = chart.bars
    assert bar.parts == (1.0, 5.0, 3.0, 1.0)
    assert (bar.total, bar.low, bar.high) == (10.0, 9.0, 11.0)


def test_stages_beyond_the_colours_there_are_share_one() -> None:
    chart = bars_of(timed("a", 60.0, stages={f"stage {number}": float(number) for number in range(1, 11)}))
    assert chart.part_names[-2] == "other stages"
    assert chart.bars[0].parts[-2] == 1.0 + 2.0 + 3.0  # the lightest
    assert len(set(chart.part_styles)) == len(chart.part_styles)


def test_a_stage_has_one_colour_in_all_views_of_an_experiment() -> None:
    one, other = timed("a", 9.0, stages={"fill": 5.0}), timed("b", 9.0, stages={"rays": 2.0, "fill": 1.0})
    styles = stage_styles([one, other])
    for row in (one, other):
        chart = stage_bars("v", [row], named([row]), styles)
        assert chart is not None
        assert dict(zip(chart.part_names, chart.part_styles, strict=True))["fill"] == styles["fill"]


def test_cases_without_a_time_are_counted_not_drawn() -> None:
    chart = bars_of(timed("a", 9.0), some_row("b", outcome="crash"))
    assert [bar.label for bar in chart.bars] == ["a"]
    assert "1 case has no time" in chart.notes
    assert stage_bars("v", [some_row("b", outcome="crash")], {}, {}) is None


def test_of_very_many_cases_the_quickest_are_drawn_in_their_order() -> None:
    rows = [timed(f"m{number}", 100.0 - number) for number in range(MOST_BARS + 5)]
    chart = bars_of(*rows)
    assert [bar.label for bar in chart.bars] == [f"m{number}" for number in range(5, MOST_BARS + 5)]
    assert chart.notes[0] == f"the {MOST_BARS} quickest of {MOST_BARS + 5} cases"


def test_a_stage_that_is_no_number_is_left_out() -> None:
    assert bars_of(timed("a", 9.0, stages={"x": math.nan, "y": 1.0})).part_names[1:-1] == ("y",)


# How it grows


def sweep(method: str = "pcf", **fields: Any) -> list[ResultRow]:
    sizes = (256, 512, 1024)
    return [
        some_row(
            method, method_parameters={"resolution": size} | fields, shade_ms=size / 100.0, shade_ms_low=size / 110.0
        )
        for size in sizes
    ]


def plots_of(rows: list[ResultRow], layout: TableLayout) -> list[Plot]:
    return growth_plots(some_run(), layout, rows, {row.case_key: "case" for row in rows})


def test_a_swept_number_becomes_the_axis_and_methods_become_lines() -> None:
    rows = [*sweep("pcf"), *sweep("esm")]
    (plot,) = plots_of(rows, TableLayout("T", ("resolution",), ("shade_ms",), "method"))
    assert [series.name for series in plot.series] == ["pcf", "esm"]
    assert [(p.x, p.y) for p in plot.series[0].points] == [(256, 2.56), (512, 5.12), (1024, 10.24)]
    assert "exponent 1.00" in plot.summary
    assert {point.anchor for point in plot.points} == {"case"}


def test_printed_values_stand_beside_ours_without_a_case() -> None:
    printed = (Printed({"resolution": 256}, {"shade_ms": 20.0}), Printed({"resolution": 1024}, {"shade_ms": 30.0}))
    (plot,) = plots_of(sweep(), TableLayout("T", ("resolution",), ("shade_ms",), None, {}, printed))
    measured, theirs = plot.series
    assert theirs.is_printed
    assert theirs.style == measured.style
    assert [(p.x, p.y, p.anchor) for p in theirs.points] == [(256, 20.0, ""), (1024, 30.0, "")]


def test_values_of_different_units_get_plots_of_their_own() -> None:
    rows = [row.model_copy(update={"counters": {"texels": 7}}) for row in sweep()]
    layout = TableLayout("T", ("measure",), ("shade_ms", "counters.texels"), "resolution")
    assert [plot.y.label for plot in plots_of(rows, layout)] == ["shade [ms]", "texels"]


def test_too_many_lines_for_one_plot_are_shared_out() -> None:
    rows = [row for kernel in (3, 5, 7) for m in "abcd" for row in sweep(m, kernel=kernel)]
    layout = TableLayout("T", ("kernel", "resolution"), ("shade_ms",), "method")
    plots = plots_of(rows, layout)
    assert [plot.title.rpartition(", ")[2] for plot in plots] == ["kernel 3", "kernel 5", "kernel 7"]
    assert all(len(plot.series) == 4 for plot in plots)


@pytest.mark.parametrize("index", [("method",), ("scene", "method"), ("width",)])
def test_a_table_that_sweeps_no_number_has_no_plot(index: tuple[str, ...]) -> None:
    assert plots_of(sweep(), TableLayout("T", index, ("shade_ms",))) == []


def test_rows_that_failed_and_values_of_0_have_no_point() -> None:
    rows = [*sweep(), some_row(method_parameters={"resolution": 2048}, outcome="error")]
    rows[1] = rows[1].model_copy(update={"shade_ms": 0.0})
    assert plots_of(rows, TableLayout("T", ("resolution",), ("shade_ms",))) == []  # two points are no growth


# What it buys


def test_points_of_a_front_name_their_case_and_those_beaten_recede() -> None:
    rows = [
        timed("good", 5.0, failure_percent=1.0),
        timed("exact", 20.0, failure_percent=0.0),
        timed("worse", 40.0, failure_percent=9.0),
    ]
    (front,) = fronts(rows)
    plot = pareto_plot(front, "a view", named(rows))
    assert plot is not None
    best = plot.series[0]
    assert [(p.x, p.y, p.name, p.anchor) for p in best.points] == [(5, 1, "good", "case-0"), (20, 0, "exact", "case-1")]
    assert [series.is_faint for series in plot.series] == [False, True]
    assert "dominated by good" in plot.series[1].points[0].label


def test_one_point_is_no_front() -> None:
    rows = [timed("good", 5.0)]
    assert pareto_plot(fronts(rows)[0], "a view", named(rows)) is None


# Scales


def test_a_logarithmic_scale_gives_equal_ratios_equal_lengths() -> None:
    scale = scale_of([1.0, 1000.0], 100.0, is_log=True)
    assert scale.at(10.0) - scale.at(1.0) == pytest.approx(scale.at(1000.0) - scale.at(100.0))
    assert 0.0 < scale.at(1.0) < scale.at(1000.0) < 100.0


def test_zero_stands_on_a_line_of_its_own_below_a_logarithmic_axis() -> None:
    scale = scale_of([0.0, 1.0, 10.0], 100.0, is_log=True, zero_room=20.0)
    assert scale.at(0.0) == 0.0
    assert scale.at(1.0) > 20.0
    assert scale.ticks()[0] == 0.0
    assert 0.0 not in scale_of([1.0, 10.0], 100.0, is_log=True, zero_room=20.0).ticks()


@pytest.mark.parametrize("values", [[], [0.0], [5.0], [1e-9, 1e9], [0.3, 0.31]])
@pytest.mark.parametrize("is_log", [True, False])
def test_every_scale_has_an_end_and_ticks_within_it(values: list[float], is_log: bool) -> None:
    scale = scale_of(values, 100.0, is_log=is_log)
    assert scale.low < scale.high
    assert all(0.0 <= scale.at(tick) <= 100.0 for tick in scale.ticks())
    assert len(scale.ticks()) <= 12


def test_a_sweeps_own_values_are_marked_where_they_are_short_and_apart() -> None:
    scale = scale_of([512, 2048], 500.0, is_log=True)
    assert are_ticks([512, 1024, 2048], scale, apart=30.0)
    assert not are_ticks([512, 515, 2048], scale, apart=30.0)
    assert not are_ticks([512.1234, 2048], scale, apart=30.0)


def test_ticks_are_short() -> None:
    assert [tick_text(v) for v in (0.0, 0.03, 1, 512, 1000, 1024, 20_000, 3e6)] == [
        *("0", "0.03", "1", "512", "1K", "1024", "20K", "3M")
    ]
