"""Claims: what a source states about its techniques, and the tests that would make it true.

A claim stands in an experiment file as data. There is nothing to execute: a test names a value, the cases it is taken
from and what must be so, and :mod:`shadowbench.tables.claims` answers it from a run's rows::

    [[claim]]
    name = "half-the-memory"
    statement = "An exponential map takes half the memory of a variance map."
    source = "Somebody 2008, section 4"        # else the experiment's own source

    [[claim.test]]                             # every test must hold
    value = "bytes_kept"                       # what is compared: a value that a table can show
    of = {method = "esm"}                      # of the cases with these values
    is = "equal to"
    times = 0.5
    than = {method = "vsm"}                    # and of these
    each = ["kernel", "resolution"]            # once for every kernel and resolution

``is`` says what must be so, and which further keys go with it:

================================================= ================================================================
``is``                                            what must be so
================================================= ================================================================
``less than``, ``at most``, ``equal to``,         the value ``of`` the one case against that of another (``than``,
``at least``, ``more than``                       its ``than_value`` if that is another one), ``times`` a factor,
                                                  or against a ``number``
``growing``, ``falling``, ``not falling``,        the value over a sweep (``over``), from each case to the next; or,
``not growing``, ``constant``                     with ``relative_to``, its ratio to the value of those cases
``growing as a power``                            the exponent, over a sweep (``over``), of the power law that fits
                                                  best lies between ``at_least`` and ``at_most``
``crossing downwards``, ``crossing upwards``      over a sweep (``over``) the value begins above that of ``than``
                                                  and ends below it, or the other way round
================================================= ================================================================

``value``, ``than_value`` and ``per`` are row columns (``dynamic_frame_ms``, ``failure_percent``), frame rates, or one
long value (``stages.NAME``, ``counters.NAME``, ``kept.NAME``); with ``per`` the value is divided by that one of the
same case. ``of``, ``than``, ``relative_to`` and ``where`` (for all cases of the test) hold values by row column,
parameter name, ``method.NAME`` or ``scene.NAME``; a list holds any of its values. ``over`` and ``each`` are such names.
``within`` is the share by which equal and constant values may differ: none if it is not said, but for float error.

*Groups.* A test must hold in every group of cases that are alike in scene, light, camera, size, samples, layers, device
and threads (as far as ``of``, ``than``, ``relative_to`` and ``over`` do not name them; ``over = "receivers"`` sweeps
the size) and in what ``each`` names. What ``each`` names of one side's own conditions splits that side alone, and each
of its parts meets each of the other's: ``than = {method = ["csm", "vsm"]}`` with ``each = ["method"]`` compares with
both. A group has one case for each side, or for each place of a sweep; where it has more, the answer says what tells
them apart and so belongs into ``each``.

*Verdicts.* Counters, bytes, percentages and other measures of quality are exact, and decide by themselves. Times decide
by 95 % intervals: of the ratio within each round for two times of one comparison, stages too, of all pairs of rounds
otherwise. A test whose interval lies on both sides is undecided, as is one with a case that is missing or not ok. Where
a claim makes many comparisons of times, one that fails counts only if their number does not explain it
(:func:`shadowbench.statistics.differences_among`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from shadowbench.errors import ExperimentError

Scalar = str | int | float | bool
Conditions = dict[str, "Scalar | list[Scalar]"]

COMPARISONS = ("less than", "at most", "equal to", "at least", "more than")
COURSES = ("growing", "falling", "not falling", "not growing", "constant")
POWER = "growing as a power"
CROSSINGS = ("crossing downwards", "crossing upwards")

RELATIONS = (*COMPARISONS, *COURSES, POWER, *CROSSINGS)
"""The words for ``is``."""

KEYS_OF: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(COMPARISONS, ("than", "than_value", "times", "number")),
    **dict.fromkeys(COURSES, ("over", "relative_to")),
    POWER: ("over", "at_least", "at_most"),
    **dict.fromkeys(CROSSINGS, ("over", "than")),
}
"""The keys that go with each word, besides those that go with all."""

WITH_TOLERANCE = ("equal to", "constant")
"""The words that ``within`` goes with."""


@dataclass(frozen=True)
class Test:
    """One condition of a claim; the module says what each field means, ``relation`` is the file's ``is``."""

    value: str
    relation: str
    of: Conditions = field(default_factory=dict)
    than: Conditions | None = None
    than_value: str | None = None
    times: float | None = None
    number: float | None = None
    over: str | None = None
    relative_to: Conditions | None = None
    at_least: float | None = None
    at_most: float | None = None
    within: float | None = None
    per: str | None = None
    where: Conditions = field(default_factory=dict)
    each: tuple[str, ...] = ()

    __test__ = False  # its name is not pytest's


