"""Values as the report writes them."""

from __future__ import annotations

from shadowbench.report import wording


def test_absent_values_are_dashes_not_zeros() -> None:
    written = [wording.count(None), wording.number(None), wording.percent(None), wording.milliseconds(None)]
    assert {*written, wording.byte_size(None), wording.milliseconds(float("nan"))} == {wording.ABSENT}


def test_small_percentage_is_not_written_as_zero() -> None:
    assert wording.percent(0.0) == "0 %"
    assert wording.percent(0.0001) == "<0.01 %"


def test_bytes_are_whole_below_a_tenth_of_a_mebibyte() -> None:
    assert wording.byte_size(100_000) == "100,000 bytes"
    assert wording.byte_size(4 * 2**20) == "4.000 MiB"


def test_times_are_written_in_utc() -> None:
    assert wording.moment("2026-01-31T13:00:00+01:00") == "2026-01-31 12:00 UTC"
    assert wording.moment("yesterday") == "yesterday"


def test_line_ends_stay_and_control_characters_show() -> None:
    assert wording.shown("a\n\x1b[31mb") == "a\n\\x1b[31mb"
