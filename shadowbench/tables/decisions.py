"""Whether numbers are what a claim says: comparisons, courses over a sweep, exponents and crossings, with intervals.

Everything is decided by the same rule: a relation *holds* if it does so over the whole interval, *does not hold* if it
does so nowhere in it, and is *undecided* otherwise. Exact numbers have an interval of no width and always decide;
numbers closer than :data:`FLOAT_ERROR` are equal, since filtered results may differ so much between machines' sums.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from shadowbench.statistics import CONFIDENCE
from shadowbench.tables.quantities import Quantity, exact, p_value

FLOAT_ERROR = 1e-6
"""Relative difference below which two exact numbers count as equal."""

_COMPARISON_OF = {
    "growing": "more than",
    "falling": "less than",
    "not falling": "at least",
    "not growing": "at most",
    "constant": "equal to",
}
"""What a course says of the ratio of each place's value to the one before it (of a constant: to the first)."""

Shown = Callable[[Quantity], str]


class Verdict(StrEnum):
    """What is said of a claim."""

    HOLDS = "holds"
    DOES_NOT_HOLD = "does not hold"
    UNDECIDED = "undecided"


class OpenQuestion(Exception):  # noqa: N818 - no error: why something cannot be decided
    """Why a group of cases cannot be decided."""


@dataclass(frozen=True)
class Decision:
    """What numbers say.

    Attributes:
        verdict: Whether they are what was claimed.
        evidence: The numbers.
        figure: The one that decides: a value, a ratio, or an exponent.
        margin: How far it lies from the bound, as a logarithm where it is a ratio.
        p_value: How probable so far a figure is where the truth lies on the bound; ``None`` for exact figures.
    """

    verdict: Verdict
    evidence: str
    figure: Quantity
    margin: float = 0.0
    p_value: float | None = None