@dataclass(frozen=True)
class Claim:
    """A statement and its tests.

    Attributes:
        name: Unique in its experiment.
        statement: What is claimed, in words of the file's author.
        source: Where; empty for the experiment's source.
        tests: All of them must hold.
    """

    name: str
    statement: str
    source: str
    tests: tuple[Test, ...]


def in_words(test: Test) -> str:
    """Return a test as a line: ``bytes_kept of esm equal to 0.5 times vsm, for each kernel``."""
    value = f"{test.value} / {test.per}" if test.per else test.value
    parts = [f"{value} of {conditions_in_words(test.of)}" if test.of else value, test.relation]
    if test.times is not None:
        parts.append(f"{test.times:g} times")
    if test.number is not None:
        parts.append(f"{test.number:g}")
    if test.than_value is not None:
        parts.append(f"{test.than_value} of" if test.than else test.than_value)
    if test.than:
        parts.append(conditions_in_words(test.than))
    if test.relative_to:
        parts.append(f"relative to {conditions_in_words(test.relative_to)}")
    parts += [f"over {test.over}"] if test.over else []
    bounds = (("at least", test.at_least), ("at most", test.at_most), ("within", test.within))
    parts += [f"{word} {bound:g}" for word, bound in bounds if bound is not None]
    more = [f"where {conditions_in_words(test.where)}"] if test.where else []
    more += [f"for each {', '.join(map(bare, test.each))}"] if test.each else []
    return ", ".join([" ".join(parts), *more])


def conditions_in_words(conditions: Mapping[str, Any]) -> str:
    """Return conditions as people say them: ``esm, kernel 5``."""
    return ", ".join(
        shown(value) if name == "method" else f"{bare(name)} {shown(value)}" for name, value in conditions.items()
    )


def bare(name: str) -> str:
    """Return a column's name as people say it: ``scene.triangles`` is ``triangles``."""
    return name.removeprefix("method.").removeprefix("scene.").replace("_", " ")


def shown(value: Any) -> str:
    """Return a condition's value, or of a list each after the other."""
    if isinstance(value, list):
        return "/".join(map(shown, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def claim_from(stored: Mapping[str, Any]) -> Claim:
    """Return the claim that a run's record holds.

    Raises:
        ExperimentError: It is not one; a newer version may have written it.
    """
    try:
        tests = tuple(_test_from(each) for each in stored["tests"])
        return Claim(str(stored["name"]), str(stored["statement"]), str(stored.get("source", "")), tests)
    except (KeyError, TypeError, ValueError) as error:
        raise ExperimentError(f"a stored claim cannot be used: {error!r}") from error


def _test_from(stored: Mapping[str, Any]) -> Test:
    known = {each.name for each in fields(Test)}
    if unknown := set(stored) - known:
        raise ValueError(f"unknown {sorted(unknown)}")
    test = Test(**{**stored, "each": tuple(stored.get("each", ()))})
    if test.relation not in RELATIONS:
        raise ValueError(f"unknown relation {test.relation!r}")
    return test
