"""Numbers are written with the digits that mean something, and never as another number's."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.tables.numbers import MEBIBYTE, number_text


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0, "ms", "0"),
        (0.012345, "ms", "0.0123"),
        (1.0, "ms", "1.00"),
        (9.999, "ms", "10.0"),
        (12.345, "ms", "12.3"),
        (99.96, "ms", "100"),
        (1234.5, "ms", "1234"),
        (0.00001234, "ms", "1.23e-5"),
        (0.03125, "1", "0.03125"),
        (1.234e-7, "1", "1.234e-7"),
        (0.99999, "1", "1.000"),
        (-2.5, "1", "-2.500"),
        (786432, "receivers", "786432"),
        (0, "receivers", "0"),
        (23_000_000, "1", "23000000"),
        (178_956_960, "bytes", "170.7"),
        (12 * MEBIBYTE, "bytes", "12.00"),
        (0, "bytes", "0"),
        (1, "bytes", "9.537e-7"),
        (0.0, "%", "0"),
        (0.0001, "%", "<0.01"),
        (0.0049, "%", "<0.01"),
        (0.005, "%", "0.01"),
        (7.1, "%", "7.10"),
        (99.994, "%", "99.99"),
        (99.999, "%", ">99.99"),
        (100.0, "%", "100.00"),
        (math.inf, "ms", "inf"),
    ],
)
def test_a_number_is_written_by_its_unit(value: float, unit: str, text: str) -> None:
    assert number_text(value, unit) == text


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(1234567, "1", "1,234,567"), (1234.5, "ms", "1,234"), (5 * 2**40, "bytes", "5,242,880"), (999, "1", "999")],
)
def test_thousands_are_separated_when_asked_for(value: float, unit: str, text: str) -> None:
    assert number_text(value, unit, thousands=True) == text


@given(st.floats(1e-12, 1e12) | st.floats(-1e12, -1e-12), st.sampled_from(["ms", "1"]))
def test_what_is_written_is_the_value_to_three_digits(value: float, unit: str) -> None:
    assert float(number_text(value, unit)) == pytest.approx(value, rel=0.005)


@given(st.floats(0, 100))
def test_only_nothing_is_written_as_no_percentage_and_only_everything_as_all(value: float) -> None:
    text = number_text(value, "%")
    assert (text == "0") == (value == 0)
    assert (text == "100.00") == (value == 100)
    assert text != "0.00"