def all_of(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the verdict on conditions that must all hold."""
    found = set(verdicts)
    for verdict in (Verdict.DOES_NOT_HOLD, Verdict.UNDECIDED):
        if verdict in found:
            return verdict
    return Verdict.HOLDS


def relates(relation: str, figure: Quantity, bound: float, within: float | None = None) -> Verdict:
    """Return whether a number stands in one of :data:`~shadowbench.claim.COMPARISONS` to a bound.

    Args:
        relation: ``less than``, ``at most``, ``equal to``, ``at least`` or ``more than``.
        figure: The number.
        bound: What it is compared with.
        within: Share of the bound by which equal numbers may differ; :data:`FLOAT_ERROR` if not given.
    """
    slack = FLOAT_ERROR * abs(bound) if figure.is_exact else 0.0
    if relation == "equal to":
        slack = (within or FLOAT_ERROR) * abs(bound)
        return _decided(
            holds=figure.low >= bound - slack and figure.high <= bound + slack,
            fails=figure.low > bound + slack or figure.high < bound - slack,
        )
    if relation in ("more than", "at least"):
        figure, bound = Quantity(-figure.value, -figure.high, -figure.low), -bound
    if relation in ("less than", "more than"):
        return _decided(holds=figure.high < bound - slack, fails=figure.low >= bound - slack)
    return _decided(holds=figure.high <= bound + slack, fails=figure.low > bound + slack)


def _decided(*, holds: bool, fails: bool) -> Verdict:
    return Verdict.HOLDS if holds else Verdict.DOES_NOT_HOLD if fails else Verdict.UNDECIDED


def compared(
    relation: str,
    amount: Quantity,
    against: Quantity,
    ratio: Quantity | None,
    within: float | None,
    times: float,
    shown: Shown,
) -> Decision:
    """Decide a comparison of two values.

    Args:
        relation: One of :data:`~shadowbench.claim.COMPARISONS`.
        amount, against: The values.
        ratio: Of the first to the second, where there is one.
        within: For ``equal to``.
        times: The second value counts so many times.
        shown: Writes a value.
    """
    factor = "" if times == 1.0 else f"{times:g} times "
    evidence = f"{shown(amount)} against {factor}{shown(against)}"
    if ratio is None or ratio.is_exact:
        figure = ratio if ratio is not None else amount
        verdict = relates(relation, amount, against.value * times, within)
        if ratio is None and not amount.is_exact:
            evidence = f"{shown(amount)} {interval_text(amount)} against {shown(against)}"
    else:
        figure, verdict = ratio, relates(relation, ratio, times, within)
    if ratio is not None:
        evidence += f", ratio {ratio_text(ratio)}"
        return Decision(verdict, evidence, figure, _distance(ratio.value, times), _chance(figure, times, verdict))
    margin = abs(amount.value - against.value * times)
    return Decision(verdict, evidence, figure, margin, _chance(figure, against.value, verdict))


def course(
    relation: str,
    places: Sequence[float],
    amounts: Sequence[Quantity],
    ratios: Sequence[Quantity | None],
    within: float | None,
    over: str,
    shown: Shown,
) -> Decision:
    """Decide how values run over a sweep.

    Args:
        relation: One of :data:`~shadowbench.claim.COURSES`.
        places: Values of the swept parameter, in order.
        amounts: The value at each.
        ratios: Of each value but the first to the one before it (for ``constant``, to the first).
        within: For ``constant``.
        over: What the sweep is called.
        shown: Writes a value.
    """
    comparison = _COMPARISON_OF[relation]
    before = amounts[:-1] if relation != "constant" else [amounts[0]] * len(ratios)
    steps: list[tuple[Verdict, float, Quantity, int]] = []
    for step, (ratio, amount, earlier) in enumerate(zip(ratios, amounts[1:], before, strict=True)):
        if ratio is not None:
            steps.append((relates(comparison, ratio, 1.0, within), _distance(ratio.value, 1.0), ratio, step))
        else:  # from nothing there is no ratio, but there is an order
            steps.append((relates(comparison, amount, earlier.value, within), math.inf, amount, step))
    verdict = all_of(step[0] for step in steps)
    # the step that decides: of those with the verdict the clearest for a failure, the narrowest else
    deciding = [step for step in steps if step[0] is verdict]
    _, margin, figure, at = (max if verdict is Verdict.DOES_NOT_HOLD else min)(deciding, key=lambda step: step[1])
    evidence = f"{', '.join(map(shown, amounts))} at {over} {', '.join(f'{place:g}' for place in places)}"
    if ratios[at] is not None and not figure.is_exact:
        begin = places[0] if relation == "constant" else places[at]
        evidence += f"; from {begin:g} to {places[at + 1]:g} ratio {ratio_text(figure)}"
    return Decision(verdict, evidence, figure, margin, _chance(figure, 1.0, verdict))


def crossed(relation: str, places: Sequence[float], ratios: Sequence[Quantity], over: str) -> Decision:
    """Decide whether one value begins above another and ends below it (``crossing downwards``), or the other way."""
    words = ("more than", "less than") if relation == "crossing downwards" else ("less than", "more than")
    ends = (ratios[0], ratios[-1])
    verdicts = [relates(word, end, 1.0) for word, end in zip(words, ends, strict=True)]
    verdict = all_of(verdicts)
    margin, figure = min((_distance(end.value, 1.0), end.value, end) for end in ends)[::2]
    shown = (f"{ratio_text(ratio)} at {over} {place:g}" for place, ratio in zip(places, ratios, strict=True))
    return Decision(verdict, f"ratio {', '.join(shown)}", figure, margin, _chance(figure, 1.0, verdict))


def power(
    places: Sequence[float], amounts: Sequence[Quantity], at_least: float | None, at_most: float | None, over: str
) -> Decision:
    """Decide the exponent of growth: the slope of the least-squares line through the logarithms.

    Its 95 % interval is Student's, from how far the points lie off the line (Draper & Smith, Applied Regression
    Analysis, section 1.4): wide where a power is no good description. That takes three places.
    """
    if len(places) < 3:
        raise OpenQuestion(f"an exponent takes three values of {over}, not {len(places)}")
    if min(places) <= 0.0 or min(amount.value for amount in amounts) <= 0.0:
        raise OpenQuestion(f"a power needs values and {over} above 0")
    exponent = _slope([math.log(place) for place in places], [math.log(amount.value) for amount in amounts])
    verdicts = [relates("at least", exponent, at_least)] if at_least is not None else []
    verdicts += [relates("at most", exponent, at_most)] if at_most is not None else []
    margin = min(abs(exponent.value - bound) for bound in (at_least, at_most) if bound is not None)
    evidence = f"exponent {exponent.value:.2f} [{exponent.low:.2f}, {exponent.high:.2f}] over {over} {places[0]:g} to"
    return Decision(all_of(verdicts), f"{evidence} {places[-1]:g}", exponent, margin)


def _slope(x: Sequence[float], y: Sequence[float]) -> Quantity:
    from scipy.special import stdtrit  # lazily, and not scipy.stats: reading claims must start fast

    count = len(x)
    mean_x, mean_y = sum(x) / count, sum(y) / count
    spread = sum((a - mean_x) ** 2 for a in x)
    slope = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True)) / spread
    residual = sum((b - mean_y - slope * (a - mean_x)) ** 2 for a, b in zip(x, y, strict=True))
    half = float(stdtrit(count - 2, 0.975)) * math.sqrt(residual / (count - 2) / spread)
    return Quantity(slope, slope - half, slope + half) if half > 0.0 else exact(slope)


def _chance(figure: Quantity, bound: float, verdict: Verdict) -> float | None:
    """Return the p-value of a figure that is not exact; without rounds, what its 95 % interval says of it."""
    if figure.is_exact:
        return None
    found = p_value(figure, bound)
    return found if found is not None else 1.0 if verdict is Verdict.UNDECIDED else 1.0 - CONFIDENCE


def ratio_text(ratio: Quantity) -> str:
    """Return ``0.931 [0.91, 0.952]``, or the number alone where it is exact."""
    return f"{ratio.value:.3g}" if ratio.is_exact else f"{ratio.value:.3g} {interval_text(ratio)}"


def interval_text(figure: Quantity) -> str:
    """Return ``[0.91, 0.952]``, or why there is none."""
    if math.isinf(figure.high):
        return "(too few rounds for an interval)"
    return f"[{figure.low:.3g}, {figure.high:.3g}]"


def _distance(ratio: float, bound: float) -> float:
    return abs(math.log(ratio / bound)) if ratio > 0.0 and bound > 0.0 else math.inf
