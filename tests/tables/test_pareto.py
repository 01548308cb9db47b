"""Fronts of cost against quality, against the definition; and the best within a limit."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shadowbench import tables
from shadowbench.errors import UsageError
from shadowbench.tables.pareto import Front, Standing, best_within, fronts
from shadowbench.tables.pareto_tables import Limits, pareto_tables

FRONT, DOMINATED, OPEN = Standing.FRONT, Standing.DOMINATED, Standing.OPEN


def _standings(front: Front) -> dict[str, Standing]:
    return {point.label: point.standing for point in front.points}


def _of_bytes(make_row: Any, **found: tuple[int, float]) -> list[Any]:
    return [make_row(method=m, bytes_kept=size, failure_percent=failed) for m, (size, failed) in found.items()]


def test_exact_costs_decide_by_themselves(make_row: Any) -> None:
    rows = _of_bytes(make_row, a=(1, 5.0), b=(2, 3.0), c=(3, 4.0), d=(2, 3.0), e=(4, 3.0))
    (front,) = fronts(rows, "bytes_kept")
    assert _standings(front) == {"a": FRONT, "b": FRONT, "d": FRONT, "c": DOMINATED, "e": DOMINATED}
    assert [point.label for point in front.points] == ["a", "b", "d", "c", "e"], "by cost, then by quality"
    assert front.points[3].dominated_by == ("b", "d")


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(found=st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=1, max_size=12))
def test_the_front_is_what_nothing_else_beats(make_row: Any, found: list[tuple[int, int]]) -> None:
    rows = [
        make_row(method="m", method_parameters={"n": n}, bytes_kept=c, failure_percent=float(q))
        for n, (c, q) in enumerate(found)
    ]
    (front,) = fronts(rows, "bytes_kept")
    for point in front.points:
        own = (point.cost.value, point.quality.value)
        beaten = any(c <= own[0] and q <= own[1] and (c, q) != own for c, q in found)
        assert point.standing is (DOMINATED if beaten else FRONT)
    assert len(front.points) == len(found)


def _timed(make_row: Any, method: str, rounds: list[float], failed: float, comparison: str = "c") -> Any:
    middle = sorted(rounds)[len(rounds) // 2]
    interval = {"shade_ms_low": min(rounds), "shade_ms_high": max(rounds)}
    return make_row(
        method=method,
        comparison=comparison,
        samples={"shade": rounds},
        shade_ms=middle,
        failure_percent=failed,
        **interval,
    )


def test_times_dominate_where_the_rounds_tell_them_apart(make_row: Any) -> None:
    drift = [float(r) for r in range(10, 20)]
    fast, slow = [0.9 * x for x in drift], drift
    rows = [_timed(make_row, "fast", fast, 1.0), _timed(make_row, "slow", slow, 2.0)]
    (front,) = fronts(rows, "shade_ms")
    assert _standings(front) == {"fast": FRONT, "slow": DOMINATED}
    apart = [rows[0], _timed(make_row, "slow", slow[::-1], 2.0, comparison="another")]
    (front,) = fronts(apart, "shade_ms")
    assert _standings(front) == {"fast": FRONT, "slow": OPEN}
    assert front.points[1].dominated_by == ("fast",)


def test_every_view_has_a_front_of_the_cases_that_have_both_figures(make_row: Any) -> None:
    rows = [
        make_row(camera=camera, width=width, scene_parameters={"n": n}, bytes_kept=1, rmse=0.5)
        for camera, width, n in itertools.product(("near", "far"), (64, 128), (1, 2))
    ]
    rows += [make_row(bytes_kept=1), make_row(rmse=1.0), make_row(bytes_kept=1, rmse=0.1, outcome="crash")]
    found = fronts([*rows, rows[0]], "bytes_kept", "rmse")
    assert len(found) == 8
    assert all(len(front.points) == 1 for front in found)
    assert {front.scene for front in found} == {"bunny(n=1)", "bunny(n=2)"}
    assert fronts([], "bytes_kept") == ()


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (("shade_m", "rmse"), "the cost cannot be 'shade_m'; did you mean 'shade_ms'"),
        (("dynamic_frame_fps", "rmse"), "less must be better"),
        (("shade_ms", "ssim"), "the quality cannot be 'ssim'; less must be better"),
    ],
)
def test_columns_of_which_more_is_better_are_refused(columns: tuple[str, str], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        fronts([], *columns)


def test_counters_are_costs_too(make_row: Any) -> None:
    (front,) = fronts([make_row(counters={"look-ups": 3}, failure_percent=1.0)], "counters.look-ups")
    assert front.points[0].cost.value == 3


def test_the_best_within_a_cost_and_the_cheapest_within_a_quality(make_row: Any) -> None:
    (front,) = fronts(_of_bytes(make_row, a=(1, 5.0), b=(2, 3.0), c=(3, 3.0), d=(9, 0.0)), "bytes_kept")
    best = best_within(front, cost=3)
    assert best.point is not None
    assert (best.point.label, best.no_worse) == ("b", ("c",))
    cheapest = best_within(front, quality=3.0)
    assert cheapest.point is not None
    assert (cheapest.point.label, cheapest.no_worse) == ("b", ())
    assert best_within(front, cost=0).point is None
    assert best_within(front, quality=-1.0).point is None


def test_a_time_is_within_a_limit_with_its_whole_interval(make_row: Any) -> None:
    rounds = [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6]
    (front,) = fronts([_timed(make_row, "a", rounds, 1.0)], "shade_ms")
    assert best_within(front, cost=1.5).point is None
    assert best_within(front, cost=1.6).point is not None


# As tables


def test_fronts_are_a_table_that_every_format_writes(make_row: Any, make_run: Any) -> None:
    rows = [*_of_bytes(make_row, a=(2**20, 5.0), b=(2**21, 6.0)), make_row(outcome="crash")]
    run = make_run(definitions=[{"name": "quick", "title": "Quick", "case_count": 4}])
    (table,) = pareto_tables(rows, run, cost="bytes_kept")
    assert table.title == "Quick: kept against failure (partial: 3 of 4 cases)"
    assert [[cell.text() for cell in line] for line in table.body] == [
        ["bunny", "sun", "main", "64x48", "a", "1.000", "5.00", "\u25cf front", ""],
        ["bunny", "sun", "main", "64x48", "b", "2.000", "6.00", "dominated", "a"],
    ]
    assert "left out: 1 case that failed" in table.notes
    for form in tables.FORMATS:
        assert tables.render([table], form)  # type: ignore[arg-type]


def test_limits_have_a_table_each_and_say_none(make_row: Any, make_run: Any) -> None:
    rows = [
        make_row(
            method=m,
            bytes_kept=size * 2**20,
            failure_percent=f,
            dynamic_frame_ms=t,
            dynamic_frame_ms_low=t,
            dynamic_frame_ms_high=t,
        )
        for m, size, f, t in (("a", 1, 5.0, 1.0), ("b", 4, 1.0, 2.0))
    ]
    made = pareto_tables(rows, make_run(), limits=Limits(milliseconds=1.5, mebibytes=4.0, percent=0.5))
    assert [table.title for table in made] == [
        "quick: least failure within 1.5 ms of dynamic frame",
        "quick: least failure within 4 MiB kept",
        "quick: least dynamic frame within 0.50 % of failure",
    ]
    assert [[cell.text() for cell in table.body[0]][4:] for table in made] == [
        ["a", "1.00", "5.00", ""],
        ["b", "4.000", "1.00", ""],
        ["none", "", "", ""],
    ]


def test_nothing_to_compare_says_so(make_row: Any, make_run: Any) -> None:
    (table,) = pareto_tables([make_row()], make_run())
    assert table.body == ()
    assert "no measured case has both figures" in table.notes
