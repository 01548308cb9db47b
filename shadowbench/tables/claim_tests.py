"""One test of a claim on rows: groups of cases, each with what it says. The language is :mod:`shadowbench.claim`'s."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from shadowbench.claim import COMPARISONS, COURSES, POWER, Test, bare, conditions_in_words, shown
from shadowbench.rows import Outcome, ResultRow, method_label
from shadowbench.tables.claim_groups import Group, group_names, groups_of, meets, nothing_meets
from shadowbench.tables.columns import header_unit, parameter_names, unit_of, value_of
from shadowbench.tables.decisions import Decision, OpenQuestion, Verdict, compared, course, crossed, power
from shadowbench.tables.layout import SETTING
from shadowbench.tables.numbers import number_text
from shadowbench.tables.quantities import Quantity, divided, exact, quantity_of, ratio_of, scaled


@dataclass(frozen=True)
class Finding:
    """What one group of cases says.

    Attributes:
        group: What tells the group from the others, ``kernel 3, resolution 512``; empty if there is one only.
        quantity: What was compared, ``dynamic_frame_ms of esm / vsm``.
        verdict: What it says.
        evidence: The figures, in one line.
        value, low, high: The figure that decides and its interval, equal where it is exact; ``None`` where there is
            none.
        case_keys: The cases.
        margin: How far the figure lies from the bound: 0 is on it.
        p_value: How probable so far a figure is where the truth lies on the bound; ``None`` for exact figures.
    """

    group: str
    quantity: str
    verdict: Verdict
    evidence: str
    value: float | None = None
    low: float | None = None
    high: float | None = None
    case_keys: tuple[str, ...] = ()
    margin: float = 0.0
    p_value: float | None = None


def findings_of(test: Test, rows: Sequence[ResultRow]) -> list[Finding]:
    """Return what each group of the test's cases says; one that is undecided where there is none.

    Args:
        test: The test.
        rows: Rows of its experiment, whatever their outcomes.
    """
    cases = [row for row in rows if meets(row, test.where)]
    ones = [row for row in cases if meets(row, test.of)]
    quantity = _quantity_text(test)
    if not ones:
        return [Finding("", quantity, Verdict.UNDECIDED, nothing_meets(rows, test.where | test.of))]
    other_side = test.than if test.than is not None else test.relative_to
    others = [row for row in cases if meets(row, other_side)] if other_side is not None else []
    if other_side is not None and not others:
        return [Finding("", quantity, Verdict.UNDECIDED, nothing_meets(rows, test.where | other_side))]
    groups = groups_of(test, ones, others)
    names = group_names(groups)
    return [_finding(test, group, name, quantity) for name, group in zip(names, groups, strict=True)]


# One group


def _finding(test: Test, group: Group, name: str, quantity: str) -> Finding:
    used = [*group.ones, *(row for row in group.others if row not in group.ones)]
    keys = tuple(row.case_key for row in used)
    try:
        _check_outcomes(used)
        decision = _decided(test, group)
    except OpenQuestion as reason:
        return Finding(name, quantity, Verdict.UNDECIDED, str(reason), case_keys=keys)
    return Finding(
        *(name, quantity, decision.verdict, decision.evidence),
        *(decision.figure.value, decision.figure.low, decision.figure.high),
        *(keys, decision.margin, decision.p_value),
    )


def _check_outcomes(rows: Iterable[ResultRow]) -> None:
    for row in rows:
        if row.outcome is not Outcome.OK:
            why = f": {row.reason}" if row.reason else ""
            raise OpenQuestion(f"{_case_name(row)} ended as {row.outcome.value}{why}")


def _decided(test: Test, group: Group) -> Decision:
    if test.relation in COMPARISONS:
        return _compared(test, group)
    places, amounts = _sweep(test, group)
    over = bare(test.over or "")
    if test.relation in COURSES:
        ratios = _steps(test, group, amounts) if test.relation != "constant" else _to_first(test, group, amounts)
        return course(test.relation, places, amounts, ratios, test.within, over, _text_of(test))
    if test.relation == POWER:
        return power(places, amounts, test.at_least, test.at_most, over)
    return crossed(test.relation, places, amounts, over)


def _compared(test: Test, group: Group) -> Decision:
    one = _only(group.ones, "of", test)
    if test.number is None and isinstance(value_of(one, test.value), str):
        return _texts_compared(test, one, _only(group.others, "than", test))
    amount = _amount(one, test)
    if test.number is not None:
        return compared(test.relation, amount, exact(test.number), None, test.within, 1.0, _text_of(test))
    other = _only(group.others, "than", test)
    column = test.than_value or test.value
    against = _amount(other, test, column)
    ratio = None if test.per else ratio_of(one, test.value, other, column)
    if ratio is None and against.value:
        ratio = divided(amount, against)
    return compared(test.relation, amount, against, ratio, test.within, test.times or 1.0, _text_of(test))


def _texts_compared(test: Test, one: ResultRow, other: ResultRow) -> Decision:
    """Decide whether texts, a digest of pictures, say, are equal: there is nothing else to ask of them."""
    text, against = value_of(one, test.value), value_of(other, test.than_value or test.value)
    if test.relation != "equal to" or not text or not against:
        raise OpenQuestion(f"{test.value} of {_case_name(one)} is no number")
    verdict = Verdict.HOLDS if text == against else Verdict.DOES_NOT_HOLD
    return Decision(verdict, "equal" if text == against else "different", exact(float(text == against)))


def _sweep(test: Test, group: Group) -> tuple[list[float], list[Quantity]]:
    """Return the places of a sweep in order, and the value at each or its ratio to the other side's."""
    ones = _by_place(group.ones, test, "of")
    if len(ones) < 2:
        raise OpenQuestion(f"{bare(test.over or '')} has one value only")
    has_others = test.than is not None or test.relative_to is not None
    if not has_others:
        return list(ones), [_amount(row, test) for row in ones.values()]
    others = _by_place(group.others, test, "than" if test.than is not None else "relative_to")
    if missing := sorted(ones.keys() ^ others.keys()):
        raise OpenQuestion(f"no case to compare with at {bare(test.over or '')} {shown(missing[0])}")
    return list(ones), [_against(ones[place], others[place], test) for place in ones]


