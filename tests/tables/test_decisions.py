"""Whether numbers are what a claim says, exact ones and ones with intervals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from shadowbench.tables.decisions import OpenQuestion, Verdict, all_of, compared, course, crossed, power, relates
from shadowbench.tables.quantities import Quantity, exact

HOLDS, FAILS, OPEN = Verdict.HOLDS, Verdict.DOES_NOT_HOLD, Verdict.UNDECIDED


def _shown(amount: Quantity) -> str:
    return f"{amount.value:g}"


@pytest.mark.parametrize(
    ("relation", "verdicts"),
    [
        # an interval wholly below 1, one around it, one wholly above, and exactly 1
        ("less than", (HOLDS, OPEN, FAILS, FAILS)),
        ("at most", (HOLDS, OPEN, FAILS, HOLDS)),
        ("at least", (FAILS, OPEN, HOLDS, HOLDS)),
        ("more than", (FAILS, OPEN, HOLDS, FAILS)),
        ("equal to", (FAILS, OPEN, FAILS, HOLDS)),
    ],
)
def test_a_relation_holds_over_the_whole_interval_or_nowhere_or_is_open(
    relation: str, verdicts: tuple[Verdict, ...]
) -> None:
    figures = (Quantity(0.8, 0.7, 0.9), Quantity(1.0, 0.9, 1.1), Quantity(1.3, 1.2, 1.4), exact(1.0))
    assert tuple(relates(relation, figure, 1.0) for figure in figures) == verdicts


@pytest.mark.parametrize(
    ("figure", "verdict"),
    [
        (Quantity(1.0, 0.95, 1.05), HOLDS),
        (Quantity(1.05, 0.95, 1.15), OPEN),
        (Quantity(1.2, 1.11, 1.3), FAILS),
        (exact(1.1), HOLDS),
        (exact(1.11), FAILS),
    ],
)
def test_equal_within_a_tenth(figure: Quantity, verdict: Verdict) -> None:
    assert relates("equal to", figure, 1.0, 0.1) is verdict


def test_exact_numbers_are_equal_within_float_error_and_no_more() -> None:
    assert relates("equal to", exact(0.1 + 0.2), 0.3) is HOLDS
    assert relates("less than", exact(0.3), 0.1 + 0.2) is FAILS, "what is equal is not less"
    assert relates("at least", exact(0.3), 0.1 + 0.2) is HOLDS
    assert relates("equal to", exact(12_582_913), 12_582_912) is HOLDS, "a millionth"
    assert relates("equal to", exact(1001), 1000) is FAILS
    assert relates("equal to", exact(0), 0) is HOLDS
    assert relates("equal to", exact(1), 0) is FAILS


def test_all_conditions_must_hold() -> None:
    assert all_of([HOLDS, HOLDS]) is HOLDS
    assert all_of([HOLDS, OPEN]) is OPEN
    assert all_of([OPEN, FAILS, HOLDS]) is FAILS


def test_a_comparison_with_nothing_needs_no_ratio() -> None:
    decision = compared("more than", exact(3.0), exact(0.0), None, None, 1.0, _shown)
    assert (decision.verdict, decision.evidence) == (HOLDS, "3 against 0")


def test_a_factor_counts_on_the_right() -> None:
    decision = compared("equal to", exact(21.0), exact(42.0), exact(0.5), None, 0.5, _shown)
    assert (decision.verdict, decision.evidence) == (HOLDS, "21 against 0.5 times 42, ratio 0.5")
    assert decision.margin == 0.0
    slow = compared("less than", Quantity(3, 2, 4), Quantity(4, 3, 5), Quantity(0.7, 0.6, 0.8), None, 0.5, _shown)
    assert slow.verdict is FAILS, "0.6 is above half"


@pytest.mark.parametrize(
    ("relation", "values", "verdict"),
    [
        ("growing", (1, 2, 3), HOLDS),
        ("growing", (1, 2, 2), FAILS),
        ("not falling", (1, 2, 2), HOLDS),
        ("falling", (3, 2, 1), HOLDS),
        ("falling", (3, 2, 2.5), FAILS),
        ("not growing", (3, 3, 1), HOLDS),
        ("constant", (5, 5, 5), HOLDS),
        ("constant", (5, 5, 6), FAILS),
        ("growing", (0, 2, 3), HOLDS),
        ("falling", (2, 0, 0), FAILS),
    ],
)
def test_courses_of_exact_numbers(relation: str, values: tuple[float, ...], verdict: Verdict) -> None:
    first = relation == "constant"
    before = [values[0]] * (len(values) - 1) if first else values[:-1]
    ratios = [exact(b / a) if a else None for a, b in zip(before, values[1:], strict=True)]
    decision = course(relation, [1, 2, 4], list(map(exact, values)), ratios, None, "kernel", _shown)
    assert decision.verdict is verdict
    assert decision.evidence.endswith("at kernel 1, 2, 4")


def test_the_step_that_decides_is_named() -> None:
    times = [Quantity(v, 0.9 * v, 1.1 * v) for v in (1.0, 2.0, 1.2)]
    ratios = [Quantity(2.0, 1.8, 2.2), Quantity(0.6, 0.5, 0.7)]
    decision = course("growing", [1, 2, 4], times, ratios, None, "kernel", _shown)
    assert decision.verdict is FAILS
    assert decision.evidence == "1, 2, 1.2 at kernel 1, 2, 4; from 2 to 4 ratio 0.6 [0.5, 0.7]"


def test_a_crossing_takes_both_ends() -> None:
    above, below, around = Quantity(1.3, 1.2, 1.4), Quantity(0.8, 0.7, 0.9), Quantity(1.0, 0.9, 1.1)
    assert crossed("crossing downwards", [1, 2, 3], [above, around, below], "r").verdict is HOLDS
    assert crossed("crossing upwards", [1, 2, 3], [above, around, below], "r").verdict is FAILS
    assert crossed("crossing downwards", [1, 2], [above, around], "r").verdict is OPEN
    assert crossed("crossing downwards", [1, 2], [below, around], "r").verdict is FAILS


def test_the_exponent_and_its_interval_are_those_of_a_least_squares_line() -> None:
    x = np.array([1e3, 1e4, 1e5, 1e6])
    y = np.array([91e3, 471e3, 3.2e6, 23e6])
    line = stats.linregress(np.log(x), np.log(y))
    reach = stats.t.ppf(0.975, len(x) - 2) * line.stderr
    found = power(list(x), [exact(v) for v in y], 0.6, 1.0, "triangles").figure
    assert (found.value, found.low, found.high) == pytest.approx((line.slope, line.slope - reach, line.slope + reach))


@pytest.mark.parametrize(
    ("bounds", "verdict"),
    [((None, 1.0), FAILS), ((1.5, None), HOLDS), ((1.9, 2.1), HOLDS), ((2.1, None), FAILS)],
)
def test_the_exponent_of_a_power_is_found(bounds: tuple[float | None, float | None], verdict: Verdict) -> None:
    places = [1.0, 2.0, 4.0, 8.0]
    assert power(places, [exact(3.0 * x * x) for x in places], *bounds, "x").verdict is verdict


@pytest.mark.parametrize(
    ("places", "values", "why"),
    [([1.0, 2.0], [1.0, 2.0], "three values"), ([1.0, 2.0, 3.0], [0.0, 1.0, 2.0], "above 0")],
)
def test_what_has_no_exponent_is_open(places: list[float], values: list[float], why: str) -> None:
    with pytest.raises(OpenQuestion, match=why):
        power(places, [exact(v) for v in values], None, 1.0, "x")


def test_too_few_rounds_are_called_so() -> None:
    unknown = Quantity(0.5, 0.0, math.inf)
    decision = compared("less than", Quantity(1, 0, math.inf), Quantity(2, 0, math.inf), unknown, None, 1.0, _shown)
    assert decision.verdict is OPEN
    assert decision.evidence == "1 against 2, ratio 0.5 (too few rounds for an interval)"
