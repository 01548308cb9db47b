"""What is stored comes back: any row, and what no database can hold as said."""

from __future__ import annotations

import math
import sys
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shadowbench.rows import LONG_FIELDS, Outcome, ResultRow
from shadowbench.store import Store
from shadowbench.store.records import long_values, row_from, row_values

TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20)
NAMES = st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=12)
WHOLE = st.integers(-(2**63), 2**63 - 1)
REAL = st.floats(allow_nan=False, allow_infinity=False)
JSON = st.recursive(
    st.none() | st.booleans() | WHOLE | REAL | TEXT, lambda inner: st.lists(inner, max_size=3), max_leaves=4
)


def _values_of(name: str) -> st.SearchStrategy[Any]:
    field = ResultRow.model_fields[name]
    long = {
        "stages": st.dictionaries(NAMES, REAL, max_size=3),
        "counters": st.dictionaries(NAMES, WHOLE, max_size=3),
        "kept": st.dictionaries(NAMES, WHOLE, max_size=3),
        "samples": st.dictionaries(NAMES, st.lists(REAL, min_size=1, max_size=3), max_size=2),
        "artifacts": st.dictionaries(NAMES, TEXT, max_size=2),
        "warnings": st.lists(TEXT, max_size=3),
        "round_processes": st.lists(WHOLE, max_size=3),
        "outlier_rounds": st.lists(WHOLE, max_size=3),
    }
    if name in long:
        return long[name]
    if field.annotation is Outcome:
        return st.sampled_from(list(Outcome))
    if field.annotation is str:
        return TEXT
    if field.annotation is int:
        return WHOLE
    if field.annotation == (int | None):
        return st.none() | WHOLE
    if field.annotation == (float | None):
        return st.none() | REAL
    return st.dictionaries(NAMES, JSON, max_size=3)


@st.composite
def result_rows(draw: st.DrawFn) -> ResultRow:
    return ResultRow.model_validate({name: draw(_values_of(name)) for name in ResultRow.model_fields})


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(row=result_rows())
def test_any_row_comes_back_equal_from_its_database_values(row: ResultRow) -> None:
    long = {
        table: [(line["name"], line["value"]) for line in lines] for table, lines in long_values(row, row_id=1).items()
    }
    assert row_from(row_values(row), long) == row


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(row=result_rows())
def test_any_row_comes_back_equal_from_the_store(store: Store, make_run: Any, row: ResultRow) -> None:
    store.start_run(make_run(row.run_id or "r"))
    row = row.model_copy(update={"run_id": row.run_id or "r"})
    store.add_row(row)
    (found,) = [each for each in store.rows(row.run_id, row.experiment) if each.case_key == row.case_key]
    assert found == row
    for table in LONG_FIELDS:  # the paper's order of stages and counters, not the alphabet's
        assert list(getattr(found, table)) == list(getattr(row, table))


def test_numbers_that_are_not_finite_come_back_as_missing(make_row: Any) -> None:
    row = make_row(
        build_ms=math.inf,
        rmse=math.nan,
        stages={"a": math.nan, "b": 2.0},
        samples={"build": [1.0, math.inf]},
        environment={"load": [math.nan, 1.0]},
    )
    values = row_values(row)
    assert values["build_ms"] is None
    assert values["rmse"] is None
    assert values["environment"] == {"load": [None, 1.0]}
    long = {table: [(x["name"], x["value"]) for x in lines] for table, lines in long_values(row, 1).items()}
    back = row_from(values, long)
    assert math.isnan(back.stages["a"])
    assert back.stages["b"] == 2.0
    assert back.samples["build"][0] == 1.0
    assert math.isnan(back.samples["build"][1])


def test_text_that_is_not_utf8_comes_back_as_escapes(store: Store, make_run: Any, make_row: Any) -> None:
    store.start_run(make_run())
    store.add_row(make_row(reason="a\udc80b\0c", stages={"\ud800": 1.0}, method_parameters={"p": "\udfff"}))
    (row,) = store.rows("run-1")
    assert row.reason == r"a\udc80b\x00c"
    assert row.stages == {r"\ud800": 1.0}
    assert row.method_parameters == {"p": r"\udfff"}


@pytest.mark.parametrize("field", ["receivers", "counters"])
def test_a_whole_number_of_more_than_64_bits_is_refused_in_one_line(
    store: Store, make_run: Any, make_row: Any, field: str
) -> None:
    from shadowbench.errors import StoreError

    store.start_run(make_run())
    value: Any = sys.maxsize + 1
    with pytest.raises(StoreError, match=r"add a row: a whole number is outside 64 bits$"):
        store.add_row(make_row(**{field: value if field == "receivers" else {"n": value}}))
    assert store.rows("run-1") == []