def _against(one: ResultRow, other: ResultRow, test: Test) -> Quantity:
    ratio = None if test.per else ratio_of(one, test.value, other, test.value)
    if ratio is not None:
        return ratio
    amount, against = _amount(one, test), _amount(other, test)
    if not against.value:
        raise OpenQuestion(f"{test.value} of {_case_name(other)} is 0")
    return divided(amount, against)


def _steps(test: Test, group: Group, amounts: Sequence[Quantity]) -> list[Quantity | None]:
    """Return the ratio of each place's value to the one before it, ``None`` where that is 0."""
    rows = list(_by_place(group.ones, test, "of").values())
    pairs = zip(rows[1:], rows[:-1], amounts[1:], amounts[:-1], strict=True)
    return [_ratio(test, a, b, p, q) for a, b, p, q in pairs]


def _to_first(test: Test, group: Group, amounts: Sequence[Quantity]) -> list[Quantity | None]:
    rows = list(_by_place(group.ones, test, "of").values())
    return [_ratio(test, row, rows[0], p, amounts[0]) for row, p in zip(rows[1:], amounts[1:], strict=True)]


def _ratio(test: Test, row: ResultRow, to: ResultRow, amount: Quantity, to_amount: Quantity) -> Quantity | None:
    if test.relative_to is None:
        ratio = ratio_of(row, test.value, to, test.value)
        by = ratio_of(row, test.per, to, test.per) if test.per else exact(1.0)
        if ratio is not None and by is not None and by.is_exact and by.value > 0.0:
            return scaled(ratio, 1.0 / by.value)
    return divided(amount, to_amount) if to_amount.value else None


def _by_place(rows: Sequence[ResultRow], test: Test, side: str) -> dict[float, ResultRow]:
    places: dict[float, list[ResultRow]] = {}
    for row in rows:
        place = value_of(row, test.over or "")
        if isinstance(place, bool) or not isinstance(place, int | float):
            raise OpenQuestion(f"'{test.over}' is no number in {_case_name(row)}")
        places.setdefault(place, []).append(row)
    return {place: _only(places[place], side, test) for place in sorted(places)}


def _only(rows: Sequence[ResultRow], side: str, test: Test) -> ResultRow:
    if not rows:
        conditions = {"of": test.of, "than": test.than, "relative_to": test.relative_to}[side] or {}
        raise OpenQuestion(
            f"no case with {conditions_in_words(conditions)}" if conditions else "no case to compare with"
        )
    if len(rows) > 1:
        differing = _differing(rows) or ["the case"]
        raise OpenQuestion(f"{len(rows)} cases for one place of '{side}'; 'each' must name {', '.join(differing)}")
    return rows[0]


def _differing(rows: Sequence[ResultRow]) -> list[str]:
    names: list[str] = [name for name in ("method", *SETTING) if len({str(value_of(row, name)) for row in rows}) > 1]
    values: Callable[[str], set[str]] = lambda name: {json.dumps(value_of(row, name), default=str) for row in rows}  # noqa: E731
    return names + [name for name in parameter_names(rows) if len(values(name)) > 1]


def _amount(row: ResultRow, test: Test, column: str | None = None) -> Quantity:
    name = column or test.value
    amount = quantity_of(row, name)
    if amount is None:
        raise OpenQuestion(f"{_case_name(row)} has no number under {name}")
    if test.per is None:
        return amount
    ratio = ratio_of(row, name, row, test.per)
    if ratio is None:
        raise OpenQuestion(f"{_case_name(row)} has no {test.per} to divide by")
    return ratio


# Wording


def _text_of(test: Test) -> Callable[[Quantity], str]:
    """Return what writes an amount: with its unit, unless it is a ratio."""
    is_ratio = test.per is not None or test.relative_to is not None
    unit, unit_text = ("1", "") if is_ratio else (unit_of(test.value), header_unit(test.value))

    def text(amount: Quantity) -> str:
        is_count = amount.value.is_integer() and unit not in ("ms", "fps", "%", "bytes") and not is_ratio
        number = number_text(int(amount.value) if is_count else amount.value, unit or "1")
        return f"{number} {unit_text}" if unit_text not in ("", "count") else number

    return text


def _quantity_text(test: Test) -> str:
    value = f"{test.value} / {test.per}" if test.per else test.value
    one = conditions_in_words(test.of)
    text = f"{value} of {one}" if one else value
    other = test.than if test.than is not None else test.relative_to
    if other is not None or test.than_value is not None:
        column = f"{test.than_value} of " if test.than_value else ""
        text += f" / {column}{conditions_in_words(other or test.of)}"
    return text


def _case_name(row: ResultRow) -> str:
    return method_label(row.method, row.method_parameters, only=set())
